"""Mechanisms and robots with closed loops move as their kinematics say."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fclib import scenes
from fclib.scenes.walker import SHIN, THIGH, Walker

# MuJoCo has no release for the oldest Python that fclib takes
pytest.importorskip("mujoco")

from fclib.simulate import MujocoModel, Step, simulate
from helpers_simulate import last_of, mujoco_of


def violation(step: Step) -> float:
    """The largest violation of the bilateral constraints [m]."""
    return float(np.abs(step.model.assemble(1e-3).violation).max())


def coordinate(step: Step, joint: str) -> float:
    """A joint's coordinate from where it is 0, at the start of a step."""
    address = mujoco_of(step).joint(joint).qposadr[0]
    return float(step.position[address])


# ---- slider-cranks


def test_slider_follows_the_ideal_one_up_to_its_clearance() -> None:
    family: Any = scenes.get("SliderCrank")(sliders=2, time_step=4e-4)
    scene = family.scene(seed=3)
    model = MujocoModel(scene).model
    start = np.random.Generator(np.random.PCG64(3)).uniform(-math.pi, math.pi)
    # of a pin in a regular polygon, in its corner
    play = (family.pin + family.clearance) / math.cos(math.pi / family.sides) - family.pin
    slack = []
    turned = 0.0
    for step in simulate(scene, 280):
        turned = coordinate(step, "shaft")
        if step.index % 20 == 0:
            assert violation(step) < 0.1 * family.clearance
        for i in range(2):
            angle = start + math.pi * i + turned
            x = model.body(f"slider{i}").pos[0] + coordinate(step, f"slider{i}")
            # from the crank's pin to the slider's, which the ideal rod keeps at its length
            apart = math.hypot(x - family.crank * math.cos(angle), family.crank * math.sin(angle))
            slack.append(apart - family.rod)
    assert turned > 2 * math.pi
    slack_range = np.ptp(slack)
    assert np.abs(slack).max() < play + 2e-4
    # the pin goes from one side of the bore to the other
    assert slack_range > 1.5 * family.clearance


def test_slider_crank_needs_a_shorter_crank_than_rod() -> None:
    with pytest.raises(ValueError, match=r"crank \(0\.2\)"):
        scenes.get("SliderCrank")(crank=0.2)


# ---- closed chains


def test_closed_chains_stay_closed_and_do_not_pass_through_each_other() -> None:
    family: Any = scenes.get("ClosedChains")(chains=3, links=6)
    energy = []
    met = set()
    for step in simulate(family.scene(seed=0), 200):
        assert step.result.converged
        energy.append(step.model.energy())
        bodies = mujoco_of(step).geom_bodyid[step.contacts.pair[step.contacts.pair[:, 0] >= 0]]
        met |= {tuple(np.minimum(pair, 1)) for pair in bodies.tolist()}
    # with bodies that are fixed, and with each other
    assert met == {(0, 1), (1, 1)}
    assert step.problem.formulation == "GM3DFC"
    assert violation(step) < 1e-3
    assert step.contacts.gap.min() > -0.1 * family.radius
    # all that is lost is lost in contacts and joints
    assert np.diff(energy).max() < 1e-3 * energy[0]


# ---- robots


def test_quadruped_walks_over_uneven_ground() -> None:
    family: Any = scenes.get("Quadruped")()
    last = last_of(family.scene(seed=1), 300)
    assert last.problem.formulation == "GM3DFC"
    assert last.position[0] > 0.5
    assert abs(last.position[1]) < 0.2
    # upright
    _, x, y, _ = last.position[3:7]
    assert 1 - 2 * (x * x + y * y) > 0.95
    assert violation(last) < 1e-3
    # four loops of three rows, none redundant
    G: Any = last.problem.G
    assert np.linalg.matrix_rank(G.toarray()) == 12


def test_carrier_stands_with_its_bar_on_uneven_ground() -> None:
    last = last_of(scenes.get("Carrier")().scene(seed=0), 250)
    assert last.problem.formulation == "GM3DFC"
    # two hands, three rows each, none redundant
    G: Any = last.problem.G
    assert np.linalg.matrix_rank(G.toarray()) == 6
    assert violation(last) < 1e-3
    # not fallen: the trunk is near where it began
    assert last.position[2] > 0.7


