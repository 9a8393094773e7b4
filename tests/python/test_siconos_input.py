"""Siconos' old input files: bodies, shapes and velocities of input.dat, ref.txt and .vtp."""

from __future__ import annotations

import base64
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fclib._geometry import rotations
from fclib.scenes import Scene
from fclib.scenes.shared import siconos_input

pytest.importorskip("mujoco")

from fclib.simulate import model_of, simulate
from helpers_cli import invoke

GROUND = "0 -1 0  0 0 -0.5  1 0 0 0  0 0 0 0 0 0"
REFERENCE = "Box 40 40 1\nshapes/plank.vtp\nSphere .5\nCapsule 0.4 1.2\nCylinder 0.3 0.8\n"
HALF = np.array([1.5, 0.5, 0.25])
CORNERS = HALF * [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]


def vtp(points: Any, kind: str) -> str:
    """A file of points, as VTK writes them."""
    values = np.asarray(points, "<f8" if kind == "binary" else "<f4")
    raw, name = values.tobytes(), "Float64" if kind == "binary" else "Float32"
    compressor, body, appended = "", "", ""
    place = f'format="{kind}"'
    if kind == "ascii":
        body = " ".join(map(repr, values.astype(float).ravel().tolist()))
    elif kind == "binary":
        body = base64.b64encode(struct.pack("<I", len(raw)) + raw).decode()
    else:
        compressor = ' compressor="vtkZLibDataCompressor"'
        first, rest = raw[:40], raw[40:]
        blocks = [zlib.compress(first), zlib.compress(rest)]
        head = struct.pack("<5I", 2, 40, len(rest), *map(len, blocks))
        text = base64.b64encode(head).decode() + base64.b64encode(b"".join(blocks)).decode()
        place = 'format="appended" offset="8"'
        appended = f'<AppendedData encoding="base64">\n  _AAAAAAAA{text}\n</AppendedData>'
    return (
        f'<?xml version="1.0"?><VTKFile type="PolyData" byte_order="LittleEndian"{compressor}>'
        "<PolyData><Piece><PointData/><Points>"
        f'<DataArray type="{name}" NumberOfComponents="3" {place}>{body}</DataArray>'
        f"</Points></Piece></PolyData>{appended}</VTKFile>"
    )


