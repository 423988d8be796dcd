"""Impact of the rubber ball by a second element code, made to share nothing with the library's.

Nine-node quadrilaterals of scikit-fem with curved sides, fully integrated, displacements alone, a
consistent mass matrix and a penalty on the penetration of the surface; the library has four nodes
with a mean dilatation, lumped masses and hard contact. Neo-Hookean, Kelvin-Voigt, axisymmetric,
without gas and gravity; friction is Coulomb's with an elastic slip. Central differences.

    python tests/validation/quadratic_impact.py

prints levels against mesh and penalty beside those of the library (docs/finite_elements.md).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu
from skfem import Basis, ElementQuad2, FacetBasis, MeshQuad, MeshQuad2

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

# Longest part of the stability limit of the first step; stiffening takes some of the rest.
SAFETY = 0.7
# The force is averaged over intervals of this rate, Hz.
RATE = 44100.0
# Stiffness of the floor per area, Pa/m; a quarter of it reads 0.08 dB more at 500 Hz.
HARD = 6.4e10
# The impact has ended where the floor has felt nothing for this long, s.
QUIET = 2e-3


@dataclass(frozen=True)
class Rubber:
    """Ball and material; the library's flagship at Poisson's ratio 0.49."""

    outer: float = 0.089
    wall: float = 0.032
    mass: float = 2.5
    modulus: float = 2.08e6
    poisson: float = 0.49
    loss_factor: float = 0.20
    loss_frequency: float = 74.0
    velocity: float = float(np.sqrt(2 * 9.81))

    @property
    def density(self) -> float:
        """Mass over volume of the wall, kg/m3."""
        return self.mass / (4 / 3 * np.pi * (self.outer**3 - (self.outer - self.wall) ** 3))

    @property
    def shear(self) -> float:
        """Shear modulus, Pa."""
        return self.modulus / (2 * (1 + self.poisson))

    @property
    def bulk(self) -> float:
        """Bulk modulus, Pa."""
        return self.modulus / (3 * (1 - 2 * self.poisson))

    @property
    def viscosity(self) -> float:
        """Shear viscosity, Pa s."""
        return self.loss_factor * self.shear / (2 * np.pi * self.loss_frequency)


@dataclass(frozen=True)
class Impact:
    """What the floor feels."""

    force: np.ndarray
    contact_time: float
    restitution: float
    impulse_residual: float
    energy_residual: float

    @property
    def levels(self) -> np.ndarray:
        """Levels of the octaves, dB."""
        return thud.force_exposure_levels(self.force, RATE)


def matrix(columns: np.ndarray, values: np.ndarray, n_column: int) -> csr_array:
    """Return the sparse matrix whose rows are sums of columns times values: [n_local, n_row]."""
    n_local, n_row = columns.shape
    rows = np.tile(np.arange(n_row), n_local)
    return csr_array((values.ravel(), (rows, columns.ravel())), shape=(n_row, n_column))


class Body:
    """The half section of the ball: matrices that make gradients and penetrations of nodal values.

    Unknowns are the radial displacements of all nodes, then the axial ones.
    """

    def __init__(self, rubber: Rubber, through: int, along: int) -> None:
        self.rubber = rubber
        flat = MeshQuad.init_tensor(
            np.linspace(rubber.outer - rubber.wall, rubber.outer, through + 1),
            np.linspace(0, np.pi, along + 1),
        )
        curved = MeshQuad2.from_mesh(flat)
        surface = flat.facets_satisfying(lambda x: np.isclose(x[0], rubber.outer))
        radius, angle = curved.doflocs
        across = np.where(np.isclose(np.sin(angle), 0, atol=1e-9), 0, radius * np.sin(angle))
        mesh = MeshQuad2(np.array((across, -radius * np.cos(angle))), curved.t)
        basis = Basis(mesh, ElementQuad2(), intorder=5)
        self.n = basis.N
        at = basis.mapping.F(basis.X).reshape(2, -1)
        self.weight = 2 * np.pi * at[0] * basis.dx.ravel()
        dofs, shape, across, along_axis = self.tabulate(basis)
        # Rows: the four components in the plane, then the hoop, of the deformation gradient.
        self.gradient = [
            matrix(dofs, across, 2 * self.n),
            matrix(dofs, along_axis, 2 * self.n),
            matrix(dofs + self.n, across, 2 * self.n),
            matrix(dofs + self.n, along_axis, 2 * self.n),
            matrix(dofs, shape / at[0], 2 * self.n),
        ]
        self.back = [g.T.tocsr() for g in self.gradient]
        value = matrix(dofs, shape, self.n)
        mass = rubber.density * (value.T @ (value * self.weight[:, None])).tocsc()
        # The axis does not move sideways.
        self.free = basis.doflocs[0] > 0
        self.mass = mass.tocsr()
        self.solver = splu(csc_array(mass))
        self.solver_across = splu(csc_array(mass[self.free][:, self.free]))
        rim = FacetBasis(mesh, ElementQuad2(), facets=surface, intorder=5)
        place = rim.mapping.G(rim.X, find=rim.find).reshape(2, -1)
        dofs, shape, *_ = self.tabulate(rim)
        self.edge = matrix(dofs + self.n, shape, 2 * self.n)
        self.slide = matrix(dofs, shape, 2 * self.n)
        self.edge_back, self.slide_back = self.edge.T.tocsr(), self.slide.T.tocsr()
        self.edge_weight = 2 * np.pi * place[0] * rim.dx.ravel()
        self.height = place[1] + rubber.outer

    @staticmethod
    def tabulate(basis: Basis | FacetBasis) -> tuple[np.ndarray, ...]:
        """Return unknowns, values and derivatives of the local functions: [n_local, n_point]."""
        points = basis.dx.shape[1]
        dofs = np.repeat(basis.element_dofs, points, axis=1)
        fields = [f[0] for f in basis.basis]
        shape = np.array([np.broadcast_to(f, basis.dx.shape).ravel() for f in fields])
        across, along = (np.array([f.grad[i].ravel() for f in fields]) for i in range(2))
        return dofs, shape, across, along

    def accelerate(self, force: np.ndarray) -> np.ndarray:
        """Return accelerations from forces: [2 n]."""
        result = np.zeros_like(force)
        result[: self.n][self.free] = self.solver_across.solve(force[: self.n][self.free])
        result[self.n :] = self.solver.solve(force[self.n :])
        return result

    def inner(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, float, float]:
        """Return inner forces, [2 n], strain energy, J, and dissipated power, W."""
        rubber = self.rubber
        rr, rz, zr, zz, tt = (g @ u for g in self.gradient)
        rr, zz, tt = rr + 1, zz + 1, tt + 1
        plane = rr * zz - rz * zr
        volume = plane * tt
        # The cofactors, J F^-T.
        c_rr, c_rz, c_zr, c_zz, c_tt = zz * tt, -zr * tt, -rz * tt, rr * tt, plane
        invariant = rr**2 + rz**2 + zr**2 + zz**2 + tt**2
        factor = rubber.shear * volume ** (-2 / 3)
        ball = rubber.bulk * (volume - 1) - factor * invariant / (3 * volume)
        # Velocity gradient L = F' F^-1, with F^-1 the transposed cofactors over J.
        d_rr, d_rz, d_zr, d_zz, d_tt = (g @ v for g in self.gradient)
        l_rr = (d_rr * c_rr + d_rz * c_rz) / volume
        l_rz = (d_rr * c_zr + d_rz * c_zz) / volume
        l_zr = (d_zr * c_rr + d_zz * c_rz) / volume
        l_zz = (d_zr * c_zr + d_zz * c_zz) / volume
        l_tt = d_tt / tt
        mean = (l_rr + l_zz + l_tt) / 3
        s_rr, s_zz, s_tt, s_rz = l_rr - mean, l_zz - mean, l_tt - mean, (l_rz + l_zr) / 2
        two = 2 * rubber.viscosity
        stress = (
            factor * rr + ball * c_rr + two * (s_rr * c_rr + s_rz * c_zr),
            factor * rz + ball * c_rz + two * (s_rr * c_rz + s_rz * c_zz),
            factor * zr + ball * c_zr + two * (s_rz * c_rr + s_zz * c_zr),
            factor * zz + ball * c_zz + two * (s_rz * c_rz + s_zz * c_zz),
            factor * tt + ball * c_tt + two * s_tt * c_tt,
        )
        force = sum(b @ (self.weight * s) for b, s in zip(self.back, stress, strict=True))
        density = rubber.shear / 2 * (volume ** (-2 / 3) * invariant - 3)
        density += rubber.bulk / 2 * (volume - 1) ** 2
        loss = two * volume * (s_rr**2 + s_zz**2 + s_tt**2 + 2 * s_rz**2)
        return force, float(self.weight @ density), float(self.weight @ loss)

    def fastest(self, force: Callable[[np.ndarray], np.ndarray]) -> float:
        """Return the largest eigenvalue of M^-1 times the derivative of a force at zero."""
        vector = np.random.default_rng(1).normal(size=2 * self.n)
        vector[: self.n][~self.free] = 0
        value = 0.0
        for _ in range(60):
            small = 1e-9 * vector / np.abs(vector).max()
            vector = self.accelerate(force(small))
            value = float(np.linalg.norm(vector) / np.linalg.norm(small))
        return value

    def push(self, u: np.ndarray, penalty: float) -> tuple[np.ndarray, float]:
        """Return the forces of the floor at its points, N, and the energy in its springs, J."""
        depth = np.maximum(-(self.edge @ u) - self.height, 0)
        force = penalty * self.edge_weight * depth
        return force, float(force @ depth) / 2

    def steps_per_interval(self, penalty: float) -> int:
        """Return the number of steps in an interval that stability requires."""
        rest = np.zeros(2 * self.n)
        viscous = self.fastest(lambda v: self.inner(rest, v)[0])
        stiff = self.fastest(
            lambda u: (
                self.inner(u, rest)[0]
                + penalty * self.edge_back @ (self.edge_weight * (self.edge @ u))
            )
        )
        # Central differences with old velocities: h^2 K/4 + h C/2 = 1.
        limit = 2 / (viscous / 2 + np.sqrt(viscous**2 / 4 + stiff))
        return int(np.ceil(1 / (RATE * SAFETY * limit)))

    def kinetic_energy(self, v: np.ndarray) -> float:
        """Return the kinetic energy, J."""
        return float(sum(part @ (self.mass @ part) for part in np.split(v, 2))) / 2

    def drop(self, penalty: float, friction: float = 0.0) -> Impact:
        """Return the impact on a floor of a stiffness per area, Pa/m, and with friction."""
        rubber = self.rubber
        n_step = self.steps_per_interval(penalty)
        step = 1 / (RATE * n_step)
        u, v = np.zeros(2 * self.n), np.zeros(2 * self.n)
        v[self.n :] = -rubber.velocity
        drag = np.zeros_like(self.edge_weight)
        force, loss, time, last = [0.0], 0.0, 0.0, 0.0
        while time < last + QUIET:
            force.append(0.0)
            for _ in range(n_step):
                inner, elastic, power = self.inner(u, v)
                push, stored = self.push(u, penalty)
                outer = self.edge_back @ push
                loss += step * power
                if friction:
                    slip = self.slide @ v
                    drag += step * penalty * self.edge_weight * slip
                    drag = np.clip(drag, -friction * push, friction * push)
                    outer -= self.slide_back @ drag
                    loss += step * float(drag @ slip)
                v += step * self.accelerate(outer - inner)
                u += step * v
                time += step
                force[-1] += push.sum() / n_step
                if push.any():
                    last = time
        momentum = float((self.mass @ v[self.n :]).sum())
        change = momentum + rubber.mass * rubber.velocity
        energy = rubber.mass / 2 * rubber.velocity**2
        after = self.kinetic_energy(v) + elastic + stored + loss
        return Impact(
            force=np.array(force),
            contact_time=last,
            restitution=momentum / rubber.mass / rubber.velocity,
            impulse_residual=abs(sum(force) / RATE - change) / change,
            energy_residual=abs(after - energy) / energy,
        )


def drop_of_library(through: int, friction: float = 0.0) -> thud.Impact:
    """Return the same impact by the library, with as many times eight elements around."""
    rubber = Rubber()
    ball = thud.Ball(
        youngs_modulus=rubber.modulus, poisson_ratio=rubber.poisson, ambient_pressure=0
    )
    # The same speed with next to no gravity.
    drop = thud.Drop(9810, 1e-3)
    options: dict[str, object] = {"friction": friction} if friction else {}
    return thud.solve(
        ball, drop, "finite_element", viscosity="kelvin_voigt", loss_factor=rubber.loss_factor,
        loss_frequency=rubber.loss_frequency, bulk_ratio=1e3, snapshot_interval=0,
        radial_elements=through, polar_elements=8 * through, **options,
    )  # fmt: skip


def show(name: str, found: Impact | thud.Impact, levels: np.ndarray) -> None:
    """Print a row of the table."""
    numbers = " | ".join(f"{level:.2f}" for level in levels)
    time = f"{1e3 * found.contact_time:.2f}"
    sys.stdout.write(f"| {name} | {time} | {found.restitution:.4f} | {numbers} |\n")
    sys.stdout.flush()


def main() -> None:
    """Print the table; it takes half an hour."""
    sys.stdout.write("| | contact, ms | e | 31.5 | 63 | 125 | 250 | 500 Hz |\n")
    sys.stdout.write("|---|---|---|---|---|---|---|---|\n")
    runs = [(n, HARD, 0.0) for n in (2, 3, 4, 6, 8)]
    runs += [(6, penalty, 0.0) for penalty in (1e9, 4e9, 1.6e10)] + [(6, HARD, 0.5)]
    for through, penalty, friction in runs:
        found = Body(Rubber(), through, 8 * through).drop(penalty, friction)
        name = f"{through} x {8 * through}, {penalty:.1e} Pa/m, friction {friction}"
        show(name, found, found.levels)
    for through, friction in ((8, 0.0), (16, 0.0), (8, 0.5), (16, 0.5)):
        impact = drop_of_library(through, friction)
        show(f"thud, {through} x {8 * through}, friction {friction}", impact, impact.levels())


if __name__ == "__main__":
    main()
