"""LMGC90: the steps of a deck of polyhedra, or of a script that uses the `Solver` of compas_lmgc90.

The engine runs in a process of its own, by _lmgc90_steps.py. It tells the places and the axes of
the bodies, and of each contact the point, the frame, the gap, the force and the relative velocity.
From them, with h the step and A the axes of a body's inertia:

    x' = x + h ((1 - theta) v + theta v')                      v', the velocity of the centre
    A_m = A + (1 - theta) h [omega] A,  A' = A_m + theta h [omega'] A_m     made orthogonal

so that v' and the spins omega', about the body's own axes, follow from two states. H is that of the
contacts' frames in the middle of the step, x_m = x + (1 - theta) h v and A_m, M has masses and
moments of the polyhedra, and

    M (v' - v) = h F + H r,  u = H^T v' + w,  w_N = max(0, gap) / h

F has weights, driven forces and the gyroscopic moments at the start of the step. Velocities that
are driven are in w. The forces of a step are those after the engine's last sweep, its velocities
those before it: they agree as far as its sweeps have converged.

F. Dubois, M. Jean, M. Renouf, R. Mozul, A. Martin, M. Bagneris, LMGC90, 10e colloque national en
  calcul des structures, 2011.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import scipy.sparse as sp

from fclib import _core
from fclib._words import counted
from fclib.recorders._assemble import Assembled, Contacts, Vector
from fclib.recorders._recorded import Maker, Origin, Recorded, Recording, SetupError, no_step
from fclib.scenes.shared import deck as decks
from fclib.scenes.shared import deck_scene, polyhedron
from fclib.scenes.shared.deck_data import RIGID, Deck, Law
from fclib.scenes.shared.interaction import Course
from fclib.scenes.shared.recorded import jacobian

STEPS: Final = Path(__file__).with_name("_lmgc90_steps.py")
GRAVITY: Final = np.array([0.0, 0.0, -9.81])  # the engine's, which cannot be changed [m/s^2]
# the laws whose w follows from the gap: LMGC90's names
LAWS: Final = ("IQS_CLB", "IQS_CLB_g0")
AGREES: Final = 1e-8  # relative difference of velocities that is not told
# rows of a contact, of the engine's T, N, S: right-handed
ORDER: Final = (1, 2, 0)
FIELDS: Final[dict[str, Origin]] = {
    "M": "reconstructed",
    "f": "reconstructed",
    "H": "exact",
    "w": "reconstructed",
    "mu": "exact",
}


def lmgc90(
    path: str | Path,
    *,
    arguments: Sequence[str] = (),
    every: int = 1,
    steps: int = 100,
    time_step: float = 1e-3,
    theta: float = 0.5,
) -> Iterator[Recorded]:
    """Run a deck or a script, and give each `every`-th of its steps that has contacts.

    The simulation runs to its end before the first step is given.

    Args:
        path: the folder of a deck (DATBOX), or a Python script.
        arguments: of the script.
        every: one step in so many is given.
        steps: of a deck.
        time_step: h of a deck [s].
        theta: of a deck.

    Raises:
        ImportError: compas_lmgc90 is not installed.
        OSError: there is no such deck or script.
        ValueError: the deck is wrong, or holds what the engine does not take.
        ChildProcessError: the engine or the script ended with an error; raised after the steps
            before it.
    """
    source = Source(Path(path), tuple(arguments), steps, time_step, theta)
    return (step for step in steps_of(source, every) if step is not None)


@dataclass(frozen=True)
class Source:
    """A deck or a script."""

    path: Path
    arguments: tuple[str, ...] = ()
    steps: int = 100
    time_step: float = 1e-3
    theta: float = 0.5


def record(
    recording: Recording,
    script: Path,
    arguments: Sequence[str],
    *,
    steps: int = 100,
    time_step: float = 1e-3,
    theta: float = 0.5,
) -> None:
    """Add the steps of a deck or a script to a recording."""
    source = Source(script, tuple(arguments), steps, time_step, theta)
    for _, make in makers_of(source, recording.every):
        recording.take(make)


def steps_of(source: Source, every: int) -> Iterator[Recorded | None]:
    """Each step; None if it is not kept, or nothing touches."""
    return (step for _, step in states_of(source, every))


def states_of(source: Source, every: int) -> Iterator[tuple[State, Recorded | None]]:
    """Each step and the state at its start; None if it is not kept, or nothing touches."""
    return ((state, make()) for state, make in makers_of(source, every))


def makers_of(source: Source, every: int) -> Iterator[tuple[State, Maker]]:
    """The same, but each step is made by a call."""
    if every < 1:
        raise ValueError(f"every must be at least 1, not {every}")
    notes: tuple[str, ...] = ()
    with tempfile.TemporaryDirectory(prefix="fclib-") as name:
        folder = Path(name)
        command = [sys.executable, str(STEPS), name, str(every)]
        if decks.folder_of(source.path) is not None:
            notes = write_deck(folder / "deck.npz", source)
            command += ["deck", str(folder / "deck.npz"), str(source.steps)]
        elif source.path.is_file():
            command += ["script", str(source.path), *source.arguments]
        else:
            raise FileNotFoundError(f"{source.path}: there is no such deck or script")
        ran = subprocess.run(command, check=False, stderr=subprocess.PIPE, text=True)
        if "to record LMGC90 it needs" in ran.stderr:
            raise ImportError(
                f"{ran.stderr.strip()}; install it with: pip install 'fclib[recorders]'"
            )
        sys.stderr.write(ran.stderr)
        state: State | None = None
        files = sorted(folder.glob("[0-9]*.npz"))
        for file in files:
            with np.load(file) as data:
                step = dict(data)
            number = int(step["simulation"])
            if state is None or state.simulation != number:
                state = State.start(folder / f"model-{number}.npz", number)
            following = state.after(step)
            kept = "gap" in step
            yield state, partial(recorded, state, following, step, notes) if kept else no_step
            state = following
    if ran.returncode:
        raise ChildProcessError(
            f"{source.path}: LMGC90's engine ended with status {ran.returncode} after"
            f" {counted(len(files), 'step')}; what it said is above"
        )


# ---- a deck


def write_deck(path: Path, source: Source) -> tuple[str, ...]:
    """Write what the engine needs of a deck, and return what differs, in words. ValueError."""
    deck = decks.read(source.path)
    if source.steps < 1:
        raise ValueError(f"the number of steps must be at least 1, not {source.steps}")
    if deck.meshes:
        deck.meshes[0].place.fail("a mesh; the engine of compas_lmgc90 takes rigid polyhedra only")
    if not np.array_equal(deck.gravity, GRAVITY):
        raise ValueError(
            f"{deck.path / 'BULK_BEHAV.DAT'}: the engine has the gravity {GRAVITY.tolist()}, and"
            f" the deck {deck.gravity.tolist()}"
        )
    notes = list(deck.unknown)
    law, alert = one_law(deck, notes)
    densities = sorted({deck.materials[body.material].density for body in deck.rigid})
    arrays: dict[str, Any] = {
        "h": source.time_step,
        "theta": source.theta,
        "densities": np.array(densities),
        "law": law.name,
        "parameters": np.array([law.mu]),
        "alert": alert,
        "material": np.array(
            [densities.index(deck.materials[body.material].density) for body in deck.rigid]
        ),
        "driven": len(deck.driven),
    }
    for i in range(len(deck.rigid)):
        arrays[f"vertices_{i}"], arrays[f"faces_{i}"] = solid(deck, i, notes)
    for i, drive in enumerate(deck.driven):
        course = drive.course
        arrays[f"driven_{i}"] = np.array(
            [drive.body[1], drive.axis, drive.velocity, bool(course.points)]
        )
        arrays[f"values_{i}"] = (
            np.array(course.points).T.ravel()
            if course.points
            else np.array(
                [
                    *(course.constant, course.amplitude, course.omega),
                    *(course.phase, course.ramp, course.ramp_rate),
                ]
            )
        )
    np.savez(path, **arrays)
    return tuple(notes)


def one_law(deck: Deck, notes: list[str]) -> tuple[Law, float]:
    """The law and alert distance that the engine takes for all pairs: the deck's most frequent."""
    if not deck.sees:
        raise ValueError(f"{deck.path / 'TACT_BEHAV.DAT'}: nothing sees anything")
    count = {see.law: 0 for see in deck.sees}
    for see in deck.sees:
        count[see.law] += 1
    name = max(count, key=lambda law: count[law])
    law = deck.laws[name]
    if law.name not in LAWS or law.mu is None:
        law.place.fail(f"the law {law.name}; recorded are {', '.join(LAWS)}")
    alert = max(see.alert for see in deck.sees if see.law == name)
    for see in deck.sees:
        if deck.laws[see.law].mu != law.mu or see.alert != alert:
            notes.append(
                f"{see.place}: the engine has one law and one alert distance, {law.mu:g} and"
                f" {alert:g} m; here the deck has {deck.laws[see.law].mu:g} and {see.alert:g} m"
            )
    seen = {frozenset((see.first, see.second)) for see in deck.sees}
    there = sorted({(c.kind, c.colour) for body in deck.rigid for c in body.contactors})
    for i, first in enumerate(there):
        for second in there[i:]:
            movable = [
                k
                for k, body in enumerate(deck.rigid)
                if k not in deck_scene.fixed(deck)
                and any((c.kind, c.colour) in (first, second) for c in body.contactors)
            ]
            if frozenset((first, second)) not in seen and movable:
                notes.append(
                    f"{deck.path.name}/TACT_BEHAV.DAT: {' '.join(first)} and {' '.join(second)} do"
                    " not see each other in the deck, in the engine they do"
                )
    return law, alert


