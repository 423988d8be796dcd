"""Targets of fits as functions: weighted residuals of a computed result, and tests of them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np
from scipy import stats

from thud.base.checks import refuse_unknown, refuse_value, require_number
from thud.base.immutable import Immutable
from thud.base.note import Note

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from thud.case.case import Case
    from thud.studies.arrays import Array


# Probability of a false warning by one test of residuals.
UNLIKELY = 1e-3
# Fewer residuals have no test of their color, and parts of them no test of their size.
MIN_TESTED = 20
MIN_FREEDOM = 5
# Number of bands of frequency in which the size of residuals is determined.
N_BAND = 4
# What a model computes.
Result = TypeVar("Result")
# Relative step of the central differences. Forces are smooth to 1e-13, but have kinks where an
# instant enters or leaves the contact: steps of 1e-3 would cross these, steps of 1e-5 rarely do.
# Derivatives are accurate to 1e-7 (3e-3 for intermittent contact with a rising loss factor).
STEP = 2e-5


class Own(NamedTuple):
    """A parameter of one target alone, such as the time of first touch; SI units.

    The search begins at `start` and divides it by `scale`. With a finite `deviation` it is known to
    be normal about `start`.
    """

    unit: str
    scale: float
    start: float = 0.0
    deviation: float = np.inf
    low: float = -np.inf
    high: float = np.inf


@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison(Immutable, ABC, Generic[Result]):
    """How far what a model computes is from a target, in standard deviations.

    Attributes
    ----------
    unit : str
        Unit of an estimated standard deviation.
    has_own_noise : bool
        The noise follows from the residuals of a search: see `reweighted`.
    has_alternatives : bool
        The target may show alternatives to the case.
    weighted_target : ndarray, shape (n,)
        The target over its standard deviation.
    known_noise : bool
        The standard deviations are known; else their common factor is estimated.
    noise_freedom : int or None
        Degrees of freedom of the data that determine the noise; None: the noise is stated.
    unit_deviation : float
        Unit of the residuals: noise of forces, N; 1 for levels.
    absorbed : int
        Number of nuisance parameters in the covariance of the noise.
    own : dict of str to Own
        Parameters of this target alone.
    step : float
        Relative step of the differences that are the derivatives of the residuals.
    """

    unit: ClassVar[str]
    has_own_noise: ClassVar[bool] = False
    has_alternatives: ClassVar[bool] = False
    weighted_target: Array
    known_noise: bool
    noise_freedom: int | None = None
    unit_deviation: float = 1.0
    absorbed: int = 0
    own: dict[str, Own] = field(default_factory=dict)
    step: float = STEP

    @property
    def size(self) -> int:
        """Number of residuals: data, and own parameters that are known to an extent."""
        known = sum(np.isfinite(entry.deviation) for entry in self.own.values())
        return len(self.weighted_target) + int(known)

    @abstractmethod
    def solve(self, case: Case) -> Result:
        """Return what the model of a case computes."""

    def start(self, result: Result) -> Array:  # noqa: ARG002
        """Return the values of the own parameters from which the search begins."""
        return np.array([entry.start for entry in self.own.values()])

    @abstractmethod
    def misfit(self, result: Result, own: Array) -> Array:
        """Return model minus target over standard deviation, shape (n,)."""

    def residual(self, result: Result, own: Array) -> Array:
        """Return `misfit`, and own parameters minus what is known of them, shape (size,)."""
        known = [
            (value - entry.start) / entry.deviation
            for value, entry in zip(own, self.own.values(), strict=True)
            if np.isfinite(entry.deviation)
        ]
        return np.concatenate([self.misfit(result, own), known])

    def reweighted(
        self,
        result: Result,  # noqa: ARG002
        own: Array,  # noqa: ARG002
        jacobian: Array,  # noqa: ARG002
    ) -> Comparison[Result]:
        """Return the comparison with the noise that the best residuals show, or itself."""
        return self

    def is_exact(self, result: Result, own: Array) -> bool:  # noqa: ARG002
        """Return whether residuals are too small to be tested: numerical errors."""
        return False

    def warnings(
        self,
        result: Result,  # noqa: ARG002
        own: Array,  # noqa: ARG002
        residual: Array,
        freedom: float,
        unit: float,  # noqa: ARG002
    ) -> list[Note]:
        """Return warnings where residuals of unit variance are not noise.

        `freedom` is the number of residuals less that of parameters, `unit` the standard deviation
        of a residual.
        """
        if not self.known_noise or freedom <= 0:
            return []
        return size_warning(residual, freedom, self.noise_freedom)

    def excess(self, result: Result, own: Array, residual: Array) -> float:  # noqa: ARG002
        """Return by how much residuals exceed noise of unit variance; at least 1."""
        return max(1.0, float(np.sqrt(np.mean(residual**2))))

    @abstractmethod
    def columns(self, result: Result, own: Array) -> Mapping[str, Sequence[object] | Array]:
        """Return target and model side by side, SI units, dB: columns by their names."""


def numbers(name: str, values: object, count: int) -> Array:
    """Return a list of finite numbers of a given length."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape != (count,) or not np.isfinite(array).all():
        refuse_value(name, values, f"{count} real numbers")
    return array


