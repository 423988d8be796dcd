"""Estimated parameters and their uncertainty, for fits to impacts and to compressions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.base.units import display_unit
from thud.studies.fitting.inference import coverage_factor
from thud.studies.study_result import StudyResult

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.base.note import Note

    Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Estimates(StudyResult):
    """The best parameters of a model for a target, and their uncertainty; SI units.

    Attributes
    ----------
    names, units : tuple of str
        The parameters and their units.
    estimate : ndarray, shape (n,)
        Their values.
    covariance : ndarray, shape (n, n)
        Their covariance; infinite variances where they are not identifiable.
    limits : ndarray, shape (n, 2)
        Low and high limit of the search for each; infinite where there is none.
    confidence : float
        Confidence of the intervals in tables and files.
    noise : float
        Standard deviation of a residual, N or dB.
    residuals : ndarray, shape (n_residual,)
        Model minus measured values.
    warnings : tuple of Note
        Why estimates or intervals may be wrong.
    assumptions : tuple of str
        Which unknowns the intervals include, and the effect of errors that no data can show.
    widened : float
        Factor of the standard errors due to noise and unknowns, because residuals, or unknowns of a
        press, are larger than expected; 1 without a warning.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    estimate: Array
    covariance: Array
    limits: Array
    confidence: float
    noise: float
    residuals: Array
    warnings: tuple[Note, ...]
    assumptions: tuple[str, ...]
    widened: float

    @property
    def values(self) -> dict[str, float]:
        """Values of the parameters by name."""
        return dict(zip(self.names, map(float, self.estimate), strict=True))

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard errors of the parameters by name."""
        errors = np.sqrt(np.diag(self.covariance))
        return dict(zip(self.names, map(float, errors), strict=True))

    @property
    def correlation(self) -> Array:
        """Correlation of the parameters, shape (n, n); NaN where a variance is infinite."""
        errors = np.sqrt(np.diag(self.covariance))
        with np.errstate(invalid="ignore"):
            result: Array = self.covariance / np.outer(errors, errors)
        return result

    @property
    def degrees_of_freedom(self) -> int:
        """Number of residuals − number of parameters."""
        return len(self.residuals) - len(self.names)

    @property
    def interval_freedom(self) -> int | None:
        """Degrees of freedom of Student's t in the intervals; None: they are normal."""
        return self.degrees_of_freedom

    def intervals(self, confidence: float | None = None) -> dict[str, tuple[float, float]]:
        """Return confidence intervals by name, see `interval_freedom`.

        They are cut at the limits of the search. `confidence` is by default that of the fit.
        """
        confidence = self.confidence if confidence is None else confidence
        factor = coverage_factor(confidence, self.interval_freedom)
        half = factor * np.sqrt(np.diag(self.covariance))
        low = np.maximum(self.estimate - half, self.limits[:, 0]).tolist()
        high = np.minimum(self.estimate + half, self.limits[:, 1]).tolist()
        return dict(zip(self.names, zip(low, high, strict=True), strict=True))

    @property
    def display_units(self) -> dict[str, tuple[str, float]]:
        """Name of the unit in tables and figures, and how many SI units it is, by parameter."""
        pairs = zip(self.values.items(), self.units, strict=True)
        return {name: display_unit(unit, value) for (name, value), unit in pairs}

    @property
    def trust(self) -> tuple[str, ...]:
        """Lines of text on what the intervals include."""
        if self.widened == 1:
            return self.assumptions
        text = f"intervals widened {self.widened:.3g} times, see the warnings"
        return (*self.assumptions, text)

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        interval = f"{self.confidence:.0%} interval"
        rows: list[tuple[str, ...]] = [("parameter", "value", "standard error", interval, "unit")]
        intervals = self.intervals()
        for name, (unit, factor) in self.display_units.items():
            value, error = self.values[name] / factor, self.standard_errors[name] / factor
            low, high = (end / factor for end in intervals[name])
            digits = _digits(value, error)
            interval = f"{low:.{digits}g} to {high:.{digits}g}" if np.isfinite(error) else "unknown"
            rows.append((name, f"{value:.{digits}g}", f"{error:.2g}", interval, unit))
        return rows

    def __str__(self) -> str:
        """Return the table, and the warnings."""
        return "\n".join([self.table(), *(f"Warning: {note}." for note in self.warnings)])


def _digits(value: float, error: float) -> int:
    """Return the number of digits of a value that resolves its error to two digits."""
    if not (np.isfinite(error) and error > 0 and value):
        return 6
    return int(np.clip(np.ceil(np.log10(abs(value) / error)) + 2, 3, 12))
