"""All solutions of one spatial contact with friction, in rational arithmetic.

If it slides, r = n (1, mu e) and u_T = -sigma e with a direction e, n > 0, sigma > 0. With
e = (1 - t^2, 2 t) / (1 + t^2) the part of u_T across e vanishes at the roots of a quartic P(t)
(Bonnefon & Daviet 2011, "Quartic formulation of Coulomb 3D frictional contact"); the signs of n and
sigma are those of two other polynomials. Sturm's theorem counts and separates the roots, and the
signs there are certain: nothing is rounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import ceil, gcd, isfinite

import numpy as np

from fclib.analysis._data import EPS
from fclib.analysis._rational import integers

CELLS = 1 << 18  # largest number of cells of sliding directions; each is refuted in doubles
NEAR = 1 - 5e-5  # cosine of the angle, a hundredth, within which directions count as equal
REGULAR = 1e8  # largest condition of W for which a sticking solution is safe against a change of q
DIGITS = Fraction(1, 2**80)  # precision of the roots

Number = Fraction
Polynomial = list[Fraction]  # the coefficient of t^k at k; without zeros at the end
Vector = tuple[Fraction, ...]


@dataclass(frozen=True)
class Point:
    """Solutions in one state: u and r of one of them, and whether all have the same."""

    state: str
    u: Vector
    r: Vector
    velocity: bool = True
    reaction: bool = True


@dataclass(frozen=True)
class Found:
    """The solutions, the reason if they may not be all, and `robust` as in Enumeration."""

    points: list[Point]
    missing: str
    robust: bool


def one_contact(W: list[list[Fraction]], q: list[Fraction], mu: Fraction, change: float) -> Found:
    """All solutions of u = W r + q and Coulomb's law; `change` of q is for `robust`."""
    if not any(map(any, W)):  # nothing moves: u = q, and any r that fits to it is a solution
        state = "open" if q[0] > 0 else "slide" if any(q) else "stick"
        still = Point(state, tuple(q), (Fraction(0),) * 3, reaction=q[0] > 0)
        return Found([still] if q[0] >= 0 else [], "", q[0] == 0 or abs(q[0]) > change)
    points = []
    if q[0] > 0 or (q[0] == 0 and any(q)):
        points.append(Point("open" if q[0] > 0 else "slide", tuple(q), (Fraction(0),) * 3))
    held, why = _stick(W, q, mu)
    sliding, slides = _slide(W, q, mu)
    points += held + sliding
    missing = [one for one in (why, slides) if one]
    robust = not missing and _robust(W, q, mu, change, points)
    return Found(points, "; ".join(missing), robust)


def _stick(W: list[list[Fraction]], q: list[Fraction], mu: Fraction) -> tuple[list[Point], str]:
    """W r = -q with r in K."""
    rows = [[*row, -value] for row, value in zip(W, q, strict=True)]
    pivots: list[int] = []
    for column in range(3):
        free = rows[len(pivots) :]
        chosen = next((k for k, row in enumerate(free) if row[column]), None)
        if chosen is None:
            continue
        at = len(pivots)
        rows[at], rows[at + chosen] = rows[at + chosen], rows[at]
        rows[at] = [value / rows[at][column] for value in rows[at]]
        for k in range(3):
            if k != at:
                by = rows[k][column]
                rows[k] = [a - by * b for a, b in zip(rows[k], rows[at], strict=True)]
        pivots.append(column)
    if any(row[3] for row in rows[len(pivots) :]):
        return [], ""
    r = [Fraction(0)] * 3
    for row, column in zip(rows, pivots, strict=False):
        r[column] = row[3]
    still = (Fraction(0),) * 3
    if len(pivots) == 3:
        inside = r[0] >= 0 and r[1] ** 2 + r[2] ** 2 <= (mu * r[0]) ** 2
        return ([Point("stick", still, tuple(r))] if inside else []), ""
    if len(pivots) < 2:
        return [], "sticking reactions have two or more parameters"
    # one parameter: r + s d, along a line
    last = next(k for k in range(3) if k not in pivots)
    d = [Fraction(0)] * 3
    d[last] = Fraction(1)
    for row, column in zip(rows, pivots, strict=False):
        d[column] = -row[last]
    normal = _trim([r[0], d[0]])
    cone = _add(
        _times(_trim([mu * r[0], mu * d[0]]), _trim([mu * r[0], mu * d[0]])),
        *(_scale(_times(_trim([r[k], d[k]]), _trim([r[k], d[k]])), -1) for k in (1, 2)),
    )
    # points at which one of them vanishes, and points between
    product = _times(normal or [Fraction(1)], cone or [Fraction(1)])
    tried = [(s, False) for s in between(product)]
    tried += [(low, True) for low, high in roots(product) if low == high]
    for s, exact in tried:
        if _at(normal, s) >= 0 and _at(cone, s) >= 0:
            there = tuple(a + s * b for a, b in zip(r, d, strict=True))
            return [Point("stick", still, there, reaction=exact)], ""
    if any(low != high for low, high in roots(product)):
        return [], "a sticking reaction may be on the boundary of K"
    return [], ""


