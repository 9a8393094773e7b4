"""The cheap part of the analysis, for every file that is built.

Ranks and conditioning of all matrices, dense up to RANKS rows, of W on the bodies if these are
fewer: the nonzero eigenvalues of W are those of M^-1/2 H H^T M^-1/2. Above they are estimated.
Slater's condition without a conic program, uniqueness if a theorem gives it. `analyze` does the
rest.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.sparse.csgraph import structural_rank
from scipy.sparse.linalg import splu

from fclib import _core, _solve
from fclib._judge import judge
from fclib.analysis._analyze import (
    DEFINITE,
    UNKNOWN,
    Definiteness,
    definite_by_bodies,
    definiteness,
    enumerated,
    indefinite_in_part,
    uniqueness,
)
from fclib.analysis._data import DENSE, EPS, SYMMETRIC, Data, Local, asymmetry, columns
from fclib.analysis._enumerate import Enumeration
from fclib.analysis._existence import (
    EXISTS_AT_HAND,
    EXISTS_ENUMERATED,
    EXISTS_SLATER,
    PROVEN_NOT,
    UNDECIDED,
    slater,
)
from fclib.analysis._joints import joints_of
from fclib.analysis._reactions import reactions
from fclib.analysis._spectrum import LANCZOS, Spectrum, bidiagonal, quick_spectrum

RANKS = 5000  # largest side of a block whose rank and conditioning are found; a minute of CPU
SIDE = 1000  # largest side of a block that is treated densely for other facts
JOINTS = 0.5  # [s] wall clock limit for deciding whether joints agree


@dataclass(frozen=True)
class Brief:
    """The facts found, and the parts left out.

    Attributes:
        matrix_info: MATRIX_INFO of RT-0444, by the names of both forms' matrices.
        words: MATH_INFO of RT-0444.
        record: for a catalogue; None if nothing is known.
        left_out: parts that `analyze` would add, in words.
    """

    matrix_info: dict[str, _core.MatrixInfo] = field(default_factory=dict)
    words: str = ""
    record: dict[str, Any] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()


def brief(
    problem: _solve.Problem,
    local: Local,
    solution: _core.Solution | None = None,
    *,
    refuted: bool = False,
    states: Enumeration | None = None,
) -> Brief:
    """The cheap facts on a problem whose local form is at hand.

    Args:
        problem: any formulation.
        local: its local form, or itself.
        solution: a known solution.
        refuted: whether a solver has proved that there is no solution.
        states: the result of trying the states of the contacts, if they were tried.
    """
    data = Data(problem, local)
    matrices = data.matrices
    left_out = ["conic programs"]
    if states is None:
        left_out.append("states of the contacts")
    skewness = asymmetry(matrices["W"])
    spectra = {name: quick_spectrum(matrices[name], RANKS) for name in matrices if name != "W"}
    found = spectrum_of_W(data, skewness)
    sign = Definiteness(UNKNOWN, np.nan, np.nan, "left out", np.nan)
    if found is not None:
        spectra["W"] = found
    if found is not None and not found.estimate:
        sign = sign_of(data, found, skewness)
    known = found is not None and not found.estimate and not found.doubtful
    rank = found.rank if found is not None and known else None
    full = rank == problem.m and sign.word == DEFINITE[0]
    if problem.p and max(problem.n, problem.m, problem.p) > DENSE:
        full = False  # what follows from a regular W' is not tried there
    semidefinite = sign.word in DEFINITE[:2] or (sign.word == UNKNOWN and definite_by_bodies(data))
    joints = joints_of(data, JOINTS)
    condition = slater(data, joints, semidefinite, full, conic=False)
    unique = uniqueness(data, joints, sign, full, SIDE if full else 0)
    if states is not None:
        unique = enumerated(unique, states)
    error = judge(problem, solution).error if solution is not None else np.nan
    forces = reactions(data, unique.verdict, full, states, solution, error, SIDE)
    if condition.holds:
        existence, reason = EXISTS_SLATER, f"Slater's condition holds ({condition.method})"
    elif refuted:
        existence, reason = PROVEN_NOT, "a proof by Farkas' lemma, checked on the data"
    elif joints.agree is False:
        existence, reason = UNDECIDED, joints.reason
    elif states is not None and states.sound:
        existence, reason = EXISTS_ENUMERATED, states.reason
    elif solution is not None:
        existence = EXISTS_AT_HAND
        reason = f"solved to an error of {error:.0e} relative to ||q||, which is no proof"
    else:
        existence, reason = UNDECIDED, "tried: Slater's condition without a conic program, a solver"
    words = [f"Existence: {existence}: {reason}."]
    if existence != PROVEN_NOT:
        tried = "tried: " if unique.verdict == UNDECIDED else ""
        words.append(f"Velocity: {unique.verdict}: {tried}{unique.reason}.")
        words.append(f"Reactions: {forces.verdict}: {forces.reason}.")
    name = "W" if problem.p == 0 else "W' = W - V R^-1 V^T"
    if found is None:
        words.append(f"{name} is not known: it is only the rounding of that difference.")
    elif rank is None:
        most = "at most " if found.estimate else "doubtful: "
        words.append(f"The rank of {name} is {most}{found.rank} of {problem.m}.")
    else:
        skew = f", not symmetric by {skewness:.2g}" if skewness > SYMMETRIC else ""
        words.append(f"{name} is {sign.word}, of rank {rank} of {problem.m}{skew}.")
    words.append(f"Left out: {', '.join(left_out)}.")
    numbers = local.islands().contact
    return Brief(
        matrix_info_of(matrices, spectra, joints=problem.p > 0),
        " ".join(words),
        {
            "islands": int(numbers.max(initial=-1)) + 1,
            "largest_island": int(np.bincount(numbers).max(initial=0)),
            "asymmetry_W": skewness,
            "definiteness": None if sign.word == UNKNOWN else sign.word,
            "rank_H": exact(spectra.get("H"), "rank"),
            "conditioning_H": exact(spectra.get("H"), "conditioning"),
            "rank_W": rank,
            "conditioning_W": None if rank is None else exact(found, "conditioning"),
            "hyperstaticity": None if rank is None else problem.m - rank,
            "slater": condition.holds,
            "existence": None if existence == UNDECIDED else existence,
            "uniqueness": None if unique.verdict == UNDECIDED else unique.verdict,
            "reactions_unique": forces.known,
        },
        tuple(left_out),
    )


def exact(found: Spectrum | None, name: str) -> Any:
    """A fact on a spectrum, for a catalogue; None of an estimate."""
    if found is None or found.estimate:
        return None
    value = getattr(found, name)
    return digits(value) if isinstance(value, float) else value


def spectrum_of_W(data: Data, skewness: float) -> Spectrum | None:
    """Spectrum of W, on the bodies if these are fewer, or of W'; None if that is only rounding."""
    problem = data.problem
    if problem.p:
        reduced = data.reduced_within(RANKS)
        if reduced is not None:
            return quick_spectrum(reduced.W, RANKS, reduced.rounding)
        above = max(problem.n, problem.m, problem.p) > RANKS
        return estimate_with_joints(data) if above else None
    if skewness <= SYMMETRIC and 0 < problem.n < problem.m:
        gram = on_bodies(data)
        if gram is not None:
            found = quick_spectrum(gram, RANKS)
            return replace(found, method=f"{found.method} on the bodies")
    found = quick_spectrum(data.W, RANKS)
    if found.estimate and problem.n:
        most = min(found.rank, int(structural_rank(data.matrices["H"])), problem.n)
        found = replace(found, rank=most)
    return found


