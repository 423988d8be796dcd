"""Restitution and effective mass, by impulse and by bounces (docs/recordings_theory.md, 5)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from thud.base._schema import Drop
from thud.level.estimate import Estimate

if TYPE_CHECKING:
    from collections.abc import Sequence

# Acceleration of free fall, m/s2: that of a model by default.
GRAVITY = Drop.gravity
IMPULSE, BOUNCES = "impulse", "bounces"


@dataclass(frozen=True)
class DropConditions:
    """What is known of a drop.

    Attributes
    ----------
    height, mass : float or None
        Drop height of the lowest point, m, and mass, kg.
    calibration, mass_uncertainty, height_uncertainty : float
        Standard uncertainties, which all drops share: of the force, relative, and in kg and m.
    """

    height: float | None = None
    mass: float | None = None
    calibration: float = 0.0
    mass_uncertainty: float = 0.0
    height_uncertainty: float = 0.0

    @property
    def speed(self) -> float:
        """Velocity at first touch, m/s; NaN without the height."""
        return math.sqrt(2 * GRAVITY * self.height) if self.height else math.nan

    def restitutions(
        self, impulse: Estimate, contact_time: Estimate, flights: Sequence[Estimate]
    ) -> tuple[dict[str, Estimate], tuple[str, ...]]:
        """Return the restitution by each way that is known, and warnings."""
        ways: dict[str, Estimate] = {}
        speed = self.speed
        if self.height and self.mass:
            momentum = self.mass * speed
            value = impulse.value / momentum - 1 - GRAVITY * contact_time.value / speed
            parts = (impulse.uncertainty / momentum, GRAVITY * contact_time.uncertainty / speed)
            ways[IMPULSE] = Estimate(value, math.hypot(*parts))
        if self.height and flights:
            scale = GRAVITY / (2 * speed)
            ways[BOUNCES] = Estimate(scale * flights[0].value, scale * flights[0].uncertainty)
        elif len(flights) > 1:
            one, two = flights[:2]
            told = (
                f"the restitution of the first bounce is {two.value / one.value:.3f}; that of the "
                "drop itself is not known without the drop height"
            )
            return ways, (told,)
        return ways, ()

    def shared(self, ways: dict[str, Estimate], impulse: Estimate) -> dict[str, dict[str, float]]:
        """Return what calibration, mass and drop height make of each way, signed."""
        found: dict[str, dict[str, float]] = {}
        height = self.height_uncertainty / (2 * self.height) if self.height else 0.0
        if IMPULSE in ways:
            ratio = impulse.value / ((self.mass or math.nan) * self.speed)
            found[IMPULSE] = {
                "calibration": ratio * self.calibration,
                "mass": -ratio * self.mass_uncertainty / (self.mass or math.nan),
                "drop height": -(1 + ways[IMPULSE].value) * height,
            }
        if BOUNCES in ways:
            found[BOUNCES] = {"drop height": -ways[BOUNCES].value * height}
        return found

    def mean(
        self, ways: dict[str, Estimate], impulse: Estimate
    ) -> tuple[Estimate, dict[str, float]]:
        """Return the mean of the ways, and what all drops share of its uncertainty.

        The weights are 1/uncertainty2, that of the shared parts included; the uncertainty of the
        mean is without them.
        """
        if not ways:
            return Estimate.unknown(), {}
        shared = self.shared(ways, impulse)
        own = {way: max(one.uncertainty, 1e-12) for way, one in ways.items()}
        weight = {
            way: 1 / (own[way] ** 2 + sum(part**2 for part in shared[way].values())) for way in ways
        }
        total = sum(weight.values())
        weight = {way: one / total for way, one in weight.items()}
        value = sum(weight[way] * one.value for way, one in ways.items())
        own_part = math.hypot(*(weight[way] * one for way, one in own.items()))
        parts: dict[str, float] = {}
        for way, found in shared.items():
            for name, part in found.items():
                parts[name] = parts.get(name, 0.0) + weight[way] * part
        return Estimate(value, own_part), {name: part for name, part in parts.items() if part}

    def effective_mass(
        self, impulse: Estimate, contact_time: Estimate, restitution: Estimate | None
    ) -> Estimate:
        """Return impulse over (v0 (1 + e) + g t_c), kg, e from bounces."""
        if restitution is None or not self.height:
            return Estimate.unknown()
        speed = self.speed
        change = speed * (1 + restitution.value) + GRAVITY * contact_time.value
        value = impulse.value / change
        parts = (
            impulse.uncertainty / change,
            value * speed * restitution.uncertainty / change,
            value * GRAVITY * contact_time.uncertainty / change,
        )
        return Estimate(value, math.hypot(*parts))
