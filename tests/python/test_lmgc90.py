"""Steps of LMGC90's engine: its reactions give its velocities, and the stepper finds the same."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
import helpers_deck as write
from fclib import recorders
from fclib.recorders import _lmgc90
from fclib.scenes.shared import deck as decks
from fclib.scenes.shared import deck_scene
from fclib.scenes.shared.recorded import jacobian
from helpers import converged, dense
from helpers_cli import invoke

H = 1e-3
BALL = "RBDY3  SPHER  BLEUx"


@pytest.fixture
def engine() -> None:
    pytest.importorskip("compas_lmgc90", reason="LMGC90's engine is not installed")


def recorded(path: Path, steps: int, **options: Any) -> list[Any]:
    values = {"steps": steps, "time_step": H, "theta": 0.5}
    return list(recorders.lmgc90(path, **(values | options)))


def said(one: Any) -> dict[str, Any]:
    """The JSON at the end of a description."""
    known: dict[str, Any] = json.loads(one.problem.info.description.splitlines()[-1])
    return known


# ---- without the engine


def test_turns_are_found_again() -> None:
    """The spin that leads from axes to axes, as the engine moves them."""
    rng = np.random.default_rng(0)
    axes = np.linalg.qr(rng.normal(size=(20, 3, 3)))[0]
    axes[np.linalg.det(axes) < 0, :, 2] *= -1
    angle = 0.3 * rng.normal(size=(20, 3))
    after = _lmgc90.turned(axes, angle)
    np.testing.assert_allclose(
        after @ after.transpose(0, 2, 1), np.tile(np.eye(3), (20, 1, 1)), atol=1e-14
    )
    np.testing.assert_allclose(_lmgc90.turn_of(axes, after), angle, atol=1e-13)
    # a small turn is the rotation vector
    small = _lmgc90.turned(axes, 1e-5 * angle)
    exact = axes @ (np.eye(3) + _lmgc90.crosses(1e-5 * angle))
    np.testing.assert_allclose(small, exact, atol=1e-10)


def test_the_jacobian_is_that_of_rigid_bodies() -> None:
    rng = np.random.default_rng(1)
    axes = np.linalg.qr(rng.normal(size=(3, 3, 3)))[0]
    centre, point = rng.normal(size=(3, 3)), rng.normal(size=(4, 3))
    frame = np.linalg.qr(rng.normal(size=(4, 3, 3)))[0]
    bodies = np.array([(0, 1), (1, 2), (2, 0), (1, 0)])
    v = rng.normal(size=(3, 6))
    sides = [(bodies[:, 0], 1.0), (bodies[:, 1], -1.0)]
    u = jacobian(sides, point, frame, centre, axes).T @ v.ravel()
    for c, (first, second) in enumerate(bodies):
        speed = [
            v[b, :3] + np.cross(axes[b] @ v[b, 3:], point[c] - centre[b]) for b in (first, second)
        ]
        np.testing.assert_allclose(u[3 * c : 3 * c + 3], frame[c] @ (speed[0] - speed[1]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {
                "BODIES": write.body(1, (0, 0, 0), write.ball(0.5)),
                "DRV_DOF": "",
                "TACT_BEHAV": "\n".join((write.law("iqsc0"), write.see(BALL, BALL))),
            },
            "BODIES.DAT:10: a SPHER",
        ),
        (
            {
                "BODIES": write.body(1, (0, 0, 0), write.block((1, 1, 1)), write.block((2, 1, 1))),
                "DRV_DOF": "",
            },
            "BODIES.DAT:2: the engine of compas_lmgc90 takes one polyhedron a body, not 2",
        ),
        ({"BULK_BEHAV": write.bulk(gravity=1.62)}, "the engine has the gravity"),
        (
            {"TACT_BEHAV": f"{write.law('iqsc0', 'GAP_SGR_CLB')}\n{write.see()}"},
            "TACT_BEHAV.DAT:2: the law GAP_SGR_CLB",
        ),
        (
            {"DOF": write.start(3, (0, 0, 0), (1, 0, 0, 0, 0, 0))},
            "DOF.INI:4: a body that moves at the start",
        ),
    ],
)
def test_what_the_engine_does_not_take_is_named(
    tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    path = write.blocks(tmp_path, **change)
    with pytest.raises(ValueError, match=message):
        recorded(path, 1)
    done = invoke("record", "lmgc90", path, "--out", tmp_path / "out", code=1)
    assert "".join(message.split()) in "".join(done.output.split())


def test_a_mesh_is_not_for_the_engine(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="a mesh; the engine of compas_lmgc90 takes rigid"):
        recorded(write.cubes(tmp_path), 1)


def test_options_of_decks_are_for_decks(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text("pass\n")
    common = ["--out", str(tmp_path / "out")]
    done = invoke("record", "lmgc90", script, "--steps", "3", *common, code=1)
    assert "steps: only for the folder of a deck" in " ".join(done.output.split())
    done = invoke("record", "pybullet", tmp_path, *common, code=1)
    assert "there is no such script" in " ".join(done.output.split())


# ---- with it


@pytest.mark.usefixtures("engine")
@pytest.mark.parametrize("theta", [0.5, 0.7, 1.0])
def test_the_engines_reaction_gives_its_velocity(tmp_path: Path, theta: float) -> None:
    """A block that is turned on a smooth plate, and one that tumbles in the air.

    Forces, moments, an evolution, gyroscopic terms; the engine's sweeps converge, since nothing
    sticks.
    """
    rows = [
        " force      4 evolution turn.dat",
        " force      5  900. 0. 0. 0. 1. 0.",
        " force      6  -700. 300. 40. 0.3 0. 30.",
        " force      1  100. 50. 20. 0. 1. 0.",
    ]
    c, s = np.cos(0.4), np.sin(0.4)
    tilt = np.array([(1, 0, 0), (0, c, -s), (0, s, c)])
    bodies = [
        write.body(1, (0, 0, -0.25), write.block((2, 2, 0.25))),
        write.body(2, (0, 0, 0.2), write.block((0.5, 0.3, 0.2))),
        write.body(3, (5, 5, 5), write.block((0.3, 0.2, 0.4), tilt)),
    ]
    path = write.blocks(
        tmp_path,
        mu=0.0,
        BODIES="\n".join(bodies),
        DRV_DOF="\n".join(
            [
                write.driven(1, *write.STILL),
                write.driven(2, " force      6 200. 50. 30. 0.2 0. 20."),
                write.driven(3, *rows),
            ]
        ),
    )
    (path / "turn.dat").write_text("0. 0.\n0.02 2000.\n1. 2000.\n")
    steps = recorded(path, 100, theta=theta)
    assert len(steps) == 100
    # it was not at rest
    assert np.abs(steps[-1].velocity).max() > 5
    for one in steps[20:]:
        scale = np.abs(one.velocity).max()
        assert one.mismatch <= 1e-8 * scale
        assert "engine's sweeps had not converged" not in " ".join(one.notes)
    # what the engine calls the relative velocities is H^T v
    last = steps[-1]
    assert last.problem.nc == 4
    assert said(last)["fields"]["H"] == "exact"
    assert said(last)["theta"] == theta
    assert fclib.merit(last.problem, last.guess).error < 1e-6
    ours = converged(last.problem, tol=1e-10)
    assert ours.solution.v is not None
    np.testing.assert_allclose(ours.solution.v, last.velocity, atol=1e-7)


@pytest.mark.usefixtures("engine")
def test_a_mismatch_is_told(tmp_path: Path) -> None:
    """With friction the engine stops early: its reactions are a sweep newer than its velocities."""
    first = recorded(write.blocks(tmp_path), 1)[0]
    assert first.mismatch > 1e-8 * np.abs(first.velocity).max()
    assert "engine's sweeps had not converged further" in first.problem.info.description
    assert said(first)["velocity_off"] == pytest.approx(first.mismatch, rel=1e-6)
    # the data themselves are those of the engine: our solution is near its velocity
    ours = fclib.solve(first.problem, tol=1e-10).solution.v
    assert np.abs(ours - first.velocity).max() < 1e-2 * H * 9.81


@pytest.mark.usefixtures("engine")
def test_a_driven_block_pushes(tmp_path: Path) -> None:
    """A velocity that is given is not among the unknowns: it is in w."""
    rows = [" vlocy      1  0.0 0.05 30.0 0.3 1.0 0.0", *write.STILL[1:]]
    path = write.blocks(tmp_path, DRV_DOF=write.driven(1, *rows))
    for number, one in enumerate(recorded(path, 10)):
        assert one.problem.n == 12
        speed = 0.05 * np.cos(30 * (number + 1) * H + 0.3)
        # N points up to the candidate or down; tangents of contacts with the plate see it move
        of_plate = one.contacts.bodies.min(axis=1) == 0
        w = np.reshape(one.problem.w, (-1, 3))[of_plate, 1:]
        np.testing.assert_allclose(np.linalg.norm(w, axis=1), abs(speed), rtol=1e-6)


@pytest.mark.usefixtures("engine")
@pytest.mark.parametrize(
    ("row", "table"),
    [
        ("0.1 0.0 0.0 0.0 -2.0 0.0", ""),
        ("0.1 0.0 0.0 0.0 -0.5 -50.0", ""),
        ("0.1 0.0 0.0 0.0 3.0 0.0", ""),
        ("evolution  push.dat", "0.004 0.1\n0.008 0.2\n"),
    ],
)
def test_the_engine_drives_as_a_course_says(tmp_path: Path, row: str, table: str) -> None:
    """A ramp goes on below -1 and not above 1, and a table goes on beyond both of its ends."""
    rows = [f" vlocy      1  {row}", *write.STILL[1:]]
    path = write.blocks(tmp_path, DRV_DOF=write.driven(1, *rows))
    if table:
        (path / "push.dat").write_text(table)
    h, theta, steps = 1e-3, 0.5, 20
    source = _lmgc90.Source(path, steps=steps, time_step=h, theta=theta)
    states = [state for state, _ in _lmgc90.states_of(source, 1)]
    course = decks.read(path).driven[0].course
    speeds = np.array([course.at(i * h) for i in range(steps)])
    moved = np.diff([state.place[0, 0] for state in states])
    expected = h * ((1 - theta) * speeds[:-1] + theta * speeds[1:])
    np.testing.assert_allclose(moved, expected, atol=1e-12)


@pytest.mark.usefixtures("engine")
def test_both_ways_agree(tmp_path: Path) -> None:
    """A deck through the engine and through the stepper: the same M, f, contacts and frames."""
    pytest.importorskip("mujoco")
    from fclib.simulate import simulate

    path = write.blocks(tmp_path)
    theirs = recorded(path, 1)[0]
    scene = deck_scene.scene_of(decks.read(path), time_step=H, theta=0.5)
    ours = next(iter(simulate(scene, 1, tol=1e-10)))
    # axes of inertia are the engine's or ours: M is the same up to their order within a body
    for body in range(2):
        own, other = (
            np.sort(np.diag(dense(p.M))[6 * body + 3 : 6 * body + 6])
            for p in (theirs.problem, ours.problem)
        )
        np.testing.assert_allclose(own, other, rtol=1e-12)
        own, other = (
            np.diag(dense(p.M))[6 * body : 6 * body + 3] for p in (theirs.problem, ours.problem)
        )
        np.testing.assert_allclose(own, other, rtol=1e-12)
    np.testing.assert_allclose(theirs.problem.f, ours.problem.f, rtol=1e-12, atol=1e-12)
    # the same contacts: each point has one of the other side
    assert theirs.problem.nc == ours.problem.nc == 9
    found = ours.contacts
    used = set()
    for point, frame, gap in zip(
        theirs.contacts.point, theirs.contacts.frame, theirs.contacts.gap, strict=True
    ):
        near = np.linalg.norm(found.point - point, axis=1)
        k = int(near.argmin())
        used.add(k)
        # the engine cuts faces of each other on a grid; the alert distance is 1e-2
        assert near[k] < 1e-5
        assert abs(frame[0] @ found.frame[k, 0]) == pytest.approx(1, abs=1e-9)
        assert gap == pytest.approx(found.gap[k], abs=1e-6)
    assert len(used) == 9
    # and the same motion, up to the engine's gaps: of 1e-9 m, closed in a step
    v: Any = fclib.solve(theirs.problem, tol=1e-10).solution.v
    own = v.reshape(-1, 6)[:, :3]
    np.testing.assert_allclose(own, ours.velocity.reshape(-1, 6)[:, :3], atol=1e-6)


SCRIPT = """
import sys
from compas_lmgc90.solver import Solver

