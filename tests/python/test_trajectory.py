"""Trajectories: a problem is a function of a stored state, whatever solves it and however often."""

import csv
import dataclasses
import importlib
import json
import shutil
import signal
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import _digest, scenes

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")

from fclib import collections, simulate
from fclib.collections import published, set_index, trajectory
from fclib.collections.plan import Plan, Simulation
from fclib.collections.record import record
from helpers_cli import invoke
from workshop.sets import collection_table

read: Any = fclib.read
FOLDER = "rt444/BoxesStack"
NUMBERS = 12


def stack(**parameters: Any) -> scenes.Scene:
    """Boxes that land within a few steps."""
    settings = {"boxes": 3, "gap": 2e-3, "time_step": 5e-3} | parameters
    return scenes.get("BoxesStack")(**settings).scene(seed=0)


def recorded(folder: Path, version: str = "7", **settings: Any) -> Path:
    """A trajectory of a stack, where the published ones of a folder lie."""
    values: Any = {"scene": stack(), "problems": NUMBERS, "simulation": Simulation()} | settings
    plan = Plan(collection="rt444", version=version, **values)
    target = folder / collections.file_name(FOLDER, version)
    record(plan, target, folder / "state.npz")
    return target


def digests(folder: Path) -> dict[str, str]:
    """Of the problems of a built folder, from their files."""
    return {path.name: fclib.digest(read(path)) for path in sorted(folder.rglob("*-global.hdf5"))}


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A package of trajectories, with one of a small stack under the name of the large one."""
    package = tmp_path_factory.mktemp("package")
    recorded(package / published.FOLDER)
    return package


@pytest.fixture
def installed(store: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """That package as the one that is found."""
    monkeypatch.setattr(published, "IN_PLACE", store)
    return store


def plan(**settings: Any) -> Plan:
    """What is built of the small stack that is stored."""
    return collections.plan_of(FOLDER, problems=NUMBERS, **settings)


# ---- states and files

MADE: dict[str, dict[str, Any]] = {
    "BoxesStack": {"boxes": 3, "gap": 2e-3, "time_step": 5e-3},
    "CubesH8x2": {},  # elastic
    "Walker": {},  # with a gait, and bilateral constraints
    "RollingDiscs": {"discs": 6, "per_row": 3},  # in the plane
    "PeriodicBox": {"bodies": 12},
}


@pytest.mark.parametrize("name", MADE)
def test_problem_follows_from_its_stored_state_alone(name: str, tmp_path: Path) -> None:
    if name == "CubesH8x2":
        pytest.importorskip("skfem")
    family: Any = scenes.get(name)
    fields = {field.name for field in dataclasses.fields(family)}
    scene = family(**{k: v for k, v in MADE[name].items() if k in fields}).scene(seed=0)
    target = tmp_path / f"x{trajectory.SUFFIX}"
    record(Plan(scene=scene, collection="x", problems=8), target, tmp_path / "state.npz")
    states = trajectory.read(target)
    assert len(states) == 8
    assert states.scene == dataclasses.replace(scene, parameters=dict(scene.parameters))
    # in another order, and by a model that has seen nothing else
    for place in reversed(range(8)):
        problem = states.problem(place).problem
        assert fclib.digest(problem) == states.digest[place]
        assert _digest.structure(problem) == states.structure[place]
        assert states.differences(place, problem) == {}
    alone = trajectory.read(target).problem(5).problem
    assert fclib.digest(alone) == states.digest[5]


def test_equal_trajectories_are_equal_files(store: Path, tmp_path: Path) -> None:
    again = recorded(tmp_path)
    first = store / published.FOLDER / collections.file_name(FOLDER, "7")
    assert again.read_bytes() == first.read_bytes()
    copy = tmp_path / f"copy{trajectory.SUFFIX}"
    trajectory.write(copy, trajectory.read(first))
    assert copy.read_bytes() == first.read_bytes()


def test_file_says_what_simulated_it(store: Path) -> None:
    path = store / published.FOLDER / collections.file_name(FOLDER, "7")
    with zipfile.ZipFile(path) as archive:
        head = json.loads(archive.read("trajectory.json"))
    assert head["problems"] == NUMBERS
    origin = head["origin"]
    assert (origin["collection"], origin["version"]) == ("rt444", "7")
    assert origin["settings"]["solver"] == "auto"
    assert origin["settings"]["tol"] == 1e-12
    assert origin["settings"]["fclib"] == fclib.__version__
    assert "<mujoco" in head["scene"]["xml"]


@pytest.mark.parametrize("exponent", [-30, -12, 0])
def test_integers_survive_packing(exponent: int) -> None:
    random = np.random.default_rng(1)
    integers = random.integers(-(2**40), 2**40, size=(7, 5))
    integers[:, 2] = 0
    values = np.ldexp(integers.astype(float), exponent)
    data, width = trajectory.packed(values, exponent)
    assert len(data) == width * values.size
    back = trajectory.unpacked(data, shape=list(values.shape), bytes=width, exponent=exponent)
    np.testing.assert_array_equal(back, values)
    for rows in (0, 1):
        data, width = trajectory.packed(values[:rows], exponent)
        back = trajectory.unpacked(data, shape=[rows, 5], bytes=width, exponent=exponent)
        np.testing.assert_array_equal(back, values[:rows])


def test_rounding_is_below_its_quantum() -> None:
    values = np.random.default_rng(2).uniform(-100, 100, 1000)
    rounded = trajectory.rounded(values, -30)
    assert 0 < np.abs(rounded - values).max() <= 2.0**-31
    np.testing.assert_array_equal(trajectory.rounded(rounded, -30), rounded)
    for value in (np.inf, np.nan, 2.0**30):
        with pytest.raises(ValueError, match="out of range"):
            trajectory.rounded(np.array([value]), -30)


def test_files_that_are_none(store: Path, tmp_path: Path) -> None:
    good = store / published.FOLDER / collections.file_name(FOLDER, "7")
    path = tmp_path / "bad.trajectory"
    path.write_bytes(b"nonsense")
    with pytest.raises(collections.TrajectoryError, match=r"bad\.trajectory: is no trajectory"):
        trajectory.read(path)
    content = good.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(collections.TrajectoryError, match="damaged"):
        trajectory.read(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("trajectory.json", json.dumps({"format": 99}))
    with pytest.raises(collections.TrajectoryError, match="of format 99"):
        trajectory.read_origin(path)
    with pytest.raises(FileNotFoundError):
        trajectory.read(tmp_path / "none")


def test_a_trajectory_is_never_rewritten(store: Path) -> None:
    before = {path: path.read_bytes() for path in store.rglob("*.trajectory")}
    with pytest.raises(FileExistsError, match="never rewritten"):
        recorded(store / published.FOLDER, scene=stack(boxes=2))
    assert {path: path.read_bytes() for path in store.rglob("*.trajectory")} == before


KILLED = """
import sys
from pathlib import Path
from fclib import scenes
from fclib.collections import record
module = sys.modules["fclib.collections.record"]
from fclib.collections.plan import Plan, Simulation

