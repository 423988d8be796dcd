"""Drops of a signal: found, split, measured."""

from __future__ import annotations

import tracemalloc
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import codes, noted
from recording_files import noisy
from scipy.stats import chi2
from synthetic import (
    ABOVE,
    FINE,
    HALF_SINE,
    LEVELS,
    band_limited,
    cut_drops,
    half_sine,
    half_sines,
    make_drop,
    make_recording,
    only_section,
    parts,
    recording_of,
    uncertain_contact,
    with_force,
)

import thud
from thud.impact.contact_time import contact_span
from thud.level.estimate import Estimate
from thud.recordings.config import Config
from thud.recordings.drops import find_drops
from thud.recordings.measured_drop import GRAVITY, Drop, measure_drop, measure_rebound
from thud.recordings.quantities import drop_estimates
from thud.recordings.recorded_levels import measure_levels
from thud.recordings.repair import repair
from thud.recordings.signal import Signal

SPEED = np.sqrt(2 * 9.81)


def drops(force: np.ndarray, rate: float, **stated: float | None) -> tuple[Drop, ...]:
    """Return the drops of a ball of 2.5 kg from 1 m."""
    return recording_of(force, rate, **{"height": 1.0, "mass": 2.5} | stated).drops


def falling(flights: int, restitution: float = 0.8, part: float = 1.0) -> list[tuple[float, float]]:
    """Return times since first touch and factors of the bounces of a drop."""
    at, series = 0.0, []
    for _ in range(flights):
        part *= restitution
        at += 0.02 + 2 * SPEED * part / 9.81
        series.append((at, part))
    return series


@pytest.mark.parametrize("before", [0.01, 0.1])
def test_noise_of_5_n_does_not_stretch_the_contact(flagship: thud.Impact, before: float) -> None:
    # A threshold of 1 % reads 34 ms with 10 ms of quiet, and 171 to 245 ms with 100 ms.
    truth, rate = flagship.contact_time_as_recorded, flagship.sample_rate
    pulse = flagship.floor_force[: int(flagship.exact_contact_time * rate) + 2]
    how = {"noise_db": 20 * np.log10(1609 / 5), "before": before, "after": before}
    for seed in range(5):
        force, _ = make_recording(pulse, rate, seed=seed, **how)
        (drop,) = drops(force, rate)
        assert drop.contact_time.value == pytest.approx(truth, abs=1e-4)
        assert abs(drop.contact_time.value - truth) < 3 * drop.contact_time.uncertainty
        assert drop.noise == pytest.approx(5, rel=0.3 if before < 0.05 else 0.1)


@pytest.mark.parametrize("gap", [0.03, 0.1, 3.0])
def test_two_impacts_in_a_file_are_two_drops(gap: float) -> None:
    force = half_sines(48e3, 50, (0.02 + gap, 1.0))
    found = drops(force, 48e3)
    assert [drop.name for drop in found] == ["file.wav, drop 1", "file.wav, drop 2"]
    assert found[1].onset - found[0].onset == pytest.approx(0.02 + gap, abs=2e-4)
    for drop in found:
        assert drop.contact_time.value == pytest.approx(ABOVE, abs=1e-4)
        assert drop.bounce is None
    # No window reaches closer than 2 ms to the pulse of the other.
    one, two = cut_drops(Signal.from_array(force, 48e3))
    assert one.start + len(one.force) <= two.start + two.contact[0] - 96
    assert two.start >= one.start + one.contact[1] + 96


@pytest.mark.parametrize("rate", [2.5e3, 5e3, 8e3, 11025.0, 16e3, 44.1e3, 51.2e3, 96e3])
def test_filtered_half_sine_has_the_levels_of_the_pulse(rate: float) -> None:
    time = np.arange(int(0.25 * rate)) / rate - 0.1003
    (drop,) = drops(band_limited(HALF_SINE, FINE, rate, time) + 20.0, rate)
    np.testing.assert_allclose(drop.levels(), LEVELS, rtol=0, atol=1e-3)


def test_bounces_are_told_from_drops() -> None:
    second = [(6.0 + at, part) for at, part in ((0.0, 0.99), *falling(4, part=0.99))]
    force = half_sines(24e3, 50, *falling(4), *second)
    for drop, part in zip(drops(force, 24e3), (1.0, 0.99), strict=True):
        assert drop.bounce == pytest.approx(falling(1, part=part)[0][0], abs=3e-4)
        by = drop.restitutions["bounces"]
        assert by.value == pytest.approx(0.8 * part, abs=3e-4)
        assert abs(by.value - 0.8 * part) < 4 * by.uncertainty
    (without,) = drops(force[: int(5 * 24e3)], 24e3, height=None)
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
    (drop,) = drops(noisy(force, 1), rate, mass=mass)
    assert sorted(drop.restitutions) == ["bounces", "impulse"]
    for estimate in drop.restitutions.values():
        assert estimate.value == pytest.approx(restitution, abs=1.5e-3)


