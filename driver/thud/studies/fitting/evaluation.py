"""The result of a search: covariance, warnings and assumptions at the best point."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import stats
from tqdm import tqdm

from thud.base.errors import NumericalError
from thud.base.note import Note, of_part
from thud.base.units import display_unit
from thud.studies.fitting.fit_result import Fit, FittedTarget
from thud.studies.fitting.force_target import GAIN, ForceComparison
from thud.studies.fitting.inference import (
    Inference,
    Posterior,
    coverage_factor,
    direction_note,
    infer,
    posterior,
    worst_directions,
)
from thud.studies.fitting.residual_tests import UNLIKELY, size_warning
from thud.studies.fitting.search import Objective, find_best, require_data

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from thud.studies.arrays import Array
    from thud.studies.fitting.ranges import Range
    from thud.studies.fitting.search import Effects, SearchOptions, Term


# A parameter closer to a limit than this, relative, lies at it.
AT_LIMIT = 1e-4
# Minimum effect of an alternative, in standard deviations of a residual, that is tested.
VISIBLE = 1e-3
# Relative half interval above which a parameter is hardly identifiable.
WIDE = 0.5
# Relative errors of clock and calibration whose effect a fit states.
CLOCK, CALIBRATION = 1e-3, 1e-2


class _Point(NamedTuple):
    """The best point, with residuals of unit variance; relative parameters, shape (n,)."""

    names: tuple[str, ...]
    terms: Sequence[Term]
    targets: tuple[FittedTarget, ...]
    residual: Array
    deviation: float
    freedom: int | None
    inferred: Inference
    noise: Array


def search(
    terms: Sequence[Term], ranges: Sequence[Range], options: SearchOptions, *, progress: bool
) -> Fit:
    """Return the best fit of the parameters of cases to their targets."""
    require_data(terms, len(ranges))
    with tqdm(unit="impact", disable=not progress, leave=False) as bar:
        objective = Objective(terms, ranges, bar)
        best = find_best(objective, options)
        return new_fit(
            objective, best.x, options.confidence, options.unknowns, converged=best.status > 0
        )


def new_fit(
    objective: Objective, x: Array, confidence: float, unknowns: Collection[str], *, converged: bool
) -> Fit:
    """Return the fit at the best point."""
    residual = objective.residual(x)
    impacts = objective.impacts(x)
    if not impacts:
        raise NumericalError(str(objective.error))
    jacobian = objective.jacobian(x)
    finer = objective.jacobian(x, 0.5)
    terms, count, own = objective.terms, objective.count, x * objective.scale
    comparisons = [term.comparison for term in terms]
    target_size = float(np.linalg.norm(np.concatenate([c.weighted_target for c in comparisons])))
    # Relative to the result, changes along a direction are in per cent.
    relative = np.where(np.abs(x) > AT_LIMIT, np.abs(x), 1.0)
    relative[count:] = 1.0
    inferred = infer(jacobian * relative, finer * relative, target_size)
    known = all(comparison.known_noise for comparison in comparisons)
    freedom = len(residual) - len(x) - sum(comparison.absorbed for comparison in comparisons)
    deviation = 1.0
    noise_freedom: int | None = freedom
    if known:
        stated = [c.noise_freedom for c in comparisons if c.noise_freedom is not None]
        noise_freedom = min(stated, default=None)
    else:
        minimum = np.finfo(float).eps * target_size / np.sqrt(len(residual))
        deviation = max(float(np.sqrt(residual @ residual / freedom)), minimum)
    effects = objective.effects(x, unknowns)
    wrong = posterior(
        jacobian * relative / deviation,
        inferred.inverse * deviation,
        effects.columns / deviation,
        residual / deviation,
    )
    numbered = {
        name if len(terms) == 1 else f"{name}({number})": unit
        for number, comparison in enumerate(comparisons, start=1)
        for name, (unit, _) in comparison.own.items()
    }
    names = (*(entry.name for entry in objective.ranges), *numbered)
    targets = tuple(
        FittedTarget(objective.case_at(term, x), impact, term.comparison, own[term.own])
        for term, impact in zip(terms, impacts, strict=True)
    )
    noise = inferred.covariance * deviation**2
    point = _Point(
        names, terms, targets, residual / deviation, deviation, noise_freedom, inferred, noise
    )
    notes = [] if converged else [Note("not_converged")]
    notes += _identifiability_notes(point, count, confidence) + _at_limits(objective, x)
    residual_notes, ratio = _residual_warnings(point, wrong)
    notes += [*residual_notes, *effects.failures, *_effect_warning(point, effects, wrong)]
    # The second moment of the posterior about the estimate, for which the case is as assumed.
    spread = ratio**2 * (noise + wrong.spread) + np.outer(wrong.shift, wrong.shift)
    size = relative * objective.scale
    return Fit(
        names=names,
        units=(*(entry.unit for entry in objective.ranges), *numbered.values()),
        estimate=own,
        covariance=spread * np.outer(size, size),
        limits=np.column_stack([objective.low, objective.high]) * objective.scale[:, np.newaxis],
        confidence=float(confidence),
        noise=deviation * comparisons[0].unit_deviation,
        residuals=residual / deviation,
        degrees_of_freedom=freedom,
        interval_freedom=noise_freedom,
        warnings=tuple(notes),
        assumptions=tuple(_assumptions(point, count, effects)),
        widened=ratio,
        known_noise=known,
        singular_values=inferred.singular_values,
        evaluations=objective.evaluations,
        failures=objective.failures,
        converged=converged,
        targets=targets,
    )


def _identifiability_notes(point: _Point, count: int, confidence: float) -> list[Note]:
    """Return warnings of parameters of the model that the targets do not determine."""
    names, noise, null = point.names, point.noise, point.inferred.null
    factor = coverage_factor(confidence, point.freedom)
    # The factor is 0 for a confidence below rounding: no interval is wide then.
    wide = worst_directions(noise[:count, :count], WIDE / factor) if factor else []
    result = [direction_note(names, direction) for direction in null]
    for deviation, direction in wide:
        result.append(direction_note(names[:count], direction, factor * deviation, confidence))
    return result


def _at_limits(objective: Objective, x: Array) -> list[Note]:
    """Return warnings of parameters at their limits."""
    result = []
    ends = zip(objective.ranges, x, objective.low, objective.high, strict=False)
    for entry, value, low, high in ends:
        if min(value - low, high - value) < AT_LIMIT:
            limit = (low if value - low < high - value else high) * entry.scale
            unit, factor = display_unit(entry.unit, limit)
            shown = f"{limit / factor:g} {unit}".rstrip()
            others = {"name": entry.name, "limit": shown}
            result.append(Note("at_limit", value=limit, unit=entry.unit, others=others))
    return result


def _residual_warnings(point: _Point, wrong: Posterior) -> tuple[list[Note], float]:
    """Return warnings of residuals that are not noise, and by how much the latter exceed it.

    The size is that of residuals without the effects of unknowns.
    """
    result, ratio = [], 1.0
    unexplained = point.residual + wrong.visible @ wrong.mean
    for number, (term, target) in enumerate(zip(point.terms, point.targets, strict=True), start=1):
        comparison, impact, own = term.comparison, target.impact, target.own
        residual, rest = point.residual[term.rows], unexplained[term.rows]
        freedom = comparison.size - comparison.absorbed - len(point.names) / len(point.targets)
        notes = []
        if comparison.known_noise and freedom > 0:
            notes = size_warning(residual, freedom, comparison.noise_freedom)
        if isinstance(comparison, ForceComparison):
            unit = point.deviation * comparison.unit_deviation
            notes += comparison.warnings(impact, own, residual, unit, len(point.names))
        if notes:
            excess = comparison.excess(impact, own, rest)
            ratio = max(ratio, excess * float(np.sqrt(comparison.size / max(freedom, 1.0))))
        result += of_part(f"target {number}", notes) if len(point.targets) > 1 else notes
    return result, ratio


def _effect_warning(point: _Point, effects: Effects, wrong: Posterior) -> list[Note]:
    """Return a warning if residuals contain the effect of an alternative to the case."""
    length = np.linalg.norm(wrong.visible, axis=0)
    seen = length > VISIBLE
    exact = [
        isinstance(t.comparison, ForceComparison) and t.comparison.is_exact(t.impact, t.own)
        for t in point.targets
    ]
    if not seen.any() or all(exact):
        return []
    size = np.abs(point.residual @ wrong.visible[:, seen]) / length[seen]
    freedom = point.freedom
    tail = 2 * (stats.norm.sf(size) if freedom is None else stats.t.sf(size, freedom))
    index = int(np.argmax(size))
    if tail[index] * len(size) > UNLIKELY:
        return []
    unknown, label = np.array(effects.labels)[seen][index]
    others = {"alternative": str(label), "unknown": str(unknown)}
    return [Note("alternative_seen", value=float(size[index]), others=others)]


def _assumptions(point: _Point, count: int, effects: Effects) -> list[Note]:
    """Return what the intervals include, and what no data can show, with its effect."""
    names = point.names[:count]
    result = []
    if effects.labels:
        errors = np.sqrt(np.diag(point.noise)[:count])
        listed = ", ".join(f"{n} {100 * e:.2g} %" for n, e in zip(names, errors, strict=True))
        unknowns = ", ".join(dict.fromkeys(unknown for unknown, _ in effects.labels))
        others = {"unknowns": unknowns, "errors": listed}
        result.append(Note("unknowns_included", others=others))
    clock, calibration = np.zeros((2, len(point.residual)))
    shown = [False, False]
    for term, target in zip(point.terms, point.targets, strict=True):
        comparison, impact, own = term.comparison, target.impact, target.own
        if not isinstance(comparison, ForceComparison):
            continue
        slow = 1 + CLOCK
        late = replace(impact, time=impact.time * slow, sample_rate=impact.sample_rate / slow)
        here = comparison.residual(impact, own)
        clock[term.rows], shown[0] = comparison.residual(late, own) - here, True
        if GAIN not in comparison.own:
            calibration[term.rows] = CALIBRATION * (here + comparison.weighted_target)
            shown[1] = True
    causes = f"clock {100 * CLOCK:g} % fast", f"calibration {100 * CALIBRATION:g} % high"
    for cause, change, is_shown in zip(causes, (clock, calibration), shown, strict=True):
        if is_shown:
            shifts = (point.inferred.inverse @ change)[:count]
            listed = ", ".join(f"{n} {100 * v:+.2g} %" for n, v in zip(names, shifts, strict=True))
            result.append(Note("not_visible", others={"cause": cause, "changes": listed}))
    return result
