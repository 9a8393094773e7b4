"""A wrong file gives one clear line that names the file and the dataset, and nothing worse.

Each case takes a good mixed local file, or a global one, and spoils one thing.
"""

import json
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import fclib
import helpers_cli
from capi_library import CAPI, compile_program
from helpers import planted_global, planted_local, ran

ROOT = "fclib_local"
Spoil = Callable[[h5py.File], None]


def replace(name: str, value: object) -> Spoil:
    """Put another value in place of a dataset or a group, or where there is none."""

    def spoil(file: h5py.File) -> None:
        if name in file:
            del file[name]
        file[name] = value

    return spoil


def remove(name: str) -> Spoil:
    def spoil(file: h5py.File) -> None:
        del file[name]

    return spoil


def change(name: str, index: int, value: float) -> Spoil:
    def spoil(file: h5py.File) -> None:
        file[name][index] = value

    return spoil


def resize(name: str, by: int) -> Spoil:
    """Cut entries off a dataset, or repeat its last one."""

    def spoil(file: h5py.File) -> None:
        values = file[name][()]
        del file[name]
        file[name] = values[:by] if by < 0 else np.append(values, [values[-1]] * by)

    return spoil


def declare(name: str, dtype: str, size: int = 10**12) -> Spoil:
    """A dataset of a size that nobody stored."""

    def spoil(file: h5py.File) -> None:
        del file[name]
        file.create_dataset(name, shape=(size,), dtype=dtype, chunks=(2**20,))

    return spoil


def declare_sparsely(file: h5py.File) -> None:
    """One chunk of many is there."""
    declare(f"{ROOT}/vectors/q", "<f8")(file)
    file[f"{ROOT}/vectors/q"][:10] = 1.0


def store(name: str, **layout: Any) -> Spoil:
    """The same numbers, or a size that nobody stored, in another layout."""

    def spoil(file: h5py.File) -> None:
        values = file[name][()]
        del file[name]
        file.create_dataset(name, **({"data": values} | layout))

    return spoil


def store_with_wrong_checksums(name: str) -> Spoil:
    """Numbers that changed after HDF5 had summed them up."""

    def spoil(file: h5py.File) -> None:
        values = file[name][()]
        store(name, chunks=values.shape, fletcher32=True)(file)
        _, chunk = file[name].id.read_direct_chunk((0,))
        file[name].id.write_direct_chunk((0,), bytes([chunk[0] ^ 1, *chunk[1:]]))

    return spoil


def store_elsewhere(file: h5py.File) -> None:
    """A dataset whose numbers are those of other datasets."""
    layout = h5py.VirtualLayout(shape=(18,), dtype="<f8")
    layout[:] = h5py.VirtualSource(".", f"/{ROOT}/vectors/s", shape=(18,))
    del file[f"{ROOT}/vectors/q"]
    file.create_virtual_dataset(f"{ROOT}/vectors/q", layout)


def declare_text(name: str) -> Spoil:
    """A text of a length that nobody stored."""

    def spoil(file: h5py.File) -> None:
        del file[name]
        file.create_dataset(name, shape=(), dtype="S1000000000")

    return spoil


def make_group(name: str) -> Spoil:
    def spoil(file: h5py.File) -> None:
        del file[name]
        file.create_group(name)

    return spoil


def cycle(file: h5py.File) -> None:
    """A group that contains itself in place of a dataset."""
    del file[f"{ROOT}/W/x"]
    file[f"{ROOT}/W/x"] = file[f"{ROOT}/W"]


def triplets(index: int, row: int, col: int) -> Spoil:
    """R as triplets, one of which is out of place."""

    def spoil(file: h5py.File) -> None:
        group = file[f"{ROOT}/R"]
        for name in ("nz", "p", "i", "x", "nzmax"):
            del group[name]
        rows, cols = np.array([0, 1]), np.array([0, 1])
        rows[index], cols[index] = row, col
        group["nz"], group["nzmax"] = np.array([2]), np.array([2])
        group["i"], group["p"], group["x"] = rows, cols, np.ones(2)

    return spoil


def dense_of_wrong_size(file: h5py.File) -> None:
    resize(f"{ROOT}/W/x", -1)(file)
    file[f"{ROOT}/W/nz"][0] = -3


def dense_of_two_dimensions(file: h5py.File) -> None:
    """Rows or columns first? Nobody can tell."""
    file[f"{ROOT}/W/nz"][0] = -3
    replace(f"{ROOT}/W/x", np.eye(18))(file)


def never_written(name: str, **layout: Any) -> Spoil:
    """Declared as it was, and left so."""

    def spoil(file: h5py.File) -> None:
        shape, dtype = file[name].shape, file[name].dtype
        del file[name]
        file.create_dataset(name, shape=shape, dtype=dtype, **layout)

    return spoil


def half_written(name: str, **layout: Any) -> Spoil:
    """The first chunks alone."""

    def spoil(file: h5py.File) -> None:
        values = file[name][()]
        never_written(name, chunks=(4,), **layout)(file)
        file[name][:4] = values[:4]

    return spoil


def no_counts(file: h5py.File) -> None:
    file[f"{ROOT}/W/p"][:] = 0


