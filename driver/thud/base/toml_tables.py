"""TOML files, and dataclasses of their tables, in which each key declares its check."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, ClassVar, Self

from thud.base.checks import refuse, refuse_unknown, refuse_value, require_choice, require_number
from thud.base.files import read_input

if TYPE_CHECKING:
    from pathlib import Path

MAX_TEXT = 500


def read_toml(path: Path) -> tuple[dict[str, Any], str]:
    """Return the tables and the text of a TOML file.

    Raise InputError with the path if the file cannot be read or is not TOML.
    """
    try:
        text = read_input(path).decode("utf-8-sig")
    except OSError as error:
        refuse(f"{path}: {error.strerror}", "a file that exists and can be read", error)
    except UnicodeDecodeError as error:
        refuse(f"{path}: byte {error.start + 1} is not UTF-8", "TOML, which is UTF-8", error)
    try:
        return tomllib.loads(text), text
    except (ValueError, RecursionError) as error:  # no TOML, or thousands of digits or brackets
        refuse(f"{path}: {error}", "TOML", error)


@dataclass(frozen=True)
class Number:
    """Check of a number between two limits in a unit; empty for a pure number."""

    low: float
    high: float
    unit: str = ""

    def __call__(self, value: object, name: str) -> float:
        """Return the number; raise InputError if it is none or out of range."""
        return require_number(name, value, self.low, self.high, self.unit)


@dataclass(frozen=True)
class Choice:
    """Check of one of several words."""

    words: Collection[str]

    def __call__(self, value: object, name: str) -> str:
        """Return the word; raise InputError if it is not known."""
        require_choice(name, value, self.words)
        return str(value)


def to_line(value: object, name: str) -> str:
    """Return a line of text; raise InputError if a value is none."""
    if not isinstance(value, str) or len(value) > MAX_TEXT or not value.isprintable():
        refuse_value(name, value, f"a line of up to {MAX_TEXT} characters")
    return value


def to_text(value: object, name: str) -> str:
    """Return a line of text that is not blank; raise InputError if a value is none."""
    if not to_line(value, name).strip():
        refuse_value(name, value, "a text in one line")
    return str(value)


def to_pair(value: object, name: str, ends: str, number: Number) -> tuple[float, float]:
    """Return two numbers, which have these names; raise InputError if a value is none."""
    if not isinstance(value, list | tuple) or len(value) != 2:  # noqa: PLR2004
        refuse_value(name, value, ends)
    return number(value[0], name), number(value[1], name)


def require_table(value: object, name: str) -> Mapping[str, Any]:
    """Return a table; raise InputError if a value is none."""
    if not isinstance(value, Mapping):
        refuse_value(name, value, "a table")
    return value


def key(check: Callable[[Any, str], object], meaning: str, default: object = None) -> Any:  # noqa: ANN401 - a field of any type
    """Declare a key: its check, which returns the value or raises InputError, and its meaning."""
    metadata = {"check": check, "meaning": meaning}
    if default == {}:
        return field(default_factory=dict, metadata=metadata)
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class TomlTable:
    """Base of tables of a TOML file, whose values are checked when they are stated.

    `title` is the name of the table in messages, with a colon.
    """

    title: ClassVar[str] = ""

    def __post_init__(self) -> None:
        """Replace each stated value by that of its check, or raise InputError."""
        for name in self.stated:
            check = self.__dataclass_fields__[name].metadata["check"]
            object.__setattr__(self, name, check(getattr(self, name), f"{self.title}{name}"))

    @classmethod
    def read(cls, value: object, name: str) -> Self:
        """Return a table from that of a file; raise InputError if a key is unknown."""
        if isinstance(value, cls):
            return value
        table = require_table(value, name)
        refuse_unknown(name, table, [entry.name for entry in fields(cls)])
        return cls(**table)

    @property
    def stated(self) -> list[str]:
        """Names of the keys whose values are not the defaults."""
        values = [(entry, getattr(self, entry.name)) for entry in fields(self)]
        return [
            entry.name
            for entry, value in values
            if value is not None and value is not entry.default
            if not (isinstance(value, dict) and not value)
        ]

    def require(self, *names: str) -> None:
        """Raise InputError if a key is not stated."""
        for name in names:
            if name not in self.stated:
                refuse("is missing", " and ".join(names), name=f"{self.title}{name}")
