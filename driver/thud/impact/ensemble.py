"""Many drops in one call, with levels and verdicts, by any source model."""

from __future__ import annotations

import math
import os
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base._schema import KEYS, Limits
from thud.base.bridge import ask
from thud.base.checks import (
    refuse,
    refuse_value,
    require_array,
    require_choice,
    require_kind,
    require_real,
    require_whole,
)
from thud.base.immutable import freeze
from thud.case.case import Case, case_text, impact_only, new_model
from thud.case.keys import find_key, key_owners
from thud.impact.outcomes import Ensemble
from thud.level.levels import FORCES, get_bands

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import pandas as pd
    from numpy.typing import ArrayLike, NDArray

    from thud.base._schema import BandSet, LimitsSource, ModelName
    from thud.base.key import Key

MAX_THREADS = 1024
# Results that are truth values.
_FLAGS = {"conforms", *(f"{force}_conforms" for force in FORCES)}
# Duration of one call of the library, s, and samples of a thread in the first call; interrupts are
# handled between calls.
_CALL_TIME = 1.0
_FIRST_BLOCK = 4
# Limits of one call, for its memory: number of samples, and number of values of their forces.
_MAX_SAMPLES = 2**17
_MAX_VALUES = 2**26


def solve_many(  # noqa: PLR0913 - the keywords are those of `solve` and some more
    parameters: Mapping[str, ArrayLike] | pd.DataFrame,
    case: Case | None = None,
    *,
    model: ModelName | None = None,
    threads: int | None = None,
    levels: bool = True,
    bands: BandSet | None = None,
    forces: bool = False,
    sample_rate: float | None = None,
    duration: float | None = None,
    substeps: int | None = None,
    source: LimitsSource | None = None,
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
        Values of all other keys; by default the standard ball from 1 m.
    model
        Source model in place of the model of the case, with its default options.
    threads
        Number of threads; by default the number of processors. A forked process uses one thread, as
        the threads of its parent do not exist in it.
    levels
        Also compute levels and verdicts, which takes longer.
    bands
        Bands of the levels in addition to octaves, such as ``"third"``; by default the bands of
        the case.
    forces
        Return the force histories, which take 16 bytes for each instant of each sample.
    sample_rate, duration, substeps
        As in `solve`, for all samples; by default the values of the case.
    source
        ``"rubber_ball"`` or ``"tyre"``, whose limits apply; by default the source of the case.
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
        If a key is unknown, arrays are not numeric or do not broadcast, the case, the bands
        or the number of threads are invalid, or the results do not fit in memory.
    """
    from tqdm import tqdm

    base = Case() if case is None else case
    require_kind("case", base, Case)
    if bands is not None:
        get_bands(bands)
    if base.model is None and base.modes is not None and model is None:
        refuse("the case has no source model", "a case with a model, or model = its name")
    sampling = {"sample_rate": sample_rate, "duration": duration, "substeps": substeps}
    keywords = {name: value for name, value in sampling.items() if value is not None}
    base = replace(
        impact_only(base),
        sampling=replace(base.sampling, **keywords),  # type: ignore[arg-type]
        levels=replace(base.levels, bands=bands or base.levels.bands),
        limits=Limits(source) if source is not None else base.limits,
    )
    if base.model is None or (model is not None and model != base.model.name):
        base = replace(base, model=new_model(model, {}))
    content = case_text(base)
    if not hasattr(parameters, "keys"):
        refuse_value("parameters", parameters, "arrays by their keys")
    # Without parameters, there is only the drop of the case.
    varied = dict(parameters) or {"height": base.drop.height}
    try:
        columns, numbers = _columns(varied, base)
    except MemoryError as error:
        refuse("the parameters do not fit in memory", "fewer samples", error)
    for name in {*keywords, *(["source"] if source else [])} & columns.keys():
        refuse(f"{name!r} is stated twice", "once, as a parameter or as a keyword")
    n_thread = min(len(os.sched_getaffinity(0)), MAX_THREADS) if threads is None else threads
    require_whole("threads", n_thread, 1, MAX_THREADS)
    length = math.ceil(base.sampling.duration * base.sampling.sample_rate) if forces else 0
    max_count = min(_MAX_SAMPLES, _MAX_VALUES // max(1, len(FORCES) * length))
    block_size = min(_FIRST_BLOCK * n_thread, max(1, max_count))
    blocks: list[dict[str, NDArray[Any]]] = []
    try:
        # Raises MemoryError before the computation if the results do not fit.
        np.empty((len(numbers), len(FORCES), length))
        with tqdm(total=len(numbers), unit="sample", disable=not progress, leave=False) as bar:
            start = 0
            while start < len(numbers) or not blocks:
                block = numbers[start : start + block_size]
                began = time.perf_counter()
                blocks.append(
                    _compute(content, columns, block, n_thread, levels=levels, forces=forces)
                )
                start += len(block)
                rate = len(block) / (time.perf_counter() - began)
                block_size = int(np.clip(_CALL_TIME * rate, 1, max(1, max_count)))
                bar.update(len(block))
        results, *more = blocks
        if more:
            results = {name: np.concatenate([block[name] for block in blocks]) for name in results}
    except MemoryError as error:
        size = f"{len(numbers)} samples with forces of {length} values"
        refuse(f"forces = {forces}: {size} do not fit in memory", "fewer samples", error)
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
    keys: Iterable[str],
    numbers: NDArray[np.float64],
    threads: int,
    *,
    levels: bool,
    forces: bool,
) -> dict[str, NDArray[Any]]:
    """Return the results of a block of samples; the first axis is the sample."""
    names = list(keys)
    answer = ask(
        "samples", case=content, keys=",".join(names).encode("ascii", "replace"),
        key_count=len(names), values=numbers.T, threads=threads, levels=levels, forces=forces,
    )  # fmt: skip
    reasons = answer.pop("reasons").split("\n")[:-1]
    results = {
        name: values.T != 0 if name in _FLAGS else values.T for name, values in answer.items()
    }
    results["status"] = results["status"].astype(np.int32)
    results["reason"] = np.full(len(numbers), "", dtype=object)
    results["reason"][results["status"] != 0] = reasons
    return results


def _columns(
    parameters: Mapping[str, ArrayLike], case: Case
) -> tuple[dict[str, NDArray[Any]], NDArray[np.float64]]:
    """Return arrays of one length by key, and their numbers for the library, [n_sample, n_key]."""
    assert case.model is not None  # noqa: S101 - `solve_many` has set it
    keys = [find_key(name, key_owners(case))[0] for name in parameters]
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
    return require_real(key.name, array, "b" if key.kind == "flag" else "iuf")
