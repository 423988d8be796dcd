"""Files of a study: finished blocks while it runs, one file or Zarr group at its end."""

from __future__ import annotations

import os
import shutil
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import xarray as xr

from thud.checks import lock, replace_file, require_own, uninterrupted
from thud.errors import InputError
from thud.studies import sets
from thud.studies.dataset import disk_space, grid_of, in_order, new_dataset

if TYPE_CHECKING:
    from collections.abc import Iterator

    from thud.studies.evaluation import Block
    from thud.studies.sets import Columns
    from thud.studies.study import Study

# Results that need more bytes than this are written as Zarr.
LARGE = 256 * 2**20


class Store:
    """The directory of a study: a context, in which no other process computes it.

    Parameters
    ----------
    folder
        The directory; it is made where there is none.
    study
        The study that it belongs to.
    size
        Sets in a block.

    Raises
    ------
    InputError
        Where what lies there belongs to another study.
    OSError
        Where nothing can be written there.
    """

    def __init__(self, folder: str | os.PathLike[str], study: Study, size: int) -> None:
        self._study = study
        self._size = size
        self._descriptor: int | None = None
        large = disk_space(study) > LARGE
        ending = "zarr" if study.format == "zarr" or (large and study.format == "auto") else "nc"
        self.path = Path(folder) / f"{study.name}.{ending}"
        self._partial = self.path.with_suffix(".partial")

    def __enter__(self) -> Self:
        """Take the directory, unless it belongs to another study or to another run of this one."""
        try:
            with _named(self.path):
                self.path.parent.mkdir(parents=True, exist_ok=True)
                if self.complete:
                    self._require_own(self.path)
                else:
                    self._require_space()
                    self._partial.mkdir(exist_ok=True)
                    # Nothing is looked at or changed while another run may be writing.
                    self._descriptor = lock(self._partial, self.path)
                    self._require_own(self._partial)
                    replace_file(self._mark, self._identity.encode())
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Let others in again."""
        if self._descriptor is not None:
            os.close(self._descriptor)
        self._descriptor = None

    @property
    def _mark(self) -> Path:
        """The file that says whose blocks these are."""
        return self._partial / "study"

    @property
    def _identity(self) -> str:
        """What stands in it."""
        return f"{self._study.fingerprint} {self._size}\n"

    @property
    def complete(self) -> bool:
        """The study is done."""
        return self.path.exists()

    def _require_own(self, path: Path) -> None:
        """Complain about results of another study."""
        if path == self._partial:
            # A directory without blocks, whatever a kill has left there, holds nothing to be lost.
            mine = not self._blocks() or (
                self._mark.exists() and self._mark.read_bytes() == self._identity.encode()
            )
        else:
            with _open(path) as dataset:
                mine = dataset.attrs.get("fingerprint") == self._study.fingerprint
        require_own(path, mine=mine)

    def _require_space(self) -> None:
        """Complain about a disk that is too small."""
        free = shutil.disk_usage(self.path.parent).free
        needed = disk_space(self._study) - sum(path.stat().st_size for path in self._blocks())
        if needed > free:
            message = (
                f"{self.path} needs about {needed / 1e6:.3g} MB and {free / 1e6:.3g} MB are "
                f"free; allowed: fewer sets, or another disk"
            )
            raise InputError(message)

    def _blocks(self) -> list[Path]:
        """Return the files of the blocks that are finished, in their order."""
        return sorted(self._partial.glob("block_*.nc"))

    def _block(self, start: int) -> Path:
        """Return the file of a block."""
        return self._partial / f"block_{start:012d}.nc"

    def has(self, start: int) -> bool:
        """Return whether the block that begins with a set is finished."""
        return self._block(start).exists()

    def keep(self, block: Block, found: Columns) -> None:
        """Write the results of a block, completely or not at all."""
        stop = block.start + len(found["status"])
        columns = sets.parameter_columns(self._study, block.start, stop)
        _write(new_dataset(self._study, columns, found), self._block(block.start))

    def finish(self) -> None:
        """Put all blocks together, then remove them."""
        if not self.complete:
            paths = self._blocks()
            if self.path.suffix == ".nc":
                _write(grid_of(self._study, _join(paths)), self.path)
            else:
                self._write_zarr(paths)
        shutil.rmtree(self._partial, ignore_errors=True)
        # What a kill has left of the end of an earlier run.
        for path in self.path.parent.iterdir():
            if path.name.startswith(f".{self.path.name}.") and path.suffix == ".part":
                path.unlink(missing_ok=True)

    def _write_zarr(self, paths: list[Path]) -> None:
        """Write a Zarr group, some variables at a time: only these have to fit into memory."""
        part = self.path.with_name(f".{self.path.name}.part")
        shutil.rmtree(part, ignore_errors=True)
        with _open(paths[0]) as first:
            sizes = {str(name): values.nbytes for name, values in first.data_vars.items()}
        names = list(sizes)
        together = max(1, 2 * LARGE // (max(sizes.values()) * len(paths)))
        try:
            with _named(self.path):
                for i in range(0, len(names), together):
                    grid = grid_of(self._study, _join(paths, names[i : i + together]))
                    grid.to_zarr(part, mode="a" if i else "w", consolidated=False)
                part.rename(self.path)
        finally:
            shutil.rmtree(part, ignore_errors=True)


def read_sweep(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read the results of a study, also of one that was interrupted.

    Parameters
    ----------
    path
        A file ``.nc``, a Zarr group ``.zarr``, or the directory ``.partial`` of a study that is not
        done: its finished sets.

    Returns
    -------
    Dataset
        The results; those of a Zarr group are read when they are needed.

    Raises
    ------
    InputError
        Where there are no results of a study.
    """
    place = Path(path)
    if place.suffix == ".partial":
        paths = sorted(place.glob("block_*.nc"))
        if not paths:
            message = f"{place} holds no finished sets; allowed: results of a study"
            raise InputError(message)
        return _join(paths)
    if place.suffix == ".zarr":
        with _readable(place):
            return _open_zarr(place)
    with _open(place) as dataset:
        return _loaded(dataset)


