"""Levels, average, outliers, force plate, uncertainty and verdict of recorded drops."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, norm, t as student
from synthetic import LEVELS, make_drop, parts, with_force

import thud
from thud.level.assessment import assess_levels
from thud.level.estimate import Contribution, Estimate
from thud.recordings import recorded_levels as module
from thud.recordings.checks import outliers
from thud.recordings.checks.outliers import find_outliers
from thud.recordings.config import Config
from thud.recordings.instruments import Plate, instrument_uncertainties
from thud.recordings.recorded_levels import DropLevels, average_levels, measure_levels

NOMINAL = [39.0, 31.0, 23.0, 17.0, 12.5]
NAMES = [f"drop {i + 1}" for i in range(20)]


@pytest.mark.parametrize("rate", [8000, 25600, 51200, 96000])
def test_half_sine_by_all_methods(rate: int) -> None:
    drop = make_drop(rate=rate)
    found = module.compare_methods([drop])
    np.testing.assert_array_equal(found["exact"], measure_levels([drop]).level)
    # Aliases of a spectrum that falls by 12 dB per octave: 2 (f/(rate - f))**2 in amplitude.
    alias = (thud.get_bands().upper / (rate - thud.get_bands().upper)) ** 2
    assert (np.abs(found["exact"][0] - LEVELS) <= 20 * np.log10(1 + 2 * alias) + 1e-3).all()
    by_fft = thud.force_exposure_levels(drop.contact.gated, rate, method="fft")
    np.testing.assert_array_equal(found["fft"][0], by_fft)
    # The skirts of the filters take energy from lower bands: as much as the integral of
    # abs(H F)**2 says, see test_filter_bank.py, and at most 0.7 dB in any octave.
    skirts = [0.074, 0.629, 0.005, 0.384, 0.654]
    np.testing.assert_allclose(found["filter"] - found["exact"], [skirts], rtol=0, atol=0.003)


@pytest.mark.parametrize(
    ("deviation", "rate", "before"), [(5.0, 51200.0, 0.1), (40.0, 8000.0, 0.02), (150.0, 8000.0, 1)]
)
def test_uncertainty_of_noise_is_the_scatter(deviation: float, rate: float, before: float) -> None:
    """Errors of many realisations against their own standard uncertainties."""
    count, how = 200, {"before": before, "after": 0.03}
    found = measure_levels([make_drop(deviation, rate, seed=k, **how) for k in range(count)])
    error = found.level - measure_levels([make_drop(rate=rate)]).level
    uncertainty = found.uncertainty
    # Where the level is well above the background, dB are proportional to energies.
    clear = (found.measured - found.background).min(axis=0) > 9
    assert clear[:2].all()
    ratio = np.sqrt(np.mean(error**2, axis=0) / np.mean(uncertainty**2, axis=0))[clear]
    assert (ratio < 1.15).all()
    assert (ratio > 0.85).all()
    lowest, highest = binom.ppf([1e-4, 1 - 1e-4], count, 0.95)
    covered = np.sum(np.abs(error) < 1.96 * uncertainty, axis=0)[clear]
    assert (covered >= lowest).all()
    assert (covered <= highest).all()


def test_background_is_flagged_and_corrected_as_the_standards_say() -> None:
    rate = 25600.0
    clean = measure_levels([make_drop(rate=rate)])
    assert (clean.background < -200).all()
    assert clean.uncertainty.max() < 1e-9
    assert (clean.flag == "").all()
    width = (thud.get_bands().upper - thud.get_bands().lower)[3]
    length = float(np.diff(make_drop(rate=rate).gate)[0]) / rate
    for above, flag in ((20.0, ""), (14.9, "corrected"), (6.1, "corrected"), (5.9, "background")):
        # White noise in the file itself is not needed: the level is taken against its density.
        density = 10 ** ((clean.level[0, 3] - above) / 10) / width / length
        found = measure_levels([make_drop(rate=rate, density=density)])
        assert found.level[0, 3] - found.background[0, 3] <= above + 0.01
        assert found.flag[0, 3] == flag
        correction = -10 * math.log10(1 - 10 ** (-max(above, 6.0) / 10))
        # Above 15 dB too: the expected energy of the noise is in what is measured.
        assert found.measured[0, 3] - found.level[0, 3] == pytest.approx(correction, abs=0.003)


def grubbs(count: int, significance: float) -> float:
    """Return the largest score of normal values that chance explains (Grubbs 1969), two-sided."""
    t = student.isf(significance / (2 * count), count - 2)
    return (count - 1) / math.sqrt(count) * math.sqrt(t**2 / (count - 2 + t**2))


def test_grubbs_critical_values_are_the_published_ones() -> None:
    # Grubbs 1969, two-sided 5 %.
    for count, critical in ((5, 1.7150), (10, 2.2900), (20, 2.7082)):
        values = np.append(100.0, np.linspace(-1e-3, 1e-3, count - 1))
        (found,) = find_outliers(values, NAMES, "level")
        assert (found.subject, found.value) == ("drop 1", 100.0)
        assert found.others["critical"] == pytest.approx(critical, abs=1e-3)
        assert grubbs(count, 0.05) == pytest.approx(critical, abs=1e-3)
        assert found.others["score"] == pytest.approx((100 - values.mean()) / values.std(ddof=1))


def test_outliers_begin_at_the_critical_value_and_beyond_their_own_uncertainty() -> None:
    others = np.linspace(-1, 1, 8)

    def marked(last: float, **options: Any) -> bool:  # noqa: ANN401
        return bool(find_outliers([*others, last], NAMES, "level", **options))

    # The score of a last value x beside eight of mean zero and of sum of squares s.
    square, limit = np.sum(others**2), grubbs(9, 0.05)
    edge = np.sqrt(square * limit**2 / 8 / (64 / 81 - limit**2 / 9))
    assert (marked(edge - 1e-6), marked(edge + 1e-6)) == (False, True)
    # The expanded uncertainty of the value itself explains as much.
    for factor, expected in ((1 - 1e-6, True), (1 + 1e-6, False)):
        own = [0.0] * 8 + [factor * 10 * 8 / 9 / norm.ppf(0.975)]
        assert marked(10.0, uncertainty=own) == expected
    # Of ten values two are looked for, of nine one.
    two = [*others, 30.0, 30.0]
    assert len(find_outliers(two, NAMES, "level")) == 2
    assert not find_outliers(two[1:], NAMES, "level")


@pytest.mark.parametrize("bands", ["octave", "third"])
def test_outliers_of_many_bands_share_the_probability(bands: Any) -> None:  # noqa: ANN401
    """Bonferroni: any band of drops that differ by chance is marked with 5 % together."""
    made = [make_drop(0.01, seed=i) for i in range(6)]
    scales = [1.0, 1.01, 0.99, 1.005, 0.995, 1.3]
    drops = [with_force(one, k * one.force) for one, k in zip(made, scales, strict=True)]
    marked = outliers.check(drops, measure_levels(drops, bands))
    count = len(thud.get_bands(bands).nominal)
    critical = [found.others["critical"] for found in marked]
    assert critical == pytest.approx([grubbs(6, 0.05 / count)] * count)


def test_drops_that_differ_share_the_probability_among_three_quantities() -> None:
    drops = [
        replace(
            make_drop(), name=f"drop {i}", contact_time=Estimate(0.02 + 1e-5 * (i % 3), 0.0),
            restitution=Estimate(0.8 + 1e-3 * (i % 2), 0.0), peak_force=Estimate(1500.0 + i, 0.0),
        )
        for i in range(6)
    ]  # fmt: skip
    assert outliers.check(drops, measure_levels(drops)) == ()
    for change, value, unit in (
        ("contact_time", 0.03, 1e-3), ("restitution", 0.5, 1.0), ("peak_force", 3000.0, 1.0),
    ):  # fmt: skip
        # A drop that is uncertain enough does not differ.
        odd, doubtful = (
            [*drops, replace(drops[0], name="odd", **{change: Estimate(value, uncertainty)})]
            for uncertainty in (0.0, value)
        )
        (found,) = outliers.check(odd, measure_levels(odd))
        assert (found.subject, found.value) == ("odd", pytest.approx(value / unit))
        assert found.others["critical"] == pytest.approx(grubbs(7, 0.05 / 3))
        assert outliers.check(doubtful, measure_levels(doubtful)) == ()


def test_two_outliers_do_not_hide_each_other_and_noise_marks_none() -> None:
    values = [*np.random.default_rng(1).normal(size=13), 30.0, 31.0]
    assert [note.subject for note in find_outliers(values, NAMES, "level")] == NAMES[14:12:-1]
    assert find_outliers(values, NAMES, "level", uncertainty=[20.0] * 15) == ()
    assert find_outliers([1.0, np.nan, 2.0], NAMES, "level") == ()
    assert find_outliers([np.nan] * 3, NAMES, "level") == ()


def test_budget_after_the_gum() -> None:
    """JCGM 100, H.1: end gauge; combined 32 nm, 16 degrees of freedom, 93 nm at 99 %."""
    sizes = [(25.0, 18), (5.8, 24), (3.9, 5), (6.7, 8), (2.9, 50), (16.6, 2)]
    # Only the kinds of the lines count here: 16.753, which the GUM truncates to 16.
    lines = (Contribution(str(i), u, v) for i, (u, v) in enumerate(sizes))
    gauge = Estimate.from_budget(838.0, *lines)
    assert gauge.uncertainty == pytest.approx(31.666, abs=1e-3)
    assert gauge.freedom == pytest.approx(16.753, abs=1e-3)
    exact = Estimate(1.0)
    assert (exact.uncertainty, exact.freedom, exact.expanded) == (0.0, math.inf, 0.0)
    # Of five drops alone: t = 2.776.
    drops = Estimate.of_drops(3.0, (1.0, 2.0, 3.0, 4.0, 5.0), [0.1] * 5)
    assert drops.uncertainty == pytest.approx(math.sqrt(2.5 / 5))
    assert drops.coverage_factor == pytest.approx(2.7764, abs=1e-4)
    # A single one has its own noise only; two have t = 12.7.
    assert Estimate.of_drops(1.0, [1.0], [0.1]).expanded == pytest.approx(0.196, abs=1e-3)
    pair = Estimate.of_drops(1.1, [1.0, 1.2], [0.1, 0.1])
    assert pair.coverage_factor == pytest.approx(12.706, abs=1e-3)
    calibration = Contribution("calibration", 0.3)
    shared = Estimate.from_budget(pair.value, *pair.contributions, calibration)
    assert shared.uncertainty == pytest.approx(math.hypot(0.1, 0.3))
    assert shared.freedom == pytest.approx((0.1**2 + 0.3**2) ** 2 / 0.1**4)


def test_average_of_levels_is_that_of_energies_with_its_budget() -> None:
    levels, backgrounds = np.array([39.0, 39.4, 38.7]), np.array([20.0, 26.0, 10.0])
    noise, method = np.array([0.1, 0.2, 0.3]), np.array([0.05, 0.02, 0.01])

    def of(count: int) -> DropLevels:
        """Return the levels of the first drops, the same in all bands."""
        level, background, *own = (
            np.repeat(values[:count, None], 5, axis=1)
            for values in (levels, backgrounds, noise, method)
        )
        corrected = 10 * np.log10(10 ** (level / 10) - 10 ** (background / 10))
        return DropLevels(
            ("drop",) * count, "octave", corrected, level, background,
            np.full(level.shape, ""), dict(zip(("noise", "method"), own, strict=True)),
        )  # fmt: skip

    found = average_levels(of(3), {"calibration": np.full(5, 0.17)}, ())
    energies, below = 10 ** (levels / 10), 10 ** (backgrounds / 10)
    energy = (energies - below).mean()
    np.testing.assert_allclose(found.level, 10 * np.log10(energy))
    np.testing.assert_allclose(found.background, 10 * np.log10(below.mean()))
    np.testing.assert_allclose(found.spread, found.drops.level.std(axis=0, ddof=1))
    weights = (energies - below) / energy / 3
    expected = {
        "repeatability": 10 / math.log(10) * energies.std(ddof=1) / math.sqrt(3) / energy,
        "noise": np.hypot.reduce(weights * noise),
        # What is wrong with the method is wrong alike.
        "method": weights @ method,
        "calibration": 0.17,
    }
    for level in found.estimates:
        assert parts(level.contributions) == pytest.approx(expected)
        counted = [part.name for part in level.contributions if part.counted]
        assert sorted(counted) == ["calibration", "method", "repeatability"]
        assert level.uncertainty == pytest.approx(math.hypot(*(expected[n] for n in counted)))
        free = {part.name: part.freedom for part in level.contributions}
        assert free == dict.fromkeys(free, math.inf) | {"repeatability": 2}
    alone = average_levels(of(1), {}, ())
    assert np.isnan(alone.spread).all()
    for level in alone.estimates:
        assert level.uncertainty == pytest.approx(math.hypot(noise[0], method[0]))
        assert all(part.counted and part.freedom == math.inf for part in level.contributions)


def test_average_and_estimates_have_one_budget_with_calibration_and_plate() -> None:
    drops = tuple(make_drop(1.0, seed=i) for i in range(3))
    config = Config(plate=Plate(f0=1600.0, Q=20.0, f0_uncertainty=0.01))
    recording = thud.Recording("three", drops, (), config, calibration_uncertainty=0.01)
    shared = instrument_uncertainties(drops, config, 0.01)
    assert {"plate", "calibration"} <= set(shared)
    average, alone = recording.average(), average_levels(measure_levels(drops), {}, ())
    assert recording.level_estimates() == average.estimates
    estimates = alone.estimates, average.estimates
    for own, level, *known in zip(*estimates, *shared.values(), strict=True):
        (calibration,) = (part for part in level.contributions if part.name == "calibration")
        assert calibration.size == pytest.approx(0.01)
        assert calibration.sensitivity == pytest.approx(8.686, abs=1e-3)
        assert level.uncertainty == pytest.approx(math.hypot(own.uncertainty, *known))
        assert level.freedom > 2


OTHERS = {"contact_time": 0.02, "restitution": 0.8, "peaks": 1, "mass": 2.5, "drop_height": 1.0}


@pytest.mark.parametrize(
    ("value", "uncertainty", "others", "expected"),
    [
        # Limits 38 to 40 dB; 1.96 times 0.1 dB.
        (37.80, 0.1, {}, "does not conform"), (37.81, 0.1, {}, "undecided"),
        (38.19, 0.1, {}, "undecided"), (38.20, 0.1, {}, "conforms"),
        (39.80, 0.1, {}, "conforms"), (39.81, 0.1, {}, "undecided"),
        (40.19, 0.1, {}, "undecided"), (40.20, 0.1, {}, "does not conform"),
        # An exact value on the limit conforms; one that is uncertain by more than the range never.
        (38.0, 0.0, {}, "conforms"), (39.0, 1.0, {}, "undecided"),
        (39.0, math.nan, {}, "undecided"), (math.nan, 0.1, {}, "undecided"),
        (39.0, 0.0, {"mass": math.nan}, "undecided"),
        (39.0, 0.0, {"mass": math.nan, "restitution": 0.95}, "does not conform"),
    ],
)  # fmt: skip
def test_verdict_has_a_guard_band_on_both_sides(
    value: float, uncertainty: float, others: dict[str, float], expected: str
) -> None:
    levels = [Estimate(value, uncertainty), *NOMINAL[1:]]
    assert assess_levels(levels, **OTHERS | others).conforms == expected


@pytest.mark.parametrize(
    ("value", "expected"), [(39.0, "undecided"), (45.0, "undecided"), (37.0, "does not conform")]
)
def test_upper_bound_can_only_fail(value: float, expected: str) -> None:
    bound = Estimate(value, 0.1, upper_bound=True)
    verdict = assess_levels([bound, *NOMINAL[1:]], **OTHERS)
    assert verdict.conforms == expected
    assert math.isnan(verdict.criteria[0].probability)


@pytest.mark.parametrize(
    ("level", "expected"),
    [
        (Estimate(40.0, 0.1), 0.5),
        (Estimate(39.0, 1.0), 0.6827),
        # Of four drops, Student's t.
        (Estimate(39.5, 0.4, freedom=3), student.cdf(0.5 / 0.4, 3) - student.cdf(-1.5 / 0.4, 3)),
    ],
)
def test_probability_of_conformity_counts_both_limits(level: Estimate, expected: float) -> None:
    (criterion, *_) = assess_levels([level, *NOMINAL[1:]]).criteria
    assert criterion.probability == pytest.approx(expected, abs=1e-4)
    assert criterion.margin == min(level.value - 38, 40 - level.value)


def test_every_stage_draws_itself() -> None:
    stages = thud.read_recording("inputs/recordings/drop_1.csv").stages
    assert stages is not None
    levels = measure_levels([stages.drop])
    drawn = (stages, stages.section, stages.repaired, stages.drop.contact, stages.drop, levels)
    assert [len(stage.plot().axes) for stage in drawn] == [4, 1, 1, 1, 2, 1]
