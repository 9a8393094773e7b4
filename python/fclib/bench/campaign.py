"""A campaign: problems x solvers with options x tolerances x repeats, under limits.

It is a TOML file (docs/bench.md), or made from the flags of the command line. `plan` makes its
jobs.
"""

from __future__ import annotations

import importlib
import json
import math
import random
import re
import sys
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from fclib import _core, _registry
from fclib._regular import regular, resolved
from fclib._solve import MeritKind
from fclib._suggest import suggestion
from fclib.bench import generated, problems
from fclib.bench.fingerprint import version_of
from fclib.bench.job import Along, Job, Limits, ProblemFacts, SolverChoice
from fclib.bench.modules import load_modules, try_plugin
from fclib.bench.store import Store

PUBLISHED = Path(__file__).with_name("campaigns")
if not PUBLISHED.is_dir():  # in the repository, from which a development install is imported
    PUBLISHED = Path(__file__).resolve().parents[3] / "campaigns"
NUMBERS = ("time_limit", "wall_limit", "memory")  # a group of problems may set its own
KNOWN = {
    "name",
    "title",
    "tolerances",
    "from_history",
    "merit",
    *NUMBERS,
    "repeats",
    "repeated",
    "repeat_solved",
    "threads",
    "seed",
    "history",
    "renumber",
    "budget",
    "modules",
    "solvers",
    "problems",
}
LATER = 0.05  # a repeat comes after so much more of the campaign
DEFAULTS: Mapping[str, Any] = {"tolerances": [1e-8], "time_limit": 10.0, "memory": 4000.0}
WHAT = {"files", "set", "simulate", "planted"}  # a group of problems has exactly one of these
KNOWN_OF_PROBLEMS = {"family", "form", "sample", "tolerances", *WHAT, *NUMBERS}
KNOWN_OF_PROBLEMS |= {"optional", "published_mean", "sequence"}
KNOWN_OF_SEQUENCE = {"start", "count", "stride"}
SET = "set:"  # before the name of a set of the collection
UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
KNOWN_OF_SOLVER = {"name", "options", "label", "optional"}
MADE = {
    "simulate": {"family", "parameters", "steps", "seed"},
    "planted": {"count", "contacts", "spacedim", "seed"},
}


class CampaignError(_core.Error, ValueError):
    """A campaign asks for something impossible, or has an entry that is not understood."""


@dataclass(frozen=True)
class Steps:
    """Which problems of a group, in their order, are the steps of a sequence."""

    start: int = 0
    count: int | None = None  # None: all
    stride: int = 1

    def name(self, of: str) -> str:
        """The name of the sequence in stores: "rt444/Chain, from 100 by 2"."""
        return f"{of}, from {self.start}" + (f" by {self.stride}" if self.stride > 1 else "")

    @property
    def slice(self) -> slice:
        """The steps that a list describes."""
        end = None if self.count is None else self.start + self.count * self.stride
        return slice(self.start, end, self.stride)


@dataclass(frozen=True)
class Group:
    """Problems of a campaign that share tolerances and limits."""

    tolerances: tuple[float, ...]
    limits: Limits
    family: str = ""
    files: tuple[str, ...] = ()
    set: str = ""  # of the collection, or a family of it
    form: str | None = None  # form of its problems: "global", "local" or, of files, "both"
    sample: int | None = None
    simulate: Mapping[str, Any] | None = None
    planted: Mapping[str, Any] | None = None
    optional: bool = False  # a missing file is left out, without an error
    sequence: Steps | None = None  # each step is also solved from the solution before


