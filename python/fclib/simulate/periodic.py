"""A periodic cell: bodies that leave it on one side come in on the other.

Each body has four ghosts, its images shifted by the periods: (Lx, 0), (0, Ly), (Lx, Ly) and
(Lx, -Ly). Of two opposite shifts only one is used: "i touches j shifted by s" is the same as
"j touches i shifted by -s", so no contact is found twice. A ghost is a body without degrees of
freedom. Its place follows from its original, and it touches originals only. For a contact with it
MuJoCo gives the rows of the other body. The rows of the original, at the same point, are added:

    u = H_i^T v_i + H_j^T v_j,  H_j from the lever arm x - (x_j + s)

so that the cell as a whole exerts no force on itself.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib.simulate._mujoco import mujoco
from fclib.simulate.moreau_jean import Sparse, Vector

SHIFTS: Final = np.array([(1, 0, 0), (0, 1, 0), (1, 1, 0), (1, -1, 0)])  # in periods
BIT: Final = 1 << 30  # bit of contype for bodies that ghosts touch


class PeriodicCell:
    """The ghosts of a compiled model, and the cell into which its bodies are wrapped."""

    def __init__(self, m: Any, period: tuple[float, float]) -> None:
        """The cell of a model that `add_ghosts` made. ValueError if a body is too large."""
        self.period = np.array([*period, 0.0])
        ghosts = np.flatnonzero(m.body_mocapid >= 0)
        # the bodies in their order, then the four ghosts of each
        self._ghost = ghosts.reshape(-1, len(SHIFTS))
        self._body = np.arange(1, 1 + len(self._ghost))
        self.original = np.arange(m.nbody)  # (nbody) the body of a ghost, or the body itself
        self.original[self._ghost] = self._body[:, None]
        # (ngeom) likewise; the geometries of a ghost are in the order of its original's
        self.geometry = m.body_geomadr[self.original[m.geom_bodyid]] + (
            np.arange(m.ngeom) - m.body_geomadr[m.geom_bodyid]
        )
        # the compiler turns free bodies to their principal axes, but not their ghosts
        for field in (m.geom_pos, m.geom_quat, m.geom_sameframe):
            field[:] = field[self.geometry]
        size = 2 * (m.geom_rbound + np.linalg.norm(m.geom_pos, axis=1))
        largest = size[np.isin(m.geom_bodyid, self._body)].max(initial=0.0)
        if not largest < min(period):
            raise ValueError(f"the period must be above a body's size, {largest:g}, not {period}")

    def wrap(self, m: Any, q: Vector) -> None:
        """Bring the bodies of a configuration q (nq) into the cell around the origin, in place."""
        places = m.jnt_qposadr[m.body_jntadr[self._body]][:, None] + np.arange(2)
        L = self.period[:2]
        q[places] -= L * np.floor(q[places] / L + 0.5)

    def place(self, m: Any, d: Any) -> None:
        """Put the ghosts at the shifted places of their originals in the data's configuration."""
        q = m.jnt_qposadr[m.body_jntadr[self._body]]
        mocap = m.body_mocapid[self._ghost]
        d.mocap_pos[mocap] = d.qpos[q[:, None] + np.arange(3)][:, None] + self.period * SHIFTS
        d.mocap_quat[mocap] = d.qpos[q[:, None] + np.arange(3, 7)][:, None]

    def rows(self, m: Any, d: Any) -> Sparse:
        """The part of the ghosts' originals in MuJoCo's constraint rows (nefc x n)."""
        contact = d.contact
        body = m.geom_bodyid[contact.geom.reshape(-1, 2)]
        is_ghost = m.body_mocapid[body] >= 0
        values: list[Vector] = []
        rows: list[npt.NDArray[Any]] = []
        columns: list[npt.NDArray[Any]] = []
        for side, sign in ((0, -1.0), (1, 1.0)):
            which = np.flatnonzero(is_ghost[:, side] & (contact.efc_address >= 0))
            ghost = body[which, side]
            first = m.body_dofadr[self.original[ghost]]
            arm = contact.pos[which] - d.xpos[ghost]
            turn = d.xmat[ghost].reshape(-1, 3, 3)  # from the body to the world
            frame = contact.frame[which].reshape(-1, 3, 3)
            # rows of three forces and three moments along N, T1, T2; MuJoCo's spin is in the body's
            # frame
            gradient = np.zeros((len(which), 6, 6))
            gradient[:, :3, :3] = frame
            gradient[:, :3, 3:] = np.cross(arm[:, None], frame) @ turn
            gradient[:, 3:, 3:] = frame @ turn
            there = np.arange(6) < contact.dim[which][:, None]
            k, row = np.nonzero(there)
            values.append(sign * gradient[k, row].ravel())
            rows.append(np.repeat(contact.efc_address[which][k] + row, 6))
            columns.append((first[k][:, None] + np.arange(6)).ravel())
        entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        return sp.csr_array(entries, shape=(d.nefc, m.nv))


def add_ghosts(spec: Any, driven: frozenset[int] = frozenset()) -> None:
    """Give each body of a model its ghosts. ValueError if one is not a single free body.

    Bodies that are driven have none; they are given by their number, and come last.

    Across the boundary all colliding geometries touch each other, whatever their bits are.
    """
    spec.copy_during_attach = True
    bodies = list(spec.worldbody.bodies)
    if driven != frozenset(range(len(bodies) - len(driven), len(bodies))):
        raise ValueError("in a periodic scene bodies that are driven come last")
    bodies = bodies[: len(bodies) - len(driven)]
    # MuJoCo would copy keyframes with each body
    keys = [(key.name, list(key.qpos), list(key.qvel)) for key in spec.keys]
    for key in list(spec.keys):
        spec.delete(key)
    for body in bodies:
        joints = list(body.joints)
        free = len(joints) == 1 and joints[0].type == mujoco.mjtJoint.mjJNT_FREE
        if not free or list(body.bodies):
            raise ValueError(f"a periodic scene has free bodies only, not {body.name!r}")
        for geom in body.geoms:
            if geom.contype or geom.conaffinity:
                geom.contype |= BIT
    for body in bodies:
        for k in range(len(SHIFTS)):
            ghost = spec.worldbody.add_frame().attach_body(body, "", f"@{k}")
            for joint in list(ghost.joints):
                spec.delete(joint)
            ghost.mocap = True
            for geom in ghost.geoms:
                geom.conaffinity = geom.contype & BIT
                geom.contype = 0
                # no weight in the energy, and not drawn
                geom.mass = 0
                geom.rgba = (0, 0, 0, 0)
                geom.material = ""
    for name, qpos, qvel in keys:
        spec.add_key(name=name, qpos=qpos, qvel=qvel)
