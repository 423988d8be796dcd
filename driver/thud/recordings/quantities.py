"""Quantities of a recording besides its levels: means over the drops, with their budgets."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from thud.base.note import Note
from thud.level.estimate import RECTANGULAR, UNKNOWN, Contribution, Estimate
from thud.level.levels import RECORDED_BAND, peak_count
from thud.recordings.measured_drop import (
    BOUNCES,
    DIFFERENCE,
    IMPULSE,
    MASS,
    RESTITUTION,
    shared_causes,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from thud.recordings.config import Config
    from thud.recordings.measured_drop import Drop

# Contribution of restitutions that differ by more than their uncertainties.
DISAGREEMENT = "impulse against bounces"
# Prominence of a counted peak as a fraction of the peak force, and the minimum of this prominence
# in standard deviations of the noise.
PROMINENCE = 0.1
MIN_PROMINENCE = 6.0


def drop_estimates(
    drops: Sequence[Drop],
    config: Config,
    calibration: float | None,
    not_stated: Mapping[str, tuple[str, ...]] | None = None,
) -> dict[str, Estimate]:
    """Return the quantities of a recording besides its levels, with their budgets.

    These are ``"contact_time"``, s, ``"restitution"``, ``"difference"`` of the restitutions by
    impulse and by bounces, ``"effective_mass"``, kg, ``"peaks"``, their count, ``"mass"``, stated
    or effective, kg, and ``"drop_height"``, m; NaN if unknown. `calibration` is the relative
    standard uncertainty of the force, and `not_stated` are contributions to each quantity.
    """
    causes = shared_causes(config, calibration)
    times = [drop.contact_time for drop in drops]
    # The flanks of all drops have the same shape: its error does not average out.
    common = min(time.uncertainty for time in times) if len(drops) > 1 else 0.0
    edges = Contribution("edges of the pulse", common)
    differences = [
        drop.restitutions.get(IMPULSE, UNKNOWN) - drop.restitutions.get(BOUNCES, UNKNOWN)
        for drop in drops
    ]
    difference = _mean(drops, DIFFERENCE, differences, causes)
    # If the methods differ by more than the uncertainty of the difference, either may be wrong: the
    # interval of the mean then includes both.
    half_width = abs(difference.value) if abs(difference.value) > difference.expanded else 0.0
    apart = Contribution(DISAGREEMENT, half_width / RECTANGULAR, divisor=RECTANGULAR)
    effective = _mean(drops, MASS, [drop.effective_mass for drop in drops], causes)
    mass = effective if config.mass is None else _stated(config.mass, config.mass_uncertainty)
    estimates = {
        "contact_time": _mean(drops, "contact_time", times, causes, edges),
        "restitution": _mean(drops, RESTITUTION, [d.restitution for d in drops], causes, apart),
        "difference": difference,
        "effective_mass": effective,
        "peaks": Estimate(float(np.max([_count_peaks(drop) for drop in drops]))),
        "mass": mass,
        "drop_height": _stated(config.height, config.height_uncertainty),
    }
    lacking = not_stated or {}
    return {name: replace(e, not_stated=lacking.get(name, ())) for name, e in estimates.items()}


def _mean(
    drops: Sequence[Drop],
    quantity: str,
    values: Sequence[Estimate],
    causes: Mapping[str, Contribution],
    *further: Contribution,
) -> Estimate:
    """Return the mean of the values of drops that are known, with the uncertainty that they share.

    `causes` are that of all drops by name, in its own unit, and `further` that of the mean.
    """
    pairs = zip(values, drops, strict=True)
    known = [(value, drop.shared_effects.get(quantity, {})) for value, drop in pairs
             if math.isfinite(value.value)]  # fmt: skip
    if not known:
        return UNKNOWN
    shared = [
        replace(
            causes.get(cause, Contribution(cause, 0.0)),
            uncertainty=abs(sum(effects.get(cause, 0.0) for _, effects in known)) / len(known),
        )
        for cause in dict.fromkeys(cause for _, effects in known for cause in effects)
    ]
    samples = [value.value for value, _ in known]
    noises = [value.uncertainty for value, _ in known]
    lines = [line for line in (*shared, *further) if line.uncertainty]
    return Estimate.of_drops(float(np.mean(samples)), samples, noises, lines)


def check_estimates(
    drops: Sequence[Drop], estimates: Mapping[str, Estimate], config: Config
) -> list[Note]:
    """Return what may be wrong with the quantities of `drop_estimates`."""
    notes = []
    restitution, difference = estimates["restitution"], estimates["difference"]
    known = sum(math.isfinite(drop.restitution.value) for drop in drops)
    if math.isnan(estimates["peaks"].value):
        notes.append(Note("peaks_unknown"))
    if 0 < known < len(drops):
        notes.append(Note("restitution_partly_known", value=known, high=len(drops)))
    outside = max(-restitution.value, restitution.value - 1)
    if outside > 0 and outside > restitution.expanded:
        notes.append(Note("restitution_impossible", value=restitution.value, low=0, high=1))
    elif abs(difference.value) > difference.expanded:
        others = {"mass": estimates["effective_mass"].value}
        value, high = difference.value, difference.expanded
        notes.append(Note("restitutions_differ", value=value, high=high, others=others))
    if config.mass is None and math.isfinite(estimates["mass"].value):
        notes.append(Note("effective_mass"))
    return notes


def _stated(value: float | None, uncertainty: float | None) -> Estimate:
    """Return a value stated by the laboratory, with its standard uncertainty if stated."""
    if value is None:
        return UNKNOWN
    stated = () if uncertainty is None else (Contribution("stated", uncertainty),)
    return Estimate.from_budget(value, *stated)


def _count_peaks(drop: Drop) -> float:
    """Return the number of peaks of the force; NaN if some may be noise or a ringing plate."""
    count = peak_count(drop.contact.gated, drop.contact.sample_rate)
    # Noise that is slower than the contact adds no peaks.
    background = drop.contact.background
    noise = background.deviation_between(1 / drop.contact_time.value, RECORDED_BAND)
    clear = PROMINENCE * drop.peak_force.value >= MIN_PROMINENCE * noise
    return float(count) if count == 1 or (clear and not drop.ringing) else math.nan
