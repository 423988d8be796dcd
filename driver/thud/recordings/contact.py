"""Contact of one pulse: background, first touch and release (docs/recordings_theory.md)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import convolve1d, uniform_filter1d
from scipy.special import comb

from thud.base.immutable import Immutable
from thud.impact.contact_time import THRESHOLD
from thud.level.estimate import Estimate
from thud.level.levels import RECORDED_BAND, low_pass
from thud.recordings.flanks import SMOOTHING, Flank, Posterior, find_touch
from thud.recordings.noise import MAINS, N_HARMONIC, Background, fit_background
from thud.recordings.quantization import MARGIN, MAX_BACKGROUND
from thud.recordings.response import correct_force

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.drops import Window
    from thud.recordings.noise import Cells
    from thud.recordings.response import Chain

# The background is averaged over cells. Pairs: width of a cell, and distance from the contact up to
# which this width is used, s.
BACKGROUND_CELLS = ((5e-4, 5e-3), (2e-3, 25e-3), (3e-3, MAX_BACKGROUND))
# Length of a flank in the search for the touch, s.
FLANK = 3e-3
# Maximum time from the start of the pulse that the search for drops returns to the touch, s.
MAX_DELAY = 1e-3
# Time from a fifth of the peak to the end of the search over that from half of it to a fifth. A
# power of time up to 4 passes 1 % in it; in a longer search, strong noise may be a slow release.
REACH = 2.0
# Width of the cells of a flank, s: from MIN_CELL to MAX_CELL in the interval of the touch; outside,
# GROWTH times the distance from this interval, if this is more.
MIN_CELL = 2e-5
MAX_CELL = 1e-4
GROWTH = 0.15
# Width of the cells of the contact, s.
CONTACT_CELL = 2e-4
# The gate of the levels extends this many samples beyond the contact, and (GATE_RATE / rate)**2
# more at low rates, at which the anti-aliasing filter is close to the octave of 500 Hz.
GATE_SAMPLES = 8
GATE_RATE = 10_000.0
# Duration of the impulse response of a correction before and after the impulse, in periods of the
# highest corrected frequency.
CORRECTION_PERIODS = 4.0
# Error of begin and end due to content above the corrected frequencies, in periods of the highest.
CORRECTION_ERROR = 0.06
# Number of positions of a background within a quantization step.
N_PHASE = 16
# Weights of neighboring samples that give values between the steps.
NO_GRID = np.array([0.21, 0.58, 0.21])
# Order of the differences that tell noise in the contact from the force, and the rate, Hz, and the
# number of samples from which they do: a force of 600 Hz has 1e-3 of its amplitude in them. The
# variance by which they exceed the background's.
NOISE_ORDER = 8
MIN_NOISE_RATE = 5e3
MIN_NOISE_SAMPLES = 50
MIN_INCREASE = 4.0
# Band in which the noise of the background is compared with its fit, Hz.
NOISE_BAND = (100.0, 600.0)
# Errors of samples due to quantization and the filter of the recorder, as a fraction of the peak.
SAMPLE_ERROR = 2e-4


@dataclass(frozen=True, eq=False)
class Contact(Immutable):
    """Contact of one pulse; times are in s from the first sample of the window.

    Attributes
    ----------
    touch, release : Estimate
        First touch and release.
    begin, end : Estimate
        Times at which the force exceeds, and falls below, 1 % of its peak
        (`thud.impact.contact_time`).
    peak : float
        Approximate maximum of the force below 1.25 kHz without the offset, N.
    span : tuple of int
        First and stop index of `force` in the window: the gate and up to MAX_BACKGROUND on either
        side.
    force : ndarray, shape (span[1] - span[0],)
        Force without background, N.
    removed_means : tuple of ndarray, shape (n_cell,)
        Times of cells, and the removed background in them, N.
    gate : tuple of int
        First and stop index of the contact with its margins in the window.
    covariance : ndarray, shape (n_cell, n_cell)
        Covariance of the error of the background in uniform cells of the gate, N2.
    background_lengths : tuple of float
        Length of the background before and after, s.
    background : Background
        The fitted background and its noise.
    sample_rate : float
        Samples per second, Hz.
    """

    touch: Estimate
    release: Estimate
    begin: Estimate
    end: Estimate
    peak: float
    span: tuple[int, int]
    force: NDArray[np.float64]
    removed_means: tuple[NDArray[np.float64], NDArray[np.float64]]
    gate: tuple[int, int]
    covariance: NDArray[np.float64]
    background_lengths: tuple[float, float]
    background: Background
    sample_rate: float

    @property
    def gated(self) -> NDArray[np.float64]:
        """Force within the gate, N."""
        first = self.span[0]
        return self.force[self.gate[0] - first : self.gate[1] - first]

    @property
    def removed(self) -> NDArray[np.float64]:
        """Removed background, N, shape (span[1] - span[0],): linear between the cells."""
        return np.interp(np.arange(*self.span) / self.sample_rate, *self.removed_means)

    @cached_property
    def white_variance(self) -> float:
        """Variance of the white noise of a sample in the gate, N2.

        It is that of the background, or the largest of the thirds of the gate by differences of
        the order `NOISE_ORDER`, if that exceeds it clearly: noise may grow with the force. At low
        rates the differences are those of the force itself.
        """
        background = float(self.background.variances[0]) * self.sample_rate / 2
        if self.sample_rate < MIN_NOISE_RATE or len(self.gated) < MIN_NOISE_SAMPLES:
            return background
        differences = np.abs(np.diff(self.gated, NOISE_ORDER))
        medians = [np.median(third) for third in np.array_split(differences, 3)]
        variance = (1.4826 * float(max(medians))) ** 2 / float(comb(2 * NOISE_ORDER, NOISE_ORDER))
        return variance if variance > MIN_INCREASE * background else background

    @property
    def quiet_gates(self) -> NDArray[np.float64]:
        """Background in sections of the length of the gate on both sides, N, [n_section, n]."""
        first, count = self.span[0], len(self.gated)
        begin, end = self.gate[0] - first, self.gate[1] - first
        before, after = self.force[:begin], self.force[end:]
        sections = [
            side[k * count : (k + 1) * count]
            for side in (before[::-1], after)
            for k in range(len(side) // count)
        ]
        return np.array(sections).reshape(-1, count)

    @cached_property
    def noise_bandwidth(self) -> float:
        """Equivalent bandwidth of the noise of the background, Hz; infinite if it is not known.

        The noise is that of the fit below a filter, and ends at it.
        """
        gates = self.quiet_gates
        if not gates.size or self.background.quantization.offset:
            return math.inf
        frequency = np.fft.rfftfreq(gates.shape[1], 1 / self.sample_rate)[1:]
        window = np.hanning(gates.shape[1] + 2)[1:-1]
        power = (np.abs(np.fft.rfft(window * gates, axis=1)[:, 1:]) ** 2).mean(axis=0)
        white, pink, brown = self.background.variances[:3]
        ratio = power / (white + pink / frequency + brown / frequency**2)
        reference = np.median(ratio[(frequency > NOISE_BAND[0]) & (frequency < NOISE_BAND[1])])
        return float(ratio.sum() / reference * frequency[0]) if reference > 0 else math.inf

    @property
    def quantization_errors(self) -> NDArray[np.float64]:
        """Possible errors of the force in the gate by quantization, N, [n_phase, n]; empty if none.

        They are those of the low-passed force for evenly spaced positions of the background
        within its step, without and with hum. Noise lowers them like the error of the offset.
        """
        quantization = self.background.quantization
        if not quantization.offset:
            return np.empty((0, len(self.gated)))
        time = np.arange(*self.gate) / self.sample_rate
        is_contact = (time >= self.touch.value) & (time <= self.release.value)
        # Without smoothing, forces that are multiples of the step would have no error.
        smooth = np.convolve(low_pass(self.gated, self.sample_rate), NO_GRID, mode="same")
        force = smooth * is_contact / quantization.step
        phases = ((np.arange(N_PHASE) + 0.5) / N_PHASE - 0.5)[:, None]
        # Hum that stays within the step is hidden, too, and steps of hum look like its harmonics.
        order = np.arange(1, N_HARMONIC + 1)[:, None, None]
        turns = 0.618 * order * np.arange(N_PHASE)[:, None] + order * MAINS[0] * time
        hum = (0.5 - np.abs(phases)) * (np.sin(2 * np.pi * turns) / np.sqrt(order)).sum(axis=0)
        phases = np.concatenate([np.broadcast_to(phases, hum.shape), phases + hum])
        errors = (np.rint(force + phases) - force) * is_contact
        return np.asarray(math.sqrt(12) * quantization.offset * errors)

    @property
    def quantization_impulse(self) -> float:
        """Standard deviation of the impulse by quantization, N s."""
        impulses = self.quantization_errors.sum(axis=1) / self.sample_rate
        offset = self.background.quantization.offset * (self.end.value - self.begin.value)
        return max(float(impulses.std()), offset) if impulses.size else 0.0

    def summed(self, functionals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return functionals of the samples of the gate, [k, n], summed in cells: [k, n_cell]."""
        bounds = np.rint(np.linspace(0, functionals.shape[1], len(self.covariance) + 1))
        return np.add.reduceat(functionals, bounds[:-1].astype(int), axis=1)

    def covariance_of(self, functionals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the covariance, [k, k], of the errors of weighted sums of the force in the gate.

        The rows of `functionals`, [k, n], are the weights of the samples.
        """
        summed = self.summed(functionals)
        result: NDArray[np.float64] = self.white_variance * functionals @ functionals.T
        return result + summed @ self.covariance @ summed.T


def cells_between(bounds: NDArray[np.intp], rate: float, middle: float) -> Cells:
    """Return begins and ends of cells, s from the middle of the contact; bounds are in samples."""
    time = np.asarray((bounds - 0.5) / rate - middle, dtype=np.float64)
    return time[:-1], time[1:]


def _means(force: NDArray[np.float64], bounds: NDArray[np.intp]) -> NDArray[np.float64]:
    total: NDArray[np.float64] = np.add.reduceat(force[: bounds[-1]], bounds[:-1])
    return total / np.diff(bounds)


def _background_bounds(length: int, rate: float) -> NDArray[np.intp]:
    """Return bounds of background cells up to a length, in samples from the contact."""
    bounds = [0.0]
    for width, max_distance in BACKGROUND_CELLS:
        count = int((max_distance - bounds[-1]) / width + 1e-9)
        bounds += list(bounds[-1] + width * np.arange(1, count + 1))
    indices = np.unique(np.rint(np.array(bounds) * rate).astype(int))
    return indices[indices <= length]


def _spread(rate: float, chain: Chain | None) -> int:
    """Return the number of samples by which filters spread a flank."""
    periods = int(CORRECTION_PERIODS * rate / chain.highest / 2) if chain else 0
    return int((GATE_RATE / rate) ** 2) + periods


@dataclass(frozen=True, eq=False)
class Edges:
    """Posteriors of first touch, and of release in reversed time, s from the first sample.

    `background_limits` are the stop index of the background before the contact and the first index
    of the background after it. `offset` is the median of the background, N, that is subtracted
    before the fit.
    """

    touch: Posterior
    release: Posterior
    background: Background
    offset: float
    background_limits: tuple[int, int]


def estimate_limits(window: Window, noise: Background | None = None) -> tuple[Estimate, Estimate]:
    """Return first touch and release, s from the first sample, accurate to about 0.1 ms."""
    edges = find_edges(window, window.force, noise, passes=1)
    (t0, s0), (t1, s1) = edges.touch.edge_times()[0], edges.release.edge_times()[0]
    u0, u1 = _step_errors(
        edges.background, window.force - edges.offset, window.sample_rate, t0, -t1
    )
    return Estimate(t0, math.hypot(s0, u0)), Estimate(-t1, math.hypot(s1, u1))


def find_contact(window: Window, force: NDArray[np.float64]) -> Contact:
    """Return the contact in a window; `force`, N, is its force, with any dropouts filled."""
    rate, contact = window.sample_rate, window.contact
    middle = (contact[0] + contact[1]) / 2 / rate
    edges = find_edges(window, force, None, passes=2)
    background, (before_stop, after_start) = edges.background, edges.background_limits
    (t0, s0), begin = edges.touch.edge_times()
    (t1, s1), end = edges.release.edge_times()
    t1 = -t1
    correction_error = CORRECTION_ERROR / window.chain.highest if window.chain else 0.0
    margin = GATE_SAMPLES + _spread(rate, window.chain)
    gate = (
        max(int((t0 - 3 * s0) * rate) - margin, 0),
        min(int((t1 + 3 * s1) * rate) + margin + 1, len(force)),
    )
    inner = uniform_bounds(*gate, rate)
    _, covariance = background.predict(cells_between(inner, rate, middle))
    length = int(MAX_BACKGROUND * rate)
    span = (max(0, gate[0] - length), min(len(force), gate[1] + length))
    # Cells outside the gate are five times as wide; the width in samples is proportional to `rate`.
    sides = [uniform_bounds(*side, 5 * rate) for side in ((span[0], gate[0]), (gate[1], span[1]))]
    cells = cells_between(np.unique(np.concatenate([*sides, inner])), rate, middle)
    removed_means = (
        (cells[0] + cells[1]) / 2 + middle,
        background.predict_mean(cells) + edges.offset,
    )
    corrected = force[slice(*span)] - np.interp(np.arange(*span) / rate, *removed_means)
    start = span[0] / rate
    u0, u1 = _step_errors(background, corrected, rate, begin[0] - start, -end[0] - start)
    return Contact(
        Estimate(t0, s0),
        Estimate(t1, s1),
        Estimate(begin[0], math.hypot(begin[1], correction_error, u0)),
        Estimate(-end[0], math.hypot(end[1], correction_error, u1)),
        background.peak,
        span,
        corrected,
        removed_means,
        gate,
        covariance,
        (before_stop / rate, (len(force) - after_start) / rate),
        background,
        rate,
    )


def _step_errors(
    background: Background, force: NDArray[np.float64], rate: float, begin: float, end: float
) -> tuple[float, float]:
    """Return the standard deviations of begin and end of a contact by quantization, s.

    Begin and end are in s from the first sample of the force, N. Where the background lies within a
    step, offset and samples are uncertain by half a step and a step: the edges by the time that the
    force needs for both.
    """
    step, offset = background.quantization.step, background.quantization.offset
    if not offset:
        return 0.0, 0.0
    level = THRESHOLD * background.peak + 1.5 * step
    above = np.flatnonzero(force > level) / rate
    inside = above[(above > begin) & (above < end)]
    first, last = (inside[0], inside[-1]) if inside.size else (end, begin)
    return offset / step * float(first - begin), offset / step * float(end - last)


def find_edges(
    window: Window, force: NDArray[np.float64], noise: Background | None, passes: int
) -> Edges:
    """Return the edges of a contact; a second pass starts from the edges of the first pass.

    `noise` is the fit to another part of the signal; if None, the noise is fitted.
    """
    rate, (first, stop) = window.sample_rate, window.contact
    middle = (first + stop) / 2 / rate
    # At most half of a short background is cut off.
    before_stop = int(max(first - MARGIN * rate, first / 2))
    after_start = int(min(stop + MARGIN * rate, (stop + len(force)) / 2))
    offset = float(np.median(np.concatenate([force[:before_stop], force[after_start:]])))
    force = force - offset
    width = max(1, round(rate / RECORDED_BAND))
    smooth = uniform_filter1d(force[first:stop], width)
    peak = float(smooth.max())
    low = float(smooth.min())
    half, fifth = (
        first + np.flatnonzero(smooth >= low + level * (peak - low))[[0, -1]]
        for level in (0.5, 0.2)
    )
    reach = fifth + REACH * (fifth - half)
    before_stop = int(np.clip(reach[0], first / 2, before_stop))
    after_start = int(np.clip(reach[1], after_start, (stop + len(force)) / 2))
    touch = (before_stop / rate, first / rate + MARGIN)
    release = (stop / rate - MARGIN, after_start / rate)
    for pass_index in range(passes):
        # The first of two passes needs only the coarse grid.
        searches = 1 + 2 * pass_index if passes > 1 else 2
        cells, mean = background_means(force, before_stop, after_start, rate, middle)
        if noise is None:
            noise = fit_background(cells, mean, peak)
            draws, quantization = noise.draws.copy(), window.quantization
            draws[:, 0] = np.maximum(draws[:, 0], quantization.density)
            noise = Background(cells, mean, draws, peak, quantization)
        background = Background(cells, mean, noise.draws, peak, noise.quantization)
        fixed = Background(cells, mean, noise.variances[None], peak, noise.quantization)
        posteriors = []
        for sign, background_end, pulse_end, interval in (
            (1, before_stop, first, touch),
            (-1, after_start, stop, release),
        ):
            search = interval if sign > 0 else (-interval[1], -interval[0])
            end = min(search[1], sign * pulse_end / rate + MAX_DELAY) + FLANK
            bounds = sign * flank_bounds(
                sign * background_end, search, end, rate, fine=pass_index > 0
            )
            posteriors.append(
                find_posterior(force, bounds, search, fixed, rate, middle, searches, window.chain)
            )
        if pass_index + 1 < passes:
            touch, reverse = (
                _interval(posterior.edge_times(), 3 / rate + 1e-4) for posterior in posteriors
            )
            release = (-reverse[1], -reverse[0])
            # Samples into which filters spread the flanks are no background.
            spread = _spread(rate, window.chain)
            before_stop = max(int(touch[0] * rate) - spread, first // 2)
            after_start = min(int(release[1] * rate) + 1 + spread, (stop + len(force) + 1) // 2)
    return Edges(posteriors[0], posteriors[1], background, offset, (before_stop, after_start))


def _interval(
    edge: tuple[tuple[float, float], tuple[float, float]], margin: float
) -> tuple[float, float]:
    """Return an interval that includes first touch and begin, with a margin, s."""
    ends = np.array([(mean - 5 * spread, mean + 5 * spread) for mean, spread in edge])
    return float(ends.min()) - margin, float(ends.max()) + margin


def uniform_bounds(start: int, stop: int, rate: float) -> NDArray[np.intp]:
    """Return bounds of cells of about CONTACT_CELL, in samples at a rate, Hz."""
    count = max(1, round((stop - start) / rate / CONTACT_CELL))
    return np.unique(np.rint(np.linspace(start, stop, 1 + count)).astype(int))


def background_means(
    force: NDArray[np.float64], before_stop: int, after_start: int, rate: float, middle: float
) -> tuple[Cells, NDArray[np.float64]]:
    """Return the background cells on both sides of a contact, and their mean forces, N."""
    sides = (
        before_stop - _background_bounds(before_stop, rate)[::-1],
        after_start + _background_bounds(len(force) - after_start, rate),
    )
    begins, ends = zip(*(cells_between(side, rate, middle) for side in sides), strict=True)
    mean = [_means(force, side) for side in sides if len(side) > 1]
    return (np.concatenate(begins), np.concatenate(ends)), np.concatenate(mean)


def find_posterior(  # noqa: PLR0913, PLR0917 - all of them describe one flank
    force: NDArray[np.float64],
    bounds: NDArray[np.intp],
    interval: tuple[float, float],
    background: Background,
    rate: float,
    middle: float,
    searches: int,
    chain: Chain | None = None,
) -> Posterior:
    """Return the posterior of the touch within an interval, s, from cells with bounds in samples.

    If the bounds decrease, the posterior is that of the release, and its time and `interval` are
    reversed.
    """
    reversed_ = bounds[0] > bounds[-1]
    bounds = bounds[::-1] if reversed_ else bounds
    bounds = bounds[(bounds >= 0) & (bounds <= len(force))]
    cells = cells_between(bounds, rate, middle)
    mean, covariance = background.predict(cells)
    low, high = max(bounds[0] - 1, 0), min(bounds[-1] + 1, len(force))
    smooth = np.convolve(force[low:high], SMOOTHING, mode="same")[bounds[0] - low :]
    value = _means(smooth, bounds - bounds[0]) - mean
    # Weights of the samples in the smoothed means.
    count = np.diff(bounds)
    kernel = SMOOTHING if chain is None else np.convolve(SMOOTHING, _response(chain, rate))
    margin = len(kernel) // 2
    weights = np.zeros((len(count), bounds[-1] - bounds[0] + 2 * margin))
    weights[np.repeat(np.arange(len(count)), count), margin + np.arange(count.sum())] = 1
    weights = convolve1d(weights / count[:, None], kernel, mode="constant")
    covariance += background.quantization.offset**2
    covariance += background.variances[0] * rate / 2 * weights @ weights.T
    covariance += (SAMPLE_ERROR * background.peak) ** 2 * np.eye(len(value))
    time = (cells[0] + cells[1]) / 2 + middle
    if reversed_:
        time, value, covariance = -time[::-1], value[::-1], covariance[::-1, ::-1]
    flank = Flank(
        time, value, covariance, background.peak, 1 / rate, release=bool(reversed_), chain=chain
    )
    return find_touch(flank, *interval, searches)


@lru_cache(maxsize=4)
def _response(chain: Chain, rate: float) -> NDArray[np.float64]:
    """Return the impulse response of a correction; the impulse is in the middle."""
    length = int(CORRECTION_PERIODS * rate / chain.highest)
    impulse = np.zeros(2 * length + 1)
    impulse[length] = 1
    return correct_force(impulse, rate, chain)


def flank_bounds(
    first: int, interval: tuple[float, float], end: float, rate: float, *, fine: bool
) -> NDArray[np.intp]:
    """Return bounds of flank cells in samples, from the end of the background to a time, s.

    The interval, s, includes the touch. Without `fine`, all cells have the maximum width.
    """
    touch = (interval[0] + interval[1]) / 2 * rate
    half_width = (interval[1] - interval[0]) / 2 * rate
    bounds = [first]
    while bounds[-1] < end * rate:
        distance = max(abs(bounds[-1] - touch) - half_width, 0)
        width = MAX_CELL * rate
        if fine:
            width = max(MIN_CELL * rate, GROWTH * distance, min(half_width / 10, width))
        bounds.append(bounds[-1] + max(1, int(width)))
    return np.array(bounds)
