"""Uncertainty of measured criteria after the GUM, and the verdict with a guard band."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import t as student

from thud.base.checks import refuse, shown
from thud.base.display import Displayed
from thud.base.immutable import Immutable
from thud.level.levels import SOURCES, judge
from thud.recordings.recorded_levels import WITHIN_REPEATABILITY

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from thud.base._schema import LimitsSource
    from thud.recordings.estimates import Estimate
    from thud.recordings.recorded_levels import AverageLevels

CONFIDENCE = 0.95
VERDICTS = ("conforms", "does not conform", "cannot be decided")
# dB per relative change of a force.
AMPLITUDE_DECIBEL = 20 / math.log(10)


@dataclass(frozen=True, eq=False)
class Contribution(Immutable):
    """One line of an uncertainty budget.

    Attributes
    ----------
    name : str
        Where it comes from.
    uncertainty : float
        Standard uncertainty that it makes of the value, in the value's unit.
    freedom : float
        Degrees of freedom; infinite where it is not estimated from a scatter (type B).
    counted : bool
        Whether it is part of the combined uncertainty. False where the repeatability holds it.
    """

    name: str
    uncertainty: float
    freedom: float = math.inf
    counted: bool = True


@dataclass(frozen=True, eq=False)
class Quantity(Immutable):
    """A measured value and its uncertainty budget.

    Attributes
    ----------
    value : float
        Best value; NaN where not known.
    contributions : tuple of Contribution
        Independent contributions; an uncertainty of NaN is one that is not known.
    upper_bound : bool
        Whether the true value lies at or below `value`, within its uncertainty, by an unknown
        amount (a level in the background).
    """

    value: float
    contributions: tuple[Contribution, ...] = ()
    upper_bound: bool = False

    @property
    def uncertainty(self) -> float:
        """Combined standard uncertainty (JCGM 100, 5.1.2)."""
        return math.sqrt(sum(c.uncertainty**2 for c in self.contributions if c.counted))

    @property
    def freedom(self) -> float:
        """Effective degrees of freedom after Welch and Satterthwaite (JCGM 100, G.4.1)."""
        counted = [c for c in self.contributions if c.counted and c.uncertainty]
        share = sum((c.uncertainty / self.uncertainty) ** 4 / c.freedom for c in counted)
        return 1 / share if share else math.inf

    @property
    def coverage_factor(self) -> float:
        """Quantile of Student's t for 95 %."""
        freedom = self.freedom
        return float(student.ppf((1 + CONFIDENCE) / 2, freedom)) if freedom > 0 else math.nan

    @property
    def expanded(self) -> float:
        """Expanded uncertainty: value ± this holds the true value with 95 %."""
        return self.coverage_factor * self.uncertainty


@dataclass(frozen=True, eq=False)
class CriterionResult(Immutable):
    """Verdict on one criterion.

    Attributes
    ----------
    name, unit : str
        As those of `thud.Criterion`.
    quantity : Quantity
        Value and budget.
    lower, upper : float
        Limits, which are allowed values.
    verdict : str
        ``"conforms"``, ``"does not conform"`` or ``"cannot be decided"``.
    """

    name: str
    unit: str
    quantity: Quantity
    lower: float
    upper: float
    verdict: str

    @property
    def value(self) -> float:
        """The value."""
        return self.quantity.value

    @property
    def conforms(self) -> bool:
        """Whether the criterion is met at 95 %."""
        return self.verdict == VERDICTS[0]

    @property
    def margin(self) -> float:
        """Distance of the value to the nearer limit; negative outside."""
        return min(self.value - self.lower, self.upper - self.value)

    @property
    def probability(self) -> float:
        """Probability that the true value lies within the limits (JCGM 106, 7.2)."""
        if self.quantity.upper_bound:
            return math.nan
        width, freedom = self.quantity.uncertainty, self.quantity.freedom
        if width == 0:
            return float(self.lower <= self.value <= self.upper)
        low, high = ((limit - self.value) / width for limit in (self.lower, self.upper))
        return float(student.cdf(high, freedom) - student.cdf(low, freedom))


