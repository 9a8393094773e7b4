"""Scenes of Siconos' mechanics in HDF5: bodies, shapes, laws and groups become a scene here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib.external import siconos
from fclib.scenes import Scene
from fclib.scenes.shared import siconos_input
from helpers import needs_siconos_mechanics, ran

pytest.importorskip("mujoco")
pytest.importorskip("h5py")

import h5py
import mujoco

from fclib.simulate import model_of, simulate
from helpers_cli import invoke

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
CORNERS = np.array([(x, y, z) for x in (-1.5, 1.5) for y in (-0.5, 0.5) for z in (-0.25, 0.25)])
VTP = (
    '<VTKFile type="PolyData"><PolyData><Piece><Points><DataArray type="Float64"'
    ' format="ascii">{}</DataArray></Points></Piece></PolyData></VTKFile>'
)
TETRAHEDRON = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, -1, -1), (0, 0, 0.1)], float)


def contactor(
    body: Any, shape: str, at: Any = (0, 0, 0), turn: Any = UPRIGHT, group: int = 0
) -> Any:
    made = body.create_dataset(f"{shape}-{len(body)}", (0, 0), "f4")
    made.attrs.update({"shape_name": shape, "group": group, "translation": at, "orientation": turn})
    return made


def body(file: Any, name: str, at: Any, **more: Any) -> Any:
    """A body; its contactors are to come."""
    made = file["data/input"].create_group(name)
    own = {"translation": at, "orientation": UPRIGHT, "velocity": np.zeros(6)} | more
    made.attrs.update({"center_of_mass": np.zeros(3), "id": len(file["data/input"])} | own)
    return made


def begun(path: Path) -> Any:
    """An open file with a ground, shapes and one law of friction."""
    file = h5py.File(path, "w")
    file.attrs["dimension"] = 3
    for name in ("ref", "input", "nslaws", "joints", "boundary_conditions"):
        file.create_group(f"data/{name}")
    for name, primitive, sizes in (
        ("Ground", "Box", (40, 40, 1)),
        ("Floor", "Plane", ()),
        ("Block", "Box", (3, 1, 0.5)),
        ("Ball", "Sphere", (0.5,)),
        ("Pin", "Cylinder", (0.3, 0.8)),
    ):
        shape = file["data/ref"].create_dataset(name, data=np.array([sizes]))
        shape.attrs.update({"type": "primitive", "primitive": primitive})
    file["data/ref"].create_dataset("Rock", data=TETRAHEDRON).attrs["type"] = "convex"
    text = file["data/ref"].create_dataset("Plank", (1,), dtype=h5py.string_dtype())
    text[0] = VTP.format(" ".join(map(str, CORNERS.ravel())))
    text.attrs.update({"type": "vtp", "scale": 2.0})
    law = file["data/nslaws"].create_dataset("contact", (0,), "f4")
    law.attrs.update({"type": "NewtonImpactFrictionNSL", "mu": 0.3, "e": 0.1, "gid1": 0, "gid2": 0})
    contactor(body(file, "ground", (0, 0, -0.5)), "Ground")
    return file


def test_bodies_have_their_places_masses_inertias_and_velocities(tmp_path: Path) -> None:
    path = tmp_path / "some.hdf5"
    with begun(path) as file:
        turn = np.array([0.5, 0.5, 0.5, 0.5])
        made = body(
            *(file, "b<1>", (1, 2, 3)),
            mass=2,
            inertia=(1, 2, 2.5),
            orientation=turn,
            velocity=(1, 2, 3, 4, 5, 6),
        )
        contactor(made, "Block", (0, 0, 1))
        contactor(made, "Pin", (0, 0, 2), (np.sqrt(0.5), np.sqrt(0.5), 0, 0))
        matrix = np.array([(2, 0.1, 0), (0.1, 3, 0.2), (0, 0.2, 4)])
        made = body(file, "rock", (9, 0, 4), mass=3.0, inertia=matrix, center_of_mass=(0.1, 0, 0))
        contactor(made, "Rock", (0.5, 0, 0))
        contactor(body(file, "ball", (-9, 0, 4), mass=1.5), "Ball")
    scene = Scene.from_file(path, time_step=1e-3)
    assert scene.restitution == 0.1
    model: Any = model_of(scene)
    q, v = model.position.reshape(3, 7), model.velocity.reshape(3, 6)
    np.testing.assert_allclose(q[0], [1, 2, 3, *turn], atol=1e-12)
    np.testing.assert_array_equal(v[0], [1, 2, 3, 4, 5, 6])
    own = model.model
    moving = own.body_dofnum == 6
    np.testing.assert_allclose(own.body_mass[moving], [2, 3, 1.5])
    np.testing.assert_allclose(np.sort(own.body_inertia[moving][0]), [1, 2, 2.5])
    np.testing.assert_allclose(
        np.sort(own.body_inertia[moving][1]), np.linalg.eigvalsh(matrix), rtol=1e-9
    )
    # one without an inertia is homogeneous, by its first shape
    np.testing.assert_allclose(own.body_inertia[moving][2], 0.4 * 1.5 * 0.25)
    np.testing.assert_array_equal(np.unique(own.geom_friction[:, 0]), [0.3])
    # places of shapes are from the centre of mass
    (rock,) = np.flatnonzero(own.geom_bodyid == np.flatnonzero(moving)[1])
    mesh = own.geom_dataid[rock]
    start, count = own.mesh_vertadr[mesh], own.mesh_vertnum[mesh]
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, own.geom_quat[rock])
    corners = own.mesh_vert[start : start + count] @ R.reshape(3, 3).T + own.geom_pos[rock]
    expected = TETRAHEDRON[:4] + np.array([0.4, 0, 0])
    order = np.lexsort(np.round(corners, 4).T), np.lexsort(np.round(expected, 4).T)
    np.testing.assert_allclose(corners[order[0]], expected[order[1]], atol=1e-6)
    # the axis of Bullet's cylinder is y, here turned into z
    pin = int(np.flatnonzero(own.geom_type == mujoco.mjtGeom.mjGEOM_CYLINDER)[0])
    mujoco.mju_quat2Mat(R, own.geom_quat[pin])
    np.testing.assert_allclose(np.abs(R.reshape(3, 3)[:, 2]), [0, 0, 1], atol=1e-9)


def test_a_plank_comes_to_rest_on_a_plane(tmp_path: Path) -> None:
    path = tmp_path / "plank.hdf5"
    with begun(path) as file:
        del file["data/input/ground"]
        contactor(body(file, "floor", (0, 0, 1)), "Floor")
        inertia = (1.0, 1.5, 2.0)
        made = body(file, "plank", (0, 0, 1.5002), mass=2.0, inertia=inertia,
                    velocity=(0, 0, -0.1, 0, 0, 0))  # fmt: skip
        contactor(made, "Plank")  # twice as large: 1 m high
    *_, last = simulate(Scene.from_file(path, time_step=1e-3), 40)
    assert last.result.converged
    r = np.reshape(last.result.solution.r, (-1, 3))
    assert len(r) == 4
    assert r[:, 0].sum() == pytest.approx(2 * siconos_input.GRAVITY * 1e-3, rel=1e-6)


def test_only_groups_with_a_law_between_them_touch(tmp_path: Path) -> None:
    def contacts(pairs: Any) -> int:
        path = tmp_path / "groups.hdf5"
        with begun(path) as file:
            for k, (one, other) in enumerate(pairs):
                law = file["data/nslaws"].create_dataset(f"law{k}", (0,), "f4")
                law.attrs.update(dict(file["data/nslaws/contact"].attrs))
                law.attrs.update({"gid1": one, "gid2": other})
            for k, group in enumerate((2, 3)):
                made = body(file, f"ball{k}", (0, 0, 0.4999 + 0.9998 * k), mass=1.0)
                contactor(made, "Ball", group=group)
        (step,) = simulate(Scene.from_file(path, time_step=1e-3), 1)
        return int(step.problem.nc)

    assert contacts([]) == 0
    assert contacts([(2, 0)]) == 1
    assert contacts([(0, 2), (2, 3)]) == 2
    assert contacts([(2, 2), (3, 3)]) == 0


def broken(file: Any, case: str) -> None:
    """A ball, and one thing that is not taken."""
    made = body(file, "ball", (0, 0, 0.6), mass=1.0)
    if case == "shape":
        contactor(made, "Moon")
        return
    own = contactor(made, "Ball")
    data = file["data"]
    if case == "joint":
        data["joints"].create_dataset("hinge", (0,), "f4")
    elif case == "birth":
        made.attrs["time_of_birth"] = 0.5
    elif case == "number":
        made.attrs["translation"] = (0, np.nan, 0)
    elif case == "inertia":
        made.attrs["inertia"] = (1.0, -1.0, 1.0)
    elif case == "off centre":
        own.attrs["translation"] = (0, 0, 1)
    elif case == "cone":
        data["ref/Ball"].attrs["primitive"] = "Cone"
    elif case == "flat":
        del data["ref/Rock"]
        data["ref"].create_dataset("Rock", data=TETRAHEDRON[:3]).attrs["type"] = "convex"
    elif case == "two frictions":
        law = data["nslaws"].create_dataset("other", (0,), "f4")
        law.attrs.update(dict(data["nslaws/contact"].attrs))
        law.attrs["mu"] = 0.5
    elif case == "law":
        data["nslaws/contact"].attrs["type"] = "RelayNSL"
    elif case == "no law":
        del data["nslaws/contact"]
    elif case == "still":
        del made.attrs["mass"]
    elif case == "other file":
        del data["ref"]


@pytest.mark.parametrize(
    ("case", "words"),
    [
        ("shape", r"input/ball/Moon-0: asks for the shape Moon, which /data/ref lacks"),
        ("joint", r"/data/joints/hinge: is a joint, which is not taken"),
        ("birth", r"input/ball: comes or goes"),
        ("number", r"input/ball, translation: is not 3 finite numbers"),
        ("inertia", r"input/ball: its inertia is not positive definite"),
        ("off centre", r"input/ball: has no inertia, and Ball-0 is no primitive about its centre"),
        ("cone", r"ref/Ball: the primitive Cone is not taken"),
        ("flat", r"ref/Rock: its points have no volume"),
        ("two frictions", r"the laws contact and other differ in mu or e"),
        ("law", r"nslaws/contact: is a RelayNSL"),
        ("no law", r"has no law of contact"),
        ("still", r"no body moves"),
        ("other file", r"is no scene of Siconos' mechanics"),
    ],
)
def test_what_is_not_taken_is_named_with_its_place(case: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "broken.hdf5"
    with begun(path) as file:
        broken(file, case)
    with pytest.raises(ValueError, match=f"broken.hdf5.*{words}"):
        Scene.from_file(path, time_step=1e-3)


def test_a_file_becomes_problems_by_one_command(tmp_path: Path) -> None:
    path = tmp_path / "drop.hdf5"
    with begun(path) as file:
        contactor(body(file, "ball", (0, 0, 0.5001), mass=1.0), "Ball")
    command = ["simulate", str(path), "--steps", "12", "--out", str(tmp_path / "out")]
    lacking = invoke(*command, code=1)
    assert "does not have the time step" in lacking.output
    command += ["--time-step", "0.002", "--no-pictures"]
    refused = invoke(*command, "--restitution", "0.5", code=1)
    assert "has its own restitution" in refused.output
    invoke(*command)
    files = sorted((tmp_path / "out").rglob("*-global.hdf5"))
    assert files
    problem: Any = fclib.read(files[0])
    assert problem.nc == 1
    np.testing.assert_array_equal(problem.mu, [0.3])


WRITES = """
import sys
import siconos.io.mechanics_run as runner
from siconos.mechanics.collision.tools import Contactor
with runner.MechanicsHdf5Runner(mode="w", io_filename=sys.argv[1]) as io:
    io.add_primitive_shape("Block", "Box", (3, 1, 0.5))
    io.add_primitive_shape("Ground", "Box", (40, 40, 1))
    io.add_object("ground", [Contactor("Ground")], translation=[0, 0, -0.5])
    io.add_object("block", [Contactor("Block", collision_group=0)], translation=[0, 0, 0.2501],
                  orientation=[(0, 0, 1), 0.3], mass=2, inertia=[1, 2, 2.5],
                  velocity=[0, 0, -0.1, 0, 0, 0.1])
    io.add_Newton_impact_friction_nsl("contact", mu=0.4)
"""


def test_what_siconos_itself_writes_is_read(tmp_path: Path) -> None:
    needs_siconos_mechanics()
    path = tmp_path / "own.hdf5"
    done = ran(siconos.python(), "-c", WRITES, path, code=None)
    assert path.is_file(), done.stderr
    scene = Scene.from_file(path, time_step=1e-3)
    model: Any = model_of(scene)
    half = 0.15
    np.testing.assert_allclose(
        model.position, [0, 0, 0.2501, np.cos(half), 0, 0, np.sin(half)], atol=1e-7
    )
    np.testing.assert_allclose(model.velocity, [0, 0, -0.1, 0, 0, 0.1], atol=1e-7)
    *_, last = simulate(scene, 20)
    assert last.problem.nc == 4
