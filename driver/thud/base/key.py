"""Declarations of keys of the input and of quantities of results, as the library has them."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar

from thud.base.checks import refuse_value
from thud.base.errors import InputError, WrongTypeError
from thud.base.immutable import plain

if TYPE_CHECKING:
    from collections.abc import Mapping

# Types of values by kinds of keys.
_TYPES: dict[str, set[type]] = {
    "real": {int, float}, "whole": {int}, "flag": {bool}, "list": {int, float}, "choice": {str},
    "text": {str}, "texts": {str},
}  # fmt: skip


@dataclass(frozen=True)
class Key:
    """Input key, declared by the library."""

    # What uses the key: a source model, a floor, "modes", "compression", "unknowns", "floor" or
    # "room"; empty if every impact uses it.
    owner: str
    # Namelist group, and name in it.
    group: str
    name: str
    # An entry of `_TYPES`; a "list" has numbers, "texts" are a list of them.
    kind: str = "real"
    # SI unit; empty for pure numbers.
    unit: str = ""
    meaning: str = ""
    # Allowed values of a choice.
    choices: tuple[str, ...] = ()
    # Limits of the allowed range; a text is the key of the group whose value is the limit.
    lower: float | str = -math.inf
    upper: float | str = math.inf
    # Whether only whole numbers are allowed, and whether the range excludes its limits.
    whole: bool = False
    lower_open: bool = False
    upper_open: bool = False
    # What the key needs for an effect: the name of another one that is neither 0 nor empty, or of a
    # choice and its values, that of the standard ball first; empty: nothing.
    needs: tuple[str, ...] = ()

    @property
    def allowed(self) -> str:
        """Allowed words, or the range with its unit."""
        if self.choices:
            return ", ".join(map(repr, self.choices))
        if self.lower == -math.inf:
            return {"flag": "True or False"}.get(self.kind, "plain text in one line")
        ends = (e if isinstance(e, str) else f"{e:.7g}" for e in (self.lower, self.upper))
        low, high = (end.replace("e+", "e") for end in ends)
        signs = ["<" if is_open else "<=" for is_open in (self.lower_open, self.upper_open)]
        whole = ", whole" if self.whole or self.kind == "whole" else ""
        return f"{low} {signs[0]} {self.name} {signs[1]} {high} {self.unit}".rstrip() + whole

    def has_effect(self, group: Group) -> bool:
        """Whether the key has an effect with the values of the other keys of its group."""
        if not self.needs:
            return True
        switch, *values = self.needs
        value = getattr(group, switch)
        return (value in values if values else bool(value)) and group.keys[switch].has_effect(group)

    def require(self, value: object) -> None:
        """Raise InputError if a value is not allowed, whatever the values of other keys are.

        It is a TypeError, too, if the value is of a wrong type.
        """
        # NaN, which nothing is beyond, where the limit is the value of another key or none.
        low, high = (
            math.nan if isinstance(limit, str) or math.isinf(limit) else limit
            for limit in (self.lower, self.upper)
        )
        is_list = isinstance(value, tuple) and value and self.kind in {"list", "texts"}
        entries: Any = value if is_list else (value,)
        for entry in entries:
            is_typed = type(entry) in _TYPES[self.kind]
            if isinstance(entry, str):
                fits = entry in self.choices if self.choices else entry.isprintable()
            else:
                below = is_typed and (entry < low or (self.lower_open and entry == low))
                above = is_typed and (entry > high or (self.upper_open and entry == high))
                fits = not below and not above and entry == entry  # noqa: PLR0124 - NaN differs
            if not (is_typed and fits):
                refuse_value(
                    f"&{self.group}: {self.name}", entry, self.allowed, low=low, high=high,
                    subject=f"{self.group}.{self.name}", low_open=self.lower_open,
                    high_open=self.upper_open, error=InputError if is_typed else WrongTypeError,
                )  # fmt: skip


@dataclass(frozen=True)
class Quantity:
    """Number that describes an impact."""

    # Name in files and programs, and in tables for readers.
    name: str
    title: str
    # Symbol in the mathematical notation of matplotlib; empty if there is none.
    symbol: str
    # SI unit, or dB; empty for pure numbers.
    unit: str
    # In tables for readers: unit, number of these units in one `unit`, and decimals.
    display_unit: str
    display_scale: float
    decimals: int
    meaning: str

    @property
    def label(self) -> str:
        """Title and display unit."""
        return f"{self.title}, {self.display_unit}".removesuffix(", ")

    def show(self, value: float) -> str:
        """Return the text of a value in SI units, converted to `display_unit`; empty for NaN."""
        if math.isnan(value):
            return ""
        shown = value * self.display_scale
        return f"{shown:.{self.decimals}f}" if 10**-self.decimals <= abs(shown) else f"{shown:z.3g}"


class Group:
    """Base of the dataclasses whose fields are keys; lists and arrays become tuples."""

    # Keys by the names of the fields.
    keys: ClassVar[Mapping[str, Key]] = {}

    def __post_init__(self) -> None:
        """Store plain values; a number or a text becomes a list of one where a list is needed.

        Raise InputError if a value is not allowed or a list that has a default is empty; ranges
        that depend on other keys are checked when the group is used.
        """
        for option in fields(self):  # type: ignore[arg-type]
            value, key = plain(getattr(self, option.name)), self.keys.get(option.name)
            if isinstance(option.default, tuple) and isinstance(value, int | float | str):
                value = (value,)
            object.__setattr__(self, option.name, value)
            # The default of an optional key may be outside its range; True equals 1.
            kinds = {type(option.default), *_TYPES[key.kind]} if key else ()
            if key and not (value == option.default and type(value) in kinds):
                key.require(value)