@dataclass(frozen=True)
class Campaign:
    """Problems, solvers, tolerances, repeats and limits of the runs."""

    name: str
    solvers: tuple[SolverChoice, ...]
    groups: tuple[Group, ...]
    title: str = ""
    repeats: int = 1
    repeated: float = 1.0  # share of the problems that are repeated, and whose solutions are kept
    repeat_solved: bool = False  # whether a run is repeated only if the first one solved
    # larger tolerances, at which runs of built-in solvers are read off their histories: reached.py
    from_history: tuple[float, ...] = ()
    threads: int = 1
    seed: int = 0
    history: bool = False
    renumber: bool = False  # whether each repeat but the first is of a renumbered copy
    modules: tuple[str, ...] = ()
    merit: MeritKind = "both"
    budget: float | None = None  # [s] for all runs together
    base: Path = field(default_factory=Path.cwd)  # what paths are relative to
    text: str = ""  # as it was written
    missing: tuple[str, ...] = ()  # optional solvers that are not installed, and why

    @classmethod
    def read(
        cls,
        path: str | Path,
        changes: Mapping[str, Any] = MappingProxyType({}),
        sample: int | None = None,
        solvers: Sequence[str] = (),
    ) -> Campaign:
        """The campaign of a TOML file, or the published one of that name.

        Args:
            path: the file, or the name.
            changes: entries that take the place of the file's, in its groups of problems too.
            sample: number of problems to take from each group; None takes all.
            solvers: solvers to run besides those of the file.

        Raises:
            CampaignError: there is none, or it is not valid; the message names the entry.
        """
        file = Path(path)
        if not file.exists() and (PUBLISHED / f"{path}.toml").exists():
            file = PUBLISHED / f"{path}.toml"
        try:
            text = regular(file).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            word = error.strerror if isinstance(error, OSError) else "is no text"
            known = ", ".join(sorted(p.stem for p in PUBLISHED.glob("*.toml")))
            raise CampaignError(f"{file}: {word}; published campaigns: {known}") from None
        try:
            entries = toml().loads(text)
        except ValueError as error:
            raise CampaignError(f"{file}: {error}") from None
        # the paths in a published campaign are relative to the current folder
        base = Path.cwd() if file.parent == PUBLISHED else file.resolve().parent
        try:
            groups = [
                {key: value for key, value in row.items() if key not in changes}
                | ({"sample": sample} if sample else {})
                for row in _tables(entries)
            ]
            more = {"name": file.stem, **entries, "problems": groups, **changes}
            if solvers and isinstance(more.get("solvers"), list):
                more["solvers"] = [*more["solvers"], *solvers]
            return cls.of(more, base, text)
        except CampaignError as error:
            raise CampaignError(f"{file}: {error}") from None

    @classmethod
    def of(cls, entries: Mapping[str, Any], base: Path | None = None, text: str = "") -> Campaign:
        """The campaign of the entries of a TOML file.

        Raises:
            CampaignError: an entry is unknown, missing, or has a wrong value.
        """
        base = base or Path.cwd()
        _only(entries, KNOWN, "")
        modules = tuple(str(resolved(base / m)) for m in _texts(entries, "modules"))
        try:
            load_modules(list(modules))
        except _registry.SolverError as error:
            raise CampaignError(f"modules: {error}") from None
        choices, missing = _solvers(entries.get("solvers"), modules)
        rows = _tables(entries)
        groups = tuple(_group(row, entries, k) for k, row in enumerate(rows))
        larger = _larger(entries)
        if larger and min(larger) <= max(tol for group in groups for tol in group.tolerances):
            raise CampaignError("from_history: has a tolerance that is not larger than all others")
        seed = entries.get("seed", 0)
        if not isinstance(seed, int):
            raise CampaignError(f"seed: {seed!r} is not a whole number")
        return cls(
            name=str(entries.get("name", "campaign")),
            title=str(entries.get("title", "")),
            solvers=choices,
            groups=groups,
            repeats=_count(entries, "repeats", 1),
            repeated=_share(entries, "repeated"),
            repeat_solved=_yes(entries, "repeat_solved"),
            from_history=larger,
            threads=_count(entries, "threads", 1),
            seed=seed,
            history=_yes(entries, "history"),
            renumber=_yes(entries, "renumber"),
            modules=modules,
            merit=_merit(entries.get("merit", "both")),
            budget=_budget(entries["budget"]) if "budget" in entries else None,
            base=base,
            text=text,
            missing=missing,
        )

    def plan(
        self, store: Store | None = None, tell: Callable[[str], None] = lambda _: None
    ) -> list[Job]:
        """The jobs, in the order in which they are to be done, as `plan_by_key` gives them."""
        return list(self.plan_by_key(store, tell).values())

    def plan_by_key(
        self, store: Store | None = None, tell: Callable[[str], None] = lambda _: None
    ) -> dict[str, Job]:
        """The jobs by their keys, in the order in which they are to be done.

        They go repeat by repeat, each shuffled.

        If there is a budget, or if only a share of the runs is repeated, they go problem after
        problem. So a part of the campaign is spread evenly over the groups and families, and every
        problem that was begun has been solved by all solvers. The repeats of a share come between
        the other problems, some time after the first run.

        Args:
            store: files that it knows are not read again.
            tell: called with each thing left out and why, and with the progress of a build.

        Raises:
            fclib.Error: a problem cannot be found, made or read.
            ImportError: a problem is to be simulated or of a set, and the package that this needs
                is missing.
        """
        found: list[tuple[ProblemFacts, Group]] = []
        sequences: list[tuple[str, list[ProblemFacts], Group]] = []
        for group in self.groups:
            try:
                paths = self._paths(group, tell)
            except _core.FileError as error:
                if not group.optional:
                    raise
                tell(f"left out: {error}")
                continue
            before = len(found)
            for path in problems.sample(paths, group.sample):
                facts = store.known(path) if store else None
                if facts is None:
                    facts = problems.look(path, group.family)
                    if store:
                        store.note(path, facts)
                found.append((replace(facts, family=group.family or facts.family), group))
            if group.sequence is not None:
                steps = [facts for facts, _ in found[before:]]
                of = group.set or steps[0].family
                sequences.append((group.sequence.name(of), steps, group))
                problems.check_names(steps[0].path, steps[0].kind)
        again = self._repeated(found, sequences)
        random_order = random.Random(self.seed)
        order: list[Job] = []
        for repeat in range(self.repeats):
            ours = [
                job
                for facts, group in found
                if not repeat or facts.hash in again
                for choice in self.solvers
                for job in self._jobs(facts, group, choice, repeat, facts.hash in again)
            ]
            for name, steps, group in sequences:
                if repeat and steps[0].hash not in again:
                    continue
                for choice in self.solvers:
                    for tol in group.tolerances:
                        ours += self._chain(name, steps, group, choice, tol, repeat)
            random_order.shuffle(ours)
            if self.budget is not None and self.repeated == 1:
                ours = spread(ours)
            order += ours
        if self.repeated < 1 or self.repeat_solved:
            order = spread(order)
        jobs: dict[str, Job] = {}
        for job in order:
            jobs.setdefault(job.key, job)  # a problem that has two names is run once
        return jobs

    def _repeated(
        self,
        found: Sequence[tuple[ProblemFacts, Group]],
        sequences: Sequence[tuple[str, list[ProblemFacts], Group]],
    ) -> set[str]:
        """The problems that are repeated: a share of each group, evenly spread, and of sequences.

        All steps of a sequence are repeated, or none.
        """
        own: dict[int, list[str]] = defaultdict(list)
        for facts, group in found:
            if group.sequence is None:
                own[id(group)].append(facts.hash)
        chosen = {name for names in own.values() for name in share_of(names, self.repeated)}
        for _, steps, _ in share_of(sequences, self.repeated):
            chosen |= {facts.hash for facts in steps}
        return chosen

    def _jobs(
        self, facts: ProblemFacts, group: Group, choice: SolverChoice, repeat: int, again: bool
    ) -> list[Job]:
        """The jobs of a solver on a problem, at all tolerances."""
        keep = group.sequence is not None or (again and self.repeated < 1 and not repeat)
        known = self.from_history if group.sequence is None else ()
        jobs = [
            replace(self._job(facts, group, choice, tol, repeat), keep=keep)
            for tol in group.tolerances
        ]
        least = min(jobs, key=lambda job: job.tol)
        believed = choice.origin == "fclib"  # what another solver reports is not believed
        if known and believed:
            jobs[jobs.index(least)] = least = replace(least, history=True)
        for tol in known:
            job = self._job(facts, group, choice, tol, repeat)
            jobs.append(replace(job, off=least.key) if believed else job)
        if repeat and self.repeat_solved:
            jobs = [replace(job, first=replace(job, repeat=0).key) for job in jobs]
        return jobs

    def _job(
        self, facts: ProblemFacts, group: Group, choice: SolverChoice, tol: float, repeat: int
    ) -> Job:
        return Job(
            problem=facts,
            solver=choice,
            tol=tol,
            limits=group.limits,
            repeat=repeat,
            threads=self.threads,
            history=self.history,
            modules=self.modules,
            merit=self.merit,
            renumber=self.renumber,
            keep=group.sequence is not None,
        )

    def _chain(
        self,
        name: str,
        steps: Sequence[ProblemFacts],
        group: Group,
        choice: SolverChoice,
        tol: float,
        repeat: int,
    ) -> list[Job]:
        """The warm runs of a solver along a sequence; each waits for the step before."""
        chain: list[Job] = []
        for step, facts in enumerate(steps):
            along = Along(name, step, chain[-1].key if chain else "")
            job = self._job(facts, group, choice, tol, repeat)
            chain.append(replace(job, along=along, renumber=False))
        return chain

    def _paths(self, group: Group, tell: Callable[[str], None]) -> list[Path]:
        paths = self._all_paths(group, tell)
        if group.sequence is None:
            return paths
        steps = group.sequence
        if group.set:  # a set was already sampled when it was made
            steps = replace(steps, start=0, stride=1)
        chosen = paths[steps.slice]
        if len(chosen) < 2:
            name = group.sequence.name(", ".join(group.files) or group.set)
            raise _core.Error(f"a sequence needs two problems or more: {name} has {len(chosen)}")
        return chosen

    def _all_paths(self, group: Group, tell: Callable[[str], None]) -> list[Path]:
        paths = problems.files_of(group.files, self.base, group.form, tell) if group.files else []
        if group.set and group.sequence is not None:
            steps = group.sequence
            paths += generated.stored(group.set, group.form, steps.start, steps.count, steps.stride)
        elif group.set:
            part = generated.sampled(group.set, group.form, group.sample, tell)
            paths += part or generated.of_set(group.set, group.form, tell)
        if group.simulate is not None:
            paths += generated.simulated(
                family=group.simulate["family"],
                parameters=group.simulate.get("parameters", {}),
                steps=group.simulate["steps"],
                seed=group.simulate.get("seed", 0),
                form=group.form,
            )
        if group.planted is not None:
            paths += generated.planted(
                count=group.planted["count"],
                contacts=group.planted["contacts"],
                spacedim=group.planted.get("spacedim", 3),
                seed=group.planted.get("seed", 0),
            )
        return paths


