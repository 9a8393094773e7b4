"""Published runs: packed into files that never change, and put beside runs of one's own.

    results/runs/NAME-DIGEST.parquet      a part: a row for each run, written once

shards.py       a part: from a store, back into one, and checked
beside.py       published runs beside those of a store, on the scale of its machine
submission.py   a part that somebody submits, with solutions that are judged again
boards.py       which parts a set has, and which of its problems
leaders.py      the solvers of each set in their order

The parts lie in the package `fclib-results`, installed beside this one, or in `results/` of a
checkout.
"""

from fclib._stored import published_runs as folder
from fclib.results.beside import BesideError, Joined, alone, beside
from fclib.results.boards import of_sets
from fclib.results.leaders import leaders
from fclib.results.shards import Shard, ShardError, pack, rows_of, shards, twice, unpack, verify
from fclib.results.submission import judged, submit

__all__ = [
    "BesideError",
    "Joined",
    "Shard",
    "ShardError",
    "alone",
    "beside",
    "folder",
    "judged",
    "leaders",
    "of_sets",
    "pack",
    "rows_of",
    "shards",
    "submit",
    "twice",
    "unpack",
    "verify",
]
