"""Estimated parameters and their uncertainty, for fits to impacts and to compressions."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thud.base.display import Displayed, warn_if_not_drawn
from thud.base.extras import data_frame, require_extra
from thud.base.files import Results
from thud.base.units import display_unit
from thud.studies.fitting.fit_report import parameter_rows
from thud.studies.fitting.inference import coverage_factor, require_confidence

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence

    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

    from thud.base.note import Note
    from thud.studies.arrays import Array


@dataclass(frozen=True, eq=False, repr=False)
class Estimates(Displayed):
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
    degrees_of_freedom : int
        Number of residuals − number of parameters, nuisance parameters included.
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
    """

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
    def notes(self) -> tuple[Note, ...]:
        """Warnings; of a fit to impacts also what was done to records, and notes on impacts."""
        return self.warnings

    @property
    def display_units(self) -> dict[str, tuple[str, float]]:
        """Name of the unit in tables and figures, and how many SI units it is, by parameter."""
        pairs = zip(self.values.items(), self.units, strict=True)
        return {name: display_unit(unit, value) for (name, value), unit in pairs}

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

    @abstractmethod
    def columns(self) -> Mapping[str, Sequence[object] | Array]:
        """Return measured values and model side by side, SI units, dB: columns by their names."""

    @abstractmethod
    def table(self) -> str:
        """Return the fit as text."""

    @abstractmethod
    def files(self) -> dict[str, bytes]:
        """Return the contents of the files of `save`, but figures, by name."""

    def figures(self) -> dict[str, Figure]:
        """Return all figures by the names of their files."""
        return {"fit": self.plot()}

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: the parameters."""
        return parameter_rows(self)

    def __str__(self) -> str:
        """Return the table, and the warnings."""
        return "\n".join([self.table(), *(f"Warning: {note}." for note in self.warnings)])

    def to_dataframe(self) -> pd.DataFrame:
        """Return measured values and model side by side; SI units, dB."""
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
