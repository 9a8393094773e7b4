"""How far two builds of the same problems are apart, from two machines or compilers.

    python -m workshop.sets.apart FOLDER OTHER

Each problem that both hold is compared by its files: whether the digests are equal, whether those
of the structure are (sizes, and where the matrices have entries), and of each matrix and vector the
largest difference of two entries over the largest entry. Exit status 1 if a structure differs,
a difference is above --bound, or a problem is in one folder alone. `scripts/compare_on.sh` makes
the other build on another Debian.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import fclib
from fclib import _digest


def main() -> int:
    """Compare, and print a line for each family and each matrix."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("other", type=Path)
    parser.add_argument("--bound", type=float, default=1e-12)
    arguments = parser.parse_args()
    names = [
        {path.relative_to(folder) for path in folder.rglob("*.hdf5")}
        for folder in (arguments.folder, arguments.other)
    ]
    alone = len(names[0] ^ names[1])
    families: dict[str, list[int]] = {}
    worst: dict[str, tuple[float, str]] = {}
    for name in sorted(names[0] & names[1]):
        first, second = (fclib.read(base / name) for base in (arguments.folder, arguments.other))
        counts = families.setdefault(str(name.parent), [0, 0, 0])
        counts[0] += 1
        counts[1] += _digest.structure(first) == _digest.structure(second)
        counts[2] += _digest.digest(first) == _digest.digest(second)
        for part, apart in _digest.difference(first, second).items():
            worst[part] = max(worst.get(part, (0.0, "")), (apart, str(name)))
    total = [sum(column) for column in zip(*families.values(), strict=True)] or [0, 0, 0]
    print("| family | problems | equal structure | equal digest |\n|---|---|---|---|")
    for family, counts in [*families.items(), ("all", total)]:
        print(f"| {family} | {counts[0]} | {counts[1]} | {counts[2]} |")
    for part, (apart, where) in worst.items():
        print(f"{part}: entries differ by at most {apart:.1e} of the largest one, in {where}")
    if not worst:
        print("no entry differs")
    if alone:
        print(f"{alone} files are in one of the folders alone")
    largest = max((apart for apart, _ in worst.values()), default=0.0)
    return int(total[1] < total[0] or largest > arguments.bound or bool(alone) or not total[0])


if __name__ == "__main__":
    sys.exit(main())
