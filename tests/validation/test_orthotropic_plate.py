"""The modal plate against finite elements: Argyris triangles of an orthotropic plate."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh, spsolve

import thud

skfem = pytest.importorskip("skfem", reason="scikit-fem is the independent finite-element code")

LENGTH, WIDTH, MASS = 3.0, 2.0, 14.3
# Bending stiffnesses along and across and twisting stiffness H = D1 + 2 Dk, N m.
ALONG, ACROSS, TWIST = 6000.0, 1500.0, 1800.0
COUPLING = 400.0
POINT = np.array([0.4 * LENGTH, 0.35 * WIDTH])


@pytest.fixture(scope="module")
def elements() -> tuple[object, object, object, np.ndarray]:
    """Return basis, stiffness and mass of a simply supported plate, and its free unknowns."""
    from skfem.helpers import dd  # noqa: PLC0415 - skipped without it

    nodes = np.linspace(0, LENGTH, 6), np.linspace(0, WIDTH, 5)
    mesh = skfem.MeshTri.init_tensor(*nodes)
    basis = skfem.Basis(mesh, skfem.ElementTriArgyris(), intorder=10)

    @skfem.BilinearForm
    def stiffness(u: object, v: object, _: object) -> object:
        a, b = dd(u), dd(v)
        twist = (TWIST - COUPLING) / 2
        return (
            ALONG * a[0][0] * b[0][0]
            + ACROSS * a[1][1] * b[1][1]
            + COUPLING * (a[0][0] * b[1][1] + a[1][1] * b[0][0])
            + 4 * twist * a[0][1] * b[0][1]
        )

    @skfem.BilinearForm
    def mass(u: object, v: object, _: object) -> object:
        return MASS * u * v

    # Of the six unknowns at a corner (u, u_x, u_y, u_xx, u_xy, u_yy) those vanish on an edge along
    # x that belong to u along it: u, u_x and u_xx; moments make the normal second one vanish too.
    edges = {
        "u|u_x|u_xx|u_yy": mesh.p[1] % WIDTH < 1e-9,
        "u|u_y|u_xx|u_yy": mesh.p[0] % LENGTH < 1e-9,
    }
    held = []
    for names, on_edge in edges.items():
        corners = np.flatnonzero(on_edge)
        rows = [basis.elem.dofnames.index(name) for name in names.split("|")]
        held.append(basis.nodal_dofs[np.ix_(rows, corners)].ravel())
    free = np.setdiff1d(np.arange(basis.N), np.concatenate(held))
    return basis, skfem.asm(stiffness, basis), skfem.asm(mass, basis), free


@pytest.fixture(scope="module")
def plate() -> thud.Plate:
    mean = np.sqrt(ALONG * ACROSS)
    return thud.Plate(
        length=LENGTH, width=WIDTH, thickness=0.022, density=MASS / 0.022,
        wave_speed=np.sqrt(12 * mean / MASS) / 0.022, stiffness_ratio=ACROSS / ALONG,
        torsion_ratio=TWIST / mean, loss_factor=1e-6, edges="absorption",
        source_x=POINT[0] / LENGTH, source_y=POINT[1] / WIDTH,
    )  # fmt: skip
