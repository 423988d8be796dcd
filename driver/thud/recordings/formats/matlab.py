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

from thud.base.checks import refuse
from thud.recordings.channel import MAX_IN_MEMORY, MIB, require_small, shown_path, shown_text
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
# Classes of arrays that are structures, text and numbers; cells and others are not read.
STRUCTURE = 2
CHAR = 4
NUMERIC = range(6, 16)
COMPLEX = 0x0800
MOST_VARIABLES = 1000
DEEPEST = 8
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
            for key, value in _arrays(element.data, order, name):
                values[key] = value
                if len(values) > MOST_VARIABLES:
                    refuse(f"{name}: more than {MOST_VARIABLES} variables", "a recording")
    return channels_of_variables(values, name)


def _variables(file: BinaryIO, order: str, name: str) -> Iterator[_Element]:
    """Yield the arrays of a file, unpacked; raise InputError where one is cut off or too large."""
    size = file.seek(0, 2)
    begin, left = HEADER, MAX_IN_MEMORY
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
                    f"{name}: the variables unpack to more than {MAX_IN_MEMORY // MIB} MiB",
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


def _arrays(
    data: memoryview, order: str, name: str, depth: int = 0
) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """Yield names and values of an array, or of the fields of a structure of one element."""
    found = list(itertools.islice(_elements(data, order, name), 3 + MOST_VARIABLES))
    if len(found) < 4 or len(found[0].data) < 8:  # noqa: PLR2004 - class and flags, and a size
        return
    (bits,) = struct.unpack_from(f"{order}I", found[0].data)
    key = bytes(found[2].data).decode("latin-1")
    if bits & 0xFF != STRUCTURE:
        value = _array(found, bits, order, name)
        if value is not None:
            yield key, value
        return
    if depth == DEEPEST:
        refuse(f"{name}: structures in more than {DEEPEST} structures", "a recording")
    number = np.frombuffer(found[3].data, f"{order}i4")
    length = int(number[0]) if number.size else 0
    if length < 1 or len(found) < 5:  # noqa: PLR2004 - the names of the fields
        return
    names = bytes(found[4].data)
    words = [
        names[k : k + length].partition(b"\0")[0].decode("latin-1")
        for k in range(0, len(names), length)
    ]
    # Of several elements, each has all fields.
    if len(found) - 5 != len(words):
        refuse(
            f"{name}: {shown_text(key)} is an array of structures, or damaged",
            "a structure of one element, or vectors as variables of their own",
        )
    for word, field in zip(words, found[5:], strict=True):
        for inner, value in _arrays(field.data, order, name, depth + 1):
            yield f"{key}/{word}{inner}", value


def _array(found: list[_Element], bits: int, order: str, name: str) -> NDArray[np.generic] | None:
    """Return the values of an array; None where they are no real numbers or text."""
    _, shape, title, values = found[:4]
    key = bytes(title.data).decode("latin-1")
    if bits & 0xFF == CHAR and values.kind in TEXTS:
        coding = TEXTS[values.kind]
        coding += ("-le" if order == "<" else "-be") * (coding == "utf-16")
        return np.array(bytes(values.data).decode(coding, "replace"))
    if bits & 0xFF not in NUMERIC or bits & COMPLEX or values.kind not in NUMBERS:
        return None
    numbers: NDArray[np.generic] = np.frombuffer(values.data, order + NUMBERS[values.kind])
    if numbers.size > MOST_NUMBERS:
        refuse(
            f"{name}: {shown_text(key)} has {numbers.size} numbers",
            f"up to {MOST_NUMBERS}; longer recordings as WAV, RF64, FLAC, HDF5 or TDMS",
        )
    lengths = np.frombuffer(shape.data, f"{order}i4").tolist()
    if math.prod(lengths) != numbers.size or min(lengths, default=0) < 0:
        refuse(f"{name}: {numbers.size} values, {lengths} are due", "an undamaged MATLAB file")
    return numbers.reshape(lengths, order="F")
