"""All solutions of a small problem, by the states of its contacts.

In the plane each contact is in one of four states, of which exactly one holds at a solution:

    open      u_N > 0,                r = 0
    slide +   u_N = 0,  u_T > 0,      r = n (1, -mu), n >= 0
    slide -   u_N = 0,  u_T < 0,      r = n (1, mu),  n >= 0
    stick     u_N = 0,  u_T = 0,      r in K

and without friction, in the plane or in space, in one of two states: open, or u_N = 0 and r_N >= 0.
In a state of all contacts the law is linear: the solutions in it are a polyhedron, often a point or
nothing. Klarbring 1990, "Examples of non-uniqueness and non-existence of solutions to quasistatic
contact problems with friction" (Ingenieur-Archiv 60), does this by hand.

The equations are those of the whole problem, with v and lambda: nothing is condensed in doubles and
no R^-1 is needed. They are solved in rational arithmetic (_rational.py). Contacts get their
states one after the other; a contact without a state only satisfies u_N >= 0 and r in K. If a
linear program has no solution, Farkas' lemma gives a reason, which refutes all states that it fits.
Before that, states are refuted in doubles, many at a time, by the inverses of their systems. This
uses bounds of all rounding, and of a change of q and s by ROBUST ||(q, s)||.

A single spatial contact with friction is also decided (_spatial.py).
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np

from fclib import _core, _laws, _solve
from fclib.analysis._data import EPS, Array, check_arguments, columns, norm
from fclib.analysis._rational import CONSTANT, Elimination, Equation, LateError, Table, integers
from fclib.analysis._spatial import one_contact

MOST_STATES = 4**8  # largest number of states of all contacts together
MOST_UNKNOWNS = 200  # largest n + p that is eliminated in rational arithmetic
ROBUST = 1e-6  # in ||(q, s)||: a state that such a change of q and s makes solvable is not refuted
# a solution does not depend on the data's last digits if its error in doubles is below this, and so
# is the part of the reactions' effect that the last digits decide
SOUND = 1e-8
FEW_STATES = 64  # up to so many states, doubles are not tried first
# bounds of numbers that are rounded to doubles
LARGEST, SMALLEST = Fraction(10**300), Fraction(1, 10**290)
BATCH = 4096  # number of states whose systems are inverted at a time

EXISTS = "exists"
NONE = "none"
UNDECIDED = "undecided"
LATE = "the time was over"

Numbers = tuple[Fraction, ...]


@dataclass(frozen=True)
class SolutionSet:
    """The solutions in one state of the contacts: a point, or a polyhedron with one of its points.

    Attributes:
        states: (nc,) "open", "stick", "slide +" (u_T > 0), "slide -" (u_T < 0) or, without
            friction, "closed".
        solution: one of the solutions, in doubles.
        error: its merit in doubles, without the unscaled natural map: it is the same in all units.
        undone: how much of the effect of the reactions on a contact the last digits of the data
            can undo. Joints that leave a contact no freedom also leave rounding, by which a
            reaction of any size seems to move it: then it is about 1.
        velocity: whether all solutions have this u.
        reaction: whether all solutions have this r.
        isolated: whether it is a point, with no other solution near it.
        u, r: (m,) the solution, exact; to 24 digits if a spatial contact slides.
    """

    states: tuple[str, ...]
    solution: _core.Solution = field(repr=False, compare=False)
    error: float
    undone: float
    velocity: bool
    reaction: bool
    isolated: bool
    u: Numbers = field(repr=False)
    r: Numbers = field(repr=False)


@dataclass(frozen=True)
class Enumeration:
    """The result of trying the states of all contacts, in exact arithmetic, on the data as given.

    Attributes:
        solutions: the sets of solutions, each in one state.
        missing: the reason why these may not be all; empty if each state was decided.
        robust: whether the refuted states stay refuted if each component of q and s changes by 1e-6
            of ||(q, s)||.
        contacts, states: number of contacts, and number of states of all of them together.
        speed: [m/s] ||(q, s)||; for a global problem, of its local form.
    """

    solutions: tuple[SolutionSet, ...]
    missing: str
    robust: bool = False
    contacts: int = 0
    states: int = 0
    speed: float = 0.0

    @property
    def complete(self) -> bool:
        """Whether each state was decided."""
        return not self.missing

    @property
    def reason(self) -> str:
        """The result in words, or the reason why there is none."""
        if not self.states:
            return f"not decided by enumeration of contact states: {self.missing}"
        plural = "s" * (self.contacts != 1)
        words = [f"enumeration of contact states, {self.states} of {self.contacts} contact{plural}"]
        isolated = len(self.isolated)
        sets = sum(not found.isolated for found in self.sound)
        beyond = len(self.solutions) - len(self.sound)
        if self.sound:
            words.append(f": {isolated} isolated solution{'s' * (isolated != 1)}")
            words.append(f" and {sets} set{'s' * (sets != 1)} of others" if sets else "")
            error = max(found.error for found in self.sound)
            words.append(f", exact, in doubles of an error up to {error:.1e}")
        elif beyond:
            words.append(": no solution in doubles")
        else:
            words.append(": no solution" + ("" if self.complete else " yet"))
        if beyond:
            words.append(f"; {beyond} in exact arithmetic that rest on the last digits of the data")
        if not self.complete:
            words.append(f"; not all states were decided: {self.missing}")
        elif not self.robust:
            words.append(f"; there may be others if q changes by {ROBUST:.0e} ||q||")
        elif not self.solutions:
            words.append(f", also if q changes by {ROBUST:.0e} ||q||")
        return "".join(words)

    @property
    def verdict(self) -> str:
        """One of "exists", "none" and "undecided".

        A solution that depends on the last digits of the data is not enough.
        """
        if self.sound:
            return EXISTS
        return NONE if self.complete and self.robust and not self.solutions else UNDECIDED

    @property
    def sound(self) -> tuple[SolutionSet, ...]:
        """The sets whose solution is also one in doubles, by SOUND."""
        return tuple(found for found in self.solutions if max(found.error, found.undone) <= SOUND)

    @property
    def isolated(self) -> tuple[SolutionSet, ...]:
        """The isolated solutions among these; only one of those that differ by rounding."""
        kept: list[SolutionSet] = []
        for found in self.sound:
            if found.isolated and all(
                _apart(found.u, one.u, self.speed) or _apart(found.r, one.r) for one in kept
            ):
                kept.append(found)
        return tuple(kept)

    @property
    def velocity_unique(self) -> bool | None:
        """Whether all solutions have one u; None if not known, or if there is none."""
        return self._unique([found.u for found in self.sound], "velocity", self.speed)

    @property
    def reaction_unique(self) -> bool | None:
        """Whether all solutions have one r; None if not known, or if there is none."""
        return self._unique([found.r for found in self.sound], "reaction", 0.0)

    def _unique(self, points: list[Numbers], part: str, size: float) -> bool | None:
        if any(_apart(point, points[0], size) for point in points):
            return False
        if not all(getattr(found, part) for found in self.sound):
            return False
        # a solution that depends on the last digits leaves it open
        known = self.complete and self.robust and self.sound == self.solutions
        alike = known and len(set(points)) == 1
        return True if alike else None


def _error(problem: _solve.Problem, solution: _core.Solution) -> float:
    merit = _core.merit(problem, solution)
    return max(merit.scaled_natural, merit.dynamics, merit.bilateral, merit.kinematics)


def _undone(whole: _Whole, u: Numbers, r: Numbers) -> float:
    """See SolutionSet."""
    if not whole.plain:
        return 0.0
    local: Any = whole.problem
    bodies = isinstance(local, _laws.Global)
    if bodies:
        local = local.condense()
    m, p, d = local.m, local.p, local.spacedim
    reaction = np.array([float(max(-LARGEST, min(LARGEST, value))) for value in r])
    W, V, R = columns(local.W).toarray(), np.zeros((m, 0)), np.zeros((0, 0))
    if p:
        V, R = columns(local.V).toarray(), columns(local.R).toarray()
    inverse = np.linalg.pinv(R)

    def through_joints(right: Array, parts: Array) -> Array:
        """The terms of V R^-1 right, with those of solving for the multipliers."""
        multipliers = abs(inverse @ right)
        return abs(V) @ (multipliers + abs(inverse) @ (abs(R) @ multipliers + parts))

    # the terms of what reactions do, and what is left of them with the joints
    terms = abs(W) @ abs(reaction) + through_joints(V.T @ reaction, abs(V).T @ abs(reaction))
    effects = np.zeros(m)
    shares = [0.0]
    for own, row, constant, _ in whole.rows():
        moved = sum((abs(value * r[k]) for k, value in row.items()), Fraction())
        effects[own] = float(min(LARGEST, max(moved, abs(constant))))
        # a contact that only rounding can move must open by more than rounding
        if own % d or r[own] or bodies or not p:
            continue
        size = abs(W[own, own]) + through_joints(V[own], abs(V[own]))[own]
        if EPS * size > SOUND * abs(float(row.get(own, 0))):
            given = abs(local.q[own]) + through_joints(local.s, abs(local.s))[own]
            shares.append(EPS * float(terms[own] + given) / max(float(u[own]), float(SMALLEST)))
    by_contact = [part.reshape(-1, d).max(axis=1) for part in (terms, effects)]
    pressed = reaction.reshape(-1, d).any(axis=1) & (by_contact[0] > 0)
    with np.errstate(divide="ignore", over="ignore"):
        shares += list(EPS * by_contact[0][pressed] / by_contact[1][pressed])
    return float(max(shares))


def _apart(a: Numbers, b: Numbers, size: float = 0.0) -> bool:
    """Whether they differ by more than the data's last digits, relative to `size` or to a."""
    difference = max((abs(x - y) for x, y in zip(a, b, strict=True)), default=Fraction())
    return difference > Fraction(SOUND) * max([Fraction(size), *map(abs, a)])


