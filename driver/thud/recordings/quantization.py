"""Errors due to the quantization of a record (docs/recordings_theory.md, section 2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

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
# Standard deviation of the background in steps above which its mean has no error by quantization.
MAX_DEVIATION = 0.6
# Deviation of the noise from sample to sample, in steps, above which it averages the steps.
MAX_FAST = 0.4
# Maximum number of samples of the background that count as independent.
MAX_COUNT = 1000
# Standard deviation of the offset, as a fraction of the peak, from which a warning is raised: 0.03
# dB at 250, 0.06 dB at 500 Hz.
MAX_OFFSET = 5e-4
# Grid of mean and standard deviation of a background before quantization, in steps.
MEANS = np.linspace(-0.5, 0.5, 41)
DEVIATIONS = np.geomspace(0.001, 1.0, 31)


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
        found = [find_quantization(cell) for cell in section.cells]
        return Quantization(
            max(entry.step for entry in found),
            sum(entry.density for entry in found),
            math.hypot(*(entry.offset for entry in found)),
        )
    force, rate, (first, stop) = section.force, section.sample_rate, section.contact
    length, margin = int(MAX_BACKGROUND * rate), int(MARGIN * rate)
    before = force[max(first - length, 0) : max(first - margin, 1)]
    after = force[min(stop + margin, len(force) - 1) : stop + length]
    contact = force[first:stop]
    background = np.concatenate([before, after])
    step = find_step(np.concatenate([background, contact]))
    offset = offset_deviation(background, step)
    # Floats with few digits are coarser at the peak.
    peak = float(contact.max() - np.median(background))
    top = find_step(contact[contact > contact.max() - peak / 3])
    if not offset and top <= step:
        return Quantization(step)
    step = max(step, top)
    # The error is white, unless the force stays within a step for several samples: near the peak
    # of a half sine its sawtooth has q**3 T zeta(3) / pi**4 / P on either side.
    slow = 2 * 0.01234 * step**3 * len(contact) / rate / max(peak, step)
    return Quantization(step, max(step**2 / 6 / rate, slow), offset)


def find_step(values: NDArray[np.float64]) -> float:
    """Return the quantization step of values; 0 if there is none.

    It is the smallest difference between distinct values, if others are its multiples.
    """
    if not values.size:
        return 0.0
    gaps = np.diff(np.unique(values))
    gaps = gaps[gaps > MIN_STEP * np.abs(values).max() / 10]
    if not gaps.size:
        return 0.0
    step = float(gaps.min())
    multiples = gaps[gaps < MAX_MULTIPLE * step] / step
    is_near = np.abs(multiples - np.rint(multiples)) < TOLERANCE
    if len(is_near) < MIN_GAPS or is_near.mean() < MIN_FRACTION:
        return 0.0
    return step if step > MIN_STEP * np.abs(values).max() else 0.0


def offset_deviation(background: NDArray[np.float64], step: float) -> float:
    """Return the standard deviation of the mean of a background by quantization, N.

    Hum and drift change the background over several steps, without averaging them like noise from
    sample to sample of deviation s: the factor exp(-2 pi**2 s**2 / step**2) is that of the first
    harmonic of the error over the steps. The true mean and standard deviation of a background with
    few distinct values follow from their frequencies: uniform in the mean, and in the logarithm of
    the standard deviation.
    """
    if not step or background.size < 2:  # noqa: PLR2004
        return 0.0
    deviation, slow = float(background.std()) / step, 0.0
    variance = float(np.mean(np.diff(background) ** 2)) / 2 / step**2
    fast = max(variance - 1 / 12, 0.0)
    if fast < MAX_FAST**2 and np.ptp(background) >= step / 2:
        span = 1 + math.sqrt(8) * deviation
        slow = step / math.sqrt(12) * math.exp(-2 * np.pi**2 * fast) / math.sqrt(span)
    if deviation > MAX_DEVIATION:
        return slow
    codes, counts = np.unique(np.rint((background - background[0]) / step), return_counts=True)
    middle = codes[np.argmax(counts)]
    weights = counts * min(1.0, MAX_COUNT / counts.sum())
    mean, width = np.meshgrid(MEANS, DEVIATIONS, indexing="ij")
    logarithm = np.zeros(mean.shape)
    for code, weight in zip(codes - middle, weights, strict=True):
        upper, lower = ((code + side - mean) / width for side in (0.5, -0.5))
        # The complement keeps the digits of small probabilities above the mean.
        probability = np.where(lower > 0, ndtr(-lower) - ndtr(-upper), ndtr(upper) - ndtr(lower))
        logarithm += weight * np.log(np.maximum(probability, 1e-300))
    posterior = np.exp(logarithm - logarithm.max())
    error = mean - (codes - middle) @ counts / counts.sum()
    return max(slow, step * math.sqrt(float((posterior * error**2).sum() / posterior.sum())))


def check(section: Section, contact: Contact) -> tuple[Note, ...]:
    """Return a warning if the quantization of a background makes its offset uncertain."""
    del section
    step, offset = contact.background.quantization.step, contact.background.quantization.offset
    if offset < MAX_OFFSET * contact.peak:
        return ()
    return (Note("coarse_steps", value=offset, unit="N", others={"step": step}),)
