"""Tables of numbers from spreadsheets and data loggers."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, TextIO

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
from thud.recordings.channel import (
    MAX_IN_MEMORY,
    MIN_SAMPLES,
    Channel,
    require_small,
    shown_path,
    shown_text,
)
from thud.recordings.date_times import (
    DAY,
    are_days,
    continued,
    is_date,
    seconds_of_day,
    step_of_date_times,
)
from thud.recordings.force_units import find_unit
from thud.recordings.header_aliases import (
    DATE,
    RATE,
    STEP,
    TIME_UNITS,
    UNIT,
    WORDS,
    find_rate,
    find_word,
    is_time,
    plain,
    split_title,
)
from thud.recordings.signal import read_array
from thud.recordings.uniform_grid import uniform_grid
from thud.recordings.variables import MAX_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

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
# Relative tolerance between the rate in the header and the rate of the times.
SAME_RATE = 0.01
ALLOWED = (
    "columns of numbers, separated by commas, semicolons, tabs or blanks (decimal commas with "
    "semicolons, tabs and blanks, or in quotes)"
)


@dataclass
class _Table:
    """Layout of a file: header, titles and columns of numbers.

    The numbers begin at line `first`, have `width` columns, and `used` are the numeric ones;
    `clock` is the column of date and time, if there is one. With `has_commas` the only column has
    decimal commas.
    """

    name: str
    separator: str | None = None
    decimal: DecimalMark = field(default_factory=DecimalMark)
    header: list[tuple[str, object]] = field(default_factory=list)
    titles: list[list[str]] = field(default_factory=list)
    first: int = 1
    width: int = 0
    used: list[int] = field(default_factory=list)
    clock: int | None = None
    has_commas: bool = False

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line of numbers."""
        return split_line(strip_comment(line), self.separator)


def read_channels(path: Path) -> list[Channel]:
    """Return the columns of numbers of a text file except the times."""
    require_small(path, "text", MAX_IN_MEMORY)
    # A header may have an encoding that is not known.
    with path.open(encoding=find_encoding(path, _is_known), errors="replace") as text:
        table = _Table(shown_path(path))
        _read_header(read_lines(text, table.name, ALLOWED), table)
        text.seek(0)
        rows = _rows(_lines_of_numbers(text, table), table)
        table.decimal = find_decimal(rows, table.separator, table.name)
        text.seek(0)
        _require_separators(_lines_of_numbers(text, table), table)
        text.seek(0)
        values = _read_numbers(_lines_of_numbers(text, table), table)
    return _channels(table, values)


def _is_known(word: str) -> bool:
    """Whether a word of a header is known, or its unit."""
    name, unit = split_title(word)
    return plain(name) in WORDS or bool(find_unit(unit or name))


def _lines_of_numbers(text: TextIO, table: _Table) -> Iterator[str]:
    return itertools.islice(read_lines(text, table.name, ALLOWED), table.first - 1, None)


def _rows(lines: Iterator[str], table: _Table) -> Iterator[tuple[int, list[str], bool]]:
    """Yield number, numeric cells and use of quotes of lines that may show the decimal mark."""
    for number, line in enumerate(lines, table.first):
        if "." in line or "," in line:
            cells = table.cells(line)
            yield number, [cells[i] for i in table.used if i < len(cells)], '"' in line


def _require_separators(lines: Iterator[str], table: _Table) -> None:
    """Raise InputError if commas may be separators or decimal marks."""
    if table.has_commas:
        # As separate numbers, 05 and -0 would be unusual.
        texts = filter(None, map(strip_comment, lines))
        if any("," not in text or DECIMAL_COMMA.match(text) for text in texts):
            return
    elif table.separator != "," or table.decimal.line or any(map(any, table.titles)):
        return
    else:
        # A cell with a sign is not the fraction of the number before it.
        signed = {0}
        for line in lines:
            if '"' in line or "." in line:
                return
            signed |= {i for i, cell in enumerate(table.cells(line)) if cell[:1] in {"-", "+"}}
            if len(signed) == table.width:
                return
    refuse(
        f"{table.name}: line {table.first}: the commas may separate columns or be decimal marks",
        "a title for each column, decimal points, or semicolons between columns",
    )


def _read_header(lines: Iterator[str], table: _Table) -> None:
    """Find the separator and the numeric columns, and read the header and the titles."""
    above: list[str] = []
    for line in itertools.islice(lines, MAX_HEADER):
        text = strip_comment(line)
        table.separator = find_separator(text)
        cells = table.cells(line)
        used = [i for i, cell in enumerate(cells) if is_number(cell)]
        clocks = [i for i, cell in enumerate(cells) if seconds_of_day(cell) is not None]
        dates = sum(map(is_date, cells)) + len(clocks)
        # Dates precede the numbers, and further columns may hold words, such as a state.
        if used[:1] == [dates] and len(used) > (len(cells) - dates) / 2:
            table.first, table.width, table.used = len(above) + 1, len(cells), used
            table.clock = clocks[0] if clocks else None
            _sort_header(above, table)
            if table.separator == "," and _is_one_column(text, table):
                table.separator, table.width, table.used = ";", 1, [0]
                table.has_commas = True
                _sort_header(above, table)
            _require_rows(above, table)
            return
        above.append(line)
    refuse(f"{table.name}: cannot be read (no numbers)", ALLOWED)


