"""One drop, stage by stage: contact time, restitution, peak, impulse and noise with uncertainties.

A drop has two restitutions (docs/recordings_theory.md, 5). That by the impulse needs the mass and a
calibrated force, but no bounce in the record; that by the bounces needs neither. Where both are
known, their difference shows a wrong mass, height or calibration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import resample

from thud.base._schema import Drop as DropKeys
from thud.base.checks import refuse
from thud.base.note import Note
from thud.level.estimate import RECTANGULAR, UNKNOWN, Contribution, Estimate
from thud.level.levels import RECORDED_BAND, low_pass
from thud.recordings.background import remove_background
from thud.recordings.contact import SAMPLE_ERROR, Contact, find_contact
from thud.recordings.drops import Section, Stage, robust_deviation
from thud.recordings.instruments import ASSUMED, correct, filtered, find_effects
from thud.recordings.recorded_levels import measure_levels
from thud.recordings.repair import check_aliasing, repair
from thud.recordings.ringing import find_ringing, is_in_record

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.recordings.config import Config
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
# Quantities of `QUANTITIES` that are estimated for each drop.
ESTIMATES = ("contact_time", "restitution", "peak_force", "impulse", "effective_mass")
# Gravity, m/s2, the default of the models.
GRAVITY = DropKeys.gravity
IMPULSE, BOUNCES, RESTITUTION, MASS = "impulse", "bounces", "restitution", "effective_mass"
# Restitution by the impulse minus that by the bounces.
DIFFERENCE = "difference"
# Maximum error of the measured release, s, and maximum height by which the center of a ball is
# lower or higher at the release than at first touch, m: finite elements, modal ball and shell have
# up to 0.5 ms, and -2 to 4 mm.
SLOW_RELEASE = 5e-4
DEFORMATION = 4e-3


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

    def levels(self, bands: BandSet = "octave") -> NDArray[np.float64]:
        """Return the force exposure levels, corrected for the background, dB, shape (n_band,).

        Their uncertainties are in `thud.recordings.recorded_levels.measure_levels`.
        """
        return np.array(measure_levels([self], bands).level[0])


@dataclass(frozen=True, eq=False, repr=False)
class Stages(Stage):
    """One drop after each stage of its measurement.

    Attributes
    ----------
    section : Section
        As recorded.
    repaired : Section
        With spikes filled.
    corrected : Section
        After the correction of the instruments.
    drop : Drop
        Without background, measured.
    """

    section: Section
    repaired: Section
    corrected: Section
    drop: Drop


def measure_stages(section: Section, config: Config, calibration: float | None = None) -> Stages:
    """Measure the drop in a section; `calibration` is the relative uncertainty of the force.

    The levels of drops are `thud.recordings.recorded_levels.measure_levels`, their budget is
    `Recording.level_estimates`. Raise InputError if the drop cannot be measured.
    """
    repaired = repair(section)
    corrected = correct(repaired, *config.corrected)
    try:
        contact = find_contact(corrected, *remove_background(corrected))
    except np.linalg.LinAlgError as error:
        allowed = "a background of noise, drift and hum"
        refuse(f"{section.name}: the background is not noise", allowed, error)
    drop = measure_drop(corrected, contact, config, calibration, repaired)
    # A copy without the cached factors of the background, which are no longer needed.
    contact = replace(contact, background=replace(contact.background))
    return Stages(section, repaired, corrected, replace(drop, contact=contact))


def measure_drop(
    section: Section,
    contact: Contact,
    config: Config,
    calibration: float | None = None,
    recorded: Section | None = None,
) -> Drop:
    """Return contact time, peak, impulse, restitution and effective mass of a drop.

    `section` is that of the contact, with its bounce, and `recorded` the same before the
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
    landing = contact.landing
    if landing and section.bounce and config.height:
        # The force of a bounce follows its velocity, and so does the flight before it.
        flight, bounce = landing - contact.release, section.bounce
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
    notes += check_aliasing(section, contact)
    ringing, plate = find_ringing(contact, section.chain), config.corrected[0]
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
        peak_force=UNKNOWN,
        impulse=impulse,
        effective_mass=estimates[MASS],
        restitutions=restitutions,
        shared_effects=shared,
        bounce=landing.value - contact.touch.value if landing else None,
        notes=tuple(replace(note, subject=note.subject or section.name) for note in notes),
        ringing=ringing,
        plate_recorded=is_in_record(recorded, contact, plate) if recorded and plate else None,
    )  # fmt: skip
    return replace(drop, peak_force=_peak(drop, config))