@dataclass(frozen=True)
class _State:
    """A contact's state: its name, the columns that may be nonzero, and the positive one."""

    name: str
    columns: tuple[int, ...]
    strict: int | None


class _Whole:
    """The equations of the whole problem, with v and lambda eliminated exactly.

    Attributes:
        elimination: the rest of the equations, and how the other unknowns follow.
        smooth: the numbers of u_T without friction, which are eliminated too.
        changes: the numbers of the changes of the joints' right sides.
        plain: whether the rest is u = W r + q.
        drifts: whether some lambda moves such u_T and nothing else, so that u is never unique.
    """

    def __init__(self, problem: _solve.Problem, end: float) -> None:
        self.problem = problem
        d = problem.spacedim
        self.mu = [Fraction(float(value)) for value in problem.mu]
        equations, hidden, inner = _equations(problem)
        first = 2 * problem.m + len(hidden)
        self.changes = range(first, first + problem.p)
        self.elimination = Elimination(equations, end=end)
        left = self.elimination.take_out(hidden, inner)
        # redundant joints leave 0 = 0, or an equation for r, or a contradiction
        for k in inner:
            if all(j in self.changes for j in equations[k]):
                equations[k] = {}
        plain = not any(equations[k] for k in inner)
        smooth = [d * a + k for a in range(problem.nc) if not self.mu[a] > 0 for k in range(1, d)]
        self.elimination.take_out(smooth)
        # the rest of lambda, if joints are redundant
        loose = self.elimination.take_out(left)
        self.plain = plain and len(loose) == len(left)
        self.smooth = set(smooth)
        self.drifts = any(
            value and k in self.smooth
            for free in loose
            for k, value in self.elimination.complete({free: Fraction(1)}, 0).items()
        )

    def rows(self) -> list[tuple[int, dict[int, Fraction], Fraction, float]]:
        """For a plain system, each remaining u_k = row . r + constant, in order.

        Each entry has k, the row (by components of r), the constant, and the largest change of u_k
        if q and the right sides of the joints change by 1.
        """
        m = self.problem.m
        result = []
        for equation in self.elimination.equations:
            if not equation:
                continue
            (own,) = (k for k in equation if 0 <= k < m)
            by = equation[own]
            row = {k - m: -value / by for k, value in equation.items() if m <= k < 2 * m}
            moved = 1 + sum(abs(float(equation.get(k, 0) / by)) for k in self.changes)
            result.append((own, row, equation.get(CONSTANT, Fraction()) / by, moved))
        return sorted(result, key=lambda one: one[0])

    def solution(self, whole: dict[int, Fraction]) -> _core.Solution:
        """The values of all unknowns, in doubles."""
        problem, m = self.problem, self.problem.m
        bodies = isinstance(problem, _laws.Global)
        n = problem.n if bodies else 0
        exact = [whole.get(k, Fraction()) for k in range(2 * m + n + problem.p)]
        values = np.array([float(max(-LARGEST, min(LARGEST, value))) for value in exact])
        u, r, v, bilateral = np.split(values, [m, 2 * m, 2 * m + n])
        return _core.Solution(r=r, u=u, v=v if bodies else None, l=bilateral if problem.p else None)


