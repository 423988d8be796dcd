"""The search for the parameters of a model that fit a target best."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats
from scipy.optimize import OptimizeResult, least_squares
from tqdm import tqdm

from thud.errors import InputError, NumericalError, ThudError
from thud.studies.fitting.inference import (
    Inference,
    coverage_factor,
    infer,
    null_sentence,
    weak_sentence,
    worst_directions,
)
from thud.studies.fitting.objective import SHIFT_SCALE, STEP, Objective
from thud.studies.fitting.result import SHIFT, Fit
from thud.units import handy_unit

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from thud.case import Case
    from thud.studies.fitting.misfit import Misfit
    from thud.studies.fitting.ranges import Range

# Relative steps and gains at which the search ends.
TOLERANCE = 1e-8
# A parameter closer to a limit than this, relative, lies at it.
AT_LIMIT = 1e-4
# Relative half interval above which a parameter is hardly identifiable.
WIDE = 0.5
# Probability of the residual below which the model does not explain the data.
UNLIKELY = 1e-3


def search(
    case: Case, ranges: list[Range], misfit: Misfit, options: Mapping[str, Any], *, progress: bool
) -> Fit:
    """Return the best fit of the parameters of a case.

    `options` are confidence, starts, seed and max_steps of `thud.fit`.
    """
    _require_data(misfit, len(ranges) + misfit.free_shift)
    with tqdm(unit="impact", disable=not progress, leave=False) as bar:
        objective = Objective(case, ranges, misfit, bar)
        starts = _spread(ranges, int(options["starts"]), options["seed"])
        place, converged = _search(objective, starts, int(options["max_steps"]))
        return _conclude(objective, place, options["confidence"], converged=converged)


def _require_data(misfit: Misfit, count: int) -> None:
    minimum = count if misfit.known_noise else count + 1
    if misfit.size < minimum:
        message = (
            f"target: {misfit.size} data for {count} parameters are too few; "
            f"allowed: {minimum} or more"
            + ("" if misfit.known_noise else " where no noise is given")
        )
        raise InputError(message)


def _spread(ranges: list[Range], count: int, seed: int) -> Iterator[NDArray[np.float64]]:
    """Yield starts over their scales: the given one, then a Latin hypercube."""
    first = np.array([entry.start / entry.scale for entry in ranges])
    yield first
    low, high = np.array([np.array(entry.spread) / entry.scale for entry in ranges]).T
    for place in stats.qmc.LatinHypercube(len(ranges), rng=seed).random(count - 1):
        yield low + place * (high - low)


def _search(
    objective: Objective, starts: Iterator[NDArray[np.float64]], max_steps: int
) -> tuple[NDArray[np.float64], bool]:
    """Return the best place from all starts, and whether the search converged there."""
    best: OptimizeResult | None = None
    failures: list[ThudError] = []
    for start in starts:
        try:
            found = _descend(objective, start, max_steps)
        except ThudError as error:
            failures.append(error)
            continue
        if best is None or found.cost < best.cost:
            best = found
    if best is None:
        raise failures[0]
    return best.x, bool(best.status > 0)


def _descend(objective: Objective, start: NDArray[np.float64], max_steps: int) -> OptimizeResult:
    first = objective.impact(start)
    if first is None:
        message = f"the start cannot be computed: {objective.error}"
        raise type(objective.error or NumericalError())(message)
    if objective.misfit.free_shift:
        start = np.append(start, objective.misfit.first_shift(first) / SHIFT_SCALE)
    return least_squares(
        objective.residual,
        start,
        objective.jacobian,
        bounds=(objective.low, objective.high),
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=np.finfo(float).eps,  # ends a search that starts at a perfect fit
        # LSMR is regularised: parameters without effect do not hold up the others. It searches
        # a plane, which a single parameter does not span.
        tr_solver="lsmr" if len(start) > 1 else "exact",
        max_nfev=max_steps,
    )


def _conclude(
    objective: Objective, place: NDArray[np.float64], confidence: float, *, converged: bool
) -> Fit:
    residual = objective.residual(place)
    impact = objective.impact(place)
    if impact is None:
        raise NumericalError(str(objective.error))
    jacobian = objective.jacobian(place)
    finer = objective.jacobian(place, STEP / 2)
    target_size = float(np.linalg.norm(objective.misfit.target_vector()))
    # Relative to the values found, a change along a direction reads as one in per cent.
    relative = np.where(np.abs(place) > AT_LIMIT, np.abs(place), 1.0)
    if objective.misfit.free_shift:
        relative[-1] = 1.0
    known = infer(jacobian * relative, finer * relative, target_size)
    freedom = len(residual) - len(place)
    deviation = 1.0
    if not objective.misfit.known_noise:
        minimum = np.finfo(float).eps * target_size / np.sqrt(len(residual))
        deviation = max(float(np.sqrt(residual @ residual / freedom)), minimum)
    size = deviation * relative * objective.scale
    names = [entry.name for entry in objective.ranges] + [SHIFT] * objective.misfit.free_shift
    answer = Fit(
        names=tuple(names),
        units=(*(entry.unit for entry in objective.ranges), *["s"] * objective.misfit.free_shift),
        estimate=place * objective.scale,
        covariance=known.covariance * np.outer(size, size),
        limits=np.column_stack([objective.low, objective.high]) * objective.scale[:, np.newaxis],
        singular_values=known.singular_values,
        confidence=float(confidence),
        noise=deviation * objective.misfit.unit_deviation,
        known_noise=objective.misfit.known_noise,
        residuals=residual / deviation,
        evaluations=objective.evaluations,
        failures=objective.failures,
        converged=converged,
        warnings=(),
        case=objective.case_at(place),
        impact=impact,
        misfit=objective.misfit,
    )
    doubts = _doubts(objective, answer, place, known, known.covariance * deviation**2)
    return replace(answer, warnings=tuple(doubts))


def _doubts(
    objective: Objective,
    answer: Fit,
    place: NDArray[np.float64],
    known: Inference,
    covariance: NDArray[np.float64],
) -> list[str]:
    """Return warnings of a fit; `covariance` is that of relative values."""
    found = []
    if not answer.converged:
        found.append("the search has not converged; allow more steps, or start elsewhere")
    found += [null_sentence(answer.names, direction) for direction in known.null]
    freedom = answer.degrees_of_freedom
    factor = coverage_factor(answer.confidence, None if answer.known_noise else freedom)
    count = objective.count
    for deviation, direction in worst_directions(covariance[:count, :count], WIDE / factor):
        found.append(
            weak_sentence(answer.names[:count], direction, factor * deviation, answer.confidence)
        )
    for entry, value, low, high in zip(
        objective.ranges, place, objective.low, objective.high, strict=False
    ):
        if min(value - low, high - value) < AT_LIMIT:
            limit = (low if value - low < high - value else high) * entry.scale
            unit, factor = handy_unit(entry.unit, limit)
            found.append(
                f"{entry.name} ended at its limit, {limit / factor:g} {unit}".rstrip()
                + ": its interval is cut there, and all intervals hold inside the limits only"
            )
    square = float(answer.residuals @ answer.residuals)
    if answer.known_noise and freedom and stats.chi2.sf(square, freedom) < UNLIKELY:
        found.append(
            f"the residuals are {np.sqrt(square / freedom):.3g} times what the given "
            "uncertainty lets expect: the model does not explain the data"
        )
    elif doubt := objective.misfit.doubt(answer.impact, answer.time_shift, len(place)):
        found.append(doubt)
    return found
