"""Sequences: many problems in one file, written step by step, read while it grows."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import fclib
from capi_library import compile_program
from doc_blocks import blocks_of
from helpers import planted_global, planted_local, ran
from helpers_cli import run

KILLS = 60
# of any formulation
read: Any = fclib.read
Sequence: Any = fclib.Sequence
SequenceWriter: Any = fclib.SequenceWriter
TINY = Path(fclib.__file__).parent / "collections" / "data" / "tiny"
PEER = Path("/usr/include/fclib.h")


def step(k: int, nc: int = 3) -> fclib.LocalProblem:
    """A problem that says which step it is."""
    W = np.eye(3 * nc)
    return fclib.LocalProblem(W=W, q=np.full(3 * nc, -float(k)), mu=np.full(nc, 0.5))


def record(path: Path, count: int) -> None:
    with SequenceWriter(path) as writer:
        for k in range(count):
            writer.append(step(k))


def recorded() -> list[tuple[fclib.Problem, fclib.Solution]]:
    """Problems of each formulation and storage, with their solutions."""
    found: list[tuple[fclib.Problem, fclib.Solution]] = []
    for storage in ("csr", "csc", "coo", "dense"):
        for rolling, dimensions in ((False, (2, 3)), (True, (3, 5))):
            for d in dimensions:
                for p in (0, 3):
                    for planted in (planted_global, planted_local):
                        made = planted(7 * d + p, d, 4, p, storage=storage, rolling=rolling)
                        found.append((made.problem, made.solution))
    return found


def test_each_formulation_comes_back(tmp_path: Path) -> None:
    path, all_of_them = tmp_path / "run.h5", recorded()
    with SequenceWriter(path) as writer:
        for k, (problem, solution) in enumerate(all_of_them):
            named = problem.replace(info=fclib.ProblemInfo(title=f"step {k}", description="π"))
            guesses = [fclib.Solution(r=solution.r * g, l=solution.l) for g in range(k % 3)]
            writer.append(named, solution if k % 2 else None, guesses, world=k % 2)
        assert len(writer) == len(all_of_them)
    steps = Sequence(path)
    assert len(steps) == len(all_of_them)
    assert steps.worlds == [k % 2 for k in range(len(steps))]
    assert steps.numbers == [k // 2 for k in range(len(steps))]
    for k, (problem, solution) in enumerate(all_of_them):
        assert steps[k] == problem.replace(info=steps[k].info)
        assert (steps[k].info.title, steps[k].info.description) == (f"step {k}", "π")
        assert steps.solution(k) == (solution if k % 2 else None)
        assert [guess.r.tolist() for guess in steps.guesses(k)] == [
            (solution.r * g).tolist() for g in range(k % 3)
        ]
        assert fclib.load(str(path), step=k) == steps[k]
    assert steps[-1] == steps[len(steps) - 1]
    with pytest.raises(IndexError, match=f"has {len(steps)} steps"):
        steps[len(steps)]


def test_the_reader_of_the_page_reads_a_sequence(root: Path, tmp_path: Path) -> None:
    path, all_of_them = tmp_path / "run.h5", recorded()
    with SequenceWriter(path) as writer:
        for problem, solution in all_of_them:
            writer.append(problem, solution)
    code = next(b.code for b in blocks_of(root / "docs/format.md") if "def read_step" in b.code)
    definitions, call, _ = code.partition("step = read_step(")
    assert call
    namespace: dict[str, Any] = {}
    exec(compile(definitions, "docs/format.md", "exec"), namespace)
    for k, (problem, solution) in enumerate(all_of_them):
        arrays = namespace["read_step"](path, k)
        group = f"fclib_{problem.kind}"
        assert arrays[f"{group}/vectors/mu"].tolist() == problem.mu.tolist()
        assert arrays[f"{group}/spacedim"].tolist() == [problem.spacedim]
        assert arrays["solution/r"].tolist() == solution.r.tolist()
        name = "W" if hasattr(problem, "W") else "H"
        matrix = getattr(problem, name)
        stored = matrix.ravel(order="F") if isinstance(matrix, np.ndarray) else matrix.data
        assert sorted(arrays[f"{group}/{name}/x"]) == sorted(stored)


def test_geometry_and_attributes_go_with_a_step(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    placed = [read(file) for file in sorted(TINY.glob("*/*.hdf5"))]
    placed = [problem for problem in placed if problem.contacts is not None][:6]
    assert placed
    with SequenceWriter(path) as writer:
        for problem in placed:
            found = fclib.Solution(
                r=np.ones(problem.m), l=np.ones(problem.p) if problem.p else None
            )
            writer.append(problem, found, attributes={"solver": "nsgs", "error": 0.25})
    for k, problem in enumerate(placed):
        assert read(f"{path}#{k}") == problem
        told = fclib.read_attributes(f"{path}#{k}", "solution")
        assert told == {"solver": "nsgs", "error": 0.25}


def test_what_does_not_change_is_stored_once(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    made: Any = planted_global(1, nc=5)
    with SequenceWriter(path) as writer:
        for k in range(50):
            for world in range(3):
                f = np.full(made.problem.n, float(k))
                M = made.problem.M * (1.0 + world)
                writer.append(made.problem.replace(f=f, M=M), world=world)
    with h5py.File(path) as file:
        numbers = len(file["fclib_sequence/numbers"])
    one = made.problem
    of_a_world = one.M.nnz + one.H.nnz + one.w.size + one.mu.size
    assert numbers == 3 * of_a_world + 150 * one.n
    for k in range(150):
        found = read(f"{path}#{k}")
        assert found.f[0] == k // 3
        assert found.M.data[0] == one.M.data[0] * (1 + k % 3)


def test_a_sequence_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    for first in (0, 5, 10):
        with SequenceWriter(path, mode="add") as writer:
            assert len(writer) == first
            for k in range(first, first + 5):
                writer.append(step(k), world=k % 2)
    steps = Sequence(path)
    assert [problem.q[0] for problem in steps] == [-float(k) for k in range(15)]
    assert steps.numbers == [k // 2 for k in range(15)]
    record(path, 2)  # by default the old one is replaced
    assert len(Sequence(path)) == 2


def test_it_is_read_while_it_grows(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    other = [sys.executable, "-c", "import fclib, sys; print(len(fclib.Sequence(sys.argv[1])))"]
    writer = SequenceWriter(path)
    steps = Sequence(path)
    for k in range(3):
        writer.append(step(k))
        writer.flush()
        steps.refresh()
        assert len(steps) == k + 1
        assert steps[k].q[0] == -k
        assert ran(*other, path).stdout == f"{k + 1}\n"
    with h5py.File(path, swmr=True) as file:
        assert len(file["fclib_sequence/steps"]) == 3
    with pytest.raises(fclib.FileError, match="another writer has it open"):
        SequenceWriter(path, mode="add")
    with pytest.raises(fclib.FileError, match="another writer has it open"):
        SequenceWriter(path)
    writer.close()
    with pytest.raises(fclib.FileError, match="is closed"):
        writer.append(step(3))
    assert len(Sequence(path)) == 3


def test_an_error_leaves_the_steps_that_were_there(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    problem = step(1)
    with SequenceWriter(path) as writer:
        writer.append(step(0))
        with pytest.raises(fclib.ProblemError, match="/solution/r: has 1 entries, expected m = 9"):
            writer.append(problem, np.zeros(1))
        with pytest.raises(fclib.ProblemError, match="/guesses/2/r"):
            writer.append(problem, None, [np.zeros(9), np.zeros(3)])
        with pytest.raises(fclib.OptionError, match="are of a solution"):
            writer.append(problem, attributes={"error": 1.0})
        bad = problem.replace(q=np.full(9, np.nan))
        with pytest.raises(fclib.ProblemError, match=r"/fclib_local/vectors/q\[0\]"):
            writer.append(bad)
        writer.append(problem)
    assert [one.q[0] for one in Sequence(path)] == [0, -1]


def test_steps_stay_as_they_were_recorded(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    record(path, 1)
    before = path.read_bytes()
    with pytest.raises(fclib.FileError, match="is a step of a sequence"):
        fclib.write_solution(f"{path}#0", np.zeros(9))
    with pytest.raises(fclib.FileError, match="is a step of a sequence"):
        fclib.write(f"{path}#0", step(0))
    with pytest.raises(fclib.FileError, match="is a sequence"):
        fclib.write(path, step(0), mode="add")
    assert path.read_bytes() == before
    assert sorted(tmp_path.iterdir()) == [path]


def test_a_missing_step_is_named(tmp_path: Path) -> None:
    path, plain = tmp_path / "run.h5", tmp_path / "plain.hdf5"
    record(path, 2)
    fclib.write(plain, step(0))
    with pytest.raises(fclib.FileError, match=r"run.h5#2: /fclib_sequence: has 2 steps"):
        read(f"{path}#2")
    with pytest.raises(fclib.FileError, match="is no sequence"):
        read(f"{plain}#0")
    with pytest.raises(fclib.FileError, match="is a sequence of many problems: name one"):
        read(path)
    with pytest.raises(fclib.FileError, match="there is no such file"):
        read(tmp_path / "none.h5#0")
    assert fclib.steps(plain) is None
    with pytest.raises(fclib.FileError, match="is no sequence"):
        SequenceWriter(plain, mode="add")
    with pytest.raises(fclib.FileError, match="is no sequence"):
        Sequence(plain)
    odd = tmp_path / "odd#1"  # a file of such a name is itself
    fclib.write(odd, step(4))
    assert read(odd).q[0] == -4


@pytest.mark.parametrize("compression", [0, 6])
def test_bytes_beside_the_numbers(tmp_path: Path, compression: int) -> None:
    path, rng = tmp_path / "run.h5", np.random.default_rng(0)
    one: Any = planted_global(1, nc=17).problem
    numbers = 8 * (one.M.nnz + one.H.nnz + one.nc)
    with SequenceWriter(path, compression=compression) as writer:
        for _ in range(400):
            f, w = rng.standard_normal(one.n), rng.standard_normal(one.m)
            last = one.replace(f=f, w=w, H=one.H * f[0])
            writer.append(last)
            numbers += 8 * (f.size + w.size + one.H.nnz)
    assert path.stat().st_size < (1.1 if compression == 0 else 1.0) * numbers
    assert read(f"{path}#399") == last


# ---- a writer that is killed

WRITER = r"""
#include <fclib.h>
#include <stdio.h>
#include <stdlib.h>

