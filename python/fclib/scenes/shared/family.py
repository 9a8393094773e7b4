"""The base of families, and their products: scenes to simulate, or problems made directly."""

from __future__ import annotations

import hashlib
import importlib
import json
import os
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar, Literal, Protocol
from xml.etree import ElementTree
from xml.sax.saxutils import escape, quoteattr

from fclib import _core
from fclib._regular import regular
from fclib.scenes.shared import mjcf, siconos_input, siconos_scene
from fclib.scenes.shared.interaction import Drive, Interaction
from fclib.scenes.shared.solids import Solids

Law = Literal["velocity", "gap"]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A mechanical scene, ready to be simulated: its contents, and its time stepping.

    In an MJCF model a keyframe gives the initial positions, velocities and controls: the one that
    the scene names, or the first of ``start``, ``home`` and ``stand`` that exists; without one the
    scene starts at rest in the positions of the model. Keyframes whose names begin with ``gait``
    give controls at times, from 0 on, which repeat after the last.

    A problem of a scene can be made again from these fields alone.
    """

    name: str
    xml: str = ""  # MJCF text, or
    solids: Solids | None = None  # elastic blocks; neither: another engine made the states
    time_step: float | None = None  # h [s]; None: the one of the MJCF file
    restitution: float = 0.0  # Newton's coefficient e, in [0, 1]
    law: Law = "velocity"  # unilateral law, see `fclib.simulate.MoreauJean`
    activation: float = 0.0  # [m], of the velocity law, see `fclib.simulate.MoreauJean`
    allowance: bool = True  # velocity law: gaps that rounding explains count as closed
    begin: float = 0.0  # [s], start of the steps that count; earlier steps only lead to a state
    theta: float = 1.0  # of the theta scheme, in [1/2, 1]
    # whether the derivative of gyroscopic terms is part of M, which is then not symmetric
    gyroscopic: bool = False
    all_bodies: bool = False  # whether problems also have the bodies that nothing touches
    # parameters of the family, in JSON's types
    parameters: Mapping[str, Any] = field(default_factory=dict)
    seed: int | None = None
    title: str = ""
    description: str = ""
    application: str = ""  # field of application
    authors: str = ""  # authors of the original
    friction: str = ""  # the law of friction, in words
    # part shown in a picture: centre and radius [m]; None: all that moves
    focus: tuple[float, float, float, float] | None = None
    # direction of view: azimuth and elevation [deg]; None: as all others
    view: tuple[float, float] | None = None
    keyframe: str | None = None  # of the MJCF, its start; None: start, home or stand
    ground: float | None = None  # mu of a plane below all at the start; None: there is none
    planar: bool = False  # moves in a plane y = const, contacts have two components
    # features of the MJCF left out on purpose, for example limits, frictionloss
    ignore: tuple[str, ...] = ()
    # periods along x and y [m], with only free bodies; None: not periodic
    period: tuple[float, float] | None = None
    # by the law of gaps: which kinds of shapes meet, each pair by its own law; empty: all. The kind
    # of a geometry is its first user value
    interactions: tuple[Interaction, ...] = ()
    drives: tuple[Drive, ...] = ()  # velocities and forces that are given
    left_out: tuple[str, ...] = ()  # what its source asks for and it lacks, one line each
    path: Path | None = None  # path of the MJCF file, if it refers to meshes beside it
    includes: Mapping[str, str] = field(default_factory=dict)  # texts of MJCF files in it, by path

    @classmethod
    def of(cls, family: Any, seed: int, xml: str = "", **more: Any) -> Scene:
        """The scene of a family: its parameters and its facts."""
        return cls(
            name=type(family).__name__,
            xml=xml,
            time_step=family.time_step,
            restitution=family.restitution,
            activation=getattr(family, "activation", 0.0),
            allowance=getattr(family, "allowance", True),
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
    def of_bodies(cls, family: Any, seed: int, **more: Any) -> Scene:
        """The scene of a family of bodies above a floor, with its gravity and friction.

        Args:
            family: the family.
            seed: of what is random.
            more: fields of the scene, and what `mjcf.document` takes.
        """
        fields_of_scene = {one.name for one in fields(cls)}
        words = {key: more.pop(key) for key in [*more] if key not in fields_of_scene}
        words |= {"time_step": family.time_step, "gravity": family.gravity, "floor_mu": family.mu}
        return cls.of(family, seed, mjcf.document(type(family).__name__, **words), **more)

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
        activation: float = 0.0,
        floating: bool = False,
        ground: float | None = None,
        friction: float | None = None,
    ) -> Scene:
        """The scene of an MJCF file, a URDF file, or of Siconos: an input.dat or mechanics' HDF5.

        Its parameters hold the SHA-256 of the file and of all files to which it refers.

        Args:
            path: path of the file.
            time_step: h [s]; None: that of the file. Siconos' files do not have it.
            restitution: Newton's coefficient e, of files that do not have it.
            law: the unilateral law.
            planar: whether it moves in the plane x, z.
            keyframe: name of the keyframe of its start; None: start, home or stand, if there is
                one.
            packages: folders of the names in package://NAME/... of a URDF file.
            ignore: features that are left out.
            activation: [m] of the velocity law, see `fclib.simulate.MoreauJean`.
            floating: whether the root of a URDF file moves freely; else it is welded to the world.
            ground: coefficient of friction of a plane below all at the start; None: no plane.
            friction: that of all bodies of an input.dat, which does not have it.

        Raises:
            OSError: the file cannot be read.
            ValueError: a package is not known, or nothing can float; or a file of Siconos is wrong,
                or lacks its time step or friction.
            ImportError: it refers to files, and MuJoCo is missing; or h5py is, for a file of HDF5.
        """
        path = regular(path)
        if path.suffix == siconos_input.SUFFIX:
            return cls._of_siconos(path, time_step, friction, restitution, law, activation)
        if friction is not None:
            raise ValueError(f"{path.name} has its own friction; friction= is for an input.dat")
        if siconos_scene.is_one(path):
            return cls._of_mechanics(path, time_step, restitution, law, activation)
        xml = path.read_text(encoding="utf-8")
        digest = hashlib.sha256(xml.encode()).hexdigest()
        resolved = resolve_packages(path, xml, packages or {})
        files, includes = references_of(path, resolved)
        return cls(
            name=path.stem,
            xml=floated(path.name, resolved) if floating else resolved,
            time_step=time_step,
            restitution=restitution,
            law=law,
            planar=planar,
            keyframe=keyframe,
            parameters={
                "file": path.name,
                "sha256": digest,
                **({"files": files} if files else {}),
                **({"floating": True} if floating else {}),
                **({} if ground is None else {"ground": ground}),
            },
            title=path.stem,
            description=f"Problems of the scene {path.name}.",
            ignore=tuple(ignore),
            activation=activation,
            ground=ground,
            # if packages were resolved, the text tells all
            path=path if resolved == xml else None,
            includes=includes,
        )

    @classmethod
    def _of_siconos(
        cls,
        path: Path,
        time_step: float | None,
        friction: float | None,
        restitution: float,
        law: Law,
        activation: float,
    ) -> Scene:
        """The scene of an input.dat."""
        for value, name in ((time_step, "time step"), (friction, "friction")):
            if value is None:
                raise ValueError(f"{path}: does not have the {name}, which must be given")
        assert time_step is not None
        assert friction is not None
        xml = siconos_input.mjcf_of(path, friction, time_step, siconos_input.GRAVITY)
        folder = path.resolve().parent
        files = {
            os.path.relpath(file.resolve(), folder): digest_of(file)
            for file in siconos_input.files_of(path)
        }
        return cls(
            name=folder.name,
            xml=xml,
            time_step=time_step,
            restitution=restitution,
            law=law,
            activation=activation,
            parameters={
                "file": path.name,
                "sha256": digest_of(path),
                "files": files,
                "friction": friction,
            },
            title=folder.name,
            description=f"Problems of the scene {folder.name}/{path.name} of Siconos.",
        )

    @classmethod
    def _of_mechanics(
        cls, path: Path, time_step: float | None, restitution: float, law: Law, activation: float
    ) -> Scene:
        """The scene of a file of Siconos' mechanics."""
        if time_step is None:
            raise ValueError(f"{path}: does not have the time step, which must be given")
        if restitution:
            raise ValueError(f"{path}: has its own restitution; restitution= is for other files")
        found = siconos_scene.read(path, time_step, siconos_input.GRAVITY)
        return cls(
            name=path.stem,
            xml=found.xml,
            time_step=time_step,
            restitution=found.restitution,
            law=law,
            activation=activation,
            parameters={"file": path.name, "sha256": digest_of(path)},
            title=path.stem,
            description=f"Problems of the scene {path.name} of Siconos' mechanics.",
        )


