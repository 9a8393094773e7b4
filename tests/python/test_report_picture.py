"""Small pictures: all of a problem is in them, large enough, and the near hides the far."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fclib.collections import set_index, trajectory
from fclib.report import build_site, picture
from fclib.report.solids import Solids, solids_of, unit
from helpers_report import read_data, skip_without_libraries

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")
skip_without_libraries()
Image = pytest.importorskip("PIL.Image")
BOX = 5


def boxes(*shapes: tuple[tuple[float, float, float], tuple[float, float, float]]) -> Solids:
    """Boxes by half their sides and their places."""
    count = len(shapes)
    return Solids(
        names=[f"box {k}" for k in range(count)],
        moves=np.ones(count, np.int64),
        body=np.arange(count),
        kind=np.zeros(count, np.int64),
        scale=np.array([[*half, 0.0] for half, _ in shapes]),
        place=np.array([place for _, place in shapes]),
        turn=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        meshes=[unit(BOX, 0, 0)],
        strain={},
        centre=np.array([place for _, place in shapes]),
        period=np.zeros(0),
        planar=False,
        unit="m",
    )


def painted(path: Path) -> Any:
    """Colours (height, width, 4) of a picture."""
    return np.asarray(Image.open(path).convert("RGBA")).astype(int)


def share(path: Path, tint: int) -> float:
    """Share of the picture that has a body's tint, in whatever light."""
    seen = painted(path)
    own = np.array(picture.TINTS[tint]) / np.linalg.norm(picture.TINTS[tint])
    length = np.linalg.norm(seen[..., :3], axis=2)
    like = (seen[..., :3] @ own) > 0.999 * np.maximum(length, 1)
    return float((like & (seen[..., 3] > 250)).mean())


def test_the_near_hides_the_far(tmp_path: Path) -> None:
    """A long wall behind a small box: by the middles of its triangles the wall is the nearer."""
    small, wall = ((0.2, 0.2, 0.2), (-2.6, -0.5, 0.0)), ((3.0, 0.2, 1.0), (0.0, 0.0, 0.0))
    picture.draw(boxes(small, wall), tmp_path / "both.png")
    picture.draw(boxes(wall, small), tmp_path / "order.png")
    hidden = share(tmp_path / "both.png", 0)
    # all of the front of the box and of its right side is seen: nothing is before it
    axes = picture.eye(boxes(small, wall))
    corners = [boxes(*own).world(k) @ axes.T for own in [(small, wall)] for k in (0, 1)]
    span = np.ptp(np.concatenate(corners), axis=0)[:2] * picture.MARGIN
    scale = min(picture.THUMB[0] / span[0], picture.THUMB[1] / span[1])
    sides = 0.4**2 * np.abs(axes[2]).sum() * scale**2 / np.prod(picture.THUMB)
    assert hidden == pytest.approx(sides, rel=0.15)
    assert share(tmp_path / "order.png", 1) == pytest.approx(hidden, rel=0.1)


def test_triangles_are_cut_and_cover_the_same() -> None:
    corners = np.array(
        [[[0.0, 0, 0], [1000, 0, 1], [0, 500, 2]], [[0, 0, 0], [5, 0, 0], [0, 5, 0]]]
    )

    def area(triangles: Any) -> float:
        a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        return float(0.5 * np.linalg.norm(np.cross(a, b), axis=1).sum())

    both = np.array([True, True])
    parts, of = picture.halved(corners, lambda x: x[..., :2], both, (1000, 1000))
    assert area(parts) == pytest.approx(area(corners))
    assert area(parts[of == 1]) == pytest.approx(12.5)
    edges = np.linalg.norm(np.roll(parts, -1, axis=1) - parts, axis=2)[..., :2]
    assert edges.max() <= picture.PATCH * picture.FINE * 1.01
    # what lies beside the picture is not cut
    parts, _ = picture.halved(corners, lambda x: x[..., :2] + 5000, both, (1000, 1000))
    assert len(parts) == 0


@pytest.mark.parametrize(("family", "least"), [("BoxesStack", 0.2), ("Chain", 0.05)])
def test_a_long_thin_scene_is_shown_large(family: str, least: float, tmp_path: Path) -> None:
    stored = set_index.plan_of(f"standard/{family}").trajectory
    assert stored is not None
    states = trajectory.read(stored)
    problem: Any = states.problem(0).problem
    solids = solids_of(problem.bodies, problem.contacts)
    picture.draw(solids, tmp_path / "thin.png", near=problem.contacts.point)
    seen = painted(tmp_path / "thin.png")
    strip = round(picture.STRIP * seen.shape[1])
    # the whole of it, from top to bottom, in the strip
    rows = (seen[:, :strip, 3] > 80).any(axis=1).nonzero()[0]
    assert np.ptp(rows) > 0.8 * seen.shape[0]
    assert (seen[:, strip:, 3] > 250).mean() > least


def test_every_problem_has_a_small_picture(tmp_path: Path) -> None:
    """Those without bodies too: their matrix."""
    from fclib import collections

    plans = []
    for name in ("standard/Arch", "existence/ManySolutions", "standard/LocalProblems"):
        plan = set_index.plan_of(name)
        plans.append(plan.only([int(plan.numbers()[0])]))
    collections.build(plans, tmp_path / "collection", pictures=False)
    build_site(None, tmp_path / "site", tmp_path / "collection", views=0)
    columns = {one["key"]: one for one in read_data(tmp_path / "site", "catalogue")["columns"]}
    assert columns["thumb"]["values"] == [True] * 3
    for k in range(3):
        assert (painted(tmp_path / "site" / "thumbs" / f"{k}.webp")[..., 3] > 250).mean() > 0.02


def test_a_matrix_is_drawn_with_its_signs(tmp_path: Path) -> None:
    from scipy.sparse import csc_matrix

    picture.draw_matrix(csc_matrix([[2.0, 0.0], [-2.0, 1e-9]]), tmp_path / "W.png")
    seen = painted(tmp_path / "W.png")
    high, wide = seen.shape[:2]
    left, right = wide // 2 - 20, wide // 2 + 20
    assert tuple(seen[high // 4, left, :3]) == picture.TINTS[0]
    assert tuple(seen[3 * high // 4, left, :3]) == picture.TINTS[1]
    assert seen[high // 4, right, 3] == 0
    assert seen[3 * high // 4, right, 3] == 255
    assert seen[3 * high // 4, right, :3].min() > 200  # faint
