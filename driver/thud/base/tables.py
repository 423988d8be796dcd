"""Tables of text."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


def format_rows(rows: Iterable[Sequence[str]]) -> str:
    """Return rows of text as lines with aligned columns.

    >>> print(format_rows([("octave", "level"), ("31.5", "39")]))
    octave  level
    31.5    39
    """
    table = list(rows)
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in table
    )
