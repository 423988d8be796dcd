"""Records with faults that nobody states: what each does to the samples of the recorder model.

Run ``.venv/bin/python tests/validation/recorder_faults.py FIRST_SEED COUNT``.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.signal

sys.path.insert(0, str(Path(__file__).parent))
from recorder_model import KINDS, Ball, Chain, Scene, drop_pulse, electric, plate_force

from thud.base.errors import InputError
from thud.recordings.config import config_from
from thud.recordings.recording import read_recording
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    from collections.abc import Callable

    from recorder_model import Array

    # Values, N, samples per second, first and stop index of the contact, random numbers.
    Fault = Callable[[Array, float, int, int, np.random.Generator], Array]

# Errors that matter: dB of a level, s of the contact time.
LEVEL, CONTACT = 0.2, 2e-4
# Stated where a condition is not about it.
STATED = {
    "mass_uncertainty": 0.0, "height_uncertainty": 0.0, "calibration_uncertainty": 0.0,
    "plate": {"flat_limit": 20e3}, "filter": {"kind": "none"},
}  # fmt: skip


def swapped(values: Array, rate: float, first: int, stop: int, rng: np.random.Generator) -> Array:
    """Exchange two packets of 2 ms of the contact."""
    size = int(2e-3 * rate)
    start = int(rng.integers(first, stop - 2 * size))
    values[start : start + 2 * size] = np.roll(values[start : start + 2 * size], size)
    return values


def held(length: float) -> Fault:
    """Hold the sample before the touch, or at a random instant around it."""

    def fault(values: Array, rate: float, first: int, stop: int, rng: np.random.Generator) -> Array:
        del stop
        start = first - int(rng.uniform(0.1, 0.9) * length * rate)
        values[start : start + int(length * rate)] = values[start]
        return values

    return fault


def drawn(length: float) -> Fault:
    """Draw a line over a time, s, of the contact."""

    def fault(values: Array, rate: float, first: int, stop: int, rng: np.random.Generator) -> Array:
        size = int(length * rate)
        start = int(rng.integers(first - size // 2, stop - size // 2))
        values[start : start + size] = np.linspace(values[start], values[start + size], size)
        return values

    return fault


def outside_zero(
    values: Array, rate: float, first: int, stop: int, rng: np.random.Generator
) -> Array:
    """Set zero outside the contact with its margins."""
    del rng
    values[: first - int(2e-3 * rate)] = 0.0
    values[stop + int(3e-3 * rate) :] = 0.0
    return values


def gate(values: Array, rate: float, first: int, stop: int, rng: np.random.Generator) -> Array:
    """Set zero what is below 40 N."""
    del rate, first, stop, rng
    return np.where(np.abs(values) < 40.0, 0.0, values)


def needles(values: Array, rate: float, first: int, stop: int, rng: np.random.Generator) -> Array:
    """Add a sample of 60 N each 10 ms."""
    del first, stop
    period = int(0.01 * rate)
    values[int(rng.integers(period)) :: period] += 60.0
    return values


def missing_codes(bit: int) -> Fault:
    """Round to 1 N without a bit."""

    def fault(values: Array, rate: float, first: int, stop: int, rng: np.random.Generator) -> Array:
        del rate, first, stop, rng
        codes = np.rint(values).astype(int)
        return (codes & ~(1 << bit)).astype(float)

    return fault


def growing_noise(share: float) -> Fault:
    """Add noise in proportion to the force."""

    def fault(values: Array, rate: float, first: int, stop: int, rng: np.random.Generator) -> Array:
        del rate, first, stop
        return values * (1 + share * rng.normal(size=len(values)))

    return fault


def multiplexed(
    values: Array, rate: float, first: int, stop: int, rng: np.random.Generator
) -> Array:
    """Take each sample from the next of four cells."""
    del rate, first, stop
    shares = 1 + rng.uniform(-0.3, 0.3, 4)
    return values * np.resize(4 * shares / shares.sum(), len(values))


def drawn_up(values: Array, rate: float, first: int, stop: int, rng: np.random.Generator) -> Array:
    """Take samples at 2 kHz and lines between them."""
    del first, stop
    time = np.arange(len(values)) / rate
    coarse = np.arange(rng.uniform(0, 5e-4), time[-1], 5e-4)
    return np.interp(time, coarse, np.interp(coarse, time, values))


def smoothed(kind: str) -> Fault:
    """Smooth the samples with the noise."""

    def fault(values: Array, rate: float, first: int, stop: int, rng: np.random.Generator) -> Array:
        del first, stop, rng
        if kind == "mean":
            width = int(1e-3 * rate)
            return np.convolve(values, np.full(width, 1 / width), mode="same")
        sections = scipy.signal.butter(4, 700.0, fs=rate, output="sos")
        return np.asarray(scipy.signal.sosfiltfilt(sections, values))

    return fault


def rounded_off(limit: float) -> Fault:
    """Let the amplifier saturate softly."""

    def fault(values: Array, rate: float, first: int, stop: int, rng: np.random.Generator) -> Array:
        del rate, first, stop, rng
        return limit * np.tanh(values / limit)

    return fault


@dataclass(frozen=True)
class Condition:
    """A fault, the recorder, and what is stated beside the fault."""

    fault: Fault | None = None
    chain: Chain = field(default_factory=lambda: Chain(25_600.0))
    scene: Scene = field(default_factory=lambda: Scene(before=0.3, after=0.2, bounces=1))
    stated: tuple[str, ...] = tuple(STATED)


UNTOLD_FILTER = tuple(key for key in STATED if key != "filter")
QUIET = Chain(25_600.0, noises=((0.3, 0.0),), offset=0.0)
CONDITIONS = {
    "none": Condition(),
    "none, filter not stated": Condition(stated=UNTOLD_FILTER),
    "packets of 2 ms exchanged": Condition(swapped),
    "3 ms held over the touch": Condition(held(3e-3)),
    "zero outside, offset 12 N": Condition(outside_zero, replace(QUIET, offset=12.0)),
    "zero outside, offset 60 N": Condition(outside_zero, replace(QUIET, offset=60.0)),
    "gate of 40 N": Condition(gate, QUIET),
    "needles of 60 N": Condition(needles),
    "missing codes of 8 N": Condition(missing_codes(3), QUIET),
    "missing codes of 32 N": Condition(missing_codes(5), QUIET),
    "noise of 1 % of the force": Condition(growing_noise(0.01)),
    "noise of 5 % of the force": Condition(growing_noise(0.05)),
    "multiplexed cells": Condition(multiplexed, stated=UNTOLD_FILTER),
    "multiplexed cells, 5 kHz": Condition(multiplexed, Chain(5e3), stated=UNTOLD_FILTER),
    "2 kHz drawn up to 48 kHz": Condition(drawn_up, Chain(48e3), stated=UNTOLD_FILTER),
    "mean over 1 ms": Condition(smoothed("mean"), stated=UNTOLD_FILTER),
    "low-pass of 700 Hz": Condition(smoothed("low-pass"), stated=UNTOLD_FILTER),
    "amplifier up to 900 N": Condition(rounded_off(900.0)),
    "amplifier up to 500 N": Condition(rounded_off(500.0)),
    "line over 3 ms": Condition(drawn(3e-3)),
}  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """What came of a record: errors and expanded uncertainties, dB and last s, and codes."""

    errors: tuple[float, ...] = ()
    expanded: tuple[float, ...] = ()
    warnings: tuple[str, ...] = ()
    refusal: str = ""

    @property
    def material(self) -> list[int]:
        """Indices of the errors that matter and exceed their expanded uncertainty."""
        limits = (*[LEVEL] * (len(self.errors) - 1), CONTACT)
        return [
            k
            for k, (error, u) in enumerate(zip(self.errors, self.expanded, strict=True))
            if abs(error) > max(limits[k], u)
        ]

    @property
    def silent(self) -> list[int]:
        """Indices of those that no warning tells of."""
        return [] if self.warnings else self.material


def record(name: str, seed: int) -> tuple[Array, float, Ball, tuple[float, ...]]:
    """Return a record, N, its rate, the ball and the true levels, dB, and contact time, s."""
    condition = CONDITIONS[name]
    rng = np.random.default_rng([seed, list(CONDITIONS).index(name)])
    ball = Ball(restitution=rng.uniform(0.72, 0.85), deformation=rng.uniform(0, 0.003))
    pulse, truth = drop_pulse(KINDS[seed % len(KINDS)], ball, rng)
    chain, scene = condition.chain, condition.scene
    force = plate_force(pulse, ball, chain, scene, rng)
    first = int(scene.before * chain.rate) + 1
    stop = int((scene.before + pulse.duration) * chain.rate) + 1
    values = electric(force, chain, scene, pulse.duration, rng)
    if condition.fault:
        values = condition.fault(values, chain.rate, first, stop, rng)
    return values, chain.rate, ball, (*truth.levels, truth.contact_time)


# Codes of warnings of records without a fault, or not of its cause.
GENERAL = {"no_bounce", "peaks_unknown", "plate_assumed", "share_assumed", "filter_assumed"}
# Restitutions that differ concern the force from 1 % of an impulse on.
MIN_DIFFERENCE = 0.02


def measure(name: str, seed: int) -> Outcome:
    """Record and measure a drop, and compare it with the truth."""
    values, rate, ball, true = record(name, seed)
    stated = {key: STATED[key] for key in CONDITIONS[name].stated}
    config = config_from({"mass": ball.mass, "height": ball.height, **stated})
    try:
        recording = read_recording([Signal.from_array(values, rate, "record")], config=config)
    except InputError as error:
        return Outcome(refusal=str(error))
    estimates = (*recording.level_estimates(), recording.estimates["contact_time"])
    errors = [
        min(e.value - t, 0.0) if e.upper_bound else e.value - t
        for e, t in zip(estimates, true, strict=True)
    ]
    said = tuple(
        note.code
        for note in recording.notes
        if note.is_warning
        and note.code not in GENERAL
        and not (note.code == "restitutions_differ" and abs(note.value) < MIN_DIFFERENCE)
    )
    return Outcome(tuple(map(float, errors)), tuple(e.expanded for e in estimates), said)


def main(first: int, count: int) -> int:
    """Print a line for each condition, and return the number of silent and material values."""
    total = hidden = 0
    for name in CONDITIONS:
        outcomes = [measure(name, seed) for seed in range(first, first + count)]
        silent = sum(len(outcome.silent) for outcome in outcomes)
        pairs = [pair for o in outcomes for pair in zip(o.errors, o.expanded, strict=True)]
        total, hidden = total + len(pairs), hidden + silent
        inside = 100 * np.mean([abs(error) <= u for error, u in pairs] or [1.0])
        cells = (
            f"{silent} silent of {len(pairs)}",
            f"{sum(len(outcome.material) for outcome in outcomes)} material",
            f"{sum(bool(outcome.refusal) for outcome in outcomes)} of {count} refused",
            f"{sum(bool(outcome.warnings) for outcome in outcomes)} warned",
            f"{inside:.0f} % inside",
        )
        sys.stdout.write(f"{name:28s} {', '.join(cells)}\n")
    sys.stdout.write(f"{hidden} of {total} values silent and material\n")
    return hidden


if __name__ == "__main__":
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        sys.exit(bool(main(*map(int, sys.argv[1:] or ("0", "3")))))
