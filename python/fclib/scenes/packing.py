"""Packings of spheres in growing sizes, assembled directly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

SPACING = 0.02  # of the lattice [m]
REACH = 1.12  # spacings at which two spheres touch


@dataclass(frozen=True, kw_only=True)
class Packing:
    """Spheres of about 1 cm on a shaken lattice in a box without a lid, one step from rest.

    Sizes grow, and every second packing is pushed from one side, by as much as the weight of all
    spheres in that step.
    """

    title: ClassVar[str] = "Packing"
    description: ClassVar[str] = "Spheres on a shaken lattice in an open box, one step from rest."
    application: ClassVar[str] = "granular matter"
    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "ladder"
    problems: ClassVar[int] = 10  # from 10 to 1000 contacts

    mu: float = parameter(0.5, "1", "coefficient of friction")
    push: float = parameter(1.0, "1", "impulse on every second packing, in weights of all spheres")
    shake: float = parameter(0.08, "1", "deviation of a place, in spacings of the lattice")

    def __post_init__(self) -> None:
        mjcf.check(self, non_negative=("mu", "push", "shake"))

    def problem(self, number: int, seed: int = 0) -> Any:
        """Sizes of `assembly.SIZES`, each at rest and pushed; the seed draws places and radii."""
        size, pushed = divmod(number, 2)
        return self.of_size(assembly.SIZES[size], self.push if pushed else 0.0, seed)

    def of_size(self, contacts: int, push: float, seed: int = 0) -> Any:
        """A packing of about so many contacts."""
        random = np.random.Generator(np.random.PCG64(seed))
        side = max(1, round((contacts / 3.3) ** (1 / 3)))
        grid = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        centres = SPACING * (grid + 0.5 + self.shake * random.standard_normal(grid.shape))
        pairs = assembly.near(centres, REACH * SPACING)
        difference = centres[pairs[:, 1]] - centres[pairs[:, 0]]
        normals = [difference / np.linalg.norm(difference, axis=1, keepdims=True)]
        points = [0.5 * (centres[pairs[:, 1]] + centres[pairs[:, 0]])]
        ones, others = [pairs[:, 0]], [pairs[:, 1]]
        # floor, then the four sides: axis, layer of the lattice that touches, direction inwards
        for axis, layer, sign in (
            (2, 0, 1),
            (0, 0, 1),
            (0, side - 1, -1),
            (1, 0, 1),
            (1, side - 1, -1),
        ):
            touching = np.flatnonzero(grid[:, axis] == layer)
            normal = np.zeros(3)
            normal[axis] = sign
            normals.append(np.tile(normal, (len(touching), 1)))
            points.append(centres[touching] - 0.5 * SPACING * normal)
            ones.append(np.full(len(touching), -1))
            others.append(touching)
        radii = 0.5 * SPACING * random.uniform(0.8, 1.0, len(centres))
        first, second = np.concatenate(ones), np.concatenate(others)
        # of a wall half a spacing, of two spheres their distance
        width = np.full(len(first), 0.5 * SPACING)
        width[: len(pairs)] = np.linalg.norm(difference, axis=1)
        gaps = width - radii[second] - np.where(first >= 0, radii[first], 0.0)
        volumes = assembly.cubes(radii)
        if seed == 0:
            volumes = assembly.as_published(f"Packing/{contacts}", volumes)
        masses = 2500 * 4 / 3 * np.pi * volumes
        impulses = np.zeros((len(centres), 3))
        pushed = np.flatnonzero(grid[:, 0] == side - 1)
        weight = masses.sum() * assembly.GRAVITY * assembly.STEP
        impulses[pushed, 0] = -push * weight / len(pushed)
        bodies = assembly.Bodies(
            masses=masses,
            inertias=np.repeat((0.4 * masses * radii**2)[:, None], 3, axis=1),
            centres=centres,
            first=first,
            second=second,
            normals=np.concatenate(normals),
            points=np.concatenate(points),
            impulses=impulses,
            kind="sphere",
            sizes=np.repeat(radii[:, None], 3, axis=1),
            planes=box(side),
            gaps=gaps,
        )
        return bodies.problem(self.mu, f"{len(centres)} spheres, push {push:g}")


def box(side: int) -> Any:
    """The floor and the four walls (5 x 6): a point and the normal inwards."""
    width = SPACING * side
    sides: list[Any] = [((0, 0, 0), (0, 0, 1)), ((0, 0, 0), (1, 0, 0)), ((width, 0, 0), (-1, 0, 0))]
    sides += [((0, 0, 0), (0, 1, 0)), ((0, width, 0), (0, -1, 0))]
    return np.array([[*point, *normal] for point, normal in sides], dtype=float)
