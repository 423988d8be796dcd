"""Force exposure levels of recorded drops: background, uncertainty, average and outliers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len
from scipy.signal import czt

from thud.base.checks import require_choice
from thud.base.immutable import Immutable
from thud.level.estimate import NOISE, RECTANGULAR, Budget, Size
from thud.level.levels import force_exposure_levels, get_bands
from thud.recordings.background import step_errors
from thud.recordings.checks.outliers import SIGNIFICANCE, find_outliers
from thud.recordings.contact import band_noise
from thud.recordings.filters import filter_levels

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.base.note import Note
    from thud.level.estimate import Estimate
    from thud.recordings.measured_drop import Drop

METHODS = ("exact", "fft", "filter")
# Levels above background, dB: below the first value a level is an upper bound, below the second the
# standards require the correction (ISO 10140-4, ISO 16283-2).
BACKGROUND = (6.0, 15.0)
# Change of a level per relative change of an energy, dB.
ENERGY_DECIBEL = 10 / math.log(10)
# Length of a mean force in gates, and number of times that it is scaled to its levels: they then
# differ by less than 0.01 dB.
PADDING, N_SCALING = 4, 5
# Contributions that drops share: half widths of rectangular distributions.
METHOD, OFFSET_STEP = "method", "offset step"


@dataclass(frozen=True, eq=False)
class DropLevels(Immutable):
    """Levels of one drop.

    Attributes
    ----------
    name, bands, method : str
        Name of the drop, ``"octave"`` or ``"third"``, and method of measurement.
    level : ndarray, shape (n_band,)
        Force exposure levels, dB, corrected for the background.
    measured, background : ndarray, shape (n_band,)
        Levels before the correction, and levels of the noise within the same gate, dB.
    flag : ndarray of str, shape (n_band,)
        ``""``: more than 15 dB above the background; ``"corrected"``: 6 to 15 dB above it;
        ``"background"``: less than 6 dB above it, the level is an upper bound; ``"rate"``: NaN,
        the sample rate is too low for the band.
    contributions : dict of ndarray, shape (n_band,)
        Standard uncertainties, dB: noise, method, offset step, and quantization if the background
        lies within a step.
    """

    name: str
    bands: BandSet
    method: str
    level: NDArray[np.float64]
    measured: NDArray[np.float64]
    background: NDArray[np.float64]
    flag: NDArray[np.str_]
    contributions: dict[str, NDArray[np.float64]]

    @property
    def uncertainty(self) -> NDArray[np.float64]:
        """Combined standard uncertainty by `contributions`, dB, shape (n_band,)."""
        squares = [value**2 for value in self.contributions.values()]
        return np.asarray(np.sqrt(np.sum(squares, axis=0)))

    def plot(self) -> Figure:
        """Draw the levels with their standard uncertainty, and the background."""
        from thud.plot.stage_figures import draw_levels

        return draw_levels(self)


@dataclass(frozen=True, eq=False)
class AverageLevels(Immutable):
    """Energy average of the levels of drops.

    Attributes
    ----------
    bands, method : str
        As in `DropLevels`.
    names : tuple of str, shape (n_drop,)
        Names of the drops.
    drops : ndarray, shape (n_drop, n_band)
        Level of each drop, dB.
    level, background : ndarray, shape (n_band,)
        Level of the mean energy, corrected for the background, and the mean background, dB.
    flag : ndarray of str, shape (n_band,)
        As in `DropLevels`, from the mean energies.
    spread : ndarray, shape (n_band,)
        Standard deviation of the drops' levels, dB; NaN for a single drop.
    budget : Budget
        Contributions to the uncertainty of the average, dB.
    estimates : tuple of Estimate, shape (n_band,)
        The levels with this budget.
    outliers : tuple of Note
        Drops that differ from the others.
    """

    bands: BandSet
    method: str
    names: tuple[str, ...]
    drops: NDArray[np.float64]
    level: NDArray[np.float64]
    background: NDArray[np.float64]
    flag: NDArray[np.str_]
    spread: NDArray[np.float64]
    budget: Budget
    estimates: tuple[Estimate, ...]
    outliers: tuple[Note, ...]

    @property
    def uncertainty(self) -> NDArray[np.float64]:
        """Combined standard uncertainty of `estimates`, dB, shape (n_band,)."""
        return np.array([estimate.uncertainty for estimate in self.estimates])


def measure_levels(
    drops: Sequence[Drop], bands: BandSet = "octave", method: str = "exact"
) -> list[DropLevels]:
    """Return the levels of drops, corrected for the background, with their uncertainty.

    The force is set to zero outside the gate of each drop. ``"exact"`` is its band energy,
    ``"fft"`` the sum over the 1 Hz bins of a window of 1 s, ``"filter"`` the energy after filters
    of class 1. The expected energy of the noise is subtracted. Raise InputError if method or bands
    are unknown.
    """
    require_choice("method", method, METHODS)
    noise = band_noise(drops, get_bands(bands))
    return [
        _drop_levels(drop, bands, method, energies)
        for drop, energies in zip(drops, noise, strict=True)
    ]


def _drop_levels(drop: Drop, bands: BandSet, method: str, noise: NDArray[np.float64]) -> DropLevels:
    """Return the levels of a drop from the energies of its noise, [n_band, 3]."""
    force, rate = drop.contact.gated, drop.sample_rate
    exact = _levels(force, rate, bands, "exact")
    measured = exact if method == "exact" else _levels(force, rate, bands, method)
    expected, deviation, offset = noise.T
    with np.errstate(divide="ignore"):
        background = 10 * np.log10(expected)
    level, flag = _corrected(measured, background)
    contributions = {
        NOISE: ENERGY_DECIBEL * deviation / 10 ** (level / 10),
        METHOD: np.abs(measured - exact) / RECTANGULAR,
        OFFSET_STEP: _step_uncertainty(drop, bands, exact),
    }
    if offset.any():
        contributions["quantization"] = ENERGY_DECIBEL * offset / 10 ** (level / 10)
    return DropLevels(drop.name, bands, method, level, measured, background, flag, contributions)


def _step_uncertainty(
    drop: Drop, bands: BandSet, exact: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the standard uncertainty due to a step of the offset during the contact, dB."""
    if not drop.offset_step:
        return np.zeros(len(exact))
    force = drop.contact.gated
    changed = [
        _levels(force + error, drop.sample_rate, bands, "exact")
        for error in step_errors(drop.offset_step, len(force))
    ]
    return np.asarray(np.abs(np.array(changed) - exact).max(axis=0) / RECTANGULAR)


