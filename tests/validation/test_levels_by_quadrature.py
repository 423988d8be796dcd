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


def noise() -> np.ndarray:
    return np.random.default_rng(1).normal(size=3000)


RECORDS = {
    "elastic": lambda: thud.solve(model="hollow_sphere").elastic_force,
    "floor": lambda: thud.solve(model="hollow_sphere").floor_force,
    "noise": noise,
}


@pytest.mark.parametrize("record", RECORDS)
@pytest.mark.parametrize("bands", ["octave", "third"])
def test_exact_levels_are_the_integral(
    record: str, bands: str, oracle: Callable[..., None]
) -> None:
    force = RECORDS[record]()
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


def test_bins_agree_with_the_integral() -> None:
    for choice in ("momentum_balance", "retarding", "conservative", "none"):
        impact = thud.solve(momentum_flux=choice, model="hollow_sphere")
        for force in ("elastic", "floor"):
            exact = impact.levels(method="exact", force=force)
            np.testing.assert_allclose(impact.levels(method="fft", force=force), exact, atol=0.15)


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
    force = thud.solve(model="hollow_sphere").floor_force
    moved = np.concatenate([np.zeros(12345), force, np.zeros(77)])
    np.testing.assert_allclose(
        thud.force_exposure_levels(moved, 44100.0),
        thud.force_exposure_levels(force, 44100.0),
        rtol=0,
        atol=1e-10,
    )


def test_all_bands_hold_the_energy_of_the_record() -> None:
    # A tone of whole periods in the middle of a band: nearly all of its energy is there.
    tone = np.sin(2 * np.pi * 250 * np.arange(44100) / 44100)
    level = thud.force_exposure_levels(tone, 44100.0)[3]
    # Mean square 1/2 over 1 s; the rest leaks past the edges, 75 Hz away: 1/(pi^2 75) each.
    assert level == pytest.approx(10 * np.log10(0.5), abs=10 * 2 / (np.pi**2 * 75) / np.log(10))
