"""The result of a fit: numbers, table, figures and files."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from thud.base.bridge import version
from thud.base.display import Displayed, left_out
from thud.base.files import Results
from thud.base.immutable import Immutable
from thud.base.key import check_keywords
from thud.base.tables import format_rows
from thud.base.units import display_unit
from thud.case.case import case_text
from thud.studies.fitting.inference import coverage_factor
from thud.studies.fitting.misfit import SHIFT

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.case.case import Case
    from thud.impact.impact import Impact
    from thud.studies.fitting.misfit import Misfit

# By parameter: name of a unit, and how many SI units it is.
Units: TypeAlias = "Mapping[str, tuple[str, float]]"


@dataclass(frozen=True, eq=False)
class FittedTarget(Immutable):
    """One target of a fit and what was found for it.

    Attributes
    ----------
    case : Case
        The case with the fitted values, and what is fixed for this target.
    impact : Impact
        Its impact.
    misfit : Misfit
        The comparison of target and impact.
    own : ndarray
        The parameters of this target alone: time of first touch, s, and gain where they are fitted.
    """

    case: Case
    impact: Impact
    # Impact and residuals tell targets apart.
    misfit: Misfit = field(compare=False)
    own: NDArray[np.float64]

    def own_value(self, name: str, default: float) -> float:
        """Return one of the parameters of this target alone."""
        return dict(zip(self.misfit.own, map(float, self.own), strict=True)).get(name, default)

    @property
    def nuisances(self) -> dict[str, tuple[float, float]]:
        """Offset and amplitude of hum, and their standard errors, N, by name."""
        return self.misfit.nuisances(self.impact, self.own)

    def columns(self) -> Mapping[str, Sequence[object]]:
        """Return target and model side by side, SI units, dB: columns by their names."""
        return self.misfit.columns(self.impact, self.own)


@dataclass(frozen=True, eq=False)
class Fit(Displayed):
    """The best parameters of a model for a target, and their uncertainty; SI units.

    Attributes
    ----------
    names : tuple of str
        The parameters; last those of the records, where they are free: ``"time_shift"``, the time
        of first touch, and ``"gain"``, of several records with their number, as ``"gain(2)"``.
    units : tuple of str
        Their units.
    estimate : ndarray, shape (n,)
        Their values.
    covariance : ndarray, shape (n, n)
        Their covariance; infinite variances where they are not identifiable.
    limits : ndarray, shape (n, 2)
        Low and high limit of the search for each; infinite where there is none.
    singular_values : ndarray, shape (n,)
        Singular values of the Jacobian with columns of unit length, in descending order.
    confidence : float
        Confidence of the intervals in tables and files.
    noise : float
        Standard deviation of one residual of the first target: for forces that of white noise with
        the same power in the compared band, N, for levels in units of their uncertainties, or dB
        where none were given.
    known_noise : bool
        The standard deviations were given, or are those of the quiet of the records.
    residuals : ndarray, shape (n_residual,)
        Model minus target over its standard deviation.
    evaluations, failures : int
        Impacts that were computed, and that could not be.
    converged : bool
        The search has converged.
    warnings : tuple of str
        Parameters that are not identifiable or at their limits, residuals that are no noise, and a
        poor model, as sentences.
    identifiability : tuple of str
        How well the parameters can be told apart, as sentences.
    targets : tuple of FittedTarget
        Case, impact and comparison of each target.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    estimate: NDArray[np.float64]
    covariance: NDArray[np.float64]
    limits: NDArray[np.float64]
    singular_values: NDArray[np.float64]
    confidence: float
    noise: float
    known_noise: bool
    residuals: NDArray[np.float64]
    evaluations: int
    failures: int
    converged: bool
    warnings: tuple[str, ...]
    identifiability: tuple[str, ...]
    targets: tuple[FittedTarget, ...]

    @property
    def ends(self) -> list[str]:
        """What the names of the files of each target end with."""
        return file_ends(len(self.targets))

    @property
    def case(self) -> Case:
        """The case of the first target with the fitted values."""
        return self.targets[0].case

    @property
    def impact(self) -> Impact:
        """The impact of the first target."""
        return self.targets[0].impact

    @property
    def misfit(self) -> Misfit:
        """The comparison of the first target."""
        return self.targets[0].misfit

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
    def correlation(self) -> NDArray[np.float64]:
        """Correlation of the parameters, shape (n, n); NaN where a variance is infinite."""
        errors = np.sqrt(np.diag(self.covariance))
        with np.errstate(invalid="ignore"):
            result: NDArray[np.float64] = self.covariance / np.outer(errors, errors)
        return result

    @property
    def degrees_of_freedom(self) -> int:
        """Residuals less parameters and nuisance parameters."""
        absorbed = sum(target.misfit.absorbed for target in self.targets)
        return len(self.residuals) - len(self.names) - absorbed

    @property
    def interval_freedom(self) -> int | None:
        """Degrees of freedom of Student's t in the intervals; None: they are normal.

        Those of the residuals where they tell the noise, or of the quiet of the records.
        """
        if not self.known_noise:
            return self.degrees_of_freedom
        known = [target.misfit.noise_freedom for target in self.targets]
        return min((freedom for freedom in known if freedom is not None), default=None)

    @property
    def reduced_chi_square(self) -> float:
        """Squared residuals over degrees of freedom; 1 where the noise is estimated."""
        freedom = self.degrees_of_freedom
        return float(self.residuals @ self.residuals / freedom) if freedom else float("nan")

    @property
    def time_shift(self) -> float:
        """Time of first touch in the first record, s."""
        return self.targets[0].own_value(SHIFT, 0.0)

    @check_keywords
    def intervals(self, confidence: float | None = None) -> dict[str, tuple[float, float]]:
        """Return confidence intervals by name, see `interval_freedom`.

        They end at the limits of the search. `confidence` is by default that of the fit.
        """
        asked = self.confidence if confidence is None else confidence
        factor = coverage_factor(asked, self.interval_freedom)
        half = factor * np.sqrt(np.diag(self.covariance))
        low = np.maximum(self.estimate - half, self.limits[:, 0]).tolist()
        high = np.minimum(self.estimate + half, self.limits[:, 1]).tolist()
        return dict(zip(self.names, zip(low, high, strict=True), strict=True))

    def __repr__(self) -> str:
        """Return the values, and whether the search has converged."""
        shown = zip(self.names, self.estimate, self.units, strict=True)
        values = ", ".join(f"{name} {value:.4g} {unit}".strip() for name, value, unit in shown)
        return f"<Fit, {'' if self.converged else 'not '}converged: {values}>"

    def table(self, units: Units | None = None) -> str:
        """Return the fit as text; `units` as in `shown_units`."""
        return "\n".join([format_rows(self.rows(units)), "", *self._warning_lines()])

    def rows(self, units: Units | None = None) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        interval = f"{self.confidence:.0%} interval"
        rows: list[tuple[str, ...]] = [("parameter", "value", "standard error", interval, "unit")]
        intervals = self.intervals()
        for name, (shown, factor) in self.shown_units(units).items():
            value, error = self.values[name] / factor, self.standard_errors[name] / factor
            low, high = (end / factor for end in intervals[name])
            digits = _digits(value, error)
            interval = f"{low:.{digits}g} to {high:.{digits}g}" if np.isfinite(error) else "unknown"
            rows.append((name, f"{value:.{digits}g}", f"{error:.2g}", interval, shown))
        return rows

    def shown_units(self, units: Units | None = None) -> dict[str, tuple[str, float]]:
        """Return name and SI factor of the unit of each parameter; `units` override the default."""
        handy = {
            name: display_unit(unit, value)
            for (name, value), unit in zip(self.values.items(), self.units, strict=True)
        }
        return {**handy, **(units or {})}

    def _warning_lines(self) -> list[str]:
        """Return the quality of the fit, one sentence per line."""
        freedom = self.degrees_of_freedom
        quality = f", reduced chi-square {self.reduced_chi_square:.3g}" if freedom else ""
        failures = f", {self.failures} of them impossible" if self.failures else ""
        data = f"{len(self.residuals)} data, {freedom} degrees of freedom{quality}"
        # Of a single target on the line of its data.
        deviations = [self._deviation(target) for target in self.targets]
        lines = [f"{data}; {deviations[0]}"] if len(deviations) == 1 else [data]
        for number, target in enumerate(self.targets, start=1):
            told = [deviations[number - 1]] if len(deviations) > 1 else []
            told += [
                f"{name} {value:.3g} ± {error:.2g} N"
                for name, (value, error) in target.nuisances.items()
            ]
            place = f"target {number}: " if len(deviations) > 1 else ""
            lines += [f"{place}{', '.join(told)}"] if told else []
        lines += self.identifiability
        return [*lines, f"{self.evaluations} impacts computed{failures}"]

    def deviation_of(self, target: FittedTarget) -> float:
        """Return the standard deviation of one residual of a target, see `noise`."""
        return self.noise / self.misfit.unit_deviation * target.misfit.unit_deviation

    def _deviation(self, target: FittedTarget) -> str:
        """Return the standard deviation of a target in words."""
        misfit, unit = target.misfit, target.misfit.deviation_unit
        if self.known_noise and unit == "dB":  # they may differ
            return "standard deviations given"
        size = self.deviation_of(target)
        if self.known_noise and misfit.noise_freedom is not None:
            return (
                f"noise of {size * misfit.band_share:.3g} {unit} in the compared band, by the quiet"
            )
        source = "given" if self.known_noise else "estimated from the residuals"
        return f"standard deviation {size:.3g} {unit}, {source}"

    def __str__(self) -> str:
        """Return the fit as text, with its warnings."""
        return "\n".join([self.table(), *(f"Warning: {text}." for text in self.warnings)])

    def summary(self) -> dict[str, object]:
        """Return the numbers of the fit for JSON: None where they are not finite."""
        intervals = self.intervals()
        return {
            "version": version(),
            "model": self.case.model.name if self.case.model else None,
            "parameters": {
                name: {
                    "value": self.values[name],
                    "standard_error": _finite(self.standard_errors[name]),
                    "interval": [_finite(end) for end in intervals[name]],
                    "unit": unit,
                }
                for name, unit in zip(self.names, self.units, strict=True)
            },
            "confidence": self.confidence,
            "covariance": [[_finite(entry) for entry in row] for row in self.covariance],
            "correlation": [[_finite(entry) for entry in row] for row in self.correlation],
            "singular_values": self.singular_values.tolist(),
            "residuals": len(self.residuals),
            "degrees_of_freedom": self.degrees_of_freedom,
            "reduced_chi_square": _finite(self.reduced_chi_square),
            "noise": self.noise,
            "noise_given": self.known_noise,
            "nuisances": [
                {
                    name: dict(zip(("value", "standard_error"), pair, strict=True))
                    for name, pair in target.nuisances.items()
                }
                for target in self.targets
            ],
            "identifiability": list(self.identifiability),
            "evaluations": self.evaluations,
            "failures": self.failures,
            "converged": self.converged,
            "warnings": list(self.warnings),
        }

    def figures(self, units: Units | None = None) -> dict[str, Figure]:
        """Return the figures by name; `units` as in `table`."""
        from thud.plot import draw_fit

        return draw_fit(self, self.shown_units(units))

    def files(self, **extra: object) -> dict[str, bytes]:
        """Return ``fit.json``, with further entries, ``fit.csv`` and ``fitted.nml`` by name.

        Of several targets, table and case have the number of the target, as in ``fit_2.csv``.
        """
        content = json.dumps({**self.summary(), **extra}, indent=2, allow_nan=False, default=str)
        files = {"fit.json": f"{content}\n".encode()}
        for target, end in zip(self.targets, self.ends, strict=True):
            columns = target.columns()
            rows = [columns, *zip(*columns.values(), strict=True)]
            table = "".join(f"{','.join(map(str, row))}\n" for row in rows)
            files[f"fit{end}.csv"] = table.encode()
            files[f"fitted{end}.nml"] = case_text(target.case)
        return files

    def save(
        self,
        directory: str | os.PathLike[str],
        units: Units | None = None,
        *,
        figures: bool = True,
        replace: bool = False,
    ) -> list[Path]:
        """Write the files of `files`, and figures as PNG and SVG; return their paths.

        Files that thud has not written are replaced with `replace` only. `units` are those of the
        figures, as in `shown_units`; files have SI units. Raises InputError where a file is in the
        way, OSError where one cannot be written.
        """
        contents = self.files()
        if figures:
            with left_out("the figure of the fit"):
                from thud.plot import figure_files

                contents |= figure_files(self.figures(units))
        return Results(Path(directory), "fit", replace=replace).write(contents)


def file_ends(count: int) -> list[str]:
    """Return what the names of the files of targets end with."""
    return [""] if count == 1 else [f"_{number}" for number in range(1, count + 1)]


def _digits(value: float, error: float) -> int:
    """Return the number of digits that shows a value to two digits of its error."""
    if not (np.isfinite(error) and error > 0 and value):
        return 6
    return int(np.clip(np.ceil(np.log10(abs(value) / error)) + 2, 3, 12))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
