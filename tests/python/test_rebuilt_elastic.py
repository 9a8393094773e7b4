"""M, H, f and w of elastic cubes and of a wall follow from states and meshes, by NumPy alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from fclib.collections import published, trajectory
from helpers_elastic import bodies_of, directions_and_gaps, face_masses, masses, stiffness

COUNT = 10  # problems of a family, or all
EXACT = 1e-8  # of the largest entry
# a face that is farther off from a node is another one's [m]
NEAR = {"ElasticLowWall": 0.01}
FAR = 0.1
SIDES = {"x": 0, "y": 1, "z": 2}


def large(folder: str) -> Any:
    return pytest.param(folder, marks=pytest.mark.long)


FOLDERS = (
    "decks/ElasticCubesx2",
    "decks/ElasticCubes",
    large("decks/ElasticCubesx20"),
    large("decks/ElasticLowWall"),
    "rr9118/CubesH8x2",
    "rr9118/CubesH8",
    large("rr9118/CubesH8x20"),
)


def on_side(bodies: Any, body: int, side: str) -> Any:
    """The integrals of products of shape functions over a side of a body, for all nodes."""
    parts = [sp.csr_array((len(one.nodes),) * 2) for one in bodies]
    parts[body] = sp.csr_array(face_masses(bodies[body], SIDES[side[0]], side[1] == "+"))
    return sp.block_diag(parts, format="csr")


def close(found: Any, expected: Any) -> None:
    """Equal, but for EXACT of the largest entry."""
    found, expected = sp.csr_array(found), sp.csr_array(expected)
    assert found.shape == expected.shape
    assert np.abs((found - expected).data).max(initial=0.0) <= EXACT * np.abs(expected.data).max()


@pytest.mark.parametrize("folder", FOLDERS)
def test_elastic_problems_are_rebuilt_from_their_states(folder: str) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("skfem")
    versions = published.versions(folder)
    if not versions:
        pytest.skip("no states of it are stored")
    path = published.path_of(folder, versions[-1])
    assert path is not None
    states = trajectory.read(path)
    scene, h, theta = states.scene, states.time_step, states.scene.theta
    solids = scene.solids
    assert solids is not None
    near = NEAR.get(scene.name, FAR)
    bodies = bodies_of(states.model)
    mass, K = masses(bodies), stiffness(bodies)
    for bed in solids.beds:
        K += bed.stiffness * sp.kron(on_side(bodies, bed.block, bed.face), np.eye(3), format="csr")
    C = solids.damping * K
    nodes = np.concatenate([body.nodes for body in bodies])
    weight = mass @ np.tile((0.0, 0.0, -solids.gravity), len(nodes))
    free = np.ones(nodes.size, dtype=bool)
    given = {drive.dof: drive.course for drive in scene.drives if drive.velocity}
    driven = {drive.dof: drive.course for drive in scene.drives if not drive.velocity}
    free[list(given)] = False
    M = mass + h * theta * C + (h * theta) ** 2 * K
    places = np.unique(np.linspace(0, len(states) - 1, COUNT).round().astype(int))
    assert len(places) == min(COUNT, len(states))
    for place in places.tolist():
        part: Any = states.problem(place)
        problem, v = part.problem, states.velocity[place]
        u, time = states.position[place][:-1], states.position[place][-1]
        force = weight - K @ u
        for load in solids.loads:
            share = np.clip((time + 0.5 * h - load.begin) / load.rise, 0, 1)
            for body in load.blocks:
                pressed = on_side(bodies, body, load.face).sum(axis=1)
                force += share * np.outer(pressed, load.traction).ravel()
        for dof, course in driven.items():
            force[dof] += (1 - theta) * course.at(time) + theta * course.at(time + h)
        later = np.zeros(nodes.size)
        for dof, course in given.items():
            later[dof] = course.at(time + h)
        f = mass @ v - h * (1 - theta) * (C @ v) - h**2 * theta * (1 - theta) * (K @ v) + h * force
        f -= M @ later
        H, gaps = directions_and_gaps(bodies, nodes + u.reshape(-1, 3), part.contacts, near)
        w = H.T @ later
        middle = gaps + (1 - theta) * h * (H.T @ v)[0::3]
        # the law GAP_SGR_CLB of the decks undoes a penetration in one step
        undone = 1.0 if scene.interactions else states.origin["settings"]["stabilization"]
        w[0::3] += np.where(middle > 0, 1.0, undone) * middle / h
        close(problem.M, M[free][:, free])
        close(problem.H, H[free])
        np.testing.assert_allclose(problem.f, f[free], atol=EXACT * np.abs(f).max(), rtol=0)
        np.testing.assert_allclose(problem.w, w, atol=EXACT * max(1.0, np.abs(w).max()), rtol=0)
