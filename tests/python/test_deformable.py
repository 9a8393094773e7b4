"""Elastic blocks against theory: what has a closed form is compared with it."""

import dataclasses
import importlib
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import fclib
from fclib import scenes
from fclib.scenes import Scene
from fclib.scenes.shared.solids import Bed, Block, Load, Solids

# MuJoCo has no release for the oldest Python that fclib takes
pytest.importorskip("mujoco")
skfem = pytest.importorskip("skfem")

from fclib.simulate import DeformableModel, MoreauJean, NoRenderer, provenance, render, simulate  # noqa: E402
from fclib.simulate.deformable import project, shapes  # noqa: E402

G = 9.81  # m/s^2
YOUNG, POISSON, DENSITY = 1e6, 0.3, 1000.0


def block(**changes: Any) -> Block:
    values: dict[str, Any] = {
        "centre": (0.0, 0.0, 0.5),
        "size": (1.0, 1.0, 1.0),
        "elements": (2, 2, 2),
        "young": YOUNG,
        "poisson": POISSON,
        "density": DENSITY,
    }
    return Block(**(values | changes))


def scene(*blocks: Block, **changes: Any) -> Scene:
    of_scene = {"law": "gap", "time_step": 1e-3, "theta": 0.5}
    of_scene |= {key: changes.pop(key) for key in list(of_scene) if key in changes}
    values: dict[str, Any] = {"mu": 0.0, "reach": 0.1, "floor": True, "gravity": G}
    solids = Solids(blocks=tuple(blocks), **(values | changes))
    return Scene(name="test", solids=solids, **of_scene)  # type: ignore[arg-type]


def settled(of: Scene) -> Any:
    """The step of a scene that stands still: implicit Euler with a long step."""
    *_, last = simulate(dataclasses.replace(of, theta=1.0, time_step=10.0), 12, tol=1e-11)
    assert np.abs(last.velocity).max() < 1e-8
    return last


# ---- elements


def test_matrices_are_those_of_scikit_fem() -> None:
    """Of one element and the pattern of the mesh, as of an integration over all elements."""
    elasticity = importlib.import_module("skfem.models.elasticity")
    model = DeformableModel(scene(block(size=(1.0, 0.6, 0.9), elements=(2, 3, 1))))
    axes = [np.linspace(-0.5 * a, 0.5 * a, e + 1) for a, e in ((1.0, 2), (0.6, 3), (0.9, 1))]
    mesh = skfem.MeshHex.init_tensor(*axes)
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementHex1()))
    lame = elasticity.lame_parameters(YOUNG, POISSON)
    K = elasticity.linear_elasticity(*lame).assemble(basis)
    M = skfem.BilinearForm(lambda u, v, _: DENSITY * (u * v).sum(axis=0)).assemble(basis)
    np.testing.assert_allclose(model.K.toarray(), K.toarray(), atol=1e-9 * YOUNG)
    np.testing.assert_allclose(model.M.toarray(), M.toarray(), atol=1e-12 * DENSITY)


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_rigid_motions_meet_no_stiffness(yaw: float) -> None:
    model = DeformableModel(scene(block(yaw=yaw, size=(1.0, 0.5, 0.7))))
    K, M = model.K, model.M
    assert (K != K.T).nnz == 0
    assert (M != M.T).nnz == 0
    x = model.reference - model.reference.mean(axis=0)
    mass = DENSITY * 0.35
    for axis in np.eye(3):
        push, turn = np.tile(axis, len(x)), np.cross(axis, x).ravel()
        np.testing.assert_allclose(push @ (M @ push), mass, rtol=1e-12)
        for motion in (push, turn):
            assert np.abs(K @ motion).max() < 1e-9 * YOUNG
    assert np.linalg.matrix_rank(K.toarray()) == K.shape[0] - 6


def test_longitudinal_frequencies_of_a_bar() -> None:
    """Free ends, no lateral contraction: those of linear elements in closed form.

    omega^2 = 6 (c / l)^2 (1 - cos k l) / (2 + cos k l), k = j pi / L, c^2 = E / rho, l the element.
    """
    count, length = 12, 3.0
    bar = block(size=(length, 0.2, 0.2), elements=(count, 1, 1), poisson=0.0)
    model = DeformableModel(scene(bar, floor=False))
    found = scipy.linalg.eigh(model.K.toarray(), model.M.toarray(), eigvals_only=True)
    for j in range(1, 5):
        phase = np.pi * j / count
        ratio = count / length
        squared = 6 * YOUNG / DENSITY * ratio**2 * (1 - np.cos(phase)) / (2 + np.cos(phase))
        assert np.abs(found / squared - 1).min() < 1e-9
        # and near those of the bar
        assert np.sqrt(squared) == pytest.approx(
            np.pi * j / length * np.sqrt(YOUNG / DENSITY), rel=0.05
        )


