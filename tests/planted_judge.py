"""Random problems of every formulation whose solution is known, and what `auto` says of them.

    python tests/planted_judge.py [COUNT] [FIRST]    problems FIRST.. (20000 of them, from 0)

Each false word is printed with the number of its problem: `converged` where an independent judge
finds a larger error, `infeasible`, and `diverged`. Problems that are not solved are counted. Exit
status 1 where a word was false.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

import fclib
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
    ratio = 10.0 ** rng.choice([0, 0, 3, 6])
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


def rounding(problem: Any, solution: fclib.Solution) -> float:
    """What the judge's own error is rounded to: u is a sum, r - P_K(r - u^) a difference."""
    r = np.abs(solution.r)
    if isinstance(problem, fclib.LocalProblem | fclib.LocalRollingProblem):
        terms = abs(dense(problem.W)) @ r
        if problem.V is not None and solution.l is not None:
            terms += abs(dense(problem.V)) @ np.abs(solution.l)
        q = problem.q
    else:
        H, mass = dense(problem.H), np.diag(dense(problem.M))
        impulse = abs(H) @ r + np.abs(problem.f)
        if problem.G is not None and solution.l is not None:
            impulse += abs(dense(problem.G)) @ np.abs(solution.l)
        terms = abs(H).T @ (impulse / mass) + np.abs(problem.w)
        q = H.T @ (problem.f / mass) + problem.w
    size = np.linalg.norm(terms) + np.linalg.norm(r)
    return float(8 * np.finfo(float).eps * size / (np.linalg.norm(q) or 1.0))


def verdict(number: int, solve: Callable[..., fclib.Result] = fclib.solve) -> str:
    """The word of `auto` on a problem; 'false ...' where it is not true."""
    problem, solution, guess = planted(number)
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


def main() -> int:
    """Run the problems; see the top of the file."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20000
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    words: Counter[str] = Counter()
    for number in range(first, first + count):
        word = verdict(number)
        if word.startswith("false"):
            print(f"{number}: {word}", flush=True)
        words[word.split(" (")[0].split(":")[0]] += 1
    for word, times in words.most_common():
        print(f"{times:7d}  {word}")
    return int(any(word.startswith("false") for word in words))


if __name__ == "__main__":
    sys.exit(main())
