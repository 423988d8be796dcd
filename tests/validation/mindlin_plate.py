"""Orthotropic Mindlin plates: closed form of simply supported edges, and spectral elements.

Deflection w and rotations of the sections a and b (u = -z a, v = -z b) have the strain energy per
area (D11 a_x**2 + 2 D12 a_x b_y + D22 b_y**2 + D66 (a_y + b_x)**2 + S1 (w_x - a)**2
+ S2 (w_y - b)**2)/2 and the rotary inertia rho h**3/12 (Mindlin 1951). The spectral elements have
Lagrange polynomials on Gauss–Lobatto points, the same for all three fields: free edges and edge
springs follow from the energy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh, solve

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class ThickPlate:
    """An orthotropic plate with transverse shear.

    Attributes
    ----------
    length, width : float
        Sides along x and y, m.
    d11, d12, d22, d66 : float
        Bending stiffnesses, N m.
    s1, s2 : float
        Shear stiffnesses kappa G h in the planes xz and yz, N/m.
    mass, rotary_inertia : float
        rho h, kg/m2, and rho h**3/12, kg.
    loss_factor : float
        Loss factor of all stiffnesses.
    """

    length: float
    width: float
    d11: float
    d12: float
    d22: float
    d66: float
    s1: float
    s2: float
    mass: float
    rotary_inertia: float
    loss_factor: float = 0.0


@dataclass(frozen=True)
class ThickEdge:
    """Springs per length of an edge against w, the slope across it and the slope along it.

    Units N/m2, N and N; infinite springs hold the edge exactly.
    """

    translation: float = 0.0
    rotation: float = 0.0
    tangential: float = 0.0


# Hard simple support: the rotation along the edge is held, as in the closed form.
FREE, SUPPORTED = ThickEdge(), ThickEdge(math.inf, 0.0, math.inf)
CLAMPED = ThickEdge(math.inf, math.inf, math.inf)


def isotropic_thick_plate(  # noqa: PLR0913 - sides and material
    length: float,
    width: float,
    thickness: float,
    *,
    youngs_modulus: float,
    poisson_ratio: float,
    density: float,
    shear_factor: float = 5 / 6,
    loss_factor: float = 0.0,
) -> ThickPlate:
    """Return a homogeneous isotropic plate."""
    bending = youngs_modulus * thickness**3 / (12 * (1 - poisson_ratio**2))
    shear = shear_factor * youngs_modulus / (2 * (1 + poisson_ratio)) * thickness
    return ThickPlate(
        length=length, width=width, d11=bending, d12=poisson_ratio * bending, d22=bending,
        d66=(1 - poisson_ratio) / 2 * bending, s1=shear, s2=shear, mass=density * thickness,
        rotary_inertia=density * thickness**3 / 12, loss_factor=loss_factor,
    )  # fmt: skip


def get_supported_frequencies(plate: ThickPlate, m: ArrayLike, n: ArrayLike) -> Array:
    """Return the three frequencies, Hz, of each pair of half-waves, simply supported (Navier).

    w = W sin sin, a = A cos sin, b = B sin cos; shape (n_pair, 3), ascending.
    """
    result = []
    for p, q in zip(
        np.ravel(m) * np.pi / plate.length, np.ravel(n) * np.pi / plate.width, strict=True
    ):
        twist, coupled = plate.d66, (plate.d12 + plate.d66) * p * q
        stiffness = [
            [plate.s1 * p**2 + plate.s2 * q**2, -plate.s1 * p, -plate.s2 * q],
            [-plate.s1 * p, plate.d11 * p**2 + twist * q**2 + plate.s1, coupled],
            [-plate.s2 * q, coupled, plate.d22 * q**2 + twist * p**2 + plate.s2],
        ]
        inertia = np.diag([plate.mass, plate.rotary_inertia, plate.rotary_inertia])
        result.append(np.sqrt(eigh(stiffness, inertia, eigvals_only=True)) / (2 * np.pi))
    return np.array(result)


def get_supported_mobility(
    plate: ThickPlate,
    frequency: ArrayLike,
    source: tuple[float, float],
    receiver: tuple[float, float],
    count: int = 100,
) -> ComplexArray:
    """Return the transfer mobility, m/(N s), simply supported, by `count` half-waves a side.

    At the point of the force itself, shear makes the static deflection infinite: there, the result
    grows with the logarithm of `count`, with losses also its real part.
    """
    omega = 2 * np.pi * np.atleast_1d(np.asarray(frequency, float))[:, None, None]
    half_waves = np.arange(1, count + 1)
    p, q = half_waves[:, None] * np.pi / plate.length, half_waves * np.pi / plate.width
    loss = 1 + 1j * plate.loss_factor
    s1, s2, inertia = loss * plate.s1, loss * plate.s2, plate.rotary_inertia * omega**2
    one = loss * (plate.d11 * p**2 + plate.d66 * q**2) + s1 - inertia
    two = loss * (plate.d22 * q**2 + plate.d66 * p**2) + s2 - inertia
    coupled = loss * (plate.d12 + plate.d66) * p * q
    # Rotations eliminated.
    shear = ((s1 * p) ** 2 * two + (s2 * q) ** 2 * one - 2 * s1 * p * s2 * q * coupled) / (
        one * two - coupled**2
    )
    dynamic = s1 * p**2 + s2 * q**2 - plate.mass * omega**2 - shear
    shape = np.sin(p * source[0]) * np.sin(q * source[1])
    shape = shape * np.sin(p * receiver[0]) * np.sin(q * receiver[1])
    area = plate.length * plate.width
    return np.asarray(1j * omega[:, 0, 0] * (4 / area * shape / dynamic).sum((1, 2)))


def lobatto(order: int) -> tuple[Array, Array]:
    """Return Gauss–Lobatto points on [-1, 1] and the matrix of derivatives."""
    last = np.polynomial.legendre.Legendre.basis(order)
    points = np.r_[-1.0, np.sort(last.deriv().roots().real), 1.0]
    value = last(points)
    difference = points[:, None] - points
    np.fill_diagonal(difference, 1.0)
    derivative = value[:, None] / value / difference
    np.fill_diagonal(derivative, 0.0)
    derivative[0, 0], derivative[-1, -1] = -order * (order + 1) / 4, order * (order + 1) / 4
    return points, derivative


def _line(side: float, order: int, count: int) -> tuple[Array, Array, Array, Array]:
    """Return nodes, mass, stiffness and the integrals of f g' along a side."""
    points, derivative = lobatto(order)
    gauss, gauss_weight = np.polynomial.legendre.leggauss(order + 1)
    values = np.linalg.solve(
        np.polynomial.legendre.legvander(points, order).T,
        np.polynomial.legendre.legvander(gauss, order).T,
    ).T
    slopes = values @ derivative
    h = side / count
    size = order * count + 1
    nodes = np.empty(size)
    mass, stiffness, mixed = (np.zeros((size, size)) for _ in range(3))
    for element in range(count):
        at = slice(element * order, (element + 1) * order + 1)
        nodes[at] = h * (element + (1 + points) / 2)
        mass[at, at] += h / 2 * values.T @ (gauss_weight[:, None] * values)
        stiffness[at, at] += 2 / h * slopes.T @ (gauss_weight[:, None] * slopes)
        mixed[at, at] += values.T @ (gauss_weight[:, None] * slopes)
    return nodes, mass, stiffness, mixed


