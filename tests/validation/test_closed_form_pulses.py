"""Levels of sampled pulses against band energies of their closed-form spectra, at every usual rate.

Sampling adds the aliases of the spectrum. The norm of a band's sum lies within the sum of norms, so
the level errs by at most 20 lg(1 + norm of the aliases over norm of the spectrum), both known.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import quad

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

PEAK, DURATION = 1500.0, 0.02
BANDS = thud.get_bands("third")
ALIASES = np.arange(1, 400)


@dataclass(frozen=True)
class Pulse:
    """Force against time in units of the duration, magnitude of its spectrum, envelope of that."""

    force: Callable[[np.ndarray], np.ndarray]
    spectrum: Callable[[float], float]
    envelope: Callable[[np.ndarray], np.ndarray]

    def aliases(self, frequency: float, rate: float) -> float:
        """Return an upper bound of all aliases at a frequency, N s."""
        below, above = ALIASES * rate - frequency, ALIASES * rate + frequency
        # What is left falls at least like the square of the frequency.
        rest = self.envelope(above[-1:])[0] * ALIASES[-1]
        return float(np.sum(self.envelope(below) + self.envelope(above)) + 2 * rest)


def x(frequency: float) -> float:
    return frequency * DURATION


PULSES = {
    "half sine": Pulse(
        lambda s: np.sin(np.pi * s),
        lambda f: 2 / np.pi * abs(np.cos(np.pi * x(f)) / (1 - 4 * x(f) ** 2)),
        lambda f: 2 / np.pi / (4 * (f * DURATION) ** 2 - 1),
    ),
    "Hann": Pulse(
        lambda s: (1 - np.cos(2 * np.pi * s)) / 2,
        lambda f: abs(np.sinc(x(f)) / 2 / (1 - x(f) ** 2)),
        lambda f: 1 / (2 * np.pi * f * DURATION) / ((f * DURATION) ** 2 - 1),
    ),
    "triangle": Pulse(
        lambda s: 1 - np.abs(2 * s - 1),
        lambda f: np.sinc(x(f) / 2) ** 2 / 2,
        lambda f: 1 / 2 / (np.pi * f * DURATION / 2) ** 2,
    ),
}


def norm(function: Callable[[float], float], lower: float, upper: float) -> float:
    energy, _ = quad(lambda f: function(f) ** 2, lower, upper, epsrel=1e-10, limit=500)
    return PEAK * DURATION * float(np.sqrt(2 * energy))


@pytest.mark.parametrize("rate", [8e3, 44.1e3, 96e3])
@pytest.mark.parametrize("name", PULSES)
def test_pulse_has_the_levels_of_its_spectrum(
    name: str, rate: float, oracle: Callable[..., None]
) -> None:
    pulse = PULSES[name]
    # First touch between samples.
    part = (np.arange(int(0.03 * rate)) - 0.37) / rate / DURATION
    inside = (part > 0) & (part < 1)
    force = PEAK * np.where(inside, pulse.force(part), 0)
    found = thud.force_exposure_levels(force, rate, "third")
    for level, lower, upper in zip(found, BANDS.lower, BANDS.upper, strict=True):
        true = norm(pulse.spectrum, lower, upper)
        bound = 20 * np.log10(1 + norm(lambda f: pulse.aliases(f, rate), lower, upper) / true)
        oracle(
            "levels of sampled pulses, error over its bound by aliases",
            "closed form",
            (level - 20 * np.log10(true)) / (bound + 1e-6),
            1,
        )


@pytest.mark.parametrize("rate", [8e3, 24e3, 96e3])
def test_rectangle_errs_by_the_rule_of_trapezoids(rate: float, oracle: Callable[..., None]) -> None:
    # Whole intervals; the sample of a jump is the mean of its sides. The sum of the samples is then
    # the spectrum times x/tan x with x = pi f/rate.
    force = np.full(round(DURATION * rate) + 1, PEAK)
    force[[0, -1]] /= 2
    found = thud.force_exposure_levels(force, rate, "third")

    def spectrum(f: float) -> float:
        turn = np.pi * f / rate
        return float(np.sinc(x(f)) * turn / np.tan(turn))

    expected = [
        20 * np.log10(norm(spectrum, lower, upper))
        for lower, upper in zip(BANDS.lower, BANDS.upper, strict=True)
    ]
    oracle("levels of a sampled rectangle", "closed form", found - expected, 1e-6, "dB")
