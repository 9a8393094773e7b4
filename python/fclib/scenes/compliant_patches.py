"""Contact patches that yield: many points of a pressure field, with compliance on their normals."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib import _core
from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

POINTS: Final = (2, 4, 8, 16)  # of a pad, along an edge
OFFSETS: Final = (0.0, 0.5)  # of the pads from the middle of the box, in edges of a pad
GRIPS: Final = (0.9, 1.1, 3.0)  # friction of the pads over the weight
WALLS: Final = (100, 300)  # contacts of a wall of corners, which become patches
JOINTS: Final = (2, 4)  # points of a patch of a wall, along an edge
GRADIENTS: Final = (1e7, 1e9, 1e11)  # of the pressure in a wall [Pa/m]

EDGE: Final = 0.04  # of a pad [m]
BOX: Final = (0.05, 0.10, 0.06)  # half edges of the box [m]
MASS: Final = 1.0  # of the box [kg]


@dataclass(frozen=True, kw_only=True)
class CompliantPatches:
    """Faces that press each other over patches of quadrature points, as in hydroelastic contact.

    A pressure grows by G for each metre of depth. A point of the area A is a spring of the
    stiffness k = G A with a damper k tau. At the end of the step, with the gap g at its start,

        r_N = max(0, -h k (g + (h + tau) u_N)),

    which is contact with compliance: 0 <= r_N  _|_  u_N + g / (h + tau) + R r_N >= 0 with
    R = 1 / (h k (h + tau)). So w_N = g / (h + tau), and R is on the diagonal of W: in the global
    form it is the inverse mass of one auxiliary degree of freedom a point (docs/mathematics.md).

    grip    a box between two pads, which press it by friction alone against its weight, at its
            middle or beside it, where the patches must hold it from turning, too. At its middle it
            holds if and only if 2 mu G A depth >= m g, and else falls by the difference
    wall    a wall of blocks that is pushed at the top, each face a patch

    Why it is here: rows of contacts that share six degrees of freedom, regular by R alone, which
    is tiny for stiff matter.

    R. Elandt, E. Drumwright, M. Sherman, A. Ruina, A pressure field model for fast, robust
      approximation of net contact force and moment between nominally rigid objects, IROS 2019.
    A. Castro, F. Permenter, X. Han, An unconstrained convex formulation of compliant contact, IEEE
      Transactions on Robotics 39, 2023.
    """

    title: ClassVar[str] = "Compliant patches"
    description: ClassVar[str] = "A gripped box, a pushed wall: patches with a pressure field."
    application: ClassVar[str] = "robotics"
    authors: ClassVar[str] = "the authors of FCLIB; the model: R. Elandt, A. Castro and others"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere; normals yield"
    collection: ClassVar[str] = "laws"
    problems: ClassVar[int] = len(POINTS) * len(OFFSETS) * len(GRIPS) + len(WALLS) * len(
        JOINTS
    ) * len(GRADIENTS)

    mu: float = parameter(0.5, "1", "coefficient of friction")
    depth: float = parameter(1e-4, "m", "of the pads in the box")
    relaxation: float = parameter(1e-2, "s", "tau, of the damper over the spring")
    push: float = parameter(0.1, "1", "impulse on the top of a wall, in its weights")

    def __post_init__(self) -> None:
        mjcf.check(self, positive=("mu", "depth"), non_negative=("relaxation", "push"))

    def problem(self, number: int, seed: int = 0) -> Any:
        """Grips by points, offset and friction; then walls; the seed draws the walls' masses."""
        grips = len(POINTS) * len(OFFSETS) * len(GRIPS)
        if number < grips:
            points, rest = divmod(number, len(OFFSETS) * len(GRIPS))
            offset, grip = divmod(rest, len(GRIPS))
            return self.grip(POINTS[points], OFFSETS[offset], GRIPS[grip])
        size, rest = divmod(number - grips, len(JOINTS) * len(GRADIENTS))
        joint, gradient = divmod(rest, len(GRADIENTS))
        return self.wall(WALLS[size], JOINTS[joint], GRADIENTS[gradient], seed)

    def grip(self, points: int, offset: float, share: float) -> Any:
        """A box between two pads of points x points; share: their friction over its weight."""
        at = (np.arange(points) + 0.5) / points - 0.5
        y, z = (part.ravel() for part in np.meshgrid(EDGE * (at + offset), EDGE * at))
        x, y, z = np.repeat((-BOX[0], BOX[0]), len(y)), np.tile(y, 2), np.tile(z, 2)
        inwards = np.zeros((len(x), 3))
        inwards[:, 0] = np.where(x < 0, 1.0, -1.0)
        a, b, c = (2 * half for half in BOX)
        turning = MASS / 12 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
        # two pads of the area EDGE^2 at this depth
        gradient = share * MASS * assembly.GRAVITY / (2 * self.mu * EDGE * EDGE * self.depth)
        bodies = assembly.Bodies(
            masses=np.array([MASS]),
            inertias=turning[None],
            centres=np.zeros((1, 3)),
            first=np.full(len(x), -1),
            second=np.zeros(len(x), dtype=np.int64),
            normals=inwards,
            points=np.column_stack((x, y, z)),
            impulses=np.zeros((1, 3)),
            sizes=np.array([BOX]),
            planes=np.array(
                [[-BOX[0], 0.0, 0.0, 1.0, 0.0, 0.0], [BOX[0], 0.0, 0.0, -1.0, 0.0, 0.0]]
            ),
            gaps=np.full(len(x), -self.depth),
        )
        area = np.full(len(x), EDGE * EDGE / points**2)
        title = f"grip, 2 x {points} x {points} points, {offset:g} beside, {share:g} of the weight"
        return self.yielding(bodies, gradient * area, title)

    def wall(self, contacts: int, points: int, gradient: float, seed: int = 0) -> Any:
        """A wall of about so many corners, whose faces become patches of points x points."""
        corners = assembly.running_bond(contacts, seed, push=self.push)
        # four corners a patch: x and y of the first, of the second along y, of the third along x
        patch = corners.points.reshape(-1, 4, 3)
        low, high = patch[:, 0], patch[:, 3]
        at = (np.arange(points) + 0.5) / points
        x, y = (part.ravel() for part in np.meshgrid(at, at))
        which = np.repeat(np.arange(len(patch)), points**2)
        share = np.tile(np.column_stack((x, y, np.zeros(len(x)))), (len(patch), 1))
        area = ((high - low)[:, 0] * (high - low)[:, 1])[which] / points**2
        # as deep as its weight presses a block of the lowest course, were it alone
        weight = assembly.total(corners.masses) * assembly.GRAVITY
        ground = area[corners.first[4 * which] < 0]
        depth = weight / (gradient * assembly.total(ground))
        bodies = replace(
            corners,
            first=corners.first[4 * which],
            second=corners.second[4 * which],
            normals=corners.normals[4 * which],
            points=low[which] + share * (high - low)[which],
            gaps=np.full(len(which), -depth),
        )
        title = f"wall, {len(patch)} patches of {points} x {points} points, {gradient:g} Pa/m"
        return self.yielding(bodies, gradient * area, title)

    def yielding(
        self, bodies: assembly.Bodies, stiffness: npt.NDArray[np.float64], title: str
    ) -> Any:
        """The problem of bodies whose contacts (nc) have a stiffness [N/m]."""
        rigid = bodies.problem(self.mu, title)
        h, nc = assembly.STEP, rigid.nc
        lag = h + self.relaxation
        compliance = 1 / (h * stiffness * lag)  # R [m/s / (N s)]
        w = np.zeros(3 * nc)
        w[0::3] = np.asarray(bodies.gaps) / lag
        normal = 3 * np.arange(nc)
        auxiliary = sp.csc_array((np.ones(nc), (np.arange(nc), normal)), shape=(nc, 3 * nc))
        return _core.GlobalProblem(
            M=sp.diags_array(np.concatenate((rigid.M.diagonal(), 1 / compliance))).tocsc(),
            H=sp.vstack((rigid.H, auxiliary)).tocsc(),
            f=np.concatenate((rigid.f, np.zeros(nc))),
            w=w,
            mu=rigid.mu,
            spacedim=3,
            info=assembly.told(
                rigid.info,
                {"relaxation": self.relaxation, "stiffness": sorted(set(stiffness.tolist()))},
                f"the last {nc} of v are the compliance of the normals, R r_N, their mass is 1/R;"
                " R = 1 / (h k (h + tau)), w_N = gap / (h + tau)",
            ),
            contacts=rigid.contacts,
            bodies=rigid.bodies,
        )
