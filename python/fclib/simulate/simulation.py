"""From a scene to the sequence of its problems; each is solved to reach the next."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from fclib import _core, _geometry, _laws, _solve
from fclib._origin import origin_of
from fclib.scenes import Scene
from fclib.simulate import _mujoco, _skfem
from fclib.simulate.deformable import DeformableModel
from fclib.simulate.equalities import RANK, dependence, gaps_of
from fclib.simulate.geometry import places_of
from fclib.simulate.moreau_jean import (
    MOTION,
    ROUNDINGS,
    Contacts,
    MoreauJean,
    StepProblem,
    System,
    Vector,
)
from fclib.simulate.mujoco_model import MujocoModel
from fclib.simulate.mujoco_scene import refuse_unknown

Model: TypeAlias = MujocoModel | DeformableModel
# gaps that count as closed
ALLOWANCE: Final = f"{ROUNDINGS:g} roundings of a state and {MOTION:g} of the free motion"
GYROSCOPIC: Final = " M holds h theta times the derivative of gyroscopic terms;"
STABILIZATION: Final = 0.2  # share of a violation undone in a step
# relative error of an unsolved step that ends a simulation: zero reactions give as much
NONSENSE: Final = 1.0
# largest state, in quanta of stored ones: doubles hold integers up to here
LARGEST: Final = 2.0**53

# Bodies are at rest below this speed at contacts, relative to the largest without reactions. Many
# reactions hold such bodies. A solver returns any of them: those nearest to the last ones are
# taken, or else the reactions of a body at rest would change from step to step.
STILL: Final = 1e-6

Unsolved: TypeAlias = Literal["best", "stop"]


class StoppedError(FloatingPointError):
    """A simulation that cannot go on: a step was not solved, or a state is senseless."""


@dataclass(frozen=True)
class State:
    """All that a simulation needs to go on: the start of a step, and the last impulses."""

    index: int  # number of the step
    position: Vector  # q (nq)
    velocity: Vector  # v (n)
    pair: npt.NDArray[np.int64]  # (nc x 2) pairs of the last step's contacts
    frame: Vector  # (nc x 3 x 3)
    r: Vector  # (nc x d) their impulses [N s]
    # their places on their two shapes [m]
    place: Vector = field(default_factory=lambda: np.zeros((0, 2, 3)))


Control: TypeAlias = Callable[[float, State], npt.ArrayLike]


@dataclass(frozen=True)
class Step:
    """One step, from time to time + h: its problem, and the solution that gave the next state."""

    index: int  # 0, 1, ...
    time: float  # at the start of the step [s]
    problem: _laws.Global  # nc is 0 if nothing touches
    result: _core.Result  # its status tells whether the solver reached the tolerance
    velocity: Vector  # v (n) of the whole system after the step
    # (n') the degrees of freedom in the problem: those that contacts move
    dofs: npt.NDArray[np.int64]
    contacts: Contacts  # nc, the active ones, at the start of the step
    position: Vector  # q (nq) at the start of the step
    start: State  # from which `simulate` does this step again, and goes on
    model: Model  # shared by all steps


def simulate(
    scene: Scene,
    steps: int,
    *,
    solver: str = "auto",
    tol: float = 1e-8,
    warm_start: bool = True,
    stabilization: float = STABILIZATION,
    start: State | None = None,
    control: Control | None = None,
    strict: bool = False,
    unsolved: Unsolved = "best",
    **options: Any,
) -> Iterator[Step]:
    """Yield the steps of a scene, as they are computed.

    steps          number of steps
    start          the state to begin with: the `start` of an earlier step gives the same steps, bit
                   for bit; by default the scene's own start
    solver, tol    as in `fclib.solve`, with its further options
    warm_start     begin from the impulses that contacts of the same shapes and place had before
    stabilization  share of a penetration (gap law) or of a bilateral violation undone in a step

    control        called at the start of each step with the time [s] and the state there; returns
                   the controls of the actuators (nu). By default those of the scene
    strict         refuse a scene with unsupported features; by default they are left out, and named
                   by `step.model.left_out` and each problem's description

    unsolved       reaction to a step whose solver misses the tolerance: "best" goes on with the
                   best solution found. `step.result` tells so, and later problems depend on it.
                   "stop" ends the simulation there

    The tolerance bounds both errors of the merit, as in `fclib.solve`. With merit="natural" among
    the options it bounds only that of the natural map.

    Raises at once ValueError (bad MJCF, bad parameters), UnsupportedSceneError, and ImportError
    if a deformable scene lacks scikit-fem in the pinned version; while stepping, what `fclib.solve`
    raises, and StoppedError, a FloatingPointError, if the simulation cannot go on: a step is not
    solved that must be, the error of one is as large as that of no reactions (NONSENSE) and no
    rounding of its velocities (STILL), or a state is not finite or too large to be stored.
    """
    if steps < 0:
        raise ValueError(f"the number of steps must be >= 0, not {steps}")
    if unsolved not in get_args(Unsolved):
        raise ValueError(f'unsolved is "best" or "stop", not {unsolved!r}')
    model = model_of(scene, strict=strict)
    scheme = scheme_of(model, stabilization)
    if control is not None:
        if not isinstance(model, MujocoModel) or not model.model.nu:
            raise ValueError(f"{scene.name}: takes no controls, it has no actuators")
        if model.has_gait:
            raise ValueError(f"{scene.name}: takes no controls, its keyframes gait... give them")
        model.controlled = True
    settings = {"solver": solver, "tol": tol, "warm_start": warm_start, "options": options}
    if start is not None:
        model.set_state(start.position, start.velocity)
    return _march(model, scheme, steps, settings, start, control, stop=unsolved == "stop")


def model_of(scene: Scene, *, strict: bool = False) -> Model:
    """The model of a scene, at its start; raises as `simulate` does."""
    if scene.solids is None:
        return MujocoModel(scene, strict=strict)
    if strict:
        refuse_unknown(scene, scene.left_out)
    return DeformableModel(scene)


def scheme_of(model: Model, stabilization: float = STABILIZATION) -> MoreauJean:
    """The time stepping scheme of a model's scene. ValueError if a parameter is senseless."""
    scene = model.scene
    return MoreauJean(
        h=model.time_step,
        restitution=scene.restitution,
        law=scene.law,
        stabilization=stabilization,
        theta=scene.theta,
        activation=scene.activation,
        allowance=scene.allowance,
        all_bodies=scene.all_bodies,
        interactions=scene.interactions,
    )


