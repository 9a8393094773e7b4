"""Random problems of every formulation whose solution is known, and what `auto` says of them.

    python tests/planted_judge.py [COUNT] [FIRST]    problems FIRST.. (20000 of them, from 0)
    python tests/planted_judge.py --hard [COUNT] [FIRST]          2000 that ask for all digits
    python tests/planted_judge.py --infeasible [COUNT] [FIRST]    2000 that have no solution

Each false word is printed with the number of its problem: `converged` where an independent judge
finds a larger error, `infeasible`, and `diverged`. Problems that are not solved are counted. Of
those without a solution `converged` is false, and `infeasible` where its proof does not hold in
rational arithmetic. Exit status 1 where a word was false.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

import fclib
from fclib import analysis
from helpers import dense, judge, planted_law

Array: TypeAlias = npt.NDArray[np.float64]

FALSE = ("infeasible", "diverged")
TOLERANCE = 1e-8


def bodies_of(rng: np.random.Generator, n: int, ratio: float) -> Array:
    """Masses from 1 to `ratio`, in any order."""
    return np.exp(rng.uniform(0, np.log(ratio), n)) if ratio > 1 else np.ones(n)


def directions(rng: np.random.Generator, n: int, d: int, nc: int) -> Array:
    """H of contacts, whose blocks have ranks from 0 to d; some contacts are there twice."""
    columns: list[Array] = []
    for _ in range(nc):
        if columns and rng.uniform() < 0.15:
            columns.append(columns[rng.integers(len(columns))])
            continue
        rank = rng.integers(1, d + 1) if rng.uniform() < 0.5 else d
        touched = rng.choice(n, min(n, max(int(rank), 1) + 2), replace=False)
        block = np.zeros((n, d))
        block[touched] = rng.standard_normal((len(touched), rank)) @ rng.standard_normal((rank, d))
        if rng.uniform() < 0.05:
            block[:] = 0
        columns.append(block)
    return np.hstack(columns)


def joints(rng: np.random.Generator, n: int, p: int) -> Array:
    """G of p constraints; some follow from others, and one may be nothing."""
    G = rng.standard_normal((n, p)) * (rng.uniform(size=(n, p)) < 0.5)
    if p > 1 and rng.uniform() < 0.5:
        G[:, -1] = G[:, :-1] @ rng.integers(-2, 3, p - 1)
    return G


def planted(number: int) -> tuple[Any, fclib.Solution, Array | None]:
    """Problem `number`, a solution of it, and a guess."""
    rng = np.random.default_rng([number, 2026])
    rolling = bool(rng.integers(2))
    d = int(rng.choice([3, 5] if rolling else [2, 3]))
    nc = int(rng.integers(1, 9))
    n = int(rng.integers(d + 2, 2 * d * nc + 4))
    p = int(rng.integers(0, min(4, n // 3) + 1))
    ratio = 10.0 ** rng.choice([0, 0, 3, 6, 9, 12])
    unit = 10.0 ** rng.choice([0, 0, -9, -3, 3, 9])
    friction = (None, 0.0, 0.3, 1.0, 100.0)[rng.integers(5)]
    law, (u, r, _) = planted_law(rng, d, nc, friction, rolling)
    mass = unit * bodies_of(rng, n, ratio)
    H, G = directions(rng, n, d, nc), joints(rng, n, p)
    impulse = unit * r.ravel()
    lam, f = unit * rng.standard_normal(p), unit * rng.standard_normal(n)
    v = (H @ impulse + G @ lam + f) / mass
    mixed = {"G": G, "b": -G.T @ v} if p else {}
    kind: Any = fclib.GlobalRollingProblem if rolling else fclib.GlobalProblem
    problem: Any = kind(
        spacedim=d, M=np.diag(mass), H=H, f=f, w=u.ravel() - H.T @ v, **law, **mixed
    )
    solution = fclib.Solution(v=v, u=u.ravel(), r=impulse, l=lam if p else None)
    guess = [None, None, impulse * (1 + 1e-3 * rng.standard_normal(d * nc)),
             unit * rng.standard_normal(d * nc), 1e12 * unit * rng.standard_normal(d * nc)][
        rng.integers(5)
    ]  # fmt: skip
    if rng.integers(2):  # the local form
        problem = problem.condense()
        solution = fclib.Solution(u=u.ravel(), r=impulse, l=lam if p else None)
    return problem, solution, guess


def squeezed(rng: np.random.Generator, d: int, nc: int, rolling: bool) -> tuple[Array, Array]:
    """H and masses of light bodies between heavy ones, one on the other.

    What a light body feels is the small difference of large reactions.
    """
    ratio = 10.0 ** rng.uniform(2, 8)
    size = d if rolling or d == 2 else 3
    mass, arm = np.ones((nc, size)), 10.0 ** rng.uniform(-3, 0)
    mass[::2] /= ratio
    if rolling:  # spheres of this radius
        mass[:, (d + 1) // 2 :] *= 0.4 * arm**2
    H = np.zeros((nc * size, d * nc))
    for a in range(nc):
        for body, sign in ((a, 1.0), (a - 1, -1.0)):
            if body < 0:
                continue
            block = H[size * body : size * (body + 1), d * a : d * (a + 1)]
            block[:d, :d] = sign * np.eye(d)
            if rolling:  # what is tangential turns both the same way
                tangents = range(1, (d + 1) // 2)
                for k in tangents:
                    block[k + len(tangents), k] = arm
    return H, mass.ravel()


def hard(number: int) -> tuple[Any, fclib.Solution, None]:
    """Problem `number` whose solution asks for all digits, and the solution.

    Joints that nearly follow from each other on bodies of very different masses, or light bodies
    squeezed between heavy ones.
    """
    rng = np.random.default_rng([number, 2028])
    rolling = bool(rng.integers(2))
    d = int(rng.choice([3, 5] if rolling else [2, 3]))
    nc = int(rng.integers(1, 5))
    law, (u, r, _) = planted_law(rng, d, nc, 0.5, rolling)
    unit = 10.0 ** rng.choice([0, 0, -6, 6])
    mixed: dict[str, Any] = {}
    if number % 2:
        H, masses = squeezed(rng, d, nc, rolling)
        G = np.zeros((len(masses), 0))
        # what goes through a light body leaves next to nothing in it
        law, u, r = {k: x[:1].repeat(nc) for k, x in law.items()}, u[:1], r[:1]
        if rolling:
            u[:, 1 : (d + 1) // 2] = r[:, 1 : (d + 1) // 2] = 0
        u, r = u.repeat(nc, axis=0), r.repeat(nc, axis=0)
    else:
        n = int(rng.integers(d + 3, 2 * d * nc + 6))
        masses = bodies_of(rng, n, 10.0 ** rng.uniform(0, 9))
        H = rng.standard_normal((n, d * nc))
        G = rng.standard_normal((n, 2))
        gap = 10.0 ** rng.uniform(-9, -2)
        G[:, 1] = G[:, 0] + gap * rng.standard_normal(n)
    masses, impulse = unit * masses, unit * r.ravel()
    f = unit * rng.standard_normal(len(masses))
    lam = unit * rng.standard_normal(G.shape[1])
    if G.shape[1]:
        lam[1] = -lam[0] + unit * rng.standard_normal() * gap
        lam /= gap
    v = (H @ impulse + G @ lam + f) / masses
    if G.shape[1]:
        mixed = {"G": G, "b": -G.T @ v}
    kind: Any = fclib.GlobalRollingProblem if rolling else fclib.GlobalProblem
    problem: Any = kind(
        spacedim=d, M=np.diag(masses), H=H, f=f, w=u.ravel() - H.T @ v, **law, **mixed
    )
    lam_or_none = lam if G.shape[1] else None
    solution = fclib.Solution(v=v, u=u.ravel(), r=impulse, l=lam_or_none)
    if rng.integers(2) and not G.shape[1]:  # the local form
        problem = problem.condense()
        solution = fclib.Solution(u=u.ravel(), r=impulse)
    return problem, solution, None


def rounding(problem: Any, solution: fclib.Solution) -> float:
    """What the judge's own error is rounded to: u is a sum, r - P_K(r - u^) a difference."""
    r = np.abs(solution.r)
    if isinstance(problem, fclib.LocalProblem | fclib.LocalRollingProblem):
        terms = abs(dense(problem.W)) @ r
        if problem.V is not None and solution.l is not None:
            terms += abs(dense(problem.V)) @ np.abs(solution.l)
        q, diagonal = problem.q, np.diag(dense(problem.W))
    else:
        H, mass = dense(problem.H), np.diag(dense(problem.M))
        impulse = abs(H) @ r + np.abs(problem.f)
        if problem.G is not None and solution.l is not None:
            impulse += abs(dense(problem.G)) @ np.abs(solution.l)
        terms = abs(H).T @ (impulse / mass) + np.abs(problem.w)
        q, diagonal = H.T @ (problem.f / mass) + problem.w, np.sum(H * H / mass[:, None], axis=0)
    d = problem.spacedim
    size = abs(diagonal).reshape(-1, d).mean(axis=1)
    others = size[size > 0].mean() if size.any() else 1.0
    rho = np.repeat(1 / np.where(size > 0, size, others), d)
    steepest = np.repeat(1 + problem.mu + getattr(problem, "mu_r", 0), d)  # u^_N = u_N + mu |u_T|

    def relative(weight: Any) -> float:
        size = np.linalg.norm(weight * steepest * terms) + np.linalg.norm(r)
        return float(size / (np.linalg.norm(weight * q) or 1.0))

    return float(8 * np.finfo(float).eps * max(relative(1.0), relative(rho)))


