"""Impact of the rubber ball by a second element code, made to share nothing with the library's.

Nine-node quadrilaterals of scikit-fem with curved sides, fully integrated, displacements alone, a
consistent mass matrix and a penalty on the penetration of the surface; the library has four nodes
with a mean dilatation, lumped masses and hard contact. Neo-Hookean, Kelvin-Voigt, axisymmetric,
without gas, gravity and friction. Central differences.

    python tests/validation/quadratic_impact.py

prints levels against mesh and penalty beside those of the library (docs/finite_elements.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu
from skfem import Basis, ElementQuad2, FacetBasis, MeshQuad, MeshQuad2

import thud

# Longest part of the stability limit of the first step; stiffening takes some of the rest.
SAFETY = 0.7
# The force is averaged over intervals of this rate, Hz.
RATE = 44100.0
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


def matrix(blocks: list[tuple[np.ndarray, np.ndarray]], n_column: int) -> csr_array:
    """Return the sparse matrix whose rows are sums of columns times weights: [n_local, n_row]."""
    columns = np.concatenate([c.ravel() for c, _ in blocks])
    values = np.concatenate([v.ravel() for _, v in blocks])
    n_row = blocks[0][0].shape[1]
    rows = np.concatenate([np.tile(np.arange(n_row), len(c)) for c, _ in blocks])
    return csr_array((values, (rows, columns)), shape=(n_row, n_column))


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
        self.x = basis.doflocs
        at = basis.mapping.F(basis.X).reshape(2, -1)
        self.weight = 2 * np.pi * at[0] * basis.dx.ravel()
        dofs, shape, across, along_axis = self.tabulate(basis)
        # Rows: the four components in the plane, then the hoop, of the deformation gradient.
        self.gradient = [
            matrix([(dofs, across)], 2 * self.n),
            matrix([(dofs, along_axis)], 2 * self.n),
            matrix([(dofs + self.n, across)], 2 * self.n),
            matrix([(dofs + self.n, along_axis)], 2 * self.n),
            matrix([(dofs, shape / at[0])], 2 * self.n),
        ]
        self.back = [g.T.tocsr() for g in self.gradient]
        value = matrix([(dofs, shape)], self.n)
        mass = rubber.density * (value.T @ (value * self.weight[:, None])).tocsc()
        # The axis does not move sideways.
        self.free = self.x[0] > 0
        self.mass = mass
        self.solver = splu(csc_array(mass))
        self.solver_across = splu(csc_array(mass[self.free][:, self.free]))
        rim = FacetBasis(mesh, ElementQuad2(), facets=surface, intorder=5)
        place = rim.mapping.G(rim.X, find=rim.find).reshape(2, -1)
        self.edge = matrix([(self.tabulate(rim)[0] + self.n, self.tabulate(rim)[1])], 2 * self.n)
        self.edge_back = self.edge.T.tocsr()
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

    def fastest(self, velocity: bool, penalty: float) -> float:
        """Return the largest eigenvalue of M^-1 K (1/s2), or of M^-1 C (1/s) for velocities."""
        vector = np.random.default_rng(1).normal(size=2 * self.n)
        vector[: self.n][~self.free] = 0
        zero = np.zeros_like(vector)
        value = 0.0
        for _ in range(60):
            small = 1e-9 * vector / np.abs(vector).max()
            force = self.inner(zero, small)[0] if velocity else self.inner(small, zero)[0]
            if not velocity:
                force += penalty * self.edge_back @ (self.edge_weight * (self.edge @ small))
            vector = self.accelerate(force)
            value = float(np.linalg.norm(vector) / np.linalg.norm(small))
        return value

    def drop(self, penalty: float) -> Impact:
        """Return the impact on a floor of a stiffness per area, Pa/m."""
        rubber = self.rubber
        stiff, viscous = self.fastest(False, penalty), self.fastest(True, penalty)
        # Central differences with old velocities: h^2 K/4 + h C/2 = 1.
        limit = 2 / (viscous / 2 + np.sqrt(viscous**2 / 4 + stiff))
        per_interval = int(np.ceil(1 / (RATE * SAFETY * limit)))
        step = 1 / (RATE * per_interval)
        u, v = np.zeros(2 * self.n), np.zeros(2 * self.n)
        v[self.n :] = -rubber.velocity
        force, total, loss, elastic, push = [0.0], 0.0, 0.0, 0.0, 0.0
        time, last = 0.0, 0.0
        while time < last + QUIET:
            force.append(0.0)
            for _ in range(per_interval):
                inner, elastic, power = self.inner(u, v)
                depth = np.maximum(-(self.edge @ u) - self.height, 0)
                pressure = penalty * self.edge_weight * depth
                push = float(pressure.sum())
                stored = float(pressure @ depth) / 2
                v += step * self.accelerate(self.edge_back @ pressure - inner)
                u += step * v
                loss += step * power
                time += step
                total += step * push
                force[-1] += push / per_interval
                if push > 0:
                    last = time
        momentum = float((self.mass @ v[self.n :]).sum())
        bounce = momentum / rubber.mass
        kinetic = (v[self.n :] @ (self.mass @ v[self.n :]) + v[: self.n] @ (self.mass @ v[: self.n])) / 2
        energy = rubber.mass / 2 * rubber.velocity**2
        change = rubber.mass * rubber.velocity + momentum
        # The samples are means over the interval that ends at them: half a sample late.
        return Impact(
            np.array(force),
            last,
            bounce / rubber.velocity,
            abs(total - change) / change,
            abs(float(kinetic) + elastic + stored + loss - energy) / energy,
        )


def main() -> None:
    """Print the tables."""
    import sys, time
    through, along, penalty = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    t = time.time()
    body = Body(Rubber(), through, along)
    print(f"mass {body.mass.sum():.6f}")
    i = body.drop(penalty)
    print(through, along, f"{penalty:.2g}", f"{1e3*i.contact_time:.2f}", f"{i.restitution:.4f}", i.levels.round(3), f"{i.impulse_residual:.1e} {i.energy_residual:.1e} {time.time()-t:.0f} s", flush=True)


if __name__ == "__main__":
    main()
