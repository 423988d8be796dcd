"""Tables of numbers from spreadsheets, instruments and data loggers, with a unit per column.

Stages: lines → columns of the first line of numbers → header → decimal mark → arrays.
"""

from __future__ import annotations

import codecs
import itertools
import re
import zipfile
from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.etree.ElementTree import ParseError

import numpy as np

from thud.base.checks import refuse, shown_text
from thud.base.errors import InputError
from thud.base.extras import require_extra
from thud.base.files import regular_file, require_small
from thud.base.units import factor_to, size_of
from thud.recordings.header import Layout, read_header
from thud.recordings.words import (
    COMMENT,
    DATE_TIME,
    GROUPING,
    MARKS,
    TRAILING,
    find_separator,
    is_number,
    is_time,
    read_quantity,
    split_row,
)

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

# Maximum length of a line, and number of lines in a header.
MAX_LINE = 2**16
MAX_HEADER = 1000
# Maximum number of rows that are read of a sheet.
MAX_ROWS = 10_000
# Number of lines per conversion.
BLOCK = 2**14
# By decimal mark: characters that np.loadtxt cannot read, so that lines are read one by one.
UNUSUAL = {
    ".": re.compile(rf'["#{GROUPING.strip(" ")}]'),
    ",": re.compile(rf'["#{GROUPING.strip(" ")}.]|,(?!\d)'),
}
# Number of bytes from which the encoding is determined, and pairs of bytes of Korean symbols (as
# the degree Celsius) and syllables.
MAX_HEADER_SIZE = 2**16
HANGUL = re.compile(rb"[\xa1-\xc8][\xa1-\xfe]")
ALLOWED = (
    "columns of numbers, separated by commas, semicolons, tabs or blanks (decimal commas with "
    "semicolons, tabs and blanks, or in quotes)"
)


