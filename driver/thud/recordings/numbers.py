"""Notation of numbers in text: decimal marks, grouped digits, and separators of columns."""

from __future__ import annotations

import csv
import re

# Separators of columns by precedence; a line without any of them is separated by blanks.
SEPARATORS = ("\t", ";", ",")
# Decimal marks; the mark that is not the decimal one groups digits, as do the characters below.
MARKS = {".": "point", ",": "comma"}
GROUPING = " \N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}'\N{RIGHT SINGLE QUOTATION MARK}"
# Begin of a comment. Programs by Microsoft's compilers write 1.#IND, 1.#QNAN and 1.#INF for NaN and
# infinity, which are no numbers here.
COMMENT = re.compile(r"#(?!(?<=\d[.,]#)(?:IND|QNAN|SNAN|INF))")


def _numbers(decimal: str) -> re.Pattern[str]:
    """Return the pattern of numbers with a decimal mark; the first group separates thousands.

    A decimal comma needs a digit behind it: the comma in ``0, 1.5`` separates columns.
    """
    mark = re.escape(decimal)
    fraction = rf"(?:{mark}\d{'+' if decimal == ',' else '*'})?"
    grouping = "".join(other for other in MARKS if other != decimal) + GROUPING
    return re.compile(
        rf"[-+]?(?:nan|inf(?:inity)?|(?:\d+{fraction}|{mark}\d+)(?:[ed][-+]?\d+)?"
        rf"|[1-9]\d{{0,2}}(?P<group>[{grouping}])\d{{3}}(?:(?P=group)\d{{3}})*{fraction})",
        re.ASCII | re.IGNORECASE,
    )


NUMBERS = {decimal: _numbers(decimal) for decimal in MARKS}


def is_number(cell: str) -> bool:
    """Whether a cell is a number with either decimal mark."""
    return any(pattern.fullmatch(cell) for pattern in NUMBERS.values())


def to_number(cell: str, decimal: str) -> float | None:
    """Return the number in a cell; None if the cell is not a number with this decimal mark.

    >>> to_number("1.234,5", ","), to_number("1.234,5", ".")
    (1234.5, None)
    """
    match = NUMBERS[decimal].fullmatch(cell)
    if match is None:
        return None
    # Fortran writes 1.5D+03.
    return float(
        re.sub("[dD]", "e", cell.replace(match["group"] or "\0", "").replace(decimal, "."))
    )


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
