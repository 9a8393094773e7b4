"""The chute with rolling friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fclib.scenes.chute import Chute
from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import parameter


@dataclass(frozen=True, kw_only=True)
class RollingChute(Chute):
    """Polyhedra and spheres that flow down a chute and pile up, with rolling friction.

    The scene of Chute, smaller. A contact has five components: N, T1, T2 and the rolling moments
    R1 and R2.

    After the set Chute of the FCLIB library's global rolling problems by V. Acary: 6400 polyhedra,
    mu = 1, mu_r = 0.1, of a size of 0.1.
    """

    title: ClassVar[str] = "Chute with rolling friction"
    description: ClassVar[str] = (
        "Polyhedra and spheres that flow down a chute and pile up below, with rolling friction."
    )
    authors: ClassVar[str] = "V. Acary"
    friction: ClassVar[str] = "Coulomb and rolling, the same coefficients everywhere"
    collection: ClassVar[str] = "rolling"
    problems: ClassVar[int] = 230

    grains: int = parameter(120, "1", "number of grains, at least 1")
    across: int = parameter(4, "1", "grains of the bed from wall to wall, at least 1")
    mu_r: float = parameter(0.02, "m", "coefficient of rolling friction")

    def __post_init__(self) -> None:
        super().__post_init__()
        mjcf.check(self, non_negative=("mu_r",))

    def _surface(self) -> str:
        return mjcf.surface(self.mu, self.mu_r)
