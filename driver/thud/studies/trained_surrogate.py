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
from threadpoolctl import threadpool_limits

from thud.base._schema import LIMITS
from thud.base.bridge import version
from thud.base.checks import (
    MAX_SEED,
    refuse,
    refuse_unknown,
    refuse_value,
    require_kind,
    require_number,
    require_whole,
)
from thud.base.extras import require_extra
from thud.base.files import is_failure, read_input, replace_file
from thud.case.case import Case, case_text
from thud.case.keys import OUTPUT_GROUP, value_in, with_values
from thud.impact.datasets import FREQUENCIES, LEVELS, RESULTS
from thud.studies.study_result import StudyResult

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import LimitsSource

    Columns = dict[str, NDArray[Any]]
    Values = NDArray[np.float64]

# Fraction of held-out drops within the stated error, and the confidence of that statement.
COVERAGE = 0.95
# Samples that are predicted together: their kernel stays in the cache.
_CHUNK_SIZE = 250
# Values this fraction of the width outside the region are rounding errors.
_ROUNDING = 1e-9
# Smoothness of the Matern kernel: functions that are twice differentiable (see `_kernel`).
SMOOTHNESS = 2.5
# Fewer drops have no order statistic that bounds 95 % of all with a confidence of 95 %.
MIN_DROPS = 64
# The time of the training grows with the third power of the number of drops.
MAX_DROPS = 8192
_ARRAYS = "region", "points", "length", "weights", "mean", "scale", "residuals"


