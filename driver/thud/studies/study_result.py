"""Results of studies of samples."""

from __future__ import annotations

from abc import abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from thud.base.display import Displayed
from thud.base.tables import format_rows
from thud.impact.datasets import FREQUENCIES, NO_ERRORS, sample_warnings

if TYPE_CHECKING:
    import os

    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure

    from thud.base.note import Note
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
    # End of the name of a file with `to_dataframe`; empty: only the samples are written.
    table_ending: ClassVar[str] = ""

    dataset: xr.Dataset

    @abstractmethod
    def __init__(self, dataset: xr.Dataset) -> None:
        """Make the result from all samples."""

    @classmethod
    def check(cls, study: Study) -> None:
        """Raise InputError for a study whose samples cannot have such a result."""

    @property
    def warnings(self) -> tuple[Note, ...]:
        """Samples without results and the most frequent reason, and sources without conformity."""
        data = self.dataset
        names = ("status", "reason", "conforms")
        status, reason, conforms = (data[name].to_numpy() for name in names)
        return sample_warnings(status, reason, conforms if "room_rating" in data else None)

    @property
    def notes(self) -> tuple[str, ...]:
        """Accuracy of the surrogate with its undecided verdicts."""
        if "surrogate" not in self.dataset.attrs:
            return ()
        undecided = self.dataset["undecided"]
        share = f"{int(undecided.sum())} of {undecided.size} verdicts undecided"
        return (f"{self.dataset.attrs['surrogate']}; it leaves {share}",)

    def table(self) -> str:
        """Return the result as text; it says that the samples of a model state no errors."""
        table = format_rows(self.rows())
        return table if "surrogate" in self.dataset.attrs else f"{table}\n{NO_ERRORS}"

    @abstractmethod
    def plot(self) -> Figure:
        """Return the figure of the result."""

    def to_xarray(self) -> xr.Dataset:
        """Return every sample, with units and provenance."""
        return self.dataset.copy()

    def to_dataframe(self) -> pd.DataFrame:
        """Return a row for each sample; levels have a column for each band, Hz."""
        columns: dict[str, xr.DataArray] = {}
        for name, variable in self.dataset.data_vars.items():
            bands = next((bands for bands in FREQUENCIES if bands in variable.dims), None)
            for band in self.dataset[bands].to_numpy() if bands else ():
                columns[f"{name}_{band:g}"] = variable.sel({bands: band}, drop=True)
            if not bands:
                columns[str(name)] = variable
        return (
            self.dataset[[]].drop_vars(FREQUENCIES, errors="ignore").assign(columns).to_dataframe()
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write every sample as NetCDF, which `thud.read_sweep` reads."""
        from thud.studies.dataset import write_dataset

        write_dataset(self.dataset, Path(path))
