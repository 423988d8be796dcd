"""Noise of a signal, and the background that it predicts (docs/recordings_theory.md, section 2)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_solve, lapack, solve_triangular

from thud.base.immutable import Immutable
from thud.recordings.quantization import Quantization

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from thud.base.note import Note

    Cells = tuple[NDArray[np.float64], NDArray[np.float64]]  # begins and ends, s

# Mains frequencies and their standard deviation, Hz (EN 50160: ±0.5 Hz, usually ±0.1 Hz).
MAINS = (50.0, 60.0)
MAINS_DEVIATION = 0.1
# Number of harmonics of hum; the prior standard deviation of harmonic k is proportional to 1/k.
N_HARMONIC = 5
# Wide prior standard deviations of offset, and of drift per second, as fractions of the peak force.
OFFSET = 1.0
DRIFT = 0.1
# The prior density of the logarithm of a variance is proportional to this power of the variance.
# The power is lower by 1 for large variances: standard deviation of a cell above PRIOR_DEVIATION
# times the peak force.
SLOPE = np.array([0.5, 0.25, 1.0, 0.25, 0.25])
PRIOR_DEVIATION = 0.03
# Standard deviation of each cell due to quantization, as a fraction of the peak force.
QUANTIZATION = 1e-6
# Distance of the variances that represent the posterior from the most probable ones, in standard
# deviations. With sqrt(5) they would have its covariance; 95 % intervals of levels contain 95 to 97
# % of the errors with 2, and 95 to 100 % with sqrt(5).
DISTANCE = 2.0
# Search for the maximum of the posterior: maximum number of iterations, maximum change of the
# logarithm of a variance, tolerance of the logarithm of the posterior.
MAX_ITERATIONS = 50
MAX_STEP = 3.0
TOLERANCE = 0.02


def covariances_without_white(cells: Cells, other: Cells) -> NDArray[np.float64]:
    """Return unit covariances of the means over two sets of cells: [4, n_cell, n_other].

    Any two cells are equal or disjoint. The first axis is pink noise, brown noise (each of density
    1 at 1 Hz), and hum of 50 Hz and of 60 Hz (each of variance 1). Pink and brown noise have the
    covariances -ln|lag| and -pi**2 |lag|, except for a constant, which the unknown offset absorbs:
    those of means are differences of their second integrals at the corners of a pair of cells.
    """
    (a, b), (c, d) = cells, other
    pairs = ((b, c), (a, c), (b, d), (a, d))
    size = np.maximum(np.abs([np.subtract.outer(*pair) for pair in pairs]), 1e-300)
    integrals = [size**2 * (0.75 - 0.5 * np.log(size)), -(np.pi**2) / 6 * size**3]
    signs = np.array([1, -1, -1, 1])
    pink, brown = np.tensordot(integrals, signs, (1, 0)) / np.multiply.outer(b - a, d - c)
    waves = _waves(cells)
    hum = waves @ (waves if other is cells else _waves(other)).swapaxes(1, 2)
    return np.array([pink, brown, *hum])


def _waves(cells: Cells) -> NDArray[np.float64]:
    """Return means over cells of the waves of each hum, [n_mains, n_cell, n_wave].

    Each harmonic has waves of two fundamentals, MAINS plus and minus MAINS_DEVIATION.
    """
    middle, width = (cells[0] + cells[1]) / 2, cells[1] - cells[0]
    order = np.arange(1, N_HARMONIC + 1)
    fundamentals = np.add.outer(MAINS, [-MAINS_DEVIATION, MAINS_DEVIATION])
    frequency = (fundamentals[:, None] * order[:, None]).reshape(len(MAINS), 1, -1)
    weight = np.repeat(np.sqrt(0.5) / order, 2) * np.sinc(frequency * width[:, None])
    phase = 2 * np.pi * frequency * middle[:, None]
    return np.concatenate([weight * np.cos(phase), weight * np.sin(phase)], axis=-1)


@dataclass(frozen=True, eq=False)
class Background(Immutable):
    """Background during the contact, predicted linearly from cells next to the contact.

    `cells` are begins and ends of cells, s, and `mean`, [n_cell], their mean forces, N. Each row of
    `draws`, [n_draw, 5], has the densities of white, pink and brown noise, N2/Hz, and the variances
    of hum of 50 and of 60 Hz, N2; the rows are equally probable. The peak force, N, scales the
    priors. The predictions exclude the errors by `quantization`. Times of cells are from `middle`,
    s from the first sample; `ends` are the end of the background before the contact and its begin
    after it, s. `tones` are notes on what was removed before the fit.
    """

    cells: Cells
    mean: NDArray[np.float64]
    draws: NDArray[np.float64]
    peak: float
    quantization: Quantization = field(default_factory=Quantization)
    middle: float = 0.0
    ends: tuple[float, float] = (0.0, 0.0)
    tones: tuple[Note, ...] = ()

    @property
    def variances(self) -> NDArray[np.float64]:
        """Mean of the draws: densities, N2/Hz, and variances of hum, N2."""
        return np.asarray(self.draws.mean(axis=0), dtype=np.float64)

    def density(self, frequency: float) -> tuple[float, float]:
        """Return the density of the noise at a frequency, N2/Hz, and its standard deviation."""
        draws = self.draws[:, :3] @ (1 / frequency ** np.arange(3))
        return float(draws.mean()), float(draws.std())

    def spectrum(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """Return the one-sided density of the noise, N2/Hz, at frequencies above 0 Hz."""
        f = np.asarray(frequency, dtype=np.float64)
        white, pink, brown = self.variances[:3]
        return np.asarray(white + pink / f + brown / f**2)

    def deviation_between(self, lower: float, upper: float) -> float:
        """Return the standard deviation of the noise between two frequencies, N."""
        widths = (upper - lower, np.log(upper / lower), 1 / lower - 1 / upper)
        return float(np.sqrt(self.variances[:3] @ widths))

    @cached_property
    def _factors(self) -> list[NDArray[np.float64]]:
        """Cholesky factor of the covariance of the cells for each draw."""
        unit, fixed = unit_covariances(self.cells), fixed_covariance(self.cells, self.peak)
        return [
            np.asarray(np.linalg.cholesky(np.tensordot(draw, unit, 1) + fixed), dtype=np.float64)
            for draw in self.draws
        ]

    @cached_property
    def _weights(self) -> NDArray[np.float64]:
        """Inverse covariance of the cells times their means for each draw, [n_draw, n_cell]."""
        return np.array(
            [cho_solve((f, True), self.mean, check_finite=False) for f in self._factors]
        )

    def predict(self, cells: Cells) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the expected background in cells, N, and the covariance of its error, N2.

        They are the mean and the covariance of the mixture of all draws. The covariance excludes
        the white noise of the predicted cells.
        """
        cross_covariances = covariances_without_white(self.cells, cells)
        trend = _trend(self.cells, cells, self.peak)
        total = np.tensordot(self.variances[1:], covariances_without_white(cells, cells), 1)
        total += _trend(cells, cells, self.peak)
        means = np.empty((len(self.draws), len(cells[0])))
        for k, (draw, factor) in enumerate(zip(self.draws, self._factors, strict=True)):
            covariance = np.tensordot(draw[1:], cross_covariances, 1) + trend
            whitened = solve_lower(factor, covariance)
            means[k] = self._weights[k] @ covariance
            total -= whitened.T @ whitened / len(self.draws)
        mean = means.mean(axis=0)
        means -= mean
        return mean, total + means.T @ means / len(self.draws)

    def predict_mean(self, cells: Cells) -> NDArray[np.float64]:
        """Return the expected background in cells, N."""
        weights = self.draws[:, 1:].T @ self._weights / len(self.draws)
        mean = self._weights.mean(axis=0) @ _trend(self.cells, cells, self.peak)
        mean += np.einsum("ki,kij->j", weights, covariances_without_white(self.cells, cells))
        return np.asarray(mean, dtype=np.float64)

    @property
    def drift(self) -> tuple[float, float]:
        """Drift, N/s, and its standard deviation."""
        prior = (self.peak * DRIFT) ** 2
        middle = (self.cells[0] + self.cells[1]) / 2
        information = [float(np.sum(solve_lower(factor, middle) ** 2)) for factor in self._factors]
        values = prior * self._weights @ middle
        variance = max(prior - prior**2 * float(np.mean(information)), 0.0) + float(values.var())
        return float(values.mean()), float(np.sqrt(variance))

    @property
    def hum(self) -> tuple[float, float, float]:
        """Frequency of the stronger hum, Hz, amplitude, N, and its standard deviation, N."""
        k = int(np.argmax(self.variances[3:]))
        waves = _waves(self.cells)[k]
        hum = waves @ waves.T @ (self.draws[:, 3 + k] @ self._weights) / len(self.draws)
        noise = np.mean(self.variances[0] / 2 / (self.cells[1] - self.cells[0]))
        return MAINS[k], float(np.sqrt(2 * np.mean(hum**2))), float(np.sqrt(2 * noise / len(hum)))


