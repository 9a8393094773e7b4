"""Which stages and thresholds of `auto` pay: each change of its table, on problems of two halves.

    python -m workshop.tuning.choose_auto FILE... [--problems 12] [--seconds 10] [--tol 1e-8]
        [--half choose] [--only NAME...] [--rules] [--results auto-stages]
    python -m workshop.tuning.choose_auto FILE... --needed [--remove] [--keep RUNS] [--chain FILE]
        [--seconds 20] [--results auto-rows]
    python -m workshop.tuning.choose_auto FILE... --against OTHER_PYTHON [--limits 1 10 60]
        [--tols 1e-4 1e-8 1e-12] [--jobs 1] [--other NAME] [--results auto-judged]

A problem belongs to the choosing half or to the judging one by its family (for a file, its folder):
what is chosen is chosen on CHOOSING; recorded problems, other families and new seeds of generated
ones only judge. At most --problems of a family are taken, evenly spread.

A change is the table without one of its stages, or with another rule (CHANGES). It is run on the
problems that came to the stage, each beside the table as it is, in one process; the others take the
same path. A row says how many problems came to the stage and how many it solved; how many the chain
solves without the change and with it; the shifted geometric mean of the ratios of CPU times, over
the problems that both solve; and the sum of CPU times with the change over that without it, with
the 95 % interval of 2,000 bootstrap samples of the problems. The limit is one of CPU time; a
failure counts as twice the limit. Where both take the same path, they cost the same. A stage pays
if problems are lost without it, or if its interval is above 1.

--rules changes each number of the table instead, and each default that it uses: half and double, a
tenth and ten times if it is small or large. The problems are those that the table solves. A
second table, NAME-notable, has the rows in which a problem is lost, or whose interval does not have
1 in it. The rules of "held bodies" are tried by constants.py.

--needed says of each row of the table which problem needs it: one that is not solved without it
within the limit, or else the one that loses most time, with the sums of CPU times over all on which
the row does anything. The problems are those of the judging half at each tolerance, one of each
family without memory for factors, steps of simulations from the reactions of the step before, and
small planted ones. With --remove, the row whose loss costs least is taken out, and so on, until
each row is needed. Runs are kept in the file RUNS, so that the command goes on where it ended;
delete it after a change of the code.

--against makes one table on the judging half: this fclib beside another one's (the Python that
imports it), solved at 1e-4, 1e-8 and 1e-12 within each limit, sum and shifted geometric mean of CPU
times, conversions included; a failure counts as the longest limit. What a limit does not solve is
solved again with the next one, but for the first, which shares the run of the second. A second
table, NAME-worst, has what was lost, and the ten largest ratios, with the errors of both.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import threading
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import fclib
from fclib import collections, scenes
from workshop.tables import _results

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests"))
import planted_judge
from ball_judge import judge

CHOOSING = {"BoxesStack", "Capsules", "Bridge", "Chute", "LowWall", "Packing", "Wall"}
HALVES = ("choose", "judge")
TOLERANCE = 1e-8
CHARGE = 2.0  # limits, for a failure
SHIFT = 1e-3  # [s] of the geometric mean
SHORT = 0.05  # [s] under which the least of three runs counts
SAMPLES = 2000
LOOSE = 1e-4  # tolerance without memory for factors
NO_MEMORY = 1e-9  # [GB]
PLANTED = range(100_000, 102_000)  # numbers of tests/planted_judge.py
PLANTED_WORK = 1000  # iterations that a planted problem needs to be kept
WARM = ("rt444/Chain", "rt444/KaplasTower")
LEEWAY = 1.03  # of a ratio of CPU times: noise
STAGES_TITLE = "What the stages of auto are worth"

WORKER = """
import json, sys, time
import fclib, numpy
for line in sys.stdin:
    job = json.loads(line)
    options = job.get("options", {}) | ({"chain": job["chain"]} if job.get("chain") else {})
    if "guess" in options:
        options["guess"] = numpy.load(options["guess"])
    problem = fclib.read(job["file"])
    end = time.process_time() + job["limit"]
    try:
        result = fclib.solve(problem, "auto", job["tol"], time_limit=20 * job["limit"],
                             callback=lambda *_: time.process_time() < end, **options)
        stages = [[s.name, s.calls, s.solved, s.iterations, s.factorisations]
                  for s in result.stages]
        answer = [result.status, result.cpu_s, result.setup_s, result.error, stages]
    except fclib.Error as error:
        answer = [type(error).__name__, 0.0, 0.0, None, []]
    print(json.dumps(answer), flush=True)