/* adds steps for ever: says which ones are confirmed */
int main(int argc, char **argv) {
  enum { most = 40 };
  static double x[9 * most * most], q[3 * most], mu[most];
  struct fclib_sequence *sequence =
      argc > 2 ? fclib_sequence_continue(argv[1]) : fclib_sequence_create(argv[1], NULL);
  if (!sequence) return fprintf(stderr, "%s\n", fclib_last_error()), 1;
  for (int k = fclib_sequence_size(argv[1]);; k++) {
    int nc = 1 + k % most, m = 3 * nc;
    struct fclib_matrix W = {m * m, m, m, NULL, NULL, x, -3, NULL};
    struct fclib_local problem = {&W, NULL, NULL, mu, q, NULL, 3, NULL};
    for (int i = 0; i < m * m; i++) x[i] = k + i;
    for (int i = 0; i < m; i++) q[i] = k;
    struct fclib_solution solution = {NULL, q, q, NULL};
    if (!fclib_sequence_add_local(sequence, &problem, 0)) return 1;
    if (!fclib_sequence_add_solution(sequence, &solution)) return 1;
    if (k % 3 == 0) {
      if (!fclib_sequence_flush(sequence)) return 1;
      printf("%d\n", k + 1);
      fflush(stdout);
    }
  }
}
"""


@pytest.fixture(scope="module")
def writer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sequence")
    source = folder / "writer.c"
    source.write_text(WRITER)
    program: Path = compile_program(source, folder / "writer")
    return program


def check_whole(path: Path, confirmed: int) -> int:
    """All confirmed steps are there, and each is whole. Return how many there are."""
    steps = Sequence(path)
    assert len(steps) >= confirmed
    for k in {0, *range(max(0, len(steps) - 4), len(steps))} if len(steps) else ():
        nc = 1 + k % 40
        problem, solution = steps[k], steps.solution(k)
        assert problem.nc == nc
        assert (problem.q == k).all()
        assert isinstance(problem, fclib.LocalProblem)
        W = problem.W if isinstance(problem.W, np.ndarray) else problem.W.toarray()
        assert (W.T.ravel() == k + np.arange(W.size)).all()
        assert solution is not None
        assert (solution.r == k).all()
    return len(steps)


def test_a_killed_writer_leaves_all_confirmed_steps(writer: Path, tmp_path: Path) -> None:
    random.seed(2)
    path, count, kept = tmp_path / "run.h5", 0, 0
    for turn in range(KILLS):
        fresh = turn % 10 == 0
        if fresh:
            path = tmp_path / f"run-{turn}.h5"
        words = [str(writer), str(path), *([] if fresh else ["add"])]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert process.stdout is not None
        assert process.stderr is not None
        with process.stdout, process.stderr:
            time.sleep(random.uniform(0.0, 0.2))
            process.send_signal(signal.SIGKILL)
            said, errors = process.stdout.read().split(), process.stderr.read()
            assert process.wait() == -signal.SIGKILL, errors
        if not path.exists():
            assert not said
            record(path, 0)
        if fresh:
            count = 0
        confirmed = int(said[-1]) if said else count
        count = check_whole(path, confirmed)
        kept += len(said)
    assert kept > KILLS  # the writers were at work


def test_a_killed_sequence_opens_for_others_too(writer: Path, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with subprocess.Popen([writer, path], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.kill()
    with h5py.File(path, swmr=True) as file:
        assert len(file["fclib_sequence/steps"]) > 0
    with SequenceWriter(path, mode="add"):
        pass
    with h5py.File(path) as file:  # whoever goes on with it mends it
        assert len(file["fclib_sequence/steps"]) == len(Sequence(path))


FULL_DISK = """
import os, sys
import numpy as np
import fclib
path = sys.argv[1] + "/run.h5"
def step(k):
    return fclib.LocalProblem(spacedim=3, W=np.eye(30) * k, q=np.full(30, k), mu=np.ones(10))
