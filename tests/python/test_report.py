"""The report: its numbers are the store's, the network's positions are the scene's."""

import dataclasses
import itertools
import json
import math
import re
import shutil
import subprocess
from collections import Counter
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import ConvexHull, KDTree

import fclib
from fclib._geometry import rotations
from fclib.bench import Store, profiles
from fclib.collections import set_index
from fclib.report import Campaigns, ReportError, build_site, view_of, write_view
from fclib.report.libraries import as_script
from fclib.report.network import network_of
from fclib.report.recipes import recipes
from fclib.report.solids import MESH, record_of, solids_of
from fclib.report.view import hulls_of
from fclib.scenes.shared.family import Assembled
from helpers_cli import invoke
from helpers_report import (
    LABELS,
    TOLERANCES,
    make_store,
    periodic_step,
    read_data,
    skip_without_libraries,
)

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")
skip_without_libraries()
# what they give is of one kind here
read: Any = fclib.read
read_solution: Any = fclib.read_solution


def bare(problem: Any) -> Any:
    """A problem as somebody else's file has it: nothing says where it is."""
    return problem.replace(bodies=None, contacts=None)


def column(site: Path, key: str) -> list[Any]:
    """A column of the site's catalogue, its words unpacked."""
    found = next(c for c in read_data(site, "catalogue")["columns"] if c["key"] == key)
    if "words" in found:
        return [found["words"][k] if k >= 0 else None for k in found["values"]]
    return list(found["values"])


# ---- numbers


def test_costs_and_statuses_are_those_of_the_store(site: Path, store: Path) -> None:
    with Store(store, create=False) as opened:
        rows = opened.results()
    ids = column(site, "id")
    known = read_data(site, "site")
    labels = [solver["label"] for solver in known["solvers"]]
    names = {code: name for code, name, _ in known["statuses"]}
    assert sorted(labels) == sorted(LABELS)
    seen = 0
    for t, tol in enumerate(known["tolerances"]):
        bench = read_data(site, f"t{t}")
        for metric in profiles.METRICS:
            costs = read_data(site, f"t{t}-{metric}")
            for s, label in enumerate(labels):
                for i, place in enumerate(bench["problems"]):
                    name = ids[place].rpartition("/")[2]
                    own = [
                        row
                        for row in rows
                        if (row["solver"], row["tol"]) == (label, tol)
                        and row["problem"].rpartition("/")[2].startswith(name)
                    ]
                    if not own:
                        assert bench["statuses"][s][i] == "."
                        assert costs[s][i] is None
                        continue
                    (row,) = own
                    assert names[bench["statuses"][s][i]] == row["status"]
                    if row["solved"]:
                        floor = profiles.METRICS[metric][1]
                        assert costs[s][i] == pytest.approx(max(row[metric], floor), rel=1e-5)
                    else:
                        assert costs[s][i] is None
                    seen += 1
    assert seen == len(rows) * len(profiles.METRICS)


def test_headlines_are_those_of_the_profiles(site: Path, store: Path) -> None:
    known = read_data(site, "site")
    for t, tol in enumerate(known["tolerances"]):
        rows = profiles.load(store, tolerances=[tol])
        head = known["headlines"][t]
        # the solver that has run one problem alone is left out
        assert set(head["solvers"]) == set(LABELS) - {"rare"}
        costs = profiles.costs([row for row in rows if row["solver"] != "rare"])
        assert head["instances"] == len(costs.instances)
        weights = costs.weights("families")
        curves = profiles.performance_profile(costs.values, np.array(head["taus"]), weights)
        order = [costs.solvers.index(name) for name in head["solvers"]]
        np.testing.assert_allclose(head["curves"], curves[order], atol=1e-5)
        own = {row["solver"]: row for row in profiles.summary(costs, weigh="families")}
        for row in head["tables"][""]:
            for key, value in row.items():
                assert value == (
                    pytest.approx(own[row["solver"]][key], rel=1e-5)
                    if isinstance(value, float)
                    else own[row["solver"]][key]
                )