"""


@dataclass(frozen=True)
class Run:
    """A solve by `auto`."""

    status: str
    cpu_s: float
    setup_s: float
    error: float | None
    stages: dict[str, tuple[int, int, int, int]]  # calls, solved, iterations, factorisations

    @property
    def solved(self) -> bool:
        """Whether it has an answer: a solution, or the proof that there is none."""
        return self.status in ("converged", "infeasible")

    def within(self, limit: float) -> bool:
        """Whether it has one by then, conversions included."""
        return self.solved and self.whole <= limit

    @property
    def whole(self) -> float:
        """CPU time with conversions [s]."""
        return self.cpu_s + self.setup_s

    def worked(self, row: str) -> bool:
        """Whether the stage of this row of `Runs` did anything."""
        return any(self.stages.get(stage_of(row), (0,))[1:])

    def solved_by(self, row: str) -> bool:
        """Whether it brought something to the tolerance."""
        return self.worked(row) and self.stages[stage_of(row)][1] > 0

    def same_path(self, other: Run) -> bool:
        """Whether the other made the same steps to the same end."""
        return (self.status, self.error, self.stages) == (other.status, other.error, other.stages)


class Worker:
    """A process that solves files with the fclib of its Python."""

    def __init__(self, python: str = sys.executable, tol: float = TOLERANCE) -> None:
        self._python = python
        self._tol = tol
        self._process = subprocess.Popen(
            [python, "-c", WORKER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def run(self, file: Path, limit: float, tol: float = 0.0, chain: str = "") -> Run:
        """One solve."""
        return run_of(*self.told(file, limit, tol, chain))

    def told(
        self,
        file: Path,
        limit: float,
        tol: float,
        chain: str,
        options: dict[str, Any] | None = None,
    ) -> list[Any]:
        """What the process says of a solve."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        job = {"file": str(file), "limit": limit, "tol": tol or self._tol, "chain": chain}
        job |= {"options": options or {}}
        self._process.stdin.write(json.dumps(job) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit(f"{self._python}: has ended with {self._process.wait()}")
        answer: list[Any] = json.loads(line)
        return answer


def run_of(
    status: str, cpu_s: float, setup_s: float, error: float | None, stages: list[list[Any]]
) -> Run:
    """What a process has told."""
    return Run(status, cpu_s, setup_s, error, {name: tuple(rest) for name, *rest in stages})


def stage_of(row: str) -> str:
    """The name of the stage of a row of `Runs`, so that results tell rows apart."""
    return row.replace(" ", "_")


# ---- the table and its changes


def table() -> list[str]:
    """The stages of `auto`, a line each."""
    (text,) = (o.default for o in fclib.find_solver("auto").options if o.name == "chain")
    lines = [line.split("#")[0].strip() for line in str(text).splitlines()]
    return [line for line in lines if line]


def name_of(line: str) -> str:
    """What results call the stage."""
    return line.partition(":")[0].strip()


def ruled(line: str, **rules: object) -> str:
    """The stage with other values of its rules."""
    words = [word for word in line.split() if word.partition("=")[0] not in rules]
    return " ".join([*words, *(f"{key}={value}" for key, value in rules.items())])


def with_rules(number: int, **rules: object) -> Callable[[list[str]], list[str]]:
    """The change of the rules of a stage."""
    return lambda lines: [
        ruled(line, **rules) if k == number else line for k, line in enumerate(lines)
    ]


def place(lines: Sequence[str], name: str, which: int = 0) -> int:
    """Of the stage of this name."""
    return [k for k, line in enumerate(lines) if name_of(line) == name][which]


def without(number: int) -> Callable[[list[str]], list[str]]:
    """The change that leaves a stage out."""
    return lambda lines: [*lines[:number], *lines[number + 1 :]]


def inserted(after: str, line: str) -> Callable[[list[str]], list[str]]:
    """The change that puts a stage after another."""

    def change(lines: list[str]) -> list[str]:
        at = place(lines, after) + 1
        return [*lines[:at], line, *lines[at:]]

    return change


def inserted_before(number: int, line: str) -> Callable[[list[str]], list[str]]:
    """The change that puts a stage before another."""
    return lambda lines: [*lines[:number], line, *lines[number:]]


def moved(number: int, before: int, **rules: object) -> Callable[[list[str]], list[str]]:
    """The change that takes a stage to the place before another one, with other rules."""

    def change(lines: list[str]) -> list[str]:
        rest = without(number)(lines)
        at = before - (before > number)
        return [*rest[:at], ruled(lines[number], **rules), *rest[at:]]

    return change


def before_islands(line: str) -> Callable[[list[str]], list[str]]:
    """The change that puts a stage before all others of islands."""
    return lambda lines: [
        *(own for own in lines if "on=whole" in own),
        line,
        *(own for own in lines if "on=whole" not in own),
    ]


@dataclass(frozen=True)
class Change:
    """A change of the table, and the stage that a problem must come to for it to matter."""

    name: str
    stage: str
    apply: Callable[[list[str]], list[str]]


def changes(lines: list[str]) -> list[Change]:
    """Each stage left out, and other values of what has been looked at."""
    result = []
    names = [name_of(line) for line in lines]
    for k, name in enumerate(names):
        if lines[k].split(":")[1].split()[0] == "gauss_seidel" and "on=whole" in lines[k]:
            continue  # where every problem starts
        result.append(Change(f"without {numbered(names, k)}", name, without(k)))
    for gate in ("jointed=0.1", "at_most=10", "at_most=100", "at_least=0"):
        line = f"proximal newton : polish from=nothing {gate} limit=12"
        change = before_islands(line)
        result.append(Change(f"first proximal newton from nothing, {gate}", "gauss-seidel", change))
    first = "interior point"
    at = place(lines, first)
    for gate in ("1e-3", "1e-4", "1e-5"):
        line = f"proximal point : proximal_point from=best below={gate} limit=350"
        result.append(
            Change(f"proximal point after the first, below {gate}", first, inserted(first, line))
        )
    tried: dict[str, tuple[float, ...]] = {
        "far": (1, 16),
        "tau": (0.003, 0.1, 0.3, 1),
        "limit": (30, 120),
    }
    for key, values in tried.items():
        result += [
            Change(f"{first}: {key}={value:g}", first, with_rules(at, **{key: value}))
            for value in values
        ]
    for value in (1e-6, 1e-4, 1e-3):
        change = with_rules(at, polish=f"{value:g}")
        result.append(Change(f"{first}: polish={value:g}", first, change))
    sweeps = place(lines, "gauss-seidel")
    for value in (10, 40):
        result.append(
            Change(f"sweeps on the whole: {value}", "gauss-seidel", with_rules(sweeps, limit=value))
        )
    island = place(lines, "gauss-seidel", 1)
    for value in (25, 50, 200):
        result.append(
            Change(f"sweeps on islands: {value}", "gauss-seidel", with_rules(island, limit=value))
        )
    spectral = "spectral gradient"
    at_spectral = place(lines, spectral)
    line = "gauss-seidel : sweep_on at_least=150 law=coulomb worth=3"
    change = inserted_before(at_spectral, line)
    result.append(Change(f"{spectral}: after sweeps", spectral, change))
    for key, number in (("worth", 1), ("worth", 5), ("first_look", 50), ("first_look", 250)):
        change = with_rules(at_spectral, **{key: number})
        result.append(Change(f"{spectral}: {key}={number}", spectral, change))
    longer = f"{spectral}, longer"
    change = with_rules(place(lines, longer), **{"from": "best"})
    result.append(Change(f"{longer}: from=best", longer, change))
    alternating = "alternating directions"
    for key, numbers in (("worth", (10, 40)), ("first_look", (30, 100)), ("at_least", (1000,))):
        for number in numbers:
            change = with_rules(place(lines, alternating), **{key: number})
            # a lower gate lets other problems in
            stage = "gauss-seidel" if key == "at_least" else alternating
            result.append(Change(f"{alternating}: {key}={number}", stage, change))
    polish = place(lines, "proximal newton")
    for below in ("1e-6", "1e-4", "1e-3"):
        result.append(
            Change(f"proximal newton: below={below}", first, with_rules(polish, below=below))
        )
    middle = place(lines, "proximal point")
    for value in (100, 350, 600):
        result.append(
            Change(
                f"proximal point: limit={value}", "proximal point", with_rules(middle, limit=value)
            )
        )
    # another gate lets other problems in: they came to the stage before it
    gated = {
        "proximal point, near": (first, (1e-6, 1e-5, 1e-3, 1e-2), (50, 100, 400)),
        "proximal point, longer": ("proximal point", (1e-5, 1e-4, 1e-2), (600, 2400)),
    }
    for name, (before, gates, limits) in gated.items():
        k = place(lines, name)
        for error in gates:
            change = with_rules(k, below=f"{error:g}")
            result.append(Change(f"{name}: below={error:g}", before, change))
        for value in limits:
            result.append(Change(f"{name}: limit={value}", name, with_rules(k, limit=value)))
    near = place(lines, "proximal point, near")
    for later in ("no solution?", "held bodies"):
        change = moved(near, place(lines, later))
        result.append(Change(f"{names[near]}: before {later}", names[near], change))
    change = moved(near, place(lines, longer))
    result.append(Change(f"{names[near]}: before {longer}", first, change))
    after = place(lines, "held bodies") + 1
    change = moved(place(lines, "semismooth newton"), after)
    result.append(Change("semismooth newton: after held bodies", "semismooth newton", change))
    path = place(lines, "homotopy")
    for value in (1500, 5000):
        result.append(Change(f"homotopy: limit={value}", "homotopy", with_rules(path, limit=value)))
    newton = place(lines, "semismooth newton")
    for function in ("natural_map", "alart_curnier"):
        change = with_rules(newton, function=function)
        result.append(Change(f"semismooth newton: function={function}", names[newton], change))
    for earlier in ("interior point, shorter steps", "held bodies"):
        for value in (200, 400):
            change = moved(middle, place(lines, earlier), limit=value)
            name = f"proximal point before {earlier}: limit={value}"
            result.append(Change(name, earlier, change))
    return result


def numbered(names: Sequence[str], k: int) -> str:
    """The name of a stage, with its number if several have it."""
    return names[k] if names.count(names[k]) == 1 else f"{names[k]} {1 + names[:k].count(names[k])}"


def others(rule: Any, value: float) -> list[float]:
    """Smaller and larger values of a rule within its bounds; of a share near 1, of what is left."""
    if 0.5 < value < 1 and rule.highest <= 1:
        return [1 - 2 * (1 - value), 1 - (1 - value) / 2]
    factor = 2 if 1e-2 <= value < 1e4 else 10
    found = [value / factor, value * factor]
    if rule.type == "int":
        found = [float(int(number)) for number in found]
    return [number for number in found if rule.lowest <= number <= rule.highest]


def rule_changes(lines: list[str]) -> list[Change]:
    """Each number of the table, and each default that it uses, made smaller and larger."""
    methods = {method.name: method.rules for method in fclib.chain_methods()}
    names = [name_of(line) for line in lines]
    found = []
    for k, line in enumerate(lines):
        method, *words = line.partition(":")[2].split()
        given = dict(word.split("=") for word in words)
        if method == "held_bodies":
            continue
        for rule in [*methods[""], *methods[method]]:
            if rule.type not in ("int", "float"):
                continue
            value = float(given.get(rule.name, rule.default))
            where = rule.name in {own.name for own in methods[""]}
            for other in others(rule, value) if value else []:
                name = f"{numbered(names, k)}: {rule.name}={value:g} to {other:g}"
                # another gate lets other problems in
                stage = "gauss-seidel" if where else names[k]
                found.append(Change(name, stage, with_rules(k, **{rule.name: f"{other:g}"})))
    return found


# ---- the problems


@dataclass(frozen=True)
class Problem:
    """A file, with its family and half."""

    file: Path
    family: str
    half: str


def generated(folder: Path) -> Iterable[Problem]:
    """Packings and walls: some seeds to choose on, others to judge on."""
    for family in ("Packing", "Wall"):
        for half, seeds in (("choose", range(4)), ("judge", range(100, 104))):
            for contacts in (80, 300):
                for push in (0.0, 1.0):
                    for seed in seeds:
                        made: Any = scenes.assemblies()[family]()
                        file = folder / f"{family}-{contacts}-{push:g}-{seed}.hdf5"
                        fclib.write(file, made.of_size(contacts, push, seed))
                        yield Problem(file, family, half)


def evenly(problems: list[Problem], count: int) -> list[Problem]:
    """So many of them."""
    places = np.unique(np.linspace(0, len(problems) - 1, min(count, len(problems))).round())
    return [problems[int(k)] for k in places]


def gathered(files: Sequence[Path], folder: Path, count: int) -> list[Problem]:
    """At most `count` of each family and half."""
    groups: dict[tuple[str, str], list[Problem]] = defaultdict(list)
    for file in sorted(files):
        family = file.resolve().parent.name
        groups[family, "choose" if family in CHOOSING else "judge"].append(
            Problem(file.resolve(), family, "choose" if family in CHOOSING else "judge")
        )
    for problem in generated(folder):
        groups[problem.family, problem.half].append(problem)
    return [problem for group in groups.values() for problem in evenly(group, count)]


# ---- the measure


@dataclass(frozen=True)
class Row:
    """What a change does on a half."""

    change: str
    half: str
    entered: int  # problems that came to the stage
    other_path: int  # ... and took another path with the change
    solved_there: int  # ... and were solved by it
    solved: int  # by the table
    solved_changed: int
    lost: int  # solved by the table alone
    won: int
    mean: float  # shifted geometric mean of the ratios, if both solve
    ratio: float  # sums of CPU times, the change over the table
    low: float  # ends of the 95 % interval
    high: float

    def shown(self) -> dict[str, object]:
        """As pages have it."""
        return {
            "change": self.change,
            "half": self.half,
            "came to the stage": self.entered,
            "took another path": self.other_path,
            "solved there": self.solved_there,
            "solved": self.solved,
            "solved with the change": self.solved_changed,
            "lost": self.lost,
            "won": self.won,
            "mean ratio": self.mean,
            "CPU ratio": self.ratio,
            "from": self.low,
            "to": self.high,
        }


def cost(run: Run, limit: float) -> float:
    """CPU time [s], a failure charged."""
    return run.cpu_s if run.solved else CHARGE * limit


def interval(base: Sequence[float], changed: Sequence[float]) -> tuple[float, float]:
    """Of the ratio of the sums, over samples of the problems."""
    pick = np.random.default_rng(0).integers(0, len(base), (SAMPLES, len(base)))
    ratios = np.array(changed)[pick].sum(axis=1) / np.array(base)[pick].sum(axis=1)
    low, high = np.percentile(ratios, [2.5, 97.5])
    return float(low), float(high)


def mean_ratio(base: Sequence[Run], changed: Sequence[Run]) -> float:
    """The shifted geometric mean of the ratios of CPU times, if both solve."""
    both = [
        (b.cpu_s, a.cpu_s)
        for a, b in zip(base, changed, strict=True)
        if a.solved and b.solved
    ]  # fmt: skip
    if not both:
        return 1.0
    new, old = np.array(both).T
    return float(np.exp(np.mean(np.log((new + SHIFT) / (old + SHIFT)))))


def measured(
    change: Change,
    half: str,
    found: dict[Problem, Run],
    lines: list[str],
    limit: float,
    worker: Worker,
) -> Row | None:
    """The change on the problems of the half that came to its stage."""
    problems = [p for p, run in found.items() if p.half == half and change.stage in run.stages]
    if not problems:
        return None
    chain = "\n".join(change.apply(lines))
    base, changed = [], []
    for problem in problems:
        before, run = found[problem], worker.run(problem.file, limit, chain=chain)
        same = run.same_path(before)
        if not same and (before.solved or run.solved):  # side by side: the machine is shared
            before = worker.run(problem.file, limit, chain="\n".join(lines))
        base.append(before)
        changed.append(before if same else run)
    costs = [[cost(run, limit) for run in runs] for runs in (base, changed)]
    low, high = interval(*costs)
    return Row(
        change=change.name,
        half=half,
        entered=len(problems),
        other_path=sum(a is not b for a, b in zip(base, changed, strict=True)),
        solved_there=sum(
            change.stage in run.stages and run.stages[change.stage][1] > 0 for run in base
        ),
        solved=sum(run.solved for run in base),
        solved_changed=sum(run.solved for run in changed),
        lost=sum(a.solved and not b.solved for a, b in zip(base, changed, strict=True)),
        won=sum(b.solved and not a.solved for a, b in zip(base, changed, strict=True)),
        mean=round(mean_ratio(base, changed), 3),
        ratio=round(sum(costs[1]) / sum(costs[0]), 3),
        low=round(low, 3),
        high=round(high, 3),
    )


def notable(row: Row) -> bool:
    """Whether problems or time were lost or won, beyond what chance explains."""
    return bool(row.lost or row.won or row.low > 1 or row.high < 1)


def choose(problems: list[Problem], arguments: argparse.Namespace) -> None:
    """All changes on both halves."""
    lines = table()
    worker = Worker(tol=arguments.tol)
    found = {p: worker.run(p.file, arguments.seconds) for p in problems if p.half in arguments.half}
    if arguments.rules:
        found = {problem: run for problem, run in found.items() if run.solved}
    for half in arguments.half:
        own = [run for p, run in found.items() if p.half == half]
        print(f"{half}: {len(own)} problems, {sum(run.solved for run in own)} solved")
    print(f"{'change':46} {'half':7} entered there  solved   lost  won   mean  CPU ratio")
    rows = []
    for change in rule_changes(lines) if arguments.rules else changes(lines):
        if arguments.only and not any(word in change.name for word in arguments.only):
            continue
        for half in arguments.half:
            row = measured(change, half, found, lines, arguments.seconds, worker)
            if row is None:
                continue
            rows.append(row)
            print(
                f"{row.change:46} {row.half:7} {row.entered:7} {row.solved_there:5} "
                f"{row.solved:3} > {row.solved_changed:3} {row.lost:5} {row.won:4}  "
                f"{row.mean:.3f}  "
                f"{row.ratio:.3f} [{row.low:.3f}, {row.high:.3f}]",
                flush=True,
            )
    if arguments.results:
        note = (
            f"Limit {arguments.seconds:g} s of CPU, tolerance {arguments.tol:g}; at most "
            f"{arguments.problems} problems of a family."
        )
        title = "What the rules of auto are worth" if arguments.rules else STAGES_TITLE
        _results.store(arguments.results, [row.shown() for row in rows], title=title, note=note)
        chosen = [row.shown() for row in rows if notable(row)]
        if arguments.rules and chosen:
            other = sum(row.other_path > 0 for row in rows)
            note += f" Of {len(rows)} rows {other} have a problem that took another path."
            name = f"{arguments.results}-notable"
            _results.store(name, chosen, title="Rules of auto whose change matters", note=note)


# ---- which rows are needed


@dataclass(frozen=True)
class Case:
    """A solve that a row may be needed for."""

    name: str
    tol: float
    file: Path = field(compare=False)
    # "guess": a file of reactions; other keys are options of the solver
    options: tuple[tuple[str, Any], ...] = field(default=(), compare=False)


def planted(folder: Path) -> Iterable[Case]:
    """Small problems with a known solution, if the first stages do not solve them."""
    for number in PLANTED:
        problem, solution, guess = planted_judge.planted(number)
        if guess is not None or fclib.solve(problem, max_iterations=PLANTED_WORK).converged:
            continue
        if judge(problem, solution).error <= 0.1 * TOLERANCE:
            file = folder / f"planted-{number}.hdf5"
            fclib.write(file, problem)
            yield Case(f"planted {number}", TOLERANCE, file)


def warm(folder: Path, count: int) -> Iterable[Case]:
    """Steps of simulations, each from the reactions of the step before."""
    for name in WARM:
        path = collections.plan_of(collections.folders([name])[0]).trajectory
        assert path is not None
        states = collections.read_trajectory(path)
        for place in np.linspace(1, len(states) - 1, count).round().astype(int):
            before, problem = (states.problem(int(k)).problem for k in (place - 1, place))
            guess = collections.guess_of(before, fclib.solve(before), problem)
            if guess is None or states.step[place] != states.step[place - 1] + 1:
                continue
            file = folder / f"{name.replace('/', '-')}-{place}.hdf5"
            fclib.write(file, problem)
            np.save(file.with_suffix(".npy"), guess.r)
            options = (("guess", str(file.with_suffix(".npy"))),)
            step = f"{name}/{states.number[place]:04d}, from the step before"
            yield Case(step, TOLERANCE, file, options)


def cases_of(
    problems: Sequence[Problem], folder: Path, arguments: argparse.Namespace
) -> list[Case]:
    """The problems at each tolerance, without memory for factors, from guesses; planted ones."""
    found = []
    families: set[str] = set()
    for problem in problems:
        if problem.half not in arguments.half:
            continue
        name = f"{problem.family}/{problem.file.stem}"
        found += [Case(name, tol, problem.file) for tol in arguments.tols]
        if problem.family not in families:
            families.add(problem.family)
            memory = (("memory_limit", NO_MEMORY),)
            found.append(Case(f"{name}, no memory for factors", LOOSE, problem.file, memory))
    if "judge" in arguments.half:
        found += [*planted(folder), *warm(folder, arguments.steps)]
    return found


def texts(lines: Sequence[str]) -> list[str]:
    """What each row says behind its name; of equal rows, later ones with a mark."""
    found: list[str] = []
    for line in lines:
        text = " ".join(line.partition(":")[2].split())
        while text in found:
            text += " "
        found.append(text)
    return found


class Runs:
    """Runs of cases by tables of which rows are left out. Each is made once, and kept in a file."""

    def __init__(self, limit: float, kept: Path | None) -> None:
        self._worker = Worker()
        self._limit = limit
        self._kept = kept
        self._found: dict[tuple[str, float], list[tuple[list[str], Run]]] = defaultdict(list)
        if kept is not None and kept.is_file():
            for line in kept.read_text(encoding="utf-8").splitlines():
                name, tol, rows, run = json.loads(line)
                self._found[name, tol].append((rows, run_of(*run)))

    def of(self, case: Case, rows: Sequence[str]) -> Run:
        """The run with these rows. A row that does nothing in a run may as well be left out."""
        found = self._found[case.name, case.tol]
        for others, run in found:
            same = [row for row in others if row in rows] == list(rows)
            if same and not any(run.worked(row) for row in others if row not in rows):
                return run
        chain = "\n".join(f"{stage_of(row)} : {row}" for row in rows)
        told = self._worker.told(case.file, self._limit, case.tol, chain, dict(case.options))
        found.append((list(rows), run_of(*told)))
        if self._kept is not None:
            with self._kept.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps([case.name, case.tol, list(rows), told]) + "\n")
        return found[-1][1]


