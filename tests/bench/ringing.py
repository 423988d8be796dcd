"""How often a plate is said to ring: clean records of all models, and records of ringing plates.

    .venv/bin/python tests/bench/ringing.py [RECORDS [SEED]]    # 1000 of each by default

Noise 20 to 60 dB below the peak, white, pink and brown, with offset, drift and hum, quiet of 5 ms
to 1 s, 8 to 96 kHz; half of the records behind an anti-aliasing filter. Plates: 600 Hz to 0.25 of
the rate, quality 10 to 60. A ringing plate counts as due where it moves the level at 500 Hz by
0.5 dB or makes a further peak.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.signal

import thud
from thud.level.levels import low_pass, peak_count
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    from thud.base.note import Note

sys.path.insert(0, str(Path(__file__).parents[1] / "driver"))
from synthetic import band_limited, make_recording

FINE = 192_000.0
CASES = (
    "rubber_ball_100cm", "rubber_ball_modal", "rubber_ball_fe",
    "rubber_ball_fe_elastic", "rubber_ball_fe_viscous", "measured_modes", "tyre", "tyre_one_mass",
)  # fmt: skip
RATES = (8e3, 16e3, 24e3, 44.1e3, 48e3, 51.2e3, 96e3)
LENGTH = 0.3  # s of ringing


def pulses() -> dict[str, np.ndarray]:
    """Return the force of each model from first touch to release, N, at FINE."""
    time = np.arange(int(0.02 * FINE) + 1) / FINE
    found = {"half sine": 1500 * np.sin(np.pi * time / 0.02)}
    for name in CASES:
        case = thud.read_case(Path(__file__).parents[2] / "inputs" / f"{name}.nml")
        impact = thud.solve(replace(case, sampling=thud.Sampling(FINE, 0.05)))
        found[name] = impact.floor_force[: int(np.ceil(impact.exact_contact_time * FINE)) + 1]
    return found


def felt(force: np.ndarray, frequency: float, quality: float) -> np.ndarray:
    """Return what a plate gives for a force: an oscillator, exact for lines between samples."""
    omega = 2 * np.pi * frequency
    plate = ([omega**2], [1.0, omega / quality, omega**2])
    force = np.concatenate([force, np.zeros(int(LENGTH * FINE))])
    return np.asarray(scipy.signal.lsim(plate, force, np.arange(force.size) / FINE)[1])


def told(force: np.ndarray, rate: float, rng: np.random.Generator) -> list[Note]:
    """Return what is said of ringing in a random record of a force at FINE."""
    if rng.random() < 0.5:
        place = rng.uniform() / rate
        count = int((len(force) / FINE + 4e-3) * rate)
        force = band_limited(force, FINE, rate, np.arange(count) / rate - 2e-3 - place)
        fine = rate
    else:
        fine = FINE
    peak = float(force.max())
    record, _ = make_recording(
        force, fine, rate=rate, noise_db=rng.uniform(20, 60),
        colour=("white", "pink", "brown")[rng.integers(3)], offset=rng.uniform(-0.05, 0.05) * peak,
        drift=rng.uniform(-0.05, 0.05) * peak,
        hum=((50.0, 60.0)[rng.integers(2)], 10 ** rng.uniform(-4, -2) * peak),
        before=float(np.exp(rng.uniform(np.log(0.005), 0))),
        after=float(np.exp(rng.uniform(np.log(0.005), 0))), seed=int(rng.integers(2**31)),
    )  # fmt: skip
    found = thud.read_recording(Signal.from_array(record, rate), height=1.0, mass=2.5)
    return [note for note in found.drops[0].notes if note.code.startswith("plate_rings")]


def is_due(force: np.ndarray, plate: np.ndarray) -> bool:
    """Whether a plate is worth a warning."""
    before, after = (thud.force_exposure_levels(one, FINE)[4] for one in (force, plate))
    peaks = peak_count(low_pass(plate, FINE), FINE)
    return bool(abs(after - before) > 0.5 or peaks > peak_count(low_pass(force, FINE), FINE))


def main() -> None:
    """Print false alarms by model, and how many ringing plates are found."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    known = pulses()
    clean, wrong, seen, due = (Counter[str]() for _ in range(4))
    errors = []
    for seed in range(first, first + count):
        rng = np.random.default_rng(seed)
        name = list(known)[seed % len(known)]
        force, rate = known[name], RATES[rng.integers(len(RATES))]
        try:
            said = told(force, rate, rng)
            clean[name] += 1
            wrong[name] += bool(said)
            frequency, quality = rng.uniform(600, 0.25 * rate), rng.uniform(10, 60)
            plate = felt(force, frequency, quality)
            said = told(plate, rate, rng)
        except thud.InputError:
            continue
        kind = "due" if is_due(force, plate) else "slight"
        due[kind] += 1
        seen[kind] += bool(said)
        if said:
            errors.append(said[0].others["frequency"] / frequency - 1)
    print("false alarms:", *(f"{name} {wrong[name]} of {clean[name]};" for name in known))
    print(f"in all {sum(wrong.values())} of {sum(clean.values())}")
    print("plates found:", *(f"{kind} {seen[kind]} of {due[kind]};" for kind in due))
    far = np.quantile(np.abs(errors), [0.5, 0.95, 1.0])
    print("error of the frequency, median, 95 %, largest:", *(f"{100 * one:.2g} %" for one in far))


if __name__ == "__main__":
    main()
