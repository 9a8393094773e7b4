"""More odd files: types, storages and whole files as other programs of HDF5 write them.

What `odd_files.py` says of its files holds for these, which are not read in a page.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5p, h5s, h5t, h5z

from odd_files import (
    Change,
    Odd,
    datasets,
    each,
    in_words,
    is_integer,
    main_matrix,
    main_vector,
    of_matrix,
    of_vector,
    put,
    real,
    same,
    single,
    vector,
)
from odd_files import make as make_with

Store = Callable[[h5py.File, str, Any], None]


def stored(pick: Callable[[str], bool], store: Store) -> Change:
    """The chosen datasets, written by another function."""

    def change(file: h5py.File, root: str) -> None:
        for name in datasets(file, root):
            if pick(name) and (values := file[name][()]).size > 1:
                store(file, name, values)

    return change


def entries(name: str) -> bool:
    """Those of q, f and x."""
    return name.rsplit("/", 1)[-1] in ("q", "f", "x")


def indices(name: str) -> bool:
    return name.endswith("/i")


def by_hand(kind: h5t.TypeID, **layout: int) -> Store:
    """Values of a type and in a layout that h5py has no word for."""

    def store(file: h5py.File, name: str, values: Any) -> None:
        plist = h5p.create(h5p.DATASET_CREATE)
        if "chunk" in layout:
            plist.set_chunk((layout["chunk"],))
        if "filter" in layout:
            plist.set_filter(layout["filter"], h5z.FLAG_OPTIONAL, ())
        if "layout" in layout:
            plist.set_layout(layout["layout"])
        if "early" in layout:
            plist.set_alloc_time(h5d.ALLOC_TIME_EARLY)
            plist.set_fill_time(h5d.FILL_TIME_NEVER)
        del file[name]
        space = h5s.create_simple(values.shape)
        made = h5d.create(file.id, name.encode(), kind, space, plist)
        made.write(h5s.ALL, h5s.ALL, values, kind if values.dtype.kind == "S" else None)

    return store


def changed(kind: h5t.TypeID, **parts: int) -> h5t.TypeID:
    """A copy of a type with other properties."""
    copy = kind.copy()
    for name, value in parts.items():
        getattr(copy, f"set_{name}")(value)
    return copy


def title(kind: h5t.TypeID, text: bytes) -> Change:
    def change(file: h5py.File, root: str) -> None:
        by_hand(kind)(file, f"{root}/info/title", np.array([text]))

    return change


def in_another_file(file: h5py.File, name: str, values: Any) -> None:
    """Its bytes are a file of their own."""
    raw = Path(f"{file.filename}.{name.rsplit('/', 1)[-1]}")
    values.tofile(raw)
    del file[name]
    file.create_dataset(
        name, shape=values.shape, dtype=values.dtype, external=[(raw.name, 0, values.nbytes)]
    )


def virtual(file: h5py.File, name: str, values: Any) -> None:
    """A view of a dataset of another file."""
    source = Path(f"{file.filename}.{name.rsplit('/', 1)[-1]}")
    with h5py.File(source, "w") as other:
        other["data"] = values
    layout = h5py.VirtualLayout(shape=values.shape, dtype=values.dtype)
    layout[:] = h5py.VirtualSource(source.name, "data", shape=values.shape)
    del file[name]
    file.create_virtual_dataset(name, layout)


def link_to_another_file(file: h5py.File, root: str) -> None:
    """The main matrix is in another file, which is there."""
    other = Path(f"{file.filename}.matrix")
    with h5py.File(other, "w") as target:
        file.copy(main_matrix(root), target, "matrix")
    del file[main_matrix(root)]
    file[main_matrix(root)] = h5py.ExternalLink(other.name, "/matrix")


def labels(file: h5py.File, name: str, values: Any) -> None:
    """Integers that have names."""
    kind = h5py.enum_dtype({"none": 0, "one": 1, "two": 2}, basetype="i4")
    put(file, name, values.astype(kind))


def one_array(file: h5py.File, name: str, values: Any) -> None:
    """One element, which is an array."""
    kind = h5t.array_create(h5t.IEEE_F64LE, values.shape)
    del file[name]
    made = h5d.create(file.id, name.encode(), kind, h5s.create_simple((1,)))
    made.write(h5s.ALL, h5s.ALL, values.reshape(1, -1), kind)


def named_type(file: h5py.File, name: str, values: Any) -> None:
    if "types/double" not in file:
        file["types/double"] = np.dtype("<f8")
    del file[name]
    file.create_dataset(name, data=values, dtype=file["types/double"])


def in_two_dimensions(file: h5py.File, name: str, values: Any) -> None:
    """Chunks of a row that may grow, the last one not full."""
    chunks = (1, max(1, values.size // 2 + 1))
    put(file, name, values.reshape(1, -1), chunks=chunks, maxshape=(None, None), compression=4)


def of_matlab(file: h5py.File, root: str) -> None:
    """The attributes that MATLAB writes."""

    def add(_: str, item: h5py.Group | h5py.Dataset) -> None:
        struct = isinstance(item, h5py.Group)
        item.attrs["MATLAB_class"] = np.bytes_("struct" if struct else "double")
        item.attrs["H5PATH"] = np.bytes_("/")

    file.visititems(add)


def many_attributes(file: h5py.File, root: str) -> None:
    for k in range(40):
        file[main_vector(root)].attrs[f"a{k}"] = np.arange(k)
    file[root].attrs["text"] = "größe"
    file[root].attrs["itself"] = file[root].ref


def a_loop(file: h5py.File, root: str) -> None:
    file[f"{root}/all"] = file["/"]
    file[f"{main_matrix(root)}/up"] = h5py.SoftLink("..")


def shared(file: h5py.File, root: str) -> None:
    """The rows and the columns of a square matrix are one dataset."""
    group = file[main_matrix(root)]
    del group["n"]
    group["n"] = group["m"]


def info_is_no_group(file: h5py.File, root: str) -> None:
    put(file, f"{root}/info", 3)


def more_info(file: h5py.File, root: str) -> None:
    file.create_group(f"{root}/info/more/and/more")
    file[f"{root}/info/author"] = "someone"


def other_kind(file: h5py.File, root: str) -> None:
    file.create_group("fclib_global" if "local" in root else "fclib_local")


def nothing_for(name: str) -> Change:
    def change(file: h5py.File, root: str) -> None:
        put(file, f"{root}/{name}", h5py.Empty("<f8"))

    return change


def as_it_is(file: h5py.File, root: str) -> None:
    pass


STRING = h5t.C_S1
CHANGES: dict[str, Change] = {
    "sizes without a sign": each(single, lambda x: x.astype("<u4") if x[0] >= 0 else x),
    "sizes of 8 bits in 1 x 1": each(
        lambda name: single(name) and not name.endswith("/nzmax"),
        lambda x: x.astype("i1").reshape(1, 1) if abs(x[0]) < 128 else x,
    ),
    "indices without a sign": of_matrix("i", lambda x: x.astype("<u8")),
    "integers of 64 bits and the other order": each(is_integer, lambda x: x.astype(">i8")),
    "integers as long doubles": each(is_integer, lambda x: x.astype(np.longdouble)),
    "floats of the other order": each(real, lambda x: x.astype(">f4")),
    "numbers as integers of 64 bits": of_vector(lambda x: np.arange(x.size, dtype="<i8")),
    "numbers as bytes": of_vector(lambda x: np.arange(x.size, dtype="u1")),
    "integers beyond doubles": of_vector(lambda x: np.full(x.size, 2**53 + 1, "<i8")),
    "24 of 32 bits": stored(indices, by_hand(changed(h5t.STD_I32LE, precision=24))),
    "labels": stored(indices, labels),
    "one array": stored(entries, one_array),
    "pairs of name and value": stored(
        entries, lambda file, name, x: put(file, name, x.astype([("value", "<f8")]))
    ),
    "a type with a name": stored(real, named_type),
    # places and filters
    "compact": stored(real, by_hand(h5t.IEEE_F64LE, layout=h5d.COMPACT)),
    "allocated early": stored(real, by_hand(h5t.IEEE_F64BE, early=1)),
    "chunks longer than the data": each(
        vector, same, chunks=(1000,), maxshape=(None,), compression="gzip", compression_opts=9
    ),
    "chunks of a row": stored(vector, in_two_dimensions),
    "n-bit": stored(indices, by_hand(h5t.STD_I32LE, chunk=2, filter=h5z.FILTER_NBIT)),
    "LZF": stored(entries, by_hand(h5t.IEEE_F64LE, chunk=2, filter=h5z.FILTER_LZF)),
    "data in another file": stored(entries, in_another_file),
    "a view of another file": stored(entries, virtual),
    "a link to another file": link_to_another_file,
    # texts and what stands beside
    "a text filled with blanks": title(changed(h5t.FORTRAN_S1, size=12), b"title       "),
    "a text of UTF-8": title(changed(STRING, size=12, cset=h5t.CSET_UTF8), "größe".encode()),
    "a text of UTF-16": in_words(title=np.frombuffer("title".encode("utf-16-le"), "<u2")),
    "opaque": in_words(title=np.void(b"title")),
    "info is no group": info_is_no_group,
    "more info": more_info,
    "attributes of MATLAB": of_matlab,
    "many attributes": many_attributes,
    "a loop": a_loop,
    "sizes of one dataset": shared,
    "a group of the other kind": other_kind,
    "an empty solution": lambda file, root: file.create_group("solution"),
    "no mu": nothing_for("vectors/mu"),
    "no spacedim": nothing_for("spacedim"),
}
# copies of a good file, by what h5py.File takes
FILES: dict[str, dict[str, Any]] = {
    "a block of the user": {"userblock_size": 512},
    "the oldest format": {"libver": "earliest"},
    "the newest format": {"libver": "latest"},
    "the format of 1.10": {"libver": ("v110", "v110")},
    "in the order of creation": {"libver": "latest", "track_order": True},
    "in pages": {"libver": "latest", "fs_strategy": "page", "fs_page_size": 4096},
}


def make(folder: Path) -> Iterator[Odd]:
    """All of them, of both kinds."""
    yield from make_with(folder, CHANGES)
    for odd in make_with(folder, dict.fromkeys(FILES, as_it_is)):
        copy = odd.path.with_suffix(".copy")
        with h5py.File(odd.path) as file, h5py.File(copy, "w", **FILES[odd.name]) as target:
            for name in file:
                file.copy(name, target)
        copy.replace(odd.path)
        yield odd
