"""Sphinx configuration of the documentation site; `docs/site/build.py` calls it."""

from __future__ import annotations

import inspect
import re
import sys
import textwrap
from abc import ABCMeta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from docutils import nodes
from latex2mathml.converter import convert
from matplotlib.image import imread
from numpydoc.docscrape import NumpyDocString
from numpydoc.xref import DEFAULT_LINKS
from sphinx.util.inspect import stringify_signature

import thud

# The directory of this file, of which the site has a copy.
sys.path.append("docs/site")
from examples import read_examples

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.environment import BuildEnvironment
    from sphinx.writers.html5 import HTML5Translator

project = "thud"
author = "The thud developers"
copyright = "The thud developers, BSD-3-Clause"  # noqa: A001 - Sphinx's name
version = release = thud.__version__

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "html_image"]
myst_heading_anchors = 4
# The first is that of pages made by autosummary.
source_suffix = {".rst": "restructuredtext", ".md": "myst-nb"}
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
# Names in types and "See also" are links, and words in single quotes that are names, too.
default_role = "py:obj"
numpydoc_xref_param_type = True
numpydoc_xref_ignore = {"of", "or", "shape", "pair", "to", "type", "subclass"}
numpydoc_xref_aliases = {word: word for word in DEFAULT_LINKS}  # else of inventories
# Where names of other projects are described: links that need no inventory from the network.
PYTHON, NUMPY = "https://docs.python.org/3", "https://numpy.org/doc/stable/reference"
MATPLOTLIB, XARRAY = "https://matplotlib.org/stable/api", "https://docs.xarray.dev/en/stable"
EXTERNAL = {
    **{
        name: f"{PYTHON}/library/functions.html#{name}"
        for name in ("bool", "callable", "dict", "float", "int", "list", "object", "str", "tuple")
    },
    **{name: f"{PYTHON}/library/constants.html#{name}" for name in ("None", "True", "False")},
    **{name: f"{PYTHON}/glossary.html#term-{name}" for name in ("iterable", "mapping", "sequence")},
    "path-like": f"{PYTHON}/glossary.html#term-path-like-object",
    "Path": f"{PYTHON}/library/pathlib.html#pathlib.Path",
    "OSError": f"{PYTHON}/library/exceptions.html#OSError",
    "ndarray": f"{NUMPY}/generated/numpy.ndarray.html",
    "array_like": f"{NUMPY}/typing.html#numpy.typing.ArrayLike",
    "DataFrame": "https://pandas.pydata.org/docs/reference/api/pandas.DataFrame.html",
    "Dataset": f"{XARRAY}/generated/xarray.Dataset.html",
    "Axes": f"{MATPLOTLIB}/_as_gen/matplotlib.axes.Axes.html",
    "Figure": f"{MATPLOTLIB}/_as_gen/matplotlib.figure.Figure.html",
}
add_module_names = False

highlight_language = "none"  # blocks without a language are what programs print

html_math_renderer = "mathml"
html_theme = "furo"
html_search_scorer = "docs/site/static/scorer.js"
html_favicon = "docs/site/static/favicon.svg"
myst_html_meta = {
    "description": "thud: the force of the rubber ball, the tyre and other heavy/soft impact"
    " sources on floors, and the level in the room below"
}
html_copy_source = False
html_title = f"thud {release}"
html_static_path = ["docs/site/static"]
html_css_files = ["site.css", "tutorials.css"]
html_theme_options = {
    f"{scheme}_css_variables": {"code-font-size": "76%"} for scheme in ("light", "dark")
}
TUTORIALS = "docs/tutorials/"
NAVIGATION: dict[str, str] = {}
EXAMPLES = {name: example for example in read_examples() for name in example.names}
# Width of a column of a journal, inch, and pixels of the screen for an inch of a figure.
COLUMN, DENSITY = 3.5, 150


