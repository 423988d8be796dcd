"""A value with its standard uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Estimate:
    """A value and its standard uncertainty, in the same unit; NaN where not known."""

    value: float
    uncertainty: float

    def __float__(self) -> float:
        """Return the value."""
        return float(self.value)

    @classmethod
    def unknown(cls) -> Estimate:
        """Return the estimate of what is not known."""
        return cls(math.nan, math.nan)
