"""Removal of the background of a recorded pulse (docs/recordings_theory.md, section 2)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len
from scipy.ndimage import median_filter, uniform_filter1d

from thud.base.note import Note
from thud.level.levels import RECORDED_BAND
from thud.recordings.noise import (
    Background,
    fit_background,
    fixed_covariance,
    solve_lower,
    unit_covariances,
)
from thud.recordings.quantization import MARGIN, MAX_BACKGROUND

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.drops import Section
    from thud.recordings.noise import Cells

# The background is averaged over cells. Pairs: width of a cell, and distance from the contact up to
# which this width is used, s.
BACKGROUND_CELLS = ((5e-4, 5e-3), (2e-3, 25e-3), (3e-3, MAX_BACKGROUND))
# Width of the cells in which the background is predicted during the contact and beside it, s.
CONTACT_CELL = 2e-4
QUIET_CELL = 1e-3
# Time from a fifth of the peak to the end of a flank over that from half of it to a fifth. A power
# of time up to 4 passes 1 % in it; in a longer time, strong noise may be a slow release.
REACH = 2.0
# Lowest frequency of a tone, Hz: the noise includes hum with five harmonics. The highest is that of
# the recorded band.
MIN_TONE = 305.0
# Margins of the background before and after the contact, s: a plate may ring after it.
TONE_MARGINS = (5e-3, 10e-3)
# Minimum length of the background on either side, s: noise that the fit takes for a tone adds up to
# a fifth, the contact time over that of the background, to the variance of the noise.
MIN_TONE_LENGTH = 0.05
# Minimum power of a tone over the median of the spectrum within MEDIAN_WIDTH, Hz, and power of a
# background without noise.
MIN_POWER = 40.0
MEDIAN_WIDTH = 150.0
MIN_NORMAL = 1e-30
# Amplitude and phase before and after the contact are equal within this fraction of the amplitude
# and this number of standard deviations of the noise; the amplitude exceeds so many of them.
MAX_CHANGE = 0.1
MAX_DEVIATIONS = 4.0
MAX_TONES = 12
# A step of the offset exceeds its standard deviation by this factor, and this fraction of the peak.
MIN_RATIO = 5.0
MIN_STEP = 2e-3
# Minimum number of background cells on either side for the search of a step: 30 ms.
MIN_CELLS = 22
# Time constants of an amplifier that may cause the step, s, and the increase of the sum of squares,
# in variances of the noise, up to which it is the cause.
TIME_CONSTANTS = np.geomspace(0.1, 30, 200)
INCREASE = 9.0
# Steps at these fractions of the gate are compared with the interpolated background.
INSTANTS = np.linspace(0, 1, 33)


def remove_background(
    section: Section, noise: Background | None = None
) -> tuple[NDArray[np.float64], Background]:
    """Return the force of a section without its background, N, shape (n,), and the background.

    Tones are removed by least squares. Offset, drift, hum and slow noise during the contact are
    their generalized least-squares prediction from the background on both sides. `noise` is the fit
    of the noise to another section; if None, it is fitted to this one.
    """
    force, rate, (first, stop) = section.force, section.sample_rate, section.contact
    count, middle = len(force), (first + stop) / 2 / rate
    tones, notes = find_tones(force, rate, section.contact)
    quiet = force - tones
    # At most half of a short background is cut off.
    before_stop = int(max(first - MARGIN * rate, first / 2))
    after_start = int(min(stop + MARGIN * rate, (stop + count) / 2))
    offset = float(np.median(np.concatenate([quiet[:before_stop], quiet[after_start:]])))
    quiet -= offset
    smooth = uniform_filter1d(quiet[first:stop], max(1, round(rate / RECORDED_BAND)))
    low, peak = float(smooth.min()), float(smooth.max())
    half, fifth = (
        first + np.flatnonzero(smooth >= low + level * (peak - low))[[0, -1]]
        for level in (0.5, 0.2)
    )
    reach = fifth + REACH * (fifth - half)
    before_stop = int(np.clip(reach[0], first / 2, before_stop))
    after_start = int(np.clip(reach[1], after_start, (stop + count) / 2))
    cells, mean = background_means(quiet, before_stop, after_start, rate, middle)
    quantization = section.quantization
    if noise is None:
        draws = fit_background(cells, mean, peak).draws.copy()
        draws[:, 0] = np.maximum(draws[:, 0], quantization.density)
    else:
        draws, quantization = noise.draws, noise.quantization
    ends = before_stop / rate, after_start / rate
    background = Background(cells, mean, draws, peak, quantization, middle, ends, notes)
    length = int(MAX_BACKGROUND * rate)
    begin, end = max(0, before_stop - length), min(count, after_start + length)
    bounds = [
        uniform_bounds(begin, before_stop, rate, QUIET_CELL),
        uniform_bounds(before_stop, after_start, rate),
        uniform_bounds(after_start, end, rate, QUIET_CELL),
    ]
    predicted = cells_between(np.unique(np.concatenate(bounds)), rate, middle)
    slow = np.interp(
        np.arange(count) / rate - middle,
        (predicted[0] + predicted[1]) / 2,
        background.predict_mean(predicted),
    )
    return quiet - slow, background


def cells_between(bounds: NDArray[np.intp], rate: float, middle: float) -> Cells:
    """Return begins and ends of cells, s from the middle of the contact; bounds are in samples."""
    time = np.asarray((bounds - 0.5) / rate - middle, dtype=np.float64)
    return time[:-1], time[1:]


def uniform_bounds(
    start: int, stop: int, rate: float, width: float = CONTACT_CELL
) -> NDArray[np.intp]:
    """Return bounds of cells of about a width, s, in samples at a rate, Hz."""
    count = max(1, round((stop - start) / rate / width))
    return np.unique(np.rint(np.linspace(start, stop, 1 + count)).astype(int))


def cell_means(force: NDArray[np.float64], bounds: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the means of a force, N, over cells with bounds in samples."""
    total: NDArray[np.float64] = np.add.reduceat(force[: bounds[-1]], bounds[:-1])
    return total / np.diff(bounds)


