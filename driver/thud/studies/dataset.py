"""Results of a study as an xarray.Dataset: names, units, provenance; their files."""

from __future__ import annotations

import json
from io import BytesIO
from typing import TYPE_CHECKING, Any

import xarray as xr

from thud.base.checks import refuse
from thud.base.files import is_failure, replace_file, require_regular
from thud.case.case import case_text
from thud.impact.datasets import FREQUENCIES, RESULTS, attributes, case_attributes, sample_variables
from thud.studies.sampling import sampler_versions

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from thud.studies.arrays import Columns
    from thud.studies.study import Study


def new_dataset(
    study: Study, columns: Columns, results: Columns, provenance: dict[str, Any]
) -> xr.Dataset:
    """Return the results of samples along the dimension ``sample``, levels also along bands.

    `columns` are the parameters of the samples by name, `results` the results of `evaluate`,
    `provenance` the attributes.
    """
    coordinates, variables = sample_variables(results)
    for parameter in study.parameters:
        key, temperature = parameter.key, study.temperature
        meaning = key.meaning
        if temperature and parameter.name in temperature.keys:
            meaning += f" at {temperature.reference:g} degC; the temperature changes it"
        shown_unit, power = parameter.shown_unit
        attrs = {
            **attributes(key),
            "long_name": meaning,
            "group": key.group,
            "key": parameter.name,
            "shown_unit": shown_unit,
            "shown_exponent": -power,
            "scale": parameter.scale,
            **({} if parameter.low is None else {"range": (parameter.low, parameter.high)}),
        }
        values = _objects(columns[parameter.name])
        coordinates[parameter.coordinate_name] = ("sample", values, attrs)
    if study.surrogate:
        for name in study.surrogate.outputs:
            variables[name][-1]["surrogate_error"] = study.surrogate.error_of(name)
            variables[name][-1]["surrogate_variance"] = study.surrogate.mean_square(name)
    names = [*FREQUENCIES, *(p.coordinate_name for p in study.parameters)]
    return xr.Dataset(
        {name: variables[name] for name in RESULTS if name in variables},
        {name: coordinates[name] for name in names if name in coordinates},
        provenance,
    )


def provenance_of(study: Study) -> dict[str, Any]:
    """Return the provenance of results as attributes of a dataset."""
    return {
        "title": f"{study.kind} {study.name}",
        "study": study.text,
        "study_kind": study.kind,
        "identity": json.dumps(study.identity),
        "design": study.design,
        "size": study.size,
        "seed": study.seed if study.size else "none",
        "parameters": " ".join(parameter.coordinate_name for parameter in study.parameters),
        **({"density": study.density} if study.density is not None else {}),
        **({"surrogate": study.surrogate.accuracy} if study.surrogate else {}),
        **sampler_versions(study.design),
        **case_attributes(study.case),
        "case": case_text(study.case).decode(),
    }


def join_blocks(study: Study, parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return all blocks as one dataset; a grid gets a dimension for each parameter."""
    dataset = concatenate(parts)
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


def concatenate(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return blocks as one dataset along the dimension ``sample``."""
    return xr.concat(
        parts, "sample", data_vars="minimal", coords="minimal", compat="override",
        join="override", combine_attrs="override",
    )  # fmt: skip


def _objects(values: NDArray[Any]) -> NDArray[Any]:
    """Return an array; texts become objects, because xarray would fix their length."""
    return values.astype(object) if values.dtype.kind == "U" else values


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write a NetCDF file atomically."""
    replace_file(path, bytes(dataset.to_netcdf(engine="h5netcdf")))


def read_dataset(path: Path) -> xr.Dataset:
    """Return the results in a file, or of the blocks in a directory; see `thud.read_sweep`."""
    if path.suffix == ".partial":
        blocks = block_paths(path)
        if not blocks:
            refuse(f"{path} holds no finished samples", "results of a study")
        return concatenate([read_dataset(block) for block in blocks])
    try:
        content = BytesIO(require_regular(path).read_bytes())
        with xr.open_dataset(content, engine="h5netcdf") as file:
            dataset = file.load()
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        if is_failure(error):
            raise
        refuse(
            f"{path} cannot be read", "the .nc or .partial of a study; remove a damaged one", error
        )
    variables = dataset.variables.items()
    texts: dict[Any, Any] = {n: v.astype(object) for n, v in variables if v.dtype.kind == "U"}
    return dataset.assign(texts).drop_encoding()


def read_identity(path: Path) -> dict[str, str] | None:
    """Return the identity of results in a file or a directory of blocks; None without blocks."""
    if path.suffix == ".partial":
        blocks = block_paths(path)
        return read_identity(blocks[0]) if blocks else None
    identity: dict[str, str] = json.loads(read_dataset(path).attrs["identity"])
    return identity


def block_paths(folder: Path) -> list[Path]:
    """Return the files of finished blocks in order."""
    return sorted(folder.glob("block_*.nc"))
