"""Values with a measurement uncertainty, and the table of what contributes to it (JCGM 100)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from thud.base.immutable import Immutable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

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


@dataclass(frozen=True, eq=False)
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

    @classmethod
    def from_budget(
        cls,
        value: float,
        *contributions: Contribution,
        upper_bound: bool = False,
        not_stated: tuple[str, ...] = (),
    ) -> Self:
        """Combine contributions (JCGM 100, 5.1.2; degrees of freedom by G.4.1)."""
        terms = [term for term in contributions if term.counted and term.uncertainty]
        combined = math.sqrt(sum(term.uncertainty**2 for term in terms))
        inverse = sum((term.uncertainty / combined) ** 4 / term.freedom for term in terms)
        freedom = 1 / inverse if inverse else math.inf
        return cls(value, combined, "", freedom, contributions, upper_bound, not_stated)

    @classmethod
    def computed(cls, value: float, error: float) -> Self:
        """Return a computed value with its numerical error, which is its expanded uncertainty.

        The errors that models state hold for 95 % of the levels or more (docs/levels.md). NaN: an
        unknown error.
        """
        return cls.from_budget(value, Contribution(NUMERICAL_ERROR, error / NORMAL_FACTOR))

    @classmethod
    def unknown(cls) -> Self:
        """Return an unknown value."""
        return cls(math.nan, math.nan)

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


class Size(NamedTuple):
    """Size of what contributes to an uncertainty: see `Contribution`."""

    size: float = math.nan
    unit: str = ""
    divisor: float = 1.0


@dataclass(frozen=True, eq=False)
class Budget(Immutable):
    """Contributions to the uncertainty of the mean of a quantity over drops, in each of its bands.

    A quantity without bands has one.

    Attributes
    ----------
    names : tuple of str, shape (n_contribution,)
        Sources of uncertainty.
    uncertainty : ndarray, shape (n_contribution, n_band)
        Standard uncertainties, in the unit of the quantity.
    counted : ndarray of bool, shape (n_contribution, n_band)
        Whether the combined uncertainty includes it.
    freedom : ndarray, shape (n_contribution,)
        Degrees of freedom.
    sizes : dict of str to Size
        Sizes of those that have another unit or divisor, by name.
    """

    names: tuple[str, ...]
    uncertainty: NDArray[np.float64]
    counted: NDArray[np.bool_]
    freedom: NDArray[np.float64]
    sizes: dict[str, Size]

    @classmethod
    def of_mean(
        cls,
        noise: ArrayLike,
        shared: Mapping[str, ArrayLike],
        scatter: ArrayLike = 0.0,
        count: int = 1,
        sizes: Mapping[str, Size] | None = None,
    ) -> Budget:
        """Return the budget of a mean over a number of drops.

        `noise` and `scatter` are standard uncertainties of the mean, shape (n_band,), by the noise
        of each drop and by the scatter between several drops, which includes the noise. That with
        the larger expanded uncertainty counts: a scatter of few drops may be small by chance. Drops
        share the contributions `shared`, which their mean does not reduce.
        """
        rows = {NOISE: noise, **shared}
        if count > 1:
            rows = {REPEATABILITY: scatter, **rows}
        names = tuple(rows)
        uncertainty = np.array([np.atleast_1d(row) for row in rows.values()], dtype=np.float64)
        counted = np.ones(uncertainty.shape, dtype=bool)
        freedom = np.full(len(names), math.inf)
        known = dict(sizes or {})
        if count > 1:
            from scipy.special import stdtrit

            freedom[0] = count - 1
            factor = stdtrit(count - 1, (1 + CONFIDENCE) / 2)
            counted[1] = NORMAL_FACTOR * uncertainty[1] > factor * uncertainty[0]
            counted[0] = ~counted[1]
            known[REPEATABILITY] = Size(divisor=math.sqrt(count))
        return cls(names, uncertainty, counted, freedom, known)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return a contribution by its name, shape (n_band,)."""
        return np.asarray(self.uncertainty[self.names.index(name)])

    def estimates(
        self,
        values: ArrayLike,
        bounds: ArrayLike = False,  # noqa: FBT002 - an array
        not_stated: Sequence[str] = (),
    ) -> tuple[Estimate, ...]:
        """Return values with their budgets, shape (n_band,).

        `bounds` is whether a value is an upper bound; `not_stated` as in `Estimate`.
        """
        levels = np.atleast_1d(values)
        return tuple(
            Estimate.from_budget(
                float(value),
                *self._column(band),
                upper_bound=bool(is_bound),
                not_stated=tuple(not_stated),
            )
            for band, (value, is_bound) in enumerate(
                zip(levels, np.broadcast_to(bounds, levels.shape), strict=True)
            )
        )

    def _column(self, band: int) -> tuple[Contribution, ...]:
        """Return the contributions in a band; only noise and repeatability may be zero in all."""
        return tuple(
            Contribution(
                name,
                float(self.uncertainty[row, band]),
                float(self.freedom[row]),
                bool(self.counted[row, band]),
                *self.sizes.get(name, Size()),
            )
            for row, name in enumerate(self.names)
            if self.uncertainty[row].any() or name in {REPEATABILITY, NOISE}
        )
