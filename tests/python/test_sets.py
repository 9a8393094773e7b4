"""Sets: what they hold, the problems that come with the package, and how lists are chosen."""

import importlib.util
import json
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import scenes

pytest.importorskip("pyarrow")

from fclib import collections
from fclib.collections import catalog, set_index
from fclib.collections.plan import Plan
from fclib.scenes.local_problems import LocalProblems
from helpers import ran
from helpers_cli import invoke
from workshop.sets import choose

TINY = set_index.DATA / "tiny"
FILES = sorted(TINY.glob("*/*.hdf5"))


# ---- sets


def test_every_family_is_in_a_set_that_is_known() -> None:
    sets = collections.sets()
    for name, family in collections.families().items():
        assert family.collection in set_index.SETS, name
        assert f"{family.collection}/{name}" in sets[family.collection]
        assert f"{family.collection}/{name}" in sets["extended"] + sets["rt444"] + sets["ladder"]


def test_versions_are_in_list_plan_and_catalogue() -> None:
    listed = [
        json.loads(line)
        for line in invoke("collection", "list", "--sets", "--json").output.splitlines()
    ]
    assert {row["set"]: row["version"] for row in listed}["rt444"] == collections.version("rt444")
    plan = collections.plan_of("rt444/Chain")
    assert (plan.version, plan.problems) == (collections.version("rt444"), 1514)
    assert json.loads(plan.fingerprint())["version"] == plan.version
    for row in collections.read_catalog(set_index.DATA).to_pylist():
        assert row["version"] == set_index.version_of(f"tiny/{row['family']}")


def test_set_is_shown_with_its_problems() -> None:
    shown = invoke("collection", "show", "tiny")
    for choice in set_index.choices("tiny"):
        assert choice.family in shown.output
    assert "rt444/Chain" in invoke("collection", "show", "rt444").output


def test_list_refuses_what_would_change_it(tmp_path: Path) -> None:
    done = invoke("collection", "build", "tiny", "--count", 1, "--out", tmp_path, code=2)
    assert "no count and no selection" in done.output


def test_family_of_local_problems_is_built_with_its_figure(tmp_path: Path) -> None:
    table = collections.build([Plan.of_family("LocalProblems", count=3)], tmp_path)
    assert table["global_file"].to_pylist() == [None] * 3
    assert table["density"].to_pylist() == [None] * 3
    assert all(verdict.ok for verdict in collections.verify(tmp_path))
    problems = fclib.collection("LocalProblems", tmp_path)
    assert problems.path(0).name == "0000-local.hdf5"
    with pytest.raises(KeyError, match="global form"):
        problems.path(0, "global")
    if importlib.util.find_spec("matplotlib"):
        assert (tmp_path / "local/LocalProblems/distribution.svg").is_file()


def test_older_catalogue_without_version_is_read(tmp_path: Path) -> None:
    pa = catalog.arrow()
    table = collections.read_catalog(set_index.DATA).drop_columns(["version"])
    pa.parquet.write_table(table, tmp_path / catalog.FILE)
    assert collections.read_catalog(tmp_path)["version"].to_pylist() == [None] * table.num_rows


# ---- tiny


def test_tiny_has_every_kind_and_is_small() -> None:
    problems: list[Any] = [fclib.read(path) for path in FILES]
    kinds = {(problem.kind, problem.spacedim) for problem in problems}
    assert kinds >= {(form, d) for form in ("global", "local") for d in (2, 3)}
    assert kinds >= {(f"{form}_rolling", d) for form in ("global", "local") for d in (3, 5)}
    assert {problem.formulation for problem in problems} >= {"GM3DFC", "M3DFC"}
    assert sum(path.stat().st_size for path in TINY.rglob("*")) < 1e6


def test_tiny_is_as_its_catalogue_says() -> None:
    verdicts = list(collections.verify(set_index.DATA))
    assert len(verdicts) == len(FILES)
    assert all(verdict.ok for verdict in verdicts)
    rows = collections.read_catalog(set_index.DATA).to_pylist()
    assert {set_index.origin_of(row) for row in rows} == {"published"}
    assert [row["error"] <= 1e-8 for row in rows] == [True] * len(choose.TINY)


