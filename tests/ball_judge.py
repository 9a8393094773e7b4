"""A judge of solutions that shares nothing with the core: docs/mathematics.md in ball arithmetic.

Every number is a ball of Arb (https://flintlib.org): a midpoint with a bound of all rounding. So
`verdict.error > tol` is a proof, and so is `verdict.error <= tol`; while a ball has both sides of
`tol` in it, both are false. The precision grows until the balls are narrow.

The data are taken as they are stored. A double is an exact number.

The allowances for rounding are those of the page, found in doubles if they are not a plain sum.
For the signs at random there are all signs here, and e(v) is that of factors in the order of rows.
So what is above a tolerance beyond these allowances is wrong by any reading of the page.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from flint import arb, arb_mat, ctx

import fclib

Balls: TypeAlias = list[arb]
Doubles: TypeAlias = npt.NDArray[np.float64]
Effects: TypeAlias = list[list[tuple[int, arb]]]

PRECISIONS = (256, 512, 1024, 2048, 4096, 8192)  # in bits; doubles reach from 2^-1074 to 2^1024
NARROW = 2.0**-56  # radius of an error relative to it: what is left is below a double's last digit
NOTHING = 2.0**-120  # an error that is known to be below this is narrow in any case

# what rounding leaves of a sum of terms, relative to their sizes: the rule of docs/mathematics.md
UNIT = 32 * 2.0**-52
UNIT_OF_Q = 4 * 2.0**-52
DEPENDENT = 1e-13  # a direction of which no more is left explains no reactions; the page has 1e-12


# ---- vectors and matrices of balls


def balls(x: npt.ArrayLike) -> Balls:
    """The numbers as they are."""
    return [arb(float(value)) for value in np.asarray(x, dtype=float).ravel()]


def doubles(x: Balls) -> Doubles:
    """The midpoints."""
    return np.array([float(value) for value in x], dtype=float)


def zeros(size: int) -> Balls:
    """`size` zeros."""
    return [arb(0)] * size


def root(square: arb) -> arb:
    """The root of a number that is not negative; its ball may reach below zero."""
    if square > 0:
        return square.sqrt()
    return arb(0).union(square.upper().max(arb(0)).sqrt())


def norm(x: Iterable[arb]) -> arb:
    """The Euclidean norm."""
    return root(sum((value * value for value in x), arb(0)))


def largest(x: Iterable[arb]) -> arb:
    """The largest of numbers that are not negative, 0 without any."""
    result = arb(0)
    for value in x:
        result = result.max(value)
    return result


def add(*vectors: Balls) -> Balls:
    """The sum, component by component."""
    return [sum(terms, arb(0)) for terms in zip(*vectors, strict=True)]


def larger(x: Balls, y: Balls) -> Balls:
    """The larger of abs(x) and abs(y), component by component."""
    return [abs(a).max(abs(b)) for a, b in zip(x, y, strict=True)]


def quotient(x: arb, y: arb) -> arb:
    """X / y, 0 where y is 0."""
    return arb(0) if is_zero(y) else x / y


def is_zero(x: arb) -> bool:
    """Whether no precision tells the number from 0: it is, or 200 of its bits cancel."""
    return bool(x.contains(0))


class Sparse:
    """A matrix by its entries."""

    def __init__(self, a: Any) -> None:
        stored = sp.coo_array(a)
        self.rows, self.columns = stored.shape
        total: dict[tuple[int, int], arb] = {}
        for i, j, value in zip(*stored.coords, stored.data, strict=True):
            at = int(i), int(j)
            one = arb(float(value))
            total[at] = total[at] + one if at in total else one  # repeated entries add up
        self.entries = [(i, j, value) for (i, j), value in total.items()]

    def times(self, x: Balls) -> Balls:
        """A x."""
        result = zeros(self.rows)
        for i, j, value in self.entries:
            result[i] = result[i] + value * x[j]
        return result

    def transposed(self, x: Balls) -> Balls:
        """A^T x."""
        result = zeros(self.columns)
        for i, j, value in self.entries:
            result[j] = result[j] + value * x[i]
        return result

    def sizes(self, x: Balls) -> Balls:
        """abs(A) abs(x)."""
        result = zeros(self.rows)
        for i, j, value in self.entries:
            result[i] = result[i] + abs(value * x[j])
        return result

    def sizes_transposed(self, x: Balls) -> Balls:
        """abs(A)^T abs(x)."""
        result = zeros(self.columns)
        for i, j, value in self.entries:
            result[j] = result[j] + abs(value * x[i])
        return result

    @functools.cached_property
    def dense(self) -> Doubles:
        """The matrix in doubles."""
        result = np.zeros((self.rows, self.columns))
        for i, j, value in self.entries:
            result[i, j] = float(value)
        return result

    def diagonal(self) -> Balls:
        """The entries (k, k)."""
        result = zeros(self.rows)
        for i, j, value in self.entries:
            if i == j:
                result[i] = value
        return result


class Mass:
    """M and M^-1, by the parts that M couples."""

    def __init__(self, M: Sparse) -> None:
        self.matrix = M
        n = M.rows
        pattern = sp.coo_array(
            (np.ones(len(M.entries)), ([i for i, *_ in M.entries], [j for _, j, _ in M.entries])),
            shape=(n, n),
        )
        count, self.part = sp.csgraph.connected_components(pattern, directed=False)
        self.members: list[list[int]] = [[] for _ in range(count)]
        self.place = [0] * n
        for row, part in enumerate(self.part):
            self.place[row] = len(self.members[part])
            self.members[part].append(row)
        tables = [[[arb(0)] * len(rows) for _ in rows] for rows in self.members]
        for i, j, value in M.entries:
            tables[self.part[i]][self.place[i]][self.place[j]] = value
        self.inverses = [arb_mat(table).inv() for table in tables]

    def solve(self, b: Balls) -> Balls:
        """M^-1 b."""
        result = zeros(len(b))
        for rows, inverse in zip(self.members, self.inverses, strict=True):
            x = inverse * arb_mat(len(rows), 1, [b[row] for row in rows])
            for k, row in enumerate(rows):
                result[row] = x[k, 0]
        return result

    def effects(self, A: Sparse) -> Effects:
        """The columns of A^T M^-1 that are not zero, row by row."""
        result: Effects = [[] for _ in range(A.columns)]
        touched: list[dict[int, list[tuple[int, arb]]]] = [{} for _ in self.members]
        for i, j, a in A.entries:
            touched[self.part[i]].setdefault(j, []).append((self.place[i], a))
        for rows, inverse, columns in zip(self.members, self.inverses, touched, strict=True):
            own = arb_mat(len(columns), len(rows))
            for k, entries in enumerate(columns.values()):
                for place, a in entries:
                    own[k, place] = a
            moved = own * inverse
            for k, j in enumerate(columns):
                result[j] += [(row, moved[k, place]) for place, row in enumerate(rows)]
        return result

    def terms(self, v: Balls) -> Balls:
        """abs(M) abs(v) + e(v), which is what the factors of M add up on the way to v."""
        L = self.factor
        own = zeros(len(v)) if L is None else balls(abs(L) @ abs(L.T @ doubles(v)))
        return add(self.matrix.sizes(v), own)

    @functools.cached_property
    def factor(self) -> Doubles | None:
        """L of M = L L^T, None if M is not symmetric and positive definite."""
        M = self.matrix.dense
        if not np.array_equal(M, M.T):
            return None
        try:
            return np.asarray(np.linalg.cholesky(M), dtype=float)
        except np.linalg.LinAlgError:
            return None


def gram(A: Sparse, effects: Effects) -> Balls:
    """The diagonal of A^T M^-1 A."""
    known = [dict(own) for own in effects]
    result = zeros(A.columns)
    for i, j, a in A.entries:
        result[j] += a * known[j][i]
    return result


def spread(effects: Effects, impulses: Balls) -> Balls:
    """abs(A^T M^-1) abs(impulses): at least what they do with any signs."""
    return [sum((abs(x * impulses[row]) for row, x in own), arb(0)) for own in effects]


def least_reactions(A: Doubles, effect: Doubles) -> Balls:
    """abs(x) of the least x with A x = effect, each column in units of its length."""
    lengths = np.linalg.norm(A, axis=0)
    lengths[lengths == 0] = 1
    x, *_ = np.linalg.lstsq(A / lengths, effect, rcond=DEPENDENT)
    return balls(abs(x) / lengths)


# ---- one contact


class Axes(list[arb]):
    """The half-axes of an ellipsoid, one for each tangential component."""


def groups(x: Balls, limits: Sequence[arb]) -> list[Balls]:
    """The components behind the normal one: x_T, then x_R with rolling friction.

    With spin, which makes their number even, x_T, x_S, x_R.
    """
    if len(x) % 2 == 0:
        return [x[1:3], x[3:4], x[4:6]][: len(limits)]
    size = (len(x) - 1) // len(limits)
    return [x[1 + k * size : 1 + (k + 1) * size] for k in range(len(limits))]


def project_on_ellipsoid(x: Balls, axes: Axes) -> Balls:
    """P_K(x) for K = { sum of (r_k / e_k)^2 <= r_N^2 }.

    By the multiplier of the limit, p_k = e_k^2 n x_k / (n (1 + e_k^2) - x_N), and n is the root of
    a decreasing function between max(0, x_N) and |x_N| + sum of |e_k x_k|. The interval is halved
    until the sign is not known.
    """
    pairs = [(e, t) for e, t in zip(axes, x[1:], strict=True) if e > 0]

    def beyond(n: arb) -> arb:
        return sum(((e * t / (n * (1 + e * e) - x[0])) ** 2 for e, t in pairs), arb(0)) - 1

    low = x[0].max(arb(0))
    if x[0] + norm([e * t for e, t in pairs]) <= 0:
        n = arb(0)
    elif x[0] > 0 and norm([t / e for e, t in pairs]) <= x[0]:
        n = x[0]
    else:
        high = abs(x[0]) + sum((abs(e * t) for e, t in pairs), arb(0))
        low, high = arb(low.mid()), arb(high.mid()) + abs(arb(high.mid())) * 2**-20
        for _ in range(2 * ctx.prec):
            middle = arb(((low + high) / 2).mid())
            value = beyond(middle)
            if value > 0:
                low = middle
            elif value < 0:
                high = middle
            else:
                # no number between the two has a known sign
                low, high = low.union(middle), high.union(middle)
                break
        n = low.union(high)
    result = [n]
    for e, t in zip(axes, x[1:], strict=True):
        if not e > 0:
            result.append(arb(0))
        elif x[0] > 0 and n is x[0]:
            result.append(t)
        else:
            result.append(e * e * n / (n * (1 + e * e) - x[0]) * t if not is_zero(n) else arb(0))
    return result


def project(x: Balls, limits: Sequence[arb]) -> Balls:
    """P_K(x) for K = { norm of group k <= limits[k] r_N }.

    The normal part n is the root of n - x_N - sum of c max(0, t - c n), over the limits c and the
    norms t of the groups. That function is the least of increasing lines, one for each choice of
    limits that bind. So n is the largest of their roots, and 0 at least. No case is told from
    another, so that balls on a boundary do not matter.
    """
    if isinstance(limits, Axes):
        return project_on_ellipsoid(x, limits)
    parts = groups(x, limits)
    norms = [norm(part) for part in parts]
    n = arb(0)
    for binding in itertools.product((False, True), repeat=len(limits)):
        pairs = [(c, t) for c, t, binds in zip(limits, norms, binding, strict=True) if binds]
        rise = x[0] + sum((c * t for c, t in pairs), arb(0))
        n = n.max(rise / (1 + sum((c * c for c, _ in pairs), arb(0))))
    result = [n]
    for c, t, part in zip(limits, norms, parts, strict=True):
        shorter = (c * n / t).min(arb(1)) if t > 0 else arb(0).union(arb(1))
        result += [shorter * value for value in part]
    return result


def modified(u: Balls, limits: Sequence[arb], slips: Sequence[arb] | None = None) -> Balls:
    """u^: the norm of each group of u, times its limit, is added to u_N.

    `slips` are those at most that are rounding. So much is none.
    """
    result = u[0]
    if isinstance(limits, Axes):
        moves = [u[1:3], u[3:4]]
        for k, part in enumerate(moves):
            if slips is not None and not norm(part) > slips[k]:
                moves[k] = [arb(0) if norm(part) <= slips[k] else t.union(arb(0)) for t in part]
        stretched = [e * t for e, t in zip(limits, [*moves[0], *moves[1]], strict=True)]
        return [result + norm(stretched), *u[1:]]
    for k, (c, part) in enumerate(zip(limits, groups(u, limits), strict=True)):
        slip = norm(part)
        if slips is None or slip > slips[k]:
            result += c * slip
        elif not slip <= slips[k]:  # on either side
            result += c * slip.union(arb(0))
    return [result, *u[1:]]


def natural_map(r: Balls, hat: Balls, limits: Sequence[arb], rho: arb) -> Balls:
    """R - P_K(r - rho u^)."""
    y = [a - rho * b for a, b in zip(r, hat, strict=True)]
    return [a - b for a, b in zip(r, project(y, limits), strict=True)]


def status(y: Balls, limits: Sequence[arb]) -> str:
    """The state that P_K(y) tells."""
    if is_zero(project(y, limits)[0]):
        return "open"
    if isinstance(limits, Axes):
        inside = y[0] >= 0 and not any(
            t != 0 for e, t in zip(limits, y[1:], strict=True) if not e > 0
        )
        held = [t / e for e, t in zip(limits, y[1:], strict=True) if e > 0]
        return "stick" if inside and norm(held) <= y[0] else "slide"
    sizes = zip(limits, groups(y, limits), strict=True)
    return "stick" if all(norm(part) <= c * y[0] for c, part in sizes) else "slide"


# ---- the whole problem


@dataclass(frozen=True)
class Verdict:
    """The merits, each a ball."""

    natural: arb
    scaled_natural: arb
    dynamics: arb
    bilateral: arb
    kinematics: arb
    cone: arb
    dual_cone: arb
    complementarity: arb
    open: int
    stick: int
    slide: int
    u: Balls

    @property
    def error(self) -> arb:
        """What every tolerance bounds."""
        return largest(
            (self.natural, self.scaled_natural, self.dynamics, self.bilateral, self.kinematics)
        )


@dataclass(frozen=True)
class Terms:
    """What the equations say, whatever the formulation."""

    u: Balls  # recomputed
    q: Balls  # condensed for a global problem
    sizes: Balls  # c: of the terms of q
    rounding: Balls  # eps_q
    diagonal: Balls  # of W
    dynamics: arb
    bilateral: arb
    kinematics: arb


def by_contact(x: Balls, d: int) -> list[Balls]:
    """The components of each contact."""
    return [x[k : k + d] for k in range(0, len(x), d)]


def contact_norms(x: Balls, d: int) -> Balls:
    """The norm of each contact's part of x, at each of its components."""
    return [size for part in by_contact(x, d) for size in [norm(part)] * d]


