"""Files go both ways between us and libfclib 3.1, and Siconos agrees with what they mean.

Each part is skipped where the other program is not installed.
"""

import itertools
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp

import browser_module
import fclib
import odd_files
import odd_layouts
from ball_judge import judge
from capi_library import library_folder
from fclib import scenes
from helpers import dense, planted_global, planted_local, planted_spin, ran

# prints a file as JSON, every number of it; or writes a problem of known numbers
PEER = r"""
#include <fclib.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void ints(const char *name, const int *x, int n) {
  printf("\"%s\": [", name);
  for (int k = 0; k < n; k++) printf("%s%d", k ? ", " : "", x[k]);
  printf("], ");
}
static void numbers(const char *name, const double *x, int n) {
  printf("\"%s\": ", name);
  if (!x) { printf("null, "); return; }
  printf("[");
  for (int k = 0; k < n; k++) printf("%s%.17g", k ? ", " : "", x[k]);
  printf("], ");
}
static void matrix(const char *name, const struct fclib_matrix *a) {
  printf("\"%s\": ", name);
  if (!a) { printf("null, "); return; }
  int p = a->nz >= 0 ? a->nz : (a->nz == -1 ? a->n : a->m) + 1;
  int entries = a->nz >= 0 ? a->nz : a->p[p - 1];
  printf("{");
  ints("p", a->p, p);
  ints("i", a->i, entries);
  numbers("x", a->x, entries);
  printf("\"m\": %d, \"n\": %d, \"nz\": %d, \"nzmax\": %d}, ", a->m, a->n, a->nz, a->nzmax);
}
static int with_solution; /* 3.1 ends the process where it is asked for one that is not there */
static void solution(const char *path, int n, int m, int p) {
  printf("\"solution\": ");
  if (!with_solution) { printf("null, "); return; }
  struct fclib_solution *s = fclib_read_solution(path);
  printf("{");
  numbers("v", s->v, n);
  numbers("u", s->u, m);
  numbers("r", s->r, m);
  numbers("l", s->l, p);
  printf("\"end\": 0}, ");
}
static void info(const struct fclib_info *i) {
  printf("\"title\": \"%s\", ", i && i->title ? i->title : "");
}
static int show_local(const char *path) {
  struct fclib_local *a = fclib_read_local(path);
  if (!a) return 1;
  printf("{\"spacedim\": %d, ", a->spacedim);
  int m = a->W->m, p = a->R ? a->R->m : 0;
  matrix("W", a->W); matrix("V", a->V); matrix("R", a->R);
  numbers("q", a->q, m); numbers("mu", a->mu, m / a->spacedim); numbers("s", a->s, p);
  info(a->info);
  solution(path, 0, m, p);
  printf("\"end\": 0}\n");
  return 0;
}
static int show_global(const char *path) {
  struct fclib_global *a = fclib_read_global(path);
  if (!a) return 1;
  printf("{\"spacedim\": %d, ", a->spacedim);
  int n = a->M->m, m = a->H->n, p = a->G ? a->G->n : 0;
  matrix("M", a->M); matrix("H", a->H); matrix("G", a->G);
  numbers("f", a->f, n); numbers("w", a->w, m); numbers("mu", a->mu, m / a->spacedim);
  numbers("b", a->b, p);
  info(a->info);
  solution(path, n, m, p);
  printf("\"end\": 0}\n");
  return 0;
}

/* a known matrix: entry (i, j) is 1 + i + j / 4 where i + 2 j is a multiple of 3 */
static struct fclib_matrix *known(int m, int n, const char *storage) {
  struct fclib_matrix *a = calloc(1, sizeof *a);
  int rows = !strcmp(storage, "csr"), outer = rows ? m : n, inner = rows ? n : m, k = 0;
  int triplet = !strcmp(storage, "triplet");
  a->m = m; a->n = n;
  a->p = calloc(m * n + m + n + 2, sizeof(int));
  a->i = calloc(m * n + 1, sizeof(int));
  a->x = calloc(m * n + 1, sizeof(double));
  for (int o = 0; o < outer; o++) {
    for (int e = 0; e < inner; e++) {
      int i = rows ? o : e, j = rows ? e : o;
      if ((i + 2 * j) % 3) continue;
      if (triplet) { a->i[k] = i; a->p[k] = j; } else a->i[k] = e;
      a->x[k++] = 1 + i + j / 4.0;
    }
    if (!triplet) a->p[o + 1] = k;
  }
  a->nzmax = k;
  a->nz = triplet ? k : rows ? -2 : -1;
  if (m == n) {
    a->info = calloc(1, sizeof *a->info);
    a->info->comment = strdup("known"); a->info->conditioning = 2; a->info->rank = m;
  }
  return a;
}
static double *ramp(int n, double first) {
  double *x = calloc(n + 1, sizeof(double));
  for (int k = 0; k < n; k++) x[k] = first + k / 8.0;
  return x;
}
static struct fclib_info *about(void) {
  struct fclib_info *i = calloc(1, sizeof *i);
  i->title = strdup("a title");
  i->description = strdup("made by 3.1");
  i->math_info = strdup("none");
  return i;
}
static int make(const char *path, const char *kind, const char *storage, int d, int nc, int n,
                int p) {
  int m = d * nc, ok;
  struct fclib_solution s = {ramp(n, 1), ramp(m, 2), ramp(m, 3), p ? ramp(p, 4) : NULL};
  if (!strcmp(kind, "local")) {
    struct fclib_local a = {0};
    a.W = known(m, m, storage);
    if (p) { a.V = known(m, p, storage); a.R = known(p, p, storage); a.s = ramp(p, 0.5); }
    a.q = ramp(m, -1); a.mu = ramp(nc, 0.25); a.spacedim = d; a.info = about();
    s.v = NULL;
    ok = fclib_write_local(&a, path);
  } else {
    struct fclib_global a = {0};
    a.M = known(n, n, storage); a.H = known(n, m, storage);
    if (p) { a.G = known(n, p, storage); a.b = ramp(p, 0.5); }
    a.f = ramp(n, -2); a.w = ramp(m, -1); a.mu = ramp(nc, 0.25); a.spacedim = d; a.info = about();
    ok = fclib_write_global(&a, path);
  }
  /* 3.1 takes no solution without contacts */
  return !ok || (m && !fclib_write_solution(&s, path));
}
int main(int argc, char **argv) {
  with_solution = argc == 5;
  if (argc <= 5 && !strcmp(argv[1], "show"))
    return !strcmp(argv[2], "local") ? show_local(argv[3]) : show_global(argv[3]);
  if (argc == 9)
    return make(argv[2], argv[3], argv[4], atoi(argv[5]), atoi(argv[6]), atoi(argv[7]),
                atoi(argv[8]));
  return 2;
}
"""

