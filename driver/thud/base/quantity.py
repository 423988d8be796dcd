"""Declaration of a quantity, an entry of the library's table of results."""

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