def estimate_with_joints(data: Data) -> Spectrum | None:
    """An estimate of the rank and the conditioning of a large W'; None if R is singular."""
    W, V, R = (data.matrices[name] for name in ("W", "V", "R"))
    try:
        factors = splu(columns(R))
    except RuntimeError:
        return None
    values = bidiagonal(
        lambda x: W @ x - V @ factors.solve(V.T @ x),
        lambda y: W.T @ y - V @ factors.solve(V.T @ y, "T"),
        data.problem.m,
    )
    top = float(values.max(initial=0.0))
    threshold = max(W.shape) * EPS * top
    smallest = float(values[values > threshold].min(initial=np.inf))
    free = data.problem.n - data.problem.p if data.problem.n else data.problem.m
    return Spectrum(
        max(0, min(int(structural_rank(W)), free)),
        top,
        smallest if np.isfinite(smallest) else 0.0,
        f"the structural rank and {LANCZOS} steps of Lanczos",
        threshold,
        estimate=True,
    )


def on_bodies(data: Data) -> Any:
    """M^-1/2 H H^T M^-1/2 as csc_array; None if M is not positive definite, or too large."""
    M, H = data.matrices["M"], data.matrices["H"]
    if data.problem.n > RANKS or asymmetry(M) > SYMMETRIC:
        return None
    # zeros between bodies stay exact, so that the blocks are found again
    gram = (H @ H.T).toarray()
    try:
        factor = cholesky(M.toarray(), lower=True)
    except np.linalg.LinAlgError:
        return None
    for _ in range(2):
        gram = solve_triangular(factor, gram, lower=True).T
    return columns((gram + gram.T) / 2)


