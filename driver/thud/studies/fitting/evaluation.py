"""The result of a search: covariance, warnings and assumptions at the best point."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import stats
from tqdm import tqdm

from thud.base.errors import NumericalError
from thud.base.note import Note, of_part
from thud.base.units import display_unit
from thud.studies.fitting.fit_result import Fit, FittedTarget
from thud.studies.fitting.force_target import GAIN
from thud.studies.fitting.inference import (
    Inference,
    Posterior,
    coverage_factor,
    direction_note,
    infer,
    posterior,
    worst_directions,
)
from thud.studies.fitting.residual_tests import UNLIKELY
from thud.studies.fitting.search import Objective, find_best, minimize, require_data

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.studies.arrays import Array
    from thud.studies.fitting.ranges import Range
    from thud.studies.fitting.search import Effects, SearchOptions, Term


# A parameter closer to a limit than this, relative, lies at it.
AT_LIMIT = 1e-4
# Minimum effect of an alternative, in standard deviations of a residual, that is tested.
VISIBLE = 1e-3
# Relative half interval above which a parameter is hardly identifiable.
WIDE = 0.5
# Relative error of the calibration whose effect a fit states.
CALIBRATION = 1e-2
# Standard deviations from what is known of an own parameter above which it is unexpected, at 0.1 %.
EXPECTED = 3.3
# Maximum number of searches with the noise of the residuals of the one before.
MAX_SEARCHES = 8


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
        for _ in range(MAX_SEARCHES):
            reweighted = _reweighted(objective, best.x)
            if all(new is old for new, old in zip(reweighted, objective.terms, strict=True)):
                break
            objective.terms = reweighted
            best = minimize(objective, best.x, int(options.max_steps))
        return new_fit(objective, best.x, options, converged=best.status > 0)


def _reweighted(objective: Objective, x: Array) -> Sequence[Term]:
    """Return the terms with the noise that the residuals of a point show."""
    if not any(term.comparison.has_own_noise for term in objective.terms):
        return objective.terms
    jacobian, own, result = objective.jacobian(x), x * objective.scale, []
    for term, computed in zip(objective.terms, objective.results(x), strict=True):
        new = term.comparison.reweighted(computed, own[term.own], jacobian[term.rows])
        result.append(term if new is term.comparison else term._replace(comparison=new))
    return result


def new_fit(objective: Objective, x: Array, options: SearchOptions, *, converged: bool) -> Fit:
    """Return the fit at the best point."""
    residual = objective.residual(x)
    results = objective.results(x)
    if not results:
        raise NumericalError(str(objective.error))
    jacobian = objective.jacobian(x)
    finer = objective.jacobian(x, 0.5)
    confidence = options.confidence
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
    effects = objective.effects(x, options.unknowns)
    wrong = posterior(
        jacobian * relative / deviation,
        inferred.inverse * deviation,
        effects.columns / deviation,
        residual / deviation,
    )
    own_names = (
        name if len(terms) == 1 else f"{name}({number})"
        for number, comparison in enumerate(comparisons, start=1)
        for name in comparison.own
    )
    names = (*(entry.name for entry in objective.ranges), *own_names)
    targets = tuple(
        FittedTarget(objective.case_at(term, x), result, term.comparison, own[term.own])
        for term, result in zip(terms, results, strict=True)
    )
    noise = inferred.covariance * deviation**2
    point = _Point(
        names, terms, targets, residual / deviation, deviation, noise_freedom, inferred, noise
    )
    notes = [] if converged else [Note("not_converged")]
    notes += _identifiability_notes(point, count, confidence) + _at_limits(objective, x, names)
    residual_notes, ratio = _residual_warnings(point, wrong)
    notes += [*residual_notes, *effects.failures, *_effect_warning(point, effects, wrong)]
    # The second moment of the posterior about the estimate, for which the case is as assumed.
    spread = ratio**2 * (noise + wrong.spread) + np.outer(wrong.shift, wrong.shift)
    size = relative * objective.scale
    return Fit(
        names=names,
        units=tuple(entry.unit for entry in objective.parameters),
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


def _at_limits(objective: Objective, x: Array, names: Sequence[str]) -> list[Note]:
    """Return warnings of parameters at their limits."""
    result = []
    ends = zip(names, objective.parameters, x, objective.low, objective.high, strict=True)
    for name, entry, value, low, high in ends:
        if min(value - low, high - value) < AT_LIMIT:
            limit = (low if value - low < high - value else high) * entry.scale
            unit, factor = display_unit(entry.unit, limit)
            shown = f"{limit / factor:g} {unit}".rstrip()
            others = {"name": name, "limit": shown}
            result.append(Note("at_limit", value=limit, unit=entry.unit, others=others))
    return result


def _residual_warnings(point: _Point, wrong: Posterior) -> tuple[list[Note], float]:
    """Return warnings of residuals that are not noise, and by how much the latter exceed it.

    The size is that of residuals without the effects of unknowns.
    """
    result, ratio = [], 1.0
    unexplained = point.residual + wrong.visible @ wrong.mean
    for number, (term, target) in enumerate(zip(point.terms, point.targets, strict=True), start=1):
        comparison, computed, own = term.comparison, target.result, target.own
        residual, rest = point.residual[term.rows], unexplained[term.rows]
        freedom = comparison.size - comparison.absorbed - len(point.names) / len(point.targets)
        unit = point.deviation * comparison.unit_deviation
        notes = comparison.warnings(computed, own, residual, freedom, unit)
        if notes:
            excess = comparison.excess(computed, own, rest)
            ratio = max(ratio, excess * float(np.sqrt(comparison.size / max(freedom, 1.0))))
        for value, (name, entry) in zip(own.tolist(), comparison.own.items(), strict=True):
            size = abs(value - entry.start) / entry.deviation
            if size > EXPECTED:
                ratio = max(ratio, size)
                notes.append(Note("larger_than_expected", value=size, others={"name": name}))
        result += of_part(f"target {number}", notes) if len(point.targets) > 1 else notes
    return result, ratio


def _effect_warning(point: _Point, effects: Effects, wrong: Posterior) -> list[Note]:
    """Return a warning if residuals contain the effect of an alternative to the case."""
    length = np.linalg.norm(wrong.visible, axis=0)
    seen = length > VISIBLE
    if not seen.any() or all(t.comparison.is_exact(t.result, t.own) for t in point.targets):
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
    change = np.zeros(len(point.residual))
    for term, target in zip(point.terms, point.targets, strict=True):
        comparison, rows = term.comparison, slice(term.rows.start, None)
        if comparison.unit == "N" and GAIN not in comparison.own:
            here = comparison.misfit(target.result, target.own) + comparison.weighted_target
            change[rows][: len(here)] = CALIBRATION * here
    if change.any():
        shifts = (point.inferred.inverse @ change)[:count]
        listed = ", ".join(f"{n} {100 * v:+.2g} %" for n, v in zip(names, shifts, strict=True))
        others = {"cause": f"calibration {100 * CALIBRATION:g} % high", "changes": listed}
        result.append(Note("not_visible", others=others))
    return result
