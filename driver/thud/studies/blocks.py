"""Blocks of samples: computed, kept in files while a study runs, then joined."""

from __future__ import annotations

import json
import os
import re
import shutil
from contextlib import contextmanager
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from tqdm import tqdm

from thud.base.bridge import version
from thud.base.checks import refuse
from thud.base.errors import InputError
from thud.base.files import is_failure, read_input, replace_file
from thud.studies.backends import run_blocks
from thud.studies.dataset import disk_space, grid_of, new_dataset
from thud.studies.samples import Block

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from thud.studies.kind import RunOptions
    from thud.studies.samples import Columns, SampleStudy

# Name of the file with the identity of the blocks.
IDENTITY = "study"
# Names of all files: complete ones, and those that a killed process was writing.
_FILES = re.compile(rf"{IDENTITY}|block_\d+\.nc|\..*\.new")


class Blocks:
    """The finished blocks of a study in its directory, `size` samples each."""

    def __init__(self, folder: Path, study: SampleStudy, size: int) -> None:
        self._study = study
        self._size = size
        self.path = folder / result_names(study)[0]
        self._partial = self.path.with_suffix(".partial")
        self._identity = {**study.identity, "samples in a block": f"{size}"}

    def open(self) -> None:
        """Begin or continue the study. Raises InputError if the disk is too small."""
        with _named(self.path):
            self._require_space()
            self._partial.mkdir(exist_ok=True)
            if block_paths(self._partial):
                before = json.loads(read_input(self._partial / IDENTITY))
                if before != self._identity:
                    # Blocks of another size would overlap or leave gaps.
                    shutil.rmtree(self._partial)
                    self._partial.mkdir()
            replace_file(self._partial / IDENTITY, json.dumps(self._identity).encode())

    @property
    def complete(self) -> bool:
        """Whether the study is complete."""
        return self.path.exists()

    def _require_space(self) -> None:
        free = shutil.disk_usage(self.path.parent).free
        needed = disk_space(self._study) - sum(
            path.stat().st_size for path in block_paths(self._partial)
        )
        if needed > free:
            refuse(
                f"{self.path} needs about {needed / 1e6:.3g} MB and {free / 1e6:.3g} MB are free",
                "fewer samples, or another disk",
            )

    def _block(self, start: int) -> Path:
        return self._partial / f"block_{start:012d}.nc"

    def has(self, start: int) -> bool:
        """Return whether the block that begins with a sample is finished."""
        return self._block(start).exists()

    def keep(self, block: Block, result: Columns) -> None:
        """Write the results of a block atomically."""
        stop = block.start + len(result["status"])
        columns = self._study.parameter_columns(block.start, stop)
        _write(new_dataset(self._study, columns, result), self._block(block.start))

    def join(self) -> None:
        """Join all blocks."""
        paths = [self._block(start) for start in range(0, self._study.count, self._size)]
        _write(grid_of(self._study, _join(paths)), self.path)

    def remove(self) -> None:
        """Remove the blocks."""
        shutil.rmtree(self._partial, ignore_errors=True)


def result_names(study: SampleStudy) -> list[str]:
    """Return the names of the complete results of a study and of the directory of its blocks."""
    return [f"{study.name}.nc", f"{study.name}.partial"]


def block_paths(partial: Path) -> list[Path]:
    """Return the files of finished blocks in order."""
    return sorted(partial.glob("block_*.nc"))


def read_identity(path: Path) -> dict[str, str] | None:
    """Return the identity of results; None if they have no finished block."""
    if path.suffix == ".partial":
        for file in path.iterdir():
            if file.is_symlink() or not file.is_file() or not _FILES.fullmatch(file.name):
                refuse(f"{file} does not belong to a study", "finished blocks of a study")
        if not block_paths(path) and not (path / IDENTITY).exists():
            return None
        content = json.loads(read_input(path / IDENTITY))
        del content["samples in a block"]
        if not block_paths(path):
            return None
    else:
        with _open(path) as dataset:
            content = json.loads(dataset.attrs["identity"])
    identity: dict[str, str] = content
    return identity