def inches(path: Path) -> float:
    """Return the width of a figure: of PNG by 300 dots an inch, of SVG as it says."""
    if path.suffix == ".png":
        return float(imread(path).shape[1] / 300)
    width = re.search(r'<svg [^>]*?width="([\d.]+)pt"', path.read_text(encoding="utf-8"))
    return float(width[1]) / 72 if width else COLUMN


def scale_figures(app: Sphinx, document: nodes.document) -> None:
    """Show all figures with text of one size, as far as the screen is wide enough.

    A figure that is a link is none to itself; one that a tutorial draws is named as its section.
    """
    for image in document.findall(nodes.image):
        width = inches(Path(app.srcdir) / image["uri"])
        image["width"] = f"{width * DENSITY:.0f}px"
        if any(isinstance(one, nodes.reference) for one in (image.parent, image.parent.parent)):
            image["classes"].append("no-scaled-link")
        if not image.get("alt"):
            section = image.parent
            while not isinstance(section, nodes.section):
                section = section.parent
            image["alt"] = section.next_node(nodes.title).astext()


def show_signature(
    _: Sphinx, what: str, _name: str, item: object, *_rest: object
) -> tuple[str, str] | None:
    """Return the signature of a class with its own arguments: they are checked by a wrapper.

    Results have none: functions make them.
    """
    if what == "class" and isinstance(item, ABCMeta):
        return "", ""
    if what == "class":
        return stringify_signature(inspect.signature(item), show_annotation=False), ""
    return None


def show_example(
    _: Sphinx, what: str, name: str, item: object, _options: object, lines: list[str]
) -> None:
    """Add to the text of a public name its example, and to a class what its base classes hold."""
    pages = r":doc:`docs/\1.md </docs/\1>`"
    lines[:] = [re.sub(r"(?<![`\w/])docs/(\w+)\.md", pages, line) for line in lines]
    example = EXAMPLES.get(name.removeprefix("thud."))
    if what not in {"class", "function", "data", "exception"} or not example:
        return
    for base in getattr(item, "__mro__", ())[1:]:
        if base.__module__.startswith("thud.") and base.__name__ not in thud.__all__:
            shown = NumpyDocString(inspect.getdoc(base) or "")["Attributes"]
            begin = lines.index("Attributes") + 2 if shown and "Attributes" in lines else 0
            for entry in shown if begin else ():
                text = [f"{entry.name} : {entry.type}", *(f"    {line}" for line in entry.desc)]
                lines[begin:begin] = text
                begin += len(text)
    if "Examples" not in lines:
        code = textwrap.indent(example.code, "    ").splitlines()
        lines += ["", "Examples", "--------", ".. code-block:: python", "", *code, ""]


def link_other_projects(
    _: Sphinx, _environment: BuildEnvironment, node: nodes.Element, shown: nodes.TextElement
) -> nodes.reference | None:
    """Return the link of a name that another project describes."""
    address = EXTERNAL.get(node["reftarget"])
    return nodes.reference("", "", shown, internal=False, refuri=address) if address else None


def keep_punctuation(_: Sphinx, document: nodes.document) -> None:
    """Let no line begin with the punctuation behind a formula."""
    for formula in list(document.findall(nodes.math)):
        line, place = formula.parent, formula.parent.index(formula)
        behind = line[place + 1 : place + 2]
        mark = behind and re.match(r"[.,:;)]+", behind[0].astext())
        if mark and isinstance(behind[0], nodes.Text):
            kept = nodes.inline("", "", formula, nodes.Text(mark[0]), classes=["formula"])
            line[place : place + 2] = [kept, nodes.Text(behind[0][mark.end() :])]


