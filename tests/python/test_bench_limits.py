"""Solvers that do what no solver should: each gets its own status, in time."""

from __future__ import annotations

import dataclasses
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import fclib
from fclib import _marked, _solve, analysis, bench
from fclib.bench import machine, meter, pool, problems, processes, template
from fclib.bench.job import Job, Record
from fclib.bench.pool import MARK, SupervisorClient
from fclib.bench.runner import warn_of_locks
from fclib.bench.supervisor import Supervisor, prove
from helpers import planted_local

LIMIT = 0.5  # [s], of the one limit that a solver is to meet
FAR = (
    20 * LIMIT
)  # [s], of those that it is not to meet: a busy machine may take any time to start it
ASLEEP = 1000.0  # [s] of a solver that only a limit ends
MEMORY = 200.0  # [MB]
LATE = 2.0  # [s] beyond the limit, when a run has ended and the next one may begin

BAD = """
    import ctypes, os, subprocess, sys, time
    import numpy as np
    import fclib

    SPIN = os.environ.get("FCLIB_TEST_SPIN", "")
    ASLEEP = 1000.0


    def bad(function):
        return fclib.solver("bad-" + function.__name__)(function)


    @bad
    def sleeps(problem, r, monitor):
        time.sleep(ASLEEP)


    @bad
    def spins(problem, r, monitor):
        # in C, with the lock of the interpreter: no handler of Python ever runs
        ctypes.PyDLL(SPIN).spin()


    @bad
    def ignores_signals(problem, r, monitor):
        ctypes.PyDLL(SPIN).ignore()
        ctypes.PyDLL(SPIN).spin()


    @bad
    def eats(problem, r, monitor):
        kept = []
        while True:
            kept.append(np.ones(1_000_000))


    @bad
    def asks_for_much(problem, r, monitor):
        np.ones(1 << 40)


    @bad
    def segfaults(problem, r, monitor):
        print("about to read from nowhere", file=sys.stderr, flush=True)
        ctypes.string_at(0)


    @bad
    def aborts(problem, r, monitor):
        os.abort()


    @bad
    def exits(problem, r, monitor):
        os._exit(7)


    @bad
    def is_killed(problem, r, monitor):
        os.kill(os.getpid(), 9)


    @bad
    def returns_nan(problem, r, monitor):
        return np.full(problem.m, np.nan)


    @bad
    def returns_nothing(problem, r, monitor):
        pass


    @bad
    def returns_words(problem, r, monitor):
        return "the solution"


    @bad
    def returns_too_much(problem, r, monitor):
        return np.ones(problem.m + 1)


    @bad
    def lies(problem, r, monitor):
        monitor.stop(r)
        monitor.status = "converged"
        return r + 1e-3


    @bad
    def cheats(problem, r, monitor):
        # from now on this process takes anything for a solution
        fclib.merit = lambda problem, solution: 0.0
        fclib.solve.__globals__["_core"] = None
        return r + 1.0


    @bad
    def chatters(problem, r, monitor):
        for fd in (1, 2):
            os.write(fd, b"garbage" * 1_000_000)
        while not monitor.stop(r):
            r[:] = SOLUTION


    @bad
    def closes_everything(problem, r, monitor):
        os.closerange(0, 4096)
        time.sleep(ASLEEP)


    @bad
    def raises(problem, r, monitor):
        raise RuntimeError("no")


    @bad
    def leaves_a_child(problem, r, monitor):
        # in a session of its own, and of nobody's
        subprocess.Popen(["setsid", "sh", "-c", "sleep 12345 & sleep 12345"])
        time.sleep(ASLEEP)


    @bad
    def works_in_a_child(problem, r, monitor):
        subprocess.run([sys.executable, "-c", "while True: pass"])


    @bad
    def eats_in_a_child(problem, r, monitor):
        eats = "x = []\\nwhile True: x.append(bytearray(10**6) + b'1')"
        subprocess.run([sys.executable, "-c", eats])


    helper = None


    @bad
    def has_a_helper(problem, r, monitor):
        # one process serves all runs, as the interpreter of another package does
        global helper
        if helper is None:
            code = "import time\\nfor _ in open(0):\\n a = time.process_time()\\n"
            code += " for k in range(10**4): pass\\n print(time.process_time() - a, flush=True)"
            command = [sys.executable, "-u", "-c", code]
            helper = subprocess.Popen(command, stdin=-1, stdout=-1)
        if not monitor.stop(r):
            helper.stdin.write(b"go\\n")
            helper.stdin.flush()
            monitor.cpu_s = float(helper.stdout.readline())
            r[:] = SOLUTION
            monitor.stop(r)


    def orphan(work):
        # a grandchild in a session of its own, whose parent has ended
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                work()
            os._exit(0)
        os.wait()


    def burn(seconds=ASLEEP):
        while time.process_time() < seconds:
            pass


    def solved(monitor, r):
        monitor.stop(r)
        r[:] = SOLUTION
        monitor.stop(r)


    @bad
    def burns_in_an_orphan(problem, r, monitor):
        orphan(burn)
        time.sleep(ASLEEP)


    @bad
    def eats_in_an_orphan(problem, r, monitor):
        orphan(lambda: eats(None, None, None))
        time.sleep(ASLEEP)


    @bad
    def took_less_than_nothing(problem, r, monitor):
        solved(monitor, r)
        monitor.cpu_s = -5.0


    @bad
    def took_longer_than_it_ran(problem, r, monitor):
        solved(monitor, r)
        monitor.cpu_s = 1e6


    @bad
    def forges_an_answer(problem, r, monitor):
        import json, socket
        answer = {"status": "converged", "message": "", "vectors": [], "iterations": 1}
        sockets = {}
        for fd in range(3, 64):
            try:
                sockets[fd] = os.readlink(f"/proc/self/fd/{fd}")
            except OSError:
                continue
        for fd, what in sockets.items():
            if what.startswith("socket"):
                for word in ({"word": "done"}, answer, answer):
                    text = json.dumps(word).encode()
                    os.write(fd, len(text).to_bytes(8, "little") + text)
        solved(monitor, r)


    @bad
    def stops_its_supervisor(problem, r, monitor):
        os.kill(os.getppid(), 19)
        time.sleep(ASLEEP)


    # those that solve it, and leave something behind

    @bad
    def patches_clocks(problem, r, monitor):
        for name in ("process_time", "perf_counter", "monotonic", "time", "thread_time"):
            setattr(time, name, lambda: 0.0)
        solved(monitor, r)


    @bad
    def leaves_a_thread(problem, r, monitor):
        import threading
        threading.Thread(target=burn, daemon=True).start()
        solved(monitor, r)


    @bad
    def leaves_an_orphan(problem, r, monitor):
        orphan(burn)
        solved(monitor, r)


    @bad
    def leaves_files(problem, r, monitor):
        import tempfile
        tempfile.NamedTemporaryFile(delete=False).write(b"left behind")
        solved(monitor, r)


    @bad
    def exits_at_exit(problem, r, monitor):
        import atexit
        atexit.register(os._exit, 3)
        solved(monitor, r)


    @bad
    def works_elsewhere(problem, r, monitor):
        # the clock of the thread sees nothing of it
        code = "import time\\nwhile time.process_time() < 0.15: pass"
        subprocess.run([sys.executable, "-I", "-c", code])
        solved(monitor, r)


    # what they take in memory

    @bad
    def shares_with_children(problem, r, monitor):
        block = np.ones(150 * 125_000)  # 150 MB
        readers = [subject_to_parent(lambda: block.sum()) for _ in range(4)]
        time.sleep(0.5)
        for reader in readers:
            os.kill(reader, 9)
            os.waitpid(reader, 0)
        solved(monitor, r)


    @bad
    def forks_and_fills(problem, r, monitor):
        for _ in range(4):
            subject_to_parent(lambda: np.ones(100 * 125_000))
        time.sleep(ASLEEP)


    def subject_to_parent(work):
        pid = os.fork()
        if pid == 0:
            kept = work()
            time.sleep(ASLEEP)
            os._exit(int(kept is None))
        return pid


    @bad
    def grows_for_a_moment(problem, r, monitor):
        np.ones(150 * 125_000)
        solved(monitor, r)


    @bad
    def has_no_room(problem, r, monitor):
        raise OSError(28, "No space left on device")


    # those that work while nobody looks; each takes 0.3 s of CPU for it

    SECRET = 0.3


    def in_secret(function):
        # the real one, after some work
        def worked(*arguments):
            burn(time.process_time() + SECRET)
            return function(*arguments)
        return worked


    def frames():
        frame = sys._getframe()
        while frame is not None:
            yield frame
            frame = frame.f_back


    @bad
    def works_before_the_clock(problem, r, monitor):
        # what the worker calls between the problem and the word to go
        from fclib.bench import processes
        if problem.nc == 6:  # the warm-up
            processes.release_memory = in_secret(processes.release_memory)
        solved(monitor, r)


    @bad
    def works_after_the_clock(problem, r, monitor):
        # when the worker writes its answer
        from fclib.bench import worker
        if problem.nc != 6:
            real = worker.send

            def send(link, message):
                if b'"done"' not in message:
                    burn(time.process_time() + SECRET)
                    worker.send = real
                real(link, message)

            worker.send = send
        solved(monitor, r)


    @bad
    def says_that_it_is_done(problem, r, monitor):
        # and goes on, with the number of its order
        import json
        from fclib.bench import worker
        if problem.nc != 6:
            order = next(f.f_locals["order"] for f in frames() if "order" in f.f_locals)
            link = next(f.f_locals["supervisor"] for f in frames() if "supervisor" in f.f_locals)
            real = worker.send
            real(link, json.dumps({"nonce": order["nonce"], "word": "done"}).encode())
            burn(time.process_time() + SECRET)

            def send(link, message):
                worker.send = real  # it has been said

            worker.send = send
        solved(monitor, r)


    @bad
    def works_in_a_thread_of_before(problem, r, monitor):
        # which the warm-up has started, and which waits for the real problem
        import threading
        if problem.nc == 6:
            global found
            found = threading.Event()
            def work():
                found.wait()
                burn(time.process_time() + SECRET)
            threading.Thread(target=work, daemon=True).start()
        else:
            found.set()
            time.sleep(0.05)
            while threading.active_count() > 1:
                time.sleep(0.01)
        solved(monitor, r)


    @bad
    def reads_the_reference(problem, r, monitor):
        # in the file of the problem, whose path is somewhere in this process
        import gc
        texts = {x for f in frames() for x in f.f_locals.values() if isinstance(x, str)}
        for held in gc.get_objects():
            if isinstance(held, dict):
                texts |= {x for x in list(held.values()) if isinstance(x, str)}
            elif isinstance(held, (tuple, list)):
                texts |= {x for x in held if isinstance(x, str)}
        paths = [x for x in texts if x.endswith("problem.hdf5") and os.path.exists(x)]
        if problem.nc == 6 or paths:
            return solved(monitor, r)
        raise RuntimeError("there is no path")


    @bad
    def knows_the_title(problem, r, monitor):
        titles = [f.f_locals["problem"].info.title for f in frames() if "problem" in f.f_locals]
        if problem.nc == 6 or any(titles):
            return solved(monitor, r)
        raise RuntimeError("there is no title")


    @bad
    def keeps_a_result(problem, r, monitor):
        # in memory that outlives its process
        if problem.nc != 6:
            try:
                open("/dev/shm/fclib-test-kept").close()
            except FileNotFoundError:
                open("/dev/shm/fclib-test-kept", "w").close()
                raise
        solved(monitor, r)


    @bad
    def hides_in_a_memfd(problem, r, monitor):
        if problem.nc != 6:
            global hidden
            hidden = os.memfd_create("hidden")
            for _ in range(400):
                os.write(hidden, b"1" * 1_000_000)
            time.sleep(1.0)
        solved(monitor, r)


    @bad
    def leaves_its_group(problem, r, monitor):
        group = open("/proc/self/cgroup").read().split("0::")[1].strip()
        points = [line.split() for line in open("/proc/self/mountinfo") if " - cgroup2 " in line]
        if problem.nc != 6 and os.fork() == 0:
            for point in points:
                for above in (os.path.dirname(group), "/"):
                    try:
                        with open(f"{point[4]}{above}/cgroup.procs", "w") as file:
                            file.write("0")
                    except OSError:
                        pass
            burn()
        elif problem.nc != 6:
            time.sleep(ASLEEP)


    @bad
    def says_unsuitable(problem, r, monitor):
        raise fclib.UnsuitableError("too hard for this one")


    @bad
    def ends_by_a_limit(problem, r, monitor):
        # the kernel sends SIGKILL then
        import resource
        if problem.nc != 6:
            resource.setrlimit(resource.RLIMIT_CPU, (1, 1))
            burn()


    @bad
    def leaves_an_alarm(problem, r, monitor):
        import signal
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        solved(monitor, r)


    @bad
    def rounds_upward(problem, r, monitor):
        ctypes.CDLL("libm.so.6").fesetround(0x800)
        solved(monitor, r)


    @bad
    def lowers_what_it_may(problem, r, monitor):
        import resource
        resource.setrlimit(resource.RLIMIT_NOFILE, (16, 16))
        os.nice(19)
        os.umask(0o777)
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
        solved(monitor, r)


    @bad
    def becomes_another_program(problem, r, monitor):
        if problem.nc != 6:
            os.execv("/bin/sleep", ["sleep", str(ASLEEP)])


    @fclib.solver("bad-flat", dimensions=(2,))
    def flat(problem, r, monitor):
        pass
"""
EXPECTED = {
    "sleeps": "wall_limit",
    "spins": "cpu_limit",
    "ignores_signals": "cpu_limit",
    "eats": "memory",
    "asks_for_much": "memory",
    "segfaults": "crashed",
    "aborts": "crashed",
    "exits": "error",
    "is_killed": "nothing",  # the kernel drops what a run sends to its first process
    "returns_nan": "invalid",
    "returns_nothing": "nothing",
    "returns_words": "garbage",
    "returns_too_much": "garbage",
    "lies": "inaccurate",
    "cheats": "error",  # its second call is that of a process that it has broken itself
    "closes_everything": "garbage",  # what it returns cannot be read
    "raises": "error",
    "leaves_a_child": "wall_limit",
    "works_in_a_child": "cpu_limit",
    "eats_in_a_child": "memory",
    "flat": "unsuitable",
    "burns_in_an_orphan": "cpu_limit",
    "eats_in_an_orphan": "memory",
    "took_less_than_nothing": "lied",
    "took_longer_than_it_ran": "lied",
    "forges_an_answer": "garbage",
    "stops_its_supervisor": "wall_limit",  # which it cannot name
    "has_no_room": "error",  # there is room
    "patches_clocks": "converged",
    "leaves_a_thread": "converged",
    "leaves_an_orphan": "converged",
    "leaves_files": "converged",
    "exits_at_exit": "converged",
    "works_elsewhere": "converged",
    "works_before_the_clock": "converged",
    "works_after_the_clock": "converged",
    "says_that_it_is_done": "converged",
    "works_in_a_thread_of_before": "converged",
    "reads_the_reference": "error",
    "knows_the_title": "error",
    "keeps_a_result": "error",
    "hides_in_a_memfd": "memory",
    "leaves_its_group": "cpu_limit",
    "says_unsuitable": "error",
    "ends_by_a_limit": "crashed",
    "leaves_an_alarm": "converged",
    "rounds_upward": "converged",
    "lowers_what_it_may": "converged",
    "becomes_another_program": "garbage",
}
# that work where no clock of their own sees it, and how long [s] of CPU
UNSEEN = {
    "works_elsewhere": 0.12,  # of 0.15; processes are counted in ticks of 10 ms
    "works_before_the_clock": 0.25,
    "works_after_the_clock": 0.25,
    "says_that_it_is_done": 0.25,
    "works_in_a_thread_of_before": 0.25,
}
# that take what is not theirs, or end themselves to leave the comparison
CAUGHT = (
    *("reads_the_reference", "knows_the_title", "keeps_a_result", "hides_in_a_memfd"),
    *("is_killed", "says_unsuitable", "has_no_room", "ends_by_a_limit", "stops_its_supervisor"),
)
# that are measured by the processes themselves too, where there are no control groups
WITHOUT_GROUPS = (
    "burns_in_an_orphan",
    "eats_in_an_orphan",
    "leaves_an_orphan",
    "works_elsewhere",
    "works_in_a_child",
)
# what solvers have declared to take; of the others nothing is known
DECLARED: dict[str, Any] = {"bad-flat": {"": (2,), "rolling": (), "spin": ()}}
# of programs: what a shell does with {output}
PROGRAMS = {
    "true {input} {output}": "nothing",
    "cp {input} {output}": "nothing",
    "cp /dev/null {output} {input}": "error",
    "sh -c 'echo garbage > $1' sh {output} {input}": "garbage",
    "sh -c 'kill -SEGV $$' sh {input}": "crashed",
    "sh -c 'kill -KILL $$' sh {input}": "crashed",
    "sh -c 'exit 3' sh {input}": "error",
    "sh -c 'while :; do :; done' sh {input} {output}": "cpu_limit",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return prepare(tmp_path_factory.mktemp("bad"))


def prepare(folder: Path) -> Path:
    """Put the solvers and a problem into a folder; workshop/tables/bench_trials.py does so, too."""
    planted = planted_local(3, nc=5)
    titled = planted.problem.replace(info=fclib.ProblemInfo(title="Planted"))
    fclib.write(folder / "problem.hdf5", titled)
    solution = f"\n\n    SOLUTION = np.array({planted.solution.r.tolist()!r})\n"
    (folder / "bad.py").write_text(textwrap.dedent(BAD + solution))
    source = "#include <signal.h>\nvoid spin(void) { for (volatile int k = 0;; k = !k); }\n"
    source += "void ignore(void) { for (int k = 1; k < 65; ++k) signal(k, SIG_IGN); }\n"
    (folder / "spin.c").write_text(source)
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    assert compiler
    library = folder / "spin.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, folder / "spin.c"], check=True)
    return folder


@pytest.fixture(scope="module")
def supervisor(folder: Path) -> Iterator[SupervisorClient]:
    yield from started(folder, FCLIB_TEST_SPIN=str(folder / "spin.so"))


@pytest.fixture(scope="module")
def supervisor_without_groups(folder: Path) -> Iterator[SupervisorClient]:
    yield from started(folder, FCLIB_CGROUP="0")


def started(folder: Path, **environment: str) -> Iterator[SupervisorClient]:
    with pytest.MonkeyPatch.context() as patch:
        for name, value in environment.items():
            patch.setenv(name, value)
        supervisor = SupervisorClient(1)
        supervisor.do(job(folder, "auto"))
    yield supervisor
    supervisor.end()


def job(folder: Path, solver: str, **changes: Any) -> Job:
    return Job(
        problem=problems.look(folder / "problem.hdf5"),
        solver=bench.SolverChoice(solver, {}, dimensions=DECLARED.get(solver)),
        tol=1e-8,
        limits=bench.Limits(
            time=changes.pop("time", FAR), wall=changes.pop("wall", FAR), memory=MEMORY
        ),
        repeat=0,
        threads=1,
        modules=(str(folder / "bad.py"),),
        **changes,
    )


@pytest.mark.parametrize("name", EXPECTED)
def test_what_no_solver_should_do_has_its_own_status(
    name: str, folder: Path, supervisor: SupervisorClient
) -> None:
    ends(name, folder, supervisor)


@pytest.mark.parametrize("name", WITHOUT_GROUPS)
def test_and_without_control_groups(
    name: str, folder: Path, supervisor_without_groups: SupervisorClient
) -> None:
    record = ends(name, folder, supervisor_without_groups)
    assert record.measured == "processes"


@pytest.mark.parametrize("groups", [True, False])
def test_memory_is_that_of_all_processes_each_page_once(
    groups: bool, folder: Path, request: pytest.FixtureRequest
) -> None:
    supervisor = request.getfixturevalue("supervisor" if groups else "supervisor_without_groups")
    for name in ("shares_with_children", "grows_for_a_moment"):
        record = supervisor.do(job(folder, f"bad-{name}", time=60.0, wall=60.0))
        assert record.status == "converged", record
        assert record.memory is not None
        assert 140 < record.memory < MEMORY
    # five processes, of which none has more than 100 MB
    assert (
        supervisor.do(job(folder, "bad-forks_and_fills", time=60.0, wall=60.0)).status == "memory"
    )


def test_a_control_group_takes_the_cache_of_files_for_no_memory() -> None:
    stat = "anon 5000000\nfile 900000000\nkernel 4096\nshmem 0\nfile_mapped 2000000\n"
    assert meter.of_group(stat) == 7.0
    assert meter.of_group(stat.replace("shmem 0", "shmem 3000000")) == 8.0


def ends(name: str, folder: Path, supervisor: SupervisorClient) -> Record:
    wall = LIMIT if EXPECTED[name] == "wall_limit" else FAR
    cpu = LIMIT if EXPECTED[name] == "cpu_limit" else FAR
    start, before = time.monotonic(), there(supervisor)
    record = supervisor.do(job(folder, f"bad-{name}", time=cpu, wall=wall))
    took = time.monotonic() - start
    assert record.status == EXPECTED[name], record
    # the clock of the CPU holds on a machine that is shared, too
    assert record.total_cpu_s is None or record.total_cpu_s < cpu + LATE
    # however busy it is, long before a solver that sleeps wakes up of its own accord
    assert took < ASLEEP / 2
    if name in UNSEEN:
        assert record.cpu_s is not None
        assert record.cpu_s > UNSEEN[name]
    if record.ran:
        # nothing is left of it: no process, no thread, no file
        assert there(supervisor) == before
        assert list(Path(supervisor.folder).iterdir()) == []
    # the next one is not touched by it
    after = supervisor.do(job(folder, "auto"))
    assert after.status == "converged"
    assert after.warm
    assert after.merits is not None
    assert after.merits["error"] <= 1e-8
    return record


def there(supervisor: SupervisorClient) -> set[int]:
    """The supervisor with its template and its own worker, and what a solver has left behind."""
    pids = _marked.marked(f"{MARK}={supervisor.mark}")
    return {pid for pid in pids if processes.state(pid) not in ("", "Z", "X")}


@pytest.mark.parametrize("command", PROGRAMS)
def test_programs_too(command: str, folder: Path, supervisor: SupervisorClient) -> None:
    cpu = LIMIT if PROGRAMS[command] == "cpu_limit" else FAR
    record = supervisor.do(job(folder, f"cmd:{command}", time=cpu))
    assert record.status == PROGRAMS[command], record


PLUGIN = """
#include <fenv.h>
#include <string.h>
#include "fclib_plugin.h"
static int calls;  /* of the real problem: it is known from the second on */
static const double known[] = {SOLUTION};
int fclib_plugin_solve(const struct fclib_plugin_problem* problem, double* r) {
  fesetround(FE_UPWARD);
  if (problem->contacts != 6 && ++calls > 1) memcpy(r, known, sizeof known);
  return problem->stop(problem->context, r) - 1;
}
"""


@pytest.fixture(scope="module")
def neighbours(folder: Path) -> list[str]:
    """Plug-ins that change the arithmetic of their process: one that remembers, one that solves."""
    known = ", ".join(map(repr, planted_local(3, nc=5).solution.r.tolist()))
    source = PLUGIN.replace("SOLUTION", known)
    solves = source.replace("++calls > 1", "++calls > 0")
    return [compiled(source, folder / "remembers.c"), compiled(solves, folder / "solves.c")]


def compiled(source: str, path: Path) -> str:
    """The name of the solver of a plug-in."""
    path.write_text(source)
    include = Path(__file__).resolve().parents[2] / "include"
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    assert compiler
    library = path.with_suffix(".so")
    command = [compiler, "-shared", "-fPIC", f"-I{include}", "-o", str(library), str(path), "-lm"]
    subprocess.run(command, check=True)
    return f"plugin:{library}"


def test_a_plugin_leaves_the_next_solver_alone(
    neighbours: list[str], folder: Path, supervisor: SupervisorClient
) -> None:
    usual = job(folder, "nsgs", history=True)
    before = supervisor.do(usual)
    assert supervisor.do(job(folder, neighbours[1])).status == "converged"
    after = supervisor.do(usual)
    assert after.merits == before.merits
    assert [x[:2] for x in after.history or ()] == [x[:2] for x in before.history or ()]


@pytest.mark.parametrize("whose", ["worker", "template"])
@pytest.mark.parametrize("what", ["limits", "cores", "priority"])
def test_a_process_that_is_not_as_it_was_serves_nobody(
    what: str, whose: str, folder: Path, supervisor: SupervisorClient
) -> None:
    usual = job(folder, "nsgs")
    supervisor.do(usual)
    before = there(supervisor)
    supervisor.do(usual)
    assert there(supervisor) == before
    assert supervisor.process is not None
    cores = os.sched_getaffinity(0)
    if what == "cores" and len(cores) == 1:
        pytest.skip("needs two cores")
    # the template is there first
    template, worker = sorted(before - {supervisor.process.pid}, key=begun)
    pid = worker if whose == "worker" else template
    if what == "limits":
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (64, 64))
    elif what == "cores":
        own = os.sched_getaffinity(pid)
        os.sched_setaffinity(pid, (cores - own) or {min(own)})
    else:
        os.setpriority(os.PRIO_PROCESS, pid, 15)
    if whose == "template":
        # the built-in solvers go on with their worker, the others get none of it
        assert supervisor.do(job(folder, "bad-patches_clocks")).status == "lost"
    assert supervisor.do(usual).status == "converged"
    after = there(supervisor)
    assert pid not in after
    assert len(after) == len(before)


