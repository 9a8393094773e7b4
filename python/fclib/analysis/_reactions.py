"""Whether the reactions of a problem are unique, apart from its velocity.

All reactions of one velocity u are r + k, if k moves nothing and r + k stays in the faces of the
cones that u allows: zero if the contact opens, a ray if it slides, K if it sticks. So

- if no k but 0 lies in these faces' directions, the reactions of this velocity are unique;
- if there is a k at contacts whose r lies inside its face, r + t k is a solution for all small t:
  they are not unique;
- otherwise k may lead out of a cone at once, or not: this is left undecided.

Ranks are computed in doubles. In a global problem k moves nothing if H k = G l for some l; no
inverse of M is needed.
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
# a velocity above this, relative to max(||u||, ||q||), opens or slides; but the bound is at least
# so many times the error of the solution: its velocity may be wrong by as much
MOVES, UNCERTAIN = 1e-9, 1e2
# least distance of an inside reaction from its face's edge, relative to mu r_N; least r_N, relative
# to the largest
INSIDE = 1e-6
DOUBTFUL = 1e3  # a pivot up to so many times the bound for zero may be rounding, or not


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
        all: directions of all faces; inside: directions of the faces in which r lies inside.
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
        data: data of the problem.
        velocity: the verdict on the velocity.
        follow: whether reactions follow from the velocity, as W is regular.
        states: the result of the states of the contacts, if they were tried.
        solution: a known solution.
        error: its error.
        side: largest side of a block; a larger one is left undecided.
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
    """The directions that a solution allows."""
    d, nc = data.d, data.problem.nc
    _, u = completed(data, solution)
    speed, reaction = u.reshape(nc, d), solution.r.reshape(nc, d)
    threshold = max(MOVES, UNCERTAIN * error) * max(float(np.linalg.norm(u)), data.speed)
    least = INSIDE * float(abs(reaction[:, 0]).max(initial=0.0))
    entries: list[tuple[int, int, float]] = []
    inner: list[bool] = []  # for each direction
    for a in np.flatnonzero(speed[:, 0] <= threshold):
        N = d * int(a)
        ray = [(N, 1.0)]
        free: list[int] = []
        inside = bool(reaction[a, 0] > least)
        for group in data.friction:
            axes = group.axes[a]
            borne = np.flatnonzero(axes > 0)
            if not borne.size:
                continue
            # what meets no resistance says nothing of the others
            moving, pull = speed[a, group.part] * (axes > 0), reaction[a, group.part]
            components = np.arange(d)[group.part]
            if float(np.linalg.norm(moving)) > threshold:
                # against the sliding, on the boundary of the section r_N = 1
                way = axes * axes * moving / np.linalg.norm(axes * moving)
                if group.uniform:
                    way = axes * moving / np.linalg.norm(moving)
                ray += [(N + int(k), -float(x)) for k, x in zip(components, way, strict=True)]
                continue
            free += [N + int(k) for k in components[borne]]
            share = np.linalg.norm(pull[borne] / axes[borne])
            inside = inside and bool(share < (1 - INSIDE) * reaction[a, 0])
        at = len(inner)
        entries += [(row, at, value) for row, value in ray]
        entries += [(row, at + 1 + k, 1.0) for k, row in enumerate(free)]
        inner += [inside] * (1 + len(free))
    rows, cols, values = zip(*entries, strict=True) if entries else ((), (), ())
    whole = columns(sp.coo_array((values, (rows, cols)), shape=(data.problem.m, len(inner))))
    return Faces(whole, columns(whole[:, np.flatnonzero(inner)]))


@dataclass(frozen=True)
class Freedom:
    """A dimension, or a lower bound of it, in words."""

    least: int
    exact: bool = True


def freedom(data: Data, faces: Any, side: int) -> Freedom:
    """The dimension of the reactions that move nothing in these directions.

    With joints: the same for directions with multipliers, minus that for multipliers alone.
    """
    matrices, size = data.matrices, faces.shape[1]
    if size == 0:
        return Freedom(0)
    if "H" in matrices:
        # scale rows so that bodies of all masses count alike
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
    # with more directions than rows no rank is needed; rows without an entry do not count
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
    """The rank, with columns of length 1; None if the matrix is large, or doubles cannot tell.

    It uses a QR factorisation with pivots, which costs a tenth of the singular values.
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
    # a pivot that may or may not be rounding leaves the rank open
    if kept.min(initial=np.inf) < DOUBTFUL * threshold:
        return None
    return int(kept.size)
