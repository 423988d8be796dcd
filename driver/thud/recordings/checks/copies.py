"""Records of the same drops, which must not be averaged (docs/recordings_reading.md).

Without it the scatter between drops is too small, or zero; the mean of four load cells in place of
their sum is 12 dB too low.
"""

from __future__ import annotations

import math
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import uniform_filter1d

from thud.base.checks import refuse
from thud.recordings.load_cells import HINT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.recordings.drops import Pulse
    from thud.recordings.measured_drop import Drop
    from thud.recordings.recording import Origin
    from thud.recordings.signal import Signal

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
# Maximum difference of forces in the contact, in standard deviations of the noise of both records.
MAX_DIFFERENCE = 3.0
# Maximum relative difference of the rates of two records of one drop, by the rounding of times.
SAME_RATE = 1e-4
# Simultaneous records: maximum difference of instants, s, and minimum difference of the scales, for
# records with one pulse, which a trigger may put at one instant, and with several.
MAX_DELAY = 2e-4
MIN_SCALE_CHANGE = (0.1, 0.03)


def refuse_copy(signal: Signal, others: Sequence[Origin]) -> None:
    """Raise InputError if a file, or an array, was measured before."""
    for other in others:
        is_same_channel = signal.name == other.name or signal.path != other.path
        if signal.checksum == other.checksum and is_same_channel:
            also = "" if signal.name == other.name else f", also as {other.name}"
            refuse(
                f"{signal.name}: is given twice{also}",
                "each record once: repeatability is the scatter of different drops",
            )


def refuse_simultaneous_channels(
    signal: Signal, drops: Sequence[Pulse], searched: dict[str, dict[str, NDArray[np.float64]]]
) -> None:
    """Add the drops of a signal to those that were searched, by path and name of their signal.

    `searched` holds begins and ends of contacts, s, shape (n_drop, 2). Raise InputError if another
    channel of the file has a drop at the same instant.
    """
    contacts = np.array([drop.contact for drop in drops]).reshape(-1, 2) / signal.sample_rate
    channels = searched.setdefault(signal.path, {})
    for name, others in channels.items() if signal.path else ():
        if ((contacts[:, None, 0] < others[:, 1]) & (contacts[:, None, 1] > others[:, 0])).any():
            refuse(
                f"{signal.name}: has drops at the same instants as {name}; simultaneous forces are "
                "never averaged",
                HINT,
                subject="channels",
            )
    channels[signal.name] = contacts


def refuse_same_drops(origins: Sequence[Origin], drops: Sequence[Sequence[Drop]]) -> None:
    """Raise InputError if two signals hold the same drop, or simultaneous forces.

    `drops` are those of each signal.
    """
    if len(origins) == 1:
        return
    contacts = [[_Contact(drop) for drop in own] for own in drops]
    for (origin, ones), (later, others) in combinations(zip(origins, contacts, strict=True), 2):
        for one, other in product(ones, others):
            if _is_same(one, other):
                refuse(
                    f"{other.drop.name}: is the same drop as {one.drop.name}: its noise is the "
                    "same",
                    "each drop once: repeatability is the scatter of different drops",
                )
        same = [[contact.drop for contact in own] for own in (ones, others)]
        if origin.path != later.path and _are_simultaneous(*same):
            refuse(
                f"{later.name}: has the drops of {origin.name} at the same instants of its file "
                "at a different scale; simultaneous forces are never averaged",
                f"one file with all channels and {HINT}; other balls or heights, which a trigger "
                "records at the same instant, in a measurement of their own",
            )


class _Contact:
    """Background before a drop without hum and slow noise, N, and its contact."""

    def __init__(self, drop: Drop) -> None:
        self.drop = drop
        self.raw = drop.contact.force + drop.contact.removed
        self.noise = self.raw[: drop.gate[0]]
        for _ in range(3):
            width = max(3, round(SMOOTH * drop.sample_rate))
            self.noise = self.noise - uniform_filter1d(self.noise, width, mode="nearest")
        self.deviation = float(self.noise.std()) if self.noise.size else 0.0


def _is_same(one: _Contact, other: _Contact) -> bool:
    """Whether two records of drops have the same noise before the gate, and the same force."""
    rate = one.drop.sample_rate
    limit = MAX_SHIFT_SAMPLES + int(MAX_SHIFT * rate)
    length = min(len(one.noise), len(other.noise)) - 2 * limit
    count = min(length, length / rate * BANDWIDTH)
    if count < MIN_SCORE**2 or not math.isclose(rate, other.drop.sample_rate, rel_tol=SAME_RATE):
        return False
    middle = one.noise[len(one.noise) - limit - length : len(one.noise) - limit]
    near = np.correlate(other.noise[-length - 2 * limit :], middle, mode="valid")
    near /= max(length * one.deviation * other.deviation, 1e-300)
    best = int(np.argmax(near))
    if near[best] < max(MIN_CORRELATION, MIN_SCORE / math.sqrt(count)):
        return False
    noise = math.hypot(one.deviation, other.deviation)
    return _difference(one, other, best - limit) < MAX_DIFFERENCE * noise


def _difference(one: _Contact, other: _Contact, shift: int) -> float:
    """Return the standard deviation of the difference of two contacts at the best scale, N.

    `shift` is the sample of the other gate at the begin of the first one.
    """
    first, stop = one.drop.gate
    a = one.raw[first:stop]
    start = other.drop.gate[0] + shift
    b = other.raw[max(start, 0) : start + len(a)]
    if start < 0 or len(b) < len(a):
        return float("inf")
    shapes = np.column_stack([b, np.ones(len(b))])
    solution, *_ = np.linalg.lstsq(shapes, a, rcond=None)
    return float((a - shapes @ solution).std())


def _are_simultaneous(one: Sequence[Drop], other: Sequence[Drop]) -> bool:
    """Whether drops have equal instants but different scales."""
    if len(one) != len(other):
        return False
    instants, others = (
        np.array([drop.onset + time for drop in drops for time in (0.0, *drop.bounces)])
        for drops in (one, other)
    )
    if len(instants) != len(others) or np.abs(instants - others).max() > MAX_DELAY:
        return False
    minimum = MIN_SCALE_CHANGE[len(instants) > 1]
    return all(
        abs(np.log(a.peak_force.value / b.peak_force.value)) > minimum
        for a, b in zip(one, other, strict=True)
    )