def no_triplets(file: h5py.File) -> None:
    triplets(0, 0, 0)(file)
    file[f"{ROOT}/R/nz"][0] = 0


def packed(name: str, value: object) -> Spoil:
    def spoil(file: h5py.File) -> None:
        file[name].attrs["symmetric_packed"] = value

    return spoil


def spoil_contacts(file: h5py.File) -> None:
    group = file.create_group("contacts")
    group.attrs.create("layout", np.bytes_("FCLIB geometry 1"), dtype="S17")
    group.create_dataset("gap", shape=(6,), dtype="<f8")


def make_guesses(file: h5py.File) -> None:
    file.create_group("guesses/mine")


def room_with_numbers(file: h5py.File) -> None:
    for name in ("i", "x"):
        resize(f"{ROOT}/R/{name}", 2)(file)


def rename(old: str, new: str) -> Spoil:
    def spoil(file: h5py.File) -> None:
        file.move(old, new)

    return spoil


LOCAL_NAMES = [
    "spacedim",
    "W",
    *(f"{matrix}/{name}" for matrix in "WVR" for name in ("m", "n", "nz", "p", "i", "x")),
    "vectors",
    *(f"vectors/{name}" for name in ("q", "mu", "s")),
]
GLOBAL_NAMES = [
    *("M", "M/x", "H", "H/p", "H/nz"),
    *(f"vectors/{name}" for name in ("f", "w", "mu", "b")),
]

# of a dataset
LAYOUTS: dict[str, dict[str, Any]] = {
    "in chunks": {"chunks": (4,)},
    "packed": {"chunks": (4,), "compression": "gzip"},
    "with a fill value": {"fillvalue": 0.5},
    "without end": {"maxshape": (None,)},
}