@dataclass(frozen=True)
class Verdict:
    """What a row is worth: the problem that is lost without it, or the one that takes longer."""

    row: str
    worked: int  # cases on which it does anything
    lost: bool  # whether the case is not solved without it
    ratio: float  # sums of CPU times, without it over with it; of a lost one not known
    case: Case | None = None
    run: Run | None = None  # with it
    other: Run | None = None  # without it


def verdict(row: str, rows: Sequence[str], cases: Sequence[Case], runs: Runs) -> Verdict:
    """The first problem that is lost; if there is none, the one that loses most time."""
    rest = [other for other in rows if other != row]
    working = [case for case in cases if runs.of(case, rows).worked(row)]

    def likely(case: Case) -> tuple[bool, float]:
        run = runs.of(case, rows)
        return not run.solved_by(row), run.whole

    sums = [1e-12, 1e-12]
    worst: tuple[float, Case | None, Run | None, Run | None] = (0.0, None, None, None)
    for case in sorted(working, key=likely):
        run = runs.of(case, rows)
        if not run.solved:
            continue
        other = runs.of(case, rest)
        if not other.solved:
            return Verdict(row, len(working), True, np.inf, case, run, other)
        sums[0] += run.whole
        sums[1] += other.whole
        worst = max(worst, (other.whole - run.whole, case, run, other), key=lambda own: own[0])
    return Verdict(row, len(working), False, sums[1] / sums[0], *worst[1:])


