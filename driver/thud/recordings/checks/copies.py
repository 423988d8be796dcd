"""Records of the same drops, which must not be averaged (docs/recordings_reading.md)."""

from __future__ import annotations

import math
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.recordings.config import HINT
from thud.recordings.drops import FROM_CUBIC

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.recordings.measured_drop import Drop
    from thud.recordings.recording import Origin

# Maximum shift between the touches of two records of one drop, s, and samples.
MAX_SHIFT = 3e-4
MAX_SHIFT_SAMPLES = 3
# Maximum difference of two records of one drop, in standard deviations from cubics of the noise of
# both: the white noise of different drops alone differs by 0.58.
MAX_DIFFERENCE = 0.2
# Minimum number of samples before the gate of both, which know the deviation from cubics to 20 %:
# fewer samples tell no copy, nor does a record that begins at its gate.
MIN_BEFORE = 36
# Maximum relative difference of the rates of two records of one drop, by the rounding of times.
SAME_RATE = 1e-4


def check(origins: Sequence[Origin], drops: Sequence[Sequence[Drop]]) -> None:
    """Raise InputError if two signals are the same, or hold the same drop or simultaneous ones.

    `drops` are those of each signal.
    """
    for (first, ones), (later, others) in combinations(zip(origins, drops, strict=True), 2):
        is_same_channel = later.name == first.name or later.path != first.path
        if later.checksum == first.checksum and is_same_channel:
            also = "" if later.name == first.name else f", also as {first.name}"
            refuse(
                f"{later.name}: is given twice{also}",
                "each record once: repeatability is the scatter of different drops",
            )
        for one, other in product(ones, others):
            early, late = sorted((one, other), key=lambda drop: drop.onset)
            is_simultaneous = late.onset < early.onset + early.contact_time.value
            if first.path and later.path == first.path and is_simultaneous:
                refuse(
                    f"{later.name}: has drops at the same instants as {first.name}; simultaneous "
                    "forces are never averaged",
                    HINT,
                    subject="channels",
                )
            if _is_same(one, other):
                refuse(
                    f"{other.name}: is the same drop as {one.name}: its noise is the same",
                    "each drop once: repeatability is the scatter of different drops",
                )


def _is_same(one: Drop, other: Drop) -> bool:
    """Whether two records are of one drop: the noise in the contact is the same.

    They may have different gains and offsets.
    """
    rate, limit = one.sample_rate, MAX_SHIFT_SAMPLES + int(MAX_SHIFT * one.sample_rate)
    if not math.isclose(rate, other.sample_rate, rel_tol=SAME_RATE):
        return False
    first, again = (drop.force + drop.contact.removed for drop in (one, other))
    before = min(one.gate[0], other.gate[0] - limit)
    if before < MIN_BEFORE:
        return False
    first = first[one.gate[0] - before : one.gate[1]]
    again = again[other.gate[0] - before - limit :][: len(first) + 2 * limit]
    if len(again) < len(first) + 2 * limit:
        return False
    noises = [
        np.convolve(force[:before], FROM_CUBIC, mode="valid").std() for force in (first, again)
    ]
    best = int(np.argmax(np.correlate(again, first - first.mean(), mode="valid")))
    first, again = first[before:], again[best + before :][: len(first) - before]
    columns = np.column_stack([again, np.ones(len(again))])
    difference = first - columns @ np.linalg.lstsq(columns, first, rcond=None)[0]
    return bool(difference.std() < MAX_DIFFERENCE * math.hypot(*noises))
