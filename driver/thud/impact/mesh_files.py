"""Half sections of the ball as VTU files, for ParaView and VTK."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.extras import require_extra
from thud.base.files import replace_file

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from numpy.typing import NDArray


def write_vtu(
    path: str | os.PathLike[str],
    position: NDArray[np.float64],
    values: Mapping[str, NDArray[np.float64]],
) -> None:
    """Write a VTU file of quadrilaterals; distance from the axis and height become x and y.

    Parameters
    ----------
    path
        Path of the file, which ends with ``.vtu``; raise InputError otherwise.
    position : ndarray, shape (n_line, n_ring, 2)
        Positions of the nodes, m.
    values
        Values at the nodes by name, shape (n_line, n_ring) or, of vectors, (n_line, n_ring, 2).
    """
    target = require_ending(path, ".vtu")
    with require_extra("meshes"):
        import meshio
    node = np.arange(position[..., 0].size).reshape(position.shape[:2])
    corners = (node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1])
    fields = {
        name: _in_space(field) if field.ndim == position.ndim else field.ravel()
        for name, field in values.items()
    }
    cells = [("quad", np.stack(corners, axis=-1).reshape(-1, 4))]
    with TemporaryDirectory() as folder:
        file = Path(folder, "mesh.vtu")
        meshio.Mesh(_in_space(position), cells, point_data=fields).write(file)
        replace_file(target, file.read_bytes())


def require_ending(path: str | os.PathLike[str], ending: str) -> Path:
    """Return a path; raise InputError unless it has the ending."""
    if Path(path).suffix.lower() != ending:
        refuse(f"{path}: this ending is not known", ending)
    return Path(path)


def _in_space(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the vectors of all nodes, with a third component of 0, shape (n_node, 3)."""
    return np.pad(vectors.reshape(-1, 2), ((0, 0), (0, 1)))
