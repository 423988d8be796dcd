"""Cells, functionals and flanks of a contact, each by its definition."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import codes, noted
from scipy import stats
from scipy.ndimage import median_filter, uniform_filter1d
from synthetic import cut_drops, half_sine, make_drop

from thud.impact.contact_time import contact_span
from thud.level.levels import low_pass
from thud.recordings import drops, flanks, measured_drop
from thud.recordings.background import (
    background_means,
    cells_between,
    remove_background,
    uniform_bounds,
)
from thud.recordings.checks import aliasing
from thud.recordings.contact import Contact, find_contact
from thud.recordings.drops import Section
from thud.recordings.plate import Plate
from thud.recordings.response import Chain
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    from thud.level.estimate import Estimate

RATE = 25600.0


def test_quiet_cells_grow_away_from_the_contact() -> None:
    """Of 0.5 ms up to 5 ms, 2 ms up to 25 ms, 3 ms up to 0.1 s."""
    force = np.zeros(int(2.2 * RATE))
    (begins, ends), _ = background_means(force, int(RATE), int(1.2 * RATE), RATE, 0.0)
    after = begins > 1.1
    edges = np.append(begins[after], ends[-1]) - begins[after][0]
    np.testing.assert_allclose(np.diff(edges), (ends - begins)[after])
    width, begin = np.diff(edges), edges[:-1]
    assert edges[0] == 0
    assert edges[-1] == pytest.approx(0.1, abs=1.5 / RATE)
    for low, high, expected in ((0, 5e-3, 5e-4), (5e-3, 25e-3, 2e-3), (25e-3, 0.1, 3e-3)):
        inside = (begin > low - 1e-4) & (begin < high - 1e-4)
        np.testing.assert_allclose(width[inside], expected, atol=1.01 / RATE)
        assert width[inside].sum() == pytest.approx(high - low, abs=1.01 / RATE)
    # Cells that are longer than the background are left out.
    (begins, _), _ = background_means(force, 100, int(1.2 * RATE), RATE, 0.0)
    assert begins[0] > -1 / RATE


def test_cells_have_their_samples_and_means() -> None:
    edges = uniform_bounds(10, 10 + int(0.0203 * RATE), RATE)
    assert (edges[0], edges[-1]) == (10, 10 + int(0.0203 * RATE))
    # 101.5 cells of 0.2 ms.
    assert len(edges) - 1 == round(int(0.0203 * RATE) / RATE / 2e-4)
    assert np.ptp(np.diff(edges)) <= 1
    begins, ends = cells_between(edges, RATE, 0.01)
    # Each sample stands for the time half an interval around it.
    np.testing.assert_allclose(begins, (edges[:-1] - 0.5) / RATE - 0.01)
    np.testing.assert_allclose(ends - begins, np.diff(edges) / RATE)
    force = np.arange(2000.0) ** 2
    quiet, mean = background_means(force, 700, 1300, RATE, 0.04)
    for begin, end, value in zip(*quiet, mean, strict=True):
        first, stop = (round((time + 0.04) * RATE + 0.5) for time in (begin, end))
        assert value == pytest.approx(force[first:stop].mean())
        assert stop <= 700 or first >= 1300


def with_covariance(seed: int = 1) -> Contact:
    one = make_drop(3.0, RATE).contact
    root = np.random.default_rng(seed).normal(size=one.covariance.shape)
    return replace(one, covariance=root @ root.T)


def sample_covariance(one: Contact) -> np.ndarray:
    """Return the covariance of the samples of the gate: white noise, and the error of each cell."""
    count, n_cell = len(one.gated), len(one.covariance)
    edges = np.rint(np.linspace(0, count, n_cell + 1))
    cell = np.searchsorted(edges, np.arange(count), "right") - 1
    white = one.background.variances[0] * one.sample_rate / 2
    return one.covariance[np.ix_(cell, cell)] + white * np.eye(count)


def test_covariance_of_functionals_is_that_of_samples() -> None:
    one = with_covariance()
    rows = np.random.default_rng(2).normal(size=(3, len(one.gated)))
    expected = rows @ sample_covariance(one) @ rows.T
    np.testing.assert_allclose(one.covariance_of(rows), expected, rtol=1e-9)


def test_impulse_is_the_sum_of_samples_with_their_covariance() -> None:
    one = with_covariance(3)
    found = measured_drop._impulse(one)  # noqa: SLF001
    # 2 P T / pi of a half sine; the noise of n samples of 3 N.
    noise = 3 * np.sqrt(len(one.gated)) / RATE
    assert found.value == pytest.approx(1500 * 0.02 * 2 / np.pi, abs=4 * noise)
    assert found.value == pytest.approx(one.gated.sum() / RATE)
    assert found.uncertainty == pytest.approx(np.sqrt(sample_covariance(one).sum()) / RATE)


def test_peak_has_the_uncertainty_of_its_place() -> None:
    quiet = make_drop(0.0, RATE).contact
    n_cell = len(quiet.covariance)
    # That of the background grows from cell to cell; the peak lies in the middle one.
    slope = replace(quiet, covariance=np.diag(np.arange(1.0, n_cell + 1)))
    found = measured_drop._peak(slope)  # noqa: SLF001
    margin = int(np.ceil(measured_drop.PEAK_MARGIN * RATE))
    low = measured_drop._interpolated(np.pad(quiet.gated, margin), RATE)  # noqa: SLF001
    assert found.value == pytest.approx(low.max())
    cell = np.argmax(low) / len(low) * n_cell
    assert found.uncertainty**2 == pytest.approx(cell + 0.5, abs=1.0)


def test_peak_is_less_what_noise_adds_and_as_uncertain() -> None:
    """Maxima of many noisy records: their mean error is part of their uncertainty."""
    found = [measured_drop._peak(make_drop(20.0, RATE, seed=seed).contact) for seed in range(40)]  # noqa: SLF001
    clean = low_pass(np.pad(make_drop(0.0, RATE).contact.gated, 2), RATE).max()
    error = np.array([one.value for one in found]) - clean
    stated = np.array([one.uncertainty for one in found])
    # White noise below 1.25 kHz: 20 N sqrt(1250/12800); more for what is subtracted.
    floor = 20 * np.sqrt(1250 / 12800)
    assert (stated > floor).all()
    assert (stated < 2 * floor).all()
    assert abs(error.mean()) < 4 * floor / np.sqrt(40)
    assert np.mean(np.abs(error) < 1.96 * stated) > stats.binom.ppf(1e-4, 40, 0.95) / 40


def test_noise_of_the_quiet_is_that_outside_the_gate() -> None:
    found = make_drop(7.0, RATE).noise
    # The median of absolute values has a relative error of 1.17/sqrt(n).
    assert found == pytest.approx(7.0, rel=4 * 1.17 / np.sqrt(0.2 * RATE))


@pytest.mark.parametrize(("drift", "hum"), [(2.9, 3.1), (3.1, 2.9), (-3.1, 0.0)])
def test_drift_and_hum_are_told_from_three_deviations_on(drift: float, hum: float) -> None:
    one = make_drop(1.0, RATE).contact
    gate = np.array(one.gate) / RATE
    removed = np.interp(np.arange(*one.span) / RATE, [gate[0], gate[1] - 1 / RATE], [-2.0, 12.0])
    known = SimpleNamespace(drift=(drift * 4, 4.0), hum=(60.0, hum * 0.5, 0.5), tones=())
    notes = replace(one, removed=removed, background=known).notes  # type: ignore[arg-type]
    # The mean of what lies under the contact.
    assert noted(notes, "offset_removed").value == pytest.approx(5.0)
    assert ("drift_removed" in codes(notes)) == (abs(drift) > 3)
    assert ("hum_removed" in codes(notes)) == (hum > 3)


@pytest.mark.parametrize(("size", "rate"), [(0.05, 25600.0), (12.0, 25600.0), (30.0, 5000.0)])
def test_content_that_folds_back_falls_with_the_square_of_the_frequency(
    size: float, rate: float
) -> None:
    """A density of a (0.45 rate/f)**2 beyond half the rate, folded to the edge of the octave."""
    one = make_drop(0.0, rate).contact
    time = np.arange(len(one.force)) / rate
    force = one.force + size * np.cos(2 * np.pi * 0.45 * rate * time)
    one = replace(one, force=force)
    count = len(one.gated)
    length = count + int(rate / 20) + 3 * count
    f = np.fft.rfftfreq(length, 1 / rate)
    power = np.abs(np.fft.rfft(one.gated, length)) ** 2
    top = np.sqrt(power[f > 0.4 * rate].mean()) * (0.45 * rate / (rate - 707.9)) ** 2
    own = np.sqrt(power[(f > 354.8) & (f < 707.9)].mean())
    expected = 20 * np.log10(1 + top / own)
    section = Section("drop", one.force, rate, 0, one.gate)
    told = aliasing.check(section, one)
    assert bool(told) == (expected > 0.1)
    for note in told:
        assert (note.value, note.effect) == pytest.approx((expected, expected), rel=1e-3)
    # Noise has content there too: three times its power is none.
    white = top**2 * ((rate - 707.9) / 0.45 / rate) ** 4 / count / rate * 2
    for factor, expected in ((0.1, bool(told)), (0.34, False)):
        draws = np.array([[factor * white, 0, 0, 0, 0]])
        noisy = replace(one, background=replace(one.background, draws=draws))
        assert bool(aliasing.check(section, noisy)) == expected


# Flanks: times of 30 cells, whose noise is known.
TIME = np.sort(np.random.default_rng(1).uniform(-1e-3, 3e-3, 30))


def columns_at(table: np.ndarray, tau: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return shapes of a table at times since the touch, ms, with the force as the last column."""
    shapes = table[np.rint((tau + flanks.BEFORE) / flanks.TICK).astype(int)]
    last = np.broadcast_to(force, tau.shape)[..., np.newaxis]
    return np.concatenate([shapes, last], axis=-1)


