"""Pages of the report that check and solve their problem in a browser, served to this machine."""

from __future__ import annotations

import base64
import os
import re
import shutil
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp

import browser_module
import fclib
import golden_work
from capi_library import HEADERS, ROOT, compiler, library_folder
from fclib.bench import Store, supervisor
from fclib.bench.job import Job, Limits, Record, SolverChoice
from fclib.bench.problems import look
from fclib.collections import catalog
from fclib.report import Campaigns, ReportError, browser, build_site
from fclib.report.solids import solids_of
from fclib.report.view import view_of
from helpers import planted_global, planted_local
from helpers_browser import chromium, served
from helpers_cli import invoke
from helpers_report import read_data, skip_without_libraries

pytest.importorskip("pyarrow")
skip_without_libraries()
TOWER = "#/problem/tiny/KaplasTower/0030"


@pytest.fixture(scope="module")
def catalogue(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tower of `tiny`, as a collection."""
    folder = tmp_path_factory.mktemp("tower") / "collection"
    family = folder / "tiny" / "KaplasTower"
    shutil.copytree(golden_work.TINY / "KaplasTower", family)
    shutil.copy(family / "catalog.parquet", folder)
    return folder


@pytest.fixture(scope="module")
def module() -> Path:
    try:
        folder = browser.find(browser_module.FOLDER)
    except ReportError as error:
        pytest.skip(str(error))
    assert folder is not None
    return folder


@pytest.fixture(scope="module")
def site(catalogue: Path, module: Path) -> Path:
    folder = catalogue.parent / "a site #1"
    build_site(None, folder, catalogue, with_files=True, views=0, module=module)
    return folder


def test_a_site_without_the_module_says_so(
    catalogue: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(browser, "BUILT", tmp_path / "none")
    out = tmp_path / "site"
    words = ["report", "--catalog", str(catalogue), "--out", str(out), "--views", "0"]
    done = invoke(*words, "--with-files")
    assert "do not check and solve problems" in done.output
    assert read_data(out, "site")["module"] == 0
    assert not (out / browser.PLACE).exists()
    # what a file's solution is worth stands there in full
    first = read_data(out, "files/0")[0]["files"][0]
    assert first["merit"]["error"] < 1e-8
    done = invoke(*words, "--with-files", "--browser", tmp_path, code=1)
    assert "has no fclib.js; make wasm builds such a folder" in " ".join(done.output.split())
    done = invoke(*words, "--browser", tmp_path, code=1)
    assert "say --with-files" in done.output


def test_what_is_no_site_is_not_served(tmp_path: Path) -> None:
    done = invoke("report", "--serve", "--out", tmp_path, code=1)
    assert "is no site" in done.output


def test_a_site_is_served_until_an_interrupt(site: Path) -> None:
    words = [sys.executable, "-m", "fclib", "report", "--serve", "--out", str(site)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        found = re.match(r"(http://127\.0\.0\.1:\d+/) ", process.stdout.readline())
        assert found is not None
        types = {}
        for name in ("fclib-core.wasm", "fclib-core.mjs", "fclib.js"):
            with urllib.request.urlopen(f"{found[1]}{browser.PLACE}/{name}") as answer:
                types[name.rpartition(".")[2]] = answer.headers["Content-Type"]
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
    assert types == {"wasm": "application/wasm", "mjs": "text/javascript", "js": "text/javascript"}


@pytest.fixture(scope="module")
def window() -> Iterator[Any]:
    with chromium() as started:
        yield started


@contextmanager
def opened(window: Any, address: str, width: int = 390) -> Iterator[Any]:
    """A page of this machine in Chromium: no error on its console, no request to another host."""
    host = re.match(r"http://127\.0\.0\.1:\d+/", address)
    assert host is not None
    # of a context of its own, which it closes
    with window.new_page(viewport={"width": width, "height": 800}) as page:
        page.set_default_timeout(20_000)
        wrong: list[str] = []
        # Chromium warns of the speed of its own drawing, where a page has WebGL
        page.on(
            "console",
            lambda message: (
                None
                if message.type == "warning"
                else wrong.append(f"{message.text} ({message.location['url']})")
            ),
        )
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on(
            "request",
            lambda request: (
                None
                if request.url.startswith((host[0], "data:", "file:"))
                else wrong.append(request.url)
            ),
        )
        page.goto(address)
        yield page
    assert not wrong


@pytest.fixture
def page(site: Path, window: Any) -> Iterator[Any]:
    """The tower's page, as wide as a phone."""
    with served(site) as address, opened(window, address + TOWER) as page:
        yield page


@pytest.mark.slow
def test_a_tower_is_checked_and_solved_on_its_page(page: Any, site: Path) -> None:
    page.get_by_role("button", name="Check it here").click()
    checked = page.locator("table", has_text="compared").locator("tbody tr")
    checked.first.wait_for()
    stored = read_data(site, "files/0")[0]["files"][0]["merit"]
    assert checked.count() == len(stored) == 12
    words = [str(row).split("\t")[3].strip() for row in checked.all_inner_texts()]
    assert words == ["equal to 1e-12"] * 12

    # another stored value is told, and so is another file
    page.evaluate(
        """const [first, second] = Fclib.values["files/0"][0].files;
        first.merit.natural += 1e-9;
        second.sha256 = "0";"""
    )
    page.get_by_role("button", name="Check it here").click()
    page.get_by_text("differs by 1e-9").wait_for()
    form = page.locator("select", has_text="local form")
    form.select_option("1")
    page.get_by_role("button", name="Check it here").click()
    page.get_by_text("is another file than when the site was made").wait_for()
    form.select_option("0")

    page.get_by_role("button", name="Solve it here").click()
    start = page.get_by_role("button", name="Start")
    stop = page.get_by_role("button", name="Stop")
    rows = page.locator("table", has_text="time [s]").locator("tbody tr")

    def newest() -> list[str]:
        return [str(cell).strip() for cell in rows.first.locator("th, td").all_inner_texts()]

    # its options come from the solver's list, with units and bounds, and are heard
    solvers = page.locator("select:has(option[value=nsgs])").first
    solvers.select_option("nsgs")
    page.get_by_text("Options of nsgs").click()
    relaxation = page.get_by_label("relaxation", exact=True)
    lowest, highest = relaxation.get_attribute("min"), relaxation.get_attribute("max")
    option = next(one for one in fclib.find_solver("nsgs").options if one.name == "relaxation")
    assert (float(lowest), float(highest)) == (option.lowest, option.highest)
    relaxation.fill(str(2 * option.highest))
    start.click()
    with pytest.raises(fclib.OptionError) as refused:
        fclib.solve(planted_local(1).problem, "nsgs", relaxation=2 * option.highest)
    page.get_by_text(str(refused.value)).wait_for()
    solvers.select_option("auto")

    for count, solver in enumerate(("auto", "nsgs", "admm")):
        solvers.select_option(solver)
        start.click()
        page.get_by_text(re.compile(f"^{solver}: converged after")).wait_for()
        rows.nth(count).wait_for()
        found = newest()
        assert found[:3] == [solver, "1e-8", "converged"]
        assert float(found[5]) <= 1e-8
    assert page.locator("svg.curve polyline").get_attribute("points")

    # without an end: it is watched and stopped, and the page lives on
    page.get_by_label("tolerance", exact=True).fill("0")
    page.get_by_label("iterations", exact=True).fill("100000000")
    page.evaluate(
        r"""let told = new Set();
        window.before = document.querySelector("figure.live").drawn;
        new MutationObserver(() => {
          const named = (text) => [...document.querySelectorAll("main button")]
            .find((one) => one.textContent === text);
          const now = document.querySelector("main").textContent.match(/iteration \d+, error/);
          if (now) told.add(now[0]);
          if (told.size > 9 && !named("Stop").disabled) named("Stop").click();
        }).observe(document.querySelector("main"), { childList: true, subtree: true })"""
    )
    start.click()
    page.get_by_text(re.compile("admm: interrupted after")).wait_for()
    rows.nth(3).wait_for()
    found = newest()
    assert found[2] == "interrupted"
    # the picture followed the iterates
    assert page.evaluate("document.querySelector('figure.live').drawn - before") > 5
    assert float(found[5]) > 0
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")

    # what is no number is said, and nothing runs
    page.get_by_label("time limit [s]", exact=True).fill("")
    start.click()
    page.get_by_text("time limit [s]: not a number of at least 0.1").wait_for()
    assert stop.is_disabled()

    # a folder of files: the page says how to serve it
    page.goto((site / "index.html").as_uri() + TOWER)
    page.get_by_text(f"fclib report --serve --out '{site}'").wait_for()
    assert page.get_by_role("button", name="Check it here").count() == 0


def move(page: Any, slider: str, values: list[float]) -> None:
    """Drag a slider of the panel through values, one a picture of the screen."""
    page.locator(f".what-if input[aria-label^='{slider}']").evaluate(
        """async (input, values) => {
          for (const value of values) {
            input.value = value;
            input.dispatchEvent(new Event("input"));
            await new Promise(requestAnimationFrame);
          }
        }""",
        values,
    )


def counts(page: Any) -> dict[str, int]:
    """The contacts of each status that the panel tells, once it has followed."""
    page.wait_for_function("document.querySelector('.what-if')?.ariaBusy === 'false'")
    said = page.locator(".what-if [role=status]").inner_text()
    return {name: int(count) for count, name in re.findall(r"(\d+) (open|stick|slide)", said)}


@pytest.mark.slow
def test_a_tower_slides_where_friction_is_taken_from_it(page: Any) -> None:
    page.get_by_role("button", name="What if").click()
    page.locator(".what-if").wait_for()
    at_rest = counts(page)
    assert at_rest == {"open": 0, "stick": 144, "slide": 0}
    move(page, "turn of f, from z to x", [2, 4, 6, 8, 10, 12])
    turned = counts(page)
    move(page, "μ", [0.7 - 0.02 * k for k in range(31)])
    slippery = counts(page)
    assert sum(slippery.values()) == 144
    assert slippery["slide"] > turned["slide"] + 50

    # so it does natively; reactions are not unique here, and a status is its reaction's
    problem: Any = fclib.read(golden_work.TINY / "KaplasTower" / "0030-global.hdf5")
    f = problem.f.copy().reshape(-1, 6)
    angle = np.radians(12)
    x, z = f[:, 0].copy(), f[:, 2].copy()
    f[:, 0], f[:, 2] = np.cos(angle) * x + np.sin(angle) * z, np.cos(angle) * z - np.sin(angle) * x
    changed = problem.replace(f=f.ravel(), mu=np.full(144, 0.1))
    status = list(fclib.contact_merits(changed, fclib.solve(changed).solution)["status"])
    assert min(slippery["slide"], status.count("slide")) > turned["slide"] + 50

    # one contact alone, a gap that opens it, a load without weight
    page.get_by_role("button", name="Reset").click()
    assert counts(page) == at_rest
    page.get_by_label("μ and gap of contact").fill("5")
    move(page, "gap over time step", [200])
    assert counts(page)["open"] >= 1
    page.get_by_role("button", name="Reset").click()
    move(page, "size of f", [0])
    counts(page)
    page.get_by_label("μ and gap of contact").fill("144")
    page.get_by_text("there is none of the number 144; they go from 0 to 143").wait_for()
    assert page.evaluate("document.querySelector('figure.live').drawn") > 10
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def drop(page: Any, path: Path) -> None:
    """Drag a file over the page and drop it, as a person does."""
    files = page.evaluate_handle(
        """([name, data]) => {
          const bytes = Uint8Array.from(atob(data), (one) => one.charCodeAt(0));
          const files = new DataTransfer();
          files.items.add(new File([bytes], name));
          return files;
        }""",
        [path.name, base64.b64encode(path.read_bytes()).decode()],
    )
    place = page.locator(".drop")
    place.dispatch_event("dragover", {"dataTransfer": files})
    assert "over" in str(place.get_attribute("class"))
    place.dispatch_event("drop", {"dataTransfer": files})


@pytest.mark.slow
def test_a_file_of_ones_own_is_read_drawn_and_solved(page: Any, tmp_path: Path) -> None:
    page.get_by_role("link", name="Your file").click()
    page.get_by_role("heading", name="Your own file").wait_for()
    chooser = page.locator("input[type=file]")
    start = page.get_by_role("button", name="Start")
    formulations = set()
    for path in sorted(golden_work.TINY.glob("*/*.hdf5")):
        problem: Any = fclib.read(path)
        chooser.set_input_files(path)
        facts = page.locator("dl.facts", has_text=path.name)
        facts.wait_for()
        words = dict(re.findall(r"(.+)\n(.+)", facts.inner_text()))
        assert words["formulation"] == problem.formulation
        assert int(words["contacts"]) == problem.nc
        formulations.add(problem.formulation)
        assert page.locator("figure.live canvas").count() == 1
        # each is judged, solved and changed
        page.get_by_role("button", name="Check it here").click()
        merits = page.locator("table", has_text="The solution of the file").locator("tbody tr")
        merits.first.wait_for()
        page.get_by_role("button", name="Solve it here").click()
        start.click()
        page.get_by_text(re.compile("^auto: converged after")).wait_for()
        page.get_by_role("button", name="What if").click()
        page.locator(".what-if").wait_for()
        assert sum(counts(page).values()) == problem.nc
    assert len(formulations) == 10

    # one that is dropped on the page
    path = golden_work.TINY / "KaplasTower" / "0030-local.hdf5"
    drop(page, path)
    page.locator("dl.facts", has_text=path.name).wait_for()
    assert "over" not in str(page.locator(".drop").get_attribute("class"))

    # a text of Siconos, a file of several problems, and what is none
    local, whole = planted_local(3), planted_global(3)
    text = tmp_path / "text.dat"
    fclib.write_siconos(text, local.problem)
    chooser.set_input_files(text)
    page.locator("dl.facts", has_text="text.dat").wait_for()
    bad = tmp_path / "bad.hdf5"
    for content in (b"3 2 0 six", b"\x89HDF", path.read_bytes()[:700]):
        bad.write_bytes(content)
        with pytest.raises(fclib.Error) as native:
            (fclib.read if content[0] == 0x89 else fclib.read_siconos)(bad)
        chooser.set_input_files(bad)
        message = str(native.value).replace(str(bad), bad.name)
        page.get_by_text(message, exact=True).wait_for()
    both = tmp_path / "both.hdf5"
    fclib.write(both, whole.problem, whole.solution)
    chooser.set_input_files(both)
    page.get_by_role("button", name="Check it here").click()
    page.locator("table", has_text="of the file: its merits").locator("tbody tr").first.wait_for()
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def write_as_3_1(path: Path, problem: Any, solution: fclib.Solution) -> None:
    """What libfclib 3.1 writes: the first format of HDF5, nothing packed."""
    with h5py.File(path, "w", libver="earliest") as file:
        group = file.create_group(f"fclib_{problem.kind}")
        group["spacedim"] = np.array([problem.spacedim], "i4")
        group["info/title"] = np.bytes_(b"of 3.1")
        for name, member in problem.__getstate__().items():
            if sp.issparse(member):
                a = browser_module.matrix(member)
                nnz = len(a["x"])
                nz = {"csc": -1, "csr": -2}.get(a["storage"], nnz)
                for key, number in {"nzmax": nnz, "m": a["rows"], "n": a["cols"], "nz": nz}.items():
                    group[f"{name}/{key}"] = np.array([number], "i4")
                for key, numbers in {"p": a["p"], "i": a["i"]}.items():
                    group[f"{name}/{key}"] = numbers.astype("i4")
                group[f"{name}/x"] = a["x"]
            elif isinstance(member, np.ndarray):
                group[f"vectors/{name}"] = member
        file["guesses/number_of_guesses"] = np.array([1], "i4")
        for name in ("v", "u", "r", "l"):
            values = getattr(solution, name)
            if values is not None:
                file[f"solution/{name}"] = file[f"guesses/1/{name}"] = values


def written_by_3_1(path: Path, folder: Path) -> list[Path]:
    """The same by Debian's libfclib, where it is installed."""
    header = Path("/usr/include/fclib.h")
    if not header.is_file() or "FCLIB_VERSION_MAJOR" in header.read_text():
        return []
    theirs = next(Path("/usr/lib").rglob("libfclib.so.0"))
    source = ROOT / "workshop/tables/files_against_libfclib.c"
    program, written = folder / "copy", folder / f"{path.stem} by 3.1.hdf5"
    build = [compiler("C"), f"-I{HEADERS}", "-o", str(program), str(source), "-ldl"]
    subprocess.run(build, check=True)
    ours = library_folder() / "libfclib.so.0"
    subprocess.run([program, "copy", theirs, ours, path, written, folder / "ours.hdf5"], check=True)
    return [written]


@pytest.mark.slow
def test_files_of_libfclib_3_1_and_texts_are_seen_and_solved(page: Any, tmp_path: Path) -> None:
    files: list[Path] = []
    for made in (planted_local(5, nc=4), planted_global(5, nc=4, p=1)):
        own = tmp_path / f"{made.problem.kind}.hdf5"
        write_as_3_1(own, made.problem, made.solution)
        files += [own, *written_by_3_1(own, tmp_path)]
    text = tmp_path / "text.dat"
    fclib.write_siconos(text, planted_global(6, nc=3).problem)

    page.get_by_role("link", name="Your file").click()
    page.get_by_role("heading", name="Your own file").wait_for()
    for path in (*files, text):
        problem: Any = fclib.read_siconos(path) if path == text else fclib.read(path)
        drop(page, path)
        facts = page.locator("dl.facts", has_text=path.name)
        facts.wait_for()
        words = dict(re.findall(r"(.+)\n(.+)", facts.inner_text()))
        assert words["formulation"] == problem.formulation
        assert int(words["contacts"]) == problem.nc
        assert int(words["islands"]) == problem.islands().count
        if path != text:
            assert words["title"] == "of 3.1"
            assert words["guesses"] == "1"
            assert float(words["error of its solution"]) < 1e-12
            page.get_by_role("button", name="Check it here").click()
            page.locator("table", has_text="The solution of the file").wait_for()
        assert page.locator("figure.live canvas").count() == 1
        page.get_by_role("button", name="Solve it here").click()
        page.get_by_role("button", name="Start").click()
        page.get_by_text(re.compile("^auto: converged after")).wait_for()

    # damaged: cut short, without a part, with one that is wrong
    bad = tmp_path / "bad.hdf5"

    def lose(file: Any) -> None:
        del file["fclib_local/vectors/mu"]

    def spoil(file: Any) -> None:
        file["fclib_local/W/p"][1] = 1000

    for path in files[: len(files) // 2]:
        for damage in (None, lose, spoil):
            shutil.copy(path, bad)
            if damage is None:
                bad.write_bytes(path.read_bytes()[:-700])
            else:
                with h5py.File(bad, "a") as file:
                    damage(file)
            with pytest.raises(fclib.Error) as native:
                fclib.read(bad)
            drop(page, bad)
            page.get_by_text(str(native.value).replace(str(bad), bad.name), exact=True).wait_for()
            assert page.locator("dl.facts").count() == 0


@pytest.mark.slow
def test_a_file_is_drawn_where_python_draws_it(page: Any, tmp_path: Path) -> None:
    """Shapes of all kinds and contact points, of a periodic cell too, from the bytes of a file."""
    from fclib.collections import set_index, trajectory

    problems: dict[str, Any] = {}
    for family in ("machines/GearTrain", "fclib2024/PrimitiveSoup", "rr9118/PeriodicBox"):
        plan = set_index.plan_of(family)
        assert plan.trajectory is not None
        problems[family.partition("/")[2]] = trajectory.read(plan.trajectory).problem(0).problem
    kinds = set()
    for name, problem in problems.items():
        path = tmp_path / f"{name}.hdf5"
        fclib.write(path, problem)
        solids = solids_of(problem.bodies, problem.contacts)
        kinds |= set(problem.bodies.shape_kind.tolist())
        found = page.evaluate(
            """async (data) => {
              const fclib = await Fclib.core();
              const bytes = Uint8Array.from(atob(data), (one) => one.charCodeAt(0));
              const { problem } = await fclib.read(bytes);
              const { network, solids } = await Fclib.viewOf(fclib, problem);
              const corners = solids.kind.map((_, k) => Fclib.corners(solids, k));
              return { corners, network, period: solids.period ?? null };
            }""",
            base64.b64encode(path.read_bytes()).decode(),
        )
        for shape, corners in enumerate(found["corners"]):
            apart = np.abs(np.array(corners) - solids.world(shape)).max()
            assert apart < 1e-9 * max(1.0, solids.reach(shape)), (name, shape)
        drawn = view_of(problem)["network"]
        own = found["network"]
        np.testing.assert_allclose(own["points"], drawn["points"], rtol=1e-6, atol=1e-6)
        assert own["pairs"] == drawn["pairs"]
        for key in ("limits", "crossing"):
            assert own.get(key, []) == drawn.get(key, [])
        np.testing.assert_allclose(
            own.get("images", []), drawn.get("images", []), rtol=1e-4, atol=1e-4
        )
        assert (found["period"] or []) == solids.period.tolist()
    assert {0, 1, 2, 3, 5, 6} <= kinds
    assert len(problems["PeriodicBox"].bodies.period) == 2


def between_walls() -> Any:
    """A ball between two walls that close: what it needs is against what each of them gives."""
    frame = np.eye(3)
    H = np.hstack([frame, frame @ np.diag([-1.0, -1.0, 1.0])])
    w = np.array([-1.0, 0, 0, -1.0, 0, 0])
    return fclib.GlobalProblem(spacedim=3, M=np.eye(3), f=np.zeros(3), H=H, w=w, mu=np.full(2, 0.5))


@pytest.mark.slow
def test_a_stored_certificate_is_checked_on_its_page(
    catalogue: Path, module: Path, window: Any, tmp_path: Path
) -> None:
    """Where a store has the proof of one of a catalogue's problems."""
    from pyarrow import parquet

    problem = between_walls()
    folder = tmp_path / "collection"
    shutil.copytree(catalogue, folder)
    family = folder / "tiny" / "KaplasTower"
    fclib.write(family / "0030-global.hdf5", problem)
    fclib.write(family / "0030-local.hdf5", problem.condense())
    for table in (folder / "catalog.parquet", family / "catalog.parquet"):
        rows = parquet.read_table(table)
        (row,) = rows.to_pylist()
        for form, own in (("global", problem), ("local", problem.condense())):
            row[f"{form}_sha256"] = catalog.sha256(family / f"0030-{form}.hdf5")
            row["digest"] = fclib.digest(own) if form == "global" else row["digest"]
        parquet.write_table(type(rows).from_pylist([row], rows.schema), table)
    result = fclib.solve(problem, "auto")
    assert result.status == "infeasible"
    record = Record(status="infeasible", cpu_s=1.0, total_cpu_s=1.0, wall_s=1.0, memory=1.0)
    record.machine = {"node": "here", "cpu": "Abacus"}
    supervisor.prove(problem, record, result.certificate, result.certificate_z)
    assert record.certificate is not None
    with Store(tmp_path / "runs.sqlite") as store:
        number = store.begin("made", "", 1, 0, "here")
        choice = SolverChoice("auto", {}, "auto", "chain", "fclib", "1")
        limits = Limits(time=10.0, wall=20.0, memory=1000.0)
        facts = look(family / "0030-global.hdf5")
        store.add(Job(facts, choice, 1e-8, limits, 0, 1), record, number)
    site = tmp_path / "site"
    with Campaigns([tmp_path / "runs.sqlite"]) as campaigns:
        build_site(campaigns, site, folder, with_files=True, views=0, module=module)
    (run,) = read_data(site, "problems/0")
    assert result.certificate is not None
    assert run["certificate"]["y"] == {"0": result.certificate[0], "1": result.certificate[1]}

    with served(site) as address, opened(window, address + TOWER) as page:
        page.get_by_text("the global form has no solution. It was checked").wait_for()
        page.get_by_role("button", name="Check the certificate").click()
        rows = page.locator("table", has_text="The stored certificate").locator("tbody tr")
        rows.first.wait_for()
        words = [str(row).split("\t") for row in rows.all_inner_texts()]
        assert words[0][:4] == ["proves", *["that there is no solution"] * 2, "the same"]
        assert [words[1][0], words[1][3]] == ["gain", "equal to 1e-12"]
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")

        # one that has been changed is found out
        page.evaluate("Fclib.values['problems/0'][0].certificate.y[1] *= 1.5")
        page.get_by_role("button", name="Check the certificate").click()
        page.get_by_role("cell", name="nothing").wait_for()
        assert rows.first.inner_text().split("\t")[3] == "differs"

        # what is solved there is proven there
        page.get_by_role("button", name="Solve it here").click()
        page.get_by_role("button", name="Start").click()
        page.get_by_text("the certificate proves that there is no solution").wait_for()


@pytest.mark.slow
def test_a_view_that_is_served_checks_and_solves(window: Any, tmp_path: Path, module: Path) -> None:
    """One problem of a file that has two: its own solution, options, sliders."""
    file = tmp_path / "a tower#1.hdf5"
    shutil.copy(golden_work.TINY / "KaplasTower" / "0030-global.hdf5", file)
    words = [sys.executable, "-m", "fclib", "view", str(file), "--serve"]
    words += ["--browser", str(module)]
    silent = {**os.environ, "BROWSER": "true"}
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=silent) as process:
        assert process.stdout is not None
        found = re.match(r"(http://127\.0\.0\.1:\d+/) ", process.stdout.readline())
        assert found is not None
        try:
            with opened(window, found[1]) as page:
                page.get_by_text(
                    "127.0.0.1, where this page is served, is this machine alone"
                ).wait_for()
                page.get_by_role("button", name="Check it here").click()
                checked = page.locator("table", has_text="compared").locator("tbody tr")
                checked.first.wait_for()
                told = [str(row).split("\t")[3].strip() for row in checked.all_inner_texts()]
                assert told == ["equal to 1e-12"] * 12
                page.get_by_role("button", name="Solve it here").click()
                page.get_by_role("button", name="Start").click()
                page.get_by_text(re.compile("^auto: converged after")).wait_for()
                page.get_by_role("button", name="What if").click()
                assert counts(page)["stick"] == 144
                assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        finally:
            process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0

    # the page as a file says how to get there
    out = tmp_path / "page.html"
    words = ["view", str(file), "--out", str(out), "--browser", str(module)]
    invoke(*words)
    with served(tmp_path) as address, opened(window, address + out.name) as page:
        page.goto(out.as_uri())
        page.get_by_text(f"fclib view '{file}' --serve").wait_for()
        assert page.get_by_role("button", name="Check it here").count() == 0


def test_a_view_is_not_served_without_the_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(browser, "BUILT", tmp_path / "none")
    file = tmp_path / "problem.hdf5"
    fclib.write(file, planted_local(1).problem)
    done = invoke("view", file, "--serve", code=1)
    assert "there is no module for browsers" in done.output
    done = invoke("view", file, "--out", tmp_path / "page.html")
    assert "--serve" not in (tmp_path / "page.html").read_text()
    done = invoke("view", file, "--out", "page.html", "--serve", code=2)