def _double(exact: Fraction) -> float:
    """Rounded to the nearest double, by at most EPS relative; nan if there is no such double."""
    return float(exact) if not exact or SMALLEST < abs(exact) < LARGEST else float("nan")


class _System:
    """The equations of all contacts, A x = b with x >= 0, and the meaning of the columns.

    The columns of a contact with friction are u_N, u_T > 0, u_T < 0, and r along both edges of K;
    those of a contact without friction are u_N and r_N.
    """

    def __init__(self, whole: _Whole) -> None:
        self.whole, self.problem = whole, whole.problem
        d, m, nc = self.problem.spacedim, self.problem.m, self.problem.nc
        self.elimination = whole.elimination
        rows = [equation for equation in whole.elimination.equations if equation]
        self.parts: list[list[tuple[int, Fraction]]] = []
        self.states: list[list[_State]] = []
        one = Fraction(1)
        for a in range(nc):
            first, N = len(self.parts), d * a
            if (mu := whole.mu[a]) > 0:
                self.parts += [[(N, one)], [(N + 1, one)], [(N + 1, -one)]]
                across, along = Fraction(mu.numerator), Fraction(mu.denominator)
                self.parts += [[(m + N, along), (m + N + 1, sign * across)] for sign in (one, -one)]
                open_, right, left_, up, down = range(first, first + 5)
                self.states.append(
                    [
                        _State("open", (open_, right, left_), open_),
                        _State("slide +", (right, down), right),
                        _State("slide -", (left_, up), left_),
                        _State("stick", (up, down), None),
                    ]
                )
            else:
                self.parts += [[(N, one)], [(m + N, one)]]
                self.states.append(
                    [_State("open", (first,), first), _State("closed", (first + 1,), None)]
                )
        # the columns of u, with their contact and component
        self.speeds = {
            k: part for k, ((of, _), *_rest) in enumerate(self.parts) if (part := of) < m
        }
        table = []
        for row in rows:
            entries = [
                sum((row[k] * factor for k, factor in part if k in row), Fraction())
                for part in self.parts
            ]
            moved = [row.get(k, Fraction()) for k in whole.changes]
            table.append([*entries, *moved, row.get(CONSTANT, Fraction())])
        # times the determinant, all entries are minors of the whole system, which are integers
        self.denominator = int(self.elimination.determinant)
        entire = [[int(value * self.denominator) for value in row] for row in table]
        values = np.array(entire, dtype=object).reshape(len(rows), self.count + 1)
        self.A, self.b = values[:, :-1], values[:, -1]

    def plain_form(self) -> tuple[Array, Array, Array, tuple[list[Any], list[Any], list[Any]]]:
        """For a plain system, u = G x + q in doubles; x are the unknowns of the columns of r.

        Also the change of q, as in `rows`. And for each contact and state: the x that may be
        positive, the u that are zero, and the signs of the other u, if they have one.
        """
        m = self.problem.m
        reactions = [k for k, part in enumerate(self.parts) if part[0][0] >= m]
        G, q, moved = [], [], []
        for _, row, constant, by in self.whole.rows():
            q.append(_double(constant))
            moved.append(by)
            G.append(
                [
                    _double(sum((row.get(k - m, 0) * f for k, f in part), Fraction()) / part[0][1])
                    for part in (self.parts[c] for c in reactions)
                ]
            )
        used: list[Any] = []
        held: list[Any] = []
        sign: list[Any] = []
        for own_states in self.states:
            across = {c for state in own_states for c in state.columns}
            x = [c for c in reactions if c in across]
            u = sorted({self.speeds[c] for c in across if c in self.speeds})
            used.append(np.array([[c in state.columns for c in x] for state in own_states]))
            free = [
                {self.speeds[c] for c in state.columns if c in self.speeds} for state in own_states
            ]
            held.append(np.array([[k not in own for k in u] for own in free]))
            signs = np.zeros((len(own_states), len(u)))
            for s, state in enumerate(own_states):
                if state.strict is not None:
                    of = self.speeds[state.strict]
                    factor = self.parts[state.strict][0][1]
                    signs[s, u.index(of)] = float(factor)
            sign.append(signs)
        width = len(reactions)
        names = (used, held, sign)
        return np.array(G).reshape(len(q), width), np.array(q), np.array(moved), names

    @property
    def count(self) -> int:
        """The columns, also those of the joints' changes, which are zero."""
        return len(self.parts) + len(self.whole.changes)

    def exact(self, x: dict[int, Fraction]) -> tuple[dict[int, Fraction], Numbers, Numbers]:
        """All unknowns of a point, and its u and r."""
        m = self.problem.m
        values: dict[int, Fraction] = {}
        for column, value in x.items():
            for k, factor in self.parts[column]:
                values[k] = values.get(k, Fraction()) + factor * value
        whole = self.elimination.complete(values)
        parts = [
            tuple(whole.get(k, Fraction()) for k in part) for part in (range(m), range(m, 2 * m))
        ]
        return whole, parts[0], parts[1]


