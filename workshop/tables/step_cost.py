"""What a step of the time stepper costs: a humanoid that stands with twenty contacts or more.

    python -m workshop.tables.step_cost [--steps 200] [--results step-cost]

CPU milliseconds of a step: the system (MuJoCo's own functions and the arrays from them), the
problem of it, the solve from a solution, and the motion; each part is called again and again on one
step. "simulate" is what a step of a simulation takes in all: from one step to the next, with the
words that each problem gets, and the reactions carried over.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

from fclib import _solve
from fclib.scenes import Scene
from fclib.simulate import MujocoModel, scheme_of, simulate
from workshop.tables import _results

# limbs of capsules, and feet of eight spheres each
LIMB = (
    '<body pos="{x} {y} {z}"><joint axis="1 0 0" {joint}/><joint axis="0 1 0" {joint}/>'
    '<geom type="capsule" size="0.04" fromto="0 0 0 0 0 -{length}" mass="2"/>{more}</body>'
)
JOINT = 'damping="4" stiffness="300" limited="true" range="-1.5 1.5" frictionloss="0.5"'


RUNS = 10  # of a part: others on the machine make each longer, never shorter


def humanoid() -> str:
    """A trunk, two legs with feet, two arms; MJCF."""

    def limb(x: float, y: float, z: float, length: float, more: str) -> str:
        return LIMB.format(x=x, y=y, z=z, length=length, more=more, joint=JOINT)

    soles = "".join(
        f'<geom size="0.02" pos="{0.04 * i - 0.06} {0.03 * j} -0.05" mass="0.05"/>'
        for i in range(5)
        for j in (-1, 1)
    )
    foot = limb(0, 0, -0.4, 0.03, soles)
    legs = "".join(limb(0, y, 0, 0.4, limb(0, 0, -0.4, 0.4, foot)) for y in (-0.12, 0.12))
    arms = "".join(limb(0, y, 0.5, 0.3, limb(0, 0, -0.3, 0.3, "")) for y in (-0.22, 0.22))
    return (
        '<mujoco><compiler angle="radian"/><option timestep="0.002"/><worldbody>'
        '<geom type="plane" size="0 0 1"/><body pos="0 0 0.869"><freejoint/>'
        '<geom type="capsule" size="0.1" fromto="0 0 0.05 0 0 0.5" mass="30"/>'
        f"{legs}{arms}</body></worldbody></mujoco>"
    )


def cost(what: Callable[[], Any], times: int) -> float:
    """CPU milliseconds of a call: the least of some runs, in which it is called so many times."""
    least = float("inf")
    for _ in range(RUNS):
        start = time.process_time()
        for _ in range(times):
            what()
        least = min(least, time.process_time() - start)
    return 1e3 * least / times


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--times", type=int, default=20, help="calls of a part in a run")
    _results.add_option(parser)
    arguments = parser.parse_args()
    scene = Scene(name="humanoid", xml=humanoid())
    going = simulate(scene, arguments.steps + RUNS * arguments.times)
    for _ in range(arguments.steps):
        step = next(going)
    whole = cost(lambda: next(going), arguments.times)
    model = MujocoModel(scene)
    scheme = scheme_of(model)
    model.set_state(step.start.position, step.start.velocity)
    system = scheme.assemble(model)
    part = scheme.problem(system, model.velocity)
    options: dict[str, Any] = {"tol": 1e-8, "merit": "natural", "guess": step.result.solution}
    after = part.after(step.result.solution.v)

    def move() -> None:
        model.integrate(scheme.h, after)
        model.set_state(step.start.position, step.start.velocity)

    dry = 0 if system.dry is None else len(system.dry.bound)
    words = f"{part.problem.nc - dry} contacts, {dry} joints with dry friction"
    print(f"{words}; CPU ms")
    spent = {
        "system": cost(lambda: scheme.assemble(model), arguments.times),
        "problem": cost(lambda: scheme.problem(system, model.velocity), arguments.times),
        "solve": cost(lambda: _solve.solve(part.problem, **options), arguments.times),
        "move": cost(move, arguments.times),
    }
    spent["step"] = sum(spent.values())
    spent["simulate"] = whole
    for name, value in spent.items():
        print(f"{name:10}{value:8.3f}")
    if arguments.results:
        path = _results.store(
            arguments.results,
            [{"part": name, "CPU [ms]": f"{value:.2f}"} for name, value in spent.items()],
            title="Cost of a step",
            note=f"A humanoid that stands: {words}. The least of {RUNS} means over"
            f" {arguments.times} calls.",
            command="python -m workshop.tables.step_cost --results step-cost",
        )
        print(path)


if __name__ == "__main__":
    main()
