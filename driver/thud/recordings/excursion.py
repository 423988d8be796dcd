"""Largest excursions of a channel: its sign, and whether they are forces of such a source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

# Peak forces of heavy/soft sources, N: from drops of some centimetres to the tyre on stiff floors.
PEAKS = (300.0, 15000.0)
# Outside by more than this, no drop height explains it.
BEYOND = 20.0
THOUSAND = 1000.0
POLARITIES = {"positive": 1.0, "negative": -1.0}
# The excursion that decides the sign is larger than the other by this.
CLEAR = 1.5
# Samples that are read at once, and that the quiet level is estimated from.
BLOCK = 2**18
SAMPLED = 2**16
# Share of a file at each end that shows the quiet level.
EDGE = 0.01


@dataclass(frozen=True)
class Excursions:
    """Minimum, maximum and quiet level of a channel, in its own unit."""

    low: float
    high: float
    quiet: float

    def peak(self, scale: float) -> float:
        """Return the largest excursion from the quiet level in the positive direction, N."""
        # Never -0.
        return max((self.high - self.quiet) * scale, (self.low - self.quiet) * scale) + 0.0


def scan(samples: Callable[[int, int], NDArray[np.float64]], count: int, name: str) -> Excursions:
    """Read a channel once; raise InputError where a value is not finite or all are equal."""
    low, high = np.inf, -np.inf
    stride = max(1, count // SAMPLED)
    some = []
    for start in range(0, count, BLOCK):
        stop = min(count, start + BLOCK)
        block = samples(start, stop)
        if block.shape != (stop - start,):
            refuse(f"{name}: is cut off at sample {start + block.size + 1}", "a complete file")
        least, most = float(block.min()), float(block.max())
        if not (np.isfinite(least) and np.isfinite(most)):
            place = start + int(np.flatnonzero(~np.isfinite(block))[0])
            refuse(f"{name}: sample {place + 1} is not finite", "real numbers")
        low, high = min(low, least), max(high, most)
        some.append(block[-start % stride :: stride].copy())
    if low == high:
        refuse(f"{name}: all samples are {low:g}", "a recording of drops")
    thin = np.concatenate(some)
    edge = max(1, int(EDGE * thin.size))
    # A record that the pulse fills is quiet at an end only, one of many drops on the whole.
    levels = [float(np.median(part)) for part in (thin[:edge], thin[-edge:], thin)]
    middle = low + (high - low) / 2
    return Excursions(low, high, max(levels, key=lambda level: abs(level - middle)))


def find_sign(
    seen: Excursions, scale: float, polarity: str | None, name: str
) -> tuple[float, tuple[str, ...]]:
    """Return the sign that makes a compression positive, and what was done."""
    # Polarity is that of the recorded values, whatever the sign of the calibration.
    if polarity is not None:
        sign = POLARITIES[polarity] * float(np.sign(scale))
        changed = f"The sign was changed: polarity = {polarity!r} was given."
        return sign, (changed,) if sign * scale < 0 else ()
    up, down = seen.peak(scale), seen.peak(-scale)
    if max(up, down) < CLEAR * min(up, down):
        refuse(
            f"{name}: the sign is not clear, the force goes {up:.4g} N up and {down:.4g} N down",
            "polarity = 'positive' or 'negative', the sign of a compression",
        )
    if up > down:
        return 1.0, ()
    return -1.0, (f"The sign was changed: the largest excursion, {-down:.4g} N, is negative.",)


def check_peak(seen: Excursions, scale: float, name: str, *, assumed: bool) -> tuple[str, ...]:
    """Return warnings about a peak force; `scale` is N per value, with its sign.

    Raise InputError where the unit must be wrong, also where it is only assumed.
    """
    low, high = PEAKS
    peak, other = seen.peak(scale), seen.peak(-scale)
    allowed = f"{low:g} to {high:g} N for heavy/soft sources"
    if assumed and not low <= peak <= high:
        refuse(f"{name}: the values are without a unit and reach {peak:.4g}", f"{allowed}, or unit")
    for ratio, likely in ((THOUSAND, "kN for N"), (1 / THOUSAND, "mN for N")):
        if low <= peak * ratio <= high:
            what = f"the peak is {peak:.4g} N; the unit is probably wrong, {likely}"
            refuse(f"{name}: {what}", allowed)
    if not low / BEYOND <= peak <= high * BEYOND:
        refuse(f"{name}: the peak is {peak:.4g} N; unit or calibration are wrong", allowed)
    warnings: tuple[str, ...] = ()
    if not low <= peak <= high:
        warnings += (f"The peak is {peak:.4g} N; usual are {allowed}.",)
    if other > CLEAR * peak:
        warnings += (
            f"The force goes {other:.4g} N down and {peak:.4g} N up; the polarity may be wrong.",
        )
    return warnings
