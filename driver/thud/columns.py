"""Files of numbers in columns, as instruments and spreadsheets write them."""

from __future__ import annotations

import errno
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thud.errors import InputError

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

# The first of these that a line contains separates its columns; otherwise blanks do.
SEPARATORS = ("\t", ";", ",")
ALLOWED = (
    "columns of time, s, and force, N, separated by commas, semicolons, tabs or "
    "blanks (decimal commas with semicolons and tabs)"
)


def read_table(path: str | os.PathLike[str]) -> NDArray[np.float64]:
    """Return the numbers of a file of columns, shape (n_row, n_column); see `read_titled`."""
    return read_titled(path, ALLOWED)[1]


def read_titled(
    path: str | os.PathLike[str], allowed: str
) -> tuple[list[str], NDArray[np.float64]]:
    """Return the titles of a file of columns and its numbers, shape (n_row, n_column).

    The titles are the cells of the line above the first number, none where there is no such line.

    Commas, semicolons, tabs or blanks separate the columns; decimal commas are read with
    semicolons and tabs. Empty lines, comments after ``#`` and lines above the first number are
    skipped.

    Raises
    ------
    InputError
        Names the file, and the line that is not numeric or has another number of columns.
    """
    try:
        if not Path(path).is_file():  # to open a pipe could block
            raise FileNotFoundError(errno.ENOENT, "no such regular file", str(path))
        # A header may be in another encoding than UTF-8.
        text = Path(path).read_text(encoding="utf-8-sig", errors="replace")
    except (OSError, ValueError) as error:
        message = f"{path}: cannot be read ({error}); allowed: {allowed}"
        raise InputError(message) from error
    titles: list[str] = []
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        cells = _cells(line)
        found = [_number(cell) for cell in cells]
        if not cells:
            continue
        if not rows and found.count(None) == len(found):
            titles = cells
            continue
        if None in found:
            cell = cells[found.index(None)]
            message = f"{path}: line {number}: {cell[:40]!r} is not a number; allowed: {allowed}"
            raise InputError(message)
        if rows and len(found) != len(rows[0]):
            message = (
                f"{path}: line {number}: {len(found)} columns, {len(rows[0])} above it; "
                f"allowed: {allowed}"
            )
            raise InputError(message)
        rows.append([value for value in found if value is not None])
    if not rows:
        message = f"{path}: cannot be read (no numbers); allowed: {allowed}"
        raise InputError(message)
    return titles, np.array(rows)


def _cells(line: str) -> list[str]:
    """Return the cells of a line."""
    rest = line.partition("#")[0].strip().rstrip(";")
    separator = next((one for one in SEPARATORS if one in rest), None)
    if separator == ",":
        return [cell.strip() for cell in rest.split(separator)]
    return [cell.strip().replace(",", ".") for cell in rest.split(separator)]


def _number(cell: str) -> float | None:
    """Return the number in a cell; None where it is not one."""
    try:
        return float(cell)
    except ValueError:
        return None
