"""Lists of chosen problems, by rules that anyone can repeat.

local   from a built collection: the contacts that one-contact solvers find hardest
tiny    one problem of each kind, from the list below
"""

from __future__ import annotations

import json
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fclib import _core, _digest, _solve, scenes
from fclib._files import write_text
from fclib.collections import catalog, set_index, trajectory
from fclib.collections.plan import Plan, Simulation, source
from fclib.collections.record import record
from fclib.collections.set_index import Choice

Progress = Callable[[str, int, int], None]

# one problem for each kind: family, parameters, number
TINY: tuple[tuple[str, dict[str, Any], int], ...] = (
    ("PlanarBlocks", {"courses": 4, "blocks": 3}, 90),  # d = 2
    ("Capsules", {"capsules": 20, "width": 16.0}, 300),  # d = 3
    ("KaplasTower", {"levels": 2}, 30),  # d = 3, reactions not unique
    ("RollingDiscs", {"discs": 12, "per_row": 4}, 40),  # d = 3, planar rolling
    ("RollingSpheres", {"spheres": 16, "per_layer": 4}, 60),  # d = 5
    ("FourBar", {"linkages": 2}, 150),  # bilateral constraints
    ("LocalProblems", {}, 0),  # only a local form
    ("Wall", {}, 3),  # assembled directly
)


def write_list(path: Path, choices: Iterable[Choice], rule: Mapping[str, Any]) -> None:
    """Write a list in the package's format: the rule, and the problems."""
    rows = []
    for choice in choices:
        row = asdict(choice)
        if not row["scene"]:
            del row["scene"]
        rows.append(json.dumps(row, sort_keys=True))
    head = json.dumps(dict(rule), sort_keys=True)
    text = f'{{"rule": {head},\n "problems": [\n  ' + ",\n  ".join(rows) + "\n]}\n"
    write_text(path, text)


def archive(folder: Path, names: Iterable[str], version: str) -> None:
    """Keep the present lists as those of their version, if they are of another one."""
    for name in names:
        path = folder / f"{name}.json"
        if not path.is_file():
            continue
        own = json.loads(path.read_text(encoding="utf-8"))["rule"].get("version")
        own = own or set_index.version(name)
        if own != version:
            target = folder / set_index.OLDER / f"{name}-{own}.json"
            target.parent.mkdir(exist_ok=True)
            path.replace(target)


# ---- tiny


def tiny() -> list[Choice]:
    """The problems of TINY, each simulated up to its number."""
    return [choice_of(family, parameters, 0, number) for family, parameters, number in TINY]


def choice_of(family: str, parameters: Mapping[str, Any], seed: int, number: int) -> Choice:
    """A problem by its number, from a simulation. ValueError if the scene has fewer."""
    scene = source(family, dict(parameters), seed)
    if isinstance(scene, scenes.Assembled):
        digest = _digest.digest(scene.problem(number))
        return Choice(family, scene.parameters, seed, number, number, digest)
    plan = Plan(
        scene=scene,
        collection="chosen",
        problems=number + 1,
        chosen=(number,),
        simulation=Simulation(),
    )
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / f"{family}{trajectory.SUFFIX}"
        record(plan, target, Path(folder) / "state.npz")
        states = trajectory.read(target)
    if not len(states):
        raise ValueError(f"{family}: has no problem {number}")
    step = int(states.step[0])
    return Choice(family, dict(scene.parameters), seed, number, step, states.digest[0])


# ---- local

# one-contact solvers of nsgs, in the order of the table
LOCAL_SOLVERS = ("exact", "projection", "diagonal", "alart-curnier", "fischer-burmeister")
SWEEPS = 100  # largest number for a contact
LOCAL_TOLERANCE = 1e-10  # if W is small, tighter ones depend on rounding


@dataclass(frozen=True)
class Contact:
    """A problem of one contact, and the sweeps of each local solver; SWEEPS + 1 means failed."""

    problem: Any
    origin: str
    sweeps: dict[str, int]

    @property
    def difficulty(self) -> tuple[int, int]:
        """Sort key: number of solvers that failed, then sum of sweeps."""
        sweeps = self.sweeps.values()
        return sum(count > SWEEPS for count in sweeps), sum(sweeps)

    def record(self) -> dict[str, Any]:
        """The problem in the format of `local_problems.json`."""
        mu_r = getattr(self.problem, "mu_r", None)
        return {
            "spacedim": self.problem.spacedim,
            "W": np.asarray(self.problem.W).tolist(),
            "q": np.asarray(self.problem.q).tolist(),
            "mu": float(self.problem.mu[0]),
            "mu_r": None if mu_r is None else float(mu_r[0]),
            "origin": self.origin,
            "sweeps": self.sweeps,
        }


def measure(problem: Any, origin: str) -> Contact:
    """Try each local solver on a problem of one contact."""
    sweeps = {}
    for name in LOCAL_SOLVERS:
        result = _solve.solve(
            problem, "nsgs", tol=LOCAL_TOLERANCE, max_iterations=SWEEPS, local_solver=name
        )
        sweeps[name] = result.iterations if result.converged else SWEEPS + 1
    return Contact(problem, origin, sweeps)


def one_contact(W: Any, q: Any, mu: float, mu_r: float | None) -> Any:
    """A problem of one contact from its block (d x d)."""
    values: dict[str, Any] = {"spacedim": len(q), "W": W, "q": q, "mu": np.array([mu])}
    if mu_r is None:
        return _core.LocalProblem(**values)
    return _core.LocalRollingProblem(**values, mu_r=np.array([mu_r]))


