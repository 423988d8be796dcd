"""Faults of a recorded force; damaged files are those of the campaign of tests/faults."""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import REPOSITORY, codes, naming, noted, python
from recording_files import noisy, recording_file
from synthetic import recording_of

import thud
from thud.base.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

sys.path.insert(0, str(REPOSITORY / "tests/faults"))
from injection import can_inject, injecting


@pytest.mark.skipif(not can_inject(), reason="there is no C compiler")
def test_recording_is_read_where_the_file_system_has_no_locks(tmp_path: Path) -> None:
    recording_file(tmp_path / "plate.h5")
    read = "import thud; print(len(thud.read_recording('plate.h5').drops))"
    done = python("-c", read, cwd=tmp_path, env=injecting(no_locks=1))
    assert (done.stderr, done.stdout) == ("", "1\n")


def drop_force(rate: float, power: float = 1.3, noise: float = 0.5) -> np.ndarray:
    """Return the force of a drop at 0.2 s with a contact of 18 ms, N, and white noise."""
    phase = np.clip((np.arange(round(0.6 * rate)) / rate - 0.2) / 0.018, 0, 1)
    return noisy(1500 * np.sin(np.pi * phase) ** power, noise)


@pytest.mark.parametrize("rate", [8e3, 51.2e3])
@pytest.mark.parametrize("size", [300.0, -1500.0, 10e3])
@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("after", [0.0031, 0.0092])
def test_spikes_in_a_contact_are_filled(rate: float, size: float, count: int, after: float) -> None:
    whole = drop_force(rate)
    force = whole.copy()
    first = round((0.2 + after) * rate)
    force[first : first + count] += size
    found, expected = recording_of(force, rate), recording_of(whole, rate)
    spikes = noted(found.drops[0].notes, "spikes")
    assert (spikes.value, spikes.others["count"]) == (pytest.approx(1e3 * count / rate), 1)
    # A line over three samples at 8 kHz.
    np.testing.assert_allclose(found.levels(), expected.levels(), rtol=0, atol=0.05)


def ringing(rate: float, frequency: float, size: float) -> np.ndarray:
    """Return the ringing of a plate that the touch excites, N."""
    time = np.arange(round(0.6 * rate)) / rate - 0.2
    decay = np.exp(-np.maximum(time, 0) * np.pi * frequency / 25)
    return np.where(time > 0, size * np.sin(2 * np.pi * frequency * time) * decay, 0.0)


def faultless() -> Iterator[tuple[str, float, np.ndarray]]:
    """Yield steep, noisy, ringing and coarse forces, smooth tops, hum and repeated samples."""
    for rate in (2.5e3, 8e3, 51.2e3):
        yield "kink", rate, drop_force(rate, power=1.0, noise=0.0)
        yield "foot", rate, drop_force(rate, power=2.4, noise=0.01)
        yield "noise", rate, drop_force(rate, noise=50.0)
        yield "high ringing", rate, drop_force(rate) + ringing(rate, 0.42 * rate, 30.0)
        yield "ringing", rate, drop_force(rate) + ringing(rate, 1100.0, 60.0)
        yield "coarse steps", rate, np.round(drop_force(rate, noise=8.0) / 40.0) * 40.0
    for rate, noise in product((8e3, 51.2e3), (0.0, 0.3, 10.0)):
        phase = np.clip((np.arange(round(0.6 * rate)) / rate - 0.2) / 0.018, 0, 1)
        white = noisy(np.zeros(len(phase)), noise, 3)
        for power in (2, 4, 6):
            yield f"power {power}", rate, 1500 * (1 - np.abs(2 * phase - 1) ** power) + white
        for third in (0.0, 1 / 9, 0.25):
            force = 1500 * (np.sin(np.pi * phase) + third * np.sin(3 * np.pi * phase)) + white
            yield f"humps {third:g}", rate, force if third else np.round(force / 20) * 20
    for rate, duration, begin in product((2.5e3, 3e3, 4e3, 5e3), (0.012, 0.019), range(6)):
        time = np.arange(round(0.6 * rate)) / rate
        pulse = 1600 * np.sin(np.pi * np.clip((time - 0.2) / duration, 0, 1)) ** 1.1
        force = pulse + 40 * np.sin(2 * np.pi * 50 * time + begin)
        yield f"hum {duration}", rate, np.round(force / 8) * 8
    for repeats, noise in product((1, 4), (0.0, 0.1, 0.3, 2.0)):
        force = np.repeat(np.round(drop_force(48e3 / repeats, noise=noise)), repeats)
        yield f"repeated {repeats}", 48e3, force


@pytest.mark.parametrize(
    ("rate", "force"),
    [pytest.param(*rest, id=f"{name}-{rest[0]:g}") for name, *rest in faultless()],
)
def test_forces_without_a_fault_are_not_doubted(rate: float, force: np.ndarray) -> None:
    (drop,) = recording_of(force, rate).drops
    assert not {"spikes", "flat_top", "jump"} & {*codes(drop.notes)}


@pytest.mark.parametrize("rate", [2.5e3, 8e3, 51.2e3])
def test_step_of_a_force_is_a_jump_and_no_spike(rate: float) -> None:
    step = 30.0 * (np.arange(round(0.6 * rate)) > 0.2085 * rate)
    (drop,) = recording_of(drop_force(rate) - step, rate).drops
    assert {"spikes", "jump"} & {*codes(drop.notes)} == {"jump"}


def test_force_of_finite_elements_has_no_jumps() -> None:
    rate = 51.2e3
    case = thud.read_case(REPOSITORY / "inputs/rubber_ball_fe.nml")
    impact = thud.solve(replace(case, sampling=thud.Sampling(rate, 0.03)))
    for seed in range(3):
        (drop,) = recording_of(noisy(np.pad(impact.floor_force, 5000), 1, seed), rate).drops
        assert "jump" not in codes(drop.notes)


@pytest.mark.parametrize("rate", [8e3, 51.2e3])
@pytest.mark.parametrize("limit", [1450.0, 1200.0, 1000.0])
@pytest.mark.parametrize("step", [0.0, 0.3])
def test_force_that_an_amplifier_clips_is_named(rate: float, limit: float, step: float) -> None:
    force = noisy(np.minimum(drop_force(rate, noise=0.0), limit), 0.3, 2)
    force = np.round(force / step) * step if step else force
    (drop,) = recording_of(force, rate).drops
    assert noted(drop.notes, "flat_top").value == pytest.approx(limit, rel=0.01)


@pytest.mark.parametrize("step", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("after", [0.0065, 0.0105])
@pytest.mark.parametrize("value", [None, 0.0])
@pytest.mark.parametrize("count", [6, 40])
def test_lost_samples_are_named(step: float, after: float, value: float | None, count: int) -> None:
    force = drop_force(48e3, noise=0.3)
    force = np.round(force / step) * step if step else force
    first = round((0.2 + after) * 48e3) - 20
    force[first : first + count] = force[first] if value is None else value
    if value is None and count == 6:  # it jumps by less than 4 % of the peak
        assert recording_of(force, 48e3).drops
        return
    with pytest.raises(InputError, match=naming(f"{count} samples", "leave_out")):
        recording_of(force, 48e3)
