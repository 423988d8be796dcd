"""Repair of a recorded force: dropouts and spikes are filled, also in each load cell."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter

from thud.base.checks import refuse
from thud.base.note import Note, of_part
from thud.recordings.checks import CHECKS, cells
from thud.recordings.differences import (
    FROM_CUBIC,
    MEDIAN,
    MIN_STEPS,
    largest_beside,
    runs,
)
from thud.recordings.quantization import find_quantization

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.drops import Section

# Minimum length of the background on either side, s and samples.
MIN_BACKGROUND = 1e-3
MIN_SAMPLES = 4
# Minimum number of equal samples of a dropout, and minimum jump into or out of them, as a fraction
# of the peak force: no flank rises as much between two samples at 20 kHz.
MIN_FROZEN = 3
MIN_JUMP = 0.04
# Maximum total length of dropouts and spikes that are repaired, s.
MAX_REPAIRED = 1e-3
# A spike of one or two samples deviates from the cubic through samples 2 and 3 away and from the
# median of MEDIAN samples: at a kink of the force only the cubic deviates, at a smooth maximum only
# the median. It deviates by more than the jump, as of a step, from the line through the samples
# before it to the line through those after it (LINES).
LINES = np.array([2.0, -3.0, 0.0, 0.0, 0.0, 3.0, -2.0])
# The deviations exceed MIN_SPIKE_RATIO times the largest one from the cubic at samples that a spike
# does not change, CLEAN samples away, and MIN_SPIKE times the peak.
MIN_SPIKE_RATIO = 4.0
MIN_SPIKE = 0.005
CLEAN = (5, 12)
# Time before and after the contact that is searched for spikes, s, and time within which they count
# as those of the contact.
SPIKE_MARGIN = 0.12
CONTACT_MARGIN = 3e-3


def repair(section: Section) -> Section:
    """Return a section with its dropouts and spikes filled, in each load cell, and with notes.

    Raise InputError if the pulse is cut off, meets another one or is clipped, has long dropouts or
    spikes, or a load cell is the sum of the others.
    """
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
    section = replace(section, quantization=find_quantization(section))
    peak = float(median_filter(section.force[first:stop], MEDIAN).max())
    peak -= float(np.median(section.background))
    if not section.cells:
        force, notes = _filled(section, peak)
        return replace(section, force=force, notes=(*section.notes, *notes))
    forces, said = [], [*section.notes]
    for cell in section.cells:
        force, notes = _filled(replace(cell, quantization=section.quantization), peak)
        forces.append(force)
        said += of_part(cell.name, notes)
    said += cells.check(section, forces)
    return replace(section, force=np.sum(forces, axis=0), cells=(), notes=tuple(said))


def min_background(rate: float) -> int:
    """Return the minimum number of background samples on each side of a contact."""
    return max(math.ceil(MIN_BACKGROUND * rate), MIN_SAMPLES)


def _filled(section: Section, peak: float) -> tuple[NDArray[np.float64], list[Note]]:
    """Return the force, N, with lines in place of dropouts and spikes, and notes on all faults.

    Jumps are relative to the peak, N. Raise InputError if dropouts and spikes last too long.
    """
    rate, (first, stop), index = section.sample_rate, section.contact, np.arange(len(section.force))
    notes = [note for entry in CHECKS["section"] for note in entry.check(section)]
    dropouts = _find_dropouts(section, peak)
    force = np.interp(index, index[~dropouts], section.force[~dropouts])
    spikes = _find_spikes(section, force, peak)
    repaired = [
        Note(
            code, value=1e3 * np.count_nonzero(bad) / rate, high=1e3 * MAX_REPAIRED, unit="ms",
            others={"count": len(np.flatnonzero(np.diff(bad, prepend=False)[bad]))},
        )
        for code, bad in (("dropouts", dropouts), ("spikes", spikes))
        if bad.any()
    ]  # fmt: skip
    bad, margin = dropouts | spikes, int(CONTACT_MARGIN * rate)
    if np.count_nonzero(bad[max(first - margin, 0) : stop + margin]) > MAX_REPAIRED * rate:
        summaries = [f"{n.others['count']} {n.code} of {n.value:.3g} ms in all" for n in repaired]
        refuse(
            f"{section.name}: the record has {' and '.join(summaries)}",
            f"up to {1e3 * MAX_REPAIRED:g} ms",
        )
    return np.interp(index, index[~bad], section.force[~bad]), notes + repaired


def _find_dropouts(section: Section, peak: float) -> NDArray[np.bool_]:
    """Return whether samples are lost: equal, with jumps before and after them.

    One jump is enough but next to the background, which may be constant beside a steep flank.
    """
    lost = np.zeros(len(section.force), dtype=bool)
    margin = int(MIN_BACKGROUND * section.sample_rate)
    inside = slice(section.contact[0] + margin, section.contact[1] - margin)
    pulse = section.force[inside] - np.median(section.background)
    starts, lengths = runs(pulse)
    limit = max(MIN_JUMP * peak, MIN_STEPS * section.quantization.step)
    jumps = np.append(np.abs(np.diff(pulse, prepend=pulse[:1]))[starts] > limit, [False])
    least = 1 + (np.abs(pulse[starts]) < limit / 2)
    is_lost = (lengths >= MIN_FROZEN) & (jumps[:-1].astype(int) + jumps[1:] >= least)
    lost[inside] = np.repeat(is_lost, lengths)
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
    least = max(MIN_SPIKE * peak, MIN_STEPS * section.quantization.step)
    limit = np.maximum(MIN_SPIKE_RATIO * largest_beside(from_cubic, *CLEAN).max(axis=0), least)
    spikes[searched] = (np.minimum(from_cubic, from_median) > limit) & (jump < from_cubic)
    return spikes
