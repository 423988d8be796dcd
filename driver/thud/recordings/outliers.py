"""Drops that differ from the others."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from thud.level.estimate import NORMAL_FACTOR

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

# Probability that any drop is marked if all differ by chance only.
SIGNIFICANCE = 0.05
# Maximum deviation due to rounding, in the unit of the values.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Outlier:
    """A drop that differs from the others by more than chance: marked, never excluded.

    Attributes are the name of the drop, quantity and value, the deviation from the mean in standard
    deviations, and its critical value.
    """

    name: str
    quantity: str
    value: float
    score: float
    critical: float

    def __str__(self) -> str:
        """Return a sentence, with the decimals that tell the score from its critical value."""
        for decimals in range(2, 16):
            score, critical = f"{self.score:.{decimals}f}", f"{self.critical:.{decimals}f}"
            if score != critical:
                break
        return (
            f"{self.name}: {self.quantity} {self.value:.6g} lies {score} standard "
            f"deviations from the mean of the drops (Grubbs, 5 %: {critical})"
        )


def find_outliers(
    values: Sequence[float] | NDArray[np.float64],
    names: Sequence[str],
    quantity: str,
    uncertainty: Sequence[float] | NDArray[np.float64] | None = None,
    significance: float = SIGNIFICANCE,
) -> tuple[Outlier, ...]:
    """Return the drops whose value differs from those of the other drops.

    The test is Grubbs' two-sided one, exact for three and more normal values; from ten values on,
    Rosner's generalization allows one outlier in five values. The significance is the probability
    that any drop is marked if all differ by chance. Values that are not finite are ignored. A drop
    is not marked if it deviates by less than the expanded uncertainty of its value. Values and
    their standard uncertainties have the shape (n_drop,).
    """
    data = np.asarray(values, dtype=np.float64)
    uncertainties = np.zeros(data.shape) if uncertainty is None else np.nan_to_num(uncertainty)
    remaining = np.flatnonzero(np.isfinite(data))
    removed: list[Outlier] = []
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
        removed.append(Outlier(names[worst], quantity, float(data[worst]), score, critical))
        remaining = remaining[remaining != worst]
        # Rosner: outliers are all values up to the last one that exceeds its critical value.
        if score > critical and distance > NORMAL_FACTOR * uncertainties[worst]:
            last = step + 1
    return tuple(removed[:last])
