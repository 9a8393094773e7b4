"""A writer that is killed at any moment leaves the old file or the new one, whole."""

import os
import random
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

from capi_library import compile_program
from helpers import ran

KILLS = 150
TIME_LIMIT = 600.0  # seconds for all of them, on a machine however busy
SIZES = (30, 900)  # contacts of the problems that take turns, of one chunk and of several

# writes problems in turn, for ever: replaces the problem, then its solution, of a file
WRITER = r"""
#include <fclib.h>
#include <stdio.h>
#include <stdlib.h>

int main(int argc, char **argv) {
  if (argc < 4) return 2;
  fclib_set_write_mode(FCLIB_WRITE_REPLACE);
  for (int turn = 0;; turn++) {
    int nc = atoi(argv[2 + turn % 2]), m = 3 * nc, width = 9;
    struct fclib_matrix W = {m * width, m, m, NULL, NULL, NULL, -1, NULL};
    W.p = malloc(sizeof(int) * (size_t)(m + 1));
    W.i = malloc(sizeof(int) * (size_t)(m * width));
    W.x = malloc(sizeof(double) * (size_t)(m * width));
    double *q = malloc(sizeof(double) * (size_t)m), *mu = malloc(sizeof(double) * (size_t)nc);
    for (int k = 0; k <= m; k++) W.p[k] = k * width;
    for (int k = 0; k < m * width; k++) W.i[k] = k * 7 % m;
    for (int k = 0; k < m * width; k++) W.x[k] = nc + k / 3.0;
    for (int k = 0; k < m; k++) q[k] = nc;
    for (int k = 0; k < nc; k++) mu[k] = 0.5;
    struct fclib_local problem = {&W, NULL, NULL, mu, q, NULL, 3, NULL};
    struct fclib_solution solution = {NULL, q, q, NULL};
    if (!fclib_write_local(&problem, argv[1]) || !fclib_write_solution(&solution, argv[1])) {
      fprintf(stderr, "%s\n", fclib_last_error());
      return 1;
    }
    if (!turn) puts("started"), fflush(stdout);
    free(W.p), free(W.i), free(W.x), free(q), free(mu);
  }
}
"""

# reads a file; says which of the problems it is, and that all of it is of that one
READER = r"""
#include <fclib.h>
#include <stdio.h>
#include <stdlib.h>

int main(int argc, char **argv) {
  char path[4096];
  (void)argc, (void)argv;
  while (scanf("%4095s", path) == 1) {
    struct fclib_local *a = fclib_read_local(path);
    if (!a) return fprintf(stderr, "%s\n", fclib_last_error()), 1;
    int m = a->W->m, nc = m / 3, whole = 1;
    for (int k = 0; k < a->W->nzmax; k++) whole &= a->W->x[k] == nc + k / 3.0;
    for (int k = 0; k < m; k++) whole &= a->q[k] == nc;
    struct fclib_solution *s = fclib_read_solution(path);
    for (int k = 0; s && k < m; k++) whole &= s->u[k] == nc && s->r[k] == nc;
    printf("%d %d %s\n", nc, whole, s ? "solved" : "unsolved");
    fclib_delete_solutions(s, 1);
    fclib_delete_local(a);
    free(a);
  }
  return 0;
}
"""


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("kill")
    made = []
    for name, code in (("writer", WRITER), ("reader", READER)):
        source = folder / f"{name}.c"
        source.write_text(code)
        made.append(compile_program(source, folder / name))
    return made[0], made[1]


def unnamed_files(folder: Path) -> bool:
    """Whether the file system has files without a name."""
    try:
        os.close(os.open(folder, os.O_TMPFILE | os.O_WRONLY))
    except (AttributeError, OSError):
        return False
    return True


def two_turns(writer: Path, path: Path) -> float:
    """Leaves a file there. Time from a start until both problems were written, on this machine."""
    start = time.monotonic()
    with subprocess.Popen([writer, path, *map(str, SIZES)], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"started\n"
        inode, changes = path.stat().st_ino, 0
        while changes < 2 and time.monotonic() - start < TIME_LIMIT:  # the problem, its solution
            time.sleep(0.001)
            now = path.stat().st_ino
            changes, inode = changes + (now != inode), now
        process.kill()
    return time.monotonic() - start


@pytest.mark.slow
def test_a_killed_writer_leaves_a_whole_file(programs: tuple[Path, Path], tmp_path: Path) -> None:
    writer, reader = programs
    random.seed(1)
    path = tmp_path / "problem.hdf5"
    kept: list[Path] = []
    longest = max(0.05, 1.5 * two_turns(writer, path))  # s from a start to its kill
    start = time.monotonic()
    while len(kept) < KILLS and time.monotonic() - start < TIME_LIMIT:
        process = subprocess.Popen(
            [writer, path, *map(str, SIZES)], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        assert process.stdout is not None
        assert process.stderr is not None
        with process.stdout, process.stderr:
            time.sleep(random.uniform(0, longest))
            process.send_signal(signal.SIGKILL)
            assert process.wait() == -signal.SIGKILL, process.stderr.read()
        # the file as it is now, under a name of its own
        kept.append(tmp_path / f"after-{len(kept)}.hdf5")
        shutil.copyfile(path, kept[-1])
    assert len(kept) == KILLS
    if unnamed_files(tmp_path):
        # a kill may still come between the naming of a new file and its renaming
        left = set(tmp_path.iterdir()) - {path, *kept}
        assert len(left) <= len(kept) // 20, left

    done = ran(reader, input="\n".join(map(str, kept)), timeout=300)
    found = [line.split() for line in done.stdout.splitlines()]
    assert len(found) == len(kept)
    assert {whole for _, whole, _ in found} == {"1"}
    # the kills came at different moments
    assert {int(size) for size, _, _ in found} == set(SIZES)
    assert {state for _, _, state in found} == {"solved", "unsolved"}