Peer = Callable[..., str]


@pytest.fixture(scope="module")
def peer_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A program that uses libfclib 3.1."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    config = shutil.which("pkg-config")
    if compiler is None or config is None:
        pytest.skip("there is no C compiler, or no pkg-config")
    flags = ran(config, "--cflags", "--libs", "fclib", "hdf5", code=None)
    version = ran(config, "--modversion", "fclib", code=None)
    if flags.returncode or not version.stdout.startswith("3.1"):
        pytest.skip("libfclib 3.1 is not installed")
    folder = tmp_path_factory.mktemp("peer")
    source, program = folder / "peer.c", folder / "peer"
    source.write_text(PEER)
    subprocess.run(
        [compiler, "-std=gnu11", "-o", program, source, *flags.stdout.split()], check=True
    )
    return program


@pytest.fixture(scope="module")
def peer(peer_program: Path) -> Peer:
    """Runs that program, which must succeed."""

    def run(*arguments: object) -> str:
        done = ran(peer_program, *arguments, timeout=300)
        return done.stdout

    return run


def unpack(a: dict[str, Any]) -> Any:
    """The matrix that 3.1 read."""
    shape = (a["m"], a["n"])
    if a["nz"] >= 0:
        return sp.coo_array((a["x"], (a["i"], a["p"])), shape=shape)
    make = sp.csc_array if a["nz"] == -1 else sp.csr_array
    return make((a["x"], a["i"], a["p"]), shape=shape)


