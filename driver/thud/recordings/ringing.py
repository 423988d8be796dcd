"""Resonance of the force plate in a record: ringing, and whether a stated plate is in it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from thud.base.note import Note
from thud.recordings.free_oscillation import (
    MIN_FREQUENCY,
    fit_oscillations,
    matched_energy,
    resonance,
)

if TYPE_CHECKING:
    from thud.recordings.contact import Contact
    from thud.recordings.drops import Section
    from thud.recordings.instruments import Plate
    from thud.recordings.response import Chain

# Trial decay times of a ringing to 1/e, s.
DECAYS = np.array([0.002, 0.004, 0.008, 0.016, 0.032])
# Pause after the gate, in which soft releases end, and minimum length of the signal after it, s.
PAUSE = 1e-3
MIN_LENGTH = 4e-3
# Maximum frequency as a fraction of the sample rate: filters ring near half the rate.
MAX_FREQUENCY = 0.3
# Minimum ratio to the energy of noise: noise exceeds it at one of about 6000 points once in 1e7.
MIN_ENERGY = 25.0
# Minimum ratio to the energy before the contact: a tone that is there already is no ringing.
MIN_INCREASE = 4.0
# Minimum amplitude for a warning, as a fraction of the peak: without and with a correction.
MIN_AMPLITUDE = (3e-4, 1e-3)
# Minimum quality factor, pi times the number of oscillations within the decay time.
MIN_QUALITY = 3.0
# Length of the fitted ringing, in decay times.
LENGTH = 4.0
# Maximum relative change of the frequency by the fit.
MAX_SHIFT = 0.25
# Maximum relative difference between a stated resonance and the ringing that confirms it.
MATCH = 0.03
# Frequencies below and above a resonance, as fractions of it, with which its energy is compared.
SIDES = [(0.6, 0.8), (1.25, 1.5)]
# Minimum ratio of the energies of pulse and noise for this comparison, and minimum logarithm of the
# ratio of energies: 4 dB.
MIN_SIGNAL = 4.0
CLEAR = 0.9


@dataclass(frozen=True)
class Ringing:
    """A free oscillation of the plate after a contact.

    Attributes are its frequency, Hz, its quality factor, its amplitude, N, and whether the response
    of a stated plate was corrected.
    """

    frequency: float
    quality: float
    amplitude: float
    corrected: bool

    @property
    def note(self) -> Note:
        """Warning, whose effect is in the uncertainty."""
        code = "plate_rings_differently" if self.corrected else "plate_rings"
        others = {"frequency": self.frequency, "quality": self.quality}
        return Note(code, value=self.amplitude, unit="N", others=others)


def find_ringing(contact: Contact, chain: Chain | None = None) -> Ringing | None:
    """Return the ringing of the plate after a contact, None if there is none.

    A matched filter searches a free oscillation A exp(-t/d) cos(2 pi f t + p) after the gate, for
    the decay times d and all frequencies f. Its energy is compared with that of the noise, with the
    density of the background times the gain of the correction, and with that before the contact.
    Frequency and quality are those of the oscillation of least squares.
    """
    rate, pause = contact.sample_rate, int(PAUSE * contact.sample_rate)
    first, stop = (edge - contact.span[0] for edge in contact.gate)
    after, before = contact.force[stop + pause :], contact.force[: max(first - pause, 0)][::-1]
    if len(after) < MIN_LENGTH * rate:
        return None
    frequencies, energies = matched_energy(after, rate, DECAYS)
    frequencies, energies = frequencies[1:], energies[:, 1:]
    noise = contact.background.density(frequencies) * rate / 2
    if chain is not None:
        noise *= np.maximum(np.abs(chain.response(frequencies)) ** -2, 1.0)
    k, index = np.unravel_index(np.argmax(energies / noise), energies.shape)
    frequency, decay, energy = frequencies[index], DECAYS[k], energies[k, index]
    if not (
        MIN_FREQUENCY <= frequency <= MAX_FREQUENCY * rate
        and energy > MIN_ENERGY * noise[index]
        and np.pi * frequency * decay > MIN_QUALITY
    ):
        return None
    if len(before) >= MIN_LENGTH * rate:
        earlier, tones = matched_energy(before, rate, DECAYS[k : k + 1])
        if energy < MIN_INCREASE * np.interp(frequency, earlier, tones[0]):
            return None
    window = np.exp(-2 * np.arange(len(after)) / rate / decay).sum()
    amplitude = 2 * math.sqrt(energy / window)
    if amplitude < MIN_AMPLITUDE[chain is not None] * contact.peak:
        return None
    start, ringing = np.array([[frequency, -math.log(decay)]]), after[: int(LENGTH * decay * rate)]
    ((fitted, log_rate),), _ = fit_oscillations(ringing, start, rate, background=False)
    if abs(fitted / frequency - 1) < MAX_SHIFT:  # else it is another oscillation
        frequency, decay = fitted, math.exp(-log_rate)
    return Ringing(*resonance(frequency, decay), amplitude, chain is not None)


def is_in_record(recorded: Section, contact: Contact, plate: Plate) -> bool | None:
    """Return whether the resonance of a stated plate is in the recorded force; None if unclear.

    It is if the recorded force rings at its frequency. Else the energy of the pulse near the
    resonance is compared with that below and above it: where the plate resonates, the recorded
    force has more, and the corrected force as much; where it does not, the corrected force has
    less. This is unclear if noise hides the difference.
    """
    rate = contact.sample_rate
    raw = replace(contact, force=recorded.force[slice(*contact.span)] - contact.removed)
    ringing = find_ringing(raw)
    tolerance = max(MATCH, 3 * (plate.f0_uncertainty or 0.0))
    if ringing and abs(ringing.frequency / plate.f0 - 1) < tolerance:
        return True
    edges = np.array([[max(1 - 0.5 / plate.Q, 0.9), min(1 + 0.5 / plate.Q, 1.1)], *SIDES])
    edges *= plate.f0
    if edges.max() > rate / 2:
        return None
    count = len(raw.gated)
    length = max(count, int(8 * plate.Q * rate / plate.f0))
    spectra = np.abs(np.fft.rfft([raw.gated, contact.gated], length) / rate) ** 2
    frequency = np.fft.rfftfreq(length, 1 / rate)
    near, low, high = (
        spectra[:, (frequency >= begin) & (frequency <= end)].mean(axis=1) for begin, end in edges
    )
    noise = float(contact.background.density(plate.f0)) / 2 * count / rate
    if min(near[0], low[0], high[0]) < MIN_SIGNAL * noise:
        return None
    excess = np.abs(np.log(near / np.sqrt(low * high)))
    difference = float(excess[0] - excess[1])
    return None if abs(difference) < CLEAR else difference > 0
