"""Packings of spheres about jamming, in a box that holds them: with and without a solution."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib.scenes.shared import assembly, mjcf
from fclib.scenes.shared.family import parameter

SIZES = (60, 250, 1000, 5000, 6000)  # spheres
OVERLAPS = (1e-4, 1e-4, 1e-4, 1e-3, 1e-3)  # about, of a radius
# of the growth that is taken back: at 1 the overlaps sum to nothing, weighted by the forces
RELEASED = (10.0, 3.0, 1.5, 1.1, 0.9, 0.0)
STORED = Path(__file__).with_name("jammed.npz")
EDGE = 1e13  # of the stored cube
# of overlaps times overlaps, and times widths [m^2], by spheres of 1 cm: last digits as published
SUMS = {
    60: ("0x1.2a42e0d2ba970p-32", "0x1.474e5e2f58c59p-19"),
    1000: ("0x1.9ddb98b71f8b1p-31", "0x1.3fe8f4d4361e5p-16"),
    5000: ("0x1.76b30b9a55510p-19", "0x1.6d7aef2607bb6p-9"),
    6000: ("0x1.09bb2a3736478p-19", "0x1.514ef51acff89p-9"),
}


@dataclass(frozen=True, kw_only=True)
class Jammed:
    """Spheres of radii that differ in a closed box, whose radii grow step by step through jamming.

    The packings are stored, in equilibrium just above jamming: overlaps are about 1e-4 of a radius
    (1e-3 in the two largest), and as forces y they balance (H y = 0). The law is that of gaps: a
    step must open all overlaps. With y the sum of forces times gaps is below 0: no velocity does
    that, there is no solution, and y proves it. The radii are then made smaller. At `released` = 1
    this sum is 0: jamming. For larger values y proves nothing. Once all gaps are open there is a
    solution.

    Why it is here: there are just enough contacts to hold the spheres, so that W is as near to
    singular as it can be for a packing. Reactions of all sizes go through long chains, and the
    margin between a solution and none can be made as small as one likes.

    C. S. O'Hern, L. E. Silbert, A. J. Liu, S. R. Nagel, Jamming at zero temperature and zero
    applied stress: the epitome of disorder, Physical Review E 68, 2003.
    """

    title: ClassVar[str] = "Jammed packing"
    description: ClassVar[str] = "Spheres in a closed box that grow step by step through jamming."
    application: ClassVar[str] = "granular matter, existence of solutions"
    authors: ClassVar[str] = "the authors of FCLIB, after C. S. O'Hern and others"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "existence"
    problems: ClassVar[int] = len(SIZES) * len(RELEASED)

    mu: float = parameter(0.5, "1", "coefficient of friction")
    radius: float = parameter(0.01, "m", "largest radius")
    reach: float = parameter(0.02, "1", "largest gap of a contact, in largest radii")

    def __post_init__(self) -> None:
        mjcf.check(self, positive=("radius",), non_negative=("mu", "reach"))

    def problem(self, number: int, seed: int = 0) -> Any:
        """By size, then from loose to jammed; nothing is random."""
        size, step = divmod(number, len(RELEASED))
        return self.of_size(SIZES[size], RELEASED[step])

    def of_size(self, spheres: int, released: float) -> Any:
        """A packing of so many spheres; `released` as in RELEASED."""
        bodies = self.bodies(spheres)
        forces = np.maximum(-np.asarray(bodies.gaps), 0.0)
        widths = bodies.sizes[bodies.second, 0]
        widths = widths + np.where(bodies.first >= 0, bodies.sizes[bodies.first, 0], 0.0)
        # exact sums, as those of a BLAS depend on the processor
        sums = [math.fsum(forces * forces), math.fsum(forces * widths)]
        own = [float.fromhex(word) for word in SUMS.get(spheres, ())]
        if own and np.allclose(sums, own, rtol=1e-12, atol=0):
            sums = own
        gaps = bodies.gaps + released * sums[0] / sums[1] * widths
        problem = bodies.problem(
            self.mu, f"{spheres} spheres, {released:g} of the growth beyond jamming taken back"
        )
        w = np.zeros(3 * len(gaps))
        w[0::3] = gaps / assembly.STEP
        return problem.replace(w=w)

    def bodies(self, spheres: int) -> assembly.Bodies:
        """The stored packing of so many spheres, with all contacts within reach."""
        largest, places, radii = stored(spheres)
        unit = self.radius / largest  # edge of the cube [m]
        centres, radii = unit * places, unit * radii
        pairs = assembly.near(centres, (2 + self.reach) * self.radius)
        difference = centres[pairs[:, 1]] - centres[pairs[:, 0]]
        distance = np.linalg.norm(difference, axis=1)
        normals, points = [difference / distance[:, None]], [centres[pairs].mean(axis=1)]
        first, second, gaps = [pairs[:, 0]], [pairs[:, 1]], [distance - radii[pairs].sum(axis=1)]
        planes = []
        for axis in range(3):
            for side, sign in ((0.0, 1.0), (unit, -1.0)):
                normal = sign * np.eye(3)[axis]
                corner = np.full(3, side)
                planes.append(np.concatenate((corner, normal)))
                gap = sign * (centres[:, axis] - side) - radii
                near = np.arange(spheres)
                first.append(np.full(spheres, -1))
                second.append(near)
                gaps.append(gap)
                normals.append(np.tile(normal, (spheres, 1)))
                points.append(centres - (radii + gap)[:, None] * normal)
        arrays = [np.concatenate(one) for one in (first, second, gaps, normals, points)]
        kept = arrays[2] <= self.reach * self.radius
        first_, second_, gaps_, normals_, points_ = (one[kept] for one in arrays)
        volumes = assembly.as_published(f"Jammed/{spheres}", assembly.cubes(radii))
        masses = 2500 * 4 / 3 * np.pi * volumes
        return assembly.Bodies(
            masses=masses,
            inertias=np.repeat((0.4 * masses * radii**2)[:, None], 3, axis=1),
            centres=centres,
            first=first_,
            second=second_,
            normals=normals_,
            points=points_,
            impulses=np.zeros((spheres, 3)),
            sizes=np.repeat(radii[:, None], 3, axis=1),
            planes=np.array(planes),
            kind="sphere",
            gaps=gaps_,
        )

    def proof(self, problem: Any, spheres: int) -> npt.NDArray[np.float64]:
        """Normal reactions (3 nc), H y = 0 to rounding: the overlaps of the packing as forces."""
        from scipy.sparse.linalg import lsqr  # the import takes a while

        y = np.zeros(3 * problem.nc)
        y[0::3] = np.maximum(-np.asarray(self.bodies(spheres).gaps), 0.0)
        y /= y.max()
        # stored places are rounded: the nearest that balance, of those that press
        pressing = np.flatnonzero(y)
        H = sp.csc_array(problem.H)[:, pressing]
        y[pressing] -= lsqr(H, H @ y[pressing], atol=1e-15, btol=1e-15, iter_lim=20000)[0]
        return np.maximum(y, 0.0)  # one that hardly presses may have become a rounding below 0


@functools.cache
def stored(spheres: int) -> tuple[float, Any, Any]:
    """The largest radius of a stored packing, places and radii, the edge of the cube being 1."""
    with np.load(STORED) as arrays:
        largest = float(arrays[f"largest{spheres}"])
        radii = 1e-3 * largest * arrays[f"radii{spheres}"]
        return largest, arrays[f"places{spheres}"] / EDGE, radii
