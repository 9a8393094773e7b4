"""Problems of one time step from rest, made from geometry alone: bodies, contacts, impulses.

Free rigid bodies with M diagonal and axes along the world's. A contact has its two bodies (the
ground is -1), its normal from the first to the second, and its point.
"""

from __future__ import annotations

import decimal
import functools
import json
import math
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib import _core
from fclib._geometry import KINDS, Contacts
from fclib._geometry import Bodies as BodyTable

Vector: TypeAlias = npt.NDArray[np.float64]

GRAVITY = 9.81  # [m/s^2]
STEP = 5e-3  # h [s]
# approximate numbers of contacts of a ladder
SIZES = (10, 30, 100, 300, 1000, 3000, 10000, 30000, 100000)
ROUNDING = 1e-15  # smaller entries of H count as zero
LENGTH_NAMES: Final = {1e-3: "mm", 1.0: "m", 1e3: "km"}
MASS_NAMES: Final = {1e-3: "g", 1.0: "kg", 1e3: "t"}


# NumPy's powers and exponentials depend on the processor: these are exactly rounded. Problems that
# were published with NumPy's keep their last digits by `as_published`


def cubes(x: Vector) -> Vector:
    """x^3 of each number."""
    return np.array([float(Fraction(value) ** 3) for value in x.tolist()])


def exponentials(x: Vector) -> Vector:
    """e^x of each number."""
    with decimal.localcontext(decimal.Context(prec=40)):
        return np.array([float(decimal.Decimal(value).exp()) for value in x.tolist()])


def near(centres: Vector, distance: float) -> npt.NDArray[np.int64]:
    """The pairs (k x 2) of points at most so far apart, in order."""
    from scipy.spatial import cKDTree  # the import takes a while

    pairs = cKDTree(centres).query_pairs(distance, output_type="ndarray").reshape(-1, 2)
    return np.asarray(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].astype(np.int64))


def total(x: Vector) -> float:
    """The sum of numbers, exactly rounded: that of NumPy depends on the processor."""
    return math.fsum(x.tolist())


def as_published(name: str, exact: Vector) -> Vector:
    """The same numbers; some get the last digit that was published under this name."""
    found = exact.copy()
    for side, places in _last_digits().get(name, {}).items():
        found[places] = np.nextafter(exact[places], -np.inf if side == "below" else np.inf)
    return found


@functools.cache
def _last_digits() -> dict[str, dict[str, list[int]]]:
    """By FAMILY/SIZE: places of numbers that are one unit in the last place below, or above."""
    text = Path(__file__).with_name("last_digits.json").read_text(encoding="utf-8")
    return dict(json.loads(text))


def told(info: _core.ProblemInfo, facts: dict[str, Any], word: str = "") -> _core.ProblemInfo:
    """The info of a problem with facts of its own, and a further word on its mathematics."""
    return _core.ProblemInfo(
        title=info.title,
        description=json.dumps(facts),
        math_info="; ".join(part for part in (info.math_info, word) if part),
    )


