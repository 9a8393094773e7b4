"""Small problems with several solutions, all of which are known."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fclib import _core
from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import parameter

# of each kind, from little friction to much
KINDS = ("rod", "wedge", "mass")
STEPS = 12


@dataclass(frozen=True, kw_only=True)
class ManySolutions:
    """Planar problems of one or two contacts that have several solutions, or lose the only one.

    rod     Painleve's: a uniform rod at an angle slides with its lower end forwards. Beyond
            mu = (1 + 3 cos^2) / (3 sin cos) of its angle W_NN - mu W_NT < 0: friction pulls it
            down, and it may take off, slide on, or stop at once.
    wedge   a block that leaves the narrow side of two inclined faces: above a friction of the
            tangent of their slope it may also be locked, by any force above some bound.
    mass    Klarbring's: a mass on a spring that couples normal and tangential forces, on one face.
            Above a friction of 1 / coupling it may leave, slide or stick.

    `fclib.analysis.enumerate_solutions` finds all isolated solutions, in exact arithmetic.

    P. Painleve, Sur les lois du frottement de glissement, Comptes rendus 121, 1895.
    A. Klarbring, Examples of non-uniqueness and non-existence of solutions to quasistatic contact
      problems with friction, Ingenieur-Archiv 60, 1990.
    """

    title: ClassVar[str] = "Many solutions"
    description: ClassVar[str] = "Painleve's rod, a wedged block, Klarbring's mass; in the plane."
    application: ClassVar[str] = "uniqueness of solutions"
    authors: ClassVar[str] = "the authors of FCLIB, after P. Painleve and A. Klarbring"
    friction: ClassVar[str] = "Coulomb"
    collection: ClassVar[str] = "existence"
    problems: ClassVar[int] = len(KINDS) * STEPS
    several: ClassVar[bool] = True  # solutions, all of which are stored

    angle: float = parameter(1.1, "rad", "of the rod above the ground, in (0, pi/2)")
    slope: float = parameter(0.3, "rad", "of the wedge's faces to the vertical, in (0, pi/2)")
    coupling: float = parameter(0.8, "1", "of Klarbring's spring, in (-1, 1)")

    def __post_init__(self) -> None:
        mjcf.check(self, positive=("angle", "slope", "coupling"))
        if max(self.angle, self.slope) >= math.pi / 2 or self.coupling >= 1:
            raise ValueError("ManySolutions: angles must be < pi/2, the coupling < 1")

    def problem(self, number: int, seed: int = 0) -> Any:
        """The kinds in turn, friction from 0.25 to 3 for each."""
        kind, step = divmod(number, STEPS)
        mu = 0.25 * (step + 1)
        make = getattr(self, KINDS[kind])
        return make(mu)

    def rod(self, mu: float) -> Any:
        """One contact: the lower end of a rod of 1 kg and 2 m, which slides at 1 m/s."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        # lever arm from the centre to the end, N = z, T = x: u_N = v_z + omega c, ...
        H = np.array([[0.0, 1.0], [1.0, 0.0], [-c, -s]])
        v = np.array([1.0, 0.02, 0.0])
        return self._problem(np.diag([1.0, 1.0, 1 / 3]), H, v, [mu], f"rod, mu = {mu:g}")

    def wedge(self, mu: float) -> Any:
        """Two contacts: a block of 1 kg between two faces, which it leaves downwards."""
        c, s = math.cos(self.slope), math.sin(self.slope)
        # normals from the faces into the block, tangents upwards
        H = np.array([[c, s, -c, -s], [-s, c, -s, c], [0.0, 0.1, 0.0, -0.1]])
        v = np.array([0.0, -0.05, 0.0])
        return self._problem(np.diag([1.0, 1.0, 0.01]), H, v, [mu, mu], f"wedge, mu = {mu:g}")

    def mass(self, mu: float) -> Any:
        """One contact: W is the inverse of a stiffness with coupling; pulled off, and along."""
        K = np.array([[1.0, self.coupling], [self.coupling, 1.0]])
        return self._problem(K, np.eye(2), np.array([0.05, -1.0]), [mu], f"mass, mu = {mu:g}")

    @staticmethod
    def _problem(M: Any, H: Any, v: Any, mu: list[float], title: str) -> Any:
        """M v' = H r + M v, in the plane."""
        return _core.GlobalProblem(
            M=M,
            H=H,
            f=M @ v,
            w=np.zeros(H.shape[1]),
            mu=np.array(mu),
            spacedim=2,
            info=_core.ProblemInfo(
                title=title, math_info="M v = H r + f, u = H^T v; components N, T"
            ),
        )
