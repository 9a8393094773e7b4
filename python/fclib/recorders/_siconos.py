"""Siconos: the friction problems of a script's steps, in the form in which Siconos solves them.

The script runs in the interpreter that has Siconos (`fclib.external.siconos`), by
_siconos_steps.py. With `MoreauJeanGOSI` the problem is global: M v = H r + q, u = H^T v + b. With
other integrators it is local: u = W r + q. With joints it is u = W r + V lambda + q, and
V^T r + R lambda + s = 0. Stops and friction of joints, and rolling friction, are not recorded.

Acary & Perignon, "Siconos: a software platform for modeling, simulation, analysis and control of
nonsmooth dynamical systems" (2007).
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from fclib import _core
from fclib.external import siconos as installed
from fclib.recorders._assemble import Assembled, Contacts
from fclib.recorders._recorded import Maker, Origin, Recorded, Recording, SetupError, no_step

STEPS = Path(__file__).with_name("_siconos_steps.py")


def siconos(
    script: str | Path, *, arguments: Sequence[str] = (), every: int = 1
) -> Iterator[Recorded]:
    """Run a script of Siconos, and give each `every`-th of its steps that has contacts.

    The script runs to its end before the first step is given.

    Raises:
        ImportError: Siconos is not installed.
        FileNotFoundError: there is no such script.
        ChildProcessError: the script ended with an error; raised after the steps before it.
        ValueError: `every` is below 1; a joint has a stop or friction.
    """
    made = (make() for make in steps(Path(script), arguments, every))
    return (step for step in made if step is not None)


def record(recording: Recording, script: Path, arguments: Sequence[str]) -> None:
    """Add the steps of a script to a recording."""
    for make in steps(script, arguments, recording.every):
        recording.take(make)


def steps(script: Path, arguments: Sequence[str], every: int) -> Iterator[Maker]:
    """What makes each step of a script; it makes None if it is not kept, or nothing touches."""
    if every < 1:
        raise ValueError(f"every must be at least 1, not {every}")
    if not script.is_file():
        raise FileNotFoundError(f"{script}: there is no such script")
    if word := installed.missing():
        raise ImportError(word)
    with tempfile.TemporaryDirectory(prefix="fclib-") as folder:
        command = [installed.python(), str(STEPS), folder, str(every), str(script), *arguments]
        status = subprocess.run(command, check=False).returncode
        end = Path(folder) / "steps.json"
        told: Any = {"steps": 0}  # the worker ended before the script began
        if end.is_file():
            told = json.loads(end.read_text(encoding="utf-8"))
        for number in range(told["steps"]):
            file = Path(folder) / f"{number:06d}.npz"
            yield partial(recorded, file, told["version"]) if file.is_file() else no_step
    if status:
        raise ChildProcessError(
            f"{script}: ended with status {status} in {installed.python()}; what it said is above"
        )


def recorded(file: Path, version: str) -> Recorded:
    """The data that _siconos_steps.py wrote for a step.

    Raises:
        SetupError: a joint has a stop or friction.
    """
    with np.load(file) as data:
        known: dict[str, Any] = dict(data)
    if "refused" in known:
        raise SetupError(str(known["refused"]))
    dimension, h = int(known["dimension"]), float(known["h"])
    fields: dict[str, Origin]
    problem: _core.GlobalProblem | _core.LocalProblem
    contacts = None
    if "H_data" in known:
        H = columns(known, "H")
        problem = _core.GlobalProblem(
            spacedim=dimension,
            M=columns(known, "M"),
            H=H,
            f=known["q"],
            w=known["b"],
            mu=known["mu"],
        )
        fields = dict.fromkeys(("M", "f", "H", "w", "mu"), "exact")
        contacts = Contacts(
            jacobian=H.T, mu=known["mu"], bodies=touching(H, known["bodies"], dimension)
        )
        velocity = known["v"]
    else:
        names = [name for name in ("W", "V", "R") if f"{name}_data" in known]
        vectors = [name for name in ("q", "s", "mu") if name in known]
        problem = _core.LocalProblem(
            spacedim=dimension,
            **{name: columns(known, name) for name in names},
            **{name: known[name] for name in vectors},
        )
        fields = dict.fromkeys((*names, *vectors), "exact")
        velocity = known["u"]
    return Recorded(
        assembled=Assembled(problem, len(velocity)),
        engine="Siconos",
        version=version,
        licence="Apache-2.0",
        law="Coulomb and Newton's impact, Moreau-Jean",
        time=float(known["end"]) - h,
        h=h,
        fields=fields,
        guess=_core.Solution(r=known["r"], l=known.get("l")),
        velocity=velocity,
        contacts=contacts,
        notes=("The velocity and the reaction are those that Siconos' solver returned.",),
        more={"solve_cpu_s": float(known["solve_cpu_s"])},
    )


@dataclass(frozen=True)
class Told:
    """A step of a scene of rigid bodies, as Siconos' mechanics and Bullet told it."""

    start: float  # time at the start of the step [s]
    h: float  # [s]
    number: Any  # (nb) Siconos' numbers of the moving bodies
    position: Any  # (nb x 7) place and quaternion w, x, y, z
    velocity: Any  # (nb x 6) velocity, and the spin in the body's own axes
    mass: Any  # (nb x 6 x 6) in the same components
    # (nc x 2) places in `number`; the normal points to the second; -1 first: something fixed
    body: Any
    feature: Any  # (nc) Siconos' number of the contact, the same as long as it lasts
    point: Any  # (nc x 3) at which both bodies have their levers: on the second one
    normal: Any  # (nc x 3)
    gap: Any  # (nc)
    mu: Any  # (nc)
    reaction: Any  # (3 nc) in Siconos' frames
    W: Any  # (3 nc x 3 nc) of a local problem; None of a global one
    q: Any


