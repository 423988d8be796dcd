"""Samples that are held, clipped, filled or gated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.differences import FROM_CUBIC, MIN_NOISE, noise_deviation, runs

if TYPE_CHECKING:
    from thud.recordings.drops import Section

# Samples deviate from a cubic for MIN_GAP, s, by less than this fraction of the noise: one of
# 10 000 does so by chance.
MIN_GAP = 1e-3
MAX_QUIET = 1e-4
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
    is_gap = ~is_noisy[starts] & (lengths > max(MIN_GAP * rate, len(FROM_CUBIC)))
    if not is_gap.any():
        return ()
    starts, stops = starts[is_gap], (starts + lengths)[is_gap]
    total = 1e3 * int((stops - starts).sum()) / rate
    outside = 1e3 * (len(force) - (stop - first)) / rate
    if ((stops > first) & (starts < stop)).any() and total < MAX_CONSTANT * outside:
        refuse(
            f"{section.name}: the force is held, clipped or filled by a line for {total:.3g} ms at "
            "the contact while the samples around it are noisy",
            "a recording without lost samples",
        )
    return (Note("constant_background", value=total, unit="ms"),)
