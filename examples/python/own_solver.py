"""A solver of one's own, beside those of fclib: own_solver.py FILE..."""

import sys
from typing import Annotated

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

import fclib

Array = npt.NDArray[np.float64]
Step = Annotated[float, fclib.Option("step, relative to 1 / ||W_kk||", lowest=0.01, highest=2)]


@fclib.solver("my-pgs", family="splitting", citation="Jourdan, Alart & Jean 1998")
def solve(
    problem: fclib.LocalProblem, r: Array, monitor: fclib.Monitor, *, step: Step = 1.0
) -> None:
    """Projected Gauss-Seidel: u = W r + q, and r <- P_K(r - rho u^) contact by contact."""
    d, W = problem.spacedim, sp.csr_array(problem.W)
    contacts = []
    for number, mu in enumerate(problem.mu):
        k = slice(d * number, d * (number + 1))
        rho = step / (np.linalg.norm(W[k, k].toarray(), 2) or 1.0)
        contacts.append((k, W[k], problem.q[k], mu, rho))
    while not monitor.stop(r):
        for k, row, q, mu, rho in contacts:
            u = row @ r + q
            u[0] += mu * np.linalg.norm(u[1:])
            r[k] = project(r[k] - rho * u, mu)


def project(x: Array, mu: float) -> Array:
    """The point of the cone ||x_T|| <= mu x_N that is nearest to x."""
    norm = float(np.linalg.norm(x[1:]))
    if norm <= mu * x[0]:
        return x
    normal = max(0.0, float(x[0] + mu * norm) / (1 + mu * mu))
    return np.array([normal, *(mu * normal / (norm or 1.0) * x[1:])])


if __name__ == "__main__":
    for path in sys.argv[1:]:
        problem = fclib.read(path)
        for name in ("my-pgs", "auto"):
            print(path, fclib.solve(problem, name, tol=1e-6))