# ---- motion


@pytest.mark.parametrize("theta", [0.5, 1.0])
def test_free_fall(theta: float) -> None:
    steps = list(simulate(scene(block(velocity=(1.0, 0.0, 2.0)), floor=False, theta=theta), 30))
    h, k = 1e-3, np.arange(30)
    assert all(step.problem.nc == 0 for step in steps)
    v = np.array([step.velocity for step in steps]).reshape(30, -1, 3)
    expected = np.stack([np.ones(30), np.zeros(30), 2 - G * h * (k + 1)], axis=1)
    np.testing.assert_allclose(v, np.repeat(expected[:, None], 27, axis=1), atol=1e-10)
    z = np.array([step.position[2] for step in steps])
    # exact at the midpoint
    lag = (theta - 0.5) * G * h**2 * k
    np.testing.assert_allclose(z, 2 * h * k - 0.5 * G * (h * k) ** 2 - lag, atol=1e-12)
    np.testing.assert_allclose([step.position[-1] for step in steps], h * k, atol=1e-15)


@pytest.mark.parametrize(("theta", "kept"), [(0.5, True), (1.0, False)])
def test_free_vibration_keeps_its_energy_at_the_midpoint(theta: float, kept: bool) -> None:
    model = DeformableModel(scene(block(), floor=False, gravity=0.0, theta=theta))
    random = np.random.Generator(np.random.PCG64(0))
    model.set_state(np.append(1e-2 * random.normal(size=81), 0.0), np.zeros(81))
    scheme = MoreauJean(h=1e-3, law="gap", theta=theta)
    energy = []
    for _ in range(40):
        energy.append(model.energy())
        part = scheme.problem(scheme.assemble(model), model.velocity)
        solution: Any = fclib.solve(part.problem).solution
        model.integrate(1e-3, solution.v, theta)
    if kept:
        np.testing.assert_allclose(energy, energy[0], rtol=1e-10)
    else:
        assert np.all(np.diff(energy) < 0)
        assert energy[-1] < 0.5 * energy[0]


@pytest.mark.parametrize("theta", [0.5, 0.8, 1.0])
def test_energy_of_a_falling_block_does_not_grow(theta: float) -> None:
    falling = scene(
        block(centre=(0.0, 0.0, 0.51), velocity=(0.5, 0.0, -1.0)),
        mu=0.4,
        theta=theta,
        time_step=2e-3,
    )
    energy, touched = [], 0
    for step in simulate(falling, 150, tol=1e-10):
        energy.append(step.model.energy())
        touched += step.problem.nc > 0
    assert touched > 50
    assert np.diff(energy).max() < 1e-7 * energy[0]
    assert energy[-1] < energy[0]


def test_load_grows_and_moves() -> None:
    push = Load(blocks=(0,), face="z+", traction=(5.0, 0.0, -7.0), begin=1.0, rise=2.0)
    passing = dataclasses.replace(push, begin=0.0, rise=0.0, width=0.5, start=-2.0, speed=1.0)
    long = block(size=(4.0, 1.0, 1.0), elements=(80, 1, 1))
    model = DeformableModel(scene(long, loads=(push, passing)))
    one = DeformableModel(scene(long, loads=(push,)))
    for time, share in ((0.5, 0.0), (2.0, 0.5), (4.0, 1.0)):
        total = one.loads(time).reshape(-1, 3).sum(axis=0)
        np.testing.assert_allclose(total, share * 4.0 * np.array([5, 0, -7]), atol=1e-12)
    wave = (model.loads(2.5) - one.loads(2.5)).reshape(-1, 3)
    # cos^2 has the mean 1/2; its middle is at 0.5
    np.testing.assert_allclose(wave.sum(axis=0), 0.25 * np.array([5, 0, -7]), rtol=1e-2)
    assert model.reference[:, 0] @ wave[:, 2] / wave[:, 2].sum() == pytest.approx(0.5, abs=1e-6)


# ---- contact


