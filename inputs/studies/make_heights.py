"""Synthetic records of the fit fit_heights.toml beside this file.

.venv/bin/python inputs/studies/make_heights.py

writes fit_height_*.csv: the force of the ball of inputs/rubber_ball_fe_viscous.nml from three
heights, with 40 ms of background on each side, pink noise and an offset. The calibration of the
record from 1 m is off by 0.6 %.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import thud
from thud.impact.compute import compute

SEED = 5
BACKGROUND = 0.04  # s
NOISE = 5.0  # N, pink from 1 Hz on
# Height, m; offset, N; gain.
DROPS = ((0.1, 3.0, 1.0), (1.0, -7.0, 1.006), (1.6, 12.0, 1.0))
TRUTH = Path(__file__).parents[1] / "rubber_ball_fe_viscous.nml"


def pink(count: int, rate: float, random: np.random.Generator) -> np.ndarray:
    """Return a section of a long pink noise, N."""
    length = 2**18
    frequency = np.fft.rfftfreq(length, 1 / rate)
    shape = np.where(frequency < 1, 0.0, np.maximum(frequency, 1) ** -0.5)
    noise = np.fft.irfft(np.fft.rfft(random.normal(size=length)) * shape, length)
    return NOISE * noise[:count] / noise.std()


def main() -> None:
    """Write the records."""
    truth = thud.read_case(TRUTH)
    random = np.random.default_rng(SEED)
    for height, offset, gain in DROPS:
        case = replace(truth, drop=replace(truth.drop, height=height))
        impact = compute(case)
        rate = impact.sample_rate
        force = impact.floor_force[: round(impact.contact_time * rate) + 1]
        force = np.pad(force, round(BACKGROUND * rate))
        force = gain * force + offset + pink(len(force), rate, random)
        lines = [
            f"# Synthetic: finite elements from {height:g} m, offset {offset:g} N, gain {gain:g},",
            f"# pink noise of {NOISE:g} N; made by make_heights.py.",
            "time_s,force_N",
            *(f"{i / rate:.6f},{value:.2f}" for i, value in enumerate(force)),
        ]
        path = Path(__file__).with_name(f"fit_height_{round(100 * height):03d}.csv")
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
