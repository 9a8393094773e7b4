"""Proofs that a problem has no solution, checked on its data as given, in rational arithmetic.

u^ is in K* exactly if u_N >= 0. So, by Farkas' lemma, a proof that there is no solution is y >= 0,
one number for each contact, and z, one for each bilateral constraint, with

    local    -(W^T E y + V z) in K*,  V^T E y + R^T z = 0,  y . q_N + z . s < 0
    global   H E y + G z = 0,                               y . w_N + z . b < 0

Every double is a rational number, and so are the sums. A condensed W carries rounding errors. The
rest of W^T E y is then accepted under the two conditions of `check`, and the proof holds up to a
norm of the reactions.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from math import inf, isfinite, nextafter, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import qr

from fclib import _core, _digest, _laws, _solve
from fclib._regular import regular
from fclib.analysis._data import Array

LAST_DIGITS = 8  # the rest may be so many times the rounding of W's last digits
LEAST_GAIN = Fraction(1, 10**8)  # a gain below this share of its terms is rounding
LEAST_SPEED = 1e-6  # in ||q||: a slower closing speed is within the tolerance of solutions
NEAREST = 1e-9  # largest relative change of each y by an exact proof
MOST = 60  # largest number of unknowns for a kernel in rational arithmetic
DIGITS = 5000  # largest number of digits of a number in a file
FORMAT = "fclib certificate 1"

Numbers = Mapping[int, Fraction]


@dataclass(frozen=True)
class Certificate:
    """A proof that there is no solution, of a problem as given.

    Attributes:
        y: (nc,) >= 0 and z: (p,), or None without bilateral constraints, as doubles.
        exact_y, exact_z: the same as rational numbers, without zeros.
        gain: -(y . q_N + z . s), or the same with w and b; positive.
        distance: upper bound of the distance of -(W^T E y + V z) from K*; 0 for an exact proof.
        bound: no reactions with a norm below this are a solution; inf for an exact proof.
    """

    y: Array = field(repr=False)
    z: Array | None = field(repr=False)
    exact_y: Numbers = field(repr=False)
    exact_z: Numbers = field(repr=False)
    gain: float
    distance: float
    bound: float

    @property
    def exact(self) -> bool:
        """Whether it holds for all reactions."""
        return self.bound == inf

    @property
    def contacts(self) -> int:
        """The number of contacts in the proof."""
        return len(self.exact_y)

    def record(self, problem: _solve.Problem) -> dict[str, Any]:
        """The content of a certificate's file; numbers are exact, for example "3/7"."""
        return {
            "format": FORMAT,
            "digest": _digest.digest(problem),
            "y": {str(a): str(value) for a, value in self.exact_y.items()},
            "z": {str(k): str(value) for k, value in self.exact_z.items()},
            "gain": self.gain,
            "bound": None if self.exact else self.bound,
        }


class CertificateError(_core.ProblemError):
    """A certificate proves nothing; the message names the contact that breaks it."""


@dataclass(frozen=True)
class _System:
    """The terms of the sums, by unknown: the first nc are y, the others z."""

    nc: int
    p: int
    d: int
    cone: Mapping[int, list[tuple[int, Fraction]]]
    zero: Mapping[int, list[tuple[int, Fraction]]]
    constants: Sequence[Fraction]


def _entries(a: Any) -> Iterable[tuple[int, int, float]]:
    entries = sp.coo_array(a)
    yield from zip(entries.row.tolist(), entries.col.tolist(), entries.data.tolist(), strict=True)


