"""Problems that a campaign makes: of the collection, steps of a scene, random ones.

They go into a cache folder. The folder's name says how they were made, so that each is made once.
The same recipe gives the same problems, bit for bit.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fclib import _core
from fclib._words import counted
from fclib.bench.problems import SUFFIXES, sample

if TYPE_CHECKING:
    from fclib.collections.build import Progress
    from fclib.collections.plan import Plan

PATIENCE = 10.0  # [s] between two messages on the progress of a build


def cache_folder() -> Path:
    """The folder for problems that are made: $FCLIB_CACHE, or fclib in the user's cache."""
    own = os.environ.get("FCLIB_CACHE")
    if own:
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fclib"


def files_of(recipe: Mapping[str, Any], make: Callable[[Path], None]) -> list[Path]:
    """The files of a recipe; make(folder) writes them if they are not there yet."""
    text = json.dumps({"fclib": _core.version, **recipe}, sort_keys=True)
    name = hashlib.sha256(text.encode()).hexdigest()[:16]
    folder = cache_folder() / "problems" / name
    if not folder.is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f".{name}-", dir=folder.parent))
        try:
            make(part)
            (part / "recipe.json").write_text(text)
            try:
                part.rename(folder)
            except OSError:
                if not folder.is_dir():  # else another campaign was faster
                    raise
        finally:
            shutil.rmtree(part, ignore_errors=True)
    return sorted(path for path in folder.iterdir() if path.suffix in SUFFIXES)


def simulated(
    family: str,
    parameters: Mapping[str, Any],
    steps: Sequence[int],
    seed: int,
    form: str | None = None,
) -> list[Path]:
    """The problems of some steps of a scene, with the names of their contacts.

    Steps without contact are left out.

    Args:
        family: name of the scene.
        parameters: those of the scene that are not its defaults.
        steps: numbers of time steps, from 0 on.
        seed: random seed of the scene.
        form: "global", or by default "local".

    Raises:
        ImportError: MuJoCo is not there.
        fclib.OptionError: there is no such family, or it refuses the parameters.
    """
    from fclib import scenes

    wanted = set(steps)
    recipe = {
        "scene": family,
        **scenes.identity_of(family),
        "parameters": dict(parameters),
        "steps": sorted(wanted),
        "seed": seed,
        "geometry": True,
    }
    if form == "global":
        recipe["form"] = form

    def make(folder: Path) -> None:
        from fclib import simulate

        try:
            kind = scenes.get(family)
            known = [item.name for item in dataclasses.fields(kind)]
            if unknown := [name for name in parameters if name not in known]:
                raise ValueError(f"has no parameter {unknown[0]}; it has {', '.join(known)}")
            scene = kind(**parameters).scene(seed)
        except (KeyError, TypeError, ValueError) as error:
            # str() of a KeyError would put its text in quotes
            raise _core.OptionError(f"simulate {family}: {error.args[0]}") from None
        for step in simulate.simulate(scene, max(wanted) + 1):
            if step.index in wanted and step.problem.nc:
                # the model is in the state of the step until the next one is asked for
                contacts, bodies = simulate.geometry_of(step.model, step.contacts)
                problem: Any = step.problem if form == "global" else step.problem.condense()
                named = problem.replace(info=step.problem.info, contacts=contacts, bodies=bodies)
                _core.write(folder / f"{family}-{seed}-{step.index:05d}.hdf5", named)

    return files_of(recipe, make)


