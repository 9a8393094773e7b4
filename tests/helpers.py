"""Problems whose solution is known, and what several tests need."""

from __future__ import annotations

import importlib.util
import math
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import pytest
import scipy.sparse as sp

import fclib
from fclib.external import siconos

Array: TypeAlias = npt.NDArray[np.float64]

STORAGES = ("csr", "csc", "coo", "dense")

CASES = Path(__file__).resolve().parents[2] / "shared" / "data" / "cases"


def real_folder() -> Path:
    """The folder of real problems: $FCLIB_DATA, or shared/data/real beside the repository."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data" / "real"
    return Path(os.environ.get("FCLIB_DATA", default))


def case(name: str) -> Path:
    """A recorded problem on which a verdict was wrong. Skips the test if it is not there."""
    path = CASES / name
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    return path


def needs_siconos_mechanics() -> None:
    """Skips the test if Siconos is not there, or cannot simulate: its own package lacks SciPy."""
    if siconos.missing():
        pytest.skip("Siconos is not installed")
    code = "import siconos.io.mechanics_run, siconos.mechanics.collision.bullet"
    if subprocess.run([siconos.python(), "-c", code], capture_output=True, check=False).returncode:
        pytest.skip("Siconos has no mechanics with Bullet, or its Python has no SciPy")


# ---- the same digits on every processor: NumPy's products are BLAS's, whose sums depend on it


def product(a: Array, b: npt.NDArray[Any]) -> Array:
    """A @ b for a matrix A, and a vector or a matrix b."""
    total = np.zeros(a.shape[:1] + b.shape[1:])
    for column, row in zip(a.T, b, strict=True):
        total += np.multiply.outer(column, row)
    return total


def length(x: Array) -> float:
    """||x|| of a few numbers."""
    return math.sqrt(sum(float(part) ** 2 for part in x))


# ---- the law, in NumPy


def tangential_norm(x: Array) -> Array:
    """||x_T|| of each row, without overflow where its square would."""
    return np.asarray(np.hypot.reduce(np.abs(x[:, 1:]), axis=1))


def project(x: Array, mu: Array) -> Array:
    """The projection of each row on { ||x_T|| <= mu x_N }: x itself, or its part along a ray."""
    norm = tangential_norm(x)
    directions = x[:, 1:] / np.where(norm > 0, norm, 1)[:, None]
    rays = np.column_stack([np.ones_like(mu), mu[:, None] * directions])
    rays /= np.sqrt(1 + mu**2)[:, None]
    along = np.maximum(np.sum(rays * x, axis=1), 0)
    inside = (x[:, 0] >= 0) & (norm <= mu * x[:, 0])
    return np.where(inside[:, None], x, along[:, None] * rays)


def modified(u: Array, mu: Array) -> Array:
    """u^ = u + [mu ||u_T||, 0, 0] of each row."""
    result = u.copy()
    result[:, 0] += mu * tangential_norm(u)
    return result


# ---- matrices in every storage


def columns(a: Any) -> Any:
    """Any matrix as csc_array, duplicates added up."""
    result = sp.csc_array(a)
    result.sum_duplicates()
    return result


def stored(a: npt.ArrayLike, storage: str, rng: np.random.Generator) -> Any:
    """The matrix in a storage: entries in random order, triplets with duplicates."""
    a = np.asarray(a, dtype=float)
    if storage == "dense":
        return a
    rows, cols = np.nonzero(a)
    values = a[rows, cols]
    if storage == "coo" and values.size:
        rows, cols = np.append(rows, rows[0]), np.append(cols, cols[0])
        values = np.append(values, values[0] / 2)
        values[0] /= 2
    order = rng.permutation(values.size)
    rows, cols, values = rows[order], cols[order], values[order]
    if storage == "coo":
        return sp.coo_array((values, (rows, cols)), shape=a.shape)
    outer, inner = (rows, cols) if storage == "csr" else (cols, rows)
    count = a.shape[0] if storage == "csr" else a.shape[1]
    by_outer = np.argsort(outer, kind="stable")
    pointers = np.concatenate([[0], np.cumsum(np.bincount(outer, minlength=count))])
    make = sp.csr_array if storage == "csr" else sp.csc_array
    return make((values[by_outer], inner[by_outer], pointers), shape=a.shape)


# ---- problems built backwards from their solution


@dataclass(frozen=True)
class Planted:
    """A problem, a solution of it, and how many contacts are open, stick and slide."""

    problem: fclib.Problem
    solution: fclib.Solution
    statuses: tuple[int, int, int]


def contact_states(
    rng: np.random.Generator, d: int, mu: Array
) -> tuple[Array, Array, tuple[int, int, int]]:
    """Velocities and reactions (nc, d) that obey Coulomb's law, open, sticking and sliding."""
    nc = mu.size
    u, r = np.zeros((nc, d)), np.zeros((nc, d))
    counts = [0, 0, 0]
    for contact in range(nc):
        status = contact % 3
        if mu[contact] == 0 and status == 1:
            status = 2  # without friction there is no sticking
        counts[status] += 1
        tangent = rng.standard_normal(d - 1)
        tangent /= length(tangent)
        if status == 0:
            u[contact] = [rng.uniform(0.1, 1), *rng.uniform(-1, 1, d - 1)]
            continue
        normal = rng.uniform(0.5, 2)
        if status == 1:
            r[contact] = [normal, *(rng.uniform(0, 0.9) * mu[contact] * normal * tangent)]
        else:
            r[contact] = [normal, *(mu[contact] * normal * tangent)]
            u[contact] = [0, *(-rng.uniform(0.1, 1) * tangent)]
    return u, r, (counts[0], counts[1], counts[2])


