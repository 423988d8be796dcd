"""Contact of one pulse: first touch, release, gate, and the noise in it.

Derivations: docs/recordings_theory.md, sections 3 and 4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.linalg import solve_triangular
from scipy.special import comb

from thud.impact.contact_time import AVERAGING_WIDTH, THRESHOLD, average_within
from thud.level.estimate import Estimate
from thud.level.levels import low_pass
from thud.recordings.background import (
    MAINS,
    N_HARMONIC,
    cell_means,
    remove_background,
    uniform_cells,
)
from thud.recordings.drops import MAX_BACKGROUND, Stage, robust_deviation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.level.levels import Bands
    from thud.recordings.background import Background
    from thud.recordings.drops import Section
    from thud.recordings.measured_drop import Drop

# The gate of the levels extends this many samples beyond the contact, and (GATE_RATE / rate)**2
# more at low rates, at which the anti-aliasing filter is close to the octave of 500 Hz.
GATE_SAMPLES = 8
GATE_RATE = 10_000.0
# Duration of the impulse response of a correction before and after the impulse, in periods of the
# highest corrected frequency.
CORRECTION_PERIODS = 4.0
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
# Cutoff of a filter over the equivalent bandwidth of its noise: 0.89 of a mean, 0.96 of a Bessel
# filter of order 4. White noise up to half the rate has more than a quarter of the rate.
CUTOFF_RATIO = 0.9
# A flank is A (t**n + r)/(1 + r), t in ms since first touch, with one of these pairs of n and r:
# bodies that touch over an area (1) or at a point (1.5, Hertz), soft releases, jumps of shells.
POWERS = np.array([0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 1.0, 1.0, 1.0, 1.0, 1.0])
JUMPS = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.03, 0.1, 0.3, 1.0, 3.0])
# Prior standard deviation of A as a fraction of the peak; a half sine of 20 ms has 0.16.
AMPLITUDE = 0.3
# Standard deviation of the force from these shapes, as a fraction of the force: a random walk that
# grows with it. Errors of samples due to quantization and filter, as a fraction of the peak.
MISFIT = 0.06
SAMPLE_ERROR = 2e-4
# A flank ends at this fraction of the peak, or so many deviations of the noise: further up, pulses
# do not have these shapes. It is searched up to LENGTH, s, within the contact of the search.
TOP = 0.1
DEVIATIONS = 4.0
LENGTH = 4e-3
# Width of the cells of a flank, s, and weights that smooth samples, to reduce the ringing of an
# anti-aliasing filter.
CELL = 4e-5
SMOOTHING = np.array([0.25, 0.5, 0.25])
# Standard uncertainty of first touch and of release due to the shapes, s: the largest of finite
# elements, whose last force is below 1 % of the peak; of begin and end.
TOUCH_ERRORS = (40e-6, 140e-6)
EDGE_ERROR = 7e-6
# The same due to what a correction loses, in periods of the highest corrected frequency: it spreads
# an edge over half of one, a quarter of that up to which it passes.
CORRECTION_ERROR = 0.08
# Number of candidate times in a search, and of searches. The next search covers the mean plus and
# minus SEARCH_DEVIATIONS standard deviations of the result.
N_TIME = 33
N_SEARCH = 3
SEARCH_DEVIATIONS = 6.0
# The shapes are tabulated at ticks: step, and range before and after first touch, ms.
TICK, BEFORE, AFTER = 1e-3, 2.0, 13.0
# Delays after first touch at which the force is compared with 1 % of the peak, ms.
DELAYS = np.concatenate([np.linspace(0, 0.5, 101), np.linspace(0.52, 4, 175)])


@dataclass(frozen=True, eq=False, repr=False)
class Contact(Stage):
    """Contact of one pulse; times are in s from the first sample of `force`.

    Attributes
    ----------
    touch, release : Estimate
        First touch and release.
    begin, end : Estimate
        Times at which the force exceeds, and falls below, 1 % of its peak
        (`thud.impact.contact_time`).
    start : int
        Index of the first sample of `force` in the section.
    force : ndarray, shape (n,)
        Force without background in the gate and up to MAX_BACKGROUND on either side, N.
    removed : ndarray, shape (n,)
        Removed background, N.
    gate : tuple of int
        First and stop index of the contact with its margins.
    covariance : ndarray, shape (n_cell, n_cell)
        Covariance of the error of the background in uniform cells of the gate, N2.
    background : Background
        The fitted background and its noise.
    sample_rate : float
        Samples per second, Hz.
    landing : Estimate or None
        First touch of the first bounce; None if it is not recorded.
    """

    touch: Estimate
    release: Estimate
    begin: Estimate
    end: Estimate
    start: int
    force: NDArray[np.float64]
    removed: NDArray[np.float64]
    gate: tuple[int, int]
    covariance: NDArray[np.float64]
    background: Background
    sample_rate: float
    landing: Estimate | None = None

    @property
    def gated(self) -> NDArray[np.float64]:
        """Force within the gate, N."""
        return self.force[slice(*self.gate)]

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
        thirds = np.array_split(np.diff(self.gated, NOISE_ORDER), 3)
        deviation = max(map(robust_deviation, thirds))
        variance = deviation**2 / float(comb(2 * NOISE_ORDER, NOISE_ORDER))
        return variance if variance > MIN_INCREASE * background else background

    @cached_property
    def effective_rate(self) -> float:
        """Sample rate, Hz, or the lower one that the bandwidth of the noise shows.

        The noise of the background is that of the fit below a filter, and ends at it. Its spectrum
        is the mean over sections of the length of the gate.
        """
        (first, stop), count = self.gate, len(self.gated)
        sides = self.force[first % count : first], self.force[stop:]
        sections = np.concatenate([sides[0], sides[1][: len(sides[1]) // count * count]])
        if not sections.size or self.background.quantization.offset:
            return self.sample_rate
        frequency = np.fft.rfftfreq(count, 1 / self.sample_rate)[1:]
        windowed = np.hanning(count + 2)[1:-1] * sections.reshape(-1, count)
        power = (np.abs(np.fft.rfft(windowed, axis=1)[:, 1:]) ** 2).mean(axis=0)
        ratio = power / self.background.density(frequency)
        reference = np.median(ratio[(frequency > NOISE_BAND[0]) & (frequency < NOISE_BAND[1])])
        if not reference > 0:
            return self.sample_rate
        bandwidth = float(ratio.sum() / reference * frequency[0])
        return min(self.sample_rate, 4 * CUTOFF_RATIO * bandwidth)

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

    def covariance_of(self, functionals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the covariance, [k, k], of the errors of weighted sums of the force in the gate.

        The rows of `functionals`, [k, n], are the weights of the samples.
        """
        bounds = np.rint(np.linspace(0, functionals.shape[1], len(self.covariance) + 1))
        summed = np.add.reduceat(functionals, bounds[:-1].astype(int), axis=1)
        result: NDArray[np.float64] = self.white_variance * functionals @ functionals.T
        return result + summed @ self.covariance @ summed.T