def digest_of(path: Path) -> str:
    """The SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def references_of(path: Path, xml: str) -> tuple[dict[str, str], dict[str, str]]:
    """SHA-256 of the files that a model refers to, and the texts of the MJCF among them.

    Both by their paths from the model's folder. The compiler reports missing files.
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
        except (ValueError, module.FatalError):  # bad MJCF: the compiler reports it better
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


def resolve_packages(path: Path, xml: str, packages: Mapping[str, str | Path]) -> str:
    """A URDF text with the folders of its package://NAME/... in their places.

    A folder is known from the argument, is one of ROS_PACKAGE_PATH, or is found as the file's own
    package is: above the file, or beside a folder above it. ValueError if none is known.
    """
    xml = xml.replace("package:///", "package://")
    asked = sorted(set(re.findall(r"package://([^/\"'<>]+)", xml)))
    if not asked:
        return xml
    roots = [Path(root) for root in os.environ.get("ROS_PACKAGE_PATH", "").split(":") if root]
    roots += path.resolve().parents
    for package in asked:
        folders = [Path(packages[package])] if package in packages else []
        folders += [root / package for root in roots]
        found = next((folder for folder in folders if folder.is_dir()), None)
        if found is None:
            raise ValueError(
                f"{path.name}: no folder is known for package://{package}; name it with --package"
                f" {package}=DIR (packages= in Python), or set ROS_PACKAGE_PATH"
            )
        xml = xml.replace(f"package://{package}/", f"{found.resolve()}/")
    if "<mujoco" not in xml:
        # MuJoCo drops folders from the names of a URDF file's meshes unless an option forbids it
        xml = re.sub(
            r"(<robot\b[^>]*>)", r'\1<mujoco><compiler strippath="false"/></mujoco>', xml, count=1
        )
    return xml


