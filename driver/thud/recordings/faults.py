"""Faults of a pulse: clipped, cut, doubled, with dropouts; short dropouts are repaired."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.drops import Window

# Minimum background on each side, s and samples.
MIN_BACKGROUND = 1e-3
MIN_SAMPLES = 4
# Equal samples at the top are clipped if they are this many and the force beside them falls by more
# than MIN_FALL quantization steps: a smooth top of this length falls by 4.
MIN_CLIPPED = 4
MIN_FALL = 12.0
# Fraction of the full scale from which a sample is clipped.
FULL = 0.999
# Minimum jump into or out of equal samples of a dropout, over the peak force: no flank rises by
# this much between two samples of 20 kHz.
MIN_JUMP = 0.04
# Minimum number of equal samples of a dropout.
MIN_HELD = 3
# Maximum total length of dropouts that are repaired, s.
MAX_REPAIRED = 1e-3


def repair(window: Window) -> tuple[NDArray[np.float64], tuple[str, ...], tuple[str, ...]]:
    """Return the force with its dropouts filled, what was done, and warnings.

    Raise InputError where the pulse is cut, clipped, doubled or has long dropouts.
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
    _refuse_clipped(window, force)
    return _fill(window, force)


def min_background(rate: float) -> int:
    """Return the minimum number of background samples on each side of a contact."""
    return max(math.ceil(MIN_BACKGROUND * rate), MIN_SAMPLES)


def _runs(force: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first indices and the lengths of the runs of equal values."""
    starts = np.flatnonzero(np.diff(force, prepend=np.nan) != 0)
    return starts, np.diff(np.append(starts, len(force)))


def _refuse_clipped(window: Window, whole: NDArray[np.float64]) -> None:
    """Raise InputError where the top of the pulse is flat."""
    first, stop = window.contact
    force = whole[first:stop]
    starts, lengths = _runs(force)
    top = force.max()
    at_top = force[starts] == top
    k = int(np.argmax(np.where(at_top, lengths, 0)))
    start, length = int(starts[k]), int(lengths[k])
    changes = np.abs(np.diff(force))
    step = changes[changes > 0].min(initial=np.inf)
    half = max(length // 2, 1)
    beside = [force[max(start - half, 0)], force[min(start + length - 1 + half, len(force) - 1)]]
    clipped = length >= MIN_CLIPPED and top - max(beside) > MIN_FALL * step
    if window.signal.full_scale is not None:
        at_scale = np.count_nonzero(force >= FULL * window.signal.full_scale)
        clipped, length = clipped or at_scale > 1, max(length, int(at_scale))
    if clipped:
        refuse(
            f"{window.name}: the force is clipped at {top:.4g} N for "
            f"{1e3 * length / window.sample_rate:.3g} ms",
            "a range that holds the peak",
        )


def _fill(
    window: Window, force: NDArray[np.float64]
) -> tuple[NDArray[np.float64], tuple[str, ...], tuple[str, ...]]:
    """Return the force with dropouts filled from both sides, what was done, and warnings."""
    first, stop = window.contact
    rate = window.sample_rate
    guard = int(MIN_BACKGROUND * rate)
    first, stop = first + guard, stop - guard
    level = force - np.median(
        np.concatenate([force[: window.contact[0]], force[window.contact[1] :]])
    )
    part = level[first:stop]
    if not part.size:
        return force, (), ()
    starts, lengths = _runs(part)
    before = np.abs(part[starts] - part[np.maximum(starts - 1, 0)])
    ends = starts + lengths - 1
    after = np.abs(part[np.minimum(ends + 1, len(part) - 1)] - part[ends])
    limit = MIN_JUMP * part.max()
    zero = (force[first:stop][starts] == 0) & (before > limit) & (after > limit)
    held = (lengths >= MIN_HELD) & ((before > limit) | (after > limit))
    lost = np.flatnonzero(zero | held)
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
    return filled, (f"{summary} were filled by lines",), (f"the contact has {summary}",)