def test_block_pressed_on_the_floor() -> None:
    """Uniaxial compression: u_z(top) = -(p L + rho g L^2 / 2) / E, and what the floor carries."""
    pressure = 2e4
    load = Load(blocks=(0,), face="z+", traction=(0.0, 0.0, -pressure))
    # linear elements have linear displacements: many along the height for the weight's parabola
    last = settled(scene(block(poisson=0.0, elements=(2, 2, 16)), loads=(load,)))
    u = last.position[:-1].reshape(-1, 3)
    x = last.model.reference
    z = x[:, 2]
    expected = -(pressure * z + DENSITY * G * (z - 0.5 * z**2)) / YOUNG
    np.testing.assert_allclose(u[:, 2], expected, atol=1e-7)
    assert np.abs(last.contacts.gap).max() < 1e-7
    r = last.result.solution.r.reshape(-1, 3)[:, 0] / last.model.time_step
    np.testing.assert_allclose(r.sum(), pressure + DENSITY * G, rtol=1e-7)
    # by the share of the area that belongs to a node: corners 1, edges 2, middle 4 of 16
    corners = (np.abs(x[last.contacts.pair[:, 1], :2]) > 0.4).sum(axis=1)
    shares = np.array([4, 2, 1])[corners] / 16
    np.testing.assert_allclose(r, shares * (pressure + DENSITY * G), rtol=1e-6)


def test_patch_test_across_matching_meshes() -> None:
    """Two blocks pressed as one: uniform stress, free lateral expansion, no gap."""
    pressure, turned = 5e4, 0.3
    below = block(yaw=turned)
    above = block(centre=(0.0, 0.0, 1.5), yaw=turned)
    load = Load(blocks=(1,), face="z+", traction=(0.0, 0.0, -pressure))
    # one step so long that inertia does not matter
    h = 30.0
    pressed = scene(below, above, loads=(load,), gravity=0.0, theta=1.0, time_step=h)
    last: Any = next(iter(simulate(pressed, 1, tol=1e-11)))
    x, strain = last.model.reference, -pressure / YOUNG
    u = h * last.velocity.reshape(-1, 3)
    expected = np.column_stack((-POISSON * strain * x[:, :2], strain * x[:, 2]))
    np.testing.assert_allclose(u, expected, atol=1e-4 * pressure / YOUNG)
    between = last.contacts.pair[:, 0] > 0
    assert between.sum() == 9
    r = last.result.solution.r.reshape(-1, 3) / h
    for carried in (r[between], r[~between]):
        np.testing.assert_allclose(
            np.sort(carried[:, 0]), pressure / 16 * np.array([1, 1, 1, 1, 2, 2, 2, 2, 4]), rtol=1e-4
        )


def test_contact_columns_give_the_rate_of_the_gap() -> None:
    below = block()
    above = block(centre=(0.1, -0.05, 1.3), size=(0.6, 0.7, 0.6), yaw=0.2)
    model = DeformableModel(scene(below, above, mu=0.5))
    random = np.random.Generator(np.random.PCG64(3))
    u, v = 1e-2 * random.normal(size=162), random.normal(size=162)
    contacts, H = _at(model, u)
    assert (contacts.pair[:, 0] == 1).sum() == 9
    assert (contacts.pair[:, 0] == 0).sum() == 9
    step = 1e-6
    (ahead, _), (behind, _) = _at(model, u + step * v), _at(model, u - step * v)
    np.testing.assert_array_equal(ahead.pair, contacts.pair)
    rate = (ahead.gap - behind.gap) / (2 * step)
    # the normal turns with the face, which matters by the gap
    np.testing.assert_allclose((H.T @ v)[0::3], rate, atol=1e-6 + 20 * np.abs(contacts.gap).max())
    np.testing.assert_allclose(np.linalg.det(contacts.frame), 1.0, rtol=1e-12)
    # both bodies moving as one do not move against each other
    shift = np.tile((1.0, 2.0, 3.0), 54)
    assert np.abs((H.T @ shift)[3 * 9 :]).max() < 1e-12
    np.testing.assert_allclose(
        np.einsum("cij,ci->cj", contacts.frame[:9], (H.T @ shift).reshape(-1, 3)[:9]),
        np.tile((1.0, 2.0, 3.0), (9, 1)),
    )


def _at(model: DeformableModel, u: Any) -> Any:
    model.set_state(np.append(u, 0.0), np.zeros_like(u))
    H, contacts = model.contacts(0.1)
    return contacts, H


@settings(max_examples=50, deadline=None)
@given(
    local=st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    height=st.floats(-0.05, 0.05),
    bend=st.lists(st.floats(-0.05, 0.05), min_size=12, max_size=12),
)
def test_projection_finds_the_point_it_came_from(
    local: tuple[float, float], height: float, bend: list[float]
) -> None:
    corners = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]) + np.reshape(bend, (4, 3))
    shape, along = shapes(np.array([local]))
    tangents = along[0].T @ corners
    normal = np.cross(*tangents)
    normal /= np.linalg.norm(normal)
    point = shape[0] @ corners + height * normal
    found, direction, outside = project(point[None], corners[None])
    assert outside[0] <= 1e-6
    np.testing.assert_allclose(found[0] @ corners, shape[0] @ corners, atol=1e-6)
    np.testing.assert_allclose(direction[0], normal, atol=1e-6)


