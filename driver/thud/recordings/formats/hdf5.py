"""HDF5, NetCDF 4 and MATLAB 7.3 by h5py."""

from __future__ import annotations

import errno
import math
import os
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import refuse
from thud.recordings.channel import (
    MIB,
    MIN_SAMPLES,
    Channel,
    guarded,
    library,
    shown_path,
    shown_text,
)
from thud.recordings.header_aliases import (
    DATE,
    TIME_UNITS,
    UNIT,
    find_rate,
    find_word,
    is_time,
    plain,
    read_number,
    split_title,
    text_of,
)
from thud.recordings.uniform_grid import uniform_grid
from thud.recordings.variables import MAX_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

# Maximum numbers of objects and attributes, and depth of groups.
MAX_OBJECTS = 10_000
MAX_ATTRIBUTES = 256
MAX_DEPTH = 32
# Maximum numbers of bytes of a header value and of a chunk, and maximum compression ratio.
MAX_VALUE = 4096
MAX_CHUNK = 2**26
MAX_RATIO = 1100
# Maximum length of a vector of times.
MAX_TIMES = 2**22
# Attribute with the MATLAB class, and classes that are stored as numbers but are no recordings.
MATLAB_CLASS = frozenset({"matlabclass"})
MATLAB_OTHERS = {"char", "cell", "struct", "function_handle", "canonical empty"}

# Attributes by which NetCDF scales packed values, and their defaults.
SCALING = {"scalefactor": 1.0, "addoffset": 0.0}


def _read(  # noqa: PLR0913, PLR0917 - they identify a section of a channel
    path: Path,
    dataset: str,
    scale: float,
    offset: float,
    column: tuple[int, int] | None,
    start: int,
    stop: int,
) -> NDArray[np.float64]:
    h5py = library("h5py", "HDF5")
    with guarded(path, "HDF5"), _open(h5py, path) as file:
        piece: Any = slice(start, stop)
        if column is not None:
            axis, index = column
            piece = (index, piece) if axis == 0 else (piece, index)
        return np.asarray(file[dataset][piece], dtype=np.float64) * scale + offset


@dataclass(frozen=True)
class _Vectors:
    """A numeric dataset that may hold channels, with the names and values of its header."""

    key: str
    data: Any
    header: list[tuple[str, object]]

    @property
    def axis(self) -> int:
        """Axis of the samples."""
        return int(np.argmax(self.data.shape))

    @property
    def n_sample(self) -> int:
        """Number of samples."""
        return int(max(self.data.shape))

    @property
    def parent(self) -> str:
        """Path of its group."""
        return self.key.rpartition("/")[0]


def read_channels(path: Path) -> list[Channel]:
    """Return the numeric vectors of a file, and the columns of its slender matrices."""
    h5py = library("h5py", "HDF5")
    name = shown_path(path)
    with _open(h5py, path) as file:
        series = _walk(h5py, file, path)
        times = [entry for entry in series if is_time(entry.key.rpartition("/")[2])]
        channels: list[Channel] = []
        for entry in series:
            if entry not in times or len(series) == 1:
                channels += _channels(path, entry, times, len(channels))
    if not channels:
        refuse(
            f"{name}: has no dataset of {MIN_SAMPLES} or more real numbers", "a recorded channel"
        )
    return channels


def _open(h5py: Any, path: Path) -> Any:  # noqa: ANN401 - a library
    """Open a file, without a lock if the file system has none."""
    try:
        return h5py.File(os.fsencode(path), "r")
    except OSError as error:
        if error.errno not in (errno.ENOLCK, errno.ENOTSUP):
            raise
    return h5py.File(os.fsencode(path), "r", locking=False)


def _walk(h5py: Any, file: Any, path: Path) -> list[_Vectors]:  # noqa: ANN401 - a library
    """Return the datasets that may hold channels."""
    series: list[_Vectors] = []
    waiting: list[tuple[str, int, list[tuple[str, object]]]] = [("", 0, [])]
    seen = {h5py.h5o.get_info(file.id).addr}
    while waiting:
        group_path, depth, outer_header = waiting.pop()
        if depth > MAX_DEPTH:
            refuse(f"{shown_path(path)}: groups more than {MAX_DEPTH} deep", "a recording")
        group = file[group_path or "/"]
        header = [*_attributes(h5py, group), *outer_header]
        vectors = []
        for key, entry in _entries(h5py, group, seen, shown_path(path)):
            if isinstance(entry, h5py.Group):
                waiting.append((f"{group_path}/{key}", depth + 1, header))
            elif _is_scalar(h5py, entry.shape, entry.dtype) and not entry.chunks:
                header.insert(0, (key, text_of(entry[()])))
            elif _is_channel(entry, f"{shown_path(path)}: {shown_text(key)}", path):
                vectors.append((f"{group_path}/{key}", entry))
        for key, data in vectors:
            attributes = _attributes(h5py, data)
            if find_word(attributes, MATLAB_CLASS) not in MATLAB_OTHERS:
                series.append(_Vectors(key, data, [*attributes, *header]))
    return series