def sign_of(data: Data, found: Spectrum, skewness: float) -> Definiteness:
    """The definiteness of W: on the bodies it is a square without negative eigenvalues.

    With joints, or of an asymmetric W, it is found as `analyze` finds it, if W is small.
    """
    if data.problem.p or skewness > SYMMETRIC:
        reduced = data.reduced if data.problem.m <= DENSE else None
        if reduced is None:
            return Definiteness(UNKNOWN, np.nan, np.nan, "left out", np.nan)
        sign = definiteness(data, reduced, found, DENSE)
        # if a rank may be rounding, only what is indefinite is certain
        return replace(sign, word=UNKNOWN) if found.doubtful and sign.word != DEFINITE[2] else sign
    size = data.problem.m
    bodies = data.problem.n and data.problem.n < size
    low, high = found.extremes if found.extremes is not None else (0.0, found.largest)
    low = 0.0 if bodies else low
    threshold = max(found.threshold, 10 * np.finfo(float).eps * high)
    part = not data.problem.n and -threshold <= low <= threshold
    if low < -threshold or (part and indefinite_in_part(data.W, SIDE)):
        word = DEFINITE[2]
    elif found.rank < size:
        word = DEFINITE[1]
    else:
        word = DEFINITE[0]
    return Definiteness(word, low, high, found.method, threshold)


def matrix_info_of(
    matrices: dict[str, Any], spectra: dict[str, Spectrum], joints: bool = False
) -> dict[str, _core.MatrixInfo]:
    """The sparsity of each matrix, and known facts on its singular values; with joints of W'."""
    known = {}
    for name, matrix in matrices.items():
        entries = max(1, matrix.shape[0] * matrix.shape[1])
        comment = f"sparsity {matrix.nnz / entries:.3g}"
        found = spectra.get(name)
        if found is None:
            known[name] = _core.MatrixInfo(comment=comment)
            continue
        full = found.rank == min(matrix.shape)
        whose = " of W' = W - V R^-1 V^T" if joints and name == "W" else ""
        if found.estimate:
            comment += f"; rank{whose} at most, conditioning at least, by {found.method}"
        else:
            of = "" if full else " of what is not singular"
            comment += f"; rank and conditioning{of}{whose} by {found.method}"
        if found.doubtful:
            comment += f"; {found.doubtful} more singular values may be rounding"
        comment += f"; zero is below {found.threshold:.0e}"
        known[name] = _core.MatrixInfo(
            comment=comment, rank=found.rank, conditioning=digits(found.conditioning)
        )
    return known


def digits(value: float) -> float:
    """Three digits, on which all machines agree."""
    return float(f"{value:.2e}")
