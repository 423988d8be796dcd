"""Results of a study as an xarray.Dataset: names, units, provenance."""

from __future__ import annotations

import json
import platform
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from thud.base.bridge import compiler, version
from thud.floors.rating import rated_bands
from thud.level.levels import BANDWIDTHS, get_bands
from thud.impact.outcomes import FURTHER, ROOM_LEVEL
from thud.studies.designs import makers
from thud.studies.evaluation import LEVELS, SCALARS, level_names

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from thud.base.schema import BandSet
    from thud.case.case import Case
    from thud.studies.parameter import Parameter
    from thud.studies.sets import Columns, SetStudy

_LEVEL = "force exposure level of the {} force, re 1 N and 1 s"
# Dimensions that are bands: those of the levels, and the thirds in a room.
BANDS = (*BANDWIDTHS, ROOM_BAND := "room_third")
MEANINGS = {
    **SCALARS,
    **{name: ("dB", _LEVEL.format(force)) for name, (force, _) in LEVELS.items()},
    "margin": ("dB", "minimum distance of the judged octave levels to a limit, positive inside"),
    "conforms": ("1", "all criteria of the standard are met"),
    "status": ("1", "0: computed; otherwise the exit code of the error"),
    "reason": ("1", "why there are no results"),
}
# Those and what only sets on floors, of a surrogate, and of its training, have.
_CONTACT = {f"contact_{bands}_level": bands for bands in BANDWIDTHS}
_ALL = {
    **MEANINGS,
    **dict.fromkeys(_CONTACT, ("dB", "force exposure level on the floor that moves, re 1 N, 1 s")),
    **FURTHER,
    "doubtful": ("1", "the verdict could change by the errors of the surrogate"),
    "peaks": ("1", "number of peaks of the judged force"),
}
# Bytes of a set on disk without its levels and parameters, and of an empty file.
_SET_BYTES = 95
_FILE_BYTES = 27_000


def disk_space(study: SetStudy) -> int:
    """Return the estimated bytes of the results of a study, blocks included."""
    total = study.count
    files = 1 - (-total // study.block_size)
    levels = sum(len(get_bands(bands).nominal) for _, bands in level_names(study.case).values())
    return files * _FILE_BYTES + 2 * total * (_SET_BYTES + 8 * (levels + len(study.parameters)))


def coordinate(parameter: Parameter) -> str:
    """Return the name of a parameter's coordinate; some keys are named as results are."""
    name = parameter.name.replace("(", "_").replace(".", "_").rstrip(")")
    return f"{parameter.key.group}_{name}" if name in _ALL else name


def new_dataset(study: SetStudy, columns: Columns, found: Columns) -> xr.Dataset:
    """Return the results of some sets, along the dimension ``set`` (levels also along their bands).

    `columns` holds their parameters by name, `found` what `evaluate` returns.
    """
    levels = level_names(study.case)
    dimension: dict[str, str] = {**{name: bands for name, (_, bands) in levels.items()}, **_CONTACT}
    coordinates: dict[str, Any] = band_coordinates(bands for _, bands in levels.values())
    if ROOM_LEVEL in found:
        dimension[ROOM_LEVEL] = ROOM_BAND
        coordinates |= room_coordinates()
    for parameter in study.parameters:
        values = _objects(columns[parameter.name])
        coordinates[coordinate(parameter)] = ("set", values, _attributes(study, parameter))
    variables = {}
    for name, values in found.items():
        unit, meaning = _ALL[name]
        dimensions = ("set", dimension[name]) if name in dimension else ("set",)
        attributes: dict[str, Any] = {"units": unit, "long_name": meaning}
        if study.surrogate and name in study.surrogate.outputs:
            attributes["surrogate_error"] = study.surrogate.error_of(name)
        variables[name] = (dimensions, values, attributes)
    return in_order(xr.Dataset(variables, coordinates, provenance(study)))


def band_coordinates(kinds: Iterable[BandSet]) -> dict[str, Any]:
    """Return the nominal frequencies of bands by the names of their dimensions."""
    attributes = {"units": "Hz", "long_name": "nominal frequency"}
    return {bands: (bands, get_bands(bands).nominal, attributes) for bands in kinds}


def room_coordinates() -> dict[str, Any]:
    """Return the nominal frequencies of the thirds in a room by the name of their dimension."""
    attributes = {"units": "Hz", "long_name": "nominal frequency"}
    return {ROOM_BAND: (ROOM_BAND, rated_bands(BANDWIDTHS[1]), attributes)}


def _attributes(study: SetStudy, parameter: Parameter) -> dict[str, Any]:
    key, law = parameter.key, study.temperature
    shown_unit, power = parameter.shown_unit
    meaning = key.meaning
    if law and parameter.name in law.keys:
        meaning += f" at {law.reference:g} degC; changed by its temperature"
    return {
        "units": key.unit or "1",
        "long_name": meaning,
        "group": key.group,
        "key": parameter.name,
        "shown_unit": shown_unit,
        "shown_power": -power,
        "scale": parameter.scale,
    }


def provenance(study: SetStudy) -> dict[str, str]:
    """Return where results come from."""
    return {
        "title": f"{study.kind} {study.name}",
        "study": study.text,
        "study_kind": study.kind,
        "identity": json.dumps(study.identity),
        "design": study.design,
        "seed": str(study.seed) if study.size else "none",
        "parameters": " ".join(map(coordinate, study.parameters)),
        **({"surrogate": study.surrogate.sentence} if study.surrogate else {}),
        **makers(study.design),
        **origin(study.case),
    }


def origin(case: Case) -> dict[str, str]:
    """Return the case of results and what has computed them."""
    return {
        "model": case.model.name if case.model else "",
        "judged_force": case.levels.force,
        "limits": case.limits.source,
        "case": f"{case.to_namelist()}",
        "thud_version": version(),
        "compiler": compiler(),
        "python_version": platform.python_version(),
        "numpy_version": np.__version__,
        "xarray_version": xr.__version__,
        "machine": platform.machine(),
        "date_created": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def in_order(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset with variables in their order, which Zarr does not keep."""
    results = {name: dataset.variables[name] for name in _ALL if name in dataset.data_vars}
    names = [*BANDS, *dataset.attrs["parameters"].split()]
    coordinates = {name: dataset.variables[name] for name in names if name in dataset.coords}
    return xr.Dataset(results, coordinates, dataset.attrs)


def grid_of(study: SetStudy, dataset: xr.Dataset) -> xr.Dataset:
    """Return the dataset of a complete grid with one dimension per parameter instead of ``set``."""
    if study.design != "grid":
        return dataset
    coordinates = {name: dataset[name] for name in BANDS if name in dataset.coords}
    names = [coordinate(parameter) for parameter in study.parameters]
    axes = {
        name: (name, _objects(parameter.grid()), dataset[name].attrs)
        for name, parameter in zip(names, study.parameters, strict=True)
    }
    variables = {}
    for name, variable in dataset.data_vars.items():
        values = variable.to_numpy().reshape(*study.shape, *variable.shape[1:])
        variables[name] = ((*names, *variable.dims[1:]), values, variable.attrs)
    return xr.Dataset(variables, {**coordinates, **axes}, dataset.attrs)


def _objects(values: NDArray[Any]) -> NDArray[Any]:
    """Return an array, of texts as objects: xarray would fix their length."""
    return values.astype(object) if values.dtype.kind == "U" else values
