"""Drops that differ from the others."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from thud.base.note import Note
from thud.level.estimate import NORMAL_FACTOR

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

# Probability that any drop is marked if all differ by chance only.
SIGNIFICANCE = 0.05
# Maximum deviation due to rounding, in the unit of the values.
ROUNDING = 1e-9


def find_outliers(
    values: Sequence[float] | NDArray[np.float64],
    names: Sequence[str],
    quantity: str,
    uncertainty: Sequence[float] | NDArray[np.float64] | None = None,
    significance: float = SIGNIFICANCE,
) -> tuple[Note, ...]:
    """Return a note on each drop whose value differs from those of the other drops.

    Such a drop is marked, never excluded.

    The test is Grubbs' two-sided one, exact for three and more normal values; from ten values on,
    Rosner's generalization allows one outlier in five values. The significance is the probability
    that any drop is marked if all differ by chance. Values that are not finite are ignored. A drop
    is not marked if it deviates by less than the expanded uncertainty of its value. Values and
    their standard uncertainties have the shape (n_drop,).
    """
    data = np.asarray(values, dtype=np.float64)
    uncertainties = np.zeros(data.shape) if uncertainty is None else np.nan_to_num(uncertainty)
    remaining = np.flatnonzero(np.isfinite(data))
    removed: list[Note] = []
    last = 0
    for step in range(max(1, len(remaining) // 5)):
        count = len(remaining)
        if count < 3:  # noqa: PLR2004 - two values are equally far from their mean
            break
        mean, deviation = data[remaining].mean(), data[remaining].std(ddof=1)
        worst = int(remaining[np.argmax(np.abs(data[remaining] - mean))])
        distance = abs(data[worst] - mean)
        if distance <= ROUNDING:
            break
        quantile = stdtrit(count - 2, 1 - significance / (2 * count))
        critical = (count - 1) / math.sqrt(count) * quantile / math.sqrt(count - 2 + quantile**2)
        score = distance / deviation
        size: dict[str, float | str] = {
            "quantity": quantity,
            "score": float(score),
            "critical": float(critical),
        }
        removed.append(Note("outlier", names[worst], float(data[worst]), others=size))
        remaining = remaining[remaining != worst]
        # Rosner: outliers are all values up to the last one that exceeds its critical value.
        if score > critical and distance > NORMAL_FACTOR * uncertainties[worst]:
            last = step + 1
    return tuple(removed[:last])
