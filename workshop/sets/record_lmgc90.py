"""The stored steps of a deck of polyhedra, as LMGC90's engine takes them.

    PYTHON -m workshop.sets.record_lmgc90 DECK NAME OUT --steps 500 --every 10 --time-step 1e-3

PYTHON has fclib and compas_lmgc90. OUT gets NAME.npz, which goes to
`python/fclib/scenes/recorded/`: of each step that is kept the places of bodies and contacts, and
what follows from no formula of ours alone. Problems are made from it without the engine.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import fclib
from fclib.recorders import _lmgc90
from fclib.scenes.shared import deck, deck_scene, recorded


def polyhedra(path: Path, model: Any, axes: Any) -> recorded.Polyhedra:
    """The bodies of a deck in the engine's axes of inertia."""
    read = deck.read(path)
    held = deck_scene.fixed(read)
    vertices, faces = [], []
    for i in range(len(read.rigid)):
        own, triangles = _lmgc90.solid(read, i, [])
        vertices.append((own - deck_scene.placed(read, i).centre) @ axes[i])
        faces.append(np.asarray(triangles))
    moves = np.array([int(i not in held) for i in range(len(read.rigid))])
    mass = model.mass[np.repeat(moves, 6) > 0]
    return recorded.Polyhedra(moves, mass, tuple(vertices), tuple(faces))


def steps_of(path: Path, arguments: Any) -> Iterator[tuple[Any, Any]]:
    """The states at the start of the steps that are kept, and the recorded steps."""
    source = _lmgc90.Source(path, (), arguments.steps, arguments.time_step, arguments.theta)
    for state, one in _lmgc90.states_of(source, arguments.every):
        if one is not None and state.number:
            yield state, one


def step_of(state: Any, one: Any) -> recorded.Step:
    """A recorded step as it is stored."""
    problem, contacts = one.assembled.problem, one.contacts
    centre, axes = state.halfway()
    turn = np.array([deck_scene.quaternion(own) for own in axes])
    return recorded.Step(
        time=np.array([one.time]),
        step=np.array([one.h]),
        f=problem.f,
        w=problem.w,
        mu=problem.mu,
        reaction=one.guess.r,
        velocity=np.asarray(one.velocity),
        body=contacts.bodies.astype(np.int32),
        point=contacts.point,
        normal=contacts.frame[:, 0],
        tangent=contacts.frame[:, 1],
        gap=contacts.gap,
        turn=turn,
        centre=centre,
        axes=axes,
    )


def main() -> None:
    """Write the file."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("deck", type=Path)
    parser.add_argument("name")
    parser.add_argument("out", type=Path)
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--time-step", type=float, required=True)
    parser.add_argument("--theta", type=float, default=0.5)
    arguments = parser.parse_args()
    kept: list[recorded.Step] = []
    own, about = None, {}
    worst = 0.0
    for state, one in steps_of(arguments.deck, arguments):
        if own is None:
            own = polyhedra(arguments.deck, state.model, state.axes)
            about = {
                "engine": {"name": one.engine, "version": one.version, "licence": one.licence},
                "law": one.law,
                "notes": " ".join(one.notes[: len(one.notes) - bool(one.more["unconverged"])]),
                "unknowns": "velocity of each body, then its spin about its axes of inertia",
                "fields": dict(one.fields),
                "theta": arguments.theta,
            }
        kept.append(step_of(state, one))
        worst = max(worst, one.mismatch)
        # H from what is stored is that of the recorder
        made = recorded.problem_of(recorded.File(about, np.zeros((0, 3)), (kept[-1],), (), own), 0)
        off = abs(made.H - one.problem.H).max()
        print(f"{state.number}: {made.nc} contacts, H off {off:.0e}, v off {one.mismatch:.0e} m/s")
    arguments.out.mkdir(parents=True, exist_ok=True)
    path = arguments.out / f"{arguments.name}.npz"
    file = recorded.File(about, np.zeros((0, 3)), tuple(kept), (), own)
    digests = [fclib.digest(recorded.problem_of(file, k)) for k in range(len(kept))]
    recorded.write(path, replace(file, digests=tuple(digests)))
    print(f"{path}: {len(kept)} steps, {len(set(digests))} distinct, {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
