"""The script ``fclib``: Ctrl-C ends it in one line, also while it imports what it needs."""

import os
import signal


def interrupted(*_: object) -> None:
    """End the process from within whatever is being imported."""
    os.write(2, b"fclib: interrupted\n")
    os._exit(130)


def main() -> None:
    """Entry point. The package, whose import takes most of a short command, comes after."""
    usual = signal.getsignal(signal.SIGINT)
    if usual is signal.default_int_handler:  # not where Ctrl-C is ignored
        signal.signal(signal.SIGINT, interrupted)
    from fclib.cli import main as run

    try:
        run(lambda: signal.signal(signal.SIGINT, usual))
    finally:
        if usual is signal.default_int_handler:  # all is done, and Python's end has no handler
            signal.signal(signal.SIGINT, signal.SIG_DFL)