# case: how to spoil the file, and what the message must name
LOCAL: dict[str, tuple[Spoil, str]] = {
    # something is missing
    **{f"no {name}": (remove(f"{ROOT}/{name}"), f"{ROOT}/{name}") for name in LOCAL_NAMES},
    "no V": (remove(f"{ROOT}/V"), f"{ROOT}/V"),
    "no R": (remove(f"{ROOT}/R"), f"{ROOT}/V"),
    "no problem": (remove(ROOT), ": /:"),
    "another layout": (rename(ROOT, "experiment"), ": /:"),
    # of the wrong type
    **{
        f"text in {name}": (replace(f"{ROOT}/{name}", "some text"), f"{ROOT}/{name}")
        for name in ("spacedim", "W/m", "W/nz", "W/p", "W/x", "vectors/q", "vectors/mu")
    },
    **{
        f"no integers in {name}": (
            replace(f"{ROOT}/{name}", [3.5]),
            f"{ROOT}/{name}[0]: 3.5 is not",
        )
        for name in ("spacedim", "W/n", "W/nz", "W/p", "W/i")
    },
    **{
        f"{value} for an integer": (replace(f"{ROOT}/spacedim", [value]), f"{ROOT}/spacedim[0]")
        for value in (np.nan, np.inf, 2.0**31, -(2.0**40))
    },
    "complex numbers": (replace(f"{ROOT}/vectors/q", np.ones(18) * 1j), f"{ROOT}/vectors/q"),
    "truth values": (replace(f"{ROOT}/vectors/q", np.ones(18, bool)), f"{ROOT}/vectors/q"),
    "nothing": (replace(f"{ROOT}/vectors/q", h5py.Empty("f8")), f"{ROOT}/vectors/q"),
    # of the wrong shape
    "dense of two dimensions": (dense_of_two_dimensions, f"{ROOT}/W/x: has more than one"),
    **{
        f"{name} {'short' if by < 0 else 'long'}": (resize(f"{ROOT}/{name}", by), f"{ROOT}/{names}")
        for name, by, names in (
            ("W/p", -1, "W"),
            ("W/p", 1, "W/p"),
            ("W/i", -1, "W/i"),
            ("W/x", -1, "W/x"),
            ("R/x", -2, "R/x"),
            ("vectors/q", -1, "vectors/q"),
            ("vectors/q", 1, "vectors/q"),
            ("vectors/mu", -1, "W"),
            ("vectors/mu", 1, "W"),
            ("vectors/s", -1, "vectors/s"),
            ("spacedim", 1, "spacedim"),
            ("W/nz", 1, "W/nz"),
        )
    },
    "more rows than contacts": (change(f"{ROOT}/W/m", 0, 21), f"{ROOT}/W"),
    "more columns than contacts": (change(f"{ROOT}/W/n", 0, 21), f"{ROOT}/W"),
    "V of other columns": (change(f"{ROOT}/V/n", 0, 3), f"{ROOT}/V"),
    "a negative size": (change(f"{ROOT}/W/m", 0, -18), f"{ROOT}/W/m"),
    "a huge size": (change(f"{ROOT}/W/m", 0, 2**31 - 1), f"{ROOT}/W"),
    "dense without its numbers": (dense_of_wrong_size, f"{ROOT}/W/x"),
    # wrong values
    **{
        f"{value} in {name}": (change(f"{ROOT}/{name}", 3, value), f"{ROOT}/{name}[3]")
        for name in ("W/x", "V/x", "R/x", "vectors/q", "vectors/mu")
        for value in (np.nan, np.inf, -np.inf)
    },
    "nan in s": (change(f"{ROOT}/vectors/s", 1, np.nan), f"{ROOT}/vectors/s[1]"),
    "negative mu": (change(f"{ROOT}/vectors/mu", 2, -0.1), f"{ROOT}/vectors/mu[2]"),
    "very negative mu": (change(f"{ROOT}/vectors/mu", 2, -1e300), "is -1e+300, but"),
    "index out of range": (change(f"{ROOT}/W/i", 5, 18), f"{ROOT}/W/i[5]"),
    "huge index": (change(f"{ROOT}/W/i", 5, 2**31 - 1), f"{ROOT}/W/i[5]"),
    "negative index": (change(f"{ROOT}/W/i", 0, -1), f"{ROOT}/W/i[0]"),
    "index beyond 32 bits": (
        replace(f"{ROOT}/W/i", np.full(324, 2**32, dtype=np.int64)),
        f"{ROOT}/W/i[0]",
    ),
    "index beyond 63 bits": (
        replace(f"{ROOT}/W/i", np.full(324, 2**64 - 1, dtype=np.uint64)),
        f"{ROOT}/W/i[0]",
    ),
    "triplet of a row out of range": (triplets(1, 2, 1), f"{ROOT}/R/i[1]"),
    "triplet of a column out of range": (triplets(1, 1, 2), f"{ROOT}/R/p[1]"),
    "triplet of a negative row": (triplets(0, -1, 1), f"{ROOT}/R/i[0]"),
    "decreasing pointers": (change(f"{ROOT}/W/p", 4, 1), f"{ROOT}/W/p[4]"),
    "first pointer not 0": (change(f"{ROOT}/W/p", 0, 1), f"{ROOT}/W/p[0]"),
    "negative first pointer": (change(f"{ROOT}/W/p", 0, -1), f"{ROOT}/W/p[0]"),
    "negative last pointer": (change(f"{ROOT}/W/p", 18, -1), f"{ROOT}/W/p"),
    "huge last pointer": (change(f"{ROOT}/W/p", 18, 2**31 - 1), f"{ROOT}/W/i"),
    "huge inner pointer": (change(f"{ROOT}/W/p", 3, 2**31 - 1), f"{ROOT}/W/p"),
    "no pointers": (replace(f"{ROOT}/W/p", np.zeros(0, np.int32)), f"{ROOT}/W/p"),
    **{
        f"spacedim {value}": (change(f"{ROOT}/spacedim", 0, value), f"{ROOT}/spacedim")
        for value in (1, 4, -3, 0, 5, 2**31 - 1)
    },
    "another spacedim": (change(f"{ROOT}/spacedim", 0, 2), f"{ROOT}/W"),
    "unknown storage": (change(f"{ROOT}/W/nz", 0, -4), f"{ROOT}/W/nz"),
    "more triplets than there are": (change(f"{ROOT}/W/nz", 0, 10**6), f"{ROOT}/W/p"),
    # sizes that the file does not hold
    **{
        f"a huge {name}": (declare(f"{ROOT}/{name}", dtype), f"{ROOT}/{name}: declares")
        for name, dtype in (
            ("W/x", "<f8"),
            ("W/p", "<i4"),
            ("W/i", "<i4"),
            ("vectors/q", "<f8"),
            ("vectors/mu", "<f8"),
            ("spacedim", "<i4"),
            ("W/nz", "<i4"),
        )
    },
    "many more chunks than there are": (
        store(f"{ROOT}/vectors/q", data=None, shape=(10**5,), dtype="<f8", chunks=(1,)),
        f"{ROOT}/vectors/q: has chunks",
    ),
    "a chunk beyond the file": (
        store(
            f"{ROOT}/vectors/q",
            data=None,
            shape=(18,),
            dtype="<f8",
            chunks=(2**28,),
            maxshape=(None,),
        ),
        f"{ROOT}/vectors/q: has chunks",
    ),
    "numbers by their offsets": (
        store(f"{ROOT}/W/p", chunks=True, scaleoffset=0),
        f"{ROOT}/W/p: is packed",
    ),
    "numbers that their checksum denies": (
        store_with_wrong_checksums(f"{ROOT}/vectors/q"),
        f"{ROOT}/vectors/q: cannot be read",
    ),
    # h5py brings its own copy of HDF5, and this filter
    "numbers by a filter that is not installed": (
        store(f"{ROOT}/W/i", chunks=True, compression="lzf"),
        f"{ROOT}/W/i: is packed by a filter that is not installed (lzf",
    ),
    "numbers in another file": (
        store(
            f"{ROOT}/vectors/q", data=None, shape=(18,), dtype="<f8", external=[("data", 0, 144)]
        ),
        f"{ROOT}/vectors/q: keeps",
    ),
    "numbers in another dataset": (store_elsewhere, f"{ROOT}/vectors/q: keeps"),
    "a huge q with a little in it": (declare_sparsely, f"{ROOT}/vectors/q: declares"),
    "a size beyond all memory": (declare(f"{ROOT}/W/x", "<f8", 2**60), f"{ROOT}/W/x: declares"),
    # declared, and written in part or not at all
    **{
        f"{name} never written": (
            never_written(f"{ROOT}/{name}"),
            f"{ROOT}/{name}: was declared and never written",
        )
        for name in LOCAL_NAMES
        if name not in ("W", "vectors")
    },
    **{
        f"q never written, {word}": (
            never_written(f"{ROOT}/vectors/q", **layout),
            f"{ROOT}/vectors/q: was declared and never written",
        )
        for word, layout in LAYOUTS.items()
    },
    **{
        f"{name} half written{', packed' if layout else ''}": (
            half_written(f"{ROOT}/{name}", **layout),
            f"{ROOT}/{name}: was written in part",
        )
        for name in ("W/x", "W/p", "vectors/q", "vectors/mu")
        for layout in ({}, {"compression": "gzip", "shuffle": True})
    },
    "all pointers 0": (no_counts, f"{ROOT}/W/p: says that there is no entry"),
    "no triplets of two": (no_triplets, f"{ROOT}/R/nz: says that there is no entry"),
    # a triangle of a symmetric matrix
    "a triangle that is the whole": (packed(f"{ROOT}/W", 1), f"{ROOT}/W: is said to be one"),
    "a triangle that is not square": (packed(f"{ROOT}/V", 1), f"{ROOT}/V: is said to be a packed"),
    "a triangle in words": (packed(f"{ROOT}/W", "yes"), "symmetric_packed: is not a number"),
    "two triangles": (packed(f"{ROOT}/W", 2), "symmetric_packed: is not a number"),
    # links
    "a dangling soft link": (
        replace(f"{ROOT}/vectors/q", h5py.SoftLink("/nowhere")),
        f"{ROOT}/vectors/q",
    ),
    "a dangling soft link in place of a group": (
        replace(f"{ROOT}/W", h5py.SoftLink("/nowhere")),
        f"{ROOT}/W",
    ),
    "an external link to nothing": (
        replace(f"{ROOT}/vectors/mu", h5py.ExternalLink("nothing.hdf5", "/mu")),
        f"{ROOT}/vectors/mu",
    ),
    "a soft link to itself": (replace(f"{ROOT}/W", h5py.SoftLink(f"/{ROOT}/W")), f"{ROOT}/W"),
    "a soft link to the root": (replace(f"{ROOT}/W", h5py.SoftLink("/")), f"{ROOT}/W/m"),
    "a group that holds itself": (cycle, f"{ROOT}/W/x"),
    # the wrong kind of thing
    **{
        f"a dataset in place of {name or ROOT}": (
            replace(f"{ROOT}/{name}".rstrip("/"), [1.0]),
            f"{ROOT}/{name}".rstrip("/"),
        )
        for name in ("", "W", "V", "vectors")
    },
    **{
        f"a group in place of {name}": (make_group(f"{ROOT}/{name}"), f"{ROOT}/{name}")
        for name in ("spacedim", "W/m", "W/nz", "W/p", "W/x", "vectors/q")
    },
    "a type in place of q": (replace(f"{ROOT}/vectors/q", np.dtype("f8")), f"{ROOT}/vectors/q"),
}