def verdict(
    number: int,
    solve: Callable[..., fclib.Result] = fclib.solve,
    plant: Callable[[int], tuple[Any, fclib.Solution, Array | None]] = planted,
) -> str:
    """The word of `auto` on a problem; 'false ...' where it is not true."""
    problem, solution, guess = plant(number)
    own = judge(problem, solution).error
    if own > 0.1 * TOLERANCE:
        return "rounding"  # the data do not hold their own solution
    start = None if guess is None else fclib.Solution(r=guess)
    try:
        result = solve(problem, guess=start, max_iterations=20000)
    except fclib.UnsuitableError as refusal:
        return f"false refusal: {refusal}"
    if result.status in FALSE:
        return f"false {result.status}"
    error = judge(problem, result.solution).error
    if result.converged and error > 1.01 * TOLERANCE + rounding(problem, result.solution):
        return f"false converged ({error:.1e})"
    return str(result.status)


def without_solution(number: int) -> Any:
    """Problem `number` of those that have none: normal reactions y and joints' z move nothing.

    All that the proof is made of are whole numbers or halves of them, so that it is exact; where
    the masses are powers of four, it is in the local form too.
    """
    rng = np.random.default_rng([number, 2027])
    rolling = bool(rng.integers(2))
    d = int(rng.choice([3, 5] if rolling else [2, 3]))
    squeezed = int(rng.integers(2, 6))
    nc = squeezed + int(rng.integers(0, 6))
    n = int(rng.integers(max(d, 3), 2 * d + 6))
    p = int(rng.integers(0, 3))
    y, z = rng.integers(1, 5, squeezed), rng.integers(-3, 4, p)
    H = rng.integers(-3, 4, (n, d * nc)).astype(float)
    G = rng.integers(-2, 3, (n, p)).astype(float)
    y[-1] = 1  # the last normal makes the sum vanish
    rest = H[:, : d * (squeezed - 1) : d] @ y[:-1] + G @ z
    H[:, d * (squeezed - 1)] = -rest
    unit = 4.0 ** rng.integers(-10, 11)
    whole = bool(rng.integers(2))
    mass = unit * (4.0 ** rng.integers(0, 6, n) if whole else bodies_of(rng, n, 1e4))
    w, b = rng.integers(-4, 5, d * nc) / 2.0, rng.integers(-4, 5, p) / 2.0
    gain = 2.0 ** rng.integers(-10, 4)
    normals = d * np.arange(squeezed)
    w[normals[-1]] = -gain - y[:-1] @ w[normals[:-1]] - z @ b
    law: dict[str, Any] = {"mu": rng.choice([0.0, 0.3, 1.0, 10.0], nc)}
    if rolling:
        law["mu_r"] = rng.choice([0.01, 0.1], nc)
    kind: Any = fclib.GlobalRollingProblem if rolling else fclib.GlobalProblem
    problem: Any = kind(
        spacedim=d,
        M=np.diag(mass),
        H=H,
        f=unit * rng.standard_normal(n),
        w=w,
        **law,
        **({"G": G, "b": b} if p else {}),
    )
    return problem.condense() if rng.integers(2) else problem


