"""What the bench withstands, and how well it repeats itself.

    python -m workshop.tables.bench_trials nasty               # solvers that cheat and leak
    python -m workshop.tables.bench_trials liars               # who wins by what, still
    python -m workshop.tables.bench_trials kills --kills 200   # of workers and supervisors
    python -m workshop.tables.bench_trials dask --kills 20     # of workers of Dask
    python -m workshop.tables.bench_trials slurm --kills 20    # of jobs of Slurm
    python -m workshop.tables.bench_trials twice --jobs 1      # the same campaign two times

`nasty` runs the solvers of tests/python/test_bench_limits.py: by how much each exceeds its limit,
and the CPU time of a run after it over that of one before. `liars` runs those that hide their work,
and says which of them still win. `kills`, `dask` and `slurm` compare every row with that of a quiet
campaign; `slurm` starts a Slurm of its own, as root. `twice` compares statuses, iterations and
times. Each ends with exit status 1 if something is not as it should be.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import importlib
import os
import random
import signal
import socket
import statistics
import sys
import tempfile
import textwrap
import threading
import time
from pathlib import Path
from typing import Any

from fclib import bench
from fclib.bench import cluster, pool, processes
from workshop.tables import _results

ROOT = Path(__file__).resolve().parents[2]
LATE = 2.0  # [s] beyond its limit, when a run has to have ended
TOUCHED = 0.2  # change of the CPU time of the next run
SAME = ("problem", "solver", "tol", "repeat", "status", "solved", "iterations", "error")
FLOOD = """

@bad
def floods(problem, r, monitor):
    # 10 GB of output, as far as it comes within its limit
    for _ in range(10_000):
        for fd in (1, 2):
            os.write(fd, b"garbage " * 62_500)
    solved(monitor, r)
"""
# those that still look better than they are, and what it would cost to stop each
LIARS = """

@bad
def keeps_a_file(problem, r, monitor):
    # beside those that are removed
    import tempfile
    place = os.path.join(os.path.dirname(os.path.dirname(tempfile.gettempdir())), "kept-by-bad")
    if problem.nc != 6:
        if not os.path.exists(place):
            burn(time.process_time() + SECRET)
            open(place, "w").close()
    solved(monitor, r)


@bad
def knows_by_heart(problem, r, monitor):
    # a table of answers, by the numbers of the problem
    if problem.nc != 6 and not np.allclose(problem.q, QS):
        burn(time.process_time() + SECRET)
    solved(monitor, r)


@bad
def calls_its_work_setup(problem, r, monitor):
    # in a thread, and in the answer of its process
    import json, threading
    from fclib.bench import worker
    if problem.nc != 6:
        work = threading.Thread(target=burn, args=(time.process_time() + SECRET,))
        work.start()
        work.join()
        real = worker.send

        def send(link, message):
            if b"setup_s" in message:
                said = json.loads(message) | {"setup_s": 0.9 * SECRET}
                message = json.dumps(said).encode()
            real(link, message)

        worker.send = send
    solved(monitor, r)


@bad
def asks_a_server(problem, r, monitor):
    # of the user's, which runs beside the campaign
    import socket
    if problem.nc != 6:
        with socket.create_connection(("127.0.0.1", SERVER)) as link:
            link.recv(1)
    solved(monitor, r)


@bad
def takes_little_at_a_time(problem, r, monitor):
    # what may be used between the problem and the clock
    from fclib.bench import processes
    if problem.nc == 6:
        def release():
            burn(time.process_time() + 0.015)
        processes.release_memory = release
    solved(monitor, r)
