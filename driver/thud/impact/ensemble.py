"""Many drops in one call, with levels and verdicts, by any source model."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from thud.base._schema import KEYS, SampleQuantities
from thud.base.bridge import ask
from thud.base.checks import (
    refuse,
    refuse_value,
    require_array,
    require_choice,
    require_kind,
    thread_count,
)
from thud.base.display import Displayed
from thud.base.immutable import freeze
from thud.case.case import Case, case_text, impact_only, new_model
from thud.case.keys import find_key
from thud.impact.datasets import NO_ERRORS, RESULTS, ensemble_dataset, sample_table, sample_warnings
from thud.level.levels import FORCES, peak_count

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    import pandas as pd
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from thud.base._schema import ModelName
    from thud.base.key import Key
    from thud.base.note import Note

# Maximum number of values of one call of the library, for its memory, and of one sample without its
# forces.
_MAX_VALUES = 2**26
_SAMPLE_VALUES = 2**6
# Number of steps of a progress bar, each with at least this number of samples for every thread.
_STEPS = 100
_MIN_SAMPLES = 4


@dataclass(frozen=True, eq=False, kw_only=True)
class Ensemble(SampleQuantities, Displayed):
    """Results of many samples of a case; NaN for samples that could not be computed.

    Attributes are those of `SampleQuantities` and the following.

    Attributes
    ----------
    case : Case
        All other keys.
    parameters : dict of str to ndarray, shape (n_sample,)
        Values of the keys in which the samples differ.
    status : ndarray of int, shape (n_sample,)
        0, or the exit code of the error: 1 invalid input, 2 numerical failure.
    reason : ndarray of str, shape (n_sample,)
        Message of the error; empty without an error.
    elastic_octave, floor_octave : ndarray, shape (n_sample, 5)
        Force exposure levels of the octaves, which are assessed, dB: those of the elastic force and
        of the force on a rigid floor.
    elastic_third, floor_third : ndarray, shape (n_sample, 15), or None
        Levels of the one-third-octave bands, dB; None unless requested.
    margin : ndarray, shape (n_sample,)
        Minimum distance of the octave levels of the assessed force from their limits, dB; negative
        outside the limits.
    conforms : ndarray of bool, shape (n_sample,)
        Whether all criteria are met with the force that the case assesses.
    elastic_force, floor_force : ndarray, shape (n_sample, n_time), or None
        Forces, N; None unless requested.
    sample_rate : float
        Samples per second, Hz.
    contact_octave, contact_third : ndarray, shape (n_sample, n_band), or None
        Levels of the force on the floor of the case, dB; equal to those on a rigid floor if the
        model has no other force. None without a floor, or if the bands are not requested.
    floor_work : ndarray, shape (n_sample,), or None
        Energy that the source transfers to the floor, J; None without a floor.
    room_third : ndarray, shape (n_sample, 12), or None
        Maximum Fast levels in the room, dB re 20 uPa, in the one-third-octave bands 50 to 630 Hz;
        None without a room.
    room_rating : ndarray, shape (n_sample,), or None
        The rating that the room asks for by its key `rating`, dB, not rounded; None without a room.
    """

    drawn_by: ClassVar[str] = "sweep_figures.draw_sweep"

    case: Case
    parameters: dict[str, NDArray[np.generic]]
    status: NDArray[np.int32]
    reason: NDArray[np.object_]
    elastic_octave: NDArray[np.float64]
    floor_octave: NDArray[np.float64]
    margin: NDArray[np.float64]
    conforms: NDArray[np.bool_]
    sample_rate: float
    elastic_third: NDArray[np.float64] | None = None
    floor_third: NDArray[np.float64] | None = None
    contact_octave: NDArray[np.float64] | None = None
    contact_third: NDArray[np.float64] | None = None
    elastic_force: NDArray[np.float64] | None = None
    floor_force: NDArray[np.float64] | None = None
    floor_work: NDArray[np.float64] | None = None
    room_third: NDArray[np.float64] | None = None
    room_rating: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.status)

    def __repr__(self) -> str:
        """Return the parameters and the number of drops that conform."""
        names = ", ".join(self.parameters)
        failed = f", {np.sum(self.status != 0)} failed" if self.status.any() else ""
        # If no levels were computed, all margins are NaN.
        is_assessed = np.isfinite(self.margin).any() or (self.status != 0).all()
        verdict = f"{self.conforms.sum()} conform" if is_assessed else "not assessed"
        return f"<Ensemble: {len(self)} drops by {names}; {verdict}{failed}>"

    @property
    def peaks(self) -> NDArray[np.float64] | None:
        """Number of peaks of the assessed force; NaN without result, None without forces."""
        if (forces := getattr(self, f"{self.case.levels.force}_force")) is None:
            return None
        counts = [
            math.nan if status else peak_count(force, self.sample_rate)
            for force, status in zip(forces, self.status, strict=True)
        ]
        return np.array(counts, dtype=float)

    @property
    def results(self) -> dict[str, NDArray[Any]]:
        """Results that were computed, by their names in `thud.impact.datasets.RESULTS`."""
        values = {name: getattr(self, name, None) for name in RESULTS}
        return {name: array for name, array in values.items() if array is not None}

    @property
    def notes(self) -> tuple[Note, ...]:
        """Warnings of samples without results or conformity; that none states numerical errors."""
        # Without levels, nothing is known of the source.
        conforms = None if self.room_rating is None else self.conforms | np.isnan(self.margin)
        return (*sample_warnings(self.status, self.reason, conforms), NO_ERRORS)

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: the range of each number that every sample has."""
        rows: list[tuple[str, ...]] = [("", "minimum", "median", "maximum")]
        for name, values in self.results.items():
            if values.ndim > 1 or values.dtype.kind != "f":
                continue
            computed = values[(self.status == 0) & np.isfinite(values)]
            if computed.size:
                quantiles = np.quantile(computed, [0, 0.5, 1])
                rows.append((RESULTS[name].label, *map(RESULTS[name].show, quantiles)))
        return rows

    def to_xarray(self) -> xr.Dataset:
        """Return the results along the dimension ``sample``, with units and provenance.

        Raise InputError if xarray is not installed.
        """
        return ensemble_dataset(self)

    def to_dataframe(self) -> pd.DataFrame:
        """Return a row for each sample, without forces; levels have a column for each band, Hz.

        Raise InputError if xarray is not installed.
        """
        return sample_table(self.to_xarray())