confirmed = 0
writer = fclib.SequenceWriter(path)
filling = open(sys.argv[1] + "/other", "wb")
filling.write(bytes(500_000))
filling.flush()
try:
    while confirmed < 1000:
        writer.append(step(confirmed))
        writer.flush()
        confirmed += 1
except fclib.FileError as error:
    print(error)
steps = fclib.Sequence(path)
assert len(steps) == confirmed > 5
os.remove(sys.argv[1] + "/other")
filling.close()
writer.append(step(confirmed + 1))  # there is room again, and nothing was lost
writer.close()
steps.refresh()
assert [one.q[0] for one in steps] == [*range(confirmed + 2)]
print(len(os.listdir(sys.argv[1])))
"""


def test_a_full_disk_leaves_the_confirmed_steps(tmp_path: Path) -> None:
    disk = ["sh", "-c", 'mount -t tmpfs -o size=1m none "$0" && exec "$@"', str(tmp_path)]
    apart = ["unshare", "--mount", "--map-root-user"]
    if not shutil.which("unshare") or subprocess.run([*apart, *disk, "true"]).returncode:
        pytest.skip("no file system can be mounted")
    done = ran(*apart, *disk, sys.executable, "-c", FULL_DISK, tmp_path)
    assert done.stderr == ""
    assert done.stdout.splitlines() == [
        f"{tmp_path}/run.h5: cannot be written: {os.strerror(errno.ENOSPC)}",
        "1",
    ]


@pytest.mark.parametrize("size", ["600k", "1900k"])
def test_a_full_disk_leaves_no_part_of_a_simulated_sequence(size: str, tmp_path: Path) -> None:
    """It is full while problems are made, or while they go into one file."""
    pytest.importorskip("mujoco")
    disk = ["sh", "-c", f'mount -t tmpfs -o size={size} none "$0" && exec "$@"', str(tmp_path)]
    apart = ["unshare", "--mount", "--map-root-user"]
    if not shutil.which("unshare") or subprocess.run([*apart, *disk, "true"]).returncode:
        pytest.skip("no file system can be mounted")
    scene = tmp_path.with_suffix(".xml")
    scene.write_text(
        "<mujoco><worldbody><geom type='plane' size='1 1 1'/><body pos='0 0 .1'><freejoint/>"
        "<geom size='.1'/></body></worldbody></mujoco>"
    )
    words = ["-m", "fclib", "simulate", "--steps", "100", "--out"]
    script = '"$@"; echo "ended by $?"; ls -A "$0"'
    command = [sys.executable, *words, str(tmp_path / "run.h5"), str(scene)]
    done = subprocess.run(
        [*apart, *disk, "sh", "-c", script, str(tmp_path), *command], capture_output=True, text=True
    )
    assert os.strerror(errno.ENOSPC) in done.stderr
    assert done.stdout.splitlines()[-1] == "ended by 1"


# ---- damaged and hostile files

Change = Callable[[Any], None]


def entry(k: int, field: str, value: int) -> Change:
    def change(group: Any) -> None:
        rows = group["entries"][:]
        rows[field][k] = value
        group["entries"][:] = rows

    return change


def end(k: int, value: int) -> Change:
    def change(group: Any) -> None:
        rows = group["steps"][:]
        rows["end"][k] = value
        group["steps"][:] = rows

    return change


def names(text: bytes) -> Change:
    def change(group: Any) -> None:
        group["names"].resize((len(text),))
        group["names"][:] = np.frombuffer(text, np.uint8)

    return change


def lacks(name: str) -> Change:
    def change(group: Any) -> None:
        del group[name]

    return change


def resized(name: str, size: int) -> Change:
    return lambda group: group[name].resize((size,))


def not_a_number(group: Any) -> None:
    group["numbers"][:] = np.nan


def steps_without(member: str) -> Change:
    def change(group: Any) -> None:
        rows = group["steps"][:]
        del group["steps"]
        kept = [name for name in rows.dtype.names if name != member]
        group.create_dataset("steps", data=rows[kept].copy(), maxshape=(None,), chunks=(8,))

    return change


def other_type(group: Any) -> None:
    del group["entries"]
    group.create_dataset("entries", data=np.zeros(20), maxshape=(None,), chunks=(8,))


DAMAGED: list[tuple[Change, str]] = [
    (end(1, 10**9), r"/fclib_sequence/steps\[1\]: has the entries \d+ to 1000000000 of"),
    (end(1, -1), r"/fclib_sequence/steps\[1\]: has the entries"),
    (end(0, 2**60), r"/fclib_sequence/steps\[1\]: has the entries"),
    (end(0, -5), r"/fclib_sequence/steps\[1\]: has the entries"),
    (
        entry(15, "start", 2**60),
        r"/fclib_sequence/entries\[15\]: .* entries from 1152921504606846976",
    ),
    (entry(15, "start", -1), r"/fclib_sequence/entries\[15\]: .* entries from -1 on"),
    (entry(15, "length", 2**31 - 1), r"/fclib_sequence/entries\[15\]: .* has 2147483647 entries"),
    (entry(15, "length", -1), r"/fclib_sequence/entries\[15\]: .* has -1 entries"),
    (entry(15, "name", 77), r"/fclib_sequence/entries\[15\]: has the name 77 of"),
    (entry(15, "name", -2), r"/fclib_sequence/entries\[15\]: has the name -2 of"),
    (entry(15, "name", 1), r"/fclib_sequence/entries\[\d+\]: has the name .* for the second time"),
    (names(b"numbers /x\n"), r"/fclib_sequence/names\[0\]: .* does not name an array"),
    (names(b"others x\n"), r"/fclib_sequence/names\[0\]: .* does not name an array"),
    (names(b"numbers " + b"a/" * 300 + b"b\n"), r"/fclib_sequence/names\[0\]"),
    (resized("names", 2**60), r"/fclib_sequence/names: has chunks that the file does not hold"),
    (names(b"numbers x\n" * 2**18), r"/fclib_sequence/names: has \d+ bytes, expected at most"),
    (
        resized("numbers", 0),
        r"/fclib_sequence/entries\[\d+\]: .* but /fclib_sequence/numbers has 0",
    ),
    (resized("steps", 1), r"/fclib_sequence: has 1 step;"),
    (resized("steps", 2**60), r"/fclib_sequence/steps: has chunks that the file does not hold"),
    (resized("entries", 2**60), r"/fclib_sequence/entries: has chunks that the file does not hold"),
    (resized("numbers", 2**60), r"/fclib_sequence/numbers: has chunks that the file does not hold"),
    (not_a_number, r"#1: /fclib_sequence/steps\[1\]: .* its checksum is wrong"),
    (steps_without("checksum"), "/fclib_sequence/steps: has no member checksum"),
    (other_type, "/fclib_sequence/entries: has entries of another type"),
    *(
        (lacks(name), f"/fclib_sequence/{name}: the dataset is missing")
        for name in ("names", "texts", "integers", "numbers", "entries", "steps")
    ),
]


@pytest.mark.parametrize(("change", "words"), DAMAGED)
def test_a_damaged_sequence_is_named(change: Change, words: str, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    record(path, 3)
    with h5py.File(path, "r+") as file:
        change(file["fclib_sequence"])
    with pytest.raises((fclib.FileError, fclib.ProblemError), match=f"{path.name}.*{words}"):
        read(f"{path}#1")


def test_what_was_never_written_is_no_number(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    record(path, 3)
    with h5py.File(path, "r+") as file:
        group = file["fclib_sequence"]
        group["numbers"].resize((10**4,))
        entry(15, "start", 9000)(group)
        entry(15, "length", 900)(group)
    with pytest.raises(fclib.FileError, match=r"numbers\[\d+\]: was never written"):
        read(f"{path}#1")


def test_a_cut_sequence_is_refused_quickly(tmp_path: Path, writer: Path) -> None:
    closed, killed = tmp_path / "closed.h5", tmp_path / "killed.h5"
    record(closed, 3000)
    with subprocess.Popen([writer, killed], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        for _ in range(5):
            process.stdout.readline()
        process.kill()
    random.seed(4)
    start = time.monotonic()
    for whole in (closed.read_bytes(), killed.read_bytes()):
        for turn in range(30):
            path, cut = tmp_path / f"cut-{turn}.h5", random.randrange(len(whole))
            damaged = bytearray(whole[:cut] if turn % 2 else whole)
            if turn % 2 == 0:
                for _ in range(20):
                    damaged[random.randrange(min(len(damaged), 4000))] = random.randrange(256)
            path.write_bytes(damaged)
            for k in range(0, 30, 7):
                with contextlib.suppress(fclib.FileError, fclib.ProblemError):
                    read(f"{path}#{k}")
    assert time.monotonic() - start < 60


FLIPS = 250
Read = tuple[fclib.Problem, fclib.Solution | None]


def check_told(path: Path, whole: list[Read]) -> int:
    """Each step is as it was written, or an error tells it. Return how many errors there are."""
    told = []
    for k, (problem, solution) in enumerate(whole):
        try:
            assert (read(f"{path}#{k}"), fclib.read_solution(f"{path}#{k}")) == (problem, solution)
        except (fclib.FileError, fclib.ProblemError) as error:
            told.append(str(error))
    assert all(path.name in words for words in told)
    return len(told)


@pytest.mark.parametrize("compression", [0, 6])
def test_a_flipped_byte_is_told(tmp_path: Path, compression: int) -> None:
    random.seed(compression)
    path, rng = tmp_path / "run.h5", np.random.default_rng(0)
    whole: list[Read] = []
    with SequenceWriter(path, compression=compression) as writer:
        for seed in range(6):
            made: Any = planted_global(seed, nc=17)
            q = made.problem.replace(f=rng.standard_normal(made.problem.n))
            whole.append((q, made.solution))
            writer.append(q, made.solution, world=seed % 2)
    assert check_told(path, whole) == 0
    intact, told = path.read_bytes(), 0
    with h5py.File(path) as file:
        used = [
            (data.id.get_chunk_info(0).byte_offset, data.id.get_storage_size())
            for data in file["fclib_sequence"].values()
            if data.size
        ]
    for flip in range(FLIPS):
        # of the headers, or of one of the datasets
        start, size = random.choice([(0, len(intact)), *used]) if flip % 2 else (0, len(intact))
        damaged = bytearray(intact)
        damaged[start + random.randrange(min(size, len(intact) - start))] ^= 1 << flip % 8
        path.write_bytes(damaged)
        told += check_told(path, whole) > 0
    assert told > FLIPS // 4
    path.write_bytes(intact)
    with h5py.File(path, "r+") as file:
        file["fclib_sequence/numbers"][5] += 1e-12
    done = run("check", path, code=1)
    assert "steps[0]: is not as it was written: its checksum is wrong" in done.stderr


def test_options_are_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    for compression in (-1, 10, 99):
        with pytest.raises(fclib.OptionError, match=f"compression.*is {compression}, but must be"):
            SequenceWriter(path, compression=compression)
        assert not path.exists()
    with SequenceWriter(path) as writer:
        writer.append(step(0))
        with pytest.raises(fclib.OptionError, match="world: is -1, but must be 0 or more"):
            writer.append(step(1), world=-1)
        writer.append(step(2))
    assert [problem.q[0] for problem in Sequence(path)] == [0, -2]


TWICE = r"""
#include <fclib.h>
#include <stdio.h>

