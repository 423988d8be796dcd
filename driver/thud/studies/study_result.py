"""Results of studies."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

from thud.base.display import Displayed
from thud.base.tables import format_rows
from thud.impact.datasets import NO_ERRORS, sample_warnings

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from thud.base.note import Note


class StudyResult(Displayed):
    """Result of a study: `rows` and `table`, `plot`, `warnings` and `notes`.

    Attributes
    ----------
    warnings : tuple of Note or str
        Reasons why numbers may be wrong or missing.
    """

    warnings: tuple[Note | str, ...]

    @property
    def notes(self) -> tuple[Note | str, ...]:
        """Notes on what was done."""
        return ()

    @property
    def succeeded(self) -> bool:
        """Whether there is any result."""
        return True

    def table(self) -> str:
        """Return the result as text."""
        return format_rows(self.rows())

    @abstractmethod
    def plot(self) -> Figure:
        """Return the figure of the result."""

    def figures(self, name: str) -> dict[str, Figure]:
        """Return all figures by the names of their files; `name` is the name of the study."""
        return {name: self.plot()} if self.succeeded else {}


class SampleResult(StudyResult):
    """Result of a study of samples.

    Attributes
    ----------
    dataset : Dataset
        Every sample of the study.
    """

    dataset: xr.Dataset

    @property
    def warnings(self) -> tuple[Note, ...]:  # type: ignore[override]
        """Samples without results and the most frequent reason, and sources without conformity."""
        data = self.dataset
        conforms = data["conforms"].values if "room_rating" in data else None
        return sample_warnings(data["status"].values, data["reason"].values, conforms)

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
        if "surrogate" in self.dataset.attrs:
            return super().table()
        return f"{super().table()}\n{NO_ERRORS}"

    @property
    def succeeded(self) -> bool:
        """Whether any sample has results."""
        return bool((self.dataset["status"] == 0).any())

    def to_xarray(self) -> xr.Dataset:
        """Return every sample, with units and provenance."""
        return self.dataset.copy()
