"""TDMS files of LabVIEW by npTDMS."""

from __future__ import annotations

import logging
import os
import struct
import weakref
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from thud.base.checks import refuse
from thud.recordings.channel import Channel, guarded, library, shown_path
from thud.recordings.header_aliases import DATE, UNIT, find_rate, find_word, text_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

MAX_CHANNELS = 1024
MAX_SEGMENTS = 200_000
# Lead-in of a segment: mark, flags, version, length of the segment, length of its metadata.
LEAD = struct.Struct("<4sIIQQ")


class _OpenFile:
    """A TDMS file that stays open, as its metadata may be long; other processes open it again."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[type[_OpenFile], tuple[Path]]:
        return _OpenFile, (self.path,)

    @cached_property
    def tdms(self) -> Any:  # noqa: ANN401 - of the library
        """File opened by the library; it is closed with this object."""
        file = self.path.open("rb")
        weakref.finalize(self, file.close)
        return _library().TdmsFile.open(file)

    def read(self, group: str, name: str, start: int, stop: int) -> NDArray[np.float64]:
        """Return the samples of a channel from start to before stop."""
        with guarded(self.path, "TDMS"):
            return np.asarray(self.tdms[group][name][start:stop], dtype=np.float64)


def _library() -> Any:  # noqa: ANN401 - a module
    """Return the library without its warnings; files that cause them are rejected here."""
    nptdms = library("nptdms", "TDMS")
    # Each module of the library has a logger with its own level.
    nptdms.log.log_manager.set_level(logging.ERROR)
    return nptdms


def read_channels(path: Path) -> list[Channel]:
    """Return the numeric channels of a TDMS file."""
    _library()
    with path.open("rb") as raw:
        _require_complete(raw, shown_path(path))
    file = _OpenFile(path)
    entries = [(group, channel) for group in file.tdms.groups() for channel in group.channels()]
    if len(entries) > MAX_CHANNELS:
        refuse(f"{shown_path(path)}: {len(entries)} channels", f"up to {MAX_CHANNELS}")
    return [
        _channel(file, number, group, channel)
        for number, (group, channel) in enumerate(entries, start=1)
        if channel.dtype.kind in "iuf" and len(channel)
    ]


def _channel(file: _OpenFile, number: int, group: Any, channel: Any) -> Channel:  # noqa: ANN401
    size = file.path.stat().st_size
    if len(channel) > size:  # a sample has one byte or more
        refuse(
            f"{shown_path(file.path)}: {len(channel)} samples in {size} bytes",
            "an undamaged TDMS file",
        )
    owners = [owner.properties for owner in (channel, group, file.tdms)]
    items = [(str(key), text_of(value)) for owner in owners for key, value in owner.items()]
    return Channel(
        name=channel.name,
        number=number,
        n_sample=len(channel),
        samples=partial(file.read, group.name, channel.name),
        unit=find_word(items, UNIT),
        sample_rate=find_rate(items),
        date=find_word(items, DATE),
    )


def _require_complete(file: BinaryIO, name: str) -> None:
    """Raise InputError if a segment is cut off; the library only warns."""
    size = os.fstat(file.fileno()).st_size
    begin = 0
    for _ in range(MAX_SEGMENTS):
        file.seek(begin)
        lead = file.read(LEAD.size)
        if not lead:
            return
        if len(lead) < LEAD.size or begin + LEAD.size + LEAD.unpack(lead)[3] > size:
            refuse(f"{name}: is cut off in the segment at byte {begin}", "a complete file")
        begin += LEAD.size + LEAD.unpack(lead)[3]
    refuse(f"{name}: more than {MAX_SEGMENTS} segments", "a recording")
