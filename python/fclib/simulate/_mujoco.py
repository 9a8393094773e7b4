"""MuJoCo, in the one version that reproduces the collection.

Contact points, their order and their frames change between versions of MuJoCo, so problems are
equal bit for bit only with the version pinned here. Its soft contact solver is not used.
"""

from __future__ import annotations

import importlib
import logging
from typing import Any

VERSION = "4.0.0"


def load() -> Any:
    """The module `mujoco`. If it is not version 4.0.0, an ImportError says what to install."""
    remedy = "install it with: pip install 'fclib[simulate]' (Python 3.11 or later)"
    try:
        mujoco = importlib.import_module("mujoco")
    except ImportError as error:
        raise ImportError(
            f"fclib.simulate needs MuJoCo {VERSION}, which cannot be imported ({error}); {remedy}"
        ) from error
    found = getattr(mujoco, "__version__", "of unknown version")
    if found != VERSION:
        raise ImportError(f"fclib.simulate needs MuJoCo {VERSION}, found {found}; {remedy}")
    if mujoco.get_mju_user_warning() is None:
        # without a handler MuJoCo writes its warnings to MUJOCO_LOG.TXT in the current folder
        mujoco.set_mju_user_warning(logging.getLogger(__package__).warning)
    return mujoco


mujoco: Any = load()
