"""Records of force: samples, pulse, background and noise, as `thud.recordings` models it.

Records are compared on a grid of an odd number of points with the same Fourier coefficients up to a
frequency. `on_grid` is orthonormal: white noise stays white and keeps its deviation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.background import (
    DRIFT,
    MAINS,
    Background,
    cell_means,
    fit_noise,
    unit_covariances,
)
from thud.recordings.drops import CELL, FOOT, MARGIN, MAX_BACKGROUND
from thud.recordings.formats import MIN_SAMPLES, uniform_grid
from thud.studies.fitting.comparison import UNLIKELY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.recordings.background import Cells
    from thud.recordings.formats.text import Table
    from thud.studies.arrays import Array


# Maximum force, N: its square is finite.
MAX_FORCE = 1e12
# Minimum number of independent values in the band that determine the noise.
MIN_BACKGROUND = 50
# Minimum frequency of a tone, Hz: below, it is drift within a pulse. Maximum number of tones.
MIN_TONE = 10.0
MAX_TONES = 3
# Tones are searched up to this fraction of the highest frequency.
TONE_EDGE = 0.95
# Time from the foot of a pulse to its edge, s: flanks of the models rise to it in 4 ms.
FLANK = 2 * MARGIN * CELL


class Record(NamedTuple):
    """Uniformly spaced times, s, and force, N, both of shape (n_sample,), and sample rate, Hz."""

    time: Array
    force: Array
    sample_rate: float


def time_and_force(table: Table) -> Array:
    """Return time, s, and force, N, shape (n_row, 2), of a table of two columns."""
    columns = table.columns
    if len(columns) != 2:  # noqa: PLR2004 - time and force
        count = f"{len(columns[0].values)} rows of {len(columns)} numbers"
        refuse(f"{table.name}: {count}", "two columns: time, s, and force, N")
    is_second = columns[1].is_time and not columns[0].is_time
    time, force = columns[::-1] if is_second else columns
    return np.column_stack([time.to("s"), force.to("N")])


def read_record(table: Array, name: str = "record") -> Record:
    """Return the record of a table with the columns time, s, and force, N.

    Raise InputError if it has fewer than eight samples, times that are not uniformly spaced, or
    a force that is not mainly positive.
    """
    rows, columns = table.shape
    if rows < MIN_SAMPLES or columns != 2:  # noqa: PLR2004 - time and force
        refuse(
            f"{name}: {rows} rows of {columns} numbers",
            f"{MIN_SAMPLES} rows or more of time, s, and force, N",
        )
    if not np.isfinite(table).all():
        refuse(f"{name}: a value is not finite", "real numbers")
    time, force = table.T
    begin, step, *_ = uniform_grid(time, name)
    if force.max() <= 0 and not force.min() < 0:
        refuse(f"{name}: the force is nowhere positive", "the force on the floor, N")
    if -force.min() > force.max():
        refuse(
            f"{name}: the force is mostly negative, {force.min():.4g} to {force.max():.4g} N",
            "the force on the floor, positive in compression (change its sign)",
        )
    if force.max() > MAX_FORCE:
        refuse(f"{name}: the force has a peak of {force.max():.4g} N", f"up to {MAX_FORCE:g} N")
    uniform = np.asarray(begin + np.arange(rows) * step, dtype=np.float64)
    return Record(uniform, force.copy(), 1 / step)


def on_grid(spectrum: NDArray[np.complex128]) -> Array:
    """Return the history of Fourier coefficients, (n, ...), on a grid of 2 n - 1 points."""
    result: Array = np.fft.irfft(spectrum, 2 * len(spectrum) - 1, norm="ortho", axis=0)
    return result


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


class Quiet(NamedTuple):
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
    """

    cells: Cells
    mean: Array
    peak: float
    seconds: float
    middle: float
    freedom: int
    deviation: float


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
    )


def fit_quiet(quiet: Quiet, tones: Sequence[float] = ()) -> Background:
    """Return the most likely noise: white, pink, brown and hum of 50 and 60 Hz.

    Tones, Hz, are removed first, by least squares.
    """
    waves = np.column_stack([np.ones(len(quiet.mean)), cell_waves(quiet.cells, tones)])
    factors = np.linalg.lstsq(waves, quiet.mean)[0]
    residual = quiet.mean - waves @ factors
    logarithms, log_covariance = fit_noise(quiet.cells, residual, quiet.peak)
    # The waves have absorbed part of the noise.
    n = len(residual)
    scale = np.where(np.arange(5) < 3, n / (n - 2 * len(tones)), 1.0)  # noqa: PLR2004
    sizes = np.hypot(*factors[1:].reshape(2, -1)).tolist()
    notes = (
        Note("tone_removed", value=size, unit="N", others={"frequency": tone})
        for tone, size in zip(tones, sizes, strict=True)
    )
    variances = scale * np.exp(logarithms)
    return Background(
        quiet.cells, residual, variances, quiet.peak, log_covariance, tones=tuple(notes)
    )


