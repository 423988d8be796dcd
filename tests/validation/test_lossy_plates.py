"""Floors of two plates whose layer has losses of its own, against complex stiffnesses."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from baffled_plate import SupportedPlate, get_third, grid_centers, resistance_matrices
from lossy_plates import LossyPlates, Part
from modal_room_reference import get_maximum_levels, get_pressure

import thud
from thud.base.bridge import ask
from thud.case.case import case_text

if TYPE_CHECKING:
    from collections.abc import Callable

THIRDS = np.array([50, 63, 80, 100, 125, 160, 200])
AIR_DENSITY, SOUND_SPEED = 1.2, 343.0
# 160 mm of concrete, with the loss factor of a laboratory by ISO 10140-5.
SLAB = thud.Plate(thickness=0.16, loss_factor=0.03, edges="laboratory")
MASS = 2300 * 0.16
PLATE = Part(MASS, MASS * (3500 * 0.16) ** 2 / 12, 0.03, MASS / 485)
SCREED = Part(2000 * 0.05, 2000 * 0.05 * (3500 * 0.05) ** 2 / 12, 0.03)
BOARD = Part(720 * 0.0125, 2.5e9 * 0.0125**3 / 12, 0.02)
HALF_WAVES = np.stack(np.meshgrid(np.arange(1, 14), np.arange(1, 14)), -1).reshape(-1, 2)


def floating(stiffness: float, loss: float) -> tuple[thud.Plate, LossyPlates]:
    floor = replace(SLAB, screed_thickness=0.05, layer_stiffness=stiffness, layer_loss_factor=loss)
    return floor, LossyPlates(SCREED, PLATE, stiffness, loss)


def hung(depth: float, loss: float) -> tuple[thud.Plate, LossyPlates]:
    floor = replace(
        SLAB, subceiling_thickness=0.0125, channel_stiffness=0.0, cavity_depth=depth,
        cavity_loss_factor=loss,
    )  # fmt: skip
    return floor, LossyPlates(PLATE, BOARD, AIR_DENSITY * SOUND_SPEED**2 / depth, loss)


FLOORS = [floating(s, e) for s in (1e7, 3e7) for e in (0.1, 0.5, 1.0)]
FLOORS += [hung(d, e) for d in (0.1, 0.2) for e in (0.1, 0.3)]


def radiated_power(plates: LossyPlates) -> np.ndarray:
    """Return powers per mean-square force in one-third octaves, means over all strikes, m/(N s)."""
    length, width = plates.sides
    shapes = SupportedPlate(length, width).shapes(HALF_WAVES, *grid_centers(length, width, 0.1))
    parts = (np.arange(6) + 0.5) / 6
    powers = []
    for lower, upper in np.transpose(get_third(THIRDS)):
        frequency = lower * (upper / lower) ** parts
        resistance = resistance_matrices(
            shapes, length, width, frequency, air_density=AIR_DENSITY, sound_speed=SOUND_SPEED
        )
        # Fine steps about each frequency.
        near = frequency[:, None] * (upper / lower) ** (np.linspace(-0.5, 0.5, 61)[:-1] / 6)
        square = abs(plates.answers(HALF_WAVES, near.ravel())) ** 2
        square = square.reshape(len(HALF_WAVES), *near.shape).mean(axis=2)
        own = np.diagonal(resistance, axis1=1, axis2=2)
        # A force F has the pressure 4 F sin sin/S, whose square is 4 F**2/S**2 on average.
        powers.append((square.T * own).sum(axis=1).mean() * 4 / (length * width) ** 2)
    return np.array(powers)


@pytest.mark.parametrize(("floor", "plates"), FLOORS)
def test_layers_radiate_with_their_losses(
    floor: thud.Plate, plates: LossyPlates, oracle: Callable[..., None]
) -> None:
    middle = (np.arange(14) + 0.5) / 14
    x, y = (grid.ravel() for grid in np.meshgrid(middle, middle))
    case = case_text(thud.Case(floor=floor, room=thud.Room()))
    found = np.asarray(ask("radiation", case=case, x=x, y=y)["radiated"])[: len(THIRDS)]
    oracle(
        "power below two plates with a lossy layer",
        "independent code",
        10 * np.log10(found / radiated_power(plates)),
        0.5,
        "dB",
    )


def energy_mean(level: np.ndarray) -> np.ndarray:
    """Return energy means over the last axis, dB."""
    return np.asarray(10 * np.log10((10 ** (level / 10)).mean(axis=-1)))


@pytest.mark.parametrize(("floor", "plates"), [FLOORS[1], FLOORS[2], FLOORS[5], FLOORS[9]])
def test_modal_rooms_hear_the_losses_of_layers(
    floor: thud.Plate, plates: LossyPlates, oracle: Callable[..., None]
) -> None:
    room, rate, count = thud.Room(reverberation_time=(0.4,)), 4096.0, 8192
    ball = np.array([1.3, 1.7])
    microphones = 0.5 + np.random.default_rng(1).random((8, 3)) * (4.0, 3.0, 1.5)
    source = thud.solve(model="modal_ball", floor=floor)
    found = thud.modal_room(
        thud.predict_level(source, floor, room), balls=[ball], microphones=microphones
    )
    history = found.prediction.source
    force = np.interp(np.arange(count) / rate, history.time, history.force("floor"), right=0.0)
    frequency = np.fft.rfftfreq(count, 1 / rate)
    answers = np.zeros((len(HALF_WAVES), len(frequency)), complex)
    answers[:, 1:] = plates.answers(HALF_WAVES, frequency[1:])
    drive = np.prod(np.sin(np.pi * HALF_WAVES * ball / plates.sides), axis=1)
    spectrum = answers * 4 / np.prod(plates.sides) * drive[:, None] * np.fft.rfft(force)
    shapes = SupportedPlate(*plates.sides).shapes(
        HALF_WAVES, *((np.arange(60) + 0.5) / 60 * side for side in plates.sides)
    )
    pressure = get_pressure(
        np.fft.irfft(spectrum, count).T, shapes, rate, found.size, microphones, 0.4, maximum=450.0,
        air_density=AIR_DENSITY, sound_speed=SOUND_SPEED,
    )  # fmt: skip
    expected = get_maximum_levels(pressure, rate, found.frequency)
    # Means over positions: quiet ones depend on high modes of the room.
    oracle(
        "levels in a modal room below two plates with a lossy layer",
        "independent code",
        energy_mean(found.level[0].T) - energy_mean(expected),
        0.5,
        "dB",
    )
    energy = found.floor_energy
    oracle(
        "two plates with a lossy layer: energy into the floor − energy lost",
        "balance",
        energy[:, 0] / energy[:, 1] - 1,
        1e-3,
    )
