"""The low-pass at 1.25 kHz of the paper (section 3)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import butter, sosfiltfilt

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Band edge, Hz, and the order of the Butterworth filter, which runs forwards and backwards.
BAND_EDGE = 1250.0
ORDER = 6


def low_pass_force(
    force: NDArray[np.float64], sample_rate: float
) -> tuple[NDArray[np.float64], str]:
    """Return a force below 1.25 kHz, N, shape (n_sample,), without delay, and a sentence on it.

    A Butterworth filter of order 6 runs forwards and backwards; together they are 3.01 dB down at
    1.25 kHz. Where the sample rate, Hz, is too low to hold such frequencies, nothing is done.
    """
    corner = _corner()
    if corner >= sample_rate / 2:
        return force, f"no low-pass at 1.25 kHz: the sample rate, {sample_rate:g} Hz, is one"
    sections = butter(ORDER, corner, fs=sample_rate, output="sos")
    room = min(len(force) - 1, math.ceil(10 * sample_rate / BAND_EDGE))
    filtered: NDArray[np.float64] = sosfiltfilt(sections, force, padlen=max(room, 0))
    return filtered, (
        f"low-pass, -3 dB at 1.25 kHz: Butterworth of order {ORDER}, forwards and backwards "
        "(no delay)"
    )


def _corner() -> float:
    """Return the corner of one run of the low-pass, Hz; both runs are 3 dB down at 1.25 kHz.

    Two runs attenuate by (1 + (f/corner)**12)**2 in energy, which is 2 at the band edge.
    """
    return float(BAND_EDGE / (math.sqrt(2) - 1) ** (1 / (2 * ORDER)))


def attenuation(frequency: NDArray[np.float64], sample_rate: float) -> NDArray[np.float64]:
    """Return the attenuation of the low-pass, dB; zero where it is not applied."""
    if _corner() >= sample_rate / 2:
        return np.zeros(frequency.shape)
    warped = np.tan(np.pi * np.minimum(frequency / sample_rate, 0.5))
    ratio = warped / math.tan(math.pi * _corner() / sample_rate)
    return np.asarray(20 * np.log10(1 + ratio ** (2 * ORDER)))
