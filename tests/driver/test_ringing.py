"""Ringing of a plate raises a warning, and nothing else is taken for it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import REPOSITORY, codes
from synthetic import coloured_noise, make_drop, recording_of

import thud
from thud.recordings.config import read_config
from thud.recordings.instruments import Chain, Plate
from thud.recordings.ringing import find_ringing

if TYPE_CHECKING:
    from thud.recordings.contact import Contact

RATE = 48_000.0
PLATE = Plate(1600.0, 30.0)


@pytest.mark.slow
def test_clean_record_does_not_ring() -> None:
    case = thud.read_case(REPOSITORY / "inputs/rubber_ball_fe.nml")
    impact = thud.solve(replace(case, sampling=thud.Sampling(RATE, 0.03)))
    force = np.pad(impact.floor_force, int(0.1 * RATE))
    for colour in ("white", "pink", "brown"):
        noise = coloured_noise(len(force), RATE, 2.0, colour, np.random.default_rng(1))
        found = recording_of(force + noise, RATE, height=1.0, mass=2.5)
        assert "plate_rings" not in codes(found.notes)


def test_plate_that_is_stated_wrongly_rings_on() -> None:
    folder = REPOSITORY / "inputs/recordings"
    config = read_config(folder / "lab.toml")
    assert config.plate
    for stated, expected in ((1100.0, 0), (1600.0, 1)):
        changed = replace(config, plate=replace(config.plate, f0=stated))
        (drop,) = thud.read_recording(folder / "drop_1.wav", config=changed).drops
        assert codes(drop.notes).count("plate_rings_differently") == expected


VARIANCES = np.array([4e-5, 0.0, 0.0, 0, 0])


def rung(
    amplitude: float, frequency: float, decay: float = 0.008, variances: np.ndarray = VARIANCES
) -> Contact:
    """Return a contact of 1500 N behind the gate of which an oscillation dies away."""
    contact = make_drop(0.0, RATE).contact
    force = contact.force + np.random.default_rng(3).normal(scale=1.0, size=len(contact.force))
    time = np.arange(len(force) - contact.gate[1]) / RATE
    wave = amplitude * np.exp(-time / decay) * np.cos(2 * np.pi * frequency * time + 0.4)
    force[contact.gate[1] :] += wave
    background = replace(contact.background, variances=variances)
    return replace(contact, force=force, background=background)


def is_found(contact: Contact, plate: Plate | None = None) -> bool:
    """Return whether ringing is found in a contact, that of a corrected plate if any."""
    return find_ringing(contact, Chain((plate,)) if plate else None) is not None


@pytest.mark.parametrize("decay", [0.002, 0.0036])
def test_soft_release_is_not_fitted_in_place_of_the_ringing(decay: float) -> None:
    """A release of 1000 N, which brown noise explains, had a frequency of 290 Hz."""
    contact = rung(20.0, 3700.0, variances=np.array([4e-5, 0.0, 1000.0, 0, 0]))
    late = np.arange(len(contact.force) - contact.gate[1]) / RATE
    release = np.pad(1000 * np.exp(-late / decay), (contact.gate[1], 0))
    ringing = find_ringing(replace(contact, force=contact.force + release))
    assert ringing is not None
    assert ringing.frequency == pytest.approx(3700, rel=0.02)


@pytest.mark.parametrize("frequency", [907.3, 1100.3, 3999.9])
@pytest.mark.parametrize("plate", [None, PLATE])
def test_free_oscillation_is_described_by_frequency_and_amplitude(
    frequency: float, plate: Plate | None
) -> None:
    """Noise of 1 N makes an amplitude uncertain by sqrt(2/n) and a frequency by its own slope."""
    # One of the decays that are tried, 8 ms after a pause of a millisecond.
    ringing = find_ringing(rung(20.0, frequency), Chain((plate,)) if plate else None)
    assert ringing is not None
    count = 0.008 * RATE / 2
    error = 0.5 + 1 / 20 / 0.008 / np.sqrt(count)
    assert ringing.frequency == pytest.approx(frequency, abs=error)
    expected = 20 * np.exp(-1e-3 / 0.008)
    assert ringing.amplitude == pytest.approx(expected, abs=4 * np.sqrt(2 / count) + 0.5)


@pytest.mark.parametrize(("plate", "fraction"), [(None, 3e-4), (PLATE, 1e-3)])
@pytest.mark.parametrize("factor", [0.93, 1.07])
def test_ringing_has_a_fraction_of_the_peak(
    plate: Plate | None, fraction: float, factor: float
) -> None:
    """Of 1500 N, more where a plate is corrected; without noise, which the background has."""
    amplitude = factor * fraction * 1500 * np.exp(1e-3 / 0.008)
    contact = rung(amplitude, 1000.0, variances=np.array([1e-9, 0.0, 0.0, 0, 0]))
    force = contact.force - np.random.default_rng(3).normal(scale=1.0, size=len(contact.force))
    assert is_found(replace(contact, force=force), plate) == (factor > 1)


@pytest.mark.parametrize(
    ("frequency", "decay", "expected"),
    [
        # Three oscillations while it falls to 1/e, pi f d; from 200 Hz to 0.3 of the rate.
        (3.2 / np.pi / 0.004, 0.004, True), (2.8 / np.pi / 0.004, 0.004, False),
        (190.0, 0.016, False), (215.0, 0.016, True), (14_300.0, 0.016, True),
        (14_500.0, 0.016, False),
    ],
)  # fmt: skip
def test_ringing_has_oscillations_in_a_band(
    frequency: float, decay: float, *, expected: bool
) -> None:
    assert is_found(rung(200.0, frequency, decay)) == expected


def test_ringing_needs_four_milliseconds_behind_a_pause() -> None:
    whole = rung(20.0, 1000.0)
    for length, expected in ((4.8e-3, False), (5.2e-3, True)):
        behind = whole.gate[1] + round(length * RATE)
        assert is_found(replace(whole, force=whole.force[:behind])) == expected


def test_ringing_has_four_times_the_energy_of_the_quiet_before() -> None:
    contact = rung(200.0, 1000.0)
    first, stop = contact.gate
    # The same wave before the contact, in reversed time.
    wave = contact.force[stop:][::-1][-first:]
    for part, expected in ((0.45, True), (0.55, False)):
        force = contact.force.copy()
        force[first - len(wave) : first] += part * wave
        assert is_found(replace(contact, force=force)) == expected


@pytest.mark.parametrize("plate", [None, PLATE])
def test_ringing_has_25_times_the_energy_of_the_noise(plate: Plate | None) -> None:
    """The noise is that of the background, times what the correction raises."""
    f, decay = 2800.0, 0.008
    contact = rung(200.0, f)
    after = contact.force[contact.gate[1] + int(1e-3 * RATE) :]
    time = np.arange(len(after)) / RATE
    window = np.exp(-time / decay)
    filtered = abs(np.sum(window * after * np.exp(-2j * np.pi * f * time))) ** 2
    density = filtered / np.sum(window**2) / 25 / (RATE / 2)
    if plate:
        density *= abs(plate.response(np.array([f]))[0]) ** 2
    for factor, expected in ((0.9, True), (1.1, False)):
        variances = factor * density * np.array([0.8, 0.1 * f, 0.1 * f**2, 0, 0])
        background = replace(contact.background, variances=variances)
        assert is_found(replace(contact, background=background), plate) == expected
