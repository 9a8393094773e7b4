"""All that is known of a problem before it is solved, and whether it can be."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from fclib import _core, _digest, _solve
from fclib.analysis._data import SYMMETRIC, Data, asymmetry, columns
from fclib.analysis._existence import Certificate, Existence, Slater, existence, slater
from fclib.analysis._spectrum import DENSE, EPS, Spectrum, lowest_eigenvalue, spectrum

DEFINITE = ("positive definite", "positive semidefinite", "indefinite")
FAR = 1e4  # a size this many times above or below 1 is said to be far from the units
SPREAD = 1e6  # the same of a ratio inside the problem


@dataclass(frozen=True)
class Definiteness:
    """The sign of the symmetric part of W.

    Attributes:
        word: positive definite, positive semidefinite or indefinite.
        lowest, highest: its extreme eigenvalues.
        method: how they were found.
        threshold: up to which an eigenvalue counts as zero, absolute.
    """

    word: str
    lowest: float
    highest: float
    method: str
    threshold: float


@dataclass(frozen=True)
class Uniqueness:
    """Whether the velocity is unique, in the words of the theory.

    Attributes:
        verdict: "unique" or "undecided".
        reason: in words.
        contraction: Lipschitz constant of the map s -> mu ||u_T||, u the velocity of the convex
            problem with q + [s, 0, 0], in the norm of s: below 1 its fixed point is unique. nan
            where W is not symmetric positive definite.
        reactions: whether they follow from the velocity: W is nonsingular.
    """

    verdict: str
    reason: str
    contraction: float
    reactions: bool


@dataclass(frozen=True)
class Units:
    """The sizes of a problem in its own units, and what may give trouble.

    Attributes:
        mass: [kg] 1 / the mean of the diagonal of W.
        velocity: [m/s] the mean of |q_k|, as a root of squares.
        mass_ratio: the largest of the contacts' tr(W_aa) over the smallest.
        prestress: ||r|| mean(W_kk) / ||q|| of the solution at hand; nan without one.
        guess: in words.
        trouble: in words, one for each.
    """

    mass: float
    velocity: float
    mass_ratio: float
    prestress: float
    guess: str
    trouble: tuple[str, ...]


@dataclass(frozen=True)
class Analysis:
    """What a problem is. Each quantity says how it was found and what counted as zero.

    Attributes:
        problem: what was analysed.
        digest: of its data.
        nnz: entries that are not zero of each matrix, those of the local form too.
        sparsity: the same over rows times columns.
        asymmetry: of W, M and R: max |A - A^T| / max |A|.
        definiteness: of the symmetric part of W.
        spectra: rank and conditioning of H, W, M, R, where they are.
        islands: how many have contacts; largest_island: contacts of the largest.
        contact_density: m / n, unknowns of the contacts a degree of freedom (RT-0444; nan for a
            local problem, which has lost n).
        hyperstaticity: m - rank W, the dimension of the reactions that move nothing.
        hyperstaticity_ratio: m / rank W.
        units, slater, existence, uniqueness: see there.
    """

    problem: _solve.Problem = field(repr=False, compare=False)
    digest: str
    nnz: dict[str, int]
    sparsity: dict[str, float]
    asymmetry: dict[str, float]
    definiteness: Definiteness
    spectra: dict[str, Spectrum]
    islands: int
    largest_island: int
    contact_density: float
    hyperstaticity: int
    hyperstaticity_ratio: float
    units: Units
    slater: Slater
    existence: Existence
    uniqueness: Uniqueness

    @property
    def certificate(self) -> Certificate | None:
        """The proof where there is no solution."""
        return self.existence.certificate

    @property
    def record(self) -> dict[str, Any]:
        """One flat dictionary of JSON values; the keys are those of ``docs/analysis.md``."""
        problem = self.problem
        record: dict[str, Any] = {
            "digest": self.digest,
            "formulation": problem.formulation,
            "spacedim": problem.spacedim,
            "n": problem.n,
            "m": problem.m,
            "p": problem.p,
            "nc": problem.nc,
            "islands": self.islands,
            "largest_island": self.largest_island,
            "mu_min": float(problem.mu.min()) if problem.nc else None,
            "mu_max": float(problem.mu.max()) if problem.nc else None,
        }
        if isinstance(problem, (_core.LocalRollingProblem, _core.GlobalRollingProblem)):
            record["mu_r_min"] = float(problem.mu_r.min()) if problem.nc else None
            record["mu_r_max"] = float(problem.mu_r.max()) if problem.nc else None
        for name in self.nnz:
            record[f"nnz_{name}"] = self.nnz[name]
            record[f"sparsity_{name}"] = self.sparsity[name]
        for name, value in self.asymmetry.items():
            record[f"asymmetry_{name}"] = value
        record["definiteness"] = self.definiteness.word
        record["definiteness_method"] = self.definiteness.method
        record["definiteness_threshold"] = self.definiteness.threshold
        record["lowest_eigenvalue"] = self.definiteness.lowest
        for name, found in self.spectra.items():
            record[f"rank_{name}"] = found.rank
            record[f"conditioning_{name}"] = found.conditioning
            record[f"rank_{name}_method"] = found.method
            record[f"rank_{name}_threshold"] = found.threshold
        record |= {
            "contact_density": self.contact_density,
            "hyperstaticity": self.hyperstaticity,
            "hyperstaticity_ratio": self.hyperstaticity_ratio,
            "mass": self.units.mass,
            "velocity": self.units.velocity,
            "mass_ratio": self.units.mass_ratio,
            "prestress": self.units.prestress,
            "units": self.units.guess,
            "trouble": "; ".join(self.units.trouble),
            "slater": self.slater.holds,
            "slater_margin": self.slater.margin,
            "slater_method": self.slater.method,
            "slater_threshold": self.slater.threshold,
            "existence": self.existence.verdict,
            "existence_reason": self.existence.reason,
            "solution_error": self.existence.error,
            "uniqueness": self.uniqueness.verdict,
            "uniqueness_reason": self.uniqueness.reason,
            "contraction": self.uniqueness.contraction,
            "reactions_follow": self.uniqueness.reactions,
        }
        if self.certificate is not None:
            record["certificate_bound"] = self.certificate.bound
            record["certificate_contacts"] = np.flatnonzero(self.certificate.y).tolist()
        return {
            key: None if isinstance(value, float) and not np.isfinite(value) else value
            for key, value in record.items()
        }

    @property
    def words(self) -> str:
        """MATH_INFO of RT-0444: existence and uniqueness in words."""
        w = self.spectra["W"]
        text = [
            f"Existence: {self.existence.verdict}: {self.existence.reason}.",
            f"Velocity: {self.uniqueness.verdict}: {self.uniqueness.reason}.",
            f"W is {self.definiteness.word}, of rank {w.rank} of {self.problem.m}"
            + ("." if self.asymmetry["W"] <= SYMMETRIC else " and not symmetric."),
        ]
        if self.units.trouble:
            text.append(f"Trouble: {'; '.join(self.units.trouble)}.")
        return " ".join(text)

    @property
    def matrix_info(self) -> dict[str, _core.MatrixInfo]:
        """MATRIX_INFO of RT-0444, of the matrices that the problem has and that were looked at."""
        own = {name for name in self.nnz if getattr(self.problem, name, None) is not None}
        known = self.problem.matrix_info
        result = dict(known)
        for name in sorted(own & set(self.spectra)):
            found = self.spectra[name]
            full = found.rank == min(getattr(self.problem, name).shape)
            of = "" if full else " of what is not singular"
            result[name] = _core.MatrixInfo(
                comment=f"conditioning{of} and rank by {found.method}, "
                f"zero below {found.threshold:.1e}",
                conditioning=found.conditioning,
                rank=found.rank,
                determinant=known[name].determinant if name in known else 0.0,
            )
        return result


def analyze(
    problem: _solve.Problem,
    *,
    tol: float = 1e-8,
    time_limit: float = 20.0,
    dense: int = DENSE,
) -> Analysis:
    """What a problem is: sizes, ranks, conditioning, units, existence and uniqueness.

    Args:
        problem: any formulation.
        tol: the error up to which a solution is at hand.
        time_limit: [s] wall clock, of the solver and of each conic program.
        dense: the side of a block up to which singular values are found densely.

    Raises:
        fclib.ProblemError: the data is not valid.
        fclib.UnsuitableError: M is singular, so that there is no local form.
        ImportError: Clarabel is needed for the verdict, and not installed.
    """
    problem.validate()
    data = Data.of(problem)
    matrices = data.matrices
    spectra: dict[str, Spectrum] = {
        name: spectrum(matrices[name], dense) for name in ("H", "W", "M", "R") if name in matrices
    }
    sign = _definiteness(data, spectra["W"], dense)
    rank = spectra["W"].rank
    full = rank == problem.m
    condition = slater(
        data, sign.word != "indefinite", full and sign.word == DEFINITE[0], time_limit
    )
    verdict = existence(data, condition, tol, time_limit)
    numbers = data.local.islands().contact
    return Analysis(
        problem=problem,
        digest=_digest.digest(problem),
        nnz={name: int(a.nnz) for name, a in matrices.items()},
        sparsity={name: a.nnz / max(1, a.shape[0] * a.shape[1]) for name, a in matrices.items()},
        asymmetry={name: asymmetry(matrices[name]) for name in ("W", "M", "R") if name in matrices},
        definiteness=sign,
        spectra=spectra,
        islands=int(numbers.max(initial=-1)) + 1,
        largest_island=int(np.bincount(numbers).max(initial=0)),
        contact_density=problem.m / problem.n if problem.n else float("nan"),
        hyperstaticity=problem.m - rank,
        hyperstaticity_ratio=problem.m / rank if rank else float("nan"),
        units=_units(data, verdict),
        slater=condition,
        existence=verdict,
        uniqueness=_uniqueness(data, sign, full, dense),
    )


def _definiteness(data: Data, found: Spectrum, dense: int) -> Definiteness:
    """Of the symmetric part of W."""
    if found.extremes is not None:
        (low, high), method = found.extremes, found.method
    else:
        low, high, method = lowest_eigenvalue(columns((data.W + data.W.T) / 2), dense)
    threshold = max(data.problem.m, 10) * EPS * max(high, -low)
    if low < -threshold:
        word = DEFINITE[2]
    elif low <= threshold:
        word = DEFINITE[1]
    else:
        word = DEFINITE[0]
    return Definiteness(word, low, high, method, threshold)


def _uniqueness(data: Data, sign: Definiteness, full: bool, dense: int) -> Uniqueness:
    """By the contraction of the fixed point on s (Acary, Cadoux, Lemarechal & Malick 2011)."""
    if data.problem.nc == 0:
        return Uniqueness("unique", "there is no contact", 0.0, True)
    constant = float("nan")
    if data.symmetric and sign.word == DEFINITE[0]:
        constant = _contraction(data, dense)
    if constant < 1:
        reason = f"the fixed point on mu ||u_T|| is a contraction, of {constant:.2g}"
        return Uniqueness("unique", reason, constant, full)
    frictionless = not any(mu.any() for mu, _ in data.friction)
    if frictionless and data.symmetric and sign.word != DEFINITE[2]:
        return Uniqueness("unique", "the problem without friction is convex", constant, full)
    if np.isnan(constant):
        reason = "W is not symmetric positive definite"
    else:
        reason = f"the fixed point on mu ||u_T|| need not be a contraction ({constant:.2g})"
    return Uniqueness("undecided", reason, constant, full)


def _contraction(data: Data, dense: int) -> float:
    """sqrt(lambda_max(D W_TT D) lambda_max((W^-1)_NN)), D the coefficients of friction.

    r(s) minimises 1/2 r.W r + (q + E s).r over K, so that ||r - r'||_W <= ||E (s - s')||_W^-1, and
    the change of mu ||u_T|| is at most ||D W_T W^-1/2|| times that. With two groups of components
    (rolling) the sum of their norms costs a factor of sqrt(2).
    """
    d = data.d
    weights = np.zeros(data.problem.m)
    for mu, part in data.friction:
        for k in range(d)[part]:
            weights[k::d] = mu
    normal = np.arange(data.problem.m) % d == 0
    worst = 0.0
    numbers = data.local.islands().contact
    W = data.W.tocsr()
    order = np.argsort(numbers, kind="stable")
    for island in np.split(order, np.cumsum(np.bincount(numbers))[:-1]):
        rows = (d * island[:, None] + np.arange(d)).ravel()
        if rows.size > dense:
            return float("nan")
        block = W[rows][:, rows].toarray()
        weight, up = weights[rows], normal[rows]
        try:
            factor = cho_factor(block)
        except np.linalg.LinAlgError:
            return float("nan")
        selected = np.eye(rows.size)[:, up]
        inverse = cho_solve(factor, selected)[up]
        push = np.linalg.eigvalsh(weight[:, None] * block * weight)[-1]
        worst = max(worst, float(push * np.linalg.eigvalsh((inverse + inverse.T) / 2)[-1]))
    return float(np.sqrt(worst * len(data.friction)))


def _units(data: Data, verdict: Existence) -> Units:
    """A guess at the units, and what is far from 1 in them."""
    nc, d = data.problem.nc, data.d
    if nc == 0:
        nan = float("nan")
        return Units(nan, nan, nan, nan, "there is no contact", ())
    trace = data.W.diagonal().reshape(nc, d).sum(axis=1)
    mean = data.stiffness
    mass = 1 / mean
    velocity = float(np.sqrt(np.mean(data.local.q**2)))
    held = trace[trace > 0]
    ratio = float(held.max() / held.min()) if held.size else float("nan")
    prestress = float("nan")
    if verdict.solution is not None:
        prestress = float(np.linalg.norm(verdict.solution.r)) * mean / data.speed
    trouble = []
    if not 1 / FAR <= mass <= FAR:
        trouble.append(
            f"masses of {mass:.1e} make reactions and velocities of different sizes, which the "
            f"natural map adds: scaled(impulse={mean:.1e}) makes them alike"
        )
    if velocity and not 1 / FAR <= velocity <= FAR:
        trouble.append(f"velocities of {velocity:.1e}")
    if ratio > SPREAD:
        trouble.append(f"mass ratio of {ratio:.1e} between contacts")
    if held.size < nc:
        trouble.append(f"{nc - held.size} contacts that nothing can move (W_aa = 0)")
    if prestress > FAR:
        trouble.append(f"prestress: reactions {prestress:.1e} times what stops the velocity")
    guess = f"masses of about {mass:.1e} kg and velocities of about {velocity:.1e} m/s, if SI"
    return Units(mass, velocity, ratio, prestress, guess, tuple(trouble))