def written(folder: Path, *bodies: str, reference: str = REFERENCE, points: Any = CORNERS) -> Path:
    (folder / "shapes").mkdir(parents=True, exist_ok=True)
    (folder / "shapes/plank.vtp").write_text(vtp(points, "appended"), encoding="utf-8")
    (folder / "ref.txt").write_text(reference, encoding="utf-8")
    path = folder / "input.dat"
    path.write_text("\n".join([GROUND, *bodies]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", ["ascii", "binary", "appended"])
def test_points_of_a_shape_are_read_in_every_form(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "x.vtp"
    path.write_text(vtp(CORNERS, kind), encoding="utf-8")
    np.testing.assert_array_equal(siconos_input.points_of(path), CORNERS)


def test_bodies_have_their_places_masses_and_velocities(tmp_path: Path) -> None:
    path = written(
        tmp_path / "Some",
        "1 0 2  1 2 3  0.5 0.5 0.5 0.5  1 2 3 4 5 6",
        "2 0 3  5 0 4  1 0 0 0  0 0 0 0 0 1",
        "",
        "3 0 1  -5 0 4  1 0 0 0  0 0 0 0 0 0",
        "4 0 1  -9 0 4  1 0 0 0  0 0 0 0 0 0",
        "1 -2 1  9 0 4  1 0 0 0  0 0 0 0 0 0",
    )
    scene = Scene.from_file(path, time_step=1e-3, friction=0.3)
    model: Any = model_of(scene)
    assert scene.name == "Some"
    assert set(scene.parameters["files"]) == {"ref.txt", "shapes/plank.vtp"}
    # four bodies move; one of a negative group, and the ground, do not
    q, v = model.position.reshape(4, 7), model.velocity.reshape(4, 6)
    np.testing.assert_allclose(q[0], [1, 2, 3, 0.5, 0.5, 0.5, 0.5], atol=1e-12)
    np.testing.assert_array_equal(v[0], [1, 2, 3, 4, 5, 6])
    mass = model.model.body_mass[model.model.body_dofnum == 6]
    np.testing.assert_allclose(mass, [2, 3, 1, 1])
    inertia = model.model.body_inertia[model.model.body_dofnum == 6]
    x, y, z = 2 * HALF
    box = np.sort([y * y + z * z, x * x + z * z, x * x + y * y]) * 2 / 12
    np.testing.assert_allclose(np.sort(inertia[0]), box, rtol=1e-6)
    np.testing.assert_allclose(inertia[1], 0.4 * 3 * 0.25, rtol=1e-6)
    np.testing.assert_array_equal(np.unique(model.model.geom_friction[:, 0]), [0.3])
    # the axes of a capsule and a cylinder are along y
    for body, half in ((2, 0.6), (3, 0.4)):
        geom = int(np.flatnonzero(model.model.geom_bodyid == body + 2)[0])
        axis = rotations(model.model.geom_quat[geom][None])[0][:, 2]
        np.testing.assert_allclose(np.abs(axis), [0, 1, 0], atol=1e-12)
        assert model.model.geom_size[geom, 1] == half


def test_a_plank_comes_to_rest_on_the_ground(tmp_path: Path) -> None:
    path = written(tmp_path, "1 0 2  0 0 0.2502  1 0 0 0  0 0 -0.1 0 0 0")
    scene = Scene.from_file(path, time_step=1e-3, friction=0.3)
    *_, last = simulate(scene, 30)
    assert last.result.converged
    # four corners carry the weight
    r = np.reshape(last.result.solution.r, (-1, 3))
    assert len(r) == 4
    assert r[:, 0].sum() == pytest.approx(2 * siconos_input.GRAVITY * 1e-3, rel=1e-6)


def test_a_file_becomes_problems_by_one_command(tmp_path: Path) -> None:
    path = written(tmp_path / "Drop", "2 0 1  0 0 0.5001  1 0 0 0  0 0 0 0 0 0")
    command = ["simulate", str(path), "--steps", "12", "--out", str(tmp_path / "out")]
    lacking = invoke(*command, "--time-step", "0.002", code=1)
    assert "does not have the friction" in " ".join(lacking.output.split())
    more = ["--time-step", "0.002", "--friction", "0.4", "--no-pictures"]
    invoke(*command, *more)
    assert len(list((tmp_path / "out").rglob("*-global.hdf5"))) > 3
    scene = tmp_path / "scene.xml"
    scene.write_text("<mujoco/>", encoding="utf-8")
    refused = invoke("simulate", scene, "--friction", "0.4", code=1)
    assert "has its own friction" in " ".join(refused.output.split())


BALL = "2 0 1  0 0 1  1 0 0 0  0 0 0 0 0 0"
WRONG: dict[str, tuple[list[str], str, str]] = {
    "a number is missing": (["2 0 1  0 0 1  1 0 0 0  0 0 0 0 0"], REFERENCE, "line 2: has 15"),
    "a word": ([BALL.replace("2", "two")], REFERENCE, "line 2: could not convert"),
    "no such shape": ([BALL.replace("2", "7")], REFERENCE, "line 2: asks for shape 7; ref.txt"),
    "no mass": (["2 0 0  0 0 1  1 0 0 0  0 0 0 0 0 0"], REFERENCE, "line 2: a body that moves"),
    "no turn": (["2 0 1  0 0 1  0 0 0 0  0 0 0 0 0 0"], REFERENCE, "line 2: its quaternion"),
    "not finite": ([BALL.replace("0 0 1 ", "0 0 nan ")], REFERENCE, "line 2: has a number that"),
    "nothing moves": ([], REFERENCE, "no body moves"),
    "a cone": (
        [BALL.replace("2", "1", 1)],
        "Box 1 1 1\n\nCone 1 2\nSphere 1\n",
        "ref.txt, line 3: .*'Cone'",
    ),
    "no size": ([BALL], "Box 1 1 1\nSphere\nSphere\n", "ref.txt, line 3: Sphere has 1 positive"),
    "no file": ([BALL], "Box 1 1 1\nBox 1 1 1\nx.vtp\n", "ref.txt, line 3: the shape .*x.vtp is"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named_with_file_and_line(name: str, tmp_path: Path) -> None:
    bodies, reference, words = WRONG[name]
    path = written(tmp_path, *bodies, reference=reference)
    with pytest.raises(ValueError, match=words):
        Scene.from_file(path, time_step=1e-3, friction=0.3)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (np.vstack((CORNERS, np.zeros((1, 3)))), "is not convex: a vertex lies 0.25 m"),
        (CORNERS + np.array([0.1, 0, 0]), "the centre of mass of .* is 0.1 m"),
        (CORNERS * np.array([1, 1, 0]), "has no volume"),
    ],
)
def test_a_shape_that_siconos_takes_otherwise_is_refused(
    points: Any, words: str, tmp_path: Path
) -> None:
    path = written(tmp_path, "1 0 2  0 0 1  1 0 0 0  0 0 0 0 0 0", points=points)
    with pytest.raises(ValueError, match=words):
        Scene.from_file(path, time_step=1e-3, friction=0.3)


def test_a_damaged_shape_is_no_vtp_file(tmp_path: Path) -> None:
    path = written(tmp_path, "1 0 2  0 0 1  1 0 0 0  0 0 0 0 0 0")
    shape = tmp_path / "shapes/plank.vtp"
    whole = shape.read_text(encoding="utf-8")
    for text in ("", whole[:-40], whole.replace("Float32", "Int8"), whole.replace("base64", "raw")):
        shape.write_text(text, encoding="utf-8")
        with pytest.raises(ValueError, match=r"plank.vtp: is no .vtp file"):
            Scene.from_file(path, time_step=1e-3, friction=0.3)
