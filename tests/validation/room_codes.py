"""Level below a floor by equations of its own: energies integrated in time, detector, ratings.

Nothing is shared with the program but the input: loss factor, radiation factor, energy and room.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

# A-weighting in one-third octaves 50 to 630 Hz and octaves 63 to 500 Hz, dB (IEC 61672-1).
THIRDS = (-30.3, -26.2, -22.4, -19.1, -16.2, -13.2, -10.8, -8.7, -6.6, -4.8, -3.2, -1.9)
OCTAVES = (-26.2, -16.2, -8.7, -3.2)
# Values of the former Korean curve in octaves 63 to 500 Hz, dB.
CURVE = (83, 73, 66, 60)
MAX_EXCESS = 8


def fast_maximum(  # noqa: PLR0913 - a floor and a room
    frequency: float,
    *,
    energy: float,
    mass: float,
    loss_factor: float,
    radiation_factor: float,
    volume: float,
    reverberation_time: float,
    modes: tuple[float, float],
    sound_speed: float,
    air_density: float,
) -> float:
    """Return the maximum Fast level, dB re 20 uPa, of energies of floor and room (DOP853).

    `modes` are the modes per hertz of floor and room; energy flows back so that equal
    energies of the modes are in equilibrium. The reverberation time is that of the bare room.
    """
    omega = 2 * np.pi * frequency
    forth = air_density * sound_speed * radiation_factor / mass
    back = forth * modes[0] / modes[1]
    lost = 6 * np.log(10) / reverberation_time + back

    def rates(_: float, state: np.ndarray) -> list[float]:
        floor, room, detected = state
        pressure = air_density * sound_speed**2 * room / volume
        return [
            -omega * loss_factor * floor + back * room,
            forth * floor - lost * room,
            (pressure - detected) / 0.125,
        ]

    end = 3 * max(reverberation_time / 6, 0.125, 1 / (omega * loss_factor))
    solved = solve_ivp(
        rates, (0.0, end), [energy, 0.0, 0.0], "DOP853", rtol=1e-10, atol=1e-30, max_step=end / 800
    )
    return float(10 * np.log10(solved.y[2].max() / 2e-5**2))


def a_weighted(levels: np.ndarray) -> float:
    """Return the A-weighted sum of twelve one-third octaves or four octaves, dB (ISO 717-2)."""
    weights = THIRDS if len(levels) == len(THIRDS) else OCTAVES
    return float(10 * np.log10((10 ** ((levels + np.array(weights)) / 10)).sum()))


def curve_rating(octaves: np.ndarray) -> int:
    """Return the former Korean rating: the value at 500 Hz of the lowest curve with 8 dB excess."""
    curve = np.array(CURVE)
    shift = -100
    while np.maximum(octaves - curve - shift, 0).sum() > MAX_EXCESS:
        shift += 1
    return CURVE[-1] + shift
