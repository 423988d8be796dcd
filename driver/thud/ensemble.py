"""Many drops at once, with levels and verdicts, by any source model."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from tqdm import tqdm

from thud._api import call, collect, ensemble_api, text
from thud._schema import KEYS, SCALARS, HollowSphere, Levels, Limits, Sampling
from thud.case import Case, case_text, new_model
from thud.checks import require_kind, require_whole
from thud.errors import InputError
from thud.keys import find_key
from thud.levels import get_bands

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from thud._api import Bundle
    from thud.key import Key

MAX_THREADS = 1024
# About the work of one call of the library on each thread, s: between two calls it can be stopped.
_CALL_TIME = 1.0
# Most sets of one call, whose results the library holds.
_MAX_CALL = 2**17

# The library keeps matrices from call to call, and one call uses all threads anyway.
_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True, eq=False)
class Ensemble:
    """Outcomes of many drops; NaN where a drop could not be computed.

    Attributes
    ----------
    parameters : dict of str to ndarray, shape (n_set,)
        What the drops differ in.
    status : ndarray of int, shape (n_set,)
        0, or the exit code of the error: 1 bad input, 2 numerical failure.
    reason : ndarray of str, shape (n_set,)
        The sentence of the error.
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
    reason: NDArray[np.object_]
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


def solve_many(  # noqa: PLR0913 - the keywords are those of `solve` and some more
    parameters: Mapping[str, ArrayLike],
    case: Case | None = None,
    *,
    model: str | None = None,
    threads: int | None = None,
    bands: str | None = "octave",
    forces: bool = False,
    sample_rate: float | None = None,
    duration: float | None = None,
    substeps: int | None = None,
    source: str | None = None,
    progress: bool = False,
) -> Ensemble:
    """Drop many balls on a rigid floor.

    The numbers are those of `solve`: of the shell model, whose drops are computed in batches, to
    1e-10 in forces and 1e-6 dB in levels; of the others bit by bit. They do not depend on the
    number of threads or on the order of the sets.

    Parameters
    ----------
    parameters
        Arrays of one dimension, or scalars, by the names of keys (entries of lists as
        ``"frequency(2)"``); they are broadcast against each other.
    case
        Everything else; by default the paper's ball and drop.
    model
        Source model, with its default options where it is not that of the case.
    threads
        Threads to use; all processors by default.
    bands
        ``"octave"`` or ``"third"``: the bands of the levels; None: neither levels nor verdicts,
        which takes less time.
    forces
        Keep the force histories: 16 bytes per sample and set.
    sample_rate, duration, substeps
        As in `solve`, shared by all sets; by default those of the case.
    source
        ``"rubber_ball"`` or ``"tyre"``: the limits that apply; by default those of the case.
    progress
        Show how many sets are computed.

    Returns
    -------
    Ensemble
        Outcomes, levels and verdicts. Sets that cannot be computed have a status, a reason and
        NaN, and leave the others as they are.

    Raises
    ------
    InputError
        Where a key is not known, arrays do not broadcast or hold no numbers, the case, the bands
        or the number of threads cannot be used, or the results have no space in memory.
    """
    base = Case() if case is None else case
    require_kind("case", base, Case)
    if bands is not None:
        get_bands(bands)
    sampling = base.sampling
    base = replace(
        base,
        modes=None,
        sampling=Sampling(
            sampling.sample_rate if sample_rate is None else sample_rate,
            sampling.duration if duration is None else duration,
            sampling.substeps if substeps is None else substeps,
        ),
        levels=replace(base.levels, bands=bands or Levels.bands),
        limits=Limits(str(source)) if source is not None else base.limits,
    )
    if base.model is None or (model is not None and model != base.model.name):
        base = replace(base, model=new_model(model or HollowSphere.name, {}))
    content = case_text(base)
    # Without parameters there is one drop, that of the case.
    columns, numbers = _columns(parameters or {"height": base.drop.height}, base)
    sizes = call(ensemble_api.size_many, content)
    width = _threads(threads)
    results = _allocate(len(numbers), sizes, forces=forces)
    work = int(np.clip(_CALL_TIME * width / sizes["cost"], 1, _MAX_CALL))
    with tqdm(total=len(numbers), unit="set", disable=not progress, leave=False) as bar:
        for start in range(0, len(numbers), work):
            place = slice(start, min(start + work, len(numbers)))
            _compute(content, columns, numbers[place], width, bands, results, place)
            bar.update(place.stop - place.start)
    levels, octaves = results["level"], len(get_bands().nominal)
    wanted = levels[:, :, int(sizes["first_band"]) - 1 :] if bands else levels[:, :, :0]
    force = results["force"]
    return Ensemble(
        columns,
        results["status"],
        results["reason"],
        **dict(zip(SCALARS, results["outcome"].T, strict=False)),
        elastic_levels=wanted[:, 0],
        floor_levels=wanted[:, 1],
        elastic_octaves=levels[:, 0, :octaves],
        floor_octaves=levels[:, 1, :octaves],
        conforms=results["conforms"][:, 0],
        floor_conforms=results["conforms"][:, 1],
        elastic_force=force[:, 0] if forces else None,
        floor_force=force[:, 1] if forces else None,
        sample_rate=base.sampling.sample_rate,
    )


