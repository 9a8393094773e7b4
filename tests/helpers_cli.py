"""Commands of ``fclib``, run in the process of the tests."""

import json
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import Any
from unittest.mock import patch

from typer.testing import CliRunner

from fclib import cli


class Pipe(TextIOWrapper):
    """A stream as Python opens it where a program reads what is said."""

    def __init__(self, errors: str) -> None:
        self.bytes = BytesIO()
        super().__init__(self.bytes, "utf-8", errors, write_through=True)


def run(*arguments: object, code: int | None = 0) -> subprocess.CompletedProcess[str]:
    """A command that ends with this code, or with any, in the process of the tests.

    Another process takes half a second to start, and tests no more.
    """
    command = ["fclib", *map(str, arguments)]
    ended: Any = 0
    with (
        redirect_stdout(Pipe("strict")) as out,
        redirect_stderr(Pipe("backslashreplace")) as err,
        patch.object(sys, "argv", command),
    ):
        try:
            cli.main()
        except SystemExit as end:
            ended = end.code or 0
    said = [stream.bytes.getvalue().decode() for stream in (out, err)]
    assert code in (None, ended), "".join(said)
    return subprocess.CompletedProcess(command, ended, *said)


def tables(store: Path, *arguments: str) -> dict[str, list[dict[str, Any]]]:
    """What `fclib profile --json` prints, by table."""
    found: dict[str, list[dict[str, Any]]] = {}
    for line in run("profile", store, "--json", *arguments).stdout.splitlines():
        record = json.loads(line)
        found.setdefault(record.pop("table"), []).append(record)
    return found


def invoke(*arguments: object, code: int | None = 0) -> Any:
    """A command that ends so; its output is one text in which both streams are."""
    done = CliRunner().invoke(cli.app, [str(argument) for argument in arguments])
    assert code in (None, done.exit_code), f"{done.output}\n{done.exception!r}"
    return done
