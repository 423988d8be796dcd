"""One recorded channel as a force."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse, require_array, require_number
from thud.base.immutable import Immutable

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from thud.base.note import Note

# Number of bytes of a file per read for the checksum.
BLOCK = 2**20


@dataclass(frozen=True, eq=False)
class Signal(Immutable):
    """Force of one channel of a file, N; only requested samples are read.

    Attributes
    ----------
    name : str
        Name of the file, and of the channel if there are several.
    path : str
        Path of the file; empty for an array.
    sample_rate : float
        Samples per second, Hz.
    n_sample : int
        Number of samples.
    full_scale : float or None
        Largest force that the sample format can hold, N; None if unknown.
    date : str
        Date of the measurement; empty if unknown.
    calibration : str
        Description of the calibration.
    calibration_uncertainty : float or None
        Relative standard uncertainty of the calibration; None if unknown.
    notes : tuple of Note
        Processing when the file was read, and possible faults; the subject is the name of the
        signal, or of one of its load cells.
    cells : tuple of Signal
        Load cells whose sum this is.
    samples : callable
        Returns the force, N, shape (stop - start,), of the samples from start to before stop.
    """

    name: str
    path: str
    sample_rate: float
    n_sample: int
    samples: Callable[[int, int], NDArray[np.float64]] = field(repr=False)
    full_scale: float | None = None
    date: str = ""
    calibration: str = ""
    calibration_uncertainty: float | None = None
    notes: tuple[Note, ...] = ()
    cells: tuple[Signal, ...] = ()

    @classmethod
    def from_array(cls, force: ArrayLike, sample_rate: float, name: str = "recording") -> Signal:
        """Return the signal of a force in memory, N, shape (n_sample,)."""
        values = require_array(f"{name}: force", force, (1,), "iuf")
        require_number(f"{name}: sample_rate", sample_rate)
        if not sample_rate > 0:
            refuse(f"{name}: sample_rate = {sample_rate:g}", "positive numbers, Hz")
        if not np.isfinite(values).all():
            refuse(f"{name}: a value is not finite", "real numbers")
        return cls(name, "", float(sample_rate), len(values), partial(read_array, values.copy()))

    def scaled(self, factor: float) -> Signal:
        """Return the signal, and those of its load cells, times a factor."""
        cells = tuple(cell.scaled(factor) for cell in self.cells)
        return replace(self, samples=partial(read_scaled, self.samples, factor, 0.0), cells=cells)

    @cached_property
    def checksum(self) -> str:
        """SHA-256 of the file, or of the values of an array, in hexadecimal digits."""
        digest = hashlib.sha256()
        if not self.path:
            digest.update(self.read(0, self.n_sample).tobytes())
            return digest.hexdigest()
        try:
            with Path(self.path).open("rb") as file:
                while block := file.read(BLOCK):
                    digest.update(block)
        except OSError as error:
            refuse(f"{self.name}: cannot be read ({error.strerror})", "a readable file", error)
        return digest.hexdigest()

    def read(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return the force of the samples from start to before stop, N, positive in compression.

        Raise InputError if the file has changed, is damaged, or holds non-finite values.
        """
        if not 0 <= start <= stop <= self.n_sample:
            refuse(f"{self.name}: samples {start} to {stop}", f"samples 0 to {self.n_sample}")
        force = self.samples(start, stop)
        if force.shape != (stop - start,):
            refuse(
                f"{self.name}: {force.size} samples from sample {start}, {stop - start} expected",
                "a file that is complete and does not change",
            )
        if not np.isfinite(force).all():
            index = start + int(np.flatnonzero(~np.isfinite(force))[0])
            refuse(f"{self.name}: sample {index + 1} is not finite", "real numbers")
        return force


def common_uncertainty(values: Sequence[float | None]) -> float | None:
    """Return the largest of relative uncertainties of signals, None if one is not known."""
    known = [value for value in values if value is not None]
    return max(known) if len(known) == len(values) else None


def read_scaled(
    samples: Callable[[int, int], NDArray[np.float64]],
    factor: float,
    offset: float,
    start: int,
    stop: int,
) -> NDArray[np.float64]:
    """Return samples from start to before stop times a factor, plus an offset."""
    return samples(start, stop) * factor + offset


def read_array(values: NDArray[np.float64], start: int, stop: int) -> NDArray[np.float64]:
    """Return a copy of the samples of an array from start to before stop."""
    return values[start:stop].copy()
