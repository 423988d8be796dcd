"""Noise and background of a signal from its quiet parts (docs/recordings_theory.md, section 2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_solve, lapack, solve_triangular
from scipy.stats import qmc

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Cells = tuple[NDArray[np.float64], NDArray[np.float64]]  # begins and ends, s

# Mains frequencies, Hz; their standard deviation (EN 50160: +- 0.5 Hz, most of the time 0.1).
MAINS = (50.0, 60.0)
MAINS_DEVIATION = 0.1
# Harmonics of hum; the prior standard deviation of the k-th falls as 1/k.
N_HARMONIC = 5
# Prior standard deviations of offset, and of drift per second, over the peak force: wide.
OFFSET = 1.0
DRIFT = 0.1
# Squared lag over mean squared length of two cells below which their covariance is exact.
NEAR = 8.0
# Fewer quiet cells than these do not tell the parts of the noise: draws of the variances, over
# ranges of their size if each part were all of the fast changes of the cells. Slow noise and hum
# may be much larger than fast changes show.
FEW_CELLS = 60
N_DRAW = 256
RANGES = np.array([[1e-3, 3.0], [1e-3, 30.0], [1e-2, 300.0], [1e-2, 1e3], [1e-2, 1e3]])
# Iterations of the likelihood, the change of its logarithm that ends them, and the largest
# logarithm of a mean variance over the most likely one.
MAX_ITERATIONS = 25
MOST_DOUBT = 0.4
TOLERANCE = 0.02


@dataclass(frozen=True)
class Noise:
    """Noise of a recording, white, pink and brown.

    Attributes
    ----------
    deviation : float
        Standard deviation of one sample, N.
    source : str
        ``"before and after"``, ``"before"`` or ``"after"``: the quiet parts that it is known from.
    white, pink, brown : float
        One-sided spectral densities at 1 Hz, N2/Hz, of the parts that are even, fall as 1/f and
        as 1/f2.
    """

    deviation: float
    source: str
    white: float
    pink: float = 0.0
    brown: float = 0.0

    def spectrum(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """Return the one-sided spectral density, N2/Hz, at frequencies above 0 Hz."""
        f = np.asarray(frequency, dtype=np.float64)
        density: NDArray[np.float64] = self.white + self.pink / f + self.brown / f**2
        return density

    def deviation_between(self, lower: float, upper: float) -> float:
        """Return the standard deviation of the noise between two frequencies, N."""
        parts = (
            self.white * (upper - lower),
            self.pink * np.log(upper / lower),
            self.brown * (1 / lower - 1 / upper),
        )
        return float(np.sqrt(sum(parts)))


def noise_covariances(one: Cells, other: Cells) -> NDArray[np.float64]:
    """Return covariances of means over cells that are equal or apart: [4, n_one, n_other].

    Of pink and brown noise of density 1 at 1 Hz and of hum of 50 and 60 Hz of variance 1. The
    covariances at a lag are -ln|lag| and -pi2 |lag|, up to a constant that the unknown offset
    takes; the mean of the first over two cells is taken to second order in their lengths.
    """
    (a, b), (c, d) = one, other
    lag = np.abs(((a + b) / 2)[:, None] - (c + d) / 2)
    width = (((b - a) ** 2)[:, None] + (d - c) ** 2) / 2
    near = np.nonzero(lag**2 < NEAR * width)
    lag[near] = 1.0
    pink = width / (12 * lag**2) - np.log(lag)
    brown = -(np.pi**2) * lag
    # Of cells that touch or are the same: corner differences of the second integrals.
    a, b, c, d = a[near[0]], b[near[0]], c[near[1]], d[near[1]]
    size: NDArray[np.float64] = np.maximum(np.abs([b - c, a - c, b - d, a - d]), 1e-300)
    sign = np.array([1, -1, -1, 1]) / ((b - a) * (d - c))[:, None]
    pink[near] = (sign * (size**2 * (0.75 - 0.5 * np.log(size))).T).sum(1)
    brown[near] = (sign * (-(np.pi**2) / 6 * size**3).T).sum(1)
    hum = [_waves(one, mains) @ _waves(other, mains).T for mains in MAINS]
    return np.array([pink, brown, *hum])


def _waves(cells: Cells, mains: float) -> NDArray[np.float64]:
    """Return means of the waves of hum over cells; two frequencies stand for an uncertain one."""
    middle, width = (cells[0] + cells[1]) / 2, cells[1] - cells[0]
    order = np.arange(1, N_HARMONIC + 1)
    frequency = np.multiply.outer(order, mains + np.array([-MAINS_DEVIATION, MAINS_DEVIATION]))
    weight = np.sqrt(0.5) / order[:, None] * np.sinc(frequency * width[:, None, None])
    phase = 2 * np.pi * frequency * middle[:, None, None]
    waves = np.stack([weight * np.cos(phase), weight * np.sin(phase)], axis=-1)
    return waves.reshape(len(middle), -1)


@dataclass(frozen=True, eq=False)
class Background:
    """What lies under the force, from the means of quiet cells: the best linear prediction.

    Attributes
    ----------
    variances : ndarray, shape (5,)
        Densities of white, pink and brown noise, N2/Hz, and variances of hum, N2.
    peak : float
        Scale of the priors of offset and drift, N.
    """

    quiet: Cells
    mean: NDArray[np.float64]
    variances: NDArray[np.float64]
    peak: float

    @cached_property
    def _factor(self) -> NDArray[np.float64]:
        """Return the factor of the covariance of the quiet cells."""
        parts = covariances(self.quiet)
        total = np.tensordot(self.variances, parts, 1) + self._trend(self.quiet, self.quiet)
        return np.asarray(np.linalg.cholesky(total), dtype=np.float64)

    def predict(self, cells: Cells) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the background of cells, N, and the covariance of its error, N2.

        The covariance lacks the white noise of the cells themselves.
        """
        across = self._covariance(self.quiet, cells)
        half = solve_triangular(self._factor, across, lower=True, check_finite=False)
        mean = solve_triangular(self._factor, self.mean, lower=True, check_finite=False) @ half
        return mean, self._covariance(cells, cells) - half.T @ half

    def predict_mean(self, cells: Cells) -> NDArray[np.float64]:
        """Return the background of cells, N."""
        mean: NDArray[np.float64] = self._weights @ self._covariance(self.quiet, cells)
        return mean

    def _covariance(self, one: Cells, other: Cells) -> NDArray[np.float64]:
        """Return the covariance of cells, without white noise."""
        parts = noise_covariances(one, other)
        total: NDArray[np.float64] = np.tensordot(self.variances[1:], parts, 1)
        return total + self._trend(one, other)

    def _trend(self, one: Cells, other: Cells) -> NDArray[np.float64]:
        """Return the prior covariance of offset and drift."""
        time = np.multiply.outer((one[0] + one[1]) / 2, (other[0] + other[1]) / 2)
        return self.peak**2 * (OFFSET**2 + DRIFT**2 * time)

    @cached_property
    def _weights(self) -> NDArray[np.float64]:
        """Return the inverse covariance of the quiet cells times their means."""
        weights: NDArray[np.float64] = cho_solve(
            (self._factor, True), self.mean, check_finite=False
        )
        return weights

    @property
    def drift(self) -> tuple[float, float]:
        """Drift, N/s, and its standard deviation."""
        prior = (self.peak * DRIFT) ** 2
        middle = (self.quiet[0] + self.quiet[1]) / 2
        half = solve_triangular(self._factor, middle, lower=True, check_finite=False)
        value = prior * float(middle @ self._weights)
        return value, float(np.sqrt(max(prior - prior**2 * half @ half, 0)))

    @property
    def hum(self) -> tuple[float, float, float]:
        """Frequency of the stronger hum, Hz, its amplitude and the deviation of that, N."""
        k = int(np.argmax(self.variances[3:]))
        waves = _waves(self.quiet, MAINS[k])
        part = self.variances[3 + k] * waves @ (waves.T @ self._weights)
        noise = np.mean(self.variances[0] / 2 / (self.quiet[1] - self.quiet[0]))
        return MAINS[k], float(np.sqrt(2 * np.mean(part**2))), float(np.sqrt(2 * noise / len(part)))


