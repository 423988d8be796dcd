"""Results of impacts and of many drops, by name, and as xarray datasets with units and meanings."""

from __future__ import annotations

import math
import platform
from collections import Counter
from datetime import UTC, datetime
from importlib import metadata
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base._schema import BANDS, QUANTITIES, RATED_BANDS, SAMPLE_QUANTITIES, VERDICTS
from thud.base.bridge import compiler, version, without_units
from thud.base.extras import require_extra
from thud.base.key import Quantity
from thud.base.note import Note
from thud.case.case import case_text
from thud.case.keys import find_key
from thud.level.levels import FORCES

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

    from thud.base.key import Key
    from thud.case.case import Case
    from thud.impact.ensemble import Ensemble
    from thud.recordings.recording import ImpactResult

NO_ERRORS = Note("no_numerical_errors")
# Nominal frequencies, Hz, by the name of the dimension: of force levels, and of levels in a room.
FREQUENCIES = {bands: entry["nominal"] for bands, entry in BANDS.items()} | {
    "rated_third": RATED_BANDS["third"]
}
# Dimension of the force exposure levels, of the elastic force, of the force on a rigid floor and of
# that on the floor of the case.
LEVELS: dict[str, str] = {
    f"{force}_{bands}": bands for bands in BANDS for force in ("elastic", "floor", "contact")
}
# Second dimension of results; the first is the sample.
DIMENSIONS = LEVELS | {"room_third": "rated_third"}


def _level(force: str, bands: str) -> Quantity:
    """Return the declaration of the levels of a force in bands."""
    meaning = f"force exposure level of the {force} force, re 1 N and 1 s"
    title = f"{force} level" if bands == "octave" else f"{force} {bands} level"
    return Quantity(f"{force}_{bands}", title, "L_{FE}", "dB", "dB", 1.0, 2, meaning)


def _number(name: str, meaning: str) -> Quantity:
    """Return the declaration of a pure number, a truth value or a text."""
    return Quantity(name, name, "", "", "", 1.0, 0, meaning)


# All results of samples, including those of surrogates and of their training, in their order.
RESULTS = {
    **{name: QUANTITIES[name] for name in SAMPLE_QUANTITIES},
    **{name: _level(name.partition("_")[0], bands) for name, bands in LEVELS.items()},
    "margin": QUANTITIES["margin"],
    "conforms": _number("conforms", "all criteria of the standard are met"),
    "status": _number("status", "0: computed; otherwise the exit code of the error"),
    "reason": _number("reason", "why there are no results"),
    "floor_work": QUANTITIES["floor_work"],
    "room_third": Quantity(
        "room_third", "level in the room", "L_{i,Fmax}", "dB", "dB", 1.0, 1,
        "maximum Fast level in the room, re 20 uPa",
    ),
    "room_rating": QUANTITIES["room_rating"],
    "undecided": _number("undecided", "the verdict could change by the errors of the surrogate"),
    "peaks": QUANTITIES["peak_count"],
}  # fmt: skip


def sample_warnings(
    status: NDArray[np.integer], reason: NDArray[np.object_], conforms: NDArray[np.bool_] | None
) -> tuple[Note, ...]:
    """Return warnings of samples without results, and of sources that do not conform.

    Status and reason are those of `Ensemble`, of any shape, and of the same shape is whether each
    source conforms; None if levels in a room are not rated.
    """
    failed = status != 0
    result = []
    if failed.any():
        ((cause, _),) = Counter(reason[failed]).most_common(1)
        count = float(failed.sum())
        others = {"reason": cause}
        result.append(Note("samples_failed", value=count, high=failed.size, others=others))
    if conforms is not None and (unlike := ~failed & ~conforms).any():
        result.append(Note("samples_not_standard", value=float(unlike.sum()), high=failed.size))
    return tuple(result)


