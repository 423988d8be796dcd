"""Times of samples on a uniform grid, times of day, dates, and records of force over time."""

from __future__ import annotations

import re
from datetime import datetime
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.channel import MIN_SAMPLES

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Minimum and maximum sampling interval, s.
STEPS = (1e-9, 1e3)
# Tolerances of any times, and of rounded times, as fractions of the sampling interval.
TOLERANCE = 1e-3
ROUNDED_TOLERANCE = 0.25
# Relative tolerance between the rate in a header and the rate of the times, and of a step.
SAME_RATE = 0.01
# Approximate number of times from which the last digit is determined.
MAX_COUNTED = 2**16
# Significant decimal digits of a float.
FLOAT_DIGITS = 17
# Maximum force, N: its square is finite.
MAX_FORCE = 1e12
DATE = re.compile(r"\d{1,4}(?P<mark>[-./])\d{1,2}(?P=mark)\d{1,4}", re.ASCII)
# 10:15:30.25 or, in minutes and seconds as Excel shows them, 15:30.25, with or without a date.
CLOCK = re.compile(
    rf"(?:{DATE.pattern}(?:[ T]\s*|,\s+))?(?:(?P<hours>\d{{1,2}}):)??(?P<minutes>\d{{1,2}})"
    r":(?P<seconds>\d{2}(?:[.,]\d{1,9})?)\s*(?:[ap]m)?(?:Z|[-+]\d\d:?\d\d)?",
    re.IGNORECASE | re.ASCII,
)
DATE_FORMATS = ("%d.%m.%Y", "%Y/%m/%d", "%Y:%m:%d", "%d-%b-%y", "%d-%b-%Y", "%d %b %Y")
TIME_FORMATS = ("", " %H:%M:%S", " %H:%M")


class Record(NamedTuple):
    """Uniformly spaced times, s, and force, N, both of shape (n_sample,), and sample rate, Hz."""

    time: NDArray[np.float64]
    force: NDArray[np.float64]
    sample_rate: float


def rise_uniformly(values: NDArray[np.float64]) -> bool:
    """Whether values may be times: steps are positive, and differ by a factor of 2 at most."""
    with np.errstate(invalid="ignore"):  # infinite numbers
        rise = np.diff(values)
    return bool((rise > 0).all() and rise.max() < 2 * rise.min() + SAME_RATE * rise.mean())


def uniform_grid(time: NDArray[np.float64], name: str) -> tuple[float, float, tuple[Note, ...]]:
    """Return start and step, s, of the uniform grid that fits times best, and notes.

    Times, s, shape (n_sample,), may deviate by their rounding to the last written digit: at
    44.1 kHz, the sixth decimal is a twentieth of a step. Raise InputError if a time is off the
    grid, or the step is not allowed.
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
    # An odd stride samples all last digits.
    rounding = last_digit(time[:: len(time) // MAX_COUNTED | 1])
    allowed = max(TOLERANCE, min(ROUNDED_TOLERANCE, rounding / step))
    worst = int(np.argmax(deviation))
    if deviation[worst] > allowed:
        refuse(
            f"{name}: the times are not uniformly spaced: row {worst + 1}, {time[worst]:.9g} s, is "
            f"{deviation[worst]:.2g} steps of {step:.4g} s off a uniform grid",
            f"a constant step, within {allowed:.2g} steps",
        )
    begin = float(time.mean() + index[0] * step)
    if deviation[worst] <= TOLERANCE:
        return begin, step, ()
    rounded = Note("times_rounded", name, value=rounding, unit="s", others={"rate": 1 / step})
    return begin, step, (rounded,)


def last_digit(time: NDArray[np.float64]) -> float:
    """Return the unit of the last digit of times, s, by decimals or by significant digits."""
    size = np.abs(time)
    # Rounding error of numbers of this size.
    rounding = 4 * np.spacing(size.max())
    scale = 10.0 ** np.floor(np.log10(np.maximum(size, rounding)))
    largest = 0.0
    for unit in (np.full_like(scale, scale.max()), scale):
        for power in range(FLOAT_DIGITS):
            digit = unit * 10.0**-power
            if (np.abs(time - digit * np.rint(time / digit)) <= rounding).all():
                largest = max(largest, float(digit.max()))
                break
    return largest


def read_record(table: NDArray[np.float64], name: str = "record") -> Record:
    """Return the record of a table with the columns time, s, and force, N.

    Raise InputError if it has fewer than eight samples, times that are not uniformly spaced, or
    a force that is not mainly positive.
    """
    rows, columns = table.shape
    if rows < MIN_SAMPLES or columns != 2:  # noqa: PLR2004 - time and force
        refuse(
            f"{name}: {rows} rows of {columns} numbers",
            f"{MIN_SAMPLES} rows or more of time, s, and force, N",
        )
    if not np.isfinite(table).all():
        refuse(f"{name}: a value is not finite", "real numbers")
    time, force = table.T
    begin, step, _ = uniform_grid(time, name)
    if force.max() <= 0 and not force.min() < 0:
        refuse(f"{name}: the force is nowhere positive", "the force on the floor, N")
    if -force.min() > force.max():
        refuse(
            f"{name}: the force is mostly negative, {force.min():.4g} to {force.max():.4g} N",
            "the force on the floor, positive in compression (change its sign)",
        )
    if force.max() > MAX_FORCE:
        refuse(f"{name}: the force has a peak of {force.max():.4g} N", f"up to {MAX_FORCE:g} N")
    uniform = np.asarray(begin + np.arange(rows) * step, dtype=np.float64)
    return Record(uniform, force.copy(), 1 / step)


def seconds_of_day(cell: str) -> float | None:
    """Return the time in a cell, s, since midnight or the full hour; None if it holds none.

    >>> [seconds_of_day(cell) for cell in ("23.11.2026 01:00:02,5", "01:02.5")]
    [3602.5, 62.5]
    """
    match = CLOCK.fullmatch(cell)
    if match is None:
        return None
    seconds = float(match["seconds"].replace(",", "."))
    return 3600.0 * int(match["hours"] or 0) + 60.0 * int(match["minutes"]) + seconds


def read_date(text: str) -> datetime | None:
    """Return a date written in ISO 8601 or one of the other known formats; None if in none.

    >>> read_date("03.05.2024").date().isoformat()
    '2024-05-03'
    """
    line = " ".join(text.split())
    try:
        return datetime.fromisoformat(line).replace(tzinfo=None)
    except ValueError:
        pass
    for form in (date + time for date in DATE_FORMATS for time in TIME_FORMATS):
        try:
            return datetime.strptime(line, form)  # noqa: DTZ007 - files state no time zone
        except ValueError:
            continue
    return None