def _system(problem: _solve.Problem, used: set[int]) -> _System:
    """The terms of the unknowns in use."""
    d, nc, p = problem.spacedim, problem.nc, problem.p
    cone: dict[int, list[tuple[int, Fraction]]] = defaultdict(list)
    zero: dict[int, list[tuple[int, Fraction]]] = defaultdict(list)

    def add_term(to: dict[int, list[tuple[int, Fraction]]], row: int, k: int, value: float) -> None:
        if k in used and value:
            to[k].append((row, Fraction(value)))

    if isinstance(problem, _laws.Global):
        for row, col, value in _entries(problem.H):
            if col % d == 0:
                add_term(zero, row, col // d, value)
        if problem.G is not None:
            for row, col, value in _entries(problem.G):
                add_term(zero, row, nc + col, value)
        constants = [*problem.w[::d], *(problem.b if problem.b is not None else [])]
    else:
        for row, col, value in _entries(problem.W):
            if row % d == 0:
                add_term(cone, col, row // d, -value)
        if problem.V is not None:
            for row, col, value in _entries(problem.V):
                add_term(cone, row, nc + col, -value)
                if row % d == 0:
                    add_term(zero, col, row // d, value)
        if problem.R is not None:
            for row, col, value in _entries(problem.R):
                add_term(zero, col, nc + row, value)
        constants = [*problem.q[::d], *(problem.s if problem.s is not None else [])]
    return _System(nc, p, d, cone, zero, [Fraction(float(one)) for one in constants])


def _sum(
    terms: Mapping[int, list[tuple[int, Fraction]]], x: Numbers
) -> tuple[dict[int, Fraction], dict[int, Fraction]]:
    """The sums that are not zero, and the sums of the sizes of their terms."""
    total: dict[int, Fraction] = defaultdict(Fraction)
    size: dict[int, Fraction] = defaultdict(Fraction)
    for k, value in x.items():
        for row, entry in terms.get(k, []):
            total[row] += entry * value
            size[row] += abs(entry * value)
    return {row: value for row, value in total.items() if value}, size


def _outside(problem: _solve.Problem, a: int, part: Sequence[Fraction]) -> float:
    """An upper bound of the distance of a contact's part from K*; 0 exactly if it is inside."""
    normal = part[0]
    squares = [
        sum(
            (
                (Fraction(float(axis)) * x) ** 2
                for axis, x in zip(group.axes[a], part[group.part], strict=True)
            ),
            Fraction(),
        )
        for group in _laws.groups(problem)
    ]
    if _at_least_roots(normal, squares):
        return 0.0
    size = _root(sum((x * x for x in part), Fraction()))
    outside = nextafter(sum(map(_root, squares)) - float(normal), inf)
    return max(5e-324, min(size, outside * (1 + 1e-12)) if outside > 0 else size)


def _at_least_roots(x: Fraction, squares: Sequence[Fraction]) -> bool:
    """Whether x is at least the sum of the roots of at most three numbers, without roots."""
    if x < 0:
        return False
    if len(squares) < 2:
        return x * x >= sum(squares)
    *two, last = [Fraction(), *squares][-3:]
    # x - sqrt(last) >= 0, and its square less the sum of the two is at least 2 sqrt(their product):
    # rest >= sqrt(s) + sqrt(t)
    rest = x * x + last - sum(two)
    s, t = 4 * x * x * last, 4 * two[0] * two[1]
    left = rest * rest - s - t
    return x * x >= last and rest >= 0 and left >= 0 and left * left >= 4 * s * t


def _root(x: Fraction) -> float:
    """An upper bound of the root."""
    if x == 0:
        return 0.0
    shift = (x.denominator.bit_length() - x.numerator.bit_length()) // 2
    scaled = x * Fraction(4) ** shift
    return sqrt(float(scaled)) * (1 + 1e-14) * 2.0**-shift


def check(
    problem: _solve.Problem, y: Mapping[int, Any], z: Mapping[int, Any] | None = None
) -> Certificate:
    """The proof that y and z give, in exact arithmetic.

    If W^T E y is not in K*, the proof can still be accepted for a local problem without bilateral
    constraints, up to a norm of the reactions. It is if the rest is at most the last digits of W,
    and y . W_NN y < 0: then W is not positive semidefinite, so it was rounded. If W is positive
    semidefinite, the rest is a velocity that the contacts can have.

    Args:
        problem: any formulation.
        y: one number for each contact, of any type that Fraction takes.
        z: one number for each bilateral constraint.

    Raises:
        CertificateError: it proves nothing; the message names the contact or constraint that breaks
            it.
    """
    exact_y = _rationals(y, problem.nc, "y", "contact")
    exact_z = _rationals(z or {}, problem.p, "z", "bilateral constraint")
    try:
        return _check(problem, exact_y, exact_z)
    except OverflowError:
        raise CertificateError(
            "its sums are too large for doubles: any positive multiple of y and z proves the same"
        ) from None


def _check(problem: _solve.Problem, exact_y: Numbers, exact_z: Numbers) -> Certificate:
    nc, p = problem.nc, problem.p
    for a, value in exact_y.items():
        if value < 0:
            raise CertificateError(f"y: contact {a}: {float(value):.3g} is negative")
    x = {**exact_y, **{nc + k: value for k, value in exact_z.items()}}
    system = _system(problem, set(x))
    terms = [value * system.constants[k] for k, value in x.items()]
    gain = -sum(terms, Fraction())
    if not gain > LEAST_GAIN * sum(map(abs, terms)):
        worst = min(exact_y, key=lambda a: -exact_y[a] * system.constants[a], default=None)
        where = "" if worst is None else f", contact {worst} takes the most from it"
        raise CertificateError(
            f"-(y . q_N + z . s) is {float(gain):.3g}, which must be positive{where}"
        )
    if isinstance(problem, _laws.Local):
        size = float(np.linalg.norm(problem.q)) * sqrt(
            sum(float(one) ** 2 for one in exact_y.values())
        )
        if not float(gain) > LEAST_SPEED * size * (1 - 1e-9):
            raise CertificateError(
                f"-(y . q_N + z . s) is {float(gain):.3g}, which ||q|| hides: contact "
                f"{max(exact_y, key=lambda a: exact_y[a])} closes within the tolerance"
            )
    rest, _ = _sum(system.zero, x)
    if rest:
        row, value = max(rest.items(), key=lambda item: abs(item[1]))
        if isinstance(problem, _laws.Global):
            touching = [k for k in exact_y if any(one == row for one, _ in system.zero.get(k, []))]
            where = f"contact {touching[0]}" if touching else "a bilateral constraint"
            raise CertificateError(
                f"{where}: H E y + G z = {float(value):.3g} at degree of freedom {row}, "
                "which must be 0"
            )
        raise CertificateError(
            f"bilateral constraint {row}: V^T E y + R^T z = {float(value):.3g}, which must be 0"
        )
    image, magnitudes = _sum(system.cone, x)
    distance, broken, curvature = 0.0, -1, Fraction()
    bounded = p == 0
    for a in sorted({row // system.d for row in image}):
        part = [image.get(system.d * a + k, Fraction()) for k in range(system.d)]
        off = _outside(problem, a, part)
        curvature -= exact_y.get(a, Fraction()) * part[0]
        if off == 0:
            continue
        broken = a if broken < 0 else broken
        distance = float(np.hypot(distance, off)) * (1 + 1e-15)
        terms_of_a = sum(
            (magnitudes.get(system.d * a + k, Fraction()) for k in range(system.d)), Fraction()
        )
        bounded = bounded and off <= LAST_DIGITS * 2.0**-53 * float(terms_of_a)
    if broken >= 0 and not (bounded and curvature < 0):
        raise CertificateError(
            f"contact {broken}: -(W^T E y + V z) is not in K*, by {distance:.3g} in all"
        )
    bound = float(gain) / distance * (1 - 1e-14) if distance else inf
    doubles = np.zeros(nc)
    doubles[list(exact_y)] = [float(value) for value in exact_y.values()]
    bilateral = np.zeros(p)
    bilateral[list(exact_z)] = [float(value) for value in exact_z.values()]
    return Certificate(
        doubles, bilateral if p else None, exact_y, exact_z, float(gain), distance, bound
    )


def check_arrays(problem: _solve.Problem, y: Array, z: Array | None = None) -> Certificate:
    """`check` of y (nc,) and z (p,) as arrays, as in `fclib.Result`.

    If doubles are too coarse for the sums to vanish, it is the nearest proof in rational numbers.

    Raises:
        CertificateError: they prove nothing.
    """
    own = _rationals(dict(enumerate(y.tolist())), problem.nc, "y", "contact")
    by_constraint = {} if z is None else dict(enumerate(z.tolist()))
    near = _rationals(by_constraint, problem.p, "z", "bilateral constraint")
    try:
        return check(problem, own, near)
    except CertificateError:
        if len(own) + problem.p > MOST or (exact := _completed(problem, own, near, "zero")) is None:
            raise
        if any(abs(value - own[a]) > NEAREST * own[a] for a, value in exact[0].items()):
            raise
        return check(problem, *exact)


def _rationals(values: Mapping[int, Any], count: int, name: str, of: str) -> dict[int, Fraction]:
    result = {}
    for key, value in values.items():
        if not 0 <= key < count:
            raise CertificateError(f"{name}: there is no {of} {key}, the problem has {count}")
        try:
            # the number of such a text would fill the memory
            if isinstance(value, str) and abs(Decimal(value.partition("/")[0]).adjusted()) > DIGITS:
                raise ValueError
            number = Fraction(value)
        except (ArithmeticError, ValueError, TypeError):
            raise CertificateError(f"{name}: {of} {key}: {value!r} is no number") from None
        if number:
            result[key] = number
    return result


def farkas(problem: _solve.Problem, y: Any, z: Any = None) -> Certificate | None:
    """The proof that y (and z) give, or one near them; None if none was found.

    Args:
        problem: any formulation.
        y: (nc,) as in Certificate.
        z: (p,) likewise; found from y if it is left out.

    Raises:
        fclib.ProblemError: y or z is not of this size.
    """
    nc, p = problem.nc, problem.p
    y = np.asarray(y, dtype=float)
    if y.shape != (nc,) or (z is not None and np.shape(z) != (p,)):
        raise _core.ProblemError(f"y must have nc = {nc} entries, z p = {p}")
    if not np.isfinite(y).all() or (y < 0).any() or not y.any():
        return None
    own = {int(a): Fraction(float(y[a])) for a in np.flatnonzero(y)}
    near = {
        int(k): Fraction(float(z[k]))
        for k in ([] if z is None else np.flatnonzero(z))
        if isfinite(z[k])
    }
    if z is not None or p == 0:
        try:
            found = check(problem, own, near)
        except CertificateError:
            pass
        else:
            if found.exact:
                return found
    best = None
    if core := _core.prove_no_solution(problem, y):
        try:
            best = check_arrays(problem, core[0], core[1] if p else None)
        except CertificateError:
            best = None
        if best is not None and best.exact:
            return best
    # doubles cannot decide: find the kernel in rational numbers
    if len(own) + p <= MOST:
        for rows in ("zero", "all"):
            if (exact := _completed(problem, own, near, rows)) is None:
                continue
            try:
                found = check(problem, *exact)
            except CertificateError:
                continue
            if found.exact:
                return found
    return best


def _completed(
    problem: _solve.Problem, y: Numbers, z: Numbers, which: str
) -> tuple[dict[int, Fraction], dict[int, Fraction]] | None:
    """Y and z moved so that the sums vanish exactly: those that must vanish, or all of them."""
    nc, p = problem.nc, problem.p
    system = _system(problem, {*y, *range(nc, nc + p)})
    rows: dict[tuple[bool, int], dict[int, Fraction]] = defaultdict(dict)
    for kind, terms in ((False, system.zero), (True, system.cone)):
        if kind and which == "zero":
            continue
        for k, entries in terms.items():
            for row, value in entries:
                own = rows[kind, row]
                own[k] = own.get(k, Fraction()) + value
    if not rows:
        return None
    # the bilateral multipliers follow from y; of y, change the entries that change least
    unknowns = [*range(nc, nc + p), *_by_independence(list(rows.values()), y, range(nc, nc + p))]
    pivots: dict[int, dict[int, Fraction]] = {}
    place = {k: number for number, k in enumerate(unknowns)}
    for equation in rows.values():
        left = {k: value for k, value in equation.items() if value}
        while left:
            k = min(left, key=lambda one: place[one])
            if k not in pivots:
                factor = left[k]
                pivots[k] = {one: value / factor for one, value in left.items()}
                break
            factor = left[k]
            for one, value in pivots[k].items():
                rest = left.get(one, Fraction()) - factor * value
                if rest:
                    left[one] = rest
                else:
                    left.pop(one, None)
        if len(pivots) == len(unknowns):
            return None
    x: dict[int, Fraction] = {}
    for k in reversed(unknowns):
        if k in pivots:
            x[k] = -sum(
                (value * x[one] for one, value in pivots[k].items() if one != k), Fraction()
            )
        else:
            x[k] = y[k] if k in y else z.get(k - nc, Fraction())
    return {a: x[a] for a in y}, {k: x[nc + k] for k in range(p)}


def _by_independence(equations: list[dict[int, Fraction]], y: Numbers, joints: range) -> list[int]:
    """The contacts of y, first those with large terms that depend least on each other."""
    order = [*joints, *y]
    place = {k: number for number, k in enumerate(order)}
    terms = np.zeros((len(equations), len(order)))
    for row, equation in zip(terms, equations, strict=True):
        for k, value in equation.items():
            row[place[k]] = float(value) * float(y.get(k, 1))
    held, own = terms[:, : len(joints)], terms[:, len(joints) :]
    if not np.isfinite(terms).all() or not own.size:
        return sorted(y, key=lambda a: y[a])
    if len(joints):
        basis, upper, _ = qr(held, mode="economic", pivoting=True)
        sizes = abs(np.diag(upper))
        basis = basis[:, : int((sizes > 1e-12 * sizes.max(initial=0.0)).sum())]
        own = own - basis @ (basis.T @ own)
    return [order[len(joints) + int(k)] for k in qr(own, mode="r", pivoting=True)[1]]


def read_certificate(path: str | Path) -> tuple[dict[int, Any], dict[int, Any], str | None]:
    """Y, z and the digest from a file with a `Certificate.record`, or with its y and z.

    Raises:
        fclib.FileError: the file is not a certificate.
    """
    try:
        record = json.loads(regular(path).read_text())
        record = record.get("certificate") or record
        y, z = record["y"], record.get("z") or {}
        parts = [
            {int(k): v for k, v in (x.items() if isinstance(x, dict) else enumerate(x)) if v}
            for x in (y, z)
        ]
    except OSError as error:
        raise _core.FileError(f"{path}: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise _core.FileError(f"{path}: no certificate: y and z are missing") from None
    return parts[0], parts[1], record.get("digest")
