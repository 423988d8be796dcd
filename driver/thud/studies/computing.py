"""Samples of a study, computed in blocks by a backend, kept or continued in a directory."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

import numpy as np
from tqdm import tqdm

from thud.base.bridge import version
from thud.base.checks import refuse
from thud.studies.backends import run_blocks
from thud.studies.blocks import Blocks, read_dataset
from thud.studies.dataset import disk_space, grid_of, new_dataset
from thud.studies.samples import Block

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import xarray as xr

    from thud.studies.kind import RunOptions
    from thud.studies.samples import Columns, SampleStudy


def compute_samples(study: SampleStudy, folder: Path | None, how: RunOptions) -> xr.Dataset:
    """Compute or continue a study; without a folder its results are not written.

    Raises InputError where they cannot fit in memory, and NumericalError where the backend loses
    samples; samples that fail have a status and a reason.
    """
    if not folder and disk_space(study) > os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"):
        refuse(
            f"{study.count} samples do not fit in memory", "fewer samples, or a directory for them"
        )
    size = study.block_size
    blocks = Blocks(folder, study, size) if folder else None
    memory: dict[int, Columns] = {}

    def keep(block: Block, result: Columns) -> None:
        if blocks:
            blocks.keep(block, result)
        else:
            memory[block.start] = result
        bar.update(len(result["status"]))

    if not (blocks and blocks.complete):
        if blocks:
            blocks.open()
        starts = range(0, study.count, size)
        open_starts = [start for start in starts if not (blocks and blocks.has(start))]
        done = study.count - sum(min(size, study.count - start) for start in open_starts)
        with tqdm(
            total=study.count,
            initial=done,
            unit="sample",
            disable=not how.get("progress", False),
            file=sys.stderr,
        ) as bar:
            backend = how.get("backend"), how.get("workers"), how.get("scheduler")
            run_blocks(_blocks(study, open_starts, size), keep, *backend)
    if blocks:
        blocks.finish()
        return read_dataset(blocks.path)
    parts = [memory[start] for start in sorted(memory)]
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return grid_of(study, new_dataset(study, study.parameter_columns(0, study.count), whole))


def _blocks(study: SampleStudy, starts: list[int], size: int) -> Iterator[Block]:
    for start in starts:
        columns = study.parameter_columns(start, min(start + size, study.count))
        yield Block(
            start,
            study.case,
            study.key_columns(columns),
            version(),
            study.surrogate,
            counts_peaks=study.counts_peaks,
        )
