"""Contact time, restitution, peak, impulse and noise of a drop, with their uncertainties.

Derivations: docs/recordings_theory.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import resample

from thud.base.checks import refuse
from thud.base.note import Note
from thud.level.estimate import RECTANGULAR, Estimate
from thud.level.levels import RECORDED_BAND, low_pass
from thud.recordings.background import remove_background
from thud.recordings.checks import CONTACT_CHECKS
from thud.recordings.contact import SAMPLE_ERROR, Contact, find_edge
from thud.recordings.drops import Stage, robust_deviation
from thud.recordings.instruments import peak_uncertainty
from thud.recordings.quantities import BOUNCES, GRAVITY, IMPULSE, MASS, RESTITUTION, measure_rebound
from thud.recordings.recorded_levels import measure_levels
from thud.recordings.ringing import find_ringing, is_in_record

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.recordings.config import Config
    from thud.recordings.drops import Section
    from thud.recordings.ringing import Ringing

# Minimum rate of the force in which the peak is searched, Hz, and length of zeros on either side of
# the contact for the interpolation to it, s. At this rate a peak of a 500 Hz ripple is 0.05 % of
# the ripple too low at most.
PEAK_RATE = 50_000.0
PEAK_MARGIN = 2e-3
# Length of the background below which a warning is raised, s.
SHORT_BACKGROUND = 0.005
# Minimum ratio of contact time and its uncertainty.
MIN_CONTACT_RATIO = 4.0
# Maximum factor between the restitution by flight and the ratio of the peaks. Beyond it a pulse is
# no bounce, because the force follows the velocity.
MAX_BOUNCE_RATIO = 3.0
# Cutoff of a filter over the equivalent bandwidth of its noise: 0.89 of a mean, 0.96 of a Bessel
# filter of order 4. White noise up to half the rate has more than a quarter of the rate.
CUTOFF_RATIO = 0.9
# Quantities of `QUANTITIES` that are estimated for each drop.
ESTIMATES = ("contact_time", "restitution", "peak_force", "impulse", "effective_mass")


@dataclass(frozen=True, eq=False, repr=False)
class Drop(Stage):
    """One measured drop.

    Attributes
    ----------
    name : str
        Name of the drop, as ``"file.wav, drop 3"``.
    onset : float
        Time of first touch in the file, s.
    contact : Contact
        Times, background and gate of the contact.
    contact_time, restitution, peak_force, impulse, effective_mass : Estimate
        Units: s (`thud.impact.contact_time`), 1, N (below 1.25 kHz), N s and kg. NaN if unknown.
    restitutions : dict of str to Estimate
        Restitution by ``"impulse"`` and by ``"bounces"``, as far as they are known.
    shared_effects : dict of dict of float
        Changes of ``"impulse"``, ``"bounces"``, their ``"difference"``, ``"restitution"`` and
        ``"effective_mass"`` by one standard uncertainty of what all drops share, such as
        ``"calibration"``, by its name; the uncertainties above exclude them.
    bounce : float or None
        Time at which the first bounce begins, s since first touch; None if it is not recorded.
    notes : tuple of Note
        Processing of the signal, and possible faults.
    ringing : Ringing or None
        Ringing of the plate after the contact.
    plate_recorded : bool or None
        Whether the resonance of the stated plate is in the record; None if unclear, or none is
        stated.
    """

    name: str
    onset: float
    contact: Contact
    contact_time: Estimate
    restitution: Estimate
    peak_force: Estimate
    impulse: Estimate
    effective_mass: Estimate
    restitutions: dict[str, Estimate] = field(default_factory=dict)
    shared_effects: dict[str, dict[str, float]] = field(default_factory=dict)
    bounce: float | None = None
    notes: tuple[Note, ...] = ()
    ringing: Ringing | None = None
    plate_recorded: bool | None = None

    @property
    def force(self) -> NDArray[np.float64]:
        """Force without offset, drift, hum and slow noise, N, shape (n,)."""
        return self.contact.force

    @property
    def sample_rate(self) -> float:
        """Samples per second, Hz."""
        return self.contact.sample_rate

    @property
    def begin(self) -> float:
        """Time of the first sample, s; zero is the first touch."""
        return -self.contact.touch.value

    @property
    def time(self) -> NDArray[np.float64]:
        """Time since first touch, s, shape (n,)."""
        return np.asarray(self.begin + np.arange(len(self.force)) / self.sample_rate)

    @property
    def gate(self) -> tuple[int, int]:
        """First and stop index of the contact with its margins, whose levels are measured."""
        return self.contact.gate

    @cached_property
    def noise(self) -> float:
        """Standard deviation of the noise of a sample, N; NaN without samples beside the gate."""
        force = np.delete(self.force, slice(*self.gate))
        return robust_deviation(force - np.median(force)) if force.size else math.nan

    @property
    def effective_rate(self) -> float:
        """Sample rate, Hz, or the lower one that the noise of the background would have."""
        return min(self.contact.sample_rate, 4 * CUTOFF_RATIO * self.contact.noise_bandwidth)

    def levels(self, bands: BandSet = "octave") -> NDArray[np.float64]:
        """Return the force exposure levels, corrected for the background, dB, shape (n_band,).

        Their uncertainties are in `thud.recordings.recorded_levels.measure_levels`.
        """
        return np.array(measure_levels([self], bands).level[0])


def measure_drop(
    section: Section,
    contact: Contact,
    config: Config,
    calibration: float | None = None,
    recorded: Section | None = None,
) -> Drop:
    """Return contact time, peak, impulse, restitution and effective mass of a drop.

    `section` is that of the contact, with its bounces, and `recorded` the same before the
    correction of the instruments, which shows whether the resonance of a stated plate is in it.
    `calibration` is the relative standard uncertainty of the force. Raise InputError if the contact
    cannot be distinguished from the noise.
    """
    contact_time = contact.end - contact.begin
    if not contact_time.value > MIN_CONTACT_RATIO * contact_time.uncertainty:
        refuse(
            f"{section.name}: the contact cannot be distinguished from the noise: "
            f"{1e3 * contact_time.value:.3g} ms with a standard uncertainty of "
            f"{1e3 * contact_time.uncertainty:.2g} ms",
            f"an uncertainty up to 1/{MIN_CONTACT_RATIO:g} of it",
        )
    offset = float(contact.removed[slice(*contact.gate)].mean())
    notes = [*section.notes, *contact.background.notes]
    notes.append(Note("offset_removed", value=offset, unit="N"))
    begin, end = contact.background.ends
    lengths = {"before": begin, "after": len(section.force) / section.sample_rate - end}
    notes += (
        Note("short_background", value=1e3 * length, low=1e3 * SHORT_BACKGROUND, unit="ms",
             others={"side": side})
        for side, length in lengths.items()
        if length < SHORT_BACKGROUND
    )  # fmt: skip
    ones = np.full((1, len(contact.gated)), 1 / contact.sample_rate)
    variance = contact.covariance_of(ones)[0, 0]
    impulse = Estimate(float((ones @ contact.gated)[0]), math.sqrt(variance))
    peak_force = _peak(contact)
    landing = _first_landing(section, contact)
    if landing and config.height:
        # The force of a bounce follows its velocity, and so does the flight before it.
        flight, bounce = landing - contact.release, section.bounces[0]
        ratio = float(bounce.force[slice(*bounce.contact)].max()) - bounce.offset
        ratio /= contact.background.peak
        expected = GRAVITY * flight.value / (2 * math.sqrt(2 * GRAVITY * config.height))
        if not ratio / MAX_BOUNCE_RATIO < expected < ratio * MAX_BOUNCE_RATIO:
            others = {"ratio": ratio, "height": config.height}
            notes.append(Note("no_bounce", value=1e3 * flight.value, unit="ms", others=others))
            landing = None
    estimates, shared = measure_rebound(
        impulse, contact.release - contact.touch, landing - contact.release if landing else None,
        config, calibration, contact.background.quantization.offset * contact_time.value,
    )  # fmt: skip
    notes += (note for check in CONTACT_CHECKS for note in check(section, contact))
    ringing, plate = find_ringing(contact, section.chain), config.resonance
    if ringing:
        code = "plate_rings_differently" if section.chain else "plate_rings"
        others = {"frequency": ringing.frequency, "quality": ringing.quality}
        notes.append(Note(code, value=ringing.amplitude, unit="N", others=others))
        if not section.chain:
            # A resonance spreads an edge over a quarter of its period.
            contact_time = contact_time.widened(0.25 / ringing.frequency / RECTANGULAR)
    onset = (section.start + contact.start) / section.sample_rate + contact.touch.value
    restitutions = {
        name: estimates[name] for name in (IMPULSE, BOUNCES) if math.isfinite(estimates[name].value)
    }
    drop = Drop(
        section.name, onset, contact,
        contact_time=contact_time,
        restitution=estimates[RESTITUTION],
        peak_force=peak_force,
        impulse=impulse,
        effective_mass=estimates[MASS],
        restitutions=restitutions,
        shared_effects=shared,
        bounce=landing.value - contact.touch.value if landing else None,
        notes=tuple(replace(note, subject=note.subject or section.name) for note in notes),
        ringing=ringing,
        plate_recorded=is_in_record(recorded, contact, plate) if recorded and plate else None,
    )  # fmt: skip
    return replace(drop, peak_force=peak_force.widened(peak_uncertainty(drop, config)))


def _first_landing(section: Section, contact: Contact) -> Estimate | None:
    """Return the first touch of the first bounce, in the time of a contact, s; None if unknown."""
    if not section.bounces or not section.bounces[0].has_background:
        return None
    bounce = section.bounces[0]
    force, background = remove_background(bounce, contact.background)
    touch = find_edge(bounce, force, background, side=1)[0]
    delay = (bounce.start - section.start - contact.start) / section.sample_rate
    return replace(touch, value=delay + touch.value)


def _peak(contact: Contact) -> Estimate:
    """Return the maximum of the force below 1.25 kHz, N.

    Noise increases a maximum by about its standard deviation, which is subtracted; the uncertainty
    has it twice.
    """
    rate, margin = contact.sample_rate, math.ceil(PEAK_MARGIN * contact.sample_rate)
    low = low_pass(np.pad(contact.gated, margin), rate)
    # The peak may lie between samples.
    factor = math.ceil(PEAK_RATE / rate)
    low = resample(low, factor * len(low)) if factor > 1 else low
    index = int(np.clip(np.argmax(low) // factor - margin, 0, len(contact.gated) - 1))
    cell = index * len(contact.covariance) // len(contact.gated)
    density = float(contact.background.density(RECORDED_BAND))
    noise = math.sqrt(density * min(RECORDED_BAND, rate / 2))
    variance = 2 * noise**2 + (SAMPLE_ERROR * contact.background.peak) ** 2
    # The top stays within a step for some time: its error is that of the offset again.
    variance += contact.covariance[cell, cell] + 2 * contact.background.quantization.offset**2
    return Estimate(float(low.max()) - noise, math.sqrt(variance))
