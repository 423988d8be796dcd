"""Times of samples as an even grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Minimum and maximum sampling interval, s.
STEPS = (1e-9, 1e3)
# Fractions of the sampling interval by which any times, and rounded times, may miss an even grid.
JITTER = 1e-3
ROUNDED = 0.25
# Times whose digits are counted, more or less.
LOOKED_AT = 2**16
# Significant decimal digits of a float.
DIGITS = 17


def even_grid(time: NDArray[np.float64], name: str) -> tuple[float, float, tuple[str, ...]]:
    """Return start and step, s, of the even grid that fits times best, and what was done.

    Times, s, shape (n_sample,), may miss it by their rounding to the last written digit: at
    44.1 kHz, the sixth decimal is a twentieth of a step.

    Raises
    ------
    InputError
        Names the time that misses the grid, or the step that is not allowed.
    """
    if not np.isfinite(time).all():
        refuse(f"{name}: a time is not finite", "real numbers, s")
    place = np.arange(len(time)) - (len(time) - 1) / 2
    with np.errstate(over="ignore", invalid="ignore"):
        step = float(place @ time / (place @ place))
    minimum, maximum = STEPS
    if not minimum <= step <= maximum:
        refuse(
            f"{name}: the times rise by {step:.4g} s from row to row",
            f"{minimum:g} to {maximum:g} s",
        )
    miss = np.abs(time - time.mean() - place * step) / step
    # An odd stride meets all digits.
    digit = last_digit(time[:: len(time) // LOOKED_AT | 1])
    allowed = max(JITTER, min(ROUNDED, digit / step))
    worst = int(np.argmax(miss))
    if miss[worst] > allowed:
        refuse(
            f"{name}: the times are not evenly spaced: row {worst + 1}, {time[worst]:.9g} s, is "
            f"{miss[worst]:.2g} steps of {step:.4g} s off an even grid",
            f"one sampling rate, to {allowed:.2g} steps",
        )
    begin = float(time.mean() + place[0] * step)
    if miss[worst] <= JITTER:
        return begin, step, ()
    done = (
        f"The times, rounded to {digit:.1g} s, were replaced by an even grid of {1 / step:.7g} Hz."
    )
    return begin, step, (done,)


def last_digit(time: NDArray[np.float64]) -> float:
    """Return the unit of the last digit of times, s, by decimals or by significant digits."""
    size = np.abs(time)
    # Rounding error of numbers of this size.
    rounding = 4 * np.spacing(size.max())
    scale = 10.0 ** np.floor(np.log10(np.maximum(size, rounding)))
    worth = 0.0
    for unit in (np.full_like(scale, scale.max()), scale):
        for power in range(DIGITS):
            digit = unit * 10.0**-power
            if (np.abs(time - digit * np.rint(time / digit)) <= rounding).all():
                worth = max(worth, float(digit.max()))
                break
    return worth
