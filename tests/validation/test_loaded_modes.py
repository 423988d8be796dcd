"""Natural frequencies of the ball under the load of an impact, by a stiffness matrix of our own.

The paper supposes that the second mode of Park et al., 89 Hz, is the free mode of 74 Hz under the
load of the contact. The stiffness is the second derivative of the energy of the deformed elements
(complex steps), with the gas and with the nodes in contact at rest on the floor.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.linalg import eigh

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Values = NDArray[np.float64]

PRESSURE, GAMMA, BULK_RATIO = 101325.0, 1.4, 200.0
GAUSS = [(x / np.sqrt(3), y / np.sqrt(3)) for x in (-1, 1) for y in (-1, 1)]
# Complex step of a first derivative; step of the second, m.
COMPLEX, DIFFERENCE = 1e-20, 1e-7


def shapes(s: float, t: float) -> tuple[Values, Values]:
    """Return the shape functions of four nodes, and their derivatives by s and t."""
    a, b = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])
    return (1 + a * s) * (1 + b * t) / 4, np.array([a * (1 + b * t), b * (1 + a * s)]) / 4


def energy(position: NDArray[np.complex128], start: Values, shear: float) -> NDArray[np.complex128]:
    """Return the energy of neo-Hookean elements with one mean dilatation each, J."""
    volume = deformed = total = 0.0
    for point in GAUSS:
        shape, slope = shapes(*point)
        before, after = slope @ start, slope @ position
        radius, stretch = start[..., 0] @ shape, position[..., 0] @ shape
        weight = 2 * np.pi * radius * np.abs(np.linalg.det(before))
        gradient = np.linalg.solve(before, after)
        hoop = stretch / radius
        ratio = np.linalg.det(gradient) * hoop
        invariant = (gradient**2).sum((1, 2)) + hoop**2
        total = total + weight * shear / 2 * (ratio ** (-2 / 3) * invariant - 3)
        volume, deformed = volume + weight, deformed + weight * ratio
    return total + volume * BULK_RATIO * shear / 2 * (deformed / volume - 1) ** 2


def hessian(function: Callable[[Any], Any], x: Values) -> Values:
    """Return the second derivatives of a function by the last axis of x."""
    unit = np.eye(x.shape[-1])
    return np.stack(
        [
            np.stack(
                [
                    function(x + COMPLEX * 1j * e + DIFFERENCE * d).imag
                    - function(x + COMPLEX * 1j * e - DIFFERENCE * d).imag
                    for d in unit
                ],
                axis=-1,
            )
            for e in unit
        ],
        axis=-2,
    ) / (2 * DIFFERENCE * COMPLEX)


def cavity(inner: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the volume in the inner surface, m3."""
    r, z = inner.reshape(-1, 2).T
    return np.pi / 3 * ((z[1:] - z[:-1]) * (r[1:] ** 2 + r[1:] * r[:-1] + r[:-1] ** 2)).sum()


def frequencies(motion: thud.Motion, instant: int | None, modulus: float, density: float) -> Values:
    """Return the lowest natural frequencies at an instant, Hz; None: free and undeformed."""
    start = motion.start.reshape(-1, 2)
    position = start if instant is None else motion.position[instant].reshape(-1, 2)
    index = np.arange(len(start)).reshape(motion.start.shape[:2])
    cells = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1)
    cells = cells.reshape(-1, 4)
    shear = modulus * (3 * BULK_RATIO + 1) / (9 * BULK_RATIO)
    stiffness, mass = np.zeros((2 * len(start),) * 2), np.zeros(len(start))
    dofs = (2 * cells[:, :, None] + [0, 1]).reshape(-1, 8)
    blocks = hessian(
        lambda x: energy(x.reshape(-1, 4, 2), start[cells], shear), position[cells].reshape(-1, 8)
    )
    np.add.at(stiffness, (dofs[:, :, None], dofs[:, None, :]), blocks)
    for point in GAUSS:
        shape, slope = shapes(*point)
        area = np.abs(np.linalg.det(slope @ start[cells]))
        radius = start[cells][..., 0] @ shape
        np.add.at(mass, cells, (2 * np.pi * density * radius * area)[:, None] * shape)
    inner = (2 * index[:, 0, None] + [0, 1]).ravel()
    surface = position[index[:, 0]].ravel()
    unit = np.eye(len(surface))
    slope = np.array([cavity(surface + COMPLEX * 1j * e).imag for e in unit]) / COMPLEX
    curvature = hessian(cavity, surface)
    volume, full = cavity(surface), cavity(start[index[:, 0]].ravel())
    pressure = PRESSURE * (full / volume) ** GAMMA
    stiffness[np.ix_(inner, inner)] += GAMMA * pressure / volume * np.outer(slope, slope)
    stiffness[np.ix_(inner, inner)] -= (pressure - PRESSURE) * curvature
    free = np.ones(2 * len(start), dtype=bool)
    free[2 * index[[0, -1]].ravel()] = False
    if instant is not None:
        free[2 * index[motion.contact_pressure[instant] > 0, -1] + 1] = False
    scale = 1 / np.sqrt(np.repeat(mass, 2)[free])
    matrix = stiffness[np.ix_(free, free)] * np.outer(scale, scale)
    squares = eigh(matrix, eigvals_only=True, subset_by_index=(0, 3))
    return np.sqrt(np.maximum(squares, 0)) / (2 * np.pi)


def test_load_raises_the_modes_to_those_of_park() -> None:
    impact = thud.solve(
        model="finite_element", radial_elements=6, polar_elements=48, snapshot_interval=4e-4
    )
    motion, ball = impact.motion, impact.case.resolved().ball
    assert motion is not None
    hole = ball.outer_radius - ball.wall_thickness
    density = ball.mass / (4 / 3 * np.pi * (ball.outer_radius**3 - hole**3))
    # Without load: the free modes, which the library computes otherwise.
    free = frequencies(motion, None, ball.youngs_modulus, density)[1:4]
    np.testing.assert_allclose(free, thud.free_modes(ball).frequency[:3], rtol=5e-3)
    # The paper's elements turn 8.5 ms after touch, one of nine instants of its figure 5.
    turning = float(impact.time[impact.deflection.argmax()])
    assert turning == pytest.approx(9.25e-3, abs=0.1e-3)
    instants = np.searchsorted(motion.time, [0.4e-3, 1.2e-3, turning, 18.4e-3])
    loaded = [frequencies(motion, i, ball.youngs_modulus, density)[:2] for i in instants]
    expected = [[24.5, 86.4], [28.7, 91.0], [33.0, 94.6], [22.6, 84.8]]
    np.testing.assert_allclose(loaded, expected, rtol=0.02)
    # Park et al. (2010): 24 Hz and 89 Hz.
    assert np.min(loaded, axis=0) == pytest.approx([24, 89], rel=0.06)
    assert (np.max(loaded, axis=0) > [24, 89]).all()
