"""The exact solution of joist floors against closed forms and finite elements."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from baffled_plate import SupportedPlate, band_points, get_third, struck_plate
from joists import (
    JoistFloor,
    get_conductance,
    get_frequencies,
    get_joists,
    get_mobility,
    get_radiated_energy,
    get_ribs,
    get_torsion_constant,
    get_velocity,
    to_elements,
)
from plate_elements import CLAMPED, FREE, SUPPORTED, Edge, get_modes, get_point_mobility

FLOOR = JoistFloor()
# A plate without joists, in SI units of `SupportedPlate`.
BARE = JoistFloor(joists=(), loss_factor=0.04)
PLAIN = SupportedPlate(
    length=BARE.length, width=BARE.width, thickness=BARE.sheathing_thickness,
    density=BARE.sheathing_density,
    wave_speed=math.sqrt(BARE.sheathing_modulus / BARE.sheathing_density), loss_factor=0.04,
)  # fmt: skip
ON, BETWEEN = (1.7, 2.3), (1.7, 2.1)


def test_joists_stand_in_the_middle_of_the_floor() -> None:
    assert get_joists(FLOOR) == pytest.approx(0.3 + 0.4 * np.arange(12))
    assert get_joists(replace(FLOOR, width=4.8)) == pytest.approx(0.2 + 0.4 * np.arange(12))


def test_ribs_have_closed_sections() -> None:
    # Timoshenko and Goodier, Theory of elasticity, article 109.
    assert get_torsion_constant(1, 1) == pytest.approx(0.1406, abs=5e-5)
    assert get_torsion_constant(2, 1) == pytest.approx(0.457, abs=5e-4)
    loose, screwed, glued = (get_ribs(replace(FLOOR, connection=c))[0] for c in (0, 0.1, 1))
    assert loose.bending == pytest.approx(1.1e10 * 0.06 * 0.22**3 / 12)
    assert loose.spring == 0
    # About the common neutral axis; over the span EN 1995-1-1 annex B weakens the sheathing.
    k = math.pi / 4
    for part, added in ((1, glued.flange), (0.1, 1 / (1 / screwed.flange + k**2 / screwed.spring))):
        sections = [(1.1e10 * 0.06 * 0.22, 0.0), (part * 3e9 * 0.022 * 0.4, 0.121)]
        axis = sum(ea * z for ea, z in sections) / sum(ea for ea, _ in sections)
        expected = sum(ea * (z - axis) ** 2 for ea, z in sections)
        assert added == pytest.approx(expected, rel=1e-12)


def test_plate_without_joists_has_the_closed_form() -> None:
    half_waves, natural = PLAIN.modes(60)
    found, n = get_frequencies(BARE, 30, maximum=60)
    assert found == pytest.approx(natural[:30], rel=1e-9)
    assert np.sort(n) == pytest.approx(np.sort(half_waves[:30, 0]))
    half_waves, natural = PLAIN.modes(30000)
    for f in (60.0, 250.0):
        q = PLAIN.amplitudes(half_waves, natural, f, [ON])[0]
        expected = q @ PLAIN.shapes(half_waves, ON[:1], ON[1:])[:, 0, 0]
        found = get_mobility(BARE, f, ON)[0]
        assert found.real == pytest.approx(expected.real, rel=1e-3)
        # Modes above 30 kHz: 2/(pi 8 sqrt(B' m'')) f/30 kHz.
        assert found == pytest.approx(expected, rel=6e-3)


@pytest.mark.parametrize(
    "floor",
    [
        FLOOR,
        replace(FLOOR, shear=True, sides=(FREE, CLAMPED)),
        replace(FLOOR, sides=(Edge(3e4, 500.0), Edge(math.inf, 300.0))),
    ],
)
def test_frequencies_are_those_of_finite_elements(floor: JoistFloor) -> None:
    found, half_waves = get_frequencies(floor, 20, maximum=120)
    assert {1, 2} <= set(half_waves)
    elements, _ = get_modes(to_elements(floor, 0.134), 20)
    # Elements are stiffer.
    assert (elements / found > 1 - 1e-8).all()
    assert elements == pytest.approx(found, rel=4e-4)


@pytest.mark.parametrize(
    ("floor", "point"),
    [
        (FLOOR, ON),
        (FLOOR, BETWEEN),
        (replace(FLOOR, shear=True, sides=(FREE, SUPPORTED)), ON),
        (replace(FLOOR, sides=(Edge(3e4, 500.0, 0.5), SUPPORTED)), (1.7, 0.3)),
    ],
)
def test_mobility_is_that_of_finite_elements(floor: JoistFloor, point: tuple[float, float]) -> None:
    frequency = np.array([24.0, 60.0, 150.0, 330.0])
    found = get_mobility(floor, frequency, point)
    elements = get_point_mobility(to_elements(floor, 0.1, points=[point]), frequency, *point)[:, 0]
    assert elements.real == pytest.approx(found.real, rel=0.012)
    if not floor.shear:
        # Elements are too stiff at a force; at one on a beam with shear, w has a kink.
        assert abs(elements / found - 1).max() < 0.03
    assert abs(get_mobility(floor, frequency, point, 200) / found - 1).max() < 3e-4


def test_transfer_mobility_is_reciprocal() -> None:
    floor = replace(FLOOR, shear=True, sides=(FREE, CLAMPED))
    there, back = (
        get_velocity(floor, [80.0, 400.0], a, [b[0]], [b[1]])
        for a, b in (((1.7, 2.3), (0.9, 3.33)), ((0.9, 3.33), (1.7, 2.3)))
    )
    assert there == pytest.approx(back, rel=1e-9)


def test_conductance_between_joists_becomes_that_of_the_sheathing() -> None:
    sheathing = 1 / (8 * math.sqrt(FLOOR.stiffness * FLOOR.mass))
    found = get_conductance(FLOOR, BETWEEN, [2000, 2500, 3150, 4000]).mean()
    assert 10 * np.log10(found / sheathing) == pytest.approx(0, abs=0.5)
    # The joists are stiffer and heavier.
    ratio = get_conductance(FLOOR, ON, [250, 500]) / get_conductance(FLOOR, BETWEEN, [250, 500])
    assert (ratio < 0.2).all()


def test_radiated_energy_of_a_plate_without_joists_is_that_of_its_modes() -> None:
    energy, sigma = get_radiated_energy(BARE, ON, [80], count=4, size=0.1)
    frequency = band_points(*get_third(80), 4)
    power, square = struck_plate(PLAIN, frequency, [ON], size=0.1, maximum=600.0)
    assert energy == pytest.approx(2 * power.mean(), rel=0.01)
    # Per mean square velocity of a piston.
    expected = power.mean() / (1.2 * 340 * PLAIN.length * PLAIN.width * square.mean())
    assert sigma == pytest.approx(expected, rel=0.01)
    # Radiators of half the size.
    finer, _ = get_radiated_energy(BARE, ON, [80], count=4, size=0.05)
    assert finer == pytest.approx(energy, rel=0.02)
