"""Reference solutions: to the limit of double precision, by two unrelated algorithms.

The first algorithm gives the solution, the second one confirms it: it shares no iteration with the
first, and its velocity must agree. It starts from zero; where it ends nowhere, or at another
solution (frictional problems may have several), from the first's reactions rounded to three digits.

Where the reactions of a velocity are not unique, the solution has the one of least norm: min ||r||
over W r = W r*, r in the faces of the cones that the velocity leaves open - none where the contact
opens, a ray where it slides, K where it sticks. That is a conic program, solved island by island;
its answer is brought into the kernel of W on these faces, where W r keeps its value to rounding.
"""

from __future__ import annotations

import datetime
import importlib.metadata
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import qr

from fclib import _core, _registry, _solve
from fclib.analysis._conic import Program
from fclib.analysis._contacts import completed, velocity
from fclib.analysis._data import Array, Data
from fclib.analysis._spectrum import DENSE, EPS

TARGET = 1e-12  # of the merit
CONFIRMED = 1e2  # the confirming error may be this many times the target
AGREE = 1e-8  # distance of the velocities, relative to max(||u||, ||q||)
MOVES = 1e-9  # a velocity above this, relative to the same, opens or slides
DIGITS = 3  # of the reactions that a second try starts from

# what runs inside the default solver, in the families of the others
STAGES = {
    "gauss-seidel": {"splitting"},
    "conjugate gradients": {"krylov"},
    "proximal newton": {"newton", "proximal point"},
    "proximal point": {"newton", "proximal point"},
}
INTERIOR = {"interior point", "newton", "proximal point"}  # each polishes by proximal Newton
FIRST = ("auto", "nsn-jm", "nsn-ac", "ppa-nsn", "admm", "nsgs", "apgd")
SECOND = ("nsn-jm", "nsn-ac", "admm", "apgd", "aclm", "nsgs", "fp-eg-upk", "ppa-nsgs")


@dataclass(frozen=True)
class Confirmation:
    """A run of one algorithm.

    Attributes:
        solver: its name; families: what it is made of.
        error: the merit it reached; status: of the result.
        difference: of its velocity from the reference's, relative to max(||u||, ||q||); 0 for the
            first.
        start: "zero" or "rounded", the first's reactions to three digits.
    """

    solver: str
    families: tuple[str, ...]
    error: float
    status: str
    difference: float
    start: str


@dataclass(frozen=True)
class Reference:
    """A solution and what stands behind it.

    Attributes:
        solution: the reference, None where no algorithm came within 100 targets.
        merit: of the solution, on the problem as it was given.
        target: of the merit.
        runs: the algorithms, the first and those that were asked to confirm it.
        confirmed: whether a run of no common family agrees.
        reaction: "unique" (given the velocity), "minimum norm" or "one of several".
        freedom: dimension of the reactions of this velocity, before the cones bound them.
        others: differences of the velocities of other solutions that were met, of an error within
            the target: the velocity is not unique.
        reason: why it is not certified, empty where it is.
    """

    problem: _solve.Problem = field(repr=False, compare=False)
    solution: _core.Solution | None = field(repr=False, compare=False)
    merit: _core.Merit | None
    target: float
    runs: tuple[Confirmation, ...]
    confirmed: bool
    reaction: str
    freedom: int
    others: tuple[float, ...]
    reason: str

    @property
    def certified(self) -> bool:
        """Whether the merit is within the target, and a second algorithm agrees."""
        return not self.reason

    @property
    def error(self) -> float:
        """Of the solution; nan without one."""
        return self.merit.error if self.merit is not None else float("nan")

    @property
    def second(self) -> Confirmation | None:
        """The run that confirms the solution."""
        return self.runs[-1] if self.confirmed else None

    @property
    def record(self) -> dict[str, Any]:
        """One flat dictionary of JSON values."""
        merit = self.merit
        second = self.second
        return {
            "formulation": self.problem.formulation,
            "nc": self.problem.nc,
            "certified": self.certified,
            "error": merit.error if merit else None,
            "scaled_natural": merit.scaled_natural if merit else None,
            "algorithm": self.runs[0].solver if self.runs else None,
            "second": second.solver if second else None,
            "second_start": second.start if second else None,
            "second_error": second.error if second else None,
            "difference": second.difference if second else None,
            "reaction": self.reaction,
            "freedom": self.freedom,
            "other_velocities": list(self.others),
            "open": merit.open if merit else None,
            "stick": merit.stick if merit else None,
            "slide": merit.slide if merit else None,
            "reason": self.reason,
        }

    @property
    def attributes(self) -> dict[str, float | str]:
        """What the file says of /solution: the merits, the algorithms, versions and date."""
        if self.solution is None or self.merit is None:
            raise _core.ProblemError("there is no solution to speak of")
        merits = {
            f"merit_{name}": float(getattr(self.merit, name))
            for name in (
                "error",
                "natural",
                "scaled_natural",
                "dynamics",
                "bilateral",
                "kinematics",
                "cone",
                "dual_cone",
                "complementarity",
            )
        }
        said = [
            f"{run.solver} ({'+'.join(run.families)}) from {run.start}: error {run.error:.1e}, "
            f"velocity differs by {run.difference:.1e}"
            for run in self.runs
        ]
        now = datetime.datetime.now(datetime.timezone.utc)
        return {
            **merits,
            "merit_1": _core.merit_1(self.problem, self.solution),
            "algorithms": "; ".join(said[:1] + said[-1:] if self.confirmed else said[:1]),
            "certified": "yes" if self.certified else f"no: {self.reason}",
            "reaction": self.reaction,
            "versions": versions(),
            "date": now.strftime("%Y-%m-%dT%H:%M:%SZ"),
        }


