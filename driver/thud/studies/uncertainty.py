"""Probability of conformity with tolerances of manufacture and temperature (Monte Carlo)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Unpack

import numpy as np

from thud.base.checks import refuse
from thud.level.assessment import octave_limits, wilson_interval
from thud.level.levels import get_bands
from thud.studies.run import compute
from thud.studies.study_result import SampleResult

if TYPE_CHECKING:
    import os

    import xarray as xr

    from thud.base._schema import LimitsSource
    from thud.studies.arrays import Array
    from thud.studies.run import RunOptions
    from thud.studies.study import Source, Study


@dataclass(frozen=True, eq=False, repr=False)
class Uncertainty(SampleResult):
    """Distribution of the levels, and the probability of conformity.

    Attributes
    ----------
    dataset : Dataset
        Every sample.
    """

    drawn_by: ClassVar[str] = "study_figures.draw_uncertainty"

    kind: ClassVar[str] = "uncertainty"

    dataset: xr.Dataset

    def __post_init__(self) -> None:
        """Raise InputError if fewer than two samples have results."""
        if self.computed < 2:  # noqa: PLR2004 - a spread needs two
            reasons = [text for text in self.dataset["reason"].values if text]
            count = f"only {self.computed} of {self.dataset.sizes['sample']} samples have results"
            refuse(f"{count} ({reasons[0]})" if reasons else count, "two or more")

    @classmethod
    def check(cls, study: Study) -> None:
        """Raise InputError for a study whose samples have different limits."""
        for name in {parameter.name for parameter in study.parameters} & {"source", "force"}:
            refuse(
                f"[parameters] {name} is not allowed, because all samples have the same limits",
                f"{name} in [fixed]",
            )

    def __repr__(self) -> str:
        """Return how many samples conform."""
        return f"<Uncertainty, {self.source}: {self.conforming} of {self.computed} samples conform>"

    @property
    def samples(self) -> xr.Dataset:
        """Samples that have results."""
        return self.dataset.isel(sample=np.flatnonzero(self.dataset["status"] == 0))

    @property
    def levels(self) -> Array:
        """Octave levels of the assessed force of these samples, dB, shape (n_sample, 5)."""
        return np.asarray(self.samples[f"{self.dataset.attrs['assessed_force']}_octave"])

    @property
    def source(self) -> LimitsSource:
        """Source whose limits apply."""
        source: LimitsSource = self.dataset.attrs["limits"]
        return source

    @property
    def conforming(self) -> int:
        """Number of samples that meet all criteria."""
        return int(self.samples["conforms"].sum())

    @property
    def computed(self) -> int:
        """Number of samples that have results."""
        return self.samples.sizes["sample"]

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
        for i, (band, level) in enumerate(zip(get_bands().nominal, self.levels.T, strict=True)):
            share = np.mean((level >= lower[i]) & (level <= upper[i]))
            rows.append((f"{band:g}", *_spread(level), f"{100 * share:.1f} %"))
        if "room_rating" in self.dataset:
            rating = self.samples["room_rating"].to_numpy()
            rows.append(("rating of the room", *_spread(rating), ""))
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


def _spread(values: Array) -> tuple[str, str, str]:
    """Return mean, standard deviation and the range of 95 % as text."""
    low, high = np.quantile(values, [0.025, 0.975])
    return f"{values.mean():.2f}", f"{values.std(ddof=1):.2f}", f"{low:.2f} to {high:.2f}"


def uncertainty(
    study: Source, output: str | os.PathLike[str] | None = None, **options: Unpack[RunOptions]
) -> Uncertainty:
    """Compute how tolerances spread the levels, and the probability of conformity.

    The parameters of the study are independent. Arguments and errors are those of `sweep`;
    InputError is also raised if fewer than two samples have results.
    """
    return compute(Uncertainty, study, output, **options)
