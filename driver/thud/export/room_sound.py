"""Sound of an impact in the room below a floor, calibrated, from the predicted levels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import butter, lfilter, resample, sosfilt

from thud.base.bridge import version
from thud.base.checks import refuse, refuse_value, require_kind, require_number, require_whole
from thud.base.display import Displayed
from thud.base.files import replace_file
from thud.base.immutable import Immutable
from thud.export.wav import wav_file
from thud.floors.modal_room import positions_below
from thud.floors.prediction import BANDS, RoomPrediction
from thud.level.levels import get_bands
from thud.level.rating import MAX_LEVEL, rated_bands, rating
from thud.recordings.filters import band_filters

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Samples per second of a file, and of the computation, which contains frequencies up to 1 kHz.
SAMPLE_RATE = 48000
RATIO = 8
RATE = SAMPLE_RATE // RATIO
# Time constant of the Fast detector, s, and reference sound pressure, Pa.
TIME_CONSTANT = 0.125
REFERENCE_PRESSURE = 2e-5
# Order of the filters at the ends of the modal bands, and their frequencies over the band edges:
# these attenuate neither edge much, nor does the sound beyond them exceed the predicted levels.
ORDER = 16
HIGH_PASS, LOW_PASS = 0.9, 1.03
# Order of the filter of noise after its decay is applied.
START_ORDER = 4
# Fraction of the energy at which the sound ends.
END = 1e-6
# Maximum duration of a sound and of a file, s.
MAX_SOUND = 30.0
MAX_DURATION = 600.0
# Samples after the modal sound in which the filters decay.
MARGIN = RATE // 10
# Number of iterations of the gains of overlapping bands.
ITERATIONS = 8
# Deviation of octaves and A-weighted level below which a realization of the noise is used, dB, and
# maximum number of realizations, of which the best is used otherwise.
TOLERANCE = 0.25
MAX_REALIZATIONS = 20
# Deviation that raises a warning, dB.
MAX_DEVIATION = 0.5
MAX_PAUSE = 60.0
MAX_REPEAT = 100
NOTE = (
    "computed from a prediction, not recorded: no measured room, no furniture, no listener's head; "
    "bands from 50 to 630 Hz only"
)


@dataclass(frozen=True, eq=False, repr=False)
class SoundLevels(Immutable):
    """Maximum Fast levels of a sound, dB re 20 uPa.

    Attributes
    ----------
    third : ndarray, shape (12,)
        Levels of the one-third-octave bands 50 to 630 Hz.
    octave : ndarray, shape (4,)
        Levels of the octaves 63 to 500 Hz; each is the maximum of the sum of its bands.
    a_weighted : float
        A-weighted level L_AFmax; as a reference, the maximum of the A-weighted sum of all bands.
    """

    third: Array
    octave: Array
    a_weighted: float

    def __repr__(self) -> str:
        """Return the A-weighted level."""
        return f"<SoundLevels: L_AFmax {self.a_weighted:.1f} dB>"


@dataclass(frozen=True, eq=False, repr=False)
class FloorSound(Immutable):
    """Sound of one impact in the room below a floor.

    Attributes
    ----------
    name : str
        Name of the floor.
    prediction : RoomPrediction
        The prediction that the sound represents.
    n_modal : int
        Number of bands, from the lowest, whose sound is that of the modes of floor and room; the
        sound of the others is noise.
    position : tuple of int or None
        Numbers of the positions of ball and microphone, from 1; None without modal bands.
    pressure : ndarray, shape (n_sample,)
        Sound pressure, Pa, from the impact on.
    level, reference : SoundLevels
        Levels of the sound, and those that it should have: in modal bands the levels at the
        position, in others the statistical ones.
    """

    name: str
    prediction: RoomPrediction
    n_modal: int
    position: tuple[int, int] | None
    pressure: Array
    level: SoundLevels
    reference: SoundLevels

    def __repr__(self) -> str:
        """Return the name of the floor, duration and level."""
        duration = len(self.pressure) / SAMPLE_RATE
        return f"<FloorSound {self.name}: {duration:.1f} s, L_AFmax {self.level.a_weighted:.1f} dB>"

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on the prediction and on levels that deviate from it."""
        result = list(self.prediction.warnings)
        if self.prediction.n_modal and not self.n_modal:
            result.append(
                "the modes of the room do not include its walls and ceiling: the sound is noise "
                "with the statistical levels in all bands"
            )
        if (deviation := _deviation(self.level, self.reference)) > MAX_DEVIATION:
            result.append(
                f"the sound deviates from the prediction by {deviation:.1f} dB in an octave or in "
                "the A-weighted level"
            )
        return tuple(f"{self.name}: {sentence}" for sentence in result)


