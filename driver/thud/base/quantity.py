"""Declaration of a result, as the table of quantities of the library has it."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """Number that describes an impact.

    Attributes
    ----------
    name, title : str
        Name in files and programs, and in tables for readers.
    symbol : str
        Symbol in formulas, in the mathematical notation of matplotlib; empty where there is none.
    unit : str
        SI unit, or dB; empty for pure numbers.
    display_unit : str
        Unit in tables for readers.
    display_scale : float
        How many of them are one `unit`.
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
        """Return a value, in SI units, as tables show it in `display_unit`; empty if it is NaN."""
        if math.isnan(value):
            return ""
        shown = value * self.display_scale
        return f"{shown:.{self.decimals}f}" if 10**-self.decimals <= abs(shown) else f"{shown:.3g}"
