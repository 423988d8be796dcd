"""Resonance of a force plate from taps with a hammer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.fft import next_fast_len
from scipy.special import chdtrc, stdtrit

from thud.base.checks import refuse
from thud.level.estimate import NORMAL_FACTOR
from thud.recordings.calibration import open_source
from thud.recordings.decay_fit import (
    MAX_FREQUENCY,
    MIN_LENGTH,
    SAME,
    Fit,
    closest_decay,
    columns_of,
    fit_decay,
)
from thud.recordings.plate import Plate

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    from thud.recordings.signal import Signal

# Maximum number of samples of a record, and minimum sample rate, Hz.
MAX_SAMPLES = 2**24
MIN_RATE = 2000.0
# Cells, s, in which taps are searched. The range of the level in a tap exceeds MIN_RISE times the
# usual one, and MIN_HEIGHT of the largest; between two taps it does not for QUIET, s.
CELL = 1e-3
MIN_RISE = 4.0
MIN_HEIGHT = 0.1
QUIET = 0.03
# Longest time from the peak of a tap to the end of the contact and to that of its section, s.
CONTACT = 6e-3
AFTER = 0.5
# Times after the peak from which the ringing is fitted in turn, s, until what remains is noise: the
# hammer may have touched the plate again.
WAITS = (CONTACT, 12e-3, 20e-3, 32e-3, 50e-3)
# Time before a tap from which its noise is known, s, and fraction of an oscillation from which on a
# warning states what remains of it.
BEFORE = 0.1
MIN_MISFIT = 0.01
# Relative standard uncertainty of the clock of a recorder.
CLOCK = 1e-4
# The contact ends where the level differs from the decaying resonance by this fraction of the peak
# or by this many standard deviations of the noise, and a margin, s.
MIN_CONTACT = 0.01
NOISE_LEVEL = 4.0
MARGIN = 2e-4
# An antiresonance is possible where the spectrum is below POSSIBLE of its maxima within a factor of
# NEAR on both sides, unless these are below CLEAR times the noise, in all taps. It is one if it is
# below ZERO in each at frequencies that scatter by less than SAME_ZERO, although the spectra
# differ: the logarithms of their decreases by more than DIFFERENT.
POSSIBLE = 0.6
ZERO = 0.4
NEAR = 1.3
CLEAR = 5.0
SAME_ZERO = 0.01
DIFFERENT = 0.1
# Number of frequencies within a factor of NEAR.
POINTS = 128
# Maximum relative uncertainty of the frequency.
MAX_UNCERTAINTY = 0.05
# Probability below which the taps differ by more than their noise.
SIGNIFICANT = 0.05


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
        Frequencies of further resonances, Hz, the strongest first.
    share : float or None
        Share of the resonance in the static response, from an antiresonance; None without one.
    share_uncertainty : float
        Standard uncertainty of the share; 0 if it is None.
    minimum_share : float
        Minimum of the share: no antiresonance is nearer.
    name : str
        Name of the record.
    warnings : tuple of str
        Possible faults of the taps, a sentence each.
    """

    frequency: float
    quality: float
    frequency_uncertainty: float
    quality_uncertainty: float
    count: int
    others: tuple[float, ...]
    share: float | None
    share_uncertainty: float
    minimum_share: float
    name: str
    warnings: tuple[str, ...] = ()

    def lines(self) -> str:
        """Return the lines of a configuration, the table ``[plate]``."""
        return (
            f"[plate]\nf0 = {self.frequency:.6g}\nQ = {self.quality:.4g}\n"
            f"f0_uncertainty = {self.frequency_uncertainty:.2g}"
        ) + (f"\nshare = {self.share:.3g}" if self.share is not None else "")

    def __str__(self) -> str:
        """Return a sentence for reports."""
        taps = f"{self.count} tap{'s' * (self.count > 1)} in {self.name}"
        text = f"{taps}: Q within {100 * self.quality_uncertainty:.2g} % (standard uncertainty)"
        text += f"; f0_uncertainty includes {100 * CLOCK:g} % for the clock of the recorder"
        text += (
            f"; share in the static response {self.minimum_share:.2f} to 1"
            if self.share is None
            else f"; share within {self.share_uncertainty:.2g} (standard uncertainty)"
        )
        if self.others:
            text += f"; also resonances at {', '.join(f'{other:.4g}' for other in self.others)} Hz"
        return text


