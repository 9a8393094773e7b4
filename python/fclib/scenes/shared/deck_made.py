"""Decks that are made by a rule, and not read: for families that follow a published deck."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np

from fclib.scenes.shared.deck_data import (
    RIGID,
    Contactor,
    Deck,
    Driven,
    Law,
    Material,
    RigidBody,
    See,
    Start,
)
from fclib.scenes.shared.deck_lines import Place
from fclib.scenes.shared.deck_scene import scene_of
from fclib.scenes.shared.family import Scene
from fclib.scenes.shared.interaction import Course

HERE: Final = Place(Path("deck"), 0)


def body(centre: Any, kind: str, colour: str, size: Any = (), vertices: Any = None) -> RigidBody:
    """A body of one contactor; the mass follows from it."""
    corners = np.zeros((0, 3)) if vertices is None else np.asarray(vertices, dtype=float)
    return RigidBody(
        material="solid",
        radius=0.0,
        gyration=0.0,
        inertia=(0.0, 0.0, 0.0),
        centre=np.asarray(centre, dtype=float),
        contactors=(
            Contactor(kind=kind, colour=colour, size=tuple(size), vertices=corners, place=HERE),
        ),
        place=HERE,
    )


def held(index: int, courses: dict[int, Course] | None = None) -> list[Driven]:
    """All six velocities of a body: 0, or as the courses of some axes say."""
    own = courses or {}
    return [
        Driven(
            body=(RIGID, index),
            node=0,
            axis=axis,
            velocity=True,
            course=own.get(axis, Course()),
            place=HERE,
        )
        for axis in range(6)
    ]


def turned(axes: Any) -> Start:
    """The start of a body at rest with these axes (columns)."""
    return Start(
        displacement=np.zeros(6), velocity=np.zeros(6), frame=np.asarray(axes, float), place=HERE
    )


def scene(
    family: Any,
    seed: int,
    *,
    rigid: Iterable[RigidBody],
    sees: Iterable[tuple[tuple[str, str], tuple[str, str], float, float]],
    starts: dict[int, Start] | None = None,
    driven: Iterable[Driven] = (),
    period: tuple[float, float] | None = None,
    **more: Any,
) -> Scene:
    """The scene of a family of rigid bodies, by the law IQS_CLB.

    Args:
        family: with `density`, `gravity`, `time_step` and `theta`.
        seed: of what is drawn.
        rigid: the bodies.
        sees: two kinds and colours that meet, their friction and alert distance [m].
        starts: of bodies, by their number.
        driven: velocities and forces.
        period: of the cell [m].
        more: further fields of the scene.
    """
    laws, rows = {}, []
    for i, (first, second, mu, alert) in enumerate(sees):
        laws[str(i)] = Law(name="IQS_CLB", mu=mu, place=HERE)
        rows.append(See(first=first, second=second, law=str(i), alert=alert, place=HERE))
    deck = Deck(
        path=Path("deck"),
        gravity=np.array([0.0, 0.0, -family.gravity]),
        materials={"solid": Material(density=family.density, place=HERE)},
        lumped={},
        laws=laws,
        sees=tuple(rows),
        rigid=tuple(rigid),
        meshes=(),
        starts={(RIGID, i, 0): start for i, start in (starts or {}).items()},
        driven=tuple(driven),
        unknown=(),
        sha256={},
    )
    return scene_of(
        deck,
        time_step=family.time_step,
        theta=family.theta,
        period=period,
        name=type(family).__name__,
        parameters=asdict(family),
        seed=seed,
        title=family.title,
        description=family.description,
        application=family.application,
        authors=family.authors,
        friction=family.friction,
        **more,
    )
