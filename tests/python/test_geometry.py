"""Where contacts are and what touches there: /contacts and /bodies of a file."""

import json
import pickle
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp

import fclib
from fclib import scenes
from fclib._geometry import KINDS, Bodies, Contacts
from helpers import planted_local

read: Any = fclib.read


def wall(number: int = 0) -> Any:
    """Blocks in running bond, assembled directly."""
    return scenes.Assembled(family=scenes.assemblies()["Units"](contacts=40), seed=0).problem(
        number
    )


def assert_same(one: Any, other: Any) -> None:
    first, second = one.columns(), other.columns()
    assert first.keys() == second.keys()
    for name, value in first.items():
        np.testing.assert_array_equal(value, second[name], err_msg=name)


def test_geometry_goes_with_a_problem(tmp_path: Path) -> None:
    problem = wall()
    fclib.write(tmp_path / "wall.hdf5", problem)
    again = read(tmp_path / "wall.hdf5")
    copies = [again, pickle.loads(pickle.dumps(problem)), problem.replace(mu=problem.mu)]
    for copy in (*copies, problem.with_storage("csr"), problem.condense()):
        assert_same(copy.contacts, problem.contacts)
        assert_same(copy.bodies, problem.bodies)
    assert again.bodies.names[0] == "ground"
    assert again.bodies.unit == "mm"
    assert fclib.digest(again) == fclib.digest(problem.replace(contacts=None, bodies=None))
    # added beside it, the local form brings or keeps the same; one without it takes it away
    fclib.write(tmp_path / "wall.hdf5", problem.condense(), mode="add")
    assert_same(read(tmp_path / "wall.hdf5", "local").contacts, problem.contacts)
    bare = problem.replace(contacts=None, bodies=None)
    assert bare.contacts is None
    assert bare.bodies is None
    fclib.write(tmp_path / "wall.hdf5", bare, mode="replace")
    assert read(tmp_path / "wall.hdf5", "global").contacts is None


def test_geometry_of_other_contacts_goes() -> None:
    problem = wall()
    fewer = problem.condense().replace(W=np.eye(3), q=np.zeros(3), mu=[0.5])
    assert fewer.nc == 1
    assert fewer.contacts is None


def test_what_is_wrong_is_named(tmp_path: Path) -> None:
    path = tmp_path / "wall.hdf5"
    fclib.write(path, wall())
    with h5py.File(path, "r+") as file:
        gap = file["contacts/gap"][:]
        del file["contacts/gap"]
        file["contacts/gap"] = gap[1:]
        del file["bodies/shape_body"]
    problem = read(path)  # still a problem
    with pytest.raises(ValueError, match=r"/contacts/body: has .* rows, expected nc = "):
        _ = problem.contacts
    with pytest.raises(ValueError, match=r"/bodies/shape_body: the dataset is missing"):
        _ = problem.bodies
    with pytest.raises(TypeError, match=r"contacts must be of type fclib.Contacts"):
        problem.replace(contacts=3)
    with h5py.File(path, "r+") as file:
        del file["bodies/place"]
        file.create_dataset("bodies/place", shape=(2, 3), dtype="<f8")
    # where a table cannot be read, the problem stays
    assert read(path).bodies is None
    (line,) = fclib.left_out(path)
    assert line.startswith("/bodies/place: was declared and never written")


def test_groups_of_others_are_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "other.hdf5"
    fclib.write(path, planted_local(1, nc=2).problem)
    with h5py.File(path, "r+") as file:
        file["contacts/table"] = np.zeros((3, 3))
        file["bodies"] = np.zeros(2)
    assert read(path).contacts is None
    assert read(path).bodies is None
    fclib.write_solution(path, planted_local(1, nc=2).solution)
    with h5py.File(path) as file:
        assert file["contacts/table"].shape == (3, 3)


def test_the_page_has_every_column(root: Path) -> None:
    page = (root / "docs" / "format.md").read_text(encoding="utf-8")
    for table in (Contacts, Bodies):
        for name in table.__dataclass_fields__:
            assert f"| `{name}` |" in page, name
    for number, kind in enumerate(KINDS):
        assert f"{number} {kind}" in page


# ---- of simulated scenes


def steps(name: str, count: int, **parameters: Any) -> list[Any]:
    """Problems with their geometry, of the steps of a family's scene that touch."""
    pytest.importorskip("mujoco")
    from fclib import simulate

    scene = parameters.get("scene") or scenes.get(name)(**parameters).scene(0)
    model = simulate.model_of(scene)
    scheme = simulate.scheme_of(model)
    found = []
    for step in simulate.simulate(scene, count):
        if not step.problem.nc:
            continue
        state = step.start
        part = simulate.problem_at(model, scheme, state.position, state.velocity)
        contacts, bodies = simulate.geometry_of(model, part.contacts)
        found.append(part.problem.replace(contacts=contacts, bodies=bodies))
    assert found
    return found


