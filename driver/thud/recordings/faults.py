"""Faults of a pulse: clipped, cut off or doubled; dropouts and spikes, which are repaired."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import median_filter, uniform_filter1d

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.load_cells import check_cells
from thud.recordings.quantization import find_quantization

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.contact import Contact
    from thud.recordings.drops import Section

# Minimum length of the background on either side, s and samples.
MIN_BACKGROUND = 1e-3
MIN_SAMPLES = 4
# The top is clipped if this many samples are equal, and the force half as many samples farther out
# is lower by more than MIN_FALL quantization steps. At a smooth top it is lower by 4.
MIN_CLIPPED = 4
MIN_FALL = 12.0
# It is no clipping if samples are equal elsewhere for 1/MAX_ELSEWHERE of the time.
MAX_ELSEWHERE = 2
# The force, averaged over SMOOTHING, s, is flat at its top if it is above (1 - a) of its maximum
# almost as long as above (1 - 4 a). The ratio of the times is 1 for a top that an amplifier clips,
# 1.41 and at least 1.22 for tops of fourth order with one and two maxima, and 2 for parabolas.
# The fractions a are the lowest one, MIN_FLAT standard deviations of the noise or quantization
# steps, times powers of 2 up to MAX_FLAT. The top must be flat for MIN_TOP, s.
SMOOTHING = 3e-4
MAX_RATIO = 1.15
MIN_FLAT = 4.0
MAX_FLAT = 0.02
MIN_TOP = 5e-4
# Minimum noise as a fraction of the peak: smaller steps of quantization are not known.
MIN_NOISE = 4e-5
# Fraction of full scale from which a sample is clipped.
CLIPPED_FRACTION = 0.999
# Minimum jump into or out of the equal samples of a dropout, as a fraction of the peak force: no
# flank rises as much between two samples at 20 kHz.
MIN_JUMP = 0.04
# Minimum jump in quantization steps.
MIN_STEPS = 3.5
# Minimum number of equal samples of a dropout.
MIN_FROZEN = 3
# Maximum total length of dropouts and spikes that are repaired, s.
MAX_REPAIRED = 1e-3
# A spike of one or two samples deviates from the cubic through samples 2 and 3 away (by the
# weighted sum DIFFERENCE) and from the median of MEDIAN samples: at a kink of the force only the
# cubic deviates, at a smooth maximum only the median. It deviates by more than the jump, as of a
# step, from the line through the samples before it to the line through those after it (LINES).
MEDIAN = 5
DIFFERENCE = np.array([0.4, -0.9, 0.0, 1.0, 0.0, -0.9, 0.4])
LINES = np.array([2.0, -3.0, 0.0, 0.0, 0.0, 3.0, -2.0])
# The deviations exceed MIN_SPIKE_RATIO times the largest one from the cubic at samples that a spike
# does not change, CLEAN samples away; MIN_SPIKE_DEVIATIONS robust standard deviations of all of
# them; and MIN_SPIKE times the peak.
MIN_SPIKE_RATIO = 4.0
MIN_SPIKE_DEVIATIONS = 8.0
MIN_SPIKE = 0.005
CLEAN = (5, 12)
# Time before and after the contact that is searched for spikes, s, and time within which they count
# as those of the contact.
SPIKE_MARGIN = 0.12
CONTACT_MARGIN = 3e-3
# Minimum number of different values of a contact over the period of a bit that may be missing.
MIN_VISITS = 4
# Samples are held, filled or gated if they deviate from a cubic for MIN_BACKGROUND by less than
# this fraction of the noise; one of 10 000 does so by chance.
MAX_QUIET = 1e-4
# Fraction of the background outside the contact from which constant samples are a gate, not a loss.
MAX_CONSTANT = 0.5
# Value and slope are compared between the lines through the samples of this time, s, or four at
# least, on either side. Its curvature changes the slope of a force of 600 Hz by less than that of
# a kink, which is a jump by MIN_JUMP_RATIO times the largest change around it. First touch and
# release, where forces have kinks and jumps, are at least JUMP_MARGIN, s, away.
JUMP_TIME = 2.5e-4
JUMP_MARGIN = 5e-4
MIN_JUMP_RATIO = 3.0
# The same for the quieter side alone, of values: packets that change places jump three times, and
# hide each other on the sides between them. The slope may change on one side only.
MIN_SIDE_RATIO = 6.0


def repair(section: Section) -> Section:
    """Return a section with its dropouts and spikes filled, in each load cell, and with notes.

    Raise InputError if the pulse is cut off, clipped or doubled, has long dropouts or spikes, or a
    load cell is the sum of the others.
    """
    rate, (first, stop), name = section.sample_rate, section.contact, section.name
    minimum = min_background(rate)
    if first < minimum or len(section.force) - stop < minimum:
        side = "starts" if first < minimum else "ends"
        refuse(
            f"{name}: the signal {side} within the pulse or less than 1 ms "
            f"{'before' if first < minimum else 'after'} it",
            "background of 1 ms or more, better 100 ms, before and after the contact",
        )
    if second := section.second_peak:
        refuse(
            f"{name}: two impacts overlap: a second peak of {second.peak:.0f} N rises from "
            f"{second.valley:.0f} N; the force does not return to the background between them, at "
            f"{second.time:.2f} s",
            "one impact, with background before and after it; --leave-out (leave_out) with the "
            "number of this drop, or --from and --to (begin, end) without it",
        )
    section = replace(section, quantization=find_quantization(section))
    if section.cells:
        section = _repair_cells(section)
    refuse_clipped(section)
    _refuse_missing_codes(section)
    force, notes = fill_dropouts(section)
    return replace(section, force=force, notes=(*section.notes, *notes))


def _repair_cells(section: Section) -> Section:
    """Return the sum of load cells whose dropouts and spikes are filled."""
    peak = float(np.ptp(section.force[slice(*section.contact)]))
    forces, notes = [], [*section.notes]
    for cell in section.cells:
        refuse_clipped(cell)
        force, faults = fill_dropouts(replace(cell, quantization=section.quantization), peak)
        forces.append(force)
        notes += (replace(note, others={**note.others, "cell": cell.name}) for note in faults)
    notes += check_cells(section, forces)
    return replace(section, force=np.sum(forces, axis=0), cells=(), notes=tuple(notes))


def min_background(rate: float) -> int:
    """Return the minimum number of background samples on each side of a contact."""
    return max(math.ceil(MIN_BACKGROUND * rate), MIN_SAMPLES)


def _runs(force: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return first index and length of each run of equal values."""
    starts = np.flatnonzero(np.diff(force, prepend=np.nan) != 0)
    return starts, np.diff(np.append(starts, len(force)))


