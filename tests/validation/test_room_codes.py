"""Levels below floors and their ratings against equations that share nothing with the program."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from room_codes import a_weighted, curve_rating, fast_maximum

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

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


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("room", ROOMS)
def test_statistical_levels_are_those_of_energies_in_time(
    floor: str, room: str, oracle: Callable[..., None]
) -> None:
    plate = FLOORS[floor]
    found = thud.predict_level(floor=plate, room=ROOMS[room])
    frequency = 1000 * 10 ** (np.arange(-13, -1) / 10)
    # Losses are at least the internal ones plus the radiation to both sides.
    air = ROOMS[room].air_density * ROOMS[room].sound_speed
    radiated = air * found.radiation_factor / found.mass_per_area
    least = plate.loss_factor + 2 * radiated / (2 * np.pi * frequency)
    loss_factor = np.maximum(found.loss_factor, least)
    expected = [
        fast_maximum(
            frequency[i],
            energy=found.energy[i],
            mass=found.mass_per_area,
            loss_factor=loss_factor[i],
            radiation_factor=found.radiation_factor[i],
            volume=found.volume,
            reverberation_time=found.reverberation_time[i],
            modes=(
                np.sqrt(3) * plate.length * plate.width / (plate.wave_speed * plate.thickness),
                4 * np.pi * found.volume * frequency[i] ** 2 / ROOMS[room].sound_speed ** 3,
            ),
            sound_speed=ROOMS[room].sound_speed,
            air_density=ROOMS[room].air_density,
        )
        for i in range(found.n_modal, len(frequency))
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