def compare_methods(drop: Drop, bands: BandSet = "octave") -> dict[str, NDArray[np.float64]]:
    """Return the levels of a drop by each method, dB, shape (n_band,), background included."""
    force = drop.contact.gated
    return {method: _levels(force, drop.sample_rate, bands, method) for method in METHODS}


def average_levels(
    levels: Sequence[DropLevels],
    shared: Mapping[str, NDArray[np.float64]] | None = None,
    sizes: Mapping[str, Size] | None = None,
    not_stated: Sequence[str] = (),
) -> AverageLevels:
    """Return the energy average of the levels of drops, its budget, and outliers.

    `shared` are standard uncertainties that all drops share, dB, shape (n_band,), by name, with
    their `sizes`; `not_stated` are uncertainties that are not stated.
    """
    first, count = levels[0], len(levels)
    drops = np.array([entry.level for entry in levels])
    energies = np.array([10 ** (entry.measured / 10) for entry in levels])
    with np.errstate(divide="ignore"):
        noise = np.mean([10 ** (entry.background / 10) for entry in levels], axis=0)
        background = 10 * np.log10(noise)
    level, flag = _corrected(10 * np.log10(energies.mean(axis=0)), background)
    weights = 10 ** (drops / 10)
    weights /= weights.sum(axis=0)
    none = np.zeros(len(level))
    weighted = {
        name: weights * [entry.contributions.get(name, none) for entry in levels]
        for name in dict.fromkeys(name for entry in levels for name in entry.contributions)
    }
    single = np.full(level.shape, np.nan)
    scatter = energies.std(axis=0, ddof=1) / math.sqrt(count) if count > 1 else single
    budget = Budget.of_mean(
        np.sqrt((weighted.pop(NOISE) ** 2).sum(axis=0)),
        {name: values.sum(axis=0) for name, values in weighted.items()} | dict(shared or {}),
        scatter * ENERGY_DECIBEL / 10 ** (level / 10),
        count,
        {name: Size(divisor=RECTANGULAR) for name in (METHOD, OFFSET_STEP)} | dict(sizes or {}),
    )
    return AverageLevels(
        first.bands, first.method, tuple(entry.name for entry in levels), drops, level, background,
        flag, drops.std(axis=0, ddof=1) if count > 1 else single, budget,
        budget.estimates(level, flag == "background", not_stated), _level_outliers(levels, drops),
    )  # fmt: skip


