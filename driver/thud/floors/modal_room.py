"""Levels in a modal room below a floor, for positions of ball and microphone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from thud.base._schema import RectangularFloor
from thud.base.bridge import ask
from thud.base.checks import refuse, refuse_value, require_array, require_kind, require_number
from thud.base.display import Tabulated
from thud.case.case import case_text
from thud.floors.prediction import RoomPrediction, predict_level

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from thud.base.display import Columns
    from thud.base.note import Note

    Array = NDArray[np.float64]

# Maximum number of positions of ball or microphone.
MAX_POSITIONS = 1000


@dataclass(frozen=True, eq=False, repr=False)
class ModalRoom(Tabulated):
    """Levels in a modal room below a floor, for positions of ball and microphone.

    Attributes
    ----------
    prediction : RoomPrediction
        Prediction for the same impact, floor and room.
    size : tuple of float
        Length, width and height of the room, m.
    frequency : ndarray, shape (n_band,)
        Rounded mid frequencies of the one-third-octave bands from 50 Hz to the crossover.
    crossover : float
        Frequency above which three modes of the room overlap, Hz.
    balls : ndarray, shape (n_ball, 2)
        Positions of the ball on the floor, from the corner of the room, m.
    microphones : ndarray, shape (n_microphone, 3)
        Positions of the microphones, m; the third coordinate is the height.
    level : ndarray, shape (n_ball, n_microphone, n_band)
        Maximum Fast levels, dB re 20 uPa.
    mean, spread : ndarray, shape (n_band,)
        Energy mean over all positions, and standard deviation of their levels, dB.
    floor_modes, room_modes : int
        Numbers of modes of floor and room that take part.
    floor_energy, room_energy : ndarray, shape (n_ball, 2)
        For each impact, energy input to the modes of floor and room and their energy loss, J.
    pressure : ndarray, shape (n_ball, n_microphone, n_sample)
        Sound pressure of the modes, Pa, at `sample_rate` samples per second.
    sample_rate : float
        Samples of the pressure per second, Hz.
    """

    drawn_by: ClassVar[str] = "room_figures.draw_modal_room"

    prediction: RoomPrediction
    size: tuple[float, float, float]
    frequency: Array
    crossover: float
    balls: Array
    microphones: Array
    level: Array
    mean: Array
    spread: Array
    floor_modes: int
    room_modes: int
    floor_energy: Array
    room_energy: Array
    pressure: Array
    sample_rate: float

    @property
    def notes(self) -> tuple[Note, ...]:
        """Warnings of the prediction."""
        return self.prediction.notes

    def columns(self) -> Columns:
        """Return the levels in bands."""
        return {
            "band, Hz": (self.frequency, "g"),
            "mean, dB": (self.mean, ".1f"),
            "standard deviation, dB": (self.spread, ".1f"),
            "minimum, dB": (self.level.min(axis=(0, 1)), ".1f"),
            "maximum, dB": (self.level.max(axis=(0, 1)), ".1f"),
        }

    def __repr__(self) -> str:
        """Return the size of the room and the numbers of positions and modes."""
        sides = " x ".join(f"{side:g}" for side in np.round(self.size, 2))
        return (
            f"<ModalRoom {sides} m, to {self.crossover:.0f} Hz: {len(self.balls)} x "
            f"{len(self.microphones)} positions, {self.floor_modes} modes of the floor, "
            f"{self.room_modes} of the room>"
        )


def modal_room(
    prediction: RoomPrediction,
    *,
    balls: ArrayLike | None = None,
    microphones: ArrayLike | None = None,
    max_frequency: float | None = None,
) -> ModalRoom:
    """Compute the modal levels of a prediction for pairs of positions, up to the crossover.

    The floor moves in its modes, the air in a rectangular room with rigid walls in its own; the
    reaction of the air is included only as radiation in the loss factor of the floor. Edges whose
    support is not known are simply supported.

    Walls and ceilings of its room and a stated improvement by a covering are left out, in
    `ModalRoom.prediction`, too. The energy of floor modes decays at the rate omega eta, the energy
    of room modes at 6 ln 10/T.

    Parameters
    ----------
    prediction
        Impact, floor and room.
    balls : array_like, shape (n_ball, 2), optional
        Positions of the ball from the corner of the room, m; by default those of
        ``room.positions``.
    microphones : array_like, shape (n_microphone, 3), optional
        Positions of the microphone, m; the third coordinate is the height.
    max_frequency : float, optional
        Highest mid frequency of a band, Hz; by default the crossover. Bands that would take too
        long are left out.

    Raises
    ------
    InputError
        If the floor has no modes, a position is outside, or no band lies below `max_frequency`.
    """
    require_kind("prediction", prediction, RoomPrediction)
    room = replace(prediction.room, wall_lengths=(), ceiling_mass=0.0)
    floor = prediction.floor
    if isinstance(floor, RectangularFloor):
        floor = replace(floor, covering_improvement=())
    if (floor, room) != (prediction.floor, prediction.room):
        prediction = predict_level(prediction.source, floor, room)
    source = prediction.source
    case = replace(source.case, modes=None, floor=prediction.floor, room=prediction.room)
    size = prediction.size
    if max_frequency is not None:
        require_number("max_frequency", max_frequency)
    request = {} if max_frequency is None else {"highest": float(max_frequency)}
    answer = ask(
        "modal_room",
        case=case_text(case),
        force=source.mean_force(),
        sample_rate=source.sample_rate,
        ball=_positions("balls", balls, size[:2]),
        microphone=_positions("microphones", microphones, size),
        **request,
    )
    if not len(answer["frequency"]):
        crossover = answer["crossover"] if max_frequency is None else max_frequency
        refuse(
            f"room: the modes overlap above {crossover:.0f} Hz, below the lowest band",
            "a smaller volume, or max_frequency of at least 50 Hz and few enough modes",
        )
    return ModalRoom(
        prediction=prediction,
        size=size,
        balls=answer.pop("ball").T,
        microphones=answer.pop("microphone").T,
        level=answer.pop("level").transpose(2, 1, 0),
        pressure=answer.pop("pressure").transpose(2, 1, 0),
        floor_modes=int(answer.pop("floor_modes")),
        room_modes=int(answer.pop("room_modes")),
        **answer,
    )


def _positions(name: str, value: ArrayLike | None, sides: tuple[float, ...]) -> Array:
    """Return stated positions after a check, one after the other, m; none for the default."""
    if value is None:
        return np.zeros(0)
    positions = require_array(name, value, (2,), "iuf")
    if positions.shape[1] != len(sides) or not 1 <= len(positions) <= MAX_POSITIONS:
        refuse(
            f"{name} have the shape {positions.shape}",
            f"(n, {len(sides)}), n from 1 to {MAX_POSITIONS}",
        )
    outside = positions[~((positions >= 0) & (positions <= sides)).all(axis=1)]
    if len(outside):
        limits = ", ".join(f"0 to {side:g}" for side in sides)
        refuse_value(name, outside[0].tolist(), f"{limits} m")
    return np.asarray(positions.ravel())