def test_disagreement_of_impulse_and_bounces_is_not_averaged_away() -> None:
    force = half_sines(24e3, 60, *falling(2, 0.75))
    momentum = 1500 * 0.02 * 2 / np.pi
    fits = momentum / (1.75 * SPEED + 9.81 * 0.02)
    alike = recording_of(force, 24e3, height=1.0, mass=fits)
    assert "impulse against bounces" not in parts(alike.estimates["restitution"].contributions)
    assert "restitutions_differ" not in codes(alike.notes)
    found = recording_of(force, 24e3, height=1.0, mass=2.5)
    mean = found.estimates["restitution"]
    ways = [way.value for way in found.drops[0].restitutions.values()]
    apart = parts(mean.contributions)["impulse against bounces"]
    assert apart == pytest.approx(abs(np.subtract(*ways)) / np.sqrt(3))
    assert mean.value - mean.expanded <= min(ways) < max(ways) <= mean.value + mean.expanded
    assert noted(found.notes, "restitutions_differ").others["mass"] == pytest.approx(fits, rel=1e-3)
    # A mass that is not stated is measured.
    found = recording_of(force, 24e3, height=1.0, calibration_uncertainty=0.01)
    mass = found.estimates["mass"]
    assert mass.value == pytest.approx(fits, rel=1e-3)
    assert mass.uncertainty == pytest.approx(0.01 * mass.value, rel=1e-3)
    assert "effective_mass" in codes(found.notes)


IMPULSE, CONTACT, FLIGHT = Estimate(22.0, 0.05), Estimate(0.02, 2e-4), Estimate(0.7, 2e-3)
CONFIG = Config(height=1.2, mass=2.4, mass_uncertainty=0.02, height_uncertainty=0.003)
CALIBRATION = 0.01
NOISE = {"impulse": 0.05, "contact": 2e-4, "flight": 2e-3}
# A release that is up to 0.5 ms late, and a flight from up to 4 mm above or below.
SHARED = {
    "calibration": CALIBRATION, "mass": 0.02, "drop height": 0.003,
    "slow release": 5e-4 / np.sqrt(3), "deformed ball": 4e-3 / np.sqrt(3),
}  # fmt: skip
WAYS = ("impulse", "bounces")


def rebound(quantity: str, **changes: float) -> float:
    """Return a quantity of a contact by its closed form, of changed inputs."""
    change = dict.fromkeys([*NOISE, *SHARED], 0.0) | changes
    mass, speed = 2.4 + change["mass"], np.sqrt(2 * GRAVITY * (1.2 + change["drop height"]))
    momentum = (22.0 + change["impulse"]) * (1 + change["calibration"])
    contact = 0.02 + change["contact"]
    rise = GRAVITY * (0.7 + change["flight"]) / 2
    if quantity == "impulse":
        # Of the momentum before and after: (J - m g t_c)/(m v0) - 1.
        return float((momentum / mass - GRAVITY * (contact - change["slow release"])) / speed - 1)
    if quantity == "bounces":
        # A ball that flies for T from the floor comes back with the velocity g T/2.
        height = change["deformed ball"]
        return float((rise + np.sqrt(rise**2 + 2 * GRAVITY * height)) / 2 / speed)
    return float(momentum / (speed + rise + GRAVITY * contact))


def changes_of(quantity: str) -> dict[str, float]:
    """Return the changes of a quantity by standard uncertainties (JCGM 100, 5.1.2)."""
    found = {}
    for name, size in (NOISE | SHARED).items():
        high, low = (rebound(quantity, **{name: side * size}) for side in (1e-3, -1e-3))
        found[name] = (high - low) / 2e-3
    return found


def test_rebound_has_the_uncertainty_of_its_inputs() -> None:
    found, shared = measure_rebound(IMPULSE, CONTACT, FLIGHT, CONFIG, CALIBRATION)
    expected = {name: changes_of(name) for name in (*WAYS, "effective_mass")}
    values = {name: rebound(name) for name in expected}
    # The mean weighs the ways by their whole uncertainty.
    weights = np.array([1 / np.sum(np.square([*expected[way].values()])) for way in WAYS])
    for name, factors in (("restitution", weights / weights.sum()), ("difference", [1, -1])):
        values[name] = float(np.dot(factors, [values[way] for way in WAYS]))
        expected[name] = {
            cause: float(np.dot(factors, [expected[way][cause] for way in WAYS]))
            for cause in NOISE | SHARED
        }
    assert set(found) == set(shared) == set(expected)
    for name, changes in expected.items():
        assert found[name].value == pytest.approx(values[name])
        noise = np.hypot.reduce([changes[cause] for cause in NOISE])
        assert found[name].uncertainty == pytest.approx(noise, rel=1e-5)
        assert set(shared[name]) == {cause for cause in SHARED if abs(changes[cause]) > 1e-12}
        for cause, effect in shared[name].items():
            # Of the third order: the square of half the relative uncertainty of the mass, 0.4 %,
            # and of the second in the height of the flight.
            rel = 2e-3 if cause == "deformed ball" else 3e-5
            assert effect == pytest.approx(changes[cause], rel=rel)


