"""What `import fclib` gives: light, complete, typed."""

import sys
import types
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from helpers import dense, ran

HEAVY = ("scipy", "mujoco", "typer", "rich", "matplotlib", "h5py", "dask", "plotly")


def loaded_after(code: str) -> set[str]:
    script = f"import sys\n{code}\nprint(*sys.modules)"
    names = ran(sys.executable, "-c", script).stdout.split()
    return {*names, *(name.partition(".")[0] for name in names)}


def test_import_loads_nothing_heavy() -> None:
    loaded = loaded_after("import fclib")
    assert "fclib" in loaded
    assert loaded.isdisjoint({*HEAVY, "fclib.external"})


def test_reading_and_solving_load_no_more_than_they_need(tmp_path: Path) -> None:
    path = tmp_path / "p.hdf5"
    fclib.write(path, fclib.LocalProblem(W=np.eye(3), q=[-1, 0, 0], mu=[0.5]))
    code = f"import fclib\nassert fclib.solve(fclib.read({str(path)!r})).converged"
    assert loaded_after(code).isdisjoint(HEAVY)


def test_a_build_begins_without_what_few_of_them_need() -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("pyarrow")
    code = "import fclib.simulate\nfrom fclib.collections import ratings\nratings.runs()"
    assert loaded_after(code).isdisjoint(("pandas", "scipy.spatial"))


def test_all_is_complete_and_sorted() -> None:
    public = {
        name
        for name, value in vars(fclib).items()
        if not name.startswith("_") and not isinstance(value, types.ModuleType)
    }
    assert set(fclib.__all__) == public | {"__version__"}
    assert list(fclib.__all__) == sorted(fclib.__all__)
    for name in fclib.__all__:
        assert getattr(fclib, name) is not None


def test_the_version_is_that_of_the_package() -> None:
    assert fclib.__version__ == version("fclib")


def test_stubs_are_installed_and_say_what_there_is() -> None:
    folder = Path(fclib.__file__).parent
    assert (folder / "py.typed").is_file()
    stub = (folder / "_core.pyi").read_text()
    for name in fclib.__all__:
        if name in {"Problem", "__version__", *errors()}:
            continue
        if getattr(fclib, name).__module__ == "fclib._core":
            assert f"class {name}" in stub or f"def {name}(" in stub, name
    for field in ("W", "V", "R", "q", "mu", "s", "M", "H", "G", "f", "w", "b", "v", "u", "r", "l"):
        assert f"def {field}(self" in stub, field


def errors() -> dict[str, type[Exception]]:
    return {
        name: value
        for name, value in vars(fclib).items()
        if isinstance(value, type) and issubclass(value, Exception)
    }


def test_errors_are_those_of_python_too() -> None:
    assert set(errors()) == {
        "Error",
        "FileError",
        "OptionError",
        "ProblemError",
        "SolverError",
        "UnsuitableError",
    }
    for error in errors().values():
        assert issubclass(error, fclib.Error)
    assert issubclass(fclib.FileError, OSError)
    assert issubclass(fclib.SolverError, RuntimeError)
    for error in (fclib.ProblemError, fclib.OptionError, fclib.UnsuitableError):
        assert issubclass(error, ValueError)


# but for an alias, and a text
@pytest.mark.parametrize("name", [n for n in fclib.__all__ if n not in {"Problem", "__version__"}])
def test_everything_says_what_it_is(name: str) -> None:
    assert (getattr(fclib, name).__doc__ or "").strip()


def test_sizes_of_problems() -> None:
    local = fclib.LocalProblem(spacedim=2, W=np.eye(4), q=np.zeros(4), mu=[0.5, 0.5])
    assert (local.n, local.m, local.nc, local.p) == (0, 4, 2, 0)
    assert (local.kind, local.formulation) == ("local", "2DFC")
    assert "2DFC" in repr(local)
    assert (local.V, local.R, local.s) == (None, None, None)
    whole = fclib.GlobalProblem(
        M=np.eye(5),
        H=np.zeros((5, 3)),
        G=np.ones((5, 1)),
        f=np.zeros(5),
        w=np.zeros(3),
        mu=[1.0],
        b=[0.0],
    )
    assert (whole.n, whole.m, whole.nc, whole.p) == (5, 3, 1, 1)
    assert (whole.kind, whole.formulation) == ("global", "GM3DFC")
    assert "GM3DFC" in repr(whole)


def test_values_are_equal_where_their_members_are() -> None:
    rank: Any = np.int32(3)  # NumPy's scalars are taken too
    info = fclib.MatrixInfo(comment="a", conditioning=np.inf, rank=rank)
    same = fclib.MatrixInfo(comment="a", conditioning=np.inf, rank=3)
    assert info == same
    assert hash(info) == hash(same)
    assert info != same.replace(rank=2)
    assert info != "a"
    assert repr(info) == "MatrixInfo(comment='a', conditioning=inf, determinant=0.0, rank=3)"
    words = fclib.ProblemInfo(title="a")
    assert words == fclib.ProblemInfo(title="a")
    assert words != words.replace(title="b")
    assert "title='a'" in repr(words)


def test_a_copy_has_what_is_given_to_it_and_the_rest() -> None:
    problem = fclib.LocalProblem(
        W=np.eye(3), V=np.ones((3, 1)), R=np.eye(1), s=[1.0], q=np.zeros(3), mu=[0.5]
    )
    other = problem.replace(mu=[0.25], info=fclib.ProblemInfo(title="another"))
    assert (other.mu[0], other.info.title) == (0.25, "another")
    assert (problem.mu[0], problem.info.title) == (0.5, "")
    np.testing.assert_array_equal(dense(other.W), np.eye(3))
    plain = problem.replace(V=None, R=None, s=None)
    assert (problem.p, plain.p) == (1, 0)
    with pytest.raises(TypeError, match="unexpected argument 'mass'"):
        problem.replace(mass=1)  # type: ignore[call-arg]
    with pytest.raises(fclib.ProblemError, match="W"):
        problem.replace(W=None)


def test_condensation_and_elimination_are_what_they_say() -> None:
    rng = np.random.default_rng(1)
    M = np.diag(rng.uniform(1, 2, 7))
    H, G = rng.standard_normal((7, 6)), rng.standard_normal((7, 2))
    f, w, b = rng.standard_normal(7), rng.standard_normal(6), rng.standard_normal(2)
    whole = fclib.GlobalProblem(M=M, H=H, G=G, f=f, w=w, mu=[0.3, 0.4], b=b)
    local = whole.condense()
    assert local.V is not None
    assert local.R is not None
    assert local.s is not None
    inverse = np.linalg.inv(M)
    V, R, s = H.T @ inverse @ G, G.T @ inverse @ G, G.T @ inverse @ f + b
    np.testing.assert_allclose(dense(local.W), H.T @ inverse @ H, atol=1e-14)
    np.testing.assert_allclose(dense(local.V), V, atol=1e-14)
    np.testing.assert_allclose(dense(local.R), R, atol=1e-14)
    np.testing.assert_allclose(local.q, H.T @ inverse @ f + w, atol=1e-14)
    np.testing.assert_allclose(local.s, s, atol=1e-14)
    np.testing.assert_array_equal(local.mu, whole.mu)
    plain = local.eliminate()
    assert plain.p == 0
    np.testing.assert_allclose(
        dense(plain.W), dense(local.W) - V @ np.linalg.solve(R, V.T), atol=1e-13
    )
    np.testing.assert_allclose(plain.q, local.q - V @ np.linalg.solve(R, s), atol=1e-13)
