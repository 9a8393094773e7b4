"""Piles of spheres, square pyramids of some 10 to 100,000 contacts, assembled directly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

DIAMETER = 0.1  # [m]
DENSITY = 2500.0  # [kg/m^3]


class Plane(NamedTuple):
    """The ground, or a side of the frame."""

    point: tuple[float, float, float]  # [m]
    normal: tuple[float, float, float]  # inwards


@dataclass(frozen=True, kw_only=True)
class Pile:
    """Equal spheres in a square pyramid, as cannonballs are piled, one step from rest.

    Each sphere lies on four others or on the ground, and touches its neighbours of the same layer.
    A frame holds the lowest layer: the pile stands, even without friction. Every second pile has no
    frame, and comes apart. Without one, the line through the two contacts of a sphere in the lowest
    of two layers is 22.5 degrees off their normals: two layers stand from mu = tan 22.5 = 0.414 on.

    Why it is here: the weight of all that is above goes through long chains of contacts, and how it
    spreads over ground and frame is far from unique.
    """

    title: ClassVar[str] = "Pile"
    description: ClassVar[str] = "Spheres in a square pyramid on the ground, one step from rest."
    application: ClassVar[str] = "granular matter"
    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "ladder"
    problems: ClassVar[int] = 2 * len(assembly.SIZES)

    mu: float = parameter(0.6, "1", "coefficient of friction")
    spread: float = parameter(0.05, "1", "masses differ by this share")

    def __post_init__(self) -> None:
        mjcf.check(self, non_negative=("mu", "spread"))

    def problem(self, number: int, seed: int = 0) -> Any:
        """Sizes of `assembly.SIZES`, each with a frame and without; the seed draws the masses."""
        size, loose = divmod(number, 2)
        return self.of_size(assembly.SIZES[size], not loose, seed)

    def of_size(self, contacts: int, framed: bool, seed: int = 0) -> Any:
        """The pile whose number of contacts is nearest to this one."""
        layers = min(range(1, 120), key=lambda n: abs(contacts_of(n, framed) - contacts))
        bodies = self.bodies(layers, framed, seed)
        words = "in a frame" if framed else "without a frame"
        return bodies.problem(self.mu, f"{len(bodies.masses)} spheres, {words}")

    def bodies(self, layers: int, framed: bool = True, seed: int = 0) -> assembly.Bodies:
        """A pile of so many layers; the lowest has as many spheres along an edge."""
        random = np.random.Generator(np.random.PCG64(seed))
        planes = [Plane((0, 0, 0), (0, 0, 1))]
        if framed:
            width = layers * DIAMETER
            planes += [Plane((0, 0, 0), (1, 0, 0)), Plane((width, 0, 0), (-1, 0, 0))]
            planes += [Plane((0, 0, 0), (0, 1, 0)), Plane((0, width, 0), (0, -1, 0))]
        centres: list[Any] = []
        pairs: list[tuple[Any, Any]] = []
        lower = np.zeros((0, 0), np.int64)
        count = 0
        for layer in range(layers):
            edge = layers - layer
            ids = count + np.arange(edge**2).reshape(edge, edge)
            count += edge**2
            x, y = np.meshgrid(*[np.arange(edge) + 0.5 * (layer + 1)] * 2, indexing="ij")
            z = np.full(x.shape, 0.5 + layer * np.sqrt(0.5))
            centres.append(DIAMETER * np.stack([x, y, z], axis=-1).reshape(-1, 3))
            if layer:
                pairs += [(lower[i : i + edge, j : j + edge], ids) for i in (0, 1) for j in (0, 1)]
            pairs += [(ids[:-1], ids[1:]), (ids[:, :-1], ids[:, 1:])]
            lower = ids
        places = np.concatenate(centres)
        first = np.concatenate([one.ravel() for one, _ in pairs])
        second = np.concatenate([other.ravel() for _, other in pairs])
        normals = [(places[second] - places[first]) / DIAMETER]
        points = [0.5 * (places[second] + places[first])]
        firsts, seconds = [first], [second]
        lowest = np.arange(layers**2)
        for plane in planes:
            normal = np.array(plane.normal, float)
            away = (places[lowest] - plane.point) @ normal
            touching = lowest[away < 0.6 * DIAMETER]
            firsts.append(np.full(len(touching), -1))
            seconds.append(touching)
            normals.append(np.tile(normal, (len(touching), 1)))
            points.append(places[touching] - 0.5 * DIAMETER * normal)
        weights = random.uniform(1 - self.spread, 1 + self.spread, count)
        masses = DENSITY * np.pi / 6 * DIAMETER**3 * weights
        return assembly.Bodies(
            masses=masses,
            inertias=np.repeat((0.1 * masses * DIAMETER**2)[:, None], 3, axis=1),
            centres=places,
            first=np.concatenate(firsts),
            second=np.concatenate(seconds),
            normals=np.concatenate(normals),
            points=np.concatenate(points),
            impulses=np.zeros((count, 3)),
            kind="sphere",
            sizes=np.full((count, 3), 0.5 * DIAMETER),
            planes=np.array([[*plane.point, *plane.normal] for plane in planes], dtype=float),
        )


def contacts_of(layers: int, framed: bool) -> int:
    """How many contacts a pile has."""
    edges = range(1, layers + 1)
    ground = layers**2 + (4 * layers if framed else 0)
    return ground + sum(2 * n * (n - 1) for n in edges) + sum(4 * n**2 for n in edges[:-1])
