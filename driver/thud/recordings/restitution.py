"""Restitution and effective mass by impulse and by bounces (docs/recordings_theory.md, 5).

The impulse needs the mass and a calibrated force, but no bounce in the record; the bounces need
neither. Where both are known, their difference shows a wrong mass, height or calibration.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import Drop
from thud.level.estimate import RECTANGULAR, Contribution, Estimate

if TYPE_CHECKING:
    from collections.abc import Mapping

    from thud.recordings.config import Config

    Values = Mapping[str, float]

# Gravity, m/s2, the default of the models.
GRAVITY = Drop.gravity
IMPULSE, BOUNCES, RESTITUTION, MASS = "impulse", "bounces", "restitution", "effective_mass"
# Restitution by the impulse minus that by the bounces.
DIFFERENCE = "difference"
# Maximum error of the measured release, s, and maximum height by which the center of a ball is
# lower or higher at the release than at first touch, m: finite elements, modal ball and shell have
# up to 0.5 ms, and -2 to 4 mm.
SLOW_RELEASE = 5e-4
DEFORMATION = 4e-3


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
    """Return how a ball returns after a contact, as far as mass, height and flight allow.

    These are the restitution by `IMPULSE` and by `BOUNCES`, their mean `RESTITUTION`, weighted by
    inverse variances, their `DIFFERENCE`, and the effective `MASS`, kg. Their uncertainties are
    those by the noise of the drop; also returned are the changes of each by one standard
    uncertainty of what all drops share (`shared_causes`, and quantization).

    The impulse is in N s; the duration of the contact, and the flight, s, are those between first
    touch and release. `quantization` is the standard uncertainty of the impulse by quantization of
    the background, N s. Uncertainties are propagated linearly (JCGM 100, 5.1.2), with slopes by
    central differences.
    """
    noise = {"impulse": impulse, "duration": duration}
    functions = {IMPULSE: _by_impulse} if config.height and config.mass else {}
    if flight:
        noise["flight"] = flight
        functions |= {BOUNCES: _by_flight, MASS: _effective_mass} if config.height else {}
    steps = {name: c.uncertainty for name, c in shared_causes(config, calibration).items()}
    steps["quantization"] = quantization
    steps |= {name: estimate.uncertainty for name, estimate in noise.items()}
    inputs = dict.fromkeys(steps, 0.0) | {name: e.value for name, e in noise.items()}
    inputs |= {"mass": config.mass or math.nan, "drop height": config.height or math.nan}
    values, effects = {}, {}
    for name, function in functions.items():
        values[name] = function(inputs)
        effects[name] = {
            cause: function({**inputs, cause: inputs[cause] + step / 2})
            - function({**inputs, cause: inputs[cause] - step / 2})
            for cause, step in steps.items()
        }
    methods = [method for method in (IMPULSE, BOUNCES) if method in values]
    weights = np.array([1 / max(math.hypot(*effects[m].values()), 1e-12) ** 2 for m in methods])
    combined = {RESTITUTION: weights / weights.sum()} if methods else {}
    if len(methods) == 2:  # noqa: PLR2004 - both
        combined[DIFFERENCE] = np.array([1, -1])
    for name, factors in combined.items():
        values[name] = float(factors @ [values[method] for method in methods])
        effects[name] = {
            cause: float(factors @ [effects[method][cause] for method in methods])
            for cause in steps
        }
    estimates = {
        name: Estimate(value, math.hypot(*(effects[name][cause] for cause in noise)))
        for name, value in values.items()
    }
    shared = {
        name: {cause: effect for cause, effect in row.items() if effect and cause not in noise}
        for name, row in effects.items()
    }
    return estimates, shared


def _by_impulse(values: Values) -> float:
    """Return (J - m g t)/(m v) - 1; a slow release makes the measured duration t too long."""
    speed = math.sqrt(2 * GRAVITY * values["drop height"])
    momentum = values["impulse"] * (1 + values["calibration"]) + values["quantization"]
    duration = values["duration"] - values["slow release"]
    return momentum / values["mass"] / speed - 1 - (GRAVITY * duration / speed)


def _by_flight(values: Values) -> float:
    """Return e = g T/(2 v); a flight from a height d lasts 2 e v/g + d/(e v)."""
    rise = GRAVITY * values["flight"] / 2
    speed = math.sqrt(2 * GRAVITY * values["drop height"])
    return (rise + GRAVITY * values["deformed ball"] / (2 * rise)) / speed


def _effective_mass(values: Values) -> float:
    """Return J/(v + g T/2 + g t), kg."""
    momentum = values["impulse"] * (1 + values["calibration"]) + values["quantization"]
    rise = GRAVITY * (values["flight"] / 2 + values["duration"])
    return momentum / (math.sqrt(2 * GRAVITY * values["drop height"]) + rise)
