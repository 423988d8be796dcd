"""Tables of numbers from spreadsheets, instruments and data loggers, with a unit per column."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from thud.base.checks import refuse
from thud.base.columns import (
    GROUPING,
    DecimalMark,
    find_decimal,
    find_encoding,
    find_separator,
    is_number,
    read_lines,
    split_line,
    strip_comment,
    to_number,
)
from thud.base.errors import InputError
from thud.base.units import UNITS, find_unit
from thud.base.workbooks import read_workbook
from thud.recordings.channel import require_small, shown_path, shown_text
from thud.recordings.header_aliases import (
    BRACKETS,
    DATE,
    NUMBER,
    RATE,
    STEP,
    TIME_UNIT,
    UNIT,
    WORDS,
    find_rate,
    is_time,
    plain,
    split_title,
)
from thud.recordings.times import DATE as DATE_CELL, seconds_of_day
from thud.recordings.variables import MAX_COLUMNS

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

COMMENTS = "#%!*'/;"
# Maximum number of lines in a header, and of numbers in a table.
MAX_HEADER = 1000
MAX_NUMBERS = 2**24
# Number of lines per conversion.
BLOCK = 2**14
# By decimal mark: characters that np.loadtxt cannot read, so that lines are read one by one.
UNUSUAL = {
    ".": re.compile(rf'["#{GROUPING.strip(" ")}]'),
    ",": re.compile(rf'["#{GROUPING.strip(" ")}.]|,(?!\d)'),
}
# A comma that must be a decimal mark, as in 1,05 and -0,5.
DECIMAL_COMMA = re.compile(r"[-+]?\d+,0\d|[-+]0,")
# Separators of name and value in a header, and maximum number of lines of titles and units.
PAIR = re.compile(r"[:=\t;,]")
MAX_TITLES = 3
# A title with the number of its column, such as "Column 2: Force [N]".
NUMBERED = re.compile(r"(?:column|col\.?|spalte|열|列)\s*(\d{1,3})\s*[:=]\s*(\S.*)", re.IGNORECASE)
# What separates titles that hold commas: tabs, semicolons, or blanks between words.
OTHER_SEPARATOR = re.compile(r"[\t;]|[^\s,] {2,}[^\s,]")
# A number behind a name.
VALUE = re.compile(r"[:=]\s*[-+]?\d")
DATE_LIKE = re.compile(r"\d+[-./:]\d+|\d{8}")
# Titles of columns that may have no cells.
REMARK = {
    "comment", "comments", "remark", "remarks", "note", "notes", "kommentar", "bemerkung",
    "bemerkungen",
}  # fmt: skip
ALLOWED = (
    "columns of numbers, separated by commas, semicolons, tabs or blanks (decimal commas with "
    "semicolons, tabs and blanks, or in quotes)"
)
ONE_TITLE = "a title for each column, with its unit if it is known"


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
    table : str
        Name of the file.
    """

    number: int
    name: str
    unit: str
    values: NDArray[np.float64]
    table: str = ""

    def __str__(self) -> str:
        """Return number and title for messages."""
        return f"column {self.number}" + (f", {shown_text(self.name)!r}" if self.name else "")

    @property
    def is_time(self) -> bool:
        """Whether title or unit are those of times."""
        return is_time(f"{self.name} [{self.unit}]")

    def factor(self, unit: str, allowed: str) -> float:
        """Return a number of the column in a unit; without a unit in the file it is 1.

        Raise InputError if the unit of the file is not known or of another quantity.
        """
        base, size = UNITS.get(find_unit(self.unit), ("", 0.0))
        if self.unit and base != UNITS[unit][0]:
            text = "does not fit" if base else "is not known"
            refuse(f"{self.table}: {self}: the unit {shown_text(self.unit)!r} {text}", allowed)
        return size / UNITS[unit][1] if self.unit else 1.0

    def to(self, unit: str, allowed: str = "") -> NDArray[np.float64]:
        """Return the numbers in a unit of `UNITS`, see `factor`."""
        known = ", ".join(name for name, entry in UNITS.items() if entry[0] == UNITS[unit][0])
        return self.values * self.factor(unit, allowed or known)


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