def solve_many(  # noqa: PLR0913 - samples, and how to compute them
    parameters: Mapping[str, ArrayLike] | pd.DataFrame,
    case: Case | None = None,
    *,
    model: ModelName | None = None,
    threads: int | None = None,
    levels: bool = True,
    forces: bool = False,
    progress: bool = False,
) -> Ensemble:
    """Compute many drops on a rigid floor and, if the case has a floor, on this floor.

    Results are identical to those of `solve`, except for the shell model, which is computed in
    batches: its forces agree to 1e-10, and its levels to 1e-6 dB in bands with at least 1e-8 of the
    energy of the force. In bands with less energy, such as 500 Hz for slow contacts, the difference
    is inversely proportional to the energy. Results do not depend on the number of threads or on
    the order of the samples.

    Parameters
    ----------
    parameters
        Scalars or arrays of one dimension by the names of keys, such as a pandas.DataFrame; they
        are broadcast against each other. An entry of a list is named like ``"frequency(2)"``. If
        the name of a key of floor or room is not unique, its group precedes it, as in
        ``"plate.loss_factor"``.
    case
        Values of all other keys, such as the bands of the levels in addition to octaves; by default
        the standard ball from 1 m.
    model
        Source model in place of the model of the case, with its default options.
    threads
        Number of threads; by default the number of processors. A forked process uses one thread, as
        the threads of its parent do not exist in it.
    levels
        Also compute levels and verdicts, which takes longer.
    forces
        Return the force histories, which take 16 bytes for each instant of each sample.
    progress
        Show a progress bar.

    Returns
    -------
    Ensemble
        Quantities, levels and verdicts. Failed samples have a status, a reason and NaN, and do not
        affect other samples.

    Raises
    ------
    InputError
        If a key is unknown, arrays are not numeric or do not broadcast, the case or the number of
        threads are invalid, or the results do not fit in memory.
    """
    from tqdm import tqdm

    base = Case() if case is None else case
    require_kind("case", base, Case)
    for name, value in {"levels": levels, "forces": forces, "progress": progress}.items():
        require_kind(name, value, bool | np.bool_)
    if model is not None and str(model) != (base.model.name if base.model else ""):
        base = replace(base, model=new_model(model, {}))
    if base.model is None:
        refuse("the case has no source model", "a case with a model, or model = its name")
    base = impact_only(base)
    content = case_text(base)
    if not hasattr(parameters, "keys"):
        refuse_value("parameters", parameters, "arrays by their keys")
    width = thread_count("threads", threads)
    length = math.ceil(base.sampling.duration * base.sampling.sample_rate) if forces else 0
    try:
        # Without parameters, there is only the drop of the case.
        columns, numbers = _columns(dict(parameters) or {"height": base.drop.height}, base)
        # Raises MemoryError before the computation if the results do not fit.
        np.empty((len(numbers), len(FORCES), length))
        size = max(1, _MAX_VALUES // (_SAMPLE_VALUES + len(FORCES) * length))
        if progress:
            size = min(size, max(_MIN_SAMPLES * width, len(numbers) // _STEPS))
        blocks = []
        with tqdm(total=len(numbers), unit="sample", disable=not progress, leave=False) as bar:
            for start in range(0, max(1, len(numbers)), size):
                block = numbers[start : start + size]
                results = _compute(content, columns, block, width, levels=levels, forces=forces)
                blocks.append(results)
                bar.update(len(block))
        if len(blocks) > 1:
            results = {name: np.concatenate([block[name] for block in blocks]) for name in results}
    except MemoryError as error:
        problem = f"the parameters, or forces of {length} values each, do not fit in memory"
        refuse(problem, "fewer samples", error)
    # Forces may fill the memory; `Ensemble` does not copy frozen arrays.
    force = freeze(results.pop("force"))
    return Ensemble(
        case=base,
        parameters=columns,
        elastic_force=force[:, 0] if forces else None,
        floor_force=force[:, 1] if forces else None,
        sample_rate=base.sampling.sample_rate,
        **results,
    )


def _compute(  # noqa: PLR0913 - the arguments of the library
    content: bytes,
    keys: Collection[str],
    numbers: NDArray[np.float64],
    threads: int,
    *,
    levels: bool,
    forces: bool,
) -> dict[str, NDArray[Any]]:
    """Return the results of a block of samples; the first axis is the sample."""
    answer = ask(
        "samples", case=content, keys=",".join(keys).encode("ascii", "replace"),
        key_count=len(keys), values=numbers.T, threads=threads, levels=levels, forces=forces,
    )  # fmt: skip
    reasons = answer.pop("reasons").split("\n")[:-1]
    for force in FORCES:
        answer.pop(f"{force}_conforms")
    results = {name: values.T for name, values in answer.items()}
    results["conforms"] = results["conforms"] != 0
    results["status"] = results["status"].astype(np.int32)
    results["reason"] = np.full(len(numbers), "", dtype=object)
    results["reason"][results["status"] != 0] = reasons
    return results


def _columns(
    parameters: Mapping[str, ArrayLike], case: Case
) -> tuple[dict[str, NDArray[Any]], NDArray[np.float64]]:
    """Return arrays of one length by key, and their numbers for the library, [n_sample, n_key]."""
    keys = [find_key(name, case)[0] for name in parameters]
    for key in keys:
        if key not in KEYS:
            refuse(f"{key.name!r} is a parameter of studies", "keys of the input")
    inputs = [require_array(name, values, (0, 1)) for name, values in parameters.items()]
    numbers = [_numbers(key, array) for key, array in zip(keys, inputs, strict=True)]
    try:
        arrays = np.broadcast_arrays(*map(np.atleast_1d, inputs))
        table = np.stack(np.broadcast_arrays(*map(np.atleast_1d, numbers)), axis=1)
    except ValueError as error:
        shapes = ", ".join(f"{name} {a.shape}" for name, a in zip(parameters, inputs, strict=True))
        refuse(f"the arrays differ in length: {shapes}", "one length, or scalars", error)
    return {name: a.copy() for name, a in zip(parameters, arrays, strict=True)}, table


def _numbers(key: Key, array: NDArray[Any]) -> NDArray[np.float64]:
    """Return the numbers of a parameter; a choice is represented by its index, from 1."""
    if key.kind == "choice":
        words = array.astype(str)
        for word in np.unique(words):
            require_choice(key.name, str(word), key.choices)
        numbers = np.arange(1.0, len(key.choices) + 1)
        return np.select([words == word for word in key.choices], list(numbers))
    return require_array(key.name, array, (0, 1), "b" if key.kind == "flag" else "iuf")
