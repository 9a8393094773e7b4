"""License and citation of the data, in files and catalogues."""

from __future__ import annotations

import functools
import json
from typing import Any

from fclib import _core
from fclib.collections.plan import Plan, families

LICENSE = "CC-BY-4.0"  # license of the data; the software has another
CITATION = (
    "V. Acary, M. Bremond, T. Koziara, F. Perignon, FCLIB: a collection of discrete 3D Frictional"
    " Contact problems, Inria RT-0444, 2014; set {set}, version {version}"
)


@functools.cache
def is_ours(scene: str) -> bool:
    """Whether a scene has the name of a family."""
    return scene in families()


def of(plan: Plan) -> dict[str, str | None]:
    """License and citation of a plan's problems; both are empty for a scene that is not ours."""
    if not is_ours(plan.scene.name):
        return {"license": None, "citation": None}
    citation = CITATION.format(set=plan.collection, version=plan.version)
    return {"license": LICENSE, "citation": citation}


def stamped(info: _core.ProblemInfo, plan: Plan, number: int, facts: str = "") -> _core.ProblemInfo:
    """The info; the JSON at the end of its description has these facts and the problem's name.

    The facts on existence and uniqueness come after those that the family states.
    """
    if facts:
        said = info.math_info.rstrip(". ")
        info = info.replace(math_info=f"{said}. {facts}" if said else facts)
    *words, last = info.description.split("\n")
    try:
        origin: Any = json.loads(last)
    except ValueError:
        return info
    own = {name: value for name, value in of(plan).items() if value is not None}
    known = {"collection": plan.collection, "version": plan.version, "number": number}
    text = "\n".join([*words, json.dumps(origin | known | own)])
    return info.replace(description=text)
