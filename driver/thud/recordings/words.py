"""Texts in files: numbers, units and dates in cells; names, units and values in headers.

`read_header` reads the lines above the numbers of a table: titles, units, names and values.
"""

from __future__ import annotations

import csv
import re
from datetime import datetime
from typing import TYPE_CHECKING, NamedTuple, NoReturn

import numpy as np

from thud.base.checks import refuse, shown_text
from thud.base.units import UNITS, find_unit, size_of

if TYPE_CHECKING:
    from collections.abc import Iterable

    Pairs = list[tuple[str, str]]

# Separators of columns by precedence; a line without any of them is separated by blanks.
SEPARATORS = ("\t", ";", ",")
# Decimal marks; the mark that is not the decimal one groups digits, as do the characters below.
MARKS = {".": "point", ",": "comma"}
GROUPING = " \N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}'\N{RIGHT SINGLE QUOTATION MARK}"
# Begin of a comment. Programs by Microsoft's compilers write 1.#IND, 1.#QNAN and 1.#INF for NaN and
# infinity, which are no numbers here.
COMMENT = re.compile(r"#(?!(?<=\d[.,]#)(?:IND|QNAN|SNAN|INF))")
# Marks at the end of a line that separate nothing.
TRAILING = "\t; "
# Dates and times of day: 23.11.2026 10:15:30.25, 2026-11-23T10:15Z, 15:30,25.
_DATE = r"\d{1,4}(?P<mark>[-./])\d{1,2}(?P=mark)\d{1,4}"
_CLOCK = r"(?:\d{1,2}:)?\d{1,2}:\d{2}(?:[.,]\d{1,9})?\s*(?:[ap]m)?(?:Z|[-+]\d\d:?\d\d)?"
DATE_TIME = re.compile(rf"{_DATE}(?:(?:[ T]\s*|,\s+){_CLOCK})?|{_CLOCK}", re.IGNORECASE | re.ASCII)


def _quantities(decimal: str) -> re.Pattern[str]:
    """Return the pattern of numbers with a decimal mark, and a unit behind them or none.

    The group ``group`` separates thousands. A decimal comma needs a digit behind it: the comma in
    ``0, 1.5`` separates columns.
    """
    mark = re.escape(decimal)
    fraction = rf"(?:{mark}[0-9]{'+' if decimal == ',' else '*'})?"
    grouping = "".join(other for other in MARKS if other != decimal) + GROUPING
    return re.compile(
        rf"(?P<number>[-+]?(?:nan|inf(?:inity)?|(?:[0-9]+{fraction}|{mark}[0-9]+)(?:[ed][-+]?[0-9]+)?"
        rf"|[1-9][0-9]{{0,2}}(?P<group>[{grouping}])[0-9]{{3}}(?:(?P=group)[0-9]{{3}})*{fraction}))"
        r"(?:\s*(?P<unit>[^\W\d_].*|[%\[(].*))?",
        re.IGNORECASE,
    )


_QUANTITIES = {decimal: _quantities(decimal) for decimal in MARKS}


def read_quantity(cell: str, decimal: str) -> tuple[float, str] | None:
    """Return number and unit of a cell; None if it is no number with this decimal mark.

    The unit is empty if there is none; a text with a number and anything else is no number.

    >>> read_quantity("1.234,5", ","), read_quantity("28.1 dB", "."), read_quantity("1.234,5", ".")
    ((1234.5, ''), (28.1, 'dB'), None)
    """
    match = _QUANTITIES[decimal].fullmatch(cell)
    if match is None:
        return None
    unit = (match["unit"] or "").strip(" []()")
    if unit and not find_unit(unit):
        return None
    # Fortran writes 1.5D+03.
    digits = match["number"].replace(match["group"] or "\0", "").replace(decimal, ".")
    return float(re.sub("[dD]", "e", digits)), unit


def is_number(cell: str) -> bool:
    """Whether a cell is a number with either decimal mark, and nothing else."""
    return any((quantity := read_quantity(cell, mark)) and not quantity[1] for mark in MARKS)


