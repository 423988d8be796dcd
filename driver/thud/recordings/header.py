"""Lines above the numbers of a table: titles and units of columns, names and values."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NoReturn

from thud.base.checks import refuse
from thud.base.units import UNITS, find_unit
from thud.recordings.channel import shown_text
from thud.recordings.times import DATE as DATE_CELL, seconds_of_day
from thud.recordings.words import (
    BRACKETS,
    COMMENT,
    DATE,
    QUANTITY,
    RATE,
    STEP,
    TIME,
    TIME_UNIT,
    UNIT,
    is_number,
    is_time,
    marked_units,
    plain,
    split_line,
    split_title,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    Pairs = list[tuple[str, str]]

COMMENTS = "#%!*'/;"
# Marks at the end of a line that separate nothing.
TRAILING = "\t; "
# Separators of name and value in a header, and begin of a value.
PAIR = re.compile(r"[:=\t;,]")
VALUE = re.compile(r"[:=]\s*[-+]?\d")
DATE_LIKE = re.compile(r"\d+[-./:]\d+|\d{8}")
# What separates titles that hold commas: tabs, semicolons, or blanks between words.
OTHER_SEPARATOR = re.compile(r"[\t;]|[^\s,] {2,}[^\s,]")
# A unit behind a comma, as in "Time, s": this comma separates no titles.
UNIT_PART = re.compile(r", +([^,]+)")
# Titles of the column that LabVIEW and spreadsheets add, which may have no cells.
REMARK = {"comment", "comments", "remark", "remarks", "kommentar", "bemerkung"}
ONE_TITLE = "a title for each column, with its unit if it is known"


@dataclass
class Layout:
    """Layout of a file: the numbers begin at line `first`.

    `used` are the columns of numbers with the units in their first cells, `clock` is a column of
    times of day, `width` the number of columns and `full_width` that with empty ones behind them.
    Line `shown` shows the decimal mark; 0 if none does.
    """

    name: str
    allowed: str
    lines: Callable[[], Iterator[str]]
    separator: str | None = None
    decimal: str = "."
    shown: int = 0
    first: int = 1
    width: int = 0
    full_width: int = 0
    used: dict[int, str] = field(default_factory=dict)
    clock: int | None = None

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line of numbers."""
        text = COMMENT.split(line, 1)[0].strip(" \r")
        text = text.rstrip(TRAILING.replace(self.separator or " ", ""))
        return split_line(text, self.separator) if text else []

    def refuse(self, line: int, reason: str, allowed: str = "") -> NoReturn:
        """Raise InputError for a line."""
        refuse(f"{self.name}: line {line}: {reason}", allowed or self.allowed)


def read_cell(cell: str) -> tuple[str, str]:
    """Return the number of a cell as text and its unit; the cell itself if there is no unit."""
    match = None if is_number(cell) else QUANTITY.fullmatch(cell)
    is_value = match and is_number(match["number"]) and find_unit(match["unit"])
    return (match["number"], match["unit"]) if match and is_value else (cell, "")


@dataclass(frozen=True, eq=False)
class _Row:
    """A line above the numbers: name and unit of its cells, and if there is one for each column."""

    number: int
    text: str
    titles: Pairs
    fits: bool

    @property
    def states(self) -> tuple[bool, bool]:
        """Whether it states units, and whether it names times."""
        units = [find_unit(unit) for _, unit in self.titles]
        names_time = any(plain(name) in TIME for name, _ in self.titles)
        return any(units), names_time or any(UNITS[unit][0] == "s" for unit in units if unit)


