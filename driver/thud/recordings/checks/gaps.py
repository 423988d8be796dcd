"""Samples that are held, filled by a line, or lost behind a gate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.differences import FROM_CUBIC, noise_deviation, runs

if TYPE_CHECKING:
    from thud.recordings.drops import Section

# Samples deviate from a cubic for MIN_LENGTH, s, by less than this fraction of the noise: one of
# 10 000 does so by chance.
MIN_LENGTH = 1e-3
MAX_QUIET = 1e-4
# Minimum noise as a fraction of the peak: without noise nothing shows a gap.
MIN_NOISE = 4e-5
# Fraction of the background outside the contact from which constant samples are a gate, not a loss.
MAX_CONSTANT = 0.5


def check(section: Section) -> tuple[Note, ...]:
    """Return a warning if the background is constant, at least in part, and the contact noisy.

    Raise InputError if the force is held over first touch or release.
    """
    rate, force, (first, stop) = section.sample_rate, section.force, section.contact
    noise = noise_deviation(force[first:stop])
    if not noise > max(section.quantization.step, MIN_NOISE * float(np.ptp(force[first:stop]))):
        return ()
    is_noisy = np.abs(np.convolve(force, FROM_CUBIC, mode="same")) > MAX_QUIET * noise
    starts, lengths = runs(is_noisy.astype(float))
    constant = ~is_noisy[starts] & (lengths > max(MIN_LENGTH * rate, len(FROM_CUBIC)))
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
