"""First touch and release from the flanks of a pulse (docs/recordings_theory.md, section 3)."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import ndtri
from scipy.stats import qmc

from thud.impact.contact_time import AVERAGING_WIDTH, THRESHOLD, average_within
from thud.level.estimate import Estimate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.response import Chain

# A flank is a sum of shapes, t in ms since the touch: a jump, a jump that a filter spreads over a
# sampling interval, powers t**n, a parabola, and a random walk between knots. Powers: bodies that
# touch over an area, and a sphere that touches at a point (Hertz).
POWERS = np.array([1.0, 1.5])
# Spacing about 20 % of the time, from that of the finest cells to the end of the longest flank.
KNOTS = np.array([
    0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5, 4.0, 6.0,
    9.0,
])  # fmt: skip
# Number of jumps.
N_JUMP = 2


class _Kind(NamedTuple):
    """A kind of flank: prior distribution of its shapes, as fractions of the peak force.

    Attributes
    ----------
    mean, spread : tuple of float
        Means and standard deviations of the powers.
    walk : float
        Smooth kinds: standard deviation of a step of the walk, as a fraction of the increment of
        the mean flank between the same knots. Rough kinds: standard deviation of the walk after
        1 ms.
    probability : tuple of float
        Prior probability at touch and at release.
    error : float
        Standard uncertainty of begin or end of the contact due to the shapes, s.
    jump : float
        Standard deviation of each of the jumps.
    parabola : float
        Standard deviation of the parabola.
    rough : bool
        Whether the force may fall during the flank.
    """

    mean: tuple[float, float]
    spread: tuple[float, float]
    walk: float
    probability: tuple[float, float]
    error: float
    jump: float = 0.0
    parabola: float = 0.0
    rough: bool = False


# Slope and curvature of lines: of a half sine of 20 ms (0.157 per ms, and no curvature), with
# deviations that include its double and half, and the curvature of contacts of 12 ms (pi/12 squared
# is 0.07).
_LINE, _PARABOLA = ((0.16, 0.0), (0.08, 0.0)), 0.06
# Lines without and with a jump; feet with zero slope: 0.045 t**1.5 +- 56 % includes releases of
# modal balls (0.037) and finite elements (0.066); rough: rippling or steep flanks. A jump, of a
# shell up to 0.2 of the peak, is likely at touch only. Deviations of walks, probabilities and
# errors were fitted to the two models of section 7. Smooth kinds, whose force must not fall, come
# first.
KINDS = (
    _Kind(*_LINE, 0.15, (0.25, 0.40), 5e-6, parabola=_PARABOLA),
    _Kind(*_LINE, 0.15, (0.25, 0.02), 5e-6, parabola=_PARABOLA, jump=0.2),
    _Kind((0.0, 0.045), (0.0, 0.025), 0.30, (0.10, 0.40), 20e-6),
    _Kind(*_LINE, 0.15, (0.40, 0.18), 20e-6, parabola=_PARABOLA, rough=True),
)
N_SMOOTH = sum(not kind.rough for kind in KINDS)
with np.errstate(divide="ignore"):
    LOG_PRIOR = np.log([kind.probability for kind in KINDS])
ERRORS = np.array([kind.error for kind in KINDS])
# Standard uncertainty of first touch and of release due to the shapes, s: the largest of finite
# elements, whose last force is below 1 % of the peak.
TOUCH_ERRORS = (40e-6, 140e-6)
# Relative error of the force due to the shapes, and time over which it is correlated, s.
MISFIT = 0.02
CORRELATION_TIME = 2e-4
# Errors of samples due to quantization and the filter of the recorder, as a fraction of the peak.
SAMPLE_ERROR = 2e-4
# A draw is rejected if its force is negative, or falls in a smooth kind, by more than this fraction
# of the peak: a fifth of the threshold.
MAX_FALL = 0.002
# Number of candidate times in a search, and of searches. The next search covers the mean plus and
# minus SEARCH_DEVIATIONS standard deviations of the result.
N_TIME = 33
N_SEARCH = 3
SEARCH_DEVIATIONS = 6.0
# Length of a flank after the latest candidate time, s: beyond, pulses do not have these shapes.
FLANK = 3e-3
# Number of draws of each kind of flank, and minimum posterior probability of a kind.
N_DRAW = 128
MIN_PROBABILITY = 1e-6
# Weights that smooth samples, to reduce the ringing of an anti-aliasing filter.
SMOOTHING = np.array([0.25, 0.5, 0.25])
# The shapes are tabulated at ticks: step, and range before and after the touch, ms.
TICK = 1e-3
BEFORE = 2.0
AFTER = 13.0
# Margin of the table on either side, ms: the response of the correction wraps around the ends.
GUARD = 4.0
# Times after the touch at which draws are evaluated, ms.
DELAY = np.concatenate([np.linspace(0, 0.5, 51), np.linspace(0.55, 4, 70)])


def find_touch(  # noqa: PLR0913, PLR0917 - all of them describe one flank
    time: NDArray[np.float64],
    force: NDArray[np.float64],
    covariance: NDArray[np.float64],
    search: tuple[float, float],
    interval: float,
    chain: Chain | None,
    *,
    release: bool,
) -> tuple[Estimate, Estimate]:
    """Return first touch of a flank, and the time at which its force passes 1 % of the peak, s.

    Parameters
    ----------
    time, force : ndarray, shape (n_cell,)
        Middles of cells, s, and mean forces in them without background, as fractions of the peak.
    covariance : ndarray, shape (n_cell, n_cell)
        Covariance of the errors of `force`.
    search
        Earliest and latest time of first touch, s.
    interval
        Sampling interval, s.
    chain
        Instruments whose responses were corrected.
    release
        Whether the flank is the end of a pulse in reversed time.
    """
    error = np.hypot(MISFIT * force, SAMPLE_ERROR)
    correlation = np.exp(-np.abs(np.subtract.outer(time, time)) / CORRELATION_TIME)
    factor = np.linalg.cholesky(covariance + np.multiply.outer(error, error) * correlation)
    inverse = solve_triangular(factor, np.eye(len(force)), lower=True, check_finite=False)
    table = _table(1e3 * interval, chain)
    low, high = search
    for _ in range(N_SEARCH):
        candidates = np.linspace(low, high, N_TIME)
        count = int(np.searchsorted(time, high + FLANK))
        tick = np.rint(1e3 * (time[:count] - candidates[:, None]) / TICK).astype(int)
        tick = np.clip(tick + round(BEFORE / TICK), 0, len(table) - 1)
        columns = np.empty((*tick.shape, table.shape[1] + 1))
        columns[..., :-1], columns[..., -1] = table[tick], force[:count]
        logarithm, factors = _evidence(columns, inverse[:count, :count])
        logarithm += LOG_PRIOR[:, int(release), None]
        weight = np.exp(logarithm - logarithm.max())
        weight /= weight.sum()
        mean = float(weight.sum(axis=0) @ candidates)
        spacing = float((candidates[1] - candidates[0]) ** 2 / 12)
        variance = float(weight.sum(axis=0) @ (candidates - mean) ** 2) + spacing
        half_width = SEARCH_DEVIATIONS * float(np.sqrt(variance))
        if mean - half_width <= low and mean + half_width >= high:
            break
        low, high = max(low, mean - half_width), min(high, mean + half_width)
    touch, delay, kind, probability = _draw_edges(candidates, weight, factors)

    def estimate(value: NDArray[np.float64], variance: NDArray[np.float64]) -> Estimate:
        mean = float(probability @ value)
        variance = probability @ ((value - mean) ** 2 + variance)
        return Estimate(mean, float(np.sqrt(variance)))

    # A candidate time is that of the threshold only at a jump.
    return (
        estimate(touch, np.full(len(touch), spacing + TOUCH_ERRORS[release] ** 2)),
        estimate(touch + 1e-3 * delay, spacing * (delay == 0) + ERRORS[kind] ** 2),
    )


def _draw_edges(
    candidates: NDArray[np.float64],
    weight: NDArray[np.float64],
    factors: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp], NDArray[np.float64]]:
    """Return draws of touch, s, delay to 1 % of the peak, ms, and kind, with probabilities.

    The arguments are candidate times, the posterior, [n_kind, n_time], and the factors of
    `_evidence`. Draws with an implausible flank have no probability.
    """
    quantiles = (np.arange(N_DRAW) + 0.5) / N_DRAW
    normal = _normal_draws(factors.shape[-1] - 1)
    touches, forces, probabilities = [], [], []
    kinds: NDArray[np.intp] = np.flatnonzero(weight.sum(axis=1) > MIN_PROBABILITY)
    for kind, row, lower in zip(kinds, weight[kinds], factors[kinds], strict=True):
        index = np.minimum(np.searchsorted(row.cumsum(), quantiles * row.sum()), len(row) - 1)
        used, pair = np.unique(index, return_inverse=True)
        inverse = np.linalg.inv(lower[used, :-1, :-1])
        units = ((lower[index, -1, :-1] + normal)[:, None] @ inverse[pair])[:, 0]
        force = (units * SPREADS[kind] + MEANS[kind]) @ AVERAGED_SHAPES.T
        highest = np.maximum.accumulate(force, axis=1) if kind < N_SMOOTH else 0.0
        plausible = (highest - force).max(axis=1) <= MAX_FALL
        touches.append(candidates[index])
        forces.append(force)
        probabilities.append(row.sum() * np.array([plausible, np.ones(N_DRAW)]))
    probability, fallback = np.concatenate(probabilities, axis=1)
    if not probability.any():
        probability = fallback
    delay = _crossing(np.concatenate(forces), THRESHOLD)
    probability /= probability.sum()
    return np.concatenate(touches), delay, np.repeat(kinds, N_DRAW), probability


def _evidence(
    columns: NDArray[np.float64], inverse: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return logarithms of the likelihood by kind and time, and factors of the information.

    The columns, [n_time, n_cell, n_column], are the shapes and, last, the force. `inverse`, of the
    Cholesky factor of the noise covariance, whitens them. With the shapes scaled to unit prior
    deviation, X, and the force minus its prior mean, y, the information is
    [X y]'[X y] + diag(1, ..., 1, 0); the last diagonal element of its Cholesky factor is the square
    root of the residual sum of squares.
    """
    n_time, n_cell, n_column = columns.shape
    flat = np.moveaxis(columns, 1, 0).reshape(n_cell, -1)
    white = (inverse @ flat).reshape(n_cell, n_time, n_column).transpose(1, 2, 0)
    transforms = TRANSFORMS[:, None]
    information = transforms.swapaxes(2, 3) @ (white @ white.swapaxes(1, 2)) @ transforms
    shapes = np.arange(n_column - 1)
    information[..., shapes, shapes] += 1
    factors = np.asarray(np.linalg.cholesky(information), dtype=np.float64)
    diagonal = np.diagonal(factors, axis1=2, axis2=3)
    likelihood = np.log(np.diagonal(inverse)).sum() - 0.5 * diagonal[..., -1] ** 2
    return likelihood - np.log(diagonal[..., :-1]).sum(axis=-1), factors