def problem_at(
    model: Model,
    scheme: MoreauJean,
    position: Vector,
    velocity: Vector,
    info: _core.ProblemInfo | None = None,
) -> StepProblem:
    """The problem of the step from q (nq) and v (n): it follows from these alone, without a solve.

    Raises as `ContactModel.assemble` does.
    """
    model.set_state(position, velocity)
    return scheme.problem(scheme.assemble(model), model.velocity, info)


def _march(
    model: Model,
    scheme: MoreauJean,
    steps: int,
    settings: dict[str, Any],
    start: State | None,
    control: Control | None,
    *,
    stop: bool,
) -> Iterator[Step]:
    state = start or State(
        0,
        model.position,
        model.velocity,
        np.zeros((0, 2), dtype=np.int64),
        np.zeros((0, 3, 3)),
        np.zeros((0, 3)),
    )
    spin = bool(getattr(model, "spin", False))
    info_of = descriptions(model.scene, scheme, settings, model.left_out, spin=spin)
    options = dict(settings["options"])
    first = options.pop("guess", None)
    solve = _solve.solve_with(settings["solver"], settings["tol"], **options)
    for index in range(state.index, state.index + steps):
        if control is not None:
            assert isinstance(model, MujocoModel)
            model.control(control(index * scheme.h, state))
            state = replace(state, position=model.position)
        system = scheme.assemble(model)
        part = scheme.problem(system, model.velocity, info_of(index))
        problem, contacts = part.problem, part.contacts

        places = places_of(model, contacts)
        guess, still = first, None
        if settings["warm_start"] and problem.nc and len(state.r):
            guess, still = carry_over(state, contacts, places), STILL
        try:
            result = solve(problem, guess, still)
            solution = result.solution
            after = part.after(solution.v)
        except _core.UnsuitableError as error:
            word = contradiction(model, system)
            if not word:
                raise
            raise _core.UnsuitableError(f"{model.scene.name}, step {index}: {word}") from error

        word = trouble(problem, result, after, LARGEST * system.rounding, stop=stop)
        if word:
            raise StoppedError(f"{model.scene.name}, step {index}: {word}")
        yield Step(
            index,
            index * scheme.h,
            problem,
            result,
            after,
            part.dofs,
            contacts,
            state.position,
            state,
            model,
        )
        model.integrate(scheme.h, after, scheme.theta)
        r = solution.r.reshape(-1, contacts.dimension)
        state = State(
            index + 1, model.position, model.velocity, contacts.pair, contacts.frame, r, places
        )
        if not _core.are_within(state.position, LARGEST * system.rounding):
            raise StoppedError(
                f"{model.scene.name}, step {index}: leads to a position that is out of range"
                f" ({largest(state.position):.3g})"
            )


