"""Blocks that are glued together: a law with cohesion, as Coulomb's problem by a shift."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import numpy as np

from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

SIZES: Final = (100, 300, 1000, 3000)  # approximate numbers of contacts
# cohesion over the mean load of a contact of the uppermost joint, or of the ground if pushed
SHARES: Final = {"tower": (0.9, 1.05, 2.0), "curtain": (0.9, 1.05, 2.0), "pushed": (0.05, 0.2, 0.8)}
CORNERS: Final = 4  # contacts of two faces
BLOCK: Final = 1000.0  # mass of a block of a tower [kg]


@dataclass(frozen=True, kw_only=True)
class CohesiveWall:
    """Blocks glued by a force c at each contact: they hang from a ceiling, or a wall is pushed.

    A contact takes a pull of up to c, and its friction counts from there: with the impulse h c,

        0 <= u_N  _|_  r_N + h c >= 0,   ||r_T|| <= mu (r_N + h c),

    as IQS_WET of LMGC90. In r^ = r + h c e_N this is Coulomb's law, and the problem is the plain
    one with f^ = f - H E h c, E taking each c to its normal component (docs/mathematics.md). The
    files have that one: r = r^ - h c e_N is the reaction with cohesion. Their description has h c.

    tower    blocks below each other under a ceiling, four contacts a joint. The uppermost
             contacts each carry a quarter of the weight: it holds if and only if c is as large
    curtain  a wall of blocks that hangs from a ceiling
    pushed   a wall on the ground, pushed at the top

    A. Taboada, N. Estrada, F. Radjai, Additive decomposition of shear strength in cohesive granular
    media from grain-scale interactions, Physical Review Letters 97, 2006.
    """

    title: ClassVar[str] = "Cohesive wall"
    description: ClassVar[str] = "Glued blocks hang from a ceiling, or are pushed on the ground."
    application: ClassVar[str] = "masonry with mortar, cohesive granular matter"
    authors: ClassVar[str] = "the authors of FCLIB; the law: LMGC90, A. Taboada and others"
    friction: ClassVar[str] = "Coulomb with cohesion, as Coulomb by a shift of the reactions"
    collection: ClassVar[str] = "laws"
    problems: ClassVar[int] = 3 * len(SIZES) * len(SHARES)

    mu: float = parameter(0.5, "1", "coefficient of friction")
    push: float = parameter(0.3, "1", "impulse on the top of the pushed wall, in its weights")

    def __post_init__(self) -> None:
        mjcf.check(self, non_negative=("mu", "push"))

    def problem(self, number: int, seed: int = 0) -> Any:
        """By kind, then size, then cohesion; the seed draws the masses of walls."""
        which, rest = divmod(number, len(SIZES) * 3)
        size, share = divmod(rest, 3)
        kind = list(SHARES)[which]
        return self.of_kind(kind, SIZES[size], SHARES[kind][share], seed)

    def of_kind(self, kind: str, contacts: int, share: float, seed: int = 0) -> Any:
        """A problem of about so many contacts; `share` as in SHARES."""
        if kind == "tower":
            bodies = tower(max(1, contacts // CORNERS))
        else:
            push = self.push if kind == "pushed" else 0.0
            bodies = assembly.running_bond(contacts, seed, push=push)
            if kind == "curtain":
                bodies = hung(bodies)
        weight = assembly.total(bodies.masses) * assembly.GRAVITY * assembly.STEP
        held = np.count_nonzero(bodies.first < 0)
        glue = share * weight / held  # h c [N s]
        problem = bodies.problem(self.mu, f"{kind}, {len(bodies.first)} contacts, {share:g} c")
        shift = np.zeros(3 * problem.nc)
        shift[0::3] = glue
        facts = {"cohesion_impulse": glue, "kind": kind}
        return problem.replace(
            f=problem.f - problem.H @ shift,
            info=assembly.told(
                problem.info,
                facts,
                f"cohesion is shifted away: r - {glue!r} e_N is the reaction with it",
            ),
        )


def tower(blocks: int) -> assembly.Bodies:
    """So many blocks of 2 x 1 x 1 m below each other, under the plane z = 0."""
    each = np.arange(blocks)
    below = np.repeat(each, CORNERS)
    corners = np.array([(x, y) for x in (-1.0, 1.0) for y in (-0.5, 0.5)])
    points = np.column_stack((np.tile(corners, (blocks, 1)), -1.0 * below))
    masses = np.full(blocks, BLOCK)
    return assembly.Bodies(
        masses=masses,
        inertias=masses[:, None] / 12 * np.array([[2.0, 5.0, 5.0]]),
        centres=np.column_stack((np.zeros((blocks, 2)), -0.5 - each)),
        first=below - 1,
        second=below,
        normals=np.tile([0.0, 0.0, -1.0], (len(below), 1)),
        points=points,
        impulses=np.zeros((blocks, 3)),
        sizes=np.tile([1.0, 0.5, 0.5], (blocks, 1)),
        planes=np.array([[0.0, 0.0, 0.0, 0.0, 0.0, -1.0]]),
    )


def hung(bodies: assembly.Bodies) -> assembly.Bodies:
    """The same upside down: what stood on the ground hangs from a ceiling."""
    down = np.array([1.0, 1.0, -1.0])
    return replace(
        bodies,
        centres=bodies.centres * down,
        points=bodies.points * down,
        normals=bodies.normals * down,
        planes=bodies.planes * np.concatenate((down, down)),
    )
