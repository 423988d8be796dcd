"""Channels from named arrays, as in HDF5 and MATLAB files."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import refuse
from thud.recordings.channel import MAX_IN_MEMORY, MIN_SAMPLES, Channel
from thud.recordings.force_units import find_unit
from thud.recordings.header_aliases import (
    DATE,
    TIME,
    UNIT,
    find_rate,
    find_unapplied,
    find_word,
    is_time,
    neutral_value,
    plain,
    read_number,
    split_title,
    text_of,
    time_scale,
)
from thud.recordings.times import uniform_grid

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from thud.base.note import Note

# Maximum number of columns of a matrix of channels.
MAX_COLUMNS = 256
# Maximum number of times, and number of rows that show whether a column may hold times.
MAX_TIMES = MAX_IN_MEMORY // 8
SHOWN_TIMES = 4096

Header = list[tuple[str, str]]


@dataclass(frozen=True)
class Variable:
    """An array of numbers of one or two dimensions: its name with its groups, shape and reader.

    `read` returns the values of a column from start to before stop.
    """

    key: str
    shape: tuple[int, ...]
    read: Callable[[int, int, int], NDArray[np.float64]]

    @property
    def n_sample(self) -> int:
        """Number of samples: the larger side of a matrix."""
        return max(self.shape)

    @property
    def n_column(self) -> int:
        """Number of columns of samples."""
        return math.prod(self.shape) // self.n_sample

    @property
    def group(self) -> str:
        """Its group, with a slash at the end; empty for the whole file."""
        return self.key[: self.key.rfind("/") + 1]

    @property
    def title(self) -> str:
        """Its name in the group."""
        return self.key.rpartition("/")[2]


def may_hold_channels(kind: str, shape: tuple[int, ...]) -> bool:
    """Whether an array is a vector, or a slender matrix, of enough real numbers."""
    return (
        kind in "iuf"
        and len(shape) in {1, 2}
        and max(shape) >= MIN_SAMPLES
        and math.prod(shape) <= MAX_COLUMNS * max(shape)
    )


def read_column(array: Any, column: int, start: int, stop: int) -> NDArray[np.float64]:  # noqa: ANN401
    """Return a section of a column of an array of NumPy or of a file."""
    if array.ndim == 1:
        piece = array[start:stop]
    elif array.shape[1] > array.shape[0]:
        piece = array[column, start:stop]
    else:
        piece = array[start:stop, column]
    return np.array(piece, dtype=np.float64)


def header_entry(key: str, value: object) -> tuple[str, str]:
    """Return a name and its value as text; of several values those of units and of factors only."""
    title = key.rpartition("/")[2]
    many = np.size(value) != 1 if isinstance(value, np.ndarray | list) else False
    if many and (plain(title) in UNIT or neutral_value(title) is not None):
        return key, ", ".join(map(str, np.ravel(np.asarray(value))[:MIN_SAMPLES])) or "nothing"
    return key, "" if many else text_of(value)


def channels_of_variables(variables: list[Variable], header: Header, name: str) -> list[Channel]:
    """Return the channels among variables: vectors, and the columns of slender matrices.

    The header holds scalars, texts and attributes by their names. An entry applies to its owner,
    which is a group or an array, and to what is within it. A vector of times gives the rate of
    vectors of its length in its group and within it.
    """
    columns = [(variable, i) for variable in variables for i in range(variable.n_column)]
    times = [variable for variable in variables if _holds_times(variable)]
    own_times = [v for v in variables if v.n_column > 1 and _rises(v)]
    channels = []
    for number, (variable, i) in enumerate(columns, start=1):
        if (variable in times and len(columns) > 1) or (variable in own_times and i == 0):
            continue
        own, near, entries = _header_of(variable, header)
        notes: tuple[Note, ...] = ()
        rate, since = find_rate(near), ""
        time = variable if variable in own_times else _times_of(variable, times)
        # Times override a rate in the header of an outer group.
        if time is not None and (rate is None or time is variable):
            rate, since, notes = _rate(time, header, name)
        unit = _unit(variable, own, entries)
        factor, offset, applied = _scaling(own)
        channels.append(
            Channel(
                name=variable.key + f"[{i + 1}]" * (variable.n_column > 1),
                number=number,
                n_sample=variable.n_sample,
                samples=partial(_read_scaled, variable.read, i, factor, offset),
                unit=unit,
                sample_rate=rate or find_rate(entries),
                date=find_word(entries, DATE) or since,
                notes=notes,
                unapplied=find_unapplied((e for e in entries if e not in applied), unit),
            )
        )
    if not channels:
        refuse(f"{name}: has no vector of {MIN_SAMPLES} or more real numbers", "a recorded channel")
    return channels


def _header_of(variable: Variable, header: Header) -> tuple[Header, Header, Header]:
    """Return the attributes of an array, the entries of array and group, and all that apply.

    Siemens Testlab exports have the step in ``x_values`` and the samples in ``y_values``.
    """
    own_key, group = f"{variable.key}/", variable.group
    sibling = group.removesuffix("y_values/") + "x_values/" if group.endswith("y_values/") else None
    entries: list[tuple[int, tuple[str, str], bool, bool]] = []
    for key, text in header:
        owner, title = key[: key.rfind("/") + 1], key.rpartition("/")[2]
        if own_key.startswith(owner) or owner == sibling:
            item = (title, text)
            entries.append((len(owner), item, owner == own_key, owner in {own_key, group}))
        elif key == f"{group}quantity/label":
            entries.append((len(group), ("unit", text), False, False))
    entries.sort(key=lambda entry: -entry[0])
    return (
        [item for _, item, is_own, _ in entries if is_own],
        [item for _, item, _, is_near in entries if is_near],
        [item for _, item, _, _ in entries],
    )


def _unit(variable: Variable, own: Header, entries: Header) -> str:
    """Return the unit of an array by its attribute, its title, or the header of its groups."""
    stated, titled = find_word(own, UNIT), split_title(variable.title)[1]
    if find_unit(stated) and find_unit(titled) and find_unit(stated) != find_unit(titled):
        return f"{stated} by the attribute, {titled} by the name"
    return stated or titled or find_word(entries, UNIT)


def _scaling(own: Header) -> tuple[float, float, Header]:
    """Return factor and offset by the attributes of NetCDF, and those that are applied.

    Numbers that are not finite, and a factor of zero, are not applied.
    """
    factor, offset, applied = 1.0, 0.0, []
    for entry in own:
        number, unit = read_number(entry[1]) or (math.nan, "")
        key = plain(entry[0]) if math.isfinite(number) and not unit else ""
        if key == "scalefactor" and number:
            factor = number
        elif key == "addoffset":
            offset = number
        else:
            continue
        applied.append(entry)
    return factor, offset, applied


def _read_scaled(  # noqa: PLR0913, PLR0917 - a section of a column and its scale
    read: Callable[[int, int, int], NDArray[np.float64]],
    column: int,
    factor: float,
    offset: float,
    start: int,
    stop: int,
) -> NDArray[np.float64]:
    return read(column, start, stop) * factor + offset


def _holds_times(variable: Variable) -> bool:
    """Whether a vector holds times by its name, or by the end of its name and its values."""
    if variable.n_column > 1:
        return False
    end = variable.title.rpartition("_")[2].casefold()
    return is_time(variable.title) or (end in TIME and _rises(variable))


def _rises(variable: Variable) -> bool:
    """Whether the first column rises uniformly enough to be times."""
    for count in (min(SHOWN_TIMES, variable.n_sample), min(MAX_TIMES, variable.n_sample)):
        rise = np.diff(variable.read(0, 0, count))
        if not ((rise > 0).all() and rise.max() < 2 * rise.min()):
            return False
    return True


def _times_of(variable: Variable, times: list[Variable]) -> Variable | None:
    """Return the times of an array, of the innermost group; None if there are several."""
    fitting = [
        time
        for time in times
        if time.n_sample == variable.n_sample and variable.key.startswith(time.group)
    ]
    group = max((time.group for time in fitting), key=len, default="")
    inner = [time for time in fitting if time.group == group]
    return inner[0] if len(inner) == 1 else None


def _rate(time: Variable, header: Header, name: str) -> tuple[float | None, str, tuple[Note, ...]]:
    """Return sample rate, Hz, the date of time zero if it is stated, and notes, from times.

    The rate is None if it is not known whether the times were multiplied by a factor.
    """
    label = f"{name}: {time.key}"
    if time.n_sample > MAX_TIMES:
        refuse(f"{label}: {time.n_sample} times", f"up to {MAX_TIMES}, or a sample_rate")
    own = _header_of(time, header)[0]
    scale, since = 1.0, ""
    factor, offset, applied = _scaling(own)
    if time.n_column == 1:
        if find_unapplied((entry for entry in own if entry not in applied), "s"):
            return None, "", ()
        unit, _, since = find_word(own, UNIT).partition(" since ")
        scale = time_scale(unit or split_title(time.title)[1], label)
    values = (time.read(0, 0, time.n_sample) * factor + offset) * scale
    _, step, notes = uniform_grid(values, label)
    return 1 / step, since, notes