def refuse_clipped(section: Section) -> None:
    """Raise InputError if the top of a recorded force, N, is clipped."""
    first, stop = section.contact
    force = section.force[first:stop]
    starts, lengths = _runs(force)
    top = force.max()
    at_top = force[starts] == top
    k = int(np.argmax(np.where(at_top, lengths, 0)))
    start, length = int(starts[k]), int(lengths[k])
    changes = np.abs(np.diff(force))
    step = changes[changes > 0].min(initial=np.inf)
    distance = max(length // 2, 1)
    neighbors = [
        force[max(start - distance, 0)],
        force[min(start + length - 1 + distance, len(force) - 1)],
    ]
    # Samples that are held, or the median of several, are equal elsewhere, too.
    quiet = section.force[: max(first // 2, 1)]
    is_noisy = float(np.ptp(quiet)) > MIN_FALL * step
    beside = ~at_top & (force[starts] > (top + force.min()) / 2)
    elsewhere = max(lengths[beside].max(initial=0), _runs(quiet)[1].max() if is_noisy else 0)
    falls = top - max(neighbors) > MIN_FALL * step
    clipped = length >= MIN_CLIPPED and falls and length > MAX_ELSEWHERE * elsewhere
    if section.full_scale is not None:
        at_scale = np.count_nonzero(force >= CLIPPED_FRACTION * section.full_scale)
        clipped, length = clipped or at_scale > 1, max(length, int(at_scale))
    if clipped:
        refuse(
            f"{section.name}: the force is clipped at {top:.4g} N for "
            f"{1e3 * length / section.sample_rate:.3g} ms",
            "a measuring range that includes the peak",
        )


def _refuse_missing_codes(section: Section) -> None:
    """Raise InputError if half of the values of a converter never occur in the contact.

    These are the values in which a bit is set, or not set, of all within its period. A smooth force
    may well leave out values.
    """
    step, force = section.quantization.step, section.force[slice(*section.contact)]
    if not step or _deviation(force) < step:
        return
    codes = np.unique(np.rint((force - force.min()) / step).astype(np.int64))
    period = 4
    while MIN_VISITS * period < len(codes):
        occupied = len(np.unique(codes % period))
        if occupied <= period // 2:
            refuse(
                f"{section.name}: of {period} successive values of the converter, {step:.3g} N "
                f"apart, {period - occupied} never occur",
                "a converter without missing codes",
            )
        period *= 2


def fill_dropouts(
    section: Section, peak: float | None = None
) -> tuple[NDArray[np.float64], tuple[Note, ...]]:
    """Return the force with dropouts and spikes interpolated, and notes, on a flat top too.

    A jump of a dropout is relative to the peak, N: that of the force, if None. Raise InputError if
    dropouts and spikes last too long.
    """
    rate, force = section.sample_rate, section.force
    offset = float(np.median(section.background))
    if peak is None:
        contact = force[slice(*section.contact)]
        peak = float(median_filter(contact, MEDIAN).max()) - offset
    dropouts = _find_dropouts(section, force, offset, peak)
    filled = _interpolated(force, dropouts)
    spikes = _find_spikes(section, filled, peak)
    filled = _interpolated(filled, dropouts | spikes)
    notes = [
        Note(
            code, value=1e3 * np.count_nonzero(bad) / rate, high=1e3 * MAX_REPAIRED, unit="ms",
            others={"count": len(np.flatnonzero(np.diff(bad, prepend=False)[bad]))},
        )
        for code, bad in (("dropouts", dropouts), ("spikes", spikes))
        if bad.any()
    ]  # fmt: skip
    margin = int(CONTACT_MARGIN * rate)
    near = slice(max(section.contact[0] - margin, 0), section.contact[1] + margin)
    if np.count_nonzero((dropouts | spikes)[near]) > MAX_REPAIRED * rate:
        group = int(np.median(_runs(force[slice(*section.contact)])[1]))
        if group >= MIN_FROZEN:
            refuse(
                f"{section.name}: {group} samples each are equal: the record was drawn up from "
                f"{rate / group:g} Hz",
                f"each sample once, at {rate / group:g} Hz",
            )
        summaries = [f"{n.others['count']} {n.code} of {n.value:.3g} ms in all" for n in notes]
        refuse(
            f"{section.name}: the record has {' and '.join(summaries)}",
            f"up to {1e3 * MAX_REPAIRED:g} ms",
        )
    top = _check_top(section, filled[slice(*section.contact)] - offset)
    return filled, (*notes, *check_constant(section), *top)


def check_constant(section: Section) -> tuple[Note, ...]:
    """Return a warning if the background is constant, at least in part, and the contact noisy.

    Raise InputError if the force is held over first touch or release.
    """
    rate, force, (first, stop) = section.sample_rate, section.force, section.contact
    contact, step = force[first:stop], section.quantization.step
    noise = _deviation(contact)
    if not noise > max(step, MIN_NOISE * float(np.ptp(contact))):
        return ()
    is_noisy = np.abs(np.convolve(force, DIFFERENCE, mode="same")) > MAX_QUIET * noise
    starts, lengths = _runs(is_noisy.astype(float))
    constant = ~is_noisy[starts] & (lengths > max(MIN_BACKGROUND * rate, len(DIFFERENCE)))
    if not constant.any():
        return ()
    starts, stops = starts[constant], (starts + lengths)[constant]
    total = 1e3 * int((stops - starts).sum()) / rate
    inside = (stops > first) & (starts < stop)
    outside = len(force) - (stop - first)
    if inside.any() and total < MAX_CONSTANT * 1e3 * outside / rate:
        refuse(
            f"{section.name}: the force is held, or filled by a line, for {total:.3g} ms at the "
            "contact while the samples around it are noisy",
            "a recording without lost samples",
        )
    return (Note("constant_background", value=total, unit="ms"),)


def check_jumps(contact: Contact) -> tuple[Note, ...]:
    """Return a warning if the force or its slope jumps within a contact, away from its ends.

    A jump is the distance between the lines through the samples before and after it, at the middle
    or, by their slopes, at their length from it.
    """
    rate, force = contact.sample_rate, contact.gated
    count = max(4, round(JUMP_TIME * rate))
    center = (np.arange(count) - (count - 1) / 2) / count
    slope = center / (center @ center)
    line = 1 / count + slope / 2
    # The jump at an index is between the samples half the kernel behind it.
    margin = JUMP_MARGIN * rate + 3 * count
    start = contact.gate[0] + count
    first = max(int(contact.touch.value * rate + margin) - start, 0)
    stop = int(contact.release.value * rate - margin) - start
    least = max(MIN_SPIKE * contact.peak, MIN_STEPS * contact.background.quantization.step)
    for what, before, after in (
        ("force", line, line[::-1]), ("slope of the force", slope, slope),
    ):  # fmt: skip
        jump = np.abs(np.correlate(force, np.concatenate([before, -after]), mode="valid"))
        sides = _largest_beside(jump, count + 1, 3 * count)
        limit = MIN_JUMP_RATIO * sides.max(axis=0)
        if what == "force":
            limit = np.minimum(limit, MIN_SIDE_RATIO * sides.min(axis=0))
        limit = np.maximum(limit, least)
        found = (jump > limit)[first : max(stop, first)]
        if found.any():
            size = float(jump[first:stop][found].max())
            return (Note("jump", value=size, unit="N", others={"what": what}),)
    return ()


def _check_top(section: Section, force: NDArray[np.float64]) -> tuple[Note, ...]:
    """Return a warning if the top of a force without offset, N, is flat."""
    rate = section.sample_rate
    width = max(1, round(SMOOTHING * rate))
    if len(force) < 2 * width + len(DIFFERENCE):
        return ()
    smooth = uniform_filter1d(force, width)
    peak = smooth.max()
    noise, step = _deviation(force), section.quantization.step
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
    return float(np.clip(high / np.maximum(high - low, 1e-300), 0, 1).sum())


def _deviation(force: NDArray[np.float64]) -> float:
    """Return the standard deviation of the white noise of a force, N, by its median."""
    deviation = np.convolve(force, DIFFERENCE, mode="valid")
    return 1.4826 * float(np.median(np.abs(deviation))) / math.sqrt(float(DIFFERENCE @ DIFFERENCE))


def _largest_beside(values: NDArray[np.float64], near: int, far: int) -> NDArray[np.float64]:
    """Return the largest of the values from near to far samples before and after, [2, n]."""
    extended = np.pad(values, far, mode="edge")
    largest = sliding_window_view(extended, far - near + 1).max(axis=1)
    return np.stack([largest[: len(values)], largest[-len(values) :]])


def _interpolated(force: NDArray[np.float64], bad: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return a force, N, with a line in place of bad samples."""
    result = force.copy()
    good = np.flatnonzero(~bad)
    result[bad] = np.interp(np.flatnonzero(bad), good, force[good])
    return result


def _find_dropouts(
    section: Section, force: NDArray[np.float64], offset: float, peak: float
) -> NDArray[np.bool_]:
    """Return whether samples of a force, N, are lost: held, or zero between jumps."""
    lost = np.zeros(len(force), dtype=bool)
    margin = int(MIN_BACKGROUND * section.sample_rate)
    first, stop = section.contact[0] + margin, section.contact[1] - margin
    pulse = force[first:stop] - offset
    if not pulse.size:
        return lost
    starts, lengths = _runs(pulse)
    before = np.abs(pulse[starts] - pulse[np.maximum(starts - 1, 0)])
    ends = starts + lengths - 1
    after = np.abs(pulse[np.minimum(ends + 1, len(pulse) - 1)] - pulse[ends])
    limit = max(MIN_JUMP * peak, MIN_STEPS * section.quantization.step)
    zero = (force[first:stop][starts] == 0) & (before > limit) & (after > limit)
    # A constant background next to a steep flank is no dropout: it has one jump.
    is_background = np.abs(pulse[starts]) < limit / 2
    jumps = (before > limit).astype(int) + (after > limit)
    frozen = (lengths >= MIN_FROZEN) & (jumps > is_background)
    lost[first:stop] = np.repeat(zero | frozen, lengths)
    return lost


def _find_spikes(section: Section, force: NDArray[np.float64], peak: float) -> NDArray[np.bool_]:
    """Return whether samples of a force, N, stand out alone or in pairs."""
    spikes = np.zeros(len(force), dtype=bool)
    margin = int(SPIKE_MARGIN * section.sample_rate)
    searched = slice(max(section.contact[0] - margin, 0), section.contact[1] + margin)
    part = force[searched]
    padded = np.pad(part, 3, mode="edge")
    from_cubic = np.abs(np.convolve(padded, DIFFERENCE, mode="valid"))
    from_median = np.abs(part - median_filter(part, MEDIAN, mode="nearest"))
    jump = np.abs(np.convolve(padded, LINES, mode="valid"))
    usual = 1.4826 * float(np.median(from_cubic))
    least = max(
        MIN_SPIKE_DEVIATIONS * usual, MIN_SPIKE * peak, MIN_STEPS * section.quantization.step
    )
    limit = np.maximum(MIN_SPIKE_RATIO * _largest_beside(from_cubic, *CLEAN).max(axis=0), least)
    spikes[searched] = (np.minimum(from_cubic, from_median) > limit) & (jump < from_cubic)
    return spikes
