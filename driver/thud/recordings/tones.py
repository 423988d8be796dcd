"""Tones that last through a contact (docs/recordings_theory.md, section 2)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len
from scipy.ndimage import median_filter

from thud.base.note import Note
from thud.level.levels import RECORDED_BAND

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Lowest frequency of a tone, Hz: the noise includes hum with five harmonics. The highest is that of
# the recorded band.
MIN_FREQUENCY = 305.0
# Margins of the background before and after the contact, s: a plate may ring after it.
MARGINS = (5e-3, 10e-3)
# Minimum length of the background on either side, s: noise that the fit takes for a tone adds up to
# a fifth, the contact time over that of the background, to the variance of the noise.
MIN_LENGTH = 0.05
# Minimum power of a tone over the median of the spectrum within MEDIAN_WIDTH, Hz, and power of a
# background without noise.
MIN_POWER = 40.0
MEDIAN_WIDTH = 150.0
NO_POWER = 1e-30
# Amplitude and phase before and after the contact are equal within this fraction of the amplitude
# and this number of standard deviations of the noise; the amplitude exceeds so many of them.
MAX_CHANGE = 0.1
MAX_DEVIATIONS = 4.0
MAX_TONES = 12


def find_tones(
    force: NDArray[np.float64], rate: float, contact: tuple[int, int]
) -> tuple[NDArray[np.float64], tuple[Note, ...]]:
    """Return the sum of the tones that last through a contact, N, shape (n,), and notes on them.

    A tone stands out of the spectrum of the background on both sides, with the same amplitude and
    phase: ringing of a plate does not.
    """
    first = contact[0] - math.ceil(MARGINS[0] * rate)
    stop = contact[1] + math.ceil(MARGINS[1] * rate)
    count = len(force)
    if min(first, count - stop) < MIN_LENGTH * rate:
        return np.zeros(count), ()
    # Drift and offset leak less through a window on each side.
    windows, quiet = np.zeros((2, count)), np.zeros(count)
    for side, window in zip((slice(0, first), slice(stop, count)), windows, strict=True):
        window[side] = np.hanning(len(window[side]))
        quiet[side] = force[side] - np.median(force[side])
    window, sizes = windows.sum(axis=0), windows.sum(axis=1)
    time = (np.arange(count) - np.average(np.arange(count), weights=window)) / rate
    length = next_fast_len(2 * count, real=True)
    grid = np.fft.rfftfreq(length, 1 / rate)
    band = slice(*np.searchsorted(grid, [MIN_FREQUENCY, min(RECORDED_BAND, 0.4 * rate)]))
    spectrum = np.abs(np.fft.rfft(window * quiet, length)[band]) ** 2
    width = round(MEDIAN_WIDTH / grid[1])
    usual = np.maximum(median_filter(spectrum, width, mode="reflect"), NO_POWER)
    frequencies: list[float] = []
    tones, amplitudes = np.zeros(count), np.zeros(0)
    outside = window > 0
    while len(frequencies) < MAX_TONES:
        residual = quiet - tones
        power = np.abs(np.fft.rfft(window * residual, length)[band]) ** 2
        k = int(np.argmax(power / usual))
        if not power[k] > MIN_POWER * usual[k]:
            break
        frequency = float(grid[band][k])
        # Newton's step: the slope of the phase over time.
        for _ in range(2):
            turned = window * residual * np.exp(-2j * np.pi * frequency * time)
            slope = (time @ turned / turned.sum()).imag / (window @ time**2)
            frequency += float(slope) * sizes.sum() / 2 / np.pi
        before, after = 2 * (windows @ (residual * np.exp(-2j * np.pi * frequency * time))) / sizes
        amplitude = abs(sizes @ [before, after]) / sizes.sum()
        # The spectrum of noise is its variance times the sum of the squared window.
        variance = float(usual[k]) / math.log(2) / float(window @ window)
        deviation = 2 * math.sqrt(variance * float(((windows**2).sum(axis=1) / sizes**2).sum()))
        limit = MAX_DEVIATIONS * deviation
        if abs(after - before) > MAX_CHANGE * amplitude + limit or amplitude < limit:
            break
        frequencies.append(frequency)
        phase = 2 * np.pi * np.multiply.outer(time, frequencies)
        waves = np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
        factors = np.linalg.lstsq(waves[outside], quiet[outside])[0]
        tones, amplitudes = waves @ factors, np.hypot(*factors.reshape(2, -1))
    return tones, tuple(
        Note("tone_removed", value=float(amplitude), unit="N", others={"frequency": frequency})
        for frequency, amplitude in sorted(zip(frequencies, amplitudes, strict=True))
    )
