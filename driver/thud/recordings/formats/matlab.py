"""MATLAB files up to version 7; version 7.3 is HDF5.

The layout is that of "MAT-File Format" (MathWorks). It is read here because the compiled reader of
scipy dies of damaged files.
"""

from __future__ import annotations

import itertools
import math
import struct
import zlib
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

import numpy as np

from thud.checks import refuse
from thud.recordings.channel import MIB, WHOLE, require_small, shown_path, shown_text
from thud.recordings.variables import channels_of_variables

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from thud.recordings.channel import Channel

HEADER = 128
# Types of elements: numbers by their code in numpy, texts, and those that hold others.
NUMBERS = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
TEXTS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16"}
MATRIX, COMPRESSED = 14, 15
# Classes of arrays that are text and numbers; cells, structures and others are not read.
CHAR = 4
NUMERIC = range(6, 16)
COMPLEX = 0x0800
MOST_VARIABLES = 1000
MOST_NUMBERS = 2**24
# Most that is unpacked at once, bytes.
PIECE = 2**20


class _Element(NamedTuple):
    """One element of a file: its type and its bytes."""

    kind: int
    data: memoryview


def read_channels(path: Path) -> list[Channel]:
    """Return the numeric vectors of a MATLAB file."""
    name = shown_path(path)
    require_small(path, "a MATLAB file")
    values: dict[str, NDArray[np.generic]] = {}
    with path.open("rb") as file:
        order = "<" if file.read(HEADER)[126:128] == b"IM" else ">"
        for element in _variables(file, order, name):
            key, value = _array(element.data, order, name)
            if value is not None:
                values[key] = value
            if len(values) > MOST_VARIABLES:
                refuse(f"{name}: more than {MOST_VARIABLES} variables", "a recording")
    return channels_of_variables(values, name)


def _variables(file: BinaryIO, order: str, name: str) -> Iterator[_Element]:
    """Yield the arrays of a file, unpacked; raise InputError where one is cut off or too large."""
    size = file.seek(0, 2)
    begin, left = HEADER, WHOLE
    while begin < size:
        file.seek(begin)
        tag = file.read(8)
        kind, length = struct.unpack(f"{order}II", tag) if len(tag) == 8 else (0, size)  # noqa: PLR2004
        begin += 8 + length
        if begin > size:
            refuse(f"{name}: is cut off, or a variable claims {length} bytes", "a complete file")
        if kind == COMPRESSED:
            data = _unpacked(file, length, left, name)
            left -= len(data)
            yield from (one for one in _elements(data, order, name) if one.kind == MATRIX)
        elif kind == MATRIX:
            yield _Element(kind, memoryview(file.read(length)))


def _unpacked(file: BinaryIO, length: int, left: int, name: str) -> memoryview:
    """Return unpacked bytes; raise InputError where they are more than are left to be held."""
    unpacker = zlib.decompressobj()
    data = bytearray()
    while length > 0:
        packed = file.read(min(length, PIECE))
        length -= len(packed)
        while packed:
            data += unpacker.decompress(packed, PIECE)
            packed = unpacker.unconsumed_tail
            if len(data) > left:
                refuse(
                    f"{name}: the variables unpack to more than {WHOLE // MIB} MiB",
                    "longer recordings as WAV, RF64, FLAC, HDF5 or TDMS",
                )
    if not unpacker.eof:
        refuse(f"{name}: a variable is cut off", "a complete file")
    return memoryview(data)


def _elements(data: memoryview, order: str, name: str) -> Iterator[_Element]:
    """Yield the elements of an array."""
    begin = 0
    while begin + 8 <= len(data):
        kind, length = struct.unpack_from(f"{order}II", data, begin)
        start, after = begin + 8, begin + 8 + length + -length % 8
        if kind >> 16:  # up to four bytes stand in the tag
            kind, length = kind & 0xFFFF, kind >> 16
            start, after = begin + 4, begin + 8
        if start + length > len(data):
            refuse(f"{name}: an element claims {length} bytes", "an undamaged MATLAB file")
        yield _Element(kind, data[start : start + length])
        begin = after


def _array(data: memoryview, order: str, name: str) -> tuple[str, NDArray[np.generic] | None]:
    """Return name and values of an array; None where they are no real numbers or text."""
    found = list(itertools.islice(_elements(data, order, name), 4))
    flags, shape, title, values = found + [_Element(0, data[:0])] * (4 - len(found))
    if len(flags.data) < 8:  # noqa: PLR2004 - class and flags, and a size
        return "", None
    (bits,) = struct.unpack_from(f"{order}I", flags.data)
    key = bytes(title.data).decode("latin-1")
    if bits & 0xFF == CHAR and values.kind in TEXTS:
        coding = TEXTS[values.kind]
        coding += ("-le" if order == "<" else "-be") * (coding == "utf-16")
        return key, np.array(bytes(values.data).decode(coding, "replace"))
    if bits & 0xFF not in NUMERIC or bits & COMPLEX or values.kind not in NUMBERS:
        return key, None
    numbers: NDArray[np.generic] = np.frombuffer(values.data, order + NUMBERS[values.kind])
    if numbers.size > MOST_NUMBERS:
        refuse(
            f"{name}: {shown_text(key)} has {numbers.size} numbers",
            f"up to {MOST_NUMBERS}; longer recordings as WAV, RF64, FLAC, HDF5 or TDMS",
        )
    lengths = np.frombuffer(shape.data, f"{order}i4").tolist()
    if math.prod(lengths) != numbers.size or min(lengths, default=0) < 0:
        refuse(f"{name}: {numbers.size} values, {lengths} are due", "an undamaged MATLAB file")
    return key, numbers.reshape(lengths, order="F")
