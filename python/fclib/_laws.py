"""The contact law of a problem: the groups of components of a contact, and the limit of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import _core

Array: TypeAlias = npt.NDArray[np.float64]
Local: TypeAlias = _core.LocalProblem | _core.LocalRollingProblem | _core.LocalSpinProblem
Global: TypeAlias = _core.GlobalProblem | _core.GlobalRollingProblem | _core.GlobalSpinProblem
Problem: TypeAlias = Local | Global

# the coefficients of friction that there are, in the order of the components that they bound
COEFFICIENTS = ("mu", "mu_s", "mu_r")


# the root of 1/2, rounded down: a product of two limits of this share is in the ellipsoid
INSCRIBED = 0.707106781186547

CLASSES: dict[str, type[Problem]] = {
    "local": _core.LocalProblem,
    "local_rolling": _core.LocalRollingProblem,
    "local_spin": _core.LocalSpinProblem,
    "global": _core.GlobalProblem,
    "global_rolling": _core.GlobalRollingProblem,
    "global_spin": _core.GlobalSpinProblem,
}


@dataclass(frozen=True)
class Group:
    """The components of a contact that share a limit: ||r_g / axes|| <= r_N.

    Attributes:
        name: t (sliding), s (spin), r (rolling) or ts (the ellipsoid of sliding and spin).
        axes: the half-axes of the limit (nc, components), all alike but for the ellipsoid.
        part: the components.
    """

    name: str
    axes: Array
    part: slice

    @property
    def uniform(self) -> bool:
        """Whether the limit is a disk or a segment, ||r_g|| <= coefficient r_N."""
        return self.name != "ts"

    @property
    def coefficient(self) -> Array:
        """The coefficient of each contact (nc); of the ellipsoid, that of sliding."""
        return np.asarray(self.axes[:, 0])

    def resistance(self, u: Array) -> Array:
        """||axes u_g|| for contacts (nc, d): what the group adds to u_N in u^."""
        moved = u[:, self.part]
        if self.uniform:
            return np.asarray(self.coefficient * np.linalg.norm(moved, axis=1))
        return np.asarray(np.linalg.norm(self.axes * moved, axis=1))


def boxes(problem: Problem, *, inner: bool) -> list[tuple[Array, slice]]:
    """Coefficients and components of a product of disks and segments.

    It is K itself if each group has a limit of its own. Beside an ellipsoid it is a product that
    contains K, or that K contains.
    """
    found: list[tuple[Array, slice]] = []
    for group in groups(problem):
        if group.uniform:
            found.append((group.coefficient, group.part))
            continue
        share = INSCRIBED if inner else 1.0
        found.append((share * group.axes[:, 0], slice(1, 3)))
        found.append((share * group.axes[:, 2], slice(3, 4)))
    return found


def law_of(kind: str) -> str:
    """The law of a kind of problems: "", "rolling" or "spin"."""
    return kind.partition("_")[2]


def groups(problem: Problem) -> list[Group]:
    """The groups of a problem's contacts."""
    if isinstance(problem, (_core.LocalSpinProblem, _core.GlobalSpinProblem)) and problem.coupled:
        mu = problem.mu
        return [Group("ts", np.stack([mu, mu, problem.mu_s], axis=1), slice(1, 4))]
    bounds = coefficients(problem).values()
    found = []
    for (name, part), bound in zip(parts(problem).items(), bounds, strict=True):
        size = part.stop - part.start
        found.append(Group(name, np.repeat(bound[:, None], size, axis=1), part))
    return found


def coefficients(problem: Problem) -> dict[str, Array]:
    """The coefficients of friction by their names, each (nc)."""
    known = {name: getattr(problem, name) for name in names(problem.kind, problem.spacedim)}
    # mu_r of no contacts is not there
    return {name: np.zeros(0) if bound is None else bound for name, bound in known.items()}


def names(kind: str, d: int) -> list[str]:
    """The names of the coefficients of friction that contacts of d components have."""
    law = law_of(kind)
    rolls = law == "rolling" or d == 6
    has = {"mu": True, "mu_s": law == "spin", "mu_r": rolls}
    return [name for name in COEFFICIENTS if has[name]]


def parts(problem: Problem) -> dict[str, slice]:
    """The components of sliding (t), spin (s) and rolling (r)."""
    d, law = problem.spacedim, law_of(problem.kind)
    if law == "spin":
        return {"t": slice(1, 3), "s": slice(3, 4), **({"r": slice(4, 6)} if d == 6 else {})}
    half = of_force(problem.kind, d)
    return {"t": slice(1, half), **({"r": slice(half, d)} if law else {})}


def of_force(kind: str, d: int) -> int:
    """How many components of a contact are those of a force: N and T; the others are moments."""
    law = law_of(kind)
    return 3 if law == "spin" else (d + 1) // 2 if law == "rolling" else d
