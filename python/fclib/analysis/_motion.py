"""The reactions that move nothing: directions k for which some multipliers l undo all effects.

In a problem with bodies the effect of (k, l) is H k + G l: if M is positive definite, contacts keep
their velocities only if the bodies keep theirs. Otherwise it is (W k + V l, V^T k + R l). The
multipliers are taken out by an orthogonal projection, so joints may be redundant, and no inverse is
needed. All is done in doubles: `clear` says whether rounding can change a rank.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.linalg import qr

from fclib.analysis._bounds import lower_bound
from fclib.analysis._data import DENSE, EPS, Array, Data, columns
from fclib.analysis._joints import joints_of

Places: TypeAlias = npt.NDArray[np.int_]

DOUBTFUL = 1e3  # a pivot up to so many times the bound for zero may be rounding, or not
JOINTS = 1e6  # the same for the singular values of joints
ROWS = 3 * DENSE  # largest number of rows of a dense block
NOISE = 1e-10  # a direction that is known less well than this is no reason to call a pivot zero


@dataclass(frozen=True)
class Effects:
    """What all reactions and all multipliers move; rows are scaled so that all masses count alike.

    Attributes:
        data: the problem.
        moved: (rows x m) of the reactions; joints: (rows x p) of the multipliers.
        exact: whether these are the data themselves, so that small columns are not rounding.
    """

    data: Data = field(repr=False)
    moved: Any = field(repr=False)
    joints: Any = field(repr=False)
    exact: bool

    @classmethod
    def of_data(cls, data: Data) -> Effects:
        """By bodies if M is positive definite, else by contacts."""
        matrices, p = data.matrices, data.problem.p
        M = matrices.get("M")
        if M is not None and lower_bound((M + M.T) / 2) > 0:
            scale = sp.diags_array(1 / np.sqrt(M.diagonal()))
            moved = columns(scale @ matrices["H"])
            joints = scale @ matrices["G"] if p else sp.csc_array((moved.shape[0], 0))
            return cls(data, moved, columns(joints), True)
        W, size = matrices["W"], abs(matrices["W"].diagonal())
        if p:
            size = np.concatenate([size, abs(matrices["R"].diagonal())])
        scale = sp.diags_array(1 / np.sqrt(np.where(size > 0, size, 1.0)))
        if not p:
            return cls(data, columns(scale @ W), sp.csc_array((W.shape[0], 0)), False)
        V, R = matrices["V"], matrices["R"]
        both = sp.vstack([W, V.T]), sp.vstack([V, R])
        return cls(data, columns(scale @ both[0]), columns(scale @ both[1]), False)

    @cached_property
    def lengths(self) -> Array:
        """The length of the effect of each component of the reactions (m)."""
        return np.asarray(np.sqrt(np.asarray(self.moved.power(2).sum(axis=0)).ravel()))

    @cached_property
    def certain(self) -> bool:
        """Whether the rank of redundant joints is shown in rational numbers."""
        return joints_of(self.data).certain

    def reached(self, moved: Any) -> tuple[Places, Places]:
        """The rows that some directions move, or joints that act on them; and these joints."""
        rows = np.zeros(moved.shape[0])
        rows[moved.indices[moved.data != 0]] = 1
        links = (self.joints != 0).astype(float)
        while True:
            joints = (links.T @ rows > 0).astype(float)
            grown = ((rows > 0) | (links @ joints > 0)).astype(float)
            if (grown == rows).all():
                return np.flatnonzero(rows), np.flatnonzero(joints)
            rows = grown


@dataclass(frozen=True)
class Motion:
    """What some directions move, once multipliers have undone all that they can.

    Attributes:
        rows, joints: the rows and multipliers of the whole problem that take part.
        left: (rows x directions) what is left of the effects.
        own: (rows x joints) effects of the multipliers.
        lengths: (directions) of the effects before that.
        rounding: of `left`, relative to `lengths`.
        clear: whether the ranks until here do not depend on rounding.
    """

    rows: Places
    joints: Places
    left: Array
    own: Array
    lengths: Array
    rounding: float
    clear: bool

    def kernel(self, noise: Array) -> tuple[Array, bool]:
        """An orthonormal basis of the directions that move nothing, and whether its size is clear.

        Args:
            noise: (directions) relative errors of the effects, as the directions are not exact.
        """
        size = self.left.shape[1]
        scale = np.where(self.lengths > 0, self.lengths, 1.0)
        # rows of A^T are directions: the complement of their range moves nothing
        q, upper, _ = qr((self.left / scale).T, pivoting=True)
        pivots = abs(np.diagonal(upper))
        blur = float(noise.max(initial=0.0))
        zero = 10 * max(self.left.shape) * self.rounding * float(pivots.max(initial=0.0))
        limit = max(zero, min(blur, NOISE))
        doubtful = max(DOUBTFUL * limit, 1e2 * blur)
        rank = int((pivots > limit).sum())
        clear = not ((pivots > limit) & (pivots < doubtful)).any()
        if rank == size:
            return np.zeros((size, 0)), clear and self.clear
        # back from directions with effects of length one
        basis = np.linalg.qr(q[:, rank:] / scale[:, None])[0]
        return np.asarray(basis), clear and self.clear

    def multipliers(self, effect: Array) -> Array:
        """The multipliers (joints) that undo an effect (rows) the best."""
        size = np.linalg.norm(self.own, axis=0)
        size[size == 0] = 1
        digits = max(self.own.shape, default=0) * EPS
        found = np.linalg.lstsq(self.own / size, -effect, rcond=digits)[0]
        return np.asarray(found / size)


def motion_of(effects: Effects, rows: Places, basis: Any) -> Motion | None:
    """What directions (columns of the basis) of the reactions `rows` move; None if too large."""
    moved = columns(effects.moved[:, rows] @ basis)
    reached, joints = effects.reached(moved)
    if max(basis.shape[1], joints.size) > DENSE or reached.size > ROWS:
        return None
    A = moved[reached].toarray()
    own = effects.joints[reached][:, joints].toarray()
    lengths = np.linalg.norm(A, axis=0)
    left, rounding, clear = _projected(A, own, lengths, lambda: effects.certain)
    if not effects.exact:
        # W is computed: a column this much shorter than others may be rounding
        short = DOUBTFUL * 10 * max(A.shape, default=0) * EPS * float(lengths.max(initial=0.0))
        clear = clear and not ((lengths > 0) & (lengths < short)).any()
    return Motion(reached, joints, left, own, lengths, rounding, clear)


def _projected(
    A: Array, own: Array, lengths: Array, certain: Callable[[], bool]
) -> tuple[Array, float, bool]:
    """A without the range of `own`, its relative rounding, and whether that range is clear."""
    if own.shape[1] == 0:
        return A, EPS, True
    size = np.linalg.norm(own, axis=0)
    U, sigma, _ = np.linalg.svd(own / np.where(size > 0, size, 1.0), full_matrices=False)
    digits = max(own.shape) * EPS
    kept = sigma > digits
    clear = not (kept & (sigma < JOINTS * digits)).any()
    # what doubles call redundant may differ in the last digits
    if int(kept.sum()) < own.shape[1]:
        clear = clear and certain()
    Q = U[:, kept]
    left = A - Q @ (Q.T @ A)
    left -= Q @ (Q.T @ left)
    rounding = EPS / float(sigma[kept].min(initial=1.0))
    # what joints hold entirely is zero, not rounding
    left[:, np.linalg.norm(left, axis=0) <= 16 * max(A.shape) * rounding * lengths] = 0
    return left, rounding, clear
