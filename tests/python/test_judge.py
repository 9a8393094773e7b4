"""The judgement of whole runs of simulators: planted defects show in their own criterion."""

from __future__ import annotations

import csv
import json
import math
import re
import tempfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import fclib
from fclib import recorders
from helpers import SPIN_LAWS, planted_global, planted_local, planted_spin
from helpers_cli import invoke


def block(mu: float = 0.5, sideways: float = 0.2) -> Any:
    """A block of 2 kg on a plane, which slides: q = (-0.1, sideways, 0) m/s."""
    return fclib.LocalProblem(
        spacedim=3, W=0.5 * np.eye(3), q=np.array([-0.1, sideways, 0.0]), mu=np.array([mu])
    )


RIGHT = np.array([0.2, -0.1, 0.0])  # of the block


def test_a_solution_is_zero_in_all_criteria() -> None:
    for seed in range(20):
        for planted in (planted_local(seed), planted_global(seed)):
            found = recorders.criteria_of(planted.problem, planted.solution)
            assert found.keys() == recorders.CRITERIA.keys()
            assert max(found.values()) < 1e-7


@pytest.mark.parametrize(("law", "d"), SPIN_LAWS)
def test_moments_have_their_own_limits(law: str, d: int) -> None:
    problem, known = planted_spin(law, d, 3)
    assert max(recorders.criteria_of(problem, fclib.Solution(r=known)).values()) < 1e-7
    r = np.reshape(known, (-1, d)).copy()
    # one contact with a moment of three times its limit
    pressed = int(np.argmax(r[:, 0]))
    r[pressed, 1:], r[pressed, 3] = 0, 3 * problem.mu_s[pressed] * r[pressed, 0]
    found = recorders.criteria_of(problem, fclib.Solution(r=r.ravel()))
    weight = problem.mu if law == "ellipsoid" else problem.mu_s
    share = 2 * weight[pressed] * r[pressed, 0] / (weight @ r[:, 0])
    assert found["cone"] == pytest.approx(share, rel=1e-9)


def test_a_moment_that_is_missing_shows_in_the_dissipation() -> None:
    """A ball that spins on a plane, without a moment: mu_s r_N u_S is missing."""
    problem = fclib.LocalSpinProblem(
        spacedim=4, W=np.eye(4), q=[-0.1, 0, 0, 5], mu=[0.5], mu_s=[0.01], coupled=1
    )
    found = recorders.criteria_of(problem, fclib.Solution(r=np.array([0.1, 0, 0, 0])))
    assert found["dissipation"] == pytest.approx(0.01 * 0.1 * 5 / (0.1 * 0.5 * 0.1), rel=1e-12)
    assert max(found[name] for name in ("penetration", "tension", "distance", "cone")) < 1e-15


@pytest.mark.parametrize(
    ("r", "shown", "hidden"),
    [
        ([0.1, -0.05, 0], {"penetration": 0.05 / math.hypot(0.1, 0.2)}, ("tension", "cone")),
        ([-0.1, 0.05, 0], {"tension": 1.0}, ("distance",)),
        (
            [0.4, -0.2, 0],
            {"distance": 0.4 * 0.1 / (math.hypot(0.1, 0.2) * math.hypot(0.4, 0.2))},
            (),
        ),
        ([0.2, -0.3, 0], {"cone": 2.0}, ("penetration", "tension", "distance")),
        (
            [0.2, 0, 0],
            {"dissipation": 0.5 * 0.2 * 0.2 / (math.hypot(0.1, 0.2) * 0.5 * 0.2)},
            ("penetration", "tension", "cone", "distance"),
        ),
        # against the law of dissipation: friction pushes, and energy comes in
        ([0.2, 0.1, 0], {"energy": 0.1 * 0.25 / (math.hypot(0.1, 0.2) * math.hypot(0.2, 0.1))}, ()),
    ],
)
def test_a_defect_shows_in_its_criterion(
    r: list[float], shown: dict[str, float], hidden: tuple[str, ...]
) -> None:
    found = recorders.criteria_of(block(), fclib.Solution(r=np.array(r, dtype=float)))
    for name, value in shown.items():
        assert found[name] == pytest.approx(value, rel=1e-12)
    for name in hidden:
        assert found[name] < 1e-15
    assert found["error"] > 1e-2


def test_criteria_do_not_depend_on_units() -> None:
    """Velocities in mm/s, impulses in N s: the same numbers."""
    problem, r = block(), fclib.Solution(r=np.array([0.3, 0.05, 0.1]))
    scaled = problem.replace(W=np.asarray(problem.W) * 1e3, q=np.asarray(problem.q) * 1e3)
    first, second = (recorders.criteria_of(one, r) for one in (problem, scaled))
    for name in set(first) - {"error"}:
        assert first[name] == pytest.approx(second[name], rel=1e-12), name


