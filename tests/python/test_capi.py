"""The C library: a drop-in for libfclib 3.1 that never takes its host down."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import capi_abi
import fclib
from capi_library import CAPI, HEADERS, ROOT, compile_fortran, compile_program, library_folder
from helpers import Array, dense, modified, planted_global, planted_local, project, ran
from helpers_cli import invoke

# where libfclib 3.1 is installed, or unpacked with what it needs
PEER = Path(os.environ.get("FCLIB_PEER", "/usr"))
PEER_HEADER = PEER / "include/fclib.h"
BATCH = 25  # problems in one process


@pytest.fixture(scope="session")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for what is compiled here."""
    return tmp_path_factory.mktemp("programs")


# ---- what the interface promises


@pytest.fixture(scope="session")
def checks(programs: Path) -> Path:
    return compile_program(ROOT / "tests/capi/checks.c", programs / "checks")


def test_what_the_header_promises(checks: Path, tmp_path: Path) -> None:
    done = ran(checks, tmp_path, timeout=300)
    assert done.stdout == done.stderr == "", "the library prints nothing"


def valgrind(*command: object) -> None:
    tool = shutil.which("valgrind")
    if tool is None:
        pytest.skip("there is no valgrind")
    options = ["--quiet", "--error-exitcode=99"]
    if not str(command[0]).startswith("--tool"):
        options.append("--leak-check=full")
    ran(tool, *options, *command, timeout=300)


@pytest.mark.slow
def test_the_library_is_clean_under_valgrind(checks: Path, tmp_path: Path) -> None:
    valgrind(checks, tmp_path)


@pytest.fixture(scope="session")
def threads(programs: Path) -> Path:
    return compile_program(CAPI / "threads.c", programs / "threads")


def test_threads_do_not_disturb_each_other(threads: Path, tmp_path: Path) -> None:
    done = ran(threads, tmp_path, timeout=300)
    assert (done.stdout, done.stderr) == ("", "")


@pytest.mark.slow
def test_threads_are_clean_under_helgrind(threads: Path, tmp_path: Path) -> None:
    if next(library_folder().rglob("*.gcno"), None):
        pytest.skip("the counters of a build for coverage race, as they may")
    # few rounds of few threads, for it runs them by turns and remembers each access
    helgrind = f"--suppressions={CAPI / 'helgrind.txt'}"
    # two rounds alone come first, one of each solver: what is made at its first use is there then
    valgrind("--tool=helgrind", helgrind, threads, tmp_path, 2, 2, 3)


def test_only_the_interface_is_exported() -> None:
    tool = shutil.which("nm")
    if tool is None:
        pytest.skip("there is no nm")
    library = library_folder() / "libfclib.so.0"
    names = ran(tool, "--dynamic", "--defined-only", library)
    exported = {line.split()[-1] for line in names.stdout.splitlines()}
    versions = set(capi_abi.exported().values())
    assert versions == {"FCLIB_3.1", "FCLIB_3.2"}
    if sys.platform == "linux":
        expected = {f"{name}@@{version}" for name, version in capi_abi.exported().items()}
        assert {name for name in exported if name.partition("@")[0] not in versions} == expected
    else:
        assert {name.lstrip("_") for name in exported} == set(capi_abi.exported())


def test_what_the_header_declares_is_exported() -> None:
    declared = {re.findall(r"fclib_\w+(?=\()", line)[0] for line in capi_abi.declared()}
    assert declared == set(capi_abi.exported()), "cmake/fclib.map has the names"


def test_the_binary_interface_is_the_recorded_one(tmp_path: Path) -> None:
    if shutil.which("abidw") is None or shutil.which("abidiff") is None:
        pytest.skip("there is no libabigail")
    now = capi_abi.describe(tmp_path)
    done = ran("abidiff", "--no-added-syms", capi_abi.RECORDED, now, code=None)
    assert done.returncode == 0, (
        f"{done.stdout}\ndocs/compiled.md has the policy; python tests/capi_abi.py --write"
    )


def test_the_header_compiles_as_cxx(programs: Path) -> None:
    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("there is no C++ compiler")
    source = programs / "header.cpp"
    source.write_text(
        "#define FCLIB_WITH_MERIT_FUNCTIONS\n#define FCLIB_APICOMPILE\n"
        "#include <fclib.h>\n#include <fclib.h>\n"
        "int main() { return fclib_solver_name(0) ? 0 : 1; }\n"
    )
    program, folder = programs / "header", library_folder()
    command = [compiler, "-std=c++98", "-pedantic", "-Werror", f"-I{HEADERS}", str(source)]
    libraries = [f"-L{folder}", "-lfclib", f"-Wl,-rpath,{folder}"]
    subprocess.run([*command, "-o", str(program), *libraries], check=True)
    assert subprocess.run([program]).returncode == 0