def require_positive(name: str, value: Any, unit: str) -> None:  # noqa: ANN401 - checked here
    """Raise InputError if a value is not a number above 0."""
    require_number(name, value)
    if not value > 0:
        refuse_value(name, value, f"numbers above 0, {unit}")


def require_unknowns(unknowns: object, known: Collection[str]) -> None:
    """Raise InputError where unknowns are not a list of known names."""
    if not isinstance(unknowns, list | tuple):
        refuse_value("unknowns", unknowns, f"a list of {', '.join(known)}")
    refuse_unknown("unknowns", unknowns, known)


def misfit_ratio(residual: Array) -> float:
    """Return the root mean square of residuals of unit variance; at least 1.

    Of four bands of frequency that with the largest residuals counts: a model is wrong in one.
    """
    power = np.abs(np.fft.rfft(residual)[1:]) ** 2 / len(residual)
    bands = [band.mean() for band in np.array_split(power, N_BAND) if len(band)]
    return float(np.sqrt(max(1.0, np.mean(residual**2), *bands)))


def size_warning(residual: Array, freedom: float, noise_freedom: int | None) -> list[Note]:
    """Return a warning if residuals of known variance are too large (chi-square, or Fisher's F).

    `noise_freedom` are the degrees of freedom of the data that determine the noise; None: it is
    stated.
    """
    square = float(residual @ residual)
    tail = (
        stats.chi2.sf(square, freedom)
        if noise_freedom is None
        else stats.f.sf(square / freedom, freedom, noise_freedom)
    )
    return [] if tail > UNLIKELY else [Note("unexplained", value=math.sqrt(square / freedom))]


def color_warning(residual: Array) -> list[Note]:
    """Return a warning if residuals at uniform positions are not independent noise.

    The cumulative periodogram (Bartlett) is uniform for white noise.
    """
    if len(residual) < MIN_TESTED:
        return []
    power = np.abs(np.fft.rfft(residual)[1:]) ** 2
    share = np.cumsum(power) / power.sum()
    result = stats.kstest(share[:-1], "uniform")
    if result.pvalue > UNLIKELY:
        return []
    fraction = float(np.searchsorted(share, 0.5) / len(power))
    side = "low" if fraction < 0.5 else "high"  # noqa: PLR2004 - halves
    value = min(fraction, 1 - fraction)
    return [Note("residuals_colored", value=value, others={"side": side})]


def contact_warning(
    residual: Array, inside: NDArray[np.bool_], count: int, unit: float
) -> list[Note]:
    """Return a warning if residuals during contact exceed those before and after it (F).

    `count` parameters are fitted; `unit` is the unit of the residuals, N.
    """
    inside_count, outside_count = int(inside.sum()) - count, int((~inside).sum())
    if min(inside_count, outside_count) < MIN_FREEDOM:
        return []
    square = float((residual[inside] ** 2).sum()) / inside_count
    outside = float((residual[~inside] ** 2).sum()) / outside_count
    if square < stats.f.isf(UNLIKELY, inside_count, outside_count) * outside:
        return []
    value, high = (unit * math.sqrt(part) for part in (square, outside))
    return [Note("residuals_in_contact", value=value, high=high, unit="N")]


def coverage_factor(confidence: float, freedom: int | None) -> float:
    """Return the half width of a two-sided interval in standard errors.

    It is Student's t, or normal where the noise is known (`freedom` is None).
    """
    quantile = (1 + confidence) / 2
    return float(stats.norm.ppf(quantile) if freedom is None else stats.t.ppf(quantile, freedom))


def require_confidence(confidence: object) -> None:
    """Raise InputError where a confidence is not between 0 and 1."""
    if not (isinstance(confidence, float | np.floating) and 0 < confidence < 1):
        refuse_value("confidence", confidence, "0 < confidence < 1")
