"""Impacts and ensembles as xarray datasets, with units and meanings."""

from __future__ import annotations

import math
import platform
import re
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from thud.base import _schema as schema
from thud.base._schema import VERDICTS
from thud.base.bridge import compiler, version
from thud.case.keys import find_key, key_owners
from thud.impact.quantities import (
    ALL_QUANTITIES,
    DIMENSIONS,
    LEVELS,
    ROOM_BAND,
    SAMPLE_RESULTS,
    sample_results,
)
from thud.level.levels import BANDWIDTHS, get_bands
from thud.level.rating import rated_bands

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.base.key import Key
    from thud.base.quantity import Quantity
    from thud.case.case import Case
    from thud.impact.impact import Impact
    from thud.impact.outcomes import Ensemble
    from thud.level.impact_result import ImpactResult

# Name and unit in the column name of a history.
_HISTORY = re.compile(r"(.*?)_((?:m|s|N|Pa|J|Hz|kg)(?:_per_\w+)?)")


def impact_dataset(impact: Impact, histories: Mapping[str, NDArray[np.float64]]) -> xr.Dataset:
    """Return the dataset of an impact and its histories; their names end with units."""
    variables: dict[str, Any] = {}
    for column, values in histories.items():
        match = _HISTORY.fullmatch(column)
        name, unit = match.groups() if match else (column, "")
        attrs = _attributes(unit.replace("_per_", "/"), name.replace("_", " "))
        variables[name] = ("time", values, attrs)
    for name, (force, bands) in LEVELS.items():
        levels = impact.levels(bands, force=force)
        variables[name] = (bands, levels, attributes(SAMPLE_RESULTS[name]))
    for name in schema.IMPACT_QUANTITIES:
        variables[name] = ((), getattr(impact, name), attributes(schema.QUANTITIES[name]))
    conforms = impact.assess().conforms == VERDICTS[0]
    variables["conforms"] = ((), conforms, attributes(SAMPLE_RESULTS["conforms"]))
    coordinates = {"time": _time(impact.time), **band_coordinates(BANDWIDTHS)}
    warnings = {"warnings": "\n".join(impact.warnings)}
    dataset = xr.Dataset(
        variables, coordinates, case_attributes(impact.case) | impact.model_quantities | warnings
    )
    # The dataset is writable, unlike the arrays of the impact.
    return dataset.copy(deep=True)


def recording_dataset(recording: ImpactResult) -> xr.Dataset:
    """Return the dataset of a recording: force on the floor, levels and known quantities."""
    variables: dict[str, Any] = {
        "floor_force": ("time", recording.force(), _attributes("N", "floor force")),
        **{
            name: (bands, recording.levels(bands), attributes(SAMPLE_RESULTS[name]))
            for name, (force, bands) in LEVELS.items()
            if force == "floor"
        },
        **{
            name: ((), recording.quantity(name), attributes(quantity))
            for name, quantity in schema.QUANTITIES.items()
            if not math.isnan(recording.quantity(name))
        },
    }
    coordinates = {"time": _time(recording.time), **band_coordinates(BANDWIDTHS)}
    provenance = {"recording": recording.name, "warnings": "\n".join(recording.warnings)}
    return xr.Dataset(variables, coordinates, provenance).copy(deep=True)


def ensemble_dataset(ensemble: Ensemble) -> xr.Dataset:
    """Return the dataset of an ensemble, with the dimension ``sample``."""
    assert ensemble.case.model is not None  # noqa: S101 - `solve_many` has set it
    coordinates, variables = sample_variables(sample_results(ensemble))
    for name, values in ensemble.parameters.items():
        key, _ = find_key(name, key_owners(ensemble.case))
        coordinates[coordinate_name(name, key)] = ("sample", values, attributes(key))
    for force in ("elastic", "floor"):
        if (values := getattr(ensemble, f"{force}_force")) is not None:
            seconds = np.arange(values.shape[1]) / ensemble.sample_rate
            coordinates["time"] = _time(seconds)
            attrs = _attributes("N", f"{force} force")
            variables[f"{force}_force"] = (("sample", "time"), values, attrs)
    return xr.Dataset(variables, coordinates, case_attributes(ensemble.case)).copy(deep=True)


def sample_variables(results: Mapping[str, NDArray[Any]]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the coordinates of the bands and the variables for results of `sample_results`."""
    variables: dict[str, Any] = {}
    for name, values in results.items():
        dimensions = ("sample", DIMENSIONS[name]) if name in DIMENSIONS else ("sample",)
        variables[name] = (dimensions, values, attributes(ALL_QUANTITIES[name]))
    used = {DIMENSIONS[name] for name in results if name in DIMENSIONS}
    coordinates = band_coordinates(bands for bands in BANDWIDTHS if bands in used)
    return coordinates | (room_coordinates() if ROOM_BAND in used else {}), variables


def _time(seconds: NDArray[np.float64]) -> tuple[str, NDArray[np.float64], dict[str, str]]:
    return "time", seconds, _attributes("s", "time since the start of the record")


def attributes(quantity: Quantity | Key) -> dict[str, str]:
    """Return unit and meaning of a quantity or a key as attributes of a variable."""
    return _attributes(quantity.unit, quantity.meaning)


def _attributes(unit: str, meaning: str) -> dict[str, str]:
    return {"units": unit or "1", "long_name": meaning}


def coordinate_name(parameter: str, key: Key) -> str:
    """Return the name of a parameter's coordinate, which differs from the names of results."""
    name = parameter.replace("(", "_").replace(".", "_").rstrip(")")
    return f"{key.group}_{name}" if name in ALL_QUANTITIES else name


def band_coordinates(kinds: Iterable[BandSet]) -> dict[str, Any]:
    """Return the coordinates of band sets: nominal frequencies by the name of the dimension."""
    return {bands: _frequencies(bands, get_bands(bands).nominal) for bands in kinds}


def room_coordinates() -> dict[str, Any]:
    """Return the coordinate of the bands in a room, as `band_coordinates` does."""
    return {ROOM_BAND: _frequencies(ROOM_BAND, rated_bands(BANDWIDTHS[1]))}


def _frequencies(
    dimension: str, nominal: NDArray[np.float64]
) -> tuple[str, NDArray[np.float64], dict[str, str]]:
    return dimension, nominal, _attributes("Hz", "nominal frequency")


def case_attributes(case: Case) -> dict[str, str]:
    """Return the case and the software of results as attributes of a dataset."""
    return {
        "model": case.model.name if case.model else "",
        "assessed_force": case.levels.force,
        "limits": case.limits.source,
        "case": f"{case.to_namelist()}",
        "resolved_case": f"{case.resolved().to_namelist()}",
        "thud_version": version(),
        "compiler": compiler(),
        "python_version": platform.python_version(),
        "numpy_version": np.__version__,
        "xarray_version": xr.__version__,
        "machine": platform.machine(),
        "date_created": datetime.now(UTC).isoformat(timespec="seconds"),
    }
