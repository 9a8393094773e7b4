"""Facts on a problem before it is solved, and whether it can be solved."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse.csgraph import connected_components

from fclib import _core, _digest, _laws, _solve
from fclib._words import counted
from fclib.analysis._bounds import least_singular, lower_bound
from fclib.analysis._certificate import Certificate
from fclib.analysis._data import (
    DENSE,
    EPS,
    SYMMETRIC,
    Array,
    Data,
    Reduced,
    asymmetry,
    balanced,
    check_arguments,
    columns,
    norm,
)
from fclib.analysis._enumerate import Enumeration, enumerate_solutions
from fclib.analysis._existence import PROVEN_NOT, Existence, Slater, existence, slater
from fclib.analysis._joints import Joints, joints_of
from fclib.analysis._reactions import UNDECIDED, Reactions, reactions
from fclib.analysis._self_stress import SelfStress, self_stress
from fclib.analysis._spectrum import Spectrum, lowest_eigenvalue, spectrum

DEFINITE = ("positive definite", "positive semidefinite", "indefinite")
UNKNOWN = "not known"
ENUMERATION = 5.0  # [s] time limit for trying the states of all contacts
FAR = 1e4  # a size this many times above or below 1 is reported as far from the units
SPREAD = 1e6  # the same for a ratio inside the problem


@dataclass(frozen=True)
class Definiteness:
    """The sign of the symmetric part of W; of W' = W - V R^-1 V^T with bilateral constraints.

    Attributes:
        word: positive definite, positive semidefinite, indefinite or not known.
        lowest, highest: its extreme eigenvalues.
        method: the method that found them.
        threshold: absolute bound up to which an eigenvalue counts as zero.
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
        verdict: "unique", "not unique" or "undecided".
        reason: in words.
        contraction: Lipschitz constant of the map s -> mu ||u_T||, u the velocity of the convex
            problem with q + [s, 0, 0], in the norm of s: below 1 its fixed point is unique. nan
            if W is not symmetric positive definite.
        reactions: whether they follow from the velocity, as W is nonsingular.
    """

    verdict: str
    reason: str
    contraction: float
    reactions: bool


@dataclass(frozen=True)
class Units:
    """The sizes of a problem in its own units, and possible sources of trouble.

    Attributes:
        mass: [kg] 1 / the mean of the diagonal of W.
        velocity: [m/s] the root mean square of q_k.
        mass_ratio: the largest tr(W_aa) of a contact over the smallest.
        prestress: ||r|| mean(W_kk) / ||q|| of the known solution; nan without one.
        guess: a guess at the units, in words.
        trouble: the sources of trouble, one sentence each.
    """

    mass: float
    velocity: float
    mass_ratio: float
    prestress: float
    guess: str
    trouble: tuple[str, ...]


@dataclass(frozen=True)
class Analysis:
    """The analysis of a problem. Each quantity has its method and its bound for zero.

    Attributes:
        problem: the problem that was analysed.
        digest: of its data.
        nnz: number of nonzero entries of each matrix, also of the local form.
        sparsity: the same over rows times columns.
        asymmetry: of W, M and R: max |A - A^T| / max |A|.
        definiteness: definiteness of the symmetric part of W.
        spectra: rank and conditioning of H, W, M, R, if the problem has them. With bilateral
            constraints "W" is W' = W - V R^-1 V^T, and is missing if that is rounding or too large.
        islands: number of islands with contacts; largest_island: number of contacts of the largest.
        contact_density: m / n, contact unknowns for each degree of freedom (RT-0444; nan for a
            local problem, which does not know n).
        hyperstaticity: m - rank W, the dimension of the reactions that move nothing; None if the
            rank is not known.
        hyperstaticity_ratio: m / rank W.
        units, slater, existence, uniqueness, reactions, self_stress: see their classes.
        enumeration: result of trying the states of all contacts; None if theorems say it all.
        isolated_solutions: their number; None if not known.
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
    hyperstaticity: int | None
    hyperstaticity_ratio: float
    units: Units
    slater: Slater
    existence: Existence
    uniqueness: Uniqueness
    reactions: Reactions
    self_stress: SelfStress
    enumeration: Enumeration | None = field(default=None, repr=False)

    @property
    def isolated_solutions(self) -> int | None:
        """The number of solutions that have no other near them."""
        if self.enumeration is None:
            return 1
        return len(self.enumeration.isolated) if self.enumeration.complete else None

    @property
    def certificate(self) -> Certificate | None:
        """The proof that there is no solution, if there is one."""
        return self.existence.certificate

    @property
    def record(self) -> dict[str, Any]:
        """One flat dictionary of JSON values; its keys are those of ``docs/analysis.md``."""
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
        }
        for name, values in _laws.coefficients(problem).items():
            record[f"{name}_min"] = float(values.min()) if problem.nc else None
            record[f"{name}_max"] = float(values.max()) if problem.nc else None
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
        if "W" not in self.spectra:
            record |= dict.fromkeys(
                ("rank_W", "conditioning_W", "rank_W_method", "rank_W_threshold")
            )
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
            "self_stress": self.self_stress.verdict,
            "self_stress_reason": self.self_stress.reason,
            "reaction_bound": self.self_stress.bound,
            "reaction_far": self.self_stress.far,
            "uniqueness": self.uniqueness.verdict,
            "uniqueness_reason": self.uniqueness.reason,
            "contraction": self.uniqueness.contraction,
            "reactions_follow": self.uniqueness.reactions,
            "reactions_unique": self.reactions.known,
            "reactions_reason": self.reactions.reason,
            "isolated_solutions": self.isolated_solutions,
        }
        if self.certificate is not None:
            record["certificate_bound"] = self.certificate.bound
            record["certificate_contacts"] = sorted(self.certificate.exact_y)
        return {
            key: None if isinstance(value, float) and not np.isfinite(value) else value
            for key, value in record.items()
        }

    @property
    def words(self) -> str:
        """MATH_INFO of RT-0444: existence and uniqueness in words."""
        name = "W" if self.problem.p == 0 else "W' = W - V R^-1 V^T"
        sign = f"{name} is not known."
        if (w := self.spectra.get("W")) is not None:
            sign = f"{name} is {self.definiteness.word}, of rank {w.rank} of {self.problem.m}"
            skewness = self.asymmetry["W"]
            sign += "." if skewness <= SYMMETRIC else f" and not symmetric, by {skewness:.2g}."
        text = [
            f"Existence: {self.existence.verdict}: {self.existence.reason}.",
            f"Self-stress: {self.self_stress.verdict}: {self.self_stress.reason}.",
            f"Velocity: {self.uniqueness.verdict}: {self.uniqueness.reason}.",
            f"Reactions: {self.reactions.verdict}: {self.reactions.reason}.",
            sign,
        ]
        if self.units.trouble:
            text.append(f"Trouble: {'; '.join(self.units.trouble)}.")
        return " ".join(text)

    @property
    def matrix_info(self) -> dict[str, _core.MatrixInfo]:
        """MATRIX_INFO of RT-0444, for the matrices that the problem has and that were analysed."""
        own = {name for name in self.nnz if getattr(self.problem, name, None) is not None}
        if self.problem.p:
            own.discard("W")  # the known facts are of W'
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


