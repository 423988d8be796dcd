"""Text and HTML of results, for consoles and notebooks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from thud.immutable import Immutable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

# What makes the figure, the dataset or the table of a result. The makers import the results, which
# therefore cannot import them: the package enters them.
MAKERS: dict[str, Callable[..., Any]] = {}


class Displayed(Immutable, ABC):
    """Base of results: their HTML is their text above a table."""

    @abstractmethod
    def rows(self) -> Sequence[Sequence[str]]:
        """Return header and rows of the table."""

    def _repr_html_(self) -> str:
        return f"<p>{_escaped(repr(self)[1:-1])}</p>\n{html_table(self.rows())}"


def html_table(rows: Iterable[Sequence[str]]) -> str:
    """Return rows of text, the header first, as HTML."""
    header, *body = (tuple(map(_escaped, row)) for row in rows)
    lines = [("th", header), *(("td", row) for row in body)]
    cells = ["".join(f"<{tag}>{cell}</{tag}>" for cell in row) for tag, row in lines]
    return "<table>\n" + "".join(f"<tr>{line}</tr>\n" for line in cells) + "</table>"


def _escaped(text: str) -> str:
    from html import escape  # noqa: PLC0415 - for notebooks only

    return escape(text)