def floated(name: str, xml: str) -> str:
    """A URDF text whose root moves freely. ValueError: it is not URDF, or its root is the world."""
    try:
        robot = ElementTree.fromstring(with_prefixes(xml).encode())
    except ElementTree.ParseError as error:
        raise ValueError(f"{name}: is no XML: {error}") from None
    if robot.tag != "robot":
        raise ValueError(
            f"{name}: floating is for URDF files; in an MJCF file write <freejoint/> into the body"
        )
    children = {child.get("link") for child in robot.iterfind("joint/child")}
    roots = [link.get("name") for link in robot.iterfind("link")]
    roots = [root for root in roots if root not in children]
    if len(roots) != 1 or roots[0] is None:
        raise ValueError(f"{name}: has {len(roots)} links that are no child of a joint, not one")
    if roots[0] == "world":
        raise ValueError(
            f'{name}: its root is the link "world", to which a joint ties the rest: make that'
            ' joint type="floating" in the file'
        )
    joint = (
        f'<link name="world"/><joint name="world to {escape(roots[0])}" type="floating">'
        f'<parent link="world"/><child link={quoteattr(roots[0])}/></joint>'
    )
    return re.sub(r"(<robot\b[^>]*>)", lambda found: found[0] + joint, xml, count=1)


def with_prefixes(xml: str) -> str:
    """A URDF text whose root names all prefixes of tags: tools of ROS leave some out."""
    used = set(re.findall(r"[</\s]([A-Za-z_][\w.-]*):[A-Za-z_]", xml)) - {"xml", "xmlns"}
    unknown = [prefix for prefix in sorted(used) if f"xmlns:{prefix}" not in xml]
    words = "".join(f' xmlns:{prefix}="{prefix}"' for prefix in unknown)
    return re.sub(r"<robot\b", lambda found: found[0] + words, xml, count=1)


@dataclass(frozen=True, kw_only=True)
class Assembled:
    """The problems of a family that are assembled from its parameters, without a simulation."""

    family: Assembly
    seed: int

    @property
    def name(self) -> str:
        """The name of the family."""
        return type(self.family).__name__

    @property
    def title(self) -> str:
        """The title of the family."""
        return self.family.title

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters of the family."""
        return asdict(self.family)

    def problem(self, number: int) -> Any:
        """Problem 0, 1, ...; the last line of its description is JSON and tells its origin.

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
            # the facts of one problem, as JSON
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
    """The units of a problem of bodies, from its file; SI if it has none."""
    length = problem.bodies.unit if problem.bodies is not None else ""
    mass = problem.bodies.mass_unit if problem.bodies is not None else ""
    return {"length": length or "m", "mass": mass or "kg", "time": "s"}


class Described(Protocol):
    """The base of every family: a frozen dataclass whose fields, all with defaults, are its
    parameters.
    """

    title: ClassVar[str]
    description: ClassVar[str]
    application: ClassVar[str]  # field of application
    authors: ClassVar[str]  # of the original family
    friction: ClassVar[str]  # the law of friction, in words
    collection: ClassVar[str]  # the set that it belongs to
    problems: ClassVar[int]  # number of problems in the set; for a scene, steps with contact
    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __init__(self, **parameters: Any) -> None: ...


class Assembly(Described, Protocol):
    """A family that makes its problems directly."""

    def problem(self, number: int, seed: int = 0) -> Any:
        """Problem `number`; the same number and seed give the same data, bit for bit.

        The title of its info identifies it in the family.
        """
        ...


class Family(Described, Protocol):
    """A family that makes scenes. Among its parameters are `restitution` and `time_step` [s].

    If it has parameters `activation` [m], `begin` [s], `gyroscopic` and `all_bodies`, they are
    those of its scenes.
    A family whose published states were simulated without sets `allowance` to False.

    If the default scene takes long, `small` holds parameters of a quick one of the kind.
    """

    restitution: float
    time_step: float

    def scene(self, seed: int = 0) -> Scene:
        """The scene of these parameters; the same seed gives the same scene, bit for bit."""
        ...


class Published:
    """What most families have in common whose states are published; one may say otherwise."""

    authors: ClassVar[str] = "the authors of FCLIB"
    friction: ClassVar[str] = "Coulomb, the same coefficient everywhere"
    allowance: ClassVar[bool] = False  # their published states have none


def parameter(default: Any, unit: str, doc: str) -> Any:
    """A dataclass field that carries its unit ("1" if it has none) and its meaning."""
    return field(default=default, metadata={"unit": unit, "doc": doc})