def solid(deck: Deck, index: int, notes: list[str]) -> tuple[Vector, Any]:
    """The vertices in the world and the triangles of a body of a deck. ValueError."""
    body = deck.rigid[index]
    if len(body.contactors) != 1:
        body.place.fail(
            f"the engine of compas_lmgc90 takes one polyhedron a body, not {len(body.contactors)}"
        )
    one = deck_scene.placed(deck, index, notes)
    if one.velocity.any():
        deck.starts[RIGID, index, 0].place.fail(
            "a body that moves at the start; the engine of compas_lmgc90 starts at rest"
        )
    contactor, vertices, origin = one.shapes[0]
    if contactor.kind == "SPHER":
        contactor.place.fail("a SPHER; the engine of compas_lmgc90 takes POLYR and PLANx only")
    if contactor.kind == "PLANx":
        corners, faces = polyhedron.box_surface(np.array(contactor.size))
        local = corners @ (one.turn @ contactor.turn).T + origin
    else:
        local, faces = vertices, contactor.faces
        try:
            faces = polyhedron.oriented(local, faces)
        except ValueError:  # named by `placed`
            local, faces = polyhedron.hull(local)
    return local @ one.axes.T + one.centre, faces


# ---- a step


@dataclass(frozen=True)
class Model:
    """What a simulation was told."""

    h: float
    theta: float
    law: str
    mu: float
    version: str
    mass: Vector  # (n) of each degree of freedom, six a body
    driven: tuple[tuple[int, bool, Course], ...]  # degree of freedom, velocity or force, course

    @classmethod
    def of(cls, file: Path) -> Model:
        with np.load(file) as data:
            told = dict(data)
        h, theta = float(told["h"]), float(told["theta"])
        masses = []
        for i, kind in enumerate(told["material"].tolist()):
            density = float(told["densities"][kind])
            own, faces = told[f"vertices_{i}"], told[f"faces_{i}"]
            solid_of = polyhedron.moments(own, polyhedron.oriented(own, faces))
            axes = told["frame"][i].reshape(3, 3)  # rows
            moments = np.einsum("ij,jk,ik->i", axes, solid_of.inertia, axes)
            masses.append(density * np.concatenate(([solid_of.volume] * 3, moments)))
        driven = []
        for i in range(sum(name.startswith("driven_") for name in told)):
            body, dof, velocity, evolution = told[f"driven_{i}"].tolist()
            values = told[f"values_{i}"].tolist()
            half = len(values) // 2
            names = ("constant", "amplitude", "omega", "phase", "ramp", "ramp_rate")
            course = (
                Course(points=tuple(zip(values[:half], values[half:], strict=True)))
                if evolution
                else Course(**dict(zip(names, values, strict=True)))
            )
            driven.append((6 * int(body) + int(dof), bool(velocity), course))
        parameters = told["parameters"].tolist()
        return cls(
            h,
            theta,
            str(told["law"]),
            float(parameters[0]) if parameters else 0.0,
            str(told["version"]),
            np.concatenate(masses),
            tuple(driven),
        )


