"""A measured recording as NetCDF: the content of ``recording.nc``."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import h5netcdf
import h5py
import numpy as np

from thud.base._schema import QUANTITIES
from thud.recordings.measured_drop import ESTIMATES

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

# Variable and meaning of the average levels, by their keys in a report.
LEVELS = {
    "level": ("level", "force exposure level of the average, re 1 N and 1 s"),
    "uncertainty": ("level_uncertainty", "standard uncertainty of the level"),
    "expanded_uncertainty": ("level_expanded", "expanded uncertainty of the level, 95 %"),
    "background": ("background", "level of the noise within the same gate"),
    "spread": ("spread", "standard deviation of the levels of the drops"),
}
FILES = {"name": "name", "sha256": "SHA-256", "date": "date", "calibration": "calibration"}
PROVENANCE = (
    "name", "thud", "source", "verdict", "confidence", "laboratory", "ball", "serial", "date",
    "temperature", "mass", "height", "mass_uncertainty", "height_uncertainty",
    "calibration_uncertainty",
)  # fmt: skip


def netcdf(data: dict[str, Any]) -> bytes:
    """Return drops, levels and files of a report as the content of a NetCDF file.

    `data` is the result of `thud.report.contents.report_data`. xarray, which could write it too,
    takes a second to import.
    """
    content = io.BytesIO()
    with h5netcdf.File(content, "w") as file:
        lengths = {"drop": len(data["drops"]), "file": len(data["files"])}
        lengths |= {bands: len(levels["band"]) for bands, levels in data["levels"].items()}
        file.dimensions = lengths
        for name, (dimensions, values, attributes) in _variables(data).items():
            is_text = values.dtype == object
            variable = file.create_variable(
                name, dimensions, h5py.string_dtype() if is_text else values.dtype, data=values
            )
            variable.attrs.update(attributes)
        file.attrs.update(_attributes(data))
    return content.getvalue()


def _variables(data: dict[str, Any]) -> dict[str, tuple[tuple[str, ...], NDArray[Any], Any]]:
    """Return dimensions, values and attributes of each variable."""
    drops, files = data["drops"], data["files"]
    onset = {"units": "s", "long_name": "time of first touch in the file"}
    variables: dict[str, Any] = {
        "drop": (("drop",), _texts(drop["name"] for drop in drops), {}),
        "onset": (("drop",), _numbers(d["onset"] for d in drops), onset),
    }
    for name in ESTIMATES:
        for key, suffix, prefix in (
            ("value", "", ""),
            ("uncertainty", "_uncertainty", "standard uncertainty of the "),
        ):
            values = _numbers(drop[name][key] for drop in drops)
            quantity = QUANTITIES[name]
            attributes = {"units": quantity.unit or "1", "long_name": prefix + quantity.meaning}
            variables[name + suffix] = (("drop",), values, attributes)
    for bands, levels in data["levels"].items():
        attributes = {"units": "Hz", "long_name": "nominal frequency"}
        variables[bands] = ((bands,), np.array(levels["band"]), attributes)
        for key, (name, meaning) in LEVELS.items():
            attributes = {"units": "dB", "long_name": meaning}
            variables[f"{bands}_{name}"] = ((bands,), _numbers(levels[key]), attributes)
        flag = {"long_name": "corrected for the background, upper bound, or no level"}
        variables[f"{bands}_flag"] = ((bands,), _texts(levels["flag"]), flag)
        attributes = {"units": "dB", "long_name": "force exposure level of each drop"}
        of_drops = np.array([_numbers(row) for row in levels["drops"]])
        variables[f"{bands}_drop_level"] = (("drop", bands), of_drops, attributes)
    for key, meaning in FILES.items():
        attributes = {"long_name": f"{meaning} of the file"}
        variables[f"file_{key}"] = (("file",), _texts(file[key] for file in files), attributes)
    return variables


def _attributes(data: dict[str, Any]) -> dict[str, Any]:
    known = {key: data[key] for key in PROVENANCE if data[key] not in (None, "")}
    notes = {kind: "\n".join(data[kind]) for kind in ("processing", "warnings")}
    instruments = "\n".join(", ".join(filter(None, item.values())) for item in data["instruments"])
    result = {**known, "instruments": instruments, **notes}
    return {k: _plain(value) if isinstance(value, str) else value for k, value in result.items()}


def _numbers(values: Iterable[float | None]) -> NDArray[np.float64]:
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _texts(values: Iterable[str]) -> NDArray[np.object_]:
    return np.array([_plain(value) for value in values], dtype=object)


def _plain(text: str) -> str:
    """Return a text that HDF5 can store: no null characters, no lone surrogates."""
    return text.replace("\0", " ").encode("utf-8", "replace").decode()
