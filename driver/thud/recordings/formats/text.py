"""Tables of numbers as spreadsheets and data loggers write them."""

from __future__ import annotations

import csv
import itertools
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TextIO

import numpy as np

from thud.checks import refuse
from thud.recordings.channel import WHOLE, Channel, require_small, shown_path, shown_text
from thud.recordings.grid import even_grid
from thud.recordings.signal import ArraySamples
from thud.recordings.units import find_unit
from thud.recordings.words import (
    DATE,
    RATE,
    STEP,
    TIME_UNITS,
    UNIT,
    find_rate,
    find_word,
    is_time,
    plain,
    split_title,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

# The first of these that a line contains separates its columns; otherwise blanks do.
SEPARATORS = ("\t", ";", ",")
COMMENTS = "#%!*'/;"
# Maximum lengths of a line, of a header in lines, and of a table in numbers.
LONGEST = 2**16
LONGEST_HEADER = 1000
MOST_NUMBERS = 2**24
MOST_COLUMNS = 256
# Characters that are read and lines that are converted at once.
PIECE = 2**20
BLOCK = 2**14
SHORTEST = 8
DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?|[-+]?\d+")
# Between names and values of a header; lines of titles and units.
PAIR = re.compile(r"[:=\t;,]")
MOST_TITLES = 3
# Relative difference of two statements about the rate.
SAME_RATE = 0.01
ALLOWED = (
    "columns of numbers, separated by commas, semicolons, tabs or blanks (decimal commas with "
    "semicolons, tabs and blanks)"
)


@dataclass
class _Table:
    """Lines of a file, sorted into header, titles and numbers."""

    name: str
    separator: str | None = None
    decimal_comma: bool = False
    header: list[tuple[str, object]] = field(default_factory=list)
    titles: list[list[str]] = field(default_factory=list)
    first: int = 1
    width: int = 0

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line."""
        return [cell.strip() for cell in line.split(self.separator)]

    def titles_of(self, line: str, columns: int) -> list[str]:
        """Return the cells of a line of words, which may hold separators in quotes."""
        if columns == 1:
            return [line.strip()]
        if self.separator and '"' in line:
            return next(csv.reader([line], delimiter=self.separator))
        return self.cells(line)

    def clean(self, line: str) -> str:
        """Return a line without its comment and what ends it, with decimal points."""
        rest = line.partition("#")[0].strip().rstrip(";").rstrip()
        return rest.replace(",", ".") if self.decimal_comma else rest


def read_channels(path: Path) -> list[Channel]:
    """Return the columns of numbers of a text file but that of the times."""
    require_small(path, "text", WHOLE)
    with path.open("rb") as file:
        mark = file.read(2)
    encoding = "utf-16" if mark in {b"\xff\xfe", b"\xfe\xff"} else "utf-8-sig"
    # A header may be in another encoding than UTF-8.
    with path.open(encoding=encoding, errors="replace") as text:
        table = _Table(shown_path(path))
        lines = _lines(text, table.name)
        begin = _read_header(lines, table)
        values = _read_numbers(itertools.chain(begin, lines), table)
    return _channels(table, values)


def _lines(text: TextIO, name: str) -> Iterator[str]:
    """Yield the lines of a text without their ends; raise InputError where one is too long."""
    while piece := text.read(PIECE):
        lines = (piece + text.readline(LONGEST + 1)).removesuffix("\n").split("\n")
        if max(map(len, lines)) > LONGEST or "\0" in piece:
            what = "holds zero bytes" if "\0" in piece else f"is longer than {LONGEST} characters"
            refuse(f"{name}: a line {what}", ALLOWED)
        yield from lines


def _read_header(lines: Iterator[str], table: _Table) -> list[str]:
    """Sort the lines above the numbers into a table; return the first lines of numbers."""
    above: list[str] = []
    for line in itertools.islice(lines, LONGEST_HEADER):
        separator, comma = _separator(line.partition("#")[0].strip())
        probe = _Table(table.name, separator, comma)
        cells = probe.cells(probe.clean(line))
        found = [_number(cell) for cell in cells]
        # Beside the numbers a table may have words, such as a state.
        if found and found[0] is not None and found.count(None) < len(found) / 2:
            table.separator, table.decimal_comma = separator, comma
            table.first = len(above) + 1
            _sort_header(above, table, len(cells))
            if separator == "," and _is_one_column(line.strip(), table):
                table.separator, table.decimal_comma = ";", True
                _sort_header(above, table, 1)
            return [line]
        above.append(line)
    return refuse(f"{table.name}: cannot be read (no numbers)", ALLOWED)


def _is_one_column(text: str, table: _Table) -> bool:
    """Whether a comma is a decimal point: there is a rate, no time, and no title for each side."""
    return (
        DECIMAL_COMMA.fullmatch(text) is not None
        and not table.titles
        and find_rate(table.header) is not None
    )


def _separator(text: str) -> tuple[str | None, bool]:
    """Return what separates columns, None for blanks, and whether commas are decimal points."""
    separator = next((one for one in SEPARATORS if one in text), None)
    words = text.split()
    if separator == "," and len(words) > 1 and all(DECIMAL_COMMA.fullmatch(w) for w in words):
        return None, True
    return separator, separator in {"\t", ";"}


def _sort_header(above: list[str], table: _Table, columns: int) -> None:
    """Find names and values, and the titles of the columns, in the lines above the numbers."""
    texts = [text for line in above if (text := line.strip().lstrip(COMMENTS).strip())]
    for place, text in enumerate(texts):
        cells = table.titles_of(text.rstrip(";"), columns)
        words = plain(split_title(re.split(PAIR, text, maxsplit=1)[0])[0])
        is_pair = words in RATE | STEP | DATE | UNIT and columns < 3  # noqa: PLR2004
        is_near = place >= len(texts) - MOST_TITLES and len(cells) == columns and not is_pair
        if is_near and all(_number(cell) is None for cell in cells):
            table.titles.append(cells)
            continue
        pair = re.split(PAIR, text, maxsplit=1)
        if len(pair) == 1:
            pair = text.rsplit(maxsplit=1)
        if len(pair) == 2:  # noqa: PLR2004 - name and value
            # Of values of several channels the first counts.
            table.header.append((pair[0], re.split(r"[\t;]", pair[1].strip(" :=\t;,"))[0]))


def _read_numbers(lines: Iterator[str], table: _Table) -> dict[int, NDArray[np.float64]]:
    """Return the columns of numbers of the lines by their place; columns of words are left out."""
    first = next(lines)
    cells = table.cells(table.clean(first))
    used = [i for i, cell in enumerate(cells) if _number(cell) is not None]
    if len(cells) > MOST_COLUMNS:
        refuse(f"{table.name}: {len(cells)} columns", f"up to {MOST_COLUMNS}")
    table.width = len(cells)
    blocks: list[NDArray[np.float64]] = []
    lines = itertools.chain([first], lines)
    number, count = table.first, 0
    while block := list(itertools.islice(lines, BLOCK)):
        values = _convert(block, table, used)
        if values is None:
            values = _convert_each(block, number, table, used)
        blocks.append(values)
        number, count = number + len(block), count + values.size
        if count > MOST_NUMBERS:
            refuse(
                f"{table.name}: more than {MOST_NUMBERS / 1e6:.1f} million numbers as text",
                "longer recordings as WAV, RF64, FLAC, HDF5 or TDMS",
            )
    return {i: np.concatenate([block[:, k] for block in blocks]) for k, i in enumerate(used)}


def _convert(block: list[str], table: _Table, used: list[int]) -> NDArray[np.float64] | None:
    """Return the numbers of some lines; None where one is empty, has comments or is wrong."""
    separator = table.separator
    joined = "\n".join(block)
    if separator is None:
        counts = {len(line.split()) for line in block}
    else:
        counts = {line.count(separator) + 1 for line in block}
    if counts != {table.width} or "#" in joined:
        return None
    lines = joined.replace(",", ".").split("\n") if table.decimal_comma else block
    try:
        return np.loadtxt(
            lines, delimiter=separator, comments=None, usecols=used, ndmin=2, dtype=np.float64
        )
    except (ValueError, OverflowError):
        return None


def _convert_each(
    block: list[str], first: int, table: _Table, used: list[int]
) -> NDArray[np.float64]:
    """Return the numbers of some lines; raise InputError where one has others or other columns."""
    rows = []
    for number, line in enumerate(block, first):
        text = table.clean(line)
        if not text:
            continue
        cells = table.cells(text)
        row = [_number(cells[i]) if i < len(cells) else 0.0 for i in used]
        if None in row:
            wrong = shown_text(cells[used[row.index(None)]])[:40]
            refuse(f"{table.name}: line {number}: {wrong!r} is not a number", ALLOWED)
        if len(cells) != table.width:
            what = f"{len(cells)} columns, {table.width} above it"
            refuse(f"{table.name}: line {number}: {what}", ALLOWED)
        rows.append(row)
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(used))


def _number(cell: str) -> float | None:
    """Return the number in a cell; None where it is not one."""
    try:
        return float(cell)
    except ValueError:
        return None


def _channels(table: _Table, values: dict[int, NDArray[np.float64]]) -> list[Channel]:
    """Return the columns of a table but that of the times."""
    numeric = list(values)
    rows = len(values[numeric[0]])
    if rows < SHORTEST:
        what = f"{rows} rows of {len(numeric)} numbers"
        refuse(f"{table.name}: {what}", f"{SHORTEST} rows or more of numbers")
    titles, units = _titles(table, table.width)
    rate = find_rate(table.header)
    steps: tuple[str, ...] = ()
    time = next((i for i in numeric if is_time(titles[i]) or _is_time_unit(units[i])), None)
    if time is None and len(numeric) > 1 and (rate is None or _are_times(values[numeric[0]])):
        time = numeric[0]
    if time is not None and len(numeric) > 1:
        numeric.remove(time)
        scale = TIME_UNITS.get(units[time].casefold(), 1.0)
        _, step, steps = even_grid(values[time] * scale, table.name)
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
            samples=ArraySamples(values[i]),
            unit=units[i],
            sample_rate=rate,
            date=find_word(table.header, DATE),
            steps=steps,
        )
        for i in numeric
    ]


def _are_times(column: NDArray[np.float64]) -> bool:
    """Whether a column without a title rises evenly enough to be times."""
    rise = np.diff(column)
    return bool((rise > 0).all() and rise.max() < 2 * rise.min() + SAME_RATE * rise.mean())


def _is_time_unit(unit: str) -> bool:
    """Whether a unit is one of times."""
    return bool(unit) and unit.casefold() in TIME_UNITS and not find_unit(unit)


def _titles(table: _Table, width: int) -> tuple[list[str], list[str]]:
    """Return the titles of the columns and their units."""
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
