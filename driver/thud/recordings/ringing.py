"""Ringing of the plate after a contact, where its resonance is not taken out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.contact import Contact
    from thud.recordings.plate import Plate

# Times in which a ringing may fall to 1/e, s.
DECAYS = np.array([0.002, 0.004, 0.008, 0.016, 0.032])
# Quiet between the gate and what is looked at, s: soft releases end in it; and the least after it.
PAUSE = 1e-3
LEAST = 4e-3
# Frequencies of a plate, Hz, up to a part of the rate: filters ring near to half of it.
LOWEST = 200.0
HIGHEST = 0.3
# Energy over that of the noise: of about 6000 places one of noise alone exceeds it once in 1e7.
CLEAR = 25.0
# Energy over that of the quiet before, whose tones are no ringing.
OVER_BEFORE = 4.0
# Amplitude that is worth a warning, as part of the peak: of a plate that nothing is said of, and
# left by the correction; and the fewest oscillations.
NOTABLE = (3e-4, 1e-3)
OSCILLATIONS = 3.0


def check_ringing(contact: Contact, plate: Plate | None = None) -> tuple[str, ...]:
    """Return a warning if the plate keeps ringing after the contact, else an empty string.

    A free oscillation A exp(-t/d) cos(2 pi f t + p) is looked for by its matched filter, for some
    d and all f, in the quiet behind the gate. The density of the noise is that of the quiet, times
    what the correction of a plate makes of it.
    """
    rate, first = contact.sample_rate, contact.span[0]
    pause = int(PAUSE * rate)
    after = contact.force[contact.gate[1] - first + pause :]
    before = contact.force[: max(contact.gate[0] - first - pause, 0)][::-1]
    if len(after) < LEAST * rate:
        return ()
    frequency, energy = _matched(after, contact, plate)
    k, place = np.unravel_index(np.argmax(energy), energy.shape)
    found, decay = float(frequency[place]), float(DECAYS[k])
    quality = np.pi * found * decay
    if not (LOWEST <= found <= HIGHEST * rate and energy[k, place] > CLEAR):
        return ()
    if quality < OSCILLATIONS:
        return ()
    if len(before) >= LEAST * rate:
        usual, same = _matched(before, contact, plate)
        at = int(np.argmin(np.abs(usual - found)))
        if energy[k, place] < OVER_BEFORE * same[k, max(at - 1, 0) : at + 2].max():
            return ()
    density, _ = contact.background.density(found)
    density *= float(_gain(plate, np.array([found]))[0]) if plate else 1.0
    window = np.exp(-2 * np.arange(len(after)) / rate / decay).sum()
    amplitude = 2 * np.sqrt(energy[k, place] * density * rate / 2 / window)
    if amplitude < NOTABLE[plate is not None] * contact.peak:
        return ()
    # Between the lines of the transform: the vertex of a parabola.
    low, top, high = np.log(energy[k, place - 1 : place + 2])
    found += (frequency[1] - frequency[0]) * (low - high) / (2 * (low - 2 * top + high))
    stated = "is not the one of [plate]" if plate else "is in levels, peaks and contact time"
    told = (
        f"the plate keeps ringing after the contact, at {found:.0f} Hz with {amplitude:.2g} N: a "
        f"resonance of the plate that {stated}; state it in [plate]"
    )
    return (told,)


def _gain(plate: Plate, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what the correction of a plate makes of the density of noise, where it raises it."""
    return np.asarray(np.maximum(1 / np.abs(plate.response(frequency)) ** 2, 1.0))


def _matched(
    force: NDArray[np.float64], contact: Contact, plate: Plate | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return frequencies, Hz, and the energy of each decay there over that of the noise."""
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
