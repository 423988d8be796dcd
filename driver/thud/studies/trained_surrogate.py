"""Surrogates: interpolation of the results of a model, with its errors."""

from __future__ import annotations

import io
import json
import math
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.distance import cdist
from threadpoolctl import threadpool_limits

from thud.base._schema import LIMITS
from thud.base.bridge import version
from thud.base.checks import refuse, require_kind
from thud.base.display import Displayed
from thud.base.extras import data_frame
from thud.base.files import is_failure, read_input, replace_file
from thud.case.case import Case, case_text, impact_only
from thud.case.keys import OUTPUT_GROUP, value_in, with_values
from thud.impact.datasets import FREQUENCIES, LEVELS, RESULTS

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable

    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import LimitsSource
    from thud.studies.arrays import Array, Columns


# Fraction of held-out drops within the stated error, and the confidence of that statement.
COVERAGE = 0.95
# Samples that are predicted together: their kernel stays in the cache.
_CHUNK_SIZE = 250
# Array this fraction of the width outside the region are rounding errors.
_ROUNDING = 1e-9
# Smoothness of the Matern kernel: functions that are twice differentiable (see `matern`).
SMOOTHNESS = 2.5
_ARRAYS = "region", "points", "drops", "length", "weights", "residuals"


@dataclass(frozen=True, eq=False)
class Surrogate(Displayed):
    """Prediction of drops of a model from training drops in the same region.

    A Gaussian process interpolates all quantities, in dB: levels, and 20 lg of other quantities.
    Each quantity has a stated error: with a confidence of 95 %, the errors of 95 % of other drops
    are smaller (order statistic of the leave-one-out residuals).

    Attributes
    ----------
    case : Case
        The case of the drops.
    keys : tuple of str
        Keys in which the drops differ.
    region : ndarray, shape (n_key, 2)
        Minimum and maximum of each key.
    outputs : dict of str to int
        Quantities, and the number of values of each: levels have one per band.
    bound : float
        Maximum error of a predicted quantity, dB; quantities with larger errors are NaN.
    peaks : int
        Number of peaks of the assessed force, the same in all drops.
    seed : int
        Seed of the drops.
    version : str
        Version of thud that computed the drops.
    points : ndarray, shape (n_drop, n_key)
        The drops, in the unit cube.
    drops : ndarray, shape (n_drop, n_number)
        Results of the drops, dB.
    length : ndarray, shape (n_key,)
        Correlation lengths in the unit cube.
    weights : ndarray, shape (n_drop, n_number)
        Weights of the kernels of the drops, dB.
    residuals : ndarray, shape (n_drop, n_number)
        Leave-one-out residuals: prediction minus result, dB.
    """

    case: Case
    keys: tuple[str, ...]
    region: Array
    outputs: dict[str, int]
    bound: float
    peaks: int
    seed: int
    version: str
    points: Array
    drops: Array
    length: Array
    weights: Array
    residuals: Array

    def __repr__(self) -> str:
        """Return the keys and the largest error of an assessed number."""
        return (
            f"<Surrogate of {len(self.points)} drops by {', '.join(self.keys)}: "
            f"95 % within {self.worst[1]:.3f} dB>"
        )

    def to_dataframe(self) -> pd.DataFrame:
        """Return the errors of held-out drops by number, dB; raise InputError without pandas.

        Columns: the error of 95 %, the maximum, the standard deviation of the results, and whether
        the number is withheld because its error exceeds the bound.
        """
        largest, spread = np.abs(self.residuals).max(axis=0), self.drops.std(axis=0)
        table = {"error_dB": self.errors, "maximum_dB": largest, "spread_dB": spread}
        withheld = self.errors > self.bound
        return data_frame(table | {"withheld": withheld}).set_axis(self.labels).dropna()

    def to_xarray(self) -> xr.Dataset:
        """Return the table of `to_dataframe` as a dataset."""
        result: xr.Dataset = self.to_dataframe().rename_axis("number").to_xarray()
        return result

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: the error of each quantity."""
        header = ("held-out drops, dB", "95 %", "maximum", "spread", "")
        return [header, *(
            (name, *(f"{number:.2g}" for number in numbers), "withheld" if withheld else "")
            for name, *numbers, withheld in self.to_dataframe().itertuples()
        )]  # fmt: skip

    @property
    def notes(self) -> tuple[str, ...]:
        """Accuracy of the surrogate."""
        return (self.accuracy,)

    @property
    def accuracy(self) -> str:
        """Number of training drops, maximum assessed error, and quantities that it withholds."""
        label, error = self.worst
        result = (
            f"surrogate of {len(self.points)} drops: 95 % of held-out drops within {error:.2g} dB "
            f"({label}; other quantities of the verdict have smaller errors)"
        )
        withheld = [n for n, e in zip(self.labels, self.errors, strict=True) if e > self.bound]
        if withheld:
            result += f"; withheld, with errors above {self.bound:g} dB: {', '.join(withheld)}"
        return result

    def plot(self) -> Figure:
        """Return the errors of the held-out drops."""
        from thud.plot import draw_surrogate

        return draw_surrogate(self)

    @property
    def labels(self) -> list[str]:
        """Labels of all numbers."""
        result = []
        for name in self.outputs:
            bands = FREQUENCIES[LEVELS[name]] if name in LEVELS else ()
            title = RESULTS[name].title
            result += [f"{title} {band:g} Hz" for band in bands] or [title]
        return result

    @property
    def assessed(self) -> NDArray[np.bool_]:
        """Whether the verdict depends on each number, shape (n_number,)."""
        names = {f"{self.case.levels.force}_octave", "contact_time", "restitution"}
        return np.repeat([name in names for name in self.outputs], list(self.outputs.values()))

    @property
    def errors(self) -> Array:
        """Error of each number, dB, shape (n_number,); NaN if the model has no such result."""
        result: Array = np.sort(np.abs(self.residuals), axis=0)[rank(len(self.points))]
        return result

    @property
    def worst(self) -> tuple[str, float]:
        """Name and error, dB, of the assessed number with the largest error."""
        errors = np.where(self.assessed, self.errors, -np.inf)
        return self.labels[int(np.nanargmax(errors))], float(np.nanmax(errors))

    def error_of(self, name: str) -> Array:
        """Return the errors of a quantity, dB, shape (count,)."""
        return self._split(self.errors)[name]

    def mean_square(self, name: str) -> Array:
        """Return the mean squares of the held-out errors of a quantity, dB2, shape (count,)."""
        return self._split(np.mean(self.residuals**2, axis=0))[name]

    def _split(self, numbers: Array) -> dict[str, Array]:
        """Return numbers, shape (..., n_number), by quantity, shape (..., count)."""
        ends = np.cumsum(list(self.outputs.values()))[:-1]
        return dict(zip(self.outputs, np.split(numbers, ends, axis=-1), strict=True))

    def require(self, case: Case, names: Iterable[str]) -> None:
        """Raise InputError if it cannot predict a case in which the named keys vary."""
        if self.version != version():
            refuse(
                f"the surrogate was trained by thud {self.version}", f"training by thud {version()}"
            )
        label, error = self.worst
        if not error <= self.bound:
            refuse(
                f"the training of the surrogate is not finished: its error of the {label} is "
                f"{error:.3g} dB",
                f"a surrogate with errors up to {self.bound:g} dB",
            )
        if more := [name for name in names if name not in self.keys]:
            refuse(
                f"the surrogate was not trained on {', '.join(more)}",
                f"parameters among {', '.join(self.keys)}",
            )
        middle = dict(zip(self.keys, self.region.mean(axis=1).tolist(), strict=True))
        model = self.case.model.name  # type: ignore[union-attr]
        if case.model is None or case.model.name != model:
            refuse("the surrogate was trained on another model", f"model = {model!r}")
        if changed := differing_keys(with_values(self.case, middle), with_values(case, middle)):
            key, before, now = changed[0]
            refuse(f"{key} = {now} differs from that of the surrogate", before)

    def predict(self, case: Case, columns: Columns) -> Columns:
        """Return the results of samples of a case that differ in some keys, shape (n_sample,) each.

        The results are those of `thud.studies.samples.evaluate`, and ``undecided``: whether errors
        could change the verdict. Samples outside the region have a status and a reason instead.
        Raises InputError like `require`.
        """
        self.require(case, columns)
        count = len(next(iter(columns.values())))
        sampled = {
            name: np.broadcast_to(columns.get(name, np.asarray(value_in(case, name))), count)
            for name in self.keys
        }
        values = np.column_stack(list(sampled.values())).astype(float)
        low, high = self.region.T
        width = high - low
        tolerance = _ROUNDING * np.maximum(width, np.abs(high))
        outside = ~((values >= low - tolerance) & (values <= high + tolerance))
        points = (values - low) / np.where(width > 0, width, 1.0) / self.length
        numbers = np.empty((count, len(self.errors)))
        # Threads of BLAS would wait for each other at each chunk.
        with threadpool_limits(1, "blas"):
            for start in range(0, count, _CHUNK_SIZE):
                chunk = slice(start, start + _CHUNK_SIZE)
                numbers[chunk] = matern(points[chunk], self.points / self.length) @ self.weights
        numbers += self.drops.mean(axis=0)
        numbers[:, ~(self.errors <= self.bound)] = np.nan
        numbers[outside.any(axis=1)] = np.nan
        reasons = np.full(count, "", dtype=object)
        for i in np.flatnonzero(outside.any(axis=1)):
            j = int(np.argmax(outside[i]))
            reasons[i] = (
                f"{self.keys[j]} = {values[i, j]:g} is outside the region of the surrogate; "
                f"allowed: {low[j]:g} to {high[j]:g}"
            )
        result: Columns = {
            name: part if name in LEVELS else 10 ** (part[:, 0] / 20)
            for name, part in self._split(numbers).items()
        }
        level, ratios = f"{case.levels.force}_octave", ("contact_time", "restitution")
        others = [sampled.get(n, np.asarray(value_in(case, n))) for n in ("mass", "height")]
        decibels = np.array([self.error_of(name)[0] for name in ratios])
        known = np.column_stack([result[name] for name in ratios])
        fixed = np.broadcast_arrays(np.full(count, self.peaks), *others)
        verdicts = assess_many(
            np.column_stack([result[level], known, *fixed]),
            np.column_stack([
                np.tile(self.error_of(level), (count, 1)), known * (10 ** (decibels / 20) - 1),
                np.zeros((count, len(fixed))),
            ]),
            case.limits.source,
        )  # fmt: skip
        verdicts["undecided"] &= reasons == ""
        return result | verdicts | {"status": (reasons != "").astype("int8"), "reason": reasons}

    @property
    def digest(self) -> str:
        """Checksum of its content."""
        return sha256(self.to_bytes()).hexdigest()

    def to_bytes(self) -> bytes:
        """Return the content of its file."""
        header = {name: v for name, v in vars(self).items() if name not in {*_ARRAYS, "case"}}
        header["case"] = case_text(self.case).decode()
        file = io.BytesIO()
        np.savez(file, header=json.dumps(header), **{name: vars(self)[name] for name in _ARRAYS})
        return file.getvalue()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the file ``.npz`` that `read_surrogate` reads, atomically."""
        replace_file(path, self.to_bytes())


