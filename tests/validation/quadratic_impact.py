"""Impact of the rubber ball by a second element code, made to share nothing with the library's.

Nine-node quadrilaterals of scikit-fem with curved sides, fully integrated, displacements alone, a
consistent mass matrix and a penalty on the penetration of the surface; the library has four nodes
with a mean dilatation, lumped masses and hard contact. Neo-Hookean, Kelvin-Voigt, axisymmetric,
without gas and gravity; friction is Coulomb's with an elastic slip. Central differences.

    python tests/validation/quadratic_impact.py

prints levels against mesh and penalty beside those of the library (docs/finite_elements.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from plate_elements import get_operator
from scipy.sparse import csc_array, csr_array, hstack
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


def half_section(inner: float, outer: float, through: int, along: int) -> MeshQuad2:
    """Return quadrilaterals with curved sides in the half section of a hollow sphere."""
    radii = np.linspace(inner, outer, through + 1)
    flat = MeshQuad2.from_mesh(MeshQuad.init_tensor(radii, np.linspace(0, np.pi, along + 1)))
    radius, angle = flat.doflocs
    across = np.where(np.isclose(np.sin(angle), 0, atol=1e-9), 0, radius * np.sin(angle))
    return MeshQuad2(np.array((across, -radius * np.cos(angle))), flat.t)


class Body:
    """The half section of the ball: matrices that make gradients and penetrations of nodal values.

    Unknowns are the radial displacements of all nodes, then the axial ones.
    """

    def __init__(self, rubber: Rubber, through: int, along: int) -> None:
        self.rubber = rubber
        mesh = half_section(rubber.outer - rubber.wall, rubber.outer, through, along)
        basis = Basis(mesh, ElementQuad2(), intorder=5)
        self.n = basis.N
        at = basis.mapping.F(basis.X).reshape(2, -1)
        self.weight = 2 * np.pi * at[0] * basis.dx.ravel()
        value, across, upward = (
            get_operator(basis, derivative)
            for derivative in (np.asarray, lambda f: f.grad[0], lambda f: f.grad[1])
        )
        none = csr_array(value.shape)
        # Rows: the four components in the plane, then the hoop, of the deformation gradient.
        self.gradient = [
            hstack(pair, "csr")
            for pair in (
                (across, none), (upward, none), (none, across), (none, upward),
                (value / at[0][:, None], none),
            )
        ]  # fmt: skip
        self.back = [g.T.tocsr() for g in self.gradient]
        mass = rubber.density * (value.T @ (value * self.weight[:, None])).tocsc()
        # The axis does not move sideways.
        self.free = basis.doflocs[0] > 0
        self.mass = mass.tocsr()
        self.solver = splu(csc_array(mass))
        self.solver_across = splu(csc_array(mass[self.free][:, self.free]))
        facets = mesh.facets_satisfying(
            lambda x: (x[0] > 0) & (np.hypot(*x) > rubber.outer - rubber.wall / 2),
            boundaries_only=True,
        )
        rim = FacetBasis(mesh, ElementQuad2(), facets=facets, intorder=5)
        place = rim.mapping.G(rim.X, find=rim.find).reshape(2, -1)
        value = get_operator(rim, np.asarray)
        none = csr_array(value.shape)
        self.edge, self.slide = hstack((none, value), "csr"), hstack((value, none), "csr")
        self.edge_back, self.slide_back = self.edge.T.tocsr(), self.slide.T.tocsr()
        self.edge_weight = 2 * np.pi * place[0] * rim.dx.ravel()
        self.height = place[1] + rubber.outer

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


def main() -> None:
    """Print the table; it takes half an hour."""
    runs: dict[str, Impact | thud.Impact] = {
        f"{n} x {8 * n}, {penalty:.1e} Pa/m, friction {friction}": (
            Body(Rubber(), n, 8 * n).drop(penalty, friction)
        )
        for n, penalty, friction in ((2, HARD, 0.0), (6, HARD, 0.0), (6, 1.6e10, 0.5))
    }
    runs |= {
        f"thud, {n} x {8 * n}, friction {friction}": drop_of_library(n, friction)
        for n, friction in ((8, 0.0), (16, 0.0), (8, 0.5))
    }
    for name, found in runs.items():
        levels = found.levels if isinstance(found, Impact) else found.levels()
        numbers = " | ".join(f"{level:.2f}" for level in levels)
        row = f"| {name} | {1e3 * found.contact_time:.2f} | {found.restitution:.4f} | {numbers} |"
        print(row)  # noqa: T201 - its output


if __name__ == "__main__":
    main()
