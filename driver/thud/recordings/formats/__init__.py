"""Formats of recordings: one module for each, and a table that identifies them."""

from __future__ import annotations

import importlib
import struct
from typing import TYPE_CHECKING, NamedTuple

from thud.base.checks import refuse
from thud.recordings.channel import Channel, guarded, shown_path

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

# Number of bytes from which the format is identified.
HEAD = 4096
HDF5 = b"\x89HDF\r\n\x1a\n"


class Format(NamedTuple):
    """A format: name, module that reads it, suffixes, and whether the first bytes match it."""

    name: str
    module: str
    suffixes: tuple[str, ...]
    matches: Callable[[bytes], bool]


def _is_uff(head: bytes) -> bool:
    """Whether a file begins with the mark -1 of a universal file and the number of a data set."""
    lines = head.lstrip(b"\r\n").splitlines()[:2]
    return len(lines) > 1 and lines[0].strip() == b"-1" and lines[1][:6].strip().isdigit()


def _is_matlab_4(head: bytes) -> bool:
    """Whether a file begins as one of MATLAB 4.

    Its integers are: type, rows, columns, imaginary part, length of the name, which ends with a
    zero. The decimal digits of the type are byte order, zero, precision and kind of matrix.
    """
    for digit, order in enumerate("<>"):
        kind, _, _, imaginary, length = struct.unpack(f"{order}5I", head[:20].ljust(20, b"\xff"))
        is_type = kind // 100 == 10 * digit and kind // 10 % 10 <= 5 and kind % 10 <= 2  # noqa: PLR2004
        if is_type and imaginary <= 1 and head[19 + length : 20 + length] == b"\0" and length > 1:
            return True
    return False


def _is_text(head: bytes) -> bool:
    """Whether a file is text: UTF-16 with a byte order mark, or without zero bytes."""
    return bool(head) and (head[:2] in {b"\xff\xfe", b"\xfe\xff"} or b"\0" not in head)


FORMATS = (
    Format("WAV", "audio", (".wav", ".rf64", ".bwf"),
           lambda head: head[:4] in {b"RIFF", b"RF64"} and head[8:12] == b"WAVE"),
    Format("FLAC", "audio", (".flac",), lambda head: head[:4] == b"fLaC"),
    Format("TDMS", "tdms", (".tdms",), lambda head: head[:4] == b"TDSm"),
    Format("HDF5", "hdf5", (".h5", ".hdf5", ".hdf", ".nc", ".nc4"),
           lambda head: any(head[at : at + 8] == HDF5 for at in (0, 512, 1024, 2048))),
    Format("MATLAB", "matlab", (".mat",),
           lambda head: head[124:128] in {b"\0\1IM", b"\1\0MI"} or _is_matlab_4(head)),
    Format("universal", "universal", (".uff", ".unv", ".uf"), _is_uff),
    Format("text", "text", (".csv", ".tsv", ".txt", ".asc", ".dat", ".lvm", ".prn"), _is_text),
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
    with guarded(path, "a file"), path.open("rb") as file:
        head = file.read(HEAD)
    name = shown_path(path)
    if not head:
        refuse(f"{name}: is empty", "a recording")
    actual = next((entry for entry in FORMATS if entry.matches(head)), None)
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
