"""Background of a recorded pulse: tones, offset, drift, hum, noise; predicted from both sides.

Derivation: docs/recordings_theory.md, section 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len
from scipy.linalg import lapack, solve_triangular
from scipy.ndimage import median_filter, uniform_filter1d

from thud.base.immutable import Immutable, freeze
from thud.base.note import Note
from thud.level.levels import RECORDED_BAND
from thud.recordings.drops import BACKGROUND_MARGIN, MAX_BACKGROUND, Quantization

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
# Standard deviation of the offset, as a fraction of the peak, from which a warning is raised: 0.03
# dB at 250, 0.06 dB at 500 Hz.
MAX_OFFSET = 5e-4
# Minimum drift and hum that are noted, in standard deviations.
MIN_DEVIATIONS = 3.0
# Lowest frequency of a tone, Hz: the noise includes hum with five harmonics. The highest is that of
# the recorded band.
MIN_FREQUENCY = 305.0
# Margins of the background before and after the contact, s: a plate may ring after it.
MARGINS = (5e-3, 10e-3)
# Minimum length of the background on either side, s: noise that the fit takes for a tone adds up to
# a fifth, the contact time over that of the background, to the variance of the noise.
MIN_LENGTH = 0.05
# Minimum power of a tone over the median of the spectrum within MEDIAN_WIDTH, Hz, and power of a
# background without noise.
MIN_POWER = 40.0
MEDIAN_WIDTH = 150.0
NO_POWER = 1e-30
# Amplitude and phase before and after the contact are equal within this fraction of the amplitude
# and this number of standard deviations of the noise; the amplitude exceeds so many of them.
MAX_CHANGE = 0.1
MAX_DEVIATIONS = 4.0
MAX_TONES = 12


@dataclass(frozen=True, eq=False)
class Background(Immutable):
    """Background of a contact: generalized least squares from cells beside it.

    Times of cells are from the first sample of the section. Predictions exclude the errors by
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
    ends : tuple of float
        End of the background before the contact, and its begin after it, s.
    step : float
        Change of the offset at an unknown instant between both, N; zero if there is none.
    tones : tuple of Note
        Tones that were removed before the fit.
    """

    cells: Cells
    mean: NDArray[np.float64]
    variances: NDArray[np.float64]
    peak: float
    log_covariance: NDArray[np.float64] = field(default_factory=lambda: np.zeros((5, 5)))
    quantization: Quantization = field(default_factory=Quantization)
    ends: tuple[float, float] = (0.0, 0.0)
    step: float = 0.0
    tones: tuple[Note, ...] = ()

    def density(self, frequency: ArrayLike) -> NDArray[np.float64]:
        """Return the one-sided density of the noise, N2/Hz, at frequencies above 0 Hz."""
        powers = np.asarray(frequency, dtype=np.float64)[..., None] ** -np.arange(3.0)
        return np.asarray(powers @ self.variances[:3])

    def deviation_between(self, lower: float, upper: float) -> float:
        """Return the standard deviation of the noise between two frequencies, N."""
        widths = (upper - lower, np.log(upper / lower), 1 / lower - 1 / upper)
        return float(np.sqrt(self.variances[:3] @ widths))

    def covariance(self, cells: Cells, other: Cells) -> NDArray[np.float64]:
        """Return the covariance of two sets of cells, N2, [n_cell, n_other], but white noise.

        A step at an instant that is uniformly distributed between the ends has the variance
        step**2 times the fraction of this time that has passed at the earlier of two instants.
        """
        trend = (OFFSET * self.peak) ** 2, (DRIFT * self.peak) ** 2
        scales = np.array([*self.variances[1:], *trend])
        covariance = np.tensordot(scales, unit_covariances(cells, other), 1)
        if self.step:
            passed = (np.interp((a + b) / 2, self.ends, (0, 1)) for a, b in (cells, other))
            covariance += self.step**2 * np.minimum.outer(*passed)
        return np.asarray(covariance)

    @cached_property
    def whiten(self) -> NDArray[np.float64]:
        """Matrix that makes the cells independent and of unit variance, [n_cell, n_cell], 1/N."""
        white = self.variances[0] / 2 / (self.cells[1] - self.cells[0])
        noise = np.diag(white + (QUANTIZATION * self.peak) ** 2)
        factor = np.linalg.cholesky(self.covariance(self.cells, self.cells) + noise)
        unit = np.eye(len(factor))
        return freeze(solve_triangular(factor, unit, lower=True, check_finite=False))

    def predict(self, cells: Cells) -> NDArray[np.float64]:
        """Return the expected background in cells, N."""
        weights = self.whiten.T @ (self.whiten @ self.mean)
        return np.asarray(weights @ self.covariance(self.cells, cells))

    def error_covariance(self, cells: Cells) -> NDArray[np.float64]:
        """Return the covariance of the error of this prediction, N2."""
        known = self.whiten @ self.covariance(self.cells, cells)
        return np.asarray(self.covariance(cells, cells) - known.T @ known)

    @property
    def notes(self) -> tuple[Note, ...]:
        """Tones, step, drift and hum, the last two from three standard deviations on.

        A warning if quantization makes the offset uncertain; the uncertainty includes it.
        """
        notes = [*self.tones]
        quantization = self.quantization
        if quantization.offset > MAX_OFFSET * self.peak:
            others = {"step": quantization.step}
            notes.append(Note("coarse_steps", value=quantization.offset, unit="N", others=others))
        if self.step:
            notes.append(Note("offset_step", value=self.step, unit="N"))
        weights = self.whiten.T @ (self.whiten @ self.mean)
        middle, width = (self.cells[0] + self.cells[1]) / 2, self.cells[1] - self.cells[0]
        prior = (DRIFT * self.peak) ** 2
        drift = float(prior * weights @ middle)
        known = float(np.sum((self.whiten @ middle) ** 2))
        if abs(drift) > MIN_DEVIATIONS * math.sqrt(max(prior - prior**2 * known, 0.0)):
            notes.append(Note("drift_removed", value=drift, unit="N/s"))
        k = int(np.argmax(self.variances[3:]))
        hum = self.variances[3 + k] * unit_covariances(self.cells, self.cells)[2 + k] @ weights
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
    count = len(force)
    tones, notes = find_tones(force, rate, section.contact)
    quiet = force - tones
    # At most half of a short background is cut off.
    before_stop = int(max(first - BACKGROUND_MARGIN * rate, first / 2))
    after_start = int(min(stop + BACKGROUND_MARGIN * rate, (stop + count) / 2))
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
    distances = np.unique(np.rint(DISTANCES * rate).astype(int))
    before = before_stop - distances[distances <= before_stop][::-1]
    after = after_start + distances[distances <= count - after_start]
    background = Background(
        *cell_means(quiet, rate, before, after), np.zeros(5), peak,
        quantization=section.quantization, ends=(before_stop / rate, after_start / rate),
        tones=notes,
    )  # fmt: skip
    if noise is None:
        background = fit_background(background, float(quiet[first:stop].sum() / rate))
    else:
        background = replace(
            background, variances=noise.variances, log_covariance=noise.log_covariance,
            quantization=noise.quantization,
        )  # fmt: skip
    length = int(MAX_BACKGROUND * rate)
    sides = (
        uniform_cells(max(0, before_stop - length), before_stop, rate, QUIET_CELL),
        uniform_cells(before_stop, after_start, rate),
        uniform_cells(after_start, min(count, after_start + length), rate, QUIET_CELL),
    )
    begin, end = (np.concatenate(edges) for edges in zip(*sides, strict=True))
    predicted = background.predict((begin, end))
    return quiet - np.interp(np.arange(count) / rate, (begin + end) / 2, predicted), background


def uniform_cells(start: int, stop: int, rate: float, width: float = CONTACT_CELL) -> Cells:
    """Return uniform cells of about a width, s, from a first to before a stop sample, rate in Hz.

    A sample is the middle of the interval from one half before it to one half after it.
    """
    count = max(1, round((stop - start) / rate / width))
    time = (np.unique(np.rint(np.linspace(start, stop, 1 + count))) - 0.5) / rate
    return time[:-1], time[1:]


def cell_means(
    force: NDArray[np.float64], rate: float, *sides: NDArray[np.intp]
) -> tuple[Cells, NDArray[np.float64]]:
    """Return the cells between the bounds of each side, in samples, and the means of a force, N."""
    bounds = np.concatenate(sides)
    time = (bounds - 0.5) / rate
    mean = np.add.reduceat(force[: bounds[-1]], bounds[:-1]) / np.diff(bounds)
    gaps = np.cumsum([len(side) for side in sides[:-1]], dtype=int) - 1
    begin, end, mean = (np.delete(values, gaps) for values in (time[:-1], time[1:], mean))
    return (begin, end), mean


def fit_background(background: Background, impulse: float) -> Background:
    """Return a background with the fitted noise, and with a step of the offset if there is one.

    The step is fitted together with offset, drift, hum and noise. It is none if the droop of an
    amplifier after the impulse of the contact, N s, explains the background: -1/tau times the
    impulse, decaying with the time constant tau.
    """
    cells, mean, peak = background.cells, background.mean, background.peak
    time = (cells[0] + cells[1] - sum(background.ends)) / 2
    after = np.asarray(time > 0, dtype=np.float64)
    fits = []
    for column in (None, after):
        likely, covariance = fit_noise(cells, mean, peak, column)
        # The means of log-normal variables.
        variances = np.exp(likely + np.diagonal(covariance) / 2)
        variances[0] = max(variances[0], background.quantization.density)
        fits.append(replace(background, variances=variances, log_covariance=covariance))
        if min(len(time) - after.sum(), after.sum()) < MIN_CELLS:
            return fits[0]
    plain, other = fits
    column, white = other.whiten @ after, other.whiten @ mean
    step = float(column @ white / (column @ column))
    if abs(step) < max(MIN_RATIO / math.sqrt(column @ column), MIN_STEP * peak):
        return plain
    squares = float(np.sum((white - step * column) ** 2))
    droop = -impulse / TIME_CONSTANTS * np.exp(-time[:, None] / TIME_CONSTANTS) * after[:, None]
    rest = other.whiten @ (mean[:, None] - droop)
    is_droop = np.min(np.sum(rest**2, axis=0)) < squares + INCREASE
    return plain if is_droop else replace(other, step=step)


def fit_noise(
    cells: Cells, mean: NDArray[np.float64], peak: float, column: NDArray[np.floating] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the most likely logarithms of the variances of the noise, and their covariance.

    Arguments are as in `Background`. A multiple of `column`, [n_cell], of about the peak may be in
    the means. The posterior of the logarithms is approximated as normal, from Newton's method. The
    prior densities increase with the variances up to about those of PRIOR_DEVIATION, so that the
    estimate of absent noise is small and not zero.
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
    return best, np.asarray(np.linalg.inv(curvature), dtype=np.float64)


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


def unit_covariances(cells: Cells, other: Cells) -> NDArray[np.float64]:
    """Return unit covariances of the means over two sets of cells: [6, n_cell, n_other].

    Any two cells are equal or disjoint. The first axis is pink noise, brown noise (each of density
    1 at 1 Hz), hum of 50 Hz and of 60 Hz (each of variance 1), an offset of 1 and a drift of 1 per
    second. Pink and brown noise have the covariances -ln|lag| and -pi**2 |lag|, except for a
    constant, which the unknown offset absorbs: those of means are differences of their second
    integrals at the corners of a pair of cells.
    """
    (times, corners), (other_times, other_corners) = (
        np.unique(pair, return_inverse=True) for pair in (cells, other)
    )
    size = np.maximum(np.abs(np.subtract.outer(times, other_times)), 1e-300)
    integrals = np.array([size**2 * (0.75 - 0.5 * np.log(size)), -(np.pi**2) / 6 * size**3])
    for k, (begin, end) in enumerate((corners, other_corners), 1):
        integrals = integrals.take(end, axis=k) - integrals.take(begin, axis=k)
    widths = [end - begin for begin, end in (cells, other)]
    centers = [(begin + end) / 2 for begin, end in (cells, other)]
    noise = -integrals / np.multiply.outer(*widths)
    # Each harmonic has two frequencies: of the mains plus and minus its deviation.
    order = np.arange(1, N_HARMONIC + 1)
    mains = np.add.outer(MAINS, [-MAINS_DEVIATION, MAINS_DEVIATION])
    frequency = np.multiply.outer(mains, order).reshape(len(MAINS), 1, -1)
    weight = np.tile(np.sqrt(0.5) / order, 2)
    waves, others = (
        weight * np.sinc(frequency * width[:, None])
        * np.exp(2j * np.pi * frequency * center[:, None])
        for width, center in zip(widths, centers, strict=True)
    )  # fmt: skip
    hum = (waves @ others.conj().swapaxes(1, 2)).real
    drift = np.multiply.outer(*centers)
    return np.array([*noise, *hum, np.ones_like(drift), drift])


def find_tones(
    force: NDArray[np.float64], rate: float, contact: tuple[int, int]
) -> tuple[NDArray[np.float64], tuple[Note, ...]]:
    """Return the sum of the tones that last through a contact, N, shape (n,), and notes on them.

    A tone stands out of the spectrum of the background on both sides, with the same amplitude and
    phase: ringing of a plate does not.
    """
    first = contact[0] - math.ceil(MARGINS[0] * rate)
    stop = contact[1] + math.ceil(MARGINS[1] * rate)
    count = len(force)
    if min(first, count - stop) < MIN_LENGTH * rate:
        return np.zeros(count), ()
    # Drift and offset leak less through a window on each side.
    windows, quiet = np.zeros((2, count)), np.zeros(count)
    for side, window in zip((slice(0, first), slice(stop, count)), windows, strict=True):
        window[side] = np.hanning(len(window[side]))
        quiet[side] = force[side] - np.median(force[side])
    window, sizes = windows.sum(axis=0), windows.sum(axis=1)
    time = (np.arange(count) - np.average(np.arange(count), weights=window)) / rate
    length = next_fast_len(2 * count, real=True)
    grid = np.fft.rfftfreq(length, 1 / rate)
    band = slice(*np.searchsorted(grid, [MIN_FREQUENCY, min(RECORDED_BAND, 0.4 * rate)]))
    spectrum = np.abs(np.fft.rfft(window * quiet, length)[band]) ** 2
    width = round(MEDIAN_WIDTH / grid[1])
    usual = np.maximum(median_filter(spectrum, width, mode="reflect"), NO_POWER)
    frequencies: list[float] = []
    tones, amplitudes = np.zeros(count), np.zeros(0)
    outside = window > 0
    while len(frequencies) < MAX_TONES:
        residual = quiet - tones
        power = np.abs(np.fft.rfft(window * residual, length)[band]) ** 2
        k = int(np.argmax(power / usual))
        if not power[k] > MIN_POWER * usual[k]:
            break
        frequency = float(grid[band][k])
        # Newton's step: the slope of the phase over time.
        for _ in range(2):
            turned = window * residual * np.exp(-2j * np.pi * frequency * time)
            slope = (time @ turned / turned.sum()).imag / (window @ time**2)
            frequency += float(slope) * sizes.sum() / 2 / np.pi
        before, after = 2 * (windows @ (residual * np.exp(-2j * np.pi * frequency * time))) / sizes
        amplitude = abs(sizes @ [before, after]) / sizes.sum()
        # The spectrum of noise is its variance times the sum of the squared window.
        variance = float(usual[k]) / math.log(2) / float(window @ window)
        deviation = 2 * math.sqrt(variance * float(((windows**2).sum(axis=1) / sizes**2).sum()))
        limit = MAX_DEVIATIONS * deviation
        if abs(after - before) > MAX_CHANGE * amplitude + limit or amplitude < limit:
            break
        frequencies.append(frequency)
        phase = 2 * np.pi * np.multiply.outer(time, frequencies)
        waves = np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
        factors = np.linalg.lstsq(waves[outside], quiet[outside])[0]
        tones, amplitudes = waves @ factors, np.hypot(*factors.reshape(2, -1))
    return tones, tuple(
        Note("tone_removed", value=float(amplitude), unit="N", others={"frequency": frequency})
        for frequency, amplitude in sorted(zip(frequencies, amplitudes, strict=True))
    )
