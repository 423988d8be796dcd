"""Contact of one pulse: first touch and release (docs/recordings_theory.md, section 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.special import comb

from thud.base.note import Note
from thud.level.levels import low_pass
from thud.recordings.background import MAINS, N_HARMONIC, uniform_cells
from thud.recordings.differences import robust_deviation
from thud.recordings.flanks import find_edge
from thud.recordings.quantization import MAX_BACKGROUND
from thud.recordings.stage import Stage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.level.estimate import Estimate
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


@dataclass(frozen=True, eq=False)
class Contact(Stage):
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
    removed : ndarray, shape (span[1] - span[0],)
        Removed background, N.
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
    removed: NDArray[np.float64]
    gate: tuple[int, int]
    covariance: NDArray[np.float64]
    background_lengths: tuple[float, float]
    background: Background
    sample_rate: float

    @property
    def notes(self) -> tuple[Note, ...]:
        """What was removed with the background."""
        first, stop = (index - self.span[0] for index in self.gate)
        offset = float(self.removed[first:stop].mean())
        return (*self.background.notes, Note("offset_removed", value=offset, unit="N"))

    @property
    def gated(self) -> NDArray[np.float64]:
        """Force within the gate, N."""
        first = self.span[0]
        return self.force[self.gate[0] - first : self.gate[1] - first]

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
    def noise_bandwidth(self) -> float:
        """Equivalent bandwidth of the noise of the background, Hz; infinite if it is not known.

        The noise is that of the fit below a filter, and ends at it. Its spectrum is the mean over
        sections of the length of the gate.
        """
        first, stop = (index - self.span[0] for index in self.gate)
        count = stop - first
        before, after = self.force[first % count : first], self.force[stop:]
        sides = before, after[: len(after) // count * count]
        sections = np.concatenate(sides).reshape(-1, count)
        if not sections.size or self.background.quantization.offset:
            return math.inf
        frequency = np.fft.rfftfreq(count, 1 / self.sample_rate)[1:]
        window = np.hanning(count + 2)[1:-1]
        power = (np.abs(np.fft.rfft(window * sections, axis=1)[:, 1:]) ** 2).mean(axis=0)
        ratio = power / self.background.density(frequency)
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

    def covariance_of(self, functionals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the covariance, [k, k], of the errors of weighted sums of the force in the gate.

        The rows of `functionals`, [k, n], are the weights of the samples.
        """
        bounds = np.rint(np.linspace(0, functionals.shape[1], len(self.covariance) + 1))
        summed = np.add.reduceat(functionals, bounds[:-1].astype(int), axis=1)
        result: NDArray[np.float64] = self.white_variance * functionals @ functionals.T
        return result + summed @ self.covariance @ summed.T


def find_contact(section: Section, force: NDArray[np.float64], background: Background) -> Contact:
    """Return the contact of a section; `force` is that without its background, N, shape (n,)."""
    rate, chain = section.sample_rate, section.chain
    touch, begin = find_edge(section, force, background, side=1)
    release, end = find_edge(section, force, background, side=-1)
    # Samples into which filters spread the flanks belong to the gate.
    margin = GATE_SAMPLES + int((GATE_RATE / rate) ** 2)
    margin += int(CORRECTION_PERIODS * rate / chain.highest / 2) if chain else 0
    gate = (
        max(int((touch.value - 3 * touch.uncertainty) * rate) - margin, 0),
        min(int((release.value + 3 * release.uncertainty) * rate) + margin + 1, len(force)),
    )
    length = int(MAX_BACKGROUND * rate)
    span = (max(0, gate[0] - length), min(len(force), gate[1] + length))
    return Contact(
        touch,
        release,
        begin,
        end,
        background.peak,
        span,
        force[slice(*span)],
        (section.force - force)[slice(*span)],
        gate,
        background.error_covariance(uniform_cells(*gate, rate)),
        (background.ends[0], len(force) / rate - background.ends[1]),
        background,
        rate,
    )


def band_functionals(count: int, rate: float, lower: float, upper: float) -> NDArray[np.float64]:
    """Return functionals of samples whose squares add up to the energy in a band, [n, count].

    They are the Fourier integrals at the nodes of a Gauss quadrature over the band.
    """
    time = np.arange(count) / rate
    nodes, weights = leggauss(12 + int(2 * (upper - lower) * count / rate))
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
