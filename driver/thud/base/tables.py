"""Tables and sentences that fit the terminal."""

from __future__ import annotations

import csv
import io
import re
import textwrap
from itertools import zip_longest
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

# Columns of a terminal and blanks between columns of a table.
WIDTH = 80
_GAP = "  "
# Columns of wider tables keep the width of their longest word, or label in the first column, within
# these limits: numbers with their uncertainties stay whole, and two columns fit.
_NARROW, _WIDE = 11, WIDTH // 2 - len(_GAP)


class _Wrapper(textwrap.TextWrapper):
    """Breaks lines also after the underscores in names of keys."""

    wordsep_re = re.compile(r"((?<=_)|\s+)")


def format_rows(rows: Iterable[Sequence[str]]) -> str:
    """Return rows of text as lines with aligned columns, up to `WIDTH` wide.

    Cells of wider tables are broken. If there are too many columns, they are distributed over two
    tables or more, each with the first column.

    >>> print(format_rows([("octave", "level"), ("31.5", "39")]))
    octave  level
    31.5    39
    """
    return _format_columns(list(zip(*rows, strict=True)))


def _format_columns(columns: Sequence[Sequence[str]]) -> str:
    widths = [max(1, *map(len, column)) for column in columns]
    words = [columns[0], *(_Wrapper.wordsep_re.split(" ".join(c)) for c in columns[1:])]
    minima = [min(_WIDE, max(_NARROW, *map(len, entries))) for entries in words]
    while sum(widths) + len(_GAP) * (len(widths) - 1) > WIDTH:
        reducible = [i for i, minimum in enumerate(minima) if widths[i] > minimum]
        if not reducible:
            half = (len(columns) + 1) // 2
            halves = columns[:half], [columns[0], *columns[half:]]
            return "\n\n".join(map(_format_columns, halves))
        widths[max(reducible, key=widths.__getitem__)] -= 1
    lines = []
    for row in zip(*columns, strict=True):
        broken = [_Wrapper(w).wrap(cell) or [""] for cell, w in zip(row, widths, strict=True)]
        for parts in zip_longest(*broken, fillvalue=""):
            cells = (part.ljust(width) for part, width in zip(parts, widths, strict=True))
            lines.append(_GAP.join(cells).rstrip())
    return "\n".join(lines)


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Return rows as CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def wrap(text: str) -> str:
    """Return text whose lines are up to `WIDTH` wide: long ones are broken, and then indented.

    Words and paths that are wider stay whole.

    >>> print(wrap("  " + "word " * 16))
      word word word word word word word word word word word word word word word
        word
    """
    lines = text.split("\n")
    for i, line in enumerate(lines):
        if len(line) > WIDTH:
            # Further lines of a comment are comments, too.
            indent = line[: len(line) - len(line.lstrip(" #"))] + "  "
            lines[i] = textwrap.fill(
                line, WIDTH, subsequent_indent=indent, break_long_words=False,
                break_on_hyphens=False,
            )  # fmt: skip
    return "\n".join(lines)