def cube(z, half):
    corners = [(x, y, z + h) for x in (-half, half) for y in (-half, half) for h in (-half, half)]
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    return {"vertices": corners, "faces": faces}

for law in sys.argv[1:]:
    solver = Solver(dt=1e-3, theta=0.5)
    solver.geometry_from_v_f([cube(-1.0, 1.0)], density=1000.0)
    solver.geometry_from_v_f([cube(0.5, 0.5)], density=3000.0)
    solver.set_supports(z_threshold=0.0)
    solver.contact_law(law, 0.6)
    solver.preprocess()
    solver.run(nb_steps=3)
"""


@pytest.mark.usefixtures("engine")
def test_a_script_is_recorded(tmp_path: Path) -> None:
    """Two simulations in a script; each begins at time 0."""
    script = tmp_path / "cubes.py"
    script.write_text(SCRIPT)
    out = tmp_path / "out"
    command = ["record", "lmgc90", str(script), "IQS_CLB", "IQS_CLB_g0", "--every", "2"]
    done = invoke(*command, "--out", out)
    assert "of 6 steps" in done.output
    files = sorted(out.glob("*.hdf5"))
    assert [file.stem for file in files] == [f"lmgc90-{k:06d}" for k in (0, 2, 4)]
    times = []
    for file in files:
        problem: Any = fclib.read(file)
        assert (problem.nc, problem.n) == (4, 6)
        np.testing.assert_allclose(np.diag(dense(problem.M))[:3], 3000)
        np.testing.assert_allclose(problem.mu, 0.6)
        assert len(fclib.read_guesses(file)) == 1
        times.append(json.loads(problem.info.description.splitlines()[-1])["time"])
    assert times == [0.0, 0.002, 0.001]


@pytest.mark.usefixtures("engine")
def test_an_engine_that_ends_keeps_its_steps(tmp_path: Path) -> None:
    """A law that the engine does not know ends its process; so does a script's own error."""
    script = tmp_path / "fails.py"
    script.write_text(SCRIPT + "\nraise SystemExit(3)\n")
    out = tmp_path / "out"
    done = invoke("record", "lmgc90", script, "IQS_CLB", "--out", out, code=1)
    assert "ended with status 3 after 3 steps" in " ".join(done.output.split())
    assert len(list(out.glob("*.hdf5"))) == 3
    script.write_text(SCRIPT)
    out = tmp_path / "no"
    done = invoke("record", "lmgc90", script, "NO_SUCH_LAW", "--out", out, code=1)
    assert "LMGC90's engine ended with status" in " ".join(done.output.split())
    assert not out.exists()


def test_an_engine_that_is_missing_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # a package of the same name that cannot be imported comes first
    (tmp_path / "compas_lmgc90.py").write_text("raise ImportError('no engine')\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    path = write.blocks(tmp_path)
    done = invoke("record", "lmgc90", path, "--out", tmp_path / "out", code=1)
    assert "to record LMGC90 it needs compas_lmgc90" in " ".join(done.output.split())
    assert "pip install 'fclib[recorders]'" in " ".join(done.output.split())