def versions() -> str:
    """Of fclib and of what it computes with."""
    names = ("numpy", "scipy", "clarabel")
    found = [f"fclib {_core.version}"]
    for name in names:
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    return ", ".join(found)


def reference(
    problem: _solve.Problem, *, target: float = TARGET, time_limit: float = 10.0
) -> Reference:
    """The reference solution of a problem.

    Args:
        problem: any formulation.
        target: bound on the merit.
        time_limit: [s] wall clock of each run. How many runs are made depends on the problem: two
            where all goes well.

    Raises:
        fclib.ProblemError: the data is not valid.
        fclib.UnsuitableError: M or R is singular.
        ImportError: reactions are not unique, and Clarabel is not installed.
    """
    problem.validate()
    data = Data.of(problem)
    first, run = _first(data, target, time_limit)
    if not first.error <= CONFIRMED * target:
        reason = f"no algorithm came nearer than {first.error:.1e}"
        return Reference(problem, None, None, target, (run,), False, "none", 0, (), reason)
    solution = first.solution
    runs, confirmed, others = _confirm(data, solution, run, target, time_limit)
    reaction, freedom, solution = _least(data, solution, target)
    merit = _core.merit(problem, solution)
    reasons = []
    if not merit.error <= target:
        reasons.append(f"the error {merit.error:.1e} is above {target:.0e}")
    if not confirmed:
        tries = min((r.difference for r in runs[1:]), default=float("nan"))
        reasons.append(f"no unrelated algorithm agrees (the nearest differs by {tries:.1e})")
    return Reference(
        problem,
        solution,
        merit,
        target,
        runs,
        confirmed,
        reaction,
        freedom,
        others,
        "; ".join(reasons),
    )


def _families(result: _core.Result) -> tuple[str, ...]:
    """What a solver is made of; of a chain, what worked on the solution."""
    if result.solver != "auto":
        return (_registry.find_solver(result.solver).family,)
    found: set[str] = set()
    for stage in result.stages:
        # gauss-seidel comes first in nearly every chain: it counts where it ended the work
        if stage.solved or stage.name != "gauss-seidel":
            found |= STAGES.get(stage.name, INTERIOR)
    return tuple(sorted(found)) or ("none",)


def _first(data: Data, target: float, time_limit: float) -> tuple[_core.Result, Confirmation]:
    """The best result of the first algorithms, up to one within the target."""
    best = None
    for name in FIRST:
        try:
            result = _solve.solve(data.problem, name, target / 10, time_limit=time_limit)
            if best is not None and not result.error < best.error:
                continue
        except _core.UnsuitableError:
            if name == "auto":
                raise
            continue
        best = result
        if best.error <= target or best.status == "infeasible":
            break
    assert best is not None
    run = Confirmation(best.solver, _families(best), best.error, best.status, 0.0, "zero")
    return best, run


