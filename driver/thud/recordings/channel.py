"""One channel of a file in the unit of the file, before the conversion to a force."""

from __future__ import annotations

import os
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse, require_kind
from thud.base.errors import InputError
from thud.base.files import require_regular
from thud.base.note import Note
from thud.base.units import size_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

# Maximum size of files that are read as a whole, bytes.
MAX_IN_MEMORY = 2**27
# Maximum number of characters of a text or a path that are shown.
MAX_SHOWN = 200
MIB = 2**20
# Minimum number of samples of a recording.
MIN_SAMPLES = 8
# Maximum number of columns of a matrix of channels.
MAX_COLUMNS = 256
# Minimum and maximum sampling interval, s.
STEPS = (1e-9, 1e3)
# Deviations of times from a uniform grid, as fractions of the sampling interval: from the first on
# they are noted, and above the second one they are an error. Where a sample is missing, a time
# deviates by half an interval or more.
NOTED = 1e-3
TOLERANCE = 0.25


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
    samples : callable
        Returns the values in the file from index start to before stop, shape (stop - start,).
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
    samples: Callable[[int, int], NDArray[np.float64]]
    unit: str = ""
    sample_rate: float | None = None
    counts: float | None = None
    date: str = ""
    notes: tuple[Note, ...] = ()
    may_be_fractions: bool = False
    unapplied: str = ""

    @property
    def is_force(self) -> bool:
        """Whether its values are in a unit of force."""
        return size_of(self.unit)[0] == "N"

    @property
    def title(self) -> str:
        """Name for messages, or the number if it has none."""
        return shown_text(self.name) or f"channel {self.number}"


def rise_uniformly(values: NDArray[np.float64]) -> bool:
    """Whether values may be times: steps are positive, and differ by a factor of 2 at most."""
    with np.errstate(invalid="ignore"):  # infinite numbers
        rise = np.diff(values)
    return bool((rise > 0).all() and rise.max() <= 2.01 * rise.min())


def uniform_grid(time: NDArray[np.float64], name: str) -> tuple[float, float, tuple[Note, ...]]:
    """Return start and step, s, of the uniform grid that fits times best, and notes.

    Times, s, shape (n_sample,), may be rounded to a quarter of the step: at 44.1 kHz, the fifth
    decimal is half a step. Raise InputError if a time is off the grid, or the step is not allowed.
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
    begin = float(time.mean() + index[0] * step)
    if deviation[worst] <= NOTED:
        return begin, step, ()
    size = float(deviation[worst]) * step
    return begin, step, (Note("times_rounded", name, size, unit="s", others={"rate": 1 / step}),)


def shown_text(text: object) -> str:
    """Return text of a file or a library, or a path, for a message: printable, in one line.

    Of long texts both ends are shown.
    """
    line = " ".join(str(text).split())
    if len(line) > MAX_SHOWN:
        line = f"{line[: MAX_SHOWN // 2]} ... {line[-MAX_SHOWN // 2 :]}"
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in line)


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


def regular_file(path: str | os.PathLike[str]) -> Path:
    """Return a path; raise InputError if it is no readable regular file (a pipe could block)."""
    require_kind("path", path, str | os.PathLike)
    file = Path(path)
    try:
        require_regular(file)
        file.open("rb").close()
    except (OSError, ValueError) as error:  # a zero byte
        reason = getattr(error, "strerror", "no path")
        refuse(f"{shown_text(file)}: cannot be read ({reason})", "a file that can be read", error)
    return file


def require_small(path: Path, kind: str, limit: int = MAX_IN_MEMORY) -> None:
    """Raise InputError if a file that is read as a whole is too large."""
    size = path.stat().st_size
    if size > limit:
        refuse(
            f"{shown_text(path)}: {size / MIB:.0f} MiB of {kind}, which is read as a whole",
            f"up to {limit // MIB} MiB; longer recordings as WAV, RF64, FLAC, HDF5 or TDMS",
        )
