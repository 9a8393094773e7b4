"""Whether the reactions of a problem are unique, apart from its velocity.

All reactions of one velocity u are r + k, where k moves nothing and r + k stays in the faces of the
cones that u leaves open: none if the contact opens, a ray if it slides, K if it sticks. So

- if no k but 0 lies in these faces' directions, the reactions of this velocity are unique;
- if there is a k at contacts whose r lies inside its face, r + t k is a solution for all small t:
  they are not unique;
- else k leads out of a cone at once, or not: that is left undecided.

Ranks are those of doubles. Of a global problem k moves nothing if H k = G l for some l; no inverse
of M is needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import qr

from fclib import _core
from fclib.analysis._contacts import completed
from fclib.analysis._data import EPS, Array, Data, columns
from fclib.analysis._enumerate import Enumeration
from fclib.analysis._spectrum import blocks_of

UNIQUE, SEVERAL, UNDECIDED = "unique", "not unique", "undecided"
# a velocity above this, relative to max(||u||, ||q||), opens or slides; not less than so many
# times the error of the solution, which its velocity may be wrong by
MOVES, UNCERTAIN = 1e-9, 1e2
# how far inside of its face a reaction is at least, relative to mu r_N, and r_N to the largest
INSIDE = 1e-6
DOUBTFUL = 1e3  # times what counts as zero: up to here a pivot may be rounding, or not


@dataclass(frozen=True)
class Reactions:
    """Whether all solutions have the same reactions.

    Attributes:
        verdict: "unique", "not unique" or "undecided".
        reason: in words.
    """

    verdict: str
    reason: str

    @property
    def known(self) -> bool | None:
        """Whether they are unique, if that is known."""
        return {UNIQUE: True, SEVERAL: False}.get(self.verdict)


@dataclass(frozen=True)
class Faces:
    """Directions (m x k) in which the reactions of a velocity may differ.

    Attributes:
        all: of the whole faces; inside: of those in which r lies inside.
    """

    all: Any
    inside: Any


def reactions(
    data: Data,
    velocity: str,
    follow: bool,
    states: Enumeration | None,
    solution: _core.Solution | None,
    error: float,
    side: int,
) -> Reactions:
    """Whether the reactions are unique.

    Args:
        data: of the problem.
        velocity: the verdict on the velocity.
        follow: whether reactions follow from the velocity: W is regular.
        states: what the states of the contacts say, if they were looked at.
        solution: one that is at hand, and its error.
        error: see there.
        side: of a block that is treated densely; of a larger one nothing is said.
    """
    if data.problem.nc == 0:
        return Reactions(UNIQUE, "there is no contact")
    if states is not None and states.reaction_unique is not None:
        verdict = UNIQUE if states.reaction_unique else SEVERAL
        return Reactions(verdict, states.reason)
    if follow:
        return Reactions(velocity, "they follow from the velocity: W is regular")
    if solution is None:
        return Reactions(UNDECIDED, "no solution is at hand whose contacts say how free they are")
    faces = faces_of(data, solution, error)
    inside = freedom(data, faces.inside, side)
    if inside.least:
        words = f"{inside.least}" if inside.exact else f"{inside.least} at least"
        return Reactions(
            SEVERAL,
            f"at the solution at hand reactions of dimension {words} move nothing and stay in the"
            " cones",
        )
    whole = freedom(data, faces.all, side)
    if whole.exact and whole.least == 0:
        words = "at the solution at hand none moves nothing and stays in the cones"
        if velocity == UNIQUE:
            return Reactions(UNIQUE, words)
        return Reactions(UNDECIDED, f"of the stored velocity unique, of others not known: {words}")
    if not (whole.exact and inside.exact):
        return Reactions(
            UNDECIDED, "tried: a rank that doubles do not tell, or that costs too much"
        )
    return Reactions(
        UNDECIDED,
        f"tried: reactions of dimension {whole.least} move nothing, but some are at the edge of a"
        " cone",
    )


def faces_of(data: Data, solution: _core.Solution, error: float) -> Faces:
    """The directions that a solution leaves open."""
    d, nc = data.d, data.problem.nc
    _, u = completed(data, solution)
    speed, reaction = u.reshape(nc, d), solution.r.reshape(nc, d)
    threshold = max(MOVES, UNCERTAIN * error) * max(float(np.linalg.norm(u)), data.speed)
    least = INSIDE * float(abs(reaction[:, 0]).max(initial=0.0))
    entries: list[tuple[int, int, float]] = []
    inner: list[bool] = []  # of each direction
    for a in np.flatnonzero(speed[:, 0] <= threshold):
        N = d * int(a)
        ray = [(N, 1.0)]
        free: list[int] = []
        inside = bool(reaction[a, 0] > least)
        for mu, part in data.friction:
            moving, pull = speed[a, part], reaction[a, part]
            size = float(np.linalg.norm(moving))
            components = range(d)[part]
            limit = float(mu[a]) * float(reaction[a, 0])
            if not mu[a] > 0:
                continue
            if size > threshold:
                ray += [
                    (N + k, -float(mu[a] * x) / size)
                    for k, x in zip(components, moving, strict=True)
                ]
                continue
            free += [N + k for k in components]
            inside = inside and bool(np.linalg.norm(pull) < (1 - INSIDE) * limit)
        at = len(inner)
        entries += [(row, at, value) for row, value in ray]
        entries += [(row, at + 1 + k, 1.0) for k, row in enumerate(free)]
        inner += [inside] * (1 + len(free))
    rows, cols, values = zip(*entries, strict=True) if entries else ((), (), ())
    whole = columns(sp.coo_array((values, (rows, cols)), shape=(data.problem.m, len(inner))))
    return Faces(whole, columns(whole[:, np.flatnonzero(inner)]))


@dataclass(frozen=True)
class Freedom:
    """A dimension, or what it is at least."""

    least: int
    exact: bool = True


def freedom(data: Data, faces: Any, side: int) -> Freedom:
    """The dimension of what moves nothing in these directions.

    With joints: of the directions beside their multipliers, less what the multipliers alone leave.
    """
    matrices, size = data.matrices, faces.shape[1]
    if size == 0:
        return Freedom(0)
    if "H" in matrices:
        # rows of bodies of all masses count alike
        mass = matrices["M"].diagonal()
        if not (mass > 0).all():
            return Freedom(0, False)
        scale = sp.diags_array(1 / np.sqrt(mass))
        moved = scale @ matrices["H"] @ faces
        joints = scale @ matrices["G"] if "G" in matrices else None
    elif "V" in matrices:
        V, R = matrices["V"], matrices["R"]
        moved = sp.vstack([matrices["W"] @ faces, V.T @ faces])
        joints = sp.vstack([V, R])
    else:
        moved, joints = matrices["W"] @ faces, None
    # more directions than rows need no rank; rows without an entry are none
    held = np.unique(columns(moved).indices).size
    if size > held:
        return Freedom(size - held, False)
    if joints is None:
        rank = rank_of(moved, side)
    else:
        both, alone = rank_of(sp.hstack([moved, joints]), side), rank_of(joints, side)
        rank = None if both is None or alone is None else both - alone
    return Freedom(0, False) if rank is None else Freedom(size - rank)


def rank_of(a: Any, side: int) -> int | None:
    """The rank, with columns of length 1; None of a large matrix, or if doubles do not tell.

    By a factorisation Q R with pivots, which costs a tenth of the singular values.
    """
    a = columns(a)
    lengths: Array = np.sqrt(np.asarray(a.power(2).sum(axis=0)).ravel())
    a = columns(a @ sp.diags_array(1 / np.where(lengths > 0, lengths, 1.0)))
    blocks = blocks_of(a, side)
    if blocks.sparse:
        return None
    pivots = [
        abs(np.diagonal(qr(block, mode="r", pivoting=True)[0]))
        for stack in blocks.dense
        for block in stack
    ]
    found = np.concatenate([np.zeros(0), *pivots])
    threshold = 10 * max(a.shape) * EPS * float(found.max(initial=0.0))
    kept = found[found > threshold]
    # a pivot between what is rounding and what is none leaves the rank open
    if kept.min(initial=np.inf) < DOUBTFUL * threshold:
        return None
    return int(kept.size)