# what overflows is not finite, and decides nothing
@np.errstate(over="ignore", divide="ignore", invalid="ignore")
def analyze(
    problem: _solve.Problem, *, tol: float = 1e-8, time_limit: float = 20.0, dense: int = DENSE
) -> Analysis:
    """Analyse a problem: sizes, ranks, conditioning, units, existence and uniqueness.

    Args:
        problem: any formulation.
        tol: the error up to which a vector counts as a solution.
        time_limit: [s] wall clock, of the solver and of each conic program. The solver has at most
            2 s if Slater's condition proves that there is a solution.
        dense: largest side of a block whose singular values are found densely.

    Raises:
        fclib.ProblemError: the data is not valid.
        fclib.OptionError: tol or time_limit is no number, or out of range.
        fclib.UnsuitableError: M is singular, so that there is no local form.
        ImportError: Clarabel is needed for the verdict, but not installed.
    """
    check_arguments(problem, time_limit=time_limit, tol=tol)
    problem.validate()
    data = Data.of_problem(problem)
    matrices = data.matrices
    nan = float("nan")
    spectra: dict[str, Spectrum] = {
        name: spectrum(matrices[name], dense) for name in ("H", "M", "R") if name in matrices
    }
    reduced = data.reduced
    if reduced is None:
        sign = Definiteness(UNKNOWN, nan, nan, "too large or too close to singular", nan)
        rank = None
    else:
        found = spectrum(reduced.W, dense, reduced.rounding)
        sign = definiteness(data, reduced, found, dense)
        rank = None if found.doubtful else found.rank
        if rank is not None:
            spectra["W"] = found
        elif sign.word == DEFINITE[1]:
            sign = replace(sign, word=UNKNOWN)
    full = rank == problem.m and sign.word == DEFINITE[0]
    # W = H^T M^-1 H, whatever its size
    semidefinite = sign.word in DEFINITE[:2] or (sign.word == UNKNOWN and definite_by_bodies(data))
    joints = joints_of(data)
    condition = slater(data, joints, semidefinite, full, time_limit)
    unique = uniqueness(data, joints, sign, full, dense)
    states = None
    # theorems show a single solution; otherwise the states of the contacts give the number
    if not (condition.holds and unique.verdict == "unique" and unique.reactions):
        states = enumerate_solutions(problem, time_limit=min(time_limit, ENUMERATION))
        unique = enumerated(unique, states)
    verdict = existence(data, joints, condition, states, tol, time_limit)
    if verdict.verdict == PROVEN_NOT:
        # theorems of uniqueness say that there is at most one solution
        unique = replace(unique, verdict="undecided", reason="there is no solution")
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
        contact_density=problem.m / problem.n if problem.n else nan,
        hyperstaticity=None if rank is None else problem.m - rank,
        hyperstaticity_ratio=problem.m / rank if rank else nan,
        units=_units(data, verdict),
        slater=condition,
        existence=verdict,
        uniqueness=unique,
        reactions=Reactions(UNDECIDED, unique.reason)
        if verdict.verdict == PROVEN_NOT
        else reactions(
            data, unique.verdict, unique.reactions, states, verdict.solution, verdict.error, dense
        ),
        self_stress=self_stress(data, joints, condition, time_limit),
        enumeration=states,
    )


