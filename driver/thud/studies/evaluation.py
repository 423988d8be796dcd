"""What becomes of a block of sets: one function, whatever computes them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from thud._api import version
from thud.case import Ball, Case, Drop, Levels
from thud.ensemble import solve_many
from thud.errors import InputError, ThudError
from thud.impact import FORCES, solve_case
from thud.keys import put
from thud.levels import get_bands, octave_limits
from thud.models import HollowSphere

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Columns = dict[str, NDArray[Any]]

# By name: unit and meaning of the numbers that each set has.
SCALARS = {
    "contact_time": ("s", "contact time"),
    "peak_force": ("N", "maximum elastic force"),
    "peak_floor_force": ("N", "maximum force on the floor"),
    "max_deflection": ("m", "maximum deflection"),
    "restitution": ("1", "coefficient of restitution"),
    "impulse": ("N s", "time integral of the force on the floor"),
}
OCTAVES = len(get_bands().nominal)
# About the time of one set, s; a block of sets should take about _BLOCK_TIME.
_SET_TIME = {"modal_ball": 8e-3, "finite_element": 0.25}
_USUAL_TIME = 1.5e-3
_ENSEMBLE_TIME = 1.5e-5
_BLOCK_TIME = 0.5
_ENSEMBLE_KEYS = {
    *(option.name for kind in (Ball, Drop) for option in dataclasses.fields(kind)),
    "momentum_flux",
}


@dataclass(frozen=True)
class Block:
    """Sets that are computed together.

    Attributes
    ----------
    start : int
        The first of them.
    case : Case
        The case from which they differ.
    columns : dict of str to ndarray, shape (n_set,)
        Their values by the names of keys.
    version : str
        The version of thud that has to compute them.
    """

    start: int
    case: Case
    columns: Columns
    version: str


def evaluate(block: Block, threads: int = 1) -> Columns:
    """Compute the sets of a block.

    Parameters
    ----------
    block
        The sets.
    threads
        Threads of an ensemble; it gives the same bits with any number of them.

    Returns
    -------
    dict of str to ndarray, shape (n_set,) or (n_set, 5)
        The `SCALARS`; ``elastic_level`` and ``floor_level`` of each octave, dB, and where the case
        wants them ``elastic_third_level`` and ``floor_third_level``; ``margin``, the
        minimum distance of the judged force's levels to a limit, dB; ``conforms``; ``status``, 0 or
        the exit code of the error; ``reason``, its text. Sets with an error have no numbers: NaN.

    Raises
    ------
    InputError
        Where this is another version of thud.
    """
    if block.version != version():
        message = (
            f"thud {version()} is asked for sets of thud {block.version}; "
            f"allowed: the same version everywhere"
        )
        raise InputError(message)
    if _suits_ensemble(block.case, block.columns):
        return _by_ensemble(block.case, block.columns, threads)
    return _one_by_one(block.case, block.columns)


def _one_by_one(case: Case, columns: Mapping[str, NDArray[Any]]) -> Columns:
    """Compute sets by the single solver."""
    size = len(next(iter(columns.values())))
    found = _empty(size, case)
    for i in range(size):
        try:
            one = put(case, {name: values[i].item() for name, values in columns.items()})
            impact = solve_case(one)
            levels = {
                name: impact.levels(bands=bands, force=force)
                for name, (force, bands) in level_names(case).items()
            }
            verdict = impact.conformity()
        except ThudError as error:
            found["status"][i] = error.exit_code
            found["reason"][i] = str(error)
            continue
        for name in SCALARS:
            found[name][i] = getattr(impact, name)
        for name, values in levels.items():
            found[name][i] = values
        octaves = verdict.criteria[:OCTAVES]
        found["margin"][i] = min(min(o.value - o.lower, o.upper - o.value) for o in octaves)
        found["conforms"][i] = verdict.conforms
    return found


def level_names(case: Case) -> dict[str, tuple[str, str]]:
    """Return force and bands of the levels that each set has, by their names.

    The octaves serve the verdict also where the case wants thirds only.
    """
    names = {f"{force}_level": (force, "octave") for force in FORCES}
    if case.levels.bands != "octave":
        names |= {f"{force}_third_level": (force, "third") for force in FORCES}
    return names


def _empty(size: int, case: Case) -> Columns:
    """Return columns for the results of sets: not a number, not conforming, no error."""
    found: Columns = {name: np.full(size, np.nan) for name in (*SCALARS, "margin")}
    for name, (_, bands) in level_names(case).items():
        found[name] = np.full((size, len(get_bands(bands).nominal)), np.nan)
    found["conforms"] = np.zeros(size, dtype=bool)
    found["status"] = np.zeros(size, dtype=np.int8)
    found["reason"] = np.full(size, "", dtype=object)
    return found


def block_size(case: Case) -> int:
    """Return how many sets are computed together: the same wherever they are computed."""
    usual = _ENSEMBLE_TIME if _has_ensemble(case) else _USUAL_TIME
    return max(1, round(_BLOCK_TIME / _SET_TIME.get(case.model.name, usual)))  # type: ignore[union-attr]


def _has_ensemble(case: Case) -> bool:
    """Return whether the library computes many sets of a case at once."""
    exact = case.levels.method == Levels.method
    return isinstance(case.model, HollowSphere) and exact


def _suits_ensemble(case: Case, columns: Mapping[str, NDArray[Any]]) -> bool:
    """Return whether the library computes these sets at once."""
    return _has_ensemble(case) and set(columns) <= _ENSEMBLE_KEYS


def _by_ensemble(case: Case, columns: Columns, threads: int) -> Columns:
    """Compute sets by the ensemble of the shell model."""
    shared = vars(case.ball) | vars(case.drop) | vars(case.model)
    source = case.limits.source
    names = level_names(case)
    widest = "third" if "elastic_third_level" in names else "octave"
    ensemble = solve_many(
        shared | columns, threads=threads, bands=widest, source=source, **vars(case.sampling)
    )
    found = _empty(len(next(iter(columns.values()))), case)
    for name in SCALARS:
        found[name][:] = getattr(ensemble, name)
    judged_by_floor = case.levels.force == "floor"
    found["conforms"][:] = ensemble.floor_conforms if judged_by_floor else ensemble.conforms
    for name, (force, bands) in names.items():
        kind = "octaves" if bands == "octave" else "levels"
        found[name][:] = getattr(ensemble, f"{force}_{kind}")
    lower, upper = octave_limits(source)
    judged = found[f"{case.levels.force}_level"]
    found["margin"][:] = np.minimum(judged - lower, upper - judged).min(axis=1)
    # The single solver has the sentences.
    failed = np.flatnonzero(np.asarray(ensemble.status))
    if failed.size:
        again = _one_by_one(case, {name: values[failed] for name, values in columns.items()})
        for name, values in again.items():
            found[name][failed] = values
    return found