def covariances(cells: Cells) -> NDArray[np.float64]:
    """Return covariances of means over cells: white, pink, brown, hum of 50 and of 60 Hz."""
    white = np.diag(0.5 / (cells[1] - cells[0]))
    return np.concatenate([white[None], noise_covariances(cells, cells)])


def fit_background(
    quiet: Cells, mean: NDArray[np.float64], peak: float, few_cells: int = FEW_CELLS
) -> Background:
    """Return the background of the most likely noise, by average-information steps.

    Parameters
    ----------
    quiet
        Begins and ends of the quiet cells, s, from near the middle of the contact.
    mean : ndarray, shape (n_cell,)
        Mean force of each, N.
    peak
        Peak force, N.
    few_cells
        Number of cells below which the variances are means over their posterior.
    """
    parts = covariances(quiet)
    middle = (quiet[0] + quiet[1]) / 2
    trend = peak**2 * (OFFSET**2 + DRIFT**2 * np.multiply.outer(middle, middle))
    # Half of the size of fast changes, spread over all.
    adjoining = quiet[0][1:] - quiet[1][:-1] < 1e-3 * (quiet[1] - quiet[0])[1:]
    changes = np.diff(mean)[adjoining]
    rough = (np.mean(changes**2) / 2 if changes.size else 0.0) + (1e-5 * peak) ** 2
    scale = np.array([np.mean(np.diagonal(parts[0])), 1.0, np.pi**2 * 0.02, 1.0, 1.0])
    least = np.array([0.01, 1e-9, 1e-9, 1e-9, 1e-9]) * rough / scale
    theta = np.array([rough, 0.1 * rough, 0.1 * rough, 0.05 * rough, 0.05 * rough]) / scale
    value, score, information = _likelihood(theta, parts, trend, mean)
    for _ in range(MAX_ITERATIONS):
        # Steps in the logarithms: all variances stay positive.
        gradient, curvature = score * theta, information * np.multiply.outer(theta, theta)
        free = (theta > 2 * least) | (gradient > 0)
        damping = 0.02 * np.trace(curvature) / 5 + 0.05
        step = np.zeros(5)
        step[free] = np.linalg.solve(
            curvature[np.ix_(free, free)] + damping * np.eye(int(free.sum())), gradient[free]
        )
        step = np.clip(step, -3, 2)
        for _halving in range(6):
            trial = np.maximum(theta * np.exp(step), least)
            result = _likelihood(trial, parts, trend, mean)
            if result[0] >= value:
                break
            step /= 3
        gain = result[0] - value
        if gain < 0:
            break
        theta, (value, score, information) = trial, result
        if gain < TOLERANCE:
            break
    curvature = information * np.multiply.outer(theta, theta)
    doubt = np.linalg.inv(curvature + 0.05 * np.eye(5))
    # The mean of a variance that is known to a factor is larger than its most likely value.
    likely = theta * np.exp(np.minimum(0.5 * np.diagonal(doubt), MOST_DOUBT))
    if len(mean) < few_cells:
        likely = _mean_variances(likely, value, doubt, rough / scale, parts, trend, mean)
    return Background(quiet, mean, likely, peak)


