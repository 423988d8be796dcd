"""Decaying oscillations Re(a exp(s t)) of a force plate: least-squares fit of their poles s."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.special import fdtrc

from thud.recordings.background import MAINS
from thud.recordings.ringing import MIN_FREQUENCY, matched_energy

if TYPE_CHECKING:
    from numpy.typing import NDArray

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
    noise = quiet - _fit(quiet, np.zeros((0, 2)), rate)[0] if quiet.size else quiet
    modes, parameters, used = None, np.zeros((0, 2)), level
    while len(parameters) < MAX_MODES and len(used) >= MIN_LENGTH:
        trial = _strongest(used - _fit(used, parameters, rate)[0], rate)
        if trial is None or (np.abs(parameters[:, 0] / trial[0] - 1) < SAME).any():
            break
        parameters = np.vstack([parameters, trial])
        length = round(DECAY_TIMES / math.exp(parameters[:, 1].min()) * rate)
        used = level[: max(length, MIN_LENGTH)]
        parameters, inverse = _optimize(used, parameters, rate)
        quality = np.pi * np.hypot(parameters[:, 0], np.exp(parameters[:, 1]) / (2 * np.pi))
        if (quality < MIN_QUALITY * np.exp(parameters[:, 1])).any():
            break
        modes = _describe(used, parameters, inverse, rate, noise)
    return modes


def _fit(
    level: NDArray[np.float64], parameters: NDArray[np.float64], rate: float
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Return the oscillations, a drift and hum that are closest to a level, and the amplitudes.

    The parameters of an oscillation are its frequency, Hz, and the logarithm of its decay rate,
    1/s.
    """
    time = np.arange(len(level)) / rate
    frequencies = np.append(parameters[:, 0], MAINS)
    decays = np.append(np.exp(parameters[:, 1]), np.zeros(len(MAINS)))
    waves = np.exp(np.outer(time, 2j * np.pi * frequencies - decays))
    drift = np.vander(time * rate / len(level), DEGREE + 1)
    columns = np.hstack([waves.real, -waves.imag, drift])
    factors = np.linalg.lstsq(columns, level, rcond=None)[0]
    real, imaginary = factors[: 2 * len(frequencies)].reshape(2, -1)
    return columns @ factors, (real + 1j * imaginary)[: len(parameters)]


def _optimize(
    level: NDArray[np.float64], parameters: NDArray[np.float64], rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the parameters of least squares, and their covariance for noise of variance one."""
    low = np.tile([MIN_FREQUENCY, 0.0], len(parameters))
    high = np.tile([MAX_FREQUENCY * rate, math.log(rate)], len(parameters))
    solution = least_squares(
        lambda x: level - _fit(level, x.reshape(-1, 2), rate)[0],
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
    fitted, amplitudes = _fit(level, parameters, rate)
    frequencies, power = _spectrum(level - fitted, rate)
    quiet_frequencies, quiet_power = _spectrum(quiet, rate)
    deviations = np.sqrt(np.diagonal(inverse)).reshape(-1, 2)
    modes = []
    for (frequency, log_decay), amplitude, deviation in zip(
        parameters, np.abs(amplitudes), deviations, strict=True
    ):
        decay = math.exp(log_decay)
        natural = math.hypot(frequency, decay / (2 * math.pi))
        near = power[np.abs(frequencies / natural - 1) < AROUND]
        usual = quiet_power[np.abs(quiet_frequencies / natural - 1) < AROUND]
        # An oscillation takes two values from the residual.
        count = max(near.size - 2, 1)
        noise, excess = math.sqrt(float(near.sum()) / count), 0.0
        if usual.size:
            ratio = float(near.sum() / count / usual.mean())
            # A frequency of a real signal has two values.
            if fdtrc(2 * count, 2 * usual.size, ratio) < NOISE_PROBABILITY:
                excess = math.sqrt(max(2 * float(near.sum() - near.size * usual.mean()), 0.0))
        # Noise is distributed over all samples, a misfit is not.
        u_frequency, u_decay = deviation * math.hypot(noise, MISFIT_WEIGHT * excess)
        u_frequency /= natural
        u_quality = math.hypot(u_frequency, u_decay)
        # The sum of the squares of the oscillation is that of its amplitude times rate / (4 decay).
        misfit = excess / float(amplitude) / math.sqrt(rate / (4 * decay))
        quality = math.pi * natural / decay
        modes.append(Mode(natural, quality, u_frequency, u_quality, float(amplitude), misfit))
    return modes


def _spectrum(
    values: NDArray[np.float64], rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return frequencies, Hz, and power; that of white noise is its variance at each of them."""
    power = np.abs(np.fft.rfft(values, max(len(values), 1))) ** 2 / max(len(values), 1)
    frequency = np.fft.rfftfreq(max(len(values), 1), 1 / rate)
    return np.asarray(frequency[1:], dtype=np.float64), np.asarray(power[1:])
