"""The libraries that the pages draw with, taken from the Python packages that ship them.

    plotly   plotly.min.js: charts, patterns, bodies and contacts in space
    itables  DataTables with jQuery: tables

Nothing of theirs lies in this repository: their files are copied into a site when it is written,
each with its licence.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from fclib.report.error import ReportError

# a module that ends in exports: from a folder of files a browser loads scripts, but no modules
EXPORTS = re.compile(r"export\s*\{([^{}]*)\};?\s*(?=/\*|\Z)")
# comments on the parts from which a file is bundled
NOTICES = re.compile(r"^/\*!? *Bundled license information:.*?^\*/", re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Library:
    """A library in a site."""

    name: str
    version: str
    licence: str  # name of the licence
    package: str  # the package that ships it, with its version
    purpose: str
    files: Mapping[str, str]  # name in the site -> text
    notices: str  # the text of the licence, and the file's notes on its parts

    @property
    def record(self) -> dict[str, str]:
        """The entry of the page about the site."""
        keys = ("name", "version", "licence", "package", "purpose")
        return {key: getattr(self, key) for key in keys} | {"text": self.licence_file}

    @property
    def licence_file(self) -> str:
        """The place of its licence in the site."""
        return f"assets/licences/{self.name.lower().replace('.', '-')}.txt"


def libraries() -> tuple[Library, ...]:
    """The libraries of a site.

    Raises:
        ReportError: a package is not installed, or holds something else than expected.
    """
    return plotly(), datatables()


def plotly() -> Library:
    """Plotly's JavaScript, from the package plotly."""
    distribution = _package("plotly")
    script = _text(distribution, "plotly/package_data/plotly.min.js")
    return Library(
        name="plotly.js",
        version=_version(distribution, r"plotly\.js v([\d.]+)", script),
        licence="MIT, parts BSD-3-Clause",
        package=f"plotly {distribution.version}",
        purpose="charts, patterns, bodies and contacts",
        files={"plotly.js": script},
        notices=_notices(distribution, script),
    )


def datatables() -> Library:
    """DataTables with its extensions and jQuery, from the package itables."""
    distribution = _package("itables")
    module = _text(distribution, "itables/html/dt_bundle.js")
    return Library(
        name="DataTables",
        version=_version(distribution, r"DataTables ([\d.]+)\n", module),
        licence="MIT",
        package=f"itables {distribution.version}",
        purpose="tables",
        files={
            "tables.js": as_script(module, "default", "DataTable"),
            "tables.css": _text(distribution, "itables/html/dt_bundle.css"),
        },
        notices=_notices(distribution, module),
    )


def as_script(module: str, export: str, name: str) -> str:
    """A module as a classic script that leaves one of its exports in a global variable.

    Raises:
        ReportError: the text does not end in one list of exports, with this one in it.
    """
    found = EXPORTS.findall(module)
    names = {}
    if len(found) == 1:
        for part in found[0].split(","):
            own, _, given = part.strip().partition(" as ")
            names[given or own] = own
    if export not in names:
        raise ReportError(
            f"itables' dt_bundle.js does not export {export} as expected; install another"
            " version of itables"
        )
    end = f"window.{name} = {names[export]};\n}})();\n"
    return "(() => {\n" + EXPORTS.sub(lambda _: end, module)


def _package(name: str) -> metadata.Distribution:
    try:
        return metadata.distribution(name)
    except metadata.PackageNotFoundError:
        raise ReportError(
            f'the pages draw by a file of the package {name}: pip install "fclib[report]"'
        ) from None


def _text(distribution: metadata.Distribution, path: str) -> str:
    file = Path(str(distribution.locate_file(path)))
    try:
        return file.read_text(encoding="utf-8")
    except OSError:
        raise ReportError(
            f"{distribution.metadata['Name']} {distribution.version} ships no {path};"
            f" pip install --upgrade {distribution.metadata['Name']}"
        ) from None


def _version(distribution: metadata.Distribution, pattern: str, text: str) -> str:
    found = re.search(pattern, text)
    return found[1] if found else f"of {distribution.metadata['Name']} {distribution.version}"


def _notices(distribution: metadata.Distribution, text: str) -> str:
    """The licence in the package, then the file's notes on its bundled parts."""
    own = [
        file.read_text(encoding="utf-8")
        for file in distribution.files or ()
        if file.name.upper().startswith("LICENSE") and ".dist-info" in str(file)
    ]
    if not own:
        raise ReportError(
            f"{distribution.metadata['Name']} {distribution.version} has no text of its licence"
        )
    return "\n\n".join(part.strip() for part in [*own, *NOTICES.findall(text)]) + "\n"
