"""Checks of the force of one drop: top cut off, samples lost, aliasing, load cells."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import maximum_filter, uniform_filter1d
from scipy.signal import peak_widths

from thud.base.checks import refuse
from thud.base.note import Note
from thud.level.levels import get_bands
from thud.recordings.signal import MIN_OPPOSITE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.recordings.contact import Contact
    from thud.recordings.drops import Section

# The force, averaged over SMOOTHING, s, is flat at its top if it is above (1 - a) of its maximum
# almost as long as above (1 - 4 a). The ratio of the times is 1 for a top that is cut off, 1.41 and
# at least 1.22 for tops of fourth order with one and two maxima, and 2 for parabolas. The fractions
# a are the lowest one, MIN_FLAT standard deviations of the noise or quantization steps, and at
# least MIN_FRACTION each, times powers of 2 up to MAX_FLAT. A half-sine of 20 ms that is flat for
# less than MIN_TOP, s, has levels that are less than 0.01 dB off.
SMOOTHING = 3e-4
MAX_WIDTH_RATIO = 1.15
MIN_FLAT = 4.0
MIN_FRACTION = 4e-5
MAX_FLAT = 0.02
MIN_TOP = 5e-4
# Fraction of full scale from which a sample is clipped.
CLIPPED_FRACTION = 0.999
# Minimum number of equal samples that are lost, and minimum jump into or out of them, as a fraction
# of the peak: no flank rises as much between two samples at 20 kHz. It is at least MIN_SCORE
# standard deviations of the noise, which may repeat coarse codes. Minimum of any jump in
# quantization steps.
MIN_LOST = 3
MIN_LOSS = 0.04
MIN_SCORE = 8.0
MIN_STEPS = 3.5
# Samples deviate from a cubic for MIN_GAP, s, by less than this fraction of the noise: one of
# 10 000 does so by chance. The noise exceeds this fraction of the peak and a quantization step.
MIN_GAP = 1e-3
MIN_GAP_SAMPLES = 7
MAX_QUIET = 1e-4
MIN_NOISE = 4e-5
# Fraction of the background outside the contact from which constant samples are a gate, not a loss.
MAX_CONSTANT = 0.5
# Value and slope are compared between the lines through the samples of this time, s, or four at
# least, on either side. Its curvature changes the slope of a force of 600 Hz by less than that of
# a kink, which is a jump by MIN_RATIO or MIN_SLOPE_RATIO times the largest change around it. First
# touch and release, where forces have kinks and jumps up to FLANK of the peak and more, are at
# least JUMP_MARGIN, s, away.
JUMP_TIME = 2.5e-4
FLANK = 0.1
JUMP_MARGIN = 5e-4
MIN_RATIO = 3.0
# The same for the quieter side alone, of values: packets that change places jump three times, and
# hide each other on the sides between them. The slope may change on one side only.
MIN_SIDE_RATIO = 6.0
# Forces of finite-element balls have changes of slope, too. Of 171 clean records, 40 with exchanged
# packets and 40 with lines in the contact, a limit of 3 names 45, 39 and 26, one of 3.5 names 6, 39
# and 25, and one of 4 names 1, 39 and 23.
MIN_SLOPE_RATIO = 3.5
# Minimum jump as a fraction of the peak.
MIN_JUMP = 0.005
# Fraction of the rate above which content indicates aliasing, and error above which a warning is
# raised, dB.
ALIASED_FRACTION = 0.4
MAX_ERROR = 0.1
# Maximum deviation of a channel from the sum of the others, as a fraction, if it is their sum.
MAX_DEVIATION = 0.05
# Minimum magnitude of the impulse of a cell as a fraction of that of the sum: without one of four
# cells, levels are 2.5 dB too low.
MIN_SHARE = 0.005


def check_clipping(section: Section) -> tuple[Note, ...]:
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
    least = max(noise / math.sqrt(width), step if noise < step / 2 else 0.0, MIN_FRACTION * peak)
    lowest = MIN_FLAT * least / peak
    # The height of the whole force, from its first to its last sample.
    height = np.array([peak]), np.array([0]), np.array([len(smooth) - 1])
    for fraction in lowest * 2.0 ** np.arange(math.log2(max(MAX_FLAT / lowest, 0.5)) + 1):
        inner, outer = (peak_widths(smooth, [top], k * fraction, height)[0][0] for k in (1, 4))
        if outer < MAX_WIDTH_RATIO * inner and inner > MIN_TOP * rate:
            size = {"fraction": 100 * float(fraction), "duration": 1e3 * inner / rate}
            return (Note("flat_top", value=peak, unit="N", others=size),)
    return ()


def check_lost(section: Section) -> tuple[Note, ...]:
    """Raise InputError if samples are lost: equal, with jumps before and after them.

    One jump is enough but at forces of the background, which may be constant beside a steep flank.
    Zeros of 0.2 to 0.9 ms in a contact change 250 and 500 Hz by up to 20 dB.
    """
    whole, contact = section.force - section.offset, slice(*section.contact)
    force = whole[contact]
    bounds = np.flatnonzero(np.diff(force, prepend=np.nan, append=np.nan) != 0)
    step, noise = section.quantization.step, section.noise
    limit = max(MIN_LOSS * float(force.max()), MIN_STEPS * step, MIN_SCORE * noise)
    is_jump = np.abs(np.diff(force, prepend=force[0], append=force[-1]))[bounds] > limit
    jumps = is_jump[:-1].astype(int) + is_jump[1:]
    # With hum and drift, but without single samples that are lost.
    quiet = limit / 2 + float(np.quantile(np.abs(np.delete(whole, contact)), 0.95))
    least = 1 + (np.abs(force[bounds[:-1]]) < quiet)
    lengths = np.diff(bounds)[(np.diff(bounds) >= MIN_LOST) & (jumps >= least)]
    if lengths.size:
        refuse(
            f"{section.name}: {lengths.sum()} samples at the contact are equal, with jumps of "
            f"{limit:.3g} N or more beside them: they are lost",
            "a recording without lost samples; --leave-out (leave_out) with the number of this "
            "drop",
        )
    return ()


def check_noise(section: Section) -> tuple[Note, ...]:
    """Return a warning if the background is constant, at least in part, and the contact noisy.

    Raise InputError if the force is held over first touch or release. 3 ms of the touch change 500
    Hz by 16 dB, a gate of 40 N by 1 dB; a converter without the bit of 32 N changes 250 Hz by 0.4
    dB.
    """
    rate, force, (first, stop) = section.sample_rate, section.force, section.contact
    noise = section.noise
    if noise <= max(section.quantization.step, MIN_NOISE * float(np.ptp(force[first:stop]))):
        return ()
    is_quiet = np.abs(section.roughness) <= MAX_QUIET * noise
    edges = np.flatnonzero(np.diff(is_quiet.astype(int), prepend=0, append=0))
    starts, stops = edges[::2], edges[1::2]
    is_gap = stops - starts > max(MIN_GAP * rate, MIN_GAP_SAMPLES)
    if not is_gap.any():
        return ()
    starts, stops = starts[is_gap], stops[is_gap]
    total = 1e3 * int((stops - starts).sum()) / rate
    outside = 1e3 * (len(force) - (stop - first)) / rate
    if ((stops > first) & (starts < stop)).any() and total < MAX_CONSTANT * outside:
        refuse(
            f"{section.name}: the force is held, clipped or filled by a line for {total:.3g} ms at "
            "the contact while the samples around it are noisy",
            "a recording without lost samples",
        )
    return (Note("constant_background", value=total, unit="ms"),)


def check_slope(section: Section) -> tuple[Note, ...]:
    """Return a warning if the force or its slope jumps within a contact, away from its ends.

    A jump is the distance between the lines through the samples before and after it, at the middle
    or, by their slopes, at their length from it. Packets of 2 ms that are lost or exchanged change
    250 and 500 Hz by 12 dB.
    """
    rate, force = section.sample_rate, section.force[slice(*section.contact)] - section.offset
    peak, count = float(force.max()), max(4, round(JUMP_TIME * rate))
    center = (np.arange(count) - (count - 1) / 2) / count
    slope = center / (center @ center)
    line = 1 / count + slope / 2
    # The jump at an index is between the samples half the kernel behind it.
    flanks = np.flatnonzero(force > FLANK * peak)[[0, -1]] - count
    margin = int(JUMP_MARGIN * rate) + 3 * count
    inside = slice(flanks[0] + margin, max(flanks[1] - margin, flanks[0] + margin))
    least = max(MIN_JUMP * peak, MIN_STEPS * section.quantization.step)
    distance = np.arange(-3 * count, 3 * count + 1)
    for what, before, after, ratio in (
        ("force", line, line[::-1], MIN_RATIO),
        ("slope of the force", slope, slope, MIN_SLOPE_RATIO),
    ):
        jump = np.abs(np.correlate(force, np.concatenate([before, -after]), mode="valid"))
        sides = [
            maximum_filter(jump, footprint=side * distance > count, mode="nearest")
            for side in (-1, 1)
        ]
        limit = ratio * np.maximum(*sides)
        if what == "force":
            limit = np.minimum(limit, MIN_SIDE_RATIO * np.minimum(*sides))
        jumps = jump[inside][jump[inside] > np.maximum(limit, least)[inside]]
        if jumps.size:
            return (Note("jump", value=float(jumps.max()), unit="N", others={"what": what}),)
    return ()


def check_aliasing(section: Section, contact: Contact) -> tuple[Note, ...]:
    """Return a warning if content may alias into the octave of 500 Hz.

    This is content above half the rate, where no filter precedes sampling; from 0.1 dB on, the
    warning states what it adds. The amplitude of a pulse with kinks is assumed to fall as 1/f**2
    there; stated instruments reduce it further.
    """
    rate, bands = contact.sample_rate, get_bands()
    lower, upper = bands.lower[-1], bands.upper[-1]
    # Padded to a length with several frequencies in the octave.
    force = np.pad(contact.gated, (0, int(rate / 20) + 3 * len(contact.gated)))
    frequency = np.fft.rfftfreq(len(force), 1 / rate)
    power = np.abs(np.fft.rfft(force)) ** 2
    noise = contact.background.variances[0] * rate / 2 * len(contact.gated)
    octave_power = power[(frequency > lower) & (frequency < upper)].mean()
    top = max(power[frequency > ALIASED_FRACTION * rate].mean() - 3 * noise, 0.0)
    folded = top * (0.45 * rate / (rate - upper)) ** 4
    if section.chain is not None:
        folded *= abs(section.chain.response(np.array([rate - upper]))[0]) ** 2
    error = 20 * math.log10(1 + math.sqrt(folded / octave_power))
    if error < MAX_ERROR:
        return ()
    return (Note("aliasing", value=error, unit="dB", others={"frequency": rate / 2}),)


def check_cells(section: Section, forces: Sequence[NDArray[np.float64]]) -> list[Note]:
    """Return a warning for each load cell of a section without a force in the contact.

    `forces` are those of the cells, N. Raise InputError if a channel is the sum of the others,
    which would count twice.
    """
    first, stop = section.contact
    levels = [
        force[first:stop] - np.median(np.delete(force, slice(first, stop))) for force in forces
    ]
    total = np.sum(levels, axis=0)
    shares = [float(level.sum() / total.sum()) for level in levels]
    cells = section.cells
    # Two cells may have equal forces, and a cell of the wrong sign, which `orient` names, makes
    # another one the sum of the others.
    if len(cells) > 2 and min(shares) > -MIN_OPPOSITE:  # noqa: PLR2004
        for cell, level in zip(cells, levels, strict=True):
            if np.ptp(total - 2 * level) < MAX_DEVIATION * np.ptp(total - level):
                refuse(
                    f"{cell.name}: is the sum of the other channels, which would count twice",
                    "channels without it, or channel = this one",
                )
    return [
        Note("cell_without_force", value=share, others={"part": cell.name})
        for cell, share in zip(cells, shares, strict=True)
        if abs(share) < MIN_SHARE
    ]