def find_contact(section: Section, force: NDArray[np.float64], background: Background) -> Contact:
    """Return the contact of a section; `force` is that without its background, N, shape (n,).

    The bounce has the noise of `background`.
    """
    rate, chain = section.sample_rate, section.chain
    touch, begin = find_edge(section, force, background, side=1)
    release, end = find_edge(section, force, background, side=-1)
    # Samples into which filters spread the flanks belong to the gate.
    margin = GATE_SAMPLES + int((GATE_RATE / rate) ** 2)
    margin += int(CORRECTION_PERIODS * rate / chain.highest / 2) if chain else 0
    first = max(int((touch.value - 3 * touch.uncertainty) * rate) - margin, 0)
    stop = min(int((release.value + 3 * release.uncertainty) * rate) + margin + 1, len(force))
    length = int(MAX_BACKGROUND * rate)
    start = max(0, first - length)
    shown = slice(start, stop + length)
    touch, release, begin, end = (
        replace(edge, value=edge.value - start / rate) for edge in (touch, release, begin, end)
    )
    landing, bounce = None, section.bounce
    if bounce:
        landing = find_edge(bounce, *remove_background(bounce, background), side=1)[0]
        delay = (bounce.start - section.start - start) / rate
        landing = replace(landing, value=delay + landing.value)
    return Contact(
        touch, release, begin, end, start, force[shown],
        (section.force - force)[shown], (first - start, stop - start),
        background.error_covariance(uniform_cells(first, stop, rate)),
        background, rate, landing,
    )  # fmt: skip


