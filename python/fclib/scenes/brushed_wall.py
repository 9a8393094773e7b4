"""A wall of brushed stones: friction by an ellipse, as Coulomb's problem by a scaling."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

SIZES: Final = (100, 300, 1000, 3000)  # approximate numbers of contacts
RATIOS: Final = (1.0, 2.0, 5.0, 20.0)  # of the friction along the grain's two axes
PUSHES: Final = (0.2, 0.6)  # impulse on the top, in weights of all blocks


@dataclass(frozen=True, kw_only=True)
class BrushedWall:
    """Blocks whose faces are brushed: along the grain they slide more easily than across it.

    The friction of a contact is an ellipse, r_T1 / mu1 and r_T2 / mu2 within r_N, and sliding
    dissipates as much as it can. In r^ = S r, u^ = S^-1 u with S = diag(1, mu / mu1, mu / mu2) this
    is Coulomb's law with mu (docs/mathematics.md), and the problem is the plain one with
    H^ = H S^-1. The files have that one, with mu^2 = mu1 mu2; their description has S. T1 is along
    the grain, whose direction is drawn for each pair of faces.

    It is no scaling of another law, that friction is opposite to the velocity.

    A. Michalowski, Z. Mroz, Associated and non-associated sliding rules in contact friction
    problems, Archives of Mechanics 30, 1978.
    """

    title: ClassVar[str] = "Brushed wall"
    description: ClassVar[str] = "A pushed wall of blocks with friction by ellipses."
    application: ClassVar[str] = "masonry"
    authors: ClassVar[str] = "the authors of FCLIB; the law: A. Michalowski and Z. Mroz"
    friction: ClassVar[str] = "an ellipse at each contact, as Coulomb by a scaling"
    collection: ClassVar[str] = "laws"
    problems: ClassVar[int] = len(SIZES) * len(RATIOS) * len(PUSHES)

    mu: float = parameter(0.4, "1", "root of the product of the friction along both axes")

    def __post_init__(self) -> None:
        mjcf.check(self, positive=("mu",))

    def problem(self, number: int, seed: int = 0) -> Any:
        """By size, then ratio, then push; the seed draws masses and grains."""
        size, rest = divmod(number, len(RATIOS) * len(PUSHES))
        ratio, push = divmod(rest, len(PUSHES))
        bodies = assembly.running_bond(SIZES[size], seed, push=PUSHES[push])
        random = np.random.Generator(np.random.PCG64([seed, number]))
        # the four contacts of two faces have one grain
        angles = np.repeat(random.uniform(0, math.pi, len(bodies.first) // 4), 4)
        title = f"{len(bodies.first)} contacts, ratio {RATIOS[ratio]:g}, push {PUSHES[push]:g}"
        return self.scaled(bodies, angles, RATIOS[ratio], title)

    def scaled(
        self, bodies: assembly.Bodies, angles: npt.NDArray[np.float64], ratio: float, title: str
    ) -> Any:
        """The problem of bodies whose grain is turned from their T1 by angles (nc)."""
        plain = bodies.problem(self.mu, title)
        nc = plain.nc
        root = math.sqrt(ratio)
        # S^-1 = diag(1, mu1 / mu, mu2 / mu), the grain being the axis of the least friction
        inverse = np.tile([1.0, 1 / root, root], nc)
        cosines = np.array([math.cos(angle) for angle in angles.tolist()])
        sines = np.array([math.sin(angle) for angle in angles.tolist()])
        first = 3 * np.arange(nc)
        rows = np.concatenate((first, first + 1, first + 2, first + 1, first + 2))
        columns = np.concatenate((first, first + 1, first + 1, first + 2, first + 2))
        turn = sp.csc_array(
            (np.concatenate((np.ones(nc), cosines, sines, -sines, cosines)), (rows, columns))
        )
        contacts = plain.contacts
        assert contacts is not None
        across = np.cross(contacts.normal, contacts.tangent)
        tangent = cosines[:, None] * contacts.tangent + sines[:, None] * across
        facts = {"S": [1.0, root, 1 / root], "mu1": self.mu / root, "mu2": self.mu * root}
        return plain.replace(
            H=sp.csc_array(plain.H @ turn @ sp.diags_array(inverse)),
            contacts=replace(contacts, tangent=tangent),
            info=assembly.told(
                plain.info,
                facts,
                "friction by ellipses is scaled away: S^-1 r is the reaction, S u the velocity,"
                f" S = diag(1, {root!r}, {1 / root!r}), T1 along the grain",
            ),
        )
