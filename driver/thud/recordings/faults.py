"""Faults of a pulse: clipped, cut off, doubled, or dropouts, of which short ones are repaired."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.drops import Window
    from thud.recordings.signal import Signal

# Minimum length of the background on either side, s and samples.
MIN_BACKGROUND = 1e-3
MIN_SAMPLES = 4
# The top is clipped if this many samples are equal, and the force half as many samples farther out
# is lower by more than MIN_FALL quantization steps. At a smooth top it is lower by 4.
MIN_CLIPPED = 4
MIN_FALL = 12.0
# Fraction of full scale from which a sample is clipped.
CLIPPED_FRACTION = 0.999
# Minimum jump into or out of the equal samples of a dropout, as a fraction of the peak force: no
# flank rises as much between two samples at 20 kHz.
MIN_JUMP = 0.04
# Minimum jump in quantization steps.
MIN_STEPS = 3.5
# Minimum number of equal samples of a dropout.
MIN_FROZEN = 3
# Maximum total length of dropouts that are repaired, s.
MAX_REPAIRED = 1e-3


def repair(window: Window) -> tuple[NDArray[np.float64], tuple[str, ...], tuple[str, ...]]:
    """Return the force with its dropouts filled, notes, and warnings.

    Raise InputError if the pulse is cut off, clipped or doubled, or has long dropouts.
    """
    rate, (first, stop), name = window.sample_rate, window.contact, window.name
    minimum = min_background(rate)
    if first < minimum or window.stop - window.start - stop < minimum:
        side = "starts" if first < minimum else "ends"
        refuse(
            f"{name}: the signal {side} within the pulse or less than 1 ms "
            f"{'before' if first < minimum else 'after'} it",
            "background of 1 ms or more, better 100 ms, before and after the contact",
        )
    for warning in window.warnings:
        if warning.startswith("two impacts"):
            refuse(f"{name}: {warning}", "one impact, with background before and after it")
    force = window.force
    refuse_clipped(window, force)
    return fill_dropouts(window, force)


def min_background(rate: float) -> int:
    """Return the minimum number of background samples on each side of a contact."""
    return max(math.ceil(MIN_BACKGROUND * rate), MIN_SAMPLES)


def _runs(force: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return first index and length of each run of equal values."""
    starts = np.flatnonzero(np.diff(force, prepend=np.nan) != 0)
    return starts, np.diff(np.append(starts, len(force)))


def refuse_clipped(window: Window, record: NDArray[np.float64]) -> None:
    """Raise InputError if the top of a recorded force, N, is clipped."""
    first, stop = window.contact
    force = record[first:stop]
    starts, lengths = _runs(force)
    top = force.max()
    at_top = force[starts] == top
    k = int(np.argmax(np.where(at_top, lengths, 0)))
    start, length = int(starts[k]), int(lengths[k])
    changes = np.abs(np.diff(force))
    step = changes[changes > 0].min(initial=np.inf)
    distance = max(length // 2, 1)
    neighbors = [
        force[max(start - distance, 0)],
        force[min(start + length - 1 + distance, len(force) - 1)],
    ]
    clipped = length >= MIN_CLIPPED and top - max(neighbors) > MIN_FALL * step
    if window.signal.full_scale is not None:
        at_scale = np.count_nonzero(force >= CLIPPED_FRACTION * window.signal.full_scale)
        clipped, length = clipped or at_scale > 1, max(length, int(at_scale))
    if clipped:
        refuse(
            f"{window.name}: the force is clipped at {top:.4g} N for "
            f"{1e3 * length / window.sample_rate:.3g} ms",
            "a measuring range that includes the peak",
        )


def fill_dropouts(
    window: Window, force: NDArray[np.float64], peak: float | None = None
) -> tuple[NDArray[np.float64], tuple[str, ...], tuple[str, ...]]:
    """Return the force with dropouts interpolated, notes, and warnings.

    A jump of a dropout is relative to the peak, N: that of the force, if None.
    """
    first, stop = window.contact
    rate = window.sample_rate
    margin = int(MIN_BACKGROUND * rate)
    first, stop = first + margin, stop - margin
    level = force - np.median(
        np.concatenate([force[: window.contact[0]], force[window.contact[1] :]])
    )
    pulse = level[first:stop]
    if not pulse.size:
        return force, (), ()
    starts, lengths = _runs(pulse)
    before = np.abs(pulse[starts] - pulse[np.maximum(starts - 1, 0)])
    ends = starts + lengths - 1
    after = np.abs(pulse[np.minimum(ends + 1, len(pulse) - 1)] - pulse[ends])
    limit = MIN_JUMP * (pulse.max() if peak is None else peak)
    limit = max(limit, MIN_STEPS * window.quantization.step)
    zero = (force[first:stop][starts] == 0) & (before > limit) & (after > limit)
    # A constant background next to a steep flank is no dropout: it has one jump.
    is_background = np.abs(pulse[starts]) < limit / 2
    jumps = (before > limit).astype(int) + (after > limit)
    frozen = (lengths >= MIN_FROZEN) & (jumps > is_background)
    lost = np.flatnonzero(zero | frozen)
    total = int(lengths[lost].sum())
    if not total:
        return force, (), ()
    summary = f"{len(lost)} dropouts of {1e3 * total / rate:.3g} ms in all"
    if total > MAX_REPAIRED * rate:
        refuse(f"{window.name}: the contact has {summary}", f"up to {1e3 * MAX_REPAIRED:g} ms")
    good = np.ones(len(force), dtype=bool)
    for k in lost:
        good[first + starts[k] : first + starts[k] + lengths[k]] = False
    filled = force.copy()
    index = np.arange(len(force))
    filled[~good] = np.interp(index[~good], index[good], force[good])
    return (
        filled,
        (f"{summary} were filled by linear interpolation",),
        (f"the contact has {summary}",),
    )


def read_repaired(
    signal: Signal, begin: int, repaired: NDArray[np.float64], start: int, stop: int
) -> NDArray[np.float64]:
    """Return a force, N, from start to before stop, with repaired samples from `begin` on."""
    force = signal.read(start, stop)
    first, last = max(start, begin), min(stop, begin + len(repaired))
    if first < last:
        force[first - start : last - start] = repaired[first - begin : last - begin]
    return force
