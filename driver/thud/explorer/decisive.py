"""Warnings on a recording that can change the verdict on a level."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from thud.base._schema import VERDICTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.base.note import Note
    from thud.level.assessment import Criterion

# Warnings that change no level, or whose effect on the levels is in their uncertainty.
WITHOUT_EFFECT = {
    "coarse_steps", "effective_mass", "filter_assumed", "no_bounce", "noise_ends", "offset_step",
    "peaks_unknown", "plate_assumed", "plate_estimated", "plate_not_recorded", "plate_rings",
    "plate_rings_differently", "restitution_impossible", "restitution_partly_known",
    "restitutions_differ", "share_assumed", "uncertainty_not_stated",
}  # fmt: skip
# Warnings whose value is their effect on the octave of 500 Hz, dB.
WITH_EFFECT = {"aliasing", "plate_unclear"}


def decisive_warnings(notes: Sequence[Note], criteria: Sequence[Criterion]) -> list[Note]:
    """Return the warnings that can change the verdict on a level.

    These are those whose effect is unknown, or at least the distance of the octave of 500 Hz to
    another verdict.
    """
    octave = next(entry for entry in criteria if entry.name == "octave_500")
    is_decided = octave.conforms_if_stated != VERDICTS[2]
    distance = abs(octave.margin) - octave.estimate.expanded if is_decided else math.inf
    return [
        note
        for note in notes
        if note.is_warning
        and note.code not in WITHOUT_EFFECT
        and (note.code not in WITH_EFFECT or note.value >= distance)
    ]