def read_header(above: list[str], layout: Layout) -> tuple[Pairs, Pairs, bool]:
    """Return names and values of the header, name and unit of each column, and if it has a line."""
    header: Pairs = []
    rows: list[_Row] = []
    for number, line in enumerate(above, 1):
        text = line.lstrip(COMMENTS + " \t").strip()
        if pair := _known_pair(text):
            header.append(pair)
        elif text:
            rows.append(_read_row(number, line, text, layout))
    fitting = [row for row in rows if row.fits]
    units = [row for row in fitting if _are_units(row.titles)]
    titles = [row for row in fitting if row not in units]
    # Titles state units or times, or are next to the numbers.
    chosen = max(titles, key=lambda row: (row.states, row.number), default=None)
    for row in rows:
        if row is not chosen and row not in units:
            _refuse_row(row, above, layout, is_open=chosen is None)
    names = [*chosen.titles] if chosen else []
    layout.width = max([layout.width, len(names), *(len(row.titles) for row in units)])
    names += [("", "")] * (layout.width - len(names))
    stated = [[unit, layout.used.get(i, "")] for i, (_, unit) in enumerate(names)]
    for i, (name, unit) in itertools.chain(*(enumerate(row.titles) for row in units)):
        stated[i].append(unit or name)
    times = [i for i in layout.used if is_time(f"{names[i][0]} [{stated[i][0]}]")]
    for title, value in header:
        for i, unit in _header_units(title, value, times, layout):
            stated[i].append(unit)
    columns = [
        (name, _one_unit(name, stated[i], f"{layout.name}: column {i + 1}"))
        for i, (name, _) in enumerate(names)
    ]
    return (
        [(name, re.split(r"[\t;]", value)[0]) for name, value in header],
        columns,
        bool(fitting),
    )


def _are_units(titles: Pairs) -> bool:
    """Whether most titles are units without a name."""
    filled = [title for title in titles if any(map(str.isalpha, "".join(title)))]
    known = sum(bool(find_unit(unit or name)) for name, unit in filled)
    has_names = any(name and unit for name, unit in filled)
    is_bare = bool(filled) and all(unit for _, unit in filled)
    return not has_names and (2 * known > len(filled) or is_bare)


def _one_unit(name: str, stated: list[str], label: str) -> str:
    """Return the unit of a column, of which several statements may hold the same."""
    known = {find_unit(unit) or unit: unit for unit in stated if unit not in {"", "-", "--"}}
    if len(known) > 1:
        text = " and ".join(map(shown_text, known.values()))
        refuse(f"{label}: its unit is stated as {text}", "one unit")
    return next(iter(known.values()), name if name in UNITS else "")


def _known_pair(text: str) -> tuple[str, str] | None:
    """Return name and value of a line of a header if the name is known and the value is one."""
    is_marked = PAIR.search(text)
    parts = PAIR.split(text, maxsplit=1) if is_marked else text.rsplit(maxsplit=1)
    name, value = "".join(parts[:1]).strip(), "".join(parts[1:]).strip(" :=\t;,")
    word = plain(split_title(name)[0] if is_marked else name)
    is_pair = word in UNIT | TIME_UNIT or (word in DATE and DATE_LIKE.search(value))
    is_pair = is_pair or (word in RATE | STEP and re.match(r"[-+.]?\d", value))
    return (name, value) if value and is_pair else None


def _read_row(number: int, line: str, text: str, layout: Layout) -> _Row:
    """Return the cells of a line, split so that there is a title or unit for each column."""
    separator = layout.separator
    if layout.width == 1:
        bare = text.strip(" ;\t")
        is_value = re.search(r"[:=]|[\t;]\s*\S", bare) or is_number(bare)
        return _Row(number, text, [split_title(bare)], fits=not is_value)
    # A separator in front of the titles is no comment.
    full = line.lstrip((COMMENTS + " \t").replace(separator or " ", "")).rstrip(" \r")
    splits = [*_splits(full, separator), *_splits(full.partition("#")[0].rstrip(), separator)]
    for cells in splits:
        has_number = any(
            is_number(c.rstrip(":")) or DATE_CELL.fullmatch(c) or seconds_of_day(c) is not None
            for c in cells
        )
        has_remarks = all(plain(c) in REMARK for c in cells[layout.width :] if c)
        if len(cells) < layout.width or not any(cells) or has_number:
            continue
        if has_remarks or not any(cells[layout.full_width :]):
            count = max(layout.width, *(i for i, cell in enumerate(cells, 1) if cell))
            return _Row(number, text, [split_title(cell) for cell in cells[:count]], fits=True)
    cells = next(_splits(text, separator), [text])
    return _Row(number, text, [split_title(cell) for cell in cells], fits=False)


