"""Drops that differ from the others."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from thud.base.note import Note
from thud.level.estimate import NOISE, NORMAL_FACTOR
from thud.level.levels import get_bands

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.recordings.measured_drop import Drop
    from thud.recordings.recorded_levels import DropLevels

# Probability that any drop is marked if all differ by chance only.
SIGNIFICANCE = 0.05
# Quantities besides levels that are searched for outliers: attribute, title, size of the unit.
SEARCHED = (
    ("contact_time", "contact time, ms,", 1e-3),
    ("restitution", "restitution", 1.0),
    ("peak_force", "peak force, N,", 1.0),
)
# Maximum deviation due to rounding, in the unit of the values.
ROUNDING = 1e-9


def check(drops: Sequence[Drop], levels: DropLevels) -> tuple[Note, ...]:
    """Return a note on each drop that differs in a level, contact time, restitution or peak force.

    At 5 % for the levels of all bands together (Bonferroni), and at 5 % for all other quantities.
    """
    nominal, noise = get_bands(levels.bands).nominal, levels.contributions[NOISE]
    searched = [
        (values, levels.names, f"level at {band:g} Hz, dB,", own, SIGNIFICANCE / len(nominal))
        for band, values, own in zip(nominal, levels.level.T, noise.T, strict=True)
    ]
    for attribute, title, unit in SEARCHED:
        estimates = [getattr(drop, attribute) for drop in drops]
        values, own = np.array([(e.value, e.uncertainty) for e in estimates]).T / unit
        searched.append((values, levels.names, title, own, SIGNIFICANCE / len(SEARCHED)))
    return tuple(note for arguments in searched for note in find_outliers(*arguments))


def find_outliers(
    values: Sequence[float] | NDArray[np.float64],
    names: Sequence[str],
    quantity: str,
    uncertainty: Sequence[float] | NDArray[np.float64] | None = None,
    significance: float = SIGNIFICANCE,
) -> tuple[Note, ...]:
    """Return a note on each drop whose value differs from those of the other drops.

    Such a drop is marked, never excluded. The test is Grubbs' two-sided one, exact for three and
    more normal values; from ten values on, Rosner's generalization allows one outlier in five. The
    significance is the probability that any drop is marked if all differ by chance. Values that
    are not finite are ignored. A drop is not marked if it deviates by less than the expanded
    uncertainty of its value. Values and standard uncertainties have the shape (n_drop,).
    """
    data = np.asarray(values, dtype=np.float64)
    uncertainties = np.zeros(data.shape) if uncertainty is None else np.nan_to_num(uncertainty)
    remaining = np.flatnonzero(np.isfinite(data))
    tested: list[Note] = []
    last = 0
    # Two values are equally far from their mean.
    steps = max(1, len(remaining) // 5) if len(remaining) > 2 else 0  # noqa: PLR2004
    for step in range(steps):
        count = len(remaining)
        distances = np.abs(data[remaining] - data[remaining].mean())
        if distances.max() <= ROUNDING:
            break
        worst = int(remaining[np.argmax(distances)])
        score = float(distances.max() / data[remaining].std(ddof=1))
        quantile = stdtrit(count - 2, 1 - significance / (2 * count))
        critical = (count - 1) / math.sqrt(count * (1 + (count - 2) / quantile**2))
        others: dict[str, float | str] = {"quantity": quantity}
        others |= {"score": score, "critical": float(critical)}
        tested.append(Note("outlier", names[worst], float(data[worst]), others=others))
        remaining = remaining[remaining != worst]
        # Rosner: outliers are all values up to the last one that exceeds its critical value.
        if score > critical and distances.max() > NORMAL_FACTOR * uncertainties[worst]:
            last = step + 1
    return tuple(tested[:last])
