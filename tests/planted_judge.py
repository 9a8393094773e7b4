"""Random problems of every formulation whose truth is known, and what solvers say of them.

    python tests/planted_judge.py [COUNT] [FIRST] [--regime NAME] [--solver NAME]

COUNT problems (1000) from number FIRST (0) on: of each regime, or of the one that is named. They
are solved by `auto`, by the solver that is named, or by all built-in solvers in turn (`each`).

    random          masses over twelve decades, redundant joints, blocks of every rank, guesses
    digits          solutions that ask for all digits
    corners         contacts at the corners of the law: they graze, roll without sliding, slide
                    without rolling, stick at a limit; mu and mu_r from 0 to 2^40; half of them in
                    whole numbers, so that the solution is exact
    spin            contacts with spin friction, of each law in turn: the product, the product with
                    rolling, the ellipsoid
    held limits     limits that closed loops of joints hold
    nearly          joints that contradict each other by rounding, or by a little more
    contradicting   joints that contradict each other
    unsolvable      bodies that nothing keeps apart
    damaged         files that end early, or parts of which were never written

Each false word is printed with its number. The judge is tests/ball_judge.py, so that what is
called false is proven to be. Exit status 1 where a word was false.
"""

from __future__ import annotations

import argparse
import functools
import math
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import h5py
import numpy as np
import numpy.typing as npt

import fclib
from ball_judge import judge
from fclib import _registry, analysis
from helpers import SPIN_LAWS, dense, planted_law, product, spin_states

Array: TypeAlias = npt.NDArray[np.float64]
# a problem, a solution of it, and a guess
Plant: TypeAlias = Callable[[int], tuple[Any, fclib.Solution, Array | None]]

FALSE = ("infeasible", "diverged")  # words of `auto` that are false of a problem with a solution
TOLERANCE = 1e-8
DIGITS = 1e-12  # below it errors are not compared: four digits of the tolerance are left
EXTENDED = 2.0**-63  # what the merit's extended precision leaves of large reactions beside q
LEEWAY = 1.01  # an error is called larger than a tolerance, or than another error, beyond this
ITERATIONS = 20_000  # of `auto`, which seldom needs them
SWEEPS = 1_000  # of any other solver: most of what is solved at all is solved by then


def bodies_of(rng: np.random.Generator, n: int, ratio: float) -> Array:
    """Masses from 1 to `ratio`, in any order."""
    if ratio <= 1:
        return np.ones(n)
    # not np.exp, whose last digit depends on the processor
    return np.array([math.exp(x) for x in rng.uniform(0, math.log(ratio), n)])


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
        left, right = rng.standard_normal((len(touched), rank)), rng.standard_normal((rank, d))
        block[touched] = product(left, right)
        if rng.uniform() < 0.05:
            block[:] = 0
        columns.append(block)
    return np.hstack(columns)


def joints(rng: np.random.Generator, n: int, p: int) -> Array:
    """G of p constraints; some follow from others, and one may be nothing."""
    G = rng.standard_normal((n, p)) * (rng.uniform(size=(n, p)) < 0.5)
    if p > 1 and rng.uniform() < 0.5:
        G[:, -1] = product(G[:, :-1], rng.integers(-2, 3, p - 1))
    return G