GLOBAL: dict[str, tuple[Spoil, str]] = {
    **{
        f"global, no {name}": (remove(f"fclib_global/{name}"), f"fclib_global/{name}")
        for name in GLOBAL_NAMES
    },
    "global, no G": (remove("fclib_global/G"), "fclib_global/vectors/b"),
    "global, f short": (resize("fclib_global/vectors/f", -1), "fclib_global/vectors/f"),
    "global, w long": (resize("fclib_global/vectors/w", 1), "fclib_global/vectors/w"),
    "global, H of other rows": (change("fclib_global/H/m", 0, 3), "fclib_global/H"),
    "global, M not square": (change("fclib_global/M/n", 0, 3), "fclib_global/M"),
    "global, a row of H out of range": (change("fclib_global/H/i", 2, 999), "fclib_global/H/i[2]"),
    "global, a column of H out of range": (
        change("fclib_global/H/p", 2, 18),
        "fclib_global/H/p[2]",
    ),
    "global, nan in M": (change("fclib_global/M/x", 0, np.nan), "fclib_global/M/x[0]"),
    "global, too many triplets": (change("fclib_global/M/nz", 0, 2**31 - 1), "fclib_global/M/p"),
}

CASES = LOCAL | GLOBAL

# what a problem can do without, and the words about it
OPTIONAL: dict[str, tuple[Spoil, str]] = {
    "numbers in title": (replace(f"{ROOT}/info/title", [1, 2]), "info/title: does not hold text"),
    "texts in title": (replace(f"{ROOT}/info/title", ["a", "b"]), "info/title: holds 2 texts"),
    "title of many dimensions": (
        replace(f"{ROOT}/info/title", np.zeros((2, 2), "u1")),
        "info/title: does not hold text",
    ),
    "a huge title": (declare_text(f"{ROOT}/info/title"), "info/title: declares a text"),
    "title never written": (
        never_written(f"{ROOT}/info/title"),
        "info/title: was declared and never written",
    ),
    "a group in place of title": (make_group(f"{ROOT}/info/title"), "info/title: is not a dataset"),
    "a title elsewhere": (
        replace(f"{ROOT}/info/title", h5py.ExternalLink("nothing.hdf5", "/title")),
        "info/title: is an external link to '/title' of the file 'nothing.hdf5'",
    ),
    "a dataset in place of info": (replace(f"{ROOT}/info", [1.0]), f"{ROOT}/info: is not a group"),
    "no such info": (
        replace(f"{ROOT}/info", h5py.SoftLink("/nowhere")),
        f"{ROOT}/info: is a link to '/nowhere'",
    ),
    "words for a rank": (replace(f"{ROOT}/W/rank", "full"), "W/rank: does not hold numbers"),
    "several ranks": (replace(f"{ROOT}/W/rank", [1, 2]), "W/rank: has 2 entries"),
    "numbers for a comment": (replace(f"{ROOT}/W/comment", [1.0]), "W/comment: does not hold text"),
    "contacts of no table": (spoil_contacts, "/contacts/gap: was declared and never written"),
    "no such solution": (
        replace("solution", h5py.SoftLink("/nowhere")),
        "/solution: is a link to '/nowhere'",
    ),
    "guesses of others": (make_guesses, "/guesses/number_of_guesses: the dataset is missing"),
    "entries that nobody counts": (room_with_numbers, "R/x: has 6 entries, of which 4"),
}


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a file for each case, and good.hdf5."""
    folder = tmp_path_factory.mktemp("malformed")
    good, whole = folder / "good.hdf5", folder / "whole.hdf5"
    fclib.write(good, planted_local(1, p=2).problem, planted_local(1, p=2).solution)
    fclib.write(whole, planted_global(1, p=2).problem)
    for source, cases in ((good, LOCAL), (whole, GLOBAL)):
        for case, (spoil, _) in cases.items():
            path = path_of(folder, case)
            path.write_bytes(source.read_bytes())
            with h5py.File(path, "a") as file:
                spoil(file)
    return folder


def path_of(folder: Path, case: str) -> Path:
    return folder / (case.replace("/", ".").replace(" ", "-") + ".hdf5")


def test_the_unspoilt_files_are_good(corpus: Path) -> None:
    assert fclib.read(corpus / "good.hdf5").formulation == "M3DFC"
    assert fclib.read(corpus / "whole.hdf5").formulation == "GM3DFC"


@pytest.mark.parametrize("case", CASES)
def test_a_spoilt_file_is_refused_and_the_dataset_named(corpus: Path, case: str) -> None:
    path = path_of(corpus, case)
    with pytest.raises((fclib.FileError, fclib.ProblemError)) as caught:
        fclib.read(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert CASES[case][1] in message.removeprefix(str(path))
    assert "\n" not in message
    assert len(message) < len(str(path)) + 200


@pytest.mark.parametrize("case", OPTIONAL)
def test_what_is_optional_never_costs_the_problem(corpus: Path, tmp_path: Path, case: str) -> None:
    path = path_of(tmp_path, case)
    path.write_bytes((corpus / "good.hdf5").read_bytes())
    with h5py.File(path, "a") as file:
        OPTIONAL[case][0](file)
    good, problem = fclib.read(corpus / "good.hdf5"), fclib.read(path)
    assert fclib.digest(problem) == fclib.digest(good)
    assert problem.info.title == ""
    (line,) = fclib.left_out(path)
    assert OPTIONAL[case][1] in line
    run = helpers_cli.run("info", str(path))
    assert run.stderr == f"fclib: {path}: {line}: left out\n"
    helpers_cli.run("solve", str(path))


def test_nothing_is_left_out_of_a_good_file(corpus: Path) -> None:
    assert fclib.left_out(corpus / "good.hdf5") == []
    assert fclib.left_out(corpus / "whole.hdf5") == []


@pytest.mark.parametrize("command", [["info"], ["solve"], ["check"], ["solve", "--write"]])
def test_the_commands_say_one_line_for_each_spoilt_file(corpus: Path, command: list[str]) -> None:
    paths = [str(path_of(corpus, case)) for case in CASES]
    before = {path: Path(path).read_bytes() for path in paths}
    arguments = [*command, "--json", *paths, str(corpus / "good.hdf5")]
    run = helpers_cli.run(*arguments, code=1)
    lines = run.stderr.splitlines()
    assert len(lines) == len(paths), run.stderr
    for line, path in zip(lines, paths, strict=True):
        assert line.startswith(f"fclib: {path}: ")
    records = [json.loads(line) for line in run.stdout.splitlines()]
    assert [record["problem"] for record in records if "message" in record][: len(paths)] == paths
    assert "formulation" in records[-1]
    assert {path: Path(path).read_bytes() for path in paths} == before


# ---- the same through the C library


@pytest.fixture(scope="module")
def refuse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program that says how the C library refuses files."""
    folder = tmp_path_factory.mktemp("programs")
    return compile_program(CAPI / "refuse.c", folder / "refuse")