def _peak(drop: Drop, config: Config) -> Estimate:
    """Return the maximum of the force below 1.25 kHz, N.

    Noise increases a maximum by about its standard deviation, which is subtracted; the uncertainty
    has it twice, and the effects of instruments that are not stated.
    """
    contact, background, force = drop.contact, drop.contact.background, drop.contact.gated
    rate, margin = contact.sample_rate, math.ceil(PEAK_MARGIN * contact.sample_rate)
    low = low_pass(np.pad(force, margin), rate)
    # The peak may lie between samples.
    factor = math.ceil(PEAK_RATE / rate)
    low = resample(low, factor * len(low)) if factor > 1 else low
    index = int(np.clip(np.argmax(low) // factor - margin, 0, len(force) - 1))
    cell = index * len(contact.covariance) // len(force)
    noise = math.sqrt(float(background.density(RECORDED_BAND)) * min(RECORDED_BAND, rate / 2))
    variance = 2 * noise**2 + (SAMPLE_ERROR * background.peak) ** 2
    # The top stays within a step for some time: its error is that of the offset again.
    variance += contact.covariance[cell, cell] + 2 * background.quantization.offset**2
    force = np.pad(force, 2)
    peaks = [
        low_pass(filtered(force, rate, gain, len(force)), rate).max()
        for name, gain, _ in find_effects([drop], config)
        if name in ASSUMED
    ]
    assumed = math.hypot(*(np.array(peaks) - low_pass(force, rate).max())) / RECTANGULAR
    return Estimate(float(low.max()) - noise, math.hypot(math.sqrt(variance), assumed))


def shared_causes(config: Config, calibration: float | None) -> dict[str, Contribution]:
    """Return what is uncertain in all drops alike, in its own unit, by name.

    `calibration` is the relative standard uncertainty of the force. One that is not stated is zero.
    """
    causes = (
        ("calibration", calibration or 0.0, "", 1.0),
        ("mass", config.mass_uncertainty or 0.0, "kg", 1.0),
        ("drop height", config.height_uncertainty or 0.0, "m", 1.0),
        ("slow release", SLOW_RELEASE, "s", RECTANGULAR),
        ("deformed ball", DEFORMATION, "m", RECTANGULAR),
    )
    return {
        name: Contribution(name, size / divisor, size=size, unit=unit, divisor=divisor)
        for name, size, unit, divisor in causes
    }


def measure_rebound(  # noqa: PLR0913, PLR0917 - what is measured, and what is stated
    impulse: Estimate,
    duration: Estimate,
    flight: Estimate | None,
    config: Config,
    calibration: float | None = None,
    quantization: float = 0.0,
) -> tuple[dict[str, Estimate], dict[str, dict[str, float]]]:
    """Return how a ball returns after a contact; NaN if mass, height or flight do not allow it.

    These are the restitution by `IMPULSE` and by `BOUNCES`, their mean `RESTITUTION`, weighted by
    inverse variances, their `DIFFERENCE`, and the effective `MASS`, kg. Their uncertainties are
    those by the noise of the drop; also returned are the changes of each by one standard
    uncertainty of what all drops share (`shared_causes`, and quantization).

    The impulse is in N s; the duration of the contact, and the flight, s, are those between first
    touch and release. `quantization` is the standard uncertainty of the impulse by quantization of
    the background, N s. Uncertainties are propagated linearly (JCGM 100, 5.1.2), with slopes by
    central differences.
    """
    noise = {"impulse": impulse, "duration": duration, "flight": flight or UNKNOWN}
    steps = {name: c.uncertainty for name, c in shared_causes(config, calibration).items()}
    steps["quantization"] = quantization
    steps |= {name: estimate.uncertainty for name, estimate in noise.items()}
    inputs = dict.fromkeys(steps, 0.0) | {name: e.value for name, e in noise.items()}
    inputs |= {"mass": config.mass or math.nan, "drop height": config.height or math.nan}
    values = _rebound(inputs)
    effects: dict[str, dict[str, float]] = {name: {} for name in values}
    for cause, step in steps.items():
        low, high = (
            _rebound({**inputs, cause: inputs[cause] + half}) for half in (-step / 2, step / 2)
        )
        for name in values:
            effects[name][cause] = high[name] - low[name]
    methods = [method for method in (IMPULSE, BOUNCES) if math.isfinite(values[method])]
    weights = np.array([1 / max(math.hypot(*effects[m].values()), 1e-12) ** 2 for m in methods])
    for name, factors, used in (
        (RESTITUTION, weights / weights.sum(), methods),
        (DIFFERENCE, np.array([1, -1]), [IMPULSE, BOUNCES]),
    ):
        values[name] = float(factors @ [values[method] for method in used]) if methods else math.nan
        effects[name] = {
            cause: float(factors @ [effects[method][cause] for method in used]) for cause in steps
        }
    estimates = {
        name: Estimate(value, math.hypot(*(effects[name][cause] for cause in noise)))
        for name, value in values.items()
    }
    shared = {
        name: {cause: effect for cause, effect in row.items() if effect and cause not in noise}
        for name, row in effects.items()
        if math.isfinite(values[name])
    }
    return estimates, shared


def _rebound(values: Mapping[str, float]) -> dict[str, float]:
    """Return the restitution by impulse and by bounces, and the effective mass.

    By the impulse it is (J - m g t)/(m v) - 1, where a slow release makes the measured duration t
    too long; by bounces e = g T/(2 v), where a flight from a height d lasts 2 e v/g + d/(e v). The
    mass is J/(v + g T/2 + g t).
    """
    # A stated uncertainty may exceed its value.
    height, mass = (max(values[name], 1e-6) for name in ("drop height", "mass"))
    speed = math.sqrt(2 * GRAVITY * height)
    momentum = values["impulse"] * (1 + values["calibration"]) + values["quantization"]
    duration = values["duration"] - values["slow release"]
    rise = GRAVITY * values["flight"] / 2
    return {
        IMPULSE: momentum / mass / speed - 1 - GRAVITY * duration / speed,
        BOUNCES: (rise + GRAVITY * values["deformed ball"] / (2 * rise)) / speed,
        MASS: momentum / (speed + rise + GRAVITY * values["duration"]),
    }
