"""Fits to records with colored noise, offset, hum and unknown gain, and tests of residuals."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import codes, noted, quiet_fit
from fit_disturbances import DISTURBANCES, QUIET, RATE, TRUTH, pulse
from scipy import stats
from scipy.linalg import toeplitz

import thud
from thud.base.note import Note
from thud.recordings.background import Background, fit_noise, unit_covariances
from thud.studies.fitting import comparison
from thud.studies.fitting.record import (
    Quiet,
    cell_waves,
    find_pulse,
    find_quiet,
    find_tones,
    fit_quiet,
    grid_covariance,
    log_likelihood,
    on_grid,
    record_noise,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

CASE = thud.Case(sampling=thud.Sampling(duration=0.026), model=thud.HollowSphere())
# A miss by four standard errors has a probability of 6e-5.
FAR = 4.0


def record(disturbance: str, seed: int = 1) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the pulse of the truth with a disturbance of the study of coverage."""
    time, force = pulse(QUIET)
    return time, force + DISTURBANCES[disturbance](time, np.random.default_rng(seed))


def pulls(fit: thud.Fit) -> NDArray[np.float64]:
    """Return the errors of a fit over its standard errors."""
    errors = [(fit.values[n] - TRUTH[n]) / fit.standard_errors[n] for n in TRUTH]
    return np.array(errors)


