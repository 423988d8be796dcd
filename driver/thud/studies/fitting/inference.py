"""Covariance and identifiability of the parameters of a fit."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import stats
from scipy.linalg import qr

from thud.base.checks import refuse_value
from thud.base.note import Note

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.studies.arrays import Array


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
# Fraction of the maximum entry below which a message omits a parameter.
SMALL = 0.05


class Inference(NamedTuple):
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


class Posterior(NamedTuple):
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
    shift, spread : ndarray, shapes (n,) and (n, n)
        Change of the best parameters by the effects, and its covariance.
    evidence : float
        Logarithm of the likelihood of the residuals, up to a constant.
    """

    visible: Array
    mean: Array
    covariance: Array
    response: Array
    shift: Array
    spread: Array
    evidence: float


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
    spread = response @ covariance @ response.T
    return Posterior(visible, mean, covariance, response, response @ mean, spread, evidence)


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


def direction_note(
    names: Sequence[str], direction: Array, width: float = np.inf, confidence: float = 1.0
) -> Note:
    """Return the note on a direction by its relative half interval; infinite: no effect."""
    largest = np.abs(direction).max()
    entries = [
        (name, float(value / largest))
        for name, value in zip(names, direction, strict=True)
        if abs(value) > SMALL * largest
    ]
    sign = np.sign(entries[0][1])
    changes = [f"{name} {sign * value:+.2g} %" for name, value in entries]
    others: dict[str, float | str] = {
        "names": _join([name for name, _ in entries]),
        "changes": _join(changes),
        "product": _product(entries),
    }
    if np.isinf(width):
        return Note("not_identifiable" if len(entries) > 1 else "no_effect", others=others)
    code = "hardly_identifiable" if len(entries) > 1 else "hardly_known"
    size = 100 * width * largest
    return Note(code, value=float(size), unit="%", others={**others, "confidence": confidence})


def _join(words: Sequence[str]) -> str:
    return f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else words[0]


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
    quantile = (1 + confidence) / 2
    return float(stats.norm.ppf(quantile) if freedom is None else stats.t.ppf(quantile, freedom))


def require_confidence(confidence: object) -> None:
    """Raise InputError where a confidence is not between 0 and 1."""
    if not (isinstance(confidence, float | np.floating) and 0 < confidence < 1):
        refuse_value("confidence", confidence, "0 < confidence < 1")
