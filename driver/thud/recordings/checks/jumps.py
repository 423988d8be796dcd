"""Jumps of the force or of its slope within a contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base.note import Note
from thud.recordings.differences import MIN_STEPS, largest_beside

if TYPE_CHECKING:
    from thud.recordings.contact import Contact
    from thud.recordings.drops import Section

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


def check(section: Section, contact: Contact) -> tuple[Note, ...]:
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
    inside = slice(first, max(int(contact.release.value * rate - margin) - start, first))
    background = contact.background
    least = max(MIN_JUMP * background.peak, MIN_STEPS * background.quantization.step)
    for what, before, after in (
        ("force", line, line[::-1]), ("slope of the force", slope, slope),
    ):  # fmt: skip
        jump = np.abs(np.correlate(force, np.concatenate([before, -after]), mode="valid"))
        sides = largest_beside(jump, count + 1, 3 * count)
        limit = MIN_RATIO * sides.max(axis=0)
        if what == "force":
            limit = np.minimum(limit, MIN_SIDE_RATIO * sides.min(axis=0))
        jumps = jump[inside][jump[inside] > np.maximum(limit, least)[inside]]
        if jumps.size:
            return (Note("jump", value=float(jumps.max()), unit="N", others={"what": what}),)
    return ()