def test_extremes_are_ordered_and_true(site: Path, store: Path) -> None:
    known = read_data(site, "site")
    ids = column(site, "id")
    for t, tol in enumerate(known["tolerances"]):
        with Store(store, create=False) as opened:
            rows = [row for row in opened.results(tol=tol) if row["solver"] != "rare"]
        for label, lists in known["headlines"][t]["extremes"].items():
            for kind in ("best", "worst"):
                for place, own, best, which in lists[kind]:
                    name = ids[place].rpartition("/")[2]
                    costs = {
                        row["solver"]: row["cpu_s"] if row["solved"] else math.inf
                        for row in rows
                        if row["problem"].rpartition("/")[2].startswith(name)
                    }
                    mine = costs.pop(label)
                    assert (own if own is not None else math.inf) == pytest.approx(mine, rel=1e-5)
                    assert (best if best is not None else math.inf) == pytest.approx(
                        min(costs.values()), rel=1e-5
                    )
                    assert which is None or costs[which] == min(costs.values())
                    assert (mine <= min(costs.values())) == (kind == "best")


def test_the_catalogue_knows_all_problems_and_their_best_solver(
    site: Path, store: Path, collection: Path
) -> None:
    from fclib.collections import read_catalog

    catalogue = read_catalog(collection).to_pylist()
    ids = column(site, "id")
    # the last one is of the store alone
    assert ids[:-1] == [row["id"] for row in catalogue]
    assert ids[-1] == "Alone/alone"
    assert column(site, "nc")[:-1] == [row["nc"] for row in catalogue]
    with Store(store, create=False) as opened:
        rows = opened.results(solved=True)
    # a copy shows what its original has
    originals = column(site, "same_as")
    solved = [x or 0 for x, own in zip(column(site, "solved"), originals, strict=True) if not own]
    assert sum(solved) == len(rows)
    for k, best in enumerate(column(site, "best_solver")):
        name = (originals[k] or ids[k]).rpartition("/")[2]
        own = [row for row in rows if row["problem"].rpartition("/")[2].startswith(name)]
        tol = min((row["tol"] for row in own), default=None)
        fastest = min(
            (row for row in own if row["tol"] == tol), key=lambda r: r["cpu_s"], default=None
        )
        assert best == (fastest["solver"] if fastest else None)


def test_runs_and_histories_of_a_problem(site: Path, store: Path) -> None:
    with Store(store, create=False) as opened:
        rows = opened.results()
        histories = {row["run"]: opened.history(row["run"]) for row in rows}
    written = sorted((site / "data" / "problems").iterdir())
    runs = [run for path in written for run in read_data(site, f"problems/{path.stem}")]
    assert len(runs) == len(rows)
    long = [run for run in runs if len(run.get("history", ())) > 1]
    assert long
    assert all(len(run["history"]) <= 81 for run in long)
    ends = {round(math.log10(history[-1][1]), 3) for history in histories.values() if history}
    assert {round(math.log10(run["history"][-1][1]), 3) for run in long} <= ends


def test_several_stores_are_one(store: Path, collection: Path, tmp_path: Path, site: Path) -> None:
    other = make_store(tmp_path / "other.sqlite", collection, labels=["later"])
    with Campaigns([store, other]) as campaigns:
        assert set(campaigns.solvers) == {*LABELS, "later"}
        build_site(campaigns, tmp_path / "site", views=0)
    assert read_data(tmp_path / "site", "site")["problems"] < len(column(site, "id"))


