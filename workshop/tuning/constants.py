"""What other values of the constants of `auto` and of its solve would do.

    python -m workshop.tuning.constants FILE... [--only NAME...] [--count 4000] [--seconds 5]
        [--results auto-constants]

A constant of C++ has no option. So the source that names it is compiled once more for each value,
and the module is linked anew, in a folder of its own; nothing of the build changes. Rules of stages
are given as a chain. The problems are planted ones with numbers below 100,000 (those of tables of
other pages have larger numbers):

    digits      small ones that ask for all digits
    random      small ones that come to the stages "pivoting" or "random starts" of `auto`
    linked      some without a solution, which an open contact links to one island
    no memory   the FILEs to 1e-4, with no memory for factors: those of the families to choose on
    jammed      packings that come to the stage "held bodies", of other seeds than packings.py has
    loose       the FILEs of the families to choose on, to 1e-4
    paths       the FILEs of the families to choose on, by the interior point alone
    crowded     the FILEs of the families to choose on that come to this stage: most bodies move
    batches     boxes of 4 to 64 contacts, in batches, cold and warm, to four tolerances
    alone       boxes on a corner, mechanisms and spheres, one contact each, likewise

A row says how many are solved (of linked ones: proven to have no solution), and the sum of CPU
times; of digits the least of three runs, of batches of more. A FILE or a packing has a limit of
--seconds of CPU, as much as a failure counts.
"""

from __future__ import annotations

import argparse
import json
import re
import shlex
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build"
MODULE = "_core" + str(sysconfig.get_config_var("EXT_SUFFIX"))
REPEATS = 3
LOOSE = 1e-4  # tolerance of what is solved without factors
OWN = "--measure"  # this script in another process, with another module


def other_module(folder: str) -> None:
    """Import fclib from the folder, not from where it was installed to be edited."""
    sys.meta_path[:] = [
        finder for finder in sys.meta_path if not type(finder).__module__.startswith("_editable")
    ]
    sys.path.insert(0, folder)


if OWN in sys.argv:
    other_module(sys.argv[sys.argv.index(OWN) + 1])

import numpy as np  # noqa: E402

import fclib  # noqa: E402
from workshop.tables import _results, small_scenes  # noqa: E402
from workshop.tuning import choose_auto  # noqa: E402

sys.path.append(str(ROOT / "tests"))
import planted_judge  # noqa: E402
from ball_judge import judge  # noqa: E402
from helpers import dense  # noqa: E402


@dataclass(frozen=True)
class Constant:
    """A constant in C++ and other values of it."""

    name: str
    source: str  # in core/
    values: tuple[str, ...]  # the first one is that which it has
    problems: str


HELD = "held bodies"
HELD_SOURCE = "methods/held_bodies.cpp"


def pattern(name: str) -> str:
    """What defines a constant, up to its value."""
    return rf"(constexpr [\w:]+ {name} =\s+)([^;]+);"


