"""First touch and release from the flanks of a pulse (docs/recordings_theory.md, section 3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import sici

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Prior of a flank over the peak force, t in ms since the touch: a jump, a line of the mean slope
# MEAN_SLOPE, a parabola, and a random walk. Standard deviations of each class, from the flanks of
# the models: smooth as a half sine, with a jump as the shell, rough as modes and finite elements.
MEAN_SLOPE = 0.17
KNOTS = np.array([0.0, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0])
CLASSES = np.array([
    # jump, line, parabola, walk in 1 ms
    [0.0, 0.12, 0.06, 0.02],
    [0.2, 0.12, 0.06, 0.02],
    [0.2, 0.12, 0.06, 0.02],  # the same through an anti-aliasing filter
    [0.0, 0.12, 0.06, 0.15],
])  # fmt: skip
PRIOR = np.log([0.4, 0.2, 0.1, 0.3])
FILTERED = 2
# Times of one search, and searches, each within REACH standard deviations of the one before.
N_TIME = 41
SEARCHES = 3
REACH = 6.0
# Step through a low-pass at 0.45 of the rate, times in samples.
_SAMPLES = np.linspace(-40, 40, 1601)
_FILTERED_STEP = (_SAMPLES, 0.5 + sici(0.9 * np.pi * _SAMPLES)[0] / np.pi)


@dataclass(frozen=True, eq=False)
class Flank:
    """The start of a pulse; the end of one is a flank in reversed time.

    Attributes
    ----------
    time : ndarray, shape (n_cell,)
        Middles of the cells, the means of which are used, s.
    force : ndarray, shape (n_cell,)
        Mean force of each cell, background removed, N.
    covariance : ndarray, shape (n_cell, n_cell)
        Covariance of their noise, N2.
    peak : float
        Peak force of the pulse, N.
    interval : float
        Sampling interval, s.
    """

    time: NDArray[np.float64]
    force: NDArray[np.float64]
    covariance: NDArray[np.float64]
    peak: float
    interval: float


def find_touch(flank: Flank, low: float, high: float) -> tuple[float, float]:
    """Return the time of first touch between two times, s, and its standard deviation.

    The mean over the posterior of the time, all classes of flanks together.
    """
    factor = np.linalg.cholesky(flank.covariance / flank.peak**2)
    value = solve_triangular(factor, flank.force / flank.peak, lower=True, check_finite=False)
    mean, deviation = (low + high) / 2, (high - low) / 2
    for _ in range(SEARCHES):
        time = np.linspace(low, high, N_TIME)
        logarithm = _evidence(flank, factor, value, time)
        weight = np.exp(logarithm - logarithm.max())
        weight /= weight.sum()
        mean = float(weight.sum(0) @ time)
        deviation = float(np.sqrt(weight.sum(0) @ (time - mean) ** 2 + (time[1] - time[0]) ** 2 / 12))
        reach = REACH * deviation
        if mean - reach <= low and mean + reach >= high:
            break
        low, high = max(low, mean - reach), min(high, mean + reach)
    return mean, deviation


def _evidence(
    flank: Flank,
    factor: NDArray[np.float64],
    value: NDArray[np.float64],
    time: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the logarithm of the posterior of times of first touch: [n_class, n_time]."""
    tau = 1e3 * (flank.time - time[:, None])
    shape = _columns(tau, 1e3 * flank.interval)
    n_time, n_cell, n_column = shape.shape
    flat = np.moveaxis(shape, 1, 0).reshape(n_cell, -1)
    white = solve_triangular(factor, flat, lower=True, check_finite=False)
    white = np.moveaxis(white.reshape(n_cell, n_time, n_column), 0, 1)
    gram = np.swapaxes(white, 1, 2) @ white
    result = np.empty((len(CLASSES), n_time))
    walk = np.sqrt(np.diff(KNOTS))
    for k, (jump, line, parabola, rough) in enumerate(CLASSES):
        jumps = (0.0, jump) if k == FILTERED else (jump, 0.0)
        spread = np.array([*jumps, line, parabola, *(rough * walk)])
        used = spread > 0
        spread = spread[used]
        rest = value - MEAN_SLOPE * white[:, :, 2]
        inner = gram[:, used][:, :, used] * spread[:, None] * spread + np.eye(len(spread))
        right = (white[:, :, used] * spread).swapaxes(1, 2) @ rest[..., None]
        lower = np.linalg.cholesky(inner)
        solved = np.linalg.solve(lower, right)
        fit = (rest**2).sum(1) - (solved**2).sum((1, 2))
        size = np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(1)
        result[k] = -0.5 * fit - size + PRIOR[k]
    return result


def _columns(tau: NDArray[np.float64], interval: float) -> NDArray[np.float64]:
    """Return the shapes of a flank at times since the touch, ms: [..., n_column]."""
    after = np.maximum(tau, 0)
    filtered = np.interp(tau / interval, *_FILTERED_STEP)
    step = np.diff(KNOTS)
    walk = np.clip((tau[..., None] - KNOTS[:-1]) / step, 0, 1)
    rest = np.stack([tau >= 0, filtered, after, after**2 / 2], axis=-1)
    return np.concatenate([rest, walk], axis=-1)
