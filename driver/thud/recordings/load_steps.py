"""Steps of a known force in a record, also behind an amplifier that droops."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import fdtrc, stdtrit

from thud.base.checks import refuse
from thud.level.estimate import NORMAL_FACTOR

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Number of means in the running median that ignores knocks, and minimum number in a plateau.
MEDIAN = 5
MIN_PLATEAU = 8
# Time within which a step changes the level, s, and its maximum as a fraction of the record.
LAG = 0.7
MAX_LAG = 1 / 12
# Fraction of the largest change within this time that is a step.
STEP = 0.5
# Fraction of a plateau that is ignored at either end.
SETTLING = 0.15
# A plateau is reduced to about this many means, within which noise may be correlated.
BLOCKS = 24
# Number of trial rates (reciprocals of the time constant), and the smallest times the duration. The
# largest is the reciprocal of the lag.
TRIALS, MIN_RATE = 40, 1e-3
# Maximum decay within the lag, in time constants: a faster one is hardly distinguished from a step.
MAX_DECAY = 0.5
# Degree of the drift.
DRIFT = 2
# Prior standard deviation of what still decays when the record begins, in ranges of the level.
EARLIER = 2.0
# Degree of the polynomials, for each plateau, that search for other curvature.
DEGREE = 3
# Probability of noise below which such curvature is significant. The uncertainty then includes its
# root mean square times MISFIT_WEIGHT, up to MAX_MISFIT of the step.
SIGNIFICANT = 1e-4
MISFIT_WEIGHT = 30.0
MAX_MISFIT = 1e-2
# Standard deviations from zero beyond which a change of the drift is significant. It may be another
# curvature in disguise: the uncertainty includes its effect.
SIGNIFICANT_DRIFT = 2.5
# Standard deviations beyond which a second time constant is significant. The uncertainty includes
# its effect.
SIGNIFICANT_SECOND = 3.0
# A plateau is clipped if more than this fraction of its sections reach full scale, or the extreme
# value of the record while the extremes of adjacent sections of another plateau differ by more than
# this many steps of quantization. Fraction of full scale from which a value is clipped.
CUT = 0.2
MIN_NOISE = 3.0
CLIPPED = 0.999
# Relative singular values below this are zero.
NEGLIGIBLE = 1e-6


class Level(NamedTuple):
    """Mean, minimum and maximum of each section of a record."""

    mean: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


class Plateau(NamedTuple):
    """First and stop index of the means of a plateau."""

    start: int
    stop: int


class Rate(NamedTuple):
    """Reciprocal of a time constant and its standard uncertainty, per mean or per second."""

    value: float
    uncertainty: float


class Steps(NamedTuple):
    """Magnitude of each step, standard uncertainty of their mean, and the rate of the droop.

    Then the signs of the steps, and if a rate was stated, the one that the record alone shows.
    """

    sizes: NDArray[np.float64]
    uncertainty: float
    rate: Rate
    signs: NDArray[np.float64]
    shown: Rate | None = None


def measure_steps(
    record: Level,
    interval: float | None,
    name: str,
    stated: Rate | None = None,
    full_scale: float | None = None,
) -> Steps:
    """Return the steps of a record, the interval of whose sections is in s if it is known.

    The rate of the droop is fitted unless it is stated as exact. Raise InputError if there is no
    clear step, if a plateau is clipped, or if the level between the steps fits no exponential
    decay.
    """
    level = record.mean
    if not np.isfinite(level).all():
        refuse(f"{name}: a value is not finite", "real numbers")
    longest = max(1, int(MAX_LAG * len(level)))
    lag = longest if interval is None else min(longest, max(1, round(LAG / interval)))
    edges = [(0, 0), *_edges(level, lag), (len(level), len(level))]
    middles = [(first + last) // 2 for first, last in edges]
    plateaus = []
    for (_, start), (stop, _) in itertools.pairwise(edges):
        ignored = max(1, int(SETTLING * (stop - start)))
        plateaus.append(Plateau(start + ignored, stop - ignored))
    shortest = min(plateau.stop - plateau.start for plateau in plateaus)
    if len(edges) < 3 or min(np.diff(middles)) < MIN_PLATEAU or shortest <= DEGREE:  # noqa: PLR2004
        refuse(
            f"{name}: has no clear step", "a record in which a known force is put on or taken off"
        )
    _refuse_clipped(record, plateaus, name, full_scale)
    steps, misfit = _fit_steps(level, plateaus, lag, stated)
    if MISFIT_WEIGHT * misfit > MAX_MISFIT:
        refuse(
            f"{name}: the level between the steps deviates by {misfit:.2g} of the step from any "
            "exponential decay with a drift",
            "an amplifier with one time constant, a force and a temperature that are constant",
        )
    if steps.rate.value * lag > MAX_DECAY:
        refuse(
            f"{name}: the level decays to 1/e within {1 / steps.rate.value / len(level):.2g} of "
            "the record, too fast for a step to be distinguished from the decay",
            f"a time constant of {lag / MAX_DECAY / len(level):.2g} of the record or more",
        )
    if stated:
        steps = steps._replace(shown=_fit_steps(level, plateaus, lag, None)[0].rate)
    return steps


def _refuse_clipped(
    record: Level, plateaus: list[Plateau], name: str, full_scale: float | None
) -> None:
    """Raise InputError if a plateau is at full scale, or at one value while another has noise."""
    for values, extreme, side in (
        (record.high, float(record.high.max()), "maximum"),
        (-record.low, float(-record.low.min()), "minimum"),
    ):
        parts = [values[plateau.start : plateau.stop] for plateau in plateaus]
        # The quantization of a record is no noise.
        levels = np.unique(np.concatenate(parts))
        step = float(np.diff(levels).min(initial=math.inf))
        noises = [float(np.median(np.abs(np.diff(part)))) for part in parts]
        is_noisy = max(noises) > MIN_NOISE * step
        for plateau, part in zip(plateaus, parts, strict=True):
            at_scale = full_scale is not None and np.mean(part >= CLIPPED * full_scale) > CUT
            if at_scale or (is_noisy and np.mean(part == extreme) > CUT):
                value = extreme if side == "maximum" else -extreme
                cause = (
                    "at full scale"
                    if at_scale
                    else f"at {value:.5g}, the {side} of the record, while another one has noise"
                )
                refuse(
                    f"{name}: the plateau from {plateau.start / len(values):.0%} to "
                    f"{plateau.stop / len(values):.0%} of the record is clipped, {cause}",
                    "a measuring range that includes the known force",
                )


def _edges(level: NDArray[np.float64], lag: int) -> list[tuple[int, int]]:
    """Return the first and the stop index of the means of each step."""
    if len(level) <= MEDIAN + lag:
        return []
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(level, MEDIAN), axis=1)
    change = smooth[lag:] - smooth[:-lag]
    index = np.flatnonzero(np.abs(change) > STEP * np.abs(change).max())
    if not index.size:
        return []
    breaks = (np.diff(index) > lag) | (np.diff(np.sign(change[index])) != 0)
    offset = MEDIAN // 2 + (lag + 1) / 2
    edges = []
    for run in np.split(index, np.flatnonzero(breaks) + 1):
        size = np.abs(change[run])
        top = run[size > STEP * size.max()]
        edges.append((int(top[0] + offset), math.ceil(top[-1] + offset)))
    return edges


class _Droop:
    """Model of the plateaus behind a first-order high-pass; times are in means.

    Plateau k, which begins at t_k, has the level B(t) + (v_k - B(t_k)) exp(-rate (t - t_k)), where
    B(t) = v_0 + u + d x + c x**2, x = (t - t_0) / duration, is that without a force. It is linear
    in the parameters: the levels v_k, what still decays when the record begins (-u), and the drift
    d, c.
    """

    def __init__(
        self, level: NDArray[np.float64], plateaus: list[Plateau], stated: Rate | None
    ) -> None:
        self.level, self.plateaus, self.stated = level, plateaus, stated
        self.range = float(np.ptp(level))
        self.origin, self.duration = plateaus[0].start - 0.5, len(level)
        count = len(plateaus)
        begins = np.array([plateau.start - 0.5 for plateau in plateaus])
        # Coefficients of v_k - B(t_k).
        self.excess = np.eye(count, count + 1 + DRIFT) - self.baseline(begins)
        self.times = [_blocks(plateau) for plateau in plateaus]
        self.index = np.repeat(np.arange(count), [len(time) for time in self.times])
        self.values = np.concatenate([level[time].mean(axis=1) for time in self.times])
        self.baselines = np.concatenate([self.baseline(time).mean(axis=1) for time in self.times])
        self.delays = [time - begin for time, begin in zip(self.times, begins, strict=True)]

    def baseline(self, time: NDArray[Any]) -> NDArray[np.float64]:
        """Return the coefficients of the level without a force, shape (..., n_parameter)."""
        rows = np.zeros((*time.shape, len(self.plateaus) + 1 + DRIFT))
        rows[..., 0] = 1.0
        rows[..., -1 - DRIFT :] = ((time - self.origin) / self.duration)[..., None] ** np.arange(
            DRIFT + 1
        )
        return rows

    def design(self, rate: float) -> NDArray[np.float64]:
        """Return the coefficients of the values, shape (n_value, n_parameter)."""
        decay = np.concatenate([np.exp(-rate * delay).mean(axis=1) for delay in self.delays])
        return self.baselines + decay[:, None] * self.excess[self.index]

    def slope(self, rate: float, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of the values by the rate, shape (n_value,)."""
        slope = [(-delay * np.exp(-rate * delay)).mean(axis=1) for delay in self.delays]
        return np.asarray(np.concatenate(slope) * (self.excess[self.index] @ parameters))

    def priors(self, noise: float) -> NDArray[np.float64]:
        """Return the rows of the priors, those of the parameters and of the rate."""
        rows = np.zeros((2, self.excess.shape[1] + 1))
        rows[0, -2 - DRIFT] = noise / (EARLIER * self.range)
        if self.stated and self.stated.uncertainty:
            rows[1, -1] = noise / self.stated.uncertainty
        return rows

    def solve(self, rate: float, noise: float) -> tuple[NDArray[np.float64], float]:
        """Return the parameters at a rate and the sum of squares, both with the priors."""
        priors = self.priors(noise)
        rows = np.vstack([self.design(rate), priors[:1, :-1]])
        right = np.append(self.values, 0.0)
        parameters = np.linalg.lstsq(rows, right, rcond=None)[0]
        residual = right - rows @ parameters
        square = float(residual @ residual)
        if self.stated:
            square += float(priors[1, -1] * (rate - self.stated.value)) ** 2
        return parameters, square

    def best_rate(self, noise: float, highest: float) -> float:
        """Return the rate of the least sum of squares, 0 or more."""

        def square(rate: float) -> float:
            return self.solve(rate, noise)[1]

        trials = np.append(0.0, np.geomspace(MIN_RATE / self.duration, highest, TRIALS))
        best = int(np.argmin([square(rate) for rate in trials]))
        low, high = trials[max(best - 1, 0)], trials[min(best + 1, TRIALS)]
        tolerance = {"xatol": 1e-6 * (high - low)}
        found = minimize_scalar(square, bounds=(low, high), method="bounded", options=tolerance).x
        return 0.0 if low == 0 and square(0.0) <= square(found) else float(found)

    def steps(
        self, rate: float, parameters: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
        """Return the steps, their derivatives by parameters and rate, and the means between.

        A step is the change of the level plus what has decayed meanwhile, the rate times the
        integral of the recorded level: the inverse of a high-pass, however the force was put on.
        """
        sizes, gradients, between = [], [], 0
        for k, (before, after) in enumerate(itertools.pairwise(self.plateaus)):
            time = np.arange(before.stop, after.start)
            delay = before.stop - before.start
            # The difference to the level without a force: after the step, and before it.
            last = math.exp(-rate * delay) * self.excess[k]
            decayed = self.level[time].sum() - self.baseline(time).sum(axis=0) @ parameters
            gradient = self.excess[k + 1] - last - rate * self.baseline(time).sum(axis=0)
            slope = delay * last @ parameters + decayed
            sizes.append((self.excess[k + 1] - last) @ parameters + rate * decayed)
            gradients.append([*gradient, slope])
            between += len(time)
        return np.array(sizes), np.array(gradients), between


def _blocks(plateau: Plateau) -> NDArray[np.int64]:
    """Return the indices of the means in each value of a plateau, shape (n_value, width)."""
    width = max(1, (plateau.stop - plateau.start) // BLOCKS)
    count = (plateau.stop - plateau.start) // width
    return np.arange(plateau.start, plateau.start + count * width).reshape(count, width)


def _fit_steps(
    level: NDArray[np.float64], plateaus: list[Plateau], lag: int, stated: Rate | None
) -> tuple[Steps, float]:
    """Return the steps between plateaus, and other curvature as a fraction of the mean step."""
    droop = _Droop(level, plateaus, stated)
    fixed = stated is not None and not stated.uncertainty
    used = slice(None, -1 if fixed else None)
    freedom = max(len(droop.values) - droop.excess.shape[1] - (not fixed), 1)
    rate, noise = stated.value if stated else 0.0, 1e-12 * droop.range
    # The weight of the priors depends on the noise.
    for _ in range(2):
        if not fixed:
            rate = droop.best_rate(noise, 1 / lag)
        parameters, square = droop.solve(rate, noise)
        noise = max(math.sqrt(square / freedom), noise)
    jacobian = np.column_stack([droop.design(rate), droop.slope(rate, parameters)])[:, used]
    residual = droop.values - droop.design(rate) @ parameters
    rows = np.vstack([jacobian, droop.priors(noise)[:, used]])
    scale = np.linalg.norm(rows, axis=0)
    inverse = np.linalg.pinv(rows / scale) / scale[:, None]
    covariance = noise**2 * inverse @ inverse.T
    sizes, gradients, between = droop.steps(rate, parameters)
    gradient = np.sign(sizes) @ gradients[:, used] / len(sizes)
    width = max(time.shape[1] for time in droop.times)
    variance = gradient @ covariance @ gradient
    variance += (rate * noise / len(sizes)) ** 2 * between * width
    deviation = math.sqrt(variance) * float(stdtrit(freedom, 0.975)) / NORMAL_FACTOR
    last = droop.excess.shape[1] - 1
    if abs(parameters[last]) > SIGNIFICANT_DRIFT * math.sqrt(covariance[last, last]):
        effect = parameters[last] * (gradient @ covariance)[last] / covariance[last, last]
        deviation = math.hypot(deviation, effect)
    signs, sizes = np.sign(sizes), np.abs(sizes)
    if len(sizes) > 1:
        deviation = max(deviation, float(sizes.std(ddof=1)) / math.sqrt(len(sizes)))
    # A rate at its bound fits nothing.
    misfit = _misfit(droop, jacobian[:, : droop.excess.shape[1] + (rate > 0)], residual)
    deviation = math.hypot(deviation, MISFIT_WEIGHT * misfit)
    if rate > 0 and not fixed:
        # A second high-pass in series.
        projection = jacobian @ inverse[:, : len(residual)]
        lost = _lost_level(droop, projection, residual, parameters, noise)
        if lost is not None:
            other = _Droop(level + lost, plateaus, stated)
            first = other.best_rate(noise, 1 / lag)
            changed = np.abs(other.steps(first, other.solve(first, noise)[0])[0])
            deviation = math.hypot(deviation, float(changed.mean() - sizes.mean()))
    fitted = Rate(rate, 0.0 if fixed else math.sqrt(covariance[-1, -1]))
    return Steps(sizes, deviation, fitted, signs), misfit / float(sizes.mean())


def _lost_level(
    droop: _Droop,
    projection: NDArray[np.float64],
    residual: NDArray[np.float64],
    parameters: NDArray[np.float64],
    noise: float,
) -> NDArray[np.float64] | None:
    """Return the level that a second high-pass in series has taken away, if it is significant."""
    time = np.arange(len(droop.level))
    integral = np.cumsum(droop.level - droop.baseline(time) @ parameters)
    curve = np.concatenate([integral[block].mean(axis=1) for block in droop.times])
    curve -= projection @ curve
    square, product = float(curve @ curve), float(curve @ residual)
    if abs(product) < SIGNIFICANT_SECOND * noise * math.sqrt(square):
        return None
    return -product / square * integral


def _misfit(droop: _Droop, jacobian: NDArray[np.float64], residual: NDArray[np.float64]) -> float:
    """Return the root mean square of the significant curvature in the residual, or 0."""
    curves = np.zeros((len(residual), len(droop.times) * DEGREE))
    for k, time in enumerate(droop.times):
        position = np.linspace(-1, 1, len(time))
        columns = np.polynomial.legendre.legvander(position, DEGREE)[:, 1:]
        curves[droop.index == k, k * DEGREE : (k + 1) * DEGREE] = columns
    scale = np.linalg.norm(jacobian, axis=0)
    fitted, sizes, _ = np.linalg.svd(jacobian / np.where(scale > 0, scale, 1), full_matrices=False)
    fitted = fitted[:, sizes > NEGLIGIBLE * sizes[0]]
    curves, sizes, _ = np.linalg.svd(curves - fitted @ (fitted.T @ curves), full_matrices=False)
    curves = curves[:, sizes > NEGLIGIBLE * sizes[0]]
    count = curves.shape[1]
    freedom = len(residual) - fitted.shape[1] - count
    explained = float(np.sum((curves.T @ residual) ** 2))
    rest = float(residual @ residual) - explained
    if freedom < 1 or not rest > 0:
        return 0.0
    probability = fdtrc(count, freedom, explained / count / (rest / freedom))
    return math.sqrt(explained / len(residual)) if probability < SIGNIFICANT else 0.0
