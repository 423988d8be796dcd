"""Verdict over what is not known of a source: ranges, probabilities and outcomes of a model."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import refuse, require_kind
from thud.base.display import Displayed
from thud.base.errors import InputError
from thud.case.case import Case, check_case
from thud.case.keys import value_in, with_values
from thud.impact.compute import compute
from thud.impact.ensemble import get_cost, solve_many
from thud.level.levels import peak_count
from thud.studies.held_surrogate import covered_case, get_unknowns, held_surrogate, is_covered
from thud.studies.trained_surrogate import keys_of
from thud.studies.unknowns import blocked_case

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from numpy.typing import NDArray

    from thud.base._schema import LimitsSource
    from thud.impact.impact import Impact
    from thud.level.assessment import Criterion
    from thud.studies.trained_surrogate import Surrogate
    from thud.studies.unknowns import Unknown

    Values = NDArray[np.float64]

OUTCOMES = ("conforms", "does not conform", "undecided by the model")
# Fraction of the distribution within the limits from which a criterion is met, and fraction of the
# distribution within the stated range.
COVERAGE = 0.95
# Number of samples of the distribution, and number of base samples of the Sobol indices.
SAMPLES = 4096
INDEX_SAMPLES = 512
_SEED = 0
# Drops take at most this time, s on one core; slower models get a surrogate.
_DIRECT_TIME = 60.0
# A surrogate of a drop farther off than this many of its errors belongs to another model.
_MAX_DEVIATION = 3.0
# Training of other surrogates: maximum error, dB, which widens the ranges, and number of drops.
_TRAINING = {"error": 1.0, "size": 1024}
# Quantile of the normal distribution for a two-sided interval of 95 %.
_FACTOR = 1.96


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
    error : float
        Error of the probability (95 %): samples, surrogate, and numerical error of the drops.
    indices : dict of str to float
        Total Sobol index of each unknown; empty if the value does not vary.
    """

    criterion: Criterion
    low: float
    high: float
    probability: float
    error: float
    indices: dict[str, float]

    @property
    def name(self) -> str:
        """Name of the criterion."""
        return self.criterion.name

    @property
    def result(self) -> str:
        """``"conforms"``, ``"does not conform"`` or ``"undecided by the model"``."""
        return _outcome(self.probability, self.error)

    @property
    def hangs_on(self) -> str:
        """Unknown with the largest total index; empty if the value does not vary."""
        return max(self.indices, key=lambda key: self.indices[key], default="")

    @property
    def range(self) -> str:
        """Range in the display unit; empty if the value does not vary."""
        if not self.indices:
            return ""
        quantity = self.criterion.quantity
        digits = max(quantity.decimals - 1, 1)
        ends = (f"{end * quantity.display_scale:z.{digits}f}" for end in (self.low, self.high))
        return " to ".join(ends)

    def __repr__(self) -> str:
        """Return reason and result."""
        return f"<ModelCriterion, {self.reason}: {self.result}>"

    @property
    def reason(self) -> str:
        """Range, limits and unknown."""
        quantity = self.criterion.quantity
        unit = f" {quantity.display_unit}" if quantity.display_unit else ""
        value = self.range or quantity.show(self.criterion.value)
        hanging = f", hangs on {self.hangs_on}" if self.hangs_on else ""
        return f"{quantity.title} {value}{unit}, limits {self.criterion.shown_limits}{hanging}"

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        criterion, quantity = self.criterion, self.criterion.quantity
        return [
            ("criterion", "value", "range (95 %)", "limits", "probability", "hangs on", "result"),
            (
                quantity.label, quantity.show(criterion.value), self.range, criterion.shown_limits,
                _percent(self.probability, self.error), self.hangs_on, self.result,
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
    probability, error : float
        Probability that the source meets all criteria, and its error (95 %).
    method : str
        How the distribution was computed.
    """

    source: LimitsSource
    unknowns: tuple[Unknown, ...]
    criteria: tuple[ModelCriterion, ...]
    probability: float
    error: float
    method: str

    @property
    def result(self) -> str:
        """``"conforms"``, ``"does not conform"`` or ``"undecided by the model"``."""
        return _outcome(self.probability, self.error)

    @property
    def decisive(self) -> ModelCriterion:
        """The criterion that is met with the lowest probability."""
        return min(self.criteria, key=lambda criterion: criterion.probability)

    @property
    def share(self) -> str:
        """Probability that the source meets all criteria, with its error."""
        return _percent(self.probability, self.error)

    @property
    def reason(self) -> str:
        """The result, its probability, and the decisive criterion."""
        return f"{self.result} ({self.share} of it conforms): {self.decisive.reason}"

    @property
    def sentence(self) -> str:
        """The reason in a sentence of its own."""
        return f"Verdict over what is not known: {self.reason}"

    def __repr__(self) -> str:
        """Return the result and its probability."""
        return f"<ModelVerdict, {self.source}: {self.result} ({self.probability:.0%})>"

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        header = self.criteria[0].rows()[0]
        return [
            header,
            *(criterion.rows()[1] for criterion in self.criteria),
            ("all criteria", "", "", "", self.share, self.decisive.hangs_on, self.result),
        ]

    def unknown_rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: the unknowns."""
        rows: list[tuple[str, ...]] = [("not known", "low", "high", "standard deviation", "reason")]
        for entry in self.unknowns:
            deviation = f"{entry.standard_deviation:g}" if entry.standard_deviation else ""
            rows.append((entry.key, f"{entry.low:g}", f"{entry.high:g}", deviation, entry.reason))
        return rows


def _outcome(probability: float, error: float) -> str:
    if probability - error >= COVERAGE:
        return OUTCOMES[0]
    return OUTCOMES[1] if probability + error <= 1 - COVERAGE else OUTCOMES[2]


def _percent(probability: float, error: float) -> str:
    half = f" ± {100 * error:.0f}" if 100 * error >= 0.5 else ""  # noqa: PLR2004 - rounds to 0
    return f"{100 * probability:.0f}{half} %"


class _Source:
    """Values of all criteria for values of the unknowns."""

    def __init__(
        self,
        impact: Impact,
        unknowns: tuple[Unknown, ...],
        evaluate: Callable[[dict[str, Values]], Values],
        method: str,
        residuals: Values | None = None,
    ) -> None:
        self.verdict = impact.assess()
        self.unknowns = unknowns
        self.evaluate = evaluate
        self.method = method
        # These begin with octave levels, contact time and restitution.
        count = len(self.verdict.criteria)
        # Errors of the values relative to a drop: one row for each held-out drop.
        self.residuals = np.zeros((1, count)) if residuals is None else residuals
        errors = impact.numerical_error
        numerical = np.zeros(count)
        numerical[:7] = [*errors.level, errors.contact_time, errors.restitution]
        if np.isnan(numerical).any():
            self.method += "; the numerical error of the drops is unknown and not included"
        self.numerical = np.nan_to_num(numerical)
        self.start = {u.key: _number(impact.case, u.key) for u in unknowns}

    def values(self, fractions: Values) -> Values:
        """Return the criteria at quantiles of the unknowns, shape (n, n_criterion)."""
        columns = {
            u.key: u.quantiles(fractions[:, i], self.start[u.key])
            for i, u in enumerate(self.unknowns)
        }
        return self.evaluate(columns)

    def assess(self) -> ModelVerdict:
        """Return the verdict."""
        random = np.random.default_rng(_SEED)
        dimension = len(self.unknowns)
        fractions = random.random((SAMPLES, dimension))
        values = self.values(fractions)
        rows = random.integers(len(self.residuals), size=SAMPLES)
        noise = self.numerical * random.standard_normal(values.shape)
        actual = values + self.residuals[rows] + noise
        # The errors may also be common to all samples.
        spread = np.sqrt(np.mean(self.residuals**2, axis=0) + self.numerical**2)
        criteria = self.verdict.criteria
        lower = np.array([criterion.lower for criterion in criteria])
        upper = np.array([criterion.upper for criterion in criteria])
        margins = np.minimum(values - lower, upper - values)
        inside = (actual >= lower) & (actual <= upper)
        adverse, favorable = margins >= spread, margins >= -spread
        indices = self._indices(fractions, values)
        # The range holds at least the stated fraction in spite of the finite number of samples.
        coverage = COVERAGE + _FACTOR * math.sqrt(COVERAGE * (1 - COVERAGE) / SAMPLES)
        low, high = np.quantile(actual, [(1 - coverage) / 2, (1 + coverage) / 2], axis=0)
        low, high = low - spread, high + spread
        return ModelVerdict(
            self.verdict.source,
            self.unknowns,
            tuple(
                ModelCriterion(
                    criterion,
                    float(low[i]),
                    float(high[i]),
                    *_probability(inside[:, i], adverse[:, i], favorable[:, i]),
                    indices[i],
                )
                for i, criterion in enumerate(criteria)
            ),
            *_probability(*(np.asarray(p.all(axis=1)) for p in (inside, adverse, favorable))),
            self.method,
        )

    def _indices(self, fractions: Values, values: Values) -> list[dict[str, float]]:
        """Return the total Sobol indices of each criterion (Jansen's estimator).

        `thud.studies.sensitivity` needs SALib, which a plain installation does not have.
        """
        half = SAMPLES // 2
        first, second = fractions[:INDEX_SAMPLES], fractions[half : half + INDEX_SAMPLES]
        variance = values.var(axis=0)
        varies = variance > 1e-20 * np.maximum(1.0, values.mean(axis=0) ** 2)  # not rounding errors
        result: list[dict[str, float]] = [{} for _ in self.verdict.criteria]
        for j, unknown in enumerate(self.unknowns):
            mixed = first.copy()
            mixed[:, j] = second[:, j]
            change = np.mean((values[:INDEX_SAMPLES] - self.values(mixed)) ** 2, axis=0) / 2
            for i in np.flatnonzero(varies):
                result[i][unknown.key] = float(change[i] / variance[i])
        return result


def _probability(
    inside: NDArray[np.bool_], adverse: NDArray[np.bool_], favorable: NDArray[np.bool_]
) -> tuple[float, float]:
    """Return the fraction of samples that conform, and its error (95 %)."""
    probability = float(inside.mean())
    sampling = _FACTOR * math.sqrt(probability * (1 - probability) / len(inside))
    systematic = float(favorable.mean() - adverse.mean()) / 2
    return probability, math.hypot(sampling, systematic)


def _number(case: Case, key: str) -> float:
    return float(value_in(case, key) or 0.0)


def _predicted(surrogate: Surrogate, case: Case, columns: dict[str, Values]) -> Values:
    """Return the criteria of drops by a surrogate, shape (n, n_criterion)."""
    result = surrogate.predict(case, dict(columns))
    count = len(result["status"])
    others = [result[name] for name in ("contact_time", "restitution")]
    others.append(np.array([float(surrogate.peaks)]))
    others += [_column(case, columns, name) for name in ("mass", "height")]
    return np.column_stack(
        [
            result[f"{case.levels.force}_level"],
            *(np.broadcast_to(np.asarray(part, dtype=float), count) for part in others),
        ]
    )


def _column(case: Case, columns: dict[str, Values], name: str) -> Any:  # noqa: ANN401 - or arrays
    return columns[name] if name in columns else _number(case, name)


def _surrogate_source(
    impact: Impact, case: Case, unknowns: tuple[Unknown, ...], surrogate: Surrogate
) -> _Source:
    """Return a source by a surrogate. Raises SurrogateError if it does not reproduce the drop."""
    start = {u.key: np.array([_number(case, u.key)]) for u in unknowns}
    center = _predicted(surrogate, case, start)[0]
    scale = np.ones(len(center))
    # Residuals of levels are differences, those of other quantities ratios, in dB.
    scale[5:7] = center[5:7] * math.log(10) / 20
    names = (f"{case.levels.force}_level", "contact_time", "restitution")
    residuals = np.zeros((len(surrogate.points), len(center)))
    errors = np.zeros(len(center))
    residuals[:, :7] = -np.column_stack([surrogate.residuals_of(name) for name in names])
    errors[:7] = np.concatenate([surrogate.error_of(name) for name in names])
    source = _Source(
        impact,
        unknowns,
        lambda columns: _predicted(surrogate, case, columns),
        surrogate.accuracy,
        residuals * scale,
    )
    values = np.array([criterion.value for criterion in source.verdict.criteria])
    allowed = _MAX_DEVIATION * (errors * scale + source.numerical)
    if not (np.abs(values - center) <= allowed + 1e-9 * np.abs(values)).all():
        i = int(np.argmax(np.abs(values - center) - allowed))
        message = (
            f"the surrogate predicts {source.verdict.criteria[i].name} = {center[i]:.4g} for a "
            f"drop with {values[i]:.4g}; allowed: a surrogate trained on drops of this model"
        )
        raise SurrogateError(message)
    return source


class SurrogateError(InputError):
    """A surrogate that does not reproduce a drop: that of another model or ball."""


def assess_impact(impact: Impact) -> ModelVerdict | None:
    """Return the verdict over what is not known of an impact, by the held surrogate.

    None if nothing is known to vary, or the held surrogate does not cover the case or differs from
    the impact.
    """
    unknowns = get_unknowns(impact.case)
    if not unknowns or not is_covered(impact.case, unknowns):
        return None
    try:
        return _by_held_surrogate(impact, unknowns).assess()
    except SurrogateError:
        return None


def same_source(first: Case, second: Case) -> bool:
    """Return whether the held surrogate covers two cases, and they differ in unknowns only."""
    unknowns = get_unknowns(first)
    if not unknowns or unknowns != get_unknowns(second) or first.limits != second.limits:
        return False
    low = {u.key: u.low for u in unknowns}
    try:
        keys = [keys_of(with_values(covered_case(c, unknowns), low)) for c in (first, second)]
    except InputError:
        return False
    return keys[0] == keys[1]


def _by_held_surrogate(impact: Impact, unknowns: tuple[Unknown, ...]) -> _Source:
    case = covered_case(impact.case, unknowns)
    return _surrogate_source(impact, case, unknowns, held_surrogate())


def assess(
    case: Case,
    output: str | os.PathLike[str] | None = None,
    *,
    progress: bool = False,
    replace_files: bool = False,
) -> ModelVerdict:
    """Assess a source over what is not known of it.

    The unknowns are those of ``Case.unknowns``; a standard ball by finite elements without them has
    documented defaults (docs/verdict.md). Near the standard ball a surrogate of the package
    predicts the drops. Elsewhere drops of fast models are computed, and slow models get a
    surrogate.

    Parameters
    ----------
    case
        The case; its drop on the rigid floor is assessed.
    output
        Directory that keeps the training drops of a surrogate, so that an interrupted training
        continues there.
    progress
        Show a progress bar.
    replace_files
        Also replace files in `output` that were not written by thud.

    Raises
    ------
    InputError
        If nothing is known to vary, drops have no results, or a surrogate cannot be trained.
    NumericalError
        If the errors of a trained surrogate are too large.
    """
    require_kind("case", case, Case)
    check_case(case)
    unknowns = get_unknowns(case)
    if not unknowns:
        refuse(
            f"{case.name}: nothing is known to vary in this case",
            "&unknowns with key, low, high and reason, or a standard ball by finite elements",
        )
    blocked = blocked_case(case, unknowns)
    impact = compute(blocked)
    if is_covered(case, unknowns):
        with suppress(SurrogateError):
            return _by_held_surrogate(impact, unknowns).assess()
    count = SAMPLES + INDEX_SAMPLES * len(unknowns)
    if get_cost(blocked, [u.key for u in unknowns]) * count <= _DIRECT_TIME:
        return _direct_source(impact, unknowns, progress=progress).assess()
    surrogate = _train(blocked, unknowns, output, progress=progress, replace_files=replace_files)
    return _surrogate_source(impact, blocked, unknowns, surrogate).assess()


def _direct_source(impact: Impact, unknowns: tuple[Unknown, ...], *, progress: bool) -> _Source:
    """Return a source by drops of its model."""
    case = impact.case

    def evaluate(columns: dict[str, Values]) -> Values:
        result = solve_many(columns, case, forces=True, progress=progress)
        failed = result.status != 0
        if failed.any():
            reason = result.reason[failed][0]
            refuse(
                f"{failed.sum()} of {failed.size} drops have no result ({reason})",
                "ranges of &unknowns in which all drops have results",
            )
        assessed = case.levels.force
        forces = result.elastic_force if assessed == "elastic" else result.floor_force
        assert forces is not None  # noqa: S101 - `forces` was asked for
        others = [_column(case, columns, name) for name in ("mass", "height")]
        peaks = [peak_count(force, result.sample_rate) for force in forces]
        return np.column_stack(
            [
                result.levels[assessed, "octave"], result.contact_time, result.restitution, peaks,
                *(np.broadcast_to(other, len(peaks)) for other in others),
            ]
        )  # fmt: skip

    return _Source(impact, unknowns, evaluate, f"{SAMPLES} drops")


def _train(
    case: Case,
    unknowns: tuple[Unknown, ...],
    output: str | os.PathLike[str] | None,
    *,
    progress: bool,
    replace_files: bool,
) -> Surrogate:
    """Return a surrogate over the ranges of the unknowns, trained or read from a directory."""
    from thud.studies.surrogate import surrogate

    study = {
        "name": f"{case.name}_unknowns",
        "case": replace(case, name=f"{case.name}_unknowns").to_namelist(),
        "surrogate": _TRAINING,
        "parameters": {u.key: {"low": u.low, "high": u.high} for u in unknowns},
    }
    return surrogate(study, output, progress=progress, replace=replace_files)
