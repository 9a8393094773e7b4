"""Words that the command line, the figures and the site have in common."""

from __future__ import annotations


def counted(number: int, one: str, many: str = "") -> str:
    """A number of things: "1 family", "2 families"; without `many`, with an s."""
    return f"{number} {one if number == 1 else many or one + 's'}"
