"""An elastic block pressed on a rigid plane and sheared, quasi-statically: M is a stiffness."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fclib import _core
from fclib._geometry import KINDS, Bodies, Contacts
from fclib.scenes.shared import mjcf
from fclib.scenes.shared.bricks import Block, Vector, isotropic
from fclib.scenes.shared.family import parameter

KINDS_OF_FACE: Final = (("flat", 8), ("round", 8), ("round", 16))  # and bricks along an edge
PRESSING: Final = 4  # steps down, then steps aside, and back
ASIDE: Final = 6
BACK: Final = 6
STEPS: Final = PRESSING + ASIDE + BACK
FILE: Final = Path(__file__).with_name("elastic_punch.npz")
QUANTUM: Final = 2.0**-44  # of stored displacements [m]


@dataclass(frozen=True, kw_only=True)
class ElasticPunch:
    """A block of rubber, its upper face glued to a holder that goes down, aside, and back.

    There is no inertia. The unknown v is the displacement of the nodes since the block was free of
    stress, in m, M is their stiffness K, which is regular as the holder clamps the upper face, and
    r are forces in N:

        K v = H r - K_fc d,   u_N = gap + v_N,   u_T = v_T - v_T of the step before,

    where d is the displacement of the holder. So u_N is the gap, and u_T the slip of this step: w_N
    is the gap at rest, and w_T = -v_T of the step before, which is stored. Nothing else of the
    history counts.

    flat   the whole face touches. Its edges slip first
    round  a ball-shaped face, the contact of H. Hertz. As it is pushed aside, a ring slips from the
           edge inwards, while the middle sticks, until all of it slides (C. Cattaneo, R. D.
           Mindlin); on the way back slip begins anew at the edge

    Why it is here: M is no mass. W is full, has entries about a thousandth of r's units, and its
    contacts are coupled through the block.

    C. Cattaneo, Sul contatto di due corpi elastici: distribuzione locale degli sforzi, Rendiconti
      dell'Accademia nazionale dei Lincei 27, 1938.
    R. D. Mindlin, Compliance of elastic bodies in contact, Journal of Applied Mechanics 16, 1949.
    """

    title: ClassVar[str] = "Elastic punch"
    description: ClassVar[str] = "An elastic block is pressed on a plane and pushed aside and back."
    application: ClassVar[str] = "quasi-static contact of deformable solids, fretting"
    authors: ClassVar[str] = "the authors of FCLIB, after C. Cattaneo and R. D. Mindlin"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "quasistatic"
    problems: ClassVar[int] = len(KINDS_OF_FACE) * STEPS

    mu: float = parameter(0.4, "1", "coefficient of friction")
    edge: float = parameter(0.1, "m", "of the square face; the block is half as high")
    young: float = parameter(2e6, "Pa", "Young's modulus")
    poisson: float = parameter(0.45, "1", "Poisson's ratio")
    radius: float = parameter(0.5, "m", "of the round face")
    down: float = parameter(1.5e-3, "m", "how far the holder goes down")
    aside: float = parameter(1.5e-3, "m", "how far it goes aside")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("edge", "young", "radius", "down"),
            non_negative=("mu", "poisson", "aside"),
        )
        if not self.poisson < 0.5:
            raise ValueError(f"ElasticPunch: poisson must be < 0.5, not {self.poisson}")

    def problem(self, number: int, seed: int = 0) -> Any:
        """By face, then along the path; there is nothing that the seed could draw."""
        face, step = divmod(number, STEPS)
        kind, bricks = KINDS_OF_FACE[face]
        slipped = history()[face][step - 1] if step else np.zeros(((bricks + 1) ** 2, 2))
        return self.of_step(kind, bricks, step, slipped)

    def holder(self, step: int) -> tuple[float, float]:
        """How far the holder is aside and down at the end of a step [m]."""
        pressed = min(step + 1, PRESSING) / PRESSING
        along = step + 1 - PRESSING
        aside = min(max(along, 0), ASIDE) / ASIDE
        # back as far as to the other side
        back = 2 * max(along - ASIDE, 0) / BACK
        return (aside - back) * self.aside, pressed * self.down

    def of_step(self, kind: str, bricks: int, step: int, slipped: npt.NDArray[np.float64]) -> Any:
        """The problem of a step of the path.

        Args:
            kind: of the face, flat or round.
            bricks: along an edge, even.
            step: of the path.
            slipped: (nc x 2) displacements along x and y of the lower face at the step before [m].
        """
        aside, down = self.holder(step)
        block = Block((bricks, bricks, bricks // 2), (self.edge / bricks,) * 3)
        K = stiffness(block, isotropic(self.young, self.poisson))
        places = block.places()
        numbers = block.numbers()
        foot = numbers[:, :, 0].ravel()
        x, y = (places[foot] - 0.5 * self.edge).T[:2]
        gap = (x * x + y * y) / (2 * self.radius) if kind == "round" else np.zeros(len(foot))
        w = np.zeros(3 * len(foot))
        w[0::3], w[1::3], w[2::3] = gap, -slipped[:, 0], -slipped[:, 1]
        title = f"{kind}, {len(foot)} contacts, {1e3 * down:.3g} mm down, {1e3 * aside:.3g} aside"
        return clamped(
            block, K, np.array([aside, 0.0, -down]), np.zeros(K.shape[0]), w, self.mu, gap, title
        )


def clamped(
    block: Block,
    K: Any,
    holder: Vector,
    forces: Vector,
    w: Vector,
    mu: float,
    gap: Vector,
    title: str,
    facts: dict[str, Any] | None = None,
    word: str = "",
) -> Any:
    """A block whose upper face moves with a holder, and whose lower one touches the plane z = 0.

    Args:
        block: the block.
        K: (3 nodes x 3 nodes) its stiffness [N/m].
        holder: (3) displacement of the upper face [m].
        forces: (3 nodes) on the nodes [N].
        w: (3 nc).
        mu: coefficient of friction.
        gap: (nc) of the lower face, for the table of contacts [m].
        title: of the problem.
        facts: for its description.
        word: on its mathematics.
    """
    numbers = block.numbers()
    top = numbers[:, :, -1].ravel()
    foot = numbers[:, :, 0].ravel()
    held = (3 * top[:, None] + np.arange(3)).ravel()
    free = np.setdiff1d(np.arange(K.shape[0]), held)
    place = np.full(K.shape[0], -1)
    place[free] = np.arange(len(free))
    nc = len(foot)
    # N = z, T1 = x, T2 = y
    rows = place[(3 * foot[:, None] + (2, 0, 1)).ravel()]
    H = sp.csc_array((np.ones(3 * nc), (rows, np.arange(3 * nc))), shape=(len(free), 3 * nc))
    moved = np.tile(holder, len(top))
    points = block.places()[foot]
    contacts = Contacts(
        body=np.tile([0, 1], (nc, 1)).astype(np.int32),
        shape=np.tile([0, 1], (nc, 1)).astype(np.int32),
        feature=np.arange(nc, dtype=np.int32),
        point=points,
        normal=np.tile([0.0, 0.0, 1.0], (nc, 1)),
        tangent=np.tile([1.0, 0.0, 0.0], (nc, 1)),
        gap=gap,
    )
    return _core.GlobalProblem(
        M=sp.csc_array(K[:, free][free]),
        H=H,
        f=forces[free] - K[:, held][free] @ moved,
        w=w,
        mu=np.full(nc, mu),
        spacedim=3,
        info=_core.ProblemInfo(
            title=title,
            description=json.dumps({"quasi_static": True, **(facts or {})}),
            math_info="; ".join(
                part
                for part in (
                    "quasi-static: M is a stiffness in N/m, v and u are displacements in m, r are"
                    " forces in N; M v = H r + f, u = H^T v + w; components N, T1, T2",
                    word,
                )
                if part
            ),
        ),
        contacts=contacts,
        bodies=table(block, gap),
    )


def table(block: Block, gap: Vector) -> Bodies:
    """The plane, and the surface of the block as a mesh, its lower face raised by gaps (nc)."""
    upright = (1.0, 0.0, 0.0, 0.0)
    numbers = block.numbers()
    places = block.places()
    places[numbers[:, :, 0].ravel(), 2] += gap
    quads = []
    for axis in range(3):
        for end in (0, -1):
            face = np.take(numbers, end, axis=axis)
            around = (face[:-1, :-1], face[1:, :-1], face[1:, 1:], face[:-1, 1:])
            # counterclockwise from outside
            outwards = (end == 0) == (axis == 1)
            order = around if outwards else around[::-1]
            quads.append(np.stack([part.ravel() for part in order], axis=1))
    face = np.concatenate(quads)
    kept, corner = np.unique(face, return_inverse=True)
    face = corner.reshape(face.shape).astype(np.int32)
    return Bodies(
        name="plane\nblock",
        moves=np.array([0, 1], np.int32),
        place=np.zeros((2, 3)),
        turn=np.tile(upright, (2, 1)),
        shape_body=np.arange(2, dtype=np.int32),
        shape_kind=np.array([KINDS.index("plane"), KINDS.index("mesh")], np.int32),
        shape_size=np.zeros((2, 3)),
        shape_place=np.zeros((2, 3)),
        shape_turn=np.tile(upright, (2, 1)),
        shape_mesh=np.array([-1, 0], np.int32),
        mesh_first=np.array([[0, 0], [len(kept), len(face)]], np.int32),
        vertex=places[kept],
        face=face,
    )


def stiffness(block: Block, tangent: Vector) -> Any:
    """K of a block of one material."""
    return block.stiffness([tangent], np.zeros(int(np.prod(block.counts)), dtype=np.int64))


@functools.cache
def history() -> tuple[Vector, ...]:
    """Of each face the displacements along x and y (STEPS x nc x 2) at the end of each step [m]."""
    with np.load(FILE) as arrays:
        return tuple(
            QUANTUM * arrays[f"slipped{face}"].astype(float) for face in range(len(KINDS_OF_FACE))
        )
