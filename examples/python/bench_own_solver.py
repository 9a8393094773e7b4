"""Your own solver on the bench: bench_own_solver.py.

Runs the solver of own_solver.py beside two built-in ones, on problems whose solution is known by
construction, each run in a process with hard limits; the store keeps what came of it.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from fclib import bench
from fclib.bench import profiles

STORE = Path("own.sqlite")


def main() -> None:
    """Run the campaign, or what is left of it, and compare."""
    campaign = bench.Campaign.of(
        {
            "name": "own",
            "solvers": ["my-pgs", "my-pgs step=1.6", "nsgs", "auto"],
            "modules": [str(Path(__file__).with_name("own_solver.py"))],
            "tolerances": [1e-4, 1e-8],
            "time_limit": 2.0,
            "problems": [
                {"planted": {"count": 3, "contacts": 15, "seed": 1}, "family": "space"},
                {"planted": {"count": 3, "contacts": 15, "spacedim": 2}, "family": "plane"},
            ],
        }
    )
    done = bench.run_campaign(campaign, STORE, jobs=1)
    print(f"{done.planned} runs, {done.skipped} of them stored before")

    rows = profiles.load(STORE)
    costs = profiles.costs(rows)
    for row in profiles.summary(costs):
        solved = f"{row['solved']} of {row['of']}, fastest on {row['fastest']}"
        print(f"{row['solver']:16} solved {solved}, mean {1e6 * row['mean']:.0f} us")

    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    taus = np.logspace(0, 4, 400)
    curves = profiles.performance_profile(costs.values, taus)
    for name, curve in zip(costs.solvers, curves, strict=True):
        axes.semilogx(taus, curve, drawstyle="steps-post", label=name)
    axes.set(xlabel="multiple of the fastest time", ylabel="share solved", ylim=(0, 1.02))
    axes.legend(loc="lower right")
    figure.savefig("own.png", dpi=130)


if __name__ == "__main__":
    main()