def write_mathml(translator: HTML5Translator, node: nodes.math | nodes.math_block) -> None:
    """Write a formula as MathML, with the spaces of TeX, which browsers set by themselves."""
    block = isinstance(node, nodes.math_block)
    text = node.astext().replace("''", "\u2033").replace("'", "\u2032")  # else small superscripts
    formula = convert(text, display="block" if block else "inline")
    # A name stands apart from a number, a symbol or a closing bracket (&#x00029;).
    name, thin = r"<mi>\w\w+</mi>", '<mspace width="0.17em"/>'
    formula = re.sub(rf"(?<![^9];</mo>)(?<!<mrow>)(?={name})", thin, formula)
    formula = re.sub(rf"({name})(?!<mo)", rf"\1{thin}", formula)
    formula = formula.replace("<mo>&#x0002F;</mo>", '<mo lspace="0" rspace="0">/</mo>')
    translator.body.append(f'<div class="math">{formula}</div>' if block else formula)
    raise nodes.SkipNode


def spread_tutorials(_: Sphinx, _environment: BuildEnvironment, pages: list[str]) -> None:
    """Let each process that reads pages read some of the tutorials, which take longest."""
    tutorials = [page for page in pages if page.startswith(TUTORIALS)]
    others = [page for page in pages if page not in tutorials]
    for i, tutorial in enumerate(tutorials):
        others.insert(i * len(pages) // len(tutorials), tutorial)
    pages[:] = others


def fill_gallery(app: Sphinx, document: nodes.document, page: str) -> None:
    """Show on its page the figures of all tutorials, as links to the sections that draw them."""
    if page != "gallery":
        return
    for name in app.env.toctree_includes["index"]:
        if not name.startswith(TUTORIALS):
            continue
        address = app.builder.get_relative_uri(page, name)
        tutorial = app.env.get_doctree(name)
        title = nodes.title("", app.env.titles[name].astext())
        section = nodes.section("", title, ids=[Path(name).name])
        summary = tutorial.next_node(nodes.emphasis)
        section += nodes.paragraph("", "", *(summary.children if summary else []))
        grid = nodes.container(classes=["gallery"])
        for image in tutorial.findall(nodes.image):
            drawn = image.parent
            while not isinstance(drawn, nodes.section):
                drawn = drawn.parent
            caption = drawn.next_node(nodes.title).astext()
            picture = nodes.image(
                uri=image["uri"], candidates={"*": image["uri"]}, alt=caption, loading="lazy"
            )
            link = nodes.reference(
                "", "", picture, internal=True, refuri=f"{address}#{drawn['ids'][0]}"
            )
            link += nodes.inline("", caption)
            grid += nodes.paragraph("", "", link)
        section += grid
        document.next_node(nodes.section).append(section)


def shorten_navigation(
    app: Sphinx, page: str, _template: str, context: dict[str, Any], _document: nodes.document
) -> None:
    """List the same pages in the navigation of all: not those of single names and folders."""
    if toctree := context.get("toctree"):
        # It is the same for all pages of a folder that it does not list.
        listed = page in app.env.toctree_includes["index"]
        key = page if listed else page.rpartition("/")[0]

        def navigation(**options: bool) -> str:
            if key not in NAVIGATION:
                found = toctree(**options | {"collapse": True, "maxdepth": 1})
                # A heading without its level says nothing to screen readers.
                NAVIGATION[key] = found.replace('role="heading"', 'role="heading" aria-level="2"')
            return NAVIGATION[key]

        context["toctree"] = navigation


def setup(app: Sphinx) -> None:
    """Write formulas as MathML; scale figures and join punctuation when a page was read."""
    app.connect("html-page-context", shorten_navigation, priority=400)  # before the theme
    app.add_html_math_renderer("mathml", (write_mathml, None), (write_mathml, None))
    app.connect("autodoc-process-docstring", show_example, priority=400)  # before numpydoc
    app.connect("autodoc-process-signature", show_signature)
    app.connect("missing-reference", link_other_projects)
    app.connect("env-before-read-docs", spread_tutorials)
    app.connect("doctree-read", scale_figures)
    app.connect("doctree-read", keep_punctuation)
    app.connect("doctree-resolved", fill_gallery)
