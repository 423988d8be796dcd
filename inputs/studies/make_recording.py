"""Synthetic recording of the fits fit_recording*.toml beside this file.

.venv/bin/python inputs/studies/make_recording.py

writes fit_recording.wav: the force of the ball of inputs/rubber_ball_fe_viscous.nml with noise,
offset, drift and hum; the noise comes from NumPy's default generator with the seed below.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import soundfile

import thud

SEED = 3
RATE = 44100  # Hz
LENGTH, TOUCH = 0.25, 0.11  # s
NOISE = 5.0  # N
OFFSET, DRIFT = 12.0, -8.0  # N, N/s
HUM, MAINS = 2.0, 50.0  # N, Hz
TRUTH = Path(__file__).parents[1] / "rubber_ball_fe_viscous.nml"


def main() -> None:
    """Write the recording."""
    impact = thud.solve(thud.read_case(TRUTH))
    time = np.arange(round(LENGTH * RATE)) / RATE
    force = np.random.default_rng(SEED).normal(scale=NOISE, size=len(time))
    force += OFFSET + DRIFT * time + HUM * np.sin(2 * np.pi * MAINS * time)
    first, count = round(TOUCH * RATE), round(impact.contact_time * RATE) + 1
    force[first : first + count] += impact.floor_force[:count]
    # 32 bits hold 7 digits; the values are newtons.
    path = Path(__file__).with_name("fit_recording.wav")
    soundfile.write(path, force.astype(np.float32), RATE, subtype="FLOAT")


if __name__ == "__main__":
    main()