def _confirm(
    data: Data, solution: _core.Solution, run: Confirmation, target: float, time_limit: float
) -> tuple[tuple[Confirmation, ...], bool, tuple[float, ...]]:
    """Runs of other families until one agrees, and the velocities of other solutions."""
    _, u = completed(data, solution)
    speed = max(float(np.linalg.norm(u)), data.speed)
    tried: list[Confirmation] = [run]
    others: list[float] = []
    for start in ("zero", "rounded"):
        guess = None if start == "zero" else _rounded(solution)
        # what does not come soon from zero is not waited for
        limit = min(time_limit, 2.0) if start == "zero" else time_limit
        for name in SECOND:
            info = _registry.find_solver(name)
            if info.family in run.families or not _takes(info, data):
                continue
            try:
                result = _solve.solve(data.problem, name, target, time_limit=limit, guess=guess)
            except _core.UnsuitableError:
                continue
            difference = float(np.linalg.norm(completed(data, result.solution)[1] - u)) / speed
            found = Confirmation(
                name, (info.family,), result.error, result.status, difference, start
            )
            tried.append(found)
            if found.error <= CONFIRMED * target and difference <= AGREE:
                return tuple(tried), True, tuple(others)
            if found.error <= target and difference > AGREE:
                others.append(difference)
    return tuple(tried), False, tuple(others)


def _takes(info: _core.SolverInfo, data: Data) -> bool:
    rolling = len(data.friction) > 1
    return data.d in (info.rolling_dimensions if rolling else info.dimensions)


def _rounded(solution: _core.Solution) -> _core.Solution:
    def short(x: Array) -> Array:
        return np.array([float(f"{value:.{DIGITS - 1}e}") for value in x])

    multiplier = None if solution.l is None else short(solution.l)
    return _core.Solution(r=short(solution.r), l=multiplier)


# ---- the reaction of least norm


def _least(data: Data, solution: _core.Solution, target: float) -> tuple[str, int, _core.Solution]:
    """Whether the reactions of the velocity are unique, how free they are, and the least ones."""
    problem, d = data.problem, data.d
    if problem.nc == 0:
        return "unique", 0, solution
    _, u = completed(data, solution)
    islands = data.local.islands()
    local_W, r = data.W.tocsr(), solution.r.copy()
    freedom, skipped = 0, False
    threshold = MOVES * max(float(np.linalg.norm(u)), data.speed)
    V = data.matrices.get("V")
    order = np.argsort(islands.contact, kind="stable")
    for island in np.split(order, np.cumsum(np.bincount(islands.contact))[:-1]):
        rows = (d * island[:, None] + np.arange(d)).ravel()
        if not r[rows].any():
            continue
        if rows.size > DENSE:
            skipped = True
            continue
        block = local_W[rows][:, rows].toarray()
        if V is not None:
            # lambda may change too, and no velocity of it
            block = _held(block, V.tocsr()[rows].toarray(), data.matrices["R"].toarray())
        faces = _faces(data, island, r, u, threshold)
        kernel = _kernel(block @ faces.basis)
        if kernel.shape[1] == 0:
            continue
        freedom += kernel.shape[1]
        least = _least_in(data, faces, block, r[rows], kernel)
        if least is not None and np.linalg.norm(least) <= np.linalg.norm(r[rows]):
            r[rows] = least
    if freedom == 0:
        return ("one of several" if skipped else "unique"), 0, solution
    least_one = _complete(data, _core.Solution(r=r, l=_multiplier(data, r)))
    if skipped or not _core.merit(problem, least_one).error <= target:
        return "one of several", freedom, solution
    return "minimum norm", freedom, least_one


def _held(W: Array, V: Array, R: Array) -> Array:
    """W - V R^-1 V^T."""
    return W - V @ np.linalg.solve(R, V.T)


def _multiplier(data: Data, r: Array) -> Array | None:
    """Lambda from r."""
    if "V" not in data.matrices or data.local.s is None:
        return None
    V, R = data.matrices["V"], data.matrices["R"]
    return np.asarray(-np.linalg.solve(R.toarray(), V.T @ r + data.local.s))


def _complete(data: Data, solution: _core.Solution) -> _core.Solution:
    """With u, recomputed, and v of a global problem."""
    problem = data.problem
    _, u = completed(data, solution)
    if isinstance(problem, (_core.GlobalProblem, _core.GlobalRollingProblem)):
        v = velocity(problem, data, solution)
        return solution.replace(v=v, u=data.matrices["H"].T @ v + problem.w)
    return solution.replace(u=u)