def rolling_states(
    rng: np.random.Generator, d: int, mu: Array, mu_r: Array
) -> tuple[Array, Array, tuple[int, int, int]]:
    """Velocities and reactions (nc, d): open, sticking, sliding, rolling, and both, in turn."""
    nc = mu.size
    half = (d - 1) // 2
    u, r = np.zeros((nc, d)), np.zeros((nc, d))
    counts = [0, 0, 0]
    for k in range(nc):
        status = k % 5
        counts[min(status, 2)] += 1
        if status == 0:
            u[k] = rng.normal(size=d)
            u[k, 0] = abs(u[k, 0]) + 0.1
            continue
        r[k, 0] = rng.uniform(0.5, 2)
        for part, limit, moves in (
            (slice(1, 1 + half), mu[k], status in (2, 4)),
            (slice(1 + half, d), mu_r[k], status in (3, 4)),
        ):
            direction = rng.normal(size=half)
            direction /= length(direction)
            r[k, part] = limit * r[k, 0] * direction * (1.0 if moves else 0.5)
            u[k, part] = -direction * rng.uniform(0.5, 2) if moves else 0.0
    return u, r, (counts[0], counts[1], counts[2])


def planted_law(
    rng: np.random.Generator, d: int, nc: int, mu: float | None, rolling: bool
) -> tuple[dict[str, Array], tuple[Array, Array, tuple[int, int, int]]]:
    """Coefficients of friction, a tenth of them for rolling, and the states of the contacts."""
    coefficients = rng.uniform(0.1, 0.6, nc) if mu is None else np.full(nc, mu)
    if not rolling:
        return {"mu": coefficients}, contact_states(rng, d, coefficients)
    law = {"mu": coefficients, "mu_r": coefficients / 10}
    return law, rolling_states(rng, d, **law)


def planted_global(
    seed: int,
    d: int = 3,
    nc: int = 6,
    p: int = 0,
    mu: float | None = None,
    storage: str = "csr",
    rolling: bool = False,
) -> Planted:
    """A global problem, mixed where p > 0, with its solution."""
    rng = np.random.default_rng(seed)
    n = 2 * (d * nc + p) + 1
    root = rng.standard_normal((n, n)) * (rng.uniform(size=(n, n)) < 0.2)
    M = root @ root.T / n + np.eye(n)
    H = np.eye(n, d * nc) + 0.1 * rng.standard_normal((n, d * nc))
    G = np.eye(n, p, -d * nc) + 0.1 * rng.standard_normal((n, p))
    law, (u, r, statuses) = planted_law(rng, d, nc, mu, rolling)
    lam, f = rng.standard_normal(p), rng.standard_normal(n)
    v = np.linalg.solve(M, H @ r.ravel() + G @ lam + f)
    mixed = {"G": stored(G, storage, rng), "b": -G.T @ v} if p else {}
    kind: Any = fclib.GlobalRollingProblem if rolling else fclib.GlobalProblem
    problem = kind(
        spacedim=d,
        M=stored(M, storage, rng),
        H=stored(H, storage, rng),
        f=f,
        w=u.ravel() - H.T @ v,
        **law,
        **mixed,
    )
    solution = fclib.Solution(v=v, u=u.ravel(), r=r.ravel(), l=lam if p else None)
    return Planted(problem, solution, statuses)