def _join(paths: list[Path], names: list[str] | None = None) -> xr.Dataset:
    """Return blocks as one dataset, or some variables of them with all coordinates."""
    parts = []
    for path in paths:
        with _open(path) as dataset:
            parts.append(_loaded(dataset if names is None else dataset[names]))
    return xr.concat(
        parts, "set", data_vars="minimal", coords="minimal", compat="override",
        join="override", combine_attrs="override",
    )  # fmt: skip


def _loaded(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset in memory, its texts of any length as they were before they were written."""
    texts: dict[Any, Any] = {
        name: variable.astype(object)
        for name, variable in dataset.variables.items()
        if variable.dtype.kind == "U"
    }
    return dataset.load().assign(texts)


@contextmanager
def _open(path: Path) -> Iterator[xr.Dataset]:
    """Open a file or Zarr group to be read."""
    with _readable(path):
        with uninterrupted():
            zarr = path.suffix == ".zarr"
            dataset = _open_zarr(path) if zarr else xr.open_dataset(path, engine="h5netcdf")
        with dataset:
            yield dataset


def _open_zarr(path: Path) -> xr.Dataset:
    """Open a Zarr group: its arrays are read when they are needed, whether Dask is there or not."""
    return in_order(xr.open_zarr(path, consolidated=False, chunks=None))


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Complain about what is not a dataset."""
    try:
        yield
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        message = f"{path} cannot be read; allowed: results of a study, or remove it"
        raise InputError(message) from error


def _write(dataset: xr.Dataset, path: Path) -> None:
    """Write a NetCDF file, completely or not at all."""
    with uninterrupted():
        replace_file(path, bytes(dataset.to_netcdf(engine="h5netcdf")))


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Give errors of the disk the path that was asked for."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(error.filename or path)) from error