class _Tap(NamedTuple):
    """Index of the peak of a tap, stop index of its section, its height, and the level before."""

    top: int
    stop: int
    height: float
    before: NDArray[np.float64]


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
        mean with that from their scatter.

    Raises
    ------
    InputError
        If the record has no tap, or no resonance stands out.
    """
    source, _, _ = open_source(record, channel)
    if not source.sample_rate >= MIN_RATE:
        refuse(f"{source.name}: the sample rate is unknown or low", f"{MIN_RATE:g} Hz or more")
    if source.n_sample > MAX_SAMPLES:
        refuse(f"{source.name}: {source.n_sample} samples", f"up to {MAX_SAMPLES} samples")
    level, rate = source.read(0, source.n_sample), source.sample_rate
    taps = _find_taps(level, rate, source.name)
    fits = [(tap, fit) for tap in taps if (fit := _fit_tap(level, tap, rate))]
    if not fits:
        refuse(
            f"{source.name}: no resonance stands out after {len(taps)} tap{'s' * (len(taps) > 1)}",
            "a tap of a hard hammer after which the plate rings",
        )
    # Weaker taps may show another resonance first.
    strongest = max((fit.modes[0] for _, fit in fits), key=lambda mode: mode.response).frequency
    nearest = [
        (min(fit.modes, key=lambda mode: abs(mode.frequency - strongest)), fit) for _, fit in fits
    ]
    same = [pair for pair in nearest if abs(pair[0].frequency / strongest - 1) < SAME]
    firsts = [mode for mode, _ in same]
    tops = [tap.top for tap, _ in fits]
    frequency, u_frequency = _mean(
        [math.log(mode.frequency) for mode in firsts],
        [mode.frequency_uncertainty for mode in firsts],
    )
    quality, u_quality = _mean(
        [math.log(mode.quality) for mode in firsts], [mode.quality_uncertainty for mode in firsts]
    )
    if not u_frequency <= MAX_UNCERTAINTY:
        refuse(
            f"{source.name}: the resonance near {strongest:.4g} Hz is known to "
            f"{100 * u_frequency:.2g} % only",
            f"an uncertainty up to {MAX_UNCERTAINTY:.0%}",
        )
    others = max((fit.modes for _, fit in same), key=len)
    misfit = max(fit.misfit for _, fit in same)
    warnings: tuple[str, ...] = ()
    if misfit > MIN_MISFIT:
        message = (
            f"{source.name}: the ringing differs from decaying oscillations by {misfit:.1%}, as by "
            "modes close to each other or a hammer that touches the plate again; the uncertainties "
            "include it"
        )
        warnings = (message,)
    plate = Plate(math.exp(frequency), math.exp(quality))
    return TappedPlate(
        plate.f0,
        plate.Q,
        math.hypot(u_frequency, CLOCK),
        u_quality,
        len(firsts),
        tuple(m.frequency for m in others if abs(m.frequency / strongest - 1) >= SAME),
        *_share(level, tops, rate, plate),
        source.name,
        warnings,
    )


def _share(
    level: NDArray[np.float64], tops: list[int], rate: float, plate: Plate
) -> tuple[float | None, float, float]:
    """Return the share of a resonance in the static response or None, its uncertainty and minimum.

    With the share s the response, 1 + s (H - 1), is zero at f0 / sqrt(1 - s). The inverse of H
    ends the ringing: what remains of a tap is as short as the contact, and its spectrum is zero
    there. The spectrum of the contact has zeros too, which move with its duration.
    """
    half = round(CONTACT * rate)
    highest_frequency = MAX_FREQUENCY * rate
    count = int(math.log(highest_frequency / plate.f0) / math.log(NEAR) * POINTS)
    grid = plate.f0 * NEAR ** (np.arange(-POINTS, count) / POINTS)
    transform = np.exp(-2j * np.pi / rate * np.outer(grid, np.arange(2 * half)))
    sizes, depths = [], []
    for top in tops:
        section = level[max(top - half, 0) : top + round(AFTER * rate)]
        if top < half or len(section) < 4 * half or count <= POINTS:
            continue
        length = next_fast_len(2 * len(section), real=True)
        frequency = np.asarray(np.fft.rfftfreq(length, 1 / rate), dtype=np.float64)
        inverse = (frequency < highest_frequency) / plate.response(frequency)
        spectrum = np.fft.rfft(section - np.median(section[: half // 2]), length) * inverse
        # The tap itself, and as much of what follows.
        applied = np.fft.irfft(spectrum, length)[: 4 * half].reshape(2, 2 * half)
        size, noise = np.abs(transform @ applied.T).T
        sizes.append(size)
        depths.append(_depth(size, noise))
    if not depths:
        return None, 0.0, 0.0
    # A zero of the plate is one in each tap.
    depth = np.array(depths)
    highest = np.nan_to_num(depth).max(axis=0)
    above = grid[POINTS:-POINTS]
    possible = np.flatnonzero(highest < POSSIBLE)
    first = int(possible[0]) if possible.size else len(above) - 1
    minimum = 1 - (plate.f0 / float(above[first])) ** 2
    stop = first + int(np.argmax(highest[first:] >= POSSIBLE))
    inside = depth[:, first:stop]
    if len(depth) == 1 or stop == first or not inside.min(axis=1).max() < ZERO:
        return None, 0.0, minimum
    zeros = above[first + np.argmin(inside, axis=1)]
    zero, scatter = float(zeros.mean()), float(zeros.std(ddof=1) / zeros.mean())
    beyond = min(int(np.searchsorted(grid, NEAR * zero)), len(grid) - 1)
    slopes = np.log([size[beyond] / size[0] for size in sizes])
    if scatter > SAME_ZERO or slopes.std(ddof=1) < DIFFERENT:
        return None, 0.0, minimum
    rest = (plate.f0 / zero) ** 2
    return 1 - rest, 2 * rest * scatter / math.sqrt(len(zeros)), minimum


def _depth(size: NDArray[np.float64], noise: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the ratio of a spectrum and its neighbors on both sides; NaN where noise hides it."""
    window = np.lib.stride_tricks.sliding_window_view
    sides = window(size, POINTS + 1).max(axis=1)
    sides = np.minimum(sides[:-POINTS], sides[POINTS:])
    noise = np.sqrt(window(noise**2, 2 * POINTS + 1).mean(axis=1))
    return np.where(sides > CLEAR * noise, size[POINTS:-POINTS] / sides, np.nan)


