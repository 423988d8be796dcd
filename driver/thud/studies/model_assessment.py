"""Assessment of a source over what is not known of it: by surrogates, or by drops of its model."""

from __future__ import annotations

import math
import sys
import time
from contextlib import suppress
from dataclasses import replace
from itertools import islice, product
from typing import TYPE_CHECKING, Any

import numpy as np
from tqdm import tqdm

from thud.base.checks import refuse, require_kind
from thud.base.errors import InputError, ThudError
from thud.case.case import Case, check_case
from thud.case.keys import value_in, with_values
from thud.impact.compute import compute
from thud.impact.ensemble import get_cost, solve_many
from thud.impact.impact import Impact
from thud.level.estimate import NORMAL_FACTOR
from thud.level.levels import peak_count
from thud.studies.bundled_surrogate import (
    bundled_surrogate,
    find_unknowns,
    reason_without_defaults,
)
from thud.studies.model_verdict import COVERAGE, MAX_WIDTH, ModelCriterion, ModelVerdict
from thud.studies.trained_surrogate import ERROR_DROPS
from thud.studies.unknowns import blocked_case

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

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
# Deviation that no other model has by chance, dB.
_NEGLIGIBLE = 0.01
# Training of other surrogates: maximum error, dB, which widens the ranges, and number of drops.
_TRAINING = {"error": 1.0, "size": 1024}
# Number of criteria that are computed: octave levels, contact time and restitution; the last two
# have relative residuals.
_COMPUTED = 7
_RELATIVE = slice(5, 7)
# Maximum size of the forces of direct drops in memory.
_MAX_BYTES = 64e6
# Maximum number of combinations of minima and maxima that are checked.
_MAX_CORNERS = 256
# Causes of poorly known probabilities, and what helps.
_SURROGATE = "the error of the surrogate, {}: compute drops instead (thud-driver uncertainty)"
_NUMERICAL = "the numerical error of the drops, {}: refine &mesh or &sampling"


