"""Warnings on a recording that can change the verdict on a level."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from thud.level.assessment import VERDICTS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from thud.level.assessment import Criterion

# Errors of a calibration up to this fraction are common.
CALIBRATION_ERROR = 0.05


def decisive_warnings(effects: Mapping[str, float], criteria: Sequence[Criterion]) -> list[str]:
    """Return the warnings that can change the verdict on a level.

    `effects` are those of `thud.recordings.recording.Recording.level_effects`: a warning is
    returned if its effect is unknown, or at least the distance of the level to another verdict.
    """
    octave = next(entry for entry in criteria if entry.name == "octave_500")
    distance = _distance(octave)
    return [text for text, size in effects.items() if 0 < size >= distance]


def calibration_warning(criteria: Sequence[Criterion]) -> str:
    """Return a warning if a common error of a calibration changes the verdict on a level."""
    levels = [entry for entry in criteria if entry.unit == "dB"]
    closest = min(levels, key=_distance)
    error = 10 ** (_distance(closest) / 20) - 1
    if error >= CALIBRATION_ERROR:
        return ""
    return (
        f"The uncertainty of the calibration is not stated: an error of {100 * error:.2g} % "
        f"changes the verdict on {closest.quantity.title}."
    )


def _distance(criterion: Criterion) -> float:
    """Return the change of a level, dB, that changes its verdict; infinite if it is undecided."""
    if criterion.result == VERDICTS[2]:
        return math.inf
    return abs(criterion.margin) - criterion.estimate.expanded
