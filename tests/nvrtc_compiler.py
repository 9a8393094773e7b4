"""NVRTC of the package nvidia-cuda-nvrtc-cu12, which compiles kernels without a GPU."""

from __future__ import annotations

import ctypes
import importlib.util
import re
from pathlib import Path
from typing import Any


def found() -> Path | None:
    """The library, if it is installed."""
    try:
        spec = importlib.util.find_spec("nvidia.cuda_nvrtc")
    except ModuleNotFoundError:
        return None
    places = spec.submodule_search_locations if spec is not None else None
    for place in places or ():
        for library in sorted(Path(place).glob("lib/libnvrtc.so.*")):
            return library
    return None


def compiled(source: str, macros: dict[str, int], architecture: str = "sm_90") -> tuple[int, int]:
    """The registers of the kernel `solve`, and the bytes that it spills."""
    library = found()
    assert library is not None
    nvrtc = ctypes.CDLL(str(library))
    program = ctypes.c_void_p()

    def call(name: str, *arguments: Any) -> int:
        return int(getattr(nvrtc, f"nvrtc{name}")(*arguments))

    text = source.encode()
    assert call("CreateProgram", ctypes.byref(program), text, b"kernel.cu", 0, None, None) == 0
    options = [f"-D{name}={value}".encode() for name, value in macros.items()]
    options += [b"--gpu-architecture=" + architecture.encode(), b"-std=c++17"]
    options += [b"--ptxas-options=-v"]
    array = (ctypes.c_char_p * len(options))(*options)
    status = call("CompileProgram", program, len(options), array)
    size = ctypes.c_size_t()
    call("GetProgramLogSize", program, ctypes.byref(size))
    log = ctypes.create_string_buffer(size.value)
    call("GetProgramLog", program, log)
    call("DestroyProgram", ctypes.byref(program))
    words = log.value.decode()
    assert status == 0, words
    part = words[words.index("'solve'") :]
    spilled = re.search(r"(\d+) bytes spill stores, (\d+) bytes spill loads", part)
    registers = re.search(r"Used (\d+) registers", part)
    assert spilled is not None, words
    assert registers is not None, words
    return int(registers[1]), int(spilled[1]) + int(spilled[2])