def needed(problems: list[Problem], folder: Path, arguments: argparse.Namespace) -> None:
    """Of each row of the table, the problem that needs it; with --remove, without the others."""
    lines = arguments.chain.read_text().splitlines() if arguments.chain else table()
    names = [numbered([name_of(line) for line in lines], k) for k in range(len(lines))]
    rows = texts(lines)
    named = dict(zip(rows, names, strict=True))
    cases = cases_of(problems, folder, arguments)
    runs = Runs(arguments.seconds, arguments.keep)
    solved = [case for case in cases if runs.of(case, rows).solved]
    print(f"{len(cases)} cases, {len(solved)} solved", flush=True)
    while True:
        found = []
        for row in reversed(rows):
            found.append(verdict(row, rows, solved, runs))
            print(*verdict_row(found[-1], named).values(), sep="  ", flush=True)
        free = [one for one in found if one.ratio <= LEEWAY]
        if not (arguments.remove and free):
            break
        least = min(free, key=lambda one: one.ratio)
        print(f"removed: {named[least.row]}", flush=True)
        rows.remove(least.row)
    if arguments.results:
        _results.store(
            arguments.results,
            [verdict_row(one, named) for one in reversed(found)],
            title="What each row of auto is needed for",
            note=f"{len(solved)} of {len(cases)} cases are solved within {arguments.seconds:g} s.",
        )


