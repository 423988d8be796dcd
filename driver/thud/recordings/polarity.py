"""Sign and peak of a recorded force, and whether both are plausible."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note

if TYPE_CHECKING:
    from thud.recordings.signal import Signal

# Peak forces of heavy/soft sources, N: from drops of some centimeters to the tyre on stiff floors.
PEAKS = (300.0, 15000.0)
# Maximum factor beyond this range that a drop height can explain.
MAX_FACTOR = 20.0
# Factors by which a peak in another unit is wrong.
WRONG_UNITS = {"kN": 1000.0, "mN": 0.001}
POLARITIES = {"positive": 1.0, "negative": -1.0}
# Minimum ratio of the peaks of both signs from which the sign is determined.
MIN_PEAK_RATIO = 1.5
# Number of samples per read, and approximate number from which the background level is estimated.
BLOCK = 2**18
SAMPLED = 2**16


def find_peaks(signal: Signal) -> tuple[float, float]:
    """Return the largest deviations of a force above and below its background level, N.

    Raise InputError if values are not finite or all equal.
    """
    low, high = np.inf, -np.inf
    stride = max(1, signal.n_sample // SAMPLED)
    thinned = []
    for start in range(0, signal.n_sample, BLOCK):
        block = signal.read(start, min(signal.n_sample, start + BLOCK))
        low, high = min(low, float(block.min())), max(high, float(block.max()))
        thinned.append(block[-start % stride :: stride].copy())
    if low == high:
        refuse(f"{signal.name}: all samples are {low:g}", "a recording of drops")
    thin = np.concatenate(thinned)
    edge = max(1, thin.size // 100)
    # If the pulse fills the record, the background is at one end only; with many drops, overall.
    levels = [float(np.median(section)) for section in (thin[:edge], thin[-edge:], thin)]
    middle = low + (high - low) / 2
    background = max(levels, key=lambda level: abs(level - middle))
    return high - background, background - low


def check_peak(peak: float, opposite: float, name: str, *, assumed: bool = False) -> list[Note]:
    """Return warnings about a peak force, N, and that of the opposite sign.

    Raise InputError if the unit must be wrong, or may be if it is `assumed`.
    """
    low, high = PEAKS
    allowed = f"{low:g} to {high:g} N for heavy/soft sources"
    if low <= peak <= high:
        notes = []
    elif assumed:
        unknown = f"{name}: the values are without a unit and reach {peak:.4g}"
        refuse(unknown, f"{allowed}, or unit")
    elif low <= opposite <= high:
        cause = "the polarity is wrong, or the force does not return from its peak"
        refuse(f"{name}: the peaks are {-opposite:.4g} N and {peak:.4g} N; {cause}", allowed)
    else:
        for unit, factor in WRONG_UNITS.items():
            if low <= peak * factor <= high:
                refuse(
                    f"{name}: the peak is {peak:.4g} N: too {'low' if peak < low else 'high'} for "
                    f"a drop, or the values are {unit}",
                    f"{allowed}; unit = {unit!r}, or a calibration",
                )
        if not low / MAX_FACTOR <= peak <= high * MAX_FACTOR:
            refuse(f"{name}: the peak is {peak:.4g} N; unit or calibration is wrong", allowed)
        notes = [Note("peak_unusual", name, peak, low, high, "N")]
    if opposite > MIN_PEAK_RATIO * peak:
        others = {"opposite": -opposite}
        notes.append(Note("polarity_doubtful", name, peak, unit="N", others=others))
    return notes