def flank() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return table, columns at three times of touch, and the covariance of the noise."""
    table = flanks._table(1e3 / RATE, None)  # noqa: SLF001
    level = np.where(TIME > 2e-4, 0.16 * 1e3 * (TIME - 2e-4), 0.0)
    touches = np.array([0.0, 2e-4, 5e-4])
    columns = columns_at(table, 1e3 * (TIME - touches[:, None]), level)
    root = np.random.default_rng(5).normal(size=(30, 30)) / 30
    return level, columns, 4e-4 * np.eye(30) + 1e-3 * root @ root.T


def test_evidence_is_the_normal_density_of_the_flank() -> None:
    """With normal shapes of mean m and deviation S, y is normal: X m, C + X S2 X'."""
    level, columns, covariance = flank()
    inverse = np.linalg.inv(np.linalg.cholesky(covariance))
    kinds = range(len(flanks.KINDS))
    found, factors = flanks._evidence(columns, inverse)  # noqa: SLF001
    expected = np.empty(found.shape)
    for kind in kinds:
        for place, shapes in enumerate(columns[..., :-1]):
            spread = shapes * flanks.SPREADS[kind]
            expected[kind, place] = stats.multivariate_normal.logpdf(
                level, shapes @ flanks.MEANS[kind], covariance + spread @ spread.T
            )
    difference = found - expected
    np.testing.assert_allclose(difference, difference[0, 0], atol=1e-8)
    # The last row of a factor is the mean of the shapes of unit deviation.
    lower, shapes = factors[0, 1], columns[1, :, :-1] * flanks.SPREADS[0]
    information = np.eye(shapes.shape[1]) + shapes.T @ np.linalg.solve(covariance, shapes)
    rest = level - columns[1, :, :-1] @ flanks.MEANS[0]
    mean = np.linalg.solve(information, shapes.T @ np.linalg.solve(covariance, rest))
    np.testing.assert_allclose(np.linalg.solve(lower[:-1, :-1].T, lower[-1, :-1]), mean, atol=1e-9)


