"""Formats of recordings: one module for each, and a table that identifies them."""

from __future__ import annotations

import importlib
import re
from typing import TYPE_CHECKING, NamedTuple

from thud.base.checks import refuse
from thud.recordings.channel import Channel, guarded, shown_text

if TYPE_CHECKING:
    from pathlib import Path

# Number of bytes from which the format is identified.
HEAD = 4096


class Format(NamedTuple):
    """A format: name, module that reads it, suffixes, and pattern of the first bytes."""

    name: str
    module: str
    suffixes: tuple[str, ...]
    pattern: bytes


# A MATLAB file of version 4 begins with integers: type (kind and precision of numbers), rows,
# columns, imaginary part, length of the name. A universal file begins with the mark -1 and the
# number of a data set. Text is UTF-16 with a mark, or without zero bytes.
FORMATS = (
    Format("WAV", "audio", (".wav", ".rf64", ".bwf"), rb"(RIFF|RF64).{4}WAVE"),
    Format("FLAC", "audio", (".flac",), rb"fLaC"),
    Format("TDMS", "tdms", (".tdms",), rb"TDSm"),
    Format("HDF5", "hdf5", (".h5", ".hdf5", ".hdf", ".nc", ".nc4"),
           rb"(.{512}|.{1024}|.{2048})?\x89HDF\r\n\x1a\n"),
    Format("MATLAB", "matlab", (".mat",),
           rb".{124}\x00\x01IM|[\x00-\x34]\x00{3}.{8}[\x00\x01]\x00{3}[\x02-\x40]\x00{3}"),
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
    with guarded(path, "a file"), path.open("rb") as file:
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
