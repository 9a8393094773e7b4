"""Solve a problem with five solvers and plot how their errors fall: convergence.py [FILE].

The history of a solve has the error at every report of the solver, as `fclib.merit` defines it, and
the wall clock since the start. Without a file, a stack of boxes is simulated to have a problem.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import fclib
from fclib import scenes, simulate

SOLVERS = ("nsgs", "fp-eg-upk", "admm", "nsn-ac", "auto")
TOLERANCE = 1e-8


def example() -> fclib.Problem:
    """Ten boxes while they settle, when contacts stick and slide."""
    scene = scenes.get("BoxesStack")(boxes=10, gap=0.01, time_step=5e-3).scene(seed=0)
    *_, last = simulate.simulate(scene, steps=45)
    return last.problem


def main(problem: fclib.Problem) -> None:
    """Solve, print, plot."""
    print(problem)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), sharey=True, layout="constrained")
    for name in SOLVERS:
        result = fclib.solve(problem, name, tol=TOLERANCE, time_limit=10, history=True)
        history = result.history
        assert history is not None
        print(
            f"{name:10} {result.status:12} {result.iterations:6} iterations "
            f"error {result.error:.0e}  {1e3 * result.cpu_s:.1f} ms"
        )
        errors = np.maximum(history["error"], 1e-16)
        left.loglog(history["iteration"] + 1, errors, label=name)
        right.loglog(1e3 * history["time"] + 1e-3, errors, label=name)
    left.set(xlabel="iteration", ylabel="relative error of the natural map")
    right.set(xlabel="wall clock [ms]")
    for axes in (left, right):
        axes.axhline(TOLERANCE, color="gray", linestyle=":")
        axes.grid(alpha=0.3)
    right.legend()
    figure.savefig("convergence.png", dpi=130)


if __name__ == "__main__":
    main(fclib.read(sys.argv[1]) if len(sys.argv) > 1 else example())
