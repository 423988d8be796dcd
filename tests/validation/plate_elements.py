"""Finite elements of thin orthotropic plates with ribs, springs and a second plate on a layer.

Conforming bicubic Hermite elements (Bogner, Fox and Schmit 1965): each node has w, w_x, w_y, w_xy.
On a rectangular grid, their matrices are Kronecker products of those of Hermite cubics along x and
y. A stiffness is multiplied by 1 + i times the loss factor of its component.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh, splu

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    ComplexArray = NDArray[np.complex128]

# Gauss points of an element: products of two cubics have degree six.
POINTS = 4
INFINITE = math.inf


@dataclass(frozen=True)
class Edge:
    """Springs along an edge; infinite ones hold the edge exactly.

    Attributes
    ----------
    translation, rotation : float
        Stiffness per length against w, N/m2, and against the slope across the edge, N.
    loss_factor : float
        Loss factor of both.
    """

    translation: float = 0.0
    rotation: float = 0.0
    loss_factor: float = 0.0


FREE, SUPPORTED, CLAMPED = Edge(), Edge(INFINITE), Edge(INFINITE, INFINITE)


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
class Rib:
    """A beam along a grid line, joined to the plate in deflection and twist.

    Attributes
    ----------
    along : str
        Direction of the beam, `x` or `y`.
    at : float
        Its coordinate in the other direction, m: a line of the grid.
    bending, torsion : float
        E I and G J, N m2.
    warping : float
        Stiffness against the curvature of the twist, N m4: of lateral bending at a distance.
    flange, spring : float
        Bending stiffness of a flange in N m2 that follows the rotation by a spring, N; the spring
        may be infinite.
    mass, torsional_inertia : float
        Mass, kg/m, and polar moment of inertia, kg m, per length.
    shear_stiffness : float
        kappa G A, N; infinite for an Euler beam.
    rotary_inertia : float
        rho I of a beam with shear, kg m.
    loss_factor : float
        Loss factor of all its stiffnesses.
    plate : int
        Index of the plate that carries it.
    """

    along: str
    at: float
    bending: float
    torsion: float = 0.0
    warping: float = 0.0
    flange: float = 0.0
    spring: float = 0.0
    mass: float = 0.0
    torsional_inertia: float = 0.0
    shear_stiffness: float = INFINITE
    rotary_inertia: float = 0.0
    loss_factor: float = 0.0
    plate: int = 0


@dataclass(frozen=True)
class LineSpring:
    """A spring along a grid line: stiffness per length against w, N/m2, and slope across, N.

    It stands between a plate and the ground, or the same line of another plate.
    """

    along: str
    at: float
    translation: float = 0.0
    rotation: float = 0.0
    loss_factor: float = 0.0
    plate: int = 0
    other: int | None = None


@dataclass(frozen=True)
class Layer:
    """A resilient layer between the plates 0 and 1: stiffness per area, N/m3."""

    stiffness: float
    loss_factor: float = 0.0


@dataclass(frozen=True)
class System:
    """Matrices of the free unknowns.

    Attributes
    ----------
    stiffness, mass : sparse arrays, shape (n, n)
        Complex stiffness and mass.
    get_row : callable
        `get_row(x, y, plate, x_order, y_order)` returns the values of the unknowns' functions, or
        of derivatives, at points, shape (n_point, n).
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


