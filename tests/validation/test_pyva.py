"""Radiation factors of plates against pyva (Peiffer 2022), by the formulas of Leppington."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

pytest.importorskip("pyva")
from pyva.properties.materialClasses import Fluid, IsoMat
from pyva.properties.structuralPropertyClasses import PlateProp
from pyva.systems.structure2Dsystems import RectangularPlate

# Thin plates have an index of Poisson's ratio in their wave speed; any value gives the same plate.
POISSON_RATIO = 0.2


@pytest.mark.parametrize("thickness", [0.14, 0.18, 0.25])
def test_radiation_factors_agree_above_the_critical_frequency(
    thickness: float, oracle: Callable[..., None]
) -> None:
    floor = thud.Plate(thickness=thickness, loss_factor=0.05, edges="absorption")
    room = thud.Room(sound_speed=340.0, air_density=1.29)
    found = thud.predict_level(floor=floor, room=room)
    modulus = floor.density * floor.wave_speed**2 * (1 - POISSON_RATIO**2)
    material = IsoMat(E=modulus, rho0=floor.density, nu=POISSON_RATIO)
    plate = RectangularPlate(
        1, floor.length, floor.width, prop=PlateProp(thickness, material), wave_DOF=[3]
    )
    frequency = 1000 * 10 ** (np.arange(-13, -1) / 10)
    air = Fluid(c0=room.sound_speed, rho0=room.air_density, eta=0.0)
    expected = plate.radiation_efficiency(2 * np.pi * frequency, air)
    critical = room.sound_speed**2 * np.sqrt(12) / (2 * np.pi * floor.wave_speed * thickness)
    difference = 10 * np.log10(found.radiation_factor / expected)[frequency > 2 * critical]
    oracle("radiation factor of a plate, pyva", "independent code", difference, 0.5, "dB")
