"""What a file and a catalogue say of who may use the data, and how to name them."""

from __future__ import annotations

import functools
import json
from typing import Any

from fclib import _core
from fclib.collections.plan import Plan, families

LICENSE = "CC-BY-4.0"  # of the data; the software has another
CITATION = (
    "V. Acary, M. Bremond, T. Koziara, F. Perignon, FCLIB: a collection of discrete 3D Frictional"
    " Contact problems, Inria RT-0444, 2014; set {set}, version {version}"
)


@functools.cache
def is_ours(scene: str) -> bool:
    """Whether a scene has the name of a family."""
    return scene in families()


def of(plan: Plan) -> dict[str, str | None]:
    """License and citation of a plan's problems; nothing is said of a scene that is not ours."""
    if not is_ours(plan.scene.name):
        return {"license": None, "citation": None}
    citation = CITATION.format(set=plan.collection, version=plan.version)
    return {"license": LICENSE, "citation": citation}


def stamped(info: _core.ProblemInfo, plan: Plan, number: int, facts: str = "") -> _core.ProblemInfo:
    """The info with all of it in the JSON that ends its description, and the problem's name.

    The facts are what is known of existence and uniqueness, after what the family says of them.
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
