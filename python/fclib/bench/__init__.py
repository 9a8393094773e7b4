"""The bench: solvers are run here, and judged by the merit, never by themselves.

    campaign ──> job ──> pool | cluster ──> supervisor ──> worker: the solver
                                                │
    profiles, plots <── store <── record <──────┘ the merit

One run by hand is `run`; thousands are a `Campaign` and `run_campaign`. A supervisor is a process
that has a worker forked, hands it a job, watches its time and memory, and judges what it returns.

campaign.py     what is to be run: a TOML file becomes jobs. Needs problems.py, made.py, modules.py
problems.py     the files that a campaign names, and what it knows of the problem in each
made.py         problems that a campaign has made: steps of a scene, random ones
modules.py      files of Python with solvers of the user's own
fingerprint.py  what tells two versions of a solver apart
job.py          what travels: a job there, a record back, and the statuses of a record
runner.py       runs a campaign: what the store lacks goes to the pool or the cluster, twice and
                a third time where something from outside has spoilt it
pool.py         supervisors on this machine, several at once
cluster.py      the same in the workers of Dask, on many machines
supervisor.py   the process that watches a worker, and judges. Knows no campaign
copies.py       the same problem in other numbers, against answers known by heart and luck
template.py     the process that workers are forked from
worker.py       the process that solves
warm_up.py      its first call of a solver, which is not measured
meter.py        what the kernel says a run took: a control group, or the processes
processes.py    processes as Linux shows them
machine.py      what a record says of its machine; cores for one run alone
layout.py       how a store lies in SQLite: tables, columns, a checksum for each row
table.py        runs in columns
store.py        one SQLite file, one row a run
table.py        runs in columns
comparison.py   what an instance is, which of them are compared, and their costs
profiles.py     what the runs of a store say. Knows runs alone
plots.py        profiles as pictures
single.py       one run by hand, in this process
"""

from fclib._solve import MeritKind
from fclib.bench.campaign import Campaign, CampaignError
from fclib.bench.job import STATUSES, Job, Limits, ProblemFacts, Record, SolverChoice
from fclib.bench.runner import Progress, run_campaign
from fclib.bench.single import COLUMNS, Run, run
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
