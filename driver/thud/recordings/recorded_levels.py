"""Force exposure levels of recorded drops, and their mean with its uncertainty budget."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len
from threadpoolctl import threadpool_limits

from thud.base.immutable import Immutable
from thud.level.estimate import NOISE, RECTANGULAR, Contribution, Estimate
from thud.level.levels import force_exposure_levels, get_bands
from thud.recordings.contact import band_noise
from thud.recordings.drops import Stage
from thud.recordings.filters import filter_levels
from thud.recordings.instruments import AMPLITUDE_DECIBEL, ASSUMED, CALIBRATION

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.recordings.measured_drop import Drop

# Levels above background, dB: below the first value a level is an upper bound, below the second the
# standards require the correction (ISO 10140-4, ISO 16283-2).
BACKGROUND = (6.0, 15.0)
# Change of a level per relative change of an energy, dB.
ENERGY_DECIBEL = 10 / math.log(10)
# Length of a mean force in gates, and number of times that it is scaled to its levels: they then
# differ by less than 0.01 dB.
PADDING, N_SCALING = 4, 5


@dataclass(frozen=True, eq=False, repr=False)
class DropLevels(Stage):
    """Levels of drops.

    Attributes
    ----------
    names : tuple of str, shape (n_drop,)
        Names of the drops.
    bands : str
        ``"octave"`` or ``"third"``.
    level : ndarray, shape (n_drop, n_band)
        Force exposure levels, dB, corrected for the background.
    measured, background : ndarray, shape (n_drop, n_band)
        Levels before the correction, and levels of the noise within the same gate, dB.
    flag : ndarray of str, shape (n_drop, n_band)
        ``""``: more than 15 dB above the background; ``"corrected"``: 6 to 15 dB above it;
        ``"background"``: less than 6 dB above it, the level is an upper bound; ``"rate"``: NaN,
        the sample rate is too low for the band.
    contributions : dict of ndarray, shape (n_drop, n_band)
        Standard uncertainties, dB, by noise and quantization.
    """

    names: tuple[str, ...]
    bands: BandSet
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
    instruments : dict of ndarray, shape (n_band,)
        Standard uncertainties by the instruments, dB.
    """

    drops: DropLevels
    level: NDArray[np.float64]
    background: NDArray[np.float64]
    flag: NDArray[np.str_]
    spread: NDArray[np.float64]
    estimates: tuple[Estimate, ...]
    instruments: Mapping[str, NDArray[np.float64]]


def measure_levels(drops: Sequence[Drop], bands: BandSet = "octave") -> DropLevels:
    """Return the levels of drops, corrected for the background, with their uncertainty.

    They are the band energies of the force within the gate of each drop, less the expected energy
    of the noise. Raise InputError if the bands are unknown.
    """
    # BLAS threads slow down the many small matrix products.
    with threadpool_limits(1, "blas"):
        energies = band_noise(drops, get_bands(bands))
    expected, deviation, quantized = np.moveaxis(energies, 2, 0)
    contacts = [drop.contact for drop in drops]
    measured = np.array([
        force_exposure_levels(contact.gated, contact.sample_rate, bands) for contact in contacts
    ])  # fmt: skip
    with np.errstate(divide="ignore"):
        background = 10 * np.log10(expected)
    level, flag = corrected(measured, background)
    contributions = {
        NOISE: ENERGY_DECIBEL * deviation / 10 ** (level / 10),
        "quantization": ENERGY_DECIBEL * quantized / 10 ** (level / 10),
    }
    names = tuple(drop.name for drop in drops)
    return DropLevels(names, bands, level, measured, background, flag, contributions)


def average_levels(
    drops: DropLevels, instruments: Mapping[str, NDArray[np.float64]], not_stated: tuple[str, ...]
) -> AverageLevels:
    """Return the energy average of the levels of drops, with its budget.

    `instruments` are the standard uncertainties of `instrument_uncertainties`, and `not_stated` the
    contributions whose size is not stated.
    """
    energy = np.mean(10 ** (drops.measured / 10), axis=0)
    with np.errstate(divide="ignore"):
        background = 10 * np.log10(np.mean(10 ** (drops.background / 10), axis=0))
    level, flag = corrected(10 * np.log10(energy), background)
    # Energies relative to the mean: a drop adds to its uncertainty as much as to its energy.
    relative = 10 ** ((drops.level - level) / 10)
    samples = ENERGY_DECIBEL * 10 ** ((drops.measured - level) / 10)
    noises = relative * drops.contributions[NOISE]
    causes = {
        name: (relative * values).mean(axis=0)
        for name, values in drops.contributions.items()
        if name != NOISE
    }
    causes |= instruments
    causes = {name: values for name, values in causes.items() if values.any()}
    estimates = tuple(
        replace(
            Estimate.of_drops(float(level[band]), samples[:, band], noises[:, band], [
                Contribution(
                    name, float(values[band]),
                    size=values[band] / AMPLITUDE_DECIBEL if name == CALIBRATION else math.nan,
                    divisor=RECTANGULAR if name in ASSUMED else 1.0,
                )
                for name, values in causes.items()
            ]),
            upper_bound=flag[band] == "background", not_stated=not_stated,
        )
        for band in range(len(level))
    )  # fmt: skip
    spread = np.full(level.shape, np.nan)
    if len(drops.names) > 1:
        spread = drops.level.std(axis=0, ddof=1)
    return AverageLevels(drops, level, background, flag, spread, estimates, instruments)


def compare_methods(drops: Sequence[Drop]) -> dict[str, NDArray[np.float64]]:
    """Return octave levels of drops by each method, with background, dB, shape (n_drop, 5).

    ``"exact"`` is the band energy of the force in the gate, ``"fft"`` the sum over the 1 Hz bins of
    a window of 1 s, ``"filter"`` the energy after filters of class 1; NaN if the rate is too low.
    """
    forces = [(drop.contact.gated, drop.contact.sample_rate) for drop in drops]
    return {
        "exact": np.array([force_exposure_levels(*force) for force in forces]),
        "fft": np.array([force_exposure_levels(*force, method="fft") for force in forces]),
        "filter": np.array([filter_levels(*force, "octave") for force in forces]),
    }


def mean_force(drop: Drop, level: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the force of a drop, scaled to a level in each one-third-octave band, N, shape (n,).

    The levels are in dB, shape (n_band,); a NaN changes nothing.
    """
    force, rate, bands = drop.contact.gated, drop.contact.sample_rate, get_bands("third")
    count = next_fast_len(PADDING * len(force), real=True)
    frequency = np.fft.rfftfreq(count, 1 / rate)
    below, band = frequency < bands.upper[-1], np.searchsorted(bands.upper, frequency)
    spectrum = np.fft.rfft(force, count)
    for _ in range(N_SCALING):
        gain = np.nan_to_num(level - force_exposure_levels(force, rate, "third"))
        spectrum[below] *= 10 ** (gain[band[below]] / 20)
        force = np.fft.irfft(spectrum, count)
    return np.asarray(force)


def corrected(
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
