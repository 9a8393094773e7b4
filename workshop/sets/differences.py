"""Why figures of our sets are others than the published ones: contacts, bodies, conditioning.

    .venv/bin/python -m workshop.sets.differences closed DIR SET/FAMILY... [--results NAME]
    .venv/bin/python -m workshop.sets.differences untouched DIR SET/FAMILY... --files FILES
        [--results NAME]
    .venv/bin/python -m workshop.sets.differences lighter DIR SET/FAMILY... [--results NAME]

DIR has the built families. `closed` counts in problems of each, evenly spread, all contacts, those
that are closed (their gap is at most zero), those that are open by at most a third of the largest
gap, and those that carry a reaction (none are counted if no solution was found). If all contacts
are on one face, it counts those inside the rectangle around them too. Minutes of CPU.

`untouched` takes the list of the published files, whose names have contacts and degrees of freedom:
a problem with fewer ends of contacts than bodies has bodies that nothing touches. It prints the
bodies of a problem with a given number of contacts, in the published set and in ours.

`lighter` finds the conditioning of W of elastic bodies, of the first stored state, as it is and
with an eighth of the mass.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import scipy.sparse as sp

import fclib
from fclib.collections import published as stored
from fclib.collections import set_index as versions
from fclib.collections import trajectory
from workshop.sets import collection_table
from workshop.tables import _results
from workshop.tables.published_beside_ours import sets

SAMPLE: Final = 20  # problems of a family
TOLERANCE: Final = 1e-8
SECONDS: Final = 60.0
FLAT: Final = 1e-6  # [1] normals that differ by less are those of one face
CARRIES: Final = 1e-6  # a normal reaction above this share of the largest one
SHARES: Final = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the published problems, by their contacts

# title and note of each table
TOLD: Final = {
    "closed": (
        "Contacts of the decks: all, closed, and those that carry",
        f"Up to {SAMPLE} problems of each; auto to {TOLERANCE:g}, at most {SECONDS:g} s.",
    ),
    "untouched": (
        "Bodies of the published chutes and of ours, at the same contacts",
        "Quarters of the published problems by their contacts.",
    ),
    "lighter": (
        "Conditioning of W of elastic cubes, with the mass and with an eighth of it",
        "All contacts of the first stored state.",
    ),
}


def published_of(name: str) -> list[dict[str, str]]:
    """The published sets that SET/FAMILY stands beside."""
    return [row for row in sets() if name in row["ours"].split()]


def problems(folder: Path, name: str, count: int | None) -> Iterator[Any]:
    """The problems of a built family, all or so many. SystemExit if there is none."""
    files = sorted((folder / name).glob("*-global.hdf5"))
    if not files:
        raise SystemExit(f"{folder / name}: no problem; fclib collection build {name} makes them")
    places = np.linspace(0, len(files) - 1, min(count or len(files), len(files)))
    for place in np.unique(np.rint(places).astype(int)).tolist():
        yield fclib.read(files[place])


def inside(contacts: Any) -> int | None:
    """How many are inside the rectangle around all; None if these are on several faces."""
    normals = np.reshape(contacts.normal, (-1, 3))
    points = np.reshape(contacts.point, (-1, 3))
    axis = int(np.abs(normals[0]).argmax())
    apart = np.ptp(points @ normals[0])
    if np.ptp(normals, axis=0).max() > FLAT or apart > FLAT * np.ptp(points, axis=0).max():
        return None
    places = np.delete(points, axis, axis=1)
    margin = FLAT * np.ptp(places, axis=0)
    low, high = places.min(axis=0) + margin, places.max(axis=0) - margin
    return int(((places > low) & (places < high)).all(axis=1).sum())


def counted(problem: Any) -> dict[str, int | None]:
    """The contacts of a problem: all, and kinds of them; None if a kind is not known."""
    gap = np.asarray(problem.contacts.gap)
    found = fclib.solve(problem, tol=TOLERANCE, time_limit=SECONDS)
    normal = np.reshape(found.solution.r, (problem.nc, -1))[:, 0]
    return {
        "contacts": problem.nc,
        "closed": int((gap <= 0).sum()),
        "open by at most a third": int((gap <= gap.max() / 3).sum()),
        "that carry": int((normal > CARRIES * normal.max()).sum()) if found.converged else None,
        "inside the face": inside(problem.contacts),
    }


def closed(folder: Path, name: str) -> Iterator[dict[str, str]]:
    """The row of a family."""
    rows = [counted(problem) for problem in problems(folder, name, SAMPLE)]
    spans = {key: collection_table.span(row[key] for row in rows) for key in rows[0]}
    theirs = ", ".join(row["contacts"] for row in published_of(name))
    yield {"set": name, "problems": str(len(rows)), "published contacts": theirs, **spans}


def untouched(folder: Path, name: str, files: Path) -> Iterator[dict[str, str]]:
    """Published problems beside those of ours with the nearest number of contacts."""
    begins = tuple(row["files"] for row in published_of(name) if row["files"])
    with files.open(newline="", encoding="utf-8") as file:
        listed = sorted(
            (int(row["contacts"]), int(row["dof"]) // 6)
            for row in csv.DictReader(file)
            if f"{row['set']}/{row['file']}".startswith(begins) and row["dof"] and row["contacts"]
        )
    if not listed:
        raise SystemExit(f"{files}: has no file of the published set that {name} stands beside")
    ours = sorted((problem.nc, problem.n // 6) for problem in problems(folder, name, None))
    for share in SHARES:
        contacts, bodies = listed[round(share * (len(listed) - 1))]
        own_contacts, own_bodies = min(ours, key=lambda own: abs(own[0] - contacts))
        yield {
            "set": name,
            "published contacts": str(contacts),
            "published bodies": str(bodies),
            "of them untouched, at least": str(max(0, bodies - 2 * contacts)),
            "our contacts": str(own_contacts),
            "our bodies": str(own_bodies),
        }


def lighter(name: str) -> Iterator[dict[str, str]]:
    """The row of an elastic family: W = H^T (s M + (h theta)^2 K)^-1 H for two shares s."""
    path = stored.path_of(name, versions.version_of(name))
    if path is None:
        raise SystemExit(f"{name}: no states are stored")
    states = trajectory.read(path)
    model: Any = states.model
    if not hasattr(model, "K"):
        raise SystemExit(f"{name}: has no stiffness; only elastic families have")
    part: Any = states.problem(0)
    free = part.dofs[: part.problem.n]
    conditioning = []
    for share in (1.0, 1 / 8):
        M = share * model.M + (states.time_step * states.scene.theta) ** 2 * model.K
        W: Any = part.problem.replace(M=sp.csc_array(M[free][:, free])).condense().W
        values = np.linalg.svd(W.toarray(), compute_uv=False)
        conditioning.append(collection_table.span([values[0] / values[-1]]))
    theirs = ", ".join(row["conditioning"] for row in published_of(name) if row["conditioning"])
    as_it_is, light = conditioning
    yield {
        "set": name,
        "published conditioning": theirs,
        "ours": as_it_is,
        "with an eighth of the mass": light,
    }


def main() -> None:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("table", choices=("closed", "untouched", "lighter"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("families", nargs="+", metavar="SET/FAMILY")
    parser.add_argument("--files", type=Path, help="list of the published files")
    _results.add_option(parser)
    own = parser.parse_args()
    if own.table == "untouched" and own.files is None:
        parser.error("untouched needs --files, the list of the published files")
    made: dict[str, Callable[[str], Iterator[dict[str, str]]]] = {
        "closed": lambda name: closed(own.folder, name),
        "untouched": lambda name: untouched(own.folder, name, own.files),
        "lighter": lighter,
    }
    table = []
    for name in own.families:
        for row in made[own.table](name):
            table.append(row)
            print(row, flush=True)
    if own.results:
        title, note = TOLD[own.table]
        _results.store(own.results, table, title=title, note=note)


if __name__ == "__main__":
    main()
