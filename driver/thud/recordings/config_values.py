"""Keys of a configuration: a check, a unit and a meaning each, and the base of their tables."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import MISSING, dataclass, field, fields
from datetime import date
from numbers import Integral
from typing import Any, ClassVar, Self

from thud.base.checks import (
    refuse,
    refuse_unknown,
    refuse_value,
    require_choice,
    require_number,
    require_whole,
)
from thud.base.errors import InputError
from thud.level.assessment import get_criteria
from thud.level.levels import SOURCES
from thud.recordings.force_units import Calibration, plain_number, read_chain
from thud.recordings.words import read_date

MAX_TEXT = 500
# Maximum number of digits of the number of a drop.
MAX_DIGITS = 6
SUM = "sum"
# Maximum number of channels that are added.
MAX_CELLS = 64
EXAMPLES = '"sum", "F1+F2+F3+F4" or a list of names or numbers'


@dataclass(frozen=True)
class Number:
    """Check of a number between two limits in a unit; empty for a pure number."""

    low: float
    high: float
    unit: str = ""
    whole: bool = False

    def __call__(self, value: Any, key: str) -> Any:  # noqa: ANN401 - of a user; a number
        """Return the number; raise InputError if it is none or out of range."""
        if self.whole:
            return require_whole(key, value, int(self.low), int(self.high))
        require_number(key, value)
        if not self.low <= float(value) <= self.high:
            allowed = f"{self.low:g} to {self.high:g} {self.unit}".rstrip()
            refuse_value(key, value, allowed, low=self.low, high=self.high)
        return float(value)


@dataclass(frozen=True)
class Choice:
    """Check of one of several words."""

    words: Collection[str]

    def __call__(self, value: object, key: str) -> str:
        """Return the word; raise InputError if it is not known."""
        require_choice(key, value, self.words)
        return str(value)


@dataclass(frozen=True)
class Listed:
    """Check of each entry of a list, or of a single entry, which need not be in a list."""

    entry: Callable[[object, str], object]

    def __call__(self, value: object, key: str) -> tuple[Any, ...]:
        """Return the entries."""
        entries = value if isinstance(value, list | tuple) else [value]
        return tuple(self.entry(entry, key) for entry in entries)


def to_line(value: object, key: str) -> str:
    """Return a line of text."""
    if not isinstance(value, str) or len(value) > MAX_TEXT or not value.isprintable():
        refuse_value(key, value, f"a line of up to {MAX_TEXT} characters")
    return value


def to_day(value: object, key: str) -> str:
    """Return the date of the measurement as text, in any form."""
    return value.isoformat() if isinstance(value, date) else to_line(value, key)


def to_date(value: object, key: str) -> str:
    """Return a date as text in ISO 8601; empty if not stated."""
    text = to_day(value, key)
    read = read_date(text) if text else None
    if text and read is None:
        refuse_value(key, value, 'a date, such as "2024-05-03"')
    return read.date().isoformat() if read else ""


def to_channel(value: object, key: str) -> int | str:
    """Return the number or the name of a channel."""
    if isinstance(value, Integral) and not isinstance(value, bool):
        return int(Number(1, 1_000_000, whole=True)(int(value), key))
    return to_line(value, key)


def require_channels(value: object, key: str = "channels") -> str | tuple[int | str, ...]:
    """Return ``"sum"`` or names and numbers of channels; raise InputError if they are neither.

    >>> require_channels("F1 + F2 + 3")
    ('F1', 'F2', 3)
    """
    names: Any = value if isinstance(value, list | tuple) else ()
    if isinstance(value, str):
        if value.strip().casefold() == SUM:
            return SUM
        parts = map(str.strip, value.split("+"))
        names = [int(name) if name.isdecimal() else name for name in parts]
    are_names = all(type(name) in {int, str} and name for name in names)
    if not 1 < len(names) <= MAX_CELLS or not are_names or len(set(names)) < len(names):
        refuse_value(key, value, f"{EXAMPLES}, 2 to {MAX_CELLS} different")
    return tuple(names)


def to_calibrations(value: object, key: str) -> Any:  # noqa: ANN401 - one, or a tuple of them
    """Return a calibration, also that of a list of one, or one for each channel.

    Each is a number, a chain of factors or a `Calibration`.
    """
    if isinstance(value, list | tuple):
        several = len(value) > 1
        names = [f"{key}, entry {i}" if several else key for i in range(1, len(value) + 1)]
        entries = tuple(map(to_calibrations, value, names))
        return entries[0] if len(entries) == 1 else entries
    value = plain_number(value)
    if isinstance(value, Calibration):
        return value
    if not isinstance(value, str):
        return Number(-1e30, 1e30)(value, key)
    try:
        read_chain(to_line(value, key))
    except InputError as error:
        raise error.within(key) from error
    return value


def _pair(value: object, key: str, ends: str, number: Number) -> tuple[float, float]:
    if not isinstance(value, list | tuple) or len(value) != 2:  # noqa: PLR2004
        refuse_value(key, value, f"[{ends}]")
    return number(value[0], key), number(value[1], key)


def to_linearity(value: object, key: str) -> tuple[tuple[float, float], ...]:
    """Return pairs of an applied and an indicated force, N."""
    pairs = value if isinstance(value, list | tuple) else []
    if len(pairs) < 2:  # noqa: PLR2004
        refuse_value(key, value, "two or more pairs [applied, indicated], N")
    return tuple(_pair(pair, key, "applied, indicated", Number(1e-3, 1e9)) for pair in pairs)


def parse_numbers(text: str, key: str) -> list[range]:
    """Return the ranges of numbers in a text such as ``"1-5, 8"``; raise InputError if none."""
    ranges = []
    for part in text.split(","):
        first, dash, last = (side.strip() for side in part.partition("-"))
        sides = (first, last) if dash else (first, first)
        is_valid = all(side.isdecimal() and len(side) <= MAX_DIGITS for side in sides)
        ranges.append(range(int(sides[0]), int(sides[1]) + 1) if is_valid else range(0))
    if not all(ranges) or any(part.start < 1 for part in ranges):
        refuse_value(key, text, 'numbers of drops from 1, such as "1-5, 8"')
    return ranges


def to_numbers(value: object, key: str) -> str:
    """Return the text of numbers of drops."""
    text = to_line(value, key)
    parse_numbers(text, key)
    return text


def _table(value: object, key: str) -> Mapping[str, object]:
    if not isinstance(value, Mapping):
        refuse_value(key, value, "a table")
    return value


def to_reasons(value: object, key: str) -> dict[str, str]:
    """Return reasons by numbers of drops."""
    reasons = {
        to_numbers(str(number), key): to_line(reason, key)
        for number, reason in _table(value, key).items()
    }
    for number, reason in reasons.items():
        if not reason.strip():
            refuse(f"{key}: {number} has no reason", 'a reason, such as "touched"')
    return reasons


def to_limits(value: object, key: str) -> dict[str, tuple[float, float]]:
    """Return minimum and maximum by criterion."""
    table = _table(value, key)
    refuse_unknown(key, table, [criterion.name for criterion in get_criteria(SOURCES[0])])
    limits = {}
    for name, span in table.items():
        low, high = _pair(span, f"{key}: {name}", "minimum, maximum", Number(-1e6, 1e6))
        if not low < high:
            refuse_value(f"{key}: {name}", span, "minimum < maximum")
        limits[name] = (low, high)
    return limits


def key(
    check: Callable[[Any, str], object],
    meaning: str,
    default: object = None,
) -> Any:  # noqa: ANN401 - a field of any type
    """Declare a key: its check, which returns the value or raises InputError, and its meaning."""
    metadata = {"check": check, "meaning": meaning}
    if default == {}:
        return field(default_factory=dict, metadata=metadata)
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class Table:
    """Base of the tables of a configuration, whose values are checked when they are stated.

    `title` is the name of the table in messages, with a colon.
    """

    title: ClassVar[str] = ""

    def __post_init__(self) -> None:
        """Replace each stated value by that of its check, or raise InputError."""
        for name in self.stated:
            check = self.__dataclass_fields__[name].metadata["check"]
            object.__setattr__(self, name, check(getattr(self, name), f"{self.title}{name}"))

    @classmethod
    def read(cls, value: object, key: str) -> Self:
        """Return a table from that of a file; raise InputError if a key is unknown."""
        if isinstance(value, cls):
            return value
        table = _table(value, key)
        refuse_unknown(key, table, [entry.name for entry in fields(cls)])
        return cls(**table)

    @property
    def stated(self) -> list[str]:
        """Names of the keys whose values are not the defaults."""
        return [
            entry.name
            for entry in fields(self)
            if (value := getattr(self, entry.name)) is not None
            and value is not entry.default
            and not (entry.default is MISSING and isinstance(value, dict) and not value)
        ]

    def require(self, *names: str) -> None:
        """Raise InputError if a key is not stated."""
        for name in names:
            if name not in self.stated:
                refuse("is missing", " and ".join(names), name=f"{self.title}{name}")
