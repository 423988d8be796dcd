"""The rubber ball on a concrete plate, the plate by scikit-fem.

    .venv/bin/python docs/examples/plate_scikit_fem.py [force.csv]

The force is that of a file of `thud-driver export --csv`, by default that of the ball by finite
elements. It drives a simply supported plate of Kirchhoff; the velocity at the point of impact is
compared with the modal sum and drawn. What a force plate does not record, above 1.25 kHz, is
removed before: the bending waves are too short for the elements there.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.sparse.linalg import splu
from skfem import Basis, BilinearForm, DiscreteField, ElementQuadBFS, MeshQuad, condense
from skfem.helpers import dd, ddot, trace

from thud.plot import add_curves, legend_above, own_style, save
from thud.plot.style import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LENGTH, WIDTH, THICKNESS = 5.0, 4.0, 0.14  # m
POINT = (2.0, 1.5)  # m, of impact
DENSITY = 2300.0  # kg/m3
WAVE_SPEED = 3500.0  # m/s, of longitudinal waves in the plate
POISSON_RATIO = 0.2
DAMPING = 30.0  # 1/s, loss of momentum: loss factor 0.05 at 95 Hz, falling as 1/f
BAND = 1250.0  # Hz, edge of the force's low-pass
BEFORE = 0.005  # s, rest before first touch: a filter without phase begins earlier
MASS = DENSITY * THICKNESS  # kg/m2
STIFFNESS = MASS * (WAVE_SPEED * THICKNESS) ** 2 / 12  # N m


@dataclass(frozen=True)
class Plate:
    """Matrices of the free degrees of freedom, and the deflection of the point in them."""

    mass: object
    stiffness: object
    point: np.ndarray


@BilinearForm
def inertia(u: DiscreteField, v: DiscreteField, _: object) -> np.ndarray:
    """Return the mass, kg/m2, times two deflections."""
    return MASS * u * v


@BilinearForm
def bending(u: DiscreteField, v: DiscreteField, _: object) -> np.ndarray:
    """Return the work of the moments of one deflection on the curvatures of another."""
    one, other = dd(u), dd(v)
    shear = (1 - POISSON_RATIO) * ddot(one, other)
    return STIFFNESS * (shear + POISSON_RATIO * trace(one) * trace(other))


def new_plate(elements: int) -> Plate:
    """Return a plate of elements x elements rectangles of Bogner, Fox and Schmit."""
    x, y = np.linspace(0, LENGTH, elements + 1), np.linspace(0, WIDTH, elements + 1)
    basis = Basis(MeshQuad.init_tensor(x, y), ElementQuadBFS(), intorder=6)
    # No deflection on the edges, so no slope along them.
    ends = basis.get_dofs(lambda p: np.isin(p[0], [0, LENGTH])).all(["u", "u_y"])
    sides = basis.get_dofs(lambda p: np.isin(p[1], [0, WIDTH])).all(["u", "u_x"])
    fixed = np.union1d(ends, sides)
    point = basis.probes(np.array(POINT)[:, np.newaxis]).toarray()[0]
    free = np.setdiff1d(np.arange(basis.N), fixed)
    matrices = [
        condense(form.assemble(basis), D=fixed, expand=False) for form in (inertia, bending)
    ]
    return Plate(*matrices, point[free])


def plate_velocity(plate: Plate, force: np.ndarray, step: float) -> np.ndarray:
    """Return the velocity of the point, m/s, by Newmark's method of constant mean acceleration."""
    solver = splu((plate.mass * (1 + step / 2 * DAMPING) + plate.stiffness * step**2 / 4).tocsc())
    deflection, speed, acceleration = np.zeros((3, len(plate.point)))
    found = np.zeros(len(force))
    for n, value in enumerate(force):
        if n:
            deflection += step * speed + step**2 / 4 * acceleration
            speed += step / 2 * acceleration
        # A plate at rest: only the force of the first sample acts.
        load = value * plate.point - plate.stiffness @ deflection
        acceleration = solver.solve(load - plate.mass @ speed * DAMPING)
        if n:
            deflection += step**2 / 4 * acceleration
            speed += step / 2 * acceleration
        found[n] = plate.point @ speed
    return found


