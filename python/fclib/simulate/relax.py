"""Move bodies apart in a state in which they are deep in each other.

If fast bodies strike, the law on velocities leaves a penetration of the size of h u. A state is
only configuration and velocity, and its problem follows from them. So it may be corrected before it
is stored: the bodies are moved as little as possible until no contact is deeper than a bound, and
the velocities stay. In each round, with the displacement x (n) of the configuration,

    minimise  1/2 x^T M x
    such that g + (H^T x)_N >= -b       nothing is deeper than the bound b [m]
              g + (H^T x)_N <= a        touching bodies still touch afterwards
              G^T x = 0                 violations of bilateral constraints do not change

These are the conditions of a problem without friction, G3DFC with f = 0 and mu = 0, in which each
touching pair is a contact twice, from both sides; `fclib.solve` solves it. Only contact forces move
the bodies, so that a group without a support keeps its centre of mass. A deep contact is opened in
several rounds, since its normal turns with the bodies.

The projection of positions is that of
M. Mueller, B. Heidelberger, M. Hennix, J. Ratcliff, Position based dynamics, Journal of Visual
  Communication and Image Representation 18, 2007, 109-118,
in the metric of the masses, and solved to convergence in each round.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import scipy.sparse as sp

from fclib import _core, _solve
from fclib.simulate.arrays import submatrix, transposed_times
from fclib.simulate.moreau_jean import MoreauJean, System, Vector, components
from fclib.simulate.mujoco_model import MujocoModel
from fclib.simulate.simulation import Model

ROUNDS: Final = 100  # largest number of rounds
PATIENCE: Final = 10  # give up after so many rounds without a less deep state
AIM: Final = 0.9  # share of the bound to aim at: nonlinear terms may miss it
CLOSED: Final = 0.05  # share of the bound by which a contact stays inside its range
STRIDE: Final = 0.1  # largest penetration undone in a round, in smallest radii
TOLERANCE: Final = 1e-6  # relative tolerance of a round
ITERATIONS: Final = 2000


def relaxed(
    model: Model, scheme: MoreauJean, position: Vector, velocity: Vector, deepest: float
) -> Vector:
    """The configuration nearest to q (nq) in which no contact is deeper than a bound.

    Args:
        model: the model of the bodies; its state changes.
        scheme: it says which contacts a step has.
        position: q (nq), with the states of actuators and the other values on which forces depend.
        velocity: v (n); the contacts of a step depend on it.
        deepest: the bound, in diameters of the smallest body.

    Returns:
        q itself if nothing is deeper, for elastic bodies, which have no size, and if the scene has
        interactions: their laws say what becomes of a penetration. If bodies are wedged so that no
        state is within the bound, the least deep state found.

    Raises:
        As `ContactModel.assemble` and `fclib.solve` do.
    """
    size = model.smallest_size
    if size is None or not isinstance(model, MujocoModel) or model.scene.interactions:
        return position
    bound = deepest * 2 * size
    best, least, since = position, np.inf, 0
    here = position
    for done in range(ROUNDS):
        model.set_state(here, velocity)
        system = scheme.assemble(model)
        gap = system.contacts.gap[system.contacts.pair[:, 0] >= 0]
        depth = -float(gap.min(initial=0.0))
        if depth < least:
            best, least, since = here, depth, done
        if depth <= bound or done - since >= PATIENCE:
            break
        displacement = step(scheme, system, velocity, bound, STRIDE * size)
        model.set_state(here, velocity)
        model.integrate(1.0, displacement)
        # actuators and time stay
        here = np.concatenate((model.position[: model.coordinates], here[model.coordinates :]))
    return best


def step(
    scheme: MoreauJean, system: System, velocity: Vector, bound: float, stride: float
) -> Vector:
    """The displacement x (n) of one round."""
    contacts, gap = system.contacts, system.contacts.gap
    d = components(contacts.planar, rolling=False)
    columns = contacts.dimension * np.arange(len(contacts))[:, None] + np.arange(d)
    bodies = contacts.pair[:, 0] >= 0
    # a joint's limit gets no worse
    lowest = np.where(bodies, np.minimum(-AIM * bound, gap + stride), np.minimum(gap, 0.0))

    # pairs that are contacts of the step, and can stay so within the bound
    highest = np.zeros(len(contacts))
    if scheme.law == "velocity":
        rate = transposed_times(system.H, velocity)[:: contacts.dimension]
        highest = -0.5 * scheme.h * rate
    touch = gap <= highest
    highest -= CLOSED * bound
    kept = np.flatnonzero(bodies & touch & (highest > lowest))

    sides = [submatrix(system.H, columns.ravel()), submatrix(system.H, columns[kept].ravel())]
    sides[1] = sides[1] @ sp.diags_array(np.tile([-1.0, *[1.0] * (d - 1)], len(kept)))
    w = np.zeros((len(contacts) + len(kept), d))
    w[:, 0] = np.concatenate((gap - lowest, (highest - gap)[kept]))
    p = system.G.shape[1]
    problem = _core.GlobalProblem(
        M=system.M,
        H=sp.csc_array(sp.hstack(sides)),
        G=system.G if p else None,
        f=np.zeros(len(velocity)),
        w=w.ravel(),
        mu=np.zeros(len(w)),
        b=np.zeros(p) if p else None,
        spacedim=d,
    )
    result = _solve.solve(problem, tol=TOLERANCE, max_iterations=ITERATIONS, merit="natural")
    displacement: Vector = np.asarray(result.solution.v)
    return displacement
