"""Ringing of a plate raises a warning, and nothing else is taken for it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import scipy.signal
from conftest import REPOSITORY, codes
from synthetic import coloured_noise, make_drop

import thud
from thud.recordings.config import read_config
from thud.recordings.response import Chain, Plate
from thud.recordings.ringing import find_ringing
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    from thud.base.note import Note
    from thud.recordings.contact import Contact

RATE = 48_000.0
QUIET = int(0.1 * RATE)


def chain(plate: Plate | None) -> Chain | None:
    """Return the chain of a plate."""
    return None if plate is None else Chain((plate,))


@pytest.fixture(scope="module")
def force() -> np.ndarray:
    """Return the force of the ball of finite elements, N, without its zeros."""
    case = thud.read_case(REPOSITORY / "inputs/rubber_ball_fe.nml")
    impact = thud.solve(replace(case, sampling=thud.Sampling(RATE, 0.03)))
    return impact.floor_force


def said(force: np.ndarray, colour: str = "white", deviation: float = 2.0) -> tuple[Note, ...]:
    """Return the notes on ringing in a force with noise, N."""
    noise = coloured_noise(len(force), RATE, deviation, colour, np.random.default_rng(1))
    (drop,) = thud.read_recording(
        Signal.from_array(force + noise, RATE), height=1.0, mass=2.5
    ).drops
    return tuple(note for note in drop.notes if note.code.startswith("plate_rings"))


@pytest.mark.parametrize("colour", ["white", "pink", "brown"])
@pytest.mark.slow
def test_clean_record_does_not_ring(force: np.ndarray, colour: str) -> None:
    assert not said(np.pad(force, QUIET), colour)


@pytest.mark.parametrize(("frequency", "quality"), [(1100.0, 25.0), (1600.0, 40.0)])
def test_plate_that_is_not_stated_raises_a_warning(
    force: np.ndarray, frequency: float, quality: float
) -> None:
    omega = 2 * np.pi * frequency
    plate = ([omega**2], [1.0, omega / quality, omega**2])
    force = np.pad(force, QUIET)
    felt = scipy.signal.lsim(plate, force, np.arange(len(force)) / RATE)[1]
    (told,) = said(felt)
    assert told.code == "plate_rings"
    assert told.others["frequency"] == pytest.approx(frequency, rel=0.005)


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
        assert codes(drop.notes).count("plate_rings_differently") == expected


def test_short_quiet_tells_nothing(force: np.ndarray) -> None:
    recording = thud.read_recording(Signal.from_array(np.pad(force, QUIET), RATE))
    contact = recording.drops[0].contact
    short = replace(contact, force=contact.force[: contact.gate[1] + 100])
    assert find_ringing(short, Chain((Plate(1100.0, 25.0),))) is None


VARIANCES = np.array([4e-5, 0.0, 0.0, 0, 0])


def rung(
    amplitude: float, frequency: float, decay: float, noise: np.ndarray = VARIANCES, **how: float
) -> Contact:
    """Return a contact of 1500 N behind the gate of which an oscillation dies away."""
    contact = make_drop(0.0, RATE, **how).contact  # type: ignore[arg-type]
    rng = np.random.default_rng(3)
    force = contact.force + rng.normal(scale=1.0, size=len(contact.force))
    time = np.arange(len(force) - contact.gate[1]) / RATE
    wave = amplitude * np.exp(-time / decay) * np.cos(2 * np.pi * frequency * time + 0.4)
    force[contact.gate[1] :] += wave
    background = replace(contact.background, variances=noise)
    return replace(contact, force=force, background=background)


@pytest.mark.parametrize("decay", [0.002, 0.0036])
def test_soft_release_is_not_fitted_in_place_of_the_ringing(decay: float) -> None:
    """A release of 1000 N, which brown noise explains, had a frequency of 290 Hz."""
    contact = rung(20.0, 3700.0, 0.008, np.array([4e-5, 0.0, 1000.0, 0, 0]))
    time = np.arange(len(contact.force) - contact.gate[1]) / RATE
    force = contact.force.copy()
    force[contact.gate[1] :] += 1000 * np.exp(-time / decay)
    ringing = find_ringing(replace(contact, force=force))
    assert ringing is not None
    assert ringing.frequency == pytest.approx(3700, rel=0.02)


@pytest.mark.parametrize("frequency", [907.3, 1100.3, 3999.9])
@pytest.mark.parametrize("plate", [None, Plate(1600.0, 30.0)])
def test_free_oscillation_is_told_by_frequency_and_amplitude(
    frequency: float, plate: Plate | None
) -> None:
    """Noise of 1 N makes an amplitude uncertain by sqrt(2/n) and a frequency by its own slope."""
    # One of the decays that are tried, 8 ms after a pause of a millisecond.
    ringing = find_ringing(rung(20.0, frequency, 0.008), chain(plate))
    assert ringing is not None
    found, amplitude = ringing.frequency, ringing.amplitude
    count = 0.008 * RATE / 2
    assert found == pytest.approx(frequency, abs=0.5 + 1 / 20 / 0.008 / np.sqrt(count))
    expected = 20 * np.exp(-1e-3 / 0.008)
    assert amplitude == pytest.approx(expected, abs=4 * np.sqrt(2 / count) + 0.5)


def test_ringing_begins_where_it_is_clear_large_and_long_enough() -> None:
    # As part of the peak of 1500 N: 3e-4 where no plate is stated, 1e-3 of what is corrected.
    quiet = np.array([1e-9, 0.0, 0.0, 0, 0])
    for plate, part in ((None, 3e-4), (Plate(1600.0, 30.0), 1e-3)):
        for factor, expected in ((0.93, False), (1.07, True)):
            contact = rung(factor * part * 1500 * np.exp(1e-3 / 0.008), 1000.0, 0.008, quiet)
            clean = make_drop(0.0, RATE).contact.force
            noise = contact.force[: contact.gate[0]] - clean[: contact.gate[0]]
            force = contact.force.copy()
            # The noise of the record itself is left out.
            force -= np.random.default_rng(3).normal(scale=1.0, size=len(force))
            assert noise.std() > 0.9
            assert bool(find_ringing(replace(contact, force=force), chain(plate))) == expected
    # Three oscillations while it falls to 1/e: pi f d.
    for frequency, expected in ((3.2 / np.pi / 0.004, True), (2.8 / np.pi / 0.004, False)):
        assert bool(find_ringing(rung(200.0, frequency, 0.004))) == expected
    # Between 200 Hz and 0.3 of the rate.
    for frequency, expected in ((190, False), (215, True), (14_300, True), (14_500, False)):
        assert bool(find_ringing(rung(200.0, float(frequency), 0.016))) == expected
    # At least 4 ms of quiet behind a pause of 1 ms.
    whole = rung(20.0, 1000.0, 0.008)
    for length, expected in ((4.8e-3, False), (5.2e-3, True)):
        behind = whole.gate[1] + round(length * RATE)
        assert bool(find_ringing(replace(whole, force=whole.force[:behind]))) == expected


def test_ringing_has_four_times_the_energy_of_the_quiet_before() -> None:
    contact = rung(200.0, 1000.0, 0.008)
    first, stop = contact.gate
    # The same wave before the contact, in reversed time.
    wave = contact.force[stop:][::-1][-first:]
    for part, expected in ((0.45, True), (0.55, False)):
        force = contact.force.copy()
        force[first - len(wave) : first] += part * wave
        assert bool(find_ringing(replace(contact, force=force))) == expected


@pytest.mark.parametrize("plate", [None, Plate(1600.0, 30.0)])
@pytest.mark.parametrize(("factor", "expected"), [(0.9, True), (1.1, False)])
def test_ringing_has_25_times_the_energy_of_the_noise(
    plate: Plate | None, factor: float, *, expected: bool
) -> None:
    """The noise is that of the background, times what the correction raises."""
    f, decay = 2800.0, 0.008
    contact = rung(200.0, f, decay)
    after = contact.force[contact.gate[1] + int(1e-3 * RATE) :]
    time = np.arange(len(after)) / RATE
    window = np.exp(-time / decay)
    filtered = abs(np.sum(window * after * np.exp(-2j * np.pi * f * time))) ** 2
    density = filtered / np.sum(window**2) / 25 / (RATE / 2)
    if plate:
        density *= abs(plate.response(np.array([f]))[0]) ** 2
    variances = factor * density * np.array([0.8, 0.1 * f, 0.1 * f**2, 0, 0])
    background = replace(contact.background, variances=variances)
    assert bool(find_ringing(replace(contact, background=background), chain(plate))) == expected
