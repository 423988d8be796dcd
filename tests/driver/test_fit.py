"""Fits: known parameters come back, intervals cover, what is not identifiable is named."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import SHELL, naming, quiet_fit
from scipy import stats

import thud
from thud.case.keys import with_values
from thud.studies.fitting import force_target, search
from thud.studies.fitting.estimate import infer, worst_directions
from thud.studies.parameter import Range, fitted_parameter, get_ranges

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    FailWhere = Callable[[Callable[[float], bool]], None]

RATE = 44100.0
TRUTH = thud.Case(ball=thud.Ball(youngs_modulus=1.8e6), model=thud.HollowSphere())
MODAL = thud.Case(model=thud.ModalBall(damping_law="rising"))
COARSE = thud.FiniteElement(radial_elements=2, polar_elements=16, snapshot_interval=0.0)
# Least squares end where a step or a gain is 1e-8; near a perfect fit the last step squares that
# of the one before, but for the derivative's own error of up to 3e-3.
SOLVED = 1e-8


def noisy_record(impact: thud.Impact, noise: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    # 5 ms before first touch, at which no sample lies, and the impact: too little quiet to tell
    # the noise.
    force = np.random.default_rng(seed).normal(scale=noise, size=1323)
    force[220:] += impact.floor_force[:1103]
    return np.arange(1323) / RATE - 0.1, force


@pytest.fixture
def fail_where(monkeypatch: pytest.MonkeyPatch) -> FailWhere:
    """Let the model fail at some of the moduli, Pa."""
    solve = force_target.compute

    def set_failures(fails: Callable[[float], bool]) -> None:
        def compute(case: thud.Case) -> thud.Impact:
            if fails(case.ball.youngs_modulus):
                message = "out of the model"
                raise thud.NumericalError(message)
            return solve(case)

        monkeypatch.setattr(force_target, "compute", compute)

    return set_failures


def test_known_parameters_come_back() -> None:
    target = thud.solve(replace(TRUTH, drop=thud.Drop(1.1)))
    fit = thud.fit(target, ["youngs_modulus", "height"], case=SHELL)
    assert fit.values == pytest.approx({"youngs_modulus": 1.8e6, "height": 1.1}, rel=SOLVED)
    assert fit.converged
    assert fit.case.ball == replace(TRUTH.ball, youngs_modulus=fit.values["youngs_modulus"])
    # Of a confidence below the rounding the intervals have no width.
    for name, (low, high) in fit.intervals(1e-17).items():
        assert low == high == fit.values[name]


@pytest.mark.parametrize(
    ("model", "truth", "starts"),
    [
        (thud.ModalBall(damping_law="rising"), {"youngs_modulus": 1.75e6, "loss_factor": 0.18}, {}),
        (COARSE, {"youngs_modulus": 2.08e6, "loss_factor": 0.25},
         {"youngs_modulus": 1.6e6, "loss_factor": 0.1}),
        (thud.HuntCrossley(contact_time=0.019, restitution=0.7),
         {"contact_time": 0.02, "restitution": 0.8}, {}),
        (thud.TwoMass(belt_mass=1.0), {"inflation_pressure": 2.3e5, "contact_damping": 0.07}, {}),
        (thud.MeasuredModes((23.0, 80.0), (0.05, 0.1), (2.4, 0.1)),
         {"frequency(1)": 24.0, "frequency(2)": 89.0, "damping_ratio(2)": 0.05}, {}),
    ],
    ids=["modal_ball", "finite_element", "hunt_crossley", "two_mass", "measured_modes"],
)  # fmt: skip
@pytest.mark.slow
def test_every_model_can_be_fitted(
    model: thud.FiniteElement, truth: dict[str, float], starts: dict[str, float]
) -> None:
    case = thud.Case(model=model)
    fit = thud.fit(thud.solve(with_values(case, truth)), starts or list(truth), case)
    assert fit.values == pytest.approx(truth, rel=SOLVED)
    assert not fit.warnings


def test_search_keeps_the_automatic_elements_of_its_start(monkeypatch: pytest.MonkeyPatch) -> None:
    searched: list[thud.FiniteElement] = []

    def search_nothing(terms: list[search.Term], *_: object, **__: object) -> None:
        searched.extend(term.case.model for term in terms)  # type: ignore[misc]
        raise thud.NumericalError

    monkeypatch.setattr("thud.studies.fit.Objective", search_nothing)
    start = {"youngs_modulus": 2.2e6, "height": 0.9}
    target = thud.solve(model=COARSE)
    for case in (thud.Case(model=thud.FiniteElement()), thud.Case(model=COARSE)):
        with pytest.raises(thud.NumericalError):
            thud.fit(target, start, case)
        elements = thud.solve(with_values(case, start)).model_quantities
        model = searched.pop()
        assert model.radial_elements == elements["radial_elements"]
        assert model.polar_elements == elements["polar_elements"] >= 16


def test_time_of_first_touch_is_found_between_samples() -> None:
    impact = thud.solve(TRUTH)
    late = 0.0123456
    time = np.arange(3000) / RATE
    frequency = np.fft.rfftfreq(3000, 1 / RATE)
    whole = np.concatenate([impact.floor_force, np.zeros(3000 - len(impact.time))])
    moved = np.fft.irfft(np.fft.rfft(whole) * np.exp(-2j * np.pi * frequency * late), 3000)
    fit = thud.fit((time, moved), ["youngs_modulus"], case=SHELL)
    assert fit.values["time_shift"] == pytest.approx(late, abs=1e-10)
    assert fit.values["youngs_modulus"] == pytest.approx(1.8e6, rel=SOLVED)


def test_other_sampling_rates_are_no_hindrance() -> None:
    target = thud.solve(replace(TRUTH, sampling=thud.Sampling(96000.0, substeps=2)))
    fit = thud.fit(target, ["youngs_modulus"], case=SHELL)
    # The sums over samples differ by the bend at release, at most slope/8 times the interval
    # squared in an impulse of 21 N s; a change of E by 1 changes the spectrum by about itself.
    slope = np.abs(np.diff(target.floor_force)).max() * 96000
    assert fit.values["youngs_modulus"] == pytest.approx(1.8e6, rel=10 * slope / 8 / RATE**2 / 21)


@pytest.mark.parametrize("noise", [5.0, None], ids=["given noise", "noise from the residuals"])
@pytest.mark.slow
def test_intervals_cover_the_truth_as_often_as_they_say(noise: float | None) -> None:
    # 90 % of the intervals are to hold the truth: the number of those that do is binomial, and
    # leaves these quantiles once in 10 000 times.
    count, confidence = 100, 0.9
    truth = {"youngs_modulus": 1.8e6, "height": 1.1, "time_shift": 220 / RATE - 0.1}
    case = thud.Case(sampling=thud.Sampling(duration=0.026), model=thud.HollowSphere())
    impact = thud.solve(replace(case, ball=TRUTH.ball, drop=thud.Drop(1.1)))
    impact = replace(impact, floor_force=np.append(impact.floor_force, np.zeros(2000)))
    starts = {"youngs_modulus": 1.8e6, "height": 1.1}
    covered = dict.fromkeys(truth, 0)
    pulls = []
    for seed in range(count):
        record = noisy_record(impact, 5.0, seed)
        fit = quiet_fit(thud.ForceTarget(record, noise=noise), starts, case, confidence=confidence)
        for name, (low, high) in fit.intervals().items():
            covered[name] += low < truth[name] < high
        pulls.append([(fit.values[n] - truth[n]) / fit.standard_errors[n] for n in truth])
    low, high = stats.binom.ppf([0.5e-4, 1 - 0.5e-4], count, confidence)
    assert all(low <= number <= high for number in covered.values()), covered
    # The covariance is that of the estimates: errors over standard errors have unit variance, the
    # sum of their squares is chi-square (to 1/100 where some 100 residuals tell the noise).
    spread = np.sum(np.square(pulls), axis=0)
    ends = stats.chi2.ppf([0.5e-4, 1 - 0.5e-4], count)
    assert (ends[0] < spread).all(), spread
    assert (spread < ends[1]).all(), spread


def test_worst_directions_are_axes_of_the_ellipsoid() -> None:
    turn, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    covariance = np.full((4, 4), np.nan)
    covariance[np.ix_([0, 2, 3], [0, 2, 3])] = turn @ np.diag([4.0, 1.0, 0.25]) @ turn.T
    found = worst_directions(covariance, 0.9)
    assert [size for size, _ in found] == pytest.approx([2.0, 1.0])
    for (_, direction), axis in zip(found, turn.T, strict=False):
        assert abs(direction[[0, 2, 3]] @ axis) == pytest.approx(1)
        assert direction[1] == 0


def test_parameters_are_lost_by_size_and_by_error_of_the_derivatives() -> None:
    base = np.linalg.qr(np.random.default_rng(3).normal(size=(30, 2)))[0]

    def lost(jacobian: np.ndarray, change: np.ndarray, size: float = 1.0) -> int:
        return len(infer(jacobian, jacobian + change, size).null)

    exact = base @ [[2.0, 1.0], [0.0, 3.0]]
    np.testing.assert_allclose(infer(exact, exact, 1.0).covariance, np.linalg.inv(exact.T @ exact))
    # Less than 1e-9 of the target, or half of it error: no effect.
    none = np.zeros_like(base)
    for length, expected in ((0.99e-9, 1), (1.01e-9, 0)):
        assert lost(base * [1, 7 * length], none, 7.0) == expected
    # A column that is half error has no effect; one with a little less makes all doubtful.
    for share, expected in ((0.49, 2), (0.51, 1)):
        assert lost(base, np.column_stack([none[:, 0], share * base[:, 0]])) == expected
    # Nearly equal columns: their smallest singular value below three of its own errors.
    angle = 0.1
    near = np.column_stack([base[:, 0], np.cos(angle) * base[:, 0] + np.sin(angle) * base[:, 1]])
    small, large = np.sqrt(1 - np.cos(angle)), np.sqrt(1 + np.cos(angle))
    for factor, expected in ((0.99, 0), (1.01, 1)):
        error = factor * small / large / 3
        change = np.column_stack([none[:, 0], error * base[:, 1]])
        assert lost(near, change) == expected
    # Without errors below a millionth of the largest one: the tangent of half the angle.
    for angle, expected in ((2 * 0.99e-6, 1), (2 * 1.01e-6, 0)):
        assert lost(np.column_stack([base[:, 0], base @ [1, angle]]), none) == expected


def ranges_of(case: thud.Case, **given: object) -> list[Range]:
    """Return the ranges of parameters, given as in a fit."""
    return get_ranges(case, [fitted_parameter(name, entry, case) for name, entry in given.items()])


def test_ranges_start_inside_and_spread_to_half_and_double() -> None:
    case = thud.Case(drop=thud.Drop(2.0), model=thud.HollowSphere())
    (plain,) = ranges_of(case, height=None)
    assert (plain.start, plain.scale, plain.spread) == (2.0, 2.0, (1.0, 4.0))
    (cut,) = ranges_of(case, height=thud.Parameter(start=2.0, low=1.5, high=2.0))
    # A start at a limit lies a percent of itself inside.
    assert (cut.low, cut.high, cut.spread) == (1.5, 2.0, (1.5, 2.0))
    assert cut.start == pytest.approx(2.0 - 0.02)
    (narrow,) = ranges_of(case, height=thud.Parameter(start=2.0, low=1.99, high=2.0))
    assert narrow.start == pytest.approx(2.0 - 0.01 / 4)
    # A start at 0 has no scale of its own: a tenth of the range is one.
    (zero,) = ranges_of(SHELL, poisson_ratio=thud.Parameter(start=0.0, low=-0.2, high=0.3))
    assert zero.scale == pytest.approx(0.05)


def test_starts_are_the_given_one_and_a_latin_hypercube_over_the_spread() -> None:
    ranges = ranges_of(SHELL, height=thud.Parameter(2.0), mass=thud.Parameter(2.5, 2.0, 4.0))
    first, *others = search.starts_of(ranges, 9, 0)
    assert first == pytest.approx([1.0, 1.0])
    # Of height from half to double, of mass inside its limits: one in each eighth.
    for column, (low, high) in zip(np.transpose(others), ((0.5, 2.0), (0.8, 1.6)), strict=True):
        assert sorted(8 * (column - low) // (high - low)) == list(range(8))


def test_noise_is_estimated_from_the_residuals() -> None:
    record = noisy_record(thud.solve(TRUTH), 5.0, 3)
    fit = quiet_fit(record, ["youngs_modulus"], case=SHELL)
    # A standard deviation from n residuals has the relative error 1 / sqrt(2 n).
    assert fit.noise == pytest.approx(5.0, rel=4 / np.sqrt(2 * fit.degrees_of_freedom))
    assert fit.reduced_chi_square == pytest.approx(1.0)
    given = quiet_fit(thud.ForceTarget(record, noise=5.0), ["youngs_modulus"], case=SHELL)
    assert given.reduced_chi_square == pytest.approx((fit.noise / 5.0) ** 2)
    assert given.values == pytest.approx(fit.values)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        # F ~ E / sqrt(1 - nu2): d ln F = d ln E + nu2 / (1 - nu2) d ln nu.
        ({"youngs_modulus": None, "poisson_ratio": 0.4}, ["youngs_modulus * poisson_ratio^0.19"]),
        (
            {"youngs_modulus": None, "wall_thickness": None},
            ["youngs_modulus +1 %", "wall_thickness -0.5 %", "* wall_thickness^2"],
        ),
    ],
)
def test_parameters_that_are_not_identifiable_are_named(
    parameters: dict[str, float], words: list[str]
) -> None:
    target = thud.ForceTarget(noisy_record(thud.solve(TRUTH), 5.0, 1), noise=5.0)
    with pytest.warns(thud.FitWarning, match=naming(*words)):
        fit = thud.fit(target, parameters, case=SHELL)
    assert all(fit.standard_errors[name] == np.inf for name in parameters)
    assert np.isfinite(fit.standard_errors["time_shift"])
    assert fit.singular_values[-1] < 1e-6 * fit.singular_values[0]


def test_parameter_without_effect_is_named() -> None:
    case = thud.Case(model=thud.ModalBall(damping_law="constant", loss_factor=0.3))
    with pytest.warns(thud.FitWarning, match=naming("loss_frequency")):
        fit = thud.fit(thud.solve(case), {"youngs_modulus": 1.5e6, "loss_frequency": 80}, case)
    assert fit.values["youngs_modulus"] == pytest.approx(1.56e6, rel=1e-6)
    assert np.isfinite(fit.standard_errors["youngs_modulus"])


def test_modulus_and_wall_are_hardly_identifiable_from_low_octaves() -> None:
    impact = thud.solve(MODAL)
    names = ["youngs_modulus", "wall_thickness"]
    low = thud.LevelTarget(impact.levels(force="floor")[:2], 0.5, frequencies=[31.5, 63])
    with pytest.warns(thud.FitWarning, match=naming(*names)):
        thud.fit(low, names, MODAL)
    # From the force itself they are.
    fit = thud.fit(thud.ForceTarget(impact, noise=5.0), names, MODAL)
    assert not fit.warnings
    assert all(fit.standard_errors[name] < 0.01 * fit.values[name] for name in names)


@pytest.mark.parametrize("bands", ["octave", "third"])
@pytest.mark.slow
def test_levels_and_what_else_is_known(bands: str) -> None:
    truth = {"youngs_modulus": 1.75e6, "loss_factor": 0.18}
    impact = thud.solve(with_values(MODAL, truth))
    known = {"restitution": (impact.restitution, 0.01)}
    levels = impact.levels(bands, force="floor")
    fit = thud.fit(thud.LevelTarget(levels, 0.2, bands, quantities=known), list(truth), MODAL)
    assert fit.values == pytest.approx(truth, rel=1e-6)
    assert not fit.warnings


def test_model_that_cannot_follow_is_reported() -> None:
    record = noisy_record(thud.solve(MODAL), 5.0, 1)
    for noise, expected in (
        (None, ["residuals_in_contact", "background_too_short"]),
        (5.0, ["unexplained", "residuals_in_contact"]),
    ):
        fit = quiet_fit(thud.ForceTarget(record, noise=noise), ["youngs_modulus"], case=SHELL)
        assert [note.code for note in fit.warnings] == expected


@pytest.mark.parametrize(("low", "high", "limit"), [(1e6, 1.7e6, 1.7e6), (1.9e6, 3e6, 1.9e6)])
def test_limits_hold_and_are_reported(
    low: float, high: float, limit: float, fail_where: FailWhere
) -> None:
    # Also of the differences that are the derivatives.
    fail_where(lambda modulus: not low * (1 - 1e-12) <= modulus <= high * (1 + 1e-12))
    limited = {"youngs_modulus": thud.Parameter((low + high) / 2, low, high)}
    fit = quiet_fit(thud.solve(TRUTH), limited, case=SHELL)
    assert not fit.failures
    told = fit.warnings[0]
    assert (told.code, told.others["name"]) == ("at_limit", "youngs_modulus")
    assert told.value == pytest.approx(limit)
    assert low <= fit.values["youngs_modulus"] <= high


def test_intervals_end_at_the_limits() -> None:
    record = noisy_record(thud.solve(TRUTH), 5.0, 3)
    limited = {"youngs_modulus": thud.Parameter(1.5e6, 1e6, 1.8e6)}
    fit = quiet_fit(record, limited, case=SHELL)
    low, high = fit.intervals(0.999999)["youngs_modulus"]
    assert low < fit.values["youngs_modulus"] <= high == pytest.approx(1.8e6, rel=1e-12)
    free = quiet_fit(record, ["youngs_modulus"], case=SHELL)
    assert free.intervals(0.999999)["youngs_modulus"][1] > 1.8e6
    assert np.isinf(free.limits[free.names.index("time_shift")]).all()


def test_estimated_deviation_of_levels_is_that_of_their_residuals() -> None:
    def levels_of(modulus: float) -> NDArray[np.float64]:
        return thud.solve(thud.Ball(youngs_modulus=modulus), model="hollow_sphere").levels()

    levels = levels_of(1.8e6) + 0.1 * np.eye(5)[0]
    fit = quiet_fit(thud.LevelTarget(levels), ["youngs_modulus"], case=SHELL)
    rest = fit.result.levels(force="floor") - levels
    # Five levels, less one parameter.
    assert fit.noise == pytest.approx(np.sqrt(rest @ rest / 4))
    modulus, step = fit.values["youngs_modulus"], 1e2
    slope = np.linalg.norm(levels_of(modulus + step) - levels_of(modulus - step)) / (2 * step)
    assert fit.standard_errors["youngs_modulus"] == pytest.approx(fit.noise / slope, rel=1e-3)


@pytest.mark.parametrize(
    ("start", "starts", "fails"),
    [
        # The first step, of the length of the start, leads into the gap.
        (0.5e6, 1, lambda modulus: 0.95e6 < modulus < 1.1e6),
        # SciPy's search in a plane breaks down for a single parameter far from its start.
        (0.3e6, 1, None),
        # Around the first of four starts.
        (2e6, 4, lambda modulus: modulus > 1.95e6 and modulus != 2e6),
    ],
    ids=["gap", "far", "one of four starts"],
)
def test_search_goes_on_from_far_and_where_the_model_fails(
    start: float, starts: int, fails: Callable[[float], bool] | None, fail_where: FailWhere
) -> None:
    target = thud.solve(TRUTH)
    if fails:
        fail_where(fails)
    fit = thud.fit(target, {"youngs_modulus": start}, starts=starts, case=SHELL)
    if fails and starts == 1:
        assert fit.failures
    assert fit.values["youngs_modulus"] == pytest.approx(1.8e6, rel=SOLVED)


def test_model_that_fails_around_the_best_place(fail_where: FailWhere) -> None:
    fail_where(lambda modulus: modulus != 2e6)
    with pytest.raises(
        thud.NumericalError, match=naming("youngs_modulus", "2e+06", "out of the model")
    ):
        thud.fit(thud.solve(TRUTH), {"youngs_modulus": 2e6}, case=SHELL)


@pytest.mark.slow
def test_best_of_several_starts_counts() -> None:
    case = thud.Case(model=COARSE)
    names = {"youngs_modulus": thud.Parameter(5e6, 1e6, 6e6), "loss_factor": None}
    once, often = (
        quiet_fit(thud.solve(case), names, case, max_steps=2, starts=starts, seed=4)
        for starts in (1, 4)
    )
    assert often.noise < once.noise
    assert often.evaluations > once.evaluations
    assert not once.converged
    assert "converged" in str(once)


def test_large_ball_is_valid_in_fits() -> None:
    # The wall is thicker than the default ball.
    ball = thud.Ball(outer_radius=0.2, wall_thickness=0.1, mass=20.0)
    target = thud.solve(ball, model="hollow_sphere")
    fit = thud.fit(target, {"wall_thickness": 0.11}, replace(SHELL, ball=ball))
    assert fit.values["wall_thickness"] == pytest.approx(0.1, rel=SOLVED)
    starts = {"wall_thickness": 0.11, "outer_radius": 0.2}
    quiet_fit(target, starts, replace(SHELL, ball=thud.Ball(mass=20.0)))


def test_contact_times_that_jump_hide_no_parameter() -> None:
    # The end of the contact moves from ring to ring: here between two close moduli, by 1.5e-5 s.
    model = thud.ModalBall(damping_law="rising", loss_factor=0.1889)
    case = thud.Case(ball=thud.Ball(youngs_modulus=1.71513e6), model=model)
    impact = thud.solve(case)
    known = {"contact_time": (impact.exact_contact_time, 1e-4)}
    target = thud.LevelTarget(impact.levels(force="floor"), 0.3, quantities=known)
    found = quiet_fit(target, ["youngs_modulus"], case)
    # Of levels alone the error is larger.
    alone = quiet_fit(replace(target, quantities={}), ["youngs_modulus"], case)
    assert not found.warnings
    assert found.standard_errors["youngs_modulus"] < alone.standard_errors["youngs_modulus"]
    expected = 2 * 1e-4 / impact.exact_contact_time * 1.71513e6
    assert found.standard_errors["youngs_modulus"] < 1.3 * expected


@pytest.mark.parametrize(("cut", "whole"), [(0.0, True), (1e-4, True), (2e-4, False)])
def test_record_whose_last_millisecond_is_below_a_tenth_is_whole(
    cut: float, *, whole: bool
) -> None:
    """A half sine of 20 ms that is cut s before its end: sin(pi (s + 0.5 ms)/20 ms)."""
    time = np.arange(0, 0.04 - cut, 1e-5)
    force = np.where(time > 0.02, 1500 * np.sin(np.pi * (time - 0.02) / 0.02), 0)
    last = np.sin(np.pi * (cut + 0.5e-3) / 0.02)
    assert (last < 0.1) == whole
    target = thud.ForceTarget((time, force), noise=1.0)
    if whole:
        assert target.compare().record.time[-1] == pytest.approx(time[-1])
    else:
        with pytest.raises(thud.InputError, match=naming("force", f"{last:.0%}")):
            target.compare()
