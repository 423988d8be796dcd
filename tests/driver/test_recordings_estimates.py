"""Drops of a signal: found, split, measured; faults named."""

from __future__ import annotations

import re
import tracemalloc
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import codes, naming, noted
from scipy.stats import chi2
from synthetic import band_limited, cut_drops, half_sine, make_drop, make_recording, with_force

import thud
from thud.impact.contact_time import contact_span
from thud.level.estimate import Estimate
from thud.recordings.background import remove_background
from thud.recordings.config import Config
from thud.recordings.contact import find_contact
from thud.recordings.drops import Section, find_drops
from thud.recordings.measured_drop import GRAVITY, Drop, measure_drop, measure_rebound
from thud.recordings.quantities import drop_estimates
from thud.recordings.recorded_levels import measure_levels
from thud.recordings.repair import repair
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    from collections.abc import Callable

BANDS = thud.get_bands()
ORACLE = np.array([38.3125, 30.6046, 19.2578, 8.9323, -0.4390])
FINE = 192_000.0
# A half sine of 20 ms is above 1 % of its peak for this time, s.
ABOVE = 0.02 * (1 - 2 * np.arcsin(0.01) / np.pi)
HALF_SINE = half_sine(FINE, 0.0, int(0.02 * FINE) + 2)
SPEED = np.sqrt(2 * 9.81)


def pulse(impact: thud.Impact) -> np.ndarray:
    return impact.floor_force[: int(impact.exact_contact_time * impact.sample_rate) + 2]


def drops(force: np.ndarray, rate: float, **known: float) -> list[Drop]:
    config = Config(**{"height": 1.0, "mass": 2.5, **known})
    sections = cut_drops(Signal.from_array(force, rate, "file.wav"))
    return [measured(section, config) for section in sections]


def measured(section: Section, config: Config) -> Drop:
    repaired = repair(section)
    return measure_drop(repaired, find_contact(repaired, *remove_background(repaired)), config)


def levels(drop: Drop) -> np.ndarray:
    return measure_levels([drop]).level[0]


@pytest.mark.parametrize("before", [0.01, 0.1])
def test_noise_of_5_n_does_not_stretch_the_contact(flagship: thud.Impact, before: float) -> None:
    # A threshold of 1 % reads 34 ms with 10 ms of quiet, and 171 to 245 ms with 100 ms.
    for seed in range(5):
        rate = flagship.sample_rate
        force, _ = make_recording(
            pulse(flagship), rate, noise_db=20 * np.log10(1609 / 5), before=before,
            after=before, seed=seed,
        )  # fmt: skip
        (drop,) = drops(force, rate)
        truth = flagship.contact_time_as_recorded
        assert drop.contact_time.value == pytest.approx(truth, abs=1e-4)
        assert abs(drop.contact_time.value - truth) < 3 * drop.contact_time.uncertainty
        assert drop.noise == pytest.approx(5, rel=0.3 if before < 0.05 else 0.1)


@pytest.mark.parametrize("gap", [0.03, 0.1, 3.0])
def test_two_impacts_in_a_file_are_two_drops(gap: float) -> None:
    force, _ = make_recording(
        HALF_SINE, FINE, rate=48e3, noise_db=50, drops=((0.0, 1.0), (0.02 + gap, 1.0))
    )
    found = drops(force, 48e3)
    assert [drop.name for drop in found] == ["file.wav, drop 1", "file.wav, drop 2"]
    assert found[1].onset - found[0].onset == pytest.approx(0.02 + gap, abs=2e-4)
    for drop in found:
        assert drop.contact_time.value == pytest.approx(ABOVE, abs=1e-4)
        assert drop.bounce is None
    # No window reaches closer than 2 ms to the pulse of the other.
    one, two = cut_drops(Signal.from_array(force, 48e3, "file.wav"))
    assert one.start + len(one.force) <= two.start + two.contact[0] - 96
    assert two.start >= one.start + one.contact[1] + 96


RATES = [2.5e3, 5e3, 8e3, 11025.0, 16e3, 44.1e3, 51.2e3, 96e3]


