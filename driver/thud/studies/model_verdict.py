"""Verdict over what is not known of a source: ranges, probabilities and outcomes of a model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from thud.base.display import Displayed
from thud.base.tables import csv_text, format_rows
from thud.level.assessment import VERDICTS

if TYPE_CHECKING:
    from thud.base._schema import LimitsSource
    from thud.level.assessment import Criterion
    from thud.studies.unknowns import Unknown

# File with the rows of a verdict, in SI units.
FILE = "model_verdict.csv"
# Width of an interval of a probability above which it means little.
MAX_WIDTH = 0.4
# Fraction of the distribution within the limits from which a criterion is met, and fraction of the
# distribution within the stated range.
COVERAGE = 0.95


@dataclass(frozen=True, eq=False, repr=False)
class ModelCriterion(Displayed):
    """Criterion of the standards over the unknowns of a source.

    Attributes
    ----------
    criterion : Criterion
        Value of the case, and the limits.
    low, high : float
        Range that holds at least 95 % of the distribution, with the errors of surrogate and drops.
    probability : float
        Probability that the source meets the criterion.
    probability_range : tuple of float
        Its interval (95 %): samples, surrogate, and numerical error of the drops, by their effects
        on either side.
    indices : dict of str to float
        Total Sobol index of each unknown; empty if the value does not vary.
    """

    criterion: Criterion
    low: float
    high: float
    probability: float
    probability_range: tuple[float, float]
    indices: dict[str, float]

    @property
    def name(self) -> str:
        """Name of the criterion."""
        return self.criterion.name

    @property
    def result(self) -> str:
        """``"conforms"``, ``"does not conform"`` or ``"undecided"``."""
        return _outcome(*self.probability_range)

    @property
    def main_unknown(self) -> str:
        """Unknown with the largest total index; empty if the value does not vary."""
        return max(self.indices, key=lambda key: self.indices[key], default="")

    @property
    def range(self) -> str:
        """Range in the display unit; empty if its ends are equal."""
        quantity = self.criterion.quantity
        digits = max(quantity.decimals - 1, 1)
        ends = (f"{end * quantity.display_scale:z.{digits}f}" for end in (self.low, self.high))
        low, high = ends
        return f"{low} to {high}" if low != high else ""

    def __repr__(self) -> str:
        """Return reason and result."""
        return f"<ModelCriterion, {self.reason}: {self.result}>"

    @property
    def reason(self) -> str:
        """Range, limits and unknown."""
        quantity = self.criterion.quantity
        unit = f" {quantity.display_unit}" if quantity.display_unit else ""
        value = self.range or quantity.show(self.criterion.value)
        unknown = f", main unknown: {self.main_unknown}" if self.main_unknown else ""
        return f"{quantity.title} {value}{unit}, limits {self.criterion.shown_limits}{unknown}"

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        criterion, quantity = self.criterion, self.criterion.quantity
        return [
            (
                "criterion", "value", "range (95 %)", "limits", "probability", "main unknown",
                "result",
            ),
            (
                quantity.label, quantity.show(criterion.value), self.range, criterion.shown_limits,
                _percent(*self.probability_range), self.main_unknown,
                self.result,
            ),
        ]  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class ModelVerdict(Displayed):
    """Verdict of a model over what is not known of a source.

    Attributes
    ----------
    source : str
        Source whose limits apply.
    unknowns : tuple of Unknown
        Keys that are not known, with their ranges and reasons.
    criteria : tuple of ModelCriterion
        Octave levels, contact time, restitution, number of peaks, mass, drop height.
    probability, probability_range : float and tuple of float
        Probability that the source meets all criteria, and its interval (95 %).
    method : str
        How the distribution was computed.
    warnings : tuple of str
        Probabilities that are known poorly, with the cause.
    """

    source: LimitsSource
    unknowns: tuple[Unknown, ...]
    criteria: tuple[ModelCriterion, ...]
    probability: float
    probability_range: tuple[float, float]
    method: str
    warnings: tuple[str, ...] = ()

    @property
    def result(self) -> str:
        """``"conforms"``, ``"does not conform"`` or ``"undecided"``."""
        return _outcome(*self.probability_range)

    @property
    def identity(self) -> tuple[object, ...]:
        """Everything but the values of the case, to find equal verdicts."""
        results = ((c.low, c.high, c.probability_range) for c in self.criteria)
        return self.source, self.unknowns, self.method, self.probability_range, *results

    @property
    def decisive(self) -> ModelCriterion:
        """The criterion that is met with the lowest probability."""
        return min(self.criteria, key=lambda criterion: criterion.probability)

    @property
    def shown_probability(self) -> str:
        """Interval of the probability that the source meets all criteria."""
        return _percent(*self.probability_range)

    @property
    def reason(self) -> str:
        """The result, its probability, and all criteria that do not conform or are undecided.

        If there are none, the decisive criterion.
        """
        probability = f"probability of conformity {self.shown_probability}"
        causes = [c for c in self.criteria if c.result != VERDICTS[0]] or [self.decisive]
        causes.sort(key=lambda criterion: criterion.probability)
        return f"{self.result} ({probability}): {'; '.join(c.reason for c in causes)}"

    @property
    def message(self) -> str:
        """The reason in a sentence of its own."""
        return f"Verdict over what is not known: {self.reason}"

    def __repr__(self) -> str:
        """Return the result and its probability."""
        return f"<ModelVerdict, {self.source}: {self.result} ({self.probability:.0%})>"

    def __str__(self) -> str:
        """Return unknowns, criteria, method and result as text."""
        tables = format_rows(self.unknown_rows()), "", format_rows(self.rows())
        return "\n".join((*tables, f"by {self.method}", self.message))

    def to_csv(self) -> str:
        """Return the criteria as CSV, SI units, levels in dB; the last row is that of all."""
        columns = (
            "criterion", "unit", "value", "low", "high", "lower_limit", "upper_limit",
            "probability_low", "probability_high", "main_unknown", "result",
        )  # fmt: skip
        rows: list[tuple[object, ...]] = [columns]
        for entry in self.criteria:
            criterion = entry.criterion
            rows.append((
                criterion.name, criterion.unit, criterion.value, entry.low, entry.high,
                criterion.lower, criterion.upper, *entry.probability_range, entry.main_unknown,
                entry.result,
            ))  # fmt: skip
        ends = (*self.probability_range, self.decisive.main_unknown, self.result)
        return csv_text([*rows, ("all", *("",) * 6, *ends)])

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        header = self.criteria[0].rows()[0]
        return [
            header,
            *(criterion.rows()[1] for criterion in self.criteria),
            (
                "all criteria",
                "",
                "",
                "",
                self.shown_probability,
                self.decisive.main_unknown,
                self.result,
            ),
        ]

    def unknown_rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: the unknowns."""
        rows: list[tuple[str, ...]] = [("not known", "low", "high", "standard deviation", "reason")]
        for entry in self.unknowns:
            unit, size = entry.shown_unit
            low, high = (f"{end / size:g}" for end in (entry.low, entry.high))
            deviation = entry.standard_deviation / size
            label = f"{entry.key}, {unit}".removesuffix(", ")
            rows.append((label, low, high, f"{deviation:g}" if deviation else "", entry.reason))
        return rows


def _outcome(low: float, high: float) -> str:
    if low >= COVERAGE:
        return VERDICTS[0]
    return VERDICTS[1] if high <= 1 - COVERAGE else VERDICTS[2]


def _percent(low: float, high: float) -> str:
    """Return an interval of a probability in percent.

    >>> _percent(0.85, 0.881)
    '85 to 88 %'
    """
    ends = dict.fromkeys(f"{100 * end:.0f}" for end in (low, high))
    return f"{' to '.join(ends)} %"
