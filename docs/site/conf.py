"""How Sphinx builds the site; `docs/site/build.py` calls it on the pages that it lays out."""

import os
import re
from importlib.metadata import version as version_of
from pathlib import Path

import looking

project = "flurries"
copyright = "The flurries authors"
version = release = version_of("flurries")

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "equations",
]
html_theme = "pydata_sphinx_theme"
html_title = "flurries"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = [("search.js", {"defer": "defer"})]
html_search_scorer = str(Path(__file__).parent / "scorer.js")
# Pages without others below them.
html_sidebars = {
    name: []
    for name in ("start", "gallery", "concepts", "faq", "cite", "changelog", "contributing")
}
html_show_sourcelink = False
html_copy_source = False
# The address of the published site, if it has one; links inside the site need none.
html_baseurl = os.environ.get("FLURRIES_SITE", "")
html_theme_options = {
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "header_links_before_dropdown": 8,
}

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
# Notebooks are run by build.py before Sphinx sees them, or shown without outputs.
nb_execution_mode = "off"

# Docstrings give the types, with shapes and units; signatures stay short.
toc_object_entries = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb", ".rst": "restructuredtext"}
# Code of consoles and scene files in pages that GitHub shows too.
suppress_warnings = ["misc.highlighting_failure"]


def add_pictures(app, what, name, obj, options, lines):
    """Put a picture beside each field of an effect that has a look."""
    if what == "class":
        lines[:] = looking.beside(name.rpartition(".")[2], lines)


def keep_bars(app, what, name, obj, options, lines):
    """Take |v| in docstrings for a length, and not for a name to be replaced."""
    for number, line in enumerate(lines):
        parts = line.split("``")
        parts[::2] = [part.replace("|", "\\|") for part in parts[::2]]
        lines[number] = "``".join(parts)


def without_ways_back(app, pagename, templatename, context, doctree):
    """Take the links back out of the pages of sources: what has two names has one place."""
    if pagename.startswith("_modules/"):
        context["body"] = re.sub(r'<a class="viewcode-back".*?</a>', "", context["body"])


def setup(app):
    app.connect("html-page-context", without_ways_back)
    # Before numpydoc reads the lines.
    app.connect("autodoc-process-docstring", add_pictures, priority=100)
    app.connect("autodoc-process-docstring", keep_bars, priority=900)