def test_sliding_block_stops_by_coulomb() -> None:
    """Stiff, hence nearly rigid: it slows down by mu g."""
    mu, speed, h = 0.3, 0.2, 2e-3
    sliding = scene(block(young=1e9, velocity=(speed, 0.0, 0.0)), mu=mu, theta=1.0, time_step=h)
    v = np.array([step.velocity.reshape(-1, 3)[:, 0].mean() for step in simulate(sliding, 60)])
    expected = np.maximum(speed - mu * G * h * np.arange(1, 61), 0)
    np.testing.assert_allclose(v, expected, atol=0.02 * speed)


@pytest.mark.parametrize("name", ["CubesH8x2", "LowWallFEM"])
def test_families_have_the_matrices_they_promise(name: str) -> None:
    """M + h^2 theta^2 K + h theta C, not diagonal, symmetric to the last bit; W of full rank."""
    family: Any = scenes.get(name)
    of = family(**family.small).scene(seed=0)
    step: Any
    *_, step = simulate(of, 12)
    model, h = step.model, step.model.time_step
    assert of.theta == 0.5
    M: Any = step.problem.M
    expected = model.M + 0.5 * h * model.C + 0.25 * h**2 * model.K
    np.testing.assert_allclose(M.toarray(), expected.toarray(), rtol=1e-13)
    assert (M != M.T).nnz == 0
    assert np.abs(sp.triu(M, 1)).max() > 0.1 * M.diagonal().min()
    W: Any = step.problem.condense().W
    assert np.linalg.matrix_rank(W.toarray()) == 3 * step.problem.nc


# ---- the simulation


def arrays(step: Any) -> list[Any]:
    p = step.problem
    return [p.M.toarray(), p.H.toarray(), p.f, p.w, p.mu, step.result.solution.r, step.position]


def test_same_seed_same_bits_also_from_the_middle() -> None:
    family: Any = scenes.get("CubesH8x2")
    steps = list(simulate(family().scene(seed=5), 8))
    origin = provenance(steps[5].problem.info)
    assert origin["scikit-fem"] == skfem.__version__
    assert "mujoco" not in origin
    assert origin["theta"] == 0.5
    assert "theta = 0.5" in steps[5].problem.info.math_info
    again = scenes.get(origin["scene"])(**origin["parameters"]).scene(origin["seed"])
    from_the_middle = list(simulate(again, 3, start=steps[5].start))
    for one, twin in zip(steps[5:], from_the_middle, strict=True):
        for a, b in zip(arrays(one), arrays(twin), strict=True):
            np.testing.assert_array_equal(a, b)
    other: Any = next(iter(simulate(family().scene(seed=6), 1)))
    assert np.any(arrays(other)[1] != arrays(steps[0])[1])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mu": -0.1}, "mu must be >= 0"),
        ({"damping": float("nan")}, "damping must be >= 0"),
        ({"beds": (Bed(block=3, face="z-", stiffness=1.0),)}, "there is no block 3, only 1"),
    ],
)
def test_nonsense_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        scene(block(), **changes)


@pytest.mark.parametrize("changes", [{"poisson": 0.5}, {"size": (1.0, 0.0, 1.0)}, {"density": 0.0}])
def test_bad_block_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="block 0"):
        scene(block(**changes))


@pytest.mark.parametrize("name", ["CubesH8", "LowWallFEM"])
def test_families_refuse_restitution(name: str) -> None:
    with pytest.raises(ValueError, match="restitution must be 0"):
        scenes.get(name)(restitution=0.5)


@pytest.mark.parametrize(
    ("module", "message"),
    [(types.SimpleNamespace(__version__="1.0"), "found 1.0"), (None, "cannot be imported")],
)
def test_another_scikit_fem_is_refused(
    monkeypatch: pytest.MonkeyPatch, module: Any, message: str
) -> None:
    monkeypatch.setitem(sys.modules, "skfem", module)
    with pytest.raises(ImportError, match=f"{message}.*pip install scikit-fem=="):
        simulate(scene(block()), 1)


def test_picture(tmp_path: Path) -> None:
    *_, step = simulate(scenes.get("CubesH8x2")().scene(), 3)
    pictures = {}
    try:
        for name, source in (("forces", step), ("bodies", step.model)):
            render(source, tmp_path / f"{name}.png", size=(120, 160))
            pictures[name] = (tmp_path / f"{name}.png").read_bytes()
    except NoRenderer as reason:
        pytest.skip(str(reason))
    assert pictures["forces"] != pictures["bodies"]
