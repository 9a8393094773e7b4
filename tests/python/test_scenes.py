"""Every family keeps the contract of scenes; none is named here but where its own facts are."""

import dataclasses
import json
from typing import Any

import numpy as np
import pytest

from fclib import scenes
from fclib.scenes.shared import mjcf

# MuJoCo has no release for the oldest Python that fclib takes
pytest.importorskip("mujoco")

from fclib.simulate import MujocoModel, Step, problem_at, scheme_of, simulate
from helpers_simulate import last_of

FAMILIES = scenes.families()


def quick(family: Any) -> scenes.Scene:
    """The default scene of a family, or a small one where that takes long."""
    scene: scenes.Scene = family(**getattr(family, "small", {})).scene(seed=0)
    return scene


def test_families_are_found() -> None:
    assert "BoxesStack" in FAMILIES
    assert scenes.get("BoxesStack") is FAMILIES["BoxesStack"]


def test_unknown_family_lists_the_known_ones() -> None:
    with pytest.raises(KeyError, match=r"'BoxStack'.*BoxesStack"):
        scenes.get("BoxStack")


@pytest.mark.parametrize("name", FAMILIES)
def test_scene_follows_from_parameters_and_seed(name: str) -> None:
    family = FAMILIES[name]
    scene = family().scene(seed=7)
    # the parameters survive a file's text
    parameters = json.loads(json.dumps(dict(scene.parameters)))
    assert family(**parameters).scene(seed=7) == scene
    assert scene.seed == 7
    assert scene.name == name


@pytest.mark.parametrize("name", FAMILIES)
def test_scene_is_simulated(name: str) -> None:
    steps = list(simulate(quick(FAMILIES[name]), 3))
    assert [step.index for step in steps] == [0, 1, 2]
    for step in steps:
        assert step.result.converged
        assert len(step.contacts) == step.problem.nc
        assert np.isfinite(step.position).all()


@pytest.mark.parametrize("boxes", [1, 2, 50])
def test_boxes_stack_has_its_boxes(boxes: int) -> None:
    model = MujocoModel(scenes.get("BoxesStack")(boxes=boxes, mass=3.0).scene())
    assert model.velocity.size == 6 * boxes
    np.testing.assert_allclose(model.model.body_mass[1:], 3.0)
    # a cube: m a^2 / 6 about each axis
    np.testing.assert_allclose(model.model.body_inertia[1:], 3.0 * 2.0**2 / 6)


def test_boxes_stack_lands_on_four_points_a_box() -> None:
    scene = scenes.get("BoxesStack")(boxes=3, gap=0.005, time_step=5e-3).scene(seed=1)
    *_, last = simulate(scene, 25)
    assert last.problem.nc == 12
    pairs, counts = np.unique(last.contacts.pair, axis=0, return_counts=True)
    np.testing.assert_array_equal(pairs, [[0, 1], [1, 2], [2, 3]])
    np.testing.assert_array_equal(counts, 4)


@pytest.mark.parametrize(("activation", "contacts"), [(0.0, 3), (1e-4, 4)])
def test_corners_of_a_face_that_touches_are_closed(activation: float, contacts: int) -> None:
    """A box that is tilted by less than the activation rests on all its corners."""
    scene = scenes.get("BoxesStack")(boxes=1, gap=0.0, activation=activation).scene(seed=0)
    model = MujocoModel(scene)
    q = model.position
    # three corners in the floor, the fourth 0.05 mm above it
    q[2] -= 5e-5
    tilt = 5e-5 / 2.0
    q[3:7] = np.array([1.0, 0.5 * tilt, -0.5 * tilt, 0.0])
    model.set_state(q, np.zeros(6))
    problem = problem_at(model, scheme_of(model), q, np.zeros(6))
    assert len(problem.contacts) == contacts
    gaps = problem.contacts.gap
    assert ((gaps > 0).sum(), gaps.max() < 1e-4) == (contacts - 3, True)


def test_activation_closes_no_gap_between_bodies_that_do_not_touch() -> None:
    scene = scenes.get("BoxesStack")(boxes=1, gap=5e-5, activation=1e-4).scene(seed=0)
    (step,) = simulate(scene, 1)
    assert step.problem.nc == 0
    with pytest.raises(ValueError, match="activation must be >= 0"):
        list(simulate(dataclasses.replace(scene, activation=-1.0), 1))


