"""Repair of a recorded force: dropouts and spikes are filled, also in each load cell."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.checks import check_section
from thud.recordings.differences import (
    FROM_CUBIC,
    MEDIAN,
    MIN_STEPS,
    largest_beside,
    robust_deviation,
    runs,
)
from thud.recordings.load_cells import check_cells
from thud.recordings.quantization import find_quantization

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.drops import Section

# Minimum length of the background on either side, s and samples.
MIN_BACKGROUND = 1e-3
MIN_SAMPLES = 4
# Minimum jump into or out of the equal samples of a dropout, as a fraction of the peak force: no
# flank rises as much between two samples at 20 kHz.
MIN_JUMP = 0.04
# Minimum number of equal samples of a dropout.
MIN_FROZEN = 3
# Maximum total length of dropouts and spikes that are repaired, s.
MAX_REPAIRED = 1e-3
# A spike of one or two samples deviates from the cubic through samples 2 and 3 away and from the
# median of MEDIAN samples: at a kink of the force only the cubic deviates, at a smooth maximum only
# the median. It deviates by more than the jump, as of a step, from the line through the samples
# before it to the line through those after it (LINES).
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


def repair(section: Section) -> Section:
    """Return a section with its dropouts and spikes filled, in each load cell, and with notes.

    Raise InputError if the pulse is cut off, clipped or doubled, has long dropouts or spikes, or a
    load cell is the sum of the others.
    """
    _refuse_incomplete(section)
    section = replace(section, quantization=find_quantization(section))
    if section.cells:
        section = _repair_cells(section)
    return _fill(replace(section, notes=(*section.notes, *check_section(section))))


def min_background(rate: float) -> int:
    """Return the minimum number of background samples on each side of a contact."""
    return max(math.ceil(MIN_BACKGROUND * rate), MIN_SAMPLES)


def _refuse_incomplete(section: Section) -> None:
    """Raise InputError if the pulse is cut off or meets another one."""
    rate, (first, stop) = section.sample_rate, section.contact
    lengths = first, len(section.force) - stop
    for length, edge, side in zip(lengths, ("begins", "ends"), ("before", "after"), strict=True):
        if length < min_background(rate):
            refuse(
                f"{section.name}: {1e3 * length / rate:.2g} ms of background {side} the pulse at "
                f"{(section.start + first) / rate:.2f} s: the signal {edge} within the pulse or "
                "less than 1 ms from it, or two impacts overlap",
                "1 ms or more, better 100 ms, on both sides of one impact; --leave-out (leave_out) "
                "with the number of this drop, or --from and --to (begin, end), without it",
            )


def _repair_cells(section: Section) -> Section:
    """Return the sum of load cells whose dropouts and spikes are filled."""
    peak = float(np.ptp(section.force[slice(*section.contact)]))
    forces, notes = [], [*section.notes]
    for cell in section.cells:
        recorded = replace(cell, quantization=section.quantization)
        filled = _fill(replace(recorded, notes=check_section(recorded)), peak)
        forces.append(filled.force)
        notes += (replace(note, others={**note.others, "part": cell.name}) for note in filled.notes)
    notes += check_cells(section, forces)
    return replace(section, force=np.sum(forces, axis=0), cells=(), notes=tuple(notes))


def _fill(section: Section, peak: float | None = None) -> Section:
    """Return a section with dropouts and spikes interpolated, and notes on them.

    A jump of a dropout is relative to the peak, N: that of the force, if None. Raise InputError if
    dropouts and spikes last too long.
    """
    rate, force, contact = section.sample_rate, section.force, slice(*section.contact)
    offset = float(np.median(section.background))
    if peak is None:
        peak = float(median_filter(force[contact], MEDIAN).max()) - offset
    dropouts = _find_dropouts(section, force, offset, peak)
    spikes = _find_spikes(section, _interpolated(force, dropouts), peak)
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
        group = int(np.median(runs(force[contact])[1]))
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
    filled = _interpolated(force, dropouts | spikes)
    return replace(section, force=filled, notes=(*section.notes, *notes))


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
    starts, lengths = runs(pulse)
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
    from_cubic = np.abs(np.convolve(padded, FROM_CUBIC, mode="valid"))
    from_median = np.abs(part - median_filter(part, MEDIAN, mode="nearest"))
    jump = np.abs(np.convolve(padded, LINES, mode="valid"))
    usual = robust_deviation(from_cubic)
    least = max(
        MIN_SPIKE_DEVIATIONS * usual, MIN_SPIKE * peak, MIN_STEPS * section.quantization.step
    )
    limit = np.maximum(MIN_SPIKE_RATIO * largest_beside(from_cubic, *CLEAN).max(axis=0), least)
    spikes[searched] = (np.minimum(from_cubic, from_median) > limit) & (jump < from_cubic)
    return spikes
