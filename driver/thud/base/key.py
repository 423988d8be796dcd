"""Declarations of keys of the input and of quantities of results, as the library has them."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Literal

from thud.base.checks import refuse
from thud.base.immutable import Plain, plain

Kind = Literal["real", "whole", "choice", "flag", "list", "text", "texts"]


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
    needs: tuple[str, ...] = ()


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


class Group(Plain):
    """Base of the dataclasses whose fields are keys."""

    def __post_init__(self) -> None:
        """Store plain values; a number or a text becomes a list of one where a list is needed.

        Raise InputError if a list that has a default is empty.
        """
        for option in fields(self):  # type: ignore[arg-type]
            value = plain(getattr(self, option.name))
            if isinstance(option.default, tuple) and isinstance(value, int | float | str):
                value = (value,)
            elif option.default and value == ():
                refuse(f"{type(self).__name__}: {option.name} is empty", "one number or more")
            object.__setattr__(self, option.name, value)
