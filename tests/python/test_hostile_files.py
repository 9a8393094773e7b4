"""Files from elsewhere, made to do more than be read: SECURITY.md says what they may do."""

from __future__ import annotations

import http.client
import os
import resource
import shutil
import socket
import sqlite3
import subprocess
import sys
import threading
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import fclib
import helpers_cli
from fclib import _core, _registry, bench
from fclib.bench.job import Limits, Record, SolverChoice
from fclib.collections import catalog
from helpers import planted_local, ran
from helpers_bench import facts_of
from helpers_report import read_data, skip_without_libraries

pytest.importorskip("pyarrow")
skip_without_libraries()
ESCAPE = "\x1b]0;stolen\x07\x1b[2J\x9b31m"


@pytest.fixture
def problem(tmp_path: Path) -> Path:
    path = tmp_path / "one.hdf5"
    fclib.write(path, planted_local(1).problem)
    return path


def store_of(path: Path, solver: SolverChoice, message: str = "", **facts: Any) -> Path:
    """A store of one run, by a solver of this name."""
    known = facts_of(**{"hash": "h", "name": "p", "family": "f", "title": "t", **facts})
    job = bench.Job(known, solver, 1e-4, Limits(1.0, 1.0, 100.0), 0, 1)
    record = Record("converged", message, cpu_s=0.1, iterations=3, merits={"error": 1e-5})
    record.machine = {"node": "here"}
    with bench.Store(path) as store:
        store.add(job, record, store.begin("c", "", 1, 0, "here"))
    return path


# ---- no name is resolved to code


def commands_on(store: Path, folder: Path) -> list[list[object]]:
    """All commands that read a store."""
    found: list[list[object]] = [
        ["profile", store],
        ["profile", store, "--out", folder / "figures", "--format", "svg"],
        ["bench", "--status", store],
        ["bench", "export", store, folder / "runs.csv"],
        ["bench", "merge", folder / "merged.sqlite", store],
        ["report", store, "--out", folder / "paper", "--pdf"],
        ["report", store, "--out", folder / "site"],
        ["report", store, store, "--out", folder / "sites"],
    ]
    return found


@pytest.fixture
def stolen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The name of a solver whose code leaves a mark when it is loaded."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("needs a C compiler")
    mark, source = tmp_path / "mark", tmp_path / "libx.c"
    source.write_text(
        "#include <stdio.h>\n__attribute__((constructor)) static void ran(void)"
        f'{{ FILE* f = fopen("{mark}", "w"); if (f) fclose(f); }}\n'
    )
    library = source.with_suffix(".so")
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, source], check=True)
    yield f"plugin:{library}"
    assert not mark.exists()


