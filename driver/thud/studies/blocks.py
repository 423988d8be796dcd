"""Blocks of samples: computed, kept in files while a study runs, then joined."""

from __future__ import annotations

import json
import os
import re
import shutil
from contextlib import contextmanager
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from tqdm import tqdm

from thud.base.bridge import version
from thud.base.checks import refuse
from thud.base.files import (
    is_failure,
    is_regular,
    read_input,
    replace_file,
    uninterrupted,
    unique_path,
)
from thud.studies.backends import run_blocks
from thud.studies.dataset import disk_space, grid_of, in_order, new_dataset
from thud.studies.samples import Block

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from thud.studies.kind import RunOptions
    from thud.studies.samples import Columns, SampleStudy

# Results that need more bytes than this are written as Zarr.
MAX_NETCDF_SIZE = 24 * 2**20
# Name of the file with the identity of the blocks.
IDENTITY = "study"
# Names of all files: complete ones, and those that a killed process was writing.
_FILES = re.compile(rf"{IDENTITY}|block_\d+\.nc|\..*\.new")
# Separates a NetCDF file from its checksum; HDF5 ignores both.
_SEAL = b"thud sha256 "


class Blocks:
    """The finished blocks of a study in its directory, `size` samples each."""

    def __init__(self, folder: Path, study: SampleStudy, size: int) -> None:
        self._study = study
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

    def finish(self) -> None:
        """Join all blocks, then remove them."""
        if not self.complete:
            paths = block_paths(self._partial)
            if self.path.suffix == ".nc":
                _write(grid_of(self._study, _join(paths)), self.path)
            else:
                self._write_zarr(paths)
        shutil.rmtree(self._partial, ignore_errors=True)

    def _write_zarr(self, paths: list[Path]) -> None:
        """Write a Zarr group in parts, so that the results need not fit in memory."""
        part = unique_path(self.path)
        write = self._write_grid if self._study.design == "grid" else _write_samples
        try:
            with _named(self.path):
                write(paths, part)
                part.rename(self.path)
        finally:
            shutil.rmtree(part, ignore_errors=True)

    def _write_grid(self, paths: list[Path], part: Path) -> None:
        """Write some variables at a time: only these have to fit in memory."""
        with _open(paths[0]) as first:
            sizes = {str(name): values.nbytes for name, values in first.data_vars.items()}
        names = list(sizes)
        group_size = max(1, MAX_NETCDF_SIZE // (max(sizes.values()) * len(paths)))
        for i in range(0, len(names), group_size):
            result = _join(paths, names[i : i + group_size], known_intact=i > 0)
            grid = grid_of(self._study, result)
            grid.to_zarr(part, mode="a" if i else "w", consolidated=False)


def _write_samples(paths: list[Path], part: Path) -> None:
    """Write one block after the other: only one has to fit in memory."""
    for i, path in enumerate(paths):
        with _open(path) as dataset:
            # All blocks but the last are of one size, that of the chunks.
            dimension = "sample" if i else None
            _loaded(dataset).to_zarr(part, consolidated=False, append_dim=dimension)


def result_names(study: SampleStudy) -> list[str]:
    """Return the possible file names of a study's results; the first is of complete results."""
    large = disk_space(study) > MAX_NETCDF_SIZE
    endings = ["nc", "zarr", "partial"]
    if study.format == "zarr" or (large and study.format == "auto"):
        endings = ["zarr", "nc", "partial"]
    return [f"{study.name}.{ending}" for ending in endings]


def block_paths(partial: Path) -> list[Path]:
    """Return the files of finished blocks in order."""
    return sorted(partial.glob("block_*.nc"))


def read_identity(path: Path) -> dict[str, str] | None:
    """Return the identity of results; None if they have no finished block."""
    if path.suffix == ".partial":
        for file in path.iterdir():
            if not is_regular(file) or not _FILES.fullmatch(file.name):
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
    if path.suffix == ".zarr":
        with _readable(path):
            return _open_zarr(path)
    with _open(path) as dataset:
        return _loaded(dataset)


def _join(
    paths: list[Path], names: list[str] | None = None, *, known_intact: bool = False
) -> xr.Dataset:
    """Return blocks as one dataset, or some of its variables with all coordinates.

    The checksums of blocks that are known to be intact are not verified.
    """
    parts = []
    for path in paths:
        with _open(path, known_intact=known_intact) as dataset:
            parts.append(_loaded(dataset if names is None else dataset[names]))
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
def _open(path: Path, *, known_intact: bool = False) -> Iterator[xr.Dataset]:
    with _readable(path):
        with uninterrupted():
            if path.suffix == ".zarr":
                # Opening a pipe could block.
                if any(not (entry.is_dir() or is_regular(entry)) for entry in path.rglob("*")):
                    message = "contains an entry that is neither a file nor a directory"
                    raise ValueError(message)
                dataset = _open_zarr(path)
            else:
                if not known_intact:
                    _require_intact(path)
                # No lock is needed, because complete files are renamed to this name; some file
                # systems have no locks.
                dataset = xr.open_dataset(
                    path, engine="h5netcdf", driver_kwds={"locking": False}, phony_dims="access"
                )
        with dataset:
            yield dataset


def _open_zarr(path: Path) -> xr.Dataset:
    """Open a Zarr group; its arrays are read on demand, with or without Dask."""
    dataset = in_order(xr.open_zarr(path, consolidated=False, chunks=None))
    dataset.encoding["source"] = f"{path}"
    return dataset


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
    with uninterrupted():
        content = dataset.to_netcdf(engine="h5netcdf")
        replace_file(path, b"".join((content, _SEAL, sha256(content).digest())))


def _require_intact(path: Path) -> None:
    """Raise ValueError for a damaged NetCDF file: HDF5 may hang on one."""
    content, _, digest = read_input(path).rpartition(_SEAL)
    if sha256(content).digest() != digest:
        message = "wrong checksum"
        raise ValueError(message)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Add the path to errors of the disk that name no file."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(error.filename or path)) from error


def compute_samples(study: SampleStudy, folder: Path | None, options: RunOptions) -> xr.Dataset:
    """Compute or continue a study; without a folder its results are not written.

    Raises InputError if they do not fit in memory, NumericalError if the backend loses samples.
    Samples that fail have a status and a reason.
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
        hidden = not options.get("progress", False)
        with tqdm(total=study.count, initial=done, unit="sample", disable=hidden) as bar:
            backend = options.get("backend"), options.get("workers"), options.get("scheduler")
            run_blocks(_blocks(study, open_starts, size), keep, *backend)
    if blocks:
        blocks.finish()
        return read_dataset(blocks.path)
    parts = [memory[start] for start in sorted(memory)]
    results = {name: np.concatenate([block[name] for block in parts]) for name in parts[0]}
    return grid_of(study, new_dataset(study, study.parameter_columns(0, study.count), results))


def _blocks(study: SampleStudy, starts: list[int], size: int) -> Iterator[Block]:
    for start in starts:
        columns = study.key_columns(study.parameter_columns(start, min(start + size, study.count)))
        yield Block(
            start, study.case, columns, version(), study.surrogate, counts_peaks=study.counts_peaks
        )
