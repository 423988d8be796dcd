"""Free oscillations a exp(-t/d) cos(2 pi f t + p) of a force plate: least-squares fits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.fft import next_fast_len
from scipy.optimize import least_squares
from scipy.special import fdtrc

from thud.recordings.background import MAINS

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Minimum frequency of a resonance of a plate, Hz.
MIN_FREQUENCY = 200.0
# Trial decay times to 1/e, s.
DECAYS = np.array([0.001, 0.002, 0.004, 0.008, 0.016, 0.032, 0.064])
# Maximum frequency of a resonance as a fraction of the sample rate; minimum quality factor; minimum
# ratio of its energy to that of the noise; maximum number of resonances.
MAX_FREQUENCY = 0.4
MIN_QUALITY = 2.0
MIN_ENERGY = 60.0
MAX_MODES = 4
# Resonances are the same if their frequencies differ by less, and the noise is taken from this
# relative distance around them.
SAME = 0.05
AROUND = 0.3
# Degree of the drift.
DEGREE = 2
# Length of a fit in decay times, and its minimum in samples.
DECAY_TIMES = 10.0
MIN_LENGTH = 100
# Maximum number of evaluations of a least-squares fit; one of a resonance takes about 10.
MAX_EVALUATIONS = 20
# Probability of noise below which what remains of a fit is no noise. The uncertainties then include
# its amplitude times MISFIT_WEIGHT.
NOISE_PROBABILITY = 0.01
MISFIT_WEIGHT = 2.0
# Power of a record without noise.
TINY = 1e-300


class Mode(NamedTuple):
    """A resonance: natural frequency, Hz, quality factor, and their relative uncertainties.

    The amplitude is that at the begin of the level. The misfit is the amplitude of what remains and
    is no noise, as a fraction of the oscillation.
    """

    frequency: float
    quality: float
    frequency_uncertainty: float
    quality_uncertainty: float
    amplitude: float
    misfit: float


def fit_modes(
    level: NDArray[np.float64], rate: float, quiet: NDArray[np.float64]
) -> list[Mode] | None:
    """Fit decaying oscillations to a level sampled at a rate, Hz.

    `quiet` is the level before they begin; what remains of the fit is compared with its noise.
    Return None if no resonance stands out.
    """
    noise = quiet - _closest(quiet, np.zeros((0, 2)), rate)[0] if quiet.size else quiet
    modes, parameters, used = None, np.zeros((0, 2)), level
    while len(parameters) < MAX_MODES and len(used) >= MIN_LENGTH:
        trial = _strongest(used - _closest(used, parameters, rate)[0], rate)
        if trial is None or (np.abs(parameters[:, 0] / trial[0] - 1) < SAME).any():
            break
        parameters = np.vstack([parameters, trial])
        length = round(DECAY_TIMES / math.exp(parameters[:, 1].min()) * rate)
        used = level[: max(length, MIN_LENGTH)]
        parameters, inverse = fit_oscillations(used, parameters, rate)
        if any(resonance(f, math.exp(-decay))[1] < MIN_QUALITY for f, decay in parameters):
            break
        modes = _describe(used, parameters, inverse, rate, noise)
    return modes


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


def _closest(
    level: NDArray[np.float64],
    parameters: NDArray[np.float64],
    rate: float,
    *,
    background: bool = True,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the oscillations that are closest to a level, and their amplitudes.

    The parameters of each are its frequency, Hz, and the logarithm of its decay rate, 1/s. With a
    `background`, drift and hum are fitted, too.
    """
    time = np.arange(len(level)) / rate
    hum = MAINS if background else ()
    frequencies = np.append(parameters[:, 0], hum)
    decays = np.append(np.exp(parameters[:, 1]), np.zeros(len(hum)))
    waves = np.exp(np.outer(time, 2j * np.pi * frequencies - decays))
    drift = np.vander(time * rate / len(level), DEGREE + 1 if background else 0)
    columns = np.hstack([waves.real, -waves.imag, drift])
    factors = np.linalg.lstsq(columns, level, rcond=None)[0]
    amplitudes = np.hypot(*factors[: 2 * len(frequencies)].reshape(2, -1))
    return columns @ factors, amplitudes[: len(parameters)]


