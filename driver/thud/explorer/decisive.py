"""Warnings on a recording that can change the verdict on a level."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from thud.level.assessment import VERDICTS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from thud.level.assessment import Criterion

# Errors of a calibration up to this fraction are common.
CALIBRATION_ERROR = 0.05
# Effects on a level that no uncertainty includes: dB and Hz, or Hz and dB.
_SIZED = re.compile(
    r"its correction, (?P<size>[\d.]+) dB at (?P<band>[\d.]+) Hz"
    r"|octave of (?P<other_band>[\d.]+) Hz may be off by (?P<other_size>[\d.]+) dB"
)
_NOT_STATED = "uncertainty not stated, and not included: "
# Warnings on other criteria, and on effects that are included or asked for.
_OTHER = re.compile(
    r"not stated, and assumed|restitution|number of peaks|mass is not stated|no bounce|uncertainty"
    r"|keeps ringing"
)


def decisive_warnings(warnings: Iterable[str], criteria: Sequence[Criterion]) -> list[str]:
    """Return the warnings that can change the verdict on a level.

    These are warnings on an effect that is at least as large as the distance of the level to
    another verdict, and warnings on the force that state no size.
    """
    distances = {entry.name: _distance(entry) for entry in criteria if entry.unit == "dB"}
    return [text for warning in warnings for text in _decisive(warning, distances)]


def _distance(criterion: Criterion) -> float:
    """Return the change of a level, dB, that changes its verdict; infinite if it is undecided."""
    if criterion.result == VERDICTS[2]:
        return float("inf")
    return abs(criterion.margin) - criterion.estimate.expanded


def _decisive(warning: str, distances: dict[str, float]) -> Iterator[str]:
    """Yield a warning, or its part, that can change a verdict."""
    if warning.startswith(_NOT_STATED):
        name = min(distances, key=lambda band: distances[band])
        error = 10 ** (distances[name] / 20) - 1
        if "calibration" in warning and error < CALIBRATION_ERROR:
            yield (
                f"The uncertainty of the calibration is not stated: an error of {100 * error:.2g} "
                f"% changes the verdict on {_band(name)} Hz."
            )
        return
    effect = _SIZED.search(warning)
    if effect:
        band, size = effect["band"] or effect["other_band"], effect["size"] or effect["other_size"]
        if float(size) >= distances[f"octave_{band.replace('.', '_')}"]:
            yield warning
    elif not _OTHER.search(warning):
        yield warning


def _band(name: str) -> str:
    return name.removeprefix("octave_").replace("_", ".")
