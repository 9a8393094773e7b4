"""What can go wrong with a report."""

from __future__ import annotations

from fclib import _core


class ReportError(_core.Error, ValueError):
    """There is nothing to report, nowhere to put it, or nothing to draw it with."""
