"""The set `simulators`: problems from stored steps of other engines, made without the engines."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import collections, recorders, scenes
from fclib.collections import catalog
from fclib.collections.set_index import plan_of
from fclib.collections.verify import verify
from fclib.scenes.shared import recorded
from helpers import converged

ENGINES = {
    "DrakeBoxes": "Drake",
    "NewtonBoxes": "Newton",
    "PyBulletBoxes": "PyBullet",
    "SiconosBoxes": "Siconos",
}
SINGLE = {"NewtonBoxes"}  # precision
COULOMB = {"NewtonBoxes", "SiconosBoxes"}  # whose own law is that of the problem
FAMILIES: dict[str, Any] = scenes.assemblies()


def steps(name: str) -> list[tuple[Any, recorded.Step]]:
    """Problems, and what is stored."""
    family = FAMILIES[name]
    found = family.file().steps
    assert len(found) == family.problems == 16
    return [(family().problem(number), step) for number, step in enumerate(found)]


def test_the_set_is_built_without_any_engine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("pydrake", "newton", "warp", "pybullet", "siconos"):
        monkeypatch.setitem(sys.modules, module, None)
    folders = collections.sets()["simulators"]
    assert folders == [f"simulators/{name}" for name in ENGINES]
    for folder in folders:
        plan = plan_of(folder, count=4, references=False)
        collections.build([plan], tmp_path, pictures=False)
    verdicts = list(verify(tmp_path))
    assert len(verdicts) == 4 * 4 * 2
    assert all(verdict.ok for verdict in verdicts)
    rows = catalog.read_catalog(tmp_path).to_pylist()
    # the digest is that of the global form
    assert [one.origin for one in verdicts].count("published") == len(rows) == 16
    for row in rows:
        path = tmp_path / row["global_file"]
        (guess,) = fclib.read_guesses(path)
        np.testing.assert_array_equal(guess.r, FAMILIES[row["family"]]().reaction(row["number"]).r)
        origin = json.loads(fclib.read(path).info.description.splitlines()[-1])
        assert origin["engine"]["name"] == ENGINES[row["family"]]
        assert origin["engine"]["version"]
        assert origin["engine"]["licence"]
        assert set(origin["fields"]) >= {"M", "f", "H", "w", "mu"}


@pytest.mark.parametrize("name", ENGINES)
def test_problems_are_the_published_ones(name: str) -> None:
    digests = FAMILIES[name].digests()
    assert [fclib.digest(problem) for problem, _ in steps(name)] == list(digests)
    assert len(set(digests)) == 16


def test_another_problem_is_not_the_published_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    family = FAMILIES["DrakeBoxes"]
    true = family.problem
    monkeypatch.setattr(
        family, "problem", lambda self, number, seed=0: heavier(true(self, number, seed))
    )
    plan = plan_of("simulators/DrakeBoxes", count=1, references=False, form="global")
    collections.build([plan], tmp_path, pictures=False)
    (verdict,) = verify(tmp_path)
    assert (verdict.status, verdict.origin) == ("not published", "differs")


def heavier(problem: Any) -> Any:
    return problem.replace(M=1.001 * problem.M)


@pytest.mark.parametrize("name", ENGINES)
def test_frames_are_orthonormal_and_forces_have_reactions(name: str) -> None:
    """The velocity rows of H are the frame of a contact, of either sign on its two boxes.

    The first tangent of Siconos is not at right angles to N where both are tilted.
    """
    unknowns = FAMILIES[name].file().about["unknowns"]
    first = 3 if unknowns.startswith("spin") else 0
    close: Any = {"rtol": 0, "atol": 1e-6 if name in SINGLE else 1e-14}
    skewed = 0.0
    for problem, step in steps(name):
        H = problem.H.toarray().reshape(-1, 6, problem.nc, 3)[:, first : first + 3]
        for c in range(problem.nc):
            boxes = np.flatnonzero(H[:, :, c].any(axis=(1, 2)))
            frames = [H[i, :, c].T for i in boxes]
            assert len(frames) in (1, 2)
            for frame in frames:
                gram = frame @ frame.T
                if name == "SiconosBoxes":
                    sign = np.sign(np.linalg.det(frame))
                    second = sign * np.cross(frame[0], frame[1])
                    np.testing.assert_allclose(frame[2], second, **close)
                    np.testing.assert_allclose(gram.diagonal()[:2], 1, **close)
                    skewed = max(skewed, abs(gram[0, 1]))
                else:
                    np.testing.assert_allclose(gram, np.eye(3), **close)
            if len(frames) == 2:
                np.testing.assert_allclose(frames[0], -frames[1], **close)
            if step.body is None:
                continue
            contacts = problem.contacts
            assert set(boxes + 1) == set(contacts.body[c].tolist()) - {0}
            side = dict(zip((contacts.body[c] - 1).tolist(), (-1.0, 1.0), strict=True))
            for i, frame in zip(boxes, frames, strict=True):
                np.testing.assert_allclose(frame, side[i] * contacts.frame[c], **close)
    assert (skewed > 0.1) == (name == "SiconosBoxes")


@pytest.mark.parametrize("name", [name for name in ENGINES if name != "SiconosBoxes"])
def test_the_levers_of_h_lead_to_the_stored_points(name: str) -> None:
    """But for half a gap: a point lies between those of the two bodies. Siconos tells none.

    Bullet keeps the points of a pair while the boxes slide, until they are 20 mm apart.
    """
    unknowns = FAMILIES[name].file().about["unknowns"]
    first = 3 if unknowns.startswith("spin") else 0
    rounding = 1e-6 if name in SINGLE else 1e-9
    slid = 0.01 if name == "PyBulletBoxes" else 0.0
    compared = 0
    for problem, _ in steps(name):
        H = problem.H.toarray().reshape(-1, 6, problem.nc, 3)
        for c, pair in enumerate(problem.contacts.body.tolist()):
            for body in pair:
                if body == 0:  # the ground
                    continue
                block = H[body - 1, :, c]
                lever = problem.contacts.point[c] - problem.bodies.place[body]
                moments = np.cross(lever, block[first : first + 3].T)
                found = block[3 - first : 6 - first].T
                away = np.abs(np.linalg.norm(moments, axis=1) - np.linalg.norm(found, axis=1))
                assert away.max() <= abs(problem.contacts.gap[c]) / 2 + rounding + slid, (c, body)
                compared += 1
    assert compared > 100


@pytest.mark.parametrize("name", ENGINES)
def test_boxes_fall_freely_but_for_the_contacts(name: str) -> None:
    """M v_free = f: masses 1 to 6 kg, and free velocities that gravity changes alone."""
    about = FAMILIES[name].file().about
    first = 3 if about["unknowns"].startswith("spin") else 0
    close: Any = {"rtol": 0, "atol": 1e-4 if name in SINGLE else 1e-9}
    for problem, step in steps(name):
        M = problem.M.toarray().reshape(6, 6, 6, 6)
        for i in range(6):
            linear = M[i, first : first + 3, i, first : first + 3]
            np.testing.assert_allclose(linear, (1 + i) * np.eye(3), rtol=1e-6, atol=1e-12)
        assert np.linalg.eigvalsh(problem.M.toarray()).min() > 0
        # what reaction and velocity of the engine say together
        pushed = problem.M @ step.velocity - problem.H @ step.reaction - problem.f
        assert np.abs(np.linalg.solve(problem.M.toarray(), pushed)).max() < 1e-5
        # a box without contacts keeps its horizontal velocity
        touched = problem.H.toarray().reshape(6, -1).any(axis=1)
        free = np.linalg.solve(problem.M.toarray(), problem.f).reshape(6, 6)
        np.testing.assert_allclose(step.velocity.reshape(6, 6)[~touched], free[~touched], **close)


@pytest.mark.parametrize("name", ENGINES)
def test_auto_solves_them_and_the_engine_is_judged(name: str) -> None:
    errors = []
    for number, (problem, _) in enumerate(steps(name)):
        converged(problem, tol=1e-8)
        own = FAMILIES[name]().reaction(number)
        assert own.r.shape == (problem.m,)
        errors.append(fclib.merit(problem, fclib.Solution(r=own.r)).error)
    if name in COULOMB:
        assert max(errors) < 1e-4
    else:
        # compliant, or with penetrations corrected: other laws, and yet impulses of that size
        assert 1e-2 < min(errors) <= max(errors) < 1


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    file = FAMILIES["PyBulletBoxes"].file()
    path = tmp_path / "again.npz"
    recorded.write(path, recorded.File(file.about, file.half, file.steps[:3], file.digests[:3]))
    again = recorded.read(path)
    assert (again.about, again.digests, len(again.steps)) == (file.about, file.digests[:3], 3)
    np.testing.assert_array_equal(again.steps[2].turn, file.steps[2].turn)


def test_recorders_tell_what_the_set_says() -> None:
    """Names of engines are those of the recorders."""
    for engine in ENGINES.values():
        assert engine.lower() in recorders.ENGINES
