"""Steps of engines with joints: two pads on slides press a box, and hold it or let it slide down.

The pads press by P each. So the normal forces of a side are P, and the box is held if
2 mu P >= m g. If not, friction is all that it can be: mu P on each side.
"""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np
import pytest

from fclib import _core, recorders
from helpers import needs_siconos_mechanics
from workshop.tables import judged_engines

# the package of each engine
PACKAGES = {
    "MuJoCo": "mujoco",
    "MuJoCo Warp": "mujoco_warp",
    "Drake": "pydrake",
    "Genesis": "genesis",
    "Newton": "newton",
    "PyBullet": "pybullet",
    "Siconos": "",
}
STEPS = 60  # by then soft contacts have settled
LAST = 20  # steps of which the median is judged: Bullet's points come and go
GRAVITY = 9.81  # [m/s^2]; Siconos has 9.80665
H = judged_engines.H


def steps_of(engine: str) -> list[Any]:
    """The gripper's steps with contacts; the test is skipped if the engine is not installed."""
    if engine == "Siconos":
        needs_siconos_mechanics()
    elif importlib.util.find_spec(PACKAGES[engine]) is None:
        pytest.skip(f"{engine} is not installed")
    every = judged_engines.ENGINES[engine]("gripper", STEPS)
    return [step for step in every if step is not None and step.problem.nc]


def slip(step: Any) -> float:
    """The fastest contact along the pads [m/s]."""
    u = np.reshape(_core.contact_merits(step.problem, step.guess)["u"], (-1, 3))
    return float(np.linalg.norm(u[:, 1:], axis=1).max())


def pushes(step: Any) -> Any:
    """(2 x 3) the forces of the left and of the right pad on the box [N], in the world."""
    r = step.guess.r.reshape(-1, 3) / step.h
    forces = np.einsum("ci,cij->cj", r, step.contacts.frame)
    side = np.sign(step.contacts.point[:, 0])
    # a pad pushes away from itself
    away = -np.sign(side * forces[:, 0])
    away[away == 0] = 1
    forces *= away[:, None]
    return np.array([forces[side == own].sum(axis=0) for own in (-1, 1)])


def normal(step: Any) -> float:
    """The sum of all normal forces [N]."""
    return float(step.guess.r[::3].sum() / step.h)


@pytest.mark.slow
@pytest.mark.parametrize("engine", list(PACKAGES))
def test_pads_hold_a_box_by_friction(engine: str) -> None:
    steps = steps_of(engine)[-LAST:]
    assert len(steps) == LAST
    last, box, press = steps[-1], 2.0, judged_engines.PRESS
    if engine == "Siconos":
        assert np.median([normal(step) for step in steps]) == pytest.approx(2 * press, rel=5e-3)
        # the box has turned a little, and so have the normals
        # the slides carry all that does not fall: the pads have 1 kg each
        carried = [np.abs(step.guess.l.reshape(2, 5)[:, 1].sum()) / step.h for step in steps]
        assert np.median(carried) == pytest.approx((box + 2) * GRAVITY, rel=2e-3)
    else:
        found = np.median([pushes(step) for step in steps], axis=0)
        np.testing.assert_allclose(found[:, 0], [press, -press], rtol=5e-3)
        assert found[:, 2].sum() == pytest.approx(box * GRAVITY, rel=5e-3)
    # soft contacts creep; without friction it would have the speed of all steps
    assert slip(last) < GRAVITY * H
    found = [recorders.criteria_of(step.problem, step.guess) for step in steps]
    median = {name: np.median([one[name] for one in found]) for name in recorders.CRITERIA}
    assert median["cone"] < 1e-6
    assert median["tension"] == 0
    assert median["distance"] < 0.05
    assert median["penetration"] < 0.02
    assert median["dissipation"] < 0.03
    assert median["energy"] < 0.02


@pytest.mark.slow
# Drake's spheres overlap the pads at the start, and its contacts give way slowly
@pytest.mark.parametrize("engine", [name for name in PACKAGES if name != "Drake"])
def test_a_box_slides_down_if_pads_press_too_little(
    engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    press = 10.0
    monkeypatch.setattr(judged_engines, "PRESS", press)
    steps = steps_of(engine)
    # contacts may open between, and then press more
    assert sum(normal(step) for step in steps) / STEPS == pytest.approx(2 * press, rel=0.1)
    last = steps[-1]
    friction = np.linalg.norm(last.guess.r.reshape(-1, 3)[:, 1:], axis=1).sum() / last.h
    assert friction == pytest.approx(judged_engines.MU * normal(last), rel=1e-3)
    assert slip(last) > 0.3 * GRAVITY * STEPS * H / 2
    criteria = recorders.criteria_of(last.problem, last.guess)
    assert criteria["cone"] < 1e-6
    assert criteria["dissipation"] < 0.03
