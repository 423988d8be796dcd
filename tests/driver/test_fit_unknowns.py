"""Fits whose case may be wrong: intervals include what the force does not exclude, or a warning."""

from __future__ import annotations

import json

import numpy as np
import pytest
from conftest import SHELL, codes, naming, noted, quiet_fit
from fit_assumptions import ASSUMED, BACKGROUND, RATE, START, TRUTH, record

import thud
from thud.case.keys import with_values
from thud.studies.fit import read_fit_study
from thud.studies.fitting import force_target
from thud.studies.fitting.comparison import misfit_ratio
from thud.studies.fitting.estimate import posterior
from thud.studies.fitting.search import ORDERS, UNKNOWNS, alternatives


def miss(fit: thud.Fit) -> float:
    """Return the largest error over its standard error."""
    return max(abs(fit.values[name] - TRUTH[name]) / fit.standard_errors[name] for name in TRUTH)


@pytest.mark.parametrize(("values", "effects"), [(12, 3), (3, 5)])
def test_effects_are_those_of_a_regression_with_their_priors(values: int, effects: int) -> None:
    """Parameters and effects of normal priors in one least-squares problem, a row per prior."""
    rng = np.random.default_rng(1)
    jacobian, change = rng.normal(size=(values, 2)), rng.normal(size=(values, effects))
    residual = rng.normal(size=values)
    inverse = np.linalg.pinv(jacobian)
    found = posterior(jacobian, inverse, change, residual)
    prior = np.hstack([np.zeros((effects, 2)), np.eye(effects)])
    rows = np.vstack([np.hstack([jacobian, change]), prior])
    best, (square,), *_ = np.linalg.lstsq(rows, -np.append(residual, np.zeros(effects)))
    covariance = np.linalg.inv(rows.T @ rows)
    np.testing.assert_allclose(found.mean, best[2:])
    np.testing.assert_allclose(found.shift - inverse @ residual, best[:2])
    np.testing.assert_allclose(found.covariance, covariance[2:, 2:])
    noise = np.linalg.inv(jacobian.T @ jacobian)
    np.testing.assert_allclose(noise + found.spread, covariance[:2, :2])
    # What is left of the data, and the volume of the posterior over that of the prior.
    volume = np.linalg.slogdet(found.covariance)[1]
    assert found.evidence == pytest.approx(-0.5 * (square - volume))


def test_alternatives_differ_from_the_case_in_one_unknown() -> None:
    found = alternatives(ASSUMED, UNKNOWNS, ())
    assert [unknown for unknown, *_ in found] == [
        *["damping law"] * len(ORDERS), "friction", "gravity", "floor"
    ]  # fmt: skip
    assert [case.model.fractional_order for *_, case in found[:3]] == list(ORDERS)  # type: ignore[union-attr]
    assert found[-1][2].floor is not None
    # A parameter that is fitted is none of them.
    assert len(alternatives(ASSUMED, UNKNOWNS, ["fractional_order"])) == 3
    assert [unknown for unknown, *_ in alternatives(ASSUMED, ["gravity"], ())] == ["gravity"]
    elastic = thud.Case(model=thud.FiniteElement(viscosity="none"))
    found = alternatives(elastic, UNKNOWNS, ())
    assert [label for _, label, _ in found] == ["friction 1.0", "resistance 100000.0"]
    assert not alternatives(thud.Case(model=thud.HollowSphere()), UNKNOWNS, ())


@pytest.mark.parametrize("name", ["order 0.7", "gravity"])
def test_wrong_assumption_does_not_pass_in_silence(name: str) -> None:
    """Of 5 % of noise; the trusting fit misses without a word."""
    drop = record(name, np.random.default_rng(3), 0.05)
    trusting = thud.fit(drop, START, ASSUMED, unknowns=())
    assert not trusting.warnings
    assert miss(trusting) > 3
    fit = thud.fit(drop, START, ASSUMED)
    assert miss(fit) < 3
    # The estimate is that of the case.
    assert fit.values == pytest.approx(trusting.values)


def test_clear_effect_of_an_alternative_warns_and_widens() -> None:
    drop = record("order 0.7", np.random.default_rng(1), 0.005)
    fit = quiet_fit(drop, START, ASSUMED)
    seen = noted(fit.warnings, "alternative_seen").others
    assert "fractional_order" in seen["alternative"]
    assert seen["unknown"] == "damping law"
    assert miss(fit) < 3 < miss(quiet_fit(drop, START, ASSUMED, unknowns=()))


