"""Assumptions on the instruments of a recording, with their sizes for the uncertainty budget."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

from thud.base.note import Note
from thud.level.estimate import RECTANGULAR, Size
from thud.level.levels import get_bands, low_pass
from thud.recordings.plate import TOLERANCE, Plate
from thud.recordings.recorder_filter import assumed_filter

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.level.estimate import Budget
    from thud.recordings.config import Config
    from thud.recordings.measured_drop import Drop

    Gain = Callable[[NDArray[np.float64]], NDArray[np.float64]]

# Change of a level per relative change of a force, dB.
AMPLITUDE_DECIBEL = 20 / math.log(10)
# Frequency up to which a plate is assumed to be flat if nothing is stated, Hz (ISO 10140-5).
ASSUMED_FLAT = 1000.0
# Effect on an octave above which an assumption is a warning, dB.
MIN_WARNED = 0.1
# Cutoff of a filter over the equivalent bandwidth of its noise: 0.89 of a mean, 0.96 of a Bessel
# filter of order 4. White noise up to half the rate has more than a quarter of the rate.
CUTOFF_RATIO = 0.9
# Length of the spectrum of a pulse, in lengths of the pulse: the lowest band holds three lines; for
# the peak, longer responses do not return to the beginning.
PADDING = 16
PEAK_PADDING = 2


# Contributions of instruments that are not stated: rectangular distributions.
ASSUMED_PLATE, ASSUMED_SHARE, ASSUMED_FILTER = ASSUMED = (
    "plate, assumed",
    "share of the plate's resonance, assumed",
    "recorder filter, assumed",
)
# Share of a resonance in the static response that may be instead of the whole, if it is not stated.
MIN_SHARE = 0.5


def instrument_contributions(
    drops: Sequence[Drop], config: Config, calibration: float | None, bands: BandSet = "octave"
) -> tuple[dict[str, NDArray[np.float64]], dict[str, Size]]:
    """Return standard uncertainties of levels due to the instruments, dB, shape (n_band,), by name.

    Also return their sizes. `calibration` is the relative standard uncertainty of the force.
    An instrument that is not stated may change a level by any amount between zero and the given
    size: a rectangular distribution with this half-width.
    """
    contributions = {}
    if calibration is not None:
        change = AMPLITUDE_DECIBEL * calibration
        contributions["calibration"] = np.full(len(get_bands(bands).nominal), change)
    pulses = PulseSpectra(drops)
    plate, stated = config.resonance, config.recorder_filter
    if plate is not None:
        contributions["plate"] = plate.level_uncertainty(bands)
    if stated is not None:
        shifted = stated.shifted()
        contributions["recorder filter"] = np.abs(
            pulses.level_change(lambda f: np.abs(shifted.response(f) / stated.response(f)), bands)
        )
    assumed = {
        ASSUMED_PLATE: _plate_gain(drops, config),
        ASSUMED_SHARE: _share_gain(config),
        ASSUMED_FILTER: _filter_gain(drops, config),
    }
    for name, gain in assumed.items():
        if gain is not None:
            contributions[name] = np.abs(pulses.level_change(gain, bands)) / RECTANGULAR
    sizes = {name: Size(divisor=RECTANGULAR) for name in ASSUMED}
    sizes["calibration"] = Size(math.nan if calibration is None else calibration)
    return {name: values for name, values in contributions.items() if values.any()}, sizes


def check_assumptions(drops: Sequence[Drop], config: Config, octaves: Budget) -> list[Note]:
    """Return a warning for each assumption on the instruments that matters.

    `octaves` is the budget of the octave levels of the drops.
    """
    plate, limit = config.resonance, _flat_limit(config)
    seen = [drop.plate_recorded for drop in drops]
    contributions = dict(zip(octaves.names, octaves.uncertainty, strict=True))
    rings = any(drop.ringing for drop in drops)
    assumed = {
        "plate_estimated": (ASSUMED_PLATE, plate is None and rings),
        "plate_assumed": (ASSUMED_PLATE, plate is None and limit is None and not rings),
        "share_assumed": (ASSUMED_SHARE, ASSUMED_SHARE in contributions),
        "filter_assumed": (ASSUMED_FILTER, config.filter is None),
        "plate_not_recorded": (ASSUMED_PLATE, bool(plate) and True not in seen and False in seen),
    }
    notes = [
        _size_note(code, contributions.get(name), plate)
        for code, (name, is_assumed) in assumed.items()
        if is_assumed
    ]
    slowest = min(drops, key=_effective_rate)
    if config.filter is None and _effective_rate(slowest) < slowest.sample_rate:
        bandwidth = slowest.contact.noise_bandwidth
        notes.append(Note("noise_ends", value=bandwidth, unit="Hz", effect=0.0))
    if limit is not None and limit < ASSUMED_FLAT:
        notes.append(Note("plate_not_flat", value=limit, low=ASSUMED_FLAT, unit="Hz"))
    if plate is not None and not {True, False} & {*seen}:
        changes = PulseSpectra(drops).level_change(lambda f: np.abs(plate.response(f)))
        change = float(np.nanmax(np.abs(changes)))
        others = {"frequency": plate.f0}
        if change > MIN_WARNED:
            notes.append(
                Note("plate_unclear", value=change, unit="dB", effect=change, others=others)
            )
    return notes


def _size_note(code: str, uncertainty: NDArray[np.float64] | None, plate: Plate | None) -> Note:
    """Return a note with the largest half-width of a contribution, dB, shape (n_octave,)."""
    half_widths = np.zeros(1) if uncertainty is None else RECTANGULAR * uncertainty
    band = int(np.nanargmax(half_widths))
    others = {
        "band": float(get_bands("octave").nominal[band]),
        "percent": 100 * TOLERANCE,
        "frequency": plate.f0 if plate else ASSUMED_FLAT,
    }
    return Note(code, value=float(half_widths[band]), unit="dB", effect=0.0, others=others)


def with_assumptions(drop: Drop, config: Config) -> Drop:
    """Return a drop whose peak has the uncertainty due to instruments that are not stated."""
    variance = drop.peak_force.uncertainty**2
    force, rate = drop.contact.gated, drop.sample_rate
    for gain in (_plate_gain([drop], config), _filter_gain([drop], config)):
        if gain is not None:
            length = next_fast_len(PEAK_PADDING * len(force), real=True)
            factor = gain(np.asarray(np.fft.rfftfreq(length, 1 / rate), dtype=np.float64))
            changed = np.fft.irfft(np.fft.rfft(force, length) * factor, length)[: len(force)]
            change = (
                low_pass(np.pad(changed, 2), rate).max() - low_pass(np.pad(force, 2), rate).max()
            )
            variance += change**2 / 3
    return replace(drop, peak_force=replace(drop.peak_force, uncertainty=math.sqrt(variance)))


class PulseSpectra:
    """Energy spectra of drops, summed for each sample rate."""

    def __init__(self, drops: Sequence[Drop]) -> None:
        self._spectra = []
        for rate in {drop.sample_rate for drop in drops}:
            forces = [drop.contact.gated for drop in drops if drop.sample_rate == rate]
            length = next_fast_len(PADDING * max(map(len, forces)), real=True)
            energy = np.sum([np.abs(np.fft.rfft(force, length)) ** 2 for force in forces], axis=0)
            frequency = np.asarray(np.fft.rfftfreq(length, 1 / rate), dtype=np.float64)
            self._spectra.append((frequency, energy / (rate * length)))

    def level_change(self, gain: Gain, bands: BandSet = "octave") -> NDArray[np.float64]:
        """Return the change of the mean level by a gain of the force, dB, shape (n_band,)."""
        edges = get_bands(bands)
        before, after = np.zeros((2, len(edges.nominal)))
        for frequency, energy in self._spectra:
            first, stop = np.searchsorted(frequency, [edges.lower, edges.upper])
            for sums, energies in ((before, energy), (after, energy * gain(frequency) ** 2)):
                below = np.concatenate([[0.0], np.cumsum(energies)])
                sums += below[stop] - below[first]  # noqa: PLW2901 - in place
        with np.errstate(invalid="ignore"):  # a band above half the rate
            return np.asarray(10 * np.log10(after / before))


def _flat_limit(config: Config) -> float | None:
    return None if config.plate is None else config.plate.flat_limit


def _plate_gain(drops: Sequence[Drop], config: Config) -> Gain | None:
    """Return the gain of the resonance that the levels may hold or lack; None if there is none."""
    plate = config.resonance
    if plate is not None:
        seen = [drop.plate_recorded for drop in drops]
        is_doubtful = False in seen and True not in seen
    else:
        is_doubtful = True
        ringing = [drop.ringing for drop in drops if drop.ringing]
        if ringing:
            plate = Plate(*np.median([[r.frequency, r.quality] for r in ringing], axis=0))
        else:
            # A mass on a spring that is TOLERANCE off at this frequency.
            limit = _flat_limit(config) or ASSUMED_FLAT
            plate = Plate(limit * math.sqrt(1 + 1 / TOLERANCE), 100.0)
    resonance = plate
    return (lambda f: np.abs(resonance.response(f))) if is_doubtful else None


def _share_gain(config: Config) -> Gain | None:
    """Return the gain of a resonance with a smaller share; None if it is stated, or no resonance.

    A force that was corrected for the whole share is multiplied by it.
    """
    plate = config.resonance
    if plate is None or plate.share is not None:
        return None
    smaller = replace(plate, share=MIN_SHARE)
    return lambda f: np.abs(plate.response(f) / smaller.response(f))


def _effective_rate(drop: Drop) -> float:
    """Return the sample rate, Hz, or the one that the noise of the background would have."""
    bandwidth = drop.contact.noise_bandwidth
    return min(drop.sample_rate, 4 * CUTOFF_RATIO * bandwidth)


def _filter_gain(drops: Sequence[Drop], config: Config) -> Gain | None:
    """Return the gain of the filter that is assumed if none is stated."""
    if config.filter is not None:
        return None
    assumed = assumed_filter(min(map(_effective_rate, drops)))
    return lambda f: np.abs(assumed.response(f))
