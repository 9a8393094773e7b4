"""MuJoCo's equalities as bilateral rows: vanishing rows, dependent rows, rounding errors.

A row that follows from others must agree with them: a loop in an inclined plane has three rows, and
two are independent. If the positions are exact up to rounding, the violations are only rounding,
and the third row contradicts the others by them. The bound on this rounding follows from the
lengths and angles that MuJoCo adds. So the size and the place of a mechanism do not matter.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from fclib import _core
from fclib.simulate._mujoco import mujoco
from fclib.simulate.arrays import Sparse, Vector, empty, matrix_of, without_zeros

# workshop/tables/loop_rounding.py chose these, docs/results/loop-rounding.csv has its results
RANK: Final = 1e-9  # rest of a row of length one, after the rows from which it follows
OWN: Final = 1e-3  # a row with a larger rest is independent
ROUNDING: Final = 2.0  # a gap may be so many units in the last place of all terms added
TURNED: Final = 8.0  # the rest of a row may be so many times the angle by which a loop is open
SINGULAR: Final = 1e-6  # A^T A tells larger singular values from zero: its rounding is below 1e-13
SEEN: Final = 1e-13  # solvers see that a row follows if its rest is below 1e-12 (eliminate.cpp)

CONNECT, WELD, JOINT, TENDON = (
    int(getattr(mujoco.mjtEq, f"mjEQ_{name}")) for name in ("CONNECT", "WELD", "JOINT", "TENDON")
)

SITE = int(mujoco.mjtObj.mjOBJ_SITE)


class Equalities:
    """The equalities of a model."""

    def __init__(self, m: Any) -> None:
        self.model = m
        # number of bodies on the way from the world to each, with the body itself
        depth = np.zeros(m.nbody)
        for body in range(1, m.nbody):
            depth[body] = depth[m.body_parentid[body]] + 1
        # (neq x nbody) how often each body is on the way to the bodies that an equality ties
        self.on_the_way = np.zeros((m.neq, m.nbody))
        self.depth = np.zeros(m.neq)
        self.arms = np.zeros(m.neq)  # lever arms of the tied points in their bodies
        for i in range(m.neq):
            for body, point in ends_of(m, i):
                self.depth[i] += depth[body]
                self.arms[i] += np.linalg.norm(point)
                while body:
                    self.on_the_way[i, body] += 1
                    body = m.body_parentid[body]
        # each turns all bodies after it
        self.turned = self.on_the_way * np.maximum(depth - 1, 0)
        # an angle of a weld is multiplied by a length
        self.turns = m.eq_data[:, 10] * (self.depth + 2)
        self.reach = (self.depth + 2) * self.arms
        self.ties = bool(self.depth.any())
        self.sums = np.flatnonzero((m.eq_type == JOINT) | (m.eq_type == TENDON)).tolist()

    def columns(self, d: Any) -> tuple[Sparse, Vector]:
        """G (n x p) and the violation (p), without rows that vanish.

        A loop in a plane has a row normal to the plane, which says 0 = 0.
        """
        n = self.model.nv
        if not d.ne:
            return empty((n, 0)), np.zeros(0)
        rounding = self.rounding(d)
        kept, columns = self.kept(d, rounding)
        G = matrix_of(columns, (n, len(kept)))
        return consistent(G, d.efc_pos[: d.ne][kept], rounding[kept])

    def kept(self, d: Any, rounding: Vector) -> tuple[npt.NDArray[np.int64], Any]:
        """Which rows are not zero beside others of their equality, and the arrays of G."""
        group = 2 * d.efc_id[: d.ne].astype(np.int64) + self.of_turns(d)
        kept, columns = _core.bilateral_rows(d, self.model.nv, group, rounding, RANK)
        return kept, columns

    def of_turns(self, d: Any) -> npt.NDArray[np.bool_]:
        """Which rows (ne) are angles of a weld: the last three of its six."""
        number = d.efc_id[: d.ne]
        place = np.arange(d.ne) - np.searchsorted(number, number)
        found: npt.NDArray[np.bool_] = place >= 3
        return found

    def rounding(self, d: Any) -> Vector:
        """The largest rounding error of the violation of each row (ne) [m, rad]."""
        m, place = self.model, self.reach
        if self.ties:
            lengths = np.linalg.norm(d.xpos, axis=1)
            steps = np.linalg.norm(d.xpos - d.xpos[m.body_parentid], axis=1)
            place = self.on_the_way @ lengths + self.turned @ steps + place
        elif self.sums:
            place = place.copy()
        for i in self.sums:
            place[i] = terms(m, d, i)
        number = d.efc_id[: d.ne]
        sizes: Vector = np.where(self.of_turns(d), self.turns[number], place[number])
        return ROUNDING * np.finfo(float).eps * sizes

    def of_columns(self, d: Any) -> tuple[list[str], Vector]:
        """The name of the equality of each column of G, and its largest rounding error."""
        rounding = self.rounding(d)
        kept, _ = self.kept(d, rounding)
        return [self.name(i) for i in d.efc_id[: d.ne][kept]], rounding[kept]

    def name(self, i: int) -> str:
        """The name of an equality: its own, or the names that it joins."""
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
    """The two bodies that a connect or a weld ties, and the points; empty for other equalities."""
    if m.eq_type[i] not in (CONNECT, WELD):
        return []
    ends = [int(m.eq_obj1id[i]), int(m.eq_obj2id[i])]
    if m.eq_objtype[i] == SITE:
        return [(int(m.site_bodyid[end]), m.site_pos[end]) for end in ends]
    points = m.eq_data[i, :3], m.eq_data[i, 3:6]
    return list(zip(ends, points, strict=True))


def terms(m: Any, d: Any, i: int) -> float:
    """The sum of the sizes of the terms in the violation of an equality of joints or tendons."""
    ends = [int(k) for k in (m.eq_obj1id[i], m.eq_obj2id[i]) if k >= 0]
    added = 0.0
    if m.eq_type[i] == JOINT:
        places = [int(m.jnt_qposadr[k]) for k in ends]
        sizes = [abs(float(d.qpos[k])) + abs(float(m.qpos0[k])) for k in places]
    else:
        sizes = [abs(float(d.ten_length[k])) + abs(float(m.tendon_length0[k])) for k in ends]
        # a tendon adds lengths between points of bodies
        points = float(np.sum(m.tendon_num[ends]))
        added = points * float(np.linalg.norm(d.site_xpos, axis=1).max(initial=0.0))
    # a polynomial of the second one
    moved, x = 0.0, sizes[1] if len(ends) > 1 else 0.0
    for factor in m.eq_data[i, 4::-1].tolist():
        moved = moved * x + abs(factor)
    return sizes[0] + moved + added


def consistent(G: Sparse, violation: Vector, rounding: Vector) -> tuple[Sparse, Vector]:
    """G (n x p) and the violation (p), without the effect of rounding (p) on dependent rows.

    Such rows are replaced by the exact combinations of the others. Otherwise the small rounding
    would need very large multipliers.
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
    """Whether no column of G (n x p) follows from others; faster than `dependence`."""
    return _core.are_independent(G, G.shape[0], violation, rounding, RANK, OWN, TURNED, SINGULAR)


