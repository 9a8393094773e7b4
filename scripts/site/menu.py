"""The menu beside the pages: rendered once, and marked for each page.

The theme renders all of it for each page, which takes two fifths of a build.
"""

from __future__ import annotations

import functools
import posixpath
import re
from typing import Any

from furo.navigation import get_navigation_tree  # type: ignore[import-untyped]
from sphinx.environment.adapters.toctree import global_toctree_for_doc

PIECE = re.compile(r'(<ul>|</ul>|<li class="[^"]*">|</li>|<input [^>]*>|href="[^"#]+")')


def put(app: Any) -> None:
    """Have Sphinx give the pages this menu, and the theme none of its own."""
    app.connect("html-page-context", take_from_the_theme, priority=400)
    app.connect("html-page-context", give_to_the_page, priority=600)


def take_from_the_theme(
    app: Any, page: str, template: str, context: dict[str, Any], doctree: Any
) -> None:
    """Without this it has nothing to render."""
    context.pop("toctree", None)


def give_to_the_page(
    app: Any, page: str, template: str, context: dict[str, Any], doctree: Any
) -> None:
    """What the theme's template puts beside the page."""
    context["furo_navigation_tree"] = seen_from(whole(app), app.builder.get_target_uri(page))


@functools.lru_cache(maxsize=1)
def whole(app: Any) -> str:
    """The menu as the theme renders it, with addresses from the root of the site."""
    tree = global_toctree_for_doc(
        app.env,
        app.config.root_doc,
        app.builder,
        tags=app.tags,
        collapse=False,
        includehidden=True,
        maxdepth=-1,
        titles_only=True,
    )
    return str(get_navigation_tree(app.builder.render_partial(tree)["fragment"]))


def seen_from(menu: str, page: str) -> str:
    """The menu with addresses from a page; the way down to the page's own entry is marked."""
    folder = posixpath.dirname(page)
    pieces = PIECE.split(menu)  # every second one is a tag or an address
    boxes: dict[int, int] = {}  # that open an entry
    path: list[int] = []  # lists and entries around a piece
    own: list[int] = []
    for k in range(1, len(pieces), 2):
        if pieces[k].startswith("</"):
            path.pop()
        elif pieces[k].startswith("<input"):
            boxes[path[-1]] = k
        elif pieces[k].startswith("<"):
            path.append(k)
        elif (target := pieces[k][6:-1]) != page:
            pieces[k] = f'href="{posixpath.relpath(target, folder)}"'
        else:
            own = path.copy()
            pieces[k - 1] = pieces[k - 1].replace('"reference', '"current reference')
            pieces[k] = 'href="#"'
    for k in own:
        if pieces[k] == "<ul>":
            pieces[k] = '<ul class="current">'
        else:
            pieces[k] = re.sub(r"toctree-l\d+", r"\g<0> current", pieces[k])
        if k in boxes:
            pieces[boxes[k]] = pieces[boxes[k]].replace(" class=", ' checked="" class=', 1)
    if own:
        pieces[own[-1]] = pieces[own[-1]][:-2] + ' current-page">'
    return "".join(pieces)
