"""Results of studies of samples."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

from thud.base.display import Displayed
from thud.base.files import require_ending
from thud.base.note import Note
from thud.base.tables import format_rows
from thud.impact.datasets import NO_ERRORS, sample_table, sample_warnings

if TYPE_CHECKING:
    import os

    import pandas as pd
    import xarray as xr

    from thud.studies.study import Study


class SampleResult(Displayed):
    """Result of a study of samples, a function of their dataset.

    Attributes
    ----------
    dataset : Dataset
        Every sample of the study, as returned by `thud.studies.run.run`.
    """

    # Kind of study, see `thud.studies.kinds.KINDS`.
    kind: ClassVar[str]

    dataset: xr.Dataset

    @abstractmethod
    def __init__(self, dataset: xr.Dataset) -> None:
        """Make the result from all samples."""

    @classmethod
    def check(cls, study: Study) -> None:
        """Raise InputError for a study whose samples cannot have such a result."""

    @property
    def notes(self) -> tuple[Note, ...]:
        """Samples without results or sources without conformity, and accuracy of the surrogate."""
        data = self.dataset
        names = ("status", "reason", "conforms")
        status, reason, conforms = (data[name].to_numpy() for name in names)
        notes = sample_warnings(status, reason, conforms if "room_rating" in data else None)
        if "surrogate" not in data.attrs:
            return notes
        undecided, others = data["undecided"], {"accuracy": data.attrs["surrogate"]}
        count = float(undecided.sum())
        return (*notes, Note("undecided", value=count, high=undecided.size, others=others))

    def table(self) -> str:
        """Return the result as text; it says that the samples of a model state no errors."""
        table = format_rows(self.rows())
        return table if "surrogate" in self.dataset.attrs else f"{table}\n{NO_ERRORS}"

    def to_xarray(self) -> xr.Dataset:
        """Return every sample, with units and provenance."""
        return self.dataset.copy()

    def to_dataframe(self) -> pd.DataFrame:
        """Return a row for each sample; levels have a column for each band, Hz."""
        return sample_table(self.dataset)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write every sample as NetCDF, which `thud.read_sweep` reads.

        Raise InputError if the path does not end with ``.nc``.
        """
        from thud.studies.dataset import write_dataset

        write_dataset(self.dataset, require_ending(path, ".nc"))