@given(st.sampled_from([1, -1]), st.floats(0, 3), st.floats(1.2, 1.9), st.floats(0, 0.35))
def test_legs_of_the_walker_reach_what_is_planned(
    side: int, time: float, height: float, stride: float
) -> None:
    family = Walker(height=height, stride=stride)
    roll, pitch, knee, ankle, foot = family.angles(side, time)
    assert 0 < knee < 2.4
    assert pitch + knee + ankle == pytest.approx(0, abs=1e-12)
    assert roll + foot == 0
    # thigh and shin hang down and turn about y, then all turns about x
    lengths, angles = height / 1.7 * np.array([THIGH, SHIN]), np.array([pitch, pitch + knee])
    x, down = -lengths @ np.sin(angles), lengths @ np.cos(angles)
    reached = [x, down * math.sin(roll), -down * math.cos(roll)]
    np.testing.assert_allclose(reached, family.ankle(side, time), atol=1e-12)


def test_plan_of_the_walker_leaves_a_foot_where_it_stands() -> None:
    family = Walker()
    times = np.linspace(0, 2 * family.period, 481)
    trunk = np.array([[family.stride * t / family.period, family.trunk(t), 0.0] for t in times])
    aloft = {}
    for side in (1, -1):
        foot = trunk + [family.ankle(side, t) for t in times]
        stands = foot[:, 2] < foot[:, 2].min() + 1e-9
        aloft[side] = ~stands
        assert stands.mean() == pytest.approx(1 - family.airborne, abs=0.02)
        # in one place until the next step, which is a stride ahead
        places = np.unique(foot[stands, 0].round(9))
        assert len(places) >= 2
        np.testing.assert_allclose(np.diff(places), family.stride)
        assert np.ptp(foot[:, 1]) < 1e-12
        assert foot[:, 2].max() - foot[:, 2].min() == pytest.approx(family.lift, abs=1e-3)
    assert not (aloft[1] & aloft[-1]).any()
    # the zero moment point is over the foot that stands
    height = -family.ankle(1, 0.0)[2] + 0.1
    point = trunk[1:-1, 1] - height / family.gravity * np.diff(trunk[:, 1], 2) / times[1] ** 2
    np.testing.assert_allclose(np.abs(point).max(), family.sway, rtol=1e-3)
    assert point[aloft[-1][1:-1]].min() > 0
    assert point[aloft[1][1:-1]].max() < 0


def test_walker_that_cannot_reach_is_refused() -> None:
    with pytest.raises(ValueError, match="do not reach the feet's way"):
        Walker(stride=3.0)
    with pytest.raises(ValueError, match=r"airborne must be < 0\.5"):
        Walker(airborne=0.5)


@pytest.mark.parametrize("roughness", [0.0, 0.01])
def test_walker_walks(roughness: float) -> None:
    family = Walker(roughness=roughness)
    steps = 450
    loaded: dict[str, list[bool]] = {"left": [], "right": []}
    for step in simulate(family.scene(), steps):
        normal = np.reshape(step.result.solution.r, (-1, 3))[:, 0]
        for side, record in loaded.items():
            sole = mujoco_of(step).body(f"foot.{side}").geomadr[0]
            on = (step.contacts.pair == sole).any(axis=1)
            record.append(bool(normal[on].sum() > 0))
    assert step.problem.formulation == "GM3DFC"
    # each foot is lifted for its share of the time and carries the body for more
    for record in loaded.values():
        assert 0.15 < 1 - np.mean(record) < 0.5
    # nearly as far as planned, and upright
    way = family.stride / family.period * steps * family.time_step
    assert 0.6 * way < step.position[0] < 1.4 * way
    _, x, y, _ = step.position[3:7]
    assert 1 - 2 * (x * x + y * y) > 0.98
    assert violation(step) < 1e-3


# ---- a biped with closed loops, whose knees are locked beyond their limits


