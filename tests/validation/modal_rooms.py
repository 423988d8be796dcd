"""Modal rooms under modal plates of random sizes against the statistical level."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import thud

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Ranges of length, width and thickness of the floor, and height of the room, m; the floors of halls
# are heavy, so that their critical frequency is low.
DWELLINGS = ((4.0, 7.0), (3.0, 5.0), (0.14, 0.22), (2.3, 3.0))
HALLS = ((12.0, 16.0), (9.0, 12.0), (0.35, 0.50), (2.3, 3.0))


def draw_differences(
    ranges: tuple[tuple[float, float], ...],
    count: int,
    positions: tuple[int, int],
    border: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return modal less statistical levels, and expected spreads, dB, of the thirds 50 to 160 Hz.

    Positions keep a distance of `border` from all boundaries, m. Shapes (count, n_ball *
    n_microphone, 6) and (6,).
    """
    impact = thud.solve(model="modal_ball")
    draw = np.random.default_rng(1)
    found, expected = [], []
    for _ in range(count):
        length, width, thickness, height = (draw.uniform(*ends) for ends in ranges)
        floor = thud.Plate(length=length, width=width, thickness=thickness, edges="laboratory")
        room = thud.Room(volume=length * width * height)
        size = np.array([length, width, height])
        balls, microphones = (
            border + draw.random((n, sides.size)) * (sides - 2 * border)
            for n, sides in zip(positions, (size[:2], size), strict=True)
        )
        one = thud.modal_room(
            impact, floor, room, balls=balls, microphones=microphones, max_frequency=160.0
        )
        level, spread = one.statistical
        found.append(one.level.reshape(-1, 6) - level)
        expected.append(spread)
    return np.array(found), np.mean(expected, axis=0)


def energy_mean(
    differences: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the energy mean of differences and its standard error by floors, dB, shape (6,)."""
    energy = (10 ** (differences / 10)).mean(axis=1)
    mean = energy.mean(axis=0)
    error = energy.std(axis=0, ddof=1) / np.sqrt(len(energy)) / mean
    return 10 * np.log10(mean), 10 / np.log(10) * error