@dataclass(frozen=True, eq=False, repr=False)
class RoomSound(Displayed):
    """Sounds of impacts in the rooms below floors, one after the other.

    Attributes
    ----------
    sounds : tuple of FloorSound
        The sound of each floor.
    pressure : ndarray, shape (n_sample,)
        Sound pressure, Pa.
    sample_rate : int
        Samples per second, Hz.
    full_scale : float
        Sound pressure of a full-scale sample, Pa; the same for all floors.
    starts : ndarray, shape (n_impact,)
        Times of the impacts, s.
    order : tuple of str
        Names of the floors of the impacts.
    """

    sounds: tuple[FloorSound, ...]
    pressure: Array
    sample_rate: int
    full_scale: float
    starts: Array
    order: tuple[str, ...]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on the validity of the sounds, with the names of the floors."""
        return tuple(sentence for sound in self.sounds for sentence in sound.warnings)

    @property
    def comment(self) -> str:
        """Comment in the file: full scale, contents and limits."""
        impacts = "; ".join(
            f"{start:.3f} s {name}" for start, name in zip(self.starts, self.order, strict=True)
        )
        sounds = "; ".join(f"{sound.name}: {_describe(sound)}" for sound in self.sounds)
        return (
            f"Sound pressure, full scale {self.full_scale:g} Pa. Impacts: {impacts}. {sounds}. "
            f"The sound is {NOTE}."
        )

    def rows(self) -> list[tuple[str, ...]]:
        """Return the header and a row of text for each impact: levels, and their deviations."""
        octaves = [f"{f:g} Hz, dB" for f in get_bands("octave").nominal[1:]]
        sounds = {sound.name: sound for sound in self.sounds}
        rows = []
        for start, name in zip(self.starts, self.order, strict=True):
            sound = sounds[name]
            pairs = zip(_summary(sound.level), _summary(sound.reference), strict=True)
            cells = [f"{level:.1f} ({level - reference:+.1f})" for level, reference in pairs]
            place = "-" if sound.position is None else "{}, {}".format(*sound.position)
            rows.append((f"{start:.3f}", name, place, *cells))
        return [("start, s", "floor", "ball, microphone", *octaves, "L_AFmax, dB"), *rows]

    def wav(self) -> bytes:
        """Return the content of the WAV file: one channel of 24 bit."""
        samples = self.pressure / self.full_scale
        return wav_file(samples, self.sample_rate, self.comment, f"thud {version()}")

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the WAV file, replacing an existing one; raise OSError if that is not possible."""
        replace_file(path, self.wav())

    def __repr__(self) -> str:
        """Return duration, full scale and levels."""
        levels = ", ".join(f"{s.name} {s.level.a_weighted:.1f} dB" for s in self.sounds)
        return (
            f"<RoomSound {len(self.pressure) / self.sample_rate:.1f} s, full scale "
            f"{self.full_scale:g} Pa, L_AFmax: {levels}>"
        )