def test_nothing_is_lost_and_nothing_foreign_replaced(
    store: Path, collection: Path, tmp_path: Path
) -> None:
    foreign = tmp_path / "mine"
    foreign.mkdir()
    (foreign / "thesis.tex").write_text("years of work")
    with pytest.raises(ReportError, match="is no site"):
        build_site(None, foreign, collection)
    assert (foreign / "thesis.tex").is_file()
    with pytest.raises(ReportError, match="needs a store"):
        build_site(None, tmp_path / "new")
    # a site takes the place of the older one, and leaves nothing beside it
    for _ in range(2):
        build_site(None, tmp_path / "site", collection, views=1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine", "site"]


def test_no_path_of_this_machine_is_on_the_site(site: Path, collection: Path) -> None:
    scripts = list((site / "data").rglob("*.js"))
    assert scripts
    for path in scripts:
        assert str(collection) not in path.read_text(), path


# ---- libraries


def test_the_libraries_are_copied_with_their_licences(site: Path) -> None:
    known = read_data(site, "site")["libraries"]
    assert [one["name"] for one in known] == ["plotly.js", "DataTables"]
    for one in known:
        assert re.fullmatch(r"\d+\.\d+\.\d+", one["version"])
        text = (site / one["text"]).read_text()
        assert "Permission is hereby granted" in text
        assert "Bundled license information" in text
    assert "jQuery JavaScript Library" in (site / known[1]["text"]).read_text()
    page = (site / "index.html").read_text()
    for name in ("plotly.js", "tables.js", "tables.css"):
        assert (site / "assets" / name).stat().st_size > 100_000
    # the large one waits until a page draws
    assert "assets/tables.js" in page
    assert "assets/plotly.js" not in page


def test_without_the_packages_it_is_said_what_to_install(
    collection: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build_site(None, tmp_path / "site", collection, views=0)

    def missing(name: str) -> metadata.Distribution:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr("importlib.metadata.distribution", missing)
    with pytest.raises(ReportError, match=r'package plotly: pip install "fclib\[report\]"'):
        build_site(None, tmp_path / "site", collection, views=0)
    # the older site is there
    assert (tmp_path / "site" / "assets" / "plotly.js").is_file()
    assert [path.name for path in tmp_path.iterdir()] == ["site"]
    file = sorted(collection.rglob("*-local.hdf5"))[-1]
    invoke("view", file, "--out", tmp_path / "v.html", code=1)
    assert not (tmp_path / "v.html").exists()


def test_a_module_becomes_a_script() -> None:
    module = "var a=1,b=2;/* c */export{a as default,b};\n/*! Bundled */\n"
    script = as_script(module, "default", "A")
    assert "export" not in script
    assert script.count("window.A = a;") == 1
    assert script.endswith("/*! Bundled */\n")
    assert "window.B = b;" in as_script(module, "b", "B")
    for wrong in ("var a=1;", module + module, "export{b};"):
        with pytest.raises(ReportError, match="another version of itables"):
            as_script(wrong, "default", "A")


# ---- recipes


@pytest.mark.parametrize(
    "formulation", ["2DFC", "3DFC", "M3DFC", "G3DFC", "GM3DFC", "R3DFC", "GR3DFC"]
)
def test_recipes_in_c_compile(formulation: str, tmp_path: Path) -> None:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("there is no C compiler")
    (tmp_path / "recipe.c").write_text(recipes([formulation])[formulation]["c"])
    include = Path(__file__).parents[2] / "include"
    command = [compiler, "-std=c11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only"]
    subprocess.run([*command, f"-I{include}", tmp_path / "recipe.c"], check=True)


def test_recipes_in_python_run(collection: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = sorted(collection.rglob("*-global.hdf5"))[-1]
    monkeypatch.chdir(file.parent)
    text = recipes(["G3DFC"])["G3DFC"]["python"].replace("{path}", file.name)
    found: dict[str, Any] = {}
    exec(text, found)
    assert found["result"].status == "converged"


# ---- networks


def test_positions_are_recovered(collection: Path) -> None:
    """Cubes of side 2, one upon another: their centres are 2 apart, and 1 above the ground."""
    file = sorted(collection.rglob("*-global.hdf5"))[-1]
    problem = bare(read(file))
    network = network_of(problem)
    assert network.placed
    assert len(network.bodies) == 3
    heights = np.sort(network.bodies[:, 2]) - network.points[:, 2].min()
    np.testing.assert_allclose(heights, [1.0, 3.0, 5.0], atol=0.05)
    assert network.frames is not None
    np.testing.assert_allclose(np.abs(network.frames[:, 2, 0]), 1.0, atol=1e-2)


def test_positions_are_those_of_the_simulation() -> None:
    """Capsules that fall into a box: two that touch are apart as they are there."""
    from fclib import scenes, simulate

    scene = scenes.get("Capsules")(capsules=40, width=16.0).scene(seed=0)
    step = next(s for s in simulate.simulate(scene, 600) if s.problem.nc > 20)
    network = network_of(bare(step.problem))
    assert network.source == "H"
    bodies = np.asarray(step.dofs)[::6] // 6
    true = step.model.position.reshape(-1, 7)[bodies, :3]
    pairs = network.pairs[(network.pairs >= 0).all(axis=1)]
    assert len(pairs) > 3
    apart = network.bodies[pairs[:, 0]] - network.bodies[pairs[:, 1]]
    expected = true[pairs[:, 0]] - true[pairs[:, 1]]
    # the state is that after the step, of 2.5 ms
    np.testing.assert_allclose(apart, expected, atol=5e-2)
    assert np.median(np.abs(apart - expected)) < 1e-3


def test_contacts_across_a_periodic_boundary_are_near_both_bodies() -> None:
    step = periodic_step()
    network = network_of(bare(step.problem))
    assert network.source == "H"
    assert network.shifts is not None
    assert network.cell is not None
    np.testing.assert_allclose(np.diff(network.cell, axis=0), [[13.0, 13.0]])
    crossing = network.shifts.any(axis=1)
    assert 3 < crossing.sum() < step.problem.nc
    np.testing.assert_array_equal(np.remainder(network.shifts[:, :2], 13.0), 0.0)
    # a polyhedron has a radius of 3, and the gap that a step closes may lie beyond it
    first, second = network.pairs.T
    assert np.linalg.norm(network.points - network.bodies[first], axis=1).max() < 3.5
    both = second >= 0
    ends = (network.points - network.shifts)[both]
    assert np.linalg.norm(ends - network.bodies[second[both]], axis=1).max() < 3.5
    # two bodies are apart as they are in the simulation, but for whole periods
    true = step.position.reshape(-1, 7)[np.asarray(step.dofs)[::6] // 6, :3]
    apart = network.bodies[first[both]] - network.bodies[second[both]]
    wrong = apart - (true[first[both]] - true[second[both]])
    wrong[:, :2] -= 13.0 * np.round(wrong[:, :2] / 13.0)
    # a floor that gaps are above of is not quite plane
    np.testing.assert_allclose(wrong, 0.0, atol=1e-4)
    # a hull is as large as its body, and has the image of a contact for its corner
    corners = np.concatenate([network.bodies, network.points, network.points - network.shifts])
    faces = np.array(hulls_of(network))
    assert faces.max() >= len(network.bodies) + len(network.points)
    record = view_of(bare(step.problem))["network"]
    corners = np.array(record["bodies"] + record["points"] + record["images"])
    assert np.ptp(corners[faces], axis=1).max() < 7.0
    # where the file says nothing of a period, the points do not close
    silent = bare(step.problem).replace(info=fclib.ProblemInfo())
    assert network_of(silent).shifts is None


# 100,000 contacts
LONG = {"flows/GranularFlow": pytest.mark.long}


def families(assembled: bool) -> list[Any]:
    """SET/FAMILY of all families, each once: of `standard`, and of `extended` what that has not.

    Chute1000 stands for Chute4000, which has four times as many grains, and ElasticCubesx2 for
    ElasticCubesx20, whose mesh is finer. What other engines recorded has the order of their
    unknowns, and a test of its own (test_simulators.py).
    """
    found: dict[str, str] = {}
    for own in (*set_index.sets()["standard"], *set_index.sets()["extended"]):
        found.setdefault(set_index.kind_of(own), own)
    recorded = {own.partition("/")[2] for own in set_index.sets()["simulators"]}
    for name in ("Chute4000", "ElasticCubesx20", *recorded):
        del found[name]
    from fclib import scenes

    simulated = scenes.families()
    chosen = [own for name, own in found.items() if (name not in simulated) == assembled]
    return [pytest.param(k, marks=LONG.get(k, ())) for k in chosen]


def a_problem(own: str) -> tuple[Any, Any, Any]:
    """A problem of a family from its stored states, else the first of its simulation that has a
    contact, small where that takes long; its model, in this state; the state's positions.
    """
    from fclib import scenes, simulate
    from fclib.collections import trajectory

    plan = set_index.plan_of(own)
    states = trajectory.read(plan.trajectory) if plan.trajectory is not None else None
    if states is not None and states.handed is None:
        return states.problem(0).problem, states.model, states.position[0]
    chosen: Any = scenes.get(set_index.kind_of(own))
    scene = chosen(**getattr(chosen, "small", {})).scene(seed=0)
    step = next(s for s in simulate.simulate(scene, 1000, tol=1e-4) if s.problem.nc)
    contacts, bodies = simulate.geometry_of(step.model, step.contacts)
    problem = step.problem.replace(contacts=contacts, bodies=bodies)
    return problem, step.model, step.position


@pytest.mark.parametrize("family", families(assembled=False))
def test_drawn_positions_are_those_of_the_simulation(family: str) -> None:
    """Of each family, to 1e-6 of its smallest body, by MuJoCo's own places of its geometries."""
    problem, model, position = a_problem(family)
    bodies = problem.bodies
    assert bodies is not None
    drawn = solids_of(bodies, problem.contacts)
    record = record_of(drawn)
    bound = 1e-6 * drawn.size
    network = network_of(problem)
    assert network.source == "file"
    if not hasattr(model, "model"):
        # elastic: each vertex is a node, where it is now
        nodes = model.places()
        for shape in np.flatnonzero(bodies.shape_kind == MESH).tolist():
            away, _ = KDTree(nodes).query(drawn.world(shape), p=np.inf)
            assert away.max() < bound
        return
    kinds = {0: 0, 2: 1, 3: 2, 4: 3, 5: 4, 6: 5, 7: 6, 1: 6}  # of MuJoCo's geometries
    import mujoco

    data = mujoco.MjData(model.model)
    data.qpos[:] = position[: model.model.nq]
    mujoco.mj_kinematics(model.model, data)
    places, turns = data.geom_xpos, data.geom_xmat.reshape(-1, 3, 3)
    found = 0
    for shape in range(len(drawn.kind)):
        away = np.abs(places - record["place"][shape]).max(axis=1)
        near = np.flatnonzero(away < bound).tolist()
        kind = int(bodies.shape_kind[shape])
        near = [g for g in near if kinds[int(model.model.geom_type[g])] == kind]
        assert near, f"shape {shape} is nowhere in the simulation"
        R = rotations(np.array([record["turn"][shape]]))[0]
        assert min(np.abs(turns[g] - R).max() for g in near) < 1e-6
        found += 1
    assert found == len(drawn.kind)


@pytest.mark.parametrize("family", families(assembled=True))
def test_drawn_positions_of_assembled_families_are_those_of_their_equations(family: str) -> None:
    """The moments in H are those of the levers that are drawn, to 1e-6 of the smallest body.

    These families have no simulation: H is what their problems are. A body's own axes turn the
    moments, and leave their sizes.
    """
    plan = set_index.plan_of(family)
    assert isinstance(plan.scene, Assembled)
    problem: Any = plan.scene.problem((plan.chosen or (0,))[0])
    network = network_of(problem)
    if problem.bodies is None:
        # nothing is said of places: what is drawn is a graph, or follows from the levers in H
        assert network.source in ("graph", "H")
        assert "solids" not in view_of(problem)
        return
    assert network.source == "file"
    drawn = record_of(solids_of(problem.bodies, problem.contacts))
    size = solids_of(problem.bodies, problem.contacts).size
    place = np.array(problem.bodies.place)
    shapes = np.array(problem.bodies.shape_body)
    own = np.abs(np.array(problem.bodies.shape_place)).max(axis=1) == 0
    # a shape that is its body's own stands where the body is
    np.testing.assert_allclose(
        np.array(drawn["place"])[own], place[shapes][own], rtol=0, atol=1e-6 * size
    )
    moving = np.flatnonzero(problem.bodies.moves == 1)
    if problem.n == 3 * len(moving):  # points have no moments
        return
    H, d = problem.H.tocoo(), problem.spacedim
    entries = (H.col % d < 3) & (H.row < 6 * len(moving))  # others are coordinates of no body
    row, column, value = H.row[entries], H.col[entries], H.data[entries]
    # the block of each contact and body
    pairs, where = np.unique(np.stack([column // d, row // 6]), axis=1, return_inverse=True)
    blocks = np.zeros((pairs.shape[1], 6, 3))
    np.add.at(blocks, (where.ravel(), row % 6, column % d), value)
    contact, body = pairs[0], moving[pairs[1]]
    own = problem.contacts.body
    assert (own[contact] == body[:, None]).any(axis=1).all()
    assert len(contact) == np.isin(own, moving).sum() or problem.n > 6 * len(moving)
    lever = network.points[contact] - place[body]
    moments = np.linalg.norm(np.cross(lever[:, None], blocks[:, :3].transpose(0, 2, 1)), axis=2)
    expected = np.linalg.norm(blocks[:, 3:], axis=1)
    assert np.abs(moments - expected).max() < 1e-6 * size


def test_positions_do_not_depend_on_bodies_frames(collection: Path) -> None:
    """The rotation of a body turns its part of H and its inertia, and moves nothing."""
    problem = bare(read(sorted(collection.rglob("*-global.hdf5"))[-1]))
    before = network_of(problem)
    H = problem.H.toarray()
    M = problem.M.toarray()
    random = np.random.default_rng(3)
    for body in range(problem.n // 6):
        Q, _ = np.linalg.qr(random.standard_normal((3, 3)))
        Q *= np.sign(np.linalg.det(Q))
        own = slice(6 * body + 3, 6 * body + 6)
        H[own] = Q.T @ H[own]
        M[own, own] = Q.T @ M[own, own] @ Q
    import scipy.sparse as sp

    after = network_of(problem.replace(H=sp.csc_array(H), M=sp.csc_array(M)))
    assert after.placed
    np.testing.assert_allclose(after.points, before.points, atol=1e-6)
    np.testing.assert_allclose(after.bodies, before.bodies, atol=1e-6)


def test_bodies_without_contact_and_rounding_move_nothing(collection: Path) -> None:
    import scipy.sparse as sp

    problem = bare(read(sorted(collection.rglob("*-global.hdf5"))[-1]))
    before = network_of(problem)
    # a body that touches nothing comes first, and rounding ties it to all contacts
    n, m = problem.n, problem.m
    H = np.full((n + 6, m), 1e-17)
    H[6:] = problem.H.toarray()
    M = sp.block_diag([sp.diags_array([2.0, 2.0, 2.0, 0.1, 0.2, 0.3]), problem.M])
    f = np.concatenate([np.zeros(6), problem.f])
    after = network_of(problem.replace(H=sp.csc_array(H), M=sp.csc_array(M), f=f))
    assert after.placed
    np.testing.assert_array_equal(after.pairs, before.pairs)
    np.testing.assert_allclose(after.points, before.points, atol=1e-6)


def test_hulls_are_those_of_each_body(collection: Path) -> None:
    problem = bare(read(sorted(collection.rglob("*-global.hdf5"))[-1]))
    network = network_of(problem)
    for body in range(len(network.bodies)):
        own = np.flatnonzero((network.pairs == body).any(axis=1))
        alone = dataclasses.replace(
            network,
            bodies=network.bodies[[body]],
            points=network.points[own],
            pairs=np.tile([0, -1], (own.size, 1)),
        )
        faces = hulls_of(alone)
        # a closed surface: each edge is of two triangles
        edges = Counter(frozenset(pair) for f in faces for pair in itertools.combinations(f, 2))
        assert set(edges.values()) == {2}
        # of the volume that SciPy finds
        corners = np.concatenate([alone.bodies, alone.points])
        a, b, c = corners[np.array(faces)].transpose(1, 0, 2) - corners.mean(axis=0)
        volume = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c))).sum() / 6
        assert volume == pytest.approx(ConvexHull(corners).volume, rel=1e-6)
    assert not hulls_of(network_of(problem.condense()))


def test_a_matrix_that_is_not_of_rigid_bodies_gives_a_graph(collection: Path) -> None:
    problem = bare(read(sorted(collection.rglob("*-global.hdf5"))[-1]))
    network = network_of(problem.replace(H=problem.H * 2.0))
    assert not network.placed
    assert "graph" in network.note
    assert np.isfinite(network.points).all()
    assert np.isfinite(network.bodies).all()


def test_a_view_counts_as_the_merit_does(collection: Path) -> None:
    files = sorted(collection.rglob("*.hdf5"))[-4:]
    assert len(files) == 4
    for file in files:
        problem, solution = read(file), read_solution(file)
        view = view_of(problem, solution)
        merit = fclib.merit(problem, solution)
        counts = [view["status"].count(str(k)) for k in range(3)]
        assert counts == [merit.open, merit.stick, merit.slide]
        assert view["merit"]["error"] == pytest.approx(merit.error, rel=1e-4)
        r = np.asarray(solution.r).reshape(problem.nc, -1)
        np.testing.assert_allclose(view["reactions"], r, rtol=1e-4, atol=1e-300)
        assert json.dumps(view, allow_nan=False)
        W = problem.W if problem.kind == "local" else problem.condense().W
        values = np.linalg.svd(W.toarray(), compute_uv=False)
        assert view["spectrum"]["rank"] == np.linalg.matrix_rank(W.toarray())
        np.testing.assert_allclose(
            view["spectrum"]["values"], values[: view["spectrum"]["rank"]], rtol=1e-3
        )
        assert view["patterns"][0]["name"] == "W"
        for pattern in view["patterns"]:
            assert sum(pattern["counts"]) == pattern["nnz"]


@pytest.mark.parametrize("kind", ["without contact", "planar", "without solution"])
def test_views_of_any_problem(kind: str, tmp_path: Path) -> None:
    nc = 0 if kind == "without contact" else 3
    d = 2 if kind == "planar" else 3
    W = np.eye(d * nc) + 0.1
    problem = fclib.LocalProblem(spacedim=d, W=W, q=-np.ones(d * nc), mu=np.full(nc, 0.5))
    solution = None if kind == "without solution" else fclib.solve(problem).solution
    record = view_of(problem, solution)
    assert ("network" in record) == (nc > 0)
    write_view(record, tmp_path / "page.html", title="</script><b>")
    page = (tmp_path / "page.html").read_text()
    assert "</script><b>" not in page
    assert not re.search(r"""<(script|link|img)[^>]*=["']?https?:""", page)


# ---- the command line


def test_report_by_the_command_line(store: Path, collection: Path, tmp_path: Path) -> None:
    done = invoke("report", store, "--catalog", collection, "--out", tmp_path / "s", "--views", 1)
    assert "1 view," in done.output
    assert (tmp_path / "s" / "index.html").is_file()
    invoke("report", code=2)
    invoke("report", "--pdf", "--catalog", collection, code=2)
    invoke("report", tmp_path / "none.sqlite", code=1)
    invoke("report", "--catalog", tmp_path, code=1)


def test_view_by_the_command_line(
    collection: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = sorted(collection.rglob("*-local.hdf5"))[-1]
    invoke("view", file, "--out", tmp_path / "v.html")
    assert (tmp_path / "v.html").stat().st_size > 10_000
    invoke("view", tmp_path / "none.hdf5", code=1)
    opened: list[str] = []

    def open_page(address: str) -> bool:
        opened.append(address)
        return True

    monkeypatch.setattr("webbrowser.open", open_page)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    invoke("view", file)
    (address,) = opened
    assert address.startswith("file:")
    assert address.endswith(f"{file.stem}.html")


def test_figures_for_a_paper(store: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    invoke("report", store, "--pdf", "--out", tmp_path / "paper")
    for tol in TOLERANCES:
        folder = tmp_path / "paper" / f"tol-{tol:g}"
        assert (folder / "performance-cpu_s.pdf").read_bytes().startswith(b"%PDF")
        table = (folder / "summary.tex").read_text()
        assert table.count(r"\\") == len(LABELS) - 1 + 2  # without the rare one; best, and heads
        assert "under\\_score" in table