module.CHECKPOINT = 0.0  # at each step
scene = scenes.get("BoxesStack")(boxes=3, gap=2e-3, time_step=5e-3).scene(seed=0)
plan = Plan(scene=scene, collection="rt444", version="7", problems=12, simulation=Simulation())
folder = Path(sys.argv[1])
record(plan, folder / "x.trajectory", folder / "state.npz",
       lambda name, done, total: print(done, flush=True))
"""


@pytest.mark.slow
def test_killed_simulations_go_on_and_end_the_same(store: Path, tmp_path: Path) -> None:
    seen: list[int] = []
    for after in (2, 3, None):
        command = [sys.executable, "-c", KILLED, str(tmp_path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            for lines, line in enumerate(process.stdout, start=1):
                seen.append(int(line))
                if lines == after:
                    process.send_signal(signal.SIGKILL)
                    break
    # each went on where the one before was, or a step behind
    assert len(seen) <= NUMBERS + 2
    assert seen[-1] == NUMBERS
    whole = store / published.FOLDER / collections.file_name(FOLDER, "7")
    assert (tmp_path / "x.trajectory").read_bytes() == whole.read_bytes()
    assert not (tmp_path / "state.npz").exists()


# ---- problems do not depend on what solves them


def test_problems_are_assembled_without_a_solve(
    installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*args: Any, **options: Any) -> None:
        raise AssertionError("nothing is solved where problems are assembled")

    for module in ("fclib._solve", "fclib.simulate.simulation", "fclib.collections.build"):
        loaded = importlib.import_module(module)
        monkeypatch.setattr(getattr(loaded, "_solve", loaded), "solve", never)
    table = collections.build([plan(references=False)], tmp_path, pictures=False)
    assert table.num_rows == NUMBERS
    assert set(table["status"].to_pylist()) == {None}
    assert all(verdict.ok for verdict in collections.verify(tmp_path))
    assert fclib.read_solution(tmp_path / FOLDER / "0000-global.hdf5") is None


@pytest.mark.parametrize("solver", ["nsgs", "psor", "nsn-ac"])
def test_another_solver_changes_no_problem(installed: Path, tmp_path: Path, solver: str) -> None:
    """Nor would another constant of `auto`: no problem sees a solver."""
    settings: Any = {"form": "global", "solver": solver}
    table = collections.build([plan(**settings)], tmp_path / "other", pictures=False)
    # others find the last digits
    assert {name.split(", ")[0] for name in table["solver"].to_pylist()} == {solver}
    collections.build([plan(form="global")], tmp_path / "auto", pictures=False)
    made = digests(tmp_path / "other")
    assert len(made) == NUMBERS
    assert made == digests(tmp_path / "auto")
    assert {set_index.origin_of(row) for row in table.to_pylist()} == {"published"}


def test_another_solver_of_the_simulation_is_another_version(
    installed: Path, tmp_path: Path
) -> None:
    settings: Any = {"scene": stack(boxes=3), "simulation": Simulation(solver="nsgs", tol=1e-4)}
    other = recorded(tmp_path, version="own", **settings)
    assert trajectory.read(other).origin["settings"]["solver"] == "nsgs"
    own = collections.from_folder(plan(), tmp_path)
    assert (own.version, own.trajectory) == ("own", other)
    table = collections.build([own], tmp_path / "built", pictures=False)
    assert {set_index.origin_of(row) for row in table.to_pylist()} == {"yours"}


def test_frozen_problems_outlive_their_family(
    installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scene is the file's: what the family's code says by now does not matter."""
    before = collections.build([plan()], tmp_path / "before", pictures=False)
    other = stack(size=9.0)
    monkeypatch.setattr(scenes.get("BoxesStack"), "scene", lambda self, seed=0: other)
    after = collections.build([plan()], tmp_path / "after", pictures=False)
    assert after["digest"].to_pylist() == before["digest"].to_pylist()


