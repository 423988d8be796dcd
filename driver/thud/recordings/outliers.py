"""Drops that differ from the others."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

# Probability that a drop that differs by chance is marked.
SIGNIFICANCE = 0.05
# Expanded uncertainty (95 %) over the standard uncertainty.
EXPANDED = 1.96
# Deviation due to rounding, in the unit of the values, which marks no drop.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Outlier:
    """A drop that differs from the others by more than chance: marked, never excluded.

    Name of the drop, quantity and value, deviation from the mean in standard deviations, and the
    largest one that chance explains.
    """

    name: str
    quantity: str
    value: float
    score: float
    critical: float

    def __str__(self) -> str:
        """Return a sentence."""
        return (
            f"{self.name}: {self.quantity} {self.value:.6g} lies {self.score:.2f} standard "
            f"deviations from the mean of the drops (Grubbs, 5 %: {self.critical:.2f})"
        )


def find_outliers(
    values: Sequence[float] | NDArray[np.float64],
    names: Sequence[str],
    quantity: str,
    uncertainty: Sequence[float] | NDArray[np.float64] | None = None,
    significance: float = SIGNIFICANCE,
) -> tuple[Outlier, ...]:
    """Return the drops whose value differs from that of the others.

    Grubbs' two-sided test, exact for three and more normal values; with ten or more values,
    Rosner's generalization searches one outlier in five. The significance is the probability that a
    drop is marked if all differ by chance. Values that are not finite are excluded, and a deviation
    within the expanded uncertainty (1.96 times the standard one) of the value itself marks no drop.
    Values and their standard uncertainties have the shape (n_drop,).
    """
    data = np.asarray(values, dtype=np.float64)
    uncertainties = np.zeros(data.shape) if uncertainty is None else np.nan_to_num(uncertainty)
    remaining = np.flatnonzero(np.isfinite(data))
    removed: list[Outlier] = []
    last = 0
    for step in range(max(1, len(remaining) // 5)):
        count = len(remaining)
        if count < 3:  # noqa: PLR2004 - two values have the same distance from their mean
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
        # Rosner: all up to the last that exceeds its critical value are outliers.
        if score > critical and distance > EXPANDED * uncertainties[worst]:
            last = step + 1
    return tuple(removed[:last])
