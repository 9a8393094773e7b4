"""Read a problem and look at it: look.py [FILE].

Without a file, a stack of boxes is simulated to have one. Prints sizes, what W is like and whether
there is a solution; draws the pattern of W and the forces at the contacts.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import scipy.sparse as sp

import fclib
from fclib import analysis, scenes, simulate


def example() -> str:
    """A problem of ten boxes at rest, in a file."""
    scene = scenes.get("BoxesStack")(boxes=10, gap=0.01, time_step=5e-3).scene(seed=0)
    *_, last = simulate.simulate(scene, steps=50)
    fclib.write("stack.hdf5", last.problem, last.result.solution)
    return "stack.hdf5"


def main(path: str) -> None:
    """Look at the problem of a file."""
    problem = fclib.read(path)
    print(problem)
    print("title:", problem.info.title)
    print(f"{problem.nc} contacts, friction {problem.mu.min():g} to {problem.mu.max():g}")

    # the local form has all that the contacts see
    globally = fclib.GlobalProblem | fclib.GlobalRollingProblem | fclib.GlobalSpinProblem
    local = problem.condense() if isinstance(problem, globally) else problem
    W, d = sp.csr_array(local.W), local.spacedim
    print(f"W: {W.shape[0]} x {W.shape[1]}, {W.nnz} entries")
    print(f"   max |W - W^T| / max |W| = {abs(W - W.T).max() / abs(W).max():.0e}")
    print(f"   contacts that approach: {np.count_nonzero(local.q[::d] < 0)}")

    found = analysis.analyze(local)
    print(f"   rank {found.spectra['W'].rank}, hyperstaticity {found.hyperstaticity}")
    print(f"solution: {found.existence.verdict}; {found.existence.reason}")

    # a stored solution is judged before it is believed
    stored = fclib.read_solution(path)
    if stored is not None and fclib.merit(problem, stored).error < 1e-6:
        r = stored.r
    else:
        r = fclib.solve(problem).solution.r
    forces = r.reshape(-1, d)
    merit = fclib.merit(local, fclib.Solution(r=r))
    print(f"error {merit.error:.0e}: {merit.open} open, {merit.stick} stick, {merit.slide} slide")

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    left.spy(W, markersize=1.5)
    left.set_title("W, three rows a contact")
    last = (d + 1) // 2 if hasattr(local, "mu_r") else d  # what follows are rolling moments
    normal, tangential = forces[:, 0], np.linalg.norm(forces[:, 1:last], axis=1)
    right.plot(normal, tangential, "o", markersize=4)
    reach = np.array([0, 1.05 * normal.max()])
    right.plot(reach, problem.mu.max() * reach, "--", color="gray", label="the cone's boundary")
    right.set(xlabel="normal impulse [N s]", ylabel="tangential impulse [N s]")
    right.legend()
    figure.savefig("look.png", dpi=130)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else example())