def test_shapes_are_those_of_the_theory() -> None:
    tau = np.array([-0.5, -0.02, 0.0, 0.3, 1.0, 2.7])
    found = flanks._shapes(tau, 0.1)  # noqa: SLF001
    after = np.maximum(tau, 0)
    np.testing.assert_array_equal(found[:, 0], tau >= 0)
    # A jump that a filter spreads over one sample.
    np.testing.assert_allclose(found[:, 1], [0, 0.3, 0.5, 1, 1, 1])
    for column, expected in zip(found.T[2:5], (after, after**1.5, after**2 / 2), strict=True):
        np.testing.assert_allclose(column, expected)
    # Steps of a walk: each rises from one knot to the next, so that together they are a line.
    walk = found[:, 5:]
    np.testing.assert_allclose(walk @ np.diff(flanks.KNOTS), after)
    np.testing.assert_allclose(
        flanks._shapes(flanks.KNOTS, 0)[:, 5:],  # noqa: SLF001
        np.tri(len(flanks.KNOTS), len(flanks.KNOTS) - 1, -1),
    )


def test_walks_scatter_with_the_steps_of_their_flank() -> None:
    gaps = np.diff(flanks.KNOTS)
    for kind, spread in zip(flanks.KINDS, flanks.SPREADS, strict=True):
        mean = flanks._shapes(flanks.KNOTS, 0)[:, 2:4] @ kind.mean  # noqa: SLF001
        expected = kind.walk * (np.sqrt(gaps) if kind.rough else np.diff(mean))
        np.testing.assert_allclose(spread[5:], expected)
        assert tuple(spread[:2]) == (kind.jump, kind.jump)
        assert spread[4] == kind.parabola
        # What is added to begin and end: 5 us for lines and jumps, 20 us for all other kinds.
        is_line = not kind.rough and kind.mean[1] == 0
        assert kind.error == (5e-6 if is_line else 20e-6)
    # What is likely at touch and at release.
    np.testing.assert_allclose(np.exp(flanks.LOG_PRIOR).sum(axis=0), 1)