def test_frictionless_contacts_of_three_components_have_no_friction() -> None:
    scene = scenes.get("BoxesStack")(boxes=1, gap=0.0, mu=0.0).scene(seed=0)
    *_, last = simulate(scene, 3)
    assert last.problem.nc == 4
    np.testing.assert_array_equal(np.asarray(last.problem.mu), 0.0)


def test_boxes_stack_seed_draws_the_offsets() -> None:
    family: Any = scenes.get("BoxesStack")
    low, high = family(boxes=3).scene(seed=0), family(boxes=5).scene(seed=0)
    start = [MujocoModel(scene).position.reshape(-1, 7) for scene in (low, high)]
    np.testing.assert_array_equal(start[0], start[1][:3])
    assert np.abs(start[1][:, :2]).max() <= 0.05
    other = MujocoModel(family(boxes=3).scene(seed=1)).position.reshape(-1, 7)
    assert np.all(other[:, :2] != start[0][:, :2])


# ---- the scenes stand; energy never grows without cause


def places(step: Step) -> Any:
    """Where the bodies are (nb x 3) [m]; for scenes of free bodies."""
    return step.position.reshape(-1, 7)[:, :3]


def test_kaplas_tower_stands() -> None:
    family: Any = scenes.get("KaplasTower")(levels=4)
    scene = family.scene(seed=0)
    start = places(next(iter(simulate(scene, 1))))
    last = last_of(scene, 120)
    assert last.problem.nc == 4 * (12 + 2 * 3 * 12)
    moved = places(last) - start
    assert np.abs(moved[:, :2]).max() < 5e-4
    # each level has fallen by the gaps below it, and no further than a penetration
    fallen = -moved[:, 2] - family.gap * np.repeat(np.arange(1, 5), 12)
    assert np.abs(fallen).max() < 2e-4
    assert last.contacts.gap.min() > -2e-4
    assert np.abs(last.velocity).max() < 1e-3


def test_chain_hangs() -> None:
    family: Any = scenes.get("Chain")(gap=1e-3)
    last = last_of(family.scene(seed=0), 400)
    assert last.problem.n == 60
    z = places(last)[:, 2]
    pitch = (family.length - 2 * family.thickness) / family.links
    # beside the corners of two rods, which rise by 15 degrees, a link is higher by this at most
    joints = np.arange(1, family.links)
    high = 2 * family.offset * np.tan(np.pi / 12) * joints
    above = z + pitch * joints
    assert (above > -family.thickness / 50).all()
    assert (above < high + family.thickness / 50).all()
    # the tip goes on at its speed
    assert 0.8 * family.tip_speed < last.velocity[-6] < 1.2 * family.tip_speed
    assert last.contacts.gap.min() > -0.1 * family.thickness


def test_links_far_from_the_middle_lie_against_a_side() -> None:
    scene = scenes.get("Chain")(loose=0, offset=0.03, begin=0.0).scene(seed=0)
    (step,) = simulate(scene, 1)
    # each joint touches where it hangs, and some a side too
    assert len(step.contacts) > 10
    assert -2e-6 < step.contacts.gap.min() <= step.contacts.gap.max() < 1e-4


def test_chain_begins_with_links_alike_that_touch() -> None:
    scene = scenes.get("Chain")().scene(seed=0)
    m = MujocoModel(scene).model
    links = m.geom_bodyid[m.geom_bodyid > 0]
    _, counts = np.unique(links, return_counts=True)
    assert (counts == counts[0]).all()
    np.testing.assert_allclose(m.body_inertia[1:], m.body_inertia[1:2].repeat(11, axis=0))
    first, last = (list(simulate(scene, steps))[-1] for steps in (1, 31))
    # the two lowest links fall, all others touch in one point
    assert (first.problem.n, first.problem.nc) == (48, 8)
    assert np.abs(first.contacts.gap).max() < 2e-6
    assert last.index * last.model.time_step == pytest.approx(scene.begin)
    assert (last.problem.n, last.problem.nc >= 8) == (48, True)


def test_capsules_stay_in_the_box() -> None:
    family: Any = scenes.get("Capsules")(capsules=12)
    last = last_of(family.scene(seed=0), 500)
    inside = 0.5 * family.width - family.radius + 0.1
    assert np.abs(places(last)[:, :2]).max() < inside
    assert places(last)[:, 2].min() > 0.9 * family.radius
    assert last.contacts.gap.min() > -0.1 * family.radius


