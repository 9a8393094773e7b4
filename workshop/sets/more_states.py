"""A further version of stored states: those that are stored, and more of a new simulation.

    fclib collection simulate GearTrain Rover --tol 1e-7 --version 2 --out TR
    python -m workshop.sets.more_states machines/GearTrain machines/Rover --from TR --out OUT

A simulation made again is another one in its last digits, and in the end in all of them. So the
states that are stored stay, with their numbers and digests, and those of the new simulation stand
beside them, at equal distances. States in which a body is more than DEEPEST in another are left
out. Writes OUT/SET/FAMILY-VERSION.trajectory, which goes to
`collection/fclib_collection/trajectories/`.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fclib.collections import published, trajectory
from fclib.collections.plan import DEEPEST, evenly
from workshop.sets.relaxed_states import depth, newest


def joined(
    stored: trajectory.Trajectory, fresh: trajectory.Trajectory, count: int
) -> trajectory.Trajectory:
    """All states of the first, and of the second as many as make `count`."""
    own = {trajectory.record(one.scene)["xml"] for one in (stored, fresh)}
    if len(own) > 1 or stored.exponent != fresh.exponent:
        raise ValueError(f"{stored.scene.name}: the new states are of another scene")
    taken = set(stored.number.tolist())
    free = [k for k, number in enumerate(fresh.number.tolist()) if number not in taken]
    flat = []
    for k in free:
        part: Any = fresh.problem(k)
        if depth(fresh, part.contacts) <= DEEPEST:
            flat.append(k)
    wanted = count - len(stored)
    places = [flat[k] for k in evenly(len(flat), min(wanted, len(flat)))]
    order = np.argsort(np.concatenate((stored.number, fresh.number[places])), kind="stable")

    def both(name: str) -> Any:
        return np.concatenate((getattr(stored, name), getattr(fresh, name)[places]))[order]

    values: dict[str, Any] = {name: both(name) for name in trajectory.ARRAYS}
    for name in trajectory.HEXES:
        all_of_it = [*getattr(stored, name), *(getattr(fresh, name)[k] for k in places)]
        values[name] = tuple(all_of_it[k] for k in order)
    earlier = f"{stored.origin['collection']}/{stored.scene.name}, {stored.origin['version']}"
    settings = stored.origin["settings"] | {"states": f"{earlier}, and others beside them"}
    origin = {**stored.origin, "version": fresh.origin["version"], "settings": settings}
    return replace(stored, origin=origin, **values)


def main() -> None:
    """Write the trajectories."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", nargs="+", metavar="SET/FAMILY")
    parser.add_argument("--from", dest="source", type=Path, required=True)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    for folder in arguments.folders:
        (path,) = arguments.source.glob(f"{folder}-*{trajectory.SUFFIX}")
        states = joined(trajectory.read(newest(folder)), trajectory.read(path), arguments.count)
        target = arguments.out / published.file_name(folder, states.origin["version"])
        trajectory.write(target, states)
        print(f"{folder}: {len(states)} states, {target.stat().st_size} bytes")


if __name__ == "__main__":
    main()
