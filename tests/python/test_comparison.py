"""What an instance is, what solved means, and which set is compared: by what commands print."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import helpers_cli
from fclib.bench import ProblemFacts, Progress, Record, Store
from helpers_bench import add_run, facts_of
from helpers_cli import tables

LIMIT = 10.0


def facts(
    name: str,
    family: str = "Family",
    form: str = "local",
    folder: str = "/there/set",
    digest: str = "",
) -> ProblemFacts:
    """A problem that is nowhere but in a store."""
    return facts_of(
        (digest or f"{family}{name}{form}").ljust(64, "0"),
        f"{name}-{form}",
        family=family,
        path=f"{folder}/{family}/{name}-{form}.hdf5",
        kind=form,
        formulation="G3DFC" if form == "global" else "3DFC",
        n=6,
    )


def solved(rows: Sequence[dict[str, Any]]) -> dict[str, tuple[int, int]]:
    """By solver how many instances it solves, of how many."""
    return {row["solver"]: (row["solved"], row["of"]) for row in rows}


@pytest.fixture
def store(tmp_path: Path) -> Path:
    return tmp_path / "runs.sqlite"


# ---- which set is compared


def test_a_solver_that_takes_the_easy_part_is_not_ranked_first(store: Path) -> None:
    """It is slower than another one on each problem that it takes."""
    for k in range(8):
        easy = k < 6
        add_run(store, facts(f"{k:04d}"), "apgd", 2.7e-4 if easy else 1.0)
        add_run(
            store,
            facts(f"{k:04d}"),
            "plugin",
            7.5e-4 if easy else None,
            "" if easy else "unsuitable",
        )
    rows = tables(store)["summary"]
    assert [row["solver"] for row in rows] == ["virtual best", "apgd", "plugin"]
    assert solved(rows) == {"virtual best": (6, 6), "apgd": (6, 6), "plugin": (6, 6)}
    means = {row["solver"]: row["mean"] for row in rows}
    assert means["plugin"] / means["apgd"] == pytest.approx(7.5 / 2.7)
    own = tables(store, "--own-set")["summary"]
    assert solved(own) == {"virtual best": (8, 8), "apgd": (8, 8), "plugin": (6, 6)}
    counted = tables(store, "--count-unsuitable")["summary"]
    assert solved(counted)["plugin"] == (6, 8)


def test_a_solver_with_few_runs_takes_nothing_from_the_others(store: Path) -> None:
    for k in range(6):
        for name in ("apgd", "nsgs"):
            add_run(store, facts(f"{k:04d}"), name, 1.0)
    add_run(store, facts("0000"), "rare", 0.1)
    found = tables(store)
    assert set(solved(found["summary"])) == {"virtual best", "apgd", "nsgs"}
    assert solved(found["summary"])["apgd"] == (6, 6)
    assert solved(found["left out"]) == {"rare": (1, 1)}
    # unless it is asked for
    asked = tables(store, "--solver", "rare", "--solver", "apgd")["summary"]
    assert solved(asked) == {"virtual best": (1, 1), "apgd": (1, 1), "rare": (1, 1)}
    shown = helpers_cli.run("profile", str(store)).stdout
    assert "Not compared" in shown
    assert "--solver apgd --solver nsgs --solver rare" in shown


def test_a_legend_says_how_many_of_how_many(store: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    for k in range(3):
        for tol in (1e-4, 1e-6):
            add_run(store, facts(f"{k:04d}"), "apgd", 1.0, tol=tol)
            add_run(store, facts(f"{k:04d}"), "nsgs", 1.0 if k else None, tol=tol)
    helpers_cli.run("profile", str(store), "--out", str(tmp_path), "--format", "svg")
    drawn = sorted(tmp_path.glob("*.svg"))
    assert len(drawn) == 7
    for path in drawn:
        text = path.read_text()
        assert "apgd 3 of 3" in text, path.name
        assert "nsgs 2 of 3" in text, path.name


def test_a_format_of_pictures_is_known_before_anything_is_written(
    store: Path, tmp_path: Path
) -> None:
    pytest.importorskip("matplotlib")
    add_run(store, facts("0000"), "apgd", 1.0)
    out = tmp_path / "figures"
    said = helpers_cli.run("profile", store, "--out", out, "--format", "foo", code=1)
    assert "'foo' is no format of pictures; there is: eps," in said.stderr
    assert not said.stdout
    assert not out.exists()


def test_a_comparison_of_nothing_says_what_to_do(store: Path) -> None:
    add_run(store, facts("0000"), "apgd", 1.0)
    add_run(store, facts("0001"), "nsgs", 1.0)
    done = helpers_cli.run("profile", str(store), code=1)
    assert "--own-set" in done.stderr


# ---- what solved means


def test_a_proof_that_was_checked_is_a_success(store: Path) -> None:
    add_run(store, facts("0000"), "auto", 0.5, "infeasible")
    add_run(store, facts("0000"), "nsgs", None)
    assert solved(tables(store)["summary"]) == {
        "virtual best": (1, 1),
        "auto": (1, 1),
        "nsgs": (0, 1),
    }
    with Store(store) as opened:
        opened.begin("made", "", 2, 0, "here")
        assert Record(status="infeasible").solved
    progress = Progress(
        planned=3, skipped=0, statuses=Counter(infeasible=1, converged=1, stalled=1)
    )
    assert progress.solved == 2


# ---- what an instance is


def test_both_forms_of_a_problem_are_one(store: Path) -> None:
    for k in range(3):
        for form in ("global", "local"):
            # the local form is quicker, and is not the one that counts
            add_run(store, facts(f"{k:04d}", form=form), "apgd", 2.0 if form == "global" else 1.0)
            takes = form == "local"
            add_run(
                store,
                facts(f"{k:04d}", form=form),
                "plugin",
                3.0 if takes else None,
                "" if takes else "unsuitable",
            )
    rows = tables(store)["summary"]
    assert solved(rows) == {"virtual best": (3, 3), "apgd": (3, 3), "plugin": (3, 3)}
    means = {row["solver"]: row["mean"] for row in rows}
    assert means["apgd"] == pytest.approx(2.0)
    assert means["plugin"] == pytest.approx(3.0)
    both = tables(store, "--forms", "both", "--own-set")["summary"]
    assert solved(both) == {"virtual best": (6, 6), "apgd": (6, 6), "plugin": (3, 3)}
    (family,) = tables(store)["families"]
    assert family["problems"] == 3


def test_problems_of_one_name_are_two(store: Path) -> None:
    # two versions of a family, and two sets that have a family of one name
    for folder, digest in (("/a/set", "one"), ("/b/set", "two"), ("/a/other", "three")):
        for form in ("global", "local"):
            problem = facts("0001", form=form, folder=folder, digest=f"{digest}-{form}")
            add_run(store, problem, "apgd", 1.0)
    rows = tables(store)["summary"]
    # of set/Family/0001 nothing tells which forms belong together
    assert solved(rows)["apgd"] == (5, 5)


def test_each_tolerance_has_its_own_table(store: Path) -> None:
    for k in range(4):
        add_run(store, facts(f"{k:04d}"), "apgd", 1.0, tol=1e-4)
        add_run(store, facts(f"{k:04d}"), "apgd", 8.0 if k else None, tol=1e-8)
    found = tables(store)
    assert [(row["tol"], row["solver"], row["solved"]) for row in found["summary"]] == [
        *((1e-4, "virtual best", 4), (1e-4, "apgd", 4)),
        *((1e-8, "virtual best", 3), (1e-8, "apgd", 3)),
    ]
    for name in ("profile", "statuses", "shifts", "accuracies"):
        assert [row["tol"] for row in found[name]] == [1e-4, 1e-8], name


# ---- what weighs the same


def test_a_large_family_decides_no_mean(store: Path) -> None:
    for k in range(9):
        add_run(store, facts(f"{k:04d}", "Large"), "apgd", 1.0)
        add_run(store, facts(f"{k:04d}", "Large"), "nsgs", 4.0)
    add_run(store, facts("0000", "Small"), "apgd", 100 * 1e-1)
    add_run(store, facts("0000", "Small"), "nsgs", None)
    of = {row["solver"]: row for row in tables(store, "--shift", "1e-9")["summary"]}
    assert of["apgd"]["mean"] == pytest.approx(math.sqrt(1.0 * 10.0), rel=1e-6)
    assert of["nsgs"]["mean"] == pytest.approx(math.sqrt(4.0 * 10 * LIMIT), rel=1e-6)
    assert of["nsgs"]["share"] == pytest.approx(0.5)
    assert (of["nsgs"]["solved"], of["nsgs"]["of"]) == (9, 10)
    arguments = ("--shift", "1e-9", "--weigh", "instances")
    of = {row["solver"]: row for row in tables(store, *arguments)["summary"]}
    assert of["apgd"]["mean"] == pytest.approx(10.0 ** (1 / 10), rel=1e-6)
    assert of["nsgs"]["share"] == pytest.approx(0.9)


def test_renumbered_copies_are_one_instance_and_the_median_counts() -> None:
    from fclib.bench import profiles

    def row(solver: str, copy: int, seconds: float | None, repeat: int = 0) -> dict[str, Any]:
        return {
            **{"solver": solver, "hash": "one", "problem": "one", "family": "f", "nc": 3},
            **{"tol": 1e-6, "time_limit": LIMIT, "copy": copy, "repeat": repeat},
            "status": "converged" if seconds else "stalled",
            **dict.fromkeys(profiles.METRICS, seconds),
        }

    rows = [row("A", 0, 1.0), row("A", 1, 5.0), row("A", 1, 4.0, 1), row("A", 2, 9.0)]
    rows += [row("B", 0, 2.0), row("B", 1, None), row("B", 2, None)]
    costs = profiles.costs(rows)
    assert costs.values.tolist() == [[4.0, math.inf]]
    _, a, b = profiles.summary(costs)
    assert (a["solved"], a["of"], b["solved"]) == (1, 1, 0)
    # from 1 s to 9 s over the copies; of one of them two repeats differ by a quarter
    assert (a["copies"], a["spread"]) == (8.0, 0.25)


def test_an_interval_of_families_that_weigh_the_same_is_over_families() -> None:
    from fclib.bench import profiles

    def rows(family: str, ratio: float) -> list[dict[str, Any]]:
        made = {"nc": 3, "tol": 1e-6, "time_limit": LIMIT, "status": "converged", "family": family}
        made |= {"hash": family, "problem": family}
        times = {"A": ratio, "B": 1.0}
        return [
            made | {"solver": name, **dict.fromkeys(profiles.METRICS, time)}
            for name, time in times.items()
        ]

    costs = profiles.costs([*rows("one", 4.0), *rows("two", 0.25)])
    (pair,) = profiles.pairs(costs, weigh="families")
    assert pair.ratio == pytest.approx(1)
    assert [pair.low, pair.high] == pytest.approx([0.25, 4])
    low, high = profiles.bands(costs, costs.values, np.array([1.0]), "families")
    assert (low.tolist(), high.tolist()) == ([[0], [1]], [[1], [1]])