def stored(name: str, form: str | None, start: int, count: int | None, stride: int) -> list[Path]:
    """Problems of a family of the collection, from its stored states, in the order of the steps.

    Args:
        name: SET/FAMILY.
        form: "global" or "local", of problems that have both.
        start: the first of them; 0 is the first that is stored.
        count: how many; None: all.
        stride: step from one problem to the next.

    Raises:
        ImportError: MuJoCo is not there.
        fclib.Error: there is no such family, or no states of it are stored.
    """
    from fclib import collections

    try:
        folders = collections.folders([name])
    except KeyError as error:
        raise _core.Error(f"set {name}: {error.args[0]}") from None
    if len(folders) != 1:
        raise _core.Error(
            f"set {name}: a sequence is of one family, and this has {', '.join(folders)}"
        )
    plan = collections.plan_of(folders[0])
    if plan.trajectory is None:
        raise _core.Error(f"set {name}: no states are stored of it, which a sequence is made from")
    path = plan.trajectory
    recipe = {"states": path.name, "of": folders[0], "form": form, "steps": [start, count, stride]}

    def make(folder: Path) -> None:
        try:
            states = collections.read_trajectory(path)
        except (OSError, ValueError) as error:
            raise _core.Error(f"set {name}: {error}") from None
        end = None if count is None else start + count * stride
        for place in range(len(states))[start:end:stride]:
            problem: Any = states.problem(place).problem
            if form == "local":
                problem = problem.condense()
            own = f"{plan.scene.name}-{int(states.number[place]):05d}.hdf5"
            _core.write(folder / own, problem)

    return files_of(recipe, make)


def of_set(
    name: str, form: str | None = None, tell: Callable[[str], None] = lambda _: None
) -> list[Path]:
    """The files of a set or family of the collection. What is missing is fetched, or built alone.

    Args:
        name: as ``fclib collection list`` prints it.
        form: "global" or "local"; by default the global one of a problem that has both.
        tell: called with the name of each build and its progress.

    Raises:
        fclib.Error: there is no such set, or it can neither be built nor fetched.
        ImportError: the collection needs a package that is not there.
    """
    from fclib.collections import library, set_index

    try:
        found = library.Collection(name)
        fetched = bool(os.environ.get(library.SOURCE))
        made = {  # the families that no folder of the collection has
            own: _without_references(set_index.plan_of(own))
            for own in found.folders
            if not fetched and not library.is_there(own, found.folder)
        }
        missing = [own for own, (_, folder) in made.items() if not library.is_there(own, folder)]
        if missing:
            tell(
                f"set {name}: {len(found.folders) - len(missing)} of {len(found.folders)} families"
                " are there; the others are made now, once, without reference solutions:"
                f" {', '.join(own.split('/')[-1] for own in missing)}. On several cores:"
                f" fclib collection build {name} --no-references --out {found.folder}"
            )
        for k, own in enumerate(missing):
            _build(*made[own], now_and_then(f"family {k + 1} of {len(missing)}", tell))
        if missing:
            tell(f"set {name}: built")
        paths = []
        for own in found.folders:
            part = library.Collection(own, made[own][1] if own in made else found.folder)
            paths += [part.path(k, form).resolve() for k in range(len(part))]
        return paths
    except (KeyError, OSError) as error:
        word = error.args[0] if isinstance(error, KeyError) else error
        raise _core.Error(f"set {name}: {word}") from None


def sampled(
    name: str, form: str | None, count: int | None, tell: Callable[[str], None]
) -> list[Path]:
    """Some problems of a family of the collection, as `problems.sample` takes them, built alone.

    Empty if the family is there or can be fetched, if no states of it are stored, or if it has no
    more problems than these.

    Args:
        name: SET/FAMILY; nothing else is sampled here.
        form: "global" or "local", of problems that have both.
        count: how many; None: all.
        tell: called with the progress of the build.

    Raises:
        ImportError: MuJoCo or pyarrow is not there.
        OSError, fclib.Error: the files cannot be written.
    """
    from fclib.collections import library, set_index

    if count is None or os.environ.get(library.SOURCE):
        return []
    try:
        found = library.Collection(name)
    except KeyError:
        return []  # of_set says what there is
    if len(found.folders) != 1 or library.is_there(found.folders[0], found.folder):
        return []
    plan = set_index.plan_of(found.folders[0])
    numbers = plan.numbers().tolist()
    if plan.trajectory is None or count >= len(numbers):
        return []
    plan, folder = _without_references(plan.only(sample(numbers, count)))
    _build(plan, folder, now_and_then(f"a sample of {count}", tell))
    part = library.Collection(plan.name, folder)
    return [part.path(k, form).resolve() for k in range(len(part))]


