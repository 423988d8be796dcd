"""Recordings as tables of numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thud.base.checks import refuse
from thud.base.immutable import freeze
from thud.recordings.formats import MIN_SAMPLES, Channel, agreed_rate, rise_uniformly, uniform_grid
from thud.recordings.table import read_table
from thud.recordings.words import DATE, find_rate, find_word

if TYPE_CHECKING:
    from pathlib import Path

    from thud.base.note import Note
    from thud.recordings.table import Column, Table


def read_channels(path: Path) -> list[Channel]:
    """Return the columns of numbers of a text file except the times."""
    table = read_table(path)
    rows = len(table.columns[0].values)
    if rows < MIN_SAMPLES:
        count = f"{rows} rows of {len(table.columns)} numbers"
        refuse(f"{table.name}: {count}", f"{MIN_SAMPLES} rows or more of numbers")
    rate = find_rate(table.header, table.decimal)
    time = _find_times(table, rate)
    notes: tuple[Note, ...] = ()
    if time is not None:
        step, notes = uniform_grid(time.to("s"), table.name)[1:]
        rate = agreed_rate(rate, 1 / step, table.name)
    date = find_word(table.header, DATE)
    return [
        Channel(c.name, c.number, rows, freeze(c.values), c.unit, rate, date=date, notes=notes)
        for c in table.columns
        if c is not time
    ]


def _find_times(table: Table, rate: float | None) -> Column | None:
    """Return the column of times, or None.

    Without a title or unit of times it is the first of the file, if it rises uniformly or no rate
    is stated.
    """
    first, *others = table.columns
    if not others:
        return None
    may_be = first.number == 1 and not first.unit
    may_be = may_be and (rate is None or rise_uniformly(first.values))
    return next((c for c in table.columns if c.is_time), first if may_be else None)
