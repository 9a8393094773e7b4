"""The same campaign on a Dask scheduler with workers in other processes, of which one dies."""

from __future__ import annotations

import importlib.util
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import fclib
import helpers_cli
from fclib import bench
from helpers import planted_local, ran

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")

from fclib.bench import cluster  # noqa: E402

SLOW = """
import time
import fclib

@fclib.solver("test-slow")
def slow(problem, r, monitor):
    '''Takes its time, and then does what another does.'''
    time.sleep(0.1)
    if not monitor.stop(r):
        r[:] = fclib.solve(problem, "nsgs", monitor.tolerance / 2).solution.r
        monitor.stop(r)
"""
SAME = ("problem", "hash", "solver", "tol", "repeat", "status", "solved", "iterations", "error")


@pytest.fixture(scope="module")
def scheduler() -> Iterator[Any]:
    # a scheduler and workers as processes of their own, one thread each
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as local,
        distributed.Client(local) as client,
    ):
        yield client


def campaign(folder: Path, slow: str = SLOW, **changes: Any) -> bench.Campaign:
    for number in range(4):
        fclib.write(folder / f"{number}.hdf5", planted_local(number, nc=4).problem)
    (folder / "slow.py").write_text(slow)
    entries: dict[str, Any] = {
        "name": "cluster",
        "solvers": ["nsgs", "test-slow"],
        "modules": ["slow.py"],
        "tolerances": [1e-6],
        "repeats": 2,
        "problems": [{"files": "*.hdf5"}],
    }
    return bench.Campaign.of(entries | changes, folder)


def rows(path: Path) -> list[tuple[Any, ...]]:
    with bench.Store(path) as store:
        return sorted(tuple(row[name] for name in SAME) for row in store.results())


@pytest.mark.slow
def test_the_same_rows_as_on_one_machine_while_a_worker_dies(
    scheduler: Any, tmp_path: Path
) -> None:
    chosen = campaign(tmp_path)
    bench.run_campaign(chosen, tmp_path / "local.sqlite", jobs=2)
    killed: list[int] = []

    def show(progress: bench.Progress) -> None:
        # in mid-run: both workers have work, and most of it is still to be done
        if not killed and sum(progress.statuses.values()) == 3:
            pids = scheduler.run(os.getpid)
            killed.append(next(iter(pids.values())))
            os.kill(killed[0], signal.SIGKILL)

    address = scheduler.scheduler.address
    with cluster.on_scheduler(address) as runner:
        progress = bench.run_campaign(chosen, tmp_path / "dask.sqlite", runner=runner, show=show)
    assert killed
    assert progress.done == progress.planned == 16
    assert rows(tmp_path / "dask.sqlite") == rows(tmp_path / "local.sqlite")
    # the nanny has started another
    scheduler.wait_for_workers(2, timeout=60)
    assert killed[0] not in scheduler.run(os.getpid).values()


