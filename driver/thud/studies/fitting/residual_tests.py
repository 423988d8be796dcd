"""Tests of weighted residuals: independent and of unit variance if all assumptions hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Probability of a false warning by one test.
UNLIKELY = 1e-3
# Fewer residuals are not tested.
MIN_TESTED = 20


def residual_doubts(residual: Array, time: Array) -> list[str]:
    """Return what the residuals of equally spaced times, s, show beside independent noise."""
    if len(residual) < MIN_TESTED:
        return []
    return [
        told for told in (_colour(residual), _largest(residual, time), runs_doubt(residual)) if told
    ]


def _colour(residual: Array) -> str:
    """Test the cumulative periodogram (Bartlett): of white noise it is that of uniform numbers."""
    power = np.abs(np.fft.rfft(residual)[1:]) ** 2
    share = np.cumsum(power) / power.sum()
    found = stats.kstest(share[:-1], "uniform")
    if found.pvalue > UNLIKELY:
        return ""
    place = np.searchsorted(share, 0.5) / len(power)
    side = "low" if place < 0.5 else "high"  # noqa: PLR2004 - halves
    return (
        f"the residuals are coloured: half of their power lies in the {side}est "
        f"{min(place, 1 - place):.0%} of the compared frequencies: the noise or the model is not "
        "what is assumed, and the intervals do not hold"
    )


def _largest(residual: Array, time: Array) -> str:
    """Test the largest of n normal residuals: n times its probability (Bonferroni)."""
    place = int(np.argmax(np.abs(residual)))
    size = abs(float(residual[place]))
    if 2 * len(residual) * stats.norm.sf(size) > UNLIKELY:
        return ""
    return (
        f"the largest residual, at {1e3 * time[place]:.4g} ms, is {size:.3g} standard deviations: "
        "it is no noise, and the intervals do not hold"
    )


def runs_doubt(residual: Array) -> str:
    """Return that residuals have too few or many runs of one sign (Wald and Wolfowitz), or ""."""
    positive = residual > 0
    n, m = int(positive.sum()), int((~positive).sum())
    if not min(n, m):
        expected, deviation = 1.0, 0.0
    else:
        product = 2 * n * m
        expected = 1 + product / (n + m)
        deviation = np.sqrt(product * (product - n - m) / (n + m - 1)) / (n + m)
    runs = 1 + int(np.count_nonzero(positive[1:] != positive[:-1]))
    if min(n, m) and 2 * stats.norm.sf(abs(runs - expected) / deviation) > UNLIKELY:
        return ""
    return (
        f"the residuals change their sign {runs - 1} times where {expected - 1:.0f} are expected: "
        "they are not independent, and the intervals do not hold"
    )
