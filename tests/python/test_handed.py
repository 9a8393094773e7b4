"""States of another engine: their problems, their files, and the choice of rt444's steps."""

from __future__ import annotations

import dataclasses
import io
import math
import shutil
import signal
import threading
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import fclib
from fclib import _digest, collections
from fclib._geometry import rotations
from fclib.collections import handed, published, set_index, trajectory
from fclib.collections.verify import verify
from fclib.external import siconos
from fclib.recorders import _siconos
from fclib.scenes import Scene
from helpers import dense, needs_siconos_mechanics, ran
from workshop.sets import _rt444_scenes, rt444_states

H, THETA, GRAVITY, MU = 1e-3, 0.6, 9.81, 0.4
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


def solids() -> tuple[handed.Solid, ...]:
    """A floor, and three bodies that differ in all."""
    return (
        handed.Solid(name="floor", kind="box", size=(9.0, 9.0, 1.0), place=(0.0, 0.0, -1.0)),
        *(
            handed.Solid(
                name=f"body{i}",
                kind="box",
                size=(0.5, 0.6, 0.7),
                mass=2.0 + i,
                inertia=(1.0 + i, 1.5, 2.0 - 0.3 * i),
                place=(0.0, 0.0, 1.0 + i),
            )
            for i in range(3)
        ),
    )


