"""What a family is, and what it makes: a scene to simulate, or problems assembled directly."""

from __future__ import annotations

import hashlib
import importlib
import json
import os
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal, Protocol

from fclib import _core
from fclib.scenes.shared.solids import Solids

Law = Literal["velocity", "gap"]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A mechanical scene, ready to be simulated: what is in it, and how to step it.

    In an MJCF model a keyframe gives the initial positions, velocities and controls: the one that
    the scene names, or the first of ``start``, ``home`` and ``stand`` that is there; without one
    the scene starts at rest in the positions of the model. Keyframes whose
    names begin with ``gait`` give controls at times, from 0 on, which repeat after the last.

    To solve a problem of a scene again, one needs what is here and nothing else.
    """

    name: str
    xml: str = ""  # MJCF text, or
    solids: Solids | None = None  # elastic blocks
    time_step: float | None = None  # h [s]; None: the one of the MJCF file
    restitution: float = 0.0  # Newton's coefficient e, in [0, 1]
    law: Law = "velocity"  # unilateral law, see `fclib.simulate.MoreauJean`
    activation: float = 0.0  # [m], of the velocity law, see `fclib.simulate.MoreauJean`
    begin: float = 0.0  # [s], of the steps that count: those before only lead to a state
    theta: float = 1.0  # of the theta scheme, in [1/2, 1]
    gyroscopic: bool = False  # their derivative is part of M, which is then not symmetric
    all_bodies: bool = False  # its problems have those that nothing touches too
    parameters: Mapping[str, Any] = field(default_factory=dict)  # of the family, JSON types
    seed: int | None = None
    title: str = ""
    description: str = ""
    application: str = ""  # field of application
    authors: str = ""  # of the original
    friction: str = ""  # the law of friction, in words
    # what a picture shows: centre and radius [m]; None: all that moves
    focus: tuple[float, float, float, float] | None = None
    # where it is seen from: azimuth and elevation [deg]; None: as all others
    view: tuple[float, float] | None = None
    keyframe: str | None = None  # of the MJCF, where it starts; None: start, home or stand
    planar: bool = False  # moves in a plane y = const, contacts have two components
    ignore: tuple[str, ...] = ()  # features of the MJCF left out knowingly: limits, frictionloss
    # the scene repeats itself along x and y, its bodies all free ones [m]; None: it does not
    period: tuple[float, float] | None = None
    path: Path | None = None  # where the MJCF file lies, if it refers to meshes beside it
    includes: Mapping[str, str] = field(default_factory=dict)  # texts of MJCF files in it, by path

    @classmethod
    def of(cls, family: Any, seed: int, xml: str = "", **more: Any) -> Scene:
        """The scene of a family: its parameters and all that it says of itself."""
        return cls(
            name=type(family).__name__,
            xml=xml,
            time_step=family.time_step,
            restitution=family.restitution,
            activation=getattr(family, "activation", 0.0),
            begin=getattr(family, "begin", 0.0),
            gyroscopic=getattr(family, "gyroscopic", False),
            all_bodies=getattr(family, "all_bodies", False),
            parameters=asdict(family),
            seed=seed,
            title=family.title,
            description=family.description,
            application=family.application,
            authors=family.authors,
            friction=family.friction,
            **more,
        )

    @classmethod
    def from_file(
        cls,
        path: str | Path,
        *,
        time_step: float | None = None,
        restitution: float = 0.0,
        law: Law = "velocity",
        planar: bool = False,
        keyframe: str | None = None,
        packages: Mapping[str, str | Path] | None = None,
        ignore: tuple[str, ...] = (),
    ) -> Scene:
        """The scene of an MJCF file, or of a URDF file. OSError where it cannot be read.

        Its parameters hold the SHA-256 of the file and of all that it refers to.

        Args:
            path: of the file.
            time_step: h [s]; None: that of the file.
            restitution: Newton's coefficient e.
            law: the unilateral law.
            planar: whether it moves in the plane x, z.
            keyframe: where it starts, by name; None: start, home or stand where there is one.
            packages: folders of the names in package://NAME/... of a URDF file.
            ignore: features that are left out.

        Raises:
            OSError: it cannot be read.
            ValueError: a package is not known.
            ImportError: it refers to files, and MuJoCo is missing.
        """
        path = Path(path)
        xml = path.read_text(encoding="utf-8")
        digest = hashlib.sha256(xml.encode()).hexdigest()
        resolved = resolve_packages(path.name, xml, packages or {})
        files, includes = references_of(path, resolved)
        return cls(
            name=path.stem,
            xml=resolved,
            time_step=time_step,
            restitution=restitution,
            law=law,
            planar=planar,
            keyframe=keyframe,
            parameters={"file": path.name, "sha256": digest, **({"files": files} if files else {})},
            title=path.stem,
            description=f"Problems of the scene {path.name}.",
            ignore=tuple(ignore),
            # the text tells all where packages were resolved
            path=path if resolved == xml else None,
            includes=includes,
        )


def references_of(path: Path, xml: str) -> tuple[dict[str, str], dict[str, str]]:
    """SHA-256 of the files that a model refers to, and the texts of the MJCF among them.

    Both by their paths from the model's folder. What is not there is left to the compiler to name.
    """
    if "file=" not in xml and "filename=" not in xml:
        return {}, {}
    folder = path.resolve().parent
    if "<mujoco" in xml and "<robot" not in xml:
        try:
            module: Any = importlib.import_module("mujoco")
        except ImportError as error:
            raise ImportError(
                f"{path.name} refers to files, which MuJoCo finds; it cannot be imported ({error});"
                " install it with: pip install 'fclib[simulate]' (Python 3.11 or later)"
            ) from error
        try:
            names = module.mju_getXMLDependencies(str(path.resolve()))
        except (ValueError, module.FatalError):  # bad MJCF, which the compiler says better
            return {}, {}
    else:
        names = re.findall(r"""filename=["']([^"']+)""", xml)
    hashes, texts = {}, {}
    for found in sorted({(folder / name).resolve() for name in names} - {path.resolve()}):
        if not found.is_file():
            continue
        content, name = found.read_bytes(), os.path.relpath(found, folder)
        hashes[name] = hashlib.sha256(content).hexdigest()
        if found.suffix == ".xml":
            texts[name] = content.decode()
    return hashes, texts


def resolve_packages(name: str, xml: str, packages: Mapping[str, str | Path]) -> str:
    """A URDF text with the folders of its package://NAME/... in their places.

    ValueError where one is not known: by the argument, or as a folder of ROS_PACKAGE_PATH.
    """
    asked = sorted(set(re.findall(r"package://([^/\"'<>]+)", xml)))
    if not asked:
        return xml
    roots = [Path(root) for root in os.environ.get("ROS_PACKAGE_PATH", "").split(":") if root]
    for package in asked:
        folders = [Path(packages[package])] if package in packages else []
        folders += [root / package for root in roots]
        found = next((folder for folder in folders if folder.is_dir()), None)
        if found is None:
            raise ValueError(
                f"{name}: no folder is known for package://{package}; name it with --package"
                f" {package}=DIR (packages= in Python), or set ROS_PACKAGE_PATH"
            )
        xml = xml.replace(f"package://{package}/", f"{found.resolve()}/")
    if "<mujoco" not in xml:
        # MuJoCo drops folders from the names of a URDF file's meshes unless it is told not to
        xml = re.sub(
            r"(<robot\b[^>]*>)", r'\1<mujoco><compiler strippath="false"/></mujoco>', xml, count=1
        )
    return xml


@dataclass(frozen=True, kw_only=True)
class Assembled:
    """The problems of a family that are assembled from its parameters, without a simulation."""

    family: Assembly
    seed: int

    @property
    def name(self) -> str:
        """Of the family."""
        return type(self.family).__name__

    @property
    def title(self) -> str:
        """Of the family."""
        return self.family.title

    @property
    def parameters(self) -> dict[str, Any]:
        """Of the family."""
        return asdict(self.family)

    def problem(self, number: int) -> Any:
        """Problem 0, 1, ...; the last line of its description is JSON and says where it is from.

        Raises:
            ValueError: the number is negative, or there are not so many problems.
        """
        family = self.family
        if not 0 <= number < family.problems:
            raise ValueError(f"{self.name} has problems 0 to {family.problems - 1}, not {number}")
        problem = family.problem(number, self.seed)
        origin = {
            "generator": "fclib.scenes",
            "fclib": _core.version,
            "scene": self.name,
            "parameters": self.parameters,
            "seed": self.seed,
            "step": number,
            "units": units_of(problem),
            # what a family says of one problem, as JSON
            **json.loads(problem.info.description or "{}"),
        }
        words = [
            family.description,
            f"Field of application: {family.application}.",
            f"Friction: {family.friction}.",
            json.dumps(origin, default=str),
        ]
        info = _core.ProblemInfo(
            title=f"{family.title}, {problem.info.title}",
            description="\n".join(words),
            math_info=problem.info.math_info,
        )
        return problem.replace(info=info)


def units_of(problem: Any) -> dict[str, str]:
    """The units of a problem of bodies, as its file says them; SI elsewhere."""
    length = problem.bodies.unit if problem.bodies is not None else ""
    mass = problem.bodies.mass_unit if problem.bodies is not None else ""
    return {"length": length or "m", "mass": mass or "kg", "time": "s"}


class Described(Protocol):
    """What every family says of itself: a frozen dataclass whose fields, all with defaults, are its
    parameters.
    """

    title: ClassVar[str]
    description: ClassVar[str]
    application: ClassVar[str]  # field of application
    authors: ClassVar[str]  # of the original family
    friction: ClassVar[str]  # the law of friction, in words
    collection: ClassVar[str]  # the set that it belongs to
    problems: ClassVar[int]  # that the set takes; of a scene, steps with contact
    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __init__(self, **parameters: Any) -> None: ...


class Assembly(Described, Protocol):
    """A family that makes its problems directly."""

    def problem(self, number: int, seed: int = 0) -> Any:
        """Problem `number`; the same number and seed give the same data, bit for bit.

        The title of its info tells it from the others of the family.
        """
        ...


class Family(Described, Protocol):
    """A family that makes scenes. Among its parameters are `restitution` and `time_step` [s].

    Where it has parameters `activation` [m], `begin` [s], `gyroscopic` and `all_bodies`, they are
    those of its scenes.

    Where the default scene takes long, `small` holds parameters of a quick one of the kind.
    """

    restitution: float
    time_step: float

    def scene(self, seed: int = 0) -> Scene:
        """The scene of these parameters; the same seed gives the same scene, bit for bit."""
        ...


def parameter(default: Any, unit: str, doc: str) -> Any:
    """A dataclass field that carries its unit ("1" where it has none) and its meaning."""
    return field(default=default, metadata={"unit": unit, "doc": doc})
