"""Records of force over time: those of tables, and of arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from thud.base.checks import refuse
from thud.recordings.formats import MIN_SAMPLES, uniform_grid

if TYPE_CHECKING:
    from thud.recordings.formats.text import Table
    from thud.studies.arrays import Array

# Maximum force, N: its square is finite.
MAX_FORCE = 1e12


class Record(NamedTuple):
    """Uniformly spaced times, s, and force, N, both of shape (n_sample,), and sample rate, Hz."""

    time: Array
    force: Array
    sample_rate: float


def time_and_force(table: Table) -> Array:
    """Return time, s, and force, N, shape (n_row, 2), of a table of two columns."""
    columns = table.columns
    if len(columns) != 2:  # noqa: PLR2004 - time and force
        count = f"{len(columns[0].values)} rows of {len(columns)} numbers"
        refuse(f"{table.name}: {count}", "two columns: time, s, and force, N")
    is_second = columns[1].is_time and not columns[0].is_time
    time, force = columns[::-1] if is_second else columns
    return np.column_stack([time.to("s"), force.to("N")])


def read_record(table: Array, name: str = "record") -> Record:
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
    begin, step, *_ = uniform_grid(time, name)
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
