"""A low wall of elastic blocks, sheared by a heavy plate of steel, after a deck of LMGC90."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from fclib.scenes.shared import mjcf
from fclib.scenes.shared.family import Scene, parameter
from fclib.scenes.shared.hex_box import HexBox
from fclib.scenes.shared.interaction import Course, Drive, Interaction
from fclib.scenes.shared.solids import HexMesh, Solids, Surface

# kinds of surfaces: lower faces of blocks and what they lie on; left ends and the right ends that
# they meet; nodes that meet floor and plate; floor and plate
LOWER, UPPER, LEFT, RIGHT, OUTER, STEEL = range(6)


@dataclass(frozen=True, kw_only=True)
class ElasticLowWall:
    """Blocks of stone in running bond stand on a rigid floor; a plate of steel lies on them.

    The blocks have no weight. The weight of the plate grows while the plate stands still. Then the
    plate moves along the wall, and the wall slides in its joints.

    After the deck LowWall of V. Acary and the developers of LMGC90: elements, lumped masses,
    materials, both coefficients of friction, law GAP_SGR_CLB, alert distances, the plate's density
    and motion, no gravity, step and theta. The geometry of the deck is not public, and nothing in
    the deck says what presses the wall. Chosen here: all sizes and meshes; open head joints; that
    the driven body lies on the wall and that its weight presses it; that it is one stiff element
    whose nodes all have the given velocity along x.
    """

    title: ClassVar[str] = "Low wall under a plate of steel"
    description: ClassVar[str] = (
        "A heavy plate shears a low wall of 8-node hexahedra, after the LMGC90 deck LowWall."
    )
    application: ClassVar[str] = "masonry, deformable solids"
    authors: ClassVar[str] = (
        "V. Acary, the developers of LMGC90; the geometry and the load are chosen here"
    )
    friction: ClassVar[str] = "Coulomb, one coefficient between blocks, one on floor and plate"
    collection: ClassVar[str] = "decks"
    problems: ClassVar[int] = 500
    allowance: ClassVar[bool] = False  # the law of gaps has none

    courses: int = parameter(5, "1", "number of courses, at least 1")
    length: int = parameter(8, "1", "blocks of a course, at least 1")
    block: float = parameter(0.4, "m", "length of a block")
    height: float = parameter(0.2, "m", "height of a block")
    depth: float = parameter(0.2, "m", "depth of a block")
    elements: int = parameter(2, "1", "elements along depth, and along half the length, at least 1")
    layers: int = parameter(3, "1", "elements along height, at least 1")
    joint: float = parameter(2e-3, "m", "width of a head joint at the start")
    young: float = parameter(2.2e9, "Pa", "Young's modulus of the blocks")
    poisson: float = parameter(0.2, "1", "Poisson's ratio, of blocks and plate")
    density: float = parameter(2000.0, "kg/m^3", "mass density of the blocks")
    plate: float = parameter(0.1, "m", "thickness of the plate, and of the floor")
    margin: float = parameter(0.01, "m", "the plate and the floor stand out so far on all sides")
    plate_young: float = parameter(2.1e11, "Pa", "Young's modulus of the plate")
    plate_density: float = parameter(148146.0, "kg/m^3", "mass density of the plate")
    mu: float = parameter(0.53, "1", "coefficient of friction between blocks")
    mu_plate: float = parameter(0.83, "1", "coefficient of friction on the floor and the plate")
    alert: float = parameter(1e-3, "m", "alert distance between blocks")
    alert_plate: float = parameter(1e-2, "m", "alert distance to the floor and the plate")
    restitution: float = parameter(0.0, "1", "0: the law GAP_SGR_CLB is inelastic")
    gravity: float = parameter(9.81, "m/s^2", "weight of the plate by its mass; blocks have none")
    still: float = parameter(0.021, "s", "how long the plate stands still, and its weight grows")
    rise: float = parameter(0.019, "s", "how long the plate's speed grows then")
    speed: float = parameter(1e-3, "m/s", "speed of the plate along -x in the end")
    theta: float = parameter(0.5, "1", "theta of the scheme, in [1/2, 1]")
    time_step: float = parameter(1e-3, "s", "time step h")

    # of a scene of this kind that is quickly simulated
    small: ClassVar[Mapping[str, Any]] = {"courses": 2, "length": 2}

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=(
                *("block", "height", "depth", "young", "density", "plate", "plate_young"),
                *("plate_density", "still", "rise", "time_step"),
            ),
            non_negative=("mu", "mu_plate", "alert", "alert_plate", "joint", "margin"),
            at_least={"courses": 1, "length": 1, "elements": 1, "layers": 1},
        )
        if self.restitution:
            raise ValueError(f"ElasticLowWall: restitution must be 0, not {self.restitution}")
        if not self.joint < 0.5 * self.block:
            raise ValueError("ElasticLowWall: joint must be less than half of block")

    def scene(self, seed: int = 0) -> Scene:
        """The scene; nothing of it is random."""
        meshes = [mesh for course in range(self.courses) for mesh in self._course(course)]
        first = 3 * sum(len(mesh.nodes) for mesh in meshes)
        lid, floor = self._slab(self.courses * self.height), self._slab(-self.plate)
        meshes += [self._steel(lid, top=True), self._steel(floor, top=False)]
        nodes = len(lid.nodes)
        return Scene.of(
            self,
            seed,
            solids=Solids(
                blocks=(),
                meshes=tuple(meshes),
                mu=self.mu,
                reach=max(self.alert, self.alert_plate),
                gravity=0.0,
            ),
            interactions=tuple(
                Interaction(kinds=kinds, mu=mu, alert=alert, law="GAP_SGR_CLB")
                for kinds, mu, alert in (
                    ((LOWER, UPPER), self.mu, self.alert),
                    ((LEFT, RIGHT), self.mu, self.alert),
                    ((OUTER, STEEL), self.mu_plate, self.alert_plate),
                )
            ),
            drives=(
                *self._drives(lid, first),
                *(
                    Drive(dof=first + 3 * nodes + i, velocity=True, course=Course())
                    for i in range(3 * nodes)
                ),
            ),
            law="gap",
            theta=self.theta,
            view=(105.0, -12.0),
        )

    def _course(self, course: int) -> Iterator[HexMesh]:
        """The blocks of a course from left to right; every second one ends in half blocks."""
        halves = [2] * self.length if course % 2 == 0 else [1, *[2] * (self.length - 1), 1]
        x = -0.5 * self.length * self.block
        for count in halves:
            size = 0.5 * count * self.block
            box = HexBox(
                low=(x + 0.5 * self.joint, -0.5 * self.depth, course * self.height),
                size=(size - self.joint, self.depth, self.height),
                elements=(count * self.elements, self.elements, self.layers),
            )
            lowest, highest = course == 0, course == self.courses - 1
            yield box.mesh(
                young=self.young,
                poisson=self.poisson,
                density=self.density,
                surfaces=(
                    Surface(kind=LEFT, candidate=True, quads=box.quads("x-")),
                    Surface(kind=RIGHT, candidate=False, quads=box.quads("x+")),
                    Surface(kind=OUTER if lowest else LOWER, candidate=True, quads=box.quads("z-")),
                    Surface(
                        kind=OUTER if highest else UPPER, candidate=highest, quads=box.quads("z+")
                    ),
                ),
            )
            x += size

    def _slab(self, z: float) -> HexBox:
        """One element as long and as deep as the wall, and a margin, from some height on."""
        length, depth = self.length * self.block + 2 * self.margin, self.depth + 2 * self.margin
        return HexBox(
            low=(-0.5 * length, -0.5 * depth, z),
            size=(length, depth, self.plate),
            elements=(1, 1, 1),
        )

    def _steel(self, box: HexBox, *, top: bool) -> HexMesh:
        """The plate on the wall, or the floor, which is held anyway."""
        return box.mesh(
            young=self.plate_young,
            poisson=self.poisson,
            density=self.plate_density,
            surfaces=(
                Surface(kind=STEEL, candidate=False, quads=box.quads("z-" if top else "z+")),
            ),
        )

    def _drives(self, lid: HexBox, first: int) -> Iterator[Drive]:
        """The plate's velocity along x, and its weight, each node's share."""
        moves = Course(
            points=(
                (0.0, 0.0),
                (self.still, 0.0),
                (self.still + self.rise, -self.speed),
                (self.still + self.rise + 1.0, -self.speed),
            )
        )
        x, y, z = lid.size
        weight = self.plate_density * x * y * z * self.gravity / len(lid.nodes)
        grows = Course(constant=-weight, ramp=0.0, ramp_rate=1.0 / self.still)
        for node in range(len(lid.nodes)):
            yield Drive(dof=first + 3 * node, velocity=True, course=moves)
            yield Drive(dof=first + 3 * node + 2, velocity=False, course=grows)
