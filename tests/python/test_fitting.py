"""Pins in holes and a cable on a drum: what statics says of jamming and of the capstan."""

import itertools
import json
import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

import fclib
from fclib.scenes import assemblies
from fclib.scenes.capstan import NODES, TURNS, Capstan, nodes_of
from fclib.scenes.peg_in_hole import PITCH, PegInHole
from fclib.scenes.shared import assembly
from helpers import converged


def facts(problem: Any) -> dict[str, Any]:
    return dict(json.loads(problem.info.description))


# ---- pins


def carried(problem: Any) -> bool:
    """Whether some reactions in the cones carry the push at rest, in the plane of the push."""
    # T1 or T2 is along the pins; the other one is across, where nothing acts
    frame_rows = np.array([3 * i + k for i in range(problem.nc) for k in range(3)])
    up = np.abs(problem.H[2].toarray().ravel()) > 0.5  # what pushes along z
    normal = np.zeros(3 * problem.nc, bool)
    normal[0::3] = True
    own = frame_rows[normal | up]
    H = problem.H.toarray()[[0, 2, 4]][:, own]
    f = problem.f[[0, 2, 4]]
    # |r_T| <= mu r_N of each contact, r_N first
    rows = []
    for i in range(problem.nc):
        for sign in (1.0, -1.0):
            row = np.zeros(2 * problem.nc)
            row[2 * i], row[2 * i + 1] = -problem.mu[i], sign
            rows.append(row)
    bounds = [(0, None), (None, None)] * problem.nc
    scale = np.abs(f).max()
    found = linprog(
        np.zeros(2 * problem.nc), rows, np.zeros(len(rows)), H, -f / scale, bounds=bounds
    )
    return bool(found.status == 0)


def wedging(own: PegInHole, pins: int) -> float:
    """The depth up to which pins wedge, in widths."""
    return own.mu * (PITCH * (pins - 1) + 1)


@pytest.mark.parametrize("pins", [1, 2, 3])
@pytest.mark.parametrize("deeper", [1.02, 1.5, 4.0])
def test_push_is_carried_from_whitneys_offset_on(pins: int, deeper: float) -> None:
    own = PegInHole()
    for offset, holds in ((0.99, False), (1.01, True)):
        problem = own.of_pins(pins, deeper * wedging(own, pins), offset, np.zeros(pins**2))
        assert not facts(problem)["wedges"]
        assert problem.nc == 4 * pins**2
        assert carried(problem) == holds


@pytest.mark.parametrize("pins", [1, 3])
def test_wedged_pins_carry_any_push(pins: int) -> None:
    own = PegInHole()
    for offset in (-3.0, 0.0, 0.9, 2.0):
        problem = own.of_pins(pins, 0.98 * wedging(own, pins), offset, np.zeros(pins**2))
        assert facts(problem)["wedges"]
        assert carried(problem)


def test_planted_rest_of_one_pin_is_a_solution() -> None:
    own = PegInHole()
    problem = own.of_pins(1, 3.0, 1.0 / 0.8, np.zeros(1))
    e, L = facts(problem)["offset"], facts(problem)["depth"]
    h = assembly.STEP
    N = own.force * e / L  # of each side, on two corners
    r = np.zeros((4, 3))
    frames = np.cross(problem.contacts.normal, problem.contacts.tangent)
    for i in range(4):
        r[i, 0] = h * N / 2
        lifts = np.array([problem.contacts.tangent[i, 2], frames[i, 2]])
        r[i, 1:] = h * own.force / 4 * lifts
    np.testing.assert_allclose(problem.H @ r.ravel() + problem.f, 0, atol=1e-12)
    merit = fclib.merit(problem, fclib.Solution(v=np.zeros(6), r=r.ravel()))
    assert merit.natural < 1e-12
    assert merit.stick == 4
    # less friction would not do
    slippery = problem.replace(mu=0.79 * problem.mu)
    assert fclib.merit(slippery, fclib.Solution(r=r.ravel())).error > 1e-3


def test_free_connector_slides_in_and_friction_slows_it() -> None:
    own = PegInHole()
    problem = own.of_pins(2, 3.0, 0.5, np.zeros(4))
    result = converged(problem, tol=1e-9)
    r = np.reshape(result.solution.r, (-1, 3))
    lifted = problem.H[2] @ result.solution.r
    assert result.solution.v is not None
    assert result.solution.v[2] == pytest.approx(
        (lifted - own.force * assembly.STEP) / own.mass, rel=1e-6
    )
    assert result.solution.v[2] < 0 < lifted
    assert np.all(np.linalg.norm(r[:, 1:], axis=1) <= own.mu * r[:, 0] * (1 + 1e-6) + 1e-12)


