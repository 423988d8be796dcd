"""Tables of text."""

from __future__ import annotations

import re
from functools import lru_cache
from itertools import zip_longest
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

MAX_WIDTH = 99
# Cells are broken after spaces and underscores, but numbers keep their signs.
_WORD = re.compile(r"(?:[^ _]| (?=[±%]))*[ _]*")


def format_rows(rows: Iterable[Sequence[str]]) -> str:
    """Return rows of text as lines with aligned columns.

    Cells of tables wider than `MAX_WIDTH` are broken, but not those of the first column.

    >>> print(format_rows([("octave", "level"), ("31.5", "39")]))
    octave  level
    31.5    39
    """
    table = list(rows)
    columns = list(zip(*table, strict=True))
    widths = [max(map(len, column)) for column in columns]
    minima = [max(len(w.rstrip()) for c in column for w in _WORD.findall(c)) for column in columns]
    minima[:1] = widths[:1]
    while sum(widths) + 2 * (len(widths) - 1) > MAX_WIDTH and widths != minima:
        # The column that adds the fewest lines; of several, the widest.
        narrower = [
            (_height(table, trial), -width, trial)
            for i, (width, least) in enumerate(zip(widths, minima, strict=True))
            if width > least
            for trial in [[*widths[:i], width - 1, *widths[i + 1 :]]]
        ]
        widths = min(narrower)[-1]
    broken = [[_break(c, w) for c, w in zip(row, widths, strict=True)] for row in table]
    widths = [max(len(line) for c in column for line in c) for column in zip(*broken, strict=True)]
    return "\n".join(
        "  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip()
        for row in broken
        for line in zip_longest(*row, fillvalue="")
    )


def _height(table: Iterable[Sequence[str]], widths: Sequence[int]) -> int:
    """Return the number of lines of a table."""
    return sum(max(len(_break(c, w)) for c, w in zip(row, widths, strict=True)) for row in table)


@lru_cache(4096)
def _break(cell: str, width: int) -> list[str]:
    """Return the lines of a cell."""
    lines = [""]
    for word in _WORD.findall(cell):
        if lines[-1] and len((lines[-1] + word).rstrip()) > width:
            lines.append("")
        lines[-1] += word
    return [line.rstrip() for line in lines]
