"""Decks of LMGC90: what is read, what is refused, and what the stepper makes of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import fclib
import helpers_deck as write
from fclib.scenes.shared import deck as decks
from fclib.scenes.shared import deck_scene, polyhedron
from fclib.scenes.shared.interaction import Course, Drive, Interaction
from helpers_cli import invoke

PUBLISHED = Path(__file__).parents[3] / "shared" / "data" / "scenes" / "lmgc90"
G = 9.81


def scene_of(path: Path, **options: Any) -> Any:
    values: dict[str, Any] = {"time_step": 1e-3, "theta": 0.5}
    return deck_scene.scene_of(decks.read(path), **(values | options))


def steps_of(scene: Any, count: int, **options: Any) -> list[Any]:
    pytest.importorskip("mujoco")
    from fclib.simulate import simulate

    return list(simulate(scene, count, **({"tol": 1e-10} | options)))


# ---- what is read


def test_a_deck_is_read(tmp_path: Path) -> None:
    path = write.blocks(tmp_path, mu=0.4)
    deck = decks.read(tmp_path)
    assert decks.read(path).sha256 == deck.sha256
    assert len(deck.rigid) == 3
    assert not deck.unknown
    np.testing.assert_array_equal(deck.gravity, [0, 0, -G])
    assert deck.laws["iqsc0"].mu == 0.4
    assert deck.sees[0].alert == 1e-2
    assert len(deck.driven) == 6
    assert deck_scene.fixed(deck) == {0}
    third = deck.rigid[2]
    np.testing.assert_array_equal(third.centre, [0.1, 0.05, 0.7])
    np.testing.assert_array_equal(third.contactors[0].vertices, write.CORNERS * (0.3, 0.25, 0.3))
    assert deck.driven[0].place.path.name == "DRV_DOF.DAT"


def test_names_of_columns_and_comments_may_differ(tmp_path: Path) -> None:
    """As in decks of several ages: coor= for coo3=, ver1= 1, text before the first keyword."""
    path = write.blocks(tmp_path)
    text = (path / "BODIES.DAT").read_text()
    changed = "1! File BODIES\n any words\n! a comment\n" + text.replace("coo3=", "coor=")
    changed = changed.replace("nb_faces=", "nb_face=").replace("$$$$$$", "$$$$$$     \n\n! more")
    (path / "BODIES.DAT").write_text(changed)
    for one, other in zip(
        decks.read(path).rigid, decks.read(write.blocks(tmp_path / "b")).rigid, strict=True
    ):
        np.testing.assert_array_equal(one.centre, other.centre)
        np.testing.assert_array_equal(one.contactors[0].faces, other.contactors[0].faces)


def test_a_part_of_a_file_may_number_again(tmp_path: Path) -> None:
    """A plane that is added to a file of blocks, before or after it, has the number 1 too."""
    plane = write.body(1, (0, 0, -1), write.plate((5, 5, 0.5)))
    boxes = [write.body(k, (0, 0, 2.0 * k), write.block((1, 1, 1))) for k in (1, 2, 3)]
    for bodies in ([*boxes, plane], [plane, *boxes]):
        deck = decks.read(write.blocks(tmp_path, BODIES="\n".join(bodies), DRV_DOF=""))
        assert len(deck.rigid) == 4


def test_a_value_changes_as_lmgc90_says() -> None:
    wave = Course(constant=2.0, amplitude=3.0, omega=5.0, phase=0.5, ramp=0.25, ramp_rate=0.5)
    for time in (0.0, 0.7, 1.5, 4.0):
        expected = (2 + 3 * np.cos(5 * time + 0.5)) * min(1, 0.25 + 0.5 * time)
        assert wave.at(time) == pytest.approx(expected, abs=1e-14)
    table = Course(points=((1.0, 0.0), (2.0, 10.0), (4.0, -10.0)))
    assert [table.at(t) for t in (1, 1.5, 2, 3, 4)] == [0, 5, 10, 0, -10]
    # beyond its ends a table goes on, and below -1 a ramp, as in the engine (test_lmgc90.py)
    assert [table.at(t) for t in (0, 9)] == [-10, -60]
    assert Course(constant=1.0, ramp=-1.5, ramp_rate=-1.0).at(1.0) == -2.5
    assert Course(constant=1.0, ramp=0.0).is_zero
    assert not Course(constant=1.0, ramp=0.0, ramp_rate=1.0).is_zero


# ---- what is refused


def broken(name: str, old: str, new: str, count: int = 1) -> Any:
    """A change of a file of the deck of three blocks."""

    def change(path: Path) -> None:
        text = (path / name).read_text()
        assert old in text
        (path / name).write_text(text.replace(old, new, count))

    return change


def cut(name: str, line: int, characters: int) -> Any:
    """A line of a file that ends early, and all lines after it."""

    def change(path: Path) -> None:
        lines = (path / name).read_text().splitlines()
        lines[line] = lines[line][:characters]
        (path / name).write_text("\n".join(lines[: line + 1]))

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda path: (path / "BODIES.DAT").unlink(), "BODIES.DAT: is missing"),
        (lambda path: (path / "TACT_BEHAV.DAT").unlink(), "TACT_BEHAV.DAT: is missing"),
        (cut("BODIES.DAT", 10, 50), "BODIES.DAT:11: a vertex: 3 numbers are expected"),
        (cut("BODIES.DAT", 12, 99), "BODIES.DAT:10: the contactor ends before all its lines"),
        (cut("BODIES.DAT", 3, 99), "BODIES.DAT:2: $nodty is expected here"),
        (cut("BODIES.DAT", 20, 45), "BODIES.DAT:21: a face: ver1=, ver2= and ver3= are expected"),
        (
            cut("BODIES.DAT", 31, 99),
            "the file ends where the kind and number of a body is expected",
        ),
        (
            broken("BODIES.DAT", f"coo1={write.fortran(2.0)}", "coo1=NaN"),
            "coo1: 'NaN' is not finite",
        ),
        (broken("BODIES.DAT", f"coo1={write.fortran(2.0)}", "coo1=1.0x"), "'1.0x' is no number"),
        (
            broken("BODIES.DAT", "RBDY3      3", "RBDY3      2"),
            "the number 2 of a body is there twice",
        ),
        (
            broken("BODIES.DAT", "RBDY3      2", "RBDY3      1"),
            "the number 1 of a body is there twice",
        ),
        (broken("BODIES.DAT", "ver1=      1", "ver1=      9"), "a face has vertices 1 to 8"),
        (broken("BODIES.DAT", "STONE", "IRONx"), "the material 'IRONx' is not in BULK_BEHAV.DAT"),
        (broken("BODIES.DAT", "$tacty", "$other"), "$tacty is expected here"),
        (broken("BODIES.DAT", " POLYR", " POLYX"), "'POLYX' is no contactor"),
        (broken("BULK_BEHAV.DAT", "Umas=", "Mass="), "BULK_BEHAV.DAT:6: has no Umas="),
        (broken("BULK_BEHAV.DAT", "Umas=2", "Umas=-2"), "the density of 'STONE' must be > 0"),
        (broken("TACT_BEHAV.DAT", "fric=", "fri="), "TACT_BEHAV.DAT:2: has no fric="),
        (
            broken("TACT_BEHAV.DAT", "RBDY3  POLYR", "RBDY9  POLYR"),
            "TACT_BEHAV.DAT:5: the see table names bodies 'RBDY9'",
        ),
        (
            broken("TACT_BEHAV.DAT", "BLEUx  iqsc0", "BLEUx  iqsc9"),
            "names the law 'iqsc9', and there is none such",
        ),
        (
            broken("TACT_BEHAV.DAT", "RBDY3  POLYR", "RBDY3  POLYX"),
            "names 'POLYX', and there is no such contactor",
        ),
        (cut("TACT_BEHAV.DAT", 4, 50), "TACT_BEHAV.DAT:5: a see table has cdbdy"),
        (broken("DRV_DOF.DAT", "RBDY3      1", "RBDY3      7"), "there is no body RBDY3 7, only 3"),
        (
            broken("DRV_DOF.DAT", " vlocy      2", " vlocy      1"),
            "this vlocy is given twice, also in DRV_DOF.DAT:6",
        ),
        (
            broken("DRV_DOF.DAT", " vlocy      2", " vlocy      8"),
            "RBDY3 has no degree of freedom 8",
        ),
        (cut("DRV_DOF.DAT", 7, 60), "DRV_DOF.DAT:8: a driven value has six numbers"),
    ],
)
def test_a_bad_deck_is_refused(tmp_path: Path, change: Any, message: str) -> None:
    path = write.blocks(tmp_path)
    decks.read(path)
    change(path)
    with pytest.raises(decks.DeckError) as caught:
        decks.read(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    done = invoke("simulate", path, "--time-step", "1e-3", "--out", tmp_path / "out", code=1)
    assert "Traceback" not in done.output
    assert "".join(message.split()) in "".join(done.output.split())


def test_a_bad_evolution_is_refused(tmp_path: Path) -> None:
    path = write.blocks(tmp_path, DRV_DOF=write.driven(2, " force      1 evolution push.dat"))
    with pytest.raises(decks.DeckError, match=r"DRV_DOF.DAT:6: the file push.dat is missing"):
        decks.read(path)
    (path / "push.dat").write_text("0. 1.\n1. 2.\n1. 3.\n")
    with pytest.raises(decks.DeckError, match=r"push.dat:3: the times must increase"):
        decks.read(path)
    (path / "push.dat").write_text("0. 1.\n1.\n")
    with pytest.raises(decks.DeckError, match=r"push.dat:2: a time and a value"):
        decks.read(path)
    (path / "push.dat").write_text("0. 1.\n")
    with pytest.raises(decks.DeckError, match=r"push.dat:1: an evolution has two times"):
        decks.read(path)
    (path / "push.dat").write_text("0. 1.\n0.5D+01 2.D0\n")
    assert decks.read(path).driven[0].course.at(2.5) == 1.5


def test_a_ramp_that_falls_below_its_bound_is_named(tmp_path: Path) -> None:
    def unknown(row: str) -> tuple[str, ...]:
        path = write.blocks(tmp_path, DRV_DOF=write.driven(2, f" force      1  {row}"))
        return decks.read(path).unknown

    assert not unknown("1.0 0.0 0.0 0.0 -1.0 2.0")
    assert not unknown("0.0 0.0 0.0 0.0 0.0 -2.0")
    for row in ("1.0 0.0 0.0 0.0 -1.5 2.0", "0.0 1.0 0.0 0.0 1.0 -2.0"):
        (word,) = unknown(row)
        assert "DRV_DOF.DAT:6: below -1 the ramp" in word


def test_a_bad_start_is_refused(tmp_path: Path) -> None:
    turn = np.array([(0, -1, 0), (1, 0, 0), (0, 0, 1)])
    good = write.start(2, (1, 2, 3), np.arange(6.0), turn)
    deck = decks.read(write.blocks(tmp_path, DOF=good))
    start = deck.starts["RBDY3", 1, 0]
    np.testing.assert_array_equal(start.displacement[:3], [1, 2, 3])
    np.testing.assert_array_equal(start.velocity, np.arange(6))
    np.testing.assert_array_equal(start.frame, turn)
    for bad, message in (
        (good.replace("b(2)=", "b(9)="), r"DOF.INI:\d+: .*b\(2\)= is missing"),
        (good.replace("V(4)=", "V(4)=nan "), r"V\(4\): 'nan' is not finite"),
        (good + "\n" + good, "RBDY3 2, node 1 is there twice"),
        (write.start(2, (0, 0, 0), np.zeros(6), 2 * turn), "not at right angles and of length 1"),
        (write.start(5, (0, 0, 0), np.zeros(6)), "there is no body RBDY3 5"),
    ):
        with pytest.raises(decks.DeckError, match=message):
            decks.read(write.blocks(tmp_path, DOF=bad))


def test_what_is_not_known_is_named(tmp_path: Path) -> None:
    cylinder = " CYLND      1  color  BLEUx  hlen= 0.1D+01  byrd= 0.1D+00"
    bodies = [
        write.body(1, (0, 0, -0.25), write.block((2, 2, 0.25))),
        write.body(2, (0, 0, 0.2), write.block((0.5, 0.3, 0.2)), cylinder),
    ]
    tact = "\n".join(
        [
            write.law("iqsc0"),
            "$behav  lawty\n wet01  IQS_WET_DS_CLB    cohn= 0.1D+09",
            write.see(),
            write.see(second="RBDY3  PLANx  VERTx"),
            write.see(second="RBDY3  CYLND  BLEUx"),
            write.see(first="RBDY3  POLYR  REDxx", law="wet01"),
        ]
    )
    path = write.blocks(
        tmp_path,
        BODIES="\n".join(bodies),
        TACT_BEHAV=tact,
        DRV_DOF=write.driven(1, *write.STILL, " temp_      1  0. 0. 0. 0. 1. 0."),
    )
    unknown = decks.read(path).unknown
    for word in (
        "BODIES.DAT:62: contactors CYLND are not known",
        "DRV_DOF.DAT:12: 'temp_' is not known",
        "TACT_BEHAV.DAT:10: nothing is PLANx VERTx",
        "TACT_BEHAV.DAT:13: nothing is CYLND BLEUx",
        "TACT_BEHAV.DAT:4: the law IQS_WET_DS_CLB is not known",
    ):
        assert any(line.startswith(word) for line in unknown), (word, unknown)
    pytest.importorskip("mujoco")
    arguments = ["simulate", str(path), "--time-step", "1e-3", "--steps", "1", "--no-pictures"]
    done = invoke(*arguments, "--out", tmp_path / "out")
    assert "Left out: BODIES.DAT:62" in " ".join(done.output.split())
    file = next((tmp_path / "out").rglob("*global.hdf5"))
    said = json.loads(fclib.read(file).info.description.splitlines()[-1])
    assert set(unknown) <= set(said["left_out"])
    assert said["parameters"]["sha256"]["BODIES.DAT"]
    refused = invoke(*arguments, "--strict", "--out", tmp_path / "no", code=1)
    assert "not supported" in refused.output


def test_a_periodic_deck_on_the_command_line(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    bodies = [
        write.body(1, (0, 0, -0.5), write.plate((20, 20, 0.5))),
        write.body(1, (4.6, 0, 0.5), write.ball(0.5)),
        write.body(2, (-4.6, 0, 0.5), write.ball(0.5)),
    ]
    ball, plate = "RBDY3  SPHER  BLEUx", "RBDY3  PLANx  VERTx"
    path = write.blocks(
        tmp_path,
        BODIES="\n".join(bodies),
        TACT_BEHAV="\n".join((write.law("iqsc0"), write.see(ball, plate), write.see(ball, ball))),
        DRV_DOF=write.driven(1, *write.STILL),
    )
    arguments = ["simulate", str(path), "--time-step", "1e-3", "--steps", "2", "--no-pictures"]
    for period, contacts in (([], 2), (["--period", "10.2", "10.2"], 3)):
        out = tmp_path / f"out{contacts}"
        invoke(*arguments, *period, "--out", out)
        problem: Any = fclib.read(next(out.rglob("*-global.hdf5")))
        assert problem.nc == contacts
        said = json.loads(problem.info.description.splitlines()[-1])
        assert (said["theta"], said["time_step"], said["laws"]) == (0.5, 1e-3, ["IQS_CLB"])


def test_options_that_are_not_for_decks(tmp_path: Path) -> None:
    path = write.blocks(tmp_path)
    for more, message in (
        ([], "a deck does not say its step"),
        (["--time-step", "1e-3", "--ground", "0.5"], "--ground is not for decks"),
        (["--time-step", "1e-3", "--law", "gap"], "--law is not for decks"),
    ):
        done = invoke("simulate", path, *more, code=2)
        assert message in " ".join(done.output.replace("│", "").split())
    (tmp_path / "empty").mkdir()
    done = invoke("simulate", tmp_path / "empty", "--time-step", "1e-3", code=1)
    assert "is no deck of LMGC90" in " ".join(done.output.split())


# ---- masses


def turned(angle: float, axis: int = 2) -> Any:
    c, s = np.cos(angle), np.sin(angle)
    full = np.eye(3)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    full[i, i], full[i, j], full[j, i], full[j, j] = c, -s, s, c
    return full


def test_moments_of_polyhedra() -> None:
    """Of a box, moved and turned, whichever way its triangles look."""
    half = np.array([0.5, 0.3, 0.2])
    turn = turned(0.4) @ turned(1.1, 0)
    corners = (write.CORNERS * half) @ turn.T + (3, -1, 2)
    exact = polyhedron.box(half)
    rng = np.random.default_rng(0)
    for _ in range(5):
        faces = np.array([f[::-1] if rng.random() < 0.5 else f for f in write.FACES])
        got = polyhedron.moments(corners, polyhedron.oriented(corners, faces))
        assert got.volume == pytest.approx(exact.volume, rel=1e-13)
        np.testing.assert_allclose(got.centre, (3, -1, 2), atol=1e-13)
        np.testing.assert_allclose(got.inertia, turn @ exact.inertia @ turn.T, atol=1e-14)
        moments, axes = got.principal()
        np.testing.assert_allclose(axes @ np.diag(moments) @ axes.T, got.inertia, atol=1e-14)
        assert np.linalg.det(axes) == pytest.approx(1)
    with pytest.raises(ValueError, match="do not close"):
        polyhedron.oriented(corners, np.array(write.FACES[:-1]))


def test_a_polyhedron_with_a_dent_has_its_own_mass(tmp_path: Path) -> None:
    """A box whose top has a pit: its triangles tell its mass, its hull collides, which is named."""
    vertices = np.vstack((write.CORNERS, (0.0, 0.0, 0.0)))
    # the two triangles of the top, z = 1, become four that go down to the middle
    faces = [*write.FACES[:10], (1, 5, 8), (5, 7, 8), (7, 3, 8), (3, 1, 8)]
    path = write.blocks(
        tmp_path, BODIES=write.body(1, (0, 0, 1), write.polyhedron(vertices, faces)), DRV_DOF=""
    )
    scene = scene_of(path)
    assert "the POLYR is not convex" in scene.left_out[0]
    assert scene.left_out[0].startswith("BODIES.DAT:10")
    assert deck_scene.placed(decks.read(path), 0).mass == pytest.approx(2000 * (8 - 4 / 3))


def test_masses_that_the_deck_gives(tmp_path: Path) -> None:
    """Avrd and I1, I2, I3, or gyrd, stand for what the contactors would give."""
    given = f"avrd={write.fortran(0.4)}\n{write.PAD}{write.row(('I1', 'I2', 'I3'), (1, 2, 2.5))}"
    gyration = f"avrd={write.fortran(0.4)}  gyrd={write.fortran(0.3)}"
    bodies = [
        write.body(1, (0, 0, 0), write.ball(0.5), bulk=given),
        write.body(2, (0, 0, 2), write.ball(0.5), bulk=gyration),
        write.body(3, (0, 0, 4), write.ball(0.5), bulk="avrd= 0.0000000D+00"),
    ]
    deck = decks.read(write.blocks(tmp_path, BODIES="\n".join(bodies), DRV_DOF=""))
    one, two, three = (deck_scene.placed(deck, i) for i in range(3))
    mass = 2000 * 4 / 3 * np.pi * 0.4**3
    assert (one.mass, two.mass) == pytest.approx((mass, mass))
    np.testing.assert_allclose(one.moments, [2000, 4000, 5000])
    np.testing.assert_allclose(two.moments, mass * 0.09)
    ball = 2000 * 4 / 3 * np.pi * 0.125
    assert three.mass == pytest.approx(ball)
    np.testing.assert_allclose(three.moments, 0.4 * ball * 0.25)


def test_plates_of_a_body_keep_their_own_axes(tmp_path: Path) -> None:
    """A body of several contactors has principal axes that are not those of BODIES.DAT."""
    mujoco = pytest.importorskip("mujoco")
    from fclib.simulate import MujocoModel

    corners = write.CORNERS * 0.2 + (0.5, 0.4, 0.1)
    half = (0.6, 0.1, 0.2)
    body = write.body(2, (0, 0, 3), write.plate(half), write.polyhedron(corners))
    held = write.body(1, (9, 0, 0), write.plate(half), write.polyhedron(corners))
    sees = [write.law("iqsc0"), write.see("RBDY3  PLANx  VERTx", "RBDY3  POLYR  BLEUx")]
    path = write.blocks(tmp_path, BODIES=f"{held}\n{body}", TACT_BEHAV="\n".join(sees))
    deck = decks.read(path)
    one = deck_scene.placed(deck, 1)
    # they are turned indeed
    assert np.abs(one.axes).max(axis=0).min() < 0.95
    model = MujocoModel(deck_scene.scene_of(deck, time_step=1e-3))
    m, d = model.model, model.data
    mujoco.mj_kinematics(m, d)
    boxes = np.flatnonzero(m.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
    assert len(boxes) == 2
    for box, centre in zip(boxes, ((9, 0, 0), (0, 0, 3)), strict=True):
        np.testing.assert_allclose(d.geom_xpos[box], centre, atol=1e-12)
        np.testing.assert_allclose(d.geom_xmat[box].reshape(3, 3), np.eye(3), atol=1e-9)
    # axes of a start would be those that LMGC90 finds, in its own order
    start = write.start(2, (0, 0, 0), np.zeros(6))
    path = write.blocks(tmp_path, BODIES=f"{held}\n{body}", TACT_BEHAV="\n".join(sees), DOF=start)
    with pytest.raises(decks.DeckError, match=r"DOF.INI:4: a, b, c are the axes of inertia"):
        deck_scene.placed(decks.read(path), 1)


def test_plates_have_frames_of_their_own(tmp_path: Path) -> None:
    """As LMGC90 writes a PLANx: its axes and its place in the body."""
    rng = np.random.default_rng(3)
    turn, frame = np.linalg.qr(rng.normal(size=(2, 3, 3)))[0]
    turn, frame = (q * np.sign(np.linalg.det(q)) for q in (turn, frame))
    half, shift = np.array((0.6, 0.1, 0.2)), np.array((0.3, -0.2, 0.5))
    plate = write.plate(half, turn=turn, shift=shift)
    box = write.polyhedron(write.CORNERS * 0.2 + (0.5, 0.4, 0.1))
    bodies = "\n".join(write.body(k, (0, 0, k), plate) for k in (1, 2))
    bodies += "\n" + write.body(3, (0, 0, 3), plate, box)
    sees = [write.law("iqsc0"), write.see("RBDY3  PLANx  VERTx", "RBDY3  POLYR  BLEUx")]
    start = write.start(2, (0, 1, 0), np.zeros(6), frame)
    files: dict[str, Any] = {
        "BODIES": bodies,
        "TACT_BEHAV": "\n".join(sees),
        "DRV_DOF": "",
        "DOF": start,
    }
    deck = decks.read(write.blocks(tmp_path, **files))
    assert not deck.unknown
    one, two, three = (deck_scene.placed(deck, i) for i in range(3))
    density = 2000.0
    moments = density * 8 * half.prod() / 3 * (half @ half - half**2)
    for body in (one, two):
        np.testing.assert_allclose(body.moments, moments)
        np.testing.assert_allclose(body.shapes[0][2], 0, atol=1e-12)
    np.testing.assert_allclose(one.axes, turn)
    np.testing.assert_allclose(one.centre, np.add((0, 0, 1), shift))
    # the axes of a start stand for those of the plate, and its centre is not turned
    np.testing.assert_allclose(two.axes, frame)
    np.testing.assert_allclose(two.centre, np.add((0, 1, 2), shift))
    np.testing.assert_allclose(two.axes @ two.turn @ turn, frame, atol=1e-12)
    # the inertia of two shapes, by points of the plate and of the cube about their centre
    corners = np.linspace(-1, 1, 41)[:-1] + 1 / 40
    grid = np.stack(np.meshgrid(*[corners] * 3), axis=-1).reshape(-1, 3)
    points = np.vstack((grid * half @ turn.T + shift, grid * 0.2 + (0.5, 0.4, 0.1)))
    mass = density * np.repeat((8 * half.prod(), 8 * 0.2**3), len(grid)) / len(grid)
    centre = mass @ points / mass.sum()
    np.testing.assert_allclose(three.centre, np.add((0, 0, 3), centre), atol=1e-9)
    arm = (points - centre) @ three.axes
    second = np.einsum("i,ij,ik->jk", mass, arm, arm)
    inertia = np.trace(second) * np.eye(3) - second
    np.testing.assert_allclose(inertia, np.diag(three.moments), atol=1e-3 * inertia.max())
    np.testing.assert_allclose(three.axes @ three.turn @ turn, turn, atol=1e-12)
    np.testing.assert_allclose(
        three.centre + three.axes @ three.shapes[0][2], np.add((0, 0, 3), shift)
    )
    wrong = {**files, "BODIES": bodies.replace("localframe", "localfr")}
    with pytest.raises(decks.DeckError, match="'localfr' is no contactor"):
        decks.read(write.blocks(tmp_path, **wrong))
    skew = write.body(1, (0, 0, 1), write.plate(half, turn=2 * turn))
    with pytest.raises(decks.DeckError, match=r"BODIES.DAT:11: the axes of the PLANx are not"):
        decks.read(write.blocks(tmp_path, **{**files, "BODIES": skew}))


# ---- rigid bodies that move


def test_a_block_rides_on_a_driven_plate(tmp_path: Path) -> None:
    """It sticks to a plate that shakes and sinks; its velocity is the plate's at each end."""
    rows = [
        " vlocy      1  0.0 0.05 30.0 0.3 1.0 0.0",
        " vlocy      2  0.0 0.0 0.0 0.0 1.0 0.0",
        " vlocy      3  -0.02 0.0 0.0 0.0 0.0 20.0",
        *write.STILL[3:],
    ]
    bodies = [
        write.body(1, (0, 0, -0.5), write.plate((5, 5, 0.5))),
        write.body(1, (0, 0, 0.5), write.block((0.5, 0.5, 0.5))),
        write.body(2, (3, 0, 0.5), write.block((0.5, 0.5, 0.5))),
    ]
    path = write.blocks(
        tmp_path,
        BODIES="\n".join(bodies),
        TACT_BEHAV=write.law("iqsc0", mu=0.9)
        + "\n"
        + write.see(second="RBDY3  PLANx  VERTx", alert=0.1),
        DRV_DOF=write.driven(1, *rows),
        DOF=write.start(2, (0, 0, 0), (0.05 * np.cos(0.3), 0, 0, 0, 0, 0)),
    )
    scene = scene_of(path)
    for step in steps_of(scene, 60):
        end = (step.index + 1) * 1e-3
        plate = [0.05 * np.cos(30 * end + 0.3), 0, -0.02 * min(1, 20 * end)]
        assert step.problem.n == 12
        assert step.problem.nc == 8
        np.testing.assert_allclose(step.velocity[:3], plate, atol=1e-12)
        if step.index:
            np.testing.assert_allclose(step.velocity[6:9], plate, atol=1e-7)
    assert step.position[-1] == pytest.approx(59e-3)