def test_problems_that_are_sent(
    scheduler: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache = tmp_path / "far away"
    scheduler.run(exec, f"import os; os.environ['FCLIB_CACHE'] = {str(cache)!r}")
    chosen = campaign(tmp_path, solvers=["nsgs"])
    runner = cluster.runner(scheduler, send=True)

    # nothing is shared once the campaign has looked at the files and sent them
    def show(progress: bench.Progress) -> None:
        assert progress.statuses["unreadable"] == 0

    progress = bench.run_campaign(chosen, tmp_path / "sent.sqlite", runner=runner, show=show)
    assert progress.solved == progress.planned == 8
    kept = sorted((cache / "sent").iterdir())
    assert len(kept) == 4
    assert {fclib.digest(fclib.read(path)) for path in kept} == {path.stem for path in kept}


def test_a_cluster_without_workers_is_waited_for_aloud(
    scheduler: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words: list[str] = []
    # as it is before the first worker has joined
    seen: list[dict[str, int]] = [{}]
    there = scheduler.nthreads
    monkeypatch.setattr(scheduler, "nthreads", lambda: seen.pop() if seen else there())
    runner = cluster.runner(scheduler, tell=words.append)
    chosen = campaign(tmp_path, solvers=["nsgs"], repeats=1)
    progress = bench.run_campaign(chosen, tmp_path / "a.sqlite", runner=runner)
    assert progress.solved == 4
    (word,) = words
    assert "has no worker; dask worker tcp://" in word


def started(*words: str) -> subprocess.Popen[bytes]:
    """A part of Dask as a process of its own."""
    command = [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@pytest.mark.slow
def test_the_loss_of_the_scheduler_ends_in_a_line_and_the_campaign_goes_on(
    scheduler: Any, tmp_path: Path
) -> None:
    campaign(tmp_path)
    store = tmp_path / "runs.sqlite"
    command = [
        "bench",
        "--problems",
        str(tmp_path / "*.hdf5"),
        "--module",
        str(tmp_path / "slow.py"),
    ]
    command += ["--solver", "test-slow", "--tol", "1e-6", "--repeats", "6", "--store", str(store)]
    address = f"tcp://127.0.0.1:{free_port()}"
    port = address.rpartition(":")[2]
    own = started("scheduler", "--host=127.0.0.1", f"--port={port}", "--no-dashboard")
    worker = started("worker", "--nthreads=1", "--no-dashboard", "--no-nanny", address)
    try:
        words = [sys.executable, "-m", "fclib", *command, "--scheduler", address]
        with subprocess.Popen(words, stdout=-1, stderr=-1, text=True) as conductor:
            while done(store) < 3:
                assert conductor.poll() is None, conductor.communicate()
                time.sleep(0.05)
            own.kill()
            out, errors = conductor.communicate()
    finally:
        for process in (own, worker):
            process.kill()
            process.wait()
    assert conductor.returncode == 1, (out, errors)
    (line,) = [line for line in errors.splitlines() if "has no worker" not in line]
    assert "the Dask scheduler has ended" in line
    assert "Traceback" not in out
    assert 3 <= done(store) < 24
    # the others are done by another scheduler
    helpers_cli.run(*command, "--scheduler", scheduler.scheduler.address)
    assert done(store) == 24


def test_a_connection_that_closes_is_the_end_of_the_scheduler() -> None:
    """Also if its client does not know it yet, and then nothing more is asked of it."""
    comm = pytest.importorskip("distributed.comm.core")

    class Client:
        status = "running"
        scheduler = SimpleNamespace(address="tcp://nowhere:1")

        def nthreads(self) -> Any:
            raise comm.CommClosedError("in <TCP (closed)>: ConnectionResetError")

        cancel = nthreads

    with pytest.raises(fclib.Error, match="tcp://nowhere:1: the Dask scheduler has ended"):
        list(cluster.runner(Client())(iter([])))


def done(store: Path) -> int:
    """How many runs there are in a store, which may be in the making."""
    with suppress(bench.StoreError), bench.Store(store, create=False) as opened:
        return len(opened.results())
    return 0


def test_a_scheduler_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "PATIENCE", 1.0)
    with (
        pytest.raises(fclib.Error, match="no Dask scheduler"),
        cluster.on_scheduler("tcp://127.0.0.1:9"),
    ):
        pass


jobqueue = pytest.mark.skipif(
    importlib.util.find_spec("dask_jobqueue") is None, reason="dask_jobqueue is not installed"
)


@jobqueue
def test_slurm_that_is_not_here_or_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(fclib.Error, match="sbatch: No such file"), cluster.on_slurm({}):
        pass
    sbatch = tmp_path / "sbatch"
    sbatch.write_text("#!/bin/sh\necho 'sbatch: error: no partition called long' >&2\nexit 1\n")
    sbatch.chmod(0o755)
    with (
        pytest.raises(fclib.Error, match="slurm: sbatch refuses the job: no partition called long"),
        cluster.on_slurm({"queue": "long"}),
    ):
        pass


SLURM = """
ClusterName=fclib
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=bf_interval=2,sched_interval=2
PreemptType=preempt/partition_prio
PreemptMode=CANCEL
KillWait=2
MpiDefault=none
SlurmdParameters=config_overrides
NodeName={host} NodeAddr=127.0.0.1 CPUs=8 RealMemory=8000 State=UNKNOWN
PartitionName=short Nodes={host} Default=YES MaxTime=INFINITE State=UP PriorityTier=1
PartitionName=urgent Nodes={host} MaxTime=INFINITE State=UP PriorityTier=10
"""
DAEMONS = ("munged", "slurmctld", "slurmd")


@pytest.fixture(scope="module")
def slurm() -> Iterator[Path]:
    """A Slurm of one node that the tests start and stop themselves."""
    absent = [name for name in (*DAEMONS, "sbatch") if which(name) is None]
    if absent or os.getuid() != 0 or importlib.util.find_spec("dask_jobqueue") is None:
        pytest.skip("needs root, and Debian's slurm-wlm and munge, and dask_jobqueue")
    # sockets have short names
    with tempfile.TemporaryDirectory(prefix="slurm-") as name, slurm_of_one_node(Path(name)):
        yield Path(name)


@contextmanager
def slurm_of_one_node(folder: Path) -> Iterator[None]:
    """Start munged, slurmctld and slurmd with a configuration of their own; as root."""
    host = socket.gethostname().partition(".")[0]
    (folder / "slurm.conf").write_text(
        SLURM.format(host=host, folder=folder, ports=[free_port(), free_port()])
    )
    for part in ("state", "spool"):
        (folder / part).mkdir()
    key = folder / "munge.key"
    key.write_bytes(os.urandom(1024))
    key.chmod(0o400)
    names = {"socket": "socket", "key-file": "key", "pid-file": "pid"}
    names |= {"log-file": "log", "seed-file": "seed"}
    options = [f"--{option}={folder}/munge.{end}" for option, end in names.items()]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SLURM_CONF", str(folder / "slurm.conf"))
        daemons = [
            subprocess.Popen(
                [str(which(daemon)), *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            for daemon, words in (
                ("munged", ["--foreground", "--force", *options]),
                ("slurmctld", ["-D", "-i"]),
                ("slurmd", ["-D"]),
            )
        ]
        try:
            end = time.monotonic() + 120.0
            while "idle" not in slurm_says("sinfo", "--noheader", "--format=%T"):
                if time.monotonic() > end:
                    pytest.skip("Slurm does not start here")
                time.sleep(0.5)
            yield
        finally:
            slurm_says("scancel", "--user=root")
            for daemon in reversed(daemons):
                daemon.terminate()
                daemon.wait(60)


def which(name: str) -> str | None:
    """The path of a program, of the system's too."""
    return shutil.which(name, path=f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")


def free_port() -> int:
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        return int(trial.getsockname()[1])


def slurm_says(*command: str) -> str:
    return ran(*command, code=None).stdout.strip()


def jobs_of_slurm(state: str = "RUNNING") -> list[str]:
    return slurm_says("squeue", "--noheader", "--format=%i", f"--states={state}").split()


def cancelled() -> None:
    """End all jobs that run, as a person does."""
    slurm_says("scancel", *jobs_of_slurm())


def preempted() -> None:
    """End them by one that is more urgent, and takes the whole node for a moment."""
    words = ("--parsable", "--partition=urgent", "--ntasks=8", "--output=/dev/null")
    job = slurm_says("sbatch", *words, "--wrap=true")
    # `sbatch --wait` looks after 2 s, 4 s, 8 s, ...
    while slurm_says("squeue", "--noheader", "--format=%i", f"--jobs={job}"):
        time.sleep(0.1)


@jobqueue
@pytest.mark.slow
# what replaces a job ends too in one of them: each end costs the start of two jobs, 10 s
@pytest.mark.parametrize(
    ("processes", "way", "ends"),
    [
        ("1", cancelled, 1),
        ("2", preempted, 2),
        pytest.param("1", preempted, 2, marks=pytest.mark.long),
        pytest.param("2", cancelled, 2, marks=pytest.mark.long),
    ],
)
def test_jobs_of_slurm_that_end_are_replaced(
    processes: str,
    way: Any,
    ends: int,
    slurm: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)  # where the jobs leave what they say
    monkeypatch.setattr(cluster, "LOOK", 0.5)
    chosen = campaign(tmp_path, solvers=["nsgs", "test-slow"])
    bench.run_campaign(chosen, tmp_path / "local.sqlite")
    ended: list[list[str]] = []

    def show(progress: bench.Progress) -> None:
        if len(ended) < ends and sum(progress.statuses.values()) >= 3 + 4 * len(ended):
            ended.append(jobs_of_slurm())
            way()

    words: list[str] = []
    options = {"workers": "2", "cores": "2", "processes": processes, "memory": "1GB"}
    with cluster.on_slurm(options, tell=words.append) as runner:
        progress = bench.run_campaign(chosen, tmp_path / "slurm.sqlite", runner=runner, show=show)
    assert progress.done == progress.planned
    assert not progress.not_run
    assert len(ended) == ends
    assert all(ended)
    assert rows(tmp_path / "slurm.sqlite") == rows(tmp_path / "local.sqlite")
    replaced = [word for word in words if "has ended; another is submitted" in word]
    assert any(ended[0][0] in word for word in replaced)


@jobqueue
@pytest.mark.long
def test_a_walltime_shorter_than_the_campaign(
    slurm: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    # a minute is the least that Slurm knows
    chosen = campaign(tmp_path, SLOW.replace("0.1", "6.0"), solvers=["test-slow"], repeats=7)
    words: list[str] = []
    options = {"workers": "2", "cores": "2", "memory": "1GB", "walltime": "00:01:00"}
    with cluster.on_slurm(options, tell=words.append) as runner:
        progress = bench.run_campaign(chosen, tmp_path / "slurm.sqlite", runner=runner)
    assert progress.solved == progress.planned
    assert any("has ended; another is submitted" in word for word in words)


@jobqueue
@pytest.mark.slow
def test_jobs_of_slurm_that_end_at_once_end_the_campaign(
    slurm: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    chosen = campaign(tmp_path, solvers=["nsgs"])
    monkeypatch.setattr(cluster, "LOOK", 0.5)
    with (
        dask.config.set({"jobqueue.slurm.python": "/bin/false"}),
        pytest.raises(fclib.Error, match="jobs ended before a worker has joined"),
        cluster.on_slurm({}, tell=lambda _: None) as runner,
    ):
        bench.run_campaign(chosen, tmp_path / "slurm.sqlite", runner=runner)


@jobqueue
def test_the_script_for_slurm() -> None:
    before = signal.getsignal(signal.SIGINT)
    made, workers = cluster.slurm_cluster(
        {
            "workers": "8",
            "queue": "short",
            "account": "contact",
            "cores": "4",
            "memory": "16GB",
            "walltime": "02:00:00",
            "constraint": "cascade",
        }
    )
    try:
        script = made.job_script()
    finally:
        made.close()
    assert signal.getsignal(signal.SIGINT) is before
    assert workers == 8
    for line in (
        "#SBATCH -p short",
        "#SBATCH -A contact",
        "#SBATCH -n 1",
        "#SBATCH --cpus-per-task=4",
        "#SBATCH --mem=15G",
        "#SBATCH -t 02:00:00",
        "#SBATCH --constraint=cascade",
        "export OMP_NUM_THREADS=1",
    ):
        assert line in script.splitlines(), script
    assert "--nworkers 4" in script
    assert "--nthreads 1" in script
    with pytest.raises(fclib.OptionError, match="many"):
        cluster.slurm_cluster({"workers": "many"})
