"""The soup of primitives with rolling friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fclib.scenes.primitive_soup import PrimitiveSoup
from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import parameter


@dataclass(frozen=True, kw_only=True)
class RollingSoup(PrimitiveSoup):
    """Boxes, cylinders, capsules and ellipsoids that fall into a box, with rolling friction.

    The scene of PrimitiveSoup, smaller. A contact has five components: N, T1, T2 and the rolling
    moments R1 and R2.

    After the set PrimitiveSoup of the FCLIB library's global rolling problems by V. Acary: 1000
    bodies, mu = 0.7, mu_r = 0.1.
    """

    title: ClassVar[str] = "Soup of primitives with rolling friction"
    description: ClassVar[str] = (
        "Boxes, cylinders, capsules and ellipsoids dropped into an open box, with rolling friction."
    )
    friction: ClassVar[str] = "Coulomb and rolling, the same coefficients everywhere"
    collection: ClassVar[str] = "rolling"
    problems: ClassVar[int] = 200

    bodies: int = parameter(60, "1", "number of bodies, at least 1")
    width: float = parameter(6.4, "m", "inner edge of the box, a square")
    mu_r: float = parameter(0.1, "m", "coefficient of rolling friction")

    def __post_init__(self) -> None:
        super().__post_init__()
        mjcf.check(self, non_negative=("mu_r",))

    def _surface(self) -> str:
        return mjcf.surface(self.mu, self.mu_r)
