"""One channel of one file, in newtons, read piecewise."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class Signal:
    """One channel of one file, in newtons."""

    name: str
    path: str
    sample_rate: float
    n_sample: int
    full_scale: float | None = None
    checksum: str = ""
    date: str = ""
    calibration: str = "N"
    calibration_uncertainty: float = 0.0
    steps: tuple[str, ...] = ()
    samples: NDArray[np.float64] = field(default_factory=lambda: np.empty(0), repr=False)

    def read(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return the force, N, shape (stop - start,), positive in compression."""
        return self.samples[start:stop]

    @classmethod
    def from_array(cls, force: ArrayLike, sample_rate: float, name: str = "recording") -> Signal:
        """Return the signal of an array in memory."""
        samples = np.ascontiguousarray(force, dtype=np.float64)
        return cls(name, "", float(sample_rate), len(samples), samples=samples)