def find_edge(
    section: Section, force: NDArray[np.float64], background: Background, side: int
) -> tuple[Estimate, Estimate]:
    """Return first touch and begin of a contact (side 1), or its release and end (side -1), s.

    `force` is that of the section without its background, N. Times are from its first sample;
    begin and end are at 1 % of the peak.
    """
    rate = section.sample_rate
    index, other = section.contact[::side]
    end = background.ends[0 if side > 0 else 1]
    step = side * max(1, round(CELL * rate))
    bounds = np.arange(round(end * rate), int(index + side * LENGTH * rate), step)[::side]
    bounds = bounds[(bounds >= 0) & (bounds <= len(force))]
    smooth = np.convolve(force, SMOOTHING, mode="same") / background.peak
    cells, means = cell_means(smooth, rate, bounds)
    time, level = side * (cells[0] + cells[1])[::side] / 2, means[::side]
    noise = background.error_covariance(cells) + background.quantization.offset**2
    noise += np.diag(background.variances[0] / 2 / (cells[1] - cells[0]))
    noise = noise[::side, ::side] / background.peak**2
    top = max(TOP, DEVIATIONS * math.sqrt(noise[-1, -1]))
    # Up to the last cell below the top and two more.
    stop = int(np.append(-1, np.flatnonzero(level < top))[-1]) + 3
    time, level, noise = time[:stop], level[:stop], noise[:stop, :stop]
    highest = np.maximum.accumulate(np.maximum(level, 0.0))
    unit = np.eye(len(level))
    noise += (MISFIT * np.minimum.outer(highest, highest)) ** 2 + SAMPLE_ERROR**2 * unit
    whiten = solve_triangular(np.linalg.cholesky(noise), unit, lower=True, check_finite=False)
    shapes, averaged = _shapes(1e3 / rate)
    known = whiten @ level
    low, high = side * end, float(time[-1])
    for _ in range(N_SEARCH):
        touch = np.linspace(low, high, N_TIME)
        tick = np.rint((1e3 * (time - touch[:, None]) + BEFORE) / TICK).astype(int)
        columns = whiten @ shapes[np.clip(tick, 0, len(shapes) - 1)]
        # For a time and a shape, A is normal with this information and mean.
        information = (columns**2).sum(axis=1) + AMPLITUDE**-2
        score = np.maximum(np.einsum("tck,c->tk", columns, known), 0.0)
        likelihood = score**2 / information / 2 - np.log(information) / 2
        weight = np.exp(likelihood - likelihood.max())
        weight /= weight.sum()
        mean = float(weight.sum(axis=1) @ touch)
        spacing = float((touch[1] - touch[0]) ** 2 / 12)
        deviation = math.sqrt(weight.sum(axis=1) @ (touch - mean) ** 2 + spacing)
        reach = SEARCH_DEVIATIONS * deviation
        if mean - reach <= low and mean + reach >= high:
            break
        low, high = max(low, mean - reach), min(high, mean + reach)
    amplitude = np.maximum(score / information, 1e-9)
    pairs = zip(THRESHOLD / amplitude.T, averaged.T, strict=True)
    delay = np.array([np.interp(part, shape, DELAYS) for part, shape in pairs])
    begin = touch[:, None] + 1e-3 * delay.T
    middle = float((weight * begin).sum())
    variance = float((weight * (begin - middle) ** 2).sum()) + spacing + EDGE_ERROR**2
    correction = CORRECTION_ERROR / section.chain.highest if section.chain else 0.0
    quantization, rise = background.quantization, 0.0
    if quantization.offset:
        # Where the background lies within a step, offset and samples are uncertain by half a step
        # and a step: the edge by the time that the force needs for both or, in a bounce of few
        # steps that does not reach them, up to the other edge.
        limit = THRESHOLD * background.peak + 1.5 * quantization.step
        later = side * np.flatnonzero(force > limit) / rate
        rise = (
            quantization.offset
            / quantization.step
            * (later[later > middle].min(initial=side * other / rate) - middle)
        )
    return (
        Estimate(side * mean, math.hypot(deviation, TOUCH_ERRORS[side < 0])),
        Estimate(side * middle, math.hypot(math.sqrt(variance), correction, rise)),
    )


