"""Results of many drops."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base._schema import SampleQuantities
from thud.base.display import Displayed
from thud.base.extras import require_extra
from thud.base.note import Note
from thud.impact.quantities import RESULTS

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from thud.case.case import Case

NO_ERRORS = Note("no_numerical_errors")


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
    elastic_octave, floor_octave : ndarray, shape (n_sample, 5)
        Force exposure levels of the octaves, which are assessed, dB: those of the elastic force and
        of the force on a rigid floor.
    elastic_third, floor_third : ndarray, shape (n_sample, 15), or None
        Levels of the one-third-octave bands, dB; None unless requested.
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
    contact_octave, contact_third : ndarray, shape (n_sample, n_band), or None
        Levels of the force on the floor of the case, dB; equal to those on a rigid floor if the
        model has no other force. None without a floor, or if the bands are not requested.
    floor_work : ndarray, shape (n_sample,), or None
        Energy that the source transfers to the floor, J; None without a floor.
    room_third : ndarray, shape (n_sample, 12), or None
        Maximum Fast levels in the room, dB re 20 uPa, in the one-third-octave bands 50 to 630 Hz;
        None without a room.
    room_rating : ndarray, shape (n_sample,), or None
        The rating that the room asks for by its key `rating`, dB, not rounded; None without a room.
    """

    case: Case
    parameters: dict[str, NDArray[np.generic]]
    status: NDArray[np.int32]
    reason: NDArray[np.object_]
    elastic_octave: NDArray[np.float64]
    floor_octave: NDArray[np.float64]
    margin: NDArray[np.float64]
    conforms: NDArray[np.bool_]
    elastic_conforms: NDArray[np.bool_]
    floor_conforms: NDArray[np.bool_]
    sample_rate: float
    elastic_third: NDArray[np.float64] | None = None
    floor_third: NDArray[np.float64] | None = None
    contact_octave: NDArray[np.float64] | None = None
    contact_third: NDArray[np.float64] | None = None
    elastic_force: NDArray[np.float64] | None = None
    floor_force: NDArray[np.float64] | None = None
    floor_work: NDArray[np.float64] | None = None
    room_third: NDArray[np.float64] | None = None
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
    def results(self) -> dict[str, NDArray[Any]]:
        """Results that were computed, by their names in `thud.impact.quantities.RESULTS`."""
        values = {name: getattr(self, name, None) for name in RESULTS}
        return {name: array for name, array in values.items() if array is not None}

    @property
    def notes(self) -> tuple[Note, ...]:
        """Warnings of samples without results or conformity; that none states numerical errors."""
        # Without levels, nothing is known of the source.
        conforms = None if self.room_rating is None else self.conforms | np.isnan(self.margin)
        return (*sample_warnings(self.status, self.reason, conforms), NO_ERRORS)

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: the range of each number that every sample has."""
        rows: list[tuple[str, ...]] = [("", "minimum", "median", "maximum")]
        for name, values in self.results.items():
            if values.ndim > 1 or values.dtype.kind != "f":
                continue
            computed = values[(self.status == 0) & np.isfinite(values)]
            if computed.size:
                quantiles = np.quantile(computed, [0, 0.5, 1])
                rows.append((RESULTS[name].label, *map(RESULTS[name].show, quantiles)))
        return rows

    def to_xarray(self) -> xr.Dataset:
        """Return the results along the dimension ``sample``, with units and provenance.

        Raise InputError if xarray is not installed.
        """
        with require_extra("studies"):
            from thud.impact.datasets import ensemble_dataset

        return ensemble_dataset(self)


def sample_warnings(
    status: NDArray[np.integer], reason: NDArray[np.object_], conforms: NDArray[np.bool_] | None
) -> tuple[Note, ...]:
    """Return warnings of samples without results, and of sources that do not conform.

    Parameters
    ----------
    status, reason
        Exit code and message of each sample, as in `Ensemble`, of any shape.
    conforms
        Whether each source conforms, of the same shape; None if levels in a room are not rated.
    """
    failed = status != 0
    result = []
    if failed.any():
        ((cause, _),) = Counter(reason[failed]).most_common(1)
        count = float(failed.sum())
        others = {"reason": cause}
        result.append(Note("samples_failed", value=count, high=failed.size, others=others))
    if conforms is not None and (unlike := ~failed & ~conforms).any():
        result.append(Note("samples_not_standard", value=float(unlike.sum()), high=failed.size))
    return tuple(result)
