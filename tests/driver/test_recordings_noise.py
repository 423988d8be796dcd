"""Noise of recordings: covariances, prediction of the background, posterior, energies of bands."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import codes, noted
from recording_files import noisy
from scipy import stats
from scipy.integrate import quad
from synthetic import coloured_noise, make_drop, noise_density

import thud
from thud.level.levels import BANDWIDTHS
from thud.recordings import background as module
from thud.recordings.background import Background, fit_noise, unit_covariances
from thud.recordings.contact import band_functionals, band_noise

if TYPE_CHECKING:
    from thud.base._schema import BandSet
    from thud.recordings.background import Cells

# Of docs/recordings_theory.md, section 2.
MAINS, UNCERTAIN, N_HARMONIC = (50.0, 60.0), 0.1, 5
OFFSET, DRIFT = 1.0, 0.1
SLOPE = np.array([0.5, 0.25, 1.0, 0.25, 0.25])
PEAK = 1500.0


def cells_of(edges: np.ndarray) -> Cells:
    return edges[:-1], edges[1:]


def joined(one: Cells, other: Cells) -> Cells:
    return np.append(one[0], other[0]), np.append(one[1], other[1])


QUIET_EDGES = -0.012 - np.cumsum([0, 5e-4, 5e-4, 1e-3, 2e-3, 2e-3, 3e-3, 3e-3])[::-1]
QUIET = joined(cells_of(QUIET_EDGES), cells_of(-0.7 * QUIET_EDGES[::-1]))
CONTACT = cells_of(np.linspace(-0.0115, 0.008, 6))
VARIANCES = np.array([[0.02, 3.0, 40.0, 2.0, 8.0], [0.03, 1.0, 90.0, 0.5, 8.0], [0.01, 9, 5, 3, 1]])


def middle(cells: Cells) -> np.ndarray:
    return (cells[0] + cells[1]) / 2


def test_noise_between_two_frequencies_is_the_integral_of_its_spectrum() -> None:
    cells = np.array([0.0]), np.array([1.0])
    noise = Background(cells, np.zeros(1), np.array([0.3, 7.0, 50.0, 0.0, 0.0]), 1.0)
    assert noise.density(4.0) == pytest.approx(0.3 + 7 / 4 + 50 / 16)
    power, _ = quad(noise.density, 3, 700, limit=200)
    assert noise.deviation_between(3, 700) == pytest.approx(np.sqrt(power))


def mean_of_lags(a: float, b: float, c: float, d: float, brown: bool) -> float:  # noqa: FBT001
    """Return the mean of the covariance at a lag over two cells, by the density of their lags."""

    def integrand(lag: float) -> float:
        overlap = max(min(b, d + lag) - max(a, c + lag), 0.0)
        value = -(np.pi**2) * abs(lag) if brown else -np.log(max(abs(lag), 1e-300))
        return value * overlap / ((b - a) * (d - c))

    corners = sorted({a - d, a - c, b - d, b - c, 0.0 if a < d and c < b else a - d})
    return sum(quad(integrand, low, high, limit=200)[0] for low, high in pairwise(corners))


@pytest.mark.parametrize("brown", [False, True])
def test_covariances_are_means_over_cells(brown: bool) -> None:  # noqa: FBT001
    begins = np.array([0.0, 1e-3, 2e-3, 5e-3, 9e-3, 0.1])
    ends = np.array([1e-3, 2e-3, 4e-3, 6e-3, 12e-3, 0.103])
    found = unit_covariances((begins, ends), (begins, ends))[int(brown)]
    for i, k in product(range(6), range(6)):
        expected = mean_of_lags(begins[i], ends[i], begins[k], ends[k], brown)
        assert found[i, k] == pytest.approx(expected, rel=1e-7)


def test_hum_has_harmonics_of_random_phases_and_an_uncertain_frequency() -> None:
    found = unit_covariances(QUIET, CONTACT)[2:4]
    nodes, weights = np.polynomial.legendre.leggauss(12)
    time, other = (
        middle(cells)[:, None] + (cells[1] - cells[0])[:, None] / 2 * nodes
        for cells in (QUIET, CONTACT)
    )
    lag = time[:, None, :, None] - other[None, :, None, :]
    for one, mains in zip(found, MAINS, strict=True):
        expected = np.zeros(one.shape)
        for order in range(1, N_HARMONIC + 1):
            for f in (mains - UNCERTAIN, mains + UNCERTAIN):
                wave = np.cos(2 * np.pi * order * f * lag) / 2 / order**2
                expected += np.einsum("ikab,a,b->ik", wave, weights / 2, weights / 2)
        np.testing.assert_allclose(one, expected, atol=1e-12)


def dense(variances: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return covariances of quiet, quiet and contact, and contact for some variances."""
    both = joined(QUIET, CONTACT)
    time = middle(both)
    whole = np.tensordot(variances[1:], unit_covariances(both, both)[:4], 1)
    whole += PEAK**2 * (OFFSET**2 + DRIFT**2 * np.multiply.outer(time, time))
    n = len(QUIET[0])
    quiet = whole[:n, :n] + variances[0] / 2 * np.diag(1 / (QUIET[1] - QUIET[0]))
    return quiet, whole[:n, n:], whole[n:, n:]


