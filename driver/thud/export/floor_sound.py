"""Sound of one impact in the room below a floor from its predicted levels, and its own levels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from operator import itemgetter
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
from scipy.signal import butter, lfilter, resample, sosfilt
from scipy.special import exprel

from thud.base._schema import RATED_BANDS
from thud.base.checks import refuse_value, require_whole
from thud.base.display import Tabulated
from thud.base.immutable import freeze
from thud.base.note import Note
from thud.floors.modal_room import modal_room
from thud.floors.prediction import BANDS, RoomPrediction
from thud.level.levels import get_bands
from thud.recordings.filters import band_filters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.base.display import Columns

    Array = NDArray[np.float64]

# Samples per second of the levels, which contain frequencies up to 1 kHz.
RATE = 6000
# Time constant of the Fast detector, s, and reference sound pressure, Pa.
TIME_CONSTANT = 0.125
REFERENCE_PRESSURE = 2e-5
# Samples per second of the sound, a multiple of those of its levels.
RATIO = 8
SAMPLE_RATE = RATIO * RATE
# Order of the filters at the ends of the modal bands, and their frequencies over the band edges:
# these attenuate neither edge much, nor does the sound beyond them exceed the predicted levels.
ORDER = 16
HIGH_PASS, LOW_PASS = 0.9, 1.03
# Order of the filter of noise after its decay is applied.
START_ORDER = 4
# Fraction of the energy at which the sound ends.
END = 1e-6
# Maximum duration, s.
MAX_SOUND = 30.0
# Samples after the modal sound in which the filters decay.
MARGIN = RATE // 10
# Number of iterations of the gains of overlapping bands.
ITERATIONS = 8
# Deviation of octaves and A-weighted level below which a realization of the noise is used, dB, and
# maximum number of realizations, of which the best is used otherwise.
TOLERANCE = 0.25
MAX_REALIZATIONS = 20
# Change of the modal levels by walls, ceiling or covering that is applied, dB.
MIN_CHANGE = 0.01
# Deviation that raises a warning, dB.
MAX_DEVIATION = 0.5


class SoundLevels(NamedTuple):
    """Maximum Fast levels, dB re 20 uPa: of the bands 50 to 630 Hz, of the octaves, and L_AFmax.

    The level of an octave is the maximum of the sum of its bands. The A-weighted level of a
    reference is that of the modal sound and of bands of noise.
    """

    third: Array
    octave: Array
    a_weighted: float

    @property
    def shown(self) -> Array:
        """Levels of the octaves and the A-weighted level, dB, shape (5,)."""
        return np.append(self.octave, self.a_weighted)

    def deviation(self, reference: SoundLevels) -> float:
        """Return the largest difference of octaves and A-weighted levels, dB."""
        return float(abs(self.shown - reference.shown).max())


@dataclass(frozen=True, eq=False, repr=False)
class FloorSound(Tabulated):
    """Sound of one impact in the room below a floor.

    That of the first `RoomPrediction.n_modal` bands is the sound of the modes of floor and room,
    that of the others is noise.

    Attributes
    ----------
    name : str
        Name of the floor.
    prediction : RoomPrediction
        The prediction that the sound represents.
    position : tuple of int or None
        Numbers of the positions of ball and microphone, from 1; None without modal bands.
    pressure : ndarray, shape (n_sample,)
        Sound pressure, Pa, from the impact on.
    level, reference : SoundLevels
        Levels of the sound, and those that it should have: in modal bands the levels at the
        position, in others those of the prediction.
    """

    drawn_by: ClassVar[str] = "room_figures.draw_floor_sound"

    name: str
    prediction: RoomPrediction
    position: tuple[int, int] | None
    pressure: Array
    level: SoundLevels
    reference: SoundLevels

    def __repr__(self) -> str:
        """Return the name of the floor, duration and level."""
        duration = len(self.pressure) / SAMPLE_RATE
        return f"<FloorSound {self.name}: {duration:.1f} s, L_AFmax {self.level.a_weighted:.1f} dB>"

    @property
    def notes(self) -> tuple[Note, ...]:
        """Warnings of the prediction, and of levels that deviate from it."""
        deviation = self.level.deviation(self.reference)
        note = Note("sound_deviates", value=deviation, high=MAX_DEVIATION, unit="dB")
        return self.prediction.notes + (note,) * (deviation > MAX_DEVIATION)

    @property
    def place(self) -> str:
        """Numbers of the positions of ball and microphone; a dash without modal bands."""
        return "-" if self.position is None else "{}, {}".format(*self.position)

    def columns(self) -> Columns:
        """Return the levels in one-third-octave bands, and those that they should have."""
        return {
            "band, Hz": (self.prediction.frequency, "g"),
            "sound, dB": (self.level.third, ".1f"),
            "reference, dB": (self.reference.third, ".1f"),
        }


def new_floor_sound(
    name: str, prediction: RoomPrediction, position: tuple[int, int] | None, seed: int
) -> FloorSound:
    """Return the sound of one floor; the arguments are those of `listen`."""
    n_modal = prediction.n_modal
    place, modal = _modal_pressure(prediction, position) if n_modal else (None, np.zeros(0))
    square = _mean_square(prediction, len(modal) + MARGIN)
    modal = np.append(modal, np.zeros(square.shape[1] - len(modal)))
    target = np.vstack([_fast_histories(modal, range(n_modal)), _fast_history(square)])
    modal = _limited(modal, n_modal)
    reference = _maximum_levels(target, modal, n_modal)
    envelopes = np.sqrt(square)
    pressure, level = _realization(modal, envelopes, reference, seed)
    pressure = resample(pressure, RATIO * len(pressure))
    return FloorSound(name, prediction, place, pressure, level, reference)


def _realization(
    modal: Array, envelopes: Array, reference: SoundLevels, seed: int
) -> tuple[Array, SoundLevels]:
    """Return the pressure with noise whose levels are near the reference, Pa, and its levels."""
    n_band, tried = len(reference.third), []
    for i in range(MAX_REALIZATIONS if len(envelopes) else 1):
        pressure = _with_noise(modal, envelopes, reference, (seed, i))
        level = _maximum_levels(_fast_histories(pressure, range(n_band)), pressure, n_band)
        tried.append((level.deviation(reference), pressure, level))
        if tried[-1][0] < TOLERANCE:
            break
    _, pressure, level = min(tried, key=itemgetter(0))
    return pressure, level


def _mean_square(prediction: RoomPrediction, count: int) -> Array:
    """Return the mean-square pressure of each band of noise, Pa2, at `RATE`, until it is over.

    The energy of the floor decays by its loss factor and enters the room, where it decays with the
    reverberation time: a difference of both decays, that gives the predicted level. `count` is the
    minimum number of samples.
    """
    bands = np.s_[prediction.n_modal :, np.newaxis]
    room = 6 * math.log(10) / prediction.reverberation_time[bands]
    floor = 2 * math.pi * prediction.frequency[bands] * prediction.loss_factor[bands]
    slow, fast = np.minimum(room, floor), np.maximum(room, floor)
    if slow.size:
        duration = min(float(-math.log(END) / slow.min()), MAX_SOUND)
        count = max(count, math.ceil(duration * RATE))
    time = np.arange(1, count + 1) / RATE
    square = time * exprel(-(fast - slow) * time) * np.exp(-slow * time)
    level = REFERENCE_PRESSURE**2 * 10 ** (prediction.level[bands] / 10)
    return np.asarray(square * level / _fast_history(square).max(axis=1, keepdims=True))


def _modal_pressure(
    prediction: RoomPrediction, position: tuple[int, int] | None
) -> tuple[tuple[int, int], Array]:
    """Return the numbers of a position and the sound pressure of the modes there, Pa, at `RATE`."""
    room = modal_room(prediction)
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
    change = prediction.simple_level[: prediction.n_modal] - room.mean
    if np.abs(change).max() > MIN_CHANGE:
        level = room.level[position[0] - 1, position[1] - 1]
        samples = _changed(samples, prediction.frequency[: len(change)], level, change)
    return (position[0], position[1]), np.asarray(samples)


def _changed(modal: Array, frequency: Array, level: Array, change: Array) -> Array:
    """Return the modal pressure with the levels of its bands changed by walls, ceiling or covering.

    The gain is interpolated over the logarithm of frequency, and iterated as the filters overlap.
    """
    # Twice the length, so that no sound returns from the end to the impact.
    count = 2 * len(modal)
    spectrum = np.fft.rfft(modal, count)
    lines = np.log(np.maximum(np.fft.rfftfreq(count, 1 / RATE), 1.0))
    gain = change.copy()
    for _ in range(ITERATIONS):
        response = _minimum_phase(np.interp(lines, np.log(frequency), gain) * np.log(10) / 20)
        changed = np.fft.irfft(spectrum * response, count)[: len(modal)]
        maximum = _fast_histories(changed, range(len(gain))).max(axis=1)
        gain += level + change - 10 * np.log10(maximum / REFERENCE_PRESSURE**2)
    return np.asarray(changed)


def _minimum_phase(log_gain: Array) -> NDArray[np.complex128]:
    """Return the causal response with the logarithm of its magnitude at equal steps (cepstrum)."""
    cepstrum = np.fft.irfft(log_gain)
    half = len(cepstrum) // 2
    cepstrum[1:half] *= 2
    cepstrum[half + 1 :] = 0
    return np.asarray(np.exp(np.fft.rfft(cepstrum)))


def _limited(modal: Array, n_modal: int) -> Array:
    """Return the modal pressure in its bands only: below 50 Hz it may be much louder."""
    if not n_modal:
        return modal
    _, lower, upper = _band_sections()
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
    _, lower, upper = _band_sections()
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
    sections, _, _ = _band_sections()
    rows = [_fast_history(sosfilt(sections[band], pressure) ** 2) for band in indices]
    return np.array(rows).reshape(-1, len(pressure))


def _fast_history(square: Array) -> Array:
    """Return a squared pressure after the Fast detector, Pa2, along the last axis."""
    kept = math.exp(-1 / (TIME_CONSTANT * RATE))
    return np.asarray(lfilter([1 - kept], [1, -kept], square))


def _a_weighting(frequency: Array) -> Array:
    """Return the factor of pressure of the A-weighting at frequencies, Hz (IEC 61672-1 annex E)."""
    f = np.append(frequency, 1000.0)
    low, lower, upper, high = (corner**2 + f**2 for corner in (20.6, 107.65, 737.86, 12194.22))
    response = f**4 / (low * np.sqrt(lower * upper) * high)
    return np.asarray(response[:-1] / response[-1])


@lru_cache
def _band_sections() -> tuple[Array, Array, Array]:
    """Return the filters of the rated one-third-octave bands, and their lower and upper edges."""
    bands = get_bands(BANDS)
    rated = np.isin(bands.nominal, RATED_BANDS[BANDS])
    return band_filters(BANDS, RATE)[rated], bands.lower[rated], bands.upper[rated]


def _maximum_levels(histories: Array, pressure: Array, n_known: int) -> SoundLevels:
    """Return the maximum levels of histories of the squared pressure, Pa2, (12, n_sample).

    `pressure` is the sound pressure, Pa, shape (n_sample,), of the first `n_known` bands; the
    A-weighting of the other bands is that at their mid frequencies.
    """
    gain = _a_weighting(np.asarray(np.fft.rfftfreq(len(pressure), 1 / RATE), float))
    known = np.fft.irfft(np.fft.rfft(pressure) * gain, len(pressure))
    _, lower, upper = _band_sections()
    weights = _a_weighting(np.sqrt(lower * upper)[n_known:]) ** 2
    weighted = _fast_history(known**2) + weights @ histories[n_known:]
    octaves = histories.reshape(-1, 3, histories.shape[1]).sum(axis=1)
    return SoundLevels(freeze(_level(histories)), freeze(_level(octaves)), float(_level(weighted)))


def _level(history: Array) -> Array:
    """Return the maximum levels of histories of the squared pressure, dB."""
    return np.asarray(10 * np.log10(history.max(axis=-1) / REFERENCE_PRESSURE**2))
