"""The search for the parameters of a model that fit a target best."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats
from scipy.optimize import OptimizeResult, least_squares
from tqdm import tqdm

from thud.case import Case
from thud.checks import LARGEST_SEED, require_kind, require_whole
from thud.errors import FitWarning, InputError, NumericalError, ThudError
from thud.fitting.answer import Fit
from thud.fitting.force_target import ForceTarget
from thud.fitting.inference import (
    Inference,
    coverage_factor,
    infer,
    null_sentence,
    require_level,
    weak_sentence,
    worst_directions,
)
from thud.fitting.level_target import LevelTarget
from thud.fitting.objective import SHIFT_SCALE, STEP, Objective
from thud.fitting.parameters import get_ranges
from thud.fitting.result import SHIFT
from thud.units import handy_unit

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from numpy.typing import ArrayLike, NDArray

    from thud.fitting.misfit import Misfit
    from thud.fitting.parameters import Parameter, Range
    from thud.impact import Impact
    from thud.recording import Recording

# More starts, or steps of a search, than this come to no end.
MAXIMUM = 100_000
# Where steps and gains are this small, relative, the search ends.
TOLERANCE = 1e-8
# A parameter this close to a limit, relative, lies at it.
AT_LIMIT = 1e-4
# Half an interval, relative, from which little is known of a parameter.
WIDE = 0.5
# Probability of a residual as large as it is, below which the model does not explain the data.
UNLIKELY = 1e-3


def fit(  # noqa: PLR0913 - what there is to choose
    target: ForceTarget | LevelTarget | Recording | Impact | tuple[ArrayLike, ArrayLike],
    parameters: Iterable[str] | Mapping[str, Parameter | float | None],
    base: Case | None = None,
    *,
    level: float = 0.95,
    starts: int = 1,
    seed: int = 0,
    max_steps: int = 100,
    progress: bool = False,
) -> Fit:
    """Estimate parameters of a model from a force history or from levels, by least squares.

    Trust-region reflective steps (`scipy.optimize.least_squares`) within the limits, parameters
    measured in their starts. A point at which the model cannot be computed is stepped away from.

    Parameters
    ----------
    target
        What is fitted; a recording, an impact or arrays of time, s, and force, N, are the record
        of a `ForceTarget`.
    parameters
        Names of keys of ball, drop or model that take real numbers; as a mapping, with their
        starts or `Parameter`.
    base
        Everything else; by default the ball of the paper in the model of the paper.
    level
        Confidence of the intervals.
    starts
        Number of starts: the given one, and others spread over the limits (over a factor of 2 to
        both sides where a limit is not given). The best end counts.
    seed
        Seed of the other starts.
    max_steps
        Most steps of a search.
    progress
        Show how many impacts were computed.

    Returns
    -------
    Fit
        Values, covariance, intervals, residuals and warnings, also issued as `FitWarning`.

    Raises
    ------
    InputError
        Where target or parameters cannot be used.
    NumericalError
        Where the model cannot be computed around the best point.
    """
    case = Case() if base is None else base
    require_kind("base", case, Case)
    require_level(level)
    require_whole("starts", starts, 1, MAXIMUM)
    require_whole("max_steps", max_steps, 1, MAXIMUM)
    require_whole("seed", seed, 0, LARGEST_SEED)
    ranges = get_ranges(case, parameters)
    misfit = (
        target if isinstance(target, ForceTarget | LevelTarget) else ForceTarget(target)
    ).misfit()
    _require_data(misfit, len(ranges) + misfit.free_shift)
    bar: tqdm[Any] = tqdm(unit="impact", disable=not progress, leave=False)
    with bar:
        objective = Objective(case, ranges, misfit, bar)
        place, ended = _search(objective, _spread(ranges, int(starts), seed), int(max_steps))
        answer = _conclude(objective, place, level, converged=ended)
    for sentence in answer.warnings:
        warnings.warn(sentence, FitWarning, stacklevel=2)
    return answer


def _require_data(misfit: Misfit, count: int) -> None:
    """Complain about fewer data than parameters."""
    least = count if misfit.known_noise else count + 1
    if misfit.size < least:
        message = (
            f"target: {misfit.size} data for {count} parameters are too few; "
            f"allowed: {least} or more" + ("" if misfit.known_noise else " where no noise is given")
        )
        raise InputError(message)


def _spread(ranges: list[Range], count: int, seed: int) -> Iterator[NDArray[np.float64]]:
    """Yield starts over their scales: the given one, then a Latin hypercube."""
    first = np.array([entry.start / entry.scale for entry in ranges])
    yield first
    lower, upper = np.array([np.array(entry.spread) / entry.scale for entry in ranges]).T
    for place in stats.qmc.LatinHypercube(len(ranges), rng=seed).random(count - 1):
        yield lower + place * (upper - lower)


def _search(
    objective: Objective, starts: Iterator[NDArray[np.float64]], max_steps: int
) -> tuple[NDArray[np.float64], bool]:
    """Return the best place from all starts, and whether the search came to an end there."""
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
    """Return where the search from one start ends."""
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
        bounds=(objective.lower, objective.upper),
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=np.finfo(float).eps,  # ends a search that starts at a perfect fit
        # LSMR is regularised: parameters without effect do not hold up the others. It searches
        # a plane, which a single parameter does not span.
        tr_solver="lsmr" if len(start) > 1 else "exact",
        max_nfev=max_steps,
    )


def _conclude(
    objective: Objective, place: NDArray[np.float64], level: float, *, converged: bool
) -> Fit:
    """Return the fit at the place that the search has found."""
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
        least = np.finfo(float).eps * target_size / np.sqrt(len(residual))
        deviation = max(float(np.sqrt(residual @ residual / freedom)), least)
    size = deviation * relative * objective.scale
    names = [entry.name for entry in objective.ranges] + [SHIFT] * objective.misfit.free_shift
    answer = Fit(
        names=tuple(names),
        units=(*(entry.unit for entry in objective.ranges), *["s"] * objective.misfit.free_shift),
        estimate=place * objective.scale,
        covariance=known.covariance * np.outer(size, size),
        limits=np.column_stack([objective.lower, objective.upper]) * objective.scale[:, np.newaxis],
        singular_values=known.singular_values,
        level=float(level),
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
    """Return what is doubtful about a fit, as sentences; covariance of relative values."""
    found = []
    if not answer.converged:
        found.append("the search has not come to an end; allow more steps, or start elsewhere")
    found += [null_sentence(answer.names, direction) for direction in known.null]
    freedom = answer.degrees_of_freedom
    factor = coverage_factor(answer.level, None if answer.known_noise else freedom)
    count = objective.count
    for deviation, direction in worst_directions(covariance[:count, :count], WIDE / factor):
        found.append(
            weak_sentence(answer.names[:count], direction, factor * deviation, answer.level)
        )
    for entry, value, lower, upper in zip(
        objective.ranges, place, objective.lower, objective.upper, strict=False
    ):
        if min(value - lower, upper - value) < AT_LIMIT:
            limit = (lower if value - lower < upper - value else upper) * entry.scale
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
