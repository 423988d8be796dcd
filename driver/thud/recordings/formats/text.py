"""Recordings as tables of numbers."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.errors import InputError
from thud.base.note import Note
from thud.recordings.channel import MIN_SAMPLES, Channel
from thud.recordings.signal import read_array
from thud.recordings.table import read_table
from thud.recordings.times import (
    ROUNDED_TOLERANCE,
    SAME_RATE,
    last_digit,
    rise_uniformly,
    uniform_grid,
)
from thud.recordings.words import DATE, find_rate, find_word

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from thud.recordings.table import Table


def read_channels(path: Path) -> list[Channel]:
    """Return the columns of numbers of a text file except the times."""
    table = read_table(path)
    rows = len(table.columns[0].values)
    if rows < MIN_SAMPLES:
        count = f"{rows} rows of {len(table.columns)} numbers"
        refuse(f"{table.name}: {count}", f"{MIN_SAMPLES} rows or more of numbers")
    rate = find_rate(table.header, table.decimal)
    times, number = _times(table, rate)
    notes: tuple[Note, ...] = ()
    if times is not None:
        try:
            _, step, notes = uniform_grid(times, table.name)
        except InputError:
            # Times of day may have too few digits to show the rate.
            if number or last_digit(times) <= ROUNDED_TOLERANCE * np.ptp(times) / (rows - 1):
                raise
            notes = (Note("times_coarse"),)
        else:
            if rate is not None and abs(step * rate - 1) > SAME_RATE:
                refuse(
                    f"{table.name}: {rate:.6g} Hz by its header and {1 / step:.6g} Hz by its times",
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
        for column in table.columns
        if column.number != number
    ]


def _times(table: Table, rate: float | None) -> tuple[NDArray[np.float64] | None, int]:
    """Return the times of a table, s, and the number of their column; zero for times of day.

    A column without a title is that of the times if it is the first and rises uniformly.
    """
    first, *others = table.columns
    time = next((column for column in table.columns if column.is_time), None)
    if time is None and table.clock is None and others and not first.unit:
        time = first if rate is None or rise_uniformly(first.values) else None
    if time is not None and (others or table.clock is not None):
        return time.to("s"), time.number
    return table.clock, 0
