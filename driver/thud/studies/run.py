"""Sweeps: study, design, blocks, backend, dataset."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from typing import TYPE_CHECKING, TypedDict

import numpy as np
from tqdm import tqdm

import thud
from thud.errors import InputError
from thud.studies import sets
from thud.studies.backends import checked_backend, run_blocks
from thud.studies.dataset import disk_space, grid_of, new_dataset
from thud.studies.evaluation import Block, block_size
from thud.studies.store import Store, read_sweep
from thud.studies.study import Study, read_study

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator

    import xarray as xr

    from thud.studies.sets import Columns
    from thud.studies.study import Source

# More sets than this have to be confirmed.
MAX_SETS = 100_000


class How(TypedDict, total=False):
    """How the sets of a study are computed: the keywords of `sweep`."""

    backend: str | None
    workers: int | None
    scheduler: str | None
    yes: bool
    progress: bool


def sweep(  # noqa: PLR0913 - a study has a place, a backend and a face
    study: Source,
    output: str | os.PathLike[str] | None = None,
    *,
    backend: str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    yes: bool = False,
    progress: bool = False,
) -> xr.Dataset:
    """Compute every set of a study.

    Parameters
    ----------
    study
        Path of a TOML file, or what would stand in it; see docs/studies.md.
    output
        Directory of the results; an interrupted study goes on where it stopped. None: they are
        not written.
    backend
        ``"threads"`` (the default), ``"processes"`` or ``"dask"``: all give the same results.
    workers
        Number of threads or processes; by default one per processor.
    scheduler
        Address of a Dask scheduler.
    yes
        Start however many sets there are.
    progress
        Show a progress bar.

    Returns
    -------
    Dataset
        A grid has one dimension per parameter, other designs the dimension ``set``.

    Raises
    ------
    InputError
        Names what cannot be used and what is allowed.
    NumericalError
        Where the backend loses sets; single sets that fail have a status and a reason instead.
    OSError
        Where the results cannot be written.

    Examples
    --------
    >>> found = sweep({"parameters": {"height": {"values": [50, 100], "unit": "cm"}}})
    >>> found["contact_time"].round(4).values.tolist()
    [0.0211, 0.0204]
    """
    # A study of another kind is a sweep too.
    plan = study if isinstance(study, Study) else read_study(study)
    total = sets.count(plan)
    if total > MAX_SETS and not yes:
        message = f"{describe(plan)}; allowed: up to {MAX_SETS} sets, more with yes=True (--yes)"
        raise InputError(message)
    checked_backend(backend, workers, scheduler)
    size = block_size(plan.base)
    store = Store(output, plan, size) if output is not None else None
    memory: dict[int, Columns] = {}

    def keep(block: Block, found: Columns) -> None:
        if store:
            store.keep(block, found)
        else:
            memory[block.start] = found
        bar.update(len(found["status"]))

    with store or nullcontext():
        if not (store and store.complete):
            starts = [start for start in range(0, total, size) if not (store and store.has(start))]
            left = sum(min(size, total - start) for start in starts)
            with tqdm(
                total=total, initial=total - left, unit="set", disable=not progress, file=sys.stderr
            ) as bar:
                run_blocks(_blocks(plan, starts, size), keep, backend, workers, scheduler)
        if store:
            store.finish()
            return read_sweep(store.path)
    whole = {
        name: np.concatenate([memory[start][name] for start in sorted(memory)])
        for name in memory[0]
    }
    return grid_of(plan, new_dataset(plan, sets.parameter_columns(plan, 0, total), whole))


def describe(study: Study) -> str:
    """Return how many sets a study has and how much disk it needs."""
    space = disk_space(study) / 1e6
    amount = f"{space / 1e3:.3g} GB" if space > 1e3 else f"{space:.2g} MB"  # noqa: PLR2004
    return f"{study.name}: {sets.count(study)} sets of {study.model}, about {amount} on disk"


def _blocks(study: Study, starts: list[int], size: int) -> Iterator[Block]:
    """Yield the blocks that begin with some sets."""
    total = sets.count(study)
    for start in starts:
        columns = sets.parameter_columns(study, start, min(start + size, total))
        yield Block(start, study.base, sets.key_columns(study, columns), thud.__version__)
