"""Easy, hard, open: the classes of the later sets by family, and their open problems.

    python -m workshop.sets.classes [SET...] [--results classes]

Nothing is run: the runs are those of campaigns/regimes.toml, regimes-large.toml and families.toml,
which `fclib collection status SET --add STORE` has taken in. --results stores the table of the
families as NAME, and the open problems with the best error known as NAME-open.
"""

from __future__ import annotations

import argparse
from collections import Counter

from fclib._verdicts import CLASSES
from fclib.collections import ratings
from workshop.tables import _results

SETS = ("machines", "robots", "impacts", "existence", "dynamics", "simulators", "rr9118")


def main() -> None:
    """Print the tables, or store them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("sets", nargs="*", default=SETS)
    _results.add_option(parser)
    arguments = parser.parse_args()
    families: dict[str, list[ratings.RatedProblem]] = {}
    solvers: set[str] = set()
    for name in arguments.sets:
        rows, basis = ratings.ratings_of(name)
        if basis:
            solvers.update(basis.solvers)
        for row in rows:
            families.setdefault(row.id.rpartition("/")[0], []).append(row)
    table = []
    for family, own in families.items():
        counts = Counter(row.rating or "not run" for row in own)
        worst = min((r for r in own if r.voters), key=lambda r: r.solved / r.voters, default=None)
        table.append(
            {
                "family": family,
                "problems": len(own),
                "CPU a run [s]": f"{worst.limit:g}" if worst else "",
                **{name: counts[name] for name in (*CLASSES, "not run")},
                "the hardest is solved by": f"{worst.solved} of {worst.voters}" if worst else "",
            }
        )
    open_ones = [
        {
            "problem": row.id,
            "best error": f"{row.best.error:.1e}" if row.best and row.best.error else "none known",
            "by": row.best.solver if row.best else "",
        }
        for own in families.values()
        for row in own
        if row.rating == "open"
    ]
    note = f"To 1e-8 by both merits, by those of {len(solvers)} solvers that take a problem."
    for rows_ in (table, open_ones):
        if rows_:
            print(_results.table(list(rows_[0]), rows_))
    if arguments.results:
        title = "The later sets: easy, hard, open"
        _results.store(arguments.results, table, title=title, note=note)
        if open_ones:
            title = "The later sets: open problems, and the best error known"
            _results.store(f"{arguments.results}-open", open_ones, title=title, note=note)


if __name__ == "__main__":
    main()