def verdict_row(one: Verdict, named: dict[str, str]) -> dict[str, object]:
    """As pages have it."""
    run, other = one.run, one.other
    return {
        "row": named[one.row],
        "works on": one.worked,
        "problem": one.case.name if one.case else "",
        "tolerance": _results.power(one.case.tol) if one.case else "",
        "CPU [s]": run.whole if run else "",
        "without it": "" if other is None else other.status if other.solved else "lost",
        "error without it": "" if other is None or other.error is None else other.error,
        "CPU without it [s]": other.whole if other else "",
        "sum of CPU, without over with": "" if one.lost else round(one.ratio, 3),
    }


def shifted_mean(values: Sequence[float]) -> float:
    """The shifted geometric mean [s]."""
    return float(np.exp(np.mean(np.log(np.array(values) + SHIFT))) - SHIFT)


@dataclass(frozen=True)
class Pair:
    """A problem solved by both."""

    problem: Problem
    tol: float
    this: Run
    other: Run

    def ratio(self, longest: float) -> float:
        """CPU time of this over that of the other."""
        mine, theirs = charged(self.this, longest), charged(self.other, longest)
        return (mine + SHIFT) / (theirs + SHIFT)


def charged(run: Run, longest: float) -> float:
    """CPU time [s], a failure that of the longest limit."""
    return min(run.whole, longest) if run.solved else longest


