"""Differences between samples of a force, which tell noise, steps and lost samples apart."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Deviation of a sample from the cubic through the samples 2 and 3 away from it, as a weighted sum.
FROM_CUBIC = np.array([0.4, -0.9, 0.0, 1.0, 0.0, -0.9, 0.4])


# Minimum noise as a fraction of the peak: smaller steps of quantization are not known.
MIN_NOISE = 4e-5
# Minimum jump in quantization steps.
MIN_STEPS = 3.5
# Number of samples of the running median that leaves out spikes of one or two.
MEDIAN = 5


def robust_deviation(values: NDArray[np.float64]) -> float:
    """Return the standard deviation of normal values about zero, by their median magnitude."""
    return 1.4826 * float(np.median(np.abs(values)))


def runs(force: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return first index and length of each run of equal values."""
    starts = np.flatnonzero(np.diff(force, prepend=np.nan) != 0)
    return starts, np.diff(np.append(starts, len(force)))


def noise_deviation(force: NDArray[np.float64]) -> float:
    """Return the standard deviation of the white noise of a force, N, by its median."""
    deviation = np.convolve(force, FROM_CUBIC, mode="valid")
    return robust_deviation(deviation) / math.sqrt(float(FROM_CUBIC @ FROM_CUBIC))


def largest_beside(values: NDArray[np.float64], near: int, far: int) -> NDArray[np.float64]:
    """Return the largest of the values from near to far samples before and after, [2, n]."""
    extended = np.pad(values, far, mode="edge")
    largest = sliding_window_view(extended, far - near + 1).max(axis=1)
    return np.stack([largest[: len(values)], largest[-len(values) :]])
