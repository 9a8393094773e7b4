"""Build a problem from SciPy matrices, write it, read it, solve it and check: ball.py FILE.

Three balls in a row fall on a plane while they slide; a rod, a bilateral constraint, joins the
first two.
"""

import sys

import numpy as np
import scipy.sparse as sp

import fclib


def balls() -> fclib.GlobalProblem:
    """M v = H r + G lambda + f, u = H^T v + w, G^T v + b = 0, and Coulomb's law."""
    masses = np.array([1.0, 2.0, 4.0])
    size = 3 * masses.size
    return fclib.GlobalProblem(
        M=sp.diags_array(np.repeat(masses, 3)).tocsc(),
        # the contact frames are those of the world: normal, then tangential
        H=sp.eye_array(size, format="csr"),
        # the rod keeps the tangential velocities of two balls equal
        G=sp.coo_array(([1.0, -1.0], ([1, 4], [0, 0])), shape=(size, 1)),
        # momentum before: each falls, and slides faster than the next
        f=np.concatenate([mass * np.array([-1.0, 3.0 - k, 0.0]) for k, mass in enumerate(masses)]),
        w=np.zeros(size),
        mu=np.array([0.5, 0.2, 1.2]),
        b=np.zeros(1),
        info=fclib.ProblemInfo(title="three balls and a rod"),
        matrix_info={"M": fclib.MatrixInfo(conditioning=4.0, rank=size)},
    )


def main(path: str) -> None:
    """Do all of it."""
    fclib.write(path, balls())

    problem = fclib.read(path)
    print(problem, problem.info.title, f"cond(M) = {problem.matrix_info['M'].conditioning}")

    result = fclib.solve(problem, tol=1e-10)
    print(result)
    fclib.write_solution(path, result.solution)

    stored = fclib.read_solution(path)
    assert stored is not None
    assert stored.l is not None
    merit = fclib.merit(problem, stored)
    print(f"merit {merit.error:.1e}; {merit.open} open, {merit.stick} stick, {merit.slide} slide")
    print("forces", stored.r.reshape(-1, 3).round(4).tolist(), "rod", float(stored.l[0]))
    if not merit.error <= 1e-10:
        sys.exit("the stored solution is wrong")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: ball.py FILE")
    main(sys.argv[1])
