"""Arrays in packed chunks: ours are read by HDF5, and HDF5's by us, whoever packed them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp

import fclib

CHUNK = (1 << 20) // 8  # doubles in a chunk, as we write them
SIZE = 2 * CHUNK + 20  # a multiple of three, and of no word


def diagonal(x: np.ndarray) -> fclib.LocalProblem:
    """A problem of one row a number: all three arrays of W are long."""
    W = sp.csr_array((x, np.arange(x.size), np.arange(x.size + 1)), shape=(x.size, x.size))
    return fclib.LocalProblem(spacedim=3, W=W, q=np.ones(x.size), mu=np.ones(x.size // 3))


def arrays(problem: Any) -> dict[str, np.ndarray]:
    """W of a local problem as its file has it."""
    return {"x": problem.W.data, "i": problem.W.indices, "p": problem.W.indptr}


def numbers(kind: str) -> np.ndarray:
    rng = np.random.default_rng(1)
    x = {
        "of one size": 1 + rng.random(SIZE),
        "that come again": rng.random(20)[rng.integers(20, size=SIZE)],
    }[kind]
    # the second chunk is bits without any order, which deflate cannot shrink
    x[CHUNK : 2 * CHUNK] = np.frombuffer(rng.bytes(8 * CHUNK))
    x[~np.isfinite(x)] = 1
    return x


@pytest.mark.parametrize("level", [1, 6, 9])
@pytest.mark.parametrize("kind", ["of one size", "that come again"])
def test_hdf5_reads_our_chunks_and_we_do(tmp_path: Path, kind: str, level: int) -> None:
    problem = diagonal(numbers(kind))
    path = tmp_path / "ours.hdf5"
    fclib.write(path, problem, compression=level)
    with h5py.File(path) as file:
        x = file["fclib_local/W/x"]
        assert x.compression_opts == level
        assert x.shuffle == (kind == "of one size")
        chunks = [x.id.get_chunk_info(k) for k in range(x.id.get_num_chunks())]
        assert [chunk.chunk_offset for chunk in chunks] == [(0,), (CHUNK,), (2 * CHUNK,)]
        assert (chunks[1].filter_mask != 0, chunks[1].size) == (True, 8 * CHUNK)
        assert all(not chunks[k].filter_mask and chunks[k].size < 7 * CHUNK for k in (0, 2))
        for name, ours in arrays(problem).items():
            np.testing.assert_array_equal(file[f"fclib_local/W/{name}"][()], ours)
    for name, ours in arrays(fclib.read(path)).items():
        np.testing.assert_array_equal(ours, arrays(problem)[name])


def test_what_was_packed_lately_is_not_taken_for_another(tmp_path: Path) -> None:
    """Arrays that differ in one number, whichever that is; the same one has the same bytes."""
    x = 1 + np.random.default_rng(2).random(900)
    fclib.write(tmp_path / "first.hdf5", diagonal(x))
    for place in range(0, x.size, 7):
        other = x.copy()
        other[place] += 2
        fclib.write(tmp_path / "other.hdf5", diagonal(other))
        read = arrays(fclib.read(tmp_path / "other.hdf5"))
        np.testing.assert_array_equal(read["x"], other)
    for level in (9, 6):
        fclib.write(tmp_path / f"{level}.hdf5", diagonal(x), compression=level)
    first = (tmp_path / "first.hdf5").read_bytes()
    assert (tmp_path / "6.hdf5").read_bytes() == first != (tmp_path / "9.hdf5").read_bytes()


LAYOUTS: dict[str, dict[str, Any]] = {
    "deflate": {"compression": 4},
    "shuffle and deflate": {"compression": 4, "shuffle": True},
    "shuffle": {"shuffle": True},
    "deflate with a sum": {"compression": 4, "fletcher32": True},
    "one chunk": {"compression": 4, "shuffle": True, "chunks": (SIZE,)},
    "chunks of one": {"compression": 4, "shuffle": True, "chunks": (1,)},
    "room for more": {"compression": 4, "chunks": (3 * SIZE,), "maxshape": (None,)},
    "plain chunks": {},
}


def replaced(path: Path, name: str, data: np.ndarray, **layout: Any) -> None:
    with h5py.File(path, "r+") as file:
        del file[name]
        file.create_dataset(name, data=data, **{"chunks": (1000,), **layout})


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("kind", ["<f8", ">f8", "<f4"])
def test_we_read_the_chunks_of_others(tmp_path: Path, layout: str, kind: str) -> None:
    x = 1 + np.random.default_rng(2).integers(1 << 20, size=SIZE // 8) / (1 << 20)
    # more than 1024 chunks are looked at: a file must hold so many
    x = x[:1200] if layout == "chunks of one" else x[: x.size // 3 * 3]
    path = tmp_path / "theirs.hdf5"
    fclib.write(path, diagonal(x), compression=0)
    options = dict(LAYOUTS[layout])
    if layout == "one chunk":
        options["chunks"] = (x.size,)
    replaced(path, "fclib_local/W/x", x.astype(kind), **options)
    whole = np.arange(x.size, dtype=kind.replace("f8", "i4").replace("f4", "i8"))
    replaced(path, "fclib_local/W/i", whole, **options)
    read = arrays(fclib.read(path))
    np.testing.assert_array_equal(read["x"], x.astype(kind))
    np.testing.assert_array_equal(read["i"], whole)


def test_a_chunk_that_was_never_written_is_named(tmp_path: Path) -> None:
    """HDF5 reads zeros there."""
    path = tmp_path / "sparse.hdf5"
    fclib.write(path, diagonal(np.ones(3000)), compression=0)
    with h5py.File(path, "r+") as file:
        del file["fclib_local/vectors/q"]
        q = file.create_dataset("fclib_local/vectors/q", 3000, "<f8", chunks=(1000,), compression=1)
        q[:1000] = 1
        q[2000:] = 2
    with pytest.raises(fclib.FileError, match="vectors/q: was written in part"):
        fclib.read(path)


@pytest.mark.parametrize("place", [0.01, 0.5, 0.99])
def test_a_damaged_chunk_is_named(tmp_path: Path, place: float) -> None:
    path = tmp_path / "damaged.hdf5"
    fclib.write(path, diagonal(numbers("that come again")), compression=1)
    with h5py.File(path) as file:
        chunk = file["fclib_local/W/x"].id.get_chunk_info(0)
    data = bytearray(path.read_bytes())
    data[chunk.byte_offset + int(place * chunk.size)] ^= 0x55
    path.write_bytes(data)
    with pytest.raises(fclib.FileError, match=r"fclib_local/W/x: cannot be read"):
        fclib.read(path)