@pytest.fixture(scope="module")
def background() -> Background:
    """Return a background of means that hold an offset, a drift and hum."""
    time = middle(QUIET)
    mean = noisy(20 + 300 * time + 3 * np.sin(2 * np.pi * 60 * time), 1, 2)
    return Background(QUIET, mean, VARIANCES[0], PEAK)


def test_prediction_is_the_normal_distribution_given_the_quiet(background: Background) -> None:
    quiet, across, contact = dense(VARIANCES[0])
    weights = np.linalg.solve(quiet, across)
    # Offset and drift of 1500 N are known to 1e-3 of them.
    np.testing.assert_allclose(background.predict(CONTACT), weights.T @ background.mean, rtol=1e-6)
    expected = contact - across.T @ weights
    found = background.error_covariance(CONTACT)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4 * expected.max())


def test_step_at_an_unknown_instant_is_a_line_with_the_error_of_its_instant() -> None:
    """Offsets before and after that are known: the step to an instant is uniformly distributed."""
    ends, step = (QUIET[1][QUIET[1] < 0].max(), QUIET[0][QUIET[0] > 0].min()), 40.0
    mean = np.where(middle(QUIET) > 0, step, 0.0)
    found = Background(QUIET, mean, np.full(5, 1e-9), PEAK, ends=ends, step=step)
    passed = (middle(CONTACT) - ends[0]) / (ends[1] - ends[0])
    np.testing.assert_allclose(found.predict(CONTACT), step * passed, atol=0.01 * step)
    instants = ends[0] + (ends[1] - ends[0]) * (np.arange(20_000) + 0.5) / 20_000
    errors = step * (passed - (middle(CONTACT) > instants[:, None]))
    expected = errors.T @ errors / len(errors)
    np.testing.assert_allclose(found.error_covariance(CONTACT), expected, atol=0.01 * step**2)


@pytest.mark.parametrize("code", ["drift_removed", "hum_removed"])
def test_drift_and_hum_are_told_from_three_deviations_on(background: Background, code: str) -> None:
    """They are means given the quiet, and proportional to it."""
    time, prior = middle(QUIET), (DRIFT * PEAK) ** 2
    quiet, *_ = dense(VARIANCES[0])
    if code == "drift_removed":
        value = prior * time @ np.linalg.solve(quiet, background.mean)
        deviation = np.sqrt(prior - prior**2 * time @ np.linalg.solve(quiet, time))
    else:
        # 60 Hz has the larger variance; white noise of the cells makes as much by chance.
        hum = VARIANCES[0, 4] * unit_covariances(QUIET, QUIET)[3]
        value = np.sqrt(2 * np.mean((hum @ np.linalg.solve(quiet, background.mean)) ** 2))
        white = VARIANCES[0, 0] / 2 * np.mean(1 / (QUIET[1] - QUIET[0]))
        deviation = np.sqrt(2 * white / len(time))
    for ratio in (2.99, 3.01):
        scale = ratio * deviation / value
        notes = replace(background, mean=scale * background.mean).notes
        assert (code in codes(notes)) == (ratio > 3)
    assert noted(notes, code).value == pytest.approx(scale * value, rel=1e-4)
    assert code == "drift_removed" or noted(notes, code).others["frequency"] == 60


def units_of_quiet() -> np.ndarray:
    """Return unit covariances of white noise and of what has a variance."""
    white = np.diag(0.5 / (QUIET[1] - QUIET[0]))
    return np.array([white, *unit_covariances(QUIET, QUIET)[:4]])


def log_posterior(
    background: Background, phi: np.ndarray, large: float
) -> tuple[float, np.ndarray, np.ndarray]:
    time = middle(QUIET)
    trend = PEAK**2 * (OFFSET**2 + DRIFT**2 * np.multiply.outer(time, time))
    units = units_of_quiet()
    return module._log_posterior(phi, units, trend, background.mean, np.full(5, large))  # noqa: SLF001


def test_posterior_is_likelihood_times_priors(background: Background) -> None:
    values = []
    for draw in VARIANCES:
        likelihood = stats.multivariate_normal.logpdf(background.mean, cov=dense(draw)[0])
        prior = SLOPE @ np.log(draw) - np.log(1 + draw / 1e3).sum()
        values.append(log_posterior(background, np.log(draw), 1e3)[0] - likelihood - prior)
    # Up to a constant.
    assert np.ptp(values) < 1e-6


def test_derivatives_of_the_posterior(background: Background) -> None:
    phi, step = np.log(VARIANCES[1]), 1e-4
    _, score, curvature = log_posterior(background, phi, 10.0)
    high, low = (
        np.array([log_posterior(background, phi + change, 10.0)[0] for change in side * np.eye(5)])
        for side in (step, -step)
    )
    np.testing.assert_allclose(score, (high - low) / (2 * step), rtol=1e-4, atol=1e-5)
    # Average information of the likelihood (Gilmour, Thompson and Cullis 1995), and the priors'.
    inverse = np.linalg.inv(dense(VARIANCES[1])[0])
    turned = VARIANCES[1][:, None] * (units_of_quiet() @ inverse @ background.mean)
    expected = 0.5 * turned @ inverse @ turned.T + np.diag(SLOPE)
    np.testing.assert_allclose(curvature, expected, rtol=1e-4)


