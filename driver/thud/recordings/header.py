"""Lines above the numbers of a table: titles and units of columns, names and values."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple, NoReturn

from thud.base.checks import refuse, shown_text
from thud.base.units import UNITS, find_unit
from thud.recordings.words import (
    DATE,
    DATE_TIME,
    RATE,
    STEP,
    TIME_UNIT,
    UNIT,
    is_number,
    is_time,
    marked_units,
    plain,
    split_line,
    split_row,
    split_title,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    Pairs = list[tuple[str, str]]

COMMENTS = "#%!*'/;"
# Separators of name and value in a header, a value that is a number, and a date.
PAIR = re.compile(r"[:=\t;,]")
VALUE = re.compile(r"[:=]\s*[-+]?\d")
DATE_LIKE = re.compile(r"\d+[-./:]\d+|\d{8}")
# Blanks that separate titles; a unit behind a comma, as in "Time, s", which separates none; and a
# title among blanks, with what is in brackets behind it.
WIDE_BLANK = re.compile(r"(?<=[^\s,]) {2,}(?=[^\s,])")
UNIT_PART = re.compile(r", +([^,]+)")
BLANK_TITLE = re.compile(r"[^\s\[({]*\s*(?:\[[^]]*\]|\([^)]*\)|\{[^}]*\})|\S+")
# Titles of the column that LabVIEW and spreadsheets add, which may have no cells.
REMARK = {"comment", "comments", "remark", "remarks", "kommentar", "bemerkung"}


class Layout(NamedTuple):
    """Layout of a table.

    The numbers begin at line `first` in `width` columns, or `full_width` with empty ones behind
    them. `units` are the units in the first cells of the columns of numbers, empty without one.
    """

    name: str
    allowed: str
    separator: str | None
    first: int
    width: int
    full_width: int
    units: dict[int, str]

    def refuse(self, line: int, reason: str, allowed: str = "") -> NoReturn:
        """Raise InputError for a line."""
        refuse(f"{self.name}: line {line}: {reason}", allowed or self.allowed)


class Row(NamedTuple):
    """A line above the numbers: its number, itself, and without the marks of a comment.

    `titles` are name and unit of each column, empty if the line does not hold them.
    """

    number: int
    line: str
    text: str
    titles: Pairs


def read_header(above: list[str], layout: Layout) -> tuple[Pairs, Pairs, bool]:
    """Return names and values of the header, name and unit of each column, and if it has titles.

    Raise InputError if a line states units or numbers that cannot be attributed to the columns, or
    if units of a column differ.
    """
    header: Pairs = []
    rows: list[Row] = []
    for number, line in enumerate(above, 1):
        text = line.lstrip(COMMENTS + " \t").strip()
        if pair := _read_pair(text):
            header.append(pair)
        elif text:
            rows.append(Row(number, line, text, _read_titles(line, text, layout)))
    units = [row for row in rows if _are_units(row.titles)]
    titles = [row for row in rows if row.titles and row not in units]
    # Of several lines the titles are those with units, with times, or next to the numbers.
    ranks = [
        (any(find_unit(unit) for _, unit in row.titles), any(is_time(*t) for t in row.titles), i)
        for i, row in enumerate(titles)
    ]
    chosen = [titles[max(ranks)[-1]]] if titles else []
    for row in rows:
        if row not in units and row not in chosen:
            _refuse_row(row, layout, is_open=not chosen)
    width = max([layout.width, *(len(row.titles) for row in units + chosen)])
    names = [*(chosen[0].titles if chosen else ()), *[("", "")] * width][:width]
    stated = [[unit, layout.units.get(i, "")] for i, (_, unit) in enumerate(names)]
    for row in units:
        for units_of_column, (name, unit) in zip(stated, row.titles, strict=False):
            units_of_column.append(unit or name)
    times = [i for i in layout.units if any(is_time(names[i][0], unit) for unit in stated[i])]
    for title, value in header:
        for i, unit in _units_of_entry(title, value, times, layout, width):
            stated[i].append(unit)
    columns = [
        (name, _one_unit(name, stated[i], f"{layout.name}: column {i + 1}"))
        for i, (name, _) in enumerate(names)
    ]
    header = [(name, re.split(r"[\t;]", value)[0]) for name, value in header]
    return header, columns, bool(units or chosen)


def _read_pair(text: str) -> tuple[str, str] | None:
    """Return name and value of a line if the name is known and the value is one."""
    is_marked = PAIR.search(text)
    name, *values = PAIR.split(text, 1) if is_marked else text.rsplit(None, 1) or [""]
    value = "".join(values).strip(" :=\t;,")
    word = plain(split_title(name)[0] if is_marked else name)
    is_pair = word in UNIT | TIME_UNIT or (word in DATE and DATE_LIKE.search(value))
    is_pair = is_pair or (word in RATE | STEP and re.match(r"[-+.]?\d", value))
    return (name.strip(), value) if value and is_pair else None


def _read_titles(line: str, text: str, layout: Layout) -> Pairs:
    """Return name and unit of each column; nothing if the line does not hold them."""
    if layout.width == 1:
        title = text.strip(" ;\t")
        cells = [] if re.search(r"[:=]|[\t;]\s*\S", title) else [title]
    else:
        # A separator in front of the titles is no comment.
        marks = (COMMENTS + " \t").replace(layout.separator or " ", "")
        cells = _split_titles(line.lstrip(marks).rstrip(" \r"), layout.separator)
    further = [cell for cell in cells[layout.full_width :] if cell]
    are_values = any(is_number(cell.rstrip(":")) or DATE_TIME.fullmatch(cell) for cell in cells)
    if are_values or len(cells) < layout.width or {*map(plain, further)} - REMARK or not any(cells):
        return []
    count = max(layout.width, *(i for i, cell in enumerate(cells, 1) if cell))
    return [split_title(cell) for cell in cells[:count]]


def _split_titles(line: str, separator: str | None) -> list[str]:
    """Return the titles of a line, which may have another separator than the numbers."""
    for mark in "\t;":
        if mark in line:
            return split_line(line, mark)
    if WIDE_BLANK.search(line):
        return WIDE_BLANK.split(line) if separator is None else [line]
    if "," in line:
        cells = split_line(line, ",")
        has_unit = any(find_unit(part) not in {"", "counts"} for part in UNIT_PART.findall(line))
        return [line] if has_unit and not _are_units(list(map(split_title, cells))) else cells
    return BLANK_TITLE.findall(line) if separator is None else [line]


def _are_units(titles: Pairs) -> bool:
    """Whether titles are units without a name: most are known, or all are in brackets."""
    filled = [title for title in titles if any(map(str.isalpha, "".join(title)))]
    known = sum(bool(find_unit(unit or name)) for name, unit in filled)
    has_names = any(name and unit for name, unit in filled)
    is_bare = bool(filled) and all(unit for _, unit in filled)
    return not has_names and (2 * known > len(filled) or is_bare)


def _units_of_entry(
    title: str, value: str, times: list[int], layout: Layout, width: int
) -> Iterable[tuple[int, str]]:
    """Return columns and units of an entry of the header, of times or of other columns.

    A list of units is that of all columns, of those of numbers, of these without times, or without
    the first, which may be times that no title names.
    """
    word = plain(split_title(title)[0])
    if word not in UNIT | TIME_UNIT:
        return ()
    units = [part.strip(" \"'") for part in re.split(r"[\t;,]", value)]
    if word in TIME_UNIT:
        return [(i, units[0]) for i in times or [*layout.units][:1]]
    numbers = [*layout.units]
    channels = [i for i in numbers if i not in times]
    if len(units) == 1:
        return [(i, units[0]) for i in channels]
    lists = ([*range(width)], numbers, channels, numbers[1:])
    columns = next((some for some in lists if len(some) == len(units)), [])
    if not columns:
        count = f"{len(units)} units for {len(channels)} channels"
        refuse(f"{layout.name}: {shown_text(title)!r} has {count}", "one, or one each")
    return zip(columns, units, strict=True)


def _one_unit(name: str, stated: list[str], label: str) -> str:
    """Return the unit of a column, of which several statements may hold the same."""
    known = {find_unit(unit) or unit: unit for unit in stated if unit not in {"", "-", "--"}}
    if len(known) > 1:
        text = " and ".join(map(shown_text, known.values()))
        refuse(f"{label}: its unit is stated as {text}", "one unit")
    return next(iter(known.values()), name if name in UNITS else "")


def _refuse_row(row: Row, layout: Layout, *, is_open: bool) -> None:
    """Raise InputError for a line with numbers, units or titles that do not fit the columns.

    With `is_open` the columns have no titles yet.
    """
    is_last, is_comment = row.number == layout.first - 1, row.line.strip(" ")[:1] in tuple(COMMENTS)
    cells = [] if is_comment else split_row(row.line, layout.separator)
    if len(cells) >= layout.width and any(map(is_number, cells)):
        # A word may stand in front of the numbers of the first row.
        is_row = is_last and all(is_number(cells[i]) for i in layout.units)
        wrong = next((cell for cell in cells if cell and not is_number(cell)), "")
        if wrong and (is_row or not any(map(str.isalpha, next(filter(None, cells))))):
            layout.refuse(row.number, f"{shown_text(wrong)!r} is not a number")
    if VALUE.search(row.text):
        return
    pieces = re.split(r"[\t;,]", row.text)
    states_unit = any(find_unit(unit) for piece in pieces for unit in marked_units(piece.strip()))
    titles = row.titles or [split_title(t) for t in _split_titles(row.text, layout.separator)]
    count = len(titles)
    is_title = count > 1 and any(is_time(*title) for title in titles)
    is_title |= is_last and not is_comment and (layout.separator or "\n") in row.text
    if states_unit or (is_title and is_open) or _are_units(titles):
        reason = f"{count} title{'s' * (count > 1)} for {layout.width} columns"
        reason = "is a second line of titles" if row.titles else reason
        allowed = "a title for each column, with its unit if it is known"
        layout.refuse(row.number, f"{shown_text(row.text)!r}: {reason}", allowed)