def _equations(problem: _solve.Problem) -> tuple[list[Equation], list[int], set[int]]:
    """The equations of the whole problem; the numbers of v and lambda; and their equations.

    The unknowns are u, r, v, lambda, in this order, and then a change of each joint's right side;
    the change is zero.
    """
    m, p = problem.m, problem.p
    equations: list[Equation] = []

    def add(count: int, constants: Any) -> int:
        first = len(equations)
        for k in range(count):
            value = Fraction(float(constants[k]))
            equations.append({CONSTANT: value} if value else {})
        return first

    def put(row: int, column: int, value: float) -> None:
        equations[row][column] = equations[row].get(column, Fraction()) + Fraction(value)

    def matrix(a: Any, row: int, column: int, sign: int, transposed: bool = False) -> None:
        entries = columns(a).tocoo()
        if transposed:
            entries = entries.T.tocoo()
        for i, j, value in zip(
            entries.row.tolist(), entries.col.tolist(), entries.data.tolist(), strict=True
        ):
            put(row + i, column + j, sign * value)

    if isinstance(problem, _laws.Global):
        n = problem.n
        velocity, bilateral = 2 * m, 2 * m + n
        dynamics = add(n, problem.f)
        matrix(problem.M, dynamics, velocity, 1)
        matrix(problem.H, dynamics, m, -1)
        contact = add(m, problem.w)
        matrix(problem.H, contact, velocity, -1, transposed=True)
        if p:
            assert problem.b is not None
            matrix(problem.G, dynamics, bilateral, -1)
            joints = add(p, problem.b)
            matrix(problem.G, joints, velocity, -1, transposed=True)
        hidden = list(range(velocity, bilateral + p))
    else:
        contact = add(m, problem.q)
        matrix(problem.W, contact, m, -1)
        if p:
            assert problem.s is not None
            matrix(problem.V, contact, 2 * m, -1)
            joints = add(p, problem.s)
            matrix(problem.V, joints, m, -1, transposed=True)
            matrix(problem.R, joints, 2 * m, -1)
        hidden = list(range(2 * m, 2 * m + p))
    for k in range(m):
        put(contact + k, k, 1.0)
    for k in range(p):
        put(joints + k, hidden[-1] + 1 + k, 1.0)
    inner = set(range(len(equations))) - set(range(contact, contact + m))
    for row, equation in enumerate(equations):
        keys = list(equation)
        equations[row] = dict(
            zip(keys, map(Fraction, integers([equation[k] for k in keys])), strict=True)
        )
    return equations, hidden, inner


