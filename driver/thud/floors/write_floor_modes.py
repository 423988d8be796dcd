"""Files of the modes of a floor, for `ModalFloor`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.files import replace_file
from thud.base.tables import csv_text
from thud.level.levels import finite_array

if TYPE_CHECKING:
    import os

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]


def write_floor_modes(  # noqa: PLR0913 - a mode, and a grid
    path: str | os.PathLike[str],
    frequency: ArrayLike,
    loss_factor: ArrayLike,
    *,
    x: ArrayLike,
    y: ArrayLike,
    shape: ArrayLike,
    modal_mass: ArrayLike = 1.0,
) -> None:
    """Write the modes of a floor to a file for `ModalFloor`.

    Parameters
    ----------
    path
        Path of the file, a CSV table; an existing file is replaced.
    frequency
        Natural frequencies, Hz, shape (n_mode,).
    loss_factor
        Total loss factors of the modes, with radiation and edges, or one for all.
    x, y
        Coordinates of a grid over the whole floor, m, from 0 to its sides, shapes (n_x,) and
        (n_y,).
    shape
        Motion normal to the floor, of the side of the room, shape (n_mode, n_x, n_y): 1/sqrt(kg) if
        the modes are normalized to a mass of 1 kg, else in the unit that belongs to `modal_mass`.
    modal_mass
        Modal masses, kg, or one for all.

    Raises
    ------
    InputError
        If the shapes of the arrays do not fit together, or a number is not finite; all other
        checks follow when the file is read.
    OSError
        If the file cannot be written.
    """
    frequencies = finite_array("frequency", frequency, (1,))
    n_mode = len(frequencies)
    grid = finite_array("x", x, (1,)), finite_array("y", y, (1,))
    values = finite_array("shape", shape, range(4))
    if values.shape != (n_mode, *map(len, grid)):
        refuse(f"shape is an array {values.shape}", f"{(n_mode, *map(len, grid))}: modes, x and y")
    points = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 2)
    rows = [
        ["frequency", "Hz", *frequencies],
        ["loss_factor", "", *_per_mode("loss_factor", loss_factor, n_mode)],
        ["modal_mass", "kg", *_per_mode("modal_mass", modal_mass, n_mode)],
        ["x (m)", "y (m)", *(f"mode {i}" for i in range(1, n_mode + 1))],
        *np.hstack([points, values.reshape(n_mode, -1).T]),
    ]
    replace_file(path, csv_text(rows).encode())


def _per_mode(name: str, values: ArrayLike, n_mode: int) -> Array:
    """Return one value for each mode."""
    array = finite_array(name, values, (0, 1))
    if array.size not in {1, n_mode}:
        refuse(f"{name} has {array.size} values", f"1, or {n_mode}, one for each mode")
    return np.broadcast_to(array, (n_mode,))
