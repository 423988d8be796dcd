"""Channels from named arrays, as in HDF5 and MATLAB files."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import refuse
from thud.base.files import MAX_IN_MEMORY
from thud.base.units import factor_to, find_unit
from thud.recordings.formats import MIN_SAMPLES, Channel, rises, uniform_grid
from thud.recordings.words import TIME, is_time, read_facts, split_title, text_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from thud.base.note import Note

# Maximum number of columns of a matrix of channels.
MAX_COLUMNS = 256
# Maximum number of times that are read.
MAX_TIMES = MAX_IN_MEMORY // 8

Header = list[tuple[str, str]]


@dataclass(frozen=True)
class Vector:
    """A vector of numbers, or a column of a slender matrix.

    `array` is the name of the array with its groups, `column` counts from 1, zero for a vector, and
    `read` returns the values from start to before stop.
    """

    array: str
    column: int
    n_sample: int
    read: Callable[[int, int], NDArray[np.float64]]

    @property
    def group(self) -> str:
        """Its group with a slash at the end, empty for the whole file; a matrix is a group."""
        return f"{self.array}/" if self.column else self.array[: self.array.rfind("/") + 1]

    @property
    def title(self) -> str:
        """Name of the array in its group."""
        return self.array.rpartition("/")[2]


def vectors_of(
    key: str, kind: str, shape: tuple[int, ...], read: Callable[[Any], NDArray[np.generic]]
) -> list[Vector]:
    """Return an array as vectors, none if it is not a slender matrix of enough real numbers.

    `kind` is that of its numbers as in NumPy; `read` returns what an index selects of it.
    """
    n_sample = max(shape, default=0)
    n_column = math.prod(shape) // max(1, n_sample)
    if kind not in "iuf" or len(shape) > 2 or n_sample < MIN_SAMPLES or n_column > MAX_COLUMNS:  # noqa: PLR2004
        return []
    axis = shape.index(n_sample)
    return [
        Vector(key, i + 1 if n_column > 1 else 0, n_sample,
               partial(_section, read, (i,) * axis, (i,) * (len(shape) - axis - 1)))
        for i in range(n_column)
    ]  # fmt: skip


def _section(
    read: Callable[[Any], Any],
    before: tuple[int, ...],
    behind: tuple[int, ...],
    start: int,
    stop: int,
) -> NDArray[np.float64]:
    return np.array(read((*before, slice(start, stop), *behind)), dtype=np.float64)


def header_entry(key: str, value: object) -> tuple[str, str]:
    """Return a name and its value as text; of an array up to eight values."""
    if isinstance(value, np.ndarray | list) and np.size(value) != 1:
        return key, ", ".join(map(str, np.ravel(value)[:MIN_SAMPLES]))
    return key, text_of(value)


def channels_of(vectors: list[Vector], header: Header, name: str) -> list[Channel]:
    """Return the channels among vectors: all but those of times.

    The header holds scalars, texts and attributes by their names. An entry applies to its owner,
    which is a group or an array, and to what is within it. Times give the rate of the vectors of
    their length in their group and within it.
    """
    times = [vector for vector in vectors if _holds_times(vector)] if len(vectors) > 1 else []
    channels = [
        _channel(vector, number, times, header, name)
        for number, vector in enumerate(vectors, start=1)
        if vector not in times
    ]
    if not channels:
        refuse(f"{name}: has no vector of {MIN_SAMPLES} or more real numbers", "a recorded channel")
    return channels


def _channel(
    vector: Vector, number: int, times: list[Vector], header: Header, name: str
) -> Channel:
    own, near, entries = _header_of(vector, header)
    notes: tuple[Note, ...] = ()
    rate = read_facts(near).rate
    # Times override a rate in the header of an outer group, and must fit that of array and group if
    # they are in the same group; of several it is not known which apply.
    own_key, count = f"{vector.array}/", vector.n_sample
    fitting = [t for t in times if t.n_sample == count and own_key.startswith(t.group)]
    depth = max((len(time.group) for time in fitting), default=0)
    inner = [time for time in fitting if len(time.group) == depth]
    if len(inner) == 1 and (rate is None or depth > vector.array.rfind("/")):
        rate, notes = _rate(inner[0], header, name, rate)
    stated, titled = read_facts(own).unit, split_title(vector.title)[1]
    facts = read_facts(entries, stated or titled)
    unit = facts.unit
    if len({find_unit(stated), find_unit(titled)} - {""}) > 1:
        unit = f"{stated} by the attribute, {titled} by the name"
    title = vector.array + (f"[{vector.column}]" if vector.column else "")
    return Channel(
        title, number, count, vector.read, unit, rate or facts.rate,
        date=facts.date, notes=notes, unapplied=facts.unapplied,
    )  # fmt: skip


def _header_of(vector: Vector, header: Header) -> tuple[Header, Header, Header]:
    """Return the attributes of an array, the entries of array and group, and all that apply.

    Siemens Testlab exports have the step in ``x_values`` and the samples in ``y_values``.
    """
    own_key, group = f"{vector.array}/", vector.array[: vector.array.rfind("/") + 1]
    sibling = group.removesuffix("y_values/") + "x_values/" if group.endswith("y_values/") else None
    entries: list[tuple[str, tuple[str, str]]] = []
    for key, text in header:
        owner, title = key[: key.rfind("/") + 1], key.rpartition("/")[2]
        if own_key.startswith(owner) or owner == sibling:
            entries.append((owner, (title, text)))
        elif key == f"{group}quantity/label":
            entries.append((sibling or "", ("unit", text)))
    entries.sort(key=lambda entry: -len(entry[0]))
    own = [item for owner, item in entries if owner == own_key]
    near = [item for owner, item in entries if owner in {own_key, group}]
    return own, near, [item for _, item in entries]


def _holds_times(vector: Vector) -> bool:
    """Whether a vector rises and is named as times, or is the first column of a matrix."""
    name, unit = split_title(vector.title)
    is_named = is_time(name, unit) or vector.title.rpartition("_")[2].casefold() in TIME
    may_be = vector.column == 1 if vector.column else is_named
    return may_be and rises(vector.read(0, min(MAX_TIMES, vector.n_sample)))


def _rate(
    time: Vector, header: Header, name: str, stated: float | None
) -> tuple[float | None, tuple[Note, ...]]:
    """Return the sample rate, Hz, and notes, from the first times of a vector.

    It is the stated one if it is not known whether the times were multiplied by a factor.
    """
    label, own, scale = f"{name}: {time.array}", _header_of(time, header)[0], 1.0
    if not time.column:
        if read_facts(own, "s").unapplied:
            return stated, ()
        # NetCDF: "seconds since 2024-05-06".
        unit = read_facts(own).unit.partition(" since ")[0] or split_title(time.title)[1]
        scale = factor_to("s", unit, label)
    times = time.read(0, min(MAX_TIMES, time.n_sample)) * scale
    return uniform_grid(times, label, stated)[2:]