def _crossing(force: NDArray[np.float64], level: float) -> NDArray[np.float64]:
    """Return the delays at which forces first reach a level, ms; the last delay if never."""
    above = force >= level
    rows = np.arange(len(force))
    first = np.where(above.any(axis=1), np.argmax(above, axis=1), len(DELAY) - 1)
    before = np.maximum(first - 1, 0)
    rise = force[rows, first] - force[rows, before]
    fraction = np.where(rise > 0, (level - force[rows, before]) / np.where(rise > 0, rise, 1), 1)
    delay = DELAY[before] + np.clip(fraction, 0, 1) * (DELAY[first] - DELAY[before])
    return np.asarray(delay, dtype=np.float64)


@lru_cache(maxsize=8)
def _normal_draws(count: int) -> NDArray[np.float64]:
    """Return normal draws: [N_DRAW, count]."""
    points = qmc.Sobol(count, seed=0).random(N_DRAW)
    # Shuffled: the draws must not correlate with the times, which are sorted.
    return np.asarray(np.random.default_rng(0).permutation(ndtri(points)))


@lru_cache(maxsize=4)
def _table(interval: float, chain: Chain | None) -> NDArray[np.float64]:
    """Return the shapes of a flank at ticks around the touch: [n_tick, n_column]."""
    ticks = np.arange(-round((BEFORE + GUARD) / TICK), round((AFTER + GUARD) / TICK))
    tau = np.asarray(TICK * ticks, dtype=np.float64)
    total = np.zeros((len(tau), SPREADS.shape[1]))
    for weight, shift in zip(SMOOTHING, (-1, 0, 1), strict=True):
        total += weight * _shapes(tau + shift * interval, interval)
    if chain is not None:
        frequency = np.asarray(np.fft.rfftfreq(len(tau), 1e-3 * TICK), dtype=np.float64)
        spectrum = np.fft.rfft(total, axis=0) * chain.passed(frequency)[:, None]
        total = np.fft.irfft(spectrum, len(tau), axis=0)
    guard = round(GUARD / TICK)
    # A view would keep the guard in memory.
    return total[guard:-guard].copy()