@pytest.mark.parametrize("rate", RATES)
def test_filtered_half_sine_has_the_levels_of_the_pulse(rate: float) -> None:
    time = np.arange(int(0.25 * rate)) / rate - 0.1003
    (drop,) = drops(band_limited(HALF_SINE, FINE, rate, time) + 20.0, rate)
    np.testing.assert_allclose(levels(drop), ORACLE, rtol=0, atol=1e-3)


def falling(
    flights: int, restitution: float = 0.8, scale: float = 1.0
) -> list[tuple[float, float]]:
    """Return times since first touch and factors of a drop and its bounces."""
    at, part, series = 0.0, scale, [(0.0, scale)]
    for _ in range(flights):
        part *= restitution
        at += 0.02 + 2 * SPEED * part / 9.81
        series.append((at, part))
    return series


def test_bounces_are_told_from_drops() -> None:
    series = falling(4)
    second = [(6.0 + at, part) for at, part in falling(4, scale=0.99)]
    force, _ = make_recording(HALF_SINE, FINE, rate=24e3, noise_db=50, drops=(*series, *second))
    found = drops(force, 24e3)
    assert len(found) == 2
    for drop, part in zip(found, (1.0, 0.99), strict=True):
        assert drop.bounce == pytest.approx(falling(1, scale=part)[1][0], abs=3e-4)
        by = drop.restitutions["bounces"]
        assert by.value == pytest.approx(0.8 * part, abs=3e-4)
        assert abs(by.value - 0.8 * part) < 4 * by.uncertainty
    (without,) = drops(force[: int(5 * 24e3)], 24e3, height=None)  # type: ignore[arg-type]
    assert np.isnan(without.restitution.value)


def test_restitution_is_that_from_first_touch_to_release() -> None:
    """A raised cosine of 25 ms is above 1 % of its peak for 23.4 ms, and so is its bounce."""
    rate, length, restitution = 24e3, 0.025, 0.8
    mass, flight = 2.5, 2 * 0.8 * SPEED / 9.81
    momentum = mass * SPEED * (1 + restitution) + mass * 9.81 * length
    time = np.arange(int(1.2 * rate)) / rate - 0.1
    force = np.zeros(len(time))
    for touch, size in ((0.0, 1.0), (length + flight, restitution)):
        late = np.clip((time - touch) / length, 0, 1)
        force += size * momentum / length * (1 - np.cos(2 * np.pi * late))
    (drop,) = drops(force + np.random.default_rng(1).normal(size=len(time)), rate, mass=mass)
    for estimate in drop.restitutions.values():
        assert estimate.value == pytest.approx(restitution, abs=1.5e-3)


def test_disagreement_of_impulse_and_bounces_is_not_averaged_away() -> None:
    force, _ = make_recording(
        HALF_SINE, FINE, rate=24e3, noise_db=60, drops=tuple(falling(2, 0.75))
    )
    ratio = 1500 * 0.02 * 2 / np.pi / SPEED
    fits = ratio / (1.75 + 9.81 * 0.02 / SPEED)
    for mass, differs in ((2.5, True), (fits, False)):
        found = thud.read_recording(Signal.from_array(force, 24e3), height=1.0, mass=mass)
        one = found.estimates["restitution"]
        named = {part.name: part.uncertainty for part in one.contributions}
        ways = [way.value for way in found.drops[0].restitutions.values()]
        assert ("impulse against bounces" in named) == differs
        assert (
            any(re.search(naming("impulse", "bounce"), str(one)) for one in found.notes) == differs
        )
        if differs:
            width = abs(np.subtract(*ways))
            assert named["impulse against bounces"] == pytest.approx(width / np.sqrt(3))
            assert one.value - one.expanded <= min(ways) < max(ways) <= one.value + one.expanded
            assert any(f"{fits:.3f} kg" in str(note) for note in found.notes)


def propagated(function: Callable[..., float], *estimates: Estimate) -> Estimate:
    """Return a value and its uncertainty (JCGM 100, 5.1.2), slopes by differences."""
    values = [one.value for one in estimates]
    total = 0.0
    for i, one in enumerate(estimates):
        step = 1e-6 * values[i]
        ends = [function(*values[:i], values[i] + s * step, *values[i + 1 :]) for s in (1, -1)]
        total += ((ends[0] - ends[1]) / (2 * step) * one.uncertainty) ** 2
    return Estimate(function(*values), np.sqrt(total))


