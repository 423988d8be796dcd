"""Criteria other than levels, from drops: values with their budgets."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from thud.level.estimate import Contribution, Estimate
from thud.level.levels import RECORDED_BAND, peak_count
from thud.recordings.averages import average_estimates
from thud.recordings.outliers import SIGNIFICANCE, find_outliers
from thud.recordings.restitution import BOUNCES, IMPULSE, DropConditions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.recordings.config import Config
    from thud.recordings.estimates import Drop
    from thud.recordings.outliers import Outlier

# Prominence of a peak that counts, as part of the peak force, and the least of it in standard
# deviations of the noise.
PROMINENCE = 0.1
CLEAR_PEAK = 6.0

# Quantities of drops, besides levels, that are compared, with words for them and their unit.
DEVIANT = (
    ("contact_time", "contact time, ms,", 1e-3),
    ("restitution", "restitution", 1.0),
    ("peak_force", "peak force, N,", 1.0),
)


def drop_estimates(
    drops: Sequence[Drop], config: Config, calibration: float | None
) -> dict[str, Estimate]:
    """Return contact time, restitution, peaks, mass and drop height, as `assess` names them.

    A mass that is not stated is the effective mass; `calibration` is the relative standard
    uncertainty of the force.
    """
    times = [drop.contact_time for drop in drops]
    # The flanks of all drops have one shape: what is wrong with it does not average.
    shared = min(time.uncertainty for time in times)
    edges = [Contribution("edges of the pulse", shared)] if len(times) > 1 else []
    fall = known_fall(config, calibration)
    mass = _stated(config.mass, config.mass_uncertainty)
    return {
        "contact_time": average_estimates(times, *edges),
        "restitution": average_restitution(drops, fall)[0],
        "peaks": Estimate(float(np.max([_peaks(drop) for drop in drops]))),
        "mass": average_mass(drops, fall) if config.mass is None else mass,
        "drop_height": _stated(config.height, config.height_uncertainty),
    }


def known_fall(config: Config, calibration: float | None) -> DropConditions:
    """Return what a laboratory says of its drops; what is not known counts as exact."""
    return DropConditions(
        config.height,
        config.mass,
        calibration or 0.0,
        config.mass_uncertainty or 0.0,
        config.height_uncertainty or 0.0,
    )


def told_restitution(
    drops: Sequence[Drop], config: Config, calibration: float | None
) -> tuple[str, ...]:
    """Return a sentence where impulse and bounces differ by more than their uncertainties."""
    fall = known_fall(config, calibration)
    _, difference = average_restitution(drops, fall)
    if not abs(difference.value) > difference.expanded:
        return ()
    mass = average_mass(drops, fall)
    told = (
        f"the restitution by impulse and by bounces differ by {difference.value:.3f}, with an "
        f"expanded uncertainty of {difference.expanded:.2g}; the effective mass is "
        f"{mass.value:.3f} kg: check mass, height and calibration"
    )
    return (told,)


def average_restitution(drops: Sequence[Drop], fall: DropConditions) -> tuple[Estimate, Estimate]:
    """Return the restitution, and impulse minus bounces, with their budgets; NaN where not known.

    Where the ways differ by more than the expanded uncertainty of the difference, one of them is
    wrong and nobody knows which: a rectangle as wide on each side as the difference is part of the
    uncertainty of their mean, so that its interval holds both.
    """
    known = [drop for drop in drops if drop.restitutions]
    names = dict.fromkeys(name for drop in known for name in drop.restitution_shared)
    shared = [
        Contribution(
            name, abs(float(np.mean([drop.restitution_shared.get(name, 0.0) for drop in known])))
        )
        for name in names
    ]
    difference = _difference([d for d in known if {IMPULSE, BOUNCES} <= set(d.restitutions)], fall)
    if abs(difference.value) > difference.expanded:
        shared.append(Contribution("impulse against bounces", abs(difference.value) / math.sqrt(3)))
    return average_estimates([drop.restitution for drop in known], *shared), difference


def _difference(drops: Sequence[Drop], fall: DropConditions) -> Estimate:
    """Return restitution by impulse minus that by bounces."""
    differences = []
    parts: dict[str, list[float]] = {}
    for drop in drops:
        by, other = (drop.restitutions[way] for way in (IMPULSE, BOUNCES))
        combined = math.hypot(by.uncertainty, other.uncertainty)
        differences.append(Estimate(by.value - other.value, combined))
        one, two = (fall.shared(drop.restitutions, drop.impulse)[w] for w in (IMPULSE, BOUNCES))
        for name in one:
            parts.setdefault(name, []).append(one[name] - two.get(name, 0.0))
    shared = [Contribution(name, abs(float(np.mean(found)))) for name, found in parts.items()]
    return average_estimates(differences, *shared)


def average_mass(drops: Sequence[Drop], fall: DropConditions) -> Estimate:
    """Return the effective mass with its budget, kg; NaN where bounces or height are not known."""
    known = [drop for drop in drops if math.isfinite(drop.effective_mass.value)]
    if not known or not fall.height:
        return Estimate.unknown()
    value = float(np.mean([drop.effective_mass.value for drop in known]))
    # Of m = J/(v0 + g (t_f/2 + t_c)), in which the height changes v0 alone.
    change = float(np.mean([drop.impulse.value for drop in known])) / value
    height = value * fall.speed / change * fall.height_uncertainty / (2 * fall.height)
    shared = {"calibration": value * fall.calibration, "drop height": height}
    return average_estimates(
        [drop.effective_mass for drop in known],
        *(Contribution(name, part) for name, part in shared.items() if part),
    )


def find_deviant(drops: Sequence[Drop]) -> tuple[Outlier, ...]:
    """Return the drops that differ in contact time, restitution or peak, at 5 % for all three."""
    names = [drop.name for drop in drops]
    found: list[Outlier] = []
    for attribute, words, unit in DEVIANT:
        ones = [getattr(drop, attribute) for drop in drops]
        found += find_outliers(
            [one.value / unit for one in ones],
            names,
            words,
            [one.uncertainty / unit for one in ones],
            SIGNIFICANCE / len(DEVIANT),
        )
    return tuple(found)


def _stated(value: float | None, uncertainty: float | None) -> Estimate:
    """Return what the laboratory states."""
    if value is None:
        return Estimate.unknown()
    stated = () if uncertainty is None else (Contribution("stated", uncertainty),)
    return Estimate.from_budget(value, *stated)


def _peaks(drop: Drop) -> float:
    """Return the number of peaks of the force of a drop; NaN where noise may have made some."""
    force = drop.force[slice(*drop.gate)]
    count = peak_count(force, drop.sample_rate)
    # Slower noise than the contact tilts the pulse, and makes no peak.
    noise = drop.noise.deviation_between(1 / drop.contact_time.value, RECORDED_BAND)
    clear = PROMINENCE * drop.peak_force.value >= CLEAR_PEAK * noise
    return float(count) if clear or count == 1 else math.nan
