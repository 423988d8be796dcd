"""Modal rooms against closed forms, and, where modes are many, against the statistical level."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

# Ranges of length, width and thickness of the floor, and height of the room, m; the floors of halls
# are heavy, so that their critical frequency is low.
HALLS = ((12.0, 16.0), (9.0, 12.0), (0.35, 0.50), (2.3, 3.0))
# Levels of the thirds 50 to 200 Hz, dB, that an independent code in closed forms gives below simply
# supported floors of 5 m x 4 m, at the standard positions.
DWELLING = {
    "concrete 180": (61.7, 62.2, 56.2, 53.5, 56.7, 63.9, 57.6),
    "concrete 180, screed on 15 MN/m3": (70.1, 66.5, 56.6, 47.8, 47.1, 48.8, 40.0),
}


@pytest.mark.parametrize("name", DWELLING)
def test_levels_in_a_dwelling_are_those_of_closed_forms(
    name: str, oracle: Callable[..., None]
) -> None:
    """The ball is by modes, of 1.6 MPa with a loss factor that rises with exponent 0.3."""
    ball = thud.solve(
        thud.Ball(youngs_modulus=1.6e6), model="modal_ball", damping_law="rising",
        fractional_order=0.3,
    )  # fmt: skip
    case = thud.construction(name).case()
    room = thud.Room(height=2.5, reverberation_time=(0.5,), positions="standard")
    found = thud.predict_level(ball, replace(case.floor, support="simple"), room)
    assert found.n_modal == len(DWELLING[name])
    oracle(
        "levels below a concrete and a floating floor at the standard positions",
        "independent code", found.level[: found.n_modal] - DWELLING[name], 0.5, "dB",
    )  # fmt: skip


def test_modal_and_statistical_levels_agree_in_halls(oracle: Callable[..., None]) -> None:
    """From 100 Hz on a third of a hall holds dozens of modes, above the critical frequency.

    Over the whole of floors and rooms the energy means agree to three standard errors; of thirty
    floors they are 0.4 to 0.5 dB in each third.
    """
    impact = thud.solve(model="modal_ball")
    draw = np.random.default_rng(1)
    energy = []
    for _ in range(12):
        length, width, thickness, height = (draw.uniform(*ends) for ends in HALLS)
        floor = thud.Plate(length=length, width=width, thickness=thickness, edges="laboratory")
        room = thud.Room(volume=length * width * height)
        size = np.array([length, width, height])
        balls, microphones = draw.random((2, 2)) * size[:2], draw.random((4, 3)) * size
        found = thud.predict_level(impact, floor, room)
        modal = thud.modal_room(found, balls=balls, microphones=microphones, max_frequency=160.0)
        # Thirds from 100 Hz on that are statistical in a prediction.
        bands = np.arange(max(3, found.n_modal), 6)
        energy.append((10 ** ((modal.level[..., bands] - found.level[bands]) / 10)).mean())
    mean = np.mean(energy)
    error = np.std(energy, ddof=1) / np.sqrt(len(energy)) / mean
    assert 10 / np.log(10) * error < 0.7
    oracle(
        "level in halls by modes, in standard errors of the mean",
        "other model", np.log(mean) / error, 3,
    )  # fmt: skip
