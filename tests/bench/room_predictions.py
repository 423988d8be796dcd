"""Rows of the benchmarks on levels below floors; without scikit-fem these are skipped."""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from typing import TYPE_CHECKING

import numpy as np
from ensemble import medians
from scipy.sparse.linalg import eigsh

import thud
from thud.base.bridge import ask
from thud.case.case import case_text

try:
    import skfem
    from skfem.helpers import dd, ddot
except ImportError:
    skfem = None

if TYPE_CHECKING:
    from collections.abc import Callable

# One construction of each kind of floor.
FLOORS = {
    "concrete": "concrete 180",
    "floating floor": "concrete 180, screed on 10 MN/m3",
    "laminate": "CLT 160",
    "joists": "joists, 1 board",
}
# Elements along length and width, and number of modes, of the competitor.
ELEMENTS, MODES = (20, 16), 40


def bench_rooms(row: Callable[..., None]) -> None:
    """Print the rows on both predictions of floors."""
    if skfem is None:
        print("scikit-fem is not installed: skipped")
        return
    impact = thud.solve(model="modal_ball")
    plate = thud.construction(FLOORS["concrete"]).case().floor
    assert isinstance(plate, thud.Plate)
    found = plate_modes(plate)
    clamped = replace(plate, support="clamped")
    text = case_text(thud.Case(floor=clamped, room=thud.Room()))
    ours = ask("floor_modes", case=text, highest=1.1 * found[-1])["frequency"][:MODES]
    print(f"Equal results: {MODES} modes of a clamped plate to {found[-1]:.0f} Hz within "
          f"{np.max(np.abs(ours / found - 1)):.1e}")  # fmt: skip
    for name, construction in FLOORS.items():
        case = thud.construction(construction).case()
        numbers = count()

        def predict(case: thud.Case = case, numbers: count[int] = numbers) -> None:
            # Another floor each time, as the modes of the last ones are kept.
            loss_factor = case.floor.loss_factor * (1 + 1e-9 * next(numbers))  # type: ignore[union-attr]
            floor = replace(case.floor, loss_factor=loss_factor)  # type: ignore[type-var]
            thud.predict_level(impact, floor, case.room)

        seconds = medians(predict, lambda: plate_modes(plate), runs=5)
        row(f"drop and predictions, {name}", "scikit-fem, modes of a clamped plate", seconds)


def plate_modes(plate: thud.Plate) -> np.ndarray:
    """Return the natural frequencies of a clamped plate by scikit-fem, in Hz.

    Bogner-Fox-Schmit elements and SciPy's shift-invert Lanczos method; Poisson's ratio is 0.3, on
    which the frequencies of clamped plates do not depend.
    """
    sides = plate.length, plate.width
    mesh = skfem.MeshQuad.init_tensor(
        *(np.linspace(0, side, n + 1) for side, n in zip(sides, ELEMENTS, strict=True))
    )
    basis = skfem.Basis(mesh, skfem.ElementQuadBFS())
    stiffness = plate.density * plate.thickness**3 * plate.wave_speed**2 / 12
    mass = plate.density * plate.thickness

    def bending(u: object, v: object, _: object) -> object:
        trace = (dd(u)[0, 0] + dd(u)[1, 1]) * (dd(v)[0, 0] + dd(v)[1, 1])
        return stiffness * (0.7 * ddot(dd(u), dd(v)) + 0.3 * trace)

    k = skfem.BilinearForm(bending).assemble(basis)
    m = skfem.BilinearForm(lambda u, v, _: mass * u * v).assemble(basis)
    inside = np.setdiff1d(np.arange(basis.N), basis.get_dofs().flatten())
    values = eigsh(
        k[inside][:, inside], MODES, m[inside][:, inside], sigma=0, return_eigenvectors=False
    )
    frequencies: np.ndarray = np.sqrt(np.sort(values)) / (2 * np.pi)
    return frequencies
