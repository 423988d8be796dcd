"""Impacts and ensembles as datasets of xarray: names, units and meanings, which studies share."""

from __future__ import annotations

import platform
import re
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from thud.base import _schema as schema
from thud.base.bridge import compiler, version
from thud.case.keys import find_key, users
from thud.impact.quantities import (
    ALL_QUANTITIES,
    CONTACT_LEVEL,
    FLOOR_QUANTITIES,
    LEVELS,
    ROOM_BAND,
    ROOM_LEVEL,
    SET_QUANTITIES,
)
from thud.level.levels import BANDWIDTHS, get_bands
from thud.level.rating import rated_bands

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.base.key import Key
    from thud.case.case import Case
    from thud.impact.impact import Impact
    from thud.impact.outcomes import Ensemble

# Name and unit of a history.
_HISTORY = re.compile(r"(.*?)_((?:m|s|N|Pa|J|Hz|kg)(?:_per_\w+)?)")


def impact_dataset(impact: Impact, histories: Mapping[str, NDArray[np.float64]]) -> xr.Dataset:
    """Return the dataset of an impact and of its histories, by name and unit."""
    variables: dict[str, Any] = {}
    for column, values in histories.items():
        named = _HISTORY.fullmatch(column)
        name, unit = named.groups() if named else (column, "")
        words = attributes(unit.replace("_per_", "/"), name.replace("_", " "))
        variables[name] = ("time", values, words)
    for name, (force, bands) in LEVELS.items():
        variables[name] = (
            bands,
            impact.levels(bands, force=force),
            attributes(*SET_QUANTITIES[name]),
        )
    for name, entry in schema.SCALARS.items():
        variables[name] = ((), getattr(impact, name), attributes(*entry))
    conforms = impact.conformity().conforms
    variables["conforms"] = ((), conforms, attributes(*SET_QUANTITIES["conforms"]))
    coordinates = {"time": _time(impact.time), **band_coordinates(BANDWIDTHS)}
    remarks = {"remarks": "\n".join(impact.remarks)}
    found = xr.Dataset(variables, coordinates, origin(impact.case) | impact.facts | remarks)
    # The arrays of the impact are read-only.
    return found.copy(deep=True)


def ensemble_dataset(ensemble: Ensemble) -> xr.Dataset:
    """Return the dataset of many drops, along the dimension ``sample``."""
    assert ensemble.case.model is not None  # noqa: S101 - `solve_many` has set it
    coordinates: dict[str, Any] = band_coordinates(bands for _, bands in ensemble.levels)
    for name, values in ensemble.parameters.items():
        key, _ = find_key(name, users(ensemble.case))
        words = attributes(key.unit, key.meaning)
        coordinates[coordinate(name, key)] = ("sample", values, words)
    variables: dict[str, Any] = {}
    for name, entry in SET_QUANTITIES.items():
        if name not in LEVELS:
            variables[name] = ("sample", getattr(ensemble, name), attributes(*entry))
        elif LEVELS[name] in ensemble.levels:
            values = ensemble.levels[LEVELS[name]]
            variables[name] = (("sample", LEVELS[name][1]), values, attributes(*entry))
    for bands, level in ensemble.contact_levels.items():
        words = attributes(*CONTACT_LEVEL)
        variables[f"contact_{bands}_level"] = (("sample", bands), level, words)
    for name, (unit, meaning) in FLOOR_QUANTITIES.items():
        if (values := getattr(ensemble, name)) is not None:
            dimensions = ("sample", ROOM_BAND) if name == ROOM_LEVEL else ("sample",)
            variables[name] = (dimensions, values, attributes(unit, meaning))
            coordinates |= room_coordinates() if name == ROOM_LEVEL else {}
    for force in ("elastic", "floor"):
        if (values := getattr(ensemble, f"{force}_force")) is not None:
            seconds = np.arange(values.shape[1]) / ensemble.sample_rate
            coordinates["time"] = _time(seconds)
            words = attributes("N", f"{force} force")
            variables[f"{force}_force"] = (("sample", "time"), values, words)
    return xr.Dataset(variables, coordinates, origin(ensemble.case)).copy(deep=True)


def _time(seconds: NDArray[np.float64]) -> tuple[str, NDArray[np.float64], dict[str, str]]:
    return "time", seconds, attributes("s", "time since the start of the record")


def attributes(unit: str, meaning: str) -> dict[str, str]:
    """Return unit and meaning as attributes of a variable."""
    return {"units": unit or "1", "long_name": meaning}


def coordinate(parameter: str, key: Key) -> str:
    """Return the name of a parameter's coordinate; some keys are named as results are."""
    name = parameter.replace("(", "_").replace(".", "_").rstrip(")")
    return f"{key.group}_{name}" if name in ALL_QUANTITIES else name


def band_coordinates(kinds: Iterable[BandSet]) -> dict[str, Any]:
    """Return the nominal frequencies of bands by the names of their dimensions."""
    return {bands: _frequencies(bands, get_bands(bands).nominal) for bands in kinds}


def room_coordinates() -> dict[str, Any]:
    """Return the nominal frequencies of the thirds in a room by the name of their dimension."""
    return {ROOM_BAND: _frequencies(ROOM_BAND, rated_bands(BANDWIDTHS[1]))}


def _frequencies(
    dimension: str, nominal: NDArray[np.float64]
) -> tuple[str, NDArray[np.float64], dict[str, str]]:
    return dimension, nominal, attributes("Hz", "nominal frequency")


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
