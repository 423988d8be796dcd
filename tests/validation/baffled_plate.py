"""Sound radiated by a plate in a rigid baffle, by elementary radiators in space.

The plate is divided into n_x by n_y equal rectangles, each a small piston: the power is the double
sum of rho c k**2 A**2/(4 pi) Re(v_i v_j*) sin(k r)/(k r) (Elliott and Johnson 1993; amplitudes). On
a uniform grid this sum is a convolution, here by zero-padded Fourier transforms in space.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

AIR_DENSITY, SOUND_SPEED = 1.2, 343.0
# One-third-octave bands from 50 to 630 Hz.
THIRDS = np.array([50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630])


def get_third(nominal: ArrayLike) -> tuple[Array, Array]:
    """Return lower and upper limits of one-third-octave bands, Hz (base ten)."""
    center = 10 ** (np.round(10 * np.log10(np.asarray(nominal, float))) / 10)
    return center * 10**-0.05, center * 10**0.05


def band_points(nominal: float, count: int) -> Array:
    """Return the midpoints of `count` equal parts of a one-third-octave band, Hz."""
    lower, upper = get_third(nominal)
    return lower + (upper - lower) * (np.arange(count) + 0.5) / count


def grid_centers(length: float, width: float, size: float) -> tuple[Array, Array]:
    """Return the middles of radiators of at most `size` along both sides, m."""
    counts = [math.ceil(side / size - 1e-9) for side in (length, width)]
    x, y = (
        side * (np.arange(n) + 0.5) / n for side, n in zip((length, width), counts, strict=True)
    )
    return x, y


def radiated_power(  # noqa: PLR0913 - a field, a frequency, and the air
    velocity: ArrayLike,
    length: float,
    width: float,
    frequency: float,
    *,
    air_density: float = AIR_DENSITY,
    sound_speed: float = SOUND_SPEED,
) -> Array:
    """Return the mean power radiated to one side, W, shape (...).

    Parameters
    ----------
    velocity
        Complex amplitudes at the middles of the radiators, m/s, shape (..., n_x, n_y).
    length, width
        Sides of the plate, m.
    frequency
        Frequency, Hz.
    air_density, sound_speed
        kg/m3, m/s.
    """
    n_x, n_y = np.shape(velocity)[-2:]
    x, y = (
        side / n * np.fft.ifftshift(np.arange(-n, n)) for side, n in ((length, n_x), (width, n_y))
    )
    k = 2 * math.pi * frequency / sound_speed
    kernel = np.fft.fft2(np.sinc(k * np.hypot(x[:, None], y) / np.pi)).real
    spectrum = np.fft.fft2(velocity, (2 * n_x, 2 * n_y))
    double_sum = (abs(spectrum) ** 2 * kernel).sum((-2, -1)) / (4 * n_x * n_y)
    element = length * width / (n_x * n_y)
    return np.asarray(air_density * sound_speed * (k * element) ** 2 / (4 * math.pi) * double_sum)


@dataclass(frozen=True)
class SupportedPlate:
    """A homogeneous simply supported plate: B' = m'' c_L**2 h**2/12."""

    length: float
    width: float
    thickness: float
    density: float
    wave_speed: float
    loss_factor: float

    def radiation_factor(self, nominal: float, *, count: int = 8, maximum: float = 1500.0) -> Array:
        """Return power over mean square velocity in a one-third-octave band, mean over strikes.

        Forces have an equal spectral density at `count` frequencies. Over all positions, products
        of different modes have no mean. Modes have natural frequencies up to `maximum`, Hz.
        """
        unit = math.pi / (4 * math.sqrt(3)) * self.wave_speed * self.thickness
        half_waves = np.stack(np.meshgrid(*[np.arange(1, 60)] * 2), -1).reshape(-1, 2)
        natural = unit * ((half_waves / [self.length, self.width]) ** 2).sum(1)
        half_waves, natural = half_waves[natural < maximum], natural[natural < maximum]
        shapes = get_shapes(half_waves, *grid_centers(1.0, 1.0, 1 / 40))
        power = square = 0.0
        for f in band_points(nominal, count):
            answer = abs(f / (natural**2 * (1 + 1j * self.loss_factor) - f**2)) ** 2
            own = radiated_power(shapes, self.length, self.width, f, air_density=1.0)
            power, square = power + answer @ own, square + answer.sum() / 8
        return np.asarray(power / (SOUND_SPEED * self.length * self.width * square))


def get_shapes(half_waves: ArrayLike, x: ArrayLike, y: ArrayLike) -> Array:
    """Return sin sin on a grid of positions over sides, shape (n_mode, n_x, n_y)."""
    m, n = np.asarray(half_waves).T
    along, across = np.sin(np.pi * np.outer(m, x)), np.sin(np.pi * np.outer(n, y))
    return along[:, :, None] * across[:, None, :]
