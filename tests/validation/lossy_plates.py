"""Two simply supported plates with a layer between them, each part with a loss factor of its own.

Each pair of half-waves has a complex stiffness matrix of two by two, K (1 + i eta) summed over its
parts, which is inverted at each frequency.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class Part:
    """A plate: mass per area, kg/m2, bending stiffness, N m, and loss factor.

    `falling` is a further loss factor at 1 Hz, which falls as one over the root of the frequency.
    """

    mass: float
    stiffness: float
    loss_factor: float
    falling: float = 0.0


@dataclass(frozen=True)
class LossyPlates:
    """Both plates, sides in m, and stiffness per area, N/m3, and loss factor of the layer."""

    upper: Part
    lower: Part
    layer: float
    layer_loss: float
    sides: tuple[float, float] = (5.0, 4.0)

    def answers(self, half_waves: ArrayLike, frequency: ArrayLike) -> ComplexArray:
        """Return velocities of the lower plate by unit pressures on the upper one, m/(Pa s).

        Both have the shape sin sin of `half_waves`, shape (n_pair, 2). Frequencies are in Hz, shape
        (n_frequency,); the result has the shape (n_pair, n_frequency).
        """
        wave = (np.asarray(half_waves) * np.pi / self.sides) ** 2
        hertz = np.asarray(frequency, float)
        omega = 2 * np.pi * hertz
        layer = self.layer * (1 + 1j * self.layer_loss)
        upper, lower = (
            part.stiffness
            * wave.sum(1)[:, None] ** 2
            * (1 + 1j * (part.loss_factor + part.falling / np.sqrt(hertz)))
            + layer
            - part.mass * omega**2
            for part in (self.upper, self.lower)
        )
        return np.asarray(1j * omega * layer / (upper * lower - layer**2))