def mean_square_root(x: Balls) -> arb:
    """The root of the mean square."""
    return norm(x) / arb(max(1, len(x))).sqrt()


def stopping(velocity: Balls, diagonal: Balls, d: int, least: arb | None = None) -> Balls:
    """r_0: reactions that stop these velocities, each contact alone; 0 where W_aa is.

    No contact counts as slower than `least`: r_1.
    """
    result = []
    for part, own in zip(by_contact(velocity, d), by_contact(diagonal, d), strict=True):
        size = sum((abs(x) for x in own), arb(0)) / d
        velocity_of = norm(part) if least is None else norm(part).max(least)
        result += [quotient(velocity_of, size)] * d
    return result


def worst(residual: Balls, velocity: Balls) -> arb:
    """The largest quotient; the residual itself where there is no velocity to compare it with."""
    return largest(
        abs(x) if is_zero(y) else abs(x / y) for x, y in zip(residual, velocity, strict=True)
    )


def beyond(residual: Balls, terms: Balls, unit: float) -> Balls:
    """What is left of each component beyond `unit` of its terms."""
    result = []
    for x, y in zip(residual, terms, strict=True):
        left = (abs(x) - unit * y).max(arb(0))
        result.append(-left if x < 0 else left)
    return result


@functools.lru_cache(maxsize=16)
def local_matrices(problem: Any, _precision: int) -> tuple[Sparse, ...]:
    """W, and V and R of a mixed problem."""
    names = ("W",) if problem.V is None else ("W", "V", "R")
    return tuple(Sparse(getattr(problem, name)) for name in names)


