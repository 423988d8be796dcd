"""Fits to records with coloured noise, offset, hum and unknown gain, and tests of residuals."""

from __future__ import annotations

import re
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import naming
from scipy import stats
from scipy.linalg import toeplitz

import thud
from thud.recordings.noise import noise_covariances
from thud.studies.fitting.record_noise import find_pulse, grid_covariance, to_grid
from thud.studies.fitting.residual_tests import UNLIKELY, residual_doubts

sys.path.insert(0, str(Path(__file__).parents[1] / "validation"))
from fit_disturbances import DISTURBANCES, QUIET, RATE, TRUTH, pulse

if TYPE_CHECKING:
    from numpy.typing import NDArray

CASE = thud.Case(sampling=thud.Sampling(duration=0.026))
# A miss by four standard errors has a probability of 6e-5.
FAR = 4.0


def record(disturbance: str, seed: int = 1) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the pulse of the truth with a disturbance of the study of coverage."""
    time, force = pulse(QUIET)
    return time, force + DISTURBANCES[disturbance](time, np.random.default_rng(seed))


def quiet_fit(*arguments: object, **options: object) -> thud.Fit:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", thud.FitWarning)
        return thud.fit(*arguments, **options)  # type: ignore[arg-type]


def pulls(fit: thud.Fit) -> NDArray[np.float64]:
    """Return the errors of a fit over its standard errors."""
    errors = [(fit.values[n] - TRUTH[n]) / fit.standard_errors[n] for n in TRUTH]
    return np.array(errors)


@pytest.mark.parametrize("kind", [0, 1, 2])
def test_covariance_on_the_grid_is_that_of_samples(kind: int) -> None:
    # The closed form of the double sum over samples against that sum.
    time = np.arange(300) / RATE
    row = noise_covariances((time[:1], time[:1] + 1 / RATE), (time, time + 1 / RATE))[kind, 0]
    dense = to_grid(to_grid(toeplitz(row), 41).T, 41)
    found = grid_covariance(row, 41)
    np.testing.assert_allclose(found, dense, atol=1e-12 * np.abs(dense).max())


def test_white_noise_stays_white_on_the_grid() -> None:
    row = np.append(3.0, np.zeros(299))
    np.testing.assert_allclose(grid_covariance(row, 41), 3 * np.eye(41), atol=1e-13)


def test_pulse_is_found_on_an_offset() -> None:
    time, force = record("offset of 20 N")
    first, stop = find_pulse(force, RATE)
    # All of the contact, and no more than 5 ms of the quiet on each side.
    contact = thud.solve(thud.Ball(youngs_modulus=1.8e6), thud.Drop(1.1)).contact_time
    assert QUIET - 0.005 < time[first] < QUIET
    assert QUIET + contact < time[stop] < QUIET + contact + 0.005


@pytest.mark.parametrize(
    ("disturbance", "name", "size"),
    [
        ("offset of 20 N", "offset", 20.0),
        ("hum of 60 Hz, 3 N", "hum of 60 Hz", 3.0),
        # Its frequency is found to 0.2 Hz.
        ("hum of 16.7 Hz, 10 N", "hum of 16.", 10.0),
    ],
)
def test_what_lies_under_the_pulse_is_found(disturbance: str, name: str, size: float) -> None:
    fit = thud.fit(record(disturbance), TRUTH, CASE)
    assert not fit.warnings
    assert (np.abs(pulls(fit)) < FAR).all()
    nuisances = fit.targets[0].nuisances
    name = next(one for one in nuisances if one.startswith(name))
    # A tone of 16.7 Hz was told as hum of 50 Hz too.
    assert set(nuisances) == {"offset", name}
    value, error = nuisances[name]
    assert abs(value - size) < FAR * error
    # That of an offset holds the unknown constant of coloured noise.
    assert error < 0.15 * size
    assert f"{name} {value:.3g} ± {error:.2g} N" in str(fit)


def test_hum_of_a_given_frequency_is_removed() -> None:
    target = thud.ForceTarget(record("hum of 100 Hz, 10 N"), hum=50.0)
    fit = thud.fit(target, TRUTH, CASE)
    assert (np.abs(pulls(fit)) < FAR).all()
    # Five harmonics, each with two waves, and the offset.
    assert fit.degrees_of_freedom == len(fit.residuals) - len(fit.names) - 11
    value, error = fit.targets[0].nuisances["hum of 100 Hz"]
    assert abs(value - 10) < FAR * error
    without = quiet_fit(thud.ForceTarget(target.record, hum=0, offset=False), TRUTH, CASE)
    assert not without.targets[0].nuisances


def test_noise_makes_no_tone() -> None:
    # A tone would be found in fewer than one record in a thousand.
    for seed in range(3):
        for colour in ("white noise", "pink noise", "brown noise"):
            misfit = thud.ForceTarget(record(colour, seed)).misfit()
            assert misfit.tones == ()
            # Pink noise was told as hum with an error that held for white noise.
            _, size, error = misfit.quiet.mains(misfit.background)
            assert size < 4.5 * error


def test_standard_errors_grow_with_slow_noise() -> None:
    # White and brown noise of 5 N each: a pulse of 20 ms feels the noise of 10 to 100 Hz.
    white, pink = (quiet_fit(record(name), TRUTH, CASE) for name in ("white noise", "pink noise"))
    assert pink.standard_errors["height"] > 5 * white.standard_errors["height"]
    assert white.noise == pytest.approx(5.0, rel=0.2)


def test_gain_is_found_or_known_to_an_extent() -> None:
    time, force = record("white noise")
    louder = time, 1.02 * force
    known = {"youngs_modulus": 1.8e6}
    case = thud.Case(drop=thud.Drop(TRUTH["height"]), sampling=CASE.sampling)
    free = thud.fit(thud.ForceTarget(louder, gain=np.inf), known, case)
    assert abs(free.values["gain"] - 1.02) < FAR * free.standard_errors["gain"]
    assert free.standard_errors["gain"] < 1e-3
    # Bayes: what is known and what is measured weigh as 1/variance.
    half = quiet_fit(thud.ForceTarget(louder, gain=free.standard_errors["gain"]), known, case)
    assert half.values["gain"] - 1 == pytest.approx((free.values["gain"] - 1) / 2, rel=0.02)
    assert half.standard_errors["gain"] == pytest.approx(
        free.standard_errors["gain"] / np.sqrt(2), rel=0.02
    )
    without = quiet_fit(louder, known, case)
    assert without.warnings


@pytest.mark.parametrize(
    ("disturbance", "words"),
    [
        ("blue noise", "coloured"),
        ("spike", r"residual.* 86\.6"),
        ("ringing of 300 Hz", "uncertainty|model"),
        ("louder behind first touch", "contact"),
    ],
)
def test_noise_of_another_kind_warns(disturbance: str, words: str) -> None:
    assert re.search(words, " ".join(quiet_fit(record(disturbance), TRUTH, CASE).warnings))


def test_too_little_quiet_warns_unless_the_offset_is_decided() -> None:
    time, force = record("white noise")
    inside = (time > QUIET - 0.005) & (time < QUIET + 0.027)
    short = time[inside], force[inside]
    fit = quiet_fit(short, TRUTH, CASE)
    assert re.search(naming("ms", "offset", "hum", "noise"), str(fit))
    assert not fit.targets[0].nuisances
    decided = thud.fit(thud.ForceTarget(short, offset=True), TRUTH, CASE)
    assert set(decided.targets[0].nuisances) == {"offset"}


def test_white_residuals_pass_and_others_do_not() -> None:
    random = np.random.default_rng(1)
    time = np.arange(251) * 4e-4
    told = sum(len(residual_doubts(random.normal(size=251), time)) for _ in range(300))
    # Three tests of 300 sequences; more would have a probability of 1e-4.
    assert told <= stats.binom.ppf(1 - 1e-4, 900, UNLIKELY)
    white = random.normal(size=251)
    slow = np.convolve(white, [1.0, 1.0], "same") / np.sqrt(2)
    spiked = np.where(np.arange(251) == 100, 6.0, white)
    assert "lowest" in residual_doubts(slow, time)[0]
    assert any("sign" in one for one in residual_doubts(slow, time))
    assert re.search(naming("residual", "40 ms", 6), residual_doubts(spiked, time)[0])
    assert any(re.search(naming("sign", 0), one) for one in residual_doubts(np.abs(white), time))
    assert not residual_doubts(slow[:10], time[:10])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"hum": 5.0}, naming("target", "hum", 5.0, 0, 10, "1250 Hz")),
        ({"hum": "loud"}, naming("target", "hum", "'loud'")),
        ({"offset": 3}, naming("target", "offset", 3, "true", "false")),
        ({"gain": -0.1}, naming("target", "gain", -0.1, 0)),
        ({"fixed": 3}, naming("target", "fixed", 3)),
        ({"fixed": {"height": 2.0}}, naming("target", "fixed", "height")),
        ({"fixed": {"size": 2.0}}, naming("'size'", "hollow_sphere")),
        ({"fixed": {"mass": "big"}}, naming("target", "fixed mass", "'big'")),
        ({"fixed": {"mass": -2.0}}, naming("&ball: mass", -2.0, "kg")),
        (
            {"gain": 0.1, "window": (QUIET - 0.005, QUIET + 0.027)},
            naming("target", "gain", 0.1, "noise", "0.02 s"),
        ),
    ],
)
def test_bad_options_get_one_sentence(options: dict[str, object], words: str) -> None:
    target = thud.ForceTarget(record("white noise"), **options)  # type: ignore[arg-type]
    with pytest.raises(thud.InputError, match=words):
        thud.fit(target, TRUTH, CASE)