def contacts_of(path: Path) -> Iterator[tuple[int, Any]]:
    """The contacts of a local file that have a reaction: number, and problem at the solution.

    q_c = u_c - W_cc r_c holds the effect of the other contacts and of the bilateral constraints.
    """
    problem: Any = _core.read(path)
    solution: Any = _core.read_solution(path)
    if solution is None:  # no solution is known
        return
    d = problem.spacedim
    W = problem.W.tocsr() if hasattr(problem.W, "tocsr") else problem.W
    r, u = solution.r.reshape(-1, d), solution.u.reshape(-1, d)
    for c in np.flatnonzero(r[:, 0] > 0).tolist():
        own = slice(d * c, d * c + d)
        block = W[own, own]
        block = block.toarray() if hasattr(block, "toarray") else np.array(block)
        mu_r = None if problem.kind == "local" else float(problem.mu_r[c])
        yield c, one_contact(block, u[c] - block @ r[c], float(problem.mu[c]), mu_r)


def spinning(seed: int) -> Any:
    """A body that spins fast and touches the ground; W = H^T (M + h Gamma)^-1 H is not symmetric.

    Gamma is the derivative of the gyroscopic moment omega x I omega, taken at the end of the step.
    Odd seeds have rolling friction, d = 5.
    """
    random = np.random.Generator(np.random.PCG64(seed))
    inertia = random.uniform(0.1, 1.0) * np.diag(random.uniform(0.5, 1.0, 3)) * 1e-2
    omega = random.uniform(-400, 400, 3)
    arm = random.uniform(-0.2, 0.2, 3)
    momentum = inertia @ omega
    M = np.eye(6)
    M[3:, 3:] = inertia + 5e-3 * (cross_matrix(omega) @ inertia - cross_matrix(momentum))
    # the ground is below: N is z
    axes = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    H = np.vstack((axes.T, np.cross(arm, axes).T))
    speed = random.uniform(-2, 2, 3)
    speed[0] = -abs(speed[0])
    mu, mu_r = float(random.choice([0.1, 0.3, 0.7, 1.0, 2.0])), None
    if seed % 2:
        H = np.hstack((H, np.vstack((np.zeros((3, 2)), axes[1:].T))))
        speed = np.append(speed, random.uniform(-20, 20, 2))
        mu_r = float(random.choice([1e-3, 1e-2, 1e-1]))
    return one_contact(H.T @ np.linalg.solve(M, H), speed, mu, mu_r)


def cross_matrix(a: Any) -> Any:
    """The matrix of a x ."""
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def local(
    folder: Path,
    *,
    sample: int = 200,
    per_family: int = 4,
    spins: int = 2000,
    asymmetric: int = 16,
    progress: Progress | None = None,
) -> list[Contact]:
    """The hardest contacts of each family of a collection, and of bodies that spin.

    The hardest contact is the one that most local solvers fail on within SWEEPS sweeps; among
    equals, the one with most sweeps in total. At most one contact is taken from a problem, and at
    most one of those on which every solver takes the same sweeps. A contact that no local solver
    solves is left out.

    Args:
        folder: a built collection, with local forms.
        sample: number of problems of each family, evenly spread.
        per_family: number of contacts taken from each family.
        spins: number of spinning bodies, drawn with the seeds 0, 1, ...
        asymmetric: number of contacts taken from them, half with rolling friction.
        progress: called with SET/FAMILY, problems done and their total.

    Raises:
        CatalogError: the folder has no catalogue.
    """
    families: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for row in catalog.read_catalog(folder).to_pylist():
        if row["local_file"] is not None and row["nc"] > 1:
            families[f"{row['collection']}/{row['family']}"].append(row)
    tell = progress or (lambda name, done, total: None)
    found = []
    for name, rows in families.items():
        places = np.unique(np.linspace(0, len(rows) - 1, min(sample, len(rows))).round())
        hardest = []
        for done, place in enumerate(places.astype(int).tolist(), start=1):
            row = rows[place]
            own = [
                measure(problem, f"{row['id']}, contact {c}")
                for c, problem in contacts_of(folder / row["local_file"])
            ]
            hardest += hardest_distinct(own, 1)
            tell(name, done, len(places))
        found += hardest_distinct(hardest, per_family)
    spun = [measure(spinning(seed), f"a spinning body, seed {seed}") for seed in range(spins)]
    plain, rolling = spun[::2], spun[1::2]
    return (
        found
        + hardest_distinct(plain, asymmetric - asymmetric // 2)
        + hardest_distinct(rolling, asymmetric // 2)
    )


def hardest_distinct(contacts: Sequence[Contact], count: int) -> list[Contact]:
    """The hardest contacts that some local solver solves; of equals only the first."""
    solvable = [contact for contact in contacts if min(contact.sweeps.values()) <= SWEEPS]
    ranked = sorted(solvable, key=lambda contact: contact.difficulty, reverse=True)
    # a lasting contact changes little over many steps
    distinct: dict[tuple[int, ...], Contact] = {}
    for contact in ranked:
        distinct.setdefault(tuple(contact.sweeps.values()), contact)
    return list(distinct.values())[:count]


def write_local(path: Path, contacts: Iterable[Contact], rule: Mapping[str, Any]) -> None:
    """Write the numbers of contacts, exact to the last bit."""
    rows = [json.dumps(contact.record(), sort_keys=True) for contact in contacts]
    head = json.dumps(dict(rule), sort_keys=True)
    text = f'{{"rule": {head},\n "problems": [\n  ' + ",\n  ".join(rows) + "\n]}\n"
    write_text(path, text)