@functools.lru_cache(maxsize=16)
def global_matrices(problem: Any, _precision: int) -> list[Any]:
    """M with its inverse, and H; then G of a mixed problem: each with its effects and W_kk."""
    mass = Mass(Sparse(problem.M))
    found: list[Any] = [mass]
    for A in [Sparse(x) for x in (problem.H, problem.G) if x is not None]:
        effects = mass.effects(A)
        found += [A, effects, gram(A, effects)]
    return found


def local_terms(problem: Any, solution: Any, unit: float, unit_of_q: float) -> Terms:
    """U = W r + V l + q, V^T r + R l + s = 0."""
    d, r, q = problem.spacedim, balls(solution.r), balls(problem.q)
    W, *joints = local_matrices(problem, ctx.prec)
    diagonal = W.diagonal()
    u, own = add(W.times(r), q), [abs(x) for x in q]
    rounding, bilateral, V = zeros(len(q)), arb(0), None
    if joints:
        assert solution.l is not None
        (V, R), s, lam = joints, balls(problem.s), balls(solution.l)
        size = [abs(x) for x in s]
        held = [quotient(a, abs(b)) for a, b in zip(size, R.diagonal(), strict=True)]
        u, moved = add(u, V.times(lam)), V.sizes(held)
        own, rounding = add(own, moved), [unit_of_q * x for x in moved]
    stop = stopping(own, diagonal, d)
    known_r, known_l = stop, zeros(0) if V is None else held
    if unit:
        A, effect = W.dense, W.times(r)
        if V is not None:
            A = np.block([[A, V.dense], [V.dense.T, R.dense]])
            effect = add(effect, V.times(lam)) + add(V.transposed(r), R.times(lam))
        least = least_reactions(A, doubles(effect))
        known_r, known_l = larger(stop, least[: len(r)]), larger(known_l, least[len(r) :])
    terms = add(W.sizes(known_r), [abs(x) for x in q])
    if V is not None:
        terms = add(terms, V.sizes(known_l))
        residual = add(V.transposed(r), R.times(lam), s)
        parts = add(V.sizes_transposed(known_r), R.sizes(known_l), size)
        velocity = add(V.sizes_transposed(stop), R.sizes(held), size)
        least = [mean_square_root(s)] * len(s)
        bilateral = worst(beyond(residual, parts, unit), larger(velocity, least))
    kinematics = arb(0)
    if solution.u is not None:
        difference = [a - b for a, b in zip(balls(solution.u), u, strict=True)]
        moved = contact_norms(add(W.sizes(stop), own), d)
        velocity = larger(moved, contact_norms(u, d))
        least = [mean_square_root(q)] * len(q)
        kinematics = worst(beyond(difference, terms, unit), larger(velocity, least))
    return Terms(u, q, own, rounding, diagonal, arb(0), bilateral, kinematics)


