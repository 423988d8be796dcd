"""The result of a fit: estimated parameters, their uncertainty, and what the model computes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from thud.base.display import Displayed, warn_if_not_drawn
from thud.base.extras import data_frame, require_extra
from thud.base.files import Results
from thud.base.immutable import Immutable
from thud.base.units import display_unit
from thud.studies.fitting.comparison import coverage_factor, require_confidence
from thud.studies.fitting.fit_report import fit_files, fit_table, parameter_rows

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence

    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

    from thud.base.note import Note
    from thud.case.case import Case
    from thud.impact.compression import CompressionCurve
    from thud.impact.impact import Impact
    from thud.studies.arrays import Array
    from thud.studies.fitting.comparison import Comparison


@dataclass(frozen=True, eq=False)
class FittedTarget(Immutable):
    """One target of a fit, with its case, result and own parameters.

    Attributes
    ----------
    case : Case
        The case with the fitted values, and what is fixed for this target.
    result : Impact or CompressionCurve
        What its model computes: an impact, or the curve of a press.
    comparison : Comparison
        The comparison of target and result.
    own : ndarray
        The parameters of this target alone, if fitted, such as the time of first touch, s.
    """

    case: Case
    result: Impact | CompressionCurve
    comparison: Comparison[Any]
    own: Array

    def columns(self) -> Mapping[str, Sequence[object] | Array]:
        """Return target and model side by side, SI units, dB: columns by their names."""
        return self.comparison.columns(self.result, self.own)


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Displayed):
    """The best parameters of a model for one or more targets, and their uncertainty; SI units.

    Attributes
    ----------
    names, units : tuple of str
        The parameters and their units; then those of the targets alone, such as ``"time_shift"``,
        the time of first touch, and ``"gain"``, of several targets with their number, as
        ``"gain(2)"``.
    estimate : ndarray, shape (n,)
        Their values.
    covariance : ndarray, shape (n, n)
        Their covariance; infinite variances where they are not identifiable.
    limits : ndarray, shape (n, 2)
        Low and high limit of the search for each; infinite where there is none.
    confidence : float
        Confidence of the intervals in tables and files.
    noise : float
        Standard deviation of one residual of the first target: of forces that of white noise with
        the same power in the compared band, N; of levels in units of their uncertainties, or in dB
        without any.
    residuals : ndarray, shape (n_residual,)
        Model minus target over its standard deviation.
    degrees_of_freedom : int
        Number of residuals − number of parameters, offset and tones included.
    interval_freedom : int or None
        Degrees of freedom of Student's t in the intervals: those of the data that determine the
        noise; None: they are normal.
    warnings : tuple of Note
        Why estimates or intervals may be wrong.
    assumptions : tuple of Note
        Which unknowns the intervals include, and the effect of errors that no data can show.
    widened : float
        Factor of the standard errors due to noise and unknowns, because residuals, or unknowns of a
        press, are larger than expected; 1 without a warning.
    known_noise : bool
        The standard deviations are stated, or those of the background of the records.
    singular_values : ndarray, shape (n,)
        Singular values of the Jacobian with columns of unit length, in descending order.
    evaluations, failures : int
        Number of impacts or curves computed, and of those that failed.
    converged : bool
        The search has converged.
    targets : tuple of FittedTarget
        Case, result and comparison of each target.
    """

    drawn_by: ClassVar[str] = "fit_figures.target_and_fit"

    names: tuple[str, ...]
    units: tuple[str, ...]
    estimate: Array
    covariance: Array
    limits: Array
    confidence: float
    noise: float
    residuals: Array
    degrees_of_freedom: int
    interval_freedom: int | None
    warnings: tuple[Note, ...]
    assumptions: tuple[Note, ...]
    widened: float
    known_noise: bool
    singular_values: Array
    evaluations: int
    failures: int
    converged: bool
    targets: tuple[FittedTarget, ...]

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
    def case(self) -> Case:
        """The case of the first target with the fitted values."""
        return self.targets[0].case

    @property
    def result(self) -> Impact | CompressionCurve:
        """The impact, or curve of a press, of the first target."""
        return self.targets[0].result

    @property
    def reduced_chi_square(self) -> float:
        """Squared residuals over degrees of freedom; 1 where the noise is estimated."""
        freedom = self.degrees_of_freedom
        return float(self.residuals @ self.residuals / freedom) if freedom else float("nan")

    @property
    def notes(self) -> tuple[Note, ...]:
        """Warnings, what the background of the records holds, and notes on the impacts."""
        backgrounds = (getattr(t.comparison, "background", None) for t in self.targets)
        found = (note for background in backgrounds if background for note in background.notes)
        results = (note for t in self.targets for note in getattr(t.result, "notes", ()))
        return tuple(dict.fromkeys((*self.warnings, *found, *results)))

    @property
    def display_units(self) -> dict[str, tuple[str, float]]:
        """Name of the unit in tables and figures, and how many SI units it is, by parameter."""
        pairs = zip(self.values.items(), self.units, strict=True)
        return {name: display_unit(unit, value) for (name, value), unit in pairs}

    def deviation_of(self, target: FittedTarget) -> float:
        """Return the standard deviation of one residual of a target, see `noise`."""
        first = self.targets[0].comparison.unit_deviation
        return self.noise / first * target.comparison.unit_deviation

    def intervals(self, confidence: float | None = None) -> dict[str, tuple[float, float]]:
        """Return confidence intervals by name, see `interval_freedom`.

        They are cut at the limits of the search. `confidence` is by default that of the fit.
        Raises InputError if it is not between 0 and 1.
        """
        confidence = self.confidence if confidence is None else confidence
        require_confidence(confidence)
        factor = coverage_factor(confidence, self.interval_freedom)
        half = factor * np.sqrt(np.diag(self.covariance))
        low = np.maximum(self.estimate - half, self.limits[:, 0]).tolist()
        high = np.minimum(self.estimate + half, self.limits[:, 1]).tolist()
        return dict(zip(self.names, zip(low, high, strict=True), strict=True))

    def __repr__(self) -> str:
        """Return the values, and whether the search has converged."""
        shown = zip(self.names, self.estimate, self.units, strict=True)
        values = ", ".join(f"{name} {value:.4g} {unit}".strip() for name, value, unit in shown)
        return f"<Fit, {'' if self.converged else 'not '}converged: {values}>"

    def table(self) -> str:
        """Return the fit as text."""
        return fit_table(self)

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: the parameters."""
        return parameter_rows(self)

    def __str__(self) -> str:
        """Return the table, and the warnings."""
        return "\n".join([self.table(), *(f"Warning: {note}." for note in self.warnings)])

    def columns(self) -> Mapping[str, Sequence[object] | Array]:
        """Return the first target and the model side by side; `targets` have the others."""
        return self.targets[0].columns()

    def to_dataframe(self) -> pd.DataFrame:
        """Return `columns` as a table; SI units, dB."""
        return data_frame({name: np.asarray(values) for name, values in self.columns().items()})

    def to_xarray(self) -> xr.Dataset:
        """Return the same columns over ``point``, and the estimates over ``parameter``."""
        with require_extra("studies"):
            import xarray as xr

        axes = ("parameter", "other_parameter")
        return xr.Dataset(
            {
                **{name: ("point", np.asarray(v)) for name, v in self.columns().items()},
                "estimate": ("parameter", self.estimate),
                "unit": ("parameter", list(self.units)),
                "covariance": (axes, self.covariance),
            },
            {axis: list(self.names) for axis in axes},
        )

    def figures(self) -> dict[str, Figure]:
        """Return the figures of all targets, and confidence regions, by the names of files."""
        from thud.plot.fit_figures import draw_fit

        return draw_fit(self)

    def files(self, **extra: object) -> dict[str, bytes]:
        """Return ``fit.json``, with further entries, ``fit.csv`` and ``fitted.nml`` by name.

        The last two have a number if there are several targets, as in ``fit_2.csv``.
        """
        return fit_files(self, **extra)

    def figure_files(self) -> dict[str, bytes]:
        """Return the contents of the files of the figures by name; a warning if there are none."""
        with warn_if_not_drawn("the figure of the fit"):
            from thud.plot.save_figures import figure_files

            return figure_files(self.figures())
        return {}

    def save(
        self, path: str | os.PathLike[str], *, figures: bool = True, replace: bool = False
    ) -> None:
        """Write the files of `files`, and the figures, into a directory of their own.

        The directory is replaced as a whole; with `replace` also one with results of something
        else. Raises InputError if it holds any other file, OSError if a file cannot be written.
        """
        contents = self.files() | (self.figure_files() if figures else {})
        Results(Path(path), "fit", replace=replace).write(contents)