def find_separator(line: str) -> str | None:
    """Return the separator of the columns of a line, None for blanks.

    >>> find_separator("0,1 1,5")
    >>> find_separator("0, 1.5")
    ','
    >>> find_separator('"0,1","1,5"')
    ','
    """
    bare = re.sub('"[^"]*"', "0", line)
    separator = next((mark for mark in SEPARATORS if mark in bare), None)
    words = re.split(" +", bare)
    # A comma next to a blank is no decimal comma.
    are_numbers = all(is_number(word) and not word.startswith(",") for word in words)
    return None if separator == "," and len(words) > 1 and are_numbers else separator


def split_line(line: str, separator: str | None, *, is_row: bool = False) -> list[str]:
    """Return the cells of a line without the blanks and quotes around them.

    A row of numbers may have a comment behind them, and a line of titles a # in one.

    >>> split_line('"0,1" ;1,5  # touch', ";", is_row=True)
    ['0,1', '1,5']
    """
    if is_row:
        line = COMMENT.split(line, 1)[0].strip(" \r").rstrip(TRAILING.replace(separator or " ", ""))
        if not line:
            return []
    if '"' in line:
        words = csv.reader([line], delimiter=separator or " ", skipinitialspace=True)
        return [cell.strip() for cell in next(words)]
    if separator is None:  # other blanks group digits
        return re.split("[ \t]+", line)
    return [cell.strip() for cell in line.split(separator)]


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


# Aliases in lower case, letters and digits only.
RATE = _words(
    "samplerate samplingrate samplefrequency samplingfrequency fs sr sfreq fsample srate "
    "samplerateperchannel samplespersecond samplespersec scanrate matsamplerate abtastrate "
    "abtastfrequenz messrate frequenceechantillonnage "
    "샘플링주파수 샘플링레이트 표본화주파수 サンプリング周波数 サンプリングレート 標本化周波数"
)
STEP = _words(
    "dt deltat deltax timestep samplinginterval sampleinterval sampletime samplingtime "
    "sampleperiod samplingperiod timeincrement xincrement wfincrement increment interval ts "
    "tsample abtastintervall abtastzeit 샘플링간격 시간간격 "
    "サンプリング間隔 サンプリング周期 時間間隔"
)
DATE = _words(
    "date datum datetime recorded recordingdate measurementdate measured starttime timestamp "
    "wfstarttime startdate datestarted created 날짜 측정일 측정일시 日付 日時 測定日 測定日時"
)
UNIT = _words("unit units einheit unitstring yunit yunits yunitlabel forceunit unitsy 단위 単位")
TIME_UNIT = _words("timeunit timeunits xunit xunits xunitlabel unitsx unittime zeiteinheit")
TIME = _words(
    "time times t zeit temps tempo sec seconds xvalue abscissa timestamps 시간 시각 時間 時刻"
)
# "Force [kN]", "Force (kN) 1"; "Force / kN", "Force, kN"; "Force in kN", "Force_kN", "Force kN".
BRACKETS = re.compile(r"\[([^][]{0,30})\]|\{([^{}]{0,30})\}|\(((?:[^()]|\([^()]*\)){0,30})\)")
LOOSE = re.compile(r"(?P<name>.*?\S)(?P<mark>\s*[/,]\s*|\s+in\s+|_+|\s+)(?P<unit>[^\s,_]{1,12})\s*")
# Words that are no units after a blank, or after an underscore.
_AMBIGUOUS = {"": {"g", "h", "min", "K", "rad"}, "_": {"h", "K"}}
# Names of factors and offsets; of factors that convert to a unit, which apply if no unit is stated.
_FACTOR = re.compile(
    r"sensitivity|(amp|amplifier|channel|data|force|raw|sensor|signal|unit|y)?"
    r"((gain|scale|scaling|conversion|calibration|multiplication)(factor|coefficient|db)?"
    r"|factor|multiplier|slope)s?"
)
_OFFSET = frozenset({"addoffset", "offset", "intercept"})
_SENSITIVITY = _words("sensitivity calibration")
# Full-width brackets of Japanese and Korean titles, and those of ASCII.
_BRACKETS = str.maketrans("\uff08\uff09\uff3b\uff3d", "()[]")
_DATE_FORMATS = ("%d.%m.%Y", "%Y/%m/%d", "%Y:%m:%d", "%d-%b-%y", "%d-%b-%Y", "%d %b %Y")
_TIME_FORMATS = ("", " %H:%M:%S", " %H:%M")
# Maximum length of a title or value.
MAX_LENGTH = 200
# Begin of a comment in a header.
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


