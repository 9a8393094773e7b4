"""Decks of LMGC90, written as LMGC90 writes them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
# of a box whose corners are in this order, outwards
FACES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
FACES += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
PAD = " " * 29
ABC = ("alp", "bet", "gam")  # LMGC90's names of the axes of a PLANx
STILL = [
    f" vlocy  {k:5d}" + "  0.0000000D+00" * 4 + "  0.1000000D+01  0.0000000D+00"
    for k in range(1, 7)
]


def fortran(value: float) -> str:
    """A number as Fortran writes it, but to the last digit."""
    return f"{value:.16e}".replace("e", "D")


def row(names: Sequence[str], values: Any) -> str:
    """Entries of a line."""
    return "  ".join(f"{n}={fortran(v)}" for n, v in zip(names, values, strict=True))


def three(name: str) -> list[str]:
    return [f"{name}{k}" for k in (1, 2, 3)]


def polyhedron(vertices: Any, faces: Any = FACES, colour: str = "BLEUx") -> str:
    """A contactor POLYR."""
    lines = [
        f" POLYR      1  color  {colour}  nb_vertex={len(vertices):7d}    nb_faces={len(faces):7d}"
    ]
    lines += [PAD + row(three("coo"), vertex) for vertex in vertices]
    lines += [
        PAD + "  ".join(f"ver{k}={corner + 1:7d}" for k, corner in enumerate(face, 1))
        for face in faces
    ]
    return "\n".join(lines)


def block(half: Any, turn: Any = None, colour: str = "BLEUx") -> str:
    """A box as a polyhedron."""
    corners = CORNERS * half
    return polyhedron(corners if turn is None else corners @ np.asarray(turn).T, colour=colour)


def ball(radius: float, colour: str = "BLEUx") -> str:
    """A contactor SPHER."""
    return f" SPHER      1  color  {colour}  byrd={fortran(radius)}"


def plate(half: Any, colour: str = "VERTx", turn: Any = None, shift: Any = (0, 0, 0)) -> str:
    """A contactor PLANx, with its axes (columns) and its place in the body if it is turned."""
    line = f" PLANx      1  color  {colour}  {row(three('axe'), half)}"
    if turn is None:
        return line
    axes = [
        PAD + row(three(name), column) for name, column in zip(ABC, np.transpose(turn), strict=True)
    ]
    return "\n".join([line, f"{PAD}localframe", *axes, PAD + row(three("coo"), shift)])


def body(number: int, place: Any, *contactors: str, material: str = "STONE", bulk: str = "") -> str:
    """A rigid body; without `bulk` its mass follows from its contactors."""
    zeros = PAD + row(("I1", "I2", "I3"), (0, 0, 0))
    bulk = bulk or f"avrd= 0.0000000D+00  gyrd= 0.0000000D+00\n{zeros}"
    return "\n".join(
        [
            "$bdyty",
            f" RBDY3  {number:5d}",
            "$blmty",
            f" PLAIN      1  behav  {material}  {bulk}",
            "$nodty",
            f" NO6xx      1                {row(three('coo'), place)}",
            PAD + row(("coo4", "coo5", "coo6"), (0, 0, 0)),
            "$tacty",
            *contactors,
            "$$$$$$",
        ]
    )


def driven(number: int, *rows: str, kind: str = "RBDY3", node: int = 1) -> str:
    """Given velocities and forces of a body."""
    return "\n".join(
        [
            "$bdyty",
            f" {kind}  {number:5d}",
            "$nodty",
            f" {'NO6xx' if kind == 'RBDY3' else 'NO3xx'}  {node:5d}",
            "$dofty  numbr [CT......+......AMP..*..cos.(..OMEGA.*.time.+.PHI..)]..*..[RAMPI+RAMP]",
            *rows,
            "$$$$$$",
        ]
    )


def start(number: int, displacement: Any, velocity: Any, axes: Any = None) -> str:
    """The start of a rigid body; the columns of `axes` are a, b and c."""
    x = np.concatenate((displacement, np.zeros(3)))
    axes = np.eye(3) if axes is None else np.asarray(axes)
    lines = [f" NO6xx      1                {row([f'X({k})' for k in (1, 2, 3)], x[:3])}"]
    lines.append(PAD + row([f"X({k})" for k in (4, 5, 6)], x[3:]))
    lines += [
        PAD + row([f"V({k})" for k in range(i, i + 3)], velocity[i - 1 : i + 2]) for i in (1, 4)
    ]
    lines += [
        PAD + row([f"{name}({k})" for k in (1, 2, 3)], axes[:, i]) for i, name in enumerate("abc")
    ]
    return "\n".join(["$bdyty", f" RBDY3  {number:5d}", "$nodty", *lines, "$$$$$$"])


def law(name: str, kind: str = "IQS_CLB", mu: float = 0.5) -> str:
    return f"$behav  lawty\n {name}  {kind:<30}  fric={fortran(mu)}"


def see(
    first: str = "RBDY3  POLYR  BLEUx",
    second: str = "RBDY3  POLYR  BLEUx",
    law: str = "iqsc0",
    alert: float = 1e-2,
) -> str:
    return (
        "$seety\n cdbdy  cdtac  cdcol  behav  anbdy  antac  ancol       alert\n"
        f" {first}  {law}  {second}       {fortran(alert)}"
    )


def bulk(density: float = 2000.0, gravity: float = 9.81, more: str = "") -> str:
    return (
        f"! File BEHAVIOUR\n\n$gravy\n  {row(('grv1', 'grv2', 'grv3'), (0, 0, -gravity))}\n"
        f"$behav  lawty\n STONE  RIGID                           Umas={fortran(density)}\n{more}"
    )


def write(folder: Path, **files: str) -> Path:
    """A deck of these files: BODIES, BULK_BEHAV, TACT_BEHAV, DRV_DOF, MODELS (.DAT), DOF (.INI)."""
    datbox = folder / "DATBOX"
    datbox.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        suffix = ".INI" if name in ("DOF", "Vloc_Rloc") else ".DAT"
        (datbox / f"{name}{suffix}").write_text(text + "\n", encoding="latin-1")
    return datbox


def blocks(folder: Path, *, gap: float = 0.0, mu: float = 0.5, **more: str) -> Path:
    """Two stacked blocks on a fixed one, turned a little against each other."""
    c, s = np.cos(0.1), np.sin(0.1)
    turn = np.array([(c, -s, 0), (s, c, 0), (0, 0, 1)])
    files = {
        "BODIES": "\n".join(
            [
                body(1, (0, 0, -0.25), block((2, 2, 0.25))),
                body(2, (0, 0, 0.2 + gap), block((0.5, 0.3, 0.2), turn)),
                body(3, (0.1, 0.05, 0.7 + gap), block((0.3, 0.25, 0.3))),
            ]
        ),
        "BULK_BEHAV": bulk(),
        "TACT_BEHAV": f"{law('iqsc0', mu=mu)}\n{see()}",
        "DRV_DOF": driven(1, *STILL),
    }
    return write(folder, **(files | more))


def hexahedra(
    number: int, elements: int, place: Any, patches: Sequence[str], edge: float = 1.0
) -> str:
    """A cube MAILx of elements H8."""
    k = elements + 1
    axis = np.linspace(0, edge, k)
    nodes = [(x, y, z) for z in axis for y in axis for x in axis]

    def node(i: int, j: int, m: int) -> int:
        return 1 + i + k * j + k * k * m

    lines = ["$bdyty", f" MAILx  {number:5d}", "$blmty"]
    rings = [(0, 0), (1, 0), (1, 1), (0, 1)]
    count = 0
    for m in range(elements):
        for j in range(elements):
            for i in range(elements):
                count += 1
                own = [node(i + a, j + b, m + c) for c in (0, 1) for a, b in rings]
                lines.append(f" H8xxx  {count:5d}  nodes" + "".join(f"{n:7d}" for n in own))
                lines.append("               model  M3DH8  behav  stone")
    lines.append("$nodty")
    for i, x in enumerate(nodes, 1):
        lines.append(f" NO3xx  {i:5d}                {row(three('coo'), np.add(x, place))}")
    lines.append("$tacty")
    for patch in patches:
        top = patch == "ASpx4"
        for j in range(elements):
            for i in range(elements):
                ring = rings if top else rings[::-1]
                own = [node(i + a, j + b, elements if top else 0) for a, b in ring]
                plus = " " if i == j == 0 else "+"
                lines.append(
                    f"{plus}{patch}      1  color  BLEUx"
                    + "".join(f"  nod{c}={n:5d}" for c, n in zip("abcd", own, strict=True))
                )
    return "\n".join([*lines, "$$$$$$"])


MODELS = """\
$model  mdlty  finel  eleop  value
 M3DH8
        MECAx  H8xxx  mstrg  lump_
                      kine_  small
                      isext  yes__
                      aniso  iso__
                      mater  elas_
"""
ELASTIC = """\
$behav  lawty
 stone  ELAS                            Umas= 2.7500000e+03
                                        elas: standard
                                        ani_: isotropic
                                        EYng= 7.0000000e+10  Epss= 2.0000000e-01
"""


def cubes(folder: Path, elements: int = 2, law_kind: str = "GAP_SGR_CLB", **more: str) -> Path:
    """An elastic cube on another, which is held at its foot."""
    foot = [driven(1, *STILL[:3], kind="MAILx", node=i + 1) for i in range((elements + 1) ** 2)]
    files = {
        "BODIES": hexahedra(1, elements, (0, 0, 0), ["ASpx4"])
        + "\n"
        + hexahedra(2, elements, (0, 0, 1), ["CSpx4"]),
        "BULK_BEHAV": bulk(more=ELASTIC),
        "TACT_BEHAV": law("gapc0", law_kind, 0.3)
        + "\n"
        + see("MAILx  CSxxx  BLEUx", "MAILx  ASpxx  BLEUx", "gapc0", 0.1)
        + "\n+                                                      5.0000000e-01",
        "DRV_DOF": "\n".join(foot),
        "MODELS": MODELS,
    }
    return write(folder, **(files | more))