def _require_rows(above: list[str], table: _Table) -> None:
    """Raise InputError if a line above the numbers looks like an unreadable row."""
    for number, line in enumerate(above, 1):
        cells = table.cells(line)
        if line.lstrip()[:1] in COMMENTS or len(cells) != table.width:
            continue
        is_row = not any(map(str.isalpha, cells[0])) and any(map(is_number, cells))
        if is_row or is_number(cells[0]):
            wrong = next(cell for cell in cells if not is_number(cell))
            refuse(f"{table.name}: line {number}: {shown_text(wrong)!r} is not a number", ALLOWED)


def _is_one_column(text: str, table: _Table) -> bool:
    """Whether commas are decimal marks: with a rate, no title, and one number in the line."""
    return is_number(text) and not table.titles and find_rate(table.header) is not None


def _sort_header(above: list[str], table: _Table) -> None:
    """Sort the lines above the numbers into names with values, and titles of the columns."""
    texts = [text for line in above if (text := line.strip().lstrip(COMMENTS).strip())]
    for i, text in enumerate(texts):
        title = text.rstrip(";")
        cells = [title.strip()] if table.width == 1 else split_line(title, table.separator)
        words = plain(split_title(re.split(PAIR, text, maxsplit=1)[0])[0])
        is_pair = words in RATE | STEP | DATE | UNIT and table.width < 3  # noqa: PLR2004
        if words in DATE and i + 1 == len(texts):
            # Dates have several numbers, titles have not.
            is_pair &= len(re.findall(r"\d+", text)) > 1
        is_near = i >= len(texts) - MAX_TITLES and len(cells) == table.width and not is_pair
        if is_near and not any(map(is_number, cells)):
            table.titles.append(cells)
            continue
        pair = re.split(PAIR, text, maxsplit=1)
        if len(pair) == 1:
            pair = text.rsplit(maxsplit=1)
        if len(pair) == 2:  # noqa: PLR2004 - name and value
            # Of values for several channels, the first is used.
            table.header.append((pair[0], re.split(r"[\t;]", pair[1].strip(" :=\t;,"))[0]))


def _read_numbers(lines: Iterator[str], table: _Table) -> dict[int, NDArray[np.float64]]:
    """Return the columns of numbers by their index in the table."""
    if table.width > MAX_COLUMNS:
        refuse(f"{table.name}: {table.width} columns", f"up to {MAX_COLUMNS}")
    blocks: list[NDArray[np.float64]] = []
    clock: list[float] = []
    number, count = table.first, 0
    word_columns = sorted({*range(table.width)} - {*table.used})
    while block := list(itertools.islice(lines, BLOCK)):
        if word_columns:
            _require_words(block, number, word_columns, table)
        values = _convert(block, table)
        if values is None:
            values = _convert_each(block, number, table)
        if table.clock is not None:
            clock += _read_clock(block, number, table)
        blocks.append(values)
        number, count = number + len(block), count + values.size
        if count > MAX_NUMBERS:
            refuse(
                f"{table.name}: more than {MAX_NUMBERS / 1e6:.1f} million numbers as text",
                "longer recordings as WAV, RF64, FLAC, HDF5 or TDMS",
            )
    columns = {
        i: np.concatenate([block[:, k] for block in blocks]) for k, i in enumerate(table.used)
    }
    if table.clock is not None:
        columns[table.clock] = continued(np.array(clock))
    return columns


def _read_clock(block: list[str], first: int, table: _Table) -> list[float]:
    """Return times of day, s, from the column of date and time."""
    times = []
    for number, line in enumerate(block, first):
        if not strip_comment(line):
            continue
        cell = table.cells(line)[table.clock or 0]
        time = seconds_of_day(cell)
        if time is None:
            refuse(f"{table.name}: line {number}: {shown_text(cell)!r} is not a time", ALLOWED)
        times.append(time)
    return times


def _require_words(block: list[str], first: int, word_columns: list[int], table: _Table) -> None:
    for number, line in enumerate(block, first):
        cells = table.cells(line)
        column = next((i for i in word_columns if i < len(cells) and is_number(cells[i])), None)
        if column is not None:
            refuse(
                f"{table.name}: line {number}: column {column + 1} has a number, "
                f"{shown_text(cells[column])}, but none in line {table.first}",
                "columns of numbers or of words",
            )