def planted(number: int) -> tuple[Any, fclib.Solution, Array | None]:
    """Problem `number`, a solution of it, and a guess: the same digits on every processor."""
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
    v = (product(H, impulse) + product(G, lam) + f) / mass
    mixed = {"G": G, "b": -product(G.T, v)} if p else {}
    kind: Any = fclib.GlobalRollingProblem if rolling else fclib.GlobalProblem
    problem: Any = kind(
        spacedim=d, M=np.diag(mass), H=H, f=f, w=u.ravel() - product(H.T, v), **law, **mixed
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


def corners(number: int) -> tuple[Any, fclib.Solution, Array | None]:
    """Problem `number` whose contacts are at the corners of the law, and its solution.

    The limits of friction are powers of two. The reactions that reach them are whole multiples of
    (5, mu (3, 4), mu_r (4, 3)), whose parts have whole norms. So the law holds exactly, and in half
    of the problems W, H and M are whole too.
    """
    rng = np.random.default_rng([number, 2030])
    rolling, whole = bool(rng.integers(2)), bool(rng.integers(2))
    d = int(rng.choice([3, 5] if rolling else [2, 3]))
    nc = int(rng.integers(1, 7))
    limits = np.array([[limit_of(rng) for _ in range(1 + rolling)] for _ in range(nc)])
    states = [corner(rng, d, own) for own in limits]
    u, r = (np.concatenate([state[k] for state in states]) for k in range(2))
    law = dict(zip(("mu", "mu_r"), limits.T, strict=False))
    n = int(rng.integers(d, d * nc + 4))
    if whole:
        H = rng.integers(-2, 3, (n, d * nc)).astype(float) * (rng.uniform(size=(n, d * nc)) < 0.4)
        mass = 4.0 ** rng.integers(-3, 4, n)
        f = rng.integers(-8, 9, n).astype(float)
    else:
        H, mass = directions(rng, n, d, nc), bodies_of(rng, n, 10.0 ** rng.uniform(0, 4))
        f = rng.standard_normal(n)
    M = np.diag(mass)
    if not whole and rng.integers(2):  # coupled, or next to not
        root = rng.standard_normal((n, n)) * (rng.uniform(size=(n, n)) < 0.3)
        scale = np.sqrt(np.outer(mass, mass)) / n
        M += (1.0, 1e-8, 1e-30)[rng.integers(3)] * scale * (root @ root.T)
    if rng.integers(2):
        v = np.linalg.solve(M, H @ r + f)
        made: Any = fclib.GlobalRollingProblem if rolling else fclib.GlobalProblem
        problem: Any = made(spacedim=d, M=M, H=H, f=f, w=u - H.T @ v, **law)
        solution = fclib.Solution(v=v, u=u, r=r)
    else:
        W = H.T @ np.linalg.solve(M, H)
        W = (W + W.T) / 2
        made = fclib.LocalRollingProblem if rolling else fclib.LocalProblem
        problem = made(spacedim=d, W=W, q=u - W @ r, **law)
        solution = fclib.Solution(u=u, r=r)
    return problem, solution, None


def limit_of(rng: np.random.Generator) -> float:
    """A limit of friction: 0, an ordinary one, or one of 2^-40 to 2^40."""
    kind = rng.integers(5)
    return float(0.0 if kind == 0 else 2.0 ** rng.integers(*((-3, 2) if kind < 3 else (-40, 41))))


def corner(rng: np.random.Generator, d: int, limits: Array) -> tuple[Array, Array]:
    """U and r of a contact at a corner of the law, all of whole numbers and powers of two."""
    size = (d - 1) // len(limits)
    u, r = np.zeros(d), np.zeros(d)
    closed = rng.integers(4) > 0
    unit = 2.0 ** rng.integers(-3, 4) / max(1.0, float(np.max(limits)) if rng.integers(2) else 1.0)
    r[0] = 5 * unit if closed else 0.0
    moves = False
    for k, limit in enumerate(limits):
        part = slice(1 + k * size, 1 + (k + 1) * size)
        along = rng.permutation([3.0, 4.0])[:size] if size == 2 else np.array([5.0])
        along *= rng.choice([-1.0, 1.0], size)
        speed = 2.0 ** rng.integers(-4, 3)
        if not closed:
            u[part] = along * speed * rng.integers(2)
            continue
        # at rest below the limit, without any share of it, or at it; or moving, and at it
        state = rng.integers(4)
        r[part] = along * limit * unit * (0.5, 0.0, 1.0, 1.0)[state]
        u[part] = -along * speed if state == 3 else 0.0
        moves = moves or state == 3
    if not closed:  # open, or grazing
        u[0] = 2.0 ** rng.integers(-4, 3) * rng.integers(2)
    return u, r


def spinning(number: int) -> tuple[Any, fclib.Solution, Array | None]:
    """Problem `number` with spin friction, its solution, and a guess.

    The law is that of SPIN_LAWS in turn. Coefficients may be zero, far from each other, or one and
    the same; contacts graze, stick at their limits, and move in each way.
    """
    rng = np.random.default_rng([number, 2033])
    name, d = SPIN_LAWS[number % len(SPIN_LAWS)]
    nc = int(rng.integers(1, 8))
    spread = rng.choice([0.0, 1.0, 6.0])
    law: dict[str, Any] = {
        key: size * 10.0 ** rng.uniform(-spread, spread / 6, nc) * (rng.uniform(size=nc) > 0.15)
        for key, size in (("mu", 0.5), ("mu_s", 0.02), ("mu_r", 0.01))[: d // 2]
    }
    u, r, _ = spin_states(rng, law, name == "ellipsoid")
    unit = 10.0 ** rng.choice([0, 0, -6, 6])
    n = int(rng.integers(d + 2, 2 * d * nc + 4))
    p = int(rng.integers(0, 3))
    mass = unit * bodies_of(rng, n, 10.0 ** rng.choice([0, 0, 3, 6]))
    H, G = directions(rng, n, d, nc), joints(rng, n, p)
    impulse = unit * r.ravel()
    lam, f = unit * rng.standard_normal(p), unit * rng.standard_normal(n)
    v = (H @ impulse + G @ lam + f) / mass
    problem: Any = fclib.GlobalSpinProblem(
        spacedim=d,
        M=np.diag(mass),
        H=H,
        f=f,
        w=u.ravel() - H.T @ v,
        coupled=int(name == "ellipsoid"),
        **law,
        **({"G": G, "b": -G.T @ v} if p else {}),
    )
    solution = fclib.Solution(v=v, u=u.ravel(), r=impulse, l=lam if p else None)
    guess = [None, None, impulse * (1 + 1e-3 * rng.standard_normal(d * nc))][rng.integers(3)]
    if rng.integers(2):  # the local form
        problem = problem.condense()
        solution = fclib.Solution(u=u.ravel(), r=impulse, l=lam if p else None)
    return problem, solution, guess


def held(number: int) -> tuple[Any, fclib.Solution, Array | None]:
    """Problem `number` with limits that the joints hold: what remains of them is rounding."""
    rng = np.random.default_rng([number, 2031])
    d = int(rng.choice([2, 3]))
    nc, limits, p = (int(rng.integers(*span)) for span in ((0, 4), (1, 4), (2, 6)))
    n = int(rng.integers(p + 2, p + d * nc + 8))
    mass = bodies_of(rng, n, 10.0 ** rng.uniform(0, 6))
    G = joints(rng, n, p)
    law, (u, r, _) = planted_law(rng, d, nc + limits, None, False)
    H = np.zeros((n, d * (nc + limits)))
    H[:, : d * nc] = directions(rng, n, d, nc) if nc else 0
    for a in range(nc, nc + limits):
        law["mu"][a] = 0
        u[a], r[a] = 0, 0
        held_by_joints = rng.integers(4) > 0
        H[:, d * a] = G @ rng.standard_normal(p) if held_by_joints else rng.standard_normal(n)
        (u if rng.integers(2) else r)[a, 0] = rng.integers(2) * rng.uniform(0.1, 2)
    lam, f = rng.standard_normal(p), rng.standard_normal(n)
    impulse = r.ravel()
    v = (H @ impulse + G @ lam + f) / mass
    problem: Any = fclib.GlobalProblem(
        spacedim=d, M=np.diag(mass), H=H, f=f, w=u.ravel() - H.T @ v, mu=law["mu"], G=G, b=-G.T @ v
    )
    solution = fclib.Solution(v=v, u=u.ravel(), r=impulse, l=lam)
    if rng.integers(2):
        problem, solution = problem.condense(), fclib.Solution(u=u.ravel(), r=impulse, l=lam)
    return problem, solution, None


def related_joints(number: int) -> tuple[Any, Array, float]:
    """A problem whose last joint follows from the others, and z with G z = 0; contradicted by gap.

    G and z are whole numbers. The joints contradict each other by z . b, exactly.
    """
    rng = np.random.default_rng([number, 2032])
    d, nc, p = int(rng.choice([2, 3])), int(rng.integers(0, 4)), int(rng.integers(2, 5))
    n = int(rng.integers(p + 1, p + d * nc + 5))
    G = rng.integers(-2, 3, (n, p)).astype(float)
    z = np.append(rng.integers(-2, 3, p - 1), -1.0)
    z[0] = 1.0
    G[:, -1] = G[:, :-1] @ z[:-1]
    v = rng.integers(-4, 5, n).astype(float)
    H = rng.integers(-2, 3, (n, d * nc)).astype(float)
    law, (u, r, _) = planted_law(rng, d, nc, None, False)
    mass = 4.0 ** rng.integers(-2, 3, n)
    problem = fclib.GlobalProblem(
        spacedim=d,
        M=np.diag(mass),
        H=H,
        f=mass * v - H @ r.ravel() - G @ rng.integers(-3, 4, p),
        w=u.ravel() - H.T @ v,
        G=G,
        b=-G.T @ v,
        mu=law["mu"],
    )
    return problem, z, float(2.0 ** rng.integers(-50, -3))


# ---- what is said of them


class Said(NamedTuple):
    """A word, who said it, and of which law; a word that is not true begins with "false"."""

    word: str
    solver: str
    law: str

    @property
    def false(self) -> bool:
        """Whether it is not true."""
        return self.word.startswith("false")


def law_of(problem: Any) -> str:
    """The law of a problem's contacts, in words."""
    if problem.kind.endswith("spin"):
        return "ellipsoid" if problem.coupled else f"spin{', rolling' * (problem.spacedim == 6)}"
    return "rolling" if problem.kind.endswith("rolling") else "Coulomb"


def drawn(problem: Any, number: int, solver: str) -> str:
    """The solver, or for `each` one of the built-in solvers that take the problem."""
    if solver != "each":
        return solver
    takers = [
        one.name
        for one in fclib.solvers()
        if one.origin == "fclib" and problem.spacedim in _registry.dimensions_of(one, problem.kind)
    ]
    # by chance, since the laws come in turn
    return takers[np.random.default_rng([number, 2034]).integers(len(takers))]


def limit_of_iterations(solver: str) -> int:
    """Enough for most problems that the solver solves at all."""
    return ITERATIONS if solver == "auto" else SWEEPS


def too_large(problem: Any, solution: fclib.Solution) -> bool:
    """Whether an error is proven to be above the tolerance, whatever rounding explains."""
    return bool(judge(problem, solution, rounding=True).error > LEEWAY * TOLERANCE)


def candidates(problem: Any, solution: fclib.Solution) -> Iterator[fclib.Solution]:
    """The solution, none, and wrong ones: by a little, or behind reactions that move nothing."""
    yield solution
    yield fclib.Solution(r=np.zeros(problem.m), l=solution.l)
    rng = np.random.default_rng(problem.m)
    r = np.asarray(solution.r)
    yield fclib.Solution(r=r * (1 + 1e-6 * rng.standard_normal(r.size)), l=solution.l)
    if hasattr(problem, "W"):
        A = dense(problem.W)
        if problem.p:
            A = np.block([[A, dense(problem.V)], [dense(problem.V).T, dense(problem.R)]])
    else:
        A = dense(problem.H)
        if problem.p:
            A = np.hstack([A, dense(problem.G)])
    unmoved = np.linalg.svd(A)[2][-1]
    moved = {
        name: x + 1e-3 * rng.standard_normal(x.size)
        for name in ("v", "u")
        if (x := getattr(solution, name)) is not None
    }
    stress = 1e12 * unmoved * np.linalg.norm(r)
    yield fclib.Solution(
        r=r + stress[: r.size], l=solution.l + stress[r.size :] if problem.p else None, **moved
    )


def misjudged(problem: Any, solution: fclib.Solution) -> str:
    """A false word of the merit, on the solution or on another one; '' without any."""
    q = problem.q if hasattr(problem, "W") else problem.condense().q
    size = float(np.linalg.norm(q)) or 1.0
    for one in candidates(problem, solution):
        said = fclib.merit(problem, one).error
        digits = DIGITS + EXTENDED * float(np.linalg.norm(one.r)) / size
        least, most = (judge(problem, one, rounding=taken).error for taken in (True, False))
        # what is wrong by more than q itself is wrong, by whatever factor
        if said < 1 and least > LEEWAY * said + digits:
            return f"false small ({said:.1e})"
        # if q is rounding, errors are relative to that of its terms, which is not exact
        comparable = not least > LEEWAY * float(most.upper())
        if comparable and not said <= LEEWAY * float(most.upper()) + digits:
            return f"false large ({said:.1e})"
    return ""


def verdict(
    number: int,
    solve: Callable[..., fclib.Result] = fclib.solve,
    plant: Plant = planted,
    solver: str = "auto",
) -> Said:
    """What a solver says of a problem, and the merit of its solution."""
    problem, solution, guess = plant(number)
    solver = drawn(problem, number, solver)
    return Said(word_on(problem, solution, guess, solve, solver), solver, law_of(problem))


def word_on(
    problem: Any,
    solution: fclib.Solution,
    guess: Array | None,
    solve: Callable[..., fclib.Result],
    solver: str,
) -> str:
    """The word of a solver on a problem whose solution is known."""
    word = misjudged(problem, solution)
    if word:
        return word
    if not judge(problem, solution).error <= 0.1 * TOLERANCE:
        return "rounding"  # the data do not hold their own solution
    start = None if guess is None else fclib.Solution(r=guess)
    try:
        result = solve(
            problem, solver=solver, guess=start, max_iterations=limit_of_iterations(solver)
        )
    except fclib.UnsuitableError as refusal:
        return f"false refusal: {refusal}"
    own = result.solution
    if own.r is None or own.r.shape != (problem.m,) or not np.isfinite(own.r).all():
        return "false solution"
    if result.status == "infeasible" or (solver == "auto" and result.status in FALSE):
        return f"false {result.status}"
    if result.converged:
        return "false converged" if too_large(problem, own) else "converged"
    none = fclib.Solution(r=np.zeros(problem.m))
    relaxed = fclib.find_solver(solver).family == "relaxation"  # another law
    if problem.p == 0 and not relaxed:  # what is at hand is not better
        at_hand = [none] if start is None else [none, start]
        least = min(fclib.merit(problem, one).error for one in at_hand)
        if not fclib.merit(problem, own).error <= LEEWAY * least:
            return f"false best ({result.status})"
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


def claim(
    number: int, solve: Callable[..., fclib.Result] = fclib.solve, solver: str = "auto"
) -> Said:
    """What a solver says of a problem without a solution."""
    problem = without_solution(number)
    solver = drawn(problem, number, solver)
    return Said(word_without(problem, solve, solver), solver, law_of(problem))


def word_without(problem: Any, solve: Callable[..., fclib.Result], solver: str) -> str:
    """The word of a solver on a problem that has none."""
    try:
        result = solve(problem, solver=solver, max_iterations=limit_of_iterations(solver))
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
        # rounding has given the condensed W a way out, or the gap closes within the tolerance
        local = isinstance(problem, fclib.LocalProblem | fclib.LocalRollingProblem)
        true = local and not too_large(problem, result.solution)
        return "converged, by rounding" if true else "false converged"
    return str(result.status)


def contradiction(number: int, solver: str = "auto", little: bool = False) -> Said:
    """What is said of joints that contradict each other, by `little` or clearly."""
    problem, z, gap = related_joints(number)
    b = problem.b.copy()
    b[-1] += gap if little else 1.0
    problem = problem.replace(b=b)
    solver = drawn(problem, number, solver)
    return Said(word_on_joints(problem, z, little, solver), solver, law_of(problem))


def word_on_joints(problem: Any, z: Array, little: bool, solver: str) -> str:
    """The word of a solver, and of the analysis, on joints that contradict each other by z . b."""
    word = "refused"
    try:
        result = fclib.solve(problem, solver, max_iterations=limit_of_iterations(solver))
    except fclib.UnsuitableError as refusal:
        if np.dot(z, problem.b) == 0:  # b has rounded the difference away
            return f"false refusal: {refusal}"
    else:
        if result.converged and too_large(problem, result.solution):
            return "false converged"
        word = str(result.status)
    if not little and analysis.analyze(problem, time_limit=1.0).existence.verdict[:6] == "exists":
        return "false existence"
    return word


def damaged(number: int, solver: str = "") -> Said:
    """What is said of a file of which a part is missing; no solver is asked."""
    problem, solution, _ = planted(number)
    return Said(word_on_file(number, problem, solution), solver, law_of(problem))


def word_on_file(number: int, problem: Any, solution: fclib.Solution) -> str:
    """The word of `fclib.read` on the file of a problem that was damaged."""
    rng = np.random.default_rng([number, 2033])
    with tempfile.TemporaryDirectory(prefix="planted-") as folder:
        path = Path(folder) / "problem.hdf5"
        fclib.write(path, problem, solution)
        kind = damage(rng, path, f"fclib_{problem.kind}")
        try:
            read = fclib.read(path)
        except fclib.Error:
            return "refused"
    names = ("W", "q", "V", "R", "s", "M", "H", "f", "w", "G", "b", "mu", "mu_r")
    for own, other in ((getattr(problem, x, None), getattr(read, x, None)) for x in names):
        if (own is None) != (other is None):
            return f"false read: {kind}"
        if own is not None and not np.array_equal(dense(own), dense(other)):
            return f"false read: {kind}"
    return "whole"  # what is missing is not of the problem, or it is zeros


def damage(rng: np.random.Generator, path: Path, group: str) -> str:
    """Takes a part of the file away, and says how."""
    kind = ("ends early", "never written", "half written", "no pointers")[rng.integers(4)]
    if kind == "ends early":
        size = path.stat().st_size
        with path.open("r+b") as file:
            file.truncate(int(rng.integers(1, size)))
        return kind
    with h5py.File(path, "r+") as file:
        arrays: list[str] = []
        file[group].visititems(
            lambda name, item: (
                arrays.append(name) if isinstance(item, h5py.Dataset) and item.ndim else None
            )
        )
        if kind == "no pointers":
            # of triplets they are columns, and 0 is one
            arrays = [
                name
                for name in arrays
                if name.endswith("/p") and np.ravel(file[f"{group}/{name[:-2]}/nz"])[0] < 0
            ]
            if not arrays:
                kind = "never written"
                arrays = [name for name in ("vectors/mu",) if name in file[group]]
        name = f"{group}/{arrays[rng.integers(len(arrays))]}"
        values = file[name][()]
        if kind == "no pointers":
            file[name][...] = 0
            return kind
        del file[name]
        chunks = (1,) if kind == "half written" or rng.integers(2) else None
        made = file.create_dataset(name, values.shape, values.dtype, chunks=chunks)
        if kind == "half written":
            made[: len(values) // 2] = values[: len(values) // 2]
    return kind


REGIMES: dict[str, Callable[..., Said]] = {
    "random": verdict,
    "digits": functools.partial(verdict, plant=hard),
    "corners": functools.partial(verdict, plant=corners),
    "spin": functools.partial(verdict, plant=spinning),
    "held limits": functools.partial(verdict, plant=held),
    "nearly": functools.partial(contradiction, little=True),
    "contradicting": contradiction,
    "unsolvable": claim,
    "damaged": damaged,
}


def main() -> int:
    """Run the problems; see the top of the file."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("count", type=int, nargs="?", default=1000)
    parser.add_argument("first", type=int, nargs="?", default=0)
    parser.add_argument("--regime", choices=list(REGIMES))
    parser.add_argument("--solver", default="auto")
    arguments = parser.parse_args()
    words: Counter[str] = Counter()
    false = 0
    for name in [arguments.regime] if arguments.regime else list(REGIMES):
        for number in range(arguments.first, arguments.first + arguments.count):
            said = REGIMES[name](number, solver=arguments.solver)
            false += said.false
            if said.false:
                print(f"{name} {number}: {said.solver}: {said.word}", flush=True)
            words[f"{name}: {said.word.split(' (')[0].split(': ')[0]}"] += 1
    for word, times in sorted(words.items()):
        print(f"{times:7d}  {word}")
    return int(false > 0)


if __name__ == "__main__":
    sys.exit(main())
