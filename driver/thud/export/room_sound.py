"""Sounds of impacts in the rooms below floors in one file, calibrated."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from thud.base.checks import refuse, require_kind, require_mapping, require_number, require_whole
from thud.base.display import Tabulated
from thud.base.files import replace_file, require_ending
from thud.export.floor_sound import REFERENCE_PRESSURE, SAMPLE_RATE, FloorSound, new_floor_sound
from thud.export.wav import wav_file
from thud.floors.prediction import RoomPrediction
from thud.level.levels import get_bands

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from thud.base.display import Columns
    from thud.base.note import Note

    Array = NDArray[np.float64]

# Maximum duration of a file and of a pause, s.
MAX_DURATION = 600.0
MAX_PAUSE = 60.0
NOTE = (
    "computed from a prediction, not recorded: no measured room, no furniture, no listener's head; "
    "bands from 50 to 630 Hz only"
)


@dataclass(frozen=True, eq=False, repr=False)
class RoomSound(Tabulated):
    """Sounds of impacts in the rooms below floors, one after the other.

    Attributes
    ----------
    sounds : tuple of FloorSound
        The sound of each floor, in their order.
    pressure : ndarray, shape (n_sample,)
        Sound pressure, Pa.
    sample_rate : int
        Samples per second, Hz.
    full_scale : float
        Sound pressure of a full-scale sample, Pa; the same for all floors.
    starts : ndarray, shape (n_impact,)
        Times of the impacts, s.
    """

    drawn_by: ClassVar[str] = "room_figures.draw_sound"

    sounds: tuple[FloorSound, ...]
    pressure: Array
    sample_rate: int
    full_scale: float
    starts: Array

    @property
    def notes(self) -> tuple[Note, ...]:
        """Warnings on the validity of the sounds; their subjects are the names of the floors."""
        return tuple(replace(n, subject=sound.name) for sound in self.sounds for n in sound.notes)

    @property
    def comment(self) -> str:
        """Comment in the file: full scale, contents and limits."""
        pairs = zip(self.starts, self.sounds, strict=True)
        impacts = "; ".join(
            f"{start:.3f} s {sound.name} (ball, microphone {sound.place})" for start, sound in pairs
        )
        return (
            f"Sound pressure, full scale {self.full_scale:g} Pa. Impacts: {impacts}. "
            f"The sound is {NOTE}."
        )

    def columns(self) -> Columns:
        """Return the levels of the sounds, and in what they deviate most from the predictions."""
        levels = np.array([sound.level.shown for sound in self.sounds]).T
        titles = [*(f"{f:g} Hz, dB" for f in get_bands("octave").nominal[1:]), "L_AFmax, dB"]
        deviations = [sound.level.deviation(sound.reference) for sound in self.sounds]
        return {
            "start, s": (self.starts, ".2f"),
            "floor": ([sound.name for sound in self.sounds], ""),
            "ball, microphone": ([sound.place for sound in self.sounds], ""),
            **{title: (row, ".1f") for title, row in zip(titles, levels, strict=True)},
            "deviation, dB": (deviations, ".1f"),
        }

    def wav(self) -> bytes:
        """Return the content of the WAV file, of 24 bit; raise InputError without soundfile."""
        samples = self.pressure / self.full_scale
        return wav_file(samples, self.sample_rate, self.comment, "PCM_24")

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the WAV file, replacing an existing one; raise OSError if that is not possible."""
        replace_file(require_ending(path, ".wav"), self.wav())

    def __repr__(self) -> str:
        """Return duration, full scale and levels."""
        levels = ", ".join(f"{s.name} {s.level.a_weighted:.1f} dB" for s in self.sounds)
        return (
            f"<RoomSound {len(self.pressure) / self.sample_rate:.1f} s, full scale "
            f"{self.full_scale:g} Pa, L_AFmax: {levels}>"
        )


def listen(
    predictions: RoomPrediction | Mapping[str, RoomPrediction],
    *,
    position: tuple[int, int] | None = None,
    pause: float = 1.0,
    seed: int = 0,
) -> RoomSound:
    """Return the sound of impacts in the rooms below floors.

    Up to the crossover of the room it is the sound pressure of the modes of floor and room at one
    position, above it noise in one-third-octave bands. The mean-square pressure of the noise decays
    as floor and room do; its gain gives each band the predicted maximum Fast level. Edges whose
    support is not known are simply supported.

    Parameters
    ----------
    predictions
        A prediction, or predictions by the names of their floors.
    position
        Numbers of the positions of ball and microphone, from 1, as in `modal_room`; by default
        those whose levels in the modal bands are nearest to the mean of all positions.
    pause
        Time from the end of a sound to the next impact, s, 0 to 60.
    seed
        Seed of the noise, which is the same for all floors.

    Raises
    ------
    InputError
        If an argument is out of range, or the file would last longer than 600 s.
    """
    require_number("pause", pause, 0.0, MAX_PAUSE, "s")
    require_whole("seed", seed, 0, 2**32 - 1)
    named = {"floor": predictions} if isinstance(predictions, RoomPrediction) else predictions
    require_mapping("predictions", named, "objects of RoomPrediction")
    for name, prediction in named.items():
        require_kind(name, prediction, RoomPrediction)
    sounds = [new_floor_sound(*item, position, seed) for item in named.items()]
    gap = round(pause * SAMPLE_RATE)
    lengths = [len(sound.pressure) + gap for sound in sounds]
    duration = (sum(lengths) - gap) / SAMPLE_RATE
    if duration > MAX_DURATION:
        refuse(f"the sound lasts {duration:.0f} s", f"up to {MAX_DURATION:g} s")
    pressure = np.concatenate([np.append(sound.pressure, np.zeros(gap)) for sound in sounds])
    pressure = pressure[: len(pressure) - gap]
    return RoomSound(
        sounds=tuple(sounds),
        pressure=pressure,
        sample_rate=SAMPLE_RATE,
        full_scale=_full_scale(float(abs(pressure).max())),
        starts=np.cumsum([0, *lengths[:-1]]) / SAMPLE_RATE,
    )


def _full_scale(peak: float) -> float:
    """Return the smallest of the values 1, 2, 5, 10 ... that exceeds a peak, Pa."""
    power = 10.0 ** math.floor(math.log10(max(peak, REFERENCE_PRESSURE)))
    return next(value for value in (power, 2 * power, 5 * power, 10 * power) if value > peak)
