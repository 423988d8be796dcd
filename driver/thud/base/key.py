"""Declarations of keys of the input and of quantities of results, as the library has them."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from thud.base.checks import refuse_value, shown
from thud.base.immutable import plain

if TYPE_CHECKING:
    from collections.abc import Mapping

Kind = Literal["real", "whole", "choice", "flag", "list", "text", "texts"]
_TYPES: dict[Kind, set[type]] = {
    "real": {int, float}, "whole": {int}, "flag": {bool}, "list": {int, float}, "choice": {str},
    "text": {str}, "texts": {str},
}  # fmt: skip


@dataclass(frozen=True)
class Key:
    """Input key, declared by the library.

    Attributes
    ----------
    owner : str
        What uses the key: a source model, a floor, ``"modes"``, ``"compression"``, ``"unknowns"``,
        ``"floor"`` or ``"room"``; empty if every impact uses it.
    group, name : str
        Namelist group and name.
    kind : str
        ``"real"``, ``"whole"``, ``"choice"``, ``"flag"``, ``"list"`` (of numbers), ``"text"`` or
        ``"texts"`` (a list).
    unit : str
        SI unit; empty for pure numbers.
    meaning : str
        Description.
    choices : tuple of str
        Allowed values of a choice.
    lower, upper : float or str
        Limits of the allowed range; a text is the key of the group whose value is the limit.
    whole : bool
        Whether only whole numbers are allowed.
    lower_open, upper_open : bool
        Whether the range excludes its lower and its upper limit.
    needs : tuple of str
        Name of a choice and its values with which the key has an effect, that of the standard ball
        first; empty: with all.
    """

    owner: str
    group: str
    name: str
    kind: Kind = "real"
    unit: str = ""
    meaning: str = ""
    choices: tuple[str, ...] = ()
    lower: float | str = -math.inf
    upper: float | str = math.inf
    whole: bool = False
    lower_open: bool = False
    upper_open: bool = False
    needs: tuple[str, ...] = ()

    @property
    def allowed(self) -> str:
        """Allowed words, or the range with its unit."""
        if self.choices:
            return ", ".join(map(repr, self.choices))
        if self.lower == -math.inf:
            return {"flag": "True or False"}.get(self.kind, "plain text in one line")
        low, high = (e if isinstance(e, str) else f"{e:g}" for e in (self.lower, self.upper))
        signs = ["<" if is_open else "<=" for is_open in (self.lower_open, self.upper_open)]
        whole = ", whole" if self.whole or self.kind == "whole" else ""
        return f"{low} {signs[0]} {self.name} {signs[1]} {high} {self.unit}".rstrip() + whole

    def is_typed(self, value: object) -> bool:
        """Whether a value is of the type of the key, a tuple where the key takes several."""
        return all(type(entry) in _TYPES[self.kind] for entry in self._entries(value))

    def require(self, value: object) -> None:
        """Raise InputError if a value of Python is not allowed, whatever other keys are."""
        low = -math.inf if isinstance(self.lower, str) else self.lower
        high = math.inf if isinstance(self.upper, str) else self.upper
        for entry in self._entries(value):
            if isinstance(entry, str):
                fits = entry in self.choices if self.choices else entry.isprintable()
            elif fits := self.is_typed(entry):
                above = low < entry or (entry == low and not self.lower_open)
                fits = above and (entry < high or (entry == high and not self.upper_open))
            if not (fits and self.is_typed(entry)):
                ends = {
                    name: end if math.isfinite(end) else math.nan
                    for name, end in (("low", low), ("high", high))
                }
                refuse_value(
                    f"&{self.group}: {self.name}", entry, self.allowed, **ends,
                    subject=f"{self.group}.{self.name}", low_open=self.lower_open,
                    high_open=self.upper_open,
                )  # fmt: skip

    def _entries(self, value: Any) -> tuple[Any, ...]:  # noqa: ANN401 - of a user
        """Return the entries of a list, or the only value."""
        is_list = isinstance(value, tuple) and self.kind in {"list", "texts"}
        return value if is_list else (value,)


@dataclass(frozen=True)
class Quantity:
    """Number that describes an impact.

    Attributes
    ----------
    name, title : str
        Name in files and programs, and in tables for readers.
    symbol : str
        Symbol in the mathematical notation of matplotlib; empty if there is none.
    unit : str
        SI unit, or dB; empty for pure numbers.
    display_unit : str
        Unit in tables for readers.
    display_scale : float
        Number of display units in one `unit`.
    decimals : int
        Decimals in tables for readers.
    meaning : str
        Description.
    """

    name: str
    title: str
    symbol: str
    unit: str
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

        Raise TypeError if a value is not of the type of its key, and InputError if it is not
        allowed or a list that has a default is empty; ranges that depend on other keys are checked
        when the group is used.
        """
        for option in fields(self):  # type: ignore[arg-type]
            value, key = plain(getattr(self, option.name)), self.keys.get(option.name)
            if isinstance(option.default, tuple) and isinstance(value, int | float | str):
                value = (value,)
            object.__setattr__(self, option.name, value)
            if key is None or (value is None and option.default is None):
                continue
            if not key.is_typed(value):
                name = f"&{key.group}: {key.name}"
                message = f"{name} = {shown(value)} is not allowed; allowed: {key.allowed}"
                raise TypeError(message)
            if option.default and value == ():
                name, subject = f"&{key.group}: {key.name}", f"{key.group}.{key.name}"
                refuse_value(name, [], f"one or more numbers, {key.allowed}", subject=subject)
            key.require(value)
