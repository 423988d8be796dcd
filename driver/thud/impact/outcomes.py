"""Outcomes of many drops."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import SampleQuantities
from thud.base.display import Displayed
from thud.base.extras import require_extra
from thud.impact.quantities import FLOOR_QUANTITIES, ROOM_LEVEL, SAMPLE_RESULTS, SCALAR_QUANTITIES
from thud.level.levels import BANDWIDTHS

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from thud.base._schema import BandSet, LevelsForce
    from thud.case.case import Case


@dataclass(frozen=True, eq=False, kw_only=True)
class Ensemble(SampleQuantities, Displayed):
    """Results of many samples of a case; NaN if a sample could not be computed.

    It has the attributes of `SampleQuantities`, and those below.

    Attributes
    ----------
    case : Case
        All other keys.
    parameters : dict of str to ndarray, shape (n_sample,)
        Parameters in which the drops differ.
    status : ndarray of int, shape (n_sample,)
        0, or the exit code of the error: 1 bad input, 2 numerical failure.
    reason : ndarray of str, shape (n_sample,)
        The message of the error.
    levels : dict of (force, bands) to ndarray, shape (n_sample, n_band)
        Force exposure levels, dB: of ``"elastic"`` and ``"floor"``, in octaves, on which the
        verdict is based, and in the other bands of the case.
    margin : ndarray, shape (n_sample,)
        Minimum distance of an octave level of the assessed force to its limits, dB; positive
        inside.
    conforms : ndarray of bool, shape (n_sample,)
        Verdict of the standards on the force that the case assesses.
    elastic_conforms, floor_conforms : ndarray of bool, shape (n_sample,)
        The same on the elastic force and on the force on the floor.
    elastic_force, floor_force : ndarray, shape (n_sample, n_time), or None
        Forces, N; None unless requested.
    sample_rate : float
        Samples per second, Hz.
    contact_levels : dict of bands to ndarray, shape (n_sample, n_band)
        Of cases with a floor: levels of the force on it, dB; on a rigid floor, and of models that
        have no other, those of the force there.
    floor_work : ndarray, shape (n_sample,), or None
        Likewise the energy that the source gives to the floor, J.
    room_level : ndarray, shape (n_sample, 12), or None
        Of cases with a room: maximum Fast levels of the one-third-octave bands 50 to 630 Hz, dB
        re 20 uPa.
    room_rating, standardized_rating : ndarray, shape (n_sample,), or None
        Their A-weighted sum L_iA,Fmax, dB, and that of the standardized levels; see `rating`.
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
    standardized_rating: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.status)

    def __repr__(self) -> str:
        """Return the parameters, and how many drops conform."""
        names = ", ".join(self.parameters)
        failed = f", {np.sum(self.status != 0)} failed" if self.status.any() else ""
        # Without levels the margins of drops that were computed are not known.
        is_assessed = np.isfinite(self.margin).any() or (self.status != 0).all()
        verdict = f"{self.conforms.sum()} conform" if is_assessed else "not assessed"
        return f"<Ensemble: {len(self)} drops by {names}; {verdict}{failed}>"

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        rows: list[tuple[str, ...]] = [("", "minimum", "median", "maximum")]
        shown = SCALAR_QUANTITIES | {"margin": SAMPLE_RESULTS["margin"]} | FLOOR_QUANTITIES
        for name, quantity in shown.items():
            values = getattr(self, name)
            if name == ROOM_LEVEL or values is None:
                continue
            known = values[self.status == 0]
            known = known[np.isfinite(known)]
            if not known.size:
                continue
            quantiles = np.quantile(known, [0, 0.5, 1])
            rows.append((quantity.label, *map(quantity.show, quantiles)))
        return rows

    def to_xarray(self) -> xr.Dataset:
        """Return the outcomes along the dimension ``sample``, with units and provenance.

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