def definite_by_bodies(data: Data) -> bool:
    """Whether M is positive definite and no joint follows from others, so that W' is exact."""
    M, G = data.matrices.get("M"), data.matrices.get("G")
    if M is None or (M != M.T).nnz or not lower_bound(M) > 0:
        return False
    return G is None or least_singular(G.T) > 0


def definiteness(data: Data, reduced: Reduced, found: Spectrum, dense: int) -> Definiteness:
    """The definiteness of the symmetric part of W, or of W'."""
    symmetric = columns((reduced.W + reduced.W.T) / 2)
    if found.extremes is not None:
        (low, high), method = found.extremes, found.method
    else:
        low, high, method = lowest_eigenvalue(symmetric, dense)
    size = max(data.problem.m, 10)
    threshold = max(size * EPS * max(high, -low), size * reduced.rounding)
    if low < -threshold or (
        low <= threshold
        and indefinite_in_part(symmetric, dense, reduced.own_size, reduced.own_rounding)
    ):
        word = DEFINITE[2]
    elif low <= threshold:
        word = DEFINITE[1]
    else:
        word = DEFINITE[0]
    return Definiteness(word, low, high, method, threshold)


def indefinite_in_part(
    symmetric: Any, dense: int, own_size: Array | None = None, own_rounding: float = 0.0
) -> bool:
    """Whether a part is indefinite that is tiny beside the rest, for example of heavy bodies.

    If the diagonal is scaled to ones, each part counts, and its own rounding counts as zero.
    """
    scaled = balanced(symmetric, own_size)
    low, high, _ = lowest_eigenvalue(scaled, dense)
    size = max(scaled.shape[0], 10)
    return bool(low < -size * max(EPS * max(high, -low), own_rounding))


