"""What a guess from the step before is worth, on the sequences of the families.

    .venv/bin/python benchmarks/warm_start.py [--steps 300] [--every 1] [FAMILY...]

Each step of a scene is solved twice, from the impulses that the same pairs of bodies had in the
step before and from nothing; the simulation goes on with the first. The CPU times are those of the
solver alone, in one run. Steps without contact do not count.
"""

from __future__ import annotations

import argparse

import numpy as np

import fclib
from fclib import scenes
from fclib.simulate import simulate


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("families", nargs="*", help="by default those of rt444")
    parser.add_argument("--steps", type=int, default=300, help="steps with contact (default 300)")
    parser.add_argument("--every", type=int, default=1, help="compare one step in so many")
    parser.add_argument("--solver", default="auto")
    parser.add_argument("--tol", type=float, default=1e-8)
    arguments = parser.parse_args()
    known = scenes.families()
    families = arguments.families or [n for n, f in known.items() if f.collection == "rt444"]

    heads = ("steps", "warm s", "cold s", "ratio", "median", "solved")
    print(f"{'family':16}" + "".join(f"{head:>9}" for head in heads))
    for name in families:
        warm: list[float] = []
        cold: list[float] = []
        both = 0
        for step in simulate(
            scenes.get(name)().scene(seed=0), 100_000, solver=arguments.solver, tol=arguments.tol
        ):
            if not step.problem.nc:
                continue
            if len(warm) * arguments.every >= arguments.steps:
                break
            if step.index % arguments.every:
                continue
            again = fclib.solve(step.problem, arguments.solver, tol=arguments.tol)
            warm.append(step.result.cpu_s)
            cold.append(again.cpu_s)
            both += step.result.converged and again.converged
        ratios = np.array(warm) / np.array(cold)
        print(
            f"{name:16}{len(warm):9d}{sum(warm):9.3f}{sum(cold):9.3f}"
            f"{sum(warm) / sum(cold):9.2f}{np.median(ratios):9.2f}{both:9d}"
        )


if __name__ == "__main__":
    main()