def plain(name: str) -> str:
    """Return a name in lower case, letters and digits only.

    >>> plain("Sample_Rate ")
    'samplerate'
    """
    return "".join(c for c in name[:MAX_LENGTH].casefold() if c.isalnum())


def split_title(title: str) -> tuple[str, str]:
    """Return name and unit of a title; the unit is empty if there is none.

    >>> split_title("Force [kN]")
    ('Force', 'kN')
    >>> split_title("time_s")
    ('time', 's')
    """
    text = title.strip().strip("\"'").strip()[:MAX_LENGTH].translate(_BRACKETS)
    loose = LOOSE.fullmatch(text)
    if loose and (unit := find_unit(loose["unit"])):
        mark = loose["mark"].strip()
        if unit not in _AMBIGUOUS.get(mark[:1], ()) or plain(loose["name"]) in TIME:
            return loose["name"].strip(), loose["unit"]
    groups = [(match, "".join(filter(None, match.groups()))) for match in BRACKETS.finditer(text)]
    for match, unit in groups:
        if find_unit(unit) or (match is groups[-1][0] and text.endswith(match[0])):
            name = f"{text[: match.start()]} {text[match.end() :]}"
            return " ".join(name.split()), unit.strip()
    return text, ""


def is_time(name: str, unit: str) -> bool:
    """Whether name and unit of a column are those of times."""
    return plain(name) in TIME or size_of(unit)[0] == "s"


def read_number(text: object, decimal: str = "") -> tuple[float, str] | None:
    """Return a number and the unit after it; None if it is none, or its unit is not known.

    If the text is a number with either decimal mark, `decimal` is the mark. Without it the mark is
    the point, and None is returned for an ambiguous number such as 51,200.

    >>> read_number("51,2 kHz")
    (51.2, 'kHz')
    """
    cell = str(text).strip().strip("\"'").strip()[:MAX_LENGTH]
    found = {mark: read for mark in MARKS if (read := read_quantity(cell, mark))}
    if not found or (len(set(found.values())) > 1 and not decimal and "," in cell):
        return None
    return found.get(decimal or ".") or next(iter(found.values()))


class Facts(NamedTuple):
    """What a header states: sample rate, Hz, unit and date; None or empty if it does not.

    `unapplied` is the first factor or offset that changes values.
    """

    rate: float | None
    unit: str
    date: str
    unapplied: str


def read_facts(items: Pairs, unit: str = "", decimal: str = "") -> Facts:
    """Return what names and values of a header state; a known unit of the values precedes theirs.

    `decimal` is that of `read_number`.
    """
    rate, date = None, ""
    for title, value in items:
        name, titled = split_title(title)
        word, text = plain(name), value.strip().strip("\"'")[:MAX_LENGTH]
        kind = "Hz" if word in RATE else "s" if word in STEP else ""
        number, own = (read_number(value, decimal) if kind else None) or (0.0, "")
        base, size = size_of(own or titled or kind)
        if rate is None and number * size > 0 and base == kind:
            rate = number * size if kind == "Hz" else 1 / (number * size)
        date = date or (text if word in DATE else "")
        unit = unit or (text if word in UNIT else "")
    unapplied = (
        f"{title[:MAX_LENGTH]} = {value[:MAX_LENGTH]}"
        for title, value in items
        if (neutral := _neutral(plain(split_title(title)[0]), unit)) is not None
        and (read_number(value) or (None, ""))[0] != neutral
    )
    return Facts(rate, unit, date, next(unapplied, ""))


def _neutral(word: str, unit: str = "") -> float | None:
    """Return the value of a factor or an offset that changes no values in a unit; None if none."""
    if word in _SENSITIVITY and unit:
        return None
    return 0.0 if word in _OFFSET else 1.0 if _FACTOR.fullmatch(word) else None


def text_of(value: object) -> str:
    """Return an attribute as text: bytes, text, a number, or an array with one element."""
    item = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    while isinstance(item, list | tuple) and len(item) == 1:
        item = item[0]
    if isinstance(item, bytes):
        return item.decode("utf-8", "replace")
    return "" if isinstance(item, list | tuple) or item is None else str(item)