def planted_local(
    seed: int,
    d: int = 3,
    nc: int = 6,
    p: int = 0,
    mu: float | None = None,
    storage: str = "csr",
    rolling: bool = False,
    skew: float = 0.0,
) -> Planted:
    """A local problem, mixed where p > 0, with its solution; skew > 0 makes W asymmetric."""
    rng = np.random.default_rng(seed)
    m = d * nc
    root = np.eye(m + p) + 0.3 * rng.standard_normal((m + p, m + p)) / np.sqrt(max(1, m + p))
    whole = root @ root.T
    asymmetric = rng.standard_normal((m, m))
    W = whole[:m, :m] + skew * (asymmetric - asymmetric.T) / max(1, m)
    V, R = whole[:m, m:], whole[m:, m:]
    law, (u, r, statuses) = planted_law(rng, d, nc, mu, rolling)
    lam = rng.standard_normal(p)
    mixed = {}
    if p:
        mixed = {
            "V": stored(V, storage, rng),
            "R": stored(R, storage, rng),
            "s": -V.T @ r.ravel() - R @ lam,
        }
    kind: Any = fclib.LocalRollingProblem if rolling else fclib.LocalProblem
    problem = kind(
        spacedim=d, W=stored(W, storage, rng), q=u.ravel() - W @ r.ravel() - V @ lam, **law, **mixed
    )
    solution = fclib.Solution(u=u.ravel(), r=r.ravel(), l=lam if p else None)
    return Planted(problem, solution, statuses)


