"""Force plate and recorder filter: their responses, requirements on them, effects on levels.

What is stated is corrected, and its uncertainty contributes to the levels. What is not stated may
change them by any amount between nothing and an assumed response, a rectangular distribution.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from thud.base.note import Note
from thud.level.estimate import NORMAL_FACTOR, RECTANGULAR, Contribution
from thud.level.levels import get_bands, low_pass
from thud.recordings.response import Plate, RecorderFilter

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.level.estimate import Estimate
    from thud.recordings.config import Config
    from thud.recordings.measured_drop import Drop

    Gain = Callable[[NDArray[np.float64]], NDArray[np.complex128]]

# Requirements of the standard on a force plate: a flat response between these frequencies, Hz, and
# up to this force, N, and linearity within this relative tolerance, which is used for flatness too.
FLAT = (0.2, 1000.0)
RANGE = 5000.0
TOLERANCE = 0.02
# If no filter is stated, it is assumed to be at worst a Bessel filter of this order whose cutoff is
# this fraction of the sample rate.
ASSUMED_ORDER = 4
ASSUMED_CUTOFF = 0.25
# Change of a level per relative change of a force, dB.
AMPLITUDE_DECIBEL = 20 / math.log(10)
# Effect on an octave above which a correction that the record does not confirm is a warning, dB.
MIN_WARNED = 0.1
# Cutoff of a filter over the equivalent bandwidth of its noise: 0.89 of a mean, 0.96 of a Bessel
# filter of order 4. White noise up to half the rate has more than a quarter of the rate.
CUTOFF_RATIO = 0.9
# Length of the spectrum of a pulse, in lengths of the pulse: the lowest band holds three lines.
PADDING = 16
# Contributions of instruments that are not stated: rectangular distributions.
ASSUMED_PLATE, ASSUMED_SHARE, ASSUMED_FILTER = ASSUMED = (
    "plate, assumed",
    "share of the plate's resonance, assumed",
    "recorder filter, assumed",
)
# Share of a resonance in the static response that may be instead of the whole, if it is not stated.
MIN_SHARE = 0.5


@dataclass(frozen=True)
class PlateCheck:
    """A requirement on the force plate, whether it is met (None if unknown), and a note on it.

    Requirements: ``"flat above"`` (0.2 Hz), ``"flat below"`` (1000 Hz), ``"range"``, ``"linear"``.
    """

    requirement: str
    met: bool | None
    note: Note


def check_plate(plate: Plate | None) -> tuple[PlateCheck, ...]:
    """Check a plate by the standard: flat from 0.2 to 1000 Hz, 0 to 5000 N, linear within 2 %.

    The resonance of the plate is corrected. Without a plate there are no checks.
    """
    if plate is None:
        return ()
    low, high = FLAT
    checks = (
        ("flat above", _check_low, f"response at {low:g} Hz", "time_constant"),
        ("flat below", _check_high, f"response up to {high:g} Hz", "f0, f0_uncertainty"),
        ("range", _check_range, "measuring range", "full_scale"),
        ("linear", _check_linearity, "linearity", "linearity"),
    )
    result = []
    for requirement, check, what, keys in checks:
        met, note = None, _plate_note("plate_unknown", math.nan, {"what": what, "keys": keys})
        if getattr(plate, keys.split(", ")[-1]):
            met, note = check(plate)
        result.append(PlateCheck(requirement, met, note))
    return tuple(result)


def _plate_note(
    code: str, value: float, others: Mapping[str, float | str], unit: str = "%"
) -> Note:
    return Note(code, "force plate", float(value), unit=unit, others=others)


def _check_low(plate: Plate) -> tuple[bool, Note]:
    """Check the lowest frequency of a first-order high-pass."""
    low, time_constant = FLAT[0], plate.time_constant or math.nan
    loss = 1 - 1 / math.hypot(1, 1 / (2 * math.pi * low * time_constant))
    needed = 1 / (2 * math.pi * low * math.sqrt((1 - TOLERANCE) ** -2 - 1))
    others = {"frequency": low, "time_constant": time_constant, "needed": needed}
    return loss <= TOLERANCE, _plate_note("plate_low", 100 * loss, others)


def _check_high(plate: Plate) -> tuple[bool, Note]:
    """Check the highest frequency by the deviation that remains after the correction."""
    high = FLAT[1]
    frequency = np.linspace(0.0, high, 1001, dtype=np.float64)
    response = np.abs(plate.response(frequency))
    # Expanded uncertainty of the resonance, in both directions.
    shift = NORMAL_FACTOR * (plate.f0_uncertainty or 0.0)
    ratios = [np.abs(plate.response(frequency / (1 + sign * shift))) / response for sign in (-1, 1)]
    deviation = max(float(np.abs(ratio - 1).max()) for ratio in ratios)
    others = {"frequency": high, "f0": plate.f0, "shift": 100 * shift}
    return deviation <= TOLERANCE, _plate_note("plate_high", 100 * deviation, others)


def _check_range(plate: Plate) -> tuple[bool, Note]:
    full_scale = plate.full_scale or math.nan
    return full_scale >= RANGE, _plate_note("plate_range", full_scale, {"required": RANGE}, "N")


def _check_linearity(plate: Plate) -> tuple[bool | None, Note]:
    """Check the linearity by the relative deviation from the best line through zero."""
    applied, indicated = np.array(plate.linearity).T
    # Relative deviations give small forces as much weight as large ones.
    slope = float(np.mean(indicated / applied))
    deviations = np.abs(indicated / (slope * applied) - 1)
    worst = int(np.argmax(deviations))
    forces = {"first": applied.min(), "last": applied.max(), "worst": applied[worst]}
    met = bool(deviations[worst] <= TOLERANCE)
    is_known = not met or applied.max() >= RANGE
    return met if is_known else None, _plate_note("plate_linear", 100 * deviations[worst], forces)


def instrument_contributions(
    drops: Sequence[Drop], config: Config, calibration: float | None, bands: BandSet = "octave"
) -> list[list[Contribution]]:
    """Return the contributions of the instruments to the uncertainty of levels, dB, by band.

    `calibration` is the relative standard uncertainty of the force.
    """
    size, divisor = {"calibration": calibration or 0.0}, dict.fromkeys(ASSUMED, RECTANGULAR)
    count = len(get_bands(bands).nominal)
    changes = {"calibration": np.full(count, AMPLITUDE_DECIBEL * size["calibration"])}
    changes |= mean_level_changes(drops, _gains(drops, config), bands)
    return [
        [
            Contribution(
                name, abs(float(values[band])) / divisor.get(name, 1.0),
                size=size.get(name, math.nan), divisor=divisor.get(name, 1.0),
            )
            for name, values in changes.items()
            if values.any()
        ]
        for band in range(count)
    ]  # fmt: skip


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


def with_assumptions(drop: Drop, config: Config) -> Drop:
    """Return a drop whose peak has the uncertainty due to instruments that are not stated."""
    from scipy.fft import next_fast_len

    rate, force = drop.sample_rate, np.pad(drop.contact.gated, 2)
    length = next_fast_len(2 * len(force), real=True)
    spectrum = np.fft.rfft(force, length)
    frequency = np.asarray(np.fft.rfftfreq(length, 1 / rate), dtype=np.float64)
    peaks = [
        low_pass(np.fft.irfft(spectrum * gain(frequency), length)[: len(force)], rate).max()
        for name, gain in _gains([drop], config).items()
        if name in ASSUMED
    ]
    change = math.hypot(*(np.array(peaks) - low_pass(force, rate).max()))
    return replace(drop, peak_force=drop.peak_force.widened(change / RECTANGULAR))


def _gains(drops: Sequence[Drop], config: Config) -> dict[str, Gain]:
    """Return the gains by which the force in drops may differ from the applied one, by name."""
    plate, recorder = config.resonance, config.recorder_filter
    seen = {drop.plate_recorded for drop in drops}
    gains: dict[str, Gain] = {}
    if plate:
        higher = replace(plate, f0=plate.f0 * (1 + (plate.f0_uncertainty or 0.0)))
        gains["plate"] = lambda f: higher.response(f) / plate.response(f)
    if recorder:
        cutoff = recorder.cutoff * (1 + (recorder.cutoff_uncertainty or 0.0))
        shifted = replace(recorder, cutoff=cutoff)
        gains["recorder filter"] = lambda f: shifted.response(f) / recorder.response(f)
    if plate is None:
        ringing = [(drop.ringing.frequency, drop.ringing.quality) for drop in drops if drop.ringing]
        # Else a mass on a spring that is TOLERANCE off at the limit of its flat response.
        flat = (config.plate and config.plate.flat_limit) or FLAT[1]
        worst = [(flat * math.sqrt(1 + 1 / TOLERANCE), 100.0)]
        gains[ASSUMED_PLATE] = Plate(*np.median(ringing or worst, axis=0)).response
    elif False in seen and True not in seen:
        gains[ASSUMED_PLATE] = plate.response
    if plate and plate.share is None:
        # A force that was corrected for the whole share is multiplied by it.
        smaller = replace(plate, share=MIN_SHARE)
        gains[ASSUMED_SHARE] = lambda f: plate.response(f) / smaller.response(f)
    if config.filter is None:
        cutoff = ASSUMED_CUTOFF * min(map(_effective_rate, drops))
        gains[ASSUMED_FILTER] = RecorderFilter("bessel", ASSUMED_ORDER, cutoff).response
    return gains


def _effective_rate(drop: Drop) -> float:
    """Return the sample rate, Hz, or the one that the noise of the background would have."""
    return min(drop.sample_rate, 4 * CUTOFF_RATIO * drop.contact.noise_bandwidth)


def check_assumptions(
    drops: Sequence[Drop], config: Config, octaves: Sequence[Estimate]
) -> list[Note]:
    """Return a warning for each assumption on the instruments that matters.

    `octaves` are the octave levels of the drops with their budgets.
    """
    plate, limit = config.resonance, config.plate.flat_limit if config.plate else None
    seen = {drop.plate_recorded for drop in drops}
    rings = any(drop.ringing for drop in drops)
    assumed = {
        "plate_estimated": (ASSUMED_PLATE, plate is None and rings),
        "plate_assumed": (ASSUMED_PLATE, plate is None and limit is None and not rings),
        "share_assumed": (ASSUMED_SHARE, plate is not None and plate.share is None),
        "filter_assumed": (ASSUMED_FILTER, config.filter is None),
        "plate_not_recorded": (ASSUMED_PLATE, bool(plate) and True not in seen and False in seen),
    }
    notes = []
    for code, (name, is_assumed) in assumed.items():
        if is_assumed:
            # Half widths of the contribution, dB, shape (n_octave,).
            sizes = np.array([
                sum(part.uncertainty for part in level.contributions if part.name == name)
                for level in octaves
            ]) * RECTANGULAR  # fmt: skip
            band = int(np.nanargmax(sizes))
            others = {
                "band": float(get_bands("octave").nominal[band]),
                "percent": 100 * TOLERANCE,
                "frequency": plate.f0 if plate else FLAT[1],
            }
            notes.append(Note(code, value=float(sizes[band]), unit="dB", others=others))
    slowest = min(drops, key=_effective_rate)
    if config.filter is None and _effective_rate(slowest) < slowest.sample_rate:
        bandwidth = _effective_rate(slowest) / (4 * CUTOFF_RATIO)
        notes.append(Note("noise_ends", value=bandwidth, unit="Hz"))
    if limit is not None and limit < FLAT[1]:
        notes.append(Note("plate_not_flat", value=limit, low=FLAT[1], unit="Hz"))
    if plate is not None and seen == {None}:
        changes = mean_level_changes(drops, {"plate": plate.response})["plate"]
        change, others = float(np.nanmax(np.abs(changes))), {"frequency": plate.f0}
        if change > MIN_WARNED:
            notes.append(Note("plate_unclear", value=change, unit="dB", others=others))
    return notes
