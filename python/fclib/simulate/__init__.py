"""Simulate a scene, and obtain the discrete problem of every step.

    for step in fclib.simulate.simulate(scene, steps=100):
        step.problem, step.result

    scenes ──> MujocoModel, DeformableModel ──> System ──> MoreauJean ──> GlobalProblem ──> solve
                          ^                                                                   │
                          └──────────────────── integrate(h, v) ──────────────────────────────┘

arrays.py         what a step needs of sparse matrices, on their arrays
moreau_jean.py    the scheme: the system at an instant becomes a problem. Knows no MuJoCo.
mujoco_model.py   the model: kinematics, inertia, forces and collisions of an MJCF scene
equalities.py     MuJoCo's equalities: which follow from others, which contradict them
mujoco_scene.py   MuJoCo's model of an MJCF scene, its gait, and what it asks too much
deformable.py     the model of elastic blocks, by finite elements, with contacts between meshes
plane.py          contacts of bodies that move in a plane
periodic.py       a cell that repeats itself: ghosts of bodies, and their part of H
relax.py          a state whose bodies are deep in each other, with these moved apart
control.py        controls from outside: a file's rows, a function of time and state
logged.py         states from outside: a file's rows
simulation.py     the loop, warm starts, and what each problem says of its origin
geometry.py       what a file says of contacts and bodies: identities, frames, shapes, poses
faces.py          the corners of flat faces, of which MuJoCo keeps four
terrain.py        all contacts of height fields, of which MuJoCo keeps 50 a pair
servos.py         actuators that feed back, and the limits of their forces
rounding.py       how states are rounded where they are stored
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