def hermite_row(nodes: Array, x: ArrayLike, order: int = 0) -> Any:  # noqa: ANN401 - sparse
    """Return the Hermite cubics, or a derivative, at points, shape (n_point, 2 n_node).

    The unknowns are value and slope at each node in turn.
    """
    x = np.atleast_1d(np.asarray(x, float))
    left = np.clip(np.searchsorted(nodes, x, "right") - 1, 0, len(nodes) - 2)
    h = np.diff(nodes)[left]
    t = (x - nodes[left]) / h
    cubics = np.array([[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], float)
    derivative = np.polynomial.polynomial.polyder(cubics.T, order)
    values = np.polynomial.polynomial.polyval(t, derivative).T / h[:, None] ** order
    values[:, 1::2] *= h[:, None]
    columns = 2 * left[:, None] + np.arange(4)
    rows = np.repeat(np.arange(len(x)), 4)
    return sparse.csr_array(
        (values.ravel(), (rows, columns.ravel())), shape=(len(x), 2 * len(nodes))
    )


def gauss_points(nodes: Array, count: int = POINTS) -> tuple[Array, Array]:
    """Return points and weights of Gauss's quadrature over all elements."""
    point, weight = np.polynomial.legendre.leggauss(count)
    h = np.diff(nodes)[:, None]
    return (nodes[:-1, None] + h * (1 + point) / 2).ravel(), (h * weight / 2).ravel()


def _products(nodes: Array) -> dict[tuple[int, int], Any]:
    """Return the integrals of products of derivatives of the orders (a, b)."""
    x, weight = gauss_points(nodes)
    rows = [hermite_row(nodes, x, order) for order in range(3)]
    scale = sparse.diags_array(weight)
    return {
        (a, b): rows[a].T @ scale @ rows[b]
        for a, b in [(0, 0), (1, 1), (2, 2), (0, 2), (2, 0)]
    }  # fmt: skip


def _held(nodes: Array, low: Edge, high: Edge) -> tuple[Array, Array]:
    """Return whether edges hold the unknowns along the line across them, shape (2 n_node,)."""
    held = np.zeros(2 * len(nodes), bool)
    held[[0, -2]] = [math.isinf(edge.translation) for edge in (low, high)]
    held[[1, -1]] = [math.isinf(edge.rotation) for edge in (low, high)]
    return held


class _Assembly:
    """Matrices of all unknowns: those of the plates, then the rotations of beams with shear."""

    def __init__(self, x: Array, y: Array, plates: Sequence[Plate], ribs: Sequence[Rib]) -> None:
        self.nodes = {"x": x, "y": y}
        self.products = {axis: _products(nodes) for axis, nodes in self.nodes.items()}
        self.plates = plates
        self.n_plate = 4 * len(x) * len(y)
        self.total = self.n_plate * len(plates)
        self.total += sum(
            self.n_rotation(rib) for rib in ribs
            for spring in (rib.shear_stiffness, rib.spring * bool(rib.flange))
            if 0 < spring < math.inf
        )  # fmt: skip
        self.next_rotation = self.n_plate * len(plates)
        self.stiffness = sparse.csr_array((self.total, self.total), dtype=complex)
        self.mass = sparse.csr_array((self.total, self.total))
        self.held = np.zeros(self.total, bool)

    def n_rotation(self, rib: Rib) -> int:
        return 2 * len(self.nodes[rib.along]) - 1

    def place(self, matrix: Any, plate: int = 0, other: int | None = None) -> Any:  # noqa: ANN401 - sparse
        """Return a matrix of a plate, or of the plates from one on, among all unknowns.

        With another plate, return that of the difference of both.
        """
        entries, rows, columns, values = matrix.tocoo(), [], [], []
        plates = [plate] if other is None else [plate, other]
        for row, column in itertools.product(plates, plates):
            rows.append(entries.row + row * self.n_plate)
            columns.append(entries.col + column * self.n_plate)
            values.append(entries.data if row == column else -entries.data)
        return sparse.csr_array(
            (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))),
            shape=(self.total,) * 2,
        )

    def on_line(self, line: Rib | LineSpring, order: int, matrix: Any) -> Any:  # noqa: ANN401
        """Return a matrix along a line, of w there or of the slope across it."""
        row = hermite_row(self.nodes["y" if line.along == "x" else "x"], line.at, order)
        across = row.T @ row
        pair = (matrix, across) if line.along == "x" else (across, matrix)
        return self.place(sparse.kron(*pair), line.plate, getattr(line, "other", None))

    def row(self, x: ArrayLike, y: ArrayLike, plate: int, orders: tuple[int, int] = (0, 0)) -> Any:  # noqa: ANN401
        """Return the values at points, shape (n_point, n)."""
        along, across = (
            hermite_row(self.nodes[axis], at, order)
            for axis, at, order in zip("xy", (x, y), orders, strict=True)
        )
        rows = [sparse.kron(along[[i]], across[[i]]) for i in range(along.shape[0])]
        entries = sparse.vstack(rows).tocoo()
        return sparse.csr_array(
            (entries.data, (entries.row, entries.col + plate * self.n_plate)),
            shape=(len(rows), self.total),
        )

    def add_plate(self, index: int) -> None:
        plate, px, py = self.plates[index], self.products["x"], self.products["y"]
        bending = (
            plate.d11 * sparse.kron(px[2, 2], py[0, 0])
            + plate.d22 * sparse.kron(px[0, 0], py[2, 2])
            + plate.d12 * (sparse.kron(px[2, 0], py[0, 2]) + sparse.kron(px[0, 2], py[2, 0]))
            + 4 * plate.d66 * sparse.kron(px[1, 1], py[1, 1])
        )
        self.stiffness += (1 + 1j * plate.loss_factor) * self.place(bending, index)
        self.mass += plate.mass * self.place(sparse.kron(px[0, 0], py[0, 0]), index)
        x, y = self.nodes.values()
        on_x, on_y = _held(x, *plate.edges[:2]), _held(y, *plate.edges[2:])
        part = slice(index * self.n_plate, (index + 1) * self.n_plate)
        self.held[part] = (on_x[:, None] | on_y).ravel()
        for edge, along, at in zip(plate.edges, "yyxx", (x[0], x[-1], y[0], y[-1]), strict=True):
            springs = [0.0 if math.isinf(k) else k for k in (edge.translation, edge.rotation)]
            self.add_line(LineSpring(along, at, *springs, edge.loss_factor, index))

    def add_line(self, line: LineSpring) -> None:
        matrix = (1 + 1j * line.loss_factor) * self.products[line.along][0, 0]
        for order, spring in enumerate((line.translation, line.rotation)):
            if spring:
                self.stiffness += spring * self.on_line(line, order, matrix)

    def add_rib(self, rib: Rib) -> None:
        product, loss = self.products[rib.along], 1 + 1j * rib.loss_factor
        self.stiffness += loss * rib.torsion * self.on_line(rib, 1, product[1, 1])
        self.stiffness += loss * rib.warping * self.on_line(rib, 1, product[2, 2])
        self.mass += rib.mass * self.on_line(rib, 0, product[0, 0])
        self.mass += rib.torsional_inertia * self.on_line(rib, 1, product[0, 0])
        x, weight = gauss_points(self.nodes[rib.along])
        at, scale = np.full(len(x), rib.at), sparse.diags_array(weight * loss)
        # Slope and curvature at the Gauss points.
        slope, rate = (
            self.row(x, at, rib.plate, (order, 0))
            if rib.along == "x"
            else self.row(at, x, rib.plate, (0, order))
            for order in (1, 2)
        )
        if math.isfinite(rib.shear_stiffness):
            slope, rate = self.add_rotation(rib, rib.shear_stiffness, slope, scale)
            self.mass += rib.rotary_inertia * (slope.T @ sparse.diags_array(weight) @ slope)
        self.stiffness += rib.bending * (rate.T @ scale @ rate)
        if rib.flange and 0 < rib.spring < math.inf:
            _, rate = self.add_rotation(rib, rib.spring, slope, scale)
        if rib.spring:
            self.stiffness += rib.flange * (rate.T @ scale @ rate)

    def add_rotation(self, rib: Rib, spring: float, slope: Any, scale: Any) -> tuple[Any, Any]:  # noqa: ANN401
        """Add a rotation that follows a slope by a spring; return its values and derivatives.

        It is a continuous parabola in each element; those contain the slopes of the cubics, so that
        a stiff spring does not lock.
        """
        nodes = self.nodes[rib.along]
        x, _ = gauss_points(nodes)
        left = np.clip(np.searchsorted(nodes, x, "right") - 1, 0, len(nodes) - 2)
        h = np.diff(nodes)[left]
        t = (x - nodes[left]) / h
        values = np.stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)], 1)
        slopes = np.stack([4 * t - 3, 4 - 8 * t, 4 * t - 1], 1) / h[:, None]
        columns = (self.next_rotation + 2 * left[:, None] + np.arange(3)).ravel()
        rotation, rate = (
            sparse.csr_array(
                (value.ravel(), (np.repeat(np.arange(len(x)), 3), columns)),
                shape=(len(x), self.total),
            )
            for value in (values, slopes)
        )
        strain = slope - rotation
        self.stiffness += spring * (strain.T @ scale @ strain)
        edges = self.plates[rib.plate].edges
        ends = self.next_rotation, self.next_rotation + self.n_rotation(rib) - 1
        for end, edge in zip(ends, edges[:2] if rib.along == "x" else edges[2:], strict=True):
            self.held[end] = math.isinf(edge.rotation)
        self.next_rotation += self.n_rotation(rib)
        return rotation, rate

    def add_layer(self, layer: Layer) -> None:
        area = sparse.kron(self.products["x"][0, 0], self.products["y"][0, 0])
        self.stiffness += layer.stiffness * (1 + 1j * layer.loss_factor) * self.place(area, 0, 1)


