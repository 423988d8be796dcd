"""Disturbances of a recording: noted, removed, or in the uncertainty of what is measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import scipy.signal
from conftest import codes
from recording_files import noisy
from synthetic import felt, half_sine, recording_of

from thud.recordings.instruments import Plate, RecorderFilter

if TYPE_CHECKING:
    import thud

RATE = 48e3
TIME = np.arange(-0.3, 0.4, 1 / RATE)
PULSE = 1500 * np.sin(np.pi * np.clip(TIME / 0.02, 0, 1)) ** 1.3
NOISE = np.random.default_rng(4).normal(0, 0.3, len(TIME))
STATED: dict[str, Any] = {
    "plate": Plate(flat_limit=1e5), "filter": RecorderFilter("none"), "mass": 2.5, "height": 1.0,
    "mass_uncertainty": 0.002, "height_uncertainty": 0.002, "calibration_uncertainty": 0.002,
}  # fmt: skip
AFTER = TIME > 0
# Resonances and qualities.
RINGS = (400, 25), (400, 100), (1100, 100)
# Hum of less, N, may be noted where something else is slow.
SMALL = 0.5
# A limit of the errors of levels, dB: their intervals, and none.
INTERVAL, NONE = -1.0, np.inf


def wave(frequency: float, size: float, phase: float = 1.0) -> np.ndarray:
    return size * np.sin(2 * np.pi * frequency * TIME + phase)


def tone(frequency: float, size: float) -> dict[str, Any]:
    return {"code": "tone_removed", "value": size, "frequency": frequency}


def hum(frequency: float) -> Any:  # noqa: ANN401
    """Return a row of hum with harmonics that fall as their number."""
    sizes = 30 / np.arange(1, 6)
    force = np.sum([wave(k * frequency, size) for k, size in enumerate(sizes, 1)], axis=0)
    return row(f"hum {frequency}", force, [{"code": "hum_removed", "frequency": frequency}], 0.05)


def ringing(frequency: float, quality: float) -> np.ndarray:
    late = np.maximum(TIME, 0)
    decay = np.exp(-late * np.pi * frequency / quality)
    return 30 * decay * np.sin(2 * np.pi * frequency * late)


def rings(name: str, force: np.ndarray, frequency: float, quality: float) -> Any:  # noqa: ANN401
    note = {"code": "plate_rings", "frequency": frequency, "quality": quality}
    return row(name, force, [{"code": "plate_estimated"}, note])


def plate(frequency: float, quality: float) -> Any:  # noqa: ANN401
    """Return a row of a plate that is not stated, whose ringing changes 500 Hz."""
    force = felt(PULSE, RATE, Plate(frequency, quality)) - PULSE
    return rings(f"plate {frequency} {quality}", force, frequency, quality)


def step(size: float, instant: float) -> Any:  # noqa: ANN401
    """Return a row of a step of the offset, which is a jump away from touch and release."""
    notes: list[dict[str, Any]] = [{"code": "offset_step", "value": size}]
    if abs(size) > 50 or instant > 0.005:
        notes.insert(0, {"code": "jump"})
    return row(f"step {size} {instant}", size * (instant < TIME), notes)


def narrow() -> np.ndarray:
    """Return noise of 300 to 700 Hz."""
    spectrum = np.fft.rfft(np.random.default_rng(5).normal(0, 3, len(TIME)))
    frequency = np.fft.rfftfreq(len(TIME), 1 / RATE)
    return np.fft.irfft(spectrum * ((frequency > 300) & (frequency < 700)), len(TIME))


def droop(tau: float) -> np.ndarray:
    """Return what a high-pass of a time constant, s, adds to the pulse."""
    return np.asarray(scipy.signal.lfilter([-1 / tau / RATE], [1, -1 + 1 / tau / RATE], PULSE))


def held() -> np.ndarray:
    """Return a tone and the change of 20 samples that are held."""
    force = PULSE + NOISE + wave(450, 3)
    force[14800:14820] = force[14800]
    return force - PULSE - NOISE


def row(name: str, disturbance: np.ndarray, notes: Any, limit: float = INTERVAL) -> Any:  # noqa: ANN401
    """Return a disturbance, N, the notes on it, and the limit of the errors of the levels."""
    return pytest.param(disturbance, notes, limit, id=name)


@pytest.fixture(scope="module")
def truth() -> thud.Recording:
    """Return the recording without a disturbance."""
    return recording_of(PULSE + NOISE, RATE, **STATED)


@pytest.mark.parametrize(
    ("disturbance", "notes", "limit"),
    [
        row("no noise", -NOISE, [], 0.03),
        row("offset", np.full(len(TIME), -30.0), [], 0.01),
        row("drift", 100 * TIME, [{"code": "drift_removed", "value": 100}], 0.01),
        hum(50),
        hum(60),
        row("tone", wave(350, 3), [tone(350, 3)], 0.03),
        row("small tone", wave(550.3, 1), [tone(550.3, 1)], 0.03),
        # In the quiet before the contact too, it is no ringing.
        row("high tone", wave(1100, 10), [tone(1100, 10)], 0.03),
        row("three tones", wave(350, 3) + wave(450, 2) + wave(911.7, 1),
            [tone(350, 3), tone(450, 2), tone(911.7, 1)], 0.03),
        rings("tone that begins", wave(450, 3) * AFTER, 450, 1414),
        row("tone that falls", wave(450, 3) * np.where(AFTER, 0.5, 1.0), [], NONE),
        row("tone that turns", wave(450, 3) * np.where(AFTER, -1.0, 1.0), [], NONE),
        # Beyond the recorded band, where they move the edges of the contact.
        *(row(f"tone of {f}", wave(f, 20), [], NONE) for f in (5600, 6400, 11600)),
        row("narrow noise", narrow(), []),
        *(rings(f"ring {f} {q}", ringing(f, q), f, q) for f, q in RINGS),
        plate(1100, 25),
        plate(1300, 10),
        plate(1600, 40),
        *(step(size, instant) for size in (15.0, -60.0) for instant in (0.002, 0.01, 0.017)),
        row("tremor", wave(6, 20), []),
        row("droop of 0.2 s", droop(0.2), []),
        row("droop of 2 s", droop(2.0), []),
        row("constant before", -NOISE * (TIME < -0.15), [{"code": "constant_background"}]),
        row("held samples beside a tone", held(), [{"code": "jump"}, tone(450, 3)], NONE),
    ],
)  # fmt: skip
def test_disturbance_is_noted_and_in_the_interval(
    disturbance: np.ndarray, notes: list[dict[str, Any]], limit: float, truth: thud.Recording
) -> None:
    recording = recording_of(PULSE + NOISE + disturbance, RATE, **STATED)
    found = [
        note.others | {"code": note.code, "value": note.value}
        for note in recording.notes
        if note.code != "offset_removed" and (note.code != "hum_removed" or note.value > SMALL)
    ]
    assert [note["code"] for note in found] == [note["code"] for note in notes]
    for note, expected in zip(found, notes, strict=True):
        for key, value in expected.items():
            assert note[key] == (value if key == "code" else pytest.approx(value, rel=0.02)), key
    for level, right in zip(recording.level_estimates(), truth.levels(), strict=True):
        assert abs(level.value - right) < (1.1 * level.expanded if limit == INTERVAL else limit)
    for name in ("contact_time", "peak_force", "impulse"):
        estimate, right = (getattr(one.drops[0], name) for one in (recording, truth))
        assert abs(estimate.value - right.value) < right.expanded + estimate.expanded or limit > 1


def test_step_of_the_offset_widens_what_is_measured(truth: thud.Recording) -> None:
    (drop,) = recording_of(PULSE + NOISE + 15 * (TIME > 0.002), RATE, **STATED).drops
    for name, ratio in (("contact_time", 1), ("peak_force", 5), ("impulse", 5)):
        wider, narrower = (getattr(one, name).uncertainty for one in (drop, truth.drops[0]))
        assert wider > ratio * narrower


def test_quiet_next_to_little_noise_at_a_frequency_is_no_tone() -> None:
    # The noise at 306 Hz is below that around it.
    force = noisy(half_sine(51.2e3, 0.2, 30720, duration=0.018), 0.3, 81)
    assert "tone_removed" not in codes(recording_of(force, 51.2e3).notes)