def test_table_holds_smoothed_shapes() -> None:
    interval = 1e3 / RATE
    table = flanks._table(interval, None)  # noqa: SLF001
    tau = np.array([-1.2, -0.03, 0.017, 0.5, 7.9])
    found = columns_at(table, tau, np.zeros(5))[:, :-1]
    near, far = (flanks._shapes(tau + k * interval, interval) for k in (-1, 1))  # noqa: SLF001
    expected = (near + far) / 4 + flanks._shapes(tau, interval) / 2  # noqa: SLF001
    # Times are rounded to a microsecond, in which a jump that is spread rises by 1/39 of itself.
    np.testing.assert_allclose(found[:, 1:], expected[:, 1:], atol=0.03)
    np.testing.assert_allclose(found[:, 2:5], expected[:, 2:5], atol=2e-3)
    # A plate leaves a slow flank alone.
    plated = flanks._table(interval, Chain((Plate(1600.0, 30.0),)))  # noqa: SLF001
    end = columns_at(plated, np.array([7.9]), np.zeros(1))[:, :-1]
    np.testing.assert_allclose(end[0, 2], 7.9, atol=0.02)


def test_crossings_lie_on_the_lines_between_delays() -> None:
    delay = flanks.DELAY
    slope = np.array([[0.013], [0.4], [1e-4]])
    found = flanks._crossing(slope * delay, 0.01)  # noqa: SLF001
    # The last never gets there: the end of the delays.
    np.testing.assert_allclose(found, [0.01 / 0.013, 0.025, delay[-1]])
    np.testing.assert_allclose(flanks._crossing(0.02 + slope * delay, 0.01), 0)  # noqa: SLF001


def test_edge_is_where_the_force_of_a_line_begins_and_passes_a_percent() -> None:
    """Without noise the posterior is as narrow as its cells and what the shapes leave."""
    time = np.arange(-60, 90) / 25600
    shift = 1.3e-5
    level = np.maximum(0.16 * 1e3 * (time - shift), 0)
    smooth = np.convolve(level, flanks.SMOOTHING, mode="same")[1:-1]
    covariance = (2 / 1500) ** 2 * np.eye(len(smooth))

    def find(low: float, high: float) -> tuple[Estimate, Estimate]:
        interval = 1 / 25600
        return flanks.find_touch(
            time[1:-1], smooth, covariance, (low, high), interval, None, release=False
        )

    touch, begin = find(-1e-3, 1e-3)
    assert abs(touch.value - shift) < 4 * touch.uncertainty
    # 1 % of the peak, averaged over 0.1 ms, at 0.01/0.16 ms.
    assert abs(begin.value - shift - 0.01 / 160) < 4 * begin.uncertainty
    assert 5e-6 < begin.uncertainty < 4e-5
    # The searches narrow to where the touch lies, from bounds of any width.
    near, _ = find(shift - 2e-4, shift + 2.5e-4)
    assert touch.value == pytest.approx(near.value, abs=0.1 * near.uncertainty)
    assert touch.uncertainty == pytest.approx(near.uncertainty, rel=0.1)


def test_only_rough_flanks_fall() -> None:
    """A force of 0.16 t - 0.035 t**2 falls by a tenth of the peak within 4 ms."""
    smooth, rough = 0, flanks.N_SMOOTH
    assert not flanks.KINDS[smooth].rough
    assert flanks.KINDS[rough].rough
    # Shapes that are known to 1e-6 of their deviation.
    n = flanks.SPREADS.shape[1]
    factors = 1e6 * np.tile(np.eye(n + 1), (len(flanks.KINDS), 2, 1, 1))
    factors[:, :, -1, :-1] = 0
    # The two kinds touch at different times.
    weight = np.zeros((len(flanks.KINDS), 2))
    weight[smooth, 0] = weight[rough, 1] = 0.5
    for kind in (smooth, rough):
        factors[kind, :, -1, 4] = 1e6 * -0.07 / flanks.SPREADS[kind, 4]
    candidates = np.array([0.0, 1e-3])
    touch, _, _, probability = flanks._draw_edges(candidates, weight, factors)  # noqa: SLF001
    assert probability @ touch == pytest.approx(1e-3)


