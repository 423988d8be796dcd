"""Sound pressure in a room with rigid walls below a plate of given velocity, stepped in time.

The room is a box with modes cos cos cos; the plate is its whole ceiling. All modes take exact steps
for inputs that are linear between samples. An analog Butterworth response filters the bands in the
frequency domain, and the Fast detector is stepped exactly.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

REFERENCE_PRESSURE = 2e-5
FAST = 0.125
AIR_DENSITY, SOUND_SPEED = 1.2, 343.0


def modal_rate(inputs: ArrayLike, omega: float, decay: float, sample_rate: float) -> Array:
    """Return X' of X'' + 2 decay X' + omega**2 X = input, from rest, exact for linear pieces.

    `decay` is the rate of the amplitude, 1/s, below omega unless omega is 0; shape (n_time,).
    """
    inputs = np.asarray(inputs, float)
    h = 1 / sample_rate
    # z' = s z + input, with X' = Im(s z)/omega_d; without stiffness X' = z of s = -2 decay.
    damped = math.sqrt(omega**2 - decay**2) if omega > 0 else 0.0
    s = complex(-decay, damped) if omega > 0 else complex(-2 * decay)
    before, after = _linear_step(s * h)
    z = lfilter([h * after, h * before], [1, -np.exp(s * h)], inputs)
    # The first sample has no piece before it.
    z = z - h * after * inputs[0] * np.exp(s * h * np.arange(len(z)))
    return np.asarray((s * z).imag / damped if omega > 0 else z.real)


def _linear_step(x: complex) -> tuple[complex, complex]:
    """Return the integrals over a unit step of exp(x (1 - t)) (1 - t) and exp(x (1 - t)) t."""
    if abs(x) < 1e-3:
        first = 1 + x / 2 + x**2 / 6 + x**3 / 24
        second = 0.5 + x / 6 + x**2 / 24 + x**3 / 120
    else:
        first = (np.exp(x) - 1) / x
        second = (np.exp(x) - 1 - x) / x**2
    return first - second, second


def get_room_modes(
    size: ArrayLike, maximum: float, sound_speed: float = SOUND_SPEED
) -> tuple[Array, Array]:
    """Return half-waves, shape (n, 3), and frequencies up to `maximum`, Hz, ascending; first 0."""
    size = np.asarray(size, float)
    counts = (2 * size * maximum / sound_speed).astype(int) + 1
    orders = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1).reshape(-1, 3)
    frequency = sound_speed / 2 * np.linalg.norm(orders / size, axis=1)
    order = np.argsort(frequency, kind="stable")
    order = order[frequency[order] <= maximum]
    return orders[order].astype(float), frequency[order]


def get_pressure(  # noqa: PLR0913, PLR0917 - a plate, a room, and positions
    velocity: ArrayLike,
    shapes: ArrayLike,
    sample_rate: float,
    size: ArrayLike,
    microphones: ArrayLike,
    reverberation_time: float,
    *,
    maximum: float = 700.0,
    air_density: float = AIR_DENSITY,
    sound_speed: float = SOUND_SPEED,
) -> Array:
    """Return the sound pressure at microphones, Pa, shape (n_time, n_microphone).

    Parameters
    ----------
    velocity
        Amplitudes of the plate's velocity into the room, m/s, linear between samples, shape
        (n_time, n_shape).
    shapes
        Their shapes at the middles of equal rectangles of the ceiling, shape (n_shape, n_x, n_y).
    sample_rate
        Hz.
    size
        Length, width and height of the room, m; the plate is at z = height.
    microphones
        Positions, m, shape (n_microphone, 3).
    reverberation_time
        In s, of all modes.
    maximum
        Highest natural frequency, Hz.
    air_density, sound_speed
        kg/m3, m/s.
    """
    size, shapes = np.asarray(size, float), np.asarray(shapes, float)
    orders, frequency = get_room_modes(size, maximum, sound_speed)
    decay = 3 * math.log(10) / reverberation_time
    cosines = [
        np.cos(np.pi * np.outer(orders[:, axis], (np.arange(n) + 0.5) / n))
        for axis, n in enumerate(shapes.shape[1:])
    ]
    cell = size[0] * size[1] / (shapes.shape[1] * shapes.shape[2])
    flow = cell * np.einsum("mx,sxy,my->ms", cosines[0], shapes, cosines[1], optimize=True)
    flow *= np.cos(np.pi * orders[:, 2:])
    norm = np.where(orders > 0, 0.5, 1.0).prod(1)
    stiffness = air_density * sound_speed**2 / (size.prod() * norm)
    heard = np.cos(np.pi * orders * np.asarray(microphones, float)[:, None] / size).prod(2)
    result = np.zeros((len(np.asarray(velocity)), len(heard)))
    for i, f in enumerate(frequency):
        source = np.asarray(velocity) @ (stiffness[i] * flow[i])
        result += np.outer(modal_rate(source, 2 * np.pi * f, decay, sample_rate), heard[:, i])
    return result


def filter_band(pressure: Array, sample_rate: float, nominal: float) -> Array:
    """Return a record in a one-third-octave band: Butterworth, three poles, base ten.

    Zeros of the length of the record, and of one second at least, precede the period's end.
    """
    count = len(pressure) + max(len(pressure), math.ceil(sample_rate))
    center = 10 ** (round(10 * math.log10(nominal)) / 10)
    f = np.fft.rfftfreq(count, 1 / sample_rate)[1:, None]
    x = 1j * (f / center - center / f) / (10**0.05 - 10**-0.05)
    spectrum = np.fft.rfft(pressure, count, axis=0)
    spectrum[0] = 0
    spectrum[1:] /= (1 + x) * (1 + x + x**2)
    return np.asarray(np.fft.irfft(spectrum, count, axis=0)[: len(pressure)])


def get_maximum_levels(pressure: Array, sample_rate: float, nominal: ArrayLike) -> Array:
    """Return the maximum Fast levels in bands, dB, shape (n_band, n_microphone)."""
    x = -1 / (FAST * sample_rate)
    before, after = (float(value.real) * -x for value in map(complex, _linear_step(x)))
    maxima = []
    for f in np.atleast_1d(nominal):
        square = filter_band(pressure, sample_rate, float(f)) ** 2
        maxima.append(lfilter([after, before], [1, -math.exp(x)], square, axis=0).max(axis=0))
    return np.asarray(10 * np.log10(np.array(maxima) / REFERENCE_PRESSURE**2))
