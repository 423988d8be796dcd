"""Timber joist floors: a plate with discrete ribs, exact across the joists (Lévy's solution).

All edges are simply supported: w = sum of W_n(y) sin(n pi x/l). Each W_n solves an ordinary
differential equation between joists, which are point springs and masses of its deflection and
slope: no approximation but the number of half-waves n.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from baffled_plate import THIRDS, band_points, get_third, grid_centers, radiated_power
from plate_elements import Joist, get_grid

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    ComplexArray = NDArray[np.complex128]

# Half-waves along the joists.
HALF_WAVES = 100


@dataclass(frozen=True)
class JoistFloor:
    """Keys and defaults of `&joist_floor`; the joists run along x.

    The bending stiffness of the sheathing is E t**3/12. Joists that are not `held` below rotate
    about the sheathing, and bend sideways.
    """

    length: float = 4.0
    width: float = 5.0
    sheathing_thickness: float = 0.022
    sheathing_density: float = 650.0
    sheathing_modulus: float = 3.0e9
    spacing: float = 0.4
    joist_width: float = 0.06
    joist_height: float = 0.22
    joist_density: float = 420.0
    joist_modulus: float = 1.1e10
    connection: float = 0.1
    held: bool = False
    loss_factor: float = 0.05

    @property
    def stiffness(self) -> float:
        """Bending stiffness of the sheathing, N m."""
        return self.sheathing_modulus * self.sheathing_thickness**3 / 12

    @property
    def mass(self) -> float:
        """Mass of the sheathing per area, kg/m2."""
        return self.sheathing_density * self.sheathing_thickness

    @property
    def positions(self) -> Array:
        """Positions of the joists across, m: as many as fit, in the middle of the width."""
        count = int(self.width / self.spacing * (1 + 1e-9))
        middle = self.spacing * (np.arange(count) - (count - 1) / 2)
        return np.round(self.width / 2 + middle, 9)

    @property
    def joist(self) -> Joist:
        """A joist, with the sheathing as a flange that slips.

        The axial forces of sheathing and joist, N = E A u' with one u for both, are a couple that
        springs of the connection load by the slip u - arm w' (Newmark); `connection` is the
        fraction of E A that remains of the sheathing for one half-wave over the length.
        """
        width, height = self.joist_width, self.joist_height
        joist = self.joist_modulus * width * height
        sheathing = self.sheathing_modulus * self.sheathing_thickness * self.spacing
        arm = (height + self.sheathing_thickness) / 2
        # The torsion constant by Saint-Venant's series.
        odd = np.arange(1, 40, 2)
        series = (np.tanh(odd * np.pi * height / (2 * width)) / odd**5.0).sum()
        torsion = height * width**3 / 3 * (1 - 192 / np.pi**5 * width / height * series)
        shear_modulus, mass = self.joist_modulus / 16, self.joist_density * width * height
        free = arm**2 * (not self.held)
        return Joist(
            bending=joist * height**2 / 12, torsion=float(shear_modulus * torsion),
            warping=free * joist * width**2 / 12,
            flange=arm**2 / (1 / joist + 1 / sheathing),
            spring=arm**2 * sheathing * (math.pi / self.length) ** 2 / (1 / self.connection - 1),
            mass=mass, torsional_inertia=mass * ((width**2 + height**2) / 12 + free),
            shear=5 / 6 * shear_modulus * width * height,
            rotary_inertia=mass * height**2 / 12, loss_factor=self.loss_factor,
        )  # fmt: skip

    def dynamics(self, k: Array, omega: Array, *, damped: bool) -> tuple[Array, Array]:
        """Return dynamic stiffnesses of a joist per length against W and its slope."""
        joist = self.joist
        loss = 1 + 1j * joist.loss_factor * damped
        twist = loss * (joist.torsion * k**2 + joist.warping * k**4)
        bending = joist.bending + 1 / (1 / joist.flange + k**2 / joist.spring)
        shear = loss * joist.shear
        # The rotation of the sections is eliminated.
        rotation = loss * bending * k**2 + shear - joist.rotary_inertia * omega**2
        bend = shear * k**2 - (shear * k) ** 2 / rotation - joist.mass * omega**2
        return bend, twist - joist.torsional_inertia * omega**2


def _strip(
    floor: JoistFloor, width: float, k: Array, omega: Array, *, damped: bool
) -> tuple[Array, Array, Array]:
    """Return roots (..., 2), coefficients (..., 4, 4) and dynamic stiffness (..., 4, 4) of a strip.

    Functions exp(-s y) and exp(-s (width - y)) of both roots; unknowns W, W' at both ends.
    """
    bending = floor.stiffness * (1 + 1j * floor.loss_factor * damped)
    free_wave = np.sqrt(floor.mass * omega**2 / bending + 0j)
    roots = np.sqrt(np.stack(np.broadcast_arrays(k**2 + free_wave, k**2 - free_wave), -1))
    decay = np.exp(-roots * width)
    one = np.ones_like(decay)
    # Values of the four functions and of their derivatives at both ends.
    at = [
        [np.concatenate([(-roots) ** order * near, roots**order * far], -1) for order in range(4)]
        for near, far in ((one, decay), (decay, one))
    ]
    # Terms of Poisson's ratio cancel between strips, and vanish at the edges.
    k = k[..., None]
    values = np.stack([at[0][0], at[0][1], at[1][0], at[1][1]], -2)
    forces = []
    for sign, (_, slope, second, third) in zip((-1, 1), at, strict=True):
        forces.append(sign * bending * (2 * k**2 * slope - third))
        forces.append(sign * bending * second)
    coefficients = np.linalg.inv(values)
    return roots, coefficients, np.stack(forces, -2) @ coefficients


def _assembled(
    floor: JoistFloor, nodes: Array, k: Array, omega: Array, *, damped: bool
) -> tuple[Array, dict[float, tuple[Array, Array, Array]], Array]:
    """Return the dynamic stiffness of all nodes, (..., n, n), the strips, and the free unknowns."""
    shape = np.broadcast_shapes(k.shape, omega.shape)
    total = np.zeros((*shape, 2 * len(nodes), 2 * len(nodes)), complex)
    widths = np.round(np.diff(nodes), 9)
    strips = {w: _strip(floor, w, k, omega, damped=damped) for w in np.unique(widths)}
    for i, width in enumerate(widths):
        total[..., 2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += strips[width][2]
    bend, twist = floor.dynamics(k, omega, damped=damped)
    for at in floor.positions:
        i = 2 * int(np.argmin(abs(nodes - at)))
        total[..., i, i] += bend
        total[..., i + 1, i + 1] += twist
    # Deflections of the edges are held.
    return total, strips, np.delete(np.arange(2 * len(nodes)), [0, -2])


def get_frequencies(floor: JoistFloor, count: int, maximum: float) -> Array:
    """Return the first natural frequencies without losses, Hz.

    Exact: counted by Wittrick and Williams (1971) and found by bisection. `maximum` bounds the
    search, Hz.
    """
    # No strip that is clamped at its sides resonates below `maximum`.
    widest = math.sqrt(22.3 / (2 * math.pi * maximum) * math.sqrt(floor.stiffness / floor.mass))
    nodes = get_grid(floor.width, widest, floor.positions)
    found = []
    for n in range(1, 200):
        k = np.array(n * np.pi / floor.length)

        def number_below(frequency: Array, k: Array = k) -> Array:
            omega = 2 * np.pi * frequency
            matrix, _, free = _assembled(floor, nodes, k, omega, damped=False)
            return (np.linalg.eigvalsh(matrix[:, free[:, None], free].real) < 0).sum(-1)

        below = int(number_below(np.array([maximum]))[0])
        low, high = np.zeros(below), np.full(below, maximum)
        for _ in range(45 if below else 0):
            middle = (low + high) / 2
            above = number_below(middle) > np.arange(below)
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        found += [*(low + high) / 2]
        if not below:
            break
    assert len(found) >= count
    return np.sort(found)[:count]


def get_velocity(  # noqa: PLR0913, PLR0917 - a floor, a force, and points
    floor: JoistFloor,
    frequency: ArrayLike,
    strike: tuple[float, float],
    x: ArrayLike,
    y: ArrayLike,
    half_waves: int = HALF_WAVES,
) -> ComplexArray:
    """Return velocities on a grid by a unit force, m/(N s), shape (n_frequency, n_x, n_y)."""
    n = np.arange(1, half_waves + 1)
    k = n * np.pi / floor.length
    omega = 2 * np.pi * np.atleast_1d(np.asarray(frequency, float))[:, None]
    x, y = np.atleast_1d(np.asarray(x, float)), np.atleast_1d(np.asarray(y, float))
    nodes = np.unique(np.round([0.0, floor.width, *floor.positions, strike[1]], 9))
    matrix, strips, free = _assembled(floor, nodes, k, omega, damped=True)
    load = np.zeros(len(nodes) * 2)
    load[2 * int(np.argmin(abs(nodes - strike[1])))] = 1
    answer = np.zeros(matrix.shape[:-1], complex)
    picked = matrix[..., free[:, None], free]
    right = np.broadcast_to(load[free][:, None], (*picked.shape[:-1], 1))
    answer[..., free] = np.linalg.solve(picked, right)[..., 0]
    answer *= (2 / floor.length * np.sin(k * strike[0]))[:, None]
    across = np.empty((len(omega), half_waves, len(y)), complex)
    left = np.clip(np.searchsorted(nodes, y, "right") - 1, 0, len(nodes) - 2)
    for i in np.unique(left):
        width = round(float(nodes[i + 1] - nodes[i]), 9)
        roots, coefficients, _ = strips[width]
        here = (y[left == i] - nodes[i])[:, None]
        functions = np.concatenate(
            [np.exp(-roots[..., None, :] * here), np.exp(-roots[..., None, :] * (width - here))], -1
        )
        weight = np.einsum("...ij,...j->...i", coefficients, answer[..., 2 * i : 2 * i + 4])
        across[..., left == i] = np.einsum("...pi,...i->...p", functions, weight)
    along = np.sin(np.outer(k, x))
    return np.asarray(1j * omega[..., None] * np.einsum("nx,fny->fxy", along, across))


def get_mobility(
    floor: JoistFloor,
    frequency: ArrayLike,
    point: tuple[float, float],
    half_waves: int = HALF_WAVES,
) -> ComplexArray:
    """Return the driving-point mobility, m/(N s), shape (n_frequency,).

    More half-waves act as on a sheathing without end, 4 B' k**3 per length, and on the joist below.
    """
    summed = get_velocity(floor, frequency, point, point[0], point[1], half_waves)[:, 0, 0]
    omega = 2 * np.pi * np.atleast_1d(np.asarray(frequency, float))[:, None]
    k = np.arange(half_waves + 1, 50 * half_waves) * np.pi / floor.length
    line = 4 * floor.stiffness * (1 + 1j * floor.loss_factor) * k**3
    if abs(floor.positions - point[1]).min() < 1e-9:
        line = line + floor.dynamics(k, omega, damped=True)[0]
    rest = (2 / floor.length * np.sin(k * point[0]) ** 2 / line).sum(-1)
    return np.asarray(summed + 1j * omega[:, 0] * rest)


def get_conductance(floor: JoistFloor, point: tuple[float, float]) -> Array:
    """Return the mean real part of the mobility over each one-third-octave band, m/(N s)."""
    return np.array(
        [get_mobility(floor, band_points(f, 16), point).real.mean() for f in THIRDS.tolist()]
    )


def get_radiated_energy(floor: JoistFloor, point: tuple[float, float]) -> Array:
    """Return energies that a force radiates to one side in one-third-octave bands, J/(N2 s).

    They are energies over the force exposure of the band, of a floor without reaction of the air:
    the power over the mean square force, m/(N s), as a mean over the band. Radiators of 0.1 m.
    """
    x, y = grid_centers(floor.length, floor.width, 0.1)
    energy = []
    for nominal in THIRDS.tolist():
        frequency = band_points(nominal, 16)
        field = get_velocity(floor, frequency, point, x, y, half_waves=60)
        power = [
            radiated_power(v, floor.length, floor.width, f)
            for v, f in zip(field, frequency, strict=True)
        ]
        energy.append(2 * np.mean(power))
    return np.array(energy)


def get_octaves(thirds: ArrayLike) -> Array:
    """Return means over octaves of the bands from 50 to 630 Hz, weighted with their widths."""
    low, high = get_third(THIRDS)
    values = (np.asarray(thirds) * (high - low)).reshape(-1, 3).sum(1)
    return np.asarray(values / (high - low).reshape(-1, 3).sum(1))
