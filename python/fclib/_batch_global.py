"""Many small global problems in one call: M v = H r + f, as simulators hold them."""

from __future__ import annotations

from typing import Any

import numpy as np

from fclib import _core
from fclib._batch import BatchResult, Law, check_contacts, flat, floats, run, shaped
from fclib._solve import check_limits


def solve_batch_global(
    M: Any,
    H: Any,
    f: Any,
    mu: Any,
    *,
    w: Any = None,
    spacedim: int = 3,
    mu_r: Any = None,
    mu_s: Any = None,
    coupled: bool = False,
    guess: Any = None,
    tol: float = 1e-8,
    threads: int = 1,
    time_limit: float | None = None,
) -> BatchResult:
    """Solve many global problems, M v = H r + f and u = H^T v + w with one law.

    H is the transpose of the contacts' Jacobian: a simulator's J (count, m, n) is given as
    ``J.swapaxes(1, 2)``, which copies nothing. W is made in the core. Bodies that no contact
    connects are solved apart from each other. All else is as in ``fclib.solve_batch``.

    Args:
        M: (count, n, n) mass matrices; or a list of matrices of any sizes, and lists below.
        H: (count, n, m), m = spacedim * nc.
        f: (count, n) impulses.
        mu: (count, nc) coefficients of friction, or anything that NumPy broadcasts to it. Of lists,
            a list or a number.
        w: (count, m) velocities; None for zeros.
        spacedim: 3, or 2 for planar problems; 5 (3) with mu_r, 4 with mu_s, 6 with both.
        mu_r: coefficients of rolling friction [m], as mu. Then ``auto`` solves each problem.
        mu_s: coefficients of spin friction [m], likewise.
        coupled: whether sliding and spin share one limit, an ellipsoid (spacedim 4).
        guess: (count, m) reactions to start from.
        tol: bound on Merit.error of each.
        threads: number of threads that share the batch; 0: all of the machine.
        time_limit: [s] for all of them.

    Returns:
        As ``fclib.solve_batch``, with the velocities v of the bodies, in the shape of f.

    Raises:
        ProblemError: sizes that do not agree.
        OptionError: tol, threads or time_limit out of range.
    """
    law = Law(mu, mu_r, mu_s, coupled)
    law.check(spacedim)
    check_limits(tol, time_limit, threads=threads)
    given: dict[str, Any]
    if isinstance(M, (list, tuple)):
        for name, values in (("H", H), ("f", f)):
            if not isinstance(values, (list, tuple)) or len(values) != len(M):
                raise _core.ProblemError(f"{name}: is not a list of {len(M)} problems, as M is")
        masses = [floats("M", one) for one in M]
        jacobians = [floats("H", one) for one in H]
        for k, (mass, one) in enumerate(zip(masses, jacobians, strict=True)):
            if mass.ndim != 2 or mass.shape[0] != mass.shape[1]:
                raise _core.ProblemError(f"M: problem {k} has the shape {mass.shape}")
            if one.ndim != 2 or one.shape[0] != len(mass) or one.shape[1] % spacedim:
                raise _core.ProblemError(
                    f"H: problem {k} has the shape {one.shape}, expected ({len(mass)}, "
                    f"{spacedim} nc)"
                )
        n = np.array([len(mass) for mass in masses], dtype=np.int32)
        counts = check_contacts(
            np.array([one.shape[1] // spacedim for one in jacobians], dtype=np.int64)
        )
        count, each = len(masses), 0
        lengths = spacedim * counts.astype(np.int64)
        offsets = np.concatenate(([0], np.cumsum(lengths))).astype(np.int64)
        shape: tuple[int, ...] = (int(offsets[-1]),)
        empty = np.empty(0)
        given = {
            "n": n,
            "M": np.concatenate([empty, *(mass.reshape(-1) for mass in masses)]),
            "H": np.concatenate([empty, *(one.T.reshape(-1) for one in jacobians)]),
            "f": shaped("f", flat("f", f, n), (int(n.sum()),)),
        }
        if w is not None:
            given["w"] = shaped("w", flat("w", w, lengths), shape)
        friction = law.spread((int(counts.sum()),), counts)
        start = None if guess is None else shaped("guess", flat("guess", guess, lengths), shape)
        v = np.empty(int(n.sum()))
        return run(
            given, spacedim, count, each, counts, offsets, shape, friction, start, v, tol, threads,
            time_limit,
        )  # fmt: skip
    mass = floats("M", M)
    if mass.ndim != 3 or mass.shape[1] != mass.shape[2]:
        raise _core.ProblemError(f"M: has the shape {mass.shape}, expected (count, n, n)")
    count, size = mass.shape[:2]
    jacobian = floats("H", np.swapaxes(np.asarray(H), 1, 2) if np.ndim(H) == 3 else H)
    if jacobian.ndim != 3 or jacobian.shape[::2] != (count, size) or jacobian.shape[1] % spacedim:
        raise _core.ProblemError(
            f"H: has the shape {np.shape(H)}, expected ({count}, {size}, {spacedim} nc)"
        )
    m = jacobian.shape[1]
    each = m // spacedim
    given = {
        "n_each": size,
        "M": mass.reshape(-1),
        "H": jacobian.reshape(-1),
        "f": shaped("f", f, (count, size)).reshape(-1),
    }
    if w is not None:
        given["w"] = shaped("w", w, (count, m)).reshape(-1)
    friction = law.spread((count, each))
    start = None if guess is None else shaped("guess", guess, (count, m))
    return run(
        given, spacedim, count, each, None, None, (count, m), friction, start,
        np.empty((count, size)), tol, threads, time_limit,
    )  # fmt: skip
