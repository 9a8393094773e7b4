"""The stored solutions of a collection, by `fclib check` and by `fclib collection verify`.

    python -m workshop.tables.references FOLDER [--results references]

The two commands are run on all files of FOLDER, as `fclib collection build` wrote them. They agree
on a file if verify takes it exactly where check finds a solution in it, or a reason why it has
none. The exit status is 1 if they differ on a file, or if the build is not finished; each is
printed.

A solution is certified if a second, unrelated algorithm has found the same velocities
(`fclib collection build --certify`); a file says why its one is not.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

from workshop.tables import _results

MARKED = "no solution"  # what check says of a file that says why it has none
MANY = 200  # files of one command


def told(*words: str) -> list[dict[str, Any]]:
    """What a command of ours prints for each file."""
    command = [sys.executable, "-m", "fclib", *words, "--json"]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


def checked(folder: Path) -> dict[str, dict[str, Any]]:
    """What `fclib check` says of all files below a folder, by their paths in it."""
    paths = sorted(map(str, folder.rglob("*.hdf5")))
    found = {}
    for k in range(0, len(paths), MANY):
        for row in told("check", *paths[k : k + MANY]):
            found[str(Path(row["problem"]).relative_to(folder))] = row
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path)
    _results.add_option(parser)
    given = parser.parse_args()
    check = checked(given.folder)
    verify = {
        row["problem"]: row["status"] for row in told("collection", "verify", str(given.folder))
    }
    if not check:
        parser.error(f"{given.folder}: fclib check reads no file there")
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    wrong = [f"{path}: {status}, and check has not read it" for path, status in verify.items()
             if path not in check]  # fmt: skip
    for path, row in check.items():
        own, says = counts[path.split("/")[0]], row.get("says") or {}
        status, other = row.get("status", "unreadable"), verify.get(path, "not named")
        right = status in ("ok", MARKED)
        if right != (other == "ok"):
            wrong.append(f"{path}: check says {status}, verify says {other}")
        own["files"] += 1
        own["ok"] += status == "ok"
        own["to 1e-12"] += status == "ok" and row["error"] <= 1e-12
        own["certified"] += status == "ok" and says.get("certified") == "yes"
        own["have none, with the reason"] += status == MARKED
        own["others"] += not right
        own["verify differs"] += right != (other == "ok")
    print(*wrong, sep="\n")
    columns = list(next(iter(counts.values())))
    rows = [{"set": name} | {k: own[k] for k in columns} for name, own in sorted(counts.items())]
    print(_results.table(["set", *columns], rows))
    if given.results:
        note = "A file is one form of a problem: global, or local. Judged by both merits, to 1e-8."
        title = "Stored solutions by fclib check and fclib collection verify"
        command = "python -m workshop.tables.references FOLDER --results references"
        print(_results.store(given.results, rows, title=title, note=note, command=command))
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
