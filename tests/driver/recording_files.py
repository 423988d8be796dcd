"""Recordings in every format, for tests: one channel of values with a unit and a rate."""

from __future__ import annotations

import gc
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import nptdms
import numpy as np
import pyuff
import scipy.io
import soundfile
import synthetic

from thud.recordings.config import Config
from thud.recordings.signal import Signal, open_signals

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    Writer = Callable[[Path, NDArray[np.float64], float, str], None]
    # The owner of an entry of a header is the array, its group or the file.
    Entry = tuple[str, str, Any]
    HeaderWriter = Callable[[Path, NDArray[np.float64], list[Entry]], None]

PEAK, RATE = 1500.0, 8000.0


def opened(path: Path | str, **stated: Any) -> list[Signal]:  # noqa: ANN401 - of `Config`
    """Return the signals of a file of which some keys of the configuration are stated."""
    return open_signals(path, Config(**stated))


def half_sine(rate: float, before: float = 0.01, after: float = 0.01) -> NDArray[np.float64]:
    """Return samples of the half sine of 1500 N and 20 ms with quiet around it."""
    return synthetic.half_sine(rate, before, round((before + 0.02 + after) * rate))


FORCE = half_sine(RATE)


def noisy(level: ArrayLike, deviation: float, seed: int = 1) -> NDArray[np.float64]:
    """Return a level with white noise of a standard deviation."""
    return level + np.random.default_rng(seed).normal(0, deviation, np.shape(level))


def steps(*plateaus: tuple[float, int]) -> Signal:
    """Return a record of levels, V, and their numbers of samples."""
    levels, counts = zip(*plateaus, strict=True)
    return Signal.from_array(np.repeat(levels, counts), 5000.0)


def rows_of(row: str | Callable[[int, float, float], str]) -> str:
    """Return the rows of a table from their index, time, s, and force, N, of the half sine."""
    form = (lambda i, t, f: row.format(i=i, t=t, f=f)) if isinstance(row, str) else row
    return "".join(form(i, i / RATE, force) + "\n" for i, force in enumerate(FORCE))


def _sound(path: Path, values: NDArray[np.float64], rate: float, unit: str) -> None:
    """Write numbers of the kind that the name begins with; the format holds no unit."""
    del unit
    kind = path.stem.upper().replace("PCM", "PCM_")
    with path.open("w+b") as file:
        soundfile.write(file, values, round(rate), kind, format=path.suffix[1:].upper())


def _table(head: str, separator: str, *, comma: bool = False, time: bool = True) -> Writer:
    def write(path: Path, values: NDArray[np.float64], rate: float, unit: str) -> None:
        cells = ([f"{i / rate:.9f}"] * time + [f"{x:.17g}"] for i, x in enumerate(values))
        text = "\n".join(map(separator.join, cells)) + "\n"
        if comma:
            text = text.replace(".", ",")
        path.write_text(head.format(rate=rate, unit=unit, step=1 / rate) + text, encoding="utf-8")

    return write


def write_hdf5(path: Path, values: NDArray[np.float64], entries: list[Entry]) -> None:
    with h5py.File(path, "w") as file:
        data = file.create_dataset("plate/force", data=values, chunks=(64,), compression="gzip")
        for owner, key, value in entries:
            target = {"array": data, "group": file["plate"], "file": file}[owner]
            (target if owner != "array" and len(key) % 2 else target.attrs)[key] = value


def _netcdf(path: Path, values: NDArray[np.float64], rate: float, unit: str) -> None:
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(len(values)) / rate
        file["time"].make_scale("time")
        file["time"].attrs["units"] = "s"
        file["force"] = values
        file["force"].dims[0].attach_scale(file["time"])
        file["force"].attrs["units"] = unit


