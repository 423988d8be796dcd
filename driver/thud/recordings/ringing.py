"""Free oscillations a exp(-t/d) cos(2 pi f t + p) of a force plate: ringing after a contact."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.fft import next_fast_len
from scipy.optimize import least_squares

from thud.recordings.background import MAINS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.contact import Contact
    from thud.recordings.drops import Section
    from thud.recordings.instruments import Chain, Plate

# Minimum frequency of a resonance of a plate, Hz, maximum as a fraction of the sample rate, and
# trial decay times to 1/e, s.
MIN_FREQUENCY = 200.0
HIGHEST = 0.4
DECAYS = np.array([0.001, 0.002, 0.004, 0.008, 0.016, 0.032, 0.064])
# Degree of the drift that is fitted together with oscillations, and maximum number of evaluations
# of a least-squares fit; one of a resonance takes about 10.
DEGREE = 2
MAX_EVALUATIONS = 20
# Trial decay times of a ringing: shorter ones are those of soft releases.
RINGING_DECAYS = DECAYS[1:-1]
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


class Ringing(NamedTuple):
    """A free oscillation of the plate after a contact: resonance, Hz, quality, and amplitude, N."""

    frequency: float
    quality: float
    amplitude: float


def find_ringing(contact: Contact, chain: Chain | None = None) -> Ringing | None:
    """Return the ringing of the plate after a contact, None if there is none.

    A matched filter searches a free oscillation A exp(-t/d) cos(2 pi f t + p) after the gate, for
    the decay times d and all frequencies f. Its energy is compared with that of the noise, with the
    density of the background times the gain of the correction, and with that before the contact.
    Frequency and quality are those of the oscillation of least squares.
    """
    rate, pause = contact.sample_rate, int(PAUSE * contact.sample_rate)
    first, stop = contact.gate
    after, before = contact.force[stop + pause :], contact.force[: max(first - pause, 0)][::-1]
    if len(after) < MIN_LENGTH * rate:
        return None
    frequencies, energies = matched_energy(after, rate, RINGING_DECAYS)
    frequencies, energies = frequencies[1:], energies[:, 1:]
    noise = contact.background.density(frequencies) * rate / 2
    if chain is not None:
        noise *= np.maximum(np.abs(chain.response(frequencies)) ** -2, 1.0)
    k, index = np.unravel_index(np.argmax(energies / noise), energies.shape)
    frequency, decay, energy = frequencies[index], RINGING_DECAYS[k], energies[k, index]
    if not (
        MIN_FREQUENCY <= frequency <= MAX_FREQUENCY * rate
        and energy > MIN_ENERGY * noise[index]
        and np.pi * frequency * decay > MIN_QUALITY
    ):
        return None
    if len(before) >= MIN_LENGTH * rate:
        earlier, tones = matched_energy(before, rate, RINGING_DECAYS[k : k + 1])
        if energy < MIN_INCREASE * np.interp(frequency, earlier, tones[0]):
            return None
    window = np.exp(-2 * np.arange(len(after)) / rate / decay).sum()
    amplitude = 2 * math.sqrt(energy / window)
    if amplitude < MIN_AMPLITUDE[chain is not None] * contact.background.peak:
        return None
    start, ringing = np.array([[frequency, -math.log(decay)]]), after[: int(LENGTH * decay * rate)]
    ((fitted, log_rate),), _ = fit_oscillations(ringing, start, rate)
    if abs(fitted / frequency - 1) < MAX_SHIFT:  # else it is another oscillation
        frequency, decay = fitted, math.exp(-log_rate)
    return Ringing(*resonance(frequency, decay), amplitude)


def is_in_record(recorded: Section, contact: Contact, plate: Plate) -> bool | None:
    """Return whether the resonance of a stated plate is in the recorded force; None if unclear.

    It is if the recorded force rings at its frequency. Else the energy of the pulse near the
    resonance is compared with that below and above it: where the plate resonates, the recorded
    force has more, and the corrected force as much; where it does not, the corrected force has
    less. This is unclear if noise hides the difference.
    """
    rate = contact.sample_rate
    as_recorded = recorded.force[contact.start :][: len(contact.force)]
    raw = replace(contact, force=as_recorded - contact.removed)
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


def resonance(frequency: float, decay_time: float) -> tuple[float, float]:
    """Return the resonance, Hz, and the quality factor of a mode from its free oscillation.

    A damped mode oscillates at a frequency, Hz, below its resonance; the amplitude falls to 1/e
    within the decay time, s.
    """
    natural = math.hypot(frequency, 1 / (2 * math.pi * decay_time))
    return natural, math.pi * natural * decay_time


def matched_energy(
    level: NDArray[np.float64], rate: float, decay_times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return frequencies, Hz, and the energy of a matched filter, shape (n_decay, n_frequency).

    The filter searches a free oscillation that begins with the level. Of white noise the energy is
    its variance at every frequency and decay time, s.
    """
    windows = np.exp(-np.arange(len(level)) / rate / decay_times[:, None])
    length = next_fast_len(2 * len(level), real=True)
    energy = np.abs(np.fft.rfft(windows * level, length)) ** 2 / (windows**2).sum(axis=1)[:, None]
    frequency = np.fft.rfftfreq(length, 1 / rate)
    return np.asarray(frequency, dtype=np.float64), np.asarray(energy)


def closest(
    level: NDArray[np.float64], parameters: NDArray[np.float64], rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the oscillations, with drift and hum, that are closest to a level; their amplitudes.

    The parameters of each are its frequency, Hz, and the logarithm of its decay rate, 1/s.
    """
    time = np.arange(len(level)) / rate
    frequencies = np.append(parameters[:, 0], MAINS)
    decays = np.append(np.exp(parameters[:, 1]), np.zeros(len(MAINS)))
    waves = np.exp(np.outer(time, 2j * np.pi * frequencies - decays))
    drift = np.vander(time * rate / len(level), DEGREE + 1)
    columns = np.hstack([waves.real, -waves.imag, drift])
    factors = np.linalg.lstsq(columns, level, rcond=None)[0]
    amplitudes = np.hypot(*factors[: 2 * len(frequencies)].reshape(2, -1))
    return columns @ factors, amplitudes[: len(parameters)]


def fit_oscillations(
    level: NDArray[np.float64], parameters: NDArray[np.float64], rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the parameters of least squares, and their covariance for noise of variance one.

    They begin with `parameters`, shape (n, 2): frequencies, Hz, and logarithms of decay rates, 1/s.
    Drift and hum are fitted, too.
    """
    low = np.tile([MIN_FREQUENCY, 0.0], len(parameters))
    high = np.tile([HIGHEST * rate, math.log(rate)], len(parameters))
    solution = least_squares(
        lambda x: level - closest(level, x.reshape(-1, 2), rate)[0],
        np.clip(parameters.ravel(), low, high),
        bounds=(low, high),
        x_scale=np.column_stack([np.exp(parameters[:, 1]), np.ones(len(parameters))]).ravel(),
        max_nfev=MAX_EVALUATIONS,
    )
    return solution.x.reshape(-1, 2), np.linalg.pinv(solution.jac.T @ solution.jac)