def qualifies(problem: _solve.Problem) -> str:
    """The reason why contact states cannot decide a problem; empty if they can."""
    if problem.n + problem.p > MOST_UNKNOWNS:
        return f"n + p is above {MOST_UNKNOWNS}"
    rubbing = problem.mu > 0
    if law := _laws.law_of(problem.kind):
        for values in _laws.coefficients(problem).values():
            rubbing = rubbing | (values > 0)
        if rubbing.any():
            return f"the contacts have friction of {law}"
    elif problem.spacedim == 3 and rubbing.any():
        if problem.nc == 1:
            return ""
        return "of spatial contacts with friction only a single one is decided"
    bits = problem.nc + int(rubbing.sum())
    if 2**bits > MOST_STATES:
        return f"there are 2^{bits} states of {problem.nc} contacts"
    return ""


def enumerate_solutions(problem: _solve.Problem, *, time_limit: float = 5.0) -> Enumeration:
    """All solutions, by the states of the contacts, in exact arithmetic.

    Args:
        problem: planar with up to eight contacts, or without friction with up to sixteen; in any
            formulation, with any W, R and M. Others are undecided, and the reason says why.
        time_limit: [s] wall clock, after which the solutions found are returned as incomplete.

    Raises:
        fclib.ProblemError: the data is not valid.
        fclib.OptionError: time_limit is no number, or negative.
    """
    check_arguments(problem, time_limit=time_limit, no_time=True)
    problem.validate()
    if why := qualifies(problem):
        return Enumeration((), why)
    end = time.monotonic() + time_limit
    try:
        whole = _Whole(problem, end)
    except LateError:
        return Enumeration((), LATE)
    if problem.spacedim == 3 and problem.nc == 1 and problem.mu[0] > 0:
        return _single(whole)
    return _Search(whole, end).run()


