"""scikit-fem, in the one version that reproduces the deformable families.

Only making a deformable model loads it.
"""

from __future__ import annotations

import importlib
from typing import Any

VERSION = "12.0.2"


def load() -> Any:
    """The module `skfem`. If it is not this version, an ImportError says what to install."""
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
