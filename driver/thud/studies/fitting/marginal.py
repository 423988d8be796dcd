"""Estimates from residuals of unknown noise, with effects that the model leaves out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.studies.fitting.inference import posterior

if TYPE_CHECKING:
    from thud.studies.arrays import Array


# Correlations of neighbors over which estimates are averaged, and the number of standard
# deviations of the noise for each.
CORRELATIONS = np.linspace(0.0, 0.95, 20)
N_DEVIATION = 20
# The standard deviations reach from that without the effects of any size, divided by this factor,
# to that with the effects, multiplied by it.
FACTOR = 2.0


@dataclass(frozen=True, eq=False)
class Marginal:
    """A step of the parameters to their best values, averaged over noise and effects.

    Attributes
    ----------
    shift : ndarray, shape (n,)
        Change of the parameters.
    covariance : ndarray, shape (n, n)
        Covariance of the parameters.
    effect, effect_covariance : ndarray, shapes (n_effect,) and (n_effect, n_effect)
        Sizes of the effects, and their covariance.
    deviation, correlation : float
        Standard deviation of the noise, and correlation of neighbors.
    """

    shift: Array
    covariance: Array
    effect: Array
    effect_covariance: Array
    deviation: float
    correlation: float

    def whiten(self, residual: Array) -> Array:
        """Return residuals of unit variance that are independent if they are this noise."""
        innovation = self.deviation * np.sqrt(1 - self.correlation**2)
        return np.asarray(_whiten(residual, self.correlation) / innovation)


def estimate_marginal(
    jacobian: Array, effects: Array, residual: Array, min_deviation: float
) -> Marginal:
    """Return the best step for residuals with noise of unknown size and color.

    Noise is a first-order autoregressive process; its standard deviation has the prior 1/s, the
    correlation of neighbors a uniform one. Effects have normal priors of mean 0 and variance 1.
    """
    count = jacobian.shape[1]
    evidence, means, covariances, noise = [], [], [], []
    for correlation in CORRELATIONS:
        slopes, shapes, rest = (_whiten(a, correlation) for a in (jacobian, effects, residual))
        inverse = np.linalg.pinv(slopes)
        # Of the noise for a given correlation, s, of whitened residuals of equal variance.
        information = np.linalg.slogdet(slopes.T @ slopes)[1]
        low, high = (
            max(_deviation(columns, rest), min_deviation)
            for columns in (np.hstack([slopes, shapes]), slopes)
        )
        deviations = np.geomspace(low / FACTOR, high * FACTOR, N_DEVIATION)
        # The deviations of another correlation may be spaced differently.
        information -= 2 * np.log(np.log(deviations[-1] / deviations[0]))
        for deviation in deviations:
            wrong = posterior(
                slopes / deviation, inverse * deviation, shapes / deviation, rest / deviation
            )
            evidence.append(
                wrong.evidence - 0.5 * information - (len(rest) - count) * np.log(deviation)
                + 0.5 * np.log1p(-correlation**2)
            )  # fmt: skip
            means.append(np.concatenate([wrong.shift - inverse @ rest, wrong.mean]))
            response = np.vstack([wrong.response, np.eye(shapes.shape[1])])
            spread = response @ wrong.covariance @ response.T
            spread[:count, :count] += deviation**2 * inverse @ inverse.T
            covariances.append(spread)
            noise.append([deviation / np.sqrt(1 - correlation**2), correlation])
    weight = np.exp(np.array(evidence) - max(evidence))
    weight /= weight.sum()
    values = np.array(means)
    mean = weight @ values
    about = values - mean
    covariance = np.tensordot(weight, covariances, 1) + (about.T * weight) @ about
    deviation, correlation = weight @ np.array(noise)
    return Marginal(
        mean[:count],
        covariance[:count, :count],
        mean[count:],
        covariance[count:, count:],
        float(deviation),
        float(correlation),
    )


def _deviation(columns: Array, residual: Array) -> float:
    """Return the standard deviation of what columns leave of a residual."""
    freedom = len(residual) - columns.shape[1]
    if freedom <= 0:
        return 0.0
    left = residual - columns @ np.linalg.lstsq(columns, residual)[0]
    return float(np.sqrt(left @ left / freedom))


def _whiten(values: Array, correlation: float) -> Array:
    """Return the innovations of an autoregressive process of unit innovations: [n, ...]."""
    result = values.copy()
    result[0] *= np.sqrt(1 - correlation**2)
    result[1:] -= correlation * values[:-1]
    return result
