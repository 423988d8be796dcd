"""Tables of numbers from spreadsheets, instruments and data loggers, with a unit per column.

Stages: lines → columns of the first line of numbers → header → decimal mark → arrays.
"""

from __future__ import annotations

import codecs
import itertools
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse, require_kind
from thud.base.errors import InputError
from thud.base.units import factor_to, find_unit, size_of
from thud.base.workbooks import read_workbook
from thud.recordings.channel import MAX_COLUMNS, require_small, shown_path, shown_text
from thud.recordings.header import TRAILING, Layout, read_cell, read_header
from thud.recordings.times import DATE as DATE_CELL, seconds_of_day
from thud.recordings.words import (
    COMMENT,
    GROUPING,
    MARKS,
    NUMBERS,
    WORDS,
    find_separator,
    is_number,
    is_time,
    plain,
    split_title,
    to_number,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

# Maximum length of a line, number of lines in a header, and of numbers in a table.
MAX_LINE = 2**16
MAX_HEADER = 1000
MAX_NUMBERS = 2**24
# Number of lines per conversion.
BLOCK = 2**14
# By decimal mark: characters that np.loadtxt cannot read, so that lines are read one by one.
UNUSUAL = {
    ".": re.compile(rf'["#{GROUPING.strip(" ")}]'),
    ",": re.compile(rf'["#{GROUPING.strip(" ")}.]|,(?!\d)'),
}
# Encodings that are not Unicode: Western European, Korean and Japanese spreadsheets; characters
# other than ASCII of German titles and of units; bytes from which the encoding is determined.
ENCODINGS = ("latin-1", "cp949", "cp932")
GERMAN = set("ÄÖÜäöüß°²³µ")
MAX_HEADER_SIZE = 2**16
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
        Columns of numbers; columns of words and empty ones are left out.
    header : list of tuple of str
        Names and values of the header.
    decimal : str
        Decimal mark, if a number shows it.
    has_titles : bool
        Whether the file has a line of titles.
    clock : ndarray or None, shape (n_row,)
        Times of day, s, of a column of date and time.
    """

    name: str
    columns: list[Column]
    header: list[tuple[str, str]]
    decimal: str = ""
    has_titles: bool = False
    clock: NDArray[np.float64] | None = None


def read_table(
    path: str | os.PathLike[str],
    allowed: str = ALLOWED,
    is_known: Callable[[str], bool] = lambda _: False,
) -> Table:
    """Read a text of columns, or the first sheet with numbers of a workbook (.xlsx).

    Separators (commas, semicolons, tabs, blanks) and decimal mark hold for all numbers. Lines above
    the first number are titles, units, or names and values. A unit of a column stands in its title,
    in a line of units, in the header or in its cells. Columns without numbers are left out. Words
    of which `is_known` is true show the encoding.

    Raises
    ------
    InputError
        If the file has no numbers, if a cell is not a number, if rows or titles do not fit the
        number of columns, or if units are stated that cannot be attributed to a column; the message
        names file and line.
    """
    require_kind("path", path, str | os.PathLike)
    file = Path(path)
    name = shown_path(file)
    try:
        if file.suffix.lower() == ".xlsx":
            sheet, rows = read_workbook(file, allowed)
            layout = Layout(f"{name}, sheet {sheet!r}", allowed, lambda: iter(rows), "\t", ".", 1)
        else:
            if not file.is_file():  # opening a pipe could block
                refuse(f"{name}: cannot be read (no such regular file)", allowed)
            require_small(file, "text")
            encoding = _find_encoding(file, is_known)
            layout = Layout(name, allowed, lambda: _read_lines(file, encoding, name, allowed))
        header, titles, has_titles = read_header(_find_numbers(layout), layout)
        if not layout.shown:
            layout.decimal, layout.shown = _find_decimal(layout)
        if layout.separator == "," and not layout.shown and not has_titles:
            layout.refuse(
                layout.first,
                "the commas may separate columns or be decimal marks",
                "a title for each column, decimal points, or semicolons between columns",
            )
        values = _read_numbers(layout)
    except InputError:  # is a ValueError
        raise
    except (OSError, ValueError) as error:
        refuse(f"{name}: cannot be read ({shown_text(error)})", allowed, error)
    clock = None if layout.clock is None else values.pop(layout.clock)
    columns = [
        Column(i + 1, *titles[i], numbers, is_time("{} [{}]".format(*titles[i])), layout.name)
        for i, numbers in values.items()
    ]
    decimal = layout.decimal if layout.shown else ""
    return Table(layout.name, columns, header, decimal, has_titles, clock)


def time_and_force(table: Table) -> NDArray[np.float64]:
    """Return time, s, and force, N, shape (n_row, 2), of a table of two columns."""
    columns = table.columns
    if len(columns) != 2:  # noqa: PLR2004 - time and force
        count = f"{len(columns[0].values)} rows of {len(columns)} numbers"
        refuse(f"{table.name}: {count}", "two columns: time, s, and force, N")
    is_second = columns[1].is_time and not columns[0].is_time
    time, force = columns[::-1] if is_second else columns
    return np.column_stack([time.to("s"), force.to("N")])


# Lines.


def _find_encoding(path: Path, is_known: Callable[[str], bool]) -> str:
    """Return the encoding of a text.

    UTF-16 has a byte order mark. A header that is not UTF-8 has that of `ENCODINGS` in which the
    most words that are not ASCII are known, or Latin-1 if its only such characters are those of
    German and of units; else the result is UTF-8, with characters that show what is not.
    """
    with path.open("rb") as file:
        header = file.read(MAX_HEADER_SIZE)
    if header.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(header)
    except UnicodeDecodeError:
        pass
    else:
        return "utf-8-sig"

    def count(encoding: str) -> int:
        known = 0
        for word in re.split(r"[\t\n;,:=]", header.decode(encoding, "replace")):
            if not word.isascii():
                title, unit = split_title(word.strip(" \r\"'#"))
                is_word = plain(title) in WORDS or find_unit(title) or is_known(title)
                known += bool(is_word if unit.isascii() else find_unit(unit))
        return known

    best = max(ENCODINGS, key=count)
    others = {character for character in header.decode("latin-1") if not character.isascii()}
    return best if others <= GERMAN or count(best) else "utf-8-sig"


def _read_lines(path: Path, encoding: str, name: str, allowed: str) -> Iterator[str]:
    """Yield the lines of a text without line ends; refuse long ones and zero bytes."""
    with path.open(encoding=encoding, errors="replace") as text:
        for number, line in enumerate(iter(lambda: text.readline(MAX_LINE + 2), ""), start=1):
            if "\0" in line:
                refuse(f"{name}: line {number} holds zero bytes", allowed)
            if len(line) > MAX_LINE + 1:
                refuse(f"{name}: line {number} is longer than {MAX_LINE} characters", allowed)
            yield line.removesuffix("\n")


def _find_numbers(layout: Layout) -> list[str]:
    """Find the first line of numbers and its columns; return the lines above it."""
    above: list[str] = []
    is_workbook = layout.separator is not None
    for line in itertools.islice(layout.lines(), MAX_HEADER):
        if not is_workbook:
            text = COMMENT.split(line, 1)[0].strip(" \r")
            bare = text.rstrip(TRAILING)
            # Behind the only number of a line, a mark shows that its comma separates nothing.
            layout.separator = find_separator(text if is_number(bare) else bare)
        cells = layout.cells(line)
        filled = {i: cell for i, cell in enumerate(cells) if cell}
        values = {i: read_cell(cell) for i, cell in filled.items()}
        used = {i: unit for i, (number, unit) in values.items() if is_number(number)}
        clocks = [i for i, cell in filled.items() if seconds_of_day(cell) is not None]
        dates = [i for i, cell in filled.items() if DATE_CELL.fullmatch(cell)] + clocks
        # Dates precede the numbers, and further columns may hold words, such as a state.
        is_first = bool(used) and min(filled) in {*used, *dates}
        is_first = is_first and min(used) > max(dates, default=-1)
        if is_first and len(used) > (len(filled) - len(dates)) / 2:
            layout.first, layout.used = len(above) + 1, used
            layout.clock = min(clocks, default=None)
            layout.width, layout.full_width = max(filled) + 1, len(cells)
            if layout.width > MAX_COLUMNS:
                refuse(f"{layout.name}: {layout.width} columns", f"up to {MAX_COLUMNS}")
            return above
        above.append(line)
    return refuse(f"{layout.name}: cannot be read (no numbers)", layout.allowed)


# Numbers.


def _find_decimal(layout: Layout) -> tuple[str, int]:
    """Return the decimal mark of a table, and the number of the line that shows it, 0 if none.

    The first number that is valid with only one mark decides: ``0,5``, ``1.234,5`` and ``1,2345``
    show a decimal comma; ``1,575`` is ambiguous. Raise InputError, naming its line, if no number
    decides.
    """
    ambiguous: tuple[int, str] | None = None
    for line, text in itertools.islice(enumerate(layout.lines(), 1), layout.first - 1, None):
        if "." not in text and "," not in text:
            continue
        # If commas separate columns, unquoted numbers have decimal points.
        has_points = layout.separator == "," and '"' not in text
        cells = layout.cells(text)
        for cell in (read_cell(cells[i])[0] for i in layout.used if i < len(cells)):
            if "." not in cell and "," not in cell:
                continue
            marks = [mark for mark, pattern in NUMBERS.items() if pattern.fullmatch(cell)]
            if len(marks) == 1:
                return marks[0], line
            if marks and ambiguous is None and not (has_points and "." in cell):
                ambiguous = line, cell
    if ambiguous is not None:
        line, cell = ambiguous
        value = to_number(cell, "," if "," in cell else ".")
        readings = " or ".join(f"{to_number(cell, mark):.15g}" for mark in MARKS)
        layout.refuse(
            line,
            f"{cell!r} may be {readings}, and no number of the table decides",
            f"tables with a number that shows the decimal mark, such as {cell}0 for {value:.15g}",
        )
    return ".", 0


def _read_numbers(layout: Layout) -> dict[int, NDArray[np.float64]]:
    """Return the columns of numbers and times of day by their index in the table."""
    columns = [*layout.used, *([] if layout.clock is None else [layout.clock])]
    blocks: list[NDArray[np.float64]] = []
    rows = itertools.islice(enumerate(layout.lines(), 1), layout.first - 1, None)
    while block := list(itertools.islice(rows, BLOCK)):
        values = _convert([line for _, line in block], len(columns), layout)
        if values is None:
            texts = [_convert_row(number, line, columns, layout) for number, line in block]
            values = np.array(list(filter(None, texts)), dtype=np.float64)
        blocks.append(values.reshape(-1, len(columns)))
        if sum(block.size for block in blocks) > MAX_NUMBERS:
            refuse(
                f"{layout.name}: more than {MAX_NUMBERS / 1e6:.1f} million numbers as text",
                "longer recordings as WAV, RF64, FLAC, HDF5 or TDMS",
            )
    table = np.concatenate(blocks)
    return {column: table[:, k].copy() for k, column in enumerate(columns)}


def _convert(lines: list[str], count: int, layout: Layout) -> NDArray[np.float64] | None:
    """Return the numbers of lines at once; None if they hold anything else."""
    text = "\n".join(lines)
    if count < layout.width or UNUSUAL[layout.decimal].search(text):
        return None
    if layout.decimal == ",":
        text = text.replace(",", ".")
    separator = layout.separator
    lines = [line.rstrip(TRAILING + (separator or "")) for line in text.split("\n")]
    if not any(lines):  # of which NumPy warns
        return np.empty((0, count))
    try:
        values = np.loadtxt(lines, delimiter=separator, comments=None, ndmin=2, dtype=np.float64)
    except (ValueError, OverflowError):
        return None
    # Empty lines are left out.
    return values if values.shape[1] == count else None


def _convert_row(number: int, line: str, columns: list[int], layout: Layout) -> list[float] | None:
    """Return the numbers of a line, None of an empty one; raise InputError if it is wrong."""
    cells = layout.cells(line)
    if not cells:
        return None
    if len(cells) <= max(columns) or any(cells[layout.width :]):
        layout.refuse(number, f"{len(cells)} columns, {layout.width} in the lines above")
    row = []
    for i in columns:
        cell, unit = cells[i], layout.used.get(i, "")
        text, own = read_cell(cell) if unit else (cell, "")
        reason = f"{shown_text(cell)!r} is not a number"
        if i == layout.clock:
            value, reason = seconds_of_day(cell), f"{shown_text(cell)!r} is not a time"
        else:
            value = to_number(text, layout.decimal)
        if unit:
            reason = f"{shown_text(cell)!r} is not in {unit}"
            (base, size), (own_base, own_size) = size_of(unit), size_of(own)
            value = None if value is None or base != own_base else value * own_size / size
        elif is_number(cell) and layout.shown:
            reason += f" with the decimal {MARKS[layout.decimal]} of line {layout.shown}"
        if value is None:
            layout.refuse(number, reason)
        row.append(value)
    for i in {*range(len(cells))} - {*columns}:
        if is_number(cells[i]):
            text = f"column {i + 1} has a number, {shown_text(cells[i])}, but none in line "
            layout.refuse(number, text + str(layout.first), "columns of numbers or of words")
    return row
