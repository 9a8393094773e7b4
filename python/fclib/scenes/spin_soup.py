"""The soup of primitives whose contacts resist spin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fclib.scenes.primitive_soup import PrimitiveSoup
from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import parameter


@dataclass(frozen=True, kw_only=True)
class SpinSoup(PrimitiveSoup):
    """Boxes, cylinders, capsules and ellipsoids that fall into a box, with spin friction.

    The scene of PrimitiveSoup, smaller. A contact has four components: N, T1, T2 and the spin
    moment S. Sliding and spin share one ellipsoid, as in the patch of two soft bodies. A patch of
    radius a under the pressure of Hertz bears at most (3 pi / 16) mu a r_N, if all of it slides
    (K. L. Johnson, Contact Mechanics, 1985, chapter 7). So mu_s = 0.04 m with mu = 0.7 is one of
    a = 0.1 m.
    """

    title: ClassVar[str] = "Soup of primitives with spin friction"
    description: ClassVar[str] = (
        "Boxes, cylinders, capsules and ellipsoids dropped into an open box, with spin friction."
    )
    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb and spin in one ellipsoid, the same everywhere"
    collection: ClassVar[str] = "spin"
    problems: ClassVar[int] = 200

    bodies: int = parameter(60, "1", "number of bodies, at least 1")
    width: float = parameter(6.4, "m", "inner edge of the box, a square")
    mu_s: float = parameter(0.04, "m", "coefficient of spin friction")

    def __post_init__(self) -> None:
        super().__post_init__()
        mjcf.check(self, non_negative=("mu_s",))

    def _surface(self) -> str:
        return mjcf.surface(self.mu, mu_s=self.mu_s)
