"""Markup of reports: texts, tables and figures as HTML."""

from __future__ import annotations

import html
import re
from typing import TYPE_CHECKING

from thud.base.display import html_text
from thud.report.fonts import FAMILY
from thud.report.notes import shorten
from thud.report.rows import NOT_KNOWN

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

# Maximum length of a list of notes.
MAX_NOTES = 40


def plain(text: str) -> str:
    """Return a text as one line of printable characters."""
    line = " ".join(text.split())
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in line)


def escaped(text: str) -> str:
    """Return a text in one line as HTML."""
    return html.escape(plain(text))


def symbols(text: str) -> str:
    """Return a text in one line as HTML, with the indices of symbols below the line."""
    return html_text(plain(text))


def css_string(text: str) -> str:
    """Return a text for a string of CSS, with an escape for all but letters and digits."""
    return "".join(
        c if c.isascii() and (c.isalnum() or c == " ") else f"\\{ord(c):x} " for c in plain(text)
    )


def pair_rows(pairs: Iterable[tuple[str, str]]) -> str:
    """Return rows of a table of names and values; lines of a value stay lines."""
    rows = []
    for label, value in pairs:
        shown = "<br>".join(map(escaped, value.split("\n"))) if value else NOT_KNOWN
        rows.append(f'<tr><th>{escaped(label)}</th><td dir="auto">{shown}</td></tr>')
    return "\n".join(rows)


def labeled(cells: Sequence[str], head: Sequence[str]) -> str:
    """Return cells of a table with the titles of their columns, shown on narrow screens."""
    return "".join(
        f'<td data-label="{escaped(title)}">{cell}</td>'
        for cell, title in zip(cells, head, strict=True)
    )


def notes(title: str, messages: Sequence[str]) -> str:
    """Return a list of messages below a title; empty without messages."""
    items = "".join(f"<li>{escaped(message)}</li>" for message in shorten(messages, MAX_NOTES))
    return f"<h2>{escaped(title)}</h2><ul>{items}</ul>" if messages else ""


def inline_svg(svg: str, prefix: str) -> str:
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
    return f'{head} font-family="{FAMILY}">{text[text.index(">") + 1 :]}'


def _attributes(style: re.Match[str]) -> str:
    """Return the properties of a style as attributes; all texts have the font of the page."""
    pairs = re.findall(r"([\w-]+): ([^;]*)", style[1])
    return "".join(f' {name}="{value}"' for name, value in pairs if name != "font-family")
