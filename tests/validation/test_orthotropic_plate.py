"""The modal plate against finite elements: Argyris triangles of an orthotropic plate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh, spsolve

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

skfem = pytest.importorskip("skfem", reason="scikit-fem is the independent finite-element code")

# So heavy that air takes nothing.
LENGTH, WIDTH, THICKNESS, MASS = 3.0, 2.0, 0.2, 2000.0
# Bending stiffnesses along and across and twisting stiffness H = D1 + 2 Dk, N m.
ALONG, ACROSS, TWIST = 6.0e7, 1.5e7, 1.8e7
COUPLING = 4.0e6
POINT = np.array([0.4 * LENGTH, 0.35 * WIDTH])


class Elements(NamedTuple):
    """Matrices of the free unknowns, and the shape functions at the point."""

    stiffness: Any
    mass: Any
    at_point: np.ndarray


@pytest.fixture(scope="module")
def elements() -> Elements:
    """Return the finite elements of the simply supported plate."""
    from skfem.helpers import dd

    mesh = skfem.MeshTri.init_tensor(np.linspace(0, LENGTH, 11), np.linspace(0, WIDTH, 9))
    basis = skfem.Basis(mesh, skfem.ElementTriArgyris(), intorder=10)

    @skfem.BilinearForm
    def stiffness(u: object, v: object, _: object) -> object:
        a, b = dd(u), dd(v)
        # H = D1 + 2 Dk.
        return (
            ALONG * a[0][0] * b[0][0]
            + ACROSS * a[1][1] * b[1][1]
            + COUPLING * (a[0][0] * b[1][1] + a[1][1] * b[0][0])
            + 2 * (TWIST - COUPLING) * a[0][1] * b[0][1]
        )

    @skfem.BilinearForm
    def mass(u: object, v: object, _: object) -> object:
        return MASS * u * v

    # On an edge u and its derivatives along it vanish, and, without moment, the normal second one.
    edges = {
        "u u_x u_xx u_yy": mesh.p[1] % WIDTH < 1e-9,
        "u u_y u_xx u_yy": mesh.p[0] % LENGTH < 1e-9,
    }
    held = []
    for names, on_edge in edges.items():
        rows = [basis.elem.dofnames.index(name) for name in names.split()]
        held.append(basis.nodal_dofs[np.ix_(rows, np.flatnonzero(on_edge))].ravel())
    free = np.setdiff1d(np.arange(basis.N), np.concatenate(held))
    at_point = np.asarray(basis.probes(POINT[:, None]).todense()).ravel()[free]
    matrices = (skfem.asm(form, basis)[free][:, free].tocsc() for form in (stiffness, mass))
    return Elements(*matrices, at_point)


@pytest.fixture(scope="module")
def plate() -> thud.Plate:
    mean = np.sqrt(ALONG * ACROSS)
    return thud.Plate(
        length=LENGTH, width=WIDTH, thickness=THICKNESS, density=MASS / THICKNESS,
        wave_speed=np.sqrt(12 * mean / MASS) / THICKNESS, stiffness_ratio=ACROSS / ALONG,
        torsion_ratio=TWIST / mean, loss_factor=1e-6, edges="absorption",
        source_x=POINT[0] / LENGTH, source_y=POINT[1] / WIDTH,
    )  # fmt: skip


def closed_form() -> np.ndarray:
    """Return the first frequencies of the plate, Hz."""
    m, n = np.meshgrid(np.arange(1, 30), np.arange(1, 30))
    x, y = (m * np.pi / LENGTH) ** 2, (n * np.pi / WIDTH) ** 2
    omega = np.sqrt((ALONG * x**2 + 2 * TWIST * x * y + ACROSS * y**2) / MASS)
    return np.sort(omega.ravel())[:12] / (2 * np.pi)


def test_frequencies_are_those_of_finite_elements(
    elements: Elements, oracle: Callable[..., None]
) -> None:
    squares = eigsh(elements.stiffness, 12, elements.mass, sigma=0, return_eigenvectors=False)
    # Elements are stiffer, by up to 1e-5.
    ratio = np.sqrt(np.sort(squares)) / (2 * np.pi) / closed_form()
    assert np.all(ratio > 1 - 1e-9)
    oracle(
        "orthotropic plate: frequencies by Argyris elements", "independent code", ratio - 1, 2e-5
    )


def test_mobility_is_that_of_finite_elements(elements: Elements, plate: thud.Plate) -> None:
    # Statically and between modes, where losses do nothing.
    modes = closed_form()
    frequency = np.append(0.1, (modes[:-1] + modes[1:]) / 2)[np.append(True, np.diff(modes) > 5)]
    assert len(frequency) > 6
    found = thud.mobility(plate, frequency).values
    for f, value in zip(frequency, found, strict=True):
        omega = 2 * np.pi * f
        answer = spsolve(elements.stiffness - omega**2 * elements.mass, elements.at_point)
        expected = omega * (elements.at_point @ answer)
        # A point force inside an element is met within 0.3 % of the static compliance.
        assert value.imag == pytest.approx(expected, rel=0.01, abs=3e-3 * found[0].imag * f / 0.1)
