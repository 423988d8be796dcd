"""Which pulses are drops, and which drops are measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import synthetic
from conftest import codes, noted

import thud
from thud.recordings.config import Config
from thud.recordings.drops import Pulse, find_drops
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    from thud.base.note import Note

RATE = 8_000.0


def half_sine(time: np.ndarray, begin: float, peak: float, duration: float = 0.02) -> np.ndarray:
    """Return a half sine, N, that begins at a time, s."""
    return synthetic.half_sine(RATE, begin, len(time), peak, duration)


def three_drops(seconds: float = 16.0, bounces: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Return time, s, and force, N, of drops at 5, 8.5 and 12 s with their bounces."""
    time = np.arange(int(seconds * RATE)) / RATE
    force = np.random.default_rng(4).normal(scale=1.0, size=len(time))
    for begin in (5.0, 8.5, 12.0):
        touch, flight = begin, 0.7
        for k in range(bounces + 1):
            force += half_sine(time, touch, 1500 * 0.8**k)
            touch, flight = touch + 0.02 + flight, 0.8 * flight
    return time, force


def footstep(time: np.ndarray, begin: float, weight: float = 800.0) -> np.ndarray:
    """Return the force of a step of 0.6 s, with the blow of the heel, N."""
    phase = np.clip((time - begin) / 0.6, 0, 1)
    roll = weight * np.sin(np.pi * phase) ** 0.5 * (1 - 0.25 * np.sin(np.pi * phase) ** 8)
    return np.asarray(roll + half_sine(time, begin, 0.6 * weight, 0.025))


def disturbed(kind: str) -> tuple[list[Pulse], list[Note]]:
    """Return the search in a record with a disturbance before the drops."""
    time, force = three_drops()
    if kind == "footsteps":
        force += footstep(time, 1.0) + footstep(time, 2.1)
    elif kind == "handling":
        random = np.random.default_rng(9)
        for begin in random.uniform(0.5, 4, 20):
            force += half_sine(time, begin, random.uniform(20, 150), random.uniform(0.005, 0.04))
    elif kind == "man steps off":
        force += 800 * np.clip((2.0 - time) / 0.15, 0, 1)
    elif kind == "taps":
        for begin in (1.0, 2.0, 7.7, 11.0):
            force += half_sine(time, begin, 60 if begin < 2 else 150, 0.006)
    elif kind == "tap between bounces":
        force += half_sine(time, 5.3, 120, 0.008)
    return find_drops(Signal.from_array(force, RATE, "record"))


@pytest.mark.parametrize(
    "kind", ["none", "footsteps", "handling", "man steps off", "taps", "tap between bounces"]
)
def test_only_drops_are_drops(kind: str) -> None:
    drops, ignored = disturbed(kind)
    assert [len(drop.bounces) for drop in drops] == [2, 2, 2]
    for drop, begin in zip(drops, (5.0, 8.5, 12.0), strict=True):
        touch = drop.contact[0] / RATE
        assert touch == pytest.approx(begin, abs=0.004)
        landing = drop.bounces[0].contact[0] / RATE
        assert landing == pytest.approx(begin + 0.72, abs=0.004)
    if kind in {"taps", "tap between bounces"}:
        assert {*codes(ignored)} == {"pulse_ignored"}


def measured(**choice: Any) -> thud.Recording:  # noqa: ANN401
    """Return the recording of the three drops with a choice."""
    _, force = three_drops()
    return thud.read_recording([Signal.from_array(force, RATE, "r")], config=Config(**choice))


def test_drops_are_chosen_by_number_and_time() -> None:
    every = measured()
    onsets = [drop.onset for drop in every.drops]
    assert [round(onset, 2) for onset in onsets] == [5.0, 8.5, 12.0]
    for choice, kept in (
        ({"drops": "1, 3"}, [0, 2]),
        ({"drops": "2-3"}, [1, 2]),
        ({"leave_out": {"2": "touched"}}, [0, 2]),
        ({"begin": 7.0}, [1, 2]),
        ({"end": 11.0}, [0, 1]),
        ({"begin": 7.0, "end": 11.0}, [1]),
    ):
        recording = measured(**choice)
        assert [drop.onset for drop in recording.drops] == pytest.approx([onsets[k] for k in kept])
    left = measured(leave_out={"2": "touched"})
    note = noted(left.notes, "drop_left_out")
    assert (note.value, note.others["reason"]) == (2, "touched")
    assert note.others["time"] == pytest.approx(8.5, abs=0.005)


def test_small_drop_keeps_its_number_and_is_left_out_unless_it_is_chosen() -> None:
    time, force = three_drops(20.0, bounces=1)
    force += half_sine(time, 3.0, 300) + half_sine(time, 14.0, 300) + half_sine(time, 17.0, 1500)
    signal = Signal.from_array(force, RATE, "r")
    for choice, onsets in (
        ({}, [5.0, 8.5, 12.0, 17.0]),
        ({"drops": "2, 6"}, [5.0, 17.0]),
        ({"drops": "1, 5, 6"}, [3.0, 14.0, 17.0]),
        ({"leave_out": {"3": "touched"}}, [5.0, 12.0, 17.0]),
        ({"end": 4.0}, [3.0]),
        ({"begin": 13.0, "end": 15.0}, [14.0]),
    ):
        recording = thud.read_recording([signal], config=Config(**choice))  # type: ignore[arg-type]
        assert [round(drop.onset, 1) for drop in recording.drops] == onsets
    notes = thud.read_recording([signal], config=Config()).notes
    small = [note for note in notes if note.code == "drop_too_small"]
    assert [note.value for note in small] == [1, 5]
    assert [note.others["time"] for note in small] == pytest.approx([3.0, 14.0], abs=0.005)


def test_bounce_is_no_drop_of_a_section_that_begins_before_it() -> None:
    # The first bounce of the drop at 5 s lands at 5.72 s.
    recording = measured(begin=5.4)
    assert [round(drop.onset, 1) for drop in recording.drops] == [8.5, 12.0]
    assert noted(recording.notes, "section_searched").low == 5.4
    bounce = next(note for note in recording.notes if note.code == "bounce_ignored")
    assert bounce.others["time"] == pytest.approx(5.72, abs=0.03)


@pytest.mark.parametrize("instant", [2.0, 8.507])
def test_spike_of_one_sample_hides_no_drop(instant: float) -> None:
    _, force = three_drops()
    force[int(instant * RATE)] += 1e6
    found, _ = find_drops(Signal.from_array(force, RATE, "record"))
    assert [len(drop.bounces) for drop in found] == [2, 2, 2]


def test_drops_left_out_by_an_argument_join_those_of_the_configuration() -> None:
    config = Config(leave_out={"3": "touched"}).updated(leave_out={"1": "noise"})
    assert config.leave_out == {"3": "touched", "1": "noise"}


def test_impossible_restitution_is_a_warning() -> None:
    for scale, is_impossible in ((0.5, True), (1.0, False), (2.0, True)):
        _, force = three_drops(bounces=0)
        signal = Signal.from_array(scale * force, RATE, "r")
        # The impulse is 19.1 N s: with 2.5 kg and 1 m the restitution is 0.68.
        recording = thud.read_recording([signal], config=Config(mass=2.5, height=1.0))
        assert ("restitution_impossible" in codes(recording.notes)) == is_impossible
