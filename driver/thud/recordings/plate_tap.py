"""Resonance of a force plate from taps with a hammer."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.signal import find_peaks
from scipy.special import chdtrc, fdtrc, stdtrit

from thud.base.checks import refuse
from thud.base.note import Note
from thud.level.estimate import NORMAL_FACTOR
from thud.recordings import ringing
from thud.recordings.calibration import open_source
from thud.recordings.ringing import closest, resonance

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    from thud.recordings.signal import Signal

    Tap = tuple[NDArray[np.float64], NDArray[np.float64]]

# Minimum quality factor of a resonance, minimum ratio of its energy to that of the noise, and
# maximum number of resonances.
MIN_QUALITY = 2.0
MIN_ENERGY = 60.0
MAX_MODES = 4
# Resonances are the same if their frequencies differ by less, and the noise is taken from this
# relative distance around them.
SAME = 0.05
AROUND = 0.3
# Length of a fit in decay times, and its minimum in samples.
DECAY_TIMES = 10.0
MIN_LENGTH = 100
# Probability of noise below which what remains of a fit is no noise. The uncertainties then include
# its amplitude times MISFIT_WEIGHT.
NOISE_PROBABILITY = 0.01
MISFIT_WEIGHT = 2.0
# Power of a record without noise.
TINY = 1e-300
# Maximum number of samples of a record, and minimum sample rate, Hz.
MAX_SAMPLES = 2**24
MIN_RATE = 2000.0
# Minimum height of a tap in medians of the magnitude of the level (7 standard deviations of noise),
# and as a fraction of the largest; minimum time between taps, s, within which a plate rings.
MIN_RISE = 10.0
MIN_HEIGHT = 0.1
APART = 0.1
# Longest time, s, from the peak of a tap to the end of the contact and to that of its section, and
# of its noise before it.
CONTACT = 6e-3
AFTER = 0.5
BEFORE = 0.1
# Times, s, from the peak at which a contact may have ended.
STARTS = (1e-3, 1.5e-3, 2e-3, 3e-3, 4e-3)
# Fraction of the ringing from which on a warning states what remains of it.
MIN_MISFIT = 0.01
# Relative standard uncertainty of the clock of a recorder.
CLOCK = 1e-4
# Minimum relative uncertainty of a tap, by rounding, and maximum one of the frequency.
MIN_UNCERTAINTY = 1e-12
MAX_UNCERTAINTY = 0.05
# Probability below which the taps differ by more than their noise.
SIGNIFICANT = 0.05


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


@dataclass(frozen=True)
class TappedPlate:
    """Resonance of a force plate from taps.

    Attributes
    ----------
    frequency, quality : float
        Natural frequency, Hz, and quality factor.
    frequency_uncertainty, quality_uncertainty : float
        Their relative standard uncertainties; that of the frequency includes 1e-4 for the clock of
        the recorder.
    count : int
        Number of taps.
    others : tuple of float
        Frequencies of further resonances, Hz.
    name : str
        Name of the record.
    notes : tuple of Note
        Possible faults of the taps.
    """

    frequency: float
    quality: float
    frequency_uncertainty: float
    quality_uncertainty: float
    count: int
    others: tuple[float, ...]
    name: str
    notes: tuple[Note, ...] = ()

    def lines(self) -> str:
        """Return the lines of a configuration, the table ``[plate]``."""
        return (
            f"[plate]\nf0 = {self.frequency:.6g}\nQ = {self.quality:.4g}\n"
            f"f0_uncertainty = {self.frequency_uncertainty:.2g}"
        )

    def __str__(self) -> str:
        """Return a sentence for reports."""
        taps = f"{self.count} tap{'s' * (self.count > 1)} in {self.name}"
        text = f"{taps}: Q within {100 * self.quality_uncertainty:.2g} % (standard uncertainty)"
        text += f"; f0_uncertainty includes {100 * CLOCK:g} % for the clock of the recorder"
        if self.others:
            text += f"; also resonances at {', '.join(f'{other:.4g}' for other in self.others)} Hz"
        return text


def calibrate_tap(
    record: Signal | str | os.PathLike[str], *, channel: int | str | None = None
) -> TappedPlate:
    """Return the resonance of a force plate from a record of one or more taps with a hammer.

    Decaying oscillations are fitted to what follows each tap. The resonance is the one with the
    largest static response.

    Parameters
    ----------
    record
        File, or a signal, in any unit.
    channel
        Number or name of the channel of a file.

    Returns
    -------
    TappedPlate
        Weighted mean of the taps with the uncertainty due to noise or, if the taps differ by more,
        mean with that from their scatter. Taps after which more remains than noise, as of a hammer
        that hits twice, do not count if there are others.

    Raises
    ------
    InputError
        If the record has no tap, or no resonance stands out.
    """
    signal, _, _ = open_source(record, channel)
    name, rate = signal.name, signal.sample_rate
    if not rate >= MIN_RATE:
        refuse(f"{name}: the sample rate is unknown or low", f"{MIN_RATE:g} Hz or more")
    if signal.n_sample > MAX_SAMPLES:
        refuse(f"{name}: {signal.n_sample} samples", f"up to {MAX_SAMPLES} samples")
    level = signal.read(0, signal.n_sample)
    # Fits of very large or small numbers overflow.
    taps = _find_taps(level / (np.abs(level).max(initial=0.0) or 1.0), rate, name)
    fits = [modes for tap in taps if (modes := _fit_tap(tap, rate))]
    if not fits:
        problem = f"{name}: no resonance stands out after {len(taps)} tap{'s' * (len(taps) > 1)}"
        refuse(problem, "a tap of a hard hammer after which the plate rings")
    fits = [modes for modes in fits if not _misfit(modes)] or fits
    # Weaker taps may show another resonance first.
    strongest = max(itertools.chain(*fits), key=lambda mode: mode.amplitude / mode.frequency)

    def shift(mode: Mode) -> float:
        return abs(mode.frequency / strongest.frequency - 1)

    fits = [modes for modes in fits if shift(min(modes, key=shift)) < SAME]
    firsts = [min(modes, key=shift) for modes in fits]
    frequency, u_frequency = _mean([(m.frequency, m.frequency_uncertainty) for m in firsts])
    quality, u_quality = _mean([(m.quality, m.quality_uncertainty) for m in firsts])
    if not u_frequency <= MAX_UNCERTAINTY:
        known = f"the resonance near {frequency:.4g} Hz is known to {100 * u_frequency:.2g} %"
        refuse(f"{name}: {known} only", f"an uncertainty up to {MAX_UNCERTAINTY:.0%}")
    misfit, others = _misfit(firsts), [m for m in max(fits, key=len) if shift(m) >= SAME]
    return TappedPlate(
        frequency, quality, math.hypot(u_frequency, CLOCK), u_quality, len(firsts),
        tuple(mode.frequency for mode in others), name,
        (Note("tap_misfit", name, misfit),) if misfit > MIN_MISFIT else (),
    )  # fmt: skip


def _mean(estimates: list[tuple[float, float]]) -> tuple[float, float]:
    """Return the geometric mean of values with relative uncertainties, and its uncertainty."""
    values, deviations = np.transpose(estimates)
    value, weight = np.log(values), 1 / np.maximum(deviations, MIN_UNCERTAINTY) ** 2
    mean, count = float(weight @ value / weight.sum()), len(values)
    if count == 1 or chdtrc(count - 1, weight @ (value - mean) ** 2) >= SIGNIFICANT:
        return math.exp(mean), 1 / math.sqrt(weight.sum())
    factor = float(stdtrit(count - 1, 0.975)) / NORMAL_FACTOR
    return math.exp(value.mean()), factor * float(value.std(ddof=1)) / math.sqrt(count)


def _find_taps(level: NDArray[np.float64], rate: float, name: str) -> list[Tap]:
    """Return the level from the peak of each tap on, and before it.

    Raise InputError if there is none.
    """
    # Zeros on both sides end a pulse that is cut off.
    pulses = np.pad(np.abs(level - np.median(level)), 1) if level.size else np.zeros(2)
    height = max(MIN_RISE * float(np.median(pulses)), MIN_HEIGHT * float(pulses.max()))
    peaks, found = find_peaks(pulses, prominence=height, distance=round(APART * rate), width=0)
    if not peaks.size:
        refuse(f"{name}: no tap", "a record in which a hammer taps the plate")
    tops = peaks[found["widths"] <= CONTACT * rate] - 1
    if not tops.size:
        problem = f"the plate is pressed for more than {1e3 * CONTACT:g} ms, as by a drop"
        refuse(f"{name}: no tap, but {problem}", "a record in which a hard hammer taps the plate")
    contact, before, after = (round(length * rate) for length in (CONTACT, BEFORE, AFTER))
    ends = [*(tops[1:] - contact), len(level)]
    # The second half of what lies between two taps is quiet.
    quiet = [0, *(tops[1:] + tops[:-1]) // 2]
    return [
        (
            level[top : min(end, top + after)],
            level[max(start, top - before) : max(top - contact, 0)],
        )
        for top, start, end in zip(tops, quiet, ends, strict=True)
    ]


def _fit_tap(tap: Tap, rate: float) -> list[Mode]:
    """Return the modes that ring after a tap, with amplitudes at its peak.

    If what remains is noise after each contact has ended, the fit begins as early as it is.
    """
    late: list[Mode] = []
    after, before = tap
    for start in (CONTACT, *STARTS):
        modes = [
            mode._replace(amplitude=mode.amplitude * math.exp(math.pi * start * f / mode.quality))
            for mode in fit_modes(after[round(start * rate) :], rate, before)
            if (f := mode.frequency)
        ]
        if start == CONTACT:
            late = modes
            if len(before) < MIN_LENGTH or _misfit(late):
                break
        elif modes and not _misfit(modes):
            return modes
    return late


def _misfit(modes: list[Mode]) -> float:
    return max((mode.misfit for mode in modes), default=0.0)


def fit_modes(level: NDArray[np.float64], rate: float, quiet: NDArray[np.float64]) -> list[Mode]:
    """Return decaying oscillations fitted to a level sampled at a rate, Hz, if any stands out.

    `quiet` is the level before they begin; what remains of the fit is compared with its noise.
    """
    is_known = len(quiet) >= MIN_LENGTH
    noise = quiet - closest(quiet, np.zeros((0, 2)), rate)[0] if is_known else np.empty(0)
    modes: list[Mode] = []
    parameters, used = np.zeros((0, 2)), level
    while len(parameters) < MAX_MODES and len(used) >= MIN_LENGTH:
        trial = _strongest(used - closest(used, parameters, rate)[0], rate)
        if trial is None or (np.abs(parameters[:, 0] / trial[0] - 1) < SAME).any():
            break
        parameters = np.vstack([parameters, trial])
        length = round(DECAY_TIMES / math.exp(parameters[:, 1].min()) * rate)
        used = level[: max(length, MIN_LENGTH)]
        parameters, inverse = ringing.fit_oscillations(used, parameters, rate)
        if any(resonance(f, math.exp(-decay))[1] < MIN_QUALITY for f, decay in parameters):
            break
        modes = _describe(used, parameters, inverse, rate, noise)
    return modes


def _strongest(level: NDArray[np.float64], rate: float) -> tuple[float, float] | None:
    """Return the parameters of the strongest oscillation; None if it does not exceed the noise."""
    frequency, energy = ringing.matched_energy(level, rate, ringing.DECAYS)
    inside = (frequency >= ringing.MIN_FREQUENCY) & (frequency <= ringing.HIGHEST * rate)
    frequency, energy = frequency[inside], energy[:, inside]
    k, index = np.unravel_index(np.argmax(energy), energy.shape)
    if not energy[k, index] > MIN_ENERGY * np.median(energy[k]):
        return None
    return float(frequency[index]), -math.log(ringing.DECAYS[k])


def _describe(
    level: NDArray[np.float64],
    parameters: NDArray[np.float64],
    inverse: NDArray[np.float64],
    rate: float,
    quiet: NDArray[np.float64],
) -> list[Mode]:
    """Return the modes of a fit; their uncertainties are those by the noise around each."""
    fitted, amplitudes = closest(level, parameters, rate)
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
    count = max(len(values), 1)
    power = np.abs(np.fft.rfft(values, count)) ** 2 / count
    return np.asarray(np.fft.rfftfreq(count, 1 / rate)[1:]), np.asarray(power[1:])