# ---- versions


def test_newest_version_is_meant_and_older_ones_stay(store: Path, tmp_path: Path) -> None:
    folder = tmp_path / "package"
    shutil.copytree(store, folder)
    recorded(folder / published.FOLDER, version="10", scene=stack(boxes=2))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(published, "IN_PLACE", folder)
        assert published.versions(FOLDER) == ["7", "10"]
        assert set_index.version_of(FOLDER) == plan().version == "10"
        assert plan().scene.parameters["boxes"] == 2
        older = plan(version="7")
        assert (older.version, older.scene.parameters["boxes"]) == ("7", 3)
        with pytest.raises(collections.VersionError, match=r"version 8 is not stored.*7, 10"):
            plan(version="8")
        collections.build([older], tmp_path / "built", pictures=False)
        rows = collections.read_catalog(tmp_path / "built").to_pylist()
        assert {set_index.origin_of(row) for row in rows} == {"published"}
        assert {row["version"] for row in rows} == {"7"}
        # what a name means now is not what lies there
        with pytest.raises(collections.VersionError, match=r"holds version 7.* present one is 10"):
            fclib.load(f"{FOLDER}/0003", folder=tmp_path / "built")
    assert set_index.version_of("planar/DiscFlow") == collections.version("planar")


def test_another_seed_is_yours(installed: Path, tmp_path: Path) -> None:
    other = plan(seed=3)
    assert other.trajectory is None
    quick = dataclasses.replace(other, scene=dataclasses.replace(stack(), seed=3), problems=2)
    collections.build([quick], tmp_path, pictures=False)
    assert (tmp_path / FOLDER / trajectory.OWN).is_file()
    rows = collections.read_catalog(tmp_path).to_pylist()
    assert {set_index.origin_of(row) for row in rows} == {"yours"}


