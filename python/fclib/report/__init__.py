"""The report: a site to browse, a view of one problem, figures for a paper.

    stores, catalogue -> runs, problems -> site
    problem file -> network, solids -> view, picture

All numbers come from the stores of `fclib.bench` and from the catalogue of `fclib.collections`.
Files of problems are read only for their pictures: the pattern and the network of contacts.

site.py        the pages of the site: problems, families, solvers, runs
runs.py        the runs of stores in the form of the site, summed by `bench.profiles`
view.py        the content of the page of one problem, and that page by itself
network.py     bodies and contacts: places from the file, from H if that is safe, or a graph
solids.py      shapes of bodies at their places, from the file
picture.py     a small picture of the bodies
drawings.py    the drawings of each problem on the site
downloads.py   the files of a problem that the site offers
browser.py     the module with which its pages check and solve problems
serving.py     serves a site at an address of this machine
recipes.py     lines to copy: how to get, read and solve a problem
citing.py      BibTeX of all that the site shows; references.bib has the papers
paper.py       all figures and tables of a campaign for a paper
figure.py      one figure for a paper, with its caption and citations
libraries.py   JavaScript libraries for the pages, out of Python packages
error.py       ReportError
assets/        the pages themselves: HTML, CSS, JavaScript; pages/ has a file for each kind of page

site.py needs all others but paper.py and figure.py; drawings.py needs view.py and picture.py, these
two solids.py, and view.py network.py; paper.py needs runs.py, figure.py citing.py.
"""

from fclib.report.error import ReportError
from fclib.report.figure import write_figure
from fclib.report.paper import write_paper
from fclib.report.runs import Campaigns
from fclib.report.serving import serve
from fclib.report.site import build_site
from fclib.report.view import view_of, write_view

__all__ = [
    "Campaigns",
    "ReportError",
    "build_site",
    "serve",
    "view_of",
    "write_figure",
    "write_paper",
    "write_view",
]
