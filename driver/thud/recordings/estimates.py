"""Contact time, restitution, peak, impulse and noise of a drop, with their uncertainties.

Derivations: docs/recordings_theory.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.immutable import Immutable
from thud.level.estimate import Estimate
from thud.level.levels import RECORDED_BAND, record_force
from thud.recordings.contact import Contact, find_contact, find_edges
from thud.recordings.faults import least_quiet, repair
from thud.recordings.noise import Noise
from thud.recordings.recorded_levels import measure_levels
from thud.recordings.restitution import GRAVITY, DropConditions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.recordings.drops import Window

# Draws of noise that show what it adds to the maximum.
PEAK_DRAWS = 32
# Quiet below which it is told, s.
SHORT_QUIET = 0.005
# Edges of the octave of 500 Hz, Hz; the part of the rate above which content folds back, and the
# error that is told, dB.
OCTAVE_500 = (354.8, 707.9)
TOP = 0.4
NOTABLE_ERROR = 0.1
# Least contact time over its uncertainty.
MOST_DOUBT = 4.0
# A pulse whose flight and whose peak, over those of the drop, differ by this factor is no bounce:
# the force follows the velocity.
UNLIKE = 3.0
# Standard deviations that make a difference worth telling.
NOTABLE = 3.0


@dataclass(frozen=True, eq=False)
class Drop(Immutable):
    """One drop, corrected, and what it tells.

    Attributes
    ----------
    name : str
        Name of the drop, as ``"file.wav, drop 3"``.
    begin : float
        Time of the first sample since first touch, s.
    force : ndarray, shape (n,)
        Force without offset, drift, hum and slow noise, N.
    sample_rate : float
        Samples per second, Hz.
    onset : float
        Time of first touch in the file, s.
    gate : tuple of int
        First sample of the contact with its margins, and the one behind it: levels are those of
        ``force[gate[0]:gate[1]]``.
    contact_time, restitution, peak_force, impulse, effective_mass : Estimate
        In s (`thud.impact.contact_time`), 1, N (below 1.25 kHz), N s and kg; NaN where not known.
    restitution_shared : dict of str to float
        Standard uncertainties that calibration, mass and drop height make of the restitution of
        all drops alike, beside that stated; signed.
    restitution_method : str
        ``"impulse"``, ``"bounces"``, ``"impulse and bounces"`` or ``""``.
    restitutions : dict of str to Estimate
        The restitution by each way.
    noise : Noise
        Noise of the quiet parts.
    bounces : tuple of float
        Times at which the later bounces that were measured begin, since the onset, s: of one
        where the drop height is known, else of up to two.
    steps, warnings : tuple of str
        What was done to the signal, and what is doubtful; a sentence each.
    """

    name: str
    begin: float
    force: NDArray[np.float64]
    sample_rate: float
    onset: float
    gate: tuple[int, int]
    contact_time: Estimate
    restitution: Estimate
    restitution_shared: dict[str, float]
    restitution_method: str
    restitutions: dict[str, Estimate]
    peak_force: Estimate
    impulse: Estimate
    effective_mass: Estimate
    noise: Noise
    bounces: tuple[float, ...]
    steps: tuple[str, ...]
    warnings: tuple[str, ...]
    contact: Contact

    @property
    def time(self) -> NDArray[np.float64]:
        """Time since first touch, s, shape (n,)."""
        time: NDArray[np.float64] = self.begin + np.arange(len(self.force)) / self.sample_rate
        return time

    def levels(
        self, bands: BandSet = "octave", method: str = "exact", *, low_pass: bool = False
    ) -> NDArray[np.float64]:
        """Return the force exposure levels, corrected for the background, dB, shape (n_band,).

        The arguments are those of `thud.recordings.recorded_levels.measure_levels`, which has their
        uncertainties too.
        """
        return measure_levels([self], bands, method, low_pass=low_pass)[0].level.copy()


def measure_drop(  # noqa: PLR0913 - what a laboratory knows
    window: Window,
    *,
    height: float | None = None,
    mass: float | None = None,
    calibration_uncertainty: float = 0.0,
    mass_uncertainty: float = 0.0,
    height_uncertainty: float = 0.0,
) -> Drop:
    """Return what one drop tells.

    Parameters
    ----------
    window
        The part of the signal around the drop.
    height
        Drop height of the lowest point, m.
    mass
        Mass of the source, kg.
    calibration_uncertainty, mass_uncertainty, height_uncertainty
        Standard uncertainties, relative, kg and m; they weight the ways to the restitution.

    Raises
    ------
    InputError
        Where the pulse is clipped, cut, doubled or full of dropouts.
    """
    force, steps, warnings = repair(window)
    try:
        contact = find_contact(window, force)
    except np.linalg.LinAlgError as error:
        refuse(f"{window.name}: the quiet parts are no noise", "noise, drift and hum", error)
    steps += _told_background(contact)
    for side, quiet in zip(("before", "after"), contact.quiet, strict=True):
        if quiet < SHORT_QUIET:
            warnings += (f"there are {1e3 * quiet:.1f} ms of quiet {side} the contact",)
    rate = window.sample_rate
    # The flight behind the drop gives the restitution; without the height two flights are compared.
    landings = _landings(window, contact, 1 if height else 2)
    contact_time = _between(contact.begin, contact.end)
    if not contact_time.value > MOST_DOUBT * contact_time.uncertainty:
        refuse(
            f"{window.name}: the contact cannot be told from the noise: "
            f"{1e3 * contact_time.value:.3g} ms with a standard uncertainty of "
            f"{1e3 * contact_time.uncertainty:.2g} ms",
            f"an uncertainty up to 1/{MOST_DOUBT:g} of it",
        )
    impulse = _impulse(contact)
    fall = DropConditions(
        height, mass, calibration_uncertainty, mass_uncertainty, height_uncertainty
    )
    if height and landings:
        flight = _between(contact.end, landings[0][0]).value
        peak = _peak_of(window.bounces[0]) / contact.peak
        if not peak / UNLIKE < GRAVITY * flight / (2 * fall.speed) < peak * UNLIKE:
            landings = []
            unlike = (
                f"the pulse {1e3 * flight:.0f} ms behind the contact has {peak:.2g} of its peak: "
                f"it is no bounce from {height:g} m"
            )
            warnings += (unlike,)
    flights = []
    leaving = contact.end
    for landing, again in landings:
        flights.append(_between(leaving, landing))
        leaving = again
    ways, told = fall.restitutions(impulse, contact_time, flights)
    restitution, shared = fall.mean(ways, impulse)
    first, stop = (place - contact.span[0] for place in contact.gate)
    return Drop(
        name=window.name,
        begin=contact.span[0] / rate - contact.touch.value,
        force=contact.force,
        sample_rate=rate,
        onset=window.start / rate + contact.touch.value,
        gate=(first, stop),
        contact_time=contact_time,
        restitution=restitution,
        restitution_shared=shared,
        restitution_method=" and ".join(ways),
        restitutions=ways,
        peak_force=_peak(contact),
        impulse=impulse,
        effective_mass=fall.effective_mass(impulse, contact_time, ways.get("bounces")),
        noise=_noise(contact),
        bounces=tuple(landing.value - contact.touch.value for landing, _ in landings),
        steps=steps,
        warnings=(*window.warnings, *warnings, *_told_aliased(contact), *told),
        contact=contact,
    )


def _between(first: Estimate, last: Estimate) -> Estimate:
    """Return the time between two times, s."""
    return Estimate(last.value - first.value, math.hypot(last.uncertainty, first.uncertainty))


def _landings(window: Window, drop: Contact, count: int) -> list[tuple[Estimate, Estimate]]:
    """Return begin and end of the first bounces, s from the start of the window."""
    found = []
    for bounce in window.bounces[:count]:
        first, stop = bounce.contact
        least = least_quiet(bounce.sample_rate)
        if first < least or len(bounce.force) - stop < least:
            break
        late = (bounce.start - window.start) / window.sample_rate
        begin, end = (
            Estimate(late + edge.value, edge.uncertainty)
            for edge in find_edges(bounce, drop.background)
        )
        found.append((begin, end))
    return found


def _peak_of(window: Window) -> float:
    """Return the maximum of a pulse above its quiet, N."""
    first, stop = window.contact
    force = window.force
    quiet = np.concatenate([force[:first], force[stop:]])
    return float(force[first:stop].max() - np.median(quiet))


def _impulse(contact: Contact) -> Estimate:
    """Return the time integral of the force, N s: the sum over the gate."""
    ones = np.full((1, len(contact.gated)), 1 / contact.sample_rate)
    variance = contact.covariance_of(ones)[0, 0]
    return Estimate(float((ones @ contact.gated)[0]), math.sqrt(variance))


def _peak(contact: Contact) -> Estimate:
    """Return the maximum of the force below 1.25 kHz, N, less what noise adds to a maximum.

    That is what further noise of the same density adds (bootstrap), a part of it where there is
    much noise; as much again counts as uncertain.
    """
    force = np.pad(contact.gated, 2)
    low = record_force(force, contact.sample_rate)
    place = int(np.argmax(low)) * len(contact.covariance) // len(low)
    density, _ = contact.background.density(RECORDED_BAND)
    deviation = math.sqrt(density * contact.sample_rate / 2)
    draws = np.random.default_rng(0).normal(scale=deviation, size=(PEAK_DRAWS, len(force)))
    higher = [record_force(force + noise, contact.sample_rate).max() for noise in draws]
    excess = max(float(np.mean(higher) - low.max()), 0.0)
    variance = density * min(RECORDED_BAND, contact.sample_rate / 2) + excess**2
    variance += contact.covariance[place, place]
    return Estimate(float(low.max()) - excess, math.sqrt(variance))


def _noise(contact: Contact) -> Noise:
    """Return the noise of the quiet parts."""
    first, stop = (place - contact.span[0] for place in contact.gate)
    quiet = np.concatenate([contact.force[:first], contact.force[stop:]])
    deviation = 1.4826 * float(np.median(np.abs(quiet - np.median(quiet))))
    white, pink, brown = map(float, contact.background.variances[:3])
    return Noise(deviation, "before and after", white, pink, brown)


def _told_background(contact: Contact) -> tuple[str, ...]:
    """Return what was removed, a sentence each."""
    first, stop = (place - contact.span[0] for place in contact.gate)
    offset = float(contact.under[first:stop].mean())
    steps = [f"an offset of {offset:.3g} N was removed"]
    drift, deviation = contact.background.drift
    if abs(drift) > NOTABLE * deviation:
        steps.append(f"a drift of {drift:.3g} N/s was removed")
    frequency, amplitude, deviation = contact.background.hum
    if amplitude > NOTABLE * deviation:
        steps.append(f"hum of {frequency:g} Hz with an amplitude of {amplitude:.3g} N was removed")
    return tuple(steps)


def _told_aliased(contact: Contact) -> tuple[str, ...]:
    """Return a sentence where content at half the rate folds back into the octave of 500 Hz.

    Beyond half the rate the amplitude of a pulse with kinks falls as 1/f2.
    """
    rate = contact.sample_rate
    lower, upper = OCTAVE_500
    # Long enough for several frequencies in the octave.
    force = np.pad(contact.gated, (0, int(rate / 20) + 3 * len(contact.gated)))
    frequency = np.fft.rfftfreq(len(force), 1 / rate)
    power = np.abs(np.fft.rfft(force)) ** 2
    noise = contact.background.variances[0] * rate / 2 * len(contact.gated)
    own = power[(frequency > lower) & (frequency < upper)].mean()
    top = max(power[frequency > TOP * rate].mean() - 3 * noise, 0.0)
    folded = top * (0.45 * rate / (rate - upper)) ** 4
    error = 20 * math.log10(1 + math.sqrt(folded / own))
    if error < NOTABLE_ERROR:
        return ()
    told = (
        f"the force has content up to half the rate, {rate / 2:g} Hz: without a filter before "
        f"sampling, the octave of 500 Hz may be off by {error:.1f} dB"
    )
    return (told,)
