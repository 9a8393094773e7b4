"""What all tests share: the folder of real problems, and the settings of Hypothesis."""

import fcntl
import gc
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis
import pytest

TESTS = Path(__file__).parent
sys.path.insert(0, str(TESTS))  # for helpers.py, which --import-mode=importlib does not find
sys.path.append(str(TESTS.parent))  # for workshop, which is not installed

import rebuild  # noqa: E402

pytest.register_assert_rewrite("helpers")

# one thread for linear algebra: tests run side by side, and threads that wait for others burn time
for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

# the same examples every time, and no deadline: machines differ
hypothesis.settings.register_profile("fclib", deadline=None, derandomize=True)
hypothesis.settings.load_profile("fclib")

# files by the time that they take, of those that take long
LONGEST = (
    "test_report_screens",
    "test_report_browser",
    "test_bench_cluster",
    "test_bench_limits",
    "test_trajectory",
    "test_collection",
    "test_capi",
    "test_docs",
    "test_docs_code",
    "test_tutorials",
    "test_report_compute",
    "test_bench",
    "test_report",
    "test_hard_data",
    "test_solvers",
    "test_browser",
    "test_bench_sequences",
    "test_peers",
    "test_analysis",
    "test_interrupt",
    "test_examples",
    "test_scenes",
    "test_machines",
    "test_auto",
    "test_standard",
    "test_bench_profiles",
    "test_external",
    "test_doctor",
    "test_malformed",
    "test_recorders",
    "test_robots",
    "test_handed",
    "test_authors_decks",
    "test_io",
)

# a shell's job in the background ignores Ctrl-C, and so would all that it starts
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config: pytest.Config) -> None:
    """What was just edited is what is tested."""
    if not hasattr(config, "workerinput"):  # a process that pytest-xdist has started
        rebuild.rebuild()
    # files side by side are begun in the order of below, not with those of most tests
    if getattr(config.option, "loadscopereorder", False):
        config.option.loadscopereorder = False


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Thousands of tests and what they import stay: nobody need look whether they are garbage."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files come first: no core waits at the end while another runs one of them."""
    place = {name: k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))


@pytest.fixture(scope="session")
def root() -> Path:
    """The root of the repository."""
    return TESTS.parent


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real problems; skips a test if it is not there."""
    from helpers import real_folder

    folder = real_folder()
    if not folder.is_dir():
        pytest.skip(f"there are no real problems in {folder}; FCLIB_DATA names another folder")
    return folder


# ---- the report: a small collection, runs of it and their site


@pytest.fixture(scope="session")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of these: the first process that asks for it makes it, and no test changes it."""
    from helpers_report import make_report

    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    done = folder / "reported" / "done"
    with (folder / "reported.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            make_report(done.parent)
            done.touch()
    return done.parent


@pytest.fixture(scope="session")
def collection(reported: Path) -> Path:
    return reported / "collection"


@pytest.fixture(scope="session")
def store(reported: Path) -> Path:
    return reported / "runs.sqlite"


@pytest.fixture(scope="session")
def site(reported: Path) -> Path:
    return reported / "a site #1"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium. While it runs, a process has a loop of asyncio: it ends with its file of tests."""
    from helpers_browser import chromium

    with chromium() as opened:
        yield opened


@pytest.fixture
def opening(browser: Any) -> Iterator[Any]:
    """What makes openers of the pages of a site, or of a file."""
    from helpers_browser import Opener

    made: list[Opener] = []

    def start(place: Path) -> Opener:
        made.append(Opener(browser, place))
        return made[-1]

    yield start
    for opener in made:
        opener.close()


@pytest.fixture
def go(opening: Any, site: Path) -> Any:
    """An opener of the pages of the site."""
    return opening(site)
