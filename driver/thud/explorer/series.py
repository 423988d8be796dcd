"""Series of numbers for the page: thinned out and rounded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

# Maximum number of points of a curve on the page.
MAX_POINTS = 400
# Length of the displayed time range divided by the contact time.
TIME_RANGE = 1.05
# Significant digits of numbers, and of curves.
DIGITS = 6
CURVE_DIGITS = 5


def curve(times: NDArray[np.float64], values: NDArray[np.float64]) -> dict[str, Any]:
    """Return a curve of at most `MAX_POINTS` points."""
    chosen = thin_out(np.arange(len(times)), MAX_POINTS)
    series = {"time": times, "value": values}
    return {name: to_json(row[chosen], CURVE_DIGITS) for name, row in series.items()}


def thin_out(indices: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    """Return at most `count` of the indices, evenly spaced, including the first and the last."""
    chosen = np.linspace(0, len(indices) - 1, min(len(indices), count)).astype(int)
    result: NDArray[np.intp] = indices[np.unique(chosen)]
    return result


def to_json(values: Iterable[float], digits: int = DIGITS) -> list[float | None]:
    """Return numbers for JSON, with None for NaN and infinity."""
    return [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in values]
