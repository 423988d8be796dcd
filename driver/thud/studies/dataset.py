"""Results of a study as an xarray.Dataset: names, units, provenance; their files.

Directories of studies grow: every file is written aside and renamed.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import xarray as xr

from thud.base.checks import refuse, shown_text
from thud.base.errors import InputError
from thud.base.files import is_failure, is_one_of, replace_file, require_regular
from thud.case.case import case_text
from thud.impact.datasets import FREQUENCIES, RESULTS, attributes, case_attributes, sample_variables
from thud.studies.kinds import KINDS

if TYPE_CHECKING:
    from collections.abc import Sequence

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
    """Write a NetCDF file atomically, with a checksum after its end, which other readers ignore."""
    content = bytes(dataset.to_netcdf(engine="h5netcdf"))
    replace_file(path, content + sha256(content).digest())


def read_dataset(path: Path) -> xr.Dataset:
    """Return the results in a file, or of the blocks in a directory; see `thud.read_sweep`."""
    if path.suffix == ".partial":
        blocks = block_paths(path)
        if not blocks:
            refuse(f"{path} holds no finished samples", "results of a study")
        return concatenate([read_dataset(block) for block in blocks])
    content = b""
    try:
        content = require_regular(path).read_bytes()
    except (OSError, ValueError) as error:
        if is_failure(error):
            raise
    end = len(content) - sha256().digest_size
    if sha256(content[:end]).digest() != content[end:]:
        refuse(
            f"{path} cannot be read, or is not as thud wrote it",
            "the .nc or .partial of a study; remove a damaged one",
        )
    with xr.open_dataset(BytesIO(content), engine="h5netcdf") as file:
        dataset = file.load()
    variables = dataset.variables.items()
    texts: dict[Any, Any] = {n: v.astype(object) for n, v in variables if v.dtype.kind == "U"}
    return dataset.assign(texts).drop_encoding()


def read_identity(path: Path) -> dict[str, str]:
    """Return the identity of results in a file, or of the first block in a directory."""
    file = block_paths(path)[0] if path.suffix == ".partial" else path
    identity: dict[str, str] = json.loads(read_dataset(file).attrs.get("identity", "{}"))
    return identity


def block_paths(folder: Path) -> list[Path]:
    """Return the files of finished blocks in order."""
    return sorted(folder.glob("block_*.nc"))


def open_directory(
    folder: str | os.PathLike[str], study: Study, *, replace: bool
) -> tuple[Path, Path]:
    """Return the paths of the results of a study and of the directory of its blocks.

    The caller makes both. Results of another version of the study and files that thud has not
    written are refused, or removed with `replace`; inputs of the study are never replaced.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    results = folder / f"{study.name}.nc", folder / f"{study.name}.partial"
    begun = [path for path in results if os.path.lexists(path)]
    ends = (".svg", KINDS[study.kind].table)
    names = (folder / f"{study.name}{end}" for end in ends if end)
    beside = [path for path in names if os.path.lexists(path)]
    for path in (*begun, *beside):
        if is_one_of(path, study.inputs):
            refuse(f"{path} is an input, which is never replaced", "another directory")
        if path in beside and (_is_directory(path) or not (begun or replace)):
            _refuse_foreign(path)
    old = [path for path in begun if _is_outdated(path, study, replace=replace)]
    for path in (*old, *beside) if old else ():
        remove(path)
    return results


def _is_outdated(path: Path, study: Study, *, replace: bool) -> bool:
    """Return whether results are not of this study; raise InputError without `replace`."""
    if path.suffix == ".partial" and not path.is_symlink() and not block_paths(path):
        return False
    try:
        before = {} if path.is_symlink() else read_identity(path)
    except InputError:
        before = {}
    if before == study.identity:
        return False
    if not before and (not replace or _is_directory(path)):
        _refuse_foreign(path)
    if not replace:
        now = study.identity
        key = next(key for key in {**before, **now} if before.get(key) != now.get(key))
        one, other = (shown_text(identity.get(key, "not stated")) for identity in (before, now))
        refuse(
            f"{path} belongs to another version of this study: {key} = {one} is now {other}",
            "another directory, or --replace (replace=True) to compute the study again",
        )
    return True


def _refuse_foreign(path: Path) -> NoReturn:
    """Raise InputError for a file or directory that thud has not written."""
    problem = f"{path} is in the way: thud has not written it"
    refuse(problem, "another directory, or --replace (replace=True) to replace it")


def remove(path: Path) -> None:
    """Remove a file, or a directory of blocks unless it has other files."""
    if not _is_directory(path):
        path.unlink(missing_ok=True)
        return
    for block in path.glob("*block_*.nc*"):
        block.unlink(missing_ok=True)
    with suppress(OSError):
        path.rmdir()


def _is_directory(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()