def _slide(W: list[list[Fraction]], q: list[Fraction], mu: Fraction) -> tuple[list[Point], str]:
    """Sliding with r_N > 0 and u_T not zero."""
    c, s, h = ([Fraction(k) for k in one] for one in ([1, 0, -1], [0, 2], [1, 0, 1]))

    def along(a: Fraction, b: Fraction, offset: Fraction) -> Polynomial:
        return _add(_scale(h, offset), _scale(c, mu * a), _scale(s, mu * b))

    D = along(W[0][1], W[0][2], W[0][0])
    E = [along(W[k][1], W[k][2], W[k][0]) for k in (1, 2)]
    minus = Fraction(-1)
    if q[0] == 0:
        if len(D) == 3 and not roots(D):  # D = 0 for no direction
            return [], ""
        return [], "q_N = 0, and a sliding reaction may be of any size"
    P = _add(
        _scale(_add(_scale(_times(s, E[0]), minus), _times(c, E[1])), -q[0]),
        _times(D, _add(_scale(s, -q[1]), _scale(c, q[2]))),
    )
    S = _add(
        _scale(_add(_times(c, E[0]), _times(s, E[1])), -q[0]),
        _times(D, _add(_scale(c, q[1]), _scale(s, q[2]))),
    )
    signs = _times(D, S)
    if not signs:
        return [], ""

    def point(t: Fraction | None, only: bool) -> Point | None:
        """At t, or at its infinity, e = (-1, 0), for which the leading coefficients count."""
        size, slip = (_at(D, t), _at(S, t)) if t is not None else (_get(D, 2), _get(S, 4))
        if not (-q[0] * size > 0 and q[0] * slip > 0):
            return None
        norm = 1 + t * t if t is not None else Fraction(1)
        e = ((1 - t * t) / norm, 2 * t / norm) if t is not None else (minus, Fraction(0))
        n = -q[0] * norm / size
        sigma = -slip / (size * norm)
        u = (Fraction(0), -sigma * e[0], -sigma * e[1])
        return Point("slide", u, (n, n * mu * e[0], n * mu * e[1]), only, only)

    if not P:  # every direction with the right signs is a solution
        tried = [point(t, False) for t in [*between(signs), None]]
        some = next((one for one in tried if one is not None), None)
        return ([some] if some is not None else []), ""
    found = []
    if _get(P, 4) == 0 and (one := point(None, True)) is not None:
        found.append(one)
    # roots of D are not solutions (n is infinite); at those of S the contact sticks
    P = _quotient(P, _gcd(P, _derivative(P)))
    P = _quotient(P, _gcd(P, signs))
    for low, high in roots(P, apart_from=signs):
        if (one := point((low + high) / 2, True)) is not None:
            found.append(one)
    return found, ""


def _robust(
    W: list[list[Fraction]], q: list[Fraction], mu: Fraction, change: float, points: list[Point]
) -> bool:
    """Whether all solutions stay near these if q changes by `change` in each component.

    Directions of sliding are divided into cells. If no solution slides in a cell, a sign or the
    part of u_T across must be wrong there, by more than its change in the cell, by rounding and by
    the change of q.
    """
    speed = max(map(abs, q))
    if not speed or not isfinite(change):
        return False
    # in units of its own, the problem has no numbers that are too large for doubles
    size_of_W = max(abs(value) for row in W for value in row)
    A = np.array([[float(value / size_of_W) for value in row] for row in W])
    b, m = np.array([float(value / speed) for value in q]), float(mu)
    change = float(Fraction(change) / speed)
    if abs(b[0]) <= 2 * change or np.linalg.cond(A) > REGULAR:
        return False
    inverse = np.linalg.inv(A)
    r = -inverse @ b
    room = m * r[0] - np.hypot(r[1], r[2])  # room of the sticking reaction inside its cone
    off = (abs(inverse).sum() * change + EPS * REGULAR * abs(r).sum()) * (1 + m)
    if abs(room) <= 2 * off and r[0] >= -off:
        return False
    angle = (np.arange(CELLS) + 0.5) * (2 * np.pi / CELLS)
    e = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-e[1], e[0]])
    D = A[0, 0] + m * A[0, 1:] @ e
    E = A[1:, :1] + m * A[1:, 1:] @ e
    P = -b[0] * (across * E).sum(axis=0) + D * (b[1:] @ across)
    S = -b[0] * (e * E).sum(axis=0) + D * (b[1:] @ e)
    # each is a sum of products of at most two of e, W and q; bounds for half a cell and rounding
    size = abs(A).sum() * (1 + m)
    half = np.pi / CELLS + 100 * EPS
    wide = size * (4 * abs(b).sum() * half + 4 * change)
    up = np.sign(b[0])
    wrong = (up * D - size * half > 0) | (up * S + wide < 0) | (abs(P) - wide > 0)
    for point in points:
        most = max(map(abs, point.u[1:])) or Fraction(1)
        way = -np.array([float(value / most) for value in point.u[1:]])
        if point.state == "slide" and way.any():
            wrong |= way / np.linalg.norm(way) @ e > NEAR
    return bool(wrong.all())


