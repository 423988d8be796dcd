"""Radiators in a baffle against closed forms, and what ISO 12354-1 says of a struck floor."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from baffled_plate import (
    SOUND_SPEED,
    THIRDS,
    SupportedPlate,
    band_radiation_factor,
    get_third,
    grid_centers,
    radiated_power,
    radiation_factor,
    resistance_matrices,
    standard_radiation_factor,
    strike_grid,
    struck_plate,
)

import thud

PLATE = SupportedPlate()
SIDES = PLATE.length, PLATE.width


def midpoint_error(m: int, n: int, size: float = 0.05) -> float:
    """Return what midpoints add to the power of volume flow, with a margin of a fifth."""
    waves = np.pi * size * np.array([m, n]) / SIDES
    return float(1.2 * (waves**2).sum() / 12)


def mode(m: int, n: int, size: float = 0.05) -> np.ndarray:
    return PLATE.shapes([[m, n]], *grid_centers(*SIDES, size))[0]


@pytest.mark.parametrize(("m", "n"), [(1, 1), (3, 1), (3, 5)])
def test_odd_modes_are_small_sources_at_low_frequencies(m: int, n: int) -> None:
    """Sigma = 32 k2 a b/(m2 n2 pi5), as of the volume flow (Wallace 1972)."""
    frequency = 0.1
    k = 2 * math.pi * frequency / SOUND_SPEED
    expected = 32 * k**2 * PLATE.length * PLATE.width / (m**2 * n**2 * math.pi**5)
    found = radiation_factor(mode(m, n), *SIDES, frequency)
    assert found == pytest.approx(expected, rel=midpoint_error(m, n))


def test_large_piston_radiates_as_a_plane_wave() -> None:
    """The factor of a square piston approaches 1 with oscillations of 1/(k a)**(3/2)."""
    found = radiation_factor(np.ones((120, 120)), 3.0, 3.0, 2000.0)
    assert found == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize(("m", "n", "frequency"), [(1, 1, 60.0), (2, 3, 80.0), (7, 5, 120.0)])
def test_modes_radiate_as_wallaces_integral_over_the_hemisphere(
    m: int, n: int, frequency: float
) -> None:
    """The far field of a mode, with its closed transform, integrated over all directions."""
    k = 2 * math.pi * frequency / SOUND_SPEED
    x, weight = np.polynomial.legendre.leggauss(60)
    theta, phi = (x + 1) * math.pi / 4, (x + 1) * math.pi / 4
    sine = np.sin(theta)[:, None]
    square = 1.0
    for half_waves, side, direction in ((m, SIDES[0], np.cos(phi)), (n, SIDES[1], np.sin(phi))):
        wave, own = k * sine * direction, half_waves * math.pi / side
        end = 1 - (-1) ** half_waves * np.cos(wave * side)
        square = square * 2 * end * (own / (own**2 - wave**2)) ** 2
    integral = 4 * (math.pi / 4) ** 2 * (weight @ (square * sine) @ weight)
    # W = rho c k2/(8 pi2) times the integral of |v|2 for amplitudes; a mode has S/8 of v2.
    expected = k**2 / (8 * math.pi**2) * integral / (SIDES[0] * SIDES[1] / 8)
    found = radiation_factor(mode(m, n), *SIDES, frequency)
    assert found == pytest.approx(expected, rel=midpoint_error(m, n))


def test_fields_and_resistance_matrices_give_the_same_power() -> None:
    half_waves, natural = PLATE.modes(300)
    x, y = grid_centers(*SIDES, 0.25)
    shapes = PLATE.shapes(half_waves, x, y)
    q = PLATE.amplitudes(half_waves, natural, 150.0, [[1.2, 0.9]])[0]
    resistance = resistance_matrices(shapes, *SIDES, [150.0])[0]
    expected = radiated_power(np.tensordot(q, shapes, 1), *SIDES, 150.0)
    assert (q.conj() @ resistance @ q).real / 2 == pytest.approx(expected, rel=1e-12)


def test_resistance_matrix_is_the_double_sum() -> None:
    x, y = grid_centers(*SIDES, 0.5)
    shapes = np.random.default_rng(1).normal(size=(2, len(x), len(y)))
    k = 2 * math.pi * 400 / SOUND_SPEED
    points = np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)
    distance = np.linalg.norm(points[:, None] - points, axis=2)
    flat = shapes.reshape(2, -1)
    double_sum = flat @ np.sinc(k * distance / math.pi) @ flat.T
    cell = SIDES[0] * SIDES[1] / len(points)
    expected = 1.2 * SOUND_SPEED * (k * cell) ** 2 / (2 * math.pi) * double_sum
    assert resistance_matrices(shapes, *SIDES, 400.0)[0] == pytest.approx(expected, rel=1e-12)


def test_mean_over_the_grid_of_strikes_is_that_over_all_positions() -> None:
    """The mean over all positions has no products of different modes."""
    frequency = np.array([55.0, 120.0])
    power, square = struck_plate(PLATE, frequency, strike_grid(PLATE, 12, 10), maximum=600.0)
    half_waves, natural = PLATE.modes(600.0)
    shapes = PLATE.shapes(half_waves, *grid_centers(*SIDES, 0.1))
    own = np.diagonal(resistance_matrices(shapes, *SIDES, frequency), axis1=1, axis2=2)
    omega = 2 * math.pi * frequency[:, None]
    dynamic = (2 * math.pi * natural) ** 2 * (1 + 0.02j) - omega**2
    modal = abs(omega / (PLATE.mass * SIDES[0] * SIDES[1] / 4 * dynamic)) ** 2 / 4
    assert power.mean(axis=1) == pytest.approx((modal * own).sum(1) / 2, rel=1e-9)
    assert square.mean(axis=1) == pytest.approx(modal.sum(1) / 8, rel=1e-9)
    # A hundred random strikes are near.
    strikes = np.random.default_rng(3).random((100, 2)) * SIDES
    drawn, _ = struck_plate(PLATE, frequency, strikes, maximum=600.0)
    assert drawn.mean(axis=1) == pytest.approx(power.mean(axis=1), rel=0.15)


def test_factor_of_the_standard_misses_a_struck_floor_at_low_frequencies() -> None:
    """By the code: -2 dB at 50 Hz, 2 dB at 80 and 100 Hz, 1 dB at 125 Hz, 0.3 dB from 160 Hz on."""
    center = np.sqrt(np.prod(get_third(THIRDS), axis=0))
    standard = 10 * np.log10(standard_radiation_factor(PLATE, center))
    found = 10 * np.log10(band_radiation_factor(PLATE, count=8, size=0.2, maximum=1200.0))
    difference = standard - found
    assert difference[:5] == pytest.approx([-1.6, -0.5, 2.0, 1.8, 1.1], abs=0.1)
    assert abs(difference[5:]).max() < 0.3
    # Coarser radiators, fewer modes and frequencies than by default change nothing that counts.
    fine = 10 * np.log10(band_radiation_factor(PLATE, [50, 630], count=12, size=0.1))
    assert found[[0, -1]] == pytest.approx(fine, abs=0.05)


def test_standard_is_that_of_large_plates_far_above_the_critical_frequency() -> None:
    large = replace(PLATE, length=12.0, width=10.0)
    critical = SOUND_SPEED**2 / (2 * math.pi) * math.sqrt(large.mass / large.stiffness)
    frequency = 400.0
    found = band_radiation_factor(large, frequency, strikes=[[5.1, 4.3]], count=3, size=0.25)
    assert 10 * np.log10(found * math.sqrt(1 - critical / frequency)) == pytest.approx(0, abs=0.1)
    assert standard_radiation_factor(large, frequency) == pytest.approx(found, rel=0.03)


@pytest.mark.parametrize(
    ("length", "width", "thickness"),
    [(5.0, 4.0, 0.18), (5.0, 4.0, 0.05), (0.6, 0.5, 0.01), (0.8, 0.6, 0.03), (1.2, 1.0, 0.14)],
)
def test_rooms_have_the_factor_of_the_standard(
    length: float, width: float, thickness: float
) -> None:
    """Also below the first mode of small plates, and for those that are nearly rigid."""
    floor = thud.Plate(
        length=length, width=width, thickness=thickness, density=2300.0, wave_speed=3500.0
    )
    prediction = thud.predict_level(
        thud.solve(thud.Ball()),
        floor,
        thud.Room(height=4.0, sound_speed=SOUND_SPEED, radiation="iso_12354"),
    )
    # The standard rounds the critical frequency, 2 pi/sqrt(12) to 1.8.
    rounded = 3500 * 2 * math.pi / (1.8 * math.sqrt(12))
    plate = SupportedPlate(length, width, thickness, wave_speed=rounded)
    center = np.sqrt(np.prod(get_third(THIRDS), axis=0))
    expected = standard_radiation_factor(plate, center)
    assert prediction.radiation_factor == pytest.approx(expected, rel=1e-9)
