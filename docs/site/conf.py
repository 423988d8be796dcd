"""Sphinx configuration of the documentation site; `docs/site/build.py` calls it."""

from __future__ import annotations

import thud

project = "thud"
author = "The thud developers"
copyright = "The thud developers, BSD-3-Clause"  # noqa: A001 - Sphinx's name
version = release = thud.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 4
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
templates_path = ["docs/site/templates"]
suppress_warnings = ["misc.highlighting_failure"]  # lines of a CMake list
exclude_patterns = ["README.md", "inputs/**", "docs/paper/**", "docs/site/**"]

autodoc_typehints = "none"  # the sections of parameters say more
autosummary_generate = True
numpydoc_show_class_members = False
add_module_names = False

html_theme = "furo"
html_title = f"thud {release}"
html_extra_path = ["../ford"]  # made by FORD