def _mean(values: list[float], deviations: list[float]) -> tuple[float, float]:
    """Return the mean of values and its standard uncertainty."""
    count, value = len(values), np.array(values)
    if count == 1 or not min(deviations) > 0:
        return float(value.mean()), max(deviations) / math.sqrt(count)
    weight = 1 / np.square(deviations)
    mean = float(weight @ value / weight.sum())
    if chdtrc(count - 1, weight @ (value - mean) ** 2) >= SIGNIFICANT:
        return mean, 1 / math.sqrt(weight.sum())
    factor = float(stdtrit(count - 1, 0.975)) / NORMAL_FACTOR
    return float(value.mean()), factor * float(value.std(ddof=1)) / math.sqrt(count)


def _find_taps(level: NDArray[np.float64], rate: float, name: str) -> list[_Tap]:
    """Return the taps of a record; raise InputError if there is none."""
    width = round(CELL * rate)
    count = len(level) // width
    height = np.ptp(level[: count * width].reshape(count, width), axis=1)
    noise, highest = (float(np.median(height)), float(height.max())) if count else (0.0, 0.0)
    above = np.flatnonzero(height > max(MIN_RISE * noise, MIN_HEIGHT * highest))
    if not above.size:
        refuse(f"{name}: no tap", "a record in which a hammer taps the plate")
    quiet = round(QUIET / CELL)
    begins = width * above[np.diff(above, prepend=-quiet - 1) > quiet]
    taps = []
    for begin, following in zip(begins, [*begins[1:], len(level) + width], strict=True):
        before = level[max(0, begin - round(QUIET * rate)) : begin]
        offset = float(np.median(before)) if before.size else 0.0
        contact = level[begin : begin + round(CONTACT * rate)] - offset
        peak = int(np.argmax(np.abs(contact)))
        stop = min(following - width, begin + round(AFTER * rate), len(level))
        height = abs(float(contact[peak]))
        pulse = np.abs(level[begin : begin + 3 * round(CONTACT * rate)] - offset)
        if _width_at_half(pulse, peak) > CONTACT * rate:
            continue
        # Between the last cell of the previous tap, and the cell before this one.
        index = int(np.searchsorted(above, begin // width))
        first = width * (int(above[index - 1]) + 1) if index else 0
        first = max(first, int(begin) - round(BEFORE * rate))
        quiet_section = level[first : max(first, begin - width)]
        taps.append(_Tap(int(begin) + peak, int(stop), height, quiet_section))
    if not taps:
        refuse(
            f"{name}: no tap, but the plate is pressed for more than {1e3 * CONTACT:g} ms, as by a "
            "drop",
            "a record in which a hard hammer taps the plate",
        )
    return taps


def _width_at_half(pulse: NDArray[np.float64], peak: int) -> int:
    """Return the number of samples around a peak that are above half of it."""
    below = np.flatnonzero(pulse < pulse[peak] / 2)
    index = int(np.searchsorted(below, peak))
    first = int(below[index - 1]) if index else -1
    stop = int(below[index]) if index < len(below) else len(pulse)
    return stop - first - 1


def _fit_tap(level: NDArray[np.float64], tap: _Tap, rate: float) -> Fit | None:
    """Return the fit to the ringing after a tap; None if no resonance stands out.

    If what remains of a fit is not noise, the hammer may have touched the plate again: the ringing
    after the last touch is fitted instead.
    """
    quiet = np.zeros(0)
    if len(tap.before) >= MIN_LENGTH:
        quiet = tap.before - closest_decay(np.zeros((0, 2)), tap.before, rate)[0]
    fits: list[Fit] = []
    for wait in WAITS:
        fit = _fit_ringing(level, tap, rate, tap.top + round(wait * rate), quiet)
        if fit is not None:
            # One mode decays at the same rate later, several do not.
            fits.append(_with_change(fit, level, tap, rate, quiet) if fits else fit)
            if not fit.misfit:
                break
    return min(fits, key=lambda fit: fit.misfit) if fits else None


def _with_change(
    fit: Fit, level: NDArray[np.float64], tap: _Tap, rate: float, quiet: NDArray[np.float64]
) -> Fit:
    """Return a fit whose uncertainties include what changes one decay time later."""
    mode = fit.modes[0]
    start = fit.start + round(mode.quality / (math.pi * mode.frequency) * rate)
    later = fit_decay(level[start : tap.stop], rate, (start - tap.top) / rate, quiet)
    if later is None:
        return fit
    other = min(later.modes, key=lambda one: abs(one.frequency - mode.frequency))
    if abs(other.frequency / mode.frequency - 1) > SAME:
        return fit
    changed = mode._replace(
        frequency_uncertainty=math.hypot(
            mode.frequency_uncertainty, math.log(other.frequency / mode.frequency)
        ),
        quality_uncertainty=math.hypot(
            mode.quality_uncertainty, math.log(other.quality / mode.quality)
        ),
    )
    return fit._replace(modes=[changed, *fit.modes[1:]])


def _fit_ringing(
    level: NDArray[np.float64],
    tap: _Tap,
    rate: float,
    latest: int,
    quiet: NDArray[np.float64],
) -> Fit | None:
    """Fit the ringing from an index on, or from the end of the contact before it."""
    start, best = latest, None
    for _ in range(3):
        fit = fit_decay(level[start : tap.stop], rate, (start - tap.top) / rate, quiet)
        if fit is None:
            break
        best = fit._replace(start=start)
        # Continued back, the decay ends where the contact does.
        time = np.arange(tap.top - start, latest - start) / rate
        deviation = np.abs(level[tap.top : latest] - columns_of(fit.rates, time) @ fit.factors)
        limit = max(MIN_CONTACT * tap.height, NOISE_LEVEL * fit.noise)
        contact = np.flatnonzero(deviation > limit)
        earlier = tap.top + int(contact[-1] if contact.size else 0) + max(1, round(MARGIN * rate))
        if earlier >= start:
            break
        start = earlier
    return best