def modal_velocity(force: np.ndarray, step: float, count: int = 60) -> np.ndarray:
    """Return the velocity of the point, m/s, by count x count modes, the force linear in a step."""
    m, n = (number.ravel() for number in np.mgrid[1 : count + 1, 1 : count + 1])
    wave_number = (np.pi * m / LENGTH) ** 2 + (np.pi * n / WIDTH) ** 2
    omega = wave_number * np.sqrt(STIFFNESS / MASS)
    shape = np.sin(np.pi * m * POINT[0] / LENGTH) * np.sin(np.pi * n * POINT[1] / WIDTH)
    turning = np.sqrt(omega**2 - DAMPING**2 / 4)
    pole = -DAMPING / 2 + 1j * turning
    grown = np.exp(pole * step)
    # Integrals of exp(pole (step - t)) times 1 and times t/step.
    whole = (grown - 1) / pole
    ramp = (whole / step - 1) / pole
    weight = shape**2 / (MASS * LENGTH * WIDTH / 4) * pole / turning
    state = np.zeros(len(pole), dtype=complex)
    found = np.zeros(len(force))
    for i in range(1, len(force)):
        state = grown * state + (whole - ramp) * force[i - 1] + ramp * force[i]
        found[i] = (weight @ state).imag
    return found


def read_force(path: str | None) -> tuple[np.ndarray, float]:
    """Return force, N, and time step, s, of a file, or of the ball by finite elements."""
    if path is None:
        import thud

        impact = thud.solve(model="finite_element")
        return impact.floor_force, 1 / impact.sample_rate
    # The first row that is no comment holds the titles.
    time, force = np.genfromtxt(path, delimiter=",", comments="#")[1:].T
    return force, (time[-1] - time[0]) / (len(time) - 1)


def low_passed(force: np.ndarray, step: float) -> np.ndarray:
    """Return a force after a rest, without what is above the band."""
    sections = butter(4, BAND, fs=1 / step, output="sos")
    return sosfiltfilt(sections, np.pad(force, (round(BEFORE / step), 0)), padlen=0)


@own_style()
def draw(force: np.ndarray, step: float) -> Figure:
    """Compute the velocity of the plate; draw it, and its difference from the modal sum."""
    force = low_passed(force, step)
    time = 1e3 * (step * np.arange(len(force)) - BEFORE)
    found = 1e3 * plate_velocity(new_plate(20), force, step)
    exact = 1e3 * modal_velocity(force, step)
    infinite = 1e3 * force / (8 * np.sqrt(STIFFNESS * MASS))
    print(f"largest velocity {np.abs(found).max():.3f} mm/s")
    print(f"largest difference {np.abs(found - exact).max():.4f} mm/s")
    figure = new_figure(2.9)
    velocity, difference = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    curves = {"scikit-fem": found, "modal sum": exact, "infinite plate, F/Z": infinite}
    add_curves(velocity, {name: (time, curve) for name, curve in curves.items()})
    velocity.tick_params(labelbottom=False)
    velocity.set_ylabel("Velocity of\nthe plate, mm/s")
    difference.plot(time, 1e3 * (found - exact), color="black", linewidth=0.8)
    difference.set_ylabel("scikit-fem −\nmodal sum, µm/s")
    difference.set_xlabel("Time since first touch, ms")
    figure.align_ylabels()
    legend_above(velocity)
    return figure


def main() -> None:
    """Draw the figure into the working directory."""
    force, step = read_force(sys.argv[1] if len(sys.argv) > 1 else None)
    save(draw(force, step), "plate_velocity.png")


if __name__ == "__main__":
    main()
