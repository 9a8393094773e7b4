"""Many small problems on a GPU: how many a second, and a judge apart, in one run.

    python -m workshop.tables.gpu [--contacts 4 16] [--problems 1000000] [--results NAME]

The systems are boxes and bricks of random sizes and masses: one contact of a sphere; a box; towers
of two and four boxes; walls of six and ten bricks. Each is thrown (0.3 m/s at random), and at rest
(the velocity of a step, and 2 mm/s at random). They stay on the GPU; the time is that of the
kernel, by CUDA's events, the least of three, and of the whole call besides. Every answer that is
called converged is judged again on the CPU, by NumPy, in another formulation: projections on the
cone, of a velocity from J. It takes under four minutes.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

import fclib
from fclib import _device
from workshop.tables import _results

Floats = npt.NDArray[np.float64]
TOLERANCE = 1e-8
LEEWAY = 1 + 1e-3  # of a judge in double precision, whose sums have another order
STEP = 2e-3  # [s]
BASES = 32  # systems of each kind: sizes and masses
# so many problems make a launch long beside its start, and fit in the memory of a card
PROBLEMS = {1: 1_000_000, 4: 1_000_000, 8: 200_000, 16: 50_000, 32: 20_000, 64: 10_000}


class System:
    """Bodies and their contacts: J (m x coordinates) and 1 / M."""

    def __init__(self) -> None:
        self.centres: list[Floats] = []
        self.inverse: list[float] = []
        self.contacts: list[tuple[int, int, Floats]] = []

    def box(self, centre: Floats, half: Floats, mass: float) -> int:
        squares = half**2
        inertia = mass / 3 * (squares.sum() - squares)
        self.centres.append(centre)
        self.inverse += [1 / mass] * 3 + list(1 / inertia)
        return len(self.centres) - 1

    def touch(self, below: int, above: int, low: Floats, high: Floats, z: float) -> None:
        """Four contacts at the corners of a rectangle; below -1 is the ground."""
        for x in (low[0], high[0]):
            for y in (low[1], high[1]):
                self.contacts.append((below, above, np.array([x, y, z])))

    def jacobian(self) -> Floats:
        J = np.zeros((3 * len(self.contacts), 6 * len(self.centres)))
        axes = np.eye(3)[[2, 0, 1]]  # N, T1, T2
        for a, (below, above, point) in enumerate(self.contacts):
            for body, sign in ((above, 1.0), (below, -1.0)):
                if body < 0:
                    continue
                arm = point - self.centres[body]
                block = J[3 * a : 3 * a + 3, 6 * body : 6 * body + 6]
                block[:, :3], block[:, 3:] = sign * axes, sign * np.cross(arm, axes)
        return J


def sphere(rng: np.random.Generator) -> System:
    system = System()
    radius = 0.1 * np.exp(0.2 * rng.normal())
    body = system.box(np.array([0, 0, radius]), np.full(3, radius * 0.6**0.5), rng.uniform(0.3, 3))
    system.contacts.append((-1, body, np.zeros(3)))
    return system


def tower(rng: np.random.Generator, boxes: int) -> System:
    system, z, lowest = System(), 0.0, None
    for _ in range(boxes):
        half = np.array([0.1, 0.12, 0.08]) * np.exp(0.2 * rng.normal(size=3))
        place = 0.02 * rng.normal(size=2)
        body = system.box(np.append(place, z + half[2]), half, np.exp(rng.uniform(-1.2, 1.1)))
        low, high = place - half[:2], place + half[:2]
        if lowest is not None:
            low, high = np.maximum(low, lowest[0]), np.minimum(high, lowest[1])
        system.touch(body - 1, body, low, high, z)
        lowest, z = (place - half[:2], place + half[:2]), z + 2 * half[2]
    return system


def wall(rng: np.random.Generator, rows: tuple[int, ...]) -> System:
    """Rows of bricks, each laid over the joints of the row below."""
    system = System()
    length, depth, height = np.array([0.2, 0.1, 0.06]) * np.exp(0.1 * rng.normal(size=3))
    half = np.array([0.49 * length, depth, height])
    below: list[int] = []
    for level, count in enumerate(rows):
        row = []
        for k in range(count):
            x = (k + 0.5 * level) * length
            centre = np.array([x, 0, (2 * level + 1) * height])
            body = system.box(centre, half, np.exp(rng.uniform(-0.7, 0.7)))
            row.append(body)
            for other in below[k : k + 2] if level else [-1]:
                middle = system.centres[other][0] if level else x
                low = np.array([max(x, middle) - half[0], -depth])
                high = np.array([min(x, middle) + half[0], depth])
                system.touch(other, body, low, high, 2 * level * height)
        below = row
    return system


SYSTEMS: dict[int, tuple[str, Callable[[np.random.Generator], System]]] = {
    1: ("a sphere", sphere),
    4: ("a box", lambda rng: tower(rng, 1)),
    8: ("a tower of two", lambda rng: tower(rng, 2)),
    16: ("a tower of four", lambda rng: tower(rng, 4)),
    32: ("a wall of six", lambda rng: wall(rng, (4, 2))),
    64: ("a wall of ten", lambda rng: wall(rng, (4, 3, 2, 1))),
}


def problems(nc: int, count: int, at_rest: bool, seed: int = 7) -> dict[str, Floats]:
    """What solve_batch takes: problem k is of system k modulo BASES."""
    rng = np.random.default_rng([seed, nc])
    systems = [SYSTEMS[nc][1](rng) for _ in range(BASES)]
    J = np.array([one.jacobian() for one in systems])
    inverse, friction = (
        np.array([one.inverse for one in systems]),
        rng.uniform(0.2, 0.8, (BASES, nc)),
    )
    velocity = (0.002 if at_rest else 0.3) * rng.normal(size=(count, J.shape[2]))
    velocity[:, 2::6] -= 9.81 * STEP if at_rest else 0.2
    pick = np.arange(count) % BASES
    return {"jacobian": J[pick], "inverse_mass": inverse[pick], "velocity": velocity,
            "mu": friction[pick]}  # fmt: skip


def judge(given: dict[str, Floats], r: Floats) -> Floats:
    """Merit.error of each problem, from the projection on Coulomb's cone."""
    J, inverse, mu = given["jacobian"], given["inverse_mass"], given["mu"]
    shape = (*mu.shape, 3)
    q = np.matmul(J, given["velocity"][..., None])[..., 0]
    moved = inverse * np.matmul(J.transpose(0, 2, 1), r[..., None])[..., 0]
    u = (q + np.matmul(J, moved[..., None])[..., 0]).reshape(shape)
    size = np.einsum("kid,kid,kd->ki", J, J, inverse).reshape(shape).mean(axis=2)
    r, q = r.reshape(shape), q.reshape(shape)
    modified = u.copy()
    modified[..., 0] += mu * np.hypot(u[..., 1], u[..., 2])

    def natural(rho: Floats | float) -> Floats:
        y = r - np.asarray(rho)[..., None] * modified
        norm = np.hypot(y[..., 1], y[..., 2])
        n = np.where(norm <= mu * y[..., 0], y[..., 0], (y[..., 0] + mu * norm) / (1 + mu**2))
        n = np.where(mu * norm <= -y[..., 0], 0, n)
        scale = np.divide(mu * n, norm, out=np.zeros_like(n), where=norm > 0)
        projected = np.concatenate(
            [n[..., None], np.minimum(1, scale)[..., None] * y[..., 1:]], axis=-1
        )
        return np.asarray(np.linalg.norm(r - projected, axis=-1))

    def length(x: Floats) -> Floats:
        return np.asarray(np.sqrt((x**2).reshape(len(x), -1).sum(axis=1)))

    own = natural(1 / size)
    apart = np.maximum(own * size, -u[..., 0])
    plain = np.maximum(length(natural(1.0)), length(apart)) / length(q)
    return np.asarray(np.maximum(plain, length(own) / length(q / size[..., None])))


