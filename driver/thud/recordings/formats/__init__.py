"""Formats of recordings: the channels that they read, and a table that identifies them.

Each is a module of this package.
"""

from __future__ import annotations

import importlib
import re
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from thud.base.checks import refuse, shown_text
from thud.base.errors import InputError
from thud.base.note import Note

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    Samples = NDArray[np.float64] | Callable[[int, int], NDArray[np.float64]]

# Number of bytes from which the format is identified.
HEAD = 4096
# Minimum number of samples of a recording.
MIN_SAMPLES = 8
# Minimum and maximum sampling interval, s.
STEPS = (1e-9, 1e3)
# Deviations of times from a uniform grid, as fractions of the sampling interval: from the first on
# they are noted, and above the second one they are an error. Where a sample is missing, a time
# deviates by half an interval or more.
NOTED = 1e-3
TOLERANCE = 0.25
# Relative tolerance between the sample rate in a header and that of the times.
SAME_RATE = 0.01


@dataclass(frozen=True, eq=False)
class Channel:
    """One channel of a file.

    Attributes
    ----------
    name : str
        Name in the file; empty if it has none.
    number : int
        Number of the channel, or of the column, from 1.
    n_sample : int
        Number of samples.
    samples : ndarray, shape (n_sample,), or callable
        The values in the file, or a function that reads them from an index to before another one.
    unit : str
        Unit of the values; ``"FS"`` for fractions of full scale, empty if unknown.
    sample_rate : float or None
        Samples per second, Hz; None if unknown.
    counts : float or None
        Counts at full scale if the values are integers, else None.
    date : str
        Date of the measurement, or empty.
    notes : tuple of Note
        Processing when the file was read.
    may_be_fractions : bool
        Whether values without a unit may be fractions of full scale, as those of float audio.
    unapplied : str
        Factor or offset in the file, such as ``"gain = 10"``, of which it is not known whether the
        values were multiplied by it; empty if there is none.
    """

    name: str
    number: int
    n_sample: int
    samples: Samples
    unit: str = ""
    sample_rate: float | None = None
    counts: float | None = None
    date: str = ""
    notes: tuple[Note, ...] = ()
    may_be_fractions: bool = False
    unapplied: str = ""

    @property
    def title(self) -> str:
        """Name for messages, or the number if it has none."""
        return shown_text(self.name) or f"channel {self.number}"


class Format(NamedTuple):
    """A format: name, module that reads it, suffixes, and pattern of the first bytes."""

    name: str
    module: str
    suffixes: tuple[str, ...]
    pattern: bytes


# A MATLAB file of version 4 begins with integers: type (kind and precision of numbers; 1000 more if
# they are big-endian), rows, columns, imaginary part, length of the name. A universal file begins
# with the mark -1 and the number of a data set. Text is UTF-16 with a mark, or without zero bytes.
FORMATS = (
    Format("WAV", "audio", (".wav", ".rf64", ".bwf"), rb"(RIFF|RF64).{4}WAVE"),
    Format("FLAC", "audio", (".flac",), rb"fLaC"),
    Format("TDMS", "tdms", (".tdms",), rb"TDSm"),
    Format("HDF5", "hdf5", (".h5", ".hdf5", ".hdf", ".nc", ".nc4"),
           rb"(.{512}|.{1024}|.{2048})?\x89HDF\r\n\x1a\n"),
    Format("MATLAB", "matlab", (".mat",),
           rb".{124}(\x00\x01IM|\x01\x00MI)"
           rb"|[\x00-\x34]\x00{3}.{8}[\x00\x01]\x00{3}[\x02-\x40]\x00{3}"
           rb"|\x00{2}[\x03\x04].{9}\x00{3}[\x00\x01]\x00{3}[\x02-\x40]"),
    Format("universal", "universal", (".uff", ".unv", ".uf"), rb"\s*-1 *\r?\n *\d+ *b?"),
    Format("text", "text", (".csv", ".tsv", ".txt", ".asc", ".dat", ".lvm", ".prn"),
           rb"\xff\xfe|\xfe\xff|[^\x00]+\Z"),
)  # fmt: skip
# First bytes of files that are not supported, and what is needed instead.
UNSUPPORTED = {
    b"BW64": "RF64 or WAV, to which `ffmpeg -i OLD.wav -c copy NEW.wav` converts BW64",
    b"CDF": "NetCDF 4, to which `nccopy -k nc4` converts this older NetCDF",
    b"PK\x03\x04": "the file that is in this archive, or the table saved as CSV",
    b"\x1f\x8b": "the file that is in this archive",
    b"\xd0\xcf\x11\xe0": "the table saved as CSV",
}