def test_tiny_is_there_without_a_build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FCLIB_COLLECTION", str(tmp_path))
    problems = fclib.collection("tiny")
    assert len(problems) == len(choose.TINY)
    for name, problem in zip(problems.ids, problems, strict=True):
        assert fclib.digest(fclib.load(name)) == fclib.digest(problem)
        solution: Any = problems.solution(name)
        assert fclib.merit(problem, solution).error <= 1e-8
    assert fclib.load("tiny/LocalProblems/0000").kind == "local"
    assert fclib.load("tiny/Wall/0003", "local").kind == "local"
    with pytest.raises(KeyError, match="no problem 'tiny/Wall/0004'"):
        fclib.load("tiny/Wall/0004")
    assert not list(tmp_path.iterdir())


def test_tiny_needs_neither_pyarrow_nor_mujoco() -> None:
    code = (
        "import sys\n"
        "for name in ('pyarrow', 'mujoco', 'pooch', 'matplotlib'): sys.modules[name] = None\n"
        "import fclib\n"
        "print(fclib.load('tiny/RollingDiscs/0040').formulation)"
    )
    done = ran(sys.executable, "-c", code)
    assert done.stdout.strip() == fclib.load("tiny/RollingDiscs/0040").formulation


def close(first: Any, second: Any) -> bool:
    """Whether two problems are equal but for rounding."""
    for name in ("M", "H", "G", "f", "w", "b", "W", "q", "mu", "mu_r"):
        pair: list[Any] = [getattr(problem, name, None) for problem in (first, second)]
        if all(value is None for value in pair):
            continue
        a, b = (np.asarray(x.toarray() if hasattr(x, "toarray") else x) for x in pair)
        bound = 1e-9 * np.abs(a).max(initial=1)
        if a.shape != b.shape or not np.allclose(a, b, rtol=0, atol=bound):
            return False
    return True


