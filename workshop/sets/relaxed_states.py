"""New versions of stored states that were deeper in each other than a fiftieth of a diameter.

    python -m workshop.sets.relaxed_states [SET...]
    python -m workshop.sets.relaxed_states --results relaxed-states      # what changed

Of each set, `standard` and `tiny` by default, every family whose newest states are deeper than
`DEEPEST` gets a further version, the set's present one, in which these states are relaxed
(`fclib.simulate.relaxed`): positions move apart, velocities, numbers and steps stay, and so do the
states that are within the bound. The lists get the new digests. This writes into `collection/` and
`python/fclib/collections/data/`, and does nothing if all is within the bound. Minutes of CPU, most
of them for Chute4000.

`--results NAME` stores a table of the relaxed states beside those they were made from, and makes
nothing new.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fclib import _digest
from fclib.collections import published, set_index, trajectory
from fclib.collections.plan import DEEPEST
from fclib.simulate import problem_at, relaxed
from workshop.sets import choose
from workshop.tables import _results

SETS = ("standard", "tiny")


def newest(folder: str) -> Path:
    """The file of the newest states of SET/FAMILY."""
    path = published.path_of(folder, set_index.version_of(folder))
    assert path is not None
    return path


def depth(states: trajectory.Trajectory, contacts: Any) -> float:
    """The largest penetration, of the diameter of the smallest body; elastic ones have no size."""
    size = states.model.smallest_size
    # a joint's limit has no bodies that touch
    gap = contacts.gap[contacts.pair[:, 0] >= 0]
    return float(-gap.min(initial=0.0) / (2 * size)) if size else 0.0


def mended(states: trajectory.Trajectory, version: str) -> trajectory.Trajectory | None:
    """A version of states within the bound; None if they are."""
    model, scheme = states.model, states.scheme
    position = states.position.copy()
    for k in range(len(states)):
        part: Any = states.problem(k)
        if depth(states, part.contacts) > DEEPEST:
            found = relaxed(model, scheme, position[k], states.velocity[k], DEEPEST)
            position[k] = trajectory.rounded(found, states.exponent)
    if np.array_equal(position, states.position):
        return None
    # as a build assembles them
    problems = [
        problem_at(model, scheme, q, v).problem
        for q, v in zip(position, states.velocity, strict=True)
    ]
    name = f"{states.origin['collection']}/{states.scene.name}, {states.origin['version']}"
    settings = states.origin["settings"] | {"deepest": DEEPEST, "states": name}
    return replace(
        states,
        origin={**states.origin, "version": version, "settings": settings},
        position=position,
        digest=tuple(_digest.digest(problem) for problem in problems),
        structure=tuple(_digest.structure(problem) for problem in problems),
        sketch=np.array([_digest.sketch(problem) for problem in problems]),
    )


def write_list(name: str, changed: dict[str, trajectory.Trajectory]) -> None:
    """The list of a set, with the new digests; what it keeps is then all that it has."""
    path = set_index.DATA / f"{name}.json"
    rule = json.loads(path.read_text(encoding="utf-8"))["rule"]
    choices = []
    for choice in set_index.choices(name):
        if choice.family in changed:
            states = changed[choice.family]
            choice = replace(choice, digest=states.digest[states.index(choice.number)])
        choices.append(choice)
    if "kept" in rule:
        rule["kept"] = sorted((choice.family, choice.number) for choice in choices)
    choose.write_list(path, choices, rule)


def make(name: str) -> None:
    """Mend the states of a set, and its list."""
    changed = {}
    version = set_index.version(name)
    for folder in published.folders(name):
        if folder not in set_index.sets()[name]:
            continue
        new = mended(trajectory.read(newest(folder)), version)
        if new is not None:
            target = newest(folder).with_name(f"{new.scene.name}-{version}{trajectory.SUFFIX}")
            trajectory.write(target, new)
            changed[new.scene.name] = new
            print(target, flush=True)
    if changed:
        write_list(name, changed)


def compared(folder: str) -> dict[str, Any] | None:
    """A row of the table; None of states that were not relaxed."""
    new = trajectory.read(newest(folder))
    settings = new.origin["settings"]
    own, _, version = settings.get("states", "").rpartition(", ")
    path = published.path_of(own, version) if "deepest" in settings and own == folder else None
    if path is None:
        return None
    old = trajectory.read(path)
    vars(old)["model"] = new.model  # of one scene, and it takes seconds to make
    deep: list[list[float]] = [[], []]
    contacts, pairs, lost, added, states = [0, 0], 0, 0, 0, 0
    for k in range(len(new)):
        if new.digest[k] == old.digest[k]:
            continue
        steps: list[Any] = [each.problem(k) for each in (old, new)]
        parts = [step.contacts for step in steps]
        touching = [{tuple(pair) for pair in part.pair.tolist()} for part in parts]
        states += 1
        for side, part in enumerate(parts):
            deep[side].append(depth(new, part))
            contacts[side] += len(part)
        pairs += len(touching[0])
        lost += len(touching[0] - touching[1])
        added += len(touching[1] - touching[0])
    return {
        "family": folder,
        "states": f"{states} of {len(new)}",
        "deepest before [%]": 100 * max(deep[0]),
        "deepest now [%]": 100 * max(deep[1]),
        "contacts before": contacts[0],
        "contacts now": contacts[1],
        "pairs before": pairs,
        "pairs that part": lost,
        "pairs that come": added,
    }


def main() -> None:
    """Mend the states, or compare them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("sets", nargs="*", default=SETS)
    _results.add_option(parser)
    arguments = parser.parse_args()
    for name in () if arguments.results else arguments.sets:
        make(name)
    rows = [compared(own) for name in arguments.sets for own in published.folders(name)]
    table = [row for row in rows if row is not None]
    if table:
        print(_results.table(list(table[0]), table))
    if arguments.results:
        _results.store(
            arguments.results,
            table,
            title="Stored states that were relaxed",
            note="Of the relaxed states alone: the largest penetration, of the diameter of the"
            " smallest body, and all contacts and pairs of bodies in contact, before and after.",
        )


if __name__ == "__main__":
    main()
