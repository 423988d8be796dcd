"""Universal files, data set 58 in text and binary, by pyuff."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from thud.base.checks import refuse, shown_text
from thud.base.extras import library
from thud.base.files import require_small
from thud.base.immutable import freeze
from thud.base.note import Note
from thud.base.units import factor_to, size_of
from thud.recordings.formats import Channel, uniform_grid

if TYPE_CHECKING:
    from pathlib import Path

# Maximum size, bytes: the library keeps the text and a list of its numbers in memory.
MAX_SIZE = 2**25
MAX_SETS = 1024
FUNCTION, UNIT_SYSTEM = 58, 164
TIME_RESPONSE = 1
REAL = (2, 4)
# Specific data types: unknown or general, and forces (reaction, excitation).
UNKNOWN = (0, 1)
FORCES = (9, 13)
# Relative difference between two statements of the same unit.
SAME_UNIT = 1e-3


class DataSet(NamedTuple):
    """A data set 58, and the units of the data set 164 above it, m and N; None if there is none."""

    record: dict[str, Any]
    length: float | None
    force: float | None

    def label(self, field: str) -> str:
        """Return the text of a field, empty if it is not used."""
        text: str = self.record[field].strip()
        return "" if text.upper() == "NONE" else text


def read_data_sets(path: Path, function_type: int) -> list[DataSet]:
    """Return the data sets 58 of a function type, such as 1 for time histories."""
    require_small(path, "a universal file", MAX_SIZE)
    file = library("pyuff", "recordings").UFF(os.fsencode(path))
    kinds = [int(kind) for kind in file.get_set_types()]
    if len(kinds) > MAX_SETS:
        refuse(f"{shown_text(path)}: {len(kinds)} data sets", f"up to {MAX_SETS}")
    length: float | None = None
    force: float | None = None
    found = []
    for number, kind in enumerate(kinds):
        if kind not in {FUNCTION, UNIT_SYSTEM}:
            continue
        record = file.read_sets(number)
        if kind == FUNCTION:
            if record.get("func_type") == function_type:
                found.append(DataSet(record, length, force))
            continue
        if not all(0 < record[name] < math.inf for name in ("length", "force")):
            refuse(
                f"{shown_text(path)}: data set 164 has units of length {record['length']:g} and "
                f"force {record['force']:g}",
                "positive numbers per m and per N",
            )
        length, force = 1 / record["length"], 1 / record["force"]
    return found


def read_channels(path: Path) -> list[Channel]:
    """Return the time histories of a universal file."""
    histories = [
        data_set
        for data_set in read_data_sets(path, TIME_RESPONSE)
        if data_set.record.get("ord_data_type") in REAL
    ]
    if not histories:
        refuse(f"{shown_text(path)}: has no time history", "data sets 58 of function type 1, real")
    return [_channel(path, number, data_set) for number, data_set in enumerate(histories, start=1)]


def _channel(path: Path, number: int, data_set: DataSet) -> Channel:
    name, record = f"{shown_text(path)}: data set {number}", data_set.record
    data = np.asarray(record["data"], dtype=np.float64)
    expected = int(record["num_pts"])
    # A final line feed may add a value to binary data sets.
    if data.size < expected or expected < 1:
        refuse(f"{name}: {data.size} samples, {expected} expected", "a complete file")
    scale = factor_to("s", data_set.label("abscissa_axis_units_lab"), name)
    notes: tuple[Note, ...] = ()
    if record["abscissa_spacing"] == 1:
        step = record["abscissa_inc"] * scale
        rate = 1 / step if step > 0 else None
    else:
        times = np.asarray(record["x"], dtype=np.float64)[:expected] * scale
        *_, rate, notes = uniform_grid(times, name)
    unit, newtons, note = _ordinate(data_set)
    return Channel(
        name=data_set.label("ordinate_axis_lab") or record["id1"].strip(),
        number=number,
        n_sample=expected,
        samples=freeze(data[:expected] * newtons),
        unit=unit,
        sample_rate=rate,
        date=data_set.label("id3"),
        notes=notes + note,
    )


def _ordinate(data_set: DataSet) -> tuple[str, float, tuple[Note, ...]]:
    """Return the unit of the samples, a factor that converts them to it, and notes.

    The unit is that of the label; without a label, that of the data type in data set 164. If both
    are stated and differ, the unit is a text that is none, so that the user must state it.
    """
    label, force = data_set.label("ordinate_axis_units_lab"), data_set.force
    kind = data_set.record["ordinate_spec_data_type"]
    if label:
        base, size = size_of(label)
        if base == "N" and force and kind in FORCES and abs(force / size - 1) > SAME_UNIT:
            return f"{label} by the label, {force:.5g} N by data set 164", 1.0, ()
        return label, 1.0, ()
    if kind in FORCES:
        return "N", force or 1.0, (Note("unit_of_data_type", value=force or 1.0, unit="N"),)
    is_unknown = kind in UNKNOWN and force in {None, 1.0}
    return "" if is_unknown else "units of data set 164", 1.0, ()