def read_date(text: str) -> datetime | None:
    """Return a date written in ISO 8601 or one of the other known formats; None if in none.

    >>> read_date("03.05.2024").date().isoformat()
    '2024-05-03'
    """
    line = " ".join(text.split())
    try:
        return datetime.fromisoformat(line).replace(tzinfo=None)
    except ValueError:
        pass
    for form in (date + time for date in _DATE_FORMATS for time in _TIME_FORMATS):
        try:
            return datetime.strptime(line, form)  # noqa: DTZ007 - files state no time zone
        except ValueError:
            continue
    return None


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


def read_header(  # noqa: C901 - one pass over titles, units, names and values
    above: list[str], layout: Layout
) -> tuple[Pairs, Pairs, bool]:
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
    columns = []
    for i, (name, _) in enumerate(names):
        known = {find_unit(unit) or unit: unit for unit in stated[i] if unit not in {"", "-", "--"}}
        if len(known) > 1:
            text = " and ".join(map(shown_text, known.values()))
            refuse(f"{layout.name}: column {i + 1}: its unit is stated as {text}", "one unit")
        columns.append((name, next(iter(known.values()), name if name in UNITS else "")))
    # The first of several equal values.
    header = [
        (name, value if _neutral(plain(name)) is not None and len({*parts}) > 1 else parts[0])
        for name, value in header
        if (parts := re.split(r"[\t;]", value))
    ]
    return header, columns, bool(units or chosen)


def _read_pair(text: str) -> tuple[str, str] | None:
    """Return name and value of a line if the name is known and the value is one."""
    is_marked = PAIR.search(text)
    name, *values = PAIR.split(text, 1) if is_marked else text.rsplit(None, 1) or [""]
    value = "".join(values).strip(" :=\t;,")
    word = plain(split_title(name)[0] if is_marked else name)
    is_pair = word in UNIT | TIME_UNIT or (word in DATE and DATE_LIKE.search(value))
    is_pair = is_pair or (word in RATE | STEP and re.match(r"[-+.]?\d", value))
    # Numbers of factors and offsets, but no date of a calibration.
    is_factor = word in _OFFSET or _FACTOR.fullmatch(word)
    is_number_of = is_factor and re.match(r"[-+.]?\d", value)
    is_pair = is_pair or (is_number_of and not DATE_TIME.fullmatch(value))
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


def _refuse_row(row: Row, layout: Layout, *, is_open: bool) -> None:
    """Raise InputError for a line with numbers, units or titles that do not fit the columns.

    With `is_open` the columns have no titles yet.
    """
    is_last, is_comment = row.number == layout.first - 1, row.line.strip(" ")[:1] in tuple(COMMENTS)
    cells = [] if is_comment else split_line(row.line, layout.separator, is_row=True)
    if len(cells) >= layout.width and any(map(is_number, cells)):
        # A word may stand in front of the numbers of the first row.
        is_row = is_last and all(is_number(cells[i]) for i in layout.units)
        wrong = next((cell for cell in cells if cell and not is_number(cell)), "")
        if wrong and (is_row or not any(map(str.isalpha, next(filter(None, cells))))):
            layout.refuse(row.number, f"{shown_text(wrong)!r} is not a number")
    if VALUE.search(row.text):
        return
    # Units of titles stand in brackets, or at the end after a mark or "in".
    pieces = [piece.strip() for piece in re.split(r"[\t;,]", row.text)]
    marked = ["".join(groups) for piece in pieces for groups in BRACKETS.findall(piece)]
    loose = filter(None, map(LOOSE.fullmatch, pieces))
    marked += [match["unit"] for match in loose if match["mark"].strip()]
    states_unit = any(map(find_unit, marked))
    titles = row.titles or [split_title(t) for t in _split_titles(row.text, layout.separator)]
    count = len(titles)
    is_title = count > 1 and any(is_time(*title) for title in titles)
    is_title |= is_last and not is_comment and (layout.separator or "\n") in row.text
    if states_unit or (is_title and is_open) or _are_units(titles):
        reason = f"{count} title{'s' * (count > 1)} for {layout.width} columns"
        reason = "is a second line of titles" if row.titles else reason
        allowed = "a title for each column, with its unit if it is known"
        layout.refuse(row.number, f"{shown_text(row.text)!r}: {reason}", allowed)
