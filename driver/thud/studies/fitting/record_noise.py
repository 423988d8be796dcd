"""Noise of a record below a frequency, from its background, and the weights of residuals.

Records are compared on a grid of an odd number of points with the same Fourier coefficients up to a
frequency. `to_grid` is orthonormal: white noise stays white and keeps its deviation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular

from thud.base.immutable import freeze
from thud.recordings.background import (
    DRIFT,
    MAINS,
    Background,
    cell_means,
    fit_noise,
    unit_covariances,
)
from thud.recordings.drops import CELL, FOOT, MARGIN, MAX_BACKGROUND
from thud.studies.fitting.residual_tests import UNLIKELY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.recordings.background import Cells
    from thud.studies.arrays import Array


# Minimum number of independent values in the band that determine the noise.
MIN_BACKGROUND = 50
# Minimum frequency of hum, Hz: below, it is drift within a pulse. Maximum number of its tones.
MIN_HUM = 10.0
MAX_TONES = 3
# Harmonics of hum count up to this fraction of the highest frequency.
HARMONIC_EDGE = 0.95
# Time from the foot of a pulse to its edge, s: flanks of the models rise to it in 4 ms.
FLANK = 2 * MARGIN * CELL


def to_grid(samples: Array, count: int) -> Array:
    """Return columns of samples on a grid of `count` points."""
    spectrum = np.fft.rfft(samples, norm="ortho", axis=0)[: count // 2 + 1]
    grid: Array = np.fft.irfft(spectrum, count, norm="ortho", axis=0)
    return grid


def grid_covariance(lags: Array, count: int) -> Array:
    """Return the covariance on a grid of stationary noise, from that of samples at all lags.

    With X = n^-1/2 sum x_j w^(kj) and w = exp(-2 pi i/n), the sum over equal lags t is geometric:
    cov(X_k, X_l) = 2 i Im(a_k - a_l)/(n (1 - w^(k - l))), a_k = sum_t c(t) w^(kt); its diagonal is
    the sum of (1 - |t|/n) c(t) w^(kt).
    """
    n = len(lags)
    order = np.fft.ifftshift(np.arange(count) - count // 2)
    half = np.fft.fft(lags)[order].imag
    turn = np.exp(-2j * np.pi * np.subtract.outer(order, order) / n)
    np.fill_diagonal(turn, 0)
    covariance = 2j * np.subtract.outer(half, half) / (n * (1 - turn))
    diagonal = np.fft.fft((1 - np.arange(n) / n) * lags)[order].real
    np.fill_diagonal(covariance, 2 * diagonal - lags[0])
    result: Array = np.fft.fft(np.fft.ifft(covariance, axis=0), axis=1).real
    return result


def find_pulse(force: Array, rate: float) -> tuple[int, int]:
    """Return the first sample of the pulse of a record and the stop (exclusive), with room."""
    width = max(1, round(CELL * rate))
    smooth = np.convolve(force, np.full(width, 1 / width), mode="same")
    smooth -= np.quantile(smooth, 0.1)
    top = int(np.argmax(smooth))
    low = np.flatnonzero(smooth < FOOT * smooth[top])
    before, after = low[low < top], low[low > top]
    room = int(FLANK * rate)
    first = before[-1] - room if before.size else 0
    stop = after[0] + room if after.size else len(force)
    return max(int(first), 0), min(int(stop), len(force))


@dataclass(frozen=True, eq=False)
class Quiet:
    """Background of a record, up to 0.1 s before and after its pulse.

    Attributes
    ----------
    cells : tuple of ndarray, shape (n_cell,)
        Begins and ends of cells, s from the middle of the pulse. Their width is that of the band:
        wider cells would not show the noise of its upper end.
    mean : ndarray, shape (n_cell,)
        Mean forces in the cells − their median, N.
    peak : float
        Maximum of the record − its median, N.
    seconds, middle : float
        Length of the background, and middle of the pulse from the first sample, s.
    freedom : int
        Number of independent values in the band − 1 for the offset.
    deviation : float
        Standard deviation of the background, N.
    below : float
        Highest frequency that counts, Hz.
    """

    cells: Cells
    mean: Array
    peak: float
    seconds: float
    middle: float
    freedom: int
    deviation: float
    below: float

    def background(self, tones: Sequence[float] = ()) -> Background:
        """Return the most likely noise: white, pink, brown and hum of 50 and 60 Hz.

        Tones, Hz, are removed first, by least squares.
        """
        waves = cell_waves(self.cells, tones)
        residual = self.mean - waves @ np.linalg.lstsq(waves, self.mean)[0]
        logarithms, log_covariance = fit_noise(self.cells, residual, self.peak)
        # The waves have absorbed part of the noise.
        n = len(self.mean)
        scale = np.where(np.arange(5) < 3, n / (n - waves.shape[1] + 1), 1.0)  # noqa: PLR2004
        variances = scale * np.exp(logarithms)
        return Background(self.cells, residual, variances, self.peak, log_covariance)

    def tones(self) -> tuple[float, ...]:
        """Return the frequencies of tones, Hz, which noise and hum of 50 and 60 Hz do not explain.

        A tone must raise the likelihood by more than the search over all frequencies does.
        """
        step = 1 / (8 * float(np.abs(self.cells).max()))
        grid = np.arange(MIN_HUM, HARMONIC_EDGE * self.below, step)
        # The noise includes hum of the mains.
        grid = grid[np.abs(grid[:, np.newaxis] - MAINS).min(axis=1) > 2 * step]
        min_gain = float(np.log(len(grid) / UNLIKELY))
        result: tuple[float, ...] = ()
        background = self.background()
        best = log_likelihood(background)
        while len(result) < MAX_TONES:
            tried = [
                (log_likelihood(self.background((*result, tone))), tone)
                for whiten in (_trendless(self.cells), background.whiten)
                for tone, gain in [strongest_tone(self.cells, background.mean, whiten, grid)]
                if gain > min_gain
            ]
            likelihood, tone = max(tried, default=(best, 0.0))
            if likelihood < best + min_gain:
                break
            best, result = likelihood, (*result, tone)
            background = self.background(result)
        return result


def find_quiet(force: Array, rate: float, pulse: tuple[int, int], below: float) -> Quiet:
    """Return the background of a record, N, beside its pulse: first sample, and stop."""
    first, stop = pulse
    sides = first, len(force) - stop
    width = max(1, int(rate / (2 * below)))
    counts = [min(side, int(MAX_BACKGROUND * rate)) // width for side in sides]
    before = first - width * np.arange(1 + counts[0])[::-1]
    after = stop + width * np.arange(1 + counts[1])
    (begin, end), mean = cell_means(force, rate, before, after)
    middle = (first + stop) / 2 / rate
    seconds = sum(min(side / rate, MAX_BACKGROUND) for side in sides)
    return Quiet(
        (begin - middle, end - middle),
        mean - np.median(mean) if len(mean) else mean,
        peak=float(force.max() - np.median(force)),
        seconds=seconds,
        freedom=int(2 * below * seconds) - 1,
        middle=middle,
        deviation=float(np.std(np.concatenate([force[:first], force[stop:]]))) if any(sides) else 0,
        below=below,
    )


def wave_size(value: Array, covariance: Array) -> tuple[float, float]:
    """Return the amplitude of a cosine and a sine, and its standard error."""
    size = float(np.hypot(*value))
    slope = value / size
    return size, float(np.sqrt(slope @ covariance @ slope))


def cell_waves(cells: Cells, tones: Sequence[float]) -> Array:
    """Return a constant, and means of the waves of tones, Hz, over cells: [n_cell, 1 + 2 n]."""
    middle, width = (cells[0] + cells[1]) / 2, cells[1] - cells[0]
    phase = 2 * np.pi * np.multiply.outer(middle, np.asarray(tones, dtype=np.float64))
    weight = np.sinc(np.multiply.outer(width, np.asarray(tones, dtype=np.float64)))
    constant = np.ones((len(middle), 1))
    return np.concatenate([constant, weight * np.cos(phase), weight * np.sin(phase)], axis=1)


def strongest_tone(cells: Cells, mean: Array, whiten: Array, grid: Array) -> tuple[float, float]:
    """Return the frequency of the strongest tone in means of cells, Hz, and its gain.

    The gain is that of the logarithm of the likelihood, the deviation of the noise estimated.
    """
    tone, mean = 0.0, whiten @ mean
    for _ in range(2):
        waves = np.moveaxis(cell_waves(cells, grid.tolist())[:, 1:].reshape(-1, 2, len(grid)), 2, 0)
        basis, _ = np.linalg.qr(whiten @ waves)
        power = np.sum(np.einsum("kni,n->ki", basis, mean) ** 2, axis=1)
        index = int(np.argmax(power))
        tone, step = float(grid[index]), float(np.diff(grid).min())
        # Once more between the neighbors.
        grid = np.linspace(tone - step, tone + step, 41)
    share = min(float(power[index] / (mean @ mean)), 1 - 1e-12)
    return tone, -0.5 * len(mean) * float(np.log1p(-share))


def _trendless(cells: Cells) -> Array:
    """Return the projection that removes offset and drift from cells of white noise."""
    middle = (cells[0] + cells[1]) / 2
    basis, _ = np.linalg.qr(np.column_stack([np.ones_like(middle), middle]))
    return np.asarray(np.eye(len(middle)) - basis @ basis.T, dtype=np.float64)


def log_likelihood(background: Background) -> float:
    """Return the logarithm of the likelihood of background cells."""
    whiten = background.whiten
    white = whiten @ background.mean
    return float(np.log(np.diag(whiten)).sum() - 0.5 * white @ white)


def trimmed(force: Array, rate: float) -> slice:
    """Return the samples of the pulse and of the background that counts."""
    first, stop = find_pulse(force, rate)
    room = int(MAX_BACKGROUND * rate)
    return slice(max(first - room, 0), min(stop + room, len(force)))


class Weights:
    """Weights of residuals on a grid: generalized least squares, nuisance parameters projected out.

    Attributes
    ----------
    covariance : ndarray, shape (n, n)
        Covariance of the noise, N2.
    nuisance : ndarray, shape (n, n_nuisance)
        What each nuisance parameter adds to the record, for 1 N.
    predicted : ndarray, shape (n, n)
        The component of the covariance that is predicted from the residual: drift and hum, N2.
    """

    def __init__(self, covariance: Array, nuisance: Array, predicted: Array) -> None:
        self.covariance, self.nuisance = freeze(covariance), freeze(nuisance)
        self.predicted = freeze(predicted)
        # Whitening leaves of each point in time what the points before it do not predict.
        factor = np.linalg.cholesky(covariance)
        self._whiten = solve_triangular(factor, np.eye(len(factor)), lower=True, check_finite=False)
        self._basis, self._triangle = np.linalg.qr(self._whiten @ nuisance)
        self.matrix = freeze(self._whiten - self._basis @ (self._basis.T @ self._whiten))

    def deviation(self) -> float:
        """Return the standard deviation of the noise about its mean over the grid, N."""
        count = len(self.covariance)
        noise = self.covariance - self.predicted
        spread = np.trace(noise) - noise.sum() / count
        return float(np.sqrt(spread / (count - 1)))

    def estimates(self, difference: Array) -> tuple[Array, Array]:
        """Return the nuisance parameters of record − model, N, and their covariance, N2."""
        inverse = np.linalg.inv(self._triangle)
        return inverse @ (self._basis.T @ (self._whiten @ difference)), inverse @ inverse.T

    def background(self, difference: Array) -> Array:
        """Return what offset, drift and hum add to the record, N: [n], from record − model."""
        value, _ = self.estimates(difference)
        weighted = self._whiten.T @ (self.matrix @ difference)
        result: Array = self.nuisance @ value + self.predicted @ weighted
        return result


def new_weights(  # noqa: PLR0913 - components of the noise
    time: Array,
    rate: float,
    count: int,
    *,
    background: Background | None,
    noise: float | None,
    offset: bool,
    tones: Sequence[float],
) -> Weights:
    """Return the weights of a record at times, s from the middle of the pulse, on a grid.

    The grid has `count` points. `noise` is the standard deviation of white noise, N, instead of the
    noise of the background; if neither is known, it is 1 N. Waves of the `tones`, Hz, and an
    `offset` are nuisance parameters; hum of 50 and 60 Hz is that of the background.
    """
    n = len(time)
    white, colored, humming = (noise or 1.0) ** 2, np.zeros(n), np.zeros(n)
    drift = 0.0
    if background is not None:
        samples = time, time + 1 / rate
        rows = unit_covariances((time[:1], time[:1] + 1 / rate), samples)[:, 0]
        variances = background.variances
        if noise is None:
            white = variances[0] * rate / 2
            colored = variances[1:3] @ rows[:2]
        humming = variances[3:] @ rows[2:4]
        drift = DRIFT * background.peak if offset else 0.0
    slope = to_grid(drift * time[:, np.newaxis], count)
    predicted = grid_covariance(humming, count) + slope @ slope.T
    covariance = white * np.eye(count) + grid_covariance(colored, count) + predicted
    # Covariances of pink and brown noise hold up to a constant, that of an unknown offset; one of
    # the samples is root(n/count) times as large on the grid.
    covariance += 10 * np.abs(colored).max() * n / count
    columns = cell_waves((time, time + 1 / rate), tones)[:, 0 if offset else 1 :]
    return Weights(covariance, to_grid(columns, count), predicted)