def impact_dataset(
    impact: ImpactResult,
    histories: Mapping[str, NDArray[np.float64]],
    provenance: Mapping[str, Any],
) -> xr.Dataset:
    """Return the dataset of an impact or a recording: histories, levels and known quantities.

    The names of histories end with units. The dataset is writable, unlike the arrays of the impact.
    Raise InputError if xarray is not installed.
    """
    with require_extra("studies"):
        import xarray as xr

    variables: dict[str, Any] = {}
    for column, values in histories.items():
        (name,) = without_units({column: values})
        unit = column[len(name) + 1 :].replace("_per_", "/")
        variables[name] = ("time", values, _attributes(unit, name.replace("_", " ")))
    for bands in BANDS:
        # A recording has the force on the floor only.
        for force in dict.fromkeys(map(impact.assessed_force, FORCES)):
            name = f"{force}_{bands}"
            levels = impact.levels(bands, force=force)
            variables[name] = (bands, levels, attributes(RESULTS[name]))
    for name, quantity in QUANTITIES.items():
        if not math.isnan(value := impact.quantity(name)):
            variables[name] = ((), value, attributes(quantity))
    conforms = impact.assess().conforms == VERDICTS[0]
    variables["conforms"] = ((), conforms, attributes(RESULTS["conforms"]))
    coordinates = {"time": _time(impact.time), **_frequencies(BANDS)}
    texts = (note.message for note in impact.notes if note.is_warning)
    stated = {**provenance, "warnings": "\n".join(texts)}
    return xr.Dataset(variables, coordinates, stated).copy(deep=True)


def ensemble_dataset(ensemble: Ensemble) -> xr.Dataset:
    """Return the dataset of an ensemble; raise InputError if xarray is not installed."""
    with require_extra("studies"):
        import xarray as xr

    coordinates, variables = sample_variables(ensemble.results)
    for name, values in ensemble.parameters.items():
        key, _ = find_key(name, ensemble.case)
        coordinates[coordinate_name(name, key)] = ("sample", values, attributes(key))
    for force in FORCES:
        if (values := getattr(ensemble, f"{force}_force")) is not None:
            coordinates["time"] = _time(np.arange(values.shape[1]) / ensemble.sample_rate)
            attrs = _attributes("N", f"{force} force")
            variables[f"{force}_force"] = (("sample", "time"), values, attrs)
    return xr.Dataset(variables, coordinates, case_attributes(ensemble.case)).copy(deep=True)


def sample_table(dataset: xr.Dataset) -> pd.DataFrame:
    """Return a row for each sample of a dataset, without forces, and a column for each band, Hz."""
    columns: dict[str, xr.DataArray] = {}
    for name, variable in dataset.drop_dims("time", errors="ignore").data_vars.items():
        bands = next((bands for bands in FREQUENCIES if bands in variable.dims), None)
        for band in dataset[bands].to_numpy() if bands else ():
            columns[f"{name}_{band:g}"] = variable.sel({bands: band}, drop=True)
        if not bands:
            columns[str(name)] = variable
    table = dataset[[]].drop_vars([*FREQUENCIES, "time"], errors="ignore").assign(columns)
    return table.to_dataframe()


def sample_variables(results: Mapping[str, NDArray[Any]]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the coordinates of the bands and the variables for `Ensemble.results`."""
    variables: dict[str, Any] = {}
    for name, values in results.items():
        dimensions = ("sample", DIMENSIONS[name]) if name in DIMENSIONS else ("sample",)
        variables[name] = (dimensions, values, attributes(RESULTS[name]))
    return _frequencies({DIMENSIONS[name] for name in results if name in DIMENSIONS}), variables


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
    return f"{key.group}_{name}" if name in RESULTS else name


def _frequencies(used: Iterable[str]) -> dict[str, Any]:
    """Return the coordinates of the bands by the names of their dimensions."""
    attrs = _attributes("Hz", "nominal frequency")
    return {
        bands: (bands, np.array(nominal), attrs)
        for bands, nominal in FREQUENCIES.items()
        if bands in used
    }


def case_attributes(case: Case) -> dict[str, str]:
    """Return the case and the software of results as attributes of a dataset."""
    return {
        "model": case.model.name if case.model else "",
        "assessed_force": case.levels.force,
        "limits": case.limits.source,
        "case": case_text(case).decode(errors="surrogateescape"),
        "resolved_case": f"{case.resolved().to_namelist()}",
        "thud_version": version(),
        "compiler": compiler(),
        "python_version": platform.python_version(),
        "numpy_version": np.__version__,
        "xarray_version": metadata.version("xarray"),
        "machine": platform.machine(),
        "date_created": datetime.now(UTC).isoformat(timespec="seconds"),
    }
