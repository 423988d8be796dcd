"""Training of surrogates by drops until assessed quantities have small enough errors."""

from __future__ import annotations

import warnings
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.linalg import cho_solve
from threadpoolctl import threadpool_limits

from thud.base._schema import SAMPLE_QUANTITIES
from thud.base.checks import refuse
from thud.base.errors import InputError, NumericalError
from thud.base.extras import require_extra
from thud.case.keys import find_key
from thud.impact.datasets import LEVELS
from thud.studies.blocks import compute_samples, read_identity, result_names
from thud.studies.directory import StudyDirectory, require_version
from thud.studies.parameter import Parameter
from thud.studies.samples import SampleStudy
from thud.studies.sampling import unit_samples
from thud.studies.trained_surrogate import SMOOTHNESS, Surrogate, read_surrogate

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from thud.studies.kind import RunOptions
    from thud.studies.samples import Columns
    from thud.studies.trained_surrogate import Plan

    Values = NDArray[np.float64]

# Samples that are scanned together for the ranges of their keys.
_SCANNED = 2**17
# Variations below this fraction of the mean are rounding errors.
_ROUNDING = 1e-10
_GROUPS_OF_RECORDS = ("sampling", "levels", "limits")


@dataclass(frozen=True)
class TrainingStudy(SampleStudy):
    """Drops `first` to `size` - 1 of the design of a surrogate, and their numbers of peaks."""

    first: int = 0

    counts_peaks: ClassVar[bool] = True

    def kind_settings(self) -> dict[str, str]:
        """Return design and range of the drops."""
        return super().kind_settings() | {"first drop": f"{self.first}"}

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of drops."""
        return (self.size - self.first,)

    def parameter_columns(self, start: int, stop: int) -> Columns:
        """Return drops `start` to `stop` - 1 after the first."""
        return super().parameter_columns(self.first + start, self.first + stop)


def train(study: SampleStudy, results: StudyDirectory | None, options: RunOptions) -> Surrogate:
    """Return the surrogate of all samples of a study, trained or read from its directory.

    Its drops are saved there as samples of a separate study. Raises InputError if a key cannot
    be learned or a drop has no result, NumericalError if the error exceeds its bound.
    """
    plan = study.plan
    assert plan is not None  # noqa: S101 - see `SampleKind.compute`
    parameters = _ranges(study)
    name = surrogate_name(study)
    folder = results.folder if results else None
    if folder:
        # Any other file of this name is replaced, see `open_directory`.
        with suppress(InputError):
            saved = read_surrogate(folder / name)
            if saved.identity == study.identity:
                return saved
    stages: list[xr.Dataset] = []
    errors = []
    for first, stop in plan.stages:
        drops = TrainingStudy(
            f"{study.name}_training_{stop}", "training", study.case, parameters,
            design="sobol", size=stop, seed=plan.seed, first=first,
        )  # fmt: skip
        if results:
            paths = {results.folder / file: read_identity for file in result_names(drops)}
            require_version(paths, drops, results)
        stages.append(compute_samples(drops, folder, options).load())
        surrogate = _learn(drops, stages, plan, study.identity)
        label, error = surrogate.worst
        errors.append(f"{error:.3g} dB with {stop}")
        if error <= plan.error:
            if results:
                results.write({name: surrogate.to_bytes()})
            return surrogate
    message = (
        f"the surrogate's error of the {label} is {', '.join(errors[-3:])} drops; allowed: up to "
        f"{plan.error:g} dB ([surrogate] error): narrower ranges without a jump of the results, "
        f"more drops than {plan.size} ([surrogate] size), or a larger error"
    )
    raise NumericalError(message)


def surrogate_name(study: SampleStudy) -> str:
    """Return the name of the file of a study's surrogate."""
    return f"{study.name}_surrogate.npz"


