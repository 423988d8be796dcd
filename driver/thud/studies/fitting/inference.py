"""Covariance and identifiability of the parameters of a fit, and tests of its residuals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats
from scipy.linalg import qr

from thud.base.checks import refuse_value
from thud.base.note import Note

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Columns of the Jacobian with a smaller norm over that of the target, or a larger relative error,
# are zero.
NO_EFFECT = 1e-9
UNRESOLVED = 0.5
# Singular values of the Jacobian below this fraction of the maximum, or below this many of its own
# errors, are zero.
MIN_RATIO = 1e-6
ERRORS = 3.0
# Entries of a unit vector below this are zero.
NEGLIGIBLE = 1e-3
# Correlations that are reported, and above which two parameters cannot be separated in practice:
# errors of the model exceed the difference of their effects.
STRONG = 0.9
INSEPARABLE = 0.998
# Probability of a false warning by one test.
UNLIKELY = 1e-3
# Fewer residuals are not tested.
MIN_TESTED = 20
# Number of bands of frequency in which the size of residuals is determined.
N_BAND = 4
# Fraction of the maximum entry below which a message omits a parameter.
SMALL = 0.05


@dataclass(frozen=True, eq=False)
class Inference:
    """Covariance of scaled parameters, and directions that are not identifiable.

    Attributes
    ----------
    covariance : ndarray, shape (n, n)
        For residuals of unit variance; infinite where a parameter is not identifiable.
    singular_values : ndarray, shape (n,)
        Of the Jacobian with columns of unit length, in descending order.
    null : ndarray, shape (n_null, n)
        Changes that leave the residuals as they are, of the fewest parameters.
    inverse : ndarray, shape (n, m)
        Pseudoinverse of the Jacobian.
    """

    covariance: Array
    singular_values: Array
    null: Array
    inverse: Array


def infer(jacobian: Array, finer: Array, size: float) -> Inference:
    """Return covariance, singular values and null directions.

    `jacobian`, shape (m, n), holds derivatives of weighted residuals by scaled parameters, `finer`
    the same with another step: their difference is the error. `size` is the norm of the target.
    """
    count = jacobian.shape[1]
    length = np.linalg.norm(jacobian, axis=0)
    change = np.linalg.norm(jacobian - finer, axis=0)
    dead = (length <= NO_EFFECT * size) | (change > UNRESOLVED * length)
    length[dead] = 1.0
    error = np.max(change / length, where=~dead, initial=0.0)
    rows = len(jacobian)
    relative = np.pad(np.where(dead, 0.0, jacobian / length), ((0, max(0, count - rows)), (0, 0)))
    left, values, turned = np.linalg.svd(relative, full_matrices=False)
    lost = values <= max(MIN_RATIO, ERRORS * error) * values[0]
    known = turned[~lost] / values[~lost, np.newaxis]
    covariance = known.T @ known / np.outer(length, length)
    unknown = (np.abs(turned[lost]) > NEGLIGIBLE).any(axis=0)
    covariance[unknown] = covariance[:, unknown] = np.nan
    covariance[unknown, unknown] = np.inf
    inverse = known.T @ left[:rows, ~lost].T / length[:, np.newaxis]
    return Inference(covariance, values, _sparse(turned[lost] / length), inverse)


@dataclass(frozen=True, eq=False)
class Posterior:
    """Sizes of effects that a model leaves out, each with a normal prior of mean 0 and variance 1.

    Attributes
    ----------
    visible : ndarray, shape (m, n_effect)
        Effects on the residuals of unit variance that no change of the parameters makes.
    mean : ndarray, shape (n_effect,)
        Posterior means.
    covariance : ndarray, shape (n_effect, n_effect)
        Posterior covariance.
    response : ndarray, shape (n, n_effect)
        Change of the best parameters by a unit of each effect.
    evidence : float
        Logarithm of the likelihood of the residuals, up to a constant.
    """

    visible: Array
    mean: Array
    covariance: Array
    response: Array
    evidence: float

    @property
    def shift(self) -> Array:
        """Change of the best parameters by the effects, (n,)."""
        return np.asarray(self.response @ self.mean)

    @property
    def spread(self) -> Array:
        """Covariance of the parameters due to what is not known of the effects, (n, n)."""
        return np.asarray(self.response @ self.covariance @ self.response.T)


def posterior(jacobian: Array, inverse: Array, effects: Array, residual: Array) -> Posterior:
    """Return the sizes of effects in residuals, model minus target, of unit variance.

    `inverse` is the pseudoinverse of the Jacobian, shape (m, n), of the parameters.
    """
    response = -inverse @ effects
    visible = effects + jacobian @ response
    # Rows of zeros make the axes complete.
    extra = max(0, effects.shape[1] - len(residual))
    left, size, axes = np.linalg.svd(np.pad(visible, ((0, extra), (0, 0))), full_matrices=False)
    seen = left[: len(residual)].T @ residual
    mean = -axes.T @ (size / (1 + size**2) * seen)
    covariance = axes.T / (1 + size**2) @ axes
    rest = residual - jacobian @ (inverse @ residual)
    square = rest @ rest - seen**2 @ (size**2 / (1 + size**2))
    evidence = -0.5 * float(square + np.log1p(size**2).sum())
    return Posterior(visible, mean, covariance, response, evidence)


def _sparse(rows: Array) -> Array:
    """Return another basis of the same space, with one entry that is not 0 in each pivot column."""
    if not len(rows):
        return rows
    # The parameters that vary most represent the directions.
    _, _, order = qr(rows, pivoting=True)
    basis = np.linalg.solve(rows[:, order[: len(rows)]], rows)
    result: Array = basis / np.abs(basis).max(axis=1, keepdims=True)
    return result


def worst_directions(covariance: Array, maximum: float) -> list[tuple[float, Array]]:
    """Return directions whose standard deviation exceeds a maximum, with that deviation."""
    finite = np.flatnonzero(np.isfinite(np.diag(covariance)))
    variances, vectors = np.linalg.eigh(covariance[np.ix_(finite, finite)])
    result = []
    for variance, vector in zip(variances[::-1], vectors.T[::-1], strict=True):
        if variance > maximum**2:
            direction = np.zeros(len(covariance))
            direction[finite] = vector
            result.append((float(np.sqrt(variance)), direction))
    return result


def null_note(names: Sequence[str], direction: Array) -> Note:
    """Return the note on a direction that is not identifiable."""
    entries = _main_entries(names, direction)
    code = "not_identifiable" if len(entries) > 1 else "no_effect"
    return Note(code, others=_direction(entries))


def weak_note(names: Sequence[str], direction: Array, width: float, confidence: float) -> Note:
    """Return the note on a direction with a wide relative half interval, `width`."""
    entries = _main_entries(names, direction)
    size = 100 * width * max(abs(value) for _, value in entries)
    code = "hardly_identifiable" if len(entries) > 1 else "hardly_known"
    others: dict[str, float | str] = {**_direction(entries), "confidence": confidence}
    return Note(code, value=size, unit="%", others=others)


def pair_notes(names: Sequence[str], correlation: Array, minimum: float) -> list[Note]:
    """Return notes on pairs with at least a minimum correlation, the strongest first."""
    strong = np.triu(np.nan_to_num(np.abs(correlation)), 1)
    pairs = sorted(np.argwhere(strong >= minimum).tolist(), key=lambda pair: -strong[*pair])
    result = []
    for i, j in pairs:
        size = strong[i, j]
        # 1.00 would hide a difference.
        digits = int(np.clip(np.ceil(-np.log10(max(1 - size, 1e-9))), 2, 9))
        code = "inseparable" if size >= INSEPARABLE else "hardly_separable"
        shown = f"{correlation[i, j]:.{digits}f}".replace("-", "−")
        others = {"first": names[i], "second": names[j], "shown": shown}
        result.append(Note(code, value=float(correlation[i, j]), others=others))
    return result


def identifiability(
    names: Sequence[str], covariance: Array, correlation: Array, count: int
) -> list[Note]:
    """Return how well parameters can be separated, from the covariance of their relative values.

    The first `count` parameters are those of the model.
    """
    result = []
    directions = worst_directions(covariance[:count, :count], 0.0)
    if len(directions) > 1:
        (worst, direction), (best, _) = directions[0], directions[-1]
        entries = _main_entries(names[:count], direction)
        size = 100 * worst * max(abs(float(value)) for value in direction)
        change = _direction(entries)["changes"] if len(entries) > 1 else entries[0][0]
        others: dict[str, float | str] = {"changes": change, "ratio": worst / best}
        result.append(Note("weakest_combination", value=size, unit="%", others=others))
    return result + pair_notes(names, correlation, STRONG)


def _main_entries(names: Sequence[str], direction: Array) -> list[tuple[str, float]]:
    """Return names and entries of a direction without negligible ones; the maximum is 1."""
    largest = np.abs(direction).max()
    result = [
        (name, float(value / largest))
        for name, value in zip(names, direction, strict=True)
        if abs(value) > SMALL * largest
    ]
    sign = np.sign(result[0][1])
    return [(name, sign * value) for name, value in result]


def _join(words: Sequence[str]) -> str:
    return f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else words[0]


def _direction(entries: Sequence[tuple[str, float]]) -> dict[str, str]:
    """Return the values of a note on a direction: its parameters, changes, and their product."""
    return {
        "names": _join([name for name, _ in entries]),
        "changes": _join([f"{name} {value:+.2g} %" for name, value in entries]),
        "product": _product(entries),
    }


def _product(entries: Sequence[tuple[str, float]]) -> str:
    """Return the product of powers that two parameters determine."""
    if len(entries) != 2:  # noqa: PLR2004 - a pair determines one product of powers
        return ""
    (first, a), (second, b) = entries
    power = -a / b
    return f"; only {first} * {second}^{power:.3g} is determined, close to these values"


def coverage_factor(confidence: float, freedom: int | None) -> float:
    """Return the half width of a two-sided interval in standard errors.

    It is Student's t, or normal where the noise is known (`freedom` is None).
    """
    require_confidence(confidence)
    quantile = (1 + confidence) / 2
    return float(stats.norm.ppf(quantile) if freedom is None else stats.t.ppf(quantile, freedom))


def require_confidence(confidence: object) -> None:
    """Raise InputError where a confidence is not between 0 and 1."""
    if not (isinstance(confidence, float | np.floating) and 0 < confidence < 1):
        refuse_value("confidence", confidence, "0 < confidence < 1")


def misfit_ratio(residual: Array) -> float:
    """Return the root mean square of residuals of unit variance; at least 1.

    Of four bands of frequency that with the largest residuals counts: a model is wrong in one.
    """
    power = np.abs(np.fft.rfft(residual)[1:]) ** 2 / len(residual)
    bands = [band.mean() for band in np.array_split(power, N_BAND) if len(band)]
    return float(np.sqrt(max(1.0, np.mean(residual**2), *bands)))


def residual_warnings(residual: Array, position: Array, unit: str = "ms") -> list[Note]:
    """Return warnings if residuals at uniform times, s, or positions, m, are not independent noise.

    `unit` is a thousandth of that of the position.
    """
    if len(residual) < MIN_TESTED:
        return []
    return [
        *_color_warning(residual),
        *_outlier_warning(residual, position, unit),
        *runs_warning(residual),
    ]


def _color_warning(residual: Array) -> list[Note]:
    """Test the cumulative periodogram (Bartlett), which is uniform for white noise."""
    power = np.abs(np.fft.rfft(residual)[1:]) ** 2
    share = np.cumsum(power) / power.sum()
    result = stats.kstest(share[:-1], "uniform")
    if result.pvalue > UNLIKELY:
        return []
    fraction = float(np.searchsorted(share, 0.5) / len(power))
    side = "low" if fraction < 0.5 else "high"  # noqa: PLR2004 - halves
    value = min(fraction, 1 - fraction)
    return [Note("residuals_colored", value=value, others={"side": side})]


def _outlier_warning(residual: Array, position: Array, unit: str) -> list[Note]:
    """Test the largest of n normal residuals by n times its probability (Bonferroni)."""
    index = int(np.argmax(np.abs(residual)))
    size = abs(float(residual[index]))
    if 2 * len(residual) * stats.norm.sf(size) > UNLIKELY:
        return []
    others = {"position": 1e3 * float(position[index])}
    return [Note("residual_large", value=size, unit=unit, others=others)]


def runs_warning(residual: Array) -> list[Note]:
    """Return a warning if residuals have too few or many runs of one sign (Wald, Wolfowitz)."""
    positive = residual > 0
    n, m = int(positive.sum()), int((~positive).sum())
    if not min(n, m):
        return [] if 2 * 0.5 ** (n + m) > UNLIKELY else [Note("residuals_one_sign", value=n + m)]
    product = 2 * n * m
    expected = 1 + product / (n + m)
    deviation = np.sqrt(product * (product - n - m) / (n + m - 1)) / (n + m)
    runs = 1 + int(np.count_nonzero(positive[1:] != positive[:-1]))
    if 2 * stats.norm.sf(abs(runs - expected) / deviation) > UNLIKELY:
        return []
    return [Note("residuals_dependent", value=runs - 1, others={"expected": expected - 1})]
