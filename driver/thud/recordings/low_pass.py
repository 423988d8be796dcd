"""The low-pass at 1.25 kHz of the paper (section 3)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import butter, sosfiltfilt

from thud.level.levels import RECORDED_BAND

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Order of the Butterworth filter, which runs forwards and backwards.
ORDER = 6
# Energy that each run takes at the band edge, over what it leaves: both leave a half.
SHARE = math.sqrt(2) - 1


def low_pass_force(
    force: NDArray[np.float64], sample_rate: float
) -> tuple[NDArray[np.float64], str]:
    """Return a force below 1.25 kHz, N, shape (n_sample,), without delay, and a sentence on it.

    A Butterworth filter of order 6 runs forwards and backwards; together they are 3.01 dB down at
    1.25 kHz. Where the sample rate, Hz, is too low to hold such frequencies, nothing is done.
    """
    if sample_rate <= 2 * RECORDED_BAND:
        return force, describe_low_pass(sample_rate)
    # Both runs attenuate by (1 + (t/t_corner)**12)**2 in energy, t = tan(pi f / rate): 2 at the
    # band edge.
    edge = math.tan(math.pi * RECORDED_BAND / sample_rate)
    corner = sample_rate / math.pi * math.atan(edge / SHARE ** (1 / (2 * ORDER)))
    sections = butter(ORDER, corner, fs=sample_rate, output="sos")
    room = min(len(force) - 1, math.ceil(10 * sample_rate / RECORDED_BAND))
    filtered: NDArray[np.float64] = sosfiltfilt(sections, force, padlen=max(room, 0))
    return filtered, describe_low_pass(sample_rate)


def describe_low_pass(sample_rate: float) -> str:
    """Return what `low_pass_force` does at a sample rate, Hz."""
    if sample_rate <= 2 * RECORDED_BAND:
        return f"no low-pass at 1.25 kHz: the sample rate, {sample_rate:g} Hz, is one"
    return (
        f"low-pass, -3 dB at 1.25 kHz: Butterworth of order {ORDER}, forwards and backwards "
        "(no delay)"
    )


def attenuation(frequency: NDArray[np.float64], sample_rate: float) -> NDArray[np.float64]:
    """Return the attenuation of the low-pass, dB; zero where it is not applied."""
    if sample_rate <= 2 * RECORDED_BAND:
        return np.zeros(frequency.shape)
    edge = math.tan(math.pi * RECORDED_BAND / sample_rate)
    ratio = np.tan(np.pi * np.minimum(frequency / sample_rate, 0.5)) / edge
    return np.asarray(20 * np.log10(1 + SHARE * ratio ** (2 * ORDER)))
