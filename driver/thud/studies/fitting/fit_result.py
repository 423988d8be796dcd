"""The result of a fit to impacts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from thud.base.immutable import Immutable
from thud.studies.fitting.estimates import Estimates
from thud.studies.fitting.fit_report import fit_files, fit_table
from thud.studies.fitting.force_target import ForceComparison

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure

    from thud.base.note import Note
    from thud.case.case import Case
    from thud.impact.impact import Impact
    from thud.studies.arrays import Array
    from thud.studies.fitting.comparison import Comparison


@dataclass(frozen=True, eq=False)
class FittedTarget(Immutable):
    """One target of a fit, with its case, impact and own parameters.

    Attributes
    ----------
    case : Case
        The case with the fitted values, and what is fixed for this target.
    impact : Impact
        Its impact.
    comparison : Comparison
        The comparison of target and impact.
    own : ndarray
        The parameters of this target alone, if fitted: time of first touch, s, and gain.
    """

    case: Case
    impact: Impact
    comparison: Comparison
    own: Array

    @property
    def nuisances(self) -> dict[str, tuple[float, float]]:
        """Offset and amplitude of tones, and their standard errors, N, by name."""
        if not isinstance(self.comparison, ForceComparison):
            return {}
        return self.comparison.nuisances(self.impact, self.own)

    def columns(self) -> Mapping[str, Sequence[object] | Array]:
        """Return target and model side by side, SI units, dB: columns by their names."""
        return self.comparison.columns(self.impact, self.own)


@dataclass(frozen=True, eq=False, repr=False)
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
    targets : tuple of FittedTarget
        Case, impact and comparison of each target.
    """

    drawn_by: ClassVar[str] = "fit_figures.target_and_fit"

    known_noise: bool
    singular_values: Array
    evaluations: int
    failures: int
    converged: bool
    targets: tuple[FittedTarget, ...]

    @property
    def case(self) -> Case:
        """The case of the first target with the fitted values."""
        return self.targets[0].case

    @property
    def impact(self) -> Impact:
        """The impact of the first target."""
        return self.targets[0].impact

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
        impacts = (note for target in self.targets for note in target.impact.notes)
        return tuple(dict.fromkeys((*self.warnings, *found, *impacts)))

    def deviation_of(self, target: FittedTarget) -> float:
        """Return the standard deviation of one residual of a target, see `noise`."""
        first = self.targets[0].comparison.unit_deviation
        return self.noise / first * target.comparison.unit_deviation

    def __repr__(self) -> str:
        """Return the values, and whether the search has converged."""
        shown = zip(self.names, self.estimate, self.units, strict=True)
        values = ", ".join(f"{name} {value:.4g} {unit}".strip() for name, value, unit in shown)
        return f"<Fit, {'' if self.converged else 'not '}converged: {values}>"

    def columns(self) -> Mapping[str, Sequence[object] | Array]:
        """Return the first target and the model side by side; `targets` have the others."""
        return self.targets[0].columns()

    def table(self) -> str:
        """Return the fit as text."""
        return fit_table(self)

    def figures(self) -> dict[str, Figure]:
        """Return the figures of all targets, and confidence regions, by the names of files."""
        from thud.plot.fit_figures import draw_fit

        return draw_fit(self)

    def files(self, **extra: object) -> dict[str, bytes]:
        """Return ``fit.json``, with further entries, ``fit.csv`` and ``fitted.nml`` by name.

        The last two have a number if there are several targets, as in ``fit_2.csv``.
        """
        return fit_files(self, **extra)
