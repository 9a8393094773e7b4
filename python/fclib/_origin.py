"""The origin of a problem: the last line of its description, in JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from fclib import _core


def origin_of(info: _core.ProblemInfo) -> Mapping[str, Any]:
    """The facts that whoever made a problem left in its description; empty if there are none."""
    lines = info.description.splitlines()
    try:
        found = json.loads(lines[-1])
    except (IndexError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}
