"""A top that the recorder or the amplifier cuts off."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.differences import FROM_CUBIC, MEDIAN, MIN_NOISE, noise_deviation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.drops import Section

# The force, averaged over SMOOTHING, s, is flat at its top if it is above (1 - a) of its maximum
# almost as long as above (1 - 4 a). The ratio of the times is 1 for a top that is cut off, 1.41 and
# at least 1.22 for tops of fourth order with one and two maxima, and 2 for parabolas. The fractions
# a are the lowest one, MIN_FLAT standard deviations of the noise or quantization steps, times
# powers of 2 up to MAX_FLAT. A half-sine of 20 ms that is flat for less than MIN_TOP, s, has levels
# that are less than 0.01 dB off.
SMOOTHING = 3e-4
MAX_RATIO = 1.15
MIN_FLAT = 4.0
MAX_FLAT = 0.02
MIN_TOP = 5e-4
# Fraction of full scale from which a sample is clipped.
CLIPPED_FRACTION = 0.999


def check(section: Section) -> tuple[Note, ...]:
    """Return a warning if the top of the force is flat.

    Raise InputError if two of its samples reach full scale.
    """
    force, rate = section.force[slice(*section.contact)], section.sample_rate
    count = np.count_nonzero(force >= CLIPPED_FRACTION * (section.full_scale or math.inf))
    if count > 1:
        refuse(
            f"{section.name}: the force is clipped at {force.max():.4g} N for "
            f"{1e3 * count / rate:.3g} ms",
            "a measuring range that includes the peak",
        )
    width = max(1, round(SMOOTHING * rate))
    smooth = uniform_filter1d(median_filter(force, MEDIAN) - np.median(section.background), width)
    peak = smooth.max()
    if not (len(force) >= 2 * width + len(FROM_CUBIC) and peak > 0):
        return ()
    noise, step = noise_deviation(force), section.quantization.step
    # Noise averages the steps.
    least = max(noise / math.sqrt(width), step if noise < step / 2 else 0.0, MIN_NOISE * peak)
    lowest = MIN_FLAT * least / peak
    for fraction in lowest * 2.0 ** np.arange(math.log2(max(MAX_FLAT / lowest, 0.5)) + 1):
        inner, outer = (_count_above(smooth, (1 - k * fraction) * peak) for k in (1, 4))
        if outer < MAX_RATIO * inner and inner > MIN_TOP * rate:
            size = {"fraction": 100 * float(fraction), "duration": 1e3 * inner / rate}
            return (Note("flat_top", value=float(peak), unit="N", others=size),)
    return ()


def _count_above(force: NDArray[np.float64], level: float) -> float:
    """Return the number of samples, with fractions, for which a force, N, is above a level."""
    ends = np.array([force[1:], force[:-1]]) - level
    low, high = ends.min(axis=0), ends.max(axis=0)
    return float(np.clip(high / np.maximum(high - low, 1e-100), 0, 1).sum())