def spread(jobs: Sequence[Job]) -> list[Job]:
    """The jobs in an order whose first part has all jobs of its problems, of all families.

    If there are repeats among them, each comes `LATER` than the run before it. The steps of a
    sequence come in their order, as a warm run waits for the step before.
    """
    steps = {job.problem.hash: job.along.step for job in jobs if job.along}
    families: dict[str, dict[str, dict[int, list[Job]]]] = defaultdict(
        lambda: defaultdict(lambda: defaultdict(list))
    )
    for job in jobs:
        families[job.problem.family][job.problem.hash][job.repeat].append(job)
    places = [
        ((k + 0.5) / len(own) + LATER * (repeat - min(repeats)), family, repeat, part)
        for family, own in families.items()
        for k, (_, repeats) in enumerate(sorted(own.items(), key=lambda one: steps.get(one[0], 0)))
        for repeat, part in repeats.items()
    ]
    return [job for *_, part in sorted(places, key=lambda place: place[:3]) for job in part]


def share_of(names: Sequence[Any], share: float) -> list[Any]:
    """A share of some things, evenly spread: one at least if there is any."""
    count = max(1, round(share * len(names)))
    first = 0.5 * (len(names) / count - 1)
    return [names[int(first + k * len(names) / count)] for k in range(count)] if names else []


