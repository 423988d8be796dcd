"""The search for the parameters of a model that fit a target best."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats
from scipy.optimize import OptimizeResult, least_squares
from tqdm import tqdm

from thud.base.checks import refuse
from thud.base.errors import NumericalError, ThudError
from thud.base.note import Note, of_part
from thud.base.units import display_unit
from thud.studies.fitting.fit_result import Fit, FittedTarget
from thud.studies.fitting.inference import (
    INSEPARABLE,
    UNLIKELY,
    Inference,
    Posterior,
    coverage_factor,
    identifiability,
    infer,
    null_note,
    pair_notes,
    posterior,
    weak_note,
    worst_directions,
)
from thud.studies.fitting.objective import Effects, Objective, new_terms
from thud.studies.sampling import unit_samples

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from numpy.typing import NDArray

    from thud.case.case import Case
    from thud.studies.fitting.misfit import Misfit
    from thud.studies.fitting.objective import Term
    from thud.studies.fitting.ranges import Range

    Array = NDArray[np.float64]

# Relative steps and gains at which the search ends.
TOLERANCE = 1e-8
# A parameter closer to a limit than this, relative, lies at it.
AT_LIMIT = 1e-4
# Minimum effect of an alternative, in standard deviations of a residual, that is tested.
VISIBLE = 1e-3
# Relative half interval above which a parameter is hardly identifiable.
WIDE = 0.5


def search(
    targets: list[tuple[Case, Misfit]],
    ranges: list[Range],
    options: Mapping[str, Any],
    *,
    progress: bool,
) -> Fit:
    """Return the best fit of the parameters of cases to their targets.

    `options` are confidence, starts, seed, max_steps and unknowns of `thud.fit`.
    """
    terms = new_terms(targets, len(ranges))
    _require_data(terms, len(ranges))
    with tqdm(unit="impact", disable=not progress, leave=False) as bar:
        objective = Objective(terms, ranges, bar)
        starts = _starts(ranges, int(options["starts"]), options["seed"])
        x, converged = _search(objective, starts, int(options["max_steps"]))
        return _new_fit(
            objective, x, options["confidence"], options["unknowns"], converged=converged
        )


def _require_data(terms: list[Term], count: int) -> None:
    misfits = [term.misfit for term in terms]
    known = all(misfit.known_noise for misfit in misfits)
    for number, misfit in enumerate(misfits, start=1):
        if len(terms) > 1 and not misfit.known_noise:
            refuse(
                f"target {number}: the weight of its residuals is not known",
                f"{misfit.deviation_source} where there are several targets",
            )
    count += sum(len(misfit.own) for misfit in misfits)
    size = sum(misfit.size - misfit.absorbed for misfit in misfits)
    minimum = count if known else count + 1
    if size < minimum:
        refuse(
            f"target: {size} data for {count} parameters are too few",
            f"{minimum} or more" + ("" if known else " where no noise is given"),
        )


def _starts(ranges: list[Range], count: int, seed: int) -> Iterator[Array]:
    """Yield starts over their scales: the given one, then a Latin hypercube."""
    first = np.array([entry.start / entry.scale for entry in ranges])
    yield first
    low, high = np.array([np.array(entry.spread) / entry.scale for entry in ranges]).T
    shape = len(ranges), count - 1
    for x in unit_samples("latin_hypercube", *shape, seed, 0, count - 1):
        yield low + x * (high - low)


def _search(objective: Objective, starts: Iterator[Array], max_steps: int) -> tuple[Array, bool]:
    """Return the best point from all starts, and whether the search converged there."""
    best: OptimizeResult | None = None
    failures: list[ThudError] = []
    for start in starts:
        try:
            result = _minimize(objective, start, max_steps)
        except ThudError as error:
            failures.append(error)
            continue
        if best is None or result.cost < best.cost:
            best = result
    if best is None:
        raise failures[0]
    return best.x, bool(best.status > 0)


def _minimize(objective: Objective, start: Array, max_steps: int) -> OptimizeResult:
    first = objective.impacts(start)
    if not first:
        message = f"the start cannot be computed: {objective.error}"
        raise type(objective.error or NumericalError())(message)
    own = [
        term.misfit.own_start(impact) / objective.scale[term.own]
        for term, impact in zip(objective.terms, first, strict=True)
    ]
    start = np.concatenate([start, *own])
    return least_squares(
        objective.residual,
        start,
        objective.jacobian,
        bounds=(objective.low, objective.high),
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=np.finfo(float).eps,  # ends a search that starts at a perfect fit
        # LSMR is regularized: parameters without effect do not stop the others. It searches
        # a plane, for which a single parameter is not enough.
        tr_solver="lsmr" if len(start) > 1 else "exact",
        max_nfev=max_steps,
    )


def _new_fit(
    objective: Objective, x: Array, confidence: float, unknowns: Collection[str], *, converged: bool
) -> Fit:
    residual = objective.residual(x)
    impacts = objective.impacts(x)
    if not impacts:
        raise NumericalError(str(objective.error))
    jacobian = objective.jacobian(x)
    finer = objective.jacobian(x, 0.5)
    terms, count = objective.terms, objective.count
    misfits = [term.misfit for term in terms]
    target_size = float(np.linalg.norm(np.concatenate([m.target_vector() for m in misfits])))
    # Relative to the result, changes along a direction are in per cent.
    relative = np.where(np.abs(x) > AT_LIMIT, np.abs(x), 1.0)
    relative[count:] = 1.0
    inferred = infer(jacobian * relative, finer * relative, target_size)
    freedom = len(residual) - len(x) - sum(misfit.absorbed for misfit in misfits)
    deviation = 1.0
    if not all(misfit.known_noise for misfit in misfits):
        minimum = np.finfo(float).eps * target_size / np.sqrt(len(residual))
        deviation = max(float(np.sqrt(residual @ residual / freedom)), minimum)
    effects = objective.effects(x, unknowns)
    wrong = posterior(
        jacobian * relative / deviation,
        inferred.inverse * deviation,
        effects.columns / deviation,
        residual / deviation,
    )
    noise = inferred.covariance * deviation**2
    size = relative * objective.scale
    own = {
        name if len(terms) == 1 else f"{name}({number})": unit
        for number, misfit in enumerate(misfits, start=1)
        for name, (unit, _) in misfit.own.items()
    }
    fit = Fit(
        names=(*(entry.name for entry in objective.ranges), *own),
        units=(*(entry.unit for entry in objective.ranges), *own.values()),
        estimate=x * objective.scale,
        covariance=noise * np.outer(size, size),
        limits=np.column_stack([objective.low, objective.high]) * objective.scale[:, np.newaxis],
        singular_values=inferred.singular_values,
        confidence=float(confidence),
        noise=deviation * misfits[0].unit_deviation,
        known_noise=all(misfit.known_noise for misfit in misfits),
        residuals=residual / deviation,
        evaluations=objective.evaluations,
        failures=objective.failures,
        converged=converged,
        warnings=(),
        assumptions=(),
        widened=1.0,
        given_units={r.name: r.given_unit for r in objective.ranges if r.given_unit},
        identifiability=(),
        targets=tuple(
            FittedTarget(
                objective.case_at(term, x), impact, term.misfit, objective.own_values(term, x)
            )
            for term, impact in zip(terms, impacts, strict=True)
        ),
    )
    notes = _warnings(objective, fit, x, inferred, noise)
    residual_notes, ratio = _residual_warnings(fit, fit.residuals + wrong.visible @ wrong.mean)
    notes += residual_notes
    notes += effects.failures
    if not all(target.misfit.is_exact(target.impact, target.own) for target in fit.targets):
        notes += _effect_warning(effects, wrong, fit)
    separability = identifiability(fit.names, noise, fit.correlation, count)
    # The second moment of the posterior about the estimate, for which the case is as assumed.
    spread = ratio**2 * (noise + wrong.spread) + np.outer(wrong.shift, wrong.shift)
    return replace(
        fit,
        covariance=spread * np.outer(size, size),
        widened=ratio,
        warnings=tuple(notes),
        identifiability=tuple(separability),
        assumptions=tuple(_assumptions(objective, fit, inferred, noise, effects)),
    )


def _effect_warning(effects: Effects, wrong: Posterior, fit: Fit) -> list[Note]:
    """Return a warning if residuals contain the effect of an alternative to the case."""
    length = np.linalg.norm(wrong.visible, axis=0)
    seen = length > VISIBLE
    if not seen.any():
        return []
    size = np.abs(fit.residuals @ wrong.visible[:, seen]) / length[seen]
    freedom = fit.interval_freedom
    tail = 2 * (stats.norm.sf(size) if freedom is None else stats.t.sf(size, freedom))
    index = int(np.argmax(size))
    if tail[index] * len(size) > UNLIKELY:
        return []
    unknown, label = np.array(effects.labels)[seen][index]
    others = {"alternative": str(label), "unknown": str(unknown)}
    return [Note("alternative_seen", value=float(size[index]), others=others)]


def _assumptions(
    objective: Objective, fit: Fit, inferred: Inference, noise: Array, effects: Effects
) -> list[str]:
    """Return what the intervals include, and what no data can show, with its effect."""
    count = objective.count
    names = fit.names[:count]
    result = []
    if effects.labels:
        errors = np.sqrt(np.diag(noise)[:count])
        listed = ", ".join(f"{n} {100 * e:.2g} %" for n, e in zip(names, errors, strict=True))
        unknowns = ", ".join(dict.fromkeys(unknown for unknown, _ in effects.labels))
        result.append(f"unknown, in the intervals: {unknowns}; noise alone: {listed}")
    changes: dict[str, Array] = {}
    first = 0
    for target in fit.targets:
        rows = slice(first, first + target.misfit.size)
        first = rows.stop
        for name, change in target.misfit.assumed(target.impact, target.own).items():
            changes.setdefault(name, np.zeros(len(fit.residuals)))[rows] = change
    for name, change in changes.items():
        shifts = (inferred.inverse @ change)[:count]
        listed = ", ".join(f"{n} {100 * v:+.2g} %" for n, v in zip(names, shifts, strict=True))
        result.append(f"not in the intervals, and not visible: {name} changes {listed}")
    return result


def _warnings(
    objective: Objective, fit: Fit, x: Array, inferred: Inference, covariance: Array
) -> list[Note]:
    """Return warnings of a fit; `covariance` is that of relative values."""
    result = []
    if not fit.converged:
        result.append(Note("not_converged"))
    result += [null_note(fit.names, direction) for direction in inferred.null]
    factor = coverage_factor(fit.confidence, fit.interval_freedom)
    count = objective.count
    # The factor is 0 for a confidence below rounding: no interval is wide then.
    wide = worst_directions(covariance[:count, :count], WIDE / factor) if factor else []
    for deviation, direction in wide:
        result.append(weak_note(fit.names[:count], direction, factor * deviation, fit.confidence))
    if not inferred.null.size and not wide:
        result += pair_notes(fit.names, fit.correlation, INSEPARABLE)
    for entry, value, low, high in zip(
        objective.ranges, x, objective.low, objective.high, strict=False
    ):
        if min(value - low, high - value) < AT_LIMIT:
            limit = (low if value - low < high - value else high) * entry.scale
            unit, factor = display_unit(entry.unit, limit)
            shown = f"{limit / factor:g} {unit}".rstrip()
            others = {"name": entry.name, "limit": shown}
            result.append(Note("at_limit", value=limit, unit=entry.unit, others=others))
    return result


def _residual_warnings(fit: Fit, unexplained: Array) -> tuple[list[Note], float]:
    """Return warnings of residuals that are not noise, and by how much the latter exceed it.

    `unexplained` are the residuals without the effects of unknowns.
    """
    result, ratio = [], 1.0
    first = 0
    deviation = fit.noise / fit.targets[0].misfit.unit_deviation
    for number, target in enumerate(fit.targets, start=1):
        misfit = target.misfit
        rows = slice(first, first + misfit.size)
        first = rows.stop
        freedom = misfit.size - misfit.absorbed - len(fit.names) / len(fit.targets)
        size = size_of_residuals(fit, number - 1)
        own = [] if math.isnan(size) else [Note("unexplained", value=size)]
        own += misfit.warnings(target.impact, target.own, deviation, len(fit.names))
        if own:
            excess = misfit.excess(target.impact, target.own, unexplained[rows])
            ratio = max(ratio, excess * float(np.sqrt(misfit.size / max(freedom, 1.0))))
        result += of_part(f"target {number}", own) if len(fit.targets) > 1 else own
    return result, ratio


def size_of_residuals(fit: Fit, number: int = 0) -> float:
    """Return how many times as large as its uncertainty the residuals of a target are.

    NaN: they are not larger than noise is by chance, or the uncertainty is not known.
    """
    targets = fit.targets
    misfit = targets[number].misfit
    freedom = misfit.size - misfit.absorbed - len(fit.names) / len(targets)
    first = sum(target.misfit.size for target in targets[:number])
    residuals = fit.residuals[first : first + misfit.size]
    if not misfit.known_noise or freedom <= 0:
        return math.nan
    square = float(residuals @ residuals)
    tail = (
        stats.chi2.sf(square, freedom)
        if misfit.noise_freedom is None
        else stats.f.sf(square / freedom, freedom, misfit.noise_freedom)
    )
    return math.nan if tail > UNLIKELY else math.sqrt(square / freedom)
