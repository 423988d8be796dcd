"""Band filters of class 1 (IEC 61260-1), and levels by them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import butter, resample, sosfilt

from thud.base.checks import refuse, require_array, require_number
from thud.level.levels import get_bands
from thud.recordings.signal import RATES

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from thud.base._schema import BandSet

# Order of the low-pass prototype of each Butterworth band-pass, which has six poles. Order 2 misses
# the mask of class 1 by 18 dB.
ORDER = 3
# Minimum ratio of sample rate and upper band edge. Below it the bilinear transform flattens the
# lower skirt, which then misses the mask: by 0.8 dB at a ratio of 3.5, by 4 dB at 2.5.
MIN_RATIO = 4.0
# Length of a filter's decay in reciprocals of its bandwidth: its slowest poles then have lost all
# but 1e-7 of their energy, 4e-7 dB if the band holds as much.
DECAY = 7.3


def band_filters(bands: BandSet, sample_rate: float) -> NDArray[np.float64]:
    """Return the filters of bands as second-order sections, shape (n_band, 3, 6).

    They are Butterworth band-passes with six poles, 3.01 dB down at the exact band edges. A band
    whose upper edge exceeds a quarter of the sample rate, Hz, is NaN: its filter would miss the
    mask of class 1. For such bands `filter_levels` interpolates the record.

    Second-order sections need no decimation: even at 1 MHz the attenuation of the lowest band is
    accurate to 1e-6 dB.
    """
    require_number("sample_rate", sample_rate, *RATES, "Hz")
    edges = get_bands(bands)
    sections = np.full((len(edges.nominal), ORDER, 6), np.nan)
    for band in np.flatnonzero(MIN_RATIO * edges.upper <= sample_rate * (1 + 1e-12)):
        edge = edges.lower[band], edges.upper[band]
        sections[band] = butter(ORDER, edge, "bandpass", fs=sample_rate, output="sos")
    return sections


def filter_levels(
    force: ArrayLike, sample_rate: float, bands: BandSet = "octave"
) -> NDArray[np.float64]:
    """Return the levels of a force by filters of class 1, dB re 1 N and 1 s, shape (n_band,).

    The force, N, shape (n_sample,), is zero before its first and after its last sample: the filters
    start at rest and decay completely. Levels are NaN if the upper band edge is not below half the
    sample rate, Hz. Raise InputError if the record is empty, zero throughout or not finite, or
    the rate or the bands are invalid.
    """
    record = require_array("force", force, (1,), "iuf")
    if not np.isfinite(record).all() or not record.any():
        refuse("force is empty, zero throughout or not finite", "a force record, N")
    require_number("sample_rate", sample_rate, *RATES, "Hz")
    edges = get_bands(bands)
    inside = edges.upper < sample_rate / 2
    levels = np.full(len(inside), np.nan)
    if not inside.any():
        return levels
    factor = max(1, math.ceil(MIN_RATIO * edges.upper[inside].max() / sample_rate))
    rate = float(sample_rate) * factor
    sections = band_filters(bands, rate)
    decays = np.ceil(DECAY * rate / (edges.upper - edges.lower)).astype(int)
    if factor > 1:
        # Fourier interpolation keeps the spectrum below half the rate. It rings beyond both ends of
        # the record, hence the padding.
        record = np.pad(record, decays.max())
        record = resample(record, factor * len(record))
    for band in np.flatnonzero(inside):
        filtered = sosfilt(sections[band], np.pad(record, (0, decays[band])))
        levels[band] = 10 * np.log10(filtered @ filtered / rate)
    return levels