@pytest.fixture
def copied(corpus: Path, tmp_path: Path) -> Path:
    """The corpus again, for those who write into it."""
    return Path(shutil.copytree(corpus, tmp_path / "malformed"))


def refusals(program: Path, files: dict[Path, str], *tool: str) -> list[tuple[str, str]]:
    """For each file, in which of the kinds it is read, the step that refuses it and the message."""
    asked = "".join(f"{kind} {path}\n" for path, kind in files.items())
    run = ran(*tool, program, input=asked, timeout=300)
    assert run.stderr == "", run.stdout[-300:] + run.stderr[-600:]
    found = [line.partition("\t") for line in run.stdout.splitlines()]
    assert len(found) == len(files)
    return [(step, message) for step, _, message in found]


def kinds_of_cases(folder: Path) -> dict[Path, str]:
    return {path_of(folder, case): "local" if case in LOCAL else "global" for case in CASES}


# where reading without validation meets another contradiction first
NAMED_IN_C = {
    "no R": f"{ROOT}/vectors/s",
    "vectors/mu short": f"{ROOT}/vectors/mu",
    "vectors/mu long": f"{ROOT}/vectors/mu",
    "more columns than contacts": f"{ROOT}/vectors/mu",
    "another spacedim": f"{ROOT}/vectors/mu",
    "spacedim 1": f"{ROOT}/vectors/mu",
    "spacedim 4": f"{ROOT}/W: has 18 columns, which is no multiple of spacedim",
    "spacedim 5": f"{ROOT}/W: has 18 columns, which is no multiple of spacedim",
    f"spacedim {2**31 - 1}": f"{ROOT}/W: has 18 columns, which is no multiple of spacedim",
}
# what is beyond the sizes of a matrix is room to it
ACCEPTED_IN_C = {"W/p long"}


