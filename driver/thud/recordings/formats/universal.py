"""Universal files, data set 58 in text and binary, by pyuff."""

from __future__ import annotations

import os
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import refuse
from thud.recordings.channel import Channel, library, require_small, shown_path
from thud.recordings.header_aliases import TIME_UNITS
from thud.recordings.signal import read_array
from thud.recordings.uniform_grid import uniform_grid

if TYPE_CHECKING:
    from pathlib import Path

# Maximum size, bytes: the library keeps the text and a list of its numbers in memory.
MAX_SIZE = 2**25
MAX_SETS = 1024
TIME_RESPONSE = 1
FORCES = (9, 13)
REAL = (2, 4)
NONE = {"", "NONE"}


def read_channels(path: Path) -> list[Channel]:
    """Return the time histories of a universal file."""
    require_small(path, "a universal file", MAX_SIZE)
    file = library("pyuff", "universal").UFF(os.fsencode(path))
    kinds = [int(kind) for kind in file.get_set_types()]
    if len(kinds) > MAX_SETS:
        refuse(f"{shown_path(path)}: {len(kinds)} data sets", f"up to {MAX_SETS}")
    sets = [file.read_sets(number) for number, kind in enumerate(kinds) if kind == 58]  # noqa: PLR2004
    histories = [data_set for data_set in sets if _is_history(data_set)]
    if not histories:
        refuse(f"{shown_path(path)}: has no time history", "data sets 58 of function type 1, real")
    return [_channel(path, number, data_set) for number, data_set in enumerate(histories, start=1)]


def _is_history(data_set: dict[str, Any]) -> bool:
    return data_set.get("func_type") == TIME_RESPONSE and data_set.get("ord_data_type") in REAL


def _channel(path: Path, number: int, data_set: dict[str, Any]) -> Channel:
    name = f"{shown_path(path)}: data set {number}"
    data = np.asarray(data_set["data"], dtype=np.float64)
    expected = int(data_set["num_pts"])
    # A final line feed may add a value to binary data sets.
    if data.size < expected or expected < 1:
        refuse(f"{name}: {data.size} samples, {expected} expected", "a complete file")
    scale = TIME_UNITS.get(data_set["abscissa_axis_units_lab"].casefold(), 1.0)
    steps: tuple[str, ...] = ()
    if data_set["abscissa_spacing"] == 1:
        step = data_set["abscissa_inc"] * scale
    else:
        _, step, steps = uniform_grid(
            np.asarray(data_set["x"], dtype=np.float64)[:expected] * scale, name
        )
    unit = data_set["ordinate_axis_units_lab"].strip()
    if unit.upper() in NONE and data_set["ordinate_spec_data_type"] in FORCES:
        unit = "N"
        steps += ("The data set states no unit; its quantity is a force, read in N.",)
    label = data_set["ordinate_axis_lab"].strip()
    return Channel(
        name=data_set["id1"].strip() if label.upper() in NONE else label,
        number=number,
        n_sample=expected,
        samples=partial(read_array, data[:expected]),
        unit="" if unit.upper() in NONE else unit,
        sample_rate=1 / step if step > 0 else None,
        date=data_set["id3"].strip() if data_set["id3"].strip().upper() not in NONE else "",
        steps=steps,
    )
