"""What can go wrong with a report."""

from __future__ import annotations

import fclib


class ReportError(fclib.Error, ValueError):
    """There is nothing to report, nowhere to put it, or nothing to draw it with."""
