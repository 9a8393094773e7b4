"""scikit-fem, in the one version that reproduces the deformable families.

It is loaded when a deformable model is made, and by nothing else.
"""

from __future__ import annotations

import importlib
from typing import Any

VERSION = "12.0.2"


def load() -> Any:
    """The module `skfem`. ImportError, with what to install, where it is not this version."""
    remedy = f"install it with: pip install scikit-fem=={VERSION}"
    try:
        skfem = importlib.import_module("skfem")
    except ImportError as error:
        raise ImportError(
            f"deformable scenes need scikit-fem {VERSION}, which cannot be imported ({error});"
            f" {remedy}"
        ) from error
    found = getattr(skfem, "__version__", "of unknown version")
    if found != VERSION:
        raise ImportError(f"deformable scenes need scikit-fem {VERSION}, found {found}; {remedy}")
    return skfem
