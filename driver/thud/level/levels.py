"""Force exposure levels and peaks of any force record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, get_args

import numpy as np

from thud.base._schema import BANDS, BandSet, LevelsForce, LevelsMethod, LimitsSource
from thud.base.bridge import ask
from thud.base.checks import MAX_NUMBER, refuse, require_array, require_choice, require_number
from thud.base.display import Tabulated

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import ArrayLike, NDArray

    from thud.base.display import Columns


BANDWIDTHS: tuple[BandSet, ...] = get_args(BandSet)
SOURCES: tuple[LimitsSource, ...] = get_args(LimitsSource)
# Standards that state the limits of a source.
STANDARDS = {
    "rubber_ball": (
        "JIS A 1418-2:2019 (tables A.1 and A.2), ISO 10140-5:2021 (table F.1) and "
        "ISO 16283-2:2020 (table A.1)"
    ),
    "tyre": "JIS A 1418-2:2019 (tables A.1 and A.2)",
}
FORCES: tuple[LevelsForce, ...] = ("elastic", "floor")
# Upper limit of the band of a force plate, Hz (paper, section 3).
RECORDED_BAND = 1250.0


@dataclass(frozen=True, eq=False, repr=False)
class Bands(Tabulated):
    """Frequency bands of base 10 (IEC 61260-1), ascending; the arrays are read-only.

    Attributes
    ----------
    nominal : ndarray, shape (n_band,)
        Rounded mid frequencies, Hz.
    center : ndarray, shape (n_band,)
        Exact mid frequencies, Hz.
    lower, upper : ndarray, shape (n_band,)
        Band edges, Hz.
    """

    nominal: NDArray[np.float64]
    center: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]

    def __repr__(self) -> str:
        """Return the nominal frequencies."""
        return f"<Bands: {', '.join(f'{f:g}' for f in self.nominal)} Hz>"

    def columns(self) -> Columns:
        """Return the frequencies."""
        return {f"{name}, Hz": (values, ".4g") for name, values in vars(self).items()}


_BANDS = {
    name: Bands(**{column: np.array(values) for column, values in columns.items()})
    for name, columns in BANDS.items()
}


def get_bands(bands: BandSet = "octave") -> Bands:
    """Return the octaves 31.5 to 500 Hz or the one-third octaves 25 to 630 Hz.

    Parameters
    ----------
    bands
        ``"octave"`` or ``"third"``.

    Raises
    ------
    InputError
        If `bands` is unknown.
    """
    require_choice("bands", bands, BANDWIDTHS)
    return _BANDS[bands]


def force_exposure_levels(
    force: ArrayLike, sample_rate: float, bands: BandSet = "octave", method: LevelsMethod = "exact"
) -> NDArray[np.float64]:
    """Return the force exposure levels of a force record.

    The level of a band is 10 lg(E/(1 N2 s)), with E the integral of 2 abs(F(f))**2 df over the band
    (JIS A 1418-2). The force is zero before the first and after the last sample.

    Parameters
    ----------
    force : array_like, shape (n_sample,)
        Force, N.
    sample_rate
        Samples per second, Hz; at least twice the highest band edge.
    bands
        ``"octave"`` (31.5 to 500 Hz) or ``"third"`` (25 to 630 Hz).
    method
        ``"exact"``: the band energy of the finite record; ``"fft"``: the sum over the 1 Hz bins
        of a record of 1 s, as in the paper.

    Returns
    -------
    ndarray, shape (n_band,)
        Levels of the bands in ascending order, dB re 1 N and 1 s. No level is lower than the
        rounding error, 156 dB below the total level.

    Raises
    ------
    InputError
        If the record is empty, zero throughout, not finite or not one-dimensional, or the
        rate, the bands or the method are invalid.
    """
    require_choice("bands", bands, BANDWIDTHS)
    require_choice("method", method, get_args(LevelsMethod))
    record = require_array("force", force, (1,), "iuf")
    require_number("sample_rate", sample_rate)
    answer = ask("levels", force=record, sample_rate=sample_rate, bands=bands, method=method)
    return np.asarray(answer["levels"])


def low_pass(
    force: NDArray[np.float64], sample_rate: float, cutoff: float = RECORDED_BAND
) -> NDArray[np.float64]:
    """Return a force low-passed at a cutoff, by default the limit of a force plate.

    Forces, N, have the shape (n_sample,) and start and end at zero; rate and cutoff are in Hz.
    """
    answer = ask("low_pass", force=force, sample_rate=sample_rate, cutoff=cutoff)
    return np.asarray(answer["force"])


def peak_count(force: ArrayLike, sample_rate: float) -> int:
    """Return the number of peaks of a force.

    A local maximum is a peak if the force falls by more than 10 % of the peak force on both sides.
    The force, N, shape (n_sample,), starts and ends at zero; only content below 1.25 kHz is used.
    Raise InputError if the force is empty, not finite or not one-dimensional, or the rate, Hz, is
    not positive.
    """
    rate = require_number("sample_rate", sample_rate, 1.0, 1e9, "Hz")
    answer = ask("peak_count", force=finite_array("force", force), sample_rate=rate)
    return int(answer["peak_count"])


def finite_array(
    name: str, values: ArrayLike, dimensions: Collection[int] = (1,),
    span: tuple[float, float] = (-MAX_NUMBER, MAX_NUMBER), unit: str = "",
) -> NDArray[np.float64]:  # fmt: skip
    """Return an array of finite numbers; raise InputError if it is none, empty or out of range."""
    array = require_array(name, values, dimensions, "iuf")
    if not array.size:
        refuse(f"{name} is empty", "finite numbers")
    for end in (array.min(), array.max()):
        require_number(name, end, *span, unit)
    return array