def test_forces_and_spins_that_are_given(tmp_path: Path) -> None:
    """Free flight: the theta mean of a force that grows, a velocity of one axis that is given."""
    rows = [
        " force      1 evolution push.dat",
        " force      3  100. 50. 20. 0.2 1. 0.",
        " vlocy      6  0. 2. 40. 0. 1. 0.",
    ]
    bodies = [write.body(k, (0, 0, 5 * k), write.block((0.3, 0.25, 0.3))) for k in (1, 2, 3)]
    path = write.blocks(
        tmp_path,
        BODIES="\n".join(bodies),
        DRV_DOF=write.driven(3, *rows) + "\n" + write.driven(1, *write.STILL),
    )
    (path / "push.dat").write_text("0. 0.\n0.01 500.\n1. 500.\n")
    scene = scene_of(path, theta=0.6)
    mass = 2000 * 8 * 0.3 * 0.25 * 0.3
    velocity = np.zeros(3)
    table = Course(points=((0.0, 0.0), (0.01, 500.0), (1.0, 500.0)))
    for step in steps_of(scene, 20):
        start, end = step.index * 1e-3, (step.index + 1) * 1e-3
        wave = [100 + 50 * np.cos(20 * t + 0.2) for t in (start, end)]
        velocity[0] += 1e-3 / mass * (0.4 * table.at(start) + 0.6 * table.at(end))
        velocity[2] += 1e-3 * ((0.4 * wave[0] + 0.6 * wave[1]) / mass - G)
        np.testing.assert_allclose(step.velocity[6:9], velocity, atol=1e-12)
        assert step.velocity[11] == pytest.approx(2 * np.cos(40 * end), abs=1e-12)
        assert step.problem.nc == 0