@pytest.mark.parametrize(
    ("flight", "config", "known"),
    [
        (FLIGHT, Config(mass=2.4), set()),
        (None, CONFIG, {"impulse", "restitution"}),
        # An uncertainty above twice the height.
        (FLIGHT, Config(height=0.4, height_uncertainty=0.9),
         {"bounces", "effective_mass", "restitution"}),
    ],
)  # fmt: skip
def test_rebound_is_known_as_far_as_stated(flight: Any, config: Config, known: set[str]) -> None:  # noqa: ANN401
    found, shared = measure_rebound(IMPULSE, CONTACT, flight, config)
    assert {name for name in found if np.isfinite(found[name].value)} == set(shared) == known


def test_means_have_what_all_drops_share() -> None:
    fallen, rebounds = [], []
    for momentum, time in ((22.0, 0.7), (22.2, 0.71), (21.9, 0.7)):
        force, flight = replace(IMPULSE, value=momentum), replace(FLIGHT, value=time)
        own, shared = measure_rebound(force, CONTACT, flight, CONFIG, CALIBRATION)
        fallen.append(replace(
            make_drop(), impulse=force, restitutions={way: own[way] for way in WAYS},
            restitution=own["restitution"], effective_mass=own["effective_mass"],
            shared_effects=shared,
        ))  # fmt: skip
        rebounds.append(own)
    estimates = drop_estimates(fallen, CONFIG, CALIBRATION)
    for name in ("restitution", "difference", "effective_mass"):
        values = [own[name].value for own in rebounds]
        noise = [own[name].uncertainty for own in rebounds]
        named = parts(estimates[name].contributions)
        assert estimates[name].value == pytest.approx(np.mean(values))
        assert named["repeatability"] == pytest.approx(np.std(values, ddof=1) / np.sqrt(3))
        assert named["noise"] == pytest.approx(np.hypot.reduce(noise) / 3)
        for cause in ("calibration", "mass", "drop height"):
            effects = [drop.shared_effects[name].get(cause, 0.0) for drop in fallen]
            assert named.get(cause, 0.0) == pytest.approx(abs(np.mean(effects)))
    # The calibration moves only the drops that it is part of.
    some = [fallen[0], replace(fallen[1], shared_effects={})]
    mean = drop_estimates(some, CONFIG, CALIBRATION)["restitution"]
    effect = fallen[0].shared_effects["restitution"]["calibration"]
    assert parts(mean.contributions)["calibration"] == pytest.approx(abs(effect) / 2)


def test_edges_of_all_drops_share_the_smallest_uncertainty() -> None:
    times = [Estimate(0.02, 5e-5), Estimate(0.0201, 3e-5)]
    found = [replace(make_drop(), contact_time=time) for time in times]
    for ones, expected in ((found, 3e-5), (found[:1], None)):
        estimates = drop_estimates(ones, CONFIG, None)
        named = parts(estimates["contact_time"].contributions)
        assert named.get("edges of the pulse") == expected
        # Stated values have their stated uncertainty.
        assert (estimates["mass"].value, estimates["mass"].uncertainty) == (2.4, 0.02)
        height = estimates["drop_height"]
        assert (height.value, height.uncertainty) == (1.2, 0.003)


def test_peaks_are_not_counted_in_noise() -> None:
    """A peak of a tenth of the peak force counts from six deviations of the noise on."""
    drop = make_drop(rate=25600.0)
    time = np.arange(len(drop.force)) / drop.sample_rate - 0.1
    one = drop.force
    double = one.max() * np.abs(np.sin(100 * np.pi * time)) * (one > 0)
    band = 1250 - 1 / drop.contact_time.value
    for force, factor, expected in ((one, 1e3, 1.0), (double, 0.99, 2.0), (double, 1.01, np.nan)):
        loud = with_force(drop, force, (factor * 0.1 * 1500 / 6) ** 2 / band)
        counted = drop_estimates([loud], Config(), None)["peaks"].value
        assert counted == pytest.approx(expected, nan_ok=True)


