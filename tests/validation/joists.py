"""Timber joist floors: a plate with discrete ribs, exact across the joists (Lévy's solution).

Both ends of the joists are simply supported: w = sum of W_n(y) sin(n pi x/l). Each W_n solves an
ordinary differential equation between joists, which are point springs and masses of its deflection
and slope: no approximation but the number of half-waves n. `to_elements` gives the same floor to
`plate_elements`, for other edges and as a check.

    python tests/validation/joists.py

prints frequencies, mobilities and radiated energies.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from baffled_plate import (
    AIR_DENSITY,
    SOUND_SPEED,
    THIRDS,
    band_points,
    get_third,
    grid_centers,
    radiated_power,
)
from plate_elements import (
    FREE,
    SUPPORTED,
    Edge,
    Layer,
    LineSpring,
    Plate,
    Rib,
    System,
    assemble,
    get_grid,
    isotropic_plate,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    ComplexArray = NDArray[np.complex128]

# Octave bands, Hz, of three one-third-octave bands each.
OCTAVES = np.array([63, 125, 250, 500])
# Half-waves along the joists.
HALF_WAVES = 100


@dataclass(frozen=True)
class JoistFloor:
    """Keys and defaults of `&joist_floor`, and what a plate with ribs needs beyond them.

    Joists run along x, the length; `sides` are the edges y = 0 and y = width, parallel to them. The
    bending stiffness of the sheathing is E t**3/12, whatever its Poisson ratio, which matters at
    free edges only. `shear` makes the joists Timoshenko beams. Joists that are not `held` below
    rotate about the sheathing, and bend sideways.
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
    poisson_ratio: float = 0.3
    shear: bool = False
    sides: tuple[Edge, Edge] = (SUPPORTED, SUPPORTED)
    joists: tuple[float, ...] | None = None

    @property
    def stiffness(self) -> float:
        """Bending stiffness of the sheathing, N m."""
        return self.sheathing_modulus * self.sheathing_thickness**3 / 12

    @property
    def mass(self) -> float:
        """Mass of the sheathing per area, kg/m2."""
        return self.sheathing_density * self.sheathing_thickness


@dataclass(frozen=True)
class Subceiling:
    """A plate below the joists, on springs along them, N/m2, and on the air between."""

    plate: Plate
    air: Layer
    channel: float
    channel_loss: float


def get_joists(floor: JoistFloor) -> Array:
    """Return the positions of the joists across, m: as many as fit, in the middle of the width."""
    if floor.joists is not None:
        return np.array(floor.joists)
    count = int(floor.width / floor.spacing * (1 + 1e-9))
    return np.round(floor.width / 2 + floor.spacing * (np.arange(count) - (count - 1) / 2), 9)


def get_torsion_constant(width: float, height: float) -> float:
    """Return the torsion constant of a rectangle, m4 (Saint-Venant's series)."""
    short, long = sorted((width, height))
    odd = np.arange(1, 40, 2)
    series = (np.tanh(odd * np.pi * long / (2 * short)) / odd**5.0).sum()
    return float(long * short**3 / 3 * (1 - 192 / np.pi**5 * short / long * series))


def get_ribs(floor: JoistFloor) -> list[Rib]:
    """Return the joists, with the sheathing as a flange that slips, as beams.

    The axial forces of sheathing and joist, N = E A u' with one u for both, are a couple that
    springs of the connection load by the slip u - arm w' (Newmark); `connection` is the fraction of
    E A that remains of the sheathing for one half-wave over the length.
    """
    area = floor.joist_width * floor.joist_height
    joist = floor.joist_modulus * area
    sheathing = floor.sheathing_modulus * floor.sheathing_thickness * floor.spacing
    arm = (floor.joist_height + floor.sheathing_thickness) / 2
    flange = arm**2 / (1 / joist + 1 / sheathing)
    loose = 1 / floor.connection - 1 if floor.connection else math.inf
    spring = arm**2 * sheathing * (math.pi / floor.length) ** 2 / loose if loose else math.inf
    shear_modulus = floor.joist_modulus / 16
    mass = floor.joist_density * area
    free = arm**2 * (not floor.held)
    return [
        Rib(
            along="x", at=float(y), bending=joist * floor.joist_height**2 / 12,
            torsion=shear_modulus * get_torsion_constant(floor.joist_width, floor.joist_height),
            warping=free * joist * floor.joist_width**2 / 12, flange=flange, spring=spring,
            mass=mass,
            torsional_inertia=mass
            * ((floor.joist_width**2 + floor.joist_height**2) / 12 + free),
            shear_stiffness=5 / 6 * shear_modulus * area if floor.shear else math.inf,
            rotary_inertia=mass * floor.joist_height**2 / 12, loss_factor=floor.loss_factor,
        )
        for y in get_joists(floor)
    ]  # fmt: skip


