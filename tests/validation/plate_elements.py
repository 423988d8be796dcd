"""Finite elements of thin orthotropic plates with joists, springs and a second plate on a layer.

Conforming bicubic Hermite elements (Bogner, Fox and Schmit 1965): on a rectangular grid, their
matrices are Kronecker products of those of scikit-fem's Hermite cubics along x and y. A stiffness
is multiplied by 1 + i times the loss factor of its component.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse
from scipy.linalg import khatri_rao
from scipy.sparse.linalg import eigsh, splu
from skfem import Basis, ElementLineHermite, ElementLineP2, MeshLine

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class Edge:
    """Springs along an edge against w, N/m2, and the slope across it, N; infinite ones hold it."""

    translation: float = 0.0
    rotation: float = 0.0


FREE, SUPPORTED, CLAMPED = Edge(), Edge(math.inf), Edge(math.inf, math.inf)


@dataclass(frozen=True)
class Plate:
    """An orthotropic plate: M_x = -(D11 w_xx + D12 w_yy), M_xy = -2 D66 w_xy.

    Attributes
    ----------
    d11, d12, d22, d66 : float
        Bending stiffnesses, N m.
    mass : float
        Mass per area, kg/m2.
    edges : tuple of Edge
        Edges at x = 0, x = length, y = 0 and y = width.
    loss_factor : float
        Loss factor of the bending stiffnesses.
    """

    d11: float
    d12: float
    d22: float
    d66: float
    mass: float
    edges: tuple[Edge, Edge, Edge, Edge] = (SUPPORTED,) * 4
    loss_factor: float = 0.0


def isotropic_plate(
    stiffness: float,
    poisson_ratio: float,
    mass: float,
    edges: tuple[Edge, Edge, Edge, Edge] = (SUPPORTED,) * 4,
    loss_factor: float = 0.0,
) -> Plate:
    """Return an isotropic plate of a bending stiffness E h**3/(12 (1 - nu**2)), N m."""
    return Plate(
        d11=stiffness, d12=poisson_ratio * stiffness, d22=stiffness,
        d66=(1 - poisson_ratio) / 2 * stiffness, mass=mass, edges=edges, loss_factor=loss_factor,
    )  # fmt: skip


@dataclass(frozen=True)
class Joist:
    """A Timoshenko beam along x, joined to a plate in deflection and twist.

    Attributes
    ----------
    bending, torsion : float
        E I and G J, N m2.
    warping : float
        Stiffness against the curvature of the twist, N m4: of lateral bending at a distance.
    flange, spring : float
        Bending stiffness of a flange, N m2, that follows the rotation by a spring, N.
    mass, torsional_inertia : float
        Mass, kg/m, and polar moment of inertia, kg m, per length.
    shear : float
        Shear stiffness kappa G A, N.
    rotary_inertia : float
        rho I, kg m.
    loss_factor : float
        Loss factor of all its stiffnesses.
    """

    bending: float
    torsion: float
    warping: float
    flange: float
    spring: float
    mass: float
    torsional_inertia: float
    shear: float
    rotary_inertia: float
    loss_factor: float


@dataclass(frozen=True)
class System:
    """Matrices of the free unknowns.

    Attributes
    ----------
    stiffness, mass : sparse arrays, shape (n, n)
        Complex stiffness and mass.
    get_row : callable
        `get_row(x, y, plate)` returns the values of the unknowns' functions at points, shape
        (n_point, n).
    """

    stiffness: Any
    mass: Any
    get_row: Callable[..., Any]


def get_grid(length: float, size: float, lines: Sequence[float] = ()) -> Array:
    """Return nodes from 0 to `length` at a distance of at most `size`, also at all `lines`."""
    ends = np.unique(np.round([0.0, *lines, length], 12))
    parts = [
        np.linspace(a, b, math.ceil((b - a) / size - 1e-9), endpoint=False)
        for a, b in itertools.pairwise(ends)
    ]
    return np.append(np.concatenate(parts), ends[-1])


def get_operator(basis: Any, derivative: Callable[[Any], Array]) -> Any:  # noqa: ANN401 - sparse
    """Return the values of a derivative of all functions at the points of integration."""
    fields = (derivative(field) for (field,) in basis.basis)
    values = np.array([np.broadcast_to(field, basis.dx.shape).ravel() for field in fields])
    columns = np.repeat(basis.element_dofs, basis.dx.shape[1], axis=1)
    rows = np.broadcast_to(np.arange(values.shape[1]), values.shape)
    entries = values.ravel(), (rows.ravel(), columns.ravel())
    return sparse.csr_array(entries, shape=(values.shape[1], basis.N))


class _Side:
    """Hermite cubics along a side, with value and slope at each node as unknowns."""

    def __init__(self, nodes: Array) -> None:
        self.nodes, self.count = nodes, 2 * len(nodes)
        self.basis = Basis(MeshLine(nodes), ElementLineHermite(), intorder=6)
        self.weight = sparse.diags_array(self.basis.dx.ravel())
        # Value, slope and curvature.
        self.at = [
            get_operator(self.basis, derivative)
            for derivative in (np.asarray, lambda f: f.grad[0], lambda f: f.hess[0, 0])
        ]

    def product(self, a: int = 0, b: int = 0) -> Any:  # noqa: ANN401 - sparse
        """Return the integrals of products of derivatives."""
        return self.at[a].T @ self.weight @ self.at[b]

    def pick(self, at: ArrayLike, order: int = 0) -> Any:  # noqa: ANN401 - sparse
        """Return rows that pick value or slope at nodes."""
        nodes = abs(self.nodes - np.atleast_1d(at)[:, None]).argmin(1)
        return sparse.eye_array(self.count, format="csr")[2 * nodes + order]


def _add_joists(
    joist: Joist, sides: tuple[_Side, _Side], positions: Array, put: Callable[[Any, int], Any]
) -> tuple[Any, Any]:
    """Return stiffness and mass of joists among all unknowns.

    Rotations of joists and flanges are continuous parabolas, which contain the slopes of cubics:
    stiff springs do not lock.
    """
    along, across = sides
    one = sparse.eye_array(len(positions))
    weight = sparse.kron(along.weight, one)
    w, slope = (
        [put(sparse.kron(at, across.pick(positions, order)), 0) for at in along.at]
        for order in (0, 1)
    )
    parabolas = along.basis.with_element(ElementLineP2())
    turned = [
        get_operator(parabolas, derivative) for derivative in (np.asarray, lambda f: f.grad[0])
    ]
    rotation, flange = ([put(sparse.kron(at, one), field) for at in turned] for field in (-2, -1))
    stiffness = sum(
        (1 + 1j * joist.loss_factor) * factor * (strain.T @ weight @ strain)
        for factor, strain in [
            (joist.bending, rotation[1]), (joist.shear, w[1] - rotation[0]),
            (joist.flange, flange[1]), (joist.spring, rotation[0] - flange[0]),
            (joist.torsion, slope[1]), (joist.warping, slope[2]),
        ]
    )  # fmt: skip
    mass = sum(
        factor * (motion.T @ weight @ motion)
        for factor, motion in [
            (joist.mass, w[0]), (joist.torsional_inertia, slope[0]),
            (joist.rotary_inertia, rotation[0]),
        ]
    )  # fmt: skip
    return stiffness, mass


def assemble(  # noqa: PLR0913 - a grid, and the kinds of components
    x: Array,
    y: Array,
    plates: Sequence[Plate],
    *,
    joist: Joist | None = None,
    joists: ArrayLike = (),
    support: tuple[float, float] | None = None,
    channel: complex = 0.0,
    layer: complex = 0.0,
) -> System:
    """Return the matrices of one or two plates on the grid with nodes at `x` and `y`, m.

    `joists` are the positions across, m, of all `joist` of the plate 0, and of springs along them,
    `channel`, N/m2, between both plates, which also have a layer of a stiffness per area, `layer`,
    N/m3. `support` is a spring along y: its position, m, and stiffness, N/m2.
    """
    sides = along, across = _Side(x), _Side(y)
    positions = np.atleast_1d(joists)
    area, n = sparse.kron(along.product(), across.product()), along.count * across.count
    sizes = [n] * len(plates) + [(2 * len(x) - 1) * len(positions)] * 2 * bool(joist)
    stiffness = sparse.csr_array((sum(sizes),) * 2, dtype=complex)
    mass = sparse.csr_array((sum(sizes),) * 2)
    held = np.zeros(sum(sizes), bool)

    def put(operator: Any, field: int) -> Any:  # noqa: ANN401 - sparse
        blocks = [sparse.csr_array((operator.shape[0], size)) for size in sizes]
        blocks[field] = operator
        return sparse.hstack(blocks, "csr")

    every = [put(sparse.eye_array(n), i) for i in range(len(plates))]
    for plate, own in zip(plates, every, strict=True):
        bending = sum(
            factor * sparse.kron(along.product(a, b), across.product(c, d))
            for factor, a, b, c, d in [
                (plate.d11, 2, 2, 0, 0), (plate.d22, 0, 0, 2, 2), (plate.d12, 2, 0, 0, 2),
                (plate.d12, 0, 2, 2, 0), (4 * plate.d66, 1, 1, 1, 1),
            ]
        )  # fmt: skip
        bending = (1 + 1j * plate.loss_factor) * bending
        for i, edge in enumerate(plate.edges):
            side = sides[i // 2]
            for order, spring in enumerate((edge.translation, edge.rotation)):
                row = side.pick(side.nodes[-(i % 2)], order)
                one, two = row.T @ row, sides[1 - i // 2].product()
                pair = (one, two) if i < 2 else (two, one)
                if math.isinf(spring):
                    held |= own.T @ sparse.kron(*pair).diagonal() > 0
                else:
                    bending += spring * sparse.kron(*pair)
        stiffness += own.T @ bending @ own
        mass += own.T @ (plate.mass * area) @ own
    if support:
        row = along.pick(support[0])
        spring = support[1] * sparse.kron(row.T @ row, across.product())
        stiffness += every[0].T @ spring @ every[0]
    lines = across.pick(positions)
    if len(plates) > 1:
        gap = every[1] - every[0]
        spring = channel * sparse.kron(along.product(), lines.T @ lines) + layer * area
        stiffness += gap.T @ spring @ gap
    if joist:
        added = _add_joists(joist, sides, positions, put)
        stiffness, mass = stiffness + added[0], mass + added[1]
        # The vertices come first.
        ends = np.isin(np.arange(2 * len(x) - 1), [0, len(x) - 1])
        ends &= math.isinf(plates[0].edges[0].rotation)
        held[n * len(plates) :] = np.tile(np.repeat(ends, len(positions)), 2)
    free = np.flatnonzero(~held)

    def get_row(at_x: ArrayLike, at_y: ArrayLike, plate: int = 0) -> Any:  # noqa: ANN401 - sparse
        values = [
            side.basis.probes(np.reshape(at, (1, -1))).toarray().T
            for side, at in zip(sides, (at_x, at_y), strict=True)
        ]
        return (sparse.csr_array(khatri_rao(*values).T) @ every[plate])[:, free]

    return System(stiffness.tocsc()[:, free][free], mass.tocsc()[:, free][free], get_row)


def get_modes(system: System, count: int) -> tuple[Array, Array]:
    """Return natural frequencies without losses, Hz, and modes of unit modal mass, (n, count).

    `system.get_row(x, y) @ vectors` are values at points.
    """
    # A negative shift of 1 Hz makes the stiffness of free plates regular.
    square, vectors = eigsh(system.stiffness.real, count, system.mass, sigma=-((2 * math.pi) ** 2))
    order = np.argsort(square)
    return np.sqrt(np.maximum(square[order], 0)) / (2 * math.pi), vectors[:, order]


def get_response(
    system: System,
    frequency: ArrayLike,
    load: Any,  # noqa: ANN401 - sparse
    output: Any = None,  # noqa: ANN401 - sparse
) -> ComplexArray:
    """Return velocities due to harmonic forces, m/(N s), by direct solution.

    Parameters
    ----------
    system
        Matrices.
    frequency
        Frequencies, Hz, shape (n_frequency,).
    load, output
        Rows where the forces act, shape (n_load, n), and of the results, by default the same.

    Returns
    -------
    ndarray, shape (n_frequency, n_output, n_load)
    """
    output = load if output is None else output
    result = []
    for omega in 2 * math.pi * np.atleast_1d(np.asarray(frequency, float)):
        factors = splu(
            (system.stiffness - omega**2 * system.mass).tocsc(),
            permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True},
        )  # fmt: skip
        result.append(1j * omega * (output @ factors.solve(load.T.toarray().astype(complex))))
    return np.array(result)


def get_point_mobility(
    system: System, frequency: ArrayLike, x: ArrayLike, y: ArrayLike
) -> ComplexArray:
    """Return driving-point mobilities, m/(N s), shape (n_frequency, n_point)."""
    answer = get_response(system, frequency, system.get_row(x, y))
    return np.diagonal(answer, axis1=1, axis2=2).copy()
