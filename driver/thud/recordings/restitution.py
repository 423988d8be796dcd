"""Restitution and effective mass by impulse and by bounces (docs/recordings_theory.md, 5)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from thud.base._schema import Drop
from thud.base.note import Note
from thud.level.estimate import RECTANGULAR, Estimate, Size

if TYPE_CHECKING:
    from collections.abc import Sequence

# Gravity, m/s2, the default of the models.
GRAVITY = Drop.gravity
IMPULSE, BOUNCES = "impulse", "bounces"
# Maximum error of the measured release, s, and maximum height by
# which the center of a ball is lower or higher at the release than at first touch, m: finite
# elements, modal ball and shell have up to 0.5 ms, and -2 to 4 mm.
SLOW_RELEASE = 5e-4
DEFORMATION = 4e-3


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
            "impulse against bounces": Size(divisor=RECTANGULAR),
        }

    def restitutions(
        self, impulse: Estimate, duration: Estimate, flights: Sequence[Estimate]
    ) -> tuple[dict[str, Estimate], tuple[Note, ...]]:
        """Return the restitution by each method that can be applied, and notes.

        The duration of the contact, and the flights, are those between first touch and release.
        """
        methods: dict[str, Estimate] = {}
        speed = self.speed
        if self.height and self.mass:
            momentum = self.mass * speed
            value = impulse.value / momentum - 1 - GRAVITY * duration.value / speed
            uncertainties = (
                impulse.uncertainty / momentum,
                GRAVITY * duration.uncertainty / speed,
            )
            methods[IMPULSE] = Estimate(value, math.hypot(*uncertainties))
        if self.height and flights:
            scale = GRAVITY / (2 * speed)
            methods[BOUNCES] = Estimate(scale * flights[0].value, scale * flights[0].uncertainty)
        elif len(flights) > 1:
            first, second = flights[:2]
            ratio = second.value / first.value
            return methods, (Note("restitution_second", value=ratio, effect=0.0),)
        return methods, ()

    def shared_effects(
        self, methods: dict[str, Estimate], impulse: Estimate, quantization_impulse: float = 0.0
    ) -> dict[str, dict[str, float]]:
        """Return the change of each restitution due to one standard uncertainty of each cause.

        `quantization_impulse` is that of the impulse by quantization of the background, N s.
        """
        effects: dict[str, dict[str, float]] = {}
        relative_speed_uncertainty = (
            self.height_uncertainty / (2 * self.height) if self.height else 0.0
        )
        if IMPULSE in methods:
            ratio = impulse.value / ((self.mass or math.nan) * self.speed)
            effects[IMPULSE] = {
                "calibration": ratio * self.calibration_uncertainty,
                "mass": -ratio * self.mass_uncertainty / (self.mass or math.nan),
                "drop height": -(1 + methods[IMPULSE].value) * relative_speed_uncertainty,
                "slow release": GRAVITY * SLOW_RELEASE / self.speed / RECTANGULAR,
                "quantization": ratio * quantization_impulse / impulse.value,
            }
        if BOUNCES in methods:
            value = methods[BOUNCES].value
            # A flight from a height d: t_f = 2 v1/g + d/v1.
            lift = GRAVITY * DEFORMATION / (2 * value * self.speed**2)
            effects[BOUNCES] = {
                "drop height": -value * relative_speed_uncertainty,
                "deformed ball": lift / RECTANGULAR,
            }
        return effects

    def mean(
        self, methods: dict[str, Estimate], impulse: Estimate, quantization_impulse: float = 0.0
    ) -> tuple[Estimate, dict[str, float]]:
        """Return the weighted mean over the methods, and the shared effects on this mean.

        The weights are the inverse variances, shared effects included. The uncertainty of the mean
        does not include the shared effects.
        """
        if not methods:
            return Estimate.unknown(), {}
        effects = self.shared_effects(methods, impulse, quantization_impulse)
        deviations = {name: max(estimate.uncertainty, 1e-12) for name, estimate in methods.items()}
        weights = {
            name: 1 / (deviations[name] ** 2 + sum(effect**2 for effect in effects[name].values()))
            for name in methods
        }
        total = sum(weights.values())
        weights = {name: weight / total for name, weight in weights.items()}
        value = sum(weights[name] * estimate.value for name, estimate in methods.items())
        uncertainty = math.hypot(*(weights[name] * deviations[name] for name in methods))
        combined: dict[str, float] = {}
        for name, by_cause in effects.items():
            for cause, effect in by_cause.items():
                combined[cause] = combined.get(cause, 0.0) + weights[name] * effect
        return Estimate(value, uncertainty), {k: effect for k, effect in combined.items() if effect}

    def effective_mass(
        self, impulse: Estimate, duration: Estimate, restitution: Estimate | None
    ) -> Estimate:
        """Return J / (v0 (1 + e) + g t_c), kg, from impulse J and restitution e by bounces."""
        if restitution is None or not self.height:
            return Estimate.unknown()
        speed = self.speed
        velocity_change = speed * (1 + restitution.value) + GRAVITY * duration.value
        value = impulse.value / velocity_change
        uncertainties = (
            impulse.uncertainty / velocity_change,
            value * speed * restitution.uncertainty / velocity_change,
            value * GRAVITY * duration.uncertainty / velocity_change,
        )
        return Estimate(value, math.hypot(*uncertainties))
