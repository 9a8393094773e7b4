"""Why fclib2024/SpheresPile has fewer contacts than published: rolling friction makes piles loose.

    .venv/bin/python -m workshop.sets.pile_contacts [--results pile-contacts]

The 250 spheres of the family fall on the ground, with several coefficients of rolling friction. At
the end most of them rest. Two minutes of CPU.
"""

from __future__ import annotations

import argparse

import numpy as np

from fclib import scenes
from fclib.simulate import simulate
from workshop.tables import _results

SPHERES = 250  # the published problems have up to 1500 degrees of freedom
ROLLING = (0.0, 0.003, 0.01, 0.03, 0.1)  # mu_r [m]; the family has 0.03
END = 3.0  # [s]
STEP = 2e-3  # [s]


def row_of(mu_r: float) -> dict[str, str]:
    """The pile at the end."""
    scene = scenes.get("RollingSpheres")(spheres=SPHERES, mu_r=mu_r, time_step=STEP).scene(0)
    *_, last = simulate(scene, round(END / STEP), tol=1e-4, time_limit=5.0)
    place = np.reshape(last.start.position, (-1, 7))[:, :3]
    return {
        "rolling friction [m]": f"{mu_r:g}",
        "contacts": str(last.problem.nc),
        "contacts of a sphere": f"{last.problem.nc / SPHERES:.3g}",
        "height [m]": f"{place[:, 2].max():.2g}",
        "radius that nine of ten are within [m]": f"{np.quantile(np.hypot(*place.T[:2]), 0.9):.2g}",
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    _results.add_option(parser)
    arguments = parser.parse_args()
    table = []
    for mu_r in ROLLING:
        table.append(row_of(mu_r))
        print(table[-1], flush=True)
    if arguments.results:
        _results.store(
            arguments.results,
            table,
            title="Contacts of a pile of spheres by its rolling friction",
            note=f"{SPHERES} spheres, after {END:g} s.",
        )


if __name__ == "__main__":
    main()
