"""Text, HTML, tables and figures of results."""

from __future__ import annotations

import re
import warnings
from abc import ABC, abstractmethod
from contextlib import contextmanager
from html import escape
from importlib import import_module
from itertools import chain, repeat
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from thud.base.checks import refuse, shown_text
from thud.base.errors import ReportWarning
from thud.base.extras import data_frame, require_extra
from thud.base.files import replace_file, require_ending
from thud.base.immutable import Immutable
from thud.base.note import decimal_text
from thud.base.tables import csv_text

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base.note import Note

    # Values of a column, shape (n_row,), and their format; by title with unit, such as "level, dB".
    Columns = Mapping[str, tuple[Iterable[float | str], str]]

_SYMBOL = re.compile(r"\b([CL])_(FE|I|iA,Fmax|n,w)\b")


class Displayed(Immutable, ABC):
    """Base of results: a line and a table of texts, which HTML has both, figure, data and file."""

    # Module and function of `thud.plot` that draws a result; matplotlib is slow to import.
    drawn_by: ClassVar[str] = ""

    @property
    def notes(self) -> tuple[Note, ...]:
        """Facts that a user of the result should know."""
        return ()

    @abstractmethod
    def rows(self) -> Sequence[Sequence[str]]:
        """Return header and rows of the table."""

    @abstractmethod
    def to_dataframe(self) -> pd.DataFrame:
        """Return the result as a table; raise InputError if pandas is not installed."""

    @abstractmethod
    def to_xarray(self) -> xr.Dataset:
        """Return the result with units; raise InputError if xarray is not installed."""

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the result in a new figure, or its main panel in the stated axes.

        Return the figure; raise InputError for a result without one, such as a rating.
        """
        if not self.drawn_by:
            refuse(f"{self!r} has no figure", "its table")
        module, function = self.drawn_by.split(".")
        figure: Figure = getattr(import_module(f"thud.plot.{module}"), function)(self, ax)
        return figure

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the table to a CSV file, which is replaced as a whole; an OSError names its path.

        Raise InputError if the path does not end with ``.csv`` or pandas is not installed.
        """
        replace_file(require_ending(path, ".csv"), self.to_dataframe().to_csv().encode())

    def _repr_html_(self) -> str:
        rows = zip(chain(["th"], repeat("td")), self.rows(), strict=False)
        cells = ("".join(f"<{tag}>{html_text(cell)}</{tag}>" for cell in row) for tag, row in rows)
        table = "".join(f"<tr>{cell}</tr>\n" for cell in cells)
        return f"<p>{html_text(repr(self)[1:-1])}</p>\n<table>\n{table}</table>"


class Tabulated(Displayed):
    """Base of results that are a table of values: all its forms follow from `columns`."""

    # Whether texts have about ten rows at equal distances, as of histories and spectra.
    is_curve: ClassVar[bool] = False

    @abstractmethod
    def columns(self) -> Columns:
        """Return numbers or texts, shape (n_row,), and their format by titles with units."""

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text; the text of NaN is empty."""
        header, *rows = column_rows(self.columns())
        return [header, *rows[:: max(1, len(rows) // 10) if self.is_curve else 1]]

    def to_dataframe(self) -> pd.DataFrame:
        """Return the table, with columns such as ``"level_dB"``.

        Raise InputError if pandas is not installed.
        """
        return data_frame(self._named())

    def to_xarray(self) -> xr.Dataset:
        """Return the table as a dataset over its first column, with units.

        Raise InputError if xarray is not installed.
        """
        with require_extra("studies"):
            import xarray as xr

        units = [title.partition(", ")[2] or "1" for title in self.columns()]
        names = [title.partition(", ")[0].replace(" ", "_") for title in self.columns()]
        columns = zip(names, units, self._named().values(), strict=True)
        return xr.Dataset({n: (names[0], v, {"units": unit}) for n, unit, v in columns})

    def to_csv(self) -> str:
        """Return the table of `to_dataframe` as text, with ten digits."""
        rows = zip(*(values.tolist() for values in self._named().values()), strict=True)
        texts = ([v if isinstance(v, str) else f"{v:.10g}" for v in row] for row in rows)
        return csv_text([[*self._named()], *texts])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write `to_csv` to a file, which is replaced as a whole; an OSError names its path.

        Raise InputError if the path does not end with ``.csv``.
        """
        replace_file(require_ending(path, ".csv"), self.to_csv().encode())

    def _named(self) -> dict[str, NDArray[Any]]:
        """Return the values by names of variables, which end with units."""
        return {
            title.replace(", ", "_").replace("/", "_per_").replace(" ", "_"): np.asarray(values)
            for title, (values, _) in self.columns().items()
        }


def column_rows(columns: Columns) -> list[tuple[str, ...]]:
    """Return header and rows of text of `Tabulated.columns`."""
    # NaN alone differs from itself.
    cells = [
        ["" if v != v else decimal_text(v, form) for v in values]  # noqa: PLR0124
        for values, form in columns.values()
    ]
    return [tuple(columns), *zip(*cells, strict=True)]


@contextmanager
def warn_if_not_drawn(figure: str) -> Iterator[None]:
    """Warn instead of raising any error while a figure is drawn; results do not depend on it."""
    try:
        yield
    except Exception as error:
        # Compiled modules turn an interrupt into another error.
        if isinstance(error.__cause__ or error.__context__, KeyboardInterrupt):
            raise
        cause = shown_text(error, 100) or type(error).__name__
        message = f"{figure} is not drawn ({cause}); the results are complete without it"
        warnings.warn(message, ReportWarning, stacklevel=4)


def draw_all(draws: Mapping[str, Callable[[], Figure | None]]) -> dict[str, Figure]:
    """Return figures by name; figures that are empty or cannot be drawn are omitted."""
    drawn = {}
    for name, draw in draws.items():
        with warn_if_not_drawn(name):
            if (figure := draw()) is not None:
                drawn[name] = figure
    return drawn


def html_text(text: str) -> str:
    """Return a text as HTML, with the indices of symbols such as L_iA,Fmax below the line."""
    return _SYMBOL.sub(r"<i>\1</i><sub>\2</sub>", escape(text))