def test_the_c_library_refuses_the_same_files(refuse: Path, copied: Path) -> None:
    files = kinds_of_cases(copied)
    for case, path, (step, message) in zip(CASES, files, refusals(refuse, files), strict=True):
        if case in ACCEPTED_IN_C:
            assert step == "accepted", f"{case}: {message}"
            continue
        assert step in ("read", "validate"), f"{case}: {step}"
        assert message.startswith(f"{path}: " if step == "read" else "/fclib_"), case
        named = NAMED_IN_C.get(case, CASES[case][1])
        assert named.removeprefix(": ") in message.removeprefix(str(path)), f"{case}: {message}"
        assert len(message) < len(str(path)) + 200
    good = {copied / "good.hdf5": "local"}
    assert refusals(refuse, good) == [("accepted", "")]


@pytest.mark.long
def test_the_c_library_is_clean_on_the_same_files(refuse: Path, copied: Path) -> None:
    tool = shutil.which("valgrind")
    if tool is None:
        pytest.skip("there is no valgrind")
    options = ["--quiet", "--leak-check=full", "--error-exitcode=99"]
    refusals(refuse, kinds_of_cases(copied), tool, *options)


def test_the_c_library_refuses_what_is_no_whole_file(
    refuse: Path, corpus: Path, tmp_path: Path
) -> None:
    contents = bad_bytes(corpus)
    files = {tmp_path / f"{case.replace(' ', '-')}.hdf5": "local" for case in BAD_BYTES}
    for path, case in zip(files, BAD_BYTES, strict=True):
        path.write_bytes(contents[case])
    for path, (step, message) in zip(files, refusals(refuse, files), strict=True):
        assert step == "read"
        assert message.startswith(f"{path}: ")
    for path, case in zip(files, BAD_BYTES, strict=True):
        assert path.read_bytes() == contents[case], "what cannot be read was written"


def test_the_c_library_names_what_is_wrong_with_a_solution(
    refuse: Path, corpus: Path, tmp_path: Path
) -> None:
    files = {spoilt_solution(corpus, tmp_path, case): "local" for case in SOLUTIONS}
    for case, path, (step, message) in zip(SOLUTIONS, files, refusals(refuse, files), strict=True):
        assert step in ("read-solution", "validate-solution"), case
        assert SOLUTIONS[case][1] in message.removeprefix(f"{path}: "), f"{case}: {message}"


def test_the_sizes_of_a_problem_alone_ask_for_no_memory(corpus: Path, tmp_path: Path) -> None:
    path = tmp_path / "huge.hdf5"
    path.write_bytes((corpus / "good.hdf5").read_bytes())
    with h5py.File(path, "a") as file:
        file[f"{ROOT}/W/n"][0] = 2**31 - 1
        file[f"{ROOT}/spacedim"][0] = 1
    with pytest.raises(fclib.ProblemError, match=r"vectors/mu: has 6 entries, expected"):
        fclib.write_solution(path, fclib.Solution(r=np.zeros(18)))


def test_a_dataset_beyond_the_end_of_the_file(corpus: Path, tmp_path: Path) -> None:
    """Its size and the room for it agree, but no file is so long."""
    path, size = tmp_path / "long.hdf5", 1000003
    with h5py.File(corpus / "good.hdf5") as good, h5py.File(path, "w", libver="earliest") as file:
        good.copy(ROOT, file)
        del file[f"{ROOT}/vectors/q"]
        file[f"{ROOT}/vectors/q"] = np.zeros(size)
    data = path.read_bytes()
    for true, false in ((size, 2**40), (8 * size, 2**43)):
        data = data.replace(true.to_bytes(8, "little"), false.to_bytes(8, "little"))
    path.write_bytes(data)
    # HDF5 1.14 sees it first
    word = rf"/{ROOT}/vectors/q: (declares {2**40} entries|is not a dataset that HDF5 can open)"
    with pytest.raises(fclib.FileError, match=word):
        fclib.read(path)


