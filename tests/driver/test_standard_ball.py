"""The calibrated standard ball: its sets agree with the standards, its defaults are the fit."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import load_script
from scipy.stats import binomtest

from thud.base._schema import STANDARD_BALL
from thud.studies.calibrated_set import calibrated_set

calibrate = load_script("driver/calibrate_standard_ball.py")

# Draws of the prior that `./bootstrap calibrate` needed for its sets.
DRAWN = {"finite_element": 323, "modal_ball": 431}
# Largest deviation of an octave from the nominal level, dB.
MISFIT = {"finite_element": 1.0, "modal_ball": 1.1}
# What rounding of the fit and the ends of contacts, which fall on samples, may cost.
ROUNDING = 0.02


@pytest.mark.parametrize("model", calibrate.MODELS)
def test_sets_agree_with_the_standards(model: str) -> None:
    sets = calibrated_set(model)
    assert sets.keys() == calibrate.PRIORS[model].keys()
    assert {len(values) for values in sets.values()} == {calibrate.COUNT}
    assert calibrate.accept(calibrate.solve(model, sets)).all()
    # The prior of the loss factor, which nothing else limits, does not cut the sets.
    _, low, high = calibrate.PRIORS[model]["loss_factor"]
    margin = np.ptp(sets["loss_factor"]) / 4
    assert low + margin < sets["loss_factor"].min()
    assert sets["loss_factor"].max() < high - margin


@pytest.mark.parametrize("model", calibrate.MODELS)
def test_default_is_the_least_misfit(model: str) -> None:
    ball = {k: STANDARD_BALL[model, k] for k in calibrate.FREE[model] if k != "friction"}
    changed = [
        {**ball, key: min(value * factor, calibrate.FREE[model][key][2])}
        for key, value in ball.items()
        for factor in (0.9, 0.95, 1.05, 1.1)
    ]
    columns = {key: np.array([values[key] for values in [ball, *changed]]) for key in ball}
    residuals = calibrate.residuals(model, columns)
    misfit, *others = (residuals**2).sum(axis=1)
    assert min(others) > misfit - ROUNDING
    assert np.abs(residuals[0, :5] * calibrate.TOLERANCE).max() < MISFIT[model]
    assert abs(residuals[0, 5]) < 1  # contact time


def test_command_makes_the_sets() -> None:
    sets, drawn = calibrate.draw_sets("modal_ball", calibrate.COUNT, progress=False)
    assert drawn == DRAWN["modal_ball"]
    for key, values in calibrated_set("modal_ball").items():
        np.testing.assert_array_equal(sets[key], values)


@pytest.mark.slow
@pytest.mark.parametrize("model", calibrate.MODELS)
def test_fraction_of_the_prior_does_not_hang_on_the_mesh(
    model: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    coarse = {"radial_elements": 4, "polar_elements": 32}
    monkeypatch.setitem(calibrate.MESH, "finite_element", coarse)
    prior = calibrate.draw_prior(model, 128, np.random.default_rng(1))
    accepted = int(calibrate.accept(calibrate.solve(model, prior)).sum())
    assert binomtest(accepted, 128, calibrate.COUNT / DRAWN[model]).pvalue > 1e-3
