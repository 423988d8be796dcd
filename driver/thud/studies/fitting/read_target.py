"""Targets of fits, as a study file describes them."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeAlias

from thud.base._schema import QUANTITIES, SAMPLE_QUANTITIES
from thud.base.checks import refuse, refuse_unknown, refuse_value, require_number
from thud.base.units import power_of, scaled
from thud.recordings.formats import FORMATS
from thud.recordings.formats.text import read_table
from thud.recordings.recording import read_recording
from thud.studies.fitting.compression_target import CompressionTarget
from thud.studies.fitting.force_target import ForceTarget
from thud.studies.fitting.level_target import LevelTarget
from thud.studies.fitting.record import read_record, time_and_force
from thud.studies.parameter import read_quantity

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import ArrayLike

    from thud.recordings.recording import Recording

# What [target] may hold, and the units of its numbers.
_FORCE_KEYS = ("file", "config", *(f.name for f in fields(ForceTarget) if f.name != "record"))
_LEVEL_KEYS = (*(f.name for f in fields(LevelTarget) if f.name != "quantities"), *SAMPLE_QUANTITIES)
_UNITS = {
    "noise": "N", "below": "Hz", "window": "s", "frequencies": "Hz", "gain": "",
}  # fmt: skip

Target: TypeAlias = ForceTarget | LevelTarget | CompressionTarget


def read_target(table: dict[str, Any], folder: Path) -> Target:
    """Return the target of a table [target]; its paths are relative to a folder."""
    if ("file" in table) == ("levels" in table):
        refuse("[target] takes one of file and levels", "file = 'record.csv' or levels = [...]")
    refuse_unknown("[target]", table, _FORCE_KEYS if "file" in table else _LEVEL_KEYS)
    options = {
        name: read_quantity(f"[target] {name}", value, _UNITS[name]) if name in _UNITS else value
        for name, value in table.items()
    }
    if "levels" in table:
        quantities = {
            name: _measured(f"[target] {name}", options.pop(name), QUANTITIES[name].unit)
            for name in SAMPLE_QUANTITIES
            if name in options
        }
        return LevelTarget(**options, quantities=quantities)
    paths = {word: options.pop(word) for word in ("file", "config") if word in options}
    for word, name in paths.items():
        if not isinstance(name, str) or not name.strip():
            refuse_value(f"[target] {word}", name, "text in quotes")
    return ForceTarget(
        _read_record(
            folder / paths["file"],
            folder / paths["config"] if "config" in paths else None,
            measured=bool({"config", "drop"} & set(table)),
        ),
        **options,
    )


def _read_record(
    path: Path, config: Path | None, *, measured: bool
) -> Recording | tuple[ArrayLike, ArrayLike]:
    """Return the record of a file.

    Tables of time and force, as written by models and other programs, are taken as they are unless
    they are to be measured.
    """
    suffixes = {end for item in FORMATS if item.module != "text" for end in item.suffixes}
    if measured or path.suffix.lower() in suffixes:
        return read_recording(path, config=config)
    samples = time_and_force(read_table(path))
    read_record(samples, str(path))  # refuses what is not a record
    return samples[:, 0], samples[:, 1]


def _measured(label: str, entry: object, unit: str) -> tuple[float, float]:
    """Return value and standard deviation of a table in the unit of a key."""
    words = ("value", "uncertainty")
    if not isinstance(entry, dict) or not set(words) <= set(entry):
        refuse_value(label, entry, "a table of value, uncertainty, unit")
    refuse_unknown(label, entry, (*words, "unit"))
    power = power_of(entry.get("unit", unit or "1"), unit, label)
    for word in words:
        require_number(f"{label}: {word}", entry[word])
    return scaled(entry["value"], power), scaled(entry["uncertainty"], power)
