"""Decaying oscillations of a force plate after a tap: least-squares fit and its uncertainty."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from thud.recordings.free_oscillation import MIN_FREQUENCY, matched_energy, resonance
from thud.recordings.noise import MAINS

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Trial decay times to 1/e, s.
DECAYS = np.array([0.001, 0.002, 0.004, 0.008, 0.016, 0.032, 0.064])
# Maximum frequency of a resonance as a fraction of the sample rate.
MAX_FREQUENCY = 0.4
# Minimum ratio of the energy of a resonance to that of the noise. Minimum quality factor.
MIN_ENERGY = 60.0
MIN_QUALITY = 2.0
# Maximum number of resonances, and minimum amplitude as a fraction of the highest.
MAX_MODES = 4
MIN_AMPLITUDE = 0.01
# Resonances are the same if their frequencies differ by less, and the noise is taken from this
# relative distance around them.
SAME = 0.05
AROUND = 0.3
MIN_NEAR = 12
# Background: degree of the drift, its time scale, s, and columns, with those of the hum.
DEGREE = 2
TIME_SCALE = 0.1
BACKGROUND = DEGREE + 1 + 2 * len(MAINS)
# Length of a fit in decay times and in samples.
DECAY_TIMES = 10.0
MIN_LENGTH = 100
# What remains is no noise if its power around a resonance exceeds that of the noise by this factor.
# The uncertainties then include its amplitude times MISFIT_WEIGHT.
MAX_POWER = 2.0
MISFIT_WEIGHT = 2.0


class Mode(NamedTuple):
    """Natural frequency, Hz, quality factor, their relative uncertainties, and static response."""

    frequency: float
    quality: float
    frequency_uncertainty: float
    quality_uncertainty: float
    response: float


class Fit(NamedTuple):
    """Decaying oscillations: frequency, Hz, and logarithm of the decay rate, 1/s, of each.

    The factors are those of the columns; the noise is the standard deviation of the residual. The
    misfit is the amplitude of a residual that is no noise, as a fraction of the oscillation; the
    start is the index of the level from which it was fitted.
    """

    rates: NDArray[np.float64]
    factors: NDArray[np.float64]
    noise: float
    modes: list[Mode]
    misfit: float
    start: int = 0


def fit_decay(
    level: NDArray[np.float64], rate: float, delay: float, quiet: NDArray[np.float64]
) -> Fit | None:
    """Fit decaying oscillations to a level that begins at a delay, s, after a tap.

    `quiet` is the noise before the tap, empty if it is not known.
    """
    fit = None
    rates, used, log_rate = np.zeros((0, 2)), level, math.log(rate)
    while len(rates) < MAX_MODES and len(used) >= MIN_LENGTH:
        trial = _strongest(used - closest_decay(rates, used, rate)[0], rate)
        if trial is None or (np.abs(rates[:, 0] / trial[0] - 1) < SAME).any():
            break
        rates = np.vstack([rates, trial])
        length = round(DECAY_TIMES / math.exp(rates[:, 1].min()) * rate)
        used = level[: max(length, MIN_LENGTH)]
        scale = np.column_stack([np.exp(rates[:, 1]), np.ones(len(rates))])
        # Beyond these bounds the columns overflow.
        low, high = (np.tile(bound, len(rates)) for bound in ((0.0, -5.0), (rate / 2, log_rate)))
        rates = least_squares(
            _residual,
            rates.ravel(),
            bounds=(low, high),
            x_scale=scale.ravel(),
            args=(used, rate),
        )
        rates = rates.x.reshape(-1, 2)
        found = _describe(rates, used, rate, delay, quiet)
        if found is None:
            break
        fit = found
    return fit


def _residual(
    rates: NDArray[np.float64], level: NDArray[np.float64], rate: float
) -> NDArray[np.float64]:
    return level - closest_decay(rates.reshape(-1, 2), level, rate)[0]


def closest_decay(
    rates: NDArray[np.float64], level: NDArray[np.float64], rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the level of decaying oscillations that is closest to a level, and its factors."""
    columns = columns_of(rates, np.arange(len(level)) / rate)
    factors = np.asarray(np.linalg.lstsq(columns, level, rcond=None)[0], dtype=np.float64)
    return columns @ factors, factors


