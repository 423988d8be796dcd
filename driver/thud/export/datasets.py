"""Impacts and ensembles as datasets of xarray, named as those of studies."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr

from thud.base.schema import SCALARS
from thud.impact.floor_impact import FloorImpact
from thud.impact.impact import Impact
from thud.case.keys import find_key, users
from thud.level.levels import BANDWIDTHS
from thud.impact.outcomes import FURTHER, ROOM_LEVEL
from thud.studies.dataset import (
    MEANINGS,
    ROOM_BAND,
    band_coordinates,
    coordinate,
    origin,
    room_coordinates,
)
from thud.studies.evaluation import LEVELS
from thud.studies.parameter import Parameter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.impact.compression import CompressionCurve
    from thud.impact.outcomes import Ensemble

# Name and unit of a history.
_HISTORY = re.compile(r"(.*?)_((?:m|s|N|Pa|J|Hz|kg)(?:_per_\w+)?)")


def dataset(result: Impact | Ensemble) -> xr.Dataset:
    """Return the dataset of a result, see its `to_xarray`."""
    found = _of_impact(result) if isinstance(result, Impact) else _of_ensemble(result)
    # The arrays of the result are read-only.
    return found.copy(deep=True)


def _of_impact(impact: Impact) -> xr.Dataset:
    variables: dict[str, Any] = {}
    for column, values in _columns(impact).items():
        named = _HISTORY.fullmatch(column)
        name, unit = named.groups() if named else (column, "")
        words = _attributes(unit.replace("_per_", "/"), name.replace("_", " "))
        variables[name] = ("time", values, words)
    for name, (force, bands) in LEVELS.items():
        variables[name] = (bands, impact.levels(bands, force=force), _attributes(*MEANINGS[name]))
    for name, entry in SCALARS.items():
        variables[name] = ((), getattr(impact, name), _attributes(*entry))
    if isinstance(impact, FloorImpact):
        words = _attributes("J", "energy that the source gives to the floor")
        variables["floor_work"] = ((), impact.floor_work, words)
    conforms = impact.conformity().conforms
    variables["conforms"] = ((), conforms, _attributes(*MEANINGS["conforms"]))
    coordinates = {"time": _time(impact.time), **band_coordinates(BANDWIDTHS)}
    return xr.Dataset(
        variables,
        coordinates,
        origin(impact.case) | impact.facts | {"remarks": "\n".join(impact.remarks)},
    )


def table(impact: Impact) -> pd.DataFrame:
    """Return the table of an impact, see `Impact.to_dataframe`."""
    return pd.DataFrame(_columns(impact), index=pd.Index(impact.time, name="time_s"))


def compression_table(curve: CompressionCurve) -> pd.DataFrame:
    """Return the table of a compression, see `CompressionCurve.to_dataframe`."""
    return pd.DataFrame({"deflection_m": curve.deflection, "force_N": curve.force})


def _columns(impact: Impact) -> dict[str, NDArray[np.float64]]:
    """Return the histories of an impact by name and unit, shape (n_sample,)."""
    forces = {"elastic_force": impact.elastic_force, "floor_force": impact.floor_force}
    moving = {}
    if isinstance(impact, FloorImpact):
        forces["blocked_force"] = impact.blocked_force
        moving = {
            "floor_displacement_m": impact.floor_displacement,
            "floor_velocity_m_per_s": impact.floor_velocity,
        }
        for i, velocity in enumerate(impact.point_velocity, 1):
            moving[f"point_{i}_velocity_m_per_s"] = velocity
    return {
        "deflection_m": impact.deflection,
        "velocity_m_per_s": impact.velocity,
        **{f"{name}_N": values for name, values in (forces | impact.parts).items()},
        **moving,
        **impact.channels,
    }


def _of_ensemble(ensemble: Ensemble) -> xr.Dataset:
    assert ensemble.case.model is not None  # noqa: S101 - `solve_many` has set it
    coordinates: dict[str, Any] = band_coordinates(bands for _, bands in ensemble.levels)
    for name, values in ensemble.parameters.items():
        key, _ = find_key(name, users(ensemble.case))
        words = _attributes(key.unit, key.meaning)
        coordinates[coordinate(Parameter(name=name, key=key))] = ("set", values, words)
    variables: dict[str, Any] = {}
    for name, entry in MEANINGS.items():
        if name not in LEVELS:
            variables[name] = ("set", getattr(ensemble, name), _attributes(*entry))
        elif LEVELS[name] in ensemble.levels:
            values = ensemble.levels[LEVELS[name]]
            variables[name] = (("set", LEVELS[name][1]), values, _attributes(*entry))
    for bands, level in ensemble.contact_levels.items():
        words = _attributes("dB", "force exposure level on the floor that moves, re 1 N and 1 s")
        variables[f"contact_{bands}_level"] = (("set", bands), level, words)
    for name, (unit, meaning) in FURTHER.items():
        if (values := getattr(ensemble, name)) is not None:
            dimensions = ("set", ROOM_BAND) if name == ROOM_LEVEL else ("set",)
            variables[name] = (dimensions, values, _attributes(unit, meaning))
            coordinates |= room_coordinates() if name == ROOM_LEVEL else {}
    for force in ("elastic", "floor"):
        if (values := getattr(ensemble, f"{force}_force")) is not None:
            seconds = np.arange(values.shape[1]) / ensemble.sample_rate
            coordinates["time"] = _time(seconds)
            words = _attributes("N", f"{force} force")
            variables[f"{force}_force"] = (("set", "time"), values, words)
    return xr.Dataset(variables, coordinates, origin(ensemble.case))


def _time(seconds: NDArray[np.float64]) -> tuple[str, NDArray[np.float64], dict[str, str]]:
    return "time", seconds, _attributes("s", "time since the start of the record")


def _attributes(unit: str, meaning: str) -> dict[str, str]:
    return {"units": unit or "1", "long_name": meaning}
