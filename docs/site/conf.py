"""Sphinx configuration of the documentation site; `docs/site/build.py` calls it."""

from __future__ import annotations

import thud

project = "thud"
author = "The thud developers"
copyright = "The thud developers, BSD-3-Clause"  # noqa: A001 - Sphinx's name
version = release = thud.__version__

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 4
source_suffix = {".md": "myst-nb", ".rst": "restructuredtext"}
templates_path = ["docs/site/templates"]
suppress_warnings = ["misc.highlighting_failure"]  # lines of a CMake list
exclude_patterns = [
    "README.md",
    "inputs/**",
    "docs/paper/**",
    "docs/site/**",
    "docs/tutorials/inputs/**",
]

# Tutorials are computed at each build; one that fails is an error.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 600  # s, of a cell on a busy machine
nb_merge_streams = True

autodoc_typehints = "none"  # the sections of parameters say more
autosummary_generate = True
numpydoc_show_class_members = False
add_module_names = False

html_theme = "furo"
html_title = f"thud {release}"
html_static_path = ["docs/site/static"]
html_css_files = ["tutorials.css"]
html_extra_path = ["../ford"]  # made by FORD