@pytest.mark.parametrize("theta", [0.5, 1.0])
@pytest.mark.parametrize(
    ("law", "gap", "speed"),
    [
        ("IQS_CLB", -1e-3, 0.0),  # a penetration stays
        ("GAP_SGR_CLB", -1e-3, 1.0),  # it is undone within the step
        ("VEL_SGR_CLB", -1e-3, 0.0),
        ("IQS_CLB", 1e-3, -1.0),  # a gap is closed, and no more
        ("GAP_SGR_CLB", 1e-3, -1.0),
        ("VEL_SGR_CLB", 1e-3, None),  # nothing happens
    ],
)
def test_each_law(tmp_path: Path, law: str, gap: float, speed: float | None, theta: float) -> None:
    """A ball near a plate, fast enough downwards that it touches in the step of 1e-3 s."""
    bodies = [
        write.body(1, (0, 0, -0.5), write.plate((5, 5, 0.5))),
        write.body(1, (0, 0, 0.5 + gap), write.ball(0.5)),
        write.body(2, (3, 0, 9), write.ball(0.5)),
    ]
    path = write.blocks(
        tmp_path,
        BODIES="\n".join(bodies),
        TACT_BEHAV=write.law("iqsc0", law)
        + "\n"
        + write.see("RBDY3  SPHER  BLEUx", "RBDY3  PLANx  VERTx", alert=0.1),
        DRV_DOF=write.driven(1, *write.STILL),
        DOF=write.start(2, (0, 0, 0), (0, 0, -1.5, 0, 0, 0)),
    )
    (step,) = steps_of(scene_of(path, theta=theta), 1)
    # the gap in the middle of the step
    middle = gap - (1 - theta) * 1e-3 * 1.5
    if law == "VEL_SGR_CLB" and middle > 0:
        assert step.problem.nc == 0
        assert step.velocity[2] == pytest.approx(-1.5 - 1e-3 * G, abs=1e-12)
        return
    assert step.problem.nc == 1
    if theta == 1.0:
        assert speed is not None
        assert step.velocity[2] == pytest.approx(speed, abs=1e-9)
    elif law == "GAP_SGR_CLB":
        assert step.velocity[2] == pytest.approx(-middle / 1e-3, abs=1e-9)
    else:
        assert step.velocity[2] == pytest.approx(-max(middle, 0) / 1e-3, abs=1e-9)


