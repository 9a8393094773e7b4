"""Planted problems whose joints contradict each other: none of them has a solution.

    python tests/contradicting_joints.py [--count 150]

Each comes with the contradiction, z with B^T z = 0 and e . z != 0, which rational numbers confirm
here. `fclib analyze` must never say "exists" or "unique" of one.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

import fclib
from fclib import analysis
from helpers import dense, planted_global, planted_local

Array: TypeAlias = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Planted:
    """A problem, and the rows of its joints that contradict each other."""

    kind: str
    problem: Any
    z: Array

    def confirmed(self) -> bool:
        """Whether z is a contradiction, in rational numbers."""
        problem = self.problem
        local = isinstance(problem, (fclib.LocalProblem, fclib.LocalRollingProblem))
        parts = (problem.V, problem.R) if local else (problem.G,)
        rows = np.vstack([dense(a) for a in parts])
        exact = [Fraction(float(one)) for one in self.z]
        vanishes = all(
            sum((Fraction(float(a)) * z for a, z in zip(row, exact, strict=True)), Fraction()) == 0
            for row in rows
        )
        e = problem.s if local else problem.b
        said = sum((Fraction(float(a)) * z for a, z in zip(e, exact, strict=True)), Fraction())
        return vanishes and said != 0


def short(rng: np.random.Generator, *shape: int) -> Array:
    """Numbers of few bits, whose sums are exact."""
    return np.asarray(rng.integers(-8, 9, shape) / 8.0)


LAWS = [{"d": 2}, {"d": 3}, {"d": 3, "rolling": True}, {"d": 5, "rolling": True}]


def base(rng: np.random.Generator, p: int) -> Any:
    """A global problem with joints that agree."""
    law: dict[str, Any] = LAWS[rng.integers(len(LAWS))]
    return planted_global(int(rng.integers(10**6)), p=p, **law).problem


def equal(rng: np.random.Generator) -> tuple[Any, Array]:
    """Two equal columns of G that ask for different velocities."""
    problem = base(rng, 3)
    G = np.hstack([dense(problem.G), dense(problem.G)[:, :1]])
    b = np.append(problem.b, problem.b[0] + rng.choice([1e-6, 1e-3, 1.0, 1e3]))
    return problem.replace(G=G, b=b), np.array([1.0, 0, 0, -1])


def scaled(rng: np.random.Generator) -> tuple[Any, Array]:
    """The second row in other units, by a power of two."""
    problem = base(rng, 2)
    factor = 2.0 ** int(rng.integers(-40, 41))
    G = np.hstack([dense(problem.G), factor * dense(problem.G)[:, :1]])
    b = np.append(problem.b, factor * (problem.b[0] + 1.0))
    return problem.replace(G=G, b=b), np.array([factor, 0, -1.0])


def combined(rng: np.random.Generator) -> tuple[Any, Array]:
    """A row that is the sum of others, of numbers of few bits."""
    problem = base(rng, 3)
    G = short(rng, problem.n, 3)
    z = np.append(rng.integers(1, 4, 3) * rng.choice([-1, 1], 3), 1.0)
    b = short(rng, 3)
    G = np.hstack([G, -(G @ z[:3])[:, None]])
    off = rng.choice([2.0**-20, 2.0**-3, 1.0])
    return problem.replace(G=G, b=np.append(b, -(b @ z[:3]) + off)), z


def tiny(rng: np.random.Generator) -> tuple[Any, Array]:
    """A contradiction of the last digits: exact all the same."""
    problem = base(rng, 2)
    G = np.hstack([dense(problem.G), dense(problem.G)[:, :1]])
    first = problem.b[0] or 1.0
    other = float(first) * (1 + 2.0 ** -int(rng.integers(25, 50)))
    return problem.replace(G=G, b=np.array([first, problem.b[1], other])), np.array([1.0, 0, -1])


def empty(rng: np.random.Generator) -> tuple[Any, Array]:
    """A row of nothing that asks for a velocity."""
    problem = base(rng, 2)
    G = np.hstack([dense(problem.G), np.zeros((problem.n, 1))])
    asked = rng.choice([1e-12, 1e-3, 1.0])
    return problem.replace(G=G, b=np.append(problem.b, asked)), np.array([0.0, 0, 1])


def rigid(rng: np.random.Generator) -> tuple[Any, Array]:
    """More rows than velocities: all of them are held, one twice."""
    n = int(rng.integers(2, 6))
    G = np.hstack([np.eye(n), np.eye(n)[:, :1]])
    b = np.append(short(rng, n), 0.0)
    b[-1] = b[0] + rng.choice([2.0**-30, 0.25])
    root = short(rng, n, n)
    problem = fclib.GlobalProblem(
        spacedim=2,
        M=root @ root.T + np.eye(n),
        H=short(rng, n, 2),
        G=G,
        f=short(rng, n),
        w=[0, 0],
        b=b,
        mu=[0.5],
    )
    z = np.zeros(n + 1)
    z[0], z[-1] = 1, -1
    return problem, z


def heavy(rng: np.random.Generator) -> tuple[Any, Array]:
    """Beside masses far apart: what is contradicted is small in M's metric."""
    problem = base(rng, 2)
    sizes = 10.0 ** rng.uniform(-6, 6, problem.n)
    G = np.hstack([dense(problem.G), dense(problem.G)[:, 1:]])
    b = np.append(problem.b, problem.b[1] + 1e-3)
    M = np.diag(sizes)
    return problem.replace(M=M, G=G, b=b), np.array([0, 1.0, -1])


