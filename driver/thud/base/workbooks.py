"""Tables in workbooks of spreadsheet programs (.xlsx)."""

from __future__ import annotations

import io
import zipfile
from typing import TYPE_CHECKING
from xml.etree.ElementTree import ParseError

from thud.base.checks import refuse
from thud.base.extras import require_extra

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping, Sequence

# Maximum width of a column that is written, characters.
_MAX_WIDTH = 60
# Maximum number of rows that are read of a sheet.
MAX_ROWS = 10_000


def read_workbook(path: str | os.PathLike[str], allowed: str) -> tuple[str, list[str]]:
    """Return the name of the first sheet that has numbers, and its rows, cells separated by tabs.

    Cells of formulas have the value that the spreadsheet program has saved.
    """
    with require_extra("workbooks"):
        import openpyxl
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        sheets = {
            sheet.title: list(sheet.iter_rows(max_row=MAX_ROWS + 1, values_only=True))
            for sheet in book.worksheets
        }
        book.close()
    except (OSError, KeyError, ValueError, TypeError, zipfile.BadZipFile, ParseError) as error:
        refuse(f"{path}: cannot be read ({error})", allowed, error)
    for name, rows in sheets.items():
        if any(isinstance(cell, int | float) for row in rows for cell in row):
            if len(rows) > MAX_ROWS:
                refuse(f"{path}: sheet {name!r} has more than {MAX_ROWS} rows", "a table as text")
            return name, ["\t".join(map(_text, row)) for row in rows]
    return refuse(f"{path}: cannot be read (no numbers)", allowed)


def _text(cell: object) -> str:
    return "" if cell is None else " ".join(str(cell).replace('"', "'").split())


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
            values = (cell.value for cell in column)
            shown = (f"{v:.9g}" if isinstance(v, float) else str(v) for v in values)
            width = min(max(map(len, shown)) + 2, _MAX_WIDTH)
            sheet.column_dimensions[column[0].column_letter].width = width
    content = io.BytesIO()
    book.save(content)
    return content.getvalue()
