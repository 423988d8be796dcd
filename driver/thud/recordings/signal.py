"""One recorded channel as a force, or the sum of several; whether sign and peak are plausible."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse, require_number
from thud.base.immutable import Immutable, freeze
from thud.base.note import Note
from thud.level.levels import finite_array

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from thud.recordings.formats import Samples

# Range of sample rates, Hz.
RATES = (1.0, 1e9)
# Peak forces of heavy/soft sources, N: from drops of some centimeters to the tyre on stiff floors.
PEAKS = (300.0, 15000.0)
# Maximum factor beyond this range that a drop height can explain.
MAX_FACTOR = 20.0
# Factors by which a peak in another unit is wrong.
WRONG_UNITS = {"kN": 1000.0, "mN": 0.001}
# How channels of forces are chosen, for messages.
HINT = 'channels = "sum" for load cells under one plate, or channel = the force'
POLARITIES = {"positive": 1.0, "negative": -1.0}
# Minimum ratio of the peaks of both signs from which the sign is determined.
MIN_PEAK_RATIO = 1.5
# Minimum peak of a load cell of the opposite sign, as a fraction of the peak of the sum, that
# raises a warning.
MIN_OPPOSITE = 0.05
# Number of samples per read, and approximate number from which the background level is estimated.
BLOCK = 2**18
SAMPLED = 2**16


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
    samples : ndarray, shape (n_sample,), or callable
        The recorded values, or a function that reads them from a sample to before another one.
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
    samples: Samples = field(repr=False)
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
        values = finite_array(f"{name}: force", force)
        rate = require_number(f"{name}: sample_rate", sample_rate, *RATES, "Hz")
        return cls(name, "", rate, len(values), freeze(values.copy()))

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
        values = self.samples
        force = values(start, stop) if callable(values) else values[start:stop]
        force = force * self.scale
        if force.shape != (stop - start,):
            problem = f"{force.size} samples from sample {start}, {stop - start} expected"
            refuse(f"{self.name}: {problem}", "a file that is complete and does not change")
        if not np.isfinite(force).all():
            index = start + int(np.flatnonzero(~np.isfinite(force))[0])
            refuse(f"{self.name}: sample {index + 1} is not finite", "real numbers")
        return force


def add_signals(cells: Sequence[Signal], name: str) -> Signal:
    """Return the sum of signals of equal rate and length."""
    first = cells[0]
    notes: list[Note] = []
    known = [cell.calibration_uncertainty for cell in cells]
    for cell in cells:
        if (cell.n_sample, cell.sample_rate) != (first.n_sample, first.sample_rate):
            refuse(
                f"{cell.name}: {cell.n_sample} samples at {cell.sample_rate:g} Hz, "
                f"{first.n_sample} at {first.sample_rate:g} Hz in {first.name}",
                "channels that were recorded together",
            )
        common = [replace(note, subject=name) for note in cell.notes]
        notes += [note for note in common if note not in notes]
    return replace(
        first, name=name, samples=partial(_read_sum, tuple(cells)), scale=1.0, full_scale=None,
        calibration="; ".join(dict.fromkeys(cell.calibration for cell in cells)),
        # The reference of all calibrations is usually the same.
        calibration_uncertainty=None if None in known else max(value or 0.0 for value in known),
        notes=(*notes, Note("cells_added", name, len(cells))), cells=tuple(cells),
    )  # fmt: skip


def _read_sum(cells: tuple[Signal, ...], start: int, stop: int) -> NDArray[np.float64]:
    return np.asarray(np.sum([cell.read(start, stop) for cell in cells], axis=0))


def find_peaks(signal: Signal) -> tuple[float, float]:
    """Return the largest deviations of a force above and below its background level, N.

    Raise InputError if values are not finite or all equal.
    """
    low, high = np.inf, -np.inf
    stride = max(1, signal.n_sample // SAMPLED)
    thinned = []
    for start in range(0, signal.n_sample, BLOCK):
        block = signal.read(start, min(signal.n_sample, start + BLOCK))
        low, high = min(low, float(block.min())), max(high, float(block.max()))
        thinned.append(block[-start % stride :: stride].copy())
    if low == high:
        refuse(f"{signal.name}: all samples are {low:g}", "a recording of drops")
    thin = np.concatenate(thinned)
    edge = max(1, thin.size // 100)
    # If the pulse fills the record, the background is at one end only; with many drops, overall.
    levels = [float(np.median(section)) for section in (thin[:edge], thin[-edge:], thin)]
    middle = low + (high - low) / 2
    background = max(levels, key=lambda level: abs(level - middle))
    return high - background, background - low


def orient(signal: Signal, polarity: str | None = None) -> Signal:
    """Return a signal whose compression is positive, with notes on its peak and its load cells.

    With a stated polarity it is positive already. A single load cell may be lifted, so that the
    sum decides on the sign. Raise InputError if the sign is not clear, if the peak is impossible,
    or if all samples of the signal or of a load cell are equal.
    """
    notes: list[Note] = []
    up, down = find_peaks(signal)
    if not polarity and max(up, down) < MIN_PEAK_RATIO * min(up, down):
        problem = f"the sign is not clear, the peaks are {up:.4g} N and {-down:.4g} N"
        allowed = "polarity = 'positive' or 'negative', the sign of a compression"
        refuse(f"{signal.name}: {problem}", allowed, subject="polarity")
    if not polarity and down > up:
        notes.append(Note("sign_changed", signal.name, -down, unit="N"))
        cells = tuple(replace(cell, scale=-cell.scale) for cell in signal.cells)
        signal, up, down = replace(signal, scale=-signal.scale, cells=cells), down, up
    is_assumed = any(note.code == "unit_assumed" for note in signal.notes)
    notes += check_peak(up, down, signal.name, assumed=is_assumed)
    for cell in signal.cells:
        above, below = find_peaks(cell)
        if below > max(MIN_PEAK_RATIO * above, MIN_OPPOSITE * up):
            others: dict[str, float | str] = {"part": cell.name, "total": up}
            notes.append(Note("cell_sign", value=-below, unit="N", others=others))
    return replace(signal, notes=(*signal.notes, *notes))


def check_peak(peak: float, opposite: float, name: str, *, assumed: bool = False) -> list[Note]:
    """Return warnings about a peak force, N, and that of the opposite sign.

    Raise InputError if the unit must be wrong, or may be if it is `assumed`.
    """
    low, high = PEAKS
    notes = []
    if not low <= peak <= high:
        allowed = f"{low:g} to {high:g} N for heavy/soft sources"
        if assumed:
            unknown = f"{name}: the values are without a unit and reach {peak:.4g}"
            refuse(unknown, f"{allowed}, or unit")
        if low <= opposite <= high:
            cause = "the polarity is wrong, or the force does not return from its peak"
            refuse(f"{name}: the peaks are {-opposite:.4g} N and {peak:.4g} N; {cause}", allowed)
        if not low / MAX_FACTOR <= peak <= high * MAX_FACTOR:
            fitting = [unit for unit, size in WRONG_UNITS.items() if low <= peak * size <= high]
            mends = [f"unit = {unit!r}" for unit in fitting] + ["a calibration"]
            problem = f"{name}: the peak is {peak:.4g} N; unit or calibration is wrong"
            refuse(problem, f"{allowed}; {', or '.join(mends)}")
        notes.append(Note("peak_unusual", name, peak, low, high, "N"))
    if opposite > MIN_PEAK_RATIO * peak:
        others = {"opposite": -opposite}
        notes.append(Note("polarity_doubtful", name, peak, unit="N", others=others))
    return notes
