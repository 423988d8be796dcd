"""Load cells under one plate that carry no force, or of which one is the sum of the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.signal import MIN_OPPOSITE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.recordings.drops import Section

# Maximum deviation of a channel from the sum of the others, as a fraction, if it is their sum.
MAX_DEVIATION = 0.05
# Minimum magnitude of the impulse of a cell as a fraction of that of the sum: without one of four
# cells, levels are 2.5 dB too low.
MIN_SHARE = 0.005


def check(section: Section, forces: Sequence[NDArray[np.float64]]) -> list[Note]:
    """Return a warning for each load cell of a section without a force in the contact.

    `forces` are those of the cells, N. Raise InputError if a channel is the sum of the others,
    which would count twice.
    """
    first, stop = section.contact
    levels = [
        force[first:stop] - np.median(np.delete(force, slice(first, stop))) for force in forces
    ]
    total = np.sum(levels, axis=0)
    shares = [float(level.sum() / total.sum()) for level in levels]
    cells = section.cells
    # Two cells may have equal forces, and a cell of the wrong sign, which `orient` names, makes
    # another one the sum of the others.
    if len(cells) > 2 and min(shares) > -MIN_OPPOSITE:  # noqa: PLR2004
        for cell, level in zip(cells, levels, strict=True):
            if np.ptp(total - 2 * level) < MAX_DEVIATION * np.ptp(total - level):
                refuse(
                    f"{cell.name}: is the sum of the other channels, which would count twice",
                    "channels without it, or channel = this one",
                )
    return [
        Note("cell_without_force", value=share, others={"part": cell.name})
        for cell, share in zip(cells, shares, strict=True)
        if abs(share) < MIN_SHARE
    ]
