"""The error of a report."""

from __future__ import annotations

from fclib import _core


class ReportError(_core.Error, ValueError):
    """There is nothing to report, no place for it, or no library to draw it."""
