"""Odd files, made from a seed: shapes, types and layouts of other writers, and things amiss.

    python tests/odd_files.py FOLDER         makes them

Each is a good file with one thing changed. A change is a function of this module that takes the
open file and the name of its problem's group.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.sparse as sp

import fclib
from helpers import planted_global, planted_local

SEED = 20261126
Change = Callable[[h5py.File, str], None]

INTEGERS = ("nzmax", "m", "n", "nz", "p", "i")
NUMBERS = ("q", "mu", "s", "f", "w", "b")


def datasets(file: h5py.File, root: str) -> list[str]:
    """All datasets of numbers of the problem."""
    found: list[str] = []
    file[root].visititems(
        lambda name, item: (
            found.append(f"{root}/{name}")
            if isinstance(item, h5py.Dataset) and not name.startswith("info/")
            else None
        )
    )
    return found


def is_integer(name: str) -> bool:
    return name.rsplit("/", 1)[-1] in (*INTEGERS, "spacedim")


def put(file: h5py.File, name: str, values: Any, **layout: Any) -> None:
    """Another dataset in the place of this one."""
    if name in file:
        del file[name]
    file.create_dataset(name, data=values, **layout)


def each(pick: Callable[[str], bool], make: Callable[[Any], Any], **layout: Any) -> Change:
    """The chosen datasets with other values, shapes or types."""

    def change(file: h5py.File, root: str) -> None:
        for name in datasets(file, root):
            values = file[name][()]
            if pick(name) and not (layout and values.size < 2):
                put(file, name, make(values), **layout)

    return change


def every(_: str) -> bool:
    return True


def real(name: str) -> bool:
    return not is_integer(name)


def vector(name: str) -> bool:
    return name.rsplit("/", 1)[-1] in (*NUMBERS, "p", "i", "x")


def single(name: str) -> bool:
    return name.rsplit("/", 1)[-1] in ("spacedim", "nzmax", "m", "n", "nz")


def same(values: Any) -> Any:
    return values


def in_words(**texts: Any) -> Change:
    """Other texts of info."""

    def change(file: h5py.File, root: str) -> None:
        for name, value in texts.items():
            put(file, f"{root}/info/{name}", value)

    return change


def without(*names: str) -> Change:
    def change(file: h5py.File, root: str) -> None:
        for name in names:
            for one in (root, *(f"{root}/{a}" for a in "WMHGVR")):
                if f"{one}/{name}" in file:
                    del file[f"{one}/{name}"]

    return change


def main_matrix(root: str) -> str:
    return f"{root}/W" if "local" in root else f"{root}/M"


def main_vector(root: str) -> str:
    return f"{root}/vectors/q" if "local" in root else f"{root}/vectors/f"


def of_matrix(name: str, make: Callable[[Any], Any], **layout: Any) -> Change:
    """One dataset of the main matrix."""

    def change(file: h5py.File, root: str) -> None:
        path = f"{main_matrix(root)}/{name}"
        put(file, path, make(file[path][()]), **layout)

    return change


def of_vector(make: Callable[[Any], Any], **layout: Any) -> Change:
    def change(file: h5py.File, root: str) -> None:
        put(file, main_vector(root), make(file[main_vector(root)][()]), **layout)

    return change


def of_spacedim(make: Callable[[Any], Any]) -> Change:
    def change(file: h5py.File, root: str) -> None:
        put(file, f"{root}/spacedim", make(file[f"{root}/spacedim"][()]))

    return change


def a_row_a_contact(file: h5py.File, root: str) -> None:
    name = f"{root}/vectors/{'q' if 'local' in root else 'w'}"
    put(file, name, file[name][()].reshape(-1, int(file[f"{root}/spacedim"][0])))


def longer(values: Any) -> Any:
    return np.append(values, np.ones(3, values.dtype))


def room(file: h5py.File, root: str) -> None:
    """As CSparse keeps it: more places than entries."""
    group = file[main_matrix(root)]
    for name in ("i", "x") if group["nz"][0] < 0 else ("p", "i", "x"):
        put(file, f"{group.name}/{name}", longer(group[name][()]))
    group["nzmax"][0] += 3


def knowledge(**values: Any) -> Change:
    def change(file: h5py.File, root: str) -> None:
        for name, value in values.items():
            put(file, f"{main_matrix(root)}/{name}", value)

    return change


def attribute(name: str, value: Any) -> Change:
    def change(file: h5py.File, root: str) -> None:
        file[main_matrix(root)].attrs[name] = value

    return change


def rewrite(group: h5py.Group, make: Callable[[Any], Any]) -> None:
    """The matrix of a group as another one: csc_array or coo_array."""
    shape = int(group["m"][0]), int(group["n"][0])
    nz = int(group["nz"][0])
    p, i, x = (group[name][()] for name in ("p", "i", "x"))
    if nz < 0:
        a = make((sp.csc_array if nz == -1 else sp.csr_array)((x, i, p), shape=shape))
    else:
        a = make(sp.coo_array((x, (i, p)), shape=shape))
    p, i = (a.col, a.row) if a.format == "coo" else (a.indptr, a.indices)
    counts = {"nz": [-1 if a.format == "csc" else a.nnz], "nzmax": [a.nnz]}
    for name, values in {"p": p, "i": i, **counts}.items():
        put(group.file, f"{group.name}/{name}", np.array(values, "<i4"))
    put(group.file, f"{group.name}/x", a.data)


def half_a_triangle(file: h5py.File, root: str) -> None:
    """The lower triangle of a symmetric matrix alone, and the attribute that says so."""
    group = file[main_matrix(root)]
    rewrite(group, lambda a: sp.csc_array(sp.tril(a)))
    group.attrs["symmetric_packed"] = 1


def zero_pointers(file: h5py.File, root: str) -> None:
    group = file[main_matrix(root)]
    rewrite(group, sp.csc_array)
    group["p"][:] = 0


def no_triplets(file: h5py.File, root: str) -> None:
    group = file[main_matrix(root)]
    rewrite(group, sp.coo_array)
    group["nz"][0] = 0


def never_written(name: str, **layout: Any) -> Change:
    def change(file: h5py.File, root: str) -> None:
        path = main_vector(root) if name == "vector" else f"{main_matrix(root)}/{name}"
        shape, dtype = file[path].shape, file[path].dtype
        del file[path]
        file.create_dataset(path, shape=shape, dtype=dtype, **layout)

    return change


def half_written(file: h5py.File, root: str) -> None:
    path = f"{main_matrix(root)}/x"
    values = file[path][()]
    del file[path]
    target = file.create_dataset(path, shape=values.shape, dtype=values.dtype, chunks=(4,))
    target[: values.size // 2] = values[: values.size // 2]


def link(kind: str) -> Change:
    """The main matrix by a link."""

    def change(file: h5py.File, root: str) -> None:
        file.move(main_matrix(root), "/elsewhere")
        targets = {
            "soft": h5py.SoftLink("/elsewhere"),
            "hard": file["/elsewhere"],
            "dangling": h5py.SoftLink("/nowhere"),
            "external": h5py.ExternalLink("nowhere.hdf5", "/elsewhere"),
        }
        file[main_matrix(root)] = targets[kind]

    return change


def strangers(file: h5py.File, root: str) -> None:
    """What no reader knows."""
    file.create_dataset("other/data", data=np.arange(5))
    file.attrs["note"] = "x"
    file[root].attrs["note"] = 3.0
    file[f"{root}/vectors"].create_dataset("extra", data=[1.0])
    file[main_matrix(root)].create_group("info")


CHANGES: dict[str, Change] = {
    "as it is": lambda file, root: None,
    # shapes
    "rows": each(vector, lambda x: x.reshape(1, -1)),
    "columns": each(vector, lambda x: x.reshape(-1, 1)),
    "numbers 1 x 1": each(single, lambda x: x.reshape(1, 1)),
    "all of two dimensions": each(every, lambda x: x.reshape(1, -1)),
    "three dimensions": each(every, lambda x: x.reshape(1, -1, 1)),
    "scalars": each(single, lambda x: x[0]),
    "a row a contact": a_row_a_contact,
    "unlimited": each(vector, same, maxshape=(None,), chunks=(2,)),
    # types
    "integers as doubles": each(is_integer, lambda x: x.astype("<f8")),
    "all as doubles in rows": each(every, lambda x: x.astype("<f8").reshape(1, -1)),
    "integers as floats": each(is_integer, lambda x: x.astype("<f4")),
    "integers of 64 bits": each(is_integer, lambda x: x.astype("<i8")),
    "integers of 16 bits": each(is_integer, lambda x: x.astype("<i2")),
    "integers of the other order": each(is_integer, lambda x: x.astype(">i4")),
    "doubles of the other order": each(real, lambda x: x.astype(">f8")),
    "floats": each(real, lambda x: x.astype("<f4")),
    "halves": each(real, lambda x: x.astype("<f2")),
    "long doubles": each(real, lambda x: x.astype(np.longdouble)),
    "numbers as integers": of_vector(lambda x: np.arange(x.size, dtype="<i4")),
    "truth values": of_vector(lambda x: x > 0),
    "no integers": of_matrix("i", lambda x: x + 0.25),
    "integers beyond 32 bits": of_matrix("i", lambda x: x.astype("<i8") + 2**40),
    "complex numbers": of_vector(lambda x: x * 1j),
    # layouts
    "chunks": each(vector, same, chunks=(2,)),
    "deflate": each(vector, same, chunks=(2,), compression="gzip"),
    "shuffle and deflate": each(vector, same, chunks=(2,), compression="gzip", shuffle=True),
    "checksums": each(vector, same, chunks=(2,), fletcher32=True),
    "scale-offset": of_matrix("i", same, chunks=(2,), scaleoffset=0),
    # words
    "no info": without("info"),
    "title alone": without("info/description", "info/math_info"),
    "texts of variable length": in_words(title="of any length", description="d"),
    "texts without NUL": in_words(title=np.bytes_("title")),
    "texts in a row": in_words(title=np.array([[b"title"]], "S6")),
    "an empty text": in_words(title=""),
    "bytes": in_words(title=np.frombuffer(b"bytes as numbers", "u1")),
    "bytes in a row": in_words(title=np.frombuffer(b"bytes", "i1").reshape(1, -1)),
    "several texts": in_words(title=np.array([b"a", b"b", b"c"])),
    "several texts of any length": in_words(
        title=np.array(["a", "b"], dtype=h5py.string_dtype()), math_info="m"
    ),
    "numbers as a title": in_words(title=[1.0, 2.0]),
    "nothing as a title": in_words(title=h5py.Empty("S5")),
    # what is known of a matrix
    "all known": knowledge(
        comment=np.bytes_("words\0"), conditioning=[2.0], determinant=[3.0], rank=[4]
    ),
    "rank alone": knowledge(rank=[4]),
    "a rank of the wrong type": knowledge(rank=np.bytes_("four")),
    "a rank as a double": knowledge(conditioning=[2.0], determinant=[3.0], rank=[4.0]),
    # sizes
    "room for more entries": room,
    "nzmax too large": of_matrix("nzmax", lambda x: x + 7),
    "nzmax too small": of_matrix("nzmax", lambda x: x - 1),
    "no nzmax": without("nzmax"),
    "pointers longer": of_matrix("p", longer),
    "a vector longer": of_vector(longer),
    "a vector shorter": of_vector(lambda x: x[:-1]),
    "entries shorter": of_matrix("x", lambda x: x[:-1]),
    "an index beyond": of_matrix("i", lambda x: np.append(x[:-1], 99)),
    "a number that is none": of_vector(lambda x: np.append(x[:-1], np.nan)),
    "two numbers for one": of_spacedim(lambda x: np.append(x, x)),
    "no storage": of_matrix("nz", lambda x: np.array([-7], "<i4")),
    # what is missing
    "values never written": never_written("x"),
    "values never written in chunks": never_written("x", chunks=(2,)),
    "values with a fill value": never_written("x", fillvalue=1.0),
    "pointers never written": never_written("p"),
    "a vector never written": never_written("vector"),
    "values half written": half_written,
    "pointers all zero": zero_pointers,
    "triplets not counted": no_triplets,
    "a triangle": half_a_triangle,
    "a whole that says so": attribute("symmetric_packed", 0),
    # links and strangers
    "a soft link": link("soft"),
    "a hard link": link("hard"),
    "a dangling link": link("dangling"),
    "a dangling external link": link("external"),
    "strangers": strangers,
}


@dataclass(frozen=True)
class Odd:
    """A file, and how it came about."""

    path: Path
    kind: str
    name: str


def make(folder: Path, changes: dict[str, Change] = CHANGES) -> Iterator[Odd]:
    """All changes of a local file and of a global one."""
    rng = np.random.default_rng(SEED)
    for kind in ("local", "global"):
        for name, change in changes.items():
            seed, d, nc = int(rng.integers(1000)), int(rng.integers(2, 4)), int(rng.integers(2, 5))
            mixed = 2 * int(rng.integers(2))
            storage = str(rng.choice(["csr", "csc", "coo"])) if kind == "local" else "coo"
            planted = planted_local if kind == "local" else planted_global
            problem = planted(seed, d=d, nc=nc, p=mixed, storage=storage).problem
            info = fclib.ProblemInfo(title="title", description="what", math_info="nothing")
            path = folder / f"{kind}-{name.replace(' ', '_')}.hdf5"
            fclib.write(path, problem.replace(info=info), compression=0)
            with h5py.File(path, "r+") as file:
                change(file, f"fclib_{kind}")
            yield Odd(path, kind, name)


if __name__ == "__main__":
    for odd in make(Path(sys.argv[1])):
        print(odd.path)
