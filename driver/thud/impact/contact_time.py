"""Definition of the contact time (docs/recordings_theory.md, section 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.level.levels import low_pass

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from thud.base._schema import LevelsForce
    from thud.impact.floor_impact import FloorImpact
    from thud.impact.impact import Impact
    from thud.recordings.recording import Recording

    Array = NDArray[np.float64]

# A contact lasts from the first to the last time at which the moving average of the force reaches
# this fraction of the peak force.
THRESHOLD = 0.01
# Width of the moving average, s; it is narrower near first touch and release.
AVERAGING_WIDTH = 1e-4
# Shown time before and after a contact as a fraction of its duration.
MARGIN = 0.04


def contact_span(force: ArrayLike, sample_rate: float) -> tuple[float, float]:
    """Return the begin and the end of a contact as times after first touch, s.

    The force, N, shape (n_sample,), runs from first touch to release, without noise.
    """
    values = np.asarray(force, dtype=np.float64)
    time = np.arange(len(values)) / sample_rate
    mean = average_within(values[:, None], time, time, AVERAGING_WIDTH)[:, 0]
    threshold = THRESHOLD * values.max()
    above = np.nonzero(mean >= threshold)[0]
    ends = []
    for inside, outside in ((above[0], above[0] - 1), (above[-1], above[-1] + 1)):
        known = 0 <= outside < len(mean)
        fraction = (mean[inside] - threshold) / (mean[inside] - mean[outside]) if known else 0.0
        ends.append((inside + fraction * (outside - inside)) / sample_rate)
    return ends[0], ends[1]


def contact_force(
    impact: Impact | FloorImpact | Recording, kind: LevelsForce
) -> tuple[Array, Array]:
    """Return time since first touch, ms, and low-passed force, kN, during contact.

    Force plates record no higher frequencies (paper, section 3), at which meshes and modes ring.
    """
    time = impact.time - impact.touch_time
    recorded = low_pass(impact.force(kind), impact.sample_rate)
    end = time[recorded > THRESHOLD * recorded.max()][-1]
    shown = (time >= -MARGIN * end) & (time <= (1 + MARGIN) * end)
    return 1e3 * time[shown], 1e-3 * recorded[shown]


def average_within(values: Array, time: Array, centers: Array, width: float) -> Array:
    """Return moving averages of columns; intervals are cut off at the first and the last time.

    The values, shape (n_time, n_column), at uniformly spaced times are interpolated linearly.
    """
    step = time[1] - time[0]
    area = np.zeros_like(values)
    np.cumsum((values[1:] + values[:-1]) * (step / 2), axis=0, out=area[1:])
    low = np.maximum(centers - width / 2, time[0])
    high = np.minimum(centers + width / 2, time[-1])
    columns = [np.interp(high, time, column) - np.interp(low, time, column) for column in area.T]
    return np.asarray(np.stack(columns, axis=1) / (high - low)[:, None], dtype=np.float64)
