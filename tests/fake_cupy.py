"""CuPy without a GPU: its arrays are NumPy's, and its kernels are compiled for the host by g++.

What a GPU computes with many lanes, one lane of the host computes: the C++ tests compare lanes.
"""

from __future__ import annotations

import ctypes
import functools
import subprocess
import tempfile
import types
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import lapack

# the words of CUDA that the kernel uses, for one thread
HOST = r"""
#define __global__
#define __launch_bounds__(...)
static struct { int x = 0; } threadIdx, blockIdx;
static unsigned long long atomicAdd(unsigned long long* at, unsigned long long by) {
  const unsigned long long old = *at;
  *at += by;
  return old;
}
"""
ONE_LANE = {"LANES": 1, "WARPS": 1, "WAITING": 1, "GLOBAL": 1}
SCALARS: dict[Any, Any] = {np.int64: ctypes.c_longlong, np.int32: ctypes.c_int,
                           np.float64: ctypes.c_double, np.uint64: ctypes.c_void_p}  # fmt: skip


class ndarray(np.ndarray):  # noqa: N801
    """An array that says that it is on a GPU."""

    @property
    def device(self) -> Any:
        return types.SimpleNamespace(id=0)

    def get(self) -> Any:
        return np.asarray(self)

    def __dlpack_device__(self) -> Any:
        return (2, 0)


class Foreign:
    """An array of another library on the GPU, which speaks DLPack only."""

    def __init__(self, array: Any) -> None:
        self.array = array

    def __dlpack_device__(self) -> tuple[int, int]:
        return (2, 0)

    def __dlpack__(self, **_: Any) -> Any:
        return self.array


class Function:
    """A kernel of a compiled module."""

    kernel = types.SimpleNamespace(ptr=0)
    max_dynamic_shared_size_bytes = 0

    def __init__(self, function: Any) -> None:
        self.function = function
        self.function.restype = None

    def __call__(self, blocks: Any, threads: Any, arguments: Any, shared_mem: int = 0) -> None:
        taken = []
        for one in arguments:
            if isinstance(one, np.ndarray):
                assert isinstance(one, ndarray)
                assert one.flags.c_contiguous
                taken.append(ctypes.c_void_p(one.ctypes.data))
            else:
                taken.append(SCALARS[type(one)](int(one) if isinstance(one, np.integer) else one))
        self.function(*taken)


class RawModule:
    """A module that g++ compiles."""

    def __init__(self, code: str, options: tuple[str, ...]) -> None:
        macros = dict(one[2:].split("=") for one in options if one.startswith("-D"))
        macros.update({name: str(value) for name, value in ONE_LANE.items()})
        self.library = library_of(code, tuple(macros.items()))

    def get_function(self, name: str) -> Function:
        return Function(getattr(self.library, name))


@functools.cache
def library_of(code: str, macros: tuple[tuple[str, str], ...]) -> ctypes.CDLL:
    """The compiled kernel."""
    folder = tempfile.mkdtemp()
    source, library = (Path(folder) / name for name in ("kernel.cpp", "kernel.so"))
    source.write_text(HOST + code, encoding="utf-8")
    defined = [f"-D{name}={value}" for name, value in macros]
    command = ["g++", "-std=c++17", "-O1", "-shared", "-fPIC", "-Wall", "-Wextra", "-Werror"]
    command += ["-Wno-unknown-pragmas", "-Wno-unused-parameter", *defined, "-o", str(library)]
    subprocess.run([*command, str(source)], check=True)
    return ctypes.CDLL(str(library))


def as_ours(values: Any, dtype: Any = None) -> Any:
    return np.array(values, dtype=dtype).view(ndarray)


def unchecked_cholesky(matrices: Any) -> Any:
    """As that of CuPy: where there is no factor, what LAPACK leaves."""
    factors = [np.tril(lapack.dpotrf(one, lower=1)[0]) for one in matrices]
    return np.reshape(factors, matrices.shape).view(ndarray)


class Device:
    """The one device."""

    def __init__(self, number: int = 0) -> None:
        self.id = number

    def __enter__(self) -> Device:
        return self

    def __exit__(self, *_: Any) -> None:
        pass


def made() -> Any:
    """The module `cupy`."""
    module: Any = types.ModuleType("cupy")
    for name in ("float64", "int32", "uint64", "cumsum", "nan", "abs", "sqrt", "diagonal"):
        setattr(module, name, getattr(np, name))
    for name in ("arange", "zeros", "empty", "ones", "empty_like", "matmul", "flatnonzero", "eye",
                 "where"):  # fmt: skip
        function = getattr(np, name)
        setattr(module, name, lambda *a, _f=function, **k: _f(*a, **k).view(ndarray))
    module.ndarray = ndarray
    module.RawModule = RawModule
    module.__version__ = "fake"
    module.asarray = as_ours
    module.from_dlpack = lambda x: as_ours(x.array)
    module.asnumpy = lambda x: np.array(x)
    module.ascontiguousarray = lambda x, dtype=None: np.ascontiguousarray(x, dtype).view(ndarray)
    module.broadcast_to = lambda x, shape: np.broadcast_to(x, shape)
    module.linalg = types.SimpleNamespace(cholesky=unchecked_cholesky)
    runtime = types.SimpleNamespace(
        getDeviceProperties=lambda _: {
            "multiProcessorCount": 1, "sharedMemPerBlockOptin": 0, "name": b"none",
        },
        getDeviceCount=lambda: 1,
    )  # fmt: skip
    driver = types.SimpleNamespace(occupancyMaxActiveBlocksPerMultiprocessor=lambda *_: 1)
    module.cuda = types.SimpleNamespace(runtime=runtime, driver=driver, Device=Device)
    return module