def _allocate(count: int, sizes: Bundle, *, forces: bool) -> dict[str, NDArray[Any]]:
    """Return arrays for the results of sets."""
    outcome, band, force, sample = (
        int(sizes[name]) for name in ("outcome", "band", "force", "sample")
    )
    try:
        return {
            "status": np.zeros(count, dtype=np.int32),
            "reason": np.full(count, "", dtype=object),
            "outcome": np.empty((count, outcome)),
            "level": np.empty((count, force, band)),
            "conforms": np.zeros((count, force), dtype=bool),
            "force": np.empty((count if forces else 1, force, sample if forces else 1)),
        }
    except MemoryError as error:
        size = f"{count} sets of {sample} samples" if forces else f"{count} sets"
        message = f"forces = {forces} for {size} has no space in memory; allowed: fewer sets"
        raise InputError(message) from error


def _compute(  # noqa: PLR0913, PLR0917 - what the library asks for
    content: bytes,
    columns: Mapping[str, Any],
    numbers: NDArray[np.float64],
    threads: int,
    bands: str | None,
    results: dict[str, NDArray[Any]],
    place: slice,
) -> None:
    """Compute some sets and put their results in their place."""
    _, force_count, band = results["level"].shape
    sample = results["force"].shape[-1]
    forces = sample > 1
    with _ONE_AT_A_TIME:
        status, outcome, level, conforms, force, *left = ensemble_api.drop_many(
            content,
            ",".join(columns).encode("ascii", "replace"),
            numbers.T,
            threads,
            int(bands is not None),
            results["outcome"].shape[1],
            band,
            force_count,
            sample,
            len(numbers) if forces else 1,
        )
    reasons = collect(*left)
    results["status"][place] = status
    results["outcome"][place] = outcome.T
    results["level"][place] = np.moveaxis(level, -1, 0).swapaxes(1, 2)
    results["conforms"][place] = conforms.T != 0
    if forces:
        results["force"][place] = np.moveaxis(force, -1, 0).swapaxes(1, 2)
    for number, reason in reasons.items():
        results["reason"][place.start + int(number) - 1] = text(reason)


def _columns(
    parameters: Mapping[str, ArrayLike], case: Case
) -> tuple[dict[str, NDArray[Any]], NDArray[np.float64]]:
    """Return one array per key, all of one length, and their numbers for the library."""
    if not isinstance(parameters, Mapping):
        message = f"parameters = {parameters!r} is not allowed; allowed: arrays by their keys"
        raise InputError(message)
    assert case.model is not None  # noqa: S101 - `solve_many` has seen to it
    keys = [find_key(name, case.model.name)[0] for name in parameters]
    for key in keys:
        if key not in KEYS:
            message = f"{key.name!r} is a parameter of studies; allowed: keys of the input"
            raise InputError(message)
    given = [_array(name, values) for name, values in parameters.items()]
    numbers = [_numbers(key, array) for key, array in zip(keys, given, strict=True)]
    try:
        arrays = np.broadcast_arrays(*map(np.atleast_1d, given))
        found = np.stack(np.broadcast_arrays(*map(np.atleast_1d, numbers)), axis=1)
    except ValueError as error:
        shapes = ", ".join(f"{name} {a.shape}" for name, a in zip(parameters, given, strict=True))
        message = f"the arrays do not fit each other: {shapes}; allowed: one length, or scalars"
        raise InputError(message) from error
    return {name: a.copy() for name, a in zip(parameters, arrays, strict=True)}, found


def _numbers(key: Key, array: NDArray[Any]) -> NDArray[np.float64]:
    """Return the numbers of one parameter; of choices their places, from 1."""
    if key.kind == "choice":
        words, index = np.unique(array.astype(str), return_inverse=True)
        for word in words:
            if word not in key.choices:
                allowed = ", ".join(map(repr, key.choices))
                message = f"{key.name} = {str(word)!r} is not allowed; allowed: {allowed}"
                raise InputError(message)
        places = np.array([key.choices.index(word) + 1.0 for word in words])
        return places[index].reshape(array.shape)
    if array.size and array.dtype.kind not in ("b" if key.kind == "flag" else "iuf"):
        message = f"{key.name} is not an array of real numbers; allowed: one dimension of them"
        raise InputError(message)
    return array.astype(np.float64)


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