def assert_seen(problem: fclib.Problem, solution: fclib.Solution | None, seen: Any) -> None:
    """What 3.1 read is what we wrote, every number."""
    assert seen["spacedim"] == problem.spacedim
    assert seen["title"] == problem.info.title
    local = isinstance(problem, fclib.LocalProblem)
    for name in ("q", "mu", "s") if local else ("f", "w", "mu", "b"):
        ours = getattr(problem, name)
        if ours is None:
            assert not seen[name]
        else:
            np.testing.assert_array_equal(seen[name], ours, err_msg=name)
    for name in ("W", "V", "R") if local else ("M", "H", "G"):
        ours = getattr(problem, name)
        if ours is None:
            assert seen[name] is None
        else:
            np.testing.assert_array_equal(dense(unpack(seen[name])), dense(ours), err_msg=name)
    if solution is None:
        assert seen["solution"] is None
        return
    for name in ("v", "u", "r", "l"):
        ours = getattr(solution, name)
        if ours is not None:
            np.testing.assert_array_equal(seen["solution"][name], ours, err_msg=name)


# ---- ours, read by libfclib 3.1


@pytest.mark.parametrize("mixed", [0, 2])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("storage", ["csr", "csc", "coo"])
@pytest.mark.parametrize("kind", ["local", "global"])
def test_libfclib_reads_ours(
    peer: Peer, tmp_path: Path, kind: str, storage: str, d: int, mixed: int
) -> None:
    make = planted_local if kind == "local" else planted_global
    case = make(1, d=d, nc=3, p=mixed, storage=storage)
    path = tmp_path / "ours.hdf5"
    fclib.write(path, case.problem, case.solution)
    assert_seen(case.problem, case.solution, json.loads(peer("show", kind, path, "solution")))


@pytest.mark.parametrize("kind", ["local", "global"])
def test_libfclib_reads_our_compressed_datasets(peer: Peer, tmp_path: Path, kind: str) -> None:
    case = planted_local(1, nc=90) if kind == "local" else planted_global(1, nc=25)
    path = tmp_path / "large.hdf5"
    fclib.write(path, case.problem, case.solution)
    with h5py.File(path) as file:
        group = file[f"fclib_{kind}/{'W' if kind == 'local' else 'M'}"]
        assert group["x"].chunks is not None
        assert group["i"].compression == "gzip"
    assert_seen(case.problem, case.solution, json.loads(peer("show", kind, path, "solution")))


@pytest.mark.parametrize("kind", ["local", "global"])
@pytest.mark.parametrize("mixed", [0, 2])
def test_libfclib_reads_a_solution_of_reactions_alone(
    peer: Peer, tmp_path: Path, kind: str, mixed: int
) -> None:
    case = (planted_local if kind == "local" else planted_global)(1, nc=2, p=mixed)
    solution = fclib.Solution(r=case.solution.r, l=case.solution.l)
    fclib.write(tmp_path / "p.hdf5", case.problem, solution)
    seen = json.loads(peer("show", kind, tmp_path / "p.hdf5", "solution"))
    assert_seen(case.problem, solution, seen)


@pytest.mark.parametrize("kind", ["local", "global"])
def test_libfclib_refuses_a_file_of_spin(peer_program: Path, tmp_path: Path, kind: str) -> None:
    problem, r = planted_spin("product", 4, 0)
    fclib.write(tmp_path / "spin.hdf5", problem, fclib.Solution(r=r))
    done = ran(peer_program, "show", kind, tmp_path / "spin.hdf5", code=1)
    # it ends its process with an error, as for every file without its group, and does not crash
    assert f"fclib_{kind}" in done.stderr


def test_libfclib_reads_a_title(peer: Peer, tmp_path: Path) -> None:
    info = fclib.ProblemInfo(title="Ten boxes", description="d", math_info="m")
    problem = fclib.LocalProblem(W=sp.csr_array(np.eye(3)), q=[-1, 0, 0], mu=[0.5], info=info)
    fclib.write(tmp_path / "p.hdf5", problem)
    seen = json.loads(peer("show", "local", tmp_path / "p.hdf5"))
    assert seen["title"] == "Ten boxes"


@pytest.mark.parametrize("form", ["local", "global"])
def test_libfclib_passes_over_contacts_and_bodies(peer: Peer, tmp_path: Path, form: str) -> None:
    problem, solution = with_geometry(form)
    fclib.write(tmp_path / "p.hdf5", problem, solution)
    assert_seen(problem, solution, json.loads(peer("show", form, tmp_path / "p.hdf5", "solution")))


