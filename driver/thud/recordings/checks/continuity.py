"""Continuity of the force: gaps of samples that are held, filled or gated, and jumps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.differences import (
    FROM_CUBIC,
    MIN_NOISE,
    MIN_STEPS,
    largest_beside,
    noise_deviation,
    runs,
)

if TYPE_CHECKING:
    from thud.recordings.contact import Contact
    from thud.recordings.drops import Section

# Samples deviate from a cubic for MIN_GAP, s, by less than this fraction of the noise: one of
# 10 000 does so by chance.
MIN_GAP = 1e-3
MAX_QUIET = 1e-4
# Fraction of the background outside the contact from which constant samples are a gate, not a loss.
MAX_CONSTANT = 0.5
# Value and slope are compared between the lines through the samples of this time, s, or four at
# least, on either side. Its curvature changes the slope of a force of 600 Hz by less than that of
# a kink, which is a jump by MIN_RATIO times the largest change around it. First touch and
# release, where forces have kinks and jumps, are at least JUMP_MARGIN, s, away.
JUMP_TIME = 2.5e-4
JUMP_MARGIN = 5e-4
MIN_RATIO = 3.0
# The same for the quieter side alone, of values: packets that change places jump three times, and
# hide each other on the sides between them. The slope may change on one side only.
MIN_SIDE_RATIO = 6.0
# Minimum jump as a fraction of the peak.
MIN_JUMP = 0.005


def check_gaps(section: Section) -> tuple[Note, ...]:
    """Return a warning if the background is constant, at least in part, and the contact noisy.

    Raise InputError if the force is held over first touch or release.
    """
    rate, force, (first, stop) = section.sample_rate, section.force, section.contact
    noise = noise_deviation(force[first:stop])
    if not noise > max(section.quantization.step, MIN_NOISE * float(np.ptp(force[first:stop]))):
        return ()
    is_noisy = np.abs(np.convolve(force, FROM_CUBIC, mode="same")) > MAX_QUIET * noise
    starts, lengths = runs(is_noisy.astype(float))
    constant = ~is_noisy[starts] & (lengths > max(MIN_GAP * rate, len(FROM_CUBIC)))
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


def check_jumps(section: Section, contact: Contact) -> tuple[Note, ...]:
    """Return a warning if the force or its slope jumps within a contact, away from its ends.

    A jump is the distance between the lines through the samples before and after it, at the middle
    or, by their slopes, at their length from it. A corrected force rings and is not checked.
    """
    if section.chain is not None:
        return ()
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
    least = max(MIN_JUMP * contact.peak, MIN_STEPS * contact.background.quantization.step)
    for what, before, after in (
        ("force", line, line[::-1]), ("slope of the force", slope, slope),
    ):  # fmt: skip
        jump = np.abs(np.correlate(force, np.concatenate([before, -after]), mode="valid"))
        sides = largest_beside(jump, count + 1, 3 * count)
        limit = MIN_RATIO * sides.max(axis=0)
        if what == "force":
            limit = np.minimum(limit, MIN_SIDE_RATIO * sides.min(axis=0))
        inside = slice(first, max(stop, first))
        jumps = jump[inside][jump[inside] > np.maximum(limit, least)[inside]]
        if jumps.size:
            return (Note("jump", value=float(jumps.max()), unit="N", others={"what": what}),)
    return ()