@dataclass(frozen=True, eq=False)
class Surrogate(StudyResult):
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
    identity : dict of str to str
        Everything that the drops depend on, as texts by group and key.
    points : ndarray, shape (n_drop, n_key)
        The drops, in the unit cube.
    length : ndarray, shape (n_key,)
        Correlation lengths in the unit cube.
    weights : ndarray, shape (n_drop, n_number)
        Weights of the kernels of the drops.
    mean, scale : ndarray, shape (n_number,)
        Mean and standard deviation of each number over the drops, dB.
    residuals : ndarray, shape (n_drop, n_number)
        Leave-one-out residuals: prediction minus result, dB.
    """

    case: Case
    keys: tuple[str, ...]
    region: Values
    outputs: dict[str, int]
    bound: float
    peaks: int
    identity: dict[str, str]
    points: Values
    length: Values
    weights: Values
    mean: Values
    scale: Values
    residuals: Values

    def __repr__(self) -> str:
        """Return the keys and the largest error of an assessed number."""
        error = float(self.errors[self.assessed].max())
        return (
            f"<Surrogate of {len(self.points)} drops by {', '.join(self.keys)}: "
            f"95 % within {error:.3f} dB>"
        )

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: the error of each quantity."""
        rows: list[tuple[str, ...]] = [("held-out drops, dB", "95 %", "maximum", "spread", "")]
        largest = np.abs(self.residuals).max(axis=0)
        for name, *numbers in zip(self.labels, self.errors, largest, self.scale, strict=True):
            if np.isfinite(numbers[0]):
                note = "" if numbers[0] <= self.bound else "withheld"
                rows.append((name, *(f"{number:.2g}" for number in numbers), note))
        return rows

    warnings = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Accuracy of the surrogate."""
        return (self.accuracy,)

    def plot(self) -> Figure:
        """Return the errors of the held-out drops."""
        from thud.plot import draw_surrogate

        return draw_surrogate(self)

    @property
    def labels(self) -> list[str]:
        """Labels of all numbers."""
        result = []
        for name, count in self.outputs.items():
            title, bands = RESULTS[name].title, FREQUENCIES.get(LEVELS.get(name, ""), ())
            result += [f"{title} {band:g} Hz" for band in bands] if count > 1 else [title]
        return result

    @property
    def assessed(self) -> NDArray[np.bool_]:
        """Whether the verdict depends on each number, shape (n_number,)."""
        names = {f"{self.case.levels.force}_octave", "contact_time", "restitution"}
        return np.repeat([name in names for name in self.outputs], list(self.outputs.values()))

    @property
    def errors(self) -> Values:
        """Error of each number, dB, shape (n_number,); NaN if the model has no such result."""
        count = len(self.points)
        result: Values = np.sort(np.abs(self.residuals), axis=0)[_rank(count)]
        return result

    @property
    def worst(self) -> tuple[str, float]:
        """Name and error, dB, of the assessed number with the largest error."""
        errors = np.where(self.assessed, self.errors, -np.inf)
        return self.labels[int(np.nanargmax(errors))], float(np.nanmax(errors))

    @property
    def accuracy(self) -> str:
        """Number of training drops, maximum assessed error, and quantities that it withholds."""
        label, error = self.worst
        result = (
            f"surrogate of {len(self.points)} drops: 95 % of held-out drops within {error:.2g} dB "
            f"({label}; other quantities of the verdict have smaller errors)"
        )
        if self.withheld:
            result += f"; withheld, with errors above {self.bound:g} dB: "
            result += ", ".join(self.withheld)
        return result

    @property
    def withheld(self) -> list[str]:
        """Names of the numbers that are not predicted because their errors exceed the bound."""
        pairs = zip(self.labels, self.errors, strict=True)
        return [label for label, error in pairs if error > self.bound]

    def error_of(self, name: str) -> Values:
        """Return the errors of a quantity, dB, shape (count,)."""
        result: Values = self._split(self.errors[np.newaxis])[name][0]
        return result

    def mean_square(self, name: str) -> Values:
        """Return the mean squares of the held-out errors of a quantity, dB2, shape (count,)."""
        result: Values = self._split(np.mean(self.residuals**2, axis=0)[np.newaxis])[name][0]
        return result

    def _split(self, numbers: Values) -> dict[str, Values]:
        """Return columns of numbers by quantity, shape (n, count)."""
        ends = np.cumsum(list(self.outputs.values()))[:-1]
        return dict(zip(self.outputs, np.split(numbers, ends, axis=1), strict=True))

    def require(self, case: Case, names: Iterable[str]) -> None:
        """Raise InputError if it cannot predict a case in which the named keys vary."""
        require_kind("surrogate", self, Surrogate)
        if (trained := self.identity["thud"]) != version():
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
        before = keys_of(with_values(self.case, middle))
        now = keys_of(with_values(case, middle))
        if changed := [key for key in before if before[key] != now.get(key)]:
            key = changed[0]
            refuse(f"{key} = {now.get(key)} differs from that of the surrogate", before[key])

    def predict(self, case: Case, columns: Columns) -> Columns:
        """Return the results of samples of a case that differ in some keys, shape (n_sample,) each.

        The results are those of `thud.studies.samples.evaluate`, and ``undecided``: whether errors
        could change the verdict. Samples outside the region have a status and a reason instead.
        Raises InputError like `require`.
        """
        self.require(case, columns)
        count = len(next(iter(columns.values())))
        samples = {n: np.asarray(columns.get(n, value_in(case, n))) for n in self.keys}
        values = np.column_stack([np.broadcast_to(v, count) for v in samples.values()]).astype(
            float
        )
        low, high = self.region.T
        width = high - low
        tolerance = _ROUNDING * np.maximum(width, np.abs(high))
        outside = ~((values >= low - tolerance) & (values <= high + tolerance))
        points = (values - low) / np.where(width > 0, width, 1.0)
        numbers = np.empty((count, len(self.mean)))
        # Threads of BLAS would wait for each other at each chunk.
        with threadpool_limits(1, "blas"):
            for start in range(0, count, _CHUNK_SIZE):
                chunk = slice(start, start + _CHUNK_SIZE)
                numbers[chunk] = self._kernel(points[chunk]) @ self.weights
        numbers = numbers * self.scale + self.mean
        numbers[:, ~(self.errors <= self.bound)] = np.nan
        failed = outside.any(axis=1)
        numbers[failed] = np.nan
        return self._results(case, numbers, samples, self._reasons(values, outside))

    def _kernel(self, points: Values) -> Values:
        """Return the Matern kernel of smoothness 5/2 of points and drops, shape (n, n_drop)."""
        # scikit-learn is slow to import, and needed for the training only.
        scaled, drops = points / self.length, self.points / self.length
        squares = (scaled**2).sum(axis=1)[:, np.newaxis] + (drops**2).sum(axis=1)
        squares -= 2 * scaled @ drops.T
        distance = np.sqrt(5 * np.maximum(squares, 0.0, out=squares), out=squares)
        # In place: the time is that of the memory.
        result: Values = distance / 3
        result += 1
        result *= distance
        result += 1
        result *= np.exp(np.negative(distance, out=distance), out=distance)
        return result

    def _reasons(self, values: Values, outside: NDArray[np.bool_]) -> NDArray[np.object_]:
        reasons = np.full(len(values), "", dtype=object)
        for i in np.flatnonzero(outside.any(axis=1)):
            j = int(np.argmax(outside[i]))
            name, (low, high) = self.keys[j], self.region[j]
            reasons[i] = (
                f"{name} = {values[i, j]:g} is outside the region of the surrogate; "
                f"allowed: {low:g} <= {name} <= {high:g}"
            )
        return reasons

    def _results(
        self, case: Case, numbers: Values, samples: Columns, reasons: NDArray[np.object_]
    ) -> Columns:
        quantities = self._split(numbers)
        levels = {name: columns for name, columns in quantities.items() if self.outputs[name] > 1}
        result: Columns = {
            n: 10 ** (columns[:, 0] / 20) for n, columns in quantities.items()
        } | levels
        names = ("contact_time", "restitution")
        level = f"{case.levels.force}_octave"
        mass_and_height = [
            samples.get(n, np.asarray(value_in(case, n))) for n in ("mass", "height")
        ]
        no_errors = [np.zeros(1)] * 3
        verdicts = assess_many(
            (result[level], *(result[n] for n in names), np.array([self.peaks]), *mass_and_height),
            (
                self.error_of(level)[np.newaxis],
                *(result[n] * (10 ** (self.error_of(n) / 20) - 1) for n in names),
                *no_errors,
            ),
            case.limits.source,
        )
        verdicts["undecided"] &= reasons == ""
        status = np.where(reasons == "", 0, 1).astype("int8")
        return result | verdicts | {"status": status, "reason": reasons}

    @property
    def is_complete(self) -> bool:
        """Whether shapes and values are consistent, and assessed quantities are finite."""
        drops, keys, numbers = len(self.points), len(self.keys), sum(self.outputs.values())
        shapes = {
            "region": (keys, 2), "points": (drops, keys), "length": (keys,),
            "weights": (drops, numbers), "mean": (numbers,), "scale": (numbers,),
            "residuals": (drops, numbers),
        }  # fmt: skip
        if any(getattr(self, name).shape != shape for name, shape in shapes.items()):
            return False
        low, high = self.region.T
        finite = (self.points, self.length, *(
            getattr(self, name)[..., self.assessed] for name in ("weights", "mean", "residuals")
        ))  # fmt: skip
        return bool(
            drops > 0
            and self.assessed.any()
            and (low <= high).all()
            and (self.length > 0).all()
            and all(np.isfinite(part).all() for part in finite)
            and self.bound > 0
            and self.peaks == int(self.peaks)
            and self.case.model
            and "thud" in self.identity
        )

    @property
    def _header(self) -> str:
        return json.dumps(
            {
                "case": case_text(self.case).decode(),
                "keys": self.keys,
                "outputs": self.outputs,
                "bound": self.bound,
                "peaks": self.peaks,
                "identity": self.identity,
            }
        )

    @property
    def digest(self) -> str:
        """Checksum of its content."""
        content = sha256(self._header.encode())
        for name in _ARRAYS:
            content.update(np.ascontiguousarray(getattr(self, name)).tobytes())
        return content.hexdigest()

    def to_bytes(self) -> bytes:
        """Return the content of its file."""
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        file = io.BytesIO()
        np.savez_compressed(file, header=self._header, digest=self.digest, **arrays)
        return file.getvalue()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the file ``.npz`` that `read_surrogate` reads, atomically."""
        replace_file(path, self.to_bytes())


