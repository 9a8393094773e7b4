"""A column of spheres that collapses in a channel: stored states of up to 100,000 contacts."""

from __future__ import annotations

import functools
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import _core, _stored
from fclib.scenes.shared import assembly

SIZES: Final = ((16, 10, 22), (24, 14, 32), (36, 22, 44))  # spheres of the column, along x, y, z
STATES: Final = 8  # of each size, from the opening of the gate to the end of the flow
IN_PLACE: Final = _stored.CHECKOUT / "collection" / _stored.COLLECTION
FILE: Final = Path("states") / "GranularFlow.npz"
# units of the stored integers, in largest diameters d, sqrt(g d), sqrt(g / d) and d / 2
PLACE, VELOCITY, SPIN, RADIUS = 2.0**-14, 2.0**-8, 2.0**-6, 2.0**-15

DIAMETER: Final = 0.01  # d, of the largest sphere [m]
DENSITY: Final = 2500.0  # [kg/m^3]
MU: Final = 0.5
REACH: Final = 0.05  # largest gap of a contact, in d
SHARE: Final = 0.2  # of a penetration that is undone in a step


Vector: TypeAlias = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class State:
    """A stored state, in m, m/s and rad/s."""

    time: float  # since the gate opened [s]
    step: float  # h [s]
    wide: float  # of the channel [m]
    radii: Vector  # (n)
    places: Vector  # (n x 3)
    velocities: Vector  # (n x 3)
    spins: Vector  # (n x 3)


@dataclass(frozen=True, kw_only=True)
class GranularFlow:
    """Spheres settle behind a gate in a channel of rough walls; the gate opens, and they flow out.

    The states come from a simulation (`workshop/sets/granular_flow.cpp`): places, velocities and
    spins are stored, and contacts, M, H, f and w follow from them. Each of three sizes, of about
    10,000, 30,000 and 100,000 contacts, has eight states from the opening of the gate to the end of
    the flow.

    The law is that of gaps: w_N = gap / h for a gap of up to a twentieth of a diameter, and a fifth
    of it for a penetration. f = M v + h F. The radii differ by up to a fifth.

    Why it is here: a large problem that flows. Part of the grains rest under a load, part slide,
    part fly; no formula places them, and no two contacts are alike.

    E. Lajeunesse, A. Mangeney-Castelnau, J. P. Vilotte, Spreading of a granular mass on a
    horizontal plane, Physics of Fluids 16, 2004.
    """

    title: ClassVar[str] = "Granular flow"
    description: ClassVar[str] = "A column of spheres collapses in a channel, to 100,000 contacts."
    application: ClassVar[str] = "granular matter"
    authors: ClassVar[str] = "the authors of FCLIB, after E. Lajeunesse and others"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "flows"
    problems: ClassVar[int] = len(SIZES) * STATES

    def problem(self, number: int, seed: int = 0) -> Any:
        """By size, then in time; there is nothing that the seed could draw."""
        size, state = divmod(number, STATES)
        return problem_of(stored(size)[state])

    @classmethod
    def digests(cls) -> tuple[str, ...]:
        """The digests of the problems as they were stored; none if the states are not here."""
        try:
            stored_file = path()
        except FileNotFoundError:
            return ()
        with np.load(stored_file) as arrays:
            return tuple(json.loads(str(arrays["digests"])))


def problem_of(state: State) -> Any:
    """The problem of a step from a state."""
    bodies = bodies_of(state)
    h = state.step
    problem = bodies.problem(MU, f"{len(state.radii)} spheres, t = {state.time:.3f} s")
    momentum = np.hstack((bodies.masses[:, None] * state.velocities, bodies.inertias * state.spins))
    momentum[:, 2] -= h * assembly.GRAVITY * bodies.masses
    gaps = np.asarray(bodies.gaps)
    w = np.zeros(3 * len(gaps))
    w[0::3] = np.where(gaps > 0, gaps, SHARE * gaps) / h
    word = f"f = M v0 + h F; w_N = gap / h, {SHARE:g} of it for a penetration"
    info = assembly.told(problem.info, {"time": state.time, "time_step": h}, word)
    start = f"one step from rest, h = {assembly.STEP:g} s"
    math_info = info.math_info.replace(start, f"one step, h = {h:.6g} s")
    return problem.replace(
        f=momentum.ravel(),
        w=w,
        info=_core.ProblemInfo(title=info.title, description=info.description, math_info=math_info),
    )


