"""Errors due to the quantization of a record (docs/recordings_theory.md, section 2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.base.note import Note

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.contact import Contact
    from thud.recordings.drops import Section

# Maximum length of the background on either side of the contact, s: a longer one lowers the noise
# of the offset by less than 5 %. Margin between them, s.
MAX_BACKGROUND = 0.1
MARGIN = 2e-3
# Minimum step as a fraction of the maximum force: smaller ones are rounding of floats, or harmless.
MIN_STEP = 1e-5
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
# Standard deviation of the offset, as a fraction of the peak, from which a warning is raised: 0.03
# dB at 250, 0.06 dB at 500 Hz.
MAX_OFFSET = 5e-4


@dataclass(frozen=True)
class Quantization:
    """Errors due to quantization with a step, N, that noise does not average.

    `density` is the one-sided density of the error during the contact, N2/Hz, and `offset` the
    standard deviation of the error of the mean background, N.
    """

    step: float = 0.0
    density: float = 0.0
    offset: float = 0.0


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
    length, margin = int(MAX_BACKGROUND * rate), int(MARGIN * rate)
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
    least = MIN_STEP * float(np.abs(values).max())
    gaps = np.diff(np.unique(values))
    gaps = gaps[gaps > least / 10]
    step = float(gaps.min(initial=math.inf))
    multiples = gaps[gaps < MAX_MULTIPLE * step] / step
    is_near = np.abs(multiples - np.rint(multiples)) < TOLERANCE
    is_step = step > least and len(is_near) >= MIN_GAPS and is_near.mean() >= MIN_FRACTION
    return step if is_step else 0.0


def _offset_deviation(background: NDArray[np.float64], step: float) -> float:
    """Return the standard deviation of the error of the mean of a background, N.

    In two codes, of which the rarer one has the fraction p, the true mean is up to 1/2 - p steps
    from the recorded one. Noise of s steps from sample to sample lowers step / sqrt(12), the error
    of a constant, by exp(-2 pi**2 s**2), the first harmonic of the error over the steps; hum and
    drift lower it by the root of the number of steps over which they change the background.
    """
    steps = np.rint((background - background[0]) / step)
    fractions = np.sort(np.unique(steps, return_counts=True)[1])[:-3:-1] / len(steps)
    if fractions.sum() > TWO_CODES:
        return step * float(fractions[0] - 0.5) / math.sqrt(3)
    noise = max(float(np.mean(np.diff(steps) ** 2)) / 2 - 1 / 12, 0.0)
    if noise > MAX_NOISE**2:
        return 0.0
    span = 1 + math.sqrt(8) * float(steps.std())
    return step * math.exp(-2 * np.pi**2 * noise) / math.sqrt(12 * span)


def check(section: Section, contact: Contact) -> tuple[Note, ...]:
    """Return a warning if the quantization of a background makes its offset uncertain.

    An offset of 0.05 % of the peak changes 500 Hz by 0.06 dB; the uncertainty includes it.
    """
    del section
    step, offset = contact.background.quantization.step, contact.background.quantization.offset
    if offset < MAX_OFFSET * contact.background.peak:
        return ()
    return (Note("coarse_steps", value=offset, unit="N", others={"step": step}),)