def test_contacts_are_those_within_the_alert_distance(tmp_path: Path) -> None:
    """Of balls over a plate at growing heights, by kinds that see it up to different distances."""
    heights = np.array([-0.001, 0.0, 0.004, 0.009, 0.011, 0.03, 0.06])
    bodies = [write.body(1, (0, 0, -0.5), write.plate((50, 50, 0.5)))]
    for i, z in enumerate(heights):
        colours = ("BLEUx", "REDxx")
        bodies += [
            write.body(1 + 2 * i + k, (2 * i, 2 * k, 0.5 + z), write.ball(0.5, colour))
            for k, colour in enumerate(colours)
        ]
    tact = [write.law("iqsc0", mu=0.3), write.law("iqsc1", mu=0.7)]
    tact += [
        write.see("RBDY3  SPHER  BLEUx", "RBDY3  PLANx  VERTx", alert=0.01),
        write.see("RBDY3  PLANx  VERTx", "RBDY3  SPHER  REDxx", law="iqsc1", alert=0.05),
    ]
    path = write.blocks(
        tmp_path,
        BODIES="\n".join(bodies),
        TACT_BEHAV="\n".join(tact),
        DRV_DOF=write.driven(1, *write.STILL),
    )
    (step,) = steps_of(scene_of(path), 1)
    by_friction = {mu: step.contacts.gap[step.contacts.mu == mu] for mu in (0.3, 0.7)}
    np.testing.assert_allclose(np.sort(by_friction[0.3]), heights[heights <= 0.01], atol=1e-12)
    np.testing.assert_allclose(np.sort(by_friction[0.7]), heights[heights <= 0.05], atol=1e-12)
    np.testing.assert_allclose(
        np.reshape(step.problem.w, (-1, 3))[:, 0], np.maximum(step.contacts.gap, 0) / 1e-3
    )


