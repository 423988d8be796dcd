"""Files of numbers in columns, from instruments and spreadsheets."""

from __future__ import annotations

import csv
import re
from typing import TYPE_CHECKING, NamedTuple

from thud.base.checks import refuse

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path


# Separators of columns by precedence; a line without any of them is separated by blanks.
SEPARATORS = ("\t", ";", ",")
# Decimal marks; the mark that is not the decimal one groups digits, as do the characters below.
MARKS = {".": "point", ",": "comma"}
GROUPING = " \N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}'\N{RIGHT SINGLE QUOTATION MARK}"
QUOTED = re.compile(r'"[^"]*"')
# Begin of a comment. Programs by Microsoft's compilers write 1.#IND, 1.#QNAN and 1.#INF for NaN and
# infinity, which are no numbers here.
COMMENT = re.compile(r"#(?!(?<=\d[.,]#)(?:IND|QNAN|SNAN|INF))")
# Encodings of tables that are not Unicode: Korean and Japanese spreadsheets, and Western European
# ones, by precedence if their words are known equally well.
ENCODINGS = ("cp949", "cp932", "latin-1")
# Characters other than ASCII of German titles and of units.
_GERMAN = set("ÄÖÜäöüß°²³µ")
# Separators of words in a header; none is a byte of a character in any of the encodings.
_WORD_SEPARATOR = re.compile(r"[\t;,:=]")
# Maximum size of the header from which the encoding is determined, bytes.
_MAX_HEADER_SIZE = 2**20
# Maximum length of a line.
MAX_LINE = 2**16


def _numbers(decimal: str) -> re.Pattern[str]:
    """Return the pattern of numbers with a decimal mark; the first group has 1 to 3 digits.

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


class DecimalMark(NamedTuple):
    """Decimal mark of a table, and the number of the line that shows it; 0 if no line does."""

    mark: str = "."
    line: int = 0

    def explain(self, cell: str) -> str:
        """Return the reason why a cell is not a number."""
        reason = f"{cell[:40]!r} is not a number"
        if is_number(cell) and self.line:
            reason += f" with the decimal {MARKS[self.mark]} of line {self.line}"
        return reason


def find_encoding(path: Path, is_known: Callable[[str], bool]) -> str:
    """Return the encoding of a text.

    UTF-16 has a byte order mark. A header that is not UTF-8 has that of `ENCODINGS` in which
    `is_known` is true of the most words that are not ASCII, or Latin-1 if its only such characters
    are those of German and of units; else the result is UTF-8.
    """
    with path.open("rb") as file:
        content = file.read(_MAX_HEADER_SIZE)
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    lines = [line for line in content.split(b"\n") if not line.isascii()]
    header = b"\n".join(lines[:-1] if len(content) == _MAX_HEADER_SIZE else lines)
    try:
        header.decode("utf-8")
    except UnicodeDecodeError:
        best = max(ENCODINGS, key=lambda name: _count_known(header, name, is_known))
        others = {c for c in header.decode("latin-1") if not c.isascii()}
        if _count_known(header, best, is_known):
            return best
        return "latin-1" if others <= _GERMAN else "utf-8-sig"
    return "utf-8-sig"


def _count_known(header: bytes, encoding: str, is_known: Callable[[str], bool]) -> int:
    """Return the number of known words that are not ASCII."""
    words = _WORD_SEPARATOR.split(header.decode(encoding, "replace").replace("\n", "\t"))
    cells = (word.strip(" \r\n\"'#") for word in words)
    return sum(not cell.isascii() and is_known(cell) for cell in cells)


def read_lines(path: Path, encoding: str, name: str, allowed: str) -> Iterator[str]:
    """Yield the lines of a text without line ends.

    Raise InputError, naming the line, if a line is too long or holds zero bytes.
    """
    with path.open(encoding=encoding, errors="replace") as text:
        for number, ended in enumerate(iter(lambda: text.readline(MAX_LINE + 1), ""), start=1):
            line = ended.removesuffix("\n")
            if "\0" in line:
                refuse(f"{name}: line {number} holds zero bytes", allowed)
            if len(line) > MAX_LINE:
                refuse(f"{name}: line {number} is longer than {MAX_LINE} characters", allowed)
            yield line


def strip_comment(line: str) -> str:
    """Return a line without its comment and the blanks around it."""
    return COMMENT.split(line, 1)[0].strip(" \r")


def find_separator(line: str) -> str | None:
    """Return the separator of the columns of a line, None for blanks.

    >>> find_separator("0,1 1,5")
    >>> find_separator("0, 1.5")
    ','
    >>> find_separator('"0,1","1,5"')
    ','
    """
    bare = QUOTED.sub("0", line)
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


def to_number(cell: str, decimal: str) -> float | None:
    """Return the number in a cell; None if the cell is not a number with this decimal mark.

    >>> to_number("1.234,5", ","), to_number("1.234,5", ".")
    (1234.5, None)
    """
    match = NUMBERS[decimal].fullmatch(cell)
    if match is None:
        return None
    if match["group"]:
        cell = cell.replace(match["group"], "")
    # Fortran writes 1.5D+03.
    return float(re.sub("[dD]", "e", cell.replace(decimal, ".")))


def is_number(cell: str) -> bool:
    """Whether a cell is a number with either decimal mark."""
    return any(pattern.fullmatch(cell) for pattern in NUMBERS.values())


def find_decimal(
    rows: Iterable[tuple[int, list[str], bool]], separator: str | None, name: str
) -> DecimalMark:
    """Return the decimal mark of a table.

    Each row holds its line number, its cells, and whether the line has quotes. The first number
    that is valid with only one mark decides: ``0,5``, ``1.234,5`` and ``1,2345`` show a decimal
    comma; ``1,575`` is ambiguous. Raise InputError, naming its line, if no number decides.
    """
    ambiguous: tuple[int, str] | None = None
    for line, cells, are_quoted in rows:
        # If commas separate columns, unquoted numbers have decimal points.
        has_points = separator == "," and not are_quoted
        for cell in cells:
            if "." not in cell and "," not in cell:
                continue
            marks = [mark for mark, pattern in NUMBERS.items() if pattern.fullmatch(cell)]
            if len(marks) == 1:
                return DecimalMark(marks[0], line)
            if len(marks) > 1 and ambiguous is None and not (has_points and "." in cell):
                ambiguous = line, cell
    if ambiguous is not None:
        line, cell = ambiguous
        value = to_number(cell, "," if "," in cell else ".")
        readings = " or ".join(f"{to_number(cell, mark):.15g}" for mark in MARKS)
        refuse(
            f"{name}: line {line}: {cell!r} may be {readings}, and no number of the table decides",
            f"tables with a number that shows the decimal mark, such as {cell}0 for {value:.15g}",
        )
    return DecimalMark()
