"""The search for the parameters of a model that fit a target best."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats
from scipy.optimize import least_squares
from tqdm import tqdm

from thud.case import Case
from thud.checks import require_kind
from thud.errors import FitWarning, InputError, NumericalError, ThudError
from thud.fitting.force_target import ForceTarget
from thud.fitting.inference import Inference, infer, null_sentence, weak_sentence, worst_directions
from thud.fitting.level_target import LevelTarget
from thud.fitting.parameters import get_ranges, with_values
from thud.fitting.result import SHIFT, Fit, coverage_factor, require_level
from thud.impact import Impact, solve_case

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from numpy.typing import ArrayLike, NDArray

    from thud.fitting.misfit import Misfit
    from thud.fitting.parameters import Parameter, Range
    from thud.recording import Recording

# Relative step of the central differences. The forces are smooth to 1e-13, but samples at which
# contact ends or begins bend them: 1e-3 would step over such bends, 1e-5 hardly ever does, and its
# derivatives hold to 1e-7 (of a ball with rising loss factor, whose contact flickers, to 3e-3).
STEP = 2e-5
# What a shift in time is measured in, s.
SHIFT_SCALE = 1e-3
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
    for name, value in (("starts", starts), ("max_steps", max_steps)):
        if not isinstance(value, int | np.integer) or value < 1:
            message = f"{name} = {value!r} is not allowed; allowed: whole numbers from 1"
            raise InputError(message)
    ranges = get_ranges(case, parameters)
    misfit = (
        target if isinstance(target, ForceTarget | LevelTarget) else ForceTarget(target)
    ).misfit()
    _require_data(misfit, len(ranges) + misfit.free_shift)
    bar: tqdm[Any] = tqdm(unit="impact", disable=not progress, leave=False)
    with bar:
        search = _Search(case, ranges, misfit, bar)
        found = search.run(_spread(ranges, int(starts), seed), int(max_steps))
        answer = search.conclude(*found, level)
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
    random = np.random.default_rng(seed)
    rows = count - 1
    cells = np.column_stack([random.permutation(rows) for _ in ranges])
    for place in (cells + random.random(cells.shape)) / max(rows, 1):
        yield lower + place * (upper - lower)


class _Search:
    """Residuals and derivatives of a case; parameters are divided by their scales."""

    def __init__(self, case: Case, ranges: list[Range], misfit: Misfit, bar: tqdm[Any]) -> None:
        self.case, self.ranges, self.misfit, self.bar = case, ranges, misfit, bar
        self.count = len(ranges)
        self.scale = np.array([entry.scale for entry in ranges] + [SHIFT_SCALE] * misfit.free_shift)
        shift = [np.inf] * misfit.free_shift
        self.lower = np.array([entry.lower for entry in ranges] + [-x for x in shift]) / self.scale
        self.upper = np.array([entry.upper for entry in ranges] + shift) / self.scale
        self.evaluations = self.failures = 0
        self.error: ThudError | None = None
        self._last: tuple[bytes, Impact] | None = None

    def case_at(self, place: NDArray[np.float64]) -> Case:
        """Return the case of a place."""
        values = place[: self.count] * self.scale[: self.count]
        names = (entry.name for entry in self.ranges)
        return with_values(self.case, dict(zip(names, map(float, values), strict=True)))

    def impact(self, place: NDArray[np.float64]) -> Impact | None:
        """Return the impact of a place, or None where there is none."""
        key = place[: self.count].tobytes()
        if self._last and self._last[0] == key:
            return self._last[1]
        self.evaluations += 1
        self.bar.update()
        try:
            impact = solve_case(self.case_at(place))
        except ThudError as error:
            self.failures += 1
            self.error = error
            return None
        self._last = key, impact
        return impact

    def shift(self, place: NDArray[np.float64]) -> float:
        """Return the time of first touch of a place, s."""
        return float(place[-1] * SHIFT_SCALE) if self.misfit.free_shift else 0.0

    def residual(self, place: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the residuals of a place; infinite where there is no impact."""
        impact = self.impact(place)
        if impact is None:
            return np.full(self.misfit.size, np.inf)
        return self.misfit.residual(impact, self.shift(place))

    def jacobian(self, place: NDArray[np.float64], step: float = STEP) -> NDArray[np.float64]:
        """Return the derivatives of the residuals, shape (n_residual, n)."""
        here = self.residual(place)
        columns = [self._column(place, i, step, here) for i in range(self.count)]
        if self.misfit.free_shift and (impact := self.impact(place)):
            slope = self.misfit.shift_derivative(impact, self.shift(place))
            columns.append(SHIFT_SCALE * slope)
        return np.column_stack(columns)

    def _column(
        self, place: NDArray[np.float64], i: int, step: float, here: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the derivative with one parameter; of one side where the other is impossible."""
        ends = []
        for beside in (min(place[i] + step, self.upper[i]), max(place[i] - step, self.lower[i])):
            other = place.copy()
            other[i] = beside
            value = self.residual(other)
            possible = np.isfinite(value).all()
            ends.append((beside, value) if possible else (place[i], here))
        (above, high), (below, low) = ends
        if above == below:
            message = (
                f"{self.ranges[i].name}: the model cannot be computed around "
                f"{place[i] * self.scale[i]:g} ({self.error})"
            )
            raise NumericalError(message)
        column: NDArray[np.float64] = (high - low) / (above - below)
        return column

    def run(
        self, starts: Iterator[NDArray[np.float64]], max_steps: int
    ) -> tuple[NDArray[np.float64], bool]:
        """Return the best place from all starts, and whether the search came to an end there."""
        best: tuple[float, NDArray[np.float64], bool] | None = None
        for start in starts:
            first = self.impact(start)
            if first is None:
                continue
            if self.misfit.free_shift:
                start = np.append(start, self.misfit.first_shift(first) / SHIFT_SCALE)  # noqa: PLW2901
            done = least_squares(
                self.residual,
                start,
                self.jacobian,
                bounds=(self.lower, self.upper),
                ftol=TOLERANCE,
                xtol=TOLERANCE,
                gtol=None,
                # Regularised: parameters without effect do not hold up the others.
                tr_solver="lsmr",
                max_nfev=max_steps,
            )
            if best is None or done.cost < best[0]:
                best = float(done.cost), done.x, bool(done.status > 0)
        if best is None:
            message = f"the start cannot be computed: {self.error}"
            raise type(self.error or NumericalError())(message)
        return best[1:]

    def conclude(self, place: NDArray[np.float64], converged: bool, level: float) -> Fit:  # noqa: FBT001
        """Return the fit at the place that the search has found."""
        residual = self.residual(place)
        impact = self.impact(place)
        if impact is None:
            raise NumericalError(str(self.error))
        jacobian = self.jacobian(place)
        finer = self.jacobian(place, STEP / 2)
        length = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
        error = float((np.linalg.norm(jacobian - finer, axis=0) / length).max())
        target_size = float(np.linalg.norm(self.misfit.target_vector()))
        # Relative to the values found, a change along a direction reads as one in per cent.
        relative = np.where(np.abs(place) > AT_LIMIT, np.abs(place), 1.0)
        if self.misfit.free_shift:
            relative[-1] = 1.0
        known = infer(jacobian * relative, error, target_size)
        freedom = len(residual) - len(place)
        deviation = 1.0
        if not self.misfit.known_noise:
            least = np.finfo(float).eps * target_size / np.sqrt(len(residual))
            deviation = max(float(np.sqrt(residual @ residual / freedom)), least)
        size = deviation * relative * self.scale
        names = [entry.name for entry in self.ranges] + [SHIFT] * self.misfit.free_shift
        answer = Fit(
            names=tuple(names),
            units=(*(entry.unit for entry in self.ranges), *["s"] * self.misfit.free_shift),
            estimate=place * self.scale,
            covariance=known.covariance * np.outer(size, size),
            singular_values=known.singular_values,
            level=float(level),
            noise=deviation * self.misfit.unit_deviation,
            known_noise=self.misfit.known_noise,
            residuals=residual / deviation,
            evaluations=self.evaluations,
            failures=self.failures,
            converged=converged,
            warnings=(),
            case=self.case_at(place),
            impact=impact,
            misfit=self.misfit,
        )
        doubts = self._doubts(answer, place, known, known.covariance * deviation**2)
        return replace(answer, warnings=tuple(doubts))

    def _doubts(
        self,
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
        factor = coverage_factor(answer, answer.level)
        count = self.count
        for deviation, direction in worst_directions(covariance[:count, :count], WIDE / factor):
            found.append(
                weak_sentence(answer.names[:count], direction, factor * deviation, answer.level)
            )
        for entry, value, lower, upper in zip(
            self.ranges, place, self.lower, self.upper, strict=False
        ):
            if min(value - lower, upper - value) < AT_LIMIT:
                limit = (lower if value - lower < upper - value else upper) * entry.scale
                found.append(
                    f"{entry.name} ended at its limit, {limit:g} {entry.unit}".rstrip()
                    + ": the intervals hold for values inside the limits only"
                )
        freedom = answer.degrees_of_freedom
        square = float(answer.residuals @ answer.residuals)
        if answer.known_noise and freedom and stats.chi2.sf(square, freedom) < UNLIKELY:
            found.append(
                f"the residuals are {np.sqrt(square / freedom):.3g} times what the given "
                "uncertainty lets expect: the model does not explain the data"
            )
        elif doubt := self.misfit.doubt(answer.impact, answer.time_shift, len(place)):
            found.append(doubt)
        return found
