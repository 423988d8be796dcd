"""Results that are tables of numbers, a column for each quantity."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.display import Displayed
from thud.base.extras import data_frame, require_extra
from thud.base.tables import csv_text

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    import xarray as xr

    # Values of a column, shape (n_row,), and their format; by title with unit, such as "level, dB".
    Columns = Mapping[str, tuple[Any, str]]


class Tabulated(Displayed):
    """Base of results that are a table: all its forms follow from `columns`."""

    @abstractmethod
    def columns(self) -> Columns:
        """Return values, shape (n_row,), and their format by titles with units."""

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text; the text of NaN is empty."""
        return column_rows(self.columns())

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

        variables: dict[str, Any] = {}
        for title, (values, _) in self.columns().items():
            name, _, unit = title.replace(" ", "_").partition(",_")
            axis = next(iter(variables), name)
            variables[name] = (axis, np.asarray(values), {"units": unit.replace("_", " ") or "1"})
        return xr.Dataset(variables)

    def to_csv(self) -> str:
        """Return the table of `to_dataframe` as text, with ten digits."""
        named = self._named()
        rows = zip(*named.values(), strict=True)
        return csv_text([[*named], *([f"{value:.10g}" for value in row] for row in rows)])

    def _named(self) -> dict[str, Any]:
        """Return the values by names of variables, which end with units."""
        return {
            title.replace(", ", "_").replace("/", "_per_").replace(" ", "_"): np.asarray(values)
            for title, (values, _) in self.columns().items()
        }


def column_rows(columns: Columns) -> list[tuple[str, ...]]:
    """Return header and rows of text of `Tabulated.columns`."""
    cells = [
        ["" if np.isnan(value) else f"{value:{form}}" for value in values]
        for values, form in columns.values()
    ]
    return [tuple(columns), *zip(*cells, strict=True)]
