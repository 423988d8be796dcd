"""Sobol indices of the parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Unpack

import numpy as np
import xarray as xr

from thud.base.checks import refuse
from thud.level.levels import get_bands
from thud.studies.run import compute
from thud.studies.sampling import MIN_BASE_SAMPLES
from thud.studies.study_result import SampleResult

if TYPE_CHECKING:
    import os

    import pandas as pd

    from thud.studies.arrays import Array
    from thud.studies.run import RunOptions
    from thud.studies.study import Source

INDICES = {
    "first_order": "fraction of the variance due to this parameter alone",
    "first_order_interval": "half width of its confidence interval",
    "total": "fraction of the variance due to this parameter, interactions included",
    "total_interval": "half width of its confidence interval",
}
CONFIDENCE = 0.95
RESAMPLES = 200
# Variances below this are rounding errors, dB2.
_ROUNDING = 1e-24


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(SampleResult):
    """Sobol indices of a study.

    Attributes
    ----------
    dataset : Dataset
        Every sample of the study.
    indices : Dataset
        ``first_order`` and ``total`` index of each ``output`` and ``parameter``, and half widths
        of their 95 % confidence intervals; NaN for outputs that do not vary. With a surrogate
        also ``surrogate``, the variance of its errors divided by that of each output.
    left_out : int
        Number of base samples left out because one of their samples has no result.
    """

    drawn_by: ClassVar[str] = "study_figures.draw_sensitivity"

    kind: ClassVar[str] = "sensitivity"

    dataset: xr.Dataset
    indices: xr.Dataset = field(init=False)
    left_out: int = field(init=False)

    def __post_init__(self) -> None:
        """Compute the indices; raise InputError if too few base samples have results."""
        indices, left_out = _indices(self.dataset)
        object.__setattr__(self, "indices", indices)
        object.__setattr__(self, "left_out", left_out)

    def __repr__(self) -> str:
        """Return parameters and outputs."""
        names = ", ".join(map(str, self.indices["parameter"].to_numpy()))
        return f"<Sensitivity: {self.indices.sizes['output']} outputs to {names}>"

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: total indices of each output."""
        parameters = [str(name) for name in self.indices["parameter"].to_numpy()]
        rows = [("total index of", *parameters)]
        if "surrogate" in self.indices:
            rows = [(*rows[0], "error of the surrogate")]
        for output in self.indices["output"].to_numpy():
            row = self.indices.sel(output=output)
            pairs = zip(row["total"].to_numpy(), row["total_interval"].to_numpy(), strict=True)
            error = [f"{float(row['surrogate']):.3f}"] if "surrogate" in row else []
            rows.append((str(output), *(_index_text(*pair) for pair in pairs), *error))
        return rows

    def to_dataframe(self) -> pd.DataFrame:
        """Return all indices, with a row for each output and parameter."""
        return self.indices.to_dataframe(dim_order=["output", "parameter"])


def _index_text(index: float, half_width: float) -> str:
    """Return an index and the half width of its interval, rounded up to two decimals, as text.

    >>> _index_text(0.297, 0.072), _index_text(0.014, 0.003), _index_text(0.001, 0.0004)
    ('0.30 ± 0.08', '0.01 ± 0.01', '< 0.01')
    """
    if not math.isfinite(index + half_width):
        return "–"
    if abs(index) + half_width < 0.01:  # noqa: PLR2004
        return "< 0.01"
    return f"{index:z.2f} ± {math.ceil(100 * half_width) / 100:.2f}"


def sensitivity(
    study: Source, output: str | os.PathLike[str] | None = None, **options: Unpack[RunOptions]
) -> Sensitivity:
    """Compute Sobol indices of the octave levels, the contact time and the peak of the force.

    ``[design] size`` of the study is the number of base samples N, a power of 2 from 4; N (d + 2)
    samples are computed for d parameters. Arguments and errors are those of `sweep`; InputError is
    also raised if too few samples have results.
    """
    return compute(Sensitivity, study, output, **options)


def _indices(dataset: xr.Dataset) -> tuple[xr.Dataset, int]:
    """Return the Sobol indices of a dataset, and the number of base samples that are left out."""
    parameters = dataset.attrs["parameters"].split()
    dimension, seed = len(parameters), int(dataset.attrs["seed"])
    usable = (dataset["status"].to_numpy() == 0).reshape(-1, dimension + 2).all(axis=1)
    if usable.sum() < MIN_BASE_SAMPLES:
        reason = next(text for text in dataset["reason"].to_numpy() if text)
        refuse(
            f"only {usable.sum()} of {usable.size} base samples have results ({reason})",
            "ranges in which samples have results",
        )
    samples = dataset.isel(sample=np.repeat(usable, dimension + 2))
    force = dataset.attrs["assessed_force"]
    peak = "peak_elastic_force" if force == "elastic" else "peak_force"
    levels = f"{force}_octave"
    outputs = {
        f"level {band:g} Hz": samples[levels].to_numpy()[:, i]
        for i, band in enumerate(get_bands().nominal)
    }
    # The last two are quantities of drops on a floor.
    names = [n for n in ("contact_time", peak, "floor_work", "room_rating") if n in samples]
    outputs |= {name.replace("_", " "): samples[name].to_numpy() for name in names}
    result = [sobol_indices(values, dimension, seed) for values in outputs.values()]
    variables: dict[str, Any] = {
        name: (("output", "parameter"), np.stack(values), {"units": "1", "long_name": meaning})
        for (name, meaning), values in zip(INDICES.items(), zip(*result, strict=True), strict=True)
    }
    if "surrogate" in dataset.attrs:
        meaning = {
            "units": "1",
            "long_name": "variance of the surrogate's errors divided by that of the output",
        }
        errors = np.concatenate(
            [np.atleast_1d(dataset[name].attrs["surrogate_variance"]) for name in (levels, *names)]
        )
        # The errors of all quantities are in dB.
        spread = np.array(
            [
                np.var(v if name.startswith("level") else 20 * np.log10(v))
                for name, v in outputs.items()
            ]
        )
        # NaN for outputs that do not vary, like the indices.
        spread[spread <= _ROUNDING] = np.nan
        variables["surrogate"] = ("output", errors / spread, meaning)
    coordinates = {"output": list(outputs), "parameter": parameters}
    return xr.Dataset(variables, coordinates, dataset.attrs), int((~usable).sum())


def sobol_indices(values: Array, dimension: int, seed: int = 0) -> tuple[Array, ...]:
    """Return first-order and total Sobol indices of a quantity, with half widths of intervals.

    `values`, shape (n (dimension + 2),), belong to the points of a ``"saltelli"`` design; `seed` is
    for the resampling. Indices have shape (dimension,); NaN if the values do not vary.
    """
    from SALib.analyze import sobol

    # Rounding errors do not count as variance; quantities that a surrogate withholds are NaN.
    if not np.ptp(values) > 1e-12 * np.abs(values).max():
        return tuple(np.full((4, dimension), np.nan))
    cube = {"num_vars": dimension, "names": list(map(str, range(dimension)))}
    result = sobol.analyze(
        cube,
        values,
        calc_second_order=False,
        num_resamples=RESAMPLES,
        conf_level=CONFIDENCE,
        seed=seed + 1,  # SALib reads 0 as no seed
    )
    return tuple(np.asarray(result[name]) for name in ("S1", "S1_conf", "ST", "ST_conf"))