def some_states(count: int, seed: int = 0) -> tuple[Any, Any, handed.Handed]:
    """States with 1, 2, ... contacts: of the floor and a body, then of two bodies."""
    random = np.random.default_rng(seed)
    turn = random.normal(size=(count, 3, 4))
    turn /= np.linalg.norm(turn, axis=2, keepdims=True)
    place = random.normal(size=(count, 3, 3)) + np.array([0, 0, 2])
    position = np.concatenate((place, turn), axis=2).reshape(count, -1)
    velocity = random.normal(size=(count, 18))
    nc = np.arange(1, count + 1)
    total = int(nc.sum())
    normal = random.normal(size=(total, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    pairs = np.array([(0, 1), (1, 2)])
    return (
        position,
        velocity,
        handed.Handed(
            solids=solids(),
            mu=MU,
            theta=THETA,
            gravity=GRAVITY,
            count=nc,
            body=np.concatenate([pairs[np.arange(n) % 2] for n in nc]),
            feature=np.arange(total) + 7,
            point=random.normal(size=(total, 3)),
            normal=normal,
            gap=random.normal(size=total) * 1e-3,
        ),
    )


def states_of(count: int = 5, version: str = "1") -> trajectory.Trajectory:
    """The same as a trajectory, rounded."""
    position, velocity, contacts = some_states(count)
    rounded: dict[str, Any] = {
        name: trajectory.rounded(getattr(contacts, name), -30) for name in trajectory.NUMBERS
    }
    made = trajectory.Trajectory(
        scene=Scene(
            name="BoxesStack",
            time_step=H,
            theta=THETA,
            seed=0,
            title="Bodies",
            description="Bodies.",
            authors="somebody",
        ),
        origin={
            "collection": "rt444",
            "version": version,
            "engine": {"name": "an engine", "version": "3"},
            "settings": {"kept": "all"},
        },
        exponent=-30,
        number=np.arange(count),
        step=10 * np.arange(count) + 3,
        position=trajectory.rounded(position, -30),
        velocity=trajectory.rounded(velocity, -30),
        handed=dataclasses.replace(contacts, **rounded),
    )
    problems = [made.problem(k).problem for k in range(count)]
    return dataclasses.replace(
        made,
        digest=tuple(map(_digest.digest, problems)),
        structure=tuple(map(_digest.structure, problems)),
        sketch=np.stack([_digest.sketch(problem) for problem in problems]),
    )


# ---- the equations


def test_contact_velocities_are_those_of_the_bodies_points() -> None:
    """H^T v is how fast the points of the second body leave the first's, in the frame."""
    position, velocity, contacts = some_states(4)
    problem = contacts.problem(3, position[3], velocity[3], H, fclib.ProblemInfo())
    pose, twist = position[3].reshape(3, 7), velocity[3].reshape(3, 6)
    v = np.concatenate([twist[0], twist[1]])  # the third body touches nothing
    assert problem.n == 12
    u = dense(problem.H).T @ v
    table = problem.contacts
    for c in range(problem.nc):
        speeds = []
        for body in table.body[c]:
            if body == 0:
                speeds.append(np.zeros(3))
                continue
            x, q, own = pose[body - 1, :3], pose[body - 1, 3:], twist[body - 1]
            R = rotations(q[None])[0]
            speeds.append(own[:3] + np.cross(R @ own[3:], table.point[c] - x))
        expected = table.frame[c] @ (speeds[1] - speeds[0])
        np.testing.assert_allclose(u[3 * c : 3 * c + 3], expected, atol=1e-12)
    gram = np.einsum("cij,ckj->cik", table.frame, table.frame)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(3), gram.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(table.frame), 1, atol=1e-14)


def test_mass_has_the_derivative_of_gyroscopic_moments() -> None:
    position, velocity, contacts = some_states(2)
    problem = contacts.problem(1, position[1], velocity[1], H, fclib.ProblemInfo())
    M, f = dense(problem.M), np.asarray(problem.f)
    for i, solid in enumerate(contacts.solids[1:3]):
        own = slice(6 * i, 6 * i + 6)
        twist = velocity[1].reshape(3, 6)[i]
        inertia = np.diag(solid.inertia)

        def moment(omega: Any, inertia: Any = inertia) -> Any:
            return np.cross(omega, inertia @ omega)

        step = 1e-6
        slope = np.column_stack(
            [
                (moment(twist[3:] + step * axis) - moment(twist[3:] - step * axis)) / (2 * step)
                for axis in np.eye(3)
            ]
        )
        expected = np.zeros((6, 6))
        expected[:3, :3] = solid.mass * np.eye(3)
        expected[3:, 3:] = inertia + H * THETA * slope
        np.testing.assert_allclose(M[own, own], expected, atol=1e-9)
        push = np.concatenate(([0, 0, -solid.mass * GRAVITY], -moment(twist[3:])))
        np.testing.assert_allclose(f[own], expected @ twist + H * push, atol=1e-9)
    assert not dense(problem.M)[:6, 6:].any()
    np.testing.assert_array_equal(problem.w, 0)
    np.testing.assert_array_equal(problem.mu, MU)


def test_a_body_at_rest_on_three_points_carries_its_weight() -> None:
    floor, body = solids()[:2]
    corners = np.array([(0.5, 0.5, 0.0), (-0.5, 0.5, 0.0), (0.0, -0.5, 0.0)])
    contacts = handed.Handed(
        solids=(floor, body),
        mu=MU,
        theta=THETA,
        gravity=GRAVITY,
        count=np.array([3]),
        body=np.tile([0, 1], (3, 1)),
        feature=np.arange(3),
        point=corners,
        normal=np.tile([0.0, 0.0, 1.0], (3, 1)),
        gap=np.zeros(3),
    )
    pose = np.array([0, 0, 0.7, *UPRIGHT])
    problem = contacts.problem(0, pose, np.zeros(6), H, fclib.ProblemInfo())
    result: Any = fclib.solve(problem, tol=1e-10)
    assert result.converged
    r = np.reshape(result.solution.r, (3, 3))
    np.testing.assert_allclose(r[:, 0].sum(), H * body.mass * GRAVITY, rtol=1e-8)
    np.testing.assert_allclose(result.solution.v, 0, atol=1e-10)


@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 0, 0), (0, -1, 0), (0, 0, -1)])
def test_rounding_turns_no_frame_of_a_normal_along_an_axis(normal: Any) -> None:
    N = np.array([normal], dtype=float)
    frame = handed.frames(N)
    for disturbed in 1e-9 * np.random.default_rng(1).normal(size=(20, 3)):
        np.testing.assert_allclose(handed.frames(N + disturbed), frame, atol=1e-8)


