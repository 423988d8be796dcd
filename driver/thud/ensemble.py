"""Many drops of the shell model at once, with levels and verdicts."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from thud._api import call, ensemble_api, text, words
from thud.case import Ball, Drop, Limits, Sampling
from thud.checks import require_number, require_whole
from thud.errors import InputError
from thud.levels import get_bands
from thud.models import HollowSphere

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

_KEYS, _FLUX_CHOICES = (words(names) for names in ensemble_api.ensemble_keys())
_FLUX = "momentum_flux"
_DEFAULTS: dict[str, Any] = vars(Ball()) | vars(Drop()) | vars(HollowSphere())
MAX_THREADS = 1024

# The library keeps matrices from call to call, and one call uses all threads anyway.
_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True, eq=False)
class Ensemble:
    """Outcomes of many drops; NaN where a set could not be computed.

    Attributes
    ----------
    parameters : dict of str to ndarray, shape (n_set,)
        The parameters of the sets, defaults included.
    status : ndarray of int, shape (n_set,)
        0, or the code of the reason why the set was not computed; see `reasons`.
    contact_time : ndarray, shape (n_set,)
        Time from first touch to release, s.
    peak_force, peak_floor_force : ndarray, shape (n_set,)
        Largest elastic force and largest force on the floor, N.
    max_deflection : ndarray, shape (n_set,)
        Largest deflection, m.
    restitution : ndarray, shape (n_set,)
        Velocity at release over velocity at first touch.
    impulse : ndarray, shape (n_set,)
        Impulse given to the floor, N s.
    elastic_levels, floor_levels : ndarray, shape (n_set, n_band)
        Force exposure levels of the elastic force and of the force on the floor, dB.
    elastic_octaves, floor_octaves : ndarray, shape (n_set, 5)
        The same in octaves, which the verdict is passed on.
    conforms, floor_conforms : ndarray of bool, shape (n_set,)
        Verdict of the standards, judged by the elastic force or by that on the floor.
    elastic_force, floor_force : ndarray, shape (n_set, n_sample), or None
        Forces, N, where they were asked for.
    sample_rate : float
        Samples per second, Hz.
    """

    parameters: dict[str, NDArray[Any]]
    status: NDArray[np.int32]
    contact_time: NDArray[np.float64]
    peak_force: NDArray[np.float64]
    peak_floor_force: NDArray[np.float64]
    max_deflection: NDArray[np.float64]
    restitution: NDArray[np.float64]
    impulse: NDArray[np.float64]
    elastic_levels: NDArray[np.float64]
    floor_levels: NDArray[np.float64]
    elastic_octaves: NDArray[np.float64]
    floor_octaves: NDArray[np.float64]
    conforms: NDArray[np.bool_]
    floor_conforms: NDArray[np.bool_]
    elastic_force: NDArray[np.float64] | None
    floor_force: NDArray[np.float64] | None
    sample_rate: float

    def __len__(self) -> int:
        """Return the number of sets."""
        return len(self.status)

    def reasons(self) -> dict[int, str]:
        """Return the codes that occur and what they mean."""
        return {int(code): text(ensemble_api.status_text(code)) for code in np.unique(self.status)}


def solve_many(  # noqa: PLR0913 - the keywords are those of `solve` and three more
    parameters: Mapping[str, ArrayLike],
    *,
    threads: int | None = None,
    bands: str | None = "octave",
    forces: bool = False,
    sample_rate: float = Sampling.sample_rate,
    duration: float = Sampling.duration,
    substeps: int = Sampling.substeps,
    source: str = Limits.source,
) -> Ensemble:
    """Drop many balls on a rigid floor: the model ``hollow_sphere`` for many sets of parameters.

    The numbers are those of `solve`, to 1e-10 in forces and 1e-6 dB in levels, and have the same
    bits for any number of threads and any order of the sets.

    Parameters
    ----------
    parameters
        Arrays of one dimension, or scalars, by the keys of `Ball`, `Drop` and `HollowSphere`; they
        are broadcast against each other. Keys that are missing have their default.
    threads
        Threads to use; all processors by default.
    bands
        ``"octave"`` or ``"third"``: the bands of the levels; None: neither levels nor verdicts,
        which takes half the time.
    forces
        Keep the force histories: 16 bytes per sample and set.
    sample_rate, duration, substeps
        As in `solve`, shared by all sets.
    source
        ``"rubber_ball"`` or ``"tyre"``: the limits that apply.

    Returns
    -------
    Ensemble
        Outcomes, levels and verdicts. Sets that cannot be computed (out of range, closed, longer
        than the record, too coarse) have a status and NaN, and leave the others as they are.

    Raises
    ------
    InputError
        Where a key is not known, arrays do not broadcast or hold no numbers, the sampling, the
        bands or the number of threads cannot be used, or the results have no room in memory.
    """
    columns, flux = _columns(parameters)
    octaves = len(get_bands().nominal)
    count = 0 if bands is None else len(get_bands(bands).nominal)
    more = count if bands == "third" else 0
    require_number("sample_rate", sample_rate)
    require_number("duration", duration)
    sampling = (float(sample_rate), float(duration))
    require_whole("substeps", substeps, 1, 10_000)
    (n_sample,) = call(ensemble_api.ensemble_size, *sampling, int(substeps))
    # f2py knows no empty arrays; a set of zeros, which is out of range, stands in for none.
    n_set = len(flux)
    numbers = np.zeros((max(n_set, 1), len(_KEYS)))
    numbers[:n_set] = np.stack([columns[key] for key in _KEYS], axis=1)
    try:
        with _ONE_AT_A_TIME:
            status, scalars, levels, met, force = call(
                ensemble_api.solve_sets,
                numbers.T,
                np.resize(flux + 1, len(numbers)),
                *sampling,
                int(substeps),
                str(source).encode("ascii", "replace"),
                _threads(threads),
                int(bands is not None),
                more,
                len(numbers) if forces else 0,
                n_sample if forces else 0,
            )
    except MemoryError as error:
        size = f"{n_set} sets of {n_sample} samples" if forces else f"{n_set} sets"
        message = f"forces = {forces} for {size} has no room in memory; allowed: fewer sets"
        raise InputError(message) from error
    levels = np.moveaxis(levels, 2, 0)[:n_set]
    wanted = levels[:, octaves:] if more else levels[:, :count]
    contact_time, peak_force, peak_floor_force, max_deflection, restitution, impulse = scalars
    return Ensemble(
        columns | {_FLUX: np.array(_FLUX_CHOICES)[flux]},
        status[:n_set],
        contact_time[:n_set],
        peak_force[:n_set],
        peak_floor_force[:n_set],
        max_deflection[:n_set],
        restitution[:n_set],
        impulse[:n_set],
        elastic_levels=wanted[:, :, 0],
        floor_levels=wanted[:, :, 1],
        elastic_octaves=levels[:, :octaves, 0],
        floor_octaves=levels[:, :octaves, 1],
        conforms=met[0, :n_set] != 0,
        floor_conforms=met[1, :n_set] != 0,
        elastic_force=force[:, 0, :n_set].T if forces else None,
        floor_force=force[:, 1, :n_set].T if forces else None,
        sample_rate=sampling[0],
    )


def _columns(
    parameters: Mapping[str, ArrayLike],
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int32]]:
    """Return one array per key, all of one length, and the numbers of the flux choices."""
    if not isinstance(parameters, Mapping):
        message = f"parameters = {parameters!r} is not allowed; allowed: arrays by their keys"
        raise InputError(message)
    known = [*_KEYS, _FLUX]
    for key in parameters:
        if key not in known:
            message = f"{key!r} is not a known key; allowed: {', '.join(known)}"
            raise InputError(message)
    given = {key: _flux(values) if key == _FLUX else _numbers(key, values)
             for key, values in (_DEFAULTS | dict(parameters)).items()}  # fmt: skip
    try:
        arrays = np.broadcast_arrays(*(np.atleast_1d(values) for values in given.values()))
    except ValueError as error:
        shapes = ", ".join(f"{key} {given[key].shape}" for key in parameters)
        message = f"the arrays do not fit each other: {shapes}; allowed: one length, or scalars"
        raise InputError(message) from error
    columns = {key: array.copy() for key, array in zip(given, arrays, strict=True)}
    flux: NDArray[np.int32] = columns.pop(_FLUX).astype(np.int32)
    return columns, flux


def _numbers(key: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return the numbers of one parameter."""
    array = _array(key, values)
    if array.size and array.dtype.kind not in "iuf":
        message = f"{key} is not an array of real numbers; allowed: one dimension of them"
        raise InputError(message)
    return array.astype(np.float64)


