"""Run a user's script unchanged, and record steps of its engine."""

from __future__ import annotations

import importlib
import os
import runpy
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final

from fclib.recorders import (
    _drake,
    _genesis,
    _lmgc90,
    _mujoco,
    _mujoco_warp,
    _newton,
    _pybullet,
    _siconos,
)
from fclib.recorders._recorded import Recording

# packages of an engine that are not in the extra, since they are gigabytes
APART: Final = {"genesis": "genesis-world torch"}


@contextmanager
def _steps_of_pybullet(recording: Recording) -> Iterator[None]:
    p: Any = importlib.import_module("pybullet")
    original = p.stepSimulation

    def step(physicsClientId: int = 0) -> Any:
        result: list[Any] = []

        def once(**options: Any) -> None:
            result.append(original(**options))

        recording.take(lambda: _pybullet.record(p, physicsClientId, None, None, once))
        if not result:  # the step was not kept, or is left out
            once(physicsClientId=physicsClientId)
        return result[0]

    p.stepSimulation = step
    try:
        yield
    finally:
        p.stepSimulation = original


@contextmanager
def _steps_of_mujoco(recording: Recording) -> Iterator[None]:
    mj: Any = importlib.import_module("mujoco")
    original = mj.mj_step

    def step(m: Any, d: Any, nstep: int = 1) -> None:
        for _ in range(nstep):
            taken: list[bool] = []

            def once(m: Any, d: Any, taken: list[bool] = taken) -> None:
                original(m, d)
                taken.append(True)

            recording.take(partial(_mujoco.record, mj, m, d, once))
            if not taken:  # the step was not kept, or is left out
                original(m, d)

    mj.mj_step = step
    try:
        yield
    finally:
        mj.mj_step = original


@contextmanager
def _steps_of_mujoco_warp(recording: Recording) -> Iterator[None]:
    warp: Any = importlib.import_module("mujoco_warp")
    original, put = warp.step, warp.put_model
    models: list[tuple[Any, Any]] = []  # MuJoCo's model, and the one that was made of it

    def put_model(mjm: Any, *arguments: Any, **options: Any) -> Any:
        models.append((mjm, put(mjm, *arguments, **options)))
        return models[-1][1]

    def step(m: Any, d: Any) -> None:
        source = next((mjm for mjm, made in models if made is m), None)
        taken: list[bool] = []

        def once(m: Any, d: Any) -> None:
            original(m, d)
            taken.append(True)

        if source is not None:
            recording.take(partial(_mujoco_warp.record, warp, source, m, d, once))
        if not taken:  # the step was not kept, or is left out
            original(m, d)

    warp.step, warp.put_model = step, put_model
    try:
        yield
    finally:
        warp.step, warp.put_model = original, put


@contextmanager
def _steps_of_drake(recording: Recording) -> Iterator[None]:
    drakes: Any = importlib.import_module("pydrake.all")
    kind = drakes.Simulator
    original = kind.AdvanceTo

    def advance(self: Any, *arguments: Any, **options: Any) -> Any:
        system = self.get_system()
        systems = system.GetSystems() if hasattr(system, "GetSystems") else [system]
        plant = next(
            (one for one in systems if isinstance(one, drakes.MultibodyPlant) and one.time_step()),
            None,
        )
        last = [None]

        def monitor(root: Any) -> Any:
            if plant is not None and root.get_time() != last[0]:
                last[0] = root.get_time()
                context = plant.GetMyContextFromRoot(root)
                recording.take(partial(_drake.drake, plant, context))
            return drakes.EventStatus.DidNothing()

        self.set_monitor(monitor)
        try:
            return original(self, *arguments, **options)
        finally:
            self.clear_monitor()

    kind.AdvanceTo = advance
    try:
        yield
    finally:
        kind.AdvanceTo = original


@contextmanager
def _steps_of_newton(recording: Recording) -> Iterator[None]:
    _newton.pinned()
    kind: Any = importlib.import_module("newton").solvers.SolverKamino
    original = kind.step

    def step(self: Any, *arguments: Any, **options: Any) -> Any:
        result = original(self, *arguments, **options)
        recording.take(partial(_newton.newton, self))
        return result

    kind.step = step
    try:
        yield
    finally:
        kind.step = original


