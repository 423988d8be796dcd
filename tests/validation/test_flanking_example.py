"""Paths of impact sound of a building against the worked example of ISO 12354-2:2017 (annex G).

A floor of 220 mm of concrete with a screed on 8 MN/m3 between two dwellings, two external walls of
365 mm of aerated concrete and two internal ones of 200 mm of calcium silicate. The energies of
phonometry, which reproduces the example, are 65.6 % directly, and 9.5, 13.2, 5.0 and 6.6 % by the
walls.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import thud
from thud.floors.tapping import TappingLevel

if TYPE_CHECKING:
    from collections.abc import Callable

# Levels of the direct path, and of an external and an internal wall of 4 m, dB, from 100 to 630 Hz:
# below, the example counts forced waves in walls.
DIRECT = np.array([51.8, 49.9, 47.7, 45.2, 42.5, 39.7, 36.9, 34.3, 31.7])
EXTERNAL = np.array([42.4, 40.2, 38.0, 35.9, 33.4, 30.6, 27.6, 24.9, 22.1])
INTERNAL = np.array([43.8, 41.2, 38.5, 35.3, 32.1, 29.1, 26.0, 23.2, 20.3])
SHARES = np.array([0.656, 0.095, 0.132, 0.050, 0.066])
# Resonance of the screed of 73.5 kg/m2, Hz.
RESONANCE = 52.8
FROM_100 = slice(3, None)


@pytest.fixture(scope="module")
def building() -> SimpleNamespace:
    """Return energies by each wall over the direct one, and the level without walls, in bands."""
    floor = thud.Plate(
        length=5.0, width=4.0, thickness=0.22, density=2200.0, wave_speed=3800.0, loss_factor=0.005
    )
    room = thud.Room(
        volume=55.0, sound_speed=340.0, air_density=1.29, radiation="iso_12354",
        wall_lengths=(4.0, 5.0), wall_height=2.75,
    )  # fmt: skip
    rooms = (
        replace(
            room, wall_junction="t", wall_thickness=0.365, wall_density=600.0,
            wall_wave_speed=1900.0, wall_loss_factor=0.0125,
        ),
        replace(
            room, wall_junction="cross", wall_thickness=0.2, wall_density=1800.0,
            wall_wave_speed=2500.0, wall_loss_factor=0.01,
        ),
    )  # fmt: skip
    shares = [thud.predict_level(floor=floor, room=walls).path_shares for walls in rooms]
    walls = np.hstack([share[:, 1:] / share[:, :1] for share in shares])
    tapping = thud.tapping_level(floor, room)
    rated = tapping.level[: len(walls)]
    screed = 30 * np.log10(tapping.frequency[: len(rated)] / RESONANCE)
    return SimpleNamespace(
        walls=walls, direct=rated - np.maximum(screed, 0), frequency=tapping.frequency
    )


def test_walls_transmit_as_in_the_example(
    building: SimpleNamespace, oracle: Callable[..., None]
) -> None:
    """Edges of walls have the mean loss of dwellings, in the example that of their junctions."""
    for wall, published in ((0, EXTERNAL), (2, INTERNAL)):
        difference = 10 * np.log10(building.walls[FROM_100, wall]) - (published - DIRECT)
        oracle(
            "energy by a wall over the direct one, annex G of ISO 12354-2",
            "published example", difference, 0.8, "dB",
        )  # fmt: skip


def test_paths_have_the_shares_of_the_example(
    building: SimpleNamespace, oracle: Callable[..., None]
) -> None:
    direct = 10 ** (building.direct / 10)
    energy = np.column_stack([direct, direct[:, None] * building.walls]).sum(axis=0)
    oracle(
        "shares of the paths in the energy, phonometry",
        "published example", energy / energy.sum() - SHARES, 0.03,
    )  # fmt: skip


def test_rating_of_the_example_is_reproduced(building: SimpleNamespace) -> None:
    total = building.direct + 10 * np.log10(1 + building.walls.sum(axis=1))
    # From 800 Hz on the levels are more than 20 dB below the reference curve.
    level = np.pad(total, (0, len(building.frequency) - len(total)), constant_values=0.0)
    rated = TappingLevel(building.frequency, level)
    assert (rated.weighted, rated.adaptation) == (41, 2)
