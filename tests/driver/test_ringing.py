"""Ringing of a plate is remarked, and nothing else is taken for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.signal
from conftest import REPOSITORY
from synthetic import coloured_noise

import thud
from thud.recordings.config import read_config
from thud.recordings.plate import Plate
from thud.recordings.ringing import tell_ringing

RATE = 48_000.0
QUIET = int(0.1 * RATE)


@pytest.fixture(scope="module")
def force() -> np.ndarray:
    """Return the force of the ball of finite elements, N, without its zeros."""
    case = thud.read_case(REPOSITORY / "inputs/rubber_ball_fe.nml")
    impact = thud.solve_case(replace(case, sampling=thud.Sampling(RATE, 0.03)))
    return impact.floor_force


def said(force: np.ndarray, colour: str = "white", deviation: float = 2.0) -> tuple[str, ...]:
    """Return what is said of ringing in a force with noise, N."""
    noise = coloured_noise(len(force), RATE, deviation, colour, np.random.default_rng(1))
    (drop,) = thud.Recording.from_array(force + noise, RATE, height=1.0, mass=2.5).drops
    return tuple(remark for remark in drop.remarks if "ring" in remark)


@pytest.mark.parametrize("colour", ["white", "pink", "brown"])
def test_clean_record_does_not_ring(force: np.ndarray, colour: str) -> None:
    assert not said(np.pad(force, QUIET), colour)


@pytest.mark.parametrize(("frequency", "quality"), [(1100.0, 25.0), (1600.0, 40.0)])
def test_plate_that_is_not_stated_was_counted_as_peaks_without_a_word(
    force: np.ndarray, frequency: float, quality: float
) -> None:
    omega = 2 * np.pi * frequency
    plate = ([omega**2], [1.0, omega / quality, omega**2])
    force = np.pad(force, QUIET)
    felt = scipy.signal.lsim(plate, force, np.arange(len(force)) / RATE)[1]
    (told,) = said(felt)
    found = float(told.split(" Hz")[0].rpartition(" ")[2])
    assert found == pytest.approx(frequency, rel=0.005)
    assert "[plate]" in told


def test_tone_of_the_quiet_is_no_ringing(force: np.ndarray) -> None:
    force = np.pad(force, QUIET)
    assert not said(force + 10 * np.sin(2 * np.pi * 1100 * np.arange(len(force)) / RATE))


def test_plate_that_is_stated_wrongly_rings_on() -> None:
    folder = REPOSITORY / "inputs/recordings"
    config = read_config(folder / "lab.toml")
    assert config.plate
    for stated, expected in ((1100.0, 0), (1600.0, 1)):
        changed = replace(config, plate=replace(config.plate, f0=stated))
        (drop,) = thud.read_recording(folder / "drop_1.wav", config=changed).drops
        remarks = [remark for remark in drop.remarks if "ring" in remark]
        assert len(remarks) == expected
        assert all("[plate]" in remark for remark in remarks)


def test_short_quiet_tells_nothing(force: np.ndarray) -> None:
    recording = thud.Recording.from_array(np.pad(force, QUIET), RATE)
    contact = recording.drops[0].contact
    short = replace(contact, force=contact.force[: contact.gate[1] - contact.span[0] + 100])
    assert tell_ringing(short, Plate(1100.0, 25.0)) == ()
