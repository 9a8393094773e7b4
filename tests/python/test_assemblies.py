"""What families say; those assembled directly, and mechanics with a closed form."""

import dataclasses
import decimal
import json
import math
import os
import sys
from typing import Any

import numpy as np
import pytest
from scipy.spatial.distance import pdist

import fclib
from fclib import scenes
from fclib.collections import set_index
from fclib.scenes import Assembled
from fclib.scenes.pile import DIAMETER, Pile, contacts_of
from fclib.scenes.shared import assembly
from helpers import converged, ran

FAMILIES: dict[str, Any] = dict(scenes.assemblies())
ALL: dict[str, Any] = FAMILIES | dict(scenes.families())


@pytest.mark.parametrize("name", ALL)
def test_family_says_what_it_is(name: str) -> None:
    family = ALL[name]
    for text in ("title", "description", "application", "authors", "friction", "collection"):
        assert getattr(family, text).strip(), text
    for parameter in dataclasses.fields(family):
        assert parameter.default is not dataclasses.MISSING, parameter.name
        assert parameter.metadata["unit"], parameter.name
        assert parameter.metadata["doc"], parameter.name


@pytest.mark.parametrize("name", FAMILIES)
def test_problems_follow_from_parameters_number_and_seed(name: str) -> None:
    family = FAMILIES[name]()
    number = min(3, family.problems - 1)
    problem = Assembled(family=family, seed=5).problem(number)
    origin = json.loads(problem.info.description.splitlines()[-1])
    assert (origin["scene"], origin["seed"], origin["step"]) == (name, 5, number)
    again = Assembled(family=FAMILIES[name](**origin["parameters"]), seed=5).problem(number)
    assert fclib.digest(again) == fclib.digest(problem)
    assert again.info == problem.info
    assert problem.info.title.startswith(family.title)
    for wrong in (-1, family.problems):
        with pytest.raises(ValueError, match=f"{name} has problems 0 to"):
            Assembled(family=family, seed=0).problem(wrong)


def blocks(name: str, number: int, **parameters: Any) -> Any:
    return FAMILIES[name](**parameters).problem(number)


def solved(problem: Any) -> Any:
    result = converged(problem, tol=1e-10)
    return result.solution


