"""All contacts of a height field: MuJoCo keeps only the first 50 of a pair of geometries.

A body on more cells than that has contacts under only one of its edges, and falls. So such a pair
is treated again, window by window of the field. For a moment the field has only the rows and
columns of the window, and the window's centre. Its cells, hence its contacts, are those of the
field.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import numpy as np

from fclib._words import counted
from fclib.simulate._mujoco import mujoco

MOST: Final = int(mujoco.mjMAXCONPAIR)  # contacts of a pair that MuJoCo keeps
# cells along a side: each has two prisms with a contact each, in total below MOST
WINDOW: Final = 4
FIELD: Final = int(mujoco.mjtGeom.mjGEOM_HFIELD)


class CrowdedPairError(ValueError):
    """Two geometries have more contacts than MuJoCo keeps."""


def complete(m: Any, d: Any) -> None:
    """To be called after `mj_collision`: give crowded pairs with a height field all contacts.

    CrowdedPairError if another pair is crowded.
    """
    if d.ncon < MOST:
        return
    pairs, counts = np.unique(d.contact.geom, axis=0, return_counts=True)
    crowded = [(int(one), int(other)) for one, other in pairs[counts >= MOST]]
    if not crowded:
        return
    replace_contacts(m, d, {pair: contacts_of(m, d, *pair) for pair in crowded})


def replace_contacts(m: Any, d: Any, of_pair: dict[tuple[int, int], list[Any]]) -> None:
    """Replace the contacts of pairs of geometries."""
    contacts: list[Any] = []
    done = set()
    for contact, pair in zip(d.contact, d.contact.geom.tolist(), strict=True):
        key = (pair[0], pair[1])
        if key not in of_pair:
            contacts.append(copy.copy(contact))
        elif key not in done:
            contacts += of_pair[key]
            done.add(key)
    flags = m.opt.disableflags
    m.opt.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    try:
        mujoco.mj_collision(m, d)  # makes room; pairs that the scene names collide by no bits
    finally:
        m.opt.disableflags = flags
    if any(mujoco.mj_addContact(m, d, contact) for contact in contacts):
        raise MemoryError(
            f"no room for {counted(len(contacts), 'contact')}; raise"
            ' <size memory="..."/> in the MJCF'
        )


def contacts_of(m: Any, d: Any, field: int, other: int) -> list[Any]:
    """All contacts of two geometries, the first is a height field."""
    if m.geom_type[field] != FIELD:
        names = " and ".join(m.geom(g).name or f"geom {g}" for g in (field, other))
        raise CrowdedPairError(
            f"{names} have {MOST} contacts or more, of which MuJoCo keeps no others: make them of"
            " several geometries"
        )
    found: list[Any] = []
    with colliding(m, [field, other]):
        for window in windows(m, d, field, other):
            with window:
                mujoco.mj_collision(m, d)
            own = [c for c in d.contact if tuple(c.geom.tolist()) == (field, other)]
            if len(own) >= MOST:
                name = m.geom(field).name or f"geom {field}"
                raise CrowdedPairError(
                    f"{name}: {WINDOW} x {WINDOW} cells of the height field have {MOST} contacts"
                    " or more, of which MuJoCo keeps no others"
                )
            found += [copy.copy(contact) for contact in own]
    return found


@contextmanager
def colliding(m: Any, geoms: list[int]) -> Iterator[None]:
    """Inside the block no other geometries collide, but for pairs that the scene names."""
    kinds = m.geom_contype.copy(), m.geom_conaffinity.copy()
    for own, kept in zip((m.geom_contype, m.geom_conaffinity), kinds, strict=True):
        own[:] = 0
        own[geoms] = kept[geoms]
    try:
        yield
    finally:
        m.geom_contype[:], m.geom_conaffinity[:] = kinds


def windows(m: Any, d: Any, field: int, other: int) -> Iterator[Any]:
    """The windows of a field that are below a geometry, each to be entered."""
    number = int(m.geom_dataid[field])
    rows, columns = int(m.hfield_nrow[number]), int(m.hfield_ncol[number])
    turn = d.geom_xmat[field].reshape(3, 3)
    # the box of the geometry, in the frame of the field
    middle, half = m.geom_aabb[other].reshape(2, 3)
    local = turn.T @ d.geom_xmat[other].reshape(3, 3)
    centre = turn.T @ (d.geom_xpos[other] - d.geom_xpos[field]) + local @ middle
    reach = np.abs(local) @ half + margin_of(m, field, other)
    sides = m.hfield_size[number, :2]
    cells = np.array([columns, rows]) - 1
    edge = 2 * sides / cells
    low = np.clip(np.floor((centre - reach)[:2] / edge + cells / 2), 0, cells - 1).astype(int)
    high = np.clip(np.ceil((centre + reach)[:2] / edge + cells / 2), 1, cells).astype(int)
    for i in range(low[1], high[1], WINDOW):
        for j in range(low[0], high[0], WINDOW):
            ends = min(i + WINDOW, high[1]), min(j + WINDOW, high[0])
            yield window(m, d, field, (i, j), ends)


def margin_of(m: Any, one: int, other: int) -> float:
    """The distance [m] within which two geometries have contacts: a named pair's, or their own."""
    named = ((m.pair_geom1 == one) & (m.pair_geom2 == other)) | (
        (m.pair_geom1 == other) & (m.pair_geom2 == one)
    )
    if named.any():
        return float(m.pair_margin[named].max())
    return float(m.geom_margin[one] + m.geom_margin[other])


@contextmanager
def window(
    m: Any, d: Any, field: int, start: tuple[int, int], end: tuple[int, int]
) -> Iterator[None]:
    """Only the rows and columns of the field from `start` to `end`, both included."""
    number = int(m.geom_dataid[field])
    rows, columns = int(m.hfield_nrow[number]), int(m.hfield_ncol[number])
    first = int(m.hfield_adr[number])
    data = m.hfield_data[first : first + rows * columns]
    own = data.reshape(rows, columns)[start[0] : end[0] + 1, start[1] : end[1] + 1].copy()
    kept = data[: own.size].copy(), m.hfield_size[number].copy(), d.geom_xpos[field].copy()
    cells = np.array([columns, rows]) - 1
    edge = 2 * m.hfield_size[number, :2] / cells
    spans = np.array([end[1] - start[1], end[0] - start[0]])
    shift = edge * (np.array(start[::-1]) + spans / 2 - cells / 2)
    data[: own.size] = own.ravel()
    m.hfield_nrow[number], m.hfield_ncol[number] = own.shape
    m.hfield_size[number, :2] = edge * spans / 2
    d.geom_xpos[field] += d.geom_xmat[field].reshape(3, 3)[:, :2] @ shift
    try:
        yield
    finally:
        data[: own.size], m.hfield_size[number], d.geom_xpos[field] = kept
        m.hfield_nrow[number], m.hfield_ncol[number] = rows, columns
