"""Impact of a source on a floor: the result of every source model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from thud.base._schema import QUANTITIES, ImpactQuantities
from thud.base.checks import require_choice
from thud.base.extras import data_frame
from thud.impact.contact_time import contact_span
from thud.level.assessment import ImpactOrRecording, assess_levels
from thud.level.estimate import Estimate
from thud.level.levels import FORCES, force_exposure_levels, peak_count

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

    from thud.base._schema import BandSet, LevelsForce, LevelsMethod, LimitsSource
    from thud.base.note import Note
    from thud.case.case import Case
    from thud.impact.floor_impact import FloorImpact
    from thud.impact.motion import Motion
    from thud.impact.room_level import RoomLevel
    from thud.level.assessment import Verdict


@dataclass(frozen=True, eq=False, kw_only=True)
class Impact(ImpactQuantities, ImpactOrRecording):
    """Force and motion of an impact, sampled at a constant rate.

    Attributes are those of `ImpactQuantities` and the following. The peak forces of the model
    `finite_element` are maxima of the content below 1.25 kHz, which a force plate records.

    Attributes
    ----------
    case : Case
        The input.
    time : ndarray, shape (n_sample,)
        Time since the first sample, s; first touch is at `touch_time`.
    deflection, velocity : ndarray, shape (n_sample,)
        Deflection of the source, m, and its rate, m/s.
    elastic_force : ndarray, shape (n_sample,)
        Force of shell and gas, the ball force of the paper (eq. 1), N.
    floor_force : ndarray, shape (n_sample,)
        Total force on the floor, including the flux of momentum, N.
    components : dict of str to ndarray, shape (n_sample,)
        Components of the force, which depend on the model, N.
    model_histories : dict of str to ndarray, shape (n_sample,)
        Other histories of the model, such as the contact radius; the names end with units.
    model_quantities : dict of str to float
        Other scalars of the model, such as the bulk modulus; SI units.
    notes : tuple of Note
        Warnings on implausible input, such as a density of the wall that no rubber has.
    motion : Motion or None
        Snapshots of the deformed ball; None if the model has none.
    on_floor : FloorImpact or None
        The same drop on the floor of the case; None if the case has no floor or a rigid one, or the
        model computes the force on a rigid floor only.
    room_level : RoomLevel or None
        Level in the room of the case; None without a room or if the results were read from files.
    """

    drawn_by: ClassVar[str] = "impact_figures.overview"

    case: Case
    time: NDArray[np.float64]
    deflection: NDArray[np.float64]
    velocity: NDArray[np.float64]
    elastic_force: NDArray[np.float64]
    floor_force: NDArray[np.float64]
    components: dict[str, NDArray[np.float64]]
    model_histories: dict[str, NDArray[np.float64]]
    model_quantities: dict[str, float]
    notes: tuple[Note, ...] = ()
    motion: Motion | None = None
    on_floor: FloorImpact | None = None
    room_level: RoomLevel | None = None

    @property
    def name(self) -> str:
        """Name of the case."""
        return self.case.name

    @property
    def mass(self) -> float:
        """Mass of the source, kg."""
        return self.case.ball.mass

    @property
    def limits_source(self) -> LimitsSource:
        """Source whose limits apply."""
        return self.case.limits.source

    @property
    def level_error(self) -> NDArray[np.float64]:
        """Numerical errors of the octave levels of the force on the floor, dB, shape (5,).

        They are NaN if no other resolution can be computed.
        """
        names = (name for name in QUANTITIES if name.startswith("octave_"))
        return np.array([getattr(self, name) for name in names])

    @property
    def contact_time_as_recorded(self) -> float:
        """Contact time, s, by the definition for recordings (`thud.impact.contact_time`)."""
        first = round(self.touch_time * self.sample_rate)
        last = math.ceil((self.touch_time + self.exact_contact_time) * self.sample_rate)
        begin, end = contact_span(self.floor_force[first : last + 1], self.sample_rate)
        return end - begin

    def __repr__(self) -> str:
        """Return the main numbers of the impact, without its arrays."""
        model = self.case.model.name if self.case.model else ""
        return (
            f"<Impact, {model}: contact {1e3 * self.contact_time:.2f} ms, "
            f"e {self.restitution:.3f}, peak {self.peak():.0f} N>"
        )

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        warnings = [("warning", str(note), "", "", "") for note in self.notes]
        return [*self.assess().rows(), *warnings]

    def force(self, kind: LevelsForce | None = None) -> NDArray[np.float64]:
        """Return the ``"floor"`` or ``"elastic"`` force, N, by default the assessed force."""
        return self.elastic_force if self.assessed_force(kind) == "elastic" else self.floor_force

    def mean_force(self) -> NDArray[np.float64]:
        """Return the force on the floor, N, shape (n_sample,)."""
        return self.floor_force

    def peak(self, force: LevelsForce | None = None) -> float:
        """Return the maximum of a force, N, by default of the assessed force."""
        return (
            self.peak_elastic_force if self.assessed_force(force) == "elastic" else self.peak_force
        )

    def assessed_force(self, force: LevelsForce | None = None) -> LevelsForce:
        """Return `force` after a check, or the kind of force that the case assesses if None."""
        chosen = self.case.levels.force if force is None else force
        require_choice("force", chosen, FORCES)
        return chosen

    def levels(
        self,
        bands: BandSet = "octave",
        method: LevelsMethod | None = None,
        force: LevelsForce | None = None,
    ) -> NDArray[np.float64]:
        """Return the force exposure levels, dB, shape (n_band,).

        Parameters
        ----------
        bands
            ``"octave"`` (31.5 to 500 Hz) or ``"third"`` (25 to 630 Hz).
        method
            ``"exact"`` or ``"fft"``; by default the method of the case.
        force
            ``"floor"`` or ``"elastic"``; by default the assessed force.
        """
        method = method or self.case.levels.method
        return force_exposure_levels(self.force(force), self.sample_rate, bands, method)

    def assess(
        self, source: LimitsSource | None = None, force: LevelsForce | None = None
    ) -> Verdict:
        """Assess the source by the criteria of the standards, with the numerical errors.

        A criterion is undecided if the numerical error, which is that of the force on the floor,
        is unknown or could change the result.

        Parameters
        ----------
        source
            ``"rubber_ball"`` or ``"tyre"``, whose limits apply; by default the source of the case.
        force
            ``"floor"`` or ``"elastic"``; by default the assessed force.
        """
        levels = zip(self.levels(force=force), self.level_error, strict=True)
        return assess_levels(
            [Estimate.computed(float(level), float(error)) for level, error in levels],
            Estimate.computed(self.contact_time, self.contact_time_error),
            Estimate.computed(self.restitution, self.restitution_error),
            peak_count(self.force(force), self.sample_rate),
            self.case.ball.mass,
            self.case.drop.height,
            source or self.case.limits.source,
        )

    def to_xarray(self) -> xr.Dataset:
        """Return histories, levels of both forces and scalars, with units and provenance.

        Snapshots are not included. Raise InputError if xarray is not installed.
        """
        from thud.impact.datasets import case_attributes, impact_dataset

        return impact_dataset(
            self, self.histories(), case_attributes(self.case) | self.model_quantities
        )

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table of the columns of ``force.csv`` and `model_histories`, indexed by time.

        Raise InputError if pandas is not installed.
        """
        return data_frame(self.histories(), self.time)

    def histories(self) -> dict[str, NDArray[np.float64]]:
        """Return the histories, shape (n_sample,), by names that end with units."""
        return {
            "deflection_m": self.deflection,
            "velocity_m_per_s": self.velocity,
            **{f"{name}_N": values for name, values in self.components.items()},
            "elastic_force_N": self.elastic_force,
            "floor_force_N": self.floor_force,
            **self.model_histories,
        }
