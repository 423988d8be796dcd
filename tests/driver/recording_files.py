"""Recordings in every format, for tests: one channel of values with a unit and a rate."""

from __future__ import annotations

import gc
import struct
import warnings
from typing import TYPE_CHECKING, Any

import h5py
import nptdms
import numpy as np
import pyuff
import scipy.io
import soundfile

from thud.recordings.config import Config
from thud.recordings.signal import open_signals

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from thud.recordings.signal import Signal

    Writer = Callable[[Path, NDArray[np.float64], float, str], None]

PEAK, DURATION = 1500.0, 0.02


def opened(path: Path | str, **stated: Any) -> list[Signal]:  # noqa: ANN401 - of `Config`
    """Return the signals of a file of which some keys of the configuration are stated."""
    return open_signals(path, Config(**stated))


def half_sine(rate: float, before: float = 0.01, after: float = 0.01) -> NDArray[np.float64]:
    """Return samples of the half sine of 1500 N and 20 ms with quiet around it."""
    time = np.arange(round((before + DURATION + after) * rate)) / rate - before
    inside = (time > 0) & (time < DURATION)
    return np.where(inside, PEAK * np.sin(np.pi * time / DURATION), 0.0)


def _sound(kind: str, container: str | None = None) -> Writer:
    def write(path: Path, values: NDArray[np.float64], rate: float, unit: str) -> None:
        del unit  # is not held by the format
        with path.open("w+b") as file:
            soundfile.write(
                file, values, round(rate), kind, format=container or path.suffix[1:].upper()
            )

    return write


def _table(head: str, separator: str, *, comma: bool = False, time: bool = True) -> Writer:
    def write(path: Path, values: NDArray[np.float64], rate: float, unit: str) -> None:
        rows = (
            separator.join([f"{i / rate:.9f}"] * time + [f"{value:.17g}"])
            for i, value in enumerate(values)
        )
        text = "\n".join(rows) + "\n"
        if comma:
            text = text.replace(".", ",")
        path.write_text(head.format(rate=rate, unit=unit, step=1 / rate) + text, encoding="utf-8")

    return write


def _hdf5(path: Path, values: NDArray[np.float64], rate: float, unit: str) -> None:
    with h5py.File(path, "w") as file:
        data = file.create_dataset("plate/force", data=values, chunks=(64,), compression="gzip")
        data.attrs["units"], data.attrs["sample_rate"] = unit, rate
        file.attrs["date"] = "2024-05-06"


def _netcdf(path: Path, values: NDArray[np.float64], rate: float, unit: str) -> None:
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(len(values)) / rate
        file["time"].make_scale("time")
        file["time"].attrs["units"] = "s"
        file["force"] = values
        file["force"].dims[0].attach_scale(file["time"])
        file["force"].attrs["units"] = unit


def _universal(binary: int) -> Writer:
    def write(path: Path, values: NDArray[np.float64], rate: float, unit: str) -> None:
        path.unlink(missing_ok=True)
        entry = {
            "type": 58, "binary": binary, "func_type": 1, "data": values, "id1": "force plate",
            "id3": "06-MAY-24 10:00:00", "x": np.arange(len(values)) / rate, "rsp_node": 1,
            "rsp_dir": 3, "ref_node": 1, "ref_dir": 3, "abscissa_spacing": 1,
            "abscissa_inc": 1 / rate, "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 13,
            "orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0,
            "abscissa_axis_units_lab": "s", "ordinate_axis_units_lab": unit,
        }  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)  # the writer leaves a file open
            pyuff.UFF(str(path)).write_sets([entry], "add")
            gc.collect()

    return write


def _matlab(*, packed: bool) -> Writer:
    def write(path: Path, values: NDArray[np.float64], rate: float, unit: str) -> None:
        scipy.io.savemat(path, {"Force": values, "Fs": rate, "unit": unit}, do_compression=packed)

    return write


def _structure(path: Path, values: NDArray[np.float64], rate: float, unit: str) -> None:
    scipy.io.savemat(path, {"plate": {"Force": values, "Fs": rate, "unit": unit}})


def _matlab73(path: Path, values: NDArray[np.float64], rate: float, unit: str) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        file["Force"] = values[np.newaxis]
        file["Force"].attrs["MATLAB_class"] = np.bytes_("double")
        file["Fs"] = np.array([[rate]])
        file["Force"].attrs["unit"] = unit
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")


def _tdms(path: Path, values: NDArray[np.float64], rate: float, unit: str) -> None:
    properties = {
        "wf_increment": 1 / rate,
        "unit_string": unit,
        "wf_start_time": np.datetime64("2024-05-06T10:00:00"),
    }
    with nptdms.TdmsWriter(path) as file:
        for part in np.array_split(values, 3):
            file.write_segment([nptdms.ChannelObject("plate", "force", part, properties)])


# By name of the file; those of `SOUND` hold no unit.
SOUND: dict[str, Writer] = {
    "pcm16.wav": _sound("PCM_16"),
    "pcm24.wav": _sound("PCM_24"),
    "pcm32.wav": _sound("PCM_32"),
    "pcm24.rf64": _sound("PCM_24"),
    "float.wav": _sound("FLOAT"),
    "double.wav": _sound("DOUBLE"),
    "pcm16.flac": _sound("PCM_16"),
    "pcm24.flac": _sound("PCM_24"),
}
WITH_UNIT: dict[str, Writer] = {
    "comma.csv": _table("Time [s],Force [{unit}]\n", ","),
    "german.csv": _table("Abtastrate: {rate} Hz\nZeit;Kraft\ns;{unit}\n", ";", comma=True),
    "tabs.tsv": _table("# unit = {unit}\n# fs: {rate}\n", "\t", time=False),
    "blanks.txt": _table("% date: 2024-05-06\n% dt = {step} s\nt_s F_{unit}\n", " "),
    "logger.lvm": _table(
        "LabVIEW Measurement\nDelta_X\t{step}\nY_Unit_Label\t{unit}\n"
        "***End_of_Header***\nX_Value\tPlate\n",
        "\t",
    ),
    "plate.h5": _hdf5,
    "plate.nc": _netcdf,
    "text.uff": _universal(0),
    "binary.uff": _universal(1),
    "plain.mat": _matlab(packed=False),
    "packed.mat": _matlab(packed=True),
    "structure.mat": _structure,
    "v73.mat": _matlab73,
    "plate.tdms": _tdms,
}
WRITERS: dict[str, Writer] = SOUND | WITH_UNIT


def broadcast_chunk(date: str, clock: str) -> bytes:
    """Return the chunk by which broadcast WAV files tell when they were recorded."""
    body = b"".ljust(320, b"\0") + date.encode() + clock.encode()
    body = body.ljust(602, b"\0")
    return b"bext" + struct.pack("<I", len(body)) + body