int main(int argc, char **argv) {
  double x[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, q[3] = {-1, 0, 0}, mu[1] = {0.5};
  struct fclib_matrix W = {9, 3, 3, NULL, NULL, x, -3, NULL};
  struct fclib_local problem = {&W, NULL, NULL, mu, q, NULL, 3, NULL};
  struct fclib_solution solution = {NULL, q, q, NULL};
  struct fclib_sequence *sequence = fclib_sequence_create(argv[argc - 1], NULL);
  if (fclib_sequence_add_solution(sequence, &solution)) return 1;
  printf("%s\n", fclib_last_error());
  if (fclib_sequence_add_local(sequence, &problem, -1)) return 1;
  printf("%s\n", fclib_last_error());
  if (!fclib_sequence_add_local(sequence, &problem, 7)) return 1;
  if (!fclib_sequence_add_solution(sequence, &solution)) return 1;
  if (fclib_sequence_add_solution(sequence, &solution)) return 1;
  printf("%s\n", fclib_last_error());
  if (!fclib_sequence_add_guesses(sequence, 1, &solution)) return 1;
  return !fclib_sequence_close(sequence);
}
"""


def test_c_refuses_what_would_spoil_a_step(tmp_path: Path) -> None:
    path, source = tmp_path / "run.h5", tmp_path / "twice.c"
    source.write_text(TWICE)
    program = compile_program(source, tmp_path / "twice")
    first, second, third = ran(program, path).stdout.splitlines()
    assert "its problem comes first" in first
    assert "world: is -1, but must be 0 or more" in second
    assert "/solution/u: was already given to this step" in third
    steps = Sequence(path)
    assert (steps.worlds, steps.numbers) == ([7], [0])
    assert steps.solution(0) == fclib.Solution(r=[-1, 0, 0], u=[-1, 0, 0])
    assert len(steps.guesses(0)) == 1


def test_all_that_is_confirmed_is_read_while_it_grows(writer: Path, tmp_path: Path) -> None:
    path, rounds, last = tmp_path / "run.h5", 0, 0
    with subprocess.Popen([writer, path], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        end = time.monotonic() + 3
        while time.monotonic() < end:
            count = check_whole(path, last)
            rounds, last = rounds + (count > last), count
        process.kill()
    assert rounds > 5


# ---- the commands


def told(*arguments: object) -> list[dict[str, Any]]:
    done = run(*arguments, "--json")
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.fixture
def solved(tmp_path: Path) -> Path:
    path = tmp_path / "run.h5"
    with SequenceWriter(path) as writer:
        for seed in range(4):
            made = planted_local(seed)
            writer.append(made.problem, made.solution)
    return path


def test_a_sequence_without_a_step_is_no_success(tmp_path: Path) -> None:
    path = tmp_path / "empty.h5"
    record(path, 0)
    assert len(Sequence(path)) == 0
    for words in (("check", path), ("info", path), ("solve", path), ("judge", path)):
        done = run(*words, code=1)
        assert f"{path}: /: is a sequence in which there is no step" in done.stderr
    campaign = tmp_path / "empty.toml"
    campaign.write_text(
        'name = "empty"\nsolvers = ["auto"]\ntolerances = [1e-8]\n'
        f'[[problems]]\nfiles = ["{path}"]\n'
    )
    done = run("bench", campaign, "--store", tmp_path / "empty.sqlite", code=1)
    assert "is a sequence in which there is no step" in " ".join(done.stderr.split())


def test_commands_take_a_sequence_and_its_steps(solved: Path) -> None:
    for command, status in (("info", None), ("check", "ok"), ("solve", "converged")):
        records = told(command, solved)
        assert [one["problem"] for one in records] == [f"{solved}#{k:06d}" for k in range(4)]
        assert all(one.get("status") == status for one in records)
        assert len(told(command, f"{solved}#2")) == 1


def test_a_step_is_viewed(solved: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    run("view", f"{solved}#1", "--out", page)
    assert page.stat().st_size > 0


def test_steps_become_files(solved: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run("convert", solved, "--out", out)
    files = sorted(out.iterdir())
    assert [file.name for file in files] == [f"run-{k:06d}.hdf5" for k in range(4)]
    for k, file in enumerate(files):
        assert read(file) == read(f"{solved}#{k}")
        assert fclib.read_solution(file) == fclib.read_solution(f"{solved}#{k}")
    one = tmp_path / "one.hdf5"
    run("convert", f"{solved}#3", one)
    assert read(one) == read(files[3])


def test_a_campaign_solves_the_steps(solved: Path, tmp_path: Path) -> None:
    store = tmp_path / "mine.sqlite"
    campaign = tmp_path / "mine.toml"
    campaign.write_text(
        f'name = "mine"\nsolvers = ["nsgs"]\ntolerances = [1e-6]\n'
        f'[[problems]]\nfiles = ["{solved}"]\n'
    )
    run("bench", campaign, "--store", store)
    with sqlite3.connect(store) as db:
        assert db.execute("SELECT count(*) FROM runs").fetchone() == (4,)
        rows = db.execute("SELECT name, family FROM problems ORDER BY name").fetchall()
    assert rows == [(f"run-{k:06d}", "run") for k in range(4)]
    run("bench", campaign, "--store", store)


def test_a_collection_takes_steps_in(solved: Path, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    out = tmp_path / "collection"
    source = tmp_path / "source"
    source.mkdir()
    shutil.move(solved, source / "run.h5")
    for count in (4, 5):
        run("collection", "add", source, "--out", out, "--name", "mine")
        files = sorted((out / "mine").rglob("*.hdf5"))
        assert len(files) == count
        # the next step is a new problem, and those that were there stay
        with SequenceWriter(source / "run.h5", mode="add") as writer:
            made = planted_local(count)
            writer.append(made.problem, made.solution)
    assert read(files[2]) == planted_local(2).problem


def test_sequences_follow_a_file(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with SequenceWriter(path) as writer:
        for k in range(6):
            made = planted_local(k)
            writer.append(made.problem, made.solution, world=k % 2)
    found = list(fclib.sequence(str(path)))
    assert [(one.step, one.before and one.before.id) for one in found] == [
        (k // 2, f"{path}#{k - 2:06d}" if k > 1 else None) for k in range(6)
    ]


# ---- libfclib 3.1


def test_libfclib_3_1_says_that_it_reads_none(solved: Path, tmp_path: Path) -> None:
    if not PEER.is_file():
        pytest.skip("libfclib 3.1 is not installed")
    source = tmp_path / "peer.c"
    source.write_text(
        "#include <fclib.h>\n#include <stddef.h>\nint main(int argc, char **argv) {\n"
        "  (void)argc;\n  return fclib_read_local(argv[1]) == NULL ? 3 : 0;\n}\n"
    )
    program = tmp_path / "peer"
    subprocess.run(["cc", source, "-o", program, "-lfclib"], check=True)
    done = ran(program, solved, code=None, timeout=60)
    assert done.returncode > 0, "it ended by a signal, or read something"
    assert "fclib_local" in done.stderr or "problem" in done.stderr, done.stderr
    plain = tmp_path / "plain.hdf5"
    run("convert", f"{solved}#1", plain)
    assert subprocess.run([program, plain], timeout=60).returncode == 0


def test_other_files_are_not_disturbed(tmp_path: Path) -> None:
    """Damaged files that are no sequences fail as before, without waiting."""
    path = tmp_path / "damaged.hdf5"
    fclib.write(path, step(0))
    whole = bytearray(path.read_bytes())
    whole[40:60] = os.urandom(20)
    path.write_bytes(whole)
    start = time.monotonic()
    with pytest.raises(fclib.FileError):
        read(path)
    assert time.monotonic() - start < 5
