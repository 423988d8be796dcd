"""Recordings as tables of numbers."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.channel import MIN_SAMPLES, Channel
from thud.recordings.date_times import DAY, are_days, step_of_date_times
from thud.recordings.header_aliases import DATE, find_rate, find_word
from thud.recordings.signal import read_array
from thud.recordings.table import read_table
from thud.recordings.uniform_grid import uniform_grid

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

# Relative tolerance between the rate in the header and the rate of the times.
SAME_RATE = 0.01


def read_channels(path: Path) -> list[Channel]:
    """Return the columns of numbers of a text file except the times."""
    table = read_table(path)
    columns, name = list(table.columns), table.name
    rows = len(columns[0].values)
    if rows < MIN_SAMPLES:
        count = f"{rows} rows of {len(columns)} numbers"
        refuse(f"{name}: {count}", f"{MIN_SAMPLES} rows or more of numbers")
    rate = find_rate(table.header, table.decimal)
    time = next((column for column in columns if column.is_time), None)
    if time is None and table.clock is None and len(columns) > 1 and not columns[0].unit:
        first = columns[0]
        time = first if rate is None or _are_times(first.values) else None
    step = None
    notes: tuple[Note, ...] = ()
    if time is not None and (len(columns) > 1 or table.clock is not None):
        columns.remove(time)
        if not time.unit and are_days(time.values):
            step, notes = _date_time_step(time.values, DAY, name)
        else:
            _, step, notes = uniform_grid(time.to("s"), name)
    elif table.clock is not None:
        step, notes = _date_time_step(table.clock, 1.0, name)
    if step is not None:
        if rate is not None and abs(step * rate - 1) > SAME_RATE:
            refuse(
                f"{name}: {rate:.6g} Hz by its header and {1 / step:.6g} Hz by its times",
                "one sample rate",
            )
        rate = rate or 1 / step
    return [
        Channel(
            name=column.name,
            number=column.number,
            n_sample=rows,
            samples=partial(read_array, column.values),
            unit=column.unit,
            sample_rate=rate,
            date=find_word(table.header, DATE),
            notes=notes,
        )
        for column in columns
    ]


def _date_time_step(
    times: NDArray[np.float64], unit: float, name: str
) -> tuple[float | None, tuple[Note, ...]]:
    """Return the step of date-times, s, and notes; `unit` is that of the times, s."""
    step = step_of_date_times(times, name)
    if step is None:
        return None, (Note("date_times_coarse"),)
    return unit * step, (Note("date_times_rate", value=1 / (unit * step), unit="Hz"),)


def _are_times(column: NDArray[np.float64]) -> bool:
    """Whether a column without a title rises uniformly enough to be times."""
    rise = np.diff(column)
    return bool((rise > 0).all() and rise.max() < 2 * rise.min() + SAME_RATE * rise.mean())