def _single(whole: _Whole) -> Enumeration:
    """The enumeration for one spatial contact with friction."""
    problem = whole.problem
    if not whole.plain:
        return Enumeration((), "redundant joints act on the contact")
    rows = whole.rows()
    W = [[row.get(k, Fraction()) for k in range(3)] for _, row, _, _ in rows]
    q = [constant for _, _, constant, _ in rows]
    speed = _speed(problem)
    change = ROBUST * speed * max(moved for *_, moved in rows)
    result = one_contact(W, q, whole.mu[0], change)
    alone = not result.missing and all(one.velocity and one.reaction for one in result.points)
    found = []
    for one in result.points:
        values = whole.elimination.complete(dict(enumerate((*one.u, *one.r))))
        solution = whole.solution(values)
        found.append(
            SolutionSet(
                (one.state,),
                solution,
                _error(problem, solution),
                _undone(whole, one.u, one.r),
                one.velocity,
                one.reaction,
                alone,
                one.u,
                one.r,
            )
        )
    return Enumeration(tuple(found), result.missing, result.robust, 1, 3, speed)


class _Search:
    """The search over the states of all contacts."""

    def __init__(self, whole: _Whole, end: float) -> None:
        self.problem, self.end = whole.problem, end
        self.system = _System(whole)
        self.counts = tuple(len(own) for own in self.system.states)
        self.unrefuted = np.ones(self.counts, dtype=bool)
        self.robust = True
        self.speed = _speed(self.problem)
        self.leaves: list[tuple[tuple[int, ...], dict[int, Fraction], bool, bool]] = []
        self.contact_of = np.full(self.system.count, -1)
        for a, own in enumerate(self.system.states):
            for state in own:
                self.contact_of[list(state.columns)] = a

    def run(self) -> Enumeration:
        complete = True
        if self.unrefuted.size > FEW_STATES and self.system.whole.plain:
            _refute(self.system, self.unrefuted, ROBUST * self.speed, self.end)
        table = Table(self.system.A, self.system.b, self.system.denominator)
        try:
            proof = table.feasible(self._allowed((None,) * self.problem.nc))
            if proof is None:
                self._visit(table, (None,) * self.problem.nc)
            else:
                self._weigh(proof)
        except LateError:
            complete = False
        return self._result(complete)

    def _visit(self, table: Table, states: tuple[int | None, ...]) -> None:
        if time.monotonic() > self.end:
            raise LateError
        left = self.unrefuted[tuple(slice(None) if s is None else s for s in states)]
        if not left.any():
            return
        undecided = [a for a, s in enumerate(states) if s is None]
        if not undecided:
            self._leaf(table, states)
            return
        # choose the contact with the fewest states left
        possible = [
            left.any(axis=tuple(k for k in range(len(undecided)) if k != place))
            for place in range(len(undecided))
        ]
        place = min(range(len(undecided)), key=lambda k: int(possible[k].sum()))
        a = undecided[place]
        for s in np.flatnonzero(possible[place]):
            child = (*states[:a], int(s), *states[a + 1 :])
            if not self.unrefuted[tuple(slice(None) if t is None else t for t in child)].any():
                continue
            own = table.copy()
            allowed = self._allowed(child)
            proof = own.feasible(allowed)
            if proof is not None:
                self._weigh(proof)
                self._kill(proof[:-1] <= 0)
                continue
            strict = self.system.states[a][s].strict
            if strict is not None and (zero := own.positive(strict, allowed)) is not None:
                self._kill(zero[:-1] >= 0, strict)
                continue
            self._visit(own, child)

    def _allowed(self, states: tuple[int | None, ...]) -> Any:
        allowed = self.contact_of >= 0
        for a, s in enumerate(states):
            if s is not None:
                allowed[self.contact_of == a] = False
                allowed[list(self.system.states[a][s].columns)] = True
        return allowed

    def _kill(self, fits: Any, strict: int | None = None) -> None:
        """Refute all states whose columns fit; with `strict`, those that need a positive value."""
        refuted: Any = np.ones((), dtype=bool)
        for own in self.system.states:
            held = [all(fits[k] for k in state.columns) for state in own]
            if strict is not None and any(state.strict == strict for state in own):
                held = [h and state.strict == strict for h, state in zip(held, own, strict=True)]
            refuted = np.logical_and.outer(refuted, np.array(held))
        self.unrefuted &= ~refuted

    def _weigh(self, proof: Any) -> None:
        """Whether the proof still holds if each component of q and s changes a little."""
        moved = {k: abs(proof[k]) for k in range(len(self.system.parts), self.system.count)}
        for k, of in self.system.speeds.items():
            moved[-of - 1] = abs(proof[k])
        change = Fraction(ROBUST * self.speed) * sum(moved.values())
        self.robust = self.robust and proof[-1] > change

    def _leaf(self, table: Table, states: Any) -> None:
        """The solutions in a state of all contacts."""
        allowed = self._allowed(states)
        points = [table.point()]
        for a, s in enumerate(states):
            strict = self.system.states[a][s].strict
            if strict is None or any(point.get(strict, 0) > 0 for point in points):
                continue
            if (zero := table.positive(strict, allowed)) is not None:
                self._kill(zero[:-1] >= 0, strict)
                return
            points.append(table.point())
        self.unrefuted[states] = False
        middle: dict[int, Fraction] = {}
        for point in points:
            for k, value in point.items():
                middle[k] = middle.get(k, Fraction()) + value / len(points)
        varies = self._varying(table, allowed)
        self.leaves.append((states, middle, not varies[0], not varies[1]))

    def _varying(self, table: Table, allowed: Any) -> tuple[bool, bool]:
        """Whether u and r vary among the solutions in a state."""
        result = [False, False]
        m = self.problem.m
        functionals: dict[int, Any] = {}
        for k in np.flatnonzero(allowed):
            for of, factor in self.system.parts[k]:
                gain = functionals.setdefault(of, np.zeros(self.system.count, dtype=object))
                gain[k] = 1 if factor > 0 else -1
        # r_T of two edges of equal size is mu times their difference
        for of, gain in functionals.items():
            part = int(of >= m)
            if result[part] or table.free(allowed).size == 0:
                continue
            result[part] = table.rises(gain, allowed) or table.rises(-gain, allowed)
        # without friction u_T follows from the others
        images: dict[int, list[Fraction]] = {}
        if self.system.whole.smooth and not result[0]:
            for column, own in enumerate(self.system.parts):
                moved = self.system.elimination.complete(dict(own), 0)
                for of in self.system.whole.smooth:
                    row = images.setdefault(of, [Fraction()] * self.system.count)
                    row[column] = moved.get(of, Fraction())
        for row in images.values():
            gain = np.array(integers(row), dtype=object)
            result[0] = result[0] or table.rises(gain, allowed) or table.rises(-gain, allowed)
        return result[0] or self.system.whole.drifts, result[1]

    def _result(self, complete: bool) -> Enumeration:
        points = [self.system.exact(x) for _, x, _, _ in self.leaves]
        lines = [leaf for leaf in self.leaves if not (leaf[2] and leaf[3])]
        found = []
        for (states, _, velocity, reaction), (whole, u, r) in zip(self.leaves, points, strict=True):
            solution = self.system.whole.solution(whole)
            alone = velocity and reaction and complete
            alone = alone and not any(self._near(u, r, other) for other, *_ in lines)
            found.append(
                SolutionSet(
                    tuple(self.system.states[a][s].name for a, s in enumerate(states)),
                    solution,
                    _error(self.problem, solution),
                    _undone(self.system.whole, u, r),
                    velocity,
                    reaction,
                    alone,
                    u,
                    r,
                )
            )
        missing = "" if complete else LATE
        robust = complete and self.robust
        size = (self.problem.nc, self.unrefuted.size)
        return Enumeration(tuple(found), missing, robust, *size, self.speed)

    def _near(self, u: Numbers, r: Numbers, states: Any) -> bool:
        """Whether a point is in the closure of a state's set."""
        d = self.problem.spacedim
        for a, s in enumerate(states):
            name = self.system.states[a][s].name
            N, T = d * a, d * a + 1
            if name == "open":
                held = not any(r[N : N + d]) and u[N] >= 0
            elif name == "closed":
                held = u[N] == 0
            else:
                held = u[N] == 0
                if name == "stick":
                    held = held and u[T] == 0
                else:
                    sign = 1 if name == "slide +" else -1
                    held = (
                        held and sign * u[T] >= 0 and r[T] == -sign * self.system.whole.mu[a] * r[N]
                    )
            if not held:
                return False
        return True