IMPULSE, CONTACT = Estimate(22.0, 0.05), Estimate(0.02, 2e-4)
FLIGHT = Estimate(0.7, 2e-3)
CONFIG = Config(height=1.2, mass=2.4, mass_uncertainty=0.02, height_uncertainty=0.003)
# Relative standard uncertainty of the force.
CALIBRATION = 0.01
LANDING = np.sqrt(2 * GRAVITY * 1.2)


def by_impulse(impulse: float, contact: float, mass: float = 2.4, height: float = 1.2) -> float:
    """Return (J - m g t_c)/(m v0) - 1, of the momentum before and after."""
    speed = np.sqrt(2 * GRAVITY * height)
    return (impulse - mass * GRAVITY * contact) / (mass * speed) - 1


def by_flight(flight: float, height: float = 1.2) -> float:
    """Return v/v0 of a ball that flies for a time: it comes back with the velocity g T/2."""
    return GRAVITY * flight / 2 / np.sqrt(2 * GRAVITY * height)


def same(found: Estimate, expected: Estimate) -> None:
    assert (found.value, found.uncertainty) == pytest.approx(
        (expected.value, expected.uncertainty), rel=1e-6
    )


def test_restitution_by_impulse_and_flight_has_the_uncertainty_of_both() -> None:
    ways, shared = measure_rebound(IMPULSE, CONTACT, FLIGHT, CONFIG, CALIBRATION)
    same(ways["impulse"], propagated(by_impulse, IMPULSE, CONTACT))
    same(ways["bounces"], propagated(by_flight, FLIGHT))
    # Of the force, the mass and the height alone, with their signs.
    gain = by_impulse(22.0 * (1 + 1e-6), 0.02) - by_impulse(22.0 * (1 - 1e-6), 0.02)
    slopes = {
        "calibration": 0.01 * gain / 2e-6,
        "mass": 0.02 * (by_impulse(22, 0.02, 2.4 + 1e-6) - by_impulse(22, 0.02, 2.4 - 1e-6)) / 2e-6,
        "drop height": 0.003
        * (by_impulse(22, 0.02, height=1.2 + 1e-6) - by_impulse(22, 0.02, height=1.2 - 1e-6))
        / 2e-6,
    }
    # Of the third order: the square of half the relative uncertainty of the mass, 0.4 %.
    for name, slope in slopes.items():
        assert shared["impulse"][name] == pytest.approx(slope, rel=2e-5)
    slope = 0.003 * (by_flight(0.7, 1.2 + 1e-6) - by_flight(0.7, 1.2 - 1e-6)) / 2e-6
    assert shared["bounces"]["drop height"] == pytest.approx(slope, rel=1e-5)
    # What the models say of the release: 0.5 ms of gravity, and a flight from 4 mm above or below.
    speed = np.sqrt(2 * 9.81 * 1.2)
    assert shared["impulse"]["slow release"] == pytest.approx(9.81 * 5e-4 / speed / np.sqrt(3))
    rise = ways["bounces"].value * speed
    flight = (rise + np.sqrt(rise**2 + 2 * 9.81 * 4e-3)) / 9.81
    longer = by_flight(flight, 1.2) - ways["bounces"].value
    assert shared["bounces"]["deformed ball"] == pytest.approx(longer / np.sqrt(3), rel=2e-3)
    for flight, config, known in (
        (FLIGHT, Config(mass=2.4), []), (None, CONFIG, ["impulse", "restitution"]),
        # An uncertainty above twice the height.
        (FLIGHT, Config(height=0.4, height_uncertainty=0.9),
         ["bounces", "effective_mass", "restitution"]),
    ):  # fmt: skip
        found, shared = measure_rebound(IMPULSE, CONTACT, flight, config)
        assert sorted(name for name in found if np.isfinite(found[name].value)) == known
        assert sorted(shared) == known