@dataclass(frozen=True)
class State:
    """Where bodies are, and how they move."""

    simulation: int
    model: Model
    number: int  # of the step that begins here
    place: Vector  # (nb x 3)
    axes: Vector  # (nb x 3 x 3) columns
    velocity: Vector  # (6 nb)
    middle: tuple[Vector, Vector] = field(repr=False, default=(np.zeros(0), np.zeros(0)))

    @classmethod
    def start(cls, file: Path, number: int) -> State:
        model = Model.of(file)
        with np.load(file) as data:
            place, frame = data["place"], data["frame"]
        velocity = np.zeros(6 * len(place))
        for dof, is_velocity, course in model.driven:
            if is_velocity:
                velocity[dof] = course.at(0.0)
        return cls(number, model, 0, place, _columns(frame), velocity)

    def halfway(self) -> tuple[Vector, Vector]:
        """Centres and axes in the middle of the step, where the engine finds contacts."""
        rest = (1 - self.model.theta) * self.model.h
        v = self.velocity.reshape(-1, 6)
        return self.place + rest * v[:, :3], turned(self.axes, rest * v[:, 3:])

    def after(self, step: dict[str, Any]) -> State:
        """The state after a step."""
        model, place, axes = self.model, step["place"], _columns(step["frame"])
        share = model.theta * model.h
        if not share:
            raise ValueError("theta = 0: the velocities do not follow from the places")
        middle, middle_axes = self.halfway()
        velocity = np.concatenate(
            ((place - middle) / share, turn_of(middle_axes, axes) / share), axis=1
        )
        return State(self.simulation, model, self.number + 1, place, axes, velocity.ravel())