def test_no_command_loads_or_asks_for_a_solver_that_a_store_names(
    stolen: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def asked(name: str) -> Any:
        raise AssertionError(f"asked for {name}")

    store = store_of(tmp_path / "runs.sqlite", SolverChoice(stolen, {}, label="theirs"))
    store_of(store, SolverChoice("nsgs", {}))
    monkeypatch.setattr(_registry, "find_solver", asked)
    monkeypatch.setattr(_core, "find_solver", asked)
    for command in commands_on(store, tmp_path):
        done = helpers_cli.run(*command, code=None)
        assert "Traceback" not in done.stderr
    assert (tmp_path / "site" / "index.html").is_file()


def test_a_campaign_that_goes_on_takes_no_solver_from_its_store(
    stolen: str, problem: Path, tmp_path: Path
) -> None:
    store = tmp_path / "runs.sqlite"
    arguments = ["bench", "--problems", problem, "--solver", "nsgs", "--store", store]
    helpers_cli.run(*arguments)
    with bench.Store(store) as opened:
        opened.db.execute("UPDATE solvers SET name = ?, label = ?", (stolen, stolen))
        opened.db.execute("UPDATE campaigns SET text = ?", (f'solvers = ["{stolen}"]',))
        opened.db.execute("DELETE FROM runs")
        opened.seal()
    helpers_cli.run(*arguments)


def test_a_solver_of_ones_own_has_its_page(problem: Path, tmp_path: Path) -> None:
    module = tmp_path / "mine.py"
    module.write_text(
        '''
from typing import Annotated
import fclib

@fclib.solver("mine", family="own", title="My own", citation="Alart & Curnier 1991; me")
def mine(problem, r, monitor, *, step: Annotated[float, fclib.Option("a step", unit="kg")] = 0.5):
    """Nothing."""
    monitor.stop(r)
'''
    )
    store = tmp_path / "runs.sqlite"
    helpers_cli.run(
        *("bench", "--problems", problem, "--solver", "mine", "--module", module, "--store", store)
    )
    # elsewhere, where there is no such solver
    code = (
        f"import fclib.cli, sys; sys.argv = {['fclib', 'report', str(store)]!r}; fclib.cli.main()"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path, capture_output=True)
    (solver,) = read_data(tmp_path / "site", "site")["solvers"]
    assert (solver["title"], solver["family"], solver["origin"]) == ("My own", "own", "mine")
    assert solver["citation"] == "Alart & Curnier 1991; me"
    assert solver["known"] == [["step", "float", "0.5", "kg", "a step"]]
    assert [paper["key"] for paper in solver["papers"]] == ["alart1991"]


def test_what_solvers_say_of_themselves_may_be_edited(tmp_path: Path) -> None:
    store = tmp_path / "runs.sqlite"
    for k, about in enumerate(("{", "[1]", '{"options": 3}', '{"title": 1, "options": [2]}', "")):
        store_of(store, SolverChoice("nsgs", {"relaxation": 1 + k / 10}, about=about))
    with bench.Store(store) as opened:
        assert len(opened.results()) == 5
        opened.db.execute("UPDATE solvers SET options = '{' WHERE about = ''")
        opened.db.execute("UPDATE campaigns SET text = '[[['")
        opened.db.execute("INSERT INTO certificates (run, certificate) VALUES (1, '[]')")
        opened.seal()
    for command in commands_on(store, tmp_path)[:-1]:
        assert "Traceback" not in helpers_cli.run(*command).stderr


FOREIGN = {
    "trigger": "CREATE TRIGGER away AFTER INSERT ON runs BEGIN DELETE FROM runs; END",
    "endless view": "DROP TABLE runs; CREATE VIEW runs AS WITH RECURSIVE n(id) AS (SELECT 1 UNION "
    "ALL SELECT id + 1 FROM n) SELECT id FROM n",
    "another view": "CREATE VIEW more AS SELECT * FROM runs",
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_what_a_store_would_run_is_refused(kind: str, tmp_path: Path) -> None:
    """A trigger deletes what a campaign has run, and a view may have no end."""
    path = store_of(tmp_path / "runs.sqlite", SolverChoice("nsgs", {}))
    with sqlite3.connect(path) as database:
        database.executescript(FOREIGN[kind])
    before = path.read_bytes()
    with pytest.raises(bench.StoreError, match="which no store has"):
        bench.Store(path)
    for command in commands_on(path, tmp_path):
        done = helpers_cli.run(*command, code=None)
        assert done.returncode != 0
        assert "Traceback" not in done.stderr
    assert path.read_bytes() == before


# ---- catalogues


def catalogue(folder: Path, **changes: Any) -> Path:
    """A collection of one problem, whose row says something else."""
    own = folder / "set" / "Family"
    own.mkdir(parents=True)
    fclib.write(own / "0000-local.hdf5", planted_local(1).problem)
    row: dict[str, Any] = {name: None for name, *_ in catalog.COLUMNS}
    row |= {"id": "set/Family/0000", "collection": "set", "family": "Family", "number": 0}
    row |= {"digest": "d", "formulation": "3DFC", "spacedim": 3, "nc": 1}
    row |= {"local_file": "set/Family/0000-local.hdf5"}
    row["local_sha256"] = catalog.sha256(folder / row["local_file"])
    catalog.write_catalog(folder / catalog.FILE, [row | changes])
    return folder


@pytest.mark.parametrize(
    "changes",
    [
        {"local_file": "../secret.hdf5"},
        {"local_file": "set/../../secret.hdf5"},
        {"local_file": "set/Family/../../../secret.hdf5"},
        {"global_file": "{folder}/secret.hdf5"},
        {"collection": ".."},
        {"collection": "../../up"},
        {"family": "../../../up"},
        {"family": "/tmp/up"},
    ],
)
def test_no_path_of_a_catalogue_leads_out_of_it(changes: dict[str, str], tmp_path: Path) -> None:
    fclib.write(tmp_path / "secret.hdf5", planted_local(1).problem)
    digest = catalog.sha256(tmp_path / "secret.hdf5")
    changes = {key: value.format(folder=tmp_path) for key, value in changes.items()}
    if "global_file" in changes or "local_file" in changes:
        changes |= {f"{next(iter(changes)).partition('_')[0]}_sha256": digest}
    folder = catalogue(tmp_path / "theirs", **changes)
    inside = folder / "set" / "Family" / "scene.png"
    inside.write_bytes(b"picture")
    (tmp_path / "made").mkdir()
    before = sorted(path for path in tmp_path.rglob("*"))
    for command in (
        ["report", "--catalog", folder, "--out", tmp_path / "made" / "site", "--with-files"],
        ["collection", "verify", folder],
        ["collection", "publish", folder, "--out", tmp_path / "made" / "server"],
    ):
        done = helpers_cli.run(*command, code=None)
        assert done.returncode != 0
        assert "leads out of the catalogue's folder" in " ".join(done.stderr.split())
        assert repr(next(iter(changes.values()))) in " ".join(done.stderr.split())
    after = sorted(path for path in tmp_path.rglob("*") if "made/" not in str(path))
    assert before == after


def test_a_catalogue_of_other_types_is_none(tmp_path: Path) -> None:
    folder = catalogue(tmp_path / "theirs")
    pq = pytest.importorskip("pyarrow.parquet")
    table = pq.read_table(folder / catalog.FILE)
    for name in ("version", "global_file", "collection", "nc", "id"):
        other = table.set_column(table.column_names.index(name), name, [[[{"a": [1.5]}]]])
        pq.write_table(other, folder / catalog.FILE)
        for command in (
            ["collection", "verify", folder],
            ["report", "--catalog", folder, "--out", tmp_path / "site"],
        ):
            done = helpers_cli.run(*command, code=1)
            assert f"column {name}: is no" in " ".join(done.stderr.split())


# ---- archives


def publish(site: Path, *entries: tuple[str, bytes], name: str = "set-Family.zip") -> str:
    """A server's folder with an archive of these files."""
    site.mkdir()
    with zipfile.ZipFile(site / name, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, content in entries:
            archive.writestr(path, content)
    (site / "registry.txt").write_text(f"{name} sha256:{catalog.sha256(site / name)}\n")
    return str(site)


def part_of(tmp_path: Path) -> bytes:
    """A catalogue as an archive has it."""
    return (catalogue(tmp_path / "part") / catalog.FILE).read_bytes()


def get(url: str, folder: Path, name: str = "set/Family") -> subprocess.CompletedProcess[str]:
    done = helpers_cli.run("collection", "get", name, "--from", url, "--out", folder, code=None)
    assert "Traceback" not in done.stderr
    assert done.stderr.count("\n") <= 2 or done.returncode == 0
    return done


def test_an_archive_that_fills_the_disk_is_not_unpacked(tmp_path: Path) -> None:
    pytest.importorskip("pooch")
    part = part_of(tmp_path)
    large = ("set/Family/0000-local.hdf5", bytes(100_000_000))
    url = publish(tmp_path / "site", large, ("set/Family/catalog.parquet", part))
    done = get(url, tmp_path / "mine")
    assert done.returncode == 1
    assert "nothing of it is unpacked" in " ".join(done.stderr.split())
    assert not list((tmp_path / "mine").rglob("*.hdf5"))


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ([("set/Family/0000-local.hdf5", b"x")], "has no set/Family/catalog.parquet"),
        ([("set/Family/catalog.parquet", b"x")], "is no catalogue"),
        ([("set/Other/catalog.parquet", b"x")], "leads out of the folder set/Family"),
        ([("../up", b"x")], "leads out of the folder"),
        ([("/tmp/up", b"x")], "leads out of the folder"),
        ([("set/Family/../../up", b"x")], "leads out of the folder"),
    ],
)
def test_what_is_no_archive_of_a_family_is_said(
    entries: list[tuple[str, bytes]], words: str, tmp_path: Path
) -> None:
    pytest.importorskip("pooch")
    done = get(publish(tmp_path / "site", *entries), tmp_path / "mine")
    assert done.returncode == 1
    assert words in " ".join(done.stderr.split())
    assert not list((tmp_path / "mine").rglob("catalog.parquet"))
    assert not (tmp_path / "up").exists()


def test_an_archive_that_is_damaged_is_said(tmp_path: Path) -> None:
    pytest.importorskip("pooch")
    url = publish(tmp_path / "site", ("set/Family/catalog.parquet", part_of(tmp_path)))
    path = Path(url) / "set-Family.zip"
    whole = path.read_bytes()
    for place in range(0, len(whole), 37):
        data = bytearray(whole)
        data[place] ^= 0xFF
        path.write_bytes(data)
        (Path(url) / "registry.txt").write_text(f"{path.name} sha256:{catalog.sha256(path)}\n")
        done = get(url, tmp_path / f"mine-{place}")
        assert done.returncode in (0, 1)
    (Path(url) / "registry.txt").write_bytes(b"\xff\xfe nothing\n")
    assert "is no registry" in get(url, tmp_path / "other").stderr
    (Path(url) / "registry.txt").write_text(f"../set-Family.zip sha256:{'0' * 64}\n")
    assert "is no name of a file" in " ".join(get(url, tmp_path / "other").stderr.split())


# ---- full disks, odd names


def limited() -> None:
    """No file may be larger, as on a full disk."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))


def test_a_full_disk_is_one_line(problem: Path, tmp_path: Path) -> None:
    whole = store_of(tmp_path / "whole.sqlite", SolverChoice("nsgs", {}))
    store = tmp_path / "runs.sqlite"
    commands: list[list[object]] = [
        ["bench", "--problems", problem, "--solver", "nsgs", "--store", store, "--repeats", 300],
        ["bench", "merge", store, whole],
        ["report", whole, "--out", tmp_path / "site"],
        ["profile", whole, "--out", tmp_path / "figures"],
        ["solve", problem, "--out", tmp_path / "solved.hdf5"],
    ]
    said = []
    for command in commands:
        done = ran(sys.executable, "-m", "fclib", *command, code=None, preexec_fn=limited)
        assert "Traceback" not in done.stderr, done.stderr
        if done.returncode:
            said.append(done.stderr)
    assert len(said) >= 3
    assert "runs.sqlite: cannot be written further: the disk is full" in " ".join(said[0].split())
    assert "the same command again" in " ".join(said[0].split())
    # with room again it goes on
    helpers_cli.run(*commands[0][:-2])


def test_a_name_that_is_no_text(tmp_path: Path) -> None:
    odd = Path(os.fsdecode(os.fsencode(tmp_path) + b"/odd-\xff\xe9.hdf5"))
    plain = tmp_path / "plain.hdf5"
    fclib.write(plain, planted_local(1).problem)
    shutil.copy(plain, odd)
    store = tmp_path / "runs.sqlite"
    commands: list[list[object]] = [
        ["info", odd],
        ["check", odd],
        ["solve", odd],
        ["solve", odd, "--json"],
        ["analyze", odd],
        ["convert", odd, tmp_path / "copy.hdf5"],
        ["convert", plain, odd.with_stem(odd.stem + "-2")],
        ["view", odd, "--out", tmp_path / "page.html"],
        ["bench", "--problems", tmp_path, "--solver", "nsgs", "--store", store],
        ["bench", "--problems", odd, "--solver", "nsgs", "--store", odd.with_suffix(".sqlite")],
        ["profile", odd.with_suffix(".sqlite")],
        ["profile", store],
        ["report", store, "--out", tmp_path / "site"],
        ["report", store, "--out", odd.with_suffix("")],
    ]
    for command in commands:
        done = helpers_cli.run(*command, code=None)
        if done.returncode:
            assert "odd-" in done.stderr, (command, done.stderr)


# ---- the terminal


def test_no_text_of_a_file_steers_the_terminal(tmp_path: Path) -> None:
    odd = tmp_path / f"odd{ESCAPE}.hdf5"
    problem = planted_local(1).problem.replace(info=fclib.ProblemInfo(title=ESCAPE))
    fclib.write(odd, problem)
    solver = SolverChoice(f"solver{ESCAPE}", {}, version=ESCAPE, family=ESCAPE, label=ESCAPE)
    store = store_of(
        tmp_path / "runs.sqlite", solver, ESCAPE, name=ESCAPE, family=ESCAPE, title=ESCAPE
    )
    with bench.Store(store) as opened:
        opened.db.execute("UPDATE runs SET status = ?", (ESCAPE,))
        opened.db.execute("UPDATE machines SET node = ?, cpu = ?", (ESCAPE, ESCAPE))
        opened.db.execute("UPDATE campaigns SET name = ?, node = ?", (ESCAPE, ESCAPE))
        opened.seal()
    theirs = tmp_path / f"no{ESCAPE}.sqlite"
    theirs.write_bytes(b"nothing")
    commands: list[list[object]] = [
        *commands_on(store, tmp_path)[:5],
        ["info", odd],
        ["check", odd],
        ["solve", odd, odd],
        ["solve", tmp_path / f"none{ESCAPE}.hdf5"],
        ["profile", theirs],
        ["profile", store, "--solver", "other"],
        ["solvers", ESCAPE],
        ["collection", "verify", tmp_path / ESCAPE],
    ]
    for command in commands:
        done = helpers_cli.run(*command, code=None)
        for text in (done.stdout, done.stderr):
            assert not {"\x1b", "\x07", "\x9b"} & set(text), (command, text)


# ---- the server of a site


@pytest.fixture
def served(tmp_path: Path) -> Iterator[int]:
    from fclib.report.serving import server

    folder = tmp_path / "site"
    (folder / "data").mkdir(parents=True)
    (folder / "index.html").write_text("here")
    (folder / "data" / "site.js").write_text("here")
    (tmp_path / "secret").write_text("secret")
    (folder / "out").symlink_to(tmp_path)
    (folder / "secret").symlink_to(tmp_path / "secret")
    (folder / "inside").symlink_to(folder / "index.html")
    with server(folder) as running:
        thread = threading.Thread(target=running.serve_forever, daemon=True)
        thread.start()
        yield running.server_port
        running.shutdown()
        thread.join()


@pytest.mark.parametrize("method", ["GET", "HEAD"])
@pytest.mark.parametrize(
    ("path", "host", "status"),
    [
        ("/", "127.0.0.1", 200),
        ("/index.html", "localhost", 200),
        ("/data/site.js", "127.0.0.1", 200),
        ("/inside", "127.0.0.1", 200),
        ("/index.html", "evil.example", 403),
        ("/index.html", "", 403),
        ("/secret", "127.0.0.1", 404),
        ("/out/secret", "127.0.0.1", 404),
        ("/out/", "127.0.0.1", 404),
        ("/data/", "127.0.0.1", 404),
        ("/data/%00", "127.0.0.1", 404),
        ("/../secret", "127.0.0.1", 404),
        ("/%2e%2e/secret", "127.0.0.1", 404),
    ],
)
def test_the_server_gives_a_site_to_its_own_pages_alone(
    served: int, method: str, path: str, host: str, status: int
) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", served, timeout=20)
    named = f"{host}:{served}" if host else "evil.example"
    connection.request(method, path, headers={"Host": named})
    answer = connection.getresponse()
    assert answer.status == status
    assert b"secret" not in answer.read()
    connection.close()


def test_a_request_without_a_host_is_refused(served: int) -> None:
    with socket.create_connection(("127.0.0.1", served), timeout=20) as raw:
        raw.sendall(b"GET /index.html HTTP/1.0\r\n\r\n")
        assert b" 403 " in raw.makefile("rb").readline()


def test_old_readers_of_parquet_are_refused() -> None:
    """14.0.0 runs what a file says."""
    text = (Path(__file__).parents[2] / "pyproject.toml").read_text()
    assert text.count("pyarrow>=14.0.1") == text.count("pyarrow>=") == 3