def test_mean_of_two_ways_weighs_their_whole_uncertainty() -> None:
    found, shared = measure_rebound(IMPULSE, CONTACT, FLIGHT, CONFIG, CALIBRATION)
    ways, mean = {w: found[w] for w in ("impulse", "bounces")}, found["restitution"]
    whole = {w: ways[w].uncertainty ** 2 + np.sum(np.square([*shared[w].values()])) for w in ways}
    weights = {w: 1 / whole[w] / sum(1 / one for one in whole.values()) for w in ways}
    parts = shared["restitution"]
    assert mean.value == pytest.approx(sum(weights[w] * ways[w].value for w in ways))
    assert mean.uncertainty == pytest.approx(
        np.hypot(*(weights[w] * ways[w].uncertainty for w in ways))
    )
    for name in ("calibration", "mass", "drop height"):
        expected = sum(weights[w] * shared[w].get(name, 0.0) for w in ways)
        assert parts[name] == pytest.approx(expected)


def test_effective_mass_has_the_uncertainty_of_its_parts() -> None:
    def mass(impulse: float, contact: float, flight: float) -> float:
        return impulse / (LANDING + GRAVITY * (flight / 2 + contact))

    found, _ = measure_rebound(IMPULSE, CONTACT, FLIGHT, CONFIG)
    same(found["effective_mass"], propagated(mass, IMPULSE, CONTACT, FLIGHT))


def fallen(impulse: float, flight: float) -> Drop:
    """Return a drop with both ways to its restitution."""
    force = Estimate(impulse, 0.05)
    found, shared = measure_rebound(force, CONTACT, Estimate(flight, 2e-3), CONFIG, CALIBRATION)
    return replace(
        make_drop(), impulse=force, restitutions={w: found[w] for w in ("impulse", "bounces")},
        restitution=found["restitution"], effective_mass=found["effective_mass"],
        shared_effects=shared,
    )  # fmt: skip


def test_mean_restitution_has_what_all_drops_share_and_what_differs_between_the_ways() -> None:
    found = [
        fallen(impulse, flight) for impulse, flight in ((22.0, 0.7), (22.2, 0.71), (21.9, 0.7))
    ]
    estimates = drop_estimates(found, CONFIG, CALIBRATION)
    mean, difference = estimates["restitution"], estimates["difference"]
    assert mean.value == pytest.approx(np.mean([drop.restitution.value for drop in found]))
    values = [
        drop.restitutions["impulse"].value - drop.restitutions["bounces"].value for drop in found
    ]
    assert difference.value == pytest.approx(np.mean(values))
    named = {part.name: part.uncertainty for part in difference.contributions}
    assert named["repeatability"] == pytest.approx(np.std(values, ddof=1) / np.sqrt(3))
    noise = [np.hypot(*(way.uncertainty for way in drop.restitutions.values())) for drop in found]
    assert named["noise"] == pytest.approx(np.hypot.reduce(noise) / 3)
    for name in ("calibration", "mass", "drop height"):
        shared = [drop.shared_effects for drop in found]
        expected = np.mean([s["impulse"][name] - s["bounces"].get(name, 0.0) for s in shared])
        assert named[name] == pytest.approx(abs(expected))
        expected = abs(np.mean([effects["restitution"][name] for effects in shared]))
        parts = {part.name: part.uncertainty for part in mean.contributions}
        assert parts[name] == pytest.approx(expected)
    # A rectangle from one way to the other where they differ beyond doubt.
    exact = [replace(d, shared_effects={w: {} for w in d.shared_effects}) for d in found]
    estimates = drop_estimates(exact, CONFIG, CALIBRATION)
    wrong, apart = estimates["restitution"], estimates["difference"]
    assert abs(apart.value) > apart.expanded
    parts = {part.name: part.uncertainty for part in wrong.contributions}
    assert parts["impulse against bounces"] == pytest.approx(abs(apart.value) / np.sqrt(3))
    # The calibration moves only the drops that it is part of.
    some = [found[0], replace(found[1], shared_effects={})]
    mean = drop_estimates(some, CONFIG, CALIBRATION)["restitution"]
    parts = {part.name: part.uncertainty for part in mean.contributions}
    effect = found[0].shared_effects["restitution"]["calibration"]
    assert parts["calibration"] == pytest.approx(abs(effect) / 2)


