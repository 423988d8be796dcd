"""The result of a fit: numbers, table, figures and files."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thud.base.bridge import version
from thud.base.display import warn_if_not_drawn
from thud.base.extras import require_extra
from thud.base.files import Results
from thud.base.immutable import Immutable
from thud.case.case import case_text
from thud.studies.fitting.estimates import Estimates
from thud.studies.fitting.misfit import SHIFT

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence

    import pandas as pd
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base.note import Note
    from thud.case.case import Case
    from thud.impact.impact import Impact
    from thud.studies.fitting.misfit import Misfit


@dataclass(frozen=True, eq=False)
class FittedTarget(Immutable):
    """One target of a fit, with its case, impact and own parameters.

    Attributes
    ----------
    case : Case
        The case with the fitted values, and what is fixed for this target.
    impact : Impact
        Its impact.
    misfit : Misfit
        The comparison of target and impact.
    own : ndarray
        The parameters of this target alone, if fitted: time of first touch, s, and gain.
    """

    case: Case
    impact: Impact
    # Impact and residuals identify targets.
    misfit: Misfit = field(compare=False)
    own: NDArray[np.float64]

    def own_value(self, name: str, default: float) -> float:
        """Return one of the parameters of this target alone."""
        return dict(zip(self.misfit.own, map(float, self.own), strict=True)).get(name, default)

    @property
    def nuisances(self) -> dict[str, tuple[float, float]]:
        """Offset and amplitude of hum, and their standard errors, N, by name."""
        return self.misfit.nuisances(self.impact, self.own)

    def columns(self) -> Mapping[str, Sequence[object] | NDArray[np.float64]]:
        """Return target and model side by side, SI units, dB: columns by their names."""
        return self.misfit.columns(self.impact, self.own)


@dataclass(frozen=True, eq=False)
class Fit(Estimates):
    """The best parameters of a model for one or more targets; see `Estimates` for the rest.

    Attributes
    ----------
    names : tuple of str
        The parameters; then those of the records, if fitted: ``"time_shift"``, the time of first
        touch, and ``"gain"``, of several records with their number, as ``"gain(2)"``.
    noise : float
        Standard deviation of one residual of the first target: of forces that of white noise with
        the same power in the compared band, N; of levels in units of their uncertainties, or in dB
        without any.
    residuals : ndarray, shape (n_residual,)
        Model minus target over its standard deviation.
    known_noise : bool
        The standard deviations are stated, or those of the background of the records.
    singular_values : ndarray, shape (n,)
        Singular values of the Jacobian with columns of unit length, in descending order.
    evaluations, failures : int
        Number of impacts computed, and of those that failed.
    converged : bool
        The search has converged.
    identifiability : tuple of Note
        How well the parameters can be separated.
    targets : tuple of FittedTarget
        Case, impact and comparison of each target.
    given_units : dict of str to tuple
        Units of the parameters in the study, and their sizes in SI units.
    """

    known_noise: bool
    singular_values: NDArray[np.float64]
    evaluations: int
    failures: int
    converged: bool
    identifiability: tuple[Note, ...]
    targets: tuple[FittedTarget, ...]
    given_units: dict[str, tuple[str, float]] = field(default_factory=dict)

    @property
    def ends(self) -> list[str]:
        """Endings of the file names of each target."""
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
    def degrees_of_freedom(self) -> int:
        """Number of residuals − number of parameters, nuisance parameters included."""
        absorbed = sum(target.misfit.absorbed for target in self.targets)
        return len(self.residuals) - len(self.names) - absorbed

    @property
    def interval_freedom(self) -> int | None:
        """Degrees of freedom of Student's t in the intervals; None: they are normal.

        They are those of the residuals or of the background, whichever determines the noise.
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

    def __repr__(self) -> str:
        """Return the values, and whether the search has converged."""
        shown = zip(self.names, self.estimate, self.units, strict=True)
        values = ", ".join(f"{name} {value:.4g} {unit}".strip() for name, value, unit in shown)
        return f"<Fit, {'' if self.converged else 'not '}converged: {values}>"

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings of the impacts at the result."""
        return tuple(dict.fromkeys(r for target in self.targets for r in target.impact.warnings))

    @property
    def succeeded(self) -> bool:
        """Whether the search has converged."""
        return self.converged

    @property
    def display_units(self) -> dict[str, tuple[str, float]]:
        """Name of the unit in tables and figures, and how many SI units it is, by parameter."""
        return super().display_units | self.given_units

    def table(self) -> str:
        """Return the fit as text."""
        return "\n".join([super().table(), "", *self._quality()])

    def _quality(self) -> list[str]:
        """Return the quality of the fit in lines of text."""
        freedom = self.degrees_of_freedom
        quality = f", reduced chi-square {self.reduced_chi_square:.3g}" if freedom else ""
        failures = f", {self.failures} of them impossible" if self.failures else ""
        data = f"{len(self.residuals)} data, {freedom} degrees of freedom{quality}"
        # Of a single target on the line of its data.
        deviations = [self._deviation(target) for target in self.targets]
        lines = [f"{data}; {deviations[0]}"] if len(deviations) == 1 else [data]
        for number, target in enumerate(self.targets, start=1):
            parts = [deviations[number - 1]] if len(deviations) > 1 else []
            parts += [
                f"{name} {value:.3g} ± {error:.2g} N"
                for name, (value, error) in target.nuisances.items()
            ]
            label = f"target {number}: " if len(deviations) > 1 else ""
            lines += [f"{label}{', '.join(parts)}"] if parts else []
        lines += [*map(str, self.identifiability), *self.trust]
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
            in_band = f"{size * misfit.band_fraction:.3g} {unit}"
            return f"noise of {in_band} in the compared band, from the background"
        source = "given" if self.known_noise else "estimated from the residuals"
        return f"standard deviation {size:.3g} {unit}, {source}"

    def summary(self) -> dict[str, object]:
        """Return the numbers of the fit for JSON; None for those that are not finite."""
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
            "identifiability": list(map(str, self.identifiability)),
            "assumptions": list(self.assumptions),
            "widened": self.widened,
            "evaluations": self.evaluations,
            "failures": self.failures,
            "converged": self.converged,
            "warnings": list(map(str, self.warnings)),
        }

    def to_dataframe(self, number: int = 1) -> pd.DataFrame:
        """Return a target, by its number, and the model side by side; SI units, dB."""
        with require_extra("studies"):
            import pandas as pd

        return pd.DataFrame(self.targets[number - 1].columns())

    def plot(self) -> Figure:
        """Draw the first target and the model, and below them their difference."""
        from thud.plot import target_and_fit

        return target_and_fit(self)

    def figures(self, name: str = "fit") -> dict[str, Figure]:  # noqa: ARG002 - fits have one name
        """Return the figures of all targets, and confidence regions, by the names of files."""
        from thud.plot import draw_fit

        return draw_fit(self)

    def files(self, **extra: object) -> dict[str, bytes]:
        """Return ``fit.json``, with further entries, ``fit.csv`` and ``fitted.nml`` by name.

        The last two have a number if there are several targets, as in ``fit_2.csv``.
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
        self, directory: str | os.PathLike[str], *, figures: bool = True, replace: bool = False
    ) -> list[Path]:
        """Write the files of `files`, and the figures; return their paths.

        The directory is replaced as a whole; with `replace` also one with results of something
        else. Raises InputError if it holds any other file, OSError if a file cannot be written.
        """
        contents = self.files()
        if figures:
            with warn_if_not_drawn("the figure of the fit"):
                from thud.plot import figure_files

                contents |= figure_files(self.figures())
        return Results(Path(directory), "fit", replace=replace).write(contents)


def file_ends(count: int) -> list[str]:
    """Return the endings of the file names of targets."""
    return [""] if count == 1 else [f"_{number}" for number in range(1, count + 1)]


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
