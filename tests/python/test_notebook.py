"""Figures in a notebook: of problems, results and campaigns, and a notebook that is run."""

from __future__ import annotations

import base64
import gzip
import html
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fclib
from fclib import bench
from helpers import planted_global, planted_local, ran

pytest.importorskip("plotly")
pytest.importorskip("itables")

CAMPAIGN = {
    "name": "small",
    "solvers": ["nsgs", "apgd"],
    "tolerances": [1e-4, 1e-8],
    "problems": [{"planted": {"count": 2, "contacts": 5, "seed": 1}, "family": "planted"}],
}
CELLS = """
import fclib
problem = fclib.load("tiny/Capsules/0300")
result = fclib.solve(problem, history=True)
---
problem
---
problem.view(result)
---
result.plot()
---
fclib.profile("small.sqlite", tol=1e-8)
"""


def test_a_view_is_a_page_that_needs_no_other_file(tmp_path: Path) -> None:
    planted = planted_global(1)
    for solution in (None, planted.solution, fclib.solve(planted.problem)):
        shown = planted.problem.view(solution)
        shown.save(tmp_path / "page.html")
        text = (tmp_path / "page.html").read_text(encoding="utf-8")
        assert "Fclib.view(" in text
        assert not re.search(r"<(script|link)[^>]+(src|href)=.(?!data:)", text)
        frame = shown._repr_html_()
        assert frame.startswith("<iframe srcdoc=")
        assert 'sandbox="allow-scripts"' in frame
        assert len(frame) < 0.5 * len(text)
        packed = re.search(r'atob\("([^"]+)"\)', html.unescape(frame))
        assert packed is not None
        assert gzip.decompress(base64.b64decode(packed[1])).decode() == text


def test_a_plot_has_the_history() -> None:
    problem = planted_local(3).problem
    result = fclib.solve(problem, "nsgs", history=True)
    figure: Any = result.plot()
    assert result.history is not None
    np.testing.assert_array_equal(figure.data[0].x, result.history["iteration"])
    np.testing.assert_array_equal(figure.data[0].y, result.history["error"])
    np.testing.assert_array_equal(figure.data[1].x, result.history["time"])
    chained: Any = fclib.solve(problem, "auto", history=True)
    assert chained.history is not None
    names = set(chained.history["stage"].tolist())
    assert len(chained.plot().data) == 2 * len(names)
    with pytest.raises(ValueError, match="history=True"):
        fclib.solve(problem).plot()


def test_a_profile_is_that_of_the_command(tmp_path: Path) -> None:
    from fclib.bench import comparison, profiles

    store = tmp_path / "small.sqlite"
    bench.run_campaign(bench.Campaign.of(CAMPAIGN), store)
    figure = fclib.profile(store)
    rows = profiles.load(store, tolerances=[1e-8])
    costs = comparison.compared(profiles.gather(rows, "cpu_s"), None, False).at(1e-8)
    assert {curve.name for curve in figure.data} == {costs.legend(k) for k in range(2)}
    for curve in figure.data:
        k = [costs.legend(k) for k in range(2)].index(curve.name)
        wanted = profiles.performance_profile(
            costs.values, np.array(curve.x), costs.weights("families")
        )[k]
        np.testing.assert_array_equal(curve.y, wanted)
    assert "1e-08" in figure.layout.title.text
    assert "0.0001" in fclib.profile(store, tol=1e-4).layout.title.text
    with pytest.raises(ValueError, match="no such store"):
        fclib.profile(tmp_path / "none.sqlite")


@pytest.mark.slow
def test_a_notebook_shows_them(tmp_path: Path) -> None:
    nbformat: Any = pytest.importorskip("nbformat")
    client: Any = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    bench.run_campaign(bench.Campaign.of(CAMPAIGN), tmp_path / "small.sqlite")
    notebook = nbformat.v4.new_notebook()
    notebook.cells = [nbformat.v4.new_code_cell(cell.strip()) for cell in CELLS.split("---")]
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "", "language": "python"}
    client.NotebookClient(
        notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    shown = [cell.outputs[-1].data for cell in notebook.cells[1:]]
    assert "<table>" in shown[0]["text/html"]
    assert "<iframe" in shown[1]["text/html"]
    for figure in shown[2:]:
        assert any("plotly" in kind or "html" in kind for kind in figure)


def test_without_plotly_it_says_what_to_install(tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['plotly'] = sys.modules['plotly.subplots'] = None\n"
        "import fclib, numpy as np\n"
        "problem = fclib.LocalProblem(W=np.eye(3), q=[-1, 0, 0], mu=[0.5])\n"
        "fclib.solve(problem, history=True).plot()\n"
    )
    command = [sys.executable, "-c", code]
    done = ran(*command, code=None, cwd=tmp_path)
    assert 'pip install "fclib[report]"' in done.stderr.splitlines()[-1]