def read_dataset(path: Path) -> xr.Dataset:
    """Return the results in a file; see `thud.read_sweep`."""
    if path.suffix == ".partial":
        paths = block_paths(path)
        if not paths:
            refuse(f"{path} holds no finished samples", "results of a study")
        return _join(paths)
    with _open(path) as dataset:
        return _loaded(dataset)


def _join(paths: list[Path]) -> xr.Dataset:
    """Return blocks as one dataset."""
    parts = []
    for path in paths:
        with _open(path) as dataset:
            parts.append(_loaded(dataset))
    return xr.concat(
        parts, "sample", data_vars="minimal", coords="minimal", compat="override",
        join="override", combine_attrs="override",
    )  # fmt: skip


def _loaded(dataset: xr.Dataset) -> xr.Dataset:
    """Load a dataset, with texts as objects of any length."""
    texts: dict[Any, Any] = {
        name: variable.astype(object)
        for name, variable in dataset.variables.items()
        if variable.dtype.kind == "U"
    }
    return dataset.load().assign(texts).drop_encoding()


@contextmanager
def _open(path: Path) -> Iterator[xr.Dataset]:
    with _readable(path):
        content = BytesIO(read_input(path))
        with xr.open_dataset(content, engine="h5netcdf", phony_dims="access") as dataset:
            yield dataset


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    try:
        yield
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        if is_failure(error):
            raise
        refuse(f"{path} cannot be read", "results of a study, or remove it", error)


def _write(dataset: xr.Dataset, path: Path) -> None:
    """Write a NetCDF file atomically."""
    replace_file(path, bytes(dataset.to_netcdf(engine="h5netcdf")))


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Add the path to errors of the disk that name no file."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(error.filename or path)) from error


def compute_samples(study: SampleStudy, folder: Path | None, options: RunOptions) -> xr.Dataset:
    """Compute or continue a study; without a folder its results are not written.

    Raises InputError if they do not fit in memory, NumericalError if the executor loses samples.
    Samples that fail have a status and a reason.
    """
    if not folder and disk_space(study) > os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"):
        refuse(
            f"{study.count} samples do not fit in memory", "fewer samples, or a directory for them"
        )
    if study.design not in {"grid", "list"}:
        # Raises InputError for a design that does not fit in memory.
        study.parameter_columns(0, 1)
    size = study.block_size
    blocks = Blocks(folder, study, size) if folder else None
    memory: dict[int, Columns] = {}

    def run(starts: list[int]) -> None:
        def keep(block: Block, result: Columns) -> None:
            if blocks:
                blocks.keep(block, result)
            else:
                memory[block.start] = result
            bar.update(len(result["status"]))

        done = study.count - sum(min(size, study.count - start) for start in starts)
        hidden = not options.get("progress", False)
        with tqdm(total=study.count, initial=done, unit="sample", disable=hidden) as bar:
            how = options.get("workers"), options.get("executor")
            run_blocks(_blocks(study, starts, size), keep, *how)

    starts = range(0, study.count, size)
    if blocks:
        try:
            if not blocks.complete:
                blocks.open()
                run([start for start in starts if not blocks.has(start)])
                blocks.join()
        except (OSError, InputError):
            # Another run of the study may have joined and removed its blocks meanwhile.
            if not blocks.complete:
                raise
        blocks.remove()
        return read_dataset(blocks.path)
    run(list(starts))
    parts = [memory[start] for start in sorted(memory)]
    results = {name: np.concatenate([block[name] for block in parts]) for name in parts[0]}
    return grid_of(study, new_dataset(study, study.parameter_columns(0, study.count), results))


def _blocks(study: SampleStudy, starts: list[int], size: int) -> Iterator[Block]:
    for start in starts:
        columns = study.key_columns(study.parameter_columns(start, min(start + size, study.count)))
        yield Block(
            start, study.case, columns, version(), study.surrogate, counts_peaks=study.counts_peaks
        )
