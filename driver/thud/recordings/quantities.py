"""Criteria other than levels, from drops: values with their budgets."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from thud.levels import RECORDED_BAND, peak_count
from thud.recordings.verdict import Contribution, Quantity, average_estimates

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.recordings.config import Config
    from thud.recordings.estimates import Drop

# Prominence of a peak that counts, as part of the peak force, and the least of it in standard
# deviations of the noise.
PROMINENCE = 0.1
CLEAR_PEAK = 6.0


def drop_quantities(drops: Sequence[Drop], config: Config) -> dict[str, Quantity]:
    """Return contact time, restitution, peaks, mass and drop height, as `decide` names them."""
    shares = [drop.restitution_calibration for drop in drops if drop.restitution_by]
    share = float(np.mean(shares)) if shares else 0.0
    times = [drop.contact_time for drop in drops]
    # The flanks of all drops have one shape: what is wrong with it does not average.
    shared = min(time.uncertainty for time in times)
    edges = [Contribution("edges of the pulse", shared)] if len(times) > 1 else []
    return {
        "contact_time": average_estimates(times, *edges),
        "restitution": average_estimates(
            [drop.restitution for drop in drops],
            *([Contribution("calibration", share)] if share else []),
        ),
        "peaks": Quantity(float(np.max([_peaks(drop) for drop in drops]))),
        "mass": Quantity(math.nan if config.mass is None else config.mass),
        "drop_height": Quantity(math.nan if config.height is None else config.height),
    }


def _peaks(drop: Drop) -> float:
    """Return the number of peaks of the force of a drop; NaN where noise may have made some."""
    force = drop.force[slice(*drop.gate)]
    count = peak_count(force, drop.sample_rate)
    # Slower noise than the contact tilts the pulse, and makes no peak.
    noise = drop.noise.deviation_between(1 / drop.contact_time.value, RECORDED_BAND)
    clear = PROMINENCE * drop.peak_force.value >= CLEAR_PEAK * noise
    return float(count) if clear or count == 1 else math.nan