@dataclass(frozen=True)
class ThickSystem:
    """Dense matrices of the free unknowns, and the nodes.

    Attributes
    ----------
    stiffness, mass : ndarray, shape (n, n)
        Real matrices.
    x, y : ndarray
        Nodes.
    free : ndarray, shape (n,)
        Indices of the unknowns among w, a and b at all nodes, y fastest.
    """

    stiffness: Array
    mass: Array
    x: Array
    y: Array
    free: NDArray[np.int64]


def assemble_thick(
    plate: ThickPlate,
    edges: tuple[ThickEdge, ThickEdge, ThickEdge, ThickEdge],
    order: int = 10,
    elements: tuple[int, int] = (1, 1),
) -> ThickSystem:
    """Return the matrices with edges at x = 0, x = length, y = 0 and y = width."""
    x, mx, kx, cx = _line(plate.length, order, elements[0])
    y, my, ky, cy = _line(plate.width, order, elements[1])
    n = len(x) * len(y)
    area = np.kron(mx, my)
    # Integrals of f g_x and f g_y; those of f_x g_y are cx.T times cy.
    slope_x, slope_y, crossed = np.kron(cx, my), np.kron(mx, cy), np.kron(cx.T, cy)
    along, across = np.kron(kx, my), np.kron(mx, ky)
    coupled = plate.d12 * crossed + plate.d66 * crossed.T
    one = plate.d11 * along + plate.d66 * across + plate.s1 * area
    two = plate.d22 * across + plate.d66 * along + plate.s2 * area
    stiffness = np.block(
        [
            [plate.s1 * along + plate.s2 * across, -plate.s1 * slope_x.T, -plate.s2 * slope_y.T],
            [-plate.s1 * slope_x, one, coupled],
            [-plate.s2 * slope_y, coupled.T, two],
        ]
    )
    mass = np.zeros_like(stiffness)
    densities = (plate.mass, plate.rotary_inertia, plate.rotary_inertia)
    for field, density in enumerate(densities):
        mass[field * n : (field + 1) * n, field * n : (field + 1) * n] = density * area
    held = np.zeros((3, len(x), len(y)), bool)
    for side, edge in enumerate(edges):
        at = (-(side % 2), slice(None)) if side < 2 else (slice(None), -(side % 2))
        unit = np.zeros(len(x) if side < 2 else len(y))
        unit[-(side % 2)] = 1
        line = np.kron(np.diag(unit), my) if side < 2 else np.kron(mx, np.diag(unit))
        normal = 1 if side < 2 else 2
        springs = {0: edge.translation, normal: edge.rotation, 3 - normal: edge.tangential}
        for field, spring in springs.items():
            if math.isinf(spring):
                held[(field, *at)] = True
            else:
                block = slice(field * n, (field + 1) * n)
                stiffness[block, block] += spring * line
    free = np.flatnonzero(~held)
    pick = np.ix_(free, free)
    return ThickSystem(stiffness[pick], mass[pick], x, y, free)


