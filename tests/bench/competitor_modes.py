"""Free axisymmetric modes of the ball by scikit-fem and by CalculiX, for the benchmarks.

Both compute the same half cross-section with the same 8 x 64 quadratic quadrilaterals. Neither
belongs to the requirements of thud: without them the functions raise `CompetitorMissingError`.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

try:
    import skfem
    from skfem.helpers import ddot, dot, sym_grad
except ImportError:
    skfem = None

if TYPE_CHECKING:
    from pathlib import Path

RADIUS, WALL, MASS = 0.089, 0.032, 2.5
MODULUS, POISSON = 1.6e6, 0.4999
DENSITY = MASS / (4 / 3 * np.pi * (RADIUS**3 - (RADIUS - WALL) ** 3))
THROUGH, ALONG = 8, 64
MODES = 6
SHIFT = (2 * np.pi * 100) ** 2


class CompetitorMissingError(RuntimeError):
    """The competitor is not installed."""


def place(angle: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return radius and height, as rows, of points at angles from the lower pole."""
    across = np.where(np.isclose(np.sin(angle), 0, atol=1e-12), 0, radius * np.sin(angle))
    return np.array((across, -radius * np.cos(angle)))


def scikit_fem_mesh() -> skfem.MeshQuad2:
    """Return the mesh of nine-node quadrilaterals."""
    rectangle = skfem.MeshQuad.init_tensor(
        np.linspace(RADIUS - WALL, RADIUS, THROUGH + 1), np.linspace(0, np.pi, ALONG + 1)
    )
    quadratic = skfem.MeshQuad2.from_mesh(rectangle)
    radius, angle = quadratic.doflocs
    return skfem.MeshQuad2(place(angle, radius), quadratic.t)


def scikit_fem_modes(mesh: skfem.MeshQuad2 | None = None) -> np.ndarray:
    """Return the elastic natural frequencies by scikit-fem, in Hz.

    Taylor-Hood elements, biquadratic displacement and bilinear continuous pressure, and SciPy's
    shift-invert Lanczos method on the sparse saddle-point problem. The rules of integration have
    order 4: with order 3 a spurious mode appears at 155 Hz.

    Parameters
    ----------
    mesh : MeshQuad2, optional
        Result of `scikit_fem_mesh`, to keep its making out of a measured time.

    Raises
    ------
    CompetitorMissingError
        If scikit-fem is not installed.
    """
    if skfem is None:
        message = "scikit-fem is not installed"
        raise CompetitorMissingError(message)
    shear = MODULUS / (2 * (1 + POISSON))
    lame = 2 * shear * POISSON / (1 - 2 * POISSON)

    def deviatoric(u: Any, v: Any, w: Any) -> Any:  # noqa: ANN401
        r = w.x[0]
        return 2 * shear * (ddot(sym_grad(u), sym_grad(v)) * r + u[0] * v[0] / r)

    def divergence(u: Any, q: Any, w: Any) -> Any:  # noqa: ANN401
        return -q * ((u.grad[0, 0] + u.grad[1, 1]) * w.x[0] + u[0])

    def compressibility(p: Any, q: Any, w: Any) -> Any:  # noqa: ANN401
        return -p * q * w.x[0] / lame

    def inertia(u: Any, v: Any, w: Any) -> Any:  # noqa: ANN401
        return DENSITY * dot(u, v) * w.x[0]

    mesh = mesh or scikit_fem_mesh()
    form = skfem.BilinearForm
    displacement = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad2()), intorder=4)
    pressure = displacement.with_element(skfem.ElementQuad1())
    coupling = form(divergence).assemble(displacement, pressure)
    stiffness = sparse.bmat([
        [form(deviatoric).assemble(displacement), coupling.T],
        [coupling, form(compressibility).assemble(pressure)],
    ], "csr")  # fmt: skip
    mass = sparse.block_diag(
        [form(inertia).assemble(displacement), sparse.csr_matrix((pressure.N, pressure.N))], "csr"
    )
    axis = displacement.get_dofs(lambda x: x[0] < 1e-9).all("u^1")
    free = np.setdiff1d(np.arange(stiffness.shape[0]), axis)
    values = eigsh(
        stiffness[free][:, free], MODES + 1, mass[free][:, free],
        sigma=SHIFT, return_eigenvectors=False,
    )  # fmt: skip
    frequencies: np.ndarray = np.sqrt(np.sort(values)[1:]) / (2 * np.pi)
    return frequencies


def calculix_deck() -> str:
    """Return the input of CalculiX: CAX8R elements and a *FREQUENCY step."""
    points = [(i, j) for i in range(2 * ALONG + 1) for j in range(2 * THROUGH + 1)]
    numbers = {p: k for k, p in enumerate((p for p in points if p[0] * p[1] % 2 == 0), 1)}
    i, j = np.array(list(numbers)).T
    places = place(np.pi * i / (2 * ALONG), RADIUS - WALL + WALL * j / (2 * THROUGH)).T
    # The eight nodes in steps of angle and radius: counterclockwise, corners first.
    steps = ((0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0))
    corners = [(i, j) for i in range(0, 2 * ALONG, 2) for j in range(0, 2 * THROUGH, 2)]
    elements = [[numbers[i + a, j + b] for a, b in steps] for i, j in corners]
    return "\n".join([
        "*NODE, NSET=ALL",
        *(f"{i}, {x:.12g}, {y:.12g}" for i, (x, y) in enumerate(places, 1)),
        "*ELEMENT, TYPE=CAX8R, ELSET=BALL",
        *(f"{i}, " + ", ".join(map(str, e)) for i, e in enumerate(elements, 1)),
        "*NSET, NSET=AXIS", *(f"{i}," for i, (x, _) in enumerate(places, 1) if x == 0),
        "*BOUNDARY", "AXIS, 1, 1",
        "*MATERIAL, NAME=RUBBER",
        "*ELASTIC", f"{MODULUS}, {POISSON}",
        "*DENSITY", f"{DENSITY:.12g}",
        "*SOLID SECTION, ELSET=BALL, MATERIAL=RUBBER",
        "*STEP", "*FREQUENCY", f"{MODES + 1}",
        "*END STEP", "",
    ])  # fmt: skip


def calculix_modes(directory: Path) -> np.ndarray:
    """Return the elastic natural frequencies by CalculiX, in Hz.

    Parameters
    ----------
    directory : Path
        Existing directory for the files of CalculiX.

    Raises
    ------
    CompetitorMissingError
        If ccx is not installed.
    RuntimeError
        If ccx prints too few modes.
    """
    executable = shutil.which("ccx")
    if executable is None:
        message = "ccx is not installed"
        raise CompetitorMissingError(message)
    (directory / "modes.inp").write_text(calculix_deck(), encoding="ascii")
    subprocess.run(
        [executable, "modes"], cwd=directory, check=True, stdout=subprocess.DEVNULL,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )  # fmt: skip
    frequencies = []
    for line in (directory / "modes.dat").read_text(encoding="ascii").splitlines():
        fields = line.split()
        if len(fields) == 5 and fields[0].isdigit():
            frequencies.append(float(fields[3]))
    if len(frequencies) <= MODES:
        message = f"ccx printed {len(frequencies)} modes"
        raise RuntimeError(message)
    return np.array(frequencies[1 : MODES + 1])
