"""Floors of two plates whose layer has losses of its own, against complex stiffnesses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from baffled_plate import (
    AIR_DENSITY,
    SOUND_SPEED,
    get_shapes,
    get_third,
    grid_centers,
    radiated_power,
)
from modal_room_reference import get_maximum_levels, get_pressure

import thud
from thud.base.bridge import ask
from thud.case.case import case_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class Part:
    """A plate: mass per area, kg/m2, bending stiffness, N m, and loss factor.

    `falling` is a further loss factor at 1 Hz, which falls as one over the root of the frequency.
    """

    mass: float
    stiffness: float
    loss_factor: float
    falling: float = 0.0


@dataclass(frozen=True)
class LossyPlates:
    """Two simply supported plates, and stiffness per area, N/m3, and loss factor of the layer.

    Each pair of half-waves has a complex stiffness matrix of two by two, K (1 + i eta) summed over
    its parts, which is inverted at each frequency.
    """

    upper: Part
    lower: Part
    layer: float
    layer_loss: float

    def answers(self, half_waves: ArrayLike, frequency: ArrayLike) -> ComplexArray:
        """Return velocities of the lower plate by unit pressures on the upper one, m/(Pa s).

        Both have the shape sin sin of `half_waves`, shape (n_pair, 2). Frequencies are in Hz, shape
        (n_frequency,); the result has the shape (n_pair, n_frequency).
        """
        wave = (np.asarray(half_waves) * np.pi / SIDES) ** 2
        hertz = np.asarray(frequency, float)
        omega = 2 * np.pi * hertz
        layer = self.layer * (1 + 1j * self.layer_loss)
        upper, lower = (
            part.stiffness
            * wave.sum(1)[:, None] ** 2
            * (1 + 1j * (part.loss_factor + part.falling / np.sqrt(hertz)))
            + layer
            - part.mass * omega**2
            for part in (self.upper, self.lower)
        )
        return np.asarray(1j * omega * layer / (upper * lower - layer**2))


THIRDS = np.array([50, 63, 80, 100, 125, 160, 200])
# 160 mm of concrete, with the loss factor of a laboratory by ISO 10140-5.
SIDES = 3.2, 2.5
SLAB = thud.Plate(*SIDES, thickness=0.16, loss_factor=0.03, edges="laboratory")
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


FLOORS = [floating(1e7, 0.1), floating(1e7, 1.0), floating(3e7, 0.5), hung(0.2, 0.3)]


def get_power(plates: LossyPlates) -> np.ndarray:
    """Return powers per mean-square force in one-third octaves, means over all strikes, m/(N s)."""
    length, width = SIDES
    shapes = get_shapes(HALF_WAVES, *grid_centers(1.0, 1.0, 1 / 40))
    parts = (np.arange(6) + 0.5) / 6
    powers = []
    for lower, upper in np.transpose(get_third(THIRDS)):
        frequency = lower * (upper / lower) ** parts
        own = np.array([radiated_power(shapes, length, width, f) for f in frequency])
        # Fine steps about each frequency.
        near = frequency[:, None] * (upper / lower) ** (np.linspace(-0.5, 0.5, 61)[:-1] / 6)
        square = abs(plates.answers(HALF_WAVES, near.ravel())) ** 2
        square = square.reshape(len(HALF_WAVES), *near.shape).mean(axis=2)
        # A force F has the pressure 4 F sin sin/S, whose square is 4 F**2/S**2 on average.
        powers.append((square.T * own).sum(axis=1).mean() * 8 / (length * width) ** 2)
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
        10 * np.log10(found / get_power(plates)),
        0.5,
        "dB",
    )


def energy_mean(level: np.ndarray) -> np.ndarray:
    """Return energy means over the last axis, dB."""
    return np.asarray(10 * np.log10((10 ** (level / 10)).mean(axis=-1)))


@pytest.mark.parametrize(("floor", "plates"), FLOORS[1::2])
def test_modal_rooms_hear_the_losses_of_layers(
    floor: thud.Plate, plates: LossyPlates, oracle: Callable[..., None]
) -> None:
    room, rate, count = thud.Room(reverberation_time=(0.4,)), 4096.0, 8192
    ball = np.array([1.3, 1.7])
    microphones = 0.5 + np.random.default_rng(1).random((16, 3)) * (2.2, 1.5, 1.5)
    source = thud.solve(model="modal_ball", floor=floor)
    found = thud.modal_room(
        thud.predict_level(source, floor, room), balls=[ball], microphones=microphones
    )
    history = found.prediction.source
    force = np.interp(np.arange(count) / rate, history.time, history.force("floor"), right=0.0)
    frequency = np.fft.rfftfreq(count, 1 / rate)
    answers = np.zeros((len(HALF_WAVES), len(frequency)), complex)
    answers[:, 1:] = plates.answers(HALF_WAVES, frequency[1:])
    drive = np.prod(np.sin(np.pi * HALF_WAVES * ball / SIDES), axis=1)
    spectrum = answers * 4 / np.prod(SIDES) * drive[:, None] * np.fft.rfft(force)
    shapes = get_shapes(HALF_WAVES, *[(np.arange(60) + 0.5) / 60] * 2)
    pressure = get_pressure(
        np.fft.irfft(spectrum, count).T, shapes, rate, found.size, microphones, 0.4, maximum=700.0
    )  # fmt: skip
    # Means over positions: quiet ones depend on high modes of the room, as do higher bands.
    expected = get_maximum_levels(pressure, rate, THIRDS)
    oracle(
        "levels in a modal room below two plates with a lossy layer",
        "independent code",
        energy_mean(found.level[0].T)[: len(THIRDS)] - energy_mean(expected),
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
