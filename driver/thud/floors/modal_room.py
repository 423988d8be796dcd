"""Levels in a modal room below a modal plate, for positions of ball and microphone.

This is the deterministic counterpart of the statistical prediction at low frequencies. The plate is
simply supported and covers the ceiling of a rectangular room with rigid walls. The motion of plate
and air is a sum of modes. The force drives the plate, and the plate drives the air; the reaction of
the air is included only as radiation in the loss factor of the plate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter, sosfilt

from thud.base._schema import Plate, Room
from thud.base.bridge import ask
from thud.base.checks import (
    MAX_SEED,
    refuse,
    refuse_value,
    require_array,
    require_kind,
    require_real,
    require_whole,
)
from thud.base.display import Displayed
from thud.base.errors import InputError
from thud.case.case import Case, case_text
from thud.floors.prediction import RoomPrediction, predict_level
from thud.level.levels import get_bands
from thud.recordings.filters import band_filters

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from thud.level.impact_result import ImpactResult

    Array = NDArray[np.float64]
    ComplexArray = NDArray[np.complex128]

# Number of one-third-octave bands from 25 to 160 Hz.
N_BAND = 9
# Samples per second of the sound pressure, Hz: filters of class 1 need at least four times 178 Hz.
SAMPLE_RATE = 1024.0
# Maximum frequency of modes, Hz, which the filter of the 160 Hz band attenuates by 42 dB.
MAX_FREQUENCY = 400.0
# Minimum distance of random positions from all boundaries, m (ISO 16283-2).
BORDER = 0.5
# Decay within the record, dB.
DECAY_RANGE = 60.0
# Time constant of the Fast detector, s.
TIME_CONSTANT = 0.125
REFERENCE_PRESSURE = 2e-5
# Limits of memory: positions of ball or microphone, modes, and modes times frequency points.
MAX_POSITIONS, MAX_MODES, MAX_VALUES = 1000, 20000, 2 * 10**7


class ModeCountError(InputError):
    """A floor or a room has no modes in the bands, or more modes than can be computed."""


@dataclass(frozen=True, eq=False, repr=False)
class ModalRoom(Displayed):
    """Levels in a modal room below a modal plate, for positions of ball and microphone.

    Attributes
    ----------
    prediction : RoomPrediction
        Statistical prediction for the same impact, floor and room.
    size : tuple of float
        Length, width and height of the room, m.
    frequency : ndarray, shape (9,)
        Rounded mid frequencies of the one-third-octave bands 25 to 160 Hz.
    balls : ndarray, shape (n_ball, 2)
        Positions of the ball on the floor, m.
    microphones : ndarray, shape (n_microphone, 3)
        Positions of the microphones, m; the third coordinate is the height.
    level : ndarray, shape (n_ball, n_microphone, 9)
        Maximum Fast levels, dB re 20 uPa.
    floor_frequency, room_frequency : ndarray, shape (n_mode,)
        Natural frequencies of plate and room up to 400 Hz, ascending, Hz; the first one of the room
        is 0.
    plate_energy : ndarray, shape (n_ball, 2)
        For each impact, energy input to the modes of the plate and their energy loss, J.
    room_energy : ndarray, shape (n_ball, 2)
        For each impact, energy input to the modes of the room and their energy loss, J.
    """

    prediction: RoomPrediction
    size: tuple[float, float, float]
    frequency: Array
    balls: Array
    microphones: Array
    level: Array
    floor_frequency: Array
    room_frequency: Array
    plate_energy: Array
    room_energy: Array

    @property
    def mean(self) -> Array:
        """Energy mean over all positions, dB, shape (9,)."""
        return np.asarray(10 * np.log10((10 ** (self.level / 10)).mean(axis=(0, 1))))

    @property
    def spread(self) -> Array:
        """Standard deviation of the levels of all positions, dB, shape (9,)."""
        return np.asarray(self.level.std(axis=(0, 1)))

    @property
    def statistical(self) -> Array:
        """Levels and spread of the statistical prediction, dB, shape (2, 9); NaN below 50 Hz."""
        result = np.full((2, N_BAND), np.nan)
        covered = np.isin(self.frequency, self.prediction.frequency)
        n = covered.sum()
        result[:, covered] = self.prediction.level[:n], self.prediction.spread[:n]
        return result

    def rows(self) -> list[tuple[str, ...]]:
        """Return the header and a row of text for each band."""
        header = (
            "band, Hz", "mean, dB", "spread, dB", "minimum, dB", "maximum, dB",
            "statistical, dB", "its spread, dB",
        )  # fmt: skip
        columns = (
            self.mean, self.spread, self.level.min(axis=(0, 1)), self.level.max(axis=(0, 1)),
            *self.statistical,
        )  # fmt: skip
        cells = [[f"{v:.1f}" if np.isfinite(v) else "" for v in column] for column in columns]
        return [header, *zip((f"{f:g}" for f in self.frequency), *cells, strict=True)]

    def plot(self) -> Figure:
        """Draw the levels of all positions and the statistical prediction."""
        from thud.plot.room_figures import draw_modal_room

        return draw_modal_room(self)

    def __repr__(self) -> str:
        """Return the size of the room and the numbers of positions and modes."""
        sides = " x ".join(f"{side:g}" for side in np.round(self.size, 2))
        return (
            f"<ModalRoom {sides} m: {len(self.balls)} x {len(self.microphones)} positions, "
            f"{len(self.floor_frequency)} modes of the floor, {len(self.room_frequency)} of the "
            "room>"
        )


def modal_room(  # noqa: PLR0913 - an impact, a floor, a room, and positions in them
    source: ImpactResult,
    floor: Plate | None = None,
    room: Room | None = None,
    *,
    balls: int | ArrayLike = 16,
    microphones: int | ArrayLike = 32,
    seed: int = 0,
) -> ModalRoom:
    """Compute modal levels below a floor for pairs of positions, in bands up to 160 Hz.

    The floor is simply supported and covers the room, whose height is its volume divided by the
    area of the floor. Walls and ceilings of `room` are left out, in the statistical prediction
    beside it, too. The energy of floor modes decays
    at the rate omega eta of the statistical prediction, the energy of room modes at 6 ln 10/T.

    Parameters
    ----------
    source
        Impact of any model, or a recording. As in the statistical prediction, the force is that on
        the floor, or that on a rigid floor if the model has no other.
    floor, room
        Floor and room; by default those of the impact's case.
    balls : int or array_like, shape (n_ball, 2)
        Number of random positions of the ball, or the positions, m.
    microphones : int or array_like, shape (n_microphone, 3)
        Number of random positions of the microphone, or the positions, m; the third coordinate is
        the height.
    seed
        Seed of the random positions, which are at least 0.5 m away from all boundaries.

    Returns
    -------
    ModalRoom
        Maximum Fast levels for each pair of positions.

    Raises
    ------
    InputError
        If the floor is not a plate, a position is outside, or the room has too many modes.
    """
    prediction = predict_level(source, floor, room)
    return positions_below(prediction, balls=balls, microphones=microphones, seed=seed)


def positions_below(
    prediction: RoomPrediction,
    *,
    balls: int | ArrayLike = 16,
    microphones: int | ArrayLike = 32,
    seed: int = 0,
) -> ModalRoom:
    """Compute the `modal_room` for the impact, floor and room of a prediction."""
    bare = replace(prediction.room, wall_lengths=(), ceiling_mass=0.0)
    if prediction.room != bare:
        prediction = predict_level(prediction.source, prediction.floor, bare)
    floor, room = prediction.floor, prediction.room
    require_kind("floor", floor, Plate)
    assert isinstance(floor, Plate)  # noqa: S101 - for the type checker
    size = (floor.length, floor.width, prediction.volume / (floor.length * floor.width))
    require_whole("seed", seed, 0, MAX_SEED)
    generator = np.random.default_rng(seed)
    positions = _positions("balls", balls, size[:2], generator)
    receivers = _positions("microphones", microphones, size, generator)
    numbers, plate_frequency = _plate_modes(floor)
    orders, room_frequency = _room_modes(size, room.sound_speed)
    result = ask(
        "radiator",
        case=case_text(Case(floor=floor, room=room)),
        frequency=np.maximum(plate_frequency, 1.0),
    )
    losses = 2 * np.pi * plate_frequency * result["loss_factor"]
    decay = 6 * math.log(10) / _reverberation_times(prediction, room_frequency)
    duration = _duration(min(losses.min(), decay.min()))
    omega, force = _spectrum(prediction.source, duration)
    if len(omega) * len(orders) > MAX_VALUES:
        message = (
            f"room: {len(orders)} modes below {MAX_FREQUENCY:g} Hz decay for {duration:.1f} s; "
            "allowed: a smaller volume or reverberation time; for large rooms use the statistical "
            "prediction"
        )
        raise ModeCountError(message)
    mass = result["surface_mass"] * floor.length * floor.width / 4
    plate = _receptance(omega, plate_frequency, losses) * (1j * omega) / mass
    # Mean squares of the mode shapes of the room.
    norms = np.prod(np.where(orders > 0, 0.5, 1.0), axis=1)
    stiffness = room.air_density * room.sound_speed**2 / (prediction.volume * norms)
    air = _receptance(omega, room_frequency, decay) * (1j * omega) * stiffness[:, None]
    coupling = _coupling(orders, numbers, size[:2])
    shapes = np.prod(np.cos(np.pi * orders * receivers[:, None] / size), axis=2)
    levels, plates, rooms = [], [], []
    step = omega[1] / (2 * np.pi)
    for position in positions:
        drive = np.prod(np.sin(np.pi * numbers * position / size[:2]), axis=1)
        velocity = drive[:, None] * plate * force
        flow = coupling @ velocity
        sound = air * flow
        pressure = np.fft.irfft(shapes @ sound, axis=1) * SAMPLE_RATE
        levels.append(fast_levels(pressure).max(axis=2).T)
        # Energies by Parseval's theorem.
        plates.append(
            [
                2 * step * ((drive @ velocity) * force.conj()).real.sum(),
                2 * step * mass * (losses @ (abs(velocity) ** 2)).sum(),
            ]
        )
        rooms.append(
            [
                2 * step * (sound * flow.conj()).real.sum(),
                2 * step * ((decay / stiffness) @ (abs(sound) ** 2)).sum(),
            ]
        )
    return ModalRoom(
        prediction=prediction,
        size=size,
        frequency=get_bands("third").nominal[:N_BAND],
        balls=positions,
        microphones=receivers,
        level=np.array(levels),
        floor_frequency=np.sort(plate_frequency),
        room_frequency=np.sort(room_frequency),
        plate_energy=np.array(plates),
        room_energy=np.array(rooms),
    )


def plate_frequencies(floor: Plate, numbers: ArrayLike) -> Array:
    """Return natural frequencies, Hz, of a simply supported plate for numbers of half-waves."""
    # omega**2 m'' = Bx kx**4 + 2 H kx**2 ky**2 + By ky**4, sqrt(B'/m'') = c_L h/sqrt(12).
    square = (np.pi * np.asarray(numbers) / (floor.length, floor.width)) ** 2
    x, y, ratio = square[..., 0], square[..., 1], math.sqrt(floor.stiffness_ratio)
    root = np.sqrt(x**2 / ratio + 2 * floor.torsion_ratio * x * y + ratio * y**2)
    return np.asarray(floor.wave_speed * floor.thickness / math.sqrt(12) * root / (2 * np.pi))


def _plate_modes(floor: Plate) -> tuple[Array, Array]:
    """Return numbers of half-waves, shape (n, 2), and frequencies of the plate's modes, Hz."""
    # The number of half-waves along a side is largest if there are none along the other side.
    unit = floor.wave_speed * floor.thickness * math.pi / (2 * math.sqrt(12))
    stretch = floor.stiffness_ratio**0.125
    sides = floor.length * stretch, floor.width / stretch
    numbers = _grid([1 + int(side * math.sqrt(MAX_FREQUENCY / unit)) for side in sides])
    numbers += 1
    frequency = plate_frequencies(floor, numbers)
    keep = frequency <= MAX_FREQUENCY
    if not keep.any():
        message = (
            f"floor: the first natural frequency is {frequency.min():.0f} Hz; allowed: a floor "
            f"with modes below {MAX_FREQUENCY:g} Hz"
        )
        raise ModeCountError(message)
    _require_modes("floor: the plate has", int(keep.sum()))
    return numbers[keep], frequency[keep]