# planks that spin and fall on each other; the integrator is the one that keeps W alone
PLANKS = """
import sys
import siconos.io.mechanics_run as mechanics_run
import siconos.kernel as kernel
import siconos.numerics as numerics
from siconos.mechanics.collision.tools import Contactor

file = sys.argv[1]
with mechanics_run.MechanicsHdf5Runner(mode="w", io_filename=file) as io:
    io.add_primitive_shape("Ground", "Box", (100, 100, 1))
    io.add_object("ground", [Contactor("Ground")], translation=[0, 0, -0.5])
    io.add_primitive_shape("Plank", "Box", (3, 1, 0.5))
    for i in range(3):
        io.add_object(
            f"plank{i}",
            [Contactor("Plank")],
            translation=[0.3 * i, 0.1 * i, 0.26 + 0.51 * i],
            velocity=[0, 0, -1, 0.3, 0.2 - 0.2 * i, i],
            mass=1 + i,
            inertia=[0.3 + i, 1.0, 2.0],
        )
    io.add_Newton_impact_friction_nsl("contact", mu=0.5, e=0.0)
options = kernel.solver_options_create(numerics.SICONOS_FRICTION_3D_NSGS)
with mechanics_run.MechanicsHdf5Runner(mode="r+", io_filename=file) as io:
    io.run(
        T=0.15,
        h=0.005,
        theta=0.6,
        Newton_options=kernel.SICONOS_TS_LINEAR,
        Newton_max_iter=1,
        solver_options=options,
        verbose=False,
        verbose_progress=False,
        output_frequency=1000,
    )
"""


def test_problems_of_what_siconos_tells_are_its_own(tmp_path: Path) -> None:
    """W from poses, velocities and contacts is Siconos' W; its normal components to rounding."""
    needs_siconos_mechanics()
    script = tmp_path / "planks.py"
    script.write_text(PLANKS, encoding="utf-8")
    command = [siconos.python(), str(_siconos.STEPS), str(tmp_path), "3", str(script)]
    ran(*command, tmp_path / "scene.hdf5")
    two = spinning = 0
    equal = []
    files = sorted(tmp_path.glob("*.npz"))
    for file in files:
        told = _siconos.told(file)
        bodies = [handed.Solid(name="ground", kind="box", size=(50.0, 50.0, 0.5))]
        for mass in told.mass:
            inertia = tuple(np.diag(mass)[3:])
            body: Any = {"name": "plank", "kind": "box", "size": (1.5, 0.5, 0.25)}
            bodies.append(handed.Solid(**body, mass=mass[0, 0], inertia=inertia))
        contacts = handed.Handed(
            solids=tuple(bodies),
            mu=0.5,
            theta=0.6,
            gravity=9.80665,
            count=np.array([len(told.gap)]),
            **{name: getattr(told, name) for name in ("feature", "point", "normal", "gap")},
            body=told.body + 1,
        )
        state = told.position.ravel(), told.velocity.ravel()
        problem = contacts.problem(0, *state, told.h, fclib.ProblemInfo())
        assert np.asarray(problem.mu).tolist() == told.mu.tolist()
        local = problem.condense()
        n = slice(0, None, 3)
        W, own = dense(local.W)[n, n], dense(told.W)[n, n]
        equal.append(np.abs(W - own).max() <= 1e-11 * np.abs(own).max())
        # a share 1 - theta of Siconos' gyroscopic moments is that of the step before
        q = np.asarray(local.q)[n]
        np.testing.assert_allclose(q, told.q[n], rtol=0, atol=1e-3 * np.abs(told.q).max())
        two += int((told.body[:, 0] >= 0).sum())
        spinning += np.abs(own - own.T).max() > 1e-8
    # Bullet may be about to give up a contact
    assert len(files) > 8
    assert sum(equal) >= len(equal) - 1
    assert two
    assert spinning