def planted_bodies(
    seed: int,
    nc: int = 12,
    d: int = 3,
    ratio: float = 1.0,
    mu: float = 0.5,
    hyperstatic: bool = False,
    duplicated: int = 0,
    boundary: bool = False,
) -> tuple[fclib.GlobalProblem, Array]:
    """Bodies of masses from 1 to `ratio` in contact, and reactions that solve it.

    `duplicated` contacts are there twice, `boundary` puts statuses on the cone's boundary: contacts
    that graze, or stick at the limit of friction.
    """
    rng = np.random.default_rng(seed)
    m = d * nc
    n = max(3, m // 2 if hyperstatic else 2 * m)
    mass = np.exp(rng.uniform(0, np.log(ratio), n)) if ratio > 1 else np.ones(n)
    # a contact links two groups of coordinates, as the bodies that they are
    H = np.zeros((n, m))
    for a in range(nc):
        rows = rng.choice(n, size=min(n, 2 * d), replace=False)
        H[np.ix_(rows, np.arange(d * a, d * a + d))] = rng.standard_normal((len(rows), d))
    if duplicated:
        H = np.hstack([H, H[:, : d * duplicated]])
        nc += duplicated
        m = d * nc
    coefficients = np.full(nc, mu)
    u, r, _ = contact_states(rng, d, coefficients)
    if boundary:
        for a in range(nc):
            if (a % 2 and r[a, 0] == 0) or u[a, 0] == 0:
                u[a] = 0  # grazes at rest, or sticks at the limit
    if duplicated:  # the same velocity and law at both
        k = nc - duplicated
        u[k:], r[k:] = u[:duplicated], r[:duplicated]
    v = rng.standard_normal(n)
    problem = fclib.GlobalProblem(
        spacedim=d,
        M=np.diag(mass),
        H=H,
        f=mass * v - H @ r.ravel(),
        w=u.ravel() - H.T @ v,
        mu=coefficients,
    )
    return problem, r.ravel()


def bodies(*arguments: Any, **parameters: Any) -> fclib.GlobalProblem:
    """The problem of `planted_bodies`."""
    return planted_bodies(*arguments, **parameters)[0]


def planted_rolling(d: int, seed: int, nc: int = 6) -> tuple[fclib.LocalRollingProblem, Array]:
    """A problem and its reactions: open, sticking, sliding, rolling, and both, in turn."""
    rng = np.random.default_rng(seed)
    mu, mu_r = rng.uniform(0.2, 0.8, nc), rng.uniform(0.02, 0.3, nc)
    u, r, _ = rolling_states(rng, d, mu, mu_r)
    root = rng.normal(size=(nc * d, nc * d)) / np.sqrt(nc * d)
    W = root @ root.T + 0.5 * np.eye(nc * d)
    problem = fclib.LocalRollingProblem(
        spacedim=d, W=W, q=u.ravel() - W @ r.ravel(), mu=mu, mu_r=mu_r
    )
    return problem, r.ravel()


def spin_states(
    rng: np.random.Generator, law: dict[str, Array], coupled: bool, edges: bool = True
) -> tuple[Array, Array, tuple[int, int, int]]:
    """Velocities and reactions (nc, d) of contacts with spin, in turn over all their states.

    A contact is open, or each of its groups sticks or moves: sliding, spin and rolling if there is
    mu_r. With `edges` some graze, u_N and r are 0, and some that stick are just at the limit.
    """
    mu, mu_s, mu_r = law["mu"], law["mu_s"], law.get("mu_r")
    nc, d = mu.size, 4 if mu_r is None else 6
    parts = [(slice(1, 3), mu), (slice(3, 4), mu_s)]
    parts += [] if mu_r is None else [(slice(4, 6), mu_r)]
    u, r = np.zeros((nc, d)), np.zeros((nc, d))
    counts = [0, 0, 0]
    for k in range(nc):
        state = k % (1 + 2 ** len(parts))
        if state == 0:
            counts[0] += 1
            if k % 2 == 0 or not edges:  # the others graze
                u[k] = rng.normal(size=d)
                u[k, 0] = abs(u[k, 0]) + 0.1
            continue
        moves = [bool((state - 1) >> g & 1) for g in range(len(parts))]
        counts[2 if any(moves) else 1] += 1
        r[k, 0] = rng.uniform(0.5, 2)
        if coupled:
            axes = np.array([mu[k], mu[k], mu_s[k]])
            way = rng.normal(size=3) * [moves[0], moves[0], moves[1]]
            if any(moves):
                u[k, 1:] = way
                pull = np.linalg.norm(axes * way)
                r[k, 1:] = -r[k, 0] * axes**2 * way / pull if pull > 0 else 0.0
            else:
                ball = rng.normal(size=3)
                r[k, 1:] = 0.5 * r[k, 0] * axes * ball / np.linalg.norm(ball)
            continue
        for (part, limit), moving in zip(parts, moves, strict=True):
            way = rng.normal(size=part.stop - part.start)
            way /= np.linalg.norm(way)
            r[k, part] = (
                limit[k]
                * r[k, 0]
                * way
                * (1.0 if moving else rng.choice([0.5, 1.0]) if edges else 0.5)
            )
            u[k, part] = -way * rng.uniform(0.5, 2) if moving else 0.0
    return u, r, (counts[0], counts[1], counts[2])


SPIN_LAWS = (("product", 4), ("product", 6), ("ellipsoid", 4))


def planted_spin(
    law: str,
    d: int,
    seed: int,
    nc: int = 10,
    without: bool = False,
    ratio: float = 1.0,
    edges: bool = True,
) -> tuple[fclib.LocalSpinProblem, Array]:
    """A problem with spin and its reactions.

    `without` takes the friction of one kind, or of all, from some contacts; masses differ by
    `ratio`; `edges` puts contacts on the borders between their states.
    """
    rng = np.random.default_rng(seed)
    bounds: dict[str, Any] = {"mu": rng.uniform(0.2, 0.8, nc), "mu_s": rng.uniform(0.05, 0.3, nc)}
    if d == 6:
        bounds["mu_r"] = rng.uniform(0.05, 0.3, nc)
    if without:
        for number, values in enumerate(bounds.values()):
            values[rng.uniform(size=nc) < 0.3] = 0.0
            values[number::7] = 0.0
    u, r, _ = spin_states(rng, bounds, law == "ellipsoid", edges)
    root = rng.normal(size=(nc * d, nc * d)) / np.sqrt(nc * d)
    size = np.exp(rng.uniform(0, 0.5 * np.log(ratio), nc)).repeat(d)
    W = size[:, None] * (root @ root.T + 0.5 * np.eye(nc * d)) * size
    W = (W + W.T) / 2
    problem = fclib.LocalSpinProblem(
        spacedim=d, W=W, q=u.ravel() - W @ r.ravel(), coupled=int(law == "ellipsoid"), **bounds
    )
    return problem, r.ravel()


def as_global(problem: Any) -> Any:
    """The contacts of a local problem on bodies: H = I, M = W^-1."""
    mass = np.linalg.inv(dense(problem.W))
    mass = 0.5 * (mass + mass.T)
    law = {name: getattr(problem, name, None) for name in ("mu", "mu_s", "mu_r", "coupled")}
    kind = getattr(fclib, type(problem).__name__.replace("Local", "Global"))
    return kind(
        spacedim=problem.spacedim,
        M=mass,
        H=np.eye(problem.m),
        f=mass @ problem.q,
        w=np.zeros(problem.m),
        **{name: value for name, value in law.items() if value is not None},
    )


def auto_chain() -> list[str]:
    """The stages of `auto`, a line each."""
    (text,) = (o.default for o in fclib.find_solver("auto").options if o.name == "chain")
    lines = str(text).splitlines()
    return [line for line in lines if line.strip() and not line.startswith("#")]


def last_resort(limit: int) -> list[str]:
    """The chain of `auto` whose last resort takes so many factorisations."""
    stages = [line for line in auto_chain() if "wander=true" not in line]
    return [*stages, f"proximal point : proximal_point from=associated wander=true limit={limit}"]


def local_problem(W: npt.ArrayLike, q: npt.ArrayLike, mu: npt.ArrayLike) -> fclib.LocalProblem:
    """A local problem from a dense W; its spacedim follows from the sizes."""
    q, mu = np.asarray(q, dtype=float), np.asarray(mu, dtype=float)
    d = q.size // mu.size if mu.size else 3
    return fclib.LocalProblem(spacedim=d, W=sp.csr_array(np.asarray(W, float)), q=q, mu=mu)


def ring(count: int = 3) -> fclib.GlobalProblem:
    """Walls that close on a body from all sides: no doubles make their normals cancel."""
    angles = 2 * np.pi * np.arange(count) / count + 0.1
    frames = [np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in angles]
    w = np.zeros(2 * count)
    w[::2] = -1
    return fclib.GlobalProblem(
        spacedim=2, M=np.eye(2), H=np.hstack(frames), f=[0.3, -0.2], w=w, mu=np.full(count, 0.5)
    )


def script(path: str) -> ModuleType:
    """A script of this repository, as a module."""
    place = Path(__file__).parents[1] / path
    spec = importlib.util.spec_from_file_location(place.stem, place)
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    sys.modules[place.stem] = found  # dataclasses look for it there
    spec.loader.exec_module(found)
    return found


def git(*words: str) -> str:
    """What git says of this repository; nothing where there is no git, or where it refuses."""
    root = Path(__file__).parents[1]
    try:
        done = subprocess.run(["git", "-C", str(root), *words], capture_output=True, text=True)
    except FileNotFoundError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def dense(a: Any) -> Array:
    """Any matrix as a dense array."""
    return np.asarray(a.toarray() if sp.issparse(a) else a, dtype=float)


# ---- solves and programs


def converged(*arguments: Any, **options: Any) -> fclib.Result:
    """What `fclib.solve` returns, which must be a solution."""
    result = fclib.solve(*arguments, **options)
    assert (result.status, result.converged) == ("converged", True), result.error
    return result


def ran(
    *command: object, code: int | None = 0, **settings: Any
) -> subprocess.CompletedProcess[str]:
    """A program that has ended with this code, or with any, and what it said."""
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, **settings)
    assert code in (None, done.returncode), done.stdout + done.stderr
    return done