# ---- polynomials


def _trim(p: Polynomial) -> Polynomial:
    while p and not p[-1]:
        p = p[:-1]
    return p


def _get(p: Polynomial, k: int) -> Fraction:
    return p[k] if k < len(p) else Fraction(0)


def _add(*terms: Polynomial) -> Polynomial:
    size = max(map(len, terms), default=0)
    return _trim([sum((_get(p, k) for p in terms), Fraction(0)) for k in range(size)])


def _scale(p: Polynomial, by: Fraction | int) -> Polynomial:
    return _trim([value * by for value in p])


def _times(a: Polynomial, b: Polynomial) -> Polynomial:
    result = [Fraction(0)] * max(0, len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            result[i + j] += x * y
    return _trim(result)


def _at(p: Polynomial, t: Fraction) -> Fraction:
    value = Fraction(0)
    for coefficient in reversed(p):
        value = value * t + coefficient
    return value


def _derivative(p: Polynomial) -> Polynomial:
    return [k * value for k, value in enumerate(p)][1:]


def _division(a: Polynomial, b: Polynomial) -> tuple[Polynomial, Polynomial]:
    quotient = [Fraction(0)] * max(0, len(a) - len(b) + 1)
    while len(a) >= len(b):
        by, shift = a[-1] / b[-1], len(a) - len(b)
        quotient[shift] = by
        a = _add(a, [Fraction(0)] * shift + _scale(b, -by))
    return quotient, a


def _quotient(a: Polynomial, b: Polynomial) -> Polynomial:
    return _division(a, b)[0]


def _gcd(a: Polynomial, b: Polynomial) -> Polynomial:
    while b:
        a, b = b, _division(a, b)[1]
    return _scale(a, 1 / a[-1])


def _sturm(p: Polynomial) -> list[list[int]]:
    """Sturm's sequence, each without denominators and common factors."""
    chain = [p, _derivative(p)]
    while chain[-1]:
        chain.append(_scale(_division(chain[-2], chain[-1])[1], -1))
    whole = [integers(one) for one in chain[:-1]]
    return [[value // gcd(*one) for value in one] for one in whole]


def _changes(chain: list[list[int]], t: Fraction) -> int:
    signs = [value > 0 for value in (_signed(p, t) for p in chain) if value]
    return sum(a != b for a, b in pairwise(signs))


def _signed(p: list[int], t: Fraction) -> int:
    """The value at t, times a positive number."""
    value, power = 0, 1
    for coefficient in reversed(p):
        value = value * t.numerator + coefficient * power
        power *= t.denominator
    return value


def roots(p: Polynomial, apart_from: Polynomial | None = None) -> list[tuple[Fraction, Fraction]]:
    """Intervals (low, high) of one real root each, to 80 bits; low = high if it is rational.

    Args:
        p: a polynomial, not zero.
        apart_from: a polynomial without a common root; it has no root in the intervals either.
    """
    if len(p) < 2:
        return []
    p = _quotient(p, _gcd(p, _derivative(p)))
    chain = _sturm(p)
    other = None
    if apart_from and len(apart_from) > 1:
        other = _sturm(_quotient(apart_from, _gcd(apart_from, _derivative(apart_from))))
    # Cauchy's bound, as a power of two, so that all middles have few digits
    bound = Fraction(2 ** ceil(1 + max(abs(value / p[-1]) for value in p)).bit_length())
    found = []
    todo = [(-bound, bound)]
    while todo:
        low, high = todo.pop()
        count = _changes(chain, low) - _changes(chain, high)
        if count == 0:
            continue
        clear = other is None or _changes(other, low) == _changes(other, high)
        width = max(abs(low), abs(high))
        if count == 1 and clear and high - low <= DIGITS * width:
            found.append((low, high))
            continue
        middle = (low + high) / 2
        if _signed(chain[0], middle) == 0:
            rest = _quotient(p, [-middle, Fraction(1)])
            return sorted([(middle, middle), *roots(rest, apart_from)])
        todo += [(low, middle), (middle, high)]
    return sorted(found)


def between(p: Polynomial) -> list[Fraction]:
    """A number between every two roots, and one beyond each end. p is not zero."""
    ends = roots(p)
    if not ends:
        return [Fraction(0)]
    middle = [(a[1] + b[0]) / 2 for a, b in pairwise(ends)]
    return [ends[0][0] - 1, *middle, ends[-1][1] + 1]
