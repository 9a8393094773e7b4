"""Batches on a GPU, without one: the kernel is compiled for one lane of the host."""

import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import fake_cupy
import fclib
from fclib import _device


@pytest.fixture(autouse=True)
def cupy(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    module = fake_cupy.made()
    monkeypatch.setitem(sys.modules, "cupy", module)
    yield module
    _device.kernel.cache_clear()


def bodies(nc: int, count: int, nv: int, spacedim: int = 3, seed: int = 0) -> dict[str, Any]:
    """Problems whose W has the rank nv at most."""
    rng = np.random.default_rng(seed)
    return {
        "jacobian": rng.normal(size=(count, spacedim * nc, nv)),
        "inverse_mass": rng.uniform(0.5, 2, (count, nv)),
        "velocity": rng.normal(size=(count, nv)),
        "mu": rng.uniform(0, 1, (count, nc)),
    }


def as_matrices(given: dict[str, Any]) -> dict[str, Any]:
    J, inverse = given["jacobian"], given["inverse_mass"]
    W = (J * inverse[:, None]) @ J.transpose(0, 2, 1)
    return {"W": W, "q": (J @ given["velocity"][..., None])[..., 0], "mu": given["mu"]}


def on_gpu(given: dict[str, Any]) -> dict[str, Any]:
    return {name: fake_cupy.as_ours(array) for name, array in given.items()}


def judged(given: dict[str, Any], found: Any, k: int, spacedim: int = 3) -> float:
    """Merit.error of problem k."""
    of = as_matrices(given)
    problem = fclib.LocalProblem(spacedim=spacedim, W=of["W"][k], q=of["q"][k], mu=of["mu"][k])
    return fclib.merit(
        problem, fclib.Solution(r=np.array(found.r[k]), u=np.array(found.u[k]))
    ).error


@pytest.mark.parametrize(("nc", "nv", "spacedim"), [(4, 6, 3), (3, 7, 2), (6, 18, 3)])
@pytest.mark.parametrize("form", ["bodies", "W"])
def test_each_is_solved_and_judged(nc: int, nv: int, spacedim: int, form: str) -> None:
    given = bodies(nc, 40, nv, spacedim)
    arrays = on_gpu(given if form == "bodies" else as_matrices(given))
    found = fclib.solve_batch(**arrays, spacedim=spacedim)
    assert isinstance(found, fclib.DeviceBatchResult)
    assert found.converged.all()
    assert found.by_auto == 0
    assert len(found.unsolved) == 0
    for k in range(40):
        # W in double is not quite that of the bodies
        assert judged(given, found, k, spacedim) == pytest.approx(
            found.error[k], rel=1e-3, abs=1e-13
        )


def test_w_that_is_not_symmetric_is_not_read_the_other_way() -> None:
    rng = np.random.default_rng(3)
    for nc in (4, 10):  # copied, and transposed
        skew = rng.normal(size=(5, 3 * nc, 3 * nc))
        W = np.eye(3 * nc) + 0.1 * (skew - skew.transpose(0, 2, 1))
        q = rng.normal(size=(5, 3 * nc))
        found = fclib.solve_batch(*(fake_cupy.as_ours(x) for x in (W, q, np.full((5, nc), 0.5))))
        assert found.converged.all()
        assert np.allclose(found.u, (W @ np.array(found.r)[..., None])[..., 0] + q, atol=1e-12)


@pytest.mark.parametrize("form", ["bodies", "W"])
@pytest.mark.parametrize("counts", [[1, 4, 0, 2], [9, 2, 9]])
def test_numbers_of_contacts_may_vary(form: str, counts: list[int]) -> None:
    parts = [bodies(nc, 1, 6, seed=nc) for nc in counts]
    matrices = [as_matrices(one) for one in parts]
    expected = fclib.solve_batch(*([one[name][0] for one in matrices] for name in ("W", "q", "mu")))
    if form == "W":
        flat = {
            name: np.concatenate([x[name].ravel() for x in matrices]) for name in ("W", "q", "mu")
        }
    else:
        flat = {
            "jacobian": np.concatenate([one["jacobian"][0] for one in parts]),
            "mu": np.concatenate([one["mu"][0] for one in parts]),
            **{
                name: np.concatenate([one[name] for one in parts])
                for name in ("velocity", "inverse_mass")
            },
        }
    found = fclib.solve_batch(**on_gpu(flat), contacts=counts)
    assert found.converged.all()
    assert np.array_equal(found.offsets, expected.offsets)
    assert np.allclose(found.u, expected.u, atol=1e-6)


def test_a_bad_problem_hurts_no_other() -> None:
    given = bodies(4, 8, 6)
    good = fclib.solve_batch(**on_gpu(given))
    given["mu"][2, 1] = -0.1
    given["velocity"][5, 0] = np.nan
    given["jacobian"][6, 3, 2] = np.inf
    found = fclib.solve_batch(**on_gpu(given))
    bad = np.isin(np.arange(8), [2, 5, 6])
    assert [found.statuses[k] for k in found.status[bad]] == ["invalid"] * 3
    assert found.unsolved.tolist() == [2, 5, 6]
    assert found.by_auto == 0
    assert np.array_equal(found.r[~bad], good.r[~bad])
    assert np.isnan(found.r[bad]).all()
    assert np.isinf(found.error[bad]).all()


def test_a_full_inverse_mass_that_is_none_is_invalid() -> None:
    given = bodies(2, 6, 6)
    full = np.stack([np.diag(one) for one in given["inverse_mass"]])
    full[1, 3, 3] = -1
    full[2, 0, 1] = 0.3  # not symmetric
    full[3, 4, 4] = np.nan
    full[4, 2] = full[4, :, 2] = 0  # a coordinate that is fixed
    full[5, :2, :2] = [[1, 2], [2, 1]]
    found = fclib.solve_batch(**on_gpu({**given, "inverse_mass": full}))
    names = [found.statuses[k] for k in found.status]
    assert names == ["converged", "invalid", "invalid", "invalid", "converged", "invalid"]
    given["inverse_mass"][4, 2] = 0
    assert judged(given, found, 4) <= 1e-8 * (1 + 1e-3)


@pytest.mark.parametrize("form", ["bodies", "W"])
def test_squares_that_are_lost_make_no_small_error(form: str) -> None:
    """1e-170^2 is 0 in double precision, and (1e160)^2 is infinite: that is for the CPU."""
    for speed in (1e-300, 1e-170, 1e-140, 1e150):
        for mass in (1e-160, 1.0, 1e160):
            given = bodies(2, 3, 6)
            given["velocity"] *= speed
            given["inverse_mass"] /= mass
            arrays = on_gpu(given if form == "bodies" else as_matrices(given))
            found = fclib.solve_batch(**arrays, unsolved="leave")
            for k in np.flatnonzero(found.converged).tolist():
                assert judged(given, found, k) <= 1e-8 * (1 + 1e-3)
    # zeros have no square either, and are solved
    given = bodies(2, 3, 6)
    given["velocity"][:] = 0
    assert fclib.solve_batch(**on_gpu(given), unsolved="leave").converged.all()


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_rounding_beside_large_reactions_is_no_small_error(unit: float) -> None:
    """Masses from 1e-3 to 1e3 kg in any unit: what double precision cannot judge is left."""
    given = bodies(2, 200, 8, seed=4)
    scale = np.repeat(10 ** np.random.default_rng(1).uniform(-3, 3, (200, 2)), 3, axis=1)
    given["jacobian"] *= scale[..., None]
    given["inverse_mass"] /= unit
    found = fclib.solve_batch(**on_gpu(as_matrices(given)), unsolved="leave")
    assert found.converged.any()
    for k in np.flatnonzero(found.converged).tolist():
        assert judged(given, found, k) <= 1e-8 * (1 + 1e-3)


def test_what_is_left_goes_to_the_cpu_or_stays() -> None:
    matrices = as_matrices(bodies(2, 4, 6))
    matrices["W"][1] = 0
    matrices["q"][1] = [-1, 0, 0, 1, 0, 0]
    found = fclib.solve_batch(**on_gpu(matrices))
    assert found.statuses[found.status[1]] == "infeasible"
    assert found.by_auto == 1
    assert found.converged.tolist() == [True, False, True, True]
    left = fclib.solve_batch(**on_gpu(matrices), unsolved="leave")
    assert left.statuses[left.status[1]] == "stalled"
    assert left.by_auto == 0
    assert left.unsolved.tolist() == [1]
    # more contacts than a kernel takes
    large = bodies(65, 2, 9)
    assert fclib.solve_batch(**on_gpu(large)).by_auto == 2
    assert (fclib.solve_batch(**on_gpu(large), unsolved="leave").error == np.inf).all()


def test_a_guess_saves_steps_and_other_libraries_come_in_by_dlpack() -> None:
    given = on_gpu(bodies(4, 20, 6))
    cold = fclib.solve_batch(**given)
    foreign: dict[str, Any] = {name: fake_cupy.Foreign(array) for name, array in given.items()}
    warm = fclib.solve_batch(**foreign, guess=fake_cupy.Foreign(cold.r))
    assert warm.converged.all()
    assert warm.iterations.sum() == 0
    assert repr(warm) == "<DeviceBatchResult: 20 problems on a GPU>"


def test_a_full_inverse_mass_is_that_of_its_factor() -> None:
    given = bodies(4, 6, 6)
    rng = np.random.default_rng(1)
    root = rng.normal(size=(6, 6, 6))
    full = np.eye(6) + 0.1 * root @ root.transpose(0, 2, 1)
    found = fclib.solve_batch(**on_gpu({**given, "inverse_mass": full}))
    host = fclib.solve_batch(**{**given, "inverse_mass": full})
    assert found.converged.all()
    assert np.allclose(found.u, host.u, atol=1e-6)
    one = fclib.solve_batch(**on_gpu({**given, "inverse_mass": full[0].diagonal()}))
    assert one.converged.all()


def test_no_problems_are_no_trouble() -> None:
    empty = fclib.solve_batch(
        *(fake_cupy.as_ours(np.zeros(s)) for s in ((0, 3, 3), (0, 3), (0, 1)))
    )
    assert len(empty) == 0
    assert len(empty.unsolved) == 0


def test_wrong_input_is_refused_by_its_name() -> None:
    given = on_gpu(bodies(4, 3, 6))
    matrices = on_gpu(as_matrices(bodies(4, 3, 6)))
    learned = fake_cupy.Foreign(given["mu"])
    learned.requires_grad = True  # type: ignore[attr-defined]
    for arguments, words in [
        ({**given, "mu": given["mu"][:, :3]}, "mu: has the shape"),
        ({**given, "mu": learned}, "mu: requires a gradient"),
        ({**given, "velocity": None}, "velocity: is missing"),
        ({**given, "inverse_mass": None}, "inverse_mass: is missing"),
        ({**given, "inverse_mass": given["mu"]}, "inverse_mass: has the shape"),
        ({**given, "W": matrices["W"]}, "W: is given, and so is a jacobian"),
        ({**matrices, "velocity": given["velocity"]}, "jacobian: is missing"),
        ({**matrices, "q": None}, "q: is missing"),
        ({**matrices, "W": matrices["W"][0]}, "W: has the shape"),
        ({**matrices, "W": matrices["W"].astype(complex)}, "W: is not an array of real numbers"),
        ({**matrices, "contacts": [4, 4]}, "W: has 432 entries, expected 288"),
        ({**matrices, "contacts": [4.0] * 3}, "contacts: is not a list of whole numbers"),
    ]:
        with pytest.raises(fclib.ProblemError, match=words):
            fclib.solve_batch(**arguments)
    with pytest.raises(fclib.OptionError, match="unsolved"):
        fclib.solve_batch(**given, unsolved="maybe")  # type: ignore[arg-type]


def test_without_cupy_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cupy", None)
    assert "pip install 'fclib[gpu]'" in _device.missing()
    with pytest.raises(fclib.ProblemError, match=r"fclib\[gpu\]"):
        fclib.solve_batch(**on_gpu(bodies(1, 1, 6)))


@pytest.mark.parametrize(
    ("form", "nc", "nv"),
    [("bodies", 4, 6), ("bodies", 8, 12), ("bodies", 16, 24), ("bodies", 32, 36),
     ("bodies", 64, 60), ("W", 4, 0), ("W", 16, 0), ("W", 64, 0)],
)  # fmt: skip
def test_the_compiler_of_cuda_keeps_it_in_registers(form: str, nc: int, nv: int) -> None:
    """NVRTC compiles without a GPU."""
    nvrtc = pytest.importorskip("nvrtc_compiler")
    if not nvrtc.found():
        pytest.skip("no NVRTC: pip install nvidia-cuda-nvrtc-cu12")
    macros = _device.plan(form, 3, nc, True, nv, min(nv, 12))
    registers, spilled = nvrtc.compiled(_device.sources(), macros)
    assert spilled <= 64  # a few words of a block of 64 threads, which is faster for it
    # 12 warps on a multiprocessor of 65536 registers have 168, 8 have 255
    assert registers <= (255 if (form, nc) == ("bodies", 8) else 168)
