"""Records of the same drops, which must not be averaged (docs/recordings_reading.md)."""

from __future__ import annotations

import math
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import uniform_filter1d

from thud.base.checks import refuse
from thud.recordings.signs import HINT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.recordings.measured_drop import Drop
    from thud.recordings.recording import Origin

# Noise is compared above about 1 / SMOOTH, without hum: a moving mean is subtracted three times.
SMOOTH = 1e-3
# Minimum correlation of the noise of two records of one drop, and its minimum in standard
# deviations of a correlation by chance. Noise is assumed to reach up to BANDWIDTH, Hz.
MIN_CORRELATION = 0.5
MIN_SCORE = 6.0
BANDWIDTH = 5e3
# Maximum shift between the touches of two records of one drop, s, and samples.
MAX_SHIFT = 3e-4
MAX_SHIFT_SAMPLES = 3
# Maximum difference of forces in the contact, in standard deviations of the noise of both records:
# different drops may have the same interference.
MAX_DIFFERENCE = 3.0
# Maximum relative difference of the rates of two records of one drop, by the rounding of times.
SAME_RATE = 1e-4


def check(origins: Sequence[Origin], drops: Sequence[Sequence[Drop]]) -> None:
    """Raise InputError if two signals are the same, or hold the same drop or simultaneous ones.

    `drops` are those of each signal.
    """
    noises = {id(drop): _noise(drop) for own in drops for drop in own} if len(origins) > 1 else {}
    for (first, ones), (later, others) in combinations(zip(origins, drops, strict=True), 2):
        is_same_channel = later.name == first.name or later.path != first.path
        if later.checksum == first.checksum and is_same_channel:
            also = "" if later.name == first.name else f", also as {first.name}"
            refuse(
                f"{later.name}: is given twice{also}",
                "each record once: repeatability is the scatter of different drops",
            )
        for one, other in product(ones, others):
            if first.path and later.path == first.path and _overlap(one, other):
                refuse(
                    f"{later.name}: has drops at the same instants as {first.name}; simultaneous "
                    "forces are never averaged",
                    HINT,
                    subject="channels",
                )
            if _is_same(one, other, noises[id(one)], noises[id(other)]):
                refuse(
                    f"{other.name}: is the same drop as {one.name}: its noise is the same",
                    "each drop once: repeatability is the scatter of different drops",
                )


def _overlap(one: Drop, other: Drop) -> bool:
    """Whether two drops of one file are in contact at the same time."""
    early, late = sorted((one, other), key=lambda drop: drop.onset)
    return late.onset < early.onset + early.contact_time.value


def _noise(drop: Drop) -> NDArray[np.float64]:
    """Return the recorded force before the gate without hum and slow noise, N."""
    noise = (drop.force + drop.contact.removed)[: drop.gate[0]]
    for _ in range(3):
        width = max(3, round(SMOOTH * drop.sample_rate))
        noise = noise - uniform_filter1d(noise, width, mode="nearest")
    return noise


def _is_same(one: Drop, other: Drop, a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Whether two records of drops have the same noise a and b, N, and the same force."""
    rate = one.sample_rate
    limit = MAX_SHIFT_SAMPLES + int(MAX_SHIFT * rate)
    length = min(len(a), len(b)) - 2 * limit
    count = min(length, length / rate * BANDWIDTH)
    if count < MIN_SCORE**2 or not math.isclose(rate, other.sample_rate, rel_tol=SAME_RATE):
        return False
    middle = a[len(a) - limit - length : len(a) - limit]
    near = np.correlate(b[-length - 2 * limit :], middle, mode="valid")
    near /= max(length * float(a.std() * b.std()), 1e-300)
    best = int(np.argmax(near))
    if near[best] < max(MIN_CORRELATION, MIN_SCORE / math.sqrt(count)):
        return False
    first, stop = one.gate
    start = max(other.gate[0] + best - limit, 0)
    force, again = (drop.force + drop.contact.removed for drop in (one, other))
    force, again = force[first:stop], again[start:][: stop - first]
    if len(again) < len(force):
        return False
    columns = np.column_stack([again, np.ones(len(again))])
    difference = force - columns @ np.linalg.lstsq(columns, force, rcond=None)[0]
    return bool(difference.std() < MAX_DIFFERENCE * math.hypot(a.std(), b.std()))
