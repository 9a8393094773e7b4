"""Contacts of rigid bodies that resist spin and rolling, as columns of H."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from fclib import _core

Vector = npt.NDArray[np.float64]


def frame(normal: npt.ArrayLike, tangent: npt.ArrayLike) -> Vector:
    """The rows N, T1, T2 = N x T1."""
    n, t = np.asarray(normal, dtype=float), np.asarray(tangent, dtype=float)
    return np.stack((n, t, np.cross(n, t)))


def columns(axes: Vector, arm: npt.ArrayLike, d: int) -> Vector:
    """The columns (6 x d) of a contact for one rigid body, with velocities (v, omega).

    Args:
        axes: the frame of the contact, rows N, T1, T2.
        arm: from the body's centre of mass to the contact [m].
        d: 4 (N, T1, T2, S) or 6 (and R1, R2).
    """
    forces = np.vstack((axes.T, np.cross(np.asarray(arm, dtype=float), axes).T))
    moments = np.vstack((np.zeros((3, 3)), axes.T))
    return np.hstack((forces, moments[:, : d - 3]))


def problem(
    masses: Vector, H: Vector, f: Vector, law: dict[str, Any], title: str
) -> _core.GlobalSpinProblem:
    """M v = H r + f, u = H^T v: a step from rest, or from a state that is in f."""
    d = 4 if law.get("mu_r") is None else 6
    return _core.GlobalSpinProblem(
        spacedim=d,
        M=np.diag(masses),
        H=H,
        f=f,
        w=np.zeros(H.shape[1]),
        **law,
        info=_core.ProblemInfo(
            title=title,
            math_info="M v = H r + f, u = H^T v; components N, T1, T2, S (R1, R2 of rolling),"
            " r_S and r_R in N m s, mu_s and mu_r in m",
        ),
    )
