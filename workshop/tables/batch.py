"""Many small problems: fclib.solve_batch and its derivatives, a loop, Pinocchio and MuJoCo.

    python -m workshop.tables.batch [--count 2000] [--repeats 3] [--threads 2] [--results NAME]

The systems are MuJoCo's own: a box (or some) thrown on a plane, W = J M^-1 J^T and q = J v of its
contacts, impulses of one step. Every solver gets the same W, q and mu in one process, one thread;
the CPU time is that of the whole call from Python, what each takes to build its own objects left
out. The error is `Merit.error` of what it returns. Peers run twice: to their tightest tolerance
with many iterations, and within the limits that they come with. MuJoCo solves its own problem from
its own constraint matrices, made as stiff as it allows (solimp 0.9999, a velocity that one step
stops): its law is a convex relaxation, so that its error is what the relaxation costs.

The derivatives (fclib.vjp_batch with weights of r, fclib.jvp_batch with changes of q) take turns
with fclib.solve_batch, on one thread: a row has the ratio of their least CPU times.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.metadata
import importlib.util
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

import fclib
from workshop.tables import _results

Floats = npt.NDArray[np.float64]
STEP = 1e-3

SPHERE = '<body pos="0 0 0.1"><freejoint/><geom type="sphere" size="0.1" mass="1"/></body>'
BOX = (
    '<body pos="0 0 {z}"><freejoint/><geom type="box" size="0.1 0.12 {half}" mass="{mass}"/></body>'
)
SCENES = {
    "one (a sphere)": SPHERE,
    "four (a box)": BOX.format(z=0.08, half=0.08, mass=1),
    "eight (two boxes)": BOX.format(z=0.08, half=0.08, mass=1)
    + BOX.format(z=0.22, half=0.06, mass=0.5),
    "sixteen (four boxes)": "".join(
        BOX.format(z=0.05 + 0.1 * k, half=0.05, mass=1 / (k + 1)) for k in range(4)
    ),
}
DERIVATIVE_ROUNDS = 15


class Systems:
    """Contact problems of a scene at random velocities, and MuJoCo's state of each."""

    def __init__(self, bodies: str, count: int, rng: np.random.Generator) -> None:
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{STEP}" cone="elliptic" solver="Newton" jacobian="dense"/>'
            f'<default><geom friction="0.5 0 0" condim="3" solref="-1e-6 {-1 / STEP}" '
            'solimp="0.9999 0.9999 0.001 0.5 2"/></default>'
            f'<worldbody><geom type="plane" size="0 0 1"/>{bodies}</worldbody></mujoco>'
        )
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        start = self.data.qpos.copy()
        # a little into each other, so that the contacts are there
        start[2::7] -= 1e-4 * np.arange(1, self.model.nbody)
        self.states: list[tuple[Floats, Floats]] = []
        W, q = [], []
        for _ in range(count):
            velocity = 0.3 * rng.normal(size=self.model.nv)
            velocity[2::6] -= 0.2
            self.states.append((start, velocity))
            self.set(len(self.states) - 1)
            data, model = self.data, self.model
            rows, n = data.nefc, model.nv
            J = data.efc_J.reshape(-1)[: rows * n].reshape(rows, n)
            M = np.zeros((n, n))
            mujoco.mj_fullM(model, data, M)
            W.append(J @ np.linalg.solve(M, J.T))
            q.append(J @ (velocity + STEP * data.qacc_smooth))
        self.W, self.q = np.array(W), np.array(q)
        self.mu = np.full((count, self.W.shape[1] // 3), 0.5)

    def set(self, k: int) -> None:
        """Bring MuJoCo to state k, just before its solver."""
        self.data.qpos[:], self.data.qvel[:] = self.states[k]
        self.data.qacc_warmstart[:] = 0
        mujoco.mj_forward(self.model, self.data)

    def problem(self, k: int) -> fclib.LocalProblem:
        """The problem of state k."""
        return fclib.LocalProblem(W=self.W[k], q=self.q[k], mu=self.mu[k])


def errors(systems: Systems, reactions: Any) -> Floats:
    """Merit.error of each reaction."""
    return np.array(
        [
            fclib.merit(systems.problem(k), fclib.Solution(r=r)).error
            for k, r in enumerate(reactions)
        ]
    )


def by_mujoco(systems: Systems, count: int, tight: bool) -> tuple[float, list[Floats]]:
    """CPU time of mj_fwdConstraint [s], and the impulses."""
    option = systems.model.opt
    option.tolerance, option.iterations = (1e-15, 1000) if tight else (1e-8, 100)
    spent, reactions = 0.0, []
    for k in range(count):
        systems.set(k)
        systems.data.qacc_warmstart[:] = 0
        start = time.process_time_ns()
        mujoco.mj_fwdConstraint(systems.model, systems.data)
        spent += time.process_time_ns() - start
        reactions.append(STEP * systems.data.efc_force[: systems.data.nefc].copy())
    return 1e-9 * spent, reactions


def by_pinocchio(
    which: str, systems: Systems, count: int, tight: bool
) -> tuple[float, list[Floats]]:
    """CPU time of its solve [s], and the impulses; its normal component is the last one."""
    pin = importlib.import_module("pinocchio")
    contacts = importlib.import_module("fclib.external.pinocchio")
    m = systems.W.shape[1]
    order = np.arange(m).reshape(-1, 3)[:, [1, 2, 0]].ravel()
    models, datas = contacts._contacts(pin, systems.mu[0])
    settings = getattr(pin, f"{which}SolverSettings")()
    settings.solve_ncp = True
    if tight:
        settings.max_iterations = 2000
        settings.absolute_feasibility_tol = settings.absolute_complementarity_tol = 1e-12
        settings.relative_feasibility_tol = settings.relative_complementarity_tol = 0.0
    spent, reactions = 0.0, []
    for k in range(count):
        # the numbers are scaled as it wants them: of the size of 1
        stiffness = systems.W[k].diagonal().mean()
        speed = np.linalg.norm(systems.q[k])
        W = np.asfortranarray(systems.W[k][np.ix_(order, order)] / stiffness)
        q = systems.q[k][order] / speed
        delassus = pin.DelassusOperatorDense(W)
        result = getattr(pin, f"{which}SolverResult")()
        solver = getattr(pin, f"{which}ConstraintSolver")(m)
        start = time.process_time_ns()
        solver.solve(delassus, q, models, datas, settings, result)
        spent += time.process_time_ns() - start
        r = np.zeros(m)
        r[order] = np.array(result.retrieveConstraintImpulses()) * (speed / stiffness)
        reactions.append(r)
    return 1e-9 * spent, reactions


HEADS = (
    "contacts", "solver", "CPU [us]", "median error", "worst error", "at most 1e-8 [%]",
    "vjp / solve", "jvp / solve",
)  # fmt: skip


def row(
    contacts: str, name: str, spent: float, count: int, error: Floats, ratios: tuple[str, str]
) -> dict[str, str]:
    """A line of the table."""
    cells = (
        contacts,
        name,
        f"{1e6 * spent / count:.2f}",
        f"{np.median(error):.0e}",
        f"{error.max():.0e}",
        f"{100 * np.count_nonzero(error <= 1e-8) / len(error):.0f}",
        *ratios,
    )
    print(f"| {' | '.join(cells)} |", flush=True)
    return dict(zip(HEADS, cells, strict=True))


def gain(systems: Systems, threads: int) -> tuple[float, float]:
    """How many times as many problems a second so many threads solve, the best of many rounds, and
    how many times the CPU time of one thread they spend, which a busy machine hardly changes.
    """
    times = 200 // systems.mu.shape[1] + 1
    arrays = [
        np.tile(a, (times,) + (1,) * (a.ndim - 1)) for a in (systems.W, systems.q, systems.mu)
    ]
    walls = {1: np.inf, threads: np.inf}
    spent = dict(walls)
    for _ in range(15):
        for number in walls:
            start, cpu = time.perf_counter(), time.process_time()
            fclib.solve_batch(*arrays, threads=number)
            walls[number] = min(walls[number], time.perf_counter() - start)
            spent[number] = min(spent[number], time.process_time() - cpu)
    return walls[1] / walls[threads], spent[threads] / spent[1]


def of_derivatives(systems: Systems) -> tuple[str, str]:
    """How many times the CPU time of solve_batch vjp_batch and jvp_batch take."""
    arrays = (systems.W, systems.q, systems.mu)
    solution = fclib.solve_batch(*arrays, tol=1e-12).r
    ones = np.ones_like(solution)
    least: dict[Callable[[], object], float] = {
        lambda: fclib.solve_batch(*arrays): np.inf,
        lambda: fclib.vjp_batch(*arrays, solution, r=ones): np.inf,
        lambda: fclib.jvp_batch(*arrays, solution, dq=ones): np.inf,
    }
    for _ in range(DERIVATIVE_ROUNDS):
        for run in least:
            start = time.process_time_ns()
            run()
            least[run] = min(least[run], time.process_time_ns() - start)
    solve, vjp, jvp = least.values()
    return f"{vjp / solve:.2f}", f"{jvp / solve:.2f}"


def runs_of(
    systems: Systems, count: int
) -> Iterator[tuple[str, int, Callable[[], tuple[float, Any]]]]:
    """Name, number of problems, and a function that gives the CPU time and the reactions."""
    problems = [systems.problem(k) for k in range(count)]
    few = min(count, 300)

    def batch() -> tuple[float, Any]:
        start = time.process_time()
        found = fclib.solve_batch(systems.W, systems.q, systems.mu)
        return time.process_time() - start, found.r

    def loop() -> tuple[float, Any]:
        start = time.process_time()
        found = [fclib.solve(problem) for problem in problems]
        spent = time.process_time() - start
        return spent, [result.solution.r for result in found]

    yield "fclib.solve_batch", count, batch
    yield "a loop of fclib.solve", count, loop
    for words, tight in (("tight", True), ("its own limits", False)):
        yield (
            f"MuJoCo {mujoco.__version__}, Newton, {words}",
            few,
            partial(by_mujoco, systems, few, tight),
        )
        if importlib.util.find_spec("pinocchio") is None:
            continue
        version = importlib.metadata.version("pin")
        for which in ("ADMM", "PGS"):
            name = f"Pinocchio {version}, {which}, {words}"
            yield name, few, partial(by_pinocchio, which, systems, few, tight)


def main() -> None:
    """Solve, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=2000, help="problems of each size")
    parser.add_argument("--repeats", type=int, default=3, help="the least time counts")
    parser.add_argument("--threads", type=int, default=2)
    _results.add_option(parser)
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    print(f"| {' | '.join(HEADS)} |\n{'|---' * len(HEADS)}|")
    rows, gains = [], []
    for title, bodies in SCENES.items():
        systems = Systems(bodies, arguments.count, rng)
        for name, number, run in runs_of(systems, arguments.count):
            found = [run() for _ in range(arguments.repeats)]
            spent = min(time for time, _ in found)
            ratios = of_derivatives(systems) if name == "fclib.solve_batch" else ("", "")
            rows.append(row(title, name, spent, number, errors(systems, found[-1][1]), ratios))
        faster, dearer = gain(systems, arguments.threads)
        gains.append(f"{faster:.2f} for {title} ({dearer:.2f} times the CPU time)")
    words = f"{arguments.threads} threads solve so many times as many a second: {', '.join(gains)}."
    print("\n" + words)
    if arguments.results:
        _results.store(
            arguments.results,
            rows,
            title="Small problems, CPU time of one and `Merit.error`",
            note=f"{arguments.count} problems of a kind, the least of {arguments.repeats} runs; "
            f"of the derivatives {DERIVATIVE_ROUNDS}, in turn with the solver; tolerance 1e-8. "
            f"{words}",
        )


if __name__ == "__main__":
    main()
