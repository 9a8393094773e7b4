"""One figure for a paper, with its caption in LaTeX and the BibTeX of all that it is of.

curves.pdf    the figure: PDF, SVG or PGF
curves.tex    it in an environment of LaTeX, with a caption that cites solvers and sets
curves.bib    what the caption cites
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias

from fclib._files import write_text
from fclib.bench import comparison, plots, profiles
from fclib.bench.plots import latex_text
from fclib.bench.table import Table, object_in
from fclib.collections import families
from fclib.collections.set_index import SETS, version
from fclib.report import citing
from fclib.report.error import ReportError

Curve: TypeAlias = Literal["performance", "data", "contact", "accuracy"]
CURVES: Mapping[str, str] = {
    "performance": "Performance profiles",
    "data": "Data profiles",
    "contact": "Data profiles of the cost per contact",
    "accuracy": "Cost of an accuracy",
}
FORMATS = (".pdf", ".svg", ".pgf")
READABLE = re.compile(r"[\w .+-]+")  # names of files that TeX can be told


def write_figure(
    store: Path,
    path: Path,
    *,
    curve: Curve = "performance",
    columns: int = 1,
    font: str = "sans-serif",
    metric: str = "cpu_s",
    solvers: Sequence[str] = (),
    own_set: bool = False,
    both_forms: bool = False,
    count_unsuitable: bool = False,
    weigh: profiles.Weigh = "families",
    penalty: float = profiles.PENALTY,
    shift: float = profiles.SHIFT,
    note: str = "",
    **chosen: Any,
) -> list[Path]:
    """Write a figure, its caption and its citations.

    Args:
        store: of `fclib bench`.
        path: of the figure; its ending is the format.
        curve: what is drawn.
        columns: of the page that the figure is as wide as, 1 or 2.
        font: the name of a font, or "serif", "sans-serif", "monospace".
        metric: what is compared.
        solvers: only these, by their labels.
        own_set: count each solver on the instances that it has run and takes.
        both_forms: count the two forms of a problem as two.
        count_unsuitable: count a problem that a solver does not take as a failure.
        weigh: what weighs the same.
        penalty: a failure counts as so many times the limit.
        shift: of the means.
        note: more words of the caption.
        chosen: which runs, as `fclib.bench.profiles.load` takes them. Of several tolerances the
            smallest is drawn, except for the cost of an accuracy.

    Raises:
        ReportError: the format is not known, TeX could not read the file by its name, or there is
            nothing to draw.
        ProfileError: there is nothing to compare.
        ValueError: the font is not known, or PGF finds no TeX.
        ImportError: Matplotlib is not there.
    """
    if path.suffix not in FORMATS:
        raise ReportError(f"{path}: a figure ends in {', '.join(FORMATS)}")
    if not READABLE.fullmatch(path.name):
        raise ReportError(f"{path}: TeX needs a name of letters, digits, blanks and . _ + -")
    rows = profiles.load(store, solvers=solvers, **chosen)
    every = profiles.gather(rows, metric, count_unsuitable, both_forms)
    costs = comparison.compared(every, solvers or None, own_set)
    if curve != "accuracy":
        costs = costs.at(costs.tolerances[-1])
    elif len(costs.tolerances) == 1:
        raise ReportError(f"{store}: the cost of an accuracy needs runs to several tolerances")
    shown = costs.per_contact() if curve == "contact" else costs
    if not shown.solved.any():
        raise ReportError(f"{store}: no solver solves any of these instances")
    runs = comparison.runs_of(rows, costs)
    path.parent.mkdir(parents=True, exist_ok=True)
    with plots.of_paper(path, columns, font) as axes:
        if curve == "performance":
            plots.draw_performance(axes, shown, weigh, banded=False)
        elif curve == "accuracy":
            points = profiles.work_precision(runs, costs, penalty, shift, weigh)
            plots.draw_work_precision(axes, points, metric)
        else:
            plots.draw_data(axes, shown, weigh, " per contact" if curve == "contact" else "")
    words = [
        profiles.caption(shown, runs, weigh, own_set),
        profiles.JUDGED[runs.row(0)["merit"]],
        f"shift of the means {shift:g}, failures as {penalty:g} times the limit"
        if curve == "accuracy"
        else "",
        note,
    ]
    cited = cited_solvers(runs) | cited_sets(runs) | cited_software()
    named = dict(zip(cited, citing.distinct(list(cited.values())), strict=True))
    texts = {
        ".tex": environment(path, columns, CURVES[curve], [word for word in words if word], named),
        ".bib": "\n\n".join(dict.fromkeys(entry for own in named.values() for entry in own)) + "\n",
    }
    for ending, text in texts.items():
        write_text(path.with_suffix(ending), text)
    return [path, *(path.with_suffix(ending) for ending in texts)]


def environment(
    path: Path, columns: int, title: str, words: Sequence[str], named: Mapping[str, Sequence[str]]
) -> str:
    """The figure in LaTeX, with its caption."""
    kind = "figure*" if columns == 2 else "figure"
    put = (
        rf"\input{{{path.name}}}" if path.suffix == ".pgf" else rf"\includegraphics{{{path.stem}}}"
    )
    cites = [
        rf"{latex_text(name)}~\cite{{{','.join(map(citing.key_of, entries))}}}"
        for name, entries in named.items()
    ]
    return "\n".join(
        [
            rf"\begin{{{kind}}}",
            r"  \centering",
            *([r"  \providecommand{\mathdefault}[1]{#1}"] if path.suffix == ".pgf" else []),
            f"  {put}",
            rf"  \caption{{{title}: {latex_text('; '.join(words))}. {', '.join(cites)}.}}",
            rf"  \label{{fig:{path.stem}}}",
            rf"\end{{{kind}}}",
            "",
        ]
    )


# ---- what is cited: entries of BibTeX, by a name


def cited_solvers(runs: Table) -> dict[str, list[str]]:
    """Each solver, by its label."""
    _, first = runs.numbers("solver")
    found = {}
    for row in runs.where(first):
        about = object_in(row["about"])
        found[str(row["solver"])] = citing.of_solver(
            row["solver_name"],
            str(about.get("title", "")),
            str(about.get("citation", "")),
            row["origin"] or "fclib",
            row["version"] or "",
        )
    return found


def cited_sets(runs: Table) -> dict[str, list[str]]:
    """The sets of the problems; those of other places are named by their families."""
    known = families()
    _, first = runs.numbers("set", "family")
    names = {}
    for row in runs.where(first):
        family = known.get(row["family"])
        name = row["set"] if row["set"] in SETS else family.collection if family else None
        if name is not None:
            names[f"set {name}, version {version(name)}"] = [citing.set_of_problems(name)]
    return names


def cited_software() -> dict[str, list[str]]:
    """The bench that ran them, and the collection's first report."""
    return {"FCLIB": [citing.REPORT, citing.software()]}
