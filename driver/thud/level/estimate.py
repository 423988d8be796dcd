"""Values with a measurement uncertainty (GUM, JCGM 100)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from thud.base.immutable import Immutable

CONFIDENCE = 0.95


@dataclass(frozen=True, eq=False)
class Contribution(Immutable):
    """One line of an uncertainty budget.

    Attributes
    ----------
    name : str
        Source of uncertainty.
    uncertainty : float
        Standard uncertainty of the value due to it, in the unit of the value; NaN if unknown.
    freedom : float
        Degrees of freedom; infinite if it is not estimated from a scatter (type B).
    counted : bool
        Whether it adds to the combined uncertainty. False if the repeatability includes it.
    """

    name: str
    uncertainty: float
    freedom: float = math.inf
    counted: bool = True


@dataclass(frozen=True, eq=False)
class Estimate(Immutable):
    """A value and its uncertainty; computed values have none.

    Attributes
    ----------
    value : float
        Best value; NaN if unknown.
    uncertainty : float
        Standard uncertainty, in the unit of the value.
    unit : str
        Unit; empty for pure numbers.
    freedom : float
        Effective degrees of freedom of the uncertainty.
    contributions : tuple of Contribution
        Independent contributions to the uncertainty; empty if none is stated.
    upper_bound : bool
        The true value lies at or below `value`, within its uncertainty, by an unknown amount (a
        level in the background).
    """

    value: float
    uncertainty: float = 0.0
    unit: str = ""
    freedom: float = math.inf
    contributions: tuple[Contribution, ...] = ()
    upper_bound: bool = False

    @classmethod
    def from_budget(
        cls, value: float, *contributions: Contribution, upper_bound: bool = False
    ) -> Self:
        """Combine the contributions (JCGM 100, 5.1.2 and, by Welch-Satterthwaite, G.4.1)."""
        terms = [term for term in contributions if term.counted and term.uncertainty]
        combined = math.sqrt(sum(term.uncertainty**2 for term in terms))
        inverse = sum((term.uncertainty / combined) ** 4 / term.freedom for term in terms)
        freedom = 1 / inverse if inverse else math.inf
        return cls(value, combined, "", freedom, contributions, upper_bound)

    @classmethod
    def unknown(cls) -> Self:
        """Return an unknown value."""
        return cls(math.nan, math.nan)

    @property
    def coverage_factor(self) -> float:
        """Quantile of Student's t for 95 %."""
        from scipy.special import stdtrit

        return float(stdtrit(self.freedom, (1 + CONFIDENCE) / 2)) if self.freedom > 0 else math.nan

    @property
    def expanded(self) -> float:
        """Expanded uncertainty: value ± this holds the true value with 95 %."""
        return self.coverage_factor * self.uncertainty if self.uncertainty else 0.0
