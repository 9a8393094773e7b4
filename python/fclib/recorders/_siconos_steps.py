"""Run by Siconos' own interpreter: a script, and the friction problems that it solves.

    /usr/bin/python3 _siconos_steps.py FOLDER EVERY SCRIPT [ARGUMENT...]

Knows nothing of fclib. FOLDER/STEP.npz has the problem of a kept step with contacts,
FOLDER/steps.json the number of steps and the version. The friction classes that a script finds in
`siconos.kernel` are replaced by ones that write; so are the classes by which `mechanics_run`
traces. A step that is not recorded has a file with the reason.
"""

import json
import runpy
import sys
import time
import warnings
from pathlib import Path
from typing import Any

del sys.path[0]  # the folder of this file, which has modules of the same names as packages

try:
    import numpy as np
    import scipy.sparse
    import siconos
    import siconos.kernel as kernel
    import siconos.numerics as numerics
except ImportError as error:
    sys.exit(f"{sys.executable}: {error}; to record Siconos it needs siconos, numpy and scipy")

# warning of Siconos' own conversions
warnings.filterwarnings("ignore", message=".*scipy.sparse.coo")
NO_INDEX_SET = 999  # Siconos' number for a problem without an index set
SPATIAL = 6  # degrees of freedom of a rigid body in space


class Steps:
    """The steps of the simulation so far."""

    def __init__(self, folder: Path, every: int) -> None:
        self.folder, self.every = folder, every
        self.count = 0
        self.time = -np.inf

    def next(self, time: float) -> bool:
        """Whether the problem at the end of a step is kept. Newton's iterations are one step."""
        if time != self.time:
            self.count += 1
            self.time = time
        return (self.count - 1) % self.every == 0

    def write(self, arrays: Any) -> None:
        """Write a problem; the last one of a step stays."""
        np.savez(self.folder / f"{self.count - 1:06d}.npz", **arrays)


def columns(name: str, matrix: Any) -> Any:
    """A matrix in compressed columns."""
    matrix = scipy.sparse.csc_matrix(matrix)
    return {
        f"{name}_shape": matrix.shape,
        f"{name}_data": matrix.data,
        f"{name}_indices": matrix.indices,
        f"{name}_indptr": matrix.indptr,
    }


def local(osns: Any) -> Any:
    """W and q: siconos.kernel.FrictionContact."""
    problem = osns.frictionContactProblemPtr()
    m = problem.dimension * problem.numberOfContacts
    W = problem.M
    if osns.getMStorageType() == numerics.NM_SPARSE_BLOCK:
        numerics.NM_clear_not_SBM(W)  # otherwise the values of a step before remain
        W = numerics.NM_csc(W)
    else:
        W = np.array(W)[:m, :m]
    return {**columns("W", W), "q": np.array(osns.q())[:m]}, problem


def globally(osns: Any) -> Any:
    """M, H, q and b: siconos.kernel.GlobalFrictionContact."""
    problem = osns.globalFrictionContactProblemPtr()
    m = problem.dimension * problem.numberOfContacts
    systems = osns.simulation().nonSmoothDynamicalSystem().dynamicalSystemsVector()
    arrays = {
        **columns("M", problem.M),
        **columns("H", problem.H),
        "q": np.array(problem.q),
        "b": np.array(problem.b)[:m],
        "bodies": np.repeat([s.number() for s in systems], [s.dimension() for s in systems]),
    }
    return arrays, problem


def places(osns: Any) -> Any:
    """Contacts and rigid bodies before the solve, as Siconos' mechanics tells them.

    positions (nb x 8) and velocities (nb x 7) have the number of the body first; points (nc x 25)
    is what `MechanicsIO.contactPoints` gives; masses (nb x 6 x 6) are in the bodies' own axes.
    Nothing if the scene is of another kind.
    """
    try:
        from siconos.io.io_base import MechanicsIO
    except ImportError:
        return {}
    system = osns.simulation().nonSmoothDynamicalSystem()
    told = MechanicsIO()
    positions = told.positions(system)
    points = told.contactPoints(system, osns.indexSetLevel())
    systems = system.dynamicalSystemsVector()
    if positions is None or points is None or {s.dimension() for s in systems} != {SPATIAL}:
        return {}
    return {
        "positions": np.array(positions),
        "velocities": np.array(told.velocities(system)),
        "points": np.array(points),
        "masses": np.array([np.array(s.mass()) for s in systems]),
    }


