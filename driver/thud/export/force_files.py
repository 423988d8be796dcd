"""Files of the blocked force of an impact or a recording for other programs."""

from __future__ import annotations

import hashlib
import io
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from thud.base.bridge import version
from thud.base.checks import refuse, require_kind, require_whole
from thud.base.display import Tabulated
from thud.base.files import replace_file, require_ending
from thud.base.note import Note
from thud.base.tables import csv_text
from thud.case.case import case_text
from thud.export.wav import wav_file
from thud.level.assessment import ImpactOrRecording
from thud.recordings.recording import Recording

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    from thud.base.display import Columns
    from thud.recordings.recording import ImpactResult

KINDS = {"floor": "force on the floor", "elastic": "elastic force"}
CONVENTION = (
    "F(f) = integral of F(t) exp(-i 2 pi f t) dt, N s, t = 0 at first touch; two-sided spectrum "
    "at f >= 0: F(-f) is the complex conjugate, the energy of a band is 2 * integral of |F|^2 df"
)


@dataclass(frozen=True, eq=False)
class BlockedForce(Tabulated):
    """Force of one drop on a rigid floor with its origin, for other programs.

    Attributes
    ----------
    name : str
        Name of the drop, also of its files.
    force : ndarray, shape (n_sample,)
        Force, N, positive in compression.
    sample_rate : float
        Samples per second, Hz.
    start : float
        Time of the first sample, s; first touch is at 0.
    kind : str
        ``"floor"`` or ``"elastic"``.
    origin : str
        Case or file of the force.
    checksum : str
        SHA-256 of the case as `thud.write_case` writes it, or of the file.
    date : str
        Date of the measurement; empty if unknown.
    notes : tuple of Note
        Processing of the force.
    """

    drawn_by: ClassVar[str] = "impact_figures.draw_blocked_force"

    is_curve = True
    name: str
    force: NDArray[np.float64]
    sample_rate: float
    start: float
    kind: str
    origin: str
    checksum: str
    date: str = ""
    notes: tuple[Note, ...] = ()

    @property
    def time(self) -> NDArray[np.float64]:
        """Time since first touch, s, shape (n_sample,)."""
        return self.start + np.arange(len(self.force)) / self.sample_rate

    def spectrum(self) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        """Return frequencies, Hz, and the transform ∫ F exp(-i 2π f t) dt, N s, of the force.

        Time is 0 at first touch. The frequencies, shape (n_frequency,), range from 0 to half the
        sample rate in steps of at most 1 Hz. The force is assumed to be band-limited to half the
        sample rate, so that the integral is the sum of the samples divided by the rate.
        """
        count = max(math.ceil(self.sample_rate), len(self.force))
        frequency = np.fft.rfftfreq(count, 1 / self.sample_rate)
        shift = np.exp(-2j * np.pi * frequency * self.start)
        spectrum: NDArray[np.complex128] = np.fft.rfft(self.force, count) / self.sample_rate * shift
        return frequency.astype(np.float64), spectrum

    def header_lines(self) -> tuple[str, ...]:
        """Return the lines of the header, which describes the force."""
        lines = (
            f"Blocked force of {self.name}: {KINDS[self.kind]}, N, positive into the floor",
            f"{len(self.force)} samples, first sample at {self.start!r} s since first touch",
            f"Sample rate: {self.sample_rate:.10g} Hz",
            f"Origin: {self.origin}",
            f"SHA-256: {self.checksum}",
            *map(str, self.notes),
            f"Written by thud {version()}",
        )
        # Names of files may not be UTF-8, and notes of a laboratory may have several lines.
        texts = (line.encode("utf-8", "replace").decode() for line in lines)
        return tuple(" ".join(text.split()) for text in texts)

    def __repr__(self) -> str:
        """Return name, peak and duration."""
        duration = 1e3 * len(self.force) / self.sample_rate
        return f"<BlockedForce {self.name}: peak {self.force.max():.0f} N, {duration:.1f} ms>"

    def columns(self) -> Columns:
        """Return the force over time since first touch."""
        return {"time, s": (self.time, ".5f"), "force, N": (self.force, "z.1f")}

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the force to a file, replacing an existing file.

        Parameters
        ----------
        path
            Path of the file, which ends with ``.wav``, ``.csv`` or ``.mat``; a table of the
            spectrum ends with ``_spectrum.csv``.

        Raises
        ------
        InputError
            If the ending is not known, the format cannot represent the force, or `path` is the
            recording of the force.
        OSError
            If the file cannot be written.
        """
        file = Path(path)
        name = require_ending(path, *(ending for ending, _ in EXPORTS.values())).name.lower()
        kinds = [kind for kind, (ending, _) in EXPORTS.items() if name.endswith(ending)]
        if file.is_file() and hashlib.sha256(file.read_bytes()).hexdigest() == self.checksum:
            refuse(f"{path} is the recording of the force", "another path")
        replace_file(path, EXPORTS[kinds[-1]][1](self))


def blocked_force(source: ImpactResult, *, drop: int = 1) -> BlockedForce:
    """Return the assessed force of a drop; that of a recording is zero before and after contact.

    Parameters
    ----------
    source
        Impact or recording.
    drop
        Number of the drop in a recording, from 1.

    Raises
    ------
    InputError
        If the drop does not exist.
    """
    require_kind("source", source, ImpactOrRecording)
    if isinstance(source, Recording):
        return _of_recording(source, drop)
    require_whole("drop", drop, 1, 1)
    case = source.case
    model = case.model.name if case.model else ""
    return BlockedForce(
        name=case.name,
        force=source.force(),
        sample_rate=source.sample_rate,
        start=float(source.time[0] - source.touch_time),
        kind=source.assessed_force(),
        origin=f"case {case.name}, model {model}, drop height {case.drop.height:g} m",
        checksum=hashlib.sha256(case_text(case)).hexdigest(),
    )


def _of_recording(recording: Recording, number: int) -> BlockedForce:
    """Return the force of a measured drop within its gate."""
    require_whole("drop", number, 1, len(recording.drops))
    origin = [entry for entry in recording.origins for _ in range(entry.drops)][number - 1]
    drop = recording.drops[number - 1]
    first, stop = drop.gate
    return BlockedForce(
        name=recording.name + f"_drop_{number}" * (len(recording.drops) > 1),
        force=drop.force[first:stop],
        sample_rate=drop.sample_rate,
        start=float(drop.time[first]),
        kind=recording.assessed_force(),
        origin=f"recording {drop.name}, {origin.calibration or 'calibration not known'}",
        checksum=origin.checksum,
        date=origin.date,
        notes=(
            *(note for note in drop.notes if not note.is_warning),
            Note("noise_remains", value=drop.noise, unit="N"),
        ),
    )


def _wav(force: BlockedForce) -> bytes:
    """Return a WAV file of 32-bit floats, fractions of full scale, with the header as its comment.

    Full scale is a power of two in newtons, so that scaling is exact; the comment states it. Raise
    InputError if the sample rate is not a whole number.
    """
    rate = round(force.sample_rate)
    if rate != force.sample_rate:
        refuse(
            f"{force.name}: WAV cannot hold a sample rate of {force.sample_rate!r} Hz",
            "whole numbers of Hz, such as &sampling: sample_rate of a case",
        )
    peak = float(np.abs(force.force).max())
    scale = 2.0 ** math.ceil(math.log2(peak)) if peak > 0 else 1.0
    first = f"Scale: {scale:g} N per full scale (calibration = {scale:g})"
    return wav_file(force.force / scale, rate, "; ".join((first, *force.header_lines())))


def _csv(force: BlockedForce) -> bytes:
    """Return a table of time, s, and force, N, in full precision."""
    return _table(force.header_lines(), {"time_s": force.time, "force_N": force.force})


def _mat(force: BlockedForce) -> bytes:
    """Return a MATLAB file, version 5: time, force, spectrum and their description."""
    import scipy.io

    frequency, spectrum = force.spectrum()
    content = io.BytesIO()
    scipy.io.savemat(
        content,
        {
            "time_s": force.time,
            "force_N": force.force,
            "sample_rate_Hz": force.sample_rate,
            "frequency_Hz": frequency,
            "spectrum_Ns": spectrum,
            "about": "\n".join([*force.header_lines(), f"Spectrum: {CONVENTION}"]),
        },
        oned_as="column",
    )
    return content.getvalue()


def _spectrum(force: BlockedForce) -> bytes:
    """Return a table of the complex spectrum; see `BlockedForce.spectrum`."""
    frequency, spectrum = force.spectrum()
    columns = {
        "frequency_Hz": frequency,
        "real_Ns": spectrum.real,
        "imaginary_Ns": spectrum.imag,
        "magnitude_Ns": np.abs(spectrum),
        "phase_rad": np.angle(spectrum),
    }
    return _table((*force.header_lines(), f"Spectrum: {CONVENTION}"), columns)


# End of the file name, and function that returns the content, by the option of the command.
EXPORTS = {
    "wav": (".wav", _wav),
    "csv": (".csv", _csv),
    "mat": (".mat", _mat),
    "spectrum": ("_spectrum.csv", _spectrum),
}


def _table(comments: tuple[str, ...], columns: dict[str, NDArray[np.float64]]) -> bytes:
    """Return comments, titles and columns as a table, in full precision."""
    rows = np.column_stack(list(columns.values())).tolist()
    header = "".join(f"# {line}\n" for line in comments)
    return (header + csv_text([[*columns], *rows])).encode()