@dataclass(frozen=True, eq=False, repr=False)
class Verdict(Displayed):
    """Verdict on a measured source.

    Attributes
    ----------
    source : str
        Source whose limits apply.
    decisions : tuple of CriterionResult
        One for each criterion, in the order of `thud.judge`.
    """

    source: LimitsSource
    decisions: tuple[CriterionResult, ...]

    @property
    def criteria(self) -> tuple[CriterionResult, ...]:
        """The decisions, as `thud.Conformity` names them."""
        return self.decisions

    @property
    def verdict(self) -> str:
        """The worst of the criteria: one that is not met outweighs one that is not decided."""
        found = {decision.verdict for decision in self.decisions}
        return next(word for word in (VERDICTS[1], VERDICTS[2], VERDICTS[0]) if word in found)

    @property
    def conforms(self) -> bool:
        """Whether all criteria are met at 95 %."""
        return self.verdict == VERDICTS[0]

    def __bool__(self) -> bool:
        """Return whether all criteria are met at 95 %."""
        return self.conforms

    def __repr__(self) -> str:
        """Return the verdict, and the criteria behind it."""
        words = [d.name for d in self.decisions if d.verdict == self.verdict]
        where = "" if self.conforms else f" in {', '.join(words)}"
        return f"<Verdict, {self.source}: {self.verdict}{where}>"

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: value, expanded uncertainty, limits, verdict."""
        rows = [("criterion", "value", "uncertainty (95 %)", "limits", "verdict")]
        for one in self.decisions:
            known = not math.isnan(one.value)
            value = f"{one.value:.4g} {one.unit}".strip() if known else "not known"
            doubt = f"{one.quantity.expanded:.2g}" if known else ""
            rows.append((one.name, value, doubt, f"{one.lower:g} to {one.upper:g}", one.verdict))
        return [*rows, ("all criteria", "", "", "", self.verdict)]


def decide(  # noqa: PLR0913 - each is one criterion of the standards
    levels: Sequence[Quantity | Estimate | float],
    *,
    contact_time: Quantity | Estimate | float = math.nan,
    restitution: Quantity | Estimate | float = math.nan,
    peaks: Quantity | Estimate | float = math.nan,
    mass: Quantity | Estimate | float = math.nan,
    drop_height: Quantity | Estimate | float = math.nan,
    source: LimitsSource = SOURCES[0],
    limits: Mapping[str, tuple[float, float]] | None = None,
) -> Verdict:
    """Return the verdict of the standards on a measured source, at 95 %.

    A criterion conforms where the value and its expanded uncertainty lie within the limits, does
    not conform where they lie outside, and cannot be decided between (guard band of the expanded
    uncertainty, JCGM 106). What is not known, NaN, cannot be decided; neither can a value whose
    uncertainty is not known. Plain numbers are exact. Levels are in dB, the others in SI units.
    The `limits`, minimum and maximum by criterion, replace those of the standards.

    Raises
    ------
    InputError
        Where the source is not known, or there are not five levels.
    """
    given = [*levels, contact_time, restitution, peaks, mass, drop_height]
    values = [_quantity(value) for value in given]
    # Names, units and limits of the library; they do not depend on values.
    zeros = np.zeros(len(levels))
    criteria = judge(zeros, 0.0, 0.0, 0, 0.0, 0.0, source).criteria
    spans = [(limits or {}).get(c.name, (c.lower, c.upper)) for c in criteria]
    return Verdict(
        source,
        tuple(
            CriterionResult(c.name, c.unit, value, *span, _verdict(value, *span))
            for c, value, span in zip(criteria, values, spans, strict=True)
        ),
    )


def average_estimates(
    estimates: Sequence[Estimate], *systematic: Contribution, own: str = "noise"
) -> Quantity:
    """Return the mean of one quantity over drops.

    Parameters
    ----------
    estimates
        Value of each drop and the standard uncertainty that differs from drop to drop; values
        that are not known are left out.
    systematic
        Contributions that all drops share, which an average does not reduce (calibration, height).
    own
        Name of the uncertainty of the drops. With two or more drops their scatter, the
        repeatability, holds it.
    """
    known = [e for e in estimates if math.isfinite(e.value)]
    if not known:
        return Quantity(math.nan)
    count = len(known)
    values = np.array([e.value for e in known])
    noise = float(np.sqrt(np.sum([e.uncertainty**2 for e in known]))) / count
    parts = [Contribution(own, noise, counted=count == 1)]
    if count > 1:
        error = float(values.std(ddof=1)) / math.sqrt(count)
        parts.insert(0, Contribution("repeatability", error, count - 1))
    return Quantity(float(values.mean()), (*parts, *systematic))


def level_quantities(
    levels: AverageLevels,
    calibration: float | None = None,
    plate: NDArray[np.float64] | None = None,
) -> tuple[Quantity, ...]:
    """Return average levels with their budgets, dB, shape (n_band,).

    Parameters
    ----------
    levels
        Average over drops.
    calibration
        Relative standard uncertainty of the force; None where it is not known.
    plate : ndarray, shape (n_band,), optional
        Standard uncertainty from the correction of the force plate, dB; zero where that of its
        resonance is not stated.
    """
    count = len(levels.names)
    shared: dict[str, NDArray[np.float64]] = {}
    if calibration is not None:
        shared["calibration"] = np.full(len(levels.level), AMPLITUDE_DECIBEL * calibration)
    if plate is not None and plate.any():
        shared["plate"] = plate
    return tuple(
        Quantity(
            float(levels.level[band]),
            tuple(_level_contributions({**levels.contributions, **shared}, band, count)),
            bool(levels.flag[band] == "background"),
        )
        for band in range(len(levels.level))
    )


def _level_contributions(
    parts: Mapping[str, NDArray[np.float64]], band: int, count: int
) -> list[Contribution]:
    """Return the contributions to the level of a band."""
    return [
        Contribution(
            name,
            float(part[band]),
            count - 1 if name == "repeatability" else math.inf,
            counted=count == 1 or name not in WITHIN_REPEATABILITY,
        )
        for name, part in parts.items()
    ]


def _quantity(value: Quantity | Estimate | float) -> Quantity:
    """Return a value as a quantity."""
    if isinstance(value, Quantity):
        return value
    if isinstance(value, int | float | np.integer | np.floating):
        return Quantity(float(value))
    if not hasattr(value, "uncertainty"):
        refuse(f"a criterion is {shown(value)}", "a number, an estimate or a quantity")
    return Quantity(float(value.value), (Contribution("estimate", float(value.uncertainty)),))


def _verdict(quantity: Quantity, lower: float, upper: float) -> str:
    """Return the verdict on a value: guard bands of the expanded uncertainty inside and outside."""
    value, expanded = quantity.value, quantity.expanded
    inside, outside, open_ = VERDICTS
    if not math.isfinite(value) or not math.isfinite(expanded):
        return open_
    below, above = value + expanded < lower, value - expanded > upper
    if quantity.upper_bound:
        return outside if below else open_
    if below or above:
        return outside
    return inside if value - expanded >= lower and value + expanded <= upper else open_
