"""The modulus from a curve in a press: what is found, how well, and when it is doubted."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import naming

import thud
from thud.studies.compression_fit import _warnings, _work_ratio
from thud.studies.fitting.marginal import estimate_marginal

sys.path.insert(0, str(Path(__file__).parents[1] / "validation"))
from compression_disturbances import MODEL, START, TOUCH, TRUE, curve_of, miss, quiet

Measured = tuple[np.ndarray, np.ndarray]


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
    table = fit.to_xarray()
    assert fit.to_dataframe().shape == (44, 5)
    np.testing.assert_array_equal(table["covariance"], fit.covariance)
    assert {"fit.json", "fit.csv"} == set(fit.files())
    model = table["model_N"] + table["effects_N"]
    np.testing.assert_allclose(model - table["force_N"], table["residual_N"])
    assert re.search(r"offset \S+ ± \S+ N, drift .* N, softening \S+ ± \S+\n", str(fit))
    assert "calibration 1 % high changes youngs_modulus +1 %" in str(fit)
    assert len(fit.plot().axes[0].lines) == 2
    assert fit.curve.case.ball.youngs_modulus == fit.values["youngs_modulus"]
    shown = np.interp(measured[0] - fit.values["touch"], fit.curve.deflection, fit.curve.force)
    np.testing.assert_allclose(shown + fit.effects - measured[1] - noise, fit.residuals, atol=1.0)


def test_model_that_does_not_explain_the_curve_widens_the_interval(measured: Measured) -> None:
    with (
        pytest.warns(thud.FitWarning, match=naming("color")),
        pytest.warns(thud.FitWarning, match=naming("softening")),
    ):
        fit = thud.fit_compression(*measured, START, "hollow_sphere")
    assert fit.widened > 1
    low, high = fit.intervals()["youngs_modulus"]
    assert low < TRUE.youngs_modulus < high
    assert "widened" in str(fit)


def test_curve_that_begins_under_load_is_doubted(measured: Measured) -> None:
    with pytest.warns(thud.FitWarning) as caught:
        fit = thud.fit_compression(measured[0][20:], measured[1][20:], START, MODEL)
    assert fit.warnings[0].code == "touch_at_limit"
    assert [one.message.args for one in caught] == [(note,) for note in fit.warnings]


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


@pytest.mark.parametrize(
    "name", ["softening of 5 %", "offset of 3 N", "drift of 5 N", "friction of 2 N"]
)
def test_interval_holds_what_press_and_rubber_add(name: str) -> None:
    curve = curve_of(name, 1, white=0.2)
    fit = thud.fit_compression(*curve, START, MODEL)
    assert not fit.warnings
    assert miss(fit) < 3
    assert fit.standard_errors["youngs_modulus"] < 0.02 * TRUE.youngs_modulus
    if name == "softening of 5 %":
        assert miss(quiet(curve, unknowns=())) > 3


def test_uncertainty_of_calibration_is_that_of_the_modulus(measured: Measured) -> None:
    noise = np.random.default_rng(5).normal(scale=0.1, size=len(measured[1]))
    plain, gained = (
        thud.fit_compression(
            measured[0], measured[1] + noise, START, MODEL, unknowns=(), gain=gain
        ).standard_errors["youngs_modulus"] / TRUE.youngs_modulus
        for gain in (0.0, 0.02)
    )  # fmt: skip
    assert gained == pytest.approx(np.hypot(0.02, plain), rel=0.03)
    with pytest.raises(thud.InputError, match=naming("gain", "0 <= gain < 1")):
        thud.fit_compression(*measured, START, MODEL, gain=-0.1)
    with pytest.raises(thud.InputError, match=naming("unknowns", "offset")):
        thud.fit_compression(*measured, START, MODEL, unknowns=("offest",))


def test_noise_without_effects_is_that_of_least_squares() -> None:
    """A straight line through independent noise, whose covariance is known in closed form."""
    count = 400
    rng = np.random.default_rng(6)
    jacobian = np.column_stack([np.ones(count), np.linspace(-1, 1, count)])
    residual = rng.normal(scale=2.0, size=count)
    best = estimate_marginal(jacobian, np.empty((count, 0)), residual, 1e-3)
    inverse = np.linalg.inv(jacobian.T @ jacobian)
    # The deviation is known to 4 %, the correlation of neighbors to 0.05.
    assert best.deviation == pytest.approx(2.0, rel=0.12)
    assert best.correlation < 0.15
    np.testing.assert_allclose(np.diag(best.covariance), 4 * np.diag(inverse), rtol=0.4)
    error = np.sqrt(np.diag(best.covariance))
    assert (np.abs(best.shift + inverse @ jacobian.T @ residual) < 0.2 * error).all()


def test_color_of_noise_is_found() -> None:
    count, correlation = 400, 0.7
    noise = np.random.default_rng(7).normal(size=count)
    for i in range(1, count):
        noise[i] = correlation * noise[i - 1] + np.sqrt(1 - correlation**2) * noise[i]
    best = estimate_marginal(np.ones((count, 1)), np.empty((count, 0)), noise, 1e-3)
    assert best.correlation == pytest.approx(correlation, abs=4 * np.sqrt(0.51 / count))
    white = best.whiten(noise)
    assert np.corrcoef(white[1:], white[:-1])[0, 1] == pytest.approx(0, abs=4 / np.sqrt(count))
    # The variance of the mean of a colored process is (1 + r)/(1 - r) times as large.
    expected = (1 + best.correlation) / (1 - best.correlation) / count
    assert best.covariance[0, 0] == pytest.approx(expected, rel=0.5)


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
    ("position", "warned"),
    [(-0.04, True), (-0.04 + 2e-6, False), (0.0, False), (0.9 - 2e-6, False), (0.9, True)],
)
def test_touch_at_the_limit_of_the_search_warns(position: float, *, warned: bool) -> None:
    notes, ratio = _warnings(np.random.default_rng(1).normal(size=60), position)
    assert (len(notes), ratio) == (int(warned), 1.0)


@pytest.mark.parametrize("count", [4, 5])
def test_fewest_points_leave_something_to_two_parameters(measured: Measured, count: int) -> None:
    some = np.linspace(3, 43, count).astype(int)
    if count < 5:
        with pytest.raises(thud.InputError, match=naming("deflection", 5)):
            thud.fit_compression(measured[0][some], measured[1][some], START, MODEL)
    else:
        fit = thud.fit_compression(measured[0][some], measured[1][some], START, MODEL)
        assert fit.values["youngs_modulus"] == pytest.approx(TRUE.youngs_modulus, rel=0.01)
