"""Derivatives of a solution, by the implicit function theorem on the statuses of its contacts.

With the equations of the problem, Coulomb's law at each contact is, near a solution,

    open    dr = 0
    stick   du = 0
    slide   du_N = 0,   dr_T = -mu t dr_N - r_N t dmu - mu r_N (I - t t^T) / ||u_T|| du_T

with t = u_T / ||u_T||. Spin and rolling are the same with their coefficients, and each group sticks
or moves for itself. If sliding and spin share an ellipsoid with half-axes E, the contact moves with
r_t = -r_N E^2 u_t / ||E u_t||. The status follows from z = r - rho u, which Alart & Curnier's map
projects.
If z lies on a border between two statuses (grazing, at the limit of friction), the solution has no
derivative. One of the two is taken, an element of the generalised Jacobian of the map, and the
contact is flagged. If redundant contacts leave r undetermined, the least change of the unknowns,
scaled to one size, is given.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from fclib import _core, _laws
from fclib._equality import EqualByEntries

Array: TypeAlias = npt.NDArray[np.float64]
Smooth: TypeAlias = _laws.Problem

# relative to the largest z: a z nearer to a border than this counts as on it
BORDER = 1e-6
# singular values below this, relative to the largest, are zero
RANK = 1e-10
TURNS = 1e-12  # axes with smaller values, relative to the largest, are not turned by a velocity
REFINEMENTS = 3  # each one gives the digits of a double, less those of the conditioning


@dataclass(frozen=True, eq=False)
class Tangent(EqualByEntries):
    """What ``fclib.jvp`` returns: the change of the solution. Equal if the arrays are.

    Attributes:
        r, u: (m,) reactions and velocities of the contacts.
        v: (n,) velocities of a global problem, else None.
        l: (p,) multipliers, if there are bilateral constraints, else None.
        degenerate: (nc,) contacts on a border between two statuses.
        unique: whether the changes are determined; if not, the changes of r and l are the least
            ones.
        error: ``Merit.error`` of the solution; if it is large, the numbers here mean nothing.
    """

    r: Array
    u: Array
    v: Array | None
    l: Array | None  # noqa: E741
    degenerate: npt.NDArray[np.bool_]
    unique: bool
    error: float


@dataclass(frozen=True, eq=False)
class Gradient(EqualByEntries):
    """What ``fclib.vjp`` returns: the derivative by each datum, in its shape.

    Derivatives by data of the other formulation are None. The entries of a matrix are treated as
    independent. In a sparse matrix only stored entries have a derivative.

    Attributes:
        mu: (nc,)
        q, W, s: of a local problem.
        f, w, M, H, b: of a global one.
        mu_s, mu_r: (nc,) of a problem with spin or rolling friction.
        degenerate: (nc,) contacts on a border between two statuses.
        unique: whether the derivative is unique; if not, it belongs to one change of r and l.
        error: ``Merit.error`` of the solution; if it is large, the numbers here mean nothing.
    """

    mu: Array
    q: Array | None
    W: Any
    s: Array | None
    f: Array | None
    w: Array | None
    M: Any
    H: Any
    b: Array | None
    degenerate: npt.NDArray[np.bool_]
    unique: bool
    error: float
    mu_s: Array | None = None
    mu_r: Array | None = None


def jvp(
    problem: Smooth,
    solution: _core.Solution | _core.Result | npt.ArrayLike,
    *,
    mu: npt.ArrayLike | None = None,
    q: npt.ArrayLike | None = None,
    W: Any = None,
    s: npt.ArrayLike | None = None,
    f: npt.ArrayLike | None = None,
    w: npt.ArrayLike | None = None,
    M: Any = None,
    H: Any = None,
    b: npt.ArrayLike | None = None,
    mu_s: npt.ArrayLike | None = None,
    mu_r: npt.ArrayLike | None = None,
) -> Tangent:
    """The change of a solution if the data change: forward mode.

    Args:
        problem: any formulation.
        solution: its solution: a Solution, a Result, or only the reactions if there are no
            bilateral constraints.
        mu: change of mu.
        q: change of q.
        W: change of W.
        s: change of s.
        f: change of f.
        w: change of w.
        M: change of M.
        H: change of H.
        b: change of b.
        mu_s: change of mu_s, with spin friction.
        mu_r: change of mu_r, with rolling friction.

    Raises:
        ProblemError: a datum that the problem does not have, a wrong shape, or values that are not
            numbers.
        UnsuitableError: M is not positive definite.
    """
    point = _Point(problem, solution)
    given = {"mu": mu, "q": q, "W": W, "s": s, "f": f, "w": w, "M": M, "H": H, "b": b}
    given |= {"mu_s": mu_s, "mu_r": mu_r}
    change = {
        name: _of_shape(name, value, getattr(problem, name, None))
        for name, value in given.items()
        if value is not None
    }
    return point.tangent(change)


def vjp(
    problem: Smooth,
    solution: _core.Solution | _core.Result | npt.ArrayLike,
    *,
    r: npt.ArrayLike | None = None,
    u: npt.ArrayLike | None = None,
    v: npt.ArrayLike | None = None,
    l: npt.ArrayLike | None = None,  # noqa: E741
) -> Gradient:
    """The derivatives of r . r* + u . u* + v . v* + l . l* by all data: adjoint mode.

    r*, u*, v* and l* are the solution, r, u, v and l weights.

    Args:
        problem: any formulation.
        solution: as for ``jvp``.
        r: weights, for example the derivatives of a loss by r; zero if left out.
        u: the same for u.
        v: the same for v, of a global problem.
        l: the same for l, if there are bilateral constraints.

    Raises:
        ProblemError: weights of a wrong shape, for unknowns that the problem lacks, or not numbers.
        UnsuitableError: M is not positive definite.
    """
    return _Point(problem, solution).gradient({"r": r, "u": u, "v": v, "l": l})


def _dense(matrix: Any) -> Array:
    return np.asarray(matrix.toarray() if hasattr(matrix, "toarray") else matrix, dtype=np.float64)


def _of_shape(name: str, value: Any, like: Any) -> Array | None:
    if like is None:
        raise _core.ProblemError(f"{name}: this problem has no such datum")
    return _numbers(name, value, like.shape)


def _numbers(name: str, value: Any, shape: tuple[int, ...]) -> Array:
    """The caller's values, as finite numbers in this shape."""
    value = _core.matrix_from(value, name).toarray() if hasattr(value, "tocsr") else value
    try:
        array = np.asarray(value)
    except ValueError:
        raise _core.ProblemError(f"{name}: is not an array of numbers") from None
    if array.dtype.kind not in "biuf":
        raise _core.ProblemError(f"{name}: is not an array of real numbers")
    if array.shape != shape:
        raise _core.ProblemError(f"{name}: has the shape {array.shape}, expected {shape}")
    if np.ma.is_masked(value):
        raise _core.ProblemError(f"{name}: has masked entries")
    if not np.isfinite(array).all():
        raise _core.ProblemError(f"{name}: has an entry that is not a finite number")
    return array.astype(np.float64)


