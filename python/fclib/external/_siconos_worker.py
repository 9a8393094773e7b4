"""Runs solvers of Siconos for fclib.external.siconos, in an interpreter that has siconos.numerics.

Knows nothing of fclib. It reads a line of JSON and writes a line of JSON; what Siconos prints is
dropped.
"""

import ctypes
import json
import os
import signal
import sys
import time
from typing import Any

del sys.path[0]  # the folder of this file, which has modules of the same names as packages

KINDS = {
    "fc2d": ("frictionContact_new_from_filename", "fc2d_driver"),
    "fc3d": ("frictionContact_new_from_filename", "fc3d_driver"),
    "rolling_fc2d": ("rollingFrictionContact_new_from_filename", "rolling_fc2d_driver"),
    "rolling_fc3d": ("rollingFrictionContact_new_from_filename", "rolling_fc3d_driver"),
}

# [s] If a process has a limit of CPU time, Linux counts its CPU time in ticks, of 10 ms at most.
COARSE = 0.02


ENOUGH = 0.01  # [s] A solve is not called again if the calls took so long.


def solve(sn: Any, np: Any, order: Any) -> Any:
    """One solve; the time is only that of the driver, the least of the calls."""
    read, driver = (getattr(sn, name) for name in KINDS[order["kind"]])
    problem = read(order["path"])
    options = sn.SolverOptions(getattr(sn, order["solver"]))
    if order["one_contact"]:
        sn.solver_options_update_internal(options, 0, getattr(sn, order["one_contact"]))
    options.iparam[0] = order["max_iterations"]
    options.dparam[0] = order["tolerance"]
    least, spent = float("inf"), 0.0
    for _ in range(order["calls"]):
        r = np.array(order["r"], dtype=float)
        u = np.zeros(r.size)
        start = time.process_time(), time.thread_time()
        answer = driver(problem, r, u, options)
        whole, own = time.process_time() - start[0], time.thread_time() - start[1]
        taken = whole if whole - own > COARSE else own  # clearly more: other threads worked
        least, spent = min(least, taken), spent + taken
        if spent > ENOUGH:
            break
    info = answer[0] if isinstance(answer, (tuple, list)) else answer
    return {
        "info": int(info),
        "iterations": int(options.iparam[1]),
        "cpu_s": least,
        "r": r.tolist(),
        "u": u.tolist(),
    }


def main() -> None:
    """Answer until the input ends."""
    # it ends together with the process that started it, however that ends
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)
    replies = os.fdopen(os.dup(1), "w")
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    import numpy as np
    import siconos.numerics as sn

    replies.write("ready\n")
    replies.flush()
    for line in sys.stdin:
        try:
            reply = solve(sn, np, json.loads(line))
        except Exception as error:
            reply = {"failure": f"{type(error).__name__}: {error}"}
        replies.write(json.dumps(reply) + "\n")
        replies.flush()


main()
