"""Levels below floors and their ratings against equations that share nothing with the program."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from room_codes import a_weighted, curve_rating, fast_maximum

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

FREQUENCY = 1000 * 10 ** (np.arange(-13, -1) / 10)
# The standard rounds 2 pi/sqrt(12) of the critical frequency to 1.8.
ROUNDED = 2 * math.pi / (1.8 * math.sqrt(12))
FLOORS = {
    "thin": thud.Plate(thickness=0.1, length=3.0, width=2.5),
    "concrete": thud.Plate(thickness=0.18),
    "large": thud.Plate(thickness=0.3, length=9.0, width=7.0, edges="laboratory"),
    "floating": thud.Plate(thickness=0.2, screed_thickness=0.05),
}
ROOMS = {
    "dry": thud.Room(height=2.4, reverberation_time=0.2, reverberation_of="bare"),
    "live": thud.Room(height=3.5, reverberation_time=1.5, reverberation_of="bare"),
}


@pytest.mark.parametrize(
    ("floor", "room"),
    [("thin", "dry"), ("concrete", "live"), ("large", "dry"), ("floating", "live")],
)
def test_statistical_levels_are_those_of_energies_in_time(
    floor: str, room: str, oracle: Callable[..., None]
) -> None:
    plate = FLOORS[floor]
    found = thud.predict_level(floor=plate, room=ROOMS[room])
    # Losses are at least the internal ones plus the radiation to both sides.
    air = ROOMS[room].air_density * ROOMS[room].sound_speed
    radiated = air * found.radiation_factor / found.mass_per_area
    least = plate.loss_factor + 2 * radiated / (2 * np.pi * FREQUENCY)
    loss_factor = np.maximum(found.loss_factor, least)
    expected = [
        fast_maximum(
            FREQUENCY[i],
            energy=found.energy[i],
            mass=found.mass_per_area,
            loss_factor=loss_factor[i],
            radiation_factor=found.radiation_factor[i],
            volume=found.volume,
            reverberation_time=found.reverberation_time[i],
            modes=(
                np.sqrt(3) * plate.length * plate.width / (plate.wave_speed * plate.thickness),
                4 * np.pi * found.volume * FREQUENCY[i] ** 2 / ROOMS[room].sound_speed ** 3,
            ),
            sound_speed=ROOMS[room].sound_speed,
            air_density=ROOMS[room].air_density,
        )
        for i in range(found.n_modal, len(FREQUENCY))
    ]
    oracle(
        "level below a floor by energies integrated in time",
        "independent code", found.level[found.n_modal :] - expected, 1e-3, "dB",
    )  # fmt: skip
    thirds, octaves = (found.ratings[name].level for name in ("thirds", "octaves"))
    assert thirds == pytest.approx(a_weighted(found.level), abs=1e-9)
    assert octaves == pytest.approx(a_weighted(found.octave_level), abs=1e-9)
    rated = thud.rating(found.octave_level)
    assert rated.curve == curve_rating(found.octave_level)
    limits = (37.0, 41.0, 45.0, 49.0)
    classes = [i for i, limit in enumerate(limits, 1) if rated.rounded <= limit]
    assert rated.korean_class == min(classes, default=0)


def standard_radiation_factor(plate: thud.Plate, sound_speed: float) -> np.ndarray:
    """Return the radiation factor for free waves of ISO 12354-1:2017 annex B, at most 2."""
    a, b = max(plate.length, plate.width), min(plate.length, plate.width)
    critical = sound_speed**2 / (1.8 * ROUNDED * plate.wave_speed * plate.thickness)
    first = sound_speed**2 / (4 * critical) * (1 / a**2 + 1 / b**2)
    result = []
    for f in FREQUENCY:
        one = 1 / math.sqrt(1 - critical / f) if f > critical else math.inf
        two = 4 * a * b * (f / sound_speed) ** 2
        three = math.sqrt(2 * math.pi * f * (a + b) / (16 * sound_speed))
        if first > critical / 2:
            limits = [three]
            limits += [two] if f < critical and two < three else []
            limits += [one] if f > critical and one < three else []
            sigma = min(limits)
        elif f >= critical:
            sigma = one
        else:
            ratio = math.sqrt(f / critical)
            edge = (1 - ratio**2) * math.log((1 + ratio) / (1 - ratio)) + 2 * ratio
            edge /= 4 * math.pi**2 * (1 - ratio**2) ** 1.5
            corner = 0.0
            if f <= critical / 2:
                corner = 8 * sound_speed**2 * (1 - 2 * ratio**2)
                corner /= critical**2 * math.pi**4 * a * b * ratio * math.sqrt(1 - ratio**2)
            sigma = 2 * (a + b) / (a * b) * sound_speed / critical * edge + corner
            if f < first < critical / 2:
                sigma = min(sigma, two)
        result.append(min(sigma, 2.0))
    return np.array(result)


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
        thud.Room(height=4.0, sound_speed=340.0, radiation="iso_12354"),
    )
    expected = standard_radiation_factor(floor, 340.0)
    assert prediction.radiation_factor == pytest.approx(expected, rel=1e-9)