def largest(values: Vector) -> float:
    """The largest size of a value; NaN if one is."""
    return float(np.abs(values).max(initial=0.0))


def trouble(
    problem: _laws.Global, result: _core.Result, velocity: Vector, bound: float, *, stop: bool
) -> str:
    """Why a simulation cannot go on after a step, in words; empty if it can."""
    known = _core.are_within(velocity, bound)
    if known and result.converged:
        return ""
    found = f"{result.solver}: {result.status}, error {result.error:.2g}"
    if not known:
        return f"its velocity is out of range ({largest(velocity):.3g}; {found})"
    if stop:
        return f"it was not solved ({found})"
    if result.error < NONSENSE:
        return ""
    # the velocities that contacts ask for may be the rounding of a body in free flight
    wrong = result.error * np.linalg.norm(problem.condense().q)
    if not wrong <= STILL * largest(velocity):
        return f"it was not solved, and what was found is no better than no reactions ({found})"
    return ""


def contradiction(model: Model, system: System) -> str:
    """The equalities of a scene that contradict each other, in words; empty if there are none."""
    if not isinstance(model, MujocoModel) or not len(system.violation):
        return ""
    names, rounding = model.equalities()
    columns, violation = system.G.toarray(), system.violation
    kept, others, share = found = dependence(columns, violation, rounding)
    gaps, weights = gaps_of(columns, violation, rounding, found)
    if not gaps.size or not weights.max() > 1:
        return ""
    worst = int(weights.argmax())
    shares = np.abs(share[:, worst])
    involved = kept[shares > RANK * shares.max(initial=0.0)]
    words = sorted({names[k] for k in (others[worst], *involved)})
    return (
        f"the equalities {', '.join(words)} contradict each other: if the others hold, one is off"
        f" by {gaps[worst]:.2g} m or rad, and equalities are rigid here, not soft as in MuJoCo;"
        ' leave one of them out (active="false" in the MJCF)'
    )


def carried_to(model: Model, start: State, contacts: Contacts) -> Vector:
    """The guess (d nc) that a step has from the one before, for contacts of the model as it is."""
    if not len(start.r):
        return np.zeros(contacts.dimension * len(contacts))
    return carry_over(start, contacts, places_of(model, contacts))


def carry_over(state: State, contacts: Contacts, places: Vector) -> Vector:
    """A guess of r (d nc): the last impulses of the same shapes at the same place.

    They are carried over in the world and turned into the new frames, forces and moments alike.

    places   (nc x 2 x 3) of the contacts on their shapes, from `places_of`
    """
    source = same_contacts(np.asarray(state.pair, np.int64), state.place, contacts.pair, places)
    d, planar = contacts.dimension, contacts.planar
    carried: Vector = _core.carried_over(
        state.r,
        source,
        state.frame,
        contacts.frame,
        2 if planar else 3,
        _geometry.first_axis(planar, d),
    )
    return carried


def same_contacts(
    before: npt.NDArray[np.int64], old_places: Vector, now: npt.NDArray[np.int64], places: Vector
) -> npt.NDArray[np.int64]:
    """The contact of the step before that each one continues (nc); -1 for none.

    If a pair of shapes has several, the nearest to each other are matched first. An edge or a
    corner keeps its place on one of the shapes, so the smaller of two distances counts.
    """
    source: npt.NDArray[np.int64] = _core.same_contacts(before, old_places, now, places)
    return source


