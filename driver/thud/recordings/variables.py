"""Channels from named arrays in memory."""

from __future__ import annotations

from functools import partial
from itertools import takewhile
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.recordings.channel import MIN_SAMPLES, Channel
from thud.recordings.header_aliases import (
    DATE,
    TIME,
    TIME_UNITS,
    UNIT,
    find_rate,
    find_word,
    is_time,
    split_title,
    text_of,
)
from thud.recordings.signal import read_array
from thud.recordings.uniform_grid import uniform_grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Maximum number of columns of a matrix of channels.
MAX_COLUMNS = 256


def channels_of_variables(values: dict[str, NDArray[np.generic]], name: str) -> list[Channel]:
    """Return the channels among variables: vectors, and the columns of slender matrices.

    Scalars and texts are the header; a vector of times gives the rate of vectors of its length. A
    group is the name up to the last slash. A header applies to its group and the groups within it,
    times to their group.
    """
    columns = [
        (key, f"[{i + 1}]" * (matrix.shape[1] > 1), matrix[:, i].astype(np.float64))
        for key, value in values.items()
        if (matrix := _as_columns(value)) is not None
        for i in range(matrix.shape[1])
    ]
    times = {key: column for key, _, column in columns if is_time(_split(key)[1])}
    times |= {
        key: column
        for key, index, column in columns
        if _split(key)[1].rpartition("_")[2].casefold() in TIME and not index and _rises(column)
    }
    # The first column of a matrix may hold the times of the others.
    own_times = {key: column for key, index, column in columns if index == "[1]" and _rises(column)}
    channels = []
    for number, (key, index, column) in enumerate(columns, start=1):
        if (key in times and len(columns) > 1) or (key in own_times and index == "[1]"):
            continue
        group, title = _split(key)
        header = [
            (_split(other)[1], text_of(value))
            for other, value in sorted(values.items(), key=lambda item: -item[0].count("/"))
            if np.size(value) == 1 and _applies(_split(other)[0], group)
        ]
        named = [t for t in times if len(times[t]) == len(column) and _split(t)[0] == group]
        # Of several times, those with the longest common begin of the name.
        time = max(named, key=partial(_common_length, key), default=None)
        siblings = [(_split(k)[1], text_of(v)) for k, v in values.items() if _split(k)[0] == group]
        # Times override a rate in the header of an outer group.
        rate, steps = find_rate(header if time is None else siblings), tuple[str, ...]()
        if key in own_times:
            _, step, steps = uniform_grid(own_times[key], f"{name}: {key}")
            rate = 1 / step
        elif rate is None and time is not None:
            scale = TIME_UNITS.get(split_title(_split(time)[1])[1].casefold(), 1.0)
            _, step, steps = uniform_grid(times[time] * scale, f"{name}: {time}")
            rate = 1 / step
        channels.append(
            Channel(
                name=key + index,
                number=number,
                n_sample=len(column),
                samples=partial(read_array, column),
                unit=split_title(title)[1]
                or find_word(header, UNIT)
                or text_of(values.get(f"{group}quantity/label", np.array(""))),
                sample_rate=rate,
                date=find_word(header, DATE),
                steps=steps,
            )
        )
    if not channels:
        refuse(f"{name}: has no vector of {MIN_SAMPLES} or more real numbers", "a recorded channel")
    return channels


def _applies(owner: str, group: str) -> bool:
    """Whether the header of a group applies to another one.

    Siemens Testlab exports have the step in ``x_values`` and the samples in ``y_values``.
    """
    siblings = {group, group.removesuffix("y_values/") + "x_values/"}
    return group.startswith(owner) or (group.endswith("y_values/") and owner in siblings)


def _common_length(name: str, other: str) -> int:
    """Return the length of the common begin of two names."""
    return sum(
        1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(name, other, strict=False))
    )


def _rises(column: NDArray[np.float64]) -> bool:
    """Whether a column rises uniformly enough to be times."""
    rise = np.diff(column)
    return bool((rise > 0).all() and rise.max() < 2 * rise.min())


def _split(key: str) -> tuple[str, str]:
    """Return the group of a variable, with its slash, and its name in the group."""
    group, slash, name = key.rpartition("/")
    return group + slash, name


def _as_columns(value: NDArray[np.generic]) -> NDArray[np.generic] | None:
    """Return the columns of a vector or a slender matrix; None for anything else."""
    if value.dtype.kind not in "iuf" or value.ndim not in {1, 2} or value.size < MIN_SAMPLES:
        return None
    matrix = value.reshape(len(value), -1)
    if matrix.shape[1] > matrix.shape[0]:
        matrix = matrix.T
    return matrix if matrix.shape[0] >= MIN_SAMPLES and matrix.shape[1] <= MAX_COLUMNS else None
