"""The tables that pages quote of campaigns: made from the runs of a small one."""

from __future__ import annotations

import argparse
import csv
import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import bench
from fclib.bench import comparison, profiles
from workshop.tables import campaign as tables
from workshop.tables import siconos_in_a_loop

pytest.importorskip("mujoco", reason="simulates")

RESULTS = Path(__file__).parents[2] / "docs" / "results"
# solvers of ours in place of those of Siconos, under their names
SOLVERS: list[Any] = [
    "auto",
    "nsgs",
    "nsn-ac",
    {"name": "psor", "label": "siconos:nsgs"},
    {"name": "ppa-nsn", "label": "siconos:nsn-ac"},
]


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Steps of a falling stack, one after the other, to two tolerances."""
    path = tmp_path_factory.mktemp("campaign") / "runs.sqlite"
    simulated = {"family": "BoxesStack", "parameters": {"boxes": 4, "gap": 0.01}}
    entries = {
        "solvers": SOLVERS,
        "tolerances": [1e-4, 1e-8],
        "time_limit": 5.0,
        "problems": [{"simulate": {**simulated, "steps": [30, 31, 60]}, "sequence": {}}],
    }
    bench.run_campaign(bench.Campaign.of(entries), path)
    return path


def made(store: Path, table: str, **asked: Any) -> list[tables.Table]:
    """The tables of a kind."""
    options = {"by_set": False, "columns": None} | asked
    return tables.TABLES[table](store, argparse.Namespace(**options))


def columns_of(name: str) -> list[str]:
    """Those of a table of the pages."""
    with (RESULTS / f"{name}.csv").open(newline="") as file:
        return next(csv.reader(file))


def cold(store: Path) -> list[dict[str, Any]]:
    """The runs that count, to the tighter tolerance."""
    return [row for row in profiles.load(store) if row["tol"] == 1e-8]


def test_the_tables_have_the_columns_of_the_pages(store: Path) -> None:
    (along,) = made(store, "along")
    (hindsight,) = made(store, "hindsight")
    (runs,) = made(store, "runs")
    pairs = made(store, "pairs")
    assert list(along.rows[0]) == columns_of("sequences")
    assert list(hindsight.rows[0]) == columns_of("beside-siconos")
    assert list(runs.rows[0]) == columns_of("walls")
    assert [table.ending for table in pairs] == ["-1e-4", "-1e-8"]
    assert list(pairs[1].rows[0]) == columns_of("solvers-beside-siconos-1e-8")
    for name, by_set in (
        ("packings", False),
        ("mass-ratios", False),
        ("accurate", True),
        ("accurate-rt444", True),
    ):
        columns = columns_of(name)
        (ends,) = made(store, "ends", by_set=by_set, columns=columns)
        assert list(ends.rows[0]) == columns
    with pytest.raises(SystemExit, match="no column 'set'"):
        made(store, "ends", columns=["set"])


def test_auto_beside_the_fastest_of_siconos(store: Path) -> None:
    spent: dict[str, dict[str, float]] = {}
    for row in cold(store):
        assert row["status"] == "converged"
        spent.setdefault(row["hash"], {})[row["solver"]] = row["cpu_s"]
    ratios = [
        own["auto"] / min(own["siconos:nsgs"], own["siconos:nsn-ac"]) for own in spent.values()
    ]
    (table,) = made(store, "hindsight")
    figures = {row["figure"]: row["value"] for row in table.rows}
    assert figures["problems"] == figures["solved by both"] == len(ratios) == 3
    mean = math.exp(sum(map(math.log, ratios)) / len(ratios))
    assert float(figures["geometric mean of CPU ratios"]) == pytest.approx(mean, abs=1e-3)
    assert float(figures["worst CPU ratio"]) == pytest.approx(max(ratios), abs=1e-3)
    assert figures["solved by both from 100 contacts on"] == 0


def test_what_siconos_does_not_take_is_not_compared() -> None:
    """Of what neither solves, nothing; of what one alone solves, that it does."""
    inf, nan = math.inf, math.nan
    values = np.array(
        #  auto, two of Siconos, another
        [[1, 2, 4, 9], [1, inf, inf, 9], [inf, inf, 3, 9], [1, nan, nan, 9], [nan, 1, 1, 9]],
        dtype=float,
    )
    instances = tuple(
        comparison.Instance(str(k), str(k), "Chain", 100, 1e-8, 10.0) for k in range(len(values))
    )
    solvers = ("auto (1)", "siconos:nsgs", "siconos:prox", "scs:aclm")
    costs = comparison.Costs(instances, solvers, values, "cpu_s")
    figures = {row["figure"]: row["value"] for row in tables.beside_siconos(costs)}
    assert (figures["problems"], figures["solved by both"]) == (3, 1)
    assert figures["solved by auto alone"] == figures["solved by one of Siconos alone"] == 1
    assert figures["geometric mean of CPU ratios"] == "0.500"
    assert tables.beside_siconos(costs.chosen(solvers[:1])) == []


def test_solvers_beside_those_of_the_same_family(store: Path) -> None:
    table = made(store, "pairs")[1]
    rows = {(row["ours"], row["Siconos'"]): row for row in table.rows}
    # of what was not run there is no row
    assert set(rows) == {("nsgs", "nsgs"), ("nsn-ac", "nsn-ac"), ("auto", "none")}
    spent: dict[str, list[float]] = {}
    for row in sorted(cold(store), key=lambda row: row["hash"]):
        spent.setdefault(row["solver"], []).append(row["cpu_s"])
    ratios = np.array(spent["nsgs"]) / np.array(spent["siconos:nsgs"])
    own = rows["nsgs", "nsgs"]
    assert own["solved"] == "3 : 3"
    assert own["median CPU ratio (of)"] == f"{np.median(ratios):.3f} (3)"
    assert rows["auto", "none"]["solved"] == "3"
    fastest = [row["fastest on"].split(" : ") for row in table.rows]
    assert sum(int(word) for words in fastest for word in words) == 3


def test_what_ends_the_runs(store: Path) -> None:
    (table,) = made(store, "ends")
    assert {row["solver"] for row in table.rows} == {"auto", "nsgs", "nsn-ac"} | {
        "siconos:nsgs",
        "siconos:nsn-ac",
    }
    for row in table.rows:
        assert row["family"] == "BoxesStack"
        assert row["problems"] == row["solved"] == 6  # at two tolerances
        assert row["errors of those"] == ""
        assert bool(row["last stages"]) == (row["solver"] == "auto")
    (by_set,) = made(store, "ends", by_set=True)
    assert {row["set"] for row in by_set.rows} == {"rt444"}


def test_an_end_is_told_by_its_word() -> None:
    run = {"status": "converged", "message": "", "error": 1e-9, "nc": 4, "time_limit": 5.0}
    run |= {"total_cpu_s": 1.0, "iterations": 7, "stages": None, "solver_family": "newton"}
    coarse = f"{tables.COARSE} for the tolerance"
    runs = [
        run,
        run | {"status": "infeasible", "nc": 9, "total_cpu_s": 2.0, "iterations": 9},
        run | {"status": "stalled", "message": coarse, "error": 1e-7, "total_cpu_s": 6.0},
        run | {"status": "cpu_limit", "message": None, "error": 3e-2, "total_cpu_s": 5.0},
    ]
    row = tables.ending("some", "nsn-ac", runs)
    words = ("problems", "solved", "no solution", "ended by rounding", "others")
    assert [row[word] for word in words] == [4, 1, 1, 1, 1]
    assert (row["contacts"], row["errors of those"]) == ("4 to 9", "1e-07 to 3e-02")
    assert (row["median CPU of the solved [s]"], row["median CPU [s]"]) == (1.5, 3.5)
    assert (row["largest CPU [s]"], row["CPU of all [s]"]) == (6.0, 14.0)


def test_a_solve_that_rounding_ends_is_told_from_others(tmp_path: Path) -> None:
    """By the message of the solve, which the store keeps."""
    path = tmp_path / "runs.sqlite"
    entries = {
        "solvers": ["nsgs"],
        "tolerances": [1e-3, 1e-17],
        "time_limit": 5.0,
        "problems": [{"planted": {"count": 1, "contacts": 9, "seed": 3}}],
    }
    bench.run_campaign(bench.Campaign.of(entries), path)
    (table,) = made(path, "ends")
    (row,) = table.rows
    words = ("problems", "solved", "ended by rounding", "others")
    assert [row[word] for word in words] == [2, 1, 1, 0]


def test_the_time_grows_by_an_exponent(store: Path) -> None:
    (table,) = made(store, "runs")
    families = {row["family"] for row in table.rows}
    for family, solver in itertools.product(families, ("auto", "nsgs")):
        own = [r for r in table.rows if (r["family"], r["solver"]) == (family, solver)]
        assert own[0]["exponent"] == ""
        for before, row in itertools.pairwise(own):
            if row["contacts"] == before["contacts"]:
                assert row["exponent"] == ""
                continue
            grown = math.log(row["CPU [s]"] / before["CPU [s]"])
            size = math.log(row["contacts"] / before["contacts"])
            assert row["exponent"] == pytest.approx(grown / size)
    auto = [row["factorisations"] for row in table.rows if row["solver"] == "auto"]
    assert all(count >= 0 for count in auto)


@pytest.mark.parametrize("name", ["pairs", "hindsight"])
def test_without_siconos_there_is_no_table_beside_it(tmp_path: Path, name: str) -> None:
    path = tmp_path / "runs.sqlite"
    entries = {
        "solvers": ["nsgs", {"name": "bb", "label": "new"}],
        "problems": [{"planted": {"count": 1, "contacts": 4}}],
    }
    bench.run_campaign(bench.Campaign.of(entries), path)
    with pytest.raises(SystemExit, match="PAIRS has no new" if name == "pairs" else "no runs of"):
        made(path, name)


def test_the_problems_of_a_loop_are_those_that_siconos_takes(tmp_path: Path) -> None:
    one = fclib.LocalProblem(W=np.eye(3), q=[-1.0, 2.0, 0.0], mu=[0.5])
    two = fclib.LocalProblem(W=np.eye(6), q=[-1.0, 2.0, 0.0] * 2, mu=[0.5, 0.5])
    planar = fclib.LocalProblem(W=np.eye(4), q=[-1.0, 2.0] * 2, mu=[0.5, 0.5], spacedim=2)
    smooth = fclib.LocalProblem(W=np.eye(6), q=[-1.0, 2.0, 0.0] * 2, mu=[0.0, 0.0])
    for name, problem in {"0": one, "1": planar, "2": smooth, "3": two, "4": two}.items():
        fclib.write(tmp_path / f"{name}.hdf5", problem)
    files = sorted(tmp_path.glob("*.hdf5"))
    taken = [path.stem for path, _ in siconos_in_a_loop.taken(files, (2, 5), 1)]
    assert taken == ["3"]
    assert [path.stem for path, _ in siconos_in_a_loop.taken(files, (1, 5), 9)] == ["0", "3", "4"]


def test_where_the_time_goes() -> None:
    rows = siconos_in_a_loop.where_the_time_goes([{"a_b": 0.6, "c": 0.4}, {"a_b": 0.2}])
    told = {row["stage"]: tuple(row.values())[1:] for row in rows}
    assert told == {
        "a b": ("0.400", 2, 1),
        "outside the stages": ("0.400", 1, 1),
        "c": ("0.200", 1, 0),
    }
    assert siconos_in_a_loop.where_the_time_goes([]) == []
