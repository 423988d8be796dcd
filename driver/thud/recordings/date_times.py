"""Columns of date and time, as spreadsheets write them, as times of samples."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.recordings.uniform_grid import ROUNDED_TOLERANCE, TOLERANCE, last_digit

if TYPE_CHECKING:
    from numpy.typing import NDArray

DATE = r"\d{1,4}(?P<mark>[-./])\d{1,2}(?P=mark)\d{1,4}"
# 10:15, 10:15:30.25 or, in minutes and seconds as Excel shows them, 15:30.25.
DATE_TIME = re.compile(
    rf"(?:{DATE}(?:[ T]\s*|,\s+))?(?:(?P<hours>\d{{1,2}}):)??(?P<minutes>\d{{1,2}})"
    r":(?P<seconds>\d{2}(?:[.,]\d{1,9})?)\s*(?P<half>[ap]m)?(?:Z|[-+]\d\d:?\d\d)?",
    re.IGNORECASE | re.ASCII,
)
DAY, HOUR = 86_400.0, 3600.0
# Days since 1899-12-30, as Excel counts them, from 1954 to 2119, that rise by less than MAX_STEP
# from row to row: as seconds they would give a rate above 10 MHz.
DAYS = (20_000.0, 80_000.0)
MAX_STEP = 1e-7


def is_date(cell: str) -> bool:
    """Whether a cell holds a date without a time."""
    return bool(re.fullmatch(DATE, cell, re.ASCII))


def seconds_of_day(cell: str) -> float | None:
    """Return the time of day in a cell, s; None if it holds none.

    >>> [seconds_of_day(cell) for cell in ("23.11.2026 01:00:02,5", "01:02.5", "1:02 PM")]
    [3602.5, 62.5, 46920.0]
    """
    match = DATE_TIME.fullmatch(cell)
    if match is None:
        return None
    minutes, seconds = int(match["minutes"]), float(match["seconds"].replace(",", "."))
    if match["hours"] is not None:
        minutes += 60 * int(match["hours"])
    elif match["seconds"].isdigit():
        # Without seconds: hours and minutes.
        minutes, seconds = 60 * minutes + int(seconds), 0.0
    half = (match["half"] or "").lower()
    if half:
        minutes = minutes % 720 + 720 * (half == "pm")
    return 60.0 * minutes + seconds


def continued(times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return times of day, s, that continue to rise after midnight, or after an hour."""
    fall = np.diff(times, prepend=times[0])
    added = np.select([fall < -DAY / 2, fall < -HOUR / 2], [DAY, HOUR], 0.0)
    return np.asarray(times + np.cumsum(added))


def are_days(times: NDArray[np.float64]) -> bool:
    """Whether numbers are days, as Excel counts them, at the rate of a recording."""
    step = (times[-1] - times[0]) / (len(times) - 1)
    return bool(DAYS[0] < times[0] < times[-1] < DAYS[1] and step < MAX_STEP)


def step_of_date_times(times: NDArray[np.float64], name: str) -> float | None:
    """Return the step of times in any unit; None if they are rounded too coarsely to show it.

    Raise InputError if they are not uniformly spaced.
    """
    index = np.arange(len(times)) - (len(times) - 1) / 2
    step = float(index @ (times - times[0]) / (index @ index))
    deviation = np.abs(times - times.mean() - index * step)
    rounding = last_digit(times)
    worst = int(np.argmax(deviation))
    # Days since 1899 are rounded to a microsecond by their floats.
    allowed = max(1.01 * rounding, TOLERANCE * step, 2 * np.spacing(times.max()))
    if step < 0 or deviation[worst] > allowed:
        refuse(
            f"{name}: the date-times are not uniformly spaced at row {worst + 1}",
            "a constant step, or a table without this column, and sample_rate",
        )
    is_exact = deviation[worst] <= TOLERANCE * step
    return step if is_exact or rounding <= ROUNDED_TOLERANCE * step else None
