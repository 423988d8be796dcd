"""Boundary elements of a half space under axisymmetric loads, for contacts that stick.

Rings of constant pressure and constant radial traction; displacements at the middle of the rings by
Hankel transforms (Johnson, *Contact Mechanics*, 1985, section 3.2). The units are the radius of the
outermost ring and Young's modulus.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import j0, j1

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Largest wavenumber times the width of a ring, and wavenumbers in a panel of Gauss points.
REACH, PANEL, POINTS = 60.0, 1.5, 6


@dataclass(frozen=True)
class HalfSpace:
    """Displacements of the surface due to unit tractions, shape (n, n).

    Attributes
    ----------
    radius, area : ndarray, shape (n,)
        Middle and area of the rings.
    normal, coupling, radial : ndarray, shape (n, n)
        Indentation by pressure and by radial traction, and radial displacement by radial traction.
    back : ndarray, shape (n, n)
        Radial displacement by pressure.
    """

    radius: Array
    area: Array
    normal: Array
    coupling: Array
    back: Array
    radial: Array


def new_half_space(poisson_ratio: float, count: int) -> HalfSpace:
    edge = np.arange(count + 1) / count
    radius = (edge[1:] + edge[:-1]) / 2
    x, weight = np.polynomial.legendre.leggauss(POINTS)
    panel = np.arange(0, REACH * count / PANEL)[:, np.newaxis]
    k = ((panel + 0.5 + x / 2) * PANEL).ravel()
    step = np.tile(weight * PANEL / 2, len(panel))
    bessel = edge[:, np.newaxis] * j1(np.outer(edge, k))
    pressure = np.diff(bessel, axis=0) / k
    x, weight = np.polynomial.legendre.leggauss(12)
    points = radius[:, np.newaxis] + x / (2 * count)
    traction = np.stack([(weight * r / (2 * count)) @ j1(np.outer(r, k)) for r in points])
    zero, one = j0(np.outer(radius, k)) * step, j1(np.outer(radius, k)) * step
    shear = 1 / (2 * (1 + poisson_ratio))
    direct, cross = (1 - poisson_ratio) / shear, (1 - 2 * poisson_ratio) / (2 * shear)
    return HalfSpace(
        radius=radius,
        area=np.pi * np.diff(edge**2),
        normal=direct * zero @ pressure.T,
        coupling=-cross * zero @ traction.T,
        back=-cross * one @ pressure.T,
        radial=direct * one @ traction.T,
    )


def flat_punch_ratio(body: HalfSpace) -> float:
    """Return the force on a flat punch that sticks over that without friction."""
    n = len(body.radius)
    matrix = np.block([[body.normal, body.coupling], [body.back, body.radial]])
    sticking = np.linalg.solve(matrix, np.r_[np.ones(n), np.zeros(n)])[:n]
    free = np.linalg.solve(body.normal, np.ones(n))
    return float(body.area @ sticking / (body.area @ free))


def sphere_force(body: HalfSpace, *, sticks: bool) -> tuple[Array, Array]:
    """Return indentation and force of a sphere of unit radius as ring after ring is touched.

    A ring that is touched keeps its radial displacement for good, if it sticks.
    """
    gap = body.radius**2 / 2
    held = np.zeros_like(gap)
    result = []
    for m in range(1, len(gap)):
        zero = np.zeros(m)
        matrix = body.normal[:m, :m]
        indent, rest, row = np.ones(m), -gap[:m], body.normal[m, :m]
        if sticks:
            blocks = [[matrix, body.coupling[:m, :m]], [body.back[:m, :m], body.radial[:m, :m]]]
            matrix = np.block(blocks)
            indent, rest = np.r_[indent, zero], np.r_[rest, held[:m]]
            row = np.r_[row, body.coupling[m, :m]]
        by_indent, by_rest = np.linalg.solve(matrix, np.c_[indent, rest]).T
        # The next ring is just touched.
        indentation = (gap[m] + row @ by_rest) / (1 - row @ by_indent)
        traction = indentation * by_indent + by_rest
        if sticks:
            held[m] = np.r_[body.back[m, :m], body.radial[m, :m]] @ traction
        result.append((indentation, body.area[:m] @ traction[:m]))
    indentation, force = np.transpose(result)
    return indentation, force


def sphere_ratio(body: HalfSpace) -> float:
    """Return the force on a sphere that sticks over that without friction at one indentation."""
    indentation, force = sphere_force(body, sticks=True)
    free = sphere_force(body, sticks=False)
    # The last rings are not in the free contact of this indentation.
    shown = len(indentation) * 3 // 4
    return float(force[shown] / np.interp(indentation[shown], *free))