@lru_cache(maxsize=4)
def _shapes(interval: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the shapes of flanks at ticks from BEFORE on, and their means at DELAYS.

    `interval` is that of the samples, ms. The former are smoothed as the samples, the latter
    averaged over AVERAGING_WIDTH; both have the shape (n_time, n_shape).
    """
    time = TICK * np.arange(-round(BEFORE / TICK), round(AFTER / TICK), dtype=np.float64)
    shapes = np.sum(
        [
            weight * _flanks(time + shift * interval, interval)
            for weight, shift in zip(SMOOTHING, (-1, 0, 1), strict=True)
        ],
        axis=0,
    )
    fine = np.arange(0, DELAYS[-1] + 1, 2 * TICK)
    return shapes, average_within(_flanks(fine, 0.0), fine, DELAYS, 1e3 * AVERAGING_WIDTH)


def _flanks(time: NDArray[np.float64], interval: float) -> NDArray[np.float64]:
    """Return the shapes at times since first touch, ms, shape (n_time, n_shape), for A = 1.

    A jump is half as sampled, half spread over a sampling interval by a filter.
    """
    touched = np.asarray(time >= 0, dtype=np.float64)
    spread = np.clip(time / interval + 0.5, 0, 1) if interval else touched
    jump = (touched + spread)[:, None] / 2
    rise = np.maximum(time, 0)[:, None] ** POWERS
    return np.asarray((rise + JUMPS * jump) / (1 + JUMPS))


_quadrature = lru_cache(maxsize=64)(leggauss)


def band_functionals(count: int, rate: float, lower: float, upper: float) -> NDArray[np.float64]:
    """Return functionals of samples whose squares add up to the energy in a band, [n, count].

    They are the Fourier integrals at the nodes of a Gauss quadrature over the band.
    """
    time = np.arange(count) / rate
    nodes, weights = _quadrature(12 + int(2 * (upper - lower) * count / rate))
    phase = np.multiply.outer(np.pi * (lower + upper + (upper - lower) * nodes), time)
    scale = np.sqrt((upper - lower) * weights)[:, None] / rate
    return np.concatenate([scale * np.cos(phase), scale * np.sin(phase)])


def band_noise(drops: Sequence[Drop], bands: Bands) -> NDArray[np.float64]:
    """Return energies of the noise within the gates in bands, N2 s, [n_drop, n_band, 3].

    The last axis holds the expected energy of the noise, and the standard deviations of the force's
    energy after its subtraction: by noise, and by quantization with a quiet background.
    """
    energies = np.empty((len(drops), len(bands.lower), 3))
    for contact, drop_energies in zip((drop.contact for drop in drops), energies, strict=True):
        force, rate, background = contact.gated, contact.sample_rate, contact.background
        # What the contact has beyond the background may be the force: it is not subtracted.
        beyond = contact.white_variance - background.variances[0] * rate / 2
        errors = contact.quantization_errors
        for k, (lower, upper) in enumerate(zip(bands.lower, bands.upper, strict=True)):
            rows = band_functionals(len(force), rate, lower, upper)
            values, covariance = rows @ force, contact.covariance_of(rows)
            further = beyond * float((rows**2).sum())
            noise = float(np.trace(covariance)) - further
            squares = float((covariance**2).sum())
            # The noise in `values` makes the first term too large by twice the second, on average.
            variance = max(4 * float(values @ covariance @ values) - 2 * squares, 2 * squares)
            density = background.variances[:3] * ((lower + upper) / 2) ** -np.arange(3.0)
            relative = density / density.sum()
            variance += noise**2 * float(relative @ background.log_covariance[:3, :3] @ relative)
            variance += further**2
            # An error e changes the energy by 2 (R f)' R e + |R e|**2.
            changes = errors @ rows.T
            quantized = ((changes + 2 * values) * changes).sum(axis=1)
            deviation = float(quantized.std()) if len(quantized) else 0.0
            drop_energies[k] = noise, math.sqrt(variance), deviation
    return energies