def test_noise_behind_a_drop_is_not_its_bounce() -> None:
    (drop,) = drops(half_sines(24e3, 60, (0.06, 0.3), after=0.3), 24e3)
    assert list(drop.restitutions) == ["impulse"]
    assert noted(drop.notes, "no_bounce").others["height"] == 1.0


def test_noise_that_runs_into_a_pulse_is_not_the_pulse() -> None:
    time = np.arange(3000) / 24e3
    hump = np.interp(time, [0.02, 0.03, 0.036, 0.043, 0.06, 0.061], [0, 20, 20, 12, 12, 0])
    window = only_section(noisy(half_sine(24e3, 0.06, 3000, peak=480) + hump, 10, 0), 24e3)
    assert (window.start + window.contact[0]) / 24e3 == pytest.approx(0.06, abs=2e-3)


@pytest.mark.parametrize(("duration", "clipped"), [(0.3e-3, False), (1.5e-3, True)])
@pytest.mark.parametrize("rate", [10e3, 48e3])
def test_top_is_clipped_where_levels_change(duration: float, rate: float, *, clipped: bool) -> None:
    time = np.arange(-0.2, 0.3, 1 / rate)
    whole = 1500 * np.sin(np.pi * np.clip(time / 0.02, 0, 1))
    cut = np.minimum(whole, 1500 * np.cos(np.pi * duration / 0.02 / 2))
    assert ("flat_top" in codes(repair(only_section(cut, rate)).notes)) == clipped
    change = np.subtract(*(thud.force_exposure_levels(force, rate) for force in (cut, whole)))
    assert (np.abs(change).max() > 0.01) == clipped


def test_one_sample_at_full_scale_is_not_clipped() -> None:
    force = half_sines(48e3, 60)
    section = only_section(force, 48e3, full_scale=force.max() / 0.9990001)
    assert codes(repair(section).notes) == []


@pytest.mark.parametrize("offset", [-3000.0, 0.0, 3000.0])
def test_held_samples_jump_by_a_part_of_the_peak_above_the_quiet(offset: float) -> None:
    # Noise would exclude held samples without a jump.
    force = half_sines(48e3, 110, offset=offset)
    window = only_section(force, 48e3)
    first = window.start + window.contact[0] + 200
    rise = np.diff(force[first : first + 60]).mean()
    # 4 % of 1500 N.
    lost: Any = pytest.raises(thud.InputError, match="lost")
    for factor, refusal in ((0.85, nullcontext()), (1.15, lost)):
        held = force.copy()
        held[first : first + round(factor * 0.04 * 1500 / rise)] = force[first]
        with refusal:
            assert codes(repair(only_section(held, 48e3)).notes) == ["jump"]


def test_contact_is_measured_up_to_a_quarter_of_uncertainty() -> None:
    section, contact = uncertain_contact(4.1)
    time = measure_drop(section, contact, Config()).contact_time
    assert time.uncertainty == pytest.approx(time.value / 4.1)


def test_search_of_many_drops_is_small() -> None:
    length = int(7.2 * 51.2e3)
    part = noisy(half_sine(51.2e3, 1.0, length), 5).astype(np.float32)
    # A quarter of an hour, 350 MB as it is read: memory does not grow with the number of drops.
    hour = Signal(
        "hour.wav", "", 51.2e3, 125 * length,
        lambda start, stop: part[np.arange(start, stop) % length].astype(np.float64),
    )  # fmt: skip
    tracemalloc.start()
    found, _ = find_drops(hour)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(found) == 125
    assert most < 60e6


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
    for fraction in (0.0, 0.25, 0.5, 0.75):
        late = np.arange(int(0.25 * rate)) / rate - 0.112 - fraction / rate
        main = np.where(np.abs(late) < 0.012, 750 + 750 * np.cos(np.pi * late / 0.012), 0)
        burst = np.where(np.abs(late) < 0.004, 1 + np.cos(np.pi * late / 0.004), 0)
        (drop,) = drops(main + 75 * burst * np.cos(2 * np.pi * 600 * late), rate)
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
        found = measure_levels(drops(force, 16e3))
        pulls.append((found.level - thud.force_exposure_levels(clean, 16e3)) / found.uncertainty)
    # Sums of 16 squares, in each of five bands.
    assert (np.square(pulls).sum(axis=0) < chi2.ppf(1 - 1e-3, 16)).all(), pulls


def test_noise_that_rises_with_frequency_leaves_the_background_alone() -> None:
    white = np.random.default_rng(0).normal(scale=10, size=int(0.22 * 24e3) + 2)
    for noise in (np.diff(white)[1:], np.diff(white, 2)):
        (drop,) = drops(half_sine(24e3, 0.1, len(noise)) + noise + 12, 24e3)
        np.testing.assert_allclose(drop.contact.removed, 12, rtol=0, atol=0.01 * noise.std())
