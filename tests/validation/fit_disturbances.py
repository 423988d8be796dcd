"""Fits to disturbed records: modulus and height of the shell.

    python tests/validation/fit_disturbances.py [SEEDS]

Each record has 40 ms of zeros before and after the pulse, to which noise and one disturbance are
added. No fit may be wrong in silence: the 90 % intervals cover as often as they say, within
binomial bounds, in all fits or in those that do not warn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from fit_tally import print_tallies, quiet_fit, random_of

import thud

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Disturbance = Callable[[Array, np.random.Generator], Array]

RATE = 44100.0
QUIET = 0.04
NOISE = 5.0
TRUTH = {"youngs_modulus": 1.8e6, "height": 1.1}


def coloured(power: float) -> Disturbance:
    """Return noise of a density 1/f**power above 1 Hz, of a standard deviation of 5 N.

    It is cut from a record of 6 s: no part of it is periodic.
    """

    def make(time: Array, random: np.random.Generator) -> Array:
        count = 2**18
        frequency = np.fft.rfftfreq(count, 1 / RATE)
        shape = np.where(frequency < 1.0, 0.0, np.maximum(frequency, 1.0) ** (-power / 2))
        noise = np.fft.irfft(np.fft.rfft(random.normal(size=count)) * shape, count)
        first = random.integers(count - len(time))
        # Of unit white noise, each frequency has the variance 1/count at both signs.
        unit = np.sqrt(2 * np.sum(shape**2) / count)
        return np.asarray(noise[first : first + len(time)] * NOISE / unit)

    return make


def white(time: Array, random: np.random.Generator) -> Array:
    """Return white noise."""
    return random.normal(scale=NOISE, size=len(time))


def hum(frequency: float, *amplitudes: float) -> Disturbance:
    """Return white noise and hum with harmonics of amplitudes, N."""

    def make(time: Array, random: np.random.Generator) -> Array:
        force = white(time, random)
        for order, amplitude in enumerate(amplitudes, start=1):
            phase = 2 * np.pi * (order * frequency * time + random.random())
            force += amplitude * np.sin(phase)
        return force

    return make


def together(time: Array, random: np.random.Generator) -> Array:
    """Return pink noise, white noise twice, hum of 50 Hz of 5 N, and an offset of 20 N."""
    force = coloured(1)(time, random) + hum(50, 5)(time, random)
    return force + white(time, random) + 20


def spike(time: Array, random: np.random.Generator) -> Array:
    """Return white noise and a spike of 300 N for 1 ms, anywhere."""
    force = white(time, random)
    first = random.integers(len(time) - 44)
    force[first : first + 44] += 300.0
    return force


def ringing(time: Array, random: np.random.Generator) -> Array:
    """Return white noise and a decaying tone of 300 Hz that first touch excites."""
    late = np.maximum(time - QUIET, 0)
    tone = np.sin(2 * np.pi * 300 * late) * np.exp(-late / 0.02)
    return white(time, random) + 40 * tone


DISTURBANCES: dict[str, Disturbance] = {
    "white noise": white,
    "pink noise": coloured(1),
    "brown noise": coloured(2),
    "blue noise": coloured(-1),
    "hum of 60 Hz, 3 N": hum(60, 3),
    "hum of 50 Hz, 10, 5, 3 N": hum(50, 10, 5, 3),
    "hum of 16.7 Hz, 10 N": hum(16.7, 10),
    "offset of 20 N": lambda time, random: white(time, random) + 20,
    "pink noise, hum and offset": together,
    "spike": spike,
    "ringing of 300 Hz": ringing,
    # Five times as large behind first touch.
    "louder behind first touch": lambda t, random: white(t, random) * np.where(t < QUIET, 1, 5),
}


def pulse(quiet: float) -> tuple[Array, Array]:
    """Return time, s, and force, N, of the truth with quiet on both sides."""
    ball = thud.Ball(youngs_modulus=TRUTH["youngs_modulus"])
    impact = thud.solve(ball, thud.Drop(TRUTH["height"]), duration=0.026, model="hollow_sphere")
    contact = impact.floor_force[: int(impact.contact_time * RATE) + 2]
    force = np.pad(contact, round(quiet * RATE))
    return np.arange(len(force)) / RATE, force


def fits(name: str, count: int, **options: Any) -> Iterator[thud.Fit]:  # noqa: ANN401 - of `fit`
    """Yield fits to records of a disturbance."""
    time, force = pulse(QUIET)
    case = thud.Case(sampling=thud.Sampling(duration=0.026), model=thud.HollowSphere())
    for seed in range(count):
        record = time, force + DISTURBANCES[name](time, random_of(name, seed))
        yield quiet_fit(record, TRUTH, case, **options)


if __name__ == "__main__":
    print_tallies(DISTURBANCES, fits, TRUTH, 200)