def _without_references(plan: Plan) -> tuple[Plan, Path]:
    """The plan without references, which take longer than runs do, and its folder in the cache."""
    plan = dataclasses.replace(plan, references=False)
    digest = hashlib.sha256(plan.fingerprint().encode()).hexdigest()[:16]
    return plan, cache_folder() / "samples" / digest


def _build(plan: Plan, folder: Path, progress: Progress) -> None:
    from fclib.collections.build import build

    build([plan], folder, pictures=False, progress=progress)


def now_and_then(which: str, tell: Callable[[str], None]) -> Callable[[str, int, int], None]:
    """Tells the progress of a family's build: at its beginning, and every `PATIENCE` seconds."""
    last_told = -PATIENCE

    def show(name: str, done: int, total: int) -> None:
        nonlocal last_told
        if time.monotonic() - last_told >= PATIENCE:
            last_told = time.monotonic()
            tell(f"{which}: {name}, {done} of {counted(total, 'problem')}")

    return show


def planted(count: int, contacts: int, spacedim: int, seed: int) -> list[Path]:
    """Random local problems around a solution in which contacts are open, stick and slide in turn.

    W = A A^T + I / 2 with A sparse, about 6 blocks a row; u and r obey Coulomb's law, and
    q = u - W r.
    """
    recipe = {"planted": count, "contacts": contacts, "spacedim": spacedim, "seed": seed}

    def make(folder: Path) -> None:
        for number in range(count):
            problem = plant(contacts, spacedim, seed + number)
            _core.write(folder / f"planted-{spacedim}d-{contacts}-{seed + number}.hdf5", problem)

    return files_of(recipe, make)


def plant(nc: int, d: int, seed: int) -> _core.LocalProblem:
    """One of `planted`, with nc contacts of d components."""
    import scipy.sparse as sp

    random = np.random.Generator(np.random.PCG64([seed, nc, d]))
    mu = random.uniform(0.2, 0.8, nc)
    u, r = np.zeros((nc, d)), np.zeros((nc, d))
    for k in range(nc):
        tangent = random.standard_normal(d - 1)
        tangent /= np.linalg.norm(tangent)
        normal = random.uniform(0.5, 2.0)
        if k % 3 == 0:  # open
            u[k] = [random.uniform(0.1, 1.0), *random.uniform(-1, 1, d - 1)]
        elif k % 3 == 1:  # sticks
            r[k] = [normal, *(random.uniform(0, 0.9) * mu[k] * normal * tangent)]
        else:  # slides
            r[k] = [normal, *(mu[k] * normal * tangent)]
            u[k] = [0.0, *(-random.uniform(0.1, 1.0) * tangent)]
    rows = np.repeat(np.arange(nc), 3)
    columns = random.integers(0, nc, rows.size)
    blocks = random.standard_normal((rows.size, d, d)) / np.sqrt(3 * d)
    i = (d * rows[:, None, None] + np.arange(d)[:, None]) + np.zeros((1, 1, d), int)
    j = (d * columns[:, None, None] + np.arange(d)) + np.zeros((1, d, 1), int)
    A = sp.csr_array((blocks.ravel(), (i.ravel(), j.ravel())), shape=(d * nc, d * nc))
    W = sp.csr_array(A @ A.T + 0.5 * sp.eye_array(d * nc))
    return _core.LocalProblem(
        spacedim=d,
        W=W,
        q=u.ravel() - W @ r.ravel(),
        mu=mu,
        info=_core.ProblemInfo(title=f"Planted, {nc} contacts, seed {seed}"),
    )