def measure(nc: int, host: dict[str, Floats], at_rest: bool, form: str) -> dict[str, Any]:
    """A row of the table."""
    import cupy

    count = len(host["mu"])
    given = {name: cupy.asarray(array) for name, array in host.items()}
    if form == "W":
        J = given["jacobian"]
        W = cupy.matmul(J * given["inverse_mass"][:, None, :], J.transpose(0, 2, 1))
        q = cupy.matmul(J, given["velocity"][..., None])[..., 0]
        given = {"W": cupy.ascontiguousarray(W), "q": cupy.ascontiguousarray(q), "mu": given["mu"]}
        del J, W, q
    start, stop = cupy.cuda.Event(), cupy.cuda.Event()
    times, kernels = [], []
    for _ in range(4):  # the first one compiles
        _device.TIMER = (start, stop)
        begun = time.perf_counter()
        found = fclib.solve_batch(**given, tol=TOLERANCE, unsolved="leave")
        cupy.cuda.Device().synchronize()
        times.append(time.perf_counter() - begun)
        kernels.append(cupy.cuda.get_elapsed_time(start, stop) / 1e3)
    _device.TIMER = None
    status, error = cupy.asnumpy(found.status), cupy.asnumpy(found.error)
    r = cupy.asnumpy(found.r)
    judged = np.concatenate(
        [
            judge({name: array[k : k + 50_000] for name, array in host.items()}, r[k : k + 50_000])
            for k in range(0, count, 50_000)
        ]
    )
    claimed = status == 0
    false = int((judged[claimed] > TOLERANCE * LEEWAY).sum())
    return {
        "contacts": nc,
        "system": SYSTEMS[nc][0],
        "velocity": "at rest" if at_rest else "thrown",
        "given": "J, 1/M" if form == "bodies" else "W",
        "problems": count,
        "problems a second": f"{count / min(kernels[1:]):.3g}",
        "of the whole call": f"{count / min(times[1:]):.3g}",
        "reached 1e-8 [%]": f"{100 * claimed.mean():.4f}",
        "Newton steps, mean": f"{float(found.iterations.mean()):.1f}",
        "most": int(found.iterations.max()),
        "largest error of these, judged apart": float(judged[claimed].max()),
        "false": false,
        "unwritten": int(np.isnan(error).sum()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--contacts", nargs="+", type=int, choices=PROBLEMS, default=list(PROBLEMS))
    parser.add_argument(
        "--problems", type=int, help="of each kind, instead of the built-in numbers"
    )
    _results.add_option(parser)
    chosen = parser.parse_args()
    missing = _device.missing()
    if missing:
        parser.error(missing)
    begun = time.perf_counter()
    rows = []
    for nc in chosen.contacts:
        for at_rest in (False, True):
            host = problems(nc, chosen.problems or PROBLEMS[nc], at_rest)
            for form in ("bodies", "W"):
                row = measure(nc, host, at_rest, form)
                rows.append(row)
                print(", ".join(f"{name} {value}" for name, value in row.items()), flush=True)
    wrong = sum(row["false"] + row["unwritten"] for row in rows)
    print(f"{_device.name()}: {time.perf_counter() - begun:.0f} s, {wrong} answers are false")
    if chosen.results:
        _results.store(
            chosen.results,
            [{name: value for name, value in row.items() if name != "unwritten"} for row in rows],
            title="Small problems on a GPU",
            note=f"{_device.name()}; tolerance 1e-8, both maps, in double precision",
        )
    raise SystemExit(1 if wrong else 0)


if __name__ == "__main__":
    main()