def background_means(
    force: NDArray[np.float64], before_stop: int, after_start: int, rate: float, middle: float
) -> tuple[Cells, NDArray[np.float64]]:
    """Return the background cells on both sides of a contact, and their mean forces, N."""
    bounds = [0.0]
    for width, max_distance in BACKGROUND_CELLS:
        count = int((max_distance - bounds[-1]) / width + 1e-9)
        bounds += list(bounds[-1] + width * np.arange(1, count + 1))
    indices = np.unique(np.rint(np.array(bounds) * rate).astype(int))
    sides = (
        before_stop - indices[indices <= before_stop][::-1],
        after_start + indices[indices <= len(force) - after_start],
    )
    begins, ends = zip(*(cells_between(side, rate, middle) for side in sides), strict=True)
    mean = [cell_means(force, side) for side in sides if len(side) > 1]
    return (np.concatenate(begins), np.concatenate(ends)), np.concatenate(mean)


def find_tones(
    force: NDArray[np.float64], rate: float, contact: tuple[int, int]
) -> tuple[NDArray[np.float64], tuple[Note, ...]]:
    """Return the sum of the tones that last through a contact, N, shape (n,), and notes on them.

    A tone stands out of the spectrum of the background on both sides, with the same amplitude and
    phase: ringing of a plate does not.
    """
    first = contact[0] - math.ceil(TONE_MARGINS[0] * rate)
    stop = contact[1] + math.ceil(TONE_MARGINS[1] * rate)
    if min(first, len(force) - stop) < MIN_TONE_LENGTH * rate:
        return np.zeros(len(force)), ()
    index = np.r_[0:first, stop : len(force)]
    # Drift and offset leak less through a window on each side.
    windows = np.zeros((2, len(index)))
    windows[0, :first], windows[1, first:] = np.hanning(first), np.hanning(len(index) - first)
    window, sizes = windows.sum(axis=0), windows.sum(axis=1)
    sides = force[:first], force[stop:]
    values = residual = np.concatenate([side - np.median(side) for side in sides])
    times = (np.arange(len(force)) - np.average(index, weights=window)) / rate
    time = times[index]
    padded = np.zeros(next_fast_len(2 * len(force), real=True))
    grid = np.fft.rfftfreq(len(padded), 1 / rate)
    band = slice(*np.searchsorted(grid, [MIN_TONE, min(RECORDED_BAND, 0.4 * rate)]))
    frequencies: list[float] = []
    waves, coefficients = np.empty((len(force), 0)), np.empty(0)
    local = np.empty(0)
    while len(frequencies) < MAX_TONES:
        padded[index] = window * residual
        power = np.abs(np.fft.rfft(padded)[band]) ** 2
        if not frequencies:
            size = round(MEDIAN_WIDTH / grid[1])
            local = np.maximum(median_filter(power, size, mode="reflect"), MIN_NORMAL)
        k = int(np.argmax(power / local))
        if not power[k] > MIN_POWER * local[k]:
            break
        frequency = float(grid[band][k])
        # Newton's step: the slope of the phase over time.
        for _ in range(2):
            turned = residual * np.exp(-2j * np.pi * frequency * time)
            slope = (window * time) @ turned / (window @ turned)
            frequency += float(slope.imag) * sizes.sum() / (window @ time**2) / 2 / np.pi
        turned = residual * np.exp(-2j * np.pi * frequency * time)
        before, after = 2 * (windows @ turned) / sizes
        amplitude = 2 * abs(window @ turned) / sizes.sum()
        # The spectrum of noise is its variance times the sum of the squared window.
        variance = float(local[k]) / math.log(2) / float(window @ window)
        deviation = 2 * math.sqrt(variance * float(((windows**2).sum(axis=1) / sizes**2).sum()))
        limit = MAX_DEVIATIONS * deviation
        if abs(after - before) > MAX_CHANGE * amplitude + limit or amplitude < limit:
            break
        frequencies.append(frequency)
        wave = np.exp(2j * np.pi * frequency * times)
        waves = np.column_stack([waves, wave.real, wave.imag])
        columns = waves[index]
        coefficients = np.linalg.solve(columns.T @ columns, columns.T @ values)
        residual = values - columns @ coefficients
    amplitudes = np.hypot(*coefficients.reshape(-1, 2).T)
    notes = tuple(
        Note("tone_removed", value=float(amplitude), unit="N", others={"frequency": frequency})
        for frequency, amplitude in sorted(zip(frequencies, amplitudes, strict=True))
    )
    return waves @ coefficients, notes