def varied(name: str, kind: str, *values: float, source: str = HELD_SOURCE) -> Constant:
    """A constant of the stages that hold bodies; without values half and double of its own."""
    text = (ROOT / "core" / source).read_text(encoding="utf-8")
    found = re.search(pattern(name), text)
    if found is None:
        raise SystemExit(f"there is no constant {name} in core/{source}")
    value = float(found[2])
    whole = " int " in found[1] or "int64_t" in found[1]
    others = values or ((value // 2, 2 * value) if whole else (value / 2, 2 * value))
    return Constant(name, source, (found[2], *(f"{other:g}" for other in others)), kind)


CONSTANTS = [
    Constant("rounding_in_error", "solve/driver.cpp", ("1e3", "0", "10", "1e5"), "digits"),
    Constant("rounding_in_tolerance", "solve/driver.cpp", ("0.1", "0", "1e-3", "10"), "digits"),
    Constant("most_parts", "proof/no_solution.cpp", ("8", "0", "1", "1000"), "linked"),
    Constant("instead_of_factors", "chain/stages.cpp", ("100", "10", "1000"), "no memory"),
    Constant("time_of_multiplication", "chain/stages.cpp", ("0.25", "0.1", "0.5", "1"), "loose"),
    Constant("hope", "chain/stages.cpp", ("2", "1", "1.5", "3"), "loose"),
    *(
        varied(name, "jammed")
        for name in (
            "round_patience",
            "better",
            "regular",
            "rest_speed",
            "most_moving",
            "creep_change",
            "stuck",
            "convex_accuracy",
            "convex_limit",
            "inner",
            "doubt",
            "interior_above",
            "first_sweeps",
            "follow",
            "least_tau",
            "second_tau",
            "second_delta",
            "interior_limit",
            "short_kappa",
            "short_limit",
            "long_kappa",
            "long_easy",
            "long_hard",
            "long_limit",
        )
    ),
    varied("most_tau", "jammed", 2, 4),
    varied("second_cap", "jammed", 0.9, 0.6),  # half and double of what is left of it
    varied("most_moving", "crowded", 0.5, 0.8, 1),
    *(
        varied(name, "batches", source=f"embed/{source}.cpp")
        for name, source in (
            ("least_projections", "sweep_rule"),
            ("most_projections", "sweep_rule"),
            ("few_newton_steps", "sweep_rule"),
            ("near_end", "sweep_rule"),
        )
    ),
    varied("refined_tau", "paths", 0, 1e-9, 1e-5, 1e-3, 1e9, source="methods/interior_path.hpp"),
    varied("own_tolerance", "random", 1, 1e-3, 1e-4, source="chain/stages.cpp"),
    varied("part_of_sweep", "batches", 0.15, 0.6, 1, source="embed/lanes.cpp"),
    varied("most_steps_alone", "alone", 2, 16, 64, 128, source="embed/alone_steps.hpp"),
    varied("first_look", "alone", 2, 4, 16, 32, source="embed/alone_steps.hpp"),
]


@dataclass(frozen=True)
class Rules:
    """Other rules of a stage of the chain; none: without it."""

    stage: str
    which: int | None  # of that name; None: all of them
    rules: tuple[dict[str, object], ...]
    problems: str = "random"


RULES = [
    Rules("pivoting", 0, ({}, {"tries": 20}, {"tries": 180}, {"edges": 3}, {"edges": 8})),
    Rules("pivoting", 1, ({}, {"tries": 13}, {"tries": 120}, {"edges": 8}, {"edges": 32})),
    Rules("random starts", 0, ({}, {"tries": 67}, {"tries": 600})),
    Rules("own units", 0, ({}, {"range": 1}, {"range": 1e3}, {"range": 1e9})),
    *(Rules(HELD, k, ({},), kind) for kind in ("jammed", "crowded") for k in range(2)),
    Rules(HELD, 1, ({"creep": 0.05}, {"creep": 0.2}), "jammed"),
]


# the stages whose problems count
LATE: dict[str, set[str]] = defaultdict(
    set, random={"pivoting", "random starts"}, jammed={HELD}, crowded={HELD}
)
LIMITED = {"no memory", "loose", "paths", "jammed", "crowded"}
OF_FILES = {"no memory", "loose", "paths", "crowded"}
PACKINGS = [  # contacts, push, seed
    f"{contacts} {push:g} {seed}"
    for contacts in (800,)
    for push in (0.0, 1.0)
    for seed in range(100, 104)
]

# how many of each kind take about as long
BATCHES = {
    "batches": {"4": 1200, "8": 200, "16": 50, "64": 6},
    "alone": {"1 at a corner": 50000, "1 of a mechanism": 20000, "1": 8000},
}
BATCH_SEED = 7  # another one than that of small_problems.py
BATCH_TOLERANCES = (1e-3, 1e-4, 1e-6, 1e-8)
BATCH_REPEATS = 7

# ---- the problems


def linked(number: int) -> fclib.GlobalProblem:
    """Problem `number` of 2 to 12 parts without a solution, an open contact between neighbours."""
    rng = np.random.default_rng([number, 2029])
    parts: list[fclib.GlobalProblem] = []
    wanted = int(rng.integers(2, 13))
    at = 1000 * number
    while len(parts) < wanted:
        part = planted_judge.without_solution(at)
        at += 1
        if isinstance(part, fclib.GlobalProblem) and part.spacedim == 3 and part.G is None:
            parts.append(part)
    rows = np.cumsum([0] + [part.n for part in parts])
    links = np.zeros((rows[-1], 3 * (wanted - 1)))
    for k in range(wanted - 1):
        for side in (k, k + 1):
            at = int(rng.integers(rows[side], rows[side + 1] - 2))
            links[at : at + 3, 3 * k : 3 * k + 3] = rng.standard_normal((3, 3))
    w = np.tile([1e3, 0.0, 0.0], wanted - 1)

    def diagonal(blocks: Sequence[Any]) -> Any:
        shapes = np.array([block.shape for block in blocks])
        whole = np.zeros(shapes.sum(axis=0))
        ends = np.cumsum(shapes, axis=0)
        for block, end in zip(blocks, ends, strict=True):
            whole[end[0] - block.shape[0] : end[0], end[1] - block.shape[1] : end[1]] = block
        return whole

    return fclib.GlobalProblem(
        spacedim=3,
        M=diagonal([dense(part.M) for part in parts]),
        H=np.hstack([diagonal([dense(part.H) for part in parts]), links]),
        f=np.concatenate([part.f for part in parts]),
        w=np.concatenate([*(part.w for part in parts), w]),
        mu=np.concatenate([*(part.mu for part in parts), np.full(wanted - 1, 0.3)]),
    )


def holds(problem: Any, solution: fclib.Solution) -> bool:
    """Whether the data hold their own solution."""
    return bool(judge(problem, solution).error <= 0.1 * planted_judge.TOLERANCE)


def problems_of(kind: str, given: Sequence[str], count: int) -> Iterator[tuple[str, Any, Any]]:
    """Names, problems and guesses; `given` are files, or numbers that were picked."""
    if kind in OF_FILES:
        for file in given:
            yield file, fclib.read(Path(file)), None
        return
    if kind == "jammed":
        family: Any = fclib.scenes.assemblies()["Packing"]()
        for name in given:
            contacts, push, seed = name.split()
            yield name, family.of_size(int(contacts), float(push), int(seed)), None
        return
    if kind == "linked":
        for number in range(count // 80):
            yield str(number), linked(number), None
        return
    plant = planted_judge.hard if kind == "digits" else planted_judge.planted
    for number in map(int, given) if given else range(count):
        problem, solution, guess = plant(number)
        if holds(problem, solution):
            yield str(number), problem, None if guess is None else fclib.Solution(r=guess)


def measure_batches(kind: str) -> dict[str, Any]:
    """The same of batches; CPU times are those of the calls, the least of some."""
    problems = solved = 0
    spent = 0.0
    for name, count in BATCHES[kind].items():
        for at_rest in (False, True):
            W, q, mu, _ = small_scenes.problems(name, count, BATCH_SEED, at_rest)
            noise = np.random.default_rng(BATCH_SEED).normal(size=q.shape)
            before = fclib.solve_batch(W, q * (1 + 0.01 * noise), mu, tol=1e-10).r
            for guess in (None, before):
                for tol in BATCH_TOLERANCES:
                    least = np.inf
                    for _ in range(BATCH_REPEATS):
                        start = time.process_time()
                        found = fclib.solve_batch(W, q, mu, guess=guess, tol=tol)
                        least = min(least, time.process_time() - start)
                    problems += count
                    solved += int(np.sum(found.converged))
                    spent += least
    return {"problems": problems, "solved": solved, "CPU [s]": spent, "late": []}


def measure(job: dict[str, Any]) -> dict[str, Any]:
    """Solve the problems of a kind: how many, how many solved, CPU time [s], and who came where."""
    if job["kind"] in BATCHES:
        return measure_batches(job["kind"])
    kind, chain, seconds = job["kind"], job["chain"], job["seconds"]
    options: dict[str, Any] = {"chain": chain} if chain else {}
    tol = LOOSE if kind in {"no memory", "loose"} else planted_judge.TOLERANCE
    if kind == "no memory":
        options["memory_limit"] = 1e-9
    problems = solved = 0
    spent = 0.0
    late = []
    for name, problem, guess in problems_of(kind, job["given"], job["count"]):
        least = np.inf
        for _ in range(job["repeats"]):
            before = time.process_time()
            end = before + seconds
            result = fclib.solve(
                problem,
                "nsip" if kind == "paths" else "auto",
                tol,
                guess=guess,
                callback=lambda *_, end=end: time.process_time() < end,
                **options,
            )
            least = min(least, time.process_time() - before)
        answer = result.status == "infeasible" if kind == "linked" else result.converged
        if LATE[kind] & {stage.name for stage in result.stages}:
            late.append(name)
        problems += 1
        solved += answer
        spent += least if answer or kind not in LIMITED else max(least, seconds)
    return {"problems": problems, "solved": solved, "CPU [s]": spent, "late": late}


# ---- other modules


def command_of(source: str) -> str:
    """How the object of core/SOURCE is compiled."""
    path = str(ROOT / "core" / source)
    entries = json.loads((BUILD / "compile_commands.json").read_text(encoding="utf-8"))
    (command,) = {e["command"] for e in entries if e["file"] == path and "fPIC" in e["command"]}
    return str(command)


def users_of(header: str) -> list[str]:
    """The sources of core/ that include the header themselves."""
    core = ROOT / "core"
    line = f'#include "{header}"'
    return [
        str(file.relative_to(core))
        for file in sorted(core.rglob("*.cpp"))
        if line in file.read_text(encoding="utf-8")
    ]


def build(constant: Constant, value: str, folder: Path) -> None:
    """The package with another value of the constant: links to all of it, and its own module."""
    package = folder / "fclib"
    package.mkdir()
    for entry in (ROOT / "python" / "fclib").iterdir():
        if entry.name != MODULE:
            (package / entry.name).symlink_to(entry)
    text = (ROOT / "core" / constant.source).read_text(encoding="utf-8")
    changed, times = re.subn(pattern(constant.name), rf"\g<1>{value};", text)
    if times != 1:
        raise SystemExit(f"{constant.name} stands {times} times in core/{constant.source}")
    header = constant.source.endswith(".hpp")
    given = folder / "headers" / constant.source if header else folder / "changed.cpp"
    given.parent.mkdir(parents=True, exist_ok=True)
    given.write_text(changed, encoding="utf-8")
    objects: list[str] = []
    for source in users_of(constant.source) if header else [constant.source]:
        made = folder / f"changed{len(objects)}.o"
        words = shlex.split(command_of(source))
        words[words.index("-o") + 1] = str(made)
        first = next(k for k, word in enumerate(words) if word.startswith("-I"))
        words.insert(first, f"-I{folder / 'headers'}")
        if not header:
            words[-1] = str(given)
        subprocess.run(words, cwd=BUILD, check=True)
        objects.append(str(made))
    told = subprocess.run(
        ["ninja", "-C", str(BUILD), "-t", "commands", MODULE], capture_output=True, text=True
    )
    link = told.stdout.splitlines()[-1].removeprefix(": && ").removesuffix(" && :")
    words = shlex.split(link)
    words[words.index("-o") + 1] = str(package / MODULE)
    # what comes before the archive is taken instead of its own objects
    at = words.index("libfclib_core.a")
    words[at:at] = objects
    subprocess.run(words, cwd=BUILD, check=True)


def measured(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """`measure` in a process with the package of the folder."""
    words = [sys.executable, "-m", "workshop.tuning.constants", OWN, str(folder), json.dumps(job)]
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT)
    if done.returncode != 0:
        raise SystemExit(done.stderr)
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


# ---- the table


def rows_of(arguments: argparse.Namespace) -> Iterator[dict[str, object]]:
    """Of each constant and rule, for each value."""
    files = sorted(
        str(file.resolve())
        for file in arguments.files
        if file.resolve().parent.name in choose_auto.CHOOSING
    )
    job: dict[str, Any] = {
        "chain": "",
        "given": [],
        "count": arguments.count,
        "seconds": arguments.seconds,
        "repeats": 1,
    }

    def wanted(name: str) -> bool:
        return not arguments.only or any(word in name for word in arguments.only)

    def late(kind: str) -> list[str]:
        """The problems of a kind that come to its stages."""
        given = {"jammed": PACKINGS, "crowded": files}.get(kind, [])
        found: list[str] = measured(ROOT / "python", {**job, "kind": kind, "given": given})["late"]
        return found

    given: dict[str, list[str]] = dict.fromkeys(("no memory", "loose", "paths"), files)
    for constant in CONSTANTS:
        kind = constant.problems
        held = HELD if constant.source == HELD_SOURCE else ""
        if not wanted(f"{constant.name} {kind} {held}"):
            continue
        if kind in OF_FILES and not files:
            continue
        if LATE[kind] and kind not in given:
            given[kind] = late(kind)
        for k, value in enumerate(constant.values):
            with tempfile.TemporaryDirectory() as folder:
                build(constant, value, Path(folder))
                own = {**job, "kind": kind, "given": given.get(kind, [])}
                if kind == "digits":
                    own["repeats"] = REPEATS
                found = measured(Path(folder), own)
            yield row(constant.name, value, k == 0, kind, found)
    lines = choose_auto.table()
    for kind in ("random", "jammed", "crowded"):
        asked = [rules for rules in RULES if rules.problems == kind and wanted(rules.stage)]
        if not asked or (kind == "crowded" and not files):
            continue
        own = {**job, "kind": kind, "given": given.get(kind) or late(kind)}
        found = measured(ROOT / "python", own)
        yield row("the chain", "as it is", True, kind, found)
        for rules in asked:
            for own_rules in rules.rules:
                chain = "\n".join(changed(lines, rules, own_rules))
                found = measured(ROOT / "python", {**own, "chain": chain})
                word = " ".join(f"{key}={value}" for key, value in own_rules.items()) or "without"
                number = "" if rules.which is None else f" {rules.which + 1}"
                yield row(f"{rules.stage}{number}", word, False, kind, found)


def changed(lines: list[str], rules: Rules, own: dict[str, object]) -> list[str]:
    """The table with other rules of a stage, or of all of its name; or without it."""
    places = [k for k, line in enumerate(lines) if choose_auto.name_of(line) == rules.stage]
    if rules.which is not None:
        places = [places[rules.which]]
    if not own:
        return [line for k, line in enumerate(lines) if k not in places]
    return [choose_auto.ruled(line, **own) if k in places else line for k, line in enumerate(lines)]


def row(
    name: str, value: str, present: bool, kind: str, found: dict[str, Any]
) -> dict[str, object]:
    """As pages have it."""
    return {
        "constant": name,
        "value": value,
        "": "present" if present else "",
        "problems of": kind,
        **{key: found[key] for key in ("problems", "solved", "CPU [s]")},
    }


def note(arguments: argparse.Namespace, kinds: set[str]) -> str:
    """What a reader of the table must know."""
    count, seconds = arguments.count, f"{arguments.seconds:g} s"
    like_batches = (
        "thrown and at rest, cold and warm, to "
        f"{', '.join(map(_results.power, BATCH_TOLERANCES))}; CPU times are those of the calls, "
        f"the least of {BATCH_REPEATS}."
    )
    told = {
        "digits": f"Planted problems: of the numbers 0 to {count - 1}.",
        "random": f"Random ones: of the numbers 0 to {count - 1} that come to these stages.",
        "linked": f"Linked ones: the first {count // 80}.",
        "no memory": f"A file that is not solved to {_results.power(LOOSE)} counts as {seconds}.",
        "loose": f"A file that is not solved to {_results.power(LOOSE)} counts as {seconds}.",
        "jammed": "Jammed ones: packings of about 800 contacts, at rest and pushed, of the "
        "seeds 100 to 103, that come to the stages. One that is not solved "
        f"counts as {seconds}. A rule without a number is that of all stages of the "
        "name.",
        "crowded": "Crowded ones: files of the families to choose on that come to these stages.",
        "batches": f"Batches: boxes of 4 to 64 contacts, {like_batches}",
        "alone": f"Contacts alone: boxes on a corner, mechanisms and spheres, {like_batches}",
    }
    return " ".join(text for kind, text in told.items() if kind in kinds)


def main() -> None:
    """A row for each value."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--only", nargs="+", help="constants whose names have one of these in them")
    parser.add_argument("--count", type=int, default=4000, help="numbers of planted problems")
    parser.add_argument("--seconds", type=float, default=5, help="limit of a FILE")
    _results.add_option(parser)
    arguments = parser.parse_args()
    rows = []
    for one in rows_of(arguments):
        print(*one.values(), sep="  ", flush=True)
        rows.append(one)
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="Other values of constants",
            note=note(arguments, {str(one["problems of"]) for one in rows}),
        )


if __name__ == "__main__":
    if OWN in sys.argv:
        print(json.dumps(measure(json.loads(sys.argv[-1]))))
    else:
        main()