def bodies_of(state: State) -> assembly.Bodies:
    """The spheres of a state and all their contacts within reach."""
    count, radii, centres = len(state.radii), state.radii, state.places
    reach = REACH * DIAMETER
    pairs = assembly.near(centres, DIAMETER + reach)
    difference = centres[pairs[:, 1]] - centres[pairs[:, 0]]
    x, y, z = difference.T
    distance = np.sqrt(x * x + y * y + z * z)
    gap = distance - radii[pairs[:, 0]] - radii[pairs[:, 1]]
    normal = difference / distance[:, None]
    first, second, gaps, normals = [pairs[:, 0]], [pairs[:, 1]], [gap], [normal]
    points = [centres[pairs[:, 0]] + (radii[pairs[:, 0]] + 0.5 * gap)[:, None] * normal]
    planes = ((0, 0.0, 1.0), (1, 0.0, 1.0), (1, state.wide, -1.0), (2, 0.0, 1.0))
    table = []
    for axis, place, sign in planes:
        inwards = sign * np.eye(3)[axis]
        table.append(np.concatenate((place * np.eye(3)[axis], inwards)))
        gap = sign * (centres[:, axis] - place) - radii
        first.append(np.full(count, -1))
        second.append(np.arange(count))
        gaps.append(gap)
        normals.append(np.tile(inwards, (count, 1)))
        points.append(centres - (radii + 0.5 * gap)[:, None] * inwards)
    arrays = [np.concatenate(one) for one in (first, second, gaps, normals, points)]
    kept = arrays[2] <= reach
    first_, second_, gaps_, normals_, points_ = (one[kept] for one in arrays)
    masses = DENSITY * 4 / 3 * math.pi * (radii * radii * radii)
    return assembly.Bodies(
        masses=masses,
        inertias=np.repeat((0.4 * masses * (radii * radii))[:, None], 3, axis=1),
        centres=centres,
        first=first_,
        second=second_,
        normals=normals_,
        points=points_,
        impulses=np.zeros((count, 3)),
        sizes=np.repeat(radii[:, None], 3, axis=1),
        planes=np.array(table),
        kind="sphere",
        gaps=gaps_,
    )


def path() -> Path:
    """The file of the states. FileNotFoundError if the package with it is missing."""
    package = _stored.folder_of(_stored.COLLECTION, IN_PLACE)
    if package is None or not (package / FILE).is_file():
        raise FileNotFoundError(
            f"the states of GranularFlow ({FILE}) come with the package fclib-collection; install"
            " it with: pip install fclib-collection"
        )
    return package / FILE


@functools.lru_cache(maxsize=1)
def stored(size: int) -> tuple[State, ...]:
    """The states of a size, in time."""
    with np.load(path()) as arrays:
        head = arrays[f"head{size}"].tolist()  # width and time step, in d and sqrt(d / g)
        radii = np.multiply(whole(arrays[f"radii{size}"])[0], RADIUS * 0.5 * DIAMETER)
        speed = math.sqrt(assembly.GRAVITY * DIAMETER)
        unit = math.sqrt(DIAMETER / assembly.GRAVITY)  # of time
        units = (PLACE * DIAMETER, VELOCITY * speed, SPIN / unit)
        states = []
        for k, time in enumerate(arrays[f"time{size}"].tolist()):
            three: list[Vector] = [
                np.multiply(whole(arrays[f"{name}{size}_{k}"]).T, one)
                for name, one in zip(("place", "velocity", "spin"), units, strict=True)
            ]
            states.append(State(time * unit, head[1] * unit, head[0] * DIAMETER, radii, *three))
        return tuple(states)


def planes_of(values: npt.NDArray[np.int64]) -> npt.NDArray[np.uint8]:
    """Integers (k x n) as bytes of equal weight (b x k x n), the lowest first; -1 is 1, 1 is 2."""
    zigzag = ((values << 1) ^ (values >> 63)).astype("<u8")
    planes = np.moveaxis(zigzag[..., None].view(np.uint8), -1, 0)
    width = max((k + 1 for k in range(8) if planes[k].any()), default=1)
    return np.ascontiguousarray(planes[:width])


def whole(planes: npt.NDArray[np.uint8]) -> npt.NDArray[np.int64]:
    """The integers that `planes_of` has made into bytes."""
    zigzag = np.zeros(planes.shape[1:], np.uint64)
    for k, plane in enumerate(planes):
        zigzag |= plane.astype(np.uint64) << np.uint64(8 * k)
    return (zigzag >> np.uint64(1)).astype(np.int64) ^ -(zigzag & np.uint64(1)).astype(np.int64)