def left_of_followers(sizes: Vector, violation: Vector, rounding: Vector) -> Vector:
    """The largest rest (p) of columns that follow from others, each of length one.

    It is the sum of RANK, of the effect of rounding (p), as lever arms are differences of the same
    positions, and of the effect of the violation (p): rows of a closed loop turn as it opens.
    """
    blur = rounding / sizes + TURNED * opening(violation, sizes)
    bounds: Vector = np.clip(blur, RANK, OWN)
    return bounds


def gaps_of(
    columns: Vector,
    violation: Vector,
    rounding: Vector,
    found: tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Vector],
) -> tuple[Vector, Vector]:
    """By how much dependent rows contradict the others, and by how much they may.

    Two effects are allowed: rounding, and a second-order effect of the opening of the loop. Rows
    that follow if the loop is closed are then off to first order.

    found   the result of `dependence`; its second entry has those rows
    """
    first, others, share = found
    sizes = sizes_of(columns)
    gaps = np.abs(violation[others] - share.T @ violation[first])
    opened = opening(violation, sizes)
    turned = TURNED * opened
    # less than the opening of the loop itself
    bent = sizes[others] * opened * turned / (1 + turned)
    return gaps, gaps / (rounding[others] + np.abs(share).T @ rounding[first] + bent)


def sizes_of(columns: Vector) -> Vector:
    """The lengths (p) of columns (n x p); 1 for a zero column."""
    sizes: Vector = np.linalg.norm(columns, axis=0)
    return np.where(sizes > 0, sizes, 1.0)


def opening(violation: Vector, sizes: Vector) -> float:
    """The distance of a configuration from one without a violation (p), as an angle."""
    return float((np.abs(violation) / sizes).max(initial=0.0))


def dependence(
    columns: Vector, violation: Vector, rounding: Vector
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Vector]:
    """Independent columns of (n x p), the other columns, and these as combinations of the former.

    The last is (rank x (p - rank)): columns[:, others] = columns[:, independent] @ it, up to the
    rest in `left_of_followers`.
    """
    import scipy.linalg as la  # the import takes a while

    sizes = sizes_of(columns)
    scaled = columns / sizes
    _, triangle, order = la.qr(scaled, mode="economic", pivoting=True)
    left = np.zeros(len(order))
    left[: len(triangle)] = np.abs(np.diag(triangle))
    follows = left <= left_of_followers(sizes, violation, rounding)[order]
    first, others = order[~follows], order[follows]
    share: Any = np.linalg.lstsq(scaled[:, first], scaled[:, others], rcond=None)[0]
    return first, others, share * sizes[others] / sizes[first][:, None]
