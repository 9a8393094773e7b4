"""What it costs to record steps of 17 contacts in one file: CPU time and bytes of a step.

    python -m workshop.tables.sequence_file [--steps 10000] [--plain 300] [--solved 10000]
        [--results NAME]

Each step is a global problem of 17 contacts between two bodies, of which H, f and w are new, and
M, the pattern of H and mu are those of the step before. C and Python put the steps into a sequence,
without and with a flush after each, and some of them into files of their own, uncompressed. The
Python programs have made their problems before. The bytes are divided by those of the numbers that
are new in a step (8 each). Then each step is read by its number, and `fclib bench` solves the steps
from the one file, of C and of Python: CPU time of all its processes.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

import fclib
from workshop.tables import _results
from workshop.tables._c_library import c_library

CONTACTS, BODIES = 17, 2
M, N = 3 * CONTACTS, 6 * BODIES
NUMBERS = 8 * (6 * M + N + M)  # bytes of the numbers that are new in a step


def problems(count: int) -> list[fclib.GlobalProblem]:
    """Problems as the C program has them, with other numbers."""
    rng = np.random.default_rng(1)
    columns = np.repeat(np.arange(M), 6)
    rows = columns // 3 % BODIES * 6 + np.tile(np.arange(6), M)
    mass = sp.csc_array(sp.diags_array(np.arange(1.0, N + 1)))
    return [
        fclib.GlobalProblem(
            spacedim=3,
            M=mass,
            H=sp.csc_array((rng.uniform(-0.5, 0.5, 6 * M), (rows, columns)), shape=(N, M)),
            f=rng.uniform(-0.5, 0.5, N),
            w=np.abs(rng.uniform(-0.5, 0.5, M)),
            mu=np.full(CONTACTS, 0.5),
        )
        for _ in range(count)
    ]


def of_c(folder: Path, steps: int, plain: int) -> dict[str, tuple[float, float]]:
    """CPU seconds and bytes of a step by the way, from C."""
    library = c_library()
    program = folder / "sequence_file"
    here = Path(__file__).resolve().parent
    command = ["cc", "-O2", str(here / "sequence_file.c"), "-o", str(program)]
    flags = [f"-I{here.parents[1] / 'include'}", f"-L{library.parent}", "-lfclib"]
    subprocess.run([*command, *flags, f"-Wl,-rpath,{library.parent}"], check=True)
    done = subprocess.run(
        [program, folder, str(steps), str(plain)], capture_output=True, text=True, check=True
    )
    words = (line.split() for line in done.stdout.splitlines())
    return {way: (float(seconds), float(size)) for way, seconds, size in words}


def of_python(folder: Path, steps: int, plain: int) -> dict[str, tuple[float, float]]:
    """The same from Python."""
    made, found = problems(steps), {}
    for way in ("sequence", "flushed"):
        path = folder / f"python-{way}.h5"
        start = time.process_time()
        with fclib.SequenceWriter(path) as writer:
            for k in range(steps):
                writer.append(made[k])
                if way == "flushed":
                    writer.flush()
        found[way] = (time.process_time() - start) / steps, path.stat().st_size / steps
    paths = [folder / f"python-{k}.hdf5" for k in range(plain)]
    start = time.process_time()
    for k, path in enumerate(paths):
        fclib.write(path, made[k], compression=0, sync=False)
    if plain:
        size = sum(path.stat().st_size for path in paths) / plain
        found["plain"] = (time.process_time() - start) / plain, size
    return found


def read_all(path: Path) -> float:
    """CPU seconds of a step that is read."""
    start, steps = time.process_time(), fclib.Sequence(path)
    for _ in steps:
        pass
    return (time.process_time() - start) / len(steps)


def solved(folder: Path, path: Path, count: int) -> tuple[int, float]:
    """How many steps a campaign solves from the file, and its CPU seconds of a step."""
    import sqlite3

    store, campaign = (folder / f"{path.stem}.{kind}" for kind in ("sqlite", "toml"))
    campaign.write_text(
        'name = "steps"\nsolvers = ["auto"]\ntolerances = [1e-8]\n'
        f'[[problems]]\nfiles = ["{path}"]\nsample = {count}\n'
    )
    start = cpu_of_children()
    subprocess.run(["fclib", "bench", campaign, "--store", store], check=True, stdout=2)
    seconds = (cpu_of_children() - start) / count
    with sqlite3.connect(store) as db:
        (done,) = db.execute("SELECT count(*) FROM results WHERE status = 'converged'").fetchone()
    return done, seconds


def cpu_of_children() -> float:
    """CPU seconds of all processes that this one has waited for, and of theirs."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


WAYS = {
    "sequence": "one sequence",
    "flushed": "one sequence, each step confirmed at once",
    "plain": "a file for each step",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--plain", type=int, default=300)
    parser.add_argument("--solved", type=int, default=10_000)
    _results.add_option(parser)
    given = parser.parse_args()
    rows: list[dict[str, Any]] = []

    def tell(what: str, seconds: float, size: float | None) -> None:
        row = {
            "17 contacts a step": what,
            "CPU time of a step [ms]": 1e3 * seconds,
            "bytes of a step": "" if size is None else round(size),
            "bytes : new numbers": "" if size is None else size / NUMBERS,
        }
        rows.append(row)
        print(*row.values(), sep="  ")

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for language, measure in (("C", of_c), ("Python", of_python)):
            for way, (seconds, size) in measure(folder, given.steps, given.plain).items():
                tell(f"{language}, {WAYS[way]}", seconds, size)
        paths = {"C": folder / "c-0.h5", "Python": folder / "python-sequence.h5"}
        tell("read by its number, Python", read_all(paths["Python"]), None)
        note = f"{given.steps} steps, {given.plain} files."
        os.environ["PATH"] = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        for language, path in paths.items() if given.solved else ():
            done, seconds = solved(folder, path, given.solved)
            tell(f"solved to 1e-8 by a campaign, recorded from {language}", seconds, None)
            note += f" Of those from {language} the campaign solved {done} of {given.solved}."
        print(note)
    if given.results:
        _results.store(given.results, rows, title="Recording steps of 17 contacts", note=note)


if __name__ == "__main__":
    main()