def _speed(problem: _solve.Problem) -> float:
    """||(q, s)||; for a global problem, of its local form."""
    if isinstance(problem, _laws.Global):
        problem = problem.condense()
    return norm([*problem.q, *(() if problem.s is None else problem.s)])


def _refute(system: _System, unrefuted: Any, change: float, end: float) -> None:
    """Refutes states in doubles, despite all rounding and any small change of q and s.

    In a state, the system B x = -q of the nonzero unknowns has an approximate inverse Y. If e = ||I
    - Y B||_inf < 1, B is regular and x is within |Y| rho + e / (1 - e) max(|Y| rho) of any x', rho
      the residual of x' (Rump 2010, "Verification methods: rigorous results using
    floating-point arithmetic", section 10).
    """
    G, q, moved, names = system.plain_form()
    if not (np.isfinite(G).all() and np.isfinite(q).all()):
        return
    changes = change * moved
    # bring rows and columns to similar sizes by powers of two: nothing is rounded
    rows, cols = np.ones(len(q)), np.ones(G.shape[1])
    for _ in range(4):
        scaled = abs(G) * rows[:, None] * cols
        rows /= np.sqrt(np.where((top := scaled.max(axis=1, initial=0)) > 0, top, 1.0))
        cols /= np.sqrt(np.where((top := scaled.max(axis=0, initial=0)) > 0, top, 1.0))
    rows, cols = (np.exp2(np.round(np.log2(factor))) for factor in (rows, cols))
    G, q, changes = G * rows[:, None] * cols, q * rows, changes * rows
    G_size, q_size = abs(G), abs(q)
    unit = 2 * EPS * (2 * max(G.shape) + 4)  # rounding of sums of products, with rounded entries

    numbers = np.argwhere(unrefuted)
    used, held, sign = (
        np.concatenate([table[numbers[:, a]] for a, table in enumerate(tables)], axis=1)
        for tables in names
    )
    sizes = used.sum(axis=1)
    for size in np.unique(sizes):
        group = np.flatnonzero(sizes == size)
        for batch in np.array_split(group, -(-group.size // BATCH)):
            if time.monotonic() > end:
                return
            i = np.nonzero(held[batch])[1].reshape(batch.size, size)
            j = np.nonzero(used[batch])[1].reshape(batch.size, size)
            B = G[i[:, :, None], j[:, None, :]]
            try:
                # any Y will do: this one also exists for exactly singular systems
                Y = np.linalg.inv(B + 1e-14 * np.diag(np.linspace(0.5, 1, size)))
            except np.linalg.LinAlgError:
                continue
            with np.errstate(over="ignore", invalid="ignore"):
                B_size, Y_size = abs(B), abs(Y)
                off = abs(np.eye(size) - Y @ B) + unit * (Y_size @ B_size + np.eye(size))
                e = 1.001 * off.sum(axis=2).max(axis=1, initial=0)
                x = -(Y @ q[i][:, :, None])[:, :, 0]
                rho = abs((B @ x[:, :, None])[:, :, 0] + q[i]) + changes[i]
                rho += unit * ((B_size @ abs(x)[:, :, None])[:, :, 0] + q_size[i])
                error = 1.001 * (Y_size @ rho[:, :, None])[:, :, 0]
                error += (1.001 * e / (1 - e) * error.max(axis=1, initial=0))[:, None]
                whole, wide = np.zeros((2, batch.size, G.shape[1]))
                np.put_along_axis(whole, j, x, axis=1)
                np.put_along_axis(wide, j, error, axis=1)
                u = whole @ G.T + q
                wide_u = wide @ G_size.T + unit * (abs(whole) @ G_size.T + q_size) + changes
                beyond = (x + error < 0).any(axis=1)
                beyond |= (sign[batch] * u + 1.001 * wide_u < 0).any(axis=1)
                refuted = beyond & (e < 0.5) & np.isfinite(error).all(axis=1)
            unrefuted[tuple(numbers[batch[refuted]].T)] = False
