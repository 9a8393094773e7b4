"""Sphinx's settings. Nothing of another host is asked for, when the site is built or read."""

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
import formulas
import menu

import fclib

project = "FCLIB"
author = "the authors of FCLIB"
version = release = fclib.__version__

extensions = ["myst_parser", "sphinx_copybutton"]
source_suffix = {".md": "markdown"}
# ```math is what GitHub draws too
myst_fence_as_directive = ["math"]
myst_enable_extensions = ["html_image", "attrs_inline"]
myst_heading_anchors = 3
# of an indented block
highlight_language = "none"

html_theme = "furo"
html_title = f"FCLIB {version}"
templates_path = [str(Path(__file__).with_name("templates"))]
# furo's own, and the other versions of the site above them
html_sidebars = {
    "**": [
        *("sidebar/brand.html", "sidebar/search.html", "versions.html"),
        *("sidebar/scroll-start.html", "sidebar/navigation.html", "sidebar/scroll-end.html"),
    ]
}
html_theme_options = {"sidebar_hide_name": False}
html_math_renderer = "mathml"
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
html_css_files = ["site.css"]
html_js_files = [("contact.js", {"defer": "defer"})]
copybutton_exclude = ".linenos, .gp, .go"


def setup(app: Any) -> None:
    """Formulas become MathML, which browsers draw themselves; the menu is rendered once."""
    app.add_html_math_renderer("mathml", (formulas.inline, None), (formulas.display, None))
    menu.put(app)
