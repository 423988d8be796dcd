"""TDMS files of LabVIEW by npTDMS."""

from __future__ import annotations

import logging
import os
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from thud.checks import refuse
from thud.recordings.channel import BoundedFile, Channel, guarded, library, shown_path
from thud.recordings.words import DATE, UNIT, find_rate, find_word, text_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

MOST_CHANNELS = 1024
MOST_SEGMENTS = 200_000
# Mark, kinds of contents, version, and lengths of a segment and of its description.
LEAD = struct.Struct("<4sIIQQ")


@dataclass(frozen=True)
class TdmsSamples:
    """One channel of a TDMS file, opened for each piece."""

    path: Path
    group: str
    name: str

    def __call__(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return the samples from start to before stop."""
        nptdms = library("nptdms", "TDMS")
        with (
            guarded(self.path, "TDMS"),
            self.path.open("rb") as file,
            nptdms.TdmsFile.open(BoundedFile(file, shown_path(self.path))) as tdms,
        ):
            return np.asarray(tdms[self.group][self.name][start:stop], dtype=np.float64)


def read_channels(path: Path) -> list[Channel]:
    """Return the numeric channels of a TDMS file."""
    nptdms = library("nptdms", "TDMS")
    # What it warns of is refused here.
    logging.getLogger("nptdms").setLevel(logging.ERROR)
    with path.open("rb") as file:
        _require_complete(file, shown_path(path))
    with path.open("rb") as file, nptdms.TdmsFile.open(BoundedFile(file, shown_path(path))) as tdms:
        found = [(group, one) for group in tdms.groups() for one in group.channels()]
        if len(found) > MOST_CHANNELS:
            refuse(f"{shown_path(path)}: {len(found)} channels", f"up to {MOST_CHANNELS}")
        size = path.stat().st_size
        return [
            _channel(path, size, number, (tdms, group, one))
            for number, (group, one) in enumerate(found, start=1)
            if one.dtype.kind in "iuf" and len(one)
        ]


def _channel(path: Path, size: int, number: int, owned: tuple[Any, Any, Any]) -> Channel:
    """Return a channel of a TDMS file, of the file, its group and itself."""
    tdms, group, one = owned
    if len(one) > size:  # a sample has at least a byte
        refuse(f"{shown_path(path)}: {len(one)} samples in {size} bytes", "an undamaged TDMS file")
    owners = [owner.properties for owner in (one, group, tdms)]
    items = [(str(key), text_of(value)) for owner in owners for key, value in owner.items()]
    return Channel(
        name=one.name,
        number=number,
        n_sample=len(one),
        samples=TdmsSamples(path, group.name, one.name),
        unit=find_word(items, UNIT),
        sample_rate=find_rate(items),
        date=find_word(items, DATE),
    )


def _require_complete(file: BinaryIO, name: str) -> None:
    """Raise InputError where a segment is cut off, which the library only warns of."""
    size = os.fstat(file.fileno()).st_size
    begin = 0
    for _ in range(MOST_SEGMENTS):
        file.seek(begin)
        lead = file.read(LEAD.size)
        if not lead:
            return
        if len(lead) < LEAD.size or begin + LEAD.size + LEAD.unpack(lead)[3] > size:
            refuse(f"{name}: is cut off in the segment at byte {begin}", "a complete file")
        begin += LEAD.size + LEAD.unpack(lead)[3]
    refuse(f"{name}: more than {MOST_SEGMENTS} segments", "a recording")
