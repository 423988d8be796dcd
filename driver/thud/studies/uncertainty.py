"""Probability of conformity with tolerances of manufacture and temperature (Monte Carlo)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Unpack

import numpy as np

from thud.base.checks import refuse
from thud.level.assessment import octave_limits, wilson_interval
from thud.level.levels import get_bands
from thud.studies.sample_kind import SampleKind
from thud.studies.study_result import SampleResult

if TYPE_CHECKING:
    import os

    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import LimitsSource
    from thud.case.case import Case
    from thud.studies.kind import RunOptions
    from thud.studies.parameter import Parameter
    from thud.studies.samples import SampleStudy
    from thud.studies.study import Source


@dataclass(frozen=True, eq=False)
class Uncertainty(SampleResult):
    """Distribution of the levels, and the probability of conformity.

    Attributes
    ----------
    dataset : Dataset
        Every sample.
    levels : ndarray, shape (n_sample, 5)
        Octave levels of the assessed force, dB; samples without results are left out.
    source : str
        Source whose limits apply.
    conforming, computed, failed : int
        Samples that meet all criteria, that have results, and that have none.
    """

    dataset: xr.Dataset
    levels: NDArray[np.float64]
    source: LimitsSource
    conforming: int
    computed: int
    failed: int

    def __repr__(self) -> str:
        """Return how many samples conform."""
        return f"<Uncertainty, {self.source}: {self.conforming} of {self.computed} samples conform>"

    @property
    def probability(self) -> float:
        """Fraction of the computed samples that conform."""
        return self.conforming / self.computed

    @property
    def standard_error(self) -> float:
        """Monte Carlo standard error of the probability."""
        return math.sqrt(self.probability * (1 - self.probability) / self.computed)

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's score interval of the probability, 95 %; valid also if none or all conform."""
        return wilson_interval(self.conforming, self.computed)

    @property
    def surrogate_range(self) -> tuple[float, float] | None:
        """Probability if all errors of the surrogate are adverse, and if all are favorable.

        None if the model computed the samples.
        """
        if "undecided" not in self.dataset:
            return None
        conforms, undecided = (self.dataset[name].values for name in ("conforms", "undecided"))
        counts = (conforms & ~undecided).sum(), (conforms | undecided).sum()
        return float(counts[0] / self.computed), float(counts[1] / self.computed)

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        lower, upper = octave_limits(self.source)
        rows: list[tuple[str, ...]] = [
            ("octave, Hz", "mean, dB", "std, dB", "2.5 to 97.5 %, dB", "within its limits")
        ]
        for i, band in enumerate(get_bands().nominal):
            level = self.levels[:, i]
            low, high = np.quantile(level, [0.025, 0.975])
            share = np.mean((level >= lower[i]) & (level <= upper[i]))
            spread = f"{level.std(ddof=1):.2f}", f"{low:.2f} to {high:.2f}"
            rows.append((f"{band:g}", f"{level.mean():.2f}", *spread, f"{100 * share:.1f} %"))
        if "room_rating" in self.dataset:
            rating = self.dataset["room_rating"].values[self.dataset["status"].values == 0]
            low, high = np.quantile(rating, [0.025, 0.975])
            spread = f"{rating.std(ddof=1):.2f}", f"{low:.2f} to {high:.2f}"
            rows.append(("rating of the room", f"{rating.mean():.2f}", *spread, ""))
        low, high = self.interval
        probability = f"{100 * self.probability:.1f} %", f"± {100 * self.standard_error:.1f} %"
        interval = f"{100 * low:.1f} to {100 * high:.1f} %"
        count = f"{self.conforming} of {self.computed}"
        rows.append(("all criteria", *probability, interval, count))
        if self.surrogate_range:
            low, high = self.surrogate_range
            share = f"{100 * low:.1f} to {100 * high:.1f} %"
            rows.append(("  with errors of the surrogate", "", "", share, ""))
        return rows

    def plot(self) -> Figure:
        """Return the distribution of the levels."""
        from thud.plot import draw_uncertainty

        return draw_uncertainty(self)


class UncertaintyKind(SampleKind[Uncertainty]):
    """Uncertainty as a kind of study."""

    name = "uncertainty"
    designs = ("random",)

    def new_parameter(
        self, name: str, entry: object, case: Case, density: float | None
    ) -> Parameter:
        """Return a parameter that varies; limits must be the same for all samples."""
        if name in {"source", "force"}:
            refuse(
                f"[parameters] {name} is not allowed, because all samples have the same limits",
                f"{name} in [fixed]",
            )
        return super().new_parameter(name, entry, case, density)

    def new_result(self, study: SampleStudy, dataset: xr.Dataset) -> Uncertainty:
        """Return the distribution over all samples."""
        dataset = dataset.load()
        computed = dataset["status"].values == 0
        if computed.sum() < 2:  # noqa: PLR2004 - a spread needs two
            reason = next((f" ({text})" for text in dataset["reason"].values if text), "")
            refuse(
                f"only {computed.sum()} of {study.size} samples have results{reason}", "two or more"
            )
        return Uncertainty(
            dataset,
            dataset[f"{study.case.levels.force}_octave"].values[computed],
            study.case.limits.source,
            int(dataset["conforms"].values[computed].sum()),
            int(computed.sum()),
            int((~computed).sum()),
        )


KIND = UncertaintyKind()


def uncertainty(
    study: Source, output: str | os.PathLike[str] | None = None, **options: Unpack[RunOptions]
) -> Uncertainty:
    """Compute how tolerances spread the levels, and the probability of conformity.

    The parameters of the study are independent. Arguments and errors are those of `sweep`;
    InputError is also raised if fewer than two samples have results.
    """
    return KIND.run(study, output, **options)
