"""The module for browsers (`make wasm`) in a process of Node that answers calls."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import scipy.sparse as sp

import fclib

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "build" / "wasm" / "fclib"
DTYPES = {"f8": np.float64, "i4": np.int32, "u1": np.uint8}


def missing() -> str:
    """Why there is nothing to test; empty where there is."""
    if shutil.which("node") is None:
        return "there is no Node"
    if not (FOLDER / "fclib-core.wasm").is_file():
        return "the module for browsers is not built: make wasm"
    return ""


class BrowserError(Exception):
    """What the module threw."""

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind


class Module:
    """Functions of the module, by their names."""

    def __enter__(self) -> Module:
        self._node = subprocess.Popen(
            ["node", str(ROOT / "tests" / "browser" / "serve.mjs"), str(FOLDER)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        assert self._node.stdin is not None
        self._node.stdin.close()
        self._node.wait(10)

    def __call__(self, name: str, *values: Any) -> Any:
        assert self._node.stdin is not None
        assert self._node.stdout is not None
        line = json.dumps({"name": name, "values": [encoded(value) for value in values]})
        self._node.stdin.write(line + "\n")
        self._node.stdin.flush()
        answer = json.loads(self._node.stdout.readline())
        if "error" in answer:
            raise BrowserError(answer["error"]["kind"], answer["error"]["message"])
        return decoded(answer["value"])


def encoded(value: Any) -> Any:
    """Problems, solutions and arrays as serve.mjs takes them."""
    if isinstance(value, fclib.Solution):
        return encoded({k: v for k, v in value.__getstate__().items() if v is not None})
    if hasattr(value, "kind") and hasattr(value, "info"):
        members = {"kind": value.kind, **value.__getstate__()}
        members["info"] = value.info.__getstate__()
        infos = members.pop("matrix_info")
        for table in ("contacts", "bodies"):
            members[table] = members[table] and members[table].columns()
        found = {key: encoded(member) for key, member in members.items() if member is not None}
        for name, info in infos.items():
            found[name]["info"] = info.__getstate__()
        return found
    if sp.issparse(value):
        return encoded(matrix(value))
    if isinstance(value, bytes):
        return {"dtype": "u1", "data": base64.b64encode(value).decode()}
    if isinstance(value, np.ndarray):
        if value.ndim == 2:
            return encoded(matrix(value))
        dtype = "f8" if value.dtype.kind == "f" else "i4"
        data = np.ascontiguousarray(value, DTYPES[dtype]).tobytes()
        return {"dtype": dtype, "data": base64.b64encode(data).decode()}
    if isinstance(value, dict):
        return {key: encoded(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [encoded(one) for one in value]
    return value


def matrix(a: Any) -> dict[str, Any]:
    """A matrix as the module has it."""
    sizes = {"rows": a.shape[0], "cols": a.shape[1]}
    if not sp.issparse(a):
        return {"storage": "dense", **sizes, "x": a.ravel("F").astype(float)}
    if a.format == "coo":
        return {"storage": "triplet", **sizes, "p": a.col, "i": a.row, "x": a.data}
    return {"storage": a.format, **sizes, "p": a.indptr, "i": a.indices, "x": a.data}


def decoded(value: Any) -> Any:
    if isinstance(value, list):
        return [decoded(one) for one in value]
    if not isinstance(value, dict):
        return value
    if "dtype" in value:
        return np.frombuffer(base64.b64decode(value["data"]), DTYPES[value["dtype"]])
    if value.keys() == {"number"}:
        return float(value["number"].replace("Infinity", "inf"))
    return {key: decoded(one) for key, one in value.items()}