# ---- files


def test_states_survive_their_file(tmp_path: Path) -> None:
    states = states_of()
    path = tmp_path / f"x{trajectory.SUFFIX}"
    trajectory.write(path, states)
    again = trajectory.read(path)
    assert again.handed is not None
    assert again.scene == states.scene
    for place in reversed(range(len(again))):
        problem: Any = again.problem(place).problem
        assert fclib.digest(problem) == states.digest[place]
        assert again.differences(place, problem) == {}
        assert problem.contacts.feature.tolist() == (
            states.handed.feature[states.handed.rows(place)].tolist()  # type: ignore[union-attr]
        )
    copy = tmp_path / f"copy{trajectory.SUFFIX}"
    trajectory.write(copy, again)
    assert copy.read_bytes() == path.read_bytes()
    some = trajectory.part(again, [1, 4], "some", "2")
    assert [fclib.digest(some.problem(k).problem) for k in (0, 1)] == [
        states.digest[1],
        states.digest[4],
    ]


def test_published_states_of_an_engine_are_built_and_verified(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pyarrow")
    package = tmp_path / "package"
    states = states_of()
    folder = "rt444/BoxesStack"
    trajectory.write(package / published.FOLDER / collections.file_name(folder, "1"), states)
    monkeypatch.setattr(published, "IN_PLACE", package)
    monkeypatch.setattr(published, "_digests", trajectory.read_digests)
    monkeypatch.setattr(published, "_origin", trajectory.read_origin)
    plan = collections.plan_of(folder, problems=len(states))
    assert plan.version == "1"
    table = collections.build([plan], tmp_path / "out", pictures=False)
    rows = table.to_pylist()
    assert [row["digest"] for row in rows] == list(states.digest)
    assert [row["bodies"] for row in rows] == [1, 2, 2, 2, 2]
    assert [row["time"] for row in rows] == pytest.approx([H * k for k in states.step])
    assert {set_index.origin_of(row) for row in rows} == {"published"}
    assert all(verdict.ok for verdict in verify(tmp_path / "out"))
    # a problem that is another is told
    other = fclib.read(tmp_path / "out" / rows[2]["global_file"])
    assert states.differences(1, other) != {}


def test_words_of_a_problem_name_authors_engine_and_choice() -> None:
    info = states_of().problem(1).problem.info
    assert "Authors of the scene: somebody." in info.description
    assert '"name": "an engine", "version": "3"' in info.description
    assert '"step": 13' in info.description
    assert info.title == "Bodies, step 13"


# ---- the scenes of RT-0444


def test_scenes_are_those_of_the_authors_files() -> None:
    """Facts of their scripts: numbers of bodies, first and last places, sizes."""
    scenes = _rt444_scenes.SCENES
    boxes, planks, capsules = (
        [body for body in scenes[name].bodies() if body.mass]
        for name in ("BoxesStack", "KaplasTower", "Capsules")
    )
    assert [len(some) for some in (boxes, planks, capsules)] == [50, 132, 100]
    assert list(boxes[-1].place) == [0, 0, 300]
    assert list(capsules[-1].place) == [0, 0, 614]
    np.testing.assert_allclose(planks[-1].place, (20.3342764809, -11.74, 36.66), atol=1e-9)
    assert {body.mass for body in (*boxes, *planks, *capsules)} == {1.0}
    # a plank lies along its ring, and stands on its edge
    for plank in planks:
        R = rotations(np.array([plank.turn]))[0]
        x, y = plank.place[:2]
        np.testing.assert_allclose(R[:, 0], np.array([x, y, 0]) / math.hypot(x, y), atol=1e-12)
        np.testing.assert_allclose(R[:, 2], [0, 0, 1], atol=1e-12)


def test_inertia_of_a_capsule_is_that_of_its_points() -> None:
    body = next(body for body in _rt444_scenes.SCENES["Capsules"].bodies() if body.mass)
    radius, height = body.sizes
    axis = np.linspace(-radius - height / 2, radius + height / 2, 161)
    side = np.linspace(-radius, radius, 81)
    x, y, z = np.meshgrid(side, axis, side, indexing="ij")
    beyond = np.maximum(np.abs(y) - height / 2, 0)
    inside = x**2 + z**2 + beyond**2 <= radius**2
    x, y, z = (one[inside] for one in (x, y, z))
    expected = [np.mean(y**2 + z**2), np.mean(x**2 + z**2), np.mean(x**2 + y**2)]
    np.testing.assert_allclose(body.inertia, expected, rtol=0.02)


# ---- what is stored


@pytest.mark.parametrize("name", sorted(rt444_states.PROBLEMS))
def test_stored_problems_follow_from_bodies_and_contacts(name: str) -> None:
    """H and w of ten problems from their tables, M and f from masses and velocities; by NumPy."""
    path = published.path_of(f"rt444/{name}", set_index.version_of(f"rt444/{name}"))
    states = None if path is None else trajectory.read(path)
    if states is None or states.handed is None:
        pytest.skip("no states of another engine are stored here")
    scene = _rt444_scenes.SCENES[name]
    h, theta = scene.step, scene.theta
    for place in np.linspace(0, len(states) - 1, 10).astype(int).tolist():
        problem: Any = states.problem(place).problem
        contacts, bodies = problem.contacts, problem.bodies
        moving = np.flatnonzero(bodies.moves)
        touched = np.intersect1d(contacts.body, moving)
        assert problem.n == 6 * len(touched)
        twist = states.velocity[place].reshape(-1, 6)[np.searchsorted(moving, touched)]
        H, M, f = np.zeros((problem.n, problem.m)), np.zeros((problem.n, problem.n)), []
        for c in range(problem.nc):
            N, T1 = contacts.normal[c], contacts.tangent[c]
            frame = np.stack((N, T1, np.cross(N, T1)), axis=1)
            for body, sign in zip(contacts.body[c], (-1, 1), strict=True):
                if body in touched:
                    first = 6 * int(np.searchsorted(touched, body))
                    R = rotations(bodies.turn[body][None])[0]
                    arm = contacts.point[c] - bodies.place[body]
                    columns = slice(3 * c, 3 * c + 3)
                    H[first : first + 3, columns] += sign * frame
                    H[first + 3 : first + 6, columns] += sign * R.T @ cross(arm) @ frame
        for i, (body, v) in enumerate(zip(touched, twist, strict=True)):
            solid, omega = states.handed.solids[body], v[3:]
            inertia = np.diag(inertia_of(solid))
            own = np.zeros((6, 6))
            own[:3, :3] = solid.mass * np.eye(3)
            own[3:, 3:] = inertia + h * theta * (cross(omega) @ inertia - cross(inertia @ omega))
            M[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = own
            pushed = own @ v
            pushed[2] -= h * solid.mass * 9.80665
            pushed[3:] -= h * np.cross(omega, inertia @ omega)
            f.append(pushed)
        for found, expected in (
            (dense(problem.H), H),
            (dense(problem.M), M),
            (np.asarray(problem.f), np.concatenate(f)),
        ):
            assert np.abs(found - expected).max() <= 1e-8 * np.abs(expected).max()
        np.testing.assert_array_equal(problem.w, 0)
        np.testing.assert_array_equal(problem.mu, scene.mu)


def inertia_of(solid: handed.Solid) -> list[float]:
    """Of a homogeneous box or capsule, in its body's axes."""
    if solid.kind == "box":
        x, y, z = np.square(solid.size) * solid.mass / 3
        return [y + z, x + z, x + y]
    radius, half = solid.size
    share = 3 * half / (3 * half + 2 * radius)  # of the cylinder; it lies along y
    along = radius**2 * (0.5 * share + 0.4 * (1 - share))
    caps = 0.4 * radius**2 + half**2 + 0.75 * radius * half
    across = share * (radius**2 / 4 + half**2 / 3) + (1 - share) * caps
    return [solid.mass * across, solid.mass * along, solid.mass * across]


# ---- the choice


def written(
    folder: Path, number: int, shift: float, first: int = 0, order: Any = (0, 1, 2, 3)
) -> Path:
    """A recorded step of the stack: its lowest box on four points, so far beside its middle."""
    bodies = [body for body in _rt444_scenes.SCENES["BoxesStack"].bodies() if body.mass]
    position = np.array([[i + 1, *body.place, *body.turn] for i, body in enumerate(bodies)])
    position[0, [1, 3]] = shift, 1.0
    velocity = np.column_stack((position[:, 0], np.zeros((len(bodies), 6))))
    corners = np.array([(x, y, 0.0) for x in (-1, 1) for y in (-1, 1)])[list(order)]
    rows = np.zeros((4, 25))
    rows[:, 1:4], rows[:, 4:7], rows[:, 9] = corners, corners, 1
    rows[:, 22], rows[:, 23], rows[:, 24] = order, 1, 1
    mass = np.array([np.diag([1.0] * 3 + [2 / 3] * 3)] * len(bodies))
    h = _rt444_scenes.SCENES["BoxesStack"].step
    known: dict[str, Any] = {
        "points": rows,
        "positions": position,
        "velocities": velocity,
        "masses": mass,
        "mu": np.full(4, 0.7),
        "r": np.zeros(12),
        "q": np.tile([-h * rt444_states.GRAVITY, 0, 0], 4),
        "end": (number + 1) * h,
        "h": h,
    }
    arms = corners - position[0, 1:4]
    J = np.vstack([np.hstack((np.eye(3)[[2, 0, 1]], -cross(arm)[[2, 0, 1]])) for arm in arms])
    W = J @ np.diag(1 / np.diag(mass[0])) @ J.T
    matrix = sp.csc_array(W)
    known |= {f"W_{part}": getattr(matrix, part) for part in ("data", "indices", "indptr")}
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{number - first:06d}.npz"
    np.savez(path, W_shape=matrix.shape, **known)
    return path


def cross(a: Any) -> Any:
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def sweeps(folder: Path, counts: dict[int, int]) -> None:
    lines = ["step,contacts,dof,sweeps", *(f"{k},4,6,{n}" for k, n in counts.items())]
    (folder / "sweeps.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def test_chosen_steps_are_hard_different_and_evenly_spread(tmp_path: Path) -> None:
    folder = tmp_path / "BoxesStack"
    for number in range(40):
        # each second one is the one before it, with its contacts in another order
        order = (3, 1, 0, 2) if number % 2 else (0, 1, 2, 3)
        written(folder / "run-0", number, 1e-3 * (number // 2), order=order)
    found = [state.number for state in rt444_states.distinct("BoxesStack", folder, 1)]
    assert found == list(range(0, 40, 2))
    thinned = [state.number for state in rt444_states.distinct("BoxesStack", folder, 5)]
    assert thinned == list(range(0, 40, 5))
    sweeps(folder, {number: 5 if number < 10 else 100 for number in found})
    assert rt444_states.candidates("BoxesStack", folder) == list(range(10, 40, 2))
    path = rt444_states.choose("BoxesStack", folder, tmp_path / "out", "1", 5)
    states = trajectory.read(path)
    assert np.diff(states.step).tolist() == [6] * 4
    assert len(set(states.digest)) == 5
    assert states.origin["settings"]["W_from_engine"] < 1e-12
    with pytest.raises(SystemExit, match=r"15 different steps .* and 16 are asked for"):
        rt444_states.choose("BoxesStack", folder, tmp_path / "other", "1", 16)


def test_a_step_whose_w_is_not_the_engines_is_left_out(tmp_path: Path) -> None:
    folder = tmp_path / "BoxesStack"
    path = written(folder / "run-0", 3, 1e-3)
    rt444_states.judge("BoxesStack", folder, 1, 300)
    assert list(rt444_states.judged(folder)) == [3]
    with np.load(path) as data:
        values = dict(data)
    np.savez(path, **(values | {"W_data": 1.001 * values["W_data"]}))
    rt444_states.sweeps_of(folder).unlink()
    rt444_states.judge("BoxesStack", folder, 1, 300)
    assert not rt444_states.judged(folder)
    with pytest.raises(SystemExit, match="0 different steps"):
        rt444_states.choose("BoxesStack", folder, tmp_path / "out", "1", 1)
    assert not list(tmp_path.rglob(f"*{trajectory.SUFFIX}"))


def test_a_run_that_goes_on_replaces_what_was_simulated_after_its_start(tmp_path: Path) -> None:
    for number in range(2, 9):
        written(tmp_path / "run-0", number, 1e-3)
    last = tmp_path / "run-0" / "000009.npz"
    shutil.copy(tmp_path / "run-0" / "000008.npz", last)
    last.write_bytes(last.read_bytes()[:3000])  # a kill
    for number in range(6, 12):
        written(tmp_path / "run-1", number, 1e-3, first=5)
    (tmp_path / "run-2").mkdir()
    found = rt444_states.files(tmp_path)
    assert list(found) == list(range(2, 12))
    assert {number: path.parent.name for number, path in found.items()} == {
        number: f"run-{int(number >= 6)}" for number in range(2, 12)
    }


def test_judgement_goes_on_where_it_was(tmp_path: Path) -> None:
    folder = tmp_path / "BoxesStack"
    for number in range(3):
        written(folder / "run-0", number, 1e-3 * number)
    sweeps(folder, {1: 77})
    rt444_states.judge("BoxesStack", folder, 1, 300)
    judged = rt444_states.judged(folder)
    assert judged[1] == 77
    assert sorted(judged) == [0, 1, 2]
    assert all(0 < judged[number] <= 300 for number in (0, 2))


def test_a_simulation_gets_the_reactions_of_its_steps() -> None:
    """Siconos asks in bytes; what comes back are reactions of the problem."""
    position, velocity, contacts = some_states(3)
    problem: Any = contacts.problem(2, position[2], velocity[2], H, fclib.ProblemInfo()).condense()
    here, there = Pipe()
    serving = threading.Thread(target=rt444_states.solves, args=(here,))
    serving.start()
    W = sp.csc_array(problem.W)
    told = io.BytesIO()
    np.savez(told, data=W.data, indices=W.indices, indptr=W.indptr, q=problem.q, mu=problem.mu)
    there.send_bytes(told.getvalue())
    r = np.frombuffer(there.recv_bytes())
    there.close()
    serving.join(timeout=10)
    assert not serving.is_alive()
    assert fclib.merit(problem, fclib.Solution(r=r, u=W @ r + problem.q)).natural <= 1e-8


def test_siconos_goes_on_from_a_step_with_these_reactions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The lowest box rests; its reactions in Siconos' steps are solutions to the tolerance."""
    needs_siconos_mechanics()
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    folder = tmp_path / "BoxesStack"
    written(folder / "run-0", 100, 0.0, first=100)
    h = _rt444_scenes.SCENES["BoxesStack"].step
    rt444_states.simulate("BoxesStack", folder, 1, 106 * h)
    found = rt444_states.files(folder)
    assert len(found) >= 4
    assert max(found) == 105
    for number in range(103, 106):
        told = _siconos.told(found[number])
        with np.load(found[number]) as data:
            r, mu = data["r"], data["mu"]
        problem = fclib.LocalProblem(spacedim=3, W=told.W, q=told.q, mu=mu)
        result = fclib.Solution(r=r, u=told.W @ r + told.q)
        assert fclib.merit(problem, result).natural <= 1e-8
        # the box weighs on the ground, and nothing else does yet
        weight = rt444_states.GRAVITY * h
        assert np.reshape(r, (-1, 3))[:, 0].sum() == pytest.approx(weight, rel=1e-6)
