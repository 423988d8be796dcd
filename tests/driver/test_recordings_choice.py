"""Which pulses are drops, and which drops are measured."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import codes, noted
from synthetic import half_sine, recording_of

from thud.recordings.config import Config
from thud.recordings.drops import find_drops
from thud.recordings.signal import Signal

# Rate, Hz, and length of records.
RATE, LENGTH = 8_000.0, 128_000


def pulse(begin: float, peak: float = 1500.0, duration: float = 0.02) -> np.ndarray:
    """Return a half sine, N, that begins at a time, s, in a record of 16 s."""
    return half_sine(RATE, begin, LENGTH, peak, duration)


def three_drops(bounces: int = 2) -> np.ndarray:
    """Return the force of drops at 5, 8.5 and 12 s with their bounces, N."""
    force = np.random.default_rng(4).normal(scale=1.0, size=LENGTH)
    for begin in (5.0, 8.5, 12.0):
        touch, flight = begin, 0.7
        for k in range(bounces + 1):
            force += pulse(touch, 1500 * 0.8**k)
            touch, flight = touch + 0.02 + flight, 0.8 * flight
    return force


TIME = np.arange(LENGTH) / RATE


def footstep(begin: float, weight: float = 800.0) -> np.ndarray:
    """Return the force of a step of 0.6 s, with the blow of the heel, N."""
    phase = np.clip((TIME - begin) / 0.6, 0, 1)
    roll = weight * np.sin(np.pi * phase) ** 0.5 * (1 - 0.25 * np.sin(np.pi * phase) ** 8)
    return np.asarray(roll + pulse(begin, 0.6 * weight, 0.025))


def handling() -> np.ndarray:
    random = np.random.default_rng(9)
    begins = random.uniform(0.5, 4, 20)
    return np.sum([pulse(t, random.uniform(20, 150), random.uniform(0.005, 0.04)) for t in begins],
                  axis=0)  # fmt: skip


@pytest.mark.parametrize(
    ("disturbance", "is_tap"),
    [
        pytest.param(0 * TIME, False, id="none"),
        pytest.param(footstep(1.0) + footstep(2.1), False, id="footsteps"),
        pytest.param(handling(), False, id="handling"),
        pytest.param(800 * np.clip((2.0 - TIME) / 0.15, 0, 1), False, id="man steps off"),
        pytest.param(
            np.sum([pulse(t, 60 if t < 2 else 150, 0.006) for t in (1.0, 2.0, 7.7, 11.0)], axis=0),
            True, id="taps",
        ),
        pytest.param(pulse(5.3, 120, 0.008), True, id="tap between bounces"),
        # Spikes of one sample.
        *(pytest.param(1e6 * (int(t * RATE) == np.arange(LENGTH)), False, id=f"spike at {t} s")
          for t in (2.0, 8.507)),
    ],
)  # fmt: skip
def test_only_drops_are_drops(disturbance: np.ndarray, *, is_tap: bool) -> None:
    drops, ignored = find_drops(Signal.from_array(three_drops() + disturbance, RATE))
    assert [len(drop.bounces) for drop in drops] == [2, 2, 2]
    for drop, begin in zip(drops, (5.0, 8.5, 12.0), strict=True):
        assert drop.contact[0] / RATE == pytest.approx(begin, abs=0.004)
        assert drop.bounces[0].contact[0] / RATE == pytest.approx(begin + 0.72, abs=0.004)
    assert not is_tap or {*codes(ignored)} == {"pulse_ignored"}


def test_drops_are_chosen_by_number_and_time() -> None:
    """A small drop keeps its number, and is left out unless it is chosen."""
    force = three_drops(bounces=1) + pulse(3.0, 300) + pulse(14.0, 300) + pulse(15.5)
    for choice, onsets in (
        ({}, [5.0, 8.5, 12.0, 15.5]),
        ({"drops": "2, 6"}, [5.0, 15.5]),
        ({"drops": "1, 4-6"}, [3.0, 12.0, 14.0, 15.5]),
        ({"leave_out": {"3": "touched"}}, [5.0, 12.0, 15.5]),
        ({"begin": 7.0}, [8.5, 12.0, 15.5]),
        ({"end": 4.0}, [3.0]),
        ({"begin": 13.0, "end": 15.0}, [14.0]),
    ):
        recording = recording_of(force, RATE, **choice)  # type: ignore[arg-type]
        assert [round(drop.onset, 1) for drop in recording.drops] == onsets
        if not choice:
            small = [note for note in recording.notes if note.code == "drop_too_small"]
            assert [note.value for note in small] == [1, 5]
            times = [note.others["time"] for note in small]
            assert times == pytest.approx([3.0, 14.0], abs=0.005)
        elif "leave_out" in choice:
            note = noted(recording.notes, "drop_left_out")
            assert (note.value, note.others["reason"]) == (3, "touched")
            assert note.others["time"] == pytest.approx(8.5, abs=0.005)


def test_bounce_is_no_drop_of_a_section_that_begins_before_it() -> None:
    # The first bounce of the drop at 5 s lands at 5.72 s.
    recording = recording_of(three_drops(), RATE, begin=5.4)
    assert [round(drop.onset, 1) for drop in recording.drops] == [8.5, 12.0]
    assert noted(recording.notes, "section_searched").low == 5.4
    bounce = next(note for note in recording.notes if note.code == "bounce_ignored")
    assert bounce.others["time"] == pytest.approx(5.72, abs=0.03)


def test_drops_left_out_by_an_argument_join_those_of_the_configuration() -> None:
    config = Config(leave_out={"3": "touched"}).updated(leave_out={"1": "noise"})
    assert config.leave_out == {"3": "touched", "1": "noise"}


def test_impossible_restitution_is_a_warning() -> None:
    for scale, is_impossible in ((0.5, True), (1.0, False), (2.0, True)):
        # The impulse is 19.1 N s: with 2.5 kg and 1 m the restitution is 0.68.
        recording = recording_of(scale * three_drops(bounces=0), RATE, mass=2.5, height=1.0)
        assert ("restitution_impossible" in codes(recording.notes)) == is_impossible
