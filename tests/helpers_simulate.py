"""What tests of scenes ask of steps that MuJoCo's model moves."""

from typing import Any

import numpy as np

from fclib import scenes
from fclib.simulate import MujocoModel, Step, simulate


def last_of(scene: scenes.Scene, steps: int, **settings: Any) -> Step:
    """The last step of a simulation."""
    *_, last = simulate(scene, steps, **settings)
    return last


def mujoco_of(step: Step) -> Any:
    """MuJoCo's model behind a step."""
    assert isinstance(step.model, MujocoModel)
    return step.model.model


def force_on(step: Step, body: str, by: str | None = None) -> Any:
    """(3) what the contacts, those with one other body or all, press a body with [N]."""
    model = mujoco_of(step)
    bodies = model.geom_bodyid[step.contacts.pair]
    own = bodies == model.body(body).id
    sign = own[:, 1].astype(float) - own[:, 0]
    if by is not None:
        sign[~(bodies == model.body(by).id).any(axis=1)] = 0.0
    d = step.problem.spacedim
    impulses = np.reshape(step.result.solution.r, (-1, d))
    turned = np.einsum("ci,cij->cj", impulses, step.contacts.frame[:, :d])
    return sign @ turned / model.opt.timestep