def _columns(frame: Vector) -> Vector:
    """The engine's axes, one after the other, as columns of matrices (nb x 3 x 3)."""
    found: Vector = frame.reshape(-1, 3, 3).transpose(0, 2, 1)
    return found


def turned(axes: Vector, spin: Vector) -> Vector:
    """Axes (k x 3 x 3, columns) turned by small angles (k x 3) about themselves, as LMGC90 does.

    Each axis moves along its velocity; then they are made orthogonal in their order.
    """
    moved = axes + axes @ crosses(spin)
    first = moved[:, :, 0] / np.linalg.norm(moved[:, :, 0], axis=1, keepdims=True)
    second = moved[:, :, 1] - (moved[:, :, 1] * first).sum(axis=1, keepdims=True) * first
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    return np.stack((first, second, np.cross(first, second)), axis=2)


def turn_of(before: Vector, after: Vector) -> Vector:
    """The angles (k x 3) by which `turned` leads from axes to axes."""
    q = before.transpose(0, 2, 1) @ after
    third = q[:, 1, 0] / q[:, 0, 0]
    second = -q[:, 2, 0] / q[:, 0, 0]
    # the second axis moves along (-third, 1, first), which the new third axis is at right angles to
    first = (third * q[:, 0, 2] - q[:, 1, 2]) / q[:, 2, 2]
    return np.column_stack((first, second, third))


