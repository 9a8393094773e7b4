"""The site: pages that need no server, and data in files, which they load on demand.

    index.html  assets/           the pages and the libraries, the same for every site
    data/site.js                  content of the first page, the solvers, the families
    data/catalogue.js             facts on the problems, in columns
    data/files/1.js               digests, files and citations of rows 100 to 199
    data/t0.js  data/t0-cpu_s.js  statuses, and costs by a metric, at the first tolerance
    data/problems/12.js           the runs of the problem in row 12 of the catalogue
    data/views/  thumbs/          pictures; drawings.py
    pictures/SET/FAMILY/          of the catalogue
    files/                        the problems themselves, if that is asked for
    assets/browser/               the core that checks and solves them on a page; browser.py

A data file calls `Fclib.put(name, value)`: a script loads from a folder of files, JSON does not.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
import shlex
import shutil
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fclib import _core, _registry
from fclib._solve import MERITS
from fclib._verdicts import CLASSES, NEXT, SOLVED, UNSUITABLE, is_solved, rating
from fclib._words import counted
from fclib.bench import profiles
from fclib.bench.campaign import described
from fclib.bench.comparison import COMMON
from fclib.bench.plots import COLOURS
from fclib.bench.profiles import JUDGED, METRICS, PENALTY, SHIFT
from fclib.bench.table import object_in
from fclib.collections import families, ratings, read_catalog, sets
from fclib.collections.catalog import with_copies
from fclib.collections.figures import MEASURES, bins_of, is_whole
from fclib.collections.set_index import SETS, kind_of, version
from fclib.report import browser, citing, downloads, drawings
from fclib.report.error import ReportError
from fclib.report.libraries import libraries
from fclib.report.recipes import recipes
from fclib.report.runs import CODES, DIGITS, NOT_RUN, STATUSES, WEIGH, Bench, Campaigns
from fclib.report.view import ASSETS, asset, rounded

MARK = "data/site.js"  # file by which a folder is known to be a site
SCENE = "scene.png"  # picture of a family in a catalogue's folder
# scripts in the order in which a page loads them, after core.js and DataTables
SCRIPTS = (
    *(
        "table.js",
        "plot.js",
        "paper.js",
        "filter.js",
        "scene.js",
        "compare.js",
        "take.js",
        "live.js",
    ),
    *("whatif.js", "compute.js", "own.js", "parts.js", "choose.js"),
    *(f"pages/{path.name}" for path in sorted((ASSETS / "pages").glob("*.js"))),
    "site.js",
)
# column of the catalogue, label, meaning; others of a catalogue follow with their own names
COLUMNS: tuple[tuple[str, str, str], ...] = (
    ("id", "problem", "its name"),
    ("nc", "contacts", "number of contacts"),
    (
        "class",
        "class",
        "easy: solved by more than half of the solvers that take it; hard: by fewer; open: by none",
    ),
    ("n", "dof", "degrees of freedom of the bodies that contacts move"),
    ("family", "family", "the scene that it is from"),
    ("kind", "kind", "the set that its family is of first: masonry, granular, mixed, ..."),
    (
        "formulation",
        "form",
        "in the abbreviations of RT-0444: G global, M mixed, R rolling, S spin, E coupled",
    ),
    ("application", "application", "what such problems are from"),
    ("solved_by", "solved by", "share of the solvers that take it and solve it, for its class"),
    ("spacedim", "d", "components of a contact"),
    ("p", "bilateral", "bilateral constraints"),
    ("bodies", "bodies", "bodies, or trees of bodies, among which the contacts are"),
    ("density", "density", "contact components for a degree of freedom"),
    ("mu_min", "μ min", "smallest coefficient of friction"),
    ("mu_max", "μ max", "largest coefficient of friction"),
    ("nnz_W", "nnz W", "entries of W"),
    ("open", "open", "contacts without reaction in the best solution known"),
    ("stick", "stick", "sticking contacts in the best solution known"),
    ("slide", "slide", "sliding contacts in the best solution known"),
    ("status", "best known", "status with which the best solution known was found"),
    ("error", "error", "relative error of the best solution known, by both natural maps"),
    ("nsgs_sweeps", "NSGS sweeps", "that Gauss-Seidel takes to 1e-6"),
    ("rank_W", "rank W", "numerical rank of W"),
    ("rank_H", "rank H", "numerical rank of H"),
    (
        "conditioning_W",
        "conditioning W",
        "largest over smallest singular value that is no rounding",
    ),
    (
        "conditioning_H",
        "conditioning H",
        "largest over smallest singular value that is no rounding",
    ),
    ("definiteness", "definiteness", "of the symmetric part of W"),
    ("asymmetry_W", "asymmetry W", "largest entry of W - W^T over that of W"),
    ("hyperstaticity", "hyperstaticity", "contact components beyond the rank of W"),
    ("islands", "islands", "groups of contacts that nothing links"),
    ("largest_island", "largest island", "contacts of the largest group"),
    ("mass_ratio", "mass ratio", "largest over smallest trace of the blocks of W"),
    ("prestress", "prestress", "norm of r times the mean of W_kk over that of q"),
    ("slater", "Slater", "whether a velocity strictly inside K* was found"),
    ("existence", "existence", "of a solution, and by what it is proved"),
    ("uniqueness", "uniqueness", "of the velocity"),
    ("same_as", "same as", "the first problem with the same data"),
    ("trivial", "trivial", "why r = 0 solves it"),
    (
        "best_solver",
        "best solver",
        "the fastest one at the smallest tolerance at which one solves it",
    ),
    ("best_s", "best [s]", "its CPU time"),
    ("best_tol", "best at", "that tolerance"),
    ("runs", "runs", "in the stores"),
    ("solved", "solved", "runs whose recomputed error met the tolerance"),
    ("view", "view", "whether its page has a picture to turn"),
    ("thumb", "picture", "whether there is a small picture of it"),
    ("collection", "set", "the set of families"),
)
# descriptions of solvers: `fclib.bench.campaign.described`
ABOUT = {"title": str, "citation": str, "dimensions": list, "rolling": list, "options": list}
# columns of the runs of a problem, which its copies share
OF_RUNS = (
    *("runs", "solved", "class", "solved_by", "solved_of"),
    *("best_solver", "best_s", "best_tol"),
)
# columns that pages use and that stand in no table
SILENT = ("title", "number", "tol", "solver", "global_file", "local_file", "solved_of", "rows_W")
# columns of a catalogue that are of no use on a page
HIDDEN = {"digest", "global_file", "global_sha256", "local_file", "local_sha256", "number", "nnz_M"}
HIDDEN |= {"nnz_H", "solver", "tol", "license", "citation", "version", "rating"}  # class is newer


def _no_progress(what: str, done: int, total: int) -> None:
    pass


def build_site(
    campaigns: Campaigns | None,
    out: Path,
    catalogue: Path | None = None,
    *,
    views: int | None = None,
    title: str = "",
    with_files: bool = False,
    files_at: str = "",
    docs: str = "",
    module: Path | None = None,
    jobs: int | None = 1,
    progress: Callable[[str, int, int], None] = _no_progress,
) -> dict[str, int]:
    """Write the whole site; it replaces an older one.

    Args:
        campaigns: the runs; None: only a catalogue.
        out: the folder of the site.
        catalogue: a collection's folder.
        views: number of problems with a picture to turn, those with runs first, spread over
            families; None: all. Every problem has a small picture.
        title: title of the site.
        with_files: copy the problems into the site, with their reference solutions and pictures.
        files_at: an address where the folder of the collection is served, for links to it.
        docs: an address where the documentation is served, for links to it.
        module: the folder of the module for browsers, with which the pages of a site that has its
            files compute; None: that of a checkout, if it is built.
        jobs: number of processes that draw; None: one for each core.
        progress: called with the name of the work, the number done and the total.

    Returns:
        The numbers of different problems, their copies, runs, views and bytes in the site, and the
        bytes of the module.

    Raises:
        ReportError: there is nothing to show, `out` holds other files, or a library is not
            installed.
        fclib.collections.CatalogError: the catalogue cannot be read.
    """
    if campaigns is None and catalogue is None:
        raise ReportError("a report needs a store, a catalogue, or both")
    if out.is_symlink() and not out.exists():
        raise ReportError(f"{out}: is a link, and there is nothing where it leads")
    if out.exists() and not (out / MARK).is_file() and (not out.is_dir() or any(out.iterdir())):
        raise ReportError(f"{out}: is there, and is no site that fclib report has made")
    if module is not None and not with_files:
        raise ReportError("the module computes with a site's own files: say --with-files")
    found = browser.find(module) if with_files else None
    problems = Problems(campaigns, catalogue)
    out.parent.mkdir(parents=True, exist_ok=True)
    part = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    try:
        offered = downloads.Downloads(part, problems.folder, with_files, files_at)
        writer = _Writer(part, campaigns, problems, views, title, progress, offered, jobs)
        writer.docs = docs.rstrip("/")
        writer.module = found
        counts = writer.write()
        part.chmod(0o755)
        if out.exists():
            old = Path(tempfile.mkdtemp(prefix=f".{out.name}-old-", dir=out.parent))
            out.rename(old / "site")
            part.rename(out)
            shutil.rmtree(old)
        else:
            part.rename(out)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return counts


# ---- problems


class Problems:
    """The problems of the catalogue and those of the stores, one row each."""

    def __init__(self, campaigns: Campaigns | None, catalogue: Path | None) -> None:
        """Raises CatalogError if the catalogue cannot be read."""
        self.rows: list[dict[str, Any]] = []
        self.files: list[Path | None] = []  # file from which a problem may be read
        self.digests: list[str] = []  # of the data
        self.places: dict[str, int] = {}  # by the hash of a store
        self.folder = None
        if catalogue is not None:
            self.folder = catalogue if catalogue.is_dir() else catalogue.parent
            self.rows = with_copies(read_catalog(catalogue).to_pylist())
            for row in self.rows:
                self.files.append(self.folder / (row["global_file"] or row["local_file"]))
                self.digests.append(row["digest"])
        if campaigns is not None:
            self._add_runs(campaigns)
        known = families()
        for row in self.rows:
            family = known.get(kind_of(f"{row.get('collection')}/{row['family']}"))
            row["kind"] = family.collection if family else row.get("collection")
            row["application"] = family.application if family else None
            row["rows_W"] = row["nc"] * row["spacedim"]
            if not row["formulation"].startswith("G"):
                # a local problem does not know its bodies
                row |= {"n": None, "density": None}
        self.ratings = self._rate()

    def share(self) -> None:
        """Give what the runs say of a problem to its copies too."""
        rows = {row["id"]: row for row in self.rows}
        for row in self.rows:
            if row.get("same_as"):
                row |= {key: rows[row["same_as"]].get(key) for key in OF_RUNS}

    def _rate(self) -> dict[str, Any]:
        """The class of each problem from stored runs, and its basis, by set."""
        found: dict[str, Any] = {}
        rated: dict[str, ratings.RatedProblem] = {}
        named = {str(row.get("collection")) for row in self.rows} | {ratings.FIRST}
        own_digests = set(self.digests)
        for name in sorted(named & set(sets())):
            try:
                rows, basis = ratings.ratings_of(name)
            except (ratings.RatingError, OSError):
                continue  # the package of stored runs is not here
            of_here = {row.digest: row for row in rows if row.rating and row.digest in own_digests}
            if basis is not None and of_here:
                found[name] = (rows, basis)
                rated |= of_here
        for row, digest in zip(self.rows, self.digests, strict=True):
            own = rated.get(digest)
            if own is not None:
                row |= rated_as(own.rating, own.solved, own.voters)
        return found

    def _add_runs(self, campaigns: Campaigns) -> None:
        # of equal problems the first has the runs of all
        digests = {row["digest"]: k for k, row in reversed(list(enumerate(self.rows)))}
        names = {
            row[key]: k
            for k, row in enumerate(self.rows)
            for key in ("global_file", "local_file")
            if row[key]
        }
        taken = {row["id"] for row in self.rows}
        for digest, facts in campaigns.problems().items():
            path = Path(facts["path"] or "")
            place = self.places.get(facts["same_as"] or "")
            if place is None:
                # also by its file: at rest two steps may be equal
                place = names.get("/".join(path.parts[-3:]))
                if place is not None and not _is_of(self.rows[place], digest, facts):
                    place = None
                elif place is not None and self.rows[place]["same_as"]:
                    place = digests[self.rows[place]["digest"]]
            if place is None:
                place = digests.get(digest)
            if place is None:
                name = f"{facts['family']}/{facts['problem'].rpartition('/')[2]}"
                if name in taken:
                    name = f"{name}-{digest[:8]}"
                taken.add(name)
                place = len(self.rows)
                known = {key: value for key, value in facts.items() if key != "same_as"}
                # of a global problem the entries of M are known
                entries = None if facts["formulation"].startswith("G") else facts["nnz"]
                self.rows.append({**known, "id": name, "digest": digest, "nnz_W": entries})
                self.files.append(path)
                self.digests.append(digest)
            self.places[digest] = place

    def columns(self) -> list[dict[str, Any]]:
        """The nonempty columns, with the values of all rows."""
        known = {name for name, *_ in COLUMNS}
        more = sorted({key for row in self.rows for key in row} - known - HIDDEN)
        more = [
            key
            for key in more
            if key not in ("problem", "path", "nnz", "step", "time", "seed", *SILENT)
        ]
        found = []
        for name, label, doc in (*COLUMNS, *((key, key.replace("_", " "), "") for key in more)):
            values = [row.get(name) for row in self.rows]
            if any(value not in (None, "", False) for value in values):
                found.append({"key": name, "label": label, "doc": doc, **_packed(values)})
        for name in SILENT:
            values = [row.get(name) for row in self.rows]
            if any(value is not None for value in values):
                found.append({"key": name, "hidden": True, **_packed(values)})
        return found


def _is_of(row: Mapping[str, Any], digest: str, facts: Mapping[str, Any]) -> bool:
    """Whether the problem of a run is one of a catalogue whose file is at the same place.

    A global form is known by its digest in the catalogue. A local form has none there, and is known
    by its family and sizes.
    """
    if row["digest"] == digest:
        return True
    same = all(row[key] == facts[key] for key in ("family", "nc", "p", "spacedim"))
    return same and str(row["formulation"]) == f"G{facts['formulation']}"


def rated_as(name: str, solved: int, voters: int) -> dict[str, Any]:
    """The class of a problem, and how many of the solvers that take it solve it."""
    return {
        "class": name,
        "solved_by": solved / voters,
        "solved_of": f"{solved} of {counted(voters, 'solver')}",
    }


def law_of(formulation: str) -> str:
    """The law of contact of a formulation (RT-0444's abbreviations), in words."""
    found = re.fullmatch(r"G?(S?)(E?)(R?)(M?)([23])DFC", formulation)
    if found is None:
        return formulation
    spin, coupled, rolling, mixed, space = found.groups()
    others = [name for name, there in (("spin", spin), ("rolling", rolling)) if there]
    words = "Coulomb friction" + (f" and {' and '.join(others)} friction" if others else "")
    words += ", coupled" if coupled else ""
    place = "in the plane" if space == "2" else "in space"
    return f"{words} {place}{', with joints' if mixed else ''} ({formulation})"


def _packed(values: Sequence[Any]) -> dict[str, Any]:
    """A column; repeated words are stored once."""
    if any(isinstance(value, str) for value in values):
        words = list(dict.fromkeys(value for value in values if value is not None))
        if len(words) < len(values) / 2:
            number = {word: k for k, word in enumerate(words)}
            return {"words": words, "values": [number.get(value, -1) for value in values]}
    return {"values": rounded(list(values), DIGITS)}


# ---- pages


class _Writer:
    """Writes the files of a site into an empty folder."""

    def __init__(
        self,
        folder: Path,
        campaigns: Campaigns | None,
        problems: Problems,
        views: int | None,
        title: str,
        progress: Callable[[str, int, int], None],
        offered: downloads.Downloads,
        jobs: int | None,
    ) -> None:
        self.downloads = offered
        self.jobs = jobs
        self.docs = ""
        self.module: Path | None = None
        self.folder = folder
        self.campaigns = campaigns
        self.problems = problems
        self.views = views
        self.title = title
        self.progress = progress
        self.bytes = 0

    def put(self, name: str, value: Any) -> None:
        self.bytes += drawings.put(self.folder, name, value)

    def write(self) -> dict[str, int]:
        for name in ("style.css", "core.js", *SCRIPTS):
            target = self.folder / "assets" / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ASSETS / name, target)
        scripts = (f'<script src="assets/{name}"></script>' for name in ("tables.js", *SCRIPTS))
        page = asset("index.html").replace("<!--SCRIPTS-->", "\n".join(scripts))
        (self.folder / "index.html").write_text(page, encoding="utf-8")
        formulations = {row["formulation"] for row in self.problems.rows}
        site: dict[str, Any] = {
            "title": self.title or "Frictional contact problems",
            "version": _core.version,
            "docs": self.docs,
            "metrics": {name: label for name, (label, _) in METRICS.items()},
            "statuses": [[CODES[k], *item] for k, item in enumerate(STATUSES.items())],
            "solved": list(SOLVED),
            "common": COMMON,
            "weigh": WEIGH,
            "merits": described_merits(),
            "next": dict(NEXT),
            "charges": {"penalty": PENALTY, "shift": SHIFT},
            "laws": {name: law_of(name) for name in sorted(formulations)},
            "tolerances": [],
            "headlines": [],
            "solvers": [],
            "libraries": self._libraries(),
        }
        if self.campaigns is not None:
            site |= self._runs(self.campaigns)
        else:
            site["solvers"] = [_own(info) for info in _registry.solvers()]
        views, steps = self._views()
        site["families"] = self._families(steps)
        site["views"] = views
        site["ratings"] = _records_of_classes(self.problems, self.campaigns)
        named = {row.get(key) for row in self.problems.rows for key in ("collection", "kind")}
        site["sets"] = {
            name: {"version": version(name), "bibtex": citing.set_of_problems(name)}
            for name in sorted(SETS.keys() & named)
        }
        site["colours"] = list(COLOURS)
        site["cite"] = {"collection": citing.collection(), "problem": citing.problem()}
        site |= _numbers(self.problems.rows)
        site["recipes"] = recipes(sorted(formulations))
        site["files"] = self.downloads.kind
        site["module"] = browser.copy(self.module, self.folder) if self.module else 0
        if self.module:
            site["libraries"].append(browser.READER)
        for first in range(0, len(self.problems.rows), downloads.CHUNK):
            rows = self.problems.rows[first : first + downloads.CHUNK]
            self.put(
                f"files/{first // downloads.CHUNK}", [self.downloads.record(row) for row in rows]
            )
        self.put("catalogue", {"size": len(self.problems.rows), "columns": self.problems.columns()})
        self.put("site", site)
        return {
            **_numbers(self.problems.rows),
            "runs": len(self.campaigns.rows) if self.campaigns is not None else 0,
            "views": views,
            "bytes": self.bytes,
            "module": site["module"],
        }

    def _libraries(self) -> list[dict[str, str]]:
        found = []
        for library in libraries():
            for name, text in library.files.items():
                (self.folder / "assets" / name).write_text(text, encoding="utf-8")
            licence = self.folder / library.licence_file
            licence.parent.mkdir(exist_ok=True)
            licence.write_text(library.notices, encoding="utf-8")
            found.append(library.record)
        return found

    def _runs(self, campaigns: Campaigns) -> dict[str, Any]:
        total = len(campaigns.tolerances)
        best: dict[int, tuple[str, float, float]] = {}
        headlines = []
        for t, tol in enumerate(campaigns.tolerances):
            self.progress("tolerances", t, total)
            bench = campaigns.bench(tol)
            self._put_bench(t, bench)
            headlines.append(campaigns.headline(tol, self.problems.places))
            # tolerances fall: the result at a smaller one replaces the former
            best |= self._best(bench, campaigns.solvers)
        self.progress("tolerances", total, total)
        self._rate(campaigns)
        for place, (solver, seconds, tol) in best.items():
            self.problems.rows[place] |= {"best_solver": solver, "best_s": seconds, "best_tol": tol}
        by_place: dict[int, list[dict[str, Any]]] = defaultdict(list)
        for digest, runs in campaigns.by_problem():
            by_place[self.problems.places[digest]] += runs
        for done, (place, runs) in enumerate(by_place.items()):
            self.progress("problems", done, len(by_place))
            self.put(f"problems/{place}", runs)
            solved = sum(is_solved(run["status"]) for run in runs)
            self.problems.rows[place] |= {"runs": len(runs), "solved": solved}
        self.progress("problems", len(by_place), len(by_place))
        self.problems.share()
        # if a solver also ran before stores kept descriptions, take the later one
        _, places = campaigns.rows.numbers("solver", "about")
        kinds = list(campaigns.rows.where(places))
        first = {row["solver"]: row for row in kinds if row["about"]}
        first = {row["solver"]: row for row in kinds} | first
        return {
            "overview": campaigns.overview(),
            "tolerances": campaigns.tolerances,
            "judged": JUDGED[campaigns.rows.row(0)["merit"]],
            "headlines": headlines,
            "work": rounded(
                profiles.work_precision(campaigns.rows, campaigns.costs, weigh=WEIGH), DIGITS
            ),
            "solvers": _with_own_keys([_solver(name, first[name]) for name in campaigns.solvers]),
        }

    def _put_bench(self, t: int, bench: Bench) -> None:
        places = [self.problems.places[instance.hash] for instance in bench.instances]
        limits = [rounded(instance.limit) for instance in bench.instances]
        statuses = list(bench.statuses)
        absent = [NOT_RUN, CODES[list(STATUSES).index(UNSUITABLE)]]  # there is no such cell
        known = {"problems": places, "limits": limits, "statuses": statuses, "absent": absent}
        self.put(f"t{t}", known)
        for metric, columns in bench.costs.items():
            self.put(f"t{t}-{metric}", columns)

    def _best(self, bench: Bench, solvers: Sequence[str]) -> dict[int, tuple[str, float, float]]:
        found: dict[int, tuple[str, float, float]] = {}
        for i, instance in enumerate(bench.instances):
            costs = [(column[i], k) for k, column in enumerate(bench.costs["cpu_s"])]
            solved = [(value, k) for value, k in costs if value is not None]
            if solved:
                value, k = min(solved)
                place = self.problems.places[instance.hash]
                if place not in found or value < found[place][1]:
                    found[place] = (solvers[k], value, bench.tol)
        return found

    def _rate(self, campaigns: Campaigns) -> None:
        """The class of problems without stored runs, by these runs at the smallest tolerance."""
        tol = campaigns.tolerances[-1]
        costs = campaigns.every.at(tol)
        for instance, cells, there in zip(costs.instances, costs.solved, costs.there, strict=True):
            row = self.problems.rows[self.problems.places[instance.hash]]
            solved, voters = int(cells.sum()), int(there.sum())
            if row.get("class") or not voters:
                continue
            found = rating(solved, voters)
            best = campaigns.least_errors.get(instance.hash)
            if found == "open" and best and best[0] <= tol:
                found = "hard"  # a solution is known, which came too late; as in the collection
            row |= rated_as(found, solved, voters)

    def _views(self) -> tuple[int, dict[tuple[str, str], list[int]]]:
        """Draw all problems. Return the number of views, and the steps of each family."""
        rows, files = self.problems.rows, self.problems.files
        there = [k for k, file in enumerate(files) if file is not None and file.is_file()]
        originals = [k for k in there if not rows[k].get("same_as")]  # copies show theirs
        chosen = set(there if self.views is None else _spread(originals, rows, self.views))
        tasks = []
        for k in there:
            file = files[k]
            assert file is not None
            tasks.append(drawings.Task(k, file, k in chosen, self.downloads.picture(rows[k])))
        found = []
        for done, one in enumerate(drawings.draw_all(self.folder, tasks, self.jobs)):
            self.progress("pictures", done + 1, len(tasks))
            self.bytes += one.bytes
            rows[one.place] |= {"view": one.view, "thumb": one.thumb}
            found.append(one)
        steps, size = drawings.sequences(self.folder, found, rows)
        self.bytes += size
        return sum(one.view for one in found), steps

    def _families(self, steps: Mapping[tuple[str, str], list[int]]) -> list[dict[str, Any]]:
        known = families()
        groups: dict[tuple[str, str], list[int]] = defaultdict(list)
        for k, row in enumerate(self.problems.rows):
            groups[row.get("collection") or "", row["family"]].append(k)
        # a problem that the catalogue lacks is placed beside its family
        for _, name in [key for key in groups if not key[0]]:
            others = [key for key in groups if key[0] and key[1] == name]
            if others:
                groups[others[0]] += groups.pop(("", name))
        found = []
        for (collection, name), places in sorted(groups.items()):
            rows = [self.problems.rows[k] for k in places]
            record: dict[str, Any] = {"name": name, "set": collection, **_numbers(rows)}
            record["ranges"] = {
                key: [min(values), max(values)]
                for key in ("nc", "n", "density", "mu_max")
                if (values := [row[key] for row in rows if row.get(key) is not None])
            }
            record["ranges"] = rounded(record["ranges"])
            record["formulations"] = sorted({row["formulation"] for row in rows})
            record["kind"] = rows[0]["kind"] or ""
            record["version"] = rows[0].get("version")
            record["citation"] = rows[0].get("citation")
            if (collection, name) in steps:
                record["steps"] = steps[collection, name]
            kind = kind_of(f"{collection}/{name}")
            if kind in known:
                record |= _family(known[kind])
            record["bibtex"] = citing.family(record)
            shown = [k for k in places if self.problems.rows[k].get("thumb")]
            if shown:
                record["thumb"] = f"thumbs/{shown[len(shown) // 2]}.webp"
            source = self.problems.folder / collection / name if self.problems.folder else None
            if source and (source / SCENE).is_file():
                record["scene"] = f"pictures/{collection}/{name}/{SCENE}"
                target = self.folder / record["scene"]
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source / SCENE, target)
            record["histograms"] = _histograms(rows)
            found.append(record)
        # pictures first
        return sorted(found, key=lambda one: "scene" not in one and "thumb" not in one)


