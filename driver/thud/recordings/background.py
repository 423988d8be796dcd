"""Background of a recorded pulse: offset, drift, hum and noise, predicted from both sides of it.

Derivation: docs/recordings_theory.md, section 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack, solve_triangular
from scipy.ndimage import uniform_filter1d

from thud.base.immutable import Immutable, freeze
from thud.base.note import Note
from thud.level.levels import RECORDED_BAND
from thud.recordings.quantization import MARGIN, MAX_BACKGROUND, Quantization
from thud.recordings.tones import find_tones

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from thud.recordings.drops import Section

    Cells = tuple[NDArray[np.float64], NDArray[np.float64]]  # begins and ends, s

# The background is averaged over cells between these distances from the contact, s.
DISTANCES = np.r_[0:4.9e-3:5e-4, 5e-3:24.9e-3:2e-3, 25e-3 : MAX_BACKGROUND + 1e-4 : 3e-3]
# Width of the cells in which the background is predicted during the contact and beside it, s.
CONTACT_CELL = 2e-4
QUIET_CELL = 1e-3
# Time from a fifth of the peak to the end of a flank over that from half of it to a fifth. A power
# of time up to 4 passes 1 % in it; in a longer time, strong noise may be a slow release.
REACH = 2.0
# Mains frequencies and their standard deviation, Hz (EN 50160: ±0.5 Hz, usually ±0.1 Hz).
MAINS = (50.0, 60.0)
MAINS_DEVIATION = 0.1
# Number of harmonics of hum; the prior standard deviation of harmonic k is proportional to 1/k.
N_HARMONIC = 5
# Wide prior standard deviations of offset, and of drift per second, as fractions of the peak force.
OFFSET = 1.0
DRIFT = 0.1
# The prior density of the logarithm of a variance is proportional to this power of the variance.
# The power is lower by 1 for large variances: standard deviation of a cell above PRIOR_DEVIATION
# times the peak force.
SLOPE = np.array([0.5, 0.25, 1.0, 0.25, 0.25])
PRIOR_DEVIATION = 0.03
# Standard deviation of each cell due to quantization, as a fraction of the peak force.
QUANTIZATION = 1e-6
# Search for the maximum of the posterior: maximum number of iterations, maximum change of the
# logarithm of a variance, tolerance of the logarithm of the posterior.
MAX_ITERATIONS = 50
MAX_STEP = 3.0
TOLERANCE = 0.02
# A step of the offset exceeds its standard deviation by this factor, and this fraction of the peak.
MIN_RATIO = 5.0
MIN_STEP = 2e-3
# Minimum number of background cells on either side for the search of a step: 30 ms.
MIN_CELLS = 22
# Time constants of an amplifier that may cause the step, s, and the increase of the sum of squares,
# in variances of the noise, up to which it is the cause.
TIME_CONSTANTS = np.geomspace(0.1, 30, 200)
INCREASE = 9.0
# Steps at these fractions of the gate are compared with the interpolated background.
INSTANTS = np.linspace(0, 1, 33)
# Minimum drift and hum that are noted, in standard deviations.
MIN_DEVIATIONS = 3.0


@dataclass(frozen=True, eq=False)
class Background(Immutable):
    """Background of a contact: generalized least squares from cells beside it.

    Times of cells are from the middle of the contact. Predictions exclude the errors by
    quantization and the white noise of the predicted samples.

    Attributes
    ----------
    cells : tuple of ndarray, shape (n_cell,)
        Begins and ends of the cells, s.
    mean : ndarray, shape (n_cell,)
        Mean forces in the cells, N.
    variances : ndarray, shape (5,)
        Expected densities of white, pink and brown noise at 1 Hz, N2/Hz, and variances of hum of
        50 and of 60 Hz, N2.
    peak : float
        Approximate maximum of the force below 1.25 kHz without the offset, N.
    log_covariance : ndarray, shape (5, 5)
        Covariance of the natural logarithms of the variances.
    quantization : Quantization
        Errors that the noise does not average.
    middle : float
        Middle of the contact, s from the first sample.
    ends : tuple of float
        End of the background before the contact, and its begin after it, s from the first sample.
    tones : tuple of Note
        Tones that were removed before the fit.
    """

    cells: Cells
    mean: NDArray[np.float64]
    variances: NDArray[np.float64]
    peak: float
    log_covariance: NDArray[np.float64] = field(default_factory=lambda: np.zeros((5, 5)))
    quantization: Quantization = field(default_factory=Quantization)
    middle: float = 0.0
    ends: tuple[float, float] = (0.0, 0.0)
    tones: tuple[Note, ...] = ()

    def density(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """Return the one-sided density of the noise, N2/Hz, at frequencies above 0 Hz."""
        powers = np.asarray(frequency, dtype=np.float64)[..., None] ** -np.arange(3.0)
        return np.asarray(powers @ self.variances[:3])

    def density_deviation(self, frequency: float) -> float:
        """Return the standard uncertainty of the density at a frequency, N2/Hz."""
        change = self.variances[:3] * frequency ** -np.arange(3.0)
        return float(np.sqrt(change @ self.log_covariance[:3, :3] @ change))

    def deviation_between(self, lower: float, upper: float) -> float:
        """Return the standard deviation of the noise between two frequencies, N."""
        widths = (upper - lower, np.log(upper / lower), 1 / lower - 1 / upper)
        return float(np.sqrt(self.variances[:3] @ widths))

    def covariance(self, cells: Cells, other: Cells) -> NDArray[np.float64]:
        """Return the covariance of two sets of cells, N2, [n_cell, n_other], but white noise."""
        trend = (OFFSET * self.peak) ** 2, (DRIFT * self.peak) ** 2
        scales = np.array([*self.variances[1:], *trend])
        return np.tensordot(scales, unit_covariances(cells, other), 1)

    @cached_property
    def whiten(self) -> NDArray[np.float64]:
        """Matrix that makes the cells independent and of unit variance, [n_cell, n_cell], 1/N."""
        white = self.variances[0] / 2 / (self.cells[1] - self.cells[0])
        noise = np.diag(white + (QUANTIZATION * self.peak) ** 2)
        factor = np.linalg.cholesky(self.covariance(self.cells, self.cells) + noise)
        unit = np.eye(len(factor))
        return freeze(np.asarray(solve_triangular(factor, unit, lower=True, check_finite=False)))

    @cached_property
    def _weights(self) -> NDArray[np.float64]:
        """Inverse of the covariance of the cells times their means."""
        return np.asarray(self.whiten.T @ (self.whiten @ self.mean))

    def predict(self, cells: Cells) -> NDArray[np.float64]:
        """Return the expected background in cells, N."""
        return np.asarray(self._weights @ self.covariance(self.cells, cells))

    def error_covariance(self, cells: Cells) -> NDArray[np.float64]:
        """Return the covariance of the error of this prediction, N2."""
        known = self.whiten @ self.covariance(self.cells, cells)
        return np.asarray(self.covariance(cells, cells) - known.T @ known)

    @property
    def notes(self) -> tuple[Note, ...]:
        """Tones, drift and hum, as far as they exceed three standard deviations."""
        notes = [*self.tones]
        middle, width = (self.cells[0] + self.cells[1]) / 2, self.cells[1] - self.cells[0]
        prior = (DRIFT * self.peak) ** 2
        drift = float(prior * self._weights @ middle)
        known = float(np.sum((self.whiten @ middle) ** 2))
        if abs(drift) > MIN_DEVIATIONS * math.sqrt(max(prior - prior**2 * known, 0.0)):
            notes.append(Note("drift_removed", value=drift, unit="N/s"))
        k = int(np.argmax(self.variances[3:]))
        waves = _waves(self.cells)[k]
        hum = self.variances[3 + k] * waves @ (waves.T @ self._weights)
        amplitude = math.sqrt(2 * np.mean(hum**2))
        if amplitude > MIN_DEVIATIONS * math.sqrt(np.mean(self.variances[0] / width) / len(hum)):
            others = {"frequency": MAINS[k]}
            notes.append(Note("hum_removed", value=amplitude, unit="N", others=others))
        return tuple(notes)


def remove_background(
    section: Section, noise: Background | None = None
) -> tuple[NDArray[np.float64], Background]:
    """Return the force of a section without its background, N, shape (n,), and the background.

    Tones are removed by least squares. Offset, drift, hum and slow noise during the contact are
    their generalized least-squares prediction from the background on both sides. `noise` is the fit
    of the noise to another section; if None, it is fitted to this one.
    """
    force, rate, (first, stop) = section.force, section.sample_rate, section.contact
    count, middle = len(force), (first + stop) / 2 / rate
    tones, notes = find_tones(force, rate, section.contact)
    quiet = force - tones
    # At most half of a short background is cut off.
    before_stop = int(max(first - MARGIN * rate, first / 2))
    after_start = int(min(stop + MARGIN * rate, (stop + count) / 2))
    quiet -= float(np.median(np.concatenate([quiet[:before_stop], quiet[after_start:]])))
    smooth = uniform_filter1d(quiet[first:stop], max(1, round(rate / RECORDED_BAND)))
    low, peak = float(smooth.min()), float(smooth.max())
    half, fifth = (
        first + np.flatnonzero(smooth >= low + level * (peak - low))[[0, -1]]
        for level in (0.5, 0.2)
    )
    reach = fifth + REACH * (fifth - half)
    before_stop = int(np.clip(reach[0], first / 2, before_stop))
    after_start = int(np.clip(reach[1], after_start, (stop + count) / 2))
    cells, mean = background_means(quiet, before_stop, after_start, rate, middle)
    if noise is None:
        variances, log_covariance = fit_noise(cells, mean, peak)
        variances[0] = max(variances[0], section.quantization.density)
        quantization = section.quantization
    else:
        variances, log_covariance = noise.variances, noise.log_covariance
        quantization = noise.quantization
    background = Background(
        cells, mean, variances, peak, log_covariance, quantization, middle,
        (before_stop / rate, after_start / rate), notes,
    )  # fmt: skip
    length = int(MAX_BACKGROUND * rate)
    begin, end = max(0, before_stop - length), min(count, after_start + length)
    bounds = [
        uniform_bounds(begin, before_stop, rate, QUIET_CELL),
        uniform_bounds(before_stop, after_start, rate),
        uniform_bounds(after_start, end, rate, QUIET_CELL),
    ]
    predicted = cells_between(np.unique(np.concatenate(bounds)), rate, middle)
    time, centers = np.arange(count) / rate - middle, (predicted[0] + predicted[1]) / 2
    return quiet - np.interp(time, centers, background.predict(predicted)), background


def cells_between(bounds: NDArray[np.intp], rate: float, middle: float) -> Cells:
    """Return begins and ends of cells, s from the middle of the contact; bounds are in samples."""
    time = np.asarray((bounds - 0.5) / rate - middle, dtype=np.float64)
    return time[:-1], time[1:]


def uniform_bounds(
    start: int, stop: int, rate: float, width: float = CONTACT_CELL
) -> NDArray[np.intp]:
    """Return bounds of cells of about a width, s, in samples at a rate, Hz."""
    count = max(1, round((stop - start) / rate / width))
    return np.unique(np.rint(np.linspace(start, stop, 1 + count)).astype(int))


def cell_means(force: NDArray[np.float64], bounds: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the means of a force, N, over cells with bounds in samples."""
    total: NDArray[np.float64] = np.add.reduceat(force[: bounds[-1]], bounds[:-1])
    return total / np.diff(bounds)