def listen(
    predictions: RoomPrediction | Sequence[RoomPrediction] | Mapping[str, RoomPrediction],
    *,
    position: tuple[int, int] | None = None,
    pause: float = 1.0,
    repeat: int = 1,
    seed: int = 0,
) -> RoomSound:
    """Return the sound of impacts in the rooms below floors.

    Up to the crossover of the room it is the sound pressure of the modes of floor and room at one
    position, above it noise in one-third-octave bands. The mean-square pressure of the noise decays
    as predicted; its gain gives each band the predicted maximum Fast level.

    Parameters
    ----------
    predictions
        A prediction, several, or predictions by the names of their floors.
    position
        Numbers of the positions of ball and microphone, from 1, as in `modal_room`; by default
        those whose levels in the modal bands are nearest to the mean of all positions.
    pause
        Time from the end of a sound to the next impact, s, 0 to 60.
    repeat
        Number of repetitions of all floors in their order, 1 to 100.
    seed
        Seed of the noise, which is the same for all floors.

    Raises
    ------
    InputError
        If an argument is out of range, or the file would last longer than 600 s.
    """
    require_number("pause", pause)
    if not 0 <= pause <= MAX_PAUSE:
        refuse_value("pause", pause, f"0 to {MAX_PAUSE:g} s")
    require_whole("repeat", repeat, 1, MAX_REPEAT)
    require_whole("seed", seed, 0, 2**32 - 1)
    sounds = [_sound(*item, position, seed) for item in _named(predictions).items()]
    gap = round(pause * SAMPLE_RATE)
    ordered = sounds * repeat
    lengths = [len(sound.pressure) + gap for sound in ordered]
    duration = (sum(lengths) - gap) / SAMPLE_RATE
    if duration > MAX_DURATION:
        refuse(f"the sound lasts {duration:.0f} s", f"up to {MAX_DURATION:g} s")
    pressure = np.concatenate([np.append(sound.pressure, np.zeros(gap)) for sound in ordered])
    pressure = pressure[: len(pressure) - gap]
    return RoomSound(
        sounds=tuple(sounds),
        pressure=pressure,
        sample_rate=SAMPLE_RATE,
        full_scale=_full_scale(float(abs(pressure).max())),
        starts=np.cumsum([0, *lengths[:-1]]) / SAMPLE_RATE,
        order=tuple(sound.name for sound in ordered),
    )


def _named(predictions: object) -> dict[str, RoomPrediction]:
    """Return predictions by name; unnamed ones are numbered."""
    if isinstance(predictions, RoomPrediction):
        predictions = [predictions]
    if isinstance(predictions, Mapping):
        named = dict(predictions)
    elif isinstance(predictions, list | tuple):
        named = {f"floor {i}": entry for i, entry in enumerate(predictions, start=1)}
    else:
        named = {}
    if not named:
        refuse_value("predictions", predictions, "one or more objects of RoomPrediction")
    for name, entry in named.items():
        require_kind("name", name, str)
        require_kind(name, entry, RoomPrediction)
    return named


def _sound(
    name: str, prediction: RoomPrediction, position: tuple[int, int] | None, seed: int
) -> FloorSound:
    """Return the sound of one floor."""
    room = prediction.room
    # The modes of the room do not include walls and ceiling.
    n_modal = 0 if room.wall_lengths or room.ceiling_mass else prediction.n_modal
    step = prediction.history_time[0]
    square = _mean_square(prediction)
    modal = np.zeros(0)
    if n_modal:
        position, modal = _modal_pressure(prediction, position)
    else:
        position = None
    count = max(math.ceil(len(square) * step * RATE), len(modal) + MARGIN)
    time = np.arange(1, count + 1) / RATE
    modal = np.append(modal, np.zeros(count - len(modal)))
    histories = REFERENCE_PRESSURE**2 * 10 ** (prediction.history / 10)
    target = _interpolated(time, prediction.history_time, histories)
    target[:n_modal] = _fast_histories(modal, range(n_modal))
    reference = _levels(target)
    modal = _limited(modal, n_modal)
    middle = (np.arange(len(square)) + 0.5) * step
    envelopes = np.sqrt(_interpolated(time, middle, square[:, n_modal:]))
    # What the filter has removed may decay longest.
    audible = np.flatnonzero((modal**2 > END * (modal**2).max()) | envelopes.any(axis=0))
    end = audible[-1] + 1
    pressure, level = _realization(modal[:end], envelopes[:, :end], reference, seed)
    pressure = resample(pressure, RATIO * len(pressure))
    return FloorSound(name, prediction, n_modal, position, pressure, level, reference)


def _interpolated(time: Array, known_time: Array, values: Array) -> Array:
    """Return columns of values at other times, as rows; zero at the impact and after the end."""
    known_time = np.append(0.0, known_time)
    rows = [np.interp(time, known_time, np.append(0.0, column), right=0.0) for column in values.T]
    return np.array(rows).reshape(-1, len(time))


