"""What a step of the time stepper costs: a humanoid that stands with twenty contacts or more.

    .venv/bin/python benchmarks/step_cost.py [--steps 200]

CPU milliseconds of a step: the system (MuJoCo's own functions and the arrays from them), the
problem of it, and the solve. They are medians over the steps.
"""

from __future__ import annotations

import argparse
import statistics
import time
from typing import Any

from fclib import _solve
from fclib.scenes import Scene
from fclib.simulate import MujocoModel, scheme_of

# limbs of capsules, and feet of eight spheres each
LIMB = (
    '<body pos="{x} {y} {z}"><joint axis="1 0 0" {joint}/><joint axis="0 1 0" {joint}/>'
    '<geom type="capsule" size="0.04" fromto="0 0 0 0 0 -{length}" mass="2"/>{more}</body>'
)
JOINT = 'damping="4" stiffness="300" limited="true" range="-1.5 1.5" frictionloss="0.5"'


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


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--steps", type=int, default=200)
    steps = parser.parse_args().steps
    model = MujocoModel(Scene(name="humanoid", xml=humanoid()))
    scheme = scheme_of(model)
    spent: dict[str, list[float]] = {
        name: [] for name in ("assemble", "problem", "solve", "integrate", "all")
    }
    contacts = []
    guess = None
    for step in range(steps):
        clock = [time.process_time()]
        system = scheme.assemble(model)
        clock.append(time.process_time())
        part = scheme.problem(system, model.velocity)
        clock.append(time.process_time())
        problem = part.problem
        known: dict[str, Any] = (
            {} if guess is None or guess.r.size != problem.m else {"guess": guess}
        )
        result = _solve.solve(problem, tol=1e-8, merit="natural", **known)
        clock.append(time.process_time())
        guess = result.solution
        model.integrate(scheme.h, part.after(result.solution.v))
        clock.append(time.process_time())
        if step >= steps // 4:
            contacts.append(problem.nc - (0 if system.dry is None else len(system.dry.bound)))
            for name, start, end in zip(list(spent)[:4], clock, clock[1:], strict=False):
                spent[name].append(1e3 * (end - start))
            spent["all"].append(1e3 * (clock[-1] - clock[0]))
    print(f"{statistics.median(contacts):.0f} contacts and limits, CPU ms a step (median)")
    for name, values in spent.items():
        print(f"{name:10}{statistics.median(values):8.3f}")


if __name__ == "__main__":
    main()
