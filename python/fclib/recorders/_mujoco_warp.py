"""MuJoCo Warp: a step of many worlds at once, in single precision, of which one is recorded.

MuJoCo Warp copies a world into MuJoCo's own data, from which the problem is read (`_mujoco.py`).
"""

from __future__ import annotations

import importlib
from dataclasses import replace
from typing import Any

from fclib.recorders import _mujoco
from fclib.recorders._recorded import EXACT, Recorded, SetupError


def mujoco_warp(model: Any, warp_model: Any, warp_data: Any, world: int = 0) -> Recorded:
    """Take one step of all worlds, and return the problem of one.

    Args:
        model: mujoco.MjModel, of which `warp_model` was made.
        warp_model: mujoco_warp.Model, with the integrator Euler.
        warp_data: mujoco_warp.Data; it is stepped.
        world: one of its worlds.

    Raises:
        ImportError: mujoco_warp is not installed.
        ValueError: there is no such world, the integrator is another one, a contact is one of a
            flexible body, or the data have too little memory.
    """
    warp = importlib.import_module("mujoco_warp")
    return record(warp, model, warp_model, warp_data, warp.step, world)


def record(
    warp: Any, model: Any, warp_model: Any, warp_data: Any, step: Any, world: int = 0
) -> Recorded:
    """As `mujoco_warp`, for the module and its stepping function."""
    mj = importlib.import_module("mujoco")
    if model.opt.integrator != mj.mjtIntegrator.mjINT_EULER:
        raise SetupError(
            f"the integrator {mj.mjtIntegrator(model.opt.integrator).name} of MuJoCo Warp is not"
            ' recorded: use <option integrator="Euler"/>'
        )
    if not 0 <= world < warp_data.nworld:
        raise ValueError(f"there is no world {world}: there are {warp_data.nworld}")
    data = mj.MjData(model)
    warp.get_data_into(data, model, warp_data, world)

    def stepped(model: Any, data: Any) -> None:
        step(warp_model, warp_data)
        rows, room = int(warp_data.nefc.numpy()[world]), int(warp_data.njmax)
        if rows > room:
            raise ValueError(f"the step has {rows} rows and memory for {room}: make njmax larger")
        warp.get_data_into(data, model, warp_data, world)

    recorded = _mujoco.record(mj, model, data, stepped, exact=EXACT[4])
    return replace(
        recorded,
        engine="MuJoCo Warp",
        version=str(warp.__version__),
        notes=(*recorded.notes, "The data are of single precision."),
    )
