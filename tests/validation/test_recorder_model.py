"""The recorder model against closed forms, and one record of each part of its bench."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import scipy.signal
import soundfile
from threadpoolctl import threadpool_limits

from thud.base.note import Note
from thud.impact.contact_time import contact_span
from thud.level.levels import low_pass

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))
import recorder
from recorder_conditions import Condition, conditions
from recorder_model import (
    FINE_RATE,
    GRAVITY,
    KINDS,
    Ball,
    Cells,
    Chain,
    Filter,
    Mode,
    Pulse,
    SinePower,
    bounces,
    convert,
    droop,
    drop_pulse,
    half_cosine,
    plate_response,
    write_sound,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

# Threads only wait for each other in products of this size.
pytestmark = pytest.mark.usefixtures("one_thread")
CONDITIONS = conditions()
FREQUENCIES = np.linspace(5.0, 1250.0, 60)


@pytest.fixture(scope="module")
def one_thread() -> Iterator[None]:
    """Limit BLAS to one thread."""
    with threadpool_limits(1, "blas"):
        yield


@pytest.mark.parametrize("kind", KINDS)
def test_closed_transform_of_a_pulse_is_that_of_its_samples(kind: str) -> None:
    ball = Ball(restitution=0.8, deformation=0.002)
    pulse, truth = drop_pulse(kind, ball, np.random.default_rng(3))
    step = 1e-6
    time = np.arange(0, pulse.duration, step)
    waves = np.exp(-2j * np.pi * np.outer(FREQUENCIES, time))
    errors = np.abs(pulse.transform(FREQUENCIES) - waves @ pulse.force(time) * step)
    assert errors.max() < 1e-6 * truth.impulse
    # The impulse is the change of momentum, and the weight of the ball during the contact.
    change = ball.mass * (ball.velocity * (1 + ball.restitution) + GRAVITY * pulse.duration)
    assert math.isclose(truth.impulse, change, rel_tol=1e-9)
    rate = 1e6
    force = pulse.force(np.arange(int(pulse.duration * rate) + 2) / rate)
    begin, end = contact_span(force, rate)
    assert abs(end - begin - truth.contact_time) < 1e-7
    peak = low_pass(np.pad(force[::10], 2000), rate / 10).max()
    assert abs(peak / truth.peak - 1) < 1e-3
    assert 8 <= truth.levels[4] <= 15.5


def test_levels_of_a_half_sine() -> None:
    pulse = Pulse(0.02, ((1500.0, SinePower(0.02, 1.0)),))
    np.testing.assert_allclose(pulse.levels(), [38.313, 30.605, 19.258, 8.932, -0.439], atol=6e-4)
    # sin(pi t / T) = 1 %
    begin, end = pulse.contact()
    assert abs(end - begin - 0.02 * (1 - 2 * math.asin(0.01) / math.pi)) < 1e-8


def test_plate_is_an_oscillator_in_time() -> None:
    omega, quality = 2 * np.pi * 1200.0, 8.0
    chain = Chain(200e3, (Mode(1200.0, quality),), Filter("butterworth", 1, 1e9))
    tap = half_cosine(0.004, 100.0)
    first, samples = chain.pass_pulse(tap, 0.1)
    time = np.arange(2000) / FINE_RATE
    plate = ([omega**2], [1.0, omega / quality, omega**2])
    expected = scipy.signal.lsim(plate, tap.force(time), time)[1]
    begin = round(0.1 * chain.rate) - first
    np.testing.assert_allclose(samples[begin : begin + len(time)], expected, atol=0.02)
    # Static deformation of several modes together.
    modes = (Mode(1000.0, 5.0, 0.7), Mode(2000.0, 9.0, 0.3))
    assert abs(plate_response(modes, np.zeros(1))[0] - 1) < 1e-12


def test_droop_of_a_step_is_exponential() -> None:
    expected = np.exp(-np.arange(5000) / 1e3 / 2.0)
    np.testing.assert_allclose(droop(np.ones(5000), 1e3, 2.0), expected, rtol=5e-4)


def test_flight_ends_where_the_center_returns() -> None:
    ball = Ball(restitution=0.8, deformation=0.002)
    pulse, _ = drop_pulse("sine", ball, np.random.default_rng(5))
    (touch, bounce), (second, _) = bounces(pulse, ball, 2)
    flight = touch - pulse.duration
    height = -ball.deformation + 0.8 * ball.velocity * flight - GRAVITY / 2 * flight**2
    assert abs(height) < 1e-12
    assert second > touch + bounce.duration
    assert bounce.impulse < pulse.impulse


@pytest.mark.parametrize("bits", [8, 12, 16, 24])
def test_files_hold_the_codes(bits: int, tmp_path: Path) -> None:
    force, step = np.array([-5.0, 0.0, 12.4, 999.0, 5000.0]), 1000 / 2 ** (bits - 1)
    chain = Chain(bits=bits, full_scale=1000.0)
    values = soundfile.read(write_sound(tmp_path / "a.wav", convert(force, chain), chain))[0] * 1000
    expected = np.rint(np.minimum(force, 1000 - step) / step) * step
    np.testing.assert_allclose(values, expected, atol=1e-9)


def test_shares_of_load_cells_add_to_one() -> None:
    assert abs(Cells().shares().sum() - 1) < 1e-12


@pytest.mark.parametrize(
    ("value", "is_silent", "is_inside"),
    [
        (recorder.Value(0.5, 0.01), True, False),
        (recorder.Value(0.5, 0.01, concerned=True), False, False),
        (recorder.Value(0.5, 0.2), False, False),
        (recorder.Value(0.05, 0.001), False, False),
        # One degree of freedom: the quantile of 97.5 % is 12.7.
        (recorder.Value(0.126, 0.01, freedom=1), False, True),
        (recorder.Value(0.128, 0.01, freedom=1), False, False),
    ],
)
def test_material_errors_are_silent_unless_a_warning_concerns_them(
    value: recorder.Value, *, is_silent: bool, is_inside: bool
) -> None:
    assert (value.is_silent("500 Hz"), value.is_inside()) == (is_silent, is_inside)


@pytest.mark.parametrize(
    ("note", "quantities"),
    [
        (Note("plate_rings"), {*recorder.LEVELS, "peak", "contact"}),
        (Note("uncertainty_not_stated", others={"names": "mass, drop height"}), {"restitution"}),
        (Note("short_background"), set(recorder.MATERIAL)),
    ],
)
def test_warnings_concern_quantities(note: Note, quantities: set[str]) -> None:
    assert recorder.concern(note) == quantities


@pytest.mark.parametrize(
    ("inside", "count", "met"),
    [(95, 100, True), (90, 100, True), (100, 100, True), (88, 100, False), (500, 500, False)],
)
def test_coverage_is_met_within_chance(inside: int, count: int, *, met: bool) -> None:
    values = [recorder.Value(1.0, 1.0 if k < inside else 0.1) for k in range(count)]
    outcomes = [recorder.Outcome(CONDITIONS[0], 0, {"peak": value}) for value in values]
    assert [one for _, one in recorder.coverage(outcomes)] == [met]


@pytest.mark.parametrize("group", {condition.group: 0 for condition in CONDITIONS})
def test_each_part_is_measured(group: str) -> None:
    condition = next(one for one in CONDITIONS if one.group == group)
    outcome = recorder.measure(condition, 0)
    assert outcome.values or (outcome.refusal and condition.may_be_refused)
    if condition.is_stated:
        # Nothing is grossly off, whether or not it is inside its interval.
        assert all(abs(value.error) < 1 for value in outcome.values.values()), outcome
    assert not outcome.silent
    assert len(list(recorder.summary([outcome]))) == 3


FAULTS = [condition for condition in CONDITIONS if condition.group == "samples"]
CLEAN = [
    Condition("clean", name, is_stated=is_stated, chain=Chain(25_600.0), filter_stated=is_stated)
    for name, is_stated in (("none", True), ("none, filter not stated", False))
]


@pytest.mark.parametrize("condition", [*FAULTS, *CLEAN], ids=lambda one: one.name)
def test_faults_of_samples_are_not_silent_and_nothing_else_is_one(condition: Condition) -> None:
    for seed in range(2):
        outcome = recorder.measure(condition, seed)
        assert not outcome.silent
        said = " ".join((*outcome.warnings, outcome.refusal))
        assert any(cause in said for cause in condition.cause.split("|")), (seed, said)
        if condition in CLEAN:
            assert set(said.split()) <= {"no_bounce", "peaks_unknown", "filter_assumed"}
