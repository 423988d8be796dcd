"""Cells, functionals and flanks of a contact, each by its definition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recording_files import noisy
from scipy import stats
from scipy.ndimage import median_filter, uniform_filter1d
from synthetic import half_sine, make_drop, only_section

from thud.impact.contact_time import contact_span
from thud.level.levels import low_pass
from thud.recordings import contact as module, drops, measured_drop
from thud.recordings.background import cell_means, remove_background, uniform_cells
from thud.recordings.config import Config
from thud.recordings.contact import Contact, find_contact
from thud.recordings.drops import Section
from thud.recordings.instruments import Plate, RecorderFilter
from thud.recordings.repair import check_aliasing

RATE = 25600.0
# Instruments without an effect.
FLAT = Config(plate=Plate(f0=1e6, Q=1.0, share=1.0), filter=RecorderFilter("none"))


@pytest.mark.parametrize("before", [1.0, 0.01])
def test_quiet_cells_grow_away_from_the_contact(before: float) -> None:
    """Of 0.5 ms up to 5 ms, 2 ms up to 25 ms, 3 ms up to 0.1 s, as far as the section reaches."""
    first, stop = int(before * RATE), int((before + 0.02) * RATE)
    force = half_sine(RATE, before, int((before + 1.2) * RATE))
    _, background = remove_background(Section("drop", force, RATE, 0, (first, stop)))
    begins, ends = background.cells
    after = begins > before + 0.01
    expected = np.concatenate([np.full(10, 0.5), np.full(10, 2), np.full(25, 3)]) / 1e3
    np.testing.assert_allclose((ends - begins)[after], expected, atol=1.01 / RATE)
    assert begins[after][0] == pytest.approx(background.ends[1], abs=1 / RATE)
    assert begins[0] > max(background.ends[0] - 0.101, -1 / RATE)


def test_cells_have_their_samples_and_means() -> None:
    begins, ends = uniform_cells(10, 10 + int(0.0203 * RATE), RATE)
    # Each sample is the middle of its interval; 101.5 cells of 0.2 ms.
    assert (begins[0], ends[-1]) == pytest.approx((9.5 / RATE, (9.5 + int(0.0203 * RATE)) / RATE))
    assert len(begins) == round(int(0.0203 * RATE) / RATE / 2e-4)
    np.testing.assert_allclose(begins[1:], ends[:-1])
    assert np.ptp(ends - begins) < 1.01 / RATE
    # What lies between two sides is in no cell.
    force = np.arange(2000.0) ** 2
    sides = np.array([100, 300, 700]), np.array([1300, 1500, 2000])
    cells, mean = cell_means(force, RATE, *sides)
    expected = [(100, 300), (300, 700), (1300, 1500), (1500, 2000)]
    np.testing.assert_allclose(np.transpose(cells) * RATE + 0.5, expected)
    np.testing.assert_allclose(mean, [force[first:stop].mean() for first, stop in expected])


def test_peak_has_the_uncertainty_of_its_place() -> None:
    drop = make_drop(0.0, RATE)
    n_cell = len(drop.contact.covariance)
    # That of the background grows from cell to cell; the peak lies in the middle one.
    slope = replace(drop.contact, covariance=np.diag(np.arange(1.0, n_cell + 1)))
    found = measured_drop._peak(replace(drop, contact=slope), FLAT)  # noqa: SLF001
    assert found.uncertainty**2 == pytest.approx((n_cell + 1) / 2, abs=1.0)


def test_peak_is_less_what_noise_adds_and_as_uncertain() -> None:
    """Maxima of many noisy records: their mean error is part of their uncertainty."""
    found = [measured_drop._peak(make_drop(20.0, RATE, seed=seed), FLAT) for seed in range(40)]  # noqa: SLF001
    clean = low_pass(np.pad(make_drop(0.0, RATE).contact.gated, 2), RATE).max()
    error = np.array([one.value for one in found]) - clean
    stated = np.array([one.uncertainty for one in found])
    # White noise below 1.25 kHz: 20 N sqrt(1250/12800); more for what is subtracted.
    floor = 20 * np.sqrt(1250 / 12800)
    assert (stated > floor).all()
    assert (stated < 2 * floor).all()
    assert abs(error.mean()) < 4 * floor / np.sqrt(40)
    assert np.mean(np.abs(error) < 1.96 * stated) > stats.binom.ppf(1e-4, 40, 0.95) / 40


@pytest.mark.parametrize(("size", "rate"), [(0.05, 25600.0), (12.0, 25600.0), (30.0, 5000.0)])
def test_content_that_folds_back_falls_with_frequency_squared(size: float, rate: float) -> None:
    """A density of a (0.45 rate/f)**2 beyond half the rate, folded to the edge of the octave."""
    one = make_drop(0.0, rate).contact
    tone = size * np.cos(2 * np.pi * 0.45 * np.arange(len(one.force)))
    one = replace(one, force=one.force + tone)
    count = len(one.gated)
    length = count + int(rate / 20) + 3 * count
    f = np.fft.rfftfreq(length, 1 / rate)
    power = np.abs(np.fft.rfft(one.gated, length)) ** 2
    top = np.sqrt(power[f > 0.4 * rate].mean()) * (0.45 * rate / (rate - 707.9)) ** 2
    own = np.sqrt(power[(f > 354.8) & (f < 707.9)].mean())
    expected = 20 * np.log10(1 + top / own)
    section = Section("drop", one.force, rate, 0, one.gate)
    told = check_aliasing(section, one)
    assert bool(told) == (expected > 0.1)
    for note in told:
        assert note.value == pytest.approx(expected, rel=1e-3)
    # Noise has content there too: three times its power is none.
    white = top**2 * ((rate - 707.9) / 0.45 / rate) ** 4 / count / rate * 2
    for factor, expected in ((0.1, bool(told)), (0.34, False)):
        variances = np.array([factor * white, 0, 0, 0, 0])
        loud = replace(one, background=replace(one.background, variances=variances))
        assert bool(check_aliasing(section, loud)) == expected


def test_shapes_are_those_of_the_theory() -> None:
    tau = np.array([-0.5, -0.02, 0.0, 0.3, 1.0, 2.7])
    found = module._flanks(tau, 0.1)  # noqa: SLF001
    # A jump as sampled, and spread over a sample.
    jump = (np.array([0, 0, 1, 1, 1, 1]) + np.array([0, 0.3, 0.5, 1, 1, 1])) / 2
    for column, power, ratio in zip(found.T, module.POWERS, module.JUMPS, strict=True):
        expected = (np.maximum(tau, 0) ** power + ratio * jump) / (1 + ratio)
        np.testing.assert_allclose(column, expected, atol=1e-12)


def found_contact(record: np.ndarray, rate: float) -> tuple[Contact, float]:
    """Return the contact of a record with one drop, and the time at which its window begins, s."""
    section = only_section(record, rate)
    return find_contact(section, *remove_background(section)), section.start / rate


def edge_errors(
    pulse: np.ndarray, noise: float, seed: int, rate: float = RATE, factor: int = 16
) -> list[tuple[float, float]]:
    """Return errors of begin and end and their uncertainties, s.

    The pulse, N, is given at a multiple of the rate and recorded with noise, N.
    """
    record, start = np.zeros(int(0.25 * rate)), int(0.1 * rate)
    record[start:][: len(pulse[::factor])] += pulse[::factor]
    found, first = found_contact(noisy(record, noise, seed), rate)
    true = np.array(contact_span(pulse, factor * rate)) + start / rate - first
    edges = found.begin, found.end
    return [(e.value - t, e.uncertainty) for e, t in zip(edges, true, strict=True)]


@pytest.mark.parametrize(
    ("power", "jump", "steep"), [(1.0, 0, 0), (1.5, 0, 0), (2, 0, 0), (1, 0.1, 0), (1, 0, 12)]
)
def test_edges_of_flanks_lie_at_a_percent_of_the_peak(
    power: float, jump: float, steep: float
) -> None:
    """Lines, points of contact, feet, jumps, and rises to half the peak within a millisecond."""
    x = np.arange(int(0.02 * 16 * RATE)) / (0.02 * 16 * RATE)
    pulse = (1 - x) * (1 - np.exp(-steep * x)) if steep else np.sin(np.pi * x) ** power + jump
    for error, uncertainty in edge_errors(1500 * pulse / pulse.max(), 0.5, 1):
        assert abs(error) < min(3 * uncertainty, 4e-5)
        assert uncertainty < 6e-5


def test_uncertainty_of_edges_is_the_scatter() -> None:
    """95 % intervals of lines, which are known to be no other shape, hold more of the errors."""
    pulse = 1500 * np.sin(np.pi * np.arange(int(0.02 * 16 * RATE)) / (0.02 * 16 * RATE))
    errors = [edge for seed in range(40) for edge in edge_errors(pulse, 15.0, seed)]
    scores = np.divide(*np.transpose(errors))
    assert np.mean(np.abs(scores) < 1.96) >= stats.binom.ppf(1e-3, 80, 0.95) / 80
    assert np.std(scores) > 0.3


@pytest.mark.parametrize("rate", [8000.0, 51200.0])
@pytest.mark.parametrize(("power", "decay"), [(1.0, 1.4), (1.3, 1.4), (1.3, 0.6)])
def test_slow_release_ends_at_a_percent_of_the_peak(
    power: float, decay: float, rate: float
) -> None:
    """From a fifth of the peak to 1 % the force falls in 4.4 to 6.6 ms."""
    fine = 32 * rate
    x = np.arange(int(0.022 * fine)) / (0.022 * fine)
    pulse = (1 - x) ** power * np.exp(-decay * x) * (1 - np.exp(-10 * x))
    pulse *= 1500 / pulse.max()
    fall = contact_span(pulse, fine)[1] - np.flatnonzero(pulse > 300)[-1] / fine
    assert 4.3e-3 < fall < 6.7e-3
    for error, uncertainty in edge_errors(pulse, 1.0, 3, rate, 32):
        assert abs(error) < min(3 * uncertainty, 1e-4)


def test_scale_of_a_contact_is_its_peak_below_the_band_edge() -> None:
    force = half_sine(RATE, 0.1, int(0.22 * RATE)) + 40
    force[2700] += 300
    found, _ = found_contact(force, RATE)
    expected = uniform_filter1d(force - 40, round(RATE / 1250)).max()
    assert found.background.peak == pytest.approx(expected, rel=1e-3)
    assert found.gated.max() == pytest.approx((force - 40).max(), abs=0.5)


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
    instants, forces = [500, 510, 514, 518, 522, 532], [0, 1, valley, valley, 1, after]
    cells = 1000 * np.interp(np.arange(1000), instants, forces)
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
