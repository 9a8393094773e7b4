"""One meaning: the site says what `fclib profile` says, and its pages compute what Python does."""

from __future__ import annotations

import dataclasses
import itertools
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fclib.bench import Job, Limits, ProblemFacts, Record, SolverChoice, Store, comparison, profiles
from fclib.report import Campaigns, build_site
from fclib.report.view import rounded
from helpers_bench import facts_of
from helpers_browser import chromium
from helpers_cli import tables
from helpers_report import read_data, skip_without_libraries

pytest.importorskip("pyarrow")
skip_without_libraries()

# one takes little, one has run little, one proves that there is no solution
SOLVERS = ("apgd", "picky", "rare", "prover", "nsgs")
# of one family many problems, and of others few; some of both forms, some without a contact
FAMILIES = {"Large": 9, "Small": 2, "Both": 3}
TOLERANCES = (1e-4, 1e-8)
DIGITS = 6


def facts(family: str, number: int, form: str) -> ProblemFacts:
    """A problem of a family; the two forms of one lie beside each other."""
    return facts_of(
        f"{family}{number}{form}".ljust(64, "0"),
        f"{number:04d}-{form}",  # the same in several families
        family=family,
        path=f"/there/set/{family}/{number:04d}-{form}.hdf5",
        kind=form,
        formulation="G3DFC" if form == "global" else "3DFC",
        n=6 if form == "global" else 0,
        nc=3 * number,
    )


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs whose costs are drawn by lot, the same every time."""
    path = tmp_path_factory.mktemp("store") / "runs.sqlite"
    draw = random.Random(7)
    with Store(path) as opened:
        for family, count in FAMILIES.items():
            forms = ("global", "local") if family == "Both" else ("global",)
            for number, form, name, tol in itertools.product(
                range(count), forms, SOLVERS, TOLERANCES
            ):
                if name == "rare" and (family, number) != ("Large", 1):
                    continue
                status = draw.choice(("converged", "converged", "converged", "stalled"))
                if name == "prover" and number == 1:
                    status = "infeasible"
                if name == "picky" and (form == "global") == (family == "Both"):
                    status = "unsuitable" if family == "Both" or number % 2 else status
                for repeat in range(2 if name == "nsgs" else 1):
                    seconds = 10 ** draw.uniform(-3.5, 0)  # no ratio is beyond a curve
                    record = Record(
                        status=status,
                        iterations=draw.randrange(1, 900),
                        cpu_s=seconds,
                        total_cpu_s=2 * seconds,
                        wall_s=3 * seconds,
                        memory=draw.uniform(10, 100),
                        merits={"error": tol / 2 if status == "converged" else 1.0},
                        machine={"node": "here", "cpu": "Abacus"},
                    )
                    job = Job(
                        facts(family, number, form),
                        SolverChoice(name, {}, "1", "splitting", "fclib"),
                        tol,
                        Limits(time=2.0, wall=9.0, memory=1000.0),
                        repeat,
                        1,
                    )
                    opened.add(job, record)
    return path


@pytest.fixture(scope="module")
def site(store: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("built") / "site"
    with Campaigns([store]) as campaigns:
        build_site(campaigns, folder, views=0)
    return folder


@pytest.fixture(scope="module")
def page(site: Path) -> Iterator[Any]:
    with chromium() as browser:
        opened = browser.new_page()
        opened.goto((site / "index.html").as_uri() + "#/overview")
        opened.wait_for_selector("main h1")
        yield opened


def test_overview_says_what_the_command_says(store: Path, site: Path) -> None:
    told, known = tables(store), read_data(site, "site")
    summary = {(row["tol"], row["solver"]): row for row in told["summary"]}
    seen = set()
    for tol, head in zip(known["tolerances"], known["headlines"], strict=True):
        for row in head["tables"][""]:
            assert row == rounded(summary[tol, row["solver"]], DIGITS)
            seen.add((tol, row["solver"]))
        counts = {name: summary[tol, name] for name in head["solvers"]}
        assert head["legend"] == [
            f"{name} {row['solved']} of {row['of']}" for name, row in counts.items()
        ]
        # at the right end of a curve stands the share of the table
        for name, curve in zip(head["solvers"], head["curves"], strict=True):
            assert curve[-1] == pytest.approx(counts[name]["share"], abs=1e-5)
        assert head["not_compared"] == [row for row in told["left out"] if row["tol"] == tol]
        for family in FAMILIES:
            part = {r["solver"]: r for r in tables(store, "--family", family)["summary"]
                    if r["tol"] == tol}  # fmt: skip
            for row in head["tables"][family]:
                assert (row["solved"], row["of"]) == tuple(
                    part[row["solver"]][key] for key in ("solved", "of")
                )
    assert seen == set(summary)
    work = {(row["tol"], row["solver"]): row for row in told["work-precision"]}
    assert known["work"] == [rounded(row, DIGITS) for row in told["work-precision"]]
    assert set(work) == {key for key in summary if key[1] != profiles.VIRTUAL_BEST}
    # a problem is counted once, whatever its forms
    assert known["overview"]["problems"] == sum(FAMILIES.values()) == known["problems"]


def test_each_run_of_a_problem_is_on_its_page(store: Path, site: Path) -> None:
    runs = [
        run
        for path in (site / "data" / "problems").iterdir()
        for run in read_data(site, f"problems/{path.stem}")
    ]
    with Store(store, create=False) as opened:
        rows = opened.results()
    keys = ("solver", "tol", "status", "cpu_s")
    assert sorted(tuple(rounded(row[key], DIGITS) for key in keys) for row in rows) == sorted(
        tuple(run[key] for key in keys) for run in runs
    )


CHOICES = """async ([tol, metrics, subsets, families, kinds]) => {
  const cat = await Fclib.load("catalogue"), s = Fclib.values.site;
  const column = (key) => {
    const own = cat.columns.find((c) => c.key === key);
    return own.words ? (k) => own.words[own.values[k]] : (k) => own.values[k];
  };
  const family = column("family"), contacts = column("nc"), bench = await Fclib.load(`t${tol}`);
  const plain = (values) => values.map((v) => Number.isNaN(v) ? "none" : v === Infinity ? null : v);
  const found = [];
  for (const metric of metrics) for (const kind of kinds) for (const of of families)
    for (const weigh of ["families", "instances"]) for (const own of [false, true])
      for (const solvers of subsets) {
        const costs = await Fclib.load(`t${tol}-${metric}`), keep = (k) => !of || family(k) === of;
        const { instances, values, shown, weights } = Fclib.profile(bench, costs,
          { solvers, keep, own, weigh, kind, families: family, contacts });
        found.push({ metric, kind, family: of, weigh, own, solvers, count: instances.length,
          legends: solvers.map((s_, k) => Fclib.legend(s.solvers[s_].label, values[k])),
          steps: solvers.map((_, k) => Fclib.shares(shown[k], weights[k], 0)),
          means: solvers.map((_, k) => Fclib.mean(values[k], weights[k],
            instances.map((i) => s.charges.penalty * bench.limits[i]), s.charges.shift)) });
      }
  const widest = families.map((of) =>
    Fclib.widest(bench, bench.statuses.map(() => bench.problems.map(() => null)),
      s.solvers.map((one) => one.label), (k) => !of || family(k) === of, s.common));
  return { found, widest };
}"""


def test_pages_compute_what_python_does_on_every_choice(store: Path, site: Path, page: Any) -> None:
    known = read_data(site, "site")
    labels = [solver["label"] for solver in known["solvers"]]
    places = range(len(labels))
    subsets = [list(c) for n in places for c in itertools.combinations(places, n + 1)]
    families, kinds = ["", *FAMILIES], ["performance", "data", "contact"]
    rows = profiles.load(store)
    compared = 0
    for t, tol in enumerate(known["tolerances"]):
        here = rows.where(comparison.numbers_in(rows, "tol") == tol)
        wanted: list[Any] = [(["cpu_s"], subsets), (list(profiles.METRICS), subsets[-1:])]
        for metrics, some in wanted:
            told = page.evaluate(CHOICES, [t, metrics, some, families, kinds])
            every = {
                (metric, family): part_of(profiles.gather(here, metric), family)
                for metric in metrics
                for family in families
            }
            for one in told["found"]:
                check(one, every[one["metric"], one["family"]], labels)
                compared += 1
            for family, names in zip(families, told["widest"], strict=True):
                widest = every[metrics[0], family].widest()
                assert {labels[k] for k in names} == set(widest), family
    assert compared == 2 * 3 * 4 * 2 * 2 * (31 + 5)


def part_of(costs: profiles.Costs, family: str) -> profiles.Costs:
    """Of a family, or of all for ""; with the digits that a site has."""
    values = [[float("inf") if v is None and not np.isnan(w) else float("nan") if v is None else v
               for v, w in zip(a, b, strict=True)]
              for a, b in zip(rounded(costs.values, DIGITS), costs.values.tolist(),
                              strict=True)]  # fmt: skip
    whole = dataclasses.replace(costs, values=np.array(values, float))
    return whole.on_instances(
        k for k, one in enumerate(costs.instances) if not family or one.family == family
    )


def check(one: dict[str, Any], every: profiles.Costs, labels: list[str]) -> None:
    """One choice on a page against Python."""
    names = [labels[k] for k in one["solvers"]]
    costs = every.own(names) if one["own"] else every.shared(names)
    if one["kind"] == "contact":
        costs = costs.per_contact()
    assert one["count"] == len(costs.instances)
    assert one["legends"] == [costs.legend(k) for k in range(len(names))]
    values = profiles.ratios(costs.values) if one["kind"] == "performance" else costs.values
    weights = costs.weights(one["weigh"])
    for k, steps in enumerate(one["steps"]):
        # just beyond each step, where both have passed it
        bounds = np.array(steps["x"]) * (1 + 1e-12)
        expected = profiles.share_within(values, bounds, weights)[k]
        np.testing.assert_allclose(steps["y"], expected, atol=1e-12)
        finite = np.isfinite(values[:, k])
        assert steps["y"][-1] == pytest.approx(weights[finite, k].sum(), abs=1e-12)
    if one["kind"] == "data" and one["metric"] == "cpu_s":
        means = profiles.shifted_geometric_mean(costs.values, costs.charges, weights=weights)
        np.testing.assert_allclose(
            [mean if of else np.nan for mean, (_, of) in zip(one["means"], costs.counts(),
                                                             strict=True)],
            means, rtol=1e-9)  # fmt: skip


def test_the_odds_of_the_next_problem_are_those_of_python(page: Any) -> None:
    pairs = [[k, n] for n in (1, 2, 7, 194) for k in (0, n // 2, n)]
    told = page.evaluate("pairs => pairs.map(([k, n]) => Fclib.odds(k, n))", pairs)
    np.testing.assert_allclose(told, [comparison.odds(*pair) for pair in pairs], rtol=1e-12)


def test_overview_and_profiles_agree(site: Path, page: Any) -> None:
    """What a page computes by itself when it is opened is what Python has stored for another."""
    known = read_data(site, "site")
    for t, head in enumerate(known["headlines"]):
        page.goto((site / "index.html").as_uri() + f"#/profiles?tol={t}")
        page.hover("main .plot[data-shown]")
        page.wait_for_selector("main .plot[data-drawn]")
        shown = page.evaluate("document.querySelector('main .plot').data.map((one) => one.name)")
        assert sorted(shown) == sorted(head["legend"])
        ends = page.evaluate("document.querySelector('main .plot').data.map((one) => one.y.at(-1))")
        shares = {row["solver"]: row["share"] for row in head["tables"][""]}
        for name, end in zip(shown, ends, strict=True):
            assert end == pytest.approx(shares[name.partition(" ")[0]], abs=1e-5)


def test_the_overview_draws_the_chosen_problems_as_python_does(
    store: Path, site: Path, page: Any
) -> None:
    """Problems of some size, at each tolerance: curves, legend and number of instances."""
    known = read_data(site, "site")
    rows = profiles.load(store)
    for t, tol in enumerate(known["tolerances"]):
        every = profiles.gather(rows.where(comparison.numbers_in(rows, "tol") == tol))
        sizes = {one.hash: one.nc for one in every.instances}
        for size, (low, high) in {"0-10": (0, 10), "10-50": (10, 50)}.items():
            part = every.on_instances(
                k for k, one in enumerate(every.instances) if low <= sizes[one.hash] <= high
            )
            costs = comparison.compared(part)
            page.goto((site / "index.html").as_uri() + "#/about")
            page.wait_for_selector("main[data-page=about]")
            page.goto((site / "index.html").as_uri() + f"#/overview?tol={t}&size={size}")
            page.hover("main[data-page=overview] .first .plot[data-shown]")
            page.wait_for_selector("main[data-page=overview] .first .plot[data-drawn]")
            drawn = page.evaluate(
                "document.querySelector('.first .plot').data.map((one) => "
                "({ name: one.name, x: [...one.x], y: [...one.y] }))"
            )
            legend = [costs.legend(k) for k in range(len(costs.solvers))]
            assert sorted(one["name"] for one in drawn) == sorted(legend)
            caption = page.locator(".first figcaption").first.inner_text()
            assert caption.startswith(f"{len(costs.instances)} instance")
            values, weights = profiles.ratios(costs.values), costs.weights("families")
            for one in drawn:
                k = legend.index(one["name"])
                bounds = np.array(one["x"]) * (1 + 1e-5)  # costs have six digits
                inside = bounds < bounds[-1]
                expected = profiles.share_within(values, bounds, weights)[k]
                np.testing.assert_allclose(np.array(one["y"])[inside], expected[inside], atol=1e-9)
