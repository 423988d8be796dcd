"""Motion of the ball during an impact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.base.immutable import Immutable

if TYPE_CHECKING:
    from numpy.typing import NDArray


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


def new_motion(**fields: NDArray[np.float64]) -> Motion:
    """Return snapshots with the axes in the order of `Motion`."""
    return Motion(
        **{
            name: values if name == "start" else np.moveaxis(values, -1, 0)
            for name, values in fields.items()
        }
    )
