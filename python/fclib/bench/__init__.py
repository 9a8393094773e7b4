"""The bench: solvers are run here, and judged by the merit, never by themselves.

    campaign -> job -> pool | cluster -> keeper -> worker -> keeper -> record -> store -> profiles

One run by hand is `run`; thousands are a `Campaign` and `conduct`. A keeper is a process that forks
a worker, hands it a job, watches its time and memory, and judges what it returns.
"""

from fclib.bench.campaign import Campaign, CampaignError
from fclib.bench.conduct import Progress, conduct
from fclib.bench.job import STATUSES, Job, Limits, ProblemFacts, Record, SolverChoice
from fclib.bench.run import COLUMNS, Run, run
from fclib.bench.store import Store, StoreError

__all__ = [
    "COLUMNS",
    "STATUSES",
    "Campaign",
    "CampaignError",
    "Job",
    "Limits",
    "ProblemFacts",
    "Progress",
    "Record",
    "Run",
    "SolverChoice",
    "Store",
    "StoreError",
    "conduct",
    "run",
]