def find_tones(quiet: Quiet, below: float) -> tuple[float, ...]:
    """Return the frequencies of tones, Hz, which noise and hum of 50 and 60 Hz do not explain.

    A tone must raise the likelihood by more than the search over all frequencies does.
    """
    step = 1 / (8 * float(np.abs(quiet.cells).max()))
    grid = np.arange(MIN_TONE, TONE_EDGE * below, step)
    # The noise includes hum of the mains.
    grid = grid[np.abs(grid[:, np.newaxis] - MAINS).min(axis=1) > 2 * step]
    min_gain = float(np.log(len(grid) / UNLIKELY))
    result: tuple[float, ...] = ()
    best = fit_quiet(quiet)
    while len(result) < MAX_TONES:
        tones = (*result, strongest_tone(quiet.cells, best.mean, grid))
        trial = fit_quiet(quiet, tones)
        if log_likelihood(trial) < log_likelihood(best) + min_gain:
            break
        best, result = trial, tones
    return result


def log_likelihood(background: Background) -> float:
    """Return the logarithm of the likelihood of background cells."""
    whiten = background.whiten
    white = whiten @ background.mean
    return float(np.log(np.diag(whiten)).sum() - 0.5 * white @ white)


def cell_waves(cells: Cells, tones: Sequence[float] | Array) -> Array:
    """Return means over cells of the cosines, then of the sines, of tones, Hz: [n_cell, 2 n]."""
    middle, width = (cells[0] + cells[1]) / 2, cells[1] - cells[0]
    frequency = np.asarray(tones, dtype=np.float64)
    phase = 2 * np.pi * np.multiply.outer(middle, frequency)
    weight = np.sinc(np.multiply.outer(width, frequency))
    return np.concatenate([weight * np.cos(phase), weight * np.sin(phase)], axis=1)


def strongest_tone(cells: Cells, mean: Array, grid: Array) -> float:
    """Return the frequency of the strongest tone in means of cells but their trend, Hz."""
    middle = (cells[0] + cells[1]) / 2
    trend, _ = np.linalg.qr(np.column_stack([np.ones_like(middle), middle]))
    mean, tone = mean - trend @ (trend.T @ mean), 0.0
    for _ in range(2):
        waves = np.moveaxis(cell_waves(cells, grid).reshape(-1, 2, len(grid)), 2, 0)
        basis, _ = np.linalg.qr(waves - trend @ (trend.T @ waves))
        power = np.sum(np.einsum("kni,n->ki", basis, mean) ** 2, axis=1)
        tone, step = float(grid[np.argmax(power)]), float(np.diff(grid).min())
        # Once more between the neighbors.
        grid = np.linspace(tone - step, tone + step, 41)
    return tone


class Noise(NamedTuple):
    """Noise on a grid of n points.

    Attributes
    ----------
    whiten : ndarray, shape (n, n)
        Makes it independent and of unit variance: of each point in time it leaves what the points
        before it do not predict, 1/N.
    predicted : ndarray, shape (n, n)
        The component of the covariance that is predicted from the residual: offset, drift, hum and
        tones, N2.
    deviation : float
        Standard deviation of the rest about its mean, N.
    """

    whiten: Array
    predicted: Array
    deviation: float

    def background(self, difference: Array) -> Array:
        """Return what offset, drift, hum and tones add to the record, N: [n]; of its difference."""
        result: Array = self.predicted @ (self.whiten.T @ (self.whiten @ difference))
        return result


def record_noise(  # noqa: PLR0913 - components of the noise
    time: Array,
    rate: float,
    count: int,
    *,
    background: Background | None,
    white: float | None,
    offset: float,
) -> Noise:
    """Return the noise of a record at times, s from the middle of the pulse, on a grid.

    The grid has `count` points. `white` is the standard deviation of white noise, N, instead of the
    noise of the background; if neither is known, it is 1 N. Hum of 50 and 60 Hz is that of the
    background. `offset` is the prior standard deviation of an offset and of the amplitudes of the
    tones of the background, N.
    """
    n = len(time)
    variance, colored, humming = (white or 1.0) ** 2, np.zeros(n), np.zeros(n)
    columns = [np.full(n, offset)]
    if background is not None:
        samples = time, time + 1 / rate
        rows = unit_covariances((time[:1], time[:1] + 1 / rate), samples)[:, 0]
        variances = background.variances
        if white is None:
            variance = variances[0] * rate / 2
            colored = variances[1:3] @ rows[:2]
        humming = variances[3:] @ rows[2:4]
        tones = [float(note.others["frequency"]) for note in background.tones]
        columns += [DRIFT * background.peak * time, *(offset * cell_waves(samples, tones).T)]
    spectra = np.fft.rfft(np.column_stack(columns), norm="ortho", axis=0)
    trends = on_grid(spectra[: count // 2 + 1])
    # Covariances of pink and brown noise hold up to a constant, that of an unknown offset; one of
    # the samples is root(n/count) times as large on the grid.
    other = variance * np.eye(count) + grid_covariance(colored, count)
    other += 10 * np.abs(colored).max() * n / count
    predicted = grid_covariance(humming, count) + trends @ trends.T
    deviation = np.sqrt((np.trace(other) - other.sum() / count) / (count - 1))
    factor = np.linalg.cholesky(other + predicted)
    whiten = solve_triangular(factor, np.eye(count), lower=True, check_finite=False)
    return Noise(whiten, predicted, float(deviation))