@dataclass(frozen=True, eq=False)
class Column:
    """Numbers of one column.

    Attributes
    ----------
    number : int
        Number of the column in the file, from 1.
    name, unit : str
        Title, and unit as the file states it; empty if there is none.
    values : ndarray, shape (n_row,)
        The numbers in the unit of the file.
    is_time : bool
        Whether title or unit are those of times.
    table : str
        Name of the file.
    """

    number: int
    name: str
    unit: str
    values: NDArray[np.float64]
    is_time: bool = False
    table: str = ""

    def __str__(self) -> str:
        """Return number and title for messages."""
        return f"column {self.number}" + (f", {shown_text(self.name)!r}" if self.name else "")

    def to(self, unit: str, allowed: str = "") -> NDArray[np.float64]:
        """Return the numbers in a unit of `UNITS`; without a unit in the file it is that unit.

        Raise InputError if the unit of the file is not known or of another quantity.
        """
        return self.values * factor_to(unit, self.unit, f"{self.table}: {self}", allowed)


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of numbers of a file, and what its header states.

    Attributes
    ----------
    name : str
        Path of the file for messages.
    columns : list of Column
        Columns of numbers; columns of words, dates and times of day, and empty ones are left out.
    header : list of tuple of str
        Names and values of the header.
    decimal : str
        Decimal mark, if a number shows it.
    has_titles : bool
        Whether the file has a line of titles.
    """

    name: str
    columns: list[Column]
    header: list[tuple[str, str]]
    decimal: str = ""
    has_titles: bool = False


def read_table(path: str | os.PathLike[str], allowed: str = ALLOWED) -> Table:
    """Read a text of columns, or the first sheet with numbers of a workbook (.xlsx).

    Separators (commas, semicolons, tabs, blanks) and decimal mark hold for all numbers. Lines above
    the first number are titles, units, or names and values. A unit of a column stands in its title,
    in a line of units, in the header or in its cells. Columns without numbers are left out.

    Raises
    ------
    InputError
        If the file has no numbers, if a cell is not a number, if rows or titles do not fit the
        number of columns, or if units are stated that cannot be attributed to a column; the message
        names file and line.
    """
    file = regular_file(path)
    name = shown_text(file)
    try:
        lines: Callable[[], Iterable[str]]
        if is_workbook := file.suffix.lower() == ".xlsx":
            sheet, rows = _read_workbook(file, allowed)
            name, lines = f"{name}, sheet {sheet!r}", lambda: rows
        else:
            require_small(file, "text")
            encoding = _find_encoding(file)
            lines = lambda: _read_lines(file, encoding, name, allowed)  # noqa: E731
        above, layout = _find_numbers(lines(), name, allowed, "\t" if is_workbook else None)
        header, titles, has_titles = read_header(above, layout)
        decimal, shown = (".", 1) if is_workbook else _find_decimal(lines(), layout)
        if layout.separator == "," and not shown and not has_titles:
            layout.refuse(
                layout.first,
                "the commas may separate columns or be decimal marks",
                "a title for each column, decimal points, or semicolons between columns",
            )
        layout = layout._replace(width=len(titles))
        values = _read_numbers(lines(), layout, decimal, shown)
    except InputError:  # is a ValueError
        raise
    except (OSError, ValueError) as error:
        refuse(f"{name}: cannot be read ({shown_text(error)})", allowed, error)
    columns = [
        Column(i + 1, *titles[i], numbers, is_time(*titles[i]), name)
        for i, numbers in zip(layout.units, values.T.copy(), strict=True)
    ]
    return Table(name, columns, header, decimal if shown else "", has_titles)


# Lines.


def _find_encoding(path: Path) -> str:
    """Return the encoding of a text: Unicode, or that of Japanese, Korean or Western spreadsheets.

    The first bytes of kana and of common kanji in Shift JIS are control characters elsewhere. In
    Korean headers all bytes beyond ASCII are pairs of those of symbols and syllables.
    """
    with path.open("rb") as file:
        header = file.read(MAX_HEADER_SIZE)
    if header.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    is_japanese = re.search(rb"[\x81-\x9f]", header)
    for encoding in ("utf-8", "cp932") if is_japanese else ("utf-8",):
        try:
            codecs.getincrementaldecoder(encoding)().decode(header)
        except UnicodeDecodeError:
            continue
        return encoding.replace("utf-8", "utf-8-sig")
    return "cp949" if HANGUL.sub(b"", header).isascii() else "latin-1"


def _read_lines(path: Path, encoding: str, name: str, allowed: str) -> Iterator[str]:
    """Yield the lines of a text without line ends; refuse long ones."""
    with path.open(encoding=encoding, errors="replace") as text:
        for number, line in enumerate(iter(lambda: text.readline(MAX_LINE + 2), ""), start=1):
            if len(line) > MAX_LINE + 1:
                refuse(f"{name}: line {number} is longer than {MAX_LINE} characters", allowed)
            yield line.removesuffix("\n")


def _find_numbers(
    lines: Iterable[str], name: str, allowed: str, separator: str | None
) -> tuple[list[str], Layout]:
    """Return the lines above the first line of numbers, and the layout of its columns.

    Dates and times of day may precede the numbers, and further columns may hold words, such as a
    state, if they are less than half. A stated separator is that of all lines.
    """
    above: list[str] = []
    for line in itertools.islice(lines, MAX_HEADER):
        mark = separator
        if separator is None:
            text = COMMENT.split(line, 1)[0].strip(" \r")
            bare = text.rstrip(TRAILING)
            # Behind the only number of a line, a mark shows that its comma separates nothing.
            mark = find_separator(text if is_number(bare) else bare)
        cells = split_row(line, mark)
        filled = [i for i, cell in enumerate(cells) if cell]
        dates = [i for i in filled if DATE_TIME.fullmatch(cells[i])]
        quantities = {
            i: read_quantity(cells[i], ".") or read_quantity(cells[i], ",") for i in filled
        }
        units = {i: quantity[1] for i, quantity in quantities.items() if quantity}
        is_first = bool(units) and filled[0] in {*units, *dates}
        is_first = is_first and min(units) > max(dates, default=-1)
        if not is_first or 2 * len(units) <= len(filled) - len(dates):
            above.append(line)
            continue
        first, width = len(above) + 1, filled[-1] + 1
        return above, Layout(name, allowed, mark, first, width, len(cells), units)
    return refuse(f"{name}: cannot be read (no numbers)", allowed)


# Numbers.


def _find_decimal(lines: Iterable[str], layout: Layout) -> tuple[str, int]:
    """Return the decimal mark of a table, and the number of the line that shows it, 0 if none.

    The first number that is valid with only one mark decides: ``0,5``, ``1.234,5`` and ``1,2345``
    show a decimal comma; ``1,575`` is ambiguous. Raise InputError, naming its line, if no number
    decides.
    """
    ambiguous: tuple[int, str] | None = None
    for line, text in itertools.islice(enumerate(lines, 1), layout.first - 1, None):
        if "." not in text and "," not in text:
            continue
        cells = split_row(text, layout.separator)
        for cell in (cells[i] for i in layout.units if i < len(cells)):
            if "." not in cell and "," not in cell:
                continue
            marks = [mark for mark in MARKS if read_quantity(cell, mark)]
            if layout.separator == "," and '"' not in text:  # its commas separate columns
                marks = [mark for mark in marks if mark == "."]
            if len(marks) == 1:
                return marks[0], line
            if marks and ambiguous is None:
                ambiguous = line, cell
    if ambiguous is None:
        return ".", 0
    line, cell = ambiguous
    values = [read[0] for mark in MARKS if (read := read_quantity(cell, mark))]
    value = values["," in cell]
    return layout.refuse(
        line,
        f"{cell!r} may be {' or '.join(f'{v:.15g}' for v in values)}, and no number of the table "
        "decides",
        f"tables with a number that shows the decimal mark, such as {cell}0 for {value:.15g}",
    )


def _read_numbers(
    lines: Iterable[str], layout: Layout, decimal: str, shown: int
) -> NDArray[np.float64]:
    """Return the columns of numbers, shape (n_row, n_column)."""
    count = len(layout.units)
    blocks: list[NDArray[np.float64]] = []
    rows = itertools.islice(enumerate(lines, 1), layout.first - 1, None)
    while block := list(itertools.islice(rows, BLOCK)):
        values = None
        if count == layout.width:
            values = _convert([line for _, line in block], count, layout.separator, decimal)
        if values is None:
            cells = [(line, split_row(text, layout.separator)) for line, text in block]
            read = [_read_row(line, row, layout, decimal, shown) for line, row in cells if row]
            values = np.array(read, dtype=np.float64).reshape(-1, count)
        blocks.append(values)
    return np.concatenate(blocks)


def _convert(
    lines: list[str], count: int, separator: str | None, decimal: str
) -> NDArray[np.float64] | None:
    """Return the numbers of lines at once; None if they hold anything else."""
    text = "\n".join(lines)
    if UNUSUAL[decimal].search(text):
        return None
    text = text.replace(decimal, ".")
    lines = [line.rstrip(TRAILING + (separator or "")) for line in text.split("\n")]
    if not any(lines):  # of which NumPy warns
        return np.empty((0, count))
    try:
        values = np.loadtxt(lines, delimiter=separator, comments=None, ndmin=2, dtype=np.float64)
    except (ValueError, OverflowError):
        return None
    # Empty lines are left out.
    return values if values.shape[1] == count else None


def _read_row(line: int, cells: list[str], layout: Layout, decimal: str, shown: int) -> list[float]:
    """Return the numbers in the cells of a line; raise InputError if it is wrong."""
    if len(cells) <= max(layout.units) or any(cells[layout.width :]):
        layout.refuse(line, f"{len(cells)} columns, {layout.width} in the lines above")
    row = []
    for i, unit in layout.units.items():
        quantity = read_quantity(cells[i], decimal)
        (base, size), (own_base, own_size) = size_of(unit), size_of(quantity[1] if quantity else "")
        if quantity is None or own_base != base:
            reason = f"{shown_text(cells[i])!r} is not a number"
            if unit:
                reason += f" in {unit}"
            elif is_number(cells[i]) and shown:
                reason += f" with the decimal {MARKS[decimal]} of line {shown}"
            layout.refuse(line, reason)
        row.append(quantity[0] * own_size / size)
    for i in {*range(len(cells))} - {*layout.units}:
        if is_number(cells[i]):
            text = f"column {i + 1} has a number, {shown_text(cells[i])}, but none in line "
            layout.refuse(line, text + str(layout.first), "columns of numbers or of words")
    return row


def _read_workbook(path: Path, allowed: str) -> tuple[str, list[str]]:
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
            return name, ["\t".join(map(_cell_text, row)) for row in rows]
    return refuse(f"{path}: cannot be read (no numbers)", allowed)


def _cell_text(cell: object) -> str:
    return "" if cell is None else " ".join(str(cell).replace('"', "'").split())