def test_linkages_turn_and_stay_closed() -> None:
    formulations = set()
    for step in simulate(scenes.get("FourBar")(linkages=1).scene(seed=0), 300):
        formulations.add(step.problem.formulation)
        assert step.result.converged
    # the linkage enters a problem when it touches a block
    assert formulations == {"G3DFC", "GM3DFC"}
    assert np.abs(step.model.assemble(1e-3).violation).max() < 1e-3


def test_humanoid_stands_on_stones() -> None:
    scene = scenes.get("Humanoid")().scene(seed=0)
    last = last_of(scene, 300)
    mass: Any = last.problem.M
    M = mass.toarray()
    assert np.count_nonzero(M - np.diag(np.diag(M))) > 23 * 8
    # not fallen: the trunk is near where it began
    assert last.position[2] > 0.7


def test_rolling_spheres_come_to_rest_as_a_heap() -> None:
    family: Any = scenes.get("RollingSpheres")(spheres=12, per_layer=4)
    last = last_of(family.scene(seed=0), 700)
    assert last.problem.spacedim == 5
    speed = np.abs(last.velocity.reshape(-1, 6)[:, :3]).max()
    assert speed < 0.5
    assert last.contacts.gap.min() > -0.1 * family.radius


def flat(step: Step) -> Any:
    """x, z and angle of the bodies of a planar scene, from where they began (nb x 3)."""
    return step.position.reshape(-1, 3)


def test_discs_pile_up_before_the_wall() -> None:
    family: Any = scenes.get("DiscFlow")(discs=12, per_row=3)
    scene = family.scene(seed=0)
    model = MujocoModel(scene)
    starts = model.model.body_pos[1:, [0, 2]]
    last = last_of(scene, 250)
    assert (last.problem.spacedim, last.problem.n) == (2, 3 * 12)
    x, z = (starts + flat(last)[:, :2]).T
    # the wall stands half a row's width behind the end of the ramp
    wall = 0.5 * 3 * 2.4 * family.radius
    assert x.max() < wall - (1 - family.spread) * family.radius + 0.01
    assert x.mean() > starts[:, 0].mean() + 0.5 * wall
    assert z.min() > (1 - family.spread) * family.radius - 0.01
    assert np.abs(last.velocity).max() < 0.5


def test_planar_wall_stands_until_it_is_struck() -> None:
    family: Any = scenes.get("PlanarBlocks")(courses=4, blocks=3, disc_radius=0.0)
    last = last_of(family.scene(seed=0), 100)
    # two points for each pair of edges: on the floor, and between the courses
    lying = np.abs(last.contacts.frame[:, 0, 2]) > 0.9
    pairs, points = np.unique(last.contacts.pair[lying], axis=0, return_counts=True)
    assert len(pairs) == 3 + 3 * 6
    assert points.max() == 2
    assert points.sum() >= 2 * len(pairs) - 2
    fallen = -flat(last)[:, 1]
    courses = np.repeat(np.arange(1, 5), [3, 4, 3, 4])
    # each course has fallen by the gaps below it, and no further than a penetration a course
    assert (np.abs(fallen - family.gap * courses) < 2e-4 * courses).all()
    assert np.abs(last.velocity).max() < 1e-3
    struck = last_of(scenes.get("PlanarBlocks")(courses=4, blocks=3).scene(seed=0), 150)
    assert np.abs(flat(struck)[:-1, 0]).max() > 0.02


def test_rolling_discs_come_to_rest_as_a_heap() -> None:
    family: Any = scenes.get("RollingDiscs")(discs=9, per_row=3)
    last = last_of(family.scene(seed=0), 250)
    assert last.problem.spacedim == 3
    assert last.problem.kind == "global_rolling"
    assert np.abs(last.velocity).max() < 0.5
    assert last.contacts.gap.min() > -0.1 * family.radius


# ---- grains: few of them, until they have landed

