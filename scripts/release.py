"""A release: what must be true before one is built, and what goes with its files.

.venv/bin/python scripts/release.py check         the tree is clean, every file names the version
.venv/bin/python scripts/release.py finish DIST   the site's archive, an SBOM and checksums, in DIST

`make release` calls both, and between them builds and tries all that is released. The SBOM is in
the format CycloneDX (ECMA-424): the files, what the package needs, and what its wheels bring.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.metadata
import re
import subprocess
import sys
import tarfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SUMS = "SHA256SUMS"


def version() -> str:
    """That of CMakeLists.txt, from which the package has it."""
    found = re.search(r"project\(fclib VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text())
    if found is None:
        sys.exit("CMakeLists.txt: there is no version in project()")
    return found[1]


def git(*words: str) -> str:
    """What git says of this repository."""
    done = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True)
    return done.stdout.strip() if done.returncode == 0 else ""


def faults(name: str) -> Iterator[str]:
    """What keeps this tree from being released as a version."""
    if changed := git("status", "--porcelain"):
        yield f"the tree has changes that are not committed:\n{changed}"
    for file, pattern in (
        ("CHANGELOG.md", rf"^## {re.escape(name)}\b"),
        ("CITATION.cff", rf"^version: {re.escape(name)}$"),
        ("recipe/recipe.yaml", rf'^  version: "{re.escape(name)}"$'),
    ):
        if not re.search(pattern, (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE):
            yield f"{file}: does not name the version {name} of CMakeLists.txt"
    tagged = git("rev-list", "-n", "1", f"v{name}")
    if tagged and tagged != git("rev-parse", "HEAD"):
        yield f"the tag v{name} is at {tagged[:10]}, not here: a released version never changes"


def check() -> None:
    """End with all that is wrong."""
    name = version()
    if found := list(faults(name)):
        sys.exit(f"{name} cannot be released:\n  " + "\n  ".join(found))
    print(f"== {name} can be released")


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def macro(header: Path, pattern: str) -> str:
    """A version from the macros of a header."""
    text = header.read_text(encoding="utf-8", errors="replace") if header.is_file() else ""
    return ".".join(re.findall(pattern, text, re.MULTILINE)) or "unknown"


def brought() -> dict[str, tuple[str, str]]:
    """What a wheel has compiled into it: the version and the licence of each."""
    bundled = ROOT / "build" / "bundled" / "include"
    eigen = bundled / "eigen3"
    if not eigen.is_dir():
        eigen = Path("/usr/include/eigen3")
    return {
        "hdf5": (
            macro(bundled / "H5public.h", r"^#define H5_VERS_(?:MAJOR|MINOR|RELEASE)\s+(\d+)"),
            "BSD-3-Clause",
        ),
        "metis": (
            macro(bundled / "metis.h", r"^#define METIS_VER_(?:MAJOR|MINOR|SUBMINOR)\s+(\d+)"),
            "Apache-2.0",
        ),
        "eigen": (
            macro(
                eigen / "Eigen/src/Core/util/Macros.h",
                r"^#define EIGEN_(?:WORLD|MAJOR|MINOR)_VERSION (\d+)",
            ),
            "MPL-2.0",
        ),
        "nanobind": (importlib.metadata.version("nanobind"), "BSD-3-Clause"),
    }


def needed() -> dict[str, str]:
    """The packages that the installed fclib asks for, with the versions that it was tried with."""
    found = {}
    for requirement in importlib.metadata.requires("fclib") or []:
        name = re.match(r"[\w.-]+", requirement)
        assert name is not None
        try:
            found[name[0]] = importlib.metadata.version(name[0])
        except importlib.metadata.PackageNotFoundError:
            continue  # of another Python, or of an optional part that is not here
    return found


def sbom(name: str, files: list[Path], target: Path) -> None:
    """Write the list of what is released and of what it is made of."""
    from cyclonedx.model import HashAlgorithm, HashType
    from cyclonedx.model.bom import Bom
    from cyclonedx.model.component import Component, ComponentType
    from cyclonedx.model.license import DisjunctiveLicense
    from cyclonedx.output.json import JsonV1Dot6
    from packageurl import PackageURL

    bom = Bom()
    own = Component(
        name="fclib",
        version=name,
        type=ComponentType.LIBRARY,
        licenses=[DisjunctiveLicense(id="Apache-2.0")],
        bom_ref="fclib",
    )
    bom.metadata.component = own
    parts = [
        Component(
            name=part,
            version=released,
            type=ComponentType.LIBRARY,
            licenses=[DisjunctiveLicense(id=licence)],
            bom_ref=part,
        )
        for part, (released, licence) in brought().items()
    ]
    parts += [
        Component(
            name=part,
            version=released,
            type=ComponentType.LIBRARY,
            purl=PackageURL("pypi", None, part.lower(), released),
            bom_ref=f"pypi:{part}",
        )
        for part, released in sorted(needed().items())
    ]
    for part in parts:
        bom.components.add(part)
    for path in files:
        bom.components.add(
            Component(
                name=path.name,
                type=ComponentType.FILE,
                hashes=[HashType(alg=HashAlgorithm.SHA_256, content=digest(path))],
                bom_ref=f"file:{path.name}",
            )
        )
    bom.register_dependency(own, parts)
    target.write_text(JsonV1Dot6(bom).output_as_string(indent=2) + "\n", encoding="utf-8")


def finish(dist: Path) -> None:
    """Add the site, the SBOM and the checksums to what was built."""
    name = version()
    site = ROOT / "build" / "site"
    if not (site / "index.html").is_file():
        sys.exit(f"{site}: there is no site; make docs builds it")
    archive = dist / f"fclib-{name}-site.tar.gz"
    with tarfile.open(archive, "w:gz") as file:
        file.add(site, f"fclib-{name}-site")
    for made in (dist / "collection").glob("*.whl"):
        made.replace(dist / made.name)
    target = dist / f"fclib-{name}.cdx.json"
    files = sorted(p for p in dist.iterdir() if p.is_file() and p not in (target, dist / SUMS))
    for kind in (".whl", ".deb", f"fclib-{name}.tar.gz", "-site.tar.gz"):
        if not any(path.name.endswith(kind) for path in files):
            sys.exit(f"{dist}: has no *{kind}; make release builds all")
    sbom(name, files, target)
    lines = [f"{digest(path)}  {path.name}\n" for path in [*files, target]]
    (dist / SUMS).write_text("".join(lines), encoding="utf-8")
    print(f"== {dist}: {len(lines)} files, with {SUMS}")
    print(
        "".join(f"   {p.stat().st_size / 1e6:7.2f} MB  {p.name}\n" for p in [*files, target]),
        end="",
    )


def main() -> None:
    """Check or finish."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("act", choices=["check", "finish"])
    parser.add_argument("dist", nargs="?", type=Path, default=ROOT / "dist")
    arguments = parser.parse_args()
    if arguments.act == "check":
        check()
    else:
        finish(arguments.dist)


if __name__ == "__main__":
    main()