def _ranges(study: SampleStudy) -> tuple[Parameter, ...]:
    """Return the keys that vary among the samples, each with its minimum and maximum."""
    low: dict[str, float] = {}
    high: dict[str, float] = {}
    for start in range(0, study.count, _SCANNED):
        stop = min(start + _SCANNED, study.count)
        for name, values in study.key_columns(study.parameter_columns(start, stop)).items():
            key, _ = find_key(name, study.case)
            real = key.kind == "real" or (key.kind == "list" and not key.whole)
            if not real or key.group in _GROUPS_OF_RECORDS:
                refuse(
                    f"[surrogate] cannot learn {name}",
                    "parameters of ball, drop and model that are real numbers",
                )
            low[name] = min(low.get(name, np.inf), float(values.min()))
            high[name] = max(high.get(name, -np.inf), float(values.max()))
    return tuple(
        Parameter(low=low[name], high=high[name], name=name, key=find_key(name, study.case)[0])
        for name in low
    )


def _learn(
    drops: TrainingStudy, stages: list[xr.Dataset], plan: Plan, identity: dict[str, str]
) -> Surrogate:
    """Return the surrogate trained on the drops of some stages."""
    results = {
        name: np.concatenate([s[name].values for s in stages]) for name in stages[0].data_vars
    }
    failed = results["status"] != 0
    if failed.any():
        reason = results["reason"][failed][0]
        refuse(
            f"{failed.sum()} of {failed.size} drops of the surrogate have no result ({reason})",
            "ranges in which all drops have results",
        )
    peaks, counts = np.unique(results["peaks"], return_counts=True)
    if peaks.size > 1:
        listed = ", ".join(f"{p:.0f} in {n}" for p, n in zip(peaks, counts, strict=True))
        refuse(
            f"the number of peaks differs among the drops of the surrogate ({listed} drops)",
            "ranges in which it is the same: a count cannot be interpolated",
        )
    learned = {*SAMPLE_QUANTITIES, *LEVELS}
    quantities = {str(n): _decibels(str(n), v) for n, v in results.items() if n in learned}
    region = np.array([(p.low, p.high) for p in drops.parameters])
    points = unit_samples(drops.design, len(region), drops.size, drops.seed, 0, drops.size)
    points[:, region[:, 0] == region[:, 1]] = 0.0
    values = np.concatenate(list(quantities.values()), axis=1)
    outputs = {name: columns.shape[1] for name, columns in quantities.items()}
    blank = np.full((1, values.shape[1]), np.nan)
    surrogate = Surrogate(
        case=drops.case, keys=tuple(p.name for p in drops.parameters), region=region,
        outputs=outputs, bound=plan.error, peaks=int(peaks[0]), identity=identity, points=points,
        length=np.ones(len(region)), weights=blank, mean=blank[0], scale=blank[0], residuals=blank,
    )  # fmt: skip
    unknown = [
        n for n, v in zip(surrogate.labels, values.T, strict=True) if not np.isfinite(v).all()
    ]
    assessed = [
        n for n, j in zip(surrogate.labels, surrogate.assessed, strict=True) if j and n in unknown
    ]
    if assessed:
        refuse(
            f"{assessed[0]} is 0 or not known in some drops", "a model and ranges where it is known"
        )
    return replace(surrogate, **regress(points, values, surrogate.assessed))


def _decibels(name: str, values: Values) -> Values:
    """Return a quantity in dB, shape (n, count); NaN if any value has no logarithm."""
    if name in LEVELS:
        return values
    if (values <= 0).any():
        values = np.full_like(values, np.nan)
    result: Values = 20 * np.log10(values)[:, np.newaxis]
    return result


def regress(points: Values, values: Values, assessed: NDArray[np.bool_]) -> dict[str, Any]:
    """Return a Gaussian process through values at points in the unit cube.

    Correlation lengths and noise (of time steps, and of nodes that touch one by one) maximize the
    likelihood of the assessed quantities; the other quantities share them. Returns the
    fields length, weights, mean, scale and residuals of a `Surrogate`.
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
    residuals = np.where(varies | ~np.isfinite(mean), -weights / np.diag(inverse)[:, None], 0.0)
    return {
        "length": np.broadcast_to(signal.k2.length_scale, points.shape[1:]).astype(float),
        "weights": signal.k1.constant_value * weights,
        "mean": mean,
        "scale": scale,
        "residuals": residuals * np.where(np.isfinite(mean), scale, np.nan),
    }