def to_grid(samples: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return columns of samples on a grid of `count` points."""
    return on_grid(np.fft.rfft(samples, norm="ortho", axis=0)[: count // 2 + 1])


@pytest.mark.parametrize("kind", [0, 1, 2])
def test_covariance_on_the_grid_is_that_of_samples(kind: int) -> None:
    # The closed form of the double sum over samples against that sum.
    time = np.arange(300) / RATE
    samples = time, time + 1 / RATE
    row = unit_covariances((time[:1], time[:1] + 1 / RATE), samples)[kind, 0]
    dense = to_grid(to_grid(toeplitz(row), 41).T, 41)
    found = grid_covariance(row, 41)
    np.testing.assert_allclose(found, dense, atol=1e-12 * np.abs(dense).max())


@pytest.mark.parametrize("given", [None, 2.0])
def test_noise_of_a_record_is_that_of_its_samples(given: float | None) -> None:
    n, count, rate, wide = 301, 41, 3000.0, 900.0
    time = (np.arange(n) - 145) / rate
    variances = np.array([3e-3, 0.3, 20.0, 1.0, 2.0])
    tone = Note("tone_removed", others={"frequency": 70.0})
    background = Background((np.zeros(1), np.ones(1)), np.zeros(1), variances, wide, tones=(tone,))
    found = record_noise(time, rate, count, background=background, white=given, offset=wide)
    cells = time - 0.5 / rate, time + 0.5 / rate
    pink, brown, fifty, sixty = variances[1:, None, None] * unit_covariances(cells, cells)[:4]
    white = variances[0] * rate / 2 * np.eye(n)
    waves = np.stack([np.ones(n), np.cos(140 * np.pi * time), np.sin(140 * np.pi * time)], 1)
    waves = wide * np.column_stack([waves, 0.1 * time])
    predicted = fifty + sixty + waves @ waves.T
    noise = white + pink + brown if given is None else given**2 * np.eye(n)

    def grid(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
        return to_grid(to_grid(matrix, count).T, count)

    expected = grid(predicted)
    np.testing.assert_allclose(found.predicted, expected, atol=2e-3 * np.abs(expected).max())
    # Of colored noise up to a constant, as of an offset.
    whole = np.linalg.inv(found.whiten.T @ found.whiten)
    rest = whole - found.predicted - grid(noise)
    constant = to_grid(np.ones((n, 1)), count)
    rest -= constant @ constant.T * (constant.T @ rest @ constant) / (constant.T @ constant) ** 2
    np.testing.assert_allclose(rest, 0, atol=1e-6 * np.abs(whole).max())
    # The mean of what np.var(ddof=1) gives of noise that is not predicted.
    about = np.eye(count) - 1 / count
    deviation = np.sqrt(np.trace(about @ grid(noise)) / (count - 1))
    assert found.deviation == pytest.approx(deviation, rel=1e-3)


def background_of(seed: int, *waves: float, size: float = 0.0) -> Quiet:
    """Return 0.1 s of white noise on both sides of a pulse, with tones, Hz, of a size, N."""
    n = int(0.24 * RATE)
    time = np.arange(n) / RATE
    force = np.random.default_rng(seed).normal(scale=5, size=n)
    force += size * np.sin(2 * np.pi * np.outer(waves, time) + seed).sum(axis=0)
    first, stop = int(0.11 * RATE), int(0.13 * RATE)
    force[first:stop] += 1500 * np.sin(np.pi * np.arange(stop - first) / (stop - first))
    return find_quiet(force, RATE, (first, stop), 500.0)


def test_quiet_counts_up_to_a_tenth_of_a_second() -> None:
    quiet = background_of(1)
    # 0.11 s on each side, of which 0.1 s count; two values for each hertz of the band and second.
    assert quiet.seconds == pytest.approx(0.2)
    assert quiet.freedom == 2 * 500 * 0.2 - 1
    assert quiet.middle == pytest.approx(0.12, abs=1 / RATE)
    assert quiet.deviation == pytest.approx(5, rel=4 / np.sqrt(2 * 0.22 * RATE))
    short = find_quiet(np.ones(500), RATE, (int(0.0105 * RATE), 500), 500.0)
    assert short.freedom == int(2 * 500 * int(0.0105 * RATE) / RATE) - 1
    # Cells of a millisecond, one for each independent value of the band, next to the pulse.
    (begins, ends), mean = quiet.cells, quiet.mean
    width = int(RATE / 1000)
    assert len(mean) == 2 * (int(0.1 * RATE) // width)
    inner, outer = 0.01, 0.01 + int(0.1 * RATE) // width * width / RATE
    for time in (np.abs(begins), np.abs(ends)):
        assert time.min() == pytest.approx(inner, abs=1.5 * width / RATE)
    assert np.abs([begins.min(), ends.max()]) == pytest.approx([outer] * 2, abs=1.5 / RATE)


def test_pulse_is_found_in_means_of_a_millisecond() -> None:
    time = np.arange(int(0.22 * RATE)) / RATE
    inside = (time > 0.1) & (time < 0.12)
    force = np.where(inside, 1500 * np.sin(np.pi * (time - 0.1) / 0.02), 0)
    force += np.random.default_rng(2).normal(scale=400, size=len(time))
    # An offset of more than a fifth of the peak.
    first, stop = find_pulse(force + 600, RATE)
    # A fifth of the peak is reached after 1.3 ms; 4 ms are left before it. Noise of 60 N, and a
    # millisecond of the means.
    assert first / RATE == pytest.approx(0.1 + 0.0013 - 0.004, abs=1.2e-3)
    assert stop / RATE == pytest.approx(0.12 - 0.0013 + 0.004, abs=1.2e-3)


def test_likelihood_of_quiet_is_that_of_normal_cells() -> None:
    background = fit_quiet(background_of(2))
    other = replace(background, variances=2 * background.variances)
    begins, ends = background.cells
    values = [
        log_likelihood(one)
        - stats.multivariate_normal.logpdf(
            one.mean,
            cov=one.covariance(one.cells, one.cells)
            + np.diag(one.variances[0] / 2 / (ends - begins) + (1e-6 * one.peak) ** 2),
        )
        for one in (background, other)
    ]
    assert values[0] == pytest.approx(values[1], abs=1e-5)


def test_noise_that_waves_have_taken_is_given_back() -> None:
    """Waves of t tones take 2 t of n degrees of freedom."""
    quiet = background_of(3)
    plain, tones = fit_quiet(quiet), (150.0, 333.0, 470.0, 611.0)
    cells, mean = quiet.cells, quiet.mean
    waves = np.column_stack([np.ones(len(mean)), cell_waves(cells, tones)])
    left = mean - waves @ np.linalg.lstsq(waves, mean)[0]
    fitted = np.exp(fit_noise(cells, left, plain.peak)[0])
    n = len(mean)
    ratio = fit_quiet(quiet, tones).variances / fitted
    np.testing.assert_allclose(ratio, [n / (n - 8)] * 3 + [1, 1])
    # Eight tones that are not there take 8 of n, within the scatter of as many squares.
    assert fit_quiet(quiet, tones).variances[0] == pytest.approx(
        plain.variances[0], rel=4 / np.sqrt(n)
    )


def test_tones_are_found_between_those_of_the_mains_and_the_band_edge() -> None:
    # Three at most; each is found to a tenth of the resolution: 0.1 s on both sides of 20 ms.
    truth = [123.4, 217.3, 333.1, 411.9]
    found = find_tones(background_of(6, *truth, size=10.0), 500.0)
    assert len(set(found)) == 3
    assert all(np.abs(np.array(truth) - tone).min() < 0.1 / 0.22 for tone in found)
    # Hum of the mains is part of the noise; below 10 and above 475 Hz there is none.
    for tone in (7.0, 60.0, 490.0):
        assert find_tones(background_of(6, tone, size=10.0), 500.0) == ()


@pytest.mark.parametrize("test", ["color", "contact", "size", "size of quiet"])
def test_noise_fails_each_test_as_often_as_it_says(
    test: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(comparison, "UNLIKELY", 0.1)
    rng, warned, tries = np.random.default_rng(9), 0, 800
    inside = np.arange(40) >= 28
    for _ in range(tries):
        values = rng.normal(size=40)
        if test == "color":
            notes = comparison.color_warning(rng.normal(size=101))
        elif test == "contact":
            # Three parameters take three of the twelve during contact.
            basis, _ = np.linalg.qr(rng.normal(size=(12, 3)))
            values[inside] -= basis @ (basis.T @ values[inside])
            notes = comparison.contact_warning(values, inside, 3, 2.0)
        else:
            freedom = 25 if test == "size of quiet" else None
            scale = np.sqrt(rng.chisquare(25) / 25) if freedom else 1.0
            notes = comparison.size_warning(values / scale, 40, freedom)
        warned += bool(notes)
    low, high = stats.binom.ppf([1e-4, 1 - 1e-4], tries, [0.085, 0.115])
    assert low <= warned <= high


def test_color_is_that_of_residuals_but_a_constant() -> None:
    white = np.random.default_rng(1).normal(size=251)
    slow = np.convolve(white, [1.0, 1.0], "same") / np.sqrt(2)
    (note,) = comparison.color_warning(slow)
    assert (note.code, note.others["side"]) == ("residuals_colored", "low")
    assert not comparison.color_warning(slow[:19])
    assert not comparison.color_warning(white + 3)


def test_offset_and_tone_are_part_of_the_noise() -> None:
    fit = thud.fit(record("offset of 20 N"), TRUTH, CASE)
    assert not fit.warnings
    assert (np.abs(pulls(fit)) < FAR).all()
    under = np.asarray(fit.columns()["background_N"])
    # 80 ms of white noise of 5 N.
    assert under.mean() == pytest.approx(20, abs=FAR * 5 / np.sqrt(2 * QUIET * RATE))
    # Also without noise.
    time, force = pulse(QUIET)
    fit = thud.fit((time, force + 20), TRUTH, CASE)
    assert np.asarray(fit.columns()["background_N"]).mean() == pytest.approx(20, abs=0.1)
    assert not fit.warnings
    fit = thud.fit(record("hum of 16.7 Hz, 10 N"), TRUTH, CASE)
    assert not fit.warnings
    assert (np.abs(pulls(fit)) < FAR).all()
    note = noted(fit.notes, "tone_removed")
    # Its frequency is found to 0.2 Hz.
    assert note.others["frequency"] == pytest.approx(16.7, abs=FAR * 0.2)
    assert note.value == pytest.approx(10.0, abs=2.0)
    assert np.std(fit.columns()["background_N"]) == pytest.approx(10 / np.sqrt(2), rel=0.2)
    # Hum of the mains is noted.
    note = noted(thud.fit(record("hum of 60 Hz, 3 N"), TRUTH, CASE).notes, "hum_removed")
    assert note.others["frequency"] == 60
    # White noise of 5 N: the variance of an amplitude is 2/n times that of samples.
    assert note.value == pytest.approx(3.0, abs=FAR * 5 * np.sqrt(2 / (2 * QUIET * RATE)))


def test_noise_makes_no_tone() -> None:
    # A tone would be found in fewer than one record in a thousand.
    for seed in range(3):
        for colour in ("white noise", "pink noise", "brown noise"):
            assert thud.ForceTarget(record(colour, seed)).compare().background.tones == ()  # type: ignore[union-attr]


def test_standard_errors_grow_with_slow_noise() -> None:
    # White and brown noise of 5 N each: a pulse of 20 ms feels the noise of 10 to 100 Hz.
    white, pink = (quiet_fit(record(name), TRUTH, CASE) for name in ("white noise", "pink noise"))
    assert pink.standard_errors["height"] > 5 * white.standard_errors["height"]
    assert white.noise == pytest.approx(5.0, rel=0.2)


def test_gain_is_found_or_known_to_an_extent() -> None:
    time, force = record("white noise")
    louder = time, 1.02 * force
    known = {"youngs_modulus": 1.8e6}
    case = replace(CASE, drop=thud.Drop(TRUTH["height"]))
    free = thud.fit(thud.ForceTarget(louder, gain=np.inf), known, case)
    gain, error = free.values["gain"], free.standard_errors["gain"]
    assert abs(gain - 1.02) < FAR * error
    assert error < 1e-3
    # Bayes: what is known and what is measured weigh as 1/variance.
    half = quiet_fit(thud.ForceTarget(louder, gain=error), known, case)
    assert half.values["gain"] - 1 == pytest.approx((gain - 1) / 2, rel=0.02)
    # The gain is not 1, for which the fit warns.
    expected = error / np.sqrt(2)
    assert half.standard_errors["gain"] / half.widened == pytest.approx(expected, rel=0.02)
    assert quiet_fit(louder, known, case).warnings


@pytest.mark.parametrize(
    ("disturbance", "code"),
    [("blue noise", "residuals_colored"), ("spike", "residuals_colored"),
     ("ringing of 300 Hz", "unexplained")],
)  # fmt: skip
def test_noise_of_another_kind_warns(disturbance: str, code: str) -> None:
    assert code in codes(quiet_fit(record(disturbance), TRUTH, CASE).warnings)
