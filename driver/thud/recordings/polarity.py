"""Extremes of a channel: its polarity, and whether they are plausible forces of a source."""

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
THOUSAND = 1000.0
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
    """Minimum, maximum and background level of a channel, in its own unit.

    `stays` is whether it ends at least half of its range away from where it begins.
    """

    low: float
    high: float
    background: float
    stays: bool = False

    def peak(self, scale: float) -> float:
        """Return the positive peak above the background, N, if `scale` is N per value."""
        high, low = self.high - self.background, self.low - self.background
        return max(high * scale, low * scale) + 0.0  # never -0


def scan(samples: Callable[[int, int], NDArray[np.float64]], count: int, name: str) -> Extremes:
    """Return the extremes of a channel; raise InputError if values are not finite or all equal."""
    low, high = np.inf, -np.inf
    stride = max(1, count // SAMPLED)
    thinned = []
    for start in range(0, count, BLOCK):
        stop = min(count, start + BLOCK)
        block = samples(start, stop)
        if block.shape != (stop - start,):
            refuse(f"{name}: is cut off at sample {start + block.size + 1}", "a complete file")
        minimum, maximum = float(block.min()), float(block.max())
        if not (np.isfinite(minimum) and np.isfinite(maximum)):
            index = start + int(np.flatnonzero(~np.isfinite(block))[0])
            refuse(f"{name}: sample {index + 1} is not finite", "real numbers")
        low, high = min(low, minimum), max(high, maximum)
        thinned.append(block[-start % stride :: stride].copy())
    if low == high:
        refuse(f"{name}: all samples are {low:g}", "a recording of drops")
    thin = np.concatenate(thinned)
    edge = max(1, int(EDGE * thin.size))
    # If the pulse fills the record, the background is at one end only; with many drops, overall.
    levels = [float(np.median(section)) for section in (thin[:edge], thin[-edge:], thin)]
    middle = low + (high - low) / 2
    background = max(levels, key=lambda level: abs(level - middle))
    return Extremes(low, high, background, abs(levels[1] - levels[0]) > (high - low) / 2)


def find_sign(
    extremes: Extremes, scale: float, polarity: str | None, name: str
) -> tuple[float, tuple[Note, ...]]:
    """Return the sign that makes a compression positive, and notes."""
    # `polarity` refers to the recorded values, before the calibration.
    if polarity is not None:
        sign = POLARITIES[polarity] * float(np.sign(scale))
        changed = Note("sign_stated", name, others={"polarity": polarity})
        return sign, (changed,) if sign * scale < 0 else ()
    up, down = extremes.peak(scale), extremes.peak(-scale)
    if max(up, down) < MIN_PEAK_RATIO * min(up, down):
        _refuse_staying(extremes, max(up, down), name)
        refuse(
            f"{name}: the sign is not clear, the peaks are {up:.4g} N and {-down:.4g} N",
            "polarity = 'positive' or 'negative', the sign of a compression",
        )
    if up > down:
        return 1.0, ()
    return -1.0, (Note("sign_changed", name, value=-down, unit="N"),)


def _refuse_staying(extremes: Extremes, peak: float, name: str) -> None:
    """Raise InputError if a force, of a peak in N, does not return to its background."""
    if extremes.stays:
        refuse(
            f"{name}: the force does not return from its peak, {peak:.4g} N, to where it begins: "
            "peak hold, or a load that stays",
            "the force over time, with background before and after the contact",
        )


def check_peak(extremes: Extremes, scale: float, name: str, *, assumed: bool) -> tuple[Note, ...]:
    """Return warnings about a peak force; `scale` is N per value, with its sign.

    Raise InputError if the unit must be wrong, or an assumed unit may be.
    """
    low, high = PEAKS
    peak, opposite_peak = extremes.peak(scale), extremes.peak(-scale)
    allowed = f"{low:g} to {high:g} N for heavy/soft sources"
    if assumed and not low <= peak <= high:
        refuse(f"{name}: the values are without a unit and reach {peak:.4g}", f"{allowed}, or unit")
    if not low <= peak <= high and low <= opposite_peak <= high:
        _refuse_staying(extremes, max(peak, opposite_peak), name)
        refuse(
            f"{name}: the peaks are {-opposite_peak:.4g} N and {peak:.4g} N; the polarity is "
            "probably wrong",
            allowed,
        )
    for ratio, unit in ((THOUSAND, "kN"), (1 / THOUSAND, "mN")):
        if low <= peak * ratio <= high:
            refuse(
                f"{name}: the peak is {peak:.4g} N: too {'low' if ratio > 1 else 'high'} for a "
                f"drop, or the values are {unit}",
                f"{allowed}; unit = {unit!r}, or a calibration",
            )
    if not low / MAX_FACTOR <= peak <= high * MAX_FACTOR:
        refuse(f"{name}: the peak is {peak:.4g} N; unit or calibration is wrong", allowed)
    notes: tuple[Note, ...] = ()
    if not low <= peak <= high:
        notes += (Note("peak_unusual", name, peak, low, high, "N"),)
    if opposite_peak > MIN_PEAK_RATIO * peak:
        opposite = {"opposite": -opposite_peak}
        notes += (Note("polarity_doubtful", name, peak, unit="N", others=opposite),)
    return notes