@pytest.mark.parametrize(
    ("share", "status", "origin"),
    [(0.0, "ok", "published"), (1e-13, "ok", "differs"), (1e-3, "not published", "differs")],
)
def test_verify_says_by_how_much_a_problem_differs(
    installed: Path, tmp_path: Path, share: float, status: str, origin: str
) -> None:
    collections.build([plan(form="global")], tmp_path, pictures=False)
    rows = collections.read_catalog(tmp_path).to_pylist()
    row = rows[5]
    path = tmp_path / row["global_file"]
    problem, solution = read(path), fclib.read_solution(path)
    fclib.write(path, problem.replace(f=(1 + share) * problem.f), solution)
    row |= {
        "digest": fclib.digest(read(path)),
        "global_sha256": collections.catalog.sha256(path),
        "error": 1.0,
    }
    collections.catalog.write_catalog(tmp_path / collections.catalog.FILE, rows)
    (verdict,) = (one for one in collections.verify(tmp_path) if one.id == row["id"])
    assert (verdict.status, verdict.origin) == (status, origin)
    if share:
        # to the digits that are left of it
        assert dict(verdict.differences) == {"f": pytest.approx(share, rel=1e-15 / share)}
    told = invoke("collection", "verify", tmp_path, code=int(status != "ok"))
    words = {"published": "have the data of the published version", "differs": "1 problem differs"}
    assert words[origin] in told.output


