"""A site at an address of this machine: a browser loads modules from there, not from a folder."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from fclib.report.error import ReportError
from fclib.report.site import MARK

HOST = "127.0.0.1"  # nobody else reaches it


class _Handler(SimpleHTTPRequestHandler):
    # the system's table, which the library asks, may know other types, or none
    extensions_map = SimpleHTTPRequestHandler.extensions_map | {
        ".js": "text/javascript",
        ".mjs": "text/javascript",
        ".wasm": "application/wasm",
    }

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing of what is asked for."""

    def end_headers(self) -> None:
        # a site that is built anew is seen anew
        self.send_header("Cache-Control", "no-cache")
        super().end_headers()


def server(site: Path, port: int = 0) -> ThreadingHTTPServer:
    """A server of a site, not yet running, at a port or at any that is free.

    Raises:
        ReportError: the folder is no site, or the port is not to be had.
    """
    if not (site / MARK).is_file():
        raise ReportError(f"{site}: is no site that fclib report has made")
    try:
        return ThreadingHTTPServer((HOST, port), partial(_Handler, directory=str(site)))
    except OSError as error:
        raise ReportError(f"{HOST}:{port}: {error.strerror}") from None


def serve(site: Path, say: Callable[[str], None]) -> None:
    """Serve a site on this machine until it is interrupted; `say` is told the address.

    Raises:
        ReportError: the folder is no site.
    """
    with server(site) as running:
        say(f"http://{HOST}:{running.server_port}/")
        try:
            running.serve_forever()
        except KeyboardInterrupt:
            return
