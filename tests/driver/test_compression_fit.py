"""The modulus from a curve in a press: what is found, how well, and when it is doubted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from compression_disturbances import CASE, MODEL, TOUCH, TRUE, curve_of, miss, quiet
from conftest import codes, noted, quiet_fit

import thud

E = ["youngs_modulus"]
Measured = tuple[np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def measured() -> Measured:
    """Return deflection and force of a curve without noise, which begins before first touch."""
    curve = thud.compress(TRUE, MODEL, max_deflection=0.03, points=41)
    before = np.linspace(0, TOUCH, 4)[:-1]
    return np.append(before, curve.deflection + TOUCH), np.append(0 * before, curve.force)


def test_modulus_and_touch_are_found_with_honest_intervals(measured: Measured) -> None:
    deflection, force = measured
    seeds, covered, errors = 8, np.zeros(2), []
    for seed in range(seeds):
        noise = np.random.default_rng(seed).normal(scale=3.0, size=len(force))
        fit = thud.fit(thud.CompressionTarget(deflection, force + noise), E, CASE, confidence=0.9)
        truth = np.array([TRUE.youngs_modulus, TOUCH])
        low, high = np.array(list(fit.intervals().values()))[:2].T
        covered += (low < truth) & (truth < high)
        errors.append((fit.estimate[:2] - truth) ** 2)
        assert fit.noise == pytest.approx(3.0, rel=0.5)
        assert fit.warnings == ()
    # Of 8 intervals of 90 %, fewer than 4 hold the truth with a probability of 5e-4.
    assert np.all(covered >= 4)
    np.testing.assert_allclose(np.mean(errors, axis=0), np.diag(fit.covariance)[:2], rtol=0.9)


def test_noise_is_that_of_the_residuals() -> None:
    """A first-order process, of which the last search knows size and correlation."""
    deflection = np.linspace(0, 0.03, 400)
    curve = thud.compress(TRUE, MODEL, max_deflection=0.03, points=101)
    force = np.interp(deflection, curve.deflection, curve.force)
    for correlation in (0.0, 0.7):
        noise = np.random.default_rng(7).normal(size=400)
        for i in range(1, 400):
            noise[i] = correlation * noise[i - 1] + np.sqrt(1 - correlation**2) * noise[i]
        fit = thud.fit(thud.CompressionTarget(deflection, force + 2 * noise), E, CASE)
        comparison = fit.targets[0].comparison
        found = comparison.correlation  # type: ignore[attr-defined]
        spread = np.sqrt((1 - correlation**2) / 400)
        assert found == pytest.approx(correlation, abs=4 * spread)
        innovation = 2 * np.sqrt(1 - correlation**2)
        assert comparison.unit_deviation == pytest.approx(innovation, rel=4 / np.sqrt(800))
        white = fit.residuals[:400]
        assert np.corrcoef(white[1:], white[:-1])[0, 1] == pytest.approx(0, abs=4 / 20)
        difference = np.asarray(fit.columns()["residual_N"])
        expected = (difference[1:] - found * difference[:-1]) / comparison.unit_deviation
        np.testing.assert_allclose(white[1:], expected)


def test_fit_shows_its_numbers(measured: Measured) -> None:
    noise = np.random.default_rng(1).normal(scale=0.5, size=len(measured[1]))
    fit = thud.fit(thud.CompressionTarget(measured[0], measured[1] + noise), E, CASE)
    names = ("youngs_modulus", "touch", "offset", "drift", "friction", "softening")
    assert fit.names == names
    assert fit.units == ("Pa", "m", "N", "N", "N", "")
    assert [row[-1] for row in fit.rows()[1:3]] == ["MPa", "mm"]
    table = fit.to_xarray()
    assert fit.to_dataframe().shape == (44, 5)
    model = table["model_N"] + table["effects_N"]
    np.testing.assert_allclose(model - table["force_N"], table["residual_N"])
    assert len(fit.plot().axes[0].lines) == 2
    assert fit.result.case.ball.youngs_modulus == fit.values["youngs_modulus"]
    (note,) = fit.assumptions
    change = str(note.others["changes"]).removeprefix("youngs_modulus ").removesuffix(" %")
    assert float(change) == pytest.approx(1.0, abs=0.05)


def test_model_that_does_not_explain_the_curve_widens_the_interval(measured: Measured) -> None:
    shell = replace(CASE, model=thud.HollowSphere())
    with pytest.warns(thud.FitWarning):
        fit = thud.fit(thud.CompressionTarget(*measured), E, shell)
    assert {"residuals_colored", "larger_than_expected"} & set(codes(fit.warnings))
    assert fit.widened > 1
    low, high = fit.intervals()["youngs_modulus"]
    assert low < TRUE.youngs_modulus < high


def test_curve_that_begins_under_load_is_doubted(measured: Measured) -> None:
    fit = quiet_fit(thud.CompressionTarget(measured[0][20:], measured[1][20:]), E, CASE)
    assert noted(fit.warnings, "at_limit").others["name"] == "touch"


def test_modulus_of_a_spring_that_has_none_has_no_effect(measured: Measured) -> None:
    spring = replace(CASE, model=thud.HuntCrossley(stiffness=2e5))
    fit = quiet_fit(thud.CompressionTarget(*measured), E, spring)
    assert fit.warnings[0].code == "no_effect"
    assert np.isinf(fit.standard_errors["youngs_modulus"])


@pytest.mark.parametrize(
    "name", ["softening of 5 %", "offset of 3 N", "drift of 5 N", "friction of 2 N"]
)
def test_interval_holds_what_press_and_rubber_add(name: str) -> None:
    curve = curve_of(name, 1, white=0.2)
    fit = thud.fit(thud.CompressionTarget(*curve), E, CASE)
    assert not fit.warnings
    assert miss(fit) < 3
    assert fit.standard_errors["youngs_modulus"] < 0.02 * TRUE.youngs_modulus
    if name == "softening of 5 %":
        assert miss(quiet(curve, unknowns=())) > 3


def test_uncertainty_of_calibration_is_that_of_the_modulus(measured: Measured) -> None:
    noise = np.random.default_rng(5).normal(scale=0.1, size=len(measured[1]))
    target = thud.CompressionTarget(measured[0], measured[1] + noise, unknowns=())
    plain, gained = (
        thud.fit(replace(target, gain=gain), E, CASE).standard_errors["youngs_modulus"]
        / TRUE.youngs_modulus
        for gain in (None, 0.02)
    )
    assert gained == pytest.approx(np.hypot(0.02, plain), rel=0.03)


def test_press_and_drop_are_fitted_together(measured: Measured) -> None:
    noise = np.random.default_rng(6).normal(size=len(measured[1]))
    press = thud.CompressionTarget(measured[0], measured[1] + noise)
    impact = thud.solve(replace(CASE, ball=TRUE))
    fit = thud.fit([press, thud.ForceTarget(impact, noise=5.0)], E, CASE)
    alone = thud.fit(press, E, CASE)
    assert fit.values["youngs_modulus"] == pytest.approx(TRUE.youngs_modulus, rel=0.01)
    assert fit.standard_errors["youngs_modulus"] < alone.standard_errors["youngs_modulus"]
    assert "touch(1)" in fit.names


def test_fewest_points_leave_something_to_two_parameters(measured: Measured) -> None:
    some = np.linspace(3, 43, 5).astype(int)
    fit = quiet_fit(thud.CompressionTarget(measured[0][some], measured[1][some]), E, CASE)
    assert fit.values["youngs_modulus"] == pytest.approx(TRUE.youngs_modulus, rel=0.01)
