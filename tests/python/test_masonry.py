"""Masonry stands where limit analysis says so, falls where not, and rests on four points a face."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fclib import scenes
from fclib.scenes.shared import masonry, mjcf

# MuJoCo has no release for the oldest Python that fclib takes
pytest.importorskip("mujoco")

from fclib.simulate import Step, simulate
from helpers_simulate import last_of, mujoco_of


def places(step: Step) -> npt.NDArray[np.float64]:
    """Where the free stones are (nb x 3) [m]; supports that move come last."""
    free = len(step.velocity) // 6
    return step.position[: 7 * free].reshape(-1, 7)[:, :3]


def weight(step: Step) -> float:
    """Of the free stones [N]."""
    model = mujoco_of(step)
    free = len(step.velocity) // 6
    return float(model.body_mass[1 : 1 + free].sum() * -model.opt.gravity[2])


# ---- outlines


@given(
    st.lists(st.floats(0, 2 * math.pi), min_size=3, max_size=8, unique_by=lambda a: round(a, 1)),
    st.floats(0, 0.5),
)
def test_grown_outline_moves_every_side(angles: list[float], distance: float) -> None:
    outline = [masonry.on_circle(2.0, angle) for angle in sorted(angles)]
    for (x, z), (a, b), (c, d) in zip(
        masonry.grown(outline, distance), outline, [*outline[1:], outline[0]], strict=True
    ):
        normal = np.array([d - b, a - c]) / math.hypot(d - b, a - c)
        # to the right of a side that runs counterclockwise is outside
        assert normal @ (x - a, z - b) == pytest.approx(distance, abs=1e-9)


def test_cut_outline_loses_its_corners() -> None:
    square = masonry.rectangle(0, 2, 0, 1)
    shape = masonry.cut(square, 0.1)
    assert len(shape) == 8
    assert masonry.area(shape) == pytest.approx(2 - 4 * 0.5 * 0.1**2)


def test_ring_is_a_polygon_of_its_thickness() -> None:
    outlines = masonry.ring(2.0, 0.3, 0.0, math.pi, 7)
    # sin(2 phi) / 2 (R^2 - r^2) for each voussoir of half angle phi
    each = 0.5 * math.sin(math.pi / 7) * (2.15**2 - 1.85**2)
    np.testing.assert_allclose([masonry.area(outline) for outline in outlines], each)


# ---- arches


def test_arch_rests_on_the_corners_of_its_joints() -> None:
    family: Any = scenes.get("Arch")(voussoirs=6, spread=0.0)
    step = next(iter(simulate(family.scene(), 1)))
    contacts = step.contacts
    pairs, counts = np.unique(contacts.pair, axis=0, return_counts=True)
    assert len(pairs) == 7
    np.testing.assert_array_equal(counts, 4)
    np.testing.assert_allclose(contacts.gap, -family.lap, atol=1e-7)
    radii = np.hypot(contacts.point[:, 0], contacts.point[:, 2] - family.springing)
    edges = family.radius + 0.5 * family.thickness * np.array([-1, 1])
    assert np.abs(radii[:, None] - edges).min(axis=1).max() < 1e-4
    np.testing.assert_allclose(np.abs(contacts.point[:, 1]), 0.5 * family.depth, atol=1e-4)


@pytest.mark.parametrize(("ratio", "stands"), [(0.115, True), (0.1, False)])
def test_semicircular_arch_stands_above_couplets_thickness(ratio: float, stands: bool) -> None:
    # 0.1075 in the limit of thin voussoirs (Milankovitch), R the radius of the middle line
    family: Any = scenes.get("Arch")(
        voussoirs=20, radius=2.0, thickness=2.0 * ratio, spread=0.0, time_step=1e-2
    )
    scene = family.scene()
    start = places(next(iter(simulate(scene, 1))))
    # each step from nothing: from a guess it may be another solution, which moves a little
    last = last_of(scene, 50, warm_start=False)
    moved = np.abs(places(last) - start).max()
    if stands:
        assert moved < 1e-5
        assert np.abs(last.velocity).max() < 1e-6
    else:
        assert moved > 0.02
        assert np.abs(last.velocity).max() > 0.1


def test_arch_carries_its_weight_and_thrusts() -> None:
    step = last_of(scenes.get("Arch")(voussoirs=10, spread=0.0).scene(), 3)
    # impulses on the second body of each pair; the supports are the last two geometries
    r = np.reshape(step.result.solution.r, (-1, 3))
    force = np.einsum("cij,ci->cj", step.contacts.frame, r) / step.model.time_step
    support = step.contacts.pair.max() - np.array([1, 0])
    on = [force[step.contacts.pair[:, 1] == one].sum(axis=0) for one in support]
    np.testing.assert_allclose(-(on[0] + on[1])[2], weight(step), rtol=1e-6)
    # the left support is pushed to the left, the right one as much to the right
    np.testing.assert_allclose(on[0][0], -on[1][0], rtol=1e-6)
    assert on[0][0] < -0.1 * weight(step)


def hinges(family: Any, first: Step, last: Step) -> dict[tuple[int, int], str]:
    """The joints of an arch that turn about an edge, by their two geometries, and which edge.

    Those where the normal reactions on the other edge are less than 1/1000 of all.
    """
    contacts = last.contacts
    free = len(last.velocity) // 6
    start, now = (step.position[: 7 * free].reshape(-1, 7) for step in (first, last))
    # points go back, with their stone, to where it was laid: there the edges have their radii
    stone = contacts.pair.min(axis=1) - 1
    turned = [Rotation.from_quat(np.roll(pose[stone, 3:], -1, axis=1)) for pose in (start, now)]
    laid = start[stone, :3] + (turned[0] * turned[1].inv()).apply(contacts.point - now[stone, :3])
    radius = np.hypot(laid[:, 0], laid[:, 2] - family.springing)
    # half a thickness from the middle line, where a stone has not slid on the next one
    away = np.abs(radius - family.radius)
    np.testing.assert_allclose(away, 0.5 * family.thickness, rtol=0.1)
    normal = np.reshape(last.result.solution.r, (-1, 3))[:, 0]
    found = {}
    for pair in np.unique(contacts.pair, axis=0).tolist():
        joint = (contacts.pair == pair).all(axis=1)
        outer = normal[joint & (radius > family.radius)].sum() / normal[joint].sum()
        if min(outer, 1 - outer) < 1e-3:
            found[tuple(pair)] = "outer" if outer > 0.5 else "inner"
    return found


@pytest.mark.parametrize(
    ("spread", "expected"),
    # voussoirs are 1 to 10: both haunches turn on their inner edges, the crown on its outer one.
    # on fixed supports many lines of thrust are possible; the solver's touches no edge
    [(0.2, {(2, 3): "inner", (5, 6): "outer", (8, 9): "inner"}), (0.0, {})],
)
def test_arch_cracks_into_hinges_where_its_supports_spread(
    spread: float, expected: dict[tuple[int, int], str]
) -> None:
    family: Any = scenes.get("Arch")(voussoirs=10, time_step=1e-2, spread=spread)
    # each step from nothing: a solution that moves a little shifts points off their corners
    first, *_, last = simulate(family.scene(), 60, warm_start=False)
    if spread:
        np.testing.assert_allclose(last.position[-1], 59 * 1e-2 * spread, rtol=1e-2)
    assert len(np.unique(last.contacts.pair, axis=0)) == 11
    assert hinges(family, first, last) == expected
    # it stands on its hinges: nothing is faster than a few times the spread
    assert np.abs(last.velocity).max() < max(5 * spread, 1e-5)
    assert places(last)[:, 2].max() > 0.9 * (family.springing + family.radius)


# ---- walls


def test_low_wall_stands_on_more_contacts_than_it_needs() -> None:
    family: Any = scenes.get("LowWall")(push=0.0)
    scene = family.scene()
    first, *_, last = simulate(scene, 10)
    assert 3 * first.problem.nc > 6 * first.problem.n
    assert np.abs(places(last) - places(first)).max() < 1e-6
    assert np.abs(last.velocity).max() < 1e-6


def test_low_wall_has_no_gaps_and_no_overlaps() -> None:
    family: Any = scenes.get("LowWall")(stretchers=4, courses=4, push=0.0)
    step = next(iter(simulate(family.scene(), 1)))
    volume = 4 * family.height * 4.5 * family.length * family.length
    np.testing.assert_allclose(weight(step), volume * family.density * family.gravity, rtol=1e-3)
    np.testing.assert_allclose(step.contacts.gap.max(), step.contacts.gap.min(), rtol=0.6)


def test_ram_pushes_the_upper_courses() -> None:
    family: Any = scenes.get("LowWall")(stretchers=2, courses=3, push=1.0)
    scene = family.scene()
    first, *_, last = simulate(scene, 25)
    moved = (places(last) - places(first))[:, 1]
    ram = last.position[-1]
    np.testing.assert_allclose(ram, 24 * family.time_step, rtol=1e-2)
    # the ram was 0.1 lengths away
    assert moved.max() == pytest.approx(ram - 0.1 * family.length, abs=0.02)
    assert abs(moved[0]) < 0.01
    assert last.contacts.gap.min() > -0.02


# ---- bridges and aqueducts


def test_arcade_is_filled_without_gaps() -> None:
    arcade = masonry.Arcade(
        spans=2,
        voussoirs=9,
        radius=1.5,
        thickness=0.3,
        start=0.0,
        between=0.15,
        base=1.0,
        cover=0.15,
        slab=0.15,
        slabs=7,
    )
    # all that is above the springings, less the polygons below the rings
    whole = 2 * arcade.end * (arcade.top - arcade.base)
    opening = 9 * 0.5 * math.sin(math.pi / 9) * arcade.inner**2
    total = sum(masonry.area(outline) for _, outline in arcade.stones())
    assert total == pytest.approx(whole - 2 * opening)


@pytest.mark.parametrize("speeds", [(0.1, 0.0, 0.2), (0.0, 0.1, 0.0), (0.2, 0.1, 0.3)])
def test_supports_do_not_touch_each_other(speeds: tuple[float, ...]) -> None:
    """Whichever of them are driven, and in whatever order they are set."""
    built = masonry.Masonry(density=2000.0, mu=0.5, lap=1e-5)
    built.stone("stone", masonry.rectangle(0.0, 3.0, 1.0, 1.5), 0.0, 1.0, "1 1 1 1")
    for i, speed in enumerate(speeds):
        outline = masonry.rectangle(0.9 * i, 0.9 * i + 1.0, 0.0, 1.0)
        built.support(f"support{i}", [outline], 0.0, 1.0, speed=speed)
    xml = mjcf.document(
        "supports",
        bodies=built.bodies,
        assets=built.assets,
        time_step=1e-3,
        gravity=9.81,
        floor_mu=0.5,
        tile=1.0,
        rest=[*built.rest, *built.keyframe()],
    )
    (step,) = simulate(scenes.Scene(name="supports", xml=xml), 1)
    m = mujoco_of(step)
    assert len(step.contacts)
    assert (m.geom_bodyid[step.contacts.pair] == m.body("stone").id).any(axis=1).all()


@pytest.mark.parametrize(
    ("name", "still"),
    [
        ("Bridge", {"spread": 0.0, "load": 0.0}),
        ("Aqueduct", {"spans": 2, "settlement": 0.0}),
        ("Aqueduct", {"spans": 2, "tiers": 1, "settlement": 0.0, "split": True}),
    ],
)
def test_masonry_stands_on_supports_that_stay(name: str, still: dict[str, Any]) -> None:
    scene = scenes.get(name)(**still).scene()
    first, *_, last = simulate(scene, 5)
    assert np.abs(places(last) - places(first)).max() < 1e-6
    assert np.abs(last.velocity).max() < 1e-6
    # every joint is closed from the start, and none by more than the lap
    lap = scene.parameters["lap"]
    np.testing.assert_allclose(first.contacts.gap, -lap, rtol=0.05)
    # diagonal stones do not touch: a face has at least four corners
    _, counts = np.unique(first.contacts.pair, axis=0, return_counts=True)
    assert counts.min() >= 4


def test_aqueduct_divided_across_has_the_contact_density_of_the_published_one() -> None:
    family: Any = scenes.get("Aqueduct")(spans=2, settlement=0.0, split=True)
    step = next(iter(simulate(family.scene(), 1)))
    assert 3 * step.problem.nc > 6 * step.problem.n


def test_wagon_crosses_a_bridge_that_stands() -> None:
    family: Any = scenes.get("Bridge")(spread=0.0, load=1000.0, speed=4.0)
    scene = family.scene()
    first, *_, last = simulate(scene, 90)
    wagon = (last.position - first.position)[-7:-4]
    # its wheels lose speed at the joints of the deck, never gain any
    assert 0.95 < wagon[0] / (89 * family.time_step * family.speed) < 1 + 1e-9
    assert abs(wagon[2]) < 0.01
    # its wheels are the only contacts without friction
    assert set(last.problem.mu) == {0.0, family.mu}
    stones = places(last)[:-1] - places(first)[:-1]
    assert np.abs(stones).max() < 0.01


def test_bridge_fails_where_its_abutment_gives_way() -> None:
    family: Any = scenes.get("Bridge")(spread=1.0, time_step=1e-2)
    scene = family.scene()
    first, *_, last = simulate(scene, 70)
    fallen = (places(first) - places(last))[:, 2]
    assert fallen.max() > 0.3
    assert last.contacts.gap.min() > -0.03