def get_thick_modes(system: ThickSystem, count: int) -> tuple[Array, Array]:
    """Return frequencies, Hz, and deflections at the nodes, shape (count, n_x, n_y)."""
    square, vectors = eigh(system.stiffness, system.mass, subset_by_index=(0, count - 1))
    values = np.zeros((3 * len(system.x) * len(system.y), count))
    values[system.free] = vectors
    shapes = values[: len(values) // 3].T.reshape(count, len(system.x), len(system.y))
    return np.sqrt(np.maximum(square, 0)) / (2 * np.pi), shapes


def get_thick_mobility(
    system: ThickSystem,
    frequency: ArrayLike,
    source: tuple[int, int],
    receiver: tuple[int, int],
    loss_factor: float,
) -> ComplexArray:
    """Return the transfer mobility between two nodes, m/(N s), by direct solution.

    At the node of the force itself, the result depends on the distance of nodes (see
    `get_supported_mobility`).
    """
    at, to = (
        np.searchsorted(system.free, node[0] * len(system.y) + node[1])
        for node in (source, receiver)
    )
    load = np.zeros(len(system.free))
    load[at] = 1
    result = []
    for omega in 2 * np.pi * np.atleast_1d(np.asarray(frequency, float)):
        dynamic = (1 + 1j * loss_factor) * system.stiffness - omega**2 * system.mass
        result.append(1j * omega * solve(dynamic, load, assume_a="sym")[to])
    return np.array(result)