def mean_force(drops: Sequence[Drop], level: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a force with the mean energy of drops and the phase of the first, N, shape (n,).

    In each one-third-octave band it has the given level, dB, shape (n_band,); a NaN changes
    nothing. The sample rate is that of the first drop.
    """
    rate, bands = drops[0].sample_rate, get_bands("third")
    forces = [drop.contact.gated for drop in drops]
    count = next_fast_len(PADDING * max(map(len, forces)), real=True)
    frequency = np.fft.rfftfreq(count, 1 / rate)
    spectra = [
        czt(force, len(frequency), np.exp(-2j * np.pi * frequency[1] / drop.sample_rate))
        / drop.sample_rate
        * (frequency < drop.sample_rate / 2)
        for force, drop in zip(forces, drops, strict=True)
    ]
    size = np.sqrt(np.mean(np.abs(spectra) ** 2, axis=0))
    spectrum = rate * size * np.exp(1j * np.angle(spectra[0]))
    below, band = frequency < bands.upper[-1], np.searchsorted(bands.upper, frequency)
    for _ in range(N_SCALING):
        force = np.fft.irfft(spectrum, count)
        gain = np.nan_to_num(level - force_exposure_levels(force, rate, "third"))
        spectrum[below] *= 10 ** (gain[band[below]] / 20)
    return np.asarray(np.fft.irfft(spectrum, count))


def _levels(
    force: NDArray[np.float64], rate: float, bands: BandSet, method: str
) -> NDArray[np.float64]:
    """Return levels by a method, dB; NaN if the rate is too low for the band."""
    if method == "filter":
        return filter_levels(force, rate, bands)
    return force_exposure_levels(force, rate, bands, "fft" if method == "fft" else "exact")


def _corrected(
    measured: NDArray[np.float64], background: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.str_]]:
    """Return levels corrected for the background, and flags.

    Less than 6 dB above the background the correction is that at 6 dB. More than 15 dB above it the
    standards require none, but it is applied, up to 0.14 dB.
    """
    low, high = BACKGROUND
    above = measured - background
    level = measured + 10 * np.log10(1 - 10 ** (-np.maximum(above, low) / 10))
    flag = np.where(above < low, "background", np.where(above <= high, "corrected", ""))
    return level, np.where(np.isnan(measured), "rate", flag)


def _level_outliers(
    estimates: Sequence[DropLevels], drops: NDArray[np.float64]
) -> tuple[Note, ...]:
    """Return the outliers in any band, at 5 % for all bands together (Bonferroni)."""
    nominal = get_bands(estimates[0].bands).nominal
    names = [e.name for e in estimates]
    noise = np.array([e.contributions[NOISE] for e in estimates])
    return tuple(
        outlier
        for band, middle in enumerate(nominal)
        for outlier in find_outliers(
            drops[:, band], names, f"level at {middle:g} Hz, dB,", noise[:, band],
            SIGNIFICANCE / len(nominal),
        )
    )  # fmt: skip
