"""The bench: solvers are run here, and judged by the merit, never by themselves."""

from fclib.bench.run import COLUMNS, Run, run

__all__ = ["COLUMNS", "Run", "run"]