def distance(problem: Any, point: Any, shape: int) -> float:
    """Of a point to the surface of a box, a convex mesh, a plane or a sphere; < 0 inside."""
    bodies: Bodies = problem.bodies
    places, turns = bodies.poses()
    local = turns[shape].T @ (point - places[shape])
    kind = KINDS[bodies.shape_kind[shape]]
    if kind == "plane":
        return float(local[2])
    if kind == "sphere":
        return float(np.linalg.norm(local) - bodies.shape_size[shape, 0])
    if kind == "box":
        return float((np.abs(local) - bodies.shape_size[shape]).max())
    vertex, face = bodies.mesh(shape)  # type: ignore[misc]
    a, b, c = (vertex[face[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return float(np.einsum("fi,fi->f", normal, local - a).max())


@pytest.mark.parametrize(
    ("name", "count", "parameters"),
    [
        ("BoxesStack", 40, {"boxes": 3, "gap": 2e-3, "time_step": 5e-3}),
        ("Arch", 3, {}),
        ("PeriodicBox", 30, {"polyhedra": 40}),
        ("PlanarBlocks", 20, {}),
        ("CubesH8x2", 12, {}),
    ],
)
def test_a_contact_lies_between_its_shapes(name: str, count: int, parameters: Any) -> None:
    """The point is half a gap from both, along the normal: what is drawn is what touches."""
    problem = steps(name, count, **parameters)[-1]
    contacts, bodies = problem.contacts, problem.bodies
    size = np.ptp(contacts.point, axis=0).max()
    for i in range(problem.nc):
        for side, sign in ((0, 1.0), (1, -1.0)):
            surface = contacts.point[i] - sign * 0.5 * contacts.gap[i] * contacts.normal[i]
            shape = contacts.shape[i, side]
            assert bodies.shape_body[shape] == contacts.body[i, side]
            shifts = [np.zeros(3)]
            if len(bodies.period):
                a, b = bodies.period
                shifts = [np.array((x, y, 0)) for x in (-a, 0, a) for y in (-b, 0, b)]
            away = min(abs(distance(problem, surface + shift, shape)) for shift in shifts)
            # an elastic face is bent
            assert away < (1e-2 if name.startswith("Cubes") else 1e-6) * size, (i, side, away)
    assert len(set(contacts.identity)) == problem.nc
    assert bodies.is_planar == (name == "PlanarBlocks")
    if name.startswith("Cubes"):
        assert np.abs(bodies.displacement).max() > 0


def test_a_contact_at_rest_keeps_its_name() -> None:
    first, *_, last = steps("BoxesStack", 80, boxes=3, gap=2e-3, time_step=5e-3)[-20:]
    assert set(first.contacts.identity) == set(last.contacts.identity)
    assert first.nc == 12


PENDULUM = """<mujoco><option timestep="0.01"/><worldbody><body name="rod" pos="0 0 1">
<joint type="hinge" axis="0 1 0" limited="true" range="-5 5"/>
<geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.02"/></body></worldbody></mujoco>"""


def test_limits_have_a_joint_and_no_shape() -> None:
    (*_, problem) = steps("", 60, scene=scenes.Scene(name="pendulum", xml=PENDULUM))
    contacts = problem.contacts
    assert contacts.shape.tolist() == [[-1, -1]]
    assert contacts.body.tolist() == [[0, 1]]
    assert not contacts.normal.any()
    assert problem.bodies.names == ["world", "rod"]


@pytest.mark.parametrize("own", ["rt444/KaplasTower", "tiny/FourBar", "robots/Pusher"])
def test_f_follows_from_the_file_alone(own: str, tmp_path: Path) -> None:
    """From masses, gravity and v0 of free bodies; from v0 and the impulse of any."""
    pytest.importorskip("pyarrow")
    pytest.importorskip("mujoco")
    from fclib import collections
    from fclib.collections import published

    if published.root() is None:
        pytest.skip("the package of trajectories is not here")
    plan = collections.plan_of(own, references=False, form="global")
    plan = plan.only([int(plan.numbers()[len(plan.numbers()) // 2])])
    (row,) = collections.build([plan], tmp_path, pictures=False).to_pylist()
    path = tmp_path / row["global_file"]
    with h5py.File(path) as file:
        group = file["fclib_global"]
        entries = group["M/x"][()], (group["M/i"][()], group["M/p"][()])
        size = int(group["M/m"][0])
        M = sp.coo_array(entries, shape=(size, size)).tocsr()
        f = group["vectors/f"][()]
        v0, impulse = (file[f"bodies/{part}"][()] for part in ("velocity", "impulse"))
        np.testing.assert_allclose(M @ v0 + impulse, f, rtol=1e-12, atol=1e-14 * abs(f).max())
        mass, moves = file["bodies/mass"][()], file["bodies/moves"][()]
        assert (mass[moves == 1] > 0).all()
        assert (file["bodies/inertia"][()].reshape(-1, 3)[moves == 1] > 0).all()
        if own == "rt444/KaplasTower":  # free blocks: gravity alone, and the masses are those of M
            h = json.loads(file["fclib_global/info/description"][()].splitlines()[-1])["time_step"]
            weight = impulse.reshape(-1, 6)[:, 2] / h
            masses = -weight / 9.80665  # as Siconos has it
            assert set(np.round(masses, 9)) <= set(np.round(mass[moves == 1], 9))
            np.testing.assert_allclose(M.diagonal().reshape(-1, 6)[:, 0], masses, rtol=1e-9)