def found_contact(record: np.ndarray, rate: float) -> tuple[Contact, int]:
    """Return the contact of a record with one drop, and the first sample of its window."""
    (section,) = cut_drops(Signal.from_array(record, rate))
    return find_contact(section, *remove_background(section)), section.start


@pytest.mark.parametrize("rate", [8000.0, 51200.0])
@pytest.mark.parametrize(("power", "decay"), [(1.0, 1.4), (1.3, 1.4), (1.3, 0.6)])
def test_slow_release_ends_where_its_force_passes_a_percent(
    power: float, decay: float, rate: float
) -> None:
    """From a fifth of the peak to 1 % the force falls in 4.4 to 6.6 ms."""
    fine = 32 * rate
    x = np.arange(int(0.022 * fine)) / (0.022 * fine)
    pulse = (1 - x) ** power * np.exp(-decay * x) * (1 - np.exp(-10 * x))
    pulse *= 1500 / pulse.max()
    begin, end = contact_span(pulse, fine)
    fall = (fine * end - np.flatnonzero(pulse > 300)[-1]) / fine
    assert 4.3e-3 < fall < 6.7e-3
    record = np.zeros(int(0.25 * rate))
    record[int(0.1 * rate) :][: len(pulse[::32])] += pulse[::32]
    record += np.random.default_rng(3).normal(size=len(record))
    found, start = found_contact(record, rate)
    for edge, expected in ((found.begin, begin), (found.end, end)):
        late = edge.value - expected - int(0.1 * rate) / rate + start / rate
        assert abs(late) < min(3 * edge.uncertainty, 1e-4)


def test_scale_of_a_contact_is_its_peak_below_the_band_edge() -> None:
    force = half_sine(RATE, 0.1, int(0.22 * RATE)) + 40
    force[2700] += 300
    found, _ = found_contact(force, RATE)
    expected = uniform_filter1d(force - 40, round(RATE / 1250)).max()
    assert found.peak == pytest.approx(expected, rel=1e-3)
    assert found.gated.max() == pytest.approx((force - 40).max(), abs=0.5)
    assert found.background_lengths == pytest.approx((0.1, 0.1), abs=4.5e-3)


@pytest.mark.parametrize("ahead", ["pulse", "step"])
def test_peak_of_a_pulse_is_above_the_higher_background_beside_it(ahead: str) -> None:
    cells = np.zeros(300)
    phase = np.arange(24) / 24
    cells[100:124] += 1000 * np.sin(np.pi * phase) ** 2 * (1 + 0.3 * np.cos(np.pi * phase))
    cells += np.interp(np.arange(300), [105, 117], [0, 60])
    cells[:70] -= 50
    if ahead == "pulse":
        cells[60:80] += 800 * np.sin(np.pi * np.arange(20) / 20)
    *_, found = drops._find_pulses(cells, 0, 300, 1000.0)  # noqa: SLF001
    smooth = uniform_filter1d(median_filter(cells, 3), 3) - 60
    assert found.peak == pytest.approx(smooth.max(), abs=0.5)
    # Its edges lie two cells outside of a fifth of it, and cells are samples here.
    above = 95 + np.flatnonzero(smooth[95:] > found.peak / 5)
    assert found.contact == (above[0] - 2, above[-1] + 3)
    before = 0 if ahead == "step" else 78
    assert found.section == (pytest.approx(before, abs=6), 300)


@pytest.mark.parametrize(
    ("valley", "after", "expected"), [(0.1, 0.0, 2), (0.4, 0.0, 1), (1.0, 0.2, 1), (1.0, 0.5, 0)]
)
def test_pulses_return_to_thirty_percent(valley: float, after: float, expected: int) -> None:
    cells = np.zeros(1000)
    instants, forces = [500, 510, 514, 518, 522, 532], [0, 1, valley, valley, 1, after]
    cells += 1000 * np.interp(np.arange(1000), instants, forces)
    assert len(drops._find_pulses(cells, 0, 1000, 1000.0)) == expected  # noqa: SLF001


def test_pulses_rise_above_six_deviations_of_the_cells() -> None:
    """Of the cells below the baseline, whose median is 0.6745 deviations of normal noise."""
    rng = np.random.default_rng(4)
    pulse = np.sin(np.pi * np.arange(20) / 20)
    level = 10 / np.sqrt(3)  # of means over three cells
    for height, expected in ((4.5, 1), (8.5, 2)):
        cells = rng.normal(scale=10, size=4000)
        cells[1000:1020] += 1000 * pulse
        cells[2000:2020] += height * level * pulse
        assert len(drops._find_pulses(cells, 0, 4000, 1000.0)) == expected  # noqa: SLF001
