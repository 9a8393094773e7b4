"""What the site of the whole set `extended` costs, from a part of it: size, and time to open it.

    python -m workshop.tables.report_extended COLLECTION [--problems N] [--keep FOLDER]
        [--results NAME]

COLLECTION is a built folder with some problems of each family, `standard` for one. Each is drawn,
and the bytes of its view and its small picture are counted; a family of `extended` has as many
problems as it has, each of the mean size of those drawn. The catalogue that is opened has all rows,
each with a small picture. `--results NAME` stores two tables, NAME of the size and NAME-pages of
the times.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from collections import defaultdict
from pathlib import Path
from statistics import mean
from typing import Any

from fclib.collections import catalog, families, read_catalog, sets
from fclib.report import build_site
from fclib.report.view import as_json
from workshop.tables import _results
from workshop.tables.report_size import CATALOGUE, REPEATS, open_pages

MARKS = {name: (f"#/{name}", "main h1") for name in ("overview", CATALOGUE)}
FILTERS = ("masonry contacts > 50 class = hard", "masonry contacts > 50 class = hard arch")


def sizes(site: Path, rows: list[dict[str, Any]]) -> dict[str, float]:
    """Mean bytes of view and picture of a problem of each family."""
    found: dict[str, list[int]] = defaultdict(list)
    for place, row in enumerate(rows):
        paths = (site / "data" / "views" / f"{place}.js", site / "thumbs" / f"{place}.webp")
        found[row["family"]].append(sum(path.stat().st_size for path in paths if path.is_file()))
    return {family: mean(own) for family, own in found.items()}


def many(rows: list[dict[str, Any]], count: int) -> list[dict[str, Any]]:
    """So many rows, of the given ones in turn, each with a name of its own and without files."""
    nothing = dict.fromkeys(("global_file", "local_file", "global_sha256", "local_sha256"))
    found = []
    for k in range(count):
        row = rows[k % len(rows)]
        name = f"extended/{row['family']}/{k:05d}"
        found.append({**row, **nothing, "id": name, "number": k, "local_file": f"{name}.hdf5"})
    return found


def main() -> None:
    """Measure, and print a line for each figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("collection", type=Path)
    parser.add_argument("--problems", type=int, help="rows; by default as many as the set has")
    parser.add_argument("--keep", type=Path, help="a folder for the site of the part")
    _results.add_option(parser)
    options = parser.parse_args()
    rows = read_catalog(options.collection).to_pylist()
    known = families()
    wanted = {name: known[name].problems for name in (f.split("/")[1] for f in sets()["extended"])}
    total = options.problems or sum(wanted.values())
    with tempfile.TemporaryDirectory() as folder:
        part = options.keep or Path(folder) / "part"
        if not part.is_dir():
            build_site(None, part, options.collection)
        each = sizes(part, rows)
        bytes_ = sum(count * each.get(name, mean(each.values())) for name, count in wanted.items())
        lacking = [name for name in wanted if name not in each]
        size = {
            "problems": sum(wanted.values()),
            "drawn for it": len(rows),
            "families drawn": len(wanted) - len(lacking),
            "families": len(wanted),
            "views and pictures [MB]": bytes_ / 1e6,
        }
        print(_results.table(list(size), [size]))
        base = Path(folder) / "many"
        base.mkdir()
        catalog.write_catalog(base / catalog.FILE, many(rows, total))
        site = Path(folder) / "site"
        build_site(None, site, base, views=0)
        (site / "thumbs").mkdir(exist_ok=True)
        pictures = sorted((part / "thumbs").iterdir())
        for k in range(total):
            shutil.copyfile(pictures[k % len(pictures)], site / "thumbs" / f"{k}.webp")
        (site / "data" / "catalogue.js").write_text(with_pictures(site, total), encoding="utf-8")
        pages = [
            {"what": name, "CPU [s]": cpu, "clock [s]": seconds}
            for name, (seconds, cpu) in open_pages(site, MARKS, "filter", FILTERS).items()
        ]
    print(_results.table(list(pages[0]), pages))
    if options.results:
        others = f" By the mean of all others: {', '.join(lacking)}." if lacking else ""
        _results.store(
            options.results,
            [size],
            title="The site of the set extended",
            note=f"Each family's problems are taken as large as those drawn of it.{others}",
        )
        _results.store(
            f"{options.results}-pages",
            pages,
            title=f"A catalogue of {total} problems with small pictures",
            note=f"The least of {REPEATS} times or more, in Chromium without a graphics card, "
            "since other programs may use the machine.",
        )


def with_pictures(site: Path, total: int) -> str:
    """The catalogue's data, with a picture in each row: a line more."""
    text = (site / "data" / "catalogue.js").read_text(encoding="utf-8")
    column = {"key": "thumb", "label": "picture", "doc": "", "values": [True] * total}
    # the data are a promise if they are compressed
    return text + (
        "Fclib.values.catalogue = Promise.resolve(Fclib.values.catalogue).then((known) => {"
        f" known.columns.push({as_json(column)}); return known; }});\n"
    )


if __name__ == "__main__":
    main()