def uniqueness(
    data: Data, joints: Joints, sign: Definiteness, full: bool, dense: int
) -> Uniqueness:
    """By contraction of the fixed point on s (Acary, Cadoux, Lemarechal & Malick 2011).

    If joints contradict each other, nothing is unique. If their rank is not shown, neither is W'.
    """
    if not joints.certain:
        return Uniqueness("undecided", joints.reason, float("nan"), False)
    if data.problem.nc == 0:
        return Uniqueness("unique", "there is no contact", 0.0, True)
    constant = float("nan")
    reduced = data.reduced
    name = "W" if data.problem.p == 0 else "W' = W - V R^-1 V^T"
    if reduced is None:
        reason = f"{name} is not known"
        return Uniqueness("undecided", reason, constant, full)
    symmetric = asymmetry(balanced(reduced.W, reduced.own_size)) <= SYMMETRIC
    if symmetric and sign.word == DEFINITE[0]:
        constant = _contraction(data, reduced, dense)
        # upper bound of the rounding error of the inverse
        lost = 10 * sign.threshold / sign.lowest
        constant = constant * (1 + lost) if lost < 0.1 else float("nan")
    if constant < 1:
        reason = f"the fixed point on mu ||u_T|| is a contraction, of {constant:.2g}"
        return Uniqueness("unique", reason, constant, full)
    frictionless = not any(group.axes.any() for group in data.friction)
    if frictionless and symmetric and sign.word in DEFINITE[:2]:
        return Uniqueness("unique", "the problem without friction is convex", constant, full)
    if np.isnan(constant):
        reason = f"{name} is not symmetric positive definite beyond rounding"
    else:
        reason = f"the fixed point on mu ||u_T|| need not be a contraction ({constant:.2g})"
    return Uniqueness("undecided", reason, constant, full)


def velocity_is_unique(data: Data) -> bool:
    """Whether a theorem says that there is one velocity at most."""
    reduced = data.reduced
    if reduced is None:
        return False
    found = spectrum(reduced.W, DENSE, reduced.rounding)
    sign = definiteness(data, reduced, found, DENSE)
    rank = None if found.doubtful else found.rank
    full = rank == data.problem.m and sign.word == DEFINITE[0]
    return uniqueness(data, joints_of(data), sign, full, DENSE).verdict == "unique"


def enumerated(found: Uniqueness, states: Enumeration) -> Uniqueness:
    """Uniqueness with the results of the states of the contacts."""
    if found.verdict == "unique" or states.velocity_unique is None:
        return found
    return replace(
        found, verdict="unique" if states.velocity_unique else "not unique", reason=states.reason
    )


def _contraction(data: Data, reduced: Reduced, dense: int) -> float:
    """sqrt(lambda_max(D W_TT D) lambda_max((W^-1)_NN)), D the coefficients of friction.

    r(s) minimises 1/2 r.W r + (q + E s).r over K, so that ||r - r'||_W <= ||E (s - s')||_W^-1, and
    the change of mu ||u_T|| is at most ||D W_T W^-1/2|| times that. With several groups of
    components (spin, rolling) the sum of their norms costs the root of their number.
    """
    d = data.d
    weights = np.zeros(data.problem.m)
    for group in data.friction:
        for axis, k in zip(group.axes.T, range(d)[group.part], strict=True):
            weights[k::d] = axis
    normal = np.arange(data.problem.m) % d == 0
    worst = 0.0
    W = reduced.W.tocsr()
    label = connected_components(W, directed=False)[1].reshape(-1, d)
    links = sp.coo_array(
        (np.ones(label.size), (np.repeat(np.arange(len(label)), d), label.ravel())),
        shape=(len(label), int(label.max()) + 1),
    )
    numbers = connected_components(links @ links.T, directed=False)[1]
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
        with np.errstate(over="ignore"):
            friction = weight[:, None] * block * weight
        if not np.isfinite(friction).all():
            return float("nan")
        push = np.linalg.eigvalsh(friction)[-1]
        worst = max(worst, float(push * np.linalg.eigvalsh((inverse + inverse.T) / 2)[-1]))
    return float(np.sqrt(worst * len(data.friction)))


def _units(data: Data, verdict: Existence) -> Units:
    """A guess at the units, and the sizes that are far from 1 in them."""
    nc, d = data.problem.nc, data.d
    if nc == 0:
        nan = float("nan")
        return Units(nan, nan, nan, nan, "there is no contact", ())
    trace = data.W.diagonal().reshape(nc, d).sum(axis=1)
    mean = data.stiffness
    mass = 1 / mean
    velocity = norm(data.local.q) / float(np.sqrt(data.problem.m))
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
        trouble.append(f"{counted(nc - held.size, 'contact')} that nothing can move (W_aa = 0)")
    if prestress > FAR:
        trouble.append(f"prestress: reactions {prestress:.1e} times what stops the velocity")
    guess = f"masses of about {mass:.1e} kg and velocities of about {velocity:.1e} m/s, if SI"
    return Units(mass, velocity, ratio, prestress, guess, tuple(trouble))
