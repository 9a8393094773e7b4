"""The cheap part of the analysis, for every file that is built.

Ranks and conditioning by dense eigenvalues of blocks up to a small size, of W on the bodies if
these are fewer: the nonzero eigenvalues of W are those of M^-1/2 H H^T M^-1/2. Slater's condition
without a conic program, uniqueness if a theorem gives it. `analyze` does the rest.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from fclib import _core, _solve
from fclib._judge import judge
from fclib.analysis._analyze import (
    DEFINITE,
    UNKNOWN,
    Definiteness,
    definite_by_bodies,
    enumerated,
    indefinite_in_part,
    uniqueness,
)
from fclib.analysis._data import SYMMETRIC, Data, Local, asymmetry, columns
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
from fclib.analysis._spectrum import Spectrum, blocks_of, spectrum

SIDE = 1000  # largest side of a block that is treated densely
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
    left_out = ["conditioning of H", "conic programs"]
    if states is None:
        left_out.append("states of the contacts")
    skewness = asymmetry(matrices["W"])
    found = spectrum_of_W(data, skewness)
    spectra: dict[str, Spectrum] = {}
    if found is None:
        left_out.insert(0, "rank of W" if problem.p == 0 else "rank of W' = W - V R^-1 V^T")
        sign = Definiteness(UNKNOWN, np.nan, np.nan, "left out", np.nan)
    else:
        spectra["W"] = found
        sign = sign_of(data, found)
    for name in ("M", "R"):
        if name in matrices and not blocks_of(matrices[name], SIDE, square=True).sparse:
            spectra[name] = spectrum(matrices[name], SIDE)
    rank = found.rank if found is not None else None
    full = rank == problem.m and sign.word == DEFINITE[0]
    semidefinite = sign.word in DEFINITE[:2] or (found is None and definite_by_bodies(data))
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
    if found is not None:
        words.append(f"W is {sign.word}, of rank {rank} of {problem.m}.")
    words.append(f"Left out: {', '.join(left_out)}.")
    numbers = local.islands().contact
    return Brief(
        matrix_info_of(matrices, spectra),
        " ".join(words),
        {
            "islands": int(numbers.max(initial=-1)) + 1,
            "largest_island": int(np.bincount(numbers).max(initial=0)),
            "asymmetry_W": skewness,
            "definiteness": None if found is None else sign.word,
            "rank_W": rank,
            "conditioning_W": None if found is None else digits(found.conditioning),
            "hyperstaticity": None if rank is None else problem.m - rank,
            "slater": condition.holds,
            "existence": None if existence == UNDECIDED else existence,
            "uniqueness": None if unique.verdict == UNDECIDED else unique.verdict,
            "reactions_unique": forces.known,
        },
        tuple(left_out),
    )


def spectrum_of_W(data: Data, skewness: float) -> Spectrum | None:
    """Spectrum of W, on the bodies if these are fewer; None with joints, or if it costs much."""
    problem = data.problem
    if problem.p or skewness > SYMMETRIC:
        return None
    if problem.n and problem.n < problem.m:
        gram = on_bodies(data)
        if gram is None or blocks_of(gram, SIDE, square=True).sparse:
            return None
        found = spectrum(gram, SIDE)
        return replace(found, method=f"{found.method} on the bodies")
    if blocks_of(data.W, SIDE, square=True).sparse:
        return None
    return spectrum(data.W, SIDE)


def on_bodies(data: Data) -> Any:
    """M^-1/2 H H^T M^-1/2 as csc_array; None if M is not positive definite, or too large."""
    M, H = data.matrices["M"], data.matrices["H"]
    if data.problem.n > SIDE or asymmetry(M) > SYMMETRIC:
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


def sign_of(data: Data, found: Spectrum) -> Definiteness:
    """The definiteness of W: on the bodies it is a square without negative eigenvalues."""
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
    matrices: dict[str, Any], spectra: dict[str, Spectrum]
) -> dict[str, _core.MatrixInfo]:
    """The sparsity of each matrix, and known facts on its singular values."""
    known = {}
    for name, matrix in matrices.items():
        entries = max(1, matrix.shape[0] * matrix.shape[1])
        comment = f"sparsity {matrix.nnz / entries:.3g}"
        found = spectra.get(name)
        if found is None:
            known[name] = _core.MatrixInfo(comment=comment)
            continue
        of = "" if found.rank == min(matrix.shape) else " of what is not singular"
        comment += f"; rank and conditioning{of} by {found.method}"
        comment += f", zero below {found.threshold:.0e}"
        known[name] = _core.MatrixInfo(
            comment=comment, rank=found.rank, conditioning=digits(found.conditioning)
        )
    return known


def digits(value: float) -> float:
    """Three digits, on which all machines agree."""
    return float(f"{value:.2e}")
