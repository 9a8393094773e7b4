"""4,096 worlds of a cube that falls on a table: its mass and friction, found by gradients.

In each world the cube lands with another velocity, and is pushed by another known impulse while it
touches the table. What was recorded are the velocities of its lower corners after each of a few
steps. All steps of all worlds are one batch: a call finds their solutions, and a call the gradient
of the loss. There is no loop over worlds. `python worlds.py 256` takes fewer of them.
"""

import sys
import time
from typing import Any

import numpy as np

import fclib

WORLDS, STEPS = int(sys.argv[1]) if sys.argv[1:] else 4096, 3
STEP, GRAVITY, HALF = 0.01, 9.81, 0.1  # [s], [m/s^2], half of an edge [m]
rng = np.random.default_rng(0)

# normal z, tangents x and y of the four corners that touch: H^T maps (v, omega) to their velocities
H = np.zeros((6, 12))
for c, (x, y) in enumerate([(-1, -1), (-1, 1), (1, -1), (1, 1)]):
    arm = HALF * np.array([x, y, -1])
    for k, axis in enumerate(np.eye(3)[[2, 0, 1]]):
        H[:, 3 * c + k] = np.r_[axis, np.cross(arm, axis)]
# the inverse of the mass matrix of a cube of 1 kg
per_kg = np.r_[np.ones(3), np.full(3, 1.5 / HALF**2)]
W_per_kg = (H.T * per_kg) @ H


def data(log_mass: Any, velocity: Any, push: Any) -> tuple[Any, Any]:
    """W and q of many steps of a cube with this mass, from velocities before them."""
    mass = np.exp(log_mass)
    fall = velocity - STEP * GRAVITY * np.eye(6)[2]
    W = np.broadcast_to(W_per_kg / mass, (len(velocity), 12, 12))
    return W, (fall + push * per_kg / mass) @ H


def loss_and_slope(guess: Any, velocity: Any, push: Any, seen: Any) -> tuple[float, Any]:
    """The mean square of what is wrong with the corners' velocities, and its gradient."""
    W, q = data(guess[0], velocity, push)
    mu = np.full((len(q), 4), np.exp(guess[1]))
    found = fclib.solve_batch(W, q, mu, tol=1e-10, threads=0)
    kept = found.converged  # a world without a solution would not disturb the others
    wrong = np.where(kept[:, None], found.u - seen, 0) / kept.sum()
    by = fclib.vjp_batch(W, q, mu, found.r, u=wrong, threads=0)
    # the chain rule: W and the part of q by the push go with 1 / mass
    by_mass = -(by.W * W).sum() - (by.q * (push * per_kg / np.exp(guess[0]) @ H)).sum()
    return 0.5 * (wrong**2).sum() * kept.sum(), np.array([by_mass, (by.mu * mu).sum()])


# what was recorded, of a cube of 1.7 kg with mu = 0.35
truth = np.log([1.7, 0.35])
velocity = np.zeros((STEPS + 1, WORLDS, 6))
velocity[0, :, :3] = rng.normal(size=(WORLDS, 3)) * [0.5, 0.5, 0.1] - [0, 0, 0.5]
velocity[0, :, 5] = rng.normal(size=WORLDS)  # it spins about the vertical
push = np.zeros((STEPS, WORLDS, 6))
push[..., :2] = 0.3 * rng.normal(size=(STEPS, WORLDS, 2))  # [N s]
seen = np.empty((STEPS, WORLDS, 12))
for k in range(STEPS):
    W, q = data(truth[0], velocity[k], push[k])
    found = fclib.solve_batch(W, q, np.exp(truth[1]), tol=1e-10, threads=0)
    assert found.converged.all()
    seen[k] = found.u
    mass = np.exp(truth[0])
    velocity[k + 1] = velocity[k] - STEP * GRAVITY * np.eye(6)[2]
    velocity[k + 1] += (push[k] + found.r @ H.T) * per_kg / mass
before = velocity[:STEPS].reshape(-1, 6)

# descent by Adam on the logarithms, from a wrong mass and a wrong mu
guess, mean, square = np.log([1.0, 0.8]), np.zeros(2), np.zeros(2)
start = time.perf_counter()
for step in range(1, 101):
    loss, slope = loss_and_slope(guess, before, push.reshape(-1, 6), seen.reshape(-1, 12))
    mean += 0.1 * (slope - mean)
    square += 0.05 * (slope**2 - square)
    size = np.sqrt(square / (1 - 0.95**step)) + 1e-12
    guess -= 0.08 * 0.97**step * mean / (1 - 0.9**step) / size
    if step % 20 == 0:
        print(f"step {step:3}: loss {loss:.2e}, mass {np.exp(guess[0]):.4f}, mu", end="")
        print(f" {np.exp(guess[1]):.4f}")
spent = time.perf_counter() - start
print(f"{1e6 * spent / step / len(before):.1f} us for a step of a world, solved and differentiated")