def assemble(  # noqa: PLR0913 - a grid, and the kinds of components
    x: Array,
    y: Array,
    plates: Sequence[Plate],
    *,
    ribs: Sequence[Rib] = (),
    lines: Sequence[LineSpring] = (),
    layer: Layer | None = None,
) -> System:
    """Return the matrices of plates on the grid with nodes at `x` and `y`, m."""
    assembly = _Assembly(x, y, plates, ribs)
    for index in range(len(plates)):
        assembly.add_plate(index)
    for rib in ribs:
        assembly.add_rib(rib)
    for line in lines:
        assembly.add_line(line)
    if layer:
        assembly.add_layer(layer)
    free = np.flatnonzero(~assembly.held)

    def get_row(
        at_x: ArrayLike, at_y: ArrayLike, plate: int = 0, x_order: int = 0, y_order: int = 0
    ) -> object:
        return assembly.row(at_x, at_y, plate, (x_order, y_order)).tocsc()[:, free]

    stiffness, mass = (
        matrix.tocsc()[:, free][free].tocsc() for matrix in (assembly.stiffness, assembly.mass)
    )
    return System(stiffness, mass, get_row)


def get_modes(system: System, count: int, shift: float = 1.0) -> tuple[Array, Array]:
    """Return natural frequencies without losses, Hz, and modes of unit modal mass.

    Parameters
    ----------
    system
        Matrices.
    count
        Number of modes.
    shift
        Frequency, Hz, of the negative shift, which makes the stiffness of free plates regular.

    Returns
    -------
    frequency : ndarray, shape (count,)
        Ascending.
    vectors : ndarray, shape (n, count)
        Unknowns; `system.get_row(x, y) @ vectors` are values at points.
    """
    square, vectors = eigsh(
        system.stiffness.real.tocsc(), count, system.mass, sigma=-((2 * math.pi * shift) ** 2)
    )
    order = np.argsort(square)
    frequency = np.sqrt(np.maximum(square[order], 0)) / (2 * math.pi)
    return frequency, vectors[:, order]