def crosses(a: Vector) -> Vector:
    """The matrices (k x 3 x 3) of a x b."""
    zero = np.zeros(len(a))
    rows = [zero, -a[:, 2], a[:, 1], a[:, 2], zero, -a[:, 0], -a[:, 1], a[:, 0], zero]
    return np.stack(rows, axis=1).reshape(-1, 3, 3)


def recorded(
    state: State, following: State, step: dict[str, Any], notes: tuple[str, ...]
) -> Recorded | None:
    """The problem of a step. ValueError if its law is not known."""
    model = state.model
    h, nc = model.h, len(step["gap"])
    if not nc:
        return None
    if model.law not in LAWS:
        raise SetupError(f"the law {model.law!r} is not known: recorded are {', '.join(LAWS)}")
    frame = step["axes"][:, ORDER]
    centre, axes = state.halfway()
    # the candidate comes first, and N points to it
    sides = [(step["bodies"][:, side], sign) for side, sign in ((0, 1.0), (1, -1.0))]
    whole = jacobian(sides, step["point"], frame, centre, axes)
    gap = step["gap"] - (step["internal"] if model.law == "IQS_CLB_g0" else 0.0)
    w = np.zeros(3 * nc)
    w[::3] = np.maximum(gap, 0.0) / h
    held = np.array([dof for dof, is_velocity, _ in model.driven if is_velocity], dtype=int)
    free = np.setdiff1d(np.arange(len(model.mass)), held)
    w += whole[held].T @ following.velocity[held]
    H = sp.csc_array(whole[free])
    f = model.mass * state.velocity + h * forces(state)
    problem = _core.GlobalProblem(
        spacedim=3,
        M=sp.csc_array(sp.diags_array(model.mass[free])),
        H=H,
        f=f[free],
        w=w,
        mu=np.full(nc, model.mu),
        info=_core.ProblemInfo(),
    )
    contacts = Contacts(
        jacobian=H.T,
        mu=problem.mu,
        w=w,
        point=step["point"],
        frame=frame,
        bodies=step["bodies"][:, ::-1].astype(np.int64),
        gap=step["gap"],
    )
    made = Recorded(
        assembled=Assembled(problem, len(free)),
        engine="LMGC90",
        version=f"compas_lmgc90 {model.version}",
        licence="CeCILL",
        law=f"{model.law}: Coulomb, inelastic, Moreau-Jean",
        time=state.number * h,
        h=h,
        fields=FIELDS,
        guess=_core.Solution(r=h * step["force"][:, ORDER].ravel()),
        velocity=following.velocity[free],
        contacts=contacts,
        notes=(
            "Of each body: the velocity of its centre, and its spin about its axes of inertia.",
            *(f"Left out: {note}." for note in notes),
        ),
        more={"theta": model.theta},
    )
    off = made.mismatch or 0.0
    # the largest velocity, with reactions or without
    largest = max(np.abs(made.velocity).max(initial=0.0), np.abs(f / model.mass)[free].max())
    word = []
    if off > AGREES * largest:
        word = [
            f"From the reaction follows the next velocity to {off / largest:.1e} of the largest:"
            " the engine's sweeps had not converged further."
        ]
    more = {**made.more, "velocity_off": off, "unconverged": bool(word)}
    return replace(made, notes=(*made.notes, *word), more=more)


def forces(state: State) -> Vector:
    """Weights, driven forces in their mean over the step, and gyroscopic moments (6 nb)."""
    model = state.model
    mass = model.mass.reshape(-1, 6)
    F = np.zeros_like(mass)
    F[:, :3] = mass[:, :3] * GRAVITY
    spin = state.velocity.reshape(-1, 6)[:, 3:]
    F[:, 3:] = -np.cross(spin, mass[:, 3:] * spin)
    found = F.ravel()
    start = state.number * model.h
    for dof, is_velocity, course in model.driven:
        if not is_velocity:
            end = course.at(start + model.h)
            found[dof] += (1 - model.theta) * course.at(start) + model.theta * end
    return found
