"""Quantization of recordings: its step, the offset of a quiet background, and their effects."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import codes, noted
from synthetic import ABOVE, LEVELS, half_sine, only_section, parts, recording_of

import thud
from thud.recordings.contact import band_noise
from thud.recordings.drops import Quantization, Section
from thud.recordings.measured_drop import GRAVITY
from thud.recordings.repair import find_quantization
from thud.recordings.signal import Signal

RATE = 48_000.0
SPEED, RESTITUTION = math.sqrt(2 * GRAVITY), 0.75
MASS = 2 * 1500 * 0.02 / np.pi / (SPEED * (1 + RESTITUTION) + GRAVITY * ABOVE)
EXACT = dict.fromkeys(("mass_uncertainty", "height_uncertainty", "calibration_uncertainty"), 0.0)
# The step of 8 bit on 2 kN.
COARSE = 15.625


def record(step: float, noise: float, seed: int, count: int = 1) -> np.ndarray:
    """Return half sines on an offset, with noise, rounded to a step, N."""
    rng = np.random.default_rng(seed)
    length = round((0.2 + 1.5 * count) * RATE)
    force = rng.uniform(-50, 50) + rng.normal(scale=noise, size=length)
    for k in range(count):
        force += half_sine(RATE, 0.1 + 1.5 * k + rng.uniform(0, 1e-3), length)
    return np.rint(force / step) * step


def measured(force: np.ndarray) -> thud.Recording:
    return recording_of(force, RATE, mass=MASS, height=1.0, **EXACT)


def quantized(force: np.ndarray) -> Quantization:
    return find_quantization(only_section(force, RATE))


def offset(background: np.ndarray) -> float:
    """Return the error of the offset of a background in whole steps of 1 N."""
    contact = np.rint(100 * np.sin(np.linspace(0, np.pi, 960)))
    force = np.concatenate([background, contact, background])
    n = len(background)
    return find_quantization(Section("", force, RATE, 0, (n, n + 960))).offset


@pytest.mark.parametrize("step", [0.03, 1.0, 15.625, 156.25])
def test_step_is_the_smallest_difference(step: float) -> None:
    force = record(step, 0.01, 0)
    assert quantized(force).step == pytest.approx(step)
    assert quantized(force + 7.3).step == pytest.approx(step)
    # As floats of 32 bit, and as text with few digits.
    assert quantized(force.astype(np.float32).astype(float)).step == pytest.approx(step, rel=1e-2)
    assert quantized(np.round(1.0043 * force, 3)).step == pytest.approx(1.0043 * step, rel=0.05)


def test_continuous_values_have_no_step() -> None:
    force = half_sine(RATE, 0.1, 10_000)
    assert quantized(force).step == 0.0
    assert quantized(force + np.random.default_rng(0).normal(size=force.size)).step == 0.0
    # 24 bit on 20 kN are finer than matters.
    assert quantized(record(20_000 / 2**23, 0.001, 0)).step == 0.0


def test_background_within_a_step_has_its_error() -> None:
    assert offset(np.full(4800, 3.0)) == pytest.approx(1 / math.sqrt(12))
    # Either value half the time: in the middle between both, whatever the noise.
    assert offset(np.tile([0.0, 1.0], 2400)) == 0.0
    assert offset(np.append(np.tile([0.0, 1.0], 2400), [2.0, -1.0])) == 0.0
    # Two values that are no neighbors are a slow change.
    slow = 1 / math.sqrt(12 * (1 + math.sqrt(8)))
    assert offset(np.repeat([0.0, 2.0], 2400)) == pytest.approx(slow, rel=1e-3)
    # Noise of a step and more averages the steps.
    assert offset(np.rint(np.random.default_rng(1).normal(0.3, 1.0, 4800))) == 0.0


def test_hum_does_not_average_steps_like_noise() -> None:
    time = np.arange(4800) / RATE
    rng = np.random.default_rng(2)
    for amplitude in (2.0, 8.0):
        hum = amplitude * np.sin(2 * np.pi * 50 * time)
        slow = offset(np.rint(hum + rng.normal(0.2, 0.02, time.size)))
        span = 1 + math.sqrt(8) * amplitude / math.sqrt(2)
        assert slow == pytest.approx(1 / math.sqrt(12 * span), rel=0.15)
        assert offset(np.rint(hum + rng.normal(0.2, 0.8, time.size))) == 0.0


def test_offset_lies_within_its_deviation() -> None:
    rng = np.random.default_rng(5)
    scores = []
    for _ in range(400):
        true, noise = rng.uniform(-0.5, 0.5), 10 ** rng.uniform(-3, -0.4)
        background = np.rint(rng.normal(true, noise, 2000))
        deviation = offset(background)
        scores.append((background.mean() - true) / math.hypot(deviation, noise / math.sqrt(2000)))
    # A rectangular error is never more than sqrt(3) deviations, a known one 1.96 in 95 %.
    assert np.mean(np.abs(scores) < 1.96) > 0.93
    assert np.mean(np.square(scores)) == pytest.approx(1.0, abs=0.35)


def test_noise_that_covers_the_step_needs_no_budget() -> None:
    force = record(COARSE, 12.0, 3)
    (drop,) = measured(force).drops
    assert quantized(force).offset == 0.0
    assert not len(drop.contact.quantization_errors)
    assert not band_noise([drop], thud.get_bands())[:, :, 2].any()
    assert "coarse_steps" not in codes(drop.notes)


def test_coarse_record_has_its_budget() -> None:
    single, recording = (measured(record(COARSE, 0.5, 4, count)) for count in (1, 3))
    steps = noted(recording.drops[0].notes, "coarse_steps").others["step"]
    assert steps == pytest.approx(COARSE, abs=0.05)
    for estimate in recording.level_estimates():
        (part,) = (part for part in estimate.contributions if part.name == "quantization")
        assert part.counted
        assert part.freedom == math.inf
    # The drops share the error of the offset, which does not average out.
    alone, shared = (
        parts(one.estimates["restitution"].contributions)["quantization"]
        for one in (single, recording)
    )
    assert shared == pytest.approx(alone, rel=0.1)
    error = COARSE / math.sqrt(12) * ABOVE
    assert alone == pytest.approx(error / (MASS * SPEED), rel=0.25)
    # The error of the offset over the contact; that of its samples averages out.
    (drop,) = single.drops
    impulse = drop.contact.background.quantization.offset * drop.contact_time.value
    errors = drop.contact.quantization_errors.sum(axis=1) / drop.sample_rate
    assert errors.std() == pytest.approx(impulse, rel=0.03)


def test_effective_mass_has_the_quantization_of_the_impulse() -> None:
    force = record(COARSE, 0.5, 4)
    force[40_000:] += np.rint(half_sine(RATE, 0.05, force.size - 40_000) / 20) * COARSE
    recording = measured(force)
    (drop,), mass = recording.drops, recording.estimates["effective_mass"]
    impulse = drop.contact.background.quantization.offset * drop.contact_time.value
    expected = mass.value * impulse / drop.impulse.value
    assert parts(mass.contributions)["quantization"] == pytest.approx(expected)


def test_constant_background_next_to_a_steep_flank_is_not_lost() -> None:
    x = np.clip((np.arange(2400) / 8000 - 0.1) / 0.02, 0, 1)
    force = np.rint(1500 * np.sin(np.pi * x**0.8) / COARSE) * COARSE
    (drop,) = recording_of(force, 8000.0).drops
    assert drop.contact_time.value == pytest.approx(0.02, rel=0.05)


def test_bounce_of_a_step_has_a_touch() -> None:
    length = round(1.4 * RATE)
    force = half_sine(RATE, 0.1, length)
    force += half_sine(RATE, 0.7, length, 500.0)
    (drop,) = measured(375 * np.rint(force / 375)).drops
    assert drop.bounce == pytest.approx(0.6, abs=0.005)


def test_load_cells_add_their_steps() -> None:
    forces = [record(step, 0.01, 1) for step in (5.0, 12.0)]
    cells = tuple(Signal.from_array(force, RATE, "F") for force in forces)
    window = only_section(forces[0], RATE, cells=cells)
    both, *alone = (find_quantization(part) for part in (window, *window.cells))
    assert both.step == pytest.approx(12.0)
    assert both.offset == pytest.approx(math.hypot(*(one.offset for one in alone)))
    assert both.density == pytest.approx(sum(one.density for one in alone))


@pytest.mark.slow
@pytest.mark.parametrize(("bits", "scale"), [(8, 2e3), (12, 2e4), (10, 2e3), (16, 2e4), (24, 2e3)])
@pytest.mark.parametrize("noise", [0.05, 0.3, 1.0])
def test_quantities_lie_in_their_intervals(bits: int, scale: float, noise: float) -> None:
    # Noise in steps; no step needs more than 0.5 N of noise to be found.
    step = 2 * scale / 2**bits
    inside = []
    for seed in range(20):
        recording = measured(record(step, max(noise * step, 0.05), seed))
        known = [(recording.estimates["contact_time"], ABOVE),
                 (recording.estimates["restitution"], RESTITUTION),
                 *zip(recording.level_estimates(), LEVELS, strict=True)]  # fmt: skip
        errors = [(abs(one.value - v), one.expanded) for one, v in known if not one.upper_bound]
        inside += [error <= expanded for error, expanded in errors]
        # None is far off.
        assert all(error <= 2.5 * expanded + 1e-3 for error, expanded in errors)
    assert np.mean(inside) > 0.92