def test_mean_mass_has_calibration_and_height() -> None:
    found = [fallen(22.0, 0.7), fallen(22.2, 0.71)]
    mass = drop_estimates(found, CONFIG, CALIBRATION)["effective_mass"]
    named = {part.name: part.uncertainty for part in mass.contributions}
    assert mass.value == pytest.approx(np.mean([drop.effective_mass.value for drop in found]))
    assert named["calibration"] == pytest.approx(0.01 * mass.value)

    def at(height: float) -> float:
        # v0 e = g T/2 does not change with the height.
        speed = np.sqrt(2 * GRAVITY * height)
        return float(np.mean([
            drop.impulse.value
            / (speed + LANDING * drop.restitutions["bounces"].value + GRAVITY * CONTACT.value)
            for drop in found
        ]))  # fmt: skip

    slope = (at(1.2 + 1e-5) - at(1.2 - 1e-5)) / 2e-5
    assert named["drop height"] == pytest.approx(0.003 * abs(slope), rel=1e-3)


def test_edges_of_all_drops_share_the_smallest_uncertainty() -> None:
    times = [Estimate(0.02, 5e-5), Estimate(0.0201, 3e-5)]
    found = [replace(make_drop(), contact_time=time) for time in times]
    for ones, expected in ((found, 3e-5), (found[:1], None)):
        quantity = drop_estimates(ones, Config(), None)["contact_time"]
        named = {part.name: part.uncertainty for part in quantity.contributions}
        assert named.get("edges of the pulse") == expected


def test_peaks_are_not_counted_in_noise() -> None:
    """A peak of a tenth of the peak force counts from six deviations of the noise on."""
    drop = make_drop(rate=25600.0)
    time = np.arange(len(drop.force)) / drop.sample_rate - 0.1
    double = drop.force.max() * np.abs(np.sin(100 * np.pi * time)) * (drop.force > 0)
    band = 1250 - 1 / drop.contact_time.value
    for force, factor, expected in (
        (drop.force, 1e3, 1.0), (double, 0.99, 2.0), (double, 1.01, np.nan)
    ):  # fmt: skip
        white = (factor * 0.1 * 1500 / 6) ** 2 / band
        noisy = with_force(drop, force, white)
        counted = drop_estimates([noisy], Config(), None)["peaks"].value
        assert counted == pytest.approx(expected, nan_ok=True)


def test_noise_behind_a_drop_is_not_its_bounce() -> None:
    force, _ = make_recording(
        HALF_SINE, FINE, rate=24e3, noise_db=60, drops=((0.0, 1.0), (0.06, 0.3)), after=0.3
    )
    (drop,) = drops(force, 24e3)
    assert list(drop.restitutions) == ["impulse"]
    assert noted(drop.notes, "no_bounce").others["height"] == 1.0


def test_noise_that_runs_into_a_pulse_is_not_the_pulse() -> None:
    time = np.arange(3000) / 24e3
    hump = np.interp(time, [0.02, 0.03, 0.036, 0.043, 0.06, 0.061], [0, 20, 20, 12, 12, 0])
    noise = np.random.default_rng(0).normal(scale=10, size=len(time))
    force = half_sine(24e3, 0.06, len(time), peak=480) + hump + noise
    (window,) = cut_drops(Signal.from_array(force, 24e3, "file.wav"))
    assert (window.start + window.contact[0]) / 24e3 == pytest.approx(0.06, abs=2e-3)


def test_stated_values_have_their_stated_uncertainty() -> None:
    found = drop_estimates([make_drop()], CONFIG, None)
    assert (found["mass"].value, found["mass"].uncertainty) == (2.4, 0.02)
    assert (found["drop_height"].value, found["drop_height"].uncertainty) == (1.2, 0.003)