def test_what_cancels_in_the_sums_is_measured(
    installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two entries that differ by opposite amounts; where nothing assembles, there are the sums."""
    collections.build([plan(form="global")], tmp_path, pictures=False)
    row = collections.read_catalog(tmp_path).to_pylist()[5]
    problem = read(tmp_path / row["global_file"])
    path = published.path_of(FOLDER, row["version"])
    assert path is not None
    states = trajectory.read(path)
    place = states.index(row["number"])
    distance = importlib.import_module("fclib.collections.verify").distance
    changed, share = problem.H.copy(), 1e-3 * np.abs(problem.H.data).max()
    for other in range(1, changed.nnz):
        changed.data[:] = problem.H.data
        changed.data[[0, other]] += [share, -share]
        wrong = problem.replace(H=changed)
        if not states.differences(place, wrong):
            break
    assert states.differences(place, wrong) == {}
    assert distance(wrong, row) == {"H": pytest.approx(1e-3)}

    def missing(*_: Any) -> Any:
        raise ImportError("MuJoCo")

    monkeypatch.setattr(trajectory.Trajectory, "problem", missing)
    assert distance(wrong, row) == {}


def test_differences_of_two_problems() -> None:
    problem = read(set_index.DATA / "tiny/KaplasTower/0030-global.hdf5")
    H = problem.H.copy()
    place = np.abs(H.data).argmax()
    largest = abs(H.data[place])
    H.data[place] += 1e-5 * largest
    assert _digest.difference(problem, problem) == {}
    assert _digest.difference(problem, problem.replace(H=H)) == pytest.approx({"H": 1e-5})
    sketch = _digest.sketch(problem)
    assert _digest.distance(problem, sketch) == {}
    apart = _digest.distance(problem.replace(H=H), sketch)["H"]
    assert apart == pytest.approx(1e-5 * largest / np.linalg.norm(H.data), rel=1e-6)
    # an entry that is 0 on one machine, and rounding on another, is no other structure
    H.data[place] = 1e-17
    tiny = problem.replace(H=H)
    H = H.copy()
    H.data[place] = 0.0
    assert _digest.structure(problem.replace(H=H)) == _digest.structure(tiny)
    assert _digest.structure(problem) != _digest.structure(tiny)


# ---- the package


def test_package_is_found_where_it_is_installed(
    store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(published, "IN_PLACE", tmp_path / "none")
    monkeypatch.setattr(published, "PACKAGE", "fclib_collection_of_a_test")
    assert published.root() is None
    assert published.versions(FOLDER) == []
    site = tmp_path / "site" / "fclib_collection_of_a_test"
    shutil.copytree(store, site)
    (site / "__init__.py").touch()
    monkeypatch.syspath_prepend(site.parent)
    assert published.root() == site / published.FOLDER
    assert published.versions(FOLDER) == ["7"]


# ---- what is published

STORED = sorted(
    path.relative_to(published.IN_PLACE / published.FOLDER).as_posix()
    for path in published.IN_PLACE.rglob(f"*{trajectory.SUFFIX}")
)
STORED.sort(key=lambda name: name.partition("/")[2])  # those of a family follow each other
# what the sets have now, of which states are published
PRESENT = {
    folder: f"{folder}-{set_index.version_of(folder)}{trajectory.SUFFIX}"
    for name in sorted({name.partition("/")[0] for name in STORED})
    for folder in set_index.sets()[name]
}
there = pytest.mark.skipif(not STORED, reason="collection/ is not here: a source distribution")
CORE = ("rt444", "tiny", "hard", "standard")
LIMITS = {"core": 25e6, "all": 60e6}  # bytes, of what is stored in the repository
# of RT-0444, page by page: degrees of freedom, contacts; and the smallest thickness of a body
RANGES: dict[str, Any] = {
    "BoxesStack": ((6, 300), (1, 200), lambda p: p["size"]),
    "Capsules": ((6, 600), (1, 300), lambda p: 2 * p["radius"]),
    "Chain": ((48, 60), (8, 28), lambda p: p["thickness"]),
    "KaplasTower": ((66, 864), (39, 1104), lambda p: p["thickness"]),
}
# penetration of stored states, of the diameter of the smallest body
DEEPEST = 0.02
# that of states which another engine handed over
HANDED = 0.2
LARGE = 5_000  # coordinates
with collection_table.PUBLISHED.open(newline="") as file:
    SIZES = {
        row["ours"].split()[0]: row
        for row in csv.DictReader(file)
        if row["ours"].startswith(("rr9118/", "fclib2024/"))
    }
# ends that other ends exclude, or that the page explains
NOT_MET = {
    "rr9118/CubesH8": ("density",),
    "rr9118/CubesH8x2": ("density",),
    "rr9118/Chain": ("contacts",),
    "rr9118/KaplasTower": ("density",),
    "rr9118/PeriodicBox": ("contacts",),
    "fclib2024/Chute": ("contacts", "dof"),
    "fclib2024/RollingChute": ("dof",),
    "fclib2024/SpheresPile": ("contacts",),
}
MODELS: list[Any] = []  # of the family that was tested last


def share_model(states: Any) -> None:
    """Several sets have one scene: its model, which takes seconds to make, is made once."""
    if states.scene.solids is not None or states.handed is not None:
        return
    if MODELS and MODELS[0].scene.name != states.scene.name:
        MODELS.clear()
    equal = [model for model in MODELS if model.scene == states.scene]
    if equal:
        vars(states)["model"] = equal[0]  # where a cached property keeps its value
    else:
        MODELS.append(states.model)


@pytest.fixture(scope="module", params=STORED or ["none"])
def stored(request: pytest.FixtureRequest) -> tuple[str, Path, Any]:
    """Name, file and states of a published trajectory; tests of one follow each other."""
    name = request.param
    path = published.IN_PLACE / published.FOLDER / name
    states = trajectory.read(path)
    share_model(states)
    return name, path, states


@there
def test_published_trajectories_are_few_megabytes() -> None:
    names = {name.rpartition("-")[0] for name in STORED}
    assert names >= set(collections.sets()["rt444"])
    simulated = {
        name for name in collections.sets()["tiny"] if name.split("/")[1] in scenes.families()
    }
    assert names >= simulated
    sizes = {name: (published.IN_PLACE / published.FOLDER / name).stat().st_size for name in STORED}
    core = sum(size for name, size in sizes.items() if name.partition("/")[0] in CORE)
    assert core < LIMITS["core"]
    assert sum(sizes.values()) < LIMITS["all"]


@there
@pytest.mark.slow
def test_published_trajectory_is_what_its_name_says(stored: tuple[str, Path, Any]) -> None:
    """Its name, and the digests and depths of some problems."""
    name, path, states = stored
    folder, _, version = name.removesuffix(trajectory.SUFFIX).rpartition("-")
    # a list may call a family otherwise
    own = f"{states.origin['collection']}/{states.scene.name}"
    assert own == f"{folder.partition('/')[0]}/{set_index.kind_of(folder)}"
    assert states.origin["version"] == version
    assert published.path_of(folder, version) == path
    assert int(version) <= int(collections.version(folder.split("/")[0]))
    assert collections.plan_of(folder, version=version).trajectory == path
    # the newest one has all problems of the set
    newest = collections.plan_of(folder)
    if newest.version == version:
        assert states.number.tolist() == newest.numbers().tolist()
    bound = deepest(states)
    last = len(states) - 1
    # a large mesh takes seconds
    for place in {last} if states.position.shape[1] > LARGE else {0, last // 2, last}:
        part = states.problem(place)
        check_digest(folder, states, place, part.problem)
        assert least_gap(states, part) > -bound


@there
@pytest.mark.long
def test_depths_and_sizes_of_all_that_is_published(stored: tuple[str, Path, Any]) -> None:
    """Of the problems of the sets whose sizes were published; of 20 of each other trajectory."""
    name, _, states = stored
    folder, _, version = name.removesuffix(trajectory.SUFFIX).rpartition("-")
    row = SIZES.get(folder) if collections.plan_of(folder).version == version else None
    bound = deepest(states)
    sizes = []
    some = set(np.linspace(0, len(states) - 1, 20).astype(int).tolist())
    for place in range(len(states)) if row else sorted(some):
        if states.handed is not None:
            part = states.problem(place)
        else:
            part = simulate.problem_at(
                states.model, states.scheme, states.position[place], states.velocity[place]
            )
        if place in some:
            assert least_gap(states, part) > -bound
        problem = part.problem
        sizes.append({"n": problem.n, "nc": problem.nc, "density": problem.m / problem.n})
    if row:
        # where the published ranges of a set allow it; both ends to a tenth, as the table says
        off = {word.split()[0] for word in collection_table.within(row, sizes, []).split(", ")}
        assert off <= {"yes", *NOT_MET.get(folder, ())}


def least_gap(states: Any, part: Any) -> float:
    """Of bodies that touch: a joint's limit has none [m]."""
    if states.handed is not None:
        gap = part.problem.contacts.gap
    else:
        gap = part.contacts.gap[part.contacts.pair[:, 0] >= 0]
    return float(gap.min(initial=0.0))


def check_digest(folder: str, states: Any, place: int, problem: Any) -> None:
    """Bit for bit here, or up to rounding where mathematical libraries differ."""
    apart = states.differences(place, problem)
    assert max(apart.values(), default=0.0) < 1e-12, apart
    # those of rr9118 are equal everywhere, but for the sums of a large mesh
    if not apart or (folder.startswith("rr9118/") and problem.n < 50000):
        assert fclib.digest(problem) == states.digest[place]


def deepest(states: Any) -> float:
    """How deep bodies may be in each other [m]."""
    if states.scene.interactions:
        return float("inf")  # the laws of a deck keep penetrations
    if states.handed is not None:
        size = min(min(one.size) for one in states.handed.solids if one.mass)
    else:
        size = states.model.smallest_size
    if size is None:
        size = 0.5 * min(min(block.size) for block in states.scene.solids.blocks)
    # Siconos pushes no bodies apart: how deep an impact has left them they stay
    bound = DEEPEST if states.handed is None else HANDED
    return float(bound * 2 * size)


@there
def test_the_published_sizes_are_those_of_sets_with_states() -> None:
    there = {folder for folder in SIZES if PRESENT.get(folder) in STORED}
    assert there >= set(NOT_MET)
    assert len(there) >= 15


@there
@pytest.mark.slow
@pytest.mark.parametrize("name", RANGES)
def test_published_sets_are_within_the_ranges_of_the_report(name: str) -> None:
    folder = f"rt444/{name}"
    path = published.path_of(folder, set_index.version_of(folder))
    assert path is not None
    states = trajectory.read(path)
    dofs, contacts, thickness = RANGES[name]
    limit = (0.02 if states.handed is None else HANDED) * thickness(states.scene.parameters)
    for place in np.linspace(0, len(states) - 1, 20).astype(int).tolist():
        part: Any = states.problem(place)
        assert dofs[0] <= part.problem.n <= dofs[1]
        assert contacts[0] <= part.problem.nc <= contacts[1]
        gap = (part.problem if states.handed is not None else part).contacts.gap
        assert gap.min() > -limit


@there
def test_the_bound_is_that_of_all_families_of_published_sets() -> None:
    """Only problems that no simulation makes have no states."""
    without = {set_index.kind_of(name) for name, path in PRESENT.items() if path not in STORED}
    assert "LocalProblems" in without
    assert not without - scenes.assemblies().keys()


@there
def test_the_stack_of_boxes_stands_and_its_ground_carries_it() -> None:
    path = published.path_of("rt444/BoxesStack", set_index.version_of("rt444/BoxesStack"))
    assert path is not None
    states = trajectory.read(path)
    assert states.handed is not None
    count, edge = states.scene.parameters["boxes"], states.scene.parameters["size"]
    places = states.position.reshape(len(states), count, 7)[:, :, :3]
    above = np.arange(count) * edge + 0.5 * edge
    stands = (np.linalg.norm(places[:, :, :2], axis=2) < 0.5 * edge) & (
        np.abs(places[:, :, 2] - above) < 0.15 * edge
    )
    assert stands.all(axis=1).any()  # all boxes, once
    # at the end what is left of it has nothing that drops on it any more
    weights, carried = [], []
    for place in range(len(states) - 20, len(states)):
        problem: Any = states.problem(place).problem
        result: Any = fclib.solve(problem, time_limit=20.0)
        r = np.reshape(result.solution.r, (-1, 3))
        ground = (problem.contacts.body == 0).any(axis=1)
        carried.append(r[ground, 0].sum() / (states.time_step * states.handed.gravity))
        weights.append(problem.n / 6)
    assert np.mean(carried) == pytest.approx(np.mean(weights), rel=0.05)


# ---- commands


def test_simulate_and_build_by_commands(tmp_path: Path) -> None:
    own = tmp_path / "own"
    arguments = ("collection", "simulate", "tiny/KaplasTower", "--out", own)
    done = invoke(*arguments, "--solver", "nsgs", "--tol", "1e-6")
    assert (own / "tiny/KaplasTower-own.trajectory").is_file()
    again = invoke(*arguments, code=1)
    assert "never rewritten" in again.output
    built = ("collection", "build", "tiny/KaplasTower", "--no-pictures")
    done = invoke(*built, "--from", own, "--out", tmp_path / "built")
    assert "yours" in done.output
    assert "simulated here" not in done.output
    (row,) = collections.read_catalog(tmp_path / "built").to_pylist()
    assert (row["id"], row["version"]) == ("tiny/KaplasTower/0030", "own")
    nothing = invoke(*built, "--from", tmp_path, "--out", tmp_path / "none", code=1)
    assert "needs one trajectory of tiny/KaplasTower, and has none" in nothing.output
    invoke("collection", "simulate", "Wall", "--out", own, code=1)


def test_a_trajectory_may_keep_some_problems_alone(tmp_path: Path) -> None:
    """Those at equal distances are stored, and a build takes them, or some of them."""
    own = tmp_path / "own"
    invoke("collection", "simulate", "RockingBlock", "--count", 4, "--out", own)
    whole = collections.fresh_plan("impacts/RockingBlock")
    built = ("collection", "build", "RockingBlock", "--from", own, "--no-pictures")
    for count, kept in (((), 4), (("--count", 2), 2)):
        out = tmp_path / f"built{kept}"
        invoke(*built, *count, "--no-references", "--out", out)
        numbers = [row["number"] for row in collections.read_catalog(out).to_pylist()]
        assert (numbers[0], numbers[-1], len(numbers)) == (0, whole.total - 1, kept)


def test_build_simulates_only_where_it_may(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(published, "IN_PLACE", tmp_path)
    arguments = ("collection", "build", "tiny/KaplasTower", "--out", tmp_path / "built")
    refused = invoke(*arguments, "--no-simulate", code=1)
    assert "no trajectory is stored of tiny/KaplasTower" in refused.output
    assert not (tmp_path / "built").exists()
    done = invoke(*arguments, "--no-pictures")
    assert "tiny/KaplasTower: no states of it are published" in done.output
    missing = invoke(*arguments, "--version", "3", code=1)
    assert "version 3 is not stored here" in missing.output
