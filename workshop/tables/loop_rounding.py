"""What rounding makes of equalities that follow from others, beside what contradictions make.

    python -m workshop.tables.loop_rounding [--steps 30] [--results loop-rounding]

Closed loops with more rows than independent ones, of four sizes, at the origin and up to 1e6 m from
it: four-bar linkages in a plane of the axes and in an inclined one, a Bennett and a Sarrus linkage.
Each is simulated, and again with its last joint tied twice, to points a part of its size apart.

    steps     how many had a solution, without a contradiction
    follow    what is left of a row, of length one, after those that it follows from: the most
    turned    that as a multiple of the angle by which the loop is open and of the roundings
    others    the least that is left of other rows
    gap       of a row from those that it follows from, the most: a part of what it may be
    named     the least contradiction that is named, as a part of the size; and its gap

The constants of fclib.simulate.equalities are between: RANK above what follows exactly, OWN below
the others, TURNED above the multiples; and gaps of 1 between those of rounding and contradictions.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np
import scipy.linalg as la

import fclib
from fclib.scenes import Scene
from fclib.simulate import equalities, simulate
from workshop.tables import _results

SIZES = (1e-9, 1e-3, 1.0, 1e3)  # [m]
AWAY = (0.0, 1.0, 1e3, 1e6)  # [m]
PARTS = (1e-3, 1e-6, 1e-9, 1e-12)  # of the size: what two ties of a joint are apart
ANGLE = 1.1  # of joints at the start
SITE = '<site name="{}" pos="{}" quat="0.8 0.6 0 0"/>'


def moved(axis: str = "x", angle: float = 0.0, place: Any = (0, 0, 0)) -> Any:
    """A displacement, then a rotation about an axis (4 x 4)."""
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    found = np.eye(4)
    found[i, i] = found[j, j] = math.cos(angle)
    found[j, i] = math.sin(angle)
    found[i, j] = -found[j, i]
    found[:3, 3] = place
    return found


def numbers(values: Any) -> str:
    """Every digit of them."""
    return " ".join(repr(float(v)) for v in values)


def body(frame: Any, inside: str) -> str:
    """A body at a frame (4 x 4) of its parent."""
    axes = numbers((*frame[:3, 0], *frame[:3, 1]))
    return f'<body pos="{numbers(frame[:3, 3])}" xyaxes="{axes}">{inside}</body>'


def chain(axis: str, frames: list[Any], size: float, last: str) -> str:
    """Links from frame to frame, each on a hinge; of about the same moments at every size."""
    if not frames:
        return last
    link = (
        f'<joint axis="{numbers(np.eye(3)["xyz".index(axis)])}"/><inertial mass="{size**-2!r}"'
        f' pos="{numbers((0.3 * size, 0, 0.1 * size))}" diaginertia="0.05 0.1 0.1"/>'
    )
    return body(frames[0], link + chain(axis, frames[1:], size, last))


def sites(name: str, points: list[Any]) -> str:
    """Points of a body. They are turned: MuJoCo moves others by 1e-6 m to where their body is."""
    return "".join(SITE.format(f"{name}{i}", numbers(p[:3])) for i, p in enumerate(points))


def four_bar(size: float) -> tuple[str, int]:
    """Bars in a plane, with the last hinge's point tied to the base."""
    a, b, c = (np.array((length * size, 0, 0)) for length in (0.5, 0.7, 0.6))
    frames = [moved("z", 0.3), moved("z", ANGLE, a), moved("z", 0.7, b)]
    end = [np.append(c, 1)]
    whole = frames[0] @ frames[1] @ frames[2]
    return chain("z", frames, size, sites("p", end)) + sites("q", [whole @ end[0]]), 1


def bennett(size: float) -> tuple[str, int]:
    """Four skew hinges; the last one is two points of its axis."""
    alpha, beta, a = 0.5, 1.2, 0.4 * size
    b = a * math.sin(beta) / math.sin(alpha)
    ratio = math.sin((beta + alpha) / 2) / math.sin((beta - alpha) / 2)
    second = 2 * math.atan(ratio / math.tan(ANGLE / 2))
    angles = (ANGLE, second, 2 * math.pi - ANGLE)
    twist = [moved("x", angle, (d, 0, 0)) for angle, d in ((alpha, a), (beta, b), (alpha, a))]
    turns = [moved("z", angle) for angle in angles]
    frames = [turns[0], twist[0] @ turns[1], twist[1] @ turns[2]]
    ends = [twist[2] @ (0, 0, z, 1) for z in (0, size)]
    whole = frames[0] @ frames[1] @ frames[2]
    fixed = [whole @ end for end in ends]
    return chain("z", frames, size, sites("p", ends)) + sites("q", fixed), 2


def sarrus(size: float) -> tuple[str, int]:
    """A platform that two pairs of links lead straight up, by hinges at right angles."""
    up, side = (0, 0, 0.5 * size), 0.4 * size

    def folded(axis: str, place: Any) -> list[Any]:
        return [moved(axis, ANGLE, place), moved(axis, -2 * ANGLE, up)]

    points = [(side, side, 0, 1), (side + size, side, 0, 1)]
    frames = [*folded("y", (0, 0, 0)), moved("y", ANGLE, up)]
    others = folded("x", (side, side, 0))
    to_platform = np.linalg.inv(others[0] @ others[1]) @ frames[0] @ frames[1] @ frames[2]
    ends = [to_platform @ point for point in points]
    return (
        chain("y", frames, size, sites("p", points)) + chain("x", others, size, sites("q", ends))
    ), 2


