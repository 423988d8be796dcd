"""Values with a measurement uncertainty, and its budget of contributions (JCGM 100)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import TYPE_CHECKING, Self

import numpy as np

from thud.base.immutable import Immutable

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

CONFIDENCE = 0.95
# Name of the contribution of a computed value; see `Estimate.computed`.
NUMERICAL_ERROR = "numerical error"
# Standard deviations of the normal distribution within which 95 % lie.
NORMAL_FACTOR = NormalDist().inv_cdf((1 + CONFIDENCE) / 2)
# Contributions of several drops to their mean: the scatter includes the noise of each.
REPEATABILITY, NOISE = "repeatability", "noise"
# Ratio of the half width of a rectangular distribution to its standard uncertainty.
RECTANGULAR = math.sqrt(3)


@dataclass(frozen=True, eq=False)
class Contribution(Immutable):
    """Contribution to the uncertainty of a value, a line of an uncertainty budget.

    Attributes
    ----------
    name : str
        Source of uncertainty.
    uncertainty : float
        Standard uncertainty of the value due to this source, in the unit of the value; NaN if
        unknown.
    freedom : float
        Degrees of freedom; infinite if not estimated from scatter (type B).
    counted : bool
        Whether the combined uncertainty includes it; false if the repeatability already does.
    size : float
        Stated or determined size of the source, such as half the width of an interval; NaN if it is
        `uncertainty` times `divisor`.
    unit : str
        Unit of `size`.
    divisor : float
        Ratio of `size` to its standard uncertainty.
    """

    name: str
    uncertainty: float
    freedom: float = math.inf
    counted: bool = True
    size: float = math.nan
    unit: str = ""
    divisor: float = 1.0

    @property
    def kind(self) -> str:
        """``"A"`` if evaluated by statistics of observations, else ``"B"`` (JCGM 100, 0.7)."""
        return "A" if math.isfinite(self.freedom) or self.name == NOISE else "B"

    @property
    def sensitivity(self) -> float:
        """Change of the value per change of `size`; 1 if that is in the unit of the value."""
        if math.isnan(self.size):
            return 1.0
        return self.uncertainty * self.divisor / self.size if self.size else math.nan


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(Immutable):
    """Value and its uncertainty; that of a computed value is its numerical error.

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
        Whether `value` is only an upper bound of the true value, such as of a level masked by the
        background; the uncertainty is that of the bound.
    not_stated : tuple of str
        Contributions whose size is not stated: the uncertainty lacks them.
    """

    value: float
    uncertainty: float = 0.0
    unit: str = ""
    freedom: float = math.inf
    contributions: tuple[Contribution, ...] = ()
    upper_bound: bool = False
    not_stated: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return value and standard uncertainty."""
        return f"{self.value:.6g} ± {self.uncertainty:.2g} {self.unit}".rstrip()

    @classmethod
    def from_budget(cls, value: float, *contributions: Contribution) -> Self:
        """Combine contributions (JCGM 100, 5.1.2; degrees of freedom by G.4.1)."""
        terms = [term for term in contributions if term.counted and term.uncertainty]
        combined = math.sqrt(sum(term.uncertainty**2 for term in terms))
        inverse = sum((term.uncertainty / combined) ** 4 / term.freedom for term in terms)
        freedom = 1 / inverse if inverse else math.inf
        return cls(value, combined, "", freedom, contributions)

    @classmethod
    def computed(cls, value: float, error: float) -> Self:
        """Return a computed value with its numerical error, which is its expanded uncertainty.

        The errors that models state hold for 95 % of the levels or more (docs/levels.md). NaN: an
        unknown error.
        """
        return cls.from_budget(value, Contribution(NUMERICAL_ERROR, error / NORMAL_FACTOR))

    @classmethod
    def of_drops(
        cls,
        value: float,
        samples: Sequence[float] | NDArray[np.float64],
        noises: Sequence[float] | NDArray[np.float64],
        shared: Iterable[Contribution] = (),
    ) -> Self:
        """Return the mean over drops with its budget.

        `samples` are the values of the drops, `noises` their standard uncertainties by noise, shape
        (n_drop,), both in the unit of the mean. That of noise and scatter with the larger expanded
        uncertainty counts: a scatter, which includes the noise, may be small by chance. Drops share
        the contributions `shared`, which their mean does not reduce.
        """
        count = len(noises)
        noise = Contribution(NOISE, math.hypot(*noises) / count)
        random = [noise]
        if count > 1:
            scatter = float(np.std(samples, ddof=1)) / math.sqrt(count)
            repeated = Contribution(REPEATABILITY, scatter, count - 1, divisor=math.sqrt(count))
            is_noise = NORMAL_FACTOR * noise.uncertainty > cls.from_budget(value, repeated).expanded
            random = [replace(repeated, counted=not is_noise), replace(noise, counted=is_noise)]
        return cls.from_budget(value, *random, *shared)

    def __sub__(self, other: Estimate) -> Estimate:
        """Return the difference of independent values."""
        uncertainty = math.hypot(self.uncertainty, other.uncertainty)
        return Estimate(self.value - other.value, uncertainty)

    def widened(self, uncertainty: float) -> Self:
        """Return the estimate with a further standard uncertainty of infinite freedom."""
        combined = math.hypot(self.uncertainty, uncertainty)
        ratio = combined / self.uncertainty if self.uncertainty else math.inf
        return replace(self, uncertainty=combined, freedom=self.freedom * ratio**4)

    @property
    def coverage_factor(self) -> float:
        """Quantile of Student's t distribution for a two-sided coverage of 95 %."""
        if math.isinf(self.freedom):
            return NORMAL_FACTOR
        # SciPy is slow to import.
        from scipy.special import stdtrit

        return float(stdtrit(self.freedom, (1 + CONFIDENCE) / 2)) if self.freedom > 0 else math.nan

    @property
    def expanded(self) -> float:
        """Expanded uncertainty: half the width of the interval with 95 % coverage."""
        return self.coverage_factor * self.uncertainty if self.uncertainty else 0.0


# An unknown value.
UNKNOWN = Estimate(math.nan, math.nan)
