"""Uncertainty of the force by plate and recorder filter, and their effects on levels and peak.

What is stated is corrected, and its uncertainty contributes to the levels. What is not stated may
change them by any amount between nothing and an assumed response, a rectangular distribution.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from thud.base.note import Note
from thud.level.estimate import RECTANGULAR
from thud.level.levels import get_bands, low_pass
from thud.recordings.response import Plate, RecorderFilter, filtered

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.recordings.config import Config
    from thud.recordings.measured_drop import Drop
    from thud.recordings.response import Gain

# Requirements of the standard on a force plate: a flat response between these frequencies, Hz, and
# linearity within this relative tolerance, which is used for flatness too.
FLAT = (0.2, 1000.0)
TOLERANCE = 0.02
# If no filter is stated, it is assumed to be at worst a Bessel filter of this order whose cutoff is
# this fraction of the sample rate.
ASSUMED_ORDER = 4
ASSUMED_CUTOFF = 0.25
# Change of a level per relative change of a force, dB.
AMPLITUDE_DECIBEL = 20 / math.log(10)
# Effect on an octave above which a correction that the record does not confirm is a warning, dB.
MIN_WARNED = 0.1
# Length of the spectrum of a pulse, in lengths of the pulse: the lowest band holds three lines.
PADDING = 16
# Contributions to the uncertainty; those of instruments that are not stated are half the width of
# a rectangular distribution.
CALIBRATION = "calibration"
ASSUMED_PLATE, ASSUMED_SHARE, ASSUMED_FILTER = ASSUMED = (
    "plate, assumed",
    "share of the plate's resonance, assumed",
    "recorder filter, assumed",
)
# Share of a resonance in the static response that may be instead of the whole, if it is not stated.
MIN_SHARE = 0.5


class Effect(NamedTuple):
    """How the recorded force may differ from the applied one by an instrument.

    Attributes are the contribution to the uncertainty, the gain, a function of frequencies in Hz,
    and the code of the warning if the instrument is assumed.
    """

    name: str
    gain: Gain
    code: str = ""


def find_effects(drops: Sequence[Drop], config: Config) -> list[Effect]:
    """Return how the recorded force in drops may differ from the applied one."""
    plate, recorder = config.resonance, config.recorder_filter
    effects = []
    if plate and plate.f0_uncertainty:
        higher = replace(plate, f0=plate.f0 * (1 + plate.f0_uncertainty))
        effects.append(Effect("plate", lambda f: higher.response(f) / plate.response(f)))
    if recorder and recorder.cutoff_uncertainty:
        shifted = replace(recorder, cutoff=recorder.cutoff * (1 + recorder.cutoff_uncertainty))
        gain: Gain = lambda f: shifted.response(f) / recorder.response(f)  # noqa: E731
        effects.append(Effect("recorder filter", gain))
    seen = {drop.plate_recorded for drop in drops}
    if plate is None:
        ringing = [(drop.ringing.frequency, drop.ringing.quality) for drop in drops if drop.ringing]
        limit = config.plate.flat_limit if config.plate else None
        # Else a mass on a spring that is TOLERANCE off at the limit of its flat response.
        worst = ((limit or FLAT[1]) * math.sqrt(1 + 1 / TOLERANCE), 100.0)
        code = "plate_estimated" if ringing else "" if limit else "plate_assumed"
        assumed = Plate(*np.median(ringing or [worst], axis=0))
        effects.append(Effect(ASSUMED_PLATE, lambda f: 1 / assumed.response(f), code))
    elif False in seen and True not in seen:
        effects.append(Effect(ASSUMED_PLATE, plate.response, "plate_not_recorded"))
    if plate and plate.share is None:
        # A force that was corrected for the whole share is multiplied by it.
        smaller = replace(plate, share=MIN_SHARE)
        gain = lambda f: plate.response(f) / smaller.response(f)  # noqa: E731
        effects.append(Effect(ASSUMED_SHARE, gain, "share_assumed"))
    if config.filter is None:
        cutoff = ASSUMED_CUTOFF * min(drop.effective_rate for drop in drops)
        gain = RecorderFilter("bessel", ASSUMED_ORDER, cutoff).response
        effects.append(Effect(ASSUMED_FILTER, gain, "filter_assumed"))
    return effects


def instrument_uncertainties(
    drops: Sequence[Drop], config: Config, calibration: float | None, bands: BandSet = "octave"
) -> dict[str, NDArray[np.float64]]:
    """Return the standard uncertainties of the levels by the instruments, dB, shape (n_band,).

    They are by their names; `calibration` is the relative standard uncertainty of the force.
    """
    gains = {effect.name: effect.gain for effect in find_effects(drops, config)}
    changes = mean_level_changes(drops, gains, bands)
    stated = np.full(len(get_bands(bands).nominal), AMPLITUDE_DECIBEL * (calibration or 0.0))
    return {CALIBRATION: stated} | {
        name: np.abs(change) / (RECTANGULAR if name in ASSUMED else 1.0)
        for name, change in changes.items()
    }


def mean_level_changes(
    drops: Sequence[Drop], gains: Mapping[str, Gain], bands: BandSet = "octave"
) -> dict[str, NDArray[np.float64]]:
    """Return the changes of the mean level of drops by gains of the force, dB, shape (n_band,)."""
    from scipy.fft import next_fast_len

    edges = get_bands(bands)
    before = np.zeros(len(edges.nominal))
    after = {name: before.copy() for name in gains}
    contacts = [drop.contact for drop in drops]
    for rate in {contact.sample_rate for contact in contacts}:
        forces = [contact.gated for contact in contacts if contact.sample_rate == rate]
        length = next_fast_len(PADDING * max(map(len, forces)), real=True)
        energy = np.sum([np.abs(np.fft.rfft(force, length)) ** 2 for force in forces], axis=0)
        energy /= rate * length
        frequency = np.asarray(np.fft.rfftfreq(length, 1 / rate), dtype=np.float64)
        first, stop = np.searchsorted(frequency, [edges.lower, edges.upper])
        below = np.append(0.0, np.cumsum(energy))
        before += below[stop] - below[first]
        for name, gain in gains.items():
            below = np.append(0.0, np.cumsum(energy * np.abs(gain(frequency)) ** 2))
            after[name] += below[stop] - below[first]
    with np.errstate(invalid="ignore"):  # a band above half the rate
        return {name: 10 * np.log10(values / before) for name, values in after.items()}


def peak_uncertainty(drop: Drop, config: Config) -> float:
    """Return the standard uncertainty of a peak by instruments that are not stated, N."""
    rate, force = drop.contact.sample_rate, np.pad(drop.contact.gated, 2)
    peaks = [
        low_pass(filtered(force, rate, gain, len(force)), rate).max()
        for name, gain, _ in find_effects([drop], config)
        if name in ASSUMED
    ]
    return math.hypot(*(np.array(peaks) - low_pass(force, rate).max())) / RECTANGULAR


def check_instruments(
    drops: Sequence[Drop], config: Config, uncertainties: Mapping[str, NDArray[np.float64]]
) -> list[Note]:
    """Return a warning for each assumption on the instruments that matters.

    `uncertainties` are those of `instrument_uncertainties` in octaves.
    """
    plate, nominal = config.resonance, get_bands("octave").nominal
    notes = []
    for name, _, code in find_effects(drops, config):
        if code:
            half_widths = RECTANGULAR * uncertainties[name]
            band = int(np.nanargmax(half_widths))
            others = {
                "band": float(nominal[band]),
                "percent": 100 * TOLERANCE,
                "frequency": plate.f0 if plate else FLAT[1],
            }
            notes.append(Note(code, value=float(half_widths[band]), unit="dB", others=others))
    rate, nominal_rate = min((drop.effective_rate, drop.contact.sample_rate) for drop in drops)
    if config.filter is None and rate < nominal_rate:
        notes.append(Note("noise_ends", value=rate / 4, unit="Hz"))
    limit = config.plate.flat_limit if config.plate else None
    if limit is not None and limit < FLAT[1]:
        notes.append(Note("plate_not_flat", value=limit, low=FLAT[1], unit="Hz"))
    if plate and {drop.plate_recorded for drop in drops} == {None}:
        change = np.nanmax(np.abs(mean_level_changes(drops, {"": plate.response})[""]))
        if change > MIN_WARNED:
            others = {"frequency": plate.f0}
            notes.append(Note("plate_unclear", value=float(change), unit="dB", others=others))
    return notes