def leg(side: str, sign: int) -> str:
    """A rod from the thigh to the shin locks the knee; a crank and a link move the foot."""
    y = 0.12 * sign
    return f"""
    <body name="{side}-hip" pos="0 {y} -.05">
      <joint name="{side}-roll" axis="1 0 0" range="-20 20" damping="1" armature=".03"/>
      <geom type="sphere" size=".05" mass="1.5" class="bare"/>
      <body name="{side}-thigh" pos="0 0 -.05">
        <joint name="{side}-pitch" axis="0 1 0" range="-50 60" damping="1" armature=".09"/>
        <geom type="capsule" size=".04" fromto="0 0 0 .02 0 -.3" mass="3" class="bare"/>
        <body name="{side}-rod" pos="-.05 {0.02 * sign} 0">
          <joint name="{side}-rod" type="ball" damping=".01"/>
          <geom type="capsule" size=".01" fromto="0 0 0 -.03 {0.013 * sign} -.3" mass=".15"
            class="bare"/>
        </body>
        <body name="{side}-shin" pos=".02 0 -.3">
          <joint name="{side}-knee" axis="0 1 0" range="5 120" damping="1" armature=".09"/>
          <geom type="capsule" size=".03" fromto="0 0 0 -.1 0 -.02" mass=".4" class="bare"/>
          <geom type="capsule" size=".03" fromto="0 0 0 .05 0 -.3" mass=".6" class="bare"/>
          <body name="{side}-foot" pos=".05 0 -.3">
            <joint name="{side}-ankle" axis="0 1 0" range="-40 40" damping=".5" stiffness="80"/>
            <geom type="box" size=".1 .04 .02" mass=".4" friction=".7"/>
          </body>
          <body name="{side}-crank" pos=".02 {0.06 * sign} -.05">
            <joint name="{side}-crank" axis="0 1 0" range="-30 30" damping=".05"/>
            <geom type="capsule" size=".01" fromto="0 0 0 .06 0 0" mass=".1" class="bare"/>
            <body name="{side}-link" pos=".06 0 0">
              <joint name="{side}-link" axis="0 1 0"/>
              <geom type="capsule" size=".01" fromto="0 0 0 .02 0 -.24" mass=".1" class="bare"/>
            </body>
          </body>
        </body>
      </body>
    </body>"""


def biped(height: float) -> str:
    """Falls from a height of its pelvis [m]."""
    loops = "".join(
        f'<connect body1="{side}-rod" body2="{side}-shin" anchor="-.03 {0.013 * sign} -.3"/>'
        f'<connect body1="{side}-link" body2="{side}-foot" anchor=".02 0 -.24"/>'
        for side, sign in (("left", 1), ("right", -1))
    )
    return f"""<mujoco><option timestep=".0005"/><compiler autolimits="true"/>
    <default><default class="bare"><geom contype="0" conaffinity="0"/></default></default>
    <worldbody><geom type="plane" size="5 5 .1" friction=".7"/>
      <body name="pelvis" pos="0 0 {height}"><freejoint/>
        <geom type="box" size=".1 .15 .08" mass="10" class="bare"/>
        {leg("left", 1)}{leg("right", -1)}
      </body>
    </worldbody><equality>{loops}</equality></mujoco>"""


@pytest.mark.parametrize("height", [0.75, 0.95])
def test_a_robot_with_locked_knees_moves_as_mujocos_does(height: float) -> None:
    """Loops hold the knees where their limits push: a block of W that is rounding."""
    mujoco: Any = pytest.importorskip("mujoco")
    xml = biped(height)
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    fastest, farthest = 1e-3, 1e-3
    for _ in range(1000):
        mujoco.mj_step(model, data)
        fastest = max(fastest, float(np.abs(data.qvel).max()))
        farthest = max(farthest, float(np.abs(data.qpos).max()))
    unsolved = 0
    for step in simulate(scenes.Scene(name="biped", xml=xml), 1000, tol=1e-8):
        assert np.abs(step.velocity).max() <= 100 * fastest, step.index
        assert np.abs(step.position).max() <= 100 * farthest, step.index
        assert np.abs(step.result.solution.r).max(initial=0.0) <= 1e3, step.index
        if step.result.converged:
            continue
        # named, and nothing but the rounding of a free fall, in which no contact moves
        unsolved += 1
        assert step.result.status in ("stalled", "inaccurate"), step.index
        assert np.linalg.norm(step.problem.condense().q) <= 1e-12, step.index
        assert step.result.error * np.linalg.norm(step.problem.condense().q) <= 1e-11, step.index
    assert unsolved <= 100  # rounding decides which