def test_fit_that_warns_widens_its_intervals() -> None:
    time, force = record("as assumed", np.random.default_rng(1), 0.005)
    plain = thud.fit((time, force), START, ASSUMED)
    assert plain.widened == 1
    ringing = np.sin(2 * np.pi * 300 * time) * np.exp(-time / 0.02)
    ringing = np.roll(np.where(time < 0.04, ringing, 0), int(BACKGROUND * RATE))
    fit = quiet_fit((time, force + 40 * ringing), START, ASSUMED)
    assert fit.warnings
    assert fit.widened > 2
    assert json.loads(fit.files()["fit.json"])["widened"] == fit.widened
    low, high = fit.intervals()["youngs_modulus"]
    factor = (high - low) / 2 / fit.standard_errors["youngs_modulus"]
    assert factor > 1.9
    assert fit.standard_errors["youngs_modulus"] > 2 * plain.standard_errors["youngs_modulus"]


def test_misfit_is_that_of_the_worst_band() -> None:
    noise = np.random.default_rng(2).normal(size=400)
    # Means of 50 exponential values.
    assert 1 <= misfit_ratio(noise) < 1.3
    tone = 10 * np.sin(np.arange(400))
    # Its power is that of a quarter of the frequencies.
    assert misfit_ratio(noise + tone) == pytest.approx(np.sqrt(4 * 100 / 2), rel=0.05)
    assert misfit_ratio(0.1 * noise) == 1
    # An offset is in none of the bands.
    assert misfit_ratio(np.full(400, 3.0)) == pytest.approx(3)


def test_effect_of_calibration_is_stated() -> None:
    drop = record("as assumed", np.random.default_rng(4), 0.001)
    fit, other = (quiet_fit((drop[0], gain * drop[1]), START, ASSUMED) for gain in (1, 1.01))
    note = noted(fit.assumptions, "not_visible")
    for entry in str(note.others["changes"]).split(", "):
        name, stated, _ = entry.split()
        change = 100 * (other.values[name] / fit.values[name] - 1)
        assert float(stated) == pytest.approx(change, rel=0.1, abs=0.01), name
    content = json.loads(fit.files()["fit.json"])
    assert content["assumptions"] == list(map(str, fit.assumptions))
    known = quiet_fit(thud.ForceTarget(drop, gain=0.01), START, ASSUMED)
    assert "not_visible" not in codes(known.assumptions)


def test_alternative_that_cannot_be_computed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    compute = force_target.compute

    def fails(case: thud.Case) -> thud.Impact:
        if case.floor is not None:
            message = "out of the model"
            raise thud.NumericalError(message)
        return compute(case)

    drop = record("as assumed", np.random.default_rng(1), 0.01)
    monkeypatch.setattr(force_target, "compute", fails)
    with pytest.warns(thud.FitWarning, match=naming("resistance", "out of the model")):
        thud.fit(drop, START, ASSUMED)


def test_records_share_their_unknowns() -> None:
    """Of two records of one ball the effects are the same, of one each they are more freely so."""
    drops = [record("as assumed", np.random.default_rng(seed), 0.02) for seed in (1, 2)]
    one = thud.fit(drops[0], START, ASSUMED)
    both = thud.fit([thud.ForceTarget(drop) for drop in drops], START, ASSUMED)
    for name in TRUTH:
        assert both.standard_errors[name] < one.standard_errors[name]


@pytest.mark.slow
def test_false_warnings_of_effects_are_rare() -> None:
    impact = thud.solve(with_values(ASSUMED, TRUTH))
    force = np.pad(impact.floor_force[: int(impact.contact_time * RATE) + 2], 1764)
    time, warned = np.arange(len(force)) / RATE, 0
    for seed in range(8):
        noise = np.random.default_rng(seed).normal(scale=20, size=len(force))
        warned += bool(quiet_fit((time, force + noise), START, ASSUMED).warnings)
    assert warned <= 1


def test_files_state_unknowns() -> None:
    tables = {"target": {"levels": [39, 31, 23, 17, 12]}, "parameters": {"mass": {}}}
    study = read_fit_study({"unknowns": ["friction"], **tables})
    assert study.options.unknowns == ["friction"]


def test_levels_that_do_not_fit_have_wider_intervals() -> None:
    """By the root of the reduced chi-square."""
    levels = thud.solve(SHELL).levels(force="floor") + 3 * np.array([1, -1, 1, -1, 1])
    fit = quiet_fit(thud.LevelTarget(levels, 0.5, force="floor"), ["youngs_modulus"], SHELL)
    assert fit.warnings
    assert fit.widened == pytest.approx(np.sqrt(fit.reduced_chi_square))
    double = quiet_fit(thud.LevelTarget(levels, 100.0, force="floor"), ["youngs_modulus"], SHELL)
    assert double.widened == 1
    ratio = double.standard_errors["youngs_modulus"] / fit.standard_errors["youngs_modulus"]
    assert ratio == pytest.approx(200 / fit.widened, rel=1e-3)
