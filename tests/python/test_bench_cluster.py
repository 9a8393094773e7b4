"""The same campaign on a Dask scheduler with workers in other processes, of which one dies."""

from __future__ import annotations

import importlib.util
import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import fclib
from fclib import bench
from helpers import planted_local

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


def campaign(folder: Path, **changes: Any) -> bench.Campaign:
    for number in range(4):
        fclib.write(folder / f"{number}.hdf5", planted_local(number, nc=4).problem)
    (folder / "slow.py").write_text(SLOW)
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
    assert "has no worker yet; dask worker tcp://" in word


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


@jobqueue
@pytest.mark.skipif(
    shutil.which("sinfo") is None
    or subprocess.run(["sinfo"], capture_output=True, check=False).returncode != 0,
    reason="no Slurm answers",
)
def test_slurm_gives_the_same_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # where the jobs leave what they say
    chosen = campaign(tmp_path, solvers=["nsgs"])
    bench.run_campaign(chosen, tmp_path / "local.sqlite")
    with cluster.on_slurm({"workers": "2", "memory": "1GB"}) as runner:
        bench.run_campaign(chosen, tmp_path / "slurm.sqlite", runner=runner)
    assert rows(tmp_path / "slurm.sqlite") == rows(tmp_path / "local.sqlite")


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