def get_modal_loss(system: System, vectors: Array) -> Array:
    """Return the loss factors of modes by the strain energies of the components."""
    energy = np.einsum("ij,ij->j", vectors, system.stiffness @ vectors)
    return np.asarray(energy.imag / energy.real)


def get_response(
    system: System,
    frequency: ArrayLike,
    load: ArrayLike,
    *,
    output: Any = None,  # noqa: ANN401
) -> ComplexArray:
    """Return velocities due to harmonic forces, m/(N s), by direct solution.

    Parameters
    ----------
    system
        Matrices.
    frequency
        Frequencies, Hz, shape (n_frequency,).
    load
        Unknowns' functions where the forces act, shape (n, n_load): `get_row(...).T`.
    output
        Rows of the results; by default those of the loads.

    Returns
    -------
    ndarray, shape (n_frequency, n_output, n_load)
    """
    load = load.toarray() if sparse.issparse(load) else np.asarray(load)
    output = load.T if output is None else output
    result = []
    for omega in 2 * math.pi * np.atleast_1d(np.asarray(frequency, float)):
        factors = splu(
            (system.stiffness - omega**2 * system.mass).tocsc(),
            permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True},
        )  # fmt: skip
        result.append(1j * omega * (output @ factors.solve(load.astype(complex))))
    return np.array(result)


def get_point_mobility(
    system: System, frequency: ArrayLike, x: ArrayLike, y: ArrayLike, plate: int = 0
) -> ComplexArray:
    """Return driving-point mobilities, m/(N s), shape (n_frequency, n_point)."""
    rows = system.get_row(x, y, plate)
    return np.diagonal(get_response(system, frequency, rows.T), axis1=1, axis2=2).copy()
