"""Whether files have all that section 3 of RT-0444 asks for, read with h5py alone.

    python -m workshop.sets.metadata FOLDER... [--sample 100]

The files are those below the folders, `--sample` of them at equal distances. Each must have

- title, description and math_info, which says whether a solution exists, and of the velocity and
  of the reactions whether they are unique;
- of each matrix that is not empty a comment, its rank and its conditioning;
- a solution, or the reason why there is none;
- of a simulated problem a guess, or the reason why there is none, v0 and the impulse of forces.

The exit status is 1 if an item is missing; each is printed with its file.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

TEXTS = ("title", "description", "math_info")
FACTS = ("Existence:", "Velocity:", "Reactions:")
NONE = "proven not to exist"  # then there is nothing to be unique
SIMULATED = ("fclib.simulate", "fclib.collections.handed")  # what makes problems of simulations
MATRICES = ("M", "H", "G", "W", "V", "R")


def text(data: Any) -> str:
    """A text of fixed length, without its NUL."""
    value = data[()]
    return value.decode() if isinstance(value, bytes) else str(value)


def missing(file: Any) -> Iterator[str]:
    """The items that a file lacks, in words."""
    (name,) = (key for key in file if key.startswith("fclib_"))
    problem = file[name]
    info = problem.get("info", {})
    attributes = getattr(info, "attrs", {})
    words = {key: text(info[key]) if key in info else "" for key in TEXTS}
    yield from (f"info/{key}" for key, value in words.items() if not value)
    if NONE not in words["math_info"]:
        yield from (f"math_info: {fact}" for fact in FACTS if fact not in words["math_info"])
    for key in MATRICES:
        if key not in problem or not np.any(problem[f"{key}/x"][()]):
            continue
        for item in ("comment", "rank", "conditioning"):
            if item not in problem[key]:
                yield f"{key}/{item}"
            elif item != "comment" and not problem[f"{key}/{item}"][()] > 0:
                yield f"{key}/{item} is not known"
    if "solution" not in file and "solution" not in attributes:
        yield "solution, or why there is none"
    if any(f'"generator": "{maker}"' in words["description"] for maker in SIMULATED):
        if "guesses" not in file and "guess" not in attributes:
            yield "guess, or why there is none"
        if "bodies" in file and name.startswith("fclib_global"):
            yield from (f"bodies/{k}" for k in ("velocity", "impulse") if k not in file["bodies"])


def main() -> int:
    """Print what is missing, and how many files are whole."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--sample", type=int, default=100)
    arguments = parser.parse_args()
    paths = sorted(path for folder in arguments.folders for path in folder.rglob("[!.]*.hdf5"))
    if not paths:
        print("there is no file *.hdf5 below these folders")
        return 1
    places = np.linspace(0, len(paths) - 1, min(arguments.sample, len(paths))).round().astype(int)
    chosen = [paths[place] for place in dict.fromkeys(places.tolist())]
    whole = 0
    for path in chosen:
        with h5py.File(path) as file:
            found = list(missing(file))
        whole += not found
        for item in found:
            print(f"{path}: {item}")
    print(f"{whole} of {len(chosen)} files have all items")
    return int(whole < len(chosen))


if __name__ == "__main__":
    sys.exit(main())
