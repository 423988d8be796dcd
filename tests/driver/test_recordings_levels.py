"""Levels, average, outliers, force plate, uncertainty and verdict of recorded drops."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import naming
from scipy.optimize import brentq
from scipy.stats import binom, norm, t as student
from synthetic import make_drop, with_force

import thud
from thud.level.assessment import assess_levels
from thud.level.estimate import Contribution, Estimate
from thud.recordings.checks import outliers
from thud.recordings.checks.outliers import find_outliers
from thud.recordings.checks.plate import check_plate
from thud.recordings.config import Config
from thud.recordings.contact import band_noise
from thud.recordings.instruments import Chain, Plate, correct_force, instrument_uncertainties
from thud.recordings.recorded_levels import (
    AverageLevels,
    DropLevels,
    average_levels,
    compare_methods,
    measure_levels,
)

if TYPE_CHECKING:
    from thud.base.note import Note
    from thud.recordings.measured_drop import Drop

# Half-sine of 1500 N and 20 ms: closed form of the band energies, dB.
HALF_SINE = [38.3125, 30.6046, 19.2578, 8.9323, -0.4390]
NOMINAL = [39.0, 31.0, 23.0, 17.0, 12.5]
NAMES = [f"drop {i + 1}" for i in range(20)]


def closed_form(rate: float) -> np.ndarray:
    """Return the levels of the sampled half-sine: a sum of two geometric series, squared."""
    count = round(0.02 * rate)
    assert count == pytest.approx(0.02 * rate, abs=1e-9)
    edges = thud.get_bands()
    nodes, weights = np.polynomial.legendre.leggauss(200)
    levels = []
    for lower, upper in zip(edges.lower, edges.upper, strict=True):
        frequency = (lower + upper) / 2 + (upper - lower) / 2 * nodes
        angle, turn = 2 * np.pi * frequency / rate, np.pi / count
        # Sum of sin(turn n) exp(-i angle n) over n = 0 ... count.
        series = [
            (1 - np.exp(1j * (s * turn - angle) * count)) / (1 - np.exp(1j * (s * turn - angle)))
            for s in (1, -1)
        ]
        spectrum = 1500 / rate * (series[0] - series[1]) / 2j
        energy = (upper - lower) * np.sum(weights * np.abs(spectrum) ** 2)
        levels.append(10 * np.log10(energy))
    return np.array(levels)


@pytest.mark.parametrize("rate", [2500, 8000, 25600, 51200, 96000])
def test_half_sine_by_all_methods(rate: int) -> None:
    sampled = closed_form(rate)
    # Aliases of a spectrum that falls by 12 dB per octave: 2 (f/(rate - f))**2 in amplitude.
    alias = (thud.get_bands().upper / (rate - thud.get_bands().upper)) ** 2
    assert (np.abs(sampled - HALF_SINE) <= 20 * np.log10(1 + 2 * alias) + 6e-5).all()
    drop = make_drop(rate=rate)
    exact = measure_levels([drop]).level
    np.testing.assert_allclose(exact[0], sampled, rtol=0, atol=1e-3)
    found = compare_methods([drop])
    np.testing.assert_array_equal(found["exact"], exact)
    # Bins of 1 Hz miss up to half a bin at both edges: |F|**2 there, over the band's energy.
    edges = thud.get_bands()
    for band, (lower, upper) in enumerate(zip(edges.lower, edges.upper, strict=True)):
        pulse = np.array([lower, upper])
        density = 2 * (2 * 1500 * 0.02 / np.pi * np.cos(np.pi * 0.02 * pulse)) ** 2
        density /= (1 - (2 * 0.02 * pulse) ** 2) ** 2
        missed = 0.5 * density.sum() / 10 ** (sampled[band] / 10)
        assert abs(found["fft"][0, band] - sampled[band]) < -10 * np.log10(1 - missed) + 0.02
    # The skirts of the filters take energy from lower bands: as much as the integral of
    # abs(H F)**2 says, see below, and at most 0.7 dB in any octave.
    if rate >= 8000:
        np.testing.assert_allclose(
            found["filter"][0] - sampled, [0.074, 0.629, 0.005, 0.384, 0.654], rtol=0, atol=0.003
        )


def test_uncertain_density_adds_to_the_energy_of_a_band() -> None:
    drop, bands = make_drop(5.0), thud.get_bands()
    background = drop.contact.background
    # White noise that is known to an eighth.
    uncertain = replace(background, log_covariance=np.diag([1 / 64, 0, 0, 0, 0]))
    contact = replace(drop.contact, background=uncertain)
    exact, doubtful = band_noise([drop, replace(drop, contact=contact)], bands)
    np.testing.assert_allclose(doubtful[:, 0], exact[:, 0])
    np.testing.assert_allclose(doubtful[:, 1], np.hypot(exact[:, 1], exact[:, 0] / 8))


@pytest.mark.parametrize(
    ("deviation", "rate", "before"), [(5.0, 51200.0, 0.1), (40.0, 8000.0, 0.02), (150.0, 8000.0, 1)]
)
def test_uncertainty_from_noise_is_the_scatter(
    deviation: float, rate: float, before: float
) -> None:
    """Errors of many realisations against their own standard uncertainties."""
    count = 200
    true = measure_levels([make_drop(rate=rate)]).level
    found = measure_levels(
        [make_drop(deviation, rate, before=before, after=0.03, seed=seed) for seed in range(count)]
    )
    error, uncertainty = found.level - true, found.uncertainty
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


def test_recordings_have_levels_by_one_method() -> None:
    recording = thud.Recording("one", (make_drop(),), ())
    np.testing.assert_array_equal(recording.levels(method="exact"), recording.levels())
    with pytest.raises(thud.InputError, match=naming("method", "'fft'", "'exact'")):
        recording.levels(method="fft")


def contribution(average: AverageLevels, name: str) -> np.ndarray:
    """Return a contribution to the uncertainty of an average, dB, shape (n_band,)."""
    return np.array([
        sum(part.uncertainty for part in level.contributions if part.name == name)
        for level in average.estimates
    ])  # fmt: skip


def uncertainty(average: AverageLevels) -> np.ndarray:
    """Return the combined standard uncertainty of an average, dB, shape (n_band,)."""
    return np.array([level.uncertainty for level in average.estimates])


def grubbs(count: int, significance: float) -> float:
    """Return the largest score of normal values that chance explains (Grubbs 1969), two-sided."""
    t = student.isf(significance / (2 * count), count - 2)
    return (count - 1) / math.sqrt(count) * math.sqrt(t**2 / (count - 2 + t**2))


def test_grubbs_critical_values_are_the_published_ones() -> None:
    # Grubbs 1969, two-sided 5 %.
    for count, critical in ((5, 1.7150), (10, 2.2900), (20, 2.7082)):
        values = np.zeros(count)
        values[0], values[1:] = 100.0, np.linspace(-1e-3, 1e-3, count - 1)
        (found,) = find_outliers(values, NAMES, "level")
        assert found.others["critical"] == pytest.approx(critical, abs=1e-3)
        assert found.others["critical"] == pytest.approx(grubbs(count, 0.05))
        assert found.others["score"] == pytest.approx((100 - values.mean()) / values.std(ddof=1))
        assert (found.subject, found.value) == ("drop 1", 100.0)


def test_outliers_begin_at_the_critical_value_and_beyond_their_own_uncertainty() -> None:
    others = np.linspace(-1, 1, 8)

    def marked(last: float, **options: Any) -> bool:  # noqa: ANN401
        return bool(find_outliers([*others, last], NAMES, "level", **options))

    def score(last: float) -> float:
        values = np.append(others, last)
        return float((last - values.mean()) / values.std(ddof=1))

    edge = brentq(lambda last: score(last) - grubbs(9, 0.05), 1, 10)
    assert (marked(edge - 1e-6), marked(edge + 1e-6)) == (False, True)
    # The expanded uncertainty of the value itself explains as much.
    distance = 10 - np.append(others, 10.0).mean()
    for factor, expected in ((1 - 1e-6, True), (1 + 1e-6, False)):
        own = [0.0] * 8 + [factor * distance / norm.ppf(0.975)]
        assert marked(10.0, uncertainty=own) == expected
    # Of ten values two are looked for, of nine one.
    two = [*np.linspace(-1, 1, 8), 30.0, 30.0]
    assert len(find_outliers(two, NAMES, "level")) == 2
    assert not find_outliers(two[1:], NAMES, "level")


@pytest.mark.parametrize("bands", ["octave", "third"])
def test_outliers_of_many_bands_share_the_probability(bands: Any) -> None:  # noqa: ANN401
    """Bonferroni: any band of drops that differ by chance is marked with 5 % together."""
    drops = [with_force(drop, scale * drop.force) for drop, scale in zip(
        [make_drop(0.01, seed=i) for i in range(6)], [1.0, 1.01, 0.99, 1.005, 0.995, 1.3],
        strict=True)]  # fmt: skip
    count = len(thud.get_bands(bands).nominal)
    marked = outliers.check(drops, measure_levels(drops, bands))
    assert len(marked) == count
    for found in marked:
        assert found.others["critical"] == pytest.approx(grubbs(6, 0.05 / count))


def test_drops_that_differ_share_the_probability_among_three_quantities() -> None:
    drops = [
        replace(
            make_drop(), name=f"drop {i}", contact_time=Estimate(0.02 + 1e-5 * (i % 3), 0.0),
            restitution=Estimate(0.8 + 1e-3 * (i % 2), 0.0), peak_force=Estimate(1500.0 + i, 0.0),
        )
        for i in range(6)
    ]  # fmt: skip

    def marked(drops: list[Drop]) -> tuple[Note, ...]:
        return outliers.check(drops, measure_levels(drops))

    assert marked(drops) == ()
    for change, value, unit in (
        ("contact_time", 0.03, 1e-3), ("restitution", 0.5, 1.0), ("peak_force", 3000.0, 1.0),
    ):  # fmt: skip
        (found,) = marked([*drops, replace(drops[0], name="odd", **{change: Estimate(value, 0)})])
        assert (found.subject, found.value) == ("odd", pytest.approx(value / unit))
        assert found.others["critical"] == pytest.approx(grubbs(7, 0.05 / 3))
        # A drop that is uncertain enough does not differ.
        doubtful = replace(drops[0], name="odd", **{change: Estimate(value, value)})
        assert marked([*drops, doubtful]) == ()


def test_two_outliers_do_not_hide_each_other_and_noise_marks_none() -> None:
    values = [*np.random.default_rng(1).normal(size=13), 30.0, 31.0]
    assert [note.subject for note in find_outliers(values, NAMES, "level")] == [
        "drop 15",
        "drop 14",
    ]
    assert find_outliers(values, NAMES, "level", uncertainty=[20.0] * 15) == ()
    assert find_outliers([1.0, np.nan, 2.0], NAMES, "level") == ()
    assert find_outliers([np.nan] * 3, NAMES, "level") == ()


def test_response_of_a_plate_is_that_of_a_mass_on_a_spring() -> None:
    """k/(k - m w2 + i w c)."""
    plate = Plate(1600.0, 30.0)
    stiffness = 10 * (2 * np.pi * 1600) ** 2
    damping = 10 * 2 * np.pi * 1600 / 30
    omega = 2 * np.pi * np.array([10.0, 900.0, 1352.0, 4000.0])
    expected = stiffness / (stiffness - 10 * omega**2 + 1j * omega * damping)
    np.testing.assert_allclose(plate.response(omega / 2 / np.pi), expected)
    # Kept up to twice the resonance, nothing from four times on, cos2 of the octave between.
    f = plate.f0 * np.array([0.1, 1.99, 2 * 2 ** (1 / 3), 2 * np.sqrt(2), 4, 9])
    passed = np.abs(Chain((plate,)).correction(f) * plate.response(f))
    np.testing.assert_allclose(passed, [1, 1, 0.75, 0.5, 0, 0], atol=1e-12)


def test_constant_force_passes_the_correction() -> None:
    for length in (100, 4097):
        corrected = correct_force(np.full(length, 7.0), 25600.0, Chain((Plate(1600, 30),)))
        np.testing.assert_allclose(corrected, 7.0, rtol=1e-12)


def test_end_of_a_record_does_not_reach_its_begin_in_the_correction() -> None:
    rate, plate = 24e3, Plate(1500, 20)
    rising = np.linspace(0, 100, 4800)
    found = correct_force(rising, rate, Chain((plate,)))
    # F = F_m + F_m'/(w0 Q) between the ends, which are as if they were held.
    slope = (rising[1] - rising[0]) * rate
    expected = rising + slope / (2 * np.pi * 1500 * 20)
    np.testing.assert_allclose(found[1000:-1000], expected[1000:-1000], atol=1e-3)
    held = correct_force(np.pad(rising, 24_000, mode="edge"), rate, Chain((plate,)))[24_000:-24_000]
    np.testing.assert_allclose(found, held, atol=1e-3)


def test_resonance_near_the_bands_is_refused() -> None:
    with pytest.raises(thud.InputError, match=naming("plate", "900 Hz", "1001.2 Hz")):
        correct_force(np.ones(100), 25600.0, Chain((Plate(900, 30),)))


def met(plate: Plate) -> list[bool | None]:
    """Return whether the requirements on a plate are met."""
    return [entry for entry, _ in check_plate(plate).values()]


def test_plate_is_compared_with_the_standard() -> None:
    assert met(Plate()) == [None] * 4
    paper = Plate(1600, 30, full_scale=4000.0, time_constant=1.0)
    assert met(paper) == [False, None, False, None]
    note = check_plate(paper)["range"][1]
    assert (note.code, note.value) == ("plate_range", 4000.0)
    # A time constant of 3.92 s is just enough: 2 %.
    assert met(Plate(full_scale=5000.0, time_constant=3.92)) == [True, None, True, None]
    assert met(Plate(time_constant=3.9))[0] is False
    # Of a resonance that is less by 1.96 uncertainties, (1 - r2)/(1 - r2/(1 - s)2) is 1.02.
    square = (1000 / 1600) ** 2
    shift = 1 - np.sqrt(square / (1 - (1 - square) / 1.02))
    for factor, expected in ((0.999, True), (1.001, False)):
        assert met(Plate(1600, 1e6, f0_uncertainty=factor * shift / 1.96))[1] == expected
    forces = [500.0, 1000.0, 2000.0, 5000.0]
    for indicated, expected in (
        ([1.3 * f * (1 + 0.001 * i) for i, f in enumerate(forces)], True),
        ([f * (1 + f / 5e4) for f in forces], False),
        (forces[:3], None),
    ):
        pairs = tuple(zip(forces, indicated, strict=False))
        assert met(Plate(linearity=pairs))[3] == expected
    with pytest.raises(thud.InputError, match=naming("plate", "linearity", "pairs")):
        Plate(linearity=((0.0, 1.0),))


def test_budget_after_the_gum() -> None:
    """JCGM 100, H.1: end gauge; combined 32 nm, 16 degrees of freedom, 93 nm at 99 %."""
    parts = [(25.0, 18), (5.8, 24), (3.9, 5), (6.7, 8), (2.9, 50), (16.6, 2)]
    # Only the kinds of the lines count here: 31.7 nm and 16.7, which the GUM truncates to 16.
    lines = (Contribution(str(i), u, v) for i, (u, v) in enumerate(parts))
    gauge = Estimate.from_budget(838.0, *lines)
    expected = math.sqrt(sum(u**2 for u, _ in parts))
    assert gauge.uncertainty == pytest.approx(expected)
    assert gauge.freedom == pytest.approx(expected**4 / sum(u**4 / v for u, v in parts))
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
        level, background, parts = (
            np.repeat(values[:count, None], 5, axis=1)
            for values in (levels, backgrounds, np.stack([noise, method], axis=1))
        )
        corrected = 10 * np.log10(10 ** (level / 10) - 10 ** (background / 10))
        return DropLevels(
            ("drop",) * count, "octave", corrected, level, background,
            np.full(level.shape, ""), {"noise": parts[:, :, 0], "method": parts[:, :, 1]},
        )  # fmt: skip

    found = average_levels(of(3), {"calibration": np.full(5, 0.17)}, ())
    energies = 10 ** (levels / 10)
    below = np.mean(10 ** (backgrounds / 10))
    energy = energies.mean() - below
    np.testing.assert_allclose(found.level, 10 * np.log10(energy))
    np.testing.assert_allclose(found.background, 10 * np.log10(below))
    np.testing.assert_allclose(found.spread, found.drops.level.std(axis=0, ddof=1))
    decibel = 10 / math.log(10)
    repeated = decibel * energies.std(ddof=1) / math.sqrt(3) / energy
    np.testing.assert_allclose(contribution(found, "repeatability"), repeated)
    weights = (energies - 10 ** (backgrounds / 10)) / energy / 3
    np.testing.assert_allclose(
        contribution(found, "noise"), np.sqrt(((weights * noise) ** 2).sum()), rtol=1e-12
    )
    # What is wrong with the method is wrong alike.
    np.testing.assert_allclose(contribution(found, "method"), weights @ method)
    combined = math.hypot(repeated, weights @ method, 0.17)
    np.testing.assert_allclose(uncertainty(found), combined)
    (one, *_) = found.estimates
    freedom = {part.name: (part.freedom, part.counted) for part in one.contributions}
    assert freedom == {
        "repeatability": (2, True), "noise": (math.inf, False), "method": (math.inf, True),
        "calibration": (math.inf, True),
    }  # fmt: skip
    alone = average_levels(of(1), {}, ())
    assert np.isnan(alone.spread).all()
    np.testing.assert_allclose(uncertainty(alone), math.hypot(noise[0], method[0]))
    (one, *_) = alone.estimates
    assert all(part.counted and part.freedom == math.inf for part in one.contributions)


def test_average_and_estimates_have_one_budget_with_calibration_and_plate() -> None:
    drops = tuple(make_drop(1.0, seed=i) for i in range(3))
    config = Config(plate=Plate(f0=1600.0, Q=20.0, f0_uncertainty=0.01))
    recording = thud.Recording("three", drops, (), config, calibration_uncertainty=0.01)
    average = recording.average()
    assert recording.level_estimates() == average.estimates
    alone = average_levels(measure_levels(drops), {}, ())
    shared = instrument_uncertainties(drops, config, 0.01)
    for band, level in enumerate(average.estimates):
        parts = {part.name: part for part in level.contributions}
        calibration = parts["calibration"]
        assert calibration.size == pytest.approx(0.01)
        assert calibration.sensitivity == pytest.approx(8.686, abs=1e-3)
        assert {"plate", "calibration"} <= set(shared)
        own = alone.estimates[band].uncertainty
        expected = math.hypot(own, *(values[band] for values in shared.values()))
        assert level.uncertainty == pytest.approx(expected)
        assert level.freedom > 2


def test_plate_of_unstated_uncertainty_is_no_line_of_zero() -> None:
    drops = [make_drop(1.0)]
    for uncertainty, stated in ((0.0, False), (0.01, True)):
        config = Config(plate=Plate(f0=1600.0, Q=20.0, f0_uncertainty=uncertainty))
        assert ("plate" in instrument_uncertainties(drops, config, None)) == stated


def with_levels(level: Estimate, band: int = 0, **others: Any) -> str:  # noqa: ANN401
    levels: list[Any] = list(NOMINAL)
    levels[band] = level
    options = {
        "contact_time": 0.02, "restitution": 0.8, "peaks": 1, "mass": 2.5, "drop_height": 1.0,
        **others,
    }  # fmt: skip
    verdict = assess_levels(levels, **options)
    return verdict.conforms


def test_verdict_has_a_guard_band_on_both_sides() -> None:
    # Limits 38 to 40 dB; 1.96 times 0.1 dB.
    for value, word in (
        (37.80, "does not conform"), (37.81, "undecided"), (38.19, "undecided"),
        (38.20, "conforms"), (39.80, "conforms"), (39.81, "undecided"),
        (40.19, "undecided"), (40.20, "does not conform"),
    ):  # fmt: skip
        assert with_levels(Estimate(value, 0.1)) == word
    # An exact value on the limit conforms; one that is uncertain by more than the range never.
    assert with_levels(Estimate(38.0, 0.0)) == "conforms"
    assert with_levels(Estimate(39.0, 1.0)) == "undecided"
    assert with_levels(Estimate(39.0, math.nan)) == "undecided"
    assert with_levels(Estimate(math.nan, 0.1)) == "undecided"
    # An upper bound can only fail.
    assert with_levels(Estimate(39.0, 0.1, upper_bound=True)) == "undecided"
    assert with_levels(Estimate(45.0, 0.1, upper_bound=True)) == "undecided"
    assert with_levels(Estimate(37.0, 0.1, upper_bound=True)) == "does not conform"


def test_verdict_names_each_criterion_of_the_library() -> None:
    verdict = assess_levels(NOMINAL, contact_time=Estimate(0.02, 1e-4), restitution=0.8, peaks=2)
    expected = assess_levels(NOMINAL, 0.02, 0.8, 2)
    assert [d.name for d in verdict.criteria] == [c.name for c in expected.criteria]
    assert [(d.lower, d.upper) for d in verdict.criteria] == [
        (c.lower, c.upper) for c in expected.criteria
    ]
    assert [d.conforms for d in verdict.criteria] == [
        *["conforms"] * 7, "does not conform", *["undecided"] * 2,
    ]  # fmt: skip
    assert verdict.conforms == "does not conform"
    assert not verdict
    first = verdict.criteria[0]
    assert (first.margin, first.probability) == (1.0, 1.0)
    assert verdict.criteria[7].margin == -1
    assert with_levels(Estimate(39.0)) == "conforms"
    assert with_levels(Estimate(39.0), mass=math.nan) == "undecided"
    assert with_levels(Estimate(39.0), restitution=0.95, mass=math.nan) == "does not conform"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"levels": NOMINAL[:4]}, naming("levels", 4, 5)),
        ({"source": "bowling_ball"}, naming("'bowling_ball'", "'rubber_ball'")),
        ({"limits": {"octave_64": (1, 2)}}, naming("limits", "'octave_64'", "'octave_63'")),
        ({"limits": {"mass": ("a", 1)}}, naming("limits: mass")),
        ({"limits": {"mass": (1, 2, 3)}}, naming("limits: mass", [1, 2, 3])),
        ({"peaks": 1.5}, naming("peaks", 1.5, "whole")),
        ({"peaks": -1}, naming("peaks", -1.0)),
    ],
)
def test_wrong_criteria_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(thud.InputError, match=words):
        assess_levels(**{"levels": NOMINAL, **options})


def test_probability_of_conformity_counts_both_limits() -> None:
    half = Estimate(40.0, 0.1)
    wide = Estimate(39.0, 1.0)
    decisions = [assess_levels([q, *NOMINAL[1:]]).criteria[0] for q in (half, wide)]
    assert decisions[0].probability == pytest.approx(0.5)
    assert decisions[1].probability == pytest.approx(0.6827, abs=1e-4)
    # Of four drops, Student's t; what is not known or an upper bound has no probability.
    few = Estimate(39.5, 0.4, freedom=3)
    expected = student.cdf(0.5 / 0.4, 3) - student.cdf(-1.5 / 0.4, 3)
    assert assess_levels([few, *NOMINAL[1:]]).criteria[0].probability == pytest.approx(expected)
    bound = replace(few, upper_bound=True)
    assert math.isnan(assess_levels([bound, *NOMINAL[1:]]).criteria[0].probability)


def test_energy_of_bands_adds_up_to_neighbours() -> None:
    """Thirds of an octave hold its energy, for exact levels and for the noise."""
    drop = make_drop(5.0)
    thirds, octaves = measure_levels([drop], "third"), measure_levels([drop])
    starts = range(0, 16, 3)
    for attribute in ("measured", "background"):
        energy = 10 ** (getattr(thirds, attribute)[0] / 10)
        sums = [energy[a:b].sum() for a, b in pairwise(starts)]
        expected = getattr(octaves, attribute)[0]
        np.testing.assert_allclose(10 * np.log10(sums), expected, atol=1e-3)


def test_every_stage_draws_itself() -> None:
    stages = thud.read_recording("inputs/recordings/drop_1.csv").stages
    assert stages is not None
    levels = measure_levels([stages.drop])
    drawn = (stages, stages.section, stages.repaired, stages.drop.contact, stages.drop, levels)
    assert [len(stage.plot().axes) for stage in drawn] == [4, 1, 1, 1, 2, 1]
