"""Tones in the background of a recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import codes, noted

import thud
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    from thud.base.note import Note

RATE = 48e3
TIME = np.arange(round(0.8 * RATE)) / RATE
PHASE = np.clip((TIME - 0.3) / 0.018, 0, 1)
NOISE = np.random.default_rng(4).normal(0, 0.3, len(TIME))
FORCE = 1500 * np.sin(np.pi * PHASE) ** 1.3 + NOISE


def notes(force: np.ndarray) -> list[Note]:
    """Return the notes on tones of a recording."""
    (drop,) = thud.read_recording(Signal.from_array(force, RATE)).drops
    return [note for note in drop.notes if note.code == "tone_removed"]


@pytest.mark.parametrize(
    "tones", [{350.0: 3.0}, {550.3: 1.0}, {350.0: 3.0, 450.0: 2.0, 911.7: 1.0}]
)
def test_tones_are_removed(tones: dict[float, float]) -> None:
    waves = (size * np.sin(2 * np.pi * f * TIME + f) for f, size in tones.items())
    force = FORCE + sum(waves)
    found = notes(force)
    assert len(found) == len(tones)
    for note, (frequency, size) in zip(found, tones.items(), strict=True):
        assert note.others["frequency"] == pytest.approx(frequency, abs=0.6)
        assert note.value == pytest.approx(size, rel=0.02)
    expected = thud.read_recording(Signal.from_array(FORCE, RATE))
    result = thud.read_recording(Signal.from_array(force, RATE))
    np.testing.assert_allclose(result.levels(), expected.levels(), rtol=0, atol=0.03)


def test_levels_without_noise_and_tones_have_no_notes() -> None:
    assert not notes(FORCE)
    assert not notes(FORCE - NOISE)
    # The noise at 306 Hz is below that around it.
    draws = np.random.default_rng(81).normal(0, 0.3, 30720)
    time = np.arange(len(draws)) / 51.2e3
    pulse = 1500 * np.sin(np.pi * np.clip((time - 0.2) / 0.018, 0, 1))
    (drop,) = thud.read_recording(Signal.from_array(pulse + draws, 51.2e3)).drops
    assert "tone_removed" not in codes(drop.notes)


@pytest.mark.parametrize("frequency", [400.0, 1100.0])
@pytest.mark.parametrize("quality", [10, 100])
def test_ringing_after_the_contact_is_no_tone(frequency: float, quality: float) -> None:
    late = np.maximum(TIME - 0.3, 0)
    ringing = np.exp(-late * np.pi * frequency / quality) * np.sin(2 * np.pi * frequency * late)
    assert not notes(FORCE + 30 * ringing)


def test_tone_that_begins_or_changes_at_the_contact_stays() -> None:
    wave = 3 * np.sin(2 * np.pi * 450 * TIME)
    is_after = TIME > 0.3
    assert not notes(FORCE + wave * is_after)
    assert not notes(FORCE + wave * np.where(is_after, 0.5, 1.0))
    assert not notes(FORCE + wave * np.where(is_after, -1.0, 1.0))


def test_noise_of_a_band_and_hum_are_no_tones() -> None:
    spectrum = np.fft.rfft(np.random.default_rng(5).normal(0, 3, len(TIME)))
    frequency = np.fft.rfftfreq(len(TIME), 1 / RATE)
    spectrum *= (frequency > 300) & (frequency < 700)
    assert not notes(FORCE + np.fft.irfft(spectrum, len(TIME)))
    assert not notes(FORCE + sum(30 / k * np.sin(2 * np.pi * 50 * k * TIME) for k in range(1, 6)))


@pytest.mark.parametrize("frequency", [5600.0, 6400.0, 11600.0])
def test_tones_beyond_the_recorded_band_stay(frequency: float) -> None:
    assert not notes(FORCE + 20 * np.sin(2 * np.pi * frequency * TIME))


def test_held_samples_are_found_beside_a_tone() -> None:
    force = FORCE + 3 * np.sin(2 * np.pi * 450 * TIME)
    force[14800:14820] = force[14800]
    (drop,) = thud.read_recording(Signal.from_array(force, RATE)).drops
    tone = noted(drop.notes, "tone_removed")
    assert tone.others["frequency"] == pytest.approx(450, abs=0.5)
    assert tone.value == pytest.approx(3, rel=0.05)
    assert noted(drop.notes, "jump").value == pytest.approx(13.5, abs=0.5)