def _splits(text: str, separator: str | None) -> Iterator[list[str]]:
    """Yield the cells of a line of titles by the separator of the numbers, and by others."""
    for mark in dict.fromkeys((separator or "\t", "\t", ";", ",")):
        if mark in text and not (mark == "," and OTHER_SEPARATOR.search(text)):
            cells = split_line(text, mark)
            parts = {find_unit(part) for part in UNIT_PART.findall(text)}
            is_split = mark != "," or _are_units(list(map(split_title, cells)))
            if is_split or not parts - {"", "counts", "FS"}:
                yield cells
    if separator is None:
        yield re.split(r" {2,}", text)
        # "Force [N]" and "Force / N" are one title.
        joined = BRACKETS.sub(lambda match: match[0].replace(" ", "\0"), text)
        words = re.sub(r"(?<=[^\])}\s])\s+(?=[\[({])|\s+(/)\s+", "\0\\1\0", joined).split()
        yield [" ".join(word.split("\0")) for word in words]


def _refuse_row(row: _Row, above: list[str], layout: Layout, *, is_open: bool) -> None:
    """Raise InputError for a line above the numbers with numbers, or with titles that do not fit.

    With `is_open` the columns have no titles yet.
    """
    line, is_last = above[row.number - 1].strip(" "), row.number == len(above)
    is_comment = line[:1] in tuple(COMMENTS)
    cells = [] if is_comment else layout.cells(line)
    while cells and not cells[-1]:
        cells.pop()
    if len(cells) == layout.width and any(map(is_number, cells)):
        # A word may stand in front of the numbers of the first row.
        is_row = is_last and all(is_number(cells[i]) for i in layout.used)
        wrong = next((cell for cell in cells if cell and not is_number(cell)), "")
        if wrong and (is_row or not any(map(str.isalpha, next(filter(None, cells))))):
            layout.refuse(row.number, f"{shown_text(wrong)!r} is not a number")
    pieces = [piece.strip() for piece in re.split(r"[\t;,]", row.text)]
    if VALUE.search(row.text) or any(is_number(read_cell(piece)[0]) for piece in pieces):
        return
    _, names_time = row.states
    states_unit = any(find_unit(unit) for piece in pieces for unit in marked_units(piece))
    count = len(row.titles)
    is_title = names_time and (count > 1 or is_last)
    if is_last and not is_comment and ":" not in row.text:
        is_title |= (layout.separator or "\n") in row.text
    if (is_title and is_open) or states_unit or _are_units(row.titles):
        reason = f"{count} title{'s' * (count > 1)} for {layout.width} columns"
        reason = reason if count != layout.width else "is a second line of titles"
        layout.refuse(row.number, f"{shown_text(row.text)!r}: {reason}", ONE_TITLE)


def _header_units(
    title: str, value: str, times: list[int], layout: Layout
) -> Iterator[tuple[int, str]]:
    """Yield columns and units of an entry of the header, of times or of the other columns."""
    used, word = [*layout.used], plain(split_title(title)[0])
    channels = [i for i in used if i not in times]
    units = [part.strip(" \"'") for part in re.split(r"[\t;,]", value)]
    if word in TIME_UNIT:
        yield from ((i, units[0]) for i in times or used[:1])
    elif word in UNIT and len(units) == 1:
        yield from ((i, units[0]) for i in channels)
    elif word in UNIT:
        lists = ([*range(layout.width)], used, channels, used[1:])
        chosen = next((some for some in lists if len(some) == len(units)), [])
        if not chosen:
            count = f"{len(units)} units for {len(channels)} channels"
            refuse(f"{layout.name}: {shown_text(title)!r} has {count}", "one, or one each")
        yield from zip(chosen, units, strict=True)
