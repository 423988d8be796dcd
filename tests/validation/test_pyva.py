"""Floor and room against pyva, statistical energy analysis (Peiffer 2022), in the same run."""

from __future__ import annotations

import warnings
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

pytest.importorskip("pyva")
from pyva import models
from pyva.coupling.junctions import AreaJunction
from pyva.data import dof
from pyva.data.matrixClasses import DataAxis
from pyva.loads.loadCase import Load
from pyva.properties.materialClasses import Fluid, IsoMat
from pyva.properties.structuralPropertyClasses import PlateProp
from pyva.systems.acoustic3Dsystems import Acoustic3DSystem
from pyva.systems.structure2Dsystems import RectangularPlate

LENGTH, WIDTH, HEIGHT = 5.0, 4.0, 2.5
REVERBERATION_TIME, LOSS_FACTOR = 0.5, 0.05
SOUND_SPEED, AIR_DENSITY = 340.0, 1.29
# Thin plates have an index of Poisson's ratio in their wave speed; any value gives the same plate.
POISSON_RATIO = 0.2


@pytest.fixture(scope="module", params=[0.14, 0.18, 0.25])
def both(request: pytest.FixtureRequest) -> SimpleNamespace:
    """Return the prediction of thud, and the steady energies of pyva for a power of 1 W."""
    floor = thud.Plate(
        length=LENGTH, width=WIDTH, thickness=request.param, loss_factor=LOSS_FACTOR,
        edges="absorption",
    )  # fmt: skip
    room = thud.Room(
        volume=LENGTH * WIDTH * HEIGHT, reverberation_time=REVERBERATION_TIME,
        sound_speed=SOUND_SPEED, air_density=AIR_DENSITY, reverberation_of="bare",
    )  # fmt: skip
    prediction = thud.predict_level(floor=floor, room=room)
    frequency = 1000 * 10 ** (np.arange(-13, -1) / 10)
    omega = 2 * np.pi * frequency
    air = Fluid(c0=SOUND_SPEED, rho0=AIR_DENSITY, eta=0.0)
    modulus = floor.density * floor.wave_speed**2 * (1 - POISSON_RATIO**2)
    material = IsoMat(E=modulus, rho0=floor.density, nu=POISSON_RATIO)
    # pyva couples one side with the room: the other side of the floor is part of its losses.
    radiated = AIR_DENSITY * SOUND_SPEED * prediction.radiation_factor
    radiated /= omega * floor.thickness * floor.density
    volume = LENGTH * WIDTH * HEIGHT
    absorption = 24 * np.log(10) * volume / (SOUND_SPEED * REVERBERATION_TIME)
    # thud counts the modes of the volume alone, without the terms of surfaces and edges.
    below = Acoustic3DSystem(
        2, volume, 0.0, 0.0, air, absorption_area=absorption, damping_type=["surface"]
    )
    energies, plates = [], []
    for i, loss in enumerate(prediction.loss_factor - radiated):
        prop = PlateProp(floor.thickness, material)
        plate = RectangularPlate(1, LENGTH, WIDTH, prop=prop, eta=loss, wave_DOF=[3])
        axis = DataAxis(omega[i : i + 1], typestr="angular frequency")
        model = models.HybridModel((plate, below), xdata=axis)
        model.add_junction({"floor": AreaJunction((below, plate))})
        power = dof.DOF(1, 3, dof.DOFtype(typestr="power"))
        model.add_load("power", Load(axis, np.ones(1), power, name="power"))
        # pyva drops the imaginary parts of numbers that have none.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", np.exceptions.ComplexWarning)
            model.create_SEA_matrix(sym=1)
            model.solve()
        energies.append(np.real(model.energy.ydata[:, 0]))
        plates.append(plate)
    return SimpleNamespace(
        prediction=prediction, plate=plates[0], room=below, air=air, frequency=frequency,
        omega=omega, energy=np.array(energies).T,
    )  # fmt: skip


def test_modal_densities_agree(both: Any, oracle: Callable[..., None]) -> None:  # noqa: ANN401
    width = both.frequency * (10**0.05 - 10**-0.05)
    floor = both.plate.modal_density(both.omega) * 2 * np.pi * width
    room = both.room.modal_density(both.omega) * 2 * np.pi * width
    oracle(
        "modal density of a plate, pyva",
        "independent code",
        both.prediction.floor_modes / floor - 1,
        1e-3,
    )
    oracle(
        "modal density of a room, pyva",
        "independent code",
        both.prediction.room_modes / room - 1,
        1e-3,
    )


def test_energies_agree_above_the_critical_frequency(
    both: Any,  # noqa: ANN401
    oracle: Callable[..., None],
) -> None:
    """Formulas of Leppington (pyva) against the modes that are there (thud)."""
    found = both.prediction
    critical = SOUND_SPEED**2 * np.sqrt(12) / (2 * np.pi * 3500 * found.floor.thickness)
    above = both.frequency > 2 * critical
    expected = both.plate.radiation_efficiency(both.omega, both.air)
    difference = 10 * np.log10(found.radiation_factor / expected)
    oracle("radiation factor of a plate, pyva", "independent code", difference[above], 0.5, "dB")
    # The time integral of the answer to an impulse is the answer to a constant power.
    square = 2e-5**2 * (10 ** (found.history / 10)).sum(axis=0) * found.history_time[0]
    energy = square * found.volume / (AIR_DENSITY * SOUND_SPEED**2) / found.energy
    remaining = 10 * np.log10(energy / both.energy[1]) - difference
    oracle("steady energy in the room, pyva", "independent code", remaining[above], 0.03, "dB")