def with_geometry(form: str) -> tuple[Any, fclib.Solution]:
    """A problem that says where its contacts and bodies are, and a solution."""
    wall = scenes.Assembled(family=scenes.assemblies()["Wall"](), seed=0).problem(2)
    problem = wall if form == "global" else wall.condense()
    assert problem.contacts is not None
    assert problem.bodies is not None
    return problem, fclib.solve(problem, tol=1e-6).solution


def test_libfclib_reads_a_problem_without_contacts(peer: Peer, tmp_path: Path) -> None:
    for d, kind in itertools.product([2, 3], ["local", "global"]):
        problem: fclib.Problem = (
            fclib.LocalProblem(spacedim=d, W=sp.csr_array((0, 0)), q=[], mu=[])
            if kind == "local"
            else planted_global(1, d=d, nc=0).problem
        )
        path = tmp_path / f"{kind}{d}.hdf5"
        fclib.write(path, problem)
        seen = json.loads(peer("show", kind, path))
        assert seen["mu"] == []
        assert_seen(problem, None, seen)


# ---- theirs, read by us


def known(m: int, n: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    i, j = np.indices((m, n))
    return np.where((i + 2 * j) % 3 == 0, 1 + i + j / 4, 0.0)


def ramp(n: int, first: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    return first + np.arange(n) / 8


@pytest.mark.parametrize("p", [0, 2])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("storage", ["csr", "csc", "triplet"])
@pytest.mark.parametrize("kind", ["local", "global"])
def test_we_read_what_libfclib_writes(
    peer: Peer, tmp_path: Path, kind: str, storage: str, d: int, p: int
) -> None:
    nc, n = 3, 10
    m = d * nc
    path = tmp_path / "theirs.hdf5"
    peer("make", path, kind, storage, d, nc, n, p)
    problem, solution = fclib.read(path), fclib.read_solution(path)
    assert (problem.kind, problem.spacedim, problem.m, problem.p) == (kind, d, m, p)
    assert problem.info.title == "a title"
    assert problem.info.description == "made by 3.1"
    np.testing.assert_array_equal(problem.mu, ramp(nc, 0.25))
    local = (fclib.LocalProblem, fclib.LocalRollingProblem, fclib.LocalSpinProblem)
    if isinstance(problem, local):
        np.testing.assert_array_equal(dense(problem.W), known(m, m))
        np.testing.assert_array_equal(problem.q, ramp(m, -1))
        if p:
            np.testing.assert_array_equal(dense(problem.V), known(m, p))
            np.testing.assert_array_equal(dense(problem.R), known(p, p))
            np.testing.assert_array_equal(problem.s, ramp(p, 0.5))
    else:
        np.testing.assert_array_equal(dense(problem.M), known(n, n))
        np.testing.assert_array_equal(dense(problem.H), known(n, m))
        np.testing.assert_array_equal(problem.f, ramp(n, -2))
        np.testing.assert_array_equal(problem.w, ramp(m, -1))
        if p:
            np.testing.assert_array_equal(dense(problem.G), known(n, p))
            np.testing.assert_array_equal(problem.b, ramp(p, 0.5))
    assert solution is not None
    for name, size, first in (("u", m, 2), ("r", m, 3), ("l", p, 4)):
        if size:
            np.testing.assert_array_equal(getattr(solution, name), ramp(size, first))


def test_what_libfclib_wrote_goes_on_through_us_and_back(peer: Peer, tmp_path: Path) -> None:
    for kind, storage in itertools.product(["local", "global"], ["csr", "csc", "triplet"]):
        theirs, ours = tmp_path / f"{kind}-{storage}.hdf5", tmp_path / "ours.hdf5"
        peer("make", theirs, kind, storage, 3, 2, 7, 2)
        problem, solution = fclib.read(theirs), fclib.read_solution(theirs)
        fclib.write(ours, problem, solution)
        assert_seen(problem, solution, json.loads(peer("show", kind, ours, "solution")))
        # the solution of their file is replaced in place
        assert solution is not None
        changed = fclib.Solution(v=solution.v, u=solution.u, r=2 * solution.r, l=solution.l)
        fclib.write_solution(theirs, changed)
        assert_seen(problem, changed, json.loads(peer("show", kind, theirs, "solution")))


def test_we_read_what_libfclib_writes_without_contacts(peer: Peer, tmp_path: Path) -> None:
    for kind, d in itertools.product(["local", "global"], [2, 3]):
        path = tmp_path / f"{kind}{d}.hdf5"
        peer("make", path, kind, "triplet" if kind == "global" else "csr", d, 0, 5, 0)
        problem = fclib.read(path)
        assert (problem.kind, problem.nc, problem.m) == (kind, 0, 0)
        assert fclib.solve(problem).converged


# what 3.1 reads, and we refuse or read otherwise
WRONG_IN_3_1 = {
    "a vector longer": "it writes past an array",
    "pointers longer": "it writes past an array",
    "triplets not counted": "it writes past an array",
    "two numbers for one": "it writes past a number",
    "nzmax too small": "it writes past an array",
    "a vector shorter": "it hands out numbers that are in no file",
    "entries shorter": "it hands out numbers that are in no file",
    "integers beyond 32 bits": "it clips them",
    "no integers": "it cuts them",
    "truth values": "it takes them for numbers",
    "scale-offset": "HDF5 trusts what it unpacks, and a damaged file may end the process",
    "a vector never written": "it takes fill values for data",
    "pointers never written": "it takes fill values for data",
    "values never written": "it takes fill values for data",
    "values never written in chunks": "it takes fill values for data",
    "values with a fill value": "it takes fill values for data",
    "values half written": "it takes fill values for data",
    "a triangle": "it takes a triangle for the whole matrix",
    "nothing as a title": "it asks for no memory",
    "no mu": "it asks for no memory",
    "no spacedim": "it hands out a number that is in no file",
    "labels": "it takes them for numbers",
    "n-bit": "HDF5 trusts what it unpacks, as in scale-offset",
    "data in another file": "a file could show what its reader may read, and its sender may not",
    "a view of another file": "as data in another file",
    "a link to another file": "as data in another file",
}
# files of which 3.1 hands out a title that is longer than it should be, or no text at all: it asks
# for the memory of one element, and looks for no end
ONLY_THE_PROBLEM = (
    "texts of variable length",
    "texts without NUL",
    "an empty text",
    "bytes",
    "bytes in a row",
    "several texts",
    "several texts of any length",
    "numbers as a title",
    "nothing as a title",
    "a text of UTF-16",
    "opaque",
)
# read as they are by the C libraries, which check no value; no problem
INVALID = ("an index beyond", "a number that is none", "pointers all zero")


def test_odd_files_are_read_as_libfclib_reads_them(peer_program: Path, tmp_path: Path) -> None:
    ours = os.environ | {"LD_LIBRARY_PATH": str(library_folder())}
    count, read, refused = 0, 0, set()
    for odd in itertools.chain(odd_files.make(tmp_path), odd_layouts.make(tmp_path)):
        count += 1
        done, mine = (
            subprocess.run(
                [peer_program, "show", odd.kind, odd.path],
                capture_output=True,
                env=environment,
                timeout=60,
            )
            for environment in (dict(os.environ), ours)
        )
        # ours never ends its host: it returns NULL, and the program 1
        assert mine.returncode in (0, 1), (odd, mine.stderr)
        if mine.returncode:
            assert odd.path.name.encode() in mine.stderr, odd
        if done.returncode or odd.name in WRONG_IN_3_1:
            if mine.returncode:
                refused.add(odd.name)
            continue
        read += 1
        assert mine.returncode == 0, (odd, mine.stderr)
        if odd.name in INVALID:
            assert mine.stdout == done.stdout
            with pytest.raises(fclib.Error):
                fclib.read(odd.path, kind=odd.kind)
            continue
        again = json.loads(mine.stdout)
        theirs = done.stdout
        if odd.name in ONLY_THE_PROBLEM:
            title = json.dumps(again["title"]).encode()
            theirs = re.sub(
                rb'"title": ".*", "solution"',
                b'"title": ' + title + b', "solution"',
                theirs,
                flags=re.DOTALL,
            )
        seen = json.loads(theirs)
        for matrix in (a for one in (seen, again) for a in one.values() if isinstance(a, dict)):
            del matrix["nzmax"]  # ours is the length of x
        assert again == seen, odd
        assert_seen(fclib.read(odd.path, kind=odd.kind), None, again)
    assert count >= 200
    assert read >= 140
    # each of these is refused with a word, not read
    assert refused <= {*WRONG_IN_3_1, *NOT_IN_3_1}, refused


# what neither reads
NOT_IN_3_1 = (
    "complex numbers",
    "no storage",
    "a dangling link",
    "a dangling external link",
    "one array",
    "pairs of name and value",
    "LZF",
)


def test_titles_of_other_types_are_read_or_left_out(tmp_path: Path) -> None:
    titles = {
        "texts of variable length": "of any length",
        "texts without NUL": "title",
        "texts in a row": "title",
        "an empty text": "",
        "bytes": "bytes as numbers",
        "bytes in a row": "bytes",
    }
    odd = {one.name: one.path for one in odd_files.make(tmp_path) if one.kind == "local"}
    for name, title in titles.items():
        assert fclib.read(odd[name]).info.title == title
        assert fclib.left_out(odd[name]) == []
    for name, words in {
        "several texts": "holds 3 texts, expected one",
        "numbers as a title": "does not hold text",
        "nothing as a title": "holds 0 texts, expected one",
    }.items():
        assert fclib.read(odd[name]).info.title == ""
        assert fclib.left_out(odd[name]) == [f"/fclib_local/info/title: {words}"]
    (line,) = fclib.left_out(odd["a rank of the wrong type"])
    assert line == "/fclib_local/W/rank: does not hold numbers"


@pytest.fixture(scope="module")
def browser() -> Iterator[browser_module.Module]:
    if missing := browser_module.missing():
        pytest.skip(missing)
    if not (browser_module.FOLDER / "hdf5_hl.js").is_file():
        pytest.skip("the module reads no HDF5: there was no npm")
    with browser_module.Module() as module:
        yield module


def test_the_module_for_browsers_reads_what_libfclib_writes(
    peer: Peer, browser: browser_module.Module, tmp_path: Path
) -> None:
    for kind, storage, d, p in itertools.product(
        ["local", "global"], ["csr", "csc", "triplet"], [2, 3], [0, 2]
    ):
        path = tmp_path / f"{kind}-{storage}-{d}-{p}.hdf5"
        peer("make", path, kind, storage, d, 3, 10, p)
        found = browser("read", path.read_bytes())
        for name, ours in (("problem", fclib.read(path)), ("solution", fclib.read_solution(path))):
            seen = browser_module.encoded(found[name])
            assert seen == browser_module.encoded(ours), (kind, storage, d, p, name)


# ---- Siconos: the same file, read by another library and solved by another solver

SICONOS = r"""
import sys, numpy as np, h5py, scipy.sparse as sp, siconos.numerics as sn

def matrix(group):
    m, n, nz = (int(group[name][0]) for name in ("m", "n", "nz"))
    p, i, x = (group[name][()] for name in ("p", "i", "x"))
    if nz >= 0:
        return sp.coo_matrix((x, (i, p)), shape=(m, n))
    return (sp.csc_matrix if nz == -1 else sp.csr_matrix)((x, i, p), shape=(m, n))

kind = sys.argv[2]
with h5py.File(sys.argv[1]) as file:
    group = file["fclib_" + kind]
    d = int(group["spacedim"][0])
    mu = group["vectors/mu"][()]
    if kind == "local":
        W, q = matrix(group["W"]).toarray(), group["vectors/q"][()]
    else:
        M, H = matrix(group["M"]).toarray(), matrix(group["H"]).toarray()
        inverse = np.linalg.inv(M)
        W = H.T @ inverse @ H
        q = H.T @ inverse @ group["vectors/f"][()] + group["vectors/w"][()]
problem = sn.FrictionContactProblem(d, W, q, mu)
options = sn.SolverOptions(sn.SICONOS_FRICTION_3D_NSGS)
options.dparam[sn.SICONOS_DPARAM_TOL] = 1e-12
options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = 100000
r, u = np.zeros(q.size), np.zeros(q.size)
sn.fc3d_driver(problem, r, u, options)
print("reaction", *("%.17g" % x for x in r))
"""

READS_HDF5 = r"""
import sys, siconos.numerics as sn
read = {"local": sn.frictionContact_new_from_filename,
        "global": sn.globalFrictionContact_new_from_filename}[sys.argv[2]]
try:
    problem = read(sys.argv[1])
except RuntimeError as error:
    print("without fclib" if "fclib interface is not active" in str(error) else error)
    sys.exit(0)
print("sizes", problem.dimension, problem.numberOfContacts)
print("mu", *("%.17g" % x for x in problem.mu))
"""

SYSTEM_PYTHON = Path("/usr/bin/python3")


def siconos(code: str, *arguments: object, needs: str = "siconos.numerics") -> str:
    """Run a script in the interpreter that has Siconos."""
    if not SYSTEM_PYTHON.is_file():
        pytest.skip(f"there is no {SYSTEM_PYTHON}")
    probe = subprocess.run([SYSTEM_PYTHON, "-c", f"import {needs}"], capture_output=True)
    if probe.returncode:
        pytest.skip(f"{SYSTEM_PYTHON} cannot import {needs}")
    run = ran(SYSTEM_PYTHON, "-c", code, *arguments, timeout=100)
    return run.stdout


@pytest.mark.parametrize("kind", ["local", "global"])
def test_siconos_reads_ours(tmp_path: Path, kind: str) -> None:
    problem = (planted_local if kind == "local" else planted_global)(1, nc=3).problem
    fclib.write(tmp_path / "ours.hdf5", problem)
    output = siconos(READS_HDF5, tmp_path / "ours.hdf5", kind)
    if "without fclib" in output:
        pytest.skip("this Siconos was built without FCLIB")
    lines = {line.split()[0]: line.split()[1:] for line in output.splitlines() if line.split()}
    assert lines["sizes"] == ["3", "3"]
    np.testing.assert_array_equal([float(x) for x in lines["mu"]], problem.mu)


@pytest.mark.parametrize("kind", ["local", "global"])
def test_siconos_passes_over_contacts_and_bodies(tmp_path: Path, kind: str) -> None:
    problem, solution = with_geometry(kind)
    fclib.write(tmp_path / "ours.hdf5", problem, solution)
    output = siconos(READS_HDF5, tmp_path / "ours.hdf5", kind)
    if "without fclib" in output:
        pytest.skip("this Siconos is built without fclib")
    sizes, mu = (line.split()[1:] for line in output.splitlines())
    assert [int(size) for size in sizes] == [3, problem.nc]
    np.testing.assert_array_equal([float(value) for value in mu], problem.mu)


@pytest.mark.parametrize("kind", ["local", "global"])
def test_siconos_solves_the_same_problem(tmp_path: Path, kind: str) -> None:
    case = (planted_local if kind == "local" else planted_global)(1, nc=6)
    path = tmp_path / "ours.hdf5"
    fclib.write(path, case.problem)
    output = siconos(SICONOS, path, kind, needs="siconos.numerics, h5py, scipy")
    (line,) = (line for line in output.splitlines() if line.startswith("reaction"))
    r = np.array([float(x) for x in line.split()[1:]])
    ours = fclib.solve(case.problem, tol=1e-12).solution.r
    np.testing.assert_allclose(r, ours, atol=1e-8)
    assert fclib.merit(case.problem, fclib.Solution(r=r)).error < 1e-8
    assert judge(case.problem, fclib.Solution(r=r)).error < 1e-8


def test_problems_of_scenes_that_siconos_simulates(tmp_path: Path) -> None:
    siconos("print(1)", needs="siconos.mechanics.collision.bullet, scipy, h5py")
    root = Path(__file__).parents[2]
    command: list[str | Path] = [sys.executable, "-m", "workshop.sets.siconos_scenes", tmp_path]
    command += ["--scenes", "towers-4-0.4"]
    counts = ["--steps", "41", "--every", "20"]
    subprocess.run([*command, *counts], check=True, capture_output=True, cwd=root)
    files = sorted(tmp_path.glob("towers-4-0.4-*.hdf5"))
    assert len(files) == 2
    for path in files:
        problem = fclib.read(path)
        assert isinstance(problem, fclib.LocalProblem)
        assert problem.nc >= 3 * 4 * 4  # each cube on four corners
        w = dense(problem.W)
        assert np.linalg.eigvalsh(w + w.T).min() > -1e-12 * np.abs(w).max()
        assert fclib.solve(problem).converged
    wrong = ran(*command[:-1], "towers", code=2, cwd=root)
    assert "KIND-BODIES-MU" in wrong.stderr
