"""Force exposure levels of recorded drops: background, uncertainty, average and outliers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

from thud.base.checks import require_choice
from thud.base.immutable import Immutable
from thud.level.estimate import NOISE, RECTANGULAR, Contribution, Estimate
from thud.level.levels import force_exposure_levels, get_bands
from thud.recordings.checks.outliers import SIGNIFICANCE, find_outliers
from thud.recordings.contact import band_noise
from thud.recordings.filters import filter_levels
from thud.recordings.stage import Stage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.base.note import Note
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
METHOD = "method"
DIVISORS = {METHOD: RECTANGULAR}


@dataclass(frozen=True, eq=False)
class DropLevels(Stage):
    """Levels of drops.

    Attributes
    ----------
    names : tuple of str, shape (n_drop,)
        Names of the drops.
    bands, method : str
        ``"octave"`` or ``"third"``, and method of measurement.
    level : ndarray, shape (n_drop, n_band)
        Force exposure levels, dB, corrected for the background.
    measured, background : ndarray, shape (n_drop, n_band)
        Levels before the correction, and levels of the noise within the same gate, dB.
    flag : ndarray of str, shape (n_drop, n_band)
        ``""``: more than 15 dB above the background; ``"corrected"``: 6 to 15 dB above it;
        ``"background"``: less than 6 dB above it, the level is an upper bound; ``"rate"``: NaN,
        the sample rate is too low for the band.
    contributions : dict of ndarray, shape (n_drop, n_band)
        Standard uncertainties, dB, by noise, method, and quantization if the background lies within
        a step.
    """

    names: tuple[str, ...]
    bands: BandSet
    method: str
    level: NDArray[np.float64]
    measured: NDArray[np.float64]
    background: NDArray[np.float64]
    flag: NDArray[np.str_]
    contributions: dict[str, NDArray[np.float64]]

    @property
    def uncertainty(self) -> NDArray[np.float64]:
        """Combined standard uncertainty by `contributions`, dB, shape (n_drop, n_band)."""
        squares = [value**2 for value in self.contributions.values()]
        return np.asarray(np.sqrt(np.sum(squares, axis=0)))


@dataclass(frozen=True, eq=False)
class AverageLevels(Immutable):
    """Energy average of the levels of drops.

    Attributes
    ----------
    drops : DropLevels
        Levels of each drop.
    level, background : ndarray, shape (n_band,)
        Level of the mean energy, corrected for the background, and the mean background, dB.
    flag : ndarray of str, shape (n_band,)
        As in `DropLevels`, from the mean energies.
    spread : ndarray, shape (n_band,)
        Standard deviation of the drops' levels, dB; NaN for a single drop.
    estimates : tuple of Estimate, shape (n_band,)
        The levels with their uncertainty budgets.
    outliers : tuple of Note
        Drops that differ from the others.
    """

    drops: DropLevels
    level: NDArray[np.float64]
    background: NDArray[np.float64]
    flag: NDArray[np.str_]
    spread: NDArray[np.float64]
    estimates: tuple[Estimate, ...]
    outliers: tuple[Note, ...]


def measure_levels(
    drops: Sequence[Drop], bands: BandSet = "octave", method: str = "exact"
) -> DropLevels:
    """Return the levels of drops, corrected for the background, with their uncertainty.

    The force is set to zero outside the gate of each drop. ``"exact"`` is its band energy,
    ``"fft"`` the sum over the 1 Hz bins of a window of 1 s, ``"filter"`` the energy after filters
    of class 1. The expected energy of the noise is subtracted. Raise InputError if method or bands
    are unknown.
    """
    require_choice("method", method, METHODS)
    # Shape (3, n_drop, n_band).
    expected, deviation, quantized = np.moveaxis(band_noise(drops, get_bands(bands)), 2, 0)
    exact = _levels(drops, bands, "exact")
    measured = exact if method == "exact" else _levels(drops, bands, method)
    with np.errstate(divide="ignore"):
        background = 10 * np.log10(expected)
    level, flag = _corrected(measured, background)
    contributions = {
        NOISE: ENERGY_DECIBEL * deviation / 10 ** (level / 10),
        METHOD: np.abs(measured - exact) / RECTANGULAR,
    }
    if quantized.any():
        contributions["quantization"] = ENERGY_DECIBEL * quantized / 10 ** (level / 10)
    names = tuple(drop.name for drop in drops)
    return DropLevels(names, bands, method, level, measured, background, flag, contributions)


def compare_methods(
    drops: Sequence[Drop], bands: BandSet = "octave"
) -> dict[str, NDArray[np.float64]]:
    """Return the levels of drops by each method, background included, dB, [n_drop, n_band]."""
    return {method: _levels(drops, bands, method) for method in METHODS}


def _levels(drops: Sequence[Drop], bands: BandSet, method: str) -> NDArray[np.float64]:
    """Return levels by a method, dB, [n_drop, n_band]; NaN if a rate is too low for a band."""
    contacts = [drop.contact for drop in drops]
    return np.array([
        filter_levels(contact.gated, contact.sample_rate, bands) if method == "filter"
        else force_exposure_levels(
            contact.gated, contact.sample_rate, bands, "fft" if method == "fft" else "exact"
        )
        for contact in contacts
    ])  # fmt: skip


def average_levels(
    drops: DropLevels,
    shared: Sequence[Sequence[Contribution]] = (),
    not_stated: Sequence[str] = (),
) -> AverageLevels:
    """Return the energy average of the levels of drops, its budget, and outliers.

    `shared` are contributions that all drops share, dB, by band; `not_stated` are uncertainties
    that are not stated.
    """
    count, energies = len(drops.names), 10 ** (drops.measured / 10)
    with np.errstate(divide="ignore"):
        background = 10 * np.log10(np.mean(10 ** (drops.background / 10), axis=0))
    level, flag = _corrected(10 * np.log10(energies.mean(axis=0)), background)
    weights = 10 ** (drops.level / 10)
    weights /= weights.sum(axis=0)
    noise = np.sqrt(((weights * drops.contributions[NOISE]) ** 2).sum(axis=0))
    common = {
        name: (weights * values).sum(axis=0)
        for name, values in drops.contributions.items()
        if name != NOISE and values.any()
    }
    spread = scatter = np.full(level.shape, np.nan)
    if count > 1:
        spread = drops.level.std(axis=0, ddof=1)
        scatter = energies.std(axis=0, ddof=1) / math.sqrt(count)
        scatter = scatter * ENERGY_DECIBEL / 10 ** (level / 10)
    estimates = tuple(
        Estimate.of_mean(
            float(level[band]), float(noise[band]), float(scatter[band]), count,
            [
                Contribution(name, float(values[band]), divisor=DIVISORS.get(name, 1.0))
                for name, values in common.items()
            ] + list(shared[band] if shared else ()),
            upper_bound=flag[band] == "background", not_stated=tuple(not_stated),
        )
        for band in range(len(level))
    )  # fmt: skip
    # At 5 % for all bands together (Bonferroni).
    nominal = get_bands(drops.bands).nominal
    outliers = tuple(
        outlier
        for middle, levels, own in zip(
            nominal, drops.level.T, drops.contributions[NOISE].T, strict=True
        )
        for outlier in find_outliers(
            levels, drops.names, f"level at {middle:g} Hz, dB,", own, SIGNIFICANCE / len(nominal)
        )
    )
    return AverageLevels(drops, level, background, flag, spread, estimates, outliers)


def mean_force(drop: Drop, level: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the force of a drop, scaled to a level in each one-third-octave band, N, shape (n,).

    The levels are in dB, shape (n_band,); a NaN changes nothing.
    """
    force, rate, bands = drop.contact.gated, drop.sample_rate, get_bands("third")
    count = next_fast_len(PADDING * len(force), real=True)
    frequency = np.fft.rfftfreq(count, 1 / rate)
    below, band = frequency < bands.upper[-1], np.searchsorted(bands.upper, frequency)
    spectrum = np.fft.rfft(force, count)
    for _ in range(N_SCALING):
        gain = np.nan_to_num(level - force_exposure_levels(force, rate, "third"))
        spectrum[below] *= 10 ** (gain[band[below]] / 20)
        force = np.fft.irfft(spectrum, count)
    return np.asarray(force)


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
