"""Restitution and effective mass by impulse and by bounces (docs/recordings_theory.md, 5)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from thud.base._schema import Drop
from thud.base.note import Note
from thud.level.estimate import RECTANGULAR, Estimate, Size

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    Values = Mapping[str, float]

# Gravity, m/s2, the default of the models.
GRAVITY = Drop.gravity
IMPULSE, BOUNCES, RESTITUTION, MASS = "impulse", "bounces", "restitution", "effective_mass"
# Maximum error of the measured release, s, and maximum height by
# which the center of a ball is lower or higher at the release than at first touch, m: finite
# elements, modal ball and shell have up to 0.5 ms, and -2 to 4 mm.
SLOW_RELEASE = 5e-4
DEFORMATION = 4e-3


class Rebound(NamedTuple):
    """How a ball returns after a contact.

    `restitutions` is the restitution by each method that can be applied, `restitution` their mean,
    and `mass` the effective mass, kg, with uncertainties by the noise of the drop. `shared` is the
    change of each of them, by name, by one standard uncertainty of what all drops share.
    """

    restitutions: dict[str, Estimate]
    restitution: Estimate
    mass: Estimate
    shared: dict[str, dict[str, float]]
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True)
class DropConditions:
    """Drop height and mass, with the standard uncertainties that all drops share.

    Attributes
    ----------
    height, mass : float or None
        Drop height of the lowest point, m, and mass, kg; None if unknown.
    calibration_uncertainty, mass_uncertainty, height_uncertainty : float
        Standard uncertainties of force (relative), mass, kg, and drop height, m.
    """

    height: float | None = None
    mass: float | None = None
    calibration_uncertainty: float = 0.0
    mass_uncertainty: float = 0.0
    height_uncertainty: float = 0.0

    @property
    def speed(self) -> float:
        """Velocity at first touch, m/s; NaN if the drop height is unknown."""
        return math.sqrt(2 * GRAVITY * self.height) if self.height else math.nan

    @property
    def sizes(self) -> dict[str, Size]:
        """Standard uncertainties, or half widths of rectangular distributions, by contribution."""
        return {
            "calibration": Size(self.calibration_uncertainty),
            "mass": Size(self.mass_uncertainty, "kg"),
            "drop height": Size(self.height_uncertainty, "m"),
            "slow release": Size(SLOW_RELEASE, "s", RECTANGULAR),
            "deformed ball": Size(DEFORMATION, "m", RECTANGULAR),
        }

    def rebound(
        self,
        impulse: Estimate,
        duration: Estimate,
        flights: Sequence[Estimate],
        quantization: float = 0.0,
    ) -> Rebound:
        """Return restitution and effective mass, as far as mass, height and flights allow.

        The impulse is in N s; the duration of the contact, and the flights, s, are those between
        first touch and release. `quantization` is the standard uncertainty of the impulse by
        quantization of the background, N s. Uncertainties are propagated linearly (JCGM 100,
        5.1.2), with slopes by central differences.
        """
        noise = {"impulse": impulse, "duration": duration}
        if flights:
            noise["flight"] = flights[0]
        functions = {IMPULSE: _by_impulse} if self.height and self.mass else {}
        if self.height and flights:
            functions |= {BOUNCES: _by_flight, MASS: _effective_mass}
        values = {"mass": self.mass or math.nan, "drop height": self.height or math.nan}
        shifts = {name: size.size / size.divisor for name, size in self.sizes.items()}
        shifts["quantization"] = quantization
        values = dict.fromkeys(shifts, 0.0) | values | {k: e.value for k, e in noise.items()}
        shifts |= {name: estimate.uncertainty for name, estimate in noise.items()}
        estimates: dict[str, Estimate] = {}
        shared: dict[str, dict[str, float]] = {}
        for name, function in functions.items():
            effects = {
                key: function({**values, key: values[key] + size / 2})
                - function({**values, key: values[key] - size / 2})
                for key, size in shifts.items()
            }
            uncertainty = math.hypot(*(effects.pop(key) for key in noise))
            estimates[name] = Estimate(function(values), uncertainty)
            shared[name] = {key: effect for key, effect in effects.items() if effect}
        mass = estimates.pop(MASS, Estimate.unknown())
        restitution, shared[RESTITUTION] = _weighted_mean(estimates, shared)
        if self.height or len(flights) < 2:  # noqa: PLR2004 - the ratio of two
            return Rebound(estimates, restitution, mass, shared)
        ratio = flights[1].value / flights[0].value
        note = Note("restitution_second", value=ratio, effect=0.0)
        return Rebound(estimates, restitution, mass, shared, (note,))


def _speed(values: Values) -> float:
    return math.sqrt(2 * GRAVITY * values["drop height"])


def _momentum(values: Values) -> float:
    return values["impulse"] * (1 + values["calibration"]) + values["quantization"]


def _by_impulse(values: Values) -> float:
    """Return (J - m g t)/(m v) - 1; a slow release makes the measured duration t too long."""
    duration = values["duration"] - values["slow release"]
    return (
        _momentum(values) / values["mass"] / _speed(values)
        - 1
        - (GRAVITY * duration / _speed(values))
    )


def _by_flight(values: Values) -> float:
    """Return e = g T/(2 v); a flight from a height d lasts 2 e v/g + d/(e v)."""
    rise = GRAVITY * values["flight"] / 2
    return (rise + GRAVITY * values["deformed ball"] / (2 * rise)) / _speed(values)


def _effective_mass(values: Values) -> float:
    """Return J/(v + g T/2 + g t), kg."""
    rise = GRAVITY * (values["flight"] / 2 + values["duration"])
    return _momentum(values) / (_speed(values) + rise)


def _weighted_mean(
    estimates: Mapping[str, Estimate], shared: Mapping[str, Mapping[str, float]]
) -> tuple[Estimate, dict[str, float]]:
    """Return the mean over the methods, and the shared effects on it.

    The weights are the inverse variances, shared effects included.
    """
    if not estimates:
        return Estimate.unknown(), {}
    weights = {
        name: 1 / (max(e.uncertainty, 1e-12) ** 2 + sum(u**2 for u in shared[name].values()))
        for name, e in estimates.items()
    }
    total = sum(weights.values())
    weights = {name: weight / total for name, weight in weights.items()}
    value = sum(weights[name] * estimate.value for name, estimate in estimates.items())
    uncertainty = math.hypot(*(weights[name] * e.uncertainty for name, e in estimates.items()))
    combined: dict[str, float] = {}
    for name, weight in weights.items():
        for cause, effect in shared[name].items():
            combined[cause] = combined.get(cause, 0.0) + weight * effect
    return Estimate(value, uncertainty), combined
