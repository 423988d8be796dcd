"""Band energies against adaptive quadrature of the record's own Fourier transform."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import quad

import thud

if TYPE_CHECKING:
    from collections.abc import Callable


def quadrature_level(force: np.ndarray, sample_rate: float, lower: float, upper: float) -> float:
    time = np.arange(len(force)) / sample_rate

    def density(frequency: float) -> float:
        return float(np.abs(np.sum(force * np.exp(-2j * np.pi * frequency * time))) ** 2)

    energy, _ = quad(density, lower, upper, epsabs=0, epsrel=1e-11, limit=2000)
    return float(10 * np.log10(2 * energy / sample_rate**2))


NOISE = np.random.default_rng(1).normal(size=3000)


@pytest.mark.parametrize("bands", ["octave", "third"])
def test_exact_levels_are_the_integral(bands: str, oracle: Callable[..., None]) -> None:
    force = NOISE
    edges = thud.get_bands(bands)
    expected = [
        quadrature_level(force, 44100.0, lower, upper)
        for lower, upper in zip(edges.lower, edges.upper, strict=True)
    ]
    found = thud.force_exposure_levels(force, 44100.0, bands)
    oracle(
        "levels of records by adaptive quadrature of their transform",
        "independent code",
        found - expected,
        1e-6,
        "dB",
    )


def test_bins_of_random_pulses_differ_by_what_the_documentation_tells() -> None:
    # docs/levels.md, from 1250 drops; these are some of the same ranges.
    rng = np.random.default_rng(1)
    worst: dict[str, list[float]] = {"models": [0, 0], "lumped": [0, 0]}
    for _ in range(60):
        ball = thud.Ball(
            youngs_modulus=rng.uniform(1e6, 3e6), wall_thickness=rng.uniform(0.028, 0.036)
        )
        time, restitution, exponent = rng.uniform((0.016, 0.6, 1), (0.026, 0.95, 2.5))
        lumped = thud.solve(
            model="hunt_crossley", contact_time=time, restitution=restitution, exponent=exponent
        )
        shell = thud.solve(ball, thud.Drop(rng.uniform(0.2, 1.6)), model="hollow_sphere")
        for kind, force in (
            ("models", shell.floor_force),
            ("models", shell.elastic_force),
            ("lumped", lumped.floor_force),
        ):
            for i, bands in enumerate(("octave", "third")):
                exact = thud.force_exposure_levels(force, 44100.0, bands)
                bins = thud.force_exposure_levels(force, 44100.0, bands, method="fft")
                worst[kind][i] = max(worst[kind][i], float(np.abs(exact - bins).max()))
    # Near the limits, not only below them.
    assert 0.1 < worst["models"][0] < 0.15
    assert 0.4 < worst["models"][1] < 0.55
    assert 0.1 < worst["lumped"][0] < 0.27


def test_moved_record_has_the_same_levels() -> None:
    moved = np.concatenate([np.zeros(12345), NOISE, np.zeros(77)])
    np.testing.assert_allclose(
        thud.force_exposure_levels(moved, 44100.0),
        thud.force_exposure_levels(NOISE, 44100.0),
        rtol=0,
        atol=1e-10,
    )
