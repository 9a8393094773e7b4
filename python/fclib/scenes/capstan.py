"""A cable wound around a drum, held at one end and pulled at the other."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib import _core
from fclib._geometry import KINDS, Bodies, Contacts
from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

TURNS: Final = (0.5, 1.0, 2.0, 4.0)
NODES: Final = (24, 96)  # of a turn
PULLS: Final = (0.5, 0.9, 1.1, 2.0)  # of the largest that the drum holds


@dataclass(frozen=True, kw_only=True)
class Capstan:
    """A cable of masses with stiff segments between, wound in a helix around a fixed drum.

    Each mass touches the drum; the segments keep their lengths, as bilateral constraints. Let two
    neighbouring segments be at the angle delta, with the tensions S and S' > S. Their sum presses
    the mass to the drum by (S + S') sin(delta / 2) and pulls it along by (S' - S) cos(delta / 2).
    It sticks if and only if

        S' <= q S,   q = (1 + mu tan(delta / 2)) / (1 - mu tan(delta / 2)).

    So N masses hold a pull of q^N times the tension at the other end: the formula of Euler and
    Eytelwein, exp(mu angle), of a polygon. Below the limit the cable stops, beyond it slides. At
    the start it vibrates a little: the velocities of the masses are drawn, and their momentum is
    about a thousandth of the impulse of the tension that is held.

    Why it is here: tensions and reactions grow by a factor of up to a thousand from one end to the
    other, each contact near its limit, through a chain of constraints.

    J. A. Eytelwein, Handbuch der Statik fester Koerper, Berlin, 1808.
    """

    title: ClassVar[str] = "Capstan"
    description: ClassVar[str] = "A cable is wound around a drum, held at one end and pulled."
    application: ClassVar[str] = "cables, assembly"
    authors: ClassVar[str] = "the authors of FCLIB, after L. Euler and J. A. Eytelwein"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "assembly"
    problems: ClassVar[int] = len(TURNS) * len(NODES) * len(PULLS)

    mu: float = parameter(0.3, "1", "coefficient of friction")
    drum: float = parameter(0.1, "m", "radius of the drum")
    cable: float = parameter(0.005, "m", "radius of the cable")
    vibration: float = parameter(5e-3, "m/s", "largest component of a velocity at the start")
    density: float = parameter(7850.0, "kg/m^3", "mass density of the cable")
    held: float = parameter(10.0, "N", "tension at the end that is held")

    def __post_init__(self) -> None:
        mjcf.check(
            self, positive=("drum", "cable", "density", "held"), non_negative=("mu", "vibration")
        )

    def problem(self, number: int, seed: int = 0) -> Any:
        """By turns, then nodes of a turn, then pull; the seed draws the vibration."""
        turns, rest = divmod(number, len(NODES) * len(PULLS))
        nodes, pull = divmod(rest, len(PULLS))
        random = np.random.Generator(np.random.PCG64([seed, number]))
        count = nodes_of(TURNS[turns], NODES[nodes])
        start = self.vibration * random.uniform(-1, 1, (count, 3))
        return self.wound(TURNS[turns], NODES[nodes], PULLS[pull], start)

    def limit(self, nodes: int, of_a_turn: int) -> float:
        """The largest pull that so many nodes hold, over the tension at the other end."""
        before, after = self._directions(of_a_turn)
        delta = math.acos(min(1.0, math.fsum(a * b for a, b in zip(before, after, strict=True))))
        tangent = self.mu * math.tan(0.5 * delta)
        if tangent >= 1:
            return math.inf
        return ((1 + tangent) / (1 - tangent)) ** nodes

    def _place(self, node: float, of_a_turn: int) -> tuple[float, float, float]:
        """Where a node is; a turn goes on by three radii of the cable."""
        angle = 2 * math.pi * node / of_a_turn
        radius = self.drum + self.cable
        return (
            radius * math.cos(angle),
            3 * self.cable * node / of_a_turn,
            radius * math.sin(angle),
        )

    def _directions(self, of_a_turn: int) -> tuple[list[float], list[float]]:
        """Of the segments before and after node 0."""
        places = [self._place(node, of_a_turn) for node in (-1, 0, 1)]
        found = []
        for a, b in itertools.pairwise(places):
            length = math.dist(a, b)
            found.append([(q - p) / length for p, q in zip(a, b, strict=True)])
        return found[0], found[1]

    def wound(
        self, turns: float, of_a_turn: int, pull: float, start: npt.NDArray[np.float64]
    ) -> Any:
        """The problem of a step from velocities (nodes x 3); `pull` of the largest that holds."""
        count = nodes_of(turns, of_a_turn)
        # the segments go on beyond both ends, where the tensions act
        places = np.array([self._place(node, of_a_turn) for node in range(-1, count + 1)])
        segment = np.diff(places, axis=0)
        x, y, z = segment.T
        length = np.sqrt(x * x + y * y + z * z)
        along = segment / length[:, None]  # (count + 1 x 3)
        nodes = places[1:-1]
        angles = [2 * math.pi * node / of_a_turn for node in range(count)]
        normal = np.array([(math.cos(angle), 0.0, math.sin(angle)) for angle in angles])
        # across the cable, in the drum's surface: normal to N and to the mean of both segments
        tangent = along[:-1] + along[1:]
        tangent /= np.sqrt((tangent * tangent).sum(axis=1))[:, None]
        frame = np.stack((normal, tangent, np.cross(normal, tangent)), axis=1)

        each = np.arange(count)
        rows = np.broadcast_to(3 * each[:, None, None] + np.arange(3), (count, 3, 3))
        columns = np.broadcast_to(3 * each[:, None, None] + np.arange(3)[:, None], (count, 3, 3))
        H = sp.csc_array(
            (frame.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * count, 3 * count)
        )
        between = np.arange(count - 1)
        ends = np.concatenate(
            (3 * between[:, None] + np.arange(3), 3 * between[:, None] + (3, 4, 5))
        )
        signs = np.concatenate((-along[1:-1], along[1:-1]))
        G = sp.csc_array(
            (signs.ravel(), (ends.ravel(), np.tile(np.repeat(between, 3), 2))),
            shape=(3 * count, count - 1),
        )
        mass = self.density * math.pi * self.cable**2 * float(length[0])
        force = np.zeros((count, 3))
        most = self.held * self.limit(count, of_a_turn)
        force[0] -= self.held * along[0]
        force[-1] += pull * most * along[-1]
        title = f"{turns:g} turns, {count} nodes, pull {pull:g} of the limit"
        return _core.GlobalProblem(
            M=sp.diags_array(np.full(3 * count, mass)).tocsc(),
            H=H,
            G=G,
            f=(mass * start + assembly.STEP * force).ravel(),
            w=np.zeros(3 * count),
            b=np.zeros(count - 1),
            mu=np.full(count, self.mu),
            spacedim=3,
            info=assembly.told(
                _core.ProblemInfo(
                    title=title,
                    math_info=(
                        f"one step, h = {assembly.STEP:g} s; M v = H r + G lambda + f,"
                        " f = M v0 + h F, u = H^T v, G^T v = 0; masses without spin; lambda is h"
                        " times what presses a segment; components N, T1 along the cable, T2"
                    ),
                ),
                {"held": self.held, "pull": pull * most, "limit": most},
            ),
            contacts=Contacts(
                body=np.column_stack((np.zeros(count), 1 + each)).astype(np.int32),
                shape=np.column_stack((np.zeros(count), 1 + each)).astype(np.int32),
                feature=np.zeros(count, np.int32),
                point=nodes - self.cable * normal,
                normal=normal,
                tangent=tangent,
                gap=np.zeros(count),
            ),
            bodies=self._table(nodes, turns),
        )

    def _table(self, nodes: Any, turns: float) -> Bodies:
        """The drum, and a sphere a mass."""
        count = len(nodes)
        upright = (1.0, 0.0, 0.0, 0.0)
        half = 0.5 * (3 * self.cable * turns + 6 * self.cable)
        # a cylinder's axis is z: turned to y
        lying = (math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0)
        middle = (0.0, 1.5 * self.cable * turns, 0.0)
        return Bodies(
            name="\n".join(["drum", *(f"node {i}" for i in range(count))]),
            moves=np.array([0] + [1] * count, np.int32),
            place=np.vstack((np.zeros((1, 3)), nodes)),
            turn=np.tile(upright, (1 + count, 1)),
            shape_body=np.arange(1 + count, dtype=np.int32),
            shape_kind=np.array(
                [KINDS.index("cylinder")] + [KINDS.index("sphere")] * count, np.int32
            ),
            shape_size=np.vstack(((self.drum, half, 0.0), np.full((count, 3), self.cable))),
            shape_place=np.vstack((middle, np.zeros((count, 3)))),
            shape_turn=np.vstack((lying, np.tile(upright, (count, 1)))),
            shape_mesh=np.full(1 + count, -1, np.int32),
        )


def nodes_of(turns: float, of_a_turn: int) -> int:
    """How many masses a cable has."""
    return round(turns * of_a_turn) + 1