class _Source:
    """Values of all criteria for values of the unknowns.

    `numerical_errors` are those of some drops, see `Surrogate`. `residuals` are errors of the
    values relative to a drop, one row for each held-out drop: of levels in dB, of contact time and
    restitution relative.
    """

    def __init__(  # noqa: PLR0913, PLR0917 - all differ between surrogates and drops
        self,
        impact: Impact,
        unknowns: tuple[Unknown, ...],
        evaluate: Callable[[dict[str, Values]], Values],
        method: str,
        numerical_errors: Values,
        residuals: Values | None = None,
    ) -> None:
        self.verdict = impact.assess()
        self.unknowns = unknowns
        self.evaluate = evaluate
        self.method = method
        if np.isnan(numerical_errors).any():
            self.method += "; the numerical error of the drops is unknown and not included"
        count = len(self.verdict.criteria)
        # The criteria begin with octave levels, contact time and restitution.
        self.numerical_errors = np.zeros((len(numerical_errors), count))
        self.numerical_errors[:, :_COMPUTED] = np.nan_to_num(numerical_errors)
        self.residuals = np.zeros((1, count)) if residuals is None else residuals
        self.start = {u.key: _number(impact.case, u.key) for u in unknowns}

    def values(self, fractions: Values) -> Values:
        """Return the criteria at quantiles of the unknowns, shape (n, n_criterion)."""
        return self.evaluate(_columns(self.unknowns, fractions, self.start))

    def assess(self) -> ModelVerdict:
        """Return the verdict."""
        random = np.random.default_rng(_SEED)
        fractions = random.random((SAMPLES, len(self.unknowns)))
        values = self.values(fractions)
        scale = np.ones(values.shape)
        scale[:, _RELATIVE] = values[:, _RELATIVE]
        rows = random.integers(len(self.residuals), size=SAMPLES)
        residual = self.residuals[rows] * scale
        rows = random.integers(len(self.numerical_errors), size=SAMPLES)
        # The numerical errors hold for 95 % of the drops.
        noise = self.numerical_errors[rows] / NORMAL_FACTOR * random.standard_normal(values.shape)
        actual = values + residual + noise
        # The errors may also be common to all samples; few numerical errors are far above others.
        parts = {
            _SURROGATE: np.sqrt(np.mean(self.residuals**2, axis=0)) * scale,
            _NUMERICAL: np.median(self.numerical_errors, axis=0) * np.ones(scale.shape),
        }
        spread = np.hypot(*parts.values())
        criteria = self.verdict.criteria
        lower = np.array([criterion.lower for criterion in criteria])
        upper = np.array([criterion.upper for criterion in criteria])
        margins = np.minimum(values - lower, upper - values)
        inside = (actual >= lower) & (actual <= upper)
        adverse, favorable = margins >= spread, margins >= -spread
        indices = self._indices(fractions, values)
        # The range holds at least the stated fraction in spite of the finite number of samples.
        coverage = COVERAGE + NORMAL_FACTOR * math.sqrt(COVERAGE * (1 - COVERAGE) / SAMPLES)
        ends = (1 - coverage) / 2, (1 + coverage) / 2
        low, high = np.quantile(actual, ends, axis=0)
        low, high = low - spread.mean(axis=0), high + spread.mean(axis=0)
        assessed = tuple(
            ModelCriterion(
                criterion,
                float(low[i]),
                float(high[i]),
                *_probability(inside[:, i], adverse[:, i], favorable[:, i]),
                indices[i],
            )
            for i, criterion in enumerate(criteria)
        )
        sizes = {cause: part.mean(axis=0) for cause, part in parts.items()}
        return ModelVerdict(
            self.verdict.source,
            self.unknowns,
            assessed,
            *_probability(*(np.asarray(p.all(axis=1)) for p in (inside, adverse, favorable))),
            self.method,
            _warnings(assessed, sizes),
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


def _warnings(criteria: tuple[ModelCriterion, ...], sizes: dict[str, Values]) -> tuple[str, ...]:
    """Return warnings on probabilities that are known poorly, with the largest error by cause."""
    result = []
    for i, criterion in enumerate(criteria):
        low, high = criterion.probability_range
        if high - low <= MAX_WIDTH:
            continue
        cause = max(sizes, key=lambda name: float(sizes[name][i]))
        quantity = criterion.criterion.quantity
        size = f"{sizes[cause][i] * quantity.display_scale:.2g} {quantity.display_unit}".rstrip()
        result.append(
            f"{quantity.title}: the probability is {100 * low:.0f} to {100 * high:.0f} %, so wide "
            f"mainly because of {cause.format(size)}"
        )
    return tuple(result)


def _probability(
    inside: NDArray[np.bool_], adverse: NDArray[np.bool_], favorable: NDArray[np.bool_]
) -> tuple[float, tuple[float, float]]:
    """Return the fraction of samples that conform, and its interval (95 %)."""
    probability = float(inside.mean())
    sampling = NORMAL_FACTOR * math.sqrt(probability * (1 - probability) / len(inside))
    low = probability - math.hypot(sampling, max(probability - float(adverse.mean()), 0.0))
    high = probability + math.hypot(sampling, max(float(favorable.mean()) - probability, 0.0))
    return probability, (max(low, 0.0), min(high, 1.0))


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


def _columns(
    unknowns: tuple[Unknown, ...], fractions: Values, start: dict[str, float]
) -> dict[str, Values]:
    """Return the values of unknowns at their quantiles, around values of the case."""
    return {u.key: u.quantiles(fractions[:, i], start[u.key]) for i, u in enumerate(unknowns)}


def _column(case: Case, columns: dict[str, Values], name: str) -> Any:  # noqa: ANN401 - or arrays
    return columns[name] if name in columns else _number(case, name)


def _surrogate_source(
    impact: Impact, case: Case, unknowns: tuple[Unknown, ...], surrogate: Surrogate
) -> _Source:
    """Return a source by a surrogate. Raises SurrogateError if it does not reproduce the drop."""
    start = {u.key: np.array([_number(case, u.key)]) for u in unknowns}
    center = _predicted(surrogate, case, start)[0]
    # Residuals of levels are differences, those of other quantities ratios, in dB.
    scale = np.ones(_COMPUTED)
    scale[_RELATIVE] = math.log(10) / 20
    names = (f"{case.levels.force}_level", "contact_time", "restitution")
    residuals = np.zeros((len(surrogate.points), len(center)))
    residuals[:, :_COMPUTED] = -scale * np.column_stack([surrogate.residuals_of(n) for n in names])
    source = _Source(
        impact,
        unknowns,
        lambda columns: _predicted(surrogate, case, columns),
        surrogate.accuracy,
        surrogate.numerical_errors,
        residuals,
    )
    values = np.array([criterion.value for criterion in source.verdict.criteria])
    allowed = np.zeros(len(center))
    scale[_RELATIVE] *= center[_RELATIVE]
    errors = scale * np.concatenate([surrogate.error_of(name) for name in names])
    allowed[:_COMPUTED] = _MAX_DEVIATION * (errors + np.nan_to_num(impact.numerical_error.assessed))
    allowed[:_COMPUTED] += _NEGLIGIBLE * scale
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
    """Return the verdicts of `assess_impact` by name; impacts with equal verdicts share one."""
    result: dict[str, ModelVerdict] = {}
    verdicts: dict[object, ModelVerdict] = {}
    for name, impact in impacts.items():
        unknowns, covered = find_unknowns(impact.case)
        if covered:
            with suppress(SurrogateError):
                verdict = _by_bundled_surrogate(impact, covered, unknowns)
                result[name] = verdicts.setdefault(verdict.identity, verdict)
    return result


def _by_bundled_surrogate(
    impact: Impact, covered: Case, unknowns: tuple[Unknown, ...]
) -> ModelVerdict:
    return _surrogate_source(impact, covered, unknowns, bundled_surrogate()).assess()


def assess(
    case: Case | Impact,
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
        The case, or an impact of it; its drop on the rigid floor is assessed.
    output
        Directory that keeps the training drops of a surrogate, so that an interrupted training
        continues there.
    progress
        Show the estimated time of longer computations, and a progress bar.
    replace_files
        Also replace files in `output` that were not written by thud.

    Raises
    ------
    InputError
        If nothing is known to vary, an unknown has no effect, drops have no results, or a surrogate
        cannot be trained.
    NumericalError
        If the errors of a trained surrogate are too large.
    """
    require_kind("case", case, Case | Impact)
    if isinstance(case, Impact):
        case = case.case
    check_case(case)
    unknowns, covered = find_unknowns(case)
    if not unknowns:
        refuse(
            "nothing is known to vary in this case: it is not the standard ball of the default "
            f"unknowns ({reason_without_defaults(case)})",
            "&unknowns with key, low, high and reason, or a standard ball by finite elements",
        )
    blocked = blocked_case(case, unknowns)
    _check_corners(blocked, unknowns)
    impact = compute(blocked)
    reason = ""
    if covered:
        try:
            return _by_bundled_surrogate(impact, covered, unknowns)
        except SurrogateError as error:
            reason = f"; not by the bundled surrogate: {error}"
    _check_ends(blocked, unknowns)
    seconds = _direct_time(blocked, unknowns)
    if seconds <= _DIRECT_TIME:
        source = _direct_source(impact, unknowns, progress=progress)
    else:
        if progress:
            # The estimated time is that of all direct drops.
            minutes = seconds / _drop_count(unknowns) * _TRAINING["size"] / 60
            tqdm.write(
                f"up to {_TRAINING['size']} drops train a surrogate: up to an estimated "
                f"{minutes:.2g} min on one core",
                file=sys.stderr,
            )
        trained = _train(blocked, unknowns, output, progress=progress, replace_files=replace_files)
        source = _surrogate_source(impact, blocked, unknowns, trained)
    source.method += reason
    return source.assess()


def _check_corners(case: Case, unknowns: tuple[Unknown, ...]) -> None:
    """Raise InputError if a combination of minima and maxima is not allowed, without drops."""
    for unknown in unknowns:
        value = _number(case, unknown.key)
        if not unknown.low <= value <= unknown.high:
            refuse(
                f"&unknowns: {unknown.key} = {value:g} of the drop is outside low = "
                f"{unknown.low:g} and high = {unknown.high:g}",
                "a range with the value of the case; Kelvin-Voigt damping is order 1",
            )
    ends = [(unknown.low, unknown.high) for unknown in unknowns]
    for corner in islice(product(*ends), _MAX_CORNERS):
        values = dict(zip((u.key for u in unknowns), corner, strict=True))
        try:
            check_case(with_values(case, values))
        except InputError as error:
            listed = ", ".join(f"{key} = {value:g}" for key, value in values.items())
            refuse(
                f"&unknowns: {listed} are impossible ({str(error).replace('; allowed: ', ', ')})",
                "ranges in which all drops have results",
                error,
            )


def _check_ends(case: Case, unknowns: tuple[Unknown, ...]) -> None:
    """Raise InputError if an unknown has no effect or no drop at an end of its range."""
    for unknown in unknowns:
        values: list[list[float]] = []
        for end in (unknown.low, unknown.high):
            try:
                drop = compute(with_values(case, {unknown.key: end}))
            except ThudError as error:
                refuse(
                    f"&unknowns: {unknown.key} = {end:g} has no drop "
                    f"({str(error).replace('; allowed: ', ', ')})",
                    "ranges in which all drops have results",
                    error,
                )
            values.append([criterion.value for criterion in drop.assess().criteria])
        low, high = values
        if np.allclose(low, high, rtol=1e-12, atol=0.0, equal_nan=True):
            refuse(
                f"&unknowns: {unknown.key} = {unknown.low:g} and {unknown.high:g} make the same "
                "drop: this model does not use it",
                "keys that change the drop of the case",
            )


def _direct_time(case: Case, unknowns: tuple[Unknown, ...]) -> float:
    """Return the estimated time of all direct drops, s; a few drops check the estimate."""
    count = _drop_count(unknowns)
    estimate = get_cost(case, [u.key for u in unknowns]) * count
    if estimate > _DIRECT_TIME:
        return estimate
    trial = 8
    columns = _random_columns(case, unknowns, trial)
    # Time of the processor: other programs do not change the method.
    start = time.process_time()
    solve_many(columns, case, forces=True)
    return max(estimate, (time.process_time() - start) / trial * count)


def _drop_count(unknowns: tuple[Unknown, ...]) -> int:
    return SAMPLES + INDEX_SAMPLES * len(unknowns)


def _random_columns(case: Case, unknowns: tuple[Unknown, ...], count: int) -> dict[str, Values]:
    """Return random values of the unknowns, shape (count,) each."""
    fractions = np.random.default_rng(_SEED).random((count, len(unknowns)))
    return _columns(unknowns, fractions, {u.key: _number(case, u.key) for u in unknowns})


def _direct_source(impact: Impact, unknowns: tuple[Unknown, ...], *, progress: bool) -> _Source:
    """Return a source by drops of its model."""
    case = impact.case
    length = case.sampling.sample_rate * case.sampling.duration
    block_size = max(1, int(_MAX_BYTES / (16 * length)))

    def evaluate(columns: dict[str, Values]) -> Values:
        count = len(next(iter(columns.values())))
        blocks = []
        with tqdm(total=count, unit="drop", disable=not progress, leave=False) as bar:
            for start in range(0, count, block_size):
                block = {n: v[start : start + block_size] for n, v in columns.items()}
                blocks.append(_solved(case, block))
                bar.update(len(blocks[-1]))
        return np.concatenate(blocks)

    columns = _random_columns(case, unknowns, ERROR_DROPS)
    errors = [
        compute(
            with_values(case, dict(zip(columns, map(float, row), strict=True)))
        ).numerical_error.assessed
        for row in zip(*columns.values(), strict=True)
    ]
    return _Source(impact, unknowns, evaluate, f"{SAMPLES} drops", np.array(errors))


def _solved(case: Case, columns: dict[str, Values]) -> Values:
    """Return the criteria of drops of a model, shape (n, n_criterion)."""
    result = solve_many(columns, case, forces=True)
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