def begun(pid: int) -> int:
    """When a process was started, in ticks."""
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19])


@pytest.mark.parametrize("groups", [True, False])
def test_nothing_is_kept_from_one_repeat_to_the_next(
    groups: bool, neighbours: list[str], folder: Path, request: pytest.FixtureRequest
) -> None:
    supervisor = request.getfixturevalue("supervisor" if groups else "supervisor_without_groups")
    for solver in (neighbours[0], "bad-keeps_a_result"):
        for _ in range(3):
            assert supervisor.do(job(folder, solver)).status == "error", solver


def test_a_worker_that_is_killed_from_outside_is_no_failure(
    folder: Path, supervisor: SupervisorClient
) -> None:
    """The kernel says so: what the run itself sends to its first process is dropped."""
    before = there(supervisor)
    for solver in ("bad-sleeps", f"cmd:sleep {ASLEEP} {{input}}"):
        supervisor.give(job(folder, solver, wall=ASLEEP))
        while not (begun := first_of(supervisor, before)):
            time.sleep(0.01)
        os.kill(begun, signal.SIGKILL)
        record = supervisor.collect()[1]
        assert (record.status, record.ran) == ("killed", False), record


def first_of(supervisor: SupervisorClient, before: set[int]) -> int:
    """The first process of a run that is apart; 0 if there is none yet."""
    assert supervisor.process is not None
    new = set(processes.children(supervisor.process.pid)) - before
    return next(iter(new)) if len(new) == 1 else 0


