"""Synthetic recordings of a force plate, and their true values.

.venv/bin/python inputs/recordings/make_recordings.py

drops the ball of ball.nml from scattered heights, adds the plate's first resonance,
offset, drift, mains hum and noise, and writes the files of this directory. Nothing here was
measured.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import scipy.signal
import soundfile

import thud

HERE = Path(__file__).parent
LABEL = "Synthetic recording, not a measurement; made by make_recordings.py of thud"
MODEL = thud.read_case(HERE / "ball.nml")
GRAVITY = MODEL.drop.gravity
# Sample rates of the model and of the files, Hz.
FINE, RATE, RATE_LONG = 192e3, 48000, 24000
# Full scale of the recorder, V, and sensitivity of plate and amplifier: 4 pC/N and 0.5 mV/pC.
FULL_SCALE, VOLTS = 10.0, 4.0 * 0.5e-3
# First resonance of the plate, Hz, and its quality factor.
PLATE_F0, PLATE_Q = 1100.0, 25.0
# Drop height and its scatter, m.
HEIGHT, SCATTER = 1.0, 0.004
# Standard deviation of the noise, offset, drift and its time, hum, N, s.
NOISE, OFFSET, DRIFT, DRIFT_TIME, HUM = 1.5, 12.0, 8.0, 0.8, {50.0: 2.0, 150.0: 0.6}
DURATION, FIRST, EXCERPT = 0.5, 0.15, 0.1
BOUNCES = 2
SEED_HEIGHT, SEED_DROPS, SEED_LONG = 1, 10, 20


def drop(height: float) -> thud.Impact:
    """Return the impact of a drop from a height, m."""
    sampling = dataclasses.replace(MODEL.sampling, sample_rate=FINE, duration=0.03)
    case = dataclasses.replace(
        MODEL, drop=dataclasses.replace(MODEL.drop, height=height), sampling=sampling
    )
    return thud.solve(case)


def felt(force: np.ndarray) -> np.ndarray:
    """Return what the plate gives for a force: an oscillator, exact for lines between samples."""
    omega = 2 * math.pi * PLATE_F0
    plate = ([omega**2], [1.0, omega / PLATE_Q, omega**2])
    ringing = np.concatenate([force, np.zeros(round(0.1 * FINE))])
    return np.asarray(scipy.signal.lsim(plate, ringing, np.arange(ringing.size) / FINE)[1])


def record(
    impacts: list[tuple[float, thud.Impact]], duration: float, rate: int, seed: int
) -> np.ndarray:
    """Return the force that is recorded of impacts at times of first touch, s."""
    random = np.random.default_rng(seed)
    time = np.arange(round(duration * rate)) / rate
    force = OFFSET + DRIFT * np.exp(-time / DRIFT_TIME) + random.normal(scale=NOISE, size=time.size)
    for frequency, size in HUM.items():
        phase = random.uniform(0, 2 * math.pi)
        force += size * np.sin(2 * math.pi * frequency * time + phase)
    for touch, impact in impacts:
        plate = felt(impact.floor_force)
        force += np.interp(time - touch, np.arange(plate.size) / FINE, plate, left=0.0, right=0.0)
    return force


def write_sound(name: str, force: np.ndarray, rate: int, kind: str) -> None:
    """Write the voltage of a force, N, of which compression is negative, as charge plates do."""
    with soundfile.SoundFile(HERE / name, "w", rate, 1, kind) as file:
        file.comment = LABEL
        file.write(-force * VOLTS / FULL_SCALE)


def write_table(name: str, force: np.ndarray, rate: int, begin: float) -> None:
    """Write a force, N, from a time on, s, as a table."""
    first = round(begin * rate)
    rows = (f"{i / rate:.6f},{force[i]:.2f}\n" for i in range(first, first + round(EXCERPT * rate)))
    head = f"# {LABEL}\n# Excerpt of {name.replace('csv', 'wav')}\ntime_s,force_N\n"
    (HERE / name).write_text(head + "".join(rows), encoding="utf-8")


def truth(table: str, touch: float, height: float, impact: thud.Impact) -> str:
    """Return a table of the truth about an impact."""
    impulse = float(np.trapezoid(impact.floor_force, dx=1 / FINE))
    levels = ", ".join(f"{level:.3f}" for level in impact.levels(force="floor"))
    return f"""
{table}
onset = {touch:.7f}
height = {height:.5f}
contact_time = {impact.contact_time_as_recorded:.6f}
restitution = {impact.restitution:.5f}
peak_force = {impact.peak_force:.2f}
impulse = {impulse:.4f}
levels = [{levels}]
"""


def drops_alone(heights: np.ndarray) -> str:
    """Write five files with one drop each; return the truth."""
    told = ""
    for i, height in enumerate(heights, start=1):
        # Not at a sample.
        touch = FIRST + 0.37 * i / RATE
        impact = drop(float(height))
        force = record([(touch, impact)], DURATION, RATE, SEED_DROPS + i)
        write_sound(f"drop_{i}.wav", force, RATE, "PCM_24")
        write_table(f"drop_{i}.csv", force, RATE, FIRST - 0.04)
        told += truth(f'[[drop]]\nfile = "drop_{i}.wav"', touch, float(height), impact)
    return told


def drops_in_one(heights: np.ndarray) -> str:
    """Write a file with three drops and their bounces; return the truth."""
    impacts: list[tuple[float, thud.Impact]] = []
    told = ""
    begin = 0.5
    for height in map(float, heights):
        touch, table, now = begin, '[[drop]]\nfile = "three_drops.flac"', height
        for _ in range(1 + BOUNCES):
            impact = drop(now)
            impacts.append((touch, impact))
            told += truth(table, touch, now, impact)
            # Thrown up with the velocity of release; without air.
            velocity = impact.restitution * math.sqrt(2 * GRAVITY * now)
            touch += impact.contact_time + 2 * velocity / GRAVITY
            table, now = "[[drop.bounces]]", velocity**2 / (2 * GRAVITY)
        # The ball is caught before it comes down again.
        begin = touch + 0.4
    force = record(impacts, begin, RATE_LONG, SEED_LONG)
    write_sound("three_drops.flac", force, RATE_LONG, "PCM_16")
    return told


def main() -> None:
    """Write the recordings and the truth about them."""
    heights = HEIGHT + np.random.default_rng(SEED_HEIGHT).normal(scale=SCATTER, size=8)
    hum = ", ".join(f'"{frequency:g} Hz" = {size}' for frequency, size in HUM.items())
    head = f"""# {LABEL}.
# True values of the recordings in this directory, without the added disturbances: the force on the
# floor of the ball of ball.nml. In the sound files {FULL_SCALE:g} V are full scale and
# compression is negative; the tables are in newtons, {EXCERPT:g} s from {FIRST - 0.04:g} s on.

calibration = "{FULL_SCALE:g} V/FS, 0.5 mV/pC, 4 pC/N"
mass = {MODEL.ball.mass}            # kg
noise = {NOISE}           # N, standard deviation of one sample, white
offset = {OFFSET}         # N
drift = {DRIFT}           # N, falls as exp(-t / drift_time)
drift_time = {DRIFT_TIME}      # s
hum = {{ {hum} }} # N
plate = {{ f0 = {PLATE_F0}, Q = {PLATE_Q} }} # Hz

# Values of each drop: first touch in the sound file, s; height, m; contact time at 1 % of the peak,
# s; restitution; peak, N; impulse, N s; octave levels 31.5 to 500 Hz, dB. Bounces are those of the
# drop above them.
"""
    text = head + drops_alone(heights[:5]) + drops_in_one(heights[5:])
    (HERE / "truth.toml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