GRAINS: dict[str, tuple[dict[str, Any], int, float]] = {
    # smaller scene, steps, largest penetration for the radius
    "Spheres": ({"spheres": 27, "across": 3, "bed": 6}, 60, 0.08),
    "SpheresInABox": ({"spheres": 18, "width": 6.6}, 90, 0.08),
    "SpheresBox": ({"spheres": 18, "along_x": 3, "along_y": 3}, 60, 0.05),
    "Chute": ({"grains": 24, "across": 3, "layers": 2, "shapes": 5}, 160, 0.2),
    "Chute1000": ({"grains": 24, "across": 3, "layers": 2, "shapes": 5}, 80, 0.3),
    "RollingChute": ({"grains": 12, "across": 3, "layers": 2, "shapes": 5}, 130, 0.2),
    "PrimitiveSoup": ({"bodies": 12, "width": 4.3}, 110, 0.08),
    "RollingSoup": ({"bodies": 8, "width": 4.3}, 90, 0.08),
    "SpinSoup": ({"bodies": 8, "width": 4.3}, 90, 0.08),
    "PeriodicBox": ({"polyhedra": 18, "shapes": 5, "period": 19.0}, 80, 0.04),
}


@pytest.fixture(scope="module", params=GRAINS)
def landed(request: pytest.FixtureRequest) -> tuple[str, list[Step]]:
    """All steps of a smaller scene of grains."""
    smaller, steps, _ = GRAINS[request.param]
    scene = scenes.get(request.param)(**smaller).scene(seed=0)
    return request.param, list(simulate(scene, steps))


def test_grains_land_and_do_not_sink_into_each_other(landed: tuple[str, list[Step]]) -> None:
    name, steps = landed
    family: Any = scenes.get(name)(**GRAINS[name][0])
    assert all(step.result.converged for step in steps)
    last = steps[-1]
    # all, or nearly all, touch something
    assert last.problem.nc > 0.5 * last.problem.n / 6
    assert last.problem.n > 0.6 * len(last.velocity)
    deepest = min(step.contacts.gap.min(initial=0.0) for step in steps)
    assert -GRAINS[name][2] * family.radius < deepest
    assert last.problem.spacedim == (5 if "Rolling" in name else 4 if "Spin" in name else 3)


def test_grains_stay_inside(landed: tuple[str, list[Step]]) -> None:
    name, steps = landed
    family: Any = scenes.get(name)(**GRAINS[name][0])
    q = steps[-1].position
    centres = q[: 7 * (len(q) // 7)].reshape(-1, 7)[:, :3]
    assert centres[:, 2].min() > 0.25 * family.radius
    sides = np.abs(centres[:, :2]).max(axis=0)
    if name == "SpheresInABox" or "Soup" in name:
        assert sides.max() < 0.5 * family.width - 0.3 * family.radius
    elif name == "SpheresBox":
        # the lid came down on the spheres, and lies on them
        assert (sides <= 2.05 * family.radius * 1.5 - 0.9 * family.radius).all()
        assert -1.5 * family.radius < q[-1] < 0
    elif name == "PeriodicBox":
        assert sides.max() <= 0.5 * family.period
    elif "Chute" in name:
        width = 2.05 * family.radius * family.across
        assert sides[1] < 0.5 * width - 0.3 * family.radius
        # above the slope, before the end of the trough, and lower than at the start
        away = centres[:, [0, 2]] @ [np.sin(family.slope), np.cos(family.slope)]
        assert away.min() > 0.25 * family.radius
        assert centres[:, 0].max() < family.trough
        start = steps[0].position.reshape(-1, 7)[:, 2]
        assert centres[:, 2].mean() < 0.7 * start.mean()


def test_energy_of_grains_does_not_grow(landed: tuple[str, list[Step]]) -> None:
    _, steps = landed
    # the gap law pushes out what penetrates, and may so add a little
    tolerance = 1e-3 if steps[0].model.scene.law == "gap" else 1e-6
    model = steps[0].model
    energy = []
    for step in steps:
        model.set_state(step.position, step.start.velocity)
        energy.append(model.energy())
    assert np.diff(energy).max() < tolerance * np.abs(energy).max()


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("Spheres", {"offset": 0.3}),
        ("SpheresBox", {"load": 0.0}),
        ("SpheresBox", {"restitution": 0.5}),
        ("SpheresInABox", {"width": 1.0}),
        ("SpheresInABox", {"spread": 1.0}),
        ("Chute", {"slope": 2.0}),
        ("Chute", {"spheres": 1.5}),
        ("PeriodicBox", {"lift": -0.5}),
        ("Bridge", {"activation": -1.0}),
        ("Chute", {"thinnest": 0.5}),  # of hexahedra alone, as tilt
        ("Chute", {"tilt": 1.5, "hexahedra": True}),
        ("RollingChute", {"mu_r": -1.0}),
        ("RollingSoup", {"mu_r": -1.0}),
        ("SpinSoup", {"mu_s": -1.0}),
        ("PrimitiveSoup", {"bodies": 0}),
        ("PeriodicBox", {"period": 9.0}),
        ("PeriodicBox", {"restitution": 0.5}),
        ("RollingSoup", {"restitution": 0.5}),
        ("PeriodicBox", {"spread": 1.0}),
        ("BoxesStack", {"boxes": 0}),
        ("BoxesStack", {"size": 0.0}),
        ("BoxesStack", {"mass": -1.0}),
        ("BoxesStack", {"mu": -0.1}),
        ("BoxesStack", {"gap": -1e-3}),
        ("GearTrain", {"gears": 1}),
        ("GearTrain", {"clearance": 0.0}),
        ("ChainMail", {"across": 2}),
        ("ChainMail", {"wire": 0.02}),
        ("ChainMail", {"restitution": 0.5}),
        ("ShearBox", {"spread": 1.0}),
        ("ShearBox", {"restitution": 0.5}),
        ("Rover", {"base": 0.1}),
        ("Rover", {"restitution": 0.5}),
        ("Hand", {"fingers": 2}),
        ("Gripper", {"blocks": 0}),
        ("Gripper", {"mu": 0.0}),
        ("Pusher", {"across": 0}),
        ("Pusher", {"edge": -1.0}),
    ],
)
def test_families_refuse_nonsense(name: str, wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=f"{name}: {next(iter(wrong))}"):
        scenes.get(name)(**wrong)


