"""States whose bodies are deep in each other are mended, and mended a little."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fclib import collections, scenes
from fclib.collections import published, set_index, trajectory

pytest.importorskip("mujoco")

from fclib.simulate import model_of, problem_at, relaxed, scheme_of

BOUND = 0.02


def scene(bodies: str, **settings: Any) -> scenes.Scene:
    """Bodies above a floor, without gravity."""
    xml = f"""<mujoco><option gravity="0 0 0"/><worldbody>
        <geom type="plane" size="5 5 1"/>{bodies}</worldbody></mujoco>"""
    return scenes.Scene(name="deep", xml=xml, time_step=1e-3, **settings)


def sphere(x: float, z: float, radius: float = 0.1) -> str:
    return (
        f'<body pos="{x} 0 {z}"><freejoint/><geom type="sphere" size="{radius}" density="1000"/>'
        "</body>"
    )


def depth(model: Any, scheme: Any, position: Any, velocity: Any) -> float:
    """The largest penetration, of the diameter of the smallest body."""
    gap = problem_at(model, scheme, position, velocity).contacts.gap
    return float(-gap.min(initial=0.0) / (2 * model.smallest_size))


def pairs(model: Any, scheme: Any, position: Any, velocity: Any) -> set[tuple[int, ...]]:
    """Which geometries are in contact."""
    contacts = problem_at(model, scheme, position, velocity).contacts
    return {tuple(pair) for pair in contacts.pair.tolist()}


def test_spheres_in_the_air_keep_their_centre_of_mass() -> None:
    """Of two that are a quarter in each other the lighter one moves more."""
    own = scene(sphere(0.0, 1.0) + sphere(0.225, 1.0, 0.2) + sphere(-0.2001, 1.0))
    model = model_of(own)
    scheme, v = scheme_of(model), model.velocity
    start = model.position
    assert depth(model, scheme, start, v) == pytest.approx(0.375)
    q = relaxed(model, scheme, start, v, BOUND)
    assert depth(model, scheme, q, v) < BOUND
    assert pairs(model, scheme, q, v) >= pairs(model, scheme, start, v)
    places, before = np.reshape(q, (3, 7))[:, :3], np.reshape(start, (3, 7))[:, :3]
    mass = np.array([1.0, 8.0, 1.0])
    assert mass @ places == pytest.approx(mass @ before, abs=1e-9)
    # nor does anything turn, or leave the line
    assert places[:, 1:] == pytest.approx(before[:, 1:], abs=1e-9)
    assert places[0, 0] < -0.05 < 0.015 > places[1, 0] - before[1, 0] > 0.0


def test_what_touches_goes_on_touching() -> None:
    """A sphere deep in the floor lifts the one that rests on it, and the one beside comes along."""
    own = scene(sphere(0.0, 0.04) + sphere(0.0, 0.24) + sphere(0.199, 0.04))
    model = model_of(own)
    scheme, v = scheme_of(model), model.velocity
    start = model.position
    q = relaxed(model, scheme, start, v, BOUND)
    assert depth(model, scheme, q, v) < BOUND
    assert pairs(model, scheme, q, v) == pairs(model, scheme, start, v)
    assert len(pairs(model, scheme, q, v)) == 4


def test_a_state_within_the_bound_stays() -> None:
    model = model_of(scene(sphere(0.0, 0.097) + sphere(0.0, 0.294)))
    start = model.position
    assert relaxed(model, scheme_of(model), start, model.velocity, BOUND) is start
    tighter = relaxed(model, scheme_of(model), start, model.velocity, BOUND / 4)
    assert 0.098 < tighter[2] < 0.1


def test_wedged_bodies_are_no_deeper_than_before() -> None:
    """A sphere between two walls that are too near to each other."""
    wall = '<geom type="box" size="0.1 1 1" pos="{} 0 1"/>'
    model = model_of(scene(sphere(0.0, 0.5) + wall.format(0.18) + wall.format(-0.17)))
    scheme, v = scheme_of(model), model.velocity
    q = relaxed(model, scheme, model.position, v, BOUND)
    assert BOUND < depth(model, scheme, q, v) < 0.15 + 1e-9


def test_joints_hold_while_bodies_are_moved_apart() -> None:
    """A bar on two hinges that close a loop, one end of it in the floor."""
    own = scene(
        """<body name="a" pos="0 0 0.06"><freejoint/>
             <geom type="capsule" fromto="0 0 0 1 0 0" size="0.1"/></body>
           <body name="b" pos="1 0 0.06"><freejoint/>
             <geom type="capsule" fromto="0 0 0 1 0 0.4" size="0.1"/></body>
           </worldbody><contact><exclude body1="a" body2="b"/></contact>
           <equality><connect body1="a" body2="b" anchor="1 0 0"/></equality><worldbody>"""
    )
    model = model_of(own)
    scheme, v = scheme_of(model), model.velocity
    q = relaxed(model, scheme, model.position, v, BOUND)
    assert depth(model, scheme, q, v) < BOUND
    model.set_state(q, v)
    assert np.abs(scheme.assemble(model).violation).max() < 1e-5


@pytest.mark.parametrize(("name", "coordinates", "height"), [("Discs", 3, 1), ("Spheres", 7, 2)])
def test_bodies_that_sank_into_a_floor_are_mended(name: str, coordinates: int, height: int) -> None:
    """In the plane and with rolling friction: contacts and velocities stay as they are."""
    path = published.path_of(f"tiny/Rolling{name}", "1")
    if path is None:
        pytest.skip("collection/ is not here: a source distribution")
    states = trajectory.read(path)
    model, scheme = states.model, states.scheme
    position, v = states.position[0].copy(), states.velocity[0]
    assert model.smallest_size is not None
    position.reshape(-1, coordinates)[:, height] -= 0.03 * model.smallest_size
    assert depth(model, scheme, position, v) > 1.2 * BOUND
    q = relaxed(model, scheme, position, v, BOUND)
    assert depth(model, scheme, q, v) < BOUND
    assert pairs(model, scheme, q, v) == pairs(model, scheme, position, v)
    assert np.abs(q - position).max() < 0.03 * model.smallest_size


def test_states_are_relaxed_before_they_are_stored(tmp_path: Path) -> None:
    """Spheres that fall fast; what is simulated is not relaxed."""
    own = scene(sphere(0.0, 0.4) + sphere(0.0, 0.64))
    own = scenes.Scene(name="fall", xml=own.xml.replace("0 0 0", "0 0 -9.81", 1), time_step=0.02)

    def depths(deepest: float | None) -> list[float]:
        plan = collections.Plan(
            scene=own,
            collection="own",
            version="own",
            problems=3,
            simulation=collections.Simulation(deepest=deepest),
        )
        target = tmp_path / f"{deepest}{trajectory.SUFFIX}"
        collections.record(plan, target, tmp_path / "checkpoint.npz")
        states = trajectory.read(target)
        assert states.origin["settings"].get("deepest") == deepest
        parts: list[Any] = [states.problem(k) for k in range(len(states))]
        return [-float(part.contacts.gap.min()) / 0.2 for part in parts]

    fallen = depths(None)
    assert max(fallen) > 2 * BOUND
    stored = depths(BOUND)
    assert len(stored) == len(fallen)
    assert max(stored) <= BOUND


def test_stored_states_of_fast_grains_say_how_deep_they_may_be() -> None:
    for folder in ("standard/Chute", "rr9118/Chute4000", "tiny/RollingDiscs"):
        path = published.path_of(folder, set_index.version_of(folder))
        if path is None:
            pytest.skip("collection/ is not here: a source distribution")
        assert trajectory.read_origin(path)[1]["settings"]["deepest"] == BOUND