def test_what_cannot_be_looked_up_is_not_missing(corpus: Path, tmp_path: Path) -> None:
    """The names in the root are damaged: a solution is not said to be absent, nor written."""
    path = tmp_path / "names.hdf5"
    data = bytearray((corpus / "good.hdf5").read_bytes())
    free_list = data.index(b"HEAP") + 16
    data[free_list : free_list + 8] = (2**40).to_bytes(8, "little")
    path.write_bytes(data)
    for reads in (fclib.read, fclib.read_solution, fclib.read_guesses):
        with pytest.raises(fclib.FileError, match=r": /\w+: cannot be looked up"):
            reads(path)
    with pytest.raises(fclib.FileError, match="cannot be looked up"):
        fclib.write_solution(path, fclib.Solution(r=np.zeros(18)))
    assert path.read_bytes() == data


@pytest.mark.parametrize("block", [0, 512, 4096])
@pytest.mark.parametrize(
    ("layout", "words"),
    [
        ({}, "was declared and never written"),
        ({"chunks": (4,)}, "was declared and never written"),
        ({"external": [("data", 0, 144)]}, "keeps its data in other places"),
    ],
    ids=["in one piece", "in chunks", "in another file"],
)
def test_a_user_block_hides_nothing(
    corpus: Path, tmp_path: Path, block: int, layout: dict[str, Any], words: str
) -> None:
    path = tmp_path / "block.hdf5"
    with (
        h5py.File(corpus / "good.hdf5") as good,
        h5py.File(path, "w", userblock_size=block) as file,
    ):
        good.copy(ROOT, file)
    assert fclib.digest(fclib.read(path)) == fclib.digest(fclib.read(corpus / "good.hdf5"))
    with h5py.File(path, "r+") as file:
        never_written(f"{ROOT}/vectors/q", **layout)(file)
    with pytest.raises(fclib.FileError, match=f"/{ROOT}/vectors/q: {words}"):
        fclib.read(path)


# ---- files that are not what they seem from their first byte on