def _entries(h5py: Any, group: Any, seen: set[int], name: str) -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    """Yield name and object of the groups and datasets in a group, each object once."""
    for key in group:
        link = group.get(key, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            refuse(f"{name}: {shown_text(key)} is a link to another file", "the other file")
        # MATLAB stores the contents of cells under this name.
        if not isinstance(link, h5py.HardLink) or key == "#refs#":
            continue
        entry = group[key]
        address = h5py.h5o.get_info(entry.id).addr
        if address in seen:
            continue
        seen.add(address)
        if len(seen) > MAX_OBJECTS:
            refuse(f"{name}: more than {MAX_OBJECTS} objects", "a recording")
        if isinstance(entry, h5py.Group) or getattr(entry, "shape", None) is not None:
            yield key, entry


def _attributes(h5py: Any, entry: Any) -> list[tuple[str, object]]:  # noqa: ANN401 - a library
    """Return the scalar attributes of an object, and scaling attributes of any shape."""
    attributes: list[tuple[str, object]] = []
    for key in entry.attrs:
        kind = entry.attrs.get_id(key)
        if _is_scalar(h5py, kind.shape, kind.dtype):
            attributes.append((key, text_of(entry.attrs[key])))
        elif plain(key) in SCALING:
            attributes.append((key, f"values of shape {kind.shape or ()}"))
    if len(attributes) > MAX_ATTRIBUTES:
        attributes = [(key, value) for key, value in attributes if plain(key) in SCALING]
    return attributes


def _is_scalar(h5py: Any, shape: tuple[int, ...] | None, dtype: Any) -> bool:  # noqa: ANN401 - a library
    """Whether a value is one number or text of limited size."""
    is_text = h5py.check_string_dtype(dtype) is not None
    return (
        shape is not None  # an empty attribute has none
        and math.prod(shape) == 1
        and (dtype.kind in "iufSU" or is_text)
        and dtype.itemsize <= MAX_VALUE
    )


def _is_channel(data: Any, name: str, path: Path) -> bool:  # noqa: ANN401 - of a library
    """Whether a dataset may hold channels; raise InputError if it is external or too large."""
    if data.dtype.kind not in "iuf" or len(data.shape) not in {1, 2}:
        return False
    if max(data.shape) < MIN_SAMPLES or math.prod(data.shape) // max(data.shape) > MAX_COLUMNS:
        return False
    if data.is_virtual or data.external:
        refuse(f"{name}: is stored in another file", "the other file")
    size = math.prod(data.shape) * data.dtype.itemsize
    stored = data.id.get_storage_size() * (MAX_RATIO if data.chunks else 1)
    if size > stored or (not data.chunks and size > path.stat().st_size):
        refuse(
            f"{name}: {size} bytes according to its shape, {stored} stored at most",
            "an undamaged HDF5 file",
        )
    if data.chunks and math.prod(data.chunks) * data.dtype.itemsize > MAX_CHUNK:
        refuse(
            f"{name}: chunks of {math.prod(data.chunks) * data.dtype.itemsize / MIB:.0f} MiB",
            f"chunks of up to {MAX_CHUNK // MIB} MiB",
        )
    return True


def _channels(path: Path, entry: _Vectors, times: list[_Vectors], before: int) -> list[Channel]:
    count = math.prod(entry.data.shape) // entry.n_sample
    rate, date = find_rate(entry.header), find_word(entry.header, DATE)
    steps: tuple[str, ...] = ()
    time = next(
        (t for t in times if t.n_sample == entry.n_sample and entry.parent.startswith(t.parent)),
        None,
    )
    if rate is None and time is not None:
        rate, steps, since = _rate_of_times(path, time)
        date = date or since
    scale, offset = (_scaling(path, entry, word) for word in SCALING)
    title = entry.key.strip("/")
    is_vector = len(entry.data.shape) == 1
    read = partial(_read, path, entry.key, scale, offset)
    return [
        Channel(
            name=title + (f"[{i + 1}]" if count > 1 else ""),
            number=before + i + 1,
            n_sample=entry.n_sample,
            samples=partial(read, None if is_vector else (1 - entry.axis, i)),
            unit=find_word(entry.header, UNIT) or split_title(title.rpartition("/")[2])[1],
            sample_rate=rate,
            date=date,
            steps=steps,
        )
        for i in range(count)
    ]


def _scaling(path: Path, entry: _Vectors, word: str) -> float:
    """Return the factor or offset of a dataset; raise InputError if it is no finite number."""
    title = next((title for title, _ in entry.header if plain(title) == word), "")
    if not title:
        return SCALING[word]
    value = find_word(entry.header, frozenset({word}))
    number, unit = read_number(value) or (math.nan, "")
    if unit or not math.isfinite(number) or (number == 0 and word == "scalefactor"):
        name = f"{shown_path(path)}: {shown_text(entry.key.strip('/'))}: {shown_text(title)}"
        refuse(
            f"{name} = {shown_text(value)!r} is not allowed", "a finite number, as a factor not 0"
        )
    return number


def _rate_of_times(path: Path, times: _Vectors) -> tuple[float, tuple[str, ...], str]:
    """Return sample rate, Hz, notes, and, if stated, the date of time zero, from times."""
    name = f"{shown_path(path)}: {shown_text(times.key)}"
    if times.n_sample > MAX_TIMES:
        refuse(f"{name}: {times.n_sample} times", f"up to {MAX_TIMES}, or an attribute sample_rate")
    unit, _, since = find_word(times.header, UNIT).partition(" since ")
    unit = unit or split_title(times.key)[1]
    values = np.asarray(times.data[()], dtype=np.float64).ravel()
    if unit.casefold() not in TIME_UNITS:
        refuse(
            f"{name}: unit = {shown_text(unit)!r} is not a unit of time",
            ", ".join(filter(None, TIME_UNITS)),
        )
    _, step, steps = uniform_grid(values * TIME_UNITS[unit.casefold()], name)
    return 1 / step, steps, since
