"""The readable report of published runs, submissions, and the leaderboard."""

from __future__ import annotations

import base64
import csv
import gzip
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import fclib
from fclib import _digest, bench
from fclib.bench import calibration, comparison, machine

pytest.importorskip("pyarrow")

from fclib import results
from fclib.collections import set_index
from fclib.collections.set_index import Choice
from fclib.results import boards
from helpers import dense, planted_global, planted_local
from helpers_cli import invoke
from workshop.tables import _results, problem_facts, published, published_2018

PLANTED = {"planted": {"count": 8, "contacts": 4, "seed": 1}, "family": "Chain"}
PLAN = {
    "name": "small",
    "solvers": ["nsgs", "apgd", "nsn-ac"],
    "tolerances": [1e-8],
    "from_history": [1e-4],
    "repeats": 2,
    "repeated": 0.7,
    "renumber": True,
    "problems": [PLANTED],
}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The store of a campaign, beside the folder of its problems."""
    folder = tmp_path_factory.mktemp("published")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FCLIB_CACHE", str(folder / "cache"))
        calibration.save(calibration.calibrate(0.05))
        bench.run_campaign(bench.Campaign.of(PLAN), folder / "small.sqlite")
    machine.facts.cache_clear()  # those of other tests have no calibration
    return folder


def said(*words: object, code: int = 0) -> str:
    return str(invoke(*words, code=code).output)


def test_a_submission_is_judged_again(run: Path, tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    store = run / "small.sqlite"
    part = Path(said("results", "submit", store, "--name", "small", "--out", tmp_path).strip())
    assert results.verify(part) == []
    verdicts = results.judged(part, [run / "cache"])
    assert Counter(row["status"] for row in verdicts) == {"ok": 18}  # three solvers, six problems
    assert "ok" in said("results", "verify", part, "--problems", run / "cache")
    missing = said("results", "verify", part, "--problems", tmp_path, code=1)
    assert "so it is not judged" in missing
    assert "is no folder" in said("results", "verify", part, "--problems", "nowhere", code=1)
    # whoever claims a solution that is none is found
    table = pq.read_table(part)
    rows = table.to_pylist()
    own = next(row for row in rows if row["r"])
    own["r"] = bytes(len(own["r"]))
    pq.write_table(type(table).from_pylist(rows, schema=table.schema), part)
    assert [row["status"] for row in results.judged(part, [run])].count("wrong") == 1
    said("results", "verify", part, "--problems", run / "cache", code=1)
    # what is no vector is told, and ends nothing
    for content in (own["r"][:7], own["r"][:8], None):
        own["r"] = content
        pq.write_table(type(table).from_pylist(rows, schema=table.schema), part)
        found = [row for row in results.judged(part, [run]) if row["status"] == "wrong"]
        assert len(found) == (content is not None)
        assert all(row["why"] for row in found)
    plain_rows = pq.read_table(part).drop_columns(["l"])
    pq.write_table(plain_rows, part)
    assert {row["status"] for row in results.judged(part, [run])} == {"ok"}
    pq.write_table(plain_rows.slice(0, 1), part)
    with pytest.raises(results.ShardError, match="and 5 are asked for"):
        results.judged(part, [run])
    # a plain part has none
    with bench.Store(store) as opened:
        plain = results.pack(opened, tmp_path / "parts", "small")
    assert plain is not None
    with pytest.raises(results.ShardError, match="has 0 solutions to judge"):
        results.judged(plain, [run])


def test_the_leaders_of_a_set(run: Path, tmp_path: Path) -> None:
    with bench.Store(run / "small.sqlite") as opened:
        results.pack(opened, tmp_path, "small", "fast")
    rows = results.leaders(results.shards(tmp_path))
    assert {(row["set"], row["tol"], row["solver"]) for row in rows} == {
        ("small", tol, solver) for tol in (1e-4, 1e-8) for solver in ("nsgs", "apgd", "nsn-ac")
    }
    for row in rows:
        assert (row["of"], row["machine"]) == (8, "fast")
        assert row["version"].startswith("1.")
    shares = [row["share"] for row in rows if row["tol"] == 1e-8]
    assert shares == sorted(shares, reverse=True)
    assert "nsn-ac" in said("results", "leaders", "--in", tmp_path)


def test_a_name_of_a_built_in_solver_is_not_taken(run: Path, tmp_path: Path) -> None:
    plan = {**PLAN, "solvers": [{"name": "apgd", "label": "nsgs"}], "name": "taken"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FCLIB_CACHE", str(run / "cache"))
        machine.facts.cache_clear()
        bench.run_campaign(bench.Campaign.of(plan), tmp_path / "taken.sqlite")
    machine.facts.cache_clear()
    submitted = said("results", "submit", tmp_path / "taken.sqlite", "--name", "a",
                     "--out", tmp_path / "out", code=1)  # fmt: skip
    assert "calls apgd nsgs, which is another solver" in " ".join(submitted.split())
    assert not list((tmp_path / "out").glob("*"))


def test_published_runs_are_asked_for_before_a_campaign(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with bench.Store(run / "small.sqlite") as opened:
        part = results.pack(opened, tmp_path / "parts", "small", "fast")
    own = tmp_path / "own.toml"
    own.write_text('solvers = ["bb"]\n[[problems]]\nplanted = { count = 1 }\n')
    monkeypatch.setenv("FCLIB_CACHE", str(tmp_path / "cache"))  # where no calibration is
    machine.facts.cache_clear()
    store = tmp_path / "own.sqlite"
    words = ["bench", own, "--solver", "bb", "--store", store, "--with"]
    assert "was not calibrated" in said(*words, part, code=1)
    assert "nowhere.parquet" in said(*words, "nowhere.parquet", code=1)
    assert not store.exists()
    mine = run / "small.sqlite"
    assert "--campaign" in said("profile", mine, "--with", part, "--campaign", "small", code=2)
    assert "there is: small" in said("profile", "--with", part, "--set", "large", code=1)
    assert "84 published runs" in said("profile", "--with", part, "--set", "small")
    machine.facts.cache_clear()


def test_the_page_is_made_of_parts(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All that the page quotes is there."""
    with bench.Store(run / "small.sqlite") as opened:
        results.pack(opened, tmp_path / "parts", "mine", "fast")
    (tmp_path / "images").mkdir()
    page = tmp_path / "published-results.md"
    monkeypatch.setattr(_results, "FOLDER", tmp_path / "results")
    monkeypatch.setattr(published, "IMAGES", tmp_path / "images")
    monkeypatch.setattr(published, "PAGE", page)
    monkeypatch.setattr("sys.argv", ["published", "--parts", str(tmp_path / "parts")])
    published.main()
    text = page.read_text()
    quoted = {path.stem for path in (tmp_path / "results").glob("*.csv")}
    assert all(f"(results/{name}.csv)" in text for name in quoted)
    assert {"published-parts", "published-noise", "published-best"} <= quoted
    for path in (tmp_path / "images").glob("*.png"):
        assert f"images/{path.name}" in text
    with (tmp_path / "results" / "published-parts.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert (row["runs"], row["read off histories"], row["problems"]) == ("84", "42", "8")
    # a set beside it that others ran on, and did not solve
    monkeypatch.setenv("FCLIB_CACHE", str(run / "cache"))
    plan = {**PLAN, "name": "other", "solvers": ["nsip", "bb"], "tolerances": [1e-17]}
    plan["time_limit"] = 0.2  # nothing reaches this tolerance
    bench.run_campaign(bench.Campaign.of(plan), tmp_path / "other.sqlite")
    with bench.Store(tmp_path / "other.sqlite") as opened:
        results.pack(opened, tmp_path / "parts", "other", "fast")
    published.main()
    for name, columns in (("failures", {"stalled"}), ("kinds", {"splitting", "interior point"})):
        with (tmp_path / "results" / f"published-{name}.csv").open() as file:
            rows = list(csv.DictReader(file))
        assert columns <= rows[0].keys()
        assert {row["set"] for row in rows} == {"mine", "other"}


def test_the_curves_of_a_paper_stand_beside_ours(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each pair of curves with its distance, and what that points to."""
    monkeypatch.setattr(_results, "FOLDER", tmp_path / "results")
    monkeypatch.setattr(published, "IMAGES", tmp_path)
    monkeypatch.setattr(published_2018, "PAGE", tmp_path / "page.md")
    monkeypatch.setattr(published_2018, "OWN", {"nsgs": "apgd"})  # as if it were Siconos'
    curves = tmp_path / "curves.csv"
    curves.write_text(
        "set,tolerance,limit_s,solver,tau,share\n"
        # nsn-ac is never the fastest there, nsgs always is
        + "".join(f"Chain,1e-8,50,nsgs,{tau},1\n" for tau in (1, 9))
        + "".join(f"Chain,1e-8,50,nsn-ac,{tau},0\n" for tau in (1, 9))
        + "Elsewhere,1e-8,50,nsgs,1,1\n"
    )
    words = ["published_2018", str(curves), "--parts", str(tmp_path / "parts")]
    monkeypatch.setattr("sys.argv", words)
    with pytest.raises(SystemExit, match="no runs of the campaign faf2018"):
        published_2018.main()
    with bench.Store(run / "small.sqlite") as opened:
        results.pack(opened, tmp_path / "parts", "faf2018", "fast")
    published_2018.main()
    text = (tmp_path / "page.md").read_text()
    assert "images/published-2018-Chain-1e-8.png" in text
    assert "Elsewhere" not in text
    for path in (tmp_path / "results").glob("*.csv"):
        assert f"(results/{path.name})" in text
    with (tmp_path / "results" / "published-2018.csv").open() as file:
        rows = {row["solver"]: row for row in csv.DictReader(file)}
    assert rows.keys() == {"nsgs", "nsn-ac"}
    for solver, row in rows.items():
        assert row["our problems"] == "8"
        assert float(row["chance alone, up to"]) == pytest.approx(0.48, abs=0.005)
        assert bool(row["Siconos to the paper"]) == (solver == "nsgs")


def test_what_a_distance_points_to(monkeypatch: pytest.MonkeyPatch) -> None:
    """The program of the paper runs on our problems: as the paper says, or as ours does."""
    count = 100  # problems: the band is 0.14
    instances = tuple(
        comparison.Instance(str(k), str(k), "Chain", 3, 1e-8, 10.0) for k in range(count)
    )
    monkeypatch.setattr(published_2018, "OWN", {"a": "theirs"})

    def explained(ours: float, theirs: float, paper: float, ran: int = 100) -> str:
        """By shares of problems on which each is the fastest; theirs ran on some."""
        values = np.ones((count, 3))
        for column, share in ((0, ours), (2, theirs)):
            values[:, column] = np.where(np.arange(count) < share * count, 0.5, 2.0)
        values[ran:, 2] = np.nan
        costs = comparison.Costs(instances, ("a", "b", "theirs"), values, "cpu_s")
        curve = [(1.0, paper), (1.5, paper)]
        taus = np.array([1.0, 1.5])
        return published_2018.distance(costs, ["a", "b"], "a", curve, taus)["points to"]

    assert explained(0.5, 0.9, 0.55) == "chance"
    assert explained(0.2, 0.9, 0.85) == "the implementation"
    assert explained(0.2, 0.25, 0.9) == "the problems"
    assert explained(0.1, 0.5, 0.9) == "both"
    assert explained(0.2, 0.9, 0.85, ran=5) == "not told apart"
    monkeypatch.setattr(published_2018, "OWN", {})
    assert explained(0.1, 0.5, 0.9) == "not told apart"
    assert explained(0.5, 0.9, 0.55) == "chance"
    count, instances = 5, instances[:5]
    assert explained(0.2, 0.2, 0.2) == "too few problems"


def test_a_chosen_set_has_the_runs_that_chose_it(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of its own problems alone, with the solvers of all parts that have them."""
    monkeypatch.setenv("FCLIB_CACHE", str(run / "cache"))
    stores = {"candidates": run / "small"}
    for name, solver in (("matrix", "psor"), ("matrix-peers", "admm")):
        stores[name] = tmp_path / name
        plan = {**PLAN, "name": name, "solvers": [solver]}
        if name == "matrix-peers":  # on some problems so far
            plan["problems"] = [{**PLANTED, "sample": 2}]
        bench.run_campaign(bench.Campaign.of(plan), stores[name].with_suffix(".sqlite"))
    of = {}
    for name, store in stores.items():
        with bench.Store(store.with_suffix(".sqlite")) as opened:
            results.pack(opened, tmp_path / "parts", name, "fast")
            of[name] = sorted({row["hash"] for row in opened.table()})
    theirs = of["matrix-peers"]
    digests = theirs[:1] + [digest for digest in of["matrix"] if digest not in theirs][:2]
    own = [Choice("Chain", {}, 0, k, k, digest) for k, digest in enumerate(digests)]
    monkeypatch.setattr(set_index, "choices", lambda name: own if name == "standard" else ())
    parts = results.shards(tmp_path / "parts")
    sources = boards.sources(boards.by_name(parts))
    assert sources == {
        "standard": [part for part in parts if part.name != "matrix-peers"],
        "standard-peers": parts,
    }
    parts = sources["standard"]
    beside = published.set_of("standard-peers", sources["standard-peers"])
    assert beside is not None  # of the set, what the part has
    assert set(beside.every.solvers) == {"nsgs", "apgd", "nsn-ac", "psor", "admm"}
    assert [row["problems"] for row in published.matrix_rows(beside, 1e-8)] == [1, 1]
    one = published.set_of("standard", parts)
    assert published.set_of("hard", parts) is None
    assert one is not None
    assert set(one.every.solvers) == {"nsgs", "apgd", "nsn-ac", "psor"}
    rows = published.matrix_rows(one, 1e-8)
    assert [(row["family"], row["problems"]) for row in rows] == [("Chain", 3), ("all", 3)]
    assert rows[0]["psor"] <= 3
    # parts of its own name come beside these; a run at another limit does not
    found = boards.sources({"other": parts, "standard": parts[:1], "candidates": parts[1:]})
    assert {name: len(own) for name, own in found.items()} == {"standard": 2, "other": 2}
    short = {**PLAN, "name": "standard", "solvers": ["bb"], "time_limit": 7.0}
    bench.run_campaign(bench.Campaign.of(short), tmp_path / "standard.sqlite")
    with bench.Store(tmp_path / "standard.sqlite") as opened:
        results.pack(opened, tmp_path / "parts", "standard", "fast")
    parts = boards.sources(boards.by_name(results.shards(tmp_path / "parts")))["standard"]
    assert {row["set"] for row in results.leaders(parts)} == {"standard"}
    one = published.set_of("standard", parts)
    assert one is not None
    assert "bb" not in one.every.solvers


def test_a_site_of_published_runs_alone(run: Path, tmp_path: Path) -> None:
    """No store, no catalogue: the parts are enough, and the captions say whose times they are."""
    pytest.importorskip("itables")
    with bench.Store(run / "small.sqlite") as opened:
        part = results.pack(opened, tmp_path / "parts", "small", "fast")
    out = tmp_path / "site"
    assert "84 runs" in said("report", "--with", part, "--out", out, "--views", "0", "--jobs", "1")
    packed = [path.read_text().split('"') for path in (out / "data").glob("*.js")]
    content = [
        gzip.decompress(base64.b64decode(p[3])).decode()
        for p in packed
        if p[3:] and p[3].startswith("H4s")
    ]
    assert any("84 published runs; times as measured" in text for text in content)
    assert "84 published runs" in said("profile", "--with", part)
    said("profile", code=2)
    stores = [run / "small.sqlite"] * 2
    said("report", *stores, "--with", part, "--out", out, code=2)


def test_facts_are_those_of_problems_that_have_runs(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "facts.csv"
    with bench.Store(run / "small.sqlite") as opened:
        part = results.pack(opened, tmp_path / "parts", "small", "fast")
    assert part is not None
    monkeypatch.setattr(results, "folder", lambda: tmp_path / "parts")
    monkeypatch.setattr(problem_facts, "write", partial(problem_facts.write, path=table))
    monkeypatch.setattr(problem_facts, "read", partial(problem_facts.read, path=table))
    files = [str(path) for path in (run / "cache").rglob("*.hdf5")]
    other = tmp_path / "other.hdf5"  # no run is of it
    fclib.write(other, planted_local(3).problem)
    problem_facts.main([*files, str(other), "--candidates"])
    found = problem_facts.read()
    assert found.keys() == {row["hash"] for row in results.rows_of(part, ("hash",))}
    assert "8 of them new" in capsys.readouterr().out
    first = fclib.read(files[0])
    assert isinstance(first, fclib.LocalProblem)
    row = found[_digest.digest(first)]
    W = dense(first.W)
    assert row["rank ratio"] == pytest.approx(np.linalg.matrix_rank(W) / len(W))
    assert row["density"] is None  # a local problem has no degrees of freedom
    whole = problem_facts.facts_of(planted_global(3).problem)
    assert whole["density"] is not None
    assert whole["density"] > 0
    problem_facts.main(files)
    assert "0 of them new" in capsys.readouterr().out


def test_the_effect_of_a_fact_is_that_at_one_size() -> None:
    """Planted: the time grows with size, and with a fact that large problems have more of."""
    rng = np.random.default_rng(1)
    size = np.exp(rng.uniform(1, 6, 200))
    fact = size * np.exp(rng.normal(0, 1, 200))
    costs = 1e-6 * size**1.5 * fact**-0.4
    costs[size > np.quantile(size, 0.9)] = np.inf
    shift, exponent, low, high = published.effect(fact, costs, size)
    assert low <= exponent <= high
    assert exponent == pytest.approx(-0.4, abs=1e-6)
    _, alone, _, _ = published.effect(fact, costs)
    assert alone > 0  # size is mistaken for it
    assert shift < 0
    # as many problems as unknowns carry nothing
    assert np.isnan(published.effect(fact[:7], costs[:7], size[:7])[1])
    assert np.isnan(published.effect(size, costs, size)[1])


def test_what_a_guess_is_worth_by_solver() -> None:
    counts = {"solved warm": 3, "solved cold": 2, "of": 4}
    rows = {"A": {published.RATIO: 0.5, **counts}, "B": {published.RATIO: 8.0, **counts}}
    row = published.warm_row("nsgs", rows, 2.0)
    assert (row["least"], row["most"]) == ("0.50 (A)", "8.00 (B)")
    assert (row["solved warm"], row["solved cold"], row["of"]) == (6, 4, 8)