def background_means(
    force: NDArray[np.float64], before_stop: int, after_start: int, rate: float, middle: float
) -> tuple[Cells, NDArray[np.float64]]:
    """Return the background cells on both sides of a contact, and their mean forces, N."""
    distances = np.unique(np.rint(DISTANCES * rate).astype(int))
    sides = (
        before_stop - distances[distances <= before_stop][::-1],
        after_start + distances[distances <= len(force) - after_start],
    )
    begins, ends = zip(*(cells_between(side, rate, middle) for side in sides), strict=True)
    mean = [cell_means(force, side) for side in sides if len(side) > 1]
    return (np.concatenate(begins), np.concatenate(ends)), np.concatenate(mean)


def fit_noise(
    cells: Cells,
    mean: NDArray[np.float64],
    peak: float,
    column: NDArray[np.floating] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the expected variances of the noise, and the covariance of their logarithms.

    Arguments and results are as in `Background`; times are relative to about the middle of the
    contact. A multiple of `column`, [n_cell], of about the peak may be in the means. The posterior
    of the logarithms is approximated as normal, from Newton's method. The prior densities increase
    with the variances up to about those of PRIOR_DEVIATION, so that the estimate of absent noise is
    small and not zero.
    """
    colored = unit_covariances(cells, cells)
    unit = np.array([np.diag(0.5 / (cells[1] - cells[0])), *colored[:4]])
    fixed = peak**2 * np.tensordot([OFFSET**2, DRIFT**2], colored[4:], 1)
    fixed += (QUANTIZATION * peak) ** 2 * np.eye(len(mean))
    if column is not None:
        fixed += peak**2 * np.multiply.outer(column, column)
    # Approximate variance of a cell per unit of each variance; for brown noise over 0.02 s, the
    # duration of a contact.
    scale = np.array([np.mean(np.diagonal(unit[0])), 1.0, np.pi**2 * 0.02, 1.0, 1.0])
    large = (PRIOR_DEVIATION * peak) ** 2 / scale
    # First guess of the variance: half the mean square difference of neighbors.
    variance = np.mean(np.diff(mean) ** 2) / 2 if len(mean) > 1 else 0.0
    variance += (QUANTIZATION * peak) ** 2
    best = np.log(variance * np.array([1, 0.1, 0.1, 0.05, 0.05]) / scale)
    value, score, curvature = _log_posterior(best, unit, fixed, mean, large)
    length = 1.0
    for _ in range(MAX_ITERATIONS):
        step = np.linalg.solve(curvature, score)
        step *= length * min(1.0, MAX_STEP / float(np.abs(step).max()))
        trial = _log_posterior(best + step, unit, fixed, mean, large)
        gain = trial[0] - value
        if gain > 0:
            best, length = best + step, min(1.0, 2 * length)
            value, score, curvature = trial
        else:
            length /= 4
        if abs(gain) < TOLERANCE:
            break
    covariance = np.asarray(np.linalg.inv(curvature), dtype=np.float64)
    # The mean of a log-normal variable.
    return np.exp(best + np.diagonal(covariance) / 2), covariance


def _log_posterior(
    phi: NDArray[np.float64],
    unit: NDArray[np.float64],
    fixed: NDArray[np.float64],
    mean: NDArray[np.float64],
    large: NDArray[np.float64],
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Return the posterior of logarithms of the variances: logarithm, gradient, curvature.

    The covariance of the cells is `fixed`, and `unit` times the variances. The curvature is the
    average information (Gilmour, Thompson and Cullis 1995) of likelihood and priors.
    """
    theta = np.exp(phi)
    factor, failed = lapack.dpotrf(np.tensordot(theta, unit, 1) + fixed, lower=True)
    if failed:
        return -np.inf, np.zeros_like(phi), np.eye(len(phi))
    inverse = lapack.dpotri(factor, lower=True)[0]
    inverse = np.tril(inverse) + np.tril(inverse, -1).T
    weighted = inverse @ mean
    value = -np.log(np.diagonal(factor)).sum() - 0.5 * mean @ weighted
    value += SLOPE @ phi - np.log1p(theta / large).sum()
    products = (unit @ weighted) * theta[:, None]
    trace = theta * np.einsum("kij,ij->k", unit, inverse)
    score = 0.5 * (products @ weighted - trace) + SLOPE - theta / (theta + large)
    # At the maximum, the scores of likelihood and prior cancel; the latter is about SLOPE.
    return float(value), score, 0.5 * products @ inverse @ products.T + np.diag(SLOPE)


def find_offset_step(background: Background, impulse: float) -> float:
    """Return the step of the offset between the ends of a contact, N; zero if there is none.

    A step is fitted together with offset, drift, hum and noise. It is none if the droop of an
    amplifier after the impulse of the contact, N s, explains the background: -1/tau times the
    impulse, decaying with the time constant tau.
    """
    cells, mean, peak = background.cells, background.mean, background.peak
    time = (cells[0] + cells[1]) / 2
    after = np.asarray(time > 0, dtype=np.float64)
    if min(len(time) - after.sum(), after.sum()) < MIN_CELLS:
        return 0.0
    variances, _ = fit_noise(cells, mean, peak, column=after)
    whiten = replace(background, variances=variances).whiten
    column, white = whiten @ after, whiten @ mean
    step = float(column @ white / (column @ column))
    if abs(step) < max(MIN_RATIO / math.sqrt(column @ column), MIN_STEP * peak):
        return 0.0
    squares = float(np.sum((white - step * column) ** 2))
    droop = -impulse / TIME_CONSTANTS * np.exp(-time[:, None] / TIME_CONSTANTS) * after[:, None]
    rest = whiten @ (mean[:, None] - droop)
    return 0.0 if np.min(np.sum(rest**2, axis=0)) < squares + INCREASE else step


def step_errors(step: float, count: int) -> NDArray[np.float64]:
    """Return errors of a force if its offset changed at one of several instants, N, [k, count].

    The removed background is the line between both offsets.
    """
    line = np.linspace(0, step, count)
    index = np.arange(count)
    return np.array([line - step * (index >= instant * count) for instant in INSTANTS])


def unit_covariances(cells: Cells, other: Cells) -> NDArray[np.float64]:
    """Return unit covariances of the means over two sets of cells: [6, n_cell, n_other].

    Any two cells are equal or disjoint. The first axis is pink noise, brown noise (each of density
    1 at 1 Hz), hum of 50 Hz and of 60 Hz (each of variance 1), an offset of 1 and a drift of 1 per
    second. Pink and brown noise have the covariances -ln|lag| and -pi**2 |lag|, except for a
    constant, which the unknown offset absorbs: those of means are differences of their second
    integrals at the corners of a pair of cells.
    """
    (a, b), (c, d) = cells, other
    pairs = ((b, c), (a, c), (b, d), (a, d))
    size = np.maximum(np.abs([np.subtract.outer(*pair) for pair in pairs]), 1e-300)
    integrals = [size**2 * (0.75 - 0.5 * np.log(size)), -(np.pi**2) / 6 * size**3]
    signs = np.array([1, -1, -1, 1])
    pink, brown = np.tensordot(integrals, signs, (1, 0)) / np.multiply.outer(b - a, d - c)
    hum = _waves(cells) @ _waves(other).swapaxes(1, 2)
    drift = np.multiply.outer((a + b) / 2, (c + d) / 2)
    return np.array([pink, brown, *hum, np.ones_like(drift), drift])


def _waves(cells: Cells) -> NDArray[np.float64]:
    """Return means over cells of the waves of each hum, [n_mains, n_cell, n_wave].

    Each harmonic has waves of two fundamentals, MAINS plus and minus MAINS_DEVIATION.
    """
    middle, width = (cells[0] + cells[1]) / 2, cells[1] - cells[0]
    order = np.arange(1, N_HARMONIC + 1)
    fundamentals = np.add.outer(MAINS, [-MAINS_DEVIATION, MAINS_DEVIATION])
    frequency = (fundamentals[:, None] * order[:, None]).reshape(len(MAINS), 1, -1)
    weight = np.repeat(np.sqrt(0.5) / order, 2) * np.sinc(frequency * width[:, None])
    phase = 2 * np.pi * frequency * middle[:, None]
    return np.concatenate([weight * np.cos(phase), weight * np.sin(phase)], axis=-1)
