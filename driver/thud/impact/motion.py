"""Motion of the ball during an impact, and half sections of the ball as files for ParaView."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np

from thud.base.extras import library
from thud.base.files import replace_file, require_ending
from thud.base.immutable import Immutable

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class Motion(Immutable):
    """Snapshots of the half section of the ball; the undisplaced floor is at height 0.

    Nodes are ordered from the lowest point to the highest and from the inner surface to the outer
    surface. The components of vectors are the distance from the axis and the height.

    Attributes
    ----------
    time : ndarray, shape (n_snapshot,)
        Times since the start of the record, s.
    start : ndarray, shape (n_line, n_ring, 2)
        Positions of the nodes before the impact, m.
    position : ndarray, shape (n_snapshot, n_line, n_ring, 2)
        Positions of the nodes, m.
    velocity : ndarray, shape (n_snapshot, n_line, n_ring, 2)
        Velocities of the nodes, m/s.
    contact_pressure : ndarray, shape (n_snapshot, n_line)
        Pressure on the floor at the nodes of the outer surface, Pa.
    contact_shear : ndarray, shape (n_snapshot, n_line)
        Radial stress of the floor on these nodes, positive outwards, Pa.
    cavity_pressure : ndarray, shape (n_snapshot,)
        Overpressure of the gas in the ball, Pa.
    floor_displacement : ndarray, shape (n_snapshot,)
        Downward displacement of the floor under the ball, m; 0 for a rigid floor.
    """

    time: NDArray[np.float64]
    start: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    contact_pressure: NDArray[np.float64]
    contact_shear: NDArray[np.float64]
    cavity_pressure: NDArray[np.float64]
    floor_displacement: NDArray[np.float64]

    def __repr__(self) -> str:
        """Return the size of the snapshots, without their arrays."""
        return f"<Motion: {len(self.time)} snapshots of {self.start[..., 0].size} nodes>"

    def save(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write the snapshots for ParaView: a VTU file each, and their index; return the paths.

        The files of the snapshots are beside the index: those of ``ball.pvd`` are ``ball_0001.vtu``
        and so on. Existing files are replaced. Raise InputError if the path does not end with
        ``.pvd`` or meshio is not installed, and OSError if a file cannot be written.
        """
        index = require_ending(path, ".pvd")
        files = [index.with_name(f"{index.stem}_{i:04d}.vtu") for i in range(1, len(self.time) + 1)]
        for i, file in enumerate(files):
            values = {
                "displacement": self.position[i] - self.start,
                "velocity": self.velocity[i],
                "contact_pressure": self._on_ring(self.contact_pressure[i], -1),
                "contact_shear": self._on_ring(self.contact_shear[i], -1),
                "cavity_pressure": self._on_ring(self.cavity_pressure[i], 0),
                "floor_displacement": np.full(self.start.shape[:2], self.floor_displacement[i]),
            }
            write_vtu(file, self.position[i], values)
        collection = ET.Element("VTKFile", type="Collection", version="0.1")
        times = ET.SubElement(collection, "Collection")
        for time, file in zip(self.time, files, strict=True):
            ET.SubElement(times, "DataSet", timestep=repr(float(time)), file=file.name)
        replace_file(index, ET.tostring(collection))
        return [index, *files]

    def _on_ring(self, values: ArrayLike, ring: int) -> NDArray[np.float64]:
        """Return values at the nodes of one ring, and 0 at the others, shape (n_line, n_ring)."""
        field = np.zeros(self.start.shape[:2])
        field[:, ring] = values
        return field


def new_motion(columns: Mapping[str, NDArray[np.float64]]) -> Motion:
    """Return the snapshots in the columns of ``snapshots.csv``, by their names without units."""
    size = (-1, int(columns["ring"][-1]), int(columns["line"][-1]))
    grids = {name: values.reshape(size).swapaxes(1, 2) for name, values in columns.items()}

    def vectors(radial: str, upward: str) -> NDArray[np.float64]:
        return np.stack((grids[radial], grids[upward]), axis=-1)

    return Motion(
        grids["time"][:, 0, 0],
        vectors("start_radius", "start_height")[0],
        vectors("radius", "height"),
        vectors("radial_velocity", "upward_velocity"),
        grids["contact_pressure"][..., -1],
        grids["contact_shear"][..., -1],
        grids["cavity_pressure"][:, 0, 0],
        grids["floor_displacement"][:, 0, 0],
    )


def write_vtu(
    path: str | os.PathLike[str],
    position: NDArray[np.float64],
    values: Mapping[str, NDArray[np.float64]],
) -> None:
    """Write a VTU file of quadrilaterals; distance from the axis and height become x and y.

    The nodes have positions, m, shape (n_line, n_ring, 2), and values by name, of this shape or, of
    scalars, (n_line, n_ring). Raise InputError if the path does not end with ``.vtu``.
    """
    target = require_ending(path, ".vtu")
    meshio = library("meshio", "meshes")
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


def _in_space(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the vectors of all nodes, with a third component of 0, shape (n_node, 3)."""
    return np.pad(vectors.reshape(-1, 2), ((0, 0), (0, 1)))