def apart(rng: np.random.Generator) -> tuple[Any, Array]:
    """A loop that is no contact's, beside contacts that are well."""
    problem = base(rng, 1)
    n = problem.n
    M = np.block([[dense(problem.M), np.zeros((n, 2))], [np.zeros((2, n)), np.eye(2)]])
    H = np.vstack([dense(problem.H), np.zeros((2, problem.m))])
    G = np.zeros((n + 2, 3))
    G[:n, :1] = dense(problem.G)
    G[n:, 1] = G[n:, 2] = [1.0, -1.0]
    return (
        problem.replace(
            M=M, H=H, G=G, f=np.append(problem.f, [0, 0]), b=np.append(problem.b, [0, 1e-4])
        ),
        np.array([0, 1.0, -1]),
    )


def local(rng: np.random.Generator) -> tuple[Any, Array]:
    """The local form: equal columns of V and R."""
    law: dict[str, Any] = LAWS[rng.integers(len(LAWS))]
    problem: Any = planted_local(int(rng.integers(10**6)), p=2, **law).problem
    repeat = np.array([[1.0, 0, 1], [0, 1, 0]])
    s = np.append(problem.s, problem.s[0] + rng.choice([1e-3, 1.0]))
    V, R = dense(problem.V) @ repeat, repeat.T @ dense(problem.R) @ repeat
    return problem.replace(V=V, R=R, s=s), np.array([1.0, 0, -1])


def unheld(rng: np.random.Generator) -> tuple[Any, Array]:
    """The local form: a joint whose V and R are zero."""
    problem: Any = planted_local(int(rng.integers(10**6)), p=1, d=2).problem
    V = np.hstack([dense(problem.V), np.zeros((problem.m, 1))])
    R = np.diag([float(dense(problem.R)[0, 0]), 0.0])
    return problem.replace(V=V, R=R, s=np.append(problem.s, 0.5)), np.array([0.0, 1])


def low_rank(rng: np.random.Generator) -> tuple[Any, Array]:
    """The local form: an R of low rank, of numbers of few bits."""
    problem: Any = planted_local(int(rng.integers(10**6)), p=1, d=3).problem
    turn = np.array([[1.0, 2.0, 1.0], [0.0, 1.0, 1.0]])  # (2 x 3)
    root = short(rng, 2, 2) + 2 * np.eye(2)
    R = turn.T @ (root @ root.T) @ turn
    V = short(rng, problem.m, 2) @ turn
    z = np.array([1.0, -1.0, 1.0])  # turn @ z = 0
    s = short(rng, 3)
    s[0] += 0.125 - float(s @ z)
    return problem.replace(V=V, R=R, s=s), z


def condensed(rng: np.random.Generator) -> tuple[Any, Array]:
    """The local form of equal columns of G, which condensation keeps equal."""
    problem, z = equal(rng)
    return problem.condense(), z


KINDS: dict[str, Callable[[np.random.Generator], tuple[Any, Array]]] = {
    make.__name__: make
    for make in (
        equal, scaled, combined, tiny, empty, rigid, heavy, apart,
        local, unheld, low_rank, condensed,
    )
}  # fmt: skip


def planted(number: int) -> Planted:
    """The problem of a number; the kinds take turns."""
    kind = list(KINDS)[number % len(KINDS)]
    problem, z = KINDS[kind](np.random.default_rng(number))
    return Planted(kind, problem, z)


def verdict(problem: Any) -> tuple[str, str]:
    """What `analyze` says of existence and of uniqueness."""
    found = analysis.analyze(problem, time_limit=2.0)
    return found.existence.verdict, found.uniqueness.verdict


def main() -> int:
    """The table of what is said of each kind; 1 if anything is said to exist or to be unique."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--count", type=int, default=150)
    table: dict[str, Counter[str]] = {}
    wrong = 0
    for number in range(arguments.parse_args().count):
        case = planted(number)
        assert case.confirmed(), (number, case.kind)
        exists, unique = verdict(case.problem)
        table.setdefault(case.kind, Counter())[f"{exists}, {unique}"] += 1
        if exists.startswith("exists") or unique == "unique":
            wrong += 1
            print(f"number {number}, {case.kind}: {exists}, {unique}")
    for kind, counts in table.items():
        print(f"{kind:10}", "; ".join(f"{word}: {count}" for word, count in counts.items()))
    print(f"{wrong} said to exist or to be unique")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