def matern(points: Array, drops: Array) -> Array:
    """Return the Matern kernel of smoothness 5/2 of scaled points and drops, shape (n, n_drop)."""
    # scikit-learn is slow to import, and needed for the training only.
    distance = math.sqrt(5) * cdist(points, drops)
    result: Array = (1 + distance + distance**2 / 3) * np.exp(-distance)
    return result


def rank(count: int) -> int:
    """Return the index of the order statistic of `count` numbers that bounds 95 % of others.

    It is the quantile of the binomial distribution at the confidence of 95 %; there is no such
    index for 58 numbers or fewer.
    """
    index = np.arange(1, count + 1)
    steps = np.log((count - index + 1) / index) + math.log(COVERAGE / (1 - COVERAGE))
    logarithms = count * math.log(1 - COVERAGE) + np.cumsum([0.0, *steps])
    return int(np.searchsorted(np.cumsum(np.exp(logarithms)), COVERAGE))


def assess_many(values: Array, errors: Array, source: LimitsSource) -> dict[str, NDArray[Any]]:
    """Return margin and verdict of many drops, and whether errors could change the verdict.

    The columns of values are octave levels, dB; contact time, s; restitution; number of peaks;
    mass, kg; height, m, as in `thud.assess_levels`, shape (n, 10). Errors have the same shape and
    units. The limits are those of the source.
    """
    lower, upper = np.array([(low, high) for *_, low, high in LIMITS[source]]).T
    margins = np.minimum(values - lower, upper - values)
    certain, possible = ((margins >= sign * errors).all(axis=1) for sign in (1, -1))
    return {
        "margin": margins[:, :5].min(axis=1),
        "conforms": (margins >= 0).all(axis=1),
        "undecided": possible & ~certain,
    }