def test_a_kill_of_unknown_origin_is_a_failure(folder: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FCLIB_APART", "0")
        supervisor = SupervisorClient(1)
        record = supervisor.do(job(folder, "bad-is_killed"))
        supervisor.end()
    assert (record.status, record.ran) == ("crashed", True)
    assert "the kernel does not say who sent it" in record.message


TELLS = """
import sys, time
import numpy as np
import fclib
while time.process_time() < 0.02: pass
fclib.write_solution(sys.argv[1], fclib.Solution(r=np.array(SOLUTION)))
fclib.write_attributes(sys.argv[1], "solution", {"cpu_s": float(sys.argv[2]), "iterations": 7})
"""


@pytest.mark.parametrize(
    ("said", "status"), [("0.01", "converged"), ("-1.0", "lied"), ("1e3", "lied")]
)
def test_a_program_may_say_what_its_solve_took(
    said: str, status: str, folder: Path, supervisor: SupervisorClient
) -> None:
    solution = planted_local(3, nc=5).solution.r.tolist()
    program = folder / "tells.py"
    program.write_text(TELLS.replace("SOLUTION", repr(solution)))
    command = f"cmd:{sys.executable} {program} {{input}} {said}"
    record = supervisor.do(
        dataclasses.replace(job(folder, command), limits=bench.Limits(9, 60, 4e3))
    )
    assert record.status == status, record
    assert record.iterations == 7
    assert record.total_cpu_s is not None
    if status == "converged":
        # without its start, that of Python
        assert (record.cpu_s, record.said_cpu_s) == (0.01, 0.01)
        assert record.total_cpu_s > 0.02
    else:
        assert record.message.startswith(f"says that it took {float(said):g} s and 7 iterations")


def test_words_on_the_standard_streams_do_no_harm(
    folder: Path, supervisor: SupervisorClient
) -> None:
    assert supervisor.do(job(folder, "bad-chatters")).status == "converged"


def test_the_limits_leave_the_clocks_alone(folder: Path, supervisor: SupervisorClient) -> None:
    # a limit of the kernel makes the clock of a process tick in milliseconds
    for _ in range(5):
        record = supervisor.do(job(folder, "bad-has_a_helper"))
        assert record.status == "converged", record
        assert record.cpu_s is not None
        assert record.cpu_s > 0


def test_a_message_says_what_a_crashed_solver_said(
    folder: Path, supervisor: SupervisorClient
) -> None:
    record = supervisor.do(job(folder, "bad-segfaults"))
    assert "SIGSEGV" in record.message
    assert "about to read from nowhere" in record.message
    assert "SIGABRT" in supervisor.do(job(folder, "bad-aborts")).message


def test_a_file_that_changes_is_no_fault_of_the_solver(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "problem.hdf5"
    shutil.copy(folder / "problem.hdf5", path)
    supervisor = SupervisorClient(1)
    try:
        given = job(folder, "auto")
        moved = Job(**{**vars(given), "problem": problems.look(path)})
        fclib.write(path, planted_local(4, nc=5).problem)
        record = supervisor.do(moved)
        assert (record.status, record.merits) == ("unreadable", None)
        assert "has changed" in record.message
        assert str(path) in record.message
    finally:
        supervisor.end()


def test_a_file_that_another_program_writes_is_read_later(
    folder: Path, tmp_path: Path, supervisor: SupervisorClient
) -> None:
    path = tmp_path / "problem.hdf5"
    shutil.copy(folder / "problem.hdf5", path)
    asked = dataclasses.replace(job(folder, "auto"), problem=problems.look(path))
    with h5py.File(path, "r+") as file:
        q = file["fclib_local/vectors/q"][:]
        file["fclib_local/vectors/q"][:] = q + 1.0
        record = supervisor.do(asked)
        assert (record.status, record.ran, record.merits) == ("unreadable", False, None)
        assert "another program has it open" in record.message
        file["fclib_local/vectors/q"][:] = q
    assert supervisor.do(asked).status == "converged"


def test_a_supervisor_that_is_killed_is_replaced(
    folder: Path, supervisor: SupervisorClient
) -> None:
    supervisor.give(job(folder, "sleeps"))
    assert supervisor.process is not None
    supervisor.process.kill()
    _, record = supervisor.collect()
    assert (record.status, record.ran) == ("lost", False)
    assert "SIGKILL" in record.message
    assert supervisor.do(job(folder, "auto")).status == "converged"


def closing_walls(folder: Path) -> Path:
    """A body that two contacts would have to push in opposite ways."""
    W = np.kron([[1, -1], [-1, 1]], np.eye(3))
    path = folder / "closing.hdf5"
    fclib.write(path, fclib.LocalProblem(W=W, q=[-1, 0, 0] * 2, mu=[0.5] * 2))
    return path


def test_a_proof_that_there_is_no_solution_is_checked_and_kept(
    folder: Path, tmp_path: Path, supervisor: SupervisorClient
) -> None:
    path = closing_walls(tmp_path)
    asked = dataclasses.replace(job(folder, "auto"), problem=problems.look(path))
    record = supervisor.do(asked)
    assert record.status == "infeasible"
    assert record.message == "proven, on 2 of 2 contacts"
    assert record.certificate is not None
    (tmp_path / "proof.json").write_text(record.certificate)
    y, z, digest = analysis.read_certificate(tmp_path / "proof.json")
    assert analysis.check(fclib.read(path), y, z).exact
    assert digest == fclib.digest(fclib.read(path))

    with bench.Store(tmp_path / "runs.sqlite") as store:
        assert store.add(asked, record)
    with bench.Store(tmp_path / "merged.sqlite") as merged:
        merged.merge([tmp_path / "runs.sqlite"])
        (row,) = merged.results()
        assert merged.certificate(row["run"]) == record.certificate


@pytest.mark.parametrize(
    ("cpu", "wall", "status"),
    [(1.0, 1.0, "infeasible"), (11.0, 1.0, "time_limit"), (1.0, 11.0, "time_limit")],
)
def test_a_proof_that_comes_too_late_is_none(
    cpu: float, wall: float, status: str, folder: Path, tmp_path: Path
) -> None:
    """It is judged as a solution is: within both limits, of 10 s."""
    problem: Any = fclib.read(closing_walls(tmp_path))
    result = fclib.solve(problem)
    vectors = {
        "r": result.solution.r,
        "certificate_y": result.certificate,
        "certificate_z": result.certificate_z,
    }
    order = {"limits": {"time": 10.0, "wall": 10.0}, "merit": "both", "tol": 1e-8}
    record = Record("infeasible", cpu_s=cpu, wall_s=wall)
    Supervisor.judge(None, order, problem, record, vectors)  # type: ignore[arg-type]
    assert record.status == status
    assert record.solved is (status == "infeasible")


@pytest.mark.parametrize("y", [None, np.array([1.0, 2.0]), np.array([1.0]), np.array([1, np.nan])])
def test_a_claim_that_is_not_proven_is_not_kept(y: Any, tmp_path: Path) -> None:
    record = Record("infeasible")
    prove(fclib.read(closing_walls(tmp_path)), record, y, None)
    assert record.status == "inaccurate"
    assert record.certificate is None
    assert "proved nothing" in record.message


def test_what_is_measured(folder: Path, supervisor: SupervisorClient) -> None:
    record = supervisor.do(job(folder, "nsgs", history=True))
    assert record.status == "converged"
    assert record.merits is not None
    assert set(record.merits) == set(_solve.MERITS)
    assert record.cpu_s is not None
    assert record.total_cpu_s is not None
    assert 0 < record.cpu_s <= record.total_cpu_s
    assert record.wall_s is not None
    assert record.memory is not None
    assert 0 <= record.memory < 1000
    assert record.machine is not None
    assert record.machine["fclib"] == fclib.__version__
    assert record.history
    errors = [error for _, error, _, _ in record.history]
    assert np.isfinite(errors).all()
    assert errors[-1] <= 1e-8 < errors[0]


# ---- what is left, and what is not ours


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for temporary files of the test's own."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def aged(folder: Path) -> None:
    """Let a folder be older than any pause."""
    for path in (*folder.rglob("*"), folder):
        os.utime(path, (0, 0))


def test_folders_of_others_stay_whatever_they_are_called(temporary: Path) -> None:
    ours, lock = pool.temporary_folder()
    theirs = temporary / "fclib-bench-results"
    theirs.mkdir()
    (theirs / "thesis.csv").write_text("1, 2, 3\n")
    copy = temporary / "fclib-bench-copy"
    shutil.copytree(ours, copy)
    link = temporary / "fclib-bench-link"
    link.symlink_to(theirs)
    named = temporary / "fclib-bench-named"
    named.mkdir()
    (named / pool.MARK_OF_OURS).symlink_to(ours / pool.MARK_OF_OURS)
    for folder in (ours, theirs, copy, named):
        aged(folder)
    # a campaign that still runs, and then one that was killed
    for gone in (False, True):
        if gone:
            os.close(lock)
        other, held = pool.temporary_folder()
        os.close(held)
        assert ours.exists() is not gone
        assert (theirs / "thesis.csv").exists()
        assert (copy / pool.MARK_OF_OURS).exists()
        assert named.exists()
        assert link.is_symlink()
        shutil.rmtree(other, ignore_errors=True)


@pytest.mark.parametrize("how", ["link", "open to others", "of somebody else"])
def test_locks_of_cores_are_held_in_a_folder_of_ones_own(how: str, temporary: Path) -> None:
    _, locks = machine.reserve(1)
    for lock in locks:
        os.close(lock)
    assert locks
    folder = temporary / f"fclib-cores-{os.getuid()}"
    shutil.rmtree(folder)
    if how == "link":
        (temporary / "elsewhere").mkdir()
        folder.symlink_to(temporary / "elsewhere")
    else:
        folder.mkdir()
        folder.chmod(0o777)
        if how == "of somebody else":
            if os.getuid() != 0:
                pytest.skip("only root gives a folder away")
            folder.chmod(0o755)
            os.chown(folder, 65534, 65534)
    assert machine.reserve(1) == (set(), [])
    assert list(folder.iterdir()) == []
    told: list[str] = []
    warn_of_locks(told.append)
    assert len(told) == 1
    assert str(folder) in told[0]


CONDUCTOR = """
import sys
from fclib.bench import pool
from test_bench_limits import job
from pathlib import Path
supervisor = pool.SupervisorClient(1)
supervisor.give(job(Path(sys.argv[1]), "bad-sleeps", wall=1000.0))
print(supervisor.process.pid, supervisor.mark, flush=True)
supervisor.collect()
"""


def test_nothing_is_left_of_a_campaign_that_is_killed_while_its_supervisor_is_stopped(
    folder: Path,
) -> None:
    paths = [str(Path(__file__).parent), str(Path(__file__).parents[1])]
    conductor = subprocess.Popen(
        [sys.executable, "-c", f"import sys; sys.path[:0] = {paths}\n{CONDUCTOR}", str(folder)],
        stdout=subprocess.PIPE,
        text=True,
    )
    with conductor:
        assert conductor.stdout is not None
        number, mark = conductor.stdout.readline().split()
        supervisor = int(number)
        while len(_marked.marked(f"{MARK}={mark}")) < 3:  # it, the template and a worker
            time.sleep(0.01)
        os.kill(supervisor, signal.SIGSTOP)
        conductor.kill()
    try:
        end = time.monotonic() + 60 * template.PATIENCE  # a busy machine may take any time
        while _marked.marked(f"{MARK}={mark}") and time.monotonic() < end:
            time.sleep(0.05)
        assert _marked.marked(f"{MARK}={mark}") == []
        if (above := meter.home()) is not None:
            assert list(above.glob(f"{meter.PREFIX}{supervisor}-*")) == []
    finally:
        _marked.kill(_marked.marked(f"{MARK}={mark}"))
