"""What the tests of the report are about: a small collection and a store of made-up runs."""

import base64
import gzip
import hashlib
import importlib.util
import json
import random
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib.bench import Job, Limits, ProblemFacts, Record, SolverChoice, Store
from fclib.bench.problems import look
from helpers_bench import facts_of

LABELS = ["auto", "nsgs", "under_score", "rare"]
NAMES = {"auto": "auto", "under_score": "nsn-ac"}
TOLERANCES = (1e-4, 1e-8)
# of the collection, two problems of the same data
ORIGINAL, COPY = "small/BoxesStack/0008", "small/BoxesStack/0009"


def skip_without_libraries() -> None:
    """Skips a file where the packages with the JavaScript of pages are not installed.

    They are looked up as the report does, and not imported: itables imports pandas.
    """
    for name in ("plotly", "itables"):
        if importlib.util.find_spec(name) is None:
            pytest.skip(f"{name} is not installed", allow_module_level=True)


def make_collection(folder: Path, analyze: bool = False) -> Path:
    """A stack of three cubes that lands: a dozen problems in both forms, one of them a copy."""
    from fclib import collections, scenes
    from fclib.collections.plan import Plan

    scene = scenes.get("BoxesStack")(boxes=3, gap=2e-3, time_step=5e-3).scene(seed=1)
    plan = Plan(scene=scene, collection="small", problems=12, analyze=analyze)
    collections.build([plan], folder, pictures=False)
    _repeat(folder, plan.name)
    return folder


def _repeat(out: Path, family: str) -> None:
    """Gives problem COPY the data of ORIGINAL, as a body at rest may in the next step."""
    from fclib.collections import catalog

    part = out / family / catalog.FILE
    table = catalog.read_catalog(part)
    rows = {row["id"]: row for row in table.to_pylist()}
    original, copy = rows[ORIGINAL], rows[COPY]
    for file in ("global_file", "local_file"):
        shutil.copy(out / original[file], out / copy[file])
    kept = ("id", "number", "step", "time", "global_file", "local_file")
    rows[COPY] = original | {name: copy[name] for name in kept}
    catalog.write_catalog(part, rows.values(), table.schema.metadata)
    catalog.gather(out)


def make_store(
    path: Path,
    collection: Path,
    labels: Sequence[str] = tuple(LABELS),
    files: int = 6,
    tolerances: Sequence[float] = TOLERANCES,
) -> Path:
    """Runs of some problems, with failures and histories; the solver `rare` has run two of them."""
    alone = path.parent / "alone.hdf5"
    problem = fclib.LocalProblem(spacedim=3, W=np.eye(6), q=-np.ones(6), mu=np.full(2, 0.3))
    fclib.write(alone, problem)
    # a body at rest may hand over the same data again
    files_of = sorted(collection.rglob("*-global.hdf5"), reverse=True)
    distinct = {look(file).hash: file for file in files_of}
    found = sorted(distinct.values())[-files + 1 :]
    local = Path(str(found[0]).replace("-global", "-local"))
    # one problem by its local form, which the catalogue knows by its file alone
    facts = [look(file) for file in (local, *found[1:])] + [look(alone, "Alone")]
    add_runs(path, facts, labels, tolerances=tolerances)
    return path


def make_report(folder: Path) -> None:
    """A collection, a store and their site: pictures of all that ran, and a name to be escaped."""
    from fclib.report import Campaigns, build_site

    collection = make_collection(folder / "collection")
    with Campaigns([make_store(folder / "runs.sqlite", collection)]) as campaigns:
        build_site(campaigns, folder / "a site #1", collection, views=6)


def add_runs(
    path: Path,
    facts: Sequence[ProblemFacts],
    labels: Sequence[str],
    history: bool = True,
    tolerances: Sequence[float] = TOLERANCES,
) -> None:
    """Runs whose costs and statuses are drawn by lot, the same every time."""
    draw = random.Random(5)
    limits = Limits(time=10.0, wall=20.0, memory=1000.0)
    with Store(path) as store:
        number = store.begin(
            "made", 'title = "Made"\n', len(facts) * len(labels) * len(tolerances), 0, "here"
        )
        for p, fact in enumerate(facts):
            for label in labels:
                for tol in tolerances:
                    if label == "rare" and p > 1:
                        continue
                    solved = draw.random() < 0.8
                    seconds = 10 ** draw.uniform(-4, 0)
                    reports = [(k, 10.0 ** (-k / 20), seconds * k / 200, "") for k in range(200)]
                    record = Record(
                        status="converged" if solved else draw.choice(["stalled", "cpu_limit"]),
                        iterations=draw.randrange(1, 1000),
                        cpu_s=seconds,
                        total_cpu_s=seconds * 1.5,
                        wall_s=seconds * 2,
                        memory=draw.uniform(10, 100),
                        merits={"error": tol / 2 if solved else 1.0},
                        history=reports if history and solved else None,
                        machine={"node": "here", "cpu": "Abacus"},
                    )
                    name = NAMES.get(label, "nsgs")
                    choice = SolverChoice(name, {}, f"of {label}", "splitting", "fclib", label)
                    store.add(Job(fact, choice, tol, limits, 0, 1), record, number)


def made_facts(count: int) -> list[ProblemFacts]:
    """Problems that are nowhere but in a store."""
    return [
        facts_of(
            hashlib.sha256(str(k).encode()).hexdigest(),
            f"{k:05d}",
            family=f"Family{k % 7}",
            path=f"/none/{k:05d}.hdf5",
            nc=1 + k % 500,
            nnz=9 * (1 + k % 500),
            title=f"Problem {k}",
        )
        for k in range(count)
    ]


def read_data(site: Path, name: str) -> Any:
    """What a data file of a site holds."""
    text = (site / "data" / f"{name}.js").read_text()
    packed = f'Fclib.putPacked("{name}","'
    if text.startswith(packed):
        return json.loads(gzip.decompress(base64.b64decode(text[len(packed) : text.rindex('"')])))
    start = f'Fclib.put("{name}",'
    assert text.startswith(start)
    return json.loads(text[len(start) : text.rindex(");")])


def periodic_step() -> Any:
    """Polyhedra that fall and touch across the boundary of a periodic cell, of period 13."""
    from fclib import scenes, simulate

    scene = scenes.get("PeriodicBox")(polyhedra=24, period=13.0).scene(seed=0)
    return next(s for s in simulate.simulate(scene, 130) if s.problem.nc > 85)
