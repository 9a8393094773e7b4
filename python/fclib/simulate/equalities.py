"""MuJoCo's equalities as bilateral rows: which vanish, which follow from others, what rounding is.

A row that follows from others must agree with them: a loop in an inclined plane has three rows of
which two are independent, and where the positions are exact but for rounding, the third contradicts
the others by all that the violations are. How much that can be follows from the lengths and angles
that MuJoCo adds up, so that the size of a mechanism and its place do not matter.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from fclib.simulate._mujoco import mujoco
from fclib.simulate.arrays import (
    Sparse,
    Vector,
    by_columns,
    columns_of,
    empty,
    lengths_of,
    take,
    without_zeros,
)

# benchmarks/loop_rounding.py chose these, docs/results/loop-rounding.csv has what it found
RANK: Final = 1e-9  # what is left of a row, of length one, after others that it follows from
OWN: Final = 1e-3  # a row of which more is left is one of its own
ROUNDING: Final = 2.0  # units in the last place of all that is added that a gap may be
TURNED: Final = 8.0  # times the angle by which a loop is open, what may be left of a row
SINGULAR: Final = 1e-6  # singular values that A^T A tells from zero: its rounding is below 1e-13
FEW: Final = 48  # columns whose products are faster as those of a full matrix
SEEN: Final = 1e-13  # solvers see that a row follows which does to this: 1e-12 in eliminate.cpp

CONNECT, WELD, JOINT, TENDON = (
    int(getattr(mujoco.mjtEq, f"mjEQ_{name}")) for name in ("CONNECT", "WELD", "JOINT", "TENDON")
)

SITE = int(mujoco.mjtObj.mjOBJ_SITE)


class Equalities:
    """The equalities of a model."""

    def __init__(self, m: Any) -> None:
        self.model = m
        # how many bodies that are not the world lead to each, itself among them
        depth = np.zeros(m.nbody)
        for body in range(1, m.nbody):
            depth[body] = depth[m.body_parentid[body]] + 1
        # (neq x nbody) how often each is on the way to what an equality ties
        self.on_the_way = np.zeros((m.neq, m.nbody))
        self.depth = np.zeros(m.neq)
        self.arms = np.zeros(m.neq)  # of the points that are tied, in their bodies
        for i in range(m.neq):
            for body, point in ends_of(m, i):
                self.depth[i] += depth[body]
                self.arms[i] += np.linalg.norm(point)
                while body:
                    self.on_the_way[i, body] += 1
                    body = m.body_parentid[body]
        # each turns what comes after it
        self.turned = self.on_the_way * np.maximum(depth - 1, 0)

    def columns(self, d: Any, rows: Sparse) -> tuple[Sparse, Vector]:
        """G (n x p) and the violation (p), without rows that vanish.

        A loop in a plane has one out of it, which says 0 = 0.
        """
        if not d.ne:
            return empty((rows.shape[0], 0)), np.zeros(0)
        gradients = take(rows, np.arange(d.ne))
        kept = self.kept(d, gradients)
        G = take(gradients, kept)
        return consistent(G, d.efc_pos[: d.ne][kept], self.rounding(d)[kept])

    def kept(self, d: Any, gradients: Sparse) -> npt.NDArray[np.intp]:
        """Which rows do not vanish beside others of their equality, by their gradients (n x ne)."""
        sizes = np.sqrt(np.bincount(columns_of(gradients), gradients.data**2, minlength=d.ne))
        group = 2 * d.efc_id[: d.ne] + self.of_turns(d)
        largest = np.zeros(2 * self.model.neq)
        np.maximum.at(largest, group, sizes)
        vanish = (sizes <= RANK * largest[group]) | (
            # an equality of what cannot move
            (sizes <= RANK * sizes.max(initial=0.0)) & (sizes <= self.rounding(d))
        )
        return np.flatnonzero(~vanish)

    def of_turns(self, d: Any) -> npt.NDArray[np.bool_]:
        """Which rows (ne) are of angles of a weld: the last three of its six."""
        number = d.efc_id[: d.ne]
        place = np.arange(d.ne) - np.searchsorted(number, number)
        found: npt.NDArray[np.bool_] = place >= 3
        return found

    def rounding(self, d: Any) -> Vector:
        """What rounding may make of the violation of each row (ne) [m, rad]."""
        m = self.model
        lengths = np.linalg.norm(d.xpos, axis=1)
        steps = np.linalg.norm(d.xpos - d.xpos[m.body_parentid], axis=1)
        place = self.on_the_way @ lengths + self.turned @ steps + (self.depth + 2) * self.arms
        # of a weld an angle is multiplied by a length
        turn = m.eq_data[:, 10] * (self.depth + 2)
        for i in np.flatnonzero((m.eq_type == JOINT) | (m.eq_type == TENDON)):
            place[i] = terms(m, d, int(i))
        number = d.efc_id[: d.ne]
        sizes: Vector = np.where(self.of_turns(d), turn[number], place[number])
        return ROUNDING * np.finfo(float).eps * sizes

    def of_columns(self, d: Any, rows: Sparse) -> tuple[list[str], Vector]:
        """Of each column of G the name of its equality, and what rounding may make of it."""
        kept = self.kept(d, take(rows, np.arange(d.ne)))
        return [self.name(i) for i in d.efc_id[: d.ne][kept]], self.rounding(d)[kept]

    def name(self, i: int) -> str:
        """Of an equality: its own, or what it joins."""
        m = self.model
        kind = mujoco.mjtEq(m.eq_type[i])
        word = kind.name.removeprefix("mjEQ_").lower()
        own = mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_EQUALITY, i)
        if own:
            return f"{word} {own}"
        joined = mujoco.mjtObj(m.eq_objtype[i])
        if kind == mujoco.mjtEq.mjEQ_JOINT:
            joined = mujoco.mjtObj.mjOBJ_JOINT
        elif kind == mujoco.mjtEq.mjEQ_TENDON:
            joined = mujoco.mjtObj.mjOBJ_TENDON
        ends = [mujoco.mj_id2name(m, joined, k) for k in (m.eq_obj1id[i], m.eq_obj2id[i]) if k >= 0]
        return f"{word} {i} of {' and '.join(end or 'one without a name' for end in ends)}"


def ends_of(m: Any, i: int) -> list[tuple[int, Vector]]:
    """The two bodies that a connect or a weld ties, and where; none of other equalities."""
    if m.eq_type[i] not in (CONNECT, WELD):
        return []
    ends = [int(m.eq_obj1id[i]), int(m.eq_obj2id[i])]
    if m.eq_objtype[i] == SITE:
        return [(int(m.site_bodyid[end]), m.site_pos[end]) for end in ends]
    points = m.eq_data[i, :3], m.eq_data[i, 3:6]
    return list(zip(ends, points, strict=True))


def terms(m: Any, d: Any, i: int) -> float:
    """The sum of the sizes of what makes the violation of an equality of joints or tendons."""
    ends = [int(k) for k in (m.eq_obj1id[i], m.eq_obj2id[i]) if k >= 0]
    if m.eq_type[i] == JOINT:
        places = m.jnt_qposadr[ends]
        now, before, added = d.qpos[places], m.qpos0[places], 0.0
    else:
        now, before = d.ten_length[ends], m.tendon_length0[ends]
        # lengths between points of bodies
        points = float(np.sum(m.tendon_num[ends]))
        added = points * float(np.linalg.norm(d.site_xpos, axis=1).max(initial=0.0))
    sizes = np.abs(now) + np.abs(before)
    moved = np.polyval(np.abs(m.eq_data[i, 4::-1]), sizes[1] if len(ends) > 1 else 0.0)
    return float(sizes[0] + moved) + added


def consistent(G: Sparse, violation: Vector, rounding: Vector) -> tuple[Sparse, Vector]:
    """G (n x p) and the violation (p) without what rounding (p) makes of rows that follow.

    They become the combinations of others that they are but for rounding, which would ask for
    multipliers as large as it is small.
    """
    if are_independent(G, violation, rounding):
        return G, violation
    columns = G.toarray()
    first, others, share = found = dependence(columns, violation, rounding)
    if not len(others):
        return G, violation
    agree = gaps_of(columns, violation, rounding, found)[1] <= 1
    others, share = others[agree], share[:, agree]
    result = np.array(violation)
    result[others] = share.T @ violation[first]

    follow = columns[:, first] @ share
    sizes = np.linalg.norm(columns[:, others], axis=0)
    blurred = np.linalg.norm(columns[:, others] - follow, axis=0) > SEEN * sizes
    if not blurred.any():
        return G, result
    follow[np.abs(follow) <= 4 * np.finfo(float).eps * sizes] = 0.0
    columns[:, others[blurred]] = follow[:, blurred]
    n, p = columns.shape
    starts = n * np.arange(p + 1)
    return without_zeros(columns.T.ravel(), np.tile(np.arange(n), p), starts, (n, p)), result


def are_independent(G: Sparse, violation: Vector, rounding: Vector) -> bool:
    """Whether `dependence` finds that no column of G (n x p) follows from others, in less time.

    What is left of a column of length one, after others, is at least the smallest singular value of
    all: more than a bound where A^T A less its square on the diagonal has a Cholesky factor.
    """
    n, p = G.shape
    sizes = np.sqrt(np.bincount(columns_of(G), G.data * G.data, p))
    if p > n or not sizes.all():
        return False
    bound = max(left_of_followers(sizes, violation, rounding).max(initial=0.0), SINGULAR)
    scaled = by_columns(G.data / sizes.repeat(lengths_of(G.indptr)), G.indices, G.indptr, (n, p))
    gram = dense_gram(scaled)
    gram[np.arange(p), np.arange(p)] -= 2 * bound**2
    try:
        np.linalg.cholesky(gram)
    except np.linalg.LinAlgError:
        return False
    return True


def left_of_followers(sizes: Vector, violation: Vector, rounding: Vector) -> Vector:
    """What may be left (p) of columns that follow from others, of length one each.

    RANK, what rounding (p) makes of them, whose arms are differences of the same positions, and
    what the violation (p) does: rows of a closed loop turn as it opens.
    """
    blur = rounding / sizes + TURNED * opening(violation, sizes)
    bounds: Vector = np.clip(blur, RANK, OWN)
    return bounds


def dense_gram(A: Sparse) -> Vector:
    """A^T A (p x p); of many columns by their entries, which are few."""
    if A.shape[1] <= FEW:
        columns = A.toarray()
        few: Vector = columns.T @ columns
        return few
    many: Vector = (A.T @ A).toarray()
    return many


def gaps_of(
    columns: Vector,
    violation: Vector,
    rounding: Vector,
    found: tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Vector],
) -> tuple[Vector, Vector]:
    """By how much rows that follow from others contradict them, and beside what they may.

    They may by rounding, and to second order in how far the loop is open: rows that follow where it
    is closed are then off by the first.

    found   by `dependence`, of which the second are those rows
    """
    first, others, share = found
    sizes = sizes_of(columns)
    gaps = np.abs(violation[others] - share.T @ violation[first])
    opened = opening(violation, sizes)
    turned = TURNED * opened
    bent = sizes[others] * opened * turned / (1 + turned)  # less than what opens the loop itself
    return gaps, gaps / (rounding[others] + np.abs(share).T @ rounding[first] + bent)


def sizes_of(columns: Vector) -> Vector:
    """The lengths (p) of columns (n x p), 1 of those that are zero."""
    sizes: Vector = np.linalg.norm(columns, axis=0)
    return np.where(sizes > 0, sizes, 1.0)


def opening(violation: Vector, sizes: Vector) -> float:
    """How far a configuration is from one without a violation (p), as an angle."""
    return float((np.abs(violation) / sizes).max(initial=0.0))


def dependence(
    columns: Vector, violation: Vector, rounding: Vector
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Vector]:
    """Independent ones of the columns (n x p), the others, and these as combinations of those.

    The last is (rank x (p - rank)): columns[:, others] = columns[:, independent] @ it, but for what
    `left_of_followers` says.
    """
    import scipy.linalg as la  # takes a while

    sizes = sizes_of(columns)
    scaled = columns / sizes
    _, triangle, order = la.qr(scaled, mode="economic", pivoting=True)
    left = np.zeros(len(order))
    left[: len(triangle)] = np.abs(np.diag(triangle))
    follows = left <= left_of_followers(sizes, violation, rounding)[order]
    first, others = order[~follows], order[follows]
    share: Any = np.linalg.lstsq(scaled[:, first], scaled[:, others], rcond=None)[0]
    return first, others, share * sizes[others] / sizes[first][:, None]