def test_variances_are_a_maximum_without_slope(background: Background) -> None:
    likely, covariance = fit_noise(QUIET, background.mean, PEAK)
    scale = np.array([np.mean(0.5 / (QUIET[1] - QUIET[0])), 1.0, np.pi**2 * 0.02, 1.0, 1.0])
    large = (0.03 * PEAK) ** 2 / scale
    _, score, curvature = log_posterior(background, likely, large)
    # The search ends where a step gains less than 0.02: half of the square of the slope.
    assert score @ np.linalg.solve(curvature, score) < 2 * module.TOLERANCE
    np.testing.assert_allclose(covariance @ curvature, np.eye(5), atol=0.02)


@pytest.mark.parametrize("colour", ["white", "pink", "brown"])
def test_fitted_density_is_that_of_the_noise(colour: str) -> None:
    rate, order = 8000.0, ["white", "pink", "brown"].index(colour)
    edges = np.arange(0, 801, 8)
    quiet = joined(cells_of(0.01 + edges / rate), cells_of(-0.01 - edges[::-1] / rate))
    ratios = []
    for seed in range(8):
        noise = coloured_noise(1900, rate, 5.0, colour, np.random.default_rng(seed))
        means = [np.add.reduceat(noise[i : i + 800], edges[:-1]) / 8 for i in (960, 0)]
        likely, covariance = fit_noise(quiet, np.concatenate(means), PEAK)
        variances = np.exp(likely + np.diagonal(covariance) / 2)
        frequency = {"white": 400.0, "pink": 60.0, "brown": 20.0}[colour]
        density = variances[:3] * frequency ** -np.arange(3.0)
        true = noise_density(rate, 5.0, colour) / frequency**order
        relative = density / density.sum()
        deviation = np.sqrt(relative @ covariance[:3, :3] @ relative)
        ratios.append((np.log(density.sum() / true), deviation))
    error, stated = np.transpose(ratios)
    # Eight errors of their own stated size: their mean square between quantiles of chi squared.
    square = np.sum((error / stated) ** 2)
    assert stats.chi2.ppf(1e-3, 8) < square < stats.chi2.ppf(1 - 1e-3, 8)


@pytest.mark.parametrize("rate", [2500.0, 25600.0])
@pytest.mark.parametrize("bands", BANDWIDTHS)
def test_functionals_have_the_energy_of_a_band(rate: float, bands: BandSet) -> None:
    force, edges = np.random.default_rng(1).normal(size=int(0.02 * rate)), thud.get_bands(bands)
    energies = [
        np.sum((band_functionals(len(force), rate, *edge) @ force) ** 2)
        for edge in zip(edges.lower, edges.upper, strict=True)
    ]
    levels = thud.force_exposure_levels(force, rate, bands)
    np.testing.assert_allclose(10 * np.log10(energies), levels, atol=1e-6)


def test_energy_of_the_noise_follows_its_formula() -> None:
    """The variance is 4 F'QCQF + 2 tr(QCQC), F known by y alone; the density is uncertain."""
    drop = make_drop(3.0)
    contact = drop.contact
    n_cell = len(contact.covariance)
    root = np.random.default_rng(5).normal(size=(n_cell, n_cell))
    variances = np.array([3e-3, 0.2, 6.0, 0, 0])
    logarithms = np.random.default_rng(6).normal(size=(5, 5))
    logarithms = 0.01 * logarithms @ logarithms.T
    background = replace(contact.background, variances=variances, log_covariance=logarithms)
    contact = replace(contact, covariance=root @ root.T, background=background)
    rate, bands = drop.sample_rate, thud.get_bands()
    force = drop.force[slice(*drop.gate)]
    count = len(force)
    # Each sample has the error of its cell.
    edges = np.rint(np.linspace(0, count, n_cell + 1))
    cell = np.searchsorted(edges, np.arange(count), "right") - 1
    covariance = contact.covariance[np.ix_(cell, cell)] + 3e-3 * rate / 2 * np.eye(count)
    found = band_noise([replace(drop, contact=contact)], bands)[0]
    for (noise, deviation, _), lower, upper in zip(found, bands.lower, bands.upper, strict=True):
        rows = band_functionals(count, rate, lower, upper)
        form = rows.T @ rows
        expected = np.trace(form @ covariance)
        squares = np.trace(form @ covariance @ form @ covariance)
        variance = 4 * force @ form @ covariance @ form @ force - 2 * squares
        f = (lower + upper) / 2
        change = variances * [1, 1 / f, 1 / f**2, 0, 0]
        density = change @ logarithms @ change / change.sum() ** 2
        variance = max(variance, 2 * squares) + expected**2 * density
        assert noise == pytest.approx(expected, rel=1e-6)
        assert deviation == pytest.approx(np.sqrt(variance), rel=1e-6)
