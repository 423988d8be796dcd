"""Energy of the noise in the bands of a gated force, and what it makes uncertain."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from thud.levels import get_bands

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud._schema import BandSet
    from thud.recordings.estimates import Drop

# Length of transforms in gates: they resolve noise whose spectrum is smooth over a quarter of 1/T.
PADDING = 4
# Noise above this, Hz, is left out: less than 0.1 % of white noise leaks from there into a band.
HIGHEST = 8000.0


def noise_energies(
    drop: Drop, force: NDArray[np.float64], bands: BandSet
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return expected noise energy, its standard deviation, and that of the offset, N2 s.

    With E = abs(R f)**2 for the band's rows R, force f = s + n and the noise's covariance C:
    mean(E) = abs(R s)**2 + tr(V), var(E) = 4 (R s)' V (R s) + 2 tr(V V), V = R C R'. In a band of
    much more than one degree of freedom, 2 B T, this is 4 E_s S + 2 B T S**2, S the density.
    """
    rate, count = drop.sample_rate, len(force)
    rows, transforms, edges = _quadrature(bands, rate, count)
    frequency = _frequencies(rate, count)
    density = _density(drop, frequency)
    # Zero and half the sample rate stand for themselves, the others for both signs.
    density[(frequency == 0) | (frequency == rate / 2)] /= 2
    weights = np.tile(np.sqrt(density * frequency[1]), 2)
    quiet = _quiet_time(drop)
    # Variance of the mean over the quiet time, from which the offset was taken.
    offset = float(_density(drop, np.array([min(0.5 / quiet, rate / 2)]))[0]) / (2 * quiet)
    measured, ones = rows @ force, rows.sum(axis=1)
    widths = get_bands(bands).upper - get_bands(bands).lower
    mean, deviation, shift = np.zeros((3, len(widths)))
    for band, (start, stop) in enumerate(pairwise(edges)):
        weighted = transforms[start:stop] * weights
        covariance = weighted @ weighted.T
        signal, unit = measured[start:stop], ones[start:stop]
        squares = float((covariance**2).sum())
        mean[band] = np.trace(covariance)
        # The measured signal holds the noise too: its expected part, tr(V V), is taken off.
        variance = max(4 * float(signal @ covariance @ signal) - 2 * squares, 2 * squares)
        # The noise itself is known from 2 B T values of the quiet time.
        variance += mean[band] ** 2 / max(widths[band] * quiet, 1.0)
        deviation[band] = math.sqrt(variance)
        linear, square = float(signal @ unit), float(unit @ unit)
        shift[band] = math.sqrt(4 * linear**2 * offset + 2 * (square * offset) ** 2)
    return mean, deviation, shift


def _frequencies(rate: float, count: int) -> NDArray[np.float64]:
    """Return the frequencies at which the noise counts, Hz."""
    frequency = np.fft.rfftfreq(PADDING * count, 1 / rate)
    return np.asarray(frequency[frequency <= HIGHEST], dtype=np.float64)


def _density(drop: Drop, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the one-sided spectral density of the noise, N2/Hz, at ascending frequencies."""
    # Densities that rise without end towards 0 Hz count at the middle of the first interval: what
    # lies below went with the offset.
    positive = np.where(frequency > 0, frequency, frequency[1 % len(frequency)] / 2)
    return np.asarray(drop.noise.spectrum(positive), dtype=np.float64)


def _quiet_time(drop: Drop) -> float:
    """Return the duration of the quiet parts from which the noise is known, s."""
    step = 1 / drop.sample_rate
    before = -float(drop.time[0])
    end = float(drop.bounces[0] if drop.bounces else drop.time[-1] + step)
    after = end - float(drop.contact_time)
    source = drop.noise.source
    times = {"before": before, "after": after}
    used = [time for word, time in times.items() if word in source] or [before]
    return float(max(sum(max(time, 0.0) for time in used), step))


@lru_cache(maxsize=4)
def _quadrature(
    bands: BandSet, rate: float, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[int]]:
    """Return rows R with E_b = sum over the band's rows of (R f)**2, and their transforms.

    Gauss-Legendre nodes in each band, a cosine and a sine each: 2 abs(F(f))**2 is a sum of cosines
    of delays up to T = count / rate, which B T pi / 2 nodes resolve, and five more to 1e-4 dB.

    Returns
    -------
    tuple
        Rows, shape (n_row, count); real and imaginary parts of their transforms, side by side,
        shape (n_row, 2 n_frequency); the first row of each band, and the end.
    """
    edges = get_bands(bands)
    time = np.arange(count) / rate
    rows: list[NDArray[np.float64]] = []
    starts = [0]
    for lower, upper in zip(edges.lower, edges.upper, strict=True):
        number = math.ceil(math.pi * (upper - lower) * count / rate / 2) + 5
        nodes, weights = np.polynomial.legendre.leggauss(number)
        phase = np.pi * ((upper + lower) + (upper - lower) * nodes)[:, None] * time
        scale = np.sqrt((upper - lower) * weights)[:, None] / rate
        rows += [scale * np.cos(phase), scale * np.sin(phase)]
        starts.append(starts[-1] + 2 * number)
    matrix = np.concatenate(rows)
    transforms = np.fft.rfft(matrix, PADDING * count)[:, : len(_frequencies(rate, count))]
    return matrix, np.concatenate([transforms.real, transforms.imag], axis=1), starts
