"""An hour at 51.2 kHz with 500 drops, each with two bounces, measured by the command.

    .venv/bin/python tests/bench/recordings.py [MINUTES]    # 60 by default; 9 MB of disk a minute

It prints the time against that of the recording, and the largest memory of the command.
"""

from __future__ import annotations

import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import soundfile

import thud

RATE = 51_200  # Hz
EACH = 7.2  # s between drops
BOUNCES = 2
FULL_SCALE = 5000.0  # N
NOISE, OFFSET, HUM = 2.0, 12.0, 2.0  # N
# Drops of different heights that are taken in turn.
KINDS = 8
CASE = Path(__file__).parents[2] / "inputs/rubber_ball_fe.nml"
COMMAND = "import sys; from thud.cli import main; sys.exit(main())"


def pulses(height: float) -> list[tuple[float, np.ndarray]]:
    """Return time since first touch, s, and force, N, of a drop and its bounces."""
    case = thud.read_case(CASE)
    sampling = replace(case.sampling, sample_rate=float(RATE), duration=0.03)
    found, touch = [], 0.0
    for _ in range(1 + BOUNCES):
        drop = replace(case.drop, height=height)
        impact = thud.solve(replace(case, drop=drop, sampling=sampling))
        found.append((touch, impact.floor_force))
        velocity = impact.restitution * math.sqrt(2 * drop.gravity * height)
        touch += impact.contact_time + 2 * velocity / drop.gravity
        height = velocity**2 / (2 * drop.gravity)
    return found


def write_hour(path: Path, minutes: float) -> int:
    """Write the recording and return the number of its drops."""
    random = np.random.default_rng(7)
    kinds = [pulses(height) for height in 1 + random.normal(scale=0.004, size=KINDS)]
    count = int(60 * minutes / EACH)
    size = round(EACH * RATE)
    hum = HUM * np.sin(2 * np.pi * 50 * np.arange(size) / RATE)
    with soundfile.SoundFile(path, "w", RATE, 1, "PCM_24") as file:
        for k in range(count):
            force = random.normal(OFFSET, NOISE, size) + hum
            first = random.uniform(1, 2)
            for touch, pulse in kinds[k % KINDS]:
                start = round((first + touch) * RATE)
                force[start : start + len(pulse)] += pulse
            file.write(force / FULL_SCALE)
    return count


def main() -> None:
    """Write the recording, measure it and print time and memory."""
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "hour.wav")
        count = write_hour(file, minutes)
        arguments = [sys.executable, "-c", COMMAND, "measure", str(file), "--quiet"]
        arguments += ["--calibration", f"{FULL_SCALE:g} N/FS", "--height", "1", "--mass", "2.5"]
        arguments += ["--output", str(Path(folder, "results"))]
        before = time.monotonic()
        subprocess.run(arguments, check=True)
        wall = time.monotonic() - before
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{count} drops in {minutes:g} min: {wall:.1f} s on {os.cpu_count()} processors, ")
    print(f"{60 * minutes / wall:.0f} times real time; {used.ru_utime + used.ru_stime:.1f} s of")
    print(f"processor time; {used.ru_maxrss / 1024:.0f} MB")


if __name__ == "__main__":
    main()
