"""Maximum Fast levels of a sound pressure in the rated one-third-octave bands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter, sosfilt

from thud.base.immutable import Immutable
from thud.floors.prediction import BANDS
from thud.level.levels import get_bands
from thud.level.rating import MAX_LEVEL, rated_bands, rating
from thud.recordings.filters import band_filters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Samples per second of the levels, which contain frequencies up to 1 kHz.
RATE = 6000
# Time constant of the Fast detector, s, and reference sound pressure, Pa.
TIME_CONSTANT = 0.125
REFERENCE_PRESSURE = 2e-5


@dataclass(frozen=True, eq=False, repr=False)
class SoundLevels(Immutable):
    """Maximum Fast levels of a sound, dB re 20 uPa.

    Attributes
    ----------
    third : ndarray, shape (12,)
        Levels of the one-third-octave bands 50 to 630 Hz.
    octave : ndarray, shape (4,)
        Levels of the octaves 63 to 500 Hz; each is the maximum of the sum of its bands.
    a_weighted : float
        A-weighted level L_AFmax; as a reference, that of the modal sound and of bands of noise.
    """

    third: Array
    octave: Array
    a_weighted: float

    @property
    def shown(self) -> Array:
        """Levels of the octaves and the A-weighted level, dB, shape (5,)."""
        return np.append(self.octave, self.a_weighted)

    def deviation(self, reference: SoundLevels) -> float:
        """Return the largest difference of octaves and A-weighted levels, dB."""
        return float(abs(self.shown - reference.shown).max())

    def __repr__(self) -> str:
        """Return the A-weighted level."""
        return f"<SoundLevels: L_AFmax {self.a_weighted:.1f} dB>"


def fast_histories(pressure: Array, indices: Sequence[int]) -> Array:
    """Return the squared pressure after the Fast detector in bands, Pa2, (n_band, n_sample)."""
    sections, _, _ = band_sections()
    rows = [fast_history(sosfilt(sections[band], pressure) ** 2) for band in indices]
    return np.array(rows).reshape(-1, len(pressure))


def fast_history(square: Array) -> Array:
    """Return a squared pressure after the Fast detector, Pa2, along the last axis."""
    kept = math.exp(-1 / (TIME_CONSTANT * RATE))
    return np.asarray(lfilter([1 - kept], [1, -kept], square))


def measured_levels(pressure: Array) -> SoundLevels:
    """Return the levels of a sound pressure, Pa, shape (n_sample,)."""
    n_band = len(_weights())
    return maximum_levels(fast_histories(pressure, range(n_band)), pressure, n_band)


def _weighted_history(pressure: Array) -> Array:
    """Return the A-weighted squared pressure after the Fast detector, Pa2, shape (n_sample,)."""
    gain = _a_weighting(np.asarray(np.fft.rfftfreq(len(pressure), 1 / RATE), float))
    return fast_history(np.fft.irfft(np.fft.rfft(pressure) * gain, len(pressure)) ** 2)


def _a_weighting(frequency: Array) -> Array:
    """Return the factor of pressure of the A-weighting at frequencies, Hz (IEC 61672-1 annex E)."""

    def response(frequency: Array) -> Array:
        low, lower, upper, high = (
            corner**2 + frequency**2 for corner in (20.6, 107.65, 737.86, 12194.22)
        )
        return np.asarray(frequency**4 / (low * np.sqrt(lower * upper) * high))

    return np.asarray(response(frequency) / response(np.array(1000.0)))


@lru_cache
def band_sections() -> tuple[Array, Array, Array]:
    """Return the filters of the rated one-third-octave bands, and their lower and upper edges."""
    bands = get_bands(BANDS)
    rated = np.isin(bands.nominal, rated_bands(BANDS))
    return band_filters(BANDS, RATE)[rated], bands.lower[rated], bands.upper[rated]


@lru_cache
def _weights() -> Array:
    """Return the factors of the A-weighting in the rated one-third-octave bands."""
    n_band = len(rated_bands(BANDS))
    alone = np.where(np.eye(n_band) > 0, 0.0, -MAX_LEVEL)
    return np.array([10 ** (rating(levels, BANDS).a_weighted / 10) for levels in alone])


def maximum_levels(histories: Array, pressure: Array, n_known: int) -> SoundLevels:
    """Return the maximum levels of histories of the squared pressure, Pa2, (12, n_sample).

    `pressure` is the sound pressure, Pa, shape (n_sample,), of the first `n_known` bands; the
    A-weighting of the other bands is that at their mid frequencies.
    """
    octaves = histories.reshape(-1, 3, histories.shape[1]).sum(axis=1)
    weighted = _weighted_history(pressure) + _weights()[n_known:] @ histories[n_known:]
    return SoundLevels(_level(histories), _level(octaves), float(_level(weighted)))


def _level(history: Array) -> Array:
    """Return the maximum levels of histories of the squared pressure, dB."""
    return np.asarray(10 * np.log10(history.max(axis=-1) / REFERENCE_PRESSURE**2))