@pytest.mark.slow
def test_tiny_is_regenerated(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    plans = [collections.plan_of(folder) for folder in collections.folders(["tiny"])]
    collections.build(plans, tmp_path, pictures=False)
    for path in FILES:
        shipped, made = (
            fclib.read(base / path.relative_to(TINY)) for base in (TINY, tmp_path / "tiny")
        )
        if fclib.digest(shipped) != fclib.digest(made):
            # another machine's mathematical library may round otherwise
            assert close(shipped, made), path
            warnings.warn(f"{path.name}: equal but for rounding on this machine", stacklevel=1)


def test_tiny_list_is_what_the_command_writes(tmp_path: Path) -> None:
    """For a part of it, since the rest is regenerated above."""
    listed = {choice.family: choice for choice in set_index.choices("tiny")}
    assert [choice.family for choice in set_index.choices("tiny")] == [
        family for family, *_ in choose.TINY
    ]
    for family, parameters, number in choose.TINY:
        assert listed[family].number == number
        assert listed[family].parameters.items() >= parameters.items()
        if family in scenes.assemblies():
            assert choose.choice_of(family, parameters, 0, number) == listed[family]
    path = tmp_path / "list.json"
    choose.write_list(path, listed.values(), {"kinds": len(listed)})
    assert path.read_text() == (set_index.DATA / "tiny.json").read_text()


# ---- lists


def test_a_list_is_built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = tmp_path / "data"
    data.mkdir()
    wall = next(c for c in set_index.choices("tiny") if c.family == "Wall")
    choose.write_list(data / "hard.json", [wall], {})
    monkeypatch.setattr(set_index, "DATA", data)
    set_index.choices.cache_clear()
    try:
        assert collections.folders(["hard"]) == ["hard/Wall"]
        done = invoke("collection", "build", "hard", "--out", tmp_path / "built", "--no-pictures")
        assert "differ" not in done.output
        row = collections.read_catalog(tmp_path / "built").to_pylist()[0]
        assert (row["id"], row["version"]) == ("hard/Wall/0003", collections.version("hard"))
        assert set_index.origin_of(row) == "published"
        assert set_index.origin_of({**row, "digest": "0"}) == "differs"
        assert set_index.origin_of({**row, "version": "0"}) == "yours"
    finally:
        set_index.choices.cache_clear()


def test_two_scenes_of_one_name_in_a_list_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wall = next(c for c in set_index.choices("tiny") if c.family == "Wall")
    other = set_index.Choice("Wall", {**wall.parameters, "mu": 0.1}, 0, 1, 1, "")
    choose.write_list(tmp_path / "odd.json", [wall, other], {})
    monkeypatch.setattr(set_index, "DATA", tmp_path)
    set_index.choices.cache_clear()
    try:
        with pytest.raises(ValueError, match=r"odd/Wall: the list odd\.json has two scenes"):
            collections.plan_of("odd/Wall")
    finally:
        set_index.choices.cache_clear()


# ---- local


def test_one_contact_of_a_problem_has_its_solution() -> None:
    """W_cc and q_c at the solution: r_c solves it."""
    for name in ("KaplasTower/0030", "RollingDiscs/0040", "FourBar/0150"):
        path = TINY / f"{name}-local.hdf5"
        whole: Any = fclib.read_solution(path)
        problem: Any = fclib.read(path)
        d = problem.spacedim
        contacts = list(choose.contacts_of(path))
        assert contacts
        for c, one in contacts:
            own = fclib.Solution(r=whole.r[d * c : d * c + d])
            size = np.linalg.norm(problem.q)
            assert fclib.merit(one, own).natural * np.linalg.norm(one.q) < 1e-7 * size


def test_hardest_contacts_are_found_again(tmp_path: Path) -> None:
    settings: Any = {"per_family": 2, "spins": 40, "asymmetric": 3}
    found = choose.local(set_index.DATA, **settings)
    families = {contact.origin.split("/")[1] for contact in found[:-3]}
    assert families == {family for family, *_ in choose.TINY} - {"LocalProblems"}
    for contact in found[-3:]:
        W = np.asarray(contact.problem.W)
        assert np.abs(W - W.T).max() > 1e-3 * np.abs(W).max()
    assert [contact.problem.spacedim for contact in found[-3:]] == [3, 3, 5]
    # the hardest first, and none that is the same to all local solvers
    by_family: dict[str, list[choose.Contact]] = {}
    for contact in found:
        family = contact.origin.rpartition("/")[0] or str(contact.problem.spacedim)
        by_family.setdefault(family, []).append(contact)
    for own in by_family.values():
        difficulties = [contact.difficulty for contact in own]
        assert difficulties == sorted(difficulties, reverse=True)
        assert len({tuple(contact.sweeps.values()) for contact in own}) == len(own)
    choose.write_local(tmp_path / "list.json", found, {})
    rows = json.loads((tmp_path / "list.json").read_text())["problems"]
    for row, contact in zip(rows, found, strict=True):
        np.testing.assert_array_equal(row["W"], contact.problem.W)
        np.testing.assert_array_equal(row["q"], contact.problem.q)


def test_local_problems_are_solved_and_some_are_not_symmetric() -> None:
    family: Any = scenes.assemblies()["LocalProblems"]
    plan = Plan.of_family("LocalProblems")
    assert plan.total == family.problems >= 100
    found = set()
    asymmetric = {3: 0, 5: 0}
    rounded: list[int] = []
    for number in range(plan.total):
        problem: Any = family().problem(number)
        assert problem.nc == 1
        result = fclib.solve(problem, tol=1e-10)
        if not result.converged:  # its reactions are 5e6 beside velocities of 1
            rounded.append(number)
            assert "last digit" in result.message
            assert result.error <= 2e-10
        W = np.asarray(problem.W)
        if np.abs(W - W.T).max() > 1e-3 * np.abs(W).max():
            asymmetric[problem.spacedim] += 1
        found.add((problem.kind, problem.spacedim))
    assert len(rounded) <= 1
    assert found == {("local", 2), ("local", 3), ("local_rolling", 3), ("local_rolling", 5)}
    assert min(asymmetric.values()) >= 8


def test_local_problems_come_from_all_kinds_of_families() -> None:
    found = range(LocalProblems.problems - 16)  # those that spin come last
    origins = [problem.info.title for problem in map(LocalProblems().problem, found)]
    # those that came after it was chosen
    later = {
        "local",
        "impacts",
        "existence",
        "dynamics",
        "robots",
        "machines",
        "simulators",
        "decks",
        "rr9118",
        "fclib2024",
        "spin",
        "quasistatic",
        "laws",
        "assembly",
        "flows",
    }
    families = {tuple(origin.split("/")[:2]) for origin in origins}
    assert {name for name, _ in families} >= {"ladder", "rt444", *set_index.EXTENDED} - later
    assert len(families) >= 30
    for name, family in families:
        assert sum(origin.startswith(f"{name}/{family}/") for origin in origins) <= 4
