"""Whether reactions can grow while nothing moves, with a proof from the data.

solvable    a velocity strictly inside K* is reached, and W is positive semidefinite. Then there is
            a solution, and all of them are bounded. Let u0 = H^T v0 + w be that velocity and vf the
            one without reactions. Each solution has r . W r + q . r <= 0, since u^ . r = 0 and
            mu ||u_T|| r_N >= 0, and q . r = u0 . r - (v0 - vf) . H r. With u0 . r >= c ||r|| on K,

                c ||r|| <= ||v0 - vf||_M ||r||_W - ||r||_W^2 <= ||v0 - vf||_M^2 / 4

            For a local problem v0 - vf is the x of u0 = S x + q, S the symmetric part of W. If S
            has eigenvalues down to -delta, because W is rounded,

                (c - delta ||x||) rho - delta rho^2 > (x . S x + delta ||x||^2) / 4

            must hold for some rho: on the ball of that radius the law has a solution as a
            variational inequality (Hartman & Stampacchia 1966), and none touches the boundary. It
            holds between two radii, so that other solutions may be beyond the larger one.
prestressed r_bar in K, not zero, with W r_bar = 0 (H r_bar + G l = 0 of a global problem).
open        neither is proven.

Sums are in rational numbers, so that nothing is rounded, and eigenvalues are bounded (_bounds.py).
r_bar is near the result of a conic program. In small problems it is found by elimination in
rational numbers. In others H has full row rank on the contacts that carry r_bar, so that some r_bar
is no farther than the rest of H r over the least singular value.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from math import hypot, inf, isfinite, sqrt

import numpy as np
import scipy.sparse as sp
from scipy.linalg import qr
from scipy.sparse.linalg import lsmr, spsolve

from fclib import _laws
from fclib._words import counted
from fclib.analysis._bounds import (
    Exact,
    below,
    dot,
    exact_rows,
    least_singular,
    length,
    lower_bound,
    root_above,
)
from fclib.analysis._conic import Program
from fclib.analysis._data import DENSE, Array, Data
from fclib.analysis._existence import Slater, reachable
from fclib.analysis._joints import Joints
from fclib.analysis._rational import Elimination

SOLVABLE = "solvable"
PRESTRESSED = "prestressed"
OPEN = "open"
FEW = 40  # largest number of unknowns eliminated in rational numbers: digits grow with each


@dataclass(frozen=True)
class SelfStress:
    """Whether reactions can grow while nothing moves.

    Attributes:
        verdict: "solvable", "prestressed" or "open".
        reason: in words.
        vector: the proof: (n,) the velocity v0 of a global problem, (m,) the x of a local one,
            or (m,) the reactions r_bar, as doubles near them.
        margin: solvable: the least u_N - mu ||u_T|| (- mu_r ||u_R||) of u0, over ||q||;
            prestressed: the share of ||r_bar|| by which its contacts are inside K.
        bound: if solvable, no solution has a norm ||r|| between this one and `far`; else inf.
        far: inf if W is shown to be positive semidefinite.
    """

    verdict: str
    reason: str
    vector: Array | None = field(default=None, repr=False, compare=False)
    margin: float = float("nan")
    bound: float = inf
    far: float = inf


def self_stress(
    data: Data, joints: Joints, condition: Slater, time_limit: float = 60.0
) -> SelfStress:
    """The verdict; `joints` is the result of `joints_of`.

    Raises:
        ImportError: Clarabel is needed, but not installed.
    """
    if data.problem.nc == 0 and not joints.agree:
        return SelfStress(OPEN, joints.reason)
    if data.problem.nc == 0:
        return SelfStress(SOLVABLE, "there is no contact", np.zeros(0), 1.0, 0.0)
    reason = "no velocity strictly inside K* was found"
    if condition.holds:
        found, reason = _solvable(data, joints, condition)
        if found is not None:
            return found
    stressed, why = _prestressed(data, time_limit)
    return stressed or SelfStress(OPEN, f"{reason}; {why}")


# ---- solvable


def _solvable(data: Data, joints: Joints, condition: Slater) -> tuple[SelfStress | None, str]:
    problem = data.problem
    A, c, B, e = reachable(data)
    x, velocity = condition.witness, condition.velocity
    if x is None:
        assert velocity is not None
        whole = sp.vstack([A, B])
        x = lsmr(whole, np.concatenate([velocity - c, e]), atol=1e-15, btol=1e-15, conlim=0)[0]
    if not np.isfinite(x).all():
        return None, "its numbers are too large or too small for doubles"
    off, delta, size = 0.0, 0.0, 0.0
    if isinstance(problem, _laws.Global):
        M = data.matrices["M"]
        if (M != M.T).nnz or not lower_bound(M) > 0:
            return None, "M is not shown to be symmetric positive definite"
        if e.size:
            off = joints.distance(x)
            if not isfinite(off):
                return None, "the joints are not shown to agree"
        away = x - _free(data, joints)
        energy = float(away @ (M @ away)) * (1 + 1e-6)
        rows = exact_rows(A)
    elif e.size:
        return None, "a local problem with bilateral constraints is not decided"
    else:
        delta = max(0.0, -lower_bound(A))
        size = float(np.linalg.norm(x)) * (1 + 1e-12)
        energy = max(0.0, float(x @ (A @ x))) * (1 + 1e-6) + 2 * delta * size**2
        rows = exact_rows(data.W, data.W.T)
    margins, forces = _inside(data, rows, x, c, off)
    if not margins.min() > 0:
        return None, f"in exact arithmetic contact {int(margins.argmin())} is not inside K*"
    least = float(forces.min()) - delta * size
    if not (least > 0 and least * least > delta * energy):
        return None, f"W is not shown to have no eigenvalue below {-delta:.1e}, which is not enough"
    root = sqrt(max(0.0, least * least - delta * energy))
    margin = min(1.0, float(margins.min()) / data.speed)
    reason = f"a velocity inside K* by {margin:.1e} of ||q||, in exact arithmetic"
    far = (least + root) / (2 * delta) * (1 - 1e-15) if delta else inf
    if delta:
        reason += f"; W may have eigenvalues of {-delta:.1e}, which solutions beyond {far:.1e} feel"
    return SelfStress(SOLVABLE, reason, x, margin, energy / (2 * (least + root)), far), ""


def _free(data: Data, joints: Joints) -> Array:
    """The velocity of a global problem without contact reactions."""
    problem = data.problem
    assert isinstance(problem, _laws.Global)
    M = data.matrices["M"]
    if not joints.kept.size:
        return np.asarray(spsolve(M, problem.f))
    G_T = joints.B[joints.kept]
    saddle = sp.block_array([[M, -G_T.T], [G_T, None]], format="csc")
    return np.asarray(spsolve(saddle, np.concatenate([problem.f, joints.e[joints.kept]])))[
        : problem.n
    ]


def _inside(data: Data, rows: Exact, x: Array, constant: Array, off: float) -> tuple[Array, Array]:
    """Lower bounds for each contact: of u_N - mu ||u_T|| (- ...), and of u . r over ||r|| on K.

    `off` bounds the distance of the exact x from this one.
    """
    d, nc = data.d, data.problem.nc
    exact = [Fraction(float(one)) for one in x]
    margins, forces = np.zeros(nc), np.zeros(nc)
    for a in range(nc):
        u = [dot(rows[d * a + k], exact) + Fraction(float(constant[d * a + k])) for k in range(d)]
        steep, left = 1.0, u[0]  # sqrt(1 + mu^2 + ...), its squares may overflow doubles
        if off:
            left -= Fraction(off) * length(rows[d * a])
        for mu, part in _laws.boxes(data.local, inner=False):
            friction = root_above(sum((t * t for t in u[part]), Fraction()))
            if off:
                friction += Fraction(off) * sum(
                    (length(row) for row in rows[d * a : d * a + d][part]), Fraction()
                )
            left -= Fraction(float(mu[a])) * friction
            steep = hypot(steep, float(mu[a]))
        margin = below(left)
        margins[a] = margin
        forces[a] = margin / (steep * (1 + 1e-15))
    return margins, forces


# ---- prestressed


def _prestressed(data: Data, time_limit: float) -> tuple[SelfStress | None, str]:
    """Reactions that move nothing, with as many contacts inside their cones as possible."""
    B = _moved(data)
    nc, d, own = data.problem.nc, data.d, data.problem.m
    extra = B.shape[1] - own
    # r and the joints' multipliers, then t of each contact: r_a - t_a e_N in K, 0 <= t_a <= 1
    size = B.shape[1] + nc
    program = Program(size)
    scale = float(abs(B.data).max(initial=0.0)) or 1.0
    program.equal(sp.hstack([B / scale, sp.csr_array((B.shape[0], nc))]), np.zeros(B.shape[0]))
    t = sp.csr_array((np.ones(nc), (np.arange(nc), B.shape[1] + np.arange(nc))), (nc, size))
    program.nonnegative(t, np.zeros(nc))
    program.nonnegative(-t, np.ones(nc))
    unknown = sp.eye_array(size, format="csr")
    normal = unknown[d * np.arange(nc)] - t
    program.nonnegative(normal, np.zeros(nc))
    for mu, part in _laws.boxes(data.local, inner=True):
        components = list(range(d))[part]
        length = 1 + len(components)
        stacked = sp.vstack(
            [sp.diags_array(mu) @ normal, *(unknown[d * np.arange(nc) + k] for k in components)],
            format="csr",
        )
        order = np.arange(length * nc).reshape(length, -1).T.ravel()
        program.second_order(stacked[order], np.zeros(order.size), length)
    goal = np.zeros(size)
    goal[B.shape[1] :] = -1
    answer = program.solve(goal, time_limit=time_limit)
    y = np.array(answer.x)
    if not np.isfinite(y).all():
        return None, "no reactions that move nothing were found"
    kept = np.flatnonzero(y[B.shape[1] :] > 0.5)
    if kept.size == 0:
        return None, "no reactions that move nothing were found"
    # frictionless contacts have only their normal reaction
    columns = [d * a for a in kept.tolist()]
    for mu, part in _laws.boxes(data.local, inner=True):
        columns += [d * a + k for a in kept.tolist() if mu[a] > 0 for k in range(d)[part]]
    columns = [*sorted(columns), *range(own, own + extra)]
    x = _in_kernel(B[:, columns], y[columns])
    if x is None:
        return (
            None,
            f"reactions of {counted(kept.size, 'contact')} move nothing up to rounding, no proof",
        )
    values, off = x
    place = dict(zip(columns, values, strict=True))
    margins = []
    for a in kept.tolist():
        r = [place.get(d * a + k, Fraction()) for k in range(d)]
        for mu, part in _laws.boxes(data.local, inner=True):
            friction = root_above(sum((one * one for one in r[part]), Fraction()))
            margins.append(Fraction(float(mu[a])) * r[0] - friction)
            if mu[a] > 0:
                margins[-1] -= Fraction(off) * (1 + Fraction(float(mu[a])))
        margins.append(r[0] - Fraction(off))
    least = min(margins)
    if least < 0 or not any(place[d * a] > Fraction(off) for a in kept.tolist()):
        return (
            None,
            f"reactions of {counted(kept.size, 'contact')} move nothing up to rounding, no proof",
        )
    r_bar = np.zeros(own)
    for k, value in place.items():
        if k < own:
            r_bar[k] = float(value)
    how = "in exact arithmetic" if off == 0 else f"some within {off:.1e} of these doubles"
    reason = f"reactions of {counted(kept.size, 'contact')} move nothing, {how}"
    return SelfStress(
        PRESTRESSED, reason, r_bar, max(0.0, below(least)) / float(np.linalg.norm(r_bar))
    ), ""


def _moved(data: Data) -> sp.csr_array:
    """B of B (r, l) = 0: the motion by reactions, and by those of joints."""
    if isinstance(data.problem, _laws.Global):
        parts = [data.matrices["H"]] + ([data.matrices["G"]] if "G" in data.matrices else [])
        return sp.csr_array(sp.hstack(parts))
    if "V" not in data.matrices:
        return sp.csr_array(data.W)
    V, R = data.matrices["V"], data.matrices["R"]
    return sp.csr_array(sp.vstack([sp.hstack([data.W, V]), sp.hstack([V.T, R])]))


def _in_kernel(B: sp.csr_array, y: Array) -> tuple[list[Fraction], float] | None:
    """A vector near y, and its distance to one whose image is exactly zero; None: not shown."""
    B = sp.csr_array(B)
    B = B[np.flatnonzero(np.diff(B.indptr))]
    for _ in range(2):
        y = y - lsmr(B, B @ y, atol=1e-15, btol=1e-15, conlim=0, maxiter=20 * sum(B.shape))[0]
    if B.shape[0] <= B.shape[1] and B.shape[0] <= DENSE and (least := least_singular(B)) > 0:
        exact = [Fraction(float(one)) for one in y]
        square = sum((dot(row, exact) ** 2 for row in exact_rows(B)), Fraction())
        return exact, float(root_above(square)) / least * (1 + 1e-14)
    if B.shape[1] > 2 * DENSE or B.shape[0] > DENSE:
        return None
    _, upper, order = qr(B.toarray(), mode="economic", pivoting=True)
    values = abs(np.diag(upper))
    rank = int((values > 1e-10 * values.max(initial=0)).sum())
    if rank > FEW:
        return None
    equations = exact_rows(B)
    elimination = Elimination(equations)
    elimination.take_out(order[:rank].tolist())
    if any(equations):
        return None  # the rest shows that the rank is higher, because of rounding
    start = {int(k): Fraction(float(y[k])) for k in order[rank:]}
    full = elimination.complete(start)
    return [full.get(k, Fraction()) for k in range(B.shape[1])], 0.0
