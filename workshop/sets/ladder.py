"""Problems of any size of the families Wall and Packing, as files.

    python -m workshop.sets.ladder OUT [--contacts 10 100 1000 10000] [--kind Wall Packing]
        [--push 0 1] [--seed 0 ...]

campaigns/walls.toml and campaigns/packings.toml run solvers on them. They have no solutions, so
sizes are possible that nobody has solved; `fclib collection build ladder` has the published ones.
PUSH is a horizontal impulse on one block or on one side of the packing, in weights of all bodies.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path
from typing import Any

import fclib
from fclib import scenes

KINDS: dict[str, Any] = {name: scenes.assemblies()[name] for name in ("Wall", "Packing")}


def main() -> None:
    """Write the files OUT/KIND-pushPUSH-CONTACTS-SEED.hdf5."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--contacts", type=int, nargs="+", default=[10, 100, 1000, 10000])
    parser.add_argument("--kind", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--push", type=float, nargs="+", default=[0.0, 1.0])
    parser.add_argument("--seed", type=int, nargs="+", default=[0])
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    chosen = (arguments.kind, arguments.push, arguments.contacts, arguments.seed)
    for kind, push, contacts, seed in itertools.product(*chosen):
        problem = KINDS[kind]().of_size(contacts, push, seed)
        path = arguments.out / f"{kind}-push{push:g}-{contacts}-{seed}.hdf5"
        fclib.write(path, problem)
        print(f"{path}: {problem.nc} contacts, {problem.n // 6} bodies")


if __name__ == "__main__":
    main()
