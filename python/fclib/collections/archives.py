"""Archives of built families, for any static web server, and their download.

SITE/registry.txt               SHA-256 of each file, as pooch reads it
catalog.parquet            of all families
rt444-KaplasTower.zip      a family: its files, and its part of the catalogue
"""

from __future__ import annotations

import importlib
import shutil
import zipfile
import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import url2pathname

from fclib._files import replace_file, write_text
from fclib.collections import catalog, trajectory
from fclib.collections.set_index import folders

REGISTRY = "registry.txt"
EPOCH = (1980, 1, 1, 0, 0, 0)  # so that equal files make equal archives
TIMEOUT = 30.0  # longest silence of a server [s]
TRIES = 3  # connections for one download, if it breaks off
# the files may be so many times as large as their archive. `publish` stores them as they are, and
# HDF5 has compressed them; an archive made to fill a disk unpacks to a thousand times its size
UNPACKED = 20


class FetchError(OSError):
    """An archive could not be fetched whole."""


def pooch_module() -> Any:
    """The module pooch. Without it an ImportError says what to install."""
    try:
        return importlib.import_module("pooch")
    except ImportError as error:
        raise ImportError(
            f"fetching needs pooch ({error}); install it with: pip install 'fclib[collection]'"
        ) from error


def cache_folder() -> Path:
    """The user's cache folder for FCLIB."""
    return Path(pooch_module().os_cache("fclib"))


def publish(folder: str | Path, site: str | Path) -> list[Path]:
    """Make the archives of all finished families of a folder, and their registry.

    Families whose build was cut are left out, also from the catalogue (`catalog.unfinished`).

    Args:
        folder: the folder that `build` made.
        site: the folder that a web server serves; made if it is missing.

    Returns:
        The files written.

    Raises:
        CatalogError: the folder has no catalogue.
        FetchError: a file is missing, or is not the file in the catalogue.
    """
    folder, site = Path(folder), Path(site)
    cut = catalog.unfinished(folder)
    rows = [
        row
        for row in catalog.read_catalog(folder).to_pylist()
        if f"{row['collection']}/{row['family']}" not in cut
    ]
    site.mkdir(parents=True, exist_ok=True)
    families: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        families.setdefault(f"{row['collection']}/{row['family']}", []).append(row)

    written = []
    for name, own in families.items():
        archive = site / f"{name.replace('/', '-')}.zip"
        members = [pair for row in own for pair in catalog.files_of(row)]
        for path, digest in members:
            if not (folder / path).is_file() or catalog.sha256(folder / path) != digest:
                raise FetchError(f"{folder / path}: is not the catalogue's file; build it anew")
        # add the states of the problems, if no package has them
        parts = [f"{name}/{file}" for file in (trajectory.OWN, catalog.FILE)]
        paths = [path for path, _ in members]
        paths += [part for part in parts if (folder / part).is_file()]

        def pack(target: Path, paths: Sequence[str] = paths) -> None:
            # the files are compressed already
            with zipfile.ZipFile(target, "w", zipfile.ZIP_STORED) as zipped:
                for path in paths:
                    entry = zipfile.ZipInfo(path, date_time=EPOCH)
                    entry.external_attr = 0o644 << 16
                    zipped.writestr(entry, (folder / path).read_bytes())

        replace_file(archive, pack)
        written.append(archive)
    catalog.write_catalog(site / catalog.FILE, rows)
    written.append(site / catalog.FILE)
    lines = [f"{path.name} sha256:{catalog.sha256(path)}\n" for path in sorted(written)]
    registry = site / REGISTRY
    write_text(registry, "".join(lines))
    return [*written, registry]


def get(
    names: Sequence[str],
    url: str,
    folder: str | Path,
    progress: Callable[[str, int, int], None] | None = None,
) -> list[str]:
    """Fetch families from a server, check them, and unpack them into a folder.

    A download that broke off is continued, if the server can send the rest alone.

    Args:
        names: sets, families, families in a set (SET/FAMILY), or scenes that are published there.
        url: address or folder of `registry.txt`.
        folder: the collection's folder; the archives are kept in its `.archives`.
        progress: called with the archive's name, the bytes received and the bytes expected.

    Returns:
        The folders SET/FAMILY that are there now.

    Raises:
        KeyError: a name is neither a set nor a family, or is not published there.
        FetchError: the server cannot be reached, or the received files differ from the registry.
    """
    pooch = pooch_module()
    folder = Path(folder)
    archives = folder / ".archives"
    made = [one for one in (archives, folder) if not one.exists()]
    archives.mkdir(parents=True, exist_ok=True)
    base = url if url.endswith("/") else url + "/"
    (archives / REGISTRY).unlink(missing_ok=True)
    try:
        download(base + REGISTRY, archives / REGISTRY)
    except FetchError:
        for one in made:  # nothing is left of a wrong address
            with suppress(OSError):
                one.rmdir()
        raise
    # its messages are for a console of its own
    pooch.get_logger().setLevel("WARNING")
    fetcher = pooch.create(path=archives, base_url=base, registry=None)
    try:
        fetcher.load_registry(archives / REGISTRY)
    except (OSError, ValueError) as error:
        raise FetchError(f"{base}{REGISTRY}: is no registry: {error}") from error
    for name in fetcher.registry:
        if Path(name).name != name:
            raise FetchError(f"{base}{REGISTRY}: {name!r} is no name of a file")

    published = {folder_of(name): name for name in fetcher.registry if name.endswith(".zip")}
    wanted = list(dict.fromkeys(own for name in names for own in wanted_of(name, [*published])))
    for own in wanted:
        if own not in published:
            raise KeyError(f"{own} is not published at {base}")
        archive = published[own]

        def fetch(url: str, output_file: str, _pooch: Any, archive: str = archive) -> None:
            show = (lambda done, total: progress(archive, done, total)) if progress else None
            # pooch would begin a new file each time; ours stays and is continued
            target = archives / f"{archive}.part"
            download(url, target, show)
            shutil.move(target, output_file)

        try:
            path = fetcher.fetch(archive, downloader=fetch)
        except ValueError as error:
            raise FetchError(f"{base}{archive}: is not what the registry says: {error}") from error
        unpack(Path(path), folder, own)
    catalog.gather(folder)
    return wanted


