"""Level in the room below a floor, predicted by the library from a force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from thud.base.immutable import Immutable

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from thud.base._schema import RoomRating
    from thud.base.note import Note
    from thud.level.rating import PredictedRating

    Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RoomLevel(Immutable):
    """Level in the room below, in bands: energy mean over positions.

    It is computed by the modes of floor and room up to the crossover, where three modes of the room
    overlap, and statistically above.

    Attributes
    ----------
    frequency : ndarray, shape (12,)
        Rounded mid frequencies of the one-third-octave bands 50 to 630 Hz.
    level, uncertainty : ndarray, shape (12,)
        Maximum Fast levels L_i,Fmax, dB re 20 uPa, and their standard uncertainties, dB. If the
        support of the edges is not known, the level is the energy mean of the following two.
    simple_level, clamped_level : ndarray, shape (12,)
        Levels if the edges of the floor are simply supported or clamped, dB; where the edges do not
        matter or are known, both are `level`.
    conductance : ndarray, shape (12,)
        Real part of the mobility: power into the floor per mean square of the force, m/(N s).
    energy : ndarray, shape (12,)
        Energy that the impact transfers to the floor, J.
    radiation_factor, loss_factor : ndarray, shape (12,)
        Radiation factor and total loss factor of the floor.
    reverberation_time : ndarray, shape (12,)
        Reverberation time of the room, s.
    octave_level : ndarray, shape (4,)
        Maximum Fast levels of the octaves 63 to 500 Hz, dB.
    path_shares : ndarray, shape (12, 1 + n_wall)
        Fractions of the energy that enters the room, from the floor, directly or through a ceiling,
        and from each flanking wall.
    mass_per_area : float
        Mass per unit area of the radiating plate, kg/m2.
    volume : float
        Volume of the room, m3.
    size : tuple of float
        Length, width and height of the room, m.
    n_modal : int
        Number of bands, from the lowest, that are computed by the modes.
    ratings : mapping of str to PredictedRating
        Single-number ratings: ``"octaves"``, ``"thirds"`` and ``"standardized"``.
    probability : float
        Probability that the rating is at most the required one; NaN if the room requires none.
    verdict : str
        ``"conforms"`` to this requirement if the probability is at least 84 %, ``"does not
        conform"`` if it is at most 16 %, else ``"undecided"``; empty if the room requires none.
    floor_notes : tuple of Note
        Warnings on conditions in which the model of the floor is not valid.
    """

    frequency: Array
    level: Array
    uncertainty: Array
    simple_level: Array
    clamped_level: Array
    conductance: Array
    energy: Array
    radiation_factor: Array
    loss_factor: Array
    reverberation_time: Array
    octave_level: Array
    path_shares: Array
    mass_per_area: float
    volume: float
    size: tuple[float, float, float]
    n_modal: int
    ratings: Mapping[RoomRating, PredictedRating]
    probability: float
    verdict: str
    floor_notes: tuple[Note, ...]

    @property
    def has_edges(self) -> bool:
        """Whether the levels with simply supported and with clamped edges differ."""
        return bool((self.simple_level != self.clamped_level).any())
