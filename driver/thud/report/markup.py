"""Markup of reports: templates, texts and figures as HTML."""

from __future__ import annotations

import re
from typing import Any

from jinja2 import Environment, PackageLoader
from markupsafe import Markup

from thud.base.display import html_text
from thud.report.notes import shorten
from thud.report.pdf import FAMILY
from thud.report.rows import NOT_KNOWN

# Maximum length of a list of notes.
MAX_NOTES = 40


def plain(text: str) -> str:
    """Return a text as one line of printable characters."""
    line = " ".join(text.split())
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in line)


def _one_line(value: Any) -> Any:  # noqa: ANN401 - of a template
    """Return a text in one line; markup and other values as they are."""
    return plain(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _symbols(text: str) -> Markup:
    """Return a text in one line as HTML, with the indices of symbols below the line."""
    return text if isinstance(text, Markup) else Markup(html_text(plain(text)))  # noqa: S704


def _css_string(text: str) -> Markup:
    """Return a text for a string of CSS, with an escape for all but letters and digits."""
    escapes = (
        c if c.isascii() and (c.isalnum() or c == " ") else f"\\{ord(c):x} " for c in plain(text)
    )
    return Markup("".join(escapes))  # noqa: S704 - letters, digits and escapes


_TEMPLATES = Environment(
    loader=PackageLoader("thud.report", ""), autoescape=True, finalize=_one_line
)
_TEMPLATES.globals |= {"FAMILY": FAMILY, "NOT_KNOWN": NOT_KNOWN}
_TEMPLATES.filters |= {
    "symbols": _symbols,
    "css": _css_string,
    "shorten": lambda messages: shorten(messages, MAX_NOTES),
}


def render(template: str, **values: Any) -> str:  # noqa: ANN401 - of a template
    """Return a page by its template; texts are escaped, each as one line."""
    return _TEMPLATES.get_template(template).render(values)


def inline_svg(svg: str, prefix: str) -> Markup:
    """Return a figure as inline SVG; the prefix makes its identifiers unique on the page.

    Styles become attributes, which WeasyPrint reads in less than half the time.
    """
    text = re.sub(r"<metadata>.*?</metadata>", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    text = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{prefix}-", text)
    text = re.sub(r' style="([^"]*)"', _attributes, text)
    # Decimals of coordinates, not of texts.
    text = re.sub(r"<[^>]*>", lambda tag: re.sub(r"(\.\d\d)\d+", r"\1", tag[0]), text)
    box = re.search(r'viewBox="[^"]*"', text)
    assert box  # noqa: S101 - matplotlib writes it
    head = f'<svg class="figure" {box[0]} role="img" preserveAspectRatio="xMidYMax"'
    return Markup(f'{head} font-family="{FAMILY}">{text[text.index(">") + 1 :]}')  # noqa: S704


def _attributes(style: re.Match[str]) -> str:
    """Return the properties of a style as attributes; all texts have the font of the page."""
    pairs = re.findall(r"([\w-]+): ([^;]*)", style[1])
    return "".join(f' {name}="{value}"' for name, value in pairs if name != "font-family")