@dataclass(frozen=True)
class Bodies:
    """n free rigid bodies with nc contacts, and the impulses on them besides gravity."""

    masses: Vector  # (n) [kg]
    inertias: Vector  # (n x 3) about the axes of the world [kg m^2]
    centres: Vector  # (n x 3) [m]
    first: npt.NDArray[np.int64]  # (nc) a body, or -1
    second: npt.NDArray[np.int64]  # (nc)
    normals: Vector  # (nc x 3)
    points: Vector  # (nc x 3) [m]
    impulses: Vector  # (n x 3) [N s]
    sizes: Vector  # (n x 3) half edges of a box, or radii of a sphere [m]
    # (k x 6) a point [m] and the outward normal of each plane of the ground
    planes: Vector
    kind: str = "box"  # "box" or "sphere"
    gaps: Any = 0.0  # (nc), or one number for all contacts [m]
    gravity: float = GRAVITY  # [m/s^2]
    length: float = 1.0  # unit of all lengths here [m]
    mass: float = 1.0  # unit of all masses here [kg]

    @property
    def units(self) -> dict[str, str]:
        """The names of the units."""
        return {"length": LENGTH_NAMES[self.length], "mass": MASS_NAMES[self.mass], "time": "s"}

    def problem(self, mu: Any, title: str) -> _core.GlobalProblem:
        """The problem G3DFC of a step from rest; mu is a number or (nc)."""
        count, nc = len(self.masses), len(self.normals)
        length, mass = self.units["length"], self.units["mass"]
        impulse = "N s" if (length, mass) == ("m", "kg") else f"{mass} {length}/s"
        parts = [self._rows(self.second, 1.0), self._rows(self.first, -1.0)]
        rows, columns, values = (np.concatenate([part[k] for part in parts]) for k in range(3))
        transposed = sp.csr_array((values, (rows, columns)), shape=(3 * nc, 6 * count))
        transposed.data[np.abs(transposed.data) < ROUNDING] = 0
        transposed.eliminate_zeros()
        linear = np.repeat(self.masses[:, None], 3, axis=1)
        f = np.zeros((count, 6))
        f[:, 2] = -self.masses * self.gravity * STEP
        f[:, :3] += self.impulses
        return _core.GlobalProblem(
            M=sp.diags_array(np.concatenate([linear, self.inertias], axis=1).ravel()).tocsc(),
            H=transposed.T.tocsc(),
            f=f.ravel(),
            w=np.zeros(3 * nc),
            mu=np.broadcast_to(np.asarray(mu, dtype=float), (nc,)).copy(),
            spacedim=3,
            info=_core.ProblemInfo(
                title=title,
                math_info=(
                    f"one step from rest, h = {STEP:g} s; M v = H r + f, u = H^T v + w;"
                    f" v in {length}/s and rad/s, r in {impulse}, components N, T1, T2"
                ),
            ),
            contacts=self._contacts(),
            bodies=self._table(),
        )

    def _frames(self) -> Vector:
        """Rows N, T1, T2 of each contact (nc x 3 x 3)."""
        helper = np.where(np.abs(self.normals[:, :1]) < 0.7, [[1.0, 0, 0]], [[0, 1.0, 0]])
        t1 = np.cross(self.normals, helper)
        t1 /= np.linalg.norm(t1, axis=1, keepdims=True)
        return np.stack([self.normals, t1, np.cross(self.normals, t1)], axis=1)

    def _contacts(self) -> Contacts:
        """The table of contacts: body 0 is the ground; features count the contacts of a pair."""
        body = 1 + np.column_stack((self.first, self.second))
        # the ground's shapes come first: the plane in which the contact lies
        arms = self.points[:, None] - self.planes[:, :3]
        plane = np.abs(np.einsum("ckj,kj->ck", arms, self.planes[:, 3:])).argmin(axis=1)
        shape = np.where(body == 0, plane[:, None], body - 1 + len(self.planes))
        order = np.lexsort(shape.T)
        ranked = shape[order]
        new = np.append(True, (ranked[1:] != ranked[:-1]).any(axis=1))[: len(order)]
        feature = np.zeros(len(order), np.int32)
        feature[order] = np.arange(len(order)) - np.flatnonzero(new)[new.cumsum() - 1]
        return Contacts(
            body=body.astype(np.int32),
            shape=shape.astype(np.int32),
            feature=feature,
            point=self.points,
            normal=self.normals,
            tangent=self._frames()[:, 1],
            gap=np.broadcast_to(np.asarray(self.gaps, dtype=float), (len(order),)).copy(),
        )

    def _table(self) -> BodyTable:
        """The table of bodies, with the ground first."""
        count, planes = len(self.masses), len(self.planes)
        upright = (1.0, 0.0, 0.0, 0.0)
        # the rotation that takes z to a plane's normal
        normal = self.planes[:, 3:]
        turn = np.column_stack((1 + normal[:, 2], -normal[:, 1], normal[:, 0], np.zeros(planes)))
        turn[normal[:, 2] == -1] = (0.0, 1.0, 0.0, 0.0)
        turn /= np.linalg.norm(turn, axis=1, keepdims=True)
        length, mass = self.units["length"], self.units["mass"]
        return BodyTable(
            name="\n".join(["ground", *(f"{self.kind} {i}" for i in range(count))]),
            moves=np.array([0] + [1] * count, np.int32),
            place=np.concatenate((np.zeros((1, 3)), self.centres)),
            turn=np.tile(upright, (1 + count, 1)),
            shape_body=np.concatenate((np.zeros(planes), 1 + np.arange(count))).astype(np.int32),
            shape_kind=np.repeat(
                [KINDS.index("plane"), KINDS.index(self.kind)], [planes, count]
            ).astype(np.int32),
            shape_size=np.concatenate((np.zeros((planes, 3)), self.sizes)),
            shape_place=np.concatenate((self.planes[:, :3], np.zeros((count, 3)))),
            shape_turn=np.concatenate((turn, np.tile(upright, (count, 1)))),
            shape_mesh=np.full(planes + count, -1, np.int32),
            unit="" if length == "m" else length,
            mass_unit="" if mass == "kg" else mass,
        )

    def in_units(self, length: float, mass: float) -> Bodies:
        """The same, measured in units of so many m and so many kg."""
        return replace(
            self,
            masses=self.masses / mass,
            inertias=self.inertias / (mass * length**2),
            centres=self.centres / length,
            points=self.points / length,
            impulses=self.impulses / (mass * length),
            gravity=self.gravity / length,
            sizes=self.sizes / length,
            gaps=self.gaps / length,
            planes=self.planes / ([length] * 3 + [1.0] * 3),
            length=length,
            mass=mass,
        )

    def repeated(self, times: int) -> Bodies:
        """The same with so many copies of each contact, side by side."""
        which = np.repeat(np.arange(len(self.normals)), times)
        return replace(
            self,
            first=self.first[which],
            second=self.second[which],
            normals=self.normals[which],
            points=self.points[which],
            gaps=np.broadcast_to(self.gaps, (len(self.normals),))[which],
        )

    def _rows(
        self, bodies: npt.NDArray[np.int64], sign: float
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], Vector]:
        """Entries of H^T (rows, columns, values) for one side of the contacts."""
        frames = self._frames()
        moving = np.flatnonzero(bodies >= 0)
        arms = self.points[moving] - self.centres[bodies[moving]]
        directions = frames[moving]
        moments = np.cross(arms[:, None, :], directions)
        values = sign * np.concatenate([directions, moments], axis=2)  # (., 3, 6)
        rows = (3 * moving)[:, None, None] + np.arange(3)[:, None]
        columns = 6 * bodies[moving][:, None, None] + np.arange(6)
        return (
            np.broadcast_to(rows, values.shape).ravel(),
            np.broadcast_to(columns, values.shape).ravel(),
            values.ravel(),
        )