@pytest.fixture(scope="session")
def by_name(programs: Path) -> Path:
    return compile_program(CAPI / "by_name.c", programs / "by_name")


def test_what_goes_by_name(by_name: Path, tmp_path: Path) -> None:
    done = ran(by_name, tmp_path, timeout=300)
    assert (done.stdout, done.stderr) == ("", "")
    text = fclib.read_siconos(tmp_path / "ball.dat")
    assert isinstance(text, fclib.LocalProblem)


@pytest.mark.long
def test_what_goes_by_name_is_clean_under_valgrind(by_name: Path, tmp_path: Path) -> None:
    valgrind(by_name, tmp_path)


@pytest.fixture(scope="session")
def facade(programs: Path) -> Path:
    return compile_program(CAPI / "facade.cpp", programs / "facade", "-pedantic")


def test_what_the_cpp_header_promises(facade: Path, tmp_path: Path) -> None:
    done = ran(facade, tmp_path, timeout=300)
    assert (done.stdout, done.stderr) == ("", "")


@pytest.mark.long
def test_the_cpp_header_is_clean_under_valgrind(facade: Path, tmp_path: Path) -> None:
    valgrind(facade, tmp_path)


# ---- the examples


@pytest.fixture(scope="session")
def examples(programs: Path) -> dict[str, Path]:
    sources = sorted((ROOT / "examples/c").glob("*.c"))
    return {
        source.stem: compile_program(source, programs / source.stem, "-std=c99", "-pedantic")
        for source in sources
    }


