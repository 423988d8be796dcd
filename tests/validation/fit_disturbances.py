"""Fits to disturbed records: modulus and height of the shell.

    python tests/validation/fit_disturbances.py [SEEDS]

Each record has 40 ms of zeros before and after the pulse, to which noise and one disturbance are
added. No fit may be wrong in silence: the 90 % intervals cover as often as they say, within
binomial bounds, in all fits or in those that do not warn.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from fit_tally import print_tallies, quiet_fit

import thud

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    Disturbance = Callable[[NDArray[np.float64], np.random.Generator], NDArray[np.float64]]

RATE = 44100.0
QUIET = 0.04
NOISE = 5.0
TRUTH = {"youngs_modulus": 1.8e6, "height": 1.1}


def coloured(power: float, size: float = NOISE, low: float = 1.0) -> Disturbance:
    """Return noise of a density 1/f**power above a frequency, Hz, of a standard deviation, N.

    It is cut from a record of 6 s: no part of it is periodic.
    """

    def make(time: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
        count = 2**18
        frequency = np.fft.rfftfreq(count, 1 / RATE)
        shape = np.where(frequency < low, 0.0, np.maximum(frequency, low) ** (-power / 2))
        noise = np.fft.irfft(np.fft.rfft(random.normal(size=count)) * shape, count)
        first = random.integers(count - len(time))
        # Of unit white noise, each frequency has the variance 1/count at both signs.
        unit = np.sqrt(2 * np.sum(shape**2) / count)
        part: NDArray[np.float64] = noise[first : first + len(time)] * size / unit
        return part

    return make


def white(time: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """Return white noise."""
    return random.normal(scale=NOISE, size=len(time))


def hum(frequency: float, *amplitudes: float) -> Disturbance:
    """Return white noise and hum with harmonics of amplitudes, N."""

    def make(time: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
        force = white(time, random)
        for order, amplitude in enumerate(amplitudes, start=1):
            phase = 2 * np.pi * (order * frequency * time + random.random())
            force += amplitude * np.sin(phase)
        return force

    return make


def trend(offset: float, drift: float = 0.0) -> Disturbance:
    """Return white noise with an offset, N, and a drift, N/s."""
    return lambda time, random: white(time, random) + offset + drift * time


def together(*parts: Disturbance) -> Disturbance:
    """Return the sum of disturbances."""
    return lambda time, random: np.sum([part(time, random) for part in parts], axis=0)


def spike(time: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """Return white noise and a spike of 300 N for 1 ms, anywhere."""
    force = white(time, random)
    first = random.integers(len(time) - 44)
    force[first : first + 44] += 300.0
    return force


def ringing(time: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """Return white noise and a decaying tone of 300 Hz that first touch excites."""
    late = np.maximum(time - QUIET, 0)
    tone = np.sin(2 * np.pi * 300 * late) * np.exp(-late / 0.02)
    return white(time, random) + 40 * tone


def louder(time: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """Return white noise that is five times as large behind first touch."""
    return white(time, random) * np.where(time < QUIET, 1, 5)


# Disturbances by name.
DISTURBANCES: dict[str, Disturbance] = {
    "white noise": white,
    "pink noise": coloured(1),
    "brown noise": coloured(2),
    "hum of 60 Hz, 3 N": hum(60, 3),
    "offset of 5 N": trend(5),
    "offset of 20 N": trend(20),
    "hum of 50 Hz, 10, 5, 3 N": hum(50, 10, 5, 3),
    "hum of 16.7 Hz, 10 N": hum(16.7, 10),
    "hum of 100 Hz, 10 N": hum(100, 10),
    "drift of 100 N/s": trend(-5, 100),
    "blue noise": coloured(-1),
    "noise 1/f1.5": coloured(1.5),
    "pink noise, hum and offset": together(coloured(1), hum(50, 5), trend(20)),
    "spike": spike,
    "ringing of 300 Hz": ringing,
    "louder behind first touch": louder,
}


def pulse(quiet: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return time, s, and force, N, of the truth with quiet on both sides."""
    ball = thud.Ball(youngs_modulus=TRUTH["youngs_modulus"])
    impact = thud.solve(ball, thud.Drop(TRUTH["height"]), duration=0.026, model="hollow_sphere")
    force = impact.floor_force[: int(impact.contact_time * RATE) + 2]
    room = round(quiet * RATE)
    force = np.pad(force, room)
    return np.arange(len(force)) / RATE, force


def fits(name: str, count: int, **options: Any) -> Iterator[thud.Fit]:  # noqa: ANN401 - of `fit`
    """Yield fits to records of a disturbance."""
    time, force = pulse(QUIET)
    case = thud.Case(sampling=thud.Sampling(duration=0.026), model=thud.HollowSphere())
    for seed in range(count):
        random = np.random.default_rng([seed, *name.encode()])
        record = time, force + DISTURBANCES[name](time, random)
        yield quiet_fit(record, TRUTH, case, **options)


if __name__ == "__main__":
    print_tallies(DISTURBANCES, fits, TRUTH, int(sys.argv[1]) if len(sys.argv) > 1 else 200)
