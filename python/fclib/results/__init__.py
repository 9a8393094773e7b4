"""Published runs: packed into files that never change, and put beside runs of one's own.

    results/runs/NAME-DIGEST.parquet      a part: a row for each run, written once

shards.py       a part: from a store, back into one, and checked
beside.py       published runs beside those of a store, on the scale of its machine

The parts lie in the package `fclib-results`, installed beside this one, or in `results/` of a
checkout.
"""

from fclib.results.beside import BesideError, Joined, beside
from fclib.results.shards import Shard, ShardError, folder, pack, rows_of, shards, verify

__all__ = [
    "BesideError",
    "Joined",
    "Shard",
    "ShardError",
    "beside",
    "folder",
    "pack",
    "rows_of",
    "shards",
    "verify",
]
