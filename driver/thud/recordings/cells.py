"""Cells of tables and values of headers: separators, numbers with their units, dates."""

from __future__ import annotations

import csv
import re

from thud.base.units import find_unit

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