def read_channels(path: Path) -> list[Channel]:
    """Return the channels of a file; its content determines the format.

    Raise InputError if the format is unknown or the file is damaged.
    """
    with guarded(path, "data"), path.open("rb") as file:
        head = file.read(HEAD)
    name = shown_text(path)
    if not head:
        refuse(f"{name}: is empty", "a recording")
    actual = next((entry for entry in FORMATS if re.match(entry.pattern, head, re.DOTALL)), None)
    expected = next((entry for entry in FORMATS if path.suffix.lower() in entry.suffixes), None)
    advice = next((text for start, text in UNSUPPORTED.items() if head.startswith(start)), None)
    if advice:
        refuse(f"{name}: is of a format that is not supported", advice)
    if actual is None or (actual.module == "text" and expected not in {None, actual}):
        kinds = ", ".join(entry.name for entry in FORMATS)
        reason = f"is no {expected.name} file" if expected else "is of no known format"
        refuse(f"{name}: {reason} according to its first bytes", f"{kinds} files")
    module = importlib.import_module(f"{__name__}.{actual.module}")
    with guarded(path, actual.name):
        channels: list[Channel] = module.read_channels(path)
        return channels


@contextmanager
def guarded(path: Path, kind: str) -> Iterator[None]:
    """Convert any error of a library to InputError."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # noqa: BLE001 - libraries raise anything on damaged files
        # soundfile repeats the path.
        reason = shown_text(str(error).rpartition("': ")[2]) or type(error).__name__
        refuse(
            f"{shown_text(path)}: cannot be read as {kind} ({reason})",
            f"a complete, undamaged {kind} file",
            error,
        )


def rises(values: NDArray[np.float64]) -> bool:
    """Whether values may be times: each is larger than the one before it."""
    return bool((values[1:] > values[:-1]).all())


def uniform_grid(
    time: NDArray[np.float64], name: str, stated: float | None = None
) -> tuple[float, float, float, tuple[Note, ...]]:
    """Return start and step, s, of the uniform grid that fits times best, its rate, Hz, and notes.

    Times, s, shape (n_sample,), may be rounded to a quarter of the step: at 44.1 kHz, the fifth
    decimal is half a step. A stated rate replaces that of the times. Raise InputError if a time is
    off the grid, the step is not allowed, or the rates differ.
    """
    if not np.isfinite(time).all():
        refuse(f"{name}: a time is not finite", "real numbers, s")
    index = np.arange(len(time)) - (len(time) - 1) / 2
    with np.errstate(over="ignore", invalid="ignore"):
        step = float(index @ time / (index @ index))
    minimum, maximum = STEPS
    if not minimum <= step <= maximum:
        refuse(
            f"{name}: the times rise by {step:.4g} s from row to row",
            f"{minimum:g} to {maximum:g} s",
        )
    deviation = np.abs(time - time.mean() - index * step) / step
    worst = int(np.argmax(deviation))
    if deviation[worst] > TOLERANCE:
        refuse(
            f"{name}: the times are not uniformly spaced: row {worst + 1}, {time[worst]:.9g} s, is "
            f"{deviation[worst]:.2g} steps of {step:.4g} s off a uniform grid",
            f"a constant step, within {TOLERANCE:g} steps",
        )
    if stated is not None and abs(stated * step - 1) > SAME_RATE:
        refuse(
            f"{name}: {stated:.6g} Hz by its header and {1 / step:.6g} Hz by its times",
            "one sample rate; times are in s if no unit is stated",
        )
    notes: tuple[Note, ...] = ()
    if deviation[worst] > NOTED:
        size, others = float(deviation[worst]) * step, {"rate": 1 / step}
        notes = (Note("times_rounded", name, 1e6 * size, unit="µs", others=others),)
    return float(time.mean() + index[0] * step), step, stated or 1 / step, notes
