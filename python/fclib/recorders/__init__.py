"""The problems of other simulators' steps: each step becomes a `GlobalProblem`.

    recorded = fclib.recorders.drake(plant, context)
    recorded.problem, recorded.guess, recorded.mismatch
    recorded.write("step.hdf5")

_assemble.py   common parts: order of rows, redundant joints, limits, dry friction, compliance
_recorded.py   a recorded step, what is exact in it, and a folder or a sequence of them
_criteria.py   how far a simulator's reactions are from Coulomb's law
_scripts.py    steps of a user's script, while it runs
_drake.py, _genesis.py, _lmgc90.py, _mujoco.py, _mujoco_warp.py, _newton.py, _pinocchio.py,
_pybullet.py, _siconos.py        one engine each
_lmgc90_steps.py   run in a process of its own, which LMGC90 may end
_siconos_steps.py  run by the interpreter that has Siconos

An engine is imported only when its adapter is called.
"""

from fclib.recorders._assemble import (
    Assembled,
    Contacts,
    DryFriction,
    Joints,
    Limits,
    assemble,
    associated_error,
    solve_associated,
)
from fclib.recorders._criteria import CRITERIA, Judgement, criteria_of, judge, summary
from fclib.recorders._drake import drake
from fclib.recorders._genesis import genesis
from fclib.recorders._lmgc90 import lmgc90
from fclib.recorders._mujoco import mujoco
from fclib.recorders._mujoco_warp import mujoco_warp
from fclib.recorders._newton import newton
from fclib.recorders._pinocchio import pinocchio
from fclib.recorders._pybullet import pybullet
from fclib.recorders._recorded import Recorded, Recording, SetupError
from fclib.recorders._scripts import ENGINES, record_script
from fclib.recorders._siconos import siconos

__all__ = [
    "CRITERIA",
    "ENGINES",
    "Assembled",
    "Contacts",
    "DryFriction",
    "Joints",
    "Judgement",
    "Limits",
    "Recorded",
    "Recording",
    "SetupError",
    "assemble",
    "associated_error",
    "criteria_of",
    "drake",
    "genesis",
    "judge",
    "lmgc90",
    "mujoco",
    "mujoco_warp",
    "newton",
    "pinocchio",
    "pybullet",
    "record_script",
    "siconos",
    "solve_associated",
    "summary",
]