def to_elements(
    floor: JoistFloor,
    size: float = 0.1,
    ends: tuple[Edge, Edge] = (SUPPORTED, SUPPORTED),
    points: Sequence[tuple[float, float]] = (),
    below: Subceiling | None = None,
) -> System:
    """Return the floor in finite elements; `points` become nodes, where a force is met best.

    A subceiling is the second plate.
    """
    plate = isotropic_plate(
        floor.stiffness, floor.poisson_ratio, floor.mass, (*ends, *floor.sides), floor.loss_factor
    )
    x = get_grid(floor.length, size, [point[0] for point in points])
    y = get_grid(floor.width, size, [*get_joists(floor), *(point[1] for point in points)])
    if below is None:
        return assemble(x, y, [plate], ribs=get_ribs(floor))
    channels = [
        LineSpring("x", y, below.channel, loss_factor=below.channel_loss, other=1)
        for y in get_joists(floor).tolist()
    ]
    return assemble(
        x, y, [plate, below.plate], ribs=get_ribs(floor), lines=channels, layer=below.air
    )


def _rib_dynamics(rib: Rib, k: Array, omega: Array, *, damped: bool) -> tuple[Array, Array]:
    """Return dynamic stiffnesses per length against W and its slope."""
    loss = 1 + 1j * rib.loss_factor * damped
    twist = loss * (rib.torsion * k**2 + rib.warping * k**4) - rib.torsional_inertia * omega**2
    bending = rib.bending
    if rib.flange and rib.spring:
        bending = bending + 1 / (1 / rib.flange + k**2 / rib.spring)
    if math.isinf(rib.shear_stiffness):
        return loss * bending * k**4 - rib.mass * omega**2, twist
    shear = loss * rib.shear_stiffness
    # The rotation of the sections is eliminated.
    rotation = loss * bending * k**2 + shear - rib.rotary_inertia * omega**2
    bend = shear * k**2 - (shear * k) ** 2 / rotation - rib.mass * omega**2
    return bend, twist


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
    nu, k = floor.poisson_ratio, k[..., None]
    values = np.stack([at[0][0], at[0][1], at[1][0], at[1][1]], -2)
    forces = []
    for sign, (w, slope, second, third) in zip((-1, 1), at, strict=True):
        forces.append(sign * bending * ((2 - nu) * k**2 * slope - third))
        forces.append(sign * bending * (second - nu * k**2 * w))
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
    for rib in get_ribs(floor):
        i = 2 * int(np.argmin(abs(nodes - rib.at)))
        bend, twist = _rib_dynamics(rib, k, omega, damped=damped)
        total[..., i, i] += bend
        total[..., i + 1, i + 1] += twist
    held = np.zeros(2 * len(nodes), bool)
    for edge, i in zip(floor.sides, (0, 2 * len(nodes) - 2), strict=True):
        for j, spring in enumerate((edge.translation, edge.rotation)):
            if math.isinf(spring):
                held[i + j] = True
            else:
                total[..., i + j, i + j] += spring * (1 + 1j * edge.loss_factor * damped)
    return total, strips, np.flatnonzero(~held)


def get_frequencies(floor: JoistFloor, count: int, maximum: float = 200.0) -> tuple[Array, Array]:
    """Return the first natural frequencies without losses, Hz, and their half-waves along x.

    Exact: counted by Wittrick and Williams (1971) and found by bisection. `maximum` bounds the
    search, Hz.
    """
    # No strip that is clamped at its sides resonates below `maximum`.
    widest = math.sqrt(22.3 / (2 * math.pi * maximum) * math.sqrt(floor.stiffness / floor.mass))
    nodes = get_grid(floor.width, widest, get_joists(floor))
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
        found += [(frequency, n) for frequency in (low + high) / 2]
        if not below:
            break
    if len(found) < count:
        message = f"{len(found)} modes below {maximum} Hz, {count} wanted"
        raise ValueError(message)
    frequency, half_waves = np.array(sorted(found)[:count]).T
    return frequency, half_waves.astype(int)


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
    nodes = np.unique(np.round([0.0, floor.width, *get_joists(floor), strike[1]], 9))
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
    for rib in get_ribs(floor):
        if abs(rib.at - point[1]) < 1e-9:
            line = line + _rib_dynamics(rib, k, omega, damped=True)[0]
    rest = (2 / floor.length * np.sin(k * point[0]) ** 2 / line).sum(-1)
    return np.asarray(summed + 1j * omega[:, 0] * rest)


