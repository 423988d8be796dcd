"""The reference codes of plates with transverse shear against closed forms and each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mindlin_plate import (
    CLAMPED,
    FREE,
    SUPPORTED,
    ThickEdge,
    ThickPlate,
    assemble_thick,
    get_supported_frequencies,
    get_supported_mobility,
    get_thick_mobility,
    get_thick_modes,
    isotropic_thick_plate,
)
from numpy.polynomial import chebyshev
from scipy.linalg import eigvals

ORTHOTROPIC = ThickPlate(
    length=3.0, width=2.0, d11=6e7, d12=4e6, d22=1.5e7, d66=7e6, s1=1.2e9, s2=8e8, mass=500.0,
    rotary_inertia=5.0, loss_factor=0.05,
)  # fmt: skip


def square_plate(thickness: float, shear_factor: float = 5 / 6) -> ThickPlate:
    return isotropic_thick_plate(
        1.0, 1.0, thickness, youngs_modulus=1.0, poisson_ratio=0.3, density=1.0,
        shear_factor=shear_factor,
    )  # fmt: skip


def parameter(plate: ThickPlate, frequency: np.ndarray | float) -> np.ndarray:
    """Return omega a**2 sqrt(rho h/D) of a square plate of side 1."""
    return 2 * np.pi * np.asarray(frequency) * math.sqrt(plate.mass / plate.d11)


def test_supported_isotropic_plate_has_mindlins_closed_form() -> None:
    """(D k2 + S - I w2)(S k2 - m w2) = S2 k2, and the thickness twist (1-nu)/2 D k2 + S = I w2."""
    plate, k2 = square_plate(0.2), np.pi**2 * np.array([2, 5, 13])
    middle = plate.mass * (plate.d11 * k2 + plate.s1) + plate.rotary_inertia * plate.s1 * k2
    root = np.sqrt(middle**2 - 4 * plate.rotary_inertia * plate.mass * plate.d11 * plate.s1 * k2**2)
    roots = [(middle + sign * root) / (2 * plate.rotary_inertia * plate.mass) for sign in (-1, 1)]
    roots.append((plate.d66 * k2 + plate.s1) / plate.rotary_inertia)
    found = get_supported_frequencies(plate, [1, 1, 2], [1, 2, 3])
    assert found == pytest.approx(np.sort(np.sqrt(roots), axis=0).T / (2 * np.pi), rel=1e-12)
    thin = square_plate(1e-3)
    assert parameter(thin, get_supported_frequencies(thin, 1, 1)[0, 0]) == pytest.approx(
        2 * np.pi**2, rel=1e-5
    )


def test_spectral_elements_have_the_closed_form_of_an_orthotropic_plate() -> None:
    m, n = np.meshgrid(np.arange(1, 9), np.arange(1, 9))
    exact = np.sort(get_supported_frequencies(ORTHOTROPIC, m, n)[:, 0])[:10]
    for order, elements in ((12, (1, 1)), (7, (2, 2))):
        system = assemble_thick(ORTHOTROPIC, (SUPPORTED,) * 4, order, elements)
        assert get_thick_modes(system, 10)[0] == pytest.approx(exact, rel=1e-4)


def collocated(plate: ThickPlate, order: int) -> np.ndarray:
    """Return the first frequencies of a clamped isotropic plate by Chebyshev collocation, Hz."""
    x = np.cos(np.pi * np.arange(order + 1) / order)
    basis = np.eye(order + 1)
    values = chebyshev.chebval(x, basis).T
    slope = 2 * chebyshev.chebval(x, chebyshev.chebder(basis)).T @ np.linalg.inv(values)
    inside = slice(1, -1)
    first, second = slope[inside, inside], (slope @ slope)[inside, inside]
    one = np.eye(order - 1)
    dx, dy = np.kron(first, one), np.kron(one, first)
    dxx, dyy, dxy = np.kron(second, one), np.kron(one, second), np.kron(first, first)
    eye, shear, bend, coupled = np.eye(len(dx)), plate.s1, plate.d11, plate.d12 + plate.d66
    operator = -np.block(
        [
            [shear * (dxx + dyy), -shear * dx, -shear * dy],
            [shear * dx, bend * dxx + plate.d66 * dyy - shear * eye, coupled * dxy],
            [shear * dy, coupled * dxy, plate.d66 * dxx + bend * dyy - shear * eye],
        ]
    )
    inertia = np.repeat([plate.mass, plate.rotary_inertia, plate.rotary_inertia], len(eye))
    square = eigvals(operator / inertia[:, None])
    return np.sqrt(np.sort(square.real))[:6] / (2 * np.pi)


@pytest.mark.parametrize("thickness", [0.1, 0.2])
def test_spectral_elements_and_collocation_agree_on_clamped_plates(thickness: float) -> None:
    plate = square_plate(thickness)
    found = get_thick_modes(assemble_thick(plate, (CLAMPED,) * 4, 12), 6)[0]
    assert found == pytest.approx(collocated(plate, 12), rel=3e-5)


@pytest.mark.parametrize(("edge", "thin"), [(CLAMPED, 35.985), (FREE, 13.468), (SUPPORTED, 19.739)])
def test_thin_plates_are_those_without_shear(edge: ThickEdge, thin: float) -> None:
    """The limits are those of `plate_elements`; shear takes (h/a)**2, at free edges h/a."""
    rigid = 3 if edge == FREE else 0
    found = []
    for thickness in (0.02, 0.01):
        plate = square_plate(thickness)
        frequency = get_thick_modes(assemble_thick(plate, (edge,) * 4, 7, (2, 2)), 4)[0][rigid]
        found.append(float(parameter(plate, frequency)))
    assert found[0] < found[1] < thin
    assert found[1] == pytest.approx(thin, rel=3e-3)


@pytest.mark.parametrize(
    ("low", "high"),
    [(ThickEdge(300.0, 20.0), ThickEdge(50.0, 3.0)), (CLAMPED, ThickEdge(0.0, 4.0))],
)
def test_elastic_edges_are_those_of_a_timoshenko_beam_on_springs(
    low: ThickEdge, high: ThickEdge
) -> None:
    """Without Poisson's ratio, a plate with two free edges has the modes of a beam."""
    shear, inertia = 100.0, 0.01
    plate = ThickPlate(1.0, 0.05, 1.0, 0.0, 1.0, 0.5, shear, shear, 1.0, inertia)
    # Half as wide, modes across and in twist are above.
    frequency, shapes = get_thick_modes(assemble_thick(plate, (low, high, FREE, FREE), 12), 8)
    bending = abs(shapes - shapes[:, :, :1]).max((1, 2)) < 1e-6 * abs(shapes).max((1, 2))
    assert bending.sum() > 2

    def determinant(f: float) -> float:
        square = (2 * np.pi * f) ** 2
        # S (w'' - phi') + m w2 w = 0 and phi'' + S (w' - phi) + I w2 phi = 0, for exp(s x).
        last = square * (inertia * square - shear)
        roots = np.roots([shear, square * (1 + inertia * shear), last])
        s = np.sqrt(np.r_[roots, roots] + 0j) * [1, 1, -1, -1]
        phi = (shear * s**2 + square) / (shear * s)
        rows = []
        for edge, x, sign in ((low, 0.0, 1), (high, 1.0, -1)):
            e = np.exp(s * x)
            force, moment = sign * shear * (s - phi) * e, sign * s * phi * e
            rows.append(e if math.isinf(edge.translation) else edge.translation * e - force)
            rows.append(phi * e if math.isinf(edge.rotation) else edge.rotation * phi * e - moment)
        # Real for conjugate or real pairs but for a common phase.
        value = np.linalg.det(rows) / np.prod(s[:2])
        return float(value.real if abs(value.real) > abs(value.imag) else value.imag)

    for f in frequency[bending][:3]:
        assert determinant(f * (1 - 1e-6)) * determinant(f * (1 + 1e-6)) < 0


def test_transfer_mobility_is_that_of_the_modal_sum() -> None:
    system = assemble_thick(ORTHOTROPIC, (SUPPORTED,) * 4, 8, (2, 2))
    nodes = (5, 6), (11, 9)
    points = [(system.x[i], system.y[j]) for i, j in nodes]
    frequency = np.array([40.0, 130.0, 300.0])
    expected = get_supported_mobility(ORTHOTROPIC, frequency, *points, 200)
    found = get_thick_mobility(system, frequency, *nodes, ORTHOTROPIC.loss_factor)
    assert abs(found / expected - 1).max() < 2e-3
