"""Results of drops, and the force of one drop with its origin, as it is written to files."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.base.display import Displayed
from thud.base.immutable import Immutable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.base.note import Note


class ImpactOrRecording(Displayed):
    """Base of `Impact` and `Recording`, which have force, levels and verdict by the same names.

    Arguments are checked for it, as the packages that recordings import take 0.3 s to load.
    """

    def quantity(self, name: str) -> float:
        """Return a quantity, SI units, by its name, such as ``"contact_time"``; NaN if none."""
        return float(getattr(self, name, math.nan))


@dataclass(frozen=True, eq=False)
class DropForce(Immutable):
    """Force of one drop on a rigid floor, with its origin.

    Attributes
    ----------
    name : str
        Name of the drop, also of its files.
    force : ndarray, shape (n_sample,)
        Force, N, positive in compression.
    sample_rate : float
        Samples per second, Hz.
    start : float
        Time of the first sample, s; first touch is at 0.
    kind : str
        ``"floor"`` or ``"elastic"``.
    origin : str
        Case or file of the force.
    checksum : str
        SHA-256 of the case as `thud.write_case` writes it, or of the file.
    date : str
        Date of the measurement; empty if unknown.
    notes : tuple of Note
        Processing of the force.
    """

    name: str
    force: NDArray[np.float64]
    sample_rate: float
    start: float
    kind: str
    origin: str
    checksum: str
    date: str = ""
    notes: tuple[Note, ...] = ()

    @property
    def time(self) -> NDArray[np.float64]:
        """Time since first touch, s, shape (n_sample,)."""
        return self.start + np.arange(len(self.force)) / self.sample_rate
