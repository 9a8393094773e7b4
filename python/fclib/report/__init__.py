"""The report: a site to browse, a view of one problem, figures for a paper.

    stores, catalogue -> runs, problems -> site
    problem file -> network -> view

All numbers come from the stores of `fclib.bench` and from the catalogue of `fclib.collections`.
Files of problems are read for their pictures alone: the pattern and the network of contacts.
"""

from fclib.report.error import ReportError
from fclib.report.paper import write_paper
from fclib.report.runs import Campaigns
from fclib.report.site import build_site
from fclib.report.view import view_of, write_view

__all__ = ["Campaigns", "ReportError", "build_site", "view_of", "write_paper", "write_view"]
