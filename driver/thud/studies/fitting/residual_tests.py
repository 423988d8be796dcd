"""Tests of the residuals of a fit, each with the probability `UNLIKELY` of a false warning."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from thud.base.note import Note

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.studies.arrays import Array


# Probability of a false warning by one test.
UNLIKELY = 1e-3
# Fewer residuals have no test of their color, and parts of them no test of their size.
MIN_TESTED = 20
MIN_FREEDOM = 5
# Number of bands of frequency in which the size of residuals is determined.
N_BAND = 4


def misfit_ratio(residual: Array) -> float:
    """Return the root mean square of residuals of unit variance; at least 1.

    Of four bands of frequency that with the largest residuals counts: a model is wrong in one.
    """
    power = np.abs(np.fft.rfft(residual)[1:]) ** 2 / len(residual)
    bands = [band.mean() for band in np.array_split(power, N_BAND) if len(band)]
    return float(np.sqrt(max(1.0, np.mean(residual**2), *bands)))


def size_warning(residual: Array, freedom: float, noise_freedom: int | None) -> list[Note]:
    """Return a warning if residuals of known variance are too large (chi-square, or Fisher's F).

    `noise_freedom` are the degrees of freedom of the data that determine the noise; None: it is
    stated.
    """
    square = float(residual @ residual)
    tail = (
        stats.chi2.sf(square, freedom)
        if noise_freedom is None
        else stats.f.sf(square / freedom, freedom, noise_freedom)
    )
    return [] if tail > UNLIKELY else [Note("unexplained", value=math.sqrt(square / freedom))]


def color_warning(residual: Array) -> list[Note]:
    """Return a warning if residuals at uniform positions are not independent noise.

    The cumulative periodogram (Bartlett) is uniform for white noise.
    """
    if len(residual) < MIN_TESTED:
        return []
    power = np.abs(np.fft.rfft(residual)[1:]) ** 2
    share = np.cumsum(power) / power.sum()
    result = stats.kstest(share[:-1], "uniform")
    if result.pvalue > UNLIKELY:
        return []
    fraction = float(np.searchsorted(share, 0.5) / len(power))
    side = "low" if fraction < 0.5 else "high"  # noqa: PLR2004 - halves
    value = min(fraction, 1 - fraction)
    return [Note("residuals_colored", value=value, others={"side": side})]


def contact_warning(
    residual: Array, inside: NDArray[np.bool_], count: int, unit: float
) -> list[Note]:
    """Return a warning if residuals during contact exceed those before and after it (F).

    `count` parameters are fitted; `unit` is the unit of the residuals, N.
    """
    inside_count, outside_count = int(inside.sum()) - count, int((~inside).sum())
    if min(inside_count, outside_count) < MIN_FREEDOM:
        return []
    square = float((residual[inside] ** 2).sum()) / inside_count
    outside = float((residual[~inside] ** 2).sum()) / outside_count
    if square < stats.f.isf(UNLIKELY, inside_count, outside_count) * outside:
        return []
    value, high = (unit * math.sqrt(part) for part in (square, outside))
    return [Note("residuals_in_contact", value=value, high=high, unit="N")]
