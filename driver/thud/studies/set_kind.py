"""Kinds of studies that compute sets of drops: design, blocks, backend, dataset."""

from __future__ import annotations

import sys
from abc import abstractmethod
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, Unpack

import numpy as np
from tqdm import tqdm

from thud._api import version
from thud._schema import KEYS
from thud.checks import refuse, require_choice
from thud.keys import OF_FILES
from thud.studies.backends import checked_backend, run_blocks
from thud.studies.blocks import Blocks, read_identity, read_sweep, result_names
from thud.studies.dataset import disk_space, grid_of, new_dataset
from thud.studies.designs import read_design
from thud.studies.directory import FORMATS
from thud.studies.evaluation import Block
from thud.studies.kind import Kind
from thud.studies.parameter import varied
from thud.studies.sets import SetStudy
from thud.studies.study import table_of
from thud.studies.temperature import read_temperature
from thud.tables import format_rows

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    import xarray as xr
    from matplotlib.figure import Figure

    from thud.case import Case
    from thud.keys import Value
    from thud.studies.kind import How
    from thud.studies.parameter import Parameter
    from thud.studies.sets import Columns
    from thud.studies.study import Study

R = TypeVar("R")

# More sets than this have to be confirmed.
MAX_SETS = 100_000
_FILE_FORMATS = ("auto", "netcdf", "zarr")


class SetKind(Kind[SetStudy, R]):
    """A kind of study that computes sets of drops."""

    words = ("format", "design", "temperature")
    # The designs that it takes, the default first.
    designs: ClassVar[tuple[str, ...]]

    def new_parameter(
        self, name: str, given: object, case: Case, centre: Value | None
    ) -> Parameter:
        """Return a parameter that varies."""
        if name == "bands":
            refuse("[parameters] bands is not allowed", "bands in [fixed], the same for all sets")
        return varied(name, given, case.model.name, centre)  # type: ignore[union-attr]

    def complete(self, study: Study, given: Mapping[str, Any], folder: Path) -> SetStudy:  # noqa: ARG002
        """Return a study with its design."""
        written = given.get("format", _FILE_FORMATS[0])
        require_choice("format", written, _FILE_FORMATS)
        law = table_of(given, "temperature") if "temperature" in given else None
        temperature = read_temperature(law, study.case, study.parameters)
        design = read_design(table_of(given, "design"), self.designs, study.parameters)
        # Sets need neither snapshots nor free modes nor a compression.
        case = replace(study.case, modes=None, compression=None)
        owned = (key for key in KEYS if key.owner == study.model)
        files = {key.name: 0.0 for key in owned if key.group == OF_FILES}
        if case.model and files:
            case = replace(case, model=replace(case.model, **files))  # type: ignore[arg-type]
        head = {**vars(study), "case": case}
        return SetStudy(**head, **design, temperature=temperature, format=written)

    def describe(self, study: SetStudy) -> str:
        """Return how many sets a study has and how much disk it needs."""
        space = disk_space(study) / 1e6
        amount = f"{space / 1e3:.3g} GB" if space > 1e3 else f"{space:.2g} MB"  # noqa: PLR2004
        return f"{study.name}: {study.count} sets of {study.model}, about {amount} on disk"

    def require(self, study: SetStudy, **how: Unpack[How]) -> None:
        """Raise InputError where there are too many sets, or no such backend."""
        if study.count > MAX_SETS and not how.get("yes"):
            refuse(self.describe(study), f"up to {MAX_SETS} sets, more with yes=True (--yes)")
        checked_backend(how.get("backend"), how.get("workers"), how.get("scheduler"))

    def compute(self, study: SetStudy, folder: Path | None, **how: Unpack[How]) -> R:
        """Return the result of all sets, computed or continued."""
        return self.conclude(study, compute_sets(study, folder, how))

    @abstractmethod
    def conclude(self, study: SetStudy, dataset: xr.Dataset) -> R:
        """Return the result of all sets."""

    @abstractmethod
    def draw(self, result: R) -> Figure:
        """Return the figure of a result."""

    def results(self, study: SetStudy) -> list[str]:
        """Return the names of the dataset and of the directory of blocks."""
        return result_names(study)

    def identity_in(self, path: Path) -> dict[str, str] | None:
        """Return the identity of results."""
        return read_identity(path)

    def other_files(self, study: SetStudy) -> list[str]:
        """Return the names of the figures."""
        return [f"{study.name}{ending}" for ending in FORMATS]

    def table(self, result: R, study: SetStudy) -> str:  # noqa: ARG002 - sets know their units
        """Return the result as text."""
        return format_rows(result.table())  # type: ignore[attr-defined]

    def remarks(self, result: R) -> list[str]:
        """Return how many sets have no results, and why."""
        dataset = _sets(result)
        failed = dataset["status"].values != 0
        if not failed.any():
            return []
        ((reason, _),) = Counter(dataset["reason"].values[failed]).most_common(1)
        return [f"{failed.sum()} of {failed.size} sets have no results, such as: {reason}"]

    def succeeded(self, result: R) -> bool:
        """Return whether any set has results."""
        return bool((_sets(result)["status"] == 0).any())

    def figures(self, result: R, study: SetStudy) -> dict[str, Figure]:
        """Return the figure by the name of the study."""
        return {study.name: self.draw(result)} if self.succeeded(result) else {}


def _sets(result: Any) -> xr.Dataset:  # noqa: ANN401 - a dataset, or what has one
    return getattr(result, "dataset", result)  # type: ignore[no-any-return]


def compute_sets(study: SetStudy, folder: Path | None, how: How) -> xr.Dataset:
    """Compute or continue a study; without a folder its results are not written.

    Raises NumericalError where the backend loses sets; sets that fail have a status and a reason.
    """
    size = study.block_size
    blocks = Blocks(folder, study, size) if folder else None
    memory: dict[int, Columns] = {}

    def keep(block: Block, found: Columns) -> None:
        if blocks:
            blocks.keep(block, found)
        else:
            memory[block.start] = found
        bar.update(len(found["status"]))

    if not (blocks and blocks.complete):
        if blocks:
            blocks.open()
        starts = range(0, study.count, size)
        open_starts = [start for start in starts if not (blocks and blocks.has(start))]
        done = study.count - sum(min(size, study.count - start) for start in open_starts)
        with tqdm(
            total=study.count,
            initial=done,
            unit="set",
            disable=not how.get("progress", False),
            file=sys.stderr,
        ) as bar:
            backend = how.get("backend"), how.get("workers"), how.get("scheduler")
            run_blocks(_blocks(study, open_starts, size), keep, *backend)
    if blocks:
        blocks.finish()
        return read_sweep(blocks.path)
    parts = [memory[start] for start in sorted(memory)]
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return grid_of(study, new_dataset(study, study.parameter_columns(0, study.count), whole))


def _blocks(study: SetStudy, starts: list[int], size: int) -> Iterator[Block]:
    for start in starts:
        columns = study.parameter_columns(start, min(start + size, study.count))
        yield Block(start, study.case, study.key_columns(columns), version())
