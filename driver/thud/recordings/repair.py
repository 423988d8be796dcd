"""Repair of a recorded force: spikes are filled, also in each load cell; errors by quantization.

Derivation of the latter: docs/recordings_theory.md, section 2.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import maximum_filter, median_filter

from thud.base.checks import refuse
from thud.base.note import Note, of_part
from thud.recordings.checks import CELL_CHECKS, SECTION_CHECKS
from thud.recordings.checks.force import check_cells
from thud.recordings.drops import BACKGROUND_MARGIN, MAX_BACKGROUND, Quantization

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
        notes += check_cells(section, forces)
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
    step = _find_step(np.concatenate([background, force[first:stop]]))
    offset = _offset_deviation(background, step) if step else 0.0
    if not offset:
        return Quantization(step)
    # The error is white, unless the force stays within a step for several samples: near the peak
    # of a half sine its sawtooth has q**3 T zeta(3) / pi**4 / P on either side.
    contact = force[first:stop]
    peak = max(float(contact.max() - np.median(background)), step)
    slow = 2 * 0.01234 * step**3 * len(contact) / rate / peak
    return Quantization(step, max(step**2 / 6 / rate, slow), offset)


def _find_step(values: NDArray[np.float64]) -> float:
    """Return the smallest difference between distinct values, if others are its multiples, or 0."""
    least = MIN_STEP_SIZE * float(np.abs(values).max())
    gaps = np.diff(np.unique(values))
    gaps = gaps[gaps > least / 10]
    step = float(gaps.min(initial=math.inf))
    multiples = gaps[gaps < MAX_MULTIPLE * step] / step
    is_near = np.abs(multiples - np.rint(multiples)) < TOLERANCE
    is_step = step > least and len(is_near) >= MIN_GAPS and is_near.mean() >= MIN_FRACTION
    return step if is_step else 0.0


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
