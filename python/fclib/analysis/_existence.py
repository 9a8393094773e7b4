"""Whether a problem has a solution: Slater's condition, a known solution, or a proof of none.

Let S be the symmetric part of W, positive semidefinite. Reactions that grow without bound tend
to a direction d in K with S d = 0 and q . d <= 0; so there is a solution if no such d exists. By
the theorem of the alternative this holds if some u = S x + q is strictly inside K*. For symmetric W
this is the criterion of Cadoux: a velocity strictly inside the dual cone exists (Acary, Cadoux,
Lemarechal & Malick 2011, "A formulation of the linear discrete Coulomb friction problem via convex
optimization"; Klarbring & Pang 1998, "Existence of solutions to discrete semicoercive frictional
contact problems").

If there are few contacts, all their states are tried (_enumerate.py).

With bilateral constraints W is W' = W - V R^-1 V^T here: a positive definite W says nothing if W'
is not positive definite. There are velocities only if the joints agree, so existence is claimed
only if that is shown (_joints.py). A proof that there is no solution is checked in exact arithmetic
(_certificate.py).

The lack of a Slater point proves nothing: jammed packings have solutions under prestress.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import lsmr

from fclib import _core, _laws, _solve
from fclib._words import counted
from fclib.analysis._certificate import Certificate, CertificateError, check, farkas
from fclib.analysis._conic import Program, add_dual_cones, shares
from fclib.analysis._data import SYMMETRIC, Array, Data, asymmetry
from fclib.analysis._enumerate import EXISTS, NONE, Enumeration
from fclib.analysis._joints import Joints, joints_of_rows

PAIRS = 500  # largest number of pairs of contacts tried as a proof
MARGIN = 1e-7  # least margin of a Slater point inside K*, relative to ||q||
LOOK = 2.0  # [s] time limit for a solution that no verdict needs

EXISTS_SLATER = "exists by Slater"
EXISTS_ENUMERATED = "exists by enumeration"
EXISTS_AT_HAND = "exists (a solution is at hand)"
PROVEN_NOT = "proven not to exist"
UNDECIDED = "undecided"
VERDICTS = (EXISTS_SLATER, EXISTS_ENUMERATED, EXISTS_AT_HAND, PROVEN_NOT, UNDECIDED)


@dataclass(frozen=True)
class Slater:
    """Slater's condition: a velocity strictly inside K* at every contact.

    Attributes:
        holds: whether one was found; None if the question was not decided.
        margin: the least u_N - mu ||u_T|| (- mu_r ||u_R||) of the best velocity found, relative to
            ||q||, at most 1; nan if none was sought.
        velocity: (m,) that velocity, [m/s].
        method: the method that found it.
        threshold: what the margin must exceed.
        witness: the source of that velocity, if it was sought: v of a global problem, otherwise x
            of u = S x + q.
    """

    holds: bool | None
    margin: float
    velocity: Array | None = field(repr=False, compare=False)
    method: str
    threshold: float = MARGIN
    witness: Array | None = field(default=None, repr=False, compare=False)


def prove(data: Data, time_limit: float = 60.0) -> Certificate | None:
    """A proof that there is no solution, or None if none was found.

    Raises:
        ImportError: Clarabel is not installed.
    """
    local, d, nc, p = data.local, data.d, data.problem.nc, data.problem.p
    if nc == 0 or not (local.q[::d] < 0).any():
        return None
    own = shares(data)
    program = Program(nc + p + own)
    scale = abs(data.stiffness)
    E = sp.csr_array((np.ones(nc), (d * np.arange(nc), np.arange(nc))), shape=(d * nc, nc))
    blocks = [-(data.W.T @ E) / scale]
    c = [local.q[::d] / data.speed]
    if local.V is not None:
        V, R = data.matrices["V"], data.matrices["R"]
        blocks.append(-V / scale)
        c.append(np.asarray(local.s) / data.speed)
        program.equal(
            sp.hstack([V.T @ E / scale, R.T / scale, sp.csr_array((p, own))]), np.zeros(p)
        )
    image = sp.hstack([*blocks, sp.csr_array((d * nc, own))])
    add_dual_cones(program, data, image, np.zeros(d * nc), nc + p)
    some = sp.csr_array(sp.eye_array(nc, program.size))
    program.nonnegative(some, np.zeros(nc))
    program.nonnegative(-sp.csr_array(some.sum(axis=0)[None, :]), np.ones(1))
    answer = program.solve(np.concatenate([*c, np.zeros(own)]), tol=1e-12, time_limit=time_limit)
    x = np.array(answer.x)
    y, z = np.maximum(0, x[:nc]), x[nc : nc + p] if p else None
    if not np.isfinite(x).all() or not y.any():
        return None
    # contacts outside the proof keep small parts, which are dropped; the others are moved to make
    # the image vanish, as it does for symmetric W
    for least in (1e-3, 1e-6, 1e-9, 0.0):
        kept = y > least * y.max()
        for trial in (_refined(data, E, kept, y, z), (np.where(kept, y, 0), z)):
            if proof := farkas(data.problem, *trial):
                return proof
    if p:
        return None
    # try pairs of contacts, in case W has lost their common part: any pair may show it
    normal = data.W.tocsr()[::d][:, ::d]
    upper = sp.coo_array(sp.triu(normal, k=1))
    diagonal = normal.diagonal()
    first, second, between = upper.row, upper.col, upper.data
    parallel = (between < 0) & (
        abs(diagonal[first] * diagonal[second] - between**2) <= 1e-14 * between**2
    )
    for a, b, shared in list(
        zip(first[parallel], second[parallel], between[parallel], strict=True)
    )[:PAIRS]:
        pair = np.zeros(nc)
        pair[a], pair[b] = diagonal[b], -shared
        if pair @ local.q[::d] < 0 and (proof := farkas(data.problem, pair)):
            return proof
    return None


def _refined(
    data: Data, E: sp.csr_array, kept: Array, y: Array, z: Array | None
) -> tuple[Array, Array | None]:
    """Y and z moved to the nearest ones whose images are zero."""
    nc, p = data.problem.nc, data.problem.p
    number = np.flatnonzero(kept)
    A = (data.W.T @ E)[:, number]
    x = y[number]
    if z is not None:
        V, R = data.matrices["V"], data.matrices["R"]
        A = sp.vstack([sp.hstack([A, V]), sp.hstack([(V.T @ E)[:, number], R.T])])
        x = np.concatenate([x, z])
    A = sp.csr_array(A)
    for _ in range(2):
        x = x - lsmr(A, A @ x, atol=1e-15, btol=1e-15, conlim=0, maxiter=20 * sum(A.shape))[0]
    result = np.zeros(nc)
    result[number] = np.maximum(0, x[: number.size])
    return result, x[number.size :] if p else None


def slater(
    data: Data,
    joints: Joints,
    semidefinite: bool,
    full: bool,
    time_limit: float = 60.0,
    *,
    conic: bool = True,
) -> Slater:
    """Look for a velocity strictly inside K*.

    Args:
        data: the problem.
        joints: the result of `joints_of`.
        semidefinite: whether the symmetric part of W (W' with bilateral constraints) is positive
            semidefinite; else the condition says nothing of solutions, and is not looked at.
        full: whether that part has full rank, so that each velocity can be reached.
        time_limit: [s] of the conic solver.
        conic: whether a conic program may decide if no simpler test does.

    Raises:
        ImportError: Clarabel is needed, but not installed.
    """
    d, nc, p = data.d, data.problem.nc, data.problem.p
    if nc == 0:
        if joints.agree:
            return Slater(True, 1.0, np.zeros(0), "there is no contact")
        return Slater(None if joints.agree is None else False, np.nan, None, joints.reason)
    if joints.agree is False:
        return Slater(False, np.nan, None, joints.reason)
    if not semidefinite:
        word = "W is not positive semidefinite"
        if p:
            word = "W' = W - V R^-1 V^T is not known to be positive semidefinite"
        return Slater(None, np.nan, None, word)
    inside = np.zeros(data.problem.m)
    inside[::d] = data.speed
    if full and joints.certain:
        word = "W has full rank" if p == 0 else "W' = W - V R^-1 V^T has full rank"
        return Slater(True, 1.0, inside, word)
    if p == 0 and data.dual_margin(data.local.q).min() > MARGIN * data.speed:
        margin = min(1.0, float(data.dual_margin(data.local.q).min() / data.speed))
        return Slater(True, margin, data.local.q, "the velocity without reactions")
    A, c, B, e = reachable(data)
    if e.size and (abs(B - joints.B).nnz if B.shape == joints.B.shape else True):
        joints = joints_of_rows(B, e)  # the problem is not symmetric
    if not joints.certain:
        return Slater(None, np.nan, None, joints.reason)
    # the velocity that opens every contact at the same speed, if it can be reached
    if p == 0:
        x = lsmr(A, inside - c, atol=1e-14, btol=1e-14, maxiter=500)[0]
        if found := _witness(data, A, c, joints, x, "least squares"):
            return found
    if not conic:
        return Slater(None, np.nan, None, "left out: the conic program")
    own = shares(data)
    k = A.shape[1]
    program = Program(k + 1 + own)  # x, t and the shares of the groups
    top = sp.csr_array((np.full(nc, -1.0), (d * np.arange(nc), np.zeros(nc, int))), (d * nc, 1))
    row_scale = abs(A.data).max(initial=0.0) or 1.0
    map_ = sp.hstack([A / row_scale, top, sp.csr_array((d * nc, own))])
    add_dual_cones(program, data, map_, c / data.speed, k + 1)
    if e.size:
        program.equal(sp.hstack([B / row_scale, sp.csr_array((e.size, 1 + own))]), e / data.speed)
    t = sp.csr_array(([1.0], ([0], [k])), shape=(1, program.size))
    program.nonnegative(-t, np.ones(1))
    goal = np.zeros(program.size)
    goal[k] = -1
    answer = program.solve(goal, time_limit=time_limit)
    x = np.array(answer.x)[:k] * data.speed / row_scale
    if np.isfinite(x).all() and (found := _witness(data, A, c, joints, x, "conic program")):
        return found
    # t has no lower bound, so that there is a solution: t <= 0 is an answer if the solver finished
    reached = float(answer.x[k])
    solved = "Solved" in str(answer.status) and "Almost" not in str(answer.status)
    return Slater(False if solved and reached <= MARGIN else None, reached, None, "conic program")


def reachable(data: Data) -> tuple[sp.csr_array, Array, sp.csr_array, Array]:
    """A, c, B, e: velocities are A x + c for all x with B x = e."""
    problem, local = data.problem, data.local
    bodies = isinstance(problem, _laws.Global)
    if bodies and asymmetry(data.matrices["M"]) <= SYMMETRIC:
        assert isinstance(problem, _laws.Global)
        G, b = data.matrices.get("G"), problem.b
        if G is None or b is None:
            return data.matrices["H"].T.tocsr(), problem.w, _nothing(problem.n), np.zeros(0)
        return data.matrices["H"].T.tocsr(), problem.w, sp.csr_array(G.T), -b
    if local.V is None or local.s is None:
        return _symmetric_part(data.W), local.q, _nothing(problem.m), np.zeros(0)
    V, R = data.matrices["V"], data.matrices["R"]
    whole = sp.vstack([sp.hstack([data.W, V]), sp.hstack([V.T, R])])
    S = _symmetric_part(whole)
    m = problem.m
    return S[:m], local.q, S[m:], -local.s


def _nothing(size: int) -> sp.csr_array:
    return sp.csr_array((0, size))


def _symmetric_part(a: sp.sparray) -> sp.csr_array:
    return sp.csr_array((a + a.T) / 2)


def _witness(
    data: Data, A: sp.csr_array, c: Array, joints: Joints, x: Array, method: str
) -> Slater | None:
    """A Slater point near x, checked from the data; None if none is shown to be one."""
    B, e = joints.B, joints.e
    for _ in range(2 if e.size else 0):
        x = x - lsmr(B, B @ x - e, atol=1e-15, btol=1e-15, conlim=0, maxiter=20 * sum(B.shape))[0]
    off = joints.distance(x) if e.size else 0.0
    u = A @ x + c
    lengths = np.sqrt(np.asarray(A.multiply(A).sum(axis=1)).ravel())
    rounding = 1e-12 * (abs(A) @ abs(x) + abs(c)).reshape(-1, data.d).sum(axis=1)
    if off > 0:  # the velocity that the joints allow is at most so far from this one
        rounding = rounding + off * (lengths[:: data.d] + data.resistance(lengths))
    margin = float((data.dual_margin(u) - rounding).min()) / data.speed
    if not margin > MARGIN:
        return None
    return Slater(True, min(1.0, margin), u, method, witness=x)


@dataclass(frozen=True)
class Existence:
    """The verdict on existence, one of VERDICTS, with its reason.

    Attributes:
        verdict: one of five.
        reason: in words.
        certificate: the proof, if there is no solution and Farkas' lemma shows it.
        solution: the known one, whatever the verdict; error: its merit (nan without one).
    """

    verdict: str
    reason: str
    certificate: Certificate | None = field(default=None, repr=False)
    solution: _core.Solution | None = field(default=None, repr=False, compare=False)
    error: float = float("nan")


def existence(
    data: Data,
    joints: Joints,
    condition: Slater,
    states: Enumeration | None,
    tol: float,
    time_limit: float,
) -> Existence:
    """The verdict; `states` is the result of the states of the contacts, if they were tried.

    Raises:
        ImportError: Clarabel is needed, but not installed.
    """
    problem = data.problem
    solution, error, proof = None, float("nan"), None
    why = ""
    agreed = ""  # the reason why other joints are used than those of the data
    if isinstance(problem, _laws.Global):
        found = problem.consistent()
        agreed = found[1] if found is not None else ""
    limit = min(time_limit, LOOK) if condition.holds else time_limit
    try:
        result = _solve.solve(problem, "auto", tol, time_limit=limit)
    except _core.UnsuitableError as refused:
        why = f"no solver takes it: {refused}"
    else:
        error = result.error
        solution = result.solution if result.converged else None
        why = f"the default solver ended as {result.status}, with an error of {error:.1e}"
        if result.certificate is not None:
            proof = farkas(problem, result.certificate, result.certificate_z)
    if joints.agree is False:
        return _contradiction(data, joints, agreed, why, solution, error)
    if condition.holds:
        name = "W'" if problem.p else "W"
        reason = f"Slater's condition holds ({condition.method}), {name} is positive semidefinite"
        return Existence(EXISTS_SLATER, reason, None, solution, error)
    refuted = states is not None and states.verdict == NONE
    if states is not None and states.verdict == EXISTS:
        if solution is None:
            solution = min(states.sound, key=lambda found: found.error).solution
            error = _core.merit(problem, solution).error
        return Existence(EXISTS_ENUMERATED, states.reason, None, solution, error)
    if solution is not None and refuted:
        assert states is not None
        reason = f"solved to an error of {error:.1e} relative to ||q||, but {states.reason}"
        return Existence(UNDECIDED, reason, None, solution, error)
    if solution is not None and states is not None and not (states.solutions or states.missing):
        reason = (
            f"solved to an error of {error:.1e} relative to ||q||, but each state of the contacts "
            "is refuted in exact arithmetic: a small change of the data decides"
        )
        return Existence(UNDECIDED, reason, None, solution, error)
    if solution is not None:
        reason = (
            f"solved to an error of {error:.1e} relative to ||q|| (tolerance {tol:.0e}), which is "
            "no proof"
        )
        if agreed:
            reason = f"{agreed}; {reason}"
        return Existence(EXISTS_AT_HAND, reason, None, solution, error)
    proof = proof or prove(data, time_limit)
    if proof is not None:
        which = "no reactions" if proof.exact else f"no reactions of a norm below {proof.bound:.1e}"
        how = "in exact arithmetic" if proof.exact else "W being rounded in its last digits"
        reason = f"{which} keep {counted(proof.contacts, 'contact')} from closing (Farkas, {how})"
        return Existence(PROVEN_NOT, reason, proof, None, error)
    if states is not None and refuted:
        return Existence(PROVEN_NOT, states.reason, None, None, error)
    if states is not None and states.states:
        why += f"; {states.reason}"
    return Existence(UNDECIDED, f"{why}; no proof was found that there is no solution", None)


def _contradiction(
    data: Data, joints: Joints, agreed: str, why: str, solution: _core.Solution | None, error: float
) -> Existence:
    """The proof by joints that contradict each other, unless it is within rounding."""
    for sign in () if agreed else (1, -1):
        z = {k: sign * value for k, value in joints.combination.items()}
        try:
            proof = check(data.problem, {}, z)
        except CertificateError:
            continue
        reason = f"{joints.reason}, in exact arithmetic"
        return Existence(PROVEN_NOT, reason, proof, None, error)
    rounding = agreed or "which may be the rounding of the data"
    reason = f"{joints.reason}, exactly; {rounding}; {why}"
    return Existence(UNDECIDED, reason, None, solution, error)