def global_terms(problem: Any, solution: Any, unit: float, unit_of_q: float) -> Terms:
    """M v = H r + G l + f, u = H^T v + w, G^T v + b = 0."""
    d, r, f, w = problem.spacedim, balls(solution.r), balls(problem.f), balls(problem.w)
    mass, H, effects, diagonal, *joints = global_matrices(problem, ctx.prec)
    free = mass.solve(f)
    q = add(H.transposed(free), w)
    own = add(H.sizes_transposed(free), [abs(x) for x in w])
    effect = H.times(r)
    known_r, known_l = stopping(own, diagonal, d), zeros(0)
    stop = H.sizes(stopping(own, diagonal, d, mean_square_root(q)))
    G = b = None
    if joints:
        assert solution.l is not None
        (G, effects_of_joints, inertia), b, lam = joints, balls(problem.b), balls(solution.l)
        velocity = add(G.sizes_transposed(free), [abs(x) for x in b])
        held = [quotient(x, y) for x, y in zip(velocity, inertia, strict=True)]
        slowest = [mean_square_root(add(G.transposed(free), b))] * len(b)
        least_held = [quotient(x, y) for x, y in zip(slowest, inertia, strict=True)]
        effect, known_l = add(effect, G.times(lam)), held
        stop = add(stop, G.sizes(larger(held, least_held)))
    impulse = add(effect, f)
    given = solution.v is not None
    v = balls(solution.v) if given else mass.solve(impulse)
    rounding = terms = []
    if unit:
        terms = add(mass.terms(free), [abs(x) for x in f])
        if G is not None:
            terms = add(terms, G.sizes(known_l))
        rounding = [unit_of_q * x for x in add(own, spread(effects, terms))]
        A: Any = H.dense
        by_factor: Any = doubles(effect)
        if G is not None:
            A = np.hstack([A, G.dense])
        L = mass.factor
        if L is not None:
            whole = np.linalg.solve(L, np.column_stack([A, by_factor]))
            A, by_factor = whole[:, :-1], whole[:, -1]
        least = least_reactions(A, by_factor)
        known_r, known_l = larger(known_r, least[: len(r)]), larger(known_l, least[len(r) :])
        terms = add(mass.terms(v), [abs(x) for x in f], H.sizes(known_r))
        if G is not None:
            terms = add(terms, G.sizes(known_l))
    terms = terms or zeros(len(f))
    fastest, dynamics = larger(v, free), arb(0)
    if given:
        residual = [a - b for a, b in zip(mass.matrix.times(v), impulse, strict=True)]
        velocity = larger(fastest, mass.solve(stop))
        least = [2.0**-52 * largest(velocity)] * len(v)
        dynamics = worst(mass.solve(beyond(residual, terms, unit)), larger(velocity, least))

    u, kinematics = add(H.transposed(v), w), arb(0)
    if solution.u is not None:
        difference = [a - b for a, b in zip(balls(solution.u), u, strict=True)]
        parts = add(H.sizes_transposed(fastest), [abs(x) for x in w])
        allowed = parts if given or not unit else add(parts, spread(effects, terms))
        velocity = larger(contact_norms(parts, d), [mean_square_root(q)] * len(q))
        kinematics = worst(beyond(difference, allowed, unit), velocity)
    bilateral = arb(0)
    if G is not None and b is not None:
        residual = add(G.transposed(v), b)
        parts = add(G.sizes_transposed(fastest), [abs(x) for x in b])
        allowed = add(parts, spread(effects_of_joints, terms)) if unit else parts
        bilateral = worst(beyond(residual, allowed, unit), larger(parts, slowest))
    rounding = rounding or zeros(len(q))
    return Terms(u, q, own, rounding, diagonal, dynamics, bilateral, kinematics)


