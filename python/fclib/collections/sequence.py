"""Consecutive problems of a family, with the impulses of the step before as a guess.

    for step in fclib.sequence("rt444/KaplasTower"):
        result = fclib.solve(step.problem, guess=step.guess())          of the stored solutions
        result = fclib.solve(step.problem, guess=step.guess(result))    of one's own

Contacts are linked by their names (`fclib.Contacts.identity`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fclib import _core, _sequence
from fclib._solve import Given, Problem
from fclib.collections.catalog import files_of
from fclib.collections.library import Collection
from fclib.collections.references import guess_of


@dataclass(frozen=True)
class Step:
    """A problem of a sequence, and the one before it."""

    id: str  # SET/FAMILY/NUMBER, or the path of a step
    step: int  # of the simulation
    problem: Problem
    solution: _core.Solution | None  # the stored one
    before: Step | None  # None if the step before is missing; that step has no `before` itself

    def guess(self, solution: Given | None = None) -> _core.Solution | None:
        """A guess from a solution (or a result, or reactions) of the step before.

        By default it is from the stored one.

        It is None at the first problem, after a step without a problem, and if the contacts of one
        of the two have no names.

        Raises:
            ValueError: the solution is not of the size of the step before.
        """
        if self.before is None:
            return None
        known = solution if solution is not None else self.before.solution
        return None if known is None else guess_of(self.before.problem, known, self.problem)


def sequence(
    name: str, folder: str | Path | None = None, form: str | None = None
) -> Iterator[Step]:
    """The problems of a family in the order of their steps, as they are read.

    Args:
        name: a family, or SET/FAMILY, which is built if it is missing; or the file of a sequence.
        folder: as in `collection`.
        form: "global" or "local"; by default the global one of problems that have both.

    Raises:
        KeyError: there is no such family.
        ValueError: the name is of a set of several families.
    """
    if Path(name).is_file():
        return _recorded(_sequence.Sequence(name))
    problems = Collection(name, folder)
    if len(problems.folders) != 1:
        raise ValueError(
            f"a sequence is of one family, and {name} has several: {', '.join(problems.folders)}"
        )
    return _steps(problems, form)


def write_sequence(path: Path, folder: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Write problems of a built folder into one file, in the order of their steps.

    The file is written in that folder. It takes its place as a whole.

    Args:
        path: the file, on the disk of the folder.
        folder: what was built.
        rows: those of its catalogue, each of one form.

    Raises:
        fclib.FileError: a file cannot be read or written.
    """
    beside = folder / path.name
    beside.unlink(missing_ok=True)  # of a writer that was killed
    with _core.SequenceWriter(beside) as writer:
        for row in sorted(rows, key=lambda row: int(row["step"])):
            (name,) = (name for name, _ in files_of(dict(row)))
            file = folder / name
            solution = _core.read_solution(file)
            told = _core.read_attributes(file, "solution") if solution is not None else {}
            writer.append(_core.read(file), solution, _core.read_guesses(file), attributes=told)
    beside.replace(path)


def _recorded(steps: _sequence.Sequence) -> Iterator[Step]:
    last: dict[int, Step] = {}  # of each world
    for k in range(len(steps)):
        world, number = steps.worlds[k], steps.numbers[k]
        before = last.get(world)
        step = Step(steps.path(k), number, steps[k], steps.solution(k), before)
        yield step
        last[world] = Step(step.id, number, step.problem, step.solution, None)


def _steps(problems: Collection, form: str | None) -> Iterator[Step]:
    rows = problems.catalog.select(["id", "step"]).to_pylist()
    before: Step | None = None
    for row in sorted(rows, key=lambda row: int(row["step"])):
        path = problems.path(row["id"], form)
        follows = before is not None and before.step + 1 == row["step"]
        step = Step(
            row["id"],
            row["step"],
            _core.read(path),
            _core.read_solution(path),
            before if follows else None,
        )
        yield step
        # without earlier steps: else all of them would stay in memory
        before = Step(step.id, step.step, step.problem, step.solution, None)
