"""The set `decks`: scenes of LMGC90's authors, beside the facts of their decks."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import scenes
from fclib.collections import published, trajectory
from fclib.scenes.shared import recorded
from helpers import converged, dense
from helpers_rebuilt import directions

SIMULATED = (
    "ElasticCubes",
    "ElasticCubesx2",
    pytest.param("ElasticCubesx20", marks=pytest.mark.long),
    "ElasticLowWall",
    "ShakenCell",
    pytest.param("SpheresInPlates", marks=pytest.mark.long),
)


def test_the_bridge_is_that_of_the_engine() -> None:
    family: Any = scenes.assemblies()["LMGC90Bridge"]
    assert family.problems == len(family.digests()) == len(set(family.digests())) == 50
    file = family.file()
    assert file.about["engine"]["name"] == "LMGC90"
    assert isinstance(file.polyhedra, recorded.Polyhedra)
    for number in range(0, 50, 5):
        problem = family().problem(number)
        assert fclib.digest(problem) == family.digests()[number]
        # 22 voussoirs; the published problems have 70 to 108 contacts
        assert (problem.n, problem.nc) == (132, 108)
        H = directions(problem, np.flatnonzero(problem.bodies.moves))
        np.testing.assert_allclose(dense(problem.H), dense(H), atol=1e-8)
        w = np.reshape(problem.w, (-1, 3))
        np.testing.assert_allclose(w[:, 0], np.maximum(problem.contacts.gap, 0) / 1e-3)
        # the engine's reaction gives its velocity, as far as its sweeps go
        own = family().reaction(number)
        v = (dense(problem.H) @ own.r + problem.f) / np.diag(dense(problem.M))
        assert np.abs(v - own.v).max() < 1e-4 * max(np.abs(own.v).max(), 0.1)
    # the load on body 10 grows to 5.77 MN in 0.1 s, so the bridge comes down
    assert np.abs(family().reaction(49).v).max() > 1


def test_the_bodies_of_the_bridge_have_the_density_of_the_deck() -> None:
    """1,840 or 4,400 kg/m^3, from the volumes of the stored polyhedra."""
    from fclib.scenes.shared import polyhedron

    family: Any = scenes.assemblies()["LMGC90Bridge"]
    own = family.file().polyhedra
    moving = np.flatnonzero(own.moves)
    for k, body in enumerate(moving):
        vertices, faces = own.vertices[body], own.faces[body].astype(np.int64)
        solid = polyhedron.moments(vertices, polyhedron.oriented(vertices, faces))
        density = own.mass[6 * k] / solid.volume
        assert min(abs(density - 1840), abs(density - 4400)) < 1e-5
        moments = density * np.diag(solid.inertia)
        np.testing.assert_allclose(moments, own.mass[6 * k + 3 : 6 * k + 6], rtol=1e-8)


def test_sizes_are_those_of_the_decks() -> None:
    spheres = scenes.get("SpheresInPlates")().scene(0)
    assert spheres.xml.count('type="sphere"') == 945
    assert spheres.xml.count('type="box"') == 5
    assert {one.mu for one in spheres.interactions} == {0.0, 0.8}
    cell = scenes.get("ShakenCell")().scene(0)
    assert cell.xml.count("<freejoint/>") == 101
    assert cell.period == (25.0, 25.0)
    assert len([drive for drive in cell.drives if drive.velocity]) == 6
    for name, nodes, foot in (("ElasticCubesx2", 27, 9), ("ElasticCubes", 216, 36)):
        cubes = scenes.get(name)().scene(0)
        assert cubes.solids is not None
        assert [len(mesh.nodes) for mesh in cubes.solids.meshes] == [nodes, nodes]
        assert len(cubes.drives) == 3 * foot


@pytest.mark.parametrize("name", SIMULATED)
def test_stored_states_give_the_published_problems(name: str) -> None:
    pytest.importorskip("mujoco")
    path = published.path_of(f"decks/{name}", "1")
    if path is None:
        pytest.skip("no states of it are stored")
    states = trajectory.read(path)
    assert len(set(states.digest)) == len(states)
    for place in np.unique(np.linspace(0, len(states) - 1, 4).astype(int)).tolist():
        problem = states.problem(place).problem
        off = states.differences(place, problem)
        assert max(off.values(), default=0.0) < 1e-9
        origin = json.loads(problem.info.description.splitlines()[-1])
        assert origin["laws"]
        # spheres at rest in each other are hard: no solver here takes them to 1e-6 in a minute
        at_rest = name == "SpheresInPlates" and states.number[place] > 100
        converged(problem, tol=1e-4 if at_rest else 1e-6, time_limit=60.0)