def relative(parts: Balls, scales: Sequence[Balls]) -> arb:
    """The norm of `parts` over the largest of the scales; absolute where all of them are 0."""
    scale = largest(norm(x) for x in scales)
    return norm(parts) if is_zero(scale) else norm(parts) / scale


def slips_of_rounding(sizes: Balls, d: int, count: int) -> list[Balls]:
    """s_T, and s_R, of each contact: so much sliding is none."""
    parts = [(own, groups(own, [arb(0)] * count)) for own in by_contact(sizes, d)]
    sizes_of = [
        [norm(([own[0]] if k == 0 else []) + part[k]) for k in range(count)] for own, part in parts
    ]
    means = [mean_square_root([own[k] for own in sizes_of]) for k in range(count)]
    return [[UNIT_OF_Q * own[k].max(means[k]) for k in range(count)] for own in sizes_of]


def contacts(problem: Any, solution: Any, terms: Terms, rounding: bool) -> Verdict:
    """The parts that follow from u, r and q contact by contact."""
    d, nc = problem.spacedim, problem.nc
    coefficients = [balls(problem.mu)]
    for name in ("mu_s", "mu_r"):
        if getattr(problem, name, None) is not None:
            coefficients.append(balls(getattr(problem, name)))
    coupled = bool(getattr(problem, "coupled", 0))
    sizes = [sum((abs(x) for x in own), arb(0)) / d for own in by_contact(terms.diagonal, d)]
    known = [x for x in sizes if not is_zero(x)]
    others = sum(known, arb(0)) / len(known) if known else arb(1)
    rho = [1 / (others if is_zero(x) else x) for x in sizes]
    u, r = by_contact(terms.u, d), by_contact(balls(solution.r), d)
    allowed = [norm(x) for x in by_contact(terms.rounding, d)]
    slips = slips_of_rounding(terms.sizes, d, len(coefficients)) if rounding else [None] * nc
    natural, impulses, velocities = zeros(nc), zeros(nc), zeros(nc)
    cone, dual, power = zeros(nc), zeros(nc), zeros(nc)
    counts = {"open": 0, "stick": 0, "slide": 0}
    for a in range(nc):
        limits: Sequence[arb] = [each[a] for each in coefficients]
        if coupled:
            limits = Axes([limits[0], limits[0], limits[1]])
        hat = modified(u[a], limits, slips[a])
        natural[a] = (norm(natural_map(r[a], hat, limits, arb(1))) - allowed[a]).max(arb(0))
        scaled = norm(natural_map(r[a], hat, limits, rho[a]))
        impulses[a] = (scaled - rho[a] * allowed[a]).max(arb(0))
        velocities[a] = ((scaled / rho[a]).max(-u[a][0]) - allowed[a]).max(arb(0))
        cone[a] = norm(natural_map(r[a], hat, limits, arb(0)))
        dual[a] = norm(project([-x for x in hat], limits))
        power[a] = abs(sum((x * y for x, y in zip(r[a], hat, strict=True)), arb(0)))
        y = [x - rho[a] * z for x, z in zip(r[a], hat, strict=True)]
        counts[status(y, limits)] += 1
    impulse = [rho[k // d] * x for k, x in enumerate(terms.q)]
    impulse_rounding = [rho[k // d] * x for k, x in enumerate(terms.rounding)]
    return Verdict(
        natural=relative(natural, [terms.q, terms.rounding]),
        scaled_natural=relative(impulses, [impulse, impulse_rounding]).max(
            relative(velocities, [terms.q, terms.rounding])
        ),
        dynamics=terms.dynamics,
        bilateral=terms.bilateral,
        kinematics=terms.kinematics,
        cone=largest(cone),
        dual_cone=largest(dual),
        complementarity=largest(power),
        **counts,
        u=terms.u,
    )


def narrow(x: arb) -> bool:
    """Whether the ball says all that a double can hold."""
    return bool(x <= NOTHING or (x > 0 and x.rad() <= NARROW * x.mid()))


def judge(problem: fclib.Problem, solution: fclib.Solution, rounding: bool = False) -> Verdict:
    """The merits of a solution, without any allowance for rounding unless it is asked for."""
    if solution.r is None:
        raise ValueError("a solution without r cannot be judged")
    given = [getattr(solution, name) for name in ("v", "u", "r", "l")]
    if not all(np.isfinite(x).all() for x in given if x is not None):
        inf = arb("inf")  # what is not a number is as wrong as can be
        return Verdict(inf, inf, inf, inf, inf, inf, inf, inf, 0, 0, 0, [])
    local = problem.kind.startswith("local")
    equations: Callable[..., Terms] = local_terms if local else global_terms
    units = (UNIT, UNIT_OF_Q) if rounding else (0.0, 0.0)
    for precision in PRECISIONS:
        with ctx.workprec(precision):
            try:
                verdict = contacts(
                    problem, solution, equations(problem, solution, *units), rounding
                )
            except ZeroDivisionError:  # M is singular as far as these bits tell
                continue
            fields = (getattr(verdict, name) for name in ("natural", "scaled_natural", "dynamics",
                                                          "bilateral", "kinematics"))  # fmt: skip
            if all(narrow(x) for x in fields):
                return verdict
    raise ArithmeticError(f"{precision} bits do not tell the error of this solution")
