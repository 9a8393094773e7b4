"""The reactions of least norm of a solution whose reactions are not unique.

min ||r|| over W r = W r*, with r in the faces of the cones that the velocity allows: zero if the
contact opens, a ray if it slides, K if it sticks. This conic program is solved island by island.
Its answer is moved into the kernel of W on these faces, so that W r keeps its value up to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import qr

from fclib import _core, _laws
from fclib.analysis._conic import Program
from fclib.analysis._contacts import completed, velocity
from fclib.analysis._data import DENSE, EPS, Array, Data

MOVES = 1e-9  # a velocity above this, relative to max(||u||, ||q||), opens or slides


def least_norm(
    data: Data, solution: _core.Solution, target: float
) -> tuple[str, int, _core.Solution]:
    """Whether the reactions of the velocity are unique, their freedom, and the least ones."""
    problem, d = data.problem, data.d
    if problem.nc == 0:
        return "unique", 0, solution
    _, u = completed(data, solution)
    islands = data.local.islands()
    local_W, r = data.W.tocsr(), solution.r.copy()
    freedom, skipped = 0, False
    threshold = MOVES * max(float(np.linalg.norm(u)), data.speed)
    V = data.matrices.get("V")
    order = np.argsort(islands.contact, kind="stable")
    for island in np.split(order, np.cumsum(np.bincount(islands.contact))[:-1]):
        rows = (d * island[:, None] + np.arange(d)).ravel()
        if not r[rows].any():
            continue
        if rows.size > DENSE:
            skipped = True
            continue
        block = local_W[rows][:, rows].toarray()
        if V is not None:
            # lambda may also change, without any change of velocity
            block = _held(block, V.tocsr()[rows].toarray(), data.matrices["R"].toarray())
        faces = _faces(data, island, r, u, threshold)
        kernel = _kernel(block @ faces.basis)
        if kernel.shape[1] == 0:
            continue
        freedom += kernel.shape[1]
        least = _least_in(data, faces, block, r[rows], kernel)
        if least is not None and np.linalg.norm(least) <= np.linalg.norm(r[rows]):
            r[rows] = least
    if freedom == 0:
        return ("one of several" if skipped else "unique"), 0, solution
    least_one = complete(data, _core.Solution(r=r, l=_multiplier(data, r)))
    if skipped or not _core.merit(problem, least_one).error <= target:
        return "one of several", freedom, solution
    return "minimum norm", freedom, least_one


def _held(W: Array, V: Array, R: Array) -> Array:
    """W - V R^-1 V^T."""
    return W - V @ np.linalg.solve(R, V.T)


def _multiplier(data: Data, r: Array) -> Array | None:
    """Lambda from r."""
    if "V" not in data.matrices or data.local.s is None:
        return None
    V, R = data.matrices["V"], data.matrices["R"]
    return np.asarray(-np.linalg.solve(R.toarray(), V.T @ r + data.local.s))


def complete(data: Data, solution: _core.Solution) -> _core.Solution:
    """The solution with u recomputed, and with v for a global problem."""
    problem = data.problem
    _, u = completed(data, solution)
    if isinstance(problem, _laws.Global):
        v = velocity(problem, data, solution)
        return solution.replace(v=v, u=data.matrices["H"].T @ v + problem.w)
    return solution.replace(u=u)


@dataclass(frozen=True)
class Faces:
    """The reactions that a velocity allows, contact by contact.

    Attributes:
        basis: (d contacts, directions): unit vectors if nothing slides.
        sticking: places in the island of contacts that may have any reaction in K.
        rays: the directions of sliding contacts; their coefficients are not negative.
        contacts: the contacts of the island.
    """

    basis: Array
    sticking: Any
    rays: Any
    contacts: Any


def _faces(data: Data, island: Any, r: Array, u: Array, threshold: float) -> Faces:
    d = data.d
    entries: list[tuple[int, int, float]] = []
    sticking, rays = [], []
    count = 0
    for at, contact in enumerate(island):
        own = slice(d * contact, d * contact + d)
        reaction, speed = r[own], u[own]
        if not reaction.any() or speed[0] > threshold:
            continue
        if np.linalg.norm(speed[1:]) > threshold:
            # it slides, or rolls: its reaction keeps its direction
            direction = reaction / np.linalg.norm(reaction)
            entries += [(d * at + k, count, float(direction[k])) for k in range(d)]
            rays.append(count)
            count += 1
            continue
        entries += [(d * at + k, count + k, 1.0) for k in range(d)]
        sticking.append(at)
        count += d
    basis = np.zeros((d * len(island), count))
    for row, column, value in entries:
        basis[row, column] = value
    return Faces(basis, np.array(sticking, int), np.array(rays, int), island)


def _kernel(a: Array) -> Array:
    """An orthonormal basis of the kernel."""
    if a.shape[1] == 0:
        return np.zeros((0, 0))
    # the rows' complement: A^T P = Q R with falling |R_kk|
    q, upper, _ = qr(a.T, pivoting=True)
    values = abs(np.diag(upper))
    limit = 10 * max(a.shape) * EPS * values.max(initial=0)
    return np.asarray(q[:, int((values > limit).sum()) :])


def _least_in(data: Data, faces: Faces, W: Array, r: Array, kernel: Array) -> Array | None:
    """The reaction of least norm with the same W r, or None if it was not found.

    The conic program violates W r and the cones by its tolerance. Its answer is moved into the
    kernel. Then Newton steps of least norm on the violated constraints end at rounding.
    """
    d, B = data.d, sp.csr_array(faces.basis)
    size = B.shape[1]
    scale = float(np.linalg.norm(r))
    start = faces.basis.T @ r / scale  # the columns are orthonormal
    A = W @ faces.basis
    A = sp.csr_array(np.where(abs(A) > EPS * abs(A).max(), A, 0) / abs(A).max())
    program = Program(size)
    program.equal(A, A @ start)
    at = faces.sticking
    if not all(group.uniform for group in data.friction):
        return None
    limits = [
        (group.coefficient[faces.contacts[at]], list(range(d))[group.part])
        for group in data.friction
    ]
    for mu, components in limits:
        stacked = sp.vstack(
            [sp.diags_array(mu) @ B[d * at], *(B[d * at + k] for k in components)], format="csr"
        )
        length = 1 + len(components)
        order = np.arange(length * at.size).reshape(length, -1).T.ravel()
        program.second_order(stacked[order], np.zeros(order.size), length)
    program.nonnegative(B[d * at], np.zeros(at.size))
    rays = sp.csr_array(sp.eye_array(size, format="csr")[faces.rays])
    program.nonnegative(rays, np.zeros(faces.rays.size))
    answer = program.solve(np.zeros(size), sp.eye_array(size, format="csc"), tol=1e-11)
    z = kernel.T @ (np.array(answer.x) - start)
    if not np.isfinite(z).all():
        return None
    for _ in range(10):
        c = start + kernel @ z
        x = faces.basis @ c
        gaps, gradients = [], []
        for mu, components in limits:
            tangent = np.stack([x[d * at + k] for k in components], axis=1)
            norm = np.linalg.norm(tangent, axis=1)
            gap = mu * x[d * at] - norm
            for k in np.flatnonzero(gap < -EPS * norm):
                gradient = mu[k] * faces.basis[d * at[k]]
                for j, component in enumerate(components):
                    along = faces.basis[d * at[k] + component]
                    gradient = gradient - tangent[k, j] / norm[k] * along
                gaps.append(gap[k])
                gradients.append(gradient @ kernel)
        for k in faces.rays[c[faces.rays] < 0]:
            gaps.append(c[k])
            gradients.append(kernel[k])
        if not gaps:
            break
        z = z - np.linalg.lstsq(np.array(gradients), np.array(gaps), rcond=1e-8)[0]
    return scale * x