def _shapes(tau: NDArray[np.float64], interval: float) -> NDArray[np.float64]:
    """Return the shapes of a flank at times since the touch, ms: [n_time, n_column]."""
    after = np.maximum(tau, 0)[:, None]
    filtered = np.clip(tau / interval + 0.5, 0, 1) if interval else tau >= 0
    walk = np.clip((tau[:, None] - KNOTS[:-1]) / np.diff(KNOTS), 0, 1)
    jumps = np.stack([tau >= 0, filtered], axis=1)
    return np.hstack([jumps, after**POWERS, after**2 / 2, walk])


def _spread(kind: _Kind) -> NDArray[np.float64]:
    """Return the standard deviations of the shapes of a kind: [n_column]."""
    mean = KNOTS[:, None] ** POWERS @ kind.mean
    steps = np.sqrt(np.diff(KNOTS)) if kind.rough else np.diff(mean)
    jumps = (kind.jump,) * N_JUMP
    return np.array([*jumps, *kind.spread, kind.parabola, *(kind.walk * steps)])


def _averaged_shapes() -> NDArray[np.float64]:
    """Return the shapes averaged over AVERAGING_WIDTH, at the delays: [n_delay, n_column]."""
    time = np.arange(0, DELAY[-1] + 1, 2 * TICK)
    return average_within(_shapes(time, 0), time, DELAY, 1e3 * AVERAGING_WIDTH)


SPREADS = np.array([_spread(kind) for kind in KINDS])
MEANS = np.zeros_like(SPREADS)
MEANS[:, N_JUMP : N_JUMP + len(POWERS)] = [kind.mean for kind in KINDS]
# By kind, [n_kind, n_column, n_column]: scale the shapes to unit deviation, and subtract the mean
# from the force.
TRANSFORMS = np.zeros((len(KINDS), SPREADS.shape[1] + 1, SPREADS.shape[1] + 1))
TRANSFORMS[:, np.arange(SPREADS.shape[1]), np.arange(SPREADS.shape[1])] = SPREADS
TRANSFORMS[:, :-1, -1] = -MEANS
TRANSFORMS[:, -1, -1] = 1
AVERAGED_SHAPES = _averaged_shapes()