def solve_lower(factor: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve a lower triangular system without the slow checks of SciPy."""
    return np.asarray(lapack.dtrtrs(factor, right, lower=True)[0])


def _trend(cells: Cells, other: Cells, peak: float) -> NDArray[np.float64]:
    """Return the covariance of cells due to the priors of offset and drift."""
    time = np.multiply.outer((cells[0] + cells[1]) / 2, (other[0] + other[1]) / 2)
    return np.asarray(peak**2 * (OFFSET**2 + DRIFT**2 * time), dtype=np.float64)


def fixed_covariance(cells: Cells, peak: float) -> NDArray[np.float64]:
    """Return the part of the covariance of cells due to offset, drift and quantization."""
    return _trend(cells, cells, peak) + (QUANTIZATION * peak) ** 2 * np.eye(len(cells[0]))


def unit_covariances(cells: Cells) -> NDArray[np.float64]:
    """Return unit covariances of white, pink and brown noise and both hums: [5, n_cell, n_cell]."""
    white = np.diag(0.5 / (cells[1] - cells[0]))
    return np.concatenate([white[None], covariances_without_white(cells, cells)])


def fit_background(
    cells: Cells,
    mean: NDArray[np.float64],
    peak: float,
    column: NDArray[np.floating] | None = None,
) -> Background:
    """Return the background with variances that represent their posterior.

    Other arguments are as in `Background`; times are relative to about the middle of the contact.
    A multiple of `column`, [n_cell], of about the peak may be in the means.

    These are the most probable logarithms of the variances, plus and minus DISTANCE times each
    column of a square root of their covariance in a normal approximation. The prior densities
    increase with the variances up to about those of PRIOR_DEVIATION, so that the estimate of absent
    noise is small and not zero.
    """
    unit, fixed = unit_covariances(cells), fixed_covariance(cells, peak)
    if column is not None:
        fixed += peak**2 * np.multiply.outer(column, column)
    # Approximate variance of a cell per unit of each variance; for brown noise over 0.02 s, the
    # duration of a contact.
    scale = np.array([np.mean(np.diagonal(unit[0])), 1.0, np.pi**2 * 0.02, 1.0, 1.0])
    large = (PRIOR_DEVIATION * peak) ** 2 / scale
    # First guess of the variance: half the mean square difference of adjacent cells.
    adjacent = cells[0][1:] - cells[1][:-1] < 1e-3 * (cells[1] - cells[0])[1:]
    differences = np.diff(mean)[adjacent]
    variance = np.mean(differences**2) / 2 if differences.size else 0.0
    variance += (QUANTIZATION * peak) ** 2
    best = np.log(variance * np.array([1, 0.1, 0.1, 0.05, 0.05]) / scale)

    value, score, curvature = _log_posterior(best, unit, fixed, mean, large)
    damping = 0.0
    for _ in range(MAX_ITERATIONS):
        damped = curvature + damping * np.diag(np.diagonal(curvature))
        step = np.linalg.solve(damped, score)
        # One length for all: a step of which single components are cut off may lead downwards.
        step *= min(1.0, MAX_STEP / float(np.abs(step).max()))
        trial = _log_posterior(best + step, unit, fixed, mean, large)
        gain = trial[0] - value
        if gain > 0:
            best, damping = best + step, damping / 10
            value, score, curvature = trial
        else:
            damping = max(10 * damping, 0.1)
        if abs(gain) < TOLERANCE:
            break
    # With curvature = L L', the rows of inverse(L) are the square root of its inverse.
    lower = np.linalg.cholesky(curvature)
    steps = DISTANCE * solve_triangular(lower, np.eye(len(best)), lower=True)
    return Background(cells, mean, np.exp(np.concatenate([best + steps, best - steps])), peak)


def _log_posterior(
    phi: NDArray[np.float64],
    unit: NDArray[np.float64],
    fixed: NDArray[np.float64],
    mean: NDArray[np.float64],
    large: NDArray[np.float64],
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Return the posterior of logarithms of the variances: logarithm, gradient, curvature.

    The covariance of the cells is `fixed`, and `unit` times the variances. The curvature is the
    average information (Gilmour, Thompson and Cullis 1995) of likelihood and priors.
    """
    theta = np.exp(phi)
    factor, failed = lapack.dpotrf(np.tensordot(theta, unit, 1) + fixed, lower=True)
    if failed:
        return -np.inf, np.zeros_like(phi), np.eye(len(phi))
    inverse = lapack.dpotri(factor, lower=True)[0]
    inverse = np.tril(inverse) + np.tril(inverse, -1).T
    weighted = inverse @ mean
    value = -np.log(np.diagonal(factor)).sum() - 0.5 * mean @ weighted
    value += SLOPE @ phi - np.log1p(theta / large).sum()
    products = (unit @ weighted) * theta[:, None]
    trace = theta * np.einsum("kij,ij->k", unit, inverse)
    score = 0.5 * (products @ weighted - trace) + SLOPE - theta / (theta + large)
    # At the maximum, the scores of likelihood and prior cancel; the latter is about SLOPE.
    return float(value), score, 0.5 * products @ inverse @ products.T + np.diag(SLOPE)