def find_offset_step(background: Background, impulse: float) -> float:
    """Return the step of the offset between the ends of a contact, N; zero if there is none.

    A step is fitted together with offset, drift, hum and noise. It is none if the droop of an
    amplifier after the impulse of the contact, N s, explains the background: -1/tau times the
    impulse, decaying with the time constant tau.
    """
    cells, mean, peak = background.cells, background.mean, background.peak
    time = (cells[0] + cells[1]) / 2
    after = np.asarray(time > 0, dtype=np.float64)
    if min(len(time) - after.sum(), after.sum()) < MIN_CELLS:
        return 0.0
    fit = fit_background(cells, mean, peak, column=after)
    covariance = np.tensordot(fit.variances, unit_covariances(cells), 1)
    covariance += fixed_covariance(cells, peak)
    factor = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
    column, white = solve_lower(factor, np.column_stack([after, mean])).T
    step = float(column @ white / (column @ column))
    if abs(step) < max(MIN_RATIO / math.sqrt(column @ column), MIN_STEP * peak):
        return 0.0
    squares = float(np.sum((white - step * column) ** 2))
    droop = -impulse / TIME_CONSTANTS * np.exp(-time[:, None] / TIME_CONSTANTS) * after[:, None]
    rest = solve_lower(factor, mean[:, None] - droop)
    return 0.0 if np.min(np.sum(rest**2, axis=0)) < squares + INCREASE else step


def step_errors(step: float, count: int) -> NDArray[np.float64]:
    """Return errors of a force if its offset changed at one of several instants, N, [k, count].

    The removed background is the line between both offsets.
    """
    line = np.linspace(0, step, count)
    index = np.arange(count)
    return np.array([line - step * (index >= instant * count) for instant in INSTANTS])
