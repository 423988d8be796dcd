"""Ringing of the force plate after a contact, if its resonance is not corrected."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.contact import Contact
    from thud.recordings.plate import Plate

# Trial decay times of a ringing to 1/e, s.
DECAYS = np.array([0.002, 0.004, 0.008, 0.016, 0.032])
# Pause after the gate, in which soft releases end, and minimum length of the signal after it, s.
PAUSE = 1e-3
MIN_LENGTH = 4e-3
# Minimum frequency, Hz, and maximum frequency as a fraction of the sample rate: filters ring near
# half the rate.
MIN_FREQUENCY = 200.0
MAX_FREQUENCY = 0.3
# Minimum ratio to the energy of noise: noise exceeds it at one of about 6000 points once in 1e7.
MIN_ENERGY = 25.0
# Minimum ratio to the energy before the contact: a tone that is there already is no ringing.
MIN_INCREASE = 4.0
# Minimum amplitude for a warning, as a fraction of the peak: without and with a stated plate.
MIN_AMPLITUDE = (3e-4, 1e-3)
# Minimum quality factor, pi times the number of oscillations within the decay time.
MIN_QUALITY = 3.0


def check_ringing(contact: Contact, plate: Plate | None = None) -> tuple[str, ...]:
    """Return a warning if the plate keeps ringing after the contact.

    A matched filter searches a free oscillation A exp(-t/d) cos(2 pi f t + p) after the gate, for
    the decay times d and all frequencies f. The density of the noise is that of the background,
    times the gain of the plate's correction.
    """
    rate, first = contact.sample_rate, contact.span[0]
    pause = int(PAUSE * rate)
    after = contact.force[contact.gate[1] - first + pause :]
    before = contact.force[: max(contact.gate[0] - first - pause, 0)][::-1]
    if len(after) < MIN_LENGTH * rate:
        return ()
    frequency, energy = _matched(after, contact, plate)
    k, index = np.unravel_index(np.argmax(energy), energy.shape)
    resonance, decay = float(frequency[index]), float(DECAYS[k])
    quality = np.pi * resonance * decay
    if not (MIN_FREQUENCY <= resonance <= MAX_FREQUENCY * rate and energy[k, index] > MIN_ENERGY):
        return ()
    if quality < MIN_QUALITY:
        return ()
    if len(before) >= MIN_LENGTH * rate:
        frequency_before, energy_before = _matched(before, contact, plate)
        nearest = int(np.argmin(np.abs(frequency_before - resonance)))
        tone = energy_before[k, max(nearest - 1, 0) : nearest + 2].max()
        if energy[k, index] < MIN_INCREASE * tone:
            return ()
    density, _ = contact.background.density(resonance)
    density *= float(_gain(plate, np.array([resonance]))[0]) if plate else 1.0
    window = np.exp(-2 * np.arange(len(after)) / rate / decay).sum()
    amplitude = 2 * np.sqrt(energy[k, index] * density * rate / 2 / window)
    if amplitude < MIN_AMPLITUDE[plate is not None] * contact.peak:
        return ()
    # Interpolation between the frequencies of the transform: the vertex of a parabola.
    low, top, high = np.log(energy[k, index - 1 : index + 2])
    resonance += (frequency[1] - frequency[0]) * (low - high) / (2 * (low - 2 * top + high))
    effect = "differs from that in [plate]" if plate else "affects levels, peaks and contact time"
    warning = (
        f"the plate keeps ringing after the contact, at {resonance:.0f} Hz with {amplitude:.2g} N: "
        f"its resonance {effect}; state it in [plate]"
    )
    return (warning,)


def _gain(plate: Plate, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the gain of the noise density by a plate's correction, at least 1."""
    return np.asarray(np.maximum(1 / np.abs(plate.response(frequency)) ** 2, 1.0))


def _matched(
    force: NDArray[np.float64], contact: Contact, plate: Plate | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return frequencies, Hz, and the ratio of energy and noise by decay time and frequency."""
    rate = contact.sample_rate
    windows = np.exp(-np.arange(len(force)) / rate / DECAYS[:, None])
    length = next_fast_len(2 * len(force), real=True)
    frequency = np.asarray(np.fft.rfftfreq(length, 1 / rate), dtype=np.float64)[1:]
    power = np.abs(np.fft.rfft(windows * force, length)[:, 1:]) ** 2
    white, pink, brown = contact.background.variances[:3]
    density = white + pink / frequency + brown / frequency**2
    if plate is not None:
        density *= _gain(plate, frequency)
    noise = density * rate / 2 * (windows**2).sum(axis=1)[:, None]
    return frequency, np.asarray(power / noise)