def test_a_folder_that_is_no_deck_is_told_at_once(tmp_path: Path) -> None:
    done = invoke("simulate", tmp_path, code=1)
    assert "is no deck of LMGC90" in done.output
    assert "--time-step" not in done.output
    write.blocks(tmp_path)
    done = invoke("simulate", tmp_path, code=2)
    assert "a deck does not say its step: --time-step" in done.output


def test_a_periodic_deck_with_a_floor_that_moves(tmp_path: Path) -> None:
    """Two balls that meet across the boundary, on a plate that sinks: the cell moves as a whole."""
    bodies = [
        write.body(1, (0, 0, -0.5), write.plate((20, 20, 0.5))),
        write.body(1, (4.6, 0, 0.5), write.ball(0.5)),
        write.body(2, (-4.6, 0, 0.5), write.ball(0.5)),
    ]
    tact = [write.law("iqsc0", mu=0.0)]
    tact += [
        write.see("RBDY3  SPHER  BLEUx", "RBDY3  PLANx  VERTx", alert=0.1),
        write.see("RBDY3  SPHER  BLEUx", "RBDY3  SPHER  BLEUx", alert=0.1),
    ]
    rows = [*write.STILL[:2], " vlocy      3  -0.5 0. 0. 0. 1. 0.", *write.STILL[3:]]
    path = write.blocks(
        tmp_path,
        BODIES="\n".join(bodies),
        TACT_BEHAV="\n".join(tact),
        DRV_DOF=write.driven(1, *rows),
        DOF=write.start(2, (0, 0, 0), (3.0, 0, 0, 0, 0, 0)),
    )
    # apart by 10.2 - 9.2 - 1 = 0 across the boundary
    scene = scene_of(path, period=(10.2, 10.2))
    (step,) = steps_of(scene, 1)
    pairs = {tuple(sorted(pair)) for pair in step.contacts.pair.tolist()}
    assert len(pairs) == 3
    # the first ball passes half of its speed on: equal masses, inelastic
    np.testing.assert_allclose(step.velocity[[0, 6]], 1.5, atol=1e-8)
    # driven bodies come last
    np.testing.assert_allclose(step.velocity[12:15], [0, 0, -0.5])


