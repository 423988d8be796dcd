"""Several records in one fit, and what it says of parameters that cannot be separated."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import REPOSITORY, codes, naming, quiet_fit
from scipy import stats

import thud
from thud.studies.fit import read_fit_study
from thud.studies.fitting.comparison import UNLIKELY

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Record = tuple[NDArray[np.float64], NDArray[np.float64]]

RATE = 44100.0
HEIGHTS = (0.1, 1.0, 1.6)
# Their standard deviations, N.
NOISES = (1.0, 5.0, 8.0)
QUIET = 1000
# A miss by four standard errors has a probability of 6e-5.
FAR = 4.0
# From 0.1 m contacts are the longest.
CASE = thud.Case(
    ball=thud.Ball(youngs_modulus=1.8e6),
    sampling=thud.Sampling(duration=0.03),
    model=thud.HollowSphere(),
)
TRUTH = {"youngs_modulus": 1.8e6, "mass": 2.5}


def record(case: thud.Case, height: float, noise: float, seed: int, offset: float = 0.0) -> Record:
    """Return the force of a drop with quiet, white noise and an offset."""
    impact = thud.solve(replace(case, drop=thud.Drop(height)))
    contact = int(impact.contact_time * RATE) + 2
    force = np.pad(impact.floor_force[:contact], QUIET) + offset
    force += np.random.default_rng(seed).normal(scale=noise, size=len(force))
    return np.arange(len(force)) / RATE, force


@pytest.fixture(scope="module")
def drops() -> list[Record]:
    """Return records from three heights, each with its own noise and offset."""
    return [
        record(CASE, height, noise, seed, 4.0 * seed)
        for seed, (height, noise) in enumerate(zip(HEIGHTS, NOISES, strict=True))
    ]


def targets_of(drops: list[Record]) -> list[thud.ForceTarget]:
    """Return the targets of drops from the first heights."""
    pairs = zip(drops, HEIGHTS, strict=False)
    return [thud.ForceTarget(drop, fixed={"height": height}) for drop, height in pairs]


def test_three_heights_give_modulus_and_mass(drops: list[Record]) -> None:
    fit = thud.fit(targets_of(drops), {"youngs_modulus": 1.6e6, "mass": 2.4}, CASE)
    assert not fit.warnings
    assert fit.names[2:] == ("time_shift(1)", "time_shift(2)", "time_shift(3)")
    study = read_fit_study(REPOSITORY / "inputs/studies/fit_heights.toml")
    assert [term.case.drop.height for term in study.terms] == [*HEIGHTS]
    figures = {name for name in study.files if name.endswith("svg")}
    assert {*study.files} - figures == {*fit.files()} >= {"fit_3.csv", "fitted_1.nml", "fit.json"}
    assert figures == {f"{name}.svg" for name in fit.figures()}
    for name, value in TRUTH.items():
        assert abs(fit.values[name] - value) < FAR * fit.standard_errors[name]
    for number, target in enumerate(fit.targets):
        assert target.case.drop.height == HEIGHTS[number]
        # What lies under the pulse: the offset, to the noise of 40 ms, which hold some 60 values.
        under = np.asarray(target.columns()["background_N"])
        assert abs(under.mean() - 4.0 * number) < FAR
        noise = target.comparison.unit_deviation
        assert noise == pytest.approx(NOISES[number], rel=FAR / np.sqrt(2 * 60))


def test_information_of_records_adds() -> None:
    # One common parameter, the times of first touch apart: 1/variance is the sum of those alone.
    targets = [
        thud.ForceTarget(record(CASE, height, noise, 1), noise=noise, fixed={"height": height})
        for height, noise in ((0.5, 5.0), (1.0, 9.0))
    ]
    alone = [thud.fit(target, ["youngs_modulus"], CASE) for target in targets]
    both = thud.fit(targets, ["youngs_modulus"], CASE)
    errors = np.array([fit.standard_errors["youngs_modulus"] for fit in alone])
    values = np.array([fit.values["youngs_modulus"] for fit in alone])
    weight = errors**-2
    assert both.standard_errors["youngs_modulus"] == pytest.approx(weight.sum() ** -0.5, rel=2e-3)
    mean = float(weight @ values / weight.sum())
    assert abs(both.values["youngs_modulus"] - mean) < 0.02 * errors.min()


def test_forces_and_levels_are_fitted_together() -> None:
    impact = thud.solve(replace(CASE, drop=thud.Drop(0.5)))
    targets = [
        thud.ForceTarget(record(CASE, 1.0, 5.0, 3)),
        thud.LevelTarget(impact.levels(force="floor"), 0.1, fixed={"height": 0.5}),
    ]
    fit = thud.fit(targets, ["youngs_modulus"], CASE)
    assert abs(fit.values["youngs_modulus"] - 1.8e6) < FAR * fit.standard_errors["youngs_modulus"]
    assert list(fit.figures()) == ["fit_1", "fit_2", "confidence"]


def test_record_that_does_not_fit_the_others_is_named(drops: list[Record]) -> None:
    time, force = drops[1]
    targets = targets_of([drops[0], (time, 1.05 * force)])
    with pytest.warns(thud.FitWarning) as caught:
        thud.fit(targets, list(TRUTH), CASE)
    assert any("target 2" in str(one.message) for one in caught)
    free = [targets[0], replace(targets[1], gain=np.inf)]
    fit = thud.fit(free, list(TRUTH), CASE)
    assert abs(fit.values["gain(2)"] - 1.05) < FAR * fit.standard_errors["gain(2)"]


def test_residuals_of_a_target_have_its_share_of_the_parameters() -> None:
    # Five levels twice, and one parameter: 4.5 degrees of freedom each.
    levels = thud.solve(CASE).levels(force="floor") + np.array([1, -1, 1, -1, 1])

    def fit(uncertainty: float) -> thud.Fit:
        target = thud.LevelTarget(levels, uncertainty, force="floor")
        return quiet_fit([target, target], ["youngs_modulus"], CASE)

    residuals = fit(1.0).residuals
    for factor, expected in ((0.99, 0), (1.01, 2)):
        wanted = factor * stats.chi2.isf(UNLIKELY, 4.5)
        told = fit(float(np.sqrt(residuals @ residuals / 2 / wanted))).warnings
        assert codes(told).count("unexplained") == expected


def test_heights_do_not_tell_modulus_from_wall(drops: list[Record]) -> None:
    with pytest.warns(thud.FitWarning, match=naming("youngs_modulus * wall_thickness^2")):
        fit = thud.fit(targets_of(drops[:2]), ["youngs_modulus", "wall_thickness"], CASE)
    assert np.isinf(fit.standard_errors["youngs_modulus"])


def test_largest_correlation_is_stated() -> None:
    # The force scales with the mass, and nearly with the root of the height.
    drop = thud.ForceTarget(record(CASE, 1.0, 5.0, 2))
    fit = thud.fit(drop, ["youngs_modulus", "mass", "height"], CASE)
    strong = np.triu(np.abs(fit.correlation), 1)
    i, j = np.unravel_index(strong.argmax(), strong.shape)
    assert strong[i, j] > 0.9
    pair = f"{fit.names[i]} and {fit.names[j]}"
    assert re.search(rf"correlation: \S*{strong[i, j]:.4f} of {pair}", str(fit))