def document(made: tuple[str, int], size: float, away: float, tilt: float, off: float) -> str:
    """The MJCF of a mechanism on a base; `off` [m]: its first tie is there twice, so far apart."""
    inside, ties = made
    tied = "".join(f'<connect name="tie {i}" site1="p{i}" site2="q{i}"/>' for i in range(ties))
    if off:
        old = '<site name="q0"'
        x, y, z = inside.split(f'{old} pos="')[1].split('"')[0].split()
        again = SITE.format("again", f"{float(x) + off!r} {y} {z}")
        inside = inside.replace(old, again + old)
        tied += '<connect name="again" site1="p0" site2="again"/>'
    base = moved("x", tilt, away * np.array((1, 0.7, 0.4))) @ moved("y", 0.4 * tilt)
    down = numbers(-size * np.array((2.0, 9.0, 3.0)))
    return (
        f'<mujoco><option timestep="0.002" gravity="{down}"/>'
        f"<worldbody>{body(base, inside)}</worldbody><equality>{tied}</equality></mujoco>"
    )


MECHANISMS = {
    "four-bar": (four_bar, 0.0),
    "four-bar, inclined": (four_bar, 0.7),
    "Bennett": (bennett, 0.7),
    "Sarrus": (sarrus, 0.7),
}


class Watch:
    """What of the rows is seen while a mechanism is simulated, by hooks into two functions."""

    def __init__(self) -> None:
        self.follow, self.turned, self.others, self.gap = 0.0, 0.0, 1.0, 0.0
        self.known = equalities.dependence, equalities.gaps_of

    def __enter__(self) -> Watch:
        dependence, gaps_of = self.known

        def seen(columns: Any, violation: Any, rounding: Any) -> Any:
            found = dependence(columns, violation, rounding)
            first, others, share = found
            scaled = columns / np.linalg.norm(columns, axis=0)
            triangle = la.qr(scaled[:, first], mode="r", pivoting=True)[0]
            least = np.abs(np.diag(triangle)).min(initial=1.0)
            rest = (columns[:, others] - columns[:, first] @ share) / np.linalg.norm(
                columns[:, others], axis=0
            )
            self.others = min(self.others, least)
            most = np.linalg.norm(rest, axis=0).max(initial=0.0)
            self.follow = max(self.follow, most)
            if most > equalities.RANK:
                sizes = equalities.sizes_of(columns)
                known = equalities.opening(violation, sizes) + (rounding / sizes).max()
                self.turned = max(self.turned, most / known)
            return found

        def weighed(columns: Any, violation: Any, rounding: Any, found: Any) -> Any:
            gaps, weights = gaps_of(columns, violation, rounding, found)
            self.gap = max(self.gap, weights.max(initial=0.0))
            return gaps, weights

        equalities.dependence, equalities.gaps_of = seen, weighed
        return self

    def __exit__(self, *_: object) -> None:
        equalities.dependence, equalities.gaps_of = self.known


def run(xml: str, steps: int) -> tuple[int, str, Watch]:
    """How many steps had a solution, what ended it, and what was seen."""
    done = 0
    with Watch() as watch:
        try:
            for step in simulate(Scene(name="loop", xml=xml), steps):
                if not step.result.converged:
                    return done, str(step.result.status), watch
                done += 1
        except (fclib.Error, ValueError, FloatingPointError) as error:
            return done, str(error), watch
    return done, "", watch


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--steps", type=int, default=30)
    _results.add_option(parser)
    arguments = parser.parse_args()
    rows = []
    for name, (make, tilt) in MECHANISMS.items():
        for size in SIZES:
            for away in AWAY:
                made = make(size)
                done, end, watch = run(document(made, size, away, tilt, 0.0), arguments.steps)
                named, units = 0.0, 0.0
                for part in PARTS:
                    xml = document(made, size, away, tilt, part * size)
                    _, word, planted = run(xml, 1)
                    if "contradict each other" not in word:
                        break
                    named, units = part, planted.gap
                rows.append(
                    {
                        "mechanism": name,
                        "size [m]": f"{size:g}",
                        "from the origin [m]": f"{away:g}",
                        "steps": done,
                        "follow": f"{watch.follow:.1e}",
                        "turned": f"{watch.turned:.2g}",
                        "others": f"{watch.others:.1e}",
                        "gap": f"{watch.gap:.2g}",
                        "named": f"{named:g}",
                        "gap of it": f"{units:.1e}",
                    }
                )
                print(*rows[-1].values(), end[:90], sep="  ", flush=True)
    if arguments.results:
        note = (
            f"{arguments.steps} steps each. Follow, others: what is left of rows, of length one,"
            " after those that they follow from, the most, and of other rows, the least. Turned:"
            " the first beside the angle by which the loop is open and the roundings, if it is"
            " above 1e-9. Gap: of a row from those that it follows from, 1 is what it may be."
            " Named: the least contradiction that is named, of 1e-3 to 1e-12 of the size, 0 for"
            " none: far away from the origin positions are rounded to more than that."
        )
        title = "Rounding in closed loops"
        print(_results.store(arguments.results, rows, title=title, note=note))


if __name__ == "__main__":
    main()
