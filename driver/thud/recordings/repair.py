"""Faults of a recorded force: spikes are filled, what cannot be repaired is refused or noted.

Each check states what it protects from, and how far levels are off without it: those of a half-sine
of 1500 N and 20 ms. `repair` calls those of the force, and `measure_drop` `check_aliasing`, after
the removal of the background. Checks of more or less than a drop are called where that is read or
averaged: `thud.recordings.signal.orient` of a signal (kN in place of N: 60 dB), `copies.check`
and `outliers.check` of several drops, and `plate.check_plate` (a resonance of 1.6 kHz that is not
corrected: 1.9 dB at 708 Hz). Errors by quantization: docs/recordings_theory.md, section 2.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import maximum_filter, median_filter, uniform_filter1d
from scipy.signal import peak_widths

from thud.base.checks import refuse
from thud.base.note import Note, of_part
from thud.level.levels import get_bands
from thud.recordings.drops import (
    BACKGROUND_MARGIN,
    MAX_BACKGROUND,
    MIN_BACKGROUND,
    MIN_SAMPLES,
    Quantization,
)
from thud.recordings.signal import MIN_OPPOSITE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.recordings.contact import Contact
    from thud.recordings.drops import Section

# A spike of one or two samples deviates from the cubic through samples 2 and 3 away and from the
# median of MEDIAN samples: at a kink of the force only the cubic deviates, at a smooth maximum only
# the median. It deviates by more than the jump, as of a step, from the line through the samples
# before it to the line through those after it (LINES).
MEDIAN = 5
LINES = np.array([2.0, -3.0, 0.0, 0.0, 0.0, 3.0, -2.0])
# The deviations exceed MIN_RATIO times the largest one from the cubic at samples that a spike does
# not change, CLEAN samples away, and MIN_SPIKE times the peak and MIN_STEPS quantization steps,
# as do jumps.
MIN_RATIO = 4.0
CLEAN = np.abs(np.arange(-12, 13)) > 4  # noqa: PLR2004
MIN_SPIKE = 0.005
MIN_STEPS = 3.5
# Minimum step as a fraction of the maximum force: smaller ones are rounding of floats, or harmless.
MIN_STEP_SIZE = 1e-5
# Differences of up to MAX_MULTIPLE steps are multiples of the step within TOLERANCE steps. There
# are at least MIN_GAPS of them, at least the fraction MIN_FRACTION of them multiples.
MAX_MULTIPLE = 20
TOLERANCE = 0.1
MIN_GAPS = 4
MIN_FRACTION = 0.9
# Fraction of the samples in two neighboring codes from which the noise is less than a step.
TWO_CODES = 0.999
# Noise from sample to sample, in steps, above which it averages the steps: of the error of a
# constant background 0.7 % are left.
MAX_NOISE = 0.5
# The force, averaged over SMOOTHING, s, is flat at its top if it is above (1 - a) of its maximum
# almost as long as above (1 - 4 a). The ratio of the times is 1 for a top that is cut off, 1.41 and
# at least 1.22 for tops of fourth order with one and two maxima, and 2 for parabolas. The fractions
# a are the lowest one, MIN_FLAT standard deviations of the noise or quantization steps, and at
# least MIN_DEPTH each, times powers of 2 up to MAX_FLAT. A half-sine of 20 ms that is flat for
# less than MIN_TOP, s, has levels that are less than 0.01 dB off.
SMOOTHING = 3e-4
MAX_WIDTH_RATIO = 1.15
MIN_FLAT = 4.0
MIN_DEPTH = 4e-5
MAX_FLAT = 0.02
MIN_TOP = 5e-4
# Fraction of full scale from which a sample is clipped.
CLIPPED_FRACTION = 0.999
# Minimum number of equal samples that are lost, and minimum jump into or out of them, as a fraction
# of the peak: no flank rises as much between two samples at 20 kHz. It is at least MIN_SCORE
# standard deviations of the noise, which may repeat coarse codes.
MIN_LOST = 3
MIN_LOSS = 0.04
MIN_SCORE = 8.0
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
# a kink, which is a jump by MIN_JUMP_RATIO or MIN_SLOPE_RATIO times the largest change around it.
# First touch and release, where forces have kinks and jumps up to FLANK of the peak and more, are
# at least JUMP_MARGIN, s, away.
JUMP_TIME = 2.5e-4
FLANK = 0.1
JUMP_MARGIN = 5e-4
MIN_JUMP_RATIO = 3.0
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


def repair(section: Section) -> Section:
    """Return a section with its spikes filled by lines, in each load cell, and with notes.

    Raise InputError if the pulse is cut off, meets another one or is clipped, if samples are lost,
    or if a load cell is the sum of the others.
    """
    rate, (first, stop) = section.sample_rate, section.contact
    after = len(section.force) - stop
    length, edge, side = min((first, "begins", "before"), (after, "ends", "after"))
    if length < max(MIN_BACKGROUND * rate, MIN_SAMPLES):
        refuse(
            f"{section.name}: {1e3 * length / rate:.2g} ms of background {side} the pulse at "
            f"{(section.start + first) / rate:.2f} s: the signal {edge} within the pulse or "
            "less than 1 ms from it, or two impacts overlap",
            "1 ms or more, better 100 ms, on both sides of one impact; --leave-out (leave_out) "
            "with the number of this drop, or --from and --to (begin, end), without it",
        )
    section = replace(section, quantization=find_quantization(section))
    peak = float(median_filter(section.force[first:stop], MEDIAN).max()) - section.offset
    limit = max(MIN_SPIKE * peak, MIN_STEPS * section.quantization.step)
    notes, forces, index = [*section.notes], [], np.arange(len(section.force))
    for cell in section.cells or (section,):
        # Spikes stand out alone or in pairs, by more than the limit.
        force, from_cubic = cell.force, np.abs(cell.roughness)
        from_median = np.abs(force - median_filter(force, MEDIAN, mode="nearest"))
        jump = np.abs(np.convolve(np.pad(force, 3, mode="edge"), LINES, mode="valid"))
        clean = MIN_RATIO * maximum_filter(from_cubic, footprint=CLEAN, mode="nearest")
        is_spike = np.minimum(from_cubic, from_median) > np.maximum(clean, limit)
        is_spike &= jump < from_cubic
        forces.append(np.interp(index, index[~is_spike], cell.force[~is_spike]))
        filled = replace(cell, force=forces[-1], quantization=section.quantization)
        said = [*check_clipping(filled), *check_lost(filled), *check_noise(filled)]
        if is_spike.any():
            duration = 1e3 * float(is_spike.sum()) / rate
            count = int(np.diff(is_spike, prepend=False)[is_spike].sum())
            said.append(Note("spikes", value=duration, unit="ms", others={"count": count}))
        notes += of_part(cell.name, said) if section.cells else said
    if section.cells:
        notes += check_cells(section, forces)
    repaired = replace(section, force=np.sum(forces, axis=0), cells=())
    return replace(repaired, notes=(*notes, *check_slope(repaired)))


def find_quantization(section: Section) -> Quantization:
    """Return the errors due to quantization of a recorded drop; of load cells, their sum."""
    if section.cells:
        cells = [find_quantization(cell) for cell in section.cells]
        return Quantization(
            max(cell.step for cell in cells),
            sum(cell.density for cell in cells),
            math.hypot(*(cell.offset for cell in cells)),
        )
    force, rate, (first, stop) = section.force, section.sample_rate, section.contact
    length, margin = int(MAX_BACKGROUND * rate), int(BACKGROUND_MARGIN * rate)
    before = force[max(first - length, 0) : max(first - margin, 1)]
    after = force[min(stop + margin, len(force) - 1) : stop + length]
    background = np.concatenate([before, after])
    # The step is the smallest difference between distinct values, if others are its multiples.
    values = np.concatenate([background, force[first:stop]])
    least = MIN_STEP_SIZE * float(np.abs(values).max())
    gaps = np.diff(np.unique(values))
    gaps = gaps[gaps > least / 10]
    step = float(gaps.min(initial=math.inf))
    multiples = gaps[gaps < MAX_MULTIPLE * step] / step
    is_near = np.abs(multiples - np.rint(multiples)) < TOLERANCE
    if step <= least or len(is_near) < MIN_GAPS or is_near.mean() < MIN_FRACTION:
        step = 0.0
    offset = _offset_deviation(background, step) if step else 0.0
    if not offset:
        return Quantization(step)
    # The error is white, unless the force stays within a step for several samples: near the peak
    # of a half sine its sawtooth has q**3 T zeta(3) / pi**4 / P on either side.
    contact = force[first:stop]
    peak = max(float(contact.max() - np.median(background)), step)
    slow = 2 * 0.01234 * step**3 * len(contact) / rate / peak
    return Quantization(step, max(step**2 / 6 / rate, slow), offset)


def _offset_deviation(background: NDArray[np.float64], step: float) -> float:
    """Return the standard deviation of the error of the mean of a background, N.

    In two neighboring codes, of which the rarer one has the fraction p, the true mean is up to 1/2
    - p steps from the recorded one. Noise of s steps from sample to sample lowers step / sqrt(12),
    the error of a constant, by exp(-2 pi**2 s**2), the first harmonic of the error over the steps;
    hum and drift lower it by the root of the number of steps over which they change the background.
    """
    steps = np.rint((background - background[0]) / step)
    fractions = np.bincount((steps - steps.min()).astype(int), minlength=2) / len(steps)
    pairs = fractions[:-1] + fractions[1:]
    first = int(np.argmax(pairs))
    if pairs[first] > TWO_CODES:
        larger = float(fractions[first : first + 2].max())
        return step * max(larger - 0.5, 0.0) / math.sqrt(3)
    noise = max(float(np.mean(np.diff(steps) ** 2)) / 2 - 1 / 12, 0.0)
    if noise > MAX_NOISE**2:
        return 0.0
    span = 1 + math.sqrt(8) * float(steps.std())
    return step * math.exp(-2 * np.pi**2 * noise) / math.sqrt(12 * span)


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
    least = max(noise / math.sqrt(width), step if noise < step / 2 else 0.0, MIN_DEPTH * peak)
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
        ("force", line, line[::-1], MIN_JUMP_RATIO),
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