def bad_bytes(corpus: Path) -> dict[str, bytes]:
    good = (corpus / "good.hdf5").read_bytes()
    rng = np.random.default_rng(1)
    return {
        "empty": b"",
        "text": b"nz = -2\nm = 3\n",
        "noise": rng.bytes(10_000),
        "zeros": bytes(10_000),
        "a signature alone": good[:8],
        "a signature and text": good[:8] + b"some text" * 100,
        "another archive": b"PK\x03\x04" + bytes(1000),
        **{f"cut after {part} %": good[: len(good) * part // 100] for part in range(1, 100, 7)},
        "cut by one byte": good[:-1],
    }


BAD_BYTES = [
    "empty",
    "text",
    "noise",
    "zeros",
    "a signature alone",
    "a signature and text",
    "another archive",
    *(f"cut after {part} %" for part in range(1, 100, 7)),
    "cut by one byte",
]


@pytest.mark.parametrize("case", BAD_BYTES)
def test_what_is_no_whole_file_is_refused(corpus: Path, tmp_path: Path, case: str) -> None:
    path = tmp_path / "bad.hdf5"
    path.write_bytes(bad_bytes(corpus)[case])
    for action in (
        lambda: fclib.read(path),
        lambda: fclib.read_solution(path),
        lambda: fclib.read_guesses(path),
        lambda: fclib.contents(path),
        lambda: fclib.write_solution(path, fclib.Solution(r=np.zeros(18))),
        lambda: fclib.write_guesses(path, [fclib.Solution(r=np.zeros(18))]),
    ):
        with pytest.raises(fclib.FileError) as caught:
            action()
        assert str(caught.value).startswith(f"{path}: ")
        assert "\n" not in str(caught.value)
    assert path.read_bytes() == bad_bytes(corpus)[case]


def test_flipped_bytes_never_do_worse_than_an_error(corpus: Path, tmp_path: Path) -> None:
    """In a process of its own: what reads beyond its memory ends the process."""
    code = (
        "import sys, numpy as np, fclib\n"
        "good = open(sys.argv[1], 'rb').read()\n"
        "rng = np.random.default_rng(7)\n"
        "refused = 0\n"
        "for _ in range(1500):\n"
        "    data = bytearray(good)\n"
        "    for k in rng.integers(0, len(data), rng.integers(1, 9)):\n"
        "        data[k] = rng.choice([0, 1, 127, 128, 255, data[k] ^ (1 << rng.integers(0, 8))])\n"
        "    open(sys.argv[2], 'wb').write(data)\n"
        "    try:\n"
        "        problem = fclib.read(sys.argv[2])\n"
        "        problem.validate()\n"
        "        fclib.read_solution(sys.argv[2])\n"
        "    except (fclib.FileError, fclib.ProblemError) as error:\n"
        "        assert str(error).startswith(sys.argv[2] + ': '), error\n"
        "        refused += 1\n"
        "print(refused)\n"
    )
    run = ran(sys.executable, "-c", code, corpus / "good.hdf5", tmp_path / "flipped.hdf5")
    assert int(run.stdout) > 100
    # after damaged metadata HDF5 1.10 may say, as the process ends, that it could not close its own
    # objects: "HDF5: infinite loop closing library" and a line of their names
    own = run.stderr.splitlines()
    assert not own or (len(own) == 2 and own[0].startswith("HDF5: infinite loop closing"))


# ---- solutions


SOLUTIONS: dict[str, tuple[Spoil, str]] = {
    "no r": (remove("solution/r"), "/solution/r"),
    "no l": (remove("solution/l"), "/solution/l"),
    "r short": (resize("solution/r", -1), "/solution/r"),
    "r long": (resize("solution/r", 1), "/solution/r"),
    "u short": (resize("solution/u", -1), "/solution/u"),
    "l long": (resize("solution/l", 3), "/solution/l"),
    "nan in r": (change("solution/r", 2, np.nan), "/solution/r[2]"),
    "inf in u": (change("solution/u", 0, np.inf), "/solution/u[0]"),
    "text in r": (replace("solution/r", "text"), "/solution/r"),
    "r never written": (declare("solution/r", "<f8"), "no solution"),
    "a dataset in place of the solution": (replace("solution", [1.0]), "/solution"),
    "a dangling link in place of l": (
        replace("solution/l", h5py.SoftLink("/nowhere")),
        "/solution/l",
    ),
}


def spoilt_solution(corpus: Path, folder: Path, case: str) -> Path:
    path = path_of(folder, case)
    path.write_bytes((corpus / "good.hdf5").read_bytes())
    with h5py.File(path, "a") as file:
        SOLUTIONS[case][0](file)
    return path


def test_check_names_what_is_wrong_with_a_solution(corpus: Path, tmp_path: Path) -> None:
    paths = {case: spoilt_solution(corpus, tmp_path, case) for case in SOLUTIONS}
    run = helpers_cli.run("check", *paths.values(), code=1)
    lines = run.stderr.splitlines()
    assert len(lines) == len(paths), run.stderr
    for line, (case, path) in zip(lines, paths.items(), strict=True):
        assert line.startswith(f"fclib: {path}: "), line
        assert SOLUTIONS[case][1] in line.removeprefix(f"fclib: {path}"), line


@pytest.mark.parametrize("name", [f"{ROOT}/W", f"{ROOT}/vectors/q", "solution"])
def test_an_external_link_to_a_pipe_is_not_waited_at(tmp_path: Path, name: str) -> None:
    path = tmp_path / "problem.hdf5"
    problem = fclib.LocalProblem(W=np.eye(3), q=[-1, 0, 0], mu=[0.5])
    fclib.write(path, problem, fclib.solve(problem).solution)
    os.mkfifo(tmp_path / "pipe")
    with h5py.File(path, "a") as file:
        del file[name]
        file[name] = h5py.ExternalLink("pipe", "/there")
    code = f"import fclib; fclib.read({str(path)!r}); print(fclib.read_solution({str(path)!r}))"
    run = ran(sys.executable, "-c", code, code=None, timeout=100)
    words = "is an external link to '/there' of the file 'pipe', which is not followed"
    assert f"/{name}: {words}" in run.stderr


LINKED = (ROOT, f"{ROOT}/W", f"{ROOT}/W/x", f"{ROOT}/vectors/q", f"{ROOT}/info", "solution")


@pytest.mark.parametrize("soft", [False, True])
@pytest.mark.parametrize("name", [*LINKED, "contacts", f"{ROOT}/info/title", "guesses"])
def test_no_link_into_another_file_is_followed(tmp_path: Path, name: str, soft: bool) -> None:
    """A file from elsewhere names a file of its reader's, and `convert` would copy it."""
    theirs, path = tmp_path / "theirs.hdf5", tmp_path / "problem.hdf5"
    pairs, points = np.zeros((1, 2), np.int32), np.zeros((1, 3))
    contacts = fclib.Contacts(
        body=pairs,
        shape=pairs,
        point=points,
        normal=points,
        tangent=points,
        feature=np.zeros(1, np.int32),
        gap=np.zeros(1),
    )
    problem = fclib.LocalProblem(W=np.eye(3), q=[-1, 0, 0.0], mu=[0.12345], contacts=contacts)
    for file in (theirs, path):
        problem = problem.replace(info=fclib.ProblemInfo(title=file.stem))
        fclib.write(file, problem, fclib.solve(problem).solution)
        fclib.write_guesses(file, [fclib.solve(problem).solution], mode="add")
    with h5py.File(path, "a") as file:
        del file[name]
        file["away" if soft else name] = h5py.ExternalLink(theirs, f"/{name}")
        if soft:
            file[name] = h5py.SoftLink("/away")
    copy = tmp_path / "copy.hdf5"
    done = helpers_cli.run("convert", path, copy, code=None)
    assert "Traceback" not in done.stderr
    if done.returncode == 0:
        # what was linked is left out
        with h5py.File(copy) as file:
            assert name not in file or f"{ROOT}/info" in name
        assert fclib.read(copy).info.title != "theirs"
    else:
        assert "problem.hdf5" in done.stderr
        assert soft or f"/{name}: is an external link to" in done.stderr
