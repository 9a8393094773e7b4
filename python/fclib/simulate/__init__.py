"""Simulate a scene, and obtain the discrete problem of every step.

    for step in fclib.simulate.simulate(scene, steps=100):
        step.problem, step.result

    scenes ──> MujocoModel, DeformableModel ──> System ──> MoreauJean ──> GlobalProblem ──> solve
                          ^                                                                   │
                          └──────────────────── integrate(h, v) ──────────────────────────────┘

arrays.py         the operations on sparse matrices that a step needs, on their arrays
moreau_jean.py    the scheme: a system at an instant becomes a problem. Needs no MuJoCo.
mujoco_model.py   the model: kinematics, inertia, forces and collisions of an MJCF scene
equalities.py     MuJoCo's equalities: rows that follow from others, rows that contradict them
mujoco_scene.py   MuJoCo's model of an MJCF scene, its gait, and its unsupported features
deformable.py     the model of elastic bodies, by finite elements, with contacts between meshes
hexahedra.py      mass and stiffness of meshes of hexahedra of any shape
drives.py         velocities and forces that a scene gives
plane.py          contacts of bodies that move in a plane
periodic.py       a periodic cell: ghosts of bodies, and their part of H
relax.py          moves bodies apart that are deep in each other
control.py        controls from outside: a file's rows, a function of time and state
logged.py         states from outside: a file's rows
simulation.py     the loop, warm starts, and the origin stored in each problem
geometry.py       contacts and bodies for files: identities, frames, shapes, poses
faces.py          the corners of flat faces; MuJoCo keeps only four
terrain.py        all contacts of height fields; MuJoCo keeps only 50 for each pair
servos.py         actuators with feedback, and the limits of their forces
rounding.py       the rounding of stored states
render.py         a picture of a state with its reactions

Importing this package needs MuJoCo, in the version that `_mujoco.py` pins; deformable scenes need
scikit-fem, in that of `_skfem.py`.
"""

from fclib.simulate.control import control_of
from fclib.simulate.deformable import DeformableModel
from fclib.simulate.geometry import geometry_of
from fclib.simulate.logged import logged
from fclib.simulate.moreau_jean import ContactModel, Contacts, MoreauJean, System
from fclib.simulate.mujoco_model import MujocoModel
from fclib.simulate.mujoco_scene import UnsupportedSceneError
from fclib.simulate.relax import relaxed
from fclib.simulate.render import NoRenderer, render
from fclib.simulate.simulation import (
    ALLOWANCE,
    Control,
    Model,
    State,
    Step,
    StoppedError,
    carried_to,
    descriptions,
    engine,
    model_of,
    problem_at,
    provenance,
    scheme_of,
    simulate,
)

__all__ = [
    "ALLOWANCE",
    "ContactModel",
    "Contacts",
    "Control",
    "DeformableModel",
    "Model",
    "MoreauJean",
    "MujocoModel",
    "NoRenderer",
    "State",
    "Step",
    "StoppedError",
    "System",
    "UnsupportedSceneError",
    "carried_to",
    "control_of",
    "descriptions",
    "engine",
    "geometry_of",
    "logged",
    "model_of",
    "problem_at",
    "provenance",
    "relaxed",
    "render",
    "scheme_of",
    "simulate",
]
