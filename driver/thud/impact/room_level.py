"""Level in the room below a floor, predicted by the library from a force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import RATINGS
from thud.base.bridge import text
from thud.base.errors import NumericalError
from thud.base.immutable import Immutable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from thud.base._schema import RoomRequiredRating
    from thud.base.bridge import Bundle

    Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RoomLevel(Immutable):
    """Level in the room below, in bands: energy mean over positions.

    Attributes
    ----------
    frequency : ndarray, shape (12,)
        Rounded mid frequencies of the one-third-octave bands 50 to 630 Hz.
    level : ndarray, shape (12,)
        Maximum Fast levels L_i,Fmax, dB re 20 uPa.
    time_of_maximum : ndarray, shape (12,)
        Times of these maxima after the impact, s.
    energy : ndarray, shape (12,)
        Energy that the impact transfers to the floor, J.
    radiation_factor, loss_factor : ndarray, shape (12,)
        Radiation factor and total loss factor of the floor.
    reverberation_time : ndarray, shape (12,)
        Reverberation time of the room, s.
    floor_modes, room_modes : ndarray, shape (12,)
        Expected number of modes in each band.
    few_modes : float
        Number of modes below which the statistical prediction of a band is uncertain.
    mass_per_area : float
        Mass per unit area of the radiating plate, kg/m2.
    volume : float
        Volume of the room, m3.
    spread : ndarray, shape (12,)
        Expected standard deviation of the level at a single position of source and microphone, dB,
        by the modal overlap (Langley and Cotoni 2004).
    path_shares : ndarray, shape (12, 1 + n_wall)
        Fractions of the energy that enters the room, from the floor, directly or through a ceiling,
        and from each flanking wall.
    octave_level, octave_time : ndarray, shape (4,)
        Maximum Fast levels of the octaves 63 to 500 Hz, dB, and the times of these maxima, s. The
        level of an octave is the energy sum of its bands at an instant.
    modal_octave_level : ndarray, shape (4,)
        Levels of the octaves by the modes, dB: energy sums of `modal_level`, less what the sums of
        the statistical levels exceed `octave_level`.
    history_time : ndarray, shape (n_time,)
        Instants after the impact, s.
    history : ndarray, shape (n_time, 12)
        Fast levels of the bands at these instants, dB.
    conductance : ndarray, shape (12,)
        Real part of the mobility: power into the floor per mean square of the force, m/(N s).
    floor_warnings : tuple of str
        Sentences on conditions in which the model of the floor is not valid.
    modal_level, modal_spread : ndarray, shape (12,)
        Levels by the modes of floor and room, dB: energy mean and standard deviation of positions.
        Above the first `n_modal` bands, where three modes of the room overlap, they are
        statistical.
    simple_level, clamped_level : ndarray, shape (12,)
        The same levels if the floor is simply supported or clamped; without a choice of edges,
        `modal_level`.
    n_modal : int
        Number of bands in which the sound is modal.
    size : tuple of float
        Length, width and height of the room, m.
    rated_ends : mapping
        By the name of a rating (``"octaves"``, ``"thirds"``, ``"standardized"``): the mean of its
        values by the statistical and the modal prediction, and the lower and upper end of its
        interval, the root sum of squares of its contributions, dB.
    all_contributions : mapping
        By the name of a rating: lower and upper deviation from its mean, dB, by another conforming
        source, the support of the edges, a reverberation time 20 % shorter or longer, the
        positions, and the model.
    """

    frequency: Array
    level: Array
    time_of_maximum: Array
    energy: Array
    radiation_factor: Array
    loss_factor: Array
    reverberation_time: Array
    floor_modes: Array
    room_modes: Array
    conductance: Array
    few_modes: float
    mass_per_area: float
    volume: float
    spread: Array
    path_shares: Array
    octave_level: Array
    octave_time: Array
    modal_octave_level: Array
    history_time: Array
    history: Array
    floor_warnings: tuple[str, ...]
    modal_level: Array
    modal_spread: Array
    simple_level: Array
    clamped_level: Array
    n_modal: int
    size: tuple[float, float, float]
    rated_ends: Mapping[RoomRequiredRating, tuple[float, float, float]]
    all_contributions: Mapping[RoomRequiredRating, Mapping[str, tuple[float, float]]]

    @property
    def rated(self) -> float:
        """Mean of the A-weighted levels of both predictions in one-third octaves, dB."""
        return self.rated_of("thirds")

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the interval of `rated`, dB."""
        return self.interval_of("thirds")

    @property
    def contributions(self) -> Mapping[str, tuple[float, float]]:
        """Contributions to `interval`: lower and upper deviation from `rated`, dB."""
        return self.all_contributions["thirds"]

    def rated_of(self, name: RoomRequiredRating) -> float:
        """Return the mean of a rating by both predictions, dB."""
        return self.rated_ends[name][0]

    def interval_of(self, name: RoomRequiredRating) -> tuple[float, float]:
        """Return the ends of the interval of a rating, dB."""
        _, low, high = self.rated_ends[name]
        return low, high


def new_room_level(answer: Bundle) -> RoomLevel | None:
    """Return the level from a bundle of the library; None without one."""
    if "room" not in answer:
        return None
    bands = {**answer["room_bands"]}
    for name in ("level", "modal_level", "simple_level", "clamped_level"):
        if not (is_known := np.isfinite(bands[name])).all():
            frequencies = ", ".join(f"{f:g}" for f in bands["frequency"][~is_known])
            message = (
                f"&room: the level in the room is not finite at {frequencies} Hz: a value of the "
                "floor or the room is too extreme to be computed"
            )
            raise NumericalError(message)
    return RoomLevel(
        time_of_maximum=bands.pop("time"),
        **bands,
        few_modes=answer["room"]["few_modes"],
        mass_per_area=answer["room"]["surface_mass"],
        volume=answer["room"]["volume"],
        path_shares=answer["room_paths"]["share"],
        octave_level=answer["room_octaves"]["level"],
        octave_time=answer["room_octaves"]["time"],
        modal_octave_level=answer["room_octaves"]["modal_level"],
        history_time=answer["room_history"]["time"],
        history=answer["room_history"]["level"],
        floor_warnings=tuple(map(text, answer.get("room_warnings", {}).values())),
        n_modal=int(answer["room"]["n_modal"]),
        size=_triple(answer["room_size"]["sides"]),
        rated_ends={name: _triple(answer["room_rated"][name]) for name in RATINGS},
        all_contributions={
            name: {
                title: (float(ends[0, i]), float(ends[1, i]))
                for title, ends in answer["room_contributions"].items()
            }
            for i, name in enumerate(RATINGS)
        },
    )


def _triple(values: Array) -> tuple[float, float, float]:
    first, second, third = values.tolist()
    return first, second, third
