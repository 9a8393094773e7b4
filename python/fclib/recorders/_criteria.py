"""How far the steps of a simulator are from Coulomb's law, by the criteria of the field.

The criteria are those of Le Lidec, Jallet, Montaut, Laptev, Schmid and Carpentier, "Contact models
in robotics: a comparative analysis" (IEEE T-RO 2024): Signorini's condition, Coulomb's cone, the
principle of maximal dissipation, and energy. Each is a number without unit. Impulses are relative
to those of the step, and velocities to the largest one that contacts would have without reactions,
so that steps and scenes can be compared. Moments of spin and rolling are judged by their own
limits, and their power relative to that of forces.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from fclib import _core, _laws, _solve
from fclib._origin import origin_of

# meaning of each criterion: 0 for a solution of Coulomb's law
CRITERIA: Final = {
    "error": "the larger of both natural maps, as fclib check prints it",
    "penetration": "how fast contacts close: largest -u_N, over V",
    "tension": "how contacts pull: sum of -r_N if it is negative, over the sum of |r_N|",
    "distance": "what acts at contacts that open: sum of r_N u_N, over V times the sum of |r|",
    "cone": "friction that is too large: sum of ||r_T|| - mu r_N, over the sum of mu |r_N|; of"
    " sliding, spin and rolling the largest",
    "dissipation": "power of friction that is missing: sum of r_T . u_T + mu r_N ||u_T||, over V"
    " times the sum of mu |r_N|; with spin and rolling that of all together",
    "energy": "power that contacts make: r . u if it is positive, over V times the sum of |r|",
}


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """A step of a simulator, and of `auto` on the same problem."""

    engine: str
    file: str
    time: float  # [s]
    contacts: int
    error: float
    penetration: float
    tension: float
    distance: float
    cone: float
    dissipation: float
    energy: float
    auto_status: str
    auto_error: float
    auto_cpu: float  # [s]


@np.errstate(over="ignore", invalid="ignore")
def criteria_of(problem: Any, solution: Any) -> dict[str, float]:
    """The criteria of reactions, by their names. V is the largest velocity without reactions.

    Args:
        problem: local or global, of any law.
        solution: with r (m); the multipliers of joints if there are joints. u follows from them.

    Raises:
        ValueError: the solution has another size.
    """
    r = np.asarray(solution.r, dtype=float)
    if len(r) != problem.m:
        raise ValueError(f"the reaction has {len(r)} numbers, and the problem has {problem.m}")
    merit = _core.merit(problem, solution)
    u = np.reshape(_core.contact_merits(problem, solution)["u"], (-1, problem.spacedim))
    r = np.reshape(r, u.shape)
    # of size 1, so that no square or product overflows; each criterion is relative to ||r||
    r = r / float(np.abs(r).max(initial=0) or 1.0)
    pace = float(np.abs(u).max(initial=0) or 1.0)
    u = u / pace
    normal = r[:, 0]
    free = problem.condense().q if hasattr(problem, "condense") else problem.q
    forces = slice(0, _laws.of_force(problem.kind, problem.spacedim))
    fastest = float(
        np.linalg.norm(np.reshape(free, u.shape)[:, forces], axis=1).max(initial=0) / pace
    )
    power = fastest * np.linalg.norm(r[:, forces], axis=1).sum()
    work = np.sum(r * u, axis=1)
    limit = float(np.asarray(problem.mu) @ np.abs(normal))
    missing = np.zeros(len(r))
    cones = [0.0]
    for group in _laws.groups(problem):
        own = r[:, group.part]
        missing += np.sum(own * u[:, group.part], axis=1)
        missing += np.maximum(normal, 0) * group.resistance(u)
        size = group.coefficient
        if group.uniform:
            moved = np.linalg.norm(own, axis=1)
        else:  # an ellipsoid, stretched to a ball
            axes = np.maximum(group.axes, np.finfo(float).tiny)
            moved = np.linalg.norm(own * (size[:, None] / axes), axis=1)
        excess = np.maximum(moved - size * np.maximum(normal, 0), 0).sum()
        cones.append(share(float(excess), float(size @ np.abs(normal))))
    return {
        "error": merit.error,
        "penetration": share(float(np.max(-u[:, 0], initial=0)), fastest),
        "tension": share(np.maximum(-normal, 0).sum(), np.abs(normal).sum()),
        "distance": share(float(np.maximum(normal, 0) @ np.maximum(u[:, 0], 0)), power),
        "cone": max(cones),
        "dissipation": share(np.maximum(missing, 0).sum(), fastest * limit),
        "energy": share(max(work.sum(), 0), power),
    }


def share(part: float, whole: float) -> float:
    """Part / whole; 0 if both are 0. If one is not a number, as after an overflow: infinity."""
    if np.isnan(part) or np.isnan(whole):
        return float("inf")
    return float(part / whole) if whole > 0 else float(part > 0)


def judge(paths: Sequence[Path], *, tolerance: float = 1e-8) -> Iterator[Judgement]:
    """Judge recorded steps, in the order of the files: the first guess of each, and `auto`.

    Args:
        paths: files of `fclib record`, or any with a problem and the guess of a simulator.
        tolerance: what `auto` is asked for.

    Raises:
        fclib.FileError: a file cannot be read, or has no guess.
    """
    for path in paths:
        problem: Any = _core.read(path)
        guesses = _core.read_guesses(path)
        if not guesses:
            raise _core.FileError(f"{path}: has no guess, which would be the simulator's reaction")
        try:
            found = criteria_of(problem, guesses[0])
        except (_core.Error, ValueError) as error:
            raise _core.FileError(f"{path}: its first guess: {error}") from None
        origin = origin_of(problem.info)
        result = _solve.solve(problem, tol=tolerance)
        reached = _core.merit(problem, result.solution).error
        own = origin.get("engine", path.parent.name)
        if origin.get("generator") == "fclib.simulate":
            own = "FCLIB"
        yield Judgement(
            engine=str(own.get("name") if isinstance(own, dict) else own),
            file=str(path),
            time=time_of(origin, path),
            contacts=problem.nc,
            **found,
            auto_status=str(result.status),
            auto_error=reached,
            auto_cpu=result.cpu_s,
        )


def time_of(origin: Mapping[str, Any], path: Path) -> float:
    """The time of a step [s]; if the engine tells none, the number of its file."""
    told, h = (origin.get(name) for name in ("time", "time_step"))
    number = re.search(r"\d+$", path.stem)
    if not told and isinstance(h, (int, float)) and number:
        return float(h) * int(number[0])
    return float(told) if isinstance(told, (int, float)) else 0.0


def summary(steps: Sequence[Judgement]) -> dict[str, Any]:
    """The whole run in one row: medians and the worst of each criterion."""
    row: dict[str, Any] = {"engine": steps[0].engine, "steps": len(steps)}
    row["contacts"] = float(np.mean([step.contacts for step in steps]))
    for name in CRITERIA:
        values = [getattr(step, name) for step in steps]
        row[name], row[f"{name}, worst"] = float(np.median(values)), float(np.max(values))
    row["auto solves"] = sum(step.auto_status == "converged" for step in steps)
    row["auto, error"] = float(np.max([step.auto_error for step in steps]))
    row["auto, CPU [s]"] = float(np.median([step.auto_cpu for step in steps]))
    return row