def test_sizes_grow_by_the_ladder() -> None:
    for name, most in (("Wall", 8), ("Packing", 8)):
        numbers = [blocks(name, number).nc for number in range(0, most, 2)]
        wanted = assembly.SIZES[: most // 2]
        assert all(0.4 * size <= nc <= 1.1 * size for nc, size in zip(numbers, wanted, strict=True))
        assert [blocks(name, number).nc for number in range(1, most, 2)] == numbers


def test_wall_at_rest_stays_on_the_ground() -> None:
    problem = blocks("Wall", 4)
    solution = solved(problem)
    np.testing.assert_allclose(solution.v, 0, atol=1e-6)
    normal = solution.r.reshape(-1, 3)[:, 0]
    ground = assembly.running_bond(assembly.SIZES[2], 0).first < 0
    weight = problem.M.diagonal()[::6].sum() * assembly.GRAVITY * assembly.STEP
    np.testing.assert_allclose(normal[ground].sum(), weight, rtol=1e-6)


def test_pile_in_a_frame_stands_without_friction_and_the_ground_carries_it() -> None:
    bodies = Pile().bodies(4)
    assert len(bodies.masses) == 30
    assert len(bodies.first) == contacts_of(4, True) == contacts_of(4, False) + 16
    # nothing is in anything: spheres that touch are a diameter apart, others more
    distances = pdist(bodies.centres)
    assert distances.min() > DIAMETER * (1 - 1e-12)
    assert (distances < DIAMETER * (1 + 1e-12)).sum() == np.count_nonzero(bodies.first >= 0)
    for mu in (0.0, 0.6):
        solution = solved(bodies.problem(mu, ""))
        np.testing.assert_allclose(solution.v, 0, atol=1e-6)
        normal = solution.r.reshape(-1, 3)[:, 0]
        ground = (bodies.first < 0) & (bodies.normals[:, 2] == 1)
        friction = solution.r.reshape(-1, 3)[(bodies.first < 0) & ~ground]
        weight = bodies.masses.sum() * assembly.GRAVITY * assembly.STEP
        carried = normal[ground].sum() + np.linalg.norm(friction[:, 1:], axis=1).sum()
        assert normal[ground].sum() <= weight * (1 + 1e-6)
        assert carried >= weight * (1 - 1e-6)


def test_two_layers_without_a_frame_stand_from_the_tangent_of_an_eighth_of_pi_on() -> None:
    """The line through both contacts of a lower sphere is as far off their normals."""
    bodies = Pile().bodies(2, framed=False)
    speeds = []
    for factor in (0.99, 1.01):
        solution = solved(bodies.problem(factor * np.tan(np.pi / 8), ""))
        speeds.append(np.abs(solution.v).max() / (assembly.GRAVITY * assembly.STEP))
    assert speeds[0] > 1e-3
    assert speeds[1] < 1e-6


def test_pushed_packing_has_the_impulse() -> None:
    rest, pushed = blocks("Packing", 4), blocks("Packing", 5, push=2.0)
    weight = rest.M.diagonal()[::6].sum() * assembly.GRAVITY * assembly.STEP
    np.testing.assert_allclose(rest.f[2::6].sum(), -weight)
    np.testing.assert_allclose((pushed.f - rest.f)[0::6].sum(), -2 * weight)
    assert not (pushed.f - rest.f)[2::6].any()


def test_columns_turn_and_move_bodies_as_rigid() -> None:
    """A rotation of everything about a point leaves no relative velocity but on the ground."""
    bodies = assembly.running_bond(60, 0)
    problem: Any = bodies.problem(0.5, "")
    omega, fixed = np.array([0.3, -0.2, 0.5]), np.array([1.0, 2.0, 3.0])
    linear = np.cross(omega, bodies.centres - fixed)
    v = np.hstack((linear, np.tile(omega, (len(linear), 1)))).ravel()
    u = np.reshape(problem.H.T @ v, (-1, 3))
    ground = bodies.first < 0
    np.testing.assert_allclose(u[~ground], 0, atol=1e-13)
    speed = np.cross(omega, bodies.points[ground] - fixed)
    np.testing.assert_allclose(np.linalg.norm(u[ground], axis=1), np.linalg.norm(speed, axis=1))
    np.testing.assert_allclose(u[ground, 0], speed[:, 2], atol=1e-13)


def test_units_are_one_mechanics() -> None:
    """Natural error and all figures are those of m and kg, in other numbers."""
    reference = blocks("Units", 4, contacts=60)
    solution = solved(reference)
    for number in range(9):
        problem = blocks("Units", number, contacts=60)
        length, mass = 1e-3 * 1e3 ** (number // 3), 1e-3 * 1e3 ** (number % 3)
        v = solution.v.reshape(-1, 6) / ([length] * 3 + [1.0] * 3)
        r = solution.r / (length * mass)
        moved = fclib.Solution(v=v.ravel(), r=r)
        assert fclib.merit(problem, moved).scaled_natural < 1e-9
        assert fclib.merit(problem, moved).dynamics < 1e-9


def test_repeated_contacts_move_bodies_alike() -> None:
    once, often = (blocks("RepeatedContacts", number, contacts=60) for number in (0, 2))
    assert often.nc == 4 * once.nc
    first, second = (solved(problem).v for problem in (once, often))
    np.testing.assert_allclose(first, second, atol=1e-6)


def test_mass_ratios_and_friction_are_what_they_say() -> None:
    for number, ratio in enumerate((1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)):
        masses = blocks("MassRatios", number).M.diagonal()[::6]
        assert 0.8 * ratio < masses.max() / masses.min() < 1.25 * ratio
    mus = [float(blocks("FrictionRange", number).mu[0]) for number in range(9)]
    assert (mus[0], mus[-1]) == (0.0, 10.0)
    assert np.all(np.diff(mus) > 0)


@pytest.mark.parametrize(("name", "value"), [("mu", -1.0), ("push", float("nan"))])
def test_nonsense_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        FAMILIES["Wall"](**{name: value})


LISTED = [
    c for name in ("standard", "hard") for c in set_index.choices(name) if c.family in FAMILIES
]
OLDER_PROCESSOR = """
import json, sys, warnings
warnings.simplefilter("ignore")  # of a NumPy that knows some of these features by other names
import fclib
from fclib.scenes import assemblies
found = {}
for name, count in json.load(sys.stdin).items():
    family = assemblies()[name]()
    found[name] = [fclib.digest(family.problem(k)) for k in range(count)]
json.dump(found, sys.stdout)
"""


def test_published_problems_are_assembled_as_they_were_published() -> None:
    assert {"Jammed", "Packing", "Wall"} <= {choice.family for choice in LISTED}
    for c in LISTED:
        family = FAMILIES[c.scene or c.family](**c.parameters)
        assert fclib.digest(family.problem(c.number, c.seed)) == c.digest, c


def test_an_older_processor_assembles_the_same_problems() -> None:
    """BLAS and the vector functions of NumPy round otherwise there."""
    counts = {
        name: min(family().problems, 12)
        for name, family in FAMILIES.items()
        if not hasattr(family, "digests")
    }
    environment = os.environ | {
        "OPENBLAS_CORETYPE": "PRESCOTT",
        "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX2 FMA3 AVX512F AVX512CD AVX512_SKX",
    }
    told = ran(sys.executable, "-c", OLDER_PROCESSOR, input=json.dumps(counts), env=environment)
    elsewhere = json.loads(told.stdout)
    for name, count in counts.items():
        family = FAMILIES[name]()
        here = [fclib.digest(family.problem(k)) for k in range(count)]
        assert here == elsewhere[name], name


def test_cubes_and_exponentials_are_exactly_rounded() -> None:
    x = np.random.Generator(np.random.PCG64(0)).uniform(0.5, 2.0, 1000)
    with decimal.localcontext(decimal.Context(prec=200)):
        cubes = [float(decimal.Decimal(value) ** 3) for value in x.tolist()]
        powers = [float(decimal.Decimal(value).exp()) for value in x.tolist()]
    assert assembly.cubes(x).tolist() == cubes
    assert assembly.exponentials(x).tolist() == powers
    np.testing.assert_allclose(powers, np.exp(x), rtol=1e-15)


def test_last_digits_are_as_published() -> None:
    x = np.full(100, 0.3)
    assert assembly.as_published("Wall/100", x).tolist() == x.tolist()
    found = assembly.as_published("Packing/100", x)
    assert (found[0], found[1:].tolist()) == (math.nextafter(0.3, 0.0), x[1:].tolist())
