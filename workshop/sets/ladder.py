"""Problems of any size of the families Wall and Packing, which `fclib collection build ladder` has.

    python -m workshop.sets.ladder OUT [--contacts 10 100 1000 10000] [--kind Wall Packing]
        [--push 0 1] [--seed 0]

They are written without solutions, so that sizes are there that nobody has solved. PUSH is a
horizontal impulse on one block or on one side of the packing, in weights of all bodies.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import fclib
from fclib import scenes

KINDS: dict[str, Any] = {name: scenes.assemblies()[name] for name in ("Wall", "Packing")}


def main() -> None:
    """Write the files OUT/KIND-push-contacts.hdf5."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--contacts", type=int, nargs="+", default=[10, 100, 1000, 10000])
    parser.add_argument("--kind", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--push", type=float, nargs="+", default=[0.0, 1.0])
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for kind in arguments.kind:
        for push in arguments.push:
            for contacts in arguments.contacts:
                problem = KINDS[kind]().of_size(contacts, push, arguments.seed)
                path = arguments.out / f"{kind}-push{push:g}-{contacts}.hdf5"
                fclib.write(path, problem)
                print(f"{path}: {problem.nc} contacts, {problem.n // 6} bodies")


if __name__ == "__main__":
    main()
