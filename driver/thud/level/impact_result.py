"""Interface of computed and recorded impacts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from thud.base.immutable import Immutable

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import BandSet, LevelsForce, LevelsMethod, LimitsSource
    from thud.case.case import Case
    from thud.impact.floor_impact import FloorImpact
    from thud.impact.room_level import RoomLevel
    from thud.level.assessment import Verdict


@dataclass(frozen=True, eq=False)
class DropForce(Immutable):
    """Force of one drop on a rigid floor, with its origin.

    Attributes
    ----------
    name : str
        Name of the drop, also of its files.
    force : ndarray, shape (n_sample,)
        Force, N, positive in compression.
    sample_rate : float
        Samples per second, Hz.
    start : float
        Time of the first sample, s; first touch is at 0.
    kind : str
        ``"floor"`` or ``"elastic"``.
    origin : str
        Case or file of the force.
    checksum : str
        SHA-256 of the case as `thud.write_case` writes it, or of the file.
    date : str
        Date of the measurement; empty if unknown.
    notes : tuple of str
        Sentences on the processing of the force.
    """

    name: str
    force: NDArray[np.float64]
    sample_rate: float
    start: float
    kind: str
    origin: str
    checksum: str
    date: str = ""
    notes: tuple[str, ...] = ()

    @property
    def time(self) -> NDArray[np.float64]:
        """Time since first touch, s, shape (n_sample,)."""
        return self.start + np.arange(len(self.force)) / self.sample_rate


@runtime_checkable
class ImpactResult(Protocol):
    """Result of a drop: an `Impact` of a model, or a `Recording` of one or more drops.

    The force of a recording is that of the first drop; all other results are averages over its
    drops. A recording has only the force on the floor and returns it for every `force`.
    """

    @property
    def name(self) -> str:
        """Name of the case or of the recording."""

    @property
    def case(self) -> Case:
        """Input of the impact; without a model for a recording."""

    @property
    def time(self) -> NDArray[np.float64]:
        """Time, s, shape (n_sample,); first touch is at `touch_time`."""

    @property
    def touch_time(self) -> float:
        """Time of first touch, s."""

    @property
    def sample_rate(self) -> float:
        """Samples per second, Hz."""

    @property
    def mass(self) -> float:
        """Mass of the source, kg; NaN if unknown."""

    @property
    def impact_velocity(self) -> float:
        """Velocity at first touch, m/s; NaN if unknown."""

    @property
    def velocity_tolerance(self) -> float:
        """Relative difference up to which two impact velocities count as equal."""

    @property
    def contact_time(self) -> float:
        """Contact time, s."""

    @property
    def restitution(self) -> float:
        """Coefficient of restitution; NaN if unknown."""

    @property
    def peak_force(self) -> float:
        """Maximum force on the floor, N; below 1.25 kHz if the force has content above it."""

    @property
    def impulse(self) -> float:
        """Time integral of the force on the floor, N s."""

    @property
    def limits_source(self) -> LimitsSource | None:
        """Source whose limits apply; None if it is not stated."""

    @property
    def level_method(self) -> LevelsMethod:
        """Method of the levels."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on possible faults."""

    @property
    def on_floor(self) -> FloorImpact | None:
        """The same drop on the mobile floor of the case; None without one."""

    def quantity(self, name: str) -> float:
        """Return a quantity, SI units, by its name, such as ``"contact_time"``; NaN if none."""

    @property
    def room_level(self) -> RoomLevel | None:
        """Level in the room of the case; None if it is not known."""

    def assessed_force(self, force: LevelsForce | None = None) -> LevelsForce:
        """Return `force`, or the kind of the assessed force if it is None."""

    def force(self, kind: LevelsForce | None = None) -> NDArray[np.float64]:
        """Return a force, by default the assessed force, N, shape (n_sample,)."""

    def mean_force(self) -> NDArray[np.float64]:
        """Return the force on the floor whose levels are `levels`, N, shape (n,), from any time."""

    def peak(self, force: LevelsForce | None = None) -> float:
        """Return the maximum of a force, by default of the assessed force, N."""

    def levels(
        self,
        bands: BandSet = "octave",
        method: LevelsMethod | None = None,
        force: LevelsForce | None = None,
    ) -> NDArray[np.float64]:
        """Return the force exposure levels, dB, shape (n_band,)."""

    def assess(
        self, source: LimitsSource | None = None, force: LevelsForce | None = None
    ) -> Verdict:
        """Assess the source by the criteria of the standards."""

    def drop_force(self, drop: int = 1) -> DropForce:
        """Return the assessed force of a drop, counted from 1."""

    def plot(self) -> Figure:
        """Return a figure of the result."""

    def to_xarray(self) -> xr.Dataset:
        """Return a dataset of forces, levels and scalars, with units and provenance."""

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table of the histories, indexed by time."""
