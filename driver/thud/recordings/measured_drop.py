"""Contact time, restitution, peak, impulse and noise of a drop, with their uncertainties.

Derivations: docs/recordings_theory.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import resample

from thud.base.checks import refuse
from thud.base.immutable import Immutable
from thud.base.note import Note
from thud.level.estimate import Estimate
from thud.level.levels import RECORDED_BAND, low_pass
from thud.recordings.background import find_offset_step, remove_background, step_errors
from thud.recordings.contact import Contact, find_contact
from thud.recordings.faults import check_jumps, min_background, repair
from thud.recordings.flanks import SAMPLE_ERROR
from thud.recordings.noise import Noise
from thud.recordings.recorded_levels import measure_levels
from thud.recordings.restitution import BOUNCES, GRAVITY, DropConditions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.recordings.drops import Window
    from thud.recordings.response import Chain
    from thud.recordings.ringing import Ringing

# Number of draws of noise for its effect on the maximum.
PEAK_DRAWS = 32
# The length of this noise in samples is a multiple of this one.
NOISE_LENGTH = 1024
# Minimum rate of the force in which the peak is searched, Hz, and length of zeros on either side of
# the contact for the interpolation to it, s. At this rate a peak of a 500 Hz ripple is 0.05 % of
# the ripple too low at most.
PEAK_RATE = 50_000.0
PEAK_MARGIN = 2e-3
# Length of the background below which a warning is raised, s.
SHORT_BACKGROUND = 0.005
# Edges of the octave of 500 Hz, Hz.
OCTAVE_500 = (354.8, 707.9)
# Fraction of the rate above which content indicates aliasing, and error above which a warning is
# raised, dB.
ALIASED_FRACTION = 0.4
MAX_ALIASING_ERROR = 0.1
# Minimum ratio of contact time and its uncertainty.
MIN_CONTACT_RATIO = 4.0
# Maximum factor between the restitution by flight and the ratio of the peaks. Beyond it a pulse is
# no bounce, because the force follows the velocity.
MAX_BOUNCE_RATIO = 3.0
# Deviation of the offset by quantization, as a fraction of the peak, that raises a warning.
MAX_OFFSET = 5e-4
# Quantities of `QUANTITIES` that are estimated for each drop.
ESTIMATES = ("contact_time", "restitution", "peak_force", "impulse", "effective_mass")


@dataclass(frozen=True, eq=False)
class Drop(Immutable):
    """One measured drop.

    Attributes
    ----------
    name : str
        Name of the drop, as ``"file.wav, drop 3"``.
    begin : float
        Time of the first sample, s; zero is the first touch.
    force : ndarray, shape (n,)
        Force without offset, drift, hum and slow noise, N.
    sample_rate : float
        Samples per second, Hz.
    onset : float
        Time of first touch in the file, s.
    gate : tuple of int
        First and stop index of the contact with its margins: the samples whose levels are measured.
    contact_time, restitution, peak_force, impulse, effective_mass : Estimate
        Units: s (`thud.impact.contact_time`), 1, N (below 1.25 kHz), N s and kg. NaN if unknown.
    shared_effects : dict of str to float
        Change of the restitution by one standard uncertainty of calibration, mass, drop height and
        quantized background, which all drops share and the uncertainty of the restitution excludes.
    restitution_method : str
        ``"impulse"``, ``"bounces"``, ``"impulse and bounces"`` or ``""``.
    restitutions : dict of str to Estimate
        Restitution by each method.
    noise : Noise
        Noise estimated from the background.
    bounces : tuple of float
        Times at which the measured bounces begin, s since first touch: one bounce if the drop
        height is known, else up to two.
    notes : tuple of Note
        Processing of the signal, and possible faults.
    contact : Contact
        Times, background and gate of the contact.
    offset_step : float
        Change of the offset during the contact, N; zero if there is none.
    ringing : Ringing or None
        Ringing of the plate after the contact.
    plate_recorded : bool or None
        Whether the resonance of the stated plate is in the record; None if unclear, or none is
        stated.
    """

    name: str
    begin: float
    force: NDArray[np.float64]
    sample_rate: float
    onset: float
    gate: tuple[int, int]
    contact_time: Estimate
    restitution: Estimate
    shared_effects: dict[str, float]
    restitution_method: str
    restitutions: dict[str, Estimate]
    peak_force: Estimate
    impulse: Estimate
    effective_mass: Estimate
    noise: Noise
    bounces: tuple[float, ...]
    notes: tuple[Note, ...]
    contact: Contact
    offset_step: float = 0.0
    ringing: Ringing | None = None
    plate_recorded: bool | None = None

    @property
    def time(self) -> NDArray[np.float64]:
        """Time since first touch, s, shape (n,)."""
        return np.asarray(self.begin + np.arange(len(self.force)) / self.sample_rate)

    def levels(self, bands: BandSet = "octave", method: str = "exact") -> NDArray[np.float64]:
        """Return the force exposure levels, corrected for the background, dB, shape (n_band,).

        The arguments are those of `thud.recordings.recorded_levels.measure_levels`, which has their
        uncertainties too.
        """
        return measure_levels([self], bands, method)[0].level.copy()


def measure_drop(window: Window, conditions: DropConditions) -> Drop:
    """Measure one drop in the window around it.

    Raise InputError if the pulse is clipped, cut off or doubled, or has long dropouts.
    """
    force, faults = repair(window)
    notes, rate = [*window.notes, *faults], window.sample_rate
    try:
        quiet, removed, background = remove_background(
            force, rate, window.contact, window.quantization
        )
        contact = find_contact(quiet, removed, background, rate, window.contact, window.chain)
    except np.linalg.LinAlgError as error:
        refuse(
            f"{window.name}: the background is not noise",
            "a background of noise, drift and hum",
            error,
        )
    for side, length in zip(("before", "after"), contact.background_lengths, strict=True):
        if length < SHORT_BACKGROUND:
            note = Note("short_background", unit="ms", others={"side": side})
            notes.append(replace(note, value=1e3 * length, low=1e3 * SHORT_BACKGROUND))
    contact_time = _between(contact.begin, contact.end)
    if not contact_time.value > MIN_CONTACT_RATIO * contact_time.uncertainty:
        refuse(
            f"{window.name}: the contact cannot be distinguished from the noise: "
            f"{1e3 * contact_time.value:.3g} ms with a standard uncertainty of "
            f"{1e3 * contact_time.uncertainty:.2g} ms",
            f"an uncertainty up to 1/{MIN_CONTACT_RATIO:g} of it",
        )
    if window.chain is None:
        notes += check_jumps(contact)
    impulse, peak_force = _impulse(contact), _peak(contact)
    offset_step = find_offset_step(background, impulse.value)
    if offset_step:
        notes.append(Note("offset_step", value=offset_step, unit="N", effect=0.0))
        errors = step_errors(offset_step, len(contact.gated))
        error_impulses = errors.sum(axis=1) / contact.sample_rate
        impulse = _with_half_width(impulse, float(np.abs(error_impulses).max()))
        peak_force = _with_half_width(peak_force, float(np.abs(errors).max()))
    # The first flight gives the restitution; without the height two flights are compared.
    landings = _landings(window, contact, 1 if conditions.height else 2)
    if conditions.height and landings:
        flight = _between(contact.release, landings[0][0]).value
        peak = _peak_above_background(window.bounces[0]) / contact.peak
        expected = GRAVITY * flight / (2 * conditions.speed)
        if not peak / MAX_BOUNCE_RATIO < expected < peak * MAX_BOUNCE_RATIO:
            landings = []
            others = {"ratio": peak, "height": conditions.height}
            notes.append(
                Note("no_bounce", value=1e3 * flight, unit="ms", effect=0.0, others=others)
            )
    ends = [contact.release, *(end for _, end in landings)]
    flights = [_between(end, begin) for end, (begin, _) in zip(ends, landings, strict=False)]
    duration = _between(contact.touch, contact.release)
    methods, unknown = conditions.restitutions(impulse, duration, flights)
    notes += (*_check_aliasing(contact, window.chain), *_check_step(window, contact), *unknown)
    restitution, shared = conditions.mean(methods, impulse, contact.quantization_impulse)
    first = contact.span[0]
    return Drop(
        name=window.name,
        begin=first / rate - contact.touch.value,
        force=contact.force,
        sample_rate=rate,
        onset=window.start / rate + contact.touch.value,
        gate=(contact.gate[0] - first, contact.gate[1] - first),
        contact_time=contact_time,
        restitution=restitution,
        shared_effects=shared,
        restitution_method=" and ".join(methods),
        restitutions=methods,
        peak_force=peak_force,
        offset_step=offset_step,
        impulse=impulse,
        effective_mass=conditions.effective_mass(impulse, duration, methods.get(BOUNCES)),
        noise=_noise(contact),
        bounces=tuple(begin.value - contact.touch.value for begin, _ in landings),
        notes=(*contact.notes, *notes),
        contact=contact,
    )


def _between(start: Estimate, end: Estimate) -> Estimate:
    return Estimate(end.value - start.value, math.hypot(end.uncertainty, start.uncertainty))


def _landings(window: Window, drop: Contact, count: int) -> list[tuple[Estimate, Estimate]]:
    """Return first touch and release of each of the first bounces, s from the start."""
    landings = []
    for bounce in window.bounces[:count]:
        first, stop = bounce.contact
        minimum = min_background(bounce.sample_rate)
        if first < minimum or len(bounce.force) - stop < minimum:
            break
        rate = bounce.sample_rate
        quiet, removed, background = remove_background(
            bounce.force, rate, bounce.contact, bounce.quantization, drop.background
        )
        landing = find_contact(quiet, removed, background, rate, bounce.contact, bounce.chain)
        delay = (bounce.start - window.start) / rate
        begin, end = (
            Estimate(delay + edge.value, edge.uncertainty)
            for edge in (landing.touch, landing.release)
        )
        landings.append((begin, end))
    return landings


def _peak_above_background(window: Window) -> float:
    first, stop = window.contact
    force = window.force
    background = np.concatenate([force[:first], force[stop:]])
    return float(force[first:stop].max() - np.median(background))


def _impulse(contact: Contact) -> Estimate:
    """Return the time integral of the force over the gate, N s."""
    ones = np.full((1, len(contact.gated)), 1 / contact.sample_rate)
    variance = contact.covariance_of(ones)[0, 0]
    return Estimate(float((ones @ contact.gated)[0]), math.sqrt(variance))


def _with_half_width(estimate: Estimate, half_width: float) -> Estimate:
    """Return an estimate whose uncertainty includes a rectangular distribution."""
    uncertainty = math.hypot(estimate.uncertainty, half_width / math.sqrt(3))
    return replace(estimate, uncertainty=uncertainty)


def _peak(contact: Contact) -> Estimate:
    """Return the maximum of the force below 1.25 kHz, N, corrected for the bias due to noise.

    The bias is estimated as the increase of the maximum by additional noise of the same density
    (bootstrap). The estimate is too low for strong noise, so it is also a standard uncertainty.
    """
    margin = math.ceil(PEAK_MARGIN * contact.sample_rate)
    force = np.pad(contact.gated, margin)
    low = _interpolated(force, contact.sample_rate)
    index = int(np.argmax(low)) * len(force) // len(low) - margin
    cell = min(max(index, 0), len(contact.gated) - 1) * len(contact.covariance)
    cell //= len(contact.gated)
    density, _ = contact.background.density(RECORDED_BAND)
    deviation = math.sqrt(density * contact.sample_rate / 2)
    # The low-pass is linear: that of noise is added to that of the force.
    size = NOISE_LENGTH * math.ceil(len(force) / NOISE_LENGTH)
    noise = deviation * _unit_noise(size, contact.sample_rate)[:, : len(low)]
    bias = max(float((low + noise).max(axis=1).mean() - low.max()), 0.0)
    variance = density * min(RECORDED_BAND, contact.sample_rate / 2) + bias**2
    variance += (SAMPLE_ERROR * contact.peak) ** 2
    # The top stays within a step for some time: its error is that of the offset again.
    variance += contact.covariance[cell, cell] + 2 * contact.background.quantization.offset**2
    return Estimate(float(low.max()) - bias, math.sqrt(variance))


@lru_cache(maxsize=4)
def _unit_noise(count: int, rate: float) -> NDArray[np.float64]:
    """Return draws of white noise of unit deviation, interpolated like a force of a length."""
    draws = np.random.default_rng(0).normal(size=(PEAK_DRAWS, count))
    return np.array([_interpolated(noise, rate) for noise in draws])


def _interpolated(force: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """Return the force below 1.25 kHz at PEAK_RATE or more: the peak may lie between samples."""
    low = low_pass(force, rate)
    factor = math.ceil(PEAK_RATE / rate)
    return np.asarray(resample(low, factor * len(low))) if factor > 1 else low


def _noise(contact: Contact) -> Noise:
    first, stop = (index - contact.span[0] for index in contact.gate)
    force = np.concatenate([contact.force[:first], contact.force[stop:]])
    deviation = 1.4826 * float(np.median(np.abs(force - np.median(force))))
    white, pink, brown = map(float, contact.background.variances[:3])
    return Noise(deviation, "before and after", white, pink, brown)


def _check_step(window: Window, contact: Contact) -> tuple[Note, ...]:
    """Return a warning if the background of a coarse record lies within a quantization step."""
    step, offset = window.quantization.step, contact.background.quantization.offset
    if offset < MAX_OFFSET * contact.peak:
        return ()
    return (Note("coarse_steps", value=offset, unit="N", others={"step": step}),)


def _check_aliasing(contact: Contact, chain: Chain | None) -> tuple[Note, ...]:
    """Return a warning if content may alias into the octave of 500 Hz.

    This is content above half the rate. The amplitude of a pulse with kinks is assumed to fall as
    1/f**2 there; stated instruments reduce it further.
    """
    rate = contact.sample_rate
    lower, upper = OCTAVE_500
    # Padded to a length with several frequencies in the octave.
    force = np.pad(contact.gated, (0, int(rate / 20) + 3 * len(contact.gated)))
    frequency = np.fft.rfftfreq(len(force), 1 / rate)
    power = np.abs(np.fft.rfft(force)) ** 2
    noise = contact.background.variances[0] * rate / 2 * len(contact.gated)
    octave_power = power[(frequency > lower) & (frequency < upper)].mean()
    top = max(power[frequency > ALIASED_FRACTION * rate].mean() - 3 * noise, 0.0)
    folded = top * (0.45 * rate / (rate - upper)) ** 4
    if chain is not None:
        folded *= abs(chain.response(np.array([rate - upper]))[0]) ** 2
    error = 20 * math.log10(1 + math.sqrt(folded / octave_power))
    if error < MAX_ALIASING_ERROR:
        return ()
    others = {"frequency": rate / 2}
    return (Note("aliasing", value=error, unit="dB", effect=error, others=others),)