def _flux(values: ArrayLike) -> NDArray[np.int32]:
    """Return the numbers of the choices of the flux term, from 0."""
    array = _array(_FLUX, values)
    names, index = np.unique(array.astype(str), return_inverse=True)
    for name in names:
        if name not in _FLUX_CHOICES:
            allowed = ", ".join(map(repr, _FLUX_CHOICES))
            message = f"{_FLUX} = {str(name)!r} is not allowed; allowed: {allowed}"
            raise InputError(message)
    numbers = np.array([_FLUX_CHOICES.index(name) for name in names], dtype=np.int32)
    return numbers[index].reshape(array.shape)


def _array(key: str, values: ArrayLike) -> NDArray[Any]:
    """Return an array of at most one dimension."""
    try:
        array = np.asarray(values)
    except (TypeError, ValueError) as error:  # rows of different length
        message = f"{key} is not an array; allowed: one dimension"
        raise InputError(message) from error
    if array.ndim > 1:
        message = f"{key} has {array.ndim} dimensions; allowed: one, or a scalar"
        raise InputError(message)
    if np.ma.is_masked(values):
        message = f"{key} has masked entries; allowed: values only"
        raise InputError(message)
    return array


def _threads(threads: int | None) -> int:
    """Return the number of threads."""
    if threads is None:
        return min(len(os.sched_getaffinity(0)), MAX_THREADS)
    require_whole("threads", threads, 1, MAX_THREADS)
    return int(threads)
