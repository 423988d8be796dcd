"""First touch and begin of a contact from a flank of its force.

Derivation: docs/recordings_theory.md, section 3.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular

from thud.impact.contact_time import AVERAGING_WIDTH, THRESHOLD, average_within
from thud.level.estimate import Estimate
from thud.recordings.background import cell_means

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.background import Background
    from thud.recordings.drops import Section

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


def find_edge(
    section: Section, force: NDArray[np.float64], background: Background, side: int
) -> tuple[Estimate, Estimate]:
    """Return first touch and begin of a contact (side 1), or its release and end (side -1), s.

    `force` is that of the section without its background, N. Times are from its first sample;
    begin and end are at 1 % of the peak.
    """
    rate = section.sample_rate
    index = section.contact[0 if side > 0 else 1]
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
        # and a step: the edge by the time that the force needs for both.
        limit = THRESHOLD * background.peak + 1.5 * quantization.step
        later = side * np.flatnonzero(force > limit) / rate
        rise = quantization.offset / quantization.step * (later[later > middle].min() - middle)
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