def _convert(block: list[str], table: _Table) -> NDArray[np.float64] | None:
    """Return the numbers of a block of lines; None if a line is empty, unusual or wrong."""
    separator, decimal = table.separator, table.decimal.mark
    joined = "\n".join(block)
    if separator is None:
        counts = {len(line.split()) for line in block}
    else:
        counts = {line.count(separator) + 1 for line in block}
    if counts != {table.width} or UNUSUAL[decimal].search(joined):
        return None
    lines = joined.replace(",", ".").split("\n") if decimal == "," else block
    try:
        return np.loadtxt(
            lines, delimiter=separator, comments=None, usecols=table.used, ndmin=2,
            dtype=np.float64,
        )  # fmt: skip
    except (ValueError, OverflowError):
        return None


def _convert_each(block: list[str], first: int, table: _Table) -> NDArray[np.float64]:
    """Return the numbers of a block, line by line; raise InputError if a line is wrong."""
    rows = []
    for number, line in enumerate(block, first):
        if not strip_comment(line):
            continue
        cells = table.cells(line)
        used = [cells[i] for i in table.used if i < len(cells)]
        row = [to_number(cell, table.decimal.mark) for cell in used]
        if None in row:
            wrong = table.decimal.explain(shown_text(used[row.index(None)]))
            refuse(f"{table.name}: line {number}: {wrong}", ALLOWED)
        if len(cells) != table.width:
            count = f"{len(cells)} columns, {table.width} in the lines above"
            refuse(f"{table.name}: line {number}: {count}", ALLOWED)
        rows.append(row)
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(table.used))


def _channels(table: _Table, values: dict[int, NDArray[np.float64]]) -> list[Channel]:
    numeric = list(values)
    rows = len(values[numeric[0]])
    if rows < MIN_SAMPLES:
        count = f"{rows} rows of {len(numeric)} numbers"
        refuse(f"{table.name}: {count}", f"{MIN_SAMPLES} rows or more of numbers")
    titles, units = _titles(table, table.width)
    rate = find_rate(table.header, table.decimal.mark if table.decimal.line else "")
    steps: tuple[str, ...] = ()
    if table.clock is not None:
        numeric.remove(table.clock)
    time = next((i for i in numeric if is_time(titles[i]) or _is_time_unit(units[i])), None)
    may_be_untitled = time is None and table.clock is None and len(numeric) > 1
    if may_be_untitled and (rate is None or _are_times(values[numeric[0]])):
        time = numeric[0]
    step = None
    if time is not None and (len(numeric) > 1 or table.clock is not None):
        numeric.remove(time)
        scale = TIME_UNITS.get(units[time].casefold(), 1.0)
        if not units[time] and are_days(values[time]):
            step, steps = _date_time_step(values[time], DAY, table.name)
        else:
            _, step, steps = uniform_grid(values[time] * scale, table.name)
    elif table.clock is not None:
        step, steps = _date_time_step(values[table.clock], 1.0, table.name)
    if step is not None:
        if rate is not None and abs(step * rate - 1) > SAME_RATE:
            refuse(
                f"{table.name}: {rate:.6g} Hz by its header and {1 / step:.6g} Hz by its times",
                "one sample rate",
            )
        rate = rate or 1 / step
    return [
        Channel(
            name=titles[i],
            number=i + 1,
            n_sample=rows,
            samples=partial(read_array, values[i]),
            unit=units[i],
            sample_rate=rate,
            date=find_word(table.header, DATE),
            steps=steps,
        )
        for i in numeric
    ]


def _date_time_step(
    times: NDArray[np.float64], unit: float, name: str
) -> tuple[float | None, tuple[str, ...]]:
    """Return the step of date-times, s, and notes; `unit` is that of the times, s."""
    step = step_of_date_times(times, name)
    if step is None:
        return None, ("The date-times are too coarse to show the sample rate.",)
    return unit * step, (f"The sample rate is that of the date-times, {1 / (unit * step):.7g} Hz.",)


def _are_times(column: NDArray[np.float64]) -> bool:
    """Whether a column without a title rises uniformly enough to be times."""
    rise = np.diff(column)
    return bool((rise > 0).all() and rise.max() < 2 * rise.min() + SAME_RATE * rise.mean())


def _is_time_unit(unit: str) -> bool:
    return bool(unit) and unit.casefold() in TIME_UNITS and not find_unit(unit)


def _titles(table: _Table, width: int) -> tuple[list[str], list[str]]:
    titles, units = [""] * width, [""] * width
    for cells in table.titles:
        pairs = [split_title(cell) for cell in cells]
        only_units = all(
            not cell or find_unit(cell) or cell.casefold() in TIME_UNITS
            for cell in (unit or name for name, unit in pairs)
        ) and not any(name and unit for name, unit in pairs)
        if only_units and any(cells):
            units = [unit or name for name, unit in pairs]
        else:
            titles = [name for name, _ in pairs]
            units = [unit or old for (_, unit), old in zip(pairs, units, strict=True)]
    common = find_word(table.header, UNIT)
    return titles, [
        unit or ("" if is_time(title) else common)
        for title, unit in zip(titles, units, strict=True)
    ]
