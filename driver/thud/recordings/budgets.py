"""Quantities averaged over drops, with their uncertainty budgets after the GUM."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from thud.base.note import Note
from thud.level.estimate import RECTANGULAR, Contribution, Estimate
from thud.level.levels import RECORDED_BAND, peak_count
from thud.recordings.checks.outliers import SIGNIFICANCE, find_outliers
from thud.recordings.restitution import (
    BOUNCES,
    DIFFERENCE,
    IMPULSE,
    MASS,
    RESTITUTION,
    shared_causes,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from thud.recordings.config import Config
    from thud.recordings.measured_drop import Drop

# Contribution of restitutions that differ by more than their uncertainties.
DISAGREEMENT = "impulse against bounces"
# Prominence of a counted peak as a fraction of the peak force, and the minimum of this prominence
# in standard deviations of the noise.
PROMINENCE = 0.1
MIN_PROMINENCE = 6.0
# Quantities besides levels that are searched for outliers: attribute, title, size of the unit.
SEARCHED = (
    ("contact_time", "contact time, ms,", 1e-3),
    ("restitution", "restitution", 1.0),
    ("peak_force", "peak force, N,", 1.0),
)


def average_estimates(
    estimates: Sequence[Estimate], shared: Iterable[Contribution] = ()
) -> Estimate:
    """Return the mean of one quantity over drops, without unknown values, with its budget.

    The uncertainty of each estimate is its noise. `shared` is what all drops share (calibration,
    drop height).
    """
    known = [estimate for estimate in estimates if math.isfinite(estimate.value)]
    if not known:
        return Estimate.unknown()
    count = len(known)
    values = [estimate.value for estimate in known]
    noise = math.hypot(*(estimate.uncertainty for estimate in known)) / count
    scatter = float(np.std(values, ddof=1)) / math.sqrt(count) if count > 1 else math.nan
    stated = [contribution for contribution in shared if contribution.uncertainty]
    return Estimate.of_mean(float(np.mean(values)), noise, scatter, count, stated)


def drop_estimates(
    drops: Sequence[Drop],
    config: Config,
    calibration: float | None,
    not_stated: Sequence[str] = (),
) -> dict[str, Estimate]:
    """Return contact time, restitution, peak count, mass and drop height, as `assess` needs them.

    If no mass is stated, it is the effective mass; `calibration` is the relative standard
    uncertainty of the force, and `not_stated` are uncertainties of the recording.
    """
    times = [drop.contact_time for drop in drops]
    # The flanks of all drops have the same shape: its error does not average out.
    common = min(time.uncertainty for time in times)
    edges = [Contribution("edges of the pulse", common)] if len(times) > 1 else []
    by_impulse = any(IMPULSE in drop.restitutions for drop in drops)
    causes = {
        "restitution": ("drop height", *(("calibration", "mass") if by_impulse else ())),
        "mass": ("calibration", "drop height") if config.mass is None else ("mass",),
        "drop_height": ("drop height",),
    }
    mass = _stated(config.mass, config.mass_uncertainty)
    estimates = {
        "contact_time": average_estimates(times, edges),
        "restitution": average_restitution(drops, config, calibration)[0],
        "peaks": Estimate(float(np.max([_count_peaks(drop) for drop in drops]))),
        "mass": average_mass(drops, config, calibration) if config.mass is None else mass,
        "drop_height": _stated(config.height, config.height_uncertainty),
    }
    return {
        name: replace(
            estimate,
            not_stated=tuple(cause for cause in not_stated if cause in causes.get(name, ())),
        )
        for name, estimate in estimates.items()
    }


def check_restitution(
    drops: Sequence[Drop], config: Config, calibration: float | None
) -> tuple[Note, ...]:
    """Return a warning if the restitution is impossible, or impulse and bounces differ by more.

    They may differ by the expanded uncertainty of their difference.
    """
    mean, difference = average_restitution(drops, config, calibration)
    outside = max(-mean.value, mean.value - 1)
    if outside > 0 and outside > mean.expanded:
        return (Note("restitution_impossible", value=mean.value, low=0, high=1),)
    if not abs(difference.value) > difference.expanded:
        return ()
    note = Note(
        "restitutions_differ", value=difference.value, high=difference.expanded,
        others={"mass": average_mass(drops, config, calibration).value},
    )  # fmt: skip
    return (note,)


def average_restitution(
    drops: Sequence[Drop], config: Config, calibration: float | None
) -> tuple[Estimate, Estimate]:
    """Return the restitution, and that by impulse minus that by bounces; NaN if unknown.

    If the methods differ by more than the expanded uncertainty of the difference, either may be
    wrong: a rectangular distribution with the difference as half width enters the budget of the
    mean, whose interval then includes both.
    """
    both = [drop for drop in drops if {IMPULSE, BOUNCES} <= set(drop.restitutions)]
    pairs = [(drop.restitutions[IMPULSE], drop.restitutions[BOUNCES]) for drop in both]
    differences = [
        Estimate(one.value - other.value, math.hypot(one.uncertainty, other.uncertainty))
        for one, other in pairs
    ]
    difference = average_estimates(differences, _shared(both, DIFFERENCE, config, calibration))
    known = [drop for drop in drops if drop.restitutions]
    shared = _shared(known, RESTITUTION, config, calibration)
    if abs(difference.value) > difference.expanded:
        half_width = abs(difference.value)
        shared.append(Contribution(DISAGREEMENT, half_width / RECTANGULAR, divisor=RECTANGULAR))
    return average_estimates([drop.restitution for drop in known], shared), difference


def average_mass(drops: Sequence[Drop], config: Config, calibration: float | None) -> Estimate:
    """Return the effective mass with its budget, kg; NaN if bounces or height are unknown."""
    known = [drop for drop in drops if math.isfinite(drop.effective_mass.value)]
    shared = _shared(known, MASS, config, calibration)
    return average_estimates([drop.effective_mass for drop in known], shared)


def _shared(
    drops: Sequence[Drop], quantity: str, config: Config, calibration: float | None
) -> list[Contribution]:
    """Return what drops share in the uncertainty of the mean of a restitution or a mass."""
    effects = [drop.shared_effects.get(quantity, {}) for drop in drops]
    causes = shared_causes(config, calibration)
    return [
        replace(
            causes.get(name, Contribution(name, 0.0)),
            uncertainty=abs(sum(effect.get(name, 0.0) for effect in effects)) / len(effects),
        )
        for name in dict.fromkeys(name for effect in effects for name in effect)
    ]


def find_deviant(drops: Sequence[Drop]) -> tuple[Note, ...]:
    """Return outliers in contact time, restitution or peak force, at 5 % for all three together."""
    names = [drop.name for drop in drops]
    outliers: list[Note] = []
    for attribute, title, unit in SEARCHED:
        estimates = [getattr(drop, attribute) for drop in drops]
        outliers += find_outliers(
            [estimate.value / unit for estimate in estimates],
            names,
            title,
            [estimate.uncertainty / unit for estimate in estimates],
            SIGNIFICANCE / len(SEARCHED),
        )
    return tuple(outliers)


def _stated(value: float | None, uncertainty: float | None) -> Estimate:
    """Return a value stated by the laboratory, with its standard uncertainty if stated."""
    if value is None:
        return Estimate.unknown()
    stated = () if uncertainty is None else (Contribution("stated", uncertainty),)
    return Estimate.from_budget(value, *stated)


def _count_peaks(drop: Drop) -> float:
    """Return the number of peaks of the force; NaN if some may be noise or a ringing plate."""
    count = peak_count(drop.contact.gated, drop.sample_rate)
    # Noise that is slower than the contact adds no peaks.
    background = drop.contact.background
    noise = background.deviation_between(1 / drop.contact_time.value, RECORDED_BAND)
    clear = PROMINENCE * drop.peak_force.value >= MIN_PROMINENCE * noise
    return float(count) if count == 1 or (clear and not drop.ringing) else math.nan
