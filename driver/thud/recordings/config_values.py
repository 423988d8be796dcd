"""Checks of the values in a configuration; each returns the value or raises InputError."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import date
from typing import Any

from thud.base.checks import (
    refuse,
    refuse_unknown,
    require_choice,
    require_number,
    require_whole,
    shown,
)
from thud.base.errors import InputError
from thud.level.assessment import get_criteria
from thud.level.levels import SOURCES
from thud.recordings import dates
from thud.recordings.choice import parse_numbers
from thud.recordings.force_units import Calibration, plain_number, read_chain

MAX_TEXT = 500


def to_number(low: float, high: float, value: object, key: str, unit: str = "") -> float:
    """Return a number between two limits, in a unit."""
    require_number(key, value)
    number = float(value)  # type: ignore[arg-type]
    if not low <= number <= high:
        refuse(f"{key} = {shown(value)} is not allowed", f"{low:g} to {high:g} {unit}".rstrip())
    return number


def to_line(value: object, key: str) -> str:
    """Return a line of text."""
    if not isinstance(value, str) or len(value) > MAX_TEXT or not value.isprintable():
        refuse(f"{key} = {shown(value)} is not allowed", f"a line of up to {MAX_TEXT} characters")
    return value


def to_whole(low: int, high: int, value: object, key: str) -> int:
    """Return a whole number between two limits."""
    require_whole(key, value, low, high)
    return int(value)  # type: ignore[call-overload, no-any-return]


def to_lines(value: object, key: str) -> tuple[str, ...]:
    """Return one or more lines of text."""
    return tuple(
        to_line(text, key) for text in (value if isinstance(value, list | tuple) else [value])
    )


def to_date(value: object, key: str) -> str:
    """Return a date as text in ISO 8601; empty if not stated."""
    if isinstance(value, date):
        return value.isoformat()[:10]
    text = to_line(value, key)
    read = dates.read_date(text) if text else None
    if text and read is None:
        refuse(f"{key} = {shown(value)} is not allowed", 'a date, such as "2024-05-03"')
    return read.date().isoformat() if read else ""


def to_day(value: object, key: str) -> str:
    """Return the date of the measurement as text, in any form."""
    return value.isoformat() if isinstance(value, date) else to_line(value, key)


def to_choice(choices: Mapping[str, object] | tuple[str, ...], value: object, key: str) -> str:
    """Return one of several words."""
    require_choice(key, value, choices)
    return str(value)


def to_channel(value: object, key: str) -> int | str:
    """Return the number or the name of a channel."""
    is_number = isinstance(value, int) and not isinstance(value, bool)
    return int(to_number(1, 1e6, value, key)) if is_number else to_line(value, key)


def to_calibration(value: object, key: str) -> Calibration | str | float:
    """Return a calibration: a number, a text or a `Calibration`."""
    if isinstance(value, Calibration):
        return value
    value = plain_number(value)
    if not isinstance(value, str):
        return to_number(-1e30, 1e30, value, key)
    try:
        read_chain(to_line(value, key))
    except InputError as error:
        message = f"{key}: {error}"
        raise InputError(message) from error
    return value


def to_calibrations(
    value: object, key: str
) -> Calibration | str | float | tuple[Calibration | str | float, ...]:
    """Return a calibration, or one for each channel."""
    if not isinstance(value, list | tuple):
        return to_calibration(value, key)
    return tuple(to_calibration(entry, f"{key}, entry {i}") for i, entry in enumerate(value, 1))


def to_table(value: object, key: str) -> Mapping[str, object]:
    """Return a table."""
    if not isinstance(value, Mapping):
        refuse(f"{key} = {shown(value)} is not allowed", "a table")
    return value


def _pair(value: object, key: str, ends: str, low: float, high: float) -> tuple[float, float]:
    if not isinstance(value, list | tuple) or len(value) != 2:  # noqa: PLR2004
        refuse(f"{key} = {shown(value)} is not allowed", f"[{ends}]")
    return to_number(low, high, value[0], key), to_number(low, high, value[1], key)


def to_linearity(value: object, key: str) -> tuple[tuple[float, float], ...]:
    """Return pairs of an applied and an indicated force, N."""
    pairs = value if isinstance(value, list | tuple) else []
    if len(pairs) < 2:  # noqa: PLR2004
        refuse(
            f"{key} = {shown(value)} is not allowed", "two or more pairs [applied, indicated], N"
        )
    return tuple(_pair(pair, key, "applied, indicated", 1e-3, 1e9) for pair in pairs)


def to_numbers(value: object, key: str) -> str:
    """Return numbers of drops."""
    text = to_line(value, key)
    parse_numbers(text, key)
    return text


def to_reasons(value: object, key: str) -> dict[str, str]:
    """Return reasons by numbers of drops."""
    table = to_table(value, key)
    reasons = {
        to_numbers(str(number), key): to_line(reason, key) for number, reason in table.items()
    }
    for number, reason in reasons.items():
        if not reason.strip():
            refuse(f"{key}: {number} has no reason", 'a reason, such as "touched"')
    return reasons


def to_limits(value: object, key: str) -> dict[str, tuple[float, float]]:
    """Return minimum and maximum by criterion."""
    table = to_table(value, key)
    refuse_unknown(key, table, [criterion.name for criterion in get_criteria(SOURCES[0])])
    limits = {}
    for name, span in table.items():
        low, high = _pair(span, f"{key}: {name}", "minimum, maximum", -1e6, 1e6)
        if not low < high:
            refuse(f"{key}: {name} = {shown(span)} is not allowed", "minimum < maximum")
        limits[name] = (low, high)
    return limits


def checked_values(table: Mapping[str, object], kind: type[Any], prefix: str) -> dict[str, Any]:
    """Return the values of a table; raise InputError for an unknown key or a wrong value."""
    checks = {key.name: key.metadata["check"] for key in fields(kind)}
    refuse_unknown(prefix.removesuffix(": "), table, checks)
    return {key: checks[key](value, f"{prefix}{key}") for key, value in table.items()}


@dataclass(frozen=True)
class Checked:
    """Base of the tables of a configuration, whose values are checked when they are stated."""

    def __post_init__(self) -> None:
        """Replace each stated value by that of its check, or raise InputError."""
        for name, value in checked_values(self.stated(), type(self), "").items():
            object.__setattr__(self, name, value)

    def stated(self) -> dict[str, object]:
        """Return the values that are not the defaults."""
        values = {key.name: getattr(self, key.name) for key in fields(self)}
        defaults = {key.name: key.default for key in fields(self)}
        return {k: v for k, v in values.items() if v is not None and v is not defaults[k]}


def to_instance(kind: type[Any], value: object, key: str) -> Any:  # noqa: ANN401 - of `kind`
    """Return an instance of a dataclass from a table."""
    if isinstance(value, kind):
        return value
    return kind(**checked_values(to_table(value, key), kind, f"{key}: "))


def require_keys(table: Mapping[str, object], key: str, *names: str) -> None:
    """Raise InputError if a table lacks a key."""
    for name in names:
        if name not in table:
            refuse(f"{key}: {name} is missing", " and ".join(names))
