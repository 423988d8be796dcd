"""The statistical level below floors against modal rooms under modal plates of random sizes.

    python tests/validation/modal_rooms.py [number of floors of each kind]

prints, for rooms of dwellings and for halls with heavy floors, whose critical frequency is low, the energy mean of the modal levels less the
statistical ones with its standard error, and the spread of single positions beside the expected
one.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np

import thud

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Ranges of length, width and thickness of the floor, and height of the room, m.
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
        floor = thud.Plate(length=length, width=width, thickness=thickness)
        room = thud.Room(volume=length * width * height)
        size = np.array([length, width, height])
        balls, microphones = (
            border + draw.random((n, sides.size)) * (sides - 2 * border)
            for n, sides in zip(positions, (size[:2], size), strict=True)
        )
        one = thud.modal_room(impact, floor, room, balls=balls, microphones=microphones)
        level, spread = one.statistical[:, 3:]
        found.append(one.level[..., 3:].reshape(-1, 6) - level)
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


def main() -> None:
    """Print the study."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    print(f"{'border, thirds, Hz':37}", *(f"{f:6}" for f in (50, 63, 80, 100, 125, 160)))
    for name, *study in (
        ("dwellings, 0.5 m", DWELLINGS, count, (3, 6), 0.5),
        ("dwellings, 0 m", DWELLINGS, count, (3, 6), 0.0),
        ("halls, 0 m", HALLS, count // 2, (2, 4), 0.0),
    ):
        found, expected = draw_differences(*study)
        mean, error = energy_mean(found)
        rows = {
            "mean, dB": mean, "its error, dB": error,
            "spread, dB": found.std(axis=(0, 1)), "expected spread, dB": expected,
        }  # fmt: skip
        for title, values in rows.items():
            print(f"{name:17} {title:19}", *(f"{v:6.2f}" for v in values))


if __name__ == "__main__":
    main()