def descriptions(
    scene: Scene,
    scheme: MoreauJean,
    settings: dict[str, Any],
    left_out: Sequence[str] = (),
    *,
    spin: bool = False,
) -> Callable[..., _core.ProblemInfo]:
    """The function that gives the info of each step, from its number and its own settings.

    The info travels with a problem: its name, its mathematics, and all that is needed to make it
    again. The last line of the description is JSON, which `provenance` reads back. Most of it is
    the same for all steps.
    """
    origin = {
        "generator": "fclib.simulate",
        "fclib": _core.version,
        **engine(scene),
        "scene": scene.name,
        "parameters": dict(scene.parameters),
        "seed": scene.seed,
        "ignore": list(scene.ignore),
        "planar": scene.planar,
        **({"left_out": list(left_out)} if left_out else {}),
        **({"keyframe": scene.keyframe} if scene.keyframe else {}),
        **({"period": list(scene.period)} if scene.period else {}),
        **({"laws": laws_of(scene)} if scene.interactions else {}),
        "time_step": scheme.h,
        "restitution": scheme.restitution,
        "law": scheme.law,
        **({"activation": scheme.activation} if scheme.activation else {}),
        **({"allowance": ALLOWANCE} if scheme.allowance and scheme.law == "velocity" else {}),
        "theta": scheme.theta,
        **({"gyroscopic": True} if scene.gyroscopic else {}),
        **({"all_bodies": True} if scene.all_bodies else {}),
        **({} if scene.ground is None else {"ground": scene.ground}),
        "stabilization": scheme.stabilization,
        **settings,
    }
    units = {"length": "m", "mass": "kg", "time": "s"}
    words = [scene.description]
    words += [
        f"{name}: {text}."
        for name, text in (
            ("Field of application", scene.application),
            ("Friction", scene.friction),
            ("Authors of the original family", scene.authors),
            ("Left out", "; ".join(left_out)),
        )
        if text
    ]
    law = f"Newton impact e = {scheme.restitution:g}" if scheme.law == "velocity" else "gap law"
    if scene.interactions:
        law = f"laws of gaps {', '.join(laws_of(scene))}"
    words_of_components = (
        "N, T (and R of rolling" if scene.planar else "N, T1, T2 (and R1, R2 of rolling"
    )
    of_spin = "; S of spin before R, r_S in N m s, mu_s in m" if spin else ""
    title = f"{scene.title or scene.name}, step "
    # the JSON of each step is that of one dictionary, in this order
    before = "\n".join([*words, json.dumps(origin, default=str)]).lstrip()[:-1]
    after = json.dumps({"units": units})[1:]
    math_info = (
        f"Moreau-Jean step, theta = {scheme.theta:g}, h = {scheme.h:g} s; {law};"
        " Coulomb friction;"
        " M v = H r + G lambda + f, u = H^T v + w, G^T v + b = 0;"
        f"{GYROSCOPIC if scene.gyroscopic else ''}"
        f" v in m/s and rad/s, r in N s, components {words_of_components},"
        f" r_R in N m s, mu_r in m{of_spin})"
    )

    def of_step(index: int, **own: Any) -> _core.ProblemInfo:
        place = f'"step": {index}, "time": {index * scheme.h!r}'
        if own:
            place = f"{json.dumps(own)[1:-1]}, {place}"
        return _core.ProblemInfo(
            title=f"{title}{index}", description=f"{before}, {place}, {after}", math_info=math_info
        )

    return of_step


def laws_of(scene: Scene) -> list[str]:
    """The laws of a scene's interactions, each once."""
    return sorted({one.law for one in scene.interactions})


def engine(scene: Scene) -> dict[str, str]:
    """The simulator of a scene, with the version on which its numbers depend; none for meshes."""
    if scene.solids is None:
        return {"mujoco": _mujoco.VERSION}
    if scene.solids.meshes:
        return {}
    return {"scikit-fem": _skfem.VERSION}


def provenance(info: _core.ProblemInfo) -> dict[str, Any]:
    """The origin of a simulated problem, from its info. ValueError if the info has none."""
    origin = origin_of(info)
    if origin.get("generator") != "fclib.simulate":
        raise ValueError(f"{info.title!r} does not say how it was simulated")
    return dict(origin)