def test_contacts_lie_in_their_holes_and_on_their_shapes() -> None:
    own = PegInHole()
    problem = own.of_pins(3, 1.0, 0.9, np.linspace(0, 1e-5, 9))
    D = own.width
    near = np.abs(problem.contacts.point[:, :2] / (PITCH * D) - [0.0, 0.0])
    hole = np.rint(near)
    np.testing.assert_allclose(np.abs(near - hole) * PITCH, 0.5, atol=1e-9)
    assert set(problem.contacts.point[:, 2].tolist()) == {0.0, -D}
    shape = problem.contacts.shape
    bodies = problem.bodies
    kinds = bodies.shape_body[shape]
    assert (kinds == [0, 1]).all()
    for (plate, pin), point in zip(shape.tolist(), problem.contacts.point, strict=True):
        for one, slack in ((plate, 1e-9), (pin, 0.05 * D)):
            away = np.abs(point - bodies.place[bodies.shape_body[one]] - bodies.shape_place[one])
            assert np.all(away <= bodies.shape_size[one] + slack), (plate, pin)
    np.testing.assert_allclose(problem.w[0::3], problem.contacts.gap / assembly.STEP)


# ---- the capstan


def rest(turns: float, of_a_turn: int) -> Any:
    return np.zeros((nodes_of(turns, of_a_turn), 3))


@pytest.mark.parametrize(("turns", "of_a_turn"), list(itertools.product(TURNS[:3], NODES)))
def test_tensions_in_a_series_hold_the_cable_up_to_the_limit(turns: float, of_a_turn: int) -> None:
    own = Capstan()
    for pull, holds in ((0.999, True), (1.001, False)):
        problem = own.wound(turns, of_a_turn, pull, rest(turns, of_a_turn))
        count = problem.nc
        known = facts(problem)
        # a tension that grows alike at each mass; lambda pushes, tensions pull
        tension = own.held * (known["pull"] / own.held) ** (np.arange(count + 1) / count)
        pushes = -assembly.STEP * tension[1:-1]
        r = problem.H.T @ -(problem.G @ pushes + problem.f)
        merit = fclib.merit(problem, fclib.Solution(v=np.zeros(problem.n), r=r, l=pushes))
        # no force but tensions acts in the middle: what they round to is no mistake
        assert (merit.error < 1e-11) == holds
        assert (merit.cone < 1e-12) == holds
        if holds:
            assert merit.stick == count


def test_cable_that_starts_at_rest_is_solved() -> None:
    converged(Capstan().wound(0.5, 24, 0.5, rest(0.5, 24)), max_iterations=1000)


def test_limit_is_that_of_euler_and_eytelwein() -> None:
    own = Capstan(cable=1e-5)
    for turns in TURNS:
        angle = 2 * math.pi * turns
        found = own.limit(round(turns * 10000), 10000)
        assert found == pytest.approx(math.exp(own.mu * angle), rel=1e-4)
    assert Capstan(mu=10.0).limit(8, 4) == math.inf


@pytest.mark.parametrize("number", [9, 10])
def test_cable_stops_below_the_limit_and_slides_beyond(number: int) -> None:
    own = Capstan()
    problem = own.problem(number)
    result = converged(problem, tol=1e-9)
    known = facts(problem)
    assert result.solution.v is not None
    speed = np.abs(result.solution.v).max()
    if known["pull"] < known["limit"]:
        assert speed < 1e-3 * own.vibration
        return
    # what friction lacks accelerates the whole cable along itself, at one speed
    along = (np.reshape(problem.H.T @ result.solution.v, (-1, 3)))[:, 1]
    assert along.min() > 0
    np.testing.assert_allclose(along, along.mean(), rtol=0.02)
    # segments keep their lengths
    np.testing.assert_allclose(problem.G.T @ result.solution.v, 0, atol=1e-9)


def test_lambda_is_the_tension() -> None:
    """Half a turn without friction: the tension is the same all along, but for the vibration."""
    own = Capstan(mu=0.0)
    start = own.vibration * np.random.Generator(np.random.PCG64(0)).uniform(-1, 1, (13, 3))
    result = converged(own.wound(0.5, 24, 1.0, start), tol=1e-10)
    assert result.solution.l is not None
    np.testing.assert_allclose(result.solution.l, -own.held * assembly.STEP, rtol=0.02)


def test_both_are_families_of_assembly() -> None:
    for name in ("PegInHole", "Capstan"):
        assert assemblies()[name].collection == "assembly"
        problem: Any = assemblies()[name]().problem(0)
        digests = {fclib.digest(assemblies()[name]().problem(k)) for k in range(8)}
        assert len(digests) == 8
        assert problem.nc