def claim(number: int, solve: Callable[..., fclib.Result] = fclib.solve) -> str:
    """The word of `auto` on a problem without a solution; 'false ...' where it is not true."""
    problem = without_solution(number)
    try:
        result = solve(problem, max_iterations=20000)
    except fclib.UnsuitableError as refusal:
        return f"refused ({refusal})"
    if result.status == "infeasible":
        assert result.certificate is not None
        try:
            proof = analysis.check_arrays(problem, result.certificate, result.certificate_z)
        except analysis.CertificateError as error:
            return f"false infeasible: {error}"
        return "infeasible, exactly" if proof.exact else "infeasible, up to a bound"
    if result.converged:
        local = isinstance(problem, fclib.LocalProblem | fclib.LocalRollingProblem)
        within = judge(problem, result.solution).error <= 1.01 * TOLERANCE
        # rounding has given the condensed W a way out, or the gap closes within the tolerance
        return "converged, by rounding" if local and within else "false converged"
    return str(result.status)


def main() -> int:
    """Run the problems; see the top of the file."""
    arguments = sys.argv[1:]
    infeasible, asking = "--infeasible" in arguments, "--hard" in arguments
    numbers = [int(one) for one in arguments if not one.startswith("--")]
    count = numbers[0] if numbers else 2000 if infeasible or asking else 20000
    first = numbers[1] if len(numbers) > 1 else 0
    words: Counter[str] = Counter()
    for number in range(first, first + count):
        word = claim(number) if infeasible else verdict(number, plant=hard if asking else planted)
        if word.startswith("false"):
            print(f"{number}: {word}", flush=True)
        words[word.split(" (")[0].split(":")[0]] += 1
    for word, times in words.most_common():
        print(f"{times:7d}  {word}")
    return int(any(word.startswith("false") for word in words))


if __name__ == "__main__":
    sys.exit(main())