def test_mass_that_is_not_stated_is_measured() -> None:
    force, _ = make_recording(
        HALF_SINE, FINE, rate=24e3, noise_db=60, drops=tuple(falling(1, 0.75))
    )
    found = thud.read_recording(
        Signal.from_array(force, 24e3), config=Config(height=1.0, calibration_uncertainty=0.01)
    )
    mass = found.estimates["mass"]
    expected = 1500 * 0.02 * 2 / np.pi / (SPEED * 1.75 + 9.81 * 0.02)
    assert mass.value == pytest.approx(expected, rel=1e-3)
    assert mass.uncertainty == pytest.approx(0.01 * mass.value, rel=1e-3)
    assert any("effective mass" in str(note) for note in found.notes)


def test_hum_and_drift_are_named_and_removed() -> None:
    force, clean = make_recording(
        HALF_SINE, FINE, rate=48e3, noise_db=60, drift=100.0, hum=(60.0, 12.0), offset=-30.0,
        before=0.3, after=0.3,
    )  # fmt: skip
    (drop,) = drops(force, 48e3)
    assert noted(drop.notes, "hum_removed").others["frequency"] == 60.0
    assert noted(drop.notes, "drift_removed").value == pytest.approx(100, rel=0.2)
    touch = round(48e3 * drop.onset)
    removed = (force - clean)[touch : touch + 960].mean()
    assert noted(drop.notes, "offset_removed").value == pytest.approx(removed, abs=1)
    assert drop.contact_time.value == pytest.approx(ABOVE, abs=1e-4)
    np.testing.assert_allclose(levels(drop)[:3], ORACLE[:3], rtol=0, atol=0.05)
    assert drop.impulse.value == pytest.approx(clean.sum() / 48e3, rel=2e-3)


NOISY, _ = make_recording(HALF_SINE, FINE, rate=48e3, noise_db=60)
OVERLAPPING, _ = make_recording(
    HALF_SINE, FINE, rate=48e3, noise_db=50, drops=((0.0, 1.0), (0.021, 0.8))
)


@pytest.mark.parametrize(
    ("force", "words"),
    [
        (OVERLAPPING, naming("impacts", "N")),
        (NOISY[4900:], naming("pulse", "1 ms")),
        (NOISY[:5600], naming("pulse", "1 ms")),
    ],
    ids=["impacts that overlap", "cut at its begin", "cut at its end"],
)
def test_pulses_that_cannot_be_measured_are_refused(force: np.ndarray, words: str) -> None:
    with pytest.raises(thud.InputError, match=words):
        drops(force, 48e3)


@pytest.mark.parametrize(("duration", "clipped"), [(0.3e-3, False), (1.5e-3, True)])
@pytest.mark.parametrize("rate", [10e3, 48e3])
def test_constant_top_is_clipped_where_it_changes_levels(
    duration: float, rate: float, *, clipped: bool
) -> None:
    time = np.arange(-0.2, 0.3, 1 / rate)
    whole = 1500 * np.sin(np.pi * np.clip(time / 0.02, 0, 1))
    limit = 1500 * np.cos(np.pi * duration / 0.02 / 2)
    (section,) = cut_drops(Signal.from_array(np.minimum(whole, limit), rate))
    assert ("flat_top" in codes(repair(section).notes)) == clipped
    if not clipped:
        change = thud.force_exposure_levels(np.minimum(whole, limit), rate)
        np.testing.assert_allclose(change, thud.force_exposure_levels(whole, rate), atol=0.01)


@pytest.mark.parametrize("count", [1, 2])
def test_two_samples_at_full_scale_are_clipped(count: int) -> None:
    force, _ = make_recording(HALF_SINE, FINE, rate=48e3, noise_db=60)
    # At it are samples from 0.999 of it on.
    scale = np.sort(force)[-count] / 0.999 * (1 - 1e-9)
    (window,) = cut_drops(Hour(force, len(force), 48e3, full_scale=scale))  # type: ignore[arg-type]
    if count == 1:
        repair(window)
        return
    with pytest.raises(thud.InputError, match=naming("clip", "0.0417 ms")):
        repair(window)


