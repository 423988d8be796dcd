"""What the calls of `recordings.toml` use."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pytest
import scipy.io
import soundfile
from conftest import REPOSITORY
from recording_files import (
    FORCE,
    RATE,
    WITH_HEADER,
    WRITERS,
    noisy,
    opened,
    patch,
    recording_file,
    rows_of,
    steps,
)
from refusals.core import write
from synthetic import half_sine as pulse
from test_recordings_calibration import (
    DROOPED,
    STEADY,
    TIME as WEIGHING,
    calibrated as weight,
    high_pass,
    weighed,
)

import thud
from thud.recordings.calibration import calibrate
from thud.recordings.config import Config, read_config, to_channels
from thud.recordings.force_units import Calibration, newtons_per_unit
from thud.recordings.formats.text import read_table
from thud.recordings.instruments import Plate
from thud.recordings.plate_tap import calibrate_tap
from thud.recordings.signal import Signal, add_signals, orient
from thud.studies.fitting.record import time_and_force

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

# What is only imported for the table.
__all__ = [
    "DROOPED", "STEADY", "Calibration", "Plate", "add_signals", "h5py", "high_pass",
    "newtons_per_unit", "noisy", "orient", "os", "patch", "pulse", "recording_file", "steps",
    "struct", "to_channels",
    "weighed", "weight",
]  # fmt: skip

TIME = np.arange(len(FORCE)) / RATE


def written(head: str, row: str | Callable[..., str] = "{t:.6f};{f:.2f}") -> list[Signal]:
    """Return the channels of a table of time and force below a head."""
    return opened(write("plate.csv", head + rows_of(row)))


def sound_file(values: ArrayLike, kind: str = "DOUBLE") -> Path:
    """Write a sound; return its path."""
    soundfile.write("plate.wav", values, int(RATE), kind)
    return Path("plate.wav")


def sound(values: ArrayLike, kind: str = "DOUBLE", **stated: Any) -> list[Signal]:  # noqa: ANN401
    """Return the channels of a sound."""
    return opened(sound_file(values, kind), **stated)


def pcm(**stated: Any) -> list[Signal]:  # noqa: ANN401
    """Return the channels of a sound of integers."""
    return sound(FORCE / 5000, "PCM_24", **stated)


def header(name: str, *entries: tuple[str, str, Any]) -> list[Signal]:
    """Return the channels of a file with entries in its header and a rate."""
    WITH_HEADER[name](Path(name), FORCE, [("array", "Fs", RATE), *entries])
    return opened(name)


def matlab(**variables: Any) -> list[Signal]:  # noqa: ANN401
    """Return the channels of a MATLAB file of variables."""
    scipy.io.savemat("a.mat", variables)
    return opened("a.mat")


def hdf5(fill: Callable[[h5py.File], object], name: str = "new.h5") -> list[Signal]:
    """Return the channels of an HDF5 file that a function fills or changes."""
    if name in WRITERS:
        recording_file(name)
    with h5py.File(name, "a") as file:
        fill(file)
    return opened(name)


def netcdf(**attributes: Any) -> list[Signal]:  # noqa: ANN401
    """Return the channels of a NetCDF file whose force has attributes."""
    return hdf5(lambda file: file["force"].attrs.update(attributes), "plate.nc")


def virtual() -> h5py.VirtualLayout:
    """Return a dataset of another file."""
    layout = h5py.VirtualLayout((10,), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (10,))
    return layout


def with_count(path: Path, old: int, new: int) -> Path:
    """Replace a count of 8 bytes in a file; return its path."""
    data = path.read_bytes()
    assert struct.pack("<Q", old) in data
    return write(str(path), data.replace(struct.pack("<Q", old), struct.pack("<Q", new)))


def bomb(name: str) -> Path:
    """Write a quarter of a gibibyte of zeros into a quarter of a mebibyte of a MATLAB file."""
    packer = zlib.compressobj(1)
    head = struct.pack("<12I", 14, 2**28 + 56, 6, 8, 6, 0, 5, 8, 1, 2**25, 1, 2**16 + 70)
    packed = packer.compress(head) + b"".join(packer.compress(bytes(2**20)) for _ in range(256))
    packed += packer.flush()
    begin = recording_file(name).read_bytes()[:128]
    return write(name, begin + struct.pack("<II", 15, len(packed)) + packed)


def text(content: str) -> list[Signal]:
    """Return the channels of a table."""
    return opened(write("plate.csv", content))


def both(head: str, row: str) -> NDArray[np.float64]:
    """Return time and force of a table; the same is refused in a recording."""
    path = write("plate.csv", head + "\n" + rows_of(row))
    with pytest.raises(thud.InputError):
        time_and_force(read_table(path))
    return opened(path)


def example(**choice: Any) -> thud.Recording:  # noqa: ANN401
    """Return the recording of the example of three drops with a choice of them."""
    folder = REPOSITORY / "inputs/recordings"
    config = read_config(folder / "lab.toml").updated(**choice)
    return thud.read_recording(folder / "three_drops.flac", config=config)


def cells_file(names: str = "F1 F2 F3 F4", shares: Sequence[float] = (0.2, 0.3, 0.1, 0.4)) -> str:
    """Write a table of load cells that share a force; return its name."""
    columns = [share * FORCE for _, share in zip(names.split(), shares, strict=False)]
    titles = ",".join(["t [s]", *(f"{name} [N]" for name in names.split())])
    table = np.column_stack([TIME, *columns])
    np.savetxt("cells.csv", table, "%.7g", ",", header=titles, comments="")
    return "cells.csv"


def cells(*columns: Any, **stated: Any) -> thud.Recording:  # noqa: ANN401
    """Return the recording of load cells."""
    return thud.read_recording(cells_file(*columns), config=Config(**stated))


def config(text: str) -> Config:
    """Return a configuration."""
    return read_config(write("lab.toml", text))


def known(values: ArrayLike, **stated: Any) -> Calibration:  # noqa: ANN401
    """Return the calibration of a record."""
    return calibrate(Signal.from_array(values, 5000.0), **{"unit": "V", **stated})


def crept(end: float) -> NDArray[np.float64]:
    """Return the creep of a load cell after a weight is put on, 1."""
    return np.log1p(np.maximum(WEIGHING - end, 0) / 0.5)


def tap(values: ArrayLike, rate: float = 2e4) -> Any:  # noqa: ANN401
    """Return the plate that taps show."""
    return calibrate_tap(Signal.from_array(values, rate))
