"""Hard problems of one contact, found in the collection, and some that are not symmetric."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from fclib import _core

FILE = Path(__file__).with_name("local_problems.json")
CHUTE = Path(__file__).with_name("chute_local_problems.json")


@functools.cache
def records(path: Path = FILE) -> list[dict[str, Any]]:
    """The problems as they were found: spacedim, W, q, mu, mu_r, origin."""
    found: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["problems"]
    return found


@dataclass(frozen=True, kw_only=True)
class LocalProblems:
    """One contact each: its block of W, and q at the solution of the problem it comes from.

    The hardest for the one-contact solvers of nonsmooth Gauss-Seidel in each family of the
    collection, and in bodies that spin fast, whose gyroscopic terms make W asymmetric.
    `python -m workshop.sets local` finds them; `local_problems.json` holds them, to the last bit.

    Beside Chute_local_problems of V. Acary, M. Bremond and O. Huber, On solving contact problems
    with Coulomb friction: formulations and numerical comparisons, 2018, which come from one family.
    """

    title: ClassVar[str] = "One contact"
    description: ClassVar[str] = "The problem of one contact, the others' reactions being known."
    application: ClassVar[str] = "local solvers"
    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb, and Coulomb with rolling; in the plane and in space"
    collection: ClassVar[str] = "local"
    problems: ClassVar[int] = len(records())
    file: ClassVar[Path] = FILE

    def problem(self, number: int, seed: int = 0) -> Any:
        """The problem of that number in the file; there is nothing that the seed could draw."""
        record = records(self.file)[number]
        values: dict[str, Any] = {
            "spacedim": record["spacedim"],
            "W": np.array(record["W"]),
            "q": np.array(record["q"]),
            "mu": np.array([record["mu"]]),
            "info": _core.ProblemInfo(title=record["origin"]),
        }
        if record["mu_r"] is None:
            return _core.LocalProblem(**values)
        return _core.LocalRollingProblem(**values, mu_r=np.array([record["mu_r"]]))


@dataclass(frozen=True, kw_only=True)
class ChuteLocalProblems(LocalProblems):
    """One contact each, all of one chute: the contacts of rr9118/Chute1000 that carry a reaction.

    As many as in Chute_local_problems of V. Acary, M. Bremond and O. Huber, 2018, mu = 1, those
    with a conditioning of W up to 4.66. They are spread by it, not chosen as hard.
    """

    title: ClassVar[str] = "One contact of a chute"
    description: ClassVar[str] = "One contact of flowing polyhedra, the others' reactions known."
    authors: ClassVar[str] = "V. Acary, M. Bremond, O. Huber"
    friction: ClassVar[str] = "Coulomb"
    collection: ClassVar[str] = "rr9118"
    problems: ClassVar[int] = len(records(CHUTE))
    file: ClassVar[Path] = CHUTE
