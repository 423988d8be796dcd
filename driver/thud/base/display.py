"""Text, HTML and figures of results."""

from __future__ import annotations

import re
import warnings
from abc import ABC, abstractmethod
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING

from thud.base.errors import ReportWarning
from thud.base.immutable import Immutable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from matplotlib.figure import Figure

_SYMBOL = re.compile(r"\b([CL])_(FE|I|iA,Fmax|n,w)\b")
# Maximum length of a cause in a warning.
_MAX_CAUSE = 100


class Displayed(Immutable, ABC):
    """Base of results; their HTML is their text above a table."""

    @abstractmethod
    def rows(self) -> Sequence[Sequence[str]]:
        """Return header and rows of the table."""

    def _repr_html_(self) -> str:
        return f"<p>{html_text(repr(self)[1:-1])}</p>\n{html_table(self.rows())}"


@contextmanager
def warn_if_not_drawn(figure: str) -> Iterator[None]:
    """Warn instead of raising any error while a figure is drawn; results do not depend on it."""
    try:
        yield
    except Exception as error:
        # Compiled modules turn an interrupt into another error.
        if isinstance(error.__cause__ or error.__context__, KeyboardInterrupt):
            raise
        cause = (str(error) or type(error).__name__).partition("\n")[0][:_MAX_CAUSE]
        message = f"{figure} is not drawn ({cause}); the results are complete without it"
        warnings.warn(message, ReportWarning, stacklevel=4)


def draw_all(draws: Mapping[str, Callable[[], Figure | None]]) -> dict[str, Figure]:
    """Return figures by name; figures that are empty or cannot be drawn are omitted."""
    drawn = {}
    for name, draw in draws.items():
        with warn_if_not_drawn(name):
            figure = draw()
            if figure is not None:
                drawn[name] = figure
    return drawn


def html_table(rows: Iterable[Sequence[str]]) -> str:
    """Return rows of text, the header first, as HTML."""
    header, *body = (tuple(map(html_text, row)) for row in rows)
    lines = [("th", header), *(("td", row) for row in body)]
    cells = ["".join(f"<{tag}>{cell}</{tag}>" for cell in row) for tag, row in lines]
    return "<table>\n" + "".join(f"<tr>{line}</tr>\n" for line in cells) + "</table>"


def html_text(text: str) -> str:
    """Return a text as HTML, with the indices of symbols such as L_iA,Fmax below the line."""
    return _SYMBOL.sub(r"<i>\1</i><sub>\2</sub>", escape(text))