def test_a_penetration_stays_in_a_stored_state(tmp_path: Path) -> None:
    """The law of the deck says what becomes of it: no body is moved before."""
    pytest.importorskip("mujoco")
    from fclib.simulate import MujocoModel, relaxed, scheme_of

    model = MujocoModel(scene_of(write.blocks(tmp_path, gap=-0.05)))
    position = model.position
    moved = relaxed(model, scheme_of(model), position, model.velocity, 0.01)
    np.testing.assert_array_equal(moved, position)


def test_a_deck_is_stored_and_read_back(tmp_path: Path) -> None:
    from fclib.collections import trajectory

    for path in (write.blocks(tmp_path / "a"), write.cubes(tmp_path / "b")):
        scene = scene_of(path)
        again = trajectory.scene_of(json.loads(json.dumps(trajectory.record(scene))))
        assert again == scene
        assert isinstance(again.interactions[0], Interaction)
        assert all(isinstance(drive, Drive) for drive in again.drives)


# ---- meshes


def test_matrices_of_hexahedra_are_those_of_scikit_fem() -> None:
    """Of a twisted mesh, up to the order of its nodes."""
    skfem = pytest.importorskip("skfem")
    pytest.importorskip("mujoco")
    import importlib

    from fclib.simulate import hexahedra

    elasticity = importlib.import_module("skfem.models.elasticity")
    mesh = skfem.MeshHex.init_tensor(*[np.linspace(0, 1, 3)] * 3)
    rng = np.random.default_rng(1)
    nodes = mesh.p.T + 0.05 * rng.uniform(-1, 1, mesh.p.T.shape)
    mesh = skfem.MeshHex(nodes.T, mesh.t)
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementHex1()), intorder=3)
    lame = elasticity.lame_parameters(1e6, 0.3)
    K = elasticity.linear_elasticity(*lame).assemble(basis)
    M = skfem.BilinearForm(lambda u, v, _: 1e3 * (u * v).sum(axis=0)).assemble(basis)
    # each element's ring order, from the unit cube that scikit-fem maps to it
    reference = skfem.ElementHex1.doflocs
    order = [
        int(np.flatnonzero((reference == 0.5 * (1 + c)).all(axis=1))[0]) for c in hexahedra.CORNERS
    ]
    elements = mesh.t[order].T.astype(np.int64)
    corner = nodes[elements[0]]
    if np.linalg.det(corner[[1, 3, 4]] - corner[0]) < 0:
        # scikit-fem's own numbers may be those of the mirror image
        elements = np.roll(elements, 4, axis=1)
    mine_M, mine_K = hexahedra.matrices(nodes, elements, 1e6, 0.3, 1e3, lumped=False)
    np.testing.assert_allclose(mine_M.toarray(), M.toarray(), atol=1e-9 * abs(M).max())
    np.testing.assert_allclose(mine_K.toarray(), K.toarray(), atol=1e-9 * abs(K).max())
    lumped, _ = hexahedra.matrices(nodes, elements, 1e6, 0.3, 1e3, lumped=True)
    assert lumped.nnz == lumped.shape[0]
    np.testing.assert_allclose(lumped.diagonal(), np.asarray(M.sum(axis=1)).ravel())


