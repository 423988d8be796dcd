"""Sweeps: drops over a grid, a list or a random design of parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

import xarray as xr

from thud.base.tables import format_rows
from thud.level.levels import BANDWIDTHS
from thud.studies.sample_kind import SampleKind

if TYPE_CHECKING:
    import os

    from matplotlib.figure import Figure

    from thud.studies.kind import RunOptions
    from thud.studies.samples import SampleStudy
    from thud.studies.study import Source


class Sweep(SampleKind[xr.Dataset]):
    """Sweeps as a kind of study."""

    name = "sweep"
    designs = ("grid", "list", "random", "latin_hypercube", "sobol")

    def conclude(self, study: SampleStudy, dataset: xr.Dataset) -> xr.Dataset:  # noqa: ARG002
        """Return the results of all samples as they are."""
        return dataset

    def table(self, result: xr.Dataset, study: SampleStudy) -> str:  # noqa: ARG002
        """Return the range of each result as text."""
        rows: list[tuple[str, ...]] = [("", "minimum", "median", "maximum")]
        for name, variable in result.data_vars.items():
            if variable.dtype.kind == "f":
                bands = next((name for name in BANDWIDTHS if name in variable.dims), None)
                for band in result[bands].values if bands else [None]:
                    values = variable.sel({bands: band}) if bands else variable
                    place = "" if band is None else f" {band:g} Hz"
                    label = f"{name}{place}, {variable.attrs['units']}"
                    numbers = (values.min(), values.median(), values.max())
                    rows.append((label, *(f"{float(number):.4g}" for number in numbers)))
        rows.append(("conforming samples", "", "", f"{int(result['conforms'].sum())}"))
        return format_rows(rows)

    def draw(self, result: xr.Dataset) -> Figure:
        """Return levels against the first numeric parameter."""
        from thud.plot import draw_sweep

        return draw_sweep(result)


KIND = Sweep()


def sweep(
    study: Source, output: str | os.PathLike[str] | None = None, **how: Unpack[RunOptions]
) -> xr.Dataset:
    """Compute every sample of a study.

    Parameters
    ----------
    study
        Path of a TOML file, or what would stand in it; see docs/studies.md.
    output
        Directory of the results; an interrupted study is continued. None: they are not written.
    **how
        Keywords `backend`, `workers`, `scheduler`, `yes`, `progress`, `replace`; see
        `thud.studies.kind.How`.

    Returns
    -------
    Dataset
        A grid has one dimension per parameter, other designs the dimension ``sample``.

    Raises
    ------
    InputError
        Names what cannot be used and what is allowed.
    NumericalError
        Where the backend loses samples; samples that fail have a status and a reason instead.
    OSError
        Where the results cannot be written.

    Examples
    --------
    >>> found = sweep({"parameters": {"height": {"values": [50, 100], "unit": "cm"}}})
    >>> found["contact_time"].round(4).values.tolist()
    [0.0211, 0.0204]
    """
    return KIND.run(study, output, **how)
