"""Assessment of a source over what is not known of it: by surrogates, or by drops of its model."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import refuse, require_kind
from thud.base.errors import InputError
from thud.case.case import Case, check_case
from thud.case.keys import value_in, with_values
from thud.impact.compute import compute
from thud.impact.ensemble import get_cost, solve_many
from thud.level.levels import peak_count
from thud.studies.bundled_surrogate import bundled_surrogate, find_unknowns
from thud.studies.model_verdict import COVERAGE, ModelCriterion, ModelVerdict
from thud.studies.trained_surrogate import keys_of
from thud.studies.unknowns import blocked_case

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from thud.impact.impact import Impact
    from thud.studies.trained_surrogate import Surrogate
    from thud.studies.unknowns import Unknown

    Values = NDArray[np.float64]

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
    """Return the verdict over what is not known of an impact, by the bundled surrogate.

    None if nothing is known to vary, or the bundled surrogate does not cover the case or differs
    from the impact.
    """
    return assess_impacts({"": impact}).get("")


def assess_impacts(impacts: Mapping[str, Impact]) -> dict[str, ModelVerdict]:
    """Return the verdicts of `assess_impact` by name; cases that differ in unknowns share one."""
    result: dict[str, ModelVerdict] = {}
    verdicts: dict[object, ModelVerdict] = {}
    for name, impact in impacts.items():
        unknowns, covered = find_unknowns(impact.case)
        if not covered:
            continue
        same = with_values(covered, {u.key: u.low for u in unknowns})
        source = unknowns, covered.limits.source, *keys_of(same).items()
        with suppress(SurrogateError):
            if source not in verdicts:
                verdicts[source] = _by_bundled_surrogate(impact, covered, unknowns)
            result[name] = verdicts[source]
    return result


def _by_bundled_surrogate(
    impact: Impact, covered: Case, unknowns: tuple[Unknown, ...]
) -> ModelVerdict:
    return _surrogate_source(impact, covered, unknowns, bundled_surrogate()).assess()


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
    unknowns, covered = find_unknowns(case)
    if not unknowns:
        refuse(
            f"{case.name}: nothing is known to vary in this case",
            "&unknowns with key, low, high and reason, or a standard ball by finite elements",
        )
    blocked = blocked_case(case, unknowns)
    impact = compute(blocked)
    reason = ""
    if covered:
        try:
            return _by_bundled_surrogate(impact, covered, unknowns)
        except SurrogateError as error:
            reason = f"; not by the bundled surrogate: {error}"
    count = SAMPLES + INDEX_SAMPLES * len(unknowns)
    if get_cost(blocked, [u.key for u in unknowns]) * count <= _DIRECT_TIME:
        source = _direct_source(impact, unknowns, progress=progress)
    else:
        trained = _train(blocked, unknowns, output, progress=progress, replace_files=replace_files)
        source = _surrogate_source(impact, blocked, unknowns, trained)
    source.method += reason
    return source.assess()


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
