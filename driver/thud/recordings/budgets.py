"""Quantities averaged over drops, with their uncertainty budgets after the GUM."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.note import Note
from thud.level.estimate import Contribution, Estimate
from thud.level.levels import RECORDED_BAND, peak_count
from thud.recordings.assumptions import ASSUMED
from thud.recordings.outliers import SIGNIFICANCE, find_outliers
from thud.recordings.recorded_levels import NOISE, REPEATABILITY, noise_exceeds
from thud.recordings.restitution import BOUNCES, IMPULSE, DropConditions

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from thud.recordings.config import Config
    from thud.recordings.measured_drop import Drop
    from thud.recordings.recorded_levels import AverageLevels

# Change of a level per relative change of a force, dB.
AMPLITUDE_DECIBEL = 20 / math.log(10)
# Uncertainties of levels that a laboratory may not have stated.
LEVEL_CAUSES = ("calibration", "resonance of the plate", "cutoff of the filter")
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


def average_estimates(estimates: Sequence[Estimate], *systematic: Contribution) -> Estimate:
    """Return the mean of one quantity over drops, without unknown values.

    The uncertainty of each estimate is its noise, which the repeatability of two or more drops
    includes; the larger of both counts (`noise_exceeds`). Systematic contributions (calibration,
    drop height) are shared by all drops; the average does not reduce them.
    """
    known = [estimate for estimate in estimates if math.isfinite(estimate.value)]
    if not known:
        return Estimate.unknown()
    count = len(known)
    values = np.array([estimate.value for estimate in known])
    noise = float(np.sqrt(np.sum([estimate.uncertainty**2 for estimate in known]))) / count
    contributions = [Contribution(NOISE, noise)]
    if count > 1:
        error = float(values.std(ddof=1)) / math.sqrt(count)
        exceeds = bool(noise_exceeds(error, noise, count))
        contributions = [
            Contribution(
                REPEATABILITY, error, count - 1, counted=not exceeds, divisor=math.sqrt(count)
            ),
            Contribution(NOISE, noise, counted=exceeds),
        ]
    return Estimate.from_budget(float(values.mean()), *contributions, *systematic)


def level_estimates(
    levels: AverageLevels,
    calibration: float | None = None,
    systematic: Mapping[str, NDArray[np.float64]] | None = None,
    not_stated: Sequence[str] = (),
) -> tuple[Estimate, ...]:
    """Return average levels with their budgets, dB, shape (n_band,).

    `calibration` is the relative standard uncertainty of the force, None if not stated;
    `systematic` are further standard uncertainties that all drops share, dB, shape (n_band,), by
    name, and `not_stated` uncertainties of the recording.
    """
    lacking = tuple(name for name in not_stated if name in LEVEL_CAUSES)
    count = len(levels.names)
    contributions = dict(levels.contributions)
    rectangular = ("method", "offset step", *ASSUMED)
    sizes: dict[str, dict[str, Any]] = {name: {"divisor": math.sqrt(3)} for name in rectangular}
    if count > 1:
        sizes[REPEATABILITY] = {"divisor": math.sqrt(count)}
    if calibration is not None:
        contributions["calibration"] = np.full(len(levels.level), AMPLITUDE_DECIBEL * calibration)
        sizes["calibration"] = {"size": calibration}
    contributions |= systematic or {}
    counted: dict[str, NDArray[np.bool_]] = {}
    if count > 1:
        exceeds = noise_exceeds(contributions[REPEATABILITY], contributions[NOISE], count)
        counted = {REPEATABILITY: ~exceeds, NOISE: exceeds}
    budgets = (
        [
            Contribution(
                name,
                float(values[band]),
                count - 1 if name == REPEATABILITY else math.inf,
                counted=name not in counted or bool(counted[name][band]),
                **sizes.get(name, {}),
            )
            for name, values in contributions.items()
        ]
        for band in range(len(levels.level))
    )
    return tuple(
        replace(
            Estimate.from_budget(float(level), *budget, upper_bound=bool(flag == "background")),
            not_stated=lacking,
        )
        for level, budget, flag in zip(levels.level, budgets, levels.flag, strict=True)
    )


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
    conditions = config.conditions(calibration)
    mass = _stated(config.mass, config.mass_uncertainty)
    by_impulse = any(IMPULSE in drop.restitutions for drop in drops)
    causes = {
        "restitution": ("drop height", *(("calibration", "mass") if by_impulse else ())),
        "mass": ("calibration", "drop height") if config.mass is None else ("mass",),
        "drop_height": ("drop height",),
    }
    estimates = {
        "contact_time": average_estimates(times, *edges),
        "restitution": average_restitution(drops, conditions)[0],
        "peaks": Estimate(float(np.max([_count_peaks(drop) for drop in drops]))),
        "mass": average_mass(drops, conditions) if config.mass is None else mass,
        "drop_height": _stated(config.height, config.height_uncertainty),
    }
    return {
        name: replace(
            estimate,
            not_stated=tuple(cause for cause in not_stated if cause in causes.get(name, ())),
        )
        for name, estimate in estimates.items()
    }


def check_restitution(drops: Sequence[Drop], conditions: DropConditions) -> tuple[Note, ...]:
    """Return a warning if the restitution is impossible, or impulse and bounces differ by more.

    They may differ by the expanded uncertainty of their difference.
    """
    mean, difference = average_restitution(drops, conditions)
    outside = max(-mean.value, mean.value - 1)
    if outside > 0 and outside > mean.expanded:
        return (Note("restitution_impossible", value=mean.value, low=0, high=1, effect=0.0),)
    if not abs(difference.value) > difference.expanded:
        return ()
    note = Note(
        "restitutions_differ", value=difference.value, high=difference.expanded, effect=0.0,
        others={"mass": average_mass(drops, conditions).value},
    )  # fmt: skip
    return (note,)


def average_restitution(
    drops: Sequence[Drop], conditions: DropConditions
) -> tuple[Estimate, Estimate]:
    """Return the restitution, and that by impulse minus that by bounces; NaN if unknown.

    If the methods differ by more than the expanded uncertainty of the difference, either may be
    wrong: a rectangular distribution with the difference as half width enters the budget of the
    mean, whose interval then includes both.
    """
    known = [drop for drop in drops if drop.restitutions]
    causes = dict.fromkeys(cause for drop in known for cause in drop.shared_effects)
    systematic = [
        _mean_effect(cause, [drop.shared_effects.get(cause, 0.0) for drop in known], conditions)
        for cause in causes
    ]
    comparable = [drop for drop in known if {IMPULSE, BOUNCES} <= set(drop.restitutions)]
    difference = _difference(comparable, conditions)
    if abs(difference.value) > difference.expanded:
        half_width = abs(difference.value)
        contribution = half_width / math.sqrt(3)
        systematic.append(
            Contribution("impulse against bounces", contribution, divisor=math.sqrt(3))
        )
    return average_estimates([drop.restitution for drop in known], *systematic), difference


def _difference(drops: Sequence[Drop], conditions: DropConditions) -> Estimate:
    differences = []
    effects: dict[str, list[float]] = {}
    for drop in drops:
        impulse, bounces = (drop.restitutions[name] for name in (IMPULSE, BOUNCES))
        combined = math.hypot(impulse.uncertainty, bounces.uncertainty)
        differences.append(Estimate(impulse.value - bounces.value, combined))
        shared = conditions.shared_effects(
            drop.restitutions, drop.impulse, drop.contact.quantization_impulse
        )
        for cause, effect in shared[IMPULSE].items():
            effects.setdefault(cause, []).append(effect - shared[BOUNCES].get(cause, 0.0))
    systematic = [_mean_effect(cause, values, conditions) for cause, values in effects.items()]
    return average_estimates(differences, *systematic)


def _mean_effect(cause: str, effects: Sequence[float], conditions: DropConditions) -> Contribution:
    return Contribution(cause, abs(float(np.mean(effects))), **conditions.sizes.get(cause, {}))


def average_mass(drops: Sequence[Drop], conditions: DropConditions) -> Estimate:
    """Return the effective mass with its budget, kg; NaN if bounces or height are unknown."""
    known = [drop for drop in drops if math.isfinite(drop.effective_mass.value)]
    if not known or not conditions.height:
        return Estimate.unknown()
    value = float(np.mean([drop.effective_mass.value for drop in known]))
    # m = J / (v0 + g (t_f/2 + t_c)): the height changes v0 only.
    velocity_change = float(np.mean([drop.impulse.value for drop in known])) / value
    height_effect = value * conditions.speed / velocity_change * conditions.height_uncertainty
    height_effect /= 2 * conditions.height
    impulses = [(drop.impulse.value, drop.contact.quantization_impulse) for drop in known]
    impulse, quantization_impulse = np.mean(impulses, axis=0)
    systematic = {
        "calibration": value * conditions.calibration_uncertainty,
        "drop height": height_effect,
        "quantization": value * float(quantization_impulse / impulse),
    }
    return average_estimates(
        [drop.effective_mass for drop in known],
        *(
            _mean_effect(cause, [effect], conditions)
            for cause, effect in systematic.items()
            if effect
        ),
    )


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
    force = drop.force[slice(*drop.gate)]
    count = peak_count(force, drop.sample_rate)
    # Noise that is slower than the contact adds no peaks.
    noise = drop.noise.deviation_between(1 / drop.contact_time.value, RECORDED_BAND)
    clear = PROMINENCE * drop.peak_force.value >= MIN_PROMINENCE * noise
    return float(count) if count == 1 or (clear and not drop.ringing) else math.nan
