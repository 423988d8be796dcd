"""Free oscillation A exp(-t/d) cos(2 pi f t + p) of a force plate."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Minimum frequency of a resonance of a plate, Hz.
MIN_FREQUENCY = 200.0


def resonance(frequency: float, decay_time: float) -> tuple[float, float]:
    """Return the resonance, Hz, and the quality factor of a mode from its free oscillation.

    A damped mode oscillates at a frequency, Hz, below its resonance; the amplitude falls to 1/e
    within the decay time, s.
    """
    natural = math.hypot(frequency, 1 / (2 * math.pi * decay_time))
    return natural, math.pi * natural * decay_time


def matched_energy(
    level: NDArray[np.float64], rate: float, decay_times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return frequencies, Hz, and the energy of a matched filter, shape (n_decay, n_frequency).

    The filter searches a free oscillation that begins with the level. Of white noise the energy is
    its variance at every frequency and decay time, s.
    """
    windows = np.exp(-np.arange(len(level)) / rate / decay_times[:, None])
    length = next_fast_len(2 * len(level), real=True)
    energy = np.abs(np.fft.rfft(windows * level, length)) ** 2 / (windows**2).sum(axis=1)[:, None]
    frequency = np.fft.rfftfreq(length, 1 / rate)
    return np.asarray(frequency, dtype=np.float64), np.asarray(energy)
