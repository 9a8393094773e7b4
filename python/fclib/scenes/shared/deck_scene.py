"""From a deck of LMGC90 to a scene of ours: rigid bodies become MJCF, meshes become solids.

    scene = scene_of(read("DATBOX"), time_step=1e-3, theta=0.5)

A rigid body has its centre of mass as its origin and its principal axes as its axes, so that M is
diagonal, as in LMGC90. A body whose six velocities are 0 is fixed. A PLANx is a plate, that is a
box. A polyhedron collides as its convex hull; its mass is that of its own triangles.

Differences: LMGC90 finds contacts in the middle of a step and moves the axes of a body by a
linearised rotation; here contacts are those at the start, with their gaps moved on, and rotations
are exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from fclib.scenes.shared import mjcf, polyhedron
from fclib.scenes.shared.deck_data import MESH, RIGID, SEEN, Contactor, Deck, Mesh
from fclib.scenes.shared.deck_lines import DeckError
from fclib.scenes.shared.family import Scene
from fclib.scenes.shared.interaction import Drive, Interaction
from fclib.scenes.shared.solids import HexMesh, Solids, Surface

Vector = npt.NDArray[np.float64]

KINDS: Final = 30  # kinds of shapes that MuJoCo's bits tell apart, beside the one of a cell
CONVEX: Final = 1e-6  # share of its hull's volume that a convex polyhedron may lack, by rounding
SHAPES: Final = {"SPHER": "sphere", "PLANx": "box", "POLYR": "mesh"}


@dataclass(frozen=True)
class Placed:
    """A rigid body at the start, about its centre of mass."""

    mass: float  # [kg]
    moments: Vector  # (3) of inertia [kg m^2]
    centre: Vector  # (3) [m]
    axes: Vector  # (3 x 3) columns: its principal axes, in the world
    velocity: Vector  # (6) of the centre, and the spin about the axes
    # its contactors, with vertices and the place of others, in its own frame
    shapes: tuple[tuple[Contactor, Vector, Vector], ...]
    turn: Vector  # (3 x 3) columns: the axes of BODIES.DAT, in its own frame


def placed(deck: Deck, index: int, unknown: list[str] | None = None) -> Placed:
    """A rigid body of a deck. What is not taken as it stands is added to `unknown`. DeckError."""
    body = deck.rigid[index]
    density = deck.materials[body.material].density
    parts = [_moments(one, unknown if unknown is not None else []) for one in body.contactors]
    given = any(body.inertia) or body.gyration > 0
    if not parts and not (body.radius > 0 and given):
        body.place.fail("the body has no contactor that is known, and no avrd= with its inertia")
    volume = sum(part.volume for part in parts)
    if body.radius > 0:
        volume = polyhedron.ball(body.radius).volume
    whole = joined(parts) if parts else polyhedron.Moments(0.0, np.zeros(3), np.zeros((3, 3)))
    # LMGC90 finds the centre also if the inertia is given
    centre, axes = whole.centre, np.eye(3)
    plate = len(body.contactors) == 1 and body.contactors[0].kind == "PLANx"
    if plate:
        axes = body.contactors[0].turn
    if given:
        moments = density * np.array(body.inertia)
        if not any(body.inertia):
            moments = np.full(3, density * volume * body.gyration**2)
    else:
        if plate:
            moments = polyhedron.box(np.array(body.contactors[0].size)).inertia.diagonal()
        else:
            moments, axes = whole.principal()
        moments = moments * (density * volume / whole.volume)
    if not (min(moments) > 0 and volume > 0):
        body.place.fail("the mass and the inertia of a body must be > 0")
    start = deck.starts.get((RIGID, index, 0))
    placed_axes = axes
    if start is not None and start.frame is not None:
        if not plate and (axes != np.eye(3)).any():
            start.place.fail(
                "a, b, c are the axes of inertia, which LMGC90 finds and orders itself for this"
                " body: give its avrd, I1, I2 and I3, and its contactors along these axes"
            )
        placed_axes = start.frame
    moved = np.zeros(3) if start is None else start.displacement[:3]
    velocity = np.zeros(6) if start is None else start.velocity
    shapes = tuple(
        (one, (one.vertices - centre) @ axes, axes.T @ (one.shift - centre))
        for one in body.contactors
    )
    return Placed(
        float(density * volume),
        moments,
        body.centre + moved + centre,
        placed_axes,
        velocity,
        shapes,
        axes.T,
    )


def joined(parts: list[polyhedron.Moments]) -> polyhedron.Moments:
    """The moments of several bodies together."""
    volume = sum(part.volume for part in parts)
    centre = sum(part.volume * part.centre for part in parts) / volume
    inertia = np.zeros((3, 3))
    for part in parts:
        arm = part.centre - centre
        inertia += part.inertia + part.volume * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return polyhedron.Moments(float(volume), np.asarray(centre), inertia)


def _moments(one: Contactor, unknown: list[str]) -> polyhedron.Moments:
    if one.kind == "SPHER":
        return polyhedron.ball(one.size[0])
    if one.kind == "PLANx":
        own = polyhedron.box(np.array(one.size))
        turned = one.turn @ own.inertia @ one.turn.T
        return polyhedron.Moments(own.volume, one.shift, turned)
    try:
        corners, triangles = polyhedron.hull(one.vertices)
    except ValueError as error:
        one.place.fail(f"the POLYR has no volume: {error}")
    whole = polyhedron.moments(corners, triangles)
    try:
        own = polyhedron.moments(one.vertices, polyhedron.oriented(one.vertices, one.faces))
    except ValueError as error:
        unknown.append(f"{one.place}: of the POLYR, {error}: its convex hull is taken")
        return whole
    if own.volume < (1 - CONVEX) * whole.volume:
        unknown.append(f"{one.place}: the POLYR is not convex: its hull collides, not it")
    return own


def fixed(deck: Deck) -> set[int]:
    """The rigid bodies whose six velocities are 0."""
    held: dict[int, set[int]] = {}
    for drive in deck.driven:
        if drive.body[0] == RIGID and drive.velocity and drive.course.is_zero:
            held.setdefault(drive.body[1], set()).add(drive.axis)
    return {body for body, axes in held.items() if len(axes) == 6}


def scene_of(
    deck: Deck,
    *,
    time_step: float,
    theta: float = 0.5,
    period: tuple[float, float] | None = None,
    name: str = "",
    **more: Any,
) -> Scene:
    """The scene of a deck.

    Args:
        deck: what `read` found.
        time_step: h [s].
        theta: of the theta scheme.
        period: periods along x and y [m].
        name: of the scene; by default that of the deck's folder.
        more: further fields of the scene.

    Raises:
        DeckError: the deck cannot be simulated.
    """
    unknown = list(deck.unknown)
    if deck.meshes and set(range(len(deck.rigid))) - fixed(deck):
        place = deck.rigid[min(set(range(len(deck.rigid))) - fixed(deck))].place
        place.fail("a rigid body that moves, beside meshes: such decks are not known")
    name = name or (deck.path.parent if deck.path.name == "DATBOX" else deck.path).resolve().name
    parameters: dict[str, Any] = {"deck": name, "sha256": dict(deck.sha256)}
    if period is not None:
        parameters["period"] = list(period)
    made = (
        _elastic(deck, unknown) if deck.meshes else _rigid(deck, name, time_step, period, unknown)
    )
    values: dict[str, Any] = {
        "name": name,
        "time_step": time_step,
        "theta": theta,
        "law": "gap",
        "period": period,
        "all_bodies": True,
        "parameters": parameters,
        "title": name,
        "description": f"Problems of the LMGC90 deck {name}.",
        "left_out": tuple(dict.fromkeys(unknown)),
        **made,
    }
    return Scene(**(values | more))


def kinds_of(
    deck: Deck, unknown: list[str]
) -> tuple[dict[tuple[str, str], int], tuple[Interaction, ...]]:
    """A number for each kind and colour that sees something, and the interactions."""
    kinds: dict[tuple[str, str], int] = {}
    found = []
    for see in deck.sees:
        first, second = (kinds.setdefault(one, len(kinds)) for one in (see.first, see.second))
        law = deck.laws[see.law]
        assert law.mu is not None
        found.append(Interaction(kinds=(first, second), mu=law.mu, alert=see.alert, law=law.name))
    return kinds, tuple(found)


# ---- rigid bodies


def _rigid(
    deck: Deck, name: str, time_step: float, period: tuple[float, float] | None, unknown: list[str]
) -> dict[str, Any]:
    kinds, interactions = kinds_of(deck, unknown)
    if len(kinds) > KINDS:
        deck.sees[-1].place.fail(f"at most {KINDS} kinds and colours see each other here")
    masks = [0] * len(kinds)
    for meeting in interactions:
        first, second = meeting.kinds
        masks[first] |= 1 << second
        masks[second] |= 1 << first
    bits = {key: (1 << kind, masks[kind], kind) for key, kind in kinds.items()}
    still = fixed(deck)
    given = {d.body[1] for d in deck.driven if d.velocity}
    moving = [i for i in range(len(deck.rigid)) if i not in still]
    if period is not None:
        # bodies that are driven have no images, and come last
        moving.sort(key=lambda i: i in given)
    all_placed = [placed(deck, i, unknown) for i in range(len(deck.rigid))]
    assets: dict[str, str] = {}
    bodies = []
    for i in sorted(still):
        one = all_placed[i]
        place = (one.centre, one.axes)
        bodies += [_geom(shape, one.turn, bits, assets, place, FIXED) for shape in one.shapes]
    for rank, i in enumerate(moving):
        one = all_placed[i]
        geoms = "".join(
            _geom(shape, one.turn, bits, assets, None, mjcf.shade(rank, len(moving)))
            for shape in one.shapes
        )
        bodies.append(
            f'<body name="{RIGID} {i + 1}" pos="{mjcf.numbers(*one.centre)}"'
            f' quat="{mjcf.numbers(*quaternion(one.axes))}"><freejoint/>'
            f'<inertial pos="0 0 0" mass="{one.mass!r}"'
            f' diaginertia="{mjcf.numbers(*one.moments)}"/>{geoms}</body>'
        )
    velocity = np.concatenate([np.zeros(0), *(all_placed[i].velocity for i in moving)])
    drives = tuple(
        Drive(dof=6 * moving.index(d.body[1]) + d.axis, velocity=d.velocity, course=d.course)
        for d in deck.driven
        if d.body[1] not in still
    )
    reach = [one.centre for one in all_placed]
    xml = mjcf.document(
        name,
        bodies=bodies,
        assets=assets.values(),
        time_step=time_step,
        gravity=0.0,
        floor=False,
        floor_mu=0.0,
        tile=0.1 * float(np.ptp(reach, axis=0).max() or 1.0),
        rest=[f'<option gravity="{mjcf.numbers(*deck.gravity)}"/>'],
        velocity=velocity if velocity.any() else None,
    )
    return {"xml": xml, "interactions": interactions, "drives": drives}


FIXED: Final = "0.55 0.57 0.6 1"  # the colour of what does not move


def _geom(
    shape: tuple[Contactor, Vector, Vector],
    turn: Vector,
    bits: dict[tuple[str, str], tuple[int, int, int]],
    assets: dict[str, str],
    place: tuple[Vector, Vector] | None,
    colour: str,
) -> str:
    """A geometry of a body, or of the world if it has a place (centre, axes).

    turn   (3 x 3) columns: the axes along which boxes lie, in the body's frame
    """
    one, vertices, origin = shape
    own, seen, kind = bits.get((one.kind, one.colour), (0, 0, -1))
    look = (
        f'contype="{own}" conaffinity="{seen}" user="{kind}" condim="3" mass="0"'
        f' material="solid" rgba="{colour}"'
    )
    centre, axes = (np.zeros(3), np.eye(3)) if place is None else place
    if one.kind == "POLYR":
        # equal shapes are one mesh
        text = mjcf.polyhedron_mesh("", vertices)
        mesh = f"shape{len(assets)}"
        if text in assets:
            mesh = assets[text].split('"')[1]
        else:
            assets[text] = mjcf.polyhedron_mesh(mesh, vertices)
        size = f'mesh="{mesh}"'
        at, turn = centre, axes
    else:
        size = f'size="{mjcf.numbers(*one.size)}"'
        at, turn = centre + axes @ origin, axes @ turn @ one.turn
    return (
        f'<geom type="{SHAPES[one.kind]}" {size} pos="{mjcf.numbers(*at)}"'
        f' quat="{mjcf.numbers(*quaternion(turn))}" {look}/>'
    )


def quaternion(axes: Vector) -> Vector:
    """The unit quaternion w, x, y, z of a rotation (3 x 3)."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(axes).as_quat().tolist()
    found: Vector = np.array([w, x, y, z])
    return found if w >= 0 else -found