def folder_of(archive: str) -> str:
    """SET/FAMILY of an archive's name."""
    # the name of a set has no hyphen, that of a scene may
    return archive.removesuffix(".zip").replace("-", "/", 1)


def wanted_of(name: str, published: Sequence[str]) -> list[str]:
    """The published folders that a name stands for. KeyError if the name is unknown.

    An MJCF scene is not a family of ours; only its archive is known.
    """
    try:
        ours = folders([name])
    except KeyError:
        ours = []
    there = [own for own in published if own in ours]
    there = there or [own for own in published if name in (own, own.partition("/")[2])]
    return there or folders([name])


def download(url: str, target: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Fetch a file, or only the rest if a part is there; copy it from a folder. FetchError."""
    if url.startswith("file://") or "://" not in url:
        path = Path(url2pathname(urlsplit(url).path) if "://" in url else url)
        try:
            shutil.copyfile(path, target)
        except OSError as error:
            raise FetchError(f"{path}: cannot be fetched: {error.strerror or error}") from None
        return
    requests = importlib.import_module("requests")
    reason: object = None
    for _ in range(TRIES):
        there = target.stat().st_size if target.exists() else 0
        try:
            with requests.get(
                url,
                headers={"Range": f"bytes={there}-"} if there else {},
                stream=True,
                timeout=TIMEOUT,
            ) as response:
                if response.status_code == 416:  # nothing is left to ask for
                    return
                response.raise_for_status()
                # 200 means that the server does not support ranges: start anew
                there = there if response.status_code == 206 else 0
                length = response.headers.get("Content-Length")
                total = there + int(length) if length else 0
                with target.open("ab" if there else "wb") as file:
                    for block in response.iter_content(1 << 13):
                        file.write(block)
                        there += len(block)
                        if progress is not None:
                            progress(there, total)
            if not total or there == total:
                return
            reason = f"{there} of {total} bytes came"
        except (
            requests.ConnectionError,
            requests.Timeout,
            requests.exceptions.ChunkedEncodingError,  # broke off
        ) as error:
            reason = error
        except requests.RequestException as error:
            raise FetchError(f"{url}: {error}") from error
    raise FetchError(f"{url}: cannot be fetched: {reason}")


def unpack(archive: Path, folder: Path, family: str) -> None:
    """Unpack SET/FAMILY; its part of the catalogue comes last, as the sign that all is there.

    Raises:
        FetchError: the file is not an archive of this family, or is damaged. Then nothing is
            unpacked.
    """
    try:
        with zipfile.ZipFile(archive) as zipped:
            entries = [entry for entry in zipped.infolist() if not entry.is_dir()]
            _check(archive, entries, folder, family)
            for entry in sorted(entries, key=lambda e: e.filename.endswith(catalog.FILE)):
                target = folder / entry.filename
                target.parent.mkdir(parents=True, exist_ok=True)
                content = zipped.read(entry)

                def write(path: Path, entry: Any = entry, content: bytes = content) -> None:
                    path.write_bytes(content)
                    if entry.filename == f"{family}/{catalog.FILE}":
                        # a file that is not a catalogue replaces nothing
                        catalog.read_catalog(path)

                replace_file(target, write)
    except catalog.CatalogError as error:
        raise FetchError(f"{archive}: {family}/{catalog.FILE} is no catalogue: {error}") from None
    # zipfile raises these for an archive that is damaged, encrypted or packed in another way
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise FetchError(f"{archive}: is no archive that can be unpacked: {error}") from None


def _check(archive: Path, entries: Sequence[zipfile.ZipInfo], folder: Path, family: str) -> None:
    """FetchError if an archive holds a file that is not of the family, or is far too large."""
    for entry in entries:
        target = (folder / entry.filename).resolve()
        inside = target.is_relative_to((folder / family).resolve())
        if not (inside and entry.filename.startswith(f"{family}/")):
            raise FetchError(f"{archive}: {entry.filename!r} leads out of the folder {family}")
    if f"{family}/{catalog.FILE}" not in {entry.filename for entry in entries}:
        raise FetchError(
            f"{archive}: has no {family}/{catalog.FILE}, and is no archive of that family"
        )
    size, whole = archive.stat().st_size, sum(entry.file_size for entry in entries)
    if whole > UNPACKED * size:
        raise FetchError(
            f"{archive}: has {size} bytes, and its files would have {whole}, more than {UNPACKED}"
            " times as many: nothing of it is unpacked"
        )
