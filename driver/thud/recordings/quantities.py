"""Quantities of a recording besides its levels: of each drop, and their means with budgets.

A drop has two restitutions (docs/recordings_theory.md, 5). That by the impulse needs the mass and a
calibrated force, but no bounce in the record; that by the bounces needs neither. Where both are
known, their difference shows a wrong mass, height or calibration.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import Drop as DropKeys
from thud.base.note import Note
from thud.level.estimate import RECTANGULAR, UNKNOWN, Contribution, Estimate
from thud.level.levels import RECORDED_BAND, peak_count

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from thud.recordings.config import Config
    from thud.recordings.measured_drop import Drop

# Gravity, m/s2, the default of the models.
GRAVITY = DropKeys.gravity
IMPULSE, BOUNCES, RESTITUTION, MASS = "impulse", "bounces", "restitution", "effective_mass"
# Restitution by the impulse minus that by the bounces.
DIFFERENCE = "difference"
# Maximum error of the measured release, s, and maximum height by which the center of a ball is
# lower or higher at the release than at first touch, m: finite elements, modal ball and shell have
# up to 0.5 ms, and -2 to 4 mm.
SLOW_RELEASE = 5e-4
DEFORMATION = 4e-3
# Contribution of restitutions that differ by more than their uncertainties.
DISAGREEMENT = "impulse against bounces"
# Prominence of a counted peak as a fraction of the peak force, and the minimum of this prominence
# in standard deviations of the noise.
PROMINENCE = 0.1
MIN_PROMINENCE = 6.0


def shared_causes(config: Config, calibration: float | None) -> dict[str, Contribution]:
    """Return what is uncertain in all drops alike, in its own unit, by name.

    `calibration` is the relative standard uncertainty of the force. One that is not stated is zero.
    """
    causes = (
        ("calibration", calibration or 0.0, "", 1.0),
        ("mass", config.mass_uncertainty or 0.0, "kg", 1.0),
        ("drop height", config.height_uncertainty or 0.0, "m", 1.0),
        ("slow release", SLOW_RELEASE, "s", RECTANGULAR),
        ("deformed ball", DEFORMATION, "m", RECTANGULAR),
    )
    return {
        name: Contribution(name, size / divisor, size=size, unit=unit, divisor=divisor)
        for name, size, unit, divisor in causes
    }


def measure_rebound(  # noqa: PLR0913, PLR0917 - what is measured, and what is stated
    impulse: Estimate,
    duration: Estimate,
    flight: Estimate | None,
    config: Config,
    calibration: float | None = None,
    quantization: float = 0.0,
) -> tuple[dict[str, Estimate], dict[str, dict[str, float]]]:
    """Return how a ball returns after a contact; NaN if mass, height or flight do not allow it.

    These are the restitution by `IMPULSE` and by `BOUNCES`, their mean `RESTITUTION`, weighted by
    inverse variances, their `DIFFERENCE`, and the effective `MASS`, kg. Their uncertainties are
    those by the noise of the drop; also returned are the changes of each by one standard
    uncertainty of what all drops share (`shared_causes`, and quantization).

    The impulse is in N s; the duration of the contact, and the flight, s, are those between first
    touch and release. `quantization` is the standard uncertainty of the impulse by quantization of
    the background, N s. Uncertainties are propagated linearly (JCGM 100, 5.1.2), with slopes by
    central differences.
    """
    noise = {"impulse": impulse, "duration": duration, "flight": flight or UNKNOWN}
    steps = {name: c.uncertainty for name, c in shared_causes(config, calibration).items()}
    steps["quantization"] = quantization
    steps |= {name: estimate.uncertainty for name, estimate in noise.items()}
    inputs = dict.fromkeys(steps, 0.0) | {name: e.value for name, e in noise.items()}
    inputs |= {"mass": config.mass or math.nan, "drop height": config.height or math.nan}
    values = _rebound(inputs)
    effects: dict[str, dict[str, float]] = {name: {} for name in values}
    for cause, step in steps.items():
        low, high = (
            _rebound({**inputs, cause: inputs[cause] + half}) for half in (-step / 2, step / 2)
        )
        for name in values:
            effects[name][cause] = high[name] - low[name]
    methods = [method for method in (IMPULSE, BOUNCES) if math.isfinite(values[method])]
    weights = np.array([1 / max(math.hypot(*effects[m].values()), 1e-12) ** 2 for m in methods])
    for name, factors, used in (
        (RESTITUTION, weights / weights.sum(), methods),
        (DIFFERENCE, np.array([1, -1]), [IMPULSE, BOUNCES]),
    ):
        values[name] = float(factors @ [values[method] for method in used]) if methods else math.nan
        effects[name] = {
            cause: float(factors @ [effects[method][cause] for method in used]) for cause in steps
        }
    estimates = {
        name: Estimate(value, math.hypot(*(effects[name][cause] for cause in noise)))
        for name, value in values.items()
    }
    shared = {
        name: {cause: effect for cause, effect in row.items() if effect and cause not in noise}
        for name, row in effects.items()
        if math.isfinite(values[name])
    }
    return estimates, shared


def _rebound(values: Mapping[str, float]) -> dict[str, float]:
    """Return the restitution by impulse and by bounces, and the effective mass.

    By the impulse it is (J - m g t)/(m v) - 1, where a slow release makes the measured duration t
    too long; by bounces e = g T/(2 v), where a flight from a height d lasts 2 e v/g + d/(e v). The
    mass is J/(v + g T/2 + g t).
    """
    # A stated uncertainty may exceed its value.
    height, mass = (max(values[name], 1e-6) for name in ("drop height", "mass"))
    speed = math.sqrt(2 * GRAVITY * height)
    momentum = values["impulse"] * (1 + values["calibration"]) + values["quantization"]
    duration = values["duration"] - values["slow release"]
    rise = GRAVITY * values["flight"] / 2
    return {
        IMPULSE: momentum / mass / speed - 1 - GRAVITY * duration / speed,
        BOUNCES: (rise + GRAVITY * values["deformed ball"] / (2 * rise)) / speed,
        MASS: momentum / (speed + rise + GRAVITY * values["duration"]),
    }


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
