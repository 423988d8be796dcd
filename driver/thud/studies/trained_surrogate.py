"""Surrogates: interpolation of the results of a model, with its errors."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.linalg import cho_solve
from scipy.spatial.distance import cdist
from threadpoolctl import threadpool_limits

from thud.base._schema import KEYS, LIMITS, SAMPLE_QUANTITIES
from thud.base.bridge import version
from thud.base.checks import refuse, refuse_value, require_kind
from thud.base.extras import data_frame, require_extra
from thud.base.note import Note
from thud.case.case import Case, impact_only
from thud.case.keys import value_in, with_values
from thud.impact.datasets import FREQUENCIES, LEVELS, RESULTS
from thud.studies.dataset import read_dataset
from thud.studies.study_result import SampleResult

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable

    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

    from thud.base._schema import LimitsSource
    from thud.studies.arrays import Array, Columns
    from thud.studies.study import Study


# Fraction of held-out drops within the stated error, and the confidence of that statement.
COVERAGE = 0.95
# Fewer drops have no order statistic that bounds 95 % of all with a confidence of 95 %.
MIN_DROPS = 64
# The time of the training grows with the third power of the number of drops.
MAX_DROPS = 8192
# Samples that are predicted together: their kernel stays in the cache.
_CHUNK_SIZE = 250
# Values this fraction of the width outside the region are rounding errors.
_ROUNDING = 1e-9
# Variations below this fraction of the mean are rounding errors.
_CONSTANT = 1e-10
# Smoothness of the Matern kernel: functions that are twice differentiable (see `matern`).
SMOOTHNESS = 2.5
_GROUPS_OF_RECORDS = ("sampling", "levels", "limits")


@dataclass(frozen=True, eq=False, repr=False)
class Surrogate(SampleResult):
    """Prediction of drops of a model from training drops in the same region.

    A Gaussian process interpolates all quantities, in dB: levels, and 20 lg of other quantities.
    Each quantity has a stated error: with a confidence of 95 %, the errors of 95 % of other drops
    are smaller (order statistic of the leave-one-out residuals).

    Attributes
    ----------
    dataset : Dataset
        The training drops, from which all other attributes follow.
    case : Case
        The case of the drops.
    keys : tuple of str
        Keys in which the drops differ.
    region : ndarray, shape (n_key, 2)
        Minimum and maximum of each key.
    outputs : dict of str to int
        Quantities, and the number of values of each: levels have one per band.
    peaks : int
        Number of peaks of the assessed force, the same in all drops.
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

    kind: ClassVar[str] = "surrogate"
    drawn_by: ClassVar[str] = "study_figures.draw_surrogate"

    dataset: xr.Dataset
    case: Case = field(init=False)
    keys: tuple[str, ...] = field(init=False)
    region: Array = field(init=False)
    outputs: dict[str, int] = field(init=False)
    peaks: int = field(init=False)
    points: Array = field(init=False)
    drops: Array = field(init=False)
    length: Array = field(init=False)
    weights: Array = field(init=False)
    residuals: Array = field(init=False)

    def __post_init__(self) -> None:
        """Learn the drops.

        Raises InputError if they are not those of a surrogate, a drop has no result, or drops
        differ in their number of peaks.
        """
        data = self.dataset
        if data.attrs.get("study_kind") != self.kind or data.sizes["sample"] < MIN_DROPS:
            refuse("the samples are not those of a surrogate", "results of a finished training")
        if (failed := data["status"].to_numpy() != 0).any():
            reason = data["reason"].to_numpy()[failed][0]
            refuse(
                f"{failed.sum()} of {failed.size} drops of the surrogate have no result ({reason})",
                "ranges in which all drops have results",
            )
        if len(peaks := np.unique(data["peaks"]).astype(int).tolist()) > 1:
            refuse(
                f"the number of peaks differs among the drops of the surrogate: {peaks}",
                "ranges in which it is the same: a count cannot be interpolated",
            )
        axes = [data[name] for name in data.attrs["parameters"].split()]
        region = np.array([axis.attrs["range"] for axis in axes])
        names = [str(name) for name in data if name in {*SAMPLE_QUANTITIES, *LEVELS}]
        results = {name: _decibels(name, data[name].to_numpy()) for name in names}
        self._set(
            case=Case.from_text(data.attrs["case"]), keys=tuple(a.attrs["key"] for a in axes),
            region=region, outputs={name: part.shape[1] for name, part in results.items()},
            peaks=peaks[0], drops=np.concatenate(list(results.values()), axis=1),
            points=(np.column_stack(axes) - region[:, 0]) / np.ptp(region, axis=1),
        )  # fmt: skip
        if (unknown := self.assessed & ~np.isfinite(self.drops).all(axis=0)).any():
            label = self.labels[int(np.argmax(unknown))]
            allowed = "a model and ranges where it is known"
            refuse(f"{label} is 0 or not known in some drops", allowed)
        self._set(**regress(self.points, self.drops, self.assessed))
        super().__post_init__()

    def _set(self, **values: object) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @classmethod
    def check(cls, study: Study) -> None:
        """Raise InputError for a study whose samples cannot be learned."""
        if study.case.floor:
            refuse("a surrogate is not allowed with a floor", "a case without &floor")
        if study.density is not None:
            refuse("[fixed] density is not allowed for a surrogate", "mass")
        if not MIN_DROPS <= study.size <= MAX_DROPS:
            refuse_value("[design] size", study.size, f"{MIN_DROPS} to {MAX_DROPS}")
        for parameter in study.parameters:
            key = parameter.key
            is_real = key.kind == "real" or (key.kind == "list" and not key.whole)
            if not is_real or key.group in _GROUPS_OF_RECORDS or key not in KEYS:
                allowed = "real numbers of ball, drop and model"
                refuse(f"a surrogate cannot learn {parameter.name}", allowed)
            if parameter.low is None:
                label = f"[parameters] {parameter.name}"
                refuse(f"{label} is not a range of a surrogate", "low, high, scale and unit")

    def __repr__(self) -> str:
        """Return the keys and the largest error of an assessed number."""
        return (
            f"<Surrogate of {len(self.points)} drops by {', '.join(self.keys)}: "
            f"95 % within {self.worst[1]:.3f} dB>"
        )

    def to_dataframe(self) -> pd.DataFrame:
        """Return the errors of held-out drops by number, dB; raise InputError without pandas.

        Columns: the error of 95 %, the maximum, and the standard deviation of the results.
        """
        largest, spread = np.abs(self.residuals).max(axis=0), self.drops.std(axis=0)
        table = {"error_dB": self.errors, "maximum_dB": largest, "spread_dB": spread}
        return data_frame(table).set_axis(self.labels).dropna()

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: the error of each quantity."""
        return [("held-out drops, dB", "95 %", "maximum", "spread"), *(
            (name, *(f"{number:.2g}" for number in numbers))
            for name, *numbers in self.to_dataframe().itertuples()
        )]  # fmt: skip

    @property
    def notes(self) -> tuple[Note, ...]:
        """Accuracy of the surrogate."""
        return (Note("surrogate", others={"accuracy": self.accuracy}),)

    @property
    def accuracy(self) -> str:
        """Number of training drops, and maximum assessed error."""
        label, error = self.worst
        return (
            f"surrogate of {len(self.points)} drops: 95 % of held-out drops within {error:.2g} dB "
            f"({label}; other quantities of the verdict have smaller errors)"
        )

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
        if (trained := self.dataset.attrs["thud_version"]) != version():
            refuse(f"the surrogate was trained by thud {trained}", f"training by thud {version()}")
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

        The results are those of `thud.studies.run.evaluate`, and ``undecided``: whether errors
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
        """Checksum of the training drops."""
        return sha256(np.column_stack([self.points, self.drops]).tobytes()).hexdigest()


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
            if group not in {"case", "limits", "output"}
            for key, value in keys.items()
        }
        for case in (before, now)
    )
    texts = {key: (first.get(key, "none"), second.get(key, "none")) for key in first | second}
    return [(key, *pair) for key, pair in texts.items() if pair[0] != pair[1]]


def read_surrogate(path: str | os.PathLike[str]) -> Surrogate:
    """Read a surrogate from the results of its training, and learn the drops again.

    Raises
    ------
    InputError
        If the file is damaged or has no training drops.
    OSError
        If the file temporarily cannot be read.
    """
    require_kind("surrogate", path, str | Path)
    return Surrogate(read_dataset(Path(path)))


def _decibels(name: str, values: Array) -> Array:
    """Return a quantity in dB, shape (n, count); NaN if any value has no logarithm."""
    if name in LEVELS:
        return values
    if (values <= 0).any():
        values = np.full_like(values, np.nan)
    result: Array = 20 * np.log10(values)[:, np.newaxis]
    return result


def regress(points: Array, values: Array, assessed: NDArray[np.bool_]) -> dict[str, Any]:
    """Return a Gaussian process through values at points in the unit cube.

    Correlation lengths and noise (of time steps, and of nodes that touch one by one) maximize the
    likelihood of the assessed quantities; the other quantities share them. Returns the
    fields length, weights and residuals of a `Surrogate`.
    """
    with require_extra("surrogate"):
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
    mean, scale = values.mean(axis=0), values.std(axis=0)
    # Constant quantities, such as a prescribed contact time.
    scale[scale <= _CONSTANT * np.maximum(np.abs(mean), 1.0)] = 0.0
    varies = scale > 0  # false for NaN
    normalized = np.where(varies, (values - mean) / np.where(varies, scale, 1.0), 0.0)
    fitted = assessed & varies if (assessed & varies).any() else assessed
    shape = Matern(np.full(points.shape[1], 2.0), (0.05, 50.0), nu=SMOOTHNESS)
    kernel = ConstantKernel(10.0, (1e-2, 1e6)) * shape + WhiteKernel(1e-2, (1e-10, 10.0))
    process = GaussianProcessRegressor(kernel)
    with warnings.catch_warnings(), threadpool_limits(1, "blas"):
        # A parameter without effect gets the maximum length.
        warnings.simplefilter("ignore", ConvergenceWarning)
        process.fit(points, normalized[:, fitted])
        inverse = cho_solve((process.L_, True), np.eye(len(points)))
        weights = inverse @ normalized
    signal = process.kernel_.k1
    # Leave-one-out residuals (Rasmussen and Williams 2006, eq. 5.12).
    residuals = np.where(varies, -weights / np.diag(inverse)[:, None], 0.0) * scale
    return {
        "length": np.broadcast_to(signal.k2.length_scale, points.shape[1:]).astype(float),
        "weights": signal.k1.constant_value * weights * np.where(varies, scale, 0.0),
        "residuals": np.where(np.isfinite(mean), residuals, np.nan),
    }
