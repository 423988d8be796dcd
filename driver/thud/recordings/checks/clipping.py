"""A top that the recorder or the amplifier cuts off."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import peak_widths

from thud.base.checks import refuse
from thud.base.note import Note

if TYPE_CHECKING:
    from thud.recordings.drops import Section

# The force, averaged over SMOOTHING, s, is flat at its top if it is above
# (1 - a) of its maximum almost as long as above (1 - 4 a). The ratio of the times is 1 for a top
# that is cut off, 1.41 and at least 1.22 for tops of fourth order with one and two maxima, and 2
# for parabolas. The fractions a are the lowest one, MIN_FLAT standard deviations of the noise or
# quantization steps, and at least MIN_NOISE each, times powers of 2 up to MAX_FLAT. A half-sine of
# 20 ms that is flat for less than MIN_TOP, s, has levels that are less than 0.01 dB off.
SMOOTHING = 3e-4
MAX_RATIO = 1.15
MIN_FLAT = 4.0
MIN_NOISE = 4e-5
MAX_FLAT = 0.02
MIN_TOP = 5e-4
# Fraction of full scale from which a sample is clipped.
CLIPPED_FRACTION = 0.999


def check(section: Section) -> tuple[Note, ...]:
    """Return a warning if the top of the force is flat.

    Raise InputError if two of its samples reach full scale. A top that is cut off at 1450 N changes
    250 Hz by 1.3 dB, at 1200 N 125 Hz by 3.9 dB.
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
    smooth = uniform_filter1d(force - section.offset, width)
    top, peak = int(smooth.argmax()), float(smooth.max())
    if peak <= 0:
        return ()
    noise, step = section.noise, section.quantization.step
    # Noise averages the steps.
    least = max(noise / math.sqrt(width), step if noise < step / 2 else 0.0, MIN_NOISE * peak)
    lowest = MIN_FLAT * least / peak
    # The height of the whole force, from its first to its last sample.
    height = np.array([peak]), np.array([0]), np.array([len(smooth) - 1])
    for fraction in lowest * 2.0 ** np.arange(math.log2(max(MAX_FLAT / lowest, 0.5)) + 1):
        inner, outer = (peak_widths(smooth, [top], k * fraction, height)[0][0] for k in (1, 4))
        if outer < MAX_RATIO * inner and inner > MIN_TOP * rate:
            size = {"fraction": 100 * float(fraction), "duration": 1e3 * inner / rate}
            return (Note("flat_top", value=peak, unit="N", others=size),)
    return ()
