"""Record a simulation in one file, step by step, and read it back: a ball slides until it stops."""

import tempfile
from pathlib import Path

import numpy as np

import fclib

DT, GRAVITY = 0.01, 9.81

path = Path(tempfile.mkdtemp()) / "run.h5"
velocity = np.array([0.0, 2.0, 0.0])
with fclib.SequenceWriter(path) as writer:
    for _ in range(100):
        q = velocity - [GRAVITY * DT, 0, 0]
        problem = fclib.LocalProblem(spacedim=3, W=np.eye(3), q=q, mu=[0.5])
        result = fclib.solve(problem)
        writer.append(problem, result)
        velocity = q + result.solution.r

steps = fclib.Sequence(path)
print(f"{len(steps)} steps, {path.stat().st_size / len(steps):.0f} bytes each")
for k in range(0, len(steps), 20):
    step, solution = steps[k], steps.solution(k)
    assert isinstance(step, fclib.LocalProblem)
    assert solution is not None
    speed = step.q[1] + solution.r[1]
    error = fclib.merit(step, solution).error
    print(f"step {k}: slides with {speed:.2f} m/s, error {error:.0e}")
