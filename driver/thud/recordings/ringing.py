"""Resonance of the force plate in a record: ringing, and whether a stated plate is in it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from thud.base.note import Note
from thud.recordings.free_oscillation import MIN_FREQUENCY, matched_energy, resonance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.config import Config
    from thud.recordings.contact import Contact
    from thud.recordings.drops import Section
    from thud.recordings.measured_drop import Drop
    from thud.recordings.plate import Plate
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
        return Note(code, value=self.amplitude, unit="N", effect=0.0, others=others)


def with_plate(drop: Drop, recorded: Section, config: Config) -> Drop:
    """Return a drop with the ringing of the plate, and whether its resonance is in the record.

    `recorded` is the section before the correction of the plate.
    """
    ringing, plate = find_ringing(drop.contact, config.chain), config.resonance
    return replace(
        drop,
        ringing=ringing,
        plate_recorded=None if plate is None else is_in_record(recorded, drop.contact, plate),
        notes=(*drop.notes, ringing.note) if ringing else drop.notes,
    )


def find_ringing(contact: Contact, chain: Chain | None = None) -> Ringing | None:
    """Return the ringing of the plate after a contact, None if there is none.

    A matched filter searches a free oscillation A exp(-t/d) cos(2 pi f t + p) after the gate, for
    the decay times d and all frequencies f. The density of the noise is that of the background,
    times the gain of the correction. Frequency and quality are those of the oscillation of least
    squares.
    """
    rate, first = contact.sample_rate, contact.span[0]
    pause = int(PAUSE * rate)
    after = contact.force[contact.gate[1] - first + pause :]
    before = contact.force[: max(contact.gate[0] - first - pause, 0)][::-1]
    if len(after) < MIN_LENGTH * rate:
        return None
    frequency, energy = _matched(after, contact, chain)
    k, index = np.unravel_index(np.argmax(energy), energy.shape)
    strongest, decay = float(frequency[index]), float(DECAYS[k])
    if not (MIN_FREQUENCY <= strongest <= MAX_FREQUENCY * rate and energy[k, index] > MIN_ENERGY):
        return None
    if np.pi * strongest * decay < MIN_QUALITY:
        return None
    if len(before) >= MIN_LENGTH * rate:
        frequency_before, energy_before = _matched(before, contact, chain)
        nearest = int(np.argmin(np.abs(frequency_before - strongest)))
        tone = energy_before[k, max(nearest - 1, 0) : nearest + 2].max()
        if energy[k, index] < MIN_INCREASE * tone:
            return None
    density, _ = contact.background.density(strongest)
    density *= float(chain.noise_gain(np.array([strongest]))[0]) if chain else 1.0
    window = np.exp(-2 * np.arange(len(after)) / rate / decay).sum()
    amplitude = 2 * np.sqrt(energy[k, index] * density * rate / 2 / window)
    if amplitude < MIN_AMPLITUDE[chain is not None] * contact.peak:
        return None
    natural, quality = _fitted(after[: int(LENGTH * decay * rate)], rate, strongest, decay)
    return Ringing(natural, quality, float(amplitude), chain is not None)


def _fitted(
    force: NDArray[np.float64], rate: float, frequency: float, decay: float
) -> tuple[float, float]:
    """Return resonance, Hz, and quality factor of the free oscillation of least squares."""
    time = np.arange(len(force)) / rate

    def residual(shape: NDArray[np.float64]) -> NDArray[np.float64]:
        wave = np.exp((2j * np.pi * shape[0] - 1 / shape[1]) * time)
        waves = np.column_stack([wave.real, wave.imag])
        amplitudes = np.linalg.lstsq(waves, force)[0]
        return np.asarray(force - waves @ amplitudes)

    start = np.array([frequency, decay])
    bounds = (0.8 * start[0], 0.25 * start[1]), (1.25 * start[0], 4 * start[1])
    frequency, decay = least_squares(residual, start, bounds=bounds, x_scale=start).x
    return resonance(frequency, decay)


def is_in_record(recorded: Section, contact: Contact, plate: Plate) -> bool | None:
    """Return whether the resonance of a stated plate is in the recorded force; None if unclear.

    It is if the recorded force rings at its frequency. Else the energy of the pulse near the
    resonance is compared with that below and above it: where the plate resonates, the recorded
    force has more, and the corrected force as much; where it does not, the corrected force has
    less. This is unclear if noise hides the difference.
    """
    force = recorded.force[slice(*contact.span)] - contact.removed
    raw = replace(contact, force=force)
    ringing = find_ringing(raw)
    tolerance = max(MATCH, 3 * (plate.f0_uncertainty or 0.0))
    if ringing and abs(ringing.frequency / plate.f0 - 1) < tolerance:
        return True
    edges = np.array([[max(1 - 0.5 / plate.Q, 0.9), min(1 + 0.5 / plate.Q, 1.1)], *SIDES])
    edges *= plate.f0
    if edges.max() > contact.sample_rate / 2:
        return None
    excess = []
    for pulse in (raw, contact):
        length = max(len(pulse.gated), int(8 * plate.Q * contact.sample_rate / plate.f0))
        spectrum = np.abs(np.fft.rfft(pulse.gated, length) / contact.sample_rate) ** 2
        frequency = np.fft.rfftfreq(length, 1 / contact.sample_rate)
        energies = [
            spectrum[(frequency >= low) & (frequency <= high)].mean() for low, high in edges
        ]
        if pulse is raw:
            noise = contact.background.density(plate.f0)[0] / 2
            noise *= len(pulse.gated) / contact.sample_rate
            if min(energies) < MIN_SIGNAL * noise:
                return None
        excess.append(abs(np.log(energies[0] / np.sqrt(energies[1] * energies[2]))))
    difference = excess[0] - excess[1]
    return None if abs(difference) < CLEAR else bool(difference > 0)


def _matched(
    force: NDArray[np.float64], contact: Contact, chain: Chain | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return frequencies, Hz, and the ratio of energy and noise by decay time and frequency."""
    rate = contact.sample_rate
    frequency, energy = matched_energy(force, rate, DECAYS)
    frequency, energy = frequency[1:], energy[:, 1:]
    density = contact.background.spectrum(frequency)
    if chain is not None:
        density *= chain.noise_gain(frequency)
    return frequency, energy / (density * rate / 2)
