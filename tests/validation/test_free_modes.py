"""Free modes against the characteristic equation of the hollow sphere, and quadratic elements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import skfem
from quadratic_impact import half_section
from scipy import sparse
from scipy.optimize import brentq
from scipy.sparse.linalg import eigsh
from scipy.special import spherical_jn, spherical_yn
from skfem.helpers import ddot, dot, sym_grad

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


def tractions(wavenumber: float, harmonic: int, ratio: float, inner: float) -> NDArray[np.float64]:
    """Return the tractions of the four solutions of the equations of motion on both surfaces.

    The displacement is that of a scalar potential, of waves of compression, and of a vector one, of
    waves of shear (A. C. Eringen, E. S. Suhubi, Elastodynamics, vol. 2, section 8.13): U and V as
    in `docs/modal_ball.md`. Outer radius, shear modulus and density are 1. At Poisson's ratio 1/2
    the scalar potential is harmonic, and the pressure that of its acceleration.
    """
    order = harmonic * (harmonic + 1)
    slow = wavenumber * np.sqrt((1 - 2 * ratio) / (2 - 2 * ratio))
    rows = []
    for r in (1.0, inner):
        normal, tangential = [], []
        for wave, power in ((spherical_jn, harmonic), (spherical_yn, -harmonic - 1)):
            if slow > 0:
                value, slope = (
                    wave(harmonic, slow * r),
                    slow * wave(harmonic, slow * r, derivative=True),
                )
                curvature = -2 * slope / r - (slow**2 - order / r**2) * value
                pressure = 2 * ratio / (1 - 2 * ratio) * slow**2 * value
            else:
                value, slope = r**power, power * r ** (power - 1)
                curvature = power * (power - 1) * r ** (power - 2)
                pressure = wavenumber**2 * value
            normal.append(2 * curvature - pressure)
            tangential.append(2 * (slope / r - value / r**2))
        for wave in (spherical_jn, spherical_yn):
            value = wave(harmonic, wavenumber * r)
            slope = wavenumber * wave(harmonic, wavenumber * r, derivative=True)
            curvature = -2 * slope / r - (wavenumber**2 - order / r**2) * value
            normal.append(2 * order * (slope / r - value / r**2))
            tangential.append(curvature + (order - 2) * value / r**2)
        rows += [normal, tangential]
    matrix = np.array(rows)
    return matrix[::2, :2] if harmonic == 0 else matrix


def characteristic(wavenumber: float, harmonic: int, ratio: float, inner: float) -> float:
    """Return a function of the wavenumber that vanishes at the natural frequencies."""
    matrix = tractions(wavenumber, harmonic, ratio, inner)
    for axis in (0, 1):
        matrix = matrix / np.abs(matrix).max(axis=axis, keepdims=True)
    return float(np.linalg.det(matrix))


def exact(ball: thud.Ball, harmonic: int, near: float) -> float:
    """Return the natural frequency of a harmonic next to a frequency, Hz; nan if there is none."""
    inner = 1 - ball.wall_thickness / ball.outer_radius
    volume = 4 / 3 * np.pi * ball.outer_radius**3 * (1 - inner**3)
    speed = np.sqrt(ball.youngs_modulus / (2 + 2 * ball.poisson_ratio) * volume / ball.mass)
    unit = speed / (2 * np.pi * ball.outer_radius)
    for width in (1e-10, 1e-8, 1e-6, 1e-4):
        low, high = near / unit * (1 - width), near / unit * (1 + width)
        parameters = (harmonic, ball.poisson_ratio, inner)
        if characteristic(low, *parameters) * characteristic(high, *parameters) < 0:
            return float(unit * brentq(characteristic, low, high, parameters, 1e-15, 1e-14))
    return np.nan


RATIOS = [0.3, 0.4, 0.45, 0.49, 0.499, 0.4999, 0.499999, 0.49999999, 0.5 - 1e-11, 0.5]
WALLS = [0.02, 0.05, 0.1, 0.2, 0.36, 0.5, 0.7, 0.8, 0.9, 0.95]


@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.filterwarnings("ignore::thud.PlausibilityWarning")
def test_frequencies_solve_the_characteristic_equation(
    ratio: float, oracle: Callable[..., None]
) -> None:
    for wall in WALLS:
        ball = thud.Ball(poisson_ratio=ratio, wall_thickness=0.089 * wall, youngs_modulus=1.6e6)
        modes = thud.free_modes(ball, 12)
        true = [exact(ball, n, f) for n, f in zip(modes.harmonic, modes.frequency, strict=True)]
        oracle(
            "free modes less the roots of the characteristic equation",
            "closed form",
            modes.frequency / true - 1,
            1e-10,
        )


def element_modes(ball: thud.Ball, through: int, along: int, count: int) -> NDArray[np.float64]:
    """Return the lowest elastic frequencies by scikit-fem, Hz.

    Taylor-Hood elements, biquadratic displacement and bilinear continuous pressure. The rules of
    integration have order 4: with order 3 a spurious mode appears at 155 Hz.
    """
    outer, inner = ball.outer_radius, ball.outer_radius - ball.wall_thickness
    density = ball.mass / (4 / 3 * np.pi * (outer**3 - inner**3))
    shear = ball.youngs_modulus / (2 + 2 * ball.poisson_ratio)
    compliance = (1 - 2 * ball.poisson_ratio) / (2 * shear * ball.poisson_ratio)

    def deviatoric(u: Any, v: Any, w: Any) -> Any:  # noqa: ANN401
        r = w.x[0]
        return 2 * shear * (ddot(sym_grad(u), sym_grad(v)) * r + u[0] * v[0] / r)

    def divergence(u: Any, q: Any, w: Any) -> Any:  # noqa: ANN401
        return -q * ((u.grad[0, 0] + u.grad[1, 1]) * w.x[0] + u[0])

    def compressibility(p: Any, q: Any, w: Any) -> Any:  # noqa: ANN401
        return -compliance * p * q * w.x[0]

    def inertia(u: Any, v: Any, w: Any) -> Any:  # noqa: ANN401
        return density * dot(u, v) * w.x[0]

    mesh = half_section(inner, outer, through, along)
    form = skfem.BilinearForm
    displacement = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad2()), intorder=4)
    pressure = displacement.with_element(skfem.ElementQuad1())
    coupling = form(divergence).assemble(displacement, pressure)
    stiffness = sparse.bmat(
        [
            [form(deviatoric).assemble(displacement), coupling.T],
            [coupling, form(compressibility).assemble(pressure)],
        ],
        "csr",
    )
    mass = sparse.block_diag(
        [form(inertia).assemble(displacement), sparse.csr_matrix((pressure.N, pressure.N))], "csr"
    )
    axis = displacement.get_dofs(lambda x: x[0] < 1e-9).all("u^1")
    free = np.setdiff1d(np.arange(stiffness.shape[0]), axis)
    values = eigsh(
        stiffness[free][:, free], count + 1, mass[free][:, free],
        sigma=(2 * np.pi * 100) ** 2, return_eigenvectors=False,
    )  # fmt: skip
    return np.asarray(np.sqrt(np.sort(values)[1:]) / (2 * np.pi))


@pytest.mark.parametrize("ratio", [0.4, 0.4999, 0.5])
@pytest.mark.filterwarnings("ignore::thud.PlausibilityWarning")
def test_frequencies_are_those_of_quadratic_elements(
    ratio: float, oracle: Callable[..., None]
) -> None:
    ball = thud.Ball(poisson_ratio=ratio, youngs_modulus=1.6e6)
    oracle(
        "free modes less those of scikit-fem, 8 x 64 quadratic elements",
        "independent code",
        element_modes(ball, 8, 64, 6) / thud.free_modes(ball).frequency - 1,
        5e-5,
    )
