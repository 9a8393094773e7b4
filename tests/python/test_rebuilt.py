"""M, H, f and w of the authors' scenes follow from the tables of their files, by NumPy alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from fclib.collections import published, trajectory
from helpers_rebuilt import directions, rotations

COUNT = 10  # problems of a family
EXACT = 1e-8  # of the largest entry
ROUNDING = 2.0**-31  # of the tables' places and gaps [m]
GRAVITY = {"handed": 9.80665, "own": 9.81}  # [m/s^2]


def large(folder: str) -> Any:
    return pytest.param(folder, marks=pytest.mark.long)


FOLDERS = (
    "rt444/BoxesStack",
    large("rt444/Capsules"),
    "rt444/Chain",
    "rt444/KaplasTower",
    "fclib2024/PrimitiveSoup",
    "fclib2024/RollingSoup",
    "fclib2024/SpheresPile",
    large("fclib2024/Chute"),
    large("fclib2024/RollingChute"),
    large("fclib2024/Spheres"),
    large("fclib2024/Spheres1mm"),
    large("fclib2024/Spheres1mmScaled"),
    "rr9118/Aqueduct",
    "rr9118/Bridge",
    "rr9118/Capsules",
    "rr9118/Chain",
    "rr9118/KaplasTower",
    large("rr9118/PeriodicBox"),
    large("rr9118/SpheresBox"),
    large("rr9118/Chute1000"),
    large("rr9118/Chute4000"),
    large("decks/SpheresInPlates"),
    "decks/ShakenCell",
)


def crossing(vectors: Any) -> Any:
    """The matrices of the products a x ...: (k x 3) to (k x 3 x 3)."""
    return np.cross(vectors[:, None, :], np.eye(3)[None]).transpose(0, 2, 1)


def in_problem(problem: Any, driven: bool) -> Any:
    """The bodies of a problem with six coordinates: all that move, or those with a contact.

    The last one may be a plate on a slider, with one coordinate. Driven ones have coordinates too.
    """
    moving = np.flatnonzero(problem.bodies.moves)
    if driven:
        return moving
    count, plates = divmod(problem.n, 6)
    assert plates <= 1
    if len(moving) != count + plates:
        moving = np.intersect1d(moving, problem.contacts.body)
        assert len(moving) == count + plates
    return moving[:count]


def largest(matrix: Any) -> float:
    """The largest entry of an array or a sparse matrix."""
    return float(np.abs(matrix.data if sp.issparse(matrix) else matrix).max(initial=0.0))


@pytest.mark.parametrize("folder", FOLDERS)
def test_problems_are_rebuilt_from_their_tables(folder: str) -> None:
    versions = published.versions(folder)
    if not versions:
        pytest.skip("its states are not stored here")
    path = published.path_of(folder, versions[-1])
    assert path is not None
    states = trajectory.read(path)
    if states.handed is None:
        pytest.importorskip("mujoco")
    scene, h = states.scene, states.time_step
    places = np.unique(np.linspace(0, len(states) - 1, COUNT).round().astype(int))
    assert len(places) == COUNT
    for place in places.tolist():
        part: Any = states.problem(place)
        problem = part.problem
        bodies, contacts = problem.bodies, problem.contacts
        which = in_problem(problem, bool(scene.drives))
        n = 6 * len(which)
        free = part.dofs if scene.drives else np.arange(n)
        H = directions(problem, which)
        assert largest(H[free] - problem.H[: len(free)]) <= EXACT * max(1.0, largest(H))

        axes = rotations(bodies.axes[which])
        inertia = axes @ (bodies.inertia[which][:, :, None] * axes.transpose(0, 2, 1))
        mass = bodies.mass[which]
        # the file has no velocities of driven bodies
        v = states.velocity[place] if scene.drives else bodies.velocity
        twist = v[:n].reshape(-1, 6)
        omega = twist[:, 3:]
        momentum = np.einsum("bij,bj->bi", inertia, omega)
        blocks = np.zeros((len(which), 6, 6))
        blocks[:, np.arange(3), np.arange(3)] = mass[:, None]
        blocks[:, 3:, 3:] = inertia
        if states.handed is not None or scene.gyroscopic:
            # the derivative of the gyroscopic term h omega x J omega
            change = crossing(omega) @ inertia - crossing(momentum)
            blocks[:, 3:, 3:] += h * scene.theta * change
        M = sp.block_diag(list(blocks), format="csc")
        k = len(free)
        assert largest(M[free][:, free] - problem.M[:k, :k]) <= EXACT * largest(M)

        gravity = GRAVITY["own"] if states.handed is None else GRAVITY["handed"]
        pushed = np.zeros_like(twist)
        pushed[:, 2] = -h * mass * scene.parameters.get("gravity", gravity)
        pushed[:, 3:] = -h * np.cross(omega, momentum)
        f = (M @ twist.ravel() + pushed.ravel())[free]
        assert largest(f - problem.f[:k]) <= EXACT * largest(f)

        later = np.zeros(n)
        for drive in scene.drives:
            assert drive.velocity
            later[drive.dof] = drive.course.at(states.time(place) + h)
        w = (H.T @ later).reshape(problem.nc, -1)
        if scene.law == "gap":
            # a plate on a slider is in H of the problem only
            before = H.T @ v if scene.drives else problem.H.T @ v
            middle = contacts.gap + (1 - scene.theta) * h * before.reshape(w.shape)[:, 0]
            # the law of the decks undoes no penetration
            assert {one.law for one in scene.interactions} <= {"IQS_CLB"}
            undone = 0.0 if scene.interactions else states.origin["settings"]["stabilization"]
            w[:, 0] += np.where(middle > 0, 1.0, undone) * middle / h
        else:
            assert scene.restitution == 0
        # w has gaps by the time step
        assert largest(w.ravel() - problem.w) <= EXACT * largest(w) + 1.1 * ROUNDING / h