def test_two_elastic_cubes_at_rest(tmp_path: Path) -> None:
    """The lower one is clamped; the contacts carry the weight of the upper one in the mean."""
    scene = scene_of(write.cubes(tmp_path), time_step=0.1, theta=1.0)
    assert not scene.left_out
    *_, last = steps_of(scene, 20)
    # 27 nodes each, nine of them held
    assert last.problem.n == 6 * 27 - 27
    assert last.problem.nc == 9
    M = sp.csc_array(last.model.M)
    np.testing.assert_allclose(M.diagonal().sum() / 3, 2 * 2750)
    assert M.nnz == M.shape[0]
    normal = np.reshape(last.result.solution.r, (-1, 3))[:, 0].sum()
    assert normal == pytest.approx(0.1 * 2750 * G, rel=1e-6)
    held = np.unique([drive.dof for drive in scene.drives])
    assert not last.velocity[held].any()
    assert last.contacts.mu == pytest.approx(0.3)


def test_a_mesh_may_begin_displaced_and_in_motion(tmp_path: Path) -> None:
    """DOF.INI of nodes: the upper cube begins higher, and falls until it touches."""
    lines = ["$bdyty", " MAILx      2", "$model", " MECAx", "$nodty"]
    for node in range(1, 28):
        lines.append(f" NO3xx  {node:5d}   X(1)= 0.0  X(2)= 0.0  X(3)= 0.002")
        lines.append("                V(1)= 0.1  V(2)= 0.0  V(3)= -0.5")
    path = write.cubes(tmp_path, DOF="\n".join([*lines, "$$$$$$"]))
    scene = scene_of(path, time_step=1e-3, theta=1.0)
    steps = steps_of(scene, 5)
    np.testing.assert_allclose(steps[0].contacts.gap, 0.002, atol=1e-12)
    velocity = steps[0].velocity.reshape(-1, 3)[27:]
    np.testing.assert_allclose(velocity, [[0.1, 0, -0.5 - 1e-3 * G]] * 27, atol=1e-12)
    assert steps[-1].contacts.gap.min() < 1e-6