@contextmanager
def _steps_of_genesis(recording: Recording) -> Iterator[None]:
    version = _genesis.pinned()
    name = "genesis.engine.solvers.rigid.rigid_solver"
    kind: Any = importlib.import_module(name).RigidSolver
    scene: Any = importlib.import_module("genesis").Scene
    original, build = kind.substep, scene.build
    building: list[Any] = []

    def built(self: Any, *arguments: Any, **options: Any) -> Any:
        building.append(self)
        try:
            return build(self, *arguments, **options)
        finally:
            building.pop()

    def step(self: Any, f: int) -> None:
        if building:  # a step that compiles, and is undone
            original(self, f)
            return
        taken: list[bool] = []

        def once() -> None:
            original(self, f)
            taken.append(True)

        recording.take(partial(_genesis.record, self, 0, version, once))
        if not taken:  # the step was not kept, or is left out
            original(self, f)

    kind.substep, scene.build = step, built
    try:
        yield
    finally:
        kind.substep, scene.build = original, build


@contextmanager
def _closed_at_exit(recording: Recording) -> Iterator[None]:
    """Close the recording also if the script ends the process at once."""
    original, own = os._exit, os.getpid()

    def end(status: int) -> None:
        if os.getpid() == own:  # a process that the script has made writes nothing
            recording.close()
        original(status)

    os._exit = end  # type: ignore[assignment]
    try:
        yield
    finally:
        os._exit = original


def _in_this_process(steps: Any, module: str) -> Callable[[Recording, Path, Sequence[str]], None]:
    """Run a script while the functions of an engine's module report its steps."""

    def run(recording: Recording, script: Path, arguments: Sequence[str]) -> None:
        before, path = sys.argv, list(sys.path)
        sys.argv = [str(script), *arguments]
        sys.path.insert(0, str(script.parent))
        try:
            with steps(recording), _closed_at_exit(recording):
                runpy.run_path(str(script), run_name="__main__")
        except SystemExit as end:
            if end.code not in (None, 0):
                raise ValueError(f"{script}: ended with {end.code}") from None
        except Exception as error:
            if isinstance(error, ModuleNotFoundError) and error.name == module:
                wanted = APART.get(module, "'fclib[recorders]'")
                raise ImportError(
                    f"{module} is not installed; install it with: pip install {wanted}"
                ) from None
            kind = type(error).__name__
            raise ValueError(f"{script}{_line_of(error, script)}: {kind}: {error}") from error
        finally:
            sys.argv, sys.path[:] = before, path

    return run


def _line_of(error: Exception, script: Path) -> str:
    """The last line of a script that an error passed, as ":12"; empty if it passed none."""
    if isinstance(error, SyntaxError):
        return f":{error.lineno}" if error.lineno else ""
    lines = [
        frame.lineno
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename == str(script)
    ]
    return f":{lines[-1]}" if lines else ""


ENGINES: Final[dict[str, Callable[..., None]]] = {
    "drake": _in_this_process(_steps_of_drake, "pydrake"),
    "genesis": _in_this_process(_steps_of_genesis, "genesis"),
    "lmgc90": _lmgc90.record,
    "mujoco": _in_this_process(_steps_of_mujoco, "mujoco"),
    "mujoco_warp": _in_this_process(_steps_of_mujoco_warp, "mujoco_warp"),
    "newton": _in_this_process(_steps_of_newton, "newton"),
    "pybullet": _in_this_process(_steps_of_pybullet, "pybullet"),
    "siconos": _siconos.record,
}


def record_script(
    engine: str,
    script: str | Path,
    out: str | Path,
    *,
    every: int = 1,
    arguments: Sequence[str] = (),
    **deck: Any,
) -> Recording:
    """Run a script, and write each `every`-th step of its engine that has contacts.

    `out` is a folder, or a sequence if its name ends in .h5 or .hdf5: see `Recording`. For LMGC90
    the script may be the folder of a deck; `deck` has its steps, time_step and theta, as
    `fclib.recorders.lmgc90` takes them.

    Raises:
        ValueError: the engine is not one of `ENGINES`, or `every` is below 1; a deck is wrong, or
            no step of the simulation can be recorded.
        ImportError: the engine is not installed.
        OSError: the script cannot be read, or the steps not written; there may be none before.
        ChildProcessError: Siconos or LMGC90 ended with an error; steps before it are written.
    """
    if engine not in ENGINES:
        raise ValueError(f"no engine {engine!r} is recorded; there is: {', '.join(ENGINES)}")
    script = Path(script)
    is_deck = engine == "lmgc90" and script.is_dir()
    if not script.is_file() and not is_deck:
        raise FileNotFoundError(f"{script}: there is no such script")
    if deck and not is_deck:
        raise ValueError(f"{', '.join(deck)}: only for the folder of a deck of LMGC90")
    with Recording(out, every) as recording:
        ENGINES[engine](recording, script, arguments, **deck)
    return recording
