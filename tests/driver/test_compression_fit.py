"""The modulus from a curve in a press: what is found, how well, and when it is doubted."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import naming
from scipy.interpolate import PchipInterpolator
from scipy.stats import t

import thud
from thud.studies.compression_fit import _warnings, _work_ratio

TRUE = thud.Ball(youngs_modulus=1.83e6)
START = thud.Ball(youngs_modulus=3e6)
Measured = tuple[np.ndarray, np.ndarray]
# Coarse, and its own truth.
MODEL = thud.ModalBall(harmonics=20, static_harmonics=60, rings=20)
TOUCH = 1.2e-3


@pytest.fixture(scope="module")
def measured() -> Measured:
    """Return deflection and force of a curve without noise, which begins before first touch."""
    curve = thud.compress(TRUE, MODEL, max_deflection=0.03, points=41)
    before = np.linspace(0, TOUCH, 4)[:-1]
    return np.append(before, curve.deflection + TOUCH), np.append(0 * before, curve.force)


def test_modulus_and_touch_are_found_with_honest_intervals(measured: Measured) -> None:
    deflection, force = measured
    seeds, covered, errors = 12, np.zeros(2), []
    for seed in range(seeds):
        noise = np.random.default_rng(seed).normal(scale=3.0, size=len(force))
        fit = thud.fit_compression(deflection, force + noise, START, MODEL, confidence=0.9)
        truth = np.array([TRUE.youngs_modulus, TOUCH])
        low, high = np.array(list(fit.intervals().values())).T
        covered += (low < truth) & (truth < high)
        errors.append((fit.estimate - truth) ** 2)
        assert fit.noise == pytest.approx(3.0, rel=0.5)
        assert fit.warnings == ()
    # Of 12 intervals of 90 %, fewer than 7 hold the truth with a probability of 5e-4; of 100 seeds
    # 94 and 92 did.
    assert np.all(covered >= 7)
    np.testing.assert_allclose(np.mean(errors, axis=0), np.diag(fit.covariance), rtol=0.9)


def test_fit_shows_its_numbers(measured: Measured) -> None:
    noise = np.random.default_rng(1).normal(scale=0.5, size=len(measured[1]))
    fit = thud.fit_compression(measured[0], measured[1] + noise, START, MODEL)
    assert repr(fit).startswith("<CompressionFit: E 1.8")
    assert [(row[0], row[-1]) for row in fit.rows()[1:]] == [
        ("youngs_modulus", "MPa"), ("touch", "mm")
    ]  # fmt: skip
    table = fit.to_dataframe()
    np.testing.assert_allclose(table["model_N"] - table["force_N"], fit.residuals)
    assert len(fit.plot().axes[0].lines) == 2
    assert fit.curve.case.ball.youngs_modulus == fit.values["youngs_modulus"]
    shown = np.interp(measured[0] - fit.values["touch"], fit.curve.deflection, fit.curve.force)
    np.testing.assert_allclose(shown - measured[1] - noise, fit.residuals, atol=1.0)


def test_model_that_does_not_explain_the_curve_is_doubted(measured: Measured) -> None:
    with pytest.warns(thud.FitWarning, match=naming("sign", "model")):
        fit = thud.fit_compression(*measured, START, "hollow_sphere")
    assert len(fit.warnings) == 1


def test_curve_that_begins_under_load_is_doubted(measured: Measured) -> None:
    with pytest.warns(thud.FitWarning) as caught:
        fit = thud.fit_compression(measured[0][20:], measured[1][20:], START, MODEL)
    assert "first touch" in fit.warnings[0]
    assert [str(one.message) for one in caught] == list(fit.warnings)


@pytest.mark.parametrize(
    ("deflection", "force", "words"),
    [
        ([0, 1e-3], [0, 1], naming("deflection", "force", 2, 5)),
        ([0, 1e-3, 2e-3, 3e-3, 4e-3], [0, 1], naming("deflection", "force", 5, 2)),
        ([0, 1e-3, 1e-3, 2e-3, 3e-3], range(5), naming("deflection", "point 3")),
        ([0, 1e-3, 2e-3, 3e-3, np.nan], range(5), naming("deflection", "finite")),
        ([0, 1e-3, 2e-3, 3e-3, 4e-3], [4, 3, 2, 1, 0], naming("force", "deflection")),
        ([0, 1e-3, 2e-3, 3e-3, 4e-3], [1, 1, 1, 1, 1], naming("force", "deflection")),
        ([0, 1e-3, 2e-3, 3e-3, 4e-3], [-2, -1, 0, 0, 0], naming("force", "deflection")),
        ([0, 1e-3, 2e-3, 3e-3, 0.2], range(5), naming("max_deflection", "0.178 m")),
        ([0, 1e-12, 2e-12, 3e-12, 4e-12], range(5), naming("model", "force")),
        ("curve", range(5), naming("deflection")),
    ],
)
def test_what_is_no_curve_is_refused(deflection: object, force: object, words: str) -> None:
    values = list(force) if isinstance(force, range) else force
    with pytest.raises(thud.InputError, match=words):
        thud.fit_compression(deflection, values, START, MODEL)  # type: ignore[arg-type]


def test_modulus_of_a_spring_that_has_none_is_refused(measured: Measured) -> None:
    spring = thud.HuntCrossley(stiffness=2e5)
    with pytest.raises(thud.NumericalError, match=naming("youngs_modulus")):
        thud.fit_compression(*measured, START, spring)


def test_covariance_is_that_of_the_linearised_curve(measured: Measured) -> None:
    """Noise squared over the normal matrix of both derivatives, by differences of the model."""
    deflection, force = measured
    noise = np.random.default_rng(2).normal(scale=2.0, size=len(force))
    fit = thud.fit_compression(deflection, force + noise, START, MODEL, confidence=0.9)
    deviation = np.sqrt(fit.residuals @ fit.residuals / (len(force) - 2))
    assert fit.noise == pytest.approx(deviation)

    def model(modulus: float, touch: float) -> np.ndarray:
        ball = thud.Ball(youngs_modulus=modulus)
        curve = thud.compress(ball, MODEL, max_deflection=0.033, points=161)
        return np.asarray(PchipInterpolator(curve.deflection, curve.force)(
            np.maximum(deflection - touch, 0)))  # fmt: skip

    best = fit.estimate
    assert model(*best) - force - noise == pytest.approx(fit.residuals, abs=0.5)
    steps = np.diag([1e3, 1e-6])
    slopes = np.stack([(model(*(best + s)) - model(*(best - s))) / (2 * s.sum()) for s in steps])
    expected = deviation**2 * np.linalg.inv(slopes @ slopes.T)
    np.testing.assert_allclose(fit.covariance, expected, rtol=0.02)
    width = t.ppf(0.95, len(force) - 2) * np.sqrt(np.diag(fit.covariance))
    ends = np.array(list(fit.intervals().values()))
    np.testing.assert_allclose(ends, np.stack([best - width, best + width], axis=1))
    assert fit.confidence == 0.9


def test_search_starts_with_the_work_of_the_measured_curve() -> None:
    curve = thud.compress(START, MODEL, max_deflection=0.03, points=31)
    depth = np.linspace(0, 0.02, 41)
    force = np.interp(depth, curve.deflection, curve.force)
    for factor in (0.4, 1.0, 3.0):
        assert _work_ratio(curve, depth + 0.1, factor * force) == pytest.approx(factor)
    # Where the work is next to nothing, a hundredth of the last force times the way.
    last = np.append(np.zeros(40), 100.0)
    work = np.trapezoid(force, depth)
    assert _work_ratio(curve, depth, last - 2 * (depth < 0.01)) == pytest.approx(
        0.01 * 100 * 0.02 / work
    )


@pytest.mark.parametrize(
    ("place", "doubted"),
    [(-0.04, True), (-0.04 + 2e-6, False), (0.0, False), (0.9 - 2e-6, False), (0.9, True)],
)
def test_touch_at_the_limit_of_the_search_is_doubted(place: float, *, doubted: bool) -> None:
    bounds = ([-np.inf, -0.04], [np.inf, 0.9])
    signs = np.random.default_rng(1).normal(size=60)
    assert len(_warnings(signs, place, bounds)) == int(doubted)
    assert len(_warnings(abs(signs), place, bounds)) == int(doubted) + 1


@pytest.mark.parametrize("count", [4, 5])
def test_fewest_points_leave_something_to_two_parameters(measured: Measured, count: int) -> None:
    some = np.linspace(3, 43, count).astype(int)
    if count < 5:
        with pytest.raises(thud.InputError, match=naming("deflection", 5)):
            thud.fit_compression(measured[0][some], measured[1][some], START, MODEL)
    else:
        fit = thud.fit_compression(measured[0][some], measured[1][some], START, MODEL)
        assert fit.values["youngs_modulus"] == pytest.approx(TRUE.youngs_modulus, rel=0.01)
