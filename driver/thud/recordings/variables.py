"""Channels from named arrays in memory."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.recordings.channel import MIN_SAMPLES, Channel
from thud.recordings.header_aliases import (
    DATE,
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
    channels = []
    for number, (key, index, column) in enumerate(columns, start=1):
        if key in times and len(columns) > 1:
            continue
        group, title = _split(key)
        header = [
            (_split(other)[1], text_of(value))
            for other, value in sorted(values.items(), key=lambda item: -item[0].count("/"))
            if np.size(value) == 1 and group.startswith(_split(other)[0])
        ]
        time = next(
            (t for t in times if len(times[t]) == len(column) and _split(t)[0] == group), None
        )
        siblings = [(_split(k)[1], text_of(v)) for k, v in values.items() if _split(k)[0] == group]
        # Times override a rate in the header of an outer group.
        rate, steps = find_rate(header if time is None else siblings), tuple[str, ...]()
        if rate is None and time is not None:
            scale = TIME_UNITS.get(split_title(_split(time)[1])[1].casefold(), 1.0)
            _, step, steps = uniform_grid(times[time] * scale, f"{name}: {time}")
            rate = 1 / step
        channels.append(
            Channel(
                name=key + index,
                number=number,
                n_sample=len(column),
                samples=partial(read_array, column),
                unit=split_title(title)[1] or find_word(header, UNIT),
                sample_rate=rate,
                date=find_word(header, DATE),
                steps=steps,
            )
        )
    if not channels:
        refuse(f"{name}: has no vector of {MIN_SAMPLES} or more real numbers", "a recorded channel")
    return channels


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
