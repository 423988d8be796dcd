"""Templates of pages, which escape all texts."""

from __future__ import annotations

import base64
import re

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from thud.base.display import html_text

# Font of printed pages, which comes with matplotlib.
FAMILY = "DejaVu Sans"
# Blanks between a number and its unit, and between a sign and its number.
_INSEPARABLE = re.compile(r"(?<=\d) (?=[^\W\d_]{1,4}\b|[%°/])| (?=[±=] )|(?<=[±=<>]) (?=\w)")
# The sign of a negative number, not of an exponent, a range or a date.
_NEGATIVE = re.compile(r"(?<![\w.])-(?=\d)")


def plain(text: str) -> str:
    """Return a text as one line of printable characters."""
    line = " ".join(text.split())
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in line)


def _typeset(value: object) -> object:
    """Return a text in one line with its numbers as they are printed; others as they are."""
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    return _INSEPARABLE.sub("\N{NO-BREAK SPACE}", _NEGATIVE.sub("\N{MINUS SIGN}", plain(value)))


def _symbols(text: str) -> Markup:
    """Return a text as HTML, with the indices of symbols below the line."""
    return Markup(html_text(f"{_typeset(text)}"))  # noqa: S704 - escaped


def _css_string(text: str) -> Markup:
    """Return a text for a string of CSS, with an escape for all but letters and digits."""
    escapes = (
        c if c.isascii() and (c.isalnum() or c == " ") else f"\\{ord(c):x} " for c in plain(text)
    )
    return Markup("".join(escapes))  # noqa: S704 - letters, digits and escapes


def _picture(content: bytes, media_type: str = "image/svg+xml") -> str:
    """Return a picture as an address that contains it."""
    return f"data:{media_type};base64,{base64.b64encode(content).decode()}"


_TEMPLATES = Environment(
    loader=PackageLoader("thud", ""), autoescape=True, finalize=_typeset, undefined=StrictUndefined
)
_TEMPLATES.globals["FAMILY"] = FAMILY
_TEMPLATES.filters |= {"symbols": _symbols, "css": _css_string, "picture": _picture}


def render(template: str, **values: object) -> str:
    """Return a page by its template, such as ``"report/floor.html"``."""
    return _TEMPLATES.get_template(template).render(values)