def _mean_variances(  # noqa: PLR0913, PLR0917 - what the likelihood is made of
    likely: NDArray[np.float64],
    value: float,
    doubt: NDArray[np.float64],
    rough: NDArray[np.float64],
    parts: NDArray[np.float64],
    trend: NDArray[np.float64],
    mean: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the mean variances over their posterior: a short quiet cannot tell slow parts.

    Even priors of the logarithms over RANGES; the most likely variances have the volume of their
    doubt, the others are drawn over the whole of the ranges.
    """
    low, high = np.log(RANGES * rough[:, None]).T
    draws = np.exp(low + (high - low) * qmc.Sobol(5, seed=0).random(N_DRAW))
    logarithms = [_logarithm(theta, parts, trend, mean) for theta in draws]
    weight = np.exp(np.minimum(np.array(logarithms) - value, 20.0))
    width = np.minimum(np.sqrt(2 * np.pi * np.diagonal(doubt)) / (high - low), 1.0)
    own = N_DRAW * float(width.prod())
    result: NDArray[np.float64] = (own * likely + weight @ draws) / (own + weight.sum())
    return result


def _logarithm(
    theta: NDArray[np.float64],
    parts: NDArray[np.float64],
    trend: NDArray[np.float64],
    mean: NDArray[np.float64],
) -> float:
    """Return the logarithm of the likelihood of variances."""
    factor, failed = lapack.dpotrf(np.tensordot(theta, parts, 1) + trend, lower=True)
    if failed:
        return -np.inf
    white = solve_triangular(factor, mean, lower=True, check_finite=False)
    return float(-np.log(np.diagonal(factor)).sum() - 0.5 * white @ white)


def _likelihood(
    theta: NDArray[np.float64],
    parts: NDArray[np.float64],
    trend: NDArray[np.float64],
    mean: NDArray[np.float64],
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Return the logarithm of the likelihood, its gradient and its average information."""
    total = np.tensordot(theta, parts, 1) + trend
    factor, failed = lapack.dpotrf(total, lower=True)
    if failed:
        return -np.inf, np.zeros(5), np.eye(5)
    inverse = lapack.dpotri(factor, lower=True)[0]
    inverse = np.tril(inverse) + np.tril(inverse, -1).T
    weighted = inverse @ mean
    turned = parts @ weighted
    value = -np.log(np.diagonal(factor)).sum() - 0.5 * mean @ weighted
    trace = np.einsum("kij,ij->k", parts, inverse)
    score = 0.5 * (turned @ weighted - trace)
    information = 0.5 * turned @ inverse @ turned.T
    return float(value), score, information
