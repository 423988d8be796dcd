"""One recorded channel as a force, or the sum of several."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse, require_array, require_number
from thud.base.immutable import Immutable
from thud.base.note import Note

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray


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
    samples : callable
        Returns the recorded values, shape (stop - start,), of the samples from start to before
        stop.
    scale : float
        Force per recorded value, N, positive if positive values are compression.
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
    """

    name: str
    path: str
    sample_rate: float
    n_sample: int
    samples: Callable[[int, int], NDArray[np.float64]] = field(repr=False)
    scale: float = 1.0
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

    @cached_property
    def checksum(self) -> str:
        """SHA-256 of the file, or of the values of an array, in hexadecimal digits."""
        if not self.path:
            return hashlib.sha256(self.read(0, self.n_sample).tobytes()).hexdigest()
        try:
            with Path(self.path).open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:
            refuse(f"{self.name}: cannot be read ({error.strerror})", "a readable file", error)

    def read(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return the force of the samples from start to before stop, N, positive in compression.

        Raise InputError if the file has changed, is damaged, or holds non-finite values.
        """
        if not 0 <= start <= stop <= self.n_sample:
            refuse(f"{self.name}: samples {start} to {stop}", f"samples 0 to {self.n_sample}")
        force = self.samples(start, stop) * self.scale
        if force.shape != (stop - start,):
            refuse(
                f"{self.name}: {force.size} samples from sample {start}, {stop - start} expected",
                "a file that is complete and does not change",
            )
        if not np.isfinite(force).all():
            index = start + int(np.flatnonzero(~np.isfinite(force))[0])
            refuse(f"{self.name}: sample {index + 1} is not finite", "real numbers")
        return force


def add_signals(cells: Sequence[Signal], name: str) -> Signal:
    """Return the sum of signals of equal rate and length."""
    first = cells[0]
    notes: list[Note] = []
    for cell in cells:
        if (cell.n_sample, cell.sample_rate) != (first.n_sample, first.sample_rate):
            refuse(
                f"{cell.name}: {cell.n_sample} samples at {cell.sample_rate:g} Hz, "
                f"{first.n_sample} at {first.sample_rate:g} Hz in {first.name}",
                "channels that were recorded together",
            )
        common = [replace(note, subject=name) for note in cell.notes]
        notes += [note for note in common if note not in notes]
    return Signal(
        name,
        first.path,
        first.sample_rate,
        first.n_sample,
        partial(_read_sum, tuple(cells)),
        date=first.date,
        calibration="; ".join(dict.fromkeys(cell.calibration for cell in cells)),
        # The reference of all calibrations is usually the same.
        calibration_uncertainty=common_uncertainty([c.calibration_uncertainty for c in cells]),
        notes=(*notes, Note("cells_added", name, len(cells))),
        cells=tuple(cells),
    )


def common_uncertainty(values: Sequence[float | None]) -> float | None:
    """Return the largest of relative uncertainties of signals, None if one is not known."""
    known = [value for value in values if value is not None]
    return max(known) if len(known) == len(values) else None


def read_array(values: NDArray[np.float64], start: int, stop: int) -> NDArray[np.float64]:
    """Return the samples of an array from start to before stop."""
    return values[start:stop]


def _read_sum(cells: tuple[Signal, ...], start: int, stop: int) -> NDArray[np.float64]:
    return np.asarray(np.sum([cell.read(start, stop) for cell in cells], axis=0))