def fit_oscillations(
    level: NDArray[np.float64],
    parameters: NDArray[np.float64],
    rate: float,
    *,
    background: bool = True,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the parameters of least squares, and their covariance for noise of variance one.

    They begin with `parameters`, shape (n, 2): frequencies, Hz, and logarithms of decay rates, 1/s.
    With a `background`, drift and hum are fitted, too.
    """
    low = np.tile([MIN_FREQUENCY, 0.0], len(parameters))
    high = np.tile([MAX_FREQUENCY * rate, math.log(rate)], len(parameters))
    solution = least_squares(
        lambda x: level - _closest(level, x.reshape(-1, 2), rate, background=background)[0],
        np.clip(parameters.ravel(), low, high),
        bounds=(low, high),
        x_scale=np.column_stack([np.exp(parameters[:, 1]), np.ones(len(parameters))]).ravel(),
        max_nfev=MAX_EVALUATIONS,
    )
    return solution.x.reshape(-1, 2), np.linalg.pinv(solution.jac.T @ solution.jac)


def _strongest(level: NDArray[np.float64], rate: float) -> tuple[float, float] | None:
    """Return the parameters of the strongest oscillation; None if it does not exceed the noise."""
    frequency, energy = matched_energy(level, rate, DECAYS)
    inside = (frequency >= MIN_FREQUENCY) & (frequency <= MAX_FREQUENCY * rate)
    frequency, energy = frequency[inside], energy[:, inside]
    k, index = np.unravel_index(np.argmax(energy), energy.shape)
    if not energy[k, index] > MIN_ENERGY * np.median(energy[k]):
        return None
    return float(frequency[index]), -math.log(DECAYS[k])


def _describe(
    level: NDArray[np.float64],
    parameters: NDArray[np.float64],
    inverse: NDArray[np.float64],
    rate: float,
    quiet: NDArray[np.float64],
) -> list[Mode]:
    """Return the modes of a fit; their uncertainties are those by the noise around each."""
    fitted, amplitudes = _closest(level, parameters, rate)
    frequencies, power = _spectrum(level - fitted, rate)
    quiet_frequencies, quiet_power = _spectrum(quiet, rate)
    deviations = np.sqrt(np.diagonal(inverse)).reshape(-1, 2)
    modes = []
    for (frequency, log_decay), amplitude, deviation in zip(
        parameters, amplitudes, deviations, strict=True
    ):
        decay = math.exp(log_decay)
        natural, quality = resonance(frequency, 1 / decay)
        near = power[np.abs(frequencies / natural - 1) < AROUND]
        usual = quiet_power[np.abs(quiet_frequencies / natural - 1) < AROUND]
        # An oscillation takes two values from the residual.
        count = max(near.size - 2, 1)
        noise, excess = math.sqrt(float(near.sum()) / count), 0.0
        if usual.size:
            ratio = float(near.sum() / count / max(usual.mean(), TINY))
            # A frequency of a real signal has two values.
            if fdtrc(2 * count, 2 * usual.size, ratio) < NOISE_PROBABILITY:
                excess = math.sqrt(max(2 * float(near.sum() - near.size * usual.mean()), 0.0))
        # Noise is distributed over all samples, a misfit is not.
        u_frequency, u_decay = deviation * math.hypot(noise, MISFIT_WEIGHT * excess)
        u_frequency /= natural
        u_quality = math.hypot(u_frequency, u_decay)
        # The sum of the squares of the oscillation is that of its amplitude times rate / (4 decay).
        misfit = excess / float(amplitude) / math.sqrt(rate / (4 * decay))
        modes.append(Mode(natural, quality, u_frequency, u_quality, float(amplitude), misfit))
    return modes


def _spectrum(
    values: NDArray[np.float64], rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return frequencies, Hz, and power; that of white noise is its variance at each of them."""
    power = np.abs(np.fft.rfft(values, max(len(values), 1))) ** 2 / max(len(values), 1)
    frequency = np.fft.rfftfreq(max(len(values), 1), 1 / rate)
    return np.asarray(frequency[1:], dtype=np.float64), np.asarray(power[1:])