"""
PROGRAM = """
import sys, time
import numpy as np
import fclib
while time.process_time() < 0.5: pass
fclib.write_solution(sys.argv[1], fclib.Solution(r=np.array(SOLUTION)))
fclib.write_attributes(sys.argv[1], "solution", {"cpu_s": 0.001, "iterations": 1})
"""
SECRET = 0.3  # [s] of CPU that each works for, if it can
REST = {  # by what they win, and what it would cost to stop them
    "keeps_a_file": (
        "a file that outlives the run",
        "a file system of its own for each run: solvers"
        " that need their licence, cache or home would not run",
    ),
    "knows_by_heart": ("answers that it has learned", "`renumber = true`: a solve for each copy"),
    "calls_its_work_setup": (
        "words of its own process",
        "a process that converts, and one that"
        " solves: the driver cut in two, and each problem copied twice",
    ),
    "asks_a_server": (
        "a process of the user's outside",
        "a network of its own: licence servers and MPI would not run",
    ),
    "takes_little_at_a_time": (
        "the time to take the problem over",
        "nothing: it is at most 20 ms and five times the handing over",
    ),
    "says_its_own_time": (
        "a program that says what its solve took",
        "`--metric total_cpu_s`: its start, reading and writing count too",
    ),
}


def campaign(**changes: Any) -> bench.Campaign:
    """Small problems, by three solvers."""
    entries: dict[str, Any] = {
        "name": "trials",
        "solvers": ["auto", "nsgs", "nsn-ac"],
        "tolerances": [1e-6],
        "repeats": 1,
        "problems": [{"planted": {"count": 6, "contacts": 60, "seed": 1}, "family": "planted"}],
    }
    return bench.Campaign.of(entries | changes)


def rows_of(path: Path) -> list[dict[str, Any]]:
    """The runs of a store, by what they are of."""
    with bench.Store(path) as store:
        return sorted(store.results(), key=lambda row: [str(row[name]) for name in SAME[:4]])


def nasty(folder: Path, _: argparse.Namespace) -> tuple[list[dict[str, Any]], bool]:
    """A row a solver."""
    sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "python")]
    trials: Any = importlib.import_module("test_bench_limits")
    trials.BAD += textwrap.indent(FLOOD, "    ")
    trials.EXPECTED["floods"] = "cpu_limit or wall_limit"
    prepared = folder / "bad"
    prepared.mkdir()
    trials.prepare(prepared)
    os.environ["FCLIB_TEST_SPIN"] = str(prepared / "spin.so")
    supervisor = pool.SupervisorClient(1)
    found, good = [], True
    usual = dataclasses.replace(
        trials.job(prepared, "nsn-ac"), problem=campaign().plan()[0].problem
    )
    for name, expected in trials.EXPECTED.items():
        wall = trials.LIMIT if expected == "wall_limit" else 60 * trials.LIMIT
        cpu = trials.LIMIT if "cpu_limit" in expected else trials.FAR
        before = least(supervisor, usual)
        record = supervisor.do(trials.job(prepared, f"bad-{name}", wall=wall, time=cpu))
        after = least(supervisor, usual)
        over = (record.total_cpu_s or 0.0) - cpu
        if expected == "wall_limit":
            over = (record.wall_s or 0.0) - trials.LIMIT
        right = (
            record.status in expected.split(" or ")
            and over < LATE
            and after < (1 + TOUCHED) * before
        )
        good = good and right
        found.append(
            {
                "solver": name,
                "status": record.status,
                "beyond its limit [s]": max(0.0, over),
                "next run's CPU, over that before": after / before,
                "as it should be": "yes" if right else f"no, expected {expected}",
            }
        )
    supervisor.end()
    return found, good


def liars(folder: Path, _: argparse.Namespace) -> tuple[list[dict[str, Any]], bool]:
    """Who wins by what: solvers that hide work, and what it would cost to stop the rest."""
    sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "python")]
    trials: Any = importlib.import_module("test_bench_limits")
    planted: Any = importlib.import_module("helpers").planted_local(3, nc=5)
    server = socket.create_server(("127.0.0.1", 0))

    def work() -> None:
        while True:
            with contextlib.suppress(OSError), server.accept()[0] as link:
                end = time.thread_time() + SECRET
                while time.thread_time() < end:
                    pass
                link.send(b"1")

    threading.Thread(target=work, daemon=True).start()
    port = server.getsockname()[1]
    known = f"\n\nSERVER = {port}\nQS = np.array({planted.problem.q.tolist()!r})\n"
    trials.BAD += textwrap.indent(LIARS + known, "    ")
    prepared = trials.prepare(folder)
    os.environ["FCLIB_TEST_SPIN"] = str(prepared / "spin.so")
    program = folder / "says.py"
    program.write_text(PROGRAM.replace("SOLUTION", repr(planted.solution.r.tolist())))
    commands = {"says_its_own_time": f"cmd:{sys.executable} {program} {{input}}"}
    supervisor = pool.SupervisorClient(1)
    found = []
    for name in [*trials.UNSEEN, *trials.CAUGHT, *REST]:
        asked = trials.job(prepared, commands.get(name, f"bad-{name}"))
        record = [supervisor.do(asked) for _ in range(2)][1]
        counted = record.cpu_s or 0.0
        wins = name in REST and record.status == "converged" and counted < 0.5 * SECRET
        by, cost = REST.get(name, ("", ""))
        found.append(
            {
                "solver": name,
                "status": record.status,
                "CPU that counts [s]": record.cpu_s,
                "CPU of the run [s]": record.total_cpu_s,
                "wins": "yes" if wins else "no",
                "by": by,
                "what it would cost to stop it": cost,
            }
        )
    supervisor.end()
    server.close()
    good = all((row["wins"] == "yes") == (row["solver"] in REST) for row in found)
    return found, good


def least(supervisor: pool.SupervisorClient, job: Any) -> float:
    """[s] of CPU of a solve, the least of twelve."""
    return min(supervisor.do(job).cpu_s or float("inf") for _ in range(12))


def kills(folder: Path, arguments: argparse.Namespace) -> tuple[list[dict[str, Any]], bool]:
    """Compare a campaign of which processes are killed with a quiet one."""
    chosen = campaign(repeats=arguments.repeats)
    bench.run_campaign(chosen, folder / "quiet.sqlite", jobs=2)
    stop = threading.Event()
    killed = {"supervisors": 0, "workers": 0}
    draw = random.Random(1)

    def kill() -> None:
        while not stop.is_set() and sum(killed.values()) < arguments.kills:
            time.sleep(draw.uniform(0.02, 0.15))
            supervisors = [
                pid
                for pid in processes.children(os.getpid())
                if pool.MARK.encode() in environment(pid)
            ]
            workers = [pid for one in supervisors for pid in processes.children(one)]
            kind = "workers" if draw.random() < 0.7 else "supervisors"
            if targets := workers if kind == "workers" else supervisors:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(draw.choice(targets), signal.SIGKILL)
                    killed[kind] += 1

    killer = threading.Thread(target=kill)
    killer.start()
    starts = 0
    while True:
        starts += 1
        progress = bench.run_campaign(chosen, folder / "killed.sqlite", jobs=2)
        if progress.done == progress.planned or starts > 100:
            break
    stop.set()
    killer.join()
    quiet, loud = rows_of(folder / "quiet.sqlite"), rows_of(folder / "killed.sqlite")
    different = sum(
        any(a[name] != b[name] for name in SAME) for a, b in zip(quiet, loud, strict=False)
    ) + abs(len(quiet) - len(loud))
    entry = {"runs": len(quiet), **killed, "campaigns begun": starts, "rows that differ": different}
    return [entry], different == 0 and sum(killed.values()) >= arguments.kills


def environment(pid: int) -> bytes:
    """That a process was started with."""
    try:
        return Path(f"/proc/{pid}/environ").read_bytes()
    except OSError:
        return b""


def on_cluster(
    folder: Path, kills: int, repeats: int, runner: Any, kill: Any
) -> tuple[list[dict[str, Any]], bool]:
    """Compare a campaign on a cluster of which parts are killed with a quiet one."""
    chosen = campaign(repeats=repeats)
    bench.run_campaign(chosen, folder / "quiet.sqlite", jobs=2)
    killed = 0
    every = max(1, len(chosen.plan()) // (kills + 1))

    def show(progress: bench.Progress) -> None:
        nonlocal killed
        if killed < kills and progress.done >= (killed + 1) * every:
            killed += kill()

    start = time.monotonic()
    progress = bench.run_campaign(chosen, folder / "loud.sqlite", runner=runner, show=show)
    took = time.monotonic() - start
    quiet, loud = rows_of(folder / "quiet.sqlite"), rows_of(folder / "loud.sqlite")
    different = sum(
        any(a[name] != b[name] for name in SAME) for a, b in zip(quiet, loud, strict=False)
    )
    lost = progress.planned - len(loud)
    entry = {
        "runs": len(quiet),
        "kills": killed,
        "runs lost": lost,
        "rows that differ": different,
        "wall clock [s]": took,
    }
    return [entry], killed >= kills and lost == different == 0


def dask(folder: Path, arguments: argparse.Namespace) -> tuple[list[dict[str, Any]], bool]:
    """A campaign on a Dask cluster of which workers are killed, against a quiet one."""
    sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "python")]
    trials: Any = importlib.import_module("test_bench_cluster")
    port = trials.free_port()
    address = f"tcp://127.0.0.1:{port}"
    words = ("worker", "--nthreads=1", "--no-nanny", "--no-dashboard", address)
    scheduler = trials.started("scheduler", "--host=127.0.0.1", f"--port={port}", "--no-dashboard")
    workers = [trials.started(*words) for _ in range(2)]
    draw = random.Random(1)

    def kill() -> int:
        gone = workers.pop(draw.randrange(2))
        gone.kill()
        gone.wait()
        workers.append(trials.started(*words))  # as whoever keeps a cluster does
        return 1

    try:
        with cluster.on_scheduler(address) as runner:
            found, good = on_cluster(folder, arguments.kills, arguments.repeats, runner, kill)
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()
    return [{"cluster": "Dask, 2 workers", "killed": "a worker, SIGKILL", **found[0]}], good


def slurm(folder: Path, arguments: argparse.Namespace) -> tuple[list[dict[str, Any]], bool]:
    """A campaign on a Slurm of one node of which jobs are cancelled, against a quiet one."""
    sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "python")]
    trials: Any = importlib.import_module("test_bench_cluster")
    # one job of two processes
    options = {"workers": "2", "cores": "2", "memory": "1GB", "output": "/dev/null"}
    with trials.slurm_of_one_node(folder), cluster.on_slurm(options, tell=lambda _: None) as runner:

        def kill() -> int:
            jobs = trials.jobs_of_slurm()
            trials.cancelled()
            return len(jobs)

        found, good = on_cluster(folder, arguments.kills, arguments.repeats, runner, kill)
        return [{"cluster": "Slurm, 1 job of 2", "killed": "the job, scancel", **found[0]}], good


def twice(folder: Path, arguments: argparse.Namespace) -> tuple[list[dict[str, Any]], bool]:
    """Compare a campaign with itself."""
    chosen = campaign(repeats=arguments.repeats)
    for name in ("first", "second"):
        bench.run_campaign(chosen, folder / f"{name}.sqlite", jobs=arguments.jobs)
    first, second = rows_of(folder / "first.sqlite"), rows_of(folder / "second.sqlite")
    different = sum(
        any(a[name] != b[name] for name in SAME) for a, b in zip(first, second, strict=True)
    )
    best: list[dict[tuple[str, str], float]] = [{}, {}]
    for own, rows in zip(best, (first, second), strict=True):
        for row in rows:
            key = row["problem"], row["solver"]
            own[key] = min(own.get(key, float("inf")), row["cpu_s"])
    ratios = [best[1][key] / best[0][key] for key in best[0]]
    median = statistics.median(ratios)
    entry = {
        "runs": len(first),
        "rows that differ": different,
        "median ratio of times": median,
        "least": min(ratios),
        "largest": max(ratios),
        "load": os.getloadavg()[0],
    }
    return [entry], different == 0 and abs(median - 1) < 0.05


TRIALS = {
    "nasty": nasty,
    "liars": liars,
    "kills": kills,
    "dask": dask,
    "slurm": slurm,
    "twice": twice,
}


def main() -> None:
    """Run one of them, and print its table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("trial", choices=TRIALS)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=1)
    _results.add_option(parser)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows, good = TRIALS[arguments.trial](Path(folder), arguments)
    for row in rows:
        shown = (f"{v:.3g}" if isinstance(v, float) else str(v) for v in row.values())
        print("; ".join(f"{name}: {value}" for name, value in zip(row, shown, strict=True)))
    if arguments.results:
        _results.store(arguments.results, rows, title=(TRIALS[arguments.trial].__doc__ or ""))
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