@dataclass
class _Layout:
    """Layout of a file: the numbers begin at line `first` and have `width` columns.

    `used` are the numeric columns with the units in their cells. With `has_gaps` there are empty
    columns, which blanks between titles do not show; with `has_commas` the only column has decimal
    commas.
    """

    name: str
    allowed: str
    lines: Callable[[], Iterator[str]]
    separator: str | None = None
    decimal: DecimalMark = field(default_factory=DecimalMark)
    first: int = 1
    width: int = 0
    full_width: int = 0
    has_gaps: bool = False
    used: dict[int, str] = field(default_factory=dict)
    clock: int | None = None
    has_commas: bool = False
    header: list[tuple[str, str]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    units: list[str] = field(default_factory=list)

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line of numbers."""
        text = strip_comment(line).rstrip("\t; ".replace(self.separator or " ", ""))
        return split_line(text, self.separator) if text else []

    def rows(self) -> Iterator[tuple[int, str]]:
        """Yield number and text of the lines from the first number on."""
        return itertools.islice(enumerate(self.lines(), 1), self.first - 1, None)

    def refuse(self, line: int, reason: str, allowed: str = "") -> NoReturn:
        """Raise InputError for a line."""
        refuse(f"{self.name}: line {line}: {reason}", allowed or self.allowed)


def read_table(
    path: str | os.PathLike[str],
    allowed: str = ALLOWED,
    is_known: Callable[[str], bool] | None = None,
) -> Table:
    """Read a text of columns, or the first sheet with numbers of a workbook (.xlsx).

    Separators (commas, semicolons, tabs, blanks) and decimal mark hold for all numbers. Lines above
    the first number are titles, units, or names and values. A unit of a column stands in its title,
    in a line of units, in the header or in its cells. Columns without numbers are left out. Words
    of which `is_known` is true show the encoding, see `find_encoding`.

    Raises
    ------
    InputError
        If the file has no numbers, if a cell is not a number, if rows or titles do not fit the
        number of columns, or if units are stated that cannot be attributed to a column; the message
        names file and line.
    """
    file = Path(path)
    name = shown_path(file)
    try:
        if file.suffix.lower() == ".xlsx":
            sheet, cells = read_workbook(file, allowed)
            layout = _Layout(f"{name}, sheet {sheet!r}", allowed, lambda: iter(cells), "\t")
            layout.decimal = DecimalMark(".", 1)
        elif file.is_file():  # opening a pipe could block
            require_small(file, "text")
            # A header may have an encoding that is not known.
            encoding = find_encoding(file, lambda word: _is_known(word, is_known))
            layout = _Layout(name, allowed, lambda: _lines(file, encoding, name, allowed))
        else:
            refuse(f"{name}: cannot be read (no such regular file)", allowed)
        return _read(layout)
    except InputError:  # is a ValueError
        raise
    except (OSError, ValueError) as error:
        refuse(f"{name}: cannot be read ({shown_text(error)})", allowed, error)


def time_and_force(table: Table) -> NDArray[np.float64]:
    """Return time, s, and force, N, shape (n_row, 2), of a table of two columns."""
    columns = table.columns
    if len(columns) != 2:  # noqa: PLR2004 - time and force
        count = f"{len(columns[0].values)} rows of {len(columns)} numbers"
        refuse(f"{table.name}: {count}", "two columns: time, s, and force, N")
    is_second = columns[1].is_time and not columns[0].is_time
    time, force = columns[::-1] if is_second else columns
    return np.column_stack([time.to("s"), force.to("N")])


def _is_known(word: str, is_known: Callable[[str], bool] | None) -> bool:
    """Whether a word of a header is known, or its unit."""
    name, unit = split_title(word)
    if unit and not unit.isascii():
        return bool(find_unit(unit))
    known = plain(name) in WORDS or bool(find_unit(name))
    return known or (is_known is not None and is_known(name))


def _lines(path: Path, encoding: str, name: str, allowed: str) -> Iterator[str]:
    with path.open(encoding=encoding, errors="replace") as text:
        yield from read_lines(text, name, allowed)


def _read(layout: _Layout) -> Table:
    _read_header(_find_numbers(layout), layout)
    if not layout.decimal.line:
        layout.decimal = find_decimal(_decisive(layout), layout.separator, layout.name)
    _require_separators(layout)
    values = _read_numbers(layout)
    clock = None if layout.clock is None else values.pop(layout.clock)
    columns = [
        Column(i + 1, layout.names[i], layout.units[i], numbers, layout.name)
        for i, numbers in values.items()
    ]
    mark = layout.decimal.mark if layout.decimal.line else ""
    has_titles = any(layout.names) or any(layout.units)
    return Table(layout.name, columns, layout.header, mark, has_titles, clock)


def _trimmed(cells: list[str]) -> list[str]:
    """Return the cells up to the last one that is not empty."""
    return cells[: max((i for i, cell in enumerate(cells, 1) if cell), default=0)]


def _value(cell: str) -> tuple[str, str]:
    """Return the number of a cell as text and its unit; the cell itself if there is no unit."""
    match = None if is_number(cell) else NUMBER.fullmatch(cell)
    is_value = match and is_number(match["number"]) and find_unit(match["unit"])
    return (match["number"], match["unit"]) if match and is_value else (cell, "")


def _find_numbers(layout: _Layout) -> list[str]:
    """Find the first line of numbers and its columns; return the lines above it."""
    above: list[str] = []
    is_workbook = layout.separator is not None
    for line in itertools.islice(layout.lines(), MAX_HEADER):
        if not is_workbook:
            layout.separator = find_separator(strip_comment(line).rstrip("\t; "))
        cells = layout.cells(line)
        filled = {i: cell for i, cell in enumerate(cells) if cell}
        values = {i: _value(cell) for i, cell in filled.items()}
        used = {i: unit for i, (number, unit) in values.items() if is_number(number)}
        clocks = [i for i, cell in filled.items() if seconds_of_day(cell) is not None]
        dates = [i for i, cell in filled.items() if DATE_CELL.fullmatch(cell)] + clocks
        # Dates precede the numbers, and further columns may hold words, such as a state.
        if (
            used
            and min(filled) in {*used, *dates}
            and min(used) > max(dates, default=-1)
            and len(used) > (len(filled) - len(dates)) / 2
        ):
            layout.first, layout.used, layout.clock = (
                len(above) + 1,
                used,
                min(clocks, default=None),
            )
            layout.width, layout.full_width = max(filled) + 1, len(cells)
            layout.has_gaps = len(filled) < layout.width
            if layout.width > MAX_COLUMNS:
                refuse(f"{layout.name}: {layout.width} columns", f"up to {MAX_COLUMNS}")
            return above
        above.append(line)
    return refuse(f"{layout.name}: cannot be read (no numbers)", layout.allowed)


def _decisive(layout: _Layout) -> Iterator[tuple[int, list[str], bool]]:
    """Yield number, numeric cells and use of quotes of lines that may show the decimal mark."""
    for number, line in layout.rows():
        if "." in line or "," in line:
            cells = layout.cells(line)
            yield number, [_value(cells[i])[0] for i in layout.used if i < len(cells)], '"' in line


def _require_separators(layout: _Layout) -> None:
    """Raise InputError if commas may be separators or decimal marks."""
    texts = filter(None, (strip_comment(line) for _, line in layout.rows()))
    if layout.has_commas:
        # As separate numbers, 05 and -0 would be unusual.
        is_shown = any("," not in text or DECIMAL_COMMA.match(text) for text in texts)
    else:
        titles = any(layout.names) or any(layout.units)
        is_shown = layout.separator != "," or bool(layout.decimal.line) or titles
    # A cell that begins with a sign is not the fraction of the number before it.
    signed = {0}
    for text in () if is_shown or layout.has_commas else texts:
        signed |= {i for i, cell in enumerate(layout.cells(text)) if not cell[:1].isdigit()}
        is_shown = '"' in text or "." in text or len(signed) >= layout.width
        if is_shown:
            return
    if not is_shown:
        layout.refuse(
            layout.first,
            "the commas may separate columns or be decimal marks",
            "a title for each column, decimal points, or semicolons between columns",
        )


# Header: titles, units, names and values.


def _read_header(above: list[str], layout: _Layout) -> None:
    """Find the titles and units of the columns, and the names and values of the header."""
    lines = [(number, line.strip(" ")) for number, line in enumerate(above, 1) if line.strip()]
    rows, numbered, others = _sort_lines(lines, layout)
    text = strip_comment(next(line for _, line in layout.rows())).rstrip("\t; ")
    if layout.separator == "," and is_number(text) and not rows and find_rate(layout.header):
        layout.separator, layout.width, layout.used, layout.has_commas = ";", 1, {0: ""}, True
        rows, numbered, others = _sort_lines(lines, layout)
    units = [cells for _, cells in rows if _are_units(cells)]
    titles = [row for row in rows if row[1] not in units]
    near = {number for number, _ in lines[-MAX_TITLES:]}
    _, chosen = max(
        (row for row in titles if row[0] in near or _evidence(row[1])),
        key=lambda row: (_evidence(row[1]), row[0]),
        default=(0, []),
    )
    others += [(number, "\t".join(cells)) for number, cells in titles if cells is not chosen]
    last = lines[-1][0] if lines else 0
    for number, line in sorted(others):
        _read_other(line, number, layout, is_last=number == last, is_open=not (chosen or numbered))
    layout.width = max([layout.width, *map(len, (chosen, *units))])
    layout.names = [""] * layout.width
    stated: list[list[str]] = [[] for _ in range(layout.width)]
    for i, cell in [*enumerate(chosen), *numbered.items()]:
        if i < layout.width:
            layout.names[i], unit = split_title(cell)
            stated[i].append(unit)
        elif plain(cell) not in REMARK:
            refuse(f"{layout.name}: a title for column {i + 1} of {layout.width}", ONE_TITLE)
    for i, cell in itertools.chain(*map(enumerate, units)):
        name, unit = split_title(cell)
        stated[i].append(unit or name)
    for i, unit in layout.used.items():
        stated[i].append(unit)
    _apply_header_units(stated, layout)
    layout.units = [
        _one_unit(units, i, layout) or (name if name in UNITS else "")
        for i, (units, name) in enumerate(zip(stated, layout.names, strict=True))
    ]


def _uncommented(line: str) -> str:
    return line.lstrip(COMMENTS + " \t").strip()


def _sort_lines(
    lines: list[tuple[int, str]], layout: _Layout
) -> tuple[list[tuple[int, list[str]]], dict[int, str], list[tuple[int, str]]]:
    """Return lines with a cell for each column, titles by column, and further lines."""
    layout.header = []
    rows: list[tuple[int, list[str]]] = []
    numbered: dict[int, str] = {}
    others: list[tuple[int, str]] = []
    for number, line in lines:
        text = _uncommented(line)
        title, *value = PAIR.split(text, maxsplit=1)
        name, values = plain(split_title(title)[0]), "".join(value).strip(" :=\t;,")
        if match := NUMBERED.fullmatch(text):
            numbered[int(match[1]) - 1] = match[2]
        elif value and _is_pair(name, values, layout.width):
            is_unit = name in UNIT | TIME_UNIT
            layout.header.append((title.strip(), values if is_unit else _first(values)))
        elif cells := _fitting(line, text, layout):
            rows.append((number, cells))
        else:
            others.append((number, line))
    return rows, numbered, others


def _first(values: str) -> str:
    """Return the first of the values for several channels."""
    return re.split(r"[\t;]", values)[0]


def _is_pair(name: str, value: str, width: int) -> bool:
    """Whether a line of the header is a known name with its value."""
    if name in DATE:
        return bool(DATE_LIKE.search(value))
    has_value = width == 1 or any(map(str.isdigit, value))
    return bool(value) and (name in UNIT | TIME_UNIT or (name in RATE | STEP and has_value))


def _fitting(line: str, text: str, layout: _Layout) -> list[str]:
    """Return the cells of a line if it has a title for each column, else an empty list."""
    if layout.width == 1:
        is_value = re.search(r"[:=]|[\t;]\s*\S", text) or is_number(text)
        return [] if is_value else [text.rstrip(";\t ").strip('"')]
    # A separator in front of the titles is no comment.
    starts = (line, text) if line[:1] == layout.separator else (text,)
    for variant in (*starts, *(part.partition("#")[0].rstrip() for part in starts)):
        for cells in _splits(variant, layout):
            filled = _trimmed(cells)
            extra = filled[layout.width :]
            is_title = len(filled) <= layout.full_width or all(plain(c) in REMARK for c in extra)
            has_number = any(
                is_number(c) or DATE_CELL.fullmatch(c) or seconds_of_day(c) for c in cells
            )
            if len(cells) >= layout.width and is_title and filled and not has_number:
                return cells[: max(layout.width, len(filled))]
    return []


def _splits(text: str, layout: _Layout) -> Iterator[list[str]]:
    """Yield the cells of a line of titles by the separator of the numbers, and by others."""
    separator = layout.separator
    for mark in dict.fromkeys((separator, "\t", ";", ",")):
        if mark and mark in text and not (mark == "," and OTHER_SEPARATOR.search(text)):
            cells = split_line(text, mark)
            # The commas of "Time, s" do not separate titles.
            loose = text.split(", ")[1:] if separator == "," else cells
            bases = {_quantity(cell) for cell in loose if find_unit(cell)} - {"counts", "FS"}
            if mark != "," or _are_units(cells) or not bases:
                yield cells
    if layout.has_gaps:
        return
    if not any(mark in text for mark in '\t;"'):
        yield re.split(r" {2,}", text)
    if not any(mark in text for mark in '\t;,"'):
        # "Force [N]" and "Force / N" are one title.
        joined = BRACKETS.sub(lambda match: match[0].replace(" ", "\0"), text)
        words = re.sub(r"(?<=[^\])}\s])\s+(?=[\[({])|\s+(/)\s+", "\0\\1\0", joined).split()
        yield [" ".join(word.split("\0")) for word in words]


def _are_units(cells: list[str]) -> bool:
    """Whether most cells of a line are units without a name."""
    filled = [split_title(cell) for cell in cells if any(map(str.isalpha, cell))]
    known = sum(bool(find_unit(unit or name)) for name, unit in filled)
    return not any(name and unit for name, unit in filled) and (
        2 * known > len(filled) or (bool(filled) and all(unit for _, unit in filled))
    )


def _evidence(cells: list[str]) -> int:
    """Return 2 if a cell states a unit, 1 if it names times, else 0."""
    pairs = [split_title(cell) for cell in cells]
    return 2 if any(find_unit(unit) for _, unit in pairs) else int(any(map(is_time, cells)))


def _read_other(line: str, number: int, layout: _Layout, *, is_last: bool, is_open: bool) -> None:
    """Add a further line to the header; raise InputError for titles or numbers that do not fit.

    `is_last` is the line above the numbers; with `is_open` the columns have no titles yet.
    """
    text = _uncommented(line)
    is_comment = line[:1] in tuple(COMMENTS)
    row = [] if is_comment else _trimmed(layout.cells(line))
    if len(row) == layout.width and not layout.has_commas:
        first = next(filter(None, row))
        is_row = not any(map(str.isalpha, first)) and any(map(is_number, row))
        # A word may stand in front of the numbers of the first row.
        is_row |= number == layout.first - 1 and all(is_number(row[i]) for i in layout.used)
        if is_row or is_number(first):
            wrong = next(cell for cell in row if cell and not is_number(cell))
            layout.refuse(number, f"{shown_text(wrong)!r} is not a number")
    pieces = [piece.strip() for piece in re.split(r"[\t;,]", text)]
    has_number = any(is_number(_value(piece)[0]) for piece in pieces)
    cells = next(_splits(text, layout), [text])
    is_title = any(map(is_time, cells)) and (len(cells) > 1 or is_last)
    if is_last and not is_comment and ":" not in text:
        is_title |= (layout.separator or "\n") in text
    is_unit = _are_units(cells) or any(map(_states_unit, pieces))
    if (is_unit or (is_title and is_open)) and not has_number | bool(VALUE.search(text)):
        count = f"{len(cells)} title{'s' * (len(cells) > 1)} for {layout.width} columns"
        reason = count if len(cells) != layout.width else "is a second line of titles"
        layout.refuse(number, f"{shown_text(text)!r}: {reason}", ONE_TITLE)
    pair = PAIR.split(text, maxsplit=1) if PAIR.search(text) else text.rsplit(maxsplit=1)
    if pair[1:]:
        layout.header.append((pair[0], _first(pair[1].strip(" :=\t;,"))))


def _states_unit(text: str) -> bool:
    """Whether a text holds a unit in brackets, or ends with one after a slash or "in"."""
    if any(find_unit("".join(filter(None, groups))) for groups in BRACKETS.findall(text)):
        return True
    match = re.search(r"(?:\bin|/)\s+(\S{1,12})$", text)
    return bool(match and find_unit(match[1]))


def _apply_header_units(stated: list[list[str]], layout: _Layout) -> None:
    """Add units that the header states for the columns of times, or for the others."""
    used = [*layout.used]
    times = [i for i in used if is_time(f"{layout.names[i]} [{''.join(stated[i][:1])}]")]
    channels = [i for i in used if i not in times]
    for title, value in layout.header:
        words = plain(split_title(title)[0])
        if words not in UNIT | TIME_UNIT:
            continue
        units = _trimmed([part.strip(" \"'") for part in re.split(r"[\t;,]", value)])
        if words in TIME_UNIT:
            chosen, units = times or used[:1], units[:1]
        elif len(units) == 1:  # of the columns without a unit of another quantity
            base = _quantity(units[0])
            chosen = [i for i in channels if {*map(_quantity, filter(None, stated[i]))} <= {base}]
        else:
            lists = ([*range(layout.width)], used, channels, used[1:])
            chosen = next((some for some in lists if len(some) == len(units)), [])
        if len(units) not in {1, len(chosen)}:
            count = f"{len(units)} units for {len(channels)} channels"
            refuse(f"{layout.name}: {shown_text(title)!r} has {count}", "one, or one each")
        for i, unit in zip(chosen, itertools.cycle(units), strict=False):
            stated[i].append(unit)


def _quantity(unit: str) -> str:
    """Return the SI unit or base unit of a unit, or the unit itself if it is not known."""
    return UNITS.get(find_unit(unit), (unit,))[0]


def _one_unit(stated: list[str], column: int, layout: _Layout) -> str:
    """Return the unit of a column; raise InputError if several are stated."""
    units = {find_unit(unit) or unit: unit for unit in stated if unit not in {"", "-", "--"}}
    if len(units) > 1:
        text = " and ".join(map(shown_text, units.values()))
        refuse(f"{layout.name}: column {column + 1}: its unit is stated as {text}", "one unit")
    return next(iter(units.values()), "")


# Numbers.


def _read_numbers(layout: _Layout) -> dict[int, NDArray[np.float64]]:
    """Return the columns of numbers and times of day by their index in the table."""
    columns = [*layout.used, *([] if layout.clock is None else [layout.clock])]
    blocks: list[NDArray[np.float64]] = []
    rows = layout.rows()
    while block := list(itertools.islice(rows, BLOCK)):
        values = _convert([line for _, line in block], columns, layout)
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


def _convert(block: list[str], columns: list[int], layout: _Layout) -> NDArray[np.float64] | None:
    """Return the numbers of a block of lines; None if a line is empty, unusual or wrong."""
    separator, decimal = layout.separator, layout.decimal.mark
    joined = "\n".join(block)
    if separator is None:
        counts = {len(line.split()) for line in block}
    else:
        counts = {line.count(separator) + 1 for line in block}
    count = max(counts)
    is_even = len(counts) == 1 and count > max(columns) and layout.clock is None
    if not is_even or UNUSUAL[decimal].search(joined):
        return None
    if others := {*range(count)} - {*columns}:
        texts = (
            (i, cell.strip())
            for line in block
            for i, cell in enumerate(line.split(separator))
            if i in others
        )
        if any(text and (i >= layout.width or is_number(text)) for i, text in texts):
            return None
    lines = joined.replace(",", ".").split("\n") if decimal == "," else block
    try:
        return np.loadtxt(
            lines, delimiter=separator, comments=None, usecols=columns, ndmin=2, dtype=np.float64
        )
    except (ValueError, OverflowError):
        return None


def _convert_row(number: int, line: str, columns: list[int], layout: _Layout) -> list[float] | None:
    """Return the numbers of a line, None of an empty one; raise InputError if it is wrong."""
    cells = layout.cells(line)
    if not cells:
        return None
    row = [_cell_value(cells[i], i, number, layout) for i in columns if i < len(cells)]
    if len(row) < len(columns) or len(_trimmed(cells)) > layout.width:
        layout.refuse(number, f"{len(cells)} columns, {layout.width} in the lines above")
    for i in {*range(len(cells))} - {*columns}:
        if is_number(cells[i]):
            text = f"column {i + 1} has a number, {shown_text(cells[i])}, but none in line "
            layout.refuse(number, text + str(layout.first), "columns of numbers or of words")
    return row


def _cell_value(cell: str, column: int, number: int, layout: _Layout) -> float:
    """Return the number or the time of day, s, of a cell."""
    unit = layout.used.get(column, "")
    if column == layout.clock:
        value, reason = seconds_of_day(cell), f"{shown_text(cell)!r} is not a time"
    elif unit:
        text, own = _value(cell)
        base, size = UNITS.get(find_unit(own), ("", 0.0))
        is_same = base == UNITS[find_unit(unit)][0]
        value = to_number(text, layout.decimal.mark) if is_same else None
        value = None if value is None else value * size / UNITS[find_unit(unit)][1]
        reason = f"{shown_text(cell)!r} is not in {unit}"
    else:
        value = to_number(cell, layout.decimal.mark)
        reason = "" if value is not None else layout.decimal.explain(shown_text(cell))
    if value is None:
        layout.refuse(number, reason)
    return value
