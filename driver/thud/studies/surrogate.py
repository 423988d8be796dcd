"""Training of surrogates: drops are added until assessed quantities have small enough errors."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.linalg import cho_solve
from threadpoolctl import threadpool_limits

from thud.base._schema import KEYS, SAMPLE_QUANTITIES
from thud.base.bridge import version
from thud.base.checks import (
    MAX_SEED,
    refuse,
    refuse_unknown,
    refuse_value,
    require_number,
    require_whole,
)
from thud.base.errors import InputError, NumericalError
from thud.base.extras import require_extra
from thud.base.files import Results
from thud.impact.datasets import LEVELS
from thud.impact.ensemble import solve_many
from thud.level.levels import peak_count
from thud.studies.parameter import Parameter, read_varied
from thud.studies.sampling import unit_samples
from thud.studies.study import named_files, read_common, read_tables, table_of
from thud.studies.trained_surrogate import SMOOTHNESS, Surrogate, differing_keys, read_surrogate

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    from thud.case.case import Case
    from thud.studies.arrays import Array


# Fewer drops have no order statistic that bounds 95 % of all with a confidence of 95 %.
MIN_DROPS = 64
# The time of the training grows with the third power of the number of drops.
MAX_DROPS = 8192
# Variations below this fraction of the mean are rounding errors.
_ROUNDING = 1e-10
# Maximum error of the assessed quantities, dB, maximum number and seed of the drops.
DEFAULTS = {"error": 0.1, "size": 1024, "seed": 0}
_GROUPS_OF_RECORDS = ("sampling", "levels", "limits")


class Training(NamedTuple):
    """A training as its file describes it.

    It has a name, a case, minimum and maximum of each key that varies, the maximum error of the
    assessed quantities, dB, maximum number and seed of the drops, and its input files.
    """

    name: str
    case: Case
    region: dict[str, tuple[float, float]]
    error: float
    size: int
    seed: int
    inputs: tuple[str | os.PathLike[str], ...]

    @property
    def file(self) -> str:
        """Name of the file of the surrogate."""
        return f"{self.name}_surrogate.npz"

    def results(self, folder: str | os.PathLike[str], *, replace: bool) -> Results:
        """Return the results directory of the training."""
        return Results(Path(folder), "surrogate", self.name, self.inputs, replace=replace)


def surrogate(
    study: str | os.PathLike[str] | Mapping[str, object] | Training,
    output: str | os.PathLike[str] | None = None,
    *,
    workers: int | None = None,
    progress: bool = False,
    replace: bool = False,
) -> Surrogate:
    """Train a surrogate: a fast approximation of a slow model for studies and fits.

    Parameters
    ----------
    study
        Path of a TOML file, or its content as a mapping: each parameter has `low` and `high`, and
        ``[surrogate]`` may state error, size and seed; see docs/studies.md.
    output
        Directory of the surrogate, which is saved after each step; a training that was begun there
        is continued.
    workers
        Number of threads; by default one per processor.
    progress
        Show a progress bar for each step.
    replace
        Replace a surrogate of another region.

    Raises
    ------
    InputError
        If the study is invalid, a drop has no result, drops differ in their number of peaks, or the
        directory holds other results.
    NumericalError
        If the error exceeds its bound with all drops.
    """
    training = study if isinstance(study, Training) else read_training(study)
    trained, results = None, None
    if output is not None:
        results = training.results(output, replace=replace)
        results.require([training.file])
        trained = _begun(results.folder / training.file, training, replace=replace)
    while trained is None or trained.worst[1] > training.error:
        if trained and len(trained.points) >= training.size:
            message = (
                f"the surrogate's error of the {trained.worst[0]} is {trained.worst[1]:.3g} dB "
                f"with {len(trained.points)} drops; allowed: up to {training.error:g} dB "
                "([surrogate] error): narrower ranges without a jump of the results, more drops "
                "([surrogate] size), or a larger error"
            )
            raise NumericalError(message)
        trained = extend(trained, training, workers, progress=progress)
        if results:
            results.write({training.file: trained.to_bytes()})
    return trained


def read_training(source: str | os.PathLike[str] | Mapping[str, object]) -> Training:
    """Read a training; raise InputError if it is invalid, see `surrogate`."""
    with read_tables(source) as (content, folder, _):
        study = read_common(content, folder, "surrogate", ("surrogate",), _read_range)
        if study.density is not None:
            refuse("[fixed] density is not allowed for a surrogate", "mass")
        if study.case.floor:
            refuse("a surrogate is not allowed with a floor", "a case without &floor")
        table = {**DEFAULTS, **table_of(content, "surrogate")}
        refuse_unknown("[surrogate] of a training", table, DEFAULTS)
        error = require_number("[surrogate] error", table["error"])
        if error <= 0:
            refuse_value("[surrogate] error", error, "numbers above 0, dB")
        size = require_whole("[surrogate] size", table["size"], MIN_DROPS, MAX_DROPS)
        seed = require_whole("[surrogate] seed", table["seed"], 0, MAX_SEED)
        region = {p.name: (float(p.low), float(p.high)) for p in study.parameters}  # type: ignore[arg-type]
        inputs = () if isinstance(source, Mapping) else (source, *named_files(content, folder))
        return Training(study.name, study.case, region, error, size, seed, inputs)


def _read_range(name: str, entry: object, case: Case, density: float | None) -> Parameter:  # noqa: ARG001
    """Return a parameter that varies from a minimum to a maximum."""
    result = read_varied(name, entry, case, None)
    key = result.key
    if result.low is None or result.count or result.scale != Parameter.scale:
        refuse(f"[parameters] {name} is not a range of a surrogate", "low, high and unit")
    is_real = key.kind == "real" or (key.kind == "list" and not key.whole)
    if not is_real or key.group in _GROUPS_OF_RECORDS or key not in KEYS:
        refuse(f"a surrogate cannot learn {name}", "real numbers of ball, drop and model")
    return result


def _begun(path: Path, training: Training, *, replace: bool) -> Surrogate | None:
    """Return the surrogate of earlier steps, with the bound of this training; None: begin."""
    if not path.exists():
        return None
    try:
        before = read_surrogate(path)
    except InputError:
        if replace:
            return None
        raise
    region = dict(zip(before.keys, map(tuple, before.region.tolist()), strict=True))
    same = (before.version, before.seed, region) == (version(), training.seed, training.region)
    if same and not differing_keys(before.case, training.case):
        return dataclasses.replace(before, bound=training.error)
    if not replace:
        refuse(
            f"{path} is the surrogate of another region, case or version",
            "another directory, or --replace (replace=True) to train again",
        )
    return None


def extend(
    before: Surrogate | None, training: Training, workers: int | None, *, progress: bool
) -> Surrogate:
    """Return the surrogate with the drops of a further step: half or a third more."""
    first = len(before.points) if before else 0
    # 64, 96, 128, 192, ...: balanced parts of Sobol's sequence.
    power = 1 << max(first.bit_length() - 1, 0)
    step = (power // 2 if first == power else 2 * power - first) if first else MIN_DROPS
    stop = min(first + step, training.size)
    region = np.array(list(training.region.values()))
    points = unit_samples("sobol", len(region), stop, training.seed, first, stop)
    points[:, region[:, 0] == region[:, 1]] = 0.0
    columns = (region[:, 0] + points * np.ptp(region, axis=1)).T
    samples = solve_many(
        dict(zip(training.region, columns, strict=True)), training.case,
        threads=workers, forces=True, progress=progress,
    )  # fmt: skip
    if (failed := samples.status != 0).any():
        refuse(
            f"{failed.sum()} of {failed.size} drops of the surrogate have no result "
            f"({samples.reason[failed][0]})",
            "ranges in which all drops have results",
        )
    forces = getattr(samples, f"{training.case.levels.force}_force")
    peaks = {peak_count(force, samples.sample_rate) for force in forces}
    peaks |= {before.peaks} if before else set()
    if len(peaks) > 1:
        refuse(
            f"the number of peaks differs among the drops of the surrogate: {sorted(peaks)}",
            "ranges in which it is the same: a count cannot be interpolated",
        )
    learned = {*SAMPLE_QUANTITIES, *LEVELS}
    results = {n: _decibels(n, v) for n, v in samples.results.items() if n in learned}
    drops = np.concatenate(list(results.values()), axis=1)
    if before:
        points, drops = np.vstack([before.points, points]), np.vstack([before.drops, drops])
    blank = np.full_like(drops, np.nan)
    result = Surrogate(
        case=training.case, keys=tuple(training.region), region=region,
        outputs={name: columns.shape[1] for name, columns in results.items()},
        bound=training.error, peaks=peaks.pop(), seed=training.seed, version=version(),
        points=points, drops=drops, length=np.ones(len(region)), weights=blank, residuals=blank,
    )  # fmt: skip
    if (unknown := result.assessed & ~np.isfinite(drops).all(axis=0)).any():
        label = result.labels[int(np.argmax(unknown))]
        refuse(f"{label} is 0 or not known in some drops", "a model and ranges where it is known")
    return dataclasses.replace(result, **regress(points, drops, result.assessed))


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
    scale[scale <= _ROUNDING * np.maximum(np.abs(mean), 1.0)] = 0.0
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
