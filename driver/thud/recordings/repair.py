"""Repair of a recorded force: spikes are filled, also in each load cell."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import maximum_filter, median_filter

from thud.base.checks import refuse
from thud.base.note import Note, of_part
from thud.recordings.checks import CELL_CHECKS, SECTION_CHECKS, cells
from thud.recordings.quantization import find_quantization

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.drops import Section

# A spike of one or two samples deviates from the cubic through samples 2 and 3 away and from the
# median of MEDIAN samples: at a kink of the force only the cubic deviates, at a smooth maximum only
# the median. It deviates by more than the jump, as of a step, from the line through the samples
# before it to the line through those after it (LINES).
MEDIAN = 5
LINES = np.array([2.0, -3.0, 0.0, 0.0, 0.0, 3.0, -2.0])
# The deviations exceed MIN_RATIO times the largest one from the cubic at samples that a spike does
# not change, CLEAN samples away, and MIN_SPIKE times the peak and MIN_STEPS quantization steps.
MIN_RATIO = 4.0
CLEAN = np.abs(np.arange(-12, 13)) > 4  # noqa: PLR2004
MIN_SPIKE = 0.005
MIN_STEPS = 3.5


def repair(section: Section) -> Section:
    """Return a section with its spikes filled by lines, in each load cell, and with notes.

    Raise InputError if the pulse is cut off, meets another one or is clipped, if samples are lost,
    or if a load cell is the sum of the others.
    """
    rate, (first, stop) = section.sample_rate, section.contact
    if not section.has_background:
        after = len(section.force) - stop
        length, edge, side = min((first, "begins", "before"), (after, "ends", "after"))
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
        is_spike = _find_spikes(cell, limit)
        forces.append(np.interp(index, index[~is_spike], cell.force[~is_spike]))
        filled = replace(cell, force=forces[-1], quantization=section.quantization)
        said = [note for check in CELL_CHECKS for note in check(filled)]
        if is_spike.any():
            duration = 1e3 * float(is_spike.sum()) / rate
            count = int(np.diff(is_spike, prepend=False)[is_spike].sum())
            said.append(Note("spikes", value=duration, unit="ms", others={"count": count}))
        notes += of_part(cell.name, said) if section.cells else said
    if section.cells:
        notes += cells.check(section, forces)
    repaired = replace(section, force=np.sum(forces, axis=0), cells=())
    notes += (note for check in SECTION_CHECKS for note in check(repaired))
    return replace(repaired, notes=tuple(notes))


def _find_spikes(section: Section, limit: float) -> NDArray[np.bool_]:
    """Return whether samples stand out alone or in pairs, by more than a limit, N."""
    force, from_cubic = section.force, np.abs(section.roughness)
    from_median = np.abs(force - median_filter(force, MEDIAN, mode="nearest"))
    jump = np.abs(np.convolve(np.pad(force, 3, mode="edge"), LINES, mode="valid"))
    clean = MIN_RATIO * maximum_filter(from_cubic, footprint=CLEAN, mode="nearest")
    is_out = np.minimum(from_cubic, from_median) > np.maximum(clean, limit)
    return np.asarray(is_out & (jump < from_cubic))