def described_merits() -> list[list[str | None]]:
    """The names of all merits, and their meanings."""
    return [[name, inspect.getdoc(getattr(_core.Merit, name))] for name in MERITS]


def _histograms(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """How the measures of a family are distributed over its different problems."""
    rows = list({row.get("same_as") or row["id"]: row for row in rows}.values())
    found = []
    for key, _ in MEASURES:
        values = [row[key] for row in rows if row.get(key) is not None]
        if values:
            edges, counts = bins_of(values)
            record = {"key": key, "integer": is_whole(values)}
            found.append(record | {"edges": rounded(edges, DIGITS), "counts": counts.tolist()})
    return found


def _numbers(rows: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    """How many different problems there are, and how many copies of these or of others.

    `Fclib.tally` of the pages counts the same in what a reader has chosen.
    """
    copies = sum(bool(row.get("same_as")) for row in rows)
    return {"problems": len(rows) - copies, "copies": copies}


def _records_of_classes(problems: Problems, campaigns: Campaigns | None) -> list[dict[str, Any]]:
    """The content of the page of classes: by set, and of problems that only these runs rate."""
    found = []
    places = {digest: k for k, digest in reversed(list(enumerate(problems.digests))) if digest}
    published: set[int] = set()
    for name, (rows, basis) in problems.ratings.items():
        here = {places[row.digest]: row for row in rows if row.digest in places and row.rating}
        published |= here.keys()
        open_ones = [
            {"problem": problems.rows[k]["id"], "name": row.id}
            | ({"error": run.error, "by": run.solver, "date": run.date} if run else {})
            for k, row in here.items()
            if row.rating == "open"
            for run in [row.best]
        ]
        known = {"set": name, "basis": str(basis), "published": True, "open": _sorted(open_ones)}
        found.append(known | {"families": _classes(problems, here)})
    own = [k for k, row in enumerate(problems.rows) if row.get("class") and k not in published]
    own = [k for k in own if not problems.rows[k].get("same_as")]
    if own and campaigns is not None:
        tol = campaigns.tolerances[-1]
        best = {problems.places[key]: run for key, run in campaigns.least_errors.items()}
        open_ones = [
            {"problem": problems.rows[k]["id"]}
            | ({"error": best[k][0], "by": best[k][1]} if k in best else {})
            for k in own
            if problems.rows[k]["class"] == "open"
        ]
        basis = f"to {tol:g}, by the runs of this report"
        known = {"set": "this report", "basis": basis, "published": False}
        found.append(known | {"open": _sorted(open_ones), "families": _classes(problems, own)})
    return list(rounded(found, DIGITS))


def _sorted(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Open problems, the best errors first; last those of which no solver returned anything."""
    return sorted(found, key=lambda one: one.get("error", math.inf))


def _classes(problems: Problems, places: Iterable[int]) -> list[dict[str, Any]]:
    """How many problems of each family are of each class."""
    counts: dict[str, dict[str, int]] = {}
    for k in places:
        row = problems.rows[k]
        counts.setdefault(row["family"], dict.fromkeys(CLASSES, 0))[row["class"]] += 1
    return [{"family": family, **own} for family, own in sorted(counts.items())]


def _spread(there: Sequence[int], rows: Sequence[Mapping[str, Any]], count: int) -> list[int]:
    """A number of the rows: those with runs first, evenly over and within families."""
    chosen: list[int] = []
    for wanted in (True, False):
        families: dict[str, list[int]] = defaultdict(list)
        for k in there:
            if bool(rows[k].get("runs")) == wanted:
                families[rows[k]["family"]].append(k)
        left = count - len(chosen)
        waiting = sorted(families.values(), key=len)
        for k, own in enumerate(waiting):
            share = min(len(own), math.ceil(left / (len(waiting) - k)))
            chosen += [own[(2 * i + 1) * len(own) // (2 * share)] for i in range(share)]
            left -= share
    return sorted(chosen)


def _family(family: Any) -> dict[str, Any]:
    """The description of a family of scenes."""
    return {
        "title": family.title,
        "description": family.description,
        "text": (inspect.getdoc(family) or "").split("\n\n")[1:],
        "application": family.application,
        "friction": family.friction,
        "authors": family.authors,
        "parameters": [
            [item.name, str(item.default), item.metadata["unit"], item.metadata["doc"]]
            for item in dataclasses.fields(family)
        ],
    }


def _solver(label: str, row: Mapping[str, Any]) -> dict[str, Any]:
    """The facts on a solver from its description in the store: no name is looked up here."""
    about = object_in(row["about"])
    if not all(isinstance(about.get(key), kind) for key, kind in ABOUT.items()):
        about = {}  # the store was made before solvers had descriptions, or was edited
    name, title, citation = row["solver_name"], about.get("title", ""), about.get("citation", "")
    found: dict[str, Any] = {"label": label, "name": name}
    found |= {key: row[key] for key in ("options", "version", "origin")}
    found["family"] = row["solver_family"]
    origin, version = found["origin"] or "fclib", found["version"] or _core.version
    found["bibtex"] = citing.implementation(name, title, f"{origin} {version}")
    found["cite"] = citing.of_solver(name, title, citation, origin, version)
    found["use"] = _use(name, object_in(row["options"]))
    if not about:
        return found
    found["papers"] = citing.papers_of(about["citation"])
    found |= {key: about[key] for key in ("title", "citation", "dimensions", "rolling")}
    found["spin"] = about.get("spin", [])  # stores of earlier versions have none
    return found | {"known": about["options"]}


def _with_own_keys(solvers: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The solvers; what they cite together has one key for each entry."""
    cites = citing.distinct([one["cite"] for one in solvers])
    return [{**one, "cite": cite} for one, cite in zip(solvers, cites, strict=True)]


def _use(name: str, options: Mapping[str, Any]) -> list[str]:
    """Lines that run a solver with these options, from a shell and from Python."""
    text = " ".join([name, *(f"{key}={value}" for key, value in options.items())])
    more = "".join(f", {key}={value!r}" for key, value in options.items())
    return [
        f"fclib solve --solver {shlex.quote(text)} FILE",
        f'result = fclib.solve(problem, solver="{name}", tol=1e-8{more})',
    ]


def _own(info: _core.SolverInfo) -> dict[str, Any]:
    """The description of an installed solver, as if it had been run."""
    return _solver(
        info.name,
        {
            "solver_name": info.name,
            "solver_family": info.family,
            "origin": info.origin,
            "version": "",
            "options": "{}",
            "about": described(info),
        },
    )