def paired(
    problem: Problem, tol: float, limits: Sequence[float], workers: dict[str, Worker]
) -> Pair:
    """Both with growing limits, until both have solved it; short runs thrice, the least counts."""
    runs: dict[str, Run] = {}
    for limit in limits[1:] or limits:
        for whose, worker in workers.items():
            if whose in runs and runs[whose].solved:
                continue
            run = worker.run(problem.file, limit, tol)
            if run.solved and run.whole < SHORT:
                again = [worker.run(problem.file, limit, tol) for _ in range(2)]
                run = min(run, *again, key=lambda own: own.whole)
            runs[whose] = run
        if all(run.solved for run in runs.values()):
            break
    return Pair(problem, tol, runs["this"], runs["other"])


def compare(problems: list[Problem], arguments: argparse.Namespace) -> None:
    """Both versions on the judging half."""
    judging = [problem for problem in problems if problem.half == "judge"]
    limits = sorted(arguments.limits)
    longest = limits[-1]
    names = {"this": "this", "other": arguments.other}
    print(f"{len(judging)} problems of the judging half", flush=True)
    own = threading.local()

    def measured_pair(job: tuple[Problem, float]) -> Pair:
        if not hasattr(own, "workers"):
            own.workers = {"this": Worker(), "other": Worker(arguments.against)}
        pair = paired(*job, limits, own.workers)
        lost = pair.other.solved and not pair.this.solved
        if lost or pair.this.whole > limits[0] or pair.other.whole > limits[0]:
            print(worst_row(pair, names["other"], longest), flush=True)
        return pair

    with ThreadPoolExecutor(arguments.jobs) as pool:
        jobs = [(problem, tol) for tol in arguments.tols for problem in judging]
        pairs = list(pool.map(measured_pair, jobs))
    rows = []
    for tol in arguments.tols:
        for whose in names:
            runs: list[Run] = [getattr(pair, whose) for pair in pairs if pair.tol == tol]
            times = [charged(run, longest) for run in runs]
            row: dict[str, object] = {"tolerance": _results.power(tol), "version": names[whose]}
            row |= {
                f"solved in {limit:g} s": sum(run.within(limit) for run in runs) for limit in limits
            }
            row |= {"CPU, sum [s]": sum(times), "CPU, shifted mean [ms]": 1e3 * shifted_mean(times)}
            rows.append(row)
            print(*row.values(), sep="  ")
    lost = [pair for pair in pairs if pair.other.solved and not pair.this.solved]
    rest = [pair for pair in pairs if pair.this.solved]
    rest.sort(key=lambda pair: -pair.ratio(longest))
    worst = [worst_row(pair, names["other"], longest) for pair in [*lost, *rest[:10]]]
    print(*worst, sep="\n")
    if arguments.results:
        families = len({problem.family for problem in judging})
        _results.store(
            arguments.results,
            rows,
            title=f"auto beside another version ({arguments.other}), on problems it was not chosen "
            "on",
            note=f"{len(judging)} problems of {families} families of the judging half, at most "
            f"{arguments.problems} of a family, evenly spread. A failure counts as {longest:g} s; "
            "the mean is geometric, shifted by 1 ms. What "
            f"{limits[-2:][0]:g} s do not solve is tried once more, for {longest:g} s.",
        )
        _results.store(
            f"{arguments.results}-worst",
            worst,
            title="What was lost, and the ten largest ratios of CPU time",
            note=f"{len(lost)} were lost: solved by {arguments.other} alone.",
        )


