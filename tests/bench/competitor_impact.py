"""Impact of the undamped rubber ball on a rigid floor by CalculiX, for the benchmarks.

The half cross-section of the ball has 5 x 64 quadratic elements of a nearly incompressible
neo-Hookean material and falls on a fixed slab. There is neither gravity nor gas.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

RADIUS, WALL, MASS = 0.089, 0.032, 2.5
MODULUS, POISSON = 1.6e6, 0.49
DENSITY = MASS / (4 / 3 * np.pi * (RADIUS**3 - (RADIUS - WALL) ** 3))
VELOCITY = np.sqrt(2 * 9.81 * 1.0)
THROUGH, ALONG = 5, 64
SLAB_HOLE, SLAB_RADIUS, SLAB_THICKNESS = 1e-3, 0.1, 0.01
PENALTY = 1e9


class CompetitorMissingError(RuntimeError):
    """CalculiX is not installed."""


@dataclass(frozen=True)
class Impact:
    """Result of `calculix_impact`, in SI units."""

    time: np.ndarray
    force: np.ndarray
    """Sum of the reactions of the floor, positive upwards."""
    strain_energy: np.ndarray
    kinetic_energy: np.ndarray

    @property
    def contact_time(self) -> float:
        """Time from the first increment to the last one with a force."""
        return float(self.time[np.flatnonzero(self.force > 0)[-1]])

    @property
    def rebound_velocity(self) -> float:
        """Velocity of the centre of mass at the end, from the impulse."""
        return float(np.trapezoid(self.force, self.time) / MASS - VELOCITY)


def ball_lines() -> list[str]:
    """Return nodes, elements, sets and the outer face of the ball."""
    numbers = np.zeros((2 * ALONG + 1, 2 * THROUGH + 1), dtype=int)
    exists = np.ones_like(numbers, dtype=bool)
    exists[1::2, 1::2] = False
    numbers[exists] = np.arange(1, exists.sum() + 1)
    angle, radius = (
        a[exists]
        for a in np.meshgrid(
            np.linspace(0, np.pi, 2 * ALONG + 1),
            np.linspace(RADIUS - WALL, RADIUS, 2 * THROUGH + 1),
            indexing="ij",
        )
    )
    across = np.where(np.isclose(np.sin(angle), 0, atol=1e-12), 0, radius * np.sin(angle))
    places = np.column_stack((across, -radius * np.cos(angle)))
    # The eight nodes in steps of angle and radius: counterclockwise, corners first.
    steps = ((0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0))
    corners = [(i, j) for i in range(0, 2 * ALONG, 2) for j in range(0, 2 * THROUGH, 2)]
    elements = [[numbers[i + a, j + b] for a, b in steps] for i, j in corners]
    return [
        "*NODE, NSET=BALL",
        *(f"{i}, {x:.12g}, {y:.12g}" for i, (x, y) in enumerate(places, 1)),
        "*ELEMENT, TYPE=CAX8R, ELSET=BALL",
        *(f"{i}, " + ", ".join(map(str, e)) for i, e in enumerate(elements, 1)),
        "*NSET, NSET=AXIS", *(f"{i}," for i in numbers[[0, -1]].ravel()),
        "*SURFACE, NAME=OUTSIDE",
        *(f"{i}, S2" for i in range(THROUGH, len(elements) // 2 + 1, THROUGH)),
    ]  # fmt: skip


def floor_lines() -> list[str]:
    """Return nodes, elements and the upper face of the floor.

    The innermost element is small because ccx finds no contact on its collapsed side.
    """
    nodes = 9001
    elements = THROUGH * ALONG + 1
    radii = (0, SLAB_HOLE / 2, SLAB_HOLE, (SLAB_HOLE + SLAB_RADIUS) / 2, SLAB_RADIUS)
    lower, middle, upper = (-RADIUS - depth for depth in (SLAB_THICKNESS, SLAB_THICKNESS / 2, 0))
    places = [
        *((r, lower) for r in radii), *((r, upper) for r in radii), *((r, middle) for r in radii[::2])
    ]
    corners = ((0, 2, 7, 5, 1, 11, 6, 10), (2, 4, 9, 7, 3, 12, 8, 11))
    return [
        "*NODE, NSET=FLOOR",
        *(f"{i}, {x:g}, {y:g}" for i, (x, y) in enumerate(places, nodes)),
        "*ELEMENT, TYPE=CAX8R, ELSET=FLOOR",
        *(f"{i}, " + ", ".join(str(nodes + k) for k in e) for i, e in enumerate(corners, elements)),
        "*SURFACE, NAME=TOP",
        *(f"{elements + i}, S3" for i in range(2)),
    ]


def calculix_deck(increment: float, duration: float, alpha: float) -> str:
    """Return the input of CalculiX."""
    shear, bulk = MODULUS / (2 * (1 + POISSON)), MODULUS / (3 * (1 - 2 * POISSON))
    return "\n".join([
        *ball_lines(),
        *floor_lines(),
        "*BOUNDARY", "AXIS, 1, 1", "FLOOR, 1, 1",
        "*AMPLITUDE, NAME=MOTION", f"0, 0, {duration:g}, {VELOCITY * duration:.12g}",
        "*MATERIAL, NAME=RUBBER",
        "*HYPERELASTIC, NEO HOOKE", f"{shear / 2:.12g}, {2 / bulk:.12g}",
        "*DENSITY", f"{DENSITY:.12g}",
        "*SOLID SECTION, ELSET=BALL, MATERIAL=RUBBER",
        "*MATERIAL, NAME=STEEL",
        "*ELASTIC", "2.1e11, 0.3",
        "*DENSITY", "1e-6",
        "*SOLID SECTION, ELSET=FLOOR, MATERIAL=STEEL",
        "*SURFACE INTERACTION, NAME=HARD",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{PENALTY:g}",
        "*CONTACT PAIR, INTERACTION=HARD, TYPE=SURFACE TO SURFACE", "OUTSIDE, TOP",
        f"*STEP, NLGEOM, INC={round(duration / increment) + 1}",
        f"*DYNAMIC, DIRECT, ALPHA={alpha:g}", f"{increment:g}, {duration:g}",
        "*BOUNDARY, AMPLITUDE=MOTION", "FLOOR, 2, 2, 1",
        "*NODE PRINT, NSET=FLOOR, TOTALS=ONLY", "RF",
        "*EL PRINT, ELSET=BALL, TOTALS=ONLY", "ELSE, ELKE",
        "*END STEP", "",
    ])  # fmt: skip
