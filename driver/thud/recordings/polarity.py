"""Extremes of a signal: its polarity, and whether they are plausible forces of a source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

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
# Fraction of a file at either end from which the background level is estimated.
EDGE = 0.01


@dataclass(frozen=True)
class Extremes:
    """Minimum, maximum and background level of a signal, in its own unit."""

    low: float
    high: float
    background: float

    def peak(self, scale: float) -> float:
        """Return the positive peak above the background, N, if `scale` is N per value."""
        high, low = self.high - self.background, self.low - self.background
        return max(high * scale, low * scale) + 0.0  # never -0


def scan(samples: Callable[[int, int], NDArray[np.float64]], count: int, name: str) -> Extremes:
    """Return the extremes of a signal; raise InputError if values are not finite or all equal."""
    low, high = np.inf, -np.inf
    stride = max(1, count // SAMPLED)
    thinned = []
    for start in range(0, count, BLOCK):
        stop = min(count, start + BLOCK)
        block = samples(start, stop)
        if block.shape != (stop - start,):
            refuse(f"{name}: is cut off at sample {start + block.size + 1}", "a complete file")
        if not np.isfinite(block).all():
            index = start + int(np.flatnonzero(~np.isfinite(block))[0])
            refuse(f"{name}: sample {index + 1} is not finite", "real numbers")
        low, high = min(low, float(block.min())), max(high, float(block.max()))
        thinned.append(block[-start % stride :: stride].copy())
    if low == high:
        refuse(f"{name}: all samples are {low:g}", "a recording of drops")
    thin = np.concatenate(thinned)
    edge = max(1, int(EDGE * thin.size))
    # If the pulse fills the record, the background is at one end only; with many drops, overall.
    levels = [float(np.median(section)) for section in (thin[:edge], thin[-edge:], thin)]
    middle = low + (high - low) / 2
    return Extremes(low, high, max(levels, key=lambda level: abs(level - middle)))


def find_sign(extremes: Extremes, name: str) -> tuple[float, tuple[Note, ...]]:
    """Return the sign that makes a compression positive, and notes, from extremes in N."""
    up, down = extremes.peak(1.0), extremes.peak(-1.0)
    if max(up, down) < MIN_PEAK_RATIO * min(up, down):
        refuse(
            f"{name}: the sign is not clear, the peaks are {up:.4g} N and {-down:.4g} N",
            "polarity = 'positive' or 'negative', the sign of a compression",
            subject="polarity",
        )
    return (1.0, ()) if up > down else (-1.0, (Note("sign_changed", name, -down, unit="N"),))


def check_peak(
    extremes: Extremes, sign: float, name: str, *, assumed: bool = False
) -> tuple[Note, ...]:
    """Return warnings about a peak force from extremes in N; `sign` is that of a compression.

    Raise InputError if the unit must be wrong, or may be if it is `assumed`.
    """
    low, high = PEAKS
    peak, opposite_peak = extremes.peak(sign), extremes.peak(-sign)
    peaks = f"the peaks are {-opposite_peak:.4g} N and {peak:.4g} N"
    allowed = f"{low:g} to {high:g} N for heavy/soft sources"
    if not low <= peak <= high:
        if assumed:
            unknown = f"{name}: the values are without a unit and reach {peak:.4g}"
            refuse(unknown, f"{allowed}, or unit")
        if low <= opposite_peak <= high:
            cause = "the polarity is wrong, or the force does not return from its peak"
            refuse(f"{name}: {peaks}; {cause}", allowed)
        for unit, factor in WRONG_UNITS.items():
            if low <= peak * factor <= high:
                refuse(
                    f"{name}: the peak is {peak:.4g} N: too {'low' if peak < low else 'high'} for "
                    f"a drop, or the values are {unit}",
                    f"{allowed}; unit = {unit!r}, or a calibration",
                )
        if not low / MAX_FACTOR <= peak <= high * MAX_FACTOR:
            refuse(f"{name}: the peak is {peak:.4g} N; unit or calibration is wrong", allowed)
    notes: tuple[Note, ...] = ()
    if not low <= peak <= high:
        notes += (Note("peak_unusual", name, peak, low, high, "N"),)
    if opposite_peak > MIN_PEAK_RATIO * peak:
        others = {"opposite": -opposite_peak}
        notes += (Note("polarity_doubtful", name, peak, unit="N", others=others),)
    return notes