# ---- meshes


def _elastic(deck: Deck, unknown: list[str]) -> dict[str, Any]:
    if deck.gravity[:2].any():
        raise DeckError(f"{deck.path / 'BULK_BEHAV.DAT'}: meshes take gravity along z only")
    kinds, interactions = kinds_of(deck, unknown)
    meshes = []
    first = [0]
    for index, mesh in enumerate(deck.meshes):
        meshes.append(_mesh(deck, index, mesh, kinds))
        first.append(first[-1] + len(mesh.nodes))
    for body in deck.rigid:
        unknown.append(f"{body.place}: a rigid body beside meshes is left out")
    drives = tuple(
        Drive(dof=3 * (first[d.body[1]] + d.node) + d.axis, velocity=d.velocity, course=d.course)
        for d in deck.driven
        if d.body[0] == MESH
    )
    solids = Solids(
        blocks=(),
        meshes=tuple(meshes),
        mu=0.0,
        reach=max((one.alert for one in interactions), default=0.0),
        gravity=-float(deck.gravity[2]),
    )
    return {"solids": solids, "interactions": interactions, "drives": drives}


def _mesh(deck: Deck, index: int, mesh: Mesh, kinds: dict[tuple[str, str], int]) -> HexMesh:
    material = deck.materials[mesh.material]
    assert material.young is not None
    starts = [deck.starts.get((MESH, index, node)) for node in range(len(mesh.nodes))]
    moved = [np.zeros(3) if s is None else s.displacement for s in starts]
    velocity = [np.zeros(3) if s is None else s.velocity for s in starts]
    return HexMesh(
        nodes=_tuples(mesh.nodes),
        elements=_tuples(mesh.elements),
        young=material.young,
        poisson=material.poisson,
        density=material.density,
        lumped=deck.lumped[mesh.model],
        surfaces=tuple(
            Surface(
                kind=kinds[SEEN[p.kind], p.colour],
                candidate=p.kind == "CSpx4",
                quads=_tuples(p.quads),
            )
            for p in mesh.patches
            if (SEEN[p.kind], p.colour) in kinds
        ),
        displacement=_tuples(np.array(moved)) if np.any(moved) else (),
        velocity=_tuples(np.array(velocity)) if np.any(velocity) else (),
    )


def _tuples(rows: Any) -> tuple[Any, ...]:
    return tuple(tuple(row) for row in rows.tolist())