def _rank(count: int) -> int:
    """Return the index of the order statistic of `count` numbers that bounds 95 % of others.

    It is the quantile of the binomial distribution at the confidence of 95 %; there is no such
    index for 58 numbers or fewer.
    """
    index = np.arange(1, count + 1)
    steps = np.log((count - index + 1) / index) + math.log(COVERAGE / (1 - COVERAGE))
    logarithms = count * math.log(1 - COVERAGE) + np.cumsum([0.0, *steps])
    return int(np.searchsorted(np.cumsum(np.exp(logarithms)), COVERAGE))


def assess_many(
    values: tuple[Values, ...], errors: tuple[Values, ...], source: LimitsSource
) -> dict[str, NDArray[Any]]:
    """Return margin and verdict of many drops, and whether errors could change the verdict.

    The values are octave levels, dB, shape (n, 5); contact time, s; restitution; number of peaks;
    mass, kg; height, m, as in `thud.assess_levels`, shape (n,) or (1,). Errors have the same order
    and units. The limits are those of the source.
    """
    count, bands = values[0].shape
    assessed, deviation = (_columns(columns, count) for columns in (values, errors))
    lower, upper = np.array([(low, high) for *_, low, high in LIMITS[source]]).T
    margins = np.minimum(assessed - lower, upper - assessed)
    certain, possible = ((margins >= sign * deviation).all(axis=1) for sign in (1, -1))
    return {
        "margin": margins[:, :bands].min(axis=1),
        "conforms": (margins >= 0).all(axis=1),
        "undecided": possible & ~certain,
    }


