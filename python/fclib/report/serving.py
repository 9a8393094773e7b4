"""Pages at an address of this machine: from a folder a browser loads no modules."""

from __future__ import annotations

import os
import shlex
import shutil
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from http import HTTPStatus
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fclib.collections.catalog import sha256
from fclib.report import browser, downloads
from fclib.report.error import ReportError
from fclib.report.site import MARK, described_merits
from fclib.report.view import write_view

HOST = "127.0.0.1"  # no other machine reaches it


class _Handler(SimpleHTTPRequestHandler):
    # the library uses the system's table, which may have other types, or none
    extensions_map = SimpleHTTPRequestHandler.extensions_map | {
        ".js": "text/javascript",
        ".mjs": "text/javascript",
        ".wasm": "application/wasm",
    }

    def do_GET(self) -> None:
        """Send a file; send nothing, without an error, for the icon that browsers ask for."""
        if self.path == "/favicon.ico":
            self.send_response(204)
            self.end_headers()
        else:
            super().do_GET()

    def send_head(self) -> Any:
        """The head of an answer, and the file: one of the folder, to pages of this address alone.

        A foreign host name that leads here is refused: through it a stranger's page could read the
        files. A link out of the folder is not followed.
        """
        port = self.connection.getsockname()[1]
        if self.headers.get("Host") not in {f"{name}:{port}" for name in (HOST, "localhost")}:
            self.send_error(HTTPStatus.FORBIDDEN, f"ask for http://{HOST}:{port}/")
            return None
        root = Path(self.directory).resolve()
        try:
            inside = Path(self.translate_path(self.path)).resolve().is_relative_to(root)
        except (ValueError, OSError):  # a null character, links in a ring
            inside = False
        if not inside:
            self.send_error(HTTPStatus.NOT_FOUND)
            return None
        return super().send_head()

    def list_directory(self, path: Any) -> Any:
        """List no folder."""
        self.send_error(HTTPStatus.NOT_FOUND)

    def log_message(self, format: str, *args: object) -> None:
        """Log no requests."""

    def end_headers(self) -> None:
        # a browser must reload a site that was built anew
        self.send_header("Cache-Control", "no-cache")
        super().end_headers()


def server(folder: Path, port: int = 0) -> ThreadingHTTPServer:
    """A server of a folder, not yet running, at a port or at any that is free.

    Raises:
        ReportError: the port is not available.
    """
    try:
        return ThreadingHTTPServer((HOST, port), partial(_Handler, directory=str(folder)))
    except OSError as error:
        raise ReportError(f"{HOST}:{port}: {error.strerror}") from None


def serve(site: Path, say: Callable[[str], None]) -> None:
    """Serve a site on this machine until it is interrupted; `say` is called with the address.

    Raises:
        ReportError: the folder is not a site.
    """
    if not (site / MARK).is_file():
        raise ReportError(f"{site}: is no site that fclib report has made")
    _until_interrupted(site, say)


def _until_interrupted(folder: Path, say: Callable[[str], None]) -> None:
    with server(folder) as running:
        say(f"http://{HOST}:{running.server_port}/")
        try:
            running.serve_forever()
        except KeyboardInterrupt:
            return


# ---- the page of one problem


def panel_of(file: Path, kind: str, solved: bool, module: Path | None) -> dict[str, Any]:
    """The data that the page of a file needs to check and solve its problem.

    Args:
        file: an FCLIB file.
        kind: kind of the problem in it.
        solved: whether the stored solution is of this problem.
        module: folder of the module, None if there is none.
    """
    own: dict[str, Any] = {"what": kind, "path": file.name, "kind": kind, "sha256": sha256(file)}
    address = f"files/{quote(os.fsencode(file.name))}"  # a name may hold bytes that are no text
    own |= {"href": address, "merit": downloads.merit_of(file) if solved else None}
    return {
        "merits": described_merits(),
        "module": browser.size(module) if module else 0,
        "serve": f"fclib view {shlex.quote(str(file))} --serve",
        "files": [own],
    }


def serve_view(
    record: Mapping[str, Any],
    panel: Mapping[str, Any],
    file: Path,
    module: Path,
    say: Callable[[str], None],
) -> None:
    """Serve the page of a file on this machine until it is interrupted; `say` is told the address.

    Raises:
        ReportError: a library is not installed.
    """
    with tempfile.TemporaryDirectory(prefix="fclib-view-") as name:
        folder = Path(name)
        with_reader = {**panel, "libraries": [browser.READER]}
        write_view(record, folder / "index.html", file.name, with_reader)
        browser.copy(module, folder)
        (folder / "files").mkdir()
        shutil.copyfile(file, folder / "files" / file.name)
        _until_interrupted(folder, say)