def _room_modes(size: tuple[float, float, float], speed: float) -> tuple[Array, Array]:
    """Return numbers of half-waves, shape (n, 3), and frequencies of the room's modes, Hz."""
    counts = [1 + int(2 * side * MAX_FREQUENCY / speed) for side in size]
    _require_modes("room: the volume has", math.prod(counts) // 3)
    orders = _grid(counts)
    frequency = speed / 2 * np.sqrt(((orders / size) ** 2).sum(axis=1))
    keep = frequency <= MAX_FREQUENCY
    return orders[keep], frequency[keep]


def _grid(counts: list[int]) -> Array:
    """Return all combinations of whole numbers, each from 0 to its count - 1."""
    grid = np.meshgrid(*(np.arange(float(count)) for count in counts), indexing="ij")
    return np.stack(grid, -1).reshape(-1, len(counts))


def _require_modes(label: str, count: int) -> None:
    if count > MAX_MODES:
        message = (
            f"{label} about {count} modes below {MAX_FREQUENCY:g} Hz; allowed: at most "
            f"{MAX_MODES}; use the statistical prediction instead"
        )
        raise ModeCountError(message)


def _coupling(orders: Array, numbers: Array, sides: tuple[float, ...]) -> Array:
    """Return the integrals of products of modes over the ceiling, m2, shape (n_room, n_plate).

    The integral of sin(m pi x/L) cos(l pi x/L) is 2 L m/(pi (m**2 - l**2)) if m + l is odd, else 0.
    A room mode with n half-waves along the height has the factor (-1)**n at the ceiling.
    """
    total = (-1.0) ** orders[:, 2:]
    for axis, side in enumerate(sides):
        m, waves = numbers[None, :, axis], orders[:, None, axis]
        odd = (m + waves) % 2 == 1
        product = np.where(odd, 2 * side * m / (np.pi * np.where(odd, m**2 - waves**2, 1.0)), 0.0)
        total = total * product
    return total


def _duration(slowest: float) -> float:
    """Return the length of the record, s, that includes the decay of the slowest mode by 60 dB.

    The record is periodic: a longer decay would wrap around to its beginning. `slowest` is the
    minimum rate of decay of energy, 1/s. Impact and detector take half a second.
    """
    return 0.5 + DECAY_RANGE * math.log(10) / (10 * slowest)


def _receptance(omega: Array, frequency: Array, decay: Array) -> ComplexArray:
    """Return 1/(w0**2 - w**2 + i w a), with `decay` a of the energy, 1/s; 0 at w = 0."""
    natural = 2 * np.pi * frequency[:, None]
    divisor: ComplexArray = natural**2 - omega**2 + 1j * omega * decay[:, None]
    divisor[:, omega == 0] = 1.0
    return (omega > 0) / divisor


def _spectrum(source: ImpactResult, duration: float) -> tuple[Array, ComplexArray]:
    """Return angular frequencies, rad/s, and the Fourier transform of the force, N s."""
    force = source.force("floor")
    # The inverse transform assumes an even number of samples.
    n_sample = 2 * math.ceil(SAMPLE_RATE / 2 * max(duration, len(force) / source.sample_rate))
    omega = 2 * np.pi * np.arange(n_sample // 2 + 1) * SAMPLE_RATE / n_sample
    # Number of force samples in the same period; rounding changes frequencies by less than 1e-5.
    count = round(n_sample * source.sample_rate / SAMPLE_RATE)
    return omega, np.fft.rfft(force, count)[: len(omega)] / source.sample_rate


def fast_levels(pressure: Array) -> Array:
    """Return the Fast levels of sound pressure, dB, shape (9, n_record, n_sample).

    The pressure, Pa, has 1024 samples a second and shape (n_record, n_sample); it is filtered into
    the one-third-octave bands 25 to 160 Hz by filters of class 1.
    """
    decay_factor = math.exp(-1 / (SAMPLE_RATE * TIME_CONSTANT))
    levels = []
    for sections in band_filters("third", SAMPLE_RATE)[:N_BAND]:
        square = sosfilt(sections, pressure, axis=-1) ** 2
        mean = lfilter([1 - decay_factor], [1, -decay_factor], square, axis=-1)
        levels.append(10 * np.log10(np.maximum(mean, 1e-30) / REFERENCE_PRESSURE**2))
    return np.array(levels)


def _reverberation_times(prediction: RoomPrediction, frequency: Array) -> Array:
    """Return the reverberation times of the bands nearest to frequencies, s."""
    distance = abs(np.log(np.maximum(frequency, 1.0)[:, None] / prediction.frequency))
    return np.asarray(prediction.reverberation_time[distance.argmin(axis=1)])


def _positions(
    name: str, value: int | ArrayLike, size: tuple[float, ...], generator: np.random.Generator
) -> Array:
    """Return a number of random positions, or stated positions after a check, m.

    The shape is (n, len(size)); `size` is the length of the sides, m.
    """
    sides = np.array(size)
    if isinstance(value, int | np.integer | float | str):
        require_whole(name, value, 1, MAX_POSITIONS)
        border = np.minimum(BORDER, sides / 4)
        return np.asarray(border + generator.random((int(value), len(size))) * (sides - 2 * border))
    positions = require_real(name, require_array(name, value, dimensions=(2,)))
    if positions.shape[1] != len(size) or not 1 <= len(positions) <= MAX_POSITIONS:
        refuse(
            f"{name} have the shape {positions.shape}",
            f"(n, {len(size)}), n from 1 to {MAX_POSITIONS}",
        )
    outside = positions[~((positions >= 0) & (positions <= sides)).all(axis=1)]
    if len(outside):
        limits = ", ".join(f"0 to {side:g}" for side in size)
        refuse_value(name, outside[0].tolist(), f"{limits} m")
    return positions