def _on_pattern(matrix: Any, left: Array, right: Array) -> Any:
    """Left right^T, only at the entries of a matrix."""
    if not hasattr(matrix, "tocoo"):
        return np.outer(left, right)
    import scipy.sparse as sp

    at = matrix.tocoo()
    values = left[at.row] * right[at.col]
    return sp.csr_array((values, (at.row, at.col)), shape=matrix.shape)


def _beyond(group: _laws.Group, z: Array) -> Array:
    """How far z_g is outside its limit at z_N (nc): negative inside.

    A half-axis of 0 limits nothing else: the contact moves freely along it.
    """
    part = z[:, group.part]
    if group.uniform:
        return np.asarray(np.linalg.norm(part, axis=1) - group.coefficient * z[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where((part == 0) | (group.axes == 0), 0.0, part / group.axes)
    largest = group.axes.max(axis=1)
    far = np.linalg.norm(part, axis=1)  # if nothing may slide or spin
    some = largest > 0
    far[some] = largest[some] * (np.linalg.norm(shares[some], axis=1) - z[some, 0])
    return np.asarray(far)


def _across(z: Array, axes: Array) -> Array:
    """The direction in which a contact would slide, from a z_g at its limit."""
    squares = axes * axes
    return np.divide(z, squares, out=np.zeros_like(z), where=squares > 0)


class _Point:
    """A solution of a problem, and the linear system that its derivatives solve.

    The unknowns of a local problem are r, l; those of a global one are v, r, l.
    """

    def __init__(self, problem: Smooth, solution: Any) -> None:
        solution = _core.solution_from(solution)
        self.problem = problem
        self.d, self.nc, self.m, self.p = problem.spacedim, problem.nc, problem.m, problem.p
        if self.p and solution.l is None:
            raise _core.ProblemError("l: is missing, and the problem has bilateral constraints")
        # this checks the data of both
        self.error = _core.merit(problem, solution).error
        self.r = solution.r
        self.l = solution.l if self.p else np.zeros(0)
        self.v: Array | None = None
        self.moving = np.zeros(0)
        m, p = self.m, self.p
        if isinstance(problem, _laws.Local):
            W = _dense(problem.W)
            V = _dense(problem.V) if p else np.zeros((m, 0))
            R = _dense(problem.R) if p else np.zeros((0, 0))
            self.to_u = np.hstack([W, V])
            self.u = self.to_u @ np.concatenate([self.r, self.l]) + problem.q
            self._law(np.diag(W))
            law = self.by_u @ self.to_u
            law[:, :m] += self.by_r
            self.system = np.vstack([law, np.hstack([V.T, R])])
            self.rows = {"law": slice(0, m), "joints": slice(m, m + p)}
            self.parts = {"r": slice(0, m), "l": slice(m, m + p)}
        else:
            n = problem.n
            M, H = _dense(problem.M), _dense(problem.H)
            G = _dense(problem.G) if p else np.zeros((n, 0))
            self.v = solution.v
            if self.v is None:
                self.v = np.linalg.solve(M, H @ self.r + G @ self.l + problem.f)
            self.moving = self.v
            self.u = H.T @ self.v + problem.w
            self._law(np.einsum("ij,ij->j", H, H / np.diag(M)[:, None]))
            self.to_u = np.hstack([H.T, np.zeros((m, m + p))])
            law = self.by_u @ self.to_u
            law[:, n : n + m] += self.by_r
            joints = np.hstack([G.T, np.zeros((p, m + p))])
            self.system = np.vstack([np.hstack([M, -H, -G]), law, joints])
            self.rows = {
                "dynamics": slice(0, n),
                "law": slice(n, n + m),
                "joints": slice(n + m, n + m + p),
            }
            self.parts = {"v": slice(0, n), "r": slice(n, n + m), "l": slice(n + m, n + m + p)}

    def _law(self, diagonal: Array) -> None:
        """by_u du + by_r dr = sum of by_friction[c] dc over the coefficients c, by contacts."""
        d, nc = self.d, self.nc
        size = diagonal.reshape(nc, d).mean(axis=1)
        # a contact that moves nothing has no own scale
        size[size <= 0] = size.max(initial=0.0) or 1.0
        rho = 1 / size
        u, r = self.u.reshape(nc, d), self.r.reshape(nc, d)
        z = r - rho[:, None] * u
        border = BORDER * np.linalg.norm(z, axis=1).max(initial=0.0)
        opened = z[:, 0] <= 0
        self.degenerate = np.abs(z[:, 0]) <= border
        self.by_u = np.zeros((self.m, self.m))
        self.by_r = np.zeros((self.m, self.m))
        self.by_friction = {name: np.zeros((nc, d)) for name in _laws.coefficients(self.problem)}
        for a in range(nc):
            at = slice(d * a, d * a + d)
            if opened[a]:
                self.by_r[at, at] = np.eye(d)
            else:
                self.by_u[d * a, d * a] = rho[a]
        names = {"t": ("mu",), "s": ("mu_s",), "r": ("mu_r",), "ts": ("mu", "mu", "mu_s")}
        for group in _laws.groups(self.problem):
            size = group.part.stop - group.part.start
            bounds = names[group.name] if size == 3 else names[group.name] * size
            beyond = _beyond(group, z)
            self.degenerate |= ~opened & (np.abs(beyond) <= border)
            held = group.axes > 0
            slides = (beyond > 0) | ~held.any(axis=1)
            for a in np.flatnonzero(~opened).tolist():
                tangent = slice(d * a + group.part.start, d * a + group.part.stop)
                e, moved = group.axes[a], u[a, group.part]
                if not slides[a]:
                    self.by_u[tangent, tangent] = rho[a] * np.diag(held[a].astype(float))
                    self.by_r[tangent, tangent] = np.diag((~held[a]).astype(float))
                    self._free(a, group, bounds, rho[a], border)
                    continue
                # near the border to stick rounding gives u a direction, and z = r - rho u has both
                speed, bound = float(np.linalg.norm(moved)), max(r[a, 0], 0.0)
                if group.uniform:
                    mu, far = e[0], z[a, group.part]
                    t = -far / (np.linalg.norm(far) or 1.0)  # r_g = -mu r_N t
                    turn = mu * bound * (np.eye(size) - np.outer(t, t))
                    self._creeps(a, tangent, mu * t, turn, speed, rho[a])
                    self.by_friction[bounds[0]][a, group.part] = -r[a, 0] * t
                    continue
                near = rho[a] * speed <= border
                away = -_across(z[a, group.part], e) if near else moved
                length = np.linalg.norm(e * away) or 1.0
                t = e * e * away / length  # r_g = -r_N t
                turn = bound * (np.diag(e * e) - np.outer(t, t))
                pull = float(np.linalg.norm(e * moved))
                kept = self._creeps(a, tangent, t, turn, pull, rho[a])
                by_axes = 2 * np.diag(e * away) / length
                by_axes -= np.outer(t, e * away * away / length**2)
                by_axes = kept @ by_axes
                for axis, name in enumerate(bounds):
                    self.by_friction[name][a, group.part] -= r[a, 0] * by_axes[:, axis]

    def _creeps(
        self, a: int, tangent: slice, t: Array, turn: Array, speed: float, rho: float
    ) -> Array:
        """The rows dr_g + t dr_N + turn du_g / speed = 0, times K = (I + turn / (rho speed))^-1.

        Returns K. With it no row grows without bound if the speed tends to 0. On the axes that
        turn, rho du_g = 0 is left then.
        """
        values, axes = np.linalg.eigh(turn)
        turns = values > TURNS * max(values.max(initial=0.0), 0.0)
        whole = np.where(turns, speed + values / rho, 1.0)
        kept = (axes * np.where(turns, speed / whole, 1.0)) @ axes.T
        self.by_r[tangent, tangent] = kept
        self.by_r[tangent, self.d * a] = kept @ t
        self.by_u[tangent, tangent] = (axes * np.where(turns, values / whole, 0.0)) @ axes.T
        return np.asarray(kept)

    def _free(
        self, a: int, group: _laws.Group, bounds: tuple[str, ...], rho: float, border: float
    ) -> None:
        """What a coefficient does that is 0, if the rest of the ellipsoid sticks.

        With e for 0 and s = ||r_h / e_h|| / r_N for the rest, which holds, r = -e r_N sqrt(1 - s^2)
        u / ||u|| along the free axes, to the first order of e; and the rest creeps.
        """
        d = self.d
        rows = d * a + group.part.start + np.arange(group.part.stop - group.part.start)
        e, u, r = group.axes[a], self.u[rows], self.r[rows]
        free = e == 0
        if not free.any():
            return
        normal, speed = self.r[d * a], np.linalg.norm(u[free])
        share = np.linalg.norm(r[~free] / e[~free]) / normal if normal > 0 else 1.0
        if rho * speed <= border or share >= 1:
            self.degenerate[a] = True
            return
        rest = np.sqrt(1 - share**2)
        by_coefficient = np.zeros(len(e))
        by_coefficient[free] = -normal * rest * u[free] / speed
        by_coefficient[~free] = -rho * r[~free] / e[~free] ** 2 * speed / (normal * rest)
        name = bounds[int(np.flatnonzero(free)[0])]
        self.by_friction[name][a, group.part] = by_coefficient

    def _solve(self, transposed: bool, right: Array) -> tuple[Array, bool]:
        """Solve by singular values, after rows and columns are scaled to the same size.

        Large ratios of masses stay in the scaled system. So a unique solution is refined, with
        residuals of more digits.
        """
        system = self.system.T if transposed else self.system
        if system.size == 0:
            return np.zeros(len(right)), True
        columns = np.linalg.norm(self.system, axis=0)
        columns[columns == 0] = 1
        rows = np.linalg.norm(self.system / columns, axis=1)
        rows[rows == 0] = 1
        left_scale, right_scale = (columns, rows) if transposed else (rows, columns)
        scaled = system / left_scale[:, None] / right_scale
        u, values, v = np.linalg.svd(scaled)
        kept = values > RANK * values[0]

        def solved(b: Array) -> Array:
            return np.asarray(v[kept].T @ (u[:, kept].T @ b / values[kept]))

        wanted = right / left_scale
        found = solved(wanted)
        if kept.all():
            more = scaled.astype(np.longdouble)
            for _ in range(REFINEMENTS):
                found += solved((wanted - more @ found).astype(np.float64))
        return found / right_scale, bool(kept.all())

    def _velocity(self, change: dict[str, Array | None]) -> Array:
        """The change of u at the same unknowns."""
        result = np.zeros(self.m)
        for name in ("q", "w"):
            if (value := change.get(name)) is not None:
                result += value
        if (W := change.get("W")) is not None:
            result += W @ self.r
        if (H := change.get("H")) is not None:
            result += H.T @ self.moving
        return result

    def tangent(self, change: dict[str, Array | None]) -> Tangent:
        velocity = self._velocity(change)
        right = np.zeros(len(self.system))
        law = -self.by_u @ velocity
        for name, by in self.by_friction.items():
            if (coefficient := change.get(name)) is not None:
                law += (by * coefficient[:, None]).reshape(-1)
        right[self.rows["law"]] = law
        for name in ("s", "b"):
            if (value := change.get(name)) is not None:
                right[self.rows["joints"]] -= value
        if "dynamics" in self.rows:
            impulse = np.zeros(self.rows["dynamics"].stop)
            if (f := change.get("f")) is not None:
                impulse += f
            if (M := change.get("M")) is not None:
                impulse -= M @ self.moving
            if (H := change.get("H")) is not None:
                impulse += H @ self.r
            right[self.rows["dynamics"]] = impulse
        found, unique = self._solve(False, right)
        return Tangent(
            r=found[self.parts["r"]],
            u=self.to_u @ found + velocity,
            v=found[self.parts["v"]] if "v" in self.parts else None,
            l=found[self.parts["l"]] if self.p else None,
            degenerate=self.degenerate,
            unique=unique,
            error=self.error,
        )

    def gradient(self, weights: dict[str, npt.ArrayLike | None]) -> Gradient:
        right = np.zeros(len(self.system))
        by_u = np.zeros(self.m)
        for name, values in weights.items():
            if values is None:
                continue
            part = self.parts.get(name)
            size = self.m if name == "u" else (0 if part is None else part.stop - part.start)
            array = _numbers(name, values, (size,))
            if name == "u":
                by_u = array
            else:
                right[part] += array
        right += self.to_u.T @ by_u
        found, unique = self._solve(True, right)
        law = found[self.rows["law"]]
        by_q = by_u - self.by_u.T @ law
        by_friction = {
            name: np.einsum("ad,ad->a", by, law.reshape(self.nc, self.d))
            for name, by in self.by_friction.items()
        }
        joints = -found[self.rows["joints"]] if self.p else None
        problem = self.problem
        nothing: dict[str, Any] = dict.fromkeys(("q", "W", "s", "f", "w", "M", "H", "b"))
        if isinstance(problem, _laws.Local):
            mine = {"q": by_q, "W": _on_pattern(problem.W, by_q, self.r), "s": joints}
        else:
            assert self.v is not None
            by_f = found[self.rows["dynamics"]]
            by_H = _on_pattern(problem.H, by_f, self.r) + _on_pattern(problem.H, self.v, by_q)
            mine = {
                "f": by_f,
                "w": by_q,
                "M": _on_pattern(problem.M, -by_f, self.v),
                "H": by_H,
                "b": joints,
            }
        return Gradient(
            **by_friction,
            **(nothing | mine),
            degenerate=self.degenerate,
            unique=unique,
            error=self.error,
        )
