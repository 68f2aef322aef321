"""How Sphinx builds the site: ``sphinx-build -W docs docs/_build/html``, without the network."""

import sys
from importlib.metadata import version as installed_version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

project = "remeshvec"
author = "the remeshvec authors"
release = version = installed_version("remeshvec")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinx_copybutton",
    "sphinxcontrib.bibtex",
]
exclude_patterns = ["_build", "gallery"]
html_theme = "furo"
html_title = "remeshvec"
html_show_copyright = False
smartquotes = False  # two hyphens begin a flag

# Pages are Markdown that GitHub shows too: links between them name files, headings are anchors.
myst_heading_anchors = 3

# Docstrings are NumPy's; single backticks name Python objects where there is one of that name.
default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "none"
numpydoc_show_class_members = False
toc_object_entries_show_parents = "hide"

bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "plain"
