"""TOML files, and dataclasses of their tables, in which each key declares its check."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, fields
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Self

from thud.base.checks import refuse, refuse_unknown, refuse_value, require_choice, require_number
from thud.base.files import regular_file

if TYPE_CHECKING:
    from pathlib import Path

# Returns the value of a key, by its name, or raises InputError.
Check = Callable[[str, Any], Any]
MAX_TEXT = 500


def read_toml(path: Path) -> tuple[dict[str, Any], str]:
    """Return the tables and the text of a TOML file.

    Raise InputError with the path if the file cannot be read or is not TOML.
    """
    try:
        text = regular_file(path).read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        refuse(f"{path}: byte {error.start + 1} is not UTF-8", "TOML, which is UTF-8", error)
    try:
        return tomllib.loads(text), text
    except (ValueError, RecursionError) as error:  # no TOML, or thousands of digits or brackets
        refuse(f"{path}: {error}", "TOML", error)


def between(low: float, high: float, unit: str = "") -> Check:
    """Return the check of a number between two limits in a unit; empty for a pure number."""
    return partial(require_number, low=low, high=high, unit=unit)


def one_of(words: Collection[str]) -> Check:
    """Return the check of one of several words."""
    return partial(require_choice, allowed=words)


def to_line(name: str, value: object) -> str:
    """Return a line of text; raise InputError if a value is none."""
    if not isinstance(value, str) or len(value) > MAX_TEXT or not value.isprintable():
        refuse_value(name, value, f"a line of up to {MAX_TEXT} characters")
    return value


def to_text(name: str, value: object) -> str:
    """Return a line of text that is not blank; raise InputError if a value is none."""
    return to_line(name, value) if str(value).strip() else refuse_value(name, value, "a text")


def require_table(name: str, value: object) -> Mapping[str, Any]:
    """Return a table; raise InputError if a value is none."""
    return value if isinstance(value, Mapping) else refuse_value(name, value, "a table")


def key(check: Check, title: str, default: object = None, hint: str = "") -> Any:  # noqa: ANN401 - a field of any type
    """Declare a key: its check, which returns the value or raises InputError, title and hint."""
    metadata = {"check": check, "title": title, "hint": hint}
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
            object.__setattr__(self, name, check(f"{self.title}{name}", getattr(self, name)))

    @classmethod
    def read(cls, name: str, value: object) -> Self:
        """Return a table from that of a file; raise InputError if a key is unknown."""
        if isinstance(value, cls):
            return value
        table = require_table(name, value)
        refuse_unknown(name, table, [entry.name for entry in fields(cls)])
        return cls(**table)

    @property
    def stated(self) -> list[str]:
        """Names of the keys whose values are not the defaults."""
        # The default of tables without another one is an empty table.
        return [
            entry.name
            for entry in fields(self)
            if (value := getattr(self, entry.name)) is not None and value is not entry.default
            if entry.default_factory is not dict or not isinstance(value, dict) or value
        ]

    def require(self, *names: str) -> None:
        """Raise InputError if a key is not stated."""
        for name in names:
            if name not in self.stated:
                refuse("is missing", " and ".join(names), name=f"{self.title}{name}")
