"""Recordings as tables, and any table of numbers with a unit per column.

Stages: lines → columns of the first line of numbers → header → decimal mark → arrays → times.
"""

from __future__ import annotations

import codecs
import re
import zipfile
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.etree.ElementTree import ParseError

import numpy as np

from thud.base.checks import refuse, shown_text
from thud.base.errors import InputError
from thud.base.extras import require_extra
from thud.base.files import regular_file, require_small
from thud.base.units import factor_to, size_of
from thud.recordings.formats import MIN_SAMPLES, Channel, rises, uniform_grid
from thud.recordings.words import (
    COMMENT,
    DATE_TIME,
    GROUPING,
    MARKS,
    TRAILING,
    Layout,
    find_separator,
    is_number,
    is_time,
    read_facts,
    read_header,
    read_quantity,
    split_line,
)

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from numpy.typing import NDArray

    from thud.base.note import Note

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
        The numbers in the unit of the file; read-only.
    is_time : bool
        Whether title or unit are those of times.
    label : str
        Name of the file, number and title for messages.
    """

    number: int
    name: str
    unit: str
    values: NDArray[np.float64]
    is_time: bool
    label: str

    def to(self, unit: str, allowed: str = "") -> NDArray[np.float64]:
        """Return the numbers in a unit of `UNITS`; without a unit in the file it is that unit.

        Raise InputError if the unit of the file is not known or of another quantity.
        """
        return self.values * factor_to(unit, self.unit, self.label, allowed)


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


def read_channels(path: Path) -> list[Channel]:
    """Return the columns of numbers of a text file except times and sample numbers."""
    table = read_table(path)
    rows = len(table.columns[0].values)
    if rows < MIN_SAMPLES:
        count = f"{rows} rows of {len(table.columns)} numbers"
        refuse(f"{table.name}: {count}", f"{MIN_SAMPLES} rows or more of numbers")
    rate = read_facts(table.header, "", table.decimal).rate
    notes: tuple[Note, ...] = ()
    first, *others = table.columns
    time = next((c for c in table.columns if c.is_time), None) if others else None
    # Without a title or unit of times they are in the first column of the file, if that rises.
    if others and time is None and first.number == 1 and not first.unit:
        time = first if rate is None or rises(first.values) else None
    with np.errstate(invalid="ignore"):  # infinite numbers
        is_count = time is not None and not time.is_time and (np.diff(time.values) == 1).all()
    # Steps of 1 that are not stated to be times are sample numbers.
    if time is not None and not is_count:
        seconds = time.values * factor_to("s", time.unit, time.label)
        *_, rate, notes = uniform_grid(seconds, table.name, rate)
    channels = []
    for c in table.columns:
        facts = read_facts(table.header, c.unit)
        channel = Channel(
            c.name, c.number, rows, c.values, c.unit, rate, date=facts.date, notes=notes,
            unapplied=facts.unapplied,
        )  # fmt: skip
        channels += [] if c is time else [channel]
    return channels


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
        if is_workbook := file.suffix.lower() == ".xlsx":
            sheet, lines = _read_workbook(file, allowed)
            name = f"{name}, sheet {sheet!r}"
        else:
            lines = _read_lines(file, name, allowed)
        layout = _find_numbers(lines, name, allowed, "\t" if is_workbook else None)
        header, titles, has_titles = read_header(lines[: layout.first - 1], layout)
        decimal, shown = (".", 1) if is_workbook else _find_decimal(lines, layout)
        if layout.separator == "," and not shown and not has_titles:
            layout.refuse(
                layout.first,
                "the commas may separate columns or be decimal marks",
                "a title for each column, decimal points, or semicolons between columns",
            )
        layout = layout._replace(width=len(titles))
        values = _read_numbers(lines, layout, decimal, shown)
    except InputError:  # is a ValueError
        raise
    except (OSError, ValueError) as error:
        refuse(f"{name}: cannot be read ({shown_text(error)})", allowed, error)
    columns, values = [], values.T.copy()
    values.setflags(write=False)
    for i, numbers in zip(layout.units, values, strict=True):
        title, unit = titles[i]
        label = f"{name}: column {i + 1}" + (f", {shown_text(title)!r}" if title else "")
        columns.append(Column(i + 1, title, unit, numbers, is_time(title, unit), label))
    return Table(name, columns, header, decimal if shown else "", has_titles)


def _read_lines(path: Path, name: str, allowed: str) -> list[str]:
    """Return the lines of a text in Unicode, or as Japanese, Korean or Western spreadsheets write.

    The first bytes of kana and of common kanji in Shift JIS are control characters elsewhere. In
    Korean headers all bytes beyond ASCII are pairs of those of symbols and syllables.
    """
    require_small(path, "text")
    content = path.read_bytes()
    header = content[:MAX_HEADER_SIZE]
    encoding = "cp949" if HANGUL.sub(b"", header).isascii() else "latin-1"
    is_japanese = re.search(rb"[\x81-\x9f]", header)
    for trial in ("cp932", "utf-8") if is_japanese else ("utf-8",):
        with suppress(UnicodeDecodeError):
            codecs.getincrementaldecoder(trial)().decode(header)
            encoding = trial.replace("utf-8", "utf-8-sig")
    if header.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    text = content.decode(encoding, "replace")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if long := next((n for n, line in enumerate(lines, 1) if len(line) > MAX_LINE), 0):
        refuse(f"{name}: line {long} is longer than {MAX_LINE} characters", allowed)
    return lines


def _find_numbers(lines: list[str], name: str, allowed: str, separator: str | None) -> Layout:
    """Return the layout of the columns of the first line of numbers.

    Dates and times of day may precede the numbers, and further columns may hold words, such as a
    state, if they are less than half. A stated separator is that of all lines.
    """
    for first, line in enumerate(lines[:MAX_HEADER], 1):
        mark = separator
        if separator is None:
            text = COMMENT.split(line, 1)[0].strip(" \r")
            bare = text.rstrip(TRAILING)
            # Behind the only number of a line, a mark shows that its comma separates nothing.
            mark = find_separator(text if is_number(bare) else bare)
        cells = split_line(line, mark, is_row=True)
        filled = [i for i, cell in enumerate(cells) if cell]
        dates = [i for i in filled if DATE_TIME.fullmatch(cells[i])]
        quantities = {
            i: read_quantity(cells[i], ".") or read_quantity(cells[i], ",") for i in filled
        }
        units = {i: quantity[1] for i, quantity in quantities.items() if quantity}
        is_first = bool(units) and filled[0] in {*units, *dates}
        is_first = is_first and min(units) > max(dates, default=-1)
        if is_first and 2 * len(units) > len(filled) - len(dates):
            return Layout(name, allowed, mark, first, filled[-1] + 1, len(cells), units)
    return refuse(f"{name}: cannot be read (no numbers)", allowed)


def _find_decimal(lines: list[str], layout: Layout) -> tuple[str, int]:
    """Return the decimal mark of a table, and the number of the line that shows it, 0 if none.

    The first number that is valid with only one mark decides: ``0,5``, ``1.234,5`` and ``1,2345``
    show a decimal comma; ``1,575`` is ambiguous. Raise InputError, naming its line, if no number
    decides.
    """
    ambiguous: tuple[int, str] | None = None
    for line, text in enumerate(lines[layout.first - 1 :], layout.first):
        if "." not in text and "," not in text:
            continue
        cells = split_line(text, layout.separator, is_row=True)
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
    lines: list[str], layout: Layout, decimal: str, shown: int
) -> NDArray[np.float64]:
    """Return the columns of numbers, shape (n_row, n_column).

    NumPy reads a block of lines at once, unless it holds anything else than numbers.
    """
    count, separator = len(layout.units), layout.separator
    blocks: list[NDArray[np.float64]] = []
    for start in range(layout.first - 1, len(lines), BLOCK):
        block, values = lines[start : start + BLOCK], None
        text = "\n".join(block)
        if count == layout.width and not UNUSUAL[decimal].search(text):
            marks = TRAILING + (separator or "")
            rows = [line.rstrip(marks) for line in text.replace(decimal, ".").split("\n")]
            with suppress(ValueError, OverflowError):
                values = (
                    np.loadtxt(rows, delimiter=separator, comments=None, ndmin=2)
                    if any(rows)
                    else np.empty((0, count))  # of which NumPy warns
                )
        if values is None or values.shape[1] != count:
            read = [
                _read_row(number, cells, layout, decimal, shown)
                for number, line in enumerate(block, start + 1)
                if (cells := split_line(line, separator, is_row=True))
            ]
            values = np.array(read, dtype=np.float64).reshape(-1, count)
        blocks.append(values)
    return np.concatenate(blocks)


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
