"""Moreau-Jean time stepping of a mechanical system with contact, Coulomb friction and impacts.

One step of length h, theta = 1, forces taken at its start:

    M (v' - v) = h F(q, v) + H r + G lambda         dynamics, r and lambda impulses
    u = H^T v' + w                                  local velocities, N, T1, T2 for each contact
    G^T v' + b = 0                                  bilateral constraints
    K* contains u^, u^ . r = 0, r in K              Coulomb's law on the active contacts
    q' = q (+) h v'                                 on the manifold of configurations

which is the problem GM3DFC (G3DFC without bilateral constraints) with f = M v + h F.

    q, v    configuration and velocity at t; v' the velocity at t + h
    gap     g, signed distance at a contact [m], < 0 where bodies penetrate
    u_N^-   normal velocity before the step, (H^T v)_N; > 0 separates

Two unilateral laws:

velocity (default)  a contact is active where g + h/2 u_N^- <= 0, with Newton's law of impact
                    u_N' + e u_N^- >= 0, that is w_N = e u_N^-, w_T = 0. Restitution is exact, a
                    penetration (of order h u_N at an impact) is kept and not amplified.
gap                 every contact within reach is active, with g + h u_N' >= 0, that is
                    w_N = g / h. Where g < 0 only a share of it, the stabilization, is undone in
                    a step, since all of it would throw the bodies apart. Inelastic: no e.

A bilateral constraint with violation c is corrected by the same share: b = stabilization c / h.

J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, in Nonsmooth
  Mechanics and Applications, CISM 302, Springer, 1988.
M. Jean, The non-smooth contact dynamics method, Computer Methods in Applied Mechanics and
  Engineering 177, 1999, 235-257.
V. Acary, B. Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, Springer, 2008,
  chapter 10.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

import fclib
from fclib.scenes import Law

Vector: TypeAlias = npt.NDArray[np.float64]
Sparse: TypeAlias = Any  # a SciPy sparse array


@dataclass(frozen=True)
class Contacts:
    """The geometry of nc contacts, in the order of the problem's blocks."""

    pair: npt.NDArray[np.int64]  # (nc x 2) the two geometries; N points from the first to the other
    point: Vector  # (nc x 3) in the world [m], midway between the two
    frame: Vector  # (nc x 3 x 3) rows N, T1, T2 in the world
    gap: Vector  # (nc) signed distance [m]
    mu: Vector  # (nc) coefficient of friction

    def __len__(self) -> int:
        return len(self.gap)

    def __getitem__(self, which: npt.NDArray[Any]) -> Contacts:
        return Contacts(
            self.pair[which], self.point[which], self.frame[which], self.gap[which], self.mu[which]
        )


@dataclass(frozen=True)
class System:
    """The equations of motion at one configuration, and the contacts within reach."""

    M: Sparse  # (n x n) mass matrix
    force: Vector  # (n) F(q, v): all but the reactions, gyroscopic terms included
    H: Sparse  # (n x 3 nc) contact directions
    contacts: Contacts  # nc
    G: Sparse  # (n x p) gradients of the bilateral constraints, d violation / dt = G^T v
    violation: Vector  # (p) of the bilateral constraints


class ContactModel(Protocol):
    """A mechanical system with contacts: all that the time stepper asks of it."""

    @property
    def position(self) -> Vector:
        """Configuration q (nq), a copy; nq > n where there are rotations."""
        ...

    @property
    def velocity(self) -> Vector:
        """Velocity v (n), a copy."""
        ...

    def assemble(self, h: float, *, shared_speed: bool) -> System:
        """The system at (q, v), with every contact that may close within h.

        Each body is taken to move at its own speed, or with `shared_speed` at that of the
        fastest, since impacts pass speed on.
        """
        ...

    def integrate(self, h: float, v: Vector) -> None:
        """Take v as the velocity and move by h v: q <- q (+) h v."""
        ...


@dataclass(frozen=True, kw_only=True)
class MoreauJean:
    """The scheme: from a system and a velocity to the problem of one step."""

    h: float  # time step [s]
    restitution: float = 0.0  # e of Newton's law, in [0, 1]
    law: Law = "velocity"
    stabilization: float = 0.2  # share of a penetration or of a violation undone in a step

    def __post_init__(self) -> None:
        if not self.h > 0:
            raise ValueError(f"the time step must be positive, not {self.h}")
        if not 0 <= self.restitution <= 1:
            raise ValueError(f"restitution must be in [0, 1], not {self.restitution}")
        if not 0 <= self.stabilization <= 1:
            raise ValueError(f"stabilization must be in [0, 1], not {self.stabilization}")
        if self.law not in ("velocity", "gap"):
            raise ValueError(f'the law must be "velocity" or "gap", not {self.law!r}')
        if self.law == "gap" and self.restitution:
            raise ValueError("the gap law is inelastic: restitution needs the velocity law")

    def assemble(self, model: ContactModel) -> System:
        """The model's system, with the contacts that this law needs."""
        return model.assemble(self.h, shared_speed=self.law == "gap")

    def problem(
        self, system: System, v: Vector, info: fclib.ProblemInfo | None = None
    ) -> tuple[fclib.GlobalProblem, Contacts]:
        """The problem of the step from velocity v (n), and its contacts: the active ones only."""
        h = self.h
        contacts, H = system.contacts, system.H
        if self.law == "velocity":
            before = (H.T @ v)[0::3]
            active = np.flatnonzero(contacts.gap + 0.5 * h * before <= 0)
            contacts, H = contacts[active], H[:, block_columns(active)]
            w_n = self.restitution * before[active]
        else:
            share = np.where(contacts.gap > 0, 1.0, self.stabilization)
            w_n = share * contacts.gap / h

        w = np.zeros(3 * len(contacts))
        w[0::3] = w_n
        bilateral = system.G.shape[1] > 0
        problem = fclib.GlobalProblem(
            M=system.M,
            H=H,
            G=system.G if bilateral else None,
            f=system.M @ v + h * system.force,
            w=w,
            mu=contacts.mu,
            b=self.stabilization / h * system.violation if bilateral else None,
            spacedim=3,
            info=info or fclib.ProblemInfo(),
        )
        return problem, contacts


def block_columns(blocks: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    """The columns (3 nc) of the given contacts (nc)."""
    columns: npt.NDArray[np.intp] = (3 * blocks[:, None] + np.arange(3)).ravel()
    return columns