@dataclass(frozen=True)
class Faces:
    """The reactions that a velocity leaves open, contact by contact.

    Attributes:
        basis: (d contacts, directions): where nothing slides, unit vectors.
        sticking: positions in the island of the contacts that may have any reaction in K.
        rays: the directions that are those of sliding contacts: not negative.
        contacts: of the island.
    """

    basis: Array
    sticking: Any
    rays: Any
    contacts: Any


def _faces(data: Data, island: Any, r: Array, u: Array, threshold: float) -> Faces:
    d = data.d
    entries: list[tuple[int, int, float]] = []
    sticking, rays = [], []
    count = 0
    for at, contact in enumerate(island):
        own = slice(d * contact, d * contact + d)
        reaction, speed = r[own], u[own]
        if not reaction.any() or speed[0] > threshold:
            continue
        if np.linalg.norm(speed[1:]) > threshold:
            # it slides, or rolls: its reaction keeps its direction
            direction = reaction / np.linalg.norm(reaction)
            entries += [(d * at + k, count, float(direction[k])) for k in range(d)]
            rays.append(count)
            count += 1
            continue
        entries += [(d * at + k, count + k, 1.0) for k in range(d)]
        sticking.append(at)
        count += d
    basis = np.zeros((d * len(island), count))
    for row, column, value in entries:
        basis[row, column] = value
    return Faces(basis, np.array(sticking, int), np.array(rays, int), island)


def _kernel(a: Array) -> Array:
    """An orthonormal basis of the kernel."""
    if a.shape[1] == 0:
        return np.zeros((0, 0))
    # the rows' complement: A^T P = Q R with falling |R_kk|
    q, upper, _ = qr(a.T, pivoting=True)
    values = abs(np.diag(upper))
    limit = 10 * max(a.shape) * EPS * values.max(initial=0)
    return np.asarray(q[:, int((values > limit).sum()) :])


def _least_in(data: Data, faces: Faces, W: Array, r: Array, kernel: Array) -> Array | None:
    """The reaction of least norm with the same W r, or None where it was not found.

    The conic program leaves W r and the cones by its tolerance. Its answer is brought into the
    kernel, and Newton steps of least norm on the constraints that are broken end at rounding.
    """
    d, B = data.d, sp.csr_array(faces.basis)
    size = B.shape[1]
    scale = float(np.linalg.norm(r))
    start = faces.basis.T @ r / scale  # the columns are orthonormal
    A = W @ faces.basis
    A = sp.csr_array(np.where(abs(A) > EPS * abs(A).max(), A, 0) / abs(A).max())
    program = Program(size)
    program.equal(A, A @ start)
    at = faces.sticking
    limits = [(mu[faces.contacts[at]], list(range(d))[part]) for mu, part in data.friction]
    for mu, components in limits:
        stacked = sp.vstack(
            [sp.diags_array(mu) @ B[d * at], *(B[d * at + k] for k in components)], format="csr"
        )
        length = 1 + len(components)
        order = np.arange(length * at.size).reshape(length, -1).T.ravel()
        program.second_order(stacked[order], np.zeros(order.size), length)
    program.nonnegative(B[d * at], np.zeros(at.size))
    rays = sp.csr_array(sp.eye_array(size, format="csr")[faces.rays])
    program.nonnegative(rays, np.zeros(faces.rays.size))
    answer = program.solve(np.zeros(size), sp.eye_array(size, format="csc"), tol=1e-11)
    z = kernel.T @ (np.array(answer.x) - start)
    if not np.isfinite(z).all():
        return None
    for _ in range(10):
        c = start + kernel @ z
        x = faces.basis @ c
        gaps, gradients = [], []
        for mu, components in limits:
            tangent = np.stack([x[d * at + k] for k in components], axis=1)
            norm = np.linalg.norm(tangent, axis=1)
            gap = mu * x[d * at] - norm
            for k in np.flatnonzero(gap < -EPS * norm):
                gradient = mu[k] * faces.basis[d * at[k]]
                for j, component in enumerate(components):
                    along = faces.basis[d * at[k] + component]
                    gradient = gradient - tangent[k, j] / norm[k] * along
                gaps.append(gap[k])
                gradients.append(gradient @ kernel)
        for k in faces.rays[c[faces.rays] < 0]:
            gaps.append(c[k])
            gradients.append(kernel[k])
        if not gaps:
            break
        z = z - np.linalg.lstsq(np.array(gradients), np.array(gaps), rcond=1e-8)[0]
    return scale * x
