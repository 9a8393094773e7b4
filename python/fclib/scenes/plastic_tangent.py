"""A block of soil that yields: one step of Newton's method, whose tangent is not symmetric."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from fclib.scenes.elastic_punch import clamped
from fclib.scenes.shared import mjcf
from fclib.scenes.shared.bricks import Block, Vector, of_moduli
from fclib.scenes.shared.family import parameter

SIZES: Final = (6, 8, 12)  # bricks along an edge
DILATANCIES: Final = (1.0, 0.5, 0.0, -0.5)  # over the internal friction; 1: associated
# how far the holder moves down and aside in the step, of `move`
MOVES: Final = ((1.0, 0.0), (0.5, 0.25), (0.2, 1.0))


@dataclass(frozen=True, kw_only=True)
class PlasticTangent:
    """A block of soil under its holder, on a rough plate: the first iteration of Newton's method.

    The stress is the same everywhere: a pressure and a shear on the surface of D. C. Drucker and W.
    Prager, F = sqrt(J2) + alpha I1 / 3. A band across the block yields, with the potential
    sqrt(J2) + beta I1 / 3; the rest is elastic. The tangent of what yields is

        C - (C : m) (n : C) / (n : C : m + hardening),   C : n = G s / sqrt(J2) + alpha K 1,

    and likewise C : m with beta. It is symmetric if and only if beta = alpha: real soil dilates
    less than its friction would have it. So M, a stiffness in N/m, is not symmetric, nor is
    W = H^T M^-1 H. v is the displacement of this iteration, in m, r are the forces on the plate
    after it, in N, f has what the stress before does not balance:

        M v = H r + f_ext - f_int - M d.

    Its hardening is above the bound from which on the symmetric part of the tangent is positive
    definite (J. Raniecki, O. T. Bruhns 1981): v M v > 0 for every v.

    Why it is here: methods that minimise, or that take W for symmetric, have no right to it.

    R. I. Borja, Plasticity: modeling and computation, Springer, 2013.
    B. Raniecki, O. T. Bruhns, Bounds to bifurcation stresses in solids with non-associated plastic
      flow law at finite strain, Journal of the Mechanics and Physics of Solids 29, 1981.
    """

    title: ClassVar[str] = "Plastic tangent"
    description: ClassVar[str] = "A block of yielding soil on a rough plate; M is not symmetric."
    application: ClassVar[str] = "geomechanics"
    authors: ClassVar[str] = "the authors of FCLIB, after R. I. Borja"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    collection: ClassVar[str] = "quasistatic"
    problems: ClassVar[int] = len(SIZES) * len(DILATANCIES) * len(MOVES)

    mu: float = parameter(0.4, "1", "coefficient of friction of the plate")
    edge: float = parameter(0.1, "m", "of the square face; the block is half as high")
    bulk: float = parameter(2e7, "Pa", "bulk modulus K")
    shear: float = parameter(1e7, "Pa", "shear modulus G")
    internal: float = parameter(0.9, "1", "alpha, of the internal friction")
    hardening: float = parameter(1.2, "1", "over the bound of a positive definite symmetric part")
    pressure: float = parameter(1e5, "Pa", "mean pressure of the soil")
    move: float = parameter(2e-4, "m", "of the holder, in the step")

    def __post_init__(self) -> None:
        mjcf.check(
            self,
            positive=("edge", "bulk", "shear", "internal", "hardening", "pressure"),
            non_negative=("mu", "move"),
        )

    def problem(self, number: int, seed: int = 0) -> Any:
        """By size, then dilatancy, then move; there is nothing that the seed could draw."""
        size, rest = divmod(number, len(DILATANCIES) * len(MOVES))
        dilatancy, move = divmod(rest, len(MOVES))
        return self.of_move(SIZES[size], DILATANCIES[dilatancy], MOVES[move])

    def stress(self) -> Vector:
        """The stress (3 x 3) of the soil, on the yield surface [Pa].

        A pressure and a shear that together press the plate down and aside.
        """
        root = self.internal * self.pressure  # sqrt(J2) = -alpha I1 / 3
        s = np.zeros((3, 3))
        # uniaxial and simple shear, J2 = (s : s) / 2 = a^2 + b^2, s_zz = -2 a / sqrt(3)
        a, b = 0.8 * root, 0.6 * root
        s[0, 0] = s[1, 1] = a / math.sqrt(3)
        s[2, 2] = -2 * a / math.sqrt(3)
        s[0, 2] = s[2, 0] = b
        return s - self.pressure * np.eye(3)

    def tangent(self, dilatancy: float) -> Vector:
        """C (3 x 3 x 3 x 3) of what yields; dilatancy: beta over alpha [Pa]."""
        alpha, beta = self.internal, dilatancy * self.internal
        K, G = self.bulk, self.shear
        stress = self.stress()
        s = stress + self.pressure * np.eye(3)
        root = math.sqrt(0.5 * math.fsum((s * s).ravel().tolist()))
        # C : n, C : m, and n : C : n and so on
        Cn = G * s / root + alpha * K * np.eye(3)
        Cm = G * s / root + beta * K * np.eye(3)
        mixed = G + K * alpha * beta
        # half of the difference to the geometric mean is where v C v loses its sign
        bound = 0.5 * (math.sqrt((G + K * alpha**2) * (G + K * beta**2)) - mixed)
        # associated plasticity has no bound to be above: it hardens by a share of G
        own = max(self.hardening * bound, 0.05 * G)
        elastic = of_moduli(K - 2 * G / 3, G)
        return elastic - Cm[:, :, None, None] * Cn[None, None] / (mixed + own)

    def of_move(self, bricks: int, dilatancy: float, move: tuple[float, float]) -> Any:
        """The problem of so many bricks along an edge (even), for a move down and aside."""
        block = Block((bricks, bricks, bricks // 2), (self.edge / bricks,) * 3)
        elastic = of_moduli(self.bulk - 2 * self.shear / 3, self.shear)
        # a band across the block, from its upper left edge to the plate on the right
        x, _, z = (
            part.ravel() for part in np.meshgrid(*map(np.arange, block.counts), indexing="ij")
        )
        yields = (np.abs(x - (bricks - 1 - 2 * z)) <= bricks // 3).astype(np.int64)
        K = block.stiffness([elastic, self.tangent(dilatancy)], yields)
        numbers = block.numbers()
        forces = np.zeros((numbers.size, 3))
        # sides carry the stress from outside: what is left of f_ext - f_int acts on the lower face
        share = np.ones(block.nodes[:2]) * (self.edge / bricks) ** 2
        share[[0, -1]] *= 0.5
        share[:, [0, -1]] *= 0.5
        forces[numbers[:, :, 0].ravel()] = share.ravel()[:, None] * self.stress()[2]
        down, aside = move
        holder = self.move * np.array([aside, 0.0, -down])
        nc = numbers[:, :, 0].size
        title = f"{nc} contacts, dilatancy {dilatancy:g}, {down:g} down, {aside:g} aside"
        return clamped(
            block,
            K,
            holder,
            forces.ravel(),
            np.zeros(3 * nc),
            self.mu,
            np.zeros(nc),
            title,
            {"dilatancy": dilatancy, "yielding": int(yields.sum())},
            "M is the tangent of Newton's method, and not symmetric unless the dilatancy is 1",
        )
