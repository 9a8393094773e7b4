"""Commands of ``fclib``, run in the process of the tests."""

import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from typing import Any
from unittest.mock import patch

from fclib import cli


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    """A command in this process: another one takes half a second to start, and tests no more."""
    command = ["fclib", *map(str, arguments)]
    code: Any = 0
    with (
        redirect_stdout(StringIO()) as out,
        redirect_stderr(StringIO()) as err,
        patch.object(sys, "argv", command),
    ):
        try:
            cli.main()
        except SystemExit as end:
            code = end.code or 0
    return subprocess.CompletedProcess(command, code, out.getvalue(), err.getvalue())
