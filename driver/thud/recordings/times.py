"""Times of samples on a uniform grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Minimum and maximum sampling interval, s.
STEPS = (1e-9, 1e3)
# Deviations of times from a uniform grid, as fractions of the sampling interval: from the first on
# they are noted, and above the second one they are an error. Where a sample is missing, a time
# deviates by half an interval or more.
NOTED = 1e-3
TOLERANCE = 0.25


def rise_uniformly(values: NDArray[np.float64]) -> bool:
    """Whether values may be times: steps are positive, and differ by a factor of 2 at most."""
    with np.errstate(invalid="ignore"):  # infinite numbers
        rise = np.diff(values)
    return bool((rise > 0).all() and rise.max() <= 2.01 * rise.min())


def uniform_grid(time: NDArray[np.float64], name: str) -> tuple[float, float, tuple[Note, ...]]:
    """Return start and step, s, of the uniform grid that fits times best, and notes.

    Times, s, shape (n_sample,), may be rounded to a quarter of the step: at 44.1 kHz, the fifth
    decimal is half a step. Raise InputError if a time is off the grid, or the step is not allowed.
    """
    if not np.isfinite(time).all():
        refuse(f"{name}: a time is not finite", "real numbers, s")
    index = np.arange(len(time)) - (len(time) - 1) / 2
    with np.errstate(over="ignore", invalid="ignore"):
        step = float(index @ time / (index @ index))
    minimum, maximum = STEPS
    if not minimum <= step <= maximum:
        refuse(
            f"{name}: the times rise by {step:.4g} s from row to row",
            f"{minimum:g} to {maximum:g} s",
        )
    deviation = np.abs(time - time.mean() - index * step) / step
    worst = int(np.argmax(deviation))
    if deviation[worst] > TOLERANCE:
        refuse(
            f"{name}: the times are not uniformly spaced: row {worst + 1}, {time[worst]:.9g} s, is "
            f"{deviation[worst]:.2g} steps of {step:.4g} s off a uniform grid",
            f"a constant step, within {TOLERANCE:g} steps",
        )
    begin = float(time.mean() + index[0] * step)
    if deviation[worst] <= NOTED:
        return begin, step, ()
    size = float(deviation[worst]) * step
    return begin, step, (Note("times_rounded", name, size, unit="s", others={"rate": 1 / step}),)
