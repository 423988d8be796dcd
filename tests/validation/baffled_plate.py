"""Sound radiated by a plate in a rigid baffle, by elementary radiators in space.

The plate is divided into n_x by n_y equal rectangles, each a small piston: the power is the double
sum of rho c k**2 A**2/(4 pi) Re(v_i v_j*) sin(k r)/(k r) (Elliott and Johnson 1993; amplitudes). On
a uniform grid this sum is a convolution, here by zero-padded Fourier transforms in space.

    python tests/validation/baffled_plate.py

prints the radiation factor of a concrete plate beside that of ISO 12354-1 annex B.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    ComplexArray = NDArray[np.complex128]

AIR_DENSITY, SOUND_SPEED = 1.2, 340.0
# One-third-octave bands from 50 to 630 Hz.
THIRDS = np.array([50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630])


def get_third(nominal: ArrayLike) -> tuple[Array, Array]:
    """Return lower and upper limits of one-third-octave bands, Hz (base ten)."""
    center = 10 ** (np.round(10 * np.log10(np.asarray(nominal, float))) / 10)
    return center * 10**-0.05, center * 10**0.05


def band_points(lower: float, upper: float, count: int) -> Array:
    """Return the midpoints of `count` equal parts of a band, Hz."""
    return lower + (upper - lower) * (np.arange(count) + 0.5) / count


def grid_centers(length: float, width: float, size: float) -> tuple[Array, Array]:
    """Return the middles of radiators of at most `size` along both sides, m."""
    counts = [math.ceil(side / size - 1e-9) for side in (length, width)]
    x, y = (
        side * (np.arange(n) + 0.5) / n for side, n in zip((length, width), counts, strict=True)
    )
    return x, y


def _kernel(shape: tuple[int, int], area: tuple[float, float], wavenumber: float) -> Array:
    """Return the transform of sin(k r)/(k r) on the padded grid."""
    x, y = (
        side / n * np.fft.ifftshift(np.arange(-n, n)) for side, n in zip(area, shape, strict=True)
    )
    distance = np.hypot(x[:, None], y)
    return np.asarray(np.fft.fft2(np.sinc(wavenumber * distance / np.pi)).real)


def radiated_power(  # noqa: PLR0913 - a field, a frequency, and the air
    velocity: ArrayLike,
    length: float,
    width: float,
    frequency: float,
    *,
    air_density: float = AIR_DENSITY,
    sound_speed: float = SOUND_SPEED,
) -> Array:
    """Return the mean power radiated to one side, W.

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

    Returns
    -------
    ndarray, shape (...)
    """
    velocity = np.asarray(velocity)
    n_x, n_y = velocity.shape[-2:]
    k = 2 * math.pi * frequency / sound_speed
    spectrum = np.fft.fft2(velocity, (2 * n_x, 2 * n_y))
    kernel = _kernel((n_x, n_y), (length, width), k)
    double_sum = (abs(spectrum) ** 2 * kernel).sum((-2, -1)) / (4 * n_x * n_y)
    element = length * width / (n_x * n_y)
    return np.asarray(air_density * sound_speed * (k * element) ** 2 / (4 * math.pi) * double_sum)


def radiation_factor(
    velocity: ArrayLike,
    length: float,
    width: float,
    frequency: float,
    *,
    sound_speed: float = SOUND_SPEED,
) -> Array:
    """Return the ratio of the radiated power to rho c S times the mean square velocity, (...)."""
    power = radiated_power(
        velocity, length, width, frequency, air_density=1.0, sound_speed=sound_speed
    )
    square = (abs(np.asarray(velocity)) ** 2).mean((-2, -1)) / 2
    return np.asarray(power / (sound_speed * length * width * square))


def resistance_matrices(  # noqa: PLR0913 - shapes, frequencies, and the air
    shapes: ArrayLike,
    length: float,
    width: float,
    frequency: ArrayLike,
    *,
    air_density: float = AIR_DENSITY,
    sound_speed: float = SOUND_SPEED,
) -> Array:
    """Return radiation resistances of velocity shapes, N s/m, (n_frequency, n_shape, n_shape).

    Real `shapes` at the middles of the radiators, shape (n_shape, n_x, n_y), with amplitudes q
    radiate the power q^H R q/2.
    """
    shapes = np.asarray(shapes, float)
    n, n_x, n_y = shapes.shape
    spectrum = np.fft.rfft2(shapes, (2 * n_x, 2 * n_y))
    # The lines of a real transform that stand for themselves and their mirror image.
    weight = np.full(n_y + 1, 2.0)
    weight[[0, -1]] = 1
    flat = np.concatenate([part.reshape(n, -1) for part in (spectrum.real, spectrum.imag)], axis=1)
    element = length * width / (n_x * n_y)
    result = []
    for k in 2 * math.pi * np.atleast_1d(np.asarray(frequency, float)) / sound_speed:
        kernel = (_kernel((n_x, n_y), (length, width), k)[:, : n_y + 1] * weight).ravel()
        double_sum = (flat * np.tile(kernel, 2)) @ flat.T / (4 * n_x * n_y)
        result.append(air_density * sound_speed * (k * element) ** 2 / (2 * math.pi) * double_sum)
    return np.array(result)


@dataclass(frozen=True)
class SupportedPlate:
    """A homogeneous simply supported plate; the defaults are a floor of concrete.

    `wave_speed` is that of quasi-longitudinal waves in the plate: B' = m'' c_L**2 h**2/12.
    """

    length: float = 5.0
    width: float = 4.0
    thickness: float = 0.18
    density: float = 2300.0
    wave_speed: float = 3500.0
    loss_factor: float = 0.02

    @property
    def mass(self) -> float:
        """Mass per area, kg/m2."""
        return self.density * self.thickness

    @property
    def stiffness(self) -> float:
        """Bending stiffness, N m."""
        return self.mass * (self.wave_speed * self.thickness) ** 2 / 12

    def modes(self, maximum: float) -> tuple[NDArray[np.int64], Array]:
        """Return half-waves, shape (n, 2), and frequencies, Hz, up to `maximum`, ascending."""
        unit = math.pi / 2 * math.sqrt(self.stiffness / self.mass)
        most = int(max(self.length, self.width) * math.sqrt(maximum / unit)) + 1
        m, n = (grid.ravel() for grid in np.meshgrid(*[np.arange(1, most + 1)] * 2, indexing="ij"))
        frequency = unit * ((m / self.length) ** 2 + (n / self.width) ** 2)
        order = np.argsort(frequency)
        order = order[frequency[order] <= maximum]
        return np.stack([m, n], 1)[order], frequency[order]

    def shapes(self, half_waves: ArrayLike, x: ArrayLike, y: ArrayLike) -> Array:
        """Return sin sin at the points of a grid, shape (n_mode, n_x, n_y)."""
        m, n = np.asarray(half_waves).T
        along = np.sin(np.pi * np.outer(m, x) / self.length)
        across = np.sin(np.pi * np.outer(n, y) / self.width)
        return along[:, :, None] * across[:, None, :]

    def amplitudes(
        self, half_waves: ArrayLike, natural: ArrayLike, frequency: float, strikes: ArrayLike
    ) -> ComplexArray:
        """Return modal velocities by unit forces, m/(N s), shape (n_strike, n_mode)."""
        m, n = np.asarray(half_waves).T
        x, y = np.asarray(strikes, float).T
        force = np.sin(np.pi * np.outer(x, m) / self.length)
        force = force * np.sin(np.pi * np.outer(y, n) / self.width)
        omega, resonance = 2 * math.pi * frequency, 2 * math.pi * np.asarray(natural)
        dynamic = resonance**2 * (1 + 1j * self.loss_factor) - omega**2
        return force * (1j * omega / (self.mass * self.length * self.width / 4 * dynamic))


def strike_grid(plate: SupportedPlate, n_x: int, n_y: int) -> Array:
    """Return strikes at the middles of n_x by n_y rectangles, shape (n_x n_y, 2).

    Over these points, modes of fewer than n_x and n_y half-waves are orthogonal as over the plate:
    the mean over them is that over all positions.
    """
    x = plate.length * (np.arange(n_x) + 0.5) / n_x
    y = plate.width * (np.arange(n_y) + 0.5) / n_y
    return np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2)


def struck_plate(  # noqa: PLR0913 - a plate, strikes, the discretization, and the air
    plate: SupportedPlate,
    frequency: ArrayLike,
    strikes: ArrayLike,
    *,
    size: float = 0.1,
    maximum: float = 2000.0,
    sound_speed: float = SOUND_SPEED,
    air_density: float = AIR_DENSITY,
) -> tuple[Array, Array]:
    """Return radiated power and mean square velocity by unit forces at each strike.

    Parameters
    ----------
    plate, frequency
        Plate, and frequencies, Hz, shape (n_frequency,).
    strikes
        Positions, m, shape (n_strike, 2).
    size, maximum
        Size of radiators, m, and highest natural frequency of modes, Hz.
    sound_speed, air_density
        m/s, kg/m3.

    Returns
    -------
    power, square : ndarray, shape (n_frequency, n_strike)
        W and m2/s2 for a force of amplitude 1 N; `square` is the mean over time and plate.
    """
    half_waves, natural = plate.modes(maximum)
    x, y = grid_centers(plate.length, plate.width, size)
    shapes = plate.shapes(half_waves, x, y)
    frequency = np.atleast_1d(np.asarray(frequency, float))
    power, square = [], []
    for f in frequency:
        resistance = resistance_matrices(
            shapes, plate.length, plate.width, f, air_density=air_density, sound_speed=sound_speed
        )[0]
        q = plate.amplitudes(half_waves, natural, f, strikes)
        power.append(((q.conj() @ resistance) * q).sum(1).real / 2)
        square.append((abs(q) ** 2).sum(1) / 8)
    return np.array(power), np.array(square)


def band_radiation_factor(  # noqa: PLR0913 - a plate, bands, the discretization, and the air
    plate: SupportedPlate,
    nominal: ArrayLike = THIRDS,
    *,
    strikes: ArrayLike | None = None,
    count: int = 16,
    size: float = 0.1,
    maximum: float = 2000.0,
    sound_speed: float = SOUND_SPEED,
) -> Array:
    """Return radiation factors of one-third-octave bands: power over mean square velocity.

    Both are summed over strikes (by default a grid that stands for all positions) and over `count`
    frequencies of a band, for forces of equal spectral density.
    """
    strikes = strike_grid(plate, 22, 18) if strikes is None else strikes
    result = []
    for lower, upper in zip(*get_third(np.atleast_1d(nominal)), strict=True):
        power, square = struck_plate(
            plate, band_points(lower, upper, count), strikes, size=size, maximum=maximum,
            sound_speed=sound_speed, air_density=1.0,
        )  # fmt: skip
        result.append(power.sum() / (sound_speed * plate.length * plate.width * square.sum()))
    return np.array(result)


def standard_radiation_factor(
    plate: SupportedPlate, frequency: ArrayLike, sound_speed: float = SOUND_SPEED
) -> Array:
    """Return the radiation factor for free waves of ISO 12354-1:2017 annex B, at most 2."""
    a, b = max(plate.length, plate.width), min(plate.length, plate.width)
    critical = sound_speed**2 / (1.8 * plate.wave_speed * plate.thickness)
    first = sound_speed**2 / (4 * critical) * (1 / a**2 + 1 / b**2)
    result = []
    for f in np.atleast_1d(np.asarray(frequency, float)):
        one = 1 / math.sqrt(1 - critical / f) if f > critical else math.inf
        two = 4 * a * b * (f / sound_speed) ** 2
        three = math.sqrt(2 * math.pi * f * (a + b) / (16 * sound_speed))
        if first > critical / 2:
            limits = [three]
            limits += [two] if f < critical and two < three else []
            limits += [one] if f > critical and one < three else []
            sigma = min(limits)
        elif f >= critical:
            sigma = one
        else:
            ratio = math.sqrt(f / critical)
            edge = (1 - ratio**2) * math.log((1 + ratio) / (1 - ratio)) + 2 * ratio
            edge /= 4 * math.pi**2 * (1 - ratio**2) ** 1.5
            corner = 0.0
            if f <= critical / 2:
                corner = 8 * sound_speed**2 * (1 - 2 * ratio**2)
                corner /= critical**2 * math.pi**4 * a * b * ratio * math.sqrt(1 - ratio**2)
            sigma = 2 * (a + b) / (a * b) * sound_speed / critical * edge + corner
            if f < first < critical / 2:
                sigma = min(sigma, two)
        result.append(min(sigma, 2.0))
    return np.array(result)


def main() -> None:
    """Print radiation factors of the plate, dB, and the difference of the standard from them."""
    plate = SupportedPlate()
    sigma = 10 * np.log10(band_radiation_factor(plate))
    center = np.sqrt(np.prod(get_third(THIRDS), axis=0))
    standard = 10 * np.log10(standard_radiation_factor(plate, center))
    for row in zip(THIRDS, sigma, standard, standard - sigma, strict=True):
        print("{:6.0f} {:7.2f} {:7.2f} {:7.2f}".format(*row))  # noqa: T201 - its output


if __name__ == "__main__":
    main()