@pytest.mark.parametrize("grains", [1000, 4000])
def test_chute_has_the_published_sizes(grains: int) -> None:
    scene = scenes.get(f"Chute{grains}")().scene(seed=0)
    assert scene.xml.count("<freejoint/>") == grains


@pytest.mark.parametrize(("lift", "bodies"), [(0.0, 9), (0.5, 0)])
def test_hexahedra_without_lift_begin_on_the_floor(lift: float, bodies: int) -> None:
    scene = scenes.get("PeriodicBox")(hexahedra=True, polyhedra=9, lift=lift).scene(seed=0)
    (step,) = simulate(scene, 1)
    # the four corners of each
    assert step.problem.nc == 4 * bodies


def test_grains_that_are_not_tilted_land_on_their_faces() -> None:
    small = {"grains": 9, "across": 3, "layers": 1, "shapes": 5, "hexahedra": True, "spheres": 0.0}
    scene = scenes.get("Chute")(**small, gaps=True, tilt=0.0, thinnest=0.5).scene(seed=0)
    for step in simulate(scene, 60, solver="nsgs", tol=1e-3):
        if step.problem.nc:
            break
    # the four corners of each
    assert step.problem.nc == 4 * step.problem.n / 6


def test_polyhedra_are_convex_and_neither_flat_nor_needles() -> None:
    from scipy.spatial import ConvexHull

    corners = mjcf.polyhedra(np.random.Generator(np.random.PCG64(0)), 200)
    for each in corners:
        hull = ConvexHull(each)
        assert len(hull.vertices) == 8
        # of a ball of the same radius
        assert 0.1 < hull.volume / (4 / 3 * np.pi) < 0.5


@pytest.mark.parametrize(
    ("name", "smaller"),
    [
        ("Chain", {"gap": 2e-3}),
        ("Capsules", {"capsules": 9}),
        ("KaplasTower", {"levels": 2}),
        ("BoxesStack", {"boxes": 5}),
        ("RollingSpheres", {"spheres": 12, "per_layer": 4}),
        ("DiscFlow", {"discs": 12, "per_row": 4}),
        ("PlanarBlocks", {"courses": 3, "blocks": 3, "delay": 0.05}),
        ("RollingDiscs", {"discs": 9, "per_row": 3}),
        ("Arch", {"voussoirs": 8, "thickness": 0.15, "spread": 0.0}),
        ("LowWall", {"stretchers": 2, "courses": 2, "push": 0.0}),
    ],
)
def test_energy_does_not_grow(name: str, smaller: dict[str, Any]) -> None:
    energy = np.array(
        [
            step.model.energy()
            for step in simulate(scenes.get(name)(**smaller).scene(seed=0), 250, tol=1e-10)
        ]
    )
    assert np.diff(energy).max() < 1e-7 * np.abs(energy).max()