def get_conductance(
    floor: JoistFloor, point: tuple[float, float], nominal: ArrayLike = THIRDS, count: int = 16
) -> Array:
    """Return the mean real part of the mobility over each one-third-octave band, m/(N s)."""
    return np.array(
        [
            get_mobility(floor, band_points(*limits, count), point).real.mean()
            for limits in zip(*get_third(np.atleast_1d(nominal)), strict=True)
        ]
    )


def get_radiated_energy(  # noqa: PLR0913 - floor, point, band and air
    floor: JoistFloor,
    point: tuple[float, float],
    nominal: ArrayLike = THIRDS,
    *,
    count: int = 16,
    size: float = 0.05,
    air_density: float = AIR_DENSITY,
    sound_speed: float = SOUND_SPEED,
) -> tuple[Array, Array]:
    """Return energies that a force radiates to one side, and the radiation factors, (n_band,).

    Parameters
    ----------
    floor, point
        Floor without reaction of the air, in a baffle; position of the force, m.
    nominal
        One-third-octave bands, Hz.
    count, size
        Frequencies in a band, and size of the radiators, m.
    air_density, sound_speed
        kg/m3, m/s.

    Returns
    -------
    energy : ndarray, shape (n_band,)
        Radiated energy over the force exposure of the band, J/(N2 s), which is the power over the
        mean square force, m/(N s), as a mean over the band. An octave of a force with a flat
        spectrum has the mean of its three bands, weighted with their widths.
    sigma : ndarray, shape (n_band,)
        Power over that of a piston of the same mean square velocity.
    """
    x, y = grid_centers(floor.length, floor.width, size)
    energy, sigma = [], []
    for limits in zip(*get_third(np.atleast_1d(nominal)), strict=True):
        frequency = band_points(*limits, count)
        field = get_velocity(floor, frequency, point, x, y, half_waves=60)
        power = [
            radiated_power(
                v, floor.length, floor.width, f, air_density=air_density, sound_speed=sound_speed
            )
            for v, f in zip(field, frequency, strict=True)
        ]
        square = (abs(field) ** 2).mean() / 2
        energy.append(2 * np.mean(power))
        area = floor.length * floor.width
        sigma.append(np.mean(power) / (air_density * sound_speed * area * square))
    return np.array(energy), np.array(sigma)


def get_octaves(thirds: ArrayLike) -> Array:
    """Return means over octaves of the bands from 50 to 630 Hz, weighted with their widths."""
    low, high = get_third(THIRDS)
    values = (np.asarray(thirds) * (high - low)).reshape(-1, 3).sum(1)
    return np.asarray(values / (high - low).reshape(-1, 3).sum(1))


def main() -> None:
    """Print frequencies, mobilities and radiated energies of variants of the default floor."""
    for name, floor in {
        "Euler joists, sides supported": JoistFloor(),
        "Timoshenko joists, sides supported": JoistFloor(shear=True),
        "Euler joists, sides free": JoistFloor(sides=(FREE, FREE)),
    }.items():
        rows = {"frequencies, Hz": get_frequencies(floor, 20)[0]}
        for place, point in {"on a joist": (1.7, 2.3), "between": (1.7, 2.1)}.items():
            energy, sigma = get_radiated_energy(floor, point)
            rows |= {
                f"{place}: Re Y, 1e-6 m/(N s)": 1e6 * get_conductance(floor, point),
                f"{place}: radiated, 1e-6 J/(N2 s)": 1e6 * energy,
                f"{place}: radiated, octaves": 1e6 * get_octaves(energy),
                f"{place}: sigma, dB": 10 * np.log10(sigma),
            }
        print(name)  # noqa: T201 - its output
        for title, values in rows.items():
            print(f"  {title:36}", *(f"{value:8.4g}" for value in values))  # noqa: T201


if __name__ == "__main__":
    main()
