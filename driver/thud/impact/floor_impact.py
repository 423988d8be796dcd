"""Mobility of floors, and the impact of a source on a mobile floor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from thud.base.bridge import ask
from thud.base.checks import require_choice, require_pair
from thud.base.display import Tabulated, column_rows
from thud.case.case import Case, case_text
from thud.impact.impact import Impact
from thud.level.levels import BANDWIDTHS, force_exposure_levels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.base._schema import BandSet, FloorOptions
    from thud.base.display import Columns


@dataclass(frozen=True, eq=False, repr=False)
class FloorEnergy(Tabulated):
    """Energy that a force transfers to a floor, in bands.

    Attributes
    ----------
    frequency : ndarray, shape (n_band,)
        Rounded mid frequencies, Hz.
    energy : ndarray, shape (n_band,)
        Integral of ``2 |F|**2 Re Y df``, F the contact force and Y the mobility of the floor, J.
    conductance : ndarray, shape (n_band,)
        Mean of Re Y over the band, m/(N s).
    total : float
        Energy in all frequencies, J. `FloorImpact.floor_work` is the same energy by the simulated
        motion of the floor: their difference shows the error of the time steps.
    """

    drawn_by: ClassVar[str] = "floor_figures.draw_energy"

    frequency: NDArray[np.float64]
    energy: NDArray[np.float64]
    conductance: NDArray[np.float64]
    total: float

    def __repr__(self) -> str:
        """Return the energy in all frequencies."""
        return f"<FloorEnergy: {self.total:.3g} J, {len(self.frequency)} bands>"

    def columns(self) -> Columns:
        """Return energy and conductance."""
        return {
            "band, Hz": (self.frequency, "g"),
            "energy, J": (self.energy, ".3g"),
            "conductance, m/(N s)": (self.conductance, ".3g"),
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class FloorImpact(Impact):
    """Impact on a mobile floor; `floor_force` is the contact force.

    The `Impact` of the same drop on a rigid floor, whose force the standards assess, refers to this
    impact as `on_floor`.

    Attributes
    ----------
    blocked_force : ndarray, shape (n_sample,)
        Force of the same drop on a rigid floor, N.
    floor_displacement, floor_velocity : ndarray, shape (n_sample,)
        Displacement, m, and velocity, m/s, of the floor under the source, downwards.
    floor_work : float
        Energy that the source transfers to the floor, J.
    """

    drawn_by: ClassVar[str] = "floor_figures.draw_floor"

    blocked_force: NDArray[np.float64]
    floor_displacement: NDArray[np.float64]
    floor_velocity: NDArray[np.float64]
    floor_work: float

    def __repr__(self) -> str:
        """Return the main numbers of the impact, without its arrays."""
        change = 20 * np.log10(self.floor_force.max() / self.blocked_force.max())
        return (
            f"<FloorImpact, {self.floor.name}: contact {1e3 * self.contact_time:.2f} ms, "
            f"e {self.restitution:.3f}, peak {change:+z.2f} dB, floor work {self.floor_work:.3g} J>"
        )

    @property
    def floor(self) -> FloorOptions:
        """Floor of the case."""
        assert self.case.floor is not None  # noqa: S101 - for the type checker
        return self.case.floor

    def blocked_levels(self, bands: BandSet = "octave") -> NDArray[np.float64]:
        """Return the levels of the force on a rigid floor, dB, shape (n_band,); see `levels`."""
        method = self.case.levels.method
        return force_exposure_levels(self.blocked_force, self.sample_rate, bands, method)

    def difference(self, bands: BandSet = "octave") -> NDArray[np.float64]:
        """Return the level differences contact − blocked force, dB, shape (n_band,)."""
        return self.levels(bands, force="floor") - self.blocked_levels(bands)

    def injected_energy(self, bands: BandSet = "octave") -> FloorEnergy:
        """Return the energy that the force transfers to the floor, in bands."""
        require_choice("bands", bands, BANDWIDTHS)
        answer = ask(
            "floor_energy", case=case_text(Case(floor=self.floor)), bands=bands,
            force=self.floor_force, sample_rate=self.sample_rate,
        )  # fmt: skip
        return FloorEnergy(**answer)

    def velocity_at(self, x: float, y: float) -> NDArray[np.float64]:
        """Return the velocity at a point of a rectangular floor, m/s, shape (n_sample,).

        Raise InputError if the point, m, is outside or the floor is not rectangular.
        """
        answer = ask(
            "mobility", case=case_text(Case(floor=self.floor)), force=self.floor_force,
            sample_rate=self.sample_rate, point=np.array(require_pair("point", (x, y))),
        )  # fmt: skip
        return np.asarray(answer["velocity"])

    def rows(self) -> list[tuple[str, ...]]:
        """Return the header and a row of text for each octave."""
        energy = self.injected_energy()
        return column_rows(
            {
                "octave, Hz": (energy.frequency, "g"),
                "blocked, dB": (self.blocked_levels(), ".2f"),
                "contact, dB": (self.levels(force="floor"), ".2f"),
                "difference, dB": (self.difference(), ".2f"),
                "energy, mJ": (1e3 * energy.energy, ".3g"),
            }
        )

    def histories(self) -> dict[str, NDArray[np.float64]]:
        """Return the histories, also of the blocked force, the floor and its stated points."""
        points = zip(*(getattr(self.floor, f"point_{axis}", ()) for axis in "xy"), strict=True)
        velocities = enumerate((self.velocity_at(x, y) for x, y in points), 1)
        return super().histories() | {
            "blocked_force_N": self.blocked_force,
            "floor_displacement_m": self.floor_displacement,
            "floor_velocity_m_per_s": self.floor_velocity,
            **{f"point_{i}_velocity_m_per_s": values for i, values in velocities},
        }
