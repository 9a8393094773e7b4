"""The first call of a solver in a process. It is slower than the others, so it is not measured.

It loads what the solver loads late, and fills the caches of the processor. The problem is a small
one of the same kind, not the measured one: a solver may remember what it has solved.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from fclib import _laws, _solve

CONTACTS = 6
LIMIT = 1.0  # [s] wall clock limit that the solver gets


def small(kind: str, d: int) -> Any:
    """A small problem of a kind ("local", "global_rolling") and a number of components."""
    m = d * CONTACTS
    friction = {
        name: np.full(CONTACTS, 0.5 if name == "mu" else 0.1) for name in _laws.names(kind, d)
    }
    # the matrix couples all contacts; some stick and some slide
    A = np.sin(np.arange(1.0, m * m + 1)).reshape(m, m)
    q = np.cos(np.arange(1.0, m + 1))
    q[::d] = -1.0
    made: Any = _laws.CLASSES[kind]
    if kind.startswith("local"):
        return made(spacedim=d, W=A @ A.T / m + 0.5 * np.eye(m), q=q, **friction)
    return made(
        spacedim=d, M=np.eye(m), H=A / np.sqrt(m) + np.eye(m), f=np.zeros(m), w=q, **friction
    )


def call(kind: str, spacedim: int, solver: str, options: Mapping[str, Any]) -> None:
    """Call a solver on a small problem, whatever the result."""
    with contextlib.suppress(Exception):
        _solve.solve(small(kind, spacedim), solver, 1e-6, time_limit=LIMIT, **options)
