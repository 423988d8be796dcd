"""TDMS files of LabVIEW by npTDMS."""

from __future__ import annotations

import logging
import os
import weakref
from contextlib import contextmanager
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from thud.base.checks import refuse
from thud.recordings.channel import Channel, guarded, library, shown_path, shown_text
from thud.recordings.header_aliases import (
    DATE,
    UNIT,
    find_rate,
    find_unapplied,
    find_word,
    text_of,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

MAX_CHANNELS = 1024
# Bytes before the metadata of a segment, and the bit of its fifth byte that means big-endian.
LEAD = 28
BIG_ENDIAN = 64


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
        return library("nptdms", "TDMS").TdmsFile.open(file)

    def read(self, group: str, name: str, start: int, stop: int) -> NDArray[np.float64]:
        """Return the samples of a channel from start to before stop."""
        with guarded(self.path, "TDMS"), _refused_warnings(self.path):
            return np.asarray(self.tdms[group][name][start:stop], dtype=np.float64)


@contextmanager
def _refused_warnings(path: Path) -> Iterator[None]:
    """Raise InputError for a warning of the library: what it returns is not what the file states.

    It warns of scales that it does not know, whose raw values it returns, and of segments that are
    cut off, whose remaining samples it returns.
    """

    def refuse_warning(record: logging.LogRecord) -> bool:
        if record.levelno >= logging.WARNING:
            refuse(
                f"{shown_path(path)}: npTDMS cannot read it completely, and warns: "
                f"{shown_text(record.getMessage())}",
                "a complete file; if a scale is not supported, a table of the scaled values",
            )
        return True

    # Each module of the library has a logger of its own.
    loggers = list(library("nptdms", "TDMS").log.log_manager.loggers.values())
    for logger in loggers:
        logger.addFilter(refuse_warning)
    try:
        yield
    finally:
        for logger in loggers:
            logger.removeFilter(refuse_warning)


def read_channels(path: Path) -> list[Channel]:
    """Return the numeric channels of a TDMS file."""
    file = _OpenFile(path)
    with _refused_warnings(path):
        entries = [(group, channel) for group in file.tdms.groups() for channel in group.channels()]
        if len(entries) > MAX_CHANNELS:
            refuse(f"{shown_path(path)}: {len(entries)} channels", f"up to {MAX_CHANNELS}")
        channels = [
            _channel(file, number, group, channel)
            for number, (group, channel) in enumerate(entries, start=1)
            if channel.dtype.kind in "iuf" and len(channel)
        ]
    if _is_cut_in_lead(path) or not channels:
        refuse(f"{shown_path(path)}: is cut off or has no channel of numbers", "a complete file")
    return channels


def _is_cut_in_lead(path: Path) -> bool:
    """Whether a file ends within the lead of a segment, of which the library does not warn."""
    size = path.stat().st_size
    with path.open("rb") as file:
        while len(lead := file.read(LEAD)) == LEAD:
            order: Literal["big", "little"] = "big" if lead[4] & BIG_ENDIAN else "little"
            file.seek(min(int.from_bytes(lead[12:20], order), size), os.SEEK_CUR)
    return bool(lead)


def _channel(file: _OpenFile, number: int, group: Any, channel: Any) -> Channel:  # noqa: ANN401
    size = file.path.stat().st_size
    if len(channel) > size:  # a sample has one byte or more
        refuse(
            f"{shown_path(file.path)}: {len(channel)} samples in {size} bytes",
            "an undamaged TDMS file",
        )
    owners = [owner.properties for owner in (channel, group, file.tdms)]
    items = [(str(key), text_of(value)) for owner in owners for key, value in owner.items()]
    unit = find_word(items, UNIT)
    return Channel(
        name=channel.name,
        number=number,
        n_sample=len(channel),
        samples=partial(file.read, group.name, channel.name),
        unit=unit,
        sample_rate=find_rate(items),
        date=find_word(items, DATE),
        unapplied=find_unapplied(items, unit),
    )
