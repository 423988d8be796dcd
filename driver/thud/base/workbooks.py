"""Tables in workbooks of spreadsheet programs (.xlsx)."""

from __future__ import annotations

import io
import zipfile
from typing import TYPE_CHECKING, TypeGuard
from xml.etree.ElementTree import ParseError

import numpy as np

from thud.base.checks import refuse
from thud.base.extras import require_extra

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

# Maximum width of a column that is written, characters.
_MAX_WIDTH = 60
# Maximum number of rows that are read of a sheet.
MAX_ROWS = 10_000


def read_workbook(
    path: str | os.PathLike[str], allowed: str
) -> tuple[list[str], NDArray[np.float64]]:
    """Return titles and numbers, shape (n_row, n_column), of the first sheet that has numbers.

    The titles are the row above the first number. Empty rows and columns are skipped. Raise
    InputError, naming file, sheet and row, if a cell is no number; cells of formulas have the value
    that the spreadsheet program has saved.
    """
    with require_extra("workbooks"):
        import openpyxl
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        sheets = {
            sheet.title: list(sheet.iter_rows(max_row=MAX_ROWS, values_only=True))
            for sheet in book.worksheets
        }
        book.close()
    except (OSError, KeyError, ValueError, TypeError, zipfile.BadZipFile, ParseError) as error:
        refuse(f"{path}: cannot be read ({error})", allowed, error)
    for name, rows in sheets.items():
        if any(_is_number(cell) for row in rows for cell in row):
            return _split(f"{path}, sheet {name!r}", rows, allowed)
    return refuse(f"{path}: cannot be read (no numbers)", allowed)


def workbook(sheets: Mapping[str, Iterable[Sequence[str | float]]]) -> bytes:
    """Return a workbook of tables by the names of their sheets, each with a header row.

    Raise InputError if openpyxl is not installed.
    """
    with require_extra("workbooks"):
        import openpyxl
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(list(row))
            for cell in sheet[sheet.max_row]:
                # A text that begins with an equals sign is no formula.
                if isinstance(cell.value, str):
                    cell.data_type = "s"
        sheet.freeze_panes = "B2"
        for column in sheet.columns:
            width = max(len(_shown(cell.value)) for cell in column) + 2
            sheet.column_dimensions[column[0].column_letter].width = min(width, _MAX_WIDTH)
    content = io.BytesIO()
    book.save(content)
    return content.getvalue()


def _shown(value: object) -> str:
    """Return a cell about as spreadsheet programs show it."""
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _split(
    name: str, rows: list[tuple[object, ...]], allowed: str
) -> tuple[list[str], NDArray[np.float64]]:
    """Return the titles and the numbers of the rows of a sheet."""
    filled = [(number, row) for number, row in enumerate(rows, 1) if _columns(row)]
    first = next(i for i, (_, row) in enumerate(filled) if any(map(_is_number, row)))
    columns = _columns(filled[first][1])
    titles = [""] * len(columns)
    if first:
        above = filled[first - 1][1]
        columns = sorted({*columns, *_columns(above)})
        titles = [str(_cell(above, i) or "") for i in columns]
    table = np.empty((len(filled) - first, len(columns)))
    for values, (number, row) in zip(table, filled[first:], strict=True):
        if extra := {*_columns(row)} - {*columns}:
            refuse(f"{name}: row {number}: column {min(extra) + 1} has no title", allowed)
        for i, column in enumerate(columns):
            cell = _cell(row, column)
            if not _is_number(cell):
                shown = "empty" if cell is None else f"{str(cell)[:40]!r}, not a number"
                refuse(f"{name}: row {number}, column {column + 1} is {shown}", allowed)
            values[i] = cell
    return titles, table


def _columns(row: Iterable[object]) -> list[int]:
    """Return the indices of the cells of a row that are not empty."""
    return [i for i, cell in enumerate(row) if cell is not None and str(cell).strip()]


def _cell(row: tuple[object, ...], column: int) -> object:
    """Return a cell of a row, None beyond its end."""
    return row[column] if column < len(row) else None


def _is_number(cell: object) -> TypeGuard[float]:
    return isinstance(cell, int | float) and not isinstance(cell, bool)
