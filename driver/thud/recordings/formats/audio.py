"""WAV, RF64, BWF and FLAC by soundfile."""

from __future__ import annotations

import os
import struct
from functools import partial
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.channel import Channel, guarded, library, shown_path

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

# Counts at full scale by subtype, None for floats.
SUBTYPES = {
    "PCM_S8": 2.0**7, "PCM_U8": 2.0**7, "PCM_16": 2.0**15, "PCM_24": 2.0**23, "PCM_32": 2.0**31,
    "FLOAT": None, "DOUBLE": None,
}  # fmt: skip
# Length of a chunk whose true length is in the 64-bit table of an RF64 file, or unknown.
UNKNOWN = 0xFFFFFFFF
# Lengths that streams begin with, by ffmpeg, SoX and arecord, as they cannot go back to their head.
STREAMED = {UNKNOWN, 0x7FFFF000, 0x7FFFFF00}
# Maximum number of channels, and of chunks of a file.
MAX_CHANNELS = 1024
MAX_CHUNKS = 10000
# Maximum number of samples in a FLAC header; larger values mean that it is unknown.
MAX_FLAC = 2**36
# Bytes of date and time in a broadcast chunk.
DATE = slice(320, 330)
CLOCK = slice(330, 338)


def _read(path: Path, column: int, start: int, stop: int) -> NDArray[np.float64]:
    soundfile = library("soundfile", "WAV and FLAC")
    with guarded(path, "an audio file"), soundfile.SoundFile(os.fsencode(path)) as file:
        file.seek(start)
        block: NDArray[np.float64] = file.read(stop - start, dtype="float64", always_2d=True)
    return np.ascontiguousarray(block[:, column])


def read_channels(path: Path) -> list[Channel]:
    """Return the channels of an audio file; integers are fractions of full scale."""
    soundfile = library("soundfile", "WAV and FLAC")
    name = shown_path(path)
    with path.open("rb") as file:
        is_flac = file.read(4) == b"fLaC"
        date, notes = ("", ()) if is_flac else _read_chunks(file, name)
    with soundfile.SoundFile(os.fsencode(path)) as file:
        kind, count, columns = file.subtype, file.frames, file.channels
        rate = float(file.samplerate)
    if kind not in SUBTYPES:
        refuse(f"{name}: samples of the format {kind}", ", ".join(SUBTYPES))
    if columns > MAX_CHANNELS:
        refuse(f"{name}: {columns} channels", f"up to {MAX_CHANNELS}")
    # Without a length the library cannot seek, and a file that is cut off is not detectable.
    if is_flac and count >= MAX_FLAC:
        refuse(
            f"{name}: its header has no number of samples (written by a streaming encoder)",
            "FLAC files with their length; encode it again, as by `ffmpeg -i OLD.flac NEW.flac`",
        )
    # A FLAC file that is cut off lacks its last sample.
    if count < 1 or (is_flac and _read(path, 0, count - 1, count).size != 1):
        refuse(f"{name}: is cut off or has no samples", "a complete file")
    counts = SUBTYPES[kind]
    return [
        Channel(
            name="",
            number=column + 1,
            n_sample=count,
            samples=partial(_read, path, column),
            unit="FS" if counts else "",
            sample_rate=rate,
            counts=counts,
            date=date,
            notes=notes,
            may_be_fractions=True,
        )
        for column in range(columns)
    ]


def _read_chunks(file: BinaryIO, name: str) -> tuple[str, tuple[Note, ...]]:
    """Return the date of a WAV file, and notes; raise InputError if it is cut off.

    The library does not detect this.
    """
    notes: tuple[Note, ...] = ()
    size = os.fstat(file.fileno()).st_size
    lengths: dict[bytes, int] = {}
    date, missing = "", None
    for kind, begin, length in _chunks(file, lengths, size):
        if kind == b"data":
            missing = begin + length - size
            if length in STREAMED and missing > 0:
                missing = 0
                notes = (Note("length_unknown"),)
        if kind == b"ds64":
            file.seek(begin)
            lengths[b"data"] = struct.unpack("<QQ", file.read(16))[1]
        if kind == b"bext":
            file.seek(begin)
            text = file.read(CLOCK.stop)
            texts = (
                text[section].strip(b"\0 ").decode("ascii", "replace") for section in (DATE, CLOCK)
            )
            date = " ".join(word for word in texts if word.isprintable() and word)
    if missing is None:
        refuse(f"{name}: has no chunk of samples", "an undamaged WAV file")
    if missing > 0:
        refuse(f"{name}: is cut off, {missing} bytes are missing", "a complete file")
    return date, notes


def _chunks(
    file: BinaryIO, lengths: dict[bytes, int], size: int
) -> Iterator[tuple[bytes, int, int]]:
    """Yield kind, begin and length of the chunks of a WAV file."""
    begin = 12
    for _ in range(MAX_CHUNKS):
        file.seek(begin)
        head = file.read(8)
        if len(head) < 8 or begin >= size:  # noqa: PLR2004 - size of a chunk header
            return
        kind, length = struct.unpack("<4sI", head)
        if length == UNKNOWN:
            length = lengths.get(kind, length)
        yield kind, begin + 8, length
        begin += 8 + length + length % 2