def test_three_lost_samples_are_refused_and_two_are_a_spike() -> None:
    force, _ = make_recording(HALF_SINE, FINE, rate=48e3, noise_db=60)
    for count in (3, 15, 100):
        lost = force.copy()
        lost[5200 : 5200 + count] = 0
        with pytest.raises(thud.InputError, match=naming(count, "lost", "leave_out")):
            drops(lost, 48e3)
    lost = force.copy()
    lost[5200:5202] = 0.0
    (window,) = cut_drops(Signal.from_array(lost, 48e3, "file.wav"))
    assert codes(repair(window).notes) == ["spikes"]


@pytest.mark.parametrize("offset", [-3000.0, 0.0, 3000.0])
def test_held_samples_jump_by_a_part_of_the_peak_above_the_quiet(offset: float) -> None:
    # Noise would exclude held samples without a jump.
    force, _ = make_recording(HALF_SINE, FINE, rate=48e3, noise_db=110, offset=offset)
    (window,) = cut_drops(Signal.from_array(force, 48e3, "file.wav"))
    first = window.start + window.contact[0] + 200
    rise = np.diff(force[first : first + 60]).mean()
    # 4 % of 1500 N.
    for factor, refused in ((0.85, False), (1.15, True)):
        count = round(factor * 0.04 * 1500 / rise)
        held = force.copy()
        held[first : first + count] = force[first]
        (window,) = cut_drops(Signal.from_array(held, 48e3, "file.wav"))
        if refused:
            with pytest.raises(thud.InputError, match=naming(count, "lost")):
                repair(window)
        else:
            assert codes(repair(window).notes) == ["jump"]


@pytest.mark.parametrize(
    ("force", "rate", "words"),
    [
        (np.zeros(5000), 48e3, ("pulse", "40 ms")),
        (np.random.default_rng(1).normal(0, 9, 50000), 48e3, ("pulse", "40 ms")),
        (half_sine(1e3, 0.1, 300), 1e3, ("sample_rate", "1000 Hz")),
    ],
)
def test_quiet_and_low_rates_are_refused(
    force: np.ndarray, rate: float, words: tuple[str, ...]
) -> None:
    with pytest.raises(thud.InputError, match=naming(*words)):
        find_drops(Signal.from_array(force, rate))


@pytest.mark.parametrize("ratio", [3.9, 4.1])
def test_contact_is_refused_from_a_quarter_of_uncertainty_on(ratio: float) -> None:
    force, _ = make_recording(HALF_SINE, FINE, rate=24e3, noise_db=50)
    (section,) = cut_drops(Signal.from_array(force, 24e3))
    found = find_contact(section, *remove_background(section))
    time = found.end.value - found.begin.value
    # Of begin and end alike.
    ends = {
        name: replace(getattr(found, name), uncertainty=time / ratio / np.sqrt(2))
        for name in ("begin", "end")
    }
    contact = replace(found, **ends)
    if ratio > 4:
        drop = measure_drop(section, contact, Config())
        assert drop.contact_time.uncertainty == pytest.approx(drop.contact_time.value / ratio)
    else:
        with pytest.raises(thud.InputError, match=naming("contact", "noise", "ms", "1/4")):
            measure_drop(section, contact, Config())


@dataclass(frozen=True, eq=False)
class Hour:
    """A signal that repeats one drop: as long as asked for, in no memory."""

    part: np.ndarray
    n_sample: int
    sample_rate: float = 51.2e3
    name: str = "hour.wav"
    full_scale: float | None = None
    cells: tuple[Signal, ...] = ()

    def read(self, start: int, stop: int) -> np.ndarray:
        """Return samples, N."""
        return self.part[np.arange(start, stop) % len(self.part)].astype(np.float64)


def test_search_of_many_drops_is_small() -> None:
    part = half_sine(51.2e3, 1.0, int(7.2 * 51.2e3)) + 5 * np.random.default_rng(1).normal(
        size=int(7.2 * 51.2e3)
    )
    # A quarter of an hour, 350 MB as it is read: memory does not grow with the number of drops.
    hour = Hour(part.astype(np.float32), 125 * len(part))
    tracemalloc.start()
    found, _ = find_drops(hour)  # type: ignore[arg-type]
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(found) == 125
    assert most < 60e6