def running_bond(
    contacts: int, seed: int, *, push: float = 0.0, ratio: float = 1.0, spread: float = 0.05
) -> Bodies:
    """A wall of blocks, 2 x 1 x 1 m and 1000 kg, about twice as long as high, on the ground.

    Args:
        contacts: approximate number of contacts; four for each pair of faces.
        seed: random seed of the masses.
        push: horizontal impulse on the end of the top course, in weights of all blocks.
        ratio: mass of the top course over that of the lowest; courses between are in proportion.
        spread: masses vary randomly by this share.
    """
    random = np.random.Generator(np.random.PCG64(seed))
    high = max(1, round(np.sqrt(contacts / 16)))
    long = max(1, round(contacts / (8 * high)))
    x, z = np.meshgrid(np.arange(long), np.arange(high))
    centres = np.stack([2.0 * x + (z % 2), np.zeros(x.shape), z + 0.5], axis=-1).reshape(-1, 3)
    ids = np.arange(centres.shape[0]).reshape(x.shape)
    first, second, points = [], [], []
    corners = [(sx, sy) for sx in (0, 1) for sy in (-0.5, 0.5)]
    for row in range(high):
        for column in range(long):
            left = 2.0 * column + (row % 2) - 1
            if row == 0:
                spans = [(-1, left, left + 2)]
            else:
                shift = -1 if row % 2 == 0 else 0
                halves = [(column + shift, left), (column + shift + 1, left + 1)]
                spans = [(ids[row - 1, c], a, a + 1) for c, a in halves if 0 <= c < long]
            for lower, a, b in spans:
                for sx, sy in corners:
                    first.append(lower)
                    second.append(ids[row, column])
                    points.append([a if sx == 0 else b, sy, float(row)])
    masses = np.full(len(centres), 1000.0) * random.uniform(1 - spread, 1 + spread, len(centres))
    if ratio != 1 and high > 1:
        masses *= ratio ** (np.repeat(np.arange(high), long) / (high - 1))
    impulses = np.zeros((len(centres), 3))
    impulses[ids[-1, 0], 0] = push * masses.sum() * GRAVITY * STEP
    return Bodies(
        masses=masses,
        inertias=masses[:, None] / 12 * np.array([[2.0, 5.0, 5.0]]),
        centres=centres,
        first=np.array(first),
        second=np.array(second),
        normals=np.tile([0.0, 0.0, 1.0], (len(first), 1)),
        points=np.array(points),
        impulses=impulses,
        sizes=np.tile([1.0, 0.5, 0.5], (len(centres), 1)),
        planes=np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]),
    )
