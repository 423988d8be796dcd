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

# Quiet used on either side of the contact, s, and its cells: length up to a distance from the
# contact, s. Farther quiet lowers the noise of the offset by less than 5 %.
QUIET = 0.1
QUIET_CELLS = ((5e-4, 5e-3), (2e-3, 25e-3), (3e-3, QUIET))
# Length of a flank in the search for the touch, s, room before it, and the latest touch, behind the
# begin that the search for drops has found.
FLANK = 3e-3
ROOM = 2e-3
LATEST = 1e-3
# Cells of the flank, s: the finest, the coarsest around the touch, and the part of the distance to
# the touch elsewhere.
FINEST = 2e-5
COARSEST = 1e-4
GROWTH = 0.15
# Cells of the contact, s.
CONTACT_CELL = 2e-4
# The gate of the levels reaches this many samples beyond the contact, and more at low rates,
# whose anti-aliasing filter comes close to the octave of 500 Hz: (GATE_RATE/rate)2 more.
GATE_SAMPLES = 8
GATE_RATE = 10_000.0
# The response to a sample of the correction of a plate dies away within these periods; what lies
# above its reach moves an edge by up to this part of one.
PLATE_PERIODS = 2.0
PLATE_LEFT = 0.03
# Errors of samples that are no noise, as part of the peak: digits, the filter of the recorder.
FLOOR = 2e-4


