"""The rule of the sets standard, hard, open and sequences, on planted tables and stores."""

import json
import math
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

pytest.importorskip("pyarrow")

import fclib
from fclib._judge import NO_APPROACH, ZERO, trivial
from fclib.bench import Campaign
from fclib.collections import published, ratings, set_index, trajectory
from helpers_bench import add_run, facts_of
from workshop.sets import candidates, choose, difficulty, features, select, sequences
from workshop.sets.__main__ import app

load: Any = fclib.load
SOLVERS = ("nsgs", "nsn-ac", "nsip", "ppa-nsn", "homotopy", "admm", "apgd", "fp-eg-upk")
RULE = select.Rule()


def command(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def candidate(problem: str, **more: Any) -> dict[str, Any]:
    """A row whose features are those of nobody else, if the family's name is not that either."""
    folder, _, number = problem.rpartition("/")
    scene = folder.partition("/")[2]
    random = np.random.default_rng(abs(hash_of(problem)))
    values: dict[str, Any] = {
        "problem": problem,
        "label": scene,
        "scene": scene,
        "number": int(number),
        "digest": f"{hash_of(problem):064x}",
        "law": "Coulomb",
        "left_out": "",
        **{name: random.uniform(1, 2) for name, *_ in features.SCALES},
        "nc": 50,
        "planar": 0.0,
        "best_error": None,
        "best_by": "",
    }
    return values | more


def hash_of(text: str) -> int:
    """A number that another process finds too."""
    import zlib

    return zlib.crc32(text.encode())


def ran(row: dict[str, Any], solved: int, limit: float = 10.0, cost: float = 1.0) -> dict[str, Any]:
    """The row, with so many of the solvers that solve it; which ones changes from row to row."""
    first = hash_of(row["problem"] + "x") % len(SOLVERS)
    for place in range(len(SOLVERS)):
        name = select.column(SOLVERS[(first + place) % len(SOLVERS)], limit)
        row[name] = cost if place < solved else math.inf
    return row


def population() -> list[dict[str, Any]]:
    """Candidates of 60 families: of all sizes and laws, of which most solve some."""
    random = np.random.default_rng(3)
    rows = []
    for family in range(60):
        law = "rolling" if family % 5 == 0 else "Coulomb"
        planar = float(family % 10 in (5, 6))
        for number in range(select.MEASURED):
            # the sizes of each family reach over all classes
            contacts = int(10 ** random.uniform(0, 4.7))
            row = candidate(f"some/F{family:02d}/{number:04d}", nc=contacts, law=law, planar=planar)
            solved = int(random.choice([0, 1, 2, 3, 4, 5, 6, 7, 8, 8]))
            ran(row, solved, cost=10 ** random.uniform(-3, 1))
            if solved < 2:  # fewer than a quarter of eight
                ran(row, solved, limit=60.0, cost=20.0)
            rows.append(row)
    return rows


@pytest.fixture(scope="module")
def chosen() -> tuple[list[dict[str, Any]], select.Chosen]:
    rows = population()
    return rows, select.choose(rows, RULE)


# ---- what is left out before anything is measured


def test_copies_near_ones_and_trivial_ones_are_left_out_with_their_reasons() -> None:
    first = candidate("a/A/0001")
    same = candidate("b/B/0002", digest=first["digest"])
    near = {**candidate("c/C/0003"), **{name: first[name] for name, *_ in features.SCALES}}
    near["mu"] = first["mu"] + 1e-9
    dull = candidate("d/D/0004", left_out="trivial: r = 0 is a solution")
    rows = [first, same, near, dull, candidate("e/E/0005")]
    assert select.left_out(rows) == [
        "",
        "the same data as a/A/0001",
        "nearly the same as a/A/0001",
        "trivial: r = 0 is a solution",
        "",
    ]


def test_some_of_a_family_are_measured_and_they_are_apart() -> None:
    rows = [candidate(f"a/A/{k:04d}") for k in range(30)] + [candidate("b/B/0000")]
    words = select.not_measured(rows)
    stay = [k for k, word in enumerate(words) if not word]
    assert len(stay) == select.MEASURED + 1
    assert stay[-1] == 30
    (word,) = set(words) - {""}
    assert word == f"not measured: of A, {select.MEASURED} others are farther apart"
    place = np.array([[x, 0.0] for x in (0, 1, 2, 10, 11, 21)])
    assert features.farthest(place, 3) == [0, 3, 5]
    assert features.farthest(place, 6) == list(range(6))
    # none is left out by its data
    assert not any(select.left_out(rows))


def test_a_chain_of_near_ones_keeps_every_other_one() -> None:
    """0, 0.06, 0.12, ...: each is near its neighbours alone."""
    line = np.arange(6)
    rows = [{name: 0.0 for name, *_ in features.SCALES} | {"mu": float(k)} for k in line]
    step = abs(features.points(rows)[1] - features.points(rows)[0]).max()
    assert features.nearly_same(rows, 1.2 * step) == [None, 0, None, 2, None, 4]
    assert features.nearly_same(rows, 0.8 * step) == [None] * 6


def test_trivial_problems_are_found() -> None:
    problem = load("tiny/Wall/0003", "local")
    assert trivial(problem) is None
    d, nc = problem.spacedim, problem.nc
    normal = np.arange(0, d * nc, d)
    apart, nearly = problem.q.copy(), problem.q.copy()
    apart[normal] = np.abs(apart[normal])
    assert trivial(problem.replace(q=apart)) == NO_APPROACH
    # approaches by less than the tolerance
    nearly[normal] = np.abs(nearly[normal])
    nearly[0] = -1e-10 * np.linalg.norm(nearly)
    assert trivial(problem.replace(q=nearly)) == ZERO
    assert select.why_trivial(problem.replace(q=nearly)) == f"trivial: {ZERO}"
    # joints hold what would approach
    linked: Any = load("tiny/FourBar/0150", "local")
    away = linked.eliminate().q.reshape(linked.nc, 3)[:, 0].min()
    assert trivial(linked) is None
    lifted = linked.q.copy()
    lifted[::3] += 1.1 * abs(away)
    assert trivial(linked.replace(q=lifted)) == NO_APPROACH
    # few sweeps solve one contact
    ball = fclib.LocalProblem(spacedim=3, W=np.eye(3), q=[-1.0, 0.1, 0], mu=[0.5])
    assert select.why_trivial(ball) == "trivial: nsgs solves it, sweeps: 1"


# ---- the choice


def test_standard_is_within_all_bounds(chosen: tuple[list[dict[str, Any]], select.Chosen]) -> None:
    rows, choice = chosen
    own = [rows[k] for k in choice.of("standard")]
    assert len(own) == 240
    assert not [line for line in choice.lacking if line.startswith("standard")]
    assert max(Counter(row["scene"] for row in own).values()) <= 6
    sizes = [(1, 10), (11, 100), (101, 1000), (1001, 10_000), (10_001, 10**9)]
    shares = [sum(low <= row["nc"] <= high for row in own) / 240 for low, high in sizes]
    for share, (_, low, high) in zip(shares, select.SIZES, strict=True):
        assert low <= share <= high
    laws = Counter((row["law"], bool(row["planar"])) for row in own)
    for law, planar, low, high in select.LAWS:
        assert round(low * 240) <= laws[law, planar] <= round(high * 240)
    values = [[row[select.column(name, 10.0)] for name in SOLVERS] for row in own]
    assert sum(max(costs) <= 0.01 for costs in values) <= 24
    few = [costs for costs in values if sum(map(math.isfinite, costs)) < 2]
    assert 30 <= len(few) <= 60
    assert all(map(math.isfinite, (min(costs) for costs in few)))  # nothing that nobody solves
    # every solver but the best and the worst
    solved = sorted(np.isfinite(np.array(values)).mean(axis=0))
    assert solved[1] >= 0.1
    assert solved[-2] <= 0.9


def test_standard_has_no_family_that_all_solve() -> None:
    rows = population()
    for row in rows:
        if row["scene"] == "F07":
            ran(row, 8)
    # one that all solve comes with one that not all solve
    easy = [row for row in rows if row["scene"] == "F08"]
    for row in easy[1:]:
        ran(row, 8)
    ran(easy[0], 4)
    choice = select.choose(rows, RULE)
    own = [rows[k] for k in choice.of("standard")]
    assert len(own) == 240
    assert "F07" not in {row["scene"] for row in own}
    mine = [row["number"] for row in own if row["scene"] == "F08"]
    assert not mine or easy[0]["number"] in mine
    places = [k for k, row in enumerate(rows) if row["scene"] == "F07"]
    assert {choice.why[k] for k in places} == {"all solvers solve all of F07"}


def test_what_a_bound_lacks_is_told() -> None:
    rows = [row for row in population() if row["nc"] <= 10_000]
    choice = select.choose(rows, RULE)
    assert choice.lacking[0] == "standard: 5 of 5, above"
    few = [row for row in rows if row["scene"] < "F20"]
    told = select.choose(few, RULE).lacking
    assert any(line.endswith("240, problems in all") for line in told)
    assert len(select.choose(few, RULE).of("standard")) <= 20 * 6


def test_hard_and_open_are_what_solvers_leave(
    chosen: tuple[list[dict[str, Any]], select.Chosen],
) -> None:
    rows, choice = chosen
    assert not set(choice.of("hard")) & set(choice.of("standard"))
    for name, right in (("hard", {1}), ("open", {0})):
        own = [rows[k] for k in choice.of(name)]
        assert own
        counts = [sum(map(math.isfinite, select.costs_of(row, 60.0).values())) for row in own]
        assert set(counts) == right
        assert max(Counter(row["scene"] for row in own).values()) <= 6
    every = [
        k
        for k, row in enumerate(rows)
        if not np.isfinite(list(select.costs_of(row, 10.0).values())).any()
    ]
    assert set(choice.of("open")) <= set(every)


def test_open_hard_and_unmeasured_ones_by_name() -> None:
    names = [f"a/A{k}/0000" for k in range(7)]
    rows = [candidate(name) for name in names]
    ran(ran(rows[0], 0), 0, limit=60.0)  # nobody
    ran(ran(rows[1], 0), 0, limit=60.0)
    rows[1] |= {"best_error": 1e-9, "best_by": "auto, 60 s"}  # somebody, too late
    ran(ran(rows[2], 0), 2, limit=60.0)  # a quarter
    ran(ran(rows[3], 1), 6, limit=60.0)  # most of them
    ran(rows[4], 1)  # not run for long
    ran(rows[5], 5)
    rows.append(ran(ran(candidate("a/A7/0000"), 0), 0, limit=60.0) | {"proof": "me"})
    rows[0] |= {"best_error": 3e-5, "best_by": "admm, 60 s"}
    choice = select.choose(rows, select.Rule(standard=2, clusters=2, difficult=0))
    assert choice.set[0] == "open"
    assert choice.why[0] == (
        "0 of 8 solvers in 10 s; 0 of 8 solvers in 60 s;"
        " the best error known is 3.0e-05, by admm, 60 s"
    )
    assert {choice.set[1], choice.set[2]} <= {"standard", "hard"}
    assert choice.set[3] in ("standard", "")
    assert choice.why[4] == "difficult, and not run with a limit of 60 s"
    assert choice.why[6] == "not run with a limit of 10 s"
    assert choice.set[4] == choice.set[6] == ""
    assert choice.set[7] == "hard"  # and no part of standard, where no solver solves it
    assert choice.why[7].endswith("; proved to have no solution: me")


def test_what_standard_leaves_and_half_solve_is_run_for_longer_and_hard() -> None:
    rows = [candidate(f"a/A{k}/0000") for k in range(6)]
    ran(rows[0], 1)  # difficult
    for row, solved in zip(rows[1:], (4, 4, 4, 5, 8), strict=True):
        ran(row, solved)
    rule = select.Rule(standard=2, clusters=2, difficult=0)
    # which are open is known first
    assert select.for_longer(rows, rule) == [0]
    ran(rows[0], 2, limit=60.0)
    chosen = select.choose(rows, rule)
    left = [k for k in (1, 2, 3) if not chosen.set[k]]
    assert left
    assert select.for_longer(rows, rule) == [0, *left]
    assert all(chosen.why[k].endswith("; not run with a limit of 60 s") for k in left)
    # `standard` stays as it is, whatever these runs give
    ran(rows[left[0]], 4, limit=60.0)
    for k in left[1:]:
        ran(rows[k], 5, limit=60.0)
    again = select.choose(rows, rule)
    assert again.of("standard") == chosen.of("standard")
    assert left[0] in again.of("hard")
    assert not set(left[1:]) & set(again.of("hard"))


def test_further_ones_of_a_hard_family_are_measured_and_are_no_part_of_standard() -> None:
    rows = [candidate(f"{family}/{family}/{k:04d}") for family in "ab" for k in range(40)]
    first = [k for k, words in enumerate(select.not_measured(rows)) if not words]
    hard = [k for k in first if rows[k]["scene"] == "a"][:2]  # a quarter of those measured
    for k in first:
        ran(rows[k], 2 if k in hard else 5)
    measured = [k for k, words in enumerate(select.not_measured(rows, RULE)) if not words]
    assert set(first) < set(measured)
    assert Counter(rows[k]["scene"] for k in measured) == {
        "a": select.MEASURED + select.FURTHER,
        "b": select.MEASURED,
    }
    before = select.choose(rows, RULE)
    further = sorted(set(measured) - set(first))
    assert all(before.why[k] == "not run with a limit of 10 s" for k in further)
    for k, solved in zip(further, (0, 0, 1, 4, 5, 8, 8, 8), strict=True):
        ran(rows[k], solved)
    assert select.for_longer(rows, RULE) == further[:3]  # those that few solve
    for k, solved in zip(further, (0, 1, 2, 4), strict=False):
        ran(rows[k], solved, limit=60.0)
    after = select.choose(rows, RULE)
    assert after.of("standard") == before.of("standard") != []
    assert [after.set[k] for k in further] == ["open", "hard", "hard", "hard", "", "", "", ""]
    assert after.why[further[-1]] == "for hard and open alone: 8 of 8 solvers in 10 s"


def test_the_hardest_come_first_and_six_of_a_family() -> None:
    rows = [ran(ran(candidate(f"a/A/{k:04d}"), 0), 1, 60.0, cost=1.0 + k) for k in range(8)]
    rows += [ran(ran(candidate("b/B/0000"), 0), 2, 60.0), ran(candidate("c/C/0000"), 5)]
    choice = select.choose(rows, select.Rule(standard=1, clusters=1, difficult=0, hard=7))
    hard = choice.of("hard")
    inside = set(hard) | set(choice.of("standard"))
    # of eight that as many solve, those whose fastest solver is slowest
    assert [k for k in range(8) if k in hard] == [k for k in range(2, 8) if k in inside]
    assert choice.why[0] == "hard has 6 of A already, which are harder"


def test_each_candidate_has_a_reason_and_the_choice_is_repeated(
    chosen: tuple[list[dict[str, Any]], select.Chosen], tmp_path: Path
) -> None:
    rows, choice = chosen
    assert all(choice.why)
    select.write_table(tmp_path / "a.csv", rows)
    stored = select.read_table(tmp_path / "a.csv")
    assert select.choose(stored, RULE).set == select.choose(stored, RULE).set
    order = np.random.default_rng(0).permutation(len(rows))
    select.write_table(tmp_path / "b.csv", [rows[k] for k in order])
    assert (tmp_path / "b.csv").read_text() == (tmp_path / "a.csv").read_text()
    counts = {row["candidates"]: row["problems"] for row in select.counts_of(choice)}
    assert counts["all"] == len(rows) == sum(counts.values()) - counts["all"]
    assert counts["standard"] == 240


def test_the_published_choices_follow_from_their_tables() -> None:
    root = published.root()
    tables = sorted((root.parent / ratings.FOLDER).glob("choice-*.csv")) if root else []
    if not tables:
        pytest.skip("no choice by this rule is published yet")
    for path in tables:
        rows = select.read_table(path)
        choice = select.choose(rows, RULE)
        assert [row["set"] for row in rows] == choice.set
        version = path.stem.rpartition("-")[2]
        for name in select.SETS:
            listed = {c.digest for c in set_index.listed(name, version)}
            assert listed == {rows[k]["digest"] for k in choice.of(name)}


# ---- stores


def add(
    store: Path, row: dict[str, Any], solver: str, seconds: float | None, **settings: Any
) -> None:
    """A run of a planted store; without a time it has failed."""
    facts = facts_of(row["digest"], row["problem"], family=row["scene"])
    how: dict[str, Any] = {"tol": 1e-8, "merit": "both", "renumber": True}
    add_run(store, facts, solver, seconds, **how, **settings)


def test_stores_say_who_solves_what_and_the_best_error(tmp_path: Path) -> None:
    rows = [candidate(f"a/A/{k:04d}") for k in range(3)]
    short, long = tmp_path / "short.sqlite", tmp_path / "long.sqlite"
    add(short, rows[0], "nsgs", 1.0)
    add(short, rows[0], "nsgs", 3.0, repeat=1)  # the renumbered copy
    add(short, rows[0], "apgd", 1.0)
    add(short, rows[0], "apgd", None, repeat=1)  # luck: its renumbered copy is not solved
    add(short, rows[0], "nsip", None, status="unsuitable")
    add(short, rows[1], "nsgs", None, error=1e-3)
    add(long, rows[1], "nsgs", None, limit=60.0, error=1e-4)
    add(long, rows[1], "auto", 50.0, limit=60.0)
    found = select.measured(rows, {10.0: short, 60.0: long})
    assert select.costs_of(found[0], 10.0) == {"nsgs": 3.0, "apgd": math.inf}
    assert select.share_solved(found[0], 10.0) == 0.5
    assert select.costs_of(found[1], 10.0) == {"nsgs": math.inf}
    assert select.costs_of(found[1], 60.0) == {"nsgs": math.inf, "auto": 50.0}
    assert (found[1]["best_error"], found[1]["best_by"]) == (5e-9, "auto, 60 s")
    assert select.is_difficult(found[1], RULE)
    assert not select.is_open(found[1])
    assert select.share_solved(found[2], 10.0) is None


def test_what_was_accepted_closes_a_problem() -> None:
    rows = [candidate(f"a/A/{k:04d}", digest=str(k) * 64) for k in range(3)]
    runs = [
        ratings.Run(row["digest"][: ratings.DIGITS], "me", "", None, status, error, None, "")
        for row, status, error in zip(
            rows, (ratings.TAKEN, "infeasible"), (1e-12, None), strict=False
        )
    ]
    found = select.measured(rows, {}, runs)
    assert [select.is_open(row) for row in found] == [False, False, True]
    assert [row["best_by"] for row in found] == ["me", "", ""]
    assert [row["best_error"] for row in found] == [1e-12, None, None]


def test_runs_of_several_machines_are_taken(tmp_path: Path) -> None:
    rows = [candidate(f"a/A/{k:04d}") for k in range(2)]
    store = tmp_path / "short.sqlite"
    add(store, rows[0], "nsgs", 1.0)
    add(store, rows[1], "nsgs", 2.0, node="there")
    add(store, rows[1], "apgd", None, node="there")
    found = select.measured(rows, {10.0: store})
    assert select.costs_of(found[0], 10.0) == {"nsgs": 1.0}
    assert select.costs_of(found[1], 10.0) == {"nsgs": 2.0, "apgd": math.inf}


def test_campaigns_measure_what_the_rule_reads() -> None:
    for limit, (name, folder) in difficulty.CAMPAIGNS.items():
        campaign = Campaign.read(name)
        assert {group.limits.time for group in campaign.groups} == {limit}
        assert {group.tolerances for group in campaign.groups} == {(1e-8,)}
        assert campaign.merit == "both"
        assert f"/{folder}/" in campaign.groups[0].files[0]
    short = Campaign.read("difficulty")
    assert short.renumber
    assert (short.repeats, len(short.solvers)) == (2, 8)
    # of different kinds
    assert len({choice.family for choice in short.solvers}) >= 6


# ---- candidates, and the commands


def test_candidates_are_of_all_families() -> None:
    own = candidates.folders()
    sets = {folder.partition("/")[0] for folder in own}
    assert {"robots", "machines", "simulators", "decks", "rr9118", "rt444", "ladder"} <= sets
    assert not sets & set(candidates.CHOSEN)
    labels = [candidates.label_of(folder) for folder in own]
    assert len(set(labels)) == len(labels)
    assert candidates.label_of("rr9118/Bridge") == "Bridge_rr9118"
    assert candidates.label_of("masonry/Bridge") == "Bridge"
    missing = set(candidates.COSTLY)
    assert missing <= {folder for every in set_index.sets().values() for folder in every}


def test_candidates_are_spread() -> None:
    assert candidates.spread(range(10), 4) == (0, 3, 6, 9)
    assert candidates.spread([5, 7, 9], 9) == (5, 7, 9)
    found = candidates.candidates_of("local/LocalProblems", Path(), kept=5)
    assert len(found.numbers) == 5
    assert fclib.digest(found.problem(0))


def test_commands_measure_and_choose_and_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The whole way on two small families; a short campaign in place of that of hours."""
    work, out, states = tmp_path / "work", tmp_path / "lists", tmp_path / "package/trajectories"
    families = ("--family", "existence/ManySolutions", "--family", "simulators/SiconosBoxes")
    told = command("candidates", work, *families, "--estimate")
    assert told.exit_code == 0, told.output
    assert "2 of 2 families are to be described" in " ".join(told.output.split())
    assert not work.exists()
    monkeypatch.setattr(candidates.candidates_of, "__defaults__", (6, None))
    done = command("candidates", work, *families)
    assert done.exit_code == 0, done.output
    table = (work / difficulty.TABLE).read_text()
    rows = select.read_table(work / difficulty.TABLE)
    assert len(rows) == 12
    stay = [row for row, words in zip(rows, select.left_out(rows), strict=True) if not words]
    files = sorted((work / "problems").glob("*/*.hdf5"))
    assert sorted(difficulty.path_of(work, row) for row in stay) == files
    assert files
    for row in stay:
        assert fclib.digest(fclib.read(difficulty.path_of(work, row))) == row["digest"]

    # a family that fails is named, and the others are there
    def fails(*_: object) -> Any:
        raise ValueError("its states are damaged")

    with monkeypatch.context() as broken:
        broken.setattr(select, "describes", lambda own, found: "Siconos" not in found.label)
        broken.setattr(select, "described", fails)
        one = command("candidates", work, *families)
    assert one.exit_code == 1
    assert "simulators/SiconosBoxes: has no candidates" in " ".join(one.output.split())
    assert {row["label"] for row in select.read_table(work / difficulty.TABLE)} == {"ManySolutions"}
    assert command("candidates", work, *families).exit_code == 0
    # again, it changes nothing, and a file that was lost comes back
    files[0].unlink()
    again = command("candidates", work, *families)
    assert "0 of 2 families are to be described" in " ".join(again.output.split())
    assert files[0].is_file()
    assert (work / difficulty.TABLE).read_text() == table

    told = command("measure", work, "--estimate")
    runs = len(files) * 8 * 2
    assert f"{runs} runs on {len(files)} problems" in " ".join(told.output.split())
    for k, row in enumerate(stay):
        for solver in SOLVERS:
            solved = k > 0 and not (k == 1 and solver != "nsgs")
            add(work / "difficulty.sqlite", row, solver, 0.5 if solved else None)
    assert difficulty.link_difficult(work, RULE) == 2
    linked = {path.resolve() for path in (work / "difficult").glob("*/*.hdf5")}
    assert linked == {difficulty.path_of(work, row).resolve() for row in stay[:2]}
    told = command("measure", work, "--estimate")
    assert f"{8 * len(stay)} are done" in " ".join(told.output.split())
    for solver in SOLVERS:
        add(work / "difficulty-long.sqlite", stay[0], solver, None, limit=60.0)
    chosen = command("choose", work, "--out", out, "--states", states, "--version", 3)
    assert chosen.exit_code == 0, chosen.output
    lists = {name: json.loads((out / f"{name}.json").read_text()) for name in select.SETS}
    assert [row["digest"] for row in lists["open"]["problems"]] == [stay[0]["digest"]]
    assert lists["standard"]["rule"]["version"] == "3"
    reasons = select.read_table(states.parent / ratings.FOLDER / "choice-3.csv")
    assert len(reasons) == 12
    assert all(row["why"] for row in reasons)
    # a list that another version replaces stays
    later = command("choose", work, "--out", out, "--states", states, "--version", 4)
    assert later.exit_code == 0, later.output
    kept = json.loads((out / "older/open-3.json").read_text())
    assert kept == lists["open"]
    assert json.loads((out / "open.json").read_text())["rule"]["version"] == "4"
    # a choice that is there is not rewritten by another one
    assert command("choose", work, "--out", out, "--states", states, "--version", 3).exit_code == 0
    add(work / "difficulty-long.sqlite", stay[0], "auto", 1.0, limit=60.0)
    other = command("choose", work, "--out", out, "--states", states, "--version", 3)
    assert other.exit_code == 1
    assert "is another choice" in " ".join(other.output.split())


def test_versions_of_a_list_are_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one, two, three = (set_index.Choice("Wall", {}, 0, k, k, f"{k}") for k in (1, 2, 3))
    monkeypatch.setattr(set_index, "DATA", tmp_path)
    monkeypatch.setitem(set_index.SETS, "hard", ("9", "what few solvers solve"))
    (tmp_path / set_index.OLDER).mkdir()
    choose.write_list(tmp_path / set_index.OLDER / "hard-8.json", [one, two], {})
    choose.write_list(tmp_path / "hard.json", [three], {})
    set_index.choices.cache_clear()
    try:
        numbers = {
            version: [choice.number for choice in set_index.listed("hard", version)]
            for version in ("7", "8", "9", "own")
        }
    finally:
        set_index.choices.cache_clear()
    assert numbers == {"7": [], "8": [1, 2], "9": [3], "own": []}


def test_published_states_have_guesses_without_the_steps_before(tmp_path: Path) -> None:
    own = "robots/Gripper"
    if published.root() is None:
        pytest.skip("the package of trajectories is not here")
    found = candidates.candidates_of(own, tmp_path, kept=3)
    assert found.states is not None
    first, middle, _ = found.numbers
    digests = {n: found.states.digest[found.states.index(n)] for n in (first, middle, middle + 1)}
    chosen = [set_index.Choice("Gripper", {}, 0, n, n, text) for n, text in digests.items()]
    (path,) = select.publish({own: found}, chosen, "standard", "9", tmp_path)
    states = trajectory.read(path)
    # zero at the first contact, and the third one's step before is there
    guesses = states.guess
    assert guesses[0] is not None
    assert not guesses[0].any()
    assert guesses[2] is None
    # at rest, the step before has nearly the same reactions: they carry the weight
    problem = states.problem(1).problem
    assert guesses[1] is not None
    guess = fclib.Solution(r=guesses[1])
    assert (
        fclib.merit(problem, guess).error
        < 0.1 * fclib.merit(problem, fclib.Solution(r=0 * guess.r)).error
    )


# ---- sequences


def test_sequences_change_and_are_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [
        candidate(f"s/S{k:02d}/{number:04d}") for k in range(20) for number in range(0, 300, 20)
    ]
    for row in rows:
        if row["scene"] == "S03":  # at rest
            row["left_out"] = "trivial: r = 0 is a solution"
    monkeypatch.setattr(
        sequences, "window", lambda own, steps: None if own == "s/S04" else range(100, 100 + steps)
    )
    chosen = sequences.choose(rows, sequences.Rule())
    assert len(chosen) == 12
    assert {len(numbers) for _, numbers in chosen} == {100}
    assert not {"s/S03", "s/S04"} & {own for own, _ in chosen}
    assert chosen == sequences.choose(rows, sequences.Rule())
    few = [row for row in rows if row["scene"] < "S03"]
    assert len(sequences.choose(few, sequences.Rule())) == 3


def test_a_sequence_has_consecutive_states(tmp_path: Path) -> None:
    own = "rt444/Chain"
    if published.root() is None:
        pytest.skip("the package of trajectories is not here")
    numbers = sequences.window(own, 100)
    assert numbers is not None
    assert (numbers[0], len(numbers)) == (707, 100)
    # candidates are spread over all 1,514 problems; here it is these steps that are looked at
    rows = sequences.describe([own, "machines/Rover"], sequences.Rule(), tmp_path)
    assert [row["number"] for row in rows] == [*candidates.spread(numbers, sequences.SAMPLE)]
    assert rows == sequences.describe([own], sequences.Rule(), tmp_path)
    assert sequences.window("machines/Rover", 100) is None
    # every third step, and of these what is hard
    assert sequences.window("rt444/KaplasTower", 100) is None
    assert sequences.window("existence/Squeezed", 10) is None
    found = sequences.states_of(own, numbers, tmp_path)
    choices = sequences.choices_of(found)
    assert [choice.number for choice in choices] == list(numbers)
    (path,) = select.publish({own: found}, choices, "sequences", "1", tmp_path)
    states = trajectory.read(path)
    assert np.diff(states.step).tolist() == [1] * 99
    assert states.digest == tuple(choice.digest for choice in choices)