def test_what_cannot_be_judged_is_named(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="2 numbers, and the problem has 3"):
        recorders.criteria_of(block(), fclib.Solution(r=np.zeros(2)))
    fclib.write(tmp_path / "one.hdf5", block())
    with pytest.raises(fclib.FileError, match=r"one\.hdf5: has no guess"):
        list(recorders.judge([tmp_path / "one.hdf5"]))
    for words, status, said in (
        ([str(tmp_path)], 1, "has no guess"),
        (["mujocoo", "script.py"], 2, "mujocoo: is neither a folder nor an engine"),
        ([str(tmp_path / "none")], 1, "neither a folder, a file nor an engine"),
        (["mujoco"], 2, "name a script"),
        (["mujoco", str(tmp_path / "none.py")], 1, "there is no such script"),
    ):
        done = invoke("judge", *words, code=status)
        assert said in done.output + capfd.readouterr().err


def test_huge_reactions_are_judged_as_such() -> None:
    for size in (1e200, -1e200, 1e308):
        solution = fclib.Solution(r=np.array([size, size, 0]))
        found = recorders.criteria_of(block(), solution)
        assert not any(math.isnan(value) for value in found.values())
        assert found["error"] > 1e199
        sign = fclib.Solution(r=np.array([1.0, 1.0, 0]) * math.copysign(1, size))
        alike = recorders.criteria_of(block(), sign)
        for name in ("tension", "cone"):
            assert found[name] == pytest.approx(alike[name])
        if size > 0:
            assert found["distance"] > 1e199
            assert found["energy"] > 1e199


def test_runs_are_judged_side_by_side(tmp_path: Path) -> None:
    """Two simulators on one scene: one that is right, and one whose friction is too large."""
    for name, r in (("right", RIGHT), ("wrong", np.array([0.2, -0.3, 0.0]))):
        folder = tmp_path / name
        folder.mkdir()
        for k in range(5):
            fclib.write(folder / f"{k}.hdf5", block(), None, [fclib.Solution(r=r)])
    page, table = tmp_path / "page.html", tmp_path / "steps.csv"
    words = ["judge", str(tmp_path / "right"), str(tmp_path / "wrong")]
    done = invoke(*words, "--csv", table)
    with table.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 10
    assert [float(row["cone"]) for row in rows] == pytest.approx([0.0] * 5 + [2.0] * 5)
    assert {row["auto_status"] for row in rows} == {"converged"}
    done = invoke(*words, "--json")
    found = [json.loads(line) for line in done.output.splitlines()]
    assert [one["error"] < 1e-12 for one in found] == [True] * 5 + [False] * 5
    pytest.importorskip("plotly")
    done = invoke(*words, "--out", page)
    text = page.read_text(encoding="utf-8")
    assert text.count("<h2>") == len(recorders.CRITERIA)
    assert "<script src" not in text  # the page needs no other file


def test_a_script_is_judged(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    script = tmp_path / "slide.py"
    script.write_text(
        "import mujoco\n"
        "model = mujoco.MjModel.from_xml_string(\n"
        "    \"<mujoco><worldbody><geom type='plane' size='5 5 1'/><body pos='0 0 .0999'>\"\n"
        "    \"<freejoint/><geom type='box' size='.1 .1 .1'/></body></worldbody></mujoco>\")\n"
        "data = mujoco.MjData(model)\n"
        "for _ in range(20):\n    mujoco.mj_step(model, data)\n"
    )
    done = invoke("judge", "mujoco", script, "--every", "4")
    assert "slide" in done.output
    assert "dissipation" in done.output


@pytest.mark.parametrize(("status", "said"), [(0, "dissipation"), (5, "ended with status 5")])
def test_a_script_that_ends_its_process_is_judged(
    status: int, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    script = tmp_path / "end.py"
    script.write_text(
        "import mujoco, os\n"
        "model = mujoco.MjModel.from_xml_string(\n"
        "    \"<mujoco><worldbody><geom type='plane' size='5 5 1'/><body pos='0 0 .0999'>\"\n"
        "    \"<freejoint/><geom type='box' size='.1 .1 .1'/></body></worldbody></mujoco>\")\n"
        "data = mujoco.MjData(model)\n"
        f"mujoco.mj_step(model, data, 7)\nos._exit({status})\n"
    )
    done = invoke("judge", "mujoco", script, "--json", code=min(status, 1))
    assert said in done.output
    if not status:
        assert len(done.output.splitlines()) == 7
    assert list((tmp_path / "temporary").iterdir()) == []


def test_a_sequence_is_judged_as_its_steps(tmp_path: Path) -> None:
    with fclib.SequenceWriter(tmp_path / "run.h5") as writer:
        for _ in range(3):
            writer.append(block(), guesses=[fclib.Solution(r=RIGHT)])
    for what, count in ((tmp_path / "run.h5", 3), (tmp_path, 3), (f"{tmp_path}/run.h5#1", 1)):
        done = invoke("judge", what, "--json")
        assert len(done.output.splitlines()) == count
    done = invoke("judge", tmp_path / "run.h5", "--every", "2", "--json")
    assert len(done.output.splitlines()) == 2


def test_a_bad_guess_names_its_file(tmp_path: Path) -> None:
    path = tmp_path / "step.hdf5"
    fclib.write(path, block(), None, [fclib.Solution(r=RIGHT)])
    with h5py.File(path, "r+") as file:
        for name in ("guesses/1/r", "guesses/1/reaction"):
            if name in file:
                file[name][0] = np.nan
    with pytest.raises(fclib.FileError, match=re.escape(str(path))):
        list(recorders.judge([path]))
