"""Windows of drops on a plate whose resonance is taken out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from thud.recordings.faults import repair
from thud.recordings.plate import correct_plate

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from thud.recordings.drops import Window
    from thud.recordings.plate import Plate
    from thud.recordings.signal import Signal

# Length of the ringing of a plate that a piece of a signal takes along, periods times quality.
PERIODS = 2.0


def correct_window(window: Window, plate: Plate) -> tuple[Window, tuple[str, ...], tuple[str, ...]]:
    """Return a window of the force that was applied to a plate, what was done, and warnings.

    Raises
    ------
    InputError
        Where the pulse is cut, clipped, doubled or has long dropouts.
    """
    # What clips or drops out is what was recorded; corrected, a dropout would ring.
    force, steps, warnings = repair(window)
    repaired = replace(window.signal, samples=_Repaired(window.signal, window.start, force))
    applied = replace(window.signal, samples=_Corrected(repaired, plate), full_scale=None)
    bounces = tuple(replace(bounce, signal=applied, plate=plate) for bounce in window.bounces)
    told = plate.correction(window.sample_rate)
    return replace(window, signal=applied, bounces=bounces, plate=plate), (*steps, told), warnings


@dataclass(frozen=True, eq=False)
class _Corrected:
    """Samples of a signal without the resonance of its plate."""

    signal: Signal
    plate: Plate

    def __call__(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return the force that was applied to the plate, N, shape (stop - start,)."""
        # What comes before rings on: some periods of the resonance.
        room = math.ceil(
            PERIODS * self.plate.quality * self.signal.sample_rate / self.plate.frequency
        )
        first, last = max(start - room, 0), min(stop + room, self.signal.n_sample)
        force = self.signal.read(first, last)
        corrected = correct_plate(force, self.signal.sample_rate, self.plate)
        return corrected[start - first : stop - first]


@dataclass(frozen=True, eq=False)
class _Repaired:
    """Samples of a signal of which those from `start` on were repaired."""

    signal: Signal
    start: int
    force: NDArray[np.float64]

    def __call__(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return the force, N, shape (stop - start,)."""
        force = self.signal.read(start, stop)
        first, last = max(start, self.start), min(stop, self.start + len(self.force))
        if first < last:
            force[first - start : last - start] = self.force[first - self.start : last - self.start]
        return force