def test_the_examples_run(examples: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / "ball.hdf5"
    for _ in range(2):  # the file may be there already
        done = ran(examples["write"], path)
        assert done.stderr == ""
    problem, solution = fclib.read(path), fclib.read_solution(path)
    assert problem.info.title == "a ball on a plane"
    assert solution is not None
    assert fclib.merit(problem, solution).error == 0

    done = ran(examples["solve"], path)
    assert "converged" in done.stdout
    assert "contact 0: r = 1 -0.5" in done.stdout
    done = ran(examples["sequence"], tmp_path / "run.h5")
    assert done.stderr == ""
    assert done.stdout.startswith("100 steps\nstep 0: slides with 1.95 m/s, error ")
    assert len(fclib.Sequence(tmp_path / "run.h5")) == 100
    done = ran(examples["solve"], path, "no_such_solver", code=1)
    assert "no_such_solver" in done.stderr


@pytest.fixture(scope="session")
def cpp_example(programs: Path) -> Path:
    return compile_program(ROOT / "examples/cpp/ball.cpp", programs / "ball-cpp")


@pytest.fixture(scope="session")
def fortran_example(programs: Path) -> Path:
    return compile_fortran(ROOT / "examples/fortran/ball.f90", programs / "ball-fortran")


def check_ball(program: Path, folder: Path) -> None:
    """A program that writes a ball on a plane into a file, and solves it."""
    path = folder / "ball.hdf5"
    for _ in range(2):  # the file may be there already
        done = ran(program, path)
        assert done.stderr == ""
        assert "a ball on a plane" in done.stdout
        assert "converged" in done.stdout
    problem, solution = fclib.read(path), fclib.read_solution(path)
    assert problem.info.title == "a ball on a plane"
    assert solution is not None
    assert fclib.merit(problem, solution).error < 1e-10
    done = ran(program, folder / "no" / "folder", code=1)
    assert "no/folder: cannot be written" in done.stderr
    done = ran(program, code=2)
    assert "usage" in done.stderr


def test_the_example_in_cpp_runs(cpp_example: Path, tmp_path: Path) -> None:
    check_ball(cpp_example, tmp_path)


@pytest.fixture(scope="session")
def stack_example(programs: Path) -> Path:
    return compile_program(ROOT / "examples/cpp/stack.cpp", programs / "stack-cpp")


def test_the_bodies_of_the_example_are_drawn(stack_example: Path, tmp_path: Path) -> None:
    path = tmp_path / "stack.hdf5"
    for _ in range(2):  # the file may be there already
        done = ran(stack_example, path)
        assert done.stderr == ""
        assert done.stdout.startswith("converged")
    problem, solution = fclib.read(path), fclib.read_solution(path)
    assert fclib.left_out(path) == []
    assert problem.contacts is not None
    assert problem.bodies is not None
    assert problem.bodies.names == ["table", "box", "ball"]
    assert problem.contacts.feature.tolist() == [0, 1, 2, 3, 0]
    assert problem.contacts.shape.tolist() == [[0, 1]] * 4 + [[1, 2]]
    # what the contacts carry: the box and what the ball brings, in a step
    assert solution is not None
    force = solution.r.reshape(-1, 3)[:, 0]
    assert force[4] == pytest.approx(2 * (1 + 9.81e-3))
    assert force[:4].sum() == pytest.approx(force[4] + 9.81e-3)
    for name in ("view", "bare"):
        page = tmp_path / f"{name}.html"
        invoke("view", path, "--out", page)
        assert ('"ball"' in page.read_text()) == (name == "view")
        fclib.write(path, problem.replace(contacts=None, bodies=None), mode="replace")


@pytest.mark.long
@pytest.mark.parametrize("name", ["examples", "cpp_example", "stack_example", "fortran_example"])
def test_the_examples_are_clean_under_valgrind(
    name: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    made: Any = request.getfixturevalue(name)
    programs = [made["write"], made["solve"]] if name == "examples" else [made]
    for program in programs:
        valgrind(program, tmp_path / "ball.hdf5")


def test_the_example_in_fortran_runs(fortran_example: Path, tmp_path: Path) -> None:
    check_ball(fortran_example, tmp_path)
    known = fclib.read(tmp_path / "ball.hdf5").matrix_info
    assert known == {
        "W": fclib.MatrixInfo(comment="1 / mass", conditioning=1, determinant=1, rank=3)
    }


def test_the_example_in_python_runs(tmp_path: Path) -> None:
    path = tmp_path / "balls.hdf5"
    command = [sys.executable, str(ROOT / "examples/python/ball.py")]
    done = ran(*command, path)
    assert done.stderr == ""
    assert "converged" in done.stdout
    problem, solution = fclib.read(path), fclib.read_solution(path)
    assert problem.formulation == "GM3DFC"
    assert solution is not None
    merit = fclib.merit(problem, solution)
    assert merit.error <= 1e-10
    assert (merit.stick, merit.slide) == (1, 2)
    assert subprocess.run(command, capture_output=True).returncode == 1


# ---- the Fortran module


@pytest.fixture(scope="session")
def fortran(programs: Path) -> Path:
    return compile_fortran(CAPI / "fortran.f90", programs / "fortran")


def test_what_the_fortran_module_promises(fortran: Path, tmp_path: Path) -> None:
    done = ran(fortran, tmp_path, timeout=300)
    assert (done.stdout, done.stderr) == ("", "")
    path = tmp_path / "bodies.hdf5"
    problem = fclib.read(path)
    assert fclib.left_out(path) == []
    assert problem.contacts is not None
    assert problem.contacts.body.tolist() == [[0, 1]]
    bodies = problem.bodies
    assert bodies is not None
    assert (bodies.names, bodies.unit) == (["ground", "ball"], "mm")
    assert bodies.place.tolist() == [[0, 0, 0], [3, 4, 5]]
    assert bodies.mass.tolist() == [0, 2]
    assert bodies.inertia.tolist() == [[0, 0, 0], [7, 8, 9]]
    assert bodies.center.tolist() == [[0, 0, 0], [0.125, 0.25, 0.375]]
    assert bodies.axes.tolist() == [[1, 0, 0, 0], [0, 1, 0, 0]]
    assert bodies.velocity.tolist() == [1, 2, 3, 4, 5, 6]
    assert bodies.impulse.tolist() == [-0.5, -1, -1.5, -2, -2.5, -3]
    steps = fclib.Sequence(tmp_path / "steps.h5")
    firsts = [step.q[0] for step in steps if isinstance(step, fclib.LocalProblem)]
    assert firsts == [-1, -2, -3]


def test_large_arrays_of_fortran_need_no_stack(programs: Path) -> None:
    folder = programs / "large"  # of a module that is compiled otherwise
    folder.mkdir()
    # -Ofast puts temporary arrays on the stack
    program = compile_fortran(CAPI / "fortran_large.f90", folder / "large", "-Ofast")
    ran("sh", "-c", f"ulimit -s 4096; exec {program}", timeout=300)


@pytest.mark.long
def test_the_fortran_module_is_clean_under_valgrind(fortran: Path, tmp_path: Path) -> None:
    valgrind(fortran, tmp_path)


def without_comments(header: str) -> str:
    return re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)


IN_FORTRAN = {"int": "integer(c_int)", "double": "real(c_double)", "size_t": "integer(c_size_t)"}


def in_fortran(declaration: str) -> str:
    """A member or an argument of C as a type of Fortran."""
    if "*" in declaration:
        return "type(c_ptr)"
    if declaration.startswith("enum"):
        return "integer(c_int)"
    return IN_FORTRAN[declaration.split()[0]]


def test_the_fortran_module_is_the_header() -> None:
    source = library_folder() / "generated" / "fclib.f90"
    if not source.is_file():
        pytest.skip("the build has no Fortran module")
    module, header = source.read_text(), without_comments((HEADERS / "fclib.h").read_text())

    structs = re.findall(r"struct (?:FCLIB_APICOMPILE )?(\w+) \{(.*?)\};", header, re.DOTALL)
    assert len(structs) == 15
    for name, body in structs:
        members = [
            (in_fortran(member), member.split()[-1].strip("*"))
            for member in filter(None, map(str.strip, body.split(";")))
        ]
        found = re.search(rf"type, bind\(c\), public :: {name}\n(.*?)end type", module, re.DOTALL)
        assert found, name
        assert re.findall(r"(\S+) :: (\w+)", found[1]) == members, name

    for name, body in re.findall(r"enum (?:FCLIB_APICOMPILE )?(\w+) \{(.*?)\};", header, re.DOTALL):
        values = [value.strip() for value in body.split(",")]
        lines = "".join(f"    enumerator :: {value}\n" for value in values)
        assert f"enum, bind(c)\n{lines}  end enum" in module, name
        for value in values:
            assert re.search(rf"public :: .*\b{value}\b", module), value

    functions = re.findall(r"^[\w *]+?\b(fclib_\w+)\(([^()]*)\);", header, re.MULTILINE)
    assert len(functions) > 40
    for name, arguments in functions:
        count = 0 if arguments.strip() == "void" else arguments.count(",") + 1
        found = re.search(rf"(?:function|subroutine) {name}\(([^)]*)\) bind\(c\)", module)
        assert found, name
        assert len(list(filter(None, found[1].split(",")))) == count, name
        assert re.search(rf"^(  public ::|      ).*\b{name}\b", module, re.MULTILINE), name


# ---- files go both ways


@dataclass(frozen=True)
class Library:
    """A library, and the program that exchanges problems through it."""

    name: str
    program: Path
    environment: dict[str, str]

    def __call__(self, verb: str, words: str) -> str:
        done = ran(self.program, verb, input=words, env=self.environment, timeout=120)
        return done.stdout


EXCHANGE = ROOT / "tests/capi/exchange.c"
OF_PEER = ("-DONLY_3_1", f"-I{PEER_HEADER.parent}")


def at(*folders: Path) -> dict[str, str]:
    """The environment that has libraries loaded from these folders."""
    return os.environ | {"LD_LIBRARY_PATH": ":".join(map(str, folders))}


@pytest.fixture(scope="session")
def ours(programs: Path) -> Library:
    """Our library, and a program compiled with our header."""
    return Library("ours", compile_program(EXCHANGE, programs / "ours"), dict(os.environ))


@pytest.fixture(scope="session")
def peer_folder() -> Path:
    """The folder of the peer's library."""
    found = sorted((PEER / "lib").glob("*/libfclib.so.0"))
    if not PEER_HEADER.is_file() or not found or "FCLIB_VERSION_MAJOR" in PEER_HEADER.read_text():
        pytest.skip("libfclib 3.1 is not installed")
    return found[0].parent


@pytest.fixture(scope="session")
def theirs(programs: Path, peer_folder: Path) -> Library:
    """The peer, and a program compiled with its header."""
    program = compile_program(EXCHANGE, programs / "theirs", *OF_PEER, folder=peer_folder)
    return Library("theirs", program, at(peer_folder))


@pytest.fixture(scope="session")
def replaced(theirs: Library, peer_folder: Path) -> Library:
    """The program compiled with the peer's header, and our library in the place of theirs."""
    environment = at(library_folder(), peer_folder)
    return Library("a client of theirs with our library", theirs.program, environment)


@pytest.fixture(scope="session")
def brought(programs: Path, peer_folder: Path) -> Library:
    """A program compiled with our header, and the peer's library."""
    program = compile_program(
        EXCHANGE, programs / "brought", "-DONLY_3_1", f"-I{HEADERS}", folder=peer_folder
    )
    return Library("a client of ours with their library", program, at(peer_folder))


# ---- clients of 3.1


OLD_CLIENTS = CAPI / "old_clients.c"


@pytest.fixture(scope="session")
def old_clients(programs: Path) -> Path:
    """What clients of 3.1 do, compiled with our header."""
    return compile_program(OLD_CLIENTS, programs / "old-clients")


def test_clients_of_3_1_notice_nothing(
    old_clients: Path, programs: Path, peer_folder: Path, tmp_path: Path
) -> None:
    theirs = compile_program(
        OLD_CLIENTS, programs / "old-clients-of-3.1", *OF_PEER, folder=peer_folder
    )

    def seen(program: Path, *folders: Path) -> str:
        done = ran(program, "write", tmp_path, env=at(*folders))
        return done.stdout

    expected = seen(theirs, peer_folder)
    assert expected.count("local without") == 32
    assert seen(old_clients, library_folder()) == expected
    assert seen(theirs, library_folder(), peer_folder) == expected
    assert seen(old_clients, peer_folder) == expected


def test_what_a_solution_lacks_follows_from_r(old_clients: Path, tmp_path: Path) -> None:
    path = tmp_path / "mixed_global"
    written = ran(old_clients, "write", tmp_path)
    assert written.stderr == ""
    problem = fclib.read(path)
    assert isinstance(problem, fclib.GlobalProblem)
    assert problem.G is not None
    full, bare = fclib.read_guesses(path)  # the last file is that of a guess without anything
    assert full.r is not None
    assert not np.any(bare.r)
    assert not np.any(bare.u)
    source = tmp_path / "lacking.c"
    source.write_text(
        "#include <fclib.h>\nint main(int argc, char **argv) {\n  double r[] = {1, -0.5, 0}, "
        "l[] = {7};\n  struct fclib_solution s = {0, 0, r, l};\n"
        "  return argc > 1 && fclib_set_write_mode(FCLIB_WRITE_REPLACE) &&\n"
        "         fclib_write_solution(&s, argv[1]) ? 0 : 1;\n}\n"
    )
    subprocess.run([compile_program(source, tmp_path / "lacking"), path], check=True)
    solution = fclib.read_solution(path)
    assert solution is not None
    assert solution.v is not None
    assert solution.u is not None
    assert solution.l is not None
    v = problem.H @ solution.r + problem.G @ solution.l + problem.f
    np.testing.assert_allclose(solution.v, v)
    np.testing.assert_allclose(solution.u, problem.H.T @ v + problem.w)


@pytest.mark.parametrize("dense", [False, True])
def test_clients_of_3_1_read_dense_problems(dense: bool, old_clients: Path, tmp_path: Path) -> None:
    W = np.array([[2.0, 0.5, 0], [0.5, 3, -1], [0, -1, 4]])
    problem = fclib.LocalProblem(spacedim=3, W=W, q=[-1, 0, 0], mu=[0.5])
    fclib.write(tmp_path / "dense.hdf5", problem, dense=dense)
    stored = fclib.read(tmp_path / "dense.hdf5")
    assert isinstance(stored, fclib.LocalProblem)
    assert isinstance(stored.W, np.ndarray) == dense
    done = ran(old_clients, "read", tmp_path / "dense.hdf5")
    assert done.stderr == ""
    size, *entries = done.stdout.splitlines()
    assert size == "3 x 3"
    seen = np.zeros((3, 3))
    for line in entries:
        row, col, value = line.split()
        seen[int(row), int(col)] = float(value)
    assert np.array_equal(seen, W)
    assert len(entries) == (7 if dense else 9)


def test_who_looks_at_no_result_is_told(old_clients: Path, tmp_path: Path) -> None:
    done = ran(old_clients, "fail", tmp_path / "none", code=None)
    assert done.stderr == f"fclib: {tmp_path / 'none'}: there is no such file\n"


# ---- words of a problem


def number(x: float) -> str:
    """As %a prints it."""
    if not np.isfinite(x):
        return str(float(x))
    text = float(x).hex()
    mantissa, exponent = text.split("p")
    if "." in mantissa:
        mantissa = mantissa.rstrip("0").rstrip(".")
    return f"{mantissa}p{exponent}"


class Words:
    """Random problems in words: of one kind, in any storage, with any numbers."""

    def __init__(self, seed: int, kind: str) -> None:
        self.rng = np.random.default_rng(seed)
        self.kind = kind
        self.words: list[str] = []

    def add(self, *values: object) -> None:
        self.words += [str(value) for value in values]

    def vector(self, size: int, given: bool = True) -> None:
        if size == 0 or not given:
            return self.add("-")
        values = self.rng.standard_normal(size) * 10.0 ** self.rng.integers(-300, 300, size)
        values[self.rng.uniform(size=size) < 0.1] = self.rng.choice([0, -0.0, np.inf, -np.inf])
        self.add(*map(number, values))

    def text(self) -> None:
        letters = [*"abc -_", "é", "\n", "%s"]
        size = int(self.rng.integers(-1, 12))
        chosen = "".join(letters[k] for k in self.rng.integers(0, len(letters), max(size, 0)))
        self.add("-" if size < 0 else "=" + chosen.encode().hex())

    def info(self) -> None:
        if self.rng.uniform() < 0.3:
            return self.add("-")
        self.add("+")
        for _ in range(3):
            self.text()

    def matrix(self, rows: int, cols: int) -> None:
        """Indices and pointers are whatever: 3.1 writes and reads them."""
        storage = int(self.rng.integers(0, 3))
        entries = int(self.rng.integers(0, rows * cols + 3))
        indices = self.rng.integers(-5, rows + cols + 5, entries)
        if storage == 0:
            self.add(entries, rows, cols, entries)
            pointers = self.rng.integers(-5, rows + cols + 5, entries)
        else:
            self.add(entries, rows, cols, -storage)
            outer = cols if storage == 1 else rows
            pointers = np.sort(self.rng.integers(0, entries + 1, outer + 1))
            if self.rng.uniform() < 0.3:
                pointers = self.rng.integers(-(2**31), 2**31, outer + 1)
        self.add(*pointers, *indices)
        if entries:
            self.vector(entries)
        if self.rng.uniform() < 0.5:
            return self.add("-")
        self.add("+")
        self.text()
        self.add(*map(number, self.rng.standard_normal(2)), self.rng.integers(-3, 100))

    def problem(self) -> tuple[str, str]:
        """The words, and what there is beside the problem ("s" and "g", or neither)."""
        rng = self.rng
        law = self.kind.partition("_")[2]
        d = int(rng.choice({"": [2, 3], "rolling": [3, 5], "spin": [4, 6]}[law]))
        nc, p = int(rng.integers(0, 5)), int(rng.choice([0, 1, 3]))
        m, n = d * nc, int(rng.integers(1, 9))
        local = self.kind.startswith("local")
        self.add(self.kind, d)
        if local:
            self.matrix(m, m)
            shapes = [(m, p), (p, p)]
        else:
            self.matrix(n, n)
            self.matrix(n, m)
            shapes = [(n, p)]
        for shape in shapes:
            if p:
                self.matrix(*shape)
            else:
                self.add("-")
        self.vector(nc)
        for _ in range({"": 0, "rolling": 1, "spin": 2 if d == 6 else 1}[law]):
            self.vector(nc)
        if law == "spin":
            self.add(int(rng.integers(-3, 4)))
        for size in (m, p) if local else (n, p, m):
            self.vector(size)
        self.info()
        # 3.1 takes no solution without contacts
        what = "-" if m == 0 else str(rng.choice(["-", "s", "g", "sg"]))
        sizes = (0 if local else n, m, m, p)
        self.add("+" if "s" in what else "-")
        guesses = int(rng.integers(1, 4)) if "g" in what else 0
        for k in range(guesses + ("s" in what)):
            if k == ("s" in what):
                self.add(guesses)
            for size in sizes:
                self.vector(size)
        if guesses == 0:
            self.add(0)
        return " ".join(self.words), what


def both_ways(
    writers: Iterable[Library], readers: Iterable[Library], kind: str, seed: int, folder: Path
) -> None:
    """What any of the writers writes is what any of the readers reads, word for word."""
    problems = [Words(seed + k, kind).problem() for k in range(BATCH)]
    readers = list(readers)
    for writer in writers:
        paths = [folder / str(k) for k in range(BATCH)]
        for path in paths:
            path.unlink(missing_ok=True)
        lines = [f"{path} {words}" for path, (words, _) in zip(paths, problems, strict=True)]
        writer("write", "\n".join(lines))
        asked = "\n".join(
            f"{kind} {what} {path}" for path, (_, what) in zip(paths, problems, strict=True)
        )
        for reader in readers:
            seen = reader("show", asked).splitlines()
            for line, got in zip(lines, seen, strict=True):
                assert got == line, f"{writer.name} wrote, {reader.name} read"


@pytest.mark.parametrize("kind", ["local", "global"])
def test_files_go_both_ways(
    kind: str,
    ours: Library,
    theirs: Library,
    replaced: Library,
    brought: Library,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    folder = tmp_path_factory.mktemp(kind)

    @settings(max_examples=8)
    @given(st.integers(0, 2**32))
    def check(seed: int) -> None:
        both_ways([ours, theirs], [ours, theirs], kind, seed, folder)

    check()
    both_ways([replaced], [theirs], kind, 1, folder)
    both_ways([theirs], [replaced], kind, 2, folder)
    both_ways([brought], [ours], kind, 3, folder)
    both_ways([ours], [brought], kind, 4, folder)


@pytest.mark.parametrize(
    "kind", ["local", "global", "local_rolling", "global_rolling", "local_spin", "global_spin"]
)
def test_files_come_back(
    kind: str, ours: Library, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp(kind)

    @settings(max_examples=4)
    @given(st.integers(0, 2**32))
    def check(seed: int) -> None:
        both_ways([ours], [ours], kind, seed, folder)

    check()


# ---- MERIT_1


def matrix_words(a: Any) -> Iterator[str]:
    a = a.tocsc()
    yield from map(str, [a.nnz, *a.shape, -1, *a.indptr, *a.indices])
    yield from map(number, a.data)
    yield "-"


def vector_words(x: Array | None) -> Iterator[str]:
    yield from ["-"] if x is None or x.size == 0 else map(number, x)


def judged_words(problem: fclib.Problem, solution: fclib.Solution) -> str:
    """A problem with matrices by columns, and a solution, for `exchange merit`."""
    words = ["-", problem.kind, str(problem.spacedim)]
    local = isinstance(problem, fclib.LocalProblem)
    for name in ("W", "V", "R") if local else ("M", "H", "G"):
        a = getattr(problem, name)
        words += ["-"] if a is None else matrix_words(a)
    for name in ("mu", "q", "s") if local else ("mu", "f", "b", "w"):
        words += vector_words(getattr(problem, name))
    words += ["-", "+"]
    for name in ("v", "u", "r", "l"):
        words += vector_words(None if local and name == "v" else getattr(solution, name))
    return " ".join([*words, "0"])


def perturbed(seed: int, solution: fclib.Solution, size: float) -> fclib.Solution:
    rng = np.random.default_rng(seed)

    def moved(x: Array | None) -> Array | None:
        return None if x is None else x + size * rng.standard_normal(x.size)

    r = moved(solution.r)
    assert r is not None
    return fclib.Solution(v=moved(solution.v), u=moved(solution.u), r=r, l=moved(solution.l))


def merit_1(problem: Any, solution: fclib.Solution) -> float:
    """The formula, in NumPy."""
    r, mu, d = solution.r, problem.mu, problem.spacedim
    lam = np.zeros(0) if solution.l is None else solution.l
    norm = np.linalg.norm
    others: Any = 0.0
    if isinstance(problem, fclib.LocalProblem):
        q: Any = problem.q
        u: Any = problem.W @ r + problem.q
        if problem.V is not None:
            V, R, s = dense(problem.V), dense(problem.R), np.asarray(problem.s)
            u = u + V @ lam
            others += norm(V.T @ r + R @ lam + s) / (1 + norm(s))
    else:
        v, f = solution.v, problem.f
        u = problem.H.T @ v + problem.w
        q = problem.H.T @ np.linalg.solve(dense(problem.M), f) + problem.w
        momentum = problem.H @ r + f
        if problem.G is not None:
            momentum = momentum + problem.G @ lam
            others += norm(problem.G.T @ v + problem.b) / (1 + norm(problem.b))
        others += norm(problem.M @ v - momentum) / (1 + norm(f))
    reactions, velocities = r.reshape(-1, d), u.reshape(-1, d)
    residual = reactions - project(reactions - modified(velocities, mu), mu)
    return float(norm(residual) / (1 + np.sqrt(norm(q))) + others)


def test_merit_1_is_that_of_libfclib(ours: Library, theirs: Library) -> None:
    words = []
    for seed in range(60):
        case = planted_local(seed, nc=1 + seed % 7, p=seed % 4, storage="csc")
        solution = perturbed(seed, case.solution, [0, 1e-6, 0.1, 10][seed % 4])
        words.append(judged_words(case.problem, solution))
    mine, his = (
        np.array([float.fromhex(x) for x in program("merit", "\n".join(words)).split()])
        for program in (ours, theirs)
    )
    assert mine.size == his.size == len(words)
    np.testing.assert_allclose(mine, his, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("p", [0, 2])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("kind", ["local", "global"])
def test_merit_1_is_its_formula(ours: Library, kind: str, d: int, p: int) -> None:
    make = planted_local if kind == "local" else planted_global
    words, expected = [], []
    for seed, size in enumerate([0, 1e-6, 0.1, 10]):
        case = make(seed, d=d, p=p, storage="csc")
        solution = perturbed(seed, case.solution, size)
        words.append(judged_words(case.problem, solution))
        expected.append(merit_1(case.problem, solution))
    seen = [float.fromhex(x) for x in ours("merit", "\n".join(words)).split()]
    np.testing.assert_allclose(seen, expected, rtol=1e-10, atol=1e-13)


# ---- installed


def test_a_folder_of_a_build_is_configured_again(tmp_path: Path) -> None:
    cmake = shutil.which("cmake")
    if cmake is None:
        pytest.skip("there is no cmake")

    folder = tmp_path / "build"

    def configured(environment: dict[str, str], *options: str) -> tuple[str, list[str], bool]:
        options = ("-DFCLIB_PYTHON=OFF", *options)
        ran(cmake, "-S", ROOT, "-B", folder, *options, env=environment, timeout=300)
        cache = (folder / "CMakeCache.txt").read_text()
        found = re.findall(r"^(METIS|LIBDEFLATE)_LIBRARY:\w+=/", cache, re.MULTILINE)
        fortran = (folder / "fclib-fortran.pc").is_file()
        return (folder / "fclib.pc").read_text(), found, fortran

    # no compiler of Fortran at first, and all other libraries
    environment = {name: value for name, value in os.environ.items() if name != "FC"}
    no_compiler = environment | {"FC": "/no/such/compiler"}
    _, there, fortran = configured(no_compiler, "-DBUILD_SHARED_LIBS=ON")
    if not there:
        pytest.skip("there is neither METIS nor libdeflate")
    assert not fortran
    words, _, fortran = configured(environment, "-DBUILD_SHARED_LIBS=OFF")
    assert "hdf5" in words
    for name in ("metis", "deflate"):
        assert name not in words, "a static library has it only if it is asked for"
    if shutil.which("gfortran") is not None:
        assert fortran
    # of other libraries, those of the system are forgotten
    bundled = f"-DFCLIB_BUNDLED={tmp_path}/c++"
    assert configured(environment, "-DBUILD_SHARED_LIBS=ON", bundled)[1] == []


def test_it_is_installed_as_a_user_of_c_expects(tmp_path: Path) -> None:
    cmake, folder = shutil.which("cmake"), library_folder()
    if cmake is None or not (folder / "CMakeCache.txt").is_file():
        pytest.skip("there is no cmake, or no build of its making to install")
    prefix = tmp_path / "prefix"

    def run(*command: object) -> str:
        environment = os.environ | {"PKG_CONFIG_PATH": ":".join(map(str, found))}
        done = ran(*command, env=environment)
        return done.stdout

    found: list[Path] = []
    run(cmake, "--build", folder, "--target", "fclib_package")
    for component in ("library", "development"):
        run(cmake, "--install", folder, "--prefix", prefix, "--component", component)
    assert (prefix / "include/fclib.h").read_bytes() == (HEADERS / "fclib.h").read_bytes()

    # by CMake
    client = tmp_path / "client"
    client.mkdir()
    (client / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.16)\nproject(client C)\n"
        "find_package(fclib 3.1 REQUIRED)\n"
        f'add_executable(write "{ROOT}/examples/c/write.c")\n'
        "target_link_libraries(write fclib::fclib m)\n"
        f'add_executable(solve "{ROOT}/examples/c/solve.c")\n'
        "target_link_libraries(solve FCLIB::fclib)\n"
    )
    build = client / "build"
    run(cmake, "-S", client, "-B", build, f"-DCMAKE_PREFIX_PATH={prefix}")
    run(cmake, "--build", build)
    run(build / "write", tmp_path / "ball.hdf5")
    assert "converged" in run(build / "solve", tmp_path / "ball.hdf5")

    # by CMake from C++
    (client / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.16)\nproject(client CXX)\n"
        "find_package(fclib 3.2 REQUIRED)\n"
        f'add_executable(ball "{ROOT}/examples/cpp/ball.cpp")\n'
        "target_compile_features(ball PRIVATE cxx_std_20)\n"
        "target_link_libraries(ball fclib::fclib)\n"
    )
    build = client / "cpp"
    run(cmake, "-S", client, "-B", build, f"-DCMAKE_PREFIX_PATH={prefix}")
    run(cmake, "--build", build)
    assert "converged" in run(build / "ball", tmp_path / "cpp.hdf5")

    # by CMake from Fortran, where the module was compiled; its source is there in any case
    assert (prefix / "include/fclib.f90").is_file()
    fortran = any(prefix.rglob("fclib.mod"))
    if fortran:
        (client / "CMakeLists.txt").write_text(
            "cmake_minimum_required(VERSION 3.16)\nproject(client Fortran)\n"
            "find_package(fclib REQUIRED COMPONENTS fortran)\n"
            f'add_executable(ball "{ROOT}/examples/fortran/ball.f90")\n'
            "target_link_libraries(ball fclib::fortran)\n"
        )
        build = client / "fortran"
        run(cmake, "-S", client, "-B", build, f"-DCMAKE_PREFIX_PATH={prefix}")
        run(cmake, "--build", build)
        assert "converged" in run(build / "ball", tmp_path / "fortran.hdf5")

    # by pkg-config
    config, compiler = shutil.which("pkg-config"), shutil.which("cc")
    if config is None or compiler is None or not sys.platform.startswith("linux"):
        return
    found += [path.parent for path in prefix.rglob("fclib.pc")]
    flags = run(config, "--cflags", "--libs", "fclib").split()
    library = next(prefix.rglob("libfclib.so.0")).parent
    run(compiler, ROOT / "examples/c/write.c", "-o", tmp_path / "write", *flags, "-lm")
    programs = [tmp_path / "write"]
    gfortran = shutil.which("gfortran")
    if fortran and gfortran is not None:
        programs.append(tmp_path / "ball")
        source = ROOT / "examples/fortran/ball.f90"
        flags = run(config, "--cflags", "--libs", "fclib-fortran").split()
        run(gfortran, source, "-o", programs[-1], *flags)
    for program in programs:
        environment = os.environ | {"LD_LIBRARY_PATH": str(library)}
        ran(program, tmp_path / "ball.hdf5", env=environment)
