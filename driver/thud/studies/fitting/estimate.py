"""The estimate at the best point of a search: covariance, unknowns, warnings, assumptions."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import stats
from scipy.linalg import qr

from thud.base.errors import NumericalError
from thud.base.note import Note, of_part
from thud.base.units import display_unit
from thud.studies.fitting.comparison import UNLIKELY, coverage_factor
from thud.studies.fitting.fit_result import Fit, FittedTarget
from thud.studies.fitting.force_target import GAIN

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.studies.arrays import Array
    from thud.studies.fitting.search import Effects, Objective, SearchOptions, Term


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
# Columns of the Jacobian with a smaller norm over that of the target, or a larger relative error,
# are zero.
NO_EFFECT = 1e-9
UNRESOLVED = 0.5
# Singular values of the Jacobian below this fraction of the maximum, or below this many of its own
# errors, are zero.
MIN_RATIO = 1e-6
ERRORS = 3.0
# Entries of a unit vector below this are zero.
NEGLIGIBLE = 1e-3
# Fraction of the maximum entry below which a message omits a parameter.
SMALL = 0.05


class Inference(NamedTuple):
    """Covariance of scaled parameters, and directions that are not identifiable.

    Attributes
    ----------
    covariance : ndarray, shape (n, n)
        For residuals of unit variance; infinite where a parameter is not identifiable.
    singular_values : ndarray, shape (n,)
        Of the Jacobian with columns of unit length, in descending order.
    null : ndarray, shape (n_null, n)
        Changes that leave the residuals as they are, of the fewest parameters.
    inverse : ndarray, shape (n, m)
        Pseudoinverse of the Jacobian.
    """

    covariance: Array
    singular_values: Array
    null: Array
    inverse: Array


def infer(jacobian: Array, finer: Array, size: float) -> Inference:
    """Return covariance, singular values and null directions.

    `jacobian`, shape (m, n), holds derivatives of weighted residuals by scaled parameters, `finer`
    the same with another step: their difference is the error. `size` is the norm of the target.
    """
    count = jacobian.shape[1]
    length = np.linalg.norm(jacobian, axis=0)
    change = np.linalg.norm(jacobian - finer, axis=0)
    dead = (length <= NO_EFFECT * size) | (change > UNRESOLVED * length)
    length[dead] = 1.0
    error = np.max(change / length, where=~dead, initial=0.0)
    rows = len(jacobian)
    relative = np.pad(np.where(dead, 0.0, jacobian / length), ((0, max(0, count - rows)), (0, 0)))
    left, values, turned = np.linalg.svd(relative, full_matrices=False)
    lost = values <= max(MIN_RATIO, ERRORS * error) * values[0]
    known = turned[~lost] / values[~lost, np.newaxis]
    covariance = known.T @ known / np.outer(length, length)
    unknown = (np.abs(turned[lost]) > NEGLIGIBLE).any(axis=0)
    covariance[unknown] = covariance[:, unknown] = np.nan
    covariance[unknown, unknown] = np.inf
    inverse = known.T @ left[:rows, ~lost].T / length[:, np.newaxis]
    null = turned[lost] / length
    if len(null):
        # Another basis, with one entry that is not 0 in each pivot column: the parameters that
        # vary most represent the directions.
        _, _, order = qr(null, pivoting=True)
        basis = np.linalg.solve(null[:, order[: len(null)]], null)
        null = basis / np.abs(basis).max(axis=1, keepdims=True)
    return Inference(covariance, values, null, inverse)


class Posterior(NamedTuple):
    """Sizes of effects that a model leaves out, each with a normal prior of mean 0 and variance 1.

    Attributes
    ----------
    visible : ndarray, shape (m, n_effect)
        Effects on the residuals of unit variance that no change of the parameters makes.
    mean : ndarray, shape (n_effect,)
        Posterior means.
    covariance : ndarray, shape (n_effect, n_effect)
        Posterior covariance.
    response : ndarray, shape (n, n_effect)
        Change of the best parameters by a unit of each effect.
    shift, spread : ndarray, shapes (n,) and (n, n)
        Change of the best parameters by the effects, and its covariance.
    evidence : float
        Logarithm of the likelihood of the residuals, up to a constant.
    """

    visible: Array
    mean: Array
    covariance: Array
    response: Array
    shift: Array
    spread: Array
    evidence: float


def posterior(jacobian: Array, inverse: Array, effects: Array, residual: Array) -> Posterior:
    """Return the sizes of effects in residuals, model minus target, of unit variance.

    `inverse` is the pseudoinverse of the Jacobian, shape (m, n), of the parameters.
    """
    response = -inverse @ effects
    visible = effects + jacobian @ response
    # Rows of zeros make the axes complete.
    extra = max(0, effects.shape[1] - len(residual))
    left, size, axes = np.linalg.svd(np.pad(visible, ((0, extra), (0, 0))), full_matrices=False)
    seen = left[: len(residual)].T @ residual
    mean = -axes.T @ (size / (1 + size**2) * seen)
    covariance = axes.T / (1 + size**2) @ axes
    rest = residual - jacobian @ (inverse @ residual)
    square = rest @ rest - seen**2 @ (size**2 / (1 + size**2))
    evidence = -0.5 * float(square + np.log1p(size**2).sum())
    spread = response @ covariance @ response.T
    return Posterior(visible, mean, covariance, response, response @ mean, spread, evidence)


def worst_directions(covariance: Array, maximum: float) -> list[tuple[float, Array]]:
    """Return directions whose standard deviation exceeds a maximum, with that deviation."""
    finite = np.flatnonzero(np.isfinite(np.diag(covariance)))
    variances, vectors = np.linalg.eigh(covariance[np.ix_(finite, finite)])
    result = []
    for variance, vector in zip(variances[::-1], vectors.T[::-1], strict=True):
        if variance > maximum**2:
            direction = np.zeros(len(covariance))
            direction[finite] = vector
            result.append((float(np.sqrt(variance)), direction))
    return result


def direction_note(
    names: Sequence[str], direction: Array, width: float = np.inf, confidence: float = 1.0
) -> Note:
    """Return the note on a direction by its relative half interval; infinite: no effect."""
    largest = np.abs(direction).max()
    entries = [
        (name, float(value / largest))
        for name, value in zip(names, direction, strict=True)
        if abs(value) > SMALL * largest
    ]
    sign = np.sign(entries[0][1])
    changes = [f"{name} {sign * value:+.2g} %" for name, value in entries]
    others: dict[str, float | str] = {
        "names": _join([name for name, _ in entries]),
        "changes": _join(changes),
        "product": _product(entries),
    }
    if np.isinf(width):
        return Note("not_identifiable" if len(entries) > 1 else "no_effect", others=others)
    code = "hardly_identifiable" if len(entries) > 1 else "hardly_known"
    size = 100 * width * largest
    return Note(code, value=float(size), unit="%", others={**others, "confidence": confidence})


def _join(words: Sequence[str]) -> str:
    return f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else words[0]


def _product(entries: Sequence[tuple[str, float]]) -> str:
    """Return the product of powers that two parameters determine."""
    if len(entries) != 2:  # noqa: PLR2004 - a pair determines one product of powers
        return ""
    (first, a), (second, b) = entries
    power = -a / b
    return f"; only {first} * {second}^{power:.3g} is determined, close to these values"


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
    notes += _parameter_warnings(point, objective, x, confidence)
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


def _parameter_warnings(
    point: _Point, objective: Objective, x: Array, confidence: float
) -> list[Note]:
    """Return warnings of parameters that the targets do not determine, or that are at limits."""
    names, noise, null = point.names, point.noise, point.inferred.null
    count = objective.count
    factor = coverage_factor(confidence, point.freedom)
    # The factor is 0 for a confidence below rounding: no interval is wide then.
    wide = worst_directions(noise[:count, :count], WIDE / factor) if factor else []
    result = [direction_note(names, direction) for direction in null]
    for deviation, direction in wide:
        result.append(direction_note(names[:count], direction, factor * deviation, confidence))
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
