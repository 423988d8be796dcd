"""A force over time as arrays, taken as it is."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from thud.base.checks import refuse
from thud.recordings.grid import even_grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Minimum number of samples.
MIN_ROWS = 8
# No source of impacts comes near it, and its square is a number yet, N.
LARGEST_FORCE = 1e12


class Record(NamedTuple):
    """A force over time.

    Attributes
    ----------
    time : ndarray, shape (n_sample,)
        Time, s, evenly spaced.
    force : ndarray, shape (n_sample,)
        Force, N.
    sample_rate : float
        Samples per second, Hz.
    """

    time: NDArray[np.float64]
    force: NDArray[np.float64]
    sample_rate: float


def read_record(table: NDArray[np.float64], name: str = "record") -> Record:
    """Return the record of a table with the columns time, s, and force, N.

    Raises
    ------
    InputError
        Where it has fewer than eight samples, times that are not evenly spaced, or a force that is
        not mainly positive.
    """
    rows, columns = table.shape
    if rows < MIN_ROWS or columns != len(("time", "force")):
        refuse(
            f"{name}: {rows} rows of {columns} numbers",
            f"{MIN_ROWS} rows or more of time, s, and force, N",
        )
    if not np.isfinite(table).all():
        refuse(f"{name}: a value is not finite", "real numbers")
    time, force = table.T
    begin, step, _ = even_grid(time, name)
    if force.max() <= 0 and not force.min() < 0:
        refuse(f"{name}: the force is nowhere positive", "the force on the floor, N")
    if -force.min() > force.max():
        refuse(
            f"{name}: the force is mostly negative, {force.min():.4g} to {force.max():.4g} N",
            "the force on the floor, positive in compression (change its sign)",
        )
    if force.max() > LARGEST_FORCE:
        refuse(f"{name}: the force has a peak of {force.max():.4g} N", f"up to {LARGEST_FORCE:g} N")
    even = np.asarray(begin + np.arange(rows) * step, dtype=np.float64)
    return Record(even, force.copy(), 1 / step)
