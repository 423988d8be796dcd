"""Averages over drops with their uncertainty budgets after the GUM."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from thud.level.estimate import Contribution, Estimate
from thud.recordings.recorded_levels import WITHIN_REPEATABILITY

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from thud.recordings.recorded_levels import AverageLevels

# dB per relative change of a force.
AMPLITUDE_DECIBEL = 20 / math.log(10)


def average_estimates(
    estimates: Sequence[Estimate], *systematic: Contribution, own: str = "noise"
) -> Estimate:
    """Return the mean of one quantity over drops.

    Parameters
    ----------
    estimates
        Value of each drop and the standard uncertainty that differs from drop to drop; values
        that are not known are left out.
    systematic
        Contributions that all drops share, which an average does not reduce (calibration, height).
    own
        Name of the uncertainty of the drops. With two or more drops their scatter, the
        repeatability, holds it.
    """
    known = [e for e in estimates if math.isfinite(e.value)]
    if not known:
        return Estimate.unknown()
    count = len(known)
    values = np.array([e.value for e in known])
    noise = float(np.sqrt(np.sum([e.uncertainty**2 for e in known]))) / count
    parts = [Contribution(own, noise, counted=count == 1)]
    if count > 1:
        error = float(values.std(ddof=1)) / math.sqrt(count)
        parts.insert(0, Contribution("repeatability", error, count - 1))
    return Estimate.from_budget(float(values.mean()), *parts, *systematic)


def level_estimates(
    levels: AverageLevels,
    calibration: float | None = None,
    plate: NDArray[np.float64] | None = None,
) -> tuple[Estimate, ...]:
    """Return average levels with their budgets, dB, shape (n_band,).

    Parameters
    ----------
    levels
        Average over drops.
    calibration
        Relative standard uncertainty of the force; None where it is not known.
    plate : ndarray, shape (n_band,), optional
        Standard uncertainty from the correction of the force plate, dB; zero where that of its
        resonance is not stated.
    """
    count = len(levels.names)
    shared: dict[str, NDArray[np.float64]] = {}
    if calibration is not None:
        shared["calibration"] = np.full(len(levels.level), AMPLITUDE_DECIBEL * calibration)
    if plate is not None and plate.any():
        shared["plate"] = plate
    return tuple(
        Estimate.from_budget(
            float(levels.level[band]),
            *_level_contributions({**levels.contributions, **shared}, band, count),
            upper_bound=bool(levels.flag[band] == "background"),
        )
        for band in range(len(levels.level))
    )


def _level_contributions(
    parts: Mapping[str, NDArray[np.float64]], band: int, count: int
) -> list[Contribution]:
    """Return the contributions to the level of a band."""
    return [
        Contribution(
            name,
            float(part[band]),
            count - 1 if name == "repeatability" else math.inf,
            counted=count == 1 or name not in WITHIN_REPEATABILITY,
        )
        for name, part in parts.items()
    ]
