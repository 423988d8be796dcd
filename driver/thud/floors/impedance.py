"""Impedance of a source during its impact, from its force on resistive floors."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import BandSet, InfinitePlate
from thud.base.bridge import ask
from thud.base.checks import refuse, refuse_value, require_array, require_kind
from thud.base.display import Tabulated
from thud.case.case import case_text, impact_only
from thud.impact.compute import new_floor_impact
from thud.impact.impact import Impact
from thud.level.levels import force_exposure_levels, get_bands

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from thud.base._schema import FloorOptions
    from thud.base.display import Columns

    Array = NDArray[np.float64]

# Resistances, N s/m: from floors that a ball hardly leaves to floors that change levels by 0.01 dB.
RESISTANCES = np.geomspace(10**2.75, 1e6, 14)
# Frequency points in each band.
_POINTS_PER_BAND = 64


@dataclass(frozen=True, eq=False, repr=False)
class BallImpedance(Tabulated):
    """Impedance of a source during its impact, and the floors on which it matters.

    A linear source in permanent contact acts on a floor of impedance Z with the force
    F = F_b/(1 + Z_B/Z), where F_b is its force on a rigid floor and Z_B the impedance of the
    source. For an impact, which is nonlinear and ends, the effective Z_B is the least-squares
    solution of this equation in a band, with F on a resistive floor Z. It converges as Z increases.

    Attributes
    ----------
    bands : str
        ``"octave"`` or ``"third"``.
    frequency : ndarray, shape (n_band,)
        Rounded mid frequencies, Hz.
    resistance : ndarray, shape (n_floor,)
        Resistances of the floors, ascending, N s/m.
    change : ndarray, shape (n_floor, n_band)
        Level of the contact force − level of the blocked force, dB.
    estimate : ndarray, shape (n_floor, n_band)
        Complex impedance from the force on each floor, N s/m.
    """

    bands: BandSet
    frequency: Array
    resistance: Array
    change: Array
    estimate: NDArray[np.complex128]

    def __repr__(self) -> str:
        """Return the range of the impedance."""
        size = np.abs(self.impedance)
        return f"<BallImpedance: {size.min():.0f} to {size.max():.0f} N s/m in {self.bands}s>"

    @property
    def impedance(self) -> NDArray[np.complex128]:
        """Complex impedance in bands, N s/m, shape (n_band,), from the highest resistance."""
        return np.asarray(self.estimate[-1])

    def limit(self, decibels: float = 1.0) -> Array:
        """Return the resistance below which a floor changes the level, N s/m, shape (n_band,).

        The change, dB, is interpolated on logarithmic axes. NaN if no floor changes the level so
        much.
        """
        if not 0 < decibels < math.inf:
            refuse_value("decibels", decibels, "above 0")
        size = np.log10(np.maximum(np.abs(self.change), 1e-12))
        log_change = math.log10(decibels)
        log_resistance = np.log10(self.resistance)
        result = np.full(len(self.frequency), np.nan)
        for band, column in enumerate(size.T):
            above = np.flatnonzero(column >= log_change)
            if not above.size:
                continue
            if (i := above[-1]) == len(column) - 1:
                allowed = f"above {10 ** column[i]:.2g}, the change at the highest resistance"
                refuse_value("decibels", decibels, allowed)
            ends = slice(i, i + 2)
            result[band] = 10 ** np.interp(-log_change, -column[ends], log_resistance[ends])
        return result

    def columns(self) -> Columns:
        """Return impedance and `limit` in bands."""
        return {
            "band, Hz": (self.frequency, "g"),
            "impedance, N s/m": (np.abs(self.impedance), ".0f"),
            "phase, degrees": (np.angle(self.impedance, deg=True), ".0f"),
            "1 dB below, N s/m": (self.limit(), ".0f"),
        }

    def plot(
        self, ax: Axes | None = None, floors: Mapping[str, FloorOptions] | None = None
    ) -> Figure:
        """Draw the impedances of source and floors, by name, and where levels change by 1 dB."""
        from thud.plot.floor_figures import ball_impedances

        return ball_impedances({"": self}, floors or {}, ax)


def ball_impedance(
    source: Impact, resistance: ArrayLike | None = None, bands: BandSet = "octave"
) -> BallImpedance:
    """Return the impedance of a source during its impact.

    The forces on resistive floors (infinite plates) are compared with the force on a rigid floor.
    Estimates from different floors differ if the source is nonlinear.

    Parameters
    ----------
    source
        Impact of a model whose force depends on the floor. Its record must last until the source
        has left the floor of the lowest resistance.
    resistance : array_like, shape (n_floor,)
        Resistances, ascending, N s/m; by default 14 values from 562 to 1e6.
    bands
        ``"octave"`` or ``"third"``.

    Raises
    ------
    InputError
        If the force of the model does not depend on the floor, a resistance is out of range, or
        the source does not leave a floor.

    Examples
    --------
    >>> import thud
    >>> ball = thud.ball_impedance(thud.solve(), resistance=[1e5, 1e6])
    >>> ball.impedance[:2].real.round()
    array([311., 436.])
    """
    require_kind("source", source, Impact)
    values = RESISTANCES if resistance is None else resistance
    floors = require_array("resistance", values, (1,), "iuf")
    if len(floors) == 0 or not (np.diff(floors) > 0).all():
        refuse("resistance: the values do not ascend", "one value or more, ascending")
    edges = get_bands(bands)
    blocked = source.levels(bands, force="floor")
    spectrum = _band_spectra(source.floor_force, source.sample_rate, bands)
    changes, estimates = [], []
    for value in floors:
        force = _force_on(source, float(value))
        levels = force_exposure_levels(force, source.sample_rate, bands, source.case.levels.method)
        changes.append(levels - blocked)
        pairs = zip(spectrum, _band_spectra(force, source.sample_rate, bands), strict=True)
        estimates.append([value * np.vdot(f, fb - f) / np.vdot(f, f) for fb, f in pairs])
    return BallImpedance(
        bands=bands,
        frequency=edges.nominal,
        resistance=np.array(floors, dtype=np.float64),
        change=np.array(changes),
        estimate=np.array(estimates),
    )


def _force_on(source: Impact, resistance: float) -> Array:
    """Return the force of the same drop on a resistive floor, N, shape (n_sample,)."""
    case = replace(impact_only(source.case), room=None, floor=InfinitePlate(resistance))
    impact = new_floor_impact(case, ask("floor_impact", case=case_text(case)), source.floor_force)
    if impact is None:
        refuse(
            "source: the force of its model is the same on all floors",
            "an impact of a model whose force depends on the floor",
        )
    return impact.floor_force


def _band_spectra(force: Array, sample_rate: float, bands: BandSet) -> list[NDArray[np.complex128]]:
    """Return the spectrum of a force in each band, at the same number of frequency points."""
    edges = get_bands(bands)
    time = np.arange(len(force)) / sample_rate
    fraction = (np.arange(_POINTS_PER_BAND) + 0.5) / _POINTS_PER_BAND
    points = np.outer(edges.upper - edges.lower, fraction) + edges.lower[:, np.newaxis]
    return [np.asarray(np.exp(-2j * np.pi * np.outer(f, time)) @ force, complex) for f in points]
