"""A measured force, for comparison with models."""

from __future__ import annotations

import errno
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thud.errors import InputError
from thud.levels import force_exposure_levels

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

# Part of the largest force below which a recording counts as noise.
NOISE = 0.01
# Samples that a recording needs.
LEAST_ROWS = 8
# Part of the sampling interval by which the times of a recording may miss.
JITTER = 1e-3


@dataclass(frozen=True, eq=False)
class Recording:
    """Force of one impact as it was recorded.

    Attributes
    ----------
    time : ndarray, shape (n_sample,)
        Time since the force first passes 1 % of its largest value, s.
    record : ndarray, shape (n_sample,)
        Force, N.
    sample_rate : float
        Samples per second, Hz.
    """

    time: NDArray[np.float64]
    record: NDArray[np.float64]
    sample_rate: float

    @classmethod
    def from_csv(cls, path: str | os.PathLike[str]) -> Recording:
        """Read a file of two columns, time in s and force in N, with or without a header.

        Raises
        ------
        InputError
            Where the file is missing or does not hold at least eight evenly spaced samples.
        """
        return cls.from_arrays(read_table(path), str(path))

    @classmethod
    def from_arrays(cls, table: NDArray[np.float64], name: str = "recording") -> Recording:
        """Return the recording of a table with the columns time, s, and force, N."""
        rows, columns = table.shape
        if rows < LEAST_ROWS or columns != len(("time", "force")):
            message = (
                f"{name}: {rows} rows of {columns} numbers; allowed: {LEAST_ROWS} rows or more "
                "of time, s, and force, N"
            )
            raise InputError(message)
        if not np.isfinite(table).all():
            message = f"{name}: a value is not finite; allowed: real numbers"
            raise InputError(message)
        time, force = table.T
        step = (time[-1] - time[0]) / (rows - 1)
        if not step > 0 or np.abs(np.diff(time) - step).max() > JITTER * step:
            message = f"{name}: the times are not evenly spaced; allowed: one sampling rate"
            raise InputError(message)
        first = np.flatnonzero(force > NOISE * force.max())
        if force.max() <= 0:
            message = f"{name}: the force is nowhere positive; allowed: the force on the floor, N"
            raise InputError(message)
        return cls((np.arange(rows) - first[0]) * step, force.copy(), 1 / step)

    @property
    def touch_time(self) -> float:
        """Time of first touch, s: 0."""
        return 0.0

    @property
    def contact_time(self) -> float:
        """Time during which the force passes 1 % of its largest value, s."""
        above = np.flatnonzero(self.record > NOISE * self.record.max())
        return float((above[-1] - above[0] + 1) / self.sample_rate)

    @property
    def peak_force(self) -> float:
        """Largest force, N."""
        return float(self.record.max())

    @property
    def restitution(self) -> float:
        """Not known from one impact: NaN."""
        return float("nan")

    def force(self, kind: str = "floor") -> NDArray[np.float64]:  # noqa: ARG002 - there is one
        """Return the force, N, shape (n_sample,), whatever `kind` is asked for."""
        return self.record

    def levels(
        self, bands: str = "octave", method: str | None = None, force: str | None = None
    ) -> NDArray[np.float64]:
        """Return the force exposure levels, dB, shape (n_band,); see `Impact.levels`."""
        return force_exposure_levels(
            self.force(force or "floor"), self.sample_rate, bands, method or "exact"
        )


def read_table(path: str | os.PathLike[str]) -> NDArray[np.float64]:
    """Return the numbers of a file of columns with commas between, with or without a header.

    Raises
    ------
    InputError
        Where the file is missing or holds something else.
    """
    try:
        if not Path(path).is_file():  # to open a pipe could take for ever
            raise FileNotFoundError(errno.ENOENT, "no such regular file", str(path))
        text = Path(path).read_text(encoding="utf-8-sig")
        lines = [line for line in text.splitlines() if line.strip() and line[0] != "#"]
        if not any(map(_is_number, lines[0].split(","))):
            del lines[0]
        if not lines:
            message = "no numbers"
            raise ValueError(message)  # noqa: TRY301 - one sentence for all that is unreadable
        table = np.loadtxt(lines, delimiter=",", ndmin=2)
    except (IndexError, OSError, ValueError) as error:
        message = f"{path}: cannot be read ({error}); allowed: columns of time, s, and force, N"
        raise InputError(message) from error
    return table


def _is_number(word: str) -> bool:
    """Return whether a word is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True
