"""Tables and sentences that fit the terminal."""

from __future__ import annotations

import csv
import io
import re
import textwrap
from itertools import zip_longest
from typing import TYPE_CHECKING

from thud.base._schema import VERDICTS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import Self

    Column = Sequence[str]

# Columns of a terminal, blanks between columns of a table, and the longest word that stays whole.
WIDTH = 80
_GAP = 2
_MAX_WORD = WIDTH // 2 - _GAP
# Cells are broken after spaces and underscores, but "1.2 ± 0.1", "5 %" and "3 to 4" stay whole.
_WORD = re.compile(r"(?:[^ _]| (?=[±%]|to \S)|(?<=±) |(?<= to) )*[ _]*")
# Marks without width before and behind a verdict, which a terminal shows as its color; the library
# uses the same (src/base/text.f90).
MARKS = {verdict: chr(number) for number, verdict in enumerate(VERDICTS, 1)}
END_MARK = chr(4)
_NO_MARKS = {ord(mark): None for mark in (*MARKS.values(), END_MARK)}


class Result(str):
    """Cell of a table that tells a verdict, an entry of `VERDICTS`, in words of its own."""

    __slots__ = ("verdict",)
    verdict: str

    def __new__(cls, text: str, verdict: str) -> Self:
        """Return the text with its verdict."""
        result = super().__new__(cls, text)
        result.verdict = verdict
        return result


def marked(text: str, verdict: str) -> str:
    """Return a text on a verdict between its marks."""
    return f"{MARKS[verdict]}{text}{END_MARK}"


def unmarked(text: str) -> str:
    """Return a text without marks."""
    return text.translate(_NO_MARKS)


def format_rows(rows: Iterable[Sequence[str]]) -> str:
    """Return rows of text as lines with aligned columns, up to `WIDTH` wide.

    Cells of wider tables are broken, those of the first column last. If there are too many
    columns, they are distributed over several tables, each with the first column.

    >>> print(format_rows([("octave", "level"), ("31.5", "39")]))
    octave  level
    31.5    39
    """
    columns = list(zip(*rows, strict=True))
    minima = [
        min(max(len(word.rstrip()) for cell in column for word in _WORD.findall(cell)), _MAX_WORD)
        for column in columns
    ]
    # As few tables as fit, with as many columns each or less in the first: the levels of all bands
    # stand in one.
    others = max(1, len(columns) - 1)
    for count in range(1, others + 1):
        size = -(-others // count)
        ends = range(len(columns), min(1, len(columns) - 1), -size)
        tables = [[0, *range(max(1, end - size), end)] for end in reversed(ends)]
        if all(_total([minima[i] for i in table]) <= WIDTH for table in tables):
            break
    return "\n\n".join(
        _format_table([columns[i] for i in table], [minima[i] for i in table]) for table in tables
    )


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
        if len(unmarked(line)) > WIDTH:
            # Further lines of a comment are comments, too.
            indent = line[: len(line) - len(line.lstrip(" #"))] + "  "
            lines[i] = textwrap.fill(
                line, WIDTH, subsequent_indent=indent, break_long_words=False,
                break_on_hyphens=False,
            )  # fmt: skip
    return "\n".join(lines)


def _format_table(columns: Sequence[Column], minima: Sequence[int]) -> str:
    """Return columns of text as lines; the widest are made narrower until the table fits.

    The labels in the first column stay whole if the table fits with them.
    """
    widths = [max(map(len, column)) for column in columns]
    label = min(widths[0], _MAX_WORD)
    if _total([label, *minima[1:]]) <= WIDTH:
        minima = [label, *minima[1:]]
    while _total(widths) > WIDTH:
        reducible = [i for i, minimum in enumerate(minima) if widths[i] > minimum]
        widths[max(reducible, key=widths.__getitem__)] -= 1
    broken = [[_break(cell, w) for cell in c] for c, w in zip(columns, widths, strict=True)]
    widths = [max((len(line) for cell in c for line in cell), default=0) for c in broken]
    lines = []
    for row, cells in zip(zip(*broken, strict=True), zip(*columns, strict=True), strict=True):
        for parts in zip_longest(*row, fillvalue=""):
            line = ""
            for part, width, cell in zip(parts, widths, cells, strict=True):
                is_marked = part and isinstance(cell, Result)
                line += marked(part, cell.verdict) if is_marked else part
                line += " " * (width + _GAP - len(part))
            lines.append(line.rstrip())
    return "\n".join(lines)


def _total(widths: Sequence[int]) -> int:
    """Return the width of a table."""
    return sum(widths) + _GAP * (len(widths) - 1)


def _break(cell: str, width: int) -> list[str]:
    """Return the lines of a cell; words that are wider are cut."""
    lines = [""]
    for word in _WORD.findall(cell):
        if lines[-1] and len((lines[-1] + word).rstrip()) > width:
            lines.append("")
        lines[-1] += word
        while len(lines[-1].rstrip()) > width:
            lines[-1:] = [lines[-1][:width], lines[-1][width:]]
    return [line.rstrip() for line in lines]