@dataclass(frozen=True, eq=False)
class Contact(Immutable):
    """Contact of one pulse: its times, in s from the first sample of the window.

    Attributes
    ----------
    touch, release : Estimate
        First touch and release.
    begin, end : Estimate
        Times between which the contact lasts (`thud.impact.contact_time`).
    peak : float
        Maximum of the force below 1.25 kHz, less the offset, N: a scale.
    span : tuple of int
        First sample of the part with its background removed, and the one behind it.
    force : ndarray, shape (span[1] - span[0],)
        Force of the part, N.
    removed : ndarray, shape (span[1] - span[0],)
        Background that was removed, N.
    gate : tuple of int
        First sample of the contact with its margins, and the one behind it.
    covariance : ndarray, shape (n_cell, n_cell)
        Covariance of the background's error in even cells of the gate, N2.
    background_lengths : tuple of float
        Lengths of the background before and after, s.
    background : Background
        The noise, fitted.
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
        """Return linear functionals of the gate's samples summed over its cells: [k, n_cell]."""
        edges = np.rint(np.linspace(0, functionals.shape[1], len(self.covariance) + 1))
        return np.add.reduceat(functionals, edges[:-1].astype(int), axis=1)

    def covariance_of(self, functionals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the covariance of linear functionals of the gate's samples, shape (k, n)."""
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


def _quiet_edges(length: int, rate: float) -> NDArray[np.intp]:
    """Return edges of quiet cells, in samples away from the contact, up to a number of samples."""
    edges = [0.0]
    for width, reach in QUIET_CELLS:
        count = int((reach - edges[-1]) / width + 1e-9)
        edges += list(edges[-1] + width * np.arange(1, count + 1))
    places = np.unique(np.rint(np.array(edges) * rate).astype(int))
    return places[places <= length]


def _spread(rate: float, plate: Plate | None) -> int:
    """Return the samples over which filters spread an edge."""
    periods = int(PLATE_PERIODS * rate / plate.frequency / 2) if plate else 0
    return int((GATE_RATE / rate) ** 2) + periods


@dataclass(frozen=True, eq=False)
class Edges:
    """What is known of first touch and release, and the background between two quiet parts.

    Attributes
    ----------
    touch, release : Posterior
        First touch and release, whose time runs backwards, s from the first sample of the window.
    background : Background
        The noise, fitted.
    offset : float
        Median of the quiet, which was removed before, N.
    quiet : tuple of int
        Where the quiet ends, and begins again, in samples.
    """

    touch: Posterior
    release: Posterior
    background: Background
    offset: float
    quiet: tuple[int, int]


def find_edges(window: Window, known: Background | None = None) -> tuple[Estimate, Estimate]:
    """Return begin and end of a contact, s from the first sample of a window, to about 0.1 ms."""
    edges = find_posteriors(window, window.force, known, passes=1)
    (t0, s0), (t1, s1) = edges.touch.edge()[1], edges.release.edge()[1]
    return Estimate(t0, s0), Estimate(-t1, s1)


def find_contact(window: Window, force: NDArray[np.float64]) -> Contact:
    """Return the contact of a window, the force of which, N, may have been repaired."""
    rate, contact = window.sample_rate, window.contact
    middle = (contact[0] + contact[1]) / 2 / rate
    edges = find_posteriors(window, force, None, passes=2)
    background, (left, right) = edges.background, edges.quiet
    (t0, s0), begin = edges.touch.edge()
    (t1, s1), end = edges.release.edge()
    t1 = -t1
    left_by_plate = PLATE_LEFT / window.plate.frequency if window.plate else 0.0
    margin = GATE_SAMPLES + _spread(rate, window.plate)
    gate = (
        max(int((t0 - 3 * s0) * rate) - margin, 0),
        min(int((t1 + 3 * s1) * rate) + margin + 1, len(force)),
    )
    inner = even_edges(*gate, rate)
    _, covariance = background.predict(cells_between(inner, rate, middle))
    reach = int(QUIET * rate)
    span = (max(0, gate[0] - reach), min(len(force), gate[1] + reach))
    sides = [even_edges(*side, 5 * rate) for side in ((span[0], gate[0]), (gate[1], span[1]))]
    cells = cells_between(np.unique(np.concatenate([*sides, inner])), rate, middle)
    time = np.arange(*span) / rate - middle
    under = np.interp(time, (cells[0] + cells[1]) / 2, background.predict_mean(cells))
    under += edges.offset
    return Contact(
        Estimate(t0, s0),
        Estimate(t1, s1),
        Estimate(begin[0], math.hypot(begin[1], left_by_plate)),
        Estimate(-end[0], math.hypot(end[1], left_by_plate)),
        background.peak,
        span,
        force[slice(*span)] - under,
        under,
        gate,
        covariance,
        (left / rate, (len(force) - right) / rate),
        background,
        rate,
    )


def find_posteriors(
    window: Window, force: NDArray[np.float64], known: Background | None, passes: int
) -> Edges:
    """Return the edges of a contact; the second pass knows where the quiet ends.

    The noise may be known from elsewhere in the signal.
    """
    rate, (first, stop) = window.sample_rate, window.contact
    middle = (first + stop) / 2 / rate
    # Half of a short quiet is kept.
    left = int(max(first - ROOM * rate, first / 2))
    right = int(min(stop + ROOM * rate, (stop + len(force)) / 2))
    touch = (left / rate, first / rate + ROOM)
    release = (stop / rate - ROOM, right / rate)
    offset = float(np.median(np.concatenate([force[:left], force[right:]])))
    force = force - offset
    width = max(1, round(rate / RECORDED_BAND))
    peak = float(uniform_filter1d(force[first:stop], width).max())
    for last in range(passes):
        # The first of two passes needs no more than the grid.
        searches = 1 + 2 * last if passes > 1 else 2
        quiet, mean = quiet_means(force, left, right, rate, middle)
        if known is None:
            known = fit_background(quiet, mean, peak)
        background = Background(quiet, mean, known.draws, peak)
        likely = Background(quiet, mean, known.variances[None], peak)
        found = []
        for sign, near, at, bounds in ((1, left, first, touch), (-1, right, stop, release)):
            ahead = bounds if sign > 0 else (-bounds[1], -bounds[0])
            end = min(ahead[1], sign * at / rate + LATEST) + FLANK
            edges = sign * flank_edges(sign * near, ahead, end, rate, fine=last > 0)
            found.append(
                find_edge(force, edges, ahead, likely, rate, middle, searches, window.plate)
            )
        if last + 1 < passes:
            touch, back = (_reach(one.edge(), 3 / rate + 1e-4) for one in found)
            release = (-back[1], -back[0])
            # What a filter spreads is no quiet.
            beyond = _spread(rate, window.plate)
            left = max(int(touch[0] * rate) - beyond, first // 2)
            right = min(int(release[1] * rate) + 1 + beyond, (stop + len(force) + 1) // 2)
    return Edges(found[0], found[1], background, offset, (left, right))


def _reach(
    edge: tuple[tuple[float, float], tuple[float, float]], room: float
) -> tuple[float, float]:
    """Return times between which first touch and begin lie, with room, s."""
    ends = np.array([(mean - 5 * spread, mean + 5 * spread) for mean, spread in edge])
    return float(ends.min()) - room, float(ends.max()) + room


def even_edges(start: int, stop: int, rate: float) -> NDArray[np.intp]:
    """Return edges of cells of about CONTACT_CELL at a rate, in samples."""
    count = max(1, round((stop - start) / rate / CONTACT_CELL))
    return np.unique(np.rint(np.linspace(start, stop, 1 + count)).astype(int))


def quiet_means(
    force: NDArray[np.float64], left: int, right: int, rate: float, middle: float
) -> tuple[Cells, NDArray[np.float64]]:
    """Return the quiet cells on both sides of a contact, and their means, N."""
    both = (
        left - _quiet_edges(left, rate)[::-1],
        right + _quiet_edges(len(force) - right, rate),
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
    """Return what is known of the touch between bounds, s; of the release where edges fall.

    The time of a release runs backwards, in its bounds too.
    """
    turned = edges[0] > edges[-1]
    edges = edges[::-1] if turned else edges
    edges = edges[(edges >= 0) & (edges <= len(force))]
    cells = cells_between(edges, rate, middle)
    under, covariance = background.predict(cells)
    low, high = max(edges[0] - 1, 0), min(edges[-1] + 1, len(force))
    smooth = np.convolve(force[low:high], SMOOTHING, mode="same")[edges[0] - low :]
    value = _means(smooth, edges - edges[0]) - under
    # Weights of the samples in the smoothed means.
    count = np.diff(edges)
    kernel = SMOOTHING if plate is None else np.convolve(SMOOTHING, _response(plate, rate))
    reach = len(kernel) // 2
    weights = np.zeros((len(count), edges[-1] - edges[0] + 2 * reach))
    weights[np.repeat(np.arange(len(count)), count), reach + np.arange(count.sum())] = 1
    weights = convolve1d(weights / count[:, None], kernel, mode="constant")
    covariance += background.variances[0] * rate / 2 * weights @ weights.T
    covariance += (FLOOR * background.peak) ** 2 * np.eye(len(value))
    time = (cells[0] + cells[1]) / 2 + middle
    if turned:
        time, value, covariance = -time[::-1], value[::-1], covariance[::-1, ::-1]
    flank = Flank(
        time, value, covariance, background.peak, 1 / rate, release=bool(turned), plate=plate
    )
    return find_touch(flank, *bounds, searches)


@lru_cache(maxsize=4)
def _response(plate: Plate, rate: float) -> NDArray[np.float64]:
    """Return what the correction of a plate makes of one sample; its middle is that sample."""
    reach = int(PLATE_PERIODS * rate / plate.frequency)
    unit = np.zeros(2 * reach + 1)
    unit[reach] = 1
    return correct_plate(unit, rate, plate)


def flank_edges(
    quiet: int, bounds: tuple[float, float], end: float, rate: float, *, fine: bool
) -> NDArray[np.intp]:
    """Return edges of flank cells in samples, from the end of the quiet up to a time, s."""
    touch, half = (bounds[0] + bounds[1]) / 2 * rate, (bounds[1] - bounds[0]) / 2 * rate
    edges = [quiet]
    while edges[-1] < end * rate:
        away = max(abs(edges[-1] - touch) - half, 0)
        width = COARSEST * rate
        if fine:
            width = max(FINEST * rate, GROWTH * away, min(half / 10, width))
        edges.append(edges[-1] + max(1, int(width)))
    return np.array(edges)
