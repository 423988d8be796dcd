"""First touch and release from the flanks of a pulse (docs/recordings_theory.md, section 3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Prior of a flank over the peak force, t in ms since the touch: a jump, a t**n, a parabola, and a
# walk between knots.
KNOTS = np.array(
    [0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5, 4.0]
)
# Powers n, the mean of a, and its standard deviation: lines, and the soft feet of bodies that touch
# in a point (Hertz: 3/2 of a sphere) and roll off.
POWERS = np.array([1.0, 1.5, 1.75])
MEAN = np.array([0.16, 0.055, 0.045])
SPREAD = np.array([0.08, 0.02, 0.015])
PARABOLA = 0.06
# The steps of the walk of smooth flanks and feet deviate from those of the power, with the mean of
# a, by a part; the walk of rough flanks is random, its deviation grows with the root of time.
# Classes: power, jump, jump that a filter spreads, part, or walk in 1 ms.
CLASSES = (
    (0, 0.0, 0.0, 0.15),
    (0, 0.2, 0.0, 0.15),
    (0, 0.0, 0.2, 0.15),
    (1, 0.0, 0.0, 0.3),
    (2, 0.0, 0.0, 0.3),
    (0, 0.0, 0.0, 0.12),
    (0, 0.0, 0.0, 0.5),
)
SMOOTH = 5
# Their probabilities at touch and at release: a body strikes with a jump and lets go softly.
PRIOR = np.array([
    [0.25, 0.15, 0.1, 0.05, 0.05, 0.25, 0.15],
    [0.38, 0.01, 0.01, 0.2, 0.2, 0.15, 0.05],
])  # fmt: skip
# What these shapes leave of the time, s: errors of the method over the models, by class.
LEFT = 1e-6 * np.array([
    [5.0, 5.0, 5.0, 30.0, 30.0, 40.0, 40.0],
    [60.0, 60.0, 60.0, 60.0, 60.0, 140.0, 140.0],
])  # fmt: skip
# What these shapes miss of a flank, as part of the force itself: of smooth classes and of rough.
MISSED = (0.005, 0.1)
# Times of one search, each within REACH standard deviations of the one before.
N_TIME = 33
REACH = 6.0
# Samples are smoothed by these weights, which take the ringing of an anti-aliasing filter.
SMOOTHING = np.array([0.25, 0.5, 0.25])


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
    release : bool
        Whether this is the end of a pulse.
    """

    time: NDArray[np.float64]
    force: NDArray[np.float64]
    covariance: NDArray[np.float64]
    peak: float
    interval: float
    release: bool


def find_touch(flank: Flank, low: float, high: float, searches: int) -> tuple[float, float]:
    """Return the time of first touch between two times, s, and its standard deviation.

    The mean over the posterior of the time, all classes of flanks together.
    """
    level = flank.force / flank.peak
    groups = []
    for part, classes in zip(MISSED, (range(SMOOTH), range(SMOOTH, len(CLASSES))), strict=True):
        covariance = flank.covariance / flank.peak**2 + np.diag((part * level) ** 2)
        factor = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
        value = solve_triangular(factor, level, lower=True, check_finite=False)
        size = float(np.log(np.diagonal(factor)).sum())
        groups.append((factor, value, size, classes))
    mean, deviation, left = (low + high) / 2, (high - low) / 2, 0.0
    for _ in range(searches):
        time = np.linspace(low, high, N_TIME)
        shape = _columns(1e3 * (flank.time - time[:, None]), 1e3 * flank.interval)
        logarithm = np.concatenate([_evidence(shape, *group) for group in groups])
        logarithm += np.log(PRIOR[int(flank.release)])[:, None]
        weight = np.exp(logarithm - logarithm.max())
        weight /= weight.sum()
        mean = float(weight.sum(0) @ time)
        deviation = float(
            np.sqrt(weight.sum(0) @ (time - mean) ** 2 + (time[1] - time[0]) ** 2 / 12)
        )
        left = float(weight.sum(1) @ LEFT[int(flank.release)] ** 2)
        reach = REACH * deviation
        if mean - reach <= low and mean + reach >= high:
            break
        low, high = max(low, mean - reach), min(high, mean + reach)
    return mean, float(np.hypot(deviation, np.sqrt(left)))


def _evidence(
    shape: NDArray[np.float64],
    factor: NDArray[np.float64],
    value: NDArray[np.float64],
    size: float,
    classes: range,
) -> NDArray[np.float64]:
    """Return the logarithm of the likelihood of times of first touch: [n_class, n_time].

    Shapes: [n_time, n_cell, n_column]; the factor and the logarithm of the determinant's root are
    those of the covariance of the noise, and the value is the whitened force.
    """
    n_time, n_cell, n_column = shape.shape
    flat = np.moveaxis(shape, 1, 0).reshape(n_cell, -1)
    white = solve_triangular(factor, flat, lower=True, check_finite=False)
    white = np.moveaxis(white.reshape(n_cell, n_time, n_column), 0, 1)
    gram = np.swapaxes(white, 1, 2) @ white
    result = np.empty((len(classes), n_time))
    for row, k in enumerate(classes):
        power = CLASSES[k][0]
        spread = SPREADS[k]
        used = spread > 0
        spread = spread[used]
        rest = value - MEAN[power] * white[:, :, 2 + power]
        inner = gram[:, used][:, :, used] * spread[:, None] * spread + np.eye(len(spread))
        right = (white[:, :, used] * spread).swapaxes(1, 2) @ rest[..., None]
        lower = np.linalg.cholesky(inner)
        solved = np.linalg.solve(lower, right)
        fit = (rest**2).sum(1) - (solved**2).sum((1, 2))
        spreads = np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(1)
        result[row] = -0.5 * fit - spreads - size
    return result


def _spread(k: int) -> NDArray[np.float64]:
    """Return the standard deviations of the shapes of a class, [n_column]."""
    power, jump, filtered, walk = CLASSES[k]
    powers = np.where(np.arange(len(POWERS)) == power, SPREAD, 0.0)
    steps = MEAN[power] * np.diff(KNOTS ** POWERS[power]) if k < SMOOTH else np.sqrt(np.diff(KNOTS))
    parabola = PARABOLA if power == 0 else 0.0
    return np.array([jump, filtered, *powers, parabola, *(walk * steps)])


SPREADS = np.array([_spread(k) for k in range(len(CLASSES))])


def _columns(tau: NDArray[np.float64], interval: float) -> NDArray[np.float64]:
    """Return the smoothed shapes of a flank at times since the touch, ms: [..., n_column]."""
    parts = [
        weight * _shapes(tau + shift * interval, interval)
        for weight, shift in zip(SMOOTHING, (-1, 0, 1), strict=True)
    ]
    total: NDArray[np.float64] = parts[0] + parts[1] + parts[2]
    return total


def _shapes(tau: NDArray[np.float64], interval: float) -> NDArray[np.float64]:
    """Return the shapes of a flank: jump, jump that a filter spreads, powers, parabola, walk."""
    after = np.maximum(tau, 0)
    filtered = np.clip(tau / interval + 0.5, 0, 1)
    walk = np.clip((tau[..., None] - KNOTS[:-1]) / np.diff(KNOTS), 0, 1)
    powers = after[..., None] ** POWERS
    rest = np.stack([tau >= 0, filtered], axis=-1), powers, after[..., None] ** 2 / 2
    return np.concatenate([*rest, walk], axis=-1)
