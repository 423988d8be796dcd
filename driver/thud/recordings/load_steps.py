"""Steps of a known force in a record, also behind an amplifier that droops."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.linalg import orth
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
# Maximum decay within the lag, in time constants: a faster one is hardly distinguished from a step.
MAX_DECAY = 0.5
# Degree of the drift.
DRIFT = 2
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
    steps, misfit = _fit_steps(level, plateaus, stated)
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
        steps = steps._replace(shown=_fit_steps(level, plateaus, None)[0].rate)
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


class _Plateaus:
    """The plateaus of a level, each reduced to means within which noise may be correlated.

    A first-order high-pass of rate r, the reciprocal of its time constant, changes a force f to a
    level v with v' = f' - r (v - b), where b is the level without a force: on plateau k,
    v + r (integral of v) = f_k + a drift. This is linear in f_k, the drift and r, however the force
    was put on, and whatever decays when the record begins.
    """

    def __init__(self, level: NDArray[np.float64], plateaus: list[Plateau]) -> None:
        self.blocks = [_blocks(plateau) for plateau in plateaus]
        self.index = np.repeat(np.arange(len(plateaus)), [len(block) for block in self.blocks])
        self.values = self.means(level)
        position = self.means(np.arange(len(level)) / len(level))
        levels = self.index[:, None] == np.arange(len(plateaus))
        self.columns = np.hstack([levels, position[:, None] ** np.arange(1, DRIFT + 1)])
        # The mean is a linear drift of the integral.
        self.integral = _integral(level - level.mean())

    def means(self, values: NDArray[Any]) -> NDArray[np.float64]:
        """Return the means of values of each index over the blocks, shape (n_block,)."""
        return np.concatenate([values[block].mean(axis=1) for block in self.blocks])


def _blocks(plateau: Plateau) -> NDArray[np.int64]:
    """Return the indices of the means in each value of a plateau, shape (n_value, width)."""
    width = max(1, (plateau.stop - plateau.start) // BLOCKS)
    count = (plateau.stop - plateau.start) // width
    return np.arange(plateau.start, plateau.start + count * width).reshape(count, width)


def _integral(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the integral of values from the first to the middle of each."""
    return np.asarray(np.cumsum(values) - values / 2)


def _fit_steps(
    level: NDArray[np.float64], plateaus: list[Plateau], stated: Rate | None
) -> tuple[Steps, float]:
    """Return the steps between plateaus, and other curvature as a fraction of the mean step."""
    data = _Plateaus(level, plateaus)
    count = len(plateaus)
    droop = -data.means(data.integral)
    fixed = stated is not None and not stated.uncertainty
    design = data.columns if fixed else np.column_stack([data.columns, droop])
    values = data.values - droop * stated.value if stated and fixed else data.values
    fit = _LeastSquares(design, values)
    if stated and not fixed:
        fit = _LeastSquares(design, values, (stated.value, stated.uncertainty / fit.noise))
    rate = stated.value if stated and fixed else max(float(fit.parameters[-1]), 0.0)
    # A rate of zero fits nothing, but is uncertain.
    used = design if fixed or rate else data.columns
    parameters = fit.parameters if used is design else _LeastSquares(used, values).parameters
    sizes = np.diff(parameters[:count])
    signs = np.sign(sizes)
    gradient = np.zeros(design.shape[1])
    gradient[:count] = -np.diff(signs, prepend=0, append=0) / len(sizes)
    variance = float(gradient @ fit.covariance @ gradient)
    # The integral of the noise between the plateaus, at random from one mean to the next.
    between = sum(after.start - before.stop for before, after in itertools.pairwise(plateaus))
    width = max(block.shape[1] for block in data.blocks)
    variance += (rate * fit.noise / len(sizes)) ** 2 * between * width
    deviation = math.sqrt(variance) * float(stdtrit(fit.freedom, 0.975)) / NORMAL_FACTOR
    if not rate:
        # A droop makes a linear drift of the level a quadratic one of its integral.
        deviation = math.hypot(deviation, fit.effect_without(count + DRIFT - 1, gradient))
    sizes = np.abs(sizes)
    if len(sizes) > 1:
        deviation = max(deviation, float(sizes.std(ddof=1)) / math.sqrt(len(sizes)))
    if rate and not fixed:
        # A second high-pass in series takes away the integral of the integral, too.
        twice = data.means(_integral(data.integral))
        further = _LeastSquares(np.column_stack([design, twice]), values)
        if further.significance(-1) > SIGNIFICANT_SECOND:
            changed = float(gradient @ (further.parameters[:-1] - fit.parameters))
            deviation = math.hypot(deviation, changed)
    misfit = _misfit(data, used, values - used @ parameters)
    deviation = math.hypot(deviation, MISFIT_WEIGHT * misfit)
    fitted = Rate(rate, 0.0 if fixed else math.sqrt(fit.covariance[-1, -1]))
    return Steps(sizes, deviation, fitted, signs), misfit / float(sizes.mean())


class _LeastSquares:
    """Least squares of values by columns; the last parameter may have a prior.

    The prior is its mean, and its standard deviation in standard deviations of the noise.
    """

    def __init__(
        self,
        columns: NDArray[np.float64],
        values: NDArray[np.float64],
        prior: tuple[float, float] | None = None,
    ) -> None:
        rows, right = columns, values
        if prior:
            row = np.zeros(columns.shape[1])
            row[-1] = 1 / prior[1]
            rows, right = np.vstack([columns, row]), np.append(values, prior[0] / prior[1])
        scale = np.linalg.norm(rows, axis=0)
        inverse = np.linalg.pinv(rows / scale) / scale[:, None]
        self.parameters = inverse @ right
        self.freedom = max(len(right) - columns.shape[1], 1)
        square = float(((right - rows @ self.parameters) ** 2).sum())
        self.noise = max(math.sqrt(square / self.freedom), 1e-12 * float(np.ptp(values)))
        self.covariance = self.noise**2 * inverse @ inverse.T

    def significance(self, index: int) -> float:
        """Return the magnitude of a parameter in its standard deviations."""
        return abs(float(self.parameters[index])) / math.sqrt(self.covariance[index, index])

    def effect_without(self, index: int, gradient: NDArray[np.float64]) -> float:
        """Return the change of a weighted sum without a parameter; 0 if that is not significant."""
        if self.significance(index) < SIGNIFICANT_DRIFT:
            return 0.0
        ratio = (gradient @ self.covariance)[index] / self.covariance[index, index]
        return float(self.parameters[index] * ratio)


def _misfit(data: _Plateaus, design: NDArray[np.float64], residual: NDArray[np.float64]) -> float:
    """Return the root mean square of the significant curvature in the residual, or 0."""
    curves = np.zeros((len(residual), len(data.blocks) * DEGREE))
    for k, block in enumerate(data.blocks):
        position = np.linspace(-1, 1, len(block))
        columns = np.polynomial.legendre.legvander(position, DEGREE)[:, 1:]
        curves[data.index == k, k * DEGREE : (k + 1) * DEGREE] = columns
    fitted = orth(design / np.linalg.norm(design, axis=0), NEGLIGIBLE)
    curves = orth(curves - fitted @ (fitted.T @ curves), NEGLIGIBLE)
    count = curves.shape[1]
    freedom = len(residual) - fitted.shape[1] - count
    explained = float(np.sum((curves.T @ residual) ** 2))
    rest = float(residual @ residual) - explained
    if freedom < 1 or not rest > 0:
        return 0.0
    probability = fdtrc(count, freedom, explained / count / (rest / freedom))
    return math.sqrt(explained / len(residual)) if probability < SIGNIFICANT else 0.0
