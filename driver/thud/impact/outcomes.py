"""Results of many drops."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import SampleQuantities
from thud.base.display import Displayed
from thud.base.extras import require_extra
from thud.impact.quantities import FLOOR_QUANTITIES, ROOM_LEVEL, SAMPLE_RESULTS, SCALAR_QUANTITIES
from thud.impact.sample_messages import NO_ERRORS, sample_warnings
from thud.level.levels import BANDWIDTHS

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from thud.base._schema import BandSet, LevelsForce
    from thud.case.case import Case


@dataclass(frozen=True, eq=False, kw_only=True)
class Ensemble(SampleQuantities, Displayed):
    """Results of many samples of a case; NaN for samples that could not be computed.

    Attributes are those of `SampleQuantities` and the following.

    Attributes
    ----------
    case : Case
        All other keys.
    parameters : dict of str to ndarray, shape (n_sample,)
        Values of the keys in which the samples differ.
    status : ndarray of int, shape (n_sample,)
        0, or the exit code of the error: 1 invalid input, 2 numerical failure.
    reason : ndarray of str, shape (n_sample,)
        Message of the error; empty without an error.
    levels : dict of (force, bands) to ndarray, shape (n_sample, n_band)
        Force exposure levels, dB, of the ``"elastic"`` and the ``"floor"`` force: octaves, which
        are assessed, and other requested bands.
    margin : ndarray, shape (n_sample,)
        Minimum distance of the octave levels of the assessed force from their limits, dB; negative
        outside the limits.
    conforms : ndarray of bool, shape (n_sample,)
        Whether all criteria are met with the force that the case assesses.
    elastic_conforms, floor_conforms : ndarray of bool, shape (n_sample,)
        Whether all criteria are met with the elastic force, and with the force on the floor.
    elastic_force, floor_force : ndarray, shape (n_sample, n_time), or None
        Forces, N; None unless requested.
    sample_rate : float
        Samples per second, Hz.
    contact_levels : dict of bands to ndarray, shape (n_sample, n_band)
        Levels of the force on the floor of the case, dB; equal to those on a rigid floor if the
        model has no other force. Empty without a floor.
    floor_work : ndarray, shape (n_sample,), or None
        Energy that the source transfers to the floor, J; None without a floor.
    room_level : ndarray, shape (n_sample, 12), or None
        Maximum Fast levels in the room, dB re 20 uPa, in the one-third-octave bands 50 to 630 Hz;
        None without a room.
    room_rating : ndarray, shape (n_sample,), or None
        The rating that the room asks for by its key `rating`, dB, not rounded; None without a room.
    """

    case: Case
    parameters: dict[str, NDArray[np.generic]]
    status: NDArray[np.int32]
    reason: NDArray[np.object_]
    levels: dict[tuple[LevelsForce, BandSet], NDArray[np.float64]]
    margin: NDArray[np.float64]
    conforms: NDArray[np.bool_]
    elastic_conforms: NDArray[np.bool_]
    floor_conforms: NDArray[np.bool_]
    elastic_force: NDArray[np.float64] | None
    floor_force: NDArray[np.float64] | None
    sample_rate: float
    contact_levels: dict[BandSet, NDArray[np.float64]] = field(default_factory=dict)
    floor_work: NDArray[np.float64] | None = None
    room_level: NDArray[np.float64] | None = None
    room_rating: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.status)

    def __repr__(self) -> str:
        """Return the parameters and the number of drops that conform."""
        names = ", ".join(self.parameters)
        failed = f", {np.sum(self.status != 0)} failed" if self.status.any() else ""
        # If no levels were computed, all margins are NaN.
        is_assessed = np.isfinite(self.margin).any() or (self.status != 0).all()
        verdict = f"{self.conforms.sum()} conform" if is_assessed else "not assessed"
        return f"<Ensemble: {len(self)} drops by {names}; {verdict}{failed}>"

    @property
    def warnings(self) -> tuple[str, ...]:
        """Samples without results and the most frequent reason, and sources without conformity."""
        # Without levels, nothing is known of the source.
        conforms = None if self.room_rating is None else self.conforms | np.isnan(self.margin)
        return sample_warnings(self.status, self.reason, conforms)

    @property
    def notes(self) -> tuple[str, ...]:
        """That samples state no numerical errors."""
        return (NO_ERRORS,)

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        rows: list[tuple[str, ...]] = [("", "minimum", "median", "maximum")]
        shown = SCALAR_QUANTITIES | {"margin": SAMPLE_RESULTS["margin"]} | FLOOR_QUANTITIES
        for name, quantity in shown.items():
            values = getattr(self, name)
            if name == ROOM_LEVEL or values is None:
                continue
            computed = values[self.status == 0]
            computed = computed[np.isfinite(computed)]
            if not computed.size:
                continue
            quantiles = np.quantile(computed, [0, 0.5, 1])
            rows.append((quantity.label, *map(quantity.show, quantiles)))
        return rows

    def to_xarray(self) -> xr.Dataset:
        """Return the results along the dimension ``sample``, with units and provenance.

        Raise InputError if xarray is not installed.
        """
        with require_extra("studies"):
            from thud.impact.datasets import ensemble_dataset

        return ensemble_dataset(self)

    @property
    def elastic_octaves(self) -> NDArray[np.float64]:
        """Octave levels of the elastic force, dB, shape (n_sample, 5)."""
        return self.levels["elastic", BANDWIDTHS[0]]

    @property
    def floor_octaves(self) -> NDArray[np.float64]:
        """Octave levels of the force on the floor, dB, shape (n_sample, 5)."""
        return self.levels["floor", BANDWIDTHS[0]]
