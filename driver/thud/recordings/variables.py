"""Named vectors and scalars of a file that is in memory, as channels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.recordings.channel import Channel
from thud.recordings.grid import even_grid
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
from thud.recordings.signal import ArraySamples

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A matrix with more rows and columns than this holds no channels.
MOST_COLUMNS = 256
SHORTEST = 8


def channels_of_variables(values: dict[str, NDArray[np.generic]], name: str) -> list[Channel]:
    """Return the channels among variables: vectors, and the columns of slender matrices.

    Scalars and texts are the header; a vector of times gives the rate of those of its length. Both
    count for the variables of their own group, the name up to a stroke, and of groups in it.
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
        group, word = _split(key)
        header = [
            (_split(other)[1], text_of(value))
            for other, value in sorted(values.items(), key=lambda one: -one[0].count("/"))
            if np.size(value) == 1 and group.startswith(_split(other)[0])
        ]
        same = next(
            (t for t in times if len(times[t]) == len(column) and _split(t)[0] == group), None
        )
        near = [(_split(k)[1], text_of(v)) for k, v in values.items() if _split(k)[0] == group]
        # Times beside a vector tell more of it than a rate farther away.
        own, steps = find_rate(header if same is None else near), tuple[str, ...]()
        if own is None and same is not None:
            scale = TIME_UNITS.get(split_title(_split(same)[1])[1].casefold(), 1.0)
            _, step, steps = even_grid(times[same] * scale, f"{name}: {same}")
            own = 1 / step
        channels.append(
            Channel(
                name=key + index,
                number=number,
                n_sample=len(column),
                samples=ArraySamples(column),
                unit=split_title(word)[1] or find_word(header, UNIT),
                sample_rate=own,
                date=find_word(header, DATE),
                steps=steps,
            )
        )
    if not channels:
        refuse(f"{name}: has no vector of {SHORTEST} or more real numbers", "a recorded channel")
    return channels


def _split(key: str) -> tuple[str, str]:
    """Return the group of a variable, with its stroke, and its name in it."""
    group, stroke, word = key.rpartition("/")
    return group + stroke, word


def _as_columns(value: NDArray[np.generic]) -> NDArray[np.generic] | None:
    """Return the columns of a vector or a slender matrix; None where it is neither."""
    if value.dtype.kind not in "iuf" or value.ndim not in {1, 2} or value.size < SHORTEST:
        return None
    matrix = value.reshape(len(value), -1)
    if matrix.shape[1] > matrix.shape[0]:
        matrix = matrix.T
    return matrix if matrix.shape[0] >= SHORTEST and matrix.shape[1] <= MOST_COLUMNS else None
