"""A connector of many pins pushed into its holes: two contacts a pin, jammed or wedged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt

from fclib._geometry import KINDS
from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

PINS: Final = (2, 4, 8, 12)  # along an edge
DEPTHS: Final = (1.0, 3.0, 10.0)  # of the pins in their holes, in widths of a hole
OFFSETS: Final = (0.9, 1.1)  # of the push, of the least that jams
MACHINED: Final = (False, True)  # whether the holes' widths differ

PITCH: Final = 2.0  # of the holes, in widths
HEIGHT: Final = 1.0  # of the part above the pins, in widths


@dataclass(frozen=True, kw_only=True)
class PegInHole:
    """A rigid connector with k x k square pins, tilted by its play, is pushed into a plate.

    Each pin touches its hole at the mouth on one side and with its end on the other, at two corners
    each: four contacts. They are D apart across and L along the hole. The first and the last row of
    pins are 2 X apart. The push F is parallel to the holes, and e beside the first row.

    wedged  if L <= mu (2 X + D), the line from the mouth of the last row to the ends of the first
            one is in the friction cones of both: forces along it carry any push
    jammed  else a solution at rest exists if and only if e >= L / (2 mu). The normal forces N on
            either side are equal, and friction is up to mu N on each: F <= 2 mu N. With all of it
            at the first row, N L = F e. Anywhere else it asks for a larger e

    With one pin this is D. E. Whitney's, in the plane. A solution at rest is not the only
    one: the connector may also turn. With machined holes each pin has a gap of its own, and few of
    them bear the load.

    Why it is here: up to 576 contacts on one body, whose W has rank 6, between stick and slip.

    D. E. Whitney, Quasi-static assembly of compliantly supported rigid parts, Journal of Dynamic
    Systems, Measurement, and Control 104, 1982.
    """

    title: ClassVar[str] = "Peg in hole"
    description: ClassVar[str] = "A connector of up to 144 pins is pushed into a plate with play."
    application: ClassVar[str] = "robotics, assembly"
    authors: ClassVar[str] = "the authors of FCLIB, after D. E. Whitney"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "assembly"
    problems: ClassVar[int] = len(PINS) * len(DEPTHS) * len(OFFSETS) * len(MACHINED)

    mu: float = parameter(0.4, "1", "coefficient of friction")
    width: float = parameter(0.004, "m", "D, of a hole")
    mass: float = parameter(0.2, "kg", "of the connector with what holds it")
    force: float = parameter(20.0, "N", "F, of the push")
    play: float = parameter(1e-5, "m", "largest gap of a machined hole")

    def __post_init__(self) -> None:
        mjcf.check(self, positive=("mu", "width", "mass", "force"), non_negative=("play",))

    def problem(self, number: int, seed: int = 0) -> Any:
        """By pins, depth, offset, and whether machined; the seed draws the gaps."""
        pins, rest = divmod(number, len(DEPTHS) * len(OFFSETS) * len(MACHINED))
        depth, rest = divmod(rest, len(OFFSETS) * len(MACHINED))
        offset, machined = divmod(rest, len(MACHINED))
        random = np.random.Generator(np.random.PCG64([seed, number]))
        gaps = np.zeros(PINS[pins] ** 2)
        if MACHINED[machined]:
            gaps = self.play * random.uniform(size=len(gaps))
            gaps -= gaps.min()
        return self.of_pins(PINS[pins], DEPTHS[depth], OFFSETS[offset], gaps)

    def of_pins(self, pins: int, depth: float, offset: float, gaps: npt.NDArray[np.float64]) -> Any:
        """A connector of pins x pins; depth in widths, gaps (pins^2) [m].

        The push is `offset` times L / (2 mu) beside the first row.
        """
        D = self.width
        L = depth * D
        at = PITCH * D * (np.arange(pins) - 0.5 * (pins - 1))
        x, y = (part.ravel() for part in np.meshgrid(at, at))
        count = len(x)
        # of each pin: two corners at the mouth, x > 0, and two at its end, x < 0
        side = np.tile([1.0, 1.0, -1.0, -1.0], count)
        across = np.tile([-0.5, 0.5, -0.5, 0.5], count)
        pin = np.repeat(np.arange(count), 4)
        points = np.column_stack(
            (x[pin] + 0.5 * D * side, y[pin] + D * across, np.where(side > 0, 0.0, -L))
        )
        inwards = np.zeros((4 * count, 3))
        inwards[:, 0] = -side
        edge = PITCH * D * pins
        box = np.array([0.5 * edge, 0.5 * edge, 0.5 * HEIGHT * D])
        centre = np.array([0.0, 0.0, HEIGHT * D])
        a, b, c = (2 * box).tolist()
        turning = self.mass / 12 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
        bodies = assembly.Bodies(
            masses=np.array([self.mass]),
            inertias=turning[None],
            centres=centre[None],
            first=np.full(4 * count, -1),
            second=np.zeros(4 * count, dtype=np.int64),
            normals=inwards,
            points=points,
            impulses=np.zeros((1, 3)),
            sizes=box[None],
            planes=np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]),  # the plate, drawn by `_shown`
            gaps=gaps[pin],
            gravity=0.0,
        )
        kind = "machined" if gaps.any() else "exact"
        title = f"{count} pins, {depth:g} deep, push {offset:g} off, {kind}"
        h = assembly.STEP
        e = offset * L / (2 * self.mu) + float(x.min())  # from the middle
        f = h * self.force * np.array([0.0, 0.0, -1.0, 0.0, e, 0.0])
        w = np.zeros(12 * count)
        w[0::3] = gaps[pin] / h
        problem = bodies.problem(self.mu, title)
        facts = {"offset": e, "depth": L, "wedges": bool(self.mu * (x.max() - x.min() + D) >= L)}
        return problem.replace(
            f=f,
            w=w,
            info=assembly.told(problem.info, facts, "w_N = gap / h; no gravity"),
            **self._shown(problem, np.column_stack((x, y)), pin, L, bodies),
        )

    def _shown(
        self,
        problem: Any,
        places: npt.NDArray[np.float64],
        pin: npt.NDArray[np.int64],
        L: float,
        bodies: assembly.Bodies,
    ) -> dict[str, Any]:
        """The tables: plate and connector, with a bar beside each hole and a shape for each pin."""
        D, count = self.width, len(places)
        reach = 2 * D if L < D else 1.5 * L
        # bars of the plate between rows of pins, and its front and back
        columns = np.unique(places[:, 0])
        bars = np.append(columns - 0.5 * PITCH * D, columns[-1] + 0.5 * PITCH * D)
        half = 0.5 * PITCH * D * len(columns)
        plate = np.array([[0.5 * (PITCH - 1) * D, half, 0.5 * reach]] * len(bars))
        at = np.column_stack((bars, np.zeros(len(bars)), np.full(len(bars), -0.5 * reach)))
        long = L + 0.5 * HEIGHT * D
        # thinner than its hole by what a picture shows
        rods = np.array([[0.48 * D, 0.48 * D, 0.5 * long]] * count)
        down = np.column_stack((places, np.full(count, 0.5 * (long - 2 * L) - HEIGHT * D)))
        sizes = np.vstack((plate, bodies.sizes, rods))
        kinds = np.full(len(sizes), KINDS.index("box"), np.int32)
        upright = (1.0, 0.0, 0.0, 0.0)
        right = np.searchsorted(columns, places[pin, 0]) + (problem.contacts.normal[:, 0] < 0)
        tables = replace(
            problem.bodies,
            name="plate\nconnector",
            shape_body=np.repeat([0, 1], [len(plate), 1 + count]).astype(np.int32),
            shape_kind=kinds,
            shape_size=sizes,
            shape_place=np.vstack((at, np.zeros((1, 3)), down)),
            shape_turn=np.tile(upright, (len(sizes), 1)),
            shape_mesh=np.full(len(sizes), -1, np.int32),
        )
        shape = np.column_stack((right, len(plate) + 1 + pin)).astype(np.int32)
        feature = np.tile([0, 1, 0, 1], count).astype(np.int32)
        return {
            "bodies": tables,
            "contacts": replace(problem.contacts, shape=shape, feature=feature),
        }
