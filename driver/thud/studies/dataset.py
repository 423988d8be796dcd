"""Results of a study as an xarray.Dataset: names, units, provenance."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import xarray as xr

from thud.impact.datasets import (
    FREQUENCIES,
    RESULTS,
    attributes,
    case_attributes,
    sample_variables,
)
from thud.level.levels import BANDWIDTHS, FORCES, get_bands
from thud.studies.sampling import sampler_versions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.studies.parameter import Parameter
    from thud.studies.samples import Columns, SampleStudy

# Bytes on disk of a sample without its levels and parameters, and of an empty file.
_SAMPLE_BYTES = 95
_FILE_BYTES = 27_000


def disk_space(study: SampleStudy) -> int:
    """Return the estimated bytes of the results of a study, blocks included."""
    total = study.count
    files = 1 - (-total // study.block_size)
    # The verdict needs octaves.
    extra = study.case.levels.bands
    names = BANDWIDTHS if extra == "both" else {BANDWIDTHS[0], extra}
    levels = len(FORCES) * sum(len(get_bands(bands).nominal) for bands in names)
    return files * _FILE_BYTES + 2 * total * (_SAMPLE_BYTES + 8 * (levels + len(study.parameters)))


def new_dataset(study: SampleStudy, columns: Columns, results: Columns) -> xr.Dataset:
    """Return the results of samples along the dimension ``sample``, levels also along bands.

    `columns` are the parameters of the samples by name, `results` the results of `evaluate`.
    """
    coordinates, variables = sample_variables(results)
    for parameter in study.parameters:
        values = _objects(columns[parameter.name])
        coordinates[parameter.coordinate_name] = ("sample", values, _attributes(study, parameter))
    if study.surrogate:
        for name in study.surrogate.outputs:
            variables[name][-1]["surrogate_error"] = study.surrogate.error_of(name)
    return _in_order(xr.Dataset(variables, coordinates, provenance(study)))


def _attributes(study: SampleStudy, parameter: Parameter) -> dict[str, Any]:
    key, temperature = parameter.key, study.temperature
    shown_unit, power = parameter.shown_unit
    meaning = key.meaning
    if temperature and parameter.name in temperature.keys:
        meaning += f" at {temperature.reference:g} degC; the temperature changes it"
    return {
        **attributes(key),
        "long_name": meaning,
        "group": key.group,
        "key": parameter.name,
        "shown_unit": shown_unit,
        "shown_exponent": -power,
        "scale": parameter.scale,
    }


def provenance(study: SampleStudy) -> dict[str, str]:
    """Return the provenance of results as attributes of a dataset."""
    return {
        "title": f"{study.kind} {study.name}",
        "study": study.text,
        "study_kind": study.kind,
        "identity": json.dumps(study.identity),
        "design": study.design,
        "seed": str(study.seed) if study.size else "none",
        "parameters": " ".join(parameter.coordinate_name for parameter in study.parameters),
        **({"surrogate": study.surrogate.accuracy} if study.surrogate else {}),
        **sampler_versions(study.design),
        **case_attributes(study.case),
    }


def _in_order(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset with its variables in the usual order."""
    results = {name: dataset.variables[name] for name in RESULTS if name in dataset.data_vars}
    names = [*FREQUENCIES, *dataset.attrs["parameters"].split()]
    coordinates = {name: dataset.variables[name] for name in names if name in dataset.coords}
    return xr.Dataset(results, coordinates, dataset.attrs)


def grid_of(study: SampleStudy, dataset: xr.Dataset) -> xr.Dataset:
    """Return a complete dataset; a grid gets a dimension for each parameter."""
    if study.design != "grid":
        return dataset
    coordinates = {name: dataset[name] for name in FREQUENCIES if name in dataset.coords}
    names = [parameter.coordinate_name for parameter in study.parameters]
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
    """Return an array; texts become objects, because xarray would fix their length."""
    return values.astype(object) if values.dtype.kind == "U" else values