def mixed(osns: Any) -> Any:
    """W, V, R, q, s, mu and the solution after a solve: siconos.kernel.GenericMechanical.

    Its rows are those of joints and contacts, in the order of the interactions.
    """
    topology = osns.simulation().nonSmoothDynamicalSystem().topology()
    contact: list[int] = []
    joint: list[int] = []
    mu, dimension, start = [], 0, 0
    for one in topology.indexSet(osns.indexSetLevel()).interactions():
        law = one.nonSmoothLaw()
        rows = range(start, start + law.size())
        start = rows.stop
        friction = kernel.cast_NewtonImpactFrictionNSL(law)
        if friction is not None:
            contact.extend(rows)
            mu.append(friction.mu())
            dimension = len(rows)
        elif kernel.cast_NewtonImpactNSL(law) is None and kernel.cast_RelayNSL(law) is None:
            joint.extend(rows)
        else:
            kind = "a stop" if kernel.cast_RelayNSL(law) is None else "friction"
            return {"refused": f"a joint has {kind}, which is not recorded"}
    if not contact:
        return {}
    whole = scipy.sparse.csc_matrix(numerics.NM_csc(osns.M().numericsMatrix()))
    q, z, w = (np.array(part())[:start] for part in (osns.q, osns.z, osns.w))
    arrays = {
        **columns("W", whole[contact][:, contact]),
        "q": q[contact],
        "mu": np.array(mu),
        "dimension": dimension,
        "r": z[contact],
        "u": w[contact],
    }
    if joint:
        arrays |= columns("V", whole[contact][:, joint]) | columns("R", whole[joint][:, joint])
        arrays |= {"s": q[joint], "l": z[joint]}
    return arrays


def shown(original: Any, solved: Any) -> Any:
    """A class of nonsmooth problems whose `compute` is `solved`."""

    class Shown(original):  # type: ignore[misc]
        def __new__(cls, *arguments: Any, **options: Any) -> Any:
            # the class itself must not be the name in siconos.kernel, else compute stays C++
            return super().__new__(Hidden if cls is Shown else cls)

        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments[:2])  # further arguments are for a trace

        def compute(self, now: float) -> int:
            return int(solved(self, now))

    class Hidden(Shown):
        pass

    return Shown


def writing(original: Any, told: Any, steps: Steps) -> Any:
    """A class of friction problems that writes the problems that it solves."""

    def solved(self: Any, now: float) -> int:
        kept = steps.next(now)
        if not self.preCompute(now) or self.indexSetLevel() == NO_INDEX_SET:
            return 0
        self.updateMu()
        if not self.getSizeOutput():
            # the global problem also moves bodies that touch nothing
            return int(original.compute(self, now))
        arrays: Any = {}
        if kept:
            arrays, problem = told(self)
            nc, dimension = problem.numberOfContacts, problem.dimension
            simulation = self.simulation()
            arrays |= {"mu": np.array(problem.mu)[:nc], "dimension": dimension}
            arrays |= {"end": now, "h": simulation.timeStep(), **places(self)}
        start = time.process_time()
        info: int = self.solve()
        cpu = time.process_time() - start
        if arrays:
            m = dimension * nc
            arrays |= {"r": np.array(self.z())[:m], "u": np.array(self.w())[:m]}
            if hasattr(self, "globalVelocities"):
                arrays["v"] = np.array(self.globalVelocities())[: len(arrays["q"])]
            steps.write(arrays | {"solve_cpu_s": cpu})
        self.postCompute()
        return info

    return shown(original, solved)


def writing_mixed(original: Any, steps: Steps) -> Any:
    """The same of the problems that have joints, whose solve cannot be called alone."""

    def solved(self: Any, now: float) -> int:
        kept = steps.next(now)
        start = time.process_time()
        info: int = original.compute(self, now)
        cpu = time.process_time() - start
        there = self.indexSetLevel() != NO_INDEX_SET and self.getSizeOutput()
        arrays = mixed(self) if kept and there else {}
        if arrays:
            told = {"end": now, "h": self.simulation().timeStep(), "solve_cpu_s": cpu}
            steps.write(arrays | told)
        return info

    return shown(original, solved)


def main() -> None:
    folder, every, script, *arguments = sys.argv[1:]
    steps = Steps(Path(folder), int(every))
    try:
        import siconos.io.mechanics_run as runner
    except ImportError:  # scripts may not need it
        runner = None
    for name, trace, told in (
        ("FrictionContact", "FCTrace", local),
        ("GlobalFrictionContact", "GFCTrace", globally),
    ):
        writes = writing(getattr(kernel, name), told, steps)
        setattr(kernel, name, writes)
        if runner is not None:
            setattr(runner, trace, writes)
    kernel.GenericMechanical = writing_mixed(kernel.GenericMechanical, steps)
    sys.argv = [script, *arguments]
    sys.path.insert(0, str(Path(script).parent))
    try:
        runpy.run_path(script, run_name="__main__")
    finally:
        count = {"steps": steps.count, "version": siconos.version}
        (Path(folder) / "steps.json").write_text(json.dumps(count), encoding="utf-8")


if __name__ == "__main__":
    main()