def published_means(store: str | Path) -> dict[tuple[str, float], float]:
    """Published means of the fastest solver, by family and tolerance, that campaigns quote."""
    with Store(store, create=False) as opened:
        return {key: mean for text in opened.texts() for key, mean in means_quoted(text).items()}


def means_quoted(text: str) -> dict[tuple[str, float], float]:
    """The published means that the text of a campaign quotes, by family and tolerance."""
    try:
        campaign = toml().loads(text)
    except ValueError:
        return {}  # of another version, or edited
    found = {}
    groups = campaign.get("problems", ())
    for group in groups if isinstance(groups, list) else ():
        if isinstance(group, Mapping) and "published_mean" in group:
            tolerances = group.get("tolerances", campaign.get("tolerances", []))
            for tol in tolerances if isinstance(tolerances, list) else [tolerances]:
                found[group.get("family", ""), float(tol)] = float(group["published_mean"])
    return found


def toml() -> Any:
    """The reader of TOML: `loads`."""
    return importlib.import_module("tomllib" if sys.version_info >= (3, 11) else "tomli")


def _tables(entries: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    rows = entries.get("problems", [])
    if isinstance(rows, list):
        rows = [
            {"set": row.removeprefix(SET)} if isinstance(row, str) and row.startswith(SET) else row
            for row in rows
        ]
    if not isinstance(rows, list) or not all(isinstance(row, Mapping) for row in rows):
        raise CampaignError(
            'problems: write [[problems]], and files = [...] below it; or problems = ["set:NAME"]'
        )
    if not rows:
        raise CampaignError("problems: there is no [[problems]]")
    return rows


def _only(entries: object, known: set[str], where: str) -> None:
    if not isinstance(entries, Mapping):
        raise CampaignError(f"{where.rstrip('.') or 'the file'}: is no table")
    for name in entries:
        if name not in known:
            raise CampaignError(
                f"{where}{name}: is not known here; {suggestion(name, known)}"
                f"there is: {', '.join(sorted(known))}"
            )


def _texts(entries: Mapping[str, Any], name: str) -> list[str]:
    value = entries.get(name, [])
    value = [value] if isinstance(value, str) else value
    if not isinstance(value, list) or not all(isinstance(x, str) for x in value):
        raise CampaignError(f"{name}: is neither a text nor a list of texts")
    return list(value)


def _positive(value: object, where: str) -> float:
    number = float(value) if isinstance(value, (int, float)) else math.nan
    if not number > 0 or isinstance(value, bool):
        raise CampaignError(f"{where}: {value!r} is not a positive number")
    return number


def _tolerance(value: object, where: str) -> float:
    number = _positive(value, where)
    if math.isinf(number):
        raise CampaignError(f"{where}: with an infinite bound, anything would be a solution")
    return number


def _count(entries: Mapping[str, Any], name: str, default: int, where: str = "") -> int:
    value = entries.get(name, default)
    if not isinstance(value, int) or isinstance(value, bool) or value < 1:
        raise CampaignError(f"{where}{name}: {value!r} is not a whole number, 1 or more")
    return value


def _yes(entries: Mapping[str, Any], name: str, where: str = "") -> bool:
    """Whether an entry is true; false if it is left out."""
    value = entries.get(name, False)
    if not isinstance(value, bool):
        raise CampaignError(f"{where}{name}: {value!r} is neither true nor false")
    return value


def _share(entries: Mapping[str, Any], name: str) -> float:
    """A share of 1; 1 if it is left out."""
    value = _positive(entries.get(name, 1.0), name)
    if value > 1:
        raise CampaignError(f"{name}: {value:g} is above 1")
    return value


def _larger(entries: Mapping[str, Any]) -> tuple[float, ...]:
    """The tolerances that are read off histories."""
    values = entries.get("from_history", [])
    if not isinstance(values, list):
        raise CampaignError("from_history: is no list of tolerances, as in from_history = [1e-4]")
    return tuple(_tolerance(value, "from_history") for value in values)


def _made(recipe: Mapping[str, Any], where: str) -> None:
    steps = recipe.get("steps", [])
    if not isinstance(steps, list) or not all(isinstance(k, int) and k >= 0 for k in steps):
        raise CampaignError(f"{where}steps: {steps!r} is no list of whole numbers, 0 or more")
    for name in ("count", "contacts", "spacedim"):
        if name in recipe:
            _count(recipe, name, 1, where)
    if not isinstance(recipe.get("seed", 0), int):
        raise CampaignError(f"{where}seed: {recipe['seed']!r} is not a whole number")
    if not isinstance(recipe.get("parameters", {}), Mapping):
        raise CampaignError(f"{where}parameters: is no table")


def _merit(value: object) -> MeritKind:
    if value == "both":
        return "both"
    if value == "natural":
        return "natural"
    raise CampaignError(f"merit: {value!r} is neither 'both' nor 'natural'")


def _budget(value: object) -> float:
    """[s] of "90min", "2h" or a number of seconds."""
    found = re.fullmatch(r"([0-9.]+) *(s|min|h|d)", value) if isinstance(value, str) else None
    if found is None:
        if isinstance(value, str):
            raise CampaignError(f'budget: {value!r} is not of the form "90min", "2h" or "1d"')
        return _positive(value, "budget")
    return _positive(float(found[1]) * UNITS[found[2]], "budget")


def _group(row: Any, entries: Mapping[str, Any], number: int) -> Group:
    where = f"problems[{number}]."
    _only(row, KNOWN_OF_PROBLEMS, where)
    if not WHAT & set(row):
        raise CampaignError(f"{where[:-1]}: has neither files, set, simulate nor planted")
    forms = ("global", "local", "both") if "files" in row else ("global", "local")
    if row.get("form") not in (None, *forms):
        raise CampaignError(f"{where}form: {row['form']!r} is none of {', '.join(forms)}")
    if WHAT & set(row) == {"planted"} and row.get("form") == "global":
        raise CampaignError(f"{where}form: planted problems are local")
    steps = None
    if "sequence" in row:
        steps = _steps(row, where)
    for kind, known in MADE.items():
        if kind in row:
            _only(row[kind], known, f"{where}{kind}.")
            needed = known - {"seed", "parameters", "spacedim"}
            if absent := sorted(needed - set(row[kind])):
                raise CampaignError(f"{where}{kind}: has no {absent[0]}")
            _made(row[kind], f"{where}{kind}.")
    values = {name: row.get(name, entries.get(name)) for name in ("tolerances", *NUMBERS)}
    values = {**DEFAULTS, **{name: value for name, value in values.items() if value is not None}}
    tolerances = values["tolerances"]
    if not isinstance(tolerances, list):
        tolerances = [tolerances]
    if not tolerances:
        raise CampaignError(f"{where}tolerances: the list is empty")
    time = _positive(values["time_limit"], f"{where}time_limit")
    return Group(
        tolerances=tuple(_tolerance(x, f"{where}tolerances") for x in tolerances),
        limits=Limits(
            time=time,
            wall=_positive(values.get("wall_limit", time), f"{where}wall_limit"),
            memory=_positive(values["memory"], f"{where}memory"),
        ),
        family=str(row.get("family", "planted" if "planted" in row else "")),
        files=tuple(_texts(row, "files")),
        set=str(row.get("set", "")).removeprefix(SET),
        form=row.get("form"),
        sample=_count(row, "sample", 1, where) if "sample" in row and not steps else None,
        sequence=steps,
        simulate=row.get("simulate"),
        planted=row.get("planted"),
        optional=_yes(row, "optional", where),
    )


def _steps(row: Mapping[str, Any], where: str) -> Steps:
    """The sequence of a group of problems; a sample takes its first steps."""
    own = row["sequence"]
    _only(own, KNOWN_OF_SEQUENCE, f"{where}sequence.")
    if WHAT & set(row) not in ({"files"}, {"set"}, {"simulate"}):
        raise CampaignError(f"{where[:-1]}: a sequence is of files, a set or a simulation alone")
    start = own.get("start", 0)
    if not isinstance(start, int) or isinstance(start, bool) or start < 0:
        raise CampaignError(f"{where}sequence.start: {start!r} is not a whole number, 0 or more")
    counts = [_count(own, "count", 1, f"{where}sequence.")] if "count" in own else []
    counts += [_count(row, "sample", 1, where)] if "sample" in row else []
    stride = _count(own, "stride", 1, f"{where}sequence.")
    return Steps(start, min(counts, default=None), stride)


def _solvers(
    rows: object, modules: Sequence[str]
) -> tuple[tuple[SolverChoice, ...], tuple[str, ...]]:
    if not isinstance(rows, list) or not rows:
        raise CampaignError('solvers: is no list of solvers, as in solvers = ["auto", "nsgs"]')
    choices: dict[str, SolverChoice] = {}
    missing = []
    for number, row in enumerate(rows):
        where = f"solvers[{number}]."
        entries: Any = row
        if isinstance(row, str):
            try:
                name, options = _registry.parse_solver(row)
            except _core.OptionError as error:
                raise CampaignError(str(error)) from None
            entries = {"name": name, "options": options}
        _only(entries, KNOWN_OF_SOLVER, where)
        if "name" not in entries:
            raise CampaignError(f"{where[:-1]}: has no name")
        name, options = str(entries["name"]), entries.get("options", {})
        if not isinstance(options, Mapping):
            raise CampaignError(f"{where}options: is no table, as in options = {{ name = value }}")
        optional = _yes(entries, "optional", where)
        try:
            try_plugin(name)
            info = _registry.find_solver(name)
            info.check_options(options)
        except _core.OptionError as error:
            if not optional:
                raise CampaignError(f"{where[:-1]}: {error}") from None
            missing.append(str(error))
            continue
        choice = SolverChoice(
            name=name,
            options=options,
            version=version_of(info, modules),
            family=info.family,
            origin=info.origin,
            label=str(entries.get("label", "")),
            about=described(info),
            dimensions=_registry.dimensions_by_law(info),
        )
        if choice.title in choices:
            raise CampaignError(f"{where[:-1]}: there are two that are called {choice.title!r}")
        choices[choice.title] = choice
    if not choices:
        raise CampaignError(f"solvers: none of them is here: {'; '.join(missing)}")
    return tuple(choices.values()), tuple(missing)


def described(info: _core.SolverInfo) -> str:
    """The description of a solver, in JSON. Stores keep it, so that no solver is asked again.

    Each option has a name, a type or choices, a default, a unit and a meaning.
    """
    options = [
        [
            option.name,
            " | ".join(option.choices) or option.type,
            "see there" if option.type == "text" else str(option.default),
            option.unit,
            option.doc,
        ]
        for option in info.options
    ]
    return json.dumps(
        {
            "title": info.title,
            "citation": info.citation,
            "dimensions": list(info.dimensions),
            "rolling": list(info.rolling_dimensions),
            "spin": list(info.spin_dimensions),
            "options": options,
        },
        sort_keys=True,
    )
