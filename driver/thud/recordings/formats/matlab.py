"""MATLAB files of versions 4 to 7 by SciPy; version 7.3 is HDF5."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

import numpy as np
import scipy.io

from thud.base.checks import refuse, shown_text
from thud.base.files import MAX_IN_MEMORY, MIB, require_small
from thud.recordings.formats.variables import Vector, channels_of, header_entry, vectors_of

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from thud.recordings.formats import Channel


def read_channels(path: Path) -> list[Channel]:
    """Return the numeric vectors of a MATLAB file, also those in structures."""
    name = shown_text(path)
    require_small(path, "a MATLAB file")
    file = os.fsencode(path)
    if sum(8 * math.prod(shape) for _, shape, _ in scipy.io.whosmat(file)) > MAX_IN_MEMORY:
        refuse(
            f"{name}: the variables unpack to more than {MAX_IN_MEMORY // MIB} MiB",
            "longer recordings as WAV, RF64, FLAC, HDF5 or TDMS",
        )
    vectors: list[Vector] = []
    header = []
    for title, content in scipy.io.loadmat(file, simplify_cells=True).items():
        for key, value in _arrays(title, content, name) if not title.startswith("__") else ():
            found = vectors_of(key, value.dtype.kind, value.shape, value.__getitem__)
            vectors += found
            header += [] if found else [header_entry(key, value)]
    return channels_of(vectors, header, name)


def _arrays(key: str, content: object, name: str) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """Yield the numbers and texts in a variable by their names."""
    if isinstance(content, dict):
        for field, value in content.items():
            yield from _arrays(f"{key}/{field}", value, name)
        return
    value = np.asarray(content)
    if value.dtype == object and any(isinstance(element, dict) for element in value.ravel()):
        refuse(
            f"{name}: {shown_text(key)} is an array of structures, or damaged",
            "a single structure, or vectors as separate variables",
        )
    if value.dtype == object and all(isinstance(element, str) for element in value.ravel()):
        value = value.astype(str)  # a cell array of texts
    if value.dtype.kind in "iufU":
        yield key, value
