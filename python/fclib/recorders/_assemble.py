"""The problem of a step of any simulator, from data that every simulator has in some form.

The unknowns are the velocities v (n) at the end of the step, and the impulses r over it:

    M (v - v_free) = H r + G lambda        v_free: the velocity without contacts and constraints
    u = H^T v + w + R r,  K* contains u^, u^ . r = 0, r in K

Redundant rows of joints are left out by a QR with pivots of M^-1/2 G. Limits are contacts with
mu = 0; dry friction and compliance are auxiliary degrees of freedom (docs/mathematics.md).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt
import scipy.linalg as la
import scipy.sparse as sp

from fclib import _core, _laws, _solve

Vector = npt.NDArray[np.float64]
ORDERS: Final = {"NTT": (0, 1, 2), "TTN": (2, 0, 1)}
RANK: Final = 1e-9  # least size of an independent row of a joint, relative to the largest
RANK_SINGLE: Final = 1e-5  # the same of rows in single precision


@dataclass(frozen=True, kw_only=True)
class Contacts:
    """nc contacts; the rows of a contact are normal and tangents, in `order`.

    With `mu_s` the angular velocity about the normal follows, and with `mu_r` those about the
    tangents: d = 4, 5 or 6 rows. If contacts resist spin and not rolling, sliding and spin share
    their limit, as in MuJoCo's elliptic cone.
    """

    jacobian: Any  # (d nc x n) u = J v + w
    mu: npt.ArrayLike  # (nc)
    mu_s: npt.ArrayLike | None = None  # (nc) of spin [m]
    mu_r: npt.ArrayLike | None = None  # (nc) of rolling [m]
    w: npt.ArrayLike | None = None  # (d nc) [m/s], [rad/s]; None: 0
    order: Literal["NTT", "TTN"] = "NTT"
    point: Vector | None = None  # (nc x 3) in the world [m]
    frame: Vector | None = None  # (nc x 3 x 3) rows N, T1, T2
    bodies: npt.NDArray[np.int64] | None = None  # (nc x 2) N points from the first to the second
    gap: Vector | None = None  # (nc) the signed distance, if the engine gives it [m]

    def __len__(self) -> int:
        return len(np.atleast_1d(np.asarray(self.mu, dtype=float)))

    @property
    def components(self) -> int:
        """The rows of a contact, d."""
        return 3 + (self.mu_s is not None) + 2 * (self.mu_r is not None)

    @property
    def places(self) -> npt.NDArray[np.int64]:
        """The rows in the order N, T1, T2, then those of moments."""
        d = self.components
        order = (*ORDERS[self.order], *range(3, d))
        return np.asarray((d * np.arange(len(self))[:, None] + order).ravel(), dtype=np.int64)


@dataclass(frozen=True, kw_only=True)
class Joints:
    """p bilateral rows."""

    jacobian: Any  # (p x n) J v + b = 0
    b: npt.ArrayLike | None = None  # (p) [m/s]; None: 0
    rank: float = RANK  # a row whose rest after the earlier rows is smaller is redundant


@dataclass(frozen=True, kw_only=True)
class Limits:
    """k unilateral rows without friction."""

    jacobian: Any  # (k x n) J v + w >= 0
    w: npt.ArrayLike | None = None  # (k) [m/s]; None: 0


@dataclass(frozen=True, kw_only=True)
class DryFriction:
    """k rows that resist by an impulse of at most h F."""

    jacobian: Any  # (k x n)
    bound: npt.ArrayLike  # (k) F [N], [N m]


@dataclass(frozen=True)
class Assembled:
    """A problem, and the joint rows left out of it."""

    problem: Any  # a global problem; a LocalProblem if the engine gives only W
    dofs: int  # n; further degrees of freedom are auxiliary; for a local problem m
    redundant: tuple[int, ...] = ()  # rows of joints that follow from the others
    violated: float = 0.0  # largest deviation of a redundant row from its combination [m/s]
    info: dict[str, Any] = field(default_factory=dict)


def assemble(
    M: Any,
    v_free: npt.ArrayLike,
    h: float,
    contacts: Contacts | None = None,
    joints: Joints | None = None,
    limits: Limits | None = None,
    dry_friction: DryFriction | None = None,
    compliance: npt.ArrayLike | None = None,
    info: _core.ProblemInfo | None = None,
) -> Assembled:
    """The global problem of one step.

    The contacts of the problem are `contacts`, then `limits`, then `dry_friction`.

    Args:
        M: (n x n) symmetric, positive definite; the factor of v - v_free.
        v_free: (n) the velocity after the step without contacts, constraints and dry friction.
        h: length of the step [s].
        contacts: with friction.
        joints: bilateral rows; those that follow from others are left out.
        limits: unilateral rows without friction.
        dry_friction: dry friction of joints.
        compliance: (d nc) R of each component of `contacts`, in their order, 0 if it is rigid.
        info: info of the problem.

    Raises:
        ValueError: sizes disagree, h or a bound is negative, M is not positive definite.
    """
    v_free = vector(v_free)
    n = len(v_free)
    M = dense(M, "M", (n, n))
    if not h > 0:
        raise ValueError(f"the time step must be positive, not {h}")
    try:
        factor = la.cholesky(0.5 * (M + M.T), lower=True)
    except la.LinAlgError:
        raise ValueError("M is not positive definite") from None
    nc, d = (0, 3) if contacts is None else (len(contacts), contacts.components)
    rows: list[Vector] = []
    w: list[Vector] = []
    mu: list[Vector] = []
    R = np.zeros(d * nc)
    if contacts is not None:
        J = dense(contacts.jacobian, "the contacts' Jacobian", (d * nc, n))
        order = contacts.places
        rows.append(J[order])
        w.append(filled(contacts.w, d * nc, "w of the contacts")[order])
        mu.append(filled(contacts.mu, nc, "mu"))
        if compliance is not None:
            R = filled(compliance, d * nc, "the compliance")[order]
            if not (R >= 0).all():
                raise ValueError(f"the compliance must be >= 0, not {R.min():g}")
    elif compliance is not None:
        raise ValueError("the compliance is that of contacts, and there are none")
    if limits is not None:
        J = dense(limits.jacobian, "the limits' Jacobian", (None, n))
        own, speed = np.zeros((d * len(J), n)), np.zeros(d * len(J))
        own[::d], speed[::d] = J, filled(limits.w, len(J), "w of the limits")
        rows.append(own)
        w.append(speed)
        mu.append(np.zeros(len(J)))

    # auxiliary degrees of freedom: z = R r of compliant contacts, and the pressing mass of dry
    # friction
    soft = np.flatnonzero(R)
    mass = [1 / R[soft]]
    momentum = [np.zeros(len(soft))]
    at = [soft]
    before = sum(len(part) for part in rows)
    if dry_friction is not None:
        J = dense(dry_friction.jacobian, "the dry friction's Jacobian", (None, n))
        bound = filled(dry_friction.bound, len(J), "the bounds of dry friction")
        if not (bound >= 0).all():
            raise ValueError(f"a bound of dry friction must be >= 0, not {bound.min():g}")
        own = np.zeros((d * len(J), n))
        own[1::d] = J
        rows.append(own)
        w.append(np.zeros(d * len(J)))
        mu.append(np.ones(len(J)))
        # the mass is the inertia that the row moves
        moved = la.solve_triangular(factor, J.T, lower=True)
        inverse = (moved**2).sum(axis=0)
        mass.append(1 / np.where(inverse > 0, inverse, 1.0))
        momentum.append(-h * bound)
        at.append(before + d * np.arange(len(J)))
    places = np.concatenate(at)
    k = len(places)
    H_own = np.concatenate(rows) if rows else np.zeros((0, n))
    m = len(H_own)
    H = sp.lil_array((n + k, m))
    H[:n] = H_own.T
    H[n + np.arange(k), places] = 1.0
    G, b, violated = None, None, 0.0
    redundant: tuple[int, ...] = ()
    if joints is not None:
        J = dense(joints.jacobian, "the joints' Jacobian", (None, n))
        prescribed = filled(joints.b, len(J), "b of the joints")
        kept, violated = independent(factor, J, prescribed, joints.rank)
        redundant = tuple(sorted(set(range(len(J))) - set(kept.tolist())))
        if kept.size:
            G = sp.csc_array(np.vstack((J[kept].T, np.zeros((k, len(kept))))))
            b = prescribed[kept]
    limit = np.concatenate(mu) if mu else np.zeros(0)
    fields: dict[str, Any] = {
        "spacedim": d,
        "M": sp.csc_array(sp.block_diag((sp.csc_array(M), sp.diags_array(np.concatenate(mass))))),
        "H": sp.csc_array(H),
        "G": G,
        "f": np.concatenate((M @ v_free, *momentum)),
        "w": np.concatenate(w) if w else np.zeros(0),
        "mu": limit,
        "b": b,
        "info": info or _core.ProblemInfo(),
    }
    problem: _laws.Global
    if contacts is None or d == 3:
        problem = _core.GlobalProblem(**fields)
    else:
        others = np.zeros(len(limit) - nc)
        turning: dict[str, Any] = {
            name: np.concatenate((filled(own, nc, name), others))
            for name in ("mu_s", "mu_r")
            if (own := getattr(contacts, name)) is not None
        }
        if contacts.mu_s is None:
            problem = _core.GlobalRollingProblem(**fields, **turning)
        else:
            problem = _core.GlobalSpinProblem(**fields, **turning, coupled=int(d == 4))
    return Assembled(problem, n, redundant, violated)


def independent(
    factor: Vector, J: Vector, b: Vector, rank: float
) -> tuple[npt.NDArray[np.int64], float]:
    """Rows (of p x n), in their order, so that the others are combinations of them.

    Also the largest contradiction of a redundant row to them [m/s].
    """
    if not len(J):
        return np.zeros(0, dtype=np.int64), 0.0
    scaled = la.solve_triangular(factor, J.T, lower=True)
    _, triangle, pivots = la.qr(scaled, mode="economic", pivoting=True)
    sizes = np.abs(np.diag(triangle))
    count = int((sizes > rank * sizes.max(initial=0.0)).sum()) if sizes.size else 0
    kept, others = np.sort(pivots[:count]), np.sort(pivots[count:])
    violated = 0.0
    if others.size and count:
        share = np.linalg.lstsq(scaled[:, kept], scaled[:, others], rcond=None)[0]
        violated = float(np.abs(b[others] - share.T @ b[kept]).max())
    return kept.astype(np.int64), violated


def reaction_of(
    assembled: Assembled,
    contacts: Vector,
    limits: Vector,
    dry: tuple[Vector, Vector],
    joints: tuple[Vector, Vector],
) -> _core.Solution:
    """The reaction that an engine found, for the contacts and the kept rows of a problem.

    Args:
        assembled: the problem.
        contacts: (nc x d) impulses [N s], [N m s].
        limits: (k) impulses of the limits [N s], [N m s].
        dry: impulses of dry friction and their bounds [N s], [N m s].
        joints: rows (p x n) of the joints, and their impulses (p).
    """
    impulse, bound = dry
    r = np.zeros((assembled.problem.nc, contacts.shape[1]))
    nc, end = len(contacts), len(contacts) + len(limits)
    r[:nc] = contacts
    r[nc:end, 0] = limits
    # the bound presses dry friction
    r[end:, 0], r[end:, 1] = bound, impulse
    multipliers = None
    if assembled.problem.p:
        # multipliers of the kept rows that have the effect of all
        J, own = joints
        kept = np.setdiff1d(np.arange(len(J)), assembled.redundant)
        multipliers = np.linalg.lstsq(J[kept].T, J.T @ own, rcond=None)[0]
    return _core.Solution(r=r.ravel(), l=multipliers)


def associated_error(problem: Any, r: npt.ArrayLike) -> float:
    """The error of reactions by the associated law: u, not u^, in K*, with u . r = 0.

    It is `natural` without the shift mu ||u_T||: ||r - P_K(r - u)|| / ||q||.

    Raises:
        ValueError: the problem has rolling or spin friction.
    """
    if _laws.law_of(problem.kind):
        raise ValueError(
            "the associated law is that of contacts that do not resist rolling or spin"
        )
    local = problem.condense() if problem.kind.startswith("global") else problem
    r = vector(r)
    x = np.reshape(r - (local.W @ r + local.q), (-1, local.spacedim))
    mu = np.asarray(local.mu)
    t = np.linalg.norm(x[:, 1:], axis=1)
    normal = (x[:, 0] + mu * t) / (1 + mu**2)
    projected = np.zeros_like(x)
    inside, polar = t <= mu * x[:, 0], mu * t <= -x[:, 0]
    projected[:, 0] = np.where(inside, x[:, 0], np.where(polar, 0, normal))
    scale = np.where(inside, 1.0, np.where(polar | (t == 0), 0, mu * normal / np.where(t, t, 1)))
    projected[:, 1:] = scale[:, None] * x[:, 1:]
    residual = float(np.linalg.norm(r - projected.ravel()))
    size = float(np.linalg.norm(local.q))
    return residual / size if size else residual


def solve_associated(problem: Any, tol: float = 1e-8) -> Any:
    """Solve a problem by the associated law, as Drake's and MuJoCo's solvers do.

    The result's own error is that by Coulomb's law; `associated_error` gives the one by this law.

    Raises:
        OptionError, UnsuitableError: as `fclib.solve`.
        ValueError: the problem has rolling or spin friction.
    """
    # a start that Coulomb's law would not accept as a solution
    start = np.zeros((problem.nc, problem.spacedim))
    local = problem.condense() if problem.kind.startswith("global") else problem
    stiffness = float(local.W.diagonal().mean()) if problem.m else 1.0
    start[:, 0] = float(np.linalg.norm(local.q)) / (stiffness or 1.0)
    guess = _core.Solution(r=start.ravel())
    # the solver's own measure has other units
    for share in (1.0, 1e-2, 1e-4, 1e-6):
        own = max(share * tol, 1e-15)
        result = _solve.solve(problem, "associated", tol=own, guess=guess)
        if associated_error(problem, result.solution.r) <= tol:
            break
    return result


def vector(values: npt.ArrayLike) -> Vector:
    """Numbers as a vector of finite doubles. ValueError."""
    array = np.atleast_1d(np.asarray(values, dtype=float)).ravel()
    if not np.isfinite(array).all():
        raise ValueError("there is a number that is not finite")
    return array


def filled(values: npt.ArrayLike | None, size: int, name: str) -> Vector:
    """A vector of a size, 0 by default. ValueError."""
    array = np.zeros(size) if values is None else vector(values)
    if len(array) != size:
        raise ValueError(f"{name}: has {len(array)} numbers, not {size}")
    return array


def dense(matrix: Any, name: str, shape: tuple[int | None, int]) -> Vector:
    """A matrix as an array of finite doubles. ValueError if it has another shape."""
    known = _core.matrix_from(matrix, name).toarray() if sp.issparse(matrix) else matrix
    array = np.asarray(known, dtype=float)
    if array.size == 0:
        array = array.reshape((shape[0] or 0, shape[1]))
    if array.ndim != 2 or array.shape[1] != shape[1] or shape[0] not in (None, len(array)):
        wanted = " x ".join("any" if size is None else str(size) for size in shape)
        raise ValueError(f"{name}: is of shape {array.shape}, not {wanted}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: has a number that is not finite")
    return array