def worst_row(pair: Pair, other: str, longest: float) -> dict[str, object]:
    """A problem and what both made of it."""
    return {
        "problem": f"{pair.problem.family}/{pair.problem.file.stem}",
        "tolerance": _results.power(pair.tol),
        "CPU [s]": pair.this.whole,
        "error": pair.this.error,
        "ends": pair.this.status,
        f"CPU of {other} [s]": pair.other.whole,
        f"error of {other}": pair.other.error,
        f"{other} ends": pair.other.status,
        "CPU ratio": pair.ratio(longest),
    }


def main() -> None:
    """Choose, or compare."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--problems", type=int, default=12, help="of a family at most")
    parser.add_argument("--seconds", type=float, default=10, help="limit of a solve")
    parser.add_argument("--tol", type=float, default=TOLERANCE)
    parser.add_argument("--half", nargs="+", choices=HALVES, default=HALVES, help="both by default")
    parser.add_argument("--only", nargs="+", help="changes whose names have one of these in them")
    parser.add_argument("--rules", action="store_true", help="change each number, not the stages")
    parser.add_argument("--needed", action="store_true", help="which problem needs each row")
    parser.add_argument("--remove", action="store_true", help="rows that none needs, one by one")
    parser.add_argument("--keep", type=Path, metavar="RUNS", help="file of the runs")
    parser.add_argument("--chain", type=Path, metavar="FILE", help="another table")
    parser.add_argument("--steps", type=int, default=12, help="of each simulation, from a guess")
    _results.add_option(parser)
    parser.add_argument("--against", help="the Python of another fclib")
    parser.add_argument("--other", default="older", help="what tables call it")
    parser.add_argument("--limits", type=float, nargs="+", default=[1, 10, 60], help="[s]")
    parser.add_argument("--tols", type=float, nargs="+", default=[1e-4, 1e-8, 1e-12])
    parser.add_argument("--jobs", type=int, default=1, help="pairs of processes at once")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        problems = gathered(arguments.files, Path(folder), arguments.problems)
        if arguments.needed:
            needed(problems, Path(folder), arguments)
        else:
            (compare if arguments.against else choose)(problems, arguments)


if __name__ == "__main__":
    main()
