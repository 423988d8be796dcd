"""MATLAB files up to version 7 by scipy; version 7.3 is HDF5."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
import scipy.io

from thud.checks import refuse
from thud.recordings.channel import MIB, WHOLE, BoundedFile, require_small, shown_path
from thud.recordings.variables import channels_of_variables

if TYPE_CHECKING:
    from pathlib import Path

    from thud.recordings.channel import Channel

HEADER = 128
COMPRESSED = 15
# Most that is unpacked at once, bytes.
PIECE = 2**20
NUMERIC = {"double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32"}
MOST_VARIABLES = 1000


def read_channels(path: Path) -> list[Channel]:
    """Return the numeric vectors of a MATLAB file."""
    name = shown_path(path)
    require_small(path, "a MATLAB file")
    with path.open("rb") as file:
        _require_bounded(file, name)
        file.seek(0)
        bounded: Any = BoundedFile(file, name)
        listed = scipy.io.whosmat(bounded)
        wanted = [key for key, _, kind in listed if kind in NUMERIC or kind == "char"]
        if len(listed) > MOST_VARIABLES:
            refuse(f"{name}: {len(listed)} variables", f"up to {MOST_VARIABLES}")
        file.seek(0)
        values = scipy.io.loadmat(bounded, variable_names=wanted)
    return channels_of_variables(
        {key: np.asarray(value) for key, value in values.items() if key in wanted}, name
    )


def _require_bounded(file: BinaryIO, name: str) -> None:
    """Raise InputError where variables are cut off or unpack to more than memory should hold."""
    head = file.read(HEADER)
    order = "<" if head[126:128] == b"IM" else ">"
    begin, size = HEADER, file.seek(0, 2)
    total = 0
    while begin < size:
        file.seek(begin)
        tag = file.read(8)
        if len(tag) < 8:  # noqa: PLR2004 - of a tag
            refuse(f"{name}: is cut off", "a complete file")
        kind, length = struct.unpack(f"{order}II", tag)
        if begin + 8 + length > size:
            refuse(f"{name}: is cut off, or a variable claims {length} bytes", "a complete file")
        if kind == COMPRESSED:
            total = _unpacked(file, length, total, name)
        begin += 8 + length


def _unpacked(file: BinaryIO, length: int, total: int, name: str) -> int:
    """Return the total of unpacked bytes; raise InputError where it is too large."""
    unpacker = zlib.decompressobj()
    while length > 0:
        packed = file.read(min(length, PIECE))
        length -= len(packed)
        while packed:
            total += len(unpacker.decompress(packed, PIECE))
            packed = unpacker.unconsumed_tail
            if total > WHOLE:
                refuse(
                    f"{name}: the variables unpack to more than {WHOLE // MIB} MiB",
                    "longer recordings as WAV, RF64, FLAC, HDF5 or TDMS",
                )
    return total
