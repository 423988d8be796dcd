"""Stationary tones in the background, such as high harmonics of the mains, and their removal."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len
from scipy.ndimage import median_filter

from thud.base.note import Note
from thud.level.levels import RECORDED_BAND
from thud.recordings.faults import read_repaired, repair

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.drops import Window

# Lowest frequency, Hz: the background includes hum with five harmonics. The highest is that of the
# recorded band.
MIN_FREQUENCY = 305.0
# Margins of the background before and after the contact, s: a plate may ring after it.
MARGINS = (5e-3, 10e-3)
# Minimum length of the background on either side, s: noise that the fit takes for a tone adds up to
# a fifth, the contact time over that of the background, to the variance of the noise.
MIN_LENGTH = 0.05
# Rate to which the background is averaged for the search, Hz.
SEARCH_RATE = 6_000.0
# Minimum power of a tone over the median of the spectrum within MEDIAN_WIDTH, Hz.
MIN_POWER = 40.0
MEDIAN_WIDTH = 150.0
# Amplitude and phase before and after the contact are equal within this fraction of the amplitude
# and this number of standard deviations of the noise; the amplitude exceeds so many of them.
MAX_CHANGE = 0.1
MAX_DEVIATIONS = 4.0
MAX_TONES = 12
# Power of a background without noise.
MIN_NORMAL = 1e-30


def remove_tones(window: Window) -> tuple[Window, tuple[Note, ...]]:
    """Return a window without tones that last through the contact, and notes.

    Raise InputError if the pulse is cut off, clipped or doubled, or has long dropouts.
    """
    rate, force = window.sample_rate, window.force
    first, stop = (
        window.contact[0] - math.ceil(MARGINS[0] * rate),
        window.contact[1] + math.ceil(MARGINS[1] * rate),
    )
    if min(first, len(force) - stop) < MIN_LENGTH * rate:
        return window, ()
    found = _find_tones(force, first, stop, rate)
    if not found:
        return window, ()
    # Equal samples, which show faults, differ without the tone.
    force, faults = repair(window)
    waves = np.vstack([_wave(frequency, len(force), rate) for frequency in found])
    sides = slice(0, first), slice(stop, None)
    offset = np.median(np.concatenate([force[side] for side in sides]))
    gram = sum(waves[:, side] @ waves[:, side].T for side in sides)
    product = sum(waves[:, side] @ (force[side] - offset) for side in sides)
    coefficients = np.linalg.solve(gram, product).reshape(-1, 2)
    amplitudes = np.hypot(*coefficients.T)
    # The averages of the search also show a tone near multiples of their rate.
    coefficients[amplitudes < np.array([*found.values()]) / 2] = 0.0
    notes = tuple(
        Note("tone_removed", value=float(amplitude), unit="N", others={"frequency": frequency})
        for frequency, amplitude in sorted(zip(found, amplitudes, strict=True))
        if amplitude > found[frequency] / 2
    )
    samples = partial(
        read_repaired, window.signal, window.start, force - coefficients.ravel() @ waves
    )
    signal = replace(window.signal, samples=samples, full_scale=None)
    return replace(window, signal=signal), (*faults, *notes)


def _wave(frequency: float, count: int, rate: float) -> NDArray[np.float64]:
    """Return cosine and sine of a frequency, Hz, at samples from 0, shape (2, count)."""
    step, block = 2j * np.pi * frequency / rate, math.isqrt(count) + 1
    # Products of few values are faster than as many exponentials.
    starts, index = np.exp(step * block * np.arange(block)), np.exp(step * np.arange(block))
    wave = np.multiply.outer(starts, index).ravel()[:count]
    return np.array([wave.real, wave.imag])


def _find_tones(
    force: NDArray[np.float64], first: int, stop: int, rate: float
) -> dict[float, float]:
    """Return amplitudes, N, by frequency, Hz, of tones in a force outside a range of indices."""
    width = max(1, int(rate / SEARCH_RATE))
    rate /= width
    means = force[: len(force) // width * width].reshape(-1, width).mean(axis=1)
    first, stop = first // width, -(-stop // width)
    sides = [np.arange(first), np.arange(stop, len(means))]
    index = np.concatenate(sides)
    # Drift and offset leak less through a window on each side.
    window = np.concatenate([np.hanning(len(side) + 2)[1:-1] for side in sides])
    values = np.concatenate([means[side] - np.median(means[side]) for side in sides])
    is_before = index < first
    time = (index - np.average(index, weights=window)) / rate
    weighted = np.zeros(next_fast_len(2 * len(means), real=True))
    frequencies = np.fft.rfftfreq(len(weighted), 1 / rate)
    highest = min(RECORDED_BAND, 0.4 * rate)
    band = slice(*np.searchsorted(frequencies, [MIN_FREQUENCY, highest]))
    tones: dict[float, float] = {}
    local = np.empty(0)
    while len(tones) < MAX_TONES:
        weighted[index] = window * values
        power = np.abs(np.fft.rfft(weighted))[band] ** 2
        if not tones:
            size = round(MEDIAN_WIDTH / frequencies[1])
            local = np.maximum(median_filter(power, size, mode="reflect"), MIN_NORMAL)
        k = int(np.argmax(power / local))
        if not power[k] > MIN_POWER * local[k]:
            break
        frequency = float(frequencies[band][k])
        # Newton's step: the slope of the phase over time.
        for _ in range(2):
            demodulated = window * values * np.exp(-2j * np.pi * frequency * time)
            total, slope = demodulated.sum(), (time * demodulated).sum()
            spread = float(window @ time**2)
            frequency += float((slope / total).imag) * window.sum() / spread / 2 / np.pi
        demodulated = window * values * np.exp(-2j * np.pi * frequency * time)
        sums = [demodulated[side].sum() for side in (is_before, ~is_before)]
        before, after = (
            2 * part / window[side].sum()
            for part, side in zip(sums, (is_before, ~is_before), strict=True)
        )
        # The spectrum of noise is its variance times the sum of the squared window.
        noise = float(local[k]) / math.log(2) / float(window @ window)
        deviations = [
            2 * math.sqrt(noise * float(window[side] @ window[side])) / window[side].sum()
            for side in (is_before, ~is_before)
        ]
        amplitude = abs(2 * sum(sums) / window.sum())
        limit = MAX_DEVIATIONS * math.hypot(*deviations)
        if abs(after - before) > MAX_CHANGE * amplitude + limit or amplitude < limit:
            break
        tones[frequency] = amplitude
        wave = np.exp(2j * np.pi * frequency * time)
        columns = np.column_stack([wave.real, wave.imag])
        values = values - columns @ np.linalg.solve(columns.T @ columns, columns.T @ values)
    return tones