def _columns(parts: tuple[Values, ...], count: int) -> Values:
    """Return the values of all criteria, shape (count, n_criterion)."""
    levels = np.broadcast_to(parts[0], (count, parts[0].shape[-1]))
    return np.column_stack([levels, *(np.broadcast_to(part, count) for part in parts[1:])])


def keys_of(case: Case) -> dict[str, str]:
    """Return the keys of a case that matter for a surrogate, as texts by group and key."""
    groups = case.resolved().to_namelist()
    return {
        f"&{group}: {key}": f"{value!r}"
        for group, keys in groups.items()
        if group not in {"case", "limits", OUTPUT_GROUP}
        for key, value in keys.items()
    }


def get_surrogate(surrogate: Surrogate | str | os.PathLike[str]) -> Surrogate:
    """Return a surrogate, or read it from the path of its file."""
    return surrogate if isinstance(surrogate, Surrogate) else read_surrogate(surrogate)


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
            arrays: dict[str, Any] = {
                name: np.asarray(file[name], dtype=np.float64) for name in _ARRAYS
            }
            digest = str(file["digest"])
        header["case"] = Case.from_text(header["case"])
        header["keys"] = tuple(header["keys"])
        result = Surrogate(**header, **arrays)
        intact = result.digest == digest and result.is_complete
    except Exception as error:
        if is_failure(error):
            raise
        # Zip, NumPy and JSON raise many kinds of errors.
        reason = getattr(error, "strerror", None) or "not a surrogate"
        refuse(f"{path} cannot be read: {reason}", "a file that Surrogate.save wrote", error)
    if not intact:
        refuse(
            f"{path} is damaged: wrong checksum, shapes or numbers",
            "a file that Surrogate.save wrote",
        )
    return result


@dataclass(frozen=True)
class Plan:
    """How a surrogate is trained: maximum error, dB, maximum number of drops, seed."""

    error: float = 0.1
    size: int = 1024
    seed: int = 0

    @property
    def identity(self) -> dict[str, str]:
        """Everything besides drops that a surrogate depends on, as texts by group and key."""
        with require_extra("surrogate"):
            import sklearn
        return {
            "scikit-learn_version": sklearn.__version__,
            **{f"[surrogate] {word}": f"{value!r}" for word, value in vars(self).items()},
        }

    @property
    def stages(self) -> list[tuple[int, int]]:
        """First drop and stop (exclusive) of each stage; stages grow by a half or a third."""
        ends = [min(MIN_DROPS, self.size)]
        while ends[-1] < self.size:
            # 64, 96, 128, 192, ...: balanced parts of Sobol's sequence.
            power = 1 << (ends[-1].bit_length() - 1)
            step = power // 2 if ends[-1] == power else 2 * power - ends[-1]
            ends.append(min(ends[-1] + step, self.size))
        return list(zip([0, *ends[:-1]], ends, strict=True))


def read_plan(table: Mapping[str, object], folder: Path) -> Plan | Surrogate:
    """Return the plan of a table ``[surrogate]``, or the surrogate of the file that it names."""
    label = "[surrogate]"
    if "file" in table:
        refuse_unknown(f"{label} with file", table, ("file",))
        path = table["file"]
        if not isinstance(path, str) or not path.strip():
            refuse_value(f"{label} file", path, "the path of a saved surrogate")
        return read_surrogate(folder / path)
    refuse_unknown(label, table, ("error", "size", "seed", "file"))
    error, size, seed = (table.get(w, getattr(Plan, w)) for w in ("error", "size", "seed"))
    require_number(f"{label} error", error)
    if not error > 0:  # type: ignore[operator]
        refuse_value(f"{label} error", error, "numbers above 0, dB")
    require_whole(f"{label} size", size, MIN_DROPS, MAX_DROPS)
    require_whole(f"{label} seed", seed, 0, MAX_SEED)
    return Plan(float(error), size, seed)  # type: ignore[arg-type]
