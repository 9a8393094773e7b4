"""The reactions of least norm of a solution whose reactions are not unique.

min ||r|| over the r that have the same effect as r*, in the faces of the cones that the velocity
allows: zero if the contact opens, a ray if it slides, K if it sticks. A contact at rest may carry
load also if its r* is zero. This conic program is solved island by island. Its answer is moved into
the directions that move nothing (_motion.py), so that the velocity is kept up to rounding.

Rounding hides whether a contact with a tiny velocity is at rest. It counts as one at rest: then the
faces are too large rather than too small. So reactions that are unique in them are unique, and the
least ones in them are the least if they solve the problem.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from fclib import _core, _laws
from fclib.analysis._conic import Program
from fclib.analysis._contacts import completed, velocity
from fclib.analysis._data import DENSE, EPS, Array, Data
from fclib.analysis._motion import NOISE, Effects, Motion, motion_of
from fclib.analysis._reactions import MOVES, UNCERTAIN, faces_of, freedom

UNIQUE, LEAST, SEVERAL, UNDECIDED = "unique", "minimum norm", "one of several", "undecided"
CLOSE = 10.0  # times the error: velocities below this are zero in a second try
OWN = 1e-6  # in the largest r_N: a reaction above this says in which direction it resists
SAME = 1e-6  # relative difference of two reactions, or norms, that are not told apart
ROUNDED = 100  # times EPS: a smaller entry of an orthonormal basis is rounding
FLAT = 1e-8  # a gradient below this is no direction
PASSES = 6  # conic programs, each scaled by the norm that the last one found


@dataclass(frozen=True)
class Least:
    """The least reactions that were found.

    Attributes:
        r: (m), l: (p) or None.
        freedom: dimension of the directions in the faces that move nothing.
        clear: whether no rank depends on rounding, and each program was solved.
    """

    r: Array
    l: Array | None  # noqa: E741
    freedom: int
    clear: bool


def least_norm(
    data: Data, solution: _core.Solution, target: float
) -> tuple[str, int, _core.Solution]:
    """Whether the reactions of the velocity are unique, their freedom, and the least ones.

    The verdict is "unique", "minimum norm" (no reactions of this velocity are smaller), "one of
    several" (there are others, perhaps smaller ones) or "undecided".
    """
    if data.problem.nc == 0:
        return UNIQUE, 0, solution
    error = max(_core.merit(data.problem, solution).error, EPS)
    effects = Effects.of_data(data)
    found = _least(effects, solution, max(MOVES, UNCERTAIN * error), error)
    dimension = found.freedom
    if dimension == 0 and found.clear:
        return UNIQUE, 0, solution
    other = None
    if dimension:
        other = _judged(data, found, target)
        if other is not None and found.clear:
            return LEAST, dimension, other
        if other is None:
            # some tiny velocities are not zero
            closer = _least(effects, solution, CLOSE * max(error, target), error)
            other = _judged(data, closer, target)
    if other is not None and _differ(other.r, solution.r):
        return SEVERAL, dimension, other
    inside = faces_of(data, solution, error).inside
    several = freedom(data, inside, DENSE).least > 0
    return SEVERAL if several else UNDECIDED, dimension, solution


def _differ(r: Array, other: Array) -> bool:
    scale = max(float(np.linalg.norm(r)), float(np.linalg.norm(other)))
    return float(np.linalg.norm(r - other)) > SAME * scale


def _judged(data: Data, found: Least, target: float) -> _core.Solution | None:
    """The solution of these reactions, or None if its merit is above the target."""
    solution = complete(data, _core.Solution(r=found.r, l=found.l))
    return solution if _core.merit(data.problem, solution).error <= target else None


def complete(data: Data, solution: _core.Solution) -> _core.Solution:
    """The solution with u recomputed, and with v for a global problem."""
    problem = data.problem
    _, u = completed(data, solution)
    if isinstance(problem, _laws.Global):
        v = velocity(problem, data, solution)
        return solution.replace(v=v, u=data.matrices["H"].T @ v + problem.w)
    return solution.replace(u=u)


def _least(effects: Effects, solution: _core.Solution, moves: float, error: float) -> Least:
    """The least reactions, island by island; those of an island that is not decided are kept.

    Args:
        effects: of the problem.
        solution: a solution.
        moves: a velocity above this, relative to max(||u||, ||q||), opens or slides.
        error: of the solution, which bounds how well its velocity is known.
    """
    data, d = effects.data, effects.data.d
    _, u = completed(data, solution)
    speed = max(float(np.linalg.norm(u)), data.speed)
    r = solution.r.copy()
    multipliers = None if solution.l is None else solution.l.copy()
    total, clear = 0, True
    islands = data.local.islands().contact
    order = np.argsort(islands, kind="stable")
    for island in np.split(order, np.cumsum(np.bincount(islands))[:-1]):
        rows = (d * island[:, None] + np.arange(d)).ravel()
        faces = _faces(data, island, solution.r, u, moves * speed, error * speed)
        if faces.size == 0:
            continue
        motion = motion_of(effects, rows, faces.basis)
        if motion is None:
            clear = False
            continue
        spread = np.linalg.norm(effects.lengths[rows].reshape(-1, d)[faces.at], axis=1)
        noise = np.zeros(faces.size)
        known = motion.lengths > 0
        noise[known] = (faces.unsure * spread)[known] / motion.lengths[known]
        kernel, sure = motion.kernel(noise)
        clear = clear and sure
        total += kernel.shape[1]
        if kernel.shape[1] == 0 or not r[rows].any():
            continue
        least, solved = _least_in(faces, motion, r[rows], kernel)
        clear = clear and solved
        if least is None:
            continue
        if multipliers is not None and motion.joints.size:
            effect = (effects.moved[:, rows] @ (least - r[rows]))[motion.rows]
            multipliers[motion.joints] += motion.multipliers(effect)
        r[rows] = least
    return Least(r, multipliers, total, clear)


@dataclass(frozen=True)
class Cones:
    """Limits ||factors * r_components|| <= bound r_N of contacts, of one group of components.

    Attributes:
        at: (k) places of the contacts in the island.
        bound: (k); factors: (k, components).
        components: the components of a contact that they bound.
    """

    at: Any
    bound: Array
    factors: Array
    components: tuple[int, ...]

    def rows(self, d: int, basis: Any) -> Any:
        """Rows (contact by contact, k (1 + components)) times the coefficients are the cones."""
        length = 1 + len(self.components)
        stacked = sp.vstack(
            [
                sp.diags_array(self.bound) @ basis[d * self.at],
                *(
                    sp.diags_array(factor) @ basis[d * self.at + k]
                    for factor, k in zip(self.factors.T, self.components, strict=True)
                ),
            ],
            format="csr",
        )
        return stacked[np.arange(length * self.at.size).reshape(length, -1).T.ravel()]


@dataclass(frozen=True)
class Faces:
    """The reactions that a velocity allows, contact by contact.

    Attributes:
        d: the number of components of a contact.
        basis: (d contacts x directions), orthonormal.
        at: (directions) place of the contact in the island.
        unsure: (directions) how well a direction is known, as it is that of a velocity.
        normals: directions with a normal part; their coefficients are not negative.
        cones: the limits of components that do not move.
    """

    d: int
    basis: Any
    at: Any
    unsure: Array
    normals: Any
    cones: tuple[Cones, ...]

    @property
    def size(self) -> int:
        """The number of directions."""
        return int(self.basis.shape[1])


def _faces(data: Data, island: Any, r: Array, u: Array, threshold: float, blur: float) -> Faces:
    """The faces of an island's contacts.

    Args:
        data: of the problem.
        island: its contacts.
        r: (m) of the solution.
        u: (m) of the solution.
        threshold: [m/s] a velocity above this opens, slides, spins or rolls.
        blur: [m/s] error of the velocities.
    """
    d = data.d
    pressed = OWN * float(abs(r[::d]).max(initial=0.0))
    directions: list[Array] = []
    at: list[int] = []
    unsure: list[float] = []
    normals: list[int] = []
    resting: list[list[int]] = [[] for _ in data.friction]
    for place, contact in enumerate(island):
        own = slice(d * contact, d * contact + d)
        reaction, speed = r[own], u[own]
        if speed[0] > threshold:
            continue
        ray, free, doubt = np.zeros(d), [], 0.0
        ray[0] = 1
        for group, places in zip(data.friction, resting, strict=True):
            axes = group.axes[contact]
            if not axes.any():
                continue
            moving = speed[group.part] * (axes > 0)
            rate = float(np.linalg.norm(moving))
            if rate > threshold:
                pull = reaction[group.part] / reaction[0] if reaction[0] > pressed else None
                ray[group.part] = _against(group, axes, moving) if pull is None else pull
                doubt = max(doubt, blur / rate)
            else:
                free += [k for k, axis in zip(range(d)[group.part], axes, strict=True) if axis > 0]
                places.append(place)
        normals.append(len(at))
        at += [place] * (1 + len(free))
        unsure += [doubt] + [0.0] * len(free)
        directions += [ray / np.linalg.norm(ray), *np.eye(d)[free]]
    values = np.array(directions).reshape(len(at), d)
    rows = d * np.array(at, int)[:, None] + np.arange(d)
    places_of = np.repeat(np.arange(len(at)), d)
    basis = sp.csr_array(
        (values.ravel(), (rows.ravel(), places_of)), shape=(d * len(island), len(at))
    )
    basis.eliminate_zeros()
    cones = []
    for group, places in zip(data.friction, resting, strict=True):
        axes = group.axes[island[places]]
        bound = axes.max(axis=1, initial=0.0)
        factors = np.divide(bound[:, None], axes, out=np.zeros_like(axes), where=axes > 0)
        if places:
            cones.append(Cones(np.array(places), bound, factors, tuple(range(d)[group.part])))
    return Faces(
        d, basis, np.array(at, int), np.array(unsure), np.array(normals, int), tuple(cones)
    )


def _against(group: _laws.Group, axes: Array, moving: Array) -> Array:
    """The reaction of a group that moves, over r_N: on the border of its section."""
    if group.uniform:
        return np.asarray(-axes * moving / np.linalg.norm(moving))
    return np.asarray(-axes * axes * moving / np.linalg.norm(axes * moving))


def _least_in(faces: Faces, motion: Motion, r: Array, kernel: Array) -> tuple[Array | None, bool]:
    """The reactions of least norm with the same effect, and whether they are known to be the least.

    None if they were not found. If their norm is far below that of r, the program is solved again
    from there, so that its tolerance counts in the new norm.
    """
    found, solved = None, False
    for _ in range(PASSES):
        scale = float(np.linalg.norm(r))
        if scale == 0:
            return r, True
        start = faces.basis.T @ r / scale  # the columns are orthonormal
        c, solved = _program(faces, motion, start, kernel)
        if c is None:
            return found, False
        size = float(np.linalg.norm(c))
        if size > 1 + SAME:
            return found, False
        r = found = scale * (faces.basis @ c)
        if size > 0.1:
            break
    return found, solved


def _program(
    faces: Faces, motion: Motion, start: Array, kernel: Array
) -> tuple[Array | None, bool]:
    """The least coefficients c with the effect of `start`, and whether they are shown to be so.

    The conic program violates the effect and the cones by its tolerance. Its answer is moved into
    the kernel. Then Newton steps of least norm on the violated constraints end at rounding. The
    dual value of the program is the bound below which no norm is.
    """
    size = faces.size
    A = _equations(motion)
    program = Program(size)
    program.equal(A, A @ start)
    for cones in faces.cones:
        rows = cones.rows(faces.d, faces.basis)
        program.second_order(rows, np.zeros(rows.shape[0]), 1 + len(cones.components))
    normals = sp.csr_array(sp.eye_array(size, format="csr")[faces.normals])
    program.nonnegative(normals, np.zeros(faces.normals.size))
    answer = program.solve(np.zeros(size), sp.eye_array(size, format="csc"), tol=1e-11)
    z = kernel.T @ (np.array(answer.x) - start)
    if not np.isfinite(z).all():
        return None, False
    # what the kernel moves only by rounding keeps its value
    held = np.linalg.norm(kernel, axis=1) <= ROUNDED * EPS
    c = _inside(faces, start, np.where(held[:, None], 0.0, kernel), z)
    value = float(c @ c) / 2
    return c, bool(value - answer.obj_val_dual <= SAME * max(value, SAME))


def _equations(motion: Motion) -> Any:
    """The rows that say that the effect stays, each of size one.

    Small entries are left out: a row of rounding would forbid what moves nothing.
    """
    small = max(10 * max(motion.left.shape) * motion.rounding, NOISE) * motion.lengths
    A = np.where(abs(motion.left) <= small, 0.0, motion.left)
    largest = abs(A).max(axis=1, initial=0.0)
    A = A[largest > 0] / largest[largest > 0, None]
    return sp.csr_array(np.where(abs(A) > EPS, A, 0.0))


def _inside(faces: Faces, start: Array, kernel: Array, z: Array) -> Array:
    """The coefficients start + kernel z, moved by least steps until no constraint is violated."""
    for _ in range(10):
        c = start + kernel @ z
        x = faces.basis @ c
        gaps: list[float] = []
        gradients: list[Array] = []
        for k in faces.normals[c[faces.normals] < 0]:
            gaps.append(float(c[k]))
            gradients.append(kernel[k])
        for cones in faces.cones:
            _violations(faces, cones, x, kernel, gaps, gradients)
        # what no step in the kernel can mend is the solution's own
        mended = np.linalg.norm(np.array(gradients), axis=-1) > FLAT if gaps else np.zeros(0, bool)
        if not mended.any():
            break
        steps, rest = np.array(gradients)[mended], np.array(gaps)[mended]
        z = z - np.linalg.lstsq(steps, rest, rcond=FLAT)[0]
    return c


def _violations(
    faces: Faces, cones: Cones, x: Array, kernel: Array, gaps: list[float], gradients: list[Array]
) -> None:
    """Add the gaps of violated cones at the reactions x, and their gradients by z."""
    d, at = faces.d, cones.at
    pulls = np.stack(
        [f * x[d * at + k] for f, k in zip(cones.factors.T, cones.components, strict=True)], axis=1
    )
    norms = np.linalg.norm(pulls, axis=1)
    found = cones.bound * x[d * at] - norms
    # aim a little inside, so that the cones still hold once r is rounded
    for k in np.flatnonzero((found < 0) & (norms > 0)):
        weights = np.zeros(d)
        weights[0] = cones.bound[k]
        weights[list(cones.components)] = -cones.factors[k] * pulls[k] / norms[k]
        own = faces.basis[d * at[k] : d * at[k] + d]
        gaps.append(float(found[k] - 4 * EPS * norms[k]))
        gradients.append((own.T @ weights) @ kernel)
