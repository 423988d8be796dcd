"""Warnings on a recording that can change the verdict on a level."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from thud.base._schema import VERDICTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.base.note import Note
    from thud.level.assessment import Criterion


def decisive_warnings(notes: Sequence[Note], criteria: Sequence[Criterion]) -> list[Note]:
    """Return the warnings that can change the verdict on a level.

    These are those whose effect is unknown, or at least the distance of the level to another
    verdict.
    """
    octave = next(entry for entry in criteria if entry.name == "octave_500")
    distance = _distance(octave)
    return [note for note in notes if note.is_warning and 0 < note.effect >= distance]


def _distance(criterion: Criterion) -> float:
    """Return the change of a level, dB, that changes its verdict; infinite if it is undecided."""
    if criterion.conforms_if_stated == VERDICTS[2]:
        return math.inf
    return abs(criterion.margin) - criterion.estimate.expanded
