"""Impact of a source on a floor: the result of every source model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import require_choice
from thud.base.display import Displayed
from thud.base.extras import require_extra
from thud.impact.contact_time import contact_span
from thud.impact.motion import Motion, new_motion
from thud.level.levels import FORCES, force_exposure_levels, judge, peak_count

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import (
        BandSet,
        LevelsForce,
        LevelsMethod,
        LimitsSource,
    )
    from thud.base.bridge import Bundle
    from thud.case.case import Case
    from thud.impact.floor_impact import FloorImpact
    from thud.level.criteria import Conformity


@dataclass(frozen=True, eq=False)
class Impact(Displayed):
    """Force and motion of one impact, sampled from first touch on.

    Attributes
    ----------
    case : Case
        The input.
    time : ndarray, shape (n_sample,)
        Time since first touch, s.
    deflection, velocity : ndarray, shape (n_sample,)
        Deflection of the source, m, and its rate, m/s.
    elastic_force : ndarray, shape (n_sample,)
        Force of shell and gas, the ball force of the paper (eq. 1), N.
    floor_force : ndarray, shape (n_sample,)
        Total force on the floor, flux of momentum included, N.
    parts : dict of str to ndarray, shape (n_sample,)
        Components of the force that the model distinguishes, N.
    channels : dict of str to ndarray, shape (n_sample,)
        Other histories of the model, such as the contact radius; the names end with units.
    facts : dict of str to float
        Other numbers of the model, such as the bulk modulus; SI units.
    remarks : tuple of str
        What is possible but not plausible, such as a wall with the density of no rubber.
    motion : Motion or None
        Snapshots of the deformed ball; None where the model has none.
    sample_rate : float
        Samples per second, Hz.
    impact_velocity : float
        Velocity at first touch, m/s.
    contact_time : float
        Time from first touch to release, s.
    peak_force : float
        Maximum force on the floor, N; of finite elements of its part below 1.25 kHz, which a force
        plate records.
    peak_elastic_force : float
        Maximum elastic force, N, likewise.
    max_deflection : float
        Maximum deflection, m.
    restitution : float
        Velocity at release over velocity at first touch.
    impulse : float
        Time integral of the force on the floor, N s.
    exact_contact_time : float
        Contact time interpolated between samples, s, for models whose contact ends on a step.
    touch_time : float
        Time of first touch in the record, s.
    impulse_residual, energy_residual : float
        Relative residuals of the balances of impulse and energy.
    on_floor : FloorImpact or None
        The same drop on the floor of the case; None where there is none, it is rigid, or the model
        knows the force on a rigid floor only.
    """

    case: Case
    time: NDArray[np.float64]
    deflection: NDArray[np.float64]
    velocity: NDArray[np.float64]
    elastic_force: NDArray[np.float64]
    floor_force: NDArray[np.float64]
    parts: dict[str, NDArray[np.float64]]
    channels: dict[str, NDArray[np.float64]]
    facts: dict[str, float]
    remarks: tuple[str, ...]
    motion: Motion | None
    sample_rate: float
    impact_velocity: float
    contact_time: float
    peak_force: float
    peak_elastic_force: float
    max_deflection: float
    restitution: float
    impulse: float
    exact_contact_time: float
    touch_time: float
    impulse_residual: float
    energy_residual: float
    on_floor: FloorImpact | None = None

    @property
    def measured_contact_time(self) -> float:
        """Contact time as a recording gives it (`thud.impact.contact_time`), s."""
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
        remarks = [("remark", remark, "", "") for remark in self.remarks]
        return [*self.conformity().rows(), *remarks]

    @property
    def shell_force(self) -> NDArray[np.float64]:
        """Force of the shell F_B, N, shape (n_sample,)."""
        return self._part("shell_force")

    @property
    def gas_force(self) -> NDArray[np.float64]:
        """Force of the enclosed gas F_G, N, shape (n_sample,)."""
        return self._part("gas_force")

    @property
    def flux_force(self) -> NDArray[np.float64]:
        """Flux of momentum of the wall into the floor F_M, N, shape (n_sample,)."""
        return self._part("flux_force")

    def _part(self, name: str) -> NDArray[np.float64]:
        if name not in self.parts:
            message = f"this model has no {name}; available: {', '.join(self.parts)}"
            raise AttributeError(message)
        return self.parts[name]

    def force(self, kind: LevelsForce | None = None) -> NDArray[np.float64]:
        """Return the ``"floor"`` or the ``"elastic"`` force, N, shape (n_sample,).

        By default that which the case judges.
        """
        return self.elastic_force if self.judged(kind) == "elastic" else self.floor_force

    def peak(self, force: LevelsForce | None = None) -> float:
        """Return the maximum of a force, N; see `force` and `peak_force`."""
        return self.peak_elastic_force if self.judged(force) == "elastic" else self.peak_force

    def judged(self, force: LevelsForce | None = None) -> LevelsForce:
        """Return a force, checked, or without it that which the case judges."""
        chosen = self.case.levels.force if force is None else force
        require_choice("force", chosen, FORCES)
        return chosen

    @property
    def level_method(self) -> LevelsMethod:
        """Method of the levels, ``"exact"`` or ``"fft"``."""
        return self.case.levels.method

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
            ``"exact"`` or ``"fft"``; by default that of the case.
        force
            ``"floor"`` or ``"elastic"``; by default that of the case.
        """
        return force_exposure_levels(
            self.force(force),
            self.sample_rate,
            bands,
            method or self.level_method,
        )

    def conformity(
        self, source: LimitsSource | None = None, force: LevelsForce | None = None
    ) -> Conformity:
        """Return the verdict of the standards.

        Parameters
        ----------
        source
            ``"rubber_ball"`` or ``"tyre"``; by default that of the case.
        force
            ``"floor"`` or ``"elastic"``; by default that of the case.
        """
        return judge(
            self.levels(force=force),
            self.contact_time,
            self.restitution,
            peak_count(self.force(force), self.sample_rate),
            self.case.ball.mass,
            self.case.drop.height,
            source or self.case.limits.source,
        )

    def plot(self) -> Figure:
        """Return a figure of the force that the case judges, and of its octave levels."""
        from thud.plot.impacts import overview

        return overview(self)

    def to_xarray(self) -> xr.Dataset:
        """Return histories, levels of both forces and numbers, with units and provenance.

        Snapshots are left out. Raise InputError where xarray is not installed.
        """
        with require_extra("studies"):
            from thud.impact.datasets import impact_dataset

        return impact_dataset(self, self.histories())

    def to_dataframe(self) -> pd.DataFrame:
        """Return the histories over time, with the columns of ``force.csv`` and `channels`.

        Raise InputError where pandas is not installed.
        """
        with require_extra("studies"):
            import pandas as pd

        return pd.DataFrame(self.histories(), index=pd.Index(self.time, name="time_s"))

    def histories(self) -> dict[str, NDArray[np.float64]]:
        """Return the histories by name and unit, shape (n_sample,)."""
        return {
            "deflection_m": self.deflection,
            "velocity_m_per_s": self.velocity,
            "elastic_force_N": self.elastic_force,
            "floor_force_N": self.floor_force,
            **self._floor_histories(),
            **{f"{name}_N": values for name, values in self.parts.items()},
            **self.channels,
        }

    def _floor_histories(self) -> dict[str, NDArray[np.float64]]:
        """Return what a floor that moves adds to the histories."""
        return {}


def history(case: Case, found: Bundle, remarks: tuple[str, ...]) -> dict[str, Any]:
    """Return what every history in a bundle has."""
    samples, scalars = found["samples"], found["scalars"]
    return {
        "case": case,
        "time": np.arange(len(samples["deflection"])) / scalars["sample_rate"],
        **samples,
        "parts": found["parts"],
        "channels": found.get("channels", {}),
        "facts": found.get("facts", {}),
        "remarks": remarks,
        "motion": new_motion(**found["motion"]) if "motion" in found else None,
        **scalars,
    }