def differing_keys(before: Case, now: Case) -> list[tuple[str, str, str]]:
    """Return name and values of the keys by which the impacts of two cases differ, as texts."""
    first, second = (
        {
            f"&{group}: {key}": f"{value!r}"
            for group, keys in impact_only(case).resolved().to_namelist().items()
            if group not in {"case", "limits", OUTPUT_GROUP}
            for key, value in keys.items()
        }
        for case in (before, now)
    )
    texts = {key: (first.get(key, "none"), second.get(key, "none")) for key in first | second}
    return [(key, *pair) for key, pair in texts.items() if pair[0] != pair[1]]


def read_surrogate(path: str | os.PathLike[str]) -> Surrogate:
    """Read a surrogate from its file, which holds numbers and text only, no code.

    Raises
    ------
    InputError
        If the file is damaged or not a surrogate.
    OSError
        If the file temporarily cannot be read.
    """
    require_kind("surrogate", path, str | Path)
    try:
        with np.load(io.BytesIO(read_input(Path(path))), allow_pickle=False) as file:
            header = json.loads(str(file["header"]))
            header |= {name: np.asarray(file[name], dtype=np.float64) for name in _ARRAYS}
        header["case"] = Case.from_text(header["case"])
        result = Surrogate(**header)
    except Exception as error:
        if is_failure(error):
            raise
        # Zip, NumPy and JSON raise many kinds of errors.
        reason = getattr(error, "strerror", None) or "not a surrogate, or damaged"
        refuse(f"{path} cannot be read: {reason}", "a file that Surrogate.save wrote", error)
    return result
