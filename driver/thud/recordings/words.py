"""Texts in files: numbers, units and dates in cells; names, units and values in headers."""

from __future__ import annotations

import csv
import re
from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from thud.base.units import find_unit, size_of

if TYPE_CHECKING:
    from collections.abc import Iterable

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


def split_line(line: str, separator: str | None) -> list[str]:
    """Return the cells of a line without the blanks and quotes around them.

    >>> split_line('"0,1" ;1,5', ";")
    ['0,1', '1,5']
    """
    if '"' in line:
        words = csv.reader([line], delimiter=separator or " ", skipinitialspace=True)
        return [cell.strip() for cell in next(words)]
    if separator is None:  # other blanks group digits
        return re.split("[ \t]+", line)
    return [cell.strip() for cell in line.split(separator)]


def split_row(line: str, separator: str | None) -> list[str]:
    """Return the cells of a line of numbers without a comment behind them."""
    text = COMMENT.split(line, 1)[0].strip(" \r").rstrip(TRAILING.replace(separator or " ", ""))
    return split_line(text, separator) if text else []


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
    r"(amp|amplifier|channel|data|force|raw|sensor|signal|unit|y)?"
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


def marked_units(text: str) -> list[str]:
    """Return what a text has in brackets, or at its end after a mark or "in": units of titles."""
    loose = LOOSE.fullmatch(text)
    at_end = [loose["unit"]] if loose and loose["mark"].strip() else []
    return ["".join(groups) for groups in BRACKETS.findall(text)] + at_end


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


def find_rate(items: Iterable[tuple[str, str]], decimal: str = "") -> float | None:
    """Return the sample rate, Hz, from names and values of a header; None if there is none.

    `decimal` is that of `read_number`.
    """
    for title, value in items:
        name, titled = split_title(title)
        kind = "Hz" if plain(name) in RATE else "s" if plain(name) in STEP else ""
        number, own = (read_number(value, decimal) if kind else None) or (0.0, "")
        base, size = size_of(own or titled or kind)
        if number * size > 0 and base == kind:
            return number * size if kind == "Hz" else 1 / (number * size)
    return None


def find_word(items: Iterable[tuple[str, str]], words: frozenset[str]) -> str:
    """Return the first value of a header whose name is one of some words, or an empty string."""
    for title, value in items:
        if plain(split_title(title)[0]) in words and value.strip():
            return value.strip().strip("\"'")[:MAX_LENGTH]
    return ""


def find_unapplied(items: Iterable[tuple[str, str]], unit: str) -> str:
    """Return the first factor or offset in a header that changes values; `unit` is theirs."""
    for title, value in items:
        alias = plain(split_title(title)[0])
        is_factor = not unit if alias in _SENSITIVITY else _FACTOR.fullmatch(alias)
        neutral = 0.0 if alias in _OFFSET else 1.0 if is_factor else None
        if neutral is not None and (read_number(value) or (None, ""))[0] != neutral:
            return f"{title[:MAX_LENGTH]} = {value[:MAX_LENGTH]}"
    return ""


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