def write_universal(path: Path, *sets: dict[str, Any]) -> None:
    path.unlink(missing_ok=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # the writer leaves a file open
        gc.disable()  # it stays among the youngest objects
        for entry in sets:
            pyuff.UFF(str(path)).write_sets([entry], "add")
        gc.collect(0)
        gc.enable()


def universal_record(
    values: NDArray[np.float64], rate: float, unit: str, binary: int, quantity: int = 13
) -> dict[str, Any]:
    """Return a data set 58 of samples, whose quantity is a force by default."""
    return {
        "type": 58, "binary": binary, "func_type": 1, "data": values, "id1": "force plate",
        "id3": "06-MAY-24 10:00:00", "x": np.arange(len(values)) / rate, "rsp_node": 1,
        "rsp_dir": 3, "ref_node": 1, "ref_dir": 3, "abscissa_spacing": 1,
        "abscissa_inc": 1 / rate, "abscissa_spec_data_type": 17,
        "ordinate_spec_data_type": quantity, "orddenom_spec_data_type": 0,
        "z_axis_spec_data_type": 0, "abscissa_axis_units_lab": "s", "ordinate_axis_units_lab": unit,
    }  # fmt: skip


def _universal(path: Path, *recorded: Any) -> None:  # noqa: ANN401
    write_universal(path, universal_record(*recorded, binary=path.stem == "binary"))


def _matlab(path: Path, values: NDArray[np.float64], rate: float, unit: str) -> None:
    variables = {"Force": values, "Fs": rate, "unit": unit}
    scipy.io.savemat(path, variables, do_compression=path.stem == "packed")


def write_matlab(path: Path, values: NDArray[np.float64], entries: list[Entry]) -> None:
    inner = {key: value for owner, key, value in entries if owner != "file"}
    outer = {key: value for owner, key, value in entries if owner == "file"}
    scipy.io.savemat(path, {"plate": {"Force": values, **inner}, **outer}, long_field_names=True)


def write_matlab_4(path: Path, values: NDArray[np.float64], entries: list[Entry]) -> None:
    header = {key: value for _, key, value in entries}
    scipy.io.savemat(path, {"Force": values, **header}, format="4")


def write_matlab_73(path: Path, values: NDArray[np.float64], entries: list[Entry]) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        variables = {"Force": values, **{key: value for _, key, value in entries}}
        for key, value in variables.items():
            is_text = isinstance(value, str)
            codes = [ord(c) for c in value] if is_text else value
            file[key] = np.atleast_2d(np.asarray(codes, dtype="u2" if is_text else "f8")).T
            file[key].attrs["MATLAB_class"] = np.bytes_("char" if is_text else "double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")


def write_tdms(path: Path, values: NDArray[np.float64], entries: list[Entry]) -> None:
    properties: dict[str, dict[str, Any]] = {"array": {}, "group": {}, "file": {}}
    for owner, key, value in entries:
        is_rate = key == "Fs"
        properties[owner]["wf_increment" if is_rate else key] = 1 / value if is_rate else value
    owners = nptdms.RootObject(properties["file"]), nptdms.GroupObject("plate", properties["group"])
    with nptdms.TdmsWriter(path) as file:
        for part in np.array_split(values, 3):
            channel = nptdms.ChannelObject("plate", "force", part, properties["array"])
            file.write_segment([*owners, channel])


def write_text(path: Path, values: NDArray[np.float64], entries: list[Entry]) -> None:
    header = "".join(f"{key}: {value}\n" for _, key, value in entries)
    np.savetxt(path, values, "%.12g", header=f"{header}Force", comments="")


# Formats with a header of any entries.
WITH_HEADER: dict[str, HeaderWriter] = {
    "t.csv": write_text,
    "a.h5": write_hdf5,
    "a.nc": write_hdf5,
    "5.mat": write_matlab,
    "4.mat": write_matlab_4,
    "73.mat": write_matlab_73,
    "a.tdms": write_tdms,
}


def _stating(write: HeaderWriter, unit_key: str, rate_key: str, *others: Entry) -> Writer:
    return lambda path, values, rate, unit: write(
        path, values, [("array", unit_key, unit), ("array", rate_key, rate), *others]
    )


# By name of the file; those of `SOUND` hold no unit.
SOUND: dict[str, Writer] = dict.fromkeys(
    ["pcm16.wav", "pcm24.wav", "pcm32.wav", "pcm24.rf64", "float.wav", "double.wav", "pcm16.flac",
     "pcm24.flac"], _sound,
)  # fmt: skip
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
    "plate.h5": _stating(write_hdf5, "units", "sample_rate", ("file", "date", "2024-05-06")),
    "plate.nc": _netcdf,
    "text.uff": _universal,
    "binary.uff": _universal,
    "plain.mat": _matlab,
    "packed.mat": _matlab,
    "structure.mat": _stating(write_matlab, "unit", "Fs"),
    "v73.mat": _stating(write_matlab_73, "unit", "Fs"),
    "plate.tdms": _stating(
        write_tdms, "unit_string", "Fs", ("array", "wf_start_time", np.datetime64("2024-05-06")),
    ),
}  # fmt: skip
WRITERS: dict[str, Writer] = SOUND | WITH_UNIT


def recording_file(path: Path | str, values: NDArray[np.float64] = FORCE) -> Path:
    """Write the half sine in the format of a name of `WRITERS`, integers of 5000 N/FS."""
    path = Path(path)
    WRITERS[path.name](path, values / 5000 if path.name.startswith("pcm") else values, RATE, "N")
    return path


def patch(path: Path, at: int, *parts: bytes) -> Path:
    """Replace bytes of a file from an index on; return its path."""
    data, new = path.read_bytes(), b"".join(parts)
    path.write_bytes(data[:at] + new + data[at:][len(new) :])
    return path
