"""WAV, RF64, BWF and FLAC by soundfile."""

from __future__ import annotations

import os
import struct
import sys
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse, shown_text
from thud.base.extras import library
from thud.recordings.formats import Channel, guarded

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

# libsndfile takes the bytes of a path, but in Windows its text.
_native = os.fspath if sys.platform == "win32" else os.fsencode
# Counts at full scale by subtype, None for floats.
SUBTYPES = {
    "PCM_S8": 2.0**7, "PCM_U8": 2.0**7, "PCM_16": 2.0**15, "PCM_24": 2.0**23, "PCM_32": 2.0**31,
    "FLOAT": None, "DOUBLE": None,
}  # fmt: skip
# Lengths from this one on mean that a stream could not go back to its head (0x7FFFF000 of ffmpeg,
# 0xFFFFFFFF of SoX), or that the length is in the table of an RF64 file.
MIN_UNKNOWN = 0x7FFFF000
# Maximum number of samples in a FLAC header; larger values mean that it is unknown.
MAX_FLAC = 2**36
# Bytes of date and time in a broadcast chunk, and of the length of the samples in an RF64 file.
DATE = slice(320, 330)
CLOCK = slice(330, 338)
RF64_LENGTH = slice(28, 36)


def _read(path: Path, column: int, start: int, stop: int) -> NDArray[np.float64]:
    soundfile = library("soundfile", "recordings")
    with guarded(path, "audio"), soundfile.SoundFile(_native(path)) as file:
        file.seek(start)
        block: NDArray[np.float64] = file.read(stop - start, dtype="float64", always_2d=True)
    return np.ascontiguousarray(block[:, column])


def read_channels(path: Path) -> list[Channel]:
    """Return the channels of an audio file; integers are fractions of full scale."""
    name = shown_text(path)
    with library("soundfile", "recordings").SoundFile(_native(path)) as file:
        kind, count, columns = file.subtype, file.frames, file.channels
        rate, is_flac = float(file.samplerate), file.format == "FLAC"
    if kind not in SUBTYPES:
        refuse(f"{name}: samples of the format {kind}", ", ".join(SUBTYPES))
    # Without a length the library cannot seek, and a file that is cut off is not detectable.
    if is_flac and count >= MAX_FLAC:
        refuse(
            f"{name}: its header has no number of samples (written by a streaming encoder)",
            "FLAC files with their length; encode it again, as by `ffmpeg -i OLD.flac NEW.flac`",
        )
    date = "" if is_flac else _wav_date(path)
    # A FLAC file that is cut off lacks its last sample.
    if count < 1 or (is_flac and _read(path, 0, count - 1, count).size != 1):
        refuse(f"{name}: is cut off or has no samples", "a complete file")
    counts = SUBTYPES[kind]
    unit = "FS" if counts else ""
    reads = [partial(_read, path, column) for column in range(columns)]
    return [
        Channel("", i, count, read, unit, rate, counts, date, may_be_fractions=True)
        for i, read in enumerate(reads, 1)
    ]


def _wav_date(path: Path) -> str:
    """Return the date of a WAV file; raise InputError if its samples are cut off.

    The library reads neither, and returns what is left of the samples.
    """
    date, size = "", path.stat().st_size
    with path.open("rb") as file:
        start = file.read(RF64_LENGTH.stop)
        file.seek(12)
        while len(head := file.read(8)) == 8:  # noqa: PLR2004 - size of a chunk header
            kind, length = struct.unpack("<4sI", head)
            begin = file.tell()
            if kind == b"bext":
                bext = file.read(CLOCK.stop).decode("latin-1")
                words = (bext[section].strip("\0 ") for section in (DATE, CLOCK))
                date = " ".join(word for word in words if word and word.isprintable())
            elif kind == b"data":
                if length >= MIN_UNKNOWN:
                    is_rf64 = start.startswith(b"RF64")
                    length = int.from_bytes(start[RF64_LENGTH], "little") if is_rf64 else 0
                if (missing := begin + length - size) > 0:
                    text = f"is cut off, {missing} bytes are missing"
                    refuse(f"{shown_text(path)}: {text}", "a complete file")
                break
            file.seek(begin + length + length % 2)
    return date