def columns_of(rates: NDArray[np.float64], time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the columns of a background and of decaying oscillations at times, s."""
    columns = [(time / TIME_SCALE) ** power for power in range(DEGREE + 1)]
    steady = [(frequency, -np.inf) for frequency in MAINS]
    for frequency, log_decay in [*steady, *rates]:
        decaying = np.exp(-np.exp(log_decay) * time)
        phase = 2 * np.pi * frequency * time
        columns += [decaying * np.cos(phase), decaying * np.sin(phase)]
    return np.column_stack(columns)


def _strongest(level: NDArray[np.float64], rate: float) -> tuple[float, float] | None:
    """Return frequency, Hz, and logarithm of the decay rate of the strongest oscillation.

    Its energy is compared with the usual one, that of the noise.
    """
    frequency, energy = matched_energy(level, rate, DECAYS)
    energy = energy[:, (frequency >= MIN_FREQUENCY) & (frequency <= MAX_FREQUENCY * rate)]
    k, index = np.unravel_index(np.argmax(energy), energy.shape)
    if not energy[k, index] > MIN_ENERGY * np.median(energy[k]):
        return None
    first = int(np.searchsorted(frequency, MIN_FREQUENCY))
    return float(frequency[first + index]), -math.log(DECAYS[k])


def _describe(
    rates: NDArray[np.float64],
    level: NDArray[np.float64],
    rate: float,
    delay: float,
    quiet: NDArray[np.float64],
) -> Fit | None:
    """Return a fit with its resonances; None if one of them is none."""
    fitted, factors = closest_decay(rates, level, rate)
    time = np.arange(len(level)) / rate
    columns, waves = columns_of(rates, time), factors[BACKGROUND:].reshape(-1, 2)
    slopes = []
    pairs = np.split(columns[:, BACKGROUND:], len(rates), axis=1)
    for (_, log_decay), (cosine, sine), pair in zip(rates, waves, pairs, strict=True):
        slopes += [
            2 * np.pi * time * (pair @ [sine, -cosine]),
            -math.exp(log_decay) * time * (pair @ [cosine, sine]),
        ]
    jacobian = np.column_stack([*slopes, columns])
    scale = np.linalg.norm(jacobian, axis=0)
    inverse = np.linalg.pinv(jacobian / scale) / scale[:, None]
    residual = level - fitted
    frequencies, power = _spectrum(residual, rate)
    quiet_frequencies, quiet_power = _spectrum(quiet, rate)
    modes, misfits = [], []
    for k, (frequency, log_decay) in enumerate(rates):
        decay = math.exp(min(log_decay, 50.0))
        natural, quality = resonance(frequency, 1 / decay)
        if not (MIN_FREQUENCY <= natural <= MAX_FREQUENCY * rate and quality > MIN_QUALITY):
            return None
        # Of colored noise that around the resonance counts.
        near = power[np.abs(frequencies / natural - 1) < AROUND]
        # An oscillation takes two values from the residual, the other columns one each.
        noise = math.sqrt(
            float(near.sum()) / (near.size - 2)
            if near.size >= MIN_NEAR
            else float(residual @ residual) / (len(level) - jacobian.shape[1])
        )
        usual = quiet_power[np.abs(quiet_frequencies / natural - 1) < AROUND]
        excess = 0.0
        if usual.size and noise**2 > MAX_POWER * usual.mean():
            # A frequency of a real signal counts twice.
            excess = math.sqrt(max(2 * float((near - usual.mean()).sum()), 0.0))
        misfits.append(excess / float(np.linalg.norm(pairs[k] @ waves[k])))
        # Noise is distributed over all samples, a misfit is not.
        noise = math.hypot(noise, MISFIT_WEIGHT * excess)
        deviation = noise * np.linalg.norm(inverse[2 * k : 2 * k + 2], axis=1)
        amplitude = float(np.hypot(*waves[k])) * math.exp(decay * delay)
        u_frequency = float(deviation[0]) / natural
        u_quality = math.hypot(u_frequency, float(deviation[1]))
        modes.append(Mode(natural, quality, u_frequency, u_quality, amplitude / natural))
    if min(mode.response * mode.frequency for mode in modes) < MIN_AMPLITUDE * max(
        mode.response * mode.frequency for mode in modes
    ):
        return None
    modes.sort(key=lambda mode: -mode.response)
    return Fit(rates, factors, math.sqrt(float(power.mean())), modes, max(misfits))


def _spectrum(
    values: NDArray[np.float64], rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return frequencies, Hz, and power; that of white noise is its variance at each of them."""
    if not values.size:
        return np.zeros(0), np.zeros(0)
    power = np.abs(np.fft.rfft(values)) ** 2 / len(values)
    return np.asarray(np.fft.rfftfreq(len(values), 1 / rate), dtype=np.float64), power