def _realization(
    modal: Array, envelopes: Array, reference: SoundLevels, seed: int
) -> tuple[Array, SoundLevels]:
    """Return the pressure with noise whose levels are near the reference, Pa, and its levels."""
    tried = []
    for i in range(MAX_REALIZATIONS if len(envelopes) else 1):
        pressure = _with_noise(modal, envelopes, reference, (seed, i))
        level = _measured(pressure)
        tried.append((_deviation(level, reference), pressure, level))
        if tried[-1][0] < TOLERANCE:
            break
    _, pressure, level = min(tried, key=itemgetter(0))
    return pressure, level


def _mean_square(prediction: RoomPrediction) -> Array:
    """Return the mean-square pressure of each band, Pa2, in steps of the history, until it is over.

    It is the constant input in each step that gives the Fast detector the predicted history.
    """
    step = prediction.history_time[0]
    kept = math.exp(-step / TIME_CONSTANT)
    output = REFERENCE_PRESSURE**2 * 10 ** (prediction.history / 10)
    before = np.vstack([np.zeros_like(output[:1]), output[:-1]])
    square = np.maximum((output - kept * before) / (1 - kept), 0.0)
    # The history ends 30 dB below the maximum of the slowest band; its last decay continues.
    end = END * square.max(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        decay = np.log(square[-2] / square[-1])
        steps = np.where(square[-1] > end, np.log(square[-1] / end) / decay, 0.0)
    steps = np.where(np.isfinite(steps) & (steps > 0), steps, 0.0)
    count = math.ceil(min(steps.max(), MAX_SOUND / step))
    more = np.arange(1, count + 1)[:, None]
    tail = np.where(steps > 0, square[-1] * np.exp(-more * np.where(steps > 0, decay, 0.0)), 0.0)
    return np.vstack([square, tail])


def _modal_pressure(
    prediction: RoomPrediction, position: tuple[int, int] | None
) -> tuple[tuple[int, int], Array]:
    """Return the numbers of a position and the sound pressure of the modes there, Pa, at `RATE`."""
    room = positions_below(prediction)
    if position is None:
        distance = ((room.level - room.mean) ** 2).sum(axis=2)
        # Positions that are equal by symmetry differ by rounding: the first of them is chosen.
        i, j = np.unravel_index(distance.round(6).argmin(), distance.shape)
        position = int(i) + 1, int(j) + 1
    if not isinstance(position, list | tuple) or len(position) != 2:  # noqa: PLR2004
        refuse_value("position", position, "the numbers of the positions of ball and microphone")
    require_whole("position: ball", position[0], 1, len(room.balls))
    require_whole("position: microphone", position[1], 1, len(room.microphones))
    pressure = room.pressure[position[0] - 1, position[1] - 1]
    # The record is periodic.
    samples = resample(pressure, round(len(pressure) * RATE / room.sample_rate))
    return (position[0], position[1]), np.asarray(samples)


def _limited(modal: Array, n_modal: int) -> Array:
    """Return the modal pressure in its bands only: below 50 Hz it may be much louder."""
    if not n_modal:
        return modal
    _, lower, upper = _bands()
    edges = HIGH_PASS * lower[0], LOW_PASS * upper[n_modal - 1]
    for edge, kind, order in zip(edges, ("highpass", "lowpass"), (ORDER // 2, ORDER), strict=True):
        modal = sosfilt(butter(order, edge, kind, fs=RATE, output="sos"), modal)
    return modal


def _with_noise(
    modal: Array, envelopes: Array, reference: SoundLevels, seed: tuple[int, int]
) -> Array:
    """Return the modal pressure and the noise in the bands above, Pa, shape (n_sample,).

    `envelopes` are the root-mean-square pressures in these bands, Pa, shape (n_noise, n_sample).
    """
    _, lower, upper = _bands()
    n_band, n_sample = len(lower), len(modal)
    indices = range(n_band - len(envelopes), n_band)
    white = np.fft.rfft(np.random.default_rng(seed).standard_normal(n_sample))
    frequency = np.fft.rfftfreq(n_sample, 1 / RATE)
    noise = np.empty_like(envelopes)
    for row, band in enumerate(indices):
        inside = (lower[band] <= frequency) & (frequency < upper[band])
        samples = np.fft.irfft(white * inside, n_sample)
        # This filter removes what the sudden start of the noise adds to other bands.
        start = butter(START_ORDER, (lower[band], upper[band]), "bandpass", fs=RATE, output="sos")
        noise[row] = sosfilt(start, envelopes[row] * samples / np.sqrt(np.mean(samples**2)))
    gain = np.ones(len(noise))
    for _ in range(ITERATIONS if len(noise) else 0):
        maximum = _fast_histories(modal + gain @ noise, indices).max(axis=1)
        gain *= 10 ** (reference.third[indices.start :] / 20) / np.sqrt(
            maximum / REFERENCE_PRESSURE**2
        )
    return np.asarray(modal + gain @ noise)


def _fast_histories(pressure: Array, indices: Sequence[int]) -> Array:
    """Return the squared pressure after the Fast detector in bands, Pa2, (n_band, n_sample)."""
    sections, _, _ = _bands()
    rows = [_fast_history(sosfilt(sections[band], pressure)) for band in indices]
    return np.array(rows).reshape(-1, len(pressure))


def _fast_history(pressure: Array) -> Array:
    """Return the squared pressure after the Fast detector, Pa2, shape (n_sample,)."""
    kept = math.exp(-1 / (TIME_CONSTANT * RATE))
    return np.asarray(lfilter([1 - kept], [1, -kept], pressure**2))


def _measured(pressure: Array) -> SoundLevels:
    """Return the levels of a sound pressure, Pa, shape (n_sample,)."""
    level = _levels(_fast_histories(pressure, range(len(_weights()))))
    # The weighting between the mid frequencies is interpolated.
    bands = np.log(rated_bands(BANDS))
    frequency = np.log(np.maximum(np.fft.rfftfreq(len(pressure), 1 / RATE), 1.0))
    gain = np.exp(np.interp(frequency, bands, np.log(_weights()) / 2))
    weighted = _fast_history(np.fft.irfft(np.fft.rfft(pressure) * gain, len(pressure)))
    return replace(level, a_weighted=float(_level(weighted)))


@lru_cache
def _bands() -> tuple[Array, Array, Array]:
    """Return the filters of the rated one-third-octave bands, and their lower and upper edges."""
    bands = get_bands(BANDS)
    rated = np.isin(bands.nominal, rated_bands(BANDS))
    return band_filters(BANDS, RATE)[rated], bands.lower[rated], bands.upper[rated]


@lru_cache
def _weights() -> Array:
    """Return the factors of the A-weighting in the rated one-third-octave bands."""
    n_band = len(rated_bands(BANDS))
    alone = np.where(np.eye(n_band) > 0, 0.0, -MAX_LEVEL)
    return np.array([10 ** (rating(levels, BANDS).a_weighted / 10) for levels in alone])


def _levels(histories: Array) -> SoundLevels:
    """Return the maximum levels of histories of the squared pressure, Pa2, (12, n_sample)."""
    octaves = histories.reshape(-1, 3, histories.shape[1]).sum(axis=1)
    weighted = _weights() @ histories
    return SoundLevels(_level(histories), _level(octaves), float(_level(weighted)))


def _level(history: Array) -> Array:
    """Return the maximum levels of histories of the squared pressure, dB."""
    return np.asarray(10 * np.log10(history.max(axis=-1) / REFERENCE_PRESSURE**2))


def _summary(level: SoundLevels) -> Array:
    """Return the levels of the octaves and the A-weighted level, dB."""
    return np.append(level.octave, level.a_weighted)


def _deviation(level: SoundLevels, reference: SoundLevels) -> float:
    """Return the largest difference of octaves and A-weighted levels, dB."""
    return float(abs(_summary(level) - _summary(reference)).max())


def _describe(sound: FloorSound) -> str:
    """Return the bands of the modal sound and of the noise."""
    bands = rated_bands(BANDS)
    parts = []
    if sound.position is not None:
        parts.append(
            f"modes of floor and room from {bands[0]:g} to {bands[sound.n_modal - 1]:g} Hz at ball "
            "position {} and microphone position {}".format(*sound.position)
        )
    if sound.n_modal < len(bands):
        parts.append(f"noise from {bands[sound.n_modal]:g} to {bands[-1]:g} Hz")
    return ", ".join(parts)


def _full_scale(peak: float) -> float:
    """Return the smallest of the values 1, 2, 5, 10 ... that exceeds a peak, Pa."""
    power = 10.0 ** math.floor(math.log10(max(peak, REFERENCE_PRESSURE)))
    return next(value for value in (power, 2 * power, 5 * power, 10 * power) if value > peak)
