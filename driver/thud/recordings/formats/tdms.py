"""TDMS files of LabVIEW by npTDMS."""

from __future__ import annotations

import logging
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from thud.base.checks import refuse, shown_text
from thud.base.extras import library
from thud.recordings.formats import Channel, guarded
from thud.recordings.words import read_facts, text_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

# Bytes before the metadata of a segment, and the bit of its fifth byte that means big-endian.
LEAD = 28
BIG_ENDIAN = 64
# Scales that npTDMS applies; of others it returns the raw values.
SCALES = {
    "Linear", "Polynomial", "Table", "Add", "Subtract", "AdvancedAPI", "RTD", "Strain",
    "Thermistor", "Thermocouple",
}  # fmt: skip


def _library() -> Any:  # noqa: ANN401 - a module
    """Return npTDMS, which logs damage that is refused, or read over, to the screen."""
    module = library("nptdms", "recordings")
    module.log.log_manager.set_level(logging.CRITICAL)
    return module


def _read(path: Path, group: str, name: str, start: int, stop: int) -> NDArray[np.float64]:
    tdms = _library().TdmsFile
    with guarded(path, "TDMS"), path.open("rb") as file:
        return np.asarray(tdms.open(file)[group][name][start:stop], dtype=np.float64)


def read_channels(path: Path) -> list[Channel]:
    """Return the numeric channels of a TDMS file."""
    with path.open("rb") as file:
        tdms = _library().TdmsFile.open(file)
        entries = [(group, channel) for group in tdms.groups() for channel in group.channels()]
        channels = [
            _channel(path, number, (channel, group, tdms))
            for number, (group, channel) in enumerate(entries, start=1)
            if channel.dtype.kind in "iuf" and len(channel)
        ]
    if _is_cut(path) or not channels:
        refuse(f"{shown_text(path)}: is cut off or has no channel of numbers", "a complete file")
    return channels


def _is_cut(path: Path) -> bool:
    """Whether a file does not end with a segment; the library reads what is left."""
    position, size = 0, path.stat().st_size
    with path.open("rb") as file:
        while position < size:
            file.seek(position)
            lead = file.read(LEAD)
            if not lead.startswith(b"TDSm") or len(lead) < LEAD:
                return True
            order: Literal["big", "little"] = "big" if lead[4] & BIG_ENDIAN else "little"
            position += LEAD + int.from_bytes(lead[12:20], order)
    return position != size


def _channel(path: Path, number: int, owners: tuple[Any, Any, Any]) -> Channel:
    """Return a channel from itself, its group and its file."""
    channel, group, _ = owners
    size = path.stat().st_size
    if len(channel) > size:  # a sample has one byte or more
        refuse(f"{shown_text(path)}: {len(channel)} samples in {size} bytes", "an undamaged file")
    items = [(str(key), text_of(value)) for o in owners for key, value in o.properties.items()]
    scales = {value for key, value in items if key.endswith("_Scale_Type")}
    if unknown := scales - SCALES:
        refuse(
            f"{shown_text(path)}: npTDMS does not apply the scale {shown_text(min(unknown))!r}",
            f"a table of the scaled values, or scales of {', '.join(sorted(SCALES))}",
        )
    facts, samples = read_facts(items), partial(_read, path, group.name, channel.name)
    return Channel(
        channel.name, number, len(channel), samples, facts.unit, facts.rate,
        date=facts.date, unapplied=facts.unapplied,
    )  # fmt: skip
