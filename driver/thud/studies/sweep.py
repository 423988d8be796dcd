"""Sweeps: drops over a grid, a list or a random design of parameters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Unpack

from thud.impact.datasets import FREQUENCIES, RESULTS
from thud.studies.dataset import read_dataset
from thud.studies.run import compute
from thud.studies.study_result import SampleResult

if TYPE_CHECKING:
    import os

    import xarray as xr

    from thud.studies.run import RunOptions
    from thud.studies.study import Source


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(SampleResult):
    """Results of all samples.

    Attributes
    ----------
    dataset : Dataset
        A grid has one dimension per parameter, other designs the dimension ``sample``.
    """

    drawn_by: ClassVar[str] = "sweep_figures.draw_sweep"

    kind: ClassVar[str] = "sweep"

    dataset: xr.Dataset

    def __repr__(self) -> str:
        """Return the dimensions and how many samples conform."""
        conforms = self.dataset["conforms"]
        shape = " x ".join(f"{name} {size}" for name, size in conforms.sizes.items())
        return f"<Sweep, {shape}: {int(conforms.sum())} of {conforms.size} samples conform>"

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: the range of each result."""
        rows: list[tuple[str, ...]] = [("", "minimum", "median", "maximum")]
        for name, variable in self.dataset.data_vars.items():
            if variable.dtype.kind == "f":
                quantity = RESULTS[str(name)]
                bands = next((name for name in FREQUENCIES if name in variable.dims), None)
                for band in self.dataset[bands].values if bands else [None]:
                    values = variable.sel({bands: band}) if bands else variable
                    at = "" if band is None else f" {band:g} Hz"
                    label = f"{quantity.title}{at}, {quantity.display_unit}".removesuffix(", ")
                    numbers = (values.min(), values.median(), values.max())
                    rows.append((label, *(quantity.show(float(number)) for number in numbers)))
        rows.append(("conforming samples", "", "", f"{int(self.dataset['conforms'].sum())}"))
        return rows


def sweep(
    study: Source, output: str | os.PathLike[str] | None = None, **options: Unpack[RunOptions]
) -> Sweep:
    """Compute every sample of a study.

    Parameters
    ----------
    study
        Path of a TOML file, or its content as a mapping, see docs/studies.md; or values by names of
        keys, as for `thud.solve_many`, of which every combination is a sample.
    output
        Directory of the results; an interrupted study is continued. None: they are not written.
    **options
        Keywords `case`, `surrogate`, `workers`, `executor`, `progress`, `replace`;
        see `thud.studies.run.RunOptions`.

    Returns
    -------
    Sweep
        The results of all samples.

    Raises
    ------
    InputError
        If the study or an option cannot be used.
    NumericalError
        If the executor loses samples; samples that fail have a status and a reason instead.
    OSError
        If the results cannot be written.

    Examples
    --------
    >>> result = sweep({"height": [0.5, 1.0]})
    >>> result.dataset["contact_time"].round(4).values.tolist()
    [0.0207, 0.0196]
    """
    return compute(Sweep, study, output, **options)


def read_sweep(path: str | os.PathLike[str]) -> Sweep:
    """Read the results of a study, also of one that was interrupted.

    Parameters
    ----------
    path
        A file ``.nc``, or the directory ``.partial`` with the finished samples of an
        incomplete study.

    Returns
    -------
    Sweep
        The results; ``thud.Sensitivity(result.dataset)`` is that of a sensitivity study.

    Raises
    ------
    InputError
        If there are no results of a study.
    OSError
        If they temporarily cannot be read.
    """
    return Sweep(read_dataset(Path(path)))
