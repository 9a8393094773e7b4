"""Run in a process of its own: LMGC90's engine, and the steps that it takes.

    PYTHON _lmgc90_steps.py FOLDER EVERY deck FILE.npz STEPS
    PYTHON _lmgc90_steps.py FOLDER EVERY script SCRIPT [ARGUMENT...]

Knows nothing of fclib. compas_lmgc90 keeps one simulation in a process, and ends the process if the
engine meets an error. Each step is therefore written as soon as it is taken. FOLDER/model-K.npz has
all that simulation K was told, FOLDER/STEP.npz where its bodies are after a step, and, if the step
is kept, its contacts.
"""

import importlib
import importlib.metadata
import runpy
import sys
from pathlib import Path
from typing import Any

del sys.path[0]  # the folder of this file, which has modules of the same names as packages

try:
    import numpy as np

    engine: Any = importlib.import_module("compas_lmgc90._lmgc90")
except ImportError as error:
    sys.exit(f"{sys.executable}: {error}; to record LMGC90 it needs compas_lmgc90 and numpy")

ORIGINAL = engine.LMGC90Solver


class Steps:
    """The steps of all simulations of this process."""

    def __init__(self, folder: Path, every: int) -> None:
        self.folder, self.every = folder, every
        self.count = self.simulations = 0

    def write(self, name: str, arrays: dict[str, Any]) -> None:
        """Write a file; a half-written one never has its name."""
        beside = self.folder / "part.npz"
        np.savez(beside, **arrays)
        beside.replace(self.folder / f"{name}.npz")


class Told:
    """An engine's solver that writes what it is told, and what it tells."""

    steps: Steps

    def __init__(self) -> None:
        self.own = ORIGINAL()
        self.told: dict[str, Any] = {"alert": 0.0}
        self.bodies: list[Any] = []
        self.driven: list[Any] = []
        self.laws: list[Any] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.own, name)

    def initialize(self, dt: float, theta: float, debug: bool) -> None:
        self.told |= {"h": dt, "theta": theta}
        self.own.initialize(dt, theta, debug)

    def set_materials(self, densities: Any) -> None:
        self.told["densities"] = np.array(densities, dtype=float)
        self.own.set_materials(densities)

    def add_one_tact_behav(self, name: str, law: str, parameters: Any) -> None:
        self.laws.append((law, list(parameters)))
        self.own.add_one_tact_behav(name, law, parameters)

    def set_see_tables(self, alert: float) -> None:
        self.told["alert"] = alert
        self.own.set_see_tables(alert)

    def set_one_polyr(
        self, mat: str, coor: Any, faces: Any, vertices: Any, nb_v: int, nb_f: int
    ) -> None:
        # the material's name is s and its number, from 1
        self.bodies.append((int(mat[1:]) - 1, coor, faces, vertices))
        self.own.set_one_polyr(mat, coor, faces, vertices, nb_v, nb_f)

    def set_drvdof(
        self, i_bdyty: int, i_dof: int, drv_values: Any, velocity: bool, evolution: bool
    ) -> None:
        values = np.array(drv_values, dtype=float)
        self.driven.append((i_bdyty - 1, i_dof - 1, bool(velocity), bool(evolution), values))
        self.own.set_drvdof(i_bdyty, i_dof, values, velocity, evolution)

    def close_before_computing(self) -> None:
        self.own.close_before_computing()
        steps = self.steps
        self.number = steps.simulations
        steps.simulations += 1
        state = self.own.get_initial_state()
        arrays = {
            **self.told,
            "version": importlib.metadata.version("compas_lmgc90"),
            "law": self.laws[-1][0] if self.laws else "",
            "parameters": np.array(self.laws[-1][1] if self.laws else [], dtype=float),
            "material": np.array([body[0] for body in self.bodies]),
            "place": np.array(state.bodies),
            "frame": np.array(state.body_frames),
        }
        for i, (_, coor, faces, vertices) in enumerate(self.bodies):
            arrays[f"vertices_{i}"] = np.reshape(vertices, (-1, 3)) + np.asarray(coor)
            arrays[f"faces_{i}"] = np.reshape(faces, (-1, 3)) - 1
        for i, (body, dof, velocity, evolution, values) in enumerate(self.driven):
            arrays[f"driven_{i}"] = np.array([body, dof, velocity, evolution])
            arrays[f"values_{i}"] = values
        steps.write(f"model-{self.number}", arrays)

    def compute_one_step(self) -> Any:
        result = self.own.compute_one_step()
        steps = self.steps
        arrays = {
            "simulation": self.number,
            "place": np.array(result.bodies),
            "frame": np.array(result.body_frames),
        }
        if steps.count % steps.every == 0:
            arrays |= {
                "bodies": np.array(result.interaction_bodies, dtype=np.int64).reshape(-1, 2) - 1,
                "point": np.array(result.interaction_coords).reshape(-1, 3),
                "axes": np.array(result.interaction_uc).reshape(-1, 3, 3),
                "force": np.array(result.interaction_rloc).reshape(-1, 3),
                "velocity": np.array(result.interaction_vloc).reshape(-1, 3),
                "gap": np.array(result.interaction_gap, dtype=float),
                "internal": np.array(
                    [own[0] if own else 0.0 for own in result.interaction_internals], dtype=float
                ),
            }
        steps.write(f"{steps.count:06d}", arrays)
        steps.count += 1
        return result


def run_deck(file: str, steps: int) -> None:
    """Steps of the polyhedra that a file holds."""
    with np.load(file) as data:
        known = dict(data)
    solver = Told()
    solver.initialize(float(known["h"]), float(known["theta"]), False)
    solver.set_materials(known["densities"])
    solver.add_one_tact_behav("iqsc0", str(known["law"]), known["parameters"].tolist())
    solver.set_see_tables(float(known["alert"]))
    count = len(known["material"])
    solver.set_nb_bodies(count)
    driven = [known[f"driven_{i}"] for i in range(int(known["driven"]))]
    for i in range(count):
        mine = [d for d in driven if d[0] == i]
        velocities = sum(int(d[2]) for d in mine)
        vertices = known[f"vertices_{i}"]
        centre = vertices.mean(axis=0)
        solver.set_one_polyr(
            f"s{int(known['material'][i]) + 1:04d}",
            centre.tolist(),
            (known[f"faces_{i}"].ravel() + 1).tolist(),
            (vertices - centre).ravel().tolist(),
            velocities,
            len(mine) - velocities,
        )
    for i, (body, dof, velocity, evolution) in enumerate(driven):
        solver.set_drvdof(
            int(body) + 1, int(dof) + 1, known[f"values_{i}"], bool(velocity), bool(evolution)
        )
    solver.close_before_computing()
    for _ in range(steps):
        solver.compute_one_step()


def main() -> None:
    folder, every, what, *rest = sys.argv[1:]
    Told.steps = Steps(Path(folder), int(every))
    engine.LMGC90Solver = Told
    if what == "deck":
        run_deck(rest[0], int(rest[1]))
        return
    sys.argv = rest
    sys.path.insert(0, str(Path(rest[0]).parent))
    runpy.run_path(rest[0], run_name="__main__")


if __name__ == "__main__":
    main()
