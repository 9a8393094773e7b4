"""Which parts have the runs of a set, and on which problems its solvers are compared.

A set is the name of its parts. A set that was chosen from runs also has these: CHOSEN_FROM names
their parts. Of all of them, only the problems of the set count.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

from fclib.collections import set_index
from fclib.results.beside import keys_of, usual_limits
from fclib.results.shards import Shard, ShardError, look, rows_of

# sets that were chosen from runs, and the parts that have these, beside parts of their own name
CHOSEN_FROM: Final = {
    "standard": ("candidates", "matrix"),
    "standard-peers": ("candidates", "matrix", "matrix-peers"),
    "hard": ("candidates-long",),
    "open": ("candidates-long",),
}
# what is no set by its name: the problems of a set that a part has
PART_OF: Final = {"standard-peers": ("standard", "matrix-peers")}


def by_name(parts: Iterable[Shard]) -> dict[str, list[Shard]]:
    """The parts of each name."""
    groups: dict[str, list[Shard]] = defaultdict(list)
    for part in parts:
        groups[part.name].append(part)
    return groups


def sources(groups: Mapping[str, Sequence[Shard]]) -> dict[str, list[Shard]]:
    """The sets that the parts have runs of, each with its parts."""
    found = {
        name: [part for source in (*names, name) for part in groups.get(source, ())]
        for name, names in CHOSEN_FROM.items()
    }
    used = {source for names in CHOSEN_FROM.values() for source in names}
    found |= {name: list(own) for name, own in groups.items() if name not in used | found.keys()}
    order = (*CHOSEN_FROM, *sorted(found.keys() - CHOSEN_FROM.keys()))
    there = {n for n in order if found.get(n) and (n not in PART_OF or PART_OF[n][1] in groups)}
    return {name: found[name] for name in order if name in there}


def digests_of(name: str, parts: Sequence[Shard]) -> set[str]:
    """The problems of a set that its parts have run."""
    whole, part = PART_OF.get(name, (name, ""))
    ran = {row["hash"] for one in parts if part in ("", one.name)
           for row in rows_of(one.path, ("hash",))}  # fmt: skip
    if name not in CHOSEN_FROM:
        return ran
    return ran & {choice.digest for choice in set_index.choices(whole)}


def of_sets(paths: Iterable[Path], names: Sequence[str]) -> tuple[list[Path], set[str]]:
    """The parts that have runs of some sets, and the digests of their problems.

    Raises:
        ShardError: no runs of such a set are in the parts.
    """
    groups = sources(by_name(map(look, paths)))
    for name in names:
        if name not in groups:
            raise ShardError(f"{name}: no published run is of it; there is: {', '.join(groups)}")
    parts = {part.path: None for name in names for part in groups[name]}
    return list(parts), {one for name in names for one in digests_of(name, groups[name])}


def usual_limit(name: str, parts: Iterable[Shard]) -> float:
    """The limit of CPU time [s] under which most problems of a set are compared; 0 without runs."""
    own = sources(by_name(parts)).get(name, ())
    digests = digests_of(name, own)
    limits = Counter(usual_limits(row for row in keys_of(own) if row["hash"] in digests).values())
    return max(limits, key=lambda limit: limits[limit], default=0.0)