def test_a_mesh_that_is_pulled_moves_as_it_is_told(tmp_path: Path) -> None:
    """All nodes of the top are driven: between them and the foot the strain is uniform at rest."""
    k = 3
    foot = [write.driven(1, *write.STILL[:3], kind="MAILx", node=i + 1) for i in range(k * k)]
    top = [
        write.driven(
            1,
            *write.STILL[:2],
            " vlocy      3  1e-5 0. 0. 0. 1. 0.",
            kind="MAILx",
            node=2 * k * k + i + 1,
        )
        for i in range(k * k)
    ]
    path = write.cubes(
        tmp_path,
        BODIES=write.hexahedra(1, 2, (0, 0, 0), ["ASpx4"]),
        DRV_DOF="\n".join(foot + top),
        BULK_BEHAV=write.bulk(gravity=0.0, more=write.ELASTIC.replace("Epss= 2.0", "Epss= 0.0")),
    )
    scene = scene_of(path, time_step=0.1, theta=1.0)
    *_, last = steps_of(scene, 10)
    middle = last.velocity.reshape(-1, 3)[k * k : 2 * k * k]
    np.testing.assert_allclose(middle, np.tile((0, 0, 0.5e-5), (k * k, 1)), atol=1e-11)


def test_bad_meshes_are_refused(tmp_path: Path) -> None:
    for change, message in (
        (broken("BODIES.DAT", "nodes      1      2", "nodes      2      1"), "turned inside out"),
        (broken("BODIES.DAT", "NO3xx      2", "NO3xx      7"), "the number of this node must be 2"),
        (broken("BODIES.DAT", "nodes      1", "nodes     99"), "an element has nodes 1 to 27"),
        (broken("BODIES.DAT", "M3DH8", "OTHER", 99), "the model 'OTHER' is not in MODELS.DAT"),
        (broken("BODIES.DAT", "noda=", "nods="), None),
        (broken("BULK_BEHAV.DAT", "EYng=", "EYug="), "has no EYng="),
    ):
        path = write.cubes(tmp_path)
        change(path)
        if message is None:
            decks.read(path)
            continue
        with pytest.raises(ValueError, match=message):
            steps_of(scene_of(path), 1)


def test_elements_that_are_not_known_leave_their_mesh_out(tmp_path: Path) -> None:
    path = write.cubes(tmp_path)
    text = (path / "BODIES.DAT").read_text()
    first, second = text.split("$bdyty")[1:]
    (path / "BODIES.DAT").write_text("$bdyty" + first + "$bdyty" + second.replace("H8xxx", "TE4xx"))
    deck = decks.read(path)
    assert len(deck.meshes) == 1
    assert any("elements TE4xx are not known" in line for line in deck.unknown)


# ---- the authors' decks


@pytest.mark.parametrize(
    ("name", "rigid", "meshes"),
    [
        ("Bridge_PR", 23, 0),
        ("Aqueduc_PR", 322, 0),
        ("945_SP_Box_PL", 950, 0),
        ("100_PR_PerioBox", 101, 0),
        ("simple_cube", 10, 0),
        ("cubes_H8_2", 0, 2),
        ("cubes_H8_5", 0, 2),
    ],
)
def test_the_authors_decks_are_known(name: str, rigid: int, meshes: int) -> None:
    if not (PUBLISHED / name).is_dir():
        pytest.skip("the authors' decks are not here")
    deck = decks.read(PUBLISHED / name)
    assert (len(deck.rigid), len(deck.meshes)) == (rigid, meshes)
    assert not deck.unknown
    assert not scene_of(PUBLISHED / name, period=(25.0, 25.0) if "Perio" in name else None).left_out