@pytest.mark.parametrize(
    ("name", "rates"),
    [
        # The force fades as t**1.5, and is explained neither by a line, which ends 0.3 to 0.5 ms
        # late, nor by a negative force before a release that is 1 ms late.
        ("tyre_one_mass", (48e3, 48e3, 48e3)),
        pytest.param("rubber_ball_fe", (8e3, 48e3, 96e3), marks=pytest.mark.slow),
    ],
)
def test_releases_of_forces_that_fade_are_not_late(name: str, rates: tuple[float, ...]) -> None:
    case = thud.read_case(f"inputs/{name}.nml")
    impact = thud.solve(replace(case, sampling=thud.Sampling(FINE, 0.03)))
    for seed, rate in enumerate(rates):
        force, _ = make_recording(pulse(impact), FINE, rate=rate, noise_db=50, seed=seed)
        (drop,) = drops(force, rate)
        error = drop.contact_time.value - impact.contact_time_as_recorded
        assert abs(error) < min(1e-4, 3 * drop.contact_time.uncertainty)


def test_contact_span_is_that_of_closed_forms() -> None:
    """The average of a line is the line; that of a jump counts what lies within the contact."""
    begin, end = contact_span(HALF_SINE[:-1], FINE)
    # Chord and mean of an even grid: within a hundredth of a step of the sine.
    assert (begin, 0.02 - end) == pytest.approx((0.01 / np.pi * 0.02,) * 2, abs=1e-7)
    assert contact_span(np.full(2000, 5.0), FINE) == pytest.approx((0, 1999 / FINE), abs=1e-12)
    # t**2: its mean over a width w is larger by w**2 / 12.
    ramp = (np.arange(2001) / 2000) ** 2
    assert contact_span(ramp, 1e6)[0] == pytest.approx(np.sqrt(4e-8 - 1e-8 / 12), abs=1e-8)


@pytest.mark.parametrize("rate", [4e3, 8e3, 51.2e3])
def test_peak_may_lie_between_samples(rate: float) -> None:
    """A ripple of 600 Hz at 4 kHz: the samples miss up to 1 % of the peak."""

    def force(time: np.ndarray) -> np.ndarray:
        late = time - 0.012
        main = np.where(np.abs(late) < 0.012, 750 + 750 * np.cos(np.pi * late / 0.012), 0)
        burst = np.where(np.abs(late) < 0.004, 1 + np.cos(np.pi * late / 0.004), 0)
        return np.asarray(main + 75 * burst * np.cos(2 * np.pi * 600 * late))

    for fraction in (0.0, 0.25, 0.5, 0.75):
        time = np.arange(int(0.25 * rate)) / rate - 0.1 - fraction / rate
        (drop,) = drops(force(time), rate)
        assert drop.peak_force.value == pytest.approx(1650, rel=5e-4)


def test_levels_know_hum() -> None:
    """Intervals hold with hum of 15 to 30 N in 25 to 35 ms of quiet."""
    pulls = []
    for seed in range(16):
        rng = np.random.default_rng(seed)
        before, after = rng.uniform(0.025, 0.035, 2)
        force, clean = make_recording(
            HALF_SINE, FINE, rate=16e3, noise_db=50, seed=seed, before=before, after=after,
            hum=((50.0, 60.0)[seed % 2], rng.uniform(15, 30)),
        )  # fmt: skip
        (drop,) = drops(force, 16e3)
        found = measure_levels([drop])
        pulls.append((found.level - thud.force_exposure_levels(clean, 16e3)) / found.uncertainty)
    # Sums of 16 squares, in each of five bands.
    assert (np.square(pulls).sum(axis=0) < chi2.ppf(1 - 1e-3, 16)).all(), pulls


def test_noise_that_rises_with_frequency_leaves_the_background_alone() -> None:
    white = np.random.default_rng(0).normal(scale=10, size=int(0.22 * 24e3) + 2)
    for noise in (np.diff(white)[1:], np.diff(white, 2)):
        (drop,) = drops(half_sine(24e3, 0.1, len(noise)) + noise + 12, 24e3)
        np.testing.assert_allclose(drop.contact.removed, 12, rtol=0, atol=0.01 * noise.std())
