"""The bench: it runs solvers. The merit judges them, never the solvers themselves.

    campaign ──> job ──> pool | cluster ──> supervisor ──> worker: the solver
                                                │
    profiles, plots <── store <── record <──────┘ the merit

`run` makes one run by hand; `Campaign` and `run_campaign` make thousands. A supervisor is a process
that has a worker forked, hands it a job, watches its time and memory, and judges what it returns.

campaign.py     makes jobs of a TOML file. Needs problems.py, generated.py, modules.py
problems.py     the files that a campaign names, and what the campaign knows of each problem
generated.py    problems that a campaign has made: of the collection, steps of a scene, random ones
modules.py      files of Python with solvers of the user's own
fingerprint.py  what tells two versions of a solver apart
job.py          what travels: a job there, a record back, and the statuses of a record
runner.py       runs a campaign: jobs that the store lacks go to the pool or the cluster; a
                job that something from outside has spoilt is tried up to three times
pool.py         supervisors on this machine, several at once
cluster.py      the same in the workers of Dask, on many machines
supervisor.py   the process that watches a worker, and judges. Knows no campaign
copies.py       renumbered copies of a problem, against memorised answers and luck
template.py     the process that workers are forked from
worker.py       the process that solves
warm_up.py      the first call of a solver in a worker, which is not measured
meter.py        time and memory of a run, counted by the kernel
processes.py    processes as Linux shows them
machine.py      what a record says of its machine; cores for one run alone
layout.py       how a store lies in SQLite: tables, columns, a checksum for each row
table.py        runs in columns
store.py        one SQLite file, one row a run
table.py        runs in columns
comparison.py   what an instance is, which of them are compared, and their costs
profiles.py     profiles, means and ratios of the runs of a store. It knows no problem
plots.py        profiles as pictures
one_run.py      one run by hand, in this process
"""

from fclib._solve import MeritKind
from fclib.bench.campaign import Campaign, CampaignError
from fclib.bench.job import STATUSES, Job, Limits, ProblemFacts, Record, SolverChoice
from fclib.bench.one_run import COLUMNS, Run, run
from fclib.bench.runner import Progress, run_campaign
from fclib.bench.store import Store, StoreError

__all__ = [
    "COLUMNS",
    "STATUSES",
    "Campaign",
    "CampaignError",
    "Job",
    "Limits",
    "MeritKind",
    "ProblemFacts",
    "Progress",
    "Record",
    "Run",
    "SolverChoice",
    "Store",
    "StoreError",
    "run",
    "run_campaign",
]
