"""Contact of one pulse: background, first touch and release (docs/recordings_theory.md)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import convolve1d, uniform_filter1d

from thud.base.immutable import Immutable
from thud.level.estimate import Estimate
from thud.level.levels import RECORDED_BAND
from thud.recordings.flanks import SMOOTHING, Flank, Posterior, find_touch
from thud.recordings.noise import Background, fit_background
from thud.recordings.plate import correct_plate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.drops import Window
    from thud.recordings.noise import Cells
    from thud.recordings.plate import Plate

# Length of background used on either side of the contact, s, and its cells: width up to a distance
# from the contact, s. More background lowers the noise of the offset by less than 5 %.
MAX_BACKGROUND = 0.1
BACKGROUND_CELLS = ((5e-4, 5e-3), (2e-3, 25e-3), (3e-3, MAX_BACKGROUND))
# Length of a flank in the search for the touch, s, margin before it, and the latest touch after the
# start of the pulse as found by the search for drops.
FLANK = 3e-3
MARGIN = 2e-3
MAX_DELAY = 1e-3
# Cells of the flank, s: minimum, maximum around the touch, and elsewhere as fraction of the
# distance to the touch.
MIN_CELL = 2e-5
MAX_CELL = 1e-4
GROWTH = 0.15
# Cells of the contact, s.
CONTACT_CELL = 2e-4
# The gate of the levels extends this many samples beyond the contact, and (GATE_RATE/rate)2 more at
# low rates, whose anti-aliasing filter is close to the octave of 500 Hz.
GATE_SAMPLES = 8
GATE_RATE = 10_000.0
# Periods of the resonance within which the correction of a plate responds to a sample; content
# above its maximum frequency moves an edge by up to this fraction of a period.
PLATE_PERIODS = 2.0
PLATE_ERROR = 0.03
# Errors of samples other than noise, as fraction of the peak: quantization, filter of the recorder.
SAMPLE_ERROR = 2e-4


@dataclass(frozen=True, eq=False)
class Contact(Immutable):
    """Contact of one pulse; times are in s from the first sample of the window.

    Attributes
    ----------
    touch, release : Estimate
        First touch and release.
    begin, end : Estimate
        Limits of the contact time (`thud.impact.contact_time`).
    peak : float
        Maximum of the force below 1.25 kHz without the offset, N: a scale.
    span : tuple of int
        First and stop index of the force without background.
    force, removed : ndarray, shape (span[1] - span[0],)
        Force, N, and the background that was removed from it, N.
    gate : tuple of int
        First and stop index of the contact with its margins.
    covariance : ndarray, shape (n_cell, n_cell)
        Covariance of the error of the background in uniform cells of the gate, N2.
    background_lengths : tuple of float
        Length of the background before and after, s.
    background : Background
        The fitted noise.
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
    def gated(self) -> NDArray[np.float64]:
        """Force of the gate, N."""
        first = self.span[0]
        return self.force[self.gate[0] - first : self.gate[1] - first]

    def summed(self, functionals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sum linear functionals of the samples of the gate over its cells: [k, n_cell]."""
        edges = np.rint(np.linspace(0, functionals.shape[1], len(self.covariance) + 1))
        return np.add.reduceat(functionals, edges[:-1].astype(int), axis=1)

    def covariance_of(self, functionals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the covariance of linear functionals of the samples of the gate, shape (k, n)."""
        white = self.background.variances[0] * self.sample_rate / 2
        summed = self.summed(functionals)
        result: NDArray[np.float64] = white * functionals @ functionals.T
        return result + summed @ self.covariance @ summed.T


def cells_between(edges: NDArray[np.intp], rate: float, middle: float) -> Cells:
    """Return begins and ends of cells between samples, s from the middle of the contact."""
    time = np.asarray((edges - 0.5) / rate - middle, dtype=np.float64)
    return time[:-1], time[1:]


def _means(force: NDArray[np.float64], edges: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the means over the samples between edges."""
    total: NDArray[np.float64] = np.add.reduceat(force[: edges[-1]], edges[:-1])
    return total / np.diff(edges)


def _background_edges(length: int, rate: float) -> NDArray[np.intp]:
    """Return edges of background cells, in samples from the contact, up to a length."""
    edges = [0.0]
    for width, reach in BACKGROUND_CELLS:
        count = int((reach - edges[-1]) / width + 1e-9)
        edges += list(edges[-1] + width * np.arange(1, count + 1))
    indices = np.unique(np.rint(np.array(edges) * rate).astype(int))
    return indices[indices <= length]


def _spread(rate: float, plate: Plate | None) -> int:
    """Return the number of samples over which filters spread an edge."""
    periods = int(PLATE_PERIODS * rate / plate.frequency / 2) if plate else 0
    return int((GATE_RATE / rate) ** 2) + periods


@dataclass(frozen=True, eq=False)
class Edges:
    """Posteriors of first touch, and of release in reversed time, s from the first sample.

    `limits` are the stop index of the background before, and the first index of that after the
    contact; the offset, N, is the median of both, which was removed before.
    """

    touch: Posterior
    release: Posterior
    background: Background
    offset: float
    limits: tuple[int, int]


def find_edges(window: Window, noise: Background | None = None) -> tuple[Estimate, Estimate]:
    """Return begin and end of a contact within about 0.1 ms, s from the first sample."""
    edges = find_posteriors(window, window.force, noise, passes=1)
    (t0, s0), (t1, s1) = edges.touch.edge()[1], edges.release.edge()[1]
    return Estimate(t0, s0), Estimate(-t1, s1)


def find_contact(window: Window, force: NDArray[np.float64]) -> Contact:
    """Return the contact in a window from its force, N, which may have been repaired."""
    rate, contact = window.sample_rate, window.contact
    middle = (contact[0] + contact[1]) / 2 / rate
    edges = find_posteriors(window, force, None, passes=2)
    background, (before_stop, after_start) = edges.background, edges.limits
    (t0, s0), begin = edges.touch.edge()
    (t1, s1), end = edges.release.edge()
    t1 = -t1
    plate_error = PLATE_ERROR / window.plate.frequency if window.plate else 0.0
    margin = GATE_SAMPLES + _spread(rate, window.plate)
    gate = (
        max(int((t0 - 3 * s0) * rate) - margin, 0),
        min(int((t1 + 3 * s1) * rate) + margin + 1, len(force)),
    )
    inner = uniform_edges(*gate, rate)
    _, covariance = background.predict(cells_between(inner, rate, middle))
    reach = int(MAX_BACKGROUND * rate)
    span = (max(0, gate[0] - reach), min(len(force), gate[1] + reach))
    sides = [uniform_edges(*side, 5 * rate) for side in ((span[0], gate[0]), (gate[1], span[1]))]
    cells = cells_between(np.unique(np.concatenate([*sides, inner])), rate, middle)
    time = np.arange(*span) / rate - middle
    removed = np.interp(time, (cells[0] + cells[1]) / 2, background.predict_mean(cells))
    removed += edges.offset
    return Contact(
        Estimate(t0, s0),
        Estimate(t1, s1),
        Estimate(begin[0], math.hypot(begin[1], plate_error)),
        Estimate(-end[0], math.hypot(end[1], plate_error)),
        background.peak,
        span,
        force[slice(*span)] - removed,
        removed,
        gate,
        covariance,
        (before_stop / rate, (len(force) - after_start) / rate),
        background,
        rate,
    )


def find_posteriors(
    window: Window, force: NDArray[np.float64], noise: Background | None, passes: int
) -> Edges:
    """Return the edges of a contact; the second pass starts from the background found by the first.

    Noise that is known from another part of the signal is not fitted again.
    """
    rate, (first, stop) = window.sample_rate, window.contact
    middle = (first + stop) / 2 / rate
    # Half of a short background is kept.
    before_stop = int(max(first - MARGIN * rate, first / 2))
    after_start = int(min(stop + MARGIN * rate, (stop + len(force)) / 2))
    touch = (before_stop / rate, first / rate + MARGIN)
    release = (stop / rate - MARGIN, after_start / rate)
    offset = float(np.median(np.concatenate([force[:before_stop], force[after_start:]])))
    force = force - offset
    width = max(1, round(rate / RECORDED_BAND))
    peak = float(uniform_filter1d(force[first:stop], width).max())
    for pass_index in range(passes):
        # The first of two passes needs the coarse grid only.
        searches = 1 + 2 * pass_index if passes > 1 else 2
        cells, mean = background_means(force, before_stop, after_start, rate, middle)
        if noise is None:
            noise = fit_background(cells, mean, peak)
        background = Background(cells, mean, noise.draws, peak)
        fixed = Background(cells, mean, noise.variances[None], peak)
        posteriors = []
        for sign, near, at, bounds in (
            (1, before_stop, first, touch),
            (-1, after_start, stop, release),
        ):
            ahead = bounds if sign > 0 else (-bounds[1], -bounds[0])
            end = min(ahead[1], sign * at / rate + MAX_DELAY) + FLANK
            edges = sign * flank_edges(sign * near, ahead, end, rate, fine=pass_index > 0)
            posteriors.append(
                find_edge(force, edges, ahead, fixed, rate, middle, searches, window.plate)
            )
        if pass_index + 1 < passes:
            touch, back = (_reach(posterior.edge(), 3 / rate + 1e-4) for posterior in posteriors)
            release = (-back[1], -back[0])
            # Samples that a filter affects are no background.
            beyond = _spread(rate, window.plate)
            before_stop = max(int(touch[0] * rate) - beyond, first // 2)
            after_start = min(int(release[1] * rate) + 1 + beyond, (stop + len(force) + 1) // 2)
    return Edges(posteriors[0], posteriors[1], background, offset, (before_stop, after_start))


def _reach(
    edge: tuple[tuple[float, float], tuple[float, float]], margin: float
) -> tuple[float, float]:
    """Return limits of first touch and begin, with a margin, s."""
    ends = np.array([(mean - 5 * spread, mean + 5 * spread) for mean, spread in edge])
    return float(ends.min()) - margin, float(ends.max()) + margin


def uniform_edges(start: int, stop: int, rate: float) -> NDArray[np.intp]:
    """Return edges of cells of about CONTACT_CELL at a rate, in samples."""
    count = max(1, round((stop - start) / rate / CONTACT_CELL))
    return np.unique(np.rint(np.linspace(start, stop, 1 + count)).astype(int))


def background_means(
    force: NDArray[np.float64], before_stop: int, after_start: int, rate: float, middle: float
) -> tuple[Cells, NDArray[np.float64]]:
    """Return the background cells on both sides of a contact, and their mean forces, N."""
    both = (
        before_stop - _background_edges(before_stop, rate)[::-1],
        after_start + _background_edges(len(force) - after_start, rate),
    )
    begins, ends = zip(*(cells_between(edges, rate, middle) for edges in both), strict=True)
    mean = [_means(force, edges) for edges in both if len(edges) > 1]
    return (np.concatenate(begins), np.concatenate(ends)), np.concatenate(mean)


def find_edge(  # noqa: PLR0913, PLR0917 - what a flank is
    force: NDArray[np.float64],
    edges: NDArray[np.intp],
    bounds: tuple[float, float],
    background: Background,
    rate: float,
    middle: float,
    searches: int,
    plate: Plate | None = None,
) -> Posterior:
    """Return the posterior of the touch between bounds, s; of the release if the edges fall.

    The time of a release is reversed, also in its bounds.
    """
    reversed_ = edges[0] > edges[-1]
    edges = edges[::-1] if reversed_ else edges
    edges = edges[(edges >= 0) & (edges <= len(force))]
    cells = cells_between(edges, rate, middle)
    mean, covariance = background.predict(cells)
    low, high = max(edges[0] - 1, 0), min(edges[-1] + 1, len(force))
    smooth = np.convolve(force[low:high], SMOOTHING, mode="same")[edges[0] - low :]
    value = _means(smooth, edges - edges[0]) - mean
    # Weights of the samples in the smoothed means.
    count = np.diff(edges)
    kernel = SMOOTHING if plate is None else np.convolve(SMOOTHING, _response(plate, rate))
    reach = len(kernel) // 2
    weights = np.zeros((len(count), edges[-1] - edges[0] + 2 * reach))
    weights[np.repeat(np.arange(len(count)), count), reach + np.arange(count.sum())] = 1
    weights = convolve1d(weights / count[:, None], kernel, mode="constant")
    covariance += background.variances[0] * rate / 2 * weights @ weights.T
    covariance += (SAMPLE_ERROR * background.peak) ** 2 * np.eye(len(value))
    time = (cells[0] + cells[1]) / 2 + middle
    if reversed_:
        time, value, covariance = -time[::-1], value[::-1], covariance[::-1, ::-1]
    flank = Flank(
        time, value, covariance, background.peak, 1 / rate, release=bool(reversed_), plate=plate
    )
    return find_touch(flank, *bounds, searches)


@lru_cache(maxsize=4)
def _response(plate: Plate, rate: float) -> NDArray[np.float64]:
    """Return the response of the correction of a plate to one sample, in its middle."""
    reach = int(PLATE_PERIODS * rate / plate.frequency)
    unit = np.zeros(2 * reach + 1)
    unit[reach] = 1
    return correct_plate(unit, rate, plate)


def flank_edges(
    first: int, bounds: tuple[float, float], end: float, rate: float, *, fine: bool
) -> NDArray[np.intp]:
    """Return edges of flank cells in samples, from the end of the background to a time, s."""
    touch, half = (bounds[0] + bounds[1]) / 2 * rate, (bounds[1] - bounds[0]) / 2 * rate
    edges = [first]
    while edges[-1] < end * rate:
        away = max(abs(edges[-1] - touch) - half, 0)
        width = MAX_CELL * rate
        if fine:
            width = max(MIN_CELL * rate, GROWTH * away, min(half / 10, width))
        edges.append(edges[-1] + max(1, int(width)))
    return np.array(edges)