def told(file: Path) -> Told:
    """The bodies and contacts of a step that _siconos_steps.py wrote.

    Siconos builds its tangents such that T1 is not at right angles to N if a contact is tilted
    about two axes. So only the normal components of W, q and the reaction are those of the true
    frames. Of a contact that Bullet is about to give up, point and normal may not be those in W.

    Raises:
        ValueError: it has none: the scene is not of rigid bodies, or not of Siconos' mechanics.
        OSError, EOFError: the file is not whole.
    """
    with np.load(file) as data:
        known: dict[str, Any] = dict(data)
    if "points" not in known:
        raise ValueError(f"{file}: its scene has no rigid bodies of Siconos' mechanics")
    h, rows = float(known["h"]), known["points"]
    number = known["positions"][:, 0].astype(int)
    order = np.argsort(number)
    # the two numbers are equal if the other side is fixed
    second, first = (
        order[np.searchsorted(number[order], rows[:, k].astype(int))] for k in (23, 24)
    )
    fixed = rows[:, 23] == rows[:, 24]
    return Told(
        start=float(known["end"]) - h,
        h=h,
        number=number,
        position=known["positions"][:, 1:],
        velocity=known["velocities"][:, 1:],
        mass=known["masses"],
        body=np.column_stack((np.where(fixed, -1, first), second)),
        feature=rows[:, 22].astype(int),
        point=rows[:, 1:4],
        normal=rows[:, 7:10] / np.linalg.norm(rows[:, 7:10], axis=1, keepdims=True),
        gap=rows[:, 13],
        mu=known["mu"],
        reaction=known["r"],
        W=columns(known, "W") if "W_data" in known else None,
        q=known["q"],
    )


def columns(known: dict[str, Any], name: str) -> Any:
    """A matrix of the file."""
    parts = (known[f"{name}_{part}"] for part in ("data", "indices", "indptr"))
    matrix = sp.csc_array(tuple(parts), shape=tuple(known[f"{name}_shape"]))
    matrix.eliminate_zeros()
    return matrix


def touching(H: Any, bodies: Any, dimension: int) -> Any:
    """(nc x 2) the numbers of the systems that a contact moves; -1 first if it is only one."""
    pairs = np.full((H.shape[1] // dimension, 2), -1)
    for c, pair in enumerate(pairs):
        rows = H.indices[H.indptr[dimension * c] : H.indptr[dimension * (c + 1)]]
        moved = np.unique(bodies[rows])
        pair[2 - len(moved) :] = moved
    return pairs
